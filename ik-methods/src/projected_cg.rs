//! Projected conjugate gradients for one damped least-squares system with equality rows:
//!
//! ```text
//! minimise ½ ‖J_s d + e_s‖² + ½ R ‖d − p‖²    subject to  J_h d = −e_h
//! ```
//!
//! Source: Gould, Hribar & Nocedal (2001), On the solution of equality constrained quadratic programming problems arising
//! in optimization, SIAM J. Sci. Comput. 23(4), alg. 6.2, with the normal-equations projection, one step of iterative
//! refinement and the residual replaced by its projection (their §7): the part of the residual in the range of J_hᵀ does
//! not vanish, and its rounding would otherwise drown the rest. The reduced operator is R·I plus a matrix of the rank of J_s, so at most rank + 1 iterations are
//! needed in exact arithmetic.

use ik_core::evaluator::Linearisation;
use ik_core::rows::Rows;

/// Residuals below this fraction of the first end the iteration.
const TOLERANCE: f64 = 1e-14;

/// Pivots of J_h J_hᵀ below this fraction of their diagonal mark a dependent row: the square of the relative row
/// remainder 1e-7, beyond which squared conditioning leaves no digits.
const DEPENDENT: f64 = 1e-14;

/// Workspace of the iteration.
#[derive(Clone, Debug)]
pub(crate) struct ProjectedCg {
    gram: Vec<f64>,
    rows: Vec<f64>,
    soft: Vec<f64>,
    residual: Vec<f64>,
    projected: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
}

impl ProjectedCg {
    pub(crate) fn new(n: usize, m: usize, soft_rows: usize) -> Self {
        let m = m.next_multiple_of(4).max(4);
        Self {
            gram: vec![0.0; m * m],
            rows: vec![0.0; m],
            soft: vec![0.0; soft_rows.next_multiple_of(4).max(4)],
            residual: vec![0.0; n],
            projected: vec![0.0; n],
            direction: vec![0.0; n],
            image: vec![0.0; n],
        }
    }

    /// Largest violation that `d` leaves in the hard rows (m, rad): not rounding where these are dependent, since dependent
    /// rows are left out.
    pub(crate) fn violation(&mut self, lin: &Linearisation, d: &[f64]) -> f64 {
        lin.hard.multiply_into(d, &mut self.rows);
        let rows = self.rows.iter().zip(&lin.hard.error[..lin.hard.rows()]);
        rows.map(|(moved, error)| (moved + error).abs())
            .fold(0.0, f64::max)
    }

    /// Solves at the linearised configuration into `d`, p being `pull`, zero without one; returns the number of iterations,
    /// none if the gradient is not finite.
    pub(crate) fn solve(
        &mut self,
        lin: &Linearisation,
        damping: f64,
        pull: Option<&[f64]>,
        d: &mut [f64],
    ) -> Option<u32> {
        factorise_gram(&lin.hard, &mut self.gram);
        // d₀ = −J_hᵀ (J_h J_hᵀ)⁻¹ e_h meets the rows.
        let m = lin.hard.rows();
        self.rows[..m].copy_from_slice(&lin.hard.error[..m]);
        solve_gram(&self.gram, m, &mut self.rows);
        d.fill(0.0);
        lin.hard.add_transposed(&self.rows, -1.0, d);
        // Gradient at d₀.
        self.image.copy_from_slice(d);
        apply(
            &lin.soft,
            damping,
            &mut self.soft,
            &self.image,
            &mut self.residual,
        );
        lin.soft.add_transposed(&lin.soft.error, 1.0, &mut self.residual);
        if let Some(pull) = pull {
            axpy(-damping, pull, &mut self.residual);
        }
        self.project(lin);
        for (p, g) in self.direction.iter_mut().zip(&self.projected) {
            *p = -g;
        }
        let mut rg = dot(&self.residual, &self.projected);
        if !rg.is_finite() {
            return None;
        }
        let goal = TOLERANCE * TOLERANCE * rg;
        let limit = u32::try_from(d.len()).unwrap_or(u32::MAX);
        let mut iterations = 0;
        while rg > goal && iterations < limit {
            iterations += 1;
            apply(
                &lin.soft,
                damping,
                &mut self.soft,
                &self.direction,
                &mut self.image,
            );
            let alpha = rg / dot(&self.direction, &self.image);
            axpy(alpha, &self.direction, d);
            axpy(alpha, &self.image, &mut self.residual);
            self.project(lin);
            let next = dot(&self.residual, &self.projected);
            let beta = next / rg;
            for (p, g) in self.direction.iter_mut().zip(&self.projected) {
                *p = beta * *p - g;
            }
            rg = next;
        }
        Some(iterations)
    }

    /// `residual = projected = P residual`, P the orthogonal projector onto the null space of J_h; refined once.
    fn project(&mut self, lin: &Linearisation) {
        self.projected.copy_from_slice(&self.residual);
        let m = lin.hard.rows();
        for _ in 0..2 {
            lin.hard.multiply_into(&self.projected, &mut self.rows);
            solve_gram(&self.gram, m, &mut self.rows);
            lin.hard.add_transposed(&self.rows, -1.0, &mut self.projected);
        }
        self.residual.copy_from_slice(&self.projected);
    }
}

/// `out = (J_sᵀ J_s + R) v`.
fn apply(soft: &Rows, damping: f64, scratch: &mut [f64], v: &[f64], out: &mut [f64]) {
    soft.multiply_into(v, scratch);
    for (o, v) in out.iter_mut().zip(v) {
        *o = damping * v;
    }
    soft.add_transposed(scratch, 1.0, out);
}

/// Lower Cholesky factor of J_h J_hᵀ in `gram` (m × m, column-major); dependent rows get a zero pivot.
fn factorise_gram(hard: &Rows, gram: &mut [f64]) {
    let (m, ld) = (hard.rows(), hard.ld());
    gram[..m * m].fill(0.0);
    for column in hard.jacobian.chunks_exact(ld) {
        for j in 0..m {
            axpy(column[j], &column[j..m], &mut gram[j * m + j..(j + 1) * m]);
        }
    }
    for j in 0..m {
        let diagonal = gram[j * m + j];
        let (before, rest) = gram.split_at_mut(j * m);
        let column = &mut rest[..m];
        for k in 0..j {
            let factor = &before[k * m..(k + 1) * m];
            axpy(-factor[j], &factor[j..], &mut column[j..]);
        }
        let pivot = column[j];
        if pivot > DEPENDENT * diagonal {
            let inverse = 1.0 / pivot.sqrt();
            column[j..].iter_mut().for_each(|c| *c *= inverse);
        } else {
            column[j..].fill(0.0);
        }
    }
}

/// Solves L Lᵀ y = b in place; unknowns of zero pivots are zero.
fn solve_gram(gram: &[f64], m: usize, b: &mut [f64]) {
    for j in 0..m {
        let column = &gram[j * m..(j + 1) * m];
        b[j] = if column[j] > 0.0 { b[j] / column[j] } else { 0.0 };
        let y = b[j];
        axpy(-y, &column[j + 1..], &mut b[j + 1..m]);
    }
    for j in (0..m).rev() {
        let column = &gram[j * m..(j + 1) * m];
        let rest = dot(&column[j + 1..], &b[j + 1..m]);
        b[j] = if column[j] > 0.0 {
            (b[j] - rest) / column[j]
        } else {
            0.0
        };
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn axpy(s: f64, from: &[f64], to: &mut [f64]) {
    to.iter_mut().zip(from).for_each(|(t, f)| *t += s * f);
}
