//! Colours, dashes and markers of the methods.
//!
//! Colours are those of Okabe & Ito, "Color universal design" (2008), without the yellow, which is too pale for a line on
//! white, and with a grey. A method differs from every other in dash and marker as well, so nothing hangs on colour.

use plotters::style::RGBColor;
use std::collections::BTreeMap;

pub(super) const BLACK: RGBColor = RGBColor(0, 0, 0);
pub(super) const GREY: RGBColor = RGBColor(110, 110, 110);
pub(super) const PALE: RGBColor = RGBColor(222, 222, 222);
pub(super) const WHITE: RGBColor = RGBColor(255, 255, 255);
pub(super) const ORANGE: RGBColor = RGBColor(230, 159, 0);
pub(super) const SKY: RGBColor = RGBColor(86, 180, 233);
pub(super) const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const VERMILLION: RGBColor = RGBColor(213, 94, 0);
pub(super) const PURPLE: RGBColor = RGBColor(204, 121, 167);

/// Fill where the right foot stands alone, and the left one: light enough for any line on them.
pub(super) const PALE_BLUE: RGBColor = RGBColor(218, 234, 246);
pub(super) const PALE_VERMILLION: RGBColor = RGBColor(252, 230, 216);
/// Fill of an area that a quantity should stay in.
pub(super) const PALE_GREEN: RGBColor = RGBColor(214, 238, 229);

/// Pattern of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dash {
    Solid,
    Long,
    Short,
    Dotted,
}

/// Shape of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
    Plus,
    Cross,
    /// A circle not filled.
    Ring,
}

/// How a method is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Style {
    pub(super) colour: RGBColor,
    pub(super) dash: Dash,
    pub(super) marker: Marker,
}

/// Limbs on the right and on the left of a robot, and what is between them.
pub(super) const RIGHT: Style = style(BLUE, Dash::Solid, Marker::Circle);
pub(super) const LEFT: Style = style(VERMILLION, Dash::Long, Marker::Square);
pub(super) const TRUNK: Style = style(BLACK, Dash::Solid, Marker::Diamond);

const fn style(colour: RGBColor, dash: Dash, marker: Marker) -> Style {
    Style { colour, dash, marker }
}

/// Labels whose style never changes.
const KNOWN: [(&str, Style); 8] = [
    ("ik1", style(VERMILLION, Dash::Solid, Marker::Circle)),
    ("ik2", style(ORANGE, Dash::Long, Marker::Triangle)),
    ("ik3", style(PURPLE, Dash::Short, Marker::Square)),
    ("ik4", style(BLUE, Dash::Solid, Marker::Diamond)),
    ("ik4 literal", style(SKY, Dash::Dotted, Marker::Plus)),
    ("ik5", style(GREEN, Dash::Long, Marker::Ring)),
    ("penalty-cg", style(BLACK, Dash::Dotted, Marker::Cross)),
    ("penalty-lbfgs", style(GREY, Dash::Short, Marker::Triangle)),
];

const COLOURS: [RGBColor; 8] = [BLACK, GREEN, VERMILLION, BLUE, PURPLE, ORANGE, SKY, GREY];
const DASHES: [Dash; 4] = [Dash::Short, Dash::Solid, Dash::Dotted, Dash::Long];
const MARKERS: [Marker; 6] = [
    Marker::Square,
    Marker::Diamond,
    Marker::Ring,
    Marker::Cross,
    Marker::Plus,
    Marker::Circle,
];

/// The styles of all labels of a set of results, the same in each of its figures.
#[derive(Clone, Debug, Default)]
pub(super) struct Styles(BTreeMap<String, Style>);

impl Styles {
    /// Known labels get their own style; the others, in alphabetical order, the combinations not taken yet, colour
    /// changing fastest.
    pub(super) fn assign<'a>(labels: impl Iterator<Item = &'a str>) -> Self {
        let mut styles: BTreeMap<String, Style> = KNOWN.iter().map(|(l, s)| ((*l).to_owned(), *s)).collect();
        let mut free = (0..)
            .map(combination)
            .filter(|s| KNOWN.iter().all(|(_, k)| k != s));
        let sorted: std::collections::BTreeSet<&str> = labels.collect();
        for label in sorted {
            if !styles.contains_key(label) {
                styles.insert(label.to_owned(), free.next().expect("the sequence has no end"));
            }
        }
        Self(styles)
    }

    /// Style of a label; a plain line for one that was not among those assigned.
    pub(super) fn of(&self, label: &str) -> Style {
        self.0
            .get(label)
            .copied()
            .unwrap_or(style(BLACK, Dash::Solid, Marker::Circle))
    }
}

/// The i-th combination; 8, 4 and 6 repeat jointly only after 192, since each round of colours shifts the dash and each
/// round of dashes the marker.
fn combination(index: usize) -> Style {
    let round = index / COLOURS.len();
    let turn = round / DASHES.len();
    style(
        COLOURS[index % COLOURS.len()],
        DASHES[(index + round) % DASHES.len()],
        MARKERS[(index + turn) % MARKERS.len()],
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_labels_differ_in_style_and_do_not_depend_on_order() {
        let labels: Vec<String> = (0..40)
            .map(|i| format!("m{i}"))
            .chain(["ik1".to_owned()])
            .collect();
        let styles = Styles::assign(labels.iter().map(String::as_str));
        let reversed = Styles::assign(labels.iter().rev().map(String::as_str));
        for (index, label) in labels.iter().enumerate() {
            assert_eq!(styles.of(label), reversed.of(label), "{label}");
            for other in &labels[..index] {
                assert_ne!(styles.of(label), styles.of(other), "{label} looks like {other}");
            }
        }
        assert_eq!(styles.of("ik1").colour, VERMILLION);
    }
}
