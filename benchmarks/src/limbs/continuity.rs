//! Paths through singular sets, followed by the solution nearest to the one before.
//!
//! A *smooth* path is straight in the joints and crosses one singular set, away from all others: a continuous solution
//! exists, so nothing forces a jump. A *turned* path is the same, but at the singular set a joint that the geometry leaves
//! free there has turned: the poses still form one path, the joints before and after do not meet.
//!
//! **Jump.** A step in which some joint moves more than [`FAST`] times as far as the fastest joint of the generating path,
//! and still more than half as far when the step is taken in [`PARTS`] parts: what shrinks with the sampling is fast, but
//! continuous.
//!
//! **Forced.** A jump is forced if there are no joints near the last ones that meet the new pose. That is decided without
//! the solver under test: by the generating joints, if they are near, and by a damped Newton iteration on the robot's own
//! kinematics from the last joints and from random ones around them.

use super::numbers::Numbers;
use super::record::ContinuityFindings;
use super::subject::{Answers, Joints, Kinematics, SNAPPED, Solve, Subject, away, wrap};
use super::suite::{ContinuityCounts, ContinuitySpec};
use crate::records::Trace;
use ik_methods::reverse_decoupling::analyser::Family;
use nalgebra::{Isometry3, Matrix6, Vector6};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// Steps of the solver this many times as large as those of its path are looked at. On the singular set itself a free
/// joint stays where it was and others move for it, in the next step they move back: up to three joints share one turn,
/// so smooth paths reach 2 to 3.
pub(super) const FAST: f64 = 6.0;
/// Parts into which a fast step is divided.
const PARTS: usize = 8;
/// What the indicating quantities of a path's middle that do not vanish there must exceed: no path meets a second set.
const CLEAR: f64 = 0.35;
/// Starts of the search for joints near the last ones, the first of them being these.
const STARTS: usize = 24;
/// Newton steps from each start.
const NEWTON_STEPS: usize = 60;
/// Damping of a Newton step (m² and rad²): steps stay small where the Jacobian loses a direction.
const DAMPING: f64 = 1e-9;
/// Pose error (m and rad) that counts as met by the search.
const FOUND: f64 = 1e-9;
/// A path that ends this far (rad) from the generating joints has changed its posture.
const ELSEWHERE_RAD: f64 = 1e-3;

/// A singular set: D-H angles that it fixes, and the joint it leaves free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Singular {
    pub(super) id: &'static str,
    /// Joint (from 0) and its angle (rad).
    fixed: &'static [(usize, f64)],
    /// Whether joint 5 is set so that the hip is on the axis of joint 6: K = 0.
    ankle: Ankle,
    /// A joint that may turn at the set.
    free: Option<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ankle {
    AsDrawn,
    UnderTheHip,
}

const fn set(id: &'static str, fixed: &'static [(usize, f64)], free: Option<usize>) -> Singular {
    Singular {
        id,
        fixed,
        ankle: Ankle::AsDrawn,
        free,
    }
}

/// Singular sets of the leg, notes on sections 3 and 4 of the source.
const LEG: [Singular; 5] = [
    set("hip-0", &[(1, 0.0)], Some(0)),
    set("hip-180", &[(1, PI)], Some(0)),
    Singular {
        ankle: Ankle::UnderTheHip,
        ..set("ankle", &[], Some(5))
    },
    set("stretched", &[(3, 0.0)], None),
    set("folded", &[(3, PI)], None),
];

/// Those of the arm: the source's cases 1 to 3, also at 180°, and the wrist at C5 = 0.
const ARM: [Singular; 7] = [
    set("case-1", &[(1, 0.0)], Some(0)),
    set("case-1-180", &[(1, PI)], Some(0)),
    set("case-2", &[(3, 0.0)], Some(2)),
    set("case-2-180", &[(3, PI)], Some(2)),
    set("case-3", &[(1, 0.0), (3, 0.0)], Some(0)),
    set("case-3-180", &[(1, PI), (3, PI)], Some(0)),
    set("wrist", &[(4, FRAC_PI_2)], None),
];

/// Those of the arm of four joints.
const ELBOW_ARM: [Singular; 2] = [
    set("shoulder-0", &[(1, 0.0)], Some(0)),
    set("shoulder-180", &[(1, PI)], Some(0)),
];

/// What happens on the singular set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Smooth,
    Turned,
}

impl Kind {
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Smooth => "smooth",
            Self::Turned => "turned",
        }
    }
}

