//! Kinematics by successive screw displacements: the description of a robot by one axis and one point per joint.
//!
//! Every joint is given by its axis `s` and a point `s0` of it in *one* frame, that of the root, at the *zero pose*,
//! where the value of every joint is zero. The displacement of a link from its zero pose is the product
//! `T_root A_1 … A_i` over the path from the root, with `A` of [`displacement`]; the current pose of a frame is the
//! displacement of its link times its zero pose; the current axis of a joint is its axis at zero displaced with the link
//! that *carries* it.
//!
//! Source: Tsai (1999), Robot Analysis, successive screw displacements; eqs. (1)–(3) of the Davies network paper on a
//! Bioloid humanoid. No local link frames enter after the description is made, so this is an independent check of
//! [`super::forward`]. It allocates; the control step reads the same screws off a page, see [`super::screws`].

use crate::configuration::root_pose;
use crate::robot::{FrameId, Joint, Motion, Robot};
use crate::spatial::screw::{Screw, displacement};
use nalgebra::{Isometry3, Point3, Vector3};

/// The line of a joint in the root frame at the zero pose. The point of a prismatic joint is any point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLine {
    /// Unit vector.
    pub axis: Vector3<f64>,
    /// A point of the axis (m).
    pub point: Vector3<f64>,
}

/// A robot described at its zero pose, in the frame of its root.
#[derive(Clone, Debug)]
pub struct ZeroPose<'a> {
    robot: &'a Robot,
    lines: Vec<JointLine>,
    frames: Vec<Isometry3<f64>>,
}

impl<'a> ZeroPose<'a> {
    /// Describes `robot`.
    pub fn of(robot: &'a Robot) -> Self {
        let mut bodies = vec![Isometry3::identity()];
        for joint in robot.joints() {
            bodies.push(bodies[joint.parent] * joint.x_parent_joint);
        }
        let line = |(joint, body): (&Joint, &Isometry3<f64>)| JointLine {
            axis: body.rotation * joint.axis.into_inner(),
            point: body.translation.vector,
        };
        let lines = robot.joints().iter().zip(&bodies[1..]).map(line).collect();
        let frames = robot
            .frames()
            .iter()
            .map(|frame| bodies[frame.body] * frame.x_body_frame)
            .collect();
        Self { robot, lines, frames }
    }

    /// The line of each joint, in the order of [`Robot::joints`].
    pub fn lines(&self) -> &[JointLine] {
        &self.lines
    }

    /// The zero pose of each frame in the root frame, in the order of [`Robot::frames`].
    pub fn frames(&self) -> &[Isometry3<f64>] {
        &self.frames
    }

    /// The displacement of each body at the configuration `q` (length `robot.nq()`): takes points of the body from
    /// their place at the zero pose, in the root frame, to their place in the world.
    pub fn displacements(&self, q: &[f64]) -> Vec<Isometry3<f64>> {
        let coordinates = &q[self.robot.root().nq()..];
        let mut displacements = vec![root_pose(self.robot, q)];
        for (joint, line) in self.robot.joints().iter().zip(&self.lines) {
            let value = joint.multiplier * coordinates[joint.coordinate] + joint.offset;
            let own = displacement(joint.motion, &line.axis, &line.point, value);
            displacements.push(displacements[joint.parent] * own);
        }
        displacements
    }

    /// Pose of a frame in the world, from the `displacements` of a configuration.
    pub fn frame_pose(&self, displacements: &[Isometry3<f64>], frame: FrameId) -> Isometry3<f64> {
        displacements[self.robot.frames()[frame.0].body] * self.frames[frame.0]
    }

    /// Normalised screw of a joint in the world frame, written at the world origin, from the `displacements` of a
    /// configuration. Per unit rate of the joint itself: where it follows a coordinate, its multiplier is to be applied.
    pub fn screw(&self, displacements: &[Isometry3<f64>], joint: usize) -> Screw {
        let JointLine { axis, point } = self.lines[joint];
        let carrier = &displacements[self.robot.joints()[joint].parent];
        let axis = carrier.rotation * axis;
        match self.robot.joints()[joint].motion {
            Motion::Revolute => Screw::revolute(&axis, &(carrier * Point3::from(point)).coords),
            Motion::Prismatic => Screw::prismatic(&axis),
        }
    }
}
