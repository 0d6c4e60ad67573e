//! A limb under test: its solver, the robot it belongs to, and the kinematics that judge it.

use crate::error::InputError;
use ik_core::kinematics::{Page, forward};
use ik_core::robot::{FrameId, Limits, Robot};
use ik_methods::reverse_decoupling::analyser::{
    DenavitHartenberg, Family, LimbReport, Verdict, denavit_hartenberg, limbs,
};
use ik_methods::reverse_decoupling::{Limb, Unsolved};
use nalgebra::{Isometry3, Matrix6, UnitQuaternion};
use std::f64::consts::TAU;

/// Joint values, base to tip (rad); a limb of fewer joints leaves the last ones at zero.
pub(super) type Joints = [f64; 6];

/// Solutions closer than this (rad, modulo full turns) are one.
const SAME_RAD: f64 = 1e-6;
/// What |S2|, |S4| and |C5| (a leg: |K| / l3) must exceed for joints to be compared.
const REGULAR: f64 = 1e-3;
/// The same of the determinant of the Jacobian of a general limb, lengths in parts of the limb: it is the product of such
/// factors.
const REGULAR_DETERMINANT: f64 = 1e-5;

/// Largest error of a pose (m and rad): what snapping to a singular set may cost.
pub(super) const SNAPPED: f64 = 2e-7;

/// The solutions of a pose with their branch numbers.
pub(super) type Answers = Vec<(Joints, u8)>;

/// A solver as the studies see it: a pose of the tip body in the base body, previous joints, and where its solutions go.
/// The studies take it as an argument, so that tests can hand them a wrong one.
pub(super) type Solve<'a> =
    dyn Fn(&Isometry3<f64>, &Joints, &mut Answers) -> Result<(), Unsolved> + Sync + 'a;

/// A limb with a closed form.
#[derive(Debug)]
pub(super) struct Subject {
    pub(super) robot: Robot,
    pub(super) report: LimbReport,
    pub(super) family: Family,
    pub(super) table: DenavitHartenberg,
    solver: Limb,
    /// The robot with all joints but those of the limb locked at zero: one tree pass costs no more than the limb.
    alone: Robot,
    /// Places of the joints in a configuration of `alone`.
    places: Vec<usize>,
    base: BodyFrame,
    tip: BodyFrame,
}

/// A body, by a frame fixed in it.
#[derive(Debug)]
struct BodyFrame {
    frame: FrameId,
    x_frame_body: Isometry3<f64>,
}

impl Subject {
    /// All limbs with a closed form of a robot, in the order of the analyser.
    ///
    /// # Errors
    /// None that a robot can cause; what the libraries refuse is reported with `place`.
    pub(super) fn of(robot: &Robot, place: &str) -> Result<Vec<Self>, InputError> {
        let closed = limbs(robot)
            .into_iter()
            .filter_map(|report| match report.verdict {
                Verdict::ClosedForm(family) => Some((report, family)),
                Verdict::NotCovered(_) => None,
            });
        closed
            .map(|(report, family)| Self::new(robot, report, family, place))
            .collect()
    }

    fn new(robot: &Robot, report: LimbReport, family: Family, place: &str) -> Result<Self, InputError> {
        let unfit = |e: &dyn std::fmt::Display| {
            InputError::value(place, "robots", robot.name(), &format!("another: {e}"))
        };
        let solver = Limb::new(robot, &report).map_err(|e| unfit(&e))?;
        let table = denavit_hartenberg(robot, &report).map_err(|e| unfit(&e))?;
        let others = robot.coordinates().iter().map(|c| c.name.as_str());
        let others = others.filter(|name| report.joint_names.iter().all(|joint| joint != name));
        let locked: Vec<(&str, f64)> = others.map(|name| (name, 0.0)).collect();
        let bad = |source| InputError::Robot {
            place: place.to_owned(),
            source: Box::new(source),
        };
        let alone = robot.with_locked(&locked).map_err(bad)?;
        let nq = alone.root().nq();
        let places = report.joint_names.iter().map(|name| alone.coordinate(name));
        let places = places.map(|at| at.map(|at| nq + at));
        let places = places.collect::<Result<_, _>>().map_err(bad)?;
        Ok(Self {
            base: BodyFrame::named(robot, &alone, report.base).map_err(bad)?,
            tip: BodyFrame::named(robot, &alone, report.tip).map_err(bad)?,
            robot: robot.clone(),
            family,
            table,
            solver,
            alone,
            places,
            report,
        })
    }

