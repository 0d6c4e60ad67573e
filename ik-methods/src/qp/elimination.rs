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

use super::kernels::{GROUP, LANES, copy_padded, dot, group_of, padded, subtract_scaled_group};
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
    /// Original index of each row in its current place.
    rows: Vec<usize>,
    /// 1-norm of each row of A, moving with the row.
    row_scale: Vec<f64>,
    /// Pivot preference per column; 0 for the right-hand side.
    weight: Vec<f64>,
    /// Column eliminated by each row in turn: B.
    pub(super) pivots: Vec<usize>,
    /// Columns still to be updated: the right-hand side and then, in any order, those not eliminated (N).
    live: Vec<usize>,
    /// Entry of the next pivot row in each live column.
    next_row: Vec<f64>,
    /// Multiple of the pivot column to subtract from each live column.
    factors: Vec<f64>,
}

impl Elimination {
    pub(super) fn new(n: usize, m: usize) -> Self {
        let ld = padded(m);
        Self {
            m: 0,
            n: 0,
            ld: 0,
            store: vec![0.0; 2 * ld * (n + 1)],
            rows: Vec::with_capacity(m),
            row_scale: vec![0.0; ld],
            weight: vec![0.0; n + 1],
            pivots: Vec::with_capacity(m.min(n)),
            live: Vec::with_capacity(n + 1),
            next_row: vec![0.0; n + 1],
            factors: vec![0.0; n + 1],
        }
    }

    /// Number of rows eliminated.
    pub(super) fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// Columns not eliminated: N.
    pub(super) fn remaining(&self) -> &[usize] {
        &self.live[1..]
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
        self.live.clear();
        self.live.push(self.n);
        self.live.extend(0..self.n);
        self.rows.clear();
        self.rows.extend(0..self.m);
        for ((weight, lo), hi) in self.weight.iter_mut().zip(qp.lo).zip(qp.hi) {
            let is_free = *lo == f64::NEG_INFINITY && *hi == f64::INFINITY;
            *weight = if is_free { 1.0 } else { BOUNDED_WEIGHT };
        }
        self.weight[self.n] = 0.0;
        if self.m > 0 {
            self.load_rows(&qp.a, qp.b);
        }
    }

