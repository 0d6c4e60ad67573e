//! How rows are named in figures and tables, and which of several equal ones counts.
//!
//! A label is the method id, `literal` after it where the velocity term acts on all rows, and every parameter other than
//! `n` in which rows of the same method on the same scenario differ. A method whose parameters are all its defaults goes
//! by its id alone, whoever its rivals are: it is the same contestant on every suite.

use crate::records::Row;
use crate::runner::recorded;
use ik_methods::registry::{METHODS, method};
use serde_json::Value;
use std::collections::BTreeMap;

/// A row with its name.
#[derive(Clone, Debug)]
pub(crate) struct Labelled<'a> {
    pub(crate) row: &'a Row,
    /// Method and variant without n.
    pub(crate) label: String,
    /// Budget of major iterations; none for a method that does not iterate.
    pub(crate) n: Option<u64>,
}

impl Labelled<'_> {
    /// Label and n.
    pub(crate) fn full(&self) -> String {
        match self.n {
            Some(n) => format!("{} n={n}", self.label),
            None => self.label.clone(),
        }
    }

    /// Place among the methods of a table: as registered, then by label, numbers in it by value, then by falling n.
    pub(crate) fn order(&self) -> (usize, Vec<(String, u64)>, std::cmp::Reverse<Option<u64>>) {
        let place = METHODS
            .iter()
            .position(|entry| entry.info().id == self.row.method);
        (
            place.unwrap_or(METHODS.len()),
            self.label.split(' ').map(sortable).collect(),
            std::cmp::Reverse(self.n),
        )
    }

    /// Whether two rows are of the same method, variant and budget.
    pub(crate) fn is_same_method(&self, other: &Self) -> bool {
        self.label == other.label && self.n == other.n
    }

    /// Parameter γ of the velocity term.
    pub(crate) fn gamma(&self) -> Option<f64> {
        self.row.parameters.get("gamma").and_then(Value::as_f64)
    }
}

/// Names the rows. Of rows that agree in suite, scenario, Δt, method and parameters the last counts. They come in the
/// order of suites and scenarios as first met, then by label, then by falling n.
pub(crate) fn labelled(rows: &[Row]) -> Vec<Labelled<'_>> {
    let rows = last_of_each(rows);
    let mut named: Vec<Labelled<'_>> = rows.iter().map(|row| name(row, &rows)).collect();
    let mut order: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for row in &rows {
        let next = order.len();
        order.entry((&row.suite, &row.scenario)).or_insert(next);
    }
    let suite_order = |row: &Row| rows.iter().position(|r| r.suite == row.suite);
    named.sort_by_cached_key(|l| {
        let place = order[&(l.row.suite.as_str(), l.row.scenario.as_str())];
        (suite_order(l.row), place, l.order())
    });
    named
}

