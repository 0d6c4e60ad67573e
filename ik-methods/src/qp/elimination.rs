//! # Elimination of the equality rows
//!
//! Gaussian elimination of A x = b with the pivot of each row chosen among its columns,
//!
//! ```text
//! P A Q = L U,    U unit upper trapezoidal with bounded entries,    L lower trapezoidal,
//! ```
//!
//! the transposed twin of LU with partial pivoting and as stable (Golub & Van Loan, Matrix Computations,
//! 4th ed., 3.4). It splits the unknowns into pivots B and the rest N, with x_B = c + T x_N.
//!
//! Rows whose remainder has become small are put off until the others are done and are then taken in the
//! order of their size (complete pivoting among them); what is left at rounding level is dependent.
//!
//! Storage is by rows, padded to whole blocks: place 0 of a row is its right-hand side, place j + 1 belongs to
//! unknown j. Nothing is swapped between columns: a row of U is zero at the unknowns eliminated before, so
//! subtracting it leaves the entries of L there untouched.

use std::ops::Range;

use super::kernels::{GROUP, LANES, padded, subtract_scaled_blocks, subtract_scaled_group};
use super::{MatRef, Qp};

/// A row is put off when its largest remaining entry falls below this fraction of its original 1-norm.
///
/// Heuristic: late enough that ordinary rows keep their order, early enough that the rows before lose no
/// more than these four digits to a nearly dependent one.
const POSTPONED: f64 = 1e-4;

/// A row is dependent when its largest remaining entry is below this fraction of its original 1-norm.
///
/// Unknowns are metres and radians and move by less than 1, in tracking by some 0.02: leaving out such a remainder
/// misses the row by about 2e-9 of its scale. Meeting it instead would amplify rounding by 1e7 and more. A posture on a
/// singularity to the last step tolerance (1e-9 rad) leaves remainders of that order, with and without rounding.
pub(super) const DEPENDENT: f64 = 1e-7;

/// The same for a second attempt, where the first one lost its accuracy.
pub(super) const NEARLY_DEPENDENT: f64 = 1e-5;

/// A dependent row holds when its reduced right-hand side is below this fraction of the row's own terms, or below
/// [`SHARE`] of the remainder that was left out.
const CONSISTENT: f64 = 1e-10;

/// Part of the largest remainder left out (times a motion of size 1) that a dependent row may miss.
const SHARE: f64 = 1e-3;

/// Weight of a bounded unknown in the choice of the pivot; unknowns without bounds count fully.
///
/// Pivots without bounds can never become active. The factor limits entries of U to 1 / 0.25 (threshold
/// pivoting); growth stays harmless in practice up to about 10 (Duff, Erisman & Reid, Direct Methods for Sparse Matrices).
const BOUNDED_WEIGHT: f64 = 0.25;

/// Bits of a pivot key that hold the index of the candidate instead of the tail of its magnitude.
const INDEX_MASK: u64 = 0xFFF;

/// The other bits, without the sign.
const MAGNITUDE_MASK: u64 = !INDEX_MASK & (u64::MAX >> 1);

/// Largest number of unknowns the pivot keys can index.
pub(super) const MAX_UNKNOWNS: usize = INDEX_MASK as usize;

/// Result of [`Elimination::run`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rows {
    /// All rows are eliminated or redundant.
    Consistent,
    /// A dependent row contradicts the others.
    Contradictory,
    /// Some entry of A or b is not finite.
    NotFinite,
}

/// Workspace and factors.
#[derive(Clone, Debug)]
pub(super) struct Elimination {
    dependent: f64,
    m: usize,
    n: usize,
    /// Padded length of a row.
    ld: usize,
    /// [b A] while it is eliminated; L stays at the places of the pivots.
    lower: Vec<f64>,
    /// Rows of U without their unit diagonal.
    upper: Vec<f64>,
    /// Reciprocal of the diagonal of L.
    inverse_pivot: Vec<f64>,
    /// Pivot preference of each place, 0 if it cannot be a pivot.
    weight: Vec<f64>,
    /// 1 at places still alive (unknowns not eliminated and the right-hand side), else 0.
    alive: Vec<f64>,
    /// 0, 1, 2, ...: places as bits of pivot keys.
    place_bits: Vec<u64>,
    /// Unknown eliminated in each step: B.
    pub(super) pivots: Vec<usize>,
    /// Unknowns not eliminated: N.
    pub(super) remaining: Vec<usize>,
    /// Place of the right-hand side, then of N, then 0 up to a whole number of blocks.
    kept_places: Vec<usize>,
    /// Original index of each row in its current place.
    rows: Vec<usize>,
    /// 1-norm of each row of A, moving with the row.
    row_scale: Vec<f64>,
    /// A column of zeros: the padding of the rows.
    zeros: Vec<f64>,
    /// Rows of (c, -T), some blocks at a time; later the right-hand side of the multipliers, by place.
    solution: Vec<f64>,
}

