//! A pose for one limb as a file, and its closed-form solutions as the answer.

use crate::error::{InputError, finite};
use crate::suite::RobotSpec;
use ik_core::kinematics::{Page, forward};
use ik_core::robot::{FrameId, Limits, Robot};
use ik_methods::reverse_decoupling::analyser::{Family, LimbReport, Side, limbs};
use ik_methods::reverse_decoupling::{ArmBranch, LegBranch, Limb, Unsolved};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Version of the layout.
pub const SCHEMA: &str = "ik-bench/limb-pose/1";

/// A pose of a frame at the end of a limb.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimbPoseFile {
    /// [`SCHEMA`].
    pub schema: String,
    /// The robot.
    pub robot: RobotSpec,
    /// A frame fixed in the last body of a limb with a closed form.
    pub frame: String,
    /// Its position in the body that carries the limb (m).
    pub position_m: [f64; 3],
    /// Its rotation there as a unit quaternion x, y, z, w.
    pub rotation_xyzw: [f64; 4],
    /// Joints of the limb before (rad), by name; those not named are 0. Joints that the pose leaves free stay there.
    #[serde(default)]
    pub previous: BTreeMap<String, f64>,
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LimbAnswer {
    /// Name of the robot.
    pub robot: String,
    /// Body that carries the limb.
    pub base: String,
    /// The frame.
    pub frame: String,
    /// Family of the closed form.
    pub family: String,
    /// `solved`, or why there is no solution.
    pub outcome: String,
    /// The solutions, the nearest to `previous` first.
    pub solutions: Vec<LimbSolution>,
}

impl LimbAnswer {
    /// The nearest solution alone: of those within the limits if there is one, else of all.
    pub fn nearest(mut self) -> Self {
        let within = self.solutions.iter().position(|s| s.within_limits);
        self.solutions.drain(..within.unwrap_or(0));
        self.solutions.truncate(1);
        self
    }
}

/// One posture of the limb.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LimbSolution {
    /// Joint values by name (rad), each in the turn that is within its limits and nearest to `previous`.
    pub joints: BTreeMap<String, f64>,
    /// Number of the branch.
    pub branch: u8,
    /// Decision indicators by name, +1 or −1; none in the general family.
    pub indicators: BTreeMap<&'static str, i8>,
    /// Largest difference of a joint from `previous` (rad), modulo full turns.
    pub away_rad: f64,
    /// Whether all joints are within the robot's limits.
    pub within_limits: bool,
    /// What the robot's own kinematics miss the pose by (m).
    pub error_m: f64,
    /// The same in rotation (rad).
    pub error_rad: f64,
}

/// How far a quaternion's length may be from one.
const UNIT_TOLERANCE: f64 = 1e-6;

impl LimbPoseFile {
    /// Reads a file; `source` stands for it in messages.
    ///
    /// # Errors
    /// Text that is no such file, with line and column.
    pub fn parse(text: &str, source: &str) -> Result<Self, InputError> {
        let file: Self = serde_json::from_str(text).map_err(|e| InputError::Syntax {
            file: source.to_owned(),
            reason: e.to_string(),
        })?;
        if file.schema != SCHEMA {
            return Err(InputError::value(source, "schema", &file.schema, SCHEMA));
        }
        Ok(file)
    }

    /// All solutions, the nearest first.
    ///
    /// # Errors
    /// A robot, frame or joint that does not exist, a frame on no limb with a closed form, numbers that are no pose.
    pub fn solve(&self, source: &str) -> Result<LimbAnswer, InputError> {
        let robot = self.robot.build(source)?;
        let (frame, report) = self.limb(&robot, source)?;
        let limb = Limb::new(&robot, &report)
            .map_err(|e| InputError::value(source, "frame", &self.frame, &format!("another limb: {e}")))?;
        let wanted = self.pose(source)?;
        let previous = self.previous(&report, source)?;
        let tip = wanted * robot.frames()[frame.0].x_body_frame.inverse();
        let mut found: Vec<(Vec<f64>, u8)> = Vec::new();
        let solved = limb.for_each_solution(&tip, &previous, |q, branch| found.push((q.to_vec(), branch)));
        let mut solutions: Vec<LimbSolution> = found
            .iter()
            .map(|(q, branch)| solution(&robot, &report, (frame, &wanted), q, *branch, &previous))
            .collect();
        solutions.sort_by(|a, b| a.away_rad.total_cmp(&b.away_rad));
        Ok(LimbAnswer {
            robot: robot.name().to_owned(),
            base: report.base_name.clone(),
            frame: self.frame.clone(),
            family: report.verdict.to_string(),
            outcome: outcome(&solved),
            solutions,
        })
    }

    /// The frame, and the limb it ends.
    fn limb(&self, robot: &Robot, source: &str) -> Result<(FrameId, LimbReport), InputError> {
        let known = robot.frames().iter().map(|frame| &frame.name);
        let frame = robot
            .frame(&self.frame)
            .map_err(|_| InputError::unknown(&format!("{source}: frame"), "frame", &self.frame, known))?;
        let all = limbs(robot);
        let ends = all
            .iter()
            .flat_map(|limb| &limb.frames)
            .map(|f| robot.frame_name(*f));
        let ends = ends.collect::<Vec<_>>().join(", ");
        let found = all.into_iter().find(|limb| limb.frames.contains(&frame));
        let found = found.ok_or_else(|| {
            let allowed = format!("a frame at the end of a limb: {ends}");
            InputError::value(source, "frame", &self.frame, &allowed)
        })?;
        Ok((frame, found))
    }

