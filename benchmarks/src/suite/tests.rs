#![allow(
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "tests compare copies and want to stop at the first surprise"
)]
#![allow(clippy::print_stdout, reason = "a skipped test says why")]

use super::*;
use crate::trajectory::Shape;
use ik_core::kinematics::{Page, forward};

fn cases(suite: &Suite) -> Vec<Case> {
    (0..suite.scenarios.len())
        .map(|i| Case::new(suite, i, &Variation::default()).unwrap())
        .collect()
}

#[test]
fn embedded_suites_are_sound() {
    for ((id, _), suite) in EMBEDDED.iter().zip(Suite::load_embedded().unwrap()) {
        assert_eq!(*id, suite.id);
        assert!(
            suite.analysis.len() > 400 && suite.analysis.contains("Caution"),
            "{id}"
        );
        assert!(
            suite.full_only || suite.scenarios.iter().any(|s| s.quick),
            "{id} has a quick scenario or none is wanted"
        );
        assert!(!lineup(&suite, &Selection::default()).unwrap().is_empty());
        assert_eq!(cases(&suite).len(), suite.scenarios.len());
    }
}

/// Pelvis upright, knees bent alike, soles flat at z = 0, x = 0, y = ±0.0726, centre of mass at x = 0.02.
#[test]
fn starts_obey_the_pose_rule() {
    let mut checked = 0;
    let mut suites = Suite::load_embedded().unwrap();
    suites.retain(|suite| suite.id.starts_with("coman/"));
    for suite in suites {
        for case in cases(&suite) {
            let robot = case.problem.robot();
            let q = &case.q_start;
            let mut page = Page::new(robot);
            forward(robot, q, &mut page);
            assert_eq!(q[3..7], [0.0, 0.0, 0.0, 1.0]);
            assert!(
                (page.centre_of_mass().x - 0.02).abs() < 1e-12,
                "{}/{}",
                case.suite,
                case.scenario
            );
            for (frame, y) in [("l_sole", 0.0726), ("r_sole", -0.0726)] {
                let pose = page.frame_pose(robot, robot.frame(frame).unwrap());
                let p = pose.translation.vector;
                assert!(p.x.abs().max((p.y - y).abs()).max(p.z.abs()) < 1e-12, "{p}");
                assert!(pose.rotation.angle() < 1e-12);
            }
            let joint = |name: &str| q[7 + robot.coordinate(name).unwrap()];
            assert_eq!(joint("LKneeSag"), joint("RKneeSag"));
            for other in ["HipLat", "HipYaw", "AnkLat"] {
                assert_eq!(
                    (joint(&format!("L{other}")), joint(&format!("R{other}"))),
                    (0.0, 0.0)
                );
            }
            checked += 1;
        }
    }
    assert!(checked >= 29, "{checked}");
}

#[test]
fn the_crouched_start_is_that_of_the_specification() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/papers/coman-spec.json");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: the folder `shared` beside the project is absent");
        return;
    };
    let spec: serde_json::Value = serde_json::from_str(&text).unwrap();
    let expected: Vec<f64> = serde_json::from_value(spec["q0"].clone()).unwrap();
    let suite = Suite::load("coman/asymmetric").unwrap();
    for case in cases(&suite) {
        assert_eq!(case.q_start[..3], expected[..3]);
        assert_eq!(case.q_start[7..], expected[6..]);
    }
}

/// Soles flat at z = 0 below the hips, knees forwards, right elbow positive, left negative; a start that meets its targets
/// does so to rounding.
#[test]
fn bioloid_starts_stand_with_bent_knees_and_elbows() {
    for suite in Suite::load_embedded().unwrap() {
        if !suite.id.starts_with("bioloid/") {
            continue;
        }
        for (case, scenario) in cases(&suite).iter().zip(&suite.scenarios) {
            let robot = case.problem.robot();
            let at = |name: &str| case.q_start[7 + robot.coordinate(name).unwrap()];
            assert!(at("r_knee_pitch") > 0.5 && at("l_knee_pitch") > 0.5);
            assert!(at("r_elbow_roll") > 0.5 && at("l_elbow_roll") < -0.5);
            let mut page = Page::new(robot);
            forward(robot, &case.q_start, &mut page);
            // The angles of the standing start are given to seven digits.
            let tolerance = match suite.starts[&scenario.start].meet {
                Meet::Targets => 1e-12,
                Meet::Nothing => 1e-7,
            };
            for (frame, y) in [("r_foot", -0.042_165), ("l_foot", 0.042_165)] {
                let pose = page.frame_pose(robot, robot.frame(frame).unwrap());
                let p = pose.translation.vector;
                assert!((p.y - y).abs().max(p.z.abs()) < tolerance, "{}: {p}", suite.id);
                assert!(pose.rotation.angle() < tolerance, "{}", suite.id);
            }
        }
    }
}

