//! Suites: scenarios for one problem, who competes in them, and how to read the result, as TOML.

mod case;
mod closure;
mod lineup;
mod problem_spec;
mod reach;

pub use case::{Case, Variation};
pub use lineup::{Selection, lineup};
pub(crate) use lineup::{build, known_method};
pub use problem_spec::{LimitsSpec, PrioritySpec, ProblemSpec, RobotSpec, TaskSpec, TrackSpec};

use crate::error::InputError;
use crate::referee::Foot;
use crate::trajectory::{GaitSpec, MotionSpec, WalkSpec};
use ik_core::boundary::Boundary;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A suite as it is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Suite {
    /// Id, e.g. `coman/squat`.
    pub id: String,
    /// What it is about, in one line.
    pub title: String,
    /// What it shows, what to look for, and what not to conclude.
    pub analysis: String,
    /// Time step (s).
    pub dt_s: f64,
    /// Largest distance, in a run that survives, of any compromised task that places a point: a frame's position, that of a
    /// pose, the centre of mass (m).
    pub soft_tolerance_m: f64,
    /// Joints whose exit from the straight leg is timed.
    #[serde(default)]
    pub exit_joints: Vec<String>,
    /// Frames that carry the robot where static torques are asked for.
    #[serde(default)]
    pub torque_supports: Vec<String>,
    /// What each foot stands on, where balance is asked for.
    #[serde(default)]
    pub soles: Vec<SoleSpec>,
    /// Whether `ik-bench --quick` leaves it out.
    #[serde(default)]
    pub full_only: bool,
    /// Traces keep every so many samples, and the last one; all without it.
    #[serde(default = "every_sample")]
    pub trace_every: usize,
    /// The problem of all scenarios.
    pub problem: ProblemSpec,
    /// Named start configurations.
    pub starts: BTreeMap<String, StartSpec>,
    /// The scenarios.
    pub scenarios: Vec<ScenarioSpec>,
    /// Who competes; without it, every registered method with its usual budgets.
    #[serde(default)]
    pub contestants: Vec<ContestantSpec>,
    /// Where it was read from, for messages.
    #[serde(skip)]
    pub source: String,
}

fn every_sample() -> usize {
    1
}

/// What a foot stands on: a rectangle around the origin of a frame, in its x–y plane, x forwards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SoleSpec {
    /// Name of the frame.
    pub frame: String,
    /// Half of the extent along x (m).
    pub half_length_m: f64,
    /// Half of the extent along y (m).
    pub half_width_m: f64,
    /// The foot it belongs to.
    pub foot: Foot,
}

/// A start configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartSpec {
    /// Position of a floating root (m, world).
    #[serde(default)]
    pub base_position_m: Option<[f64; 3]>,
    /// Roll, pitch, yaw of a floating root (rad).
    #[serde(default)]
    pub base_rpy_rad: Option<[f64; 3]>,
    /// Joints by name (rad or m); those not named are 0.
    #[serde(default)]
    pub joints: BTreeMap<String, f64>,
    /// What the configuration is made to meet.
    #[serde(default)]
    pub meet: Meet,
}

/// What a start configuration is made to meet before the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Meet {
    /// Nothing: it stays as given.
    #[default]
    Nothing,
    /// The targets of all tasks at t = 0, from the given configuration as guess.
    Targets,
}

/// A motion from a start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioSpec {
    /// Id, unique in the suite.
    pub id: String,
    /// Whether `--quick` keeps it.
    #[serde(default)]
    pub quick: bool,
    /// Duration (s).
    pub duration_s: f64,
    /// Name of the start.
    pub start: String,
    /// A walk: the targets of its tasks, in place of their values at the start.
    #[serde(default)]
    pub gait: Option<GaitSpec>,
    /// A walk by preview control, likewise.
    #[serde(default)]
    pub walk: Option<WalkSpec>,
    /// Gains of the problem's objectives, one each in their order.
    #[serde(default)]
    pub gains: Vec<GainSpec>,
    /// The terms that move the targets; tasks without one keep their value at the start.
    #[serde(default)]
    pub motion: Vec<MotionSpec>,
    /// Boundary in place of the problem's.
    #[serde(default)]
    pub boundary: Option<Boundary>,
}

/// The gain γ of a secondary objective: how fast the joints go down its gradient, `q̇₀ = −γ ∇H`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainSpec {
    /// Its full value (rad²/s per unit of the objective).
    pub value: f64,
    /// Zero in double support, rising from lift-off and falling to touchdown in this time (s); without it the gain is constant.
    #[serde(default)]
    pub single_support_ramp_s: Option<f64>,
}

/// A competing method, or several: lists in `set` are multiplied out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContestantSpec {
    /// Id of the method; `*` is every registered one with its usual budgets.
    pub method: String,
    /// Parameter values, or lists of values.
    #[serde(default)]
    pub set: toml::Table,
}