impl Elimination {
    pub(super) fn new(n: usize, m: usize) -> Self {
        let ld = padded(n + 1);
        Self {
            dependent: DEPENDENT,
            m: 0,
            n: 0,
            ld,
            lower: vec![0.0; m * ld],
            upper: vec![0.0; m * ld],
            inverse_pivot: vec![0.0; m.min(n)],
            weight: vec![0.0; ld],
            alive: vec![0.0; ld],
            place_bits: (0..ld as u64).collect(),
            pivots: Vec::with_capacity(m.min(n)),
            remaining: Vec::with_capacity(n),
            kept_places: Vec::with_capacity(ld),
            rows: Vec::with_capacity(m),
            row_scale: vec![0.0; m],
            zeros: vec![0.0; m],
            solution: vec![0.0; m.max(1) * ld],
        }
    }

    /// Number of rows eliminated.
    pub(super) fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// Eliminates the rows of `qp`, leaving out those whose remainder is below `dependent` (see [`DEPENDENT`]).
    pub(super) fn run(&mut self, qp: &Qp<'_>, dependent: f64) -> Rows {
        self.dependent = dependent;
        self.load(qp);
        if !self.row_scale[..self.m]
            .iter()
            .zip(qp.b)
            .all(|(scale, b)| (scale + b.abs()).is_finite())
        {
            return Rows::NotFinite;
        }
        self.factorise();
        self.remaining
            .extend((0..self.n).filter(|j| self.alive[j + 1] > 0.0));
        if self.dependent_rows_hold(qp.b) {
            Rows::Consistent
        } else {
            Rows::Contradictory
        }
    }

    fn load(&mut self, qp: &Qp<'_>) {
        (self.m, self.n, self.ld) = (qp.equalities(), qp.unknowns(), padded(qp.unknowns() + 1));
        self.pivots.clear();
        self.remaining.clear();
        self.rows.clear();
        self.rows.extend(0..self.m);
        self.alive.fill(1.0);
        if self.m > 0 {
            self.weight.fill(0.0);
            for ((weight, lo), hi) in self.weight[1..].iter_mut().zip(qp.lo).zip(qp.hi) {
                let is_free = *lo == f64::NEG_INFINITY && *hi == f64::INFINITY;
                *weight = if is_free { 1.0 } else { BOUNDED_WEIGHT };
            }
            self.load_rows(&qp.a, qp.b);
        }
    }

    /// Transposes [b A] into `lower`, four columns at a time.
    fn load_rows(&mut self, a: &MatRef<'_>, b: &[f64]) {
        let (n, m, ld) = (self.n, self.m, self.ld);
        let column = |place: usize| match place {
            0 => &b[..m],
            place if place <= n => &a.col(place - 1)[..m],
            _ => &self.zeros[..m],
        };
        for first in (0..ld).step_by(LANES) {
            let [c0, c1, c2, c3] = std::array::from_fn(|lane| column(first + lane));
            let entries = c0.iter().zip(c1).zip(c2).zip(c3);
            for (r, (((e0, e1), e2), e3)) in entries.enumerate() {
                self.lower[r * ld + first..][..LANES].copy_from_slice(&[*e0, *e1, *e2, *e3]);
            }
        }
        for (scale, row) in self.row_scale.iter_mut().zip(self.lower.chunks_exact(ld)).take(m) {
            *scale = sum_abs(row) - row[0].abs();
        }
    }

    fn factorise(&mut self) {
        let (mut row, mut end) = (0, self.m);
        let mut key = if end > 0 { self.best_in_row(0) } else { 0 };
        while row < end {
            let place = (key & INDEX_MASK) as usize;
            if self.is_above(POSTPONED, row, place) {
                key = self.eliminate(row, place);
                row += 1;
            } else {
                end -= 1;
                self.swap_rows(row, end);
                key = self.best_in_row(row);
            }
        }
        while let Some((pivot_row, place)) = self.best_of_rows_from(row) {
            self.swap_rows(row, pivot_row);
            self.eliminate(row, place);
            row += 1;
        }
    }

