//! A walk by preview control: planned footsteps, feet of minimum jerk, a zero-moment point that goes from foot to foot, and the
//! motion of the centre of mass that puts it there; hands keep their place beside the centre of mass.
//!
//! This is the chain of motion generation that stands before the inverse kinematics of the humanoid Melson: planner, trajectories,
//! centre of mass. Nothing in it knows a robot. Feet walk on the ground z = 0 along x with the axes of the world, the centre of mass
//! stays at one height. Equations: `plan.rs`, `preview_control.rs`.

mod plan;
mod preview_control;
mod spec;
#[cfg(test)]
mod tests;

pub use plan::{Plan, Step};
pub use preview_control::{CartTable, NoGains, PreviewControl};
pub use spec::{PreviewSpec, WalkSpec, WalkTasks};

use super::gait::Support;
use super::samples::Grid;
use super::task_finder::TaskFinder;
use crate::error::InputError;
use crate::referee::Foot;
use ik_core::problem::{PhaseId, Problem};
use ik_core::robot::FrameId;
use ik_core::task::Track;
use nalgebra::Vector3;

/// A walk in the rows of a problem's tasks.
#[derive(Clone, Debug)]
pub struct PreviewWalk {
    /// How it walks.
    pub spec: WalkSpec,
    /// Its steps.
    pub plan: Plan,
    /// How far the centre of mass is known (s): to the end of the motion and of what may be seen beyond it.
    pub until_s: f64,
    centre_of_mass: CentreOfMass,
    /// First rows of the tasks of the feet, right and left.
    foot_rows: [usize; 2],
    com_row: usize,
    carried: Vec<Carried>,
    /// Phases in which the robot hangs on the right and on the left foot.
    phases: [PhaseId; 2],
}

/// A task whose position keeps its offset from the centre of mass.
#[derive(Clone, Debug)]
struct Carried {
    row: usize,
    offset: Vector3<f64>,
}

/// The motion of the centre of mass: cubic in time within each period of the controller.
#[derive(Clone, Debug)]
struct CentreOfMass {
    cart: CartTable,
    /// For x and y: state and jerk at the beginning of each period.
    axes: [Vec<(Vector3<f64>, f64)>; 2],
}

impl CentreOfMass {
    /// The motion under the reference of `plan` for `duration_s`.
    fn new(spec: &WalkSpec, plan: &Plan, duration_s: f64) -> Result<Self, NoGains> {
        let cart = spec.cart();
        let control = PreviewControl::new(cart, spec.preview.samples())?;
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "checked to be 1 .. 1e6"
        )]
        let reference = |axis: usize| -> Vec<f64> {
            let last = (duration_s / cart.dt_s).ceil() as usize;
            (0..=last + spec.preview.samples())
                .map(|k| plan.zmp_m(k as f64 * cart.dt_s)[axis])
                .collect()
        };
        Ok(Self {
            cart,
            axes: [0, 1].map(|axis| control.follow(&reference(axis))),
        })
    }

    /// Position, velocity and acceleration along an axis (x: 0, y: 1) at `t` (s).
    fn at(&self, axis: usize, t: f64) -> Vector3<f64> {
        let motion = &self.axes[axis];
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "as many periods as there are samples, 1e6 at most"
        )]
        let (k, tau_s) = {
            // A time at the end of a period, whatever it was rounded to, is the beginning of the next one.
            let k = ((t / self.cart.dt_s + 1e-9).floor().max(0.0) as usize).min(motion.len() - 1);
            (k, t - k as f64 * self.cart.dt_s)
        };
        let (state, jerk) = &motion[k];
        self.cart.after(state, *jerk, tau_s)
    }
}

impl PreviewWalk {
    /// Puts the walk of `spec` into the rows of `problem`, whose tasks have the `values` at the start (plain coordinates, one
    /// per row); `grid` is that of the run, `place` and `field` (the path of the table) go into messages.
    ///
    /// # Errors
    /// A number that cannot be, a task that is unknown or tracks something else, supports that are not the feet.
    pub fn new(
        spec: &WalkSpec,
        problem: &Problem,
        values: &[f64],
        grid: Grid,
        place: &str,
        field: &str,
    ) -> Result<Self, InputError> {
        spec.check(grid, place, field)?;
        spec.tasks.check_distinct(place, field)?;
        let plan = Plan::new(spec);
        let until_s = grid.time(grid.steps + grid.preview);
        let centre_of_mass = CentreOfMass::new(spec, &plan, until_s).map_err(|e| {
            InputError::value(
                place,
                &format!("{field}.preview"),
                e,
                "weights nearer to each other",
            )
        })?;
        let finder = TaskFinder {
            problem,
            place,
            field,
        };
        let (right, right_frame) = finder.foot("right_foot", &spec.tasks.right_foot)?;
        let (left, left_frame) = finder.foot("left_foot", &spec.tasks.left_foot)?;
        let com_row = finder.centre_of_mass(&spec.tasks.centre_of_mass)?;
        let com = Vector3::from_column_slice(&values[com_row..com_row + 3]);
        let mut carried = Vec::new();
        for name in &spec.tasks.carried {
            if let Some(row) = finder.carried(name)? {
                let offset = Vector3::from_column_slice(&values[row..row + 3]) - com;
                carried.push(Carried { row, offset });
            }
        }
        Ok(Self {
            spec: spec.clone(),
            plan,
            until_s,
            centre_of_mass,
            foot_rows: [right, left],
            com_row,
            carried,
            phases: finder.phases([right_frame, left_frame])?,
        })
    }

