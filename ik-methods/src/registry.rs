//! The registry: one line per method. Whoever is listed here is in the conformance suite, every bench, every figure and
//! the generated tables.

use crate::baselines::{PenaltyCg, PenaltyLbfgs};
use crate::constrained_qp::ConstrainedQp;
use crate::davies::{self, Davies};
use crate::direct_position::DirectPosition;
use crate::error_integration::ErrorIntegration;
use crate::gauss_newton::GaussNewton;
use crate::null_space_clik::NullSpaceClik;
use crate::reverse_decoupling::formulation::ReverseDecoupling;
use crate::two_slack::TwoSlack;
use ik_core::formulation::Formulation;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::{self, Debug, Display};
use std::sync::Arc;
use toml::{Table, Value};

/// Every method, in the order of tables and figures.
pub static METHODS: &[Entry] = &[
    entry::<ErrorIntegration>(),
    entry::<GaussNewton>(),
    entry::<ConstrainedQp>(),
    entry::<DirectPosition>(),
    entry::<TwoSlack>(),
    entry::<Davies>(),
    preset::<Davies>(davies::OPEN_LOOP),
    entry::<ReverseDecoupling>(),
    entry::<NullSpaceClik>(),
    entry::<PenaltyCg>(),
    entry::<PenaltyLbfgs>(),
];

/// What a method is called and where it comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MethodInfo {
    /// Stable id, used in commands and records.
    pub id: &'static str,
    /// Name as in its source.
    pub name: &'static str,
    /// One line on what it does.
    pub summary: &'static str,
    /// Author, year, equations.
    pub source: &'static str,
}

/// Meaning and range of one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Key.
    pub key: &'static str,
    /// Unit, `-` if it has none.
    pub unit: &'static str,
    /// What it does.
    pub meaning: &'static str,
    /// What it may be.
    pub allowed: Allowed,
}

/// What a parameter may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Allowed {
    /// A number between these, both included.
    Number {
        /// Least value.
        least: f64,
        /// Largest value.
        largest: f64,
    },
    /// A whole number between these, both included.
    Whole {
        /// Least value.
        least: i64,
        /// Largest value.
        largest: i64,
    },
    /// One of these words.
    Words(&'static [&'static str]),
}

impl Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number { least, largest } => write!(f, "a number from {least:?} to {largest:?}"),
            Self::Whole { least, largest } => write!(f, "a whole number from {least} to {largest}"),
            Self::Words(words) => {
                let quoted: Vec<_> = words.iter().map(|w| format!("\"{w}\"")).collect();
                f.write_str(&quoted.join(" or "))
            }
        }
    }
}

/// Parameters of a method: a plain struct with its source's values as default.
pub trait Parameters: Default + Clone + Debug + Serialize + DeserializeOwned {
    /// Unit, meaning and range of every field; a test holds it against the fields.
    const HELP: &'static [Field];

    /// Rules that concern several fields at once.
    ///
    /// # Errors
    /// The rule that is broken.
    fn validate(&self) -> Result<(), ParameterError> {
        Ok(())
    }
}

/// A formulation that can be registered.
pub trait Method: Formulation + Sized + 'static {
    /// Its parameters.
    type Parameters: Parameters;
    /// What it is.
    const INFO: MethodInfo;
    /// The formulation with these (checked) parameters.
    fn new(parameters: Self::Parameters) -> Self;
}

/// Why a method or its parameters were refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// No such method.
    #[error("unknown method `{found}`; known: {}", .known.join(", "))]
    UnknownMethod {
        /// What was asked for.
        found: String,
        /// The ids there are.
        known: Vec<&'static str>,
    },
    /// No such parameter.
    #[error("method `{method}` has no parameter `{found}`; it has: {}", .known.join(", "))]
    UnknownParameter {
        /// The method.
        method: &'static str,
        /// What was asked for.
        found: String,
        /// The parameters there are.
        known: Vec<&'static str>,
    },
    /// A value of the wrong type or out of range.
    #[error("parameter `{key}` of method `{method}` is {found}; allowed: {allowed}")]
    Value {
        /// The method.
        method: &'static str,
        /// The parameter.
        key: &'static str,
        /// What was given.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// A broken rule between parameters.
    #[error("parameters of method `{method}`: {rule}")]
    Rule {
        /// The method.
        method: &'static str,
        /// The rule.
        rule: String,
    },
}

