//! A trajectory: the values of all tasks at the start configuration plus the terms of a motion.
//!
//! Values are kept in *plain* coordinates, one number per task row, orientations as roll, pitch and yaw: terms act on
//! single components, and the rates of the components are exact. How the problem writes orientations matters only when
//! a trajectory is sampled.

use super::gait::{Gait, Support};
use super::preview_walk::PreviewWalk;
use super::samples::Grid;
use super::shape::Shape;
use crate::error::{InputError, finite};
use ik_core::kinematics::{Page, forward};
use ik_core::problem::{PhaseId, Problem};
use ik_core::robot::{FrameId, Robot};
use ik_core::spatial::rpy;
use ik_core::task::Track;
use serde::{Deserialize, Serialize};

/// One term of a scenario's motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionSpec {
    /// Name of the task.
    pub task: String,
    /// Name of the component: `x y z`, `roll pitch yaw`, or a joint of a posture.
    pub component: String,
    /// The function of time.
    pub shape: Shape,
    /// When its time starts (s); before that it contributes nothing.
    #[serde(default)]
    pub from_s: f64,
    /// When it ends (s), itself excluded; from then on it contributes nothing. Without it, it never ends.
    #[serde(default)]
    pub until_s: Option<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Term {
    row: usize,
    shape: Shape,
    from_s: f64,
    until_s: f64,
}

/// Targets of all tasks as functions of time, in plain coordinates.
#[derive(Clone, Debug)]
pub struct Trajectory {
    base: Vec<f64>,
    pub(super) locomotion: Option<Locomotion>,
    terms: Vec<Term>,
}

/// What makes the feet go, where they do: a source of all rows of several tasks.
#[derive(Clone, Debug)]
pub enum Locomotion {
    /// Splines through knots.
    Gait(Box<Gait>),
    /// Footsteps and preview control.
    Walk(Box<PreviewWalk>),
}

impl Locomotion {
    fn moves(&self, row: usize) -> bool {
        match self {
            Self::Gait(gait) => gait.moves(row),
            Self::Walk(walk) => walk.moves(row),
        }
    }

    fn support(&self, t: f64) -> Support {
        match self {
            Self::Gait(gait) => gait.support(t),
            Self::Walk(walk) => walk.support(t),
        }
    }

    fn value_into(&self, t: f64, out: &mut [f64]) {
        match self {
            Self::Gait(gait) => gait.value_into(t, out),
            Self::Walk(walk) => walk.value_into(t, out),
        }
    }

    fn rate_into(&self, t: f64, out: &mut [f64]) {
        match self {
            Self::Gait(gait) => gait.rate_into(t, out),
            Self::Walk(walk) => walk.rate_into(t, out),
        }
    }
}

impl Trajectory {
    /// The motion of a robot that starts at `q_start` (length nq): gait or walk, elsewhere the values at the start, and the
    /// terms on top of both. `place` and `field` (the path of the list of terms) go into messages.
    ///
    /// # Errors
    /// An unknown task or component, a number that cannot be, two constants for one component.
    pub fn new(
        problem: &Problem,
        q_start: &[f64],
        locomotion: Option<Locomotion>,
        motion: &[MotionSpec],
        place: &str,
        field: &str,
    ) -> Result<Self, InputError> {
        let mut base = task_values(problem, q_start);
        let (mut terms, mut held) = (Vec::new(), Vec::new());
        for (i, spec) in motion.iter().enumerate() {
            let field = format!("{field}[{i}]");
            let term = term(problem, spec, place, &field)?;
            let Shape::Hold { value } = spec.shape else {
                terms.push(term);
                continue;
            };
            if locomotion.as_ref().is_some_and(|walk| walk.moves(term.row)) {
                let found = "a hold on what the gait or walk moves";
                return Err(InputError::value(place, &field, found, "any other shape"));
            }
            if held.contains(&term.row) {
                return Err(InputError::value(
                    place,
                    &field,
                    "a second hold",
                    "one hold per component",
                ));
            }
            held.push(term.row);
            base[term.row] = value;
        }
        Ok(Self {
            base,
            locomotion,
            terms,
        })
    }

    /// The gait in it.
    pub fn gait(&self) -> Option<&Gait> {
        match &self.locomotion {
            Some(Locomotion::Gait(gait)) => Some(gait),
            _ => None,
        }
    }

    /// The walk by preview control in it.
    pub fn walk(&self) -> Option<&PreviewWalk> {
        match &self.locomotion {
            Some(Locomotion::Walk(walk)) => Some(walk),
            _ => None,
        }
    }

    /// Which feet carry the robot at the samples k = 0 … N: both without a walk.
    pub fn support(&self, grid: Grid) -> Vec<Support> {
        let at = |k| match &self.locomotion {
            Some(walk) => walk.support(grid.time(k)),
            None => Support::Both,
        };
        (0..=grid.steps).map(at).collect()
    }

    /// The phase of each step k = 1 … N: the step from k − 1 to k is made in the phase of its beginning, so that a robot hangs
    /// on one foot from the first sample of a step to the last.
    pub fn phases(&self, grid: Grid) -> Vec<PhaseId> {
        let at = |k| match self.walk() {
            Some(walk) => walk.phase(grid.time(k)),
            None => PhaseId(0),
        };
        (0..grid.steps).map(at).collect()
    }

