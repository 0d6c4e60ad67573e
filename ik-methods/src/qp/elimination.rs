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
//! Storage: per column of [A b] two runs of `ld` entries (rows padded to whole blocks), first the part
//! above the diagonal (U) then the part below (L and what is not yet eliminated). The update of a column may
//! then start at a whole block: it spoils only entries of the lower run that are never read again.

use super::kernels::{LANES, add_scaled_blocks, padded};
use super::{MatRef, Qp};

/// A row is put off when its largest remaining entry falls below this fraction of its original 1-norm.
///
/// Heuristic: late enough that ordinary rows keep their order, early enough that the rows before lose no
/// more than these four digits to a nearly dependent one.
const POSTPONED: f64 = 1e-4;

/// A row is dependent when its largest remaining entry is below this fraction of its original 1-norm.
///
/// Rounding leaves about n * 2.2e-16 (1e-14 for n = 60) times the growth of the elimination (in practice
/// below 100). A real remainder this small could only be met by moving the unknowns 1e12 times as far.
const DEPENDENT: f64 = 1e-12;

/// A dependent row holds when its reduced right-hand side is below this fraction of the row's own terms.
const CONSISTENT: f64 = 1e-10;

/// Weight of a bounded unknown in the choice of the pivot; unknowns without bounds count fully.
///
/// Pivots without bounds can never become active. The factor limits entries of U to 1 / 0.25 (threshold
/// pivoting); growth stays harmless in practice up to about 10 (Duff, Erisman & Reid, 2nd ed., 5.2).
const BOUNDED_WEIGHT: f64 = 0.25;

/// Bits of a pivot key that hold the index of the candidate instead of the tail of its magnitude.
const INDEX_MASK: u64 = 0xFFF;

/// Largest number of unknowns the pivot keys can index.
pub(super) const MAX_UNKNOWNS: usize = INDEX_MASK as usize + 1;

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
    m: usize,
    n: usize,
    /// Padded number of rows.
    ld: usize,
    /// n + 1 columns of `2 * ld` entries: upper run, lower run.
    store: Vec<f64>,
    /// Lower run of the current pivot column.
    pivot: Vec<f64>,
    /// Original index of each row in its current place.
    rows: Vec<usize>,
    /// 1-norm of each row of A, moving with the row.
    row_scale: Vec<f64>,
    /// Pivot preference per column.
    weight: Vec<f64>,
    /// Column eliminated by each row in turn: B.
    pub(super) pivots: Vec<usize>,
    /// Columns not eliminated: N.
    pub(super) remaining: Vec<usize>,
}

impl Elimination {
    pub(super) fn new(n: usize, m: usize) -> Self {
        let ld = padded(m);
        Self {
            m: 0,
            n: 0,
            ld: 0,
            store: vec![0.0; 2 * ld * (n + 1)],
            pivot: vec![0.0; ld],
            rows: Vec::with_capacity(m),
            row_scale: vec![0.0; ld],
            weight: vec![0.0; n],
            pivots: Vec::with_capacity(m.min(n)),
            remaining: Vec::with_capacity(n),
        }
    }

    /// Number of rows eliminated.
    pub(super) fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// Eliminates the rows of `qp`.
    pub(super) fn run(&mut self, qp: &Qp<'_>) -> Rows {
        self.load(qp);
        if !self.row_scale[..self.m].iter().zip(qp.b).all(|(scale, b)| (scale + b.abs()).is_finite()) {
            return Rows::NotFinite;
        }
        self.factorise();
        if self.dependent_rows_hold(qp.b) { Rows::Consistent } else { Rows::Contradictory }
    }

    fn load(&mut self, qp: &Qp<'_>) {
        (self.m, self.n, self.ld) = (qp.equalities(), qp.unknowns(), padded(qp.equalities()));
        self.pivots.clear();
        self.remaining.clear();
        self.remaining.extend(0..self.n);
        self.rows.clear();
        self.rows.extend(0..self.m);
        for ((weight, lo), hi) in self.weight.iter_mut().zip(qp.lo).zip(qp.hi) {
            let is_free = *lo == f64::NEG_INFINITY && *hi == f64::INFINITY;
            *weight = if is_free { 1.0 } else { BOUNDED_WEIGHT };
        }
        if self.m > 0 {
            self.load_rows(&qp.a, qp.b);
        }
    }

