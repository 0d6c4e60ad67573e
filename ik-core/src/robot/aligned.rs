//! The same tree with every body frame turned so that its joint axis is the body's z axis.
//!
//! A joint then needs one sine and one cosine mixing two columns, and its axis in the world is the third
//! column of the body's rotation: the form fast tree passes want (Featherstone 2008, section 4.4, uses the
//! same convention).
//!
//! With `A_b` the rotation of the aligned frame in the frame of body b (same origin, `A_b e_z = axis`, `A_0 =
//! 1`): joint pose `A_p^T R A_c`, `A_p^T p`; points of body b `A_b^T p`.

use super::model::{Body, Frame, Joint, Motion};
use nalgebra::{Matrix3, Vector3};

/// A joint that turns about or slides along z of its own frame.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AlignedJoint {
    pub(crate) motion: Motion,
    /// Body that carries the joint.
    pub(crate) parent: usize,
    /// Rotation of the aligned joint frame (= aligned child body at value 0) in the aligned parent body
    /// frame.
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

/// A rotation whose third column is `axis`: the shortest one in the upper half space, preceded by a half turn
/// about x in the lower one, so that it is exact for axes along +-x, +-y, +-z and well conditioned
/// everywhere.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{EMBEDDED, Robot, Root, UrdfOptions, embedded};
    use nalgebra::{Isometry3, Point3, UnitQuaternion};

    /// Body poses from the aligned tree: one plane rotation or one slide along z for each joint.
    fn aligned_bodies(robot: &Robot, q: &[f64]) -> Vec<(Matrix3<f64>, Vector3<f64>)> {
        let root = root_pose(robot, q);
        let mut poses = vec![(
            root.rotation.to_rotation_matrix().into_inner(),
            root.translation.vector,
        )];
        for joint in &robot.aligned {
            let value = joint.multiplier * q[robot.root().nq() + joint.coordinate] + joint.offset;
            let (r_parent, p_parent) = poses[joint.parent];
            let (r, p) = (
                r_parent * joint.r_parent_joint,
                r_parent * joint.p_parent_joint + p_parent,
            );
            poses.push(match joint.motion {
                Motion::Revolute => {
                    let (s, c) = value.sin_cos();
                    (r * Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0), p)
                }
                Motion::Prismatic => (r, p + r.column(2) * value),
            });
        }
        poses
    }

    fn public_bodies(robot: &Robot, q: &[f64]) -> Vec<Isometry3<f64>> {
        let mut poses = vec![root_pose(robot, q)];
        for joint in robot.joints() {
            let value = joint.multiplier * q[robot.root().nq() + joint.coordinate] + joint.offset;
            poses.push(poses[joint.parent] * joint.x_parent_child(value));
        }
        poses
    }

    fn root_pose(robot: &Robot, q: &[f64]) -> Isometry3<f64> {
        match robot.root() {
            Root::Fixed => Isometry3::identity(),
            Root::Floating => {
                let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[6], q[3], q[4], q[5]));
                Isometry3::from_parts(Vector3::new(q[0], q[1], q[2]).into(), turn)
            }
        }
    }

    /// Largest difference of frames and centres of mass between the two trees; also checks the z axes.
    fn difference(robot: &Robot, q: &[f64]) -> f64 {
        let (aligned, public) = (aligned_bodies(robot, q), public_bodies(robot, q));
        let mut worst: f64 = 0.0;
        let mut see = |error: f64| {
            assert!(error.is_finite());
            worst = worst.max(error);
        };
        for ((body, r_frame, p_frame), frame) in robot.aligned_frames.iter().zip(robot.frames()) {
            let (r, p) = aligned[*body];
            let expected = public[frame.body] * frame.x_body_frame;
            see((r * r_frame - expected.rotation.to_rotation_matrix().matrix())
                .abs()
                .sum());
            see((r * p_frame + p - expected.translation.vector).abs().sum());
        }
        for (i, ((mass, com), body)) in robot.aligned_bodies.iter().zip(robot.bodies()).enumerate() {
            let (r, p) = aligned[i];
            see((r * com + p - (public[i] * Point3::from(body.com)).coords)
                .abs()
                .sum());
            see((mass - body.mass_kg).abs());
        }
        for (i, joint) in robot.joints().iter().enumerate() {
            see(
                (aligned[i + 1].0.column(2) - public[i + 1] * joint.axis.into_inner())
                    .abs()
                    .sum(),
            );
        }
        worst
    }

    /// Numbers between -1.5 and 1.5 that repeat late: multiples of the golden ratio.
    fn some_configuration(robot: &Robot, start: usize) -> Vec<f64> {
        (0..robot.nq())
            .map(|i| ((start + i) as f64 * 0.618_033_988_749_895).fract() * 3.0 - 1.5)
            .collect()
    }

    fn assert_same_motion(robot: &Robot) {
        for start in 0..5 {
            let worst = difference(robot, &some_configuration(robot, 100 * start));
            assert!(worst < 1e-12, "{}: {worst:e}", robot.name());
        }
    }

    #[test]
    fn the_aligned_tree_moves_like_the_public_one() {
        for entry in EMBEDDED {
            let robot = embedded(entry.id).expect("embedded robots are sound");
            assert_same_motion(&robot);
        }
    }

    #[test]
    fn the_aligned_trees_of_the_reference_robots_move_like_the_public_ones() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/robots");
        let Ok(entries) = std::fs::read_dir(&folder) else {
            eprintln!(
                "skipped: the reference robots are not installed ({})",
                folder.display()
            );
            return;
        };
        let mut seen = 0;
        for entry in entries.flatten() {
            let file = entry.path().join(entry.file_name()).with_extension("urdf");
            for root in [Root::Fixed, Root::Floating]
                .into_iter()
                .filter(|_| file.is_file())
            {
                let robot =
                    Robot::from_urdf_file(&file, &UrdfOptions { root }).expect("reference robots are sound");
                assert_same_motion(&robot);
                seen += 1;
            }
        }
        assert!(seen >= 40, "{seen}");
    }

    #[test]
    fn the_turn_is_a_rotation_with_the_axis_as_z_and_exact_on_the_coordinate_axes() {
        let levels: [f64; 7] = [-1.0, -0.5, -1e-9, 0.0, 1e-9, 0.5, 1.0];
        let digits = |n: usize| Vector3::new(levels[n % 7], levels[n / 7 % 7], levels[n / 49]);
        for axis in (0..343)
            .map(digits)
            .filter(|axis| axis.norm() > 0.1)
            .map(|axis| axis.normalize())
        {
            let turn = rotation_taking_z_to(&axis);
            assert!((turn * turn.transpose() - Matrix3::identity()).amax() < 1e-15);
            assert!((turn.determinant() - 1.0).abs() < 1e-15);
            assert!((turn.column(2) - axis).amax() < 1e-16);
        }
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()]
            .into_iter()
            .flat_map(|axis| [axis, -axis])
        {
            let turn = rotation_taking_z_to(&axis);
            assert!(
                turn.iter().all(|entry| [-1.0, 0.0, 1.0].contains(entry)),
                "{turn}"
            );
        }
    }
}
