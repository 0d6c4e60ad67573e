//! Figure 9: the pose before the first step and the one after the last of thirty.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Aspect, Level, Panel};
use super::super::skeleton::View;
use super::super::style::{Dash, PURPLE, Style};
use super::super::walked::plain;
use super::super::{Obstacle, Studio};
use super::{LONG, Shown, place_of, scenarios};

const BEFORE: Style = plain(PURPLE, Dash::Solid);

/// Figure 9.
pub(in super::super) fn poses(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let mut shown = scenarios(studio, LONG)?;
    shown.retain(|one| one.scenario.id != "S3");
    let rows = shown
        .iter()
        .map(|one| {
            let panels = [(View::Side, "from the right"), (View::Front, "from the front")]
                .map(|(view, from)| panel(one, view, from));
            panels
                .into_iter()
                .collect::<Result<Vec<_>, _>>()
                .map(|panels| PanelRow::new(330.0, panels))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let title = format!("Fig. 9  Start and pose after 30 steps: {}", place_of(&shown));
    let remark =
        "From the right, the last pose is moved back by the way the feet went. Both axes have one scale.";
    Ok(Figure::new(title, rows)
        .with_remarks(vec![remark.to_owned()])
        .render()?)
}

fn panel(one: &Shown<'_>, view: View, from: &str) -> Result<Panel, Obstacle> {
    let Shown { scenario, walked } = one;
    let robot = walked.case.problem.robot();
    let skeleton = walked.skeleton();
    let across = if view == View::Side { "x (m)" } else { "y (m)" };
    let title = format!("{}, {from}", scenario.name);
    let mut panel = Panel::new(&title, Axis::linear(across), Axis::linear("z (m)"));
    let x = walked.over_time("right-foot_target_x")?;
    let (Some(first), Some(last)) = (walked.q.first(), walked.q.last()) else {
        return Err(Obstacle::NoData("the trace is empty".to_owned()));
    };
    let went_m = x[x.len() - 1].1 - x[0].1;
    let back_m = if view == View::Side { -went_m } else { 0.0 };
    let mut before = skeleton.curves(robot, first, view, 0.0);
    for curve in &mut before {
        curve.name = "before the first step".to_owned();
        (curve.style, curve.width) = (BEFORE, 5.0);
    }
    panel.curves = before;
    panel.curves.extend(skeleton.curves(robot, last, view, back_m));
    panel.aspect = Aspect::Equal;
    panel.levels.push(Level {
        name: "floor".to_owned(),
        value: 0.0,
    });
    Ok(panel)
}
