//! What an inverse-kinematics problem *is*: robots, kinematics, tasks, boundaries, one control step.
//!
//! This crate knows no way to solve one. The seam is [`formulation`]: a [`formulation::Formulation`] prepares a
//! [`formulation::Stepper`] for a [`problem::Problem`], and a [`driver::Driver`] feeds it one [`step::ControlStep`] at a
//! time. Methods reach kinematics through the [`evaluator::Evaluator`] only.
//!
//! Units are SI and radians; vectors and rotations are expressed in the world frame unless a name says otherwise.

pub mod boundary;
pub mod configuration;
pub mod driver;
pub mod evaluator;
pub mod formulation;
pub mod instructions;
pub mod kinematics;
pub mod objective;
pub mod problem;
pub mod robot;
pub mod rows;
pub mod spatial;
pub mod step;
pub mod task;
pub mod weights;
