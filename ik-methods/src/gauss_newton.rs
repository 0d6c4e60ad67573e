//! # IK2: damped Gauss–Newton (conjugate gradient)
//!
//! n damped Newton steps per control step, then a separate velocity: the exact position of a reachable target, without
//! any boundary. Right where joint limits and speeds are no concern.
//!
//! ## Problem solved
//! ```text
//! minimise  δᵀ Q δ              subject to  f(q) = x + [δ; 0]
//! minimise  δᵀ Q δ + Δt² q̇ᵀ R q̇  subject to  J(q) q̇ Δt = ẋ Δt + [δ; 0]
//! ```
//! ## Step
//! (S1) Repeat n times, or until the step is below the tolerance: solve IK1's system at the current iterate, R damping
//! the step (not the distance from q⁻); q ← q ⊕ d. (S2) Solve the second problem for q̇.
//!
//! Objectives of the problem are the reference of the regularisation: R pulls the first iteration's step towards p = Δt q̇₀
//! (`secondary.rs`) and Δt q̇ in (S2) likewise. Later iterations are damped as ever and so do not go that way again.
//!
//! ## What it needs
//! Targets x and ẋ.
//!
//! ## Known limits
//! Converges linearly with factor R/(J² + R) per iteration, so it depends on n. Nothing ties q to q⁻: near singular
//! postures joint velocities are huge, and a knee may pass through to the other branch.
//!
//! ## Source
//! Faraji & Ijspeert (2017), (S1) = eq. (4) with the damping of eq. (2), (S2) = eq. (5). The source calls the iteration
//! conjugate gradient and says that each of its iterations "is solved similar to (2)".
//!
//! ## Deviations
//! Deviation: `inner = "cg"` solves each damped system by projected conjugate gradients (Gould, Hribar & Nocedal 2001,
//! alg. 6.2) instead of elimination: same iterates up to rounding, its iterations are counted as minors. Where hard rows
//! are dependent and it cannot meet them, the major is solved by elimination after all.

use crate::error_integration::{DAMPING_FIELD, damped_step};
use crate::projected_cg::ProjectedCg;
use crate::qp::{Outcome, QpStatus};
use crate::registry::{Allowed, Field, Method, MethodInfo, N_FIELD, Parameters};
use crate::secondary::Secondary;
use crate::step_qp::{Stack, StepQp, conclude, stay};
use ik_core::configuration::integrate_into;
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::{
    Declined, Formulation, Honours, Prepared, Solution, Stepper, Termination, Trust, Use,
};
use ik_core::problem::Problem;
use ik_core::step::ControlStep;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How each damped system is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Inner {
    /// Elimination.
    #[default]
    Direct,
    /// Projected conjugate gradients.
    Cg,
}

/// Parameters of [`GaussNewton`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaussNewtonParameters {
    /// Most iterations.
    pub n: u32,
    /// R as a multiple of the identity, root included.
    pub damping: f64,
    /// How each damped system is solved.
    pub inner: Inner,
    /// A step whose largest component is below this ends the iteration (rad, m).
    pub step_tolerance: f64,
}

impl Default for GaussNewtonParameters {
    fn default() -> Self {
        Self {
            n: 15,
            damping: 1e-2,
            inner: Inner::Direct,
            step_tolerance: 1e-9,
        }
    }
}

/// Hard rows that conjugate gradients leave by less than this (m, rad) are met: rounding of rows of size 1.
const MET: f64 = 1e-12;

/// The help of the step tolerance, which the iterating methods share.
pub(crate) const STEP_TOLERANCE_FIELD: Field = Field {
    key: "step_tolerance",
    unit: "rad, m",
    meaning: "a step whose largest component is below this ends the iteration",
    allowed: Allowed::Number {
        least: 1e-15,
        largest: 1.0,
    },
};

impl Parameters for GaussNewtonParameters {
    const HELP: &'static [Field] = &[
        N_FIELD,
        DAMPING_FIELD,
        Field {
            key: "inner",
            unit: "-",
            meaning: "solution of each damped system: elimination or projected conjugate gradients",
            allowed: Allowed::Words(&["direct", "cg"]),
        },
        STEP_TOLERANCE_FIELD,
    ];
}

/// IK2.
#[derive(Clone, Debug)]
pub struct GaussNewton {
    parameters: GaussNewtonParameters,
}

impl Method for GaussNewton {
    type Parameters = GaussNewtonParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "ik2",
        name: "IK2 Gauss-Newton",
        summary: "n damped Gauss-Newton iterations on the positions, then a separate velocity; no boundary",
        source: "Faraji & Ijspeert (2017), eqs. (4), (5)",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self { parameters }
    }
}

