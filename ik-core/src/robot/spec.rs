//! What a builder takes: links and joints as a description states them, unchecked.

use super::model::Limits;
use nalgebra::{Isometry3, Matrix3, Vector3};

/// What a joint of a description allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// Rotation about the axis within limits.
    Revolute,
    /// Rotation about the axis without position limits.
    Continuous,
    /// Translation along the axis within limits.
    Prismatic,
    /// No motion.
    Fixed,
    /// All motions, allowed for the only joint of a massless root link: makes the child the root body of a
    /// free flyer.
    Floating,
}

impl JointKind {
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Continuous => "continuous",
            Self::Prismatic => "prismatic",
            Self::Fixed => "fixed",
            Self::Floating => "floating",
        }
    }

    pub(super) fn moves(self) -> bool {
        matches!(self, Self::Revolute | Self::Continuous | Self::Prismatic)
    }
}

/// Mass, centre of mass and inertia of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Inertial {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the link frame, m.
    pub com: Vector3<f64>,
    /// Inertia about the centre of mass in the axes of the link frame, kg m^2; symmetric.
    pub inertia: Matrix3<f64>,
}

/// A link to be built; without inertial it is massless.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkSpec {
    /// Name, unique among the links.
    pub name: String,
    /// Mass data.
    pub inertial: Option<Inertial>,
}

/// A joint that follows another: value = `multiplier * value of joint + offset`.
#[derive(Debug, Clone, PartialEq)]
pub struct Mimic {
    /// Name of the joint followed, which may itself follow another.
    pub joint: String,
    /// Factor.
    pub multiplier: f64,
    /// Summand, rad or m.
    pub offset: f64,
}

/// A joint to be built.
#[derive(Debug, Clone, PartialEq)]
pub struct JointSpec {
    /// Name, unique among the joints.
    pub name: String,
    /// What it allows.
    pub kind: JointKind,
    /// Name of the link that carries it.
    pub parent: String,
    /// Name of the link it moves.
    pub child: String,
    /// Pose of the joint frame in the parent link frame.
    pub origin: Isometry3<f64>,
    /// Unit axis in the joint frame; ignored for fixed and floating joints.
    pub axis: Vector3<f64>,
    /// Required for revolute and prismatic joints; position limits are ignored for continuous ones. Infinite
    /// where there is no limit.
    pub limits: Option<Limits>,
    /// The joint it follows, if any; limits of a joint that follows another are checked but not used.
    pub mimic: Option<Mimic>,
}
