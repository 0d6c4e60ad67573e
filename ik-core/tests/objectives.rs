//! Secondary objectives: values by hand, torques by lifting the centre of mass, gradients and the change of torques by
//! finite differences, problems they are refused on.

#![allow(clippy::unwrap_used, reason = "tests")]

#[allow(dead_code, reason = "every test uses its part")]
mod common;

use common::{Random, robots};
use ik_core::boundary::Boundary;
use ik_core::evaluator::Evaluator;
use ik_core::kinematics::gravity::{GRAVITY_M_S2, static_torques_into};
use ik_core::kinematics::hanging::HangingTree;
use ik_core::kinematics::{Page, forward};
use ik_core::objective::Objective;
use ik_core::problem::{Kind, Phase, PhaseId, Problem, ProblemError, ProblemParts, Supplies};
use ik_core::robot::{FrameId, Limits, Robot, Root, embedded};
use ik_core::task::{OrientationCoordinates, Priority, Task, Track};
use nalgebra::DMatrix;
use std::sync::Arc;

const PHASE: PhaseId = PhaseId(0);

fn parts(robot: &Arc<Robot>, objectives: Vec<Objective>, support: Option<FrameId>) -> ProblemParts {
    ProblemParts {
        robot: Arc::clone(robot),
        tasks: vec![Task {
            name: "posture".into(),
            track: Track::Posture,
        }],
        phases: vec![Phase {
            name: "standing".into(),
            support,
            tasks: vec![(0, Priority::Hard)],
        }],
        boundary: Boundary::None,
        objectives,
        kind: Kind::Tracking,
        supplies: Supplies {
            rates: true,
            preview_s: 0.0,
        },
        orientation: OrientationCoordinates::Log,
    }
}

fn evaluator(robot: &Arc<Robot>, objective: Objective, support: Option<FrameId>) -> Evaluator {
    let problem = Problem::new(parts(robot, vec![objective], support)).unwrap();
    Evaluator::new(&Arc::new(problem))
}

/// Value and gradient (length nv) at `q`.
fn evaluate(robot: &Robot, evaluator: &mut Evaluator, q: &[f64]) -> (f64, Vec<f64>) {
    let mut page = Page::new(robot);
    evaluator.pass(q, &mut page);
    let mut gradient = vec![0.0; robot.nv()];
    let value = evaluator.add_objectives(q, &page, PHASE, &[1.0], &mut gradient);
    (value, gradient)
}

fn gravity(weights: Option<Vec<f64>>) -> Objective {
    Objective::GravityTorque { weights }
}

/// A joint configuration within its limits, or within ±1.5.
fn within_limits(robot: &Robot, random: &mut Random) -> Vec<f64> {
    let mut q = random.configuration(robot, 0.5);
    for (q, c) in q[robot.root().nq()..].iter_mut().zip(robot.coordinates()) {
        let (lower, upper) = (c.limits.lower.max(-1.5), c.limits.upper.min(1.5));
        *q = random.between(lower, upper);
    }
    q
}

/// `q` with the root moved so that `frame` stands where it stands at `held`.
fn held_at(robot: &Robot, frame: FrameId, held: &[f64], q: &[f64]) -> Vec<f64> {
    if robot.root() == Root::Fixed {
        return q.to_vec();
    }
    let mut page = Page::new(robot);
    forward(robot, held, &mut page);
    let wanted = page.frame_pose(robot, frame);
    forward(robot, q, &mut page);
    let root = nalgebra::Isometry3::from_parts(
        nalgebra::Translation3::new(q[0], q[1], q[2]),
        nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q[6], q[3], q[4], q[5])),
    );
    let placed = wanted * page.frame_pose(robot, frame).inverse() * root;
    let mut out = q.to_vec();
    out[..3].copy_from_slice(placed.translation.vector.as_slice());
    out[3..7].copy_from_slice(placed.rotation.coords.as_slice());
    out
}

/// Largest difference from fourth-order differences of the value with `support` held, in parts of the largest entry of the
/// gradient.
fn gradient_error(robot: &Robot, evaluator: &mut Evaluator, support: FrameId, q: &[f64]) -> f64 {
    const STEP: f64 = 1e-3;
    let (_, gradient) = evaluate(robot, evaluator, q);
    let first = (robot.root().nq(), robot.root().nv());
    assert!(
        gradient[..first.1].iter().all(|g| *g == 0.0),
        "the root has no part in it"
    );
    let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
    let mut worst = 0.0_f64;
    for (j, g) in gradient[first.1..].iter().enumerate() {
        let mut value = |steps: f64| {
            let mut moved = q.to_vec();
            moved[first.0 + j] += steps * STEP;
            evaluate(robot, evaluator, &held_at(robot, support, q, &moved)).0
        };
        let near = value(1.0) - value(-1.0);
        let far = value(2.0) - value(-2.0);
        let expected = (8.0 * near - far) / (12.0 * STEP);
        worst = worst.max((g - expected).abs());
    }
    worst / largest
}

