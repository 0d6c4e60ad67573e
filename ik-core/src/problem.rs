//! A problem: robot, tasks, phases, boundary, objectives. Built and checked once, shared by everyone, never changed.

use crate::boundary::{Boundary, BoundaryError};
use crate::objective::Objective;
use crate::robot::{FrameId, Robot};
use crate::rows::RowLayout;
use crate::task::{OrientationCoordinates, Priority, Task, Track, Weights};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Index of a phase in its problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhaseId(pub usize);

/// Which tasks count, and how much, during one part of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Phase {
    /// Name, for records.
    pub name: String,
    /// `(index of the task, its priority)`, in the order of the rows; hard rows and soft rows are stacked separately.
    pub tasks: Vec<(usize, Priority)>,
    /// The frame that carries the robot, a foot say; none if it is not known. Gravity torques are those of the tree hanging
    /// from it, and a method may take it as its base. A fixed root carries its robot itself.
    pub support: Option<FrameId>,
}

/// What a step is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Follow moving targets from one control step to the next.
    Tracking,
    /// Reach a fixed target: unit time, zero rates, position limits only.
    Pose,
}

/// Information the problem promises with every step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supplies {
    /// Target rates are meaningful (analytic or differenced); otherwise they are zero.
    pub rates: bool,
    /// Seconds of future target samples.
    pub preview_s: f64,
}

/// The parts of a problem, before they are checked.
#[derive(Clone, Debug)]
pub struct ProblemParts {
    /// The robot.
    pub robot: Arc<Robot>,
    /// What is tracked.
    pub tasks: Vec<Task>,
    /// Which tasks count when.
    pub phases: Vec<Phase>,
    /// The boundary of every joint.
    pub boundary: Boundary,
    /// Secondary objectives.
    pub objectives: Vec<Objective>,
    /// What a step is.
    pub kind: Kind,
    /// Information supplied.
    pub supplies: Supplies,
    /// How orientations are written.
    pub orientation: OrientationCoordinates,
}

