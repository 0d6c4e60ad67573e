//! # The working set and its factor
//!
//! Bounds held as equalities, with the thin factorisation G_W = Q R of their normals (columns) in the
//! least-distance unknowns: Q has orthonormal columns, R is upper triangular. Columns are appended by
//! Gram–Schmidt with one reorthogonalisation, which is as stable as Householder, and removed by plane
//! rotations (Daniel, Gragg, Kaufman & Stewart, Math. Comp. 30, 1976).

use super::kernels::{add_scaled, dot};

/// A normal is dependent on the working set when less than this fraction of it is left outside their span.
///
/// A bound that independent would still move the point by its violation times 1e11: with violations no
/// smaller than 1e-12 of the point, farther than the point is from the origin.
const DEPENDENT_NORMAL: f64 = 1e-11;

/// Working set with multipliers.
#[derive(Clone, Debug)]
pub(super) struct WorkingSet {
    k: usize,
    /// Position of each member.
    pub(super) positions: Vec<usize>,
    /// +1: held at the lower bound, -1: at the upper.
    pub(super) signs: Vec<f64>,
    /// Multiplier, non-negative in the end unless both bounds coincide.
    pub(super) multipliers: Vec<f64>,
    /// Member whose bounds coincide: its multiplier may have either sign.
    pub(super) fixed: Vec<bool>,
    /// Per position: is it a member.
    pub(super) is_member: Vec<bool>,
    /// k x w, stride k.
    q: Vec<f64>,
    /// w x w, stride k.
    r: Vec<f64>,
}

impl WorkingSet {
    pub(super) fn new(n: usize) -> Self {
        Self {
            k: 0,
            positions: Vec::with_capacity(n),
            signs: Vec::with_capacity(n),
            multipliers: Vec::with_capacity(n),
            fixed: Vec::with_capacity(n),
            is_member: vec![false; n],
            q: vec![0.0; n * n],
            r: vec![0.0; n * n],
        }
    }

    /// Empties the set, for problems with `k` reduced unknowns.
    pub(super) fn clear(&mut self, k: usize) {
        self.k = k;
        self.positions.clear();
        self.signs.clear();
        self.multipliers.clear();
        self.fixed.clear();
        self.is_member.fill(false);
    }

    pub(super) fn len(&self) -> usize {
        self.positions.len()
    }

    /// Splits `normal` into Q `inside` + `outside`; returns |outside|², 0 if it is dependent.
    pub(super) fn split(&self, normal: &[f64], inside: &mut [f64], outside: &mut [f64]) -> f64 {
        let w = self.len();
        outside.copy_from_slice(normal);
        let norm_sq = dot(normal, normal);
        if w == 0 {
            return norm_sq;
        }
        inside[..w].fill(0.0);
        self.remove_span(inside, outside);
        self.remove_span(inside, outside);
        if w == self.k {
            return 0.0;
        }
        let rest_sq = dot(outside, outside);
        if rest_sq > DEPENDENT_NORMAL * DEPENDENT_NORMAL * norm_sq {
            rest_sq
        } else {
            0.0
        }
    }

    /// One pass of Gram–Schmidt: inside += Qᵀ outside, outside <- (I - Q Qᵀ) outside.
    fn remove_span(&self, inside: &mut [f64], outside: &mut [f64]) {
        for (inside, q) in inside[..self.len()]
            .iter_mut()
            .zip(self.q.chunks_exact(self.k.max(1)))
        {
            let part = dot(q, outside);
            *inside += part;
            add_scaled(outside, -part, q);
        }
    }

    /// Appends a bound whose normal was split into `inside` and `outside`, |outside| = `rest`.
    pub(super) fn push(&mut self, member: Member, inside: &[f64], outside: &[f64], rest: f64) {
        let (k, w) = (self.k, self.len());
        for (q, value) in self.q[w * k..][..k].iter_mut().zip(outside) {
            *q = value / rest;
        }
        let column = &mut self.r[w * k..][..w + 1];
        column[..w].copy_from_slice(&inside[..w]);
        column[w] = rest;
        self.positions.push(member.position);
        self.signs.push(member.sign);
        self.multipliers.push(member.multiplier);
        self.fixed.push(member.fixed);
        self.is_member[member.position] = true;
    }

