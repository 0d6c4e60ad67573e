//! Rows of limb suites: one JSON line per robot, limb and set of poses. Units are in the names.

use super::subject::SNAPPED;
use crate::records::Machine;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the row layout.
pub const SCHEMA: &str = "ik-bench/limb/1";

/// What was found on one limb with one set of poses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimbRow {
    /// [`SCHEMA`].
    pub schema: String,
    /// Id of the suite, e.g. `closed-form/grid`.
    pub suite: String,
    /// Name of the robot.
    pub robot: String,
    /// Name of the last body of the limb.
    pub limb: String,
    /// `right`, `left` or `centre`.
    pub side: String,
    /// Family of its closed form.
    pub family: String,
    /// Id of the set, e.g. `on-axis-30`.
    pub set: String,
    /// Numbers that define the set.
    pub parameters: BTreeMap<String, serde_json::Value>,
    /// Seed of the suite. The draws of a row depend on it and on robot, limb and set.
    pub seed: u64,
    /// Revision of the source.
    pub revision: String,
    /// Machine the row was made on.
    pub machine: Machine,
    /// Remarks.
    pub notes: Vec<String>,
    /// What was found.
    pub found: Findings,
    /// Trace file relative to the folder of the rows, if one was written.
    pub trace: Option<String>,
}

/// What was found, by the study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Findings {
    /// Poses of given joints.
    Grid(GridFindings),
    /// Paths through a singular set.
    Continuity(ContinuityFindings),
    /// Orientations over distances.
    Reach(ReachFindings),
    /// A slice of the workspace.
    Slice(SliceFindings),
    /// All solutions of one pose.
    Postures(PosturesFindings),
}

impl Findings {
    /// Whether everything held that can be asked.
    pub fn held(&self) -> bool {
        match self {
            Self::Grid(found) => found.held,
            Self::Continuity(found) => found.held,
            Self::Reach(found) => found.held,
            Self::Slice(found) => found.error_max < SNAPPED,
            Self::Postures(found) => found.solutions.iter().all(|s| s.error < SNAPPED),
        }
    }
}

/// Poses of given joints, solved and judged.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridFindings {
    /// Poses solved.
    pub poses: u64,
    /// Points of the whole grid, of which the poses are drawn if they are fewer; none for random joints.
    pub grid_points: Option<f64>,
    /// Poses refused, though a posture of the limb made them.
    pub unsolved: u64,
    /// Solutions returned, of all poses.
    pub solutions: u64,
    /// Solutions with a number that is not finite.
    pub not_finite: u64,
    /// Largest distance FK(IK(T)) from T of any solution (m).
    pub error_max_m: f64,
    /// Largest rotation between them (rad).
    pub error_max_rad: f64,
    /// Solutions by the decade of the larger of both errors: exponent → count, everything below 1e-17 in −18.
    pub error_decades: BTreeMap<i32, u64>,
    /// Poses on which the generating joints are looked for; the others, next to a singular set, are judged by forward
    /// kinematics alone.
    pub compared: u64,
    /// Poses not compared.
    pub excluded: u64,
    /// Compared poses with the generating joints among the solutions.
    pub recovered: u64,
    /// How far (rad) a recovered solution may be from the generating joints.
    pub recovered_within_rad: f64,
    /// Largest distance of the nearest solution from the generating joints over compared poses (rad).
    pub away_max_rad: f64,
    /// Compared poses whose solution with the indicators of the generating joints is those joints; none in families
    /// without indicators.
    pub indicated: Option<u64>,
    /// Poses by their number of distinct solutions (1e-6 rad, modulo full turns).
    pub distinct: BTreeMap<u32, u64>,
    /// Least number of distinct solutions of a compared pose.
    pub distinct_compared_min: Option<u32>,
    /// Whether the criteria of the set were met.
    pub held: bool,
    /// What it costs.
    pub times: Times,
}

/// Times, the least over repeats, serial.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Times {
    /// All solutions of a pose (ns, mean over the timed poses).
    pub solve_ns: f64,
    /// One tree pass over the same limb with every other joint locked (ns).
    pub forward_ns: f64,
    /// Their ratio.
    pub ratio: f64,
}

/// Paths through a singular set, followed by the nearest solution.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContinuityFindings {
    /// Paths followed; each joint path is sampled on the singular set and to both sides of it.
    pub paths: u64,
    /// Steps taken.
    pub steps: u64,
    /// Samples without solution.
    pub unsolved: u64,
    /// Largest step of a joint on a generating path, the turn itself left out (rad).
    pub path_step_max_rad: f64,
    /// Largest step of a joint of the solver (rad).
    pub step_max_rad: f64,
    /// Largest ratio of a step of the solver to the largest step of its path.
    pub step_ratio_max: f64,
    /// Steps that stay large however finely they are divided.
    pub jumps: u64,
    /// Those of them that the geometry forces: no joints near the last ones meet the pose.
    pub forced: u64,
    /// Largest error of a pose (m or rad).
    pub error_max: f64,
    /// Paths that end in another posture than the generating one.
    pub ended_elsewhere: u64,
    /// No jump but forced ones, no sample without solution, poses met.
    pub held: bool,
}

/// Reachable orientations by the distance of the wrist or ankle from the common point of the first axes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReachFindings {
    /// Distances (m).
    pub distance_m: Vec<f64>,
    /// Orientations tried at each.
    pub orientations: u64,
    /// Orientations with a solution, per distance.
    pub reachable: Vec<u64>,
    /// Fraction to be expected from the geometry, per distance; none in general families and for arms of four joints.
    pub expected: Option<Vec<f64>>,
    /// Poses on which solver and geometry disagree although the boundary is farther than 1e-9 m.
    pub disagreements: Option<u64>,
    /// Poses put 1.1e-9 m to either side of the boundary of reach, in addition; they count among the disagreements.
    pub at_boundary: Option<u64>,
    /// Largest error of a solution (m or rad).
    pub error_max: f64,
    /// No disagreement, no wrong solution.
    pub held: bool,
}

/// Numbers of solutions on a sagittal slice.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SliceFindings {
    /// The frame that is placed.
    pub frame: String,
    /// Its roll, pitch, yaw in the body that carries the limb (rad).
    pub rotation_rpy_rad: [f64; 3],
    /// The common point of the first axes in that body (m).
    pub common_point_m: [f64; 3],
    /// x of the cells relative to the common point (m).
    pub x_m: Vec<f64>,
    /// z of the cells relative to it (m).
    pub z_m: Vec<f64>,
    /// Distinct solutions: one line per z, one number per x.
    pub distinct: Vec<Vec<u32>>,
    /// Those within the limits of the robot.
    pub within_limits: Vec<Vec<u32>>,
    /// Largest error of a solution (m or rad).
    pub error_max: f64,
}

/// All solutions of one pose.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PosturesFindings {
    /// Names of the joints, base to tip.
    pub joint_names: Vec<String>,
    /// Joints that made the pose (rad).
    pub generating_rad: Vec<f64>,
    /// The solutions.
    pub solutions: Vec<ShownPosture>,
}

/// One solution.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShownPosture {
    /// Number of the branch.
    pub branch: u8,
    /// Decision indicators by name, +1 or −1.
    pub indicators: BTreeMap<String, i8>,
    /// Joints, base to tip (rad).
    pub joints_rad: Vec<f64>,
    /// Error of its pose (m or rad).
    pub error: f64,
}