/// The sets of a limb, smooth and, where a joint is free, turned. None for general families, whose sets have no names.
pub(super) fn sets(subject: &Subject) -> Vec<(Singular, Kind)> {
    let sets: &[Singular] = match subject.family {
        Family::Leg => &LEG,
        Family::Arm => &ARM,
        Family::FourJointArm => &ELBOW_ARM,
        Family::General { .. } => &[],
    };
    let offset = subject.table.rows.get(2).map_or(0.0, |row| row.d);
    let mut all = Vec::new();
    for set in sets {
        all.push((*set, Kind::Smooth));
        // With an offset the hip cannot come onto the axis of joint 6: a double root, nothing is free.
        let double_root = subject.family == Family::Leg && set.ankle == Ankle::UnderTheHip && offset != 0.0;
        if set.free.is_some() && !double_root {
            all.push((*set, Kind::Turned));
        }
    }
    all
}

/// Joints over a path: D-H angles that pass through `middle` (from `before`'s side) with constant rates.
#[derive(Clone, Copy, Debug)]
struct Path {
    /// Angles in the middle, as the first half ends and as the second begins.
    middle: [Joints; 2],
    /// Change per unit of the path; the fastest joint has 1.
    rates: Joints,
}

impl Path {
    /// Joint values at `s`, the singular set being at 0.
    fn at(&self, subject: &Subject, s: f64) -> Joints {
        let middle = &self.middle[usize::from(s > 0.0)];
        subject.joints_at(&std::array::from_fn(|i| middle[i] + s * self.rates[i]))
    }
}

/// A random path through the set; none if what is free cannot be turned here.
fn path(
    subject: &Subject,
    (set, kind): (Singular, Kind),
    turn_rad: f64,
    numbers: &mut Numbers,
    solve: &Solve<'_>,
) -> Option<Path> {
    let count = subject.joints();
    let mut rates = [0.0; 6];
    rates[..count]
        .iter_mut()
        .for_each(|rate| *rate = numbers.sign() * (0.3 + 0.7 * numbers.unit()));
    // What crosses the set is the fastest.
    for (joint, _) in set.fixed {
        rates[*joint] = rates[*joint].signum();
    }
    let middle = middle(subject, set, numbers);
    let other = match (kind, set.free) {
        (Kind::Turned, Some(free)) => turned(subject, &middle, free, turn_rad, solve)?,
        _ => middle,
    };
    Some(Path {
        middle: [middle, other],
        rates,
    })
}

/// Angles on the singular set, clear of the others.
fn middle(subject: &Subject, set: Singular, numbers: &mut Numbers) -> Joints {
    let count = subject.joints();
    loop {
        let mut angles = [0.0; 6];
        angles[..count]
            .iter_mut()
            .for_each(|angle| *angle = numbers.angle());
        for (joint, angle) in set.fixed {
            angles[*joint] = *angle;
        }
        if set.ankle == Ankle::UnderTheHip {
            let (l3, l4) = (subject.table.rows[2].a, subject.table.rows[3].a);
            let psi = (angles[3].sin() * l3).atan2(angles[3].cos() * l3 + l4);
            angles[4] = FRAC_PI_2 - psi;
        }
        if is_clear(subject, set, &angles) {
            return angles;
        }
    }
}

fn is_clear(subject: &Subject, set: Singular, angles: &Joints) -> bool {
    let Some(values) = subject.indicating(&subject.joints_at(angles)) else {
        return true;
    };
    let fixes = |joint: usize| set.fixed.iter().any(|(fixed, _)| *fixed == joint);
    let folded = subject.family == Family::Leg && fixes(3);
    values.into_iter().zip([1, 3, 4]).all(|(value, joint)| {
        let vanishes = fixes(joint) || (joint == 4 && (set.ankle == Ankle::UnderTheHip || folded));
        // Where a straight elbow makes joint 5 free it is not asked for, but may not be at its own set.
        vanishes || value.is_none_or(|value| value.abs() > CLEAR)
    })
}

