//! Who competes: the contestants of a suite, what a command selects among them and sets for them.

use super::{ContestantSpec, Suite};
use crate::error::InputError;
use ik_methods::registry::{Contestant, Entry, METHODS, method};
use toml::{Table, Value};

/// Budgets of majors per control step a method that iterates competes with: generous and tight (Faraji & Ijspeert 2017,
/// section IV, use both).
const USUAL_BUDGETS: [i64; 2] = [15, 3];
/// Stands for every registered method.
const EVERY: &str = "*";

/// What a command asks of the lineup.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Methods to keep; all if empty.
    pub methods: Vec<String>,
    /// Parameter values, or lists of values, for those that have the parameter.
    pub set: Table,
}

/// The contestants of a suite, in the order it names them.
///
/// A selected method that the suite does not name competes with its usual budgets. Values of the selection replace those
/// of the suite; a parameter that none of the contestants has is an error.
///
/// # Errors
/// Unknown methods and parameters, values out of range.
pub fn lineup(suite: &Suite, selection: &Selection) -> Result<Vec<Contestant>, InputError> {
    let lines = selected_lines(suite, selection)?;
    if let Some(key) = selection
        .set
        .keys()
        .find(|key| !lines.iter().any(|(entry, _)| has(entry, key)))
    {
        let known = lines
            .iter()
            .flat_map(|(entry, _)| entry.fields().iter().map(|f| f.key));
        let mut known: Vec<_> = known.collect();
        known.sort_unstable();
        known.dedup();
        return Err(InputError::unknown("--set", "parameter", key, known));
    }
    let mut contestants: Vec<Contestant> = Vec::new();
    for (entry, mut values) in lines {
        let wanted = selection.set.iter().filter(|(key, _)| has(entry, key));
        values.extend(wanted.map(|(key, value)| (key.clone(), value.clone())));
        for parameters in products(&values) {
            let contestant = build(entry, &parameters, &suite.source)?;
            let known = |c: &Contestant| c.id == contestant.id && c.parameters == contestant.parameters;
            if !contestants.iter().any(known) {
                contestants.push(contestant);
            }
        }
    }
    Ok(contestants)
}

/// The contestant with these parameters.
///
/// # Errors
/// An unknown parameter or a value out of range; `place` goes into the message.
pub(crate) fn build(entry: &Entry, parameters: &Table, place: &str) -> Result<Contestant, InputError> {
    if let Some(key) = parameters.keys().find(|key| !has(entry, key)) {
        let place = format!("{place}: method `{}`", entry.info().id);
        return Err(InputError::unknown(
            &place,
            "parameter",
            key,
            entry.fields().iter().map(|f| f.key),
        ));
    }
    entry.build(parameters).map_err(|source| InputError::Parameter {
        place: place.to_owned(),
        source,
    })
}

/// The registered method of that id.
///
/// # Errors
/// An unknown id; `place` goes into the message.
pub(crate) fn known_method(id: &str, place: &str) -> Result<&'static Entry, InputError> {
    method(id).map_err(|_| InputError::unknown(place, "method", id, METHODS.iter().map(|e| e.info().id)))
}

fn has(entry: &Entry, key: &str) -> bool {
    entry.fields().iter().any(|f| f.key == key)
}

/// Methods with the values the suite gives them, lists not yet multiplied out.
fn selected_lines(suite: &Suite, selection: &Selection) -> Result<Vec<(&'static Entry, Table)>, InputError> {
    let all = suite_lines(suite)?;
    if selection.methods.is_empty() {
        return Ok(all);
    }
    let mut lines = Vec::new();
    for id in &selection.methods {
        let entry = known_method(id, "--method")?;
        let before = lines.len();
        lines.extend(
            all.iter()
                .filter(|(other, _)| other.info().id == id.as_str())
                .cloned(),
        );
        if lines.len() == before {
            lines.push(usual_line(entry));
        }
    }
    Ok(lines)
}

