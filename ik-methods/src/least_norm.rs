//! Least squares of least norm by orthogonal factorisation, in stages of priority.
//!
//! A stage holds rows `F u + C x = y`: the unknowns u are free (they cost nothing), the unknowns x cost their length. It
//! answers
//! ```text
//! minimise ‖F u + C x − y‖² + λ² ‖x‖²   over u, x;   with λ = 0 the shortest x among the least squares
//! ```
//! in two orthogonal factorisations. Householder reflections from the left make F upper triangular; the rows below no
//! longer contain u, they are the left null space of F times the rows (Campos, Guenther & Martins 2005 call it the
//! elimination of the columns that are not wanted). Householder reflections from the right make what is left of C lower
//! triangular, `C Q = [L 0]`, rows pivoted by length: `x = Q [w; z]` with `L w = y`, and z is what the stage leaves
//! free. The next stage of priority ([`Stage::follow`]) is written in z and the u that are left, and so cannot disturb
//! this one.
//!
//! What is left after an elimination may be rounding alone and is no measure of itself: pivots are compared with the rows
//! as they came in, and there are never more of them than the rows can have at a posture without symmetry.
//!
//! Rows are stored `[F | C | y]`, one after the other.

/// Hard rows whose [`Stage::independence`] is below this are damped. It is never less than the inverse of the condition
/// number, so that nothing is damped below one of 1e5; there a twist of 1 mm/s asks for some 1e2 rad/s.
pub(crate) const DEPENDENT: f64 = 1e-5;
/// Pivots below this part of the longest row have no number in them. The last direction of a nearly straight limb is
/// damped, but never dropped before: with it dropped, the limb stays straight for good (bioloid/squat z190).
pub(crate) const DROP: f64 = f64::EPSILON;
/// The same at the postures at which ranks are counted: independent rows stay far above, rounding far below.
pub(crate) const DROP_AT_GENERIC_POSTURE: f64 = 1e-9;
/// Free columns below this part of the largest are dependent on the others: unknowns that the rows hardly see would take
/// rates of a million times what is asked for.
const FREE_DEPENDENT: f64 = 1e-6;
/// Rows shorter than this (m, rad) are no rows: a frame on the axes that should move it, or a weight that weighs nothing.
const SHORTEST: f64 = 1e-12;
/// Free unknowns there can be: the six of a root.
pub(crate) const MOST_FREE: usize = 6;

/// Ranks of the two parts of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Ranks {
    /// Of F.
    pub(crate) free: usize,
    /// Of C below F.
    pub(crate) costed: usize,
}

impl Ranks {
    /// None at all.
    pub(crate) const NONE: Self = Self { free: 0, costed: 0 };

    /// The larger of each.
    pub(crate) fn max(self, other: Self) -> Self {
        Self {
            free: self.free.max(other.free),
            costed: self.costed.max(other.costed),
        }
    }
}

/// Rows of one priority and their factorisation. Sized once; nothing here allocates afterwards.
#[derive(Clone, Debug)]
pub(crate) struct Stage {
    free: usize,
    costed: usize,
    width: usize,
    height: usize,
    rows: Vec<f64>,
    /// Ranks the rows can have.
    most: Ranks,
    /// Length of the longest column of F and of the longest row of C as they came in.
    free_scale: f64,
    row_scale: f64,
    /// Column of F that stands at each place after pivoting.
    order: Vec<usize>,
    /// Ranks found.
    found: Ranks,
    /// Reflection k from the right is `1 − factors[k] v vᵀ`, v at `reflections[k * costed..]`.
    reflections: Vec<f64>,
    factors: Vec<f64>,
    /// The part of x that the stage decides, in the coordinates of Q.
    decided: Vec<f64>,
    /// A row's worth of sums.
    sums: Vec<f64>,
    /// The small least-squares problem `[L; λ 1] w = [y; 0]`.
    small: Vec<f64>,
}

impl Stage {
    /// Room for `height` rows in `free` free and `costed` costed unknowns, whose ranks can be as large as that allows.
    pub(crate) fn new(height: usize, free: usize, costed: usize) -> Self {
        let width = free + costed + 1;
        let most = height.min(costed);
        Self {
            free,
            costed,
            width,
            height,
            rows: vec![0.0; height * width],
            most: Ranks {
                free: free.min(height),
                costed: most,
            },
            free_scale: 0.0,
            row_scale: 0.0,
            order: (0..free).collect(),
            found: Ranks::NONE,
            reflections: vec![0.0; most * costed],
            factors: vec![0.0; most],
            decided: vec![0.0; most],
            sums: vec![0.0; width],
            small: vec![0.0; (height + most) * (most + 1)],
        }
    }

