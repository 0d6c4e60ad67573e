//! Loops over contiguous columns that the whole solver is made of, in the shape the compiler vectorises.
//!
//! Optimisation: lengths known to be a multiple of [`LANES`] are walked in blocks of that many entries, so
//! that a column of 15 rows padded to 16 costs eight two-lane operations and no scalar remainder.

/// Block width: two 128-bit or one 256-bit register of f64.
pub(super) const LANES: usize = 4;

/// `len` rounded up to whole blocks.
#[inline]
pub(super) fn padded(len: usize) -> usize {
    len.next_multiple_of(LANES)
}

/// Blocks of one column that are kept in registers while they are subtracted from others.
pub(super) const GROUP: usize = 4;

/// y -= a x for a fixed number of blocks; fully unrolled.
#[inline(always)]
pub(super) fn subtract_scaled_group<const BLOCKS: usize>(y: &mut [f64], a: f64, x: &[[f64; LANES]; BLOCKS]) {
    for (y, x) in y[..BLOCKS * LANES].as_chunks_mut::<LANES>().0.iter_mut().zip(x) {
        for lane in 0..LANES {
            y[lane] -= a * x[lane];
        }
    }
}

/// The first `BLOCKS` blocks of x.
#[inline(always)]
pub(super) fn group_of<const BLOCKS: usize>(x: &[f64]) -> [[f64; LANES]; BLOCKS] {
    std::array::from_fn(|block| std::array::from_fn(|lane| x[block * LANES + lane]))
}

/// Copies `source` and fills the rest of `out` with zeros; `out` is a whole number of blocks.
#[inline]
pub(super) fn copy_padded(source: &[f64], out: &mut [f64]) {
    let (blocks, rest) = source.as_chunks::<LANES>();
    let (out_blocks, _) = out.as_chunks_mut::<LANES>();
    for (out, block) in out_blocks.iter_mut().zip(blocks) {
        *out = *block;
    }
    for (index, out) in out_blocks.iter_mut().enumerate().skip(blocks.len()) {
        let first = (index - blocks.len()) * LANES;
        *out = std::array::from_fn(|lane| rest.get(first + lane).copied().unwrap_or(0.0));
    }
}

/// y += a x.
#[inline]
pub(super) fn add_scaled(y: &mut [f64], a: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// y += a0 x0 + a1 x1 + a2 x2 + a3 x3 for columns at least as long as y.
#[inline]
pub(super) fn add_scaled4(y: &mut [f64], a: [f64; 4], x: [&[f64]; 4]) {
    let [x0, x1, x2, x3] = x.map(|column| &column[..y.len()]);
    for ((((y, x0), x1), x2), x3) in y.iter_mut().zip(x0).zip(x1).zip(x2).zip(x3) {
        *y += (a[0] * x0 + a[1] * x1) + (a[2] * x2 + a[3] * x3);
    }
}

/// Dot product over the common length.
#[inline]
pub(super) fn dot(x: &[f64], y: &[f64]) -> f64 {
    let (x_blocks, x_rest) = x.as_chunks::<LANES>();
    let (y_blocks, _) = y.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (x, y) in x_blocks.iter().zip(y_blocks) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    let rest: f64 = x_rest.iter().zip(&y[y.len().min(x_blocks.len() * LANES)..]).map(|(x, y)| x * y).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Largest magnitude; NaN entries are ignored.
#[inline]
pub(super) fn max_abs(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |largest, value| if value.abs() > largest { value.abs() } else { largest })
}