fn suite_lines(suite: &Suite) -> Result<Vec<(&'static Entry, Table)>, InputError> {
    let default = [ContestantSpec {
        method: EVERY.to_owned(),
        set: Table::new(),
    }];
    let specs = if suite.contestants.is_empty() {
        &default[..]
    } else {
        &suite.contestants
    };
    let mut lines = Vec::new();
    for (i, spec) in specs.iter().enumerate() {
        let place = format!("{}: contestants[{i}]", suite.source);
        match (spec.method.as_str(), spec.set.is_empty()) {
            (EVERY, true) => lines.extend(METHODS.iter().map(usual_line)),
            (EVERY, false) => return Err(InputError::value(&place, "set", "values", "none for method `*`")),
            (id, _) => lines.push((known_method(id, &format!("{place}.method"))?, spec.set.clone())),
        }
    }
    Ok(lines)
}

fn usual_line(entry: &'static Entry) -> (&'static Entry, Table) {
    let budgets = Value::Array(USUAL_BUDGETS.map(Value::Integer).to_vec());
    let values = entry.iterates().then(|| ("n".to_owned(), budgets));
    (entry, values.into_iter().collect())
}

/// Every combination of the values of lists; single values count as lists of one. The last key varies fastest.
fn products(values: &Table) -> Vec<Table> {
    let mut tables = vec![Table::new()];
    for (key, value) in values {
        let choices = match value {
            Value::Array(list) => list.clone(),
            single => vec![single.clone()],
        };
        let extend = |table: &Table, choice: &Value| {
            let mut table = table.clone();
            table.insert(key.clone(), choice.clone());
            table
        };
        tables = tables
            .iter()
            .flat_map(|table| choices.iter().map(|c| extend(table, c)).collect::<Vec<_>>())
            .collect();
    }
    tables
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids(suite: &Suite, selection: &Selection) -> Vec<String> {
        let describe = |c: Contestant| {
            format!(
                "{} {}",
                c.id,
                c.parameters.get("n").map_or(String::new(), Value::to_string)
            )
        };
        lineup(suite, selection)
            .unwrap()
            .into_iter()
            .map(describe)
            .collect()
    }

    fn selection(methods: &[&str], set: &str) -> Selection {
        Selection {
            methods: methods.iter().map(ToString::to_string).collect(),
            set: set.parse().unwrap(),
        }
    }

    #[test]
    fn every_iterating_method_competes_with_both_budgets() {
        let mut suite = Suite::load("coman/squat").unwrap();
        suite.contestants.clear();
        let found = ids(&suite, &Selection::default());
        let expected: usize = METHODS.iter().map(|e| if e.iterates() { 2 } else { 1 }).sum();
        assert_eq!(found.len(), expected);
        assert!(found.contains(&"ik4 15".to_owned()) && found.contains(&"ik4 3".to_owned()));
    }

    #[test]
    fn lists_are_multiplied_out() {
        let tables = products(&"n = [15, 3]\ngamma = [0, 1, 3]\nrows = 'soft'".parse().unwrap());
        assert_eq!(tables.len(), 6);
        assert!(tables.iter().all(|t| t["rows"].as_str() == Some("soft")));
        assert!((0..6).all(|i| tables[..i].iter().all(|other| *other != tables[i])));
    }

    #[test]
    fn a_selection_filters_sets_and_removes_repetitions() {
        let suite = Suite::load("coman/squat").unwrap();
        assert_eq!(
            ids(&suite, &selection(&["ik5", "ik1"], "n = 7")),
            ["ik5 7", "ik1 "]
        );
        assert_eq!(
            ids(&suite, &selection(&["ik2"], "n = [1, 2]")),
            ["ik2 1", "ik2 2"]
        );
        let regulator = Suite::load("coman/regulator").unwrap();
        assert_eq!(ids(&regulator, &selection(&["ik3"], "")), ["ik3 "]);
    }

    #[test]
    fn unknown_names_are_refused() {
        let suite = Suite::load("coman/squat").unwrap();
        let message = |s: Selection| lineup(&suite, &s).unwrap_err().to_string();
        assert!(message(selection(&["ik44"], "")).contains("did you mean `ik4`?"));
        let text = message(selection(&["ik4"], "gama = 3"));
        assert!(
            text.contains("unknown parameter `gama`, did you mean `gamma`?"),
            "{text}"
        );
        let text = message(selection(&["ik4"], "gamma = -1"));
        assert!(text.contains("gamma") && text.contains("-1"), "{text}");
    }
}
