//! What a command is going to run, checked to the last number before the first byte is written.

use crate::error::InputError;
use crate::suite::{Case, Selection, Suite, Variation, lineup};
use ik_methods::registry::Contestant;
use toml::{Table, Value};

/// A case and who runs it.
#[derive(Debug)]
pub(super) struct Heat {
    pub(super) case: Case,
    pub(super) contestants: Vec<Contestant>,
}

/// The heats of some suites; quick ones keep the marked scenarios (all, if none is marked).
pub(super) fn heats(
    suites: &[Suite],
    selection: &Selection,
    variation: &Variation,
    scenarios: Scenarios,
) -> Result<Vec<Heat>, InputError> {
    let mut heats = Vec::new();
    for suite in suites {
        let contestants = lineup(suite, selection)?;
        let marked = suite.scenarios.iter().any(|s| s.quick);
        for (index, scenario) in suite.scenarios.iter().enumerate() {
            if scenarios == Scenarios::All || scenario.quick || !marked {
                let case = Case::new(suite, index, variation)?;
                heats.push(Heat {
                    case,
                    contestants: contestants.clone(),
                });
            }
        }
    }
    Ok(heats)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scenarios {
    All,
    Quick,
}

/// The values of `--set key=value` options. A value is what TOML makes of it, or else a word.
pub(super) fn settings(options: &[String]) -> Result<Table, InputError> {
    let mut table = Table::new();
    for option in options {
        let (key, text) = option
            .split_once('=')
            .filter(|(key, text)| !key.trim().is_empty() && !text.trim().is_empty())
            .ok_or_else(|| InputError::value("command line", "--set", option, "KEY=VALUE"))?;
        let parsed: Result<Table, _> = format!("value = {text}").parse();
        let value = parsed.ok().and_then(|mut t| t.remove("value"));
        let value = value.unwrap_or_else(|| Value::String(text.trim().to_owned()));
        if value.as_array().is_some_and(Vec::is_empty) {
            return Err(InputError::value(
                "command line",
                "--set",
                option,
                "at least one value",
            ));
        }
        if table.insert(key.trim().to_owned(), value).is_some() {
            return Err(InputError::value(
                "command line",
                "--set",
                option,
                "each key once; n=[15,3] for several values",
            ));
        }
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(options: &[&str]) -> Result<Table, InputError> {
        settings(&options.iter().map(ToString::to_string).collect::<Vec<_>>())
    }

    #[test]
    fn values_are_numbers_lists_or_words() {
        let table = parse(&["n=[15, 3]", "gamma=3", "rows=literal", "damping=1e-2"]).unwrap();
        assert_eq!(table["n"].as_array().map(Vec::len), Some(2));
        assert_eq!(table["gamma"].as_integer(), Some(3));
        assert_eq!(table["rows"].as_str(), Some("literal"));
        assert_eq!(table["damping"].as_float(), Some(1e-2));
    }

    #[test]
    fn options_without_key_or_value_and_repeated_ones_are_refused() {
        for bad in [&["gamma"][..], &["=3"], &["gamma="], &["n=3", "n=15"]] {
            assert!(parse(bad).unwrap_err().to_string().contains("--set"), "{bad:?}");
        }
    }
}
