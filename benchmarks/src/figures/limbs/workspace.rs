//! Numbers of solutions on slices of the workspace, and reachable orientations by distance.

use super::super::Obstacle;
use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Aspect, Band, Curve, Dot, Markers, Panel};
use super::super::sheet::{Key, Shows};
use super::super::style::{BLACK, BLUE, Dash, GREEN, GREY, Marker, ORANGE, PURPLE, Style, VERMILLION};
use super::Limbs;
use crate::limbs::{Findings, LimbRow, ReachFindings, SliceFindings};
use plotters::style::RGBColor;

/// Numbers of solutions that share a colour: from, to, fill. One hue that darkens, so that order is seen without colour.
const CLASSES: [(u32, u32, RGBColor); 4] = [
    (1, 2, RGBColor(204, 224, 240)),
    (3, 4, RGBColor(133, 184, 219)),
    (5, 6, RGBColor(56, 128, 189)),
    (7, 8, RGBColor(8, 58, 116)),
];
/// Panels side by side, and the heights of slices and of the fractions below.
const COLUMNS: usize = 3;
const SLICE_HEIGHT: f64 = 300.0;
const REACH_HEIGHT: f64 = 270.0;

pub(super) fn workspace(limbs: &Limbs<'_>) -> Result<String, Obstacle> {
    let slices = limbs.found(|found| match found {
        Findings::Slice(slice) => Some(slice),
        _ => None,
    });
    let reach = limbs.found(|found| match found {
        Findings::Reach(reach) => Some(reach),
        _ => None,
    });
    if slices.is_empty() && reach.is_empty() {
        return Err(Obstacle::NoData("no rows of closed-form/reach".to_owned()));
    }
    let mut rows = Vec::new();
    let panels: Vec<Panel> = slices
        .iter()
        .flat_map(|(row, slice)| slice_panels(row, slice))
        .collect();
    let few = panels.chunks(COLUMNS);
    rows.extend(few.map(|few| PanelRow::new(SLICE_HEIGHT, few.to_vec())));
    let of = |family: &str| -> Vec<(&LimbRow, &ReachFindings)> {
        let is_of = |row: &LimbRow| row.side == "right" && row.family.starts_with(family);
        reach.iter().copied().filter(|(row, _)| is_of(row)).collect()
    };
    let fractions = [("legs", of("leg of")), ("arms", of("arm of the paper"))];
    let some = fractions.iter().filter(|(_, rows)| !rows.is_empty());
    let panels: Vec<Panel> = some.map(|(title, rows)| reach_panel(title, rows)).collect();
    let mut remarks = vec![
        "Above: distinct solutions over the sagittal plane through the point where the first three axes meet (cross; of arm6 \
         the origin of its first axis), turning freely or within limits, the end at roll, pitch, yaw in the title (rad), else level; white: out of reach."
            .to_owned(),
    ];
    if !panels.is_empty() {
        rows.push(PanelRow::new(REACH_HEIGHT, panels));
        remarks.push(
            "Below: part of random orientations with a solution, right limbs, by the distance of ankle or wrist from \
             that point as a part of the stretched limb. Marks: measured; lines: expected, for arms l2 |S4| / distance."
                .to_owned(),
        );
    }
    let title = "Where a limb has how many solutions, and how often an orientation can be reached".to_owned();
    let mut figure = Figure::new(title, rows).with_remarks(remarks);
    let slices: Vec<&SliceFindings> = slices.iter().map(|(_, slice)| *slice).collect();
    let mut robots: Vec<&str> = Vec::new();
    for (row, _) in fractions.iter().flat_map(|(_, rows)| rows) {
        if !robots.contains(&row.robot.as_str()) {
            robots.push(&row.robot);
        }
    }
    figure.keys.extend(robots.into_iter().map(robot_key));
    figure.keys.extend(class_keys(&slices));
    Ok(figure.render()?)
}

/// Legend entry of a robot: its line and its mark.
fn robot_key(robot: &str) -> Key {
    Key {
        name: robot.to_owned(),
        style: look(robot),
        shows: Shows::Both,
    }
}

/// Legend entries of the numbers of solutions that occur.
fn class_keys(slices: &[&SliceFindings]) -> Vec<Key> {
    let occurs = |from: u32, to: u32| {
        let mut counts = slices
            .iter()
            .flat_map(|s| s.distinct.iter().chain(&s.within_limits));
        counts.any(|line| line.iter().any(|n| (from..=to).contains(n)))
    };
    let classes = CLASSES.iter().filter(|(from, to, _)| occurs(*from, *to));
    let key = |(from, to, colour): &(u32, u32, RGBColor)| Key {
        name: format!("{from} or {to} solutions"),
        style: Style {
            colour: *colour,
            dash: Dash::Solid,
            marker: Marker::Square,
        },
        shows: Shows::Area,
    };
    classes.map(key).collect()
}

