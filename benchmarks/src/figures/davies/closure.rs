//! How far the circuits are from closed, and how well the network is conditioned, along the walk.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Curve, Markers, Panel, time_axis};
use super::super::style::{BLUE, Dash, Marker, Style, Styles, VERMILLION};
use super::super::tracking::method_curve;
use super::super::walked::walked;
use super::super::{Obstacle, Points, Studio, Traced, largest_over_time, place_of};
use super::PLACE;
use ik_core::problem::PhaseId;
use ik_methods::davies::{Network, OrientationRates, ReferencePoint};

/// Closure error of every setting of the method that was run.
pub(in super::super) fn closure(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let mut runs = studio.runs_of(PLACE.suite, PLACE.scenario);
    runs.retain(|run| run.row.method.starts_with(PLACE.method));
    let traced = studio.with_traces(runs)?;
    let Some(first) = traced.first() else {
        return Err(Obstacle::NoData(format!(
            "no run of {} with a trace on {}/{}",
            PLACE.method, PLACE.suite, PLACE.scenario
        )));
    };
    let panels = [
        ("largest position error (m)", "_error_m", 320.0),
        ("largest orientation error (rad)", "_error_rad", 230.0),
    ]
    .map(|(label, suffix, height)| {
        PanelRow::new(height, vec![panel(label, suffix, &traced, &studio.styles)])
    });
    let title = format!("Closure error along the walk: {}", place_of(&first.run));
    let remark = "Largest over all tasks: what is left between the end of the real chain and that of the virtual chain.";
    Ok(Figure::new(title, panels.to_vec())
        .with_remarks(vec![remark.to_owned()])
        .render()?)
}

fn panel(label: &str, suffix: &str, traced: &[Traced<'_>], styles: &Styles) -> Panel {
    let mut panel = Panel::new("", time_axis(), Axis::log(label));
    for (rank, one) in traced.iter().enumerate() {
        let points = largest_over_time(&one.trace, suffix);
        panel
            .curves
            .extend(points.map(|p| method_curve(&one.run, p, rank, styles)));
    }
    panel
}

/// Condition numbers are computed at about this many samples.
const SAMPLES: usize = 400;

/// Condition number of N_s with rows at the task points and at the origin.
pub(in super::super) fn condition(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let walked = walked(studio, PLACE)?;
    let problem = &walked.case.problem;
    let stride = walked.q.len().div_ceil(SAMPLES);
    let points = |reference: ReferencePoint| -> Points {
        let at =
            |q: &[f64]| Network::new(problem, PhaseId(0), q, reference, OrientationRates::Euler).condition();
        let samples = walked.q.iter().enumerate().step_by(stride);
        samples
            .map(|(k, q)| (k as f64 * walked.case.dt_s, at(q)))
            .collect()
    };
    let mut panel = Panel::new("", time_axis(), Axis::linear("cond(N_s)"));
    panel.bands = walked.supports();
    let references = [
        (
            "circuits at their task points",
            ReferencePoint::Task,
            BLUE,
            Dash::Solid,
        ),
        (
            "circuits at the world's origin",
            ReferencePoint::Origin,
            VERMILLION,
            Dash::Long,
        ),
    ];
    panel.curves = references
        .map(|(name, reference, colour, dash)| Curve {
            name: name.to_owned(),
            points: points(reference),
            style: Style {
                colour,
                dash,
                marker: Marker::Circle,
            },
            width: 1.8,
            markers: Markers::None,
        })
        .to_vec();
    let title = format!(
        "Condition of the secondary network matrix: {}, {}",
        walked.run.label,
        place_of(&walked.run)
    );
    let remark =
        "Largest over least singular value of N_s, lengths in m, rates of Euler angles: the paper's chains.";
    Ok(Figure::new(title, vec![PanelRow::new(380.0, vec![panel])])
        .with_remarks(vec![remark.to_owned()])
        .render()?)
}
