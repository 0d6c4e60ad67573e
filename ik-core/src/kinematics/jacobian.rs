//! Geometric Jacobians of named frames.
//!
//! A joint moves exactly the frames behind it, so only the columns on the path from the root to the frame differ from
//! zero: revolute `[z × (p − o); z]`, prismatic `[z; 0]`.

use super::{BodyPose, Page};
use crate::robot::{FrameId, Motion, Robot, Root};
use crate::spatial::lane::{self, AXES, Lane, ZERO};
use nalgebra::{Matrix3, Matrix6xX, Vector3};

/// Axes in which a frame Jacobian is expressed; the reference point is always the frame's origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// World axes.
    World,
    /// The frame's own axes.
    Body,
}

/// Linear and angular velocity (world axes) that a unit rate of joint `i` gives the point `p` behind it.
#[inline(always)]
pub(crate) fn joint_column(motion: Motion, pose: &BodyPose, p: Lane) -> (Lane, Lane) {
    match motion {
        Motion::Revolute => (lane::cross(pose.z, lane::sub(p, pose.origin)), pose.z),
        Motion::Prismatic => (pose.z, ZERO),
    }
}

/// Calls `write(v, linear, angular)` for each root coordinate and each joint on the path to `body`; several joints may
/// share a coordinate (mimic), so contributions add up.
#[inline(always)]
pub(crate) fn for_each_column(
    robot: &Robot,
    page: &Page,
    body: usize,
    p: Lane,
    mut write: impl FnMut(usize, Lane, Lane),
) {
    if robot.root() == Root::Floating {
        let arm = lane::sub(p, page.bodies[0].origin);
        for (k, axis) in AXES.into_iter().enumerate() {
            write(k, axis, ZERO);
            write(3 + k, lane::cross(axis, arm), axis);
        }
    }
    for_each_joint_column(robot, page, body, p, write);
}

/// The part of [`for_each_column`] that is not the root's: each joint on the path to `body`.
#[inline(always)]
pub(crate) fn for_each_joint_column(
    robot: &Robot,
    page: &Page,
    body: usize,
    p: Lane,
    mut write: impl FnMut(usize, Lane, Lane),
) {
    let first = robot.root().nv();
    for &i in robot.path(body) {
        let joint = &robot.aligned[i];
        let (linear, angular) = joint_column(joint.motion, &page.bodies[i + 1], p);
        let m = joint.multiplier;
        write(
            first + joint.coordinate,
            lane::scale(linear, m),
            lane::scale(angular, m),
        );
    }
}

/// Writes the 6 × nv Jacobian of `frame`: rows 0–2 the velocity of its origin (m/s per unit rate), rows 3–5 its angular
/// velocity (rad/s per unit rate).
///
/// `out` has `robot.nv()` columns. [`frame_jacobian`] is the allocating convenience.
pub fn frame_jacobian_into(robot: &Robot, page: &Page, frame: FrameId, axes: Axes, out: &mut Matrix6xX<f64>) {
    let (body, r, p_body) = &robot.aligned_frames[frame.0];
    let pose = &page.bodies[*body];
    let to_axes = match axes {
        Axes::World => Matrix3::identity(),
        Axes::Body => pose.rotation(r).transpose(),
    };
    out.fill(0.0);
    for_each_column(robot, page, *body, pose.point(p_body), |v, linear, angular| {
        let (linear, angular): (Vector3<f64>, Vector3<f64>) = (
            to_axes * lane::to_vector(linear),
            to_axes * lane::to_vector(angular),
        );
        let mut column = out.column_mut(v);
        for k in 0..3 {
            column[k] += linear[k];
            column[3 + k] += angular[k];
        }
    });
}

/// The 6 × nv Jacobian of `frame`; see [`frame_jacobian_into`].
pub fn frame_jacobian(robot: &Robot, page: &Page, frame: FrameId, axes: Axes) -> Matrix6xX<f64> {
    let mut out = Matrix6xX::zeros(robot.nv());
    frame_jacobian_into(robot, page, frame, axes, &mut out);
    out
}
