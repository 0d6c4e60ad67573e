//! The referee: recomputes every quality number of a run from the returned configurations alone.
//!
//! It judges with its own, deliberately simple kinematics (`tree.rs`), its own error measures (`tasks.rs`),
//! boundary conditions (`limits.rs`), torques (`torque.rs`), balance (`balance.rs`) and objectives (`walk.rs`). What a method says about itself is never
//! read, except by [`Referee::own_stationarity`], which checks such a claim.
//!
//! A run is judged as far as it can be read: up to the first sample that is no configuration (wrong length, a
//! number that is not finite or beyond [`LARGEST_READABLE`], a quaternion that is not of unit length),
//! or that has no such target. Numbers judged are therefore always finite, and a run that ends early has not
//! survived.

mod balance;
mod certificate;
mod hull;
mod judge;
mod limits;
mod rows;
mod tasks;
#[cfg(test)]
mod tests;
mod torque;
mod trace;
mod tree;
mod walk;

pub use balance::{Foot, Sole};
pub use certificate::{Certificate, CertifiedStep, OwnStationarity};
pub use trace::StepEfforts;
pub use walk::WalkReference;

use crate::records::{Quality, Trace};
use crate::trajectory::Support;
use ik_core::formulation::Claim;
use ik_core::problem::{PhaseId, Problem};
use ik_core::robot::{FrameId, Robot, Root};
use ik_core::task::{OrientationCoordinates, Track};
use std::sync::Arc;
use tree::Posture;

/// Numbers of a configuration or target beyond this (rad or m) are not judged: neighbouring values are 1e-7
/// apart there, so an angle is hardly determined any more, and squares of such numbers must not overflow.
pub const LARGEST_READABLE: f64 = 1e9;

/// How far the norm of a root quaternion may be from one; configurations are renormalised at every step.
const UNIT_TOLERANCE: f64 = 1e-6;

/// What a method returned for one scenario, and what it was asked for.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// Time step (s).
    pub dt_s: f64,
    /// Configurations at k = 0 (the start) … N.
    pub q: &'a [Vec<f64>],
    /// Samples k = 0 … N, each `[x | ẋ]` of `problem.nx() + problem.nxdot()` numbers.
    pub targets: &'a [f64],
    /// Phase of each sample k ≥ 1, or one phase for all.
    pub phases: &'a [PhaseId],
    /// Feet on the ground at each sample k ≥ 0; empty: always both.
    pub support: &'a [Support],
    /// What a walk by preview control is compared with; none: nothing walks so.
    pub walk: Option<&'a WalkReference>,
}

/// What a suite wants to be judged.
#[derive(Clone, Debug, PartialEq)]
pub struct JudgeSpec {
    /// What the distance of every compromised task that places a point (a frame, the centre of mass) stays below in a
    /// run that survives (m).
    pub soft_tolerance_m: f64,
    /// Joints whose exit from the straight leg is timed; empty: not asked for.
    pub exit_joints: Vec<String>,
    /// Frames the robot stands on; empty: torques are not asked for.
    pub torque_supports: Vec<FrameId>,
    /// What each foot stands on, both feet at least once; empty: balance is not asked for.
    pub soles: Vec<Sole>,
}

/// What the referee cannot work with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RefereeError {
    /// A tolerance that nothing or everything passes.
    #[error("soft_tolerance_m = {0}: must be a finite number above 0")]
    Tolerance(f64),
    /// An exit joint the robot lacks.
    #[error("exit_joints: `{name}` is no joint of `{robot}`; its joints are {known:?}")]
    Joint {
        /// Name found.
        name: String,
        /// Name of the robot.
        robot: String,
        /// Joints there are.
        known: Vec<String>,
    },
    /// A support or sole the robot lacks.
    #[error("{field}: frame {frame} does not exist, `{robot}` has {count} frames")]
    Frame {
        /// Which field names it.
        field: &'static str,
        /// Index found.
        frame: usize,
        /// Name of the robot.
        robot: String,
        /// Number of frames.
        count: usize,
    },
    /// A sole without extent.
    #[error("soles[{index}].{field} = {found}: must be above 0 and at most {LARGEST_READABLE:e}")]
    Sole {
        /// Which sole.
        index: usize,
        /// Which extent.
        field: &'static str,
        /// Its value (m).
        found: f64,
    },
    /// Soles of one foot only.
    #[error("soles: none has foot = \"{0}\"; a suite that names soles names those of both feet")]
    Foot(&'static str),
    /// A vector of the wrong length.
    #[error("{field} has {found} numbers, needed are {needed}")]
    Length {
        /// Which vector.
        field: &'static str,
        /// Its length.
        found: usize,
        /// The right length.
        needed: usize,
    },
    /// A vector with an entry that is not finite or too large, or a quaternion that is not of unit
    /// length.
    #[error("{field}: numbers must be finite and at most {LARGEST_READABLE:e}, quaternions of unit length")]
    Unreadable {
        /// Which vector.
        field: &'static str,
    },
    /// A phase the problem lacks.
    #[error("phase {found} does not exist: the problem has {count}")]
    Phase {
        /// Index found.
        found: usize,
        /// Number of phases.
        count: usize,
    },
}

