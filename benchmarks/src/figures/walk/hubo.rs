//! Every method on the walk of Hubo, whose tasks leave one answer: how far each is from it, and what it costs.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Panel, time_axis};
use super::super::tracking::method_curve;
use super::super::{Obstacle, Points, Studio, Traced, largest_over_time, over_time, place_of};
use crate::statistics::median_filtered;

/// Budget of the methods that have one.
const N: u64 = 15;
/// Samples over which a step time is median-filtered.
const TIME_WINDOW: usize = 11;

/// A quantity over time, if the trace has it.
type Channel = fn(&Traced<'_>) -> Option<Points>;

/// Error and step time over the walk.
pub(in super::super) fn methods(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let mut runs = studio.runs_of("walk/hubo", "walk");
    runs.retain(|run| run.n.is_none_or(|n| n == N) && run.row.metrics.is_some());
    let traced = studio.with_traces(runs)?;
    let Some(first) = traced.first() else {
        return Err(Obstacle::NoData("no run with a trace on walk/hubo".to_owned()));
    };
    let channels: [(&str, Channel, f64); 3] = [
        (
            "largest position error (m)",
            |t| largest_over_time(&t.trace, "_error_m"),
            290.0,
        ),
        (
            "largest orientation error (rad)",
            |t| largest_over_time(&t.trace, "_error_rad"),
            290.0,
        ),
        ("step time (µs)", step_time, 230.0),
    ];
    let rows = channels.map(|(label, points, height)| {
        let mut panel = Panel::new("", time_axis(), Axis::log(label));
        for (rank, one) in traced.iter().enumerate() {
            let curve = |points| method_curve(&one.run, points, rank, &studio.styles);
            panel.curves.extend(points(one).map(curve));
        }
        PanelRow::new(height, vec![panel])
    });
    let title = format!(
        "All methods to the same targets: {}, n = {N}",
        place_of(&first.run)
    );
    let remark = format!(
        "Largest over feet, hands, waist and centre of mass. Step times median-filtered over {TIME_WINDOW} samples."
    );
    Ok(Figure::new(title, rows.to_vec())
        .with_remarks(vec![remark])
        .render()?)
}

/// Points (t, filtered step time) from the first step on.
fn step_time(traced: &Traced<'_>) -> Option<Points> {
    let points = over_time(&traced.trace, "step_us")?;
    let steps = points.get(1..)?;
    let values: Vec<f64> = steps.iter().map(|p| p.1).collect();
    let filtered = median_filtered(&values, TIME_WINDOW);
    Some(
        steps
            .iter()
            .zip(filtered)
            .map(|(p, value)| (p.0, value))
            .collect(),
    )
}
