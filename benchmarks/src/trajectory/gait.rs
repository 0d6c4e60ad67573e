//! A walk from geometric constraints: knots for feet, waist and hands, joined by cubic splines.
//!
//! Source: the gait of a paper that models a Bioloid humanoid with screws, Assur virtual chains and Davies' method, its
//! section 4, eqs. (16)–(24). Several of them cannot be meant as printed; [`Walk`] marks what is read otherwise, and tests
//! show what the printed forms do. Where the paper is silent: feet and hands follow one spline per swing, at rest at its
//! ends; the waist follows one spline through all knots of the walk; its height and all orientations are constant.
//!
//! A [`GaitSpec`] says how to walk, a [`Walk`] holds the curves, a [`Gait`] puts them into the rows of a problem's tasks:
//! feet on the ground z = 0, as far apart as with all joints at zero, hands below the first joints of the arms. Nothing
//! in it knows a robot; before a run every distance that is prescribed between the two ends of a limb is compared with
//! what the limb can span.

mod limb;
mod spec;
#[cfg(test)]
mod tests;
mod walk;

pub use spec::{GaitSpec, GaitTasks, HeightKnot};
pub use walk::{Swing, Walk};

use super::spline::Curve;
use super::task_finder::TaskFinder;
use crate::error::InputError;
use ik_core::problem::Problem;
use limb::{Limb, Waist};

/// Slack of a phase at the ends of a swing, so that a sample at 0.1 Tc counts as standing whatever it was rounded to.
const PHASE_SLACK: f64 = 1e-9;

/// Which feet carry the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// Both stand.
    Both,
    /// The right foot stands, the left one swings.
    Right,
    /// The left foot stands, the right one swings.
    Left,
}

/// A walk in the rows of a problem's tasks.
#[derive(Clone, Debug)]
pub struct Gait {
    /// How it walks.
    pub spec: GaitSpec,
    /// The curves.
    pub walk: Walk,
    rows: Vec<GaitRow>,
    waist: Waist,
    /// Right, left.
    legs: [Limb; 2],
    arms: [Option<Limb>; 2],
}

/// The sum of a constant and curves in one task row.
#[derive(Clone, Debug)]
struct GaitRow {
    row: usize,
    offset: f64,
    curves: Vec<Curve>,
}

impl Gait {
    /// Puts the walk of `spec` into the rows of `problem`; `place` and `field` (the path of the table) go into messages.
    ///
    /// # Errors
    /// A number that cannot be, a task that is unknown, tracks something else or is no limb of the waist.
    pub fn new(spec: &GaitSpec, problem: &Problem, place: &str, field: &str) -> Result<Self, InputError> {
        spec.check(place, field)?;
        let walk = Walk::new(spec)
            .map_err(|e| InputError::value(place, field, e, "numbers that a spline can pass through"))?;
        let finder = TaskFinder {
            problem,
            place,
            field,
        };
        let names = spec.tasks.of(problem);
        let waist = finder.waist(&names.waist)?;
        let legs = [
            finder.leg("right_foot", &names.right_foot, &waist)?,
            finder.leg("left_foot", &names.left_foot, &waist)?,
        ];
        let arms = [
            finder.arm("right_hand", names.right_hand.as_deref(), &waist)?,
            finder.arm("left_hand", names.left_hand.as_deref(), &waist)?,
        ];
        let rows = rows(spec, &walk, &waist, &legs, &arms);
        check_distinct(&rows, problem, place, field)?;
        if legs[0].rest.y >= legs[1].rest.y {
            let field = format!("{field}.tasks.right_foot");
            let found = format!("`{}`, left of `{}`", names.right_foot, names.left_foot);
            return Err(InputError::value(
                place,
                &field,
                found,
                "the foot with the smaller y at the zero pose",
            ));
        }
        Ok(Self {
            spec: spec.clone(),
            walk,
            rows,
            waist,
            legs,
            arms,
        })
    }

    /// Duration of the walk (s); afterwards everything stands still.
    pub fn duration_s(&self) -> f64 {
        f64::from(self.spec.steps) * self.spec.step_period_s
    }

