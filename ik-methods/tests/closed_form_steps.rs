//! The closed form as a formulation: whole robots, limits, refusals.

#![allow(clippy::unwrap_used, missing_docs, reason = "tests")]

#[allow(dead_code, reason = "shared with other tests")]
#[path = "common/fixture.rs"]
mod fixture;

use fixture::{DT_S, Fixture, parts, targets_at};
use ik_core::boundary::Boundary;
use ik_core::configuration::integrate;
use ik_core::driver::Driver;
use ik_core::formulation::{Declined, Termination};
use ik_core::problem::{Problem, ProblemParts};
use ik_core::robot::{Limits, Robot, embedded};
use ik_core::task::{OrientationCoordinates, Priority, Track, Weights};
use ik_methods::registry::method;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Numbers in ±1: multiples of irrational steps, which do not repeat.
fn numbers(seed: usize, count: usize) -> Vec<f64> {
    let number = |i: usize| 2.0 * ((i + 1) as f64 * 0.754_877_666_246_692_7).fract() - 1.0;
    (0..count).map(|i| number(1009 * seed + i)).collect()
}

fn frame(robot: &Robot, name: &str) -> ik_core::robot::FrameId {
    robot.frame(name).unwrap()
}

/// Feet, hands, the orientation of the waist and the centre of mass: as many rows as coordinates.
fn balanced(robot: &Robot) -> Vec<(&'static str, Track)> {
    vec![
        ("com", Track::CentreOfMass),
        ("waist", Track::Orientation(frame(robot, "waist"))),
        ("right-foot", Track::Pose(frame(robot, "r_sole"))),
        ("left-foot", Track::Pose(frame(robot, "l_sole"))),
        ("right-hand", Track::Pose(frame(robot, "r_hand"))),
        ("left-hand", Track::Pose(frame(robot, "l_hand"))),
    ]
}

/// Standing with bent knees and elbows, arms a little spread, plus `size` times a pattern.
fn bent(robot: &Robot, seed: usize, size: f64) -> Vec<f64> {
    let mut q = robot.neutral();
    for side in ["r", "l"] {
        let leg = [0.0, -FRAC_PI_2, -0.4, 0.8, -0.4, 0.0];
        let arm = [1.4, -1.3, -1.4, 1.1, -0.5, 1.1];
        for (limb, values) in [("leg", leg), ("arm", arm)] {
            for (joint, value) in (1..).zip(values) {
                if let Ok(c) = robot.coordinate(&format!("{side}_{limb}_{joint}")) {
                    q[7 + c] = value;
                }
            }
        }
    }
    let pattern: Vec<f64> = numbers(seed, robot.nv()).iter().map(|x| size * x).collect();
    integrate(robot, &q, &pattern)
}

fn fixture(
    tasks: &[(&str, Track)],
    robot: &Arc<Robot>,
    start: Vec<f64>,
    change: impl FnOnce(&mut ProblemParts),
) -> Fixture {
    let mut parts = parts(robot, tasks, OrientationCoordinates::Log);
    change(&mut parts);
    Fixture::new(parts, start)
}

