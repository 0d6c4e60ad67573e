//! # IK1: error integration
//!
//! One damped Newton step per control step: the error of the tasks is integrated over time. The cheapest method here,
//! and the reference of every time ratio. Right where the motion is slow, feasible and away from singularities.
//!
//! ## Problem solved
//! ```text
//! minimise  δᵀ Q δ + Δqᵀ R Δq    subject to  f(q⁻) + J(q⁻) Δq = x + [δ; 0]
//! ```
//! ## Step
//! (S1) Solve the KKT system for Δq, λ with E = x − f(q⁻). (S2) q = q⁻ ⊕ Δq, q̇ = Δq/Δt.
//!
//! Objectives of the problem are the reference of the regularisation: `(Δq − p)ᵀ R (Δq − p)` with p = Δt q̇₀, see
//! `secondary.rs`. Hard rows are not disturbed, compromised ones by as much as R weighs.
//!
//! ## What it needs
//! Targets x. Knows no boundary: positions and velocities are whatever the step gives.
//!
//! ## Known limits
//! The error follows the target's speed (about ẋΔt). At a straight knee the gradient towards bending vanishes and it
//! leaves late; velocities are unbounded.
//!
//! ## Source
//! Faraji & Ijspeert (2017), Singularity-Tolerant Inverse Kinematics for Bipedal Robots, RA-L 2(2); (S1) = eqs. (1), (2),
//! (S2) = eq. (3). Default R = 1e-2 is their Table I.
//!
//! ## Deviations
//! Deviation: eq. (2) prints a pseudo-inverse of the KKT matrix. Rows are eliminated with rank-revealing pivoting instead,
//! which is the same where the rows are independent; where they contradict each other the pseudo-inverse would mix row
//! error and multipliers, here the violation of the hard rows is minimised first and reported.

use crate::qp::Outcome;
use crate::registry::{Allowed, Field, Method, MethodInfo, Parameters};
use crate::secondary::Secondary;
use crate::step_qp::{Stack, StepQp, conclude, finish_unbounded, stay};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::{
    Declined, Formulation, Honours, Prepared, Solution, Stepper, Termination, Trust, Use,
};
use ik_core::problem::Problem;
use ik_core::step::ControlStep;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Parameters of [`ErrorIntegration`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorIntegrationParameters {
    /// R as a multiple of the identity, root included.
    pub damping: f64,
}

impl Default for ErrorIntegrationParameters {
    fn default() -> Self {
        Self { damping: 1e-2 }
    }
}

/// The help of R, which IK1, IK2 and IK3 share.
pub(crate) const DAMPING_FIELD: Field = Field {
    key: "damping",
    unit: "m²/rad²",
    meaning: "R = damping · I over all velocity coordinates, root included",
    allowed: Allowed::Number {
        least: 1e-12,
        largest: 1e6,
    },
};

impl Parameters for ErrorIntegrationParameters {
    const HELP: &'static [Field] = &[DAMPING_FIELD];
}

/// IK1.
#[derive(Clone, Debug)]
pub struct ErrorIntegration {
    parameters: ErrorIntegrationParameters,
}

impl Method for ErrorIntegration {
    type Parameters = ErrorIntegrationParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "ik1",
        name: "IK1 error integration",
        summary: "one damped least-squares step per control step, no boundary",
        source: "Faraji & Ijspeert (2017), eqs. (1)-(3)",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self { parameters }
    }
}

impl Formulation for ErrorIntegration {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        let stepper = ErrorIntegrationStepper {
            problem: Arc::clone(problem),
            damping: self.parameters.damping,
            lin: Linearisation::new(problem),
            qp: StepQp::new(problem),
            secondary: Secondary::new(problem),
        };
        let honours = Honours {
            boundary: false,
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
struct ErrorIntegrationStepper {
    problem: Arc<Problem>,
    damping: f64,
    lin: Linearisation,
    qp: StepQp,
    secondary: Secondary,
}

impl Stepper for ErrorIntegrationStepper {
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination {
        if !eval.meter.next_major() {
            stay(step, out);
            return Termination::Budget;
        }
        self.qp.reset();
        self.qp.free();
        eval.linearise(step.q_prev, step.phase, step.targets.now(), &mut self.lin);
        self.secondary.evaluate(eval, (step.q_prev, &self.lin.page), step);
        let pull = self.secondary.increment();
        let outcome = damped_step(&mut self.qp, &self.lin, self.damping, pull, eval);
        finish_unbounded(&self.problem, step, &self.qp.solution.x, out);
        conclude(outcome, Termination::Stepped, step, out)
    }

    fn reset(&mut self) {
        self.qp.reset();
    }
}

/// Solves eq. (1) (eq. (7) if `qp` is bounded) at the linearised configuration for the increment from there, R pulling it
/// towards `pull`, to zero without one.
pub(crate) fn damped_step(
    qp: &mut StepQp,
    lin: &Linearisation,
    damping: f64,
    pull: Option<&[f64]>,
    eval: &mut Evaluator,
) -> Outcome {
    qp.start(damping);
    if let Some(pull) = pull {
        qp.centre(damping, pull);
    }
    qp.add(Stack {
        matrix: &lin.soft.jacobian,
        ld: lin.soft.ld(),
        residual: &lin.soft.error,
    });
    let hard = Stack {
        matrix: &lin.hard.jacobian,
        ld: lin.hard.ld(),
        residual: &lin.hard.error,
    };
    qp.solve(hard, lin.hard.rows(), eval)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{arm_problem, drive};

    /// A pendulum whose tip height is compromised: (J² + R) Δq = J (x − f), by hand.
    #[test]
    fn one_step_of_a_pendulum_by_hand() {
        let (problem, x) = arm_problem("pendulum", 0.3);
        let method = ErrorIntegration::new(ErrorIntegrationParameters { damping: 0.5 });
        let (q, _) = drive(&method, &problem, &[0.1], &x);
        // Tip at (0, 0, −l) turned about y (or its own axis): gradient by differences of the driver's own problem.
        let mut page = ik_core::kinematics::Page::new(problem.robot());
        let mut tip = |q: f64| {
            ik_core::kinematics::forward(problem.robot(), &[q], &mut page);
            page.frame_position(
                problem.robot(),
                ik_core::robot::FrameId(problem.robot().frames().len() - 1),
            )
        };
        let h = 1e-6;
        let j = (tip(0.1 + h) - tip(0.1 - h)) / (2.0 * h);
        let error = nalgebra::Vector3::new(x[0], x[1], x[2]) - tip(0.1);
        let expected = 0.1 + j.dot(&error) / (j.dot(&j) + 0.5);
        assert!((q[0] - expected).abs() < 1e-9, "{} {expected}", q[0]);
    }
}
