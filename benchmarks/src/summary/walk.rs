//! The second table of a suite that walks by preview control or has secondary objectives.

use super::terminal::push_line;
use super::{NONE, markdown, number};
use crate::figures::labels::{Labelled, numbered};

const HEADER: [&str; 12] = [
    "scenario",
    "method",
    "n",
    "mean H_joint",
    "mean H_grav",
    "Στ² (N²m²)",
    "drift, mean (rad/cycle)",
    "drift, last (rad/cycle)",
    "cart ZMP error rms (mm)",
    "cart ZMP error max (mm)",
    "ZMP margin (mm)",
    "cart ZMP margin (mm)",
];

/// What the columns mean.
pub(super) const LEGEND: &str = "H_joint, H_grav: the secondary objectives joint centring (mean over the motion) and gravity torque (as Στ²). Στ²: mean \
     of the sum of squared static torques while one foot carries. drift: largest change of a joint from one cycle of two steps \
     to the next. ZMP error: cart ZMP against its reference; margins: least distances to the border of the support polygon. \
     ZMP columns count from 0.2 s on.\n";

/// The table of the runs of a suite; none if none of them has any of its numbers.
pub(super) fn walk_table(runs: &[&Labelled<'_>]) -> Option<String> {
    let lines: Vec<Vec<String>> = runs.iter().map(|run| cells(run)).collect();
    let has_number = lines.iter().any(|line| line[3..].iter().any(|cell| cell != NONE));
    has_number.then(|| markdown(&HEADER, &lines))
}

/// Name and width of the columns of the terminal: those of [`HEADER`] with room for them.
const TERMINAL: [(&str, usize); 12] = [
    ("scenario", 8),
    ("method", 15),
    ("n", 3),
    ("H_joint", 7),
    ("H_grav", 7),
    ("tau2", 7),
    ("drift", 8),
    ("last", 8),
    ("zmp", 7),
    ("max", 7),
    ("in mm", 6),
    ("cart", 6),
];

/// The same table on the terminal.
pub(super) fn terminal_walk_table(runs: &[&Labelled<'_>]) -> Option<String> {
    let lines: Vec<Vec<String>> = runs.iter().map(|run| cells(run)).collect();
    let lines: Vec<_> = lines
        .into_iter()
        .filter(|line| line[3..].iter().any(|cell| cell != NONE))
        .collect();
    let header = TERMINAL.map(|(name, _)| name.to_owned());
    let mut text = String::new();
    let mut notes = Vec::new();
    push_line(&mut text, &header, &TERMINAL);
    for mut line in lines.iter().cloned() {
        line[1] = numbered(line[1].clone(), TERMINAL[1].1, &mut notes);
        push_line(&mut text, &line, &TERMINAL);
    }
    for (i, note) in notes.iter().enumerate() {
        text.push_str(&format!("[{}] {note}\n", i + 1));
    }
    (!lines.is_empty()).then_some(text)
}

/// What the columns of the terminal mean.
pub(super) const TERMINAL_LEGEND: &str = "
H_joint, H_grav: means of the secondary objectives. tau2: mean of the summed squared static torques
while one foot carries (N2m2). drift, last: largest change of a joint from cycle to cycle, mean and
last (rad). zmp, max: cart ZMP off its reference (mm). in, cart: least distance of the ZMP of point
masses and of the cart to the border of the support polygon (mm). ZMP columns: from 0.2 s on.
";

fn cells(run: &Labelled<'_>) -> Vec<String> {
    let n = run.n.map_or(NONE.to_owned(), |n| n.to_string());
    let mut cells = vec![run.row.scenario.clone(), run.label.clone(), n];
    let Some(quality) = run.row.metrics.as_ref().map(|metrics| &metrics.quality) else {
        cells.resize(HEADER.len(), NONE.to_owned());
        return cells;
    };
    let objective = |name: &str| number(quality.objective_mean.get(name).copied());
    let millimetres = |value: Option<f64>| number(value.map(|v| v * 1e3));
    cells.extend([
        objective("joint-centring"),
        objective("gravity-torque"),
        number(quality.single_support_torque_squared_mean_n2m2),
        number(quality.joint_drift_mean_rad_per_cycle),
        number(quality.joint_drift_last_rad_per_cycle),
        millimetres(quality.zmp_reference_error_rms_m),
        millimetres(quality.zmp_reference_error_max_m),
        millimetres(quality.settled_zmp_margin_min_m),
        millimetres(quality.settled_cart_zmp_margin_min_m),
    ]);
    cells
}
