//! The quality numbers of a run, one group of fields at a time. Definitions: [`Quality`] and
//! [`Referee::judge`].

use super::balance::judge_balance;
use super::limits::{ellipse_value, polygon_excess, position_violation};
use super::tasks::{TaskError, hard_then_soft, jacobian, rate_of, task_error};
use super::torque::static_torques;
use super::walk::judge_walk;
use super::{Posture, Readable, Referee, Run, Sample};
use crate::records::Quality;
use faer::MatRef;
use ik_core::boundary::Boundary;
use ik_core::problem::Problem;
use ik_core::robot::Robot;
use ik_core::task::Track;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// A singular value below this part of the largest counts as zero.
const RANK_TOLERANCE: f64 = 1e-9;
/// A joint nearer to the straight leg than this (rad) is in the singularity.
const STRAIGHT_RAD: f64 = 0.05;
/// Exits are looked for after, and torques averaged from, this time (s): the start has settled by then.
const SETTLED_S: f64 = 1.0;
/// Rounding of `k Δt` in a comparison with a time (s).
const TIME_ROUNDING_S: f64 = 1e-9;
/// What a run that survives may exceed its position limits by (rad or m).
const LIMIT_TOLERANCE: f64 = 1e-6;
/// What it may exceed eq. (6) by.
const BOUNDARY_TOLERANCE: f64 = 1e-4;
/// What its hard tasks must stay below (m, rad).
const HARD_TOLERANCE: f64 = 1e-3;

pub(super) fn judge(referee: &Referee, run: &Run<'_>) -> Quality {
    let problem = &*referee.problem;
    let readable = Readable::new(problem, run);
    let mut quality = Quality::default();
    if readable.samples.is_empty() {
        return quality;
    }
    judge_tracking(problem, &readable, &mut quality);
    judge_rates(problem, &readable, run.dt_s, &mut quality);
    judge_joints(problem, &readable, run.dt_s, &mut quality);
    judge_ranks(problem, &readable, &mut quality);
    quality.singularity_exit_s = exit_time(referee, &readable, run.dt_s);
    quality.torque_squared_mean_n2m2 = torque_squared_mean(referee, &readable);
    judge_balance(referee, &readable, run.dt_s, &mut quality);
    judge_walk(referee, &readable, run, &mut quality);
    quality.survived = readable.complete
        && survives(
            &quality,
            referee.problem.boundary(),
            referee.spec.soft_tolerance_m,
        );
    quality
}

pub(super) fn survives(quality: &Quality, boundary: &Boundary, soft_tolerance_m: f64) -> bool {
    // Polygon and box reach outside the ellipse of eq. (6): who was given one is held to it.
    let inside = match boundary {
        Boundary::Polygon { .. } => quality
            .polygon_excess_max_rad
            .is_none_or(|e| e <= LIMIT_TOLERANCE),
        Boundary::Box => quality.velocity_ratio_max <= 1.0 + LIMIT_TOLERANCE,
        _ => quality.boundary_value_max.is_none_or(|g| g <= BOUNDARY_TOLERANCE),
    };
    inside
        && quality.position_limit_violation_max_rad <= LIMIT_TOLERANCE
        && quality.hard_error_max_m < HARD_TOLERANCE
        && quality.hard_error_max_rad < HARD_TOLERANCE
        && quality
            .soft_error_max_m
            .is_none_or(|error| error < soft_tolerance_m)
}

/// Root of the mean of squares, and the largest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    squares: f64,
    count: u32,
    largest: f64,
}

impl Spread {
    pub(super) fn add(&mut self, value: f64) {
        self.squares += value * value;
        self.count += 1;
        self.largest = self.largest.max(value);
    }

    pub(super) fn largest(&self) -> f64 {
        self.largest
    }

    pub(super) fn rms(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.squares / f64::from(self.count)).sqrt())
    }
}

/// Errors of the compromised tasks, by the names of [`Quality::soft_error_rms`].
#[derive(Debug, Default)]
struct SoftErrors {
    m: BTreeMap<String, Spread>,
    rad: BTreeMap<String, Spread>,
}

impl SoftErrors {
    fn add(&mut self, name: &str, error: &TaskError) {
        let both = error.m.is_some() && error.rad.is_some();
        for (spreads, miss, unit) in [(&mut self.m, error.m, "_m"), (&mut self.rad, error.rad, "_rad")] {
            if let Some(miss) = miss {
                let name = if both {
                    format!("{name}{unit}")
                } else {
                    name.to_owned()
                };
                spreads.entry(name).or_default().add(miss.norm);
            }
        }
    }

