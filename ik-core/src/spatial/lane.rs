//! Three-vectors padded to four lanes, the layout of every hot buffer.
//!
//! Optimisation: the fourth lane is kept at zero so that whole vectors move and multiply as two (or one) machine
//! vectors without shuffles.

/// A world vector `[x, y, z, 0]`.
pub(crate) type Lane = [f64; 4];

pub(crate) const ZERO: Lane = [0.0; 4];
/// World axes, the directions of the six root coordinates.
pub(crate) const AXES: [Lane; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

#[inline(always)]
pub(crate) fn add(a: Lane, b: Lane) -> Lane {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[inline(always)]
pub(crate) fn sub(a: Lane, b: Lane) -> Lane {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
}

#[inline(always)]
pub(crate) fn scale(a: Lane, s: f64) -> Lane {
    [a[0] * s, a[1] * s, a[2] * s, a[3] * s]
}

/// `a b + c`, fused or not.
#[inline(always)]
pub(crate) fn mul_add<const FMA: bool>(a: f64, b: f64, c: f64) -> f64 {
    // Without the instruction a fused product is a slow call.
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// `a + s b`, fused or not.
#[inline(always)]
pub(crate) fn add_times<const FMA: bool>(a: Lane, b: Lane, s: f64) -> Lane {
    [
        mul_add::<FMA>(s, b[0], a[0]),
        mul_add::<FMA>(s, b[1], a[1]),
        mul_add::<FMA>(s, b[2], a[2]),
        mul_add::<FMA>(s, b[3], a[3]),
    ]
}

/// `a + s b`.
#[inline(always)]
pub(crate) fn add_scaled(a: Lane, b: Lane, s: f64) -> Lane {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2], a[3] + s * b[3]]
}

#[inline(always)]
pub(crate) fn cross(a: Lane, b: Lane) -> Lane {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
        0.0,
    ]
}

#[inline(always)]
pub(crate) fn to_vector(a: Lane) -> nalgebra::Vector3<f64> {
    nalgebra::Vector3::new(a[0], a[1], a[2])
}

#[inline(always)]
pub(crate) fn from_slice(v: &[f64]) -> Lane {
    [v[0], v[1], v[2], 0.0]
}
