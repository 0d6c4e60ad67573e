//! Ways to solve an inverse-kinematics step.
//!
//! One file per formulation, named by what it does; [`registry`] lists them. [`qp`] holds the quadratic programs they
//! share. This crate knows no suite, no file, no clock.

pub mod baselines;
pub mod constrained_qp;
pub mod davies;
pub mod direct_position;
pub mod error_integration;
pub mod gauss_newton;
mod generic_posture;
mod least_norm;
pub mod null_space_clik;
mod projected_cg;
pub mod qp;
pub mod registry;
pub mod reverse_decoupling;
mod secondary;
mod sqp;
pub mod start;
mod step_qp;
mod support_base;
#[cfg(test)]
mod testing;
pub mod two_slack;
