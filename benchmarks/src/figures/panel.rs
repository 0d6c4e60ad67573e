//! A panel: one coordinate system and what it shows.

use super::axis::{Axis, FittedAxis, Scale};
use super::sheet::{Key, Point, Shows, text_width};
use super::style::{Dash, GREY, Marker, Style};
use plotters::style::RGBColor;

/// Font size of ticks and remarks.
pub(super) const TICK_SIZE: f64 = 11.0;
/// Room for a tick of an x axis, with a sign and two decimals.
const TICK_ROOM: f64 = 42.0;

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

/// A filled area below all curves: between two ordinates, or over the whole height where they are infinite.
#[derive(Clone, Debug)]
pub(super) struct Band {
    /// Entry in the legend.
    pub(super) name: String,
    pub(super) colour: RGBColor,
    /// Abscissa, lower and upper ordinate.
    pub(super) points: Vec<(f64, f64, f64)>,
}

/// How the scales of the two axes are related.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Aspect {
    Free,
    /// One unit is as long on either axis: the one that has room to spare shows more than its range.
    Equal,
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
    pub(super) aspect: Aspect,
    pub(super) bands: Vec<Band>,
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
            aspect: Aspect::Free,
            bands: Vec::new(),
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
        let of_band = |b: &Band| b.points.iter().flat_map(|p| [p.1, p.2]).collect();
        values.extend(self.bands.iter().map(of_band));
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

    /// Curves with values above or below the panel, and the largest of these in size.
    pub(super) fn leaving(&self) -> Vec<(&str, f64)> {
        let (low, high) = self.fitted().1.shown();
        let is_outside = |v: &f64| v.is_finite() && !(low..=high).contains(v);
        let farthest = |curve: &Curve| {
            let outside = curve.points.iter().map(|p| p.1).filter(is_outside);
            outside.max_by(|a, b| a.abs().total_cmp(&b.abs()))
        };
        let curves = self.curves.iter();
        curves
            .filter_map(|curve| Some((curve.name.as_str(), farthest(curve)?)))
            .collect()
    }

    /// The axes in a frame of this size, as the aspect asks.
    pub(super) fn fitted_to(&self, width: f64, height: f64) -> (FittedAxis, FittedAxis) {
        let (x, y) = self.fitted();
        if self.aspect == Aspect::Free {
            return (x, y);
        }
        let unit = f64::max((x.high - x.low) / width, (y.high - y.low) / height);
        let around = |axis: &Axis, fitted: &FittedAxis, length: f64, ticks: usize| {
            let (middle, half) = ((fitted.low + fitted.high) / 2.0, unit * length / 2.0);
            let widened = axis.clone().with_range(middle - half, middle + half);
            widened.fit(&[], ticks)
        };
        let fitting = ((width / TICK_ROOM) as usize).clamp(2, 8);
        (
            around(&self.x, &x, width, fitting),
            around(&self.y, &y, height, 6),
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

impl Band {
    pub(super) fn key(&self) -> Key {
        let style = Style {
            colour: self.colour,
            ..LEVEL
        };
        Key {
            name: self.name.clone(),
            style,
            shows: Shows::Area,
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
    let range = common_y(panels);
    panels.iter_mut().for_each(|panel| panel.y.range = range);
}

/// The vertical range of all data of some panels.
pub(super) fn common_y(panels: &[Panel]) -> Option<(f64, f64)> {
    let values: Vec<Vec<f64>> = panels.iter().flat_map(Panel::vertical_values).collect();
    let common = panels.first()?.y.fit(&values, 6);
    Some((common.low, common.high))
}

/// The parts of a line between two ordinates, cut where it crosses them. Two points that are both outside, or farther apart
/// than the ordinates, are not joined: what leaps back and forth would fill the panel with upright lines.
pub(super) fn between(points: &[Point], (low, high): (f64, f64)) -> Vec<Vec<Point>> {
    let is_inside = |p: Point| (low..=high).contains(&p.1);
    let mut parts: Vec<Vec<Point>> = Vec::new();
    let mut goes_on = false;
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let is_joined = (is_inside(a) || is_inside(b)) && (b.1 - a.1).abs() <= high - low;
        let cut = |p: Point| {
            let y = p.1.clamp(low, high);
            let x = || a.0 + (b.0 - a.0) * (y - a.1) / (b.1 - a.1);
            if is_inside(p) { p } else { (x(), y) }
        };
        match parts.last_mut().filter(|_| goes_on) {
            _ if !is_joined => (),
            Some(part) => part.push(cut(b)),
            None => parts.push(vec![cut(a), cut(b)]),
        }
        goes_on = is_joined && is_inside(b);
    }
    parts
}

/// An axis of time.
pub(super) fn time_axis() -> Axis {
    Axis::new("time (s)", Scale::Linear)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_cut_where_they_leave_the_panel() {
        let zigzag = [
            (0.0, 0.5),
            (1.0, 1.5),
            (2.0, -0.5),
            (3.0, -1.0),
            (4.0, -0.5),
            (5.0, 0.5),
            (6.0, 0.0),
            (7.0, 9.0),
            (8.0, 0.5),
        ];
        let parts = between(&zigzag, (0.0, 1.0));
        let expected = [
            vec![(0.0, 0.5), (0.5, 1.0)],
            vec![(4.5, 0.0), (5.0, 0.5), (6.0, 0.0)],
        ];
        assert_eq!(parts, expected);
        let all = between(&zigzag, (f64::NEG_INFINITY, f64::INFINITY));
        assert_eq!(all, [zigzag.to_vec()]);
    }

    #[test]
    fn equal_aspect_widens_one_axis_about_its_middle() {
        let mut panel = Panel::new(
            "",
            Axis::linear("x").with_range(0.0, 2.0),
            Axis::linear("y").with_range(0.0, 1.0),
        );
        let range = |f: FittedAxis| (f.low, f.high);
        let (x, y) = panel.fitted_to(800.0, 100.0);
        assert_eq!((range(x), range(y)), ((0.0, 2.0), (0.0, 1.0)));
        panel.aspect = Aspect::Equal;
        let (x, y) = panel.fitted_to(800.0, 100.0);
        assert_eq!((range(x), range(y)), ((-3.0, 5.0), (0.0, 1.0)));
        let (x, y) = panel.fitted_to(100.0, 100.0);
        assert_eq!((range(x), range(y)), ((0.0, 2.0), (-0.5, 1.5)));
    }
}
