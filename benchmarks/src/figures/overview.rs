//! Overviews: one panel per suite, one line per method, one mark per scenario, on a common axis.

use super::axis::{Axis, Scale};
use super::labels::Labelled;
use super::panel::{Curve, Dot, Figure, Markers, Panel, PanelRow, Remark};
use super::style::{BLACK, Dash, GREY, Marker, Style, VERMILLION};
use super::{Obstacle, Studio};
use crate::records::Metrics;
use crate::statistics::median;

/// Height of a line and of the rest of a panel.
const LINE: f64 = 17.0;
const REST: f64 = 66.0;

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

fn overview(studio: &mut Studio<'_>, title: &str, label: &str, metric: Metric) -> Result<String, Obstacle> {
    let mut suites: Vec<&str> = Vec::new();
    for run in &studio.runs {
        if !suites.contains(&run.row.suite.as_str()) {
            suites.push(&run.row.suite);
        }
    }
    let values: Vec<f64> = studio
        .runs
        .iter()
        .filter_map(|r| metric(r.row.metrics.as_ref()?))
        .filter(|v| v.is_finite())
        .collect();
    if values.is_empty() {
        return Err(Obstacle::NoData("no run has this metric".to_owned()));
    }
    let common = Axis::log(label).fit(&[values], 8);
    let axis = Axis::log(label).with_range(common.low, common.high);
    let panels: Vec<(usize, Panel)> = suites
        .iter()
        .map(|s| suite_panel(s, &studio.runs_of_suite(s), &axis, metric))
        .collect();
    let rows = panels.chunks(2).map(|pair| PanelRow {
        height: REST + LINE * pair.iter().map(|p| p.0).max().unwrap_or_default() as f64,
        panels: pair.iter().map(|p| p.1.clone()).collect(),
    });
    let key = |name: &str, colour, marker| {
        (
            name.to_owned(),
            Style {
                colour,
                dash: Dash::Solid,
                marker,
            },
        )
    };
    let figure = Figure {
        title: format!("{title}, all suites"),
        rows: rows.collect(),
        remarks: vec!["One mark per scenario; the line spans them, the bar is their median.".to_owned()],
        keys: vec![
            key("survived", BLACK, Marker::Circle),
            key("did not survive", VERMILLION, Marker::Cross),
        ],
    };
    Ok(figure.render()?)
}

/// The panel and its number of lines.
fn suite_panel(suite: &str, runs: &[Labelled<'_>], axis: &Axis, metric: Metric) -> (usize, Panel) {
    let mut lines: Vec<(String, Option<u64>)> = Vec::new();
    for run in runs {
        let line = (run.label.clone(), run.n);
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    lines.sort_by_key(|(label, n)| (label.clone(), std::cmp::Reverse(*n)));
    let count = lines.len();
    let height = |index: usize| (count - index) as f64;
    let name = |(label, n): &(String, Option<u64>)| n.map_or(label.clone(), |n| format!("{label} n={n}"));
    let names = lines
        .iter()
        .enumerate()
        .map(|(i, l)| (height(i), name(l)))
        .collect();
    let y = Axis::new("", Scale::Linear)
        .with_range(0.3, count as f64 + 0.7)
        .with_names(names);
    let mut panel = Panel::new(suite, axis.clone(), y);
    for (index, line) in lines.iter().enumerate() {
        let of_line: Vec<&Labelled<'_>> = runs
            .iter()
            .filter(|r| (&r.label, r.n) == (&line.0, line.1))
            .collect();
        add_line(&mut panel, &of_line, height(index), metric);
    }
    (count, panel)
}

fn add_line(panel: &mut Panel, runs: &[&Labelled<'_>], y: f64, metric: Metric) {
    let mut values = Vec::new();
    for metrics in runs.iter().filter_map(|r| r.row.metrics.as_ref()) {
        let Some(value) = metric(metrics).filter(|v| v.is_finite()) else {
            continue;
        };
        values.push(value);
        let (colour, marker) = if metrics.quality.survived {
            (BLACK, Marker::Circle)
        } else {
            (VERMILLION, Marker::Cross)
        };
        panel.dots.push(Dot {
            at: (value, y),
            colour,
            marker,
            radius: 3.0,
        });
    }
    let declined = runs.iter().filter(|r| r.row.metrics.is_none()).count();
    if declined > 0 {
        let text = if declined == runs.len() {
            "declined".to_owned()
        } else {
            format!("{declined} declined")
        };
        let at = panel.x.range.map_or(0.0, |r| r.0 * (r.1 / r.0).powf(0.02));
        panel.remarks.push(Remark { at: (at, y), text });
    }
    if let Some(middle) = median(&mut values) {
        let stroke = |points, width| Curve {
            name: String::new(),
            points,
            style: Style {
                colour: GREY,
                dash: Dash::Solid,
                marker: Marker::Circle,
            },
            width,
            markers: Markers::None,
        };
        panel
            .curves
            .push(stroke(vec![(values[0], y), (values[values.len() - 1], y)], 1.0));
        panel
            .curves
            .push(stroke(vec![(middle, y - 0.36), (middle, y + 0.36)], 2.0));
    }
}