/// At the start of the walk the angles of knees and elbows follow from the law of cosines.
#[test]
fn a_start_that_meets_its_targets_is_the_closed_form() {
    let case = &cases(&Suite::load("bioloid/gait").unwrap())[0];
    let bend = |a: f64, b: f64, squared: f64| {
        std::f64::consts::PI - ((a * a + b * b - squared) / (2.0 * a * b)).acos()
    };
    let at = |name: &str| case.q_start[7 + case.problem.robot().coordinate(name).unwrap()];
    // Hips 0.05 m before the right and behind the left ankle, which are 0.030779 m over the ground.
    let knee = bend(
        0.077_382_9,
        0.078_092_9,
        0.05 * 0.05 + (0.155f64 - 0.030_779).powi(2),
    );
    let elbow = bend(0.069_31, 0.051_78, 0.03 * 0.03 + (0.1f64 - 0.0187).powi(2));
    for (joint, expected) in [
        ("r_knee_pitch", knee),
        ("l_knee_pitch", knee),
        ("r_elbow_roll", elbow),
        ("l_elbow_roll", -elbow),
    ] {
        assert!(
            (at(joint) - expected).abs() < 1e-12,
            "{joint}: {} instead of {expected}",
            at(joint)
        );
    }
}

#[test]
fn targets_that_cannot_be_met_at_the_start_are_refused_with_what_is_missing() {
    let mut suite = Suite::load("bioloid/squat").unwrap();
    suite.starts.get_mut("bent").unwrap().meet = Meet::Targets;
    assert!(Case::new(&suite, 0, &Variation::default()).is_ok());
    let hold = |value: f64| crate::trajectory::MotionSpec {
        task: "waist".into(),
        component: "z".into(),
        shape: Shape::Hold { value },
        from_s: 0.0,
        until_s: None,
    };
    // From straight legs no first-order step bends a knee.
    let mut straight = suite.clone();
    straight.starts.get_mut("bent").unwrap().joints.clear();
    straight.scenarios[0].motion = vec![hold(0.14)];
    let message = Case::new(&straight, 0, &Variation::default())
        .unwrap_err()
        .to_string();
    assert!(message.contains("a guess nearer"), "{message}");
    suite.scenarios[0].motion = vec![hold(0.2)];
    let message = Case::new(&suite, 0, &Variation::default())
        .unwrap_err()
        .to_string();
    for word in ["starts.bent", "meet", ".z at t = 0", "missed by", "1e-9"] {
        assert!(message.contains(word), "`{word}` is missing in: {message}");
    }
}

#[test]
fn the_walk_is_that_of_the_specification() {
    let suite = Suite::load("bioloid/gait").unwrap();
    let walks = cases(&suite);
    let walk = |i: usize| &walks[i].trajectory.gait().unwrap().walk;
    assert_eq!(
        walk(0),
        walk(1),
        "the bounded scenario takes the defaults, which are the same numbers"
    );
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/papers/bioloid-spec.json");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: the folder `shared` beside the project is absent");
        return;
    };
    let spec: serde_json::Value = serde_json::from_str(&text).unwrap();
    let number = |pointer: &str| {
        spec.pointer(&format!("/gait/{pointer}"))
            .unwrap()
            .as_f64()
            .unwrap()
    };
    let gait = suite.scenarios[0].gait.as_ref().unwrap();
    for (pointer, value) in [
        ("step", gait.step_m),
        ("step_ini", gait.initial_step_m),
        ("z_max_foot", gait.lift_m),
        ("lift_fraction", gait.lift_fraction),
        ("land_fraction", gait.land_fraction),
        ("z_knots_seconds/0", gait.height_knots[0].after_s),
        ("z_knots_seconds/1", gait.height_knots[1].after_s),
        ("z_knots_values/0", gait.height_knots[0].share),
        ("z_knots_values/1", gait.height_knots[1].share),
        ("x_hip_ini", gait.waist_start_m.unwrap()),
        ("dx_hip", gait.waist_increment_m.unwrap()),
        ("y_hip/0", gait.sway_m[0]),
        ("y_hip/1", gait.sway_m[1]),
        ("y_hip/2", gait.sway_m[2]),
        ("hand_x_max", gait.hand_swing_m),
        ("hand_z_max", gait.hand_lift_m),
        ("chosen/Tc", gait.step_period_s),
        ("chosen/n_steps", f64::from(gait.steps)),
        ("chosen/dt", suite.dt_s),
        ("chosen/waist_z", gait.waist_height_m),
        ("chosen/hand_neutral_drop", gait.hand_drop_m),
    ] {
        assert_eq!(value, number(pointer), "{pointer}");
    }
}

