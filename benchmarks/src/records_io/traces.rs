//! Traces as CSV.

use super::{RecordError, read_text, write_atomically};
use crate::records::Trace;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

/// Writes a trace as CSV: a header of column names, then one line per sample. Numbers are the shortest decimals that read
/// back to the same f64.
///
/// # Errors
/// [`RecordError::BadTrace`] for a name with a comma or newline, a repeated name, or a row of another length; Io.
pub fn write_trace(path: &Path, trace: &Trace) -> Result<(), RecordError> {
    check_header(path, &trace.columns)?;
    let mut text = trace.columns.join(",");
    text.push('\n');
    for (index, row) in trace.rows.iter().enumerate() {
        check_length(path, index + 2, row.len(), trace.columns.len())?;
        for (position, value) in row.iter().enumerate() {
            if position > 0 {
                text.push(',');
            }
            push_number(&mut text, *value);
        }
        text.push('\n');
    }
    write_atomically(path, &text)
}

/// Shortest decimal that reads back to the same value; whole numbers without a fraction.
fn push_number(text: &mut String, value: f64) {
    let start = text.len();
    // `{:?}`, unlike `{}`, uses an exponent for very small and very large values.
    write!(text, "{value:?}").expect("writing to a String cannot fail");
    if text[start..].ends_with(".0") {
        text.truncate(text.len() - 2);
    }
}

/// Reads a trace that [`write_trace`] wrote.
///
/// # Errors
/// [`RecordError::BadTrace`] with line and column for anything that is not a table of numbers; Io.
pub fn read_trace(path: &Path) -> Result<Trace, RecordError> {
    let text = read_text(path)?;
    let mut lines = text.lines().enumerate();
    let header = lines.next().map(|(_, l)| l).unwrap_or_default();
    let columns: Vec<String> = header.split(',').map(str::to_owned).collect();
    check_header(path, &columns)?;
    let mut rows = Vec::new();
    for (index, line) in lines {
        rows.push(parse_values(path, index + 1, line, &columns)?);
    }
    Ok(Trace { columns, rows })
}

fn parse_values(path: &Path, line: usize, text: &str, columns: &[String]) -> Result<Vec<f64>, RecordError> {
    check_length(path, line, text.split(',').count(), columns.len())?;
    let parse = |(field, column): (&str, &String)| {
        field
            .parse::<f64>()
            .map_err(|_| bad_trace(path, line, column, field, "a number".to_owned()))
    };
    text.split(',').zip(columns).map(parse).collect()
}

fn check_length(path: &Path, line: usize, found: usize, expected: usize) -> Result<(), RecordError> {
    if found == expected {
        return Ok(());
    }
    let place = found.min(expected) + 1;
    Err(bad_trace(
        path,
        line,
        &place.to_string(),
        &format!("{found} values"),
        format!("{expected}, one per column"),
    ))
}

fn check_header(path: &Path, columns: &[String]) -> Result<(), RecordError> {
    let mut seen = BTreeSet::new();
    for (index, name) in columns.iter().enumerate() {
        let is_plain = !name.trim().is_empty() && !name.contains([',', '\n', '\r']);
        if !is_plain || !seen.insert(name) {
            let expected = "names that are not empty, hold no comma and no newline, and differ".to_owned();
            return Err(bad_trace(path, 1, &(index + 1).to_string(), name, expected));
        }
    }
    Ok(())
}

fn bad_trace(path: &Path, line: usize, column: &str, found: &str, expected: String) -> RecordError {
    let (column, found) = (column.to_owned(), found.to_owned());
    RecordError::BadTrace {
        path: path.to_path_buf(),
        line,
        column,
        found,
        expected,
    }
}
