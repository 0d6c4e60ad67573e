//! A figure: a title, a legend above the panels, rows of panels, remarks below.

use super::axis::{Axis, FittedAxis, Scale, rough};
use super::sheet::{Anchor, Drawing, Point, Sheet, Stroke, Type, WIDTH, draw, key_width, text_width};
use super::style::{BLACK, Dash, GREY, Marker, PALE, Style};
use plotters::style::RGBColor;
use std::collections::BTreeSet;

const MARGIN: f64 = 12.0;
const TITLE_SIZE: f64 = 15.0;
const LABEL_SIZE: f64 = 12.0;
const TICK_SIZE: f64 = 11.0;
const LINE_HEIGHT: f64 = 20.0;
const LEGEND_LINE: f64 = 19.0;
/// Space of a panel for its title, its x ticks, its x label, and to the right of it.
const TOP: f64 = 22.0;
const BOTTOM_TICKS: f64 = 20.0;
const BOTTOM_LABEL: f64 = 18.0;
const RIGHT: f64 = 16.0;
const RIGHT_GAP: f64 = 6.0;
/// Markers on one curve: enough to follow it, too few to hide it.
const MARKERS_PER_CURVE: usize = 6;

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
    pub(super) value: f64,
    pub(super) text: String,
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

    fn is_empty(&self) -> bool {
        self.curves.iter().all(|c| c.points.is_empty()) && self.dots.is_empty()
    }

    fn values(&self, coordinate: fn(Point) -> f64) -> Vec<Vec<f64>> {
        let of_points = |c: &Curve| c.points.iter().map(|p| coordinate(*p)).collect();
        let mut values: Vec<Vec<f64>> = self.curves.iter().map(of_points).collect();
        values.extend(self.dots.iter().map(|d| vec![coordinate(d.at)]));
        values
    }

    fn fitted(&self) -> (FittedAxis, FittedAxis) {
        let mut vertical = self.values(|p| p.1);
        vertical.push(self.levels.iter().map(|l| l.value).collect());
        (self.x.fit(&self.values(|p| p.0), 8), self.y.fit(&vertical, 6))
    }
}

/// Panels side by side.
#[derive(Clone, Debug)]
pub(super) struct PanelRow {
    /// Height with title and labels.
    pub(super) height: f64,
    pub(super) panels: Vec<Panel>,
}

/// A whole figure.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    pub(super) title: String,
    pub(super) rows: Vec<PanelRow>,
    pub(super) remarks: Vec<String>,
    /// Legend entries that are not those of curves.
    pub(super) keys: Vec<(String, Style)>,
}

impl Figure {
    /// The SVG.
    ///
    /// # Errors
    /// The message of the backend.
    pub(super) fn render(&self) -> Result<String, String> {
        let legend = lay_out_legend(&self.legend());
        let legend_lines = legend.last().map_or(0.0, |l| l.0.1 / LEGEND_LINE + 1.0);
        let remarks = self.all_remarks();
        let top = MARGIN + LINE_HEIGHT + 6.0;
        let panels_top = top + legend_lines * LEGEND_LINE + 4.0;
        let panels_height: f64 = self.rows.iter().map(|r| r.height).sum();
        let height = panels_top + panels_height + remarks.len() as f64 * 16.0 + MARGIN;
        draw(height.ceil(), |sheet| {
            let title = Type {
                size: TITLE_SIZE,
                anchor: Anchor::Left,
                colour: BLACK,
            };
            sheet.text(&self.title, (MARGIN, MARGIN + LINE_HEIGHT / 2.0), title)?;
            for ((x, y), (name, style)) in &legend {
                sheet.key((*x, top + y + LEGEND_LINE / 2.0), name, *style)?;
            }
            let mut y = panels_top;
            for row in &self.rows {
                paint_row(sheet, row, y)?;
                y += row.height;
            }
            let look = Type {
                size: TICK_SIZE,
                anchor: Anchor::Left,
                colour: GREY,
            };
            for (index, remark) in remarks.iter().enumerate() {
                sheet.text(remark, (MARGIN, y + 8.0 + 16.0 * index as f64), look)?;
            }
            Ok(())
        })
    }

    fn legend(&self) -> Vec<(String, Style)> {
        let mut entries: Vec<(String, Style)> = Vec::new();
        for curve in self.rows.iter().flat_map(|r| &r.panels).flat_map(|p| &p.curves) {
            if !curve.name.is_empty() && entries.iter().all(|e| e.0 != curve.name) {
                entries.push((curve.name.clone(), curve.style));
            }
        }
        entries.extend(self.keys.iter().cloned());
        entries
    }

