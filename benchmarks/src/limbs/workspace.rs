//! What is shown of a workspace: numbers of solutions on a sagittal slice, and all solutions of one pose.

use super::reach::stretched_m;
use super::record::{PosturesFindings, ShownPosture, SliceFindings};
use super::subject::{Answers, Joints, Solve, Subject, distinct};
use super::suite::{PostureSpec, ReachSpec, SliceSpec};
use crate::limb_pose::indicators;
use ik_core::robot::Limits;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// Counts solutions on a square grid in the plane x–z through the common point.
pub(super) fn slice(
    subject: &Subject,
    slice: &SliceSpec,
    spec: &ReachSpec,
    cells: usize,
    solve: &Solve<'_>,
) -> SliceFindings {
    let [roll, pitch, yaw] = slice.rotation_rpy_rad;
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    let frame = subject.robot.frames().iter().find(|f| f.name == slice.frame);
    let x_frame_body = frame.map_or_else(Isometry3::identity, |f| f.x_body_frame.inverse());
    let common = subject.table.base.translation.vector;
    // The end may be as far beyond the wrist or ankle as the tool is long.
    let half = spec.beyond * stretched_m(subject) + tool_m(subject, &x_frame_body);
    let along: Vec<f64> = (0..cells)
        .map(|i| half * (2.0 * (i as f64 + 0.5) / cells as f64 - 1.0))
        .collect();
    let limits = subject.limits();
    let mut kinematics = subject.kinematics();
    let mut answers = Answers::new();
    let mut found = SliceFindings {
        frame: slice.frame.clone(),
        rotation_rpy_rad: slice.rotation_rpy_rad,
        common_point_m: common.into(),
        x_m: along.clone(),
        z_m: along.clone(),
        ..SliceFindings::default()
    };
    for z in &along {
        let (mut counts, mut within) = (Vec::new(), Vec::new());
        for x in &along {
            let at = common + Vector3::new(*x, 0.0, *z);
            let pose = Isometry3::from_parts(Translation3::from(at), rotation) * x_frame_body;
            if solve(&pose, &[0.0; 6], &mut answers).is_err() {
                answers.clear();
            }
            for (solution, _) in &answers {
                found.error_max = found.error_max.max(kinematics.miss(&pose, solution));
            }
            counts.push(distinct(&answers));
            answers.retain(|(q, _)| is_within(&limits, q));
            within.push(distinct(&answers));
        }
        found.distinct.push(counts);
        found.within_limits.push(within);
    }
    found
}

fn tool_m(subject: &Subject, x_frame_body: &Isometry3<f64>) -> f64 {
    // Pose of the frame in the last D-H frame.
    (subject.table.tool * x_frame_body.inverse())
        .translation
        .vector
        .norm()
}

fn is_within(limits: &[Limits], joints: &Joints) -> bool {
    let inside = |(l, q): (&Limits, &f64)| (l.lower..=l.upper).contains(q);
    limits.iter().zip(joints).all(inside)
}

/// All solutions of the pose of some joints.
pub(super) fn postures(subject: &Subject, spec: &PostureSpec, solve: &Solve<'_>) -> PosturesFindings {
    let count = subject.joints();
    let mut joints = [0.0; 6];
    for (q, degrees) in joints.iter_mut().zip(&spec.joints_deg) {
        *q = degrees.to_radians();
    }
    let mut kinematics = subject.kinematics();
    let pose = kinematics.tip(&joints);
    let mut answers = Answers::new();
    if solve(&pose, &joints, &mut answers).is_err() {
        answers.clear();
    }
    let mut shown = |(solution, branch): &(Joints, u8)| {
        let signs = indicators(&subject.report, *branch).into_iter();
        ShownPosture {
            branch: *branch,
            indicators: signs.map(|(name, sign)| (name.to_owned(), sign)).collect(),
            joints_rad: solution[..count].to_vec(),
            error: kinematics.miss(&pose, solution),
        }
    };
    PosturesFindings {
        joint_names: subject.report.joint_names.clone(),
        generating_rad: joints[..count].to_vec(),
        solutions: answers.iter().map(&mut shown).collect(),
    }
}
