//! The suites on fewer poses, solvers that are wrong, and suites that are.

use super::subject::{Answers, Joints};
use super::*;
use crate::machine::machine;
use crate::runner::{Session, Timing};
use ik_methods::reverse_decoupling::Unsolved;
use nalgebra::{Isometry3, Translation3};
use std::path::Path;

const GRID: &str = include_str!("../../suites/closed-form/grid.toml");
const CONTINUITY: &str = include_str!("../../suites/closed-form/continuity.toml");
const REACH: &str = include_str!("../../suites/closed-form/reach.toml");

fn plan(text: &str) -> Plan {
    let suite = LimbSuite::parse(text, "test.toml", Path::new(".")).unwrap();
    Plan::new(&suite, Amount::Quick).unwrap()
}

/// The embedded suite with other quick numbers.
fn with_quick(text: &str, quick: &str) -> String {
    let line = text.lines().find(|line| line.starts_with("quick = ")).unwrap();
    text.replace(line, &format!("quick = {{ {quick} }}"))
}

fn session() -> Session {
    Session {
        timing: Timing::QUICK,
        revision: "test".to_owned(),
        machine: machine(),
        notes: Vec::new(),
    }
}

fn all_rows(plan: &Plan) -> Vec<LimbRow> {
    let session = session();
    plan.jobs()
        .iter()
        .map(|job| plan.make(job, &session).row)
        .collect()
}

fn own(plan: &Plan, job: &Job) -> Findings {
    let subject = plan.subject(job);
    let solve = |pose: &Isometry3<f64>, previous: &Joints, answers: &mut Answers| {
        subject.solve(pose, previous, answers)
    };
    plan.found(job, &solve).0
}

#[test]
fn a_thousand_poses_of_every_limb_are_solved() {
    let plan = plan(&with_quick(
        GRID,
        "whole_up_to = 1000, sampled = 1000, random = 1000, timed = 1",
    ));
    let rows = all_rows(&plan);
    // Four limbs of each humanoid of the source, two of bioloid and coman, one of arm6; five sets.
    assert_eq!(rows.len(), 5 * (4 * 4 + 2 + 2 + 1));
    for row in &rows {
        let Findings::Grid(found) = &row.found else {
            panic!("{row:?}")
        };
        let place = format!("{} {} {}: {found:?}", row.robot, row.limb, row.set);
        let on_axis = row.set.starts_with("on-axis");
        assert!(found.held, "{place}");
        assert_eq!((found.unsolved, found.not_finite), (0, 0), "{place}");
        let largest = if on_axis { 2e-7 } else { 1e-10 };
        assert!(found.error_max_m.max(found.error_max_rad) < largest, "{place}");
        assert_eq!(found.recovered, found.compared, "{place}");
        let within = if on_axis { 1e-5 } else { 1e-6 };
        assert!(found.away_max_rad <= within, "{place}");
        if on_axis {
            assert_eq!(found.compared, found.poses, "{place}");
            continue;
        }
        assert!(found.poses >= 1000 && found.excluded < 20, "{place}");
        assert_eq!(found.compared + found.excluded, found.poses, "{place}");
        let solutions = match row.family.as_str() {
            "leg of the paper" | "arm of the paper" => Some(8),
            "arm of four joints" => Some(2),
            _ => continue,
        };
        assert_eq!(found.indicated, Some(found.compared), "{place}");
        assert_eq!(found.distinct_compared_min, solutions, "{place}");
    }
}

#[test]
fn no_path_jumps_unless_it_must() {
    let plan = plan(&with_quick(CONTINUITY, "paths = 6, steps = 100"));
    let (mut forced, mut smooth) = (0, 0);
    for row in all_rows(&plan) {
        let Findings::Continuity(found) = &row.found else {
            panic!("{row:?}")
        };
        let place = format!("{} {} {}: {found:?}", row.robot, row.limb, row.set);
        assert!(
            found.held && found.unsolved == 0 && found.jumps == found.forced,
            "{place}"
        );
        if row.set.ends_with("smooth") {
            assert_eq!(found.jumps, 0, "{place}");
            smooth += found.paths;
        }
        forced += found.forced;
    }
    assert!(
        smooth > 800 && forced > 400,
        "{smooth} smooth paths, {forced} forced jumps"
    );
}

