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
//! (1) is written with scaled slacks, A x + d s = b, minimise 1/2 |s|²: eliminating the rows then keeps the
//! condition of A where the normal equations AᵀA would square it. The scale d is small against A, so that the
//! pivots fall on x and only what A cannot reach is left to the slacks.
//!
//! Nearly dependent rows (a singular value of 1e-9) amplify rounding of the data until the box seems out of
//! reach. Slacks in a box of rounding size then give the rows the room they need, in the problem itself if
//! (1) leaves next to no residual, else in (2).

use super::active_set::{ActiveSet, check_input, clip};
use super::kernels::{add_scaled, dot, max_abs};
use super::{MatRef, Qp, QpSolution, QpSolver, QpStatus};

/// Scale of the slacks of (1) relative to the largest entry of A.
///
/// Heuristic: a direction in which A has the singular value sigma has the curvature (sigma / d)² in (1) and is
/// resolved down to about 1e-9 (the proximal weight): residuals are minimal up to 3e-8 of A times x. A smaller
/// d would resolve more, but the normals of the bounds would differ by more than rounding allows.
const FIT_SCALE: f64 = 1e-3;

/// Residual of (1), relative to the terms of the rows, below which the rows may well fit after all.
const MAY_FIT: f64 = 1e-6;

/// Scale of slacks of rounding size relative to the largest entry of A: well above the 1e-12 at which a row
/// counts as dependent, and as small as possible for the pivots to fall on x.
const ROOM_SCALE: f64 = 1e-8;

/// Room for the rows relative to their terms: some 50 times the rounding of a row.
const ROUNDING_ROOM: f64 = 1e-14;

/// Residual relative to the terms of the rows (at least 1: rows are in metres and radians) that is rounding: the
/// rows did fit. Covers the room in all rows and the clipping of unknowns to the box.
const NEGLIGIBLE: f64 = 1e-12;

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
    /// Solver of the problems in (x, s), and their data and solution.
    slack_solver: S,
    slack_solution: QpSolution,
    hessian: Vec<f64>,
    gradient: Vec<f64>,
    rows: Vec<f64>,
    lo: Vec<f64>,
    hi: Vec<f64>,
    /// x₁, and the right-hand side to be met next: b or A x₁.
    fitted: Vec<f64>,
    reached: Vec<f64>,
    /// A x - b.
    residual: Vec<f64>,
}

impl Lexicographic<ActiveSet> {
    /// Active-set version for up to `n` unknowns and `m_max` rows; allocates nothing afterwards.
    #[must_use]
    pub fn new(n: usize, m_max: usize) -> Self {
        Self::with_solvers(
            ActiveSet::new(n, m_max),
            ActiveSet::new(n + m_max, m_max),
            n,
            m_max,
        )
    }
}

impl<S: QpSolver> Lexicographic<S> {
    /// Version with other solvers: `solver` gets problems of (n, m), `slack_solver` of (n + m, m).
    #[must_use]
    pub fn with_solvers(solver: S, slack_solver: S, n: usize, m_max: usize) -> Self {
        let wide = n + m_max;
        Self {
            solver,
            slack_solver,
            slack_solution: QpSolution::new(wide, m_max),
            hessian: vec![0.0; wide * wide],
            gradient: vec![0.0; wide],
            rows: vec![0.0; wide * m_max],
            lo: vec![0.0; wide],
            hi: vec![0.0; wide],
            fitted: vec![0.0; n],
            reached: vec![0.0; m_max],
            residual: vec![0.0; m_max],
        }
    }

    /// Forgets the previous problem.
    pub fn reset(&mut self) {
        self.solver.reset();
        self.slack_solver.reset();
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
        let mut minors = out.minors;
        // A fit that stops short of its tolerance is as good a start as any: the residual reported is that of
        // the point returned. Its objective has a minimum and its data are finite, so nothing worse can be.
        self.fit_rows(qp);
        minors += self.slack_solution.minors;
        let is_optimal = self.minimise_objective(qp, out, &mut minors);
        if !is_optimal {
            out.clear_for(qp);
            out.x.copy_from_slice(&self.fitted);
        }
        out.minors = minors;
        let residual = self.residual_norm(qp, &out.x);
        if is_optimal && residual <= NEGLIGIBLE * row_terms(qp, &out.x).max(1.0) {
            Outcome::Solved
        } else {
            Outcome::Relaxed { residual }
        }
    }

    /// The problem itself with room for rounding where that may do, else (2), else (2) with that room.
    ///
    /// False if none could be solved.
    fn minimise_objective(&mut self, qp: &Qp<'_>, out: &mut QpSolution, minors: &mut u32) -> bool {
        self.reached.copy_from_slice(qp.b);
        let fitted = std::mem::take(&mut self.fitted);
        let may_fit = self.residual_norm(qp, &fitted) <= MAY_FIT * row_terms(qp, &fitted);
        let fits = may_fit && self.solve_with_room(qp, &fitted, out, minors);
        product_into(&qp.a, &fitted, &mut self.reached);
        let is_optimal = fits || {
            let met = Qp {
                b: &self.reached,
                ..*qp
            };
            let status = self.solver.solve(&met, out);
            *minors += out.minors;
            status == QpStatus::Solved || self.solve_with_room(qp, &fitted, out, minors)
        };
        self.fitted = fitted;
        is_optimal
    }

