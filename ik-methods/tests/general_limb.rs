//! The general closed form against forward kinematics: every solution reproduces its pose, the joints that made the pose are
//! among them, and targets out of reach have none.

#![allow(
    clippy::unwrap_used,
    reason = "helpers of a test build tables that are known to be good"
)]

use ik_methods::reverse_decoupling::general::{
    DhRow, FarAxes, GeneralLimb, LimbError, Misfit, Outcome, Solutions, Triple,
};
use nalgebra::{Matrix3, Rotation3, SMatrix, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// SplitMix64 (Steele, Lea & Flood 2014).
struct Draw(u64);

impl Draw {
    fn within(&mut self, size: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 * size - size
    }

    fn joints(&mut self) -> [f64; 6] {
        std::array::from_fn(|_| self.within(PI))
    }

    fn rotation(&mut self) -> Matrix3<f64> {
        let [roll, pitch, yaw, ..] = self.joints();
        Rotation3::from_euler_angles(roll, pitch, yaw).into_inner()
    }

    /// A twist whose sine is at least 0.2.
    fn twist(&mut self) -> f64 {
        loop {
            let twist = self.within(PI);
            if twist.sin().abs() > 0.2 {
                return twist;
            }
        }
    }

    /// A length between 0.1 and 0.5 of either sign.
    fn length(&mut self) -> f64 {
        let length = self.within(0.4);
        length + 0.1f64.copysign(length)
    }
}

fn row(alpha_deg: f64, a: f64, d: f64) -> DhRow {
    DhRow {
        alpha: alpha_deg.to_radians(),
        a,
        d,
    }
}

/// Notes, section 2: thigh, shank, ankle to sole, offset of the hip.
fn leg(thigh: f64, shank: f64, foot: f64, offset: f64) -> GeneralLimb {
    GeneralLimb::new([
        row(90.0, 0.0, 0.0),
        row(-90.0, 0.0, 0.0),
        row(0.0, thigh, offset),
        row(0.0, shank, 0.0),
        row(90.0, 0.0, 0.0),
        row(0.0, foot, 0.0),
    ])
    .unwrap()
}

fn hubo_leg() -> GeneralLimb {
    leg(0.30003, 0.30038, 0.09497, 0.0)
}

fn hrp2_leg() -> GeneralLimb {
    leg(0.300, 0.300, 0.105, 0.035)
}

/// Notes, section 2: upper arm, forearm, hand.
fn arm(upper: f64, fore: f64, hand: f64) -> GeneralLimb {
    GeneralLimb::new([
        row(90.0, 0.0, 0.0),
        row(-90.0, 0.0, 0.0),
        row(90.0, 0.0, -upper),
        row(90.0, 0.0, 0.0),
        row(90.0, 0.0, fore),
        row(0.0, hand, 0.0),
    ])
    .unwrap()
}

fn hubo_arm() -> GeneralLimb {
    arm(0.17914, 0.18159, 0.12065)
}

/// The embedded arm6 (shoulder beside the waist axis, elbow offset, spherical wrist), joints counted from its D-H zero.
fn arm6() -> [DhRow; 6] {
    [
        row(-90.0, 0.06, 0.38),
        row(0.0, 0.41, 0.02),
        row(-90.0, 0.04, -0.02),
        row(90.0, 0.0, 0.38),
        row(-90.0, 0.0, 0.0),
        row(17.0, 0.01, 0.12),
    ]
}

/// Axes 5 and 6 parallel, all twists right angles.
fn parallel_arm() -> GeneralLimb {
    GeneralLimb::new([
        row(90.0, 0.0, 0.0),
        row(-90.0, 0.0, 0.0),
        row(90.0, 0.1, -0.2),
        row(90.0, 0.05, 0.1),
        row(0.0, 0.2, 0.1),
        row(0.0, 0.1, 0.0),
    ])
    .unwrap()
}

/// A random chain with its triple at the base.
fn random_rows(draw: &mut Draw, far_axes: FarAxes) -> [DhRow; 6] {
    let mut rows: [DhRow; 6] = std::array::from_fn(|_| DhRow {
        alpha: draw.twist(),
        a: draw.length(),
        d: draw.length(),
    });
    (rows[0].a, rows[1].a, rows[1].d) = (0.0, 0.0, 0.0);
    match far_axes {
        FarAxes::Meeting => rows[4].a = 0.0,
        FarAxes::Parallel => rows[4].alpha = if draw.within(1.0) > 0.0 { 0.0 } else { PI },
        FarAxes::Skew => {}
    }
    rows
}

/// The same chain seen from its other end, after a last frame of its own.
fn from_the_other_end(rows: &[DhRow; 6], draw: &mut Draw) -> [DhRow; 6] {
    let mut turned: [DhRow; 6] = std::array::from_fn(|i| DhRow {
        alpha: if i < 5 { -rows[4 - i].alpha } else { draw.twist() },
        a: if i < 5 { -rows[4 - i].a } else { draw.length() },
        d: -rows[5 - i].d,
    });
    turned[5].d = draw.length();
    turned
}

fn turns_between(one: f64, other: f64) -> f64 {
    let turned = (one - other).rem_euclid(TAU);
    turned.min(TAU - turned)
}

fn distance(one: &[f64; 6], other: &[f64; 6]) -> f64 {
    one.iter()
        .zip(other)
        .map(|(a, b)| turns_between(*a, *b))
        .fold(0.0, f64::max)
}

/// Distance to the nearest solution; infinite, not NaN, if one is not a number.
fn nearest(solutions: &Solutions, joints: &[f64; 6]) -> f64 {
    let all = solutions.as_slice().iter();
    all.map(|found| distance(found, joints))
        .fold(f64::INFINITY, f64::min)
}

/// Largest entry of the difference of two poses (rad, m).
fn pose_error(limb: &GeneralLimb, joints: &[f64; 6], pose: &(Matrix3<f64>, Vector3<f64>)) -> f64 {
    let (rotation, position) = limb.forward(joints);
    let error = (rotation - pose.0)
        .abs()
        .max()
        .max((position - pose.1).abs().max());
    if error.is_nan() { f64::INFINITY } else { error }
}

/// Smallest singular value of the Jacobian, lengths in units of 1 m, by central differences.
fn regularity(limb: &GeneralLimb, joints: &[f64; 6]) -> f64 {
    let mut jacobian = SMatrix::<f64, 6, 6>::zeros();
    let (rotation, _) = limb.forward(joints);
    for j in 0..6 {
        let step = 1e-6;
        let [mut up, mut down] = [*joints; 2];
        up[j] += step;
        down[j] -= step;
        let ((ru, pu), (rd, pd)) = (limb.forward(&up), limb.forward(&down));
        let spin = (ru - rd) / (2.0 * step) * rotation.transpose();
        let rate = (pu - pd) / (2.0 * step);
        let column = [rate.x, rate.y, rate.z, spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]];
        jacobian.set_column(j, &column.into());
    }
    jacobian.singular_values().min()
}

