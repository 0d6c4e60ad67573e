//! Figure 7 of the paper: static torque against knee angle, crouched to stretched, with a fitted line.

use super::axis::Axis;
use super::panel::{Curve, Figure, Markers, Panel, PanelRow};
use super::style::{BLACK, Dash, Marker, Style};
use super::{Points, Obstacle, Studio, milliseconds};
use crate::records::Quality;
use crate::statistics::line_fit;

const SUITE: &str = "coman/posture";
/// Method and budget of the paper's experiment.
const MAIN: (&str, u64) = ("ik4", 3);

/// Figure 7.
pub(super) fn posture(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let runs = studio.runs_of_suite(SUITE);
    let traced = studio.with_traces(runs)?;
    let mut curves: Vec<Curve> = Vec::new();
    let mut main: Points = Vec::new();
    for one in &traced {
        let torque = |q: &Quality| q.torque_squared_mean_n2m2;
        let knee = one.trace.column("LKneeSag").and_then(|c| c.first().copied());
        let Some(point) = knee.zip(one.run.row.metrics.as_ref().and_then(|m| torque(&m.quality))) else {
            continue;
        };
        let is_main = (one.run.label.as_str(), one.run.n) == (MAIN.0, Some(MAIN.1));
        if is_main {
            main.push(point);
        }
        let name = one.run.full();
        match curves.iter_mut().find(|c| c.name == name) {
            Some(curve) => curve.points.push(point),
            None => curves.push(Curve {
                name,
                points: vec![point],
                style: studio.styles.of(&one.run.label),
                width: if is_main { 2.6 } else { 0.9 },
                markers: Markers::Every,
            }),
        }
    }
    let Some(first) = traced.first().filter(|_| !curves.is_empty()) else {
        return Err(Obstacle::NoData(format!(
            "no run with a trace and a torque on {SUITE}"
        )));
    };
    for curve in &mut curves {
        curve.points.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    let mut panel = Panel::new(
        "",
        Axis::linear("left knee at the start (rad)"),
        Axis::linear("mean Στ² for t ≥ 1 s (N²m²)"),
    );
    panel.curves = curves;
    panel.curves.extend(fitted(&main));
    let dt = milliseconds(first.run.row.dt_s);
    let title =
        format!("Fig. 7  Static torque from stretched to crouched: {SUITE}, all scenarios, Δt = {dt} ms");
    let rows = vec![PanelRow {
        height: 420.0,
        panels: vec![panel],
    }];
    Ok(Figure {
        title,
        rows,
        remarks: remarks(main),
        keys: Vec::new(),
    }
    .render()?)
}

fn fitted(points: &[(f64, f64)]) -> Option<Curve> {
    let (intercept, slope) = line_fit(points)?;
    let ends = points
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| {
            (l.min(p.0), h.max(p.0))
        });
    Some(Curve {
        name: format!("linear fit {intercept:.0} + {slope:.0} q"),
        points: [ends.0, ends.1].map(|x| (x, intercept + slope * x)).to_vec(),
        style: Style {
            colour: BLACK,
            dash: Dash::Short,
            marker: Marker::Circle,
        },
        width: 1.4,
        markers: Markers::None,
    })
}

fn remarks(mut points: Points) -> Vec<String> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut remarks =
        vec!["τ²: sum over the leg joints of squared quasi-static torques, both soles loaded.".to_owned()];
    if let [first, .., last] = points[..] {
        remarks.push(format!(
            "{} n={}: start knee {:.2} rad needs {:.1} times the Στ² of {:.2} rad.",
            MAIN.0,
            MAIN.1,
            last.0,
            last.1 / first.1,
            first.0
        ));
    }
    remarks
}
