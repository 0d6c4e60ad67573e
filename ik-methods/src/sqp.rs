//! Sequential quadratic programming on positions, which IK4 and IK5 share.
//!
//! ```text
//! minimise ½ ‖r(q)‖²    subject to  c(q) = 0,   lo ≤ q ⊖ q⁻ ≤ hi
//! ```
//!
//! Each major linearises residuals r and hard rows c exactly (second-order kinematics included), takes the Gauss–Newton
//! Hessian plus a proximal weight μ around the iterate (which vanishes at the solution), solves the quadratic program and
//! searches along its step on the L1 merit ½‖r‖² + ρ‖c‖₁ (on ‖c‖₂ where the hard rows had to be relaxed). It stops when the step is below the tolerance; the gradient of
//! the Lagrangian is then below (‖A‖² + μ) times the tolerance, so step size and KKT residual end together. It never stops
//! on a small decrease: leaving a straight knee gains only 1e-9 m² at first (notes §3).
//!
//! Objectives of the problem give μ a reference that stays: the weight is then not around the iterate but a term
//! `½ μ ‖q ⊖ q⁻ − p‖²` of the problem, p = Δt q̇₀ (`secondary.rs`). Hard rows are not disturbed, soft ones
//! by as much as μ weighs.

use crate::gauss_newton::largest;
use crate::qp::{Outcome, QpStatus};
use crate::secondary::Secondary;
use crate::start::{Escape, StartParameters};
use crate::step_qp::{Stack, StepQp, conclude, finish, stay};
use ik_core::configuration::{difference_into, integrate_into};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::{Solution, Termination};
use ik_core::problem::Problem;
use ik_core::step::{ControlStep, Sample};
use std::sync::Arc;

/// ρ is this many times the largest multiplier: just above 1, since a penalty far beyond the multipliers rejects good
/// steps near small objectives (notes §5, Maratos effect).
const PENALTY_FACTOR: f64 = 1.5;

/// Fraction of the predicted decrease a step must bring (Armijo).
const SUFFICIENT: f64 = 1e-4;

/// Most halvings of a step.
const HALVINGS: u32 = 8;

/// Merit changes below this fraction of the merit's size are rounding.
const ROUNDING: f64 = 1e-14;

/// What makes r and c out of a linearisation: the formulation's equations.
pub(crate) trait Model: Send + std::fmt::Debug {
    /// Soft rows, at most, for this many task rows.
    fn soft_rows(rows: usize) -> usize
    where
        Self: Sized;

    /// Writes r and c at an iterate `dq` from q⁻. The Jacobian of the hard rows of `lin` is not filled yet.
    fn residuals(
        &self,
        eval: &Evaluator,
        lin: &mut Linearisation,
        target: Sample<'_>,
        dq: &[f64],
        dt_s: f64,
        out: &mut Residuals,
    );

    /// Writes their exact Jacobians there, filling what of `lin` they are made of.
    fn derivatives(
        &self,
        eval: &Evaluator,
        lin: &mut Linearisation,
        target: Sample<'_>,
        dq: &[f64],
        out: &mut Residuals,
    );

    /// c with its Jacobian: the hard rows of `lin` as they are, or what was made of them in `residuals`.
    fn hard<'a>(&self, lin: &'a Linearisation, residuals: &'a Residuals) -> Stack<'a>;

    /// Weight of the Hessian of soft task row `i` in the Hessian of ½‖r‖² at dq = 0, where the rows have the value
    /// `residual` (`task_ld` is the padded number of task rows).
    fn curvature_weight(&self, residual: &[f64], i: usize, task_ld: usize) -> f64;
}

/// r, c and their Jacobians; column-major, padded.
#[derive(Clone, Debug)]
pub(crate) struct Residuals {
    pub(crate) soft: Block,
    pub(crate) hard: Block,
}

