#![allow(clippy::unwrap_used, reason = "tests want to stop at the first surprise")]

use super::*;
use crate::runner::play;
use crate::suite::{Selection, Suite, Variation, lineup};
use ik_core::boundary::Boundary;
use ik_core::task::OrientationCoordinates;

fn bits(v: &[f64]) -> Vec<u64> {
    v.iter().map(|x| x.to_bits()).collect()
}

/// Dumps steps of a run as text, solves them again, and compares every bit.
fn replay(case: &Case, steps: &[usize]) {
    let all = lineup(&Suite::load("coman/squat").unwrap(), &Selection::default()).unwrap();
    for contestant in &all {
        let (driver, played) = play(case, contestant).unwrap();
        for &k in steps {
            let instance = Instance::of_run(case, contestant, &played, driver.majors(), k);
            let text = serde_json::to_string(&instance).unwrap();
            let read = Instance::parse(&text, "step.json").unwrap();
            assert_eq!(read, instance, "JSON keeps every number");
            let same = read.contestant(None, &toml::Table::new(), "step.json").unwrap();
            let answer = read.solve(&same, "step.json").unwrap();
            assert_eq!(
                bits(&answer.q),
                bits(&played.q[k]),
                "{} step {k} of {}",
                contestant.id,
                case.scenario
            );
            assert_eq!(
                (answer.majors, answer.minors),
                (played.majors[k - 1], played.minors[k - 1])
            );
        }
    }
}

fn case(suite: &Suite, index: usize, duration_s: f64) -> Case {
    let mut suite = suite.clone();
    suite.scenarios[index].duration_s = duration_s;
    Case::new(&suite, index, &Variation::default()).unwrap()
}

#[test]
fn a_step_replays_bit_for_bit() {
    let stretch = Suite::load("coman/stretch").unwrap();
    // Step 130 lies in the approach to the straight leg, 200 on it.
    replay(&case(&stretch, 0, 1.1), &[1, 2, 130, 200, 220]);
}

#[test]
fn a_step_replays_with_quaternions_preview_and_another_boundary() {
    let mut suite = Suite::load("coman/asymmetric").unwrap();
    suite.problem.orientation = OrientationCoordinates::Log;
    suite.problem.preview_s = 0.05;
    suite.problem.boundary = Boundary::Box;
    replay(&case(&suite, 0, 0.3), &[1, 60]);
}

fn instance_of(suite: &Suite, k: usize) -> (Case, Instance) {
    let case = case(suite, 0, 1.1);
    let selection = Selection {
        methods: vec!["ik4".into()],
        set: "n = 15".parse().unwrap(),
    };
    let contestant = lineup(suite, &selection).unwrap().remove(0);
    let (driver, played) = play(&case, &contestant).unwrap();
    let instance = Instance::of_run(&case, &contestant, &played, driver.majors(), k);
    (case, instance)
}

#[test]
fn an_answer_names_active_bounds_and_residuals() {
    let suite = Suite::load("coman/stretch").unwrap();
    let (_, instance) = instance_of(&suite, 200);
    let contestant = instance
        .contestant(None, &toml::Table::new(), "step.json")
        .unwrap();
    let answer = instance.solve(&contestant, "step.json").unwrap();
    let bounds = &answer.active_bounds;
    let straight =
        |b: &ActiveBound| b.joint.ends_with("KneeSag") && b.side == "lower" && b.increment.abs() < 1e-6;
    assert!(
        !bounds.is_empty() && bounds.iter().all(straight),
        "a knee is at its limit at t = 1 s: {bounds:?}"
    );
    let names: Vec<&str> = answer.residuals.iter().map(|r| r.task.as_str()).collect();
    assert_eq!(names, ["com", "left-sole", "right-sole", "torso"]);
    let com = &answer.residuals[0];
    assert!(
        com.priority == "compromised" && com.error[2] < -0.015,
        "the target is 2 cm out of reach: {com:?}"
    );
    assert!(
        answer.residuals[1..]
            .iter()
            .all(|r| r.priority == "hard" && r.error.iter().all(|e| e.abs() < 1e-6))
    );
}