/// A registered method.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    info: MethodInfo,
    fields: &'static [Field],
    defaults: fn() -> Table,
    /// Defaults that a preset changes.
    preset: &'static [(&'static str, f64)],
    build: fn(Table) -> Result<Arc<dyn Formulation>, ParameterError>,
}

/// A method under a name of its own with other defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preset {
    /// What it is.
    pub info: MethodInfo,
    /// Numbers that differ from the method's defaults.
    pub values: &'static [(&'static str, f64)],
}

/// A method with all its parameters resolved, ready to be prepared for problems.
#[derive(Clone, Debug)]
pub struct Contestant {
    /// Id of the method.
    pub id: String,
    /// Every parameter with the value in force.
    pub parameters: Table,
    /// The formulation.
    pub formulation: Arc<dyn Formulation>,
}

/// The registry line of `M`.
pub const fn entry<M: Method>() -> Entry {
    preset::<M>(Preset {
        info: M::INFO,
        values: &[],
    })
}

/// The registry line of `M` with other defaults.
pub const fn preset<M: Method>(preset: Preset) -> Entry {
    Entry {
        info: preset.info,
        fields: M::Parameters::HELP,
        defaults: defaults::<M>,
        preset: preset.values,
        build: build::<M>,
    }
}

/// The method of that id.
///
/// # Errors
/// [`ParameterError::UnknownMethod`], listing the known ids.
pub fn method(id: &str) -> Result<&'static Entry, ParameterError> {
    METHODS
        .iter()
        .find(|e| e.info.id == id)
        .ok_or_else(|| ParameterError::UnknownMethod {
            found: id.to_owned(),
            known: METHODS.iter().map(|e| e.info.id).collect(),
        })
}

impl Entry {
    /// What the method is.
    pub fn info(&self) -> &MethodInfo {
        &self.info
    }

    /// Its parameters.
    pub fn fields(&self) -> &'static [Field] {
        self.fields
    }

    /// Its parameters with their default values.
    pub fn defaults(&self) -> Table {
        let mut table = (self.defaults)();
        let changed = self
            .preset
            .iter()
            .map(|(key, value)| ((*key).to_owned(), Value::Float(*value)));
        table.extend(changed);
        table
    }

    /// True if it iterates within a step, its budget of majors being the parameter `n`.
    pub fn iterates(&self) -> bool {
        self.fields.iter().any(|f| f.key == "n")
    }

    /// The method with `overrides` in place of defaults.
    ///
    /// # Errors
    /// An unknown key, or a value of the wrong type or out of its range.
    pub fn build(&self, overrides: &Table) -> Result<Contestant, ParameterError> {
        let mut parameters = self.defaults();
        for (key, value) in overrides {
            let Some(field) = self.fields.iter().find(|f| f.key == key) else {
                return Err(ParameterError::UnknownParameter {
                    method: self.info.id,
                    found: key.clone(),
                    known: self.fields.iter().map(|f| f.key).collect(),
                });
            };
            parameters.insert(key.clone(), self.checked(field, value)?);
        }
        let formulation = (self.build)(parameters.clone())?;
        Ok(Contestant {
            id: self.info.id.to_owned(),
            parameters,
            formulation,
        })
    }

    /// `value` in the type of the field: a whole number becomes a float where floats are meant, so that the same run is
    /// always recorded the same way.
    fn checked(&self, field: &Field, value: &Value) -> Result<Value, ParameterError> {
        let checked = match (field.allowed, value) {
            (Allowed::Number { least, largest }, Value::Integer(_) | Value::Float(_)) => {
                #[allow(clippy::cast_precision_loss, reason = "parameters are far below 2^53")]
                let number = value.as_float().or(value.as_integer().map(|i| i as f64));
                number.filter(|v| (least..=largest).contains(v)).map(Value::Float)
            }
            (Allowed::Whole { least, largest }, Value::Integer(v)) => {
                (least..=largest).contains(v).then(|| value.clone())
            }
            (Allowed::Words(words), Value::String(word)) => {
                words.contains(&word.as_str()).then(|| value.clone())
            }
            _ => None,
        };
        checked.ok_or_else(|| ParameterError::Value {
            method: self.info.id,
            key: field.key,
            found: value.to_string(),
            allowed: field.allowed.to_string(),
        })
    }
}

