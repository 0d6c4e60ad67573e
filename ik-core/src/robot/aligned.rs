//! The same tree with every body frame turned so that its joint axis is the body's z axis.
//!
//! A joint then needs one sine and one cosine mixing two columns, and its axis in the world is the third column of the
//! body's rotation: the form fast tree passes want (Featherstone 2008, section 4.4, uses the same convention).
//!
//! With `A_b` the rotation of the aligned frame in the frame of body b (same origin, `A_b e_z = axis`, `A_0 = 1`):
//! joint pose `A_p^T R A_c`, `A_p^T p`; points of body b `A_b^T p`.

use super::model::{Body, Frame, Joint, Motion};
use nalgebra::{Matrix3, Vector3};

/// A joint that turns about or slides along z of its own frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AlignedJoint {
    pub(crate) motion: Motion,
    /// Body that carries the joint.
    pub(crate) parent: usize,
    /// Rotation of the aligned joint frame (= aligned child body at value 0) in the aligned parent body frame.
    pub(crate) r_parent_joint: Matrix3<f64>,
    /// Origin of the joint frame in the aligned parent body frame, m.
    pub(crate) p_parent_joint: Vector3<f64>,
    /// Index of the independent coordinate; the joint value is `multiplier * coordinate + offset`.
    pub(crate) coordinate: usize,
    pub(crate) multiplier: f64,
    pub(crate) offset: f64,
}

/// Joints, bodies (mass, centre of mass) and frames (body, rotation, origin), all in aligned body frames.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AlignedTree {
    pub(crate) joints: Vec<AlignedJoint>,
    pub(crate) bodies: Vec<(f64, Vector3<f64>)>,
    pub(crate) frames: Vec<(usize, Matrix3<f64>, Vector3<f64>)>,
}

/// Turns every body frame of a tree (`bodies.len() == joints.len() + 1`) to its joint axis.
pub(crate) fn align(joints: &[Joint], bodies: &[Body], frames: &[Frame]) -> AlignedTree {
    let turns: Vec<Matrix3<f64>> = std::iter::once(Matrix3::identity())
        .chain(joints.iter().map(|joint| rotation_taking_z_to(&joint.axis)))
        .collect();
    AlignedTree {
        joints: joints
            .iter()
            .enumerate()
            .map(|(i, joint)| align_joint(joint, &turns[joint.parent], &turns[i + 1]))
            .collect(),
        bodies: bodies
            .iter()
            .zip(&turns)
            .map(|(body, turn)| (body.mass_kg, turn.tr_mul(&body.com)))
            .collect(),
        frames: frames
            .iter()
            .map(|frame| align_frame(frame, &turns[frame.body]))
            .collect(),
    }
}

fn align_joint(joint: &Joint, parent_turn: &Matrix3<f64>, child_turn: &Matrix3<f64>) -> AlignedJoint {
    let rotation = joint.x_parent_joint.rotation.to_rotation_matrix();
    AlignedJoint {
        motion: joint.motion,
        parent: joint.parent,
        r_parent_joint: parent_turn.tr_mul(&(rotation.matrix() * child_turn)),
        p_parent_joint: parent_turn.tr_mul(&joint.x_parent_joint.translation.vector),
        coordinate: joint.coordinate,
        multiplier: joint.multiplier,
        offset: joint.offset,
    }
}

fn align_frame(frame: &Frame, turn: &Matrix3<f64>) -> (usize, Matrix3<f64>, Vector3<f64>) {
    let rotation = frame.x_body_frame.rotation.to_rotation_matrix();
    (
        frame.body,
        turn.tr_mul(rotation.matrix()),
        turn.tr_mul(&frame.x_body_frame.translation.vector),
    )
}

/// A rotation whose third column is `axis`: the shortest one in the upper half space, preceded by a half turn about x in
/// the lower one, so that it is exact for axes along +-x, +-y, +-z and well conditioned everywhere.
fn rotation_taking_z_to(axis: &Vector3<f64>) -> Matrix3<f64> {
    if axis.z < 0.0 {
        let half_turn_about_x = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
        return rotation_taking_z_to(&-axis) * half_turn_about_x;
    }
    let (x, y, z) = (axis.x, axis.y, axis.z);
    let k = 1.0 / (1.0 + z);
    Matrix3::new(
        1.0 - k * x * x,
        -k * x * y,
        x,
        -k * x * y,
        1.0 - k * y * y,
        y,
        -x,
        -y,
        z,
    )
}
