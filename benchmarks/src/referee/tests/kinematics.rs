//! The referee's kinematics against published poses, against the fast path, and against differences of
//! itself.

use super::*;
use crate::referee::rows::{error_jacobian, integrate};
use crate::referee::tasks::jacobian;
use crate::referee::torque::static_torques;
use crate::referee::tree::Posture;
use ik_core::kinematics::gravity::static_torques_into;
use ik_core::kinematics::jacobian::{Axes, frame_jacobian};
use ik_core::kinematics::{Page, forward};
use ik_core::problem::PhaseId;
use ik_core::robot::UrdfOptions;
use nalgebra::{DMatrix, DVector};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

/// Configuration that an entry of `expected.json` describes.
fn expected_configuration(robot: &Robot, entry: &Value) -> Vec<f64> {
    let mut q = Vec::new();
    if robot.root() == Root::Floating {
        q.extend(numbers(&entry["base"]["position"]));
        q.extend(numbers(&entry["base"]["quaternion_xyzw"]));
    }
    q.extend(
        robot
            .coordinates()
            .iter()
            .map(|c| entry["joints"][&c.name].as_f64().unwrap()),
    );
    q
}

fn compare_with_expected(folder: &Path, file: &str) -> usize {
    let text = std::fs::read_to_string(folder.join(file)).unwrap();
    let expected: Value = serde_json::from_str(&text).unwrap();
    let model = expected["model_file"].as_str().unwrap();
    let root = if expected["root_joint"] == "free_flyer" {
        Root::Floating
    } else {
        Root::Fixed
    };
    let urdf = std::fs::read_to_string(folder.join(model)).unwrap();
    let robot = Robot::from_urdf_str(&urdf, model, &UrdfOptions { root }).unwrap();
    let configurations = expected["configurations"].as_array().unwrap();
    for entry in configurations {
        let posture = Posture::new(&robot, &expected_configuration(&robot, entry));
        // Models without masses publish none.
        if entry["com"].is_array() {
            let com = Vector3::from_vec(numbers(&entry["com"]));
            assert!(
                (posture.com - com).norm() < 1e-9,
                "{model}: centre of mass {} instead of {com}",
                posture.com
            );
        }
        for (name, pose) in entry["frames"].as_object().unwrap() {
            let found = posture.frame(&robot, frame(&robot, name));
            let q = numbers(&pose["quaternion_xyzw"]);
            let position = Vector3::from_vec(numbers(&pose["position"]));
            let rotation = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[3], q[0], q[1], q[2]));
            assert!(
                (found.translation.vector - position).norm() < 1e-9,
                "{model}: position of {name}"
            );
            assert!(
                found.rotation.angle_to(&rotation) < 1e-9,
                "{model}: orientation of {name}"
            );
        }
    }
    configurations.len()
}

/// Every published file of poses of a URDF below a folder.
fn published(folder: &Path) -> Vec<(PathBuf, &'static str)> {
    let robots = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let files =
        robots.flat_map(|robot| ["expected.json", "expected.legs.json"].map(|file| (robot.clone(), file)));
    files.filter(|(robot, file)| robot.join(file).is_file()).collect()
}

#[test]
fn postures_match_the_published_ones() {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/robots"));
    if !folder.is_dir() {
        println!("skipped: {} is absent", folder.display());
        return;
    }
    let compared: usize = published(&folder)
        .iter()
        .map(|(robot, file)| compare_with_expected(robot, file))
        .sum();
    assert!(compared >= 12, "only {compared} configurations were compared");
}

#[test]
fn postures_and_jacobians_agree_with_the_fast_path() {
    let mut draw = Draw(1);
    for robot in robots() {
        let mut page = Page::new(&robot);
        for _ in 0..20 {
            let q = draw.configuration(&robot);
            forward(&robot, &q, &mut page);
            let posture = Posture::new(&robot, &q);
            assert!(
                (posture.com - page.centre_of_mass()).norm() < 1e-12,
                "{}",
                robot.name()
            );
            let mut com = DMatrix::zeros(3, robot.nv());
            posture.add_com_rows(&robot, 0, &mut com);
            for v in 0..robot.nv() {
                assert!(
                    (com.column(v) - page.centre_of_mass_column(v)).norm() < 1e-12,
                    "{}",
                    robot.name()
                );
            }
            for id in (0..robot.frames().len()).map(FrameId) {
                let pose = posture.frame(&robot, id);
                let rotation = pose.rotation.to_rotation_matrix().into_inner();
                assert!(
                    (rotation - page.frame_rotation(&robot, id)).norm() < 1e-12,
                    "{}",
                    robot.name()
                );
                let apart = pose.translation.vector - page.frame_position(&robot, id);
                assert!(apart.norm() < 1e-12, "{}", robot.name());
                let mut rows = DMatrix::zeros(6, robot.nv());
                posture.add_position_rows(&robot, id, 0, &mut rows);
                posture.add_rotation_rows(&robot, id, 3, &mut rows);
                let fast = frame_jacobian(&robot, &page, id, Axes::World);
                assert!(
                    (rows - fast).amax() < 1e-12,
                    "{}: {}",
                    robot.name(),
                    robot.frame_name(id)
                );
            }
        }
    }
}