    /// Sets the ranks the rows can have, known from postures without symmetry.
    pub(crate) fn cap(&mut self, most: Ranks) {
        self.most = most;
    }

    /// Ranks the rows can have.
    pub(crate) fn most(&self) -> Ranks {
        self.most
    }

    /// Ranks found by the last factorisation.
    pub(crate) fn found(&self) -> Ranks {
        self.found
    }

    /// Whether there are rows at all.
    pub(crate) fn is_empty(&self) -> bool {
        self.height == 0
    }

    /// Length of the longest row of C as it came in.
    pub(crate) fn row_scale(&self) -> f64 {
        self.row_scale
    }

    /// Zeroes the rows and hands them out to be filled, `[F | C | y]` each.
    pub(crate) fn clear(&mut self, free: usize, costed: usize) -> &mut [f64] {
        (self.free, self.costed, self.width) = (free, costed, free + costed + 1);
        let rows = &mut self.rows[..self.height * self.width];
        rows.fill(0.0);
        rows
    }

    /// Factorises rows that were filled in by the caller. Rows of C whose pivot is below `drop` of the longest row are left
    /// out.
    pub(crate) fn factorise(&mut self, drop: f64) {
        (self.free_scale, self.row_scale) =
            scales(&self.rows[..self.height * self.width], self.free, self.width);
        self.factorise_followed(drop);
    }

    /// Factorises rows that [`Stage::follow`] wrote, as [`Stage::factorise`] does.
    pub(crate) fn factorise_followed(&mut self, drop: f64) {
        self.eliminate_free();
        self.triangulate(drop);
    }

    /// F upper triangular by reflections from the left, columns pivoted by length.
    fn eliminate_free(&mut self) {
        for (place, column) in self.order[..self.free].iter_mut().enumerate() {
            *column = place;
        }
        self.found.free = 0;
        let w = self.width;
        for k in 0..self.most.free.min(self.free).min(self.height) {
            let square = |c: usize| {
                let column = self.rows[k * w..self.height * w].iter().skip(c).step_by(w);
                column.map(|x| x * x).sum::<f64>()
            };
            let (best, square) = longest((k..self.free).map(|c| (c, square(c))), k);
            let norm = square.sqrt();
            if norm <= FREE_DEPENDENT * self.free_scale {
                break;
            }
            self.order.swap(k, best);
            for row in self.rows[..self.height * w].chunks_exact_mut(w) {
                row.swap(k, best);
            }
            self.reflect_rows(k, norm);
            self.found.free += 1;
        }
    }

    /// Reflects rows k … so that column k has `norm` (up to sign) in row k and zeros below.
    fn reflect_rows(&mut self, k: usize, norm: f64) {
        let (w, h) = (self.width, self.height);
        let rows = &mut self.rows[k * w..h * w];
        let head = rows[k];
        let pivot = -norm.copysign(head);
        // The reflector is column k with `head − pivot` at its head; it stays there until it has been applied.
        rows[k] = head - pivot;
        let factor = 1.0 / (norm * (norm + head.abs()));
        let sums = &mut self.sums[k + 1..w];
        sums.fill(0.0);
        for row in rows.chunks_exact(w) {
            let v = row[k];
            sums.iter_mut().zip(&row[k + 1..]).for_each(|(s, x)| *s += v * x);
        }
        for row in rows.chunks_exact_mut(w) {
            let v = factor * row[k];
            row[k] = 0.0;
            row[k + 1..].iter_mut().zip(&*sums).for_each(|(x, s)| *x -= v * s);
        }
        rows[k] = pivot;
    }

