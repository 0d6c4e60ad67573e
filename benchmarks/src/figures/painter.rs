//! Painting of one panel: frame, grid, ticks, labels, and what it shows.

use super::axis::FittedAxis;
use super::panel::{Band, Curve, LEVEL, Level, Markers, Panel, TICK_SIZE, between};
use super::sheet::{Anchor, Drawing, Point, Sheet, Stroke, Type};
use super::style::{BLACK, Dash, GREY, PALE};
use plotters::style::RGBColor;

const LABEL_SIZE: f64 = 12.0;
/// Space of a panel for its title, its x ticks, its x label, and to the right of it.
const TOP: f64 = 22.0;
const BOTTOM_TICKS: f64 = 20.0;
const BOTTOM_LABEL: f64 = 18.0;
const RIGHT: f64 = 16.0;
/// Markers on one curve: enough to follow it, too few to hide it.
const MARKERS_PER_CURVE: usize = 6;

/// A panel being painted: `left`…`right` and `top`…`bottom` bound its frame.
pub(super) struct Painter<'a, 'b> {
    sheet: &'a Sheet<'b>,
    panel: &'a Panel,
    x: FittedAxis,
    y: FittedAxis,
    gutter: f64,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl<'a, 'b> Painter<'a, 'b> {
    pub(super) fn new(
        sheet: &'a Sheet<'b>,
        panel: &'a Panel,
        corner: Point,
        size: Point,
        gutter: f64,
    ) -> Self {
        let label = if panel.y.label.is_empty() {
            0.0
        } else {
            LABEL_SIZE + 8.0
        };
        let below = BOTTOM_TICKS
            + if panel.x.label.is_empty() {
                4.0
            } else {
                BOTTOM_LABEL
            };
        let (left, right) = (corner.0 + label + gutter + 8.0, corner.0 + size.0 - RIGHT);
        let (top, bottom) = (corner.1 + TOP, corner.1 + size.1 - below);
        let (x, y) = panel.fitted_to(right - left, bottom - top);
        Self {
            sheet,
            panel,
            x,
            y,
            gutter,
            left,
            right,
            top,
            bottom,
        }
    }

    pub(super) fn paint(&self) -> Drawing {
        for band in &self.panel.bands {
            self.band(band)?;
        }
        self.grid()?;
        self.labels()?;
        if self.panel.is_empty() {
            let middle = ((self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0);
            return self
                .sheet
                .text("no data", middle, self.look(Anchor::Centre, GREY));
        }
        for level in &self.panel.levels {
            self.level(level)?;
        }
        for curve in &self.panel.curves {
            self.curve(curve)?;
        }
        for dot in &self.panel.dots {
            self.sheet
                .marker(self.at(dot.at), dot.radius, dot.colour, dot.marker)?;
        }
        for remark in &self.panel.remarks {
            self.sheet
                .text(&remark.text, self.at(remark.at), self.look(Anchor::Left, BLACK))?;
        }
        Ok(())
    }

    fn look(&self, anchor: Anchor, colour: RGBColor) -> Type {
        Type {
            size: TICK_SIZE,
            anchor,
            colour,
        }
    }

    fn at(&self, (x, y): Point) -> Point {
        (self.at_x(x), self.at_y(y))
    }

    fn at_x(&self, value: f64) -> f64 {
        self.left + (self.right - self.left) * self.x.place(value)
    }

    fn at_y(&self, value: f64) -> f64 {
        self.bottom - (self.bottom - self.top) * self.y.place(value)
    }

    fn grid(&self) -> Drawing {
        let thin = Stroke {
            colour: PALE,
            width: 0.7,
            dash: Dash::Solid,
        };
        for (value, text) in &self.x.ticks {
            let x = self.at_x(*value);
            self.sheet.line(&[(x, self.top), (x, self.bottom)], thin)?;
            self.sheet
                .text(text, (x, self.bottom + 10.0), self.look(Anchor::Centre, BLACK))?;
        }
        for (value, text) in &self.y.ticks {
            let y = self.at_y(*value);
            self.sheet.line(&[(self.left, y), (self.right, y)], thin)?;
            self.sheet
                .text(text, (self.left - 5.0, y), self.look(Anchor::Right, BLACK))?;
        }
        self.sheet
            .frame((self.left, self.top), (self.right, self.bottom), GREY)
    }

    fn labels(&self) -> Drawing {
        let look = |anchor| Type {
            size: LABEL_SIZE,
            anchor,
            colour: BLACK,
        };
        let middle = (self.left + self.right) / 2.0;
        let beside = self.left - self.gutter - 8.0 - LABEL_SIZE / 2.0;
        self.sheet
            .text(&self.panel.title, (middle, self.top - 11.0), look(Anchor::Centre))?;
        self.sheet.text(
            &self.panel.x.label,
            (middle, self.bottom + 27.0),
            look(Anchor::Centre),
        )?;
        self.sheet.text(
            &self.panel.y.label,
            (beside, (self.top + self.bottom) / 2.0),
            look(Anchor::Upwards),
        )
    }

    fn band(&self, band: &Band) -> Drawing {
        // False also where one of them is not a number.
        let there = band.points.iter().filter(|(_, low, high)| low <= high);
        let upper = there.clone().map(|p| self.at((p.0, p.2)));
        let lower = there.rev().map(|p| self.at((p.0, p.1)));
        self.sheet
            .area(&upper.chain(lower).collect::<Vec<_>>(), band.colour)
    }

    fn level(&self, level: &Level) -> Drawing {
        let y = self.at_y(level.value);
        let stroke = Stroke {
            colour: LEVEL.colour,
            width: 1.3,
            dash: LEVEL.dash,
        };
        self.sheet.line(&[(self.left, y), (self.right, y)], stroke)
    }

    fn curve(&self, curve: &Curve) -> Drawing {
        let stroke = Stroke {
            colour: curve.style.colour,
            width: curve.width,
            dash: curve.style.dash,
        };
        let (low, high) = self.y.shown();
        let is_finite = |p: &Point| p.0.is_finite() && p.1.is_finite();
        for piece in curve.points.split(|p| !is_finite(p)) {
            for part in between(piece, (low, high)) {
                let points: Vec<Point> = part.iter().map(|p| self.at(*p)).collect();
                self.sheet.line(&points, stroke)?;
            }
        }
        let is_shown = |p: &Point| is_finite(p) && (low..=high).contains(&p.1);
        for index in marked(curve).into_iter().filter(|i| is_shown(&curve.points[*i])) {
            let at = self.at(curve.points[index]);
            self.sheet
                .marker(at, 3.2, curve.style.colour, curve.style.marker)?;
        }
        Ok(())
    }
}

/// Indices of the points with a marker.
fn marked(curve: &Curve) -> Vec<usize> {
    let count = curve.points.len();
    match curve.markers {
        Markers::None => Vec::new(),
        Markers::Every => (0..count).collect(),
        Markers::Sparse { .. } if count <= MARKERS_PER_CURVE => (0..count).collect(),
        Markers::Sparse { rank } => {
            let stride = count / MARKERS_PER_CURVE;
            // Golden-section offsets: any few ranks in a row are well apart.
            let offset = ((rank as f64 * 0.618_034).fract() * stride as f64) as usize;
            (offset..count).step_by(stride).collect()
        }
    }
}