    /// Removes member number `j` and restores the triangle by plane rotations.
    pub(super) fn remove(&mut self, j: usize) {
        let (k, w) = (self.k, self.len());
        self.is_member[self.positions[j]] = false;
        self.positions.remove(j);
        self.signs.remove(j);
        self.multipliers.remove(j);
        self.fixed.remove(j);
        for column in j + 1..w {
            self.r
                .copy_within(column * k..column * k + column + 1, (column - 1) * k);
        }
        for i in j..w - 1 {
            let (a, b) = (self.r[i * k + i], self.r[i * k + i + 1]);
            let length = a.hypot(b);
            let (cos, sin) = (a / length, b / length);
            for column in self.r.chunks_exact_mut(k).take(w - 1).skip(i) {
                (column[i], column[i + 1]) = (
                    cos * column[i] + sin * column[i + 1],
                    cos * column[i + 1] - sin * column[i],
                );
            }
            let (left, right) = self.q.split_at_mut((i + 1) * k);
            for (left, right) in left[i * k..].iter_mut().zip(&mut right[..k]) {
                (*left, *right) = (cos * *left + sin * *right, cos * *right - sin * *left);
            }
        }
    }

    /// v <- R⁻¹ v.
    pub(super) fn solve_r(&self, v: &mut [f64]) {
        for j in (0..self.len()).rev() {
            let column = &self.r[j * self.k..][..j + 1];
            let (head, tail) = v.split_at_mut(j);
            tail[0] /= column[j];
            add_scaled(head, -tail[0], column);
        }
    }

    /// v <- R⁻ᵀ v.
    pub(super) fn solve_r_transposed(&self, v: &mut [f64]) {
        for j in 0..self.len() {
            let column = &self.r[j * self.k..][..j + 1];
            v[j] = (v[j] - dot(&column[..j], &v[..j])) / column[j];
        }
    }

    /// out += Q v.
    pub(super) fn add_q_times(&self, v: &[f64], out: &mut [f64]) {
        for (value, q) in v[..self.len()].iter().zip(self.q.chunks_exact(self.k.max(1))) {
            add_scaled(out, *value, q);
        }
    }

    /// Qᵀ v.
    pub(super) fn q_transposed_times(&self, v: &[f64], out: &mut [f64]) {
        for (out, q) in out[..self.len()]
            .iter_mut()
            .zip(self.q.chunks_exact(self.k.max(1)))
        {
            *out = dot(q, v);
        }
    }
}

/// A bound about to join the working set.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member {
    pub(super) position: usize,
    pub(super) sign: f64,
    pub(super) multiplier: f64,
    pub(super) fixed: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic numbers in [-1, 1] without structure.
    fn normal(k: usize, index: usize) -> Vec<f64> {
        (0..k)
            .map(|i| ((i * 7 + index * 13 + i * index) as f64 * 1.618).sin())
            .collect()
    }

    fn push(set: &mut WorkingSet, k: usize, index: usize) -> bool {
        let (mut inside, mut outside) = (vec![0.0; k], vec![0.0; k]);
        let rest_sq = set.split(&normal(k, index), &mut inside, &mut outside);
        if rest_sq > 0.0 {
            let member = Member {
                position: index,
                sign: 1.0,
                multiplier: 0.0,
                fixed: false,
            };
            set.push(member, &inside, &outside, rest_sq.sqrt());
        }
        rest_sq > 0.0
    }

    /// Qᵀ Q = I and Q R = the normals, after additions and removals.
    #[test]
    fn factor_survives_changes() {
        let k = 6;
        let mut set = WorkingSet::new(20);
        set.clear(k);
        for (add, remove) in [
            (0, None),
            (1, None),
            (2, Some(0)),
            (3, None),
            (4, Some(1)),
            (5, None),
            (6, Some(2)),
        ] {
            assert!(push(&mut set, k, add));
            if let Some(j) = remove {
                set.remove(j);
            }
        }
        assert_eq!(set.positions, [1, 3, 5, 6]);
        for (j, &position) in set.positions.iter().enumerate() {
            let mut product = vec![0.0; k];
            set.add_q_times(
                &set.r[j * k..][..j + 1]
                    .iter()
                    .copied()
                    .chain([0.0; 6])
                    .collect::<Vec<_>>(),
                &mut product,
            );
            for (value, expected) in product.iter().zip(normal(k, position)) {
                assert!((value - expected).abs() < 1e-14);
            }
            for i in 0..set.len() {
                let inner = dot(&set.q[i * k..][..k], &set.q[j * k..][..k]);
                assert!((inner - if i == j { 1.0 } else { 0.0 }).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn dependent_normals_are_recognised() {
        let k = 3;
        let mut set = WorkingSet::new(20);
        set.clear(k);
        assert!(push(&mut set, k, 0) && push(&mut set, k, 1));
        let (mut inside, mut outside) = (vec![0.0; k], vec![0.0; k]);
        let combined: Vec<f64> = normal(k, 0)
            .iter()
            .zip(normal(k, 1))
            .map(|(a, b)| 2.0 * a - b)
            .collect();
        assert!(set.split(&combined, &mut inside, &mut outside) <= 0.0);
        assert!(push(&mut set, k, 2));
        assert!(!push(&mut set, k, 3), "the space is full");
    }
}