#[test]
fn gradients_are_differences_of_the_value_on_either_foot() {
    let robot = Arc::new(embedded("melson").unwrap());
    let mut random = Random(12);
    for foot in ["r_foot", "l_foot"] {
        let support = robot.frame(foot).unwrap();
        let weights = (0..19).map(|_| random.between(0.2, 3.0)).collect();
        for objective in [Objective::JointCentring, gravity(None), gravity(Some(weights))] {
            let mut evaluator = evaluator(&robot, objective.clone(), Some(support));
            for _ in 0..1000 {
                let q = within_limits(&robot, &mut random);
                let error = gradient_error(&robot, &mut evaluator, support, &q);
                assert!(error < 1e-7, "{foot} {objective:?}: {error:e}");
            }
        }
    }
}

#[test]
fn gradients_are_differences_of_the_value_on_every_robot_and_frame() {
    let mut random = Random(77);
    for robot in robots() {
        for frame in 0..robot.frames().len() {
            let support = FrameId(frame);
            let mut evaluator = evaluator(&robot, gravity(None), Some(support));
            let q = within_limits(&robot, &mut random);
            let error = gradient_error(&robot, &mut evaluator, support, &q);
            assert!(
                error < 1e-7,
                "{} {}: {error:e}",
                robot.name(),
                robot.frame_name(FrameId(frame))
            );
        }
    }
}

#[test]
fn torques_are_the_work_of_lifting_the_centre_of_mass_with_the_support_held() {
    const STEP: f64 = 1e-3;
    let mut random = Random(5);
    for robot in robots() {
        let mut tree = HangingTree::new(&robot);
        let mut page = Page::new(&robot);
        let joints = robot.coordinates().len();
        for frame in (0..robot.frames().len()).map(FrameId) {
            let q = within_limits(&robot, &mut random);
            forward(&robot, &q, &mut page);
            let weight = page.moving_mass_kg() * GRAVITY_M_S2;
            tree.hang(&robot, &page, Some(frame));
            let mut torque = vec![0.0; joints];
            tree.torques_into(&robot, &mut torque);
            let mut statics = vec![0.0; joints];
            static_torques_into(&robot, &page, &[frame], &mut statics).unwrap();
            for (j, torque) in torque.iter().enumerate() {
                let mut height = |steps: f64| {
                    let mut moved = q.clone();
                    moved[robot.root().nq() + j] += steps * STEP;
                    forward(&robot, &held_at(&robot, frame, &q, &moved), &mut page);
                    page.centre_of_mass().z
                };
                let near = height(1.0) - height(-1.0);
                let far = height(2.0) - height(-2.0);
                let work = weight * (8.0 * near - far) / (12.0 * STEP);
                let (name, scale) = (robot.name(), weight.max(1.0));
                assert!(
                    (torque - work).abs() < 1e-8 * scale,
                    "{name} {frame:?} {j}: {torque} {work}"
                );
                assert!(
                    (torque - statics[j]).abs() < 1e-10 * scale,
                    "{name} {frame:?} {j}"
                );
            }
        }
    }
}

#[test]
fn the_change_of_torques_is_symmetric() {
    let mut random = Random(6);
    for robot in robots() {
        let joints = robot.coordinates().len();
        let mut tree = HangingTree::new(&robot);
        let mut page = Page::new(&robot);
        for frame in (0..robot.frames().len()).map(FrameId) {
            forward(&robot, &within_limits(&robot, &mut random), &mut page);
            tree.hang(&robot, &page, Some(frame));
            let mut hessian = DMatrix::zeros(joints, joints);
            for j in 0..joints {
                let (mut unit, mut change) = (vec![0.0; joints], vec![0.0; joints]);
                unit[j] = 1.0;
                tree.torque_change_into(&robot, &page, &unit, &mut change);
                hessian.column_mut(j).copy_from_slice(&change);
            }
            let scale = page.moving_mass_kg() * GRAVITY_M_S2;
            let asymmetry = (&hessian - hessian.transpose()).amax();
            assert!(
                asymmetry < 1e-12 * scale.max(1.0),
                "{} {frame:?}: {asymmetry:e}",
                robot.name()
            );
        }
    }
}

