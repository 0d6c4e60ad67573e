//! One step of Davies' method: with an imposed root, whose secondary matrix falls into blocks, and with a free one; and the
//! network matrix written out for comparison.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench")]

use criterion::{Criterion, criterion_group, criterion_main};
use ik_core::boundary::Boundary;
use ik_core::driver::{Driver, StepInput};
use ik_core::kinematics::{Page, forward};
use ik_core::problem::{Kind, Phase, PhaseId, Problem, ProblemParts, Supplies};
use ik_core::robot::embedded;
use ik_core::step::Window;
use ik_core::task::{OrientationCoordinates, Priority, Task, Track, Weights};
use ik_methods::davies::{Network, OrientationRates, ReferencePoint};
use ik_methods::registry::method;
use std::hint::black_box;
use std::sync::Arc;

/// Bioloid with bent legs and arms, the waist at the height of the gait.
fn stance() -> Vec<f64> {
    let leg = [0.0, 0.0, -0.6486555, 1.2904366, -0.6417811, 0.0];
    let arm = [-0.3535033, -0.6403979, 1.5673627];
    let mut q = vec![0.0, 0.0, 0.155, 0.0, 0.0, 0.0, 1.0];
    q.extend(leg.iter().chain(&leg).chain(&arm));
    q.extend(arm.iter().map(|a| -a));
    q
}

/// Feet and waist hard, hands compromised; a free root holds the centre of mass instead of the waist's position.
fn bioloid(free_root: &[&str]) -> Arc<Problem> {
    let robot = Arc::new(embedded("bioloid").unwrap());
    let frame = |name: &str| robot.frame(name).unwrap();
    let soft = || Priority::Compromised(Weights::Uniform(1.0));
    let mut tasks = vec![
        ("right-foot", Track::Pose(frame("r_foot")), Priority::Hard),
        ("left-foot", Track::Pose(frame("l_foot")), Priority::Hard),
        ("right-hand", Track::Position(frame("r_hand")), soft()),
        ("left-hand", Track::Position(frame("l_hand")), soft()),
    ];
    match free_root {
        [com] => {
            tasks.push((com, Track::CentreOfMass, soft()));
            tasks.push(("waist", Track::Orientation(frame("waist")), Priority::Hard));
        }
        _ => tasks.push(("waist", Track::Pose(frame("waist")), Priority::Hard)),
    }
    let named = |(name, track, _): &(&str, Track, Priority)| Task {
        name: (*name).into(),
        track: *track,
    };
    let parts = ProblemParts {
        robot: Arc::clone(&robot),
        tasks: tasks.iter().map(named).collect(),
        phases: vec![Phase {
            name: "whole".into(),
            support: None,
            tasks: tasks
                .iter()
                .enumerate()
                .map(|(i, (_, _, p))| (i, p.clone()))
                .collect(),
        }],
        boundary: Boundary::None,
        objectives: vec![],
        kind: Kind::Tracking,
        supplies: Supplies {
            rates: true,
            preview_s: 0.0,
        },
        orientation: OrientationCoordinates::RollPitchYaw,
    };
    Arc::new(Problem::new(parts).unwrap())
}

/// Where the tasks are at `q`, attitudes being zero in this stance.
fn targets(problem: &Problem, q: &[f64]) -> Vec<f64> {
    let robot = problem.robot();
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    let mut x = Vec::new();
    for task in problem.tasks() {
        match task.track {
            Track::Position(f) => x.extend(page.frame_position(robot, f).iter()),
            Track::Pose(f) => x.extend(page.frame_position(robot, f).iter().chain(&[0.0; 3])),
            Track::CentreOfMass => x.extend(page.centre_of_mass().iter()),
            _ => x.extend([0.0; 3]),
        }
    }
    x
}

fn davies(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("davies");
    let q = stance();
    for (name, problem) in [
        ("bioloid imposed root", bioloid(&[])),
        ("bioloid free root", bioloid(&["com"])),
    ] {
        let x = targets(&problem, &q);
        let ahead: Vec<f64> = x.iter().map(|x| x + 1e-4).collect();
        let rest = vec![0.0; problem.nxdot()];
        let data = [&x[..], &rest, &ahead, &rest].concat();
        for parameters in ["", "integrator = 'rk4'\nfeed_forward = 'given'"] {
            let contestant = method("davies")
                .unwrap()
                .build(&parameters.parse().unwrap())
                .unwrap();
            let mut driver = Driver::new(&*contestant.formulation, &problem).unwrap();
            let majors = driver.majors();
            let label = format!("{name}, {majors} evaluations");
            group.bench_function(label, |b| {
                b.iter(|| {
                    let input = StepInput {
                        q_prev: black_box(&q),
                        v_prev: &[0.0; 24],
                        dt_s: 0.01,
                        phase: PhaseId(0),
                        targets: Window::new(&data, problem.nx(), problem.nxdot()).unwrap(),
                        gains: &[],
                    };
                    driver.step(&input, majors)
                });
            });
        }
        group.bench_function(format!("{name}, N written out"), |b| {
            let how = OrientationRates::AngularVelocity;
            b.iter(|| Network::new(&problem, PhaseId(0), black_box(&q), ReferencePoint::Task, how));
        });
    }
    group.finish();
}

criterion_group!(benches, davies);
criterion_main!(benches);
