//! What the paper prints of the closed forms and what that does, each beside the form that is used.

#![allow(clippy::unwrap_used, missing_docs, reason = "tests")]

use ik_methods::reverse_decoupling::{
    Arm, ElbowArm, Leg, LegBranch, LimbPose, Solutions, Unsolved, distance,
};
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, PI};

const LEG: Leg = Leg {
    thigh_m: 0.30003,
    shank_m: 0.30038,
    ankle_m: 0.09497,
    hip_offset_m: 0.0,
};
const ARM: Arm = Arm {
    upper_arm_m: 0.17914,
    forearm_m: 0.18159,
    hand_m: 0.12065,
};

fn error(a: &LimbPose, b: &LimbPose) -> f64 {
    (a.rotation - b.rotation)
        .amax()
        .max((a.position - b.position).amax())
}

/// Columns n', s', a' and the vector p' of the inverted pose.
fn inverted(pose: &LimbPose) -> [Vector3<f64>; 4] {
    let r = pose.rotation.transpose();
    let column = |k: usize| r.column(k).into_owned();
    [column(0), column(1), column(2), -(r * pose.position)]
}

fn some_angle(i: usize) -> f64 {
    PI * (2.0 * ((i + 1) as f64 * 0.618_033_988_749_894_9).fract() - 1.0)
}

/// Eqs. (7), (14), (25), (26) and (29) take roots of numbers that are zero at the ends of the range.
#[test]
fn the_root_printed_in_eq_7_is_not_a_number_for_many_stretched_legs() {
    let (mut not_a_number, poses) = (0, 400);
    for i in 0..poses {
        let q = [0, 1, 2, 4, 5].map(|k| some_angle(7 * i + k));
        let q = [q[0], q[1], q[2], 0.0, q[3], q[4]];
        let pose = LEG.forward(&q);
        let [.., p] = inverted(&pose);
        let (l3, l4, x) = (LEG.thigh_m, LEG.shank_m, p.x + LEG.ankle_m);
        let cosine = (x * x + p.y * p.y + p.z * p.z - l3 * l3 - l4 * l4) / (2.0 * l3 * l4);
        let printed = (1.0 - cosine * cosine).sqrt().atan2(cosine);
        not_a_number += usize::from(printed.is_nan());
        let found = LEG.solve_nearest(&pose, &q).unwrap();
        assert!(error(&LEG.forward(&found), &pose) < 1e-9);
    }
    assert!(not_a_number > poses / 10, "{not_a_number} of {poses}");
}

/// The text denies singularities within the limits; at S2 = 0 eqs. (15) to (17) are arc tangents of two zeros.
#[test]
fn eqs_15_to_17_are_hardly_ever_right_at_a_singular_hip() {
    let (mut wrong, poses) = (0, 200);
    for i in 0..poses {
        let mut q: [f64; 6] = std::array::from_fn(|k| some_angle(11 * i + k));
        q[1] = 0.0;
        let pose = LEG.forward(&q);
        let [n, s, a, _] = inverted(&pose);
        // As printed, with the generating joints 4 to 6 handed to it.
        let (s6, c6) = q[5].sin_cos();
        let (vx, vy) = (s6 * n.x + c6 * n.y, s6 * s.x + c6 * s.y);
        let printed = [
            (-vy).atan2(-vx),
            0.0,
            a.z.atan2(c6 * a.x - s6 * a.y) - q[3] - q[4],
            q[3],
            q[4],
            q[5],
        ];
        wrong += usize::from(error(&LEG.forward(&printed), &pose) > 1e-6);
        let mut all = Solutions::default();
        LEG.solve_all(&pose, &q, &mut all).unwrap();
        assert!(all.iter().any(|(found, _)| distance(found, &q) < 1e-6));
    }
    assert!(wrong > poses * 9 / 10, "{wrong} of {poses}");
}

/// Case 2 (stretched elbow) divides by cos θ1 in θ2: 0/0 at θ1 = 90 degrees.
#[test]
fn case_2_as_printed_has_no_second_joint_at_a_right_angle() {
    let q = [FRAC_PI_2, 0.7, 0.3, 0.0, -0.4, 0.9];
    let pose = ARM.forward(&q);
    let [n, ..] = inverted(&pose);
    let (s6, c6) = q[5].sin_cos();
    let gx = c6 * n.y + s6 * n.x;
    // θ2 = atan2(gx, −C1 (…)): both arguments vanish with C1.
    assert!(gx.abs() < 1e-15 && q[0].cos().abs() < 1e-15);
    let mut all = Solutions::default();
    ARM.solve_all(&pose, &q, &mut all).unwrap();
    assert!(all.iter().any(|(found, _)| distance(found, &q) < 1e-6));
    assert!(
        all.iter()
            .all(|(found, _)| error(&ARM.forward(found), &pose) < 1e-9)
    );
}

/// The same case always gives S2 > 0: `if S2 < 0 then add π` asks for a sign that the arc tangent before it has removed.
#[test]
fn case_2_as_printed_misses_half_of_the_postures() {
    let q = [0.4, -0.7, 0.3, 0.0, -0.4, 0.9];
    let pose = ARM.forward(&q);
    let [n, s, a, _] = inverted(&pose);
    let (s6, c6) = q[5].sin_cos();
    let (gx, gy) = (c6 * n.y + s6 * n.x, c6 * s.y + s6 * s.x);
    let printed = gx.hypot(gy).atan2(-(c6 * a.y + s6 * a.x));
    assert!(printed > 0.0 && (printed - q[1].abs()).abs() < 1e-12);
    let mut all = Solutions::default();
    ARM.solve_all(&pose, &q, &mut all).unwrap();
    let seconds: Vec<f64> = all.iter().map(|(found, _)| found[1]).collect();
    assert!(seconds.iter().any(|s| (s - 0.7).abs() < 1e-9) && seconds.iter().any(|s| (s + 0.7).abs() < 1e-9));
}

