//! Robots against the specifications of their sources, joint by joint.

use ik_core::kinematics::successive::ZeroPose;
use ik_core::robot::Robot;
use nalgebra::{Point3, Vector3};
use serde_json::Value;
use std::path::Path;

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator(value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()))
}

/// A specification beside the project, `None` (with a message) where it is not there.
pub(crate) fn read(file: &str) -> Option<Value> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/papers")
        .join(file);
    let Ok(text) = std::fs::read_to_string(&path) else {
        eprintln!("skipped: the specification is not installed ({})", path.display());
        return None;
    };
    Some(serde_json::from_str(&text).unwrap())
}

/// Joints, masses and frames of `robot` at zero are those of the specification.
pub(crate) fn assert_described(robot: &Robot, specification: &Value) {
    let zero = ZeroPose::of(robot);
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
