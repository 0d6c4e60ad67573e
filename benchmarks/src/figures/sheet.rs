//! A drawing surface: lines, shapes and text in points of a page 1000 wide.
//!
//! plotters rounds to whole pixels, so the surface is drawn larger by [`FINENESS`] and shown at the size of the page.

use super::style::{BLACK, Dash, Marker, Style, WHITE};
use plotters::coord::Shift;
use plotters::element::{DashedPathElement, Drawable, PointCollection};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Width of every figure.
pub(super) const WIDTH: f64 = 1000.0;
/// Drawn pixels per point of the page.
const FINENESS: i32 = 2;
/// plotters writes a font size divided by this (its pixel-per-em assumption in the SVG backend).
const FONT_FACTOR: f64 = 1.24;
/// Width of a character as a part of the font size: that of wide sans-serif fonts, so that text never exceeds it.
const CHARACTER_WIDTH: f64 = 0.62;

/// A point of the page: right, down.
pub(super) type Point = (f64, f64);

/// Where a text stands relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Left,
    Centre,
    Right,
    /// Centred, reading upwards.
    Upwards,
}

/// Look of a text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Type {
    pub(super) size: f64,
    pub(super) anchor: Anchor,
    pub(super) colour: RGBColor,
}

/// Width and colour of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    pub(super) colour: RGBColor,
    pub(super) width: f64,
    pub(super) dash: Dash,
}

/// A legend entry.
#[derive(Clone, Debug)]
pub(super) struct Key {
    pub(super) name: String,
    pub(super) style: Style,
    pub(super) shows: Shows,
}

/// What of a style a legend entry shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shows {
    Line,
    Marker,
    Both,
    /// A filled area of its colour.
    Area,
}

/// Estimated width of a text.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    CHARACTER_WIDTH * size * text.chars().count() as f64
}

/// The surface.
pub(super) struct Sheet<'a> {
    area: DrawingArea<SVGBackend<'a>, Shift>,
}

impl std::fmt::Debug for Sheet<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sheet").finish_non_exhaustive()
    }
}

/// Result of drawing; the message is that of the backend.
pub(super) type Drawing = Result<(), String>;

/// Makes an SVG of the given height by a drawing function.
pub(super) fn draw(height: f64, paint: impl FnOnce(&Sheet<'_>) -> Drawing) -> Result<String, String> {
    let (width_px, height_px) = (pixels(WIDTH) as u32, pixels(height) as u32);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (width_px, height_px)).into_drawing_area();
        area.fill(&WHITE).map_err(message)?;
        let sheet = Sheet { area };
        paint(&sheet)?;
        sheet.area.present().map_err(message)?;
    }
    let drawn = format!("<svg width=\"{width_px}\" height=\"{height_px}\"");
    let shown = format!("<svg width=\"{WIDTH}\" height=\"{height}\"");
    Ok(compact(&svg.replacen(&drawn, &shown, 1)))
}

/// The same drawing in fewer bytes: consecutive polylines of one look, such as the dashes of a curve, become one path,
/// and attributes at their default go.
fn compact(svg: &str) -> String {
    let mut result = String::with_capacity(svg.len());
    let mut path_look: Option<&str> = None;
    for line in svg.lines() {
        let polyline = line
            .strip_prefix("<polyline ")
            .and_then(|l| l.split_once("points=\""));
        let look = polyline.map(|p| p.0);
        if look != path_look || look.is_none() {
            result.push_str(if path_look.is_some() { "\"/>\n" } else { "" });
            path_look = look;
            result.push_str(&look.map_or(line.to_owned() + "\n", |l| format!("<path {l}d=\"")));
        }
        if let Some((_, points)) = polyline {
            // In a path, points after a moveto are linetos.
            result.push('M');
            result.push_str(points.trim_end_matches("\"/>").trim_end());
        }
    }
    result
        .replace(" opacity=\"1\"", "")
        .replace(" stroke=\"none\" stroke-width=\"1\"", "")
}