fn assert_wrapped(solutions: &Solutions) {
    for joint in solutions.as_slice().iter().flatten() {
        assert!(*joint > -PI && *joint <= PI, "{solutions:?}");
    }
}

/// What one random pose yielded.
struct Sample {
    recovered: f64,
    count: usize,
    errors: Vec<f64>,
}

/// Solves the pose of `joints` with the other arm straight at zero as previous joints.
fn sample(limb: &GeneralLimb, joints: &[f64; 6]) -> Sample {
    let pose = limb.forward(joints);
    let mut solutions = Solutions::default();
    let outcome = limb.solve_into(&pose.0, &pose.1, &[0.0; 6], &mut solutions);
    let found = solutions.as_slice();
    assert_eq!(outcome, Outcome::Solved(found.len()), "{limb:?} {joints:?}");
    assert_wrapped(&solutions);
    Sample {
        recovered: nearest(&solutions, joints),
        count: found.len(),
        errors: found.iter().map(|q| pose_error(limb, q, &pose)).collect(),
    }
}

/// 1000 regular samples: all forward errors below 1e-9, half below 1e-11; the joints of every pose recovered to 1e-6 rad.
fn check_random(seed: u64, triple: Triple, far_axes: FarAxes) {
    let mut draw = Draw(seed);
    let (mut regular, mut skipped, mut errors) = (0, 0, Vec::new());
    while regular < 1000 {
        let rows = random_rows(&mut draw, far_axes);
        let rows = match triple {
            Triple::Base => rows,
            Triple::Tip => from_the_other_end(&rows, &mut draw),
        };
        let limb = GeneralLimb::new(rows).unwrap();
        assert_eq!((limb.triple(), limb.far_axes()), (triple, far_axes));
        let joints = draw.joints();
        if regularity(&limb, &joints) < 1e-3 {
            skipped += 1;
            continue;
        }
        regular += 1;
        let sample = sample(&limb, &joints);
        assert!(
            sample.recovered < 1e-6,
            "{:e}: {rows:?} {joints:?}",
            sample.recovered
        );
        assert!(
            sample.count.is_multiple_of(2),
            "{} solutions: {rows:?} {joints:?}",
            sample.count
        );
        let worst = sample.errors.iter().copied().fold(0.0, f64::max);
        assert!(worst < 1e-9, "{worst:e}: {rows:?} {joints:?}");
        errors.extend(sample.errors);
    }
    errors.sort_by(f64::total_cmp);
    assert!(errors[errors.len() / 2] < 1e-14, "{:e}", errors[errors.len() / 2]);
    assert!(
        errors[errors.len() * 99 / 100] < 1e-11,
        "{:e}",
        errors[errors.len() * 99 / 100]
    );
    assert!(skipped <= 100, "{skipped} samples were near-singular");
}