    /// Number of joints.
    pub(super) fn joints(&self) -> usize {
        self.places.len()
    }

    /// The solver under test.
    pub(super) fn solve(
        &self,
        pose: &Isometry3<f64>,
        previous: &Joints,
        answers: &mut Answers,
    ) -> Result<(), Unsolved> {
        answers.clear();
        let solved = self
            .solver
            .for_each_solution(pose, &previous[..self.joints()], |q, branch| {
                let mut joints = [0.0; 6];
                joints[..q.len()].copy_from_slice(q);
                answers.push((joints, branch));
            });
        solved.map(|_| ())
    }

    /// D-H angles θ of joint values.
    pub(super) fn angles(&self, joints: &Joints) -> Joints {
        let mut angles = [0.0; 6];
        for ((angle, q), row) in angles.iter_mut().zip(joints).zip(&self.table.rows) {
            *angle = row.sign * q + row.offset;
        }
        angles
    }

    /// Joint values of D-H angles.
    pub(super) fn joints_at(&self, angles: &Joints) -> Joints {
        let mut joints = [0.0; 6];
        for ((q, angle), row) in joints.iter_mut().zip(angles).zip(&self.table.rows) {
            *q = row.sign * (angle - row.offset);
        }
        joints
    }

    /// Limits of the joints.
    pub(super) fn limits(&self) -> Vec<Limits> {
        let coordinate = |joint: &usize| self.robot.joints()[*joint].coordinate;
        let limits = |joint| self.robot.coordinates()[coordinate(joint)].limits;
        self.report.joints.iter().map(limits).collect()
    }

    /// The quantities of the paper's indicators by the joint they belong to: S2 of joint 2, S4 of joint 4, C5 (a leg: K / l3)
    /// of joint 5. None in general families; a joint that a family does not ask about is none.
    pub(super) fn indicating(&self, joints: &Joints) -> Option<[Option<f64>; 3]> {
        let t = self.angles(joints);
        let (s2, s4) = (t[1].sin(), t[3].sin());
        match self.family {
            Family::Leg => {
                let (l3, l4) = (self.table.rows[2].a, self.table.rows[3].a);
                let k = (t[3] + t[4]).cos() * l3 + t[4].cos() * l4;
                Some([Some(s2), Some(s4), Some(k / l3)])
            }
            Family::Arm => Some([Some(s2), Some(s4), Some(t[4].cos())]),
            Family::FourJointArm => Some([Some(s2), None, None]),
            Family::General { .. } => None,
        }
    }

    /// Number of the branch by the indicators: 4 (S4 < 0) + 2 (C5, K < 0) + (S2 < 0).
    pub(super) fn indicated(&self, joints: &Joints) -> Option<u8> {
        let [s2, s4, c5] = self.indicating(joints)?;
        let negative = |value: Option<f64>| u8::from(value.is_some_and(|v| v < 0.0));
        Some(4 * negative(s4) + 2 * negative(c5) + negative(s2))
    }

    /// Number of solutions of a regular pose; none in general families.
    pub(super) fn solutions(&self) -> Option<u32> {
        match self.family {
            Family::Leg | Family::Arm => Some(8),
            Family::FourJointArm => Some(2),
            Family::General { .. } => None,
        }
    }

    /// Whether joints are far enough from every singular set to be compared.
    pub(super) fn is_regular(&self, joints: &Joints) -> bool {
        match self.indicating(joints) {
            Some(values) => values.into_iter().flatten().all(|v| v.abs() > REGULAR),
            None => self.determinant(joints).abs() > REGULAR_DETERMINANT,
        }
    }

    /// Determinant of the geometric Jacobian, lengths in parts of the limb.
    fn determinant(&self, joints: &Joints) -> f64 {
        let length: f64 = self.table.rows.iter().map(|row| row.a.abs() + row.d.abs()).sum();
        self.jacobian(joints).determinant() / length.powi(3)
    }

