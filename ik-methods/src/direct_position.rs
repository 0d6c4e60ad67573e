//! # IK4: direct position optimisation
//!
//! Solves for the position itself inside the boundary, with a regulator γ that mixes the target's velocity into each row:
//! it smooths the catch-up after a saturation and makes a joint leave a singularity before the error asks for it.
//!
//! ## Problem solved
//! ```text
//! minimise  δᵀ Q δ    subject to  f(q) + γ [J(q) (q − q⁻) − ẋ Δt] = x + [δ; 0],   g(q, (q − q⁻)/Δt) ≤ 0
//! ```
//! ## Step
//! (S1) Sequential quadratic programming with the exact derivative J + γ (J + ∂J (q − q⁻)) of every row, see `sqp.rs`.
//! (S2) q̇ = (q − q⁻)/Δt.
//!
//! Objectives of the problem add `μ ‖q − q⁻ − p‖²` to the cost, μ being `proximal` and p = Δt q̇₀ (`secondary.rs`).
//!
//! ## What it needs
//! Targets x and ẋ; a boundary (without one it is an undamped Newton method).
//!
//! ## Known limits
//! Myopic: hard rows that move while the legs are locked straight do not fit the boundary; they are relaxed and reported.
//! Error follows the target's acceleration, e ≈ γ ½ẍΔt². With `rows = "literal"` the hard rows are filtered like the soft
//! ones, so fixed feet slip by up to 2e-4 m.
//!
//! ## Source
//! Faraji & Ijspeert (2017), (S1) = eq. (8), (S2) = eq. (3); γ = 10 and n = 15 from Table I.
//!
//! ## Deviations
//! Deviation: γ acts on the compromised rows only by default (`rows = "soft"`); eq. (8) prints it on all rows (notes §4).
//! Deviation: the source solves with SNOPT and does not say how it starts; see `start.rs` for the start and its reason.

use crate::gauss_newton::STEP_TOLERANCE_FIELD;
use crate::registry::{Allowed, Field, Method, MethodInfo, N_FIELD, ParameterError, Parameters};
use crate::sqp::{Block, Model, Residuals, Sqp, SqpParameters};
use crate::start::{START_WORDS, Start, StartParameters};
use crate::step_qp::Stack;
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::{
    Declined, Formulation, Honours, Prepared, Solution, Stepper, Termination, Trust, Use,
};
use ik_core::problem::{Kind, Problem};
use ik_core::rows::Rows;
use ik_core::step::{ControlStep, Sample};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Which rows carry the regulator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RegulatedRows {
    /// The compromised rows.
    #[default]
    Soft,
    /// All rows, as printed.
    Literal,
}

/// Parameters of [`DirectPosition`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DirectPositionParameters {
    /// Most iterations.
    pub n: u32,
    /// Regulator γ.
    pub gamma: f64,
    /// Which rows carry γ.
    pub rows: RegulatedRows,
    /// First iterate.
    pub start: Start,
    /// Distance from a limit at which the start moves a joint (rad, m).
    pub kick: f64,
    /// Proximal weight μ.
    pub proximal: f64,
    /// A step whose largest component is below this ends the iteration (rad, m).
    pub step_tolerance: f64,
}

impl Default for DirectPositionParameters {
    fn default() -> Self {
        Self {
            n: 15,
            gamma: 10.0,
            rows: RegulatedRows::Soft,
            start: Start::Kick,
            kick: 1e-2,
            proximal: 1e-6,
            step_tolerance: 1e-9,
        }
    }
}

/// The help of γ, start, kick and μ, which IK4 and IK5 share.
pub(crate) const GAMMA_FIELD: Field = Field {
    key: "gamma",
    unit: "-",
    meaning: "regulator: weight of the velocity row against the position row",
    allowed: Allowed::Number {
        least: 0.0,
        largest: 1e6,
    },
};
pub(crate) const START_FIELD: Field = Field {
    key: "start",
    unit: "-",
    meaning: "first iterate: the previous posture, joints near a limit moved inside, or only where curvature says so",
    allowed: Allowed::Words(START_WORDS),
};
pub(crate) const KICK_FIELD: Field = Field {
    key: "kick",
    unit: "rad, m",
    meaning: "distance from a limit at which the start moves a joint",
    allowed: Allowed::Number {
        least: 0.0,
        largest: 1.0,
    },
};
pub(crate) const PROXIMAL_FIELD: Field = Field {
    key: "proximal",
    unit: "m²/rad²",
    meaning: "weight of the squared step in each quadratic program; vanishes at the solution",
    allowed: Allowed::Number {
        least: 1e-12,
        largest: 1e6,
    },
};

impl Parameters for DirectPositionParameters {
    const HELP: &'static [Field] = &[
        N_FIELD,
        GAMMA_FIELD,
        Field {
            key: "rows",
            unit: "-",
            meaning: "rows that carry the regulator: the compromised ones, or all as printed in eq. (8)",
            allowed: Allowed::Words(&["soft", "literal"]),
        },
        START_FIELD,
        KICK_FIELD,
        PROXIMAL_FIELD,
        STEP_TOLERANCE_FIELD,
    ];

    fn validate(&self) -> Result<(), ParameterError> {
        check_start("ik4", self.start, self.kick)
    }
}

