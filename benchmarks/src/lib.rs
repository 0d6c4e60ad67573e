//! The shoot-out: suites, runner, referee, records, statistics and figures behind the command `ik-bench`.
//!
//! A [`suite::Suite`] becomes [`suite::Case`]s, each a checked problem with sampled targets; the [`runner`] plays the
//! contestants of the registry through them; the [`referee`] judges the returned configurations; [`records_io`] keeps the
//! rows, from which [`figures`] and [`summary`] make everything that is shown. Nothing here knows the inside of a method.

pub mod cli;
pub mod error;
pub mod figures;
pub mod instance;
pub mod limb_pose;
pub mod limbs;
pub mod machine;
pub mod records;
pub mod records_io;
pub mod referee;
pub mod runner;
pub mod statistics;
pub mod suite;
pub mod summary;
pub mod trajectory;
