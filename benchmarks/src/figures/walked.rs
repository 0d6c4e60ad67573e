//! A walk of an embedded suite as one method went it, and what its figures share.

use super::labels::{Labelled, is_default};
use super::panel::{Band, Curve, Markers};
use super::skeleton::{Skeleton, configurations};
use super::style::{Dash, Marker, PALE_BLUE, PALE_VERMILLION, Style};
use super::{Obstacle, Points, Studio, over_time};
use crate::records::Trace;
use crate::suite::{Case, SoleSpec, Suite, Variation};
use crate::trajectory::Support;
use plotters::style::RGBColor;

/// Which run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) suite: &'static str,
    pub(super) scenario: &'static str,
    pub(super) method: &'static str,
}

/// The walk as a method went it.
pub(super) struct Walked<'a> {
    pub(super) run: Labelled<'a>,
    pub(super) trace: Trace,
    pub(super) case: Case,
    pub(super) soles: Vec<SoleSpec>,
    /// Configurations of the trace.
    pub(super) q: Vec<Vec<f64>>,
}

/// The run of the place with the default parameters, else the first one.
pub(super) fn walked<'a>(studio: &mut Studio<'a>, place: Place) -> Result<Walked<'a>, Obstacle> {
    let Place {
        suite,
        scenario,
        method,
    } = place;
    let mut runs = studio.runs_of(suite, scenario);
    runs.retain(|run| run.row.method == method);
    let traced = studio.with_traces(runs)?;
    let chosen = traced.iter().position(|t| is_default(t.run.row)).unwrap_or(0);
    let Some(one) = traced.into_iter().nth(chosen) else {
        return Err(Obstacle::NoData(format!(
            "no run of {method} with a trace on {suite}/{scenario}"
        )));
    };
    let (case, soles) = walk_case(place, one.run.row.dt_s)?;
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

/// The scenario of the embedded suite at a time step, and the soles.
pub(super) fn walk_case(place: Place, dt_s: f64) -> Result<(Case, Vec<SoleSpec>), Obstacle> {
    let no_case =
        |e: &dyn std::fmt::Display| Obstacle::NoData(format!("{}/{}: {e}", place.suite, place.scenario));
    let suite = Suite::load(place.suite).map_err(|e| no_case(&e))?;
    let index = suite.scenarios.iter().position(|s| s.id == place.scenario);
    let index = index.ok_or_else(|| no_case(&"no such scenario in the embedded suite"))?;
    let variation = Variation {
        dt_s: Some(dt_s),
        ..Variation::default()
    };
    let case = Case::new(&suite, index, &variation).map_err(|e| no_case(&e))?;
    Ok((case, suite.soles))
}

impl Walked<'_> {
    /// Points (t, value) of a column.
    pub(super) fn over_time(&self, column: &str) -> Result<Points, Obstacle> {
        over_time(&self.trace, column)
            .ok_or_else(|| Obstacle::NoData(format!("the trace has no column {column}")))
    }

    /// Points (t, difference of two columns); none if the trace lacks one.
    pub(super) fn difference(&self, minuend: &str, subtrahend: &str) -> Option<Points> {
        let (a, b) = (
            over_time(&self.trace, minuend)?,
            over_time(&self.trace, subtrahend)?,
        );
        Some(a.into_iter().zip(b).map(|(a, b)| (a.0, a.1 - b.1)).collect())
    }

    /// Times of the samples in the trace (s), as many as configurations.
    pub(super) fn times(&self) -> Vec<f64> {
        self.trace.column("t").unwrap_or_default()
    }

    /// Areas in time where one foot stands alone.
    pub(super) fn supports(&self) -> Vec<Band> {
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

    /// Limbs to the hands and soles, sides as at the start.
    pub(super) fn skeleton(&self) -> Skeleton {
        let robot = self.case.problem.robot();
        let mut skeleton = Skeleton::new(robot, &self.case.q_start);
        for hand in ["r_hand", "l_hand"] {
            skeleton.end(robot, hand);
        }
        for sole in &self.soles {
            skeleton.sole(robot, &sole.frame, [sole.half_length_m, sole.half_width_m]);
        }
        skeleton
    }
}

/// A look of a line without markers.
pub(super) const fn plain(colour: RGBColor, dash: Dash) -> Style {
    let marker = Marker::Circle;
    Style { colour, dash, marker }
}

/// A line without markers.
pub(super) fn line(name: &str, points: Points, style: Style, width: f64) -> Curve {
    Curve {
        name: name.to_owned(),
        points,
        style,
        width,
        markers: Markers::None,
    }
}
