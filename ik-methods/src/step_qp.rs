//! The quadratic program of one major iteration, which the formulations share:
//!
//! ```text
//! minimise ½ ‖A_s d + r_s‖² + ½ dᵀ D d    subject to  A_h d = −r_h,   lo ≤ d ≤ hi
//! ```
//!
//! with any number of stacks of soft rows. It only assembles and solves; what the rows mean is the formulation's affair.

use crate::qp::{Lexicographic, MatRef, Outcome, Qp, QpSolution, QpStatus};
use ik_core::evaluator::Evaluator;
use ik_core::formulation::{Solution, Termination};
use ik_core::problem::Problem;
use ik_core::rows::Rows;
use ik_core::step::{Bounds, ControlStep};

/// A stack of rows `A d + r`, column-major with leading dimension `ld`; padding rows are zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stack<'a> {
    pub(crate) matrix: &'a [f64],
    pub(crate) ld: usize,
    pub(crate) residual: &'a [f64],
}

impl<'a> Stack<'a> {
    /// Task rows as they are: Jacobian and error.
    pub(crate) fn plain(rows: &'a Rows) -> Self {
        Self {
            matrix: &rows.jacobian,
            ld: rows.ld(),
            residual: &rows.error,
        }
    }
}

/// Assembles and solves; sized once.
#[derive(Clone, Debug)]
pub(crate) struct StepQp {
    hessian: Vec<f64>,
    /// Four rows of a stack.
    rows: [Vec<f64>; 4],
    pub(crate) gradient: Vec<f64>,
    pub(crate) lo: Vec<f64>,
    pub(crate) hi: Vec<f64>,
    right: Vec<f64>,
    solver: Lexicographic,
    pub(crate) solution: QpSolution,
}

impl StepQp {
    pub(crate) fn new(problem: &Problem) -> Self {
        let (n, m) = (problem.robot().nv(), problem.largest_hard_rows());
        Self {
            hessian: vec![0.0; n * n],
            rows: std::array::from_fn(|_| vec![0.0; n]),
            gradient: vec![0.0; n],
            lo: vec![f64::NEG_INFINITY; n],
            hi: vec![f64::INFINITY; n],
            right: vec![0.0; m],
            solver: Lexicographic::new(n, m),
            solution: QpSolution::new(n, m),
        }
    }

    /// Forgets the active set.
    pub(crate) fn reset(&mut self) {
        self.solver.reset();
    }

    /// An objective of `½ weight ‖d‖²` alone.
    pub(crate) fn start(&mut self, weight: f64) {
        let n = self.gradient.len();
        self.hessian.fill(0.0);
        self.gradient.fill(0.0);
        self.hessian.iter_mut().step_by(n + 1).for_each(|h| *h = weight);
    }

    /// Moves the centre of `½ weight ‖d‖²` to `centre` (length n): adds what this changes, `−weight centre`, to the gradient.
    pub(crate) fn centre(&mut self, weight: f64, centre: &[f64]) {
        for (g, c) in self.gradient.iter_mut().zip(centre) {
            *g -= weight * c;
        }
    }

    /// Adds `½ ‖A d + r‖²`: the lower triangle of AᵀA, which [`StepQp::solve`] mirrors.
    ///
    /// Optimisation: four rows of A at a time, transposed, so that columns of H are written contiguously.
    pub(crate) fn add(&mut self, stack: Stack<'_>) {
        let n = self.gradient.len();
        for (g, column) in self.gradient.iter_mut().zip(stack.matrix.chunks_exact(stack.ld)) {
            *g += dot(column, stack.residual);
        }
        for first in (0..stack.ld).step_by(4) {
            let [r0, r1, r2, r3] = &mut self.rows;
            for (j, column) in stack.matrix.chunks_exact(stack.ld).enumerate() {
                let column = &column[first..first + 4];
                (r0[j], r1[j], r2[j], r3[j]) = (column[0], column[1], column[2], column[3]);
            }
            for (j, h) in self.hessian.chunks_exact_mut(n).enumerate() {
                let (a0, a1, a2, a3) = (r0[j], r1[j], r2[j], r3[j]);
                let rows = r0[j..].iter().zip(&r1[j..]).zip(&r2[j..]).zip(&r3[j..]);
                for (h, (((r0, r1), r2), r3)) in h[j..].iter_mut().zip(rows) {
                    *h += (a0 * r0 + a1 * r1) + (a2 * r2 + a3 * r3);
                }
            }
        }
    }