/// Judges runs on one problem.
#[derive(Clone, Debug)]
pub struct Referee {
    problem: Arc<Problem>,
    spec: JudgeSpec,
    /// Coordinates of the exit joints.
    exit: Vec<usize>,
}

impl Referee {
    /// A referee for `problem`.
    ///
    /// # Errors
    /// A joint or frame of `spec` that the robot lacks, a tolerance or extent that is not a positive number, soles of
    /// one foot only.
    pub fn new(problem: &Arc<Problem>, spec: JudgeSpec) -> Result<Self, RefereeError> {
        if !(spec.soft_tolerance_m.is_finite() && spec.soft_tolerance_m > 0.0) {
            return Err(RefereeError::Tolerance(spec.soft_tolerance_m));
        }
        let robot = problem.robot();
        let exit = spec
            .exit_joints
            .iter()
            .map(|name| coordinate(problem, name))
            .collect::<Result<_, _>>()?;
        check_frames(robot, "torque_supports", spec.torque_supports.iter().copied())?;
        check_frames(robot, "soles", spec.soles.iter().map(|sole| sole.frame))?;
        check_soles(&spec.soles)?;
        Ok(Self {
            problem: Arc::clone(problem),
            spec,
            exit,
        })
    }

    /// Every quality number of a run. All numbers are finite: what cannot be read is left out, and then
    /// [`Quality::survived`] is false. A run whose start cannot be read is [`Quality::default`].
    ///
    /// Choices beyond the documentation of [`Quality`]: tasks count in the phases they belong to, k = 0 in
    /// that of k = 1. A compromised pose has two entries in `soft_error_rms` and `soft_error_max`, `<task>_m` and
    /// `<task>_rad`. A posture task is measured in rad. Balance does not decide survival: what a gait asks of it is
    /// the same for every method that follows the gait. Singular values are those of every sample. A polygon reaches past the
    /// ellipse: a run that was given one is held to it, and its value of eq. (6) is reported only.
    pub fn judge(&self, run: &Run<'_>) -> Quality {
        judge::judge(self, run)
    }

    /// The columns documented at [`Trace`], for as many samples as can be read. Joint columns are those of
    /// the independent coordinates; `<task>_rate_error_m_s` is 0 at k = 0; columns of a task are filled in
    /// every phase. Balance at k = 0 and k = N is that of the accelerations at k = 1 and N − 1.
    pub fn trace(&self, run: &Run<'_>, efforts: &StepEfforts<'_>) -> Trace {
        trace::trace(self, run, efforts)
    }

    /// How far one step is from satisfying the optimality conditions of the plain problem: least sum of
    /// squares of the compromised rows, subject to the hard rows and the intervals on Δq. Multipliers are the
    /// best there are, so the certificate needs nothing from the method.
    ///
    /// # Errors
    /// A vector of the wrong length or with unreadable numbers, an unknown phase.
    pub fn certificate(&self, step: &CertifiedStep<'_>) -> Result<Certificate, RefereeError> {
        certificate::shared_stationarity(&self.problem, step)
    }

    /// Whether a method has solved its *own* problem: the residual of the conditions it claims (see
    /// [`Claim`]), with Jacobians by finite differences of the referee's own rows.
    ///
    /// # Errors
    /// As [`Referee::certificate`].
    pub fn own_stationarity(
        &self,
        claim: &Claim,
        step: &CertifiedStep<'_>,
    ) -> Result<OwnStationarity, RefereeError> {
        certificate::own_stationarity(&self.problem, claim, step)
    }
}

fn check_frames(
    robot: &Robot,
    field: &'static str,
    mut frames: impl Iterator<Item = FrameId>,
) -> Result<(), RefereeError> {
    let count = robot.frames().len();
    frames.find(|f| f.0 >= count).map_or(Ok(()), |frame| {
        Err(RefereeError::Frame {
            field,
            frame: frame.0,
            robot: robot.name().to_owned(),
            count,
        })
    })
}

