//! The secondary objectives over time in the three scenarios.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Panel, time_axis};
use super::super::walked::line;
use super::super::{Obstacle, Studio};
use super::{SHORT, Shown, in_single_support, place_of, scenarios};

/// H_joint at all times and H_grav where it has a meaning.
pub(in super::super) fn objectives(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let shown = scenarios(studio, SHORT)?;
    let mut centring = Panel::new("eq. (12)", time_axis(), Axis::linear("H_joint (–)"));
    let mut gravity = Panel::new("eq. (13)", time_axis(), Axis::linear("H_grav (N²m²)"));
    for Shown { scenario, walked } in &shown {
        let points = walked.over_time("objective_joint-centring")?;
        centring
            .curves
            .push(line(scenario.name, points, scenario.style, 1.8));
        let points = in_single_support(walked, "objective_gravity-torque")?;
        gravity
            .curves
            .push(line(scenario.name, points, scenario.style, 1.8));
    }
    let rows = [centring, gravity].map(|mut panel| {
        panel.bands = shown[0].walked.supports();
        PanelRow::new(270.0, vec![panel])
    });
    let title = format!("Secondary objectives: {}", place_of(&shown));
    let remark = "H_grav = ½ Στ², of the robot hanging from the foot that stands alone. Its gain is on in that time only, with \
                  ramps of 0.3 s.";
    Ok(Figure::new(title, rows.to_vec())
        .with_remarks(vec![remark.to_owned()])
        .render()?)
}
