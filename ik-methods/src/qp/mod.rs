//! # Dense convex quadratic programs with equality rows and a box
//!
//! Every step of the constrained formulations ends in the same small dense problem
//!
//! ```text
//! minimise    1/2 xᵀ H x + gᵀ x
//! subject to  A x = b,   lo <= x <= hi
//! ```
//!
//! with a few dozen unknowns, H symmetric positive semidefinite and possibly infinite bounds. This module
//! holds the problem ([`Qp`]), the answer ([`QpSolution`]), the door every solver is reached through
//! ([`QpSolver`]) and the check of an answer from the problem data alone ([`kkt_residuals`]).
//!
//! | solver | role |
//! |---|---|
//! | [`ActiveSet`] | the one methods use: dual active set on the eliminated problem, warm start, no allocation |
//! | [`ClarabelQp`] | interior-point reference for tests and comparisons |
//! | [`Lexicographic`] | either of them, with rows that may not fit the box: fit the rows first, then the objective |
//!
//! The optimality (Karush–Kuhn–Tucker) conditions, in the signs used everywhere in this module:
//!
//! ```text
//! H x + g - Aᵀ y - z = 0,    A x = b,    lo <= x <= hi,
//! z_i > 0 only where x_i = lo_i,    z_i < 0 only where x_i = hi_i
//! ```

mod active_set;
mod clarabel;

mod dual;
mod elimination;
mod kernels;
mod lexicographic;

mod reduced;
mod working_set;

pub use active_set::ActiveSet;
pub use clarabel::ClarabelQp;
pub use lexicographic::{Lexicographic, Outcome};

use kernels::dot;

/// Borrowed dense matrix, column-major: entry (i, j) is `data[i + j * ld]`.
#[derive(Clone, Copy, Debug)]
pub struct MatRef<'a> {
    /// Entries, at least `ld * (cols - 1) + rows` of them.
    pub data: &'a [f64],
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Distance between the starts of two columns, at least `rows`.
    pub ld: usize,
}

impl<'a> MatRef<'a> {
    /// The `rows x cols` matrix stored without gaps in `data`.
    #[must_use]
    pub fn new(data: &'a [f64], rows: usize, cols: usize) -> Self {
        Self {
            data,
            rows,
            cols,
            ld: rows,
        }
    }

    /// Column `j`, of length `rows`.
    #[must_use]
    #[inline]
    pub fn col(&self, j: usize) -> &'a [f64] {
        &self.data[j * self.ld..][..self.rows]
    }

    /// True if the data hold the shape the fields promise.
    fn is_stored(&self) -> bool {
        self.rows == 0 || self.cols == 0 || {
            self.ld >= self.rows && self.data.len() >= self.ld * (self.cols - 1) + self.rows
        }
    }
}

/// One quadratic program, borrowed: minimise 1/2 xᵀHx + gᵀx subject to A x = b, lo <= x <= hi.
#[derive(Clone, Copy, Debug)]
pub struct Qp<'a> {
    /// H, n x n, symmetric positive semidefinite; both triangles are read.
    pub h: MatRef<'a>,
    /// g, length n.
    pub g: &'a [f64],
    /// A, m x n; m may be 0, rows may be dependent.
    pub a: MatRef<'a>,
    /// b, length m.
    pub b: &'a [f64],
    /// Lower bounds, length n, negative infinity for none.
    pub lo: &'a [f64],
    /// Upper bounds, length n, infinity for none.
    pub hi: &'a [f64],
}

impl Qp<'_> {
    /// Number of unknowns n.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.g.len()
    }

    /// Number of equality rows m.
    #[must_use]
    pub fn equalities(&self) -> usize {
        self.b.len()
    }

    /// Objective 1/2 xᵀHx + gᵀx.
    #[must_use]
    pub fn objective(&self, x: &[f64]) -> f64 {
        let quadratic: f64 = (0..self.unknowns()).map(|j| x[j] * dot(self.h.col(j), x)).sum();
        0.5 * quadratic + dot(self.g, x)
    }

    /// True if all parts have matching sizes.
    fn is_consistent_in_shape(&self) -> bool {
        let (n, m) = (self.unknowns(), self.equalities());
        let square = self.h.rows == n && self.h.cols == n && self.h.is_stored();
        let rows = m == 0 || (self.a.rows == m && self.a.cols == n && self.a.is_stored());
        square && rows && self.lo.len() == n && self.hi.len() == n
    }
}

/// Answer of a [`QpSolver`]: the point and its multipliers.
#[derive(Clone, Debug, Default)]
pub struct QpSolution {
    /// Point x, length n, inside the box.
    pub x: Vec<f64>,
    /// Multipliers of A x = b, length m (0 on rows found redundant).
    pub y: Vec<f64>,
    /// Multipliers of the box, length n: positive at a lower, negative at an upper bound.
    pub z: Vec<f64>,
    /// Minor iterations: changes of the active set, or interior-point iterations.
    pub minors: u32,
}

impl QpSolution {
    /// Zero answer for `n` unknowns and `m` equality rows.
    #[must_use]
    pub fn new(n: usize, m: usize) -> Self {
        Self {
            x: vec![0.0; n],
            y: vec![0.0; m],
            z: vec![0.0; n],
            minors: 0,
        }
    }

