//! The table of the README.

use super::{NONE, markdown, number, origin, ratio, seconds};
use crate::figures::labels::{Labelled, by_method, labelled};
use crate::records::{Metrics, Row};
use crate::records_io::{RecordError, replace_between};
use std::collections::BTreeMap;
use std::path::Path;

/// Line before the generated table of a README.
pub const RESULTS_BEGIN: &str = "<!-- results:begin -->";
/// Line after it.
pub const RESULTS_END: &str = "<!-- results:end -->";

/// Puts the table of the rows between [`RESULTS_BEGIN`] and [`RESULTS_END`] of a file.
///
/// # Errors
/// [`RecordError::Markers`], Io.
pub fn replace_readme_table(readme: &Path, rows: &[Row]) -> Result<(), RecordError> {
    replace_between(readme, RESULTS_BEGIN, RESULTS_END, &readme_table(rows))
}

/// The table of the README: one line per method and budget over the Coman suites.
pub fn readme_table(rows: &[Row]) -> String {
    let runs = labelled(rows);
    let tracked = runs.iter().filter(|r| TRACKED.contains(&r.row.suite.as_str()));
    let lines: Vec<Vec<String>> = by_method(tracked).iter().map(|group| cells(group)).collect();
    origin(rows) + "\n" + &markdown(&HEADER, &lines)
}

const HEADER: [&str; 11] = [
    "method",
    "n",
    "squat: soft rms (mm)",
    "stretch: soft rms (mm)",
    "stretch: peak velocity (rad/s)",
    "stretch: exit (s)",
    "asymmetric C",
    "family, roll period 4 s + 3 s",
    "lean D",
    "squat: median step (µs)",
    "×ik1",
];

/// The line of one method.
fn cells(group: &[&Labelled<'_>]) -> Vec<String> {
    let of = |suite: &str, scenario: &str| {
        group
            .iter()
            .find(|r| r.row.suite == suite && r.row.scenario == scenario)
            .map(|r| r.row)
    };
    let metrics = |row: Option<&Row>| row.and_then(|r| r.metrics.clone());
    let millimetres = |m: &Option<Metrics>| {
        number(
            m.as_ref()
                .and_then(|m| m.quality.worst_soft_rms_m())
                .map(|e| e * 1e3),
        )
    };
    let (squat, stretch) = (metrics(of(TRACKED[0], "A")), metrics(of(TRACKED[1], "B")));
    vec![
        group[0].label.clone(),
        group[0].n.map_or(NONE.to_owned(), |n| n.to_string()),
        millimetres(&squat),
        millimetres(&stretch),
        number(stretch.as_ref().map(|m| m.quality.velocity_max_rad_s)),
        seconds(stretch.as_ref().and_then(|m| m.quality.singularity_exit_s)),
        survival(of(TRACKED[2], "C")),
        family(group),
        survival(of(TRACKED[3], "D")),
        number(squat.as_ref().map(|m| m.effort.step_us_median)),
        squat.as_ref().map_or(NONE.to_owned(), |m| ratio(&m.effort)),
    ]
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

/// Survivors among the asymmetric scenarios other than C: first of those with the slow roll, then of the others.
fn family(group: &[&Labelled<'_>]) -> String {
    let is_family = |r: &&&Labelled<'_>| r.row.suite == TRACKED[2] && r.row.scenario != "C";
    let members: Vec<&&Labelled<'_>> = group.iter().filter(is_family).collect();
    if members.is_empty() {
        return NONE.to_owned();
    }
    // By what stands last in an id, the period of the roll: the slow half can be survived, the fast one hardly.
    let mut halves: BTreeMap<std::cmp::Reverse<&str>, (usize, usize)> = BTreeMap::new();
    for run in members {
        let period = run.row.scenario.rsplit('_').next().unwrap_or_default();
        let (survived, all) = halves.entry(std::cmp::Reverse(period)).or_default();
        *survived += usize::from(run.row.metrics.as_ref().is_some_and(|m| m.quality.survived));
        *all += 1;
    }
    let texts: Vec<String> = halves
        .values()
        .map(|(survived, all)| format!("{survived}/{all}"))
        .collect();
    texts.join(" + ")
}