    /// Nothing is bounded.
    pub(crate) fn free(&mut self) {
        self.lo.fill(f64::NEG_INFINITY);
        self.hi.fill(f64::INFINITY);
    }

    /// The step's intervals as seen from an iterate that is already `dq` away from q⁻.
    pub(crate) fn bound(&mut self, bounds: &Bounds<'_>, dq: &[f64]) {
        for (i, dq) in dq.iter().enumerate() {
            self.lo[i] = bounds.lo[i] - dq;
            self.hi[i] = bounds.hi[i] - dq;
        }
    }

    /// Copies the lower triangle to the upper one.
    fn mirror_hessian(&mut self) {
        let n = self.gradient.len();
        for j in 1..n {
            let (before, from) = self.hessian.split_at_mut(j * n);
            for (h, before) in from[..j].iter_mut().zip(before.chunks_exact(n)) {
                *h = before[j];
            }
        }
    }

    /// Solves with the hard rows `A d = −r` (`rows` of them); the answer is in `self.solution`.
    pub(crate) fn solve(&mut self, hard: Stack<'_>, rows: usize, eval: &mut Evaluator) -> Outcome {
        let n = self.gradient.len();
        self.mirror_hessian();
        for (b, r) in self.right.iter_mut().zip(&hard.residual[..rows]) {
            *b = -r;
        }
        let qp = Qp {
            h: MatRef::new(&self.hessian, n, n),
            g: &self.gradient,
            a: MatRef {
                data: hard.matrix,
                rows,
                cols: n,
                ld: hard.ld,
            },
            b: &self.right[..rows],
            lo: &self.lo,
            hi: &self.hi,
        };
        let outcome = self.solver.solve(&qp, &mut self.solution);
        eval.meter.minors(self.solution.minors);
        outcome
    }
}

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Columns are padded to a multiple of four: four partial sums keep the vector units busy.
    let mut sums = [0.0; 4];
    for (a, b) in a.chunks_exact(4).zip(b.chunks_exact(4)) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Writes q = q⁻ ⊕ dq (dq clamped into the intervals of bounded joints) and v = dq/Δt.
pub(crate) fn finish(problem: &Problem, step: &ControlStep<'_>, dq: &mut [f64], out: &mut Solution) {
    for ((d, lo), hi) in dq.iter_mut().zip(step.bounds.lo).zip(step.bounds.hi) {
        *d = d.max(*lo).min(*hi);
    }
    finish_unbounded(problem, step, dq, out);
}

/// The same without the intervals, for methods that know no boundary.
pub(crate) fn finish_unbounded(problem: &Problem, step: &ControlStep<'_>, dq: &[f64], out: &mut Solution) {
    ik_core::configuration::integrate_into(problem.robot(), step.q_prev, dq, &mut out.q);
    for (v, d) in out.v.iter_mut().zip(dq) {
        *v = d / step.dt_s;
    }
}

/// Standing still: q⁻, zero velocity.
pub(crate) fn stay(step: &ControlStep<'_>, out: &mut Solution) {
    out.q.copy_from_slice(step.q_prev);
    out.v.fill(0.0);
}

/// How a step ends whose last quadratic program ended as `outcome`: `otherwise` if that was well. Without any usable
/// answer the robot stays where it was.
pub(crate) fn conclude(
    outcome: Outcome,
    otherwise: Termination,
    step: &ControlStep<'_>,
    out: &mut Solution,
) -> Termination {
    match outcome {
        Outcome::Solved => otherwise,
        Outcome::Relaxed { residual } => Termination::HardRowsRelaxed { residual },
        Outcome::Failed(status) => {
            stay(step, out);
            Termination::Numerical(match status {
                QpStatus::Infeasible => "the interval of a joint is empty",
                _ => "the quadratic program could not be solved",
            })
        }
    }
}
