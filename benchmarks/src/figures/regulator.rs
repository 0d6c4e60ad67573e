//! Figure 6 of the paper: what the regulator γ does to velocity and torque when the knee leaves the singularity.

use super::axis::Axis;
use super::figure::{Figure, PanelRow};
use super::labels::Labelled;
use super::panel::{Curve, Markers, Panel, time_axis};
use super::style::{BLACK, Dash, Marker, Style, Styles, VERMILLION};
use super::{Obstacle, Points, Studio, Traced, over_time, place_of, rate_over_time};
use crate::records::{Quality, Trace};
use std::collections::BTreeMap;

const SUITE: &str = "coman/regulator";
/// Values of γ whose traces are shown.
const SHOWN: [f64; 2] = [0.0, 10.0];
/// Method whose traces are shown.
const METHOD: &str = "ik4";
const KNEE: &str = "LKneeSag";
const TORQUE: &str = "torque_LKneeSag";
const HEIGHT: f64 = 290.0;

/// Figure 6.
pub(super) fn regulator(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let runs = studio.runs_of_suite(SUITE);
    let Some(first) = runs.first().cloned() else {
        return Err(Obstacle::NoData(format!("no run on {SUITE}")));
    };
    let shown = SHOWN.iter().filter_map(|gamma| {
        let is_meant = |l: &&Labelled<'_>| l.row.method == METHOD && l.gamma() == Some(*gamma);
        runs.iter().find(is_meant).cloned()
    });
    let traced = studio.with_traces(shown.collect())?;
    studio.require(TORQUE, &traced);
    let velocity = time_panel("knee velocity", "left knee velocity (rad/s)", &traced, |t| {
        rate_over_time(t, KNEE)
    });
    let torque = time_panel("knee torque", "left knee static torque (Nm)", &traced, |t| {
        over_time(t, TORQUE)
    });
    let styles = &studio.styles;
    let exit = gamma_panel("exit from singularity", "exit time (s)", &runs, styles, |q| {
        q.singularity_exit_s
    });
    let jump = gamma_panel(
        "acceleration peak",
        "largest |Δ²q/Δt²| (rad/s²)",
        &runs,
        styles,
        |q| Some(q.acceleration_max_rad_s2),
    );
    let rows = vec![
        PanelRow::new(HEIGHT, vec![velocity, torque]),
        PanelRow::new(HEIGHT, vec![exit, jump]),
    ];
    let title = format!("Fig. 6  Effect of the regulator γ: {}", place_of(&first));
    Ok(Figure::new(title, rows).render()?)
}

fn time_panel(
    title: &str,
    label: &str,
    traced: &[Traced<'_>],
    extract: fn(&Trace) -> Option<Points>,
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
                colour: BLACK,
                dash: Dash::Solid,
                marker: Marker::Triangle,
            },
        };
        let curve = |points| Curve {
            name: format!("{METHOD}, γ = {gamma}"),
            points,
            style,
            width: 1.6,
            markers: Markers::Sparse { rank },
        };
        panel.curves.extend(extract(&one.trace).map(curve));
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
    let mut panel = Panel::new(title, gamma_axis(&gammas), Axis::linear(label));
    let mut groups: BTreeMap<(&str, Option<u64>), Vec<&Labelled<'_>>> = BTreeMap::new();
    for run in runs {
        // Not by label: that tells the values of γ apart.
        groups.entry((&run.row.method, run.n)).or_default().push(run);
    }
    for ((method, n), group) in groups {
        let point = |run: &&Labelled<'_>| {
            let place = gammas
                .iter()
                .position(|g| Some(g.to_bits()) == run.gamma().map(f64::to_bits))?;
            Some((place as f64, metric(&run.row.metrics.as_ref()?.quality)?))
        };
        let mut points: Points = group.iter().filter_map(point).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let name = n.map_or(method.to_owned(), |n| format!("{method} n={n}"));
        let style = styles.of(method);
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

fn gamma_axis(gammas: &[f64]) -> Axis {
    let names = gammas
        .iter()
        .enumerate()
        .map(|(i, g)| (i as f64, g.to_string()))
        .collect();
    let end = (gammas.len() as f64 - 0.5).max(0.5);
    Axis::linear("γ").with_range(-0.5, end).with_names(names)
}
