//! A formulation as a newcomer would add it: this file, plus a `mod` line, a registry line and a changelog line.
//!
//! # Jacobian transpose
//! The oldest iteration there is: move every joint along the gradient of the task error. Kept here, not in the registry,
//! as the proof that one file is enough (CONTRIBUTING.md walks through it).
//!
//! ## Problem solved
//! ```text
//! minimise ½ ‖e_s(q)‖² + ½ ‖e_h(q)‖²
//! ```
//! ## Step
//! (S1) g = J_sᵀ e_s + J_hᵀ e_h. (S2) d = −α g with α = ‖g‖² / ‖J g‖², the exact minimiser along g of the linearised
//! cost. (S3) clip d into the boundary.
//!
//! ## What it needs
//! Targets x.
//! ## Known limits
//! Linear convergence; hard rows are treated like compromised ones.
//! ## Source
//! Wolovich & Elliott (1984), A computational technique for inverse kinematics, CDC.
//! ## Deviations
//! Deviation: the step length is exact for the linearised cost instead of a fixed gain.

use ik_core::configuration::{difference_into, integrate_into};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::{
    Declined, Formulation, Honours, Prepared, Solution, Stepper, Termination, Trust, Use,
};
use ik_core::problem::Problem;
use ik_core::step::ControlStep;
use ik_methods::registry::{Allowed, Field, Method, MethodInfo, Parameters};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct JacobianTransposeParameters {
    n: u32,
    step_tolerance: f64,
}

impl Default for JacobianTransposeParameters {
    fn default() -> Self {
        Self {
            n: 15,
            step_tolerance: 1e-9,
        }
    }
}

impl Parameters for JacobianTransposeParameters {
    const HELP: &'static [Field] = &[
        Field {
            key: "n",
            unit: "-",
            meaning: "most major iterations per control step",
            allowed: Allowed::Whole {
                least: 1,
                largest: 10_000,
            },
        },
        Field {
            key: "step_tolerance",
            unit: "rad, m",
            meaning: "a step whose largest component is below this ends the iteration",
            allowed: Allowed::Number {
                least: 1e-15,
                largest: 1.0,
            },
        },
    ];
}

#[derive(Clone, Debug)]
pub(crate) struct JacobianTranspose(JacobianTransposeParameters);

impl Method for JacobianTranspose {
    type Parameters = JacobianTransposeParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "jacobian-transpose",
        name: "Jacobian transpose",
        summary: "gradient descent on the task error",
        source: "Wolovich & Elliott (1984)",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self(parameters)
    }
}

impl Formulation for JacobianTranspose {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        let (nq, nv) = (problem.robot().nq(), problem.robot().nv());
        let rows = problem
            .largest_hard_rows()
            .max(problem.largest_soft_rows())
            .next_multiple_of(4)
            .max(4);
        let stepper = JacobianTransposeStepper {
            problem: Arc::clone(problem),
            step_tolerance: self.0.step_tolerance,
            lin: Linearisation::new(problem),
            gradient: vec![0.0; nv],
            image: vec![0.0; rows],
            q: vec![0.0; nq],
            dq: vec![0.0; nv],
        };
        let honours = Honours {
            boundary: true,
            hard_rows: false,
            objective: Use::Ignored,
            allocation_free: true,
            counts: Trust::Metered,
        };
        Ok(Prepared {
            stepper: Box::new(stepper),
            majors: self.0.n,
            honours,
            notes: vec![],
        })
    }
}

#[derive(Debug)]
struct JacobianTransposeStepper {
    problem: Arc<Problem>,
    step_tolerance: f64,
    lin: Linearisation,
    gradient: Vec<f64>,
    image: Vec<f64>,
    q: Vec<f64>,
    dq: Vec<f64>,
}

impl Stepper for JacobianTransposeStepper {
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination {
        let robot = self.problem.robot();
        self.q.copy_from_slice(step.q_prev);
        self.dq.fill(0.0);
        let mut ended = Termination::Budget;
        while eval.meter.next_major() {
            eval.linearise(&self.q, step.phase, step.targets.now(), &mut self.lin);
            let (soft, hard) = (&self.lin.soft, &self.lin.hard);
            // (S1)
            self.gradient.fill(0.0);
            soft.add_transposed(&soft.error, 1.0, &mut self.gradient);
            hard.add_transposed(&hard.error, 1.0, &mut self.gradient);
            // (S2)
            let squares = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
            let mut stretch = 0.0;
            for rows in [soft, hard] {
                rows.multiply_into(&self.gradient, &mut self.image);
                stretch += squares(&self.image[..rows.rows()]);
            }
            let slope = squares(&self.gradient);
            let alpha = if stretch > 0.0 { slope / stretch } else { 0.0 };
            self.gradient.iter_mut().for_each(|g| *g *= -alpha);
            integrate_into(robot, &self.q, &self.gradient, &mut out.q);
            // (S3)
            difference_into(robot, step.q_prev, &out.q, &mut self.dq);
            for ((d, lo), hi) in self.dq.iter_mut().zip(step.bounds.lo).zip(step.bounds.hi) {
                *d = d.clamp(*lo, *hi);
            }
            integrate_into(robot, step.q_prev, &self.dq, &mut self.q);
            if self.gradient.iter().all(|g| g.abs() < self.step_tolerance) {
                ended = Termination::Converged;
                break;
            }
        }
        out.q.copy_from_slice(&self.q);
        out.v
            .iter_mut()
            .zip(&self.dq)
            .for_each(|(v, d)| *v = d / step.dt_s);
        ended
    }

    fn reset(&mut self) {}
}