/// Other angles of the same pose, with the free joint turned.
fn turned(
    subject: &Subject,
    middle: &Joints,
    free: usize,
    turn_rad: f64,
    solve: &Solve<'_>,
) -> Option<Joints> {
    let mut kinematics = subject.kinematics();
    let joints = subject.joints_at(middle);
    let pose = kinematics.tip(&joints);
    let mut previous = *middle;
    previous[free] += turn_rad;
    let previous = subject.joints_at(&previous);
    let mut answers = Answers::new();
    solve(&pose, &previous, &mut answers).ok()?;
    let has_turned = |q: &Joints| (wrap(q[free] - previous[free])).abs() < 1e-9;
    let candidates = answers.iter().map(|(q, _)| *q).filter(has_turned);
    let nearest = candidates.min_by(|a, b| away(a, &joints).total_cmp(&away(b, &joints)))?;
    (kinematics.miss(&pose, &nearest) < SNAPPED).then(|| subject.angles(&nearest))
}

/// How a path is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sampling {
    /// One sample on the set.
    Through,
    /// Half a step to either side of it.
    Beside,
}

/// Everything one path needs besides itself.
struct Walk<'a> {
    subject: &'a Subject,
    half_width_rad: f64,
    steps: usize,
    solve: &'a Solve<'a>,
}

/// A path as it was followed: generating joints and those of the solver.
type Samples = Vec<(f64, Joints, Joints)>;

impl Walk<'_> {
    fn places(&self, sampling: Sampling) -> Vec<f64> {
        let (count, offset) = match sampling {
            Sampling::Through => (self.steps + 1, 0.0),
            Sampling::Beside => (self.steps, 0.5),
        };
        let half = self.steps as f64 / 2.0;
        let place = |k: usize| (k as f64 + offset - half) / half * self.half_width_rad;
        (0..count).map(place).collect()
    }

    fn follow(&self, path: &Path, sampling: Sampling) -> (ContinuityFindings, Samples) {
        let places = self.places(sampling);
        let step = places[1] - places[0];
        let mut kinematics = self.subject.kinematics();
        let mut found = ContinuityFindings {
            paths: 1,
            path_step_max_rad: step,
            ..ContinuityFindings::default()
        };
        let mut previous = path.at(self.subject, places[0]);
        let mut answers = Answers::new();
        let mut samples = Samples::with_capacity(places.len());
        for (k, s) in places.iter().enumerate() {
            let generating = path.at(self.subject, *s);
            let pose = kinematics.tip(&generating);
            found.steps += u64::from(k > 0);
            let Some(solved) = self.nearest(&pose, &previous, &mut answers) else {
                found.unsolved += 1;
                samples.push((*s, generating, [f64::NAN; 6]));
                continue;
            };
            found.error_max = found.error_max.max(kinematics.miss(&pose, &solved));
            if k > 0 {
                let moved = away(&solved, &previous);
                found.step_max_rad = found.step_max_rad.max(moved);
                found.step_ratio_max = found.step_ratio_max.max(moved / step);
                if moved > FAST * step && self.is_jump(path, (places[k - 1], *s), &previous, moved) {
                    found.jumps += 1;
                    let near = moved / 2.0;
                    let avoidable = away(&generating, &previous) <= near
                        || meets_near(self.subject, &mut kinematics, &pose, &previous, near);
                    found.forced += u64::from(!avoidable);
                }
            }
            samples.push((*s, generating, solved));
            previous = solved;
        }
        let last = samples
            .last()
            .map_or(0.0, |(_, generating, _)| away(generating, &previous));
        found.ended_elsewhere = u64::from(last > ELSEWHERE_RAD);
        (found, samples)
    }

    /// Whether some part of a step moves a joint more than half as far as the step, `moved`.
    fn is_jump(&self, path: &Path, (from, to): (f64, f64), before: &Joints, moved: f64) -> bool {
        let mut kinematics = self.subject.kinematics();
        let mut answers = Answers::new();
        let mut previous = *before;
        (1..=PARTS).any(|part| {
            let s = from + (to - from) * part as f64 / PARTS as f64;
            let pose = kinematics.tip(&path.at(self.subject, s));
            let Some(solved) = self.nearest(&pose, &previous, &mut answers) else {
                return true;
            };
            let step = away(&solved, &previous);
            previous = solved;
            step > moved / 2.0
        })
    }

    /// The solution nearest to the one before; none for a pose that is refused or an answer that is not finite.
    fn nearest(&self, pose: &Isometry3<f64>, previous: &Joints, answers: &mut Answers) -> Option<Joints> {
        if (self.solve)(pose, previous, answers).is_err() {
            answers.clear();
        }
        answers.retain(|(q, _)| q.iter().all(|q| q.is_finite()));
        let nearest = answers
            .iter()
            .min_by(|a, b| away(&a.0, previous).total_cmp(&away(&b.0, previous)));
        nearest.map(|(q, _)| *q)
    }
}

