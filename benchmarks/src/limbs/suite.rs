//! Limb suites as they are written: robots and one study, as TOML.

use crate::error::InputError;
use crate::suite::{RobotSpec, check_id};
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use std::path::Path;

/// A suite of closed-form limbs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimbSuite {
    /// Id, e.g. `closed-form/grid`.
    pub id: String,
    /// What it is about, in one line.
    pub title: String,
    /// What it shows, what to look for, and what not to conclude.
    pub analysis: String,
    /// Seed of every random draw.
    pub seed: u64,
    /// The robots; every limb of theirs with a closed form takes part.
    pub robots: Vec<RobotSpec>,
    /// What is done with their limbs.
    pub study: Study,
    /// Where it was read from, for messages.
    #[serde(skip)]
    pub source: String,
}

/// What a suite does with each limb.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Study {
    /// Poses of given joints are solved and judged.
    Grid(GridSpec),
    /// Paths through singular sets are followed.
    Continuity(ContinuitySpec),
    /// Orientations that can be reached are counted.
    Reach(ReachSpec),
}

/// Sets of generating joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridSpec {
    /// Steps of the grids through zero (degrees); each divides a full turn.
    pub on_axis_deg: Vec<f64>,
    /// The grid beside them.
    pub off_axis: OffAxis,
    /// Numbers of poses.
    pub full: GridCounts,
    /// The same of a quick session.
    pub quick: GridCounts,
}

/// A grid that begins at an offset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OffAxis {
    /// Step (degrees).
    pub step_deg: f64,
    /// First value (degrees).
    pub offset_deg: f64,
}

/// Numbers of poses per limb.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridCounts {
    /// Grids of up to this many poses are taken whole.
    pub whole_up_to: usize,
    /// Poses drawn from a larger grid.
    pub sampled: usize,
    /// Poses with joints uniform over a turn.
    pub random: usize,
    /// Poses that are timed.
    pub timed: usize,
}

/// Paths through singular sets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContinuitySpec {
    /// How far the fastest joint is from the singular set at the ends of a path (rad).
    pub half_width_rad: f64,
    /// What a turned path changes of a free joint at the singular set (rad).
    pub turn_rad: f64,
    /// Tips of limbs, as `robot/body`, whose first path is written as a trace.
    pub traced: Vec<String>,
    /// Numbers of paths and steps.
    pub full: ContinuityCounts,
    /// The same of a quick session.
    pub quick: ContinuityCounts,
}

/// Numbers of paths per singular set and limb.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContinuityCounts {
    /// Paths; each is sampled twice, through the set and to both sides of it.
    pub paths: usize,
    /// Steps of a path; even.
    pub steps: usize,
}

/// Orientations over distances, slices of the workspace, and single poses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReachSpec {
    /// Largest distance as a part of the stretched limb.
    pub beyond: f64,
    /// Slices.
    #[serde(default)]
    pub slices: Vec<SliceSpec>,
    /// Poses of which all solutions are recorded.
    #[serde(default)]
    pub postures: Vec<PostureSpec>,
    /// Numbers of distances, orientations and cells.
    pub full: ReachCounts,
    /// The same of a quick session.
    pub quick: ReachCounts,
}

/// The sagittal plane through the common point of a limb's first axes, with the end at one orientation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SliceSpec {
    /// Name of a robot of the suite.
    pub robot: String,
    /// A frame fixed in the last body of a limb.
    pub frame: String,
    /// Its roll, pitch, yaw in the body that carries the limb (rad).
    pub rotation_rpy_rad: [f64; 3],
}

/// A posture of which all alternatives are recorded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PostureSpec {
    /// Name of a robot of the suite.
    pub robot: String,
    /// Last body of a limb.
    pub limb: String,
    /// Its joints, base to tip (degrees).
    pub joints_deg: Vec<f64>,
}

/// Numbers per limb.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReachCounts {
    /// Distances from the common point.
    pub distances: usize,
    /// Random orientations at each.
    pub orientations: usize,
    /// Cells of a slice along either axis.
    pub cells: usize,
}

/// The limb suites that come with the program: id and text.
pub const EMBEDDED: &[(&str, &str)] = &[
    (
        "closed-form/grid",
        include_str!("../../suites/closed-form/grid.toml"),
    ),
    (
        "closed-form/continuity",
        include_str!("../../suites/closed-form/continuity.toml"),
    ),
    (
        "closed-form/reach",
        include_str!("../../suites/closed-form/reach.toml"),
    ),
];