fn away(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Greatest difference of targets, quaternions up to their sign.
fn missed(problem: &Problem, x: &[f64], q: &[f64]) -> f64 {
    let found = targets_at(problem, q);
    let mut worst = 0.0_f64;
    for (task, slot) in problem.tasks().iter().zip(problem.slots()) {
        let turn = match task.track {
            Track::Orientation(_) => Some(slot.x),
            Track::Pose(_) => Some(slot.x + 3),
            _ => None,
        };
        if !matches!(task.track, Track::Orientation(_)) {
            worst = worst.max(away(&found[slot.x..slot.x + 3], &x[slot.x..slot.x + 3]));
        }
        if let Some(at) = turn {
            let (a, b) = (&found[at..at + 4], &x[at..at + 4]);
            let opposite: Vec<f64> = b.iter().map(|b| -b).collect();
            worst = worst.max(away(a, b).min(away(a, &opposite)));
        }
    }
    worst
}

#[test]
fn whole_humanoids_meet_all_targets_and_find_the_generating_posture() {
    for id in ["hubo", "hrp2", "asimo"] {
        let robot = Arc::new(embedded(id).unwrap());
        let start = bent(&robot, 0, 0.0);
        let fixture = fixture(&balanced(&robot), &robot, start, |_| {});
        let mut driver = fixture.driver("closed-form", "");
        let (mut most, mut same) = (0, 0);
        for seed in 1..=200 {
            let goal = bent(&robot, seed, 0.08);
            let x = targets_at(&fixture.problem, &goal);
            let (termination, counts) = fixture.step(&mut driver, &fixture.start, &x, &[]);
            assert_eq!(termination, Termination::Converged, "{id} {seed}");
            let q = &driver.solution().q;
            assert!(
                missed(&fixture.problem, &x, q) < 1e-9,
                "{id} {seed}: {:e}",
                missed(&fixture.problem, &x, q)
            );
            most = most.max(counts.majors);
            same += usize::from(away(q, &goal) < 1e-7);
        }
        assert_eq!(
            same, 200,
            "{id}: the generating posture is the one near the start"
        );
        assert!(most <= 8, "{id}: {most} positions of the waist");
    }
}

#[test]
fn four_joint_arms_take_poses_of_their_set_and_refuse_others() {
    let robot = Arc::new(embedded("hoap2").unwrap());
    let start = bent(&robot, 0, 0.0);
    let fixture = fixture(&placed(&robot), &robot, start, |_| {});
    let mut driver = fixture.driver("closed-form", "");
    for seed in 1..=50 {
        let goal = bent(&robot, seed, 0.1);
        let mut x = targets_at(&fixture.problem, &goal);
        let (termination, _) = fixture.step(&mut driver, &fixture.start, &x, &[]);
        assert_eq!(termination, Termination::Converged);
        assert!(away(&driver.solution().q, &goal) < 1e-7);
        // 1 cm off.
        let hand = fixture.problem.slots()[3].x;
        x[hand + 1] += 0.01;
        let (termination, _) = fixture.step(&mut driver, &fixture.start, &x, &[]);
        assert!(
            matches!(termination, Termination::OutOfReach { missing_m } if missing_m > 1e-4 && missing_m < 0.05),
            "{termination:?}"
        );
        assert_eq!(driver.solution().q, fixture.start);
    }
}

/// Feet and hands, the waist in its place.
fn placed(robot: &Robot) -> Vec<(&'static str, Track)> {
    let mut tasks = balanced(robot);
    tasks[0] = ("waist", Track::Pose(frame(robot, "waist")));
    tasks.remove(1);
    tasks
}

/// Hubo on its feet, the waist in its place, within limits.
fn limited(limits: impl Fn(&Robot) -> Robot) -> Fixture {
    let robot = Arc::new(limits(&embedded("hubo").unwrap()));
    let start = bent(&robot, 0, 0.0);
    fixture(&placed(&robot)[..3], &robot, start, |parts| {
        parts.boundary = Boundary::Box
    })
}

fn all_limited(robot: &Robot, limits: Limits) -> Robot {
    let names = robot.coordinates().iter().map(|c| c.name.clone());
    names.fold(robot.clone(), |robot, name| {
        robot.with_limits(&name, limits).unwrap()
    })
}

#[test]
fn joints_stay_inside_their_intervals_and_the_one_outside_is_named() {
    let slow = Limits {
        lower: -3.0,
        upper: 3.0,
        velocity: 1.0,
        effort: 1.0,
    };
    let fixture = limited(|robot| all_limited(robot, slow));
    let robot = fixture.problem.robot();
    let mut driver = fixture.driver("closed-form", "");
    // The right foot 5 cm to the side at once: ten times what the joints can follow.
    let mut x = fixture.target.clone();
    x[fixture.problem.slots()[1].x + 1] -= 0.05;
    let (termination, _) = fixture.step(&mut driver, &fixture.start, &x, &[]);
    let Termination::OutsideLimits { joint, excess } = termination else {
        panic!("{termination:?}");
    };
    let greatest = driver.solution().v[6..]
        .iter()
        .map(|v| v.abs())
        .fold(0.0, f64::max);
    assert!(greatest <= 1.0 + 1e-9, "{greatest}");
    // Without limits the same joint moves by that much more.
    let fast = Limits {
        velocity: 1000.0,
        ..slow
    };
    let free = limited(|robot| all_limited(robot, fast));
    let mut free_driver = free.driver("closed-form", "");
    let (termination, _) = free.step(&mut free_driver, &free.start, &x, &[]);
    assert_eq!(termination, Termination::Converged);
    let speeds = free_driver.solution().v[6..].iter().map(|v| v.abs());
    let (expected, fastest) = speeds.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    assert_eq!(
        joint,
        expected,
        "{} is furthest outside",
        robot.coordinates()[joint].name
    );
    assert!(
        (excess - (fastest - 1.0) * DT_S).abs() < 1e-9,
        "{excess}, {fastest} rad/s without limits"
    );
}

#[test]
fn a_branch_outside_the_limits_is_left_for_one_inside() {
    // The start bends the knee forwards by 0.8 rad. Limits below that allow the other bend only.
    let robot = embedded("hubo").unwrap();
    let wide = Limits {
        lower: -3.1,
        upper: 3.1,
        velocity: 1000.0,
        effort: 1.0,
    };
    let bounds = |(lower, upper)| {
        let knee = Limits { lower, upper, ..wide };
        limited(move |robot| all_limited(robot, wide).with_limits("r_leg_4", knee).unwrap())
    };
    let knee = 7 + robot.coordinate("r_leg_4").unwrap();
    for (range, sign) in [((-2.0, 2.0), 1.0), ((-2.0, 0.79), -1.0)] {
        let fixture = bounds(range);
        let mut driver = fixture.driver("closed-form", "");
        // A foot that must come 2 mm nearer bends the knee beyond 0.8 rad.
        let mut x = fixture.target.clone();
        x[fixture.problem.slots()[1].x + 2] += 0.002;
        let (termination, _) = fixture.step(&mut driver, &fixture.start, &x, &[]);
        assert_eq!(termination, Termination::Converged, "{range:?}");
        let q = &driver.solution().q;
        assert!(q[knee] * sign > 0.5, "{range:?}: knee at {}", q[knee]);
        assert!(missed(&fixture.problem, &x, q) < 1e-9);
    }
}

#[test]
fn a_hard_foot_out_of_reach_stops_the_step_and_a_compromised_hand_does_not() {
    let robot = Arc::new(embedded("hubo").unwrap());
    let start = bent(&robot, 0, 0.0);
    let fixture = fixture(&placed(&robot), &robot, start, |parts| {
        parts.phases[0].tasks[3].1 = Priority::Compromised(Weights::Uniform(1.0));
    });
    let mut driver = fixture.driver("closed-form", "");
    let at = |task: usize| fixture.problem.slots()[task].x;
    // Straight down by 1 m: what is missing is the way less what the bent leg has left.
    let (foot, hand) = (at(1), at(3));
    let mut x = fixture.target.clone();
    x[foot + 2] -= 1.0;
    let (termination, _) = fixture.step(&mut driver, &fixture.start, &x, &[]);
    let left = 0.30003 + 0.30038 - (0.30003 + 0.30038) * 0.4_f64.cos();
    assert!(
        matches!(termination, Termination::OutOfReach { missing_m } if (missing_m - (1.0 - left)).abs() < 1e-3),
        "{termination:?}"
    );
    assert_eq!(driver.solution().q, fixture.start);
    let mut x = fixture.target.clone();
    x[hand] += 1.0;
    x[foot + 2] += 0.01;
    let (termination, _) = fixture.step(&mut driver, &fixture.start, &x, &[]);
    assert!(
        matches!(termination, Termination::OutOfReach { missing_m } if missing_m > 0.3),
        "{termination:?}"
    );
    let q = &driver.solution().q;
    let reached = targets_at(&fixture.problem, q);
    assert!(away(&reached[foot..foot + 3], &x[foot..foot + 3]) < 1e-12);
    let arm = 7 + robot.coordinate("r_arm_1").unwrap();
    assert_eq!(q[arm..arm + 6], fixture.start[arm..arm + 6]);
}

#[test]
fn a_centre_of_mass_out_of_reach_is_approached_to_straight_legs() {
    let robot = Arc::new(embedded("hubo").unwrap());
    let start = bent(&robot, 0, 0.0);
    let fixture = fixture(&balanced(&robot)[..4], &robot, start, |_| {});
    let mut driver = fixture.driver("closed-form", "");
    let mut x = fixture.target.clone();
    x[2] += 1.0;
    let mut q = fixture.start.clone();
    for _ in 0..5 {
        let (termination, _) = fixture.step(&mut driver, &q, &x, &[]);
        assert!(
            matches!(termination, Termination::OutOfReach { .. } | Termination::Budget),
            "{termination:?}"
        );
        q.clone_from(&driver.solution().q);
    }
    let robot = fixture.problem.robot();
    for side in ["r", "l"] {
        let knee = q[7 + robot.coordinate(&format!("{side}_leg_4")).unwrap()];
        assert!(knee.abs() < 1e-4, "{knee}");
    }
    let found = targets_at(&fixture.problem, &q);
    let feet = fixture.problem.slots()[2].x;
    assert!(away(&found[feet..], &x[feet..]) < 1e-9, "the soles stay");
    assert!(found[2] > fixture.target[2] + 0.02);
}

fn declined(problem: &Arc<Problem>) -> String {
    let contestant = method("closed-form").unwrap().build(&toml::Table::new()).unwrap();
    match Driver::new(&*contestant.formulation, problem).unwrap_err() {
        Declined::Shape(reason) => reason,
        other => panic!("{other:?}"),
    }
}

/// A task of a robot that is made later.
type Named = (&'static str, fn(&Robot) -> Track);

#[test]
fn what_a_closed_form_cannot_do_is_declined_with_the_task_and_the_reason() {
    let reason = |id: &str, tasks: &[Named]| {
        let robot = Arc::new(embedded(id).unwrap());
        let tasks: Vec<_> = tasks.iter().map(|(name, track)| (*name, track(&robot))).collect();
        let parts = parts(&robot, &tasks, OrientationCoordinates::Log);
        declined(&Arc::new(Problem::new(parts).unwrap()))
    };
    let waist: Named = ("waist", |r| Track::Pose(frame(r, "waist")));
    let turn: Named = ("turn", |r| Track::Orientation(frame(r, "waist")));
    let foot: Named = ("foot", |r| Track::Pose(frame(r, "r_sole")));
    let com: Named = ("com", |_| Track::CentreOfMass);
    let cases: [(&str, &[Named], &[&str]); 12] = [
        ("hubo", &[foot, com], &["orientation task", "`waist`"]),
        ("hubo", &[foot, turn], &["neither", "centre of mass", "`waist`"]),
        ("hubo", &[foot, waist, com], &["`waist`", "both"]),
        (
            "hubo",
            &[foot, turn, com, ("again", |_| Track::CentreOfMass)],
            &["`again`", "second"],
        ),
        (
            "hubo",
            &[waist, ("rest", |_| Track::Posture)],
            &["`rest`", "joints"],
        ),
        (
            "hubo",
            &[waist, ("knee", |r| Track::Pose(frame(r, "r_shank")))],
            &["`knee`", "`r_shank`", "no limb"],
        ),
        (
            "hubo",
            &[waist, foot, ("again", |r| Track::Position(frame(r, "r_foot")))],
            &["`foot`", "`again`", "`r_foot_body`"],
        ),
        (
            "hubo",
            &[waist, ("turn", |r| Track::Orientation(frame(r, "r_sole")))],
            &["`turn`", "orientation alone"],
        ),
        (
            "hubo",
            &[waist, ("point", |r| Track::Position(frame(r, "r_sole")))],
            &["`point`", "three"],
        ),
        (
            "hoap2",
            &[turn, com, ("hand", |r| Track::Pose(frame(r, "r_hand")))],
            &["`r_forearm`", "four joints"],
        ),
        (
            "arm7",
            &[("tip", |r| {
                Track::Pose(ik_core::robot::FrameId(r.frames().len() - 1))
            })],
            &["`tip`", "more than six"],
        ),
        ("arm6", &[com], &["`base`", "fixed"]),
    ];
    for (id, tasks, words) in cases {
        let reason = reason(id, tasks);
        for word in words {
            assert!(reason.contains(word), "{id} {tasks:?}: {reason}");
        }
    }
}

#[test]
fn a_fixed_arm_is_solved_from_its_base() {
    let robot = Arc::new(embedded("arm6").unwrap());
    let tip = ik_core::robot::FrameId(robot.frames().len() - 1);
    let start = vec![0.3, 0.5, -0.7, 0.4, 0.9, -0.2];
    let fixture = fixture(&[("tip", Track::Pose(tip))], &robot, start.clone(), |_| {});
    let mut driver = fixture.driver("closed-form", "");
    for seed in 1..=100 {
        let goal: Vec<f64> = start
            .iter()
            .zip(numbers(seed, 6))
            .map(|(q, x)| q + 0.2 * x)
            .collect();
        let x = targets_at(&fixture.problem, &goal);
        let (termination, _) = fixture.step(&mut driver, &start, &x, &[]);
        assert_eq!(termination, Termination::Converged);
        assert!(away(&driver.solution().q, &goal) < 1e-8, "{seed}");
    }
}

#[test]
fn three_joints_place_a_point() {
    let robot = Arc::new(embedded("bioloid").unwrap());
    let tasks = [
        ("waist", Track::Pose(frame(&robot, "waist"))),
        ("hand", Track::Position(frame(&robot, "r_hand"))),
    ];
    let mut start = robot.neutral();
    let first = 7 + robot
        .coordinates()
        .iter()
        .position(|c| c.name.starts_with("r_") && c.name.contains("shoulder"))
        .unwrap();
    start[first..first + 3].copy_from_slice(&[-0.35, -0.64, 1.57]);
    let fixture = fixture(&tasks, &robot, start.clone(), |_| {});
    let mut driver = fixture.driver("closed-form", "");
    for seed in 1..=200 {
        let mut goal = start.clone();
        for (q, x) in goal[first..first + 3].iter_mut().zip(numbers(seed, 3)) {
            *q += 0.5 * x;
        }
        let x = targets_at(&fixture.problem, &goal);
        let (termination, _) = fixture.step(&mut driver, &start, &x, &[]);
        assert_eq!(termination, Termination::Converged);
        assert!(
            missed(&fixture.problem, &x, &driver.solution().q) < 1e-11,
            "{seed}"
        );
    }
}

/// Hubo with its right shoulder 0.1 rad outside its limits.
fn with_a_shoulder_outside() -> (Arc<Robot>, usize) {
    let wide = Limits {
        lower: -3.1,
        upper: 3.1,
        velocity: 100.0,
        effort: 1.0,
    };
    let robot = all_limited(&embedded("hubo").unwrap(), wide);
    let shoulder = robot.coordinate("r_arm_2").unwrap();
    let lower = bent(&robot, 0, 0.0)[7 + shoulder] + 0.1;
    let robot = robot.with_limits("r_arm_2", Limits { lower, ..wide }).unwrap();
    (Arc::new(robot), 7 + shoulder)
}

#[test]
fn the_centre_of_mass_is_met_while_an_idle_joint_returns_to_its_limits() {
    let (robot, shoulder) = with_a_shoulder_outside();
    let start = bent(&robot, 0, 0.0);
    let fixture = fixture(&balanced(&robot)[..4], &robot, start, |parts| {
        parts.boundary = Boundary::Box;
    });
    let mut driver = fixture.driver("closed-form", "");
    let mut x = fixture.target.clone();
    x[0] += 0.005;
    let (termination, _) = fixture.step(&mut driver, &fixture.start, &x, &[]);
    assert_eq!(termination, Termination::Converged);
    let q = &driver.solution().q;
    assert!((q[shoulder] - fixture.start[shoulder] - 0.1).abs() < 1e-12);
    assert!(missed(&fixture.problem, &x, q) < 1e-9);
}

#[test]
fn joints_return_to_their_limits_also_where_a_hard_hand_is_out_of_reach() {
    let (robot, shoulder) = with_a_shoulder_outside();
    let start = bent(&robot, 0, 0.0);
    let fixture = fixture(&placed(&robot), &robot, start, |parts| {
        parts.boundary = Boundary::Box;
    });
    let mut driver = fixture.driver("closed-form", "");
    assert!(driver.honours().boundary);
    let mut x = fixture.target.clone();
    x[fixture.problem.slots()[4].x] += 1.0;
    let (termination, _) = fixture.step(&mut driver, &fixture.start, &x, &[]);
    assert!(
        matches!(termination, Termination::OutOfReach { .. }),
        "{termination:?}"
    );
    let q = &driver.solution().q;
    assert!((q[shoulder] - fixture.start[shoulder] - 0.1).abs() < 1e-12);
}

#[test]
fn an_orientation_target_that_is_no_rotation_is_refused_as_such() {
    let robot = Arc::new(embedded("hubo").unwrap());
    let start = bent(&robot, 0, 0.0);
    let fixture = fixture(&balanced(&robot), &robot, start, |_| {});
    let mut driver = fixture.driver("closed-form", "");
    for turn in [1, 2, 5] {
        let slot = fixture.problem.slots()[turn].x + if turn == 1 { 0 } else { 3 };
        for w in [0.0, 1e-200, 1e200] {
            let mut x = fixture.target.clone();
            x[slot..slot + 4].copy_from_slice(&[0.0, 0.0, 0.0, w]);
            let (termination, _) = fixture.step(&mut driver, &fixture.start, &x, &[]);
            assert!(
                matches!(termination, Termination::Numerical(_)),
                "{turn} {w:e}: {termination:?}"
            );
            assert_eq!(driver.solution().q, fixture.start);
        }
    }
}

/// Right leg of Hubo with S2 = 0: θ1 and θ3 turn about one axis.
#[test]
fn a_free_joint_gives_way_where_its_partner_meets_a_limit() {
    let limits = Limits {
        lower: -3.1,
        upper: 3.1,
        velocity: 6.0,
        effort: 1.0,
    };
    let robot = Arc::new(all_limited(&embedded("hubo").unwrap(), limits));
    let joint = |name: &str| 7 + robot.coordinate(name).unwrap();
    let mut start = bent(&robot, 0, 0.0);
    let singular = [0.3, 0.0, -0.5, 0.8, 0.2, 0.1];
    start[joint("r_leg_1")..=joint("r_leg_6")].copy_from_slice(&singular);
    let fixture = fixture(&placed(&robot)[..2], &robot, start.clone(), |parts| {
        parts.boundary = Boundary::Box;
    });
    let mut driver = fixture.driver("closed-form", "");
    // 0.1 rad about the common axis: each of the two may turn by 0.06.
    for sign in [1.0, -1.0] {
        let mut goal = start.clone();
        goal[joint("r_leg_1")] += 0.05 * sign;
        goal[joint("r_leg_3")] += 0.05 * sign;
        let x = targets_at(&fixture.problem, &goal);
        let (termination, _) = fixture.step(&mut driver, &start, &x, &[]);
        assert_eq!(termination, Termination::Converged);
        assert!(missed(&fixture.problem, &x, &driver.solution().q) < 1e-12);
    }
}

#[test]
fn what_is_met_already_is_left_only_for_the_intervals() {
    let tight = Limits {
        lower: -3.1,
        upper: 0.7,
        velocity: 1000.0,
        effort: 1.0,
    };
    // The knee is bent by 0.8 rad: the targets are met and the interval is not.
    let fixture = limited(|robot| robot.with_limits("r_leg_4", tight).unwrap());
    let knee = 7 + fixture.problem.robot().coordinate("r_leg_4").unwrap();
    let mut driver = fixture.driver("closed-form", "");
    fixture.step(&mut driver, &fixture.start, &fixture.target, &[]);
    assert!(driver.solution().q[knee] <= 0.7, "{}", driver.solution().q[knee]);
}

#[test]
fn the_quaternion_of_the_root_stays_on_its_side() {
    let robot = Arc::new(embedded("hubo").unwrap());
    let start = bent(&robot, 0, 0.0);
    let fixture = fixture(&placed(&robot)[..2], &robot, start.clone(), |_| {});
    let mut driver = fixture.driver("closed-form", "");
    let goal = bent(&robot, 1, 0.05);
    let mut x = targets_at(&fixture.problem, &goal);
    let waist = fixture.problem.slots()[0].x + 3;
    for _ in 0..2 {
        let (termination, _) = fixture.step(&mut driver, &start, &x, &[]);
        assert_eq!(termination, Termination::Converged);
        let q = &driver.solution().q;
        let along: f64 = q[3..7].iter().zip(&start[3..7]).map(|(a, b)| a * b).sum();
        assert!(along > 0.9, "{along}");
        x[waist..waist + 4].iter_mut().for_each(|c| *c = -*c);
    }
}

/// The outer iteration is a local search. Of targets made by postures within ±0.6 rad of standing it finds nearly all from starts
/// off by up to 0.1 rad per joint, within limits of ±0.6 rad or without.
#[test]
fn targets_within_reach_are_rarely_lost() {
    for (id, limited, least) in [
        ("hubo", false, 199),
        ("hrp2", false, 197),
        ("asimo", false, 199),
        ("hubo", true, 194),
        ("hrp2", true, 188),
        ("asimo", true, 196),
    ] {
        let mut robot = embedded(id).unwrap();
        let middle = bent(&robot, 0, 0.0);
        for c in 0..robot.coordinates().len() {
            let name = robot.coordinates()[c].name.clone();
            let limits = Limits {
                lower: middle[7 + c] - 0.6,
                upper: middle[7 + c] + 0.6,
                velocity: 1000.0,
                effort: 1.0,
            };
            robot = robot.with_limits(&name, limits).unwrap();
        }
        let robot = Arc::new(robot);
        let fixture = fixture(&balanced(&robot), &robot, middle.clone(), |parts| {
            parts.boundary = if limited {
                Boundary::Positions
            } else {
                Boundary::None
            };
        });
        let mut driver = fixture.driver("closed-form", "");
        let mut solved = 0;
        for seed in 1..=200 {
            let goal = bent(&robot, seed, 0.59);
            let off: Vec<f64> = numbers(seed + 1000, robot.nv()).iter().map(|x| 0.1 * x).collect();
            let mut start = integrate(&robot, &goal, &off);
            for (q, middle) in start[7..].iter_mut().zip(&middle[7..]) {
                *q = q.clamp(middle - 0.6, middle + 0.6);
            }
            let x = targets_at(&fixture.problem, &goal);
            let (termination, _) = fixture.step(&mut driver, &start, &x, &[]);
            if termination == Termination::Converged {
                assert!(missed(&fixture.problem, &x, &driver.solution().q) < 1e-8);
                solved += 1;
            }
        }
        assert!(solved >= least, "{id}, limited {limited}: {solved} of 200");
    }
}
