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

/// Blocks handled at a time by the unrolled kernels.
pub(super) const GROUP: usize = 5;

/// y -= a x over whole blocks; `x` is at least as long as `y`.
///
/// Optimisation: unrolled for up to [`GROUP`] blocks. Left to itself the compiler interleaves blocks with
/// shuffles that cost more than the arithmetic.
#[inline]
pub(super) fn subtract_scaled_blocks(y: &mut [f64], a: f64, x: &[f64]) {
    for start in (0..y.len()).step_by(GROUP * LANES) {
        let (y, x) = (&mut y[start..], &x[start..]);
        match y.len() / LANES {
            0 => {}
            1 => subtract_scaled_group::<1>(y, a, x),
            2 => subtract_scaled_group::<2>(y, a, x),
            3 => subtract_scaled_group::<3>(y, a, x),
            4 => subtract_scaled_group::<4>(y, a, x),
            _ => subtract_scaled_group::<GROUP>(y, a, x),
        }
    }
}

/// y -= a x for a fixed number of blocks; fully unrolled.
#[inline(always)]
pub(super) fn subtract_scaled_group<const BLOCKS: usize>(y: &mut [f64], a: f64, x: &[f64]) {
    let x = &x[..BLOCKS * LANES];
    let y = &mut y[..BLOCKS * LANES];
    for block in 0..BLOCKS {
        for lane in block * LANES..(block + 1) * LANES {
            y[lane] -= a * x[lane];
        }
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
    let rest: f64 = x_rest
        .iter()
        .zip(&y[y.len().min(x_blocks.len() * LANES)..])
        .map(|(x, y)| x * y)
        .sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Largest magnitude; NaN entries are ignored.
#[inline]
pub(super) fn max_abs(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |largest, value| {
        if value.abs() > largest {
            value.abs()
        } else {
            largest
        }
    })
}

/// Largest magnitude, NaN if any entry is NaN.
#[inline]
pub(super) fn max_abs_or_nan(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |largest: f64, value| {
        if largest.is_nan() || value.abs() <= largest {
            largest
        } else {
            value.abs()
        }
    })
}