    /// Sets everything to zero in the size of `qp`; allocates only if the answer was smaller before.
    fn clear_for(&mut self, qp: &Qp<'_>) {
        for (part, len) in [
            (&mut self.x, qp.unknowns()),
            (&mut self.y, qp.equalities()),
            (&mut self.z, qp.unknowns()),
        ] {
            part.clear();
            part.resize(len, 0.0);
        }
        self.minors = 0;
    }
}

/// How a solve ended. Whatever it says, x holds no NaN and lies in the box (unless the box is empty).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QpStatus {
    /// The KKT conditions hold to the solver's tolerance.
    Solved,
    /// No point satisfies the rows and the box.
    Infeasible,
    /// The iteration limit was reached first.
    MinorLimit,
    /// Input that is not finite or does not match in size, an unbounded objective, or a loss of accuracy.
    Numerical,
}

/// A solver of [`Qp`].
pub trait QpSolver: Send {
    /// Solves `qp` into `out`, starting from whatever the solver remembers of its previous problem.
    ///
    /// `out` is brought to the size of `qp`; that allocates only if it was created for a smaller one.
    fn solve(&mut self, qp: &Qp<'_>, out: &mut QpSolution) -> QpStatus;

    /// Forgets the previous problem.
    fn reset(&mut self);
}

/// Largest violations of the KKT conditions by an answer, computed from the problem data alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KktResiduals {
    /// Largest |H x + g - Aᵀ y - z|.
    pub stationarity: f64,
    /// Largest |A x - b|.
    pub equality: f64,
    /// Largest distance of x outside the box.
    pub bound: f64,
    /// Largest |z_i| times the distance of x_i from the bound the sign of z_i belongs to.
    pub complementarity: f64,
    /// Largest |z_i| whose sign belongs to an infinite bound.
    pub dual_sign: f64,
    /// Largest sum of magnitudes |H_ij x_j| + |g_i| + |A_ri y_r| + |z_i| of a stationarity condition.
    ///
    /// Nearly dependent rows have large multipliers of opposite effect; a residual of rounding size in those
    /// terms is what a backward-stable solver leaves.
    pub gradient_scale: f64,
    /// Largest |b_r| or sum of |A_rj x_j| of a row.
    pub row_scale: f64,
    /// Largest |x_i|.
    pub point_scale: f64,
}

impl KktResiduals {
    /// Largest residual, each divided by the size of the terms it is the difference of (where not 0).
    #[must_use]
    pub fn worst_relative(&self) -> f64 {
        let ratio = |value: f64, scale: f64| if value > 0.0 { value / scale } else { value };
        [
            ratio(self.stationarity, self.gradient_scale),
            ratio(self.equality, self.row_scale),
            ratio(self.bound, self.point_scale),
            ratio(self.complementarity, self.gradient_scale * self.point_scale),
            ratio(self.dual_sign, self.gradient_scale),
        ]
        .into_iter()
        .fold(0.0, worse)
    }
}

/// Maximum that keeps a NaN, so that a NaN residual cannot hide.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// KKT residuals of `solution` for `qp`. The sizes of both must match.
#[must_use]
pub fn kkt_residuals(qp: &Qp<'_>, solution: &QpSolution) -> KktResiduals {
    let mut out = KktResiduals::default();
    for i in 0..qp.unknowns() {
        unknown_residuals(qp, solution, i, &mut out);
    }
    for r in 0..qp.equalities() {
        let terms = || (0..qp.unknowns()).map(|j| qp.a.data[r + j * qp.a.ld] * solution.x[j]);
        out.equality = worse((terms().sum::<f64>() - qp.b[r]).abs(), out.equality);
        out.row_scale = worse(
            terms().map(f64::abs).sum::<f64>().max(qp.b[r].abs()),
            out.row_scale,
        );
    }
    out
}

/// Adds what unknown `i` contributes to the residuals.
fn unknown_residuals(qp: &Qp<'_>, solution: &QpSolution, i: usize, out: &mut KktResiduals) {
    let (x, z) = (solution.x[i], solution.z[i]);
    let hx = dot(qp.h.col(i), &solution.x);
    let aty = if qp.equalities() > 0 {
        dot(qp.a.col(i), &solution.y)
    } else {
        0.0
    };
    out.stationarity = worse((hx + qp.g[i] - aty - z).abs(), out.stationarity);
    let terms = |column: &[f64], v: &[f64]| column.iter().zip(v).map(|(a, v)| (a * v).abs()).sum::<f64>();
    let row_terms = if qp.equalities() > 0 {
        terms(qp.a.col(i), &solution.y)
    } else {
        0.0
    };
    let scale = terms(qp.h.col(i), &solution.x) + qp.g[i].abs() + row_terms + z.abs();
    out.gradient_scale = worse(scale, out.gradient_scale);
    out.point_scale = worse(x.abs(), out.point_scale);
    out.bound = worse((qp.lo[i] - x).max(x - qp.hi[i]).max(0.0), out.bound);
    let distance = if z > 0.0 { x - qp.lo[i] } else { qp.hi[i] - x };
    if z.abs() > 0.0 && distance.is_infinite() {
        out.dual_sign = worse(z.abs(), out.dual_sign);
    } else if z.abs() > 0.0 {
        out.complementarity = worse((z * distance).abs(), out.complementarity);
    }
}
