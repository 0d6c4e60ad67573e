#![allow(
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "constants are copied, not computed; tests want to stop at the first surprise"
)]

mod errata;

use super::*;
use crate::suite::{Case, EMBEDDED, Suite, Variation};
use std::path::Path;

/// The text of the suite `bioloid/gait`.
fn text() -> &'static str {
    EMBEDDED.iter().find(|(id, _)| *id == "bioloid/gait").unwrap().1
}

fn build(text: &str) -> Result<Case, InputError> {
    let suite = Suite::parse(text, "mine.toml", Path::new("."))?;
    Case::new(&suite, 0, &Variation::default())
}

/// The suite with the first `from` replaced.
fn with(from: &str, to: &str) -> Result<Case, InputError> {
    assert!(text().contains(from), "{from}");
    build(&text().replacen(from, to, 1))
}

fn refused(from: &str, to: &str, words: &[&str]) {
    let message = with(from, to).unwrap_err().to_string();
    for word in words {
        assert!(
            message.contains(word),
            "`{to}`: `{word}` is missing in: {message}"
        );
    }
}

/// Value and rate of a task row as the methods get them.
fn target(case: &Case, task: &str, component: usize, t: f64) -> (f64, f64) {
    let tasks = case.problem.tasks();
    let slot = case.problem.slots()[tasks.iter().position(|other| other.name == task).unwrap()];
    let k = (t / case.dt_s).round() as usize;
    let now = if k == 0 {
        case.samples.window(1).previous()
    } else {
        case.samples.window(k).now()
    };
    (now.x[slot.x + component], now.xdot[slot.xdot + component])
}

/// Knots of the corrected equations, computed by hand for Tc = 2 s: task, component, time, value.
const KNOTS: [(&str, usize, f64, f64); 52] = [
    // (19): two swings of the right foot.
    ("right-foot", 0, 0.0, 0.0),
    ("right-foot", 0, 0.2, 0.0),
    ("right-foot", 0, 1.0, 0.1),
    ("right-foot", 0, 1.78, 0.2),
    ("right-foot", 0, 4.2, 0.2),
    ("right-foot", 0, 5.0, 0.3),
    ("right-foot", 0, 5.78, 0.4),
    ("right-foot", 0, 8.0, 0.4),
    // (20): two of the left foot.
    ("left-foot", 0, 0.0, 0.1),
    ("left-foot", 0, 2.2, 0.1),
    ("left-foot", 0, 3.0, 0.2),
    ("left-foot", 0, 3.78, 0.3),
    ("left-foot", 0, 6.2, 0.3),
    ("left-foot", 0, 7.0, 0.4),
    ("left-foot", 0, 7.78, 0.5),
    // (21), (22).
    ("right-foot", 2, 0.2, 0.0),
    ("right-foot", 2, 0.23, 0.003),
    ("right-foot", 2, 0.28, 0.009),
    ("right-foot", 2, 1.0, 0.03),
    ("right-foot", 2, 1.7, 0.009),
    ("right-foot", 2, 1.75, 0.003),
    ("right-foot", 2, 1.78, 0.0),
    ("left-foot", 2, 6.2, 0.0),
    ("left-foot", 2, 6.23, 0.003),
    ("left-foot", 2, 6.2 + 0.08, 0.009),
    ("left-foot", 2, 7.0, 0.03),
    ("left-foot", 2, 7.75, 0.003),
    // (23): four increments per step.
    ("waist", 0, 0.0, 0.05),
    ("waist", 0, 0.2, 0.075),
    ("waist", 0, 1.0, 0.1),
    ("waist", 0, 1.8, 0.125),
    ("waist", 0, 2.0, 0.15),
    ("waist", 0, 5.8, 0.325),
    ("waist", 0, 8.0, 0.45),
    // (24): left foot stands in the first step, right foot in the second.
    ("waist", 1, 0.0, 0.0),
    ("waist", 1, 0.2, 0.027),
    ("waist", 1, 1.0, 0.042),
    ("waist", 1, 1.8, 0.027),
    ("waist", 1, 2.0, 0.0),
    ("waist", 1, 2.2, -0.027),
    ("waist", 1, 3.0, -0.042),
    ("waist", 1, 3.8, -0.027),
    ("waist", 1, 8.0, 0.0),
    // (16)-(18) with the waist added: shoulders at y = ∓0.064646, 0.121451 above the waist.
    ("right-hand", 0, 0.0, 0.05 + 0.03),
    ("right-hand", 0, 0.2, 0.075 + 0.03),
    ("right-hand", 0, 1.0, 0.1),
    ("right-hand", 0, 2.0, 0.15 - 0.03),
    ("right-hand", 0, 2.2, 0.175 - 0.03),
    ("left-hand", 0, 0.2, 0.075 - 0.03),
    ("left-hand", 1, 1.0, 0.042 + 0.064_646),
    ("left-hand", 2, 0.2, 0.155 + 0.121_451 - 0.1 + 0.0187),
    ("left-hand", 2, 1.0, 0.155 + 0.121_451 - 0.1),
];