    /// Problem (1); leaves x₁ in `fitted`.
    fn fit_rows(&mut self, qp: &Qp<'_>) {
        let (n, m) = (qp.unknowns(), qp.equalities());
        self.load_rows_and_box(qp, FIT_SCALE);
        for slack in n..n + m {
            self.hessian[slack * (n + m + 1)] = 1.0;
            self.lo.push(f64::NEG_INFINITY);
            self.hi.push(f64::INFINITY);
        }
        self.reached.clear();
        self.reached.extend_from_slice(qp.b);
        self.solve_with_slacks(n, m);
        clip(&mut self.slack_solution.x[..n], qp.lo, qp.hi);
        self.fitted.clear();
        self.fitted.extend_from_slice(&self.slack_solution.x[..n]);
    }

    /// Minimises the objective subject to rows that meet `reached` up to rounding; true if that succeeds.
    fn solve_with_room(&mut self, qp: &Qp<'_>, x: &[f64], out: &mut QpSolution, minors: &mut u32) -> bool {
        let (n, m) = (qp.unknowns(), qp.equalities());
        let wide = n + m;
        let scale = self.load_rows_and_box(qp, ROOM_SCALE);
        let room = ROUNDING_ROOM * row_terms(qp, x) / scale;
        for _ in 0..m {
            self.lo.push(-room);
            self.hi.push(room);
        }
        for j in 0..n {
            self.hessian[j * wide..][..n].copy_from_slice(qp.h.col(j));
        }
        self.gradient[..n].copy_from_slice(qp.g);
        let status = self.solve_with_slacks(n, m);
        *minors += self.slack_solution.minors;
        out.clear_for(qp);
        out.x.copy_from_slice(&self.slack_solution.x[..n]);
        out.y.copy_from_slice(&self.slack_solution.y);
        out.z.copy_from_slice(&self.slack_solution.z[..n]);
        clip(&mut out.x, qp.lo, qp.hi);
        status == QpStatus::Solved
    }

    /// Rows [A d I] and the box of x, d relative to A; the objective is cleared. Returns d.
    fn load_rows_and_box(&mut self, qp: &Qp<'_>, relative_scale: f64) -> f64 {
        let (n, m) = (qp.unknowns(), qp.equalities());
        let wide = n + m;
        for (data, len) in [
            (&mut self.hessian, wide * wide),
            (&mut self.gradient, wide),
            (&mut self.rows, m * wide),
        ] {
            data.clear();
            data.resize(len, 0.0);
        }
        let mut largest = 0.0_f64;
        for j in 0..n {
            self.rows[j * m..][..m].copy_from_slice(qp.a.col(j));
            largest = largest.max(max_abs(qp.a.col(j)));
        }
        let scale = if largest > 0.0 {
            relative_scale * largest
        } else {
            1.0
        };
        (0..m).for_each(|r| self.rows[(n + r) * m + r] = scale);
        self.lo.clear();
        self.lo.extend_from_slice(qp.lo);
        self.hi.clear();
        self.hi.extend_from_slice(qp.hi);
        scale
    }

    /// Solves the loaded problem in (x, s) with `reached` as right-hand side.
    fn solve_with_slacks(&mut self, n: usize, m: usize) -> QpStatus {
        let problem = Qp {
            h: MatRef::new(&self.hessian, n + m, n + m),
            g: &self.gradient,
            a: MatRef::new(&self.rows, m, n + m),
            b: &self.reached,
            lo: &self.lo,
            hi: &self.hi,
        };
        self.slack_solver.solve(&problem, &mut self.slack_solution)
    }

    /// |A x - b|.
    fn residual_norm(&mut self, qp: &Qp<'_>, x: &[f64]) -> f64 {
        self.residual.resize(qp.equalities(), 0.0);
        product_into(&qp.a, x, &mut self.residual);
        add_scaled(&mut self.residual, -1.0, qp.b);
        dot(&self.residual, &self.residual).sqrt()
    }
}

/// Bound on the terms of every row: sum over j of the largest |A_rj| times |x_j|, plus the largest |b_r|.
fn row_terms(qp: &Qp<'_>, x: &[f64]) -> f64 {
    let columns = x.iter().enumerate().map(|(j, x)| max_abs(qp.a.col(j)) * x.abs());
    columns.sum::<f64>() + max_abs(qp.b)
}

/// out = A x.
fn product_into(a: &MatRef<'_>, x: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    for (j, value) in x.iter().enumerate() {
        add_scaled(out, *value, a.col(j));
    }
}
