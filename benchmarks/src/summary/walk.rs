//! The second table of a suite that walks by preview control or has secondary objectives.

use super::{NONE, markdown, number};
use crate::figures::labels::Labelled;

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
