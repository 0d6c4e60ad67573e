//! Robots, problems and single steps for the tests of Davies' method.

use ik_core::boundary::Boundary;
use ik_core::configuration::integrate;
use ik_core::driver::{Driver, StepInput};
use ik_core::formulation::{Declined, Termination};
use ik_core::kinematics::{Page, forward};
use ik_core::problem::{Kind, Phase, PhaseId, Problem, ProblemParts, Supplies};
use ik_core::robot::{Robot, Root, UrdfOptions, embedded};
use ik_core::spatial::so3;
use ik_core::step::Window;
use ik_core::task::{OrientationCoordinates, Priority, Task, Track, Weights};
use ik_methods::registry::method;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::sync::Arc;

pub(crate) const WHOLE: PhaseId = PhaseId(0);

pub(crate) fn soft() -> Priority {
    Priority::Compromised(Weights::Uniform(1.0))
}

pub(crate) fn problem(robot: &Arc<Robot>, tasks: &[(&str, Track, Priority)]) -> Arc<Problem> {
    problem_in(robot, tasks, OrientationCoordinates::Log)
}

pub(crate) fn problem_in(
    robot: &Arc<Robot>,
    tasks: &[(&str, Track, Priority)],
    orientation: OrientationCoordinates,
) -> Arc<Problem> {
    let parts = ProblemParts {
        robot: Arc::clone(robot),
        tasks: tasks
            .iter()
            .map(|(name, track, _)| Task {
                name: (*name).into(),
                track: *track,
            })
            .collect(),
        phases: vec![Phase {
            name: "whole".into(),
            support: None,
            tasks: tasks
                .iter()
                .enumerate()
                .map(|(i, (_, _, p))| (i, p.clone()))
                .collect(),
        }],
        boundary: Boundary::None,
        objectives: vec![],
        kind: Kind::Tracking,
        supplies: Supplies {
            rates: true,
            preview_s: 0.0,
        },
        orientation,
    };
    Arc::new(Problem::new(parts).unwrap())
}

/// The tasks of the Bioloid gait.
pub(crate) fn gait_tasks(robot: &Robot, hands: Priority) -> Vec<(&'static str, Track, Priority)> {
    let frame = |name| robot.frame(name).unwrap();
    vec![
        ("right-foot", Track::Pose(frame("r_foot")), Priority::Hard),
        ("left-foot", Track::Pose(frame("l_foot")), Priority::Hard),
        ("waist", Track::Pose(frame("waist")), Priority::Hard),
        ("right-hand", Track::Position(frame("r_hand")), hands.clone()),
        ("left-hand", Track::Position(frame("l_hand")), hands),
    ]
}

pub(crate) fn bioloid() -> Arc<Robot> {
    Arc::new(embedded("bioloid").unwrap())
}

/// Bioloid with three wrist joints per arm, turning about z, y and x of the hand.
pub(crate) fn bioloid_with_wrists() -> Arc<Robot> {
    let mut text = include_str!("../../../ik-core/robots/bioloid.urdf").to_owned();
    for side in ["r", "l"] {
        let mount = format!("<link name=\"{side}_hand\"/>");
        assert!(text.contains(&mount), "the hand of the description has changed");
        let mut wrist = String::new();
        let mut parent = format!("{side}_mount");
        for (k, axis) in ["0 0 1", "0 1 0", "1 0 0"].iter().enumerate() {
            let child = if k == 2 {
                format!("{side}_hand")
            } else {
                format!("{side}_wrist_{k}")
            };
            wrist += &format!(
                "<link name=\"{child}\"/><joint name=\"{side}_wrist_joint_{k}\" type=\"continuous\"><parent \
                 link=\"{parent}\"/><child link=\"{child}\"/><axis xyz=\"{axis}\"/></joint>"
            );
            parent = child;
        }
        let mounted = format!("<link name=\"{side}_mount\"/>{wrist}");
        text = text
            .replace(
                &format!("<child link=\"{side}_hand\"/>"),
                &format!("<child link=\"{side}_mount\"/>"),
            )
            .replace(&mount, &mounted);
    }
    let options = UrdfOptions { root: Root::Floating };
    Arc::new(Robot::from_urdf_str(&text, "bioloid with wrists", &options).unwrap())
}

