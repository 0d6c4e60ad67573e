//! The table of the terminal.

use super::walk::{TERMINAL_LEGEND, terminal_walk_table};
use super::{NONE, hard_max, number, seconds, suites, yes_no};
use crate::figures::labels::{Labelled, by_method, labelled, numbered};
use crate::records::{Metrics, Row, TerminationRecord};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Columns of the terminal.
pub const TERMINAL_WIDTH: usize = 100;
/// In a suite with more scenarios than this the first is shown and the others are folded into one line per method.
const UNFOLDED_SCENARIOS: usize = 3;

/// One line of the terminal table: a run, or the worst of several.
struct Line {
    scenario: String,
    method: String,
    n: String,
    values: Vec<String>,
}

/// Name and width of the columns of the terminal table; with a space between each they fill 98 columns.
const TERMINAL: [(&str, usize); 12] = [
    ("scenario", 13),
    ("method", 15),
    ("n", 3),
    ("rms mm", 8),
    ("max mm", 8),
    ("hard", 8),
    ("exit s", 6),
    ("majors", 6),
    ("us", 7),
    ("x ik1", 6),
    ("g<=0", 4),
    ("ok", 5),
];

/// What the columns mean, in as many columns.
const LEGEND: &str = "
rms, max: distance of the compromised task that misses its point most. hard: largest miss of a hard
task (m or rad). exit: when both knees left the straight leg for good. majors: outer iterations per
step. us: median step time; x ik1: the same relative to ik1. g<=0: inside the ellipse, whatever
boundary was given. ok: survived; decl.: declined, for the reason given.
";

/// A table that fits [`TERMINAL_WIDTH`] columns.
///
/// Errors are in mm, `hard` is in m or rad, whichever is larger. In a suite with more than three scenarios the first is
/// shown by itself and the others as one line per method: the worst of each value, the median of the times, and how many
/// survived.
pub fn terminal_table(rows: &[Row]) -> String {
    let runs = labelled(rows);
    let mut text = String::new();
    let mut walks = false;
    for suite in suites(&runs) {
        let of_suite: Vec<&Labelled<'_>> = runs.iter().filter(|r| r.row.suite == suite).collect();
        text.push_str(&format!("\n{suite}\n"));
        let header: Vec<String> = TERMINAL.iter().map(|c| c.0.to_owned()).collect();
        push_line(&mut text, &header, &TERMINAL);
        let mut notes = Vec::new();
        for line in terminal_lines(&of_suite) {
            let mut line_cells = vec![
                line.scenario,
                numbered(line.method, TERMINAL[1].1, &mut notes),
                line.n,
            ];
            line_cells.extend(line.values);
            push_line(&mut text, &line_cells, &TERMINAL);
        }
        for (i, note) in notes.iter().enumerate() {
            text.push_str(&format!("[{}] {note}\n", i + 1));
        }
        text.push_str(&refusals(&of_suite));
        text.push_str(&endings(&of_suite));
        if let Some(table) = terminal_walk_table(&of_suite) {
            text.push_str(&format!("\n{table}"));
            walks = true;
        }
    }
    if !text.is_empty() {
        text.push_str(LEGEND);
    }
    if walks {
        text.push_str(TERMINAL_LEGEND);
    }
    text
}

/// Endings of steps that are in order.
const IN_ORDER: [&str; 3] = ["converged", "stepped", "budget"];

