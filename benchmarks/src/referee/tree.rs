//! The referee's kinematics: products of transforms down the tree, and velocities read off axes and points.
//!
//! Deliberately plain. It uses the public description of the robot (poses of the joints in their parents,
//! axes, masses) and shares nothing with the aligned, vectorised pass the methods run on, so that an error
//! there is seen here. Velocity coordinates: linear velocity of the root origin, angular velocity of the
//! root, both in world axes, then one rate per independent coordinate.

use ik_core::robot::{FrameId, Joint, Motion, Robot, Root};
use nalgebra::{DMatrix, Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// Where everything is at one configuration.
#[derive(Clone, Debug)]
pub(super) struct Posture {
    /// Pose of every body in the world.
    pub(super) bodies: Vec<Isometry3<f64>>,
    /// Centre of mass of everything that moves (m, world); the origin if nothing has mass.
    pub(super) com: Vector3<f64>,
}

/// Rotation of a floating root stored as `[.. qx qy qz qw ..]`.
pub(super) fn root_rotation(q: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(q[6], q[3], q[4], q[5]))
}

fn root_pose(robot: &Robot, q: &[f64]) -> Isometry3<f64> {
    match robot.root() {
        Root::Fixed => Isometry3::identity(),
        Root::Floating => Isometry3::from_parts(Translation3::new(q[0], q[1], q[2]), root_rotation(q)),
    }
}

fn motion(joint: &Joint, value: f64) -> Isometry3<f64> {
    let (turn, slide) = match joint.motion {
        Motion::Revolute => (
            UnitQuaternion::from_axis_angle(&joint.axis, value),
            Vector3::zeros(),
        ),
        Motion::Prismatic => (UnitQuaternion::identity(), joint.axis.into_inner() * value),
    };
    Isometry3::from_parts(slide.into(), turn)
}

impl Posture {
    /// Walks the tree at `q` (length nq).
    pub(super) fn new(robot: &Robot, q: &[f64]) -> Self {
        let coordinates = &q[robot.root().nq()..];
        let mut bodies = vec![root_pose(robot, q)];
        for joint in robot.joints() {
            let value = joint.multiplier * coordinates[joint.coordinate] + joint.offset;
            bodies.push(bodies[joint.parent] * joint.x_parent_joint * motion(joint, value));
        }
        let com = centre_of_mass(robot, &bodies);
        Self { bodies, com }
    }

    /// Pose of a frame in the world.
    pub(super) fn frame(&self, robot: &Robot, frame: FrameId) -> Isometry3<f64> {
        let frame = &robot.frames()[frame.0];
        self.bodies[frame.body] * frame.x_body_frame
    }

    /// Calls `column(v, linear, angular)` with the velocity that each velocity coordinate gives to the point
    /// `p_w` (world) of a body; coordinates that do not move it are left out, one that moves it through
    /// several joints comes several times, to be added.
    pub(super) fn for_each_column(
        &self,
        robot: &Robot,
        body: usize,
        p_w: &Vector3<f64>,
        mut column: impl FnMut(usize, Vector3<f64>, Vector3<f64>),
    ) {
        let first = robot.root().nv();
        let mut at = body;
        while at > 0 {
            let joint = &robot.joints()[at - 1];
            // A joint leaves its own axis in place, so the axis may be read off the moved body.
            let axis_w = self.bodies[at].rotation * joint.axis.into_inner() * joint.multiplier;
            let (linear, angular) = match joint.motion {
                Motion::Revolute => (axis_w.cross(&(p_w - self.bodies[at].translation.vector)), axis_w),
                Motion::Prismatic => (axis_w, Vector3::zeros()),
            };
            column(first + joint.coordinate, linear, angular);
            at = joint.parent;
        }
        if robot.root() == Root::Floating {
            let arm = p_w - self.bodies[0].translation.vector;
            for (k, axis) in [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().enumerate() {
                column(k, axis, Vector3::zeros());
                column(3 + k, axis.cross(&arm), axis);
            }
        }
    }

    /// Adds the Jacobian of a frame's origin to three rows of `out`.
    pub(super) fn add_position_rows(
        &self,
        robot: &Robot,
        frame: FrameId,
        row: usize,
        out: &mut DMatrix<f64>,
    ) {
        let point = self.frame(robot, frame).translation.vector;
        self.for_each_column(robot, robot.frames()[frame.0].body, &point, |v, linear, _| {
            add(out, row, v, linear)
        });
    }

    /// Adds the Jacobian of a frame's angular velocity to three rows of `out`.
    pub(super) fn add_rotation_rows(
        &self,
        robot: &Robot,
        frame: FrameId,
        row: usize,
        out: &mut DMatrix<f64>,
    ) {
        let body = robot.frames()[frame.0].body;
        self.for_each_column(robot, body, &Vector3::zeros(), |v, _, angular| {
            add(out, row, v, angular)
        });
    }

    /// Adds the Jacobian of the centre of mass to three rows of `out`: the mean of those of all bodies.
    pub(super) fn add_com_rows(&self, robot: &Robot, row: usize, out: &mut DMatrix<f64>) {
        let total = moving_mass_kg(robot);
        for (body, mass_kg, point) in moving_masses(robot, &self.bodies) {
            self.for_each_column(robot, body, &point, |v, linear, _| {
                add(out, row, v, linear * (mass_kg / total))
            });
        }
    }
}

fn add(out: &mut DMatrix<f64>, row: usize, v: usize, value: Vector3<f64>) {
    for k in 0..3 {
        out[(row + k, v)] += value[k];
    }
}

/// Body, mass (kg) and centre of mass (m, world) of every body that can move and has mass.
pub(super) fn moving_masses<'a>(
    robot: &'a Robot,
    poses: &'a [Isometry3<f64>],
) -> impl Iterator<Item = (usize, f64, Vector3<f64>)> + 'a {
    let bodies = robot.bodies().iter().zip(poses).enumerate();
    bodies
        .skip(fixed_bodies(robot))
        .filter(|(_, (body, _))| body.mass_kg > 0.0)
        .map(|(i, (body, pose))| {
            (
                i,
                body.mass_kg,
                pose.rotation * body.com + pose.translation.vector,
            )
        })
}

/// Bodies that never move: the root, unless it floats.
fn fixed_bodies(robot: &Robot) -> usize {
    match robot.root() {
        Root::Fixed => 1,
        Root::Floating => 0,
    }
}

/// Mass of everything that can move (kg).
pub(super) fn moving_mass_kg(robot: &Robot) -> f64 {
    robot
        .bodies()
        .iter()
        .skip(fixed_bodies(robot))
        .map(|body| body.mass_kg)
        .sum()
}

fn centre_of_mass(robot: &Robot, poses: &[Isometry3<f64>]) -> Vector3<f64> {
    let mut moment = Vector3::zeros();
    let mut mass = 0.0;
    for (_, mass_kg, point) in moving_masses(robot, poses) {
        moment += point * mass_kg;
        mass += mass_kg;
    }
    if mass > 0.0 {
        moment / mass
    } else {
        Vector3::zeros()
    }
}
