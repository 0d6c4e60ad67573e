//! The family of asymmetric squats as a matrix: which method survives which scenario, with its largest error.

use super::labels::Labelled;
use super::sheet::{Anchor, Drawing, Point, Sheet, Stroke, Type, WIDTH, draw};
use super::style::{BLACK, Dash, GREEN, GREY, PALE, VERMILLION, WHITE};
use super::{Obstacle, Studio, milliseconds};
use plotters::style::RGBColor;

const SUITE: &str = "coman/asymmetric";
/// Scenario of the suite that has a figure of its own.
const APART: &str = "C";
const LEFT: f64 = 150.0;
const TOP: f64 = 92.0;
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
    runs: &'a [Labelled<'a>],
    scenarios: Vec<&'a str>,
    /// (label, n).
    methods: Vec<(String, Option<u64>)>,
}

impl<'a> Matrix<'a> {
    fn new(runs: &'a [Labelled<'a>]) -> Self {
        let mut scenarios: Vec<&str> = Vec::new();
        let mut methods: Vec<(String, Option<u64>)> = Vec::new();
        for run in runs {
            if !scenarios.contains(&run.row.scenario.as_str()) {
                scenarios.push(&run.row.scenario);
            }
            let method = (run.label.clone(), run.n);
            if !methods.contains(&method) {
                methods.push(method);
            }
        }
        methods.sort_by_key(|(label, n)| (label.clone(), std::cmp::Reverse(*n)));
        Self {
            runs,
            scenarios,
            methods,
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
        for (column, (label, n)) in self.methods.iter().enumerate() {
            let x = LEFT + (column as f64 + 0.5) * self.cell_width();
            let (name, variant) = label.split_once([' ', '-']).unwrap_or((label, ""));
            let budget = n.map_or(String::new(), |n| format!("n={n}"));
            let second = [variant, &budget]
                .into_iter()
                .filter(|s| !s.is_empty())
                .collect::<Vec<_>>()
                .join(" ");
            sheet.text(name, (x, TOP - 26.0), look(11.0, Anchor::Centre, BLACK))?;
            sheet.text(&second, (x, TOP - 11.0), look(10.0, Anchor::Centre, BLACK))?;
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
            for (column, method) in self.methods.iter().enumerate() {
                let corner = (
                    LEFT + column as f64 * self.cell_width(),
                    TOP + row as f64 * CELL_HEIGHT,
                );
                self.cell(sheet, corner, self.find(scenario, method))?;
            }
        }
        Ok(())
    }

    fn find(&self, scenario: &str, method: &(String, Option<u64>)) -> Option<&Labelled<'_>> {
        self.runs
            .iter()
            .find(|r| r.row.scenario == scenario && r.label == method.0 && r.n == method.1)
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
        symbol(sheet, (x + 13.0, y + CELL_HEIGHT / 2.0), quality.survived)?;
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
        for (column, (label, n)) in self.methods.iter().enumerate() {
            let of_method = self.runs.iter().filter(|r| r.label == *label && r.n == *n);
            let metrics: Vec<bool> = of_method
                .map(|r| r.row.metrics.as_ref().is_some_and(|m| m.quality.survived))
                .collect();
            let sum = format!("{}/{}", metrics.iter().filter(|s| **s).count(), metrics.len());
            sheet.text(
                &sum,
                (LEFT + (column as f64 + 0.5) * self.cell_width(), y),
                look(Anchor::Centre),
            )?;
        }
        Ok(())
    }
}

fn millimetres(value: f64) -> String {
    match value {
        v if v < 100.0 => format!("{v:.1}"),
        v if v < 1e4 => format!("{v:.0}"),
        v => format!("{v:.0e}"),
    }
}

/// A tick or a cross, drawn as lines: not every font has the signs.
fn symbol(sheet: &Sheet<'_>, (x, y): Point, survived: bool) -> Drawing {
    let stroke = |colour| Stroke {
        colour,
        width: 2.0,
        dash: Dash::Solid,
    };
    if survived {
        return sheet.line(
            &[(x - 5.0, y), (x - 1.5, y + 4.0), (x + 5.0, y - 5.0)],
            stroke(GREEN),
        );
    }
    sheet.line(&[(x - 4.0, y - 4.0), (x + 4.0, y + 4.0)], stroke(VERMILLION))?;
    sheet.line(&[(x - 4.0, y + 4.0), (x + 4.0, y - 4.0)], stroke(VERMILLION))
}
