//! How to walk, as it is written in a suite.

use crate::error::{InputError, finite, positive};
use ik_core::problem::Problem;
use serde::{Deserialize, Serialize};

/// Most steps of a walk: beyond this a number is taken for a slip.
const MOST_STEPS: u32 = 1000;

/// How to walk. What is not given is as in the source, or where that is silent as chosen for the suites.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GaitSpec {
    /// The tasks that walk.
    pub tasks: GaitTasks,
    /// Number of steps; the right foot swings first.
    pub steps: u32,
    /// Duration of one step, Tc (s). Chosen: the source gives none.
    pub step_period_s: f64,
    /// What a foot advances in one swing, Step (m).
    pub step_m: f64,
    /// Lead of the left foot at the start, Stepini (m).
    pub initial_step_m: f64,
    /// Height of a swing, Zmax (m).
    pub lift_m: f64,
    /// Part of a step after which the foot leaves the ground.
    pub lift_fraction: f64,
    /// Part of a step after which it is back.
    pub land_fraction: f64,
    /// Knots of the height between lifting and the middle of the step; mirrored before landing.
    pub height_knots: Vec<HeightKnot>,
    /// x of the waist at the start (m); without it half of `initial_step_m`, the middle of the feet.
    pub waist_start_m: Option<f64>,
    /// What the waist advances from each of its four knots per step to the next, ΔXhip (m); without it an eighth of
    /// `step_m`, which keeps it between the feet.
    pub waist_increment_m: Option<f64>,
    /// Distance of the waist from the middle line towards the standing foot at 0 and 1, at 0.1 and 0.9 and at 0.5 of a
    /// step, Yhip1 … Yhip3 (m).
    pub sway_m: [f64; 3],
    /// Height of the waist over the ground (m). Chosen: the source gives none.
    pub waist_height_m: f64,
    /// Swing of a hand to the front and back of its shoulder, Xmax of the arms (m).
    pub hand_swing_m: f64,
    /// What a hand rises at the ends of its swing, Zmax of the arms (m).
    pub hand_lift_m: f64,
    /// Depth of a hand below its shoulder in the middle of its swing (m). Chosen: the source gives none.
    pub hand_drop_m: f64,
}

/// Names of the tasks that walk. A hand of the default name swings if the problem has such a task.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GaitTasks {
    /// Pose of the sole of the right foot.
    pub right_foot: String,
    /// Pose of the sole of the left foot.
    pub left_foot: String,
    /// Pose of a frame of the root body.
    pub waist: String,
    /// Position of the right hand, if it swings.
    pub right_hand: Option<String>,
    /// Position of the left hand, if it swings.
    pub left_hand: Option<String>,
}

/// A knot of the height of a swinging foot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeightKnot {
    /// Time since lifting, and before landing (s).
    pub after_s: f64,
    /// Part of `lift_m`.
    pub share: f64,
}

impl Default for GaitSpec {
    fn default() -> Self {
        Self {
            tasks: GaitTasks::default(),
            steps: 4,
            step_period_s: 2.0,
            step_m: 0.2,
            initial_step_m: 0.1,
            lift_m: 0.03,
            lift_fraction: 0.1,
            land_fraction: 0.89,
            height_knots: [(0.03, 0.1), (0.08, 0.3)]
                .map(|(after_s, share)| HeightKnot { after_s, share })
                .to_vec(),
            waist_start_m: None,
            waist_increment_m: None,
            sway_m: [0.0, 0.027, 0.042],
            waist_height_m: 0.155,
            hand_swing_m: 0.03,
            hand_lift_m: 0.0187,
            hand_drop_m: 0.1,
        }
    }
}

impl Default for GaitTasks {
    fn default() -> Self {
        Self {
            right_foot: "right-foot".to_owned(),
            left_foot: "left-foot".to_owned(),
            waist: "waist".to_owned(),
            right_hand: Some("right-hand".to_owned()),
            left_hand: Some("left-hand".to_owned()),
        }
    }
}

impl GaitTasks {
    /// The same without hands that are there by default only and that the problem does not have.
    pub(super) fn of(&self, problem: &Problem) -> Self {
        let (mut tasks, default) = (self.clone(), Self::default());
        let lacks = |hand: &Option<String>| {
            problem
                .tasks()
                .iter()
                .all(|task| Some(&task.name) != hand.as_ref())
        };
        if tasks.right_hand == default.right_hand && lacks(&tasks.right_hand) {
            tasks.right_hand = None;
        }
        if tasks.left_hand == default.left_hand && lacks(&tasks.left_hand) {
            tasks.left_hand = None;
        }
        tasks
    }
}

impl GaitSpec {
    /// Checks every number; `place` and `field` go into the message.
    ///
    /// # Errors
    /// The first number that cannot be, with what is allowed.
    pub(super) fn check(&self, place: &str, field: &str) -> Result<(), InputError> {
        self.check_lengths(place, field)?;
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
        if !(self.lift_fraction > 0.0 && self.lift_fraction < 0.5) {
            return fail("lift_fraction", self.lift_fraction, "above 0 and below 0.5");
        }
        if !(self.land_fraction > 0.5 && self.land_fraction < 1.0) {
            return fail("land_fraction", self.land_fraction, "above 0.5 and below 1");
        }
        let rise = (0.5 - self.lift_fraction).min(self.land_fraction - 0.5);
        let mut before = 0.0;
        for (i, knot) in self.height_knots.iter().enumerate() {
            finite(place, &format!("{field}.height_knots[{i}].share"), knot.share)?;
            if !(knot.after_s > before && knot.after_s < rise * self.step_period_s) {
                let allowed = format!(
                    "above {before} and below {} = {rise:.3} step_period_s, the middle of the swing",
                    rise * self.step_period_s
                );
                return fail(&format!("height_knots[{i}].after_s"), knot.after_s, &allowed);
            }
            before = knot.after_s;
        }
        Ok(())
    }

    fn check_lengths(&self, place: &str, field: &str) -> Result<(), InputError> {
        for (name, value) in [
            ("step_period_s", self.step_period_s),
            ("lift_m", self.lift_m),
            ("waist_height_m", self.waist_height_m),
        ] {
            positive(place, &format!("{field}.{name}"), value)?;
        }
        for (name, value) in [
            ("step_m", self.step_m),
            ("initial_step_m", self.initial_step_m),
            ("waist_start_m", self.waist_start_m()),
            ("waist_increment_m", self.waist_increment_m()),
            ("sway_m[0]", self.sway_m[0]),
            ("sway_m[1]", self.sway_m[1]),
            ("sway_m[2]", self.sway_m[2]),
            ("hand_swing_m", self.hand_swing_m),
            ("hand_lift_m", self.hand_lift_m),
            ("hand_drop_m", self.hand_drop_m),
        ] {
            finite(place, &format!("{field}.{name}"), value)?;
        }
        Ok(())
    }

    pub(super) fn waist_start_m(&self) -> f64 {
        self.waist_start_m.unwrap_or(self.initial_step_m / 2.0)
    }

    pub(super) fn waist_increment_m(&self) -> f64 {
        self.waist_increment_m.unwrap_or(self.step_m / 8.0)
    }
}
