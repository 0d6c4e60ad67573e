//! Robots: the immutable kinematic tree, how to make one in code or from a URDF file, and the embedded ones.
//!
//! ```
//! use ik_core::robot::embedded;
//! let legs = embedded("coman-legs")?;
//! assert_eq!((legs.nq(), legs.nv()), (7 + 12, 6 + 12));
//! # Ok::<(), ik_core::robot::RobotError>(())
//! ```

pub(crate) mod aligned;
mod builder;
mod check;
mod embedded;
mod error;
mod mimic;
mod model;
mod order;
mod spec;
mod tree;
mod urdf;

pub use builder::RobotBuilder;
pub use embedded::{EMBEDDED, EmbeddedRobot, embedded};
pub use error::{Place, RobotError};
pub use model::{Body, Coordinate, Frame, FrameId, Joint, Limits, Motion, Robot, Root};
pub use spec::{Inertial, JointKind, JointSpec, LinkSpec, Mimic};
pub use urdf::UrdfOptions;