/// The runs grouped by method, variant and budget, in the order of tables.
pub(crate) fn by_method<'r, 'a>(
    runs: impl IntoIterator<Item = &'r Labelled<'a>>,
) -> Vec<Vec<&'r Labelled<'a>>>
where
    'a: 'r,
{
    let mut groups: Vec<Vec<&'r Labelled<'a>>> = Vec::new();
    for run in runs {
        match groups.iter_mut().find(|g| g[0].is_same_method(run)) {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    groups.sort_by_cached_key(|g| g[0].order());
    groups
}

/// A label that fits `width` characters: one that does not becomes its first word and the number of a note.
pub(crate) fn numbered(label: String, width: usize, notes: &mut Vec<String>) -> String {
    if label.chars().count() <= width {
        return label;
    }
    let place = notes.iter().position(|note| *note == label).unwrap_or_else(|| {
        notes.push(label.clone());
        notes.len() - 1
    });
    format!("{} [{}]", label.split(' ').next().unwrap_or_default(), place + 1)
}

/// A word of a label, a number after `=` apart. The bits of a non-negative f64 sort like its value.
fn sortable(word: &str) -> (String, u64) {
    let parsed = word
        .split_once('=')
        .and_then(|(key, value)| Some((key, value.parse::<f64>().ok()?)));
    parsed.map_or((word.to_owned(), 0), |(key, value)| {
        (key.to_owned(), value.max(0.0).to_bits())
    })
}

fn last_of_each(rows: &[Row]) -> Vec<&Row> {
    let mut kept: Vec<&Row> = Vec::new();
    for row in rows {
        match kept.iter_mut().find(|k| is_same_run(k, row)) {
            Some(earlier) => *earlier = row,
            None => kept.push(row),
        }
    }
    kept
}

fn is_same_run(a: &Row, b: &Row) -> bool {
    let same_place = a.suite == b.suite && a.scenario == b.scenario && a.dt_s.to_bits() == b.dt_s.to_bits();
    same_place && a.method == b.method && a.parameters == b.parameters
}

/// Whether a row's method ran with its defaults, budget apart.
pub(super) fn is_default(row: &Row) -> bool {
    let Ok(entry) = method(&row.method) else {
        return false;
    };
    let defaults = recorded(&entry.defaults());
    let mut others = row.parameters.iter().filter(|(key, _)| *key != "n");
    others.all(|(key, value)| defaults.get(key) == Some(value))
}

fn name<'a>(row: &'a Row, rows: &[&Row]) -> Labelled<'a> {
    let rivals: Vec<&&Row> = rows
        .iter()
        .filter(|r| r.suite == row.suite && r.scenario == row.scenario && r.method == row.method)
        .collect();
    let mut label = row.method.clone();
    if row.parameters.get("rows").and_then(Value::as_str) == Some("literal") {
        label.push_str(" literal");
    }
    let named_apart = |key: &str| key == "n" || key == "rows";
    let differing = row.parameters.iter().filter(|(k, _)| !named_apart(k));
    for (key, value) in differing.filter(|_| !is_default(row)) {
        if rivals.iter().any(|r| r.parameters.get(key) != Some(value)) {
            label.push_str(&format!(" {key}={}", plain(value)));
        }
    }
    if rivals.iter().any(|r| r.dt_s.to_bits() != row.dt_s.to_bits()) {
        label.push_str(&format!(" dt={} ms", super::milliseconds(row.dt_s)));
    }
    Labelled {
        row,
        label,
        n: row.parameters.get("n").and_then(Value::as_u64),
    }
}

fn plain(value: &Value) -> String {
    match (value.as_str(), value.as_f64()) {
        (Some(word), _) => word.to_owned(),
        // 10, not 10.0.
        (None, Some(number)) => number.to_string(),
        (None, None) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::row;
    use super::*;

    fn with(mut row: Row, key: &str, value: impl Into<Value>) -> Row {
        row.parameters.insert(key.to_owned(), value.into());
        row
    }

    #[test]
    fn labels_tell_variants_apart_and_sort_numbers_by_value() {
        let squat = || row("ik4", Some(15), "coman/squat", "A");
        let rows = [
            with(squat(), "gamma", 100.0),
            with(squat(), "gamma", 3.0),
            with(squat(), "rows", "literal"),
            row("ik1", None, "coman/squat", "A"),
        ];
        let names: Vec<String> = labelled(&rows).iter().map(Labelled::full).collect();
        let expected = [
            "ik1",
            "ik4 gamma=3 n=15",
            "ik4 gamma=100 n=15",
            "ik4 literal gamma=10 n=15",
        ];
        assert_eq!(names, expected);
    }

    #[test]
    fn of_equal_runs_the_last_counts_and_the_larger_budget_comes_first() {
        let newer = Row {
            revision: "newer".to_owned(),
            ..row("ik5", Some(3), "coman/squat", "A")
        };
        let rows = [
            row("ik5", Some(3), "coman/squat", "A"),
            row("ik5", Some(15), "coman/squat", "A"),
            newer,
        ];
        let runs = labelled(&rows);
        assert_eq!(runs.iter().map(|r| r.n).collect::<Vec<_>>(), [Some(15), Some(3)]);
        assert_eq!(runs[1].row.revision, "newer");
        assert_eq!(runs[1].label, "ik5");
    }

    #[test]
    fn time_steps_are_told_apart() {
        let coarse = Row {
            dt_s: 0.01,
            ..row("ik1", None, "coman/squat", "A")
        };
        let rows = [row("ik1", None, "coman/squat", "A"), coarse];
        let names: Vec<String> = labelled(&rows).iter().map(Labelled::full).collect();
        assert_eq!(names, ["ik1 dt=5 ms", "ik1 dt=10 ms"]);
    }
}
