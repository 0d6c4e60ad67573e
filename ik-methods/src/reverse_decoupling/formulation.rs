//! # Closed form by reverse decoupling, limb by limb
//!
//! Where the root is known, every limb is solved on its own and exactly, from all its branches: no linearisation, no
//! iteration. The yardstick for the speed of a step and for whether a target can be met at all.
//!
//! ## Problem solved
//! ```text
//! f(q) = x    lo ≤ q ⊖ q⁻ ≤ hi
//! ```
//! ## Step
//! 1. The root stands at the target of its pose. If only its orientation is a task, the centre of mass places it: an outer
//!    Newton iteration on its position p (our extension),
//!    `p ← p + D⁻¹ (x_com − com(p))`, `D = 1 + Σ_limbs J_com,limb ∂q_limb/∂p`.
//! 2. Each limb: all solutions of the closed form ([`super::Limb`]); those outside the intervals are dropped, the one whose
//!    largest joint motion from q⁻ is least is taken. Joints that a singularity leaves free stay.
//!
//! With the ends of a limb held, `∂q_limb/∂p` follows from two 3 × 3 systems, as the closed form itself does: written at
//! the point where three axes meet, those three joints move nothing linearly. p is kept in the shells that the knees and
//! elbows can span within their intervals (`shell.rs`, `region.rs`) and off the limits of other joints, so that a centre of
//! mass out of reach is approached as far as the legs go.
//!
//! ## What it needs
//! Every task on the root, on the last body of a limb with a closed form (pose), or of a limb of three joints (position,
//! our extension); the root's orientation among them. Other problems are declined with the task and the reason.
//!
//! ## Known limits
//! Hard or compromised, a task is met exactly or not at all: weights have no effect. A compromised limb that cannot reach
//! stays where it was, `OutOfReach` says what is missing; a hard one stops the whole step. Where every branch of a limb is
//! outside the intervals and the waist cannot give way, the robot moves towards the one that is least outside and the step
//! ends as `OutsideLimits`. Near a singularity joints move as fast as the targets demand.
//!
//! ## Source
//! Ali, Park & Lee, *Closed-form inverse kinematic joint solution for humanoid robots*; see [`super`]. Root, centre of
//! mass, limits and limbs of three joints are ours.

mod balance;
mod plan;
mod rates;
mod region;
mod shell;
mod whole_body;

use crate::registry::{Field, Method, MethodInfo, N_FIELD, Parameters};
use crate::step_qp::stay;
use ik_core::configuration::difference_into;
use ik_core::evaluator::Evaluator;
use ik_core::formulation::{
    Declined, Formulation, Honours, Prepared, Solution, Stepper, Termination, Trust, Use,
};
use ik_core::problem::Problem;
use ik_core::step::ControlStep;
use plan::{Plan, Waist};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use whole_body::{Step, Work};

/// Parameters of [`ReverseDecoupling`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReverseDecouplingParameters {
    /// Most positions of the waist that are tried per control step for the centre of mass.
    pub n: u32,
}

impl Default for ReverseDecouplingParameters {
    fn default() -> Self {
        Self { n: 15 }
    }
}

impl Parameters for ReverseDecouplingParameters {
    const HELP: &'static [Field] = &[N_FIELD];
}

/// The closed form as a formulation.
#[derive(Clone, Debug)]
pub struct ReverseDecoupling {
    parameters: ReverseDecouplingParameters,
}

impl Method for ReverseDecoupling {
    type Parameters = ReverseDecouplingParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "closed-form",
        name: "Closed form by reverse decoupling",
        summary: "every limb exactly, from all its branches; a centre of mass by Newton steps of the waist",
        source: "Ali, Park & Lee, eqs. (2)-(31)",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self { parameters }
    }
}

impl Formulation for ReverseDecoupling {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        let robot = problem.robot();
        let (mut plans, mut notes) = (Vec::new(), Vec::new());
        for phase in problem.phases() {
            let plan = Plan::new(problem, phase)?;
            notes.extend(plan.notes(robot));
            plans.push(plan);
        }
        notes.dedup();
        let iterates = plans.iter().any(|plan| matches!(plan.waist, Waist::Balanced(..)));
        let most_limbs = plans.iter().map(|plan| plan.limbs.len()).max().unwrap_or(0);
        let stepper = ReverseDecouplingStepper {
            problem: Arc::clone(problem),
            plans,
            work: Work::new(robot, most_limbs),
        };
        Ok(Prepared {
            stepper: Box::new(stepper),
            majors: if iterates { self.parameters.n } else { 1 },
            honours: Honours {
                boundary: true,
                // Of several joints that a singularity leaves free one gives way to limits, and the waist by a local search.
                hard_rows: false,
                objective: Use::Ignored,
                allocation_free: true,
                counts: Trust::Metered,
            },
            notes,
        })
    }
}

#[derive(Debug)]
struct ReverseDecouplingStepper {
    problem: Arc<Problem>,
    plans: Vec<Plan>,
    work: Work,
}

impl Stepper for ReverseDecouplingStepper {
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination {
        stay(step, out);
        if !eval.meter.next_major() {
            return Termination::Budget;
        }
        if !step.targets.now().x.iter().all(|x| x.is_finite()) {
            return Termination::Numerical("a target is not finite");
        }
        let plan = &self.plans[step.phase.0];
        if !plan.has_rotations(step.targets.now().x) {
            return Termination::Numerical("an orientation target is no rotation");
        }
        let robot = self.problem.robot();
        let one = Step::new(robot, plan, step);
        let termination = one.solve(&mut self.work, eval);
        let best = &self.work.best;
        // Without a configuration the robot stays, but for what the intervals force.
        if best.merit.missing_m == 0.0 {
            out.q.copy_from_slice(&best.q);
        }
        let first = robot.root();
        for (i, q) in out.q[first.nq()..].iter_mut().enumerate() {
            let v = first.nv() + i;
            let before = step.q_prev[first.nq() + i];
            *q = before + (*q - before).clamp(step.bounds.lo[v], step.bounds.hi[v]);
        }
        difference_into(robot, step.q_prev, &out.q, &mut out.v);
        out.v.iter_mut().for_each(|v| *v /= step.dt_s);
        termination
    }

    fn reset(&mut self) {}
}