/// Position, attitude and centre of mass of the last frame as one problem.
fn everything(robot: &Robot) -> Arc<Problem> {
    let last = FrameId(robot.frames().len() - 1);
    let tasks = vec![
        ("pose", Track::Pose(last), Priority::Hard),
        ("com", Track::CentreOfMass, soft()),
        ("posture", Track::Posture, soft()),
    ];
    let parts = parts(robot.clone(), tasks, Boundary::None);
    Arc::new(
        Problem::new(ProblemParts {
            orientation: OrientationCoordinates::Log,
            ..parts
        })
        .unwrap(),
    )
}

/// The target at which every task of [`everything`] stands at `q`: the logarithm's Jacobian is then the
/// identity.
fn target_at(problem: &Problem, q: &[f64]) -> Vec<f64> {
    let robot = problem.robot();
    let posture = Posture::new(robot, q);
    let pose = posture.frame(robot, FrameId(robot.frames().len() - 1));
    let numbers = pose
        .translation
        .vector
        .iter()
        .chain(pose.rotation.coords.iter())
        .chain(posture.com.iter());
    numbers
        .copied()
        .chain(q[robot.root().nq()..].iter().copied())
        .collect()
}

#[test]
fn jacobians_match_differences() {
    let mut draw = Draw(2);
    for robot in robots() {
        let problem = everything(&robot);
        let configurations = (0..5)
            .map(|_| draw.configuration(&robot))
            .chain([robot.neutral()]);
        for q in configurations.collect::<Vec<_>>() {
            let x = target_at(&problem, &q);
            let exact = jacobian(&problem, &Posture::new(&robot, &q), &[0, 1, 2]);
            let numeric = error_jacobian(&problem, &[0, 1, 2], &q, &x);
            let apart = (exact - numeric).amax();
            assert!(apart < 1e-10, "{}: {apart:e}", robot.name());
        }
    }
}

#[test]
fn torques_agree_with_the_fast_path() {
    let mut draw = Draw(3);
    let robot = embedded("coman").unwrap();
    let both = [frame(&robot, "l_sole"), frame(&robot, "r_sole")];
    let mut page = Page::new(&robot);
    let mut fast = vec![0.0; robot.coordinates().len()];
    for _ in 0..50 {
        let q = draw.configuration(&robot);
        forward(&robot, &q, &mut page);
        for supports in [&both[..], &both[..1], &both[1..]] {
            static_torques_into(&robot, &page, supports, &mut fast).unwrap();
            let own = static_torques(&robot, &Posture::new(&robot, &q), supports).unwrap();
            let apart = own
                .iter()
                .zip(&fast)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            assert!(apart < 1e-9, "{apart:e} Nm");
        }
    }
}

#[test]
fn torques_do_the_work_that_gravity_takes() {
    let mut draw = Draw(4);
    let robot = embedded("coman-legs").unwrap();
    let supports = [frame(&robot, "l_sole"), frame(&robot, "r_sole")];
    let weight = robot.total_mass_kg() * 9.806_65;
    for _ in 0..10 {
        let q = draw.configuration(&robot);
        let posture = Posture::new(&robot, &q);
        let torques = DVector::from_vec(static_torques(&robot, &posture, &supports).unwrap());
        let mut feet = DMatrix::zeros(12, robot.nv());
        for (i, &sole) in supports.iter().enumerate() {
            posture.add_position_rows(&robot, sole, 6 * i, &mut feet);
            posture.add_rotation_rows(&robot, sole, 6 * i + 3, &mut feet);
        }
        // A motion that leaves both feet where they are: a random one less its part in their rows.
        let any = DVector::from_fn(robot.nv(), |_, _| draw.next());
        let gram = (&feet * feet.transpose())
            .cholesky()
            .expect("bent legs are independent");
        let motion = &any - feet.transpose() * gram.solve(&(&feet * &any));
        assert!(motion.norm() > 0.1 && (feet * &motion).norm() < 1e-9);
        let height = |s: f64| {
            Posture::new(&robot, &integrate(&robot, &q, (&motion * s).as_slice()))
                .com
                .z
        };
        let power = weight * (8.0 * (height(1e-3) - height(-1e-3)) - (height(2e-3) - height(-2e-3))) / 12e-3;
        let joints = motion.rows(6, 12).into_owned();
        assert!(
            (torques.dot(&joints) - power).abs() < 1e-7 * weight,
            "{} {power}",
            torques.dot(&joints)
        );
    }
}

#[test]
fn a_pendulum_is_held_by_m_g_l_sine() {
    let robot = embedded("pendulum").unwrap();
    let body = &robot.bodies()[1];
    let (m, l) = (body.mass_kg, body.com.norm());
    for angle in [0.0_f64, 0.4, -1.2] {
        let torque = static_torques(&robot, &Posture::new(&robot, &[angle]), &[]).unwrap();
        assert!((torque[0] - m * 9.806_65 * l * angle.sin()).abs() < 1e-12);
    }
}

#[test]
fn a_flying_robot_without_support_has_no_static_torques() {
    let robot = linkage();
    assert!(static_torques(&robot, &Posture::new(&robot, &robot.neutral()), &[]).is_none());
}

#[test]
fn one_phase_has_the_tasks_of_that_phase() {
    let problem = shoot_out(Boundary::Positions);
    let (hard, soft) = crate::referee::tasks::hard_then_soft(&problem, PhaseId(0));
    assert_eq!((hard, soft), (vec![1, 2, 3], vec![0]));
}