/// Whether a name on the command line is that of a limb suite: an embedded id, or a TOML file with a `study`, or with what
/// else only these have and without a problem. A file that cannot be read or parsed is not.
pub fn is_limb_suite(name: &str) -> bool {
    let has = |table: &toml::Table, keys: &[&str]| keys.iter().any(|key| table.contains_key(*key));
    let of_limbs = |table: toml::Table| {
        has(&table, &["study"]) || (has(&table, &["robots", "limbs", "seed"]) && !has(&table, &["problem"]))
    };
    let is_study = |text: String| text.parse().is_ok_and(of_limbs);
    EMBEDDED.iter().any(|(id, _)| *id == name)
        || (name.ends_with(".toml") && std::fs::read_to_string(name).is_ok_and(is_study))
}

impl LimbSuite {
    /// The suite of that id, or in that file.
    ///
    /// # Errors
    /// A file that cannot be read or is no limb suite.
    pub fn load(name: &str) -> Result<Self, InputError> {
        if let Some((id, text)) = EMBEDDED.iter().find(|(id, _)| *id == name) {
            return Self::parse(text, &format!("suite {id}"), Path::new("."));
        }
        let text = std::fs::read_to_string(name).map_err(|e| InputError::File {
            file: name.to_owned(),
            reason: e.to_string(),
        })?;
        Self::parse(&text, name, Path::new(name).parent().unwrap_or(Path::new(".")))
    }

    /// All embedded limb suites.
    ///
    /// # Errors
    /// As [`LimbSuite::load`]; a test shows that there is none.
    pub fn load_embedded() -> Result<Vec<Self>, InputError> {
        EMBEDDED.iter().map(|(id, _)| Self::load(id)).collect()
    }

    /// Reads a suite; `source` stands for it in messages, files it names are relative to `folder`.
    ///
    /// # Errors
    /// Text that is no limb suite, with line and column; numbers out of their range.
    pub fn parse(text: &str, source: &str, folder: &Path) -> Result<Self, InputError> {
        check_one_study(text, source)?;
        let syntax = |e: toml::de::Error| InputError::Syntax {
            file: source.to_owned(),
            reason: e.to_string().trim_end().to_owned(),
        };
        let mut suite: Self = toml::from_str(text).map_err(syntax)?;
        source.clone_into(&mut suite.source);
        let inlined = suite.robots.into_iter().map(|robot| robot.inlined(folder));
        suite.robots = inlined.collect::<Result<_, _>>()?;
        check_id(&suite.id, "id", source, "/")?;
        if suite.robots.is_empty() {
            return Err(InputError::value(source, "robots", "empty", "at least one"));
        }
        match &suite.study {
            Study::Grid(spec) => spec.check(source)?,
            Study::Continuity(spec) => spec.check(source)?,
            Study::Reach(spec) => spec.check(source)?,
        }
        Ok(suite)
    }
}

/// A table of studies holds one. Text that is no TOML, or has no such table, is left to the parser.
fn check_one_study(text: &str, source: &str) -> Result<(), InputError> {
    let table: toml::Table = text.parse().unwrap_or_default();
    let Some(study) = table.get("study").and_then(toml::Value::as_table) else {
        return Ok(());
    };
    let found = match study.len() {
        0 => "empty".to_owned(),
        1 => return Ok(()),
        _ => study.keys().cloned().collect::<Vec<_>>().join(", "),
    };
    let allowed = "exactly one of grid, continuity, reach";
    Err(InputError::value(source, "study", found, allowed))
}

/// Largest whole grid, number of draws, paths or cells of a slice, and of a study's poses per set: what fits into memory and
/// some minutes.
const MOST: usize = 1_000_000;
/// A turn and a little (rad).
const TURN_RAD: f64 = 6.3;
/// Largest number of cells along either axis: [`MOST`] cells.
const MOST_CELLS: usize = 1_000;
/// Poses of the off-axis grid are this far (degrees) at least from where indicators vanish: 0, 90, 180 and 270 degrees.
const BESIDE_DEG: f64 = 1.0;

fn within<T: PartialOrd + Display>(
    source: &str,
    field: &str,
    value: T,
    (least, most): (T, T),
) -> Result<(), InputError> {
    if (&least..=&most).contains(&&value) {
        return Ok(());
    }
    let allowed = format!("{least} to {most}");
    Err(InputError::value(source, field, value, &allowed))
}