#[test]
fn base_triple_far_axes_meeting() {
    check_random(0x4a11, Triple::Base, FarAxes::Meeting);
}

#[test]
fn base_triple_far_axes_parallel() {
    check_random(0x4a12, Triple::Base, FarAxes::Parallel);
}

#[test]
fn base_triple_far_axes_skew() {
    check_random(0x4a13, Triple::Base, FarAxes::Skew);
}

#[test]
fn tip_triple_far_axes_meeting() {
    check_random(0x4a14, Triple::Tip, FarAxes::Meeting);
}

#[test]
fn tip_triple_far_axes_parallel() {
    check_random(0x4a15, Triple::Tip, FarAxes::Parallel);
}

#[test]
fn tip_triple_far_axes_skew() {
    check_random(0x4a16, Triple::Tip, FarAxes::Skew);
}

/// A small a5 or sin α5 brings pairs of roots of the quartic together; below 1e-7 it is neglected.
#[test]
fn far_axes_that_nearly_meet_or_nearly_run_parallel() {
    let mut draw = Draw(0x4a17);
    for small in [1e-3, 1e-4, 1e-5, 1e-6, 2e-7, 1e-8] {
        let (joints_within, pose_within) = if small > 1e-7 { (1e-6, 1e-9) } else { (1e-3, 1e-7) };
        for _ in 0..200 {
            let mut near_meeting = random_rows(&mut draw, FarAxes::Skew);
            near_meeting[4].a = small;
            let mut near_parallel = random_rows(&mut draw, FarAxes::Skew);
            near_parallel[4].alpha = small;
            for rows in [near_meeting, near_parallel] {
                let limb = GeneralLimb::new(rows).unwrap();
                let joints = draw.joints();
                if regularity(&limb, &joints) < 1e-3 {
                    continue;
                }
                let sample = sample(&limb, &joints);
                assert!(
                    sample.recovered < joints_within,
                    "{small:e}: {:e}",
                    sample.recovered
                );
                assert!(
                    sample.errors.iter().all(|error| *error < pose_within),
                    "{small:e}: {:?}",
                    sample.errors
                );
            }
        }
    }
}

/// Poses of random joints, singular ones left out: number of distinct solutions, recovery, forward error.
fn check_eight(limb: &GeneralLimb, seed: u64) {
    let mut draw = Draw(seed);
    let mut skipped = 0;
    for _ in 0..5000 {
        let joints = draw.joints();
        if regularity(limb, &joints) < 1e-3 {
            skipped += 1;
            continue;
        }
        let pose = limb.forward(&joints);
        let mut solutions = Solutions::default();
        let outcome = limb.solve_into(&pose.0, &pose.1, &[0.0; 6], &mut solutions);
        assert_eq!(outcome, Outcome::Solved(8), "{joints:?}");
        assert!(nearest(&solutions, &joints) < 1e-6, "{joints:?}");
        assert_wrapped(&solutions);
        for (i, found) in solutions.as_slice().iter().enumerate() {
            assert!(pose_error(limb, found, &pose) < 1e-10, "{joints:?}");
            for other in &solutions.as_slice()[..i] {
                assert!(distance(found, other) > 1e-6, "{joints:?}");
            }
        }
    }
    assert!(skipped < 500, "{skipped} of 5000 samples were near-singular");
}

#[test]
fn hubo_leg_has_eight_solutions() {
    assert_eq!(hubo_leg().far_axes(), FarAxes::Meeting);
    check_eight(&hubo_leg(), 0x4b01);
}

#[test]
fn hrp2_leg_has_eight_solutions() {
    check_eight(&hrp2_leg(), 0x4b02);
}