#[test]
fn posture_starts_have_the_knees_of_their_name() {
    let suite = Suite::load("coman/posture").unwrap();
    for (case, scenario) in cases(&suite).iter().zip(&suite.scenarios) {
        let knee = case.q_start[7 + case.problem.robot().coordinate("LKneeSag").unwrap()];
        assert_eq!(knee, scenario.id.parse().unwrap_or(0.15), "{}", scenario.id);
    }
}

#[test]
fn the_family_has_the_parameters_of_its_ids_and_c_among_them() {
    let suite = Suite::load("coman/asymmetric").unwrap();
    assert_eq!(suite.scenarios.len(), 13);
    for scenario in &suite.scenarios[1..] {
        let numbers: Vec<f64> = scenario.id[1..].split('_').map(|n| n.parse().unwrap()).collect();
        let Shape::Bump {
            amplitude,
            period_s: 2.0,
        } = scenario.motion[0].shape
        else {
            panic!("{}", scenario.id)
        };
        assert!((amplitude - numbers[0] / 100.0).abs() < 1e-15);
        let Shape::SmoothSine {
            amplitude,
            rise_s: 1.0,
            period_s,
        } = scenario.motion[1].shape
        else {
            panic!("{}", scenario.id)
        };
        assert!((amplitude - numbers[1] / 10.0).abs() < 1e-15 && period_s == numbers[2]);
    }
    let repeated = suite.scenarios.iter().find(|s| s.id == "C7_2_4").unwrap();
    assert_eq!(repeated.motion, suite.scenarios[0].motion);
}

#[test]
fn a_problem_survives_json() {
    for suite in Suite::load_embedded().unwrap() {
        for case in cases(&suite) {
            let text = serde_json::to_string(&case.spec).unwrap();
            assert_eq!(serde_json::from_str::<ProblemSpec>(&text).unwrap(), case.spec);
        }
    }
}

#[test]
fn variations_change_the_problem_and_say_so() {
    let suite = Suite::load("coman/squat").unwrap();
    let variation = Variation {
        velocity: Some(2.0),
        margin: Some(0.0873),
        ..Variation::default()
    };
    let case = Case::new(&suite, 0, &variation).unwrap();
    assert_eq!(case.scenario, "A+velocity=2+margin=0.0873");
    assert!(
        case.problem
            .robot()
            .coordinates()
            .iter()
            .all(|c| c.limits.velocity == 2.0)
    );
    assert_eq!(*case.problem.boundary(), Boundary::Ellipse { margin: 0.0873 });
    let boundary = Suite::load("coman/boundary").unwrap();
    let margin = Variation {
        margin: Some(0.1),
        ..Variation::default()
    };
    let message = Case::new(&boundary, 1, &margin).unwrap_err().to_string();
    assert!(
        message.contains("margin") && message.contains("not an ellipse"),
        "{message}"
    );
}

/// The message for a suite that is `coman/squat` with `from` replaced.
fn message(from: &str, to: &str) -> String {
    let text = EMBEDDED[0].1;
    assert!(text.contains(from), "{from}");
    let parsed = Suite::parse(&text.replacen(from, to, 1), "mine.toml", Path::new("."));
    let built = parsed.and_then(|suite| {
        lineup(&suite, &Selection::default())?;
        Case::new(&suite, 0, &Variation::default())
    });
    built.unwrap_err().to_string()
}

