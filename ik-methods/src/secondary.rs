//! The secondary motion of a step: where the problem's objectives pull the joints, for the methods to follow as far as the
//! tasks leave them free.
//!
//! ```text
//! p = Δt q̇₀,   q̇₀ = −Σ γ ∇H(q⁻)        Melson, eqs. (11)–(14)
//! ```
//!
//! A method that moves by the least increment without objectives moves by the increment nearest to p with them. Where the
//! tasks rest, all such methods stand still at the same postures, those without a descent in the null space of the tasks.

use ik_core::evaluator::Evaluator;
use ik_core::kinematics::Page;
use ik_core::problem::Problem;
use ik_core::step::ControlStep;

/// p of the current step.
#[derive(Clone, Debug)]
pub(crate) struct Secondary {
    increment: Vec<f64>,
    wanted: bool,
}

impl Secondary {
    /// Room for the objectives of `problem`.
    pub(crate) fn new(problem: &Problem) -> Self {
        Self {
            increment: vec![0.0; problem.robot().nv()],
            wanted: false,
        }
    }

    /// Whether any objective pulls in this step.
    pub(crate) fn wanted(step: &ControlStep<'_>) -> bool {
        step.gains.iter().any(|gain| *gain != 0.0)
    }

    /// Evaluates p at `q`, whose tree pass is `page`; costs nothing if no objective pulls.
    pub(crate) fn evaluate(
        &mut self,
        eval: &mut Evaluator,
        (q, page): (&[f64], &Page),
        step: &ControlStep<'_>,
    ) {
        self.wanted = Self::wanted(step);
        if !self.wanted {
            return;
        }
        self.increment.fill(0.0);
        eval.add_objectives(q, page, step.phase, step.gains, &mut self.increment);
        self.increment.iter_mut().for_each(|p| *p *= -step.dt_s);
    }

    /// p (length nv, zero for a root), if an objective pulls at all.
    pub(crate) fn increment(&self) -> Option<&[f64]> {
        self.wanted.then_some(&self.increment[..])
    }
}
