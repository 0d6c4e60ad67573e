//! Figures of the limb suites (`closed_form_*`), from the limb rows of a folder and the traces that belong to them.

mod continuity;
mod errors;
mod postures;
mod workspace;

use super::style::{BLACK, BLUE, Dash, GREEN, Marker, ORANGE, PURPLE, Style, VERMILLION};
use super::{Drawn, FigureError, Obstacle, store};
use crate::limbs::{Findings, LIMBS_FILE, LimbRow, read_limbs};
use std::path::Path;

type Paint = fn(&Limbs<'_>) -> Result<String, Obstacle>;

const FIGURES: [(&str, Paint); 4] = [
    ("closed_form_errors.svg", errors::errors),
    ("closed_form_workspace.svg", workspace::workspace),
    ("closed_form_continuity.svg", continuity::continuity),
    ("closed_form_postures.svg", postures::postures),
];

/// What the figures are drawn from.
struct Limbs<'a> {
    dir: &'a Path,
    rows: Vec<LimbRow>,
}

impl Limbs<'_> {
    /// The row of a set on a limb that is described by its robot and the beginning of its family.
    fn row(&self, robot: &str, family: &str, set: &str) -> Option<&LimbRow> {
        let here = |row: &&LimbRow| row.robot == robot && row.family.starts_with(family) && row.set == set;
        self.rows.iter().filter(here).find(|row| row.side == "right")
    }

    fn found<'a, T>(&'a self, of: impl Fn(&'a Findings) -> Option<&'a T>) -> Vec<(&'a LimbRow, &'a T)> {
        let pair = |row: &'a LimbRow| of(&row.found).map(|found| (row, found));
        self.rows.iter().filter_map(pair).collect()
    }
}

/// Draws the figures of limbs beside those of the runs. A folder without limb rows has none, which is not worth a note.
pub(super) fn draw(dir: &Path, drawn: &mut Drawn) -> Result<(), FigureError> {
    let rows = read_limbs(&dir.join(LIMBS_FILE))?;
    let has_rows = !rows.is_empty();
    let limbs = Limbs { dir, rows };
    for (name, paint) in FIGURES {
        if let Some(missing) = store(dir, name, paint(&limbs), &mut drawn.files)?.filter(|_| has_rows) {
            drawn.notes.push(missing);
        }
    }
    Ok(())
}

/// Name and look of a family of limbs; of a general one without the axes that meet.
fn family(row: &LimbRow) -> (String, Style) {
    let look = |colour, dash, marker| Style { colour, dash, marker };
    let style = match row.family.as_str() {
        "leg of the paper" => look(BLUE, Dash::Solid, Marker::Circle),
        "arm of the paper" => look(VERMILLION, Dash::Long, Marker::Square),
        "arm of four joints" => look(GREEN, Dash::Short, Marker::Triangle),
        name if name.ends_with("quartic") => look(ORANGE, Dash::Dotted, Marker::Ring),
        name if name.ends_with("a5 = 0") => look(PURPLE, Dash::Dotted, Marker::Diamond),
        _ => look(BLACK, Dash::Dotted, Marker::Cross),
    };
    let name = match row.family.strip_prefix("general, ") {
        Some(rest) => format!("general, {}", rest.rsplit(", ").next().unwrap_or(rest)),
        None => row.family.clone(),
    };
    (name, style)
}
