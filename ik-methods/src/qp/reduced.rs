//! # The problem left after elimination
//!
//! With x_B = c + T x_N the unknowns are x = x_c + Z v, v = x_N, Z = [T; I], and the objective has the
//! reduced Hessian M = Zᵀ H Z and the reduced gradient Zᵀ(H x + g). M = L Lᵀ (Cholesky) turns it into
//! a least-distance problem in w = Lᵀ v, where the normal of the bound on x_i is L⁻¹ z_i (z_i: row i of Z).
//!
//! Unknowns are kept in *positions*: first the rank pivots in order of elimination, then the rest.
//!
//! If H is only semidefinite on the rows, L belongs to M + eps I. Every correction computed with that factor
//! from the true residual is then one proximal-point step (Rockafellar 1976), which converges to a solution
//! of the true problem; with a positive definite M the same correction is iterative refinement.

use super::elimination::Elimination;
use super::kernels::{LANES, add_scaled, add_scaled4, dot, max_abs, padded};
use super::{MatRef, Qp};

/// Smallest Cholesky pivot, relative to the largest diagonal entry of M, that is factorised as it is.
///
/// The relative error of a solve is about 2.2e-16 / 1e-11, which refinement contracts by 1e-4 or better.
const SAFE_PIVOT: f64 = 1e-11;

/// Proximal weight relative to the largest diagonal entry of M.
///
/// A curvature of that size is halved per step, larger ones vanish faster; the factor is still good to
/// 2.2e-16 / 1e-9, so that corrections contract.
const PROXIMAL_WEIGHT: f64 = 1e-9;

/// Reduced problem and its factor.
#[derive(Clone, Debug)]
pub(super) struct Reduced {
    n: usize,
    rank: usize,
    k: usize,
    /// Padded rank, at least one block: stride of `t_and_c`.
    stride: usize,
    /// k columns of T and then c.
    t_and_c: Vec<f64>,
    /// k columns of H Z and then H x_c + g, in the original order of unknowns, stride n.
    hz: Vec<f64>,
    /// One column of `hz` in positions.
    gathered: Vec<f64>,
    /// L, k x k, column-major, lower triangle.
    factor: Vec<f64>,
    inverse_diagonal: Vec<f64>,
    /// Largest diagonal entry of M; where M is zero that of H, else the size of the gradient.
    curvature: f64,
    /// Unknown at each position.
    pub(super) order: Vec<usize>,
}

impl Reduced {
    pub(super) fn new(n: usize, m: usize) -> Self {
        let stride = padded(m.min(n)).max(LANES);
        Self {
            n: 0,
            rank: 0,
            k: 0,
            stride,
            t_and_c: vec![0.0; stride * (n + 1)],
            hz: vec![0.0; n * (n + 1)],
            gathered: vec![0.0; padded(n) + LANES],
            factor: vec![0.0; n * n],
            inverse_diagonal: vec![0.0; n],
            curvature: 0.0,
            order: Vec::with_capacity(n),
        }
    }

    /// Number of unknowns left, k = n - rank.
    pub(super) fn unknowns(&self) -> usize {
        self.k
    }

    /// Bound on what the terms of a point (in positions), at least `floor`, contribute to the reduced gradient.
    ///
    /// |Zᵀ H dx| is at most sqrt(|M| |H|) |dx| for a change dx of the point, and |M| |dv| for Z dv.
    pub(super) fn gradient_terms(&self, h: &MatRef<'_>, x: &[f64], floor: f64) -> f64 {
        let terms = (0..self.n).map(|p| self.terms(x, p)).fold(floor, f64::max);
        (self.curvature * largest_diagonal(h)).sqrt() * terms + self.curvature * max_abs(&x[self.rank..])
    }

    /// Number of eliminated unknowns.
    pub(super) fn rank(&self) -> usize {
        self.rank
    }

    /// Takes over T and c.
    pub(super) fn load(&mut self, elimination: &mut Elimination) {
        self.rank = elimination.rank();
        self.k = elimination.remaining.len();
        self.n = self.rank + self.k;
        self.stride = padded(self.rank).max(LANES);
        self.order.clear();
        self.order.extend_from_slice(&elimination.pivots);
        self.order.extend_from_slice(&elimination.remaining);
        elimination.solution_into(self.stride, &mut self.t_and_c);
    }