fn defaults<M: Method>() -> Table {
    Table::try_from(M::Parameters::default()).expect("parameter structs are flat and hold numbers and words")
}

fn build<M: Method>(parameters: Table) -> Result<Arc<dyn Formulation>, ParameterError> {
    let parsed: M::Parameters = parameters
        .try_into()
        .map_err(|e: toml::de::Error| ParameterError::Rule {
            method: M::INFO.id,
            rule: e.to_string(),
        })?;
    parsed.validate()?;
    Ok(Arc::new(M::new(parsed)))
}

/// The help of the iteration budget that all iterating methods share (the paper's n).
pub(crate) const N_FIELD: Field = Field {
    key: "n",
    unit: "-",
    meaning: "most major iterations per control step",
    allowed: Allowed::Whole {
        least: 1,
        largest: 10_000,
    },
};

#[cfg(test)]
mod tests {
    use super::*;

    fn table(key: &str, value: Value) -> Table {
        Table::from_iter([(key.to_owned(), value)])
    }

    #[test]
    fn help_names_exactly_the_fields_and_defaults_are_allowed() {
        for entry in METHODS {
            let defaults = entry.defaults();
            let mut keys: Vec<_> = defaults.keys().map(String::as_str).collect();
            let mut help: Vec<_> = entry.fields.iter().map(|f| f.key).collect();
            keys.sort_unstable();
            help.sort_unstable();
            assert_eq!(keys, help, "{}", entry.info.id);
            let built = entry.build(&defaults).unwrap();
            assert_eq!(built.parameters, defaults);
        }
    }

    #[test]
    fn wild_values_are_refused_for_every_parameter() {
        for entry in METHODS {
            for field in entry.fields {
                for wild in [f64::NAN, f64::INFINITY, -1.0] {
                    let error = entry.build(&table(field.key, Value::Float(wild))).unwrap_err();
                    assert!(error.to_string().contains(field.key), "{error}");
                }
                assert!(entry.build(&table(field.key, Value::Boolean(true))).is_err());
                assert!(
                    entry
                        .build(&table(field.key, Value::String("nonsense".into())))
                        .is_err()
                );
            }
        }
    }

    #[test]
    fn ids_are_unique_and_described() {
        for (i, entry) in METHODS.iter().enumerate() {
            assert!(METHODS[..i].iter().all(|other| other.info.id != entry.info.id));
            assert!(
                !entry.info.summary.is_empty()
                    && !entry.info.source.is_empty()
                    && !entry.info.name.is_empty()
            );
        }
    }

    #[test]
    fn whole_numbers_become_floats_where_floats_are_meant() {
        let built = method("ik4")
            .unwrap()
            .build(&table("gamma", Value::Integer(3)))
            .unwrap();
        assert_eq!(built.parameters["gamma"], Value::Float(3.0));
    }

    #[test]
    fn unknown_names_list_the_known_ones() {
        let error = method("ik9").unwrap_err().to_string();
        assert!(error.contains("ik9") && error.contains("ik4"));
        let error = method("ik1")
            .unwrap()
            .build(&table("gamma", Value::Float(1.0)))
            .unwrap_err()
            .to_string();
        assert!(error.contains("gamma") && error.contains("damping"));
    }
}