    /// C below F lower triangular by reflections from the right, rows pivoted by length.
    fn triangulate(&mut self, drop: f64) {
        let (f, n, w) = (self.free, self.costed, self.width);
        self.found.costed = 0;
        let below = &mut self.rows[self.found.free * w..self.height * w];
        let height = below.len() / w;
        for k in 0..self.most.costed.min(n).min(height) {
            let square = |row: &[f64]| row[f + k..f + n].iter().map(|x| x * x).sum::<f64>();
            let lengths = below.chunks_exact(w).map(square).enumerate().skip(k);
            let (best, square) = longest(lengths, k);
            let norm = square.sqrt();
            if norm <= drop * self.row_scale.max(SHORTEST) {
                break;
            }
            swap_rows(below, w, k, best);
            let (done, rest) = below.split_at_mut((k + 1) * w);
            let row = &mut done[k * w + f + k..k * w + f + n];
            let pivot = -norm.copysign(row[0]);
            let v = &mut self.reflections[k * n + k..(k + 1) * n];
            v.copy_from_slice(row);
            v[0] -= pivot;
            self.factors[k] = 1.0 / (norm * (norm + row[0].abs()));
            row.fill(0.0);
            row[0] = pivot;
            for row in rest.chunks_exact_mut(w) {
                reflect(v, self.factors[k], &mut row[f + k..f + n]);
            }
            self.found.costed += 1;
        }
    }

    /// The rows of C below F, and their number.
    fn below(&self) -> (&[f64], usize) {
        let rows = &self.rows[self.found.free * self.width..self.height * self.width];
        (rows, self.height - self.found.free)
    }

    /// How far the rows are from dependence: `√rank / (‖C⁺‖ scale)` in the Frobenius norm, C being what is below F and
    /// scale the length of its longest row as it came in. That is the harmonic mean square of the singular values over the
    /// scale: 1 for orthogonal rows of one length, continuous in the rows, between σ_min and √rank σ_min over the scale. 1
    /// without rows, 0 where a rank is less than it can be.
    pub(crate) fn independence(&mut self) -> f64 {
        let (f, w, r) = (self.free, self.width, self.found.costed);
        let possible = self
            .most
            .costed
            .min(self.costed)
            .min(self.height - self.found.free);
        if self.found.free < self.most.free.min(self.free) || r < possible {
            return 0.0;
        }
        if r == 0 {
            return 1.0;
        }
        let below = &self.rows[self.found.free * w..];
        let (column, mut squares) = (&mut self.decided, 0.0);
        for k in 0..r {
            for i in k..r {
                let row = &below[i * w + f..i * w + f + i + 1];
                let known: f64 = row[k..i].iter().zip(&column[k..i]).map(|(l, x)| l * x).sum();
                let one = if i == k { 1.0 } else { 0.0 };
                column[i] = (one - known) / row[i];
                squares += column[i] * column[i];
            }
        }
        #[allow(clippy::cast_precision_loss, reason = "a small rank")]
        let rank = r as f64;
        (rank / squares).sqrt() / self.row_scale
    }

    /// Decides what the stage decides, damped by λ; returns the Euclidean norm of what its rows then miss.
    pub(crate) fn decide(&mut self, damping: f64) -> f64 {
        let (f, n, w, r) = (self.free, self.costed, self.width, self.found.costed);
        let (below, height) = (
            &self.rows[self.found.free * w..self.height * w],
            self.height - self.found.free,
        );
        if damping == 0.0 && height == r {
            for i in 0..r {
                let row = &below[i * w..(i + 1) * w];
                let known: f64 = row[f..f + i].iter().zip(&self.decided).map(|(l, x)| l * x).sum();
                self.decided[i] = (row[f + n] - known) / row[f + i];
            }
            return 0.0;
        }
        self.decide_by_least_squares(damping);
        let (below, _) = self.below();
        let missed = below.chunks_exact(w).map(|row| {
            let made: f64 = row[f..f + r].iter().zip(&self.decided).map(|(l, x)| l * x).sum();
            (made - row[f + n]).powi(2)
        });
        missed.sum::<f64>().sqrt()
    }

