//! The referee's own task rows in the problem's coordinates, and their Jacobian by finite differences.

use super::tasks::{target_of, target_rotation, tracked_frames};
use super::tree::{Posture, root_rotation};
use ik_core::problem::Problem;
use ik_core::robot::{Robot, Root};
use ik_core::task::{OrientationCoordinates, Track};
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};

/// Step of the five-point difference (rad, m). Its truncation error h⁴/30 · f⁽⁵⁾ and the rounding error 1.5
/// ε/h of rows of size one, 3e-14 and 3e-13, are then both small.
const DIFFERENCE_STEP: f64 = 1e-3;

/// `q ⊕ dq`: positions and joints add, the root turns by the world rotation vector.
pub(super) fn integrate(robot: &Robot, q: &[f64], dq: &[f64]) -> Vec<f64> {
    let (nq, nv) = (robot.root().nq(), robot.root().nv());
    let mut out: Vec<f64> = q[nq..].iter().zip(&dq[nv..]).map(|(q, d)| q + d).collect();
    if robot.root() == Root::Floating {
        let turned = UnitQuaternion::from_scaled_axis(Vector3::new(dq[3], dq[4], dq[5])) * root_rotation(q);
        let position = q[..3].iter().zip(dq).map(|(q, d)| q + d);
        let root: Vec<f64> = position.chain(turned.coords.iter().copied()).collect();
        out.splice(..0, root);
    }
    out
}

/// `q ⊖ q_prev`, see [`integrate`].
pub(super) fn difference(robot: &Robot, q_prev: &[f64], q: &[f64]) -> Vec<f64> {
    let nq = robot.root().nq();
    let joints = q[nq..].iter().zip(&q_prev[nq..]).map(|(q, p)| q - p);
    match robot.root() {
        Root::Fixed => joints.collect(),
        Root::Floating => {
            let turn = (root_rotation(q) * root_rotation(q_prev).inverse()).scaled_axis();
            let moved = q[..3].iter().zip(q_prev).map(|(q, p)| q - p);
            moved.chain(turn.iter().copied()).chain(joints).collect()
        }
    }
}

/// Roll, pitch and yaw of a rotation `R = Rz(yaw) Ry(pitch) Rx(roll)`.
fn rpy(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let r = rotation.to_rotation_matrix();
    Vector3::new(
        r[(2, 1)].atan2(r[(2, 2)]),
        -r[(2, 0)].clamp(-1.0, 1.0).asin(),
        r[(1, 0)].atan2(r[(0, 0)]),
    )
}

fn wrap(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

fn orientation_row(problem: &Problem, now: &UnitQuaternion<f64>, target: &[f64]) -> Vector3<f64> {
    match problem.orientation() {
        OrientationCoordinates::RollPitchYaw => {
            (rpy(now) - Vector3::from_column_slice(&target[..3])).map(wrap)
        }
        OrientationCoordinates::Log => {
            (now * target_rotation(OrientationCoordinates::Log, target).inverse()).scaled_axis()
        }
    }
}

/// Unweighted errors of some tasks at `q`, stacked in the order given.
pub(super) fn errors(problem: &Problem, tasks: &[usize], q: &[f64], x: &[f64]) -> DVector<f64> {
    let robot = problem.robot();
    let posture = Posture::new(robot, q);
    let mut rows = Vec::new();
    for &task in tasks {
        let (track, target) = (problem.tasks()[task].track, target_of(problem, task, x));
        let (position, orientation) = tracked_frames(track);
        let mut differ = |now: &[f64]| rows.extend(now.iter().zip(target).map(|(now, target)| now - target));
        match track {
            Track::CentreOfMass => differ(posture.com.as_slice()),
            Track::Posture => differ(&q[robot.root().nq()..]),
            Track::Position(_) | Track::Orientation(_) | Track::Pose(_) => {}
        }
        if let Some(frame) = position {
            differ(posture.frame(robot, frame).translation.vector.as_slice());
        }
        if let Some(frame) = orientation {
            let target = &target[if position.is_some() { 3 } else { 0 }..];
            let row = orientation_row(problem, &posture.frame(robot, frame).rotation, target);
            rows.extend_from_slice(row.as_slice());
        }
    }
    DVector::from_vec(rows)
}

/// Jacobian of [`errors`] by five-point central differences along each velocity coordinate.
pub(super) fn error_jacobian(problem: &Problem, tasks: &[usize], q: &[f64], x: &[f64]) -> DMatrix<f64> {
    let robot = problem.robot();
    let moved = |v: usize, step: f64| {
        let mut dq = vec![0.0; robot.nv()];
        dq[v] = step * DIFFERENCE_STEP;
        errors(problem, tasks, &integrate(robot, q, &dq), x)
    };
    let column = |v: usize| {
        ((moved(v, 1.0) - moved(v, -1.0)) * 8.0 - (moved(v, 2.0) - moved(v, -2.0))) / (12.0 * DIFFERENCE_STEP)
    };
    let columns: Vec<_> = (0..robot.nv()).map(column).collect();
    DMatrix::from_columns(&columns)
}
