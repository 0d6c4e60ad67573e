#![allow(
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "tests compare copies and want to stop at the first surprise"
)]

use super::*;
use crate::suite::{Case, Suite, Variation};
use ik_core::kinematics::gravity::GRAVITY_M_S2;
use nalgebra::{DMatrix, DVector};

const CART: CartTable = CartTable {
    dt_s: 0.01,
    height_m: 0.269_672,
    zmp_error_weight: 1.0,
    state_weight: 0.0,
    jerk_weight: 1e-6,
};

fn spec() -> WalkSpec {
    Suite::load("melson/walk").unwrap().scenarios[0]
        .walk
        .clone()
        .unwrap()
}

fn long() -> WalkSpec {
    Suite::load("melson/long-walk").unwrap().scenarios[0]
        .walk
        .clone()
        .unwrap()
}

fn case(suite: &str) -> Case {
    Case::new(&Suite::load(suite).unwrap(), 0, &Variation::default()).unwrap()
}

/// The first increment of the jerk, by minimising the cost of a finite horizon over all increments at once.
///
/// The motion is simulated with the plain recursion of the cart, once per unit increment; nothing of the state with error, of the
/// Riccati equation or of its gains is used.
fn first_increment_by_least_squares(cart: CartTable, reference: &[f64]) -> f64 {
    let count = reference.len() - 1;
    let zmps = |increment: usize| -> Vec<f64> {
        let (mut state, mut jerk, mut zmps) = (Vector3::zeros(), 0.0, Vec::new());
        for k in 0..count {
            if k == increment {
                jerk += 1.0;
            }
            state = cart.after(&state, jerk, cart.dt_s);
            zmps.push(cart.zmp_m(&state));
        }
        zmps
    };
    let columns: Vec<Vec<f64>> = (0..count).map(zmps).collect();
    let (error, effort) = (cart.zmp_error_weight.sqrt(), cart.jerk_weight.sqrt());
    let system = DMatrix::from_fn(2 * count, count, |i, j| {
        if i < count {
            error * columns[j][i]
        } else if i - count == j {
            effort
        } else {
            0.0
        }
    });
    let wanted = DVector::from_fn(2 * count, |i, _| {
        if i < count {
            error * (reference[i + 1] - reference[0])
        } else {
            0.0
        }
    });
    let qr = system.qr();
    let mut solution = qr.q().transpose() * wanted;
    assert!(qr.r().solve_upper_triangular_mut(&mut solution));
    solution[0]
}

#[test]
fn gains_are_those_of_least_squares_over_a_finite_horizon() {
    let cart = CartTable { dt_s: 0.05, ..CART };
    let control = PreviewControl::new(cart, 60).unwrap();
    for jump in [1, 2, 7, 20, 45] {
        let reference: Vec<f64> = (0..=150).map(|k| if k < jump { 0.0 } else { 0.05 }).collect();
        let (_, first) = control.follow(&reference)[0];
        let expected = first_increment_by_least_squares(cart, &reference);
        let scale = control.error_gain * 0.05;
        assert!(
            (first - expected).abs() < 1e-8 * scale,
            "jump at {jump}: {first} instead of {expected}"
        );
    }
}

#[test]
fn a_cart_that_stands_on_its_reference_stays_wherever_the_origin_is() {
    let control = PreviewControl::new(CART, 160).unwrap();
    for at in [0.0, 100.0] {
        let motion = control.follow(&vec![at; 500]);
        assert!(motion.iter().all(|(state, jerk)| state.x == at && *jerk == 0.0));
    }
    let step = |origin: f64| -> Vec<f64> {
        let reference: Vec<f64> = (0..600)
            .map(|k| if k < 200 { origin } else { origin + 0.05 })
            .collect();
        control
            .follow(&reference)
            .iter()
            .map(|(s, _)| s.x - origin)
            .collect()
    };
    let (near, far) = (step(0.0), step(8.0));
    assert!(near.iter().zip(&far).all(|(a, b)| (a - b).abs() < 1e-9));
    assert!((near.last().unwrap() - 0.05).abs() < 1e-6);
}

/// Zero-moment point from second differences of the position alone.
#[test]
fn the_zero_moment_point_follows_its_reference() {
    for suite in [
        "melson/walk",
        "melson/long-walk",
        "walk/hubo",
        "walk/bioloid",
        "walk/coman",
    ] {
        let case = case(suite);
        let walk = case.trajectory.walk().unwrap();
        let (h, last_s) = (1e-3, case.samples.steps() as f64 * case.dt_s);
        let (mut squares, mut count) = (0.0, 0.0);
        let mut t = 0.205;
        while t < last_s - 0.01 {
            let reference = walk.plan.zmp_m(t);
            let errors = [0, 1].map(|axis| {
                let at = |t: f64| walk.com(t)[axis].x;
                let acceleration = (at(t + h) - 2.0 * at(t) + at(t - h)) / (h * h);
                at(t) - acceleration * walk.spec.com_height_m / GRAVITY_M_S2 - reference[axis]
            });
            squares += errors[0].powi(2) + errors[1].powi(2);
            count += 1.0;
            t += case.dt_s;
        }
        let rms = f64::sqrt(squares / count);
        assert!(rms < 2e-3, "{suite}: {rms}");
    }
}

