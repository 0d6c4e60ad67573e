//! What redundancy is used for, and how a walk is kept: values of the secondary objectives, torques in single support, drift of
//! the joints from one cycle to the next, and the zero-moment point against its reference.
//!
//! Objectives are computed anew, from the definitions of the source (Melson, eqs. (12) and (13)), with the torques of `torque.rs`
//! on the one foot that the phase hangs the robot on. With two feet on the ground that tree is cut open where the robot is a loop,
//! so torques count only in the samples in which one foot carries: all between lift-off and touchdown.

use super::balance::{Balance, balance};
use super::judge::Spread;
use super::torque::static_torques;
use super::tree::Posture;
use super::{Readable, Referee, Run, Sample};
use crate::records::Quality;
use crate::statistics::mean;
use crate::trajectory::Support;
use ik_core::objective::Objective;
use ik_core::problem::Problem;
use std::collections::BTreeMap;

/// Start of the part of a walk in which the zero-moment point is compared with its reference (s): a controller that begins
/// with a moving reference needs a while to catch it.
const CAUGHT_S: f64 = 0.2;
/// Samples left out at both ends: their central differences reach over the ends of the motion.
const ENDS: usize = 2;

/// What a walk by preview control is compared with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WalkReference {
    /// Reference of the zero-moment point at each sample k ≥ 0: x, y (m, world).
    pub zmp_m: Vec<[f64; 2]>,
    /// Samples at the ends of cycles: one cycle later, the walk repeats itself.
    pub cycle_ends: Vec<usize>,
}

pub(super) fn judge_walk(referee: &Referee, readable: &Readable<'_>, run: &Run<'_>, quality: &mut Quality) {
    judge_objectives(&referee.problem, readable, quality);
    if let Some(walk) = run.walk {
        judge_drift(&referee.problem, readable, walk, quality);
        judge_zmp(referee, readable, walk, run.dt_s, quality);
    }
}

/// The word for an objective, as in suites.
pub(super) fn word(objective: &Objective) -> &'static str {
    match objective {
        Objective::JointCentring => "joint-centring",
        Objective::GravityTorque { .. } => "gravity-torque",
    }
}

/// Static torques on the support of the phase (Nm); none if it has none to hold the robot.
pub(super) fn support_torques(problem: &Problem, sample: &Sample<'_>, posture: &Posture) -> Option<Vec<f64>> {
    let support = problem.phases()[sample.phase.0].support;
    static_torques(problem.robot(), posture, support.as_slice())
}

/// The value of an objective; `torques` are those of [`support_torques`].
pub(super) fn value(
    problem: &Problem,
    objective: &Objective,
    sample: &Sample<'_>,
    torques: Option<&[f64]>,
) -> Option<f64> {
    let robot = problem.robot();
    match objective {
        Objective::JointCentring => {
            let joints = robot.coordinates().iter().zip(&sample.q[robot.root().nq()..]);
            let terms = joints.map(|(c, q)| {
                let (range, middle) = (
                    c.limits.upper - c.limits.lower,
                    0.5 * (c.limits.upper + c.limits.lower),
                );
                ((q - middle) / range).powi(2)
            });
            Some(0.5 * terms.sum::<f64>())
        }
        Objective::GravityTorque { weights } => {
            let torques = torques?.iter().enumerate();
            let weight = |i: usize| weights.as_ref().map_or(1.0, |w| w[i]);
            Some(0.5 * torques.map(|(i, t)| weight(i) * t * t).sum::<f64>())
        }
    }
}

fn judge_objectives(problem: &Problem, readable: &Readable<'_>, quality: &mut Quality) {
    let single = |sample: &Sample<'_>| sample.support != Support::Both;
    let walks = readable.samples.iter().any(single);
    let supported = problem.phases().iter().any(|phase| phase.support.is_some());
    if problem.objectives().is_empty() && !(walks && supported) {
        return;
    }
    let mut squares = Spread::default();
    let mut joints = vec![Spread::default(); problem.robot().coordinates().len()];
    let mut values: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (sample, posture) in readable.iter() {
        let carried = single(sample) || !walks;
        let torques = support_torques(problem, sample, posture).filter(|_| carried);
        for objective in problem.objectives() {
            if let Some(value) = value(problem, objective, sample, torques.as_deref()) {
                values.entry(word(objective)).or_default().push(value);
            }
        }
        if let Some(torques) = torques.filter(|_| walks && supported) {
            squares.add(torques.iter().map(|t| t * t).sum::<f64>().sqrt());
            for (joint, torque) in joints.iter_mut().zip(torques) {
                joint.add(torque.abs());
            }
        }
    }
    for (name, values) in values {
        let mean = mean(&values);
        quality
            .objective_mean
            .extend(mean.map(|mean| (name.to_owned(), mean)));
    }
    quality.single_support_torque_squared_mean_n2m2 = squares.rms().map(|rms| rms * rms);
    for (coordinate, torque) in problem.robot().coordinates().iter().zip(joints) {
        if let Some(rms) = torque.rms() {
            let name = || coordinate.name.clone();
            quality.single_support_torque_rms_nm.insert(name(), rms);
            quality
                .single_support_torque_peak_nm
                .insert(name(), torque.largest());
        }
    }
}

/// Largest change of a joint between the ends of two cycles (rad or m).
fn change(problem: &Problem, before: &Sample<'_>, after: &Sample<'_>) -> f64 {
    let first = problem.robot().root().nq();
    let joints = before.q[first..].iter().zip(&after.q[first..]);
    joints.map(|(a, b)| (b - a).abs()).fold(0.0, f64::max)
}

fn judge_drift(problem: &Problem, readable: &Readable<'_>, walk: &WalkReference, quality: &mut Quality) {
    let ends: Option<Vec<_>> = walk.cycle_ends.iter().map(|&k| readable.samples.get(k)).collect();
    let Some(ends) = ends else {
        return;
    };
    let drifts: Vec<f64> = ends
        .windows(2)
        .map(|pair| change(problem, pair[0], pair[1]))
        .collect();
    quality.joint_drift_mean_rad_per_cycle = mean(&drifts);
    quality.joint_drift_last_rad_per_cycle = drifts.last().copied();
}

fn judge_zmp(
    referee: &Referee,
    readable: &Readable<'_>,
    walk: &WalkReference,
    dt_s: f64,
    quality: &mut Quality,
) {
    let samples = balance(referee, readable, dt_s);
    let last = samples.len().saturating_sub(ENDS);
    let caught =
        |k: &usize| readable.samples[*k].t_s > CAUGHT_S && *k >= ENDS && *k < last && *k < walk.zmp_m.len();
    let counted: Vec<(&Balance, [f64; 2])> = (0..samples.len())
        .filter(caught)
        .map(|k| (&samples[k], walk.zmp_m[k]))
        .collect();
    let mut error = Spread::default();
    for (balance, [x, y]) in &counted {
        error.add((balance.cart_zmp.x - x).hypot(balance.cart_zmp.y - y));
    }
    quality.zmp_reference_error_rms_m = error.rms();
    quality.zmp_reference_error_max_m = error.rms().map(|_| error.largest());
    let carts = counted.iter().map(|(balance, _)| balance.cart_zmp_margin_m());
    quality.settled_cart_zmp_margin_min_m = carts.reduce(f64::min);
    // One sample without a zero-moment point leaves no least margin.
    let masses = counted.iter().map(|(balance, _)| balance.zmp_margin_m());
    let masses: Option<Vec<f64>> = masses.collect();
    quality.settled_zmp_margin_min_m = masses.and_then(|m| m.into_iter().reduce(f64::min));
}
