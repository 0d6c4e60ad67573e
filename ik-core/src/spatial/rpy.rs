//! Roll, pitch and yaw with `R = Rz(yaw) Ry(pitch) Rx(roll)`, angles in radians, and their rates.
//!
//! The coordinates are singular at pitch = ±π/2; the rate map divides by cos(pitch), bounded below by
//! [`LEAST_COSINE`], so results stay finite there but lose their meaning: use the logarithm for such tasks.

use nalgebra::{Matrix3, Vector3};

/// Smallest |cos pitch| the rate map divides by (3e-4 degrees from the singular pitch).
pub const LEAST_COSINE: f64 = 5e-6;

/// Rotation matrix of `(roll, pitch, yaw)`.
pub fn to_matrix(rpy: &Vector3<f64>) -> Matrix3<f64> {
    let ((sr, cr), (sp, cp), (sy, cy)) = (rpy.x.sin_cos(), rpy.y.sin_cos(), rpy.z.sin_cos());
    Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
}

/// `(roll, pitch, yaw)` of a rotation matrix, pitch in [−π/2, π/2].
pub fn from_matrix(r: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(
        r[(2, 1)].atan2(r[(2, 2)]),
        (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)])),
        r[(1, 0)].atan2(r[(0, 0)]),
    )
}

/// World angular velocity (rad/s) of the rates `rpy_dot` at `rpy`.
pub fn rates_to_angular_velocity(rpy: &Vector3<f64>, rpy_dot: &Vector3<f64>) -> Vector3<f64> {
    let ((sp, cp), (sy, cy)) = (rpy.y.sin_cos(), rpy.z.sin_cos());
    Vector3::new(
        cy * cp * rpy_dot.x - sy * rpy_dot.y,
        sy * cp * rpy_dot.x + cy * rpy_dot.y,
        rpy_dot.z - sp * rpy_dot.x,
    )
}

/// The map from world angular velocity to rpy rates at one attitude, with its derivative.
#[derive(Clone, Copy, Debug)]
pub struct RateMap {
    sine_yaw: f64,
    cosine_yaw: f64,
    sine_pitch: f64,
    inverse_cosine_pitch: f64,
}

impl RateMap {
    /// The map at `rpy`.
    pub fn new(rpy: &Vector3<f64>) -> Self {
        let ((sine_pitch, cosine_pitch), (sine_yaw, cosine_yaw)) = (rpy.y.sin_cos(), rpy.z.sin_cos());
        let bounded = cosine_pitch.abs().max(LEAST_COSINE).copysign(cosine_pitch);
        Self {
            sine_yaw,
            cosine_yaw,
            sine_pitch,
            inverse_cosine_pitch: 1.0 / bounded,
        }
    }

    /// The map at the attitude of the rotation matrix `r`, without a trigonometric function.
    pub fn from_matrix(r: &Matrix3<f64>) -> Self {
        let cosine_pitch = r[(0, 0)].hypot(r[(1, 0)]).max(LEAST_COSINE);
        let inverse_cosine_pitch = 1.0 / cosine_pitch;
        Self {
            sine_yaw: r[(1, 0)] * inverse_cosine_pitch,
            cosine_yaw: r[(0, 0)] * inverse_cosine_pitch,
            sine_pitch: -r[(2, 0)],
            inverse_cosine_pitch,
        }
    }

    /// The rpy rates of a world angular velocity `w` (rad/s).
    #[inline(always)]
    pub fn apply(&self, w: [f64; 3]) -> [f64; 3] {
        let along = self.cosine_yaw * w[0] + self.sine_yaw * w[1];
        let across = self.cosine_yaw * w[1] - self.sine_yaw * w[0];
        let roll = along * self.inverse_cosine_pitch;
        [roll, across, w[2] + self.sine_pitch * roll]
    }

    /// Change of [`RateMap::apply`] of a fixed `w` when the attitude moves with the rates `rpy_dot`.
    #[inline(always)]
    pub fn derivative(&self, w: [f64; 3], rpy_dot: [f64; 3]) -> [f64; 3] {
        let along = self.cosine_yaw * w[0] + self.sine_yaw * w[1];
        let across = self.cosine_yaw * w[1] - self.sine_yaw * w[0];
        let (along_dot, across_dot) = (rpy_dot[2] * across, -rpy_dot[2] * along);
        let i = self.inverse_cosine_pitch;
        let roll_dot = along_dot * i + along * self.sine_pitch * i * i * rpy_dot[1];
        // d(tan p · along) = along / cos² p · dp + tan p · d along.
        [
            roll_dot,
            across_dot,
            along * i * i * rpy_dot[1] + self.sine_pitch * i * along_dot,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::so3;
    use proptest::prelude::*;

    fn angles() -> impl Strategy<Value = Vector3<f64>> {
        (-3.0..3.0, -1.5..1.5, -3.0..3.0).prop_map(|(r, p, y)| Vector3::new(r, p, y))
    }

    proptest! {
        #[test]
        fn matrix_and_angles_are_inverse(rpy in angles()) {
            prop_assert!((from_matrix(&to_matrix(&rpy)) - rpy).norm() < 1e-12);
        }

        #[test]
        fn rates_match_differences_and_invert(rpy in angles(), rate in angles(), other in angles()) {
            let h = 1e-6;
            let w = rates_to_angular_velocity(&rpy, &rate);
            let numeric = so3::log(&(to_matrix(&(rpy + rate * h)) * to_matrix(&(rpy - rate * h)).transpose())) / (2.0 * h);
            prop_assert!((w - numeric).norm() < 1e-6 * (1.0 + rate.norm()));
            let map = RateMap::new(&rpy);
            let same = RateMap::from_matrix(&to_matrix(&rpy));
            prop_assert!((Vector3::from(map.apply([1.0, 2.0, 3.0])) - Vector3::from(same.apply([1.0, 2.0, 3.0]))).norm() < 1e-12 / rpy.y.cos());
            let back = Vector3::from(map.apply(w.into()));
            prop_assert!((back - rate).norm() < 1e-11 / rpy.y.cos());
            let moved = |s: f64| Vector3::from(RateMap::new(&(rpy + other * (s * h))).apply(w.into()));
            let numeric = (moved(1.0) - moved(-1.0)) / (2.0 * h);
            let analytic = Vector3::from(map.derivative(w.into(), other.into()));
            prop_assert!((analytic - numeric).norm() < 1e-6 * (1.0 + w.norm() * other.norm()) / rpy.y.cos().powi(3));
        }
    }
}
