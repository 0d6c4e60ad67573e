//! # Rows first, then the objective
//!
//! Rows that do not fit the box are met as well as possible, in the Euclidean norm, before the objective is
//! looked at (lexicographic least squares; Kanoun, Lamiraux & Wieber, IEEE Trans. Robotics 27(4), 2011):
//!
//! ```text
//! (1)  minimise |A x - b|²             subject to          lo <= x <= hi
//! (2)  minimise 1/2 xᵀ H x + gᵀ x      subject to A x = A x₁, lo <= x <= hi
//! ```
//!
//! (1) is solved as an equality problem with scaled slacks, A x + d s = b, minimise 1/2 |s|²: eliminating
//! the rows then keeps the condition of A where the normal equations AᵀA would square it. The scale d is
//! small against A, so that the pivots fall on x and only what A cannot reach is left to the slacks.

use super::active_set::{ActiveSet, check_input, clip};
use super::kernels::{add_scaled, dot, max_abs};
use super::{MatRef, Qp, QpSolution, QpSolver, QpStatus};

/// Scale of the slacks relative to the largest entry of A.
///
/// Heuristic: rows are pivoted on x down to a remainder of about 4e-3; beyond that the slack is the pivot
/// and the reduced Hessian of (1) has entries of order (1 / 4)² to 4².
const SLACK_SCALE: f64 = 1e-3;

/// Weight of the motion itself in (1), against 1 for a slack.
///
/// It makes (1) strictly convex, so that nearly dependent rows cannot send x along a direction no row sees; a residual
/// grows by at most this times SLACK_SCALE² = 1e-12 of |x| over the least relevant singular value.
const MOTION_WEIGHT: f64 = 1e-6;

/// Residual, relative to the terms of the rows (at least 1: rows in metres and radians), that is rounding: the rows did
/// fit.
const NEGLIGIBLE: f64 = 1e-12;

/// Widening of the box, relative to the point (at most 1), for the second try at (2). The widened part is
/// clipped off again.
const WIDENING: f64 = 1e-9;

/// How a lexicographic solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Rows and box are met and the objective is minimal.
    Solved,
    /// The rows do not fit the box, or contradict each other; they are met as well as the box allows.
    Relaxed {
        /// Euclidean norm of A x - b.
        residual: f64,
    },
    /// No usable answer: the box is empty, the input not finite, or the objective unbounded.
    Failed(QpStatus),
}

/// Solver for problems whose rows may not fit their box; see the module documentation.
///
/// After `Relaxed` the multipliers belong to the problem (2), or are zero if only (1) could be solved.
#[derive(Clone, Debug)]
pub struct Lexicographic<S = ActiveSet> {
    solver: S,
    fit: S,
    fitted: QpSolution,
    /// Data of (1) in the unknowns (x, s).
    hessian: Vec<f64>,
    zeros: Vec<f64>,
    rows: Vec<f64>,
    lo: Vec<f64>,
    hi: Vec<f64>,
    /// A x₁, and A x - b.
    reached: Vec<f64>,
}

impl Lexicographic<ActiveSet> {
    /// Active-set version for up to `n` unknowns and `m_max` rows; allocates nothing afterwards.
    #[must_use]
    pub fn new(n: usize, m_max: usize) -> Self {
        Self::with_solvers(ActiveSet::new(n, m_max), ActiveSet::new(n + m_max, m_max), n, m_max)
    }
}

impl<S: QpSolver> Lexicographic<S> {
    /// Version with other solvers: `solver` gets problems of (n, m), `fit` of (n + m, m).
    #[must_use]
    pub fn with_solvers(solver: S, fit: S, n: usize, m_max: usize) -> Self {
        let wide = n + m_max;
        Self {
            solver,
            fit,
            fitted: QpSolution::new(wide, m_max),
            hessian: vec![0.0; wide * wide],
            zeros: vec![0.0; wide],
            rows: vec![0.0; wide * m_max],
            lo: vec![0.0; wide],
            hi: vec![0.0; wide],
            reached: vec![0.0; m_max],
        }
    }

    /// Forgets the previous problem.
    pub fn reset(&mut self) {
        self.solver.reset();
        self.fit.reset();
    }

    /// Solves `qp` into `out`, relaxing the rows if they do not fit.
    pub fn solve(&mut self, qp: &Qp<'_>, out: &mut QpSolution) -> Outcome {
        match self.solver.solve(qp, out) {
            QpStatus::Solved => Outcome::Solved,
            QpStatus::Numerical => Outcome::Failed(QpStatus::Numerical),
            failed if qp.equalities() == 0 => Outcome::Failed(failed),
            _ => match check_input(qp) {
                QpStatus::Solved => self.relax(qp, out),
                rejected => Outcome::Failed(rejected),
            },
        }
    }

