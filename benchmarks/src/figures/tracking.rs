//! Figures 1–3 of the paper: tracking, knee angles and computation time for each iteration budget.

use super::axis::{Axis, Scale};
use super::labels::Labelled;
use super::panel::{Curve, Figure, Level, Markers, Panel, PanelRow, time_axis};
use super::style::{BLACK, Dash, Marker, Style, Styles};
use super::{Points, Obstacle, Studio, Traced, over_time, place_of};
use crate::records::Trace;
use crate::statistics::median_filtered;

/// Samples over which a step time is median-filtered (the paper: "filtered").
const TIME_WINDOW: usize = 11;
/// Columns of panels at most.
const MAX_COLUMNS: usize = 3;
const ROW_HEIGHT: f64 = 215.0;

type Extract = fn(&Trace) -> Option<Points>;

/// One row of panels.
struct Channel {
    label: &'static str,
    scale: Scale,
    extract: Extract,
    reference: Option<Extract>,
    level: Option<(f64, &'static str)>,
}

fn channel(label: &'static str, scale: Scale, extract: Extract) -> Channel {
    Channel {
        label,
        scale,
        extract,
        reference: None,
        level: None,
    }
}

fn com_error(trace: &Trace) -> Option<Points> {
    over_time(trace, "com_error_m")
}

fn com_rate_error(trace: &Trace) -> Option<Points> {
    after_start(over_time(trace, "com_rate_error_m_s"))
}

fn com_height(trace: &Trace) -> Option<Points> {
    over_time(trace, "com_z")
}

fn com_target_height(trace: &Trace) -> Option<Points> {
    over_time(trace, "com_target_z")
}

fn left_knee(trace: &Trace) -> Option<Points> {
    over_time(trace, "LKneeSag")
}

fn right_knee(trace: &Trace) -> Option<Points> {
    over_time(trace, "RKneeSag")
}

fn step_time(trace: &Trace) -> Option<Points> {
    let points = after_start(over_time(trace, "step_us"))?;
    let times: Vec<f64> = points.iter().map(|p| p.1).collect();
    Some(
        points
            .iter()
            .map(|p| p.0)
            .zip(median_filtered(&times, TIME_WINDOW))
            .collect(),
    )
}

/// Without sample 0, at which no step was made.
fn after_start(points: Option<Points>) -> Option<Points> {
    points.map(|p| p.into_iter().skip(1).collect())
}

fn height_channel() -> Channel {
    Channel {
        reference: Some(com_target_height),
        ..channel("CoM height (m)", Scale::Linear, com_height)
    }
}

fn knee_channel(label: &'static str, extract: Extract) -> Channel {
    Channel {
        level: Some((0.0, "limit = singularity")),
        ..channel(label, Scale::Linear, extract)
    }
}

fn time_channel() -> Channel {
    channel("step time (µs)", Scale::Log, step_time)
}

/// Figure 1.
pub(super) fn squat(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let channels = [
        channel("CoM error (m)", Scale::Log, com_error),
        channel("CoM rate error (m/s)", Scale::Log, com_rate_error),
        time_channel(),
    ];
    tracking(
        studio,
        ("coman/squat", "A"),
        "Fig. 1  Symmetric squat without singularity",
        &channels,
    )
}

/// Figure 2.
pub(super) fn stretch(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let title = "Fig. 2  Symmetric squat through full stretch";
    tracking(studio, ("coman/stretch", "B"), title, &stretch_channels())
}

/// Figure 2 at twice the frequency.
pub(super) fn stretch_fast(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let title = "Fig. 2, faster  Symmetric squat through full stretch at 1 Hz";
    tracking(studio, ("coman/stretch", "B1"), title, &stretch_channels())
}

fn stretch_channels() -> [Channel; 3] {
    [
        height_channel(),
        knee_channel("left knee (rad)", left_knee),
        time_channel(),
    ]
}

/// Figure 3.
pub(super) fn asymmetric(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let channels = [
        height_channel(),
        knee_channel("left knee (rad)", left_knee),
        knee_channel("right knee (rad)", right_knee),
        time_channel(),
    ];
    tracking(
        studio,
        ("coman/asymmetric", "C"),
        "Fig. 3  Asymmetric squat through singularities",
        &channels,
    )
}

fn tracking(
    studio: &mut Studio<'_>,
    (suite, scenario): (&str, &str),
    title: &str,
    channels: &[Channel],
) -> Result<String, Obstacle> {
    let runs = studio.runs_of(suite, scenario);
    let traced = studio.with_traces(runs)?;
    let Some(first) = traced.first() else {
        return Err(Obstacle::NoData(format!(
            "no run with a trace on {suite}/{scenario}"
        )));
    };
    let columns = columns(&traced);
    let rows = channels.iter().enumerate().map(|(index, channel)| {
        let is_last = index + 1 == channels.len();
        let panel = |column: &Column| {
            let mut panel = channel_panel(channel, &traced, column, &studio.styles);
            if index > 0 {
                panel.title.clear();
            }
            if !is_last {
                panel.x.label.clear();
            }
            panel
        };
        PanelRow {
            height: ROW_HEIGHT,
            panels: columns.iter().map(panel).collect(),
        }
    });
    let figure = Figure {
        title: format!("{title}: {}", place_of(&first.run)),
        rows: rows.collect(),
        remarks: vec![format!(
            "Step times median-filtered over {TIME_WINDOW} samples. Methods without a budget n are shown in every column."
        )],
        keys: Vec::new(),
    };
    Ok(figure.render()?)
}

/// A column of panels: the runs with this budget, and those without one.
struct Column {
    title: String,
    n: Option<u64>,
}

fn columns(traced: &[Traced<'_>]) -> Vec<Column> {
    let mut budgets: Vec<u64> = traced.iter().filter_map(|t| t.run.n).collect();
    budgets.sort_unstable_by(|a, b| b.cmp(a));
    budgets.dedup();
    if budgets.is_empty() {
        return vec![Column {
            title: "all methods".to_owned(),
            n: None,
        }];
    }
    let column = |n: u64| Column {
        title: format!("n = {n}"),
        n: Some(n),
    };
    budgets.into_iter().take(MAX_COLUMNS).map(column).collect()
}

fn channel_panel(channel: &Channel, traced: &[Traced<'_>], column: &Column, styles: &Styles) -> Panel {
    let mut panel = Panel::new(
        &column.title,
        time_axis(),
        Axis::new(channel.label, channel.scale),
    );
    panel.levels.extend(channel.level.map(|(value, text)| Level {
        value,
        text: text.to_owned(),
    }));
    let shown = traced.iter().filter(|t| t.run.n.is_none() || t.run.n == column.n);
    for (rank, one) in shown.enumerate() {
        if rank == 0 {
            panel
                .curves
                .extend(channel.reference.and_then(|r| r(&one.trace)).map(reference_curve));
        }
        let points = (channel.extract)(&one.trace);
        panel
            .curves
            .extend(points.map(|p| method_curve(&one.run, p, rank, styles)));
    }
    panel
}

/// A curve in the style of its method.
pub(super) fn method_curve(
    run: &Labelled<'_>,
    points: Points,
    rank: usize,
    styles: &Styles,
) -> Curve {
    let markers = Markers::Sparse { rank };
    Curve {
        name: run.label.clone(),
        points,
        style: styles.of(&run.label),
        width: 1.5,
        markers,
    }
}

/// The target, below all methods.
pub(super) fn reference_curve(points: Points) -> Curve {
    let style = Style {
        colour: BLACK,
        dash: Dash::Dotted,
        marker: Marker::Circle,
    };
    Curve {
        name: "target".to_owned(),
        points,
        style,
        width: 1.8,
        markers: Markers::None,
    }
}
