//! The printed equations that cannot be meant: each as printed, what it does, and that the correction does not.
//!
//! Times in the printed foot equations are read 2j where the source prints j; why is the first test.

use super::{build, text};
use crate::trajectory::Locomotion;
use crate::trajectory::gait::{Gait, Walk, rows};
use crate::trajectory::spline::{CubicSpline, Curve};
use crate::trajectory::{Support, Trajectory};

const TC: f64 = 2.0;
const STEP: f64 = 0.2;
const STEP_INI: f64 = 0.1;

fn trajectory() -> Trajectory {
    build(text()).unwrap().trajectory
}

fn walk() -> Walk {
    trajectory().gait().unwrap().walk.clone()
}

fn spline(knots: &[(f64, f64)]) -> Curve {
    Curve::new(CubicSpline::at_rest(knots.to_vec()).unwrap(), Vec::new())
}

/// The message of the reach check between two instants, if it refuses the walk.
fn refusal(walk: Walk, from_s: f64, to_s: f64) -> Option<String> {
    let mut trajectory = trajectory();
    let mut gait: Gait = trajectory.gait().unwrap().clone();
    gait.rows = rows(&gait.spec, &walk, &gait.waist, &gait.legs, &gait.arms);
    trajectory.locomotion = Some(Locomotion::Gait(Box::new(gait.clone())));
    let count = ((to_s - from_s) / 0.01).round() as u32;
    let times = (0..=count).map(|k| from_s + 0.01 * f64::from(k));
    gait.check_reach(&trajectory, times, "printed", "gait")
        .err()
        .map(|e| e.to_string())
}

/// The distance a message of the reach check says is missing.
fn missing_m(message: &str) -> f64 {
    let number = message
        .split(" mm more")
        .next()
        .unwrap()
        .rsplit(' ')
        .next()
        .unwrap();
    1e-3 * number.parse::<f64>().unwrap()
}

/// (19)–(22) print times (j + …) Tc for cycles j that last 2 Tc: the right foot would leave the ground for the second
/// time while the left one is still in the air.
#[test]
fn times_of_the_feet_printed_in_single_periods_leave_no_foot_on_the_ground() {
    let right = |j: f64| [(j + 0.1) * TC, (j + 0.89) * TC];
    let left = |j: f64| [(j + 1.1) * TC, (j + 1.89) * TC];
    let overlap = right(1.0)[1].min(left(0.0)[1]) - right(1.0)[0].max(left(0.0)[0]);
    assert!(
        (overlap - 0.79 * TC).abs() < 1e-12,
        "in the air together for {overlap} s"
    );
    let gait = trajectory().gait().unwrap().clone();
    for k in 0..800 {
        let t = 0.01 * f64::from(k);
        let (right, left) = (gait.walk.right_foot.z.value(t), gait.walk.left_foot.z.value(t));
        assert!(right.min(left).abs() < 1e-15, "{t}: {right} {left}");
        assert_eq!(right > 1e-12, gait.support(t) == Support::Left, "{t}");
    }
}

/// (19) prints `0 ≤ t` as lower limit of the first line in every cycle: the first instants belong to all of them.
#[test]
fn the_lower_limit_of_equation_19_makes_two_values_of_one_instant() {
    let t = 0.1;
    let first_line = |j: f64, begins: f64| (begins <= t && t < (2.0 * j + 0.1) * TC).then_some(j * STEP);
    let printed: Vec<f64> = [0.0, 1.0]
        .into_iter()
        .filter_map(|j| first_line(j, 0.0))
        .collect();
    assert_eq!(printed, [0.0, STEP], "two positions at once");
    let corrected: Vec<f64> = [0.0, 1.0]
        .into_iter()
        .filter_map(|j| first_line(j, 2.0 * j * TC))
        .collect();
    assert_eq!(corrected, [0.0]);
    assert_eq!(walk().right_foot.x.value(t), 0.0);
}

/// (20) prints j − 1, j − ½, j in the lines of the swing and j in the line before it.
#[test]
fn the_index_of_equation_20_throws_the_left_foot_back() {
    let printed_before = STEP_INI;
    let printed = spline(&[
        (1.01 * TC, STEP_INI - STEP),
        (1.5 * TC, STEP_INI - 0.5 * STEP),
        (1.89 * TC, STEP_INI),
    ]);
    let jump = printed.value(1.005 * TC) - printed_before;
    assert!((jump + STEP).abs() < 1e-15, "{jump}");
    let thrown = Walk {
        left_foot: super::Swing {
            x: printed,
            z: walk().left_foot.z,
        },
        ..walk()
    };
    let message = refusal(thrown, TC, 2.0 * TC).expect("the hip is 0.25 m ahead of the foot");
    assert!(message.contains("left-foot"), "{message}");

    let corrected = walk().left_foot.x;
    assert!((corrected.value(1.05 * TC) - printed_before).abs() < 1e-15);
    assert!((corrected.value(1.89 * TC) - STEP_INI - STEP).abs() < 1e-15);
    assert_eq!(refusal(walk(), TC, 2.0 * TC), None);
}

/// (20) lets the left foot go at 1.01 Tc, (22) lifts it at 1.1 Tc.
#[test]
fn the_lift_at_1_01_in_equation_20_drags_the_foot_over_the_ground() {
    let slip = |x: &Curve, z: &Curve| {
        let on_ground = (0..=2000)
            .map(|k| TC + 1e-3 * f64::from(k))
            .take_while(|t| z.value(*t) <= 0.0);
        on_ground.map(|t| x.value(t) - STEP_INI).fold(0.0, f64::max)
    };
    let printed = spline(&[
        (1.01 * TC, STEP_INI),
        (1.5 * TC, STEP_INI + 0.5 * STEP),
        (1.89 * TC, STEP_INI + STEP),
    ]);
    let corrected = walk().left_foot;
    assert!(
        slip(&printed, &corrected.z) > 4e-3,
        "{}",
        slip(&printed, &corrected.z)
    );
    assert!(slip(&corrected.x, &corrected.z) < 1e-12);
}