#[test]
fn hubo_arm_has_eight_solutions() {
    check_eight(&hubo_arm(), 0x4b03);
}

/// Industrial arms have their triple at the tip. Beside the waist axis the shoulder makes the quartic necessary, on it not.
#[test]
fn spherical_wrists() {
    let mut on_axis = arm6();
    on_axis[0].a = 0.0;
    for (rows, far_axes) in [(arm6(), FarAxes::Skew), (on_axis, FarAxes::Meeting)] {
        let limb = GeneralLimb::new(rows).unwrap();
        assert_eq!((limb.triple(), limb.far_axes()), (Triple::Tip, far_axes));
        let mut draw = Draw(0x4b04);
        let mut eights = 0;
        for _ in 0..5000 {
            let joints = draw.joints();
            if regularity(&limb, &joints) < 1e-3 {
                continue;
            }
            let sample = sample(&limb, &joints);
            assert!(sample.recovered < 1e-6, "{joints:?}");
            assert!(sample.errors.iter().all(|error| *error < 1e-10), "{joints:?}");
            eights += usize::from(sample.count == 8);
        }
        // With the shoulder on the axis every reachable pose is reached facing both ways.
        assert!(
            eights > if far_axes == FarAxes::Meeting { 4700 } else { 3000 },
            "{eights}"
        );
    }
}

/// Joints on multiples of 45° are mostly singular. With the generating joints as previous ones they are recovered.
#[test]
fn singular_grids() {
    let mut on_axis = arm6();
    on_axis[0].a = 0.0;
    for limb in [
        GeneralLimb::new(arm6()).unwrap(),
        GeneralLimb::new(on_axis).unwrap(),
        parallel_arm(),
        hubo_leg(),
        hrp2_leg(),
        leg(0.3, 0.3, 0.1, 0.0),
        hubo_arm(),
        arm(0.25, 0.25, 0.15),
    ] {
        let mut solutions = Solutions::default();
        for index in 0..8usize.pow(6) {
            let joints: [f64; 6] =
                std::array::from_fn(|j| (index / 8usize.pow(j as u32) % 8) as f64 * FRAC_PI_2 / 2.0);
            let pose = limb.forward(&joints);
            let outcome = limb.solve_into(&pose.0, &pose.1, &joints, &mut solutions);
            assert!(matches!(outcome, Outcome::Solved(_)), "{joints:?}: {outcome:?}");
            assert!(nearest(&solutions, &joints) < 1e-5, "{joints:?}: {solutions:?}");
            for found in solutions.as_slice() {
                let error = pose_error(&limb, found, &pose);
                assert!(error < 2e-7, "{joints:?}: {error:e} {found:?}");
            }
        }
    }
}

/// A triple that is not orthogonal has a singular t2 too, and orientations it cannot reach.
#[test]
fn oblique_triple() {
    let mut rows = random_rows(&mut Draw(0x4c01), FarAxes::Meeting);
    (rows[0].alpha, rows[1].alpha) = (0.7, -0.7);
    let limb = GeneralLimb::new(rows).unwrap();
    let mut solutions = Solutions::default();
    let joints = [0.4, 0.0, -0.9, 0.8, 1.1, -2.0];
    let pose = limb.forward(&joints);
    limb.solve_into(&pose.0, &pose.1, &joints, &mut solutions);
    assert!(nearest(&solutions, &joints) < 1e-6);
    assert!(
        solutions
            .as_slice()
            .iter()
            .all(|q| pose_error(&limb, q, &pose) < 2e-7)
    );

    // Axis 3 is never farther than 1.4 rad from axis 1: turned to the opposite direction, no elbow can make up for it.
    let mut refused = 0;
    let mut draw = Draw(0x4c02);
    for _ in 0..500 {
        let (_, position) = limb.forward(&draw.joints());
        let pose = (draw.rotation(), position);
        match limb.solve_into(&pose.0, &pose.1, &[0.0; 6], &mut solutions) {
            Outcome::Solved(_) => {
                for found in solutions.as_slice() {
                    assert!(pose_error(&limb, found, &pose) < 1e-9);
                }
            }
            Outcome::OutOfReach { .. } => {
                assert!(solutions.as_slice().is_empty());
                refused += 1;
            }
        }
    }
    assert!(refused > 50 && refused < 450, "{refused}");
}

/// Pose that puts the hip (the meeting point) at p' in frame 6.
fn seen_at(rotation: Matrix3<f64>, centre: Vector3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
    (rotation, -rotation * centre)
}

