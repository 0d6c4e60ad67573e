//! Reading and writing of records: `runs.jsonl` (one row per line) and one CSV per trace.
//!
//! Every file is written whole into a temporary file of the same folder and renamed over the old one, so a killed process
//! leaves either the old file or the new one. A temporary file that it leaves behind (`.<name>.<process>.tmp`) is never
//! read. A loss of power is not covered: nothing is flushed to the disk explicitly.
//!
//! A line that is not a row stops the reading with its file and line number, because dropping it would drop a result at
//! the next write. One case is forgiven: a last line without its newline, as a foreign tool leaves it when it is stopped
//! while appending. It is skipped, reported in [`RowFile::torn`], and gone after the next write.

mod traces;

use crate::records::{Row, SCHEMA};
use std::collections::{BTreeMap, BTreeSet};

use std::fs;
use std::path::{Path, PathBuf};
pub use traces::{read_trace, write_trace};

/// Name of the file of rows in a results folder.
pub const ROWS_FILE: &str = "runs.jsonl";

/// Why a record could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The file system refused.
    #[error("{path}: cannot {action}: {source}")]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// Its answer.
        source: std::io::Error,
    },
    /// A line of a row file is not a row.
    #[error("{path}, line {line}: not a run record: {reason}; correct or remove the line")]
    BadRow {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong with it, with the field where the parser knows it.
        reason: String,
    },
    /// A row has another layout than this program knows.
    #[error(
        "{path}, line {line}, field schema: found {found:?}, this program reads {SCHEMA:?}; use another --out folder"
    )]
    Schema {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Found value.
        found: String,
    },
    /// A row would not come back as it was: JSON has no number for NaN and infinity.
    #[error(
        "{path}: row {method} on {suite}/{scenario} holds a number that is not finite; null fields: {fields}"
    )]
    NotFinite {
        /// File it was meant for.
        path: PathBuf,
        /// Method id.
        method: String,
        /// Suite id.
        suite: String,
        /// Scenario id.
        scenario: String,
        /// Metrics written as null, among them the offending one.
        fields: String,
    },
    /// A trace is not a table.
    #[error("{path}, line {line}, column {column}: found {found:?}, expected {expected}")]
    BadTrace {
        /// File.
        path: PathBuf,
        /// Line, from 1 (the header).
        line: usize,
        /// Column name, or its number where it has none.
        column: String,
        /// Found text.
        found: String,
        /// What is allowed.
        expected: String,
    },
    /// A text file lacks the markers between which a generated text goes.
    #[error(
        "{path}: {reason}; it must contain {begin:?} once and {end:?} once after it, each on a line of its own"
    )]
    Markers {
        /// File.
        path: PathBuf,
        /// Marker before the text.
        begin: String,
        /// Marker after the text.
        end: String,
        /// What was found.
        reason: String,
    },
}

/// Writes a whole file through a temporary one in the same folder, which is created if needed.
///
/// # Errors
/// [`RecordError::Io`].
pub fn write_atomically(path: &Path, content: &str) -> Result<(), RecordError> {
    let folder = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(|e| io_error(folder, "create folder", e))?;
    let name = path
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    let temporary = folder.join(format!(".{name}.{}.tmp", std::process::id()));
    let written = fs::write(&temporary, content)
        .map_err(|e| io_error(&temporary, "write", e))
        .and_then(|()| fs::rename(&temporary, path).map_err(|e| io_error(path, "replace", e)));
    if written.is_err() {
        // The write already failed and is reported; a leftover is harmless, so a second failure adds nothing.
        let _ = fs::remove_file(&temporary);
    }
    written
}

pub(crate) fn read_text(path: &Path) -> Result<String, RecordError> {
    fs::read_to_string(path).map_err(|e| io_error(path, "read", e))
}

fn io_error(path: &Path, action: &'static str, source: std::io::Error) -> RecordError {
    RecordError::Io {
        path: path.to_path_buf(),
        action,
        source,
    }
}

