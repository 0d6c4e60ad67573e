//! # IK5: two-slack optimisation
//!
//! IK4 with position and velocity errors kept apart: each compromised row gets two slacks, so neither can cancel the other.
//!
//! ## Problem solved
//! ```text
//! minimise  δᵀ Q δ + γ εᵀ Q ε    subject to  f(q) = x + [δ; 0],   S_N [J(q) (q − q⁻) − ẋ Δt] = ε,
//!                                            g(q, (q − q⁻)/Δt) ≤ 0
//! ```
//! ## Step
//! (S1) Sequential quadratic programming on the stacked rows [f − x; √γ (J (q − q⁻) − ẋΔt)], exact derivatives, see
//! `sqp.rs`. (S2) q̇ = (q − q⁻)/Δt.
//!
//! Objectives of the problem add `μ ‖q − q⁻ − p‖²` to the cost, μ being `proximal` and p = Δt q̇₀ (`secondary.rs`).
//!
//! ## What it needs
//! Targets x and ẋ; a boundary.
//!
//! ## Known limits
//! As IK4. Away from limits both give the same first-order filter of the error (notes §4). Slow to leave a singularity with
//! few iterations.
//!
//! ## Source
//! Faraji & Ijspeert (2017), (S1) = eq. (9), (S2) = eq. (3).
//!
//! ## Deviations
//! Deviation: eq. (9) prints γ εᵀ Q ε with the Q of the positions; the weighted rows of `ik_core::rows` carry √Q already.

use crate::direct_position::{
    GAMMA_FIELD, KICK_FIELD, PROXIMAL_FIELD, START_FIELD, check_start, prepared, regulator,
};
use crate::gauss_newton::STEP_TOLERANCE_FIELD;
use crate::registry::{Field, Method, MethodInfo, N_FIELD, ParameterError, Parameters};
use crate::sqp::{Model, Residuals, Sqp, SqpParameters};
use crate::start::{Start, StartParameters};
use crate::step_qp::Stack;
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::{Declined, Formulation, Prepared, Solution, Stepper, Termination};
use ik_core::problem::Problem;
use ik_core::step::{ControlStep, Sample};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Parameters of [`TwoSlack`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TwoSlackParameters {
    /// Most iterations.
    pub n: u32,
    /// Regulator γ.
    pub gamma: f64,
    /// First iterate.
    pub start: Start,
    /// Distance from a limit at which the start moves a joint (rad, m).
    pub kick: f64,
    /// Proximal weight μ.
    pub proximal: f64,
    /// A step whose largest component is below this ends the iteration (rad, m).
    pub step_tolerance: f64,
}

impl Default for TwoSlackParameters {
    fn default() -> Self {
        Self {
            n: 15,
            gamma: 10.0,
            start: Start::Kick,
            kick: 1e-2,
            proximal: 1e-6,
            step_tolerance: 1e-9,
        }
    }
}

impl Parameters for TwoSlackParameters {
    const HELP: &'static [Field] = &[
        N_FIELD,
        GAMMA_FIELD,
        START_FIELD,
        KICK_FIELD,
        PROXIMAL_FIELD,
        STEP_TOLERANCE_FIELD,
    ];

    fn validate(&self) -> Result<(), ParameterError> {
        check_start("ik5", self.start, self.kick)
    }
}

/// IK5.
#[derive(Clone, Debug)]
pub struct TwoSlack {
    parameters: TwoSlackParameters,
}

impl Method for TwoSlack {
    type Parameters = TwoSlackParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "ik5",
        name: "IK5 two slacks",
        summary: "SQP on positions inside the boundary, separate slacks for position and velocity",
        source: "Faraji & Ijspeert (2017), eq. (9)",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self { parameters }
    }
}

impl Formulation for TwoSlack {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        let p = &self.parameters;
        let sqp = Sqp::new(
            problem,
            SeparateRows {
                gamma: regulator(problem, p.gamma),
            },
            SqpParameters {
                proximal: p.proximal,
                step_tolerance: p.step_tolerance,
                start: StartParameters {
                    start: p.start,
                    kick: p.kick,
                },
            },
        );
        Ok(prepared(TwoSlackStepper { sqp }, p.n, true))
    }
}

#[derive(Debug)]
struct TwoSlackStepper {
    sqp: Sqp<SeparateRows>,
}

impl Stepper for TwoSlackStepper {
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination {
        self.sqp.step(step, eval, out)
    }
    fn reset(&mut self) {
        self.sqp.reset();
    }
}

/// The rows of eq. (9): positions above, velocities below, both padded.
#[derive(Clone, Copy, Debug)]
struct SeparateRows {
    gamma: f64,
}

impl Model for SeparateRows {
    fn soft_rows(rows: usize) -> usize {
        2 * rows.next_multiple_of(4).max(4)
    }

    fn residuals(
        &self,
        _eval: &Evaluator,
        lin: &mut Linearisation,
        _target: Sample<'_>,
        dq: &[f64],
        dt_s: f64,
        out: &mut Residuals,
    ) {
        let (soft, ld) = (&lin.soft, lin.soft.ld());
        let root = self.gamma.sqrt();
        let stack = &mut out.soft;
        stack.rows = 2 * ld;
        soft.multiply_into(dq, &mut stack.motion);
        let (position, velocity) = stack.residual.split_at_mut(ld);
        position.copy_from_slice(&soft.error[..ld]);
        for (r, (m, rate)) in velocity.iter_mut().zip(stack.motion.iter().zip(&soft.rate)) {
            *r = root * (m - rate * dt_s);
        }
    }

    fn derivatives(
        &self,
        eval: &Evaluator,
        lin: &mut Linearisation,
        target: Sample<'_>,
        dq: &[f64],
        out: &mut Residuals,
    ) {
        eval.hard_jacobian(lin, target);
        eval.soft_velocity_derivative(lin, target, dq);
        let (soft, ld) = (&lin.soft, lin.soft.ld());
        let root = self.gamma.sqrt();
        let stack = &mut out.soft;
        let columns = soft.jacobian.chunks_exact(ld).zip(soft.second.chunks_exact(ld));
        for (out, (jacobian, second)) in stack.matrix.chunks_exact_mut(stack.ld).zip(columns) {
            let (position, velocity) = out.split_at_mut(ld);
            position.copy_from_slice(jacobian);
            velocity.iter_mut().zip(second).for_each(|(v, s)| *v = root * s);
        }
    }

    fn hard<'a>(&self, lin: &'a Linearisation, _residuals: &'a Residuals) -> Stack<'a> {
        Stack::plain(&lin.hard)
    }

    fn curvature_weight(&self, residual: &[f64], i: usize, task_ld: usize) -> f64 {
        // At dq = 0 the Hessian of J(q) dq is twice that of f.
        residual[i] + 2.0 * self.gamma.sqrt() * residual[task_ld + i]
    }
}
