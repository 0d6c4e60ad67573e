//! Rotations, screws and the small vector algebra under the kinematics.
//!
//! Conventions used everywhere in the workspace: rotation matrices `r_a_b` map coordinates in frame B to coordinates
//! in frame A; angular velocities and rotation increments are expressed in the *world* frame and act from the left,
//! `R(t + dt) = exp(w dt) R(t)`.

pub(crate) mod lane;
pub mod rpy;
pub mod screw;
pub mod so3;