/// All solutions, and those within limits that leave some out.
fn slice_panels(row: &LimbRow, slice: &SliceFindings) -> Vec<Panel> {
    let rotation = match slice.rotation_rpy_rad {
        [0.0, 0.0, 0.0] => String::new(),
        [roll, pitch, yaw] => format!(" ({roll}, {pitch}, {yaw})"),
    };
    let title = format!("{} {}{rotation}", row.robot, slice.frame);
    let mut panels = vec![slice_panel(&title, slice, &slice.distinct)];
    if slice.within_limits != slice.distinct {
        let title = format!("{title}, within limits");
        panels.push(slice_panel(&title, slice, &slice.within_limits));
    }
    panels
}

fn slice_panel(title: &str, slice: &SliceFindings, counts: &[Vec<u32>]) -> Panel {
    let range = |values: &[f64]| match (values.first(), values.last()) {
        (Some(low), Some(high)) => (*low, *high),
        _ => (0.0, 1.0),
    };
    let ((x_low, x_high), (z_low, z_high)) = (range(&slice.x_m), range(&slice.z_m));
    let mut panel = Panel::new(
        title,
        Axis::linear("forwards (m)").with_range(x_low, x_high),
        Axis::linear("up (m)").with_range(z_low, z_high),
    );
    panel.aspect = Aspect::Equal;
    let half_z = half_step(&slice.z_m);
    for (from, to, colour) in CLASSES {
        for (z, line) in slice.z_m.iter().zip(counts) {
            let is_of = |n: &u32| (from..=to).contains(n);
            for (first, last) in runs(line, is_of) {
                let half_x = half_step(&slice.x_m);
                let edge = |x: f64| (x, z - half_z, z + half_z);
                panel.bands.push(Band {
                    name: String::new(),
                    colour,
                    points: vec![edge(slice.x_m[first] - half_x), edge(slice.x_m[last] + half_x)],
                });
            }
        }
    }
    panel.dots.push(Dot {
        at: (0.0, 0.0),
        colour: VERMILLION,
        marker: Marker::Plus,
        radius: 5.0,
    });
    panel
}

/// Half of the distance of neighbours; neighbours overlap, lest hairlines show where pixels are rounded.
fn half_step(values: &[f64]) -> f64 {
    match values {
        [first, second, ..] => 0.7 * (second - first),
        _ => 0.5,
    }
}

/// First and last index of every run of members.
fn runs(line: &[u32], is_member: impl Fn(&u32) -> bool) -> Vec<(usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for i in line
        .iter()
        .enumerate()
        .filter(|(_, n)| is_member(n))
        .map(|(i, _)| i)
    {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == i => *last = i,
            _ => runs.push((i, i)),
        }
    }
    runs
}

const LOOKS: [(RGBColor, Marker); 6] = [
    (BLUE, Marker::Circle),
    (VERMILLION, Marker::Square),
    (GREEN, Marker::Triangle),
    (PURPLE, Marker::Diamond),
    (ORANGE, Marker::Ring),
    (GREY, Marker::Cross),
];
const ROBOTS: [&str; 5] = ["hubo", "hrp2", "asimo", "hoap2", "bioloid"];

fn look(robot: &str) -> Style {
    let known = ROBOTS.iter().position(|known| *known == robot);
    let (colour, marker) = LOOKS[known.unwrap_or(LOOKS.len() - 1)];
    Style {
        colour,
        dash: Dash::Solid,
        marker,
    }
}

fn reach_panel(title: &str, rows: &[(&LimbRow, &ReachFindings)]) -> Panel {
    let x = Axis::linear("distance / stretched limb");
    let y = Axis::linear("part of the orientations").with_range(-0.03, 1.08);
    let mut panel = Panel::new(title, x, y);
    for (row, found) in rows {
        let style = look(&row.robot);
        let beyond = row.parameters.get("beyond").and_then(serde_json::Value::as_f64);
        let far = found.distance_m.last().copied().unwrap_or(1.0) / beyond.unwrap_or(1.0);
        let at = found.distance_m.iter().map(|d| d / far);
        let measured = found
            .reachable
            .iter()
            .map(|n| *n as f64 / found.orientations as f64);
        panel.curves.push(Curve {
            name: String::new(),
            points: at.clone().zip(found.expected.iter().flatten().copied()).collect(),
            style,
            width: 1.2,
            markers: Markers::None,
        });
        panel.dots.extend(at.zip(measured).map(|at| Dot {
            at,
            colour: style.colour,
            marker: style.marker,
            radius: 2.6,
        }));
    }
    // The colour of no robot: one orientation in one.
    panel.curves.push(Curve {
        name: String::new(),
        points: vec![(0.0, 1.0), (1.05, 1.0)],
        style: Style {
            colour: BLACK,
            dash: Dash::Dotted,
            marker: Marker::Plus,
        },
        width: 0.7,
        markers: Markers::None,
    });
    panel
}
