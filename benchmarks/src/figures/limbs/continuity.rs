//! Joints along paths through singular sets.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Curve, Markers, Panel, share_y};
use super::super::style::{BLACK, BLUE, Dash, GREEN, GREY, Marker, ORANGE, PURPLE, SKY, Style, VERMILLION};
use super::super::{Obstacle, Points};
use super::Limbs;
use crate::records::Trace;
use crate::records_io::read_trace;
use plotters::style::RGBColor;
use std::f64::consts::TAU;

/// Shown: robot, beginning of the family, set, words.
const SHOWN: [(&str, &str, &str, &str); 3] = [
    ("hubo", "leg", "hip-0-smooth", "leg through S2 = 0"),
    ("hubo", "arm", "case-3-smooth", "arm through S2 = S4 = 0"),
    ("hubo", "leg", "hip-0-turned", "leg, yaw turned at S2 = 0"),
];
const JOINTS: [(RGBColor, Marker); 6] = [
    (BLUE, Marker::Circle),
    (VERMILLION, Marker::Square),
    (GREEN, Marker::Triangle),
    (PURPLE, Marker::Diamond),
    (ORANGE, Marker::Ring),
    (SKY, Marker::Cross),
];

pub(super) fn continuity(limbs: &Limbs<'_>) -> Result<String, Obstacle> {
    let (mut joints, mut steps) = (Vec::new(), Vec::new());
    for (robot, family, set, words) in SHOWN {
        let Some(row) = limbs.row(robot, family, set) else {
            continue;
        };
        let Some(trace) = row.trace.as_ref().map(|relative| limbs.dir.join(relative)) else {
            continue;
        };
        if trace.exists() {
            let trace = read_trace(&trace)?;
            joints.push(joint_panel(&format!("{robot} {words}"), &trace));
            steps.push(step_panel(&trace));
        }
    }
    if joints.is_empty() {
        return Err(Obstacle::NoData("no traces of closed-form/continuity".to_owned()));
    }
    share_y(&mut joints);
    share_y(&mut steps);
    let rows = vec![PanelRow::new(320.0, joints), PanelRow::new(230.0, steps)];
    let title = "Through singular sets by the posture nearest to the last one".to_owned();
    let remarks = vec![
        "Above: joints 1 to 6 of the solver, and black those that made the poses, from the first sample on and without full \
         turns. On the set, at 0, a joint that the geometry leaves free is held. Right: at 0 the path changes the free \
         joint by 0.8 rad; no continuous joints lead through such poses, and the solver has to jump."
            .to_owned(),
    ];
    Ok(Figure::new(title, rows).with_remarks(remarks).render()?)
}

fn joint_panel(title: &str, trace: &Trace) -> Panel {
    let mut panel = Panel::new(
        title,
        Axis::linear("path (rad)"),
        Axis::linear("joint, change (rad)"),
    );
    let names: Vec<&String> = joint_names(trace).collect();
    for (i, name) in names.iter().enumerate() {
        let (colour, marker) = JOINTS[i % JOINTS.len()];
        let style = Style {
            colour,
            dash: Dash::Solid,
            marker,
        };
        panel.curves.push(Curve {
            name: format!("joint {}", i + 1),
            points: change(trace, name),
            style,
            width: 2.4,
            markers: Markers::Sparse { rank: i },
        });
    }
    for name in names {
        panel.curves.push(Curve {
            name: "generating".to_owned(),
            points: change(trace, &format!("{name}_generating")),
            style: Style {
                colour: BLACK,
                dash: Dash::Dotted,
                marker: Marker::Plus,
            },
            width: 1.0,
            markers: Markers::None,
        });
    }
    panel
}

fn joint_names(trace: &Trace) -> impl Iterator<Item = &String> {
    let is_joint = |name: &&String| *name != "s_rad" && !name.ends_with("_generating");
    trace.columns.iter().filter(is_joint)
}

fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// Change of a column since the first sample, without full turns.
fn change(trace: &Trace, column: &str) -> Points {
    let (Some(places), Some(values)) = (trace.column("s_rad"), trace.column(column)) else {
        return Points::new();
    };
    let mut sum = 0.0;
    let mut points = Points::new();
    for (i, place) in places.iter().enumerate() {
        if i > 0 {
            sum += wrapped(values[i] - values[i - 1]);
        }
        points.push((*place, sum));
    }
    points
}

/// Largest step of a joint, of the solver and of the path.
fn step_panel(trace: &Trace) -> Panel {
    let mut panel = Panel::new(
        "",
        Axis::linear("path (rad)"),
        Axis::log("largest step (rad)").with_range(5e-4, 2.0),
    );
    let curve = |name: &str, ending: &str, colour, dash| Curve {
        name: name.to_owned(),
        points: largest_steps(trace, ending),
        style: Style {
            colour,
            dash,
            marker: Marker::Circle,
        },
        width: 1.8,
        markers: Markers::None,
    };
    panel
        .curves
        .push(curve("step of the solver", "", GREY, Dash::Solid));
    panel
        .curves
        .push(curve("step of the path", "_generating", BLACK, Dash::Dotted));
    panel
}

fn largest_steps(trace: &Trace, ending: &str) -> Points {
    let columns: Vec<Points> = joint_names(trace)
        .map(|name| change(trace, &format!("{name}{ending}")))
        .collect();
    let count = columns.first().map_or(0, Vec::len);
    let largest = |k: usize| {
        let steps = columns.iter().map(|c| (c[k].1 - c[k - 1].1).abs());
        (columns[0][k].0, steps.fold(0.0, f64::max))
    };
    (1..count).map(largest).collect()
}
