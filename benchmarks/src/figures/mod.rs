//! Figures of a results folder as SVG: those of Faraji & Ijspeert, "Singularity-tolerant inverse kinematics for bipedal
//! robots: an efficient use of computational power to reduce energy consumption" (2017), those of Davies' method on the
//! Bioloid (`davies_*`), those of the walks of Melson (`melson_*`), what comes of its chain on other robots (`walk_*`), those of
//! closed-form limbs (`closed_form_*`), and overviews over all suites.
//!
//! Everything is drawn from the rows and traces of the folder, and from the embedded suites where a figure shows the
//! robot, its mechanism or the knots of its walk: the same folder gives the same bytes. Where several rows of a suite differ in Δt, the figures show that of the last.

mod axis;
mod boundary;
mod davies;
mod family;
mod figure;
pub(crate) mod labels;
mod lean;
mod limbs;
mod mechanism;
mod overview;
mod painter;
mod panel;
mod posture;
mod regulator;
mod sheet;
mod skeleton;
mod strip;
mod style;
mod tracking;
mod walk;
mod walked;

use crate::limbs::LIMBS_FILE;
use crate::records::{Row, Trace};
use crate::records_io::{ROWS_FILE, RecordError, read_rows, read_trace, write_atomically};
use labels::{Labelled, labelled};
pub use mechanism::mechanism_svg;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use style::Styles;

/// Why figures could not be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FigureError {
    /// Rows or a trace could not be read, or a figure not written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The drawing library refused.
    #[error("{figure}: drawing failed: {reason}")]
    Draw {
        /// File name.
        figure: String,
        /// Its message.
        reason: String,
    },
}

/// Limits that figures draw beside the data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnLimits {
    /// Lower and upper knee angle (rad).
    pub knee_rad: (f64, f64),
    /// Lower and upper hip pitch (rad).
    pub hip_pitch_rad: (f64, f64),
    /// Largest joint velocity (rad/s).
    pub velocity_rad_s: f64,
    /// Margin q_s of the ellipse (rad).
    pub margin_rad: f64,
    /// Slope κ of the polygon (1/s).
    pub polygon_slope_per_s: f64,
    /// Velocity v₀ with which the polygon lets a joint leave its limit (rad/s).
    pub polygon_exit_velocity_rad_s: f64,
}

impl DrawnLimits {
    /// Coman with the knee limited at its singularity, Table I of the paper, and our polygon.
    #[allow(
        clippy::approx_constant,
        reason = "the limit in the robot's table, not a fraction of pi"
    )]
    pub const COMAN: Self = Self {
        knee_rad: (0.0, 1.9199),
        hip_pitch_rad: (-1.9199, 0.7854),
        velocity_rad_s: 4.0,
        margin_rad: 0.0,
        polygon_slope_per_s: 8.0,
        polygon_exit_velocity_rad_s: 0.02,
    };
}

/// What [`draw_all`] did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Drawn {
    /// Files written.
    pub files: Vec<PathBuf>,
    /// Figures left out and curves missing, with the reason.
    pub notes: Vec<String>,
}

/// Draws every figure for which the folder has data into its subfolder `figures`. A figure without data is left out with
/// a note; a file left there by an earlier run is then removed, lest it be taken for one of these rows.
///
/// # Errors
/// [`FigureError`]; figures drawn before the error stay.
pub fn draw_all(dir: &Path, limits: &DrawnLimits) -> Result<Drawn, FigureError> {
    let file = dir.join(ROWS_FILE);
    // A folder of limb suites alone has no runs.
    let rows = if !file.exists() && dir.join(LIMBS_FILE).exists() {
        Vec::new()
    } else {
        of_last_dt(read_rows(&file)?.rows)
    };
    let has_runs = !rows.is_empty();
    let runs = labelled(&rows);
    let styles = Styles::assign(runs.iter().map(|r| r.label.as_str()));
    let mut studio = Studio {
        dir,
        runs,
        styles,
        limits: *limits,
        notes: Vec::new(),
    };
    let mut files = Vec::new();
    for (name, paint) in FIGURES {
        let painted = paint(&mut studio);
        if let Some(missing) = store(dir, name, painted, &mut files)?.filter(|_| has_runs) {
            studio.notes.push(missing);
        }
    }
    let mut drawn = Drawn {
        files,
        notes: studio.notes,
    };
    limbs::draw(dir, &mut drawn)?;
    Ok(drawn)
}

