//! The zero-moment point: its reference, where it was, and the centre of mass that put it there.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Band, Level, Panel, time_axis};
use super::super::style::{BLACK, BLUE, Dash, ORANGE, PALE_GREEN, Style, VERMILLION};
use super::super::walked::{Place, Walked, line, plain, walked};
use super::super::{Obstacle, Studio, place_of};
use super::{METHOD, SHORT};

/// Column prefix, name, style and width, from the undermost to the topmost.
const POINTS: [(&str, &str, Style, f64); 4] = [
    ("zmp", "ZMP of point masses", plain(VERMILLION, Dash::Solid), 1.4),
    ("cart_zmp", "ZMP of the cart", plain(BLUE, Dash::Solid), 1.8),
    ("zmp_reference", "reference", plain(BLACK, Dash::Short), 1.2),
    ("gcom", "centre of mass", plain(ORANGE, Dash::Long), 2.2),
];

/// Melson with both objectives, which change nothing in it.
pub(in super::super) fn melson(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    zmp(studio, SHORT, "S3")
}

/// Hubo.
pub(in super::super) fn hubo(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    zmp(studio, "walk/hubo", "walk")
}

fn zmp(studio: &mut Studio<'_>, suite: &'static str, scenario: &'static str) -> Result<String, Obstacle> {
    let place = Place {
        suite,
        scenario,
        method: METHOD,
    };
    let walked = walked(studio, place)?;
    let panels = [
        along("x", &walked)?,
        along("y", &walked)?,
        error(&walked)?,
        margin(&walked)?,
    ];
    let rows = panels.map(|panel| PanelRow::new(215.0, vec![panel]));
    let title = format!(
        "Zero-moment point: {}, {}",
        walked.run.label,
        place_of(&walked.run)
    );
    let remark = "Extent: of the polygon's bounding box. Margins: to the border of the polygon itself, positive inside; counted \
                  from 0.2 s on.";
    Ok(Figure::new(title, rows.to_vec())
        .with_remarks(vec![remark.to_owned()])
        .render()?)
}

/// All points along one axis, over the extent of the polygon.
fn along(axis: &str, walked: &Walked<'_>) -> Result<Panel, Obstacle> {
    let mut panel = Panel::new("", time_axis(), Axis::linear(&format!("{axis} (m)")));
    let low = walked.over_time(&format!("support_{axis}_min"))?;
    let high = walked.over_time(&format!("support_{axis}_max"))?;
    panel.bands.push(Band {
        name: "extent of the support polygon".to_owned(),
        colour: PALE_GREEN,
        points: low.iter().zip(&high).map(|(l, h)| (l.0, l.1, h.1)).collect(),
    });
    for (column, name, style, width) in POINTS {
        let points = walked.over_time(&format!("{column}_{axis}"))?;
        panel.curves.push(line(name, points, style, width));
    }
    Ok(panel)
}

/// How far both zero-moment points are from their reference.
fn error(walked: &Walked<'_>) -> Result<Panel, Obstacle> {
    let mut panel = Panel::new("", time_axis(), Axis::linear("off the reference (m)"));
    for (column, name, style, width) in &POINTS[..2] {
        let off = |axis: &str| {
            let (point, reference) = (format!("{column}_{axis}"), format!("zmp_reference_{axis}"));
            walked
                .difference(&point, &reference)
                .ok_or_else(|| Obstacle::NoData(format!("the trace has no columns {point}, {reference}")))
        };
        let (x, y) = (off("x")?, off("y")?);
        let norm = x.into_iter().zip(y).map(|((t, x), (_, y))| (t, x.hypot(y)));
        panel.curves.push(line(name, norm.collect(), *style, *width));
    }
    panel.bands = walked.supports();
    Ok(panel)
}

fn margin(walked: &Walked<'_>) -> Result<Panel, Obstacle> {
    let mut panel = Panel::new("", time_axis(), Axis::linear("margin to the border (m)"));
    for (column, name, style, width) in [POINTS[0], POINTS[3]] {
        let points = walked.over_time(&format!("{column}_margin"))?;
        panel.curves.push(line(name, points, style, width));
    }
    panel.bands = walked.supports();
    panel.levels.push(Level {
        name: "border of the support polygon".to_owned(),
        value: 0.0,
    });
    Ok(panel)
}
