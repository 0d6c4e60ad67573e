//! What a task demands and by how much a posture misses it, measured geometrically: metres between points,
//! the angle of one rotation between attitudes. The problem's orientation coordinates only say how a target
//! is written.

use super::tree::Posture;
use ik_core::problem::{PhaseId, Problem};
use ik_core::robot::FrameId;
use ik_core::task::{OrientationCoordinates, Priority, Track};
use nalgebra::{DMatrix, Quaternion, UnitQuaternion, Vector3};

/// Length and largest component of an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Miss {
    pub(super) norm: f64,
    pub(super) largest: f64,
}

/// How far a task is from its target: a distance, an angle, or both for a pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TaskError {
    pub(super) m: Option<Miss>,
    pub(super) rad: Option<Miss>,
}

/// The frame whose position a task tracks, and the one whose orientation it tracks.
pub(super) fn tracked_frames(track: Track) -> (Option<FrameId>, Option<FrameId>) {
    match track {
        Track::Position(f) => (Some(f), None),
        Track::Orientation(f) => (None, Some(f)),
        Track::Pose(f) => (Some(f), Some(f)),
        Track::CentreOfMass | Track::Posture => (None, None),
    }
}

/// Where the point that a task tracks is (m, world), if it tracks one.
pub(super) fn tracked_point(problem: &Problem, posture: &Posture, task: usize) -> Option<Vector3<f64>> {
    match problem.tasks()[task].track {
        Track::CentreOfMass => Some(posture.com),
        track => tracked_frames(track)
            .0
            .map(|f| posture.frame(problem.robot(), f).translation.vector),
    }
}

/// The part of x that belongs to a task.
pub(super) fn target_of<'a>(problem: &Problem, task: usize, x: &'a [f64]) -> &'a [f64] {
    let start = problem.slots()[task].x;
    let length = problem.tasks()[task]
        .track
        .target_len(problem.robot(), problem.orientation());
    &x[start..start + length]
}

/// The three numbers of ẋ that a centre-of-mass task begins with.
pub(super) fn rate_of(problem: &Problem, task: usize, xdot: &[f64]) -> Vector3<f64> {
    Vector3::from_column_slice(&xdot[problem.slots()[task].xdot..][..3])
}

/// Attitude written as roll, pitch, yaw with `R = Rz(yaw) Ry(pitch) Rx(roll)`, or as `[qx qy qz qw]`.
pub(super) fn target_rotation(coordinates: OrientationCoordinates, x: &[f64]) -> UnitQuaternion<f64> {
    match coordinates {
        OrientationCoordinates::RollPitchYaw => {
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), x[2])
                * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), x[1])
                * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), x[0])
        }
        OrientationCoordinates::Log => UnitQuaternion::new_normalize(Quaternion::new(x[3], x[0], x[1], x[2])),
    }
}

fn miss(difference: impl Iterator<Item = f64> + Clone) -> Miss {
    Miss {
        norm: difference.clone().map(|d| d * d).sum::<f64>().sqrt(),
        largest: difference.map(f64::abs).fold(0.0, f64::max),
    }
}

fn distance(now: &Vector3<f64>, target: &[f64]) -> Option<Miss> {
    Some(miss(now.iter().zip(target).map(|(now, target)| now - target)))
}

/// By how much `posture`, at the configuration `q`, misses the target of a task in `x`.
pub(super) fn task_error(
    problem: &Problem,
    posture: &Posture,
    q: &[f64],
    task: usize,
    x: &[f64],
) -> TaskError {
    let robot = problem.robot();
    let target = target_of(problem, task, x);
    match problem.tasks()[task].track {
        Track::CentreOfMass => TaskError {
            m: distance(&posture.com, target),
            rad: None,
        },
        Track::Posture => {
            let joints = q[robot.root().nq()..].iter().zip(target);
            TaskError {
                m: None,
                rad: Some(miss(joints.map(|(now, target)| now - target))),
            }
        }
        track => {
            let (position, orientation) = tracked_frames(track);
            let m =
                position.and_then(|f| distance(&posture.frame(robot, f).translation.vector, &target[..3]));
            let rad = orientation.map(|f| {
                let written = &target[if position.is_some() { 3 } else { 0 }..];
                let wanted = target_rotation(problem.orientation(), written);
                let angle = posture.frame(robot, f).rotation.angle_to(&wanted);
                Miss {
                    norm: angle,
                    largest: angle,
                }
            });
            TaskError { m, rad }
        }
    }
}

/// Indices of the tasks of a phase, hard ones first.
pub(super) fn hard_then_soft(problem: &Problem, phase: PhaseId) -> (Vec<usize>, Vec<usize>) {
    let (hard, soft): (Vec<_>, Vec<_>) = problem.phases()[phase.0]
        .tasks
        .iter()
        .partition(|(_, priority)| *priority == Priority::Hard);
    let index = |tasks: Vec<&(usize, Priority)>| tasks.into_iter().map(|(task, _)| *task).collect();
    (index(hard), index(soft))
}

/// Jacobian of tasks in world linear and angular velocities, one block of rows per task in the order given.
pub(super) fn jacobian(problem: &Problem, posture: &Posture, tasks: &[usize]) -> DMatrix<f64> {
    let robot = problem.robot();
    let rows = tasks.iter().map(|&t| problem.tasks()[t].track.rows(robot)).sum();
    let mut out = DMatrix::zeros(rows, robot.nv());
    let mut row = 0;
    for &task in tasks {
        let track = problem.tasks()[task].track;
        match track {
            Track::CentreOfMass => posture.add_com_rows(robot, row, &mut out),
            Track::Posture => {
                for j in 0..robot.coordinates().len() {
                    out[(row + j, robot.root().nv() + j)] = 1.0;
                }
            }
            Track::Position(f) => posture.add_position_rows(robot, f, row, &mut out),
            Track::Orientation(f) => posture.add_rotation_rows(robot, f, row, &mut out),
            Track::Pose(f) => {
                posture.add_position_rows(robot, f, row, &mut out);
                posture.add_rotation_rows(robot, f, row + 3, &mut out);
            }
        }
        row += track.rows(robot);
    }
    out
}
