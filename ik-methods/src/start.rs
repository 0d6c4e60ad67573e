//! Where a position iteration starts, and how it escapes an exactly singular posture.
//!
//! A straight knee on its limit is a stationary point of everything a Gauss–Newton step can see: the derivative of leg
//! length with respect to the knee vanishes there although bending would help (notes §3). The starts only choose the first
//! iterate; q⁻ in the equations is untouched.
//!
//! * `plain`: q⁻ itself.
//! * `kick`: every joint closer than the kick distance to one of its limits is put that far inside, as far as its interval
//!   allows. If staying is optimal the iteration returns to the limit, but only linearly (the residual is quadratic in the
//!   angle there): a robot that stands exactly straight at rest creeps to a knee of 4e-4 rad with n = 15 and spends every
//!   budget.
//! * `curvature`: the same displacement along a direction that keeps the hard rows to first order, and only if the exact
//!   second-order model of the problem (multipliers of the first program, Hessians of all rows) says that it pays. The
//!   test costs one major where a joint is near a limit.
//!
//! Empirical: on `coman/asymmetric` IK4 does equally well with `kick` and `curvature`; IK5 with n = 15 survives 6 of 6
//! slow scenarios with `kick` and loses one with `curvature`, so `kick` is the default of both. `plain` loses them
//! (`ik-bench run coman/asymmetric --method ik4,ik5 --set start=curvature`).

use crate::sqp::{Block, Model, Residuals, dot, predict};
use crate::step_qp::{Stack, StepQp};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::problem::Problem;
use ik_core::step::ControlStep;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How the first iterate is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// q⁻.
    Plain,
    /// Joints near a limit start inside it.
    Kick,
    /// Joints near a limit start inside it where negative curvature makes that pay.
    Curvature,
}

/// The words of [`Start`], for parameter help.
pub(crate) const START_WORDS: &[&str] = &["plain", "kick", "curvature"];

/// Parameters of the start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StartParameters {
    pub(crate) start: Start,
    /// Distance from a limit (rad or m).
    pub(crate) kick: f64,
}

/// Most joints near a limit that are looked at one by one; more are only moved together.
const MOST_CANDIDATES: usize = 8;

/// Proximal weight of the direction's program: only makes its solution unique.
const DIRECTION_WEIGHT: f64 = 1e-6;

/// Chooses first iterates; the scratch of the curvature test.
#[derive(Debug)]
pub(crate) struct Escape {
    problem: Arc<Problem>,
    parameters: StartParameters,
    candidates: Vec<Candidate>,
    scratch: Option<Box<Scratch>>,
}

/// A joint near a limit, with the displacement it is allowed.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    v: usize,
    /// Signed displacement into the range.
    move_by: f64,
}

#[derive(Debug)]
struct Scratch {
    lin: Linearisation,
    residuals: Residuals,
    /// As long as any stack of rows.
    zeros: Vec<f64>,
    qp: StepQp,
    multipliers: Vec<f64>,
    bound_multipliers: Vec<f64>,
    direction: Vec<f64>,
    best: Vec<f64>,
}

impl Escape {
    /// For a model that makes at most `soft_rows` soft rows.
    pub(crate) fn new(problem: &Arc<Problem>, parameters: StartParameters, soft_rows: usize) -> Self {
        let nv = problem.robot().nv();
        let scratch = (parameters.start == Start::Curvature).then(|| {
            Box::new(Scratch {
                lin: Linearisation::new(problem),
                zeros: vec![
                    0.0;
                    soft_rows
                        .max(problem.largest_hard_rows())
                        .next_multiple_of(4)
                        .max(4)
                ],
                residuals: Residuals {
                    soft: Block::new(soft_rows, nv),
                    hard: Block::new(problem.largest_hard_rows(), nv),
                },
                qp: StepQp::new(problem),
                multipliers: vec![0.0; problem.largest_hard_rows()],
                bound_multipliers: vec![0.0; nv],
                direction: vec![0.0; nv],
                best: vec![0.0; nv],
            })
        });
        Self {
            problem: Arc::clone(problem),
            parameters,
            candidates: Vec::with_capacity(nv),
            scratch,
        }
    }

    /// Writes the first iterate as its distance `dq` from q⁻, inside the intervals of the step.
    pub(crate) fn start(
        &mut self,
        model: &impl Model,
        step: &ControlStep<'_>,
        eval: &mut Evaluator,
        dq: &mut [f64],
    ) {
        dq.fill(0.0);
        if self.parameters.start != Start::Plain {
            self.find_candidates(step);
        }
        if !self.candidates.is_empty() {
            match &mut self.scratch {
                None => self.candidates.iter().for_each(|c| dq[c.v] = c.move_by),
                Some(scratch) => scratch.best_escape(&self.candidates, model, step, eval, dq),
            }
        }
        for ((d, lo), hi) in dq.iter_mut().zip(step.bounds.lo).zip(step.bounds.hi) {
            *d = d.max(*lo).min(*hi);
        }
    }

