//! The pose of a held frame, a support foot, as the base of a floating robot: what its root does follows from the joints.
//!
//! With the base at its planned pose T the root stands at `T (root→base)⁻¹`, exactly, so that it cannot drift. A unit rate
//! of joint j on the path from the root to the base turns the root by the joint's negative screw; any row with the columns
//! J_root and J_j then changes by `J_j − J_root $_j` per unit rate of the joint. Joints off the path keep their columns.

use ik_core::evaluator::Linearisation;
use ik_core::formulation::Declined;
use ik_core::kinematics::Page;
use ik_core::kinematics::screws::for_each_screw;
use ik_core::problem::{Phase, Problem, Slot};
use ik_core::robot::{FrameId, Root};
use ik_core::rows::Rows;
use ik_core::spatial::{rpy, so3};
use ik_core::task::{OrientationCoordinates, Priority, Track};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Velocity coordinates of a floating root.
const ROOT: usize = 6;

/// A frame whose pose is a hard task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Base {
    /// The task.
    pub(crate) task: usize,
    frame: FrameId,
    slot: Slot,
}

/// Where the base shall stand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Planned {
    position: Vector3<f64>,
    rotation: Matrix3<f64>,
}

impl Base {
    /// The base of a phase: its support; without one, the first frame with a hard pose; none if there is no such frame or the
    /// root is fixed.
    ///
    /// # Errors
    /// A support whose pose is no hard task.
    pub(crate) fn find(problem: &Problem, phase: &Phase) -> Result<Option<Self>, Declined> {
        let robot = problem.robot();
        if robot.root() == Root::Fixed {
            return Ok(None);
        }
        let body = |frame: FrameId| robot.frames()[frame.0].body;
        let hard = phase.tasks.iter().filter(|(_, p)| *p == Priority::Hard);
        let mut poses = hard.filter_map(|(task, _)| match problem.tasks()[*task].track {
            Track::Pose(frame) => Some(Self {
                task: *task,
                frame,
                slot: problem.slots()[*task],
            }),
            _ => None,
        });
        let Some(support) = phase.support else {
            return Ok(poses.next());
        };
        match poses.find(|base| body(base.frame) == body(support)) {
            Some(base) => Ok(Some(base)),
            None => Err(Declined::Shape(format!(
                "phase `{}` stands on `{}`, whose pose is no hard task and so cannot be the base",
                phase.name,
                robot.frame_name(support)
            ))),
        }
    }

    /// Name of its frame.
    pub(crate) fn name<'a>(&self, problem: &'a Problem) -> &'a str {
        problem.robot().frame_name(self.frame)
    }

    /// Where the targets `x` put it.
    pub(crate) fn planned(&self, problem: &Problem, x: &[f64]) -> Planned {
        let (position, rotation) = x[self.slot.x..].split_at(3);
        let rotation = match problem.orientation() {
            OrientationCoordinates::RollPitchYaw => {
                rpy::to_matrix(&Vector3::from_column_slice(&rotation[..3]))
            }
            OrientationCoordinates::Log => {
                let c = Quaternion::new(rotation[3], rotation[0], rotation[1], rotation[2]);
                UnitQuaternion::new_normalize(c).to_rotation_matrix().into_inner()
            }
        };
        Planned {
            position: Vector3::from_column_slice(position),
            rotation,
        }
    }

    /// Turns the rows of `lin`, linearised at `q`, into those of the joints alone: errors as with the base where it is
    /// planned (to first order in its own error), joint columns as with the base held. Root columns are left as they are.
    pub(crate) fn eliminate(&self, problem: &Problem, q: &[f64], planned: &Planned, lin: &mut Linearisation) {
        let robot = problem.robot();
        let Linearisation { page, hard, soft, .. } = lin;
        let origin = Vector3::from_column_slice(&q[..3]);
        let turn = so3::log(&(planned.rotation * page.frame_rotation(robot, self.frame).transpose()));
        let point = page.frame_position(robot, self.frame);
        let shift = planned.position - point + turn.cross(&(origin - point));
        let correction = [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z];
        for rows in [&mut *hard, &mut *soft] {
            let ld = rows.ld();
            let Rows { jacobian, error, .. } = rows;
            add_columns(&jacobian[..ROOT * ld], &correction, error);
        }
        for_each_screw(
            robot,
            page,
            robot.frames()[self.frame.0].body,
            &origin,
            |v, screw| {
                let (l, a) = (screw.linear, screw.angular);
                let twist = [-l.x, -l.y, -l.z, -a.x, -a.y, -a.z];
                for rows in [&mut *hard, &mut *soft] {
                    let ld = rows.ld();
                    let (root, joints) = rows.jacobian.split_at_mut(ROOT * ld);
                    let first = (v - ROOT) * ld;
                    add_columns(root, &twist, &mut joints[first..first + ld]);
                }
            },
        );
    }

    /// Moves the root in `q`, whose tree pass is `page`, so that the base stands where it is planned.
    pub(crate) fn place(&self, problem: &Problem, page: &Page, planned: &Planned, q: &mut [f64]) {
        let robot = problem.robot();
        let turn = planned.rotation * page.frame_rotation(robot, self.frame).transpose();
        let arm = Vector3::from_column_slice(&q[..3]) - page.frame_position(robot, self.frame);
        let origin = planned.position + turn * arm;
        let attitude = UnitQuaternion::new_normalize(Quaternion::new(q[6], q[3], q[4], q[5]));
        let attitude = (so3::quaternion(&turn).into_inner() * attitude.into_inner()).normalize();
        q[..3].copy_from_slice(origin.as_slice());
        q[3..7].copy_from_slice(attitude.coords.as_slice());
    }
}

/// `out += Σ columns[k] factors[k]`, columns as long as `out`.
fn add_columns(columns: &[f64], factors: &[f64; ROOT], out: &mut [f64]) {
    for (column, factor) in columns.chunks_exact(out.len()).zip(factors) {
        out.iter_mut().zip(column).for_each(|(o, c)| *o += c * factor);
    }
}