    /// Builds and factorises M; false if not even the proximal weight makes it positive definite.
    pub(super) fn factorise(&mut self, qp: &Qp<'_>) -> bool {
        self.multiply_hessian(&qp.h, qp.g);
        let largest = self.assemble();
        self.curvature = if largest > 0.0 {
            largest
        } else {
            fallback_curvature(qp)
        };
        if self.cholesky(SAFE_PIVOT * largest) {
            return true;
        }
        self.assemble();
        for a in 0..self.k {
            self.factor[a * (self.k + 1)] += PROXIMAL_WEIGHT * self.curvature;
        }
        self.cholesky(0.0)
    }

    /// H Z and H x_c + g, four columns of H at a time.
    fn multiply_hessian(&mut self, h: &MatRef<'_>, g: &[f64]) {
        let (n, k, rank, stride) = (self.n, self.k, self.rank, self.stride);
        for (out, &unknown) in self.hz.chunks_exact_mut(n).zip(&self.order[rank..]) {
            out.copy_from_slice(h.col(unknown));
        }
        self.hz[k * n..][..n].copy_from_slice(g);
        for first in (0..rank).step_by(LANES) {
            // Beyond the rank T is zero, so any column of H will do there.
            let columns: [&[f64]; LANES] =
                std::array::from_fn(|lane| h.col(self.order[(first + lane).min(rank - 1)]));
            for (out, t) in self
                .hz
                .chunks_exact_mut(n)
                .zip(self.t_and_c.chunks_exact(stride))
                .take(k + 1)
            {
                add_scaled4(out, std::array::from_fn(|lane| t[first + lane]), columns);
            }
        }
    }

    /// Lower triangle of M from H Z; returns its largest diagonal entry.
    fn assemble(&mut self) -> f64 {
        let (n, k, rank, stride) = (self.n, self.k, self.rank, self.stride);
        let mut largest = 0.0_f64;
        for a in 0..k {
            let hz = &self.hz[a * n..][..n];
            gather(hz, &self.order[..rank], &mut self.gathered[..stride]);
            for b in a..k {
                let t = &self.t_and_c[b * stride..][..stride];
                self.factor[b + a * k] = hz[self.order[rank + b]] + dot(t, &self.gathered[..stride]);
            }
            largest = largest.max(self.factor[a * (k + 1)]);
        }
        largest
    }

    /// Left-looking Cholesky factorisation in place; false at the first pivot not above `floor`.
    fn cholesky(&mut self, floor: f64) -> bool {
        let k = self.k;
        for j in 0..k {
            let (done, rest) = self.factor.split_at_mut(j * k);
            let column = &mut rest[j..k];
            let mut groups = done.chunks_exact(k * LANES);
            for group in &mut groups {
                let columns: [&[f64]; LANES] = std::array::from_fn(|lane| &group[lane * k + j..][..k - j]);
                add_scaled4(column, columns.map(|column| -column[0]), columns);
            }
            for earlier in groups.remainder().chunks_exact(k) {
                add_scaled(column, -earlier[j], &earlier[j..]);
            }
            let pivot = column[0];
            if !(pivot > floor && pivot < f64::INFINITY) {
                return false;
            }
            let inverse = 1.0 / pivot.sqrt();
            self.inverse_diagonal[j] = inverse;
            column.iter_mut().for_each(|value| *value *= inverse);
        }
        true
    }

    /// v <- L⁻¹ v.
    pub(super) fn solve_lower(&self, v: &mut [f64]) {
        self.solve_lower_from(0, v);
    }

    /// v <- L⁻¹ v for v whose entries before `first` are zero.
    fn solve_lower_from(&self, first: usize, v: &mut [f64]) {
        let k = self.k;
        for j in first..k {
            let (head, tail) = v.split_at_mut(j + 1);
            head[j] *= self.inverse_diagonal[j];
            add_scaled(tail, -head[j], &self.factor[j * k + j + 1..][..k - j - 1]);
        }
    }

    /// v <- L⁻ᵀ v.
    pub(super) fn solve_upper(&self, v: &mut [f64]) {
        let k = self.k;
        for j in (0..k).rev() {
            let (head, tail) = v.split_at_mut(j + 1);
            let column = &self.factor[j * k + j + 1..][..k - j - 1];
            head[j] = (head[j] - dot(column, tail)) * self.inverse_diagonal[j];
        }
    }