#[test]
fn targets_pass_through_every_knot() {
    let case = build(text()).unwrap();
    for (task, component, t, expected) in KNOTS {
        let (value, _) = target(&case, task, component, t);
        assert!(
            (value - expected).abs() < 1e-13,
            "{task}[{component}] at {t}: {value} instead of {expected}"
        );
    }
    let walk = &case.trajectory.gait().unwrap().walk;
    let curves = [
        &walk.right_foot.x,
        &walk.right_foot.z,
        &walk.left_foot.x,
        &walk.left_foot.z,
        &walk.waist_x,
        &walk.waist_y,
        &walk.right_hand.x,
        &walk.right_hand.z,
        &walk.left_hand.x,
        &walk.left_hand.z,
    ];
    let mut knots = 0;
    for curve in curves {
        for (t, y) in curve.splines().flat_map(|spline| spline.knots()) {
            assert!((curve.value(*t) - y).abs() < 1e-13);
            knots += 1;
        }
    }
    assert_eq!(knots, 2 * (2 * 3 + 2 * 7) + 2 * 17 + 4 * 4 * 3);
}

#[test]
fn a_standing_foot_stands_still_on_the_ground() {
    let case = build(text()).unwrap();
    let (mut both, mut right, mut left) = (0, 0, 0);
    for k in 0..=case.samples.steps() {
        let t = case.dt_s * k as f64;
        match case.support[k] {
            Support::Both => both += 1,
            Support::Right => right += 1,
            Support::Left => left += 1,
        }
        for (foot, swings) in [("right-foot", Support::Left), ("left-foot", Support::Right)] {
            let (z, climb) = target(&case, foot, 2, t);
            let (_, speed) = target(&case, foot, 0, t);
            if case.support[k] == swings {
                assert!(z > 0.0 && speed > 0.0, "{foot} swings at {t}");
            } else {
                assert!(
                    z.abs().max(climb.abs()).max(speed.abs()) < 1e-12,
                    "{foot} stands at {t}"
                );
            }
        }
    }
    // 0.1 Tc and 0.89 Tc are samples and count as standing: 157 samples lie between.
    assert_eq!((both, right, left), (801 - 4 * 157, 2 * 157, 2 * 157));
}

#[test]
fn everything_is_smooth_and_rates_are_derivatives() {
    let trajectory = build(text()).unwrap().trajectory;
    let n = trajectory.rows();
    let h = 1e-6;
    let (mut a, mut b, mut rate) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for k in 1..8000 {
        let t = f64::from(k) * 1e-3;
        trajectory.value_into(t - h, &mut a);
        trajectory.value_into(t + h, &mut b);
        trajectory.rate_into(t, &mut rate);
        for row in 0..n {
            // Accelerations are below 20 m/s², so one sided differences err by less than h · 20.
            let difference = (b[row] - a[row]) / (2.0 * h);
            assert!(
                (difference - rate[row]).abs() < 2e-5,
                "row {row} at {t}: {difference} and {}",
                rate[row]
            );
        }
    }
}

#[test]
fn orientations_and_the_height_of_the_waist_do_not_move() {
    let case = build(text()).unwrap();
    for k in 0..=800 {
        let t = 0.01 * f64::from(k);
        for task in ["right-foot", "left-foot", "waist"] {
            let turn: Vec<f64> = (3..7).map(|i| target(&case, task, i, t).0).collect();
            assert_eq!(turn, [0.0, 0.0, 0.0, 1.0]);
        }
        assert_eq!(target(&case, "waist", 2, t), (0.155, 0.0));
        assert_eq!(target(&case, "right-foot", 1, t).0, -0.042_165);
    }
}