/// Writes a figure and adds its file to `files`; one without data is removed, and a note that says why is returned.
fn store(
    dir: &Path,
    name: &str,
    painted: Result<String, Obstacle>,
    files: &mut Vec<PathBuf>,
) -> Result<Option<String>, FigureError> {
    let path = dir.join("figures").join(name);
    match painted {
        Ok(svg) => {
            write_atomically(&path, &svg)?;
            files.push(path);
            Ok(None)
        }
        Err(Obstacle::NoData(reason)) => {
            remove_stale(&path)?;
            Ok(Some(format!("{name} not drawn: {reason}")))
        }
        Err(Obstacle::Record(error)) => Err(error.into()),
        Err(Obstacle::Draw(reason)) => Err(FigureError::Draw {
            figure: name.to_owned(),
            reason,
        }),
    }
}

fn remove_stale(path: &Path) -> Result<(), RecordError> {
    match std::fs::remove_file(path) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => Err(RecordError::Io {
            path: path.to_path_buf(),
            action: "remove",
            source,
        }),
        _ => Ok(()),
    }
}

type Paint = fn(&mut Studio<'_>) -> Result<String, Obstacle>;

const FIGURES: [(&str, Paint); 31] = [
    ("fig1_squat.svg", tracking::squat),
    ("fig2_stretch.svg", tracking::stretch),
    ("fig2_stretch_fast.svg", tracking::stretch_fast),
    ("fig3_asymmetric.svg", tracking::asymmetric),
    ("fig3_family.svg", family::survival),
    ("fig4_lean.svg", lean::lean),
    ("fig5_boundary.svg", boundary::boundary),
    ("fig6_regulator.svg", regulator::regulator),
    ("fig7_posture.svg", posture::posture),
    ("davies_graph.svg", davies::graph),
    ("davies_fig6_7_feet.svg", davies::feet),
    ("davies_fig8_9_waist.svg", davies::waist),
    ("davies_fig10_strip.svg", davies::strip),
    ("davies_fig11_12_balance.svg", davies::balance),
    ("davies_fig13_joints.svg", davies::joints),
    ("davies_closure.svg", davies::closure),
    ("davies_condition.svg", davies::condition),
    ("davies_damping.svg", davies::damping),
    ("melson_fig3_4_5_joints.svg", walk::joints),
    ("melson_fig6_7_8_strips.svg", walk::melson_strips),
    ("melson_fig9_poses.svg", walk::poses),
    ("melson_fig10_drift.svg", walk::drift),
    ("melson_objectives.svg", walk::objectives),
    ("melson_zmp.svg", walk::melson_zmp),
    ("walk_hubo_zmp.svg", walk::hubo_zmp),
    ("walk_hubo_strip.svg", walk::hubo_strip),
    ("walk_hubo_methods.svg", walk::hubo_methods),
    ("overview_error.svg", overview::error),
    ("overview_time.svg", overview::time),
    ("overview_majors.svg", overview::majors),
    ("overview_hard.svg", overview::hard),
];

/// Why one figure is not drawn.
#[derive(Debug)]
enum Obstacle {
    NoData(String),
    Record(RecordError),
    Draw(String),
}

impl From<String> for Obstacle {
    fn from(message: String) -> Self {
        Self::Draw(message)
    }
}

impl From<RecordError> for Obstacle {
    fn from(error: RecordError) -> Self {
        Self::Record(error)
    }
}

/// What every figure is drawn from.
struct Studio<'a> {
    dir: &'a Path,
    runs: Vec<Labelled<'a>>,
    styles: Styles,
    limits: DrawnLimits,
    notes: Vec<String>,
}

/// A run with its trace.
struct Traced<'a> {
    run: Labelled<'a>,
    trace: Trace,
}

/// What stands below a figure whose axes are those of [`survivors`].
const AXES_OF_SURVIVORS: &str = "Linear axes fit the runs that survived. Lines end at the edge of the panel, and leaps over its height are left out.";

/// The runs that axes are fitted to, for one that diverges would make all others one flat line: those that survived, or
/// all if none did.
fn survivors<'t, 'a>(traced: &'t [Traced<'a>]) -> Vec<&'t Traced<'a>> {
    let survived = |one: &&Traced<'_>| {
        let metrics = one.run.row.metrics.as_ref();
        metrics.is_some_and(|metrics| metrics.quality.survived)
    };
    let survivors: Vec<&Traced<'a>> = traced.iter().filter(survived).collect();
    if survivors.is_empty() {
        return traced.iter().collect();
    }
    survivors
}