    fn load_rows(&mut self, a: &MatRef<'_>, b: &[f64]) {
        let (m, ld) = (self.m, self.ld);
        self.row_scale[..ld].fill(0.0);
        for (j, column) in self.store.chunks_exact_mut(2 * ld).take(self.n).enumerate() {
            let lower = &mut column[ld..];
            lower[..m].copy_from_slice(a.col(j));
            lower[m..].fill(0.0);
            for (scale, value) in self.row_scale.iter_mut().zip(lower) {
                *scale += value.abs();
            }
        }
        let rhs = &mut self.store[(2 * self.n + 1) * ld..][..ld];
        rhs[..m].copy_from_slice(b);
        rhs[m..].fill(0.0);
    }

    fn factorise(&mut self) {
        let (mut row, mut end) = (0, self.m);
        let mut key = self.best_in_row(row);
        while row < end {
            let slot = (key & INDEX_MASK) as usize;
            if self.is_above(POSTPONED, row, slot) {
                key = self.eliminate(row, slot);
                row += 1;
            } else {
                end -= 1;
                self.swap_rows(row, end);
                key = self.best_in_row(row);
            }
        }
        while let Some((pivot_row, slot)) = self.best_of_rows_from(row) {
            self.swap_rows(row, pivot_row);
            self.eliminate(row, slot);
            row += 1;
        }
    }

    /// Entry of `row` in the remaining column number `slot`.
    fn entry(&self, row: usize, slot: usize) -> f64 {
        self.store[(2 * self.remaining[slot] + 1) * self.ld + row]
    }

    fn is_above(&self, fraction: f64, row: usize, slot: usize) -> bool {
        slot < self.remaining.len() && self.entry(row, slot).abs() > fraction * self.row_scale[row]
    }

    /// Key of the best pivot of `row`: weighted magnitude with its last bits replaced by the slot.
    fn best_in_row(&self, row: usize) -> u64 {
        let keys = self.remaining.iter().enumerate().map(|(slot, &column)| {
            pivot_key(self.store[(2 * column + 1) * self.ld + row] * self.weight[column], slot)
        });
        if row < self.m { keys.max().unwrap_or(0) } else { 0 }
    }

    /// Independent row and slot with the largest remaining entry relative to its row, from `first` on.
    fn best_of_rows_from(&self, first: usize) -> Option<(usize, usize)> {
        let mut best = None;
        let mut largest = 0.0;
        for row in first..self.m {
            for slot in 0..self.remaining.len() {
                let relative = self.entry(row, slot).abs() / self.row_scale[row];
                if relative > largest && self.is_above(DEPENDENT, row, slot) {
                    largest = relative;
                    best = Some((row, slot));
                }
            }
        }
        best
    }

    fn swap_rows(&mut self, i: usize, j: usize) {
        if i == j {
            return;
        }
        self.rows.swap(i, j);
        self.row_scale.swap(i, j);
        for column in self.store.chunks_exact_mut(2 * self.ld).take(self.n + 1) {
            column.swap(self.ld + i, self.ld + j);
        }
    }

    /// Eliminates `row` with the remaining column `slot` as pivot; returns the pivot key of the next row.
    fn eliminate(&mut self, row: usize, slot: usize) -> u64 {
        let (ld, stride) = (self.ld, 2 * self.ld);
        let column = self.remaining.swap_remove(slot);
        self.pivots.push(column);
        let first = (row + 1) / LANES * LANES;
        let next = (row + 1).min(self.m - 1);

        let (upper, lower) = self.store[column * stride..][..stride].split_at_mut(ld);
        upper[row..padded(row)].fill(0.0);
        let pivot = &mut self.pivot[..ld - first];
        pivot.copy_from_slice(&lower[first..]);
        let inverse = 1.0 / lower[row];

        let mut key = 0;
        for (slot, &column) in self.remaining.iter().enumerate() {
            let value = eliminate_from(&mut self.store[column * stride..][..stride], row, inverse, pivot)[next];
            key = key.max(pivot_key(value * self.weight[column], slot));
        }
        eliminate_from(&mut self.store[self.n * stride..][..stride], row, inverse, pivot);
        key
    }