fn check_soles(soles: &[Sole]) -> Result<(), RefereeError> {
    for (index, sole) in soles.iter().enumerate() {
        let extents = [
            ("half_length_m", sole.half_length_m),
            ("half_width_m", sole.half_width_m),
        ];
        for (field, found) in extents {
            if !(found > 0.0 && found <= LARGEST_READABLE) {
                return Err(RefereeError::Sole { index, field, found });
            }
        }
    }
    // In single support a polygon of no sole would have no corners.
    for (foot, word) in [(Foot::Right, "right"), (Foot::Left, "left")] {
        if !soles.is_empty() && soles.iter().all(|sole| sole.foot != foot) {
            return Err(RefereeError::Foot(word));
        }
    }
    Ok(())
}

fn coordinate(problem: &Problem, name: &str) -> Result<usize, RefereeError> {
    let robot = problem.robot();
    let known = || robot.coordinates().iter().map(|c| c.name.clone());
    known()
        .position(|other| other == name)
        .ok_or_else(|| RefereeError::Joint {
            name: name.to_owned(),
            robot: robot.name().to_owned(),
            known: known().collect(),
        })
}

fn is_readable(values: &[f64]) -> bool {
    values.iter().all(|v| v.abs() <= LARGEST_READABLE)
}

fn is_unit(quaternion: &[f64]) -> bool {
    (quaternion.iter().map(|c| c * c).sum::<f64>().sqrt() - 1.0).abs() <= UNIT_TOLERANCE
}

fn is_configuration(problem: &Problem, q: &[f64]) -> bool {
    let robot = problem.robot();
    q.len() == robot.nq() && is_readable(q) && (robot.root() == Root::Fixed || is_unit(&q[3..7]))
}

fn is_target(problem: &Problem, x: &[f64]) -> bool {
    let log = problem.orientation() == OrientationCoordinates::Log;
    x.len() == problem.nx()
        && is_readable(x)
        && problem.tasks().iter().enumerate().all(|(i, task)| {
            let target = tasks::target_of(problem, i, x);
            !(log && matches!(task.track, Track::Orientation(_) | Track::Pose(_)))
                || is_unit(&target[target.len() - 4..])
        })
}

/// One sample of a run that can be read.
#[derive(Clone, Copy, Debug)]
struct Sample<'a> {
    t_s: f64,
    q: &'a [f64],
    x: &'a [f64],
    xdot: &'a [f64],
    phase: PhaseId,
    support: Support,
}

/// The part of a run that can be read, with the posture at each sample.
#[derive(Debug)]
struct Readable<'a> {
    samples: Vec<Sample<'a>>,
    postures: Vec<Posture>,
    /// Whether that is all of it.
    complete: bool,
}

impl<'a> Readable<'a> {
    fn new(problem: &Problem, run: &Run<'a>) -> Self {
        let samples: Vec<_> = (0..run.q.len()).map_while(|k| sample(problem, run, k)).collect();
        let postures = samples
            .iter()
            .map(|s| Posture::new(problem.robot(), s.q))
            .collect();
        let complete = !samples.is_empty() && samples.len() == run.q.len();
        Self {
            samples,
            postures,
            complete,
        }
    }

    fn iter(&self) -> impl Iterator<Item = (&Sample<'a>, &Posture)> {
        self.samples.iter().zip(&self.postures)
    }
}

/// Sample k of a run, if it can be read.
fn sample<'a>(problem: &Problem, run: &Run<'a>, k: usize) -> Option<Sample<'a>> {
    let width = problem.nx() + problem.nxdot();
    let q = run.q[k].as_slice();
    let (x, xdot) = run
        .targets
        .get(k * width..(k + 1) * width)?
        .split_at(problem.nx());
    let phase = match run.phases {
        [only] => *only,
        several => *several.get(k.max(1) - 1)?,
    };
    let support = match run.support {
        [] => Support::Both,
        each => *each.get(k)?,
    };
    let readable = is_configuration(problem, q) && is_target(problem, x) && is_readable(xdot);
    let posed = (1.0 / LARGEST_READABLE..LARGEST_READABLE).contains(&run.dt_s);
    let posed = posed && phase.0 < problem.phases().len();
    (readable && posed).then_some(Sample {
        t_s: run.dt_s * k as f64,
        q,
        x,
        xdot,
        phase,
        support,
    })
}