/// What a file of rows holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RowFile {
    /// Rows in the order of the file.
    pub rows: Vec<Row>,
    /// A remark naming file and line, if the last line was torn and skipped.
    pub torn: Option<String>,
}

/// Reads a file of rows. Empty lines are skipped.
///
/// # Errors
/// Io if the file cannot be read; [`RecordError::BadRow`] and [`RecordError::Schema`] with the line number.
pub fn read_rows(path: &Path) -> Result<RowFile, RecordError> {
    let text = read_text(path)?;
    let mut file = RowFile::default();
    let count = text.lines().count();
    for (index, line) in text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty()) {
        let is_unfinished = index + 1 == count && !text.ends_with('\n');
        match parse_row(path, index + 1, line) {
            Ok(row) => file.rows.push(row),
            Err(RecordError::BadRow { reason, .. }) if is_unfinished => {
                file.torn = Some(format!(
                    "{}, line {}: torn, skipped: {reason}",
                    path.display(),
                    index + 1
                ));
            }
            Err(error) => return Err(error),
        }
    }
    Ok(file)
}

fn parse_row(path: &Path, line: usize, text: &str) -> Result<Row, RecordError> {
    let bad = |e: serde_json::Error| RecordError::BadRow {
        path: path.to_path_buf(),
        line,
        reason: e.to_string(),
    };
    let value: serde_json::Value = serde_json::from_str(text).map_err(bad)?;
    if let Some(found) = value
        .get("schema")
        .and_then(|s| s.as_str())
        .filter(|s| *s != SCHEMA)
    {
        return Err(RecordError::Schema {
            path: path.to_path_buf(),
            line,
            found: found.to_owned(),
        });
    }
    // From the text again, not from the value: only then does the message carry the column.
    serde_json::from_str(text).map_err(bad)
}

/// What makes two runs the same run: a store that contains the key need not make the run again.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RowKey {
    method: String,
    parameters: String,
    suite: String,
    scenario: String,
    dt_bits: u64,
    seed: u64,
    revision: String,
}

impl RowKey {
    /// Key of a run that may not have been made yet.
    pub fn new(
        method: &str,
        parameters: &BTreeMap<String, serde_json::Value>,
        suite: &str,
        scenario: &str,
        dt_s: f64,
        seed: u64,
        revision: &str,
    ) -> Self {
        let parameters: Vec<String> = parameters.iter().map(|(k, v)| format!("{k}={v}")).collect();
        Self {
            method: method.to_owned(),
            parameters: parameters.join(";"),
            suite: suite.to_owned(),
            scenario: scenario.to_owned(),
            dt_bits: dt_s.to_bits(),
            seed,
            revision: revision.to_owned(),
        }
    }

    /// Key of a row.
    pub fn of(row: &Row) -> Self {
        Self::new(
            &row.method,
            &row.parameters,
            &row.suite,
            &row.scenario,
            row.dt_s,
            row.seed,
            &row.revision,
        )
    }
}

/// The rows of a results folder: those found there, and those pushed since, always on disk.
#[derive(Clone, Debug)]
pub struct RowStore {
    path: PathBuf,
    rows: Vec<Row>,
    keys: BTreeSet<RowKey>,
    text: String,
    torn: Option<String>,
}

impl RowStore {
    /// Opens the rows of a folder; neither the folder nor the file has to exist, and nothing is written yet.
    ///
    /// # Errors
    /// As [`read_rows`].
    pub fn open(dir: &Path) -> Result<Self, RecordError> {
        let path = dir.join(ROWS_FILE);
        let file = if path.exists() {
            read_rows(&path)?
        } else {
            RowFile::default()
        };
        let mut store = Self {
            path,
            rows: Vec::new(),
            keys: BTreeSet::new(),
            text: String::new(),
            torn: file.torn,
        };
        for row in file.rows {
            store.text.push_str(&to_line(&store.path, &row)?);
            store.remember(row);
        }
        Ok(store)
    }

    /// Whether a run was already made.
    pub fn contains(&self, key: &RowKey) -> bool {
        self.keys.contains(key)
    }

