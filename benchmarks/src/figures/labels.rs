//! How rows are named in figures and tables, and which of several equal ones counts.
//!
//! A label is the method id, `literal` after it where the velocity term acts on all rows, and every parameter other than
//! `n` in which rows of the same method on the same scenario differ.

use crate::records::Row;
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
        (suite_order(l.row), place, l.label.clone(), std::cmp::Reverse(l.n))
    });
    named
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
    for (key, value) in row.parameters.iter().filter(|(k, _)| !named_apart(k)) {
        if rivals.iter().any(|r| r.parameters.get(key) != Some(value)) {
            label.push_str(&format!(" {key}={}", plain(value)));
        }
    }
    if rivals.iter().any(|r| r.dt_s.to_bits() != row.dt_s.to_bits()) {
        label.push_str(&format!(" dt={}ms", row.dt_s * 1e3));
    }
    Labelled {
        row,
        label,
        n: row.parameters.get("n").and_then(Value::as_u64),
    }
}

fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
