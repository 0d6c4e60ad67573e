//! Closed forms of limbs: one branch, all branches, and the nearest one.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench")]

use criterion::{Criterion, criterion_group, criterion_main};
use ik_methods::reverse_decoupling::{Arm, ArmBranch, ElbowArm, Leg, LegBranch, Solutions};
use std::hint::black_box;

const Q: [f64; 6] = [0.3, -1.2, 0.4, 0.9, -0.5, 0.2];

fn closed_form(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("closed_form");
    let hubo = Leg {
        thigh_m: 0.30003,
        shank_m: 0.30038,
        ankle_m: 0.09497,
        hip_offset_m: 0.0,
    };
    let hrp2 = Leg {
        thigh_m: 0.3,
        shank_m: 0.3,
        ankle_m: 0.105,
        hip_offset_m: 0.035,
    };
    for (name, leg) in [("hubo leg", hubo), ("hrp2 leg", hrp2)] {
        let pose = leg.forward(&Q);
        let mut all = Solutions::default();
        group.bench_function(format!("{name}, one branch"), |b| {
            b.iter(|| leg.solve(black_box(&pose), LegBranch::numbered(2), &Q));
        });
        group.bench_function(format!("{name}, all"), |b| {
            b.iter(|| leg.solve_all(black_box(&pose), &Q, &mut all));
        });
        group.bench_function(format!("{name}, nearest"), |b| {
            b.iter(|| leg.solve_nearest(black_box(&pose), &Q));
        });
    }
    let arm = Arm {
        upper_arm_m: 0.17914,
        forearm_m: 0.18159,
        hand_m: 0.12065,
    };
    let pose = arm.forward(&Q);
    let mut all = Solutions::default();
    group.bench_function("hubo arm, one branch", |b| {
        b.iter(|| arm.solve(black_box(&pose), ArmBranch::numbered(2), &Q));
    });
    group.bench_function("hubo arm, all", |b| {
        b.iter(|| arm.solve_all(black_box(&pose), &Q, &mut all));
    });
    let four = ElbowArm { arm };
    let joints = [Q[0], Q[1], Q[2], Q[3]];
    let pose = four.forward(&joints);
    let mut both = Solutions::default();
    group.bench_function("arm of four joints, both", |b| {
        b.iter(|| four.solve_all(black_box(&pose), &joints, &mut both));
    });
    group.finish();
}

criterion_group!(benches, closed_form);
criterion_main!(benches);
