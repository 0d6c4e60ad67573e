//! Limbs of a walk: what the two ends of a chain of joints have to span, and what they can.
//!
//! Where the pose of the waist and the target at the end of a limb are prescribed, two points of the limb are: the origin
//! of its first joint, which is fixed in the root body, and that of its last joint, which is fixed in the foot (for a hand
//! without prescribed orientation, the hand itself). Their distance can be no more than the sum of the distances between
//! neighbouring joint origins on the path. The bound is sharp for limbs whose joints can align those.

use super::Gait;
use crate::error::InputError;
use crate::trajectory::Trajectory;
use crate::trajectory::task_finder::TaskFinder;
use ik_core::kinematics::{Page, forward};
use ik_core::problem::Problem;
use ik_core::robot::{FrameId, Motion};
use ik_core::task::Track;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};

/// Slack of the comparison (m): far above rounding of sums of lengths, far below what a motion would show.
const REACH_SLACK_M: f64 = 1e-9;

/// The body the limbs hang on.
#[derive(Clone, Debug)]
pub(super) struct Waist {
    /// First row of its task.
    pub(super) row: usize,
    /// Pose of its frame in the root body.
    x_body_frame: Isometry3<f64>,
}

/// A leg or an arm.
#[derive(Clone, Debug)]
pub(super) struct Limb {
    task: String,
    /// First row of its task.
    pub(super) row: usize,
    joints: [String; 2],
    /// Origin of the first joint in the frame of the waist.
    pub(super) origin: Point3<f64>,
    /// Origin of the tracked frame in the frame of the waist, with all joints at zero.
    pub(super) rest: Point3<f64>,
    end: End,
    reach_m: f64,
}

/// The point at the end of a limb that its target prescribes.
#[derive(Clone, Copy, Debug)]
enum End {
    /// The origin of the last joint, given in the frame of a foot whose pose is prescribed.
    Foot(Point3<f64>),
    /// The hand.
    Hand,
}

impl TaskFinder<'_> {
    /// The waist: a task that tracks the pose of a frame of the root body.
    pub(super) fn waist(&self, name: &str) -> Result<Waist, InputError> {
        let task = self.task("waist", name)?;
        let Track::Pose(frame) = self.problem.tasks()[task].track else {
            return Err(self.wrong("waist", name, "a task that tracks a pose"));
        };
        let frame = &self.problem.robot().frames()[frame.0];
        if frame.body != 0 {
            return Err(self.wrong(
                "waist",
                name,
                "the pose of a frame that is fixed in the root body",
            ));
        }
        Ok(Waist {
            row: self.problem.slots()[task].xdot,
            x_body_frame: frame.x_body_frame,
        })
    }

    /// A leg: the joints up to the frame of a task that tracks a pose.
    pub(super) fn leg(&self, key: &str, name: &str, waist: &Waist) -> Result<Limb, InputError> {
        let task = self.task(key, name)?;
        let Track::Pose(frame) = self.problem.tasks()[task].track else {
            return Err(self.wrong(key, name, "a task that tracks a pose"));
        };
        let x_body_frame = self.problem.robot().frames()[frame.0].x_body_frame;
        let end = End::Foot(x_body_frame.inverse_transform_point(&Point3::origin()));
        self.limb(key, task, frame, waist, end)
    }

    /// An arm, if one is named: the joints up to the frame of a task that tracks a position.
    pub(super) fn arm(
        &self,
        key: &str,
        name: Option<&str>,
        waist: &Waist,
    ) -> Result<Option<Limb>, InputError> {
        let Some(name) = name else {
            return Ok(None);
        };
        let task = self.task(key, name)?;
        let Track::Position(frame) = self.problem.tasks()[task].track else {
            return Err(self.wrong(key, name, "a task that tracks a position"));
        };
        self.limb(key, task, frame, waist, End::Hand).map(Some)
    }

    fn limb(
        &self,
        key: &str,
        task: usize,
        frame: FrameId,
        waist: &Waist,
        end: End,
    ) -> Result<Limb, InputError> {
        let robot = self.problem.robot();
        let name = &self.problem.tasks()[task].name;
        let mut page = Page::new(robot);
        forward(robot, &robot.neutral(), &mut page);
        let rest = Point3::from(page.frame_position(robot, frame));
        let frame = &robot.frames()[frame.0];
        let path = robot.path(frame.body);
        let (Some(&first), Some(&last)) = (path.first(), path.last()) else {
            return Err(self.wrong(key, name, "a frame that joints move against the waist"));
        };
        let origin = Point3::from(robot.joints()[first].x_parent_joint.translation.vector);
        let tip = match end {
            End::Foot(_) => 0.0,
            End::Hand => frame.x_body_frame.translation.vector.norm(),
        };
        Ok(Limb {
            task: name.clone(),
            row: self.problem.slots()[task].xdot,
            joints: [first, last].map(|joint| robot.joints()[joint].name.clone()),
            origin: waist.x_body_frame.inverse_transform_point(&origin),
            rest: waist.x_body_frame.inverse_transform_point(&rest),
            end,
            reach_m: tip + span(self.problem, path),
        })
    }
}

