//! Figure 4 of the paper: leaning back, the hip meets its limit and the knee has to open.

use super::axis::Axis;
use super::panel::{Figure, Level, Panel, PanelRow, time_axis};
use super::tracking::method_curve;
use super::{Obstacle, Studio, Traced, over_time, place_of};

/// Methods the paper compares; the others are drawn thinner.
const COMPARED: [&str; 2] = ["ik2", "ik4"];
const HEIGHT: f64 = 270.0;

/// Figure 4.
pub(super) fn lean(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let runs = studio.runs_of("coman/lean", "D");
    let traced = studio.with_traces(runs)?;
    let Some(first) = traced.first() else {
        return Err(Obstacle::NoData("no run with a trace on coman/lean/D".to_owned()));
    };
    let limits = studio.limits;
    let knee = Level {
        value: limits.knee_rad.0,
        text: "knee limit = singularity".to_owned(),
    };
    let hip = Level {
        value: limits.hip_pitch_rad.1,
        text: format!("hip limit {}", limits.hip_pitch_rad.1),
    };
    let largest = traced.iter().filter_map(|t| t.run.n).max();
    let shown: Vec<&Traced<'_>> = traced
        .iter()
        .filter(|t| t.run.n.is_none() || t.run.n == largest)
        .collect();
    let panel = |title: &str, column: &str, level: Level| {
        let mut panel = Panel::new(title, time_axis(), Axis::linear(&format!("{column} (rad)")));
        panel.levels.push(level);
        for (rank, one) in shown.iter().enumerate() {
            let curve =
                over_time(&one.trace, column).map(|p| method_curve(&one.run, p, rank, &studio.styles));
            let width = if COMPARED.contains(&one.run.label.as_str()) {
                3.0
            } else {
                1.2
            };
            panel
                .curves
                .extend(curve.map(|c| super::panel::Curve { width, ..c }));
        }
        // The wide curves below the thin ones.
        panel.curves.sort_by(|a, b| b.width.total_cmp(&a.width));
        panel
    };
    let rows = vec![
        PanelRow {
            height: HEIGHT,
            panels: vec![panel("left knee", "LKneeSag", knee)],
        },
        PanelRow {
            height: HEIGHT,
            panels: vec![panel("left hip pitch", "LHipSag", hip)],
        },
    ];
    let budget = largest.map_or(String::new(), |n| format!(", n = {n}"));
    let title = format!(
        "Fig. 4  Leaning forward, then backward: {}{budget}",
        place_of(&first.run)
    );
    let remarks = vec!["Wide: the two methods the paper compares, ik2 and ik4.".to_owned()];
    Ok(Figure {
        title,
        rows,
        remarks,
        keys: Vec::new(),
    }
    .render()?)
}
