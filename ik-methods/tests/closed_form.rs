//! The closed forms of legs and arms: every branch by forward kinematics, the generating posture found again, indicators,
//! singular grids, and the boundary of reach.

#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs, reason = "tests")]

use ik_methods::reverse_decoupling::general::{self, DhRow, GeneralLimb};
use ik_methods::reverse_decoupling::{
    Arm, ArmBranch, ElbowArm, Leg, LegBranch, LimbPose, Solutions, Unsolved, distance,
};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

const POSES: u64 = 20_000;
/// Sines and cosines that mark singular sets must exceed this for joints to be compared.
const REGULAR: f64 = 1e-3;

fn legs() -> Vec<(&'static str, Leg)> {
    let leg = |thigh_m, shank_m, ankle_m, hip_offset_m| Leg {
        thigh_m,
        shank_m,
        ankle_m,
        hip_offset_m,
    };
    vec![
        ("hubo", leg(0.30003, 0.30038, 0.09497, 0.0)),
        ("hoap2", leg(0.1, 0.1, 0.037, 0.0)),
        ("hrp2 left", leg(0.3, 0.3, 0.105, 0.035)),
        ("hrp2 right", leg(0.3, 0.3, 0.105, -0.035)),
        ("asimo", leg(0.28, 0.3, 0.09, 0.0)),
    ]
}

fn arms() -> Vec<(&'static str, Arm)> {
    let arm = |upper_arm_m, forearm_m, hand_m| Arm {
        upper_arm_m,
        forearm_m,
        hand_m,
    };
    vec![
        ("hubo", arm(0.17914, 0.18159, 0.12065)),
        ("hrp2", arm(0.25, 0.25, 0.15)),
        ("asimo", arm(0.24, 0.22, 0.12)),
    ]
}

/// Numbers in ±1 from a seed (SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn joints<const N: usize>(&mut self) -> [f64; N] {
        std::array::from_fn(|_| PI * self.next())
    }
}

fn error(a: &LimbPose, b: &LimbPose) -> f64 {
    (a.rotation - b.rotation)
        .amax()
        .max((a.position - b.position).amax())
}

/// The position the common point of the first axes has in frame 6, seen from the last axis: p' with the end link added.
fn seen(pose: &LimbPose, end_m: f64) -> Vector3<f64> {
    let p = -(pose.rotation.transpose() * pose.position);
    p + Vector3::new(end_m, 0.0, 0.0)
}

#[test]
fn legs_are_solved_in_every_branch() {
    for (name, leg) in legs() {
        let (mut numbers, mut excluded, mut worst) = (Numbers(1), 0, 0.0_f64);
        for _ in 0..POSES {
            let q: [f64; 6] = numbers.joints();
            let pose = leg.forward(&q);
            let mut all = Solutions::default();
            leg.solve_all(&pose, &[0.0; 6], &mut all).unwrap();
            for (solution, number) in all.iter() {
                worst = worst.max(error(&leg.forward(solution), &pose));
                let one = leg.solve(&pose, LegBranch::numbered(number), &[0.0; 6]).unwrap();
                assert_eq!(&one, solution);
            }
            let k = (q[3] + q[4]).cos() * leg.thigh_m + q[4].cos() * leg.shank_m;
            if q[1].sin().abs() < REGULAR || q[3].sin().abs() < REGULAR || k.abs() < REGULAR * leg.thigh_m {
                excluded += 1;
                continue;
            }
            assert_eq!(all.len(), 8, "{name}: {q:?}");
            let branch = leg.branch(&q);
            let found = leg.solve(&pose, branch, &[0.0; 6]).unwrap();
            assert!(distance(&found, &q) < 1e-6, "{name}: {q:?} {found:?}");
            for (solution, number) in all.iter() {
                assert_eq!(leg.branch(solution).number(), number, "{name}");
            }
            assert!(distance(&leg.solve_nearest(&pose, &q).unwrap(), &q) < 1e-6);
        }
        assert!(worst < 1e-10, "{name}: {worst:e}");
        assert!(excluded < 200, "{name}: {excluded} of {POSES} excluded");
    }
}