/// Rows of one kind.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(crate) matrix: Vec<f64>,
    pub(crate) residual: Vec<f64>,
    /// `J dq` scratch.
    pub(crate) motion: Vec<f64>,
    pub(crate) ld: usize,
    pub(crate) rows: usize,
}

impl Block {
    pub(crate) fn new(rows: usize, cols: usize) -> Self {
        let ld = rows.next_multiple_of(4).max(4);
        Self {
            matrix: vec![0.0; ld * cols],
            residual: vec![0.0; ld],
            motion: vec![0.0; ld],
            ld,
            rows,
        }
    }

    pub(crate) fn stack(&self) -> Stack<'_> {
        Stack {
            matrix: &self.matrix,
            ld: self.ld,
            residual: &self.residual,
        }
    }
}

/// Parameters of the iteration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SqpParameters {
    pub(crate) proximal: f64,
    pub(crate) step_tolerance: f64,
    pub(crate) start: StartParameters,
}

/// The iteration and its memory.
#[derive(Debug)]
pub(crate) struct Sqp<M> {
    problem: Arc<Problem>,
    model: M,
    parameters: SqpParameters,
    qp: StepQp,
    escape: Escape,
    secondary: Secondary,
    now: Point,
    trial: Point,
    /// Hard rows at the end of a program's step.
    predicted: Vec<f64>,
}

/// An iterate with everything evaluated there.
#[derive(Clone, Debug)]
struct Point {
    q: Vec<f64>,
    dq: Vec<f64>,
    lin: Linearisation,
    residuals: Residuals,
    /// ½‖r‖², and the pull of objectives.
    half_squares: f64,
}

impl<M: Model> Sqp<M> {
    pub(crate) fn new(problem: &Arc<Problem>, model: M, parameters: SqpParameters) -> Self {
        let (nq, nv) = (problem.robot().nq(), problem.robot().nv());
        let hard = Block::new(problem.largest_hard_rows(), nv);
        let predicted = hard.residual.clone();
        let point = Point {
            q: vec![0.0; nq],
            dq: vec![0.0; nv],
            lin: Linearisation::new(problem),
            residuals: Residuals {
                soft: Block::new(M::soft_rows(problem.largest_soft_rows()), nv),
                hard,
            },
            half_squares: 0.0,
        };
        Self {
            problem: Arc::clone(problem),
            model,
            parameters,
            qp: StepQp::new(problem),
            escape: Escape::new(
                problem,
                parameters.start,
                M::soft_rows(problem.largest_soft_rows()),
            ),
            secondary: Secondary::new(problem),
            now: point.clone(),
            trial: point,
            predicted,
        }
    }

    pub(crate) fn reset(&mut self) {
        self.qp.reset();
    }

    pub(crate) fn step(
        &mut self,
        step: &ControlStep<'_>,
        eval: &mut Evaluator,
        out: &mut Solution,
    ) -> Termination {
        stay(step, out);
        if eval.meter.majors_left() == 0 {
            return Termination::Budget;
        }
        self.qp.reset();
        self.escape.start(&self.model, step, eval, &mut self.now.dq);
        integrate_into(self.problem.robot(), step.q_prev, &self.now.dq, &mut self.now.q);
        self.evaluate(step, eval, Which::Now);
        self.pull(step, eval);
        let (ended, outcome) = self.iterate(step, eval, out);
        finish(&self.problem, step, &mut self.now.dq, out);
        conclude(outcome, ended, step, out)
    }