/// Cases 1 and 3 are printed for θ2 = π only, cases 2 and 3 for θ4 = 0 only: the others are as singular.
#[test]
fn singular_cases_that_are_not_printed_are_solved_too() {
    for second in [0.0, PI, 0.7] {
        for fourth in [0.0, PI, 1.1] {
            for i in 0..50 {
                let mut q: [f64; 6] = std::array::from_fn(|k| some_angle(13 * i + k));
                (q[1], q[3]) = (second, fourth);
                let pose = ARM.forward(&q);
                let mut all = Solutions::default();
                ARM.solve_all(&pose, &q, &mut all).unwrap();
                assert!(all.iter().any(|(found, _)| distance(found, &q) < 1e-5), "{q:?}");
            }
        }
    }
}

/// Eq. (27) gives θ6 by its tangent, which does not know the half plane.
#[test]
fn the_tangent_of_eq_27_loses_the_quadrant() {
    let (mut wrong, poses) = (0, 200);
    for i in 0..poses {
        let q: [f64; 6] = std::array::from_fn(|k| some_angle(17 * i + k));
        let [.., p] = inverted(&ARM.forward(&q));
        let (l2, l3, x) = (ARM.upper_arm_m, ARM.forearm_m, p.x + ARM.hand_m);
        let printed = (-(q[3].cos() * l2 + l3) / (q[3].sin() * q[4].cos() * l2)).atan() - p.y.atan2(x);
        let off = (printed - q[5]).rem_euclid(2.0 * PI);
        wrong += usize::from(off > 1.0 && off < 2.0 * PI - 1.0);
    }
    assert!(wrong > poses / 4 && wrong < 3 * poses / 4, "{wrong} of {poses}");
}

/// "Imaginary parts appear" out of reach: a distance that is right does not make an arm's pose reachable.
#[test]
fn a_distance_within_reach_is_not_enough_for_an_arm() {
    let q = [0.3, 1.0, -0.4, FRAC_PI_2, FRAC_PI_2, 0.2];
    let pose = ARM.forward(&q);
    let shoulder = inverted(&pose)[3] + Vector3::new(ARM.hand_m, 0.0, 0.0);
    // The same distance, straight out of the plane of the last axes.
    let out = Vector3::new(0.0, 0.0, shoulder.norm());
    let position = -(pose.rotation * (out - Vector3::new(ARM.hand_m, 0.0, 0.0)));
    let refused = ARM
        .solve_nearest(&LimbPose { position, ..pose }, &[0.0; 6])
        .unwrap_err();
    assert!(matches!(refused, Unsolved::Orientation { .. }), "{refused}");
}

/// HOAP-2: θ5 = 0 and θ6 = 90 degrees put into (25) leave the sign of θ4 open; (19) and (20) decide it.
#[test]
fn the_sign_of_eq_25_is_not_free_on_the_arm_of_four_joints() {
    let arm = ElbowArm {
        arm: Arm {
            upper_arm_m: 0.101,
            forearm_m: 0.1,
            hand_m: 0.033,
        },
    };
    for i in 0..100 {
        let q: [f64; 4] = std::array::from_fn(|k| some_angle(19 * i + k));
        let pose = arm.forward(&q);
        let mut all = Solutions::default();
        arm.solve_all(&pose, &q, &mut all).unwrap();
        assert!(all.iter().all(|(found, _)| (found[3] - q[3]).abs() < 1e-9));
        let (other, _) = all.iter().next().unwrap();
        let flipped = [other[0], other[1], other[2], -other[3]];
        assert!(error(&arm.forward(&flipped), &pose) > 1e-3 || q[3].sin().abs() < 0.05);
    }
}

/// ANKLE is written with p in frame 0; with the p' of eq. (2), whose symbol it reuses, it is another sign.
#[test]
fn the_symbol_of_the_ankle_indicator_is_not_that_of_eq_2() {
    let (mut differ, poses) = (0, 200);
    for i in 0..poses {
        let q: [f64; 6] = std::array::from_fn(|k| some_angle(23 * i + k));
        let pose = LEG.forward(&q);
        // x5 in frame 0: rotation of the first five joints.
        let upto5 = LEG.forward(&[q[0], q[1], q[2], q[3], q[4], 0.0]);
        let (x5, x6) = (
            upto5.rotation.column(0).into_owned(),
            pose.rotation.column(0).into_owned(),
        );
        let meant = (pose.position - x6 * LEG.ankle_m).dot(&x5);
        assert_eq!(meant < 0.0, LEG.branch(&q).ankle < 0.0);
        let read = (inverted(&pose)[3] - x6 * LEG.ankle_m).dot(&x5);
        differ += usize::from((meant < 0.0) != (read < 0.0));
    }
    assert!(differ > poses / 5, "{differ} of {poses}");
    assert_eq!(LegBranch::numbered(5).number(), 5);
}
