//! Figures 6 to 9 and 13: feet, waist and hands with the knots of the walk, and the joints of the legs.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Curve, Dot, Markers, Panel, time_axis};
use super::super::sheet::{Key, Shows};
use super::super::style::{BLACK, Dash, LEFT, Marker, RIGHT, Style, TRUNK};
use super::super::tracking::reference_curve;
use super::super::walked::{Walked, walked};
use super::super::{Obstacle, Points, Studio, over_time, place_of};
use super::PLACE;
use crate::trajectory;

const KNOT: Style = Style {
    colour: BLACK,
    dash: Dash::Solid,
    marker: Marker::Ring,
};

/// Least range of an axis of angles.
const LEAST_SPAN_RAD: f64 = 0.2;

/// Figures 6 and 7, and how far the feet miss.
pub(in super::super) fn feet(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let walked = walked(studio, PLACE)?;
    let walk = &gait(&walked)?.walk;
    let feet = [
        ("right-foot", RIGHT, &walk.right_foot),
        ("left-foot", LEFT, &walk.left_foot),
    ];
    let mut x = Panel::new("Fig. 6", time_axis(), Axis::linear("foot x (m)"));
    let mut z = Panel::new("Fig. 7", time_axis(), Axis::linear("foot z (m)"));
    let mut miss = Panel::new("", time_axis(), Axis::log("foot miss (m)"));
    for (task, style, swing) in feet {
        track(&mut x, &walked, task, "x", style);
        track(&mut z, &walked, task, "z", style);
        mark(&mut x, &swing.x, 0.0);
        mark(&mut z, &swing.z, 0.0);
        let error = over_time(&walked.trace, &format!("{task}_error_m"));
        miss.curves
            .extend(error.map(|points| limb_curve(task, points, style)));
    }
    let title = "Figs. 6, 7  Feet";
    page(&walked, title, vec![vec![x], vec![z], vec![miss]], 250.0)
}

/// Figures 8 and 9, and the hands.
pub(in super::super) fn waist(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let walked = walked(studio, PLACE)?;
    let walk = &gait(&walked)?.walk;
    let mut waist_x = Panel::new("Fig. 8", time_axis(), Axis::linear("waist x (m)"));
    let mut waist_y = Panel::new("Fig. 9", time_axis(), Axis::linear("waist y (m)"));
    for (panel, component, curve) in [
        (&mut waist_x, "x", &walk.waist_x),
        (&mut waist_y, "y", &walk.waist_y),
    ] {
        track(panel, &walked, "waist", component, TRUNK);
        mark(panel, curve, 0.0);
    }
    let mut hand_x = Panel::new(
        "eqs. (16), (17)",
        time_axis(),
        Axis::linear("hand x less waist x (m)"),
    );
    let mut hand_z = Panel::new("eq. (18)", time_axis(), Axis::linear("hand z (m)"));
    let hands = [
        ("right-hand", RIGHT, &walk.right_hand),
        ("left-hand", LEFT, &walk.left_hand),
    ];
    for (task, style, swing) in hands {
        let target = walked.difference(&format!("{task}_target_x"), "waist_target_x");
        let achieved = walked.difference(&format!("{task}_x"), "waist_x");
        mark(&mut hand_x, &swing.x, offset(target.as_deref(), &swing.x));
        follow(&mut hand_x, task, (target, achieved), style);
        let target = over_time(&walked.trace, &format!("{task}_target_z"));
        mark(&mut hand_z, &swing.z, offset(target.as_deref(), &swing.z));
        track(&mut hand_z, &walked, task, "z", style);
    }
    let title = "Figs. 8, 9  Waist, and the hands";
    page(
        &walked,
        title,
        vec![vec![waist_x, hand_x], vec![waist_y, hand_z]],
        270.0,
    )
}

/// Figure 13.
pub(in super::super) fn joints(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let walked = walked(studio, PLACE)?;
    let [right, left] = ["r_foot", "l_foot"].map(|foot| leg(&walked, foot));
    let panels = right.iter().zip(&left).map(|(right, left)| {
        let title = right.trim_start_matches("r_").replace('_', " ");
        let mut panel = Panel::new(&title, time_axis(), Axis::linear("angle (rad)"));
        for (name, joint, style) in [("right leg", right, RIGHT), ("left leg", left, LEFT)] {
            let points = over_time(&walked.trace, joint);
            panel.curves.extend(points.map(|p| limb_curve(name, p, style)));
        }
        widen(&mut panel);
        panel
    });
    let panels: Vec<Panel> = panels.collect();
    let rows = panels.chunks(2).map(<[Panel]>::to_vec).collect();
    page(&walked, "Fig. 13  Joints of the legs", rows, 210.0)
}