#[test]
fn arms_are_solved_in_every_branch() {
    for (name, arm) in arms() {
        let (mut numbers, mut excluded, mut worst) = (Numbers(2), 0, 0.0_f64);
        for _ in 0..POSES {
            let q: [f64; 6] = numbers.joints();
            let pose = arm.forward(&q);
            let mut all = Solutions::default();
            arm.solve_all(&pose, &[0.0; 6], &mut all).unwrap();
            for (solution, number) in all.iter() {
                worst = worst.max(error(&arm.forward(solution), &pose));
                let one = arm.solve(&pose, ArmBranch::numbered(number), &[0.0; 6]).unwrap();
                assert_eq!(&one, solution);
            }
            let singular = [q[1].sin(), q[3].sin(), q[4].cos()];
            if singular.iter().any(|s| s.abs() < REGULAR) {
                excluded += 1;
                continue;
            }
            assert_eq!(all.len(), 8, "{name}: {q:?}");
            let found = arm.solve(&pose, arm.branch(&q), &[0.0; 6]).unwrap();
            assert!(distance(&found, &q) < 1e-6, "{name}: {q:?} {found:?}");
            for (solution, number) in all.iter() {
                assert_eq!(arm.branch(solution).number(), number, "{name}");
            }
            assert!(distance(&arm.solve_nearest(&pose, &q).unwrap(), &q) < 1e-6);
        }
        assert!(worst < 1e-10, "{name}: {worst:e}");
        assert!(excluded < 300, "{name}: {excluded} of {POSES} excluded");
    }
}

#[test]
fn the_arm_of_four_joints_has_two_solutions_and_refuses_other_poses() {
    let arm = ElbowArm {
        arm: Arm {
            upper_arm_m: 0.101,
            forearm_m: 0.1,
            hand_m: 0.033,
        },
    };
    let mut numbers = Numbers(3);
    for _ in 0..POSES {
        let q: [f64; 4] = numbers.joints();
        let pose = arm.forward(&q);
        let mut all = Solutions::default();
        arm.solve_all(&pose, &[0.0; 4], &mut all).unwrap();
        assert!(all.iter().all(|(q, _)| error(&arm.forward(q), &pose) < 1e-10));
        if q[1].sin().abs() > REGULAR {
            assert_eq!(all.len(), 2);
            assert!(all.iter().any(|(solution, _)| distance(solution, &q) < 1e-6));
        }
        // Off its set by a turn about the forearm.
        let turn = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.8, -0.6, 0.0, 0.6, 0.8);
        let off = LimbPose {
            rotation: pose.rotation * turn,
            ..pose
        };
        let refused = arm.solve_all(&off, &[0.0; 4], &mut all);
        assert!(matches!(refused, Err(Unsolved::OffSet { .. })), "{refused:?}");
        assert!(all.is_empty());
    }
}