#[test]
fn bad_suites_are_refused_with_place_field_value_and_remedy() {
    let line = EMBEDDED[0].1.lines().position(|l| l.starts_with("dt_s")).unwrap() + 1;
    let expectations: [(&str, &str, &[&str]); 19] = [
        (
            "dt_s = 0.005",
            "dt_s = 'slow'",
            &["mine.toml", &format!("line {line}"), "string", "f64"],
        ),
        (
            "dt_s = 0.005",
            "dt_s = 0.005\ncolour = 3",
            &[
                "mine.toml",
                &format!("line {}", line + 1),
                "colour",
                "soft_tolerance_m",
            ],
        ),
        ("dt_s = 0.005", "dt_s = 0", &["dt_s = 0", "above 0"]),
        ("dt_s = 0.005", "dt_s = nan", &["dt_s = NaN", "finite"]),
        (
            "soft_tolerance_m = 0.08",
            "soft_tolerance_m = -1",
            &["soft_tolerance_m = -1", "above 0"],
        ),
        (
            "amplitude = 0.03",
            "amplitude = nan",
            &["scenarios[0].motion[0].shape.bump.amplitude = NaN", "finite"],
        ),
        (
            "amplitude = 0.03",
            "amplitude = -inf",
            &["amplitude = -inf", "finite"],
        ),
        (
            "amplitude = 0.03",
            "amplitud = 0.03",
            &["line", "amplitud", "period_s"],
        ),
        ("bump = {", "hump = {", &["line", "hump", "smooth-step"]),
        (
            "component = \"z\"",
            "component = \"pitch\"",
            &["component `pitch`", "x, y, z"],
        ),
        (
            "task = \"com\"",
            "task = \"con\"",
            &["task `con`", "did you mean `com`?"],
        ),
        (
            "\"coman-legs\"",
            "\"coman-leg\"",
            &["robot `coman-leg`", "did you mean `coman-legs`?"],
        ),
        (
            "\"l_sole\"",
            "\"l_soul\"",
            &["frame `l_soul`", "did you mean `l_sole`?"],
        ),
        (
            "joints.LKneeSag = 1.2",
            "joints.LKneeSag = 1.95",
            &["joints.LKneeSag = 1.95", "0 .. 1.9199"],
        ),
        (
            "joints.LKneeSag = 1.2",
            "joints.LKneSag = 1.2",
            &["joint `LKneSag`", "did you mean `LKneeSag`?"],
        ),
        (
            "base_rpy_rad = [0.0, 0.0, 0.0]",
            "base_rpy_rad = [0.0, 0.0]",
            &["line", "length 2", "length 3"],
        ),
        (
            "start = \"crouched\"",
            "start = \"standing\"",
            &["start `standing`", "crouched"],
        ),
        ("margin = 0.0", "margin = 1.0", &["margin", "leaves no range"]),
        (
            "method = \"ik4\"",
            "method = \"ik6\"",
            &["contestants[1].method", "method `ik6`", "ik4"],
        ),
    ];
    for (from, to, words) in expectations {
        let message = message(from, to);
        for word in words {
            assert!(
                message.contains(word),
                "`{to}`: `{word}` is missing in: {message}"
            );
        }
    }
}

#[test]
fn soles_turn_balance_on_and_are_checked() {
    let soles = |left: &str| {
        let right = "frame = 'r_sole'\nhalf_length_m = 0.1\nhalf_width_m = 0.05\nfoot = 'right'";
        format!("[[soles]]\n{right}\n[[soles]]\n{left}\n\n[problem]")
    };
    let good = "frame = 'l_sole'\nhalf_length_m = 0.1\nhalf_width_m = 0.05\nfoot = 'left'";
    let suite = |left: &str| EMBEDDED[0].1.replacen("[problem]", &soles(left), 1);
    let parsed = Suite::parse(&suite(good), "mine.toml", Path::new(".")).unwrap();
    assert_eq!(parsed.soles.len(), 2);
    let case = Case::new(&parsed, 0, &Variation::default()).unwrap();
    let start = crate::referee::Run {
        dt_s: case.dt_s,
        q: std::slice::from_ref(&case.q_start),
        targets: case.samples.judged(),
        phases: &[ik_core::problem::PhaseId(0)],
        support: &[],
        walk: None,
    };
    let margin = case.referee.judge(&start).gcom_margin_min_m.unwrap();
    assert!(margin > 0.0 && margin <= 0.1, "{margin}");
    let fails = |from: &str, to: &str| message("[problem]", &soles(&good.replacen(from, to, 1)));
    let expectations: [(&str, &str, &[&str]); 5] = [
        (
            "l_sole",
            "l_soul",
            &["soles[1]", "frame `l_soul`", "did you mean `l_sole`?"],
        ),
        ("'left'", "'hand'", &["line", "hand", "`right` or `left`"]),
        ("'left'", "'right'", &["mine.toml", "foot = \"left\""]),
        ("0.05", "0.0", &["soles[1].half_width_m = 0", "above 0"]),
        ("half_width_m", "width_m", &["line", "width_m", "half_width_m"]),
    ];
    for (from, to, words) in expectations {
        let message = fails(from, to);
        for word in words {
            assert!(
                message.contains(word),
                "`{to}`: `{word}` is missing in: {message}"
            );
        }
    }
}