    /// True if `place` holds a live unknown with an entry above `fraction` of the row.
    ///
    /// The key of a row of zeros may name any place.
    fn is_above(&self, fraction: f64, row: usize, place: usize) -> bool {
        self.weight[place] > 0.0 && self.lower[row * self.ld + place].abs() > fraction * self.row_scale[row]
    }

    /// Key of the best pivot of a row: weighted magnitude with its last bits replaced by the place.
    #[inline]
    fn best_in_row(&self, row: usize) -> u64 {
        let row = &self.lower[row * self.ld..][..self.ld];
        let mut best = [0.0; LANES];
        let blocks = row
            .as_chunks::<LANES>()
            .0
            .iter()
            .zip(self.weight.as_chunks::<LANES>().0);
        for ((row, weight), places) in blocks.zip(self.place_bits.as_chunks::<LANES>().0) {
            for lane in 0..LANES {
                // Magnitudes order like their bits, so the key can stay a float and be compared as one.
                let bits = (row[lane] * weight[lane]).to_bits() & MAGNITUDE_MASK;
                let key = f64::from_bits(bits | places[lane]);
                best[lane] = larger(best[lane], key);
            }
        }
        larger(larger(best[0], best[1]), larger(best[2], best[3])).to_bits()
    }

    /// Independent row and place with the largest live entry relative to its row, from `first` on.
    fn best_of_rows_from(&self, first: usize) -> Option<(usize, usize)> {
        let mut best = None;
        let mut largest = 0.0;
        for row in first..self.m {
            for place in 1..=self.n {
                let relative = self.lower[row * self.ld + place].abs() / self.row_scale[row];
                if relative > largest && self.is_above(self.dependent, row, place) {
                    largest = relative;
                    best = Some((row, place));
                }
            }
        }
        best
    }

    fn swap_rows(&mut self, i: usize, j: usize) {
        if i < j {
            self.rows.swap(i, j);
            self.row_scale.swap(i, j);
            let (head, tail) = self.lower.split_at_mut(j * self.ld);
            head[i * self.ld..][..self.ld].swap_with_slice(&mut tail[..self.ld]);
        }
    }

    /// Eliminates `row` with the pivot at `place`; returns the pivot key of the row after it.
    ///
    /// Optimisation: the row after it is updated first, so that the search for its pivot and the division
    /// overlap with the update of the others.
    fn eliminate(&mut self, row: usize, place: usize) -> u64 {
        let (ld, m) = (self.ld, self.m);
        self.pivots.push(place - 1);
        self.alive[place] = 0.0;
        self.weight[place] = 0.0;
        let pivot_row = &self.lower[row * ld..][..ld];
        let inverse = 1.0 / pivot_row[place];
        self.inverse_pivot[row] = inverse;
        let upper = &mut self.upper[row * ld..][..ld];
        for ((upper, entry), alive) in upper.iter_mut().zip(pivot_row).zip(&self.alive) {
            *upper = entry * (inverse * alive);
        }
        if row + 1 == m {
            return 0;
        }
        self.subtract_upper_row(row, row + 1..row + 2, place);
        let key = self.best_in_row(row + 1);
        self.subtract_upper_row(row, row + 2..m, place);
        key
    }

    /// Subtracts row `row` of U, times their entry at `place`, from `rows`.
    #[inline]
    fn subtract_upper_row(&mut self, row: usize, rows: Range<usize>, place: usize) {
        let ld = self.ld;
        let upper = &self.upper[row * ld..][..ld];
        for start in (0..ld).step_by(GROUP * LANES) {
            let upper = &upper[start..];
            let rows = rows.clone().map(|row| row * ld);
            match upper.len() / LANES {
                1 => subtract_from_rows::<1>(&mut self.lower, rows, start, place, upper),
                2 => subtract_from_rows::<2>(&mut self.lower, rows, start, place, upper),
                3 => subtract_from_rows::<3>(&mut self.lower, rows, start, place, upper),
                4 => subtract_from_rows::<4>(&mut self.lower, rows, start, place, upper),
                _ => subtract_from_rows::<GROUP>(&mut self.lower, rows, start, place, upper),
            }
        }
    }