fn pixels(length: f64) -> i32 {
    (length * f64::from(FINENESS)).round() as i32
}

fn pixel((x, y): Point) -> (i32, i32) {
    (pixels(x), pixels(y))
}

fn message(error: impl std::fmt::Display) -> String {
    error.to_string()
}

impl Sheet<'_> {
    fn put<E>(&self, element: E) -> Drawing
    where
        for<'e> &'e E: PointCollection<'e, (i32, i32)>,
        E: for<'b> Drawable<SVGBackend<'b>>,
    {
        self.area.draw(&element).map_err(message)
    }

    /// A line through the points.
    pub(super) fn line(&self, points: &[Point], stroke: Stroke) -> Drawing {
        let path = without_needless(points.iter().map(|p| pixel(*p)));
        let look = stroke.colour.stroke_width(pixels(stroke.width).max(1) as u32);
        let (dash, gap) = match stroke.dash {
            Dash::Solid => return self.put(PathElement::new(path, look)),
            Dash::Long => (9.0, 4.0),
            Dash::Short => (5.0, 3.0),
            Dash::Dotted => (1.7, 2.3),
        };
        self.put(DashedPathElement::new(path, pixels(dash), pixels(gap), look))
    }

    /// A filled rectangle.
    pub(super) fn fill(&self, corner: Point, opposite: Point, colour: RGBColor) -> Drawing {
        self.put(Rectangle::new([pixel(corner), pixel(opposite)], colour.filled()))
    }

    /// A filled polygon.
    pub(super) fn area(&self, corners: &[Point], colour: RGBColor) -> Drawing {
        let corners = without_needless(corners.iter().map(|p| pixel(*p)));
        self.put(Polygon::new(corners, colour.filled()))
    }

    /// The outline of a rectangle.
    pub(super) fn frame(&self, corner: Point, opposite: Point, colour: RGBColor) -> Drawing {
        self.put(Rectangle::new(
            [pixel(corner), pixel(opposite)],
            colour.stroke_width(FINENESS as u32),
        ))
    }

    /// A text; its point is at mid-height.
    pub(super) fn text(&self, text: &str, at: Point, look: Type) -> Drawing {
        let size = look.size * f64::from(FINENESS) * FONT_FACTOR;
        let (horizontal, transform) = match look.anchor {
            Anchor::Left => (HPos::Left, FontTransform::None),
            Anchor::Centre => (HPos::Center, FontTransform::None),
            Anchor::Right => (HPos::Right, FontTransform::None),
            Anchor::Upwards => (HPos::Center, FontTransform::Rotate270),
        };
        let style = TextStyle::from(("sans-serif", size).into_font().transform(transform))
            .color(&look.colour)
            .pos(Pos::new(horizontal, VPos::Center));
        self.put(Text::new(text.to_owned(), pixel(at), style))
    }

    /// A marker of about 2·`radius` points.
    pub(super) fn marker(&self, at: Point, radius: f64, colour: RGBColor, marker: Marker) -> Drawing {
        let corner = |x: f64, y: f64| pixel((at.0 + x * radius, at.1 + y * radius));
        let thin = colour.stroke_width(pixels(radius * 0.45).max(2) as u32);
        match marker {
            Marker::Circle => self.put(Circle::new(pixel(at), pixels(radius), colour.filled())),
            Marker::Ring => {
                self.put(Circle::new(pixel(at), pixels(radius), WHITE.filled()))?;
                self.put(Circle::new(pixel(at), pixels(radius), thin))
            }
            Marker::Square => self.put(Rectangle::new(
                [corner(-0.85, -0.85), corner(0.85, 0.85)],
                colour.filled(),
            )),
            Marker::Triangle => {
                let corners = vec![corner(0.0, -1.1), corner(1.0, 0.8), corner(-1.0, 0.8)];
                self.put(Polygon::new(corners, colour.filled()))
            }
            Marker::Diamond => {
                let corners = vec![
                    corner(0.0, -1.2),
                    corner(1.2, 0.0),
                    corner(0.0, 1.2),
                    corner(-1.2, 0.0),
                ];
                self.put(Polygon::new(corners, colour.filled()))
            }
            Marker::Plus => {
                self.put(PathElement::new(vec![corner(-1.1, 0.0), corner(1.1, 0.0)], thin))?;
                self.put(PathElement::new(vec![corner(0.0, -1.1), corner(0.0, 1.1)], thin))
            }
            Marker::Cross => {
                self.put(PathElement::new(vec![corner(-0.9, -0.9), corner(0.9, 0.9)], thin))?;
                self.put(PathElement::new(vec![corner(-0.9, 0.9), corner(0.9, -0.9)], thin))
            }
        }
    }

    /// A legend entry with its left end at a point; its width is [`key_width`].
    pub(super) fn key(&self, (x, y): Point, key: &Key) -> Drawing {
        let stroke = Stroke {
            colour: key.style.colour,
            width: 2.0,
            dash: key.style.dash,
        };
        if key.shows == Shows::Area {
            self.fill((x, y - 6.0), (x + KEY_LINE, y + 6.0), key.style.colour)?;
        }
        if matches!(key.shows, Shows::Line | Shows::Both) {
            self.line(&[(x, y), (x + KEY_LINE, y)], stroke)?;
        }
        if matches!(key.shows, Shows::Marker | Shows::Both) {
            self.marker((x + KEY_LINE / 2.0, y), 3.6, key.style.colour, key.style.marker)?;
        }
        let look = Type {
            size: KEY_SIZE,
            anchor: Anchor::Left,
            colour: BLACK,
        };
        self.text(&key.name, (x + KEY_LINE + 6.0, y), look)
    }
}