    fn iterate(
        &mut self,
        step: &ControlStep<'_>,
        eval: &mut Evaluator,
        out: &mut Solution,
    ) -> (Termination, Outcome) {
        let mut outcome = Outcome::Solved;
        while eval.meter.next_major() {
            outcome = self.solve_qp(step, eval);
            if matches!(outcome, Outcome::Failed(_)) {
                break;
            }
            if !self.now.half_squares.is_finite() {
                return (Termination::Budget, Outcome::Failed(QpStatus::Numerical));
            }
            if largest(&self.qp.solution.x) < self.parameters.step_tolerance {
                if outcome == Outcome::Solved {
                    self.claim(out);
                }
                let outcome = self.remaining(outcome);
                self.move_trial(step);
                std::mem::swap(&mut self.now, &mut self.trial);
                return (Termination::Converged, outcome);
            }
            self.line_search(outcome, step, eval);
        }
        (Termination::Budget, self.remaining(outcome))
    }

    /// A relaxed outcome with what is left of the hard rows at the iterate, not what its program promised.
    fn remaining(&self, outcome: Outcome) -> Outcome {
        match outcome {
            Outcome::Relaxed { .. } => {
                let rows = self.model.hard(&self.now.lin, &self.now.residuals);
                Outcome::Relaxed {
                    residual: two_norm(rows.residual),
                }
            }
            other => other,
        }
    }

    fn solve_qp(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator) -> Outcome {
        let now = &mut self.now;
        self.model.derivatives(
            eval,
            &mut now.lin,
            step.targets.now(),
            &now.dq,
            &mut now.residuals,
        );
        self.qp.start(self.parameters.proximal);
        if let Some(pull) = self.secondary.increment() {
            self.qp.centre(self.parameters.proximal, pull);
            self.qp.centre(-self.parameters.proximal, &now.dq);
        }
        self.qp.add(now.residuals.soft.stack());
        self.qp.bound(&step.bounds, &now.dq);
        let hard = self.model.hard(&now.lin, &now.residuals);
        self.qp.solve(hard, now.lin.hard.rows(), eval)
    }

    /// Moves to the first of 1, ½, ¼ … of the step that brings enough; the last one is taken as it is, since standing
    /// still would only repeat the same program.
    fn line_search(&mut self, outcome: Outcome, step: &ControlStep<'_>, eval: &mut Evaluator) {
        self.predict_hard_rows();
        let merit = match outcome {
            // Rows that do not fit come first, in the norm in which the program fitted them.
            Outcome::Relaxed { .. } => Merit::HardRows,
            _ => Merit::Exact {
                rho: PENALTY_FACTOR * largest(&self.qp.solution.y),
            },
        };
        let hard = self.model.hard(&self.now.lin, &self.now.residuals).residual;
        let slope = match merit {
            Merit::HardRows => two_norm(&self.predicted) - two_norm(hard),
            Merit::Exact { rho } => {
                dot(&self.qp.gradient, &self.qp.solution.x)
                    + rho * (one_norm(&self.predicted) - one_norm(hard))
            }
        };
        let start = self.merit(merit, Which::Now);
        let mut t = 1.0;
        for halving in 0..=HALVINGS {
            self.move_trial(step);
            self.evaluate(step, eval, Which::Trial);
            self.trial.half_squares += self.pulled(&self.trial.dq);
            let enough = start + SUFFICIENT * t * slope.min(0.0) + ROUNDING * start;
            if self.merit(merit, Which::Trial) <= enough || halving == HALVINGS {
                break;
            }
            t *= 0.5;
            self.qp.solution.x.iter_mut().for_each(|d| *d *= 0.5);
        }
        std::mem::swap(&mut self.now, &mut self.trial);
    }

    fn merit(&self, merit: Merit, which: Which) -> f64 {
        let point = match which {
            Which::Now => &self.now,
            Which::Trial => &self.trial,
        };
        let hard = self.model.hard(&point.lin, &point.residuals).residual;
        match merit {
            Merit::HardRows => two_norm(hard),
            Merit::Exact { rho } => point.half_squares + rho * one_norm(hard),
        }
    }

    /// Writes c + A d at the end of the program's step.
    fn predict_hard_rows(&mut self) {
        let hard = self.model.hard(&self.now.lin, &self.now.residuals);
        predict(hard, &self.qp.solution.x, &mut self.predicted);
    }