#[test]
fn terms_add_to_the_walk_and_holds_are_refused() {
    let term = |shape: &str| {
        let motion = format!("motion = [{{ task = \"waist\", component = \"z\", shape = {{ {shape} }} }}]");
        text().replacen("start = \"bent\"", &format!("start = \"bent\"\n{motion}"), 1)
    };
    let case = build(&term("offset = { value = -0.01 }")).unwrap();
    assert!((target(&case, "waist", 2, 3.0).0 - 0.145).abs() < 1e-15);
    let message = build(&term("hold = { value = 0.15 }")).unwrap_err().to_string();
    assert!(
        message.contains("scenarios[0].motion[0]") && message.contains("what the gait or walk moves"),
        "{message}"
    );
}

#[test]
fn a_foot_out_of_reach_is_refused_with_instant_and_millimetres() {
    // The limit of the height is 0.1609 m (the source is silent): the standing leg near the end of a step.
    assert!(with("waist_height_m = 0.155", "waist_height_m = 0.1608").is_ok());
    assert!(with("waist_height_m = 0.155", "waist_height_m = 0.1610").is_err());
    let height = 0.165;
    let message = with("waist_height_m = 0.155", &format!("waist_height_m = {height}"))
        .unwrap_err()
        .to_string();
    for word in [
        "scenarios[0].gait",
        "-foot` at t = ",
        "mm more than the limb can span",
        "0.155476 m",
        "lower waist_height_m",
    ] {
        assert!(message.contains(word), "`{word}` is missing in: {message}");
    }
    // The worst distance by hand: hips and ankles, both 0.042165 m beside waist and foot, so only the waist counts.
    let walk = build(text()).unwrap().trajectory.gait().unwrap().walk.clone();
    let mut worst = (0.0f64, 0.0);
    for k in 0..=800 {
        let t = f64::from(k) * 0.01;
        for foot in [&walk.right_foot, &walk.left_foot] {
            let x = walk.waist_x.value(t) - foot.x.value(t);
            let z = height - 0.030_779 - foot.z.value(t);
            let distance = (x * x + walk.waist_y.value(t).powi(2) + z * z).sqrt();
            if distance > worst.0 {
                worst = (distance, t);
            }
        }
    }
    let missing = format!("{:.3} mm more", 1e3 * (worst.0 - 0.155_475_8));
    let instant = format!("t = {:.6} s", worst.1);
    assert!(
        message.contains(&missing) && message.contains(&instant),
        "{missing}, {instant}: {message}"
    );
}

#[test]
fn a_hand_out_of_reach_is_refused() {
    refused(
        "hand_drop_m = 0.1",
        "hand_drop_m = 0.13",
        &[
            "-hand` at t = ",
            "the hand from",
            "_shoulder_pitch`",
            "0.121090 m",
            "shorten hand_drop_m",
        ],
    );
}

#[test]
fn numbers_that_cannot_be_are_refused_by_name() {
    for (from, to, words) in [
        (
            "step_period_s = 2.0",
            "step_period_s = 0.2",
            &[
                "gait.height_knots[1].after_s = 0.08",
                "below 0.078",
                "0.390 step_period_s",
            ][..],
        ),
        (
            "step_period_s = 2.0",
            "step_period_s = -2.0",
            &["gait.step_period_s = -2", "above 0"],
        ),
        ("steps = 4", "steps = 0", &["gait.steps = 0", "1 to 1000"]),
        (
            "steps = 4",
            "steps = 2000000",
            &["gait.steps = 2000000", "1 to 1000"],
        ),
        ("steps = 4", "steps = -1", &["line", "u32"]),
        ("step_m = 0.2", "step_m = nan", &["gait.step_m = NaN", "finite"]),
        ("step_m = 0.2", "stride_m = 0.2", &["line", "stride_m", "step_m"]),
        (
            "lift_fraction = 0.1",
            "lift_fraction = 0.5",
            &["gait.lift_fraction = 0.5", "below 0.5"],
        ),
        (
            "land_fraction = 0.89",
            "land_fraction = 1.0",
            &["gait.land_fraction = 1", "below 1"],
        ),
        ("lift_m = 0.03", "lift_m = 0.0", &["gait.lift_m = 0", "above 0"]),
        ("0.027, 0.042", "inf, 0.042", &["gait.sway_m[1] = inf", "finite"]),
        (
            "after_s = 0.08",
            "after_s = 0.02",
            &["height_knots[1].after_s = 0.02", "above 0.03"],
        ),
        (
            "share = 0.3",
            "share = inf",
            &["height_knots[1].share = inf", "finite"],
        ),
        (
            "waist_start_m = 0.05",
            "waist_start_m = inf",
            &["gait.waist_start_m = inf"],
        ),
        (
            "hand_swing_m = 0.03",
            "hand_swing_m = nan",
            &["gait.hand_swing_m = NaN"],
        ),
        (
            "step_period_s = 2.0",
            "step_period_s = 1e308",
            &["gait", "not finite"],
        ),
    ] {
        refused(from, to, words);
    }
}