    /// Geometric Jacobian of the tip body in the base body: velocity of its origin (m), angular velocity (rad), a column
    /// per joint; columns of joints a limb does not have are zero.
    pub(super) fn jacobian(&self, joints: &Joints) -> Matrix6<f64> {
        let mut pose = Isometry3::identity();
        let mut lines = Vec::with_capacity(6);
        for (&joint, &q) in self.report.joints.iter().zip(joints) {
            let joint = &self.robot.joints()[joint];
            pose *= joint.x_parent_joint;
            lines.push((pose.rotation * joint.axis.into_inner(), pose.translation.vector));
            pose.rotation *= UnitQuaternion::from_axis_angle(&joint.axis, q);
        }
        let end = pose.translation.vector;
        let mut jacobian = Matrix6::zeros();
        for (mut column, (axis, point)) in jacobian.column_iter_mut().zip(lines) {
            column
                .fixed_rows_mut::<3>(0)
                .copy_from(&axis.cross(&(end - point)));
            column.fixed_rows_mut::<3>(3).copy_from(&axis);
        }
        jacobian
    }

    /// Kinematics with scratch of their own.
    pub(super) fn kinematics(&self) -> Kinematics<'_> {
        Kinematics {
            subject: self,
            page: Page::new(&self.alone),
            q: self.alone.neutral(),
        }
    }
}

impl BodyFrame {
    /// The frame of `alone` that has the name of a body of `robot`: a link names its body and is a frame at its origin.
    fn named(robot: &Robot, alone: &Robot, body: usize) -> Result<Self, ik_core::robot::RobotError> {
        let name = &robot.bodies()[body].name;
        let of_robot = &robot.frames()[robot.frame(name)?.0];
        Ok(Self {
            frame: alone.frame(name)?,
            x_frame_body: of_robot.x_body_frame.inverse(),
        })
    }

    fn pose(&self, robot: &Robot, page: &Page) -> Isometry3<f64> {
        page.frame_pose(robot, self.frame) * self.x_frame_body
    }
}

/// Forward kinematics of a limb by the robot's tree pass.
#[derive(Debug)]
pub(super) struct Kinematics<'a> {
    subject: &'a Subject,
    page: Page,
    q: Vec<f64>,
}

impl Kinematics<'_> {
    /// One tree pass.
    pub(super) fn pass(&mut self, joints: &Joints) {
        for (place, value) in self.subject.places.iter().zip(joints) {
            self.q[*place] = *value;
        }
        forward(&self.subject.alone, &self.q, &mut self.page);
    }

    /// Pose of the tip body in the base body.
    pub(super) fn tip(&mut self, joints: &Joints) -> Isometry3<f64> {
        self.pass(joints);
        let (subject, page) = (self.subject, &self.page);
        subject.base.pose(&subject.alone, page).inverse() * subject.tip.pose(&subject.alone, page)
    }

    /// The larger of both parts of [`Kinematics::error`] (m or rad); what is not a number is worse than any error.
    pub(super) fn miss(&mut self, wanted: &Isometry3<f64>, joints: &Joints) -> f64 {
        let (metres, radians) = self.error(wanted, joints);
        let both = metres.max(radians);
        if metres.is_finite() && radians.is_finite() {
            both
        } else {
            f64::MAX
        }
    }

    /// Distance (m) and rotation (rad) from a pose to that of the joints.
    pub(super) fn error(&mut self, wanted: &Isometry3<f64>, joints: &Joints) -> (f64, f64) {
        let reached = self.tip(joints);
        let off = reached.rotation * wanted.rotation.inverse();
        (
            (reached.translation.vector - wanted.translation.vector).norm(),
            off.angle(),
        )
    }
}

/// The angle in [−π, π] that is the same direction.
pub(super) fn wrap(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// Largest difference of two postures, modulo full turns (rad).
pub(super) fn away(a: &Joints, b: &Joints) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| wrap(a - b).abs());
    differences.fold(0.0, f64::max)
}

/// How many of the answers differ.
pub(super) fn distinct(answers: &[(Joints, u8)]) -> u32 {
    let same = |a: &Joints, b: &Joints| a.iter().zip(b).all(|(a, b)| wrap(a - b).abs() < SAME_RAD);
    let is_first = |(i, answer): (usize, &(Joints, u8))| {
        u32::from(!answers[..i].iter().any(|other| same(&answer.0, &other.0)))
    };
    answers.iter().enumerate().map(is_first).sum()
}
