//! Tables of the rows: `summary.md`, the table of the terminal, and the table of the README.
//!
//! Every number is printed from the rows by these functions and by nothing else.

use crate::figures::labels::{Labelled, labelled};
use crate::records::{Effort, Metrics, Quality, Row};
use crate::records_io::{RecordError, replace_between, write_atomically};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Line before the generated table of a README.
pub const RESULTS_BEGIN: &str = "<!-- results:begin -->";
/// Line after it.
pub const RESULTS_END: &str = "<!-- results:end -->";
/// Columns of the terminal.
pub const TERMINAL_WIDTH: usize = 100;
/// In a suite with more scenarios than this the terminal shows the first and folds the others into one line per method.
const UNFOLDED_SCENARIOS: usize = 3;
/// Shown where there is no number.
const NONE: &str = "–";

/// Writes `summary.md` into a results folder and returns its path. `analysis` holds the text of each suite by its id.
///
/// # Errors
/// Io.
pub fn write_summary(
    dir: &Path,
    rows: &[Row],
    analysis: &BTreeMap<String, String>,
) -> Result<PathBuf, RecordError> {
    let path = dir.join("summary.md");
    write_atomically(&path, &summary_markdown(rows, analysis))?;
    Ok(path)
}

/// Puts the table of the rows between [`RESULTS_BEGIN`] and [`RESULTS_END`] of a file.
///
/// # Errors
/// [`RecordError::Markers`], Io.
pub fn replace_readme_table(readme: &Path, rows: &[Row]) -> Result<(), RecordError> {
    replace_between(readme, RESULTS_BEGIN, RESULTS_END, &readme_table(rows))
}

/// The whole summary in Markdown: one table per suite with its analysis.
pub fn summary_markdown(rows: &[Row], analysis: &BTreeMap<String, String>) -> String {
    let runs = labelled(rows);
    let mut text = String::from("# Summary\n\n");
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
    }
    text.push_str(
        "\nhard max: the larger of the largest hard position component (m) and rotation angle (rad). exit: when the knees \
         left the singularity for good. g max: largest boundary value, at most 0 inside the ellipse. ×ik1: median step \
         time relative to ik1 on the same scenario.\n",
    );
    text
}