#[test]
fn joint_centring_divides_by_the_whole_range() {
    // One joint from −1 to 3 at 2: u = (2 − 1) / 4.
    let limits = Limits {
        lower: -1.0,
        upper: 3.0,
        ..Limits::UNLIMITED
    };
    let robot = Arc::new(
        embedded("pendulum")
            .unwrap()
            .with_limits("pivot", limits)
            .unwrap(),
    );
    let mut evaluator = evaluator(&robot, Objective::JointCentring, None);
    let (value, gradient) = evaluate(&robot, &mut evaluator, &[2.0]);
    assert!((value - 0.5 * 0.0625).abs() < 1e-15 && (gradient[0] - 0.0625).abs() < 1e-15);
}

#[test]
fn gains_weigh_the_sum_and_a_zero_gain_leaves_no_trace() {
    let robot = Arc::new(embedded("melson").unwrap());
    let objectives = vec![Objective::JointCentring, gravity(None)];
    let problem = Problem::new(parts(&robot, objectives, Some(robot.frame("l_foot").unwrap()))).unwrap();
    let mut evaluator = Evaluator::new(&Arc::new(problem));
    let q = within_limits(&robot, &mut Random(3));
    let mut page = Page::new(&robot);
    evaluator.pass(&q, &mut page);
    let mut at = |gains: &[f64]| {
        let mut gradient = vec![0.0; robot.nv()];
        let value = evaluator.add_objectives(&q, &page, PHASE, gains, &mut gradient);
        (value, gradient)
    };
    let (centring, torque, both) = (at(&[1.0, 0.0]), at(&[0.0, 1.0]), at(&[0.35, 1.6]));
    assert!((both.0 - 0.35 * centring.0 - 1.6 * torque.0).abs() < 1e-14 * both.0);
    for ((b, c), t) in both.1.iter().zip(&centring.1).zip(&torque.1) {
        assert!((b - 0.35 * c - 1.6 * t).abs() < 1e-13);
    }
    assert_eq!(at(&[0.0, 0.0]), (0.0, vec![0.0; 25]));
    assert_eq!(evaluator.meter.counts().passes, 1);
}

#[test]
fn what_is_not_defined_is_refused_by_name() {
    let refused = |robot: &str, objective: Objective, support: Option<usize>| {
        let robot = Arc::new(embedded(robot).unwrap());
        Problem::new(parts(&robot, vec![objective], support.map(FrameId))).unwrap_err()
    };
    let error = refused("bioloid", Objective::JointCentring, Some(1));
    assert!(matches!(&error, ProblemError::NoRange { joints, .. } if joints.len() == 18));
    let text = error.to_string();
    assert!(
        text.contains("`bioloid`") && text.contains("r_knee_pitch"),
        "{text}"
    );
    let text = refused("melson", gravity(None), None).to_string();
    assert!(text.contains("`melson`") && text.contains("`standing`"), "{text}");
    let text = refused("melson", Objective::JointCentring, Some(99)).to_string();
    assert!(text.contains("frame 99"), "{text}");
    for (weights, named) in [
        (vec![1.0; 3], "3 weights"),
        (vec![0.0; 19], "0 for joint `r_hip_yaw`"),
        (vec![f64::NAN; 19], "NaN"),
        (vec![-1.0; 19], "-1"),
    ] {
        let text = refused("melson", gravity(Some(weights)), Some(0)).to_string();
        assert!(text.contains(named), "{text}");
    }
    // A fixed root carries its robot itself.
    let arm = Arc::new(embedded("arm7").unwrap());
    assert!(Problem::new(parts(&arm, vec![gravity(None)], None)).is_ok());
}

#[test]
fn objectives_are_written_in_kebab_case() {
    let weighted = gravity(Some(vec![1.0, 2.0]));
    for (objective, text) in [
        (Objective::JointCentring, r#"{"kind":"joint-centring"}"#),
        (gravity(None), r#"{"kind":"gravity-torque"}"#),
        (weighted, r#"{"kind":"gravity-torque","weights":[1.0,2.0]}"#),
    ] {
        assert_eq!(serde_json::to_string(&objective).unwrap(), text);
        assert_eq!(serde_json::from_str::<Objective>(text).unwrap(), objective);
    }
    assert!(serde_json::from_str::<Objective>(r#"{"kind":"gravity-torque","weight":[1.0]}"#).is_err());
}
