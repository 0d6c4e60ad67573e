//! Closing the loops: the configuration near a guess that meets the targets of all tasks at one time, the start for one.
//!
//! Damped Gauss–Newton (Levenberg 1944): with error e and Jacobian J of all task rows, `dq = −Jᵀ (J Jᵀ + μ I)⁻¹ e`, the
//! damping μ falling with every step that reduces |e| and rising with every other. Short steps keep joints on the side of
//! a singularity on which the guess is; what the tasks leave free changes as little as possible.

use super::problem_spec::{PrioritySpec, ProblemSpec};
use crate::error::InputError;
use crate::trajectory::{Samples, Trajectory, row_name};
use ik_core::boundary::Boundary;
use ik_core::configuration::integrate;
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::problem::{PhaseId, Problem};
use ik_core::step::Sample;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Largest error that needs no further step: a few units in the last place of a coordinate of 1 m or 1 rad, times the
/// joints it went through.
const MET: f64 = 1e-13;
/// Largest error of a start that is accepted: far below what any method leaves after a step (m or rad).
const ACCEPTED: f64 = 1e-9;
/// Damping at the beginning, relative to the unit singular values of a normal task Jacobian, and its factors.
const DAMPING: f64 = 1e-2;
const DAMPING_LESS: f64 = 0.1;
const DAMPING_MORE: f64 = 10.0;
/// Damping at which a step is so short that refusing it means that there is nothing to gain.
const DAMPING_MOST: f64 = 1e10;
/// Steps tried. Near the solution every step gains several digits; most of these are for singular starts.
const MOST_STEPS: u32 = 200;

/// The configuration near `guess` that meets all targets of `trajectory` at t = 0. `place` stands for the scenario in
/// messages, `start` for the start.
///
/// # Errors
/// Targets that cannot be met from there: the component that misses most, and by how much.
pub(super) fn close_loops(
    spec: &ProblemSpec,
    trajectory: &Trajectory,
    guess: &[f64],
    place: &str,
    start: &str,
) -> Result<Vec<f64>, InputError> {
    let closer = Closer::new(spec, place)?;
    let closed = closer.close(trajectory, 0.0, guess, place)?;
    match closed.miss {
        None => Ok(closed.q),
        Some(miss) => Err(miss.at_start(start)),
    }
}

/// Closes loops at any time of a motion.
#[derive(Debug)]
pub(super) struct Closer {
    problem: Arc<Problem>,
}

/// The best configuration found.
#[derive(Debug)]
pub(super) struct Closed {
    pub(super) q: Vec<f64>,
    /// The component that misses most, if one misses.
    pub(super) miss: Option<Miss>,
}

/// A component that cannot be met.
#[derive(Debug)]
pub(super) struct Miss {
    /// `task.component`.
    pub(super) component: String,
    /// By how much (m or rad).
    pub(super) error: f64,
}

impl Miss {
    fn at_start(&self, start: &str) -> InputError {
        let field = format!("meet = \"targets\": {} at t = 0", self.component);
        let found = format!("missed by {:.3e}", self.error);
        let allowed =
            format!("{ACCEPTED:e} (m or rad); targets that the robot can meet, or a guess nearer to them");
        InputError::value(start, &field, found, &allowed)
    }
}

impl Closer {
    /// For the tasks of `spec`; `place` goes into messages.
    ///
    /// # Errors
    /// As [`ProblemSpec::build`].
    pub(super) fn new(spec: &ProblemSpec, place: &str) -> Result<Self, InputError> {
        let problem = all_rows(spec).build(place)?;
        Ok(Self { problem })
    }

    /// The configuration near `guess` that meets all targets at `t` (s), or the best there is.
    ///
    /// # Errors
    /// A target that is not finite.
    pub(super) fn close(
        &self,
        trajectory: &Trajectory,
        t: f64,
        guess: &[f64],
        place: &str,
    ) -> Result<Closed, InputError> {
        let sample = Samples::at(&self.problem, trajectory, t, place)?;
        let (x, xdot) = sample.split_at(self.problem.nx());
        let closure = Closure {
            problem: &self.problem,
            target: Sample { x, xdot },
        };
        let (q, error) = closure.solve(guess);
        let row = error.iamax();
        let miss = (error[row].abs() > ACCEPTED).then(|| Miss {
            component: row_name(&self.problem, row),
            error: error[row].abs(),
        });
        Ok(Closed { q, miss })
    }
}

/// The same tasks, all of them in full: hard, so that no weight hides a row.
fn all_rows(spec: &ProblemSpec) -> ProblemSpec {
    let mut spec = spec.clone();
    spec.boundary = Boundary::None;
    spec.preview_s = 0.0;
    spec.objectives.clear();
    for task in &mut spec.tasks {
        task.priority = PrioritySpec::Hard;
    }
    spec
}

struct Closure<'a> {
    problem: &'a Arc<Problem>,
    target: Sample<'a>,
}

impl Closure<'_> {
    /// The best configuration found and its errors.
    fn solve(&self, guess: &[f64]) -> (Vec<f64>, DVector<f64>) {
        let mut q = guess.to_vec();
        let (mut error, mut jacobian) = self.rows(&q);
        let mut damping = DAMPING;
        for _ in 0..MOST_STEPS {
            if error.amax() <= MET || damping > DAMPING_MOST {
                break;
            }
            let Some(dq) = step(&jacobian, &error, damping) else {
                damping *= DAMPING_MORE;
                continue;
            };
            let trial = integrate(self.problem.robot(), &q, dq.as_slice());
            let (trial_error, trial_jacobian) = self.rows(&trial);
            if trial_error.norm() < error.norm() {
                (q, error, jacobian) = (trial, trial_error, trial_jacobian);
                damping *= DAMPING_LESS;
            } else {
                damping *= DAMPING_MORE;
            }
        }
        (q, error)
    }

    /// Errors and their Jacobian at `q`.
    fn rows(&self, q: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let mut lin = Linearisation::new(self.problem);
        Evaluator::new(self.problem).linearise(q, PhaseId(0), self.target, &mut lin);
        let (rows, cols) = (lin.hard.rows(), lin.hard.cols());
        let error = DVector::from_column_slice(&lin.hard.error[..rows]);
        (error, DMatrix::from_fn(rows, cols, |i, v| lin.hard.column(v)[i]))
    }
}

/// One damped step; none if the damped matrix is singular.
fn step(jacobian: &DMatrix<f64>, error: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let rows = jacobian.nrows();
    let normal = jacobian * jacobian.transpose() + DMatrix::identity(rows, rows) * damping;
    Some(-jacobian.transpose() * normal.cholesky()?.solve(error))
}