/// The solver of any such limb and the forms of the paper: the same postures, neither more nor fewer.
#[test]
fn the_general_solver_finds_the_same_solutions() {
    let general = |rows: [(f64, f64, f64); 6]| {
        GeneralLimb::new(rows.map(|(d, a, alpha)| DhRow { alpha, a, d })).unwrap()
    };
    let h = FRAC_PI_2;
    let same = |name: &str, closed: &Solutions<6>, pose: &LimbPose, limb: &GeneralLimb| {
        let mut others = general::Solutions::default();
        limb.solve_into(&pose.rotation, &pose.position, &[0.0; 6], &mut others);
        assert_eq!(closed.len(), others.as_slice().len(), "{name}");
        for (solution, _) in closed.iter() {
            let among = others
                .as_slice()
                .iter()
                .any(|other| distance(other, solution) < 1e-6);
            assert!(among, "{name}: {solution:?}");
        }
    };
    let mut numbers = Numbers(6);
    for _ in 0..2000 {
        let q: [f64; 6] = numbers.joints();
        if [q[1].sin(), q[3].sin(), q[4].cos()]
            .iter()
            .any(|s| s.abs() < 10.0 * REGULAR)
        {
            continue;
        }
        for (name, leg) in legs() {
            let k = (q[3] + q[4]).cos() * leg.thigh_m + q[4].cos() * leg.shank_m;
            if k.abs() < 10.0 * REGULAR * leg.thigh_m {
                continue;
            }
            let (l3, l4, l5, d3) = (leg.thigh_m, leg.shank_m, leg.ankle_m, leg.hip_offset_m);
            let rows = [
                (0.0, 0.0, h),
                (0.0, 0.0, -h),
                (d3, l3, 0.0),
                (0.0, l4, 0.0),
                (0.0, 0.0, h),
                (0.0, l5, 0.0),
            ];
            let (pose, mut all) = (leg.forward(&q), Solutions::default());
            leg.solve_all(&pose, &[0.0; 6], &mut all).unwrap();
            same(name, &all, &pose, &general(rows));
        }
        for (name, arm) in arms() {
            let (l2, l3, l4) = (arm.upper_arm_m, arm.forearm_m, arm.hand_m);
            let rows = [
                (0.0, 0.0, h),
                (0.0, 0.0, -h),
                (-l2, 0.0, h),
                (0.0, 0.0, h),
                (l3, 0.0, h),
                (0.0, l4, 0.0),
            ];
            let (pose, mut all) = (arm.forward(&q), Solutions::default());
            arm.solve_all(&pose, &[0.0; 6], &mut all).unwrap();
            same(name, &all, &pose, &general(rows));
        }
    }
}

/// All six joints on a grid that starts on an axis, so that most poses are singular.
fn grid(step_deg: usize, mut each: impl FnMut([f64; 6])) {
    let count = 360 / step_deg;
    let angle = |i: usize| (i * step_deg) as f64 * PI / 180.0;
    // A walk over the grid with a stride that is prime to its size visits all of it; a part is enough for fine grids.
    let size = count.pow(6);
    let stride = 104_729;
    for i in 0..size.min(60_000) {
        let mut rest = (i * stride) % size;
        each(std::array::from_fn(|_| {
            let digit = rest % count;
            rest /= count;
            angle(digit)
        }));
    }
}

#[test]
fn on_axis_grids_give_the_generating_posture_or_at_least_the_pose() {
    for step in [30, 45, 60] {
        for (name, leg) in legs() {
            grid(step, |q| {
                let pose = leg.forward(&q);
                let mut all = Solutions::default();
                leg.solve_all(&pose, &q, &mut all).unwrap();
                assert!(all.iter().all(|(s, _)| s.iter().all(|x| x.is_finite())));
                assert!(
                    all.iter().all(|(s, _)| error(&leg.forward(s), &pose) < 2e-7),
                    "{name}: {q:?}"
                );
                let found = all.iter().any(|(s, _)| distance(s, &q) < 1e-5);
                assert!(
                    found,
                    "{name}: {q:?} not among {:?}",
                    all.iter().collect::<Vec<_>>()
                );
            });
        }
        for (name, arm) in arms() {
            grid(step, |q| {
                let pose = arm.forward(&q);
                let mut all = Solutions::default();
                arm.solve_all(&pose, &q, &mut all).unwrap();
                assert!(all.iter().all(|(s, _)| s.iter().all(|x| x.is_finite())));
                assert!(
                    all.iter().all(|(s, _)| error(&arm.forward(s), &pose) < 2e-7),
                    "{name}: {q:?}"
                );
                let found = all.iter().any(|(s, _)| distance(s, &q) < 1e-5);
                assert!(
                    found,
                    "{name}: {q:?} not among {:?}",
                    all.iter().collect::<Vec<_>>()
                );
            });
        }
    }
}