    /// True if every row found dependent has a right-hand side to match.
    ///
    /// The reduced right-hand side of such a row is its residual at x_N = 0, known to rounding of the terms
    /// of the row at that point: |b_i| + sum_s |L_is| |u_s|.
    fn dependent_rows_hold(&self, b: &[f64]) -> bool {
        (self.rank()..self.m).all(|row| {
            let lower = &self.lower[row * self.ld..][..self.ld];
            let pivots = self.pivots.iter().enumerate();
            let eliminated: f64 = pivots
                .map(|(s, p)| (lower[p + 1] * self.upper[s * self.ld]).abs())
                .sum();
            let terms = CONSISTENT * (eliminated + b[self.rows[row]].abs());
            lower[0].abs() <= terms.max(SHARE * self.dependent * self.row_scale[row])
        })
    }

    /// Writes T (one column of `stride` per remaining unknown, in that order) and then c, so that
    /// x_B = c + T x_N. Entries from the rank to the stride are zero.
    pub(super) fn solution_into(&mut self, stride: usize, t_and_c: &mut [f64]) {
        let (k, rank) = (self.remaining.len(), self.rank());
        let width = padded(k + 1);
        self.kept_places.clear();
        self.kept_places.push(0);
        self.kept_places
            .extend(self.remaining.iter().map(|unknown| unknown + 1));
        self.kept_places.resize(width, 0);
        let columns = &mut t_and_c[..stride * (k + 1)];
        columns.fill(0.0);
        for start in (0..width).step_by(GROUP * LANES) {
            match (width - start) / LANES {
                1 => self.substitute::<1>(rank, start, stride, columns),
                2 => self.substitute::<2>(rank, start, stride, columns),
                3 => self.substitute::<3>(rank, start, stride, columns),
                4 => self.substitute::<4>(rank, start, stride, columns),
                _ => self.substitute::<GROUP>(rank, start, stride, columns),
            }
        }
    }

    /// Back-substitution of `BLOCKS` blocks of kept places from `start` on, into the columns of T and c.
    ///
    /// A row of the solution is its row of U less the rows below times their entry of U, the newest last.
    fn substitute<const BLOCKS: usize>(
        &mut self,
        rank: usize,
        start: usize,
        stride: usize,
        columns: &mut [f64],
    ) {
        let places = &self.kept_places[start..][..BLOCKS * LANES];
        let rows = &mut self
            .solution
            .as_chunks_mut::<LANES>()
            .0
            .as_chunks_mut::<BLOCKS>()
            .0[..rank];
        for row in (0..rank).rev() {
            let upper = &self.upper[row * self.ld..][..self.ld];
            let mut sums: [[f64; LANES]; BLOCKS] =
                std::array::from_fn(|block| std::array::from_fn(|lane| upper[places[block * LANES + lane]]));
            for (known, pivot) in rows[row + 1..].iter().zip(&self.pivots[row + 1..]).rev() {
                let factor = upper[pivot + 1];
                for (sums, known) in sums.iter_mut().zip(known) {
                    for lane in 0..LANES {
                        sums[lane] -= factor * known[lane];
                    }
                }
            }
            rows[row] = sums;
        }
        let k = self.remaining.len();
        for (entry, place) in (start..=k).take(BLOCKS * LANES).enumerate() {
            // Place 0 is c, the last column; the others are -T.
            let (column, sign) = if place == 0 { (k, 1.0) } else { (place - 1, -1.0) };
            for (out, row) in columns[column * stride..].iter_mut().zip(rows.iter()) {
                *out = sign * row[entry / LANES][entry % LANES];
            }
        }
    }

    /// Solves A_Bᵀ y = q for the multipliers of the eliminated rows; redundant rows get 0.
    ///
    /// `q` has the length of the rank and the order of the pivots.
    pub(super) fn multipliers_into(&mut self, q: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        let ld = self.ld;
        // Only the places of pivots matter; the others collect what is never read.
        let by_place = &mut self.solution[..ld];
        by_place.fill(0.0);
        for (pivot, value) in self.pivots.iter().zip(q) {
            by_place[pivot + 1] = *value;
        }
        for (s, pivot) in self.pivots.iter().enumerate() {
            let value = by_place[pivot + 1];
            subtract_scaled_blocks(by_place, value, &self.upper[s * ld..][..ld]);
        }
        for (s, pivot) in self.pivots.iter().enumerate().rev() {
            let value = by_place[pivot + 1] * self.inverse_pivot[s];
            y[self.rows[s]] = value;
            subtract_scaled_blocks(by_place, value, &self.lower[s * ld..][..ld]);
        }
    }
}

