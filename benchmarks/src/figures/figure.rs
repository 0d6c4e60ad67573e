//! The page of a figure: title, legend, rows of panels, remarks.

use super::axis::rough;
use super::painter::Painter;
use super::panel::{Band, Curve, Level, Panel, TICK_SIZE};
use super::sheet::{Anchor, Drawing, Key, Point, Sheet, Type, WIDTH, draw, key_width, text_width};
use super::style::{BLACK, GREY};
use crate::summary::number;
use std::collections::{BTreeMap, BTreeSet};

pub(super) const MARGIN: f64 = 12.0;
pub(super) const TITLE_SIZE: f64 = 15.0;
pub(super) const LINE_HEIGHT: f64 = 20.0;
pub(super) const LEGEND_LINE: f64 = 19.0;
const RIGHT_GAP: f64 = 6.0;
/// Room for y ticks at least.
const LEAST_GUTTER: f64 = 34.0;

/// Panels side by side.
#[derive(Clone, Debug)]
pub(super) struct PanelRow {
    /// Height with title and labels.
    pub(super) height: f64,
    pub(super) panels: Vec<Panel>,
}

impl PanelRow {
    pub(super) fn new(height: f64, panels: Vec<Panel>) -> Self {
        Self { height, panels }
    }
}

/// A whole figure.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    pub(super) title: String,
    pub(super) rows: Vec<PanelRow>,
    pub(super) remarks: Vec<String>,
    /// Legend entries that are not those of curves and levels.
    pub(super) keys: Vec<Key>,
}

impl Figure {
    pub(super) fn new(title: String, rows: Vec<PanelRow>) -> Self {
        Self {
            title,
            rows,
            remarks: Vec::new(),
            keys: Vec::new(),
        }
    }

    pub(super) fn with_remarks(mut self, remarks: Vec<String>) -> Self {
        self.remarks = remarks;
        self
    }

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
            for ((x, y), key) in &legend {
                sheet.key((*x, top + y + LEGEND_LINE / 2.0), key)?;
            }
            let mut y = panels_top;
            let gutters = self.gutters();
            for row in &self.rows {
                paint_row(sheet, row, y, &gutters)?;
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

    /// Room for the y ticks of each column of panels, so that frames are aligned.
    fn gutters(&self) -> Vec<f64> {
        let columns = self.rows.iter().map(|r| r.panels.len()).max().unwrap_or(1);
        let of_column = |column: usize| {
            let panels = self.rows.iter().filter_map(|r| r.panels.get(column));
            panels.map(Panel::tick_width).fold(LEAST_GUTTER, f64::max)
        };
        (0..columns).map(of_column).collect()
    }

    fn legend(&self) -> Vec<Key> {
        let panels = || self.rows.iter().flat_map(|r| &r.panels);
        let curves = panels().flat_map(|p| &p.curves).map(Curve::key);
        let levels = panels().flat_map(|p| &p.levels).map(Level::key);
        let bands = panels().flat_map(|p| &p.bands).map(Band::key);
        let mut keys: Vec<Key> = Vec::new();
        for key in curves.chain(levels).chain(bands).chain(self.keys.iter().cloned()) {
            if !key.name.is_empty() && keys.iter().all(|k| k.name != key.name) {
                keys.push(key);
            }
        }
        keys
    }

    fn all_remarks(&self) -> Vec<String> {
        let mut cuts = BTreeSet::new();
        let mut leaving: BTreeMap<&str, BTreeMap<&str, f64>> = BTreeMap::new();
        for panel in self.rows.iter().flat_map(|r| &r.panels).filter(|p| !p.is_empty()) {
            let (x, y) = panel.fitted();
            for (axis, fitted) in [(&panel.x, x), (&panel.y, y)] {
                cuts.extend(fitted.cut_below.map(|c| (axis.label.clone(), rough(c))));
            }
            for (name, value) in panel.leaving() {
                let of_axis = leaving.entry(&panel.y.label).or_default();
                let farthest = of_axis.entry(name).or_default();
                if value.abs() >= farthest.abs() {
                    *farthest = value;
                }
            }
        }
        let leaving = leaving.into_iter().flat_map(|(label, curves)| {
            let named = |(name, value): (&str, f64)| format!("{name} (to {})", number(Some(value)));
            let curves: Vec<String> = curves.into_iter().map(named).collect();
            let remark = format!("{label}: leaving the panel: {}.", curves.join(", "));
            wrapped(&remark.replace("(to -", "(to −"))
        });
        let cuts = cuts
            .into_iter()
            .map(|(l, c)| format!("{l}: values below {c} are drawn at {c}."));
        let remarks = self.remarks.iter().flat_map(|r| wrapped(r));
        remarks.chain(leaving).chain(cuts).collect()
    }
}

/// Breaks a remark into lines that fit the page.
pub(super) fn wrapped(text: &str) -> Vec<String> {
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
pub(super) fn lay_out_legend(keys: &[Key]) -> Vec<(Point, Key)> {
    let (mut x, mut y) = (MARGIN, 0.0);
    let mut placed = Vec::new();
    for key in keys {
        let width = key_width(key);
        if x + width > WIDTH - MARGIN && x > MARGIN {
            (x, y) = (MARGIN, y + LEGEND_LINE);
        }
        placed.push(((x, y), key.clone()));
        x += width;
    }
    placed
}

fn paint_row(sheet: &Sheet<'_>, row: &PanelRow, top: f64, gutters: &[f64]) -> Drawing {
    let width = (WIDTH - MARGIN) / gutters.len() as f64;
    for (index, (panel, gutter)) in row.panels.iter().zip(gutters).enumerate() {
        let left = MARGIN / 2.0 + width * index as f64;
        Painter::new(
            sheet,
            panel,
            (left, top),
            (width - RIGHT_GAP, row.height),
            *gutter,
        )
        .paint()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::sheet::Shows;
    use super::super::style::{Dash, Marker, Style};
    use super::*;

    #[test]
    fn legend_wraps_inside_the_page() {
        let style = Style {
            colour: BLACK,
            dash: Dash::Solid,
            marker: Marker::Circle,
        };
        let key = |i| Key {
            name: format!("method-{i}"),
            style,
            shows: Shows::Both,
        };
        let placed = lay_out_legend(&(0..30).map(key).collect::<Vec<_>>());
        assert!(
            placed.iter().all(|((x, _), k)| x + key_width(k) <= WIDTH),
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