#[test]
fn the_boundary_of_reach_is_sharp() {
    for (name, leg) in legs() {
        let longest = (leg.thigh_m + leg.shank_m).hypot(leg.hip_offset_m);
        let straight = leg.forward(&[0.1, -1.0, 0.3, 0.0, 0.4, 0.2]);
        assert!(
            (seen(&straight, leg.ankle_m).norm() - longest).abs() < 1e-14,
            "{name}"
        );
        let along = straight.rotation * Vector3::x();
        let outward = (straight.position - along * leg.ankle_m).normalize();
        let at = |past: f64| LimbPose {
            position: straight.position + outward * past,
            ..straight
        };
        let solved = |past: f64| leg.solve(&at(past), LegBranch::numbered(0), &[0.0; 6]);
        // Within the tolerance it counts as on the boundary, with an error of that size.
        let near = solved(0.9e-9).unwrap();
        assert!(error(&leg.forward(&near), &at(0.0)) < 2e-7, "{name}");
        assert!(solved(-1e-6).is_ok());
        let Err(Unsolved::Distance {
            distance_m,
            largest_m,
            ..
        }) = solved(1e-6)
        else {
            panic!("{name}");
        };
        assert!(
            (distance_m - largest_m - 1e-6).abs() < 1e-12 && (largest_m - longest).abs() < 1e-12,
            "{name}"
        );
    }
}

#[test]
fn an_arm_is_also_held_back_by_its_orientation() {
    for (name, arm) in arms() {
        // The elbow at a right angle: the shoulder can be l2 out of the plane of the last axes, and no more.
        let q = [0.3, 1.0, -0.4, FRAC_PI_2, FRAC_PI_2, 0.2];
        let pose = arm.forward(&q);
        assert!(
            (seen(&pose, arm.hand_m).z.abs() - arm.upper_arm_m).abs() < 1e-14,
            "{name}"
        );
        assert!(arm.solve(&pose, ArmBranch::numbered(0), &[0.0; 6]).is_ok());
        // Tilting the hand about the line through it and the shoulder's foot keeps the distance and leaves the plane.
        let shoulder = seen(&pose, arm.hand_m);
        let mut refused = 0;
        let mut numbers = Numbers(4);
        for _ in 0..2000 {
            // A random pose whose shoulder is at a distance within reach.
            let direction = Vector3::new(numbers.next(), numbers.next(), numbers.next()).normalize();
            let seen_from = direction * shoulder.norm();
            let position = -(pose.rotation * (seen_from - Vector3::new(arm.hand_m, 0.0, 0.0)));
            let tilted = LimbPose { position, ..pose };
            let plane = arm.upper_arm_m;
            match arm.solve(&tilted, ArmBranch::numbered(0), &[0.0; 6]) {
                Ok(found) => {
                    assert!(seen_from.z.abs() <= plane + 1e-9);
                    assert!(error(&arm.forward(&found), &tilted) < 1e-9);
                }
                Err(Unsolved::Orientation { found_m, largest_m }) => {
                    assert!(found_m > largest_m && (largest_m - plane).abs() < 1e-12);
                    assert!(seen_from.z.abs() > plane);
                    refused += 1;
                }
                Err(other) => panic!("{name}: {other}"),
            }
        }
        assert!(refused > 100, "{name}: {refused}");
    }
}

#[test]
fn what_is_no_pose_is_refused_with_its_defect() {
    let (_, leg) = legs()[0];
    let mut pose = leg.forward(&[0.1; 6]);
    pose.rotation[(0, 0)] += 1e-3;
    let Err(Unsolved::NotRigid { defect }) = leg.solve(&pose, LegBranch::numbered(0), &[0.0; 6]) else {
        panic!("a skewed rotation was accepted");
    };
    assert!(defect > 1e-4 && defect < 1e-2);
    pose.position.x = f64::NAN;
    let refused = leg.solve(&pose, LegBranch::numbered(0), &[0.0; 6]).unwrap_err();
    assert_eq!(
        refused,
        Unsolved::NotRigid {
            defect: f64::INFINITY
        }
    );
    // A mirror image is orthogonal and no rotation.
    let mirrored = LimbPose {
        rotation: Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0)),
        position: Vector3::zeros(),
    };
    assert!(matches!(
        leg.solve(&mirrored, LegBranch::numbered(0), &[0.0; 6]),
        Err(Unsolved::NotRigid { .. })
    ));
}

#[test]
fn standing_has_its_knee_forwards() {
    // The posture of the notes: both legs (0, −90°, −t/2, t, −t/2, 0), t > 0.
    for (name, leg) in legs() {
        let t = 0.6;
        let q = [0.0, -FRAC_PI_2, -t / 2.0, t, -t / 2.0, 0.0];
        let branch = leg.branch(&q);
        assert_eq!(
            (branch.knee, branch.ankle, branch.hip),
            (1.0, 1.0, -1.0),
            "{name}"
        );
        assert!(distance(&leg.solve(&leg.forward(&q), branch, &[0.0; 6]).unwrap(), &q) < 1e-12);
    }
}