    /// Row `position` of Z times `scale`.
    pub(super) fn bound_row_into(&self, position: usize, scale: f64, row: &mut [f64]) {
        if position < self.rank {
            for (value, t) in row.iter_mut().zip(self.t_and_c.chunks_exact(self.stride)) {
                *value = scale * t[position];
            }
        } else {
            row.fill(0.0);
            row[position - self.rank] = scale;
        }
    }

    /// Normal of the bound at `position` in the least-distance unknowns, times `scale`.
    pub(super) fn normal_into(&self, position: usize, scale: f64, normal: &mut [f64]) {
        self.bound_row_into(position, scale, normal);
        self.solve_lower_from(position.saturating_sub(self.rank), normal);
    }

    /// dx = Z dv in positions.
    pub(super) fn direction_into(&self, dv: &[f64], dx: &mut [f64]) {
        let (eliminated, rest) = dx.split_at_mut(self.rank);
        eliminated.fill(0.0);
        self.add_t_times(dv, eliminated);
        rest[..self.k].copy_from_slice(dv);
    }

    /// x_B <- c + T x_N for x in positions: removes the drift of updates.
    pub(super) fn complete(&self, x: &mut [f64]) {
        let (eliminated, rest) = x.split_at_mut(self.rank);
        eliminated.copy_from_slice(&self.t_and_c[self.k * self.stride..][..self.rank]);
        self.add_t_times(&rest[..self.k], eliminated);
    }

    /// Sum of the magnitudes x at `position` is made of: |c| + sum |T x_N|, or |x| itself.
    pub(super) fn terms(&self, x: &[f64], position: usize) -> f64 {
        if position >= self.rank {
            return x[position].abs();
        }
        let rest = &x[self.rank..][..self.k];
        let t = |a: usize| self.t_and_c[a * self.stride + position];
        t(self.k).abs()
            + rest
                .iter()
                .enumerate()
                .map(|(a, v)| (t(a) * v).abs())
                .sum::<f64>()
    }

    fn add_t_times(&self, v: &[f64], eliminated: &mut [f64]) {
        let rank = eliminated.len();
        for (value, t) in v.iter().zip(self.t_and_c.chunks_exact(self.stride)) {
            add_scaled(eliminated, *value, &t[..rank]);
        }
    }

    /// Gradient H x + g in the order of the problem for x in positions, from H Z and H x_c + g.
    pub(super) fn gradient_into(&self, x: &[f64], gradient: &mut [f64]) {
        let (n, k) = (self.n, self.k);
        gradient.copy_from_slice(&self.hz[k * n..][..n]);
        for (a, value) in x[self.rank..][..k].iter().enumerate() {
            add_scaled(gradient, *value, &self.hz[a * n..][..n]);
        }
    }

    /// Reduced gradient Zᵀ(H x_c + g) at x_N = 0.
    pub(super) fn initial_gradient_into(&mut self, reduced: &mut [f64]) {
        let hx_c_plus_g = &self.hz[self.k * self.n..][..self.n];
        for (value, &unknown) in self.gathered.iter_mut().zip(&self.order) {
            *value = hx_c_plus_g[unknown];
        }
        self.project(&self.gathered[..self.n], reduced);
    }

    /// Zᵀ times a gradient given in positions.
    pub(super) fn project(&self, gradient: &[f64], reduced: &mut [f64]) {
        let (eliminated, rest) = gradient.split_at(self.rank);
        for ((value, rest), t) in reduced
            .iter_mut()
            .zip(rest)
            .zip(self.t_and_c.chunks_exact(self.stride))
        {
            *value = rest + dot(eliminated, &t[..self.rank]);
        }
    }
}

/// Entries of `source` at `order`, followed by zeros.
fn gather(source: &[f64], order: &[usize], out: &mut [f64]) {
    for (out, &unknown) in out.iter_mut().zip(order) {
        *out = source[unknown];
    }
    out[order.len()..].fill(0.0);
}

fn largest_diagonal(h: &MatRef<'_>) -> f64 {
    (0..h.cols).map(|j| h.col(j)[j]).fold(0.0, f64::max)
}

/// Curvature to compare with where M is zero: that of H itself, else the size of the gradient.
fn fallback_curvature(qp: &Qp<'_>) -> f64 {
    let sizes = [largest_diagonal(&qp.h), max_abs(qp.g)];
    sizes.into_iter().find(|size| *size > 0.0).unwrap_or(1.0)
}