    fn find_candidates(&mut self, step: &ControlStep<'_>) {
        let robot = self.problem.robot();
        let (nq, nv) = (robot.root().nq(), robot.root().nv());
        let kick = self.parameters.kick;
        self.candidates.clear();
        for (j, coordinate) in robot.coordinates().iter().enumerate() {
            let (q, v) = (step.q_prev[nq + j], nv + j);
            let (below, above) = (q - coordinate.limits.lower, coordinate.limits.upper - q);
            let move_by = if below < kick {
                (kick - below).min(step.bounds.hi[v])
            } else if above < kick {
                (above - kick).max(step.bounds.lo[v])
            } else {
                0.0
            };
            if move_by != 0.0 {
                self.candidates.push(Candidate { v, move_by });
            }
        }
    }
}

impl Scratch {
    /// Tries every candidate alone and all together; writes the displacement that promises most, if any does.
    fn best_escape(
        &mut self,
        candidates: &[Candidate],
        model: &impl Model,
        step: &ControlStep<'_>,
        eval: &mut Evaluator,
        dq: &mut [f64],
    ) {
        if !eval.meter.next_major() {
            return;
        }
        self.first_program(model, step, eval, dq);
        let alone = if candidates.len() <= MOST_CANDIDATES {
            candidates.len()
        } else {
            0
        };
        let mut best = 0.0;
        for choice in 0..=alone {
            let moves = |i: usize| choice == alone || i == choice;
            if choice == alone && candidates.len() == 1 && alone == 1 {
                break;
            }
            let change = self.predicted_change(candidates, moves, model, step, eval);
            if change < best {
                best = change;
                self.best.copy_from_slice(&self.direction);
            }
        }
        if best < 0.0 {
            dq.copy_from_slice(&self.best);
        }
    }

    /// Residuals at q⁻ and the multipliers of the plain start's first program.
    fn first_program(
        &mut self,
        model: &impl Model,
        step: &ControlStep<'_>,
        eval: &mut Evaluator,
        zero: &[f64],
    ) {
        let target = step.targets.now();
        let (lin, residuals) = (&mut self.lin, &mut self.residuals);
        eval.residual(step.q_prev, step.phase, target, lin);
        model.residuals(eval, lin, target, zero, step.dt_s, residuals);
        model.derivatives(eval, lin, target, zero, residuals);
        self.qp.reset();
        self.qp.start(DIRECTION_WEIGHT);
        self.qp.add(self.residuals.soft.stack());
        self.qp.bound(&step.bounds, zero);
        let m = self.lin.hard.rows();
        self.qp.solve(model.hard(&self.lin, &self.residuals), m, eval);
        self.multipliers[..m].copy_from_slice(&self.qp.solution.y[..m]);
        self.bound_multipliers.copy_from_slice(&self.qp.solution.z);
        // Multipliers belong to the residuals that the program leaves, not to those it starts from.
        let soft = &mut self.residuals.soft;
        let mut predicted = std::mem::take(&mut soft.motion);
        predict(soft.stack(), &self.qp.solution.x, &mut predicted);
        soft.motion = predicted;
    }

    /// Change of the Lagrangian, to second order, when the chosen candidates move and the others stay; the displacement is
    /// left in `self.direction`.
    fn predicted_change(
        &mut self,
        candidates: &[Candidate],
        moves: impl Fn(usize) -> bool,
        model: &impl Model,
        step: &ControlStep<'_>,
        eval: &mut Evaluator,
    ) -> f64 {
        // The cheapest motion that keeps the hard rows and moves the candidates as told.
        self.qp.reset();
        self.qp.start(DIRECTION_WEIGHT);
        let soft = &self.residuals.soft;
        self.qp.add(Stack {
            residual: &self.zeros[..soft.ld],
            ..soft.stack()
        });
        self.qp.free();
        for (i, c) in candidates.iter().enumerate() {
            let by = if moves(i) { c.move_by } else { 0.0 };
            (self.qp.lo[c.v], self.qp.hi[c.v]) = (by, by);
        }
        let hard = model.hard(&self.lin, &self.residuals);
        let still = Stack {
            residual: &self.zeros[..hard.ld],
            ..hard
        };
        if self.qp.solve(still, self.lin.hard.rows(), eval) != crate::qp::Outcome::Solved {
            return 0.0;
        }
        self.direction.copy_from_slice(&self.qp.solution.x);
        let p = &self.direction;
        eval.hessian_product(&mut self.lin, step.targets.now(), p);
        let mut bending = 0.0;
        let (soft, hard) = (&self.lin.soft, &self.lin.hard);
        for (v, p) in p.iter().enumerate() {
            let column = &soft.second[v * soft.ld()..][..soft.rows()];
            for (i, h) in column.iter().enumerate() {
                bending += p * h * model.curvature_weight(&self.residuals.soft.motion, i, soft.ld());
            }
            let column = &hard.second[v * hard.ld()..][..hard.rows()];
            bending -= p * dot(column, &self.multipliers);
        }
        let stack = &self.residuals.soft;
        let mut stretch = 0.0;
        for i in 0..stack.rows {
            let row: f64 = p
                .iter()
                .enumerate()
                .map(|(v, p)| p * stack.matrix[v * stack.ld + i])
                .sum();
            stretch += row * row;
        }
        dot(&self.bound_multipliers, p) + 0.5 * (bending + stretch)
    }
}
