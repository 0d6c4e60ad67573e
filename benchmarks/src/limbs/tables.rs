//! Tables of limb rows: of the terminal, of `summary.md`, and of the README. Every number comes from the rows.

use super::record::{ContinuityFindings, Findings, GridFindings, LimbRow, ReachFindings};
use crate::records_io::{RecordError, replace_between};
use crate::summary::{NONE, made_with, markdown, number};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Line before the generated table of a README.
pub const CLOSED_FORM_BEGIN: &str = "<!-- closed-form:begin -->";
/// Line after it.
pub const CLOSED_FORM_END: &str = "<!-- closed-form:end -->";

/// Limbs of one robot and one family: right and left, mostly.
struct Group<'a> {
    robot: &'a str,
    family: &'a str,
    rows: Vec<&'a LimbRow>,
}

fn groups<'a>(rows: impl Iterator<Item = &'a LimbRow>) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    for row in rows {
        let same = |g: &&mut Group<'a>| g.robot == row.robot && g.family == row.family;
        match groups.iter_mut().find(same) {
            Some(group) => group.rows.push(row),
            None => groups.push(Group {
                robot: &row.robot,
                family: &row.family,
                rows: vec![row],
            }),
        }
    }
    groups
}

/// A family in few letters.
fn short(family: &str) -> &str {
    match family {
        "leg of the paper" => "leg",
        "arm of the paper" => "arm",
        "arm of four joints" => "arm of 4",
        _ => family.rsplit(", ").next().unwrap_or(family),
    }
}

/// Several rows of a grid suite as one.
#[derive(Default)]
struct GridSum {
    poses: u64,
    error: f64,
    compared: u64,
    recovered: u64,
    excluded: u64,
    indicated: Option<u64>,
    distinct: Option<u32>,
    unsolved: u64,
    times: Vec<(f64, f64)>,
}

impl GridSum {
    fn of<'a>(rows: impl Iterator<Item = &'a GridFindings>) -> Self {
        let mut sum = Self::default();
        for found in rows {
            sum.poses += found.poses;
            sum.error = sum.error.max(found.error_max_m).max(found.error_max_rad);
            sum.compared += found.compared;
            sum.recovered += found.recovered;
            sum.excluded += found.excluded;
            sum.unsolved += found.unsolved + found.not_finite;
            if let Some(right) = found.indicated {
                sum.indicated = Some(sum.indicated.unwrap_or(0) + right);
            }
            sum.distinct = [sum.distinct, found.distinct_compared_min]
                .into_iter()
                .flatten()
                .min();
            sum.times.push((found.times.solve_ns, found.times.ratio));
        }
        sum
    }

    fn median(&self, value: fn(&(f64, f64)) -> f64) -> Option<f64> {
        crate::statistics::median(&mut self.times.iter().map(value).collect::<Vec<_>>())
    }
}

fn is_on_axis(row: &LimbRow) -> bool {
    row.set.starts_with("on-axis")
}

fn grids<'a>(rows: &[&'a LimbRow], wanted: impl Fn(&LimbRow) -> bool) -> Vec<&'a GridFindings> {
    let of_grid = |row: &&'a LimbRow| match &row.found {
        Findings::Grid(found) if wanted(row) => Some(found),
        _ => None,
    };
    rows.iter().filter_map(of_grid).collect()
}

fn paths<'a>(rows: &[&'a LimbRow]) -> Vec<(&'a str, &'a ContinuityFindings)> {
    let of_paths = |row: &&'a LimbRow| match &row.found {
        Findings::Continuity(found) => Some((row.set.as_str(), found)),
        _ => None,
    };
    rows.iter().filter_map(of_paths).collect()
}

fn reaches<'a>(rows: &[&'a LimbRow]) -> Vec<&'a ReachFindings> {
    let of_reach = |row: &&'a LimbRow| match &row.found {
        Findings::Reach(found) => Some(found),
        _ => None,
    };
    rows.iter().filter_map(of_reach).collect()
}

fn yes_no(held: bool) -> String {
    if held { "yes" } else { "NO" }.to_owned()
}

fn exponent(value: f64) -> String {
    if value > 0.0 {
        format!("{value:.1e}")
    } else {
        "0".to_owned()
    }
}

fn part(count: u64, all: u64) -> String {
    format!("{count}/{all}")
}

fn held(rows: &[&LimbRow]) -> bool {
    rows.iter().all(|row| row.found.held())
}

/// Header, lines and legend of one suite as the terminal and the summary show it.
struct Shown {
    header: Vec<&'static str>,
    lines: Vec<Vec<String>>,
    legend: &'static str,
}

