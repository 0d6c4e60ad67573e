//! Whole motions: orders of the integration rules, correction, and rest.

use crate::support::*;
use ik_core::configuration::integrate;
use ik_core::driver::{Driver, StepInput};
use ik_core::formulation::Termination;
use ik_core::kinematics::jacobian::{Axes, frame_jacobian};
use ik_core::kinematics::{Page, forward};
use ik_core::problem::Problem;
use ik_core::robot::{Robot, Root, UrdfOptions};
use ik_core::spatial::so3;
use ik_core::step::Window;
use ik_core::task::{Priority, Track};
use ik_methods::registry::method;
use nalgebra::{DVector, Vector3};
use std::sync::Arc;

/// A leg of six joints under a root with a mark that is offset and turned.
fn leg_under_a_marked_root() -> Arc<Robot> {
    let mass =
        "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>";
    let mut text = format!(
        "<robot name='leg'><link name='body'>{mass}</link><link name='mark'/><joint name='m' type='fixed'><parent \
         link='body'/><child link='mark'/><origin xyz='0.4 -0.3 0.5' rpy='0.7 -0.4 1.1'/></joint>"
    );
    let joints = [
        ("0.1 0.2 0", "0 0 1"),
        ("0 0 0.05", "1 0 0"),
        ("0 0.05 0", "0 1 0"),
        ("0 0 -0.3", "0 1 0"),
        ("0.02 0 -0.3", "0 1 0"),
        ("0 0 -0.03", "1 0 0"),
    ];
    let mut parent = "body".to_owned();
    for (i, (origin, axis)) in joints.iter().enumerate() {
        text += &format!(
            "<link name='l{i}'>{mass}</link><joint name='j{i}' type='continuous'><parent link='{parent}'/><child \
             link='l{i}'/><origin xyz='{origin}'/><axis xyz='{axis}'/></joint>"
        );
        parent = format!("l{i}");
    }
    text += "</robot>";
    let options = UrdfOptions { root: Root::Floating };
    Arc::new(Robot::from_urdf_str(&text, "leg", &options).unwrap())
}

/// Smooth coordinates of that robot, and their velocity: every target made from them can be met exactly.
fn coordinates(robot: &Robot, t: f64) -> (Vec<f64>, Vec<f64>) {
    let start = [0.1, 0.2, 0.3, 0.4, -0.3, 0.5, 0.2, -0.3, -0.5, 1.2, -0.6, 0.2];
    let start = integrate(robot, &robot.neutral(), &start);
    let amplitude = |i: usize| match i {
        0..3 => 0.1,
        3..6 => 0.9,
        _ => 0.15,
    };
    let pulse = |i: usize| 1.0 + 0.2 * i as f64;
    let moved: Vec<f64> = (0..12).map(|i| amplitude(i) * (pulse(i) * t).sin()).collect();
    let mut v: Vec<f64> = (0..12)
        .map(|i| amplitude(i) * pulse(i) * (pulse(i) * t).cos())
        .collect();
    let turn =
        so3::left_jacobian(&Vector3::new(moved[3], moved[4], moved[5])) * Vector3::new(v[3], v[4], v[5]);
    v[3..6].copy_from_slice(turn.as_slice());
    (integrate(robot, &start, &moved), v)
}

/// `[x | ẋ]` of all tasks at `t`.
fn sample(problem: &Problem, t: f64) -> Vec<f64> {
    let robot = problem.robot();
    let (q, v) = coordinates(robot, t);
    let mut page = Page::new(robot);
    forward(robot, &q, &mut page);
    let v = DVector::from_vec(v);
    let mut data = targets(problem, &q);
    for task in problem.tasks() {
        let twist = |f| frame_jacobian(robot, &page, f, Axes::World) * &v;
        match task.track {
            Track::Pose(f) => data.extend(twist(f).iter()),
            Track::Orientation(f) => data.extend(twist(f).iter().skip(3)),
            _ => data.extend(
                (0..robot.nv())
                    .fold(Vector3::zeros(), |s, c| s + page.centre_of_mass_column(c) * v[c])
                    .iter(),
            ),
        }
    }
    data
}

