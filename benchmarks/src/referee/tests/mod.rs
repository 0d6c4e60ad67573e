//! Tests of the referee: robots and problems they share.

#![allow(clippy::float_cmp, reason = "hand-computed values are chosen to be exact")]
#![allow(clippy::print_stdout, reason = "a test that is skipped says why")]

mod balance;
mod certificate;
mod judge;
mod kinematics;
mod trace;

use super::{JudgeSpec, Referee};
use ik_core::boundary::Boundary;
use ik_core::problem::{Kind, Phase, Problem, ProblemParts, Supplies};
use ik_core::robot::{
    FrameId, Inertial, JointKind, JointSpec, Limits, LinkSpec, Mimic, Robot, RobotBuilder, Root, embedded,
};
use ik_core::task::{OrientationCoordinates, Priority, Task, Track, Weights};
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};
use std::sync::Arc;

/// A reproducible sequence of numbers (splitmix64, Steele, Lea & Flood 2014).
struct Draw(u64);

impl Draw {
    /// The next number in [-1, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// A configuration: root within a metre, any attitude, joints within 1.5 rad (m).
    fn configuration(&mut self, robot: &Robot) -> Vec<f64> {
        let mut q = Vec::new();
        if robot.root() == Root::Floating {
            q.extend([self.next(), self.next(), self.next()]);
            let turn = Vector3::new(self.next(), self.next(), self.next()) * 3.0;
            q.extend(UnitQuaternion::from_scaled_axis(turn).coords.iter());
        }
        q.extend(robot.coordinates().iter().map(|_| 1.5 * self.next()));
        q
    }
}

fn link(name: &str, mass_kg: f64, com: Vector3<f64>) -> LinkSpec {
    let inertial = Inertial {
        mass_kg,
        com,
        inertia: Matrix3::identity() * 0.01,
    };
    LinkSpec {
        name: name.to_owned(),
        inertial: (mass_kg > 0.0).then_some(inertial),
    }
}

fn joint(kind: JointKind, (parent, child): (&str, &str), origin: [f64; 3], axis: [f64; 3]) -> JointSpec {
    JointSpec {
        name: format!("to_{child}"),
        kind,
        parent: parent.to_owned(),
        child: child.to_owned(),
        origin: Isometry3::translation(origin[0], origin[1], origin[2]),
        axis: axis.into(),
        limits: Some(Limits::UNLIMITED),
        mimic: None,
    }
}

/// A carriage of 2 kg on two sliders: its centre of mass and its frame `tip` stand at `(q0, q1, 0)`.
fn slides() -> Robot {
    RobotBuilder::new("slides")
        .link(link("base", 7.0, Vector3::x()))
        .link(link("beam", 0.0, Vector3::zeros()))
        .link(link("tip", 2.0, Vector3::zeros()))
        .joint(joint(
            JointKind::Prismatic,
            ("base", "beam"),
            [0.0; 3],
            [1.0, 0.0, 0.0],
        ))
        .joint(joint(
            JointKind::Prismatic,
            ("beam", "tip"),
            [0.0; 3],
            [0.0, 1.0, 0.0],
        ))
        .build()
        .unwrap()
}

/// Two links of 1 m in the x–y plane, turning about z, and the frame `tip` at their end.
fn two_links() -> Robot {
    RobotBuilder::new("two links")
        .link(link("base", 0.0, Vector3::zeros()))
        .link(link("upper", 1.0, Vector3::x()))
        .link(link("lower", 1.0, Vector3::x()))
        .link(link("tip", 0.0, Vector3::zeros()))
        .joint(joint(
            JointKind::Revolute,
            ("base", "upper"),
            [0.0; 3],
            [0.0, 0.0, 1.0],
        ))
        .joint(joint(
            JointKind::Revolute,
            ("upper", "lower"),
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
        ))
        .joint(joint(
            JointKind::Fixed,
            ("lower", "tip"),
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
        ))
        .build()
        .unwrap()
}