/// A start that moves joints needs a distance.
pub(crate) fn check_start(method: &'static str, start: Start, kick: f64) -> Result<(), ParameterError> {
    if start != Start::Plain && kick <= 0.0 {
        let rule = format!("kick = {kick} moves nothing; use start = \"plain\" or a kick above 0");
        return Err(ParameterError::Rule { method, rule });
    }
    Ok(())
}

/// IK4.
#[derive(Clone, Debug)]
pub struct DirectPosition {
    parameters: DirectPositionParameters,
}

impl Method for DirectPosition {
    type Parameters = DirectPositionParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "ik4",
        name: "IK4 direct position",
        summary: "SQP on positions inside the boundary, velocity mixed into each row by the regulator",
        source: "Faraji & Ijspeert (2017), eq. (8)",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self { parameters }
    }
}

impl Formulation for DirectPosition {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        let p = &self.parameters;
        let gamma = regulator(problem, p.gamma);
        let model = CombinedRows { gamma, rows: p.rows };
        let sqp = Sqp::new(
            problem,
            model,
            SqpParameters {
                proximal: p.proximal,
                step_tolerance: p.step_tolerance,
                start: StartParameters {
                    start: p.start,
                    kick: p.kick,
                },
            },
        );
        Ok(prepared(
            DirectPositionStepper { sqp },
            p.n,
            p.rows == RegulatedRows::Soft,
        ))
    }
}

/// γ as it acts on this problem: a pose problem has no velocity to regulate.
pub(crate) fn regulator(problem: &Problem, gamma: f64) -> f64 {
    match problem.kind() {
        Kind::Tracking => gamma,
        Kind::Pose => 0.0,
    }
}

/// What IK4 and IK5 promise.
pub(crate) fn prepared(stepper: impl Stepper + 'static, majors: u32, hard_rows: bool) -> Prepared {
    let honours = Honours {
        boundary: true,
        hard_rows,
        objective: Use::Regularised,
        allocation_free: true,
        counts: Trust::Metered,
    };
    Prepared {
        stepper: Box::new(stepper),
        majors,
        honours,
        notes: vec![],
    }
}

#[derive(Debug)]
struct DirectPositionStepper {
    sqp: Sqp<CombinedRows>,
}

impl Stepper for DirectPositionStepper {
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination {
        self.sqp.step(step, eval, out)
    }
    fn reset(&mut self) {
        self.sqp.reset();
    }
}

/// The rows of eq. (8).
#[derive(Clone, Copy, Debug)]
struct CombinedRows {
    gamma: f64,
    rows: RegulatedRows,
}

impl Model for CombinedRows {
    fn soft_rows(rows: usize) -> usize {
        rows
    }

    fn residuals(
        &self,
        eval: &Evaluator,
        lin: &mut Linearisation,
        target: Sample<'_>,
        dq: &[f64],
        dt_s: f64,
        out: &mut Residuals,
    ) {
        regulate_residual(&lin.soft, self.gamma, dq, dt_s, &mut out.soft);
        if self.rows == RegulatedRows::Literal {
            eval.hard_jacobian(lin, target);
            regulate_residual(&lin.hard, self.gamma, dq, dt_s, &mut out.hard);
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
        eval.soft_velocity_derivative(lin, target, dq);
        regulate_matrix(&lin.soft, self.gamma, &mut out.soft);
        match self.rows {
            RegulatedRows::Soft => eval.hard_jacobian(lin, target),
            RegulatedRows::Literal => {
                eval.hard_velocity_derivative(lin, target, dq);
                regulate_matrix(&lin.hard, self.gamma, &mut out.hard);
            }
        }
    }

    fn hard<'a>(&self, lin: &'a Linearisation, residuals: &'a Residuals) -> Stack<'a> {
        match self.rows {
            RegulatedRows::Soft => Stack::plain(&lin.hard),
            RegulatedRows::Literal => residuals.hard.stack(),
        }
    }

    fn curvature_weight(&self, residual: &[f64], i: usize, _task_ld: usize) -> f64 {
        // At dq = 0 the Hessian of J(q) dq is twice that of f.
        residual[i] * (1.0 + 2.0 * self.gamma)
    }
}

/// `e + γ (J dq − ẋΔt)`.
fn regulate_residual(rows: &Rows, gamma: f64, dq: &[f64], dt_s: f64, out: &mut Block) {
    out.rows = rows.rows();
    rows.multiply_into(dq, &mut out.motion);
    let terms = rows.error.iter().zip(&out.motion).zip(&rows.rate);
    for (r, ((error, motion), rate)) in out.residual.iter_mut().zip(terms) {
        *r = error + gamma * (motion - rate * dt_s);
    }
}

/// Its derivative `J + γ ∂(J dq)`.
fn regulate_matrix(rows: &Rows, gamma: f64, out: &mut Block) {
    let terms = rows.jacobian.iter().zip(&rows.second);
    for (a, (jacobian, second)) in out.matrix.iter_mut().zip(terms) {
        *a = jacobian + gamma * second;
    }
}