    /// Puts the trial point one program step away from the iterate.
    fn move_trial(&mut self, step: &ControlStep<'_>) {
        let robot = self.problem.robot();
        integrate_into(robot, &self.now.q, &self.qp.solution.x, &mut self.trial.q);
        difference_into(robot, step.q_prev, &self.trial.q, &mut self.trial.dq);
    }

    fn evaluate(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, which: Which) {
        let point = match which {
            Which::Now => &mut self.now,
            Which::Trial => &mut self.trial,
        };
        let target = step.targets.now();
        eval.residual(&point.q, step.phase, target, &mut point.lin);
        let (lin, residuals) = (&mut point.lin, &mut point.residuals);
        self.model
            .residuals(eval, lin, target, &point.dq, step.dt_s, residuals);
        point.half_squares = 0.5 * point.residuals.soft.residual.iter().map(|r| r * r).sum::<f64>();
    }

    /// Evaluates p at q⁻, which needs a tree pass of its own only if the iteration starts elsewhere.
    fn pull(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator) {
        let mut page = &self.now.lin.page;
        if Secondary::wanted(step) && self.now.dq.iter().any(|d| *d != 0.0) {
            eval.pass(step.q_prev, &mut self.trial.lin.page);
            page = &self.trial.lin.page;
        }
        self.secondary.evaluate(eval, (step.q_prev, page), step);
        self.now.half_squares += self.pulled(&self.now.dq);
    }

    /// `½ μ ‖dq − p‖²` of an iterate `dq` from q⁻; zero without objectives.
    fn pulled(&self, dq: &[f64]) -> f64 {
        let Some(pull) = self.secondary.increment() else {
            return 0.0;
        };
        let squares = dq.iter().zip(pull).map(|(d, p)| (d - p) * (d - p));
        0.5 * self.parameters.proximal * squares.sum::<f64>()
    }

    /// Multipliers of the last program, with everything but the plain task rows as the method's own gradient.
    fn claim(&mut self, out: &mut Solution) {
        let (lin, residuals) = (&self.now.lin, &self.now.residuals);
        let (hard, m) = (self.model.hard(lin, residuals), lin.hard.rows());
        let claim = &mut out.claim;
        claim.has = true;
        claim.hard.fill(0.0);
        claim.hard[..m].copy_from_slice(&self.qp.solution.y[..m]);
        claim.bound.copy_from_slice(&self.qp.solution.z);
        claim.own.copy_from_slice(&self.qp.gradient);
        lin.soft.add_transposed(&lin.soft.error, -1.0, &mut claim.own);
        let rows = lin
            .hard
            .jacobian
            .chunks_exact(lin.hard.ld())
            .zip(hard.matrix.chunks_exact(hard.ld));
        for (own, (plain, full)) in claim.own.iter_mut().zip(rows) {
            let difference = full.iter().zip(plain).zip(&self.qp.solution.y[..m]);
            *own -= difference.map(|((f, p), y)| (f - p) * y).sum::<f64>();
        }
    }
}

#[derive(Clone, Copy)]
enum Which {
    Now,
    Trial,
}

/// Writes `r + A d` into `out` (length ld).
pub(crate) fn predict(stack: Stack<'_>, d: &[f64], out: &mut [f64]) {
    out.copy_from_slice(stack.residual);
    for (column, d) in stack.matrix.chunks_exact(stack.ld).zip(d) {
        out.iter_mut().zip(column).for_each(|(o, c)| *o += c * d);
    }
}

/// What the line search decreases.
#[derive(Clone, Copy)]
enum Merit {
    /// ½‖r‖² + ρ‖c‖₁.
    Exact { rho: f64 },
    /// ‖c‖₂.
    HardRows,
}

fn two_norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

fn one_norm(v: &[f64]) -> f64 {
    v.iter().map(|v| v.abs()).sum()
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