/// A flying body with a slider, an oblique hinge and a hinge that follows it.
fn linkage() -> Robot {
    let mut slider = joint(
        JointKind::Prismatic,
        ("hull", "slide"),
        [0.1, 0.2, 0.3],
        [0.6, 0.0, 0.8],
    );
    slider.origin.rotation = UnitQuaternion::from_euler_angles(0.3, -0.4, 0.5);
    let hinge = joint(
        JointKind::Revolute,
        ("slide", "finger"),
        [0.0, 0.1, 0.2],
        [0.0, 0.6, 0.8],
    );
    let mut follower = joint(
        JointKind::Revolute,
        ("finger", "nail"),
        [0.2, 0.0, 0.1],
        [1.0, 0.0, 0.0],
    );
    follower.mimic = Some(Mimic {
        joint: hinge.name.clone(),
        multiplier: -0.5,
        offset: 0.3,
    });
    RobotBuilder::new("linkage")
        .floating_root()
        .link(link("hull", 3.0, Vector3::new(0.1, 0.0, -0.1)))
        .link(link("slide", 1.0, Vector3::new(0.0, 0.2, 0.0)))
        .link(link("finger", 0.5, Vector3::new(0.1, 0.1, 0.1)))
        .link(link("nail", 0.25, Vector3::new(0.0, 0.0, 0.3)))
        .joint(slider)
        .joint(hinge)
        .joint(follower)
        .build()
        .unwrap()
}

fn robots() -> Vec<Robot> {
    let ids = ["coman", "coman-legs", "arm6", "arm7", "slider-arm", "pendulum"];
    ids.iter()
        .map(|id| embedded(id).unwrap())
        .chain([slides(), two_links(), linkage()])
        .collect()
}

fn frame(robot: &Robot, name: &str) -> FrameId {
    robot.frame(name).unwrap()
}

/// A problem from `(name, what, priority)` in one phase.
fn parts(robot: Robot, tasks: Vec<(&str, Track, Priority)>, boundary: Boundary) -> ProblemParts {
    let phase = tasks
        .iter()
        .enumerate()
        .map(|(i, (_, _, priority))| (i, priority.clone()))
        .collect();
    ProblemParts {
        robot: Arc::new(robot),
        tasks: tasks
            .into_iter()
            .map(|(name, track, _)| Task {
                name: name.to_owned(),
                track,
            })
            .collect(),
        phases: vec![Phase {
            name: "only".to_owned(),
            support: None,
            tasks: phase,
        }],
        boundary,
        objectives: Vec::new(),
        kind: Kind::Tracking,
        supplies: Supplies {
            rates: true,
            preview_s: 0.0,
        },
        orientation: OrientationCoordinates::RollPitchYaw,
    }
}

fn problem(robot: Robot, tasks: Vec<(&str, Track, Priority)>, boundary: Boundary) -> Arc<Problem> {
    Arc::new(Problem::new(parts(robot, tasks, boundary)).unwrap())
}

fn soft() -> Priority {
    Priority::Compromised(Weights::Uniform(1.0))
}

/// The problem of the shoot-out: both soles and the torso's attitude hard, the centre of mass compromised.
fn shoot_out(boundary: Boundary) -> Arc<Problem> {
    let robot = embedded("coman-legs").unwrap();
    let (left, right, torso) = (
        frame(&robot, "l_sole"),
        frame(&robot, "r_sole"),
        frame(&robot, "Waist"),
    );
    let tasks = vec![
        ("com", Track::CentreOfMass, soft()),
        ("left", Track::Pose(left), Priority::Hard),
        ("right", Track::Pose(right), Priority::Hard),
        ("torso", Track::Orientation(torso), Priority::Hard),
    ];
    problem(robot, tasks, boundary)
}

fn plain_spec() -> JudgeSpec {
    JudgeSpec {
        soft_tolerance_m: 0.08,
        exit_joints: Vec::new(),
        torque_supports: Vec::new(),
        soles: Vec::new(),
    }
}

fn referee(problem: &Arc<Problem>) -> Referee {
    Referee::new(problem, plain_spec()).unwrap()
}
