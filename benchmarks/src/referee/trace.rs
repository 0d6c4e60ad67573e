//! The run as a table over time; columns are documented at [`Trace`].

use super::balance::{Balance, balance};
use super::judge::com_rate_error;
use super::tasks::{target_of, task_error, tracked_frames, tracked_point};
use super::torque::static_torques;
use super::walk::{support_torques, value, word};
use super::{Readable, Referee, Run};
use crate::records::Trace;
use crate::trajectory::Support;
use ik_core::problem::Problem;
use ik_core::robot::Root;
use ik_core::task::{OrientationCoordinates, Track};

/// What the steps cost, one entry per sample k ≥ 1; missing entries are written as 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepEfforts<'a> {
    /// Time of each step (µs).
    pub step_us: &'a [f64],
    /// Majors of each step.
    pub majors: &'a [u32],
    /// Minors of each step.
    pub minors: &'a [u32],
}

pub(super) fn trace(referee: &Referee, run: &Run<'_>, efforts: &StepEfforts<'_>) -> Trace {
    let readable = Readable::new(&referee.problem, run);
    let mut rows: Vec<_> = (0..readable.samples.len())
        .map(|k| row(referee, &readable, k, run.dt_s, efforts))
        .collect();
    for (row, balance) in rows.iter_mut().zip(balance(referee, &readable, run.dt_s)) {
        row.extend(balance_values(&balance));
    }
    let mut columns = columns(referee);
    if let Some(walk) = run.walk {
        columns.extend(["zmp_reference_x", "zmp_reference_y"].map(str::to_owned));
        for (k, row) in rows.iter_mut().enumerate() {
            row.extend(walk.zmp_m.get(k).unwrap_or(&[f64::NAN; 2]));
        }
    }
    Trace { columns, rows }
}

/// Whether torques are those of a robot that hangs on the support of the phase.
fn hangs(referee: &Referee) -> bool {
    let phases = referee.problem.phases();
    referee.spec.torque_supports.is_empty() && phases.iter().any(|phase| phase.support.is_some())
}

const BALANCE_COLUMNS: [&str; 12] = [
    "gcom_x",
    "gcom_y",
    "zmp_x",
    "zmp_y",
    "cart_zmp_x",
    "cart_zmp_y",
    "support_x_min",
    "support_x_max",
    "support_y_min",
    "support_y_max",
    "gcom_margin",
    "zmp_margin",
];

fn balance_values(balance: &Balance) -> [f64; BALANCE_COLUMNS.len()] {
    let (gcom, cart) = (balance.gcom, balance.cart_zmp);
    let zmp = balance.zmp.map_or([f64::NAN; 2], |zmp| [zmp.x, zmp.y]);
    let (low, high) = balance.polygon.bounds();
    [
        gcom.x,
        gcom.y,
        zmp[0],
        zmp[1],
        cart.x,
        cart.y,
        low.x,
        high.x,
        low.y,
        high.y,
        balance.gcom_margin_m(),
        balance.zmp_margin_m().unwrap_or(f64::NAN),
    ]
}

fn columns(referee: &Referee) -> Vec<String> {
    let problem = &*referee.problem;
    let joints = || problem.robot().coordinates().iter().map(|c| c.name.clone());
    let mut columns = vec!["t".to_owned()];
    if problem.robot().root() == Root::Floating {
        columns.extend(["x", "y", "z", "qx", "qy", "qz", "qw"].map(|c| format!("base_{c}")));
    }
    columns.extend(joints());
    for task in 0..problem.tasks().len() {
        task_columns(problem, task, &mut columns);
    }
    columns.extend(["step_us", "majors", "minors"].map(str::to_owned));
    if !referee.spec.torque_supports.is_empty() || hangs(referee) {
        columns.extend(joints().map(|joint| format!("torque_{joint}")));
    }
    let objectives = problem.objectives().iter();
    columns.extend(objectives.map(|objective| format!("objective_{}", word(objective))));
    if hangs(referee) {
        columns.push("standing_foot".to_owned());
    }
    if !referee.spec.soles.is_empty() {
        columns.extend(BALANCE_COLUMNS.map(str::to_owned));
    }
    columns
}

