//! The family of asymmetric squats as a matrix: which method survives which scenario, with its largest error.

use super::labels::{Labelled, by_method};
use super::sheet::{Anchor, Drawing, Point, Sheet, Stroke, Type, WIDTH, draw};
use super::style::{BLACK, Dash, GREEN, GREY, PALE, VERMILLION, WHITE};
use super::{Obstacle, Studio, milliseconds};
use plotters::style::RGBColor;

const SUITE: &str = "coman/asymmetric";
/// Scenario of the suite that has a figure of its own.
const APART: &str = "C";
const LEFT: f64 = 150.0;
const TOP: f64 = 104.0;
const CELL_HEIGHT: f64 = 30.0;
const WIDEST_CELL: f64 = 78.0;
/// Tints of the cells: the palette's colours on white, pale enough for black text.
const SURVIVED: RGBColor = RGBColor(204, 236, 227);
const LOST: RGBColor = RGBColor(247, 223, 204);

/// Figure 3, family.
pub(super) fn survival(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let runs: Vec<Labelled<'_>> = studio
        .runs_of_suite(SUITE)
        .into_iter()
        .filter(|l| l.row.scenario != APART)
        .collect();
    let Some(first) = runs.first() else {
        return Err(Obstacle::NoData(format!(
            "no run on a family scenario of {SUITE}"
        )));
    };
    let dt = milliseconds(first.row.dt_s);
    let matrix = Matrix::new(&runs);
    let height = TOP + CELL_HEIGHT * matrix.scenarios.len() as f64 + 46.0;
    Ok(draw(height, |sheet| matrix.paint(sheet, dt))?)
}

struct Matrix<'a> {
    scenarios: Vec<&'a str>,
    /// Runs of each method, one column each.
    methods: Vec<Vec<&'a Labelled<'a>>>,
}

