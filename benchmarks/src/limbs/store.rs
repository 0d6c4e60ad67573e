//! The file of limb rows in a results folder: written whole and atomically, as that of the runs.

use super::record::{LimbRow, SCHEMA};
use crate::records_io::{RecordError, read_text, write_atomically};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name of the file.
pub const LIMBS_FILE: &str = "limbs.jsonl";

/// What makes two rows the same row.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LimbKey {
    place: [String; 4],
    seed: u64,
    parameters: String,
    revision: String,
}

impl LimbKey {
    /// Key of a row that may not have been made yet; `place` is suite, robot, limb and set.
    pub fn new(
        place: [&str; 4],
        seed: u64,
        parameters: &BTreeMap<String, serde_json::Value>,
        revision: &str,
    ) -> Self {
        let parameters: Vec<String> = parameters.iter().map(|(k, v)| format!("{k}={v}")).collect();
        Self {
            place: place.map(str::to_owned),
            seed,
            parameters: parameters.join(";"),
            revision: revision.to_owned(),
        }
    }

    /// Key of a row.
    pub fn of(row: &LimbRow) -> Self {
        let place = [&row.suite, &row.robot, &row.limb, &row.set];
        Self::new(
            place.map(String::as_str),
            row.seed,
            &row.parameters,
            &row.revision,
        )
    }
}

/// Reads a file of limb rows; empty lines are skipped. A file that does not exist has none.
///
/// # Errors
/// Io; [`RecordError::BadRow`] with file, line and field for a line that is no limb row.
pub fn read_limbs(path: &Path) -> Result<Vec<LimbRow>, RecordError> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = read_text(path)?;
    let lines = text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty());
    lines.map(|(i, line)| parse(path, i + 1, line)).collect()
}

fn parse(path: &Path, line: usize, text: &str) -> Result<LimbRow, RecordError> {
    let bad = |reason: String| RecordError::BadRow {
        path: path.to_path_buf(),
        line,
        reason,
    };
    let row: LimbRow = serde_json::from_str(text).map_err(|e| bad(e.to_string()))?;
    if row.schema != SCHEMA {
        return Err(bad(format!(
            "field schema: found {:?}, this program reads {SCHEMA:?}",
            row.schema
        )));
    }
    Ok(row)
}

/// The limb rows of a results folder.
#[derive(Clone, Debug)]
pub struct LimbStore {
    path: PathBuf,
    rows: Vec<LimbRow>,
}

impl LimbStore {
    /// Opens the rows of a folder; neither the folder nor the file has to exist, and nothing is written yet.
    ///
    /// # Errors
    /// As [`read_limbs`].
    pub fn open(dir: &Path) -> Result<Self, RecordError> {
        let path = dir.join(LIMBS_FILE);
        let rows = read_limbs(&path)?;
        Ok(Self { path, rows })
    }

    /// All rows, oldest first.
    pub fn rows(&self) -> &[LimbRow] {
        &self.rows
    }

    /// The row of a key.
    pub fn find(&self, key: &LimbKey) -> Option<&LimbRow> {
        self.rows.iter().find(|row| LimbKey::of(row) == *key)
    }

    /// Adds rows, in place of those of the same keys, and writes the file once.
    ///
    /// # Errors
    /// [`RecordError::BadRow`] for a row that JSON cannot hold, with the line it would have had; Io. The store is then as
    /// before.
    pub fn add(&mut self, rows: &[LimbRow]) -> Result<(), RecordError> {
        let keys: Vec<LimbKey> = rows.iter().map(LimbKey::of).collect();
        let kept = self.rows.iter().filter(|old| !keys.contains(&LimbKey::of(old)));
        let all: Vec<LimbRow> = kept.chain(rows).cloned().collect();
        let lines = all.iter().enumerate().map(|(i, row)| self.line(i + 1, row));
        let text: String = lines.collect::<Result<_, _>>()?;
        write_atomically(&self.path, &text)?;
        self.rows = all;
        Ok(())
    }

    /// One line with its newline, proven to read back as the same row.
    fn line(&self, number: usize, row: &LimbRow) -> Result<String, RecordError> {
        let line = serde_json::to_string(row).unwrap_or_default();
        match serde_json::from_str::<LimbRow>(&line) {
            Ok(back) if back == *row => Ok(line + "\n"),
            _ => Err(RecordError::BadRow {
                path: self.path.clone(),
                line: number,
                reason: format!(
                    "{} {} {} {} holds a number that is not finite",
                    row.suite, row.robot, row.limb, row.set
                ),
            }),
        }
    }
}