/// (23) prints three increments per step.
#[test]
fn three_increments_in_equation_23_leave_the_waist_behind() {
    let waist = |parts: &[f64]| {
        let mut knots = vec![(0.0, 0.05)];
        for n in 0..4 {
            for part in parts {
                let x = knots[knots.len() - 1].1 + 0.025;
                knots.push(((f64::from(n) + part) * TC, x));
            }
        }
        spline(&knots)
    };
    let printed = Walk {
        waist_x: waist(&[0.1, 0.9, 1.0]),
        ..walk()
    };
    for n in 0..=4 {
        let t = TC * f64::from(n);
        let behind = |walk: &Walk| {
            let feet = (walk.right_foot.x.value(t) + walk.left_foot.x.value(t)) / 2.0;
            feet - walk.waist_x.value(t)
        };
        assert!(
            (behind(&printed) - 0.025 * f64::from(n)).abs() < 1e-12,
            "step {n}"
        );
        assert!(behind(&walk()).abs() < 1e-12, "step {n}");
    }
    // The foot is too far ahead when it lands, in the first step by 8 mm and in every further one by more.
    let mut before = 0.008;
    for n in 0..4 {
        let (from, to) = (TC * f64::from(n), TC * f64::from(n + 1));
        let missing = missing_m(&refusal(printed.clone(), from, to).expect("the leg is too short"));
        assert!(missing > before, "step {n}: {missing} after {before}");
        before = missing;
    }
    let corrected = Walk {
        waist_x: waist(&[0.1, 0.5, 0.9, 1.0]),
        ..walk()
    };
    assert_eq!(corrected, walk());
    assert_eq!(refusal(corrected, 0.0, 4.0 * TC), None);
}

/// (24) prints s = −1 for both feet. The source takes waist and centre of mass for one: it has to be over the sole.
#[test]
fn one_sign_in_equation_24_never_brings_the_waist_over_the_left_foot() {
    // Half the width of the sole (chosen: the source gives none) and its middle.
    let (half_width, left_foot) = (0.032, 0.042_165);
    let sideways = |signs: [f64; 2]| {
        let mut knots = vec![(0.0, 0.0)];
        for n in 0..4u32 {
            let s = signs[n as usize % 2];
            let inside = [(0.1, 0.027), (0.5, 0.042), (0.9, 0.027), (1.0, 0.0)];
            knots.extend(inside.map(|(part, y)| ((f64::from(n) + part) * TC, s * y)));
        }
        spline(&knots)
    };
    let gait = trajectory().gait().unwrap().clone();
    let beside = |y: &Curve| {
        let times = (0..=800).map(|k| 0.01 * f64::from(k));
        let alone = times.filter(|t| gait.support(*t) == Support::Left);
        let distances: Vec<f64> = alone.map(|t| (y.value(t) - left_foot).abs()).collect();
        let most = distances.iter().copied().fold(0.0, f64::max);
        let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
        (least, most)
    };
    let (least, _) = beside(&sideways([-1.0, -1.0]));
    assert!(least > 0.07, "{least}");
    let (_, most) = beside(&gait.walk.waist_y);
    assert!(most < half_width, "{most}");
    assert_eq!(sideways([1.0, -1.0]), gait.walk.waist_y);
}

/// (16)–(18) move the hand by 0.03 m and raise it by 0.0187 m: no straight arm does that.
#[test]
fn a_straight_arm_does_not_rise_as_equation_18_prints() {
    let arm: f64 = 0.069_31 + 0.051_78;
    let rise = arm - (arm * arm - 0.03 * 0.03).sqrt();
    assert!((rise - 0.003_775).abs() < 1e-6, "{rise}");
    assert!(rise < 0.0187 / 4.0);
    // As corrected the arm is bent throughout, and its hand does rise by what is printed.
    let hand = walk().right_hand;
    for k in 0..=800 {
        let t = 0.01 * f64::from(k);
        let drop = 0.1 - hand.z.value(t);
        assert!(hand.x.value(t).hypot(drop) < arm - 0.01, "{t}");
    }
    assert!((hand.z.value(0.0) - hand.z.value(0.5 * TC) - 0.0187).abs() < 1e-15);
}

/// (16) and (17) leave the sign g open: kept the same, every hand would jump from one side of the shoulder to the other.
#[test]
fn one_sign_in_equations_16_and_17_makes_the_hands_jump() {
    let swing = |n: f64, g: f64| {
        spline(&[
            ((n + 0.1) * TC, g * 0.03),
            ((n + 0.5) * TC, 0.0),
            ((n + 0.89) * TC, -g * 0.03),
        ])
    };
    let at = 1.0 * TC;
    let jump = |first: f64, second: f64| (swing(1.0, second).value(at) - swing(0.0, first).value(at)).abs();
    assert!((jump(1.0, 1.0) - 0.06).abs() < 1e-15);
    assert!(jump(1.0, -1.0) < 1e-15);
    for hand in [walk().right_hand.x, walk().left_hand.x] {
        for n in 1..4 {
            let t = TC * f64::from(n);
            assert!((hand.value(t + 1e-6) - hand.value(t - 1e-6)).abs() < 1e-15);
        }
    }
}
