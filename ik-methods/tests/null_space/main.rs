//! Objectives in what the tasks leave free: the steps of closed-loop inverse kinematics against eq. (9) of their source
//! written out, and every method that takes objectives against the stationary point of the same objective.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests; measured numbers are printed"
)]

mod clik;
mod descent;
#[path = "../common/fixture.rs"]
mod fixture;
mod support;