#[test]
fn rates_are_the_derivatives_of_values() {
    let case = case("walk/hubo");
    let rows = case.problem.nxdot();
    let h = 1e-5;
    for t in [0.3, 1.9, 2.25, 2.7, 3.2003, 4.1, 5.0007, 8.0] {
        let (mut rate, mut after, mut before) = (vec![0.0; rows], vec![0.0; rows], vec![0.0; rows]);
        case.trajectory.rate_into(t, &mut rate);
        case.trajectory.value_into(t + h, &mut after);
        case.trajectory.value_into(t - h, &mut before);
        for row in 0..rows {
            let difference = (after[row] - before[row]) / (2.0 * h);
            assert!((rate[row] - difference).abs() < 1e-7, "row {row} at {t}");
        }
    }
}

#[test]
fn the_short_walk_is_that_of_the_notes() {
    let plan = Plan::new(&spec());
    assert_eq!(plan.duration_s, 12.0);
    let [first, second] = plan.steps[..] else {
        panic!("two steps")
    };
    assert_eq!((first.swing, first.from_m, first.to_m), (Foot::Left, 0.0, 0.05));
    assert_eq!(
        (second.swing, second.from_m, second.to_m),
        (Foot::Right, 0.0, 0.05)
    );
    assert_eq!((first.lift_off_s, first.touch_down_s), (2.0, 5.0));
    assert_eq!((second.lift_off_s, second.touch_down_s), (7.0, 10.0));
    let middle = plan.foot(Foot::Left, 3.5);
    assert_eq!((middle.x, middle.z, middle.z_rate), (0.025, 0.02, 0.0));
    for (t, support, carrier) in [
        (0.0, Support::Both, Foot::Right),
        (2.0, Support::Both, Foot::Right),
        (3.0, Support::Right, Foot::Right),
        (4.99, Support::Right, Foot::Right),
        (5.0, Support::Both, Foot::Left),
        (8.0, Support::Left, Foot::Left),
        (10.0, Support::Both, Foot::Right),
        (12.0, Support::Both, Foot::Right),
    ] {
        assert_eq!((plan.support(t), plan.carrier(t)), (support, carrier), "{t}");
    }
    for (t, zmp) in [
        (0.0, [0.0, 0.0]),
        (1.0, [0.0, -0.023_875]),
        (3.0, [0.0, -0.047_75]),
        (6.0, [0.025, 0.0]),
        (8.0, [0.05, 0.047_75]),
        (12.0, [0.05, 0.0]),
        (20.0, [0.05, 0.0]),
    ] {
        assert!(
            plan.zmp_m(t).iter().zip(zmp).all(|(a, b)| (a - b).abs() < 1e-15),
            "{t}"
        );
    }
    for (t, ramp) in [
        (1.0, 0.0),
        (2.15, 0.5),
        (3.0, 1.0),
        (4.85, 0.5),
        (5.0, 0.0),
        (6.0, 0.0),
    ] {
        assert!((plan.single_support_ramp(t, 0.3) - ramp).abs() < 1e-12, "{t}");
    }
    assert!(plan.cycle_ends_s().is_empty());
}

#[test]
fn the_long_walk_lasts_152_seconds_and_closes() {
    let plan = Plan::new(&long());
    assert_eq!(plan.duration_s, 152.0);
    let lengths: Vec<f64> = plan.steps.iter().map(|s| s.to_m - s.from_m).collect();
    assert!((lengths[0] - 0.05).abs() < 1e-12 && (lengths[29] - 0.05).abs() < 1e-12);
    assert!(lengths[1..29].iter().all(|l| (l - 0.1).abs() < 1e-12));
    assert!((plan.steps[29].to_m - plan.steps[28].to_m).abs() < 1e-12);
    let ends = plan.cycle_ends_s();
    assert_eq!((ends.len(), ends[0]), (14, 10.0));
    assert!(
        ends.windows(2)
            .all(|pair| (pair[1] - pair[0] - 10.0).abs() < 1e-9)
    );
}

#[test]
fn one_step_is_one_length_and_no_foot_ever_sinks() {
    let plan = Plan::new(&WalkSpec { steps: 1, ..spec() });
    assert_eq!((plan.steps[0].to_m, plan.zmp_m(100.0)), (0.05, [0.025, 0.0]));
    let plan = Plan::new(&long());
    for k in 0..15_200 {
        let t = 0.01 * f64::from(k);
        for foot in [Foot::Right, Foot::Left] {
            let z = plan.foot(foot, t).z;
            assert!((-1e-15..=0.02 + 1e-15).contains(&z));
        }
    }
}

