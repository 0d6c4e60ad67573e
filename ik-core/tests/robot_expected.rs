//! Robots against numbers made by other programs, and the embedded ones against their sources.

#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(
    clippy::float_cmp,
    reason = "numbers copied from a file must arrive unchanged"
)]

mod robot_oracle;

use ik_core::robot::{EMBEDDED, Limits, Motion, Robot, RobotError, Root, UrdfOptions, embedded};
use nalgebra::{Matrix3, Vector3};
use robot_oracle as oracle;
use serde_json::Value;
use std::path::{Path, PathBuf};

const TOLERANCE: f64 = 1e-9;

/// The folder of reference robots, `None` (with a message) where it is not there.
fn shared_robots() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/robots");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!(
        "skipped: the reference robots are not installed ({})",
        folder.display()
    );
    None
}

fn read_json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

/// The configuration of an entry of `configurations`; fails if a joint has another value than the file says.
fn configuration(robot: &Robot, entry: &Value) -> Vec<f64> {
    let mut q = robot.neutral();
    if robot.root() == Root::Floating {
        q[..3].copy_from_slice(&numbers(&entry["base"]["position"]));
        q[3..7].copy_from_slice(&numbers(&entry["base"]["quaternion_xyzw"]));
    }
    let first = robot.root().nq();
    for (i, coordinate) in robot.coordinates().iter().enumerate() {
        q[first + i] = entry["joints"][&coordinate.name].as_f64().unwrap();
    }
    for (joint, value) in robot.joints().iter().zip(oracle::joint_values(robot, &q)) {
        let expected = entry["joints"][&joint.name].as_f64().unwrap();
        assert!(
            (value - expected).abs() < 1e-12,
            "{}: {value} {expected}",
            joint.name
        );
    }
    q
}

/// Largest deviation of frames and centres of mass over all configurations of a file.
fn deviation(robot: &Robot, expected: &Value) -> f64 {
    let mut worst: f64 = 0.0;
    for entry in expected["configurations"].as_array().unwrap() {
        let q = configuration(robot, entry);
        let poses = oracle::frames(robot, &q);
        let frames = entry["frames"].as_object().unwrap();
        assert!(!frames.is_empty());
        for (name, pose) in frames {
            let found = poses[robot.frame(name).unwrap().0];
            assert!(found.iter().all(|x| x.is_finite()), "{name}: {found}");
            let position = Vector3::from_row_slice(&numbers(&pose["position"]));
            let [x, y, z, w] = numbers(&pose["quaternion_xyzw"])[..] else {
                panic!("{name}: no quaternion")
            };
            worst = worst.max((found.fixed_view::<3, 1>(0, 3) - position).amax());
            worst =
                worst.max((found.fixed_view::<3, 3>(0, 0) - oracle::quaternion_matrix(x, y, z, w)).amax());
        }
        let moving = usize::from(robot.root() == Root::Fixed);
        for (key, first) in [("com", moving), ("com_all_links", 0)] {
            if let Some(com) = entry[key].as_array() {
                let com = Vector3::from_iterator(com.iter().map(|x| x.as_f64().unwrap()));
                let found = oracle::mass_properties(robot, &q, first).1;
                assert!(found.iter().all(|x| x.is_finite()), "{key}: {found}");
                worst = worst.max((found - com).amax());
            }
        }
    }
    worst
}

fn assert_counts(robot: &Robot, expected: &Value) {
    let moving = usize::from(robot.root() == Root::Fixed);
    let mass = |range: &[ik_core::robot::Body]| range.iter().map(|body| body.mass_kg).sum::<f64>();
    assert_eq!(
        robot.coordinates().len() as u64,
        expected["independent_dof"].as_u64().unwrap()
    );
    assert_eq!(
        robot.joints().len() as u64,
        expected["moving_joints"].as_u64().unwrap()
    );
    assert!((mass(&robot.bodies()[moving..]) - expected["mass_moving"].as_f64().unwrap()).abs() < TOLERANCE);
    assert!(
        (mass(&robot.bodies()[..moving]) - expected["mass_fixed_root"].as_f64().unwrap()).abs() < TOLERANCE
    );
    let mimics = expected["mimic"].as_object().unwrap();
    assert_eq!(robot.joints().len() - robot.coordinates().len(), mimics.len());
    for (name, mimic) in mimics {
        let joint = robot.joints().iter().find(|joint| joint.name == *name).unwrap();
        assert_eq!(
            robot.coordinates()[joint.coordinate].name,
            mimic["joint"].as_str().unwrap()
        );
        assert_eq!(joint.multiplier, mimic["multiplier"].as_f64().unwrap());
        assert_eq!(joint.offset, mimic["offset"].as_f64().unwrap());
    }
}