    /// True if every row found dependent has a right-hand side to match.
    ///
    /// The reduced right-hand side of such a row is its residual at x_N = 0, known to rounding of the terms
    /// of the row at that point: |b_i| + sum_s |L_is| |u_s|.
    fn dependent_rows_hold(&self, b: &[f64]) -> bool {
        let (upper, lower) = if self.m == 0 { return true } else { self.column(self.n) };
        (self.rank()..self.m).all(|row| {
            let eliminated = self.pivots.iter().enumerate().map(|(s, &p)| self.column(p).1[row] * upper[s]);
            let terms: f64 = eliminated.map(f64::abs).sum();
            lower[row].abs() <= CONSISTENT * (terms + b[self.rows[row]].abs())
        })
    }

    /// Upper and lower run of a column; column n is the right-hand side.
    fn column(&self, j: usize) -> (&[f64], &[f64]) {
        self.store[j * 2 * self.ld..][..2 * self.ld].split_at(self.ld)
    }

    /// Writes T (one column of `stride` per remaining unknown, in that order) and then c, so that
    /// x_B = c + T x_N. Entries from the rank to the next whole block are zero.
    ///
    /// `stride` is a whole number of blocks and at least the rank.
    pub(super) fn solution_into(&self, stride: usize, t_and_c: &mut [f64]) {
        let (k, rank) = (self.remaining.len(), self.rank());
        let columns = &mut t_and_c[..stride * (k + 1)];
        if rank == 0 {
            columns.fill(0.0);
            return;
        }
        for (slot, out) in columns.chunks_exact_mut(stride).enumerate() {
            let (source, sign) = if slot < k { (self.remaining[slot], -1.0) } else { (self.n, 1.0) };
            let upper = &self.column(source).0[..rank];
            for (out, value) in out.iter_mut().zip(upper) {
                *out = sign * value;
            }
            out[rank..].fill(0.0);
        }
        for s in (1..rank).rev() {
            let upper = &self.column(self.pivots[s]).0[..padded(s)];
            for column in columns.chunks_exact_mut(stride) {
                let value = column[s];
                add_scaled_blocks(column, -value, upper);
            }
        }
    }

    /// Solves A_Bᵀ y = q for the multipliers of the eliminated rows; redundant rows get 0.
    ///
    /// `q` (length rank, in the order of the pivots) is destroyed.
    pub(super) fn multipliers_into(&mut self, q: &mut [f64], y: &mut [f64]) {
        y.fill(0.0);
        let rank = self.rank();
        for s in 1..rank {
            let upper = &self.column(self.pivots[s]).0[..s];
            q[s] -= super::kernels::dot(upper, &q[..s]);
        }
        for s in (0..rank).rev() {
            let lower = self.column(self.pivots[s]).1;
            q[s] = (q[s] - super::kernels::dot(&lower[s + 1..rank], &q[s + 1..rank])) / lower[s];
            y[self.rows[s]] = q[s];
        }
    }
}

/// Orders candidates by magnitude; the slot in the last bits makes ties deterministic.
#[inline]
fn pivot_key(value: f64, slot: usize) -> u64 {
    (value.abs().to_bits() & !INDEX_MASK) | slot as u64
}

/// Subtracts its multiple of the pivot column from one column and returns the lower run.
#[inline]
fn eliminate_from<'a>(column: &'a mut [f64], row: usize, inverse: f64, pivot: &[f64]) -> &'a [f64] {
    let (upper, lower) = column.split_at_mut(column.len() / 2);
    let factor = lower[row] * inverse;
    upper[row] = factor;
    let first = lower.len() - pivot.len();
    add_scaled_blocks(&mut lower[first..], -factor, pivot);
    lower
}
