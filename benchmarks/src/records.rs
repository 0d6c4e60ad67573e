//! Records: one JSON line per run, and one trace per run. Metric names are an interface: units are in the name.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the row layout.
pub const SCHEMA: &str = "ik-bench/run/1";

/// One run: one method with one set of parameters on one scenario.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// [`SCHEMA`].
    pub schema: String,
    /// Registry id of the method.
    pub method: String,
    /// All its parameters, defaults resolved.
    pub parameters: BTreeMap<String, serde_json::Value>,
    /// Id of the suite, e.g. `coman/squat`.
    pub suite: String,
    /// Id of the scenario in the suite, e.g. `A`.
    pub scenario: String,
    /// Time step (s).
    pub dt_s: f64,
    /// Seed of every random draw (0 where nothing is drawn).
    pub seed: u64,
    /// Revision of the source the run was made with.
    pub revision: String,
    /// Machine the run was made on.
    pub machine: Machine,
    /// How the steps ended, as the method claimed.
    pub termination: TerminationRecord,
    /// Remarks of the method and the runner.
    pub notes: Vec<String>,
    /// What the referee found in the returned configurations, and what the steps cost; none if the method declined.
    pub metrics: Option<Metrics>,
    /// Trace file relative to the folder of the rows, if one was written.
    pub trace: Option<String>,
}

/// Where a run was made.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Processor model.
    pub cpu: String,
    /// Logical processors.
    pub cores: usize,
    /// Operating system and architecture.
    pub system: String,
}

/// How a run ended, as the method claimed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "status", rename_all = "kebab-case")]
pub enum TerminationRecord {
    /// Every step was taken; number of steps by their termination word.
    Completed {
        /// `word -> steps`.
        steps: BTreeMap<String, u32>,
    },
    /// The method refused the problem.
    Declined {
        /// Why.
        reason: String,
    },
}

/// Everything measured on a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// Judged from q alone.
    #[serde(flatten)]
    pub quality: Quality,
    /// Counted and timed by the runner.
    #[serde(flatten)]
    pub effort: Effort,
}

/// What the referee found, from the returned configurations alone. Sample k = 0 is the start.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// RMS over all samples of the centre-of-mass error norm (m); none without such a task.
    pub com_error_rms_m: Option<f64>,
    /// Its maximum (m).
    pub com_error_max_m: Option<f64>,
    /// Per compromised task: RMS of its error (m or rad), by task name.
    pub soft_error_rms: BTreeMap<String, f64>,
    /// Its largest value, by the same names.
    #[serde(default)]
    pub soft_error_max: BTreeMap<String, f64>,
    /// RMS of the compromised task that has the largest, among those that place a point: a frame's position, that of a
    /// pose, the centre of mass (m); none without such a task.
    #[serde(default)]
    pub soft_error_rms_m: Option<f64>,
    /// Largest error of any of them (m).
    #[serde(default)]
    pub soft_error_max_m: Option<f64>,
    /// Largest component of any hard position row (m).
    pub hard_error_max_m: f64,
    /// Largest rotation angle of any hard orientation task (rad).
    pub hard_error_max_rad: f64,
    /// Per hard task: largest error, by `task_m` / `task_rad`.
    pub hard_error_max: BTreeMap<String, f64>,
    /// RMS over k ≥ 1 of ‖ẋ_com − Δcom/Δt‖ (m/s); none without such a task.
    pub com_rate_error_rms_m_s: Option<f64>,
    /// Largest excess over a joint position limit (rad or m), 0 inside.
    pub position_limit_violation_max_rad: f64,
    /// Largest value over k ≥ 1 and joints of Faraji & Ijspeert (2017), eq. (6): at most 0 inside the ellipse. None if the
    /// problem has no bounded velocity.
    pub boundary_value_max: Option<f64>,
    /// Largest excess over the polygon boundary (rad), where the problem has one.
    pub polygon_excess_max_rad: Option<f64>,
    /// Largest |Δq/Δt| over k ≥ 1 and joints (rad/s).
    pub velocity_max_rad_s: f64,
    /// Largest |Δq/Δt| / q̇max.
    pub velocity_ratio_max: f64,
    /// Largest second difference of a joint over k ≥ 2 (rad/s²).
    pub acceleration_max_rad_s2: f64,
    /// Least singular value of the Jacobian of all task rows over the run.
    pub sigma_min: f64,
    /// Least rank of the hard rows over the run (singular values above 1e-9 of the largest).
    pub hard_rank_min: usize,
    /// First sample after the last t > 1 s with a knee below 0.05 rad (s); none if not asked for, if no knee went below, or
    /// if one never came out.
    pub singularity_exit_s: Option<f64>,
    /// Mean over t ≥ 1 s of the sum of squared static joint torques (N²m²), where asked for.
    pub torque_squared_mean_n2m2: Option<f64>,
    /// Least signed distance over k ≥ 0 of the projected centre of mass to the border of the support polygon (m), positive
    /// inside. None, as the next three, where the suite names no soles.
    #[serde(default)]
    pub gcom_margin_min_m: Option<f64>,
    /// The same of the zero-moment point of point masses (m), over 1 ≤ k < N. None also if some sample has no such point
    /// because the ground would have to pull.
    #[serde(default)]
    pub zmp_margin_min_m: Option<f64>,
    /// The same of the zero-moment point of the cart (m), over 1 ≤ k < N.
    #[serde(default)]
    pub cart_zmp_margin_min_m: Option<f64>,
    /// RMS over 1 ≤ k < N of the distance between the zero-moment point of point masses and the projected centre of mass
    /// (m). None also as before.
    #[serde(default)]
    pub zmp_gcom_distance_rms_m: Option<f64>,
    /// Per secondary objective of the problem, by its kind: mean of its value, of joint centring over k ≥ 0, of the gravity torque
    /// over the samples in which one foot carries (k ≥ 0 in runs without such samples).
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub objective_mean: BTreeMap<String, f64>,
    /// Mean of the sum of squared static joint torques over the samples in which one foot carries (N²m²), the robot hanging
    /// from the support of the phase. None, and the next two empty, where the problem names no supports or both feet always
    /// carry.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub single_support_torque_squared_mean_n2m2: Option<f64>,
    /// RMS of each joint's torque over the same samples (Nm), by joint.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub single_support_torque_rms_nm: BTreeMap<String, f64>,
    /// Largest size of each joint's torque over them (Nm), by joint.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub single_support_torque_peak_nm: BTreeMap<String, f64>,
    /// Mean over the cycles of two steps of the largest change of a joint from one cycle to the next (rad), the first and the
    /// closing step left out. None, as the next, where a walk has fewer than two such cycles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_drift_mean_rad_per_cycle: Option<f64>,
    /// The same over the last cycle alone (rad).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_drift_last_rad_per_cycle: Option<f64>,
    /// RMS of the distance between the zero-moment point of the cart and its reference, later than 0.2 s and without the first
    /// and the last two samples (m). None, as the next three, where nothing walks by preview control or the suite names no
    /// soles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zmp_reference_error_rms_m: Option<f64>,
    /// Its largest value (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zmp_reference_error_max_m: Option<f64>,
    /// `zmp_margin_min_m` over the same samples (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settled_zmp_margin_min_m: Option<f64>,
    /// `cart_zmp_margin_min_m` over the same samples (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub settled_cart_zmp_margin_min_m: Option<f64>,
    /// All finite, limit violation ≤ 1e-6 rad, boundary value ≤ 1e-4 (a polygon: excess ≤ 1e-6 rad
    /// instead, a box: no speed limit passed), hard errors
    /// < 1e-3, `soft_error_max_m` below the tolerance of the suite. Balance does not count.
    pub survived: bool,
}