/// What is wrong with a problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProblemError {
    /// No task at all, or a phase without tasks.
    #[error("{0} has no task")]
    NoTask(String),
    /// No phase.
    #[error("the problem has no phase")]
    NoPhase,
    /// Two tasks of one name.
    #[error("task `{0}` is named twice")]
    DuplicateTask(String),
    /// A phase refers to a task that does not exist, or twice to one.
    #[error("phase `{phase}` refers to task {task}, but there are {count} tasks and each may appear once")]
    TaskIndex {
        /// Name of the phase.
        phase: String,
        /// Index found.
        task: usize,
        /// Number of tasks.
        count: usize,
    },
    /// A frame that the robot lacks.
    #[error("task `{task}` refers to frame {frame}, but `{robot}` has {count} frames")]
    Frame {
        /// Name of the task.
        task: String,
        /// Index found.
        frame: usize,
        /// Name of the robot.
        robot: String,
        /// Number of frames.
        count: usize,
    },
    /// A phase supported by a frame that the robot lacks.
    #[error("phase `{phase}` is supported by frame {frame}, but `{robot}` has {count} frames")]
    Support {
        /// Name of the phase.
        phase: String,
        /// Index found.
        frame: usize,
        /// Name of the robot.
        robot: String,
        /// Number of frames.
        count: usize,
    },
    /// Gravity torques of a floating robot in a phase without support.
    #[error(
        "gravity torques of `{robot}` depend on the foot it stands on, but phase `{phase}` names no support"
    )]
    NoSupport {
        /// Name of the phase.
        phase: String,
        /// Name of the robot.
        robot: String,
    },
    /// Joint centring of joints without a middle.
    #[error(
        "joint centring needs two different finite limits of every joint; `{robot}` lacks them for {}",
        .joints.join(", ")
    )]
    NoRange {
        /// Name of the robot.
        robot: String,
        /// The joints without.
        joints: Vec<String>,
    },
    /// Weights of gravity torques of the wrong number or not positive.
    #[error("weights of the gravity torques: {found}; allowed: {allowed}")]
    TorqueWeights {
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// The centre of mass of a robot without moving mass.
    #[error("task `{task}` tracks the centre of mass, but `{robot}` has no moving mass")]
    Massless {
        /// Name of the task.
        task: String,
        /// Name of the robot.
        robot: String,
    },
    /// A weight matrix of the wrong size, not symmetric or not positive semidefinite.
    #[error("weights of task `{task}`: {found}; allowed: {allowed}")]
    Weights {
        /// Name of the task.
        task: String,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// A pose problem, whose steps have no duration, with a bound on velocities.
    #[error("a pose problem has no time step: its boundary may be none or positions, found {0:?}")]
    PoseVelocity(Boundary),
    /// A bad boundary.
    #[error(transparent)]
    Boundary(#[from] BoundaryError),
}

/// A checked problem.
#[derive(Clone, Debug)]
pub struct Problem {
    parts: ProblemParts,
    slots: Vec<Slot>,
    nx: usize,
    nxdot: usize,
    layouts: Vec<RowLayout>,
}

/// Where a task's target and rate begin in a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// First number of x.
    pub x: usize,
    /// First number of ẋ.
    pub xdot: usize,
}

impl Problem {
    /// Checks the parts and lays out targets and rows.
    ///
    /// # Errors
    /// The first inconsistency found, naming task, phase or field.
    pub fn new(parts: ProblemParts) -> Result<Self, ProblemError> {
        check_tasks(&parts)?;
        for objective in &parts.objectives {
            objective.check(&parts.robot, &parts.phases)?;
        }
        parts.boundary.validate(&parts.robot)?;
        if parts.kind == Kind::Pose && parts.boundary.bounds_velocity() {
            return Err(ProblemError::PoseVelocity(parts.boundary));
        }
        let (mut slots, mut nx, mut nxdot) = (Vec::new(), 0, 0);
        for task in &parts.tasks {
            slots.push(Slot { x: nx, xdot: nxdot });
            nx += task.track.target_len(&parts.robot, parts.orientation);
            nxdot += task.track.rows(&parts.robot);
        }
        let layouts = parts
            .phases
            .iter()
            .map(|phase| RowLayout::new(&parts, phase, &slots))
            .collect();
        Ok(Self {
            parts,
            slots,
            nx,
            nxdot,
            layouts,
        })
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.parts.robot
    }
    /// The robot, shared.
    pub fn robot_arc(&self) -> &Arc<Robot> {
        &self.parts.robot
    }
    /// What is tracked.
    pub fn tasks(&self) -> &[Task] {
        &self.parts.tasks
    }
    /// Which tasks count when.
    pub fn phases(&self) -> &[Phase] {
        &self.parts.phases
    }
    /// The boundary.
    pub fn boundary(&self) -> &Boundary {
        &self.parts.boundary
    }
    /// Secondary objectives.
    pub fn objectives(&self) -> &[Objective] {
        &self.parts.objectives
    }
    /// What a step is.
    pub fn kind(&self) -> Kind {
        self.parts.kind
    }
    /// Information supplied with every step.
    pub fn supplies(&self) -> Supplies {
        self.parts.supplies
    }
    /// How orientations are written.
    pub fn orientation(&self) -> OrientationCoordinates {
        self.parts.orientation
    }
    /// Where each task's target begins.
    pub fn slots(&self) -> &[Slot] {
        &self.slots
    }
    /// Numbers in x of one sample.
    pub fn nx(&self) -> usize {
        self.nx
    }
    /// Numbers in ẋ of one sample.
    pub fn nxdot(&self) -> usize {
        self.nxdot
    }
    /// Rows of a phase.
    pub fn layout(&self, phase: PhaseId) -> &RowLayout {
        &self.layouts[phase.0]
    }
    /// Most hard rows of any phase.
    pub fn largest_hard_rows(&self) -> usize {
        self.layouts.iter().map(|l| l.hard.rows()).max().unwrap_or(0)
    }
    /// Most soft rows of any phase.
    pub fn largest_soft_rows(&self) -> usize {
        self.layouts.iter().map(|l| l.soft.rows()).max().unwrap_or(0)
    }
}

fn check_tasks(parts: &ProblemParts) -> Result<(), ProblemError> {
    if parts.tasks.is_empty() {
        return Err(ProblemError::NoTask("the problem".into()));
    }
    if parts.phases.is_empty() {
        return Err(ProblemError::NoPhase);
    }
    for (i, task) in parts.tasks.iter().enumerate() {
        if parts.tasks[..i].iter().any(|other| other.name == task.name) {
            return Err(ProblemError::DuplicateTask(task.name.clone()));
        }
        check_track(parts, task)?;
    }
    parts
        .phases
        .iter()
        .try_for_each(|phase| check_phase(parts, phase))
}

fn check_track(parts: &ProblemParts, task: &Task) -> Result<(), ProblemError> {
    match task.track {
        Track::Position(f) | Track::Orientation(f) | Track::Pose(f) if f.0 >= parts.robot.frames().len() => {
            Err(ProblemError::Frame {
                task: task.name.clone(),
                frame: f.0,
                robot: parts.robot.name().to_owned(),
                count: parts.robot.frames().len(),
            })
        }
        Track::CentreOfMass if crate::kinematics::Page::new(&parts.robot).moving_mass_kg() <= 0.0 => {
            Err(ProblemError::Massless {
                task: task.name.clone(),
                robot: parts.robot.name().to_owned(),
            })
        }
        _ => Ok(()),
    }
}

fn check_phase(parts: &ProblemParts, phase: &Phase) -> Result<(), ProblemError> {
    if phase.tasks.is_empty() {
        return Err(ProblemError::NoTask(format!("phase `{}`", phase.name)));
    }
    let count = parts.robot.frames().len();
    if let Some(frame) = phase.support.filter(|f| f.0 >= count) {
        return Err(ProblemError::Support {
            phase: phase.name.clone(),
            frame: frame.0,
            robot: parts.robot.name().to_owned(),
            count,
        });
    }
    for (i, (task, priority)) in phase.tasks.iter().enumerate() {
        let twice = phase.tasks[..i].iter().any(|(other, _)| other == task);
        let Some(named) = parts.tasks.get(*task).filter(|_| !twice) else {
            return Err(ProblemError::TaskIndex {
                phase: phase.name.clone(),
                task: *task,
                count: parts.tasks.len(),
            });
        };
        if let Priority::Compromised(weights) = priority {
            check_weights(&named.name, weights, named.track.rows(&parts.robot))?;
        }
    }
    Ok(())
}

fn check_weights(task: &str, weights: &Weights, rows: usize) -> Result<(), ProblemError> {
    let fail = |found: String, allowed: &str| {
        Err(ProblemError::Weights {
            task: task.to_owned(),
            found,
            allowed: allowed.to_owned(),
        })
    };
    let good = |w: &f64| w.is_finite() && *w >= 0.0;
    match weights {
        Weights::Uniform(w) if !good(w) => fail(format!("{w}"), "finite and not negative"),
        Weights::Diagonal(d) if d.len() != rows => {
            fail(format!("{} entries", d.len()), &format!("{rows} entries"))
        }
        Weights::Diagonal(d) if !d.iter().all(good) => fail(format!("{d:?}"), "finite and not negative"),
        Weights::Matrix(m) => {
            if m.len() != rows || m.iter().any(|r| r.len() != rows) {
                return fail("another shape".into(), &format!("{rows} rows of {rows} numbers"));
            }
            let matrix = nalgebra::DMatrix::from_fn(rows, rows, |i, j| m[i][j]);
            let scale = matrix.amax();
            let asymmetry = (&matrix - matrix.transpose()).amax();
            if !scale.is_finite() || asymmetry > 1e-12 * scale {
                return fail(format!("asymmetry {asymmetry:e}"), "a finite symmetric matrix");
            }
            let least = matrix.symmetric_eigenvalues().min();
            if least < -1e-12 * scale {
                return fail(format!("least eigenvalue {least:e}"), "positive semidefinite");
            }
            Ok(())
        }
        _ => Ok(()),
    }
}