#[test]
fn tasks_that_cannot_walk_are_refused_by_name() {
    for (from, to, words) in [
        (
            "right_foot = \"right-foot\"",
            "right_foot = \"right-food\"",
            &[
                "gait.tasks.right_foot",
                "task `right-food`",
                "did you mean `right-foot`?",
            ][..],
        ),
        (
            "right_foot = \"right-foot\"",
            "right_foot = \"right-hand\"",
            &["gait.tasks.right_foot = `right-hand`", "tracks a pose"],
        ),
        (
            "right_hand = \"right-hand\"",
            "right_hand = \"left-foot\"",
            &["gait.tasks.right_hand = `left-foot`", "tracks a position"],
        ),
        (
            "right_foot = \"right-foot\"",
            "right_foot = \"left-foot\"",
            &["gait.tasks = `left-foot` twice", "differ"],
        ),
        (
            "right_foot = \"right-foot\", left_foot = \"left-foot\"",
            "right_foot = \"left-foot\", left_foot = \"right-foot\"",
            &[
                "gait.tasks.right_foot = `left-foot`, left of `right-foot`",
                "smaller y",
            ],
        ),
        (
            "waist = \"waist\"",
            "waist = \"left-foot\"",
            &["gait.tasks.waist = `left-foot`", "fixed in the root body"],
        ),
        (
            "left_foot = \"left-foot\"",
            "left_foot = \"waist\"",
            &["gait.tasks.left_foot = `waist`", "joints move"],
        ),
    ] {
        refused(from, to, words);
    }
}

/// Hands of the default names swing where the problem has them, and are no fault where it has not.
#[test]
fn hands_that_nobody_named_are_optional() {
    let text = text();
    let hands = text.find("[[problem.tasks]]\nname = \"right-hand\"").unwrap();
    let after = hands + text[hands..].find("\n[starts").unwrap();
    let handless = [&text[..hands], &text[after..]].concat();
    let start = handless.find("[scenarios.gait]").unwrap();
    let rest = start + handless[start..].find("\n# The same walk").unwrap();
    let case = build(&[&handless[..start], "gait = {}\n", &handless[rest..]].concat()).unwrap();
    assert_eq!(case.problem.tasks().len(), 3);
    let named = handless.replacen("gait = {}", "gait = { tasks = { right_hand = \"a-hand\" } }", 1);
    let message = Case::new(
        &Suite::parse(&named, "mine.toml", Path::new(".")).unwrap(),
        1,
        &Variation::default(),
    );
    assert!(message.unwrap_err().to_string().contains("a-hand"));
}

/// Another robot, without arms: nothing in the generator is about one of them.
#[test]
fn the_legs_of_coman_walk_too() {
    let squat = EMBEDDED[0].1;
    let part = |from: &str, to: &str| &squat[squat.find(from).unwrap()..squat.find(to).unwrap()];
    let gait = "[scenarios.gait]\nsteps = 3\nwaist_height_m = HEIGHT\n\
                tasks = { right_foot = \"right-sole\", left_foot = \"left-sole\", waist = \"torso\" }\n";
    let walking = squat
        .replace(
            part(
                "[[problem.tasks]]\nname = \"com\"",
                "[[problem.tasks]]\nname = \"left-sole\"",
            ),
            "",
        )
        .replace(part("motion = [", "[[contestants]]"), gait)
        .replace("{ orientation = \"Waist\" }", "{ pose = \"Waist\" }")
        .replace("[starts.crouched]", "[starts.crouched]\nmeet = \"targets\"");
    let case = build(&walking.replace("HEIGHT", "0.42")).unwrap();
    assert!((target(&case, "left-sole", 1, 0.0).0 - 0.0726).abs() < 1e-12);
    assert!((target(&case, "right-sole", 0, 1.78).0 - 0.2).abs() < 1e-13);
    let start = crate::trajectory::task_values(&case.problem, &case.q_start);
    let mut expected = vec![0.0; start.len()];
    case.trajectory.value_into(0.0, &mut expected);
    for (a, b) in start.iter().zip(&expected) {
        assert!((a - b).abs() < 1e-9);
    }
    let message = build(&walking.replace("HEIGHT", "0.6")).unwrap_err().to_string();
    assert!(message.contains("-sole` at t = "), "{message}");
}