impl<'a> Studio<'a> {
    /// Runs of a scenario.
    fn runs_of(&self, suite: &str, scenario: &str) -> Vec<Labelled<'a>> {
        let here = |l: &&Labelled<'a>| l.row.suite == suite && l.row.scenario == scenario;
        self.runs.iter().filter(here).cloned().collect()
    }

    /// Suites, in the order of their first rows.
    fn suites(&self) -> Vec<&'a str> {
        let mut suites: Vec<&str> = Vec::new();
        for run in &self.runs {
            if !suites.contains(&run.row.suite.as_str()) {
                suites.push(&run.row.suite);
            }
        }
        suites
    }

    /// Runs of a suite.
    fn runs_of_suite(&self, suite: &str) -> Vec<Labelled<'a>> {
        self.runs
            .iter()
            .filter(|l| l.row.suite == suite)
            .cloned()
            .collect()
    }

    /// Those of the runs that have a trace with at least one sample. The others are noted.
    fn with_traces(&mut self, runs: Vec<Labelled<'a>>) -> Result<Vec<Traced<'a>>, Obstacle> {
        let mut traced = Vec::new();
        for run in runs {
            match self.trace(run.row)? {
                Some(trace) => traced.push(Traced { run, trace }),
                None if run.row.metrics.is_none() => self.miss(&run, "the method declined"),
                None => self.miss(&run, "no trace"),
            }
        }
        Ok(traced)
    }

    fn trace(&self, row: &Row) -> Result<Option<Trace>, RecordError> {
        let Some(relative) = &row.trace else {
            return Ok(None);
        };
        let path = self.dir.join(relative);
        if !path.exists() {
            return Ok(None);
        }
        read_trace(&path).map(|t| (!t.rows.is_empty()).then_some(t))
    }

    /// Notes how many traces lack a column.
    fn require(&mut self, column: &str, traced: &[Traced<'a>]) {
        let without: Vec<&Traced<'a>> = traced
            .iter()
            .filter(|t| !t.trace.columns.iter().any(|c| c == column))
            .collect();
        if let [first, ..] = without[..] {
            let (row, count, all) = (first.run.row, without.len(), traced.len());
            self.note(format!(
                "{}/{}: {count} of {all} traces have no column {column}",
                row.suite, row.scenario
            ));
        }
    }

    fn miss(&mut self, run: &Labelled<'_>, reason: &str) {
        self.note(format!(
            "{} on {}/{}: {reason}",
            run.full(),
            run.row.suite,
            run.row.scenario
        ));
    }

    fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }
}

/// Keeps, per suite, the rows with the Δt of the last one.
fn of_last_dt(mut rows: Vec<Row>) -> Vec<Row> {
    let last: BTreeMap<String, u64> = rows.iter().map(|r| (r.suite.clone(), r.dt_s.to_bits())).collect();
    rows.retain(|r| last.get(&r.suite) == Some(&r.dt_s.to_bits()));
    rows
}

/// Points of a curve: (time, value) or (abscissa, ordinate).
type Points = Vec<(f64, f64)>;

/// Points (t, value) of a column; none if the trace lacks it.
fn over_time(trace: &Trace, column: &str) -> Option<Points> {
    Some(
        trace
            .column("t")?
            .into_iter()
            .zip(trace.column(column)?)
            .collect(),
    )
}

/// Points (t, largest value of all columns that end so).
fn largest_over_time(trace: &Trace, suffix: &str) -> Option<Points> {
    let t = trace.column("t")?;
    let ends = |i: &usize| trace.columns[*i].ends_with(suffix);
    let columns: Vec<usize> = (0..trace.columns.len()).filter(ends).collect();
    let of_row = |row: &Vec<f64>| columns.iter().map(|i| row[*i]).fold(f64::NAN, f64::max);
    Some(t.into_iter().zip(trace.rows.iter().map(of_row)).collect())
}

/// Points (t_k, (q_k − q_{k−1})/(t_k − t_{k−1})), k ≥ 1, of a column; none if the trace lacks it.
fn rate_over_time(trace: &Trace, column: &str) -> Option<Points> {
    let points = over_time(trace, column)?;
    Some(
        points
            .windows(2)
            .map(|w| (w[1].0, (w[1].1 - w[0].1) / (w[1].0 - w[0].0)))
            .collect(),
    )
}

/// Suite, scenario and Δt as they stand in a title.
fn place_of(run: &Labelled<'_>) -> String {
    format!(
        "{}, scenario {}, Δt = {} ms",
        run.row.suite,
        run.row.scenario,
        milliseconds(run.row.dt_s)
    )
}

fn milliseconds(seconds: f64) -> f64 {
    // Rounded to a nanosecond: 0.005 s is 5 ms, not 5.000000000000001.
    (seconds * 1e9).round() / 1e6
}

#[cfg(test)]
pub(crate) mod synthetic;
#[cfg(test)]
mod tests;
