#![allow(
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "tests compare copies and want to stop at the first surprise"
)]
#![allow(clippy::print_stdout, reason = "a skipped test says why")]

use super::*;
use crate::suite::{Case, Suite, Variation};
use ik_core::problem::Problem;
use ik_core::spatial::so3;
use ik_core::task::OrientationCoordinates;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::path::Path;

fn case(suite: &str, id: &str) -> Case {
    let suite = Suite::load(suite).unwrap();
    let index = suite.scenarios.iter().position(|s| s.id == id).unwrap();
    Case::new(&suite, index, &Variation::default()).unwrap()
}

/// The samples of the specification, a document independent of this program.
#[test]
fn targets_are_those_of_the_specification() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/papers/coman-spec.json");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: the folder `shared` beside the project is absent");
        return;
    };
    let spec: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut compared = 0;
    for (suite, id) in [
        ("coman/squat", "A"),
        ("coman/stretch", "B"),
        ("coman/stretch", "B1"),
        ("coman/asymmetric", "C"),
        ("coman/lean", "D"),
        ("coman/lean", "D2"),
    ] {
        let case = case(suite, id);
        for sample in spec["task_samples"][id].as_array().unwrap() {
            let t = sample["t"].as_f64().unwrap();
            let k = (t / case.dt_s).round();
            assert!((k * case.dt_s - t).abs() < 1e-9, "{id}: {t} is on the grid");
            let now = case.samples.window(k as usize).now();
            for (field, found) in [("x", now.x), ("xdot", now.xdot)] {
                let expected: Vec<f64> = serde_json::from_value(sample[field].clone()).unwrap();
                assert_eq!(found.len(), expected.len());
                for (i, (a, b)) in found.iter().zip(&expected).enumerate() {
                    assert!(
                        (a - b).abs() < 1e-12,
                        "{id} t = {t} {field}[{i}]: {a} instead of {b}"
                    );
                    compared += 1;
                }
            }
        }
    }
    assert!(compared >= 6 * 5 * 36, "{compared} numbers compared");
}

#[test]
fn terms_act_in_their_window_only() {
    let case = case("coman/lean", "D");
    let pitch = |t: f64| case.samples.window((t / case.dt_s).round() as usize).now().x[16];
    assert_eq!(pitch(0.5), 0.0);
    assert!((pitch(2.0) - 0.4).abs() < 1e-12);
    assert!(pitch(3.0).abs() < 1e-12);
    assert!((pitch(5.0) + 0.9).abs() < 1e-12);
    assert_eq!(pitch(7.5), 0.0);
}

#[test]
fn a_window_holds_the_previous_sample_this_one_and_the_preview() {
    let mut suite = Suite::load("coman/squat").unwrap();
    suite.problem.preview_s = 0.02;
    let case = Case::new(&suite, 0, &Variation::default()).unwrap();
    assert_eq!(case.samples.steps(), 600);
    let (a, b) = (case.samples.window(7), case.samples.window(8));
    assert_eq!(a.preview_len(), 4);
    assert_eq!(a.now().x, b.previous().x);
    assert_eq!(a.ahead(1).unwrap().x, b.now().x);
    assert_eq!(case.samples.window(600).preview_len(), 4);
    assert_eq!(case.samples.judged().len(), 601 * 36);
    assert_eq!(&case.samples.judged()[7 * 36..8 * 36 - 18], a.now().x);
}

fn asymmetric(orientation: OrientationCoordinates, rates: Rates) -> (Samples, std::sync::Arc<Problem>, f64) {
    let mut suite = Suite::load("coman/asymmetric").unwrap();
    suite.problem.orientation = orientation;
    suite.problem.rates = rates;
    let case = Case::new(
        &suite,
        0,
        &Variation {
            dt_s: Some(0.001),
            ..Variation::default()
        },
    )
    .unwrap();
    (case.samples, case.problem, case.dt_s)
}