/// Subtracts `BLOCKS` blocks of a row of U, times their entry at `place`, from rows of `lower` at `start`.
#[inline(always)]
fn subtract_from_rows<const BLOCKS: usize>(
    lower: &mut [f64],
    row_offsets: impl Iterator<Item = usize>,
    start: usize,
    place: usize,
    upper: &[f64],
) {
    for offset in row_offsets {
        let factor = lower[offset + place];
        subtract_scaled_group::<BLOCKS>(&mut lower[offset + start..], factor, upper);
    }
}

/// Maximum as the one instruction it is; `f64::max` also orders NaN.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Sum of magnitudes of whole blocks.
fn sum_abs(x: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    for block in x.as_chunks::<LANES>().0 {
        for lane in 0..LANES {
            sums[lane] += block[lane].abs();
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4 rows in 6 unknowns; row 2 is row 0 less twice row 1 plus `error`.
    fn eliminate(error: f64, rhs_error: f64) -> (Rows, Elimination, Vec<f64>) {
        let (m, n) = (4, 6);
        let mut a: Vec<f64> = (0..m * n).map(|i| ((i * i + 3 * i) as f64 * 0.7).sin()).collect();
        let mut b = vec![0.3, -0.2, 0.0, 0.9];
        for j in 0..n {
            a[2 + j * m] = a[j * m] - 2.0 * a[1 + j * m] + error * ((j as f64) + 0.5).cos();
        }
        b[2] = b[0] - 2.0 * b[1] + rhs_error;
        let (lo, hi) = (vec![-1.0; n], vec![1.0; n]);
        let zeros = vec![0.0; n * n];
        let qp = Qp {
            h: MatRef::new(&zeros, n, n),
            g: &zeros[..n],
            a: MatRef::new(&a, m, n),
            b: &b,
            lo: &lo,
            hi: &hi,
        };
        let mut elimination = Elimination::new(n, m);
        let rows = elimination.run(&qp, DEPENDENT);
        a.extend(b);
        (rows, elimination, a)
    }

    /// Every x = (c + T v, v) meets the rows.
    fn worst_residual(elimination: &mut Elimination, a_and_b: &[f64]) -> f64 {
        let (m, n, stride) = (4, 6, 4);
        let mut t_and_c = vec![0.0; stride * (n + 1)];
        elimination.solution_into(stride, &mut t_and_c);
        let k = elimination.remaining.len();
        let v: Vec<f64> = (0..k).map(|a| 0.4 - 0.3 * a as f64).collect();
        let mut x = vec![0.0; n];
        for (a, &unknown) in elimination.remaining.iter().enumerate() {
            x[unknown] = v[a];
        }
        for (s, &unknown) in elimination.pivots.iter().enumerate() {
            let moved: f64 = (0..k).map(|a| t_and_c[a * stride + s] * v[a]).sum();
            x[unknown] = t_and_c[k * stride + s] + moved;
        }
        let row = |r: usize| (0..n).map(|j| a_and_b[r + j * m] * x[j]).sum::<f64>() - a_and_b[n * m + r];
        (0..m).map(|r| row(r).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn redundant_row_is_found_and_met() {
        let (rows, mut elimination, a_and_b) = eliminate(0.0, 0.0);
        assert_eq!((rows, elimination.rank()), (Rows::Consistent, 3));
        assert!(worst_residual(&mut elimination, &a_and_b) < 1e-14);
    }

    #[test]
    fn nearly_dependent_row_is_kept_and_taken_last() {
        let (rows, mut elimination, a_and_b) = eliminate(1e-6, 1e-7);
        assert_eq!((rows, elimination.rank()), (Rows::Consistent, 4));
        assert!(
            [0, 1, 2].contains(&elimination.rows[3]),
            "one of the three related rows is last"
        );
        assert!(worst_residual(&mut elimination, &a_and_b) < 1e-14);
    }

    #[test]
    fn contradiction_is_found() {
        assert_eq!(eliminate(0.0, 1e-6).0, Rows::Contradictory);
    }

    /// A_Bᵀ y = q, checked against the columns of A.
    #[test]
    fn multipliers_solve_the_transposed_system() {
        let (_, mut elimination, a_and_b) = eliminate(0.0, 0.0);
        let q = [0.5, -1.0, 0.25];
        let mut y = [f64::NAN; 4];
        elimination.multipliers_into(&q, &mut y);
        for (pivot, expected) in elimination.pivots.iter().zip(q) {
            let product: f64 = (0..4).map(|r| a_and_b[r + pivot * 4] * y[r]).sum();
            assert!((product - expected).abs() < 1e-14);
        }
        assert!(y.contains(&0.0), "the redundant row has no multiplier");
    }
}
