//! Tasks: what is tracked, and how much.

use crate::robot::{FrameId, Robot};
use serde::{Deserialize, Serialize};

/// A quantity of the robot that follows a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Track {
    /// Position of a frame's origin (m, world): 3 rows.
    Position(FrameId),
    /// Orientation of a frame: 3 rows, in the problem's [`OrientationCoordinates`].
    Orientation(FrameId),
    /// Position, then orientation of a frame: 6 rows.
    Pose(FrameId),
    /// Centre of mass of everything that moves (m, world): 3 rows.
    CentreOfMass,
    /// All independent joint coordinates (rad or m), the root excepted.
    Posture,
}

/// How orientation rows and targets are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OrientationCoordinates {
    /// Rows are differences of roll, pitch and yaw; a target is rpy (rad), its rate the rpy rates (rad/s).
    RollPitchYaw,
    /// Rows are the world rotation vector `log(R Rₜᵀ)` (rad); a target is a unit quaternion `[x y z w]`, its rate the
    /// world angular velocity (rad/s).
    #[default]
    Log,
}

/// A named task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Task {
    /// Name, unique in its problem; prefixes the columns of a trace.
    pub name: String,
    /// What is tracked.
    pub track: Track,
}

/// Whether a task must hold or may be compromised, in one phase.
#[derive(Clone, Debug, PartialEq)]
pub enum Priority {
    /// Its rows are equalities.
    Hard,
    /// Its rows may be missed, at the cost `δᵀ Q δ`.
    Compromised(Weights),
}

/// The weight matrix Q of a compromised task: symmetric positive semidefinite.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weights {
    /// `s I`.
    Uniform(f64),
    /// A diagonal, one entry per row.
    Diagonal(Vec<f64>),
    /// Rows of the full matrix.
    Matrix(Vec<Vec<f64>>),
}

impl Track {
    /// Number of rows (and of numbers in a target rate).
    pub fn rows(&self, robot: &Robot) -> usize {
        match self {
            Self::Position(_) | Self::Orientation(_) | Self::CentreOfMass => 3,
            Self::Pose(_) => 6,
            Self::Posture => robot.coordinates().len(),
        }
    }

    /// Number of numbers in a target.
    pub fn target_len(&self, robot: &Robot, coordinates: OrientationCoordinates) -> usize {
        let extra = match (self, coordinates) {
            (Self::Orientation(_) | Self::Pose(_), OrientationCoordinates::Log) => 1,
            _ => 0,
        };
        self.rows(robot) + extra
    }
}
