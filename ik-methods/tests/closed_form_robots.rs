//! The closed forms on robots: every limb the analyser names is solved from the poses the robot's own kinematics give, on the
//! embedded robots and, where they are installed, on the reference robots.

#![allow(clippy::unwrap_used, missing_docs, reason = "tests")]

use ik_core::kinematics::{Page, forward};
use ik_core::robot::{EMBEDDED, Robot, Root, UrdfOptions, embedded};
use ik_methods::reverse_decoupling::analyser::{LimbReport, Verdict, limbs};
use ik_methods::reverse_decoupling::{Limb, Unsolved};
use nalgebra::Isometry3;
use std::f64::consts::PI;
use std::path::Path;

const POSES: usize = 500;

/// Multiples of the golden ratio in ±π: they do not repeat.
fn angle(i: usize) -> f64 {
    PI * (2.0 * ((i + 1) as f64 * 0.618_033_988_749_894_9).fract() - 1.0)
}

fn posture(robot: &Robot, k: usize) -> Vec<f64> {
    let mut q = robot.neutral();
    let joints = q[robot.root().nq()..].iter_mut().enumerate();
    joints.for_each(|(i, q)| *q = angle(97 * k + i));
    q
}

/// Pose of a body in the world, by a frame fixed in it.
fn body(robot: &Robot, page: &Page, body: usize) -> Isometry3<f64> {
    let frames = robot.frames().iter().enumerate();
    let (id, frame) = frames.into_iter().find(|(_, frame)| frame.body == body).unwrap();
    page.frame_pose(robot, ik_core::robot::FrameId(id)) * frame.x_body_frame.inverse()
}

fn away(a: &[f64], b: &[f64]) -> f64 {
    let wrapped = |d: f64| (d - 2.0 * PI * (d / (2.0 * PI)).round()).abs();
    a.iter().zip(b).map(|(a, b)| wrapped(a - b)).fold(0.0, f64::max)
}

/// Solves a limb at many postures: how often the generating joints are among the solutions, and the worst error of a pose.
fn solved(robot: &Robot, report: &LimbReport) -> (usize, f64) {
    let limb = Limb::new(robot, report).unwrap();
    let mut page = Page::new(robot);
    let coordinate = |joint: &usize| robot.root().nq() + robot.joints()[*joint].coordinate;
    let (mut found, mut worst) = (0, 0.0_f64);
    for k in 0..POSES {
        let mut q = posture(robot, k);
        forward(robot, &q, &mut page);
        let pose = body(robot, &page, report.base).inverse() * body(robot, &page, report.tip);
        let joints: Vec<f64> = report.joints.iter().map(|j| q[coordinate(j)]).collect();
        let mut solutions: Vec<Vec<f64>> = Vec::new();
        let count = limb
            .for_each_solution(&pose, &joints, |solution, _| solutions.push(solution.to_vec()))
            .unwrap();
        assert_eq!(count, solutions.len());
        found += usize::from(solutions.iter().any(|s| away(s, &joints) < 1e-6));
        let mut nearest = vec![0.0; limb.joints()];
        limb.solve_nearest(&pose, &joints, &mut nearest).unwrap();
        assert!(
            solutions
                .iter()
                .all(|s| away(s, &joints) >= away(&nearest, &joints))
        );
        for solution in &solutions {
            for (joint, value) in report.joints.iter().zip(solution) {
                q[coordinate(joint)] = *value;
            }
            forward(robot, &q, &mut page);
            let reached = body(robot, &page, report.base).inverse() * body(robot, &page, report.tip);
            let off = pose.inverse() * reached;
            worst = worst.max(off.translation.vector.norm()).max(off.rotation.angle());
        }
    }
    (found, worst)
}

fn check(robot: &Robot) -> usize {
    let closed = limbs(robot)
        .into_iter()
        .filter(|limb| matches!(limb.verdict, Verdict::ClosedForm(_)));
    let mut count = 0;
    for report in closed {
        let (found, worst) = solved(robot, &report);
        let name = format!("{} {} ({})", robot.name(), report.tip_name, report.verdict);
        // Joints are only determined to 1e-6 away from singular postures.
        assert!(found >= POSES - POSES / 100, "{name}: {found} of {POSES}");
        assert!(worst < 1e-8, "{name}: {worst:e}");
        count += 1;
    }
    count
}

#[test]
fn every_limb_of_every_embedded_robot_is_solved() {
    let count: usize = EMBEDDED
        .iter()
        .map(|robot| check(&embedded(robot.id).unwrap()))
        .sum();
    // Two legs each of COMAN (three models), Bioloid, Melson and the four humanoids, two arms each of these, one arm of six joints.
    assert_eq!(count, 2 * 3 + 2 + 2 + 4 * 4 + 1);
}

#[test]
fn the_limbs_of_the_reference_robots_are_solved() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/robots");
    if !folder.is_dir() {
        eprintln!(
            "skipped: the reference robots are not installed ({})",
            folder.display()
        );
        return;
    }
    let mut count = 0;
    for id in ["coman", "icub", "hubo2", "drchubo", "hrp4c", "hoap2"] {
        let file = folder.join(id).join(format!("{id}.urdf"));
        let options = UrdfOptions { root: Root::Floating };
        count += check(&Robot::from_urdf_file(&file, &options).unwrap());
    }
    assert_eq!(count, 12);
}

#[test]
fn a_pose_that_is_not_rigid_is_refused_by_every_family() {
    let mut families = 0;
    for entry in EMBEDDED {
        let robot = embedded(entry.id).unwrap();
        for report in limbs(&robot) {
            let Ok(limb) = Limb::new(&robot, &report) else {
                continue;
            };
            let turn = nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(1.1, 0.0, 0.0, 0.0));
            let pose = Isometry3::from_parts(nalgebra::Translation3::new(0.1, 0.0, -0.2), turn);
            let previous = vec![0.1; limb.joints()];
            let refused = limb.for_each_solution(&pose, &previous, |_, _| {});
            assert!(
                matches!(refused, Err(Unsolved::NotRigid { .. })),
                "{} {}: {refused:?}",
                entry.id,
                report.tip_name
            );
            families += 1;
        }
    }
    assert!(families >= 20, "{families}");
}

#[test]
fn postures_that_place_a_point_are_given_once() {
    let robot = embedded("bioloid").unwrap();
    let report = limbs(&robot)
        .into_iter()
        .find(|limb| limb.joints.len() == 3)
        .unwrap();
    let point = nalgebra::Point3::new(0.0, 0.0, 0.08);
    let limb = Limb::placing(&robot, &report, &point).unwrap();
    let mut page = Page::new(&robot);
    let mut most = 0;
    for k in 0..200 {
        forward(&robot, &posture(&robot, k), &mut page);
        let target = body(&robot, &page, report.base).inverse() * body(&robot, &page, report.tip) * point;
        let mut all: Vec<Vec<f64>> = Vec::new();
        let pose = Isometry3::translation(target.x, target.y, target.z);
        let count = limb
            .for_each_solution(&pose, &[0.0; 3], |q, _| all.push(q.to_vec()))
            .unwrap();
        assert_eq!(count, all.len());
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| away(a, b) > 1e-9), "{all:?}");
        }
        most = most.max(count);
    }
    assert!((2..=4).contains(&most), "{most}");
}
