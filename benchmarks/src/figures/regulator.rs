//! Figure 6 of the paper: what the regulator γ does to velocity and torque when the knee leaves the singularity.

use super::axis::Axis;
use super::labels::Labelled;
use super::panel::{Curve, Figure, Markers, Panel, PanelRow, time_axis};
use super::style::{BLUE, Dash, Marker, Style, Styles, VERMILLION};
use super::{Points, Obstacle, Studio, Traced, over_time, place_of, rate_over_time};
use crate::records::Quality;

const SUITE: &str = "coman/regulator";
/// Values of γ whose traces are shown.
const SHOWN: [f64; 2] = [0.0, 10.0];
const HEIGHT: f64 = 290.0;

/// Figure 6.
pub(super) fn regulator(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let runs = studio.runs_of_suite(SUITE);
    let Some(first) = runs.first().cloned() else {
        return Err(Obstacle::NoData(format!("no run on {SUITE}")));
    };
    let is_shown = |l: &&Labelled<'_>| {
        l.row.method == "ik4"
            && l.gamma()
                .is_some_and(|g| SHOWN.iter().any(|s| (s - g).abs() < 1e-12))
    };
    let mut chosen: Vec<Labelled<'_>> = runs.iter().filter(is_shown).cloned().collect();
    chosen.sort_by(|a, b| a.gamma().unwrap_or(0.0).total_cmp(&b.gamma().unwrap_or(0.0)));
    let traced = studio.with_traces(chosen)?;
    let velocity = time_panel("knee velocity, ik4", "left knee velocity (rad/s)", &traced, |t| {
        rate_over_time(&t.trace, "LKneeSag")
    });
    let torque = time_panel("knee torque, ik4", "left knee static torque (Nm)", &traced, |t| {
        over_time(&t.trace, "torque_LKneeSag")
    });
    let exit = gamma_panel(
        "exit from singularity",
        "exit time (s)",
        &runs,
        &studio.styles,
        |q| q.singularity_exit_s,
    );
    let jump = gamma_panel(
        "acceleration peak",
        "largest |Δ²q/Δt²| (rad/s²)",
        &runs,
        &studio.styles,
        |q| Some(q.acceleration_max_rad_s2),
    );
    let rows = vec![
        PanelRow {
            height: HEIGHT,
            panels: vec![velocity, torque],
        },
        PanelRow {
            height: HEIGHT,
            panels: vec![exit, jump],
        },
    ];
    let place = place_of(&first).replace(&format!("scenario {}, ", first.row.scenario), "");
    let title = format!("Fig. 6  Effect of the regulator γ: {place}");
    Ok(Figure {
        title,
        rows,
        remarks: Vec::new(),
        keys: Vec::new(),
    }
    .render()?)
}

fn time_panel(
    title: &str,
    label: &str,
    traced: &[Traced<'_>],
    extract: fn(&Traced<'_>) -> Option<Points>,
) -> Panel {
    let mut panel = Panel::new(title, time_axis(), Axis::linear(label));
    for (rank, one) in traced.iter().enumerate() {
        let gamma = one.run.gamma().unwrap_or_default();
        let style = match rank {
            0 => Style {
                colour: VERMILLION,
                dash: Dash::Long,
                marker: Marker::Square,
            },
            _ => Style {
                colour: BLUE,
                dash: Dash::Solid,
                marker: Marker::Diamond,
            },
        };
        let curve = |points| Curve {
            name: format!("ik4, γ = {gamma}"),
            points,
            style,
            width: 1.6,
            markers: Markers::Sparse { rank },
        };
        panel.curves.extend(extract(one).map(curve));
    }
    panel
}

/// A metric against γ, one curve per method. The values of γ are equally spaced: they include 0 and span decades.
fn gamma_panel(
    title: &str,
    label: &str,
    runs: &[Labelled<'_>],
    styles: &Styles,
    metric: fn(&Quality) -> Option<f64>,
) -> Panel {
    let mut gammas: Vec<f64> = runs.iter().filter_map(Labelled::gamma).collect();
    gammas.sort_by(f64::total_cmp);
    gammas.dedup_by(|a, b| a.to_bits() == b.to_bits());
    let names = gammas
        .iter()
        .enumerate()
        .map(|(i, g)| (i as f64, g.to_string()))
        .collect();
    let edge = (gammas.len() as f64 - 0.5).max(0.5);
    let x = Axis::linear("γ").with_range(-0.5, edge).with_names(names);
    let mut panel = Panel::new(title, x, Axis::linear(label));
    let place = |gamma: f64| gammas.iter().position(|g| g.to_bits() == gamma.to_bits());
    for method in methods(runs) {
        let of_method = runs
            .iter()
            .filter(|r| (&r.row.method, r.n) == (&method.0, method.1));
        let mut points: Points = of_method
            .filter_map(|r| {
                Some((
                    place(r.gamma()?)? as f64,
                    metric(&r.row.metrics.as_ref()?.quality)?,
                ))
            })
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let name = method
            .1
            .map_or(method.0.clone(), |n| format!("{} n={n}", method.0));
        let style = styles.of(&method.0);
        panel.curves.push(Curve {
            name,
            points,
            style,
            width: 1.6,
            markers: Markers::Every,
        });
    }
    panel
}

fn methods(runs: &[Labelled<'_>]) -> Vec<(String, Option<u64>)> {
    let mut methods: Vec<(String, Option<u64>)> = runs.iter().map(|r| (r.row.method.clone(), r.n)).collect();
    methods.sort();
    methods.dedup();
    methods
}
