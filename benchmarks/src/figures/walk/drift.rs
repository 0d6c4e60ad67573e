//! Figure 10: the right hip roll over thirty steps, and what the joints change from cycle to cycle.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Markers, Panel, time_axis};
use super::super::style::Marker;
use super::super::walked::{Walked, line};
use super::super::{Obstacle, Points, Studio};
use super::{LONG, SCENARIOS, Shown, place_of, scenarios};

const MARKERS: [Marker; SCENARIOS.len()] = [Marker::Circle, Marker::Square, Marker::Triangle];

/// Joints followed from cycle to cycle: that of the paper, and one that drifts more.
const FOLLOWED: [(&str, &str); 2] = [
    ("r_hip_roll", "right hip roll"),
    ("r_hip_pitch", "right hip pitch"),
];

/// Figure 10.
pub(in super::super) fn drift(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let shown = scenarios(studio, LONG)?;
    let mut hip = Panel::new("Fig. 10", time_axis(), Axis::linear("right hip roll (rad)"));
    let mut followed = FOLLOWED.map(|(_, name)| {
        let title = format!("{name} at the ends of the cycles");
        Panel::new(&title, time_axis(), Axis::linear("less the first (rad)"))
    });
    let mut change = Panel::new("", time_axis(), Axis::log("largest change in a cycle (rad)"));
    for (Shown { scenario, walked }, marker) in shown.iter().zip(MARKERS) {
        let points = walked.over_time(FOLLOWED[0].0)?;
        hip.curves.push(line(scenario.name, points, scenario.style, 1.5));
        let ends = cycle_ends(walked);
        let marked = |points| {
            let mut curve = line(scenario.name, points, scenario.style, 1.5);
            curve.style.marker = marker;
            curve.markers = Markers::Every;
            curve
        };
        for (panel, (joint, _)) in followed.iter_mut().zip(FOLLOWED) {
            let points = walked.over_time(joint)?;
            let first = ends.first().map_or(0.0, |&k| points[k].1);
            let less = ends.iter().map(|&k| (points[k].0, points[k].1 - first));
            panel.curves.push(marked(less.collect()));
        }
        change.curves.push(marked(changes(walked, &ends)));
    }
    let rows = vec![
        PanelRow::new(270.0, vec![hip]),
        PanelRow::new(220.0, followed.into()),
        PanelRow::new(260.0, vec![change]),
    ];
    let title = format!("Fig. 10  Drift over 30 steps: {}", place_of(&shown));
    let remark = "A cycle is two steps, 10 s, after which feet, hands and centre of mass stand to each other as before. Below: \
                  the joint that changes most.";
    Ok(Figure::new(title, rows)
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