const HEADER: [&str; 14] = [
    "scenario",
    "method",
    "n",
    "CoM rms (mm)",
    "CoM max (mm)",
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
        number(quality.com_error_rms_m.map(|e| e * 1e3)),
        number(quality.com_error_max_m.map(|e| e * 1e3)),
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
fn number(value: Option<f64>) -> String {
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

fn markdown<S: AsRef<str>>(header: &[S], lines: &[Vec<String>]) -> String {
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
    let mut lines: Vec<String> = Vec::new();
    for row in rows {
        let machine = &row.machine;
        let line = format!(
            "Made with revision {} on {}, {} logical processors, {}.",
            row.revision, machine.cpu, machine.cores, machine.system
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

/// A table that fits [`TERMINAL_WIDTH`] columns.
///
/// Errors are in mm, `hard` is in m or rad, whichever is larger. In a suite with more than three scenarios the first is
/// shown by itself and the others as one line per method: the worst of each value, the median of the times, and how many
/// survived.
pub fn terminal_table(rows: &[Row]) -> String {
    let runs = labelled(rows);
    let mut text = String::new();
    for suite in suites(&runs) {
        let of_suite: Vec<&Labelled<'_>> = runs.iter().filter(|r| r.row.suite == suite).collect();
        text.push_str(&format!("\n{suite}\n"));
        let header: Vec<String> = TERMINAL.iter().map(|c| c.0.to_owned()).collect();
        push_line(&mut text, &header);
        for line in terminal_lines(&of_suite) {
            let mut line_cells = vec![line.scenario, line.method, line.n];
            line_cells.extend(line.values);
            push_line(&mut text, &line_cells);
        }
    }
    text
}

fn push_line(text: &mut String, cells: &[String]) {
    let mut line = String::new();
    for (index, (cell, (_, width))) in cells.iter().zip(TERMINAL).enumerate() {
        let short: String = cell.chars().take(width).collect();
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
    lines.extend(by_method(&rest).iter().map(|group| line(&name, group)));
    lines
}

/// Groups of equal label and n.
fn by_method<'a, 'b>(runs: &[&'b Labelled<'a>]) -> Vec<Vec<&'b Labelled<'a>>> {
    let mut groups: BTreeMap<(&str, std::cmp::Reverse<Option<u64>>), Vec<&'b Labelled<'a>>> = BTreeMap::new();
    for run in runs {
        groups
            .entry((&run.label, std::cmp::Reverse(run.n)))
            .or_default()
            .push(run);
    }
    groups.into_values().collect()
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
            number(worst(&|m| m.quality.com_error_rms_m.map(|e| e * 1e3))),
            number(worst(&|m| m.quality.com_error_max_m.map(|e| e * 1e3))),
            worst(&|m| Some(hard_max(&m.quality))).map_or(NONE.to_owned(), |h| format!("{h:.1e}")),
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

/// The table of the README: one line per method and budget over the Coman suites.
pub fn readme_table(rows: &[Row]) -> String {
    let runs = labelled(rows);
    let header = [
        "method",
        "n",
        "squat: CoM rms (mm)",
        "stretch: CoM rms (mm)",
        "stretch: peak velocity (rad/s)",
        "stretch: exit (s)",
        "asymmetric C",
        "family",
        "lean D",
        "squat: median step (µs)",
        "×ik1",
    ];
    let mut lines: Vec<Vec<String>> = Vec::new();
    let tracked: Vec<&Labelled<'_>> = runs
        .iter()
        .filter(|r| TRACKED.contains(&r.row.suite.as_str()))
        .collect();
    for group in by_method(&tracked) {
        let of = |suite: &str, scenario: &str| {
            group
                .iter()
                .find(|r| r.row.suite == suite && r.row.scenario == scenario)
                .map(|r| r.row)
        };
        let metrics = |row: Option<&Row>| row.and_then(|r| r.metrics.clone());
        let (squat, stretch) = (metrics(of(TRACKED[0], "A")), metrics(of(TRACKED[1], "B")));
        let millimetres = |m: &Option<Metrics>| {
            number(
                m.as_ref()
                    .and_then(|m| m.quality.com_error_rms_m)
                    .map(|e| e * 1e3),
            )
        };
        lines.push(vec![
            group[0].label.clone(),
            group[0].n.map_or(NONE.to_owned(), |n| n.to_string()),
            millimetres(&squat),
            millimetres(&stretch),
            number(stretch.as_ref().map(|m| m.quality.velocity_max_rad_s)),
            seconds(stretch.as_ref().and_then(|m| m.quality.singularity_exit_s)),
            survival(of(TRACKED[2], "C")),
            family(&group),
            survival(of(TRACKED[3], "D")),
            number(squat.as_ref().map(|m| m.effort.step_us_median)),
            squat.as_ref().map_or(NONE.to_owned(), |m| ratio(&m.effort)),
        ]);
    }
    let mut text = origin(rows);
    text.push('\n');
    text.push_str(&markdown(&header, &lines));
    text
}

/// Suites of the README table, in the order of its columns.
const TRACKED: [&str; 4] = ["coman/squat", "coman/stretch", "coman/asymmetric", "coman/lean"];

fn survival(row: Option<&Row>) -> String {
    match row.map(|r| &r.metrics) {
        None => NONE.to_owned(),
        Some(None) => "declined".to_owned(),
        Some(Some(m)) if m.quality.survived => "survives".to_owned(),
        Some(Some(_)) => "lost".to_owned(),
    }
}

/// Survivors among the asymmetric scenarios other than C.
fn family(group: &[&Labelled<'_>]) -> String {
    let is_family = |r: &&&Labelled<'_>| r.row.suite == TRACKED[2] && r.row.scenario != "C";
    let members: Vec<&&Labelled<'_>> = group.iter().filter(is_family).collect();
    if members.is_empty() {
        return NONE.to_owned();
    }
    let survived = |r: &&&&Labelled<'_>| r.row.metrics.as_ref().is_some_and(|m| m.quality.survived);
    format!("{}/{}", members.iter().filter(survived).count(), members.len())
}
