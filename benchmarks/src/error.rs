//! Bad input: what the user gave, where it stands, and what is allowed there.
//!
//! Whatever can be wrong with a command, a suite, an instance or a robot description is found before anything is written
//! and leaves the program with exit code 2.

use ik_core::formulation::Declined;
use ik_core::problem::ProblemError;
use ik_core::robot::RobotError;
use ik_methods::registry::ParameterError;

/// Input that cannot be used. The text names the file, the field, the value found and what is allowed.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// A file that cannot be read.
    #[error("{file}: cannot be read: {reason}")]
    File {
        /// Path.
        file: String,
        /// The answer of the system.
        reason: String,
    },
    /// Text that is not what it should be; the reason carries line and column.
    #[error("{file}: {reason}")]
    Syntax {
        /// Path or name.
        file: String,
        /// What the parser found, where, and what it expected.
        reason: String,
    },
    /// A value out of its range.
    #[error("{place}: {field} = {found}; allowed: {allowed}")]
    Value {
        /// File, suite or command.
        place: String,
        /// Field, with indices.
        field: String,
        /// What it holds.
        found: String,
        /// What it may hold.
        allowed: String,
    },
    /// A name that does not exist.
    #[error("{place}: unknown {what} `{found}`{}; known: {}", did_you_mean(.found, .known), .known.join(", "))]
    Unknown {
        /// File, suite or command.
        place: String,
        /// What kind of name.
        what: &'static str,
        /// The name.
        found: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// A bad robot.
    #[error("{place}: {source}")]
    Robot {
        /// File, suite or command.
        place: String,
        /// What is wrong with it.
        source: Box<RobotError>,
    },
    /// A problem that contradicts itself.
    #[error("{place}: {source}")]
    Problem {
        /// File, suite or command.
        place: String,
        /// What is wrong with it.
        source: ProblemError,
    },
    /// Bad parameters of a method.
    #[error("{place}: {source}")]
    Parameter {
        /// File, suite or command.
        place: String,
        /// What is wrong with them.
        source: ParameterError,
    },
    /// A single step that the method asked for refuses.
    #[error("method `{method}` {source}")]
    Declined {
        /// Id of the method.
        method: String,
        /// Its reason.
        source: Declined,
    },
}

impl InputError {
    pub(crate) fn value(place: &str, field: &str, found: impl ToString, allowed: &str) -> Self {
        Self::Value {
            place: place.to_owned(),
            field: field.to_owned(),
            found: found.to_string(),
            allowed: allowed.to_owned(),
        }
    }

    pub(crate) fn unknown<S: AsRef<str>>(
        place: &str,
        what: &'static str,
        found: &str,
        known: impl IntoIterator<Item = S>,
    ) -> Self {
        Self::Unknown {
            place: place.to_owned(),
            what,
            found: found.to_owned(),
            known: known.into_iter().map(|k| k.as_ref().to_owned()).collect(),
        }
    }
}

/// Checks that a number is finite.
pub(crate) fn finite(place: &str, field: &str, value: f64) -> Result<(), InputError> {
    if value.is_finite() {
        return Ok(());
    }
    Err(InputError::value(place, field, value, "a finite number"))
}

/// Checks that a number is finite and above zero.
pub(crate) fn positive(place: &str, field: &str, value: f64) -> Result<(), InputError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(InputError::value(place, field, value, "a finite number above 0"))
}

/// `, did you mean ..?` if a known name is near.
fn did_you_mean(found: &str, known: &[String]) -> String {
    let nearest = known.iter().map(|k| (edit_distance(found, k), k)).min();
    match nearest {
        // One slip in three letters is a typing error, more is another word.
        Some((distance, name)) if 3 * distance <= found.chars().count() => {
            format!(", did you mean `{name}`?")
        }
        _ => String::new(),
    }
}

/// Fewest insertions, deletions and replacements that turn one word into the other (Levenshtein 1966, computed by the
/// row-wise recursion of Wagner and Fischer 1974).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, other) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(letter != *other);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edit_distances_of_textbook_words() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("same", "same"), 0);
    }

    #[test]
    fn a_near_name_is_suggested_and_a_far_one_is_not() {
        let message = |found| InputError::unknown("suite x", "task", found, ["com", "torso"]).to_string();
        assert!(
            message("torsi").contains("did you mean `torso`?"),
            "{}",
            message("torsi")
        );
        assert!(
            !message("gripper").contains("did you mean"),
            "{}",
            message("gripper")
        );
        assert!(message("gripper").contains("com, torso"));
    }
}
