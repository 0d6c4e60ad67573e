//! Forward kinematics as plain products of homogeneous matrices, from the public data of a robot alone.

#![allow(dead_code, reason = "each test file uses a part of the oracle")]
#![allow(clippy::unwrap_used, reason = "tests")]

use ik_core::robot::{Motion, Robot, Root};
use nalgebra::{Isometry3, Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3};

/// Rotation about a unit axis, Rodrigues' formula.
fn rodrigues(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    let k = axis.cross_matrix();
    Matrix3::identity() + k * angle.sin() + k * k * (1.0 - angle.cos())
}

fn homogeneous(rotation: &Matrix3<f64>, translation: &Vector3<f64>) -> Matrix4<f64> {
    let mut x = Matrix4::identity();
    x.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
    x.fixed_view_mut::<3, 1>(0, 3).copy_from(translation);
    x
}

fn matrix(pose: &Isometry3<f64>) -> Matrix4<f64> {
    let [x, y, z, w]: [f64; 4] = pose.rotation.coords.into();
    homogeneous(&quaternion_matrix(x, y, z, w), &pose.translation.vector)
}

/// Rotation matrix of a unit quaternion, written out.
pub(crate) fn quaternion_matrix(x: f64, y: f64, z: f64, w: f64) -> Matrix3<f64> {
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
}

/// Value of each joint at a configuration.
pub(crate) fn joint_values(robot: &Robot, q: &[f64]) -> Vec<f64> {
    let coordinates = &q[robot.root().nq()..];
    robot
        .joints()
        .iter()
        .map(|j| j.multiplier * coordinates[j.coordinate] + j.offset)
        .collect()
}

/// Pose of each body in the world.
pub(crate) fn bodies(robot: &Robot, q: &[f64]) -> Vec<Matrix4<f64>> {
    assert_eq!(q.len(), robot.nq());
    let mut poses = vec![match robot.root() {
        Root::Fixed => Matrix4::identity(),
        Root::Floating => homogeneous(
            &quaternion_matrix(q[3], q[4], q[5], q[6]),
            &Vector3::new(q[0], q[1], q[2]),
        ),
    }];
    for (joint, value) in robot.joints().iter().zip(joint_values(robot, q)) {
        let motion = match joint.motion {
            Motion::Revolute => homogeneous(&rodrigues(&joint.axis, value), &Vector3::zeros()),
            Motion::Prismatic => homogeneous(&Matrix3::identity(), &(joint.axis.into_inner() * value)),
        };
        poses.push(poses[joint.parent] * matrix(&joint.x_parent_joint) * motion);
    }
    poses
}

/// Pose of each frame in the world, in the order of `robot.frames()`.
pub(crate) fn frames(robot: &Robot, q: &[f64]) -> Vec<Matrix4<f64>> {
    let bodies = bodies(robot, q);
    robot
        .frames()
        .iter()
        .map(|frame| bodies[frame.body] * matrix(&frame.x_body_frame))
        .collect()
}

/// Mass, centre of mass and inertia about the world origin of the bodies from index `first`.
pub(crate) fn mass_properties(robot: &Robot, q: &[f64], first: usize) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let (mut mass, mut moment, mut inertia) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for (body, pose) in robot.bodies().iter().zip(bodies(robot, q)).skip(first) {
        let r: Matrix3<f64> = pose.fixed_view::<3, 3>(0, 0).into();
        let c: Vector3<f64> = r * body.com + pose.fixed_view::<3, 1>(0, 3);
        mass += body.mass_kg;
        moment += c * body.mass_kg;
        let about_origin = (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * body.mass_kg;
        inertia += r * body.inertia * r.transpose() + about_origin;
    }
    let com = if mass > 0.0 {
        moment / mass
    } else {
        Vector3::zeros()
    };
    (mass, com, inertia)
}

/// A configuration of plain numbers in [-1, 1] from a seed, with a unit quaternion for a floating root.
pub(crate) fn some_configuration(robot: &Robot, seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut q: Vec<f64> = (0..robot.nq()).map(|_| next()).collect();
    if robot.root() == Root::Floating {
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(q[6], q[3], q[4], q[5]));
        q[3..7].copy_from_slice(turn.coords.as_slice());
    }
    q
}

/// Refuses a robot that breaks a rule every robot keeps.
pub(crate) fn assert_sound(robot: &Robot) {
    assert_eq!(robot.bodies().len(), robot.joints().len() + 1);
    assert_eq!(robot.nq(), robot.root().nq() + robot.coordinates().len());
    assert_eq!(robot.nv(), robot.root().nv() + robot.coordinates().len());
    assert_eq!(robot.neutral().len(), robot.nq());
    for (i, joint) in robot.joints().iter().enumerate() {
        assert!(joint.parent <= i, "parents precede children");
        assert!(joint.coordinate < robot.coordinates().len());
        assert!((joint.axis.norm() - 1.0).abs() < 1e-12);
        assert!(joint.multiplier.is_finite() && joint.offset.is_finite());
        // Depth first: the parent is an ancestor of the body numbered just before.
        let mut ancestor = i;
        while ancestor != joint.parent {
            ancestor = robot.joints()[ancestor - 1].parent;
        }
        let mut path = robot.path(joint.parent).to_vec();
        path.push(i);
        assert_eq!(robot.path(i + 1), path);
    }
    assert!(robot.path(0).is_empty());
    for body in robot.bodies() {
        assert!(body.mass_kg >= 0.0 && body.mass_kg.is_finite());
        assert!(body.com.iter().chain(body.inertia.iter()).all(|x| x.is_finite()));
    }
    for frame in robot.frames() {
        assert!(frame.body < robot.bodies().len());
        assert_eq!(robot.frame_name(robot.frame(&frame.name).unwrap()), frame.name);
    }
    for (i, coordinate) in robot.coordinates().iter().enumerate() {
        assert_eq!(robot.coordinate(&coordinate.name).unwrap(), i);
        assert!(coordinate.limits.lower <= coordinate.limits.upper);
    }
}
