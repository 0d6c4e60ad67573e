//! All postures of a pose as stick figures.

use super::super::Obstacle;
use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Aspect, Curve, Dot, Markers, Panel};
use super::super::style::{BLACK, BLUE, Dash, GREEN, GREY, Marker, ORANGE, Style, VERMILLION};
use super::Limbs;
use crate::limbs::{Findings, LimbRow, PosturesFindings, ShownPosture};
use ik_core::robot::{Robot, embedded};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use plotters::style::RGBColor;

/// Where the eye is: this far to the robot's right of straight ahead, and this far above the horizon (rad).
const TO_THE_RIGHT: f64 = 0.9;
const ABOVE: f64 = 0.3;
/// Panels side by side.
const COLUMNS: usize = 4;
const HEIGHT: f64 = 235.0;
/// Length of a drawn axis as a part of the limb.
const AXIS: f64 = 0.2;
/// Axes that are drawn: those that turn over when an indicator changes its sign.
const AXES: [(usize, &str, RGBColor, Marker); 3] = [
    (1, "axis 2", ORANGE, Marker::Circle),
    (3, "axis 4", VERMILLION, Marker::Square),
    (4, "axis 5", GREEN, Marker::Triangle),
];

pub(super) fn postures(limbs: &Limbs<'_>) -> Result<String, Obstacle> {
    let shown = limbs.found(|found| match found {
        Findings::Postures(postures) => Some(postures),
        _ => None,
    });
    let (mut rows, mut drawn) = (Vec::new(), Vec::new());
    for (row, found) in shown {
        // A robot of a file is not at hand any more.
        let Ok(robot) = embedded(&row.robot) else { continue };
        let Some(chain) = Chain::of(&robot, row, found) else {
            continue;
        };
        let mut panels: Vec<Panel> = found.solutions.iter().map(|s| panel(&chain, s)).collect();
        share_ranges(&mut panels);
        drawn.push(format!("{} {}", row.robot, row.limb));
        rows.extend(
            panels
                .chunks(COLUMNS)
                .map(|few| PanelRow::new(HEIGHT, few.to_vec())),
        );
    }
    if rows.is_empty() {
        return Err(Obstacle::NoData(
            "no postures of an embedded robot in closed-form/reach".to_owned(),
        ));
    }
    let title = format!("All postures of one pose: {}", drawn.join(", "));
    let remarks = vec![
        "Seen from before the robot, from its right and from above, in parallel projection (m); grey: from the origin of the \
         body that carries the limb. Below each panel joints 1 to 6 in degrees. Several postures share the places of their \
         links: they differ in which way the axes point, of which those with a mark at their positive end tell them \
         apart."
            .to_owned(),
    ];
    Ok(Figure::new(title, rows).with_remarks(remarks).render()?)
}

/// Origin and axis of a joint.
type Line = (Point3<f64>, Vector3<f64>);

/// The joints of a limb in its robot.
struct Chain<'a> {
    robot: &'a Robot,
    joints: Vec<usize>,
    /// Frames of the last body, seen from it: what is beyond the last joint.
    ends: Vec<Point3<f64>>,
}

impl<'a> Chain<'a> {
    fn of(robot: &'a Robot, row: &LimbRow, found: &PosturesFindings) -> Option<Self> {
        let joint = |name: &String| robot.joints().iter().position(|j| j.name == *name);
        let joints = found.joint_names.iter().map(joint).collect::<Option<Vec<_>>>()?;
        let tip = robot.bodies().iter().position(|b| b.name == row.limb)?;
        let frames = robot.frames().iter().filter(|f| f.body == tip);
        let ends = frames
            .map(|f| Point3::from(f.x_body_frame.translation.vector))
            .collect();
        Some(Self { robot, joints, ends })
    }

    /// Origin and axis of each joint, and the ends, in the body that carries the limb.
    fn at(&self, q: &[f64]) -> (Vec<Line>, Vec<Point3<f64>>) {
        let mut pose = Isometry3::identity();
        let mut lines = Vec::new();
        for (joint, q) in self.joints.iter().zip(q) {
            let joint = &self.robot.joints()[*joint];
            pose *= joint.x_parent_joint;
            let axis = pose.rotation * joint.axis.into_inner();
            lines.push((Point3::from(pose.translation.vector), axis));
            pose.rotation *= UnitQuaternion::from_axis_angle(&joint.axis, *q);
        }
        let ends = self.ends.iter().map(|end| pose * end).collect();
        (lines, ends)
    }
}

