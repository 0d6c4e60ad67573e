//! The small set every method is held against: arms of 1, 6 and 7 joints, one with a prismatic joint, and the legs of
//! COMAN.

use ik_core::boundary::Boundary;
use ik_core::driver::{Driver, StepInput};
use ik_core::evaluator::Counts;
use ik_core::formulation::Termination;
use ik_core::kinematics::{Page, forward};
use ik_core::problem::{Kind, Phase, PhaseId, Problem, ProblemParts, Supplies};
use ik_core::robot::{FrameId, Robot, embedded};
use ik_core::spatial::{rpy, so3};
use ik_core::step::Window;
use ik_core::task::{OrientationCoordinates, Priority, Task, Track, Weights};
use std::sync::Arc;

pub(crate) const DT_S: f64 = 0.005;

/// A problem with a start and a resting target that can be reached from it.
#[derive(Clone)]
pub(crate) struct Fixture {
    pub(crate) name: String,
    pub(crate) problem: Arc<Problem>,
    pub(crate) start: Vec<f64>,
    pub(crate) goal: Vec<f64>,
}

pub(crate) fn compromised() -> Priority {
    Priority::Compromised(Weights::Uniform(1.0))
}

impl Fixture {
    /// Tasks of `robot` whose target is where `goal` puts them.
    pub(crate) fn new(
        name: &str,
        robot: &Arc<Robot>,
        tasks: Vec<(Track, Priority)>,
        boundary: Boundary,
        start: Vec<f64>,
        goal: &[f64],
    ) -> Self {
        let orientation = OrientationCoordinates::Log;
        let named = tasks.iter().enumerate();
        let parts = ProblemParts {
            robot: Arc::clone(robot),
            tasks: named
                .map(|(i, (track, _))| Task {
                    name: format!("task{i}"),
                    track: *track,
                })
                .collect(),
            phases: vec![Phase {
                name: "all".into(),
                support: None,
                tasks: tasks
                    .iter()
                    .enumerate()
                    .map(|(i, (_, priority))| (i, priority.clone()))
                    .collect(),
            }],
            boundary,
            objectives: vec![],
            kind: Kind::Tracking,
            supplies: Supplies {
                rates: true,
                preview_s: 0.0,
            },
            orientation,
        };
        let problem = Arc::new(Problem::new(parts).unwrap());
        let goal = target_at(&problem, goal);
        Self {
            name: name.to_owned(),
            problem,
            start,
            goal,
        }
    }

    /// Two equal samples: the goal `x`, at rest.
    pub(crate) fn samples(&self, x: &[f64]) -> Vec<f64> {
        let one = [x, &vec![0.0; self.problem.nxdot()]].concat();
        [one.clone(), one].concat()
    }

    pub(crate) fn last_frame(robot: &Robot) -> FrameId {
        FrameId(robot.frames().len() - 1)
    }
}

/// Targets of all tasks where the configuration `q` puts them.
pub(crate) fn target_at(problem: &Problem, q: &[f64]) -> Vec<f64> {
    let robot = problem.robot();
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    let mut x = Vec::new();
    let turn = |f: FrameId| match problem.orientation() {
        OrientationCoordinates::Log => so3::quaternion(&page.frame_rotation(robot, f))
            .coords
            .as_slice()
            .to_vec(),
        OrientationCoordinates::RollPitchYaw => rpy::from_matrix(&page.frame_rotation(robot, f))
            .as_slice()
            .to_vec(),
    };
    for task in problem.tasks() {
        match task.track {
            Track::Position(f) => x.extend(page.frame_position(robot, f).as_slice()),
            Track::Orientation(f) => x.extend(turn(f)),
            Track::Pose(f) => {
                x.extend(page.frame_position(robot, f).as_slice());
                x.extend(turn(f));
            }
            Track::CentreOfMass => x.extend(page.centre_of_mass().as_slice()),
            Track::Posture => x.extend(&q[robot.root().nq()..]),
        }
    }
    x
}

/// The configuration between the limits at the given fraction of the range (unlimited joints within ±1).
fn between_limits(robot: &Robot, fraction: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut q = robot.neutral();
    for (j, (q, c)) in q[robot.root().nq()..]
        .iter_mut()
        .zip(robot.coordinates())
        .enumerate()
    {
        let (lo, hi) = if c.limits.lower.is_finite() {
            (c.limits.lower, c.limits.upper)
        } else {
            (-1.0, 1.0)
        };
        *q = lo + (hi - lo) * fraction(j);
    }
    q
}

/// The legs of COMAN standing with knees at 1.2 rad, and the pelvis `drop` metres lower as the goal.
pub(crate) fn coman(drop: f64) -> Fixture {
    let robot = Arc::new(embedded("coman-legs").unwrap());
    let start = coman_stance(&robot, 1.2);
    let frame = |name: &str| robot.frame(name).unwrap();
    let tasks = vec![
        (Track::CentreOfMass, compromised()),
        (Track::Pose(frame("l_sole")), Priority::Hard),
        (Track::Pose(frame("r_sole")), Priority::Hard),
        (Track::Orientation(frame("Waist")), Priority::Hard),
    ];
    let boundary = Boundary::Ellipse { margin: 0.0 };
    let mut fixture = Fixture::new("coman", &robot, tasks, boundary, start.clone(), &start);
    fixture.goal[2] -= drop;
    fixture
}

