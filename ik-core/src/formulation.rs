//! The traits every way to solve a control step implements, and the types they exchange. Nothing else.

use crate::evaluator::Evaluator;
use crate::problem::Problem;
use crate::step::ControlStep;
use std::fmt::Debug;
use std::sync::Arc;

/// A formulation with its parameters: how a step is solved. Immutable and shared.
pub trait Formulation: Send + Sync + Debug {
    /// Sizes everything for `problem`, or says why this formulation cannot take it. All allocation happens here.
    ///
    /// # Errors
    /// A typed refusal with its reason, which becomes a result row.
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined>;
}

/// The memory of one pairing of formulation and problem. Owns what it needs, borrows nothing.
pub trait Stepper: Send + Debug {
    /// Solves one control step: reads `step`, evaluates through `eval`, writes `out`.
    ///
    /// Loops on `eval.meter.next_major()`, so the budget and the count cannot disagree. The answer depends on `step`
    /// alone; memory may only accelerate.
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination;

    /// Forgets every accelerator.
    fn reset(&mut self);
}

/// A formulation ready for one problem.
#[derive(Debug)]
pub struct Prepared {
    /// The memory.
    pub stepper: Box<dyn Stepper>,
    /// Majors the formulation asks for per step (its parameter n; 1 if it does not iterate).
    pub majors: u32,
    /// What is promised on this problem.
    pub honours: Honours,
    /// What runs but deserves a remark in the row.
    pub notes: Vec<String>,
}

/// What a formulation promises on the problem it was prepared for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Honours {
    /// The returned q lies in the intervals of the step, unless it ended without a single major or as `Numerical`: then
    /// the robot stays at q⁻, also where the intervals force a motion.
    pub boundary: bool,
    /// Hard rows are met whenever the boundary allows it (as far as the budget goes).
    pub hard_rows: bool,
    /// What happens to the problem's objectives.
    pub objective: Use,
    /// `step` allocates nothing.
    pub allocation_free: bool,
    /// Where its iteration counts come from.
    pub counts: Trust,
}

/// What a formulation does with secondary objectives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// They have no effect.
    Ignored,
    /// They act in the null space of the tasks.
    Projected,
    /// They are added to the cost.
    Regularised,
}

/// Where iteration counts come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// Counted by the evaluator's meter.
    Metered,
    /// Declared by the method.
    Declared,
}

/// Why a formulation refuses a problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Declined {
    /// The tasks, robot or phases have a shape it cannot take.
    #[error("cannot take this problem: {0}")]
    Shape(String),
    /// It cannot express the boundary.
    #[error("cannot express the boundary: {0}")]
    Boundary(String),
    /// It needs information that the problem does not supply.
    #[error("needs {needs}, which the problem does not supply")]
    Information {
        /// What is missing.
        needs: String,
    },
    /// The tasks do not match the robot's mobility.
    #[error(
        "hard tasks impose {imposed} rows of rank {rank} on a mobility of {mobility}: too many are those of {tasks:?}"
    )]
    Mobility {
        /// Rows imposed.
        imposed: usize,
        /// Degrees of freedom.
        mobility: usize,
        /// Rank found.
        rank: usize,
        /// The tasks that impose more than their part of the robot can do.
        tasks: Vec<String>,
    },
    /// Something outside (a program, a file) is missing.
    #[error("unavailable: {0}")]
    Unavailable(String),
}

/// How a step ended, as the method claims it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Termination {
    /// Its own stopping rule holds.
    Converged,
    /// One step of an integrating method, which has no stopping rule.
    Stepped,
    /// The budget of majors ran out first.
    Budget,
    /// The hard rows do not fit the boundary (or contradict each other): their violation was minimised first.
    HardRowsRelaxed {
        /// Euclidean norm of the hard rows that remain (m and rad mixed): at the returned q for iterating methods, in the
        /// linearisation for those that take one step.
        residual: f64,
    },
    /// One step of an integrating method whose hard rows were damped, by choice or because they are nearly dependent.
    Damped {
        /// Euclidean norm of the hard rows that the damping leaves in the linearisation (m and rad mixed).
        residual: f64,
    },
    /// The target cannot be reached by this much.
    OutOfReach {
        /// Missing distance (m).
        missing_m: f64,
    },
    /// Every solution of a limb is outside the interval of a joint: the robot moves to the one that is least outside as far
    /// as the intervals allow, and hard rows are missed.
    OutsideLimits {
        /// Index of the joint coordinate that is furthest outside.
        joint: usize,
        /// By how much (rad or m).
        excess: f64,
    },
    /// Arithmetic broke down; q is the previous configuration.
    Numerical(&'static str),
    /// A method outside this process failed.
    Failed(Failure),
}

/// How an outside method failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// No answer in time.
    Timeout,
    /// It ended.
    Exited,
    /// Its answer could not be read.
    Garbage,
    /// Its answer has another dimension.
    WrongDimension,
}

impl Termination {
    /// A short stable word for records.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Stepped => "stepped",
            Self::Budget => "budget",
            Self::HardRowsRelaxed { .. } => "hard-rows-relaxed",
            Self::Damped { .. } => "damped",
            Self::OutOfReach { .. } => "out-of-reach",
            Self::OutsideLimits { .. } => "outside-limits",
            Self::Numerical(_) => "numerical",
            Self::Failed(_) => "failed",
        }
    }
}

/// Output of one step, sized by the driver.
#[derive(Clone, Debug)]
pub struct Solution {
    /// New configuration (length nq).
    pub q: Vec<f64>,
    /// Velocity that goes with it (length nv): Δq/Δt unless the method computes its own.
    pub v: Vec<f64>,
    /// Multipliers offered as evidence.
    pub claim: Claim,
}

/// Multipliers a method offers for the solution of its *own* problem: with J_s, J_h the soft (weighted) and hard rows at
/// the returned q and e_s their error, `J_sᵀ e_s + own − J_hᵀ hard − bound = 0`, `bound` positive only where Δq is at its
/// least, negative only at its largest.
#[derive(Clone, Debug)]
pub struct Claim {
    /// False if the method offers nothing for this step.
    pub has: bool,
    /// Multipliers of the hard rows.
    pub hard: Vec<f64>,
    /// Multipliers of the bounds (length nv).
    pub bound: Vec<f64>,
    /// Gradient of the method's private terms (regularisation, velocity rows), length nv.
    pub own: Vec<f64>,
}

impl Solution {
    /// A zero solution for `problem`.
    pub fn new(problem: &Problem) -> Self {
        let nv = problem.robot().nv();
        let hard = problem.largest_hard_rows();
        Self {
            q: problem.robot().neutral(),
            v: vec![0.0; nv],
            claim: Claim {
                has: false,
                hard: vec![0.0; hard],
                bound: vec![0.0; nv],
                own: vec![0.0; nv],
            },
        }
    }
}