    fn report(self, quality: &mut Quality) {
        quality.soft_error_rms_m = self.m.values().filter_map(Spread::rms).reduce(f64::max);
        quality.soft_error_max_m = self.m.values().map(|s| s.largest).reduce(f64::max);
        for (name, spread) in self.m.into_iter().chain(self.rad) {
            if let Some(rms) = spread.rms() {
                quality.soft_error_rms.insert(name.clone(), rms);
                quality.soft_error_max.insert(name, spread.largest);
            }
        }
    }
}

/// Raises `most` to `value`.
fn raise(most: &mut f64, value: f64) {
    *most = most.max(value);
}

/// Errors of the centre of mass, of hard and of compromised tasks over k ≥ 0.
fn judge_tracking(problem: &Problem, readable: &Readable<'_>, quality: &mut Quality) {
    let mut com = Spread::default();
    let mut soft = SoftErrors::default();
    for (sample, posture) in readable.iter() {
        let (hard_tasks, soft_tasks) = hard_then_soft(problem, sample.phase);
        for (tasks, hard) in [(hard_tasks, true), (soft_tasks, false)] {
            for task in tasks {
                let named = &problem.tasks()[task];
                let error = task_error(problem, posture, sample.q, task, sample.x);
                if let (Track::CentreOfMass, Some(m)) = (named.track, error.m) {
                    com.add(m.norm);
                }
                if hard {
                    record_hard(&named.name, &error, quality);
                } else {
                    soft.add(&named.name, &error);
                }
            }
        }
    }
    quality.com_error_rms_m = com.rms();
    quality.com_error_max_m = com.rms().map(|_| com.largest);
    soft.report(quality);
}

fn record_hard(name: &str, error: &TaskError, quality: &mut Quality) {
    if let Some(m) = error.m {
        raise(&mut quality.hard_error_max_m, m.largest);
        raise(
            quality.hard_error_max.entry(format!("{name}_m")).or_default(),
            m.largest,
        );
    }
    if let Some(rad) = error.rad {
        raise(&mut quality.hard_error_max_rad, rad.largest);
        raise(
            quality.hard_error_max.entry(format!("{name}_rad")).or_default(),
            rad.largest,
        );
    }
}

/// `‖ẋ − Δcom/Δt‖` (m/s) of a centre-of-mass task between two samples.
pub(super) fn com_rate_error(
    problem: &Problem,
    task: usize,
    (before, now): (&Posture, &Posture),
    xdot: &[f64],
    dt_s: f64,
) -> f64 {
    (rate_of(problem, task, xdot) - (now.com - before.com) / dt_s).norm()
}

fn judge_rates(problem: &Problem, readable: &Readable<'_>, dt_s: f64, quality: &mut Quality) {
    let mut rate = Spread::default();
    for (sample, postures) in readable.samples[1..].iter().zip(readable.postures.windows(2)) {
        let tasks = problem.phases()[sample.phase.0]
            .tasks
            .iter()
            .map(|(task, _)| *task);
        for task in tasks.filter(|&t| problem.tasks()[t].track == Track::CentreOfMass) {
            rate.add(com_rate_error(
                problem,
                task,
                (&postures[0], &postures[1]),
                sample.xdot,
                dt_s,
            ));
        }
    }
    quality.com_rate_error_rms_m_s = rate.rms();
}

/// Joint values of a sample.
fn joints<'a>(robot: &Robot, sample: &Sample<'a>) -> &'a [f64] {
    &sample.q[robot.root().nq()..]
}

/// Limits, boundaries, velocities and accelerations of every coordinate.
fn judge_joints(problem: &Problem, readable: &Readable<'_>, dt_s: f64, quality: &mut Quality) {
    let robot = problem.robot();
    for (j, coordinate) in robot.coordinates().iter().enumerate() {
        let limits = &coordinate.limits;
        let series: Vec<f64> = readable.samples.iter().map(|s| joints(robot, s)[j]).collect();
        for &q in &series {
            raise(
                &mut quality.position_limit_violation_max_rad,
                position_violation(limits, q),
            );
        }
        for pair in series.windows(2) {
            let (q, velocity) = (pair[1], (pair[1] - pair[0]) / dt_s);
            raise(&mut quality.velocity_max_rad_s, velocity.abs());
            if limits.velocity > 0.0 {
                raise(&mut quality.velocity_ratio_max, velocity.abs() / limits.velocity);
            }
            judge_boundary(problem, j, q, velocity, dt_s, quality);
        }
        for triple in series.windows(3) {
            let second = (triple[2] - 2.0 * triple[1] + triple[0]) / (dt_s * dt_s);
            raise(&mut quality.acceleration_max_rad_s2, second.abs());
        }
    }
}