/// A joint that does not move is shown as one, not its rounding.
fn widen(panel: &mut Panel) {
    let angles = || panel.curves.iter().flat_map(|c| &c.points).map(|p| p.1);
    let (low, high) = angles().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v), h.max(v))
    });
    if high - low < LEAST_SPAN_RAD {
        let middle = (low + high) / 2.0;
        panel.y.range = Some((middle - LEAST_SPAN_RAD / 2.0, middle + LEAST_SPAN_RAD / 2.0));
    }
}

/// Joints from the root to a frame.
fn leg(walked: &Walked<'_>, frame: &str) -> Vec<String> {
    let robot = walked.case.problem.robot();
    let body = robot.frame(frame).map(|id| robot.frames()[id.0].body);
    let path = body.map(|body| robot.path(body)).unwrap_or_default();
    path.iter().map(|&j| robot.joints()[j].name.clone()).collect()
}

fn gait<'w>(walked: &'w Walked<'_>) -> Result<&'w trajectory::Gait, Obstacle> {
    let gait = walked.case.trajectory.gait();
    gait.ok_or_else(|| Obstacle::NoData("the embedded scenario has no gait".to_owned()))
}

/// Target and achieved value of one component of a task.
fn track(panel: &mut Panel, walked: &Walked<'_>, task: &str, component: &str, style: Style) {
    let target = over_time(&walked.trace, &format!("{task}_target_{component}"));
    let achieved = over_time(&walked.trace, &format!("{task}_{component}"));
    follow(panel, task, (target, achieved), style);
}

fn follow(panel: &mut Panel, task: &str, (target, achieved): (Option<Points>, Option<Points>), style: Style) {
    // The target above the wider achieved curve, so that both are seen where they agree.
    panel
        .curves
        .extend(achieved.map(|points| limb_curve(task, points, style)));
    panel.curves.extend(target.map(|points| Curve {
        width: 1.0,
        ..reference_curve(points)
    }));
}

fn limb_curve(name: &str, points: Points, style: Style) -> Curve {
    Curve {
        name: name.replace('-', " "),
        points,
        style,
        width: 2.6,
        markers: Markers::None,
    }
}

fn mark(panel: &mut Panel, curve: &trajectory::Curve, offset: f64) {
    let knots = curve.splines().flat_map(trajectory::CubicSpline::knots);
    panel.dots.extend(knots.map(|(t, value)| Dot {
        at: (*t, value + offset),
        colour: KNOT.colour,
        marker: KNOT.marker,
        radius: 2.4,
    }));
}

/// What stands between a curve of the walk and its target: where the hand rests.
fn offset(target: Option<&[(f64, f64)]>, curve: &trajectory::Curve) -> f64 {
    let first = target.and_then(<[_]>::first);
    first.map_or(0.0, |(t, value)| value - curve.value(*t))
}

/// Panels over time with the support phases below them, and a legend for the knots if there are any.
fn page(walked: &Walked<'_>, title: &str, rows: Vec<Vec<Panel>>, height: f64) -> Result<String, Obstacle> {
    if let Some(panel) = rows.iter().flatten().find(|p| p.curves.is_empty()) {
        let reason = format!("the trace lacks columns for {}", panel.y.label);
        return Err(Obstacle::NoData(reason));
    }
    let has_knots = rows.iter().flatten().any(|p| !p.dots.is_empty());
    let rows = rows.into_iter().map(|mut panels| {
        for panel in &mut panels {
            panel.bands = walked.supports();
        }
        PanelRow::new(height, panels)
    });
    let title = format!("{title}: {}, {}", walked.run.label, place_of(&walked.run));
    let mut figure = Figure::new(title, rows.collect());
    if has_knots {
        figure.keys.push(Key {
            name: "knot of the walk".to_owned(),
            style: KNOT,
            shows: Shows::Marker,
        });
    }
    Ok(figure.render()?)
}