/// The leg reaches from |l3 − l4| to l3 + l4 around the ankle; a nanometre decides.
#[test]
fn reach_boundary_of_the_leg() {
    let limb = hubo_leg();
    let (farthest, nearest) = (0.30003 + 0.30038, 0.30038 - 0.30003);
    let mut draw = Draw(0x4d01);
    let mut solutions = Solutions::default();
    for _ in 0..500 {
        let direction = Vector3::from_fn(|_, _| draw.within(1.0)).normalize();
        let rotation = draw.rotation();
        let pose = |length: f64| seen_at(rotation, direction * length - Vector3::x() * 0.09497);
        for inside in [
            farthest - 1.1e-9,
            farthest + 0.9e-9,
            nearest + 1.1e-9,
            nearest - 0.9e-9,
        ] {
            let target = pose(inside);
            let outcome = limb.solve_into(&target.0, &target.1, &[0.0; 6], &mut solutions);
            assert!(matches!(outcome, Outcome::Solved(_)), "{inside}: {outcome:?}");
            for found in solutions.as_slice() {
                assert!(pose_error(&limb, found, &target) < 1.1e-9);
            }
        }
        for (outside, by) in [
            (farthest + 1.1e-9, 1.1e-9),
            (nearest - 1.1e-9, 1.1e-9),
            (farthest + 0.2, 0.2),
        ] {
            let target = pose(outside);
            let outcome = limb.solve_into(&target.0, &target.1, &[0.0; 6], &mut solutions);
            let Outcome::OutOfReach {
                excess_m: Some(excess),
            } = outcome
            else {
                panic!("{outside}: {outcome:?}");
            };
            assert!((excess - by).abs() < 1e-12, "{excess:e} for {by:e}");
            assert!(solutions.as_slice().is_empty());
        }
    }
}

/// An arm within reach by distance still needs |p'z| ≤ l2 |S4|; the hip offset of HRP-2 keeps the ankle's axis d3 away.
#[test]
fn reach_that_depends_on_orientation() {
    let (upper, fore, hand) = (0.17914, 0.18159, 0.12065);
    let limb = hubo_arm();
    let mut draw = Draw(0x4d02);
    let mut solutions = Solutions::default();
    let mut counts = [0; 2];
    for _ in 0..2000 {
        let from_wrist = Vector3::from_fn(|_, _| draw.within(0.3));
        let target = seen_at(draw.rotation(), from_wrist - Vector3::x() * hand);
        let cos4 = (from_wrist.norm_squared() - upper * upper - fore * fore) / (2.0 * upper * fore);
        let expected = cos4.abs() <= 1.0 && from_wrist.z.abs() <= upper * (1.0 - cos4 * cos4).sqrt();
        let outcome = limb.solve_into(&target.0, &target.1, &[0.0; 6], &mut solutions);
        assert_eq!(matches!(outcome, Outcome::Solved(_)), expected, "{from_wrist:?}");
        counts[usize::from(expected)] += 1;
        for found in solutions.as_slice() {
            assert!(pose_error(&limb, found, &target) < 1e-9);
        }
    }
    assert!(counts.iter().all(|count| *count > 200), "{counts:?}");

    let limb = hrp2_leg();
    for (radius, reached) in [
        (0.034, false),
        (0.035 - 2e-9, false),
        (0.035 + 2e-9, true),
        (0.036, true),
    ] {
        let target = seen_at(draw.rotation(), Vector3::new(radius - 0.105, 0.0, 0.4));
        let outcome = limb.solve_into(&target.0, &target.1, &[0.0; 6], &mut solutions);
        assert_eq!(
            matches!(outcome, Outcome::Solved(_)),
            reached,
            "{radius}: {outcome:?}"
        );
    }
}

/// Targets anywhere for chains that need the quartic: a solution is right, or there is none.
#[test]
fn quartic_never_answers_wrongly() {
    let mut draw = Draw(0x4d03);
    let mut solutions = Solutions::default();
    let mut refused = 0;
    for _ in 0..2000 {
        let rows = random_rows(&mut draw, FarAxes::Skew);
        let limb = GeneralLimb::new(rows).unwrap();
        let target = (draw.rotation(), Vector3::from_fn(|_, _| draw.within(1.5)));
        match limb.solve_into(&target.0, &target.1, &[0.0; 6], &mut solutions) {
            Outcome::Solved(count) => assert_eq!(count, solutions.as_slice().len()),
            Outcome::OutOfReach { .. } => refused += 1,
        }
        for found in solutions.as_slice() {
            assert!(pose_error(&limb, found, &target) < 2e-9);
        }
        let length: f64 = rows.iter().map(|row| row.a.hypot(row.d)).sum();
        let beyond = draw.rotation() * Vector3::new(length + 1e-3, 0.0, 0.0);
        let outcome = limb.solve_into(&target.0, &beyond, &[0.0; 6], &mut solutions);
        assert!(matches!(outcome, Outcome::OutOfReach { .. }));
    }
    assert!(refused > 200 && refused < 1900, "{refused}");
}