/// How many steps of a method ended otherwise than they should, over all scenarios.
fn endings(runs: &[&Labelled<'_>]) -> String {
    let mut text = String::new();
    for group in by_method(runs.iter().copied()) {
        let (mut total, mut words) = (0, BTreeMap::new());
        for run in &group {
            if let TerminationRecord::Completed { steps } = &run.row.termination {
                for (word, count) in steps {
                    total += count;
                    if !IN_ORDER.contains(&word.as_str()) {
                        *words.entry(word.as_str()).or_insert(0) += count;
                    }
                }
            }
        }
        if let Some(first) = group.first().filter(|_| !words.is_empty()) {
            let n = first.n.map_or(String::new(), |n| format!(" n={n}"));
            let words: Vec<_> = words
                .iter()
                .map(|(word, count)| format!("{count} {word}"))
                .collect();
            let words = words.join(", ");
            text.push_str(&format!("{}{n}: of {total} steps {words}\n", first.label));
        }
    }
    text
}

/// Who refused what, and why, each reason once.
fn refusals(runs: &[&Labelled<'_>]) -> String {
    let mut lines: Vec<String> = Vec::new();
    for run in runs {
        if let TerminationRecord::Declined { reason } = &run.row.termination {
            let line = format!("{} declined: {reason}\n", run.label);
            if !lines.contains(&line) {
                lines.push(line);
            }
        }
    }
    lines.concat()
}

/// One line of a table whose first two columns are words; the others are numbers.
pub(super) fn push_line(text: &mut String, cells: &[String], columns: &[(&str, usize)]) {
    let mut line = String::new();
    for (index, (cell, &(_, width))) in cells.iter().zip(columns).enumerate() {
        let short = shortened(cell, width);
        let written = if index < 2 {
            write!(line, "{short:<width$} ")
        } else {
            write!(line, "{short:>width$} ")
        };
        written.expect("writing to a String cannot fail");
    }
    text.push_str(line.trim_end());
    text.push('\n');
}

/// At most `width` characters; what is too long is cut in the middle, since labels differ at their ends.
fn shortened(cell: &str, width: usize) -> String {
    let length = cell.chars().count();
    if length <= width {
        return cell.to_owned();
    }
    let head = width / 2;
    let tail = width - head - 1;
    cell.chars()
        .take(head)
        .chain(['…'])
        .chain(cell.chars().skip(length - tail))
        .collect()
}

fn terminal_lines(runs: &[&Labelled<'_>]) -> Vec<Line> {
    let mut scenarios: Vec<&str> = Vec::new();
    for run in runs {
        if !scenarios.contains(&run.row.scenario.as_str()) {
            scenarios.push(&run.row.scenario);
        }
    }
    let unfolded = if scenarios.len() > UNFOLDED_SCENARIOS {
        1
    } else {
        scenarios.len()
    };
    let mut lines: Vec<Line> = Vec::new();
    for scenario in &scenarios[..unfolded] {
        lines.extend(
            runs.iter()
                .filter(|r| r.row.scenario == *scenario)
                .map(|r| line(scenario, &[r])),
        );
    }
    let rest: Vec<&Labelled<'_>> = runs
        .iter()
        .copied()
        .filter(|r| scenarios[unfolded..].contains(&r.row.scenario.as_str()))
        .collect();
    let name = format!("{} others", scenarios.len() - unfolded);
    lines.extend(by_method(rest).iter().map(|group| line(&name, group)));
    lines
}

fn line(scenario: &str, runs: &[&Labelled<'_>]) -> Line {
    let metrics: Vec<&Metrics> = runs.iter().filter_map(|r| r.row.metrics.as_ref()).collect();
    let worst =
        |value: &dyn Fn(&Metrics) -> Option<f64>| metrics.iter().filter_map(|m| value(m)).reduce(f64::max);
    let middle = |value: &dyn Fn(&Metrics) -> Option<f64>| {
        crate::statistics::median(&mut metrics.iter().filter_map(|m| value(m)).collect::<Vec<_>>())
    };
    let survived = metrics.iter().filter(|m| m.quality.survived).count();
    let inside = worst(&|m| m.quality.boundary_value_max).map_or(NONE, |g| yes_no(g <= INSIDE));
    let ok = match runs {
        [run] => run
            .row
            .metrics
            .as_ref()
            .map_or("decl.".to_owned(), |m| yes_no(m.quality.survived).to_owned()),
        _ => format!("{survived}/{}", runs.len()),
    };
    let first = runs.first();
    Line {
        scenario: scenario.to_owned(),
        method: first.map_or(String::new(), |r| r.label.clone()),
        n: first.and_then(|r| r.n).map_or(NONE.to_owned(), |n| n.to_string()),
        values: vec![
            number(worst(&|m| m.quality.worst_soft_rms_m().map(|e| e * 1e3))),
            number(worst(&|m| m.quality.worst_soft_max_m().map(|e| e * 1e3))),
            worst(&|m| (!m.quality.hard_error_max.is_empty()).then(|| hard_max(&m.quality)))
                .map_or(NONE.to_owned(), |h| format!("{h:.1e}")),
            seconds(worst(&|m| m.quality.singularity_exit_s)),
            worst(&|m| Some(m.effort.majors_mean)).map_or(NONE.to_owned(), |m| format!("{m:.1}")),
            number(middle(&|m| Some(m.effort.step_us_median))),
            number(middle(&|m| m.effort.step_ratio_to_ik1)),
            inside.to_owned(),
            ok,
        ],
    }
}

/// Boundary value that counts as inside, as for `survived`.
const INSIDE: f64 = 1e-4;