    fn pose(&self, source: &str) -> Result<Isometry3<f64>, InputError> {
        for (field, values) in [
            ("position_m", &self.position_m[..]),
            ("rotation_xyzw", &self.rotation_xyzw),
        ] {
            for (i, value) in values.iter().enumerate() {
                finite(source, &format!("{field}[{i}]"), *value)?;
            }
        }
        let [x, y, z, w] = self.rotation_xyzw;
        let quaternion = Quaternion::new(w, x, y, z);
        if (quaternion.norm() - 1.0).abs() > UNIT_TOLERANCE {
            let found = format!("of length {}", quaternion.norm());
            let allowed = format!("a unit quaternion, its length within {UNIT_TOLERANCE:e} of 1");
            return Err(InputError::value(source, "rotation_xyzw", found, &allowed));
        }
        let turn = UnitQuaternion::from_quaternion(quaternion);
        Ok(Isometry3::from_parts(Translation3::from(self.position_m), turn))
    }

    fn previous(&self, report: &LimbReport, source: &str) -> Result<Vec<f64>, InputError> {
        for (name, value) in &self.previous {
            finite(source, &format!("previous.{name}"), *value)?;
            if !report.joint_names.contains(name) {
                let place = format!("{source}: previous");
                return Err(InputError::unknown(
                    &place,
                    "joint of the limb",
                    name,
                    &report.joint_names,
                ));
            }
        }
        let value = |name: &String| self.previous.get(name).copied().unwrap_or(0.0);
        Ok(report.joint_names.iter().map(value).collect())
    }
}

fn outcome(solved: &Result<usize, Unsolved>) -> String {
    match solved {
        Ok(_) => "solved".to_owned(),
        Err(unsolved) => unsolved.to_string(),
    }
}

fn solution(
    robot: &Robot,
    report: &LimbReport,
    (frame, wanted): (FrameId, &Isometry3<f64>),
    q: &[f64],
    branch: u8,
    previous: &[f64],
) -> LimbSolution {
    let wrapped = |d: f64| d - TAU * (d / TAU).round();
    let away = q.iter().zip(previous).map(|(a, b)| wrapped(a - b).abs());
    let limits = |joint: &usize| robot.coordinates()[robot.joints()[*joint].coordinate].limits;
    let limits: Vec<Limits> = report.joints.iter().map(limits).collect();
    let turned = q.iter().zip(&limits).zip(previous);
    let q: Vec<f64> = turned
        .map(|((q, limits), previous)| in_turn(*q, limits, *previous))
        .collect();
    let off = wanted.inverse() * reached(robot, report, frame, &q);
    LimbSolution {
        joints: report
            .joint_names
            .iter()
            .cloned()
            .zip(q.iter().copied())
            .collect(),
        branch,
        indicators: indicators(report, branch),
        away_rad: away.fold(0.0, f64::max),
        within_limits: q.iter().zip(&limits).all(|(q, limits)| is_within(limits, *q)),
        error_m: off.translation.vector.norm(),
        error_rad: off.rotation.angle(),
    }
}

/// The angle full turns away from `q` that is nearest to `previous`, among those within the limits if there are any.
fn in_turn(q: f64, limits: &Limits, previous: f64) -> f64 {
    let nearest = |to: f64| q + TAU * ((to - q) / TAU).round();
    // The nearest one inside is next to that part of the limits which is nearest.
    let around = nearest(previous.clamp(limits.lower, limits.upper));
    let inside = [around, around - TAU, around + TAU]
        .into_iter()
        .filter(|angle| is_within(limits, *angle));
    let away = |angle: &f64| (angle - previous).abs();
    inside
        .min_by(|a, b| away(a).total_cmp(&away(b)))
        .unwrap_or_else(|| nearest(previous))
}

fn is_within(limits: &Limits, q: f64) -> bool {
    (limits.lower..=limits.upper).contains(&q)
}

/// Pose of the frame in the body that carries the limb, by the robot's kinematics.
fn reached(robot: &Robot, report: &LimbReport, frame: FrameId, q: &[f64]) -> Isometry3<f64> {
    let mut all = robot.neutral();
    for (joint, value) in report.joints.iter().zip(q) {
        all[robot.root().nq() + robot.joints()[*joint].coordinate] = *value;
    }
    let mut page = Page::new(robot);
    forward(robot, &all, &mut page);
    let mut frames = robot.frames().iter();
    let on_base = frames
        .position(|f| f.body == report.base)
        .expect("every body has a frame");
    let base = page.frame_pose(robot, FrameId(on_base)) * robot.frames()[on_base].x_body_frame.inverse();
    base.inverse() * page.frame_pose(robot, frame)
}

/// Indicators of a branch; wrist and shoulder of a left arm have the other sign.
pub(crate) fn indicators(report: &LimbReport, branch: u8) -> BTreeMap<&'static str, i8> {
    let sign = |value: f64| if value < 0.0 { -1 } else { 1 };
    let arm = if report.side == Side::Left { -1 } else { 1 };
    let ik_methods::reverse_decoupling::analyser::Verdict::ClosedForm(family) = report.verdict else {
        return BTreeMap::new();
    };
    match family {
        Family::Leg => {
            let b = LegBranch::numbered(branch);
            BTreeMap::from([
                ("knee", sign(b.knee)),
                ("ankle", sign(b.ankle)),
                ("hip", sign(b.hip)),
            ])
        }
        Family::Arm => {
            let b = ArmBranch::numbered(branch);
            BTreeMap::from([
                ("elbow", sign(b.elbow)),
                ("wrist", arm * sign(b.wrist)),
                ("shoulder", arm * sign(b.shoulder)),
            ])
        }
        Family::FourJointArm => {
            BTreeMap::from([("shoulder", arm * sign(ArmBranch::numbered(branch).shoulder))])
        }
        Family::General { .. } => BTreeMap::new(),
    }
}

#[cfg(test)]
mod tests;
