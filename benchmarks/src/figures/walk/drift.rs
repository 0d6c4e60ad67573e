//! Figure 10: the right hip over thirty steps, and what the joints change from cycle to cycle.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Markers, Panel, share_y, time_axis};
use super::super::style::Marker;
use super::super::walked::{Walked, line};
use super::super::{Obstacle, Points, Studio};
use super::{LONG, SCENARIOS, Shown, place_of, scenarios};

const MARKERS: [Marker; SCENARIOS.len()] = [Marker::Circle, Marker::Square, Marker::Triangle];

/// Joints shown: that of the paper, and one that drifts more.
const JOINTS: [(&str, &str); 2] = [
    ("r_hip_roll", "Fig. 10  right hip roll"),
    ("r_hip_pitch", "right hip pitch"),
];

/// Figure 10.
pub(in super::super) fn drift(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let shown = scenarios(studio, LONG)?;
    let mut angle = JOINTS.map(|(_, title)| Panel::new(title, time_axis(), Axis::linear("angle (rad)")));
    let mut less = JOINTS.map(|_| {
        let title = "at the ends of the cycles, less the first";
        Panel::new(title, time_axis(), Axis::linear("angle (rad)"))
    });
    let mut change = ["right hip roll", "joint that changes most"]
        .map(|title| Panel::new(title, time_axis(), Axis::log("change in a cycle (rad)")));
    for (Shown { scenario, walked }, marker) in shown.iter().zip(MARKERS) {
        let ends = cycle_ends(walked);
        let marked = |points| {
            let mut curve = line(scenario.name, points, scenario.style, 1.5);
            curve.style.marker = marker;
            curve.markers = Markers::Every;
            curve
        };
        for (i, (joint, _)) in JOINTS.into_iter().enumerate() {
            let points = walked.over_time(joint)?;
            let at_ends: Points = ends.iter().map(|&k| points[k]).collect();
            let first = at_ends.first().map_or(0.0, |p| p.1);
            if i == 0 {
                let pairs = at_ends.windows(2);
                let changes = pairs.map(|p| (p[1].0, (p[1].1 - p[0].1).abs()));
                change[0].curves.push(marked(changes.collect()));
            }
            less[i]
                .curves
                .push(marked(at_ends.into_iter().map(|(t, v)| (t, v - first)).collect()));
            angle[i]
                .curves
                .push(line(scenario.name, points, scenario.style, 1.5));
        }
        change[1].curves.push(marked(changes(walked, &ends)));
    }
    share_y(&mut change);
    let rows = [(angle, 250.0), (less, 220.0), (change, 240.0)]
        .map(|(panels, height)| PanelRow::new(height, panels.into()));
    let title = format!("Fig. 10  Drift over 30 steps: {}", place_of(&shown));
    let remark = "A cycle is two steps, 10 s, after which feet, hands and centre of mass stand to each other as before.";
    Ok(Figure::new(title, rows.to_vec())
        .with_remarks(vec![remark.to_owned()])
        .render()?)
}

/// Samples of the trace at the ends of the cycles.
fn cycle_ends(walked: &Walked<'_>) -> Vec<usize> {
    let times = walked.times();
    let nearest = |end: f64| {
        let apart = |k: &usize| (times[*k] - end).abs();
        (0..times.len()).min_by(|a, b| apart(a).total_cmp(&apart(b)))
    };
    let walk = walked.case.trajectory.walk();
    let ends = walk.map_or(Vec::new(), |walk| walk.plan.cycle_ends_s());
    ends.into_iter().filter_map(nearest).collect()
}

/// At the end of each cycle (s), the largest change of a joint since the end of the one before (rad).
fn changes(walked: &Walked<'_>, ends: &[usize]) -> Points {
    let times = walked.times();
    let first = walked.case.problem.robot().root().nq();
    let change = |pair: &[usize]| {
        let joints = walked.q[pair[0]][first..].iter().zip(&walked.q[pair[1]][first..]);
        let largest = joints.map(|(a, b)| (b - a).abs()).fold(0.0, f64::max);
        (times[pair[1]], largest)
    };
    ends.windows(2).map(change).collect()
}