const KEY_LINE: f64 = 34.0;
const KEY_SIZE: f64 = 12.0;

/// Width of a legend entry with the gap behind it.
pub(super) fn key_width(key: &Key) -> f64 {
    KEY_LINE + 6.0 + text_width(&key.name, KEY_SIZE) + 14.0
}

/// Drops points that repeat the one before or lie on the straight way to the one after: the drawing stays the same.
fn without_needless(points: impl Iterator<Item = (i32, i32)>) -> Vec<(i32, i32)> {
    let mut kept: Vec<(i32, i32)> = Vec::new();
    for point in points {
        if kept.last() == Some(&point) {
            continue;
        }
        if let [.., a, b] = kept[..] {
            let (first, second) = ((b.0 - a.0, b.1 - a.1), (point.0 - b.0, point.1 - b.1));
            let cross = i64::from(first.0) * i64::from(second.1) - i64::from(first.1) * i64::from(second.0);
            let dot = i64::from(first.0) * i64::from(second.0) + i64::from(first.1) * i64::from(second.1);
            if cross == 0 && dot > 0 {
                kept.pop();
            }
        }
        kept.push(point);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn needless_points_are_dropped_and_turns_kept() {
        let straight = [(0, 0), (1, 1), (1, 1), (3, 3), (3, 0), (3, 5)];
        assert_eq!(
            without_needless(straight.into_iter()),
            [(0, 0), (3, 3), (3, 0), (3, 5)]
        );
    }

    #[test]
    fn page_has_its_size_and_text() {
        let look = Type {
            size: 12.0,
            anchor: Anchor::Left,
            colour: BLACK,
        };
        let svg = draw(200.0, |s| s.text("Δt < 5 ms", (10.0, 10.0), look)).unwrap();
        assert!(
            svg.starts_with("<svg width=\"1000\" height=\"200\" viewBox=\"0 0 2000 400\""),
            "{svg}"
        );
        assert!(svg.contains("Δt &lt; 5 ms"), "{svg}");
    }
}