/// The suites that come with the program: id and text.
pub const EMBEDDED: &[(&str, &str)] = &[
    ("coman/squat", include_str!("../../suites/coman/squat.toml")),
    ("coman/stretch", include_str!("../../suites/coman/stretch.toml")),
    (
        "coman/asymmetric",
        include_str!("../../suites/coman/asymmetric.toml"),
    ),
    ("coman/lean", include_str!("../../suites/coman/lean.toml")),
    ("coman/boundary", include_str!("../../suites/coman/boundary.toml")),
    (
        "coman/regulator",
        include_str!("../../suites/coman/regulator.toml"),
    ),
    ("coman/posture", include_str!("../../suites/coman/posture.toml")),
    ("bioloid/gait", include_str!("../../suites/bioloid/gait.toml")),
    (
        "bioloid/com-sway",
        include_str!("../../suites/bioloid/com-sway.toml"),
    ),
    ("bioloid/squat", include_str!("../../suites/bioloid/squat.toml")),
    ("melson/walk", include_str!("../../suites/melson/walk.toml")),
    (
        "melson/long-walk",
        include_str!("../../suites/melson/long-walk.toml"),
    ),
    ("walk/hubo", include_str!("../../suites/walk/hubo.toml")),
    ("walk/bioloid", include_str!("../../suites/walk/bioloid.toml")),
    ("walk/coman", include_str!("../../suites/walk/coman.toml")),
];

impl Suite {
    /// The suite of that id, or in that file (a name that ends in `.toml`).
    ///
    /// # Errors
    /// An unknown id, a file that cannot be read or is no suite.
    pub fn load(name: &str) -> Result<Self, InputError> {
        if let Some((id, text)) = EMBEDDED.iter().find(|(id, _)| *id == name) {
            return Self::parse(text, &format!("suite {id}"), Path::new("."));
        }
        if !name.ends_with(".toml") {
            return Err(unknown(name));
        }
        let text = std::fs::read_to_string(name).map_err(|e| InputError::File {
            file: name.to_owned(),
            reason: e.to_string(),
        })?;
        Self::parse(&text, name, Path::new(name).parent().unwrap_or(Path::new(".")))
    }

    /// All embedded suites.
    ///
    /// # Errors
    /// As [`Suite::load`]; a test shows that there is none.
    pub fn load_embedded() -> Result<Vec<Self>, InputError> {
        EMBEDDED.iter().map(|(id, _)| Self::load(id)).collect()
    }

    /// Reads a suite; `source` stands for it in messages, files it names are relative to `folder`.
    ///
    /// # Errors
    /// Text that is no suite, with line and column; ids that are no ids, no scenario.
    pub fn parse(text: &str, source: &str, folder: &Path) -> Result<Self, InputError> {
        let syntax = |e: toml::de::Error| InputError::Syntax {
            file: source.to_owned(),
            reason: e.to_string().trim_end().to_owned(),
        };
        let mut suite: Self = toml::from_str(text).map_err(syntax)?;
        source.clone_into(&mut suite.source);
        suite.problem.robot = suite.problem.robot.inlined(folder)?;
        check_id(&suite.id, "id", source, "/")?;
        if suite.trace_every == 0 {
            return Err(InputError::value(source, "trace_every", 0, "at least 1"));
        }
        if suite.scenarios.is_empty() {
            return Err(InputError::value(source, "scenarios", "empty", "at least one"));
        }
        for (i, scenario) in suite.scenarios.iter().enumerate() {
            let field = format!("scenarios[{i}].id");
            check_id(&scenario.id, &field, source, "")?;
            if suite.scenarios[..i].iter().any(|other| other.id == scenario.id) {
                return Err(InputError::value(source, &field, &scenario.id, "ids that differ"));
            }
        }
        Ok(suite)
    }
}

/// A name that is no suite: of a group of suites, or of nothing.
fn unknown(name: &str) -> InputError {
    let embedded = EMBEDDED.iter().chain(crate::limbs::EMBEDDED);
    let ids: Vec<&str> = embedded.map(|(id, _)| *id).collect();
    let group = format!("{}/", name.trim_end_matches('/'));
    let of_group: Vec<&str> = ids.iter().copied().filter(|id| id.starts_with(&group)).collect();
    if of_group.is_empty() {
        let known = ids.into_iter().chain(["or the path of a .toml file"]);
        return InputError::unknown("command line", "suite", name, known);
    }
    let allowed = format!("the suites of this group: {}", of_group.join(", "));
    InputError::value("command line", "suite", name, &allowed)
}

/// Ids become names of files.
pub(crate) fn check_id(id: &str, field: &str, source: &str, also: &str) -> Result<(), InputError> {
    let good = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c) || also.contains(c);
    if !id.is_empty() && id.chars().all(good) {
        return Ok(());
    }
    let allowed = format!("letters, digits and any of `._-{also}`");
    Err(InputError::value(source, field, format!("`{id}`"), &allowed))
}

#[cfg(test)]
mod tests;