fn grid_lines(rows: &[&LimbRow]) -> Shown {
    let line = |group: &Group<'_>| {
        let on = GridSum::of(grids(&group.rows, is_on_axis).into_iter());
        let off = GridSum::of(grids(&group.rows, |row| !is_on_axis(row)).into_iter());
        vec![
            group.robot.to_owned(),
            short(group.family).to_owned(),
            on.poses.to_string(),
            exponent(on.error),
            (on.compared - on.recovered + on.unsolved).to_string(),
            off.poses.to_string(),
            exponent(off.error),
            (off.compared - off.recovered + off.unsolved).to_string(),
            off.excluded.to_string(),
            off.indicated
                .map_or(NONE.to_owned(), |right| (off.compared - right).to_string()),
            off.distinct.map_or(NONE.to_owned(), |n| n.to_string()),
            number(off.median(|t| t.0)),
            number(off.median(|t| t.1)),
            yes_no(held(&group.rows)),
        ]
    };
    Shown {
        header: vec![
            "robot", "limb", "on axis", "error", "lost", "off axis", "error", "lost", "excl", "wrong",
            "sols", "ns", "x FK", "held",
        ],
        lines: groups(rows.iter().copied()).iter().map(line).collect(),
        legend: "On and off axis: poses. error: largest of any solution (m, rad). lost: generating joints not found, \
                 pose refused. excl: next to a singular set, judged by forward kinematics alone. wrong: indicated \
                 branch. sols: least number of distinct solutions. ns: all solutions of a pose; x FK: relative to one \
                 tree pass over the limb.",
    }
}

fn continuity_lines(rows: &[&LimbRow]) -> Shown {
    let line = |group: &Group<'_>| {
        let all = paths(&group.rows);
        let (smooth, turned): (Vec<_>, Vec<_>) = all.iter().partition(|(set, _)| set.ends_with("smooth"));
        let sum = |of: &[&(&str, &ContinuityFindings)], value: fn(&ContinuityFindings) -> u64| -> u64 {
            of.iter().map(|(_, found)| value(found)).sum()
        };
        let worst = |of: &[&(&str, &ContinuityFindings)], value: fn(&ContinuityFindings) -> f64| {
            of.iter().map(|(_, found)| value(found)).fold(0.0, f64::max)
        };
        let error = worst(&smooth, |f| f.error_max).max(worst(&turned, |f| f.error_max));
        vec![
            group.robot.to_owned(),
            short(group.family).to_owned(),
            sum(&smooth, |f| f.paths).to_string(),
            sum(&smooth, |f| f.jumps).to_string(),
            number(Some(worst(&smooth, |f| f.step_ratio_max))),
            sum(&smooth, |f| f.ended_elsewhere).to_string(),
            sum(&turned, |f| f.paths).to_string(),
            part(sum(&turned, |f| f.forced), sum(&turned, |f| f.jumps)),
            (sum(&smooth, |f| f.unsolved) + sum(&turned, |f| f.unsolved)).to_string(),
            exponent(error),
            yes_no(held(&group.rows)),
        ]
    };
    Shown {
        header: vec![
            "robot", "limb", "smooth", "jumps", "step", "other", "turned", "forced", "lost", "error", "held",
        ],
        lines: groups(rows.iter().copied()).iter().map(line).collect(),
        legend: "smooth, turned: paths. jumps: steps that stay large however finely they are divided. step: largest \
                 step as a multiple of that of the path. other: paths that end in another posture. forced: jumps with no \
                 joints near that meet the pose, of all jumps of turned paths. lost: samples without solution. error: m or rad.",
    }
}

fn reach_lines(rows: &[&LimbRow]) -> Shown {
    let line = |group: &Group<'_>| {
        let all = reaches(&group.rows);
        let tried: u64 = all
            .iter()
            .map(|f| f.orientations * f.distance_m.len() as u64)
            .sum();
        let reachable: u64 = all.iter().flat_map(|f| &f.reachable).sum();
        let known: Option<u64> = all.iter().map(|f| f.disagreements).sum();
        let boundary: Option<u64> = all.iter().map(|f| f.at_boundary).sum();
        let off = all.iter().filter_map(|f| deviation(f)).reduce(f64::max);
        vec![
            group.robot.to_owned(),
            short(group.family).to_owned(),
            tried.to_string(),
            reachable.to_string(),
            boundary.map_or(NONE.to_owned(), |n| n.to_string()),
            known.map_or(NONE.to_owned(), |n| n.to_string()),
            number(off),
            exponent(all.iter().map(|f| f.error_max).fold(0.0, f64::max)),
            yes_no(held(&group.rows)),
        ]
    };
    let studied = rows
        .iter()
        .copied()
        .filter(|row| matches!(row.found, Findings::Reach(_)));
    Shown {
        header: vec![
            "robot",
            "limb",
            "tried",
            "reachable",
            "boundary",
            "disagree",
            "off by",
            "error",
            "held",
        ],
        lines: groups(studied).iter().map(line).collect(),
        legend: "tried, reachable: poses. boundary: poses 1.1e-9 m beside the boundary of reach. disagree: poses that solver \
                 and geometry decide differently, these included. off by: largest difference of measured and expected fraction at one distance. error: m or rad.",
    }
}

