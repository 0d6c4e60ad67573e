//! Figures of walks by preview control: those of the paper on the humanoid Melson (Figs. 3 to 10), its zero-moment point and
//! objectives over time, and the same chain on Hubo.
//!
//! The paper's scenarios differ in the gains of joint centring and gravity torque; all are shown as its own method, `clik`,
//! went them.

mod drift;
mod hubo;
mod joints;
mod objectives;
mod poses;
mod strips;
mod zmp;

pub(super) use drift::drift;
pub(super) use hubo::methods as hubo_methods;
pub(super) use joints::joints;
pub(super) use objectives::objectives;
pub(super) use poses::poses;
pub(super) use strips::{hubo as hubo_strip, melson as melson_strips};
pub(super) use zmp::{hubo as hubo_zmp, melson as melson_zmp};

use super::style::{BLUE, Dash, GREEN, Style, VERMILLION};
use super::walked::{Place, Walked, plain, walked};
use super::{Obstacle, Points, Studio};

const SHORT: &str = "melson/walk";
const LONG: &str = "melson/long-walk";
const METHOD: &str = "clik";

/// A scenario of Melson: id, entry in legends, look.
#[derive(Clone, Copy)]
struct Scenario {
    id: &'static str,
    name: &'static str,
    style: Style,
}

/// In the order of the paper; the last is drawn on top.
const SCENARIOS: [Scenario; 3] = [
    Scenario {
        id: "S1",
        name: "S1: no objective",
        style: plain(VERMILLION, Dash::Solid),
    },
    Scenario {
        id: "S2",
        name: "S2: joint centring",
        style: plain(BLUE, Dash::Long),
    },
    Scenario {
        id: "S3",
        name: "S3: joint centring and gravity torque",
        style: plain(GREEN, Dash::Short),
    },
];

/// A scenario as it was walked.
struct Shown<'a> {
    scenario: Scenario,
    walked: Walked<'a>,
}

/// Those scenarios of a suite that there are traces of; at least one.
fn scenarios<'a>(studio: &mut Studio<'a>, suite: &'static str) -> Result<Vec<Shown<'a>>, Obstacle> {
    let mut shown = Vec::new();
    for scenario in SCENARIOS {
        let place = Place {
            suite,
            scenario: scenario.id,
            method: METHOD,
        };
        match walked(studio, place) {
            Ok(walked) => shown.push(Shown { scenario, walked }),
            Err(Obstacle::NoData(reason)) => studio.note(reason),
            Err(other) => return Err(other),
        }
    }
    if shown.is_empty() {
        return Err(Obstacle::NoData(format!(
            "no run of {METHOD} with a trace on {suite}"
        )));
    }
    Ok(shown)
}

/// Method, suite and time step as they stand in a title.
fn place_of(shown: &[Shown<'_>]) -> String {
    shown.first().map_or(String::new(), |one| {
        let row = one.walked.run.row;
        let milliseconds = super::milliseconds(row.dt_s);
        format!("{}, {}, Δt = {milliseconds} ms", one.walked.run.label, row.suite)
    })
}

/// Points of a column where one foot stands alone; elsewhere the curve is interrupted.
fn in_single_support(walked: &Walked<'_>, column: &str) -> Result<Points, Obstacle> {
    let standing = walked.over_time("standing_foot")?;
    let values = walked.over_time(column)?;
    let points = values.into_iter().zip(standing);
    Ok(points
        .map(|((t, value), (_, foot))| (t, if foot == 0.0 { f64::NAN } else { value }))
        .collect())
}

#[cfg(test)]
pub(super) mod tests;