/// Largest distance between the origins of the first and the last joint of a path (m); unbounded if something slides.
fn span(problem: &Problem, path: &[usize]) -> f64 {
    let joints = problem.robot().joints();
    if path
        .iter()
        .any(|&joint| joints[joint].motion == Motion::Prismatic)
    {
        return f64::INFINITY;
    }
    let lengths = path[1..]
        .iter()
        .map(|&joint| joints[joint].x_parent_joint.translation.vector.norm());
    lengths.sum()
}

/// The pose in six plain task rows: position, then roll, pitch and yaw.
fn pose(rows: &[f64]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_euler_angles(rows[3], rows[4], rows[5]);
    Isometry3::from_parts(Translation3::new(rows[0], rows[1], rows[2]), turn)
}

impl Limb {
    /// Distance between the two ends that the rows `values` of all tasks prescribe (m).
    fn distance_m(&self, waist: &Waist, values: &[f64]) -> f64 {
        let first = pose(&values[waist.row..]) * self.origin;
        let last = match self.end {
            End::Foot(point) => pose(&values[self.row..]) * point,
            End::Hand => Point3::from_slice(&values[self.row..self.row + 3]),
        };
        (last - first).norm()
    }

    fn out_of_reach(&self, t: f64, distance_m: f64, place: &str, gait: &str) -> InputError {
        let [first, last] = &self.joints;
        let (end, remedy) = match self.end {
            End::Foot(_) => (
                format!("`{last}`"),
                "lower waist_height_m, or shorten step_m with waist_increment_m at an eighth of it",
            ),
            End::Hand => ("the hand".to_owned(), "shorten hand_drop_m or hand_swing_m"),
        };
        let field = format!(
            "{gait}: distance of {end} from `{first}` for task `{}` at t = {t:.6} s",
            self.task
        );
        let found = format!(
            "{distance_m:.6} m, {:.3} mm more than the limb can span",
            1e3 * (distance_m - self.reach_m)
        );
        let allowed = format!("at most {:.6} m; {remedy}", self.reach_m);
        InputError::value(place, &field, found, &allowed)
    }
}

impl Gait {
    /// Compares what limbs have to span with what they can at all `times` (s) of a trajectory of this walk; `place` and
    /// `field` (the path of the table) go into the message.
    ///
    /// # Errors
    /// The limb and the time that miss most.
    pub(in crate::trajectory) fn check_reach(
        &self,
        trajectory: &Trajectory,
        times: impl Iterator<Item = f64>,
        place: &str,
        field: &str,
    ) -> Result<(), InputError> {
        let mut values = vec![0.0; trajectory.rows()];
        let mut worst = None;
        let mut worst_missing_m = REACH_SLACK_M;
        for t in times {
            trajectory.value_into(t, &mut values);
            for limb in self.legs.iter().chain(self.arms.iter().flatten()) {
                let distance_m = limb.distance_m(&self.waist, &values);
                if distance_m - limb.reach_m > worst_missing_m {
                    worst_missing_m = distance_m - limb.reach_m;
                    worst = Some((limb, t, distance_m));
                }
            }
        }
        match worst {
            Some((limb, t, distance_m)) => Err(limb.out_of_reach(t, distance_m, place, field)),
            None => Ok(()),
        }
    }
}