fn task_columns(problem: &Problem, task: usize, columns: &mut Vec<String>) {
    let (name, track) = (&problem.tasks()[task].name, problem.tasks()[task].track);
    columns.extend(
        target_components(problem, track)
            .into_iter()
            .map(|c| format!("{name}_target_{c}")),
    );
    let (position, orientation) = tracked_frames(track);
    if position.is_some() || track == Track::CentreOfMass {
        columns.extend(["x", "y", "z"].map(|c| format!("{name}_{c}")));
        columns.push(format!("{name}_error_m"));
    }
    if orientation.is_some() || track == Track::Posture {
        columns.push(format!("{name}_error_rad"));
    }
    if track == Track::CentreOfMass {
        columns.push(format!("{name}_rate_error_m_s"));
    }
}

fn target_components(problem: &Problem, track: Track) -> Vec<String> {
    let position = || ["x", "y", "z"].map(str::to_owned).to_vec();
    let orientation = || match problem.orientation() {
        OrientationCoordinates::RollPitchYaw => ["roll", "pitch", "yaw"].map(str::to_owned).to_vec(),
        OrientationCoordinates::Log => ["qx", "qy", "qz", "qw"].map(str::to_owned).to_vec(),
    };
    match track {
        Track::Position(_) | Track::CentreOfMass => position(),
        Track::Orientation(_) => orientation(),
        Track::Pose(_) => [position(), orientation()].concat(),
        Track::Posture => problem
            .robot()
            .coordinates()
            .iter()
            .map(|c| c.name.clone())
            .collect(),
    }
}

fn row(
    referee: &Referee,
    readable: &Readable<'_>,
    k: usize,
    dt_s: f64,
    efforts: &StepEfforts<'_>,
) -> Vec<f64> {
    let problem = &*referee.problem;
    let sample = &readable.samples[k];
    let mut row = vec![sample.t_s];
    row.extend(sample.q);
    for task in 0..problem.tasks().len() {
        task_values(problem, readable, k, task, dt_s, &mut row);
    }
    let count = |counts: &[u32]| {
        k.checked_sub(1)
            .and_then(|i| counts.get(i))
            .map_or(0.0, |&n| f64::from(n))
    };
    row.push(
        k.checked_sub(1)
            .and_then(|i| efforts.step_us.get(i))
            .copied()
            .unwrap_or(0.0),
    );
    row.extend([count(efforts.majors), count(efforts.minors)]);
    let supports = &referee.spec.torque_supports;
    if !supports.is_empty() {
        let joints = problem.robot().coordinates().len();
        let torques = static_torques(problem.robot(), &readable.postures[k], supports);
        row.extend(torques.unwrap_or_else(|| vec![0.0; joints]));
    }
    row.extend(objective_values(referee, readable, k));
    row
}

/// Torques on the support of the phase, objectives, and the foot that stands alone.
fn objective_values(referee: &Referee, readable: &Readable<'_>, k: usize) -> Vec<f64> {
    let problem = &*referee.problem;
    let (hangs, objectives) = (hangs(referee), problem.objectives());
    if !hangs && objectives.is_empty() {
        return Vec::new();
    }
    let sample = &readable.samples[k];
    let torques = support_torques(problem, sample, &readable.postures[k]);
    let values = objectives
        .iter()
        .map(|objective| value(problem, objective, sample, torques.as_deref()).unwrap_or(f64::NAN));
    let values: Vec<f64> = values.collect();
    if !hangs {
        return values;
    }
    let joints = problem.robot().coordinates().len();
    let mut row = torques.unwrap_or_else(|| vec![f64::NAN; joints]);
    row.extend(values);
    row.push(match sample.support {
        Support::Both => 0.0,
        Support::Right => -1.0,
        Support::Left => 1.0,
    });
    row
}

fn task_values(
    problem: &Problem,
    readable: &Readable<'_>,
    k: usize,
    task: usize,
    dt_s: f64,
    row: &mut Vec<f64>,
) {
    let (sample, posture) = (&readable.samples[k], &readable.postures[k]);
    row.extend(target_of(problem, task, sample.x));
    if let Some(point) = tracked_point(problem, posture, task) {
        row.extend(point.iter());
    }
    let error = task_error(problem, posture, sample.q, task, sample.x);
    row.extend([error.m, error.rad].into_iter().flatten().map(|miss| miss.norm));
    if problem.tasks()[task].track == Track::CentreOfMass {
        let before = k.checked_sub(1).map(|i| &readable.postures[i]);
        row.push(before.map_or(0.0, |b| {
            com_rate_error(problem, task, (b, posture), sample.xdot, dt_s)
        }));
    }
}