#[test]
fn reach_is_decided_within_a_nanometre() {
    let plan = plan(&with_quick(
        REACH,
        "distances = 12, orientations = 100, cells = 21",
    ));
    let mut beside = 0;
    for row in all_rows(&plan) {
        let place = format!("{} {} {}: {:?}", row.robot, row.limb, row.set, row.found);
        assert!(row.found.held(), "{place}");
        match &row.found {
            Findings::Reach(found) => {
                beside += found.at_boundary.unwrap_or(0);
                assert_eq!(found.disagreements.unwrap_or(0), 0, "{place}");
                // The last distance is beyond the stretched limb, with or without formula.
                assert_eq!(found.reachable.last(), Some(&0), "{place}");
            }
            Findings::Slice(found) => assert!(found.distinct.iter().flatten().any(|n| *n == 8), "{place}"),
            Findings::Postures(found) => assert_eq!(found.solutions.len(), 8, "{place}"),
            other => panic!("{other:?}"),
        }
    }
    assert!(beside > 5_000, "{beside} poses beside the boundary");
}

#[test]
fn the_number_of_threads_changes_nothing_but_times() {
    for text in [GRID, CONTINUITY, REACH] {
        let plan = plan(&hubo_only(text));
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let found = || {
                plan.jobs()
                    .iter()
                    .map(|job| without_times(own(&plan, job)))
                    .collect::<Vec<_>>()
            };
            pool.install(found)
        };
        assert_eq!(on(1), on(4));
    }
}

/// Hubo alone, and what the suite says about other robots left out.
fn hubo_only(text: &str) -> String {
    let mut suite: toml::Table = text.parse().unwrap();
    suite["robots"].as_array_mut().unwrap().truncate(1);
    let reach = suite["study"]
        .get_mut("reach")
        .and_then(toml::Value::as_table_mut);
    if let Some(slices) = reach.and_then(|r| r["slices"].as_array_mut()) {
        slices.retain(|slice| slice["robot"].as_str() == Some("hubo"));
    }
    let quick = "whole_up_to = 64, sampled = 600, random = 600, timed = 1, paths = 2, steps = 40";
    let study = suite["study"].as_table_mut().unwrap();
    for (kind, spec) in study.iter_mut() {
        let keep: &[&str] = match kind.as_str() {
            "grid" => &["whole_up_to", "sampled", "random", "timed"],
            "continuity" => &["paths", "steps"],
            _ => continue,
        };
        let numbers: toml::Table = format!("quick = {{ {quick} }}").parse().unwrap();
        let mut numbers = numbers["quick"].as_table().unwrap().clone();
        numbers.retain(|name, _| keep.contains(&name));
        spec.as_table_mut()
            .unwrap()
            .insert("quick".to_owned(), numbers.into());
    }
    toml::to_string(&suite).unwrap()
}

fn without_times(found: Findings) -> Findings {
    match found {
        Findings::Grid(found) => Findings::Grid(GridFindings {
            times: Times::default(),
            ..found
        }),
        other => other,
    }
}

/// How a solver can be wrong.
type Spoiled = fn(&mut Isometry3<f64>, &mut Answers) -> Result<(), Unsolved>;

/// Jobs of a suite that a spoiled solver fails.
fn failed(plan: &Plan, before: Spoiled, after: Spoiled) -> usize {
    let held = |job: &Job| {
        let subject = plan.subject(job);
        let solve = |pose: &Isometry3<f64>, previous: &Joints, answers: &mut Answers| {
            let mut pose = *pose;
            before(&mut pose, answers)?;
            subject.solve(&pose, previous, answers)?;
            after(&mut pose, answers)
        };
        plan.found(job, &solve).0.held()
    };
    plan.jobs().iter().filter(|job| !held(job)).count()
}

