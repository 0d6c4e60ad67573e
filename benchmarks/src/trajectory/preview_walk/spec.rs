//! How to walk, as it is written in a suite.

use super::preview_control::CartTable;
use crate::error::{InputError, finite, positive};
use crate::referee::Foot;
use crate::trajectory::samples::Grid;
use serde::{Deserialize, Serialize};

/// Most steps of a walk: beyond this a number is taken for a slip.
const MOST_STEPS: u32 = 1000;

/// How to walk: footsteps, timing, and the preview control of the zero-moment point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WalkSpec {
    /// The tasks that walk.
    #[serde(default)]
    pub tasks: WalkTasks,
    /// The foot that swings first.
    pub first_swing: Foot,
    /// Number of steps, the last of which closes the feet.
    pub steps: u32,
    /// How far ahead of the other foot a swing lands (m).
    pub step_m: f64,
    /// Distance of the feet across (m).
    pub foot_spacing_m: f64,
    /// Height of a swing (m).
    pub lift_m: f64,
    /// Duration of every double support, also the first and the last one (s).
    pub double_support_s: f64,
    /// Duration of every swing (s).
    pub single_support_s: f64,
    /// How long the zero-moment point rests before the first double support begins (s).
    #[serde(default)]
    pub initial_hold_s: f64,
    /// Height of the centre of mass over the ground (m).
    pub com_height_m: f64,
    /// The preview control.
    #[serde(default)]
    pub preview: PreviewSpec,
}

/// Names of the tasks that walk.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WalkTasks {
    /// Pose of the sole of the right foot.
    pub right_foot: String,
    /// Pose of the sole of the left foot.
    pub left_foot: String,
    /// The centre of mass.
    pub centre_of_mass: String,
    /// Positions or poses that keep their offset from the centre of mass.
    pub carried: Vec<String>,
}

impl Default for WalkTasks {
    fn default() -> Self {
        Self {
            right_foot: "right-foot".to_owned(),
            left_foot: "left-foot".to_owned(),
            centre_of_mass: "com".to_owned(),
            carried: ["right-hand", "left-hand"].map(str::to_owned).to_vec(),
        }
    }
}

impl WalkTasks {
    /// Two names of one task would move it twice.
    pub(super) fn check_distinct(&self, place: &str, field: &str) -> Result<(), InputError> {
        let feet = [&self.right_foot, &self.left_foot, &self.centre_of_mass];
        let names: Vec<&String> = feet.into_iter().chain(&self.carried).collect();
        match (1..names.len()).find(|&i| names[..i].contains(&names[i])) {
            Some(i) => Err(InputError::value(
                place,
                &format!("{field}.tasks"),
                format!("`{}` twice", names[i]),
                "names that differ",
            )),
            None => Ok(()),
        }
    }
}

/// The preview control: period, horizon and weights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PreviewSpec {
    /// Period of the controller (s), whatever the time step of the run.
    pub period_s: f64,
    /// How far ahead it knows the zero-moment point (s).
    pub horizon_s: f64,
    /// Q_e, on the error of the zero-moment point (1/m²).
    pub zmp_error_weight: f64,
    /// Q_x, on increments of position, velocity and acceleration.
    pub state_weight: f64,
    /// R, on increments of the jerk (s⁶/m²).
    pub jerk_weight: f64,
}

impl Default for PreviewSpec {
    fn default() -> Self {
        Self {
            period_s: 0.01,
            horizon_s: 1.6,
            zmp_error_weight: 1.0,
            state_weight: 0.0,
            jerk_weight: 1e-6,
        }
    }
}

impl WalkSpec {
    /// Checks every number; `place` and `field` go into the message, `grid` is that of the run.
    ///
    /// # Errors
    /// The first number that cannot be, with what is allowed.
    pub(super) fn check(&self, grid: Grid, place: &str, field: &str) -> Result<(), InputError> {
        let fail = |name: &str, found: f64, allowed: &str| {
            Err(InputError::value(
                place,
                &format!("{field}.{name}"),
                found,
                allowed,
            ))
        };
        if !(1..=MOST_STEPS).contains(&self.steps) {
            return fail("steps", f64::from(self.steps), &format!("1 to {MOST_STEPS}"));
        }
        finite(place, &format!("{field}.step_m"), self.step_m)?;
        for (name, value) in [
            ("foot_spacing_m", self.foot_spacing_m),
            ("lift_m", self.lift_m),
            ("com_height_m", self.com_height_m),
        ] {
            positive(place, &format!("{field}.{name}"), value)?;
        }
        for (name, value) in [
            ("double_support_s", self.double_support_s),
            ("single_support_s", self.single_support_s),
        ] {
            if !(value.is_finite() && value >= grid.dt_s) {
                let allowed = format!("a finite number, at least dt_s = {}", grid.dt_s);
                return fail(name, value, &allowed);
            }
        }
        if !(self.initial_hold_s.is_finite() && self.initial_hold_s >= 0.0) {
            return fail(
                "initial_hold_s",
                self.initial_hold_s,
                "a finite number, not negative",
            );
        }
        self.preview
            .check(grid.time(grid.steps), place, &format!("{field}.preview"))
    }

    pub(super) fn cart(&self) -> CartTable {
        CartTable {
            dt_s: self.preview.period_s,
            height_m: self.com_height_m,
            zmp_error_weight: self.preview.zmp_error_weight,
            state_weight: self.preview.state_weight,
            jerk_weight: self.preview.jerk_weight,
        }
    }
}

impl PreviewSpec {
    fn check(&self, duration_s: f64, place: &str, field: &str) -> Result<(), InputError> {
        for (name, value) in [
            ("period_s", self.period_s),
            ("zmp_error_weight", self.zmp_error_weight),
            ("jerk_weight", self.jerk_weight),
        ] {
            positive(place, &format!("{field}.{name}"), value)?;
        }
        let fail = |name: &str, found: f64, allowed: &str| {
            Err(InputError::value(
                place,
                &format!("{field}.{name}"),
                found,
                allowed,
            ))
        };
        if !(self.state_weight.is_finite() && self.state_weight >= 0.0) {
            return fail("state_weight", self.state_weight, "a finite number, not negative");
        }
        if !(self.horizon_s >= self.period_s && self.horizon_s <= duration_s) {
            let allowed = format!(
                "at least period_s = {} and at most the duration of the motion, {duration_s} s",
                self.period_s
            );
            return fail("horizon_s", self.horizon_s, &allowed);
        }
        // The controller runs over the whole motion; its period bounds how many samples that are.
        Grid::new(
            self.period_s,
            duration_s,
            self.horizon_s,
            &format!("{place}: {field}"),
        )
        .map(|_| ())
    }

    /// N, the samples of the preview.
    pub(super) fn samples(&self) -> usize {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "checked to be 1 .. 1e6"
        )]
        let samples = (self.horizon_s / self.period_s).round() as usize;
        samples
    }
}
