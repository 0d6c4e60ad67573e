//! Figures 11 and 12: projected centre of mass and zero-moment points over the support polygon.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Band, Level, Panel, time_axis};
use super::super::style::{BLACK, BLUE, Dash, PALE_GREEN, Style, VERMILLION};
use super::super::walked::{Walked, line, plain, walked};
use super::super::{Obstacle, Studio, over_time, place_of};
use super::PLACE;

/// Column prefix, name, style and width, from the undermost to the topmost.
const POINTS: [(&str, &str, Style, f64); 3] = [
    ("zmp", "ZMP of point masses", plain(VERMILLION, Dash::Solid), 1.3),
    ("cart_zmp", "ZMP of the cart", plain(BLUE, Dash::Long), 1.3),
    ("gcom", "GCoM", plain(BLACK, Dash::Solid), 2.0),
];

/// Figures 11 and 12.
pub(in super::super) fn balance(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let walked = walked(studio, PLACE)?;
    if walked.trace.column("gcom_x").is_none() {
        return Err(Obstacle::NoData("the trace has no balance columns".to_owned()));
    }
    let mut away = Panel::new("", time_axis(), Axis::linear("ZMP less GCoM (m)"));
    for (axis, dash, colour) in [("x", Dash::Solid, BLUE), ("y", Dash::Long, VERMILLION)] {
        let points = walked.difference(&format!("zmp_{axis}"), &format!("gcom_{axis}"));
        let name = format!("ZMP of point masses less GCoM, {axis}");
        away.curves
            .extend(points.map(|p| line(&name, p, plain(colour, dash), 1.5)));
    }
    away.bands = walked.supports();
    let mut margin = Panel::new("", time_axis(), Axis::linear("margin to the border (m)"));
    for (column, name, style, width) in POINTS {
        let points = over_time(&walked.trace, &format!("{column}_margin"));
        margin.curves.extend(points.map(|p| line(name, p, style, width)));
    }
    margin.bands = walked.supports();
    margin.levels.push(Level {
        name: "border of the support polygon".to_owned(),
        value: 0.0,
    });
    let panels = [
        extent("Fig. 11", "y", &walked),
        extent("Fig. 12", "x", &walked),
        away,
        margin,
    ];
    let rows = panels.map(|p| PanelRow::new(215.0, vec![p])).to_vec();
    let title = format!(
        "Figs. 11, 12  Balance: {}, {}",
        walked.run.label,
        place_of(&walked.run)
    );
    let remark = "Extent: of the polygon's bounding box. Margins: to the border of the polygon itself, positive inside.";
    Ok(Figure::new(title, rows)
        .with_remarks(vec![remark.to_owned()])
        .render()?)
}

/// All points along one axis, over the extent of the polygon.
fn extent(title: &str, axis: &str, walked: &Walked<'_>) -> Panel {
    let mut panel = Panel::new(title, time_axis(), Axis::linear(&format!("{axis} (m)")));
    let side = |side| over_time(&walked.trace, &format!("support_{axis}_{side}"));
    if let (Some(low), Some(high)) = (side("min"), side("max")) {
        panel.bands.push(Band {
            name: "extent of the support polygon".to_owned(),
            colour: PALE_GREEN,
            points: low.iter().zip(&high).map(|(l, h)| (l.0, l.1, h.1)).collect(),
        });
    }
    for (column, name, style, width) in POINTS {
        let points = over_time(&walked.trace, &format!("{column}_{axis}"));
        panel.curves.extend(points.map(|p| line(name, p, style, width)));
    }
    panel
}
