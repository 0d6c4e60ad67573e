//! Closed form: time of all solutions of one pose, poses taken in turn from a fixed set; one step of the whole robot.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench")]

#[allow(dead_code, reason = "shared with the tests")]
#[path = "../tests/common/fixture.rs"]
mod fixture;

use std::f64::consts::{FRAC_PI_2, PI};
use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use fixture::{DT_S, Fixture, PHASE, parts};
use ik_core::driver::StepInput;
use ik_core::robot::embedded;
use ik_core::step::Window;
use ik_core::task::{OrientationCoordinates, Track};
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

/// One step of Hubo on its feet, hands held: the root placed by its task, and by the centre of mass.
fn whole_robot(criterion: &mut Criterion) {
    let robot = Arc::new(embedded("hubo").unwrap());
    let frame = |name: &str| robot.frame(name).unwrap();
    let ends = [
        ("right-foot", Track::Pose(frame("r_sole"))),
        ("left-foot", Track::Pose(frame("l_sole"))),
        ("right-hand", Track::Pose(frame("r_hand"))),
        ("left-hand", Track::Pose(frame("l_hand"))),
    ];
    let placed = [("waist", Track::Pose(frame("waist")))];
    let balanced = [
        ("turn", Track::Orientation(frame("waist"))),
        ("com", Track::CentreOfMass),
    ];
    let mut start = robot.neutral();
    let leg = [0.0, -FRAC_PI_2, -0.4, 0.8, -0.4, 0.0];
    let arm = [1.4, -1.3, -1.4, 1.1, -0.5, 1.1];
    for (joints, values) in start[7..].chunks_mut(6).zip([leg, leg, arm, arm]) {
        joints.copy_from_slice(&values);
    }
    let mut group = criterion.benchmark_group("closed_form step");
    for (name, root) in [("root placed", &placed[..]), ("root balanced", &balanced[..])] {
        let tasks = [&ends[..], root].concat();
        let parts = parts(&robot, &tasks, OrientationCoordinates::Log);
        let fixture = Fixture::new(parts, start.clone());
        let (nx, nxdot) = (fixture.problem.nx(), fixture.problem.nxdot());
        // The right foot is lifted by half a millimetre.
        let mut ahead = fixture.target.clone();
        ahead[2] += 5e-4;
        let rest = vec![0.0; nxdot];
        let data = [&fixture.target[..], &rest, &ahead, &rest].concat();
        for id in ["closed-form", "ik1", "clik"] {
            let mut driver = fixture.driver(id, "");
            let majors = driver.majors();
            let input = StepInput {
                q_prev: &fixture.start,
                v_prev: &vec![0.0; robot.nv()],
                dt_s: DT_S,
                phase: PHASE,
                targets: Window::new(&data, nx, nxdot).unwrap(),
                gains: &[],
            };
            group.bench_function(format!("{id}, {name}"), |bench| {
                bench.iter(|| driver.step(black_box(&input), majors));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, general_limbs, quartic, whole_robot);
criterion_main!(benches);