/// Steps divide a full turn, in at least two parts and at most one per degree.
fn check_step(source: &str, field: &str, step_deg: f64) -> Result<(), InputError> {
    let parts = 360.0 / step_deg;
    if (2.0..=360.0).contains(&parts) && (parts - parts.round()).abs() < 1e-9 {
        return Ok(());
    }
    let allowed = "degrees that divide a full turn, from 1 to 180";
    Err(InputError::value(source, field, step_deg, allowed))
}

impl OffAxis {
    fn check(self, source: &str) -> Result<(), InputError> {
        let field = "study.grid.off_axis.offset_deg";
        check_step(source, "study.grid.off_axis.step_deg", self.step_deg)?;
        within(source, field, self.offset_deg, (-360.0, 360.0))?;
        let values =
            (0..(360.0 / self.step_deg).round() as usize).map(|i| self.offset_deg + self.step_deg * i as f64);
        let from_axis = |angle: f64| (angle - 90.0 * (angle / 90.0).round()).abs();
        match values.into_iter().find(|angle| from_axis(*angle) < BESIDE_DEG) {
            Some(_) => {
                let allowed = format!(
                    "an offset that keeps a grid of {} degrees at least {BESIDE_DEG} degree from all multiples of 90",
                    self.step_deg
                );
                Err(InputError::value(source, field, self.offset_deg, &allowed))
            }
            None => Ok(()),
        }
    }
}

impl GridSpec {
    fn check(&self, source: &str) -> Result<(), InputError> {
        if self.on_axis_deg.is_empty() {
            let field = "study.grid.on_axis_deg";
            return Err(InputError::value(source, field, "empty", "at least one step"));
        }
        for (i, step) in self.on_axis_deg.iter().enumerate() {
            check_step(source, &format!("study.grid.on_axis_deg[{i}]"), *step)?;
        }
        self.off_axis.check(source)?;
        for (name, counts) in [("full", &self.full), ("quick", &self.quick)] {
            let field = |of: &str| format!("study.grid.{name}.{of}");
            within(source, &field("whole_up_to"), counts.whole_up_to, (1, MOST))?;
            within(source, &field("sampled"), counts.sampled, (1, MOST))?;
            within(source, &field("random"), counts.random, (1, MOST))?;
            within(source, &field("timed"), counts.timed, (1, MOST))?;
        }
        Ok(())
    }
}

impl ContinuitySpec {
    fn check(&self, source: &str) -> Result<(), InputError> {
        let field = |of: &str| format!("study.continuity.{of}");
        for (name, value, most) in [
            ("half_width_rad", self.half_width_rad, 0.25),
            ("turn_rad", self.turn_rad, 1.5),
        ] {
            if !(value > 0.0 && value <= most) {
                let allowed = format!("above 0, up to {most}");
                return Err(InputError::value(source, &field(name), value, &allowed));
            }
        }
        for (name, counts) in [("full", &self.full), ("quick", &self.quick)] {
            within(source, &field(&format!("{name}.paths")), counts.paths, (1, MOST))?;
            // Every path has so many.
            let most = MOST / counts.paths;
            if counts.steps < 2 || counts.steps % 2 == 1 || counts.steps > most {
                let allowed = format!("an even number from 2 to {most}");
                let of = field(&format!("{name}.steps"));
                return Err(InputError::value(source, &of, counts.steps, &allowed));
            }
        }
        Ok(())
    }
}

impl ReachSpec {
    fn check(&self, source: &str) -> Result<(), InputError> {
        within(source, "study.reach.beyond", self.beyond, (0.01, 10.0))?;
        for (i, slice) in self.slices.iter().enumerate() {
            for (k, angle) in slice.rotation_rpy_rad.iter().enumerate() {
                let field = format!("study.reach.slices[{i}].rotation_rpy_rad[{k}]");
                within(source, &field, *angle, (-TURN_RAD, TURN_RAD))?;
            }
        }
        for (i, posture) in self.postures.iter().enumerate() {
            for (k, angle) in posture.joints_deg.iter().enumerate() {
                let field = format!("study.reach.postures[{i}].joints_deg[{k}]");
                within(source, &field, *angle, (-360.0, 360.0))?;
            }
        }
        for (name, counts) in [("full", &self.full), ("quick", &self.quick)] {
            let field = |of: &str| format!("study.reach.{name}.{of}");
            within(source, &field("distances"), counts.distances, (2, MOST))?;
            // Every orientation is tried at every distance.
            let most = MOST / counts.distances;
            within(source, &field("orientations"), counts.orientations, (1, most))?;
            within(source, &field("cells"), counts.cells, (2, MOST_CELLS))?;
        }
        Ok(())
    }
}
