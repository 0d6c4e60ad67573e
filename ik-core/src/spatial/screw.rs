//! Screws: twists of rigid bodies, their change of frame, and finite screw displacements.
//!
//! A twist has six coordinates, the *angular part first*: `[w; v]`. `v` is the velocity of the body point that
//! coincides with the reference point, the origin of the frame unless said. The twist that a unit rate of a joint gives
//! is its *normalised screw*: for an axis `s` through `s0` it is `[s; s0 × s]` (revolute), `[0; s]` (prismatic) or
//! `[s; s0 × s + h s]` (pitch h).
//!
//! Source: Tsai (1999), Robot Analysis; Davies (1981). Equation numbers are those of the Davies network paper on a
//! Bioloid humanoid: displacements (1)–(3), sum of twists (5), change of frame (6).

use super::so3;
use crate::robot::Motion;
use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, Vector3, Vector6};

/// The velocity of a rigid body, or what a unit rate of a joint contributes to it.
///
/// Units: rad/s and m/s for a twist; a normalised screw has these per unit rate of its joint (rad/s or m/s).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Screw {
    /// Angular velocity.
    pub angular: Vector3<f64>,
    /// Velocity of the body point that coincides with the reference point.
    pub linear: Vector3<f64>,
}

impl Screw {
    /// Rotation about the unit vector `axis` through `point` (m): `[s; s0 × s]`.
    pub fn revolute(axis: &Vector3<f64>, point: &Vector3<f64>) -> Self {
        Self::helical(axis, point, 0.0)
    }

    /// Translation along the unit vector `axis`: `[0; s]`.
    pub fn prismatic(axis: &Vector3<f64>) -> Self {
        Self {
            angular: Vector3::zeros(),
            linear: *axis,
        }
    }

    /// Rotation about the unit vector `axis` through `point` (m) that climbs along it: `[s; s0 × s + h s]`.
    pub fn helical(axis: &Vector3<f64>, point: &Vector3<f64>, pitch_m_per_rad: f64) -> Self {
        Self {
            angular: *axis,
            linear: point.cross(axis) + axis * pitch_m_per_rad,
        }
    }

    /// The same twist in the same axes at another reference point, given relative to the present one (m).
    #[must_use]
    pub fn at(&self, point: &Vector3<f64>) -> Self {
        Self {
            angular: self.angular,
            linear: self.linear + self.angular.cross(point),
        }
    }

    /// This twist, given in frame j, in frame i: eq. (6). `x_i_j` is the pose of j in i.
    #[must_use]
    pub fn transformed(&self, x_i_j: &Isometry3<f64>) -> Self {
        let angular = x_i_j.rotation * self.angular;
        Self {
            angular,
            linear: x_i_j.translation.vector.cross(&angular) + x_i_j.rotation * self.linear,
        }
    }

    /// Both parts times `factor`, such as the rate of the joint.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            angular: self.angular * factor,
            linear: self.linear * factor,
        }
    }

    /// `[angular; linear]`.
    pub fn to_vector(&self) -> Vector6<f64> {
        let (w, v) = (&self.angular, &self.linear);
        Vector6::new(w.x, w.y, w.z, v.x, v.y, v.z)
    }
}

/// The matrix of [`Screw::transformed`], eq. (6): `T = [[R, 0], [[p]ₓ R, R]]` with `R`, `p` the pose of j in i.
pub fn transform_matrix(x_i_j: &Isometry3<f64>) -> Matrix6<f64> {
    let r = x_i_j.rotation.to_rotation_matrix().into_inner();
    let mut t = Matrix6::zeros();
    t.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
    t.fixed_view_mut::<3, 3>(3, 3).copy_from(&r);
    t.fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&(so3::skew(&x_i_j.translation.vector) * r));
    t
}

/// Where a joint with the unit vector `axis` through `point` (m) takes what it moves, eqs. (1)–(3):
/// `A = [[R, s0 − R s0], [0, 1]]` for `value` rad (revolute), `A = [[1, q s], [0, 1]]` for `value` m (prismatic).
pub fn displacement(motion: Motion, axis: &Vector3<f64>, point: &Vector3<f64>, value: f64) -> Isometry3<f64> {
    match motion {
        Motion::Revolute => helical_displacement(axis, point, 0.0, value),
        Motion::Prismatic => Isometry3::from(axis * value),
    }
}

/// The displacement of [`Screw::helical`] after `angle_rad`: `[[R, s0 − R s0 + h q s], [0, 1]]`, with Rodrigues'
/// `R = 1 + sin q [s]ₓ + (1 − cos q) [s]ₓ[s]ₓ`.
pub fn helical_displacement(
    axis: &Vector3<f64>,
    point: &Vector3<f64>,
    pitch_m_per_rad: f64,
    angle_rad: f64,
) -> Isometry3<f64> {
    let s = so3::skew(axis);
    let (sine, cosine) = angle_rad.sin_cos();
    let r = Matrix3::identity() + s * sine + s * s * (1.0 - cosine);
    let climb = axis * (pitch_m_per_rad * angle_rad);
    Isometry3::from_parts(Translation3::from(point - r * point + climb), so3::quaternion(&r))
}