    fn load_rows(&mut self, a: &MatRef<'_>, b: &[f64]) {
        let ld = self.ld;
        for (j, column) in self.store.chunks_exact_mut(2 * ld).take(self.n).enumerate() {
            copy_padded(a.col(j), &mut column[ld..]);
        }
        copy_padded(b, &mut self.store[(2 * self.n + 1) * ld..][..ld]);
        for (block, scale) in self.row_scale[..ld].as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
            let mut sums = [0.0; LANES];
            for column in self.store.chunks_exact(2 * ld).take(self.n) {
                let [entries] = group_of::<1>(&column[ld + block * LANES..]);
                for lane in 0..LANES {
                    sums[lane] += entries[lane].abs();
                }
            }
            *scale = sums;
        }
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
            self.best_in_row(row);
            self.eliminate(row, slot);
            row += 1;
        }
    }

    /// Entry of `row` in the live column number `slot`.
    fn entry(&self, row: usize, slot: usize) -> f64 {
        self.store[(2 * self.live[slot] + 1) * self.ld + row]
    }

    /// True if `slot` is an unknown with an entry above `fraction` of the row; slot 0 is the right-hand side.
    fn is_above(&self, fraction: f64, row: usize, slot: usize) -> bool {
        slot > 0 && self.entry(row, slot).abs() > fraction * self.row_scale[row]
    }

    /// Reads `row` into `next_row`; returns the key of its best pivot: weighted magnitude with its last bits
    /// replaced by the slot.
    fn best_in_row(&mut self, row: usize) -> u64 {
        let mut key = 0;
        if row < self.m {
            for (slot, &column) in self.live.iter().enumerate() {
                let value = self.store[(2 * column + 1) * self.ld + row];
                self.next_row[slot] = value;
                key = key.max(pivot_key(value * self.weight[column], slot));
            }
        }
        key
    }

    /// Independent row and slot with the largest remaining entry relative to its row, from `first` on.
    fn best_of_rows_from(&self, first: usize) -> Option<(usize, usize)> {
        let mut best = None;
        let mut largest = 0.0;
        for row in first..self.m {
            for slot in 1..self.live.len() {
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

    /// Eliminates `row`, whose entries are in `next_row`, with the live column `slot` as pivot; returns the
    /// pivot key of the row after it.
    ///
    /// Optimisation: the entries of the row after it are computed first and on their own, so that the search
    /// for its pivot and the division need not wait for the update of the whole matrix.
    fn eliminate(&mut self, row: usize, slot: usize) -> u64 {
        let (ld, stride) = (self.ld, 2 * self.ld);
        let inverse = 1.0 / self.next_row[slot];
        let last = self.live.len() - 1;
        self.next_row.swap(slot, last);
        let column = self.live.swap_remove(slot);
        self.pivots.push(column);
        self.store[column * stride..][row..padded(row)].fill(0.0);

        let next = (row + 1).min(self.m - 1);
        let pivot_next = self.store[column * stride + ld + next];
        let key = {
            let (store, weight) = (self.store.as_mut_slice(), self.weight.as_slice());
            let mut key = 0;
            let slots = self.live.iter().zip(&mut self.next_row).zip(&mut self.factors);
            for (slot, ((&column, entry), out)) in slots.enumerate() {
                let entries = &mut store[column * stride..][..stride];
                let factor = *entry * inverse;
                *out = factor;
                entries[row] = factor;
                let value = entries[ld + next] - factor * pivot_next;
                *entry = value;
                key = key.max(pivot_key(value * weight[column], slot));
            }
            key
        };

        let first = (row + 1) / LANES * LANES;
        for start in (first..ld).step_by(GROUP * LANES) {
            match (ld - start) / LANES {
                1 => self.subtract_pivot::<1>(column, start),
                2 => self.subtract_pivot::<2>(column, start),
                3 => self.subtract_pivot::<3>(column, start),
                _ => self.subtract_pivot::<GROUP>(column, start),
            }
        }
        key
    }

    /// Subtracts multiples of column `pivot` from all live columns in `BLOCKS` blocks of rows from `start`.
    fn subtract_pivot<const BLOCKS: usize>(&mut self, pivot: usize, start: usize) {
        let offset = self.ld + start;
        let stride = 2 * self.ld;
        let pivot = group_of::<BLOCKS>(&self.store[pivot * stride + offset..]);
        for (&column, factor) in self.live.iter().zip(&self.factors) {
            subtract_scaled_group(&mut self.store[column * stride + offset..], *factor, &pivot);
        }
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
        let (k, rank) = (self.remaining().len(), self.rank());
        let columns = &mut t_and_c[..stride * (k + 1)];
        if rank == 0 {
            columns.fill(0.0);
            return;
        }
        for (slot, out) in columns.chunks_exact_mut(stride).enumerate() {
            let (source, sign) = if slot < k { (self.remaining()[slot], -1.0) } else { (self.n, 1.0) };
            let upper = &self.column(source).0[..rank];
            for (out, value) in out.iter_mut().zip(upper) {
                *out = sign * value;
            }
            out[rank..].fill(0.0);
        }
        for s in (1..rank).rev() {
            let upper = &self.column(self.pivots[s]).0[..padded(s)];
            for start in (0..upper.len()).step_by(GROUP * LANES) {
                match (upper.len() - start) / LANES {
                    1 => substitute::<1>(columns, stride, s, start, upper),
                    2 => substitute::<2>(columns, stride, s, start, upper),
                    3 => substitute::<3>(columns, stride, s, start, upper),
                    _ => substitute::<GROUP>(columns, stride, s, start, upper),
                }
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
            q[s] -= dot(upper, &q[..s]);
        }
        for s in (0..rank).rev() {
            let lower = self.column(self.pivots[s]).1;
            q[s] = (q[s] - dot(&lower[s + 1..rank], &q[s + 1..rank])) / lower[s];
            y[self.rows[s]] = q[s];
        }
    }
}

/// Orders candidates by magnitude; the slot in the last bits makes ties deterministic.
#[inline]
fn pivot_key(value: f64, slot: usize) -> u64 {
    (value.abs().to_bits() & !INDEX_MASK) | slot as u64
}

/// Substitutes unknown `s`, final in each of `columns`, into `BLOCKS` blocks of rows above it.
fn substitute<const BLOCKS: usize>(columns: &mut [f64], stride: usize, s: usize, start: usize, upper: &[f64]) {
    let upper = group_of::<BLOCKS>(&upper[start..]);
    for column in columns.chunks_exact_mut(stride) {
        let value = column[s];
        subtract_scaled_group(&mut column[start..], value, &upper);
    }
}