    fn all_remarks(&self) -> Vec<String> {
        let mut cuts = BTreeSet::new();
        for panel in self.rows.iter().flat_map(|r| &r.panels).filter(|p| !p.is_empty()) {
            let (x, y) = panel.fitted();
            for (axis, fitted) in [(&panel.x, x), (&panel.y, y)] {
                cuts.extend(fitted.cut_below.map(|c| (axis.label.clone(), rough(c))));
            }
        }
        let cuts = cuts
            .into_iter()
            .map(|(l, c)| format!("{l}: values below {c} are drawn at {c}."));
        let remarks = self.remarks.iter().flat_map(|r| wrapped(r));
        remarks.chain(cuts).collect()
    }
}

/// Breaks a remark into lines that fit the page.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if text_width(line, TICK_SIZE) + text_width(word, TICK_SIZE) < WIDTH - 40.0 => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Places of the legend entries from left to right, line by line.
fn lay_out_legend(entries: &[(String, Style)]) -> Vec<(Point, (String, Style))> {
    let (mut x, mut y) = (MARGIN, 0.0);
    let mut placed = Vec::new();
    for entry in entries {
        let width = key_width(&entry.0);
        if x + width > WIDTH - MARGIN && x > MARGIN {
            (x, y) = (MARGIN, y + LEGEND_LINE);
        }
        placed.push(((x, y), entry.clone()));
        x += width;
    }
    placed
}

fn paint_row(sheet: &Sheet<'_>, row: &PanelRow, top: f64) -> Drawing {
    let width = (WIDTH - MARGIN) / row.panels.len().max(1) as f64;
    for (index, panel) in row.panels.iter().enumerate() {
        let left = MARGIN / 2.0 + width * index as f64;
        Painter::new(sheet, panel, (left, top), (width - RIGHT_GAP, row.height)).paint()?;
    }
    Ok(())
}

/// A panel being painted: `left`…`right` and `top`…`bottom` bound its frame.
struct Painter<'a, 'b> {
    sheet: &'a Sheet<'b>,
    panel: &'a Panel,
    x: FittedAxis,
    y: FittedAxis,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl<'a, 'b> Painter<'a, 'b> {
    fn new(sheet: &'a Sheet<'b>, panel: &'a Panel, corner: Point, size: Point) -> Self {
        let (x, y) = panel.fitted();
        let ticks = y
            .ticks
            .iter()
            .map(|t| text_width(&t.1, TICK_SIZE))
            .fold(0.0, f64::max);
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
        Self {
            sheet,
            panel,
            x,
            y,
            left: corner.0 + label + ticks.max(34.0) + 8.0,
            right: corner.0 + size.0 - RIGHT,
            top: corner.1 + TOP,
            bottom: corner.1 + size.1 - below,
        }
    }

    fn paint(&self) -> Drawing {
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
        let ticks = self
            .y
            .ticks
            .iter()
            .map(|t| text_width(&t.1, TICK_SIZE))
            .fold(34.0, f64::max);
        let beside = self.left - ticks - 8.0 - LABEL_SIZE / 2.0;
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

    fn level(&self, level: &Level) -> Drawing {
        let y = self.at_y(level.value);
        let stroke = Stroke {
            colour: BLACK,
            width: 1.0,
            dash: Dash::Short,
        };
        self.sheet.line(&[(self.left, y), (self.right, y)], stroke)?;
        // Above the line unless that leaves the panel.
        let text_y = if y - 8.0 > self.top + 6.0 {
            y - 8.0
        } else {
            y + 8.0
        };
        self.sheet.text(
            &level.text,
            (self.left + 5.0, text_y),
            self.look(Anchor::Left, BLACK),
        )
    }

    fn curve(&self, curve: &Curve) -> Drawing {
        let stroke = Stroke {
            colour: curve.style.colour,
            width: curve.width,
            dash: curve.style.dash,
        };
        let is_finite = |p: &Point| p.0.is_finite() && p.1.is_finite();
        for piece in curve.points.split(|p| !is_finite(p)) {
            let points: Vec<Point> = piece.iter().map(|p| self.at(*p)).collect();
            if points.len() > 1 {
                self.sheet.line(&points, stroke)?;
            }
        }
        for index in marked(curve).into_iter().filter(|i| is_finite(&curve.points[*i])) {
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

/// An axis of time.
pub(super) fn time_axis() -> Axis {
    Axis::new("time (s)", Scale::Linear)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legend_wraps_inside_the_page() {
        let style = Style {
            colour: BLACK,
            dash: Dash::Solid,
            marker: Marker::Circle,
        };
        let entries: Vec<(String, Style)> = (0..30).map(|i| (format!("method-{i}"), style)).collect();
        let placed = lay_out_legend(&entries);
        assert!(
            placed.iter().all(|((x, _), e)| x + key_width(&e.0) <= WIDTH),
            "an entry leaves the page"
        );
        assert!(placed.last().unwrap().0.1 >= 2.0 * LEGEND_LINE, "{placed:?}");
    }

    #[test]
    fn long_remarks_are_broken() {
        let lines = wrapped(&"word ".repeat(100));
        assert!(
            lines.len() > 2 && lines.iter().all(|l| text_width(l, TICK_SIZE) < WIDTH),
            "{lines:?}"
        );
    }
}
