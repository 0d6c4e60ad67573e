//! Redundant problems at rest: Melson standing on a foot, an arm of seven joints.

use ik_core::boundary::Boundary;
use ik_core::driver::{Driver, StepInput};
use ik_core::evaluator::{Counts, Evaluator};
use ik_core::formulation::Termination;
use ik_core::kinematics::{Page, forward};
use ik_core::objective::Objective;
use ik_core::problem::{Kind, Phase, PhaseId, Problem, ProblemParts, Supplies};
use ik_core::robot::{Robot, embedded};
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

/// Both objectives of the source, unweighted.
pub(crate) fn objectives() -> Vec<Objective> {
    vec![
        Objective::JointCentring,
        Objective::GravityTorque { weights: None },
    ]
}

/// Melson with both feet, both hands and its centre of mass to be held: 21 rows on 25 coordinates. `parts` may be changed
/// before they are checked.
pub(crate) fn melson(support: &str, change: impl FnOnce(&mut ProblemParts)) -> Fixture {
    let robot = Arc::new(embedded("melson").unwrap());
    let frame = |name: &str| robot.frame(name).unwrap();
    let tasks = [
        ("right-foot", Track::Pose(frame("r_foot"))),
        ("left-foot", Track::Pose(frame("l_foot"))),
        ("right-hand", Track::Position(frame("r_hand"))),
        ("left-hand", Track::Position(frame("l_hand"))),
        ("com", Track::CentreOfMass),
    ];
    let mut parts = parts(&robot, &tasks, OrientationCoordinates::RollPitchYaw);
    parts.phases[0].support = Some(frame(support));
    change(&mut parts);
    Fixture::new(parts, standing(&robot))
}

/// The arm with its last frame to be held: 6 rows on 7 joints.
pub(crate) fn arm() -> Fixture {
    let robot = Arc::new(embedded("arm7").unwrap());
    let last = ik_core::robot::FrameId(robot.frames().len() - 1);
    let parts = parts(
        &robot,
        &[("hand", Track::Pose(last))],
        OrientationCoordinates::Log,
    );
    Fixture::new(parts, vec![0.4, 0.6, -0.3, 1.1, 0.2, 0.7, 0.3])
}

fn parts(robot: &Arc<Robot>, tasks: &[(&str, Track)], orientation: OrientationCoordinates) -> ProblemParts {
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
        objectives: objectives(),
        kind: Kind::Tracking,
        supplies: Supplies {
            rates: true,
            preview_s: 0.0,
        },
        orientation,
    }
}

/// Melson's start of the walk, a little asymmetric: knees bent, soles flat, hands in front.
pub(crate) fn standing(robot: &Robot) -> Vec<f64> {
    let mut q = robot.neutral();
    (q[0], q[2]) = (-0.009_413, 0.238);
    let mut set = |joint: &str, value: f64| q[7 + robot.coordinate(joint).unwrap()] = value;
    for (side, outwards) in [("r", -1.0), ("l", 1.0)] {
        set(&format!("{side}_hip_pitch"), -0.5);
        set(&format!("{side}_knee_pitch"), 0.95);
        set(&format!("{side}_ankle_pitch"), -0.45);
        set(&format!("{side}_shoulder_pitch"), 0.2 + 0.05 * outwards);
        set(&format!("{side}_shoulder_roll"), 0.2 * outwards);
        set(&format!("{side}_elbow_pitch"), -1.0);
    }
    q
}

/// Targets of all tasks where `q` puts them.
pub(crate) fn targets_at(problem: &Problem, q: &[f64]) -> Vec<f64> {
    let robot = problem.robot();
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    let mut x = Vec::new();
    for task in problem.tasks() {
        match task.track {
            Track::Position(f) => x.extend(page.frame_position(robot, f).as_slice()),
            Track::CentreOfMass => x.extend(page.centre_of_mass().as_slice()),
            Track::Pose(f) => {
                x.extend(page.frame_position(robot, f).as_slice());
                let turn = page.frame_rotation(robot, f);
                match problem.orientation() {
                    OrientationCoordinates::RollPitchYaw => x.extend(rpy::from_matrix(&turn).as_slice()),
                    OrientationCoordinates::Log => x.extend(so3::quaternion(&turn).coords.as_slice()),
                }
            }
            _ => unreachable!("no such task here"),
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
