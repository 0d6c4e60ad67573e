//! The only caller of [`Stepper::step`]: computes the intervals, arms the meter, guards against what is not finite.

use crate::configuration::difference_into;
use crate::evaluator::{Counts, Evaluator};
use crate::formulation::{Declined, Formulation, Honours, Prepared, Solution, Stepper, Termination};
use crate::problem::{PhaseId, Problem};
use crate::step::{Bounds, ControlStep, Window};
use std::sync::Arc;

/// Drives one pairing of formulation and problem, step by step. Owns everything, borrows nothing.
#[derive(Debug)]
pub struct Driver {
    problem: Arc<Problem>,
    stepper: Box<dyn Stepper>,
    honours: Honours,
    notes: Vec<String>,
    majors: u32,
    evaluator: Evaluator,
    solution: Solution,
    lo: Vec<f64>,
    hi: Vec<f64>,
}

/// A step that cannot even be posed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StepError {
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
    /// Δt that is not a positive number.
    #[error("dt_s = {0}: must be a finite number above 0")]
    TimeStep(f64),
    /// A previous configuration, velocity or gain that is not finite, or whose root quaternion is not of unit length.
    #[error("{field}[{index}] = {value}: must be finite, and a root quaternion of unit length")]
    Value {
        /// Which vector.
        field: &'static str,
        /// Which entry.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A phase the problem does not have.
    #[error("phase {found} does not exist: the problem has {count}")]
    Phase {
        /// Index found.
        found: usize,
        /// Number of phases.
        count: usize,
    },
}

/// Quaternions of configurations are renormalised at every step; anything further from unit length is an input error.
const UNIT_TOLERANCE: f64 = 1e-6;

impl Driver {
    /// Prepares `formulation` for `problem`.
    ///
    /// # Errors
    /// The formulation's refusal.
    pub fn new(formulation: &dyn Formulation, problem: &Arc<Problem>) -> Result<Self, Declined> {
        let Prepared {
            stepper,
            majors,
            honours,
            notes,
        } = formulation.prepare(problem)?;
        let nv = problem.robot().nv();
        Ok(Self {
            problem: Arc::clone(problem),
            stepper,
            honours,
            notes,
            majors,
            evaluator: Evaluator::new(problem),
            solution: Solution::new(problem),
            lo: vec![f64::NEG_INFINITY; nv],
            hi: vec![f64::INFINITY; nv],
        })
    }

    /// What the formulation promises on this problem.
    pub fn honours(&self) -> Honours {
        self.honours
    }
    /// Remarks of the formulation.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
    /// Majors the formulation asks for per step.
    pub fn majors(&self) -> u32 {
        self.majors
    }
    /// Result of the last step.
    pub fn solution(&self) -> &Solution {
        &self.solution
    }
    /// Intervals of the last step: least and largest Δq, one per velocity coordinate.
    pub fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lo, &self.hi)
    }
    /// The problem.
    pub fn problem(&self) -> &Arc<Problem> {
        &self.problem
    }
    /// Forgets every accelerator of the method.
    pub fn reset(&mut self) {
        self.stepper.reset();
    }

    /// Checks what [`Driver::step`] takes for granted; for inputs from outside, not for the hot loop.
    ///
    /// # Errors
    /// The first field that is wrong.
    pub fn check(&self, input: &StepInput<'_>) -> Result<(), StepError> {
        let robot = self.problem.robot();
        let lengths = [
            ("q_prev", input.q_prev.len(), robot.nq()),
            ("v_prev", input.v_prev.len(), robot.nv()),
            ("gains", input.gains.len(), self.problem.objectives().len()),
        ];
        for (field, found, needed) in lengths {
            if found != needed {
                return Err(StepError::Length { field, found, needed });
            }
        }
        if !(input.dt_s.is_finite() && input.dt_s > 0.0) {
            return Err(StepError::TimeStep(input.dt_s));
        }
        if input.phase.0 >= self.problem.phases().len() {
            return Err(StepError::Phase {
                found: input.phase.0,
                count: self.problem.phases().len(),
            });
        }
        let numbers = [
            ("q_prev", input.q_prev),
            ("v_prev", input.v_prev),
            ("gains", input.gains),
        ];
        for (field, values) in numbers {
            if let Some((index, value)) = values.iter().enumerate().find(|(_, v)| !v.is_finite()) {
                return Err(StepError::Value {
                    field,
                    index,
                    value: *value,
                });
            }
        }
        if robot.root() == crate::robot::Root::Floating {
            let norm = input.q_prev[3..7].iter().map(|c| c * c).sum::<f64>().sqrt();
            if (norm - 1.0).abs() > UNIT_TOLERANCE {
                return Err(StepError::Value {
                    field: "q_prev",
                    index: 3,
                    value: input.q_prev[3],
                });
            }
        }
        Ok(())
    }

    /// Solves one step with at most `majors` majors; the result is in [`Driver::solution`].
    ///
    /// Never leaves a number that is not finite in the solution: if the method (or a NaN target) produced one, q is
    /// q⁻, v is zero and the step ended as [`Termination::Numerical`].
    pub fn step(&mut self, input: &StepInput<'_>, majors: u32) -> (Termination, Counts) {
        let outside = self.intervals(input);
        let step = ControlStep {
            q_prev: input.q_prev,
            v_prev: input.v_prev,
            dt_s: input.dt_s,
            phase: input.phase,
            targets: input.targets,
            bounds: Bounds {
                lo: &self.lo,
                hi: &self.hi,
                outside,
            },
            gains: input.gains,
        };
        self.evaluator.meter.arm(majors);
        self.solution.claim.has = false;
        let mut termination = self.stepper.step(&step, &mut self.evaluator, &mut self.solution);
        let finite = |v: &[f64]| v.iter().all(|x| x.is_finite());
        if !(finite(&self.solution.q) && finite(&self.solution.v)) {
            self.solution.q.copy_from_slice(input.q_prev);
            self.solution.v.fill(0.0);
            self.solution.claim.has = false;
            if !matches!(termination, Termination::Numerical(_) | Termination::Failed(_)) {
                termination = Termination::Numerical("a number of the result is not finite");
            }
        }
        (termination, self.evaluator.meter.counts())
    }

    fn intervals(&mut self, input: &StepInput<'_>) -> usize {
        let robot = self.problem.robot();
        let (nq, nv) = (robot.root().nq(), robot.root().nv());
        let mut outside = 0;
        let joints = robot.coordinates().iter().zip(&input.q_prev[nq..]);
        for ((c, &q), (lo, hi)) in joints.zip(self.lo[nv..].iter_mut().zip(&mut self.hi[nv..])) {
            let interval = self.problem.boundary().interval(&c.limits, q, input.dt_s);
            (*lo, *hi) = (interval.lo, interval.hi);
            outside += usize::from(interval.outside);
        }
        outside
    }

    /// Writes `Δq = q ⊖ q⁻` of the last solution into `out` (length nv).
    pub fn increment_into(&self, q_prev: &[f64], out: &mut [f64]) {
        difference_into(self.problem.robot(), q_prev, &self.solution.q, out);
    }
}

/// What the caller of a step provides.
#[derive(Clone, Copy, Debug)]
pub struct StepInput<'a> {
    /// Previous configuration (length nq).
    pub q_prev: &'a [f64],
    /// Velocity that led to it (length nv).
    pub v_prev: &'a [f64],
    /// Time step (s).
    pub dt_s: f64,
    /// Phase.
    pub phase: PhaseId,
    /// Target samples.
    pub targets: Window<'a>,
    /// Gains of the objectives.
    pub gains: &'a [f64],
}