impl Formulation for GaussNewton {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        let stepper = GaussNewtonStepper {
            problem: Arc::clone(problem),
            parameters: self.parameters.clone(),
            lin: Linearisation::new(problem),
            qp: StepQp::new(problem),
            secondary: Secondary::new(problem),
            cg: ProjectedCg::new(
                problem.robot().nv(),
                problem.largest_hard_rows(),
                problem.largest_soft_rows(),
            ),
            q: vec![0.0; problem.robot().nq()],
            rate: vec![
                0.0;
                problem
                    .largest_hard_rows()
                    .max(problem.largest_soft_rows())
                    .next_multiple_of(4)
            ],
        };
        let honours = Honours {
            boundary: false,
            hard_rows: true,
            objective: Use::Regularised,
            allocation_free: true,
            counts: Trust::Metered,
        };
        Ok(Prepared {
            stepper: Box::new(stepper),
            majors: self.parameters.n,
            honours,
            notes: vec![],
        })
    }
}

#[derive(Debug)]
struct GaussNewtonStepper {
    problem: Arc<Problem>,
    parameters: GaussNewtonParameters,
    lin: Linearisation,
    qp: StepQp,
    secondary: Secondary,
    cg: ProjectedCg,
    q: Vec<f64>,
    /// −ẋ Δt of the rows.
    rate: Vec<f64>,
}

impl Stepper for GaussNewtonStepper {
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination {
        stay(step, out);
        self.qp.reset();
        self.qp.free();
        self.q.copy_from_slice(step.q_prev);
        let mut outcome = Outcome::Solved;
        let mut ended = Termination::Budget;
        let mut iteration = 0;
        while eval.meter.next_major() {
            outcome = self.increment(step, iteration, eval);
            iteration += 1;
            if matches!(outcome, Outcome::Failed(_)) {
                return conclude(outcome, ended, step, out);
            }
            let d = &self.qp.solution.x;
            integrate_into(self.problem.robot(), &self.q, d, &mut out.q);
            self.q.copy_from_slice(&out.q);
            if largest(d) < self.parameters.step_tolerance {
                ended = Termination::Converged;
                break;
            }
        }
        if eval.meter.counts().majors > 0 {
            self.velocity(step, eval, out);
        }
        conclude(outcome, ended, step, out)
    }

    fn reset(&mut self) {
        self.qp.reset();
    }
}

impl GaussNewtonStepper {
    fn increment(&mut self, step: &ControlStep<'_>, iteration: u32, eval: &mut Evaluator) -> Outcome {
        let damping = self.parameters.damping;
        eval.linearise(&self.q, step.phase, step.targets.now(), &mut self.lin);
        if iteration == 0 {
            self.secondary.evaluate(eval, (&self.q, &self.lin.page), step);
        }
        let pull = self.secondary.increment().filter(|_| iteration == 0);
        match self.parameters.inner {
            Inner::Direct => damped_step(&mut self.qp, &self.lin, damping, pull, eval),
            Inner::Cg => {
                let x = &mut self.qp.solution.x;
                let Some(iterations) = self.cg.solve(&self.lin, damping, pull, x) else {
                    return Outcome::Failed(QpStatus::Numerical);
                };
                eval.meter.minors(iterations);
                if self.cg.violation(&self.lin, &self.qp.solution.x) <= MET {
                    return Outcome::Solved;
                }
                // Dependent or contradicting rows: elimination decides which, and reports it.
                damped_step(&mut self.qp, &self.lin, damping, pull, eval)
            }
        }
    }

    /// Eq. (5) at the final configuration; leaves `out.v` at Δq/Δt = 0 if it cannot be solved.
    fn velocity(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) {
        eval.linearise(&self.q, step.phase, step.targets.now(), &mut self.lin);
        let lin = &self.lin;
        self.qp.start(self.parameters.damping);
        if let Some(pull) = self.secondary.increment() {
            self.qp.centre(self.parameters.damping, pull);
        }
        scaled(&lin.soft.rate, -step.dt_s, &mut self.rate);
        let (ld, residual) = (lin.soft.ld(), &self.rate[..lin.soft.ld().min(self.rate.len())]);
        self.qp.add(Stack {
            matrix: &lin.soft.jacobian,
            ld,
            residual,
        });
        scaled(&lin.hard.rate, -step.dt_s, &mut self.rate);
        let hard = Stack {
            matrix: &lin.hard.jacobian,
            ld: lin.hard.ld(),
            residual: &self.rate,
        };
        // The evaluator's minors of this solve belong to the step like any other.
        if !matches!(self.qp.solve(hard, lin.hard.rows(), eval), Outcome::Failed(_)) {
            for (v, d) in out.v.iter_mut().zip(&self.qp.solution.x) {
                *v = d / step.dt_s;
            }
        }
    }
}

fn scaled(from: &[f64], s: f64, to: &mut [f64]) {
    to.fill(0.0);
    to.iter_mut().zip(from).for_each(|(t, f)| *t = s * f);
}

/// Largest absolute component.
pub(crate) fn largest(d: &[f64]) -> f64 {
    d.iter().fold(0.0, |m, x| x.abs().max(m))
}
