//! Tables of the rows: `summary.md`, the table of the terminal, and the table of the README.
//!
//! Every number is printed from the rows by these functions and by nothing else.

mod readme;
mod terminal;
mod walk;

use crate::figures::labels::{Labelled, labelled};
use crate::limbs::{LimbRow, limbs_markdown};
use crate::records::{Effort, Machine, Metrics, Quality, Row};
use crate::records_io::{RecordError, write_atomically};
pub use readme::{RESULTS_BEGIN, RESULTS_END, readme_table, replace_readme_table};
use std::collections::BTreeMap;

use std::path::{Path, PathBuf};
pub use terminal::{TERMINAL_WIDTH, terminal_table};
use walk::walk_table;

/// Shown where there is no number.
pub(crate) const NONE: &str = "–";

/// Writes `summary.md` into a results folder and returns its path: the runs, then the limbs. `analysis` holds the text of
/// each suite by its id.
///
/// # Errors
/// Io.
pub fn write_summary(
    dir: &Path,
    rows: &[Row],
    limbs: &[LimbRow],
    analysis: &BTreeMap<String, String>,
) -> Result<PathBuf, RecordError> {
    let path = dir.join("summary.md");
    let text = summary_markdown(rows, analysis) + &limbs_markdown(limbs, analysis);
    write_atomically(&path, &text)?;
    Ok(path)
}

/// The whole summary in Markdown: one table per suite with its analysis, and a second one for suites that walk.
pub fn summary_markdown(rows: &[Row], analysis: &BTreeMap<String, String>) -> String {
    let runs = labelled(rows);
    let mut text = String::from("# Summary\n\n");
    let mut walks = false;
    text.push_str(&origin(rows));
    for suite in suites(&runs) {
        text.push_str(&format!("\n## {suite}\n\n"));
        if let Some(words) = analysis.get(suite) {
            text.push_str(&format!("{}\n\n", words.trim()));
        }
        let of_suite: Vec<&Labelled<'_>> = runs.iter().filter(|r| r.row.suite == suite).collect();
        text.push_str(&markdown(
            &HEADER,
            &of_suite.iter().map(|r| cells(r)).collect::<Vec<_>>(),
        ));
        if let Some(table) = walk_table(&of_suite) {
            text.push_str(&format!("\n{table}"));
            walks = true;
        }
    }
    text.push_str(
        "\nsoft: distance of the compromised task (a frame or the centre of mass) that misses its point most. hard max: the \
         larger of the largest hard position component (m) and rotation angle (rad). exit: when the knees left the \
         singularity for good. g max: largest boundary value, at most 0 inside the ellipse. ×ik1: median step time \
         relative to ik1 on the same scenario.\n",
    );
    if walks {
        text.push_str(&format!("\n{}", walk::LEGEND));
    }
    text
}

const HEADER: [&str; 14] = [
    "scenario",
    "method",
    "n",
    "soft rms (mm)",
    "soft max (mm)",
    "hard max (m, rad)",
    "exit (s)",
    "g max",
    "acc max (rad/s²)",
    "majors",
    "median (µs)",
    "×ik1",
    "relaxed",
    "survived",
];

fn cells(run: &Labelled<'_>) -> Vec<String> {
    let n = run.n.map_or(NONE.to_owned(), |n| n.to_string());
    let mut cells = vec![run.row.scenario.clone(), run.label.clone(), n];
    let Some(Metrics { quality, effort }) = &run.row.metrics else {
        cells.extend(vec![NONE.to_owned(); HEADER.len() - 4]);
        cells.push("declined".to_owned());
        return cells;
    };
    cells.extend([
        number(quality.worst_soft_rms_m().map(|e| e * 1e3)),
        number(quality.worst_soft_max_m().map(|e| e * 1e3)),
        number(Some(hard_max(quality))),
        seconds(quality.singularity_exit_s),
        number(quality.boundary_value_max),
        number(Some(quality.acceleration_max_rad_s2)),
        format!("{:.1}", effort.majors_mean),
        number(Some(effort.step_us_median)),
        ratio(effort),
        effort.relaxed_steps.to_string(),
        yes_no(quality.survived).to_owned(),
    ]);
    cells
}

fn hard_max(quality: &Quality) -> f64 {
    quality.hard_error_max_m.max(quality.hard_error_max_rad)
}

fn ratio(effort: &Effort) -> String {
    number(effort.step_ratio_to_ik1)
}

fn seconds(value: Option<f64>) -> String {
    value.map_or(NONE.to_owned(), |v| format!("{v:.3}"))
}

fn yes_no(survived: bool) -> &'static str {
    if survived { "yes" } else { "NO" }
}

/// Three significant digits, with an exponent outside 0.001 … 99 999.
pub(crate) fn number(value: Option<f64>) -> String {
    let Some(value) = value else {
        return NONE.to_owned();
    };
    let size = value.abs();
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e5).contains(&size) {
        return format!("{value:.2e}");
    }
    let decimals = (2.0 - size.log10().floor()).max(0.0) as usize;
    format!("{value:.decimals$}")
}

pub(crate) fn markdown<S: AsRef<str>>(header: &[S], lines: &[Vec<String>]) -> String {
    let header: Vec<&str> = header.iter().map(AsRef::as_ref).collect();
    let mut text = format!("| {} |\n|{}\n", header.join(" | "), "---|".repeat(header.len()));
    for line in lines {
        let escaped: Vec<String> = line.iter().map(|c| c.replace('|', "\\|")).collect();
        text.push_str(&format!("| {} |\n", escaped.join(" | ")));
    }
    text
}

/// Where and with what the rows were made.
fn origin(rows: &[Row]) -> String {
    made_with(rows.iter().map(|row| (row.revision.as_str(), &row.machine)))
}

/// One line per revision and machine.
pub(crate) fn made_with<'a>(origins: impl Iterator<Item = (&'a str, &'a Machine)>) -> String {
    let mut lines: Vec<String> = Vec::new();
    for (revision, machine) in origins {
        let line = format!(
            "Made with revision {revision} on {}, {} logical processors, {}.",
            machine.cpu, machine.cores, machine.system
        );
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    lines.join("  \n") + "\n"
}

fn suites<'a>(runs: &[Labelled<'a>]) -> Vec<&'a str> {
    let mut suites: Vec<&str> = Vec::new();
    for run in runs {
        if !suites.contains(&run.row.suite.as_str()) {
            suites.push(&run.row.suite);
        }
    }
    suites
}

#[cfg(test)]
mod tests;