/// Every `expected*.json` of a URDF: (label, file of the model, expected values).
fn references(folder: &Path) -> Vec<(String, PathBuf, Value)> {
    let mut found = Vec::new();
    for robot in std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
    {
        let Ok(entries) = std::fs::read_dir(&robot) else {
            continue;
        };
        for path in entries.map(|entry| entry.unwrap().path()) {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if name.starts_with("expected") && name.ends_with(".json") {
                let expected = read_json(&path);
                if expected["format"] == "urdf" {
                    let label = format!("{}/{name}", robot.file_name().unwrap().to_string_lossy());
                    found.push((
                        label,
                        robot.join(expected["model_file"].as_str().unwrap()),
                        expected,
                    ));
                }
            }
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    found
}

fn root_of(expected: &Value) -> Root {
    match expected["root_joint"].as_str().unwrap() {
        "free_flyer" => Root::Floating,
        "fixed" => Root::Fixed,
        other => panic!("unknown root joint {other}"),
    }
}

#[test]
fn reference_urdfs_agree_with_their_expected_values() {
    let Some(folder) = shared_robots() else { return };
    let references = references(&folder);
    assert!(
        references.len() >= 20,
        "only {} references found",
        references.len()
    );
    for (label, file, expected) in &references {
        let robot = Robot::from_urdf_file(
            file,
            &UrdfOptions {
                root: root_of(expected),
            },
        )
        .unwrap();
        oracle::assert_sound(&robot);
        assert_eq!(robot.bodies()[0].name, expected["root_link"].as_str().unwrap());
        assert_counts(&robot, expected);
        let worst = deviation(&robot, expected);
        eprintln!(
            "{label:32} {:2} coordinates {worst:.1e}",
            robot.coordinates().len()
        );
        assert!(worst < TOLERANCE, "{label}: {worst:e}");
    }
}

#[test]
fn the_special_joints_of_the_reference_robots_are_read() {
    let Some(folder) = shared_robots() else { return };
    let load = |path: &str| Robot::from_urdf_file(folder.join(path), &UrdfOptions::default()).unwrap();
    let pr2 = load("pr2/pr2.urdf");
    assert_eq!(
        pr2.joints()
            .iter()
            .filter(|j| pr2.coordinates()[j.coordinate].name != j.name)
            .count(),
        10
    );
    let torso = pr2
        .joints()
        .iter()
        .find(|j| j.name == "torso_lift_joint")
        .unwrap();
    assert_eq!(torso.motion, Motion::Prismatic);
    let jaco = load("jaco_j2s7s300/jaco_j2s7s300.urdf");
    let endless = &jaco.coordinates()[jaco.coordinate("j2s7s300_joint_1").unwrap()].limits;
    assert_eq!((endless.lower, endless.upper), (f64::NEG_INFINITY, f64::INFINITY));
    assert!(endless.velocity.is_finite() && endless.effort.is_finite());
    let oblique = |robot: &Robot| robot.joints().iter().filter(|j| j.axis.amax() < 0.99).count();
    assert!(oblique(&load("hubo2/hubo2.urdf")) > 0);
}

#[test]
fn embedded_coman_agrees_with_its_expected_values() {
    let Some(folder) = shared_robots() else { return };
    let expected = read_json(&folder.join("coman/expected.json"));
    let robot = embedded("coman").unwrap();
    assert_counts(&robot, &expected);
    let worst = deviation(&robot, &expected);
    eprintln!("coman {worst:.1e}");
    assert!(worst < TOLERANCE, "{worst:e}");
}

#[test]
fn embedded_coman_carries_the_numbers_of_its_source() {
    let Some(folder) = shared_robots() else { return };
    let source = folder.join("coman/coman.urdf");
    let source = Robot::from_urdf_file(source, &UrdfOptions { root: Root::Floating }).unwrap();
    let robot = embedded("coman").unwrap();
    for joint in robot.joints() {
        let same = source
            .joints()
            .iter()
            .find(|other| other.name == joint.name)
            .unwrap();
        assert_eq!(
            (joint.axis, joint.x_parent_joint),
            (same.axis, same.x_parent_joint),
            "{}",
            joint.name
        );
        assert_eq!(
            source.bodies()[same.parent].name,
            robot.bodies()[joint.parent].name
        );
        let limits = |r: &Robot| r.coordinates()[r.coordinate(&joint.name).unwrap()].limits;
        assert_eq!(limits(&robot), limits(&source), "{}", joint.name);
    }
    for body in robot.bodies() {
        let same = source
            .bodies()
            .iter()
            .find(|other| other.name == body.name)
            .unwrap();
        assert!((body.mass_kg - same.mass_kg).abs() < 1e-12, "{}", body.name);
        assert!((body.com - same.com).amax() < 1e-12, "{}", body.name);
        assert!((body.inertia - same.inertia).amax() < 1e-12, "{}", body.name);
    }
}

#[test]
fn embedded_coman_legs_agree_with_the_reduced_model_of_another_program() {
    let Some(folder) = shared_robots() else { return };
    let expected = read_json(&folder.join("coman/expected.legs.json"));
    let robot = embedded("coman-legs").unwrap();
    assert_counts(&robot, &expected);
    let worst = deviation(&robot, &expected);
    eprintln!("coman-legs {worst:.1e}");
    assert!(worst < TOLERANCE, "{worst:e}");

    let reduced = read_json(&folder.join("coman/coman_18dof.json"));
    let links = reduced["links"].as_array().unwrap();
    assert_eq!(links.len(), robot.bodies().len());
    for (body, link) in robot.bodies().iter().zip(links) {
        if body.name != "base_link" {
            assert_eq!(body.name, link["name"].as_str().unwrap());
        }
        let [xx, xy, xz, yy, yz, zz] = numbers(&link["inertia_at_com_xx_xy_xz_yy_yz_zz"])[..] else {
            panic!("six numbers")
        };
        let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        assert!(
            (body.mass_kg - link["mass"].as_f64().unwrap()).abs() < TOLERANCE,
            "{}",
            body.name
        );
        assert!((body.com - Vector3::from_row_slice(&numbers(&link["com"]))).amax() < TOLERANCE);
        assert!((body.inertia - inertia).amax() < TOLERANCE, "{}", body.name);
    }
    let hyper = embedded("coman-legs-hyperextension").unwrap();
    for (i, joint) in reduced["joints"].as_array().unwrap().iter().enumerate() {
        let number = |key: &str| joint[key].as_f64().unwrap();
        let (lower, upper) = (number("lower"), number("upper"));
        let limits = Limits {
            lower,
            upper,
            velocity: number("velocity"),
            effort: number("effort"),
        };
        assert_eq!(hyper.joints()[i].name, joint["name"].as_str().unwrap());
        assert_eq!(hyper.coordinates()[i].limits, limits);
        let knee = hyper.joints()[i].name.contains("Knee");
        let lower = if knee { 0.0 } else { limits.lower };
        assert_eq!(robot.coordinates()[i].limits, Limits { lower, ..limits });
    }
}

/// The crouched pose published with the model: feet flat on the ground, centre of mass 0.02 m ahead of the
/// ankles.
#[test]
fn coman_legs_stand_in_the_nominal_pose() {
    for id in ["coman-legs", "coman-legs-hyperextension"] {
        let robot = embedded(id).unwrap();
        assert_eq!(
            (robot.name(), robot.root(), robot.nq(), robot.nv()),
            (id, Root::Floating, 19, 18)
        );
        assert!((robot.total_mass_kg() - 32.053860196).abs() < 1e-9);
        let mut q = robot.neutral();
        (q[0], q[2]) = (0.00149912, 0.44252828);
        for side in ["L", "R"] {
            for (joint, angle) in [
                ("HipSag", -0.5560154370387923),
                ("KneeSag", 1.2),
                ("AnkSag", -0.6439845629612077),
            ] {
                q[7 + robot.coordinate(&format!("{side}{joint}")).unwrap()] = angle;
            }
        }
        let poses = oracle::frames(&robot, &q);
        for (sole, y) in [("l_sole", 0.0726), ("r_sole", -0.0726)] {
            let pose = poses[robot.frame(sole).unwrap().0];
            assert!(
                (pose.fixed_view::<3, 1>(0, 3) - Vector3::new(0.0, y, 0.0)).amax() < 2e-8,
                "{pose}"
            );
            assert!((pose.fixed_view::<3, 3>(0, 0) - Matrix3::identity()).amax() < 1e-12);
        }
        let com = oracle::mass_properties(&robot, &q, 0).1;
        assert!(
            (com - Vector3::new(0.02, -1.18524e-4, 0.48867393)).amax() < 2e-8,
            "{com}"
        );
    }
}

#[test]
fn every_embedded_robot_is_sound_and_named_by_its_id() {
    for entry in EMBEDDED {
        let robot = embedded(entry.id).unwrap();
        assert_eq!(robot.name(), entry.id);
        assert!(!entry.summary.is_empty());
        oracle::assert_sound(&robot);
        assert!(robot.total_mass_kg() > 0.0);
        for body in robot.bodies().iter().filter(|body| body.mass_kg > 0.0) {
            if ["bioloid", "melson"].contains(&entry.id) {
                assert_eq!(body.inertia, Matrix3::zeros(), "{}: a point mass", body.name);
                continue;
            }
            if ["hubo", "hoap2", "hrp2", "asimo"].contains(&entry.id) {
                assert_point_masses_on_a_line(&robot, &body.name, &body.inertia);
                continue;
            }
            assert_plausible_inertia(&robot, &body.name, &body.inertia);
        }
        for limits in robot.coordinates().iter().map(|coordinate| coordinate.limits) {
            assert!(limits.upper.is_finite() || entry.id == "bioloid", "{}", entry.id);
            assert!(limits.velocity > 0.0 && limits.effort > 0.0);
        }
    }
    let expected = [
        ("coman", 36, 35),
        ("bioloid", 25, 24),
        ("melson", 26, 25),
        ("hubo", 31, 30),
        ("hoap2", 27, 26),
        ("hrp2", 31, 30),
        ("asimo", 31, 30),
        ("arm6", 6, 6),
        ("arm7", 7, 7),
        ("slider-arm", 6, 6),
        ("pendulum", 1, 1),
    ];
    for (id, nq, nv) in expected {
        let robot = embedded(id).unwrap();
        assert_eq!((robot.nq(), robot.nv()), (nq, nv), "{id}");
    }
    assert_eq!(
        embedded("slider-arm").unwrap().joints()[0].motion,
        Motion::Prismatic
    );
    assert!(
        matches!(embedded("arm8"), Err(RobotError::UnknownRobot { id, known }) if id == "arm8" && known.len() == 13)
    );
}

/// A rigid body's principal inertias are positive and none exceeds the sum of the others.
fn assert_plausible_inertia(robot: &Robot, body: &str, inertia: &Matrix3<f64>) {
    let mut principal: Vec<f64> = inertia.symmetric_eigenvalues().iter().copied().collect();
    principal.sort_by(f64::total_cmp);
    let possible = principal[0] > 0.0 && principal[2] <= principal[0] + principal[1];
    assert!(
        possible,
        "{} {body}: principal inertias {principal:?}",
        robot.name()
    );
}

/// Point masses on a line: no inertia about the line, the same about all axes across it. Links are point masses; rigidly
/// joined, two of them make a body.
fn assert_point_masses_on_a_line(robot: &Robot, body: &str, inertia: &Matrix3<f64>) {
    let mut principal: Vec<f64> = inertia.symmetric_eigenvalues().iter().copied().collect();
    principal.sort_by(f64::total_cmp);
    let on_a_line = principal[0].abs() < 1e-12 && (principal[2] - principal[1]).abs() < 1e-12;
    assert!(
        on_a_line,
        "{} {body}: principal inertias {principal:?}",
        robot.name()
    );
}

/// Wrist axes through one point, and shoulder and wrist centres at constant distances from the elbow.
#[test]
fn the_generic_arms_have_the_geometry_they_claim() {
    for (id, joints) in [
        ("arm6", [3usize, 4, 5].as_slice()),
        ("arm7", &[0, 1, 2]),
        ("arm7", &[4, 5, 6]),
    ] {
        let robot = embedded(id).unwrap();
        for seed in 1..4 {
            let q = oracle::some_configuration(&robot, seed);
            assert!(
                axes_meet(&robot, &oracle::bodies(&robot, &q), joints),
                "{id} {joints:?}"
            );
        }
    }
}

/// Whether the lines of three axes pass through one point, the least-squares meeting point of all of them.
fn axes_meet(robot: &Robot, bodies: &[nalgebra::Matrix4<f64>], joints: &[usize]) -> bool {
    let line = |j: usize| {
        let r: Matrix3<f64> = bodies[j + 1].fixed_view::<3, 3>(0, 0).into();
        let p: Vector3<f64> = bodies[j + 1].fixed_view::<3, 1>(0, 3).into();
        let d = r * robot.joints()[j].axis.into_inner();
        (Matrix3::identity() - d * d.transpose(), p)
    };
    let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for (across, p) in joints.iter().map(|&j| line(j)) {
        a += across;
        b += across * p;
    }
    let meeting = a.lu().solve(&b).unwrap();
    joints
        .iter()
        .map(|&j| line(j))
        .all(|(across, p)| (across * (meeting - p)).norm() < 1e-12)
}
