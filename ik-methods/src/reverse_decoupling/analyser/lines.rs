//! Geometry of straight lines: where joint axes meet, and by how much they miss.

use ik_core::kinematics::successive::JointLine;
use nalgebra::{Matrix3, Vector3};

/// Singular values of `Σ (1 − s sᵀ)` below this are those of parallel lines: for lines within an angle δ of each other
/// the least one is about δ², so this is δ = 1e-6 rad. The point is then free along the lines and taken nearest to their
/// given points.
const PARALLEL_SINGULAR_VALUE: f64 = 1e-12;

/// The point nearest to some lines in the least-squares sense.
#[derive(Clone, Copy, Debug)]
pub(in crate::reverse_decoupling) struct Meeting {
    /// The point (m).
    pub(in crate::reverse_decoupling) point: Vector3<f64>,
    /// Greatest distance from it to one of the lines (m).
    pub(in crate::reverse_decoupling) miss_m: f64,
}

/// Least squares over the distances: `Σ (1 − s sᵀ)(x − p) = 0`.
pub(in crate::reverse_decoupling) fn meeting(lines: &[JointLine]) -> Meeting {
    let across = |line: &JointLine| Matrix3::identity() - line.axis * line.axis.transpose();
    // Relative to the mean of the points, so that the least-norm solution for parallel lines is near them.
    let mean = lines.iter().map(|line| line.point).sum::<Vector3<f64>>() / lines.len() as f64;
    let normal: Matrix3<f64> = lines.iter().map(across).sum();
    let right: Vector3<f64> = lines.iter().map(|line| across(line) * (line.point - mean)).sum();
    // `solve` fails only where a factor of the decomposition was not asked for.
    let offset = normal.svd(true, true).solve(&right, PARALLEL_SINGULAR_VALUE);
    let point = mean + offset.unwrap_or_default();
    let distances = lines.iter().map(|line| distance(line, &point));
    Meeting {
        point,
        miss_m: distances.fold(0.0, f64::max),
    }
}

/// Distance of a point from a line (m).
pub(super) fn distance(line: &JointLine, point: &Vector3<f64>) -> f64 {
    (point - line.point).cross(&line.axis).norm()
}

/// The point of a line nearest to a point.
pub(super) fn projection(line: &JointLine, point: &Vector3<f64>) -> Vector3<f64> {
    line.point + line.axis * (point - line.point).dot(&line.axis)
}

/// Sine of the angle between two lines.
pub(super) fn sine(a: &JointLine, b: &JointLine) -> f64 {
    a.axis.cross(&b.axis).norm()
}

/// The point of `line` nearest to `other`: the foot of their common normal; not finite for parallel lines.
pub(super) fn foot(line: &JointLine, other: &JointLine) -> Vector3<f64> {
    let normal = line.axis.cross(&other.axis);
    let along = (other.point - line.point).cross(&other.axis).dot(&normal) / normal.norm_squared();
    line.point + line.axis * along
}
