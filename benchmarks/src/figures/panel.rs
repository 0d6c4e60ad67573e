//! A panel: one coordinate system and what it shows.

use super::axis::{Axis, FittedAxis, Scale};
use super::sheet::{Key, Point, Shows, text_width};
use super::style::{Dash, GREY, Marker, Style};
use plotters::style::RGBColor;

/// Font size of ticks and remarks.
pub(super) const TICK_SIZE: f64 = 11.0;

/// A line over the panel.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    /// Entry in the legend; equal names share one entry.
    pub(super) name: String,
    pub(super) points: Vec<Point>,
    pub(super) style: Style,
    pub(super) width: f64,
    /// Without markers for references and boundaries.
    pub(super) markers: Markers,
}

/// Where a curve has markers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Markers {
    None,
    /// A few; curves of different rank have them at different places.
    Sparse {
        rank: usize,
    },
    /// At every point.
    Every,
}

/// A marker by itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dot {
    pub(super) at: Point,
    pub(super) colour: RGBColor,
    pub(super) marker: Marker,
    pub(super) radius: f64,
}

/// A horizontal line at a value, e.g. a limit.
#[derive(Clone, Debug)]
pub(super) struct Level {
    /// Entry in the legend.
    pub(super) name: String,
    pub(super) value: f64,
}

/// A text in the panel, beginning at a place given in values.
#[derive(Clone, Debug)]
pub(super) struct Remark {
    pub(super) at: Point,
    pub(super) text: String,
}

/// One coordinate system with what it shows.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub(super) title: String,
    pub(super) x: Axis,
    pub(super) y: Axis,
    pub(super) curves: Vec<Curve>,
    pub(super) dots: Vec<Dot>,
    pub(super) levels: Vec<Level>,
    pub(super) remarks: Vec<Remark>,
}

impl Panel {
    pub(super) fn new(title: &str, x: Axis, y: Axis) -> Self {
        let (curves, dots, levels, remarks) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self {
            title: title.to_owned(),
            x,
            y,
            curves,
            dots,
            levels,
            remarks,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.curves.iter().all(|c| c.points.is_empty()) && self.dots.is_empty()
    }

    fn values(&self, coordinate: fn(Point) -> f64) -> Vec<Vec<f64>> {
        let of_points = |c: &Curve| c.points.iter().map(|p| coordinate(*p)).collect();
        let mut values: Vec<Vec<f64>> = self.curves.iter().map(of_points).collect();
        values.extend(self.dots.iter().map(|d| vec![coordinate(d.at)]));
        values
    }

    fn vertical_values(&self) -> Vec<Vec<f64>> {
        let mut values = self.values(|p| p.1);
        values.push(self.levels.iter().map(|l| l.value).collect());
        values
    }

    pub(super) fn tick_width(&self) -> f64 {
        let ticks = self.fitted().1.ticks;
        ticks
            .iter()
            .map(|t| text_width(&t.1, TICK_SIZE))
            .fold(0.0, f64::max)
    }

    pub(super) fn fitted(&self) -> (FittedAxis, FittedAxis) {
        (
            self.x.fit(&self.values(|p| p.0), 8),
            self.y.fit(&self.vertical_values(), 6),
        )
    }
}

/// Look of a level; its marker is never shown.
pub(super) const LEVEL: Style = Style {
    colour: GREY,
    dash: Dash::Solid,
    marker: Marker::Plus,
};

impl Curve {
    pub(super) fn key(&self) -> Key {
        let shows = if self.markers == Markers::None {
            Shows::Line
        } else {
            Shows::Both
        };
        Key {
            name: self.name.clone(),
            style: self.style,
            shows,
        }
    }
}

impl Level {
    pub(super) fn key(&self) -> Key {
        Key {
            name: self.name.clone(),
            style: LEVEL,
            shows: Shows::Line,
        }
    }
}

/// Gives all panels the vertical range of all their data, so that they can be compared.
pub(super) fn share_y(panels: &mut [Panel]) {
    let Some(first) = panels.first() else { return };
    let values: Vec<Vec<f64>> = panels.iter().flat_map(Panel::vertical_values).collect();
    let common = first.y.fit(&values, 6);
    for panel in panels {
        panel.y.range = Some((common.low, common.high));
    }
}

/// An axis of time.
pub(super) fn time_axis() -> Axis {
    Axis::new("time (s)", Scale::Linear)
}