    /// `minimise ‖L w − y‖² + λ² ‖w‖²` by reflections of `[L y; λ1 0]` from the left.
    fn decide_by_least_squares(&mut self, damping: f64) {
        let (f, n, w, r) = (self.free, self.costed, self.width, self.found.costed);
        let below = &self.rows[self.found.free * w..self.height * w];
        let (height, width) = (below.len() / w + r, r + 1);
        let small = &mut self.small[..height * width];
        small.fill(0.0);
        for (to, row) in small.chunks_exact_mut(width).zip(below.chunks_exact(w)) {
            to[..r].copy_from_slice(&row[f..f + r]);
            to[r] = row[f + n];
        }
        for k in 0..r {
            small[(height - r + k) * width + k] = damping;
        }
        for k in 0..r {
            let square: f64 = small[k * width + k..].iter().step_by(width).map(|x| x * x).sum();
            let (norm, head) = (square.sqrt(), small[k * width + k]);
            let pivot = -norm.copysign(head);
            let factor = 1.0 / (norm * (norm + head.abs()));
            small[k * width + k] -= pivot;
            for c in k + 1..width {
                let mut sum = 0.0;
                for row in small[k * width..].chunks_exact(width) {
                    sum += row[k] * row[c];
                }
                for row in small[k * width..].chunks_exact_mut(width) {
                    row[c] -= factor * sum * row[k];
                }
            }
            small[k * width + k] = pivot;
        }
        for k in (0..r).rev() {
            let row = &small[k * width..(k + 1) * width];
            let known: f64 = row[k + 1..r]
                .iter()
                .zip(&self.decided[k + 1..])
                .map(|(a, x)| a * x)
                .sum();
            self.decided[k] = (row[r] - known) / row[k];
        }
    }

    /// Unknowns that this stage leaves: free ones, costed ones.
    pub(crate) fn left(&self) -> (usize, usize) {
        (self.free - self.found.free, self.costed - self.found.costed)
    }

    /// Writes rows of the next priority, given in the unknowns of this stage (`[F | C | y]`, this stage's width), into
    /// `next` in the unknowns this stage leaves. The given rows are used up.
    pub(crate) fn follow(&self, rows: &mut [f64], next: &mut Self) {
        let (f, n, w, r) = (self.free, self.costed, self.width, self.found.costed);
        (next.free_scale, next.row_scale) = scales(rows, f, w);
        let (free, costed) = self.left();
        let to = next.clear(free, costed);
        for (row, to) in rows
            .chunks_exact_mut(w)
            .zip(to.chunks_exact_mut(free + costed + 1))
        {
            self.sort_free(row);
            for k in 0..self.found.free {
                let top = &self.rows[k * w..(k + 1) * w];
                let factor = row[k] / top[k];
                row[k..]
                    .iter_mut()
                    .zip(&top[k..])
                    .for_each(|(x, t)| *x -= factor * t);
            }
            for k in 0..r {
                let v = &self.reflections[k * n + k..(k + 1) * n];
                reflect(v, self.factors[k], &mut row[f + k..f + n]);
            }
            let made: f64 = row[f..f + r].iter().zip(&self.decided).map(|(c, x)| c * x).sum();
            to[..free].copy_from_slice(&row[self.found.free..f]);
            to[free..free + costed].copy_from_slice(&row[f + r..f + n]);
            to[free + costed] = row[f + n] - made;
        }
    }

    /// Brings the free part of a row into the pivoted order.
    fn sort_free(&self, row: &mut [f64]) {
        let mut sorted = [0.0; MOST_FREE];
        for (s, &column) in sorted.iter_mut().zip(&self.order[..self.free]) {
            *s = row[column];
        }
        row[..self.free].copy_from_slice(&sorted[..self.free]);
    }

    /// Writes u and x; on entry they hold, in front, what the stages after this one decided of what it left.
    pub(crate) fn finish(&self, u: &mut [f64], x: &mut [f64]) {
        let (f, n, w, r) = (self.free, self.costed, self.width, self.found.costed);
        x.copy_within(..n - r, r);
        x[..r].copy_from_slice(&self.decided[..r]);
        for k in (0..r).rev() {
            let v = &self.reflections[k * n + k..(k + 1) * n];
            reflect(v, self.factors[k], &mut x[k..n]);
        }
        let mut pivoted = [0.0; MOST_FREE];
        pivoted[self.found.free..f].copy_from_slice(&u[..f - self.found.free]);
        for k in (0..self.found.free).rev() {
            let row = &self.rows[k * w..(k + 1) * w];
            let costed: f64 = row[f..f + n].iter().zip(&x[..n]).map(|(c, x)| c * x).sum();
            let known: f64 = row[k + 1..f]
                .iter()
                .zip(&pivoted[k + 1..])
                .map(|(c, u)| c * u)
                .sum();
            pivoted[k] = (row[f + n] - costed - known) / row[k];
        }
        for (&column, value) in self.order[..f].iter().zip(pivoted) {
            u[column] = value;
        }
    }
}

