//! Figure 5: the graph of the closed mechanism.

use super::super::mechanism::paint;
use super::super::{Obstacle, Studio};
use super::{SCENARIO, SUITE, walked};
use ik_core::problem::PhaseId;
use ik_methods::davies::Mechanism;

/// Figure 5.
pub(in super::super) fn graph(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let walked = walked(studio)?;
    let mechanism = Mechanism::new(&walked.case.problem, PhaseId(0));
    let title = format!("Fig. 5  Mechanism of robot and virtual chains: {SUITE}, scenario {SCENARIO}");
    Ok(paint(&mechanism, &title)?)
}
