//! The embedded humanoid `melson` against its dimensions: by hand, and joint by joint where the reference data are installed.

#![allow(clippy::unwrap_used, reason = "tests")]

mod specification;

use ik_core::kinematics::{Page, forward};
use ik_core::robot::{Robot, Root, embedded};
use nalgebra::Vector3;

fn melson() -> Robot {
    embedded("melson").unwrap()
}

fn page_at(robot: &Robot, q: &[f64]) -> Page {
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    page
}

/// The start of the walk: soles flat at y = ∓0.04775 and x = 0, waist level at (`x`, 0, 0.238).
fn start(robot: &Robot, x: f64) -> Vec<f64> {
    let (thigh, shank, ankle_height) = (0.1225_f64, 0.123_f64, 0.0195);
    // The leg as a triangle in the sagittal plane, hip to ankle.
    let (ahead, below) = (-x, 0.238_f64 - ankle_height);
    let reach = below.hypot(ahead);
    let knee = std::f64::consts::PI
        - ((thigh * thigh + shank * shank - reach * reach) / (2.0 * thigh * shank)).acos();
    let at_hip = ((thigh * thigh + reach * reach - shank * shank) / (2.0 * thigh * reach)).acos();
    let hip = -ahead.atan2(below) - at_hip;
    let mut q = robot.neutral();
    (q[0], q[2]) = (x, 0.238);
    let mut set = |joint: &str, value: f64| q[7 + robot.coordinate(joint).unwrap()] = value;
    for (side, outwards) in [("r", -1.0), ("l", 1.0)] {
        set(&format!("{side}_hip_pitch"), hip);
        set(&format!("{side}_knee_pitch"), knee);
        set(&format!("{side}_ankle_pitch"), -hip - knee);
        set(&format!("{side}_shoulder_pitch"), 0.2);
        set(&format!("{side}_shoulder_roll"), 0.2 * outwards);
        set(&format!("{side}_elbow_pitch"), -1.0);
    }
    q
}

#[test]
fn the_whole_body_weighs_what_the_source_says() {
    let robot = melson();
    assert_eq!((robot.root(), robot.nq(), robot.nv()), (Root::Floating, 26, 25));
    assert!((robot.total_mass_kg() - 2.6).abs() < 1e-12);
    assert!(
        robot
            .coordinates()
            .iter()
            .all(|c| c.limits.lower < c.limits.upper)
    );
}

#[test]
fn the_straight_robot_stands_on_its_soles_with_hanging_arms() {
    let robot = melson();
    let page = page_at(&robot, &robot.neutral());
    for (frame, y, z) in [
        ("r_foot", -0.04775, -0.265),
        ("l_foot", 0.04775, -0.265),
        ("r_hand", -0.06475, -0.049),
        ("l_hand", 0.06475, -0.049),
    ] {
        let pose = page.frame_pose(&robot, robot.frame(frame).unwrap());
        let found = pose.translation.vector;
        assert!(
            (found - Vector3::new(0.0, y, z)).amax() < 1e-15,
            "{frame} {found}"
        );
        assert!(pose.rotation.angle() < 1e-15, "{frame}");
    }
}

#[test]
fn at_the_start_of_the_walk_the_centre_of_mass_is_over_the_feet() {
    let robot = melson();
    let q = start(&robot, -0.009_413);
    let page = page_at(&robot, &q);
    for (foot, y) in [("r_foot", -0.04775), ("l_foot", 0.04775)] {
        let pose = page.frame_pose(&robot, robot.frame(foot).unwrap());
        let found = pose.translation.vector;
        assert!(
            (found - Vector3::new(0.0, y, 0.0)).amax() < 1e-12,
            "{foot} {found}"
        );
        assert!(pose.rotation.angle() < 1e-7, "{foot}");
    }
    let com = page.centre_of_mass();
    assert!((com - Vector3::new(0.0, 0.0, 0.269_672)).amax() < 1e-6, "{com}");
    for (c, q) in robot.coordinates().iter().zip(&q[7..]) {
        assert!((c.limits.lower..=c.limits.upper).contains(q), "{}", c.name);
    }
}

#[test]
fn every_joint_limit_mass_and_frame_is_that_of_the_specification() {
    let Some(specification) = specification::read("melson-spec.json") else {
        return;
    };
    let robot = melson();
    specification::assert_described(&robot, &specification);
    for (c, given) in robot
        .coordinates()
        .iter()
        .zip(specification["joints"].as_array().unwrap())
    {
        let limit = |key: &str| given[key].as_f64().unwrap();
        assert!((c.limits.lower - limit("min")).abs() < 1e-15, "{}", c.name);
        assert!((c.limits.upper - limit("max")).abs() < 1e-15, "{}", c.name);
    }
}
