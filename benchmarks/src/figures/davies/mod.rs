//! Figures of Davies' method on the Bioloid: those of the paper that models it with screws, Assur virtual chains and the
//! circulation law (Figs. 5 to 13), and what its closure, condition and damping cost.
//!
//! The walk itself, its knots and the robot are those of the embedded suite; everything else is read from rows and traces.

mod balance;
mod closure;
mod curves;
mod damping;
mod graph;
mod strip;

pub(super) use balance::balance;
pub(super) use closure::{closure, condition};
pub(super) use curves::{feet, joints, waist};
pub(super) use damping::damping;
pub(super) use graph::graph;
pub(super) use strip::strip;

use super::walked::Place;

const METHOD: &str = "davies";

/// The walk of the paper.
const PLACE: Place = Place {
    suite: "bioloid/gait",
    scenario: "gait",
    method: METHOD,
};

#[cfg(test)]
pub(super) mod tests;