/// The part of its full value that a damping has at this independence; none from the threshold on (Nakamura & Hanafusa
/// 1986), so that nothing is distorted away from singularities.
pub(crate) fn fade(independence: f64, threshold: f64) -> f64 {
    let near = independence / threshold;
    (1.0 - near * near).max(0.0).sqrt()
}

/// Length of the longest column of F and of the longest row of C of rows `[F | C | y]`.
fn scales(rows: &[f64], free: usize, width: usize) -> (f64, f64) {
    let mut columns = [0.0; MOST_FREE];
    let mut longest = 0.0_f64;
    for row in rows.chunks_exact(width) {
        for (square, x) in columns.iter_mut().zip(&row[..free]) {
            *square += x * x;
        }
        longest = longest.max(row[free..width - 1].iter().map(|x| x * x).sum());
    }
    (columns.into_iter().fold(0.0, f64::max).sqrt(), longest.sqrt())
}

/// The largest of numbered squares; number `first` if none is a number.
fn longest(squares: impl Iterator<Item = (usize, f64)>, first: usize) -> (usize, f64) {
    squares.fold((first, f64::NAN), |best, next| {
        if best.1.is_nan() || next.1 > best.1 {
            next
        } else {
            best
        }
    })
}

/// `row ← row (1 − s v vᵀ)`.
#[inline]
fn reflect(v: &[f64], factor: f64, row: &mut [f64]) {
    let sum = factor * v.iter().zip(&*row).map(|(v, x)| v * x).sum::<f64>();
    row.iter_mut().zip(v).for_each(|(x, v)| *x -= sum * v);
}