#[test]
fn residuals_agree_in_both_orientation_coordinates() {
    let residual = |orientation| {
        let mut suite = Suite::load("coman/asymmetric").unwrap();
        suite.problem.orientation = orientation;
        let (case, instance) = instance_of(&suite, 150);
        // The target of the step at the configuration before it: the torso has turned a little.
        let target = case.samples.window(instance_step(&instance)).now().x.to_vec();
        residuals(&case.problem, PhaseId(0), &instance.q_prev, &target)
            .pop()
            .unwrap()
            .error
    };
    let (rpy, log) = (
        residual(OrientationCoordinates::RollPitchYaw),
        residual(OrientationCoordinates::Log),
    );
    let norm = |v: &[f64]| v.iter().map(|e| e * e).sum::<f64>().sqrt();
    assert!(norm(&rpy) > 1e-4, "{rpy:?}");
    // For angles below 0.2 rad the two measures differ by less than their cosines.
    assert!((norm(&rpy) / norm(&log) - 1.0).abs() < 0.05, "{rpy:?} {log:?}");
}

fn instance_step(instance: &Instance) -> usize {
    let words: Vec<&str> = instance.origin.split_whitespace().collect();
    words[2].parse().unwrap()
}

#[test]
fn another_method_takes_its_own_parameters_and_budget() {
    let suite = Suite::load("coman/stretch").unwrap();
    let (_, instance) = instance_of(&suite, 100);
    let other = instance
        .contestant(Some("ik5"), &"n = 3".parse().unwrap(), "step.json")
        .unwrap();
    let answer = instance.solve(&other, "step.json").unwrap();
    assert_eq!(
        (answer.method.as_str(), answer.parameters["n"].as_i64()),
        ("ik5", Some(3))
    );
    assert!(answer.majors <= 3);
    let tight = instance
        .contestant(None, &"n = 1".parse().unwrap(), "step.json")
        .unwrap();
    assert_eq!(instance.solve(&tight, "step.json").unwrap().majors, 1);
}

#[test]
fn bad_instances_are_refused() {
    let suite = Suite::load("coman/squat").unwrap();
    let (_, good) = instance_of(&suite, 10);
    let message = |change: &dyn Fn(&mut Instance)| {
        let mut bad = good.clone();
        change(&mut bad);
        let result = bad
            .contestant(None, &toml::Table::new(), "i.json")
            .and_then(|c| bad.solve(&c, "i.json"));
        result.unwrap_err().to_string()
    };
    let expect = |found: String, words: &[&str]| {
        assert!(
            words.iter().all(|word| found.contains(word)),
            "{words:?} in {found}"
        );
    };
    expect(
        message(&|i| i.q_prev.truncate(5)),
        &["i.json", "q_prev has 5 numbers", "19"],
    );
    expect(message(&|i| i.v_prev.push(0.0)), &["v_prev has 19 numbers", "18"]);
    expect(message(&|i| i.q_prev[3] = 0.5), &["q_prev[3]", "unit length"]);
    expect(message(&|i| i.dt_s = 0.0), &["dt_s = 0"]);
    expect(
        message(&|i| i.samples[1].x.truncate(3)),
        &["samples[1].x", "3 numbers", "18 numbers"],
    );
    expect(
        message(&|i| i.samples.truncate(1)),
        &["samples = 1", "at least 2"],
    );
    expect(message(&|i| i.phase = 4), &["phase 4"]);
    expect(message(&|i| i.gains.push(1.0)), &["gains has 1"]);
    expect(
        message(&|i| "ik77".clone_into(&mut i.method)),
        &["unknown method `ik77`", "ik4"],
    );
    let unknown = |i: &mut Instance| _ = i.parameters.insert("gama".into(), 1.0.into());
    expect(message(&unknown), &["gama", "did you mean `gamma`?"]);
    let text = serde_json::to_string(&good).unwrap();
    expect(
        Instance::parse(&text[..text.len() / 2], "i.json")
            .unwrap_err()
            .to_string(),
        &["i.json", "line 1 column"],
    );
    let infinite = text.replacen("\"dt_s\":0.005", "\"dt_s\":1e999", 1);
    expect(
        Instance::parse(&infinite, "i.json").unwrap_err().to_string(),
        &["i.json", "out of range"],
    );
    let other = text.replacen(SCHEMA, "ik-bench/instance/9", 1);
    expect(
        Instance::parse(&other, "i.json").unwrap_err().to_string(),
        &["schema", "instance/9", SCHEMA],
    );
}
