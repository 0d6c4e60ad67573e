//! Figures 3 to 5: torque and position of hip, knee and ankle of the left leg in the three scenarios.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Panel, time_axis};
use super::super::walked::line;
use super::super::{Obstacle, Studio};
use super::{SHORT, Shown, in_single_support, place_of, scenarios};

/// Joint and title; "around x" of the paper is the roll.
const JOINTS: [(&str, &str); 3] = [
    ("l_hip_roll", "Fig. 3  left hip roll"),
    ("l_knee_pitch", "Fig. 4  left knee"),
    ("l_ankle_roll", "Fig. 5  left ankle roll"),
];

/// Figures 3 to 5.
pub(in super::super) fn joints(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let shown = scenarios(studio, SHORT)?;
    let rows = JOINTS.map(|(joint, title)| row(joint, title, &shown));
    let rows = rows.into_iter().collect::<Result<Vec<_>, _>>()?;
    let title = format!("Figs. 3-5  Torques and positions: {}", place_of(&shown));
    let remark = "Torques hold the robot still while it hangs from the foot that stands alone; with both feet on the ground \
                  such a tree has no meaning. The curves of the ankle's torque coincide: the tasks fix it.";
    Ok(Figure::new(title, rows)
        .with_remarks(vec![remark.to_owned()])
        .render()?)
}

fn row(joint: &str, title: &str, shown: &[Shown<'_>]) -> Result<PanelRow, Obstacle> {
    let mut torque = Panel::new(title, time_axis(), Axis::linear("torque (Nm)"));
    let mut position = Panel::new("", time_axis(), Axis::linear("angle (rad)"));
    for Shown { scenario, walked } in shown {
        let points = in_single_support(walked, &format!("torque_{joint}"))?;
        torque
            .curves
            .push(line(scenario.name, points, scenario.style, 1.8));
        let points = walked.over_time(joint)?;
        position
            .curves
            .push(line(scenario.name, points, scenario.style, 1.8));
    }
    for panel in [&mut torque, &mut position] {
        panel.bands = shown[0].walked.supports();
    }
    Ok(PanelRow::new(225.0, vec![torque, position]))
}