    /// Which feet carry the robot at `t` (s).
    pub fn support(&self, t: f64) -> Support {
        let step = (t / self.spec.step_period_s + PHASE_SLACK).floor();
        let phase = t / self.spec.step_period_s - step;
        let swinging =
            phase > self.spec.lift_fraction + PHASE_SLACK && phase < self.spec.land_fraction - PHASE_SLACK;
        if !swinging || step < 0.0 || step >= f64::from(self.spec.steps) {
            Support::Both
        } else if step % 2.0 < 0.5 {
            Support::Left
        } else {
            Support::Right
        }
    }

    /// Whether the walk prescribes this task row.
    pub(super) fn moves(&self, row: usize) -> bool {
        self.rows.iter().any(|r| r.row == row)
    }

    /// Writes the values at `t` (s) of the rows the walk prescribes.
    pub(super) fn value_into(&self, t: f64, out: &mut [f64]) {
        for r in &self.rows {
            out[r.row] = r.offset + r.curves.iter().map(|c| c.value(t)).sum::<f64>();
        }
    }

    /// Writes their exact time derivatives.
    pub(super) fn rate_into(&self, t: f64, out: &mut [f64]) {
        for r in &self.rows {
            out[r.row] = r.curves.iter().map(|c| c.rate(t)).sum();
        }
    }
}

/// What every prescribed task row follows.
fn rows(
    spec: &GaitSpec,
    walk: &Walk,
    waist: &Waist,
    legs: &[Limb; 2],
    arms: &[Option<Limb>; 2],
) -> Vec<GaitRow> {
    let mut rows = waist_rows(waist, walk, spec);
    for (leg, swing) in legs.iter().zip([&walk.right_foot, &walk.left_foot]) {
        rows.extend(foot_rows(leg, swing));
    }
    for (arm, swing) in arms.iter().zip([&walk.right_hand, &walk.left_hand]) {
        rows.extend(arm.iter().flat_map(|arm| hand_rows(arm, swing, walk, spec)));
    }
    rows
}

/// A pose at `position` with the axes of the world.
fn pose_rows(first: usize, position: [(f64, Vec<Curve>); 3]) -> Vec<GaitRow> {
    let upright = [(); 3].map(|()| (0.0, Vec::new()));
    let sums = position.into_iter().chain(upright).enumerate();
    sums.map(|(i, (offset, curves))| GaitRow {
        row: first + i,
        offset,
        curves,
    })
    .collect()
}

fn waist_rows(waist: &Waist, walk: &Walk, spec: &GaitSpec) -> Vec<GaitRow> {
    let (x, y) = (walk.waist_x.clone(), walk.waist_y.clone());
    pose_rows(
        waist.row,
        [(0.0, vec![x]), (0.0, vec![y]), (spec.waist_height_m, Vec::new())],
    )
}

/// A foot goes straight ahead, as far beside the waist as with all joints at zero.
fn foot_rows(leg: &Limb, swing: &Swing) -> Vec<GaitRow> {
    let (x, z) = (swing.x.clone(), swing.z.clone());
    pose_rows(
        leg.row,
        [(0.0, vec![x]), (leg.rest.y, Vec::new()), (0.0, vec![z])],
    )
}

/// A hand swings below the first joint of its arm, which goes with the waist.
fn hand_rows(arm: &Limb, swing: &Swing, walk: &Walk, spec: &GaitSpec) -> Vec<GaitRow> {
    let x = vec![walk.waist_x.clone(), swing.x.clone()];
    let y = vec![walk.waist_y.clone()];
    let z = spec.waist_height_m + arm.origin.z - spec.hand_drop_m;
    let mut rows = pose_rows(
        arm.row,
        [(arm.origin.x, x), (arm.origin.y, y), (z, vec![swing.z.clone()])],
    );
    rows.truncate(3);
    rows
}

/// Two names of one task would move it twice.
fn check_distinct(rows: &[GaitRow], problem: &Problem, place: &str, field: &str) -> Result<(), InputError> {
    let twice = |i: usize| rows[..i].iter().any(|other| other.row == rows[i].row);
    let Some(i) = (0..rows.len()).find(|&i| twice(i)) else {
        return Ok(());
    };
    let slot = problem.slots().iter().position(|s| s.xdot == rows[i].row);
    let name = slot.map_or("", |task| problem.tasks()[task].name.as_str());
    let found = format!("`{name}` twice");
    Err(InputError::value(
        place,
        &format!("{field}.tasks"),
        found,
        "names that differ",
    ))
}
