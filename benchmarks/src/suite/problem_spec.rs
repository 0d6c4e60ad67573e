//! A problem as text: the part that suites (TOML) and instances (JSON) have in common.
//!
//! Everything in it is finite: limits are given only where they differ from the robot's, so that nothing infinite has to
//! be written as JSON.

use crate::error::InputError;
use crate::trajectory::Rates;
use ik_core::boundary::Boundary;
use ik_core::objective::Objective;
use ik_core::problem::{Kind, Phase, Problem, ProblemParts, Supplies};
use ik_core::robot::{FrameId, Limits, Robot, Root, UrdfOptions, embedded};
use ik_core::task::{OrientationCoordinates, Priority, Task, Track, Weights};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

/// A problem: one phase, or one for each support. All phases have the same tasks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProblemSpec {
    /// The robot.
    pub robot: RobotSpec,
    /// Limits that differ from the robot's own.
    #[serde(default)]
    pub limits: Vec<LimitsSpec>,
    /// How orientation targets are written.
    #[serde(default)]
    pub orientation: OrientationCoordinates,
    /// The boundary of all joints.
    pub boundary: Boundary,
    /// Where target rates come from.
    #[serde(default)]
    pub rates: Rates,
    /// Seconds of future targets that methods may see.
    #[serde(default)]
    pub preview_s: f64,
    /// Frames that the robot hangs on in turn, one phase each, in this order; without them there is one phase without a
    /// support.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub supports: Vec<String>,
    /// Secondary objectives; their gains stand in the scenarios.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub objectives: Vec<Objective>,
    /// What is tracked, in the order of targets and rows.
    pub tasks: Vec<TaskSpec>,
}

/// Where a robot comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum RobotSpec {
    /// Id of an embedded robot.
    Embedded(String),
    /// A URDF file.
    UrdfFile {
        /// Path, relative to the file that names it.
        path: String,
        /// How the root is attached.
        #[serde(default)]
        root: Root,
    },
    /// A URDF as text.
    Urdf {
        /// What stands for the file in messages.
        name: String,
        /// The text.
        text: String,
        /// How the root is attached.
        #[serde(default)]
        root: Root,
    },
}

/// Limits that replace those of the robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitsSpec {
    /// The joints concerned; all if empty.
    #[serde(default)]
    pub joints: Vec<String>,
    /// Least value (rad or m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower: Option<f64>,
    /// Largest value (rad or m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper: Option<f64>,
    /// Largest speed (rad/s or m/s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<f64>,
}

/// A task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskSpec {
    /// Name, unique in the problem.
    pub name: String,
    /// What is tracked.
    pub track: TrackSpec,
    /// Whether it must hold.
    pub priority: PrioritySpec,
}

/// What a task tracks, with frames by name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrackSpec {
    /// Position of a frame.
    Position(String),
    /// Orientation of a frame.
    Orientation(String),
    /// Position and orientation of a frame.
    Pose(String),
    /// Centre of mass.
    CentreOfMass,
    /// All joints.
    Posture,
}

/// Whether a task must hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PrioritySpec {
    /// It must.
    Hard,
    /// It may be missed at a cost.
    Compromised(Weights),
}

impl RobotSpec {
    /// The same robot without reference to a file: `folder` is that of the file that names it.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(crate) fn inlined(self, folder: &Path) -> Result<Self, InputError> {
        let Self::UrdfFile { path, root } = self else {
            return Ok(self);
        };
        let file = folder.join(&path).display().to_string();
        let text = std::fs::read_to_string(&file).map_err(|e| InputError::File {
            file: file.clone(),
            reason: e.to_string(),
        })?;
        Ok(Self::Urdf {
            name: file,
            text,
            root,
        })
    }

    /// The robot as `--robot` takes it.
    pub(crate) fn argument(&self) -> &str {
        match self {
            Self::Embedded(id) => id,
            Self::UrdfFile { path, .. } => path,
            Self::Urdf { name, .. } => name,
        }
    }

    /// Builds the robot; `place` goes into messages.
    ///
    /// # Errors
    /// An unknown id, a file that cannot be read or is no robot.
    pub(crate) fn build(&self, place: &str) -> Result<Robot, InputError> {
        let robot = match self {
            Self::Embedded(id) => embedded(id),
            Self::UrdfFile { path, root } => Robot::from_urdf_file(path, &UrdfOptions { root: *root }),
            Self::Urdf { name, text, root } => Robot::from_urdf_str(text, name, &UrdfOptions { root: *root }),
        };
        robot.map_err(|source| match source {
            ik_core::robot::RobotError::UnknownRobot { id, known } => {
                InputError::unknown(&format!("{place}: robot.embedded"), "robot", &id, known)
            }
            source => InputError::Robot {
                place: place.to_owned(),
                source: Box::new(source),
            },
        })
    }
}

