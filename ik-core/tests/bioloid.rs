//! The embedded humanoid `bioloid` against the numbers of its source: by hand, and joint by joint where the reference
//! data are installed.

#![allow(clippy::unwrap_used, reason = "tests")]

use ik_core::kinematics::successive::ZeroPose;
use ik_core::kinematics::{Page, forward};
use ik_core::robot::{Limits, Motion, Robot, Root, embedded};
use nalgebra::{Point3, Vector3};
use serde_json::Value;
use std::path::Path;

fn bioloid() -> Robot {
    embedded("bioloid").unwrap()
}

fn page_at(robot: &Robot, q: &[f64]) -> Page {
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    page
}

/// Position of a frame (m) with every joint at zero but the one named.
fn position(robot: &Robot, frame: &str, joint: &str, angle: f64) -> Vector3<f64> {
    let mut q = robot.neutral();
    q[robot.root().nq() + robot.coordinate(joint).unwrap()] = angle;
    page_at(robot, &q).frame_position(robot, robot.frame(frame).unwrap())
}

#[test]
fn the_whole_body_weighs_what_the_source_says() {
    let robot = bioloid();
    assert_eq!((robot.root(), robot.nq(), robot.nv()), (Root::Floating, 25, 24));
    assert_eq!(robot.bodies()[0].name, "waist");
    assert!((robot.total_mass_kg() - 1.7).abs() < 1e-12);
    let com = page_at(&robot, &robot.neutral()).centre_of_mass();
    assert!(
        (com - Vector3::new(-0.005781, 0.0, 0.002647)).amax() < 1e-6,
        "{com}"
    );
}

#[test]
fn the_straight_robot_stands_on_its_soles() {
    let robot = bioloid();
    for (frame, y, z) in [
        ("r_foot", -0.042165, -0.1862548),
        ("l_foot", 0.042165, -0.1862548),
        ("r_hand", -0.064646, 0.121451 - 0.06931 - 0.05178),
        ("l_hand", 0.064646, 0.121451 - 0.06931 - 0.05178),
    ] {
        let pose = page_at(&robot, &robot.neutral()).frame_pose(&robot, robot.frame(frame).unwrap());
        let found = pose.translation.vector;
        assert!(
            (found - Vector3::new(0.0, y, z)).amax() < 1e-15,
            "{frame} {found}"
        );
        assert!(pose.rotation.angle() < 1e-15, "{frame}");
    }
}

#[test]
fn a_positive_knee_takes_the_calf_back() {
    let robot = bioloid();
    let below_knee = 0.0780929 + 0.030779;
    for side in ["r", "l"] {
        let found = position(
            &robot,
            &format!("{side}_foot"),
            &format!("{side}_knee_pitch"),
            0.5,
        );
        assert!((found.x + below_knee * 0.5_f64.sin()).abs() < 1e-15, "{found}");
        assert!(
            (found.z + 0.0773829 + below_knee * 0.5_f64.cos()).abs() < 1e-15,
            "{found}"
        );
    }
}

#[test]
fn joints_come_in_the_order_of_the_source_and_have_no_limit() {
    let robot = bioloid();
    let legs = [
        "hip_yaw",
        "hip_roll",
        "hip_pitch",
        "knee_pitch",
        "ankle_pitch",
        "ankle_roll",
    ];
    let arms = ["shoulder_pitch", "shoulder_roll", "elbow_roll"];
    let limb = |side: &str, joints: &[&str]| joints.iter().map(|j| format!("{side}_{j}")).collect::<Vec<_>>();
    let names = [
        limb("r", &legs),
        limb("l", &legs),
        limb("r", &arms),
        limb("l", &arms),
    ]
    .concat();
    let axes = "zxyyyx".repeat(2) + &"yxx".repeat(2);
    assert_eq!(robot.joints().len(), names.len());
    for (i, (joint, axis)) in robot.joints().iter().zip(axes.chars()).enumerate() {
        let expected = match axis {
            'x' => Vector3::x_axis(),
            'y' => Vector3::y_axis(),
            _ => Vector3::z_axis(),
        };
        assert_eq!(
            (joint.name.as_str(), joint.motion, joint.axis, joint.coordinate),
            (names[i].as_str(), Motion::Revolute, expected, i)
        );
        assert_eq!(robot.coordinates()[i].limits, Limits::UNLIMITED);
    }
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator(value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()))
}

/// The specification beside the project, `None` (with a message) where it is not there.
fn specification() -> Option<Value> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/papers/bioloid-spec.json");
    let Ok(text) = std::fs::read_to_string(&path) else {
        eprintln!("skipped: the specification is not installed ({})", path.display());
        return None;
    };
    Some(serde_json::from_str(&text).unwrap())
}

#[test]
fn every_joint_mass_and_frame_is_that_of_the_specification() {
    let Some(specification) = specification() else {
        return;
    };
    let robot = bioloid();
    let zero = ZeroPose::of(&robot);
    let mover = |body: usize| body.checked_sub(1).map_or("root", |j| &robot.joints()[j].name);
    let assert_mass = |body: usize, given: &Value| {
        let found = &robot.bodies()[body];
        let name = &found.name;
        assert!(
            (found.mass_kg - given["mass"].as_f64().unwrap()).abs() < 1e-12,
            "{name}"
        );
        if found.mass_kg > 0.0 {
            let com = zero.frames()[robot.frame(name).unwrap().0] * Point3::from(found.com);
            assert!(
                (com.coords - vector(&given["com"])).amax() < 1e-12,
                "{name} {com}"
            );
        }
    };
    assert_mass(0, &specification["root"]);
    let joints = specification["joints"].as_array().unwrap();
    assert_eq!(joints.len(), robot.joints().len());
    for (i, (joint, given)) in robot.joints().iter().zip(joints).enumerate() {
        assert_eq!(joint.name, given["name"].as_str().unwrap());
        assert_eq!(
            mover(joint.parent),
            given["parent"].as_str().unwrap(),
            "{}",
            joint.name
        );
        let line = zero.lines()[i];
        assert!((line.axis - vector(&given["s"])).amax() < 1e-12, "{}", joint.name);
        assert!(
            (line.point - vector(&given["s0"])).amax() < 1e-12,
            "{}",
            joint.name
        );
        assert_mass(i + 1, given);
    }
    for given in specification["frames"].as_array().unwrap() {
        let id = robot.frame(given["name"].as_str().unwrap()).unwrap();
        assert_eq!(mover(robot.frames()[id.0].body), given["link"].as_str().unwrap());
        let found = zero.frames()[id.0].translation.vector;
        assert!(
            (found - vector(&given["point"])).amax() < 1e-12,
            "{}",
            given["name"]
        );
    }
}
