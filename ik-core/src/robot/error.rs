//! What can be wrong with a robot description, each case with the values found and where they stand.

use std::fmt;
use std::sync::Arc;

/// Where in a description an offending element stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// File name of a parsed description, name of the robot of one made in code.
    pub source: Arc<str>,
    /// Line in the file, counted from one; `None` for a robot made in code or an error of the whole file.
    pub line: Option<u32>,
}

impl Place {
    /// A place without line: a whole file or a robot made in code.
    pub fn of(source: &str) -> Self {
        Self {
            source: source.into(),
            line: None,
        }
    }

    /// Line `line` (from one) of the file `source`.
    pub fn line(source: &str, line: u32) -> Self {
        Self {
            source: source.into(),
            line: Some(line),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}", self.source),
            None => write!(f, "{}", self.source),
        }
    }
}

/// A description that is no robot, or a question about a robot that it cannot answer.
///
/// The text names the file (with line) or robot, the element, what was found and what is allowed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(
    missing_docs,
    reason = "the fields are the values in the message, which stands above each variant"
)]
pub enum RobotError {
    #[error("{path}: cannot read the robot description: {reason}")]
    File { path: String, reason: String },
    #[error("{place}: malformed XML: {reason}")]
    Xml { place: Place, reason: String },
    #[error("{place}: the outermost element is <{found}>, a URDF starts with <robot name=\"..\">")]
    NotUrdf { place: Place, found: String },
    #[error("{place}: {owner}: {missing} is missing")]
    Missing {
        place: Place,
        owner: String,
        missing: String,
    },
    #[error("{place}: {owner}: <{element}> occurs more than once, write it once")]
    Repeated {
        place: Place,
        owner: String,
        element: String,
    },
    #[error("{place}: {owner}: {field} is `{found}`, expected {expected}")]
    Number {
        place: Place,
        owner: String,
        field: String,
        found: String,
        expected: &'static str,
    },
    #[error("{place}: {owner}: {field} is {value}, which is not a finite number")]
    NotFinite {
        place: Place,
        owner: String,
        field: String,
        value: f64,
    },
    #[error(
        "{place}: joint `{joint}`: type `{found}` is not supported; \
         use revolute, continuous, prismatic, fixed, or floating under the root link"
    )]
    UnknownJointType {
        place: Place,
        joint: String,
        found: String,
    },
    #[error("{place}: {what} `{name}` is already defined at {first}; names must be unique")]
    Duplicate {
        place: Place,
        what: &'static str,
        name: String,
        first: Place,
    },
    #[error("{place}: joint `{joint}`: {role} link `{link}` does not exist; links: {}", known.join(", "))]
    UnknownLink {
        place: Place,
        joint: String,
        role: &'static str,
        link: String,
        known: Vec<String>,
    },
    #[error(
        "{place}: link `{link}` is the child of joint `{first}` and of joint `{second}`; \
         a tree allows one parent"
    )]
    TwoParents {
        place: Place,
        link: String,
        first: String,
        second: String,
    },
    #[error("{place}: the links {} form a cycle; a robot must be a tree", links.join(" -> "))]
    Cycle { place: Place, links: Vec<String> },
    #[error("{place}: the links {} have no parent; a robot has exactly one root link", roots.join(", "))]
    SeveralRoots { place: Place, roots: Vec<String> },
    #[error("{place}: the robot has no links")]
    Empty { place: Place },
    #[error("{place}: the robot has {found} moving joints, at most {allowed} are supported")]
    TooManyJoints {
        place: Place,
        found: usize,
        allowed: usize,
    },
    #[error(
        "{place}: joint `{joint}`: axis ({}, {}, {}) has length {length}; \
         it must be a unit vector (to {tolerance})", axis[0], axis[1], axis[2]
    )]
    Axis {
        place: Place,
        joint: String,
        axis: [f64; 3],
        length: f64,
        tolerance: f64,
    },
    #[error(
        "{place}: joint `{joint}`: a {kind} joint needs limits (lower, upper, velocity, effort); \
         an unlimited rotation is a continuous joint"
    )]
    MissingLimits {
        place: Place,
        joint: String,
        kind: &'static str,
    },
    #[error(
        "{place}: joint `{joint}`: position limits [{lower}, {upper}] are no interval; need lower <= upper"
    )]
    LimitsReversed {
        place: Place,
        joint: String,
        lower: f64,
        upper: f64,
    },
    #[error("{place}: joint `{joint}`: {field} limit is {value}, it must be zero or more")]
    NegativeLimit {
        place: Place,
        joint: String,
        field: &'static str,
        value: f64,
    },
    #[error("{place}: link `{link}`: mass is {mass_kg} kg, it must be zero or more")]
    NegativeMass {
        place: Place,
        link: String,
        mass_kg: f64,
    },
    #[error(
        "{place}: joint `{joint}`: mimics joint `{master}`, which does not exist or does not move; \
         moving joints: {}", known.join(", ")
    )]
    UnknownMimic {
        place: Place,
        joint: String,
        master: String,
        known: Vec<String>,
    },
    #[error("{place}: the joints {} mimic each other in a loop; one of them must be independent", joints.join(" -> "))]
    MimicLoop { place: Place, joints: Vec<String> },
    #[error("{place}: joint `{joint}`: a {kind} joint has no single value and cannot mimic another joint")]
    MimicNotMoving {
        place: Place,
        joint: String,
        kind: &'static str,
    },
    #[error("{place}: joint `{joint}`: a floating joint {rule}")]
    FloatingJoint {
        place: Place,
        joint: String,
        rule: &'static str,
    },
    #[error("{place}: joint `{joint}` follows joint `{master}` and cannot be locked itself; lock `{master}`")]
    LockedMimic {
        place: Place,
        joint: String,
        master: String,
    },
    #[error("{place}: joint `{joint}` is locked twice, at {first} and at {second}")]
    LockedTwice {
        place: Place,
        joint: String,
        first: f64,
        second: f64,
    },
    #[error("{place}: no independent joint is named `{name}`; independent joints: {}", known.join(", "))]
    UnknownCoordinate {
        place: Place,
        name: String,
        known: Vec<String>,
    },
    #[error("{place}: no frame is named `{name}`; frames: {}", known.join(", "))]
    UnknownFrame {
        place: Place,
        name: String,
        known: Vec<String>,
    },
    #[error("no embedded robot is named `{id}`; embedded robots: {}", known.join(", "))]
    UnknownRobot { id: String, known: Vec<String> },
}
