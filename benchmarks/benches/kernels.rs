//! Group `kernels`: what a control step is made of, each alone, on the robot and the task rows of the Coman suites. Group
//! `closed_form`: a batch of poses of one limb on one thread and on all.

use benchmarks::suite::{Case, Suite, Variation};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::kinematics::gravity::static_torques_into;
use ik_core::kinematics::jacobian::{Axes, frame_jacobian_into};
use ik_core::kinematics::{Page, forward};
use ik_core::problem::PhaseId;
use ik_core::robot::{Robot, embedded};
use ik_methods::qp::{ActiveSet, MatRef, Qp, QpSolution, QpSolver, QpStatus};
use ik_methods::reverse_decoupling::{Leg, LegBranch};
use nalgebra::Matrix6xX;
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use std::hint::black_box;

/// Half the width of the box of the quadratic program (rad): 4 rad/s for 5 ms.
const BOX_RAD: f64 = 0.02;
/// Proximal weight of the quadratic program, as IK4 and IK5 have it.
const PROXIMAL: f64 = 1e-6;
/// Root coordinates of a floating robot.
const ROOT: usize = 6;

fn squat() -> Case {
    let suite = Suite::load("coman/squat").expect("it is embedded");
    Case::new(&suite, 0, &Variation::default()).expect("a test builds every embedded scenario")
}

/// A posture without symmetry or singularity.
fn posture(robot: &Robot) -> Vec<f64> {
    let mut q = robot.neutral();
    let coordinates = q[robot.root().nq()..].iter_mut().zip(robot.coordinates());
    for (i, (q, c)) in coordinates.enumerate() {
        let part = 0.3 + 0.02 * i as f64;
        *q = c.limits.lower.max(-1.0) * (1.0 - part) + c.limits.upper.min(1.0) * part;
    }
    q
}

/// Joint axes are columns of the poses: forward kinematics, axes and the centre of mass's Jacobian are one pass.
fn kinematics(c: &mut Criterion) {
    let mut group = c.benchmark_group("kernels");
    for name in ["coman-legs", "coman"] {
        let robot = embedded(name).expect("it is embedded");
        let (q, mut page) = (posture(&robot), Page::new(&robot));
        group.bench_function(format!("forward/{name}"), |b| {
            b.iter(|| forward(&robot, black_box(&q), &mut page));
        });
    }
    let case = squat();
    let robot = case.problem.robot();
    let (mut page, sole) = (Page::new(robot), robot.frame("l_sole").expect("Coman has soles"));
    forward(robot, &posture(robot), &mut page);
    let mut jacobian = Matrix6xX::zeros(robot.nv());
    group.bench_function("frame_jacobian/l_sole", |b| {
        b.iter(|| frame_jacobian_into(robot, black_box(&page), sole, Axes::World, &mut jacobian));
    });
    let supports = ["l_sole", "r_sole"].map(|name| robot.frame(name).expect("Coman has soles"));
    let mut torque = vec![0.0; robot.coordinates().len()];
    group.bench_function("gravity/two_soles", |b| {
        b.iter(|| static_torques_into(robot, black_box(&page), &supports, &mut torque));
    });
}

/// Rows of the squat: two soles (pose) and the torso (orientation) hard, the centre of mass compromised.
fn rows(c: &mut Criterion) {
    let case = squat();
    let (robot, target) = (case.problem.robot(), case.samples.window(1).now());
    let (q, dq) = (posture(robot), vec![0.01; robot.nv()]);
    let mut evaluator = Evaluator::new(&case.problem);
    let mut lin = Linearisation::new(&case.problem);
    let mut group = c.benchmark_group("kernels");
    group.bench_function("linearise", |b| {
        b.iter(|| evaluator.linearise(black_box(&q), PhaseId(0), target, &mut lin));
    });
    group.bench_function("soft_velocity_derivative", |b| {
        b.iter(|| evaluator.soft_velocity_derivative(&mut lin, target, black_box(&dq)));
    });
    group.bench_function("velocity_derivative", |b| {
        b.iter(|| evaluator.velocity_derivative(&mut lin, target, black_box(&dq)));
    });
}

/// The quadratic program of one IK4 major (n = 18, m = 15) from a cold active set.
fn qp(c: &mut Criterion) {
    let case = squat();
    let n = case.problem.robot().nv();
    let mut lin = Linearisation::new(&case.problem);
    let target = case.samples.window(case.samples.steps() / 2).now();
    Evaluator::new(&case.problem).linearise(&case.q_start, PhaseId(0), target, &mut lin);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let soft = &lin.soft;
    let mut h: Vec<f64> = (0..n * n)
        .map(|i| dot(soft.column(i % n), soft.column(i / n)))
        .collect();
    h.iter_mut().step_by(n + 1).for_each(|h| *h += PROXIMAL);
    let g: Vec<f64> = (0..n).map(|j| dot(soft.column(j), &soft.error)).collect();
    let b: Vec<f64> = lin.hard.error[..lin.hard.rows()].iter().map(|e| -e).collect();
    let mut hi = vec![BOX_RAD; n];
    hi[..ROOT].fill(f64::INFINITY);
    let lo: Vec<f64> = hi.iter().map(|hi| -hi).collect();
    let program = Qp {
        h: MatRef::new(&h, n, n),
        g: &g,
        a: MatRef {
            data: &lin.hard.jacobian,
            rows: lin.hard.rows(),
            cols: n,
            ld: lin.hard.ld(),
        },
        b: &b,
        lo: &lo,
        hi: &hi,
    };
    let (mut solver, mut solution) = (ActiveSet::new(n, b.len()), QpSolution::new(n, b.len()));
    c.benchmark_group("kernels")
        .bench_function(format!("qp/n{n}_m{}", b.len()), |bencher| {
            bencher.iter(|| {
                solver.reset();
                let status = solver.solve(black_box(&program), &mut solution);
                assert_eq!(status, QpStatus::Solved);
            });
        });
}

/// A million poses of a leg, one branch each, on one thread and on all.
fn closed_form_batch(c: &mut Criterion) {
    const POSES: usize = 1_000_000;
    let leg = Leg {
        thigh_m: 0.30003,
        shank_m: 0.30038,
        ankle_m: 0.09497,
        hip_offset_m: 0.0,
    };
    let posture =
        |i: usize| std::array::from_fn(|j| ((6 * i + j) as f64 * 0.618_033_988_749_895).fract() * 3.0 - 1.5);
    let poses: Vec<_> = (0..POSES).map(|i| leg.forward(&posture(i))).collect();
    let mut joints = vec![[0.0; 6]; POSES];
    let mut group = c.benchmark_group("closed_form");
    group
        .throughput(Throughput::Elements(POSES as u64))
        .sample_size(10);
    for threads in [1, std::thread::available_parallelism().map_or(1, usize::from)] {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.expect("threads can be started");
        group.bench_function(format!("hubo leg, a million poses, {threads} threads"), |b| {
            b.iter(|| {
                pool.install(|| {
                    joints.par_iter_mut().zip(&poses).for_each(|(q, pose)| {
                        *q = leg
                            .solve(pose, LegBranch::numbered(0), &[0.0; 6])
                            .expect("made from joints");
                    });
                });
            });
        });
    }
    group.finish();
}

criterion_group!(kernels, kinematics, rows, qp, closed_form_batch);
criterion_main!(kernels);
