//! Overviews: one panel per suite, one line per method, one mark per scenario, on a common axis.

use super::axis::Axis;
use super::figure::{Figure, PanelRow};
use super::labels::{Labelled, by_method, numbered};
use super::panel::{Curve, Dot, Markers, Panel, Remark};
use super::sheet::{Key, Shows};
use super::style::{BLACK, Dash, GREY, Marker, Style, VERMILLION};
use super::{Obstacle, Points, Studio};
use crate::records::Metrics;
use crate::statistics::median;

/// Height of a line and of the rest of a panel.
const LINE: f64 = 17.0;
const REST: f64 = 76.0;
/// Factor by which the axis goes beyond its round ends.
const MARGIN: f64 = 1.15;

type Metric = fn(&Metrics) -> Option<f64>;

/// Tracking error.
pub(super) fn error(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    overview(
        studio,
        "Tracking error: rms of the CoM error",
        "CoM error, rms (m)",
        |m| m.quality.com_error_rms_m,
    )
}

/// Time.
pub(super) fn time(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    overview(
        studio,
        "Computation time: median of a step",
        "step time, median (µs)",
        |m| Some(m.effort.step_us_median),
    )
}

/// Iterations.
pub(super) fn majors(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    overview(
        studio,
        "Iterations: mean majors of a step",
        "majors per step, mean",
        |m| Some(m.effort.majors_mean),
    )
}

/// Error of the hard rows.
pub(super) fn hard(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    overview(
        studio,
        "Hard tasks: largest error",
        "largest hard error (m or rad)",
        |m| Some(m.quality.hard_error_max_m.max(m.quality.hard_error_max_rad)),
    )
}

fn overview(studio: &Studio<'_>, title: &str, label: &str, metric: Metric) -> Result<String, Obstacle> {
    let axis = common_axis(studio, label, metric)?;
    let (suites, without): (Vec<&str>, Vec<&str>) = studio
        .suites()
        .into_iter()
        .partition(|suite| has_data(studio, suite, metric));
    let mut remarks = vec!["One mark per scenario; the line spans them, the bar is their median.".to_owned()];
    let mut rows = Vec::new();
    for pair in suites.chunks(2) {
        let runs: Vec<Vec<Labelled<'_>>> = pair.iter().map(|s| studio.runs_of_suite(s)).collect();
        let lines = runs.iter().map(|r| by_method(r).len()).max().unwrap_or_default();
        let panels = pair
            .iter()
            .zip(&runs)
            .map(|(s, r)| suite_panel(s, r, &axis, lines, metric, &mut remarks));
        rows.push(PanelRow::new(REST + LINE * lines as f64, panels.collect()));
    }
    if !without.is_empty() {
        remarks.push(format!("Without this quantity: {}.", without.join(", ")));
    }
    let mut figure = Figure::new(format!("{title}, all suites"), rows).with_remarks(remarks);
    let keys = [("survived", SURVIVED), ("did not survive", LOST)];
    figure.keys = keys
        .map(|(name, style)| Key {
            name: name.to_owned(),
            style,
            shows: Shows::Marker,
        })
        .to_vec();
    Ok(figure.render()?)
}

/// Whether a panel of the suite shows something: a value, or that all methods declined.
fn has_data(studio: &Studio<'_>, suite: &str, metric: Metric) -> bool {
    let runs = studio.runs_of_suite(suite);
    let mut metrics = runs.iter().filter_map(|r| r.row.metrics.as_ref()).peekable();
    metrics.peek().is_none() || metrics.any(|m| metric(m).is_some())
}

/// The axis on which all values of the metric lie.
fn common_axis(studio: &Studio<'_>, label: &str, metric: Metric) -> Result<Axis, Obstacle> {
    let values = studio.runs.iter().filter_map(|r| metric(r.row.metrics.as_ref()?));
    // One curve per value: a logarithmic axis may cut the low end of a curve.
    let values: Vec<Vec<f64>> = values.map(|v| vec![v]).collect();
    if values.is_empty() {
        return Err(Obstacle::NoData("no run has this metric".to_owned()));
    }
    let common = Axis::log(label).fit(&values, 8);
    // A margin, lest marks lie on the frame.
    Ok(Axis::log(label).with_range(common.low / MARGIN, common.high * MARGIN))
}

/// Marks of runs that survived, and of those that did not.
const SURVIVED: Style = Style {
    colour: BLACK,
    dash: Dash::Solid,
    marker: Marker::Circle,
};
const LOST: Style = Style {
    colour: VERMILLION,
    dash: Dash::Solid,
    marker: Marker::Cross,
};

/// Longest name beside a panel (characters); longer ones are numbered and written out below.
const NAME_WIDTH: usize = 24;

/// The panel of a suite, with room for `lines` methods; names that are too long for it go into `remarks`.
fn suite_panel(
    suite: &str,
    runs: &[Labelled<'_>],
    axis: &Axis,
    lines: usize,
    metric: Metric,
    remarks: &mut Vec<String>,
) -> Panel {
    let groups = by_method(runs);
    let height = |index: usize| (lines - index) as f64;
    let mut notes = Vec::new();
    let names = groups
        .iter()
        .enumerate()
        .map(|(i, g)| (height(i), numbered(g[0].full(), NAME_WIDTH, &mut notes)))
        .collect();
    let y = Axis::linear("")
        .with_range(0.3, lines as f64 + 0.7)
        .with_names(names);
    let mut panel = Panel::new(suite, axis.clone(), y);
    let numbers = notes.iter().enumerate();
    remarks.extend(numbers.map(|(i, note)| format!("{suite} [{}]: {note}", i + 1)));
    for (index, group) in groups.iter().enumerate() {
        add_line(&mut panel, group, height(index), metric);
    }
    panel
}

/// The marks of one method at height `y`.
fn add_line(panel: &mut Panel, runs: &[&Labelled<'_>], y: f64, metric: Metric) {
    let mut values = Vec::new();
    for metrics in runs.iter().filter_map(|r| r.row.metrics.as_ref()) {
        let Some(value) = metric(metrics).filter(|v| v.is_finite()) else {
            continue;
        };
        values.push(value);
        let Style { colour, marker, .. } = if metrics.quality.survived { SURVIVED } else { LOST };
        panel.dots.push(Dot {
            at: (value, y),
            colour,
            marker,
            radius: 3.0,
        });
    }
    panel.remarks.extend(declined(runs).map(|text| {
        let (low, high) = panel.x.range.unwrap_or((1.0, 1.0));
        Remark {
            at: (low * (high / low).powf(0.02), y),
            text,
        }
    }));
    if let Some(middle) = median(&mut values) {
        panel
            .curves
            .push(stroke(vec![(values[0], y), (values[values.len() - 1], y)], 1.0));
        panel
            .curves
            .push(stroke(vec![(middle, y - 0.36), (middle, y + 0.36)], 2.0));
    }
}

fn declined(runs: &[&Labelled<'_>]) -> Option<String> {
    match runs.iter().filter(|r| r.row.metrics.is_none()).count() {
        0 => None,
        all if all == runs.len() => Some("declined".to_owned()),
        some => Some(format!("{some} declined")),
    }
}

fn stroke(points: Points, width: f64) -> Curve {
    let style = Style {
        colour: GREY,
        dash: Dash::Solid,
        marker: Marker::Circle,
    };
    Curve {
        name: String::new(),
        points,
        style,
        width,
        markers: Markers::None,
    }
}