#[test]
fn quaternions_turn_with_their_angular_velocity() {
    let (samples, problem, dt) = asymmetric(OrientationCoordinates::Log, Rates::Analytic);
    assert_eq!((problem.nx(), problem.nxdot()), (3 + 7 + 7 + 4, 18));
    let slot = problem.slots()[3];
    let turn = |x: &[f64]| {
        UnitQuaternion::new_normalize(Quaternion::new(
            x[slot.x + 3],
            x[slot.x],
            x[slot.x + 1],
            x[slot.x + 2],
        ))
    };
    for k in [50, 700, 1234, 5999] {
        let (before, now) = (samples.window(k).previous(), samples.window(k + 1).now());
        let omega = Vector3::from_column_slice(&samples.window(k).now().xdot[slot.xdot..slot.xdot + 3]);
        // Central difference over 2 ms: errs by dt²/6 times the third derivative, about 1e-6.
        let difference = so3::log_quaternion(&(turn(now.x) * turn(before.x).inverse())) / (2.0 * dt);
        assert!(
            (difference - omega).norm() < 5e-6,
            "step {k}: {difference} instead of {omega}"
        );
    }
}

#[test]
fn differenced_rates_lead_from_one_sample_to_the_next() {
    for orientation in [OrientationCoordinates::RollPitchYaw, OrientationCoordinates::Log] {
        let (samples, problem, dt) = asymmetric(orientation, Rates::Difference);
        assert!(samples.window(1).previous().xdot.iter().all(|v| *v == 0.0));
        for k in [1, 777, 4000] {
            let window = samples.window(k);
            let z = (window.now().x[2] - window.previous().x[2]) / dt;
            assert_eq!(window.now().xdot[2], z);
            let slot = problem.slots()[3];
            let reached = match orientation {
                OrientationCoordinates::RollPitchYaw => {
                    let step =
                        |i: usize| window.previous().x[slot.x + i] + dt * window.now().xdot[slot.xdot + i];
                    (0..3)
                        .map(|i| (step(i) - window.now().x[slot.x + i]).abs())
                        .fold(0.0, f64::max)
                }
                OrientationCoordinates::Log => {
                    let turn = |x: &[f64]| {
                        let c = &x[slot.x..slot.x + 4];
                        UnitQuaternion::new_normalize(Quaternion::new(c[3], c[0], c[1], c[2]))
                    };
                    let omega = Vector3::from_column_slice(&window.now().xdot[slot.xdot..slot.xdot + 3]);
                    let moved = so3::exp_quaternion(&(omega * dt)) * turn(window.previous().x);
                    moved.angle_to(&turn(window.now().x))
                }
            };
            assert!(reached < 1e-7, "{orientation:?}, step {k}: {reached}");
        }
    }
}

#[test]
fn zero_rates_are_zero_and_not_promised() {
    let (samples, problem, _) = asymmetric(OrientationCoordinates::RollPitchYaw, Rates::Zero);
    assert!((1..=samples.steps()).all(|k| samples.window(k).now().xdot.iter().all(|v| *v == 0.0)));
    assert!(!problem.supplies().rates);
}

#[test]
fn a_hold_replaces_the_value_at_the_start_and_other_terms_add_to_it() {
    let mut suite = Suite::load("coman/squat").unwrap();
    let hold = MotionSpec {
        task: "com".into(),
        component: "z".into(),
        shape: Shape::Hold { value: 0.5 },
        from_s: 0.0,
        until_s: None,
    };
    suite.scenarios[0].motion.push(hold.clone());
    let case = Case::new(&suite, 0, &Variation::default()).unwrap();
    assert!((case.samples.window(100).now().x[2] - 0.53).abs() < 1e-12);
    suite.scenarios[0].motion.push(hold);
    let message = Case::new(&suite, 0, &Variation::default())
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("scenarios[0].motion[2]") && message.contains("second hold"),
        "{message}"
    );
}

#[test]
fn a_target_that_overflows_is_found_with_its_time() {
    let mut suite = Suite::load("coman/squat").unwrap();
    suite.scenarios[0].motion[0].shape = Shape::Bump {
        amplitude: 1e308,
        period_s: 1e-5,
    };
    let message = Case::new(&suite, 0, &Variation::default())
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("com.z") && message.contains("finite"),
        "{message}"
    );
}

#[test]
fn time_steps_that_cannot_be_are_refused() {
    for (dt, duration) in [
        (0.0, 1.0),
        (-0.005, 1.0),
        (f64::NAN, 1.0),
        (1e-9, 1.0),
        (2.0, 1.0),
        (0.005, f64::INFINITY),
    ] {
        assert!(Grid::new(dt, duration, 0.0, "here").is_err(), "{dt} {duration}");
    }
    let grid = Grid::new(0.005, 3.0, 0.01, "here").unwrap();
    assert_eq!((grid.steps, grid.preview), (600, 2));
    assert_eq!(Grid::new(0.001, 0.3, 0.0, "here").unwrap().steps, 300);
}
