//! What damping does at straight legs: the squat that stays bent, and the one that asks for more than the legs have.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Level, Panel, time_axis};
use super::super::style::Styles;
use super::super::tracking::method_curve;
use super::super::{Obstacle, Studio, Traced, milliseconds, over_time, rate_over_time};
use super::METHOD;

const SUITE: &str = "bioloid/squat";
const SCENARIOS: [(&str, &str); 2] = [
    ("z180", "z180: waist up to 0.180 m, legs stay bent"),
    ("z190", "z190: waist up to 0.190 m, 3.7 mm beyond straight legs"),
];
const KNEE: &str = "r_knee_pitch";
const HEIGHT: f64 = 235.0;

/// Knee and foot over time for every damping that was run.
pub(in super::super) fn damping(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let mut columns = Vec::new();
    for (scenario, title) in SCENARIOS {
        let mut runs = studio.runs_of(SUITE, scenario);
        runs.retain(|run| run.row.method == METHOD);
        columns.push((title, studio.with_traces(runs)?));
    }
    let Some(dt_s) = columns.iter().find_map(|c| c.1.first()).map(|t| t.run.row.dt_s) else {
        return Err(Obstacle::NoData(format!(
            "no run of {METHOD} with a trace on {SUITE}"
        )));
    };
    let styles = &studio.styles;
    let row = |panel: fn(&[Traced<'_>], &Styles) -> Panel| {
        let panels = columns.iter().map(|(title, traced)| Panel {
            title: (*title).to_owned(),
            ..panel(traced, styles)
        });
        PanelRow::new(HEIGHT, panels.collect())
    };
    let mut rows = vec![row(knee), row(speed), row(foot)];
    // Titles above, time below.
    for (i, row) in rows.iter_mut().enumerate() {
        for panel in &mut row.panels {
            match i {
                0 => panel.x.label.clear(),
                1 => [&mut panel.title, &mut panel.x.label]
                    .into_iter()
                    .for_each(String::clear),
                _ => panel.title.clear(),
            }
        }
    }
    let title = format!(
        "Damping of the hard rows: {METHOD}, {SUITE}, Δt = {} ms",
        milliseconds(dt_s)
    );
    let remark = "Knee angles are brought into (−π, π]: undamped, the legs turn over.";
    Ok(Figure::new(title, rows)
        .with_remarks(vec![remark.to_owned()])
        .render()?)
}

fn knee(traced: &[Traced<'_>], styles: &Styles) -> Panel {
    let mut panel = column_panel("right knee (rad)", KNEE, traced, styles);
    for point in panel.curves.iter_mut().flat_map(|c| &mut c.points) {
        point.1 = point.1.sin().atan2(point.1.cos());
    }
    panel.levels.push(Level {
        name: "straight leg".to_owned(),
        value: 0.0,
    });
    panel
}

fn speed(traced: &[Traced<'_>], styles: &Styles) -> Panel {
    let mut panel = Panel::new("", time_axis(), Axis::log("right knee speed (rad/s)"));
    for (rank, one) in traced.iter().enumerate() {
        let Some(mut points) = rate_over_time(&one.trace, KNEE) else {
            continue;
        };
        points.iter_mut().for_each(|p| p.1 = p.1.abs());
        panel.curves.push(method_curve(&one.run, points, rank, styles));
    }
    panel
}

fn foot(traced: &[Traced<'_>], styles: &Styles) -> Panel {
    let mut panel = column_panel("right foot miss (m)", "right-foot_error_m", traced, styles);
    panel.y = Axis::log(&panel.y.label);
    panel
}

fn column_panel(label: &str, column: &str, traced: &[Traced<'_>], styles: &Styles) -> Panel {
    let mut panel = Panel::new("", time_axis(), Axis::linear(label));
    for (rank, one) in traced.iter().enumerate() {
        let points = over_time(&one.trace, column);
        panel
            .curves
            .extend(points.map(|p| method_curve(&one.run, p, rank, styles)));
    }
    panel
}