#[test]
fn wrong_solvers_are_found_out() {
    let fine: Spoiled = |_, _| Ok(());
    let grid = plan(&hubo_only(GRID));
    let all = grid.jobs().len();
    assert_eq!(failed(&grid, fine, fine), 0);
    let shifted: Spoiled = |pose, _| {
        *pose = Translation3::new(3e-7, 0.0, 0.0) * *pose;
        Ok(())
    };
    assert_eq!(failed(&grid, shifted, fine), all, "a pose missed by 0.3 µm");
    let short: Spoiled = |_, answers| {
        answers.pop();
        Ok(())
    };
    assert_eq!(failed(&grid, fine, short), all, "a posture left out");
    let swapped: Spoiled = |_, answers| {
        answers.iter_mut().for_each(|(_, branch)| *branch ^= 4);
        Ok(())
    };
    assert_eq!(
        failed(&grid, fine, swapped),
        2 * 4,
        "off the axes: another branch than the indicated"
    );
    let broken: Spoiled = |_, answers| {
        answers
            .iter_mut()
            .take(1)
            .for_each(|(joints, _)| joints[2] = f64::NAN);
        Ok(())
    };
    assert_eq!(failed(&grid, fine, broken), all, "not a number");

    let continuity = plan(&hubo_only(CONTINUITY));
    let flipped: Spoiled = |pose, answers| {
        // On one side of a plane only some postures are known.
        answers.retain(|(_, branch)| *branch >= 4 || pose.translation.z > -0.3);
        Ok(())
    };
    assert!(
        failed(&continuity, fine, flipped) > 0,
        "postures that come and go"
    );

    let reach = plan(&hubo_only(REACH));
    let generous: Spoiled = |pose, _| {
        pose.translation.vector *= 1.0 - 1e-8;
        Ok(())
    };
    assert!(
        failed(&reach, generous, fine) > 0,
        "a boundary some nanometres off"
    );
}

#[test]
fn bad_suites_name_file_field_and_what_is_allowed() {
    let refused = |text: &str, from: &str, to: &str, words: &[&str]| {
        let text = text.replacen(from, to, 1);
        let made = LimbSuite::parse(&text, "bad.toml", Path::new("."));
        let error = made
            .and_then(|suite| Plan::new(&suite, Amount::Quick))
            .unwrap_err();
        let message = error.to_string();
        for word in ["bad.toml"].iter().chain(words) {
            assert!(message.contains(word), "{word:?} not in {message}");
        }
    };
    refused(GRID, "seed = 20260", "sed = 20260", &["line", "sed", "seed"]);
    refused(GRID, "\"hubo\"", "\"hobo\"", &["robots[0]", "hobo", "hubo"]);
    refused(GRID, "\"hoap2\"", "\"hubo\"", &["robots[1]", "each robot once"]);
    refused(
        GRID,
        "[30, 45, 60]",
        "[30, 50, 60]",
        &["study.grid.on_axis_deg[1]", "50", "full turn"],
    );
    refused(
        GRID,
        "[30, 45, 60]",
        "[30, nan, 60]",
        &["study.grid.on_axis_deg[1]", "full turn"],
    );
    refused(
        GRID,
        "offset_deg = 7.3",
        "offset_deg = inf",
        &["study.grid.off_axis.offset_deg"],
    );
    refused(
        GRID,
        "random = 20000",
        "random = 0",
        &["study.grid.full.random", "1 to 1000000"],
    );
    refused(GRID, "random = 20000", "random = -1", &["line"]);
    refused(
        GRID,
        "\"arm6\"",
        "\"arm7\"",
        &["robots[6]", "arm7", "explain closed-form --robot arm7"],
    );
    refused(GRID, "closed-form/grid", "closed form", &["id"]);
    refused(
        GRID,
        "[30, 45, 60]",
        "[]",
        &["study.grid.on_axis_deg = empty", "at least one"],
    );
    refused(
        GRID,
        "step_deg = 30, offset_deg = 7.3",
        "step_deg = 45, offset_deg = 45",
        &["study.grid.off_axis.offset_deg = 45", "multiples of 90"],
    );
    refused(
        GRID,
        "[study.grid]",
        "[study]",
        &["study = ", "exactly one of grid"],
    );
    refused(
        CONTINUITY,
        "[study.continuity]",
        "[study.reach]\n[study.continuity]",
        &["study = continuity, reach", "exactly one of grid"],
    );
    refused(
        CONTINUITY,
        "steps = 200",
        "steps = 100000",
        &["study.continuity.full.steps = 100000", "2 to 50000"],
    );
    refused(
        REACH,
        "beyond = 1.05",
        "beyond = 1e9",
        &["study.reach.beyond = 1000000000", "0.01 to 10"],
    );
    refused(
        REACH,
        "cells = 81",
        "cells = 100000",
        &["study.reach.full.cells = 100000", "2 to 1000"],
    );
    refused(
        REACH,
        "orientations = 2000",
        "orientations = 20000",
        &["study.reach.full.orientations = 20000", "1 to 16666"],
    );
    refused(
        REACH,
        "[0.4, 0.9, 0.3]",
        "[0.4, 9e9, 0.3]",
        &["study.reach.slices[1].rotation_rpy_rad[1]", "-6.3 to 6.3"],
    );
    refused(
        CONTINUITY,
        "turn_rad = 0.8",
        "turn_rad = 0.0",
        &["study.continuity.turn_rad", "1.5"],
    );
    refused(
        CONTINUITY,
        "steps = 200",
        "steps = 201",
        &["study.continuity.full.steps", "even"],
    );
    refused(
        CONTINUITY,
        "hubo/r_palm",
        "hubo/r_plam",
        &["study.continuity.traced[1]", "r_palm"],
    );
    refused(REACH, "beyond = 1.05", "beyond = nan", &["study.reach.beyond"]);
    refused(
        REACH,
        "distances = 60",
        "distances = 1",
        &["study.reach.full.distances", "2 to"],
    );
    refused(
        REACH,
        "r_sole",
        "r_soul",
        &["study.reach.slices[0]", "hubo/r_sole"],
    );
    refused(
        REACH,
        "[15, -75,",
        "[15,",
        &["study.reach.postures[0]", "joints_deg", "6 numbers"],
    );
    refused(
        REACH,
        "\"r_palm\"",
        "\"palm\"",
        &["study.reach.postures[1]", "hubo/r_palm"],
    );
}