/// The same standing with both knees exactly on their limit, where the hard rows have rank 14 of 15.
pub(crate) fn straight() -> Fixture {
    let mut fixture = coman(0.0);
    let lower = fixture.goal.clone();
    fixture.name = "coman straight".into();
    fixture.start = coman_stance(fixture.problem.robot(), 0.0);
    fixture.goal = target_at(&fixture.problem, &fixture.start);
    // The centre of mass of the crouched pose, feet and torso as they are.
    fixture.goal[..3].copy_from_slice(&lower[..3]);
    fixture
}

/// Standing upright with both knees at `knee`: hips and ankles share the bend by the lengths of the leg, soles flat at z = 0.
pub(crate) fn coman_stance(robot: &Robot, knee: f64) -> Vec<f64> {
    let (thigh, shank, ankle) = (0.2258, 0.2010, 0.09);
    // Ankle below hip: thigh sin(hip) = shank sin(knee − hip).
    let hip = (shank * knee.sin()).atan2(thigh + shank * knee.cos());
    let mut q = robot.neutral();
    q[2] = thigh * hip.cos() + shank * (knee - hip).cos() + ankle;
    for side in ["L", "R"] {
        for (joint, value) in [("HipSag", -hip), ("KneeSag", knee), ("AnkSag", hip - knee)] {
            q[7 + robot.coordinate(&format!("{side}{joint}")).unwrap()] = value;
        }
    }
    q
}

/// One arm: the position of its tip hard or compromised, the posture as a compromised rest.
fn arm(id: &str, tasks: impl Fn(FrameId) -> Vec<(Track, Priority)>, boundary: Boundary) -> Fixture {
    let robot = Arc::new(embedded(id).unwrap());
    let start = between_limits(&robot, |j| 0.45 + 0.02 * (j % 3) as f64);
    let goal = between_limits(&robot, |j| 0.55 - 0.03 * (j % 2) as f64);
    Fixture::new(
        id,
        &robot,
        tasks(Fixture::last_frame(&robot)),
        boundary,
        start,
        &goal,
    )
}

/// Every fixture of the small set.
pub(crate) fn all() -> Vec<Fixture> {
    let soft_pose = |f| vec![(Track::Pose(f), compromised())];
    let uneven = Priority::Compromised(Weights::Diagonal(vec![4.0, 16.0, 2.0, 1.0, 2.0, 8.0]));
    let hard_position = |f| {
        vec![
            (Track::Position(f), Priority::Hard),
            (Track::Posture, compromised()),
        ]
    };
    vec![
        arm(
            "pendulum",
            |f| vec![(Track::Position(f), compromised())],
            Boundary::Box,
        ),
        arm("arm6", soft_pose, Boundary::Box),
        arm("arm7", soft_pose, Boundary::Ellipse { margin: 0.0 }),
        arm("arm7", hard_position, Boundary::Box),
        arm("slider-arm", soft_pose, Boundary::Box),
        arm("arm6", |f| vec![(Track::Pose(f), Priority::Hard)], Boundary::Box),
        arm(
            "arm7",
            |f| vec![(Track::Pose(f), uneven.clone())],
            Boundary::Ellipse { margin: 0.05 },
        ),
        coman(0.02),
        straight(),
    ]
}

/// Drives `steps` control steps towards the resting target `x`; returns the last configuration and what every step said.
pub(crate) fn drive(
    driver: &mut Driver,
    fixture: &Fixture,
    x: &[f64],
    steps: usize,
) -> (Vec<f64>, Vec<(Termination, Counts)>) {
    let samples = fixture.samples(x);
    let (mut q, mut v) = (fixture.start.clone(), vec![0.0; fixture.problem.robot().nv()]);
    let mut said = Vec::new();
    for _ in 0..steps {
        let majors = driver.majors();
        said.push(step(driver, fixture, &samples, &q, &v, majors));
        driver.increment_into(&q, &mut v);
        v.iter_mut().for_each(|v| *v /= DT_S);
        q.copy_from_slice(&driver.solution().q);
    }
    (q, said)
}

/// One step from `q`.
pub(crate) fn step(
    driver: &mut Driver,
    fixture: &Fixture,
    samples: &[f64],
    q: &[f64],
    v: &[f64],
    majors: u32,
) -> (Termination, Counts) {
    let input = StepInput {
        q_prev: q,
        v_prev: v,
        dt_s: DT_S,
        phase: PhaseId(0),
        targets: Window::new(samples, fixture.problem.nx(), fixture.problem.nxdot()).unwrap(),
        gains: &[],
    };
    driver.step(&input, majors)
}
