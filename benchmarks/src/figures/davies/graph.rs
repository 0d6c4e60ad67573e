//! Figure 5: the graph of the closed mechanism.

use super::super::mechanism::paint;
use super::super::walked::walked;
use super::super::{Obstacle, Studio};
use super::PLACE;
use ik_core::problem::PhaseId;
use ik_methods::davies::Mechanism;

/// Figure 5.
pub(in super::super) fn graph(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let walked = walked(studio, PLACE)?;
    let mechanism = Mechanism::new(&walked.case.problem, PhaseId(0));
    let (suite, scenario) = (PLACE.suite, PLACE.scenario);
    let title = format!("Fig. 5  Mechanism of robot and virtual chains: {suite}, scenario {scenario}");
    Ok(paint(&mechanism, &title)?)
}