fn swap_rows(rows: &mut [f64], width: usize, a: usize, b: usize) {
    if a != b {
        let (head, tail) = rows.split_at_mut(a.max(b) * width);
        head[a.min(b) * width..][..width].swap_with_slice(&mut tail[..width]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// Numbers in ±1 from a seed (SplitMix64).
    fn numbers(seed: u64, count: usize) -> Vec<f64> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        (0..count).map(|_| next()).collect()
    }

    struct Case {
        f: DMatrix<f64>,
        c: DMatrix<f64>,
        y: DVector<f64>,
    }

    fn case(seed: u64, m: usize, f: usize, n: usize) -> Case {
        Case {
            f: DMatrix::from_row_slice(m, f, &numbers(seed, m * f)),
            c: DMatrix::from_row_slice(m, n, &numbers(seed + 1000, m * n)),
            y: DVector::from_vec(numbers(seed + 2000, m)),
        }
    }

    fn rows(case: &Case) -> Vec<f64> {
        let row = |i: usize| {
            let (f, c) = (case.f.row(i), case.c.row(i));
            f.iter()
                .chain(c.iter())
                .copied()
                .chain([case.y[i]])
                .collect::<Vec<_>>()
        };
        (0..case.y.len()).flat_map(row).collect()
    }

    fn stage(case: &Case) -> Stage {
        let (m, f, n) = (case.y.len(), case.f.ncols(), case.c.ncols());
        let mut stage = Stage::new(m, f, n);
        stage.clear(f, n).copy_from_slice(&rows(case));
        stage
    }

    fn answer(stage: &Stage, f: usize, n: usize) -> (DVector<f64>, DVector<f64>) {
        let (mut u, mut x) = (vec![0.0; f], vec![0.0; n]);
        stage.finish(&mut u, &mut x);
        (DVector::from_vec(u), DVector::from_vec(x))
    }

    /// Oracle: W of the left null space of F by SVD, then the damped pseudo-inverse of W C.
    fn oracle(case: &Case, damping: f64) -> DVector<f64> {
        let (m, f) = (case.y.len(), case.f.ncols());
        let full = DMatrix::from_fn(m, m.max(f), |i, j| if j < f { case.f[(i, j)] } else { 0.0 });
        let svd = full.svd(true, false);
        let (u, s) = (svd.u.unwrap(), svd.singular_values);
        let null: Vec<usize> = (0..m).filter(|&i| s[i] < 1e-10).collect();
        if null.is_empty() {
            return DVector::zeros(case.c.ncols());
        }
        let w = DMatrix::from_fn(null.len(), m, |i, j| u[(j, null[i])]);
        let (a, y) = (&w * &case.c, &w * &case.y);
        let svd = a.svd(true, true);
        let (u, s, vt) = (svd.u.unwrap(), svd.singular_values, svd.v_t.unwrap());
        let filtered = (u.transpose() * y).zip_map(&s, |y, s| {
            if s > 1e-9 {
                y * s / (s * s + damping * damping)
            } else {
                0.0
            }
        });
        vt.transpose() * filtered
    }

    #[test]
    fn square_redundant_overdetermined_and_damped_stages_agree_with_singular_values() {
        for seed in 0..40 {
            for (m, f, n) in [
                (6, 0, 6),
                (5, 0, 9),
                (9, 0, 5),
                (12, 6, 8),
                (15, 6, 12),
                (4, 6, 3),
                (1, 0, 1),
            ] {
                for damping in [0.0, 1e-3, 0.3] {
                    let case = case(seed, m, f, n);
                    let mut stage = stage(&case);
                    stage.factorise(f64::EPSILON);
                    assert!(stage.independence() > 0.0);
                    stage.decide(damping);
                    let (u, x) = answer(&stage, f, n);
                    let expected = oracle(&case, damping);
                    let scale = 1.0 + expected.amax();
                    assert!(
                        (&x - &expected).amax() < 1e-9 * scale,
                        "{seed} {m} {f} {n} {damping}"
                    );
                    // With x given, u is the least-squares solution.
                    let residual = &case.f * u + &case.c * x - &case.y;
                    assert!(case.f.tr_mul(&residual).amax() < 1e-9 * scale);
                }
            }
        }
    }

    #[test]
    fn dependent_rows_are_noticed_and_solved_in_the_least_squares_sense() {
        for seed in 0..20 {
            let mut case = case(seed, 5, 0, 7);
            let copy = case.c.row(1) * 2.0;
            case.c.row_mut(4).copy_from(&copy);
            let mut stage = stage(&case);
            stage.factorise(1e-12);
            assert!(stage.independence() < 1e-300);
            let missed = stage.decide(0.0);
            let (_, x) = answer(&stage, 0, 7);
            assert!((&x - oracle(&case, 0.0)).amax() < 1e-8);
            assert!(((&case.c * x - &case.y).norm() - missed).abs() < 1e-10);
        }
    }

    #[test]
    fn a_second_stage_does_not_disturb_the_first_and_is_best_among_what_is_left() {
        for seed in 0..20 {
            for (hard, soft) in [((9, 6, 8), 3), ((4, 6, 8), 5), ((6, 0, 10), 6), ((0, 6, 5), 8)] {
                let (m, f, n) = hard;
                let (first, second) = (case(seed, m, f, n), case(seed + 77, soft, f, n));
                let mut a = stage(&first);
                a.factorise(f64::EPSILON);
                a.decide(0.0);
                let mut b = Stage::new(soft, f, n);
                a.follow(&mut rows(&second), &mut b);
                b.factorise_followed(f64::EPSILON);
                let missed = b.decide(0.0);
                let (mut u, mut x) = (vec![0.0; f], vec![0.0; n]);
                b.finish(&mut u, &mut x);
                a.finish(&mut u, &mut x);
                let (u, x) = (DVector::from_vec(u), DVector::from_vec(x));
                assert!((&first.f * &u + &first.c * &x - &first.y).amax() < 1e-9);
                let residual = &second.f * &u + &second.c * &x - &second.y;
                assert!((residual.norm() - missed).abs() < 1e-9, "{hard:?} {soft}");
                // Optimal: the gradient is orthogonal to the null space of the first stage.
                let joint = DMatrix::from_fn(m, f + n, |i, j| {
                    if j < f {
                        first.f[(i, j)]
                    } else {
                        first.c[(i, j - f)]
                    }
                });
                let other = DMatrix::from_fn(soft, f + n, |i, j| {
                    if j < f {
                        second.f[(i, j)]
                    } else {
                        second.c[(i, j - f)]
                    }
                });
                let gradient = other.tr_mul(&residual);
                let identity = DMatrix::identity(f + n, f + n);
                let projector = match m {
                    0 => identity,
                    _ => identity - joint.clone().pseudo_inverse(1e-10).unwrap() * &joint,
                };
                assert!((projector * gradient).amax() < 1e-8, "{hard:?} {soft}");
            }
        }
    }
}
