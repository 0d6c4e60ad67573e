//! Figure 4 of the paper: leaning back, the hip meets its limit and the knee has to open.

use super::axis::Axis;
use super::figure::{Figure, PanelRow};
use super::panel::{Curve, Level, Panel, common_y, time_axis};
use super::style::Styles;
use super::tracking::method_curve;
use super::{AXES_OF_SURVIVORS, Obstacle, Studio, Traced, over_time, place_of, survivors};

/// Methods the paper compares; the others are drawn thinner.
const COMPARED: [&str; 2] = ["ik2", "ik4"];
const HEIGHT: f64 = 270.0;

/// Figure 4, with the largest budget.
pub(super) fn lean(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let runs = studio.runs_of("coman/lean", "D");
    let largest = runs.iter().filter_map(|r| r.n).max();
    let shown = runs
        .into_iter()
        .filter(|r| r.n.is_none() || r.n == largest)
        .collect();
    let traced = studio.with_traces(shown)?;
    let Some(first) = traced.first() else {
        return Err(Obstacle::NoData("no run with a trace on coman/lean/D".to_owned()));
    };
    let (knee, hip) = (studio.limits.knee_rad.0, studio.limits.hip_pitch_rad.1);
    let knee = Level {
        name: format!("knee limit {knee}"),
        value: knee,
    };
    let hip = Level {
        name: format!("hip pitch limit {hip}"),
        value: hip,
    };
    let row = |title: &str, column: &str, limit: &Level| {
        let of = |runs: &[&Traced<'_>]| panel(title, column, limit.clone(), runs, &studio.styles);
        let mut panel = of(&traced.iter().collect::<Vec<_>>());
        panel.y.range = common_y(&[of(&survivors(&traced))]);
        PanelRow::new(HEIGHT, vec![panel])
    };
    let rows = vec![
        row("left knee", "LKneeSag", &knee),
        row("left hip pitch", "LHipSag", &hip),
    ];
    let budget = largest.map_or(String::new(), |n| format!(", n = {n}"));
    let title = format!(
        "Fig. 4  Leaning forward, then backward: {}{budget}",
        place_of(&first.run)
    );
    let remark = "Wide: the two methods the paper compares, ik2 and ik4.";
    Ok(Figure::new(title, rows)
        .with_remarks(vec![remark.to_owned(), AXES_OF_SURVIVORS.to_owned()])
        .render()?)
}

fn panel(title: &str, column: &str, limit: Level, traced: &[&Traced<'_>], styles: &Styles) -> Panel {
    let mut panel = Panel::new(title, time_axis(), Axis::linear(&format!("{column} (rad)")));
    panel.levels.push(limit);
    for (rank, one) in traced.iter().enumerate() {
        let is_compared = COMPARED.contains(&one.run.label.as_str());
        let width = if is_compared { 3.0 } else { 1.2 };
        let points = over_time(&one.trace, column);
        panel.curves.extend(points.map(|p| Curve {
            width,
            ..method_curve(&one.run, p, rank, styles)
        }));
    }
    // The wide curves below the thin ones.
    panel.curves.sort_by(|a, b| b.width.total_cmp(&a.width));
    panel
}
