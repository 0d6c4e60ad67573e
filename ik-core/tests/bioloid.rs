//! The embedded humanoid `bioloid` against the numbers of its source: by hand, and joint by joint where the reference
//! data are installed.

#![allow(clippy::unwrap_used, reason = "tests")]

mod specification;

use ik_core::kinematics::{Page, forward};
use ik_core::robot::{Limits, Motion, Robot, Root, embedded};
use nalgebra::Vector3;

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

#[test]
fn every_joint_mass_and_frame_is_that_of_the_specification() {
    if let Some(specification) = specification::read("bioloid-spec.json") {
        specification::assert_described(&bioloid(), &specification);
    }
}