fn judge_boundary(problem: &Problem, joint: usize, q: f64, velocity: f64, dt_s: f64, quality: &mut Quality) {
    let (boundary, limits) = (problem.boundary(), &problem.robot().coordinates()[joint].limits);
    if boundary.bounds_velocity()
        && let Some(g) = ellipse_value(boundary, limits, q, velocity)
    {
        raise(quality.boundary_value_max.get_or_insert(f64::MIN), g);
    }
    if let Some(excess) = polygon_excess(boundary, limits, q, velocity, dt_s) {
        raise(quality.polygon_excess_max_rad.get_or_insert(0.0), excess);
    }
}

/// Singular values, largest first. Should the decomposition fail to converge they are reported as zeros,
/// which no reader takes for a good sign.
fn singular_values(matrix: MatRef<'_, f64>) -> Vec<f64> {
    let count = matrix.nrows().min(matrix.ncols());
    matrix.singular_values().unwrap_or_else(|_| vec![0.0; count])
}

fn rank(values: &[f64]) -> usize {
    let largest = values.first().copied().unwrap_or(0.0);
    values
        .iter()
        .filter(|&&value| value > RANK_TOLERANCE * largest)
        .count()
}

fn view(matrix: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(matrix.as_slice(), matrix.nrows(), matrix.ncols())
}

fn judge_ranks(problem: &Problem, readable: &Readable<'_>, quality: &mut Quality) {
    (quality.sigma_min, quality.hard_rank_min) = (f64::MAX, usize::MAX);
    for (sample, posture) in readable.iter() {
        let (hard, soft) = hard_then_soft(problem, sample.phase);
        let hard_rows = hard
            .iter()
            .map(|&t| problem.tasks()[t].track.rows(problem.robot()))
            .sum();
        let all = jacobian(problem, posture, &[hard, soft].concat());
        let values = singular_values(view(&all));
        quality.sigma_min = quality.sigma_min.min(values.last().copied().unwrap_or(0.0));
        let hard_rank = hard_rank(&all, &values, hard_rows);
        quality.hard_rank_min = quality.hard_rank_min.min(hard_rank);
    }
}

/// Rank of the first `hard_rows` rows of a Jacobian with the singular values `values`.
///
/// Optimisation: taking rows away lowers the largest singular value and, of a matrix with independent rows,
/// raises the least; independent rows therefore need no second decomposition.
fn hard_rank(all: &DMatrix<f64>, values: &[f64], hard_rows: usize) -> usize {
    if rank(values) == all.nrows() {
        return hard_rows;
    }
    rank(&singular_values(view(all).subrows(0, hard_rows)))
}

/// First sample after the last one later than [`SETTLED_S`] at which an exit joint is nearly straight.
fn exit_time(referee: &Referee, readable: &Readable<'_>, dt_s: f64) -> Option<f64> {
    let robot = referee.problem.robot();
    let inside = |s: &Sample<'_>| {
        s.t_s > SETTLED_S + TIME_ROUNDING_S
            && referee.exit.iter().any(|&j| joints(robot, s)[j] < STRAIGHT_RAD)
    };
    let last = readable.samples.iter().rposition(inside)?;
    (last + 1 < readable.samples.len()).then(|| dt_s * (last + 1) as f64)
}

fn torque_squared_mean(referee: &Referee, readable: &Readable<'_>) -> Option<f64> {
    let supports = &referee.spec.torque_supports;
    if supports.is_empty() {
        return None;
    }
    let (mut sum, mut count) = (0.0, 0_u32);
    for (_, posture) in readable
        .iter()
        .filter(|(s, _)| s.t_s >= SETTLED_S - TIME_ROUNDING_S)
    {
        let torques = static_torques(referee.problem.robot(), posture, supports)?;
        sum += torques.iter().map(|t| t * t).sum::<f64>();
        count += 1;
    }
    (count > 0).then(|| sum / f64::from(count))
}
