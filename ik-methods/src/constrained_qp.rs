//! # IK3: error integration inside a boundary
//!
//! IK1's step with the joint boundary as constraint: one convex quadratic program per control step. What most
//! whole-body controllers do.
//!
//! ## Problem solved
//! ```text
//! minimise  δᵀ Q δ + Δqᵀ R Δq    subject to  f(q⁻) + J(q⁻) Δq = x + [δ; 0],   g(q⁻ + Δq, Δq/Δt) ≤ 0
//! ```
//! ## Step
//! (S1) Solve the program, g being an exact interval of each Δq_j. (S2) q = q⁻ ⊕ Δq, q̇ = Δq/Δt.
//!
//! Objectives of the problem are the reference of the regularisation as in IK1: `(Δq − p)ᵀ R (Δq − p)`, p = Δt q̇₀.
//!
//! ## What it needs
//! Targets x and a boundary (without one it is IK1).
//!
//! ## Known limits
//! Integrates the error like IK1 and is as late at a straight knee; the boundary then keeps it from catching up. Hard
//! rows that do not fit the interval are relaxed and reported.
//!
//! ## Source
//! Faraji & Ijspeert (2017), (S1) = eqs. (6), (7), (S2) = eq. (3).
//!
//! ## Deviations
//! None: with q = q⁻ + Δq the inequality of eq. (6) *is* an interval, see `ik_core::boundary`.

use crate::error_integration::{DAMPING_FIELD, damped_step};
use crate::registry::{Field, Method, MethodInfo, Parameters};
use crate::secondary::Secondary;
use crate::step_qp::{StepQp, conclude, finish, stay};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::{
    Declined, Formulation, Honours, Prepared, Solution, Stepper, Termination, Trust, Use,
};
use ik_core::problem::Problem;
use ik_core::step::ControlStep;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Parameters of [`ConstrainedQp`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstrainedQpParameters {
    /// R as a multiple of the identity, root included.
    pub damping: f64,
}

impl Default for ConstrainedQpParameters {
    fn default() -> Self {
        Self { damping: 1e-2 }
    }
}

impl Parameters for ConstrainedQpParameters {
    const HELP: &'static [Field] = &[DAMPING_FIELD];
}

/// IK3.
#[derive(Clone, Debug)]
pub struct ConstrainedQp {
    parameters: ConstrainedQpParameters,
}

impl Method for ConstrainedQp {
    type Parameters = ConstrainedQpParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "ik3",
        name: "IK3 constrained QP",
        summary: "IK1's step with the joint boundary as constraint",
        source: "Faraji & Ijspeert (2017), eqs. (6), (7)",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self { parameters }
    }
}

impl Formulation for ConstrainedQp {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        let stepper = ConstrainedQpStepper {
            problem: Arc::clone(problem),
            damping: self.parameters.damping,
            lin: Linearisation::new(problem),
            qp: StepQp::new(problem),
            secondary: Secondary::new(problem),
            zero: vec![0.0; problem.robot().nv()],
        };
        let honours = Honours {
            boundary: true,
            hard_rows: false,
            objective: Use::Regularised,
            allocation_free: true,
            counts: Trust::Metered,
        };
        Ok(Prepared {
            stepper: Box::new(stepper),
            majors: 1,
            honours,
            notes: vec![],
        })
    }
}

#[derive(Debug)]
struct ConstrainedQpStepper {
    problem: Arc<Problem>,
    damping: f64,
    lin: Linearisation,
    qp: StepQp,
    secondary: Secondary,
    zero: Vec<f64>,
}

impl Stepper for ConstrainedQpStepper {
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination {
        if !eval.meter.next_major() {
            stay(step, out);
            return Termination::Budget;
        }
        self.qp.reset();
        self.qp.bound(&step.bounds, &self.zero);
        eval.linearise(step.q_prev, step.phase, step.targets.now(), &mut self.lin);
        self.secondary.evaluate(eval, (step.q_prev, &self.lin.page), step);
        let pull = self.secondary.increment();
        let outcome = damped_step(&mut self.qp, &self.lin, self.damping, pull, eval);
        finish(&self.problem, step, &mut self.qp.solution.x, out);
        conclude(outcome, Termination::Stepped, step, out)
    }

    fn reset(&mut self) {
        self.qp.reset();
    }
}