impl<'a> Matrix<'a> {
    fn new(runs: &'a [Labelled<'a>]) -> Self {
        let mut scenarios: Vec<&str> = Vec::new();

        for run in runs {
            if !scenarios.contains(&run.row.scenario.as_str()) {
                scenarios.push(&run.row.scenario);
            }
        }
        // The halves of the family one below the other: what stands last in an id is the period of the roll.
        scenarios.sort_by_key(|s| std::cmp::Reverse(s.rsplit('_').next()));
        Self {
            scenarios,
            methods: by_method(runs),
        }
    }

    fn cell_width(&self) -> f64 {
        ((WIDTH - LEFT - 14.0) / self.methods.len() as f64).min(WIDEST_CELL)
    }

    fn paint(&self, sheet: &Sheet<'_>, dt_ms: f64) -> Drawing {
        let look = |size, anchor, colour| Type { size, anchor, colour };
        let title =
            format!("Fig. 3, family  Asymmetric squats: {SUITE}, all but scenario {APART}, Δt = {dt_ms} ms");
        sheet.text(&title, (12.0, 22.0), look(15.0, Anchor::Left, BLACK))?;
        let explanation = "Largest CoM error (mm).  Tick: survived.  Cross: lost.  – : declined or not run.";
        sheet.text(explanation, (12.0, 44.0), look(12.0, Anchor::Left, GREY))?;
        for (column, runs) in self.methods.iter().enumerate() {
            let x = LEFT + (column as f64 + 0.5) * self.cell_width();
            let name = runs[0].full();
            let lines = broken(&name);
            for (index, line) in lines.iter().enumerate() {
                let y = TOP - 11.0 - 13.0 * (lines.len() - 1 - index) as f64;
                sheet.text(line, (x, y), look(10.5, Anchor::Centre, BLACK))?;
            }
        }
        for (index, scenario) in self.scenarios.iter().enumerate() {
            let y = TOP + (index as f64 + 0.5) * CELL_HEIGHT;
            sheet.text(scenario, (LEFT - 8.0, y), look(11.0, Anchor::Right, BLACK))?;
        }
        self.cells(sheet)?;
        self.sums(sheet)
    }

    fn cells(&self, sheet: &Sheet<'_>) -> Drawing {
        for (row, scenario) in self.scenarios.iter().enumerate() {
            for (column, runs) in self.methods.iter().enumerate() {
                let corner = (
                    LEFT + column as f64 * self.cell_width(),
                    TOP + row as f64 * CELL_HEIGHT,
                );
                let run = runs.iter().copied().find(|r| r.row.scenario == *scenario);
                self.cell(sheet, corner, run)?;
            }
        }
        Ok(())
    }

    fn cell(&self, sheet: &Sheet<'_>, (x, y): Point, run: Option<&Labelled<'_>>) -> Drawing {
        let opposite = (x + self.cell_width(), y + CELL_HEIGHT);
        let quality = run.and_then(|r| r.row.metrics.as_ref()).map(|m| &m.quality);
        let tint = quality.map_or(PALE, |q| if q.survived { SURVIVED } else { LOST });
        sheet.fill((x, y), opposite, tint)?;
        sheet.frame((x, y), opposite, WHITE)?;
        let text_at = (x + self.cell_width() / 2.0 + 8.0, y + CELL_HEIGHT / 2.0);
        let look = Type {
            size: 11.0,
            anchor: Anchor::Centre,
            colour: BLACK,
        };
        let Some(quality) = quality else {
            return sheet.text("–", text_at, look);
        };
        let symbol = if quality.survived { tick } else { cross };
        symbol(sheet, (x + 13.0, y + CELL_HEIGHT / 2.0))?;
        let error = quality
            .com_error_max_m
            .map_or("–".to_owned(), |e| millimetres(e * 1e3));
        sheet.text(&error, text_at, look)
    }

    /// Survivors per method below the matrix.
    fn sums(&self, sheet: &Sheet<'_>) -> Drawing {
        let y = TOP + CELL_HEIGHT * self.scenarios.len() as f64 + 16.0;
        let look = |anchor| Type {
            size: 12.0,
            anchor,
            colour: BLACK,
        };
        sheet.text("survived", (LEFT - 8.0, y), look(Anchor::Right))?;
        for (column, runs) in self.methods.iter().enumerate() {
            let survived = |r: &&&Labelled<'_>| r.row.metrics.as_ref().is_some_and(|m| m.quality.survived);
            let sum = format!("{}/{}", runs.iter().filter(survived).count(), runs.len());
            sheet.text(
                &sum,
                (LEFT + (column as f64 + 0.5) * self.cell_width(), y),
                look(Anchor::Centre),
            )?;
        }
        Ok(())
    }
}

/// A name in lines of at most about ten characters, broken after blanks and hyphens.
fn broken(name: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for piece in name.split_inclusive([' ', '-']) {
        match lines.last_mut() {
            Some(line) if line.len() + piece.trim_end().len() <= 9 => line.push_str(piece),
            _ => lines.push(piece.to_owned()),
        }
    }
    lines
}

fn millimetres(value: f64) -> String {
    match value {
        v if v < 100.0 => format!("{v:.1}"),
        v if v < 1e4 => format!("{v:.0}"),
        v => format!("{v:.0e}"),
    }
}

/// A tick, drawn as a line: not every font has the sign.
fn tick(sheet: &Sheet<'_>, (x, y): Point) -> Drawing {
    let stroke = Stroke {
        colour: GREEN,
        width: 2.0,
        dash: Dash::Solid,
    };
    sheet.line(&[(x - 5.0, y), (x - 1.5, y + 4.0), (x + 5.0, y - 5.0)], stroke)
}

/// A cross, drawn as lines.
fn cross(sheet: &Sheet<'_>, (x, y): Point) -> Drawing {
    let stroke = Stroke {
        colour: VERMILLION,
        width: 2.0,
        dash: Dash::Solid,
    };
    sheet.line(&[(x - 4.0, y - 4.0), (x + 4.0, y + 4.0)], stroke)?;
    sheet.line(&[(x - 4.0, y + 4.0), (x + 4.0, y - 4.0)], stroke)
}