/// Postures at and near every singular set, at distances from far below to far above the thresholds.
#[test]
fn no_threshold_costs_more_than_it_says() {
    let near = |base: [f64; 6], joint: usize, numbers: &mut Numbers| {
        let mut postures = Vec::new();
        for decade in -140..0 {
            let mut q = base;
            q[joint] += 10f64.powf(0.1 * f64::from(decade)) * numbers.next().signum();
            postures.push(q);
        }
        postures
    };
    let mut numbers = Numbers(5);
    let mut worst = 0.0_f64;
    for (name, leg) in legs() {
        for _ in 0..40 {
            let mut base: [f64; 6] = numbers.joints();
            // Hip, knee, and a hip centre on the ankle's axis (K = 0): t5 with C45 l3 + C5 l4 = 0.
            let on_axis =
                -((base[3].cos() * leg.thigh_m + leg.shank_m).atan2(-base[3].sin() * leg.thigh_m)) + PI;
            for (joint, value) in [(1, 0.0), (1, PI), (3, 0.0), (3, PI), (4, on_axis)] {
                let kept = base[joint];
                base[joint] = value;
                for q in near(base, joint, &mut numbers) {
                    let pose = leg.forward(&q);
                    let mut all = Solutions::default();
                    leg.solve_all(&pose, &q, &mut all).unwrap();
                    for (solution, _) in all.iter() {
                        let found = error(&leg.forward(solution), &pose);
                        assert!(found < 2e-7, "{name} joint {joint}: {found:e} at {q:?}");
                        worst = worst.max(found);
                    }
                }
                base[joint] = kept;
            }
        }
    }
    for (name, arm) in arms() {
        for _ in 0..40 {
            let mut base: [f64; 6] = numbers.joints();
            for (joint, value) in [
                (1, 0.0),
                (1, PI),
                (3, 0.0),
                (3, PI),
                (4, FRAC_PI_2),
                (4, -FRAC_PI_2),
            ] {
                let kept = base[joint];
                base[joint] = value;
                for q in near(base, joint, &mut numbers) {
                    let pose = arm.forward(&q);
                    let mut all = Solutions::default();
                    arm.solve_all(&pose, &q, &mut all).unwrap();
                    for (solution, _) in all.iter() {
                        let found = error(&arm.forward(solution), &pose);
                        assert!(found < 2e-7, "{name} joint {joint}: {found:e} at {q:?}");
                        worst = worst.max(found);
                    }
                }
                base[joint] = kept;
            }
        }
    }
    assert!(worst > 0.0);
}

/// HRP-2's offset makes K = 0 a double root, of which rounding leaves |K| ≈ 1e-8: at S2 = 0 it must not turn the hip.
#[test]
fn a_hip_beside_the_ankle_axis_stays_singular_in_rounded_poses() {
    let mut numbers = Numbers(6);
    for (name, leg) in legs().into_iter().filter(|(_, leg)| leg.hip_offset_m != 0.0) {
        for i in 0..2_000 {
            let mut q: [f64; 6] = numbers.joints();
            q[1] = if i % 2 == 0 { 0.0 } else { PI };
            q[4] = FRAC_PI_2 - (q[3].sin() * leg.thigh_m).atan2(q[3].cos() * leg.thigh_m + leg.shank_m);
            let mut pose = leg.forward(&q);
            pose.position += Vector3::from_fn(|_, _| 3e-16 * numbers.next());
            let mut all = Solutions::default();
            leg.solve_all(&pose, &q, &mut all).unwrap();
            assert!(all.iter().all(|(s, _)| error(&leg.forward(s), &pose) < 2e-7));
            assert!(all.iter().any(|(s, _)| distance(s, &q) < 1e-5), "{name}: {q:?}");
        }
    }
}