/// Whether joints within `near` (rad) of the last ones meet a pose, as far as a Newton iteration finds them.
fn meets_near(
    subject: &Subject,
    kinematics: &mut Kinematics<'_>,
    pose: &Isometry3<f64>,
    last: &Joints,
    near: f64,
) -> bool {
    let count = subject.joints();
    let mut numbers = Numbers::new(0, "search");
    (0..STARTS).any(|start| {
        let mut joints = *last;
        if start > 0 {
            joints[..count]
                .iter_mut()
                .for_each(|q| *q += near * (2.0 * numbers.unit() - 1.0));
        }
        for _ in 0..NEWTON_STEPS {
            let reached = kinematics.tip(&joints);
            let turn = (pose.rotation * reached.rotation.inverse()).scaled_axis();
            let shift = pose.translation.vector - reached.translation.vector;
            if shift.norm().max(turn.norm()) < FOUND {
                return away(&joints, last) <= near;
            }
            let error = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
            let jacobian = subject.jacobian(&joints);
            let normal = jacobian * jacobian.transpose() + DAMPING * Matrix6::identity();
            let Some(factor) = normal.cholesky() else {
                return false;
            };
            let step = jacobian.transpose() * factor.solve(&error);
            joints.iter_mut().zip(step.iter()).for_each(|(q, d)| *q += d);
        }
        false
    })
}

/// Follows random paths through a set; the first one, through the set, is also returned as a trace.
pub(super) fn follow(
    subject: &Subject,
    set: (Singular, Kind),
    spec: &ContinuitySpec,
    counts: &ContinuityCounts,
    mut numbers: Numbers,
    solve: &Solve<'_>,
) -> (ContinuityFindings, Option<Trace>) {
    let walk = Walk {
        subject,
        half_width_rad: spec.half_width_rad,
        steps: counts.steps,
        solve,
    };
    let paths: Vec<Option<Path>> = (0..counts.paths)
        .map(|_| path(subject, set, spec.turn_rad, &mut numbers, solve))
        .collect();
    let both = |path: &Path| {
        let (through, samples) = walk.follow(path, Sampling::Through);
        (through, walk.follow(path, Sampling::Beside).0, samples)
    };
    let made: Vec<&Path> = paths.iter().flatten().collect();
    let followed: Vec<_> = made.par_iter().with_max_len(1).map(|path| both(path)).collect();
    let mut found = ContinuityFindings::default();
    let mut first = None;
    for (through, beside, samples) in followed {
        found = merged(merged(found, through), beside);
        first.get_or_insert(samples);
    }
    found.held = found.paths == 2 * counts.paths as u64
        && found.unsolved == 0
        && found.jumps == found.forced
        && (set.1 == Kind::Turned || found.jumps == 0)
        && found.error_max < SNAPPED;
    (found, first.map(|samples| trace(subject, &samples)))
}

fn merged(mut all: ContinuityFindings, one: ContinuityFindings) -> ContinuityFindings {
    all.paths += one.paths;
    all.steps += one.steps;
    all.unsolved += one.unsolved;
    all.path_step_max_rad = all.path_step_max_rad.max(one.path_step_max_rad);
    all.step_max_rad = all.step_max_rad.max(one.step_max_rad);
    all.step_ratio_max = all.step_ratio_max.max(one.step_ratio_max);
    all.jumps += one.jumps;
    all.forced += one.forced;
    all.error_max = all.error_max.max(one.error_max);
    all.ended_elsewhere += one.ended_elsewhere;
    all
}

/// Columns `s_rad`, `<joint>` as the solver has it and `<joint>_generating`, wrapped to be near the solver's.
fn trace(subject: &Subject, samples: &Samples) -> Trace {
    let names = &subject.report.joint_names;
    let mut columns = vec!["s_rad".to_owned()];
    columns.extend(names.iter().cloned());
    columns.extend(names.iter().map(|name| format!("{name}_generating")));
    let row = |(s, generating, solved): &(f64, Joints, Joints)| {
        let count = names.len();
        let mut row = vec![*s];
        row.extend(&solved[..count]);
        row.extend((0..count).map(|i| {
            let turns = generating[i] - solved[i];
            if turns.is_finite() {
                solved[i] + wrap(turns)
            } else {
                generating[i]
            }
        }));
        row
    };
    Trace {
        columns,
        rows: samples.iter().map(row).collect(),
    }
}