impl Quality {
    /// [`Quality::soft_error_rms_m`]. Rows recorded before it existed have the error of the centre of mass in its place, the
    /// only such task that suites had.
    pub fn worst_soft_rms_m(&self) -> Option<f64> {
        let before = self.com_error_rms_m.filter(|_| self.lacks_soft_maxima());
        self.soft_error_rms_m.or(before)
    }

    /// [`Quality::soft_error_max_m`], with the same substitute.
    pub fn worst_soft_max_m(&self) -> Option<f64> {
        let before = self.com_error_max_m.filter(|_| self.lacks_soft_maxima());
        self.soft_error_max_m.or(before)
    }

    /// Every compromised task has both, unless the row is older.
    fn lacks_soft_maxima(&self) -> bool {
        self.soft_error_max.is_empty() && !self.soft_error_rms.is_empty()
    }
}

/// What the steps cost.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Effort {
    /// Steps that ended with relaxed hard rows.
    pub relaxed_steps: u32,
    /// Steps in which some joint started outside its boundary.
    pub outside_steps: u32,
    /// Majors per step, mean.
    pub majors_mean: f64,
    /// Majors per step, largest.
    pub majors_max: u32,
    /// Minors per step, mean.
    pub minors_mean: f64,
    /// Minors per step, largest.
    pub minors_max: u32,
    /// Least time of a step (µs), each step being the minimum over repeats; the following are of the same distribution.
    pub step_us_min: f64,
    /// Median.
    pub step_us_median: f64,
    /// 95th percentile.
    pub step_us_p95: f64,
    /// 99th percentile.
    pub step_us_p99: f64,
    /// Largest.
    pub step_us_max: f64,
    /// Mean.
    pub step_us_mean: f64,
    /// Median step time divided by that of `ik1` on the same scenario in the same session; none if it was not run.
    pub step_ratio_to_ik1: Option<f64>,
}

/// A table of a run over time, one row per sample k = 0, 1, …
///
/// Columns: `t`; `base_x base_y base_z base_qx base_qy base_qz base_qw` if the root floats; one per joint by its name; then
/// per task `<task>_target_<component>` (x y z, roll pitch yaw, or qx qy qz qw), the actual point `<task>_x _y _z` (m) of
/// tasks that track one, `<task>_error_m` and/or `<task>_error_rad` (norm, angle), `<task>_rate_error_m_s` for the centre of mass; `step_us`, `majors`, `minors` (0 at
/// k = 0); where the suite asks for torques or the problem names supports `torque_<joint>` (Nm), on the support of the phase in
/// the latter case; `objective_<kind>` per secondary objective; where the problem names supports `standing_foot` (−1 where the right
/// foot stands alone, 1 the left, 0 both).
///
/// Where it names soles, all on the ground, in m and in the world: `gcom_x gcom_y` (projected centre of mass), `zmp_x zmp_y`
/// (zero-moment point of point masses), `cart_zmp_x cart_zmp_y` (that of the cart), `support_x_min support_x_max
/// support_y_min support_y_max` (extent of the support polygon), `gcom_margin zmp_margin` (signed distances to its border,
/// positive inside). Accelerations at k = 0 and N are those at k = 1 and N − 1. Where the ground would have to pull there is
/// no zero-moment point: `zmp_x zmp_y zmp_margin` are NaN. Where it walks by preview control, `zmp_reference_x zmp_reference_y` last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Column names.
    pub columns: Vec<String>,
    /// Values, row by row.
    pub rows: Vec<Vec<f64>>,
}

impl Trace {
    /// Values of one column, if it exists.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let index = self.columns.iter().position(|c| c == name)?;
        Some(self.rows.iter().map(|r| r[index]).collect())
    }
}