/// Largest difference of the coordinates from the true ones after 0.8 s in so many steps.
fn strayed(problem: &Arc<Problem>, parameters: &str, steps: usize) -> f64 {
    let robot = problem.robot();
    let contestant = method("davies")
        .unwrap()
        .build(&parameters.parse().unwrap())
        .unwrap();
    let mut driver = Driver::new(&*contestant.formulation, problem).unwrap();
    let (mut q, dt_s) = (coordinates(robot, 0.0).0, 0.8 / steps as f64);
    for k in 0..steps {
        let data = [
            sample(problem, dt_s * k as f64),
            sample(problem, dt_s * (k + 1) as f64),
        ]
        .concat();
        let input = StepInput {
            q_prev: &q,
            v_prev: &vec![0.0; robot.nv()],
            dt_s,
            phase: WHOLE,
            targets: Window::new(&data, problem.nx(), problem.nxdot()).unwrap(),
            gains: &[],
        };
        let majors = driver.majors();
        assert_eq!(driver.step(&input, majors).0, Termination::Stepped);
        q.clone_from(&driver.solution().q);
    }
    let off = ik_core::configuration::difference(robot, &coordinates(robot, 0.8).0, &q);
    off.iter().fold(0.0, |m, d| m.max(d.abs()))
}

#[test]
fn integration_is_of_its_order_for_imposed_and_free_turning_roots() {
    let robot = leg_under_a_marked_root();
    let (mark, foot) = (robot.frame("mark").unwrap(), robot.frame("l5").unwrap());
    let foot = ("foot", Track::Pose(foot), Priority::Hard);
    let imposed = [("mark", Track::Pose(mark), Priority::Hard), foot.clone()];
    let free = [
        foot,
        ("mark", Track::Orientation(mark), Priority::Hard),
        ("com", Track::CentreOfMass, Priority::Hard),
    ];
    let fourth = "integrator = 'rk4'\nfeed_forward = 'given'\n";
    for tasks in [&imposed[..], &free] {
        let problem = problem(&robot, tasks);
        for (parameters, least) in [
            (format!("{fourth}correction = 0.0"), 13.0),
            (
                format!("{fourth}correction = 0.0\norientation = 'euler-rates'"),
                13.0,
            ),
            // Each step forgets the error of the one before, and one step's is an order higher.
            (format!("{fourth}correction = 1.0"), 26.0),
            ("correction = 0.0\nfeed_forward = 'given'".to_owned(), 1.8),
            (String::new(), 3.5),
            ("orientation = 'euler-rates'".to_owned(), 3.5),
        ] {
            let (coarse, fine) = (
                strayed(&problem, &parameters, 80),
                strayed(&problem, &parameters, 160),
            );
            let ratio = coarse / fine;
            assert!(
                ratio > least && ratio < 2.0 * least,
                "{} {parameters}: {coarse:e} {fine:e}",
                tasks.len()
            );
        }
    }
}

#[test]
fn correction_removes_its_part_of_the_closure_error_in_one_step() {
    let robot = bioloid();
    let problem = problem(&robot, &gait_tasks(&robot, soft()));
    let q = stance(0.0);
    let mut x = targets(&problem, &q);
    x[0] += 1e-5;
    x[16] -= 1e-5;
    for integrator in ["euler", "rk4"] {
        for correction in [1.0, 0.5, 1.9] {
            let parameters = format!("integrator = '{integrator}'\ncorrection = {correction:?}");
            let (v, _) = drive(&problem, &parameters, &q, &x, &x, 0.01);
            let moved: Vec<f64> = v.iter().map(|v| v * 0.01).collect();
            let after = targets(&problem, &integrate(&robot, &q, &moved));
            for i in [0, 16] {
                let before = targets(&problem, &q)[i];
                let part = (after[i] - before) / (x[i] - before);
                assert!((part - correction).abs() < 1e-3, "{parameters}: {part}");
            }
        }
    }
}
