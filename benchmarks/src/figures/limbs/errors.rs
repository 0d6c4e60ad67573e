//! Histogram of pose errors.

use super::super::Obstacle;
use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Curve, Markers, Panel, share_y};
use super::super::style::{BLACK, Dash, Marker, Style};
use super::{Limbs, family};
use crate::limbs::{Findings, GridFindings, LimbRow};
use std::collections::BTreeMap;

/// Decades shown; the first also holds errors below it, and zeros.
const DECADES: (i32, i32) = (-18, -6);
const CRITERION: Style = Style {
    colour: BLACK,
    dash: Dash::Short,
    marker: Marker::Cross,
};

pub(super) fn errors(limbs: &Limbs<'_>) -> Result<String, Obstacle> {
    let grids = limbs.found(|found| match found {
        Findings::Grid(grid) => Some(grid),
        _ => None,
    });
    if grids.is_empty() {
        return Err(Obstacle::NoData("no rows of closed-form/grid".to_owned()));
    }
    let (on, off): (Vec<_>, Vec<_>) = grids
        .into_iter()
        .partition(|(row, _)| row.set.starts_with("on-axis"));
    let mut panels = vec![
        panel("random joints and grid beside the axes", &off, 1e-10),
        panel("grids on the axes, mostly singular", &on, 2e-7),
    ];
    share_y(&mut panels);
    let title = "Pose error FK(IK(T)) − T of all solutions".to_owned();
    let remarks = vec![
        "Error: the larger of distance (m) and rotation (rad). Solutions are counted by the decade of their error: a mark \
         stands in the middle of its decade, and on the lower edge of the panel if no solution is in that decade. The lowest \
         decade also holds what is smaller, zeros among it."
            .to_owned(),
    ];
    let figure = Figure::new(title, vec![PanelRow::new(330.0, panels)]).with_remarks(remarks);
    Ok(figure.render()?)
}

fn panel(title: &str, rows: &[(&LimbRow, &GridFindings)], criterion: f64) -> Panel {
    let mut sums: BTreeMap<String, (Style, BTreeMap<i32, u64>)> = BTreeMap::new();
    for (row, found) in rows {
        let (name, style) = family(row);
        let sum = &mut sums.entry(name).or_insert((style, BTreeMap::new())).1;
        for (decade, count) in &found.error_decades {
            *sum.entry((*decade).clamp(DECADES.0, DECADES.1 - 1)).or_default() += count;
        }
    }
    let x = Axis::log("pose error (m or rad)").with_range(10_f64.powi(DECADES.0), 10_f64.powi(DECADES.1));
    let y = Axis::log("share of the solutions").with_range(1e-7, 1.5);
    let mut panel = Panel::new(title, x, y);
    for (name, (style, decades)) in sums {
        let (Some(&first), Some(&last)) = (decades.keys().min(), decades.keys().max()) else {
            continue;
        };
        let all: u64 = decades.values().sum();
        let share = |decade: i32| {
            let count = decades.get(&decade).copied().unwrap_or(0);
            (10_f64.powf(f64::from(decade) + 0.5), count as f64 / all as f64)
        };
        panel.curves.push(Curve {
            name,
            points: (first..=last).map(share).collect(),
            style,
            width: 1.6,
            markers: Markers::Every,
        });
    }
    panel.curves.push(Curve {
        name: "largest error allowed".to_owned(),
        points: vec![(criterion, 1e-7), (criterion, 1.5)],
        style: CRITERION,
        width: 1.4,
        markers: Markers::None,
    });
    panel
}
