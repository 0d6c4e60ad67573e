//! Closed form: time of all solutions of one pose, poses taken in turn from a fixed set.

use std::f64::consts::PI;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ik_methods::reverse_decoupling::general::{DhRow, GeneralLimb, Solutions};
use ik_methods::reverse_decoupling::quartic::real_roots;

/// SplitMix64 (Steele, Lea & Flood 2014).
struct Draw(u64);

impl Draw {
    /// Uniform in [-size, size).
    fn within(&mut self, size: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 * size - size
    }
}

fn limb(table: [(f64, f64, f64); 6]) -> GeneralLimb {
    GeneralLimb::new(table.map(|(degrees, a, d)| DhRow {
        alpha: degrees.to_radians(),
        a,
        d,
    }))
    .expect("the tables of this bench have a spherical triple")
}

fn general_limbs(criterion: &mut Criterion) {
    let limbs = [
        (
            "general_hubo_leg",
            limb([
                (90.0, 0.0, 0.0),
                (-90.0, 0.0, 0.0),
                (0.0, 0.30003, 0.0),
                (0.0, 0.30038, 0.0),
                (90.0, 0.0, 0.0),
                (0.0, 0.09497, 0.0),
            ]),
        ),
        (
            "general_hubo_arm",
            limb([
                (90.0, 0.0, 0.0),
                (-90.0, 0.0, 0.0),
                (90.0, 0.0, -0.17914),
                (90.0, 0.0, 0.0),
                (90.0, 0.0, 0.18159),
                (0.0, 0.12065, 0.0),
            ]),
        ),
        (
            "general_parallel",
            limb([
                (90.0, 0.0, 0.0),
                (-90.0, 0.0, 0.0),
                (90.0, 0.1, -0.2),
                (90.0, 0.05, 0.1),
                (0.0, 0.2, 0.1),
                (0.0, 0.1, 0.0),
            ]),
        ),
        (
            "general_quartic_arm6",
            limb([
                (-90.0, 0.06, 0.38),
                (0.0, 0.41, 0.02),
                (-90.0, 0.04, -0.02),
                (90.0, 0.0, 0.38),
                (-90.0, 0.0, 0.0),
                (0.0, 0.0, 0.12),
            ]),
        ),
    ];
    let mut group = criterion.benchmark_group("closed_form");
    for (name, limb) in &limbs {
        let mut draw = Draw(0x6e);
        let poses: Vec<_> = (0..256)
            .map(|_| limb.forward(&std::array::from_fn(|_| draw.within(PI))))
            .collect();
        let mut solutions = Solutions::default();
        let mut turn = 0;
        group.bench_function(*name, |bench| {
            bench.iter(|| {
                let (rotation, position) = &poses[turn % 256];
                turn += 1;
                limb.solve_into(
                    black_box(rotation),
                    black_box(position),
                    &[0.0; 6],
                    &mut solutions,
                )
            });
        });
    }
    group.finish();
}

fn quartic(criterion: &mut Criterion) {
    let mut draw = Draw(0x6f);
    let polynomials: Vec<[f64; 5]> = (0..256)
        .map(|_| std::array::from_fn(|_| draw.within(1.0)))
        .collect();
    let mut turn = 0;
    let mut group = criterion.benchmark_group("closed_form");
    group.bench_function("quartic_roots", |bench| {
        bench.iter(|| {
            turn += 1;
            real_roots(black_box(&polynomials[turn % 256]), 0.0)
        });
    });
    group.finish();
}

criterion_group!(benches, general_limbs, quartic);
criterion_main!(benches);