/// Largest difference between measured and expected fraction.
fn deviation(found: &ReachFindings) -> Option<f64> {
    let expected = found.expected.as_ref()?;
    let measured = found
        .reachable
        .iter()
        .map(|n| *n as f64 / found.orientations as f64);
    measured
        .zip(expected)
        .map(|(m, e)| (m - e).abs())
        .reduce(f64::max)
}

fn shown(rows: &[&LimbRow]) -> Option<Shown> {
    let is = |of: fn(&Findings) -> bool| rows.iter().any(|row| of(&row.found));
    if is(|f| matches!(f, Findings::Grid(_))) {
        Some(grid_lines(rows))
    } else if is(|f| matches!(f, Findings::Continuity(_))) {
        Some(continuity_lines(rows))
    } else if is(|f| matches!(f, Findings::Reach(_))) {
        Some(reach_lines(rows))
    } else {
        None
    }
}

fn by_suite(rows: &[LimbRow]) -> Vec<(&str, Vec<&LimbRow>)> {
    let mut suites: Vec<(&str, Vec<&LimbRow>)> = Vec::new();
    for row in rows {
        match suites.iter_mut().find(|(suite, _)| *suite == row.suite) {
            Some((_, of_suite)) => of_suite.push(row),
            None => suites.push((&row.suite, vec![row])),
        }
    }
    suites
}

/// Columns of the terminal.
const WIDTH: usize = crate::summary::TERMINAL_WIDTH;

/// One table per suite, one line per robot and family of limb.
pub fn limbs_terminal(rows: &[LimbRow]) -> String {
    let mut text = String::new();
    for (suite, of_suite) in by_suite(rows) {
        let Some(Shown {
            header,
            lines,
            legend,
        }) = shown(&of_suite)
        else {
            continue;
        };
        text.push_str(&format!("\n{suite}\n"));
        let header: Vec<String> = header.into_iter().map(str::to_owned).collect();
        let widest = |column: usize| {
            let cells = lines
                .iter()
                .chain([&header])
                .map(|line| line[column].chars().count());
            cells.max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..header.len()).map(widest).collect();
        for line in [&header].into_iter().chain(&lines) {
            push_line(&mut text, line, &widths);
        }
        push_wrapped(&mut text, legend);
    }
    text
}

fn push_line(text: &mut String, cells: &[String], widths: &[usize]) {
    let mut line = String::new();
    for (index, (cell, width)) in cells.iter().zip(widths).enumerate() {
        let written = if index < 2 {
            write!(line, "{cell:<width$} ")
        } else {
            write!(line, "{cell:>width$} ")
        };
        written.expect("writing to a String cannot fail");
    }
    text.push_str(line.trim_end());
    text.push('\n');
}

fn push_wrapped(text: &mut String, words: &str) {
    let mut length = 0;
    for word in words.split_whitespace() {
        let needed = word.chars().count() + usize::from(length > 0);
        if length + needed > WIDTH {
            text.push('\n');
            length = 0;
        }
        if length > 0 {
            text.push(' ');
        }
        text.push_str(word);
        length += needed;
    }
    text.push('\n');
}

/// The limb suites in Markdown: folded tables, the analysis of each suite, and every row with what it lost.
pub fn limbs_markdown(rows: &[LimbRow], analysis: &BTreeMap<String, String>) -> String {
    let mut text = String::new();
    for (suite, of_suite) in by_suite(rows) {
        text.push_str(&format!("\n## {suite}\n\n"));
        if let Some(words) = analysis.get(suite) {
            text.push_str(&format!("{}\n\n", words.trim()));
        }
        if let Some(Shown {
            header,
            lines,
            legend,
        }) = shown(&of_suite)
        {
            text.push_str(&markdown(&header, &lines));
            text.push_str(&format!("\n{legend}\n"));
        }
        let sets: Vec<Vec<String>> = of_suite.iter().filter_map(|row| set_line(row)).collect();
        if !sets.is_empty() {
            text.push_str("\nEvery row:\n\n");
            let header = ["robot", "limb", "set", "tried", "found", "error (m, rad)", "held"];
            text.push_str(&markdown(&header, &sets));
        }
    }
    text
}

