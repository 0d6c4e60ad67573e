//! Figures 1–3 of the paper: tracking, knee angles and computation time for each iteration budget.

use super::axis::{Axis, Scale};
use super::figure::{Figure, PanelRow};
use super::labels::Labelled;
use super::panel::{Curve, Level, Markers, Panel, common_y, share_y, time_axis};
use super::style::{BLACK, Dash, Marker, Style, Styles};
use super::{AXES_OF_SURVIVORS, Obstacle, Points, Studio, Traced, over_time, place_of, survivors};
use crate::records::Trace;
use crate::statistics::median_filtered;

/// Samples over which a step time is median-filtered (the paper: "filtered").
const TIME_WINDOW: usize = 11;
/// Columns of panels at most.
const MAX_COLUMNS: usize = 3;
const ROW_HEIGHT: f64 = 207.0;

/// One row of panels: a column of the trace over time.
struct Channel {
    label: &'static str,
    scale: Scale,
    column: &'static str,
    treatment: Treatment,
    /// Column of the target.
    target: Option<&'static str>,
    /// Name and value of a horizontal line.
    level: Option<(&'static str, f64)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Treatment {
    AllSamples,
    /// Without sample 0, at which no step was made.
    Steps,
    /// Steps, median-filtered.
    FilteredSteps,
}

impl Channel {
    const fn new(label: &'static str, scale: Scale, column: &'static str, treatment: Treatment) -> Self {
        Self {
            label,
            scale,
            column,
            treatment,
            target: None,
            level: None,
        }
    }

    fn points(&self, trace: &Trace) -> Option<Points> {
        let mut points = over_time(trace, self.column)?;
        if self.treatment != Treatment::AllSamples {
            points.remove(0);
        }
        if self.treatment == Treatment::FilteredSteps {
            let values: Vec<f64> = points.iter().map(|p| p.1).collect();
            let filtered = median_filtered(&values, TIME_WINDOW);
            points
                .iter_mut()
                .zip(filtered)
                .for_each(|(point, value)| point.1 = value);
        }
        Some(points)
    }
}

const COM_ERROR: Channel = Channel::new("CoM error (m)", Scale::Log, "com_error_m", Treatment::AllSamples);
const COM_RATE_ERROR: Channel = Channel::new(
    "CoM rate error (m/s)",
    Scale::Log,
    "com_rate_error_m_s",
    Treatment::Steps,
);
const COM_HEIGHT: Channel = Channel {
    target: Some("com_target_z"),
    ..Channel::new("CoM height (m)", Scale::Linear, "com_z", Treatment::AllSamples)
};
const LEFT_KNEE: Channel = Channel {
    level: Some(("knee limit = singularity", 0.0)),
    ..Channel::new(
        "left knee (rad)",
        Scale::Linear,
        "LKneeSag",
        Treatment::AllSamples,
    )
};
const RIGHT_KNEE: Channel = Channel {
    level: Some(("knee limit = singularity", 0.0)),
    ..Channel::new(
        "right knee (rad)",
        Scale::Linear,
        "RKneeSag",
        Treatment::AllSamples,
    )
};
const STEP_TIME: Channel = Channel::new("step time (µs)", Scale::Log, "step_us", Treatment::FilteredSteps);

/// Figure 1.
pub(super) fn squat(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let title = "Fig. 1  Symmetric squat without singularity";
    tracking(
        studio,
        ("coman/squat", "A"),
        title,
        &[COM_ERROR, COM_RATE_ERROR, STEP_TIME],
    )
}

/// Figure 2.
pub(super) fn stretch(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let title = "Fig. 2  Symmetric squat through full stretch";
    tracking(
        studio,
        ("coman/stretch", "B"),
        title,
        &[COM_HEIGHT, LEFT_KNEE, STEP_TIME],
    )
}

/// Figure 2 at twice the frequency.
pub(super) fn stretch_fast(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let title = "Fig. 2, faster  Symmetric squat through full stretch at 1 Hz";
    tracking(
        studio,
        ("coman/stretch", "B1"),
        title,
        &[COM_HEIGHT, LEFT_KNEE, STEP_TIME],
    )
}

/// Figure 3.
pub(super) fn asymmetric(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let title = "Fig. 3  Asymmetric squat through singularities";
    tracking(
        studio,
        ("coman/asymmetric", "C"),
        title,
        &[COM_HEIGHT, LEFT_KNEE, RIGHT_KNEE, STEP_TIME],
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
    for channel in channels {
        studio.require(channel.column, &traced);
    }
    let columns = columns(&traced);
    let mut rows: Vec<PanelRow> = channels
        .iter()
        .map(|channel| channel_row(channel, &traced, &columns, &studio.styles))
        .collect();
    if let [heads @ .., _] = &mut rows[..] {
        // Time is labelled once, below the last row.
        heads
            .iter_mut()
            .flat_map(|row| &mut row.panels)
            .for_each(|panel| panel.x.label.clear());
    }
    if let Some(top) = rows.first_mut() {
        top.panels
            .iter_mut()
            .zip(&columns)
            .for_each(|(panel, column)| panel.title.clone_from(&column.title));
    }
    let remark = format!(
        "Step times median-filtered over {TIME_WINDOW} samples. Methods without a budget n are shown in every column."
    );
    let title = format!("{title}: {}", place_of(&first.run));
    let mut remarks = vec![remark];
    if channels.iter().any(|channel| channel.scale == Scale::Linear) {
        remarks.push(AXES_OF_SURVIVORS.to_owned());
    }
    Ok(Figure::new(title, rows).with_remarks(remarks).render()?)
}

fn channel_row(channel: &Channel, traced: &[Traced<'_>], columns: &[Column], styles: &Styles) -> PanelRow {
    let of = |runs: &[&Traced<'_>]| -> Vec<Panel> {
        let panels = columns.iter();
        panels
            .map(|column| channel_panel(channel, runs, column, styles))
            .collect()
    };
    let mut panels = of(&traced.iter().collect::<Vec<_>>());
    match channel.scale {
        Scale::Log => share_y(&mut panels),
        Scale::Linear => {
            let range = common_y(&of(&survivors(traced)));
            panels.iter_mut().for_each(|panel| panel.y.range = range);
        }
    }
    PanelRow::new(ROW_HEIGHT, panels)
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

fn channel_panel(channel: &Channel, traced: &[&Traced<'_>], column: &Column, styles: &Styles) -> Panel {
    let mut panel = Panel::new("", time_axis(), Axis::new(channel.label, channel.scale));
    panel.levels.extend(channel.level.map(|(name, value)| Level {
        name: name.to_owned(),
        value,
    }));
    let shown = traced.iter().filter(|t| t.run.n.is_none() || t.run.n == column.n);
    for (rank, one) in shown.enumerate() {
        if rank == 0 {
            let target = channel.target.and_then(|column| over_time(&one.trace, column));
            panel.curves.extend(target.map(reference_curve));
        }
        let points = channel.points(&one.trace);
        panel
            .curves
            .extend(points.map(|p| method_curve(&one.run, p, rank, styles)));
    }
    panel
}

/// A curve in the style of its method.
pub(super) fn method_curve(run: &Labelled<'_>, points: Points, rank: usize, styles: &Styles) -> Curve {
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