/// A point on the paper.
fn seen(p: &Point3<f64>) -> (f64, f64) {
    // The eye is at azimuth −TO_THE_RIGHT from x.
    let (sa, ca) = (-TO_THE_RIGHT).sin_cos();
    let (se, ce) = ABOVE.sin_cos();
    (-sa * p.x + ca * p.y, ce * p.z - se * (ca * p.x + sa * p.y))
}

fn line(name: &str, points: &[Point3<f64>], colour: RGBColor, width: f64) -> Curve {
    Curve {
        name: name.to_owned(),
        points: points.iter().map(seen).collect(),
        style: Style {
            colour,
            dash: Dash::Solid,
            marker: Marker::Circle,
        },
        width,
        markers: Markers::None,
    }
}

fn panel(chain: &Chain<'_>, posture: &ShownPosture) -> Panel {
    let (lines, ends) = chain.at(&posture.joints_rad);
    let degrees: Vec<String> = posture
        .joints_rad
        .iter()
        .map(|q| format!("{:.0}", q.to_degrees()).replace('-', "−"))
        .collect();
    let mut panel = Panel::new(
        &title(posture),
        Axis::linear(&degrees.join("  ")),
        Axis::linear(""),
    );
    panel.aspect = Aspect::Equal;
    let links: Vec<Point3<f64>> = lines.iter().map(|(origin, _)| *origin).collect();
    let (Some(first), Some(last)) = (links.first(), links.last()) else {
        return panel;
    };
    panel
        .curves
        .push(line("to the limb", &[Point3::origin(), *first], GREY, 1.2));
    panel.curves.push(line("links", &links, BLUE, 3.2));
    for end in &ends {
        panel.curves.push(line("last body", &[*last, *end], BLACK, 3.2));
    }
    let reach: f64 = links.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    for (joint, name, colour, marker) in AXES {
        if let Some((origin, axis)) = lines.get(joint) {
            let tip = origin + axis * (AXIS * reach);
            panel.curves.push(line("", &[*origin, tip], colour, 1.8));
            panel.curves.push(Curve {
                name: name.to_owned(),
                points: vec![seen(&tip)],
                style: Style {
                    colour,
                    dash: Dash::Solid,
                    marker,
                },
                width: 1.8,
                markers: Markers::Every,
            });
        }
    }
    for origin in &links {
        panel.dots.push(Dot {
            at: seen(origin),
            colour: BLUE,
            marker: Marker::Circle,
            radius: 2.6,
        });
    }
    panel
}

/// One view for all postures of a limb.
fn share_ranges(panels: &mut [Panel]) {
    let curves = panels.iter().flat_map(|panel| &panel.curves);
    let points: Vec<(f64, f64)> = curves.flat_map(|curve| curve.points.clone()).collect();
    let range = |coordinate: fn(&(f64, f64)) -> f64| {
        let of = || points.iter().map(coordinate);
        let (low, high) = (of().fold(f64::MAX, f64::min), of().fold(f64::MIN, f64::max));
        let margin = 0.05 * (high - low);
        (low - margin, high + margin)
    };
    let ((left, right), (low, high)) = (range(|p| p.0), range(|p| p.1));
    for panel in panels {
        panel.x = panel.x.clone().with_range(left, right);
        panel.y = panel.y.clone().with_range(low, high);
    }
}

/// Indicators with their signs, the first ones of the source first.
fn title(posture: &ShownPosture) -> String {
    let order = ["knee", "elbow", "ankle", "wrist", "hip", "shoulder"];
    let sign = |name: &str| {
        let sign = posture.indicators.get(name)?;
        Some(format!("{name} {}", if *sign < 0 { "−" } else { "+" }))
    };
    let signs: Vec<String> = order.iter().filter_map(|name| sign(name)).collect();
    if signs.is_empty() {
        return format!("branch {}", posture.branch);
    }
    signs.join(", ")
}