#[test]
fn poses_that_are_not_finite_have_no_solution() {
    let (rotation, position) = hubo_leg().forward(&[0.3; 6]);
    for limb in [hubo_leg(), hubo_arm(), GeneralLimb::new(arm6()).unwrap()] {
        let mut solutions = Solutions::default();
        for entry in 0..12 {
            let (mut rotation, mut position) = (rotation, position);
            if entry < 9 {
                rotation[entry] = f64::NAN;
            } else {
                position[entry - 9] = f64::NAN;
            }
            let outcome = limb.solve_into(&rotation, &position, &[0.0; 6], &mut solutions);
            assert!(matches!(outcome, Outcome::OutOfReach { .. }), "entry {entry}");
            assert!(solutions.as_slice().is_empty());
        }
    }
}

/// The triple's misfit at the base, of a table made from the Hubo leg whose tip has none.
fn refused_base(change: impl FnOnce(&mut [DhRow; 6])) -> (Misfit, Misfit) {
    let mut rows = [
        row(90.0, 0.0, 0.0),
        row(-90.0, 0.0, 0.0),
        row(0.0, 0.3, 0.0),
        row(0.0, 0.3, 0.0),
        row(90.0, 0.0, 0.0),
        row(0.0, 0.1, 0.0),
    ];
    change(&mut rows);
    match GeneralLimb::new(rows) {
        Err(LimbError::NoTriple { base, tip }) => (base, tip),
        other => panic!("{other:?}"),
    }
}

#[test]
fn refusals_name_the_row() {
    let apart = |row, entry, value| Misfit::Apart { row, entry, value };
    assert_eq!(
        refused_base(|rows| rows[0].a = 0.01),
        (apart(1, "a", 0.01), apart(4, "a", 0.3))
    );
    assert_eq!(refused_base(|rows| rows[1].a = 0.01).0, apart(2, "a", 0.01));
    assert_eq!(refused_base(|rows| rows[1].d = 2e-6).0, apart(2, "d", 2e-6));
    assert!(matches!(
        refused_base(|rows| rows[1].alpha = 0.0).0,
        Misfit::Parallel { row: 2, .. }
    ));
    assert_eq!(
        refused_base(|rows| rows[2].a = 0.0).0,
        Misfit::FourAxesMeet { row: 3 }
    );
    assert_eq!(
        refused_base(|rows| rows[4].alpha = PI).0,
        Misfit::FarAxesCoincide { row: 5 }
    );
    let parallel = refused_base(|rows| (rows[4].alpha, rows[4].a) = (0.0, 0.1));
    assert_eq!(parallel.0, Misfit::NoElbow { row: 4 });
    assert!(
        LimbError::NoTriple {
            base: parallel.0,
            tip: parallel.1
        }
        .to_string()
        .contains("at the base, row 4")
    );

    let mut rows = arm6();
    rows[4].d = 0.02;
    let Err(LimbError::NoTriple { base, tip }) = GeneralLimb::new(rows) else {
        panic!("the wrist of arm6 no longer meets");
    };
    assert_eq!((base, tip), (apart(1, "a", 0.06), apart(5, "d", 0.02)));
    let mut rows = arm6();
    rows[3].alpha = 0.0;
    assert!(matches!(
        GeneralLimb::new(rows),
        Err(LimbError::NoTriple {
            tip: Misfit::Parallel { row: 4, .. },
            ..
        })
    ));
    let mut rows = arm6();
    (rows[0].a, rows[0].alpha) = (0.0, PI);
    assert!(matches!(
        GeneralLimb::new(rows),
        Err(LimbError::NoTriple {
            tip: Misfit::FarAxesCoincide { row: 1 },
            ..
        })
    ));
    rows[5].a = f64::NAN;
    assert!(matches!(
        GeneralLimb::new(rows),
        Err(LimbError::NotFinite { row: 6 })
    ));
}