/// Numbers in ±1 from a seed (SplitMix64).
pub(crate) fn numbers(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

pub(crate) fn random_posture(robot: &Robot, seed: u64) -> Vec<f64> {
    integrate(robot, &robot.neutral(), &numbers(seed, robot.nv()))
}

/// Targets where `q` puts them.
pub(crate) fn targets(problem: &Problem, q: &[f64]) -> Vec<f64> {
    let robot = problem.robot();
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    let turn = |f| {
        so3::quaternion(&page.frame_rotation(robot, f))
            .coords
            .as_slice()
            .to_vec()
    };
    let mut x = Vec::new();
    for task in problem.tasks() {
        match task.track {
            Track::Position(f) => x.extend(page.frame_position(robot, f).iter()),
            Track::Orientation(f) => x.extend(turn(f)),
            Track::Pose(f) => {
                x.extend(page.frame_position(robot, f).iter());
                x.extend(turn(f));
            }
            Track::CentreOfMass => x.extend(page.centre_of_mass().iter()),
            Track::Posture => x.extend(&q[robot.root().nq()..]),
        }
    }
    x
}

/// A random change of every target, and the rates of the virtual coordinates it means over one second: in the order of
/// the problem's tasks, linear first, as angular velocity.
pub(crate) fn moved(problem: &Problem, x: &[f64], seed: u64, size: f64) -> (Vec<f64>, Vec<Vec<f64>>) {
    let (mut to, mut rates) = (x.to_vec(), Vec::new());
    for (i, (task, slot)) in problem.tasks().iter().zip(problem.slots()).enumerate() {
        let rows = task.track.rows(problem.robot());
        let change: Vec<f64> = numbers(seed * 100 + i as u64, rows)
            .iter()
            .map(|c| size * c)
            .collect();
        let turn = match task.track {
            Track::Pose(_) => Some(3),
            Track::Orientation(_) => Some(0),
            _ => None,
        };
        let plain = turn.unwrap_or(rows);
        for k in 0..plain {
            to[slot.x + k] += change[k];
        }
        if let Some(at) = turn {
            let c = &mut to[slot.x + at..slot.x + at + 4];
            let before = UnitQuaternion::from_quaternion(Quaternion::new(c[3], c[0], c[1], c[2]));
            let w = Vector3::from_column_slice(&change[at..]);
            c.copy_from_slice((so3::exp_quaternion(&w) * before).coords.as_slice());
        }
        rates.push(change);
    }
    (to, rates)
}

pub(crate) fn drive(
    problem: &Arc<Problem>,
    parameters: &str,
    q: &[f64],
    x0: &[f64],
    x1: &[f64],
    dt_s: f64,
) -> (Vec<f64>, Termination) {
    let contestant = method("davies")
        .unwrap()
        .build(&parameters.parse().unwrap())
        .unwrap();
    let mut driver = Driver::new(&*contestant.formulation, problem).unwrap();
    let rest = vec![0.0; problem.nxdot()];
    let data = [x0, &rest, x1, &rest].concat();
    let input = StepInput {
        q_prev: q,
        v_prev: &vec![0.0; problem.robot().nv()],
        dt_s,
        phase: WHOLE,
        targets: Window::new(&data, problem.nx(), problem.nxdot()).unwrap(),
        gains: &[],
    };
    let majors = driver.majors();
    let (termination, _) = driver.step(&input, majors);
    (driver.solution().v.clone(), termination)
}

pub(crate) fn declined(problem: &Arc<Problem>) -> Declined {
    let contestant = method("davies").unwrap().build(&toml::Table::new()).unwrap();
    Driver::new(&*contestant.formulation, problem).unwrap_err()
}
/// Problems whose N_s is square.
pub(crate) fn square_problems() -> Vec<Arc<Problem>> {
    let mut problems = Vec::new();
    let robot = bioloid();
    problems.push(problem(&robot, &gait_tasks(&robot, Priority::Hard)));
    let mut free = gait_tasks(&robot, Priority::Hard);
    free[2] = (
        "waist",
        Track::Orientation(robot.frame("waist").unwrap()),
        Priority::Hard,
    );
    free.push(("com", Track::CentreOfMass, Priority::Hard));
    problems.push(problem(&robot, &free));
    let legs = Arc::new(embedded("coman-legs").unwrap());
    let frame = |name| legs.frame(name).unwrap();
    problems.push(problem(
        &legs,
        &[
            ("com", Track::CentreOfMass, Priority::Hard),
            ("left", Track::Pose(frame("l_sole")), Priority::Hard),
            ("right", Track::Pose(frame("r_sole")), Priority::Hard),
            ("torso", Track::Orientation(frame("Waist")), Priority::Hard),
        ],
    ));
    for id in ["arm6", "slider-arm"] {
        let arm = Arc::new(embedded(id).unwrap());
        let tip = ik_core::robot::FrameId(arm.frames().len() - 1);
        problems.push(problem(&arm, &[("tip", Track::Pose(tip), Priority::Hard)]));
    }
    let arm7 = Arc::new(embedded("arm7").unwrap());
    problems.push(problem(&arm7, &[("rest", Track::Posture, Priority::Hard)]));
    problems
}

/// Bioloid with bent limbs, both feet flat, the waist 0.155 m over the ground.
pub(crate) fn stance(x: f64) -> Vec<f64> {
    let leg = [0.0, 0.0, -0.6486555, 1.2904366, -0.6417811, 0.0];
    let arm = [-0.3535033, -0.6403979, 1.5673627];
    let mut q = vec![x, 0.0, 0.155, 0.0, 0.0, 0.0, 1.0];
    q.extend(leg.iter().chain(&leg).chain(&arm));
    q.extend(arm.iter().map(|a| -a));
    q
}