    fn relax(&mut self, qp: &Qp<'_>, out: &mut QpSolution) -> Outcome {
        let tried = out.minors;
        let status = self.fit_rows(qp);
        if status != QpStatus::Solved {
            return Outcome::Failed(status);
        }
        let improved = self.improve(qp, out);
        if !improved {
            out.clear_for(qp);
            out.x.copy_from_slice(&self.fitted.x[..qp.unknowns()]);
        }
        out.minors += tried + self.fitted.minors;
        let (residual, terms) = self.residual(qp, &out.x);
        if improved && residual <= NEGLIGIBLE * terms.max(1.0) { Outcome::Solved } else { Outcome::Relaxed { residual } }
    }

    /// Problem (1); leaves x₁ (and slacks) in `self.fitted` and A x₁ in `self.reached`.
    fn fit_rows(&mut self, qp: &Qp<'_>) -> QpStatus {
        let (n, m) = (qp.unknowns(), qp.equalities());
        let wide = n + m;
        self.load_fit(qp);
        let problem = Qp {
            h: MatRef::new(&self.hessian[..wide * wide], wide, wide),
            g: &self.zeros[..wide],
            a: MatRef::new(&self.rows[..m * wide], m, wide),
            b: qp.b,
            lo: &self.lo[..wide],
            hi: &self.hi[..wide],
        };
        let status = self.fit.solve(&problem, &mut self.fitted);
        clip(&mut self.fitted.x[..n], qp.lo, qp.hi);
        self.reached.resize(m, 0.0);
        product_into(&qp.a, &self.fitted.x[..n], &mut self.reached);
        status
    }

    fn load_fit(&mut self, qp: &Qp<'_>) {
        let (n, m) = (qp.unknowns(), qp.equalities());
        let wide = n + m;
        self.hessian.clear();
        self.hessian.resize(wide * wide, 0.0);
        self.rows.clear();
        self.rows.resize(m * wide, 0.0);
        self.zeros.resize(wide.max(self.zeros.len()), 0.0);
        let mut largest = 0.0_f64;
        for j in 0..n {
            self.rows[j * m..][..m].copy_from_slice(qp.a.col(j));
            largest = largest.max(max_abs(qp.a.col(j)));
        }
        let scale = if largest > 0.0 { SLACK_SCALE * largest } else { 1.0 };
        self.hessian.iter_mut().step_by(wide + 1).take(n).for_each(|h| *h = MOTION_WEIGHT);
        for r in 0..m {
            self.rows[(n + r) * m + r] = scale;
            self.hessian[(n + r) * (wide + 1)] = 1.0;
        }
        self.widened_box(qp, 0.0);
        self.lo.resize(wide, f64::NEG_INFINITY);
        self.hi.resize(wide, f64::INFINITY);
    }

    /// Box of `qp` with `margin` on either side, in `self.lo` and `self.hi`.
    fn widened_box(&mut self, qp: &Qp<'_>, margin: f64) {
        self.lo.clear();
        self.lo.extend(qp.lo.iter().map(|lo| lo - margin));
        self.hi.clear();
        self.hi.extend(qp.hi.iter().map(|hi| hi + margin));
    }

    /// Problem (2); true if it could be solved.
    fn improve(&mut self, qp: &Qp<'_>, out: &mut QpSolution) -> bool {
        let met = Qp { b: &self.reached, ..*qp };
        if self.solver.solve(&met, out) == QpStatus::Solved {
            return true;
        }
        // x₁ itself is feasible: an infeasible verdict is rounding, amplified by nearly dependent rows.
        let tried = out.minors;
        let size = max_abs(&self.fitted.x[..qp.unknowns()]).min(1.0);
        self.widened_box(qp, WIDENING * size);
        let widened = Qp { b: &self.reached, lo: &self.lo, hi: &self.hi, ..*qp };
        let status = self.solver.solve(&widened, out);
        clip(&mut out.x, qp.lo, qp.hi);
        out.minors += tried;
        status == QpStatus::Solved
    }

    /// |A x - b|, and the size of the terms it is made of.
    fn residual(&mut self, qp: &Qp<'_>, x: &[f64]) -> (f64, f64) {
        product_into(&qp.a, x, &mut self.reached);
        add_scaled(&mut self.reached, -1.0, qp.b);
        let columns = (0..qp.unknowns()).map(|j| max_abs(qp.a.col(j)) * x[j].abs());
        (dot(&self.reached, &self.reached).sqrt(), columns.sum::<f64>() + max_abs(qp.b))
    }
}

/// out = A x.
fn product_into(a: &MatRef<'_>, x: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    for (j, value) in x.iter().enumerate() {
        add_scaled(out, *value, a.col(j));
    }
}