/// Equal links folded up, the shoulder at S2 = 0: θ1, θ3, θ5 and θ6 are free together.
/// An offset that is rounding of a model: on the ankle's axis its products vanish.
#[test]
fn a_hip_on_the_ankle_axis_is_solved_with_the_smallest_offsets() {
    let mut numbers = Numbers(12);
    for hip_offset_m in [1e-13, 1e-10, 9e-10] {
        let leg = Leg {
            thigh_m: 0.3,
            shank_m: 0.29,
            ankle_m: 0.1,
            hip_offset_m,
        };
        for _ in 0..200 {
            let mut q: [f64; 6] = numbers.joints();
            // K = 0.
            let (s, c) = q[3].sin_cos();
            q[4] = (leg.thigh_m * c + leg.shank_m).atan2(leg.thigh_m * s);
            let pose = leg.forward(&q);
            // The same with the hip exactly on the axis.
            let rotation = pose.rotation;
            let on_axis = LimbPose {
                position: -(rotation * Vector3::new(-leg.ankle_m, 0.0, seen(&pose, leg.ankle_m).z)),
                ..pose
            };
            for pose in [pose, on_axis] {
                let mut all = Solutions::default();
                leg.solve_all(&pose, &q, &mut all).unwrap();
                for (solution, _) in all.iter() {
                    let off = error(&leg.forward(solution), &pose);
                    assert!(off < 2e-7, "{hip_offset_m:e}: {off:e} {solution:?}");
                }
                let found = all.iter().any(|(s, _)| distance(s, &q) < 1e-5);
                assert!(found, "{hip_offset_m:e}: {q:?}");
            }
        }
    }
}

#[test]
fn a_folded_arm_of_equal_links_does_not_jump() {
    let (_, arm) = arms()[1];
    assert_eq!(arm.upper_arm_m, arm.forearm_m);
    let mut numbers = Numbers(7);
    for i in 0..2_000 {
        let mut q: [f64; 6] = numbers.joints();
        (q[1], q[3]) = (if i % 2 == 0 { 0.0 } else { PI }, PI);
        let previous = q.map(|q| q + 2e-3 * numbers.next());
        let pose = arm.forward(&q);
        let found = arm.solve_nearest(&pose, &previous).unwrap();
        assert!(error(&arm.forward(&found), &pose) < 2e-7);
        let away = distance(&found, &previous);
        assert!(away < 1.2e-2, "{away} from {previous:?}: {found:?}");
    }
}

/// Just beside a stretched elbow, where rounding of the sine needs some slack, no solution misses its pose by more than 2e-7.
#[test]
fn a_nearly_stretched_arm_gives_no_solution_that_misses() {
    let mut accepted = 0;
    for (name, arm) in arms() {
        let (l2, l3) = (arm.upper_arm_m, arm.forearm_m);
        for elbow in [0.0, 1e-7, 2e-7, 3e-7, 4e-7, 4.9e-7, 5.1e-7, 6e-7_f64] {
            for beyond in [1e-9, 1e-8, 3e-8, 1e-7, 1.2e-7, 2e-7] {
                let z = l2 * elbow.sin() + beyond;
                let across = ((l2 + l3 * elbow.cos()).powi(2) + (l3 * elbow.sin()).powi(2) - z * z).sqrt();
                let turn = 1e6 * elbow + 1e7 * beyond;
                let seen = Vector3::new(across * turn.cos() - arm.hand_m, across * turn.sin(), z);
                let rotation = *nalgebra::Rotation3::from_euler_angles(0.3 + turn, -0.8, 1.1 * turn).matrix();
                let pose = LimbPose {
                    rotation,
                    position: -(rotation * seen),
                };
                let mut all = Solutions::default();
                if arm.solve_all(&pose, &[0.2; 6], &mut all).is_ok() {
                    accepted += 1;
                    for (q, _) in all.iter() {
                        let found = arm.forward(q);
                        let off = (found.rotation - rotation)
                            .amax()
                            .max((found.position - pose.position).amax());
                        assert!(off < 2e-7, "{name} {elbow:e} {beyond:e}: {off:e}");
                    }
                }
            }
        }
    }
    assert!(accepted > 10, "{accepted}");
}