/// One row in a line: what was tried, and what came of it.
fn set_line(row: &LimbRow) -> Option<Vec<String>> {
    let (tried, found, error) = match &row.found {
        Findings::Grid(f) => {
            let of = f.grid_points.filter(|points| *points > f.poses as f64);
            let of = of.map_or(String::new(), |points| format!(" of {points}"));
            let found = format!("generating joints {}", part(f.recovered, f.compared));
            (
                format!("{} poses{of}", f.poses),
                found,
                f.error_max_m.max(f.error_max_rad),
            )
        }
        Findings::Continuity(f) => {
            let found = format!("{} jumps, {} forced", f.jumps, f.forced);
            (
                format!("{} paths, {} steps", f.paths, f.steps),
                found,
                f.error_max,
            )
        }
        Findings::Reach(f) => {
            let tried = f.orientations * f.distance_m.len() as u64;
            let found = format!("{} reachable", f.reachable.iter().sum::<u64>());
            (format!("{tried} poses"), found, f.error_max)
        }
        Findings::Slice(f) => {
            let cells = f.x_m.len() * f.z_m.len();
            let found = f.distinct.iter().flatten().filter(|n| **n > 0).count();
            (
                format!("{cells} cells"),
                format!("{found} reachable"),
                f.error_max,
            )
        }
        Findings::Postures(f) => {
            let error = f.solutions.iter().map(|s| s.error).fold(0.0, f64::max);
            (
                "1 pose".to_owned(),
                format!("{} solutions", f.solutions.len()),
                error,
            )
        }
    };
    let held = yes_no(row.found.held());
    Some(vec![
        row.robot.clone(),
        row.limb.clone(),
        row.set.clone(),
        tried,
        found,
        exponent(error),
        held,
    ])
}

/// The table of the README: one line per robot and family of limb.
pub fn readme_limbs(rows: &[LimbRow]) -> String {
    let origins = rows.iter().map(|row| (row.revision.as_str(), &row.machine));
    let line = |group: &Group<'_>| {
        let on = GridSum::of(grids(&group.rows, is_on_axis).into_iter());
        let off = GridSum::of(grids(&group.rows, |row| !is_on_axis(row)).into_iter());
        let random = GridSum::of(grids(&group.rows, |row| row.set == "random").into_iter());
        let followed = paths(&group.rows);
        let crossed: u64 = followed.iter().map(|(_, f)| f.paths).sum();
        let unforced: u64 = followed.iter().map(|(_, f)| f.jumps - f.forced).sum();
        let reach = reaches(&group.rows);
        let tried: u64 = reach
            .iter()
            .map(|f| f.orientations * f.distance_m.len() as u64 + f.at_boundary.unwrap_or(0))
            .sum();
        let disagreements: Option<u64> = reach.iter().map(|f| f.disagreements).sum();
        let counted = |all: u64, text: String| if all == 0 { NONE.to_owned() } else { text };
        vec![
            group.robot.to_owned(),
            short(group.family).to_owned(),
            counted(on.poses, part(on.recovered, on.compared)),
            counted(on.poses, exponent(on.error)),
            counted(off.poses, part(off.recovered, off.compared)),
            counted(off.poses, exponent(off.error)),
            off.indicated
                .map_or(NONE.to_owned(), |right| part(right, off.compared)),
            random.distinct.map_or(NONE.to_owned(), |n| n.to_string()),
            counted(crossed, part(unforced, crossed)),
            disagreements
                .filter(|_| tried > 0)
                .map_or(NONE.to_owned(), |n| part(n, tried)),
            number(random.median(|t| t.0)),
            number(random.median(|t| t.1)),
        ]
    };
    let lines: Vec<Vec<String>> = groups(rows.iter()).iter().map(line).collect();
    made_with(origins) + "\n" + &markdown(&README_HEADER, &lines)
}

const README_HEADER: [&str; 12] = [
    "robot",
    "limb",
    "on axis: joints found",
    "largest error (m, rad)",
    "off axis and random: joints found",
    "largest error (m, rad)",
    "indicated branch right",
    "solutions",
    "jumps not forced / paths",
    "reach misjudged / poses",
    "all solutions (ns)",
    "×FK",
];

/// Puts the table between [`CLOSED_FORM_BEGIN`] and [`CLOSED_FORM_END`] of a file.
///
/// # Errors
/// [`RecordError::Markers`], Io.
pub fn replace_readme_limbs(readme: &Path, rows: &[LimbRow]) -> Result<(), RecordError> {
    replace_between(readme, CLOSED_FORM_BEGIN, CLOSED_FORM_END, &readme_limbs(rows))
}
