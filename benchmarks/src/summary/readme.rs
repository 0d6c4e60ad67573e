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

/// The tables of the README, one line per method and budget: the Coman suites, then the Bioloid suites beside the plain
/// squat and the walks by preview control, if there are rows of them.
pub fn readme_table(rows: &[Row]) -> String {
    let runs = labelled(rows);
    let table = |suites: &[&str], cells: fn(&[&Labelled<'_>]) -> Vec<String>| {
        let tracked = runs.iter().filter(|r| suites.contains(&r.row.suite.as_str()));
        by_method(tracked)
            .iter()
            .map(|group| cells(group))
            .collect::<Vec<_>>()
    };
    let mut text = origin(rows) + "\n" + &markdown(&HEADER, &table(&TRACKED, cells));
    if runs.iter().any(|r| r.row.suite == BIOLOID[0]) {
        text += &format!("\n{}", markdown(&BIOLOID_HEADER, &table(&BIOLOID, bioloid_cells)));
    }
    if runs.iter().any(|r| r.row.suite == WALKS[0]) {
        text += &format!("\n{}", markdown(&WALK_HEADER, &table(&WALKS, walk_cells)));
    }
    text
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

const BIOLOID_HEADER: [&str; 11] = [
    "method",
    "n",
    "gait: feet max (mm)",
    "gait: hands rms (mm)",
    "gait: peak velocity (rad/s)",
    "gait, 4 rad/s allowed",
    "com-sway: soft rms (mm)",
    "squat beyond reach: feet max (mm)",
    "COMAN squat: soft rms (mm)",
    "gait: median step (µs)",
    "×ik1",
];

const WALK_HEADER: [&str; 12] = [
    "method",
    "n",
    "Melson S1, S2: mean H_joint",
    "Melson S1, S3: Στ² (N²m²)",
    "30 steps S1: drift (rad/cycle)",
    "30 steps S2: drift at the end (rad/cycle)",
    "Melson S3: hard max (mm)",
    "Hubo walk: hard max (mm)",
    "Bioloid walk: soft rms (mm)",
    "Bioloid walk: cart ZMP error rms (mm)",
    "Melson S3: median step (µs)",
    "×ik1",
];

/// Suites of the third table.
const WALKS: [&str; 4] = ["melson/walk", "melson/long-walk", "walk/hubo", "walk/bioloid"];

/// Suites of the second table.
const BIOLOID: [&str; 4] = ["bioloid/gait", "bioloid/com-sway", "bioloid/squat", "coman/squat"];

/// The run of a group on a scenario.
fn run_of<'a>(group: &[&Labelled<'a>], suite: &str, scenario: &str) -> Option<&'a Row> {
    let mut runs = group.iter().map(|r| r.row);
    runs.find(|r| r.suite == suite && r.scenario == scenario)
}

fn metrics(row: Option<&Row>) -> Option<Metrics> {
    row.and_then(|r| r.metrics.clone())
}

fn millimetres(metrics: &Option<Metrics>, value: impl Fn(&Metrics) -> Option<f64>) -> String {
    number(metrics.as_ref().and_then(value).map(|e| e * 1e3))
}

fn soft_rms(metrics: &Option<Metrics>) -> String {
    millimetres(metrics, |m| m.quality.worst_soft_rms_m())
}

/// The line of one method over the Bioloid suites.
fn bioloid_cells(group: &[&Labelled<'_>]) -> Vec<String> {
    let of = |suite: usize, scenario: &str| metrics(run_of(group, BIOLOID[suite], scenario));
    let (gait, beyond) = (of(0, "gait"), of(2, "z190"));
    let feet = |m: &Option<Metrics>| millimetres(m, |m| Some(m.quality.hard_error_max_m));
    vec![
        group[0].label.clone(),
        group[0].n.map_or(NONE.to_owned(), |n| n.to_string()),
        feet(&gait),
        soft_rms(&gait),
        number(gait.as_ref().map(|m| m.quality.velocity_max_rad_s)),
        survival(run_of(group, BIOLOID[0], "gait-bounded")),
        soft_rms(&of(1, "sway")),
        feet(&beyond),
        soft_rms(&of(3, "A")),
        number(gait.as_ref().map(|m| m.effort.step_us_median)),
        gait.as_ref().map_or(NONE.to_owned(), |m| ratio(&m.effort)),
    ]
}

/// The line of one method over the walks by preview control.
fn walk_cells(group: &[&Labelled<'_>]) -> Vec<String> {
    let of = |suite: usize, scenario: &str| metrics(run_of(group, WALKS[suite], scenario));
    let [nothing, centring, both] = ["S1", "S2", "S3"].map(|scenario| of(0, scenario));
    let (hubo, bioloid) = (of(2, "walk"), of(3, "walk"));
    let value = |m: &Option<Metrics>, v: fn(&Metrics) -> Option<f64>| number(m.as_ref().and_then(v));
    let centred = |m| value(m, |m| m.quality.objective_mean.get("joint-centring").copied());
    let torque = |m| value(m, |m| m.quality.single_support_torque_squared_mean_n2m2);
    let hard = |m| millimetres(m, |m| Some(m.quality.hard_error_max_m));
    vec![
        group[0].label.clone(),
        group[0].n.map_or(NONE.to_owned(), |n| n.to_string()),
        format!("{}, {}", centred(&nothing), centred(&centring)),
        format!("{}, {}", torque(&nothing), torque(&both)),
        value(&of(1, "S1"), |m| m.quality.joint_drift_mean_rad_per_cycle),
        value(&of(1, "S2"), |m| m.quality.joint_drift_last_rad_per_cycle),
        hard(&both),
        hard(&hubo),
        soft_rms(&bioloid),
        millimetres(&bioloid, |m| m.quality.zmp_reference_error_rms_m),
        number(both.as_ref().map(|m| m.effort.step_us_median)),
        both.as_ref().map_or(NONE.to_owned(), |m| ratio(&m.effort)),
    ]
}

/// The line of one method over the Coman suites.
fn cells(group: &[&Labelled<'_>]) -> Vec<String> {
    let of = |suite: &str, scenario: &str| run_of(group, suite, scenario);
    let (squat, stretch) = (metrics(of(TRACKED[0], "A")), metrics(of(TRACKED[1], "B")));
    vec![
        group[0].label.clone(),
        group[0].n.map_or(NONE.to_owned(), |n| n.to_string()),
        soft_rms(&squat),
        soft_rms(&stretch),
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