    /// Adds a row, in place of one of the same key, and writes the file.
    ///
    /// # Errors
    /// [`RecordError::NotFinite`] for a row that JSON cannot hold, Io if the file cannot be written; the store is then as
    /// before.
    pub fn push(&mut self, row: Row) -> Result<(), RecordError> {
        let line = to_line(&self.path, &row)?;
        let key = RowKey::of(&row);
        let replaces = self.keys.contains(&key);
        let mut text = if replaces {
            self.text_without(&key)?
        } else {
            std::mem::take(&mut self.text)
        };
        let before = text.len();
        text.push_str(&line);
        if let Err(error) = write_atomically(&self.path, &text) {
            if !replaces {
                text.truncate(before);
                self.text = text;
            }
            return Err(error);
        }
        self.text = text;
        if replaces {
            self.rows.retain(|old| RowKey::of(old) != key);
        }
        self.remember(row);
        Ok(())
    }

    /// The lines of all rows but those of `key`.
    fn text_without(&self, key: &RowKey) -> Result<String, RecordError> {
        let kept = self.rows.iter().filter(|row| RowKey::of(row) != *key);
        kept.map(|row| to_line(&self.path, row)).collect()
    }

    /// All rows, oldest first.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// A remark naming file and line, if the last line was torn and skipped.
    pub fn torn(&self) -> Option<&str> {
        self.torn.as_deref()
    }

    fn remember(&mut self, row: Row) {
        self.keys.insert(RowKey::of(&row));
        self.rows.push(row);
    }
}

/// One line with its newline, proven to read back as the same row.
fn to_line(path: &Path, row: &Row) -> Result<String, RecordError> {
    let line = serde_json::to_string(row).unwrap_or_default();
    if serde_json::from_str::<Row>(&line).is_ok_and(|back| back == *row) {
        return Ok(line + "\n");
    }
    Err(RecordError::NotFinite {
        path: path.to_path_buf(),
        method: row.method.clone(),
        suite: row.suite.clone(),
        scenario: row.scenario.clone(),
        fields: null_metrics(&line),
    })
}

fn null_metrics(line: &str) -> String {
    let value: serde_json::Value = serde_json::from_str(line).unwrap_or_default();
    let Some(metrics) = value["metrics"].as_object() else {
        return "dt_s or a parameter".to_owned();
    };
    let names: Vec<&str> = metrics
        .iter()
        .filter(|(_, v)| holds_null(v))
        .map(|(k, _)| k.as_str())
        .collect();
    names.join(", ")
}

fn holds_null(value: &serde_json::Value) -> bool {
    value.is_null()
        || value
            .as_object()
            .is_some_and(|o| o.values().any(serde_json::Value::is_null))
}

/// Replaces what stands between two marker lines of a text file, atomically; the markers stay.
///
/// # Errors
/// [`RecordError::Markers`] if they are missing, repeated or reversed (the file is then untouched); Io.
pub fn replace_between(path: &Path, begin: &str, end: &str, content: &str) -> Result<(), RecordError> {
    let text = read_text(path)?;
    let fail = |reason: &str| RecordError::Markers {
        path: path.to_path_buf(),
        begin: begin.to_owned(),
        end: end.to_owned(),
        reason: reason.to_owned(),
    };
    let lines: Vec<&str> = text.lines().collect();
    let places = |marker: &str| -> Vec<usize> {
        lines
            .iter()
            .enumerate()
            .filter(|(_, l)| l.trim() == marker)
            .map(|(i, _)| i)
            .collect()
    };
    let (first, last) = match (places(begin).as_slice(), places(end).as_slice()) {
        ([], _) | (_, []) => return Err(fail("a marker is missing")),
        ([first], [last]) if first < last => (*first, *last),
        ([_], [_]) => return Err(fail("the markers are reversed")),
        _ => return Err(fail("a marker is repeated")),
    };
    let mut result: Vec<&str> = lines[..=first].to_vec();
    result.push(content.trim_end());
    result.extend(&lines[last..]);
    write_atomically(path, &(result.join("\n") + "\n"))
}

#[cfg(test)]
mod tests;