#[test]
fn limits_can_be_replaced_and_are_checked() {
    let limits = |text: &str| {
        message(
            "[[problem.tasks]]",
            &format!("[[problem.limits]]\n{text}\n\n[[problem.tasks]]"),
        )
    };
    assert!(limits("joints = [\"LKneSag\"]").contains("did you mean `LKneeSag`?"));
    let excluded = limits("joints = [\"LKneeSag\"]\nlower = 1.3");
    assert!(
        excluded.contains("joints.LKneeSag = 1.2") && excluded.contains("1.3 .. 1.9199"),
        "{excluded}"
    );
    assert!(limits("lower = inf").contains("finite"));
    assert!(limits("velocity = 0.0").contains("above 0"));
    let reversed = limits("joints = [\"LKneeSag\"]\nlower = 2.5");
    assert!(reversed.contains("lower <= upper"), "{reversed}");
}

#[test]
fn robots_come_from_urdf_files_too() {
    let folder = std::env::temp_dir().join(format!("ik-bench-suite-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let suite = |path: &str| {
        format!(
            "id = 'mine'\ntitle = ''\nanalysis = ''\ndt_s = 0.01\nsoft_tolerance_m = 1.0\n[problem]\n\
             robot = {{ urdf-file = {{ path = '{path}', root = 'fixed' }} }}\nboundary = {{ kind = 'box' }}\n\
             [[problem.tasks]]\nname = 'joints'\ntrack = 'posture'\npriority = {{ compromised = {{ uniform = 1.0 }} }}\n\
             [starts.zero]\n[[scenarios]]\nid = 'wave'\nduration_s = 0.1\nstart = 'zero'\n\
             motion = [{{ task = 'joints', component = 'swing', shape = {{ offset = {{ value = 0.1 }} }} }}]\n"
        )
    };
    let urdf = "<robot name='p'><link name='a'/><link name='b'/><joint name='swing' type='revolute'><parent link='a'/>\
                <child link='b'/><axis xyz='0 1 0'/><limit lower='-1' upper='1' velocity='2' effort='1'/></joint></robot>";
    std::fs::write(folder.join("good.urdf"), urdf).unwrap();
    std::fs::write(folder.join("bad.urdf"), &urdf[..60]).unwrap();
    let build = |path: &str| {
        Suite::parse(&suite(path), "mine.toml", &folder).and_then(|s| Case::new(&s, 0, &Variation::default()))
    };
    let case = build("good.urdf").unwrap();
    assert!(
        matches!(&case.spec.robot, RobotSpec::Urdf { text, .. } if text == urdf),
        "instances carry the text"
    );
    assert_eq!(case.samples.window(3).now().x, [0.1]);
    let malformed = build("bad.urdf").unwrap_err().to_string();
    assert!(
        malformed.contains("bad.urdf") && malformed.contains("XML"),
        "{malformed}"
    );
    let missing = build("none.urdf").unwrap_err().to_string();
    assert!(
        missing.contains("none.urdf") && missing.contains("cannot be read"),
        "{missing}"
    );
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_ramp_of_gains_fits_into_a_swing() {
    let (_, text) = EMBEDDED.iter().find(|(id, _)| *id == "melson/walk").unwrap();
    let built = |ramp_s: &str| {
        let text = text.replace(
            "single_support_ramp_s = 0.3",
            &format!("single_support_ramp_s = {ramp_s}"),
        );
        let suite = Suite::parse(&text, "mine.toml", std::path::Path::new(".")).unwrap();
        Case::new(&suite, 0, &Variation::default()).map(|_| ())
    };
    built("1.5").unwrap();
    let refused = built("1.51").unwrap_err().to_string();
    for word in [
        "mine.toml",
        "gains[1].single_support_ramp_s = 1.51",
        "at most 1.5",
        "half the shortest swing",
    ] {
        assert!(refused.contains(word), "`{word}` is missing in: {refused}");
    }
}