#[test]
fn robots_without_a_row_are_noted() {
    let robots = "{ embedded = \"bioloid\" },\n]";
    let more = CONTINUITY.replace(
        robots,
        "{ embedded = \"bioloid\" },\n    { embedded = \"coman\" },\n]",
    );
    let notes = plan(&more).notes();
    assert!(
        notes.len() == 1 && notes[0].contains("no rows of coman"),
        "{notes:?}"
    );
    assert!(plan(CONTINUITY).notes().is_empty());
}

#[test]
fn rows_come_back_as_they_were_written_and_replace_their_like() {
    let dir = std::env::temp_dir().join(format!("ik-bench-limbs-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let plan = plan(&hubo_only(REACH));
    let rows = all_rows(&plan);
    let mut store = LimbStore::open(&dir).unwrap();
    store.add(&rows[..3]).unwrap();
    store.add(&rows).unwrap();
    assert_eq!(read_limbs(&dir.join(LIMBS_FILE)).unwrap().len(), rows.len());
    let again = LimbStore::open(&dir).unwrap();
    for (job, row) in plan.jobs().iter().zip(&rows) {
        assert_eq!(again.find(&plan.key(job, "test")), Some(row));
        assert_eq!(again.find(&plan.key(job, "other")), None);
    }
    let mut broken = rows[0].clone();
    if let Findings::Reach(found) = &mut broken.found {
        found.error_max = f64::NAN;
    }
    assert!(
        store
            .add(&[broken])
            .unwrap_err()
            .to_string()
            .contains("not finite")
    );
    let text = std::fs::read_to_string(dir.join(LIMBS_FILE)).unwrap();
    std::fs::write(dir.join(LIMBS_FILE), text.replace(SCHEMA, "ik-bench/limb/0")).unwrap();
    let error = read_limbs(&dir.join(LIMBS_FILE)).unwrap_err().to_string();
    assert!(error.contains("schema") && error.contains(SCHEMA), "{error}");
    std::fs::remove_dir_all(&dir).unwrap();
}
