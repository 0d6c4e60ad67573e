//! A problem with a configuration that meets its targets, and single steps from there; shared by integration tests and benches.

use ik_core::boundary::Boundary;
use ik_core::driver::{Driver, StepInput};
use ik_core::evaluator::{Counts, Evaluator};
use ik_core::formulation::Termination;
use ik_core::kinematics::{Page, forward};
use ik_core::problem::{Kind, Phase, PhaseId, Problem, ProblemParts, Supplies};
use ik_core::robot::Robot;
use ik_core::spatial::{rpy, so3};
use ik_core::step::Window;
use ik_core::task::{OrientationCoordinates, Priority, Task, Track};
use ik_methods::registry::method;
use std::sync::Arc;

pub(crate) const DT_S: f64 = 0.01;
pub(crate) const PHASE: PhaseId = PhaseId(0);

/// A problem with a configuration that meets its targets.
pub(crate) struct Fixture {
    pub(crate) problem: Arc<Problem>,
    pub(crate) start: Vec<f64>,
    pub(crate) target: Vec<f64>,
}

/// Parts of a problem in which every task is hard, without boundary or objectives.
pub(crate) fn parts(
    robot: &Arc<Robot>,
    tasks: &[(&str, Track)],
    orientation: OrientationCoordinates,
) -> ProblemParts {
    let named = |(name, track): &(&str, Track)| Task {
        name: (*name).into(),
        track: *track,
    };
    ProblemParts {
        robot: Arc::clone(robot),
        tasks: tasks.iter().map(named).collect(),
        phases: vec![Phase {
            name: "standing".into(),
            support: None,
            tasks: (0..tasks.len()).map(|i| (i, Priority::Hard)).collect(),
        }],
        boundary: Boundary::None,
        objectives: vec![],
        kind: Kind::Tracking,
        supplies: Supplies {
            rates: true,
            preview_s: 0.0,
        },
        orientation,
    }
}

/// Targets of all tasks where `q` puts them.
pub(crate) fn targets_at(problem: &Problem, q: &[f64]) -> Vec<f64> {
    let robot = problem.robot();
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    let turn = |frame, x: &mut Vec<f64>| {
        let turn = page.frame_rotation(robot, frame);
        match problem.orientation() {
            OrientationCoordinates::RollPitchYaw => x.extend(rpy::from_matrix(&turn).as_slice()),
            OrientationCoordinates::Log => x.extend(so3::quaternion(&turn).coords.as_slice()),
        }
    };
    let mut x = Vec::new();
    for task in problem.tasks() {
        match task.track {
            Track::Position(f) => x.extend(page.frame_position(robot, f).as_slice()),
            Track::CentreOfMass => x.extend(page.centre_of_mass().as_slice()),
            Track::Orientation(f) => turn(f, &mut x),
            Track::Pose(f) => {
                x.extend(page.frame_position(robot, f).as_slice());
                turn(f, &mut x);
            }
            Track::Posture => x.extend(&q[robot.root().nq()..]),
        }
    }
    x
}

impl Fixture {
    pub(crate) fn new(parts: ProblemParts, start: Vec<f64>) -> Self {
        let problem = Arc::new(Problem::new(parts).unwrap());
        let target = targets_at(&problem, &start);
        Self {
            problem,
            start,
            target,
        }
    }

    pub(crate) fn driver(&self, id: &str, parameters: &str) -> Driver {
        let contestant = method(id).unwrap().build(&parameters.parse().unwrap()).unwrap();
        Driver::new(&*contestant.formulation, &self.problem).unwrap()
    }

    /// One step from `q` with the resting target `x`.
    pub(crate) fn step(
        &self,
        driver: &mut Driver,
        q: &[f64],
        x: &[f64],
        gains: &[f64],
    ) -> (Termination, Counts) {
        let sample = [x, &vec![0.0; self.problem.nxdot()]].concat();
        let data = [sample.clone(), sample].concat();
        let input = StepInput {
            q_prev: q,
            v_prev: &vec![0.0; self.problem.robot().nv()],
            dt_s: DT_S,
            phase: PHASE,
            targets: Window::new(&data, self.problem.nx(), self.problem.nxdot()).unwrap(),
            gains,
        };
        driver.check(&input).unwrap();
        let majors = driver.majors();
        driver.step(&input, majors)
    }

    /// Value and gradient (length nv) of the weighted objectives at `q`.
    pub(crate) fn objective(&self, q: &[f64], gains: &[f64]) -> (f64, Vec<f64>) {
        let mut eval = Evaluator::new(&self.problem);
        let mut page = Page::new(self.problem.robot());
        eval.pass(q, &mut page);
        let mut gradient = vec![0.0; self.problem.robot().nv()];
        let value = eval.add_objectives(q, &page, PHASE, gains, &mut gradient);
        (value, gradient)
    }
}