impl ProblemSpec {
    /// Builds and checks the problem; `place` stands for the file in messages.
    ///
    /// # Errors
    /// The first fault, naming field, value and what is allowed.
    pub fn build(&self, place: &str) -> Result<Arc<Problem>, InputError> {
        let mut robot = self.robot.build(place)?;
        for limits in &self.limits {
            robot = limits.apply(robot, place)?;
        }
        let (mut tasks, mut priorities) = (Vec::new(), Vec::new());
        for (i, spec) in self.tasks.iter().enumerate() {
            let place = format!("{place}: tasks[{i}]");
            tasks.push(Task {
                name: checked_name(&spec.name, &place)?,
                track: spec.track.build(&robot, &place)?,
            });
            priorities.push((i, spec.priority.build()));
        }
        let parts = ProblemParts {
            phases: self.phases(&robot, &priorities, place)?,
            robot: Arc::new(robot),
            tasks,
            boundary: self.boundary,
            objectives: self.objectives.clone(),
            kind: Kind::Tracking,
            supplies: Supplies {
                rates: self.rates != Rates::Zero,
                preview_s: self.preview_s,
            },
            orientation: self.orientation,
        };
        let problem = Problem::new(parts);
        problem.map(Arc::new).map_err(|source| InputError::Problem {
            place: place.to_owned(),
            source,
        })
    }

    /// One phase per support, named after its frame, all with the same tasks.
    fn phases(
        &self,
        robot: &Robot,
        priorities: &[(usize, Priority)],
        place: &str,
    ) -> Result<Vec<Phase>, InputError> {
        let phase = |name: &str, support| Phase {
            name: name.to_owned(),
            support,
            tasks: priorities.to_vec(),
        };
        if self.supports.is_empty() {
            return Ok(vec![phase("whole", None)]);
        }
        let place = format!("{place}: supports");
        let hung = |name: &String| Ok(phase(name, Some(frame(robot, name, &place)?)));
        self.supports.iter().map(hung).collect()
    }
}

impl LimitsSpec {
    fn apply(&self, mut robot: Robot, place: &str) -> Result<Robot, InputError> {
        let all: Vec<String> = robot.coordinates().iter().map(|c| c.name.clone()).collect();
        let joints = if self.joints.is_empty() {
            &all
        } else {
            &self.joints
        };
        for joint in joints {
            let place = format!("{place}: limits");
            let Ok(index) = robot.coordinate(joint) else {
                return Err(InputError::unknown(&place, "joint", joint, &all));
            };
            let old = robot.coordinates()[index].limits;
            let limits = Limits {
                lower: self.lower.unwrap_or(old.lower),
                upper: self.upper.unwrap_or(old.upper),
                velocity: self.velocity.unwrap_or(old.velocity),
                ..old
            };
            for (field, value) in [
                ("lower", self.lower),
                ("upper", self.upper),
                ("velocity", self.velocity),
            ] {
                crate::error::finite(&place, field, value.unwrap_or(0.0))?;
            }
            if self.velocity.is_some_and(|v| v <= 0.0) {
                return Err(InputError::value(
                    &place,
                    "velocity",
                    limits.velocity,
                    "a finite number above 0",
                ));
            }
            robot = robot.with_limits(joint, limits).map_err(|e| InputError::Robot {
                place,
                source: Box::new(e),
            })?;
        }
        Ok(robot)
    }
}

impl TrackSpec {
    fn build(&self, robot: &Robot, place: &str) -> Result<Track, InputError> {
        let frame = |name: &str| frame(robot, name, &format!("{place}.track"));
        Ok(match self {
            Self::Position(name) => Track::Position(frame(name)?),
            Self::Orientation(name) => Track::Orientation(frame(name)?),
            Self::Pose(name) => Track::Pose(frame(name)?),
            Self::CentreOfMass => Track::CentreOfMass,
            Self::Posture => Track::Posture,
        })
    }
}

impl PrioritySpec {
    fn build(&self) -> Priority {
        match self {
            Self::Hard => Priority::Hard,
            Self::Compromised(weights) => Priority::Compromised(weights.clone()),
        }
    }
}

/// The frame of that name.
pub(crate) fn frame(robot: &Robot, name: &str, place: &str) -> Result<FrameId, InputError> {
    let known = robot.frames().iter().map(|f| &f.name);
    robot
        .frame(name)
        .map_err(|_| InputError::unknown(place, "frame", name, known))
}

/// Task names head the columns of a trace.
fn checked_name(name: &str, place: &str) -> Result<String, InputError> {
    if !name.is_empty()
        && name
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
    {
        return Ok(name.to_owned());
    }
    Err(InputError::value(
        place,
        "name",
        format!("`{name}`"),
        "letters, digits, `_` and `-`",
    ))
}