    /// Which feet are on the ground at `t` (s).
    pub fn support(&self, t: f64) -> Support {
        self.plan.support(t)
    }

    /// The phase of the problem at `t` (s): that of the foot the robot hangs on.
    pub fn phase(&self, t: f64) -> PhaseId {
        match self.plan.carrier(t) {
            Foot::Right => self.phases[0],
            Foot::Left => self.phases[1],
        }
    }

    /// Position, velocity and acceleration of the centre of mass along x and y at `t` (s).
    pub fn com(&self, t: f64) -> [Vector3<f64>; 2] {
        [0, 1].map(|axis| self.centre_of_mass.at(axis, t))
    }

    /// Whether the walk prescribes this task row.
    pub(super) fn moves(&self, row: usize) -> bool {
        let foot = |first: &usize| (*first..first + 6).contains(&row);
        let point = |first: usize| (first..first + 3).contains(&row);
        self.foot_rows.iter().any(foot) || point(self.com_row) || self.carried.iter().any(|c| point(c.row))
    }

    /// Writes the values at `t` (s) of the rows the walk prescribes.
    pub(super) fn value_into(&self, t: f64, out: &mut [f64]) {
        for (row, foot) in self.feet() {
            let motion = self.plan.foot(foot, t);
            let pose = [motion.x, self.plan.y_m(foot), motion.z, 0.0, 0.0, 0.0];
            out[row..row + 6].copy_from_slice(&pose);
        }
        let [x, y] = self.com(t);
        let com = Vector3::new(x[0], y[0], self.spec.com_height_m);
        out[self.com_row..self.com_row + 3].copy_from_slice(com.as_slice());
        for c in &self.carried {
            out[c.row..c.row + 3].copy_from_slice((com + c.offset).as_slice());
        }
    }

    /// Writes their exact time derivatives.
    pub(super) fn rate_into(&self, t: f64, out: &mut [f64]) {
        for (row, foot) in self.feet() {
            let motion = self.plan.foot(foot, t);
            let rates = [motion.x_rate, 0.0, motion.z_rate, 0.0, 0.0, 0.0];
            out[row..row + 6].copy_from_slice(&rates);
        }
        let [x, y] = self.com(t);
        for row in std::iter::once(self.com_row).chain(self.carried.iter().map(|c| c.row)) {
            out[row..row + 3].copy_from_slice(&[x[1], y[1], 0.0]);
        }
    }

    fn feet(&self) -> [(usize, Foot); 2] {
        let [right, left] = self.foot_rows;
        [(right, Foot::Right), (left, Foot::Left)]
    }
}

impl TaskFinder<'_> {
    /// First row and frame of a foot.
    fn foot(&self, key: &str, name: &str) -> Result<(usize, FrameId), InputError> {
        let task = self.task(key, name)?;
        match self.problem.tasks()[task].track {
            Track::Pose(frame) => Ok((self.problem.slots()[task].xdot, frame)),
            _ => Err(self.wrong(key, name, "a task that tracks a pose")),
        }
    }

    fn centre_of_mass(&self, name: &str) -> Result<usize, InputError> {
        let task = self.task("centre_of_mass", name)?;
        match self.problem.tasks()[task].track {
            Track::CentreOfMass => Ok(self.problem.slots()[task].xdot),
            _ => Err(self.wrong("centre_of_mass", name, "a task that tracks the centre of mass")),
        }
    }

    /// First row of a task that is carried; none if it is a default name and the problem has no such task.
    fn carried(&self, name: &str) -> Result<Option<usize>, InputError> {
        let tasks = self.problem.tasks();
        let by_default = WalkTasks::default().carried.iter().any(|n| n == name);
        if by_default && tasks.iter().all(|task| task.name != name) {
            return Ok(None);
        }
        let task = self.task("carried", name)?;
        match tasks[task].track {
            Track::Position(_) | Track::Pose(_) => Ok(Some(self.problem.slots()[task].xdot)),
            _ => Err(self.wrong("carried", name, "a task that tracks a position or a pose")),
        }
    }

    /// The phases that hang the robot on each of the feet; the only one there is if the problem names no supports.
    fn phases(&self, feet: [FrameId; 2]) -> Result<[PhaseId; 2], InputError> {
        let phases = self.problem.phases();
        if phases.iter().all(|phase| phase.support.is_none()) {
            return Ok([PhaseId(0); 2]);
        }
        let of = |foot: FrameId| {
            let found = phases.iter().position(|phase| phase.support == Some(foot));
            found.map(PhaseId).ok_or_else(|| {
                let name = &self.problem.robot().frames()[foot.0].name;
                let found = format!("without `{name}`");
                let allowed = "the frames of both feet, or no supports";
                InputError::value(self.place, "problem.supports", found, allowed)
            })
        };
        Ok([of(feet[0])?, of(feet[1])?])
    }
}
