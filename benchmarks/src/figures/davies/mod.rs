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

use super::labels::Labelled;
use super::panel::Band;
use super::skeleton::configurations;
use super::style::{PALE_BLUE, PALE_VERMILLION};
use super::{Obstacle, Points, Studio, over_time};
use crate::records::{Row, Trace};
use crate::suite::{Case, SoleSpec, Suite, Variation};
use crate::trajectory::Support;
use ik_methods::davies::DaviesParameters;

const SUITE: &str = "bioloid/gait";
const SCENARIO: &str = "gait";
const METHOD: &str = "davies";

/// The walk as Davies' method went it.
struct Walked<'a> {
    run: Labelled<'a>,
    trace: Trace,
    case: Case,
    soles: Vec<SoleSpec>,
    /// Configurations of the trace.
    q: Vec<Vec<f64>>,
}

/// The run of the walk with the default parameters, else the first one.
fn walked<'a>(studio: &mut Studio<'a>) -> Result<Walked<'a>, Obstacle> {
    let mut runs = studio.runs_of(SUITE, SCENARIO);
    runs.retain(|run| run.row.method == METHOD);
    let traced = studio.with_traces(runs)?;
    let chosen = traced.iter().position(|t| has_defaults(t.run.row)).unwrap_or(0);
    let Some(one) = traced.into_iter().nth(chosen) else {
        return Err(Obstacle::NoData(format!(
            "no run of {METHOD} with a trace on {SUITE}/{SCENARIO}"
        )));
    };
    let (case, soles) = walk_case(one.run.row.dt_s)?;
    let Some(q) = configurations(case.problem.robot(), &one.trace) else {
        return Err(Obstacle::NoData("the trace lacks joints of the robot".to_owned()));
    };
    Ok(Walked {
        run: one.run,
        trace: one.trace,
        case,
        soles,
        q,
    })
}

fn has_defaults(row: &Row) -> bool {
    let defaults = serde_json::to_value(DaviesParameters::default()).unwrap_or_default();
    row.parameters
        .iter()
        .all(|(key, value)| defaults.get(key) == Some(value))
}

/// The walk of the embedded suite at a time step, and the soles.
fn walk_case(dt_s: f64) -> Result<(Case, Vec<SoleSpec>), Obstacle> {
    let no_case = |e: &dyn std::fmt::Display| Obstacle::NoData(format!("{SUITE}/{SCENARIO}: {e}"));
    let suite = Suite::load(SUITE).map_err(|e| no_case(&e))?;
    let index = suite.scenarios.iter().position(|s| s.id == SCENARIO);
    let index = index.ok_or_else(|| no_case(&"no such scenario in the embedded suite"))?;
    let variation = Variation {
        dt_s: Some(dt_s),
        ..Variation::default()
    };
    let case = Case::new(&suite, index, &variation).map_err(|e| no_case(&e))?;
    Ok((case, suite.soles))
}

impl Walked<'_> {
    /// Points (t, difference of two columns); none if the trace lacks one.
    fn difference(&self, minuend: &str, subtrahend: &str) -> Option<Points> {
        let (a, b) = (
            over_time(&self.trace, minuend)?,
            over_time(&self.trace, subtrahend)?,
        );
        Some(a.into_iter().zip(b).map(|(a, b)| (a.0, a.1 - b.1)).collect())
    }

    /// Areas in time where one foot stands alone.
    fn supports(&self) -> Vec<Band> {
        let look = |support| match support {
            Support::Both => None,
            Support::Right => Some(("right foot stands alone", PALE_BLUE)),
            Support::Left => Some(("left foot stands alone", PALE_VERMILLION)),
        };
        let (mut bands, mut begin) = (Vec::new(), 0);
        for phase in self.case.support.chunk_by(|a, b| a == b) {
            let end = begin + phase.len();
            let edge = |k: usize| (k as f64 * self.case.dt_s, f64::NEG_INFINITY, f64::INFINITY);
            bands.extend(look(phase[0]).map(|(name, colour)| Band {
                name: name.to_owned(),
                colour,
                points: vec![edge(begin), edge(end - 1)],
            }));
            begin = end;
        }
        bands
    }
}

#[cfg(test)]
pub(super) mod tests;