/// A step is made in the phase it begins in: no switch falls between the two samples of a swing.
#[test]
fn phases_and_gains_change_at_touchdown() {
    let case = Case::new(&Suite::load("melson/walk").unwrap(), 2, &Variation::default()).unwrap();
    let right = PhaseId(0);
    let left = PhaseId(1);
    assert_eq!(case.phases.len(), 1200);
    for (k, phase) in [(1, right), (500, right), (501, left), (1000, left), (1001, right)] {
        assert_eq!(case.phases[k - 1], phase, "step {k}");
    }
    assert_eq!(case.gains_of(1), [0.35, 0.0]);
    assert_eq!(case.gains_of(201), [0.35, 0.0]);
    assert!((case.gains_of(216)[1] - 0.8).abs() < 1e-9);
    assert_eq!(case.gains_of(350), [0.35, 1.6]);
    assert_eq!(case.gains_of(501), [0.35, 0.0]);
}

/// The message for `melson/walk` with `from` replaced everywhere.
fn refusal(from: &str, to: &str) -> String {
    let text = crate::suite::EMBEDDED
        .iter()
        .find(|(id, _)| *id == "melson/walk")
        .unwrap()
        .1;
    assert!(text.contains(from), "{from}");
    let parsed = Suite::parse(&text.replace(from, to), "mine.toml", std::path::Path::new("."));
    let built = parsed.and_then(|suite| Case::new(&suite, 0, &Variation::default()));
    built.unwrap_err().to_string()
}

#[test]
fn numbers_that_cannot_be_are_refused_with_value_and_bound() {
    let expectations: [(&str, &str, &[&str]); 19] = [
        (
            "single_support_s = 3.0",
            "single_support_s = 0.005",
            &["walk.single_support_s = 0.005", "at least dt_s = 0.01"],
        ),
        (
            "double_support_s = 2.0",
            "double_support_s = 0.0",
            &["walk.double_support_s = 0", "at least dt_s = 0.01"],
        ),
        (
            "horizon_s = 1.6",
            "horizon_s = 12.5",
            &["walk.preview.horizon_s = 12.5", "12 s"],
        ),
        (
            "horizon_s = 1.6",
            "horizon_s = 0.001",
            &["preview.horizon_s = 0.001", "period_s = 0.01"],
        ),
        (
            "period_s = 0.01",
            "period_s = 0.0",
            &["preview.period_s = 0", "above 0"],
        ),
        (
            "jerk_weight = 1e-6",
            "jerk_weight = 0.0",
            &["preview.jerk_weight = 0", "above 0"],
        ),
        (
            "zmp_error_weight = 1.0",
            "zmp_error_weight = -1.0",
            &["zmp_error_weight = -1", "above 0"],
        ),
        (
            "state_weight = 0.0",
            "state_weight = -1.0",
            &["state_weight = -1", "not negative"],
        ),
        ("steps = 2", "steps = 0", &["walk.steps = 0", "1 to 1000"]),
        ("step_m = 0.05", "step_m = nan", &["walk.step_m = NaN", "finite"]),
        (
            "step_m = 0.05",
            "step_m = 0.5",
            &["walk.step_m = 0.5", "is missed by", "in step 1", "at most 0.1"],
        ),
        ("lift_m = 0.02", "lift_m = 0.0", &["walk.lift_m = 0", "above 0"]),
        (
            "com_height_m = 0.269672",
            "com_height_m = -0.3",
            &["walk.com_height_m = -0.3", "above 0"],
        ),
        (
            "first_swing = \"left\"",
            "first_swing = \"hand\"",
            &["line", "hand", "`right` or `left`"],
        ),
        (
            "supports = [\"r_foot\", \"l_foot\"]",
            "supports = [\"r_foot\"]",
            &["problem.supports", "without `l_foot`", "both feet"],
        ),
        (
            "supports = [\"r_foot\", \"l_foot\"]",
            "supports = [\"r_foot\", \"l_food\"]",
            &["supports", "frame `l_food`", "did you mean `l_foot`?"],
        ),
        (
            "gains = [{ value = 0.0 }, ",
            "gains = [",
            &["scenarios[0].gains = 1 gains", "2, one for each"],
        ),
        (
            "gains = [{ value = 0.0 }, ",
            "gains = [{ value = -1.0 }, ",
            &["scenarios[0].gains[0].value = -1", "not negative"],
        ),
        (
            "name = \"com\"",
            "name = \"con\"",
            &["walk.tasks.centre_of_mass", "task `com`", "did you mean `con`?"],
        ),
    ];
    for (from, to, words) in expectations {
        let message = refusal(from, to);
        for word in words {
            assert!(
                message.contains(word),
                "`{to}`: `{word}` is missing in: {message}"
            );
        }
    }
}
