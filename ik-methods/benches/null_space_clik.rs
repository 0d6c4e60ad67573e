//! One step of every method that takes objectives on Melson, with and without them; and the gradients alone, on chains of
//! different lengths.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench")]

#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/common/fixture.rs"]
mod fixture;
#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/null_space/support.rs"]
mod support;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fixture::{DT_S, PHASE};
use ik_core::driver::StepInput;
use ik_core::evaluator::Evaluator;
use ik_core::kinematics::Page;
use ik_core::kinematics::hanging::HangingTree;
use ik_core::robot::{Robot, Root, UrdfOptions};
use ik_core::step::Window;
use std::fmt::Write;
use std::hint::black_box;
use support::melson;

/// Gains of the scenarios S1 and S3 of the source.
const GAINS: [(&str, [f64; 2]); 2] = [("without", [0.0, 0.0]), ("both", [0.35, 1.6])];

fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("melson step");
    let fixture = melson("l_foot", |_| {});
    let (problem, nv) = (&fixture.problem, fixture.problem.robot().nv());
    let (nx, nxdot) = (problem.nx(), problem.nxdot());
    // The centre of mass, last, moves on.
    let mut ahead = fixture.target.clone();
    ahead[nx - 3] += 2e-4;
    let rest = vec![0.0; nxdot];
    let data = [&fixture.target[..], &rest, &ahead, &rest].concat();
    for id in ["clik", "davies", "ik1", "ik3", "ik4"] {
        let mut driver = fixture.driver(id, "");
        let majors = driver.majors();
        for (name, gains) in GAINS {
            let input = StepInput {
                q_prev: &fixture.start,
                v_prev: &vec![0.0; nv],
                dt_s: DT_S,
                phase: PHASE,
                targets: Window::new(&data, nx, nxdot).unwrap(),
                gains: &gains,
            };
            group.bench_function(format!("{id}, {name}"), |b| {
                b.iter(|| driver.step(black_box(&input), majors));
            });
        }
    }
    group.finish();
}

fn gradients(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("objectives");
    let fixture = melson("l_foot", |_| {});
    let robot = fixture.problem.robot();
    let mut eval = Evaluator::new(&fixture.problem);
    let mut page = Page::new(robot);
    eval.pass(&fixture.start, &mut page);
    let mut gradient = vec![0.0; robot.nv()];
    group.bench_function("both gradients, melson", |b| {
        b.iter(|| {
            eval.add_objectives(
                black_box(&fixture.start),
                &page,
                PHASE,
                &[0.35, 1.6],
                &mut gradient,
            )
        });
    });
    for joints in [10, 20, 40, 80, 160] {
        let robot = chain(joints);
        let (mut page, mut tree) = (Page::new(&robot), HangingTree::new(&robot));
        let q: Vec<f64> = (0..robot.nq()).map(|i| 0.1 + 0.01 * i as f64).collect();
        ik_core::kinematics::forward(&robot, &q, &mut page);
        let (mut torque, mut change) = (vec![0.0; joints], vec![0.0; joints]);
        group.bench_function(BenchmarkId::new("torque gradient, chain", joints), |b| {
            b.iter(|| {
                tree.hang(&robot, black_box(&page), None);
                tree.torques_into(&robot, &mut torque);
                tree.torque_change_into(&robot, &page, &torque, &mut change);
            });
        });
    }
    group.finish();
}

/// A chain of joints about y, x, y, x …
fn chain(joints: usize) -> Robot {
    let mut text = String::from("<robot name='chain'><link name='l0'/>");
    for i in 0..joints {
        let axis = if i % 2 == 0 { "0 1 0" } else { "1 0 0" };
        write!(
            text,
            "<link name='l{next}'><inertial><origin xyz='0 0 0.05'/><mass value='0.1'/>\
             <inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link>\
             <joint name='j{next}' type='continuous'><parent link='l{i}'/><child link='l{next}'/>\
             <origin xyz='0 0 0.1'/><axis xyz='{axis}'/></joint>",
            next = i + 1
        )
        .unwrap();
    }
    Robot::from_urdf_str(&(text + "</robot>"), "chain", &UrdfOptions { root: Root::Fixed }).unwrap()
}

criterion_group!(benches, steps, gradients);
criterion_main!(benches);
