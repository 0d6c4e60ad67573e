//! Small problems for unit tests.

use ik_core::boundary::Boundary;
use ik_core::driver::{Driver, StepInput};
use ik_core::formulation::{Formulation, Termination};
use ik_core::problem::{Kind, Phase, PhaseId, Problem, ProblemParts, Supplies};
use ik_core::robot::{FrameId, embedded};
use ik_core::step::Window;
use ik_core::task::{OrientationCoordinates, Priority, Task, Track, Weights};
use std::sync::Arc;

/// Position of the last frame of an embedded robot as the one compromised task, and its target where every joint is at
/// `value`.
pub(crate) fn arm_problem(robot: &str, value: f64) -> (Arc<Problem>, Vec<f64>) {
    let robot = Arc::new(embedded(robot).unwrap());
    let tip = FrameId(robot.frames().len() - 1);
    let problem = Problem::new(ProblemParts {
        robot: Arc::clone(&robot),
        tasks: vec![Task {
            name: "tip".into(),
            track: Track::Position(tip),
        }],
        phases: vec![Phase {
            name: "all".into(),
            support: None,
            tasks: vec![(0, Priority::Compromised(Weights::Uniform(1.0)))],
        }],
        boundary: Boundary::None,
        objectives: vec![],
        kind: Kind::Tracking,
        supplies: Supplies {
            rates: true,
            preview_s: 0.0,
        },
        orientation: OrientationCoordinates::Log,
    })
    .unwrap();
    let mut page = ik_core::kinematics::Page::new(&robot);
    ik_core::kinematics::forward(&robot, &vec![value; robot.nq()], &mut page);
    (
        Arc::new(problem),
        page.frame_position(&robot, tip).as_slice().to_vec(),
    )
}

/// One step of 10 ms towards the resting target `x`.
pub(crate) fn drive(
    method: &dyn Formulation,
    problem: &Arc<Problem>,
    q: &[f64],
    x: &[f64],
) -> (Vec<f64>, Termination) {
    let mut driver = Driver::new(method, problem).unwrap();
    let sample = [x, &vec![0.0; problem.nxdot()]].concat();
    let data = [sample.clone(), sample].concat();
    let input = StepInput {
        q_prev: q,
        v_prev: &vec![0.0; problem.robot().nv()],
        dt_s: 0.01,
        phase: PhaseId(0),
        targets: Window::new(&data, problem.nx(), problem.nxdot()).unwrap(),
        gains: &[],
    };
    let majors = driver.majors();
    let (termination, _) = driver.step(&input, majors);
    (driver.solution().q.clone(), termination)
}