    /// Checks that every limb of the walk reaches its targets at all samples; `place` and `field` (the path of the walk)
    /// go into the message.
    ///
    /// # Errors
    /// The limb and the time that miss most, by how much, and what to change.
    pub fn check_reach(&self, grid: Grid, place: &str, field: &str) -> Result<(), InputError> {
        let Some(gait) = self.gait() else {
            return Ok(());
        };
        let times = (0..=grid.steps + grid.preview).map(|k| grid.time(k));
        gait.check_reach(self, times, place, field)
    }

    /// Number of task rows.
    pub(super) fn rows(&self) -> usize {
        self.base.len()
    }

    /// Writes the values at `t` (s), one per task row (m, or rad with orientations as roll, pitch, yaw).
    pub fn value_into(&self, t: f64, out: &mut [f64]) {
        out.copy_from_slice(&self.base);
        if let Some(walk) = &self.locomotion {
            walk.value_into(t, out);
        }
        for term in self.active(t) {
            out[term.row] += term.shape.value(t - term.from_s);
        }
    }

    /// Writes the exact time derivatives of the values at `t` (s).
    pub fn rate_into(&self, t: f64, out: &mut [f64]) {
        out.fill(0.0);
        if let Some(walk) = &self.locomotion {
            walk.rate_into(t, out);
        }
        for term in self.active(t) {
            out[term.row] += term.shape.rate(t - term.from_s);
        }
    }

    fn active(&self, t: f64) -> impl Iterator<Item = &Term> {
        self.terms
            .iter()
            .filter(move |term| term.from_s <= t && t < term.until_s)
    }
}

fn term(problem: &Problem, spec: &MotionSpec, place: &str, field: &str) -> Result<Term, InputError> {
    let tasks = problem.tasks();
    let Some(index) = tasks.iter().position(|t| t.name == spec.task) else {
        let place = format!("{place}: {field}.task");
        return Err(InputError::unknown(
            &place,
            "task",
            &spec.task,
            tasks.iter().map(|t| &t.name),
        ));
    };
    let names = component_names(problem.robot(), &tasks[index].track);
    let Some(component) = names.iter().position(|n| *n == spec.component) else {
        let place = format!("{place}: {field}.component");
        return Err(InputError::unknown(&place, "component", &spec.component, names));
    };
    spec.shape.check(place, &format!("{field}.shape"))?;
    finite(place, &format!("{field}.from_s"), spec.from_s)?;
    let until_s = spec.until_s.unwrap_or(f64::INFINITY);
    let windowed = spec.from_s > 0.0 || spec.until_s.is_some();
    if windowed && matches!(spec.shape, Shape::Hold { .. }) {
        return Err(InputError::value(
            place,
            field,
            "a hold with from_s or until_s",
            "a hold for the whole motion",
        ));
    }
    if until_s.is_nan() || until_s <= spec.from_s {
        let allowed = format!("a number above from_s = {}", spec.from_s);
        return Err(InputError::value(
            place,
            &format!("{field}.until_s"),
            until_s,
            &allowed,
        ));
    }
    Ok(Term {
        row: problem.slots()[index].xdot + component,
        shape: spec.shape,
        from_s: spec.from_s,
        until_s,
    })
}

/// Names of the rows of a task, in their order.
fn component_names<'a>(robot: &'a Robot, track: &Track) -> Vec<&'a str> {
    match track {
        Track::Position(_) | Track::CentreOfMass => vec!["x", "y", "z"],
        Track::Orientation(_) => vec!["roll", "pitch", "yaw"],
        Track::Pose(_) => vec!["x", "y", "z", "roll", "pitch", "yaw"],
        Track::Posture => robot.coordinates().iter().map(|c| c.name.as_str()).collect(),
    }
}

/// Name of a task row: `task.component`.
pub(crate) fn row_name(problem: &Problem, row: usize) -> String {
    let index = problem
        .slots()
        .iter()
        .rposition(|s| s.xdot <= row)
        .expect("slots start at 0");
    let task = &problem.tasks()[index];
    let component = component_names(problem.robot(), &task.track)[row - problem.slots()[index].xdot];
    format!("{}.{component}", task.name)
}

/// Values of all tasks at `q` (length nq), in plain coordinates.
pub(crate) fn task_values(problem: &Problem, q: &[f64]) -> Vec<f64> {
    let robot = problem.robot();
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    let position = |f: FrameId| page.frame_position(robot, f);
    let attitude = |f: FrameId| rpy::from_matrix(&page.frame_rotation(robot, f));
    let mut values = Vec::with_capacity(problem.nxdot());
    for task in problem.tasks() {
        match task.track {
            Track::Position(f) => values.extend(position(f).iter()),
            Track::Orientation(f) => values.extend(attitude(f).iter()),
            Track::Pose(f) => values.extend(position(f).iter().chain(attitude(f).iter())),
            Track::CentreOfMass => values.extend(page.centre_of_mass().iter()),
            Track::Posture => values.extend(&q[robot.root().nq()..]),
        }
    }
    values
}
