//! Quality numbers of runs whose numbers are known beforehand.

use super::*;
use crate::records::Quality;
use crate::referee::Run;
use ik_core::problem::PhaseId;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3};

const ONLY: [PhaseId; 1] = [PhaseId(0)];

/// Samples that stand still at `x`.
fn constant(problem: &Problem, x: &[f64], samples: usize) -> Vec<f64> {
    assert_eq!(x.len(), problem.nx());
    let one: Vec<f64> = x.iter().copied().chain(vec![0.0; problem.nxdot()]).collect();
    one.repeat(samples)
}

fn judge_at_rest(problem: &Arc<Problem>, x: &[f64], q: &[Vec<f64>], dt_s: f64) -> Quality {
    let targets = constant(problem, x, q.len());
    referee(problem).judge(&Run {
        dt_s,
        q,
        targets: &targets,
        phases: &ONLY,
        support: &[],
        walk: None,
    })
}

fn with_limits(robot: &Robot, name: &str, lower: f64, upper: f64, velocity: f64) -> Robot {
    robot
        .with_limits(
            name,
            Limits {
                lower,
                upper,
                velocity,
                ..Limits::UNLIMITED
            },
        )
        .unwrap()
}

fn close(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-12 * expected.abs().max(1.0),
        "{found} instead of {expected}"
    );
}

#[test]
fn errors_of_the_centre_of_mass() {
    let problem = problem(
        slides(),
        vec![("com", Track::CentreOfMass, soft())],
        Boundary::None,
    );
    let q = [vec![0.0, 0.0], vec![3.0, 4.0], vec![3.0, 4.0]];
    let mut targets = constant(&problem, &[0.0, 0.0, 0.0], 3);
    // The target rate at k = 1 is what the centre of mass does, at k = 2 it is not.
    targets[9..12].copy_from_slice(&[6.0, 8.0, 0.0]);
    targets[15..18].copy_from_slice(&[0.0, 0.0, 2.0]);
    let quality = referee(&problem).judge(&Run {
        dt_s: 0.5,
        q: &q,
        targets: &targets,
        phases: &ONLY,
        support: &[],
        walk: None,
    });
    close(quality.com_error_rms_m.unwrap(), (50.0_f64 / 3.0).sqrt());
    assert_eq!(quality.com_error_max_m, Some(5.0));
    assert_eq!(quality.soft_error_rms["com"], quality.com_error_rms_m.unwrap());
    assert_eq!(quality.soft_error_rms_m, quality.com_error_rms_m);
    assert_eq!(
        (quality.soft_error_max_m, quality.soft_error_max["com"]),
        (Some(5.0), 5.0)
    );
    close(quality.com_rate_error_rms_m_s.unwrap(), 2.0_f64.sqrt());
    assert_eq!((quality.hard_error_max_m, quality.hard_error_max.len()), (0.0, 0));
    assert!(!quality.survived, "5 m is above the tolerance");
    assert_eq!(quality.boundary_value_max, None);
}

#[test]
fn no_centre_of_mass_task_means_no_such_numbers() {
    let robot = two_links();
    let tip = frame(&robot, "tip");
    let problem = problem(
        robot,
        vec![("tip", Track::Position(tip), Priority::Hard)],
        Boundary::None,
    );
    let quality = judge_at_rest(&problem, &[2.0, 0.0, 0.0], &[vec![0.0, 0.0]], 0.1);
    assert_eq!(
        (quality.com_error_rms_m, quality.com_rate_error_rms_m_s),
        (None, None)
    );
    assert!(quality.survived);
    assert_eq!((quality.soft_error_rms_m, quality.soft_error_max_m), (None, None));
}

#[test]
fn hard_errors_are_components_and_angles_whatever_the_coordinates() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let cases = [
        (OrientationCoordinates::RollPitchYaw, vec![0.0, 0.0, FRAC_PI_2]),
        (OrientationCoordinates::Log, vec![0.0, 0.0, half, half]),
        (OrientationCoordinates::Log, vec![0.0, 0.0, -half, -half]),
    ];
    for (orientation, attitude) in cases {
        let robot = two_links();
        let tasks = vec![("tip", Track::Pose(frame(&robot, "tip")), Priority::Hard)];
        let parts = ProblemParts {
            orientation,
            ..parts(robot, tasks, Boundary::None)
        };
        let problem = Arc::new(Problem::new(parts).unwrap());
        // Elbow at π/3: the tip stands at (1.5, √3/2) and looks along π/3, wanted is π/2.
        let x = [&[1.0, 0.0, 0.25][..], &attitude].concat();
        let quality = judge_at_rest(&problem, &x, &[vec![0.0, FRAC_PI_3]], 0.1);
        close(quality.hard_error_max_m, 0.75_f64.sqrt());
        close(quality.hard_error_max_rad, FRAC_PI_2 - FRAC_PI_3);
        close(quality.hard_error_max["tip_m"], 0.75_f64.sqrt());
        close(quality.hard_error_max["tip_rad"], FRAC_PI_2 - FRAC_PI_3);
        assert!(!quality.survived);
    }
}

#[test]
fn rpy_targets_turn_about_fixed_x_then_y_then_z() {
    let robot = embedded("coman-legs").unwrap();
    let tasks = vec![(
        "torso",
        Track::Orientation(frame(&robot, "Waist")),
        Priority::Hard,
    )];
    let mut q = robot.neutral();
    let problem = problem(robot, tasks, Boundary::None);
    let (roll, pitch, yaw) = (0.3, -0.7, 1.9);
    let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    q[3..7].copy_from_slice(turn.coords.as_slice());
    let hit = judge_at_rest(&problem, &[roll, pitch, yaw], std::slice::from_ref(&q), 0.1);
    assert!(hit.hard_error_max_rad < 1e-15);
    // A yaw error is a rotation about the world's z axis: its angle is the error itself, a roll error's too.
    for x in [[roll, pitch, yaw + 0.01], [roll + 0.01, pitch, yaw]] {
        close(
            judge_at_rest(&problem, &x, std::slice::from_ref(&q), 0.1).hard_error_max_rad,
            0.01,
        );
    }
}

#[test]
fn compromised_tasks_by_name() {
    let robot = two_links();
    let tip = frame(&robot, "tip");
    let tasks = vec![
        ("tool", Track::Pose(tip), soft()),
        ("rest", Track::Posture, soft()),
    ];
    let problem = problem(robot, tasks, Boundary::None);
    let x = [2.0, 0.0, 0.5, 0.0, 0.0, 0.25, 0.0, 0.125];
    let quality = judge_at_rest(&problem, &x, &[vec![0.0, 0.0]], 0.1);
    let names: Vec<_> = quality.soft_error_rms.keys().map(String::as_str).collect();
    assert_eq!(names, ["rest", "tool_m", "tool_rad"]);
    close(quality.soft_error_rms["tool_m"], 0.5);
    close(quality.soft_error_rms["tool_rad"], 0.25);
    close(quality.soft_error_rms["rest"], 0.125);
    assert!(quality.soft_error_max.keys().eq(quality.soft_error_rms.keys()));
    close(quality.soft_error_max["tool_rad"], 0.25);
    assert_eq!(
        (quality.soft_error_rms_m, quality.soft_error_max_m),
        (Some(0.5), Some(0.5)),
        "angles do not count"
    );
}

#[test]
fn the_compromised_point_that_is_missed_most_decides_survival() {
    let robot = slides();
    let (base, tip) = (frame(&robot, "base"), frame(&robot, "tip"));
    let tasks = vec![
        ("near", Track::Position(base), soft()),
        ("hand", Track::Pose(tip), soft()),
        ("turned", Track::Orientation(base), soft()),
    ];
    let problem = problem(robot, tasks, Boundary::None);
    // Off by 3 cm at all samples; off by 0 and then by `reach` in z and y; 2 rad off, which is no distance.
    let x = [0.03, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0];
    let judged = |reach: f64| {
        let q = [vec![0.0, 0.0], vec![0.8 * reach, 0.6 * reach]];
        judge_at_rest(&problem, &x, &q, 0.5)
    };
    let sound = judged(0.0799);
    assert!(sound.survived && !judged(0.0801).survived);
    close(sound.soft_error_max["hand_m"], 0.0799);
    close(sound.soft_error_max["near"], 0.03);
    close(sound.soft_error_max["turned"], 2.0);
    close(sound.soft_error_max_m.unwrap(), 0.0799);
    close(sound.soft_error_rms_m.unwrap(), 0.0799 * 0.5_f64.sqrt());
    close(judged(0.04).soft_error_rms_m.unwrap(), 0.03);
    assert_eq!(sound.com_error_max_m, None);
}

#[test]
fn tasks_count_in_the_phases_they_belong_to() {
    let robot = slides();
    let tip = frame(&robot, "tip");
    let tasks = vec![
        ("com", Track::CentreOfMass, soft()),
        ("tip", Track::Position(tip), Priority::Hard),
    ];
    let mut parts = parts(robot, tasks, Boundary::None);
    let phase = |name: &str, tasks| Phase {
        name: name.to_owned(),
        support: None,
        tasks,
    };
    parts.phases = vec![
        phase("first", vec![(0, soft()), (1, Priority::Hard)]),
        phase("second", vec![(0, Priority::Hard), (1, soft())]),
    ];
    let problem = Arc::new(Problem::new(parts).unwrap());
    // Off by 1, 2 and 4; k = 0 belongs to the phase of k = 1.
    let q = [vec![1.0, 0.0], vec![2.0, 0.0], vec![4.0, 0.0]];
    let targets = constant(&problem, &[0.0; 6], 3);
    let phases = [PhaseId(0), PhaseId(1)];
    let quality = referee(&problem).judge(&Run {
        dt_s: 1.0,
        q: &q,
        targets: &targets,
        phases: &phases,
        support: &[],
        walk: None,
    });
    assert_eq!(
        (quality.hard_error_max["tip_m"], quality.hard_error_max["com_m"]),
        (2.0, 4.0)
    );
    close(quality.soft_error_rms["com"], 2.5_f64.sqrt());
    assert_eq!(quality.soft_error_rms["tip"], 4.0);
    assert_eq!(quality.com_error_max_m, Some(4.0));
    close(quality.com_error_rms_m.unwrap(), 7.0_f64.sqrt());
}

#[test]
fn velocity_and_acceleration_of_a_parabola() {
    let robot = with_limits(&slides(), "to_beam", -100.0, 100.0, 8.0);
    let problem = problem(robot, vec![("com", Track::CentreOfMass, soft())], Boundary::None);
    let dt_s = 0.25;
    let q: Vec<Vec<f64>> = (0..9)
        .map(|k| f64::from(k) * dt_s)
        .map(|t| vec![-1.5 * t * t, 0.5])
        .collect();
    let quality = judge_at_rest(&problem, &[0.0; 3], &q, dt_s);
    assert_eq!(quality.acceleration_max_rad_s2, 3.0);
    // Mean speed of the last step, from 1.75 s to 2 s: 1.5 (2² − 1.75²) / 0.25.
    assert_eq!(quality.velocity_max_rad_s, 5.625);
    assert_eq!(quality.velocity_ratio_max, 5.625 / 8.0);
}

#[test]
fn acceleration_needs_three_samples_and_assumes_no_rest_before_the_start() {
    let problem = problem(
        slides(),
        vec![("com", Track::CentreOfMass, soft())],
        Boundary::None,
    );
    let quality = judge_at_rest(&problem, &[0.0; 3], &[vec![0.0, 0.0], vec![1.0, 0.0]], 0.5);
    assert_eq!(
        (quality.velocity_max_rad_s, quality.acceleration_max_rad_s2),
        (2.0, 0.0)
    );
}

#[test]
fn limits_and_boundaries() {
    let com = || vec![("com", Track::CentreOfMass, soft())];
    let robot = with_limits(&slides(), "to_beam", 0.0, 2.0, 4.0);
    let q = [vec![2.5, 9.0], vec![2.0, 9.0], vec![1.0, 9.0]];
    let judged = |boundary| judge_at_rest(&problem(robot.clone(), com(), boundary), &[0.0; 3], &q, 0.5);
    // k = 0 counts for the position limit, not for eq. (6): there (2, −1 rad/s) gives 1 + 1/16 − 1.
    let quality = judged(Boundary::Box);
    assert_eq!(quality.position_limit_violation_max_rad, 0.5);
    assert_eq!(quality.boundary_value_max, Some(0.0625));
    assert_eq!(quality.polygon_excess_max_rad, None);
    // With the margin the half range is 0.5: (1/0.5)² + 1/16 − 1.
    assert_eq!(
        judged(Boundary::Ellipse { margin: 0.5 }).boundary_value_max,
        Some(3.0625)
    );
    assert_eq!(judged(Boundary::Positions).boundary_value_max, None);
    // At q = 1 the way down is free up to 1 s⁻¹ · 1 m = 1 m/s; the step went at 2 m/s for 0.5 s.
    let polygon = judged(Boundary::Polygon {
        approach_per_s: 1.0,
        exit_speed: 0.125,
    });
    assert_eq!(
        (polygon.boundary_value_max, polygon.polygon_excess_max_rad),
        (Some(0.0625), Some(0.5))
    );
}

/// Polygon and box reach outside the ellipse: a run inside its own boundary survives with a positive value of eq. (6).
#[test]
fn a_run_survives_the_boundary_it_was_given() {
    let survives = |boundary: Boundary, excess: f64, ratio: f64, g: f64| {
        let quality = Quality {
            polygon_excess_max_rad: Some(excess),
            velocity_ratio_max: ratio,
            boundary_value_max: Some(g),
            ..Quality::default()
        };
        super::super::judge::survives(&quality, &boundary, 0.08)
    };
    let polygon = Boundary::Polygon {
        approach_per_s: 8.0,
        exit_speed: 0.02,
    };
    assert!(survives(polygon, 0.0, 2.0, 0.3) && !survives(polygon, 1e-3, 0.5, -0.3));
    assert!(survives(Boundary::Box, 1.0, 1.0, 0.3) && !survives(Boundary::Box, 0.0, 1.1, -0.3));
    let ellipse = Boundary::Ellipse { margin: 0.0 };
    assert!(survives(ellipse, 1.0, 2.0, -0.3) && !survives(ellipse, 0.0, 0.5, 0.3));
}

#[test]
fn a_joint_without_limits_has_no_boundary_value() {
    let problem = problem(
        slides(),
        vec![("com", Track::CentreOfMass, soft())],
        Boundary::Box,
    );
    let quality = judge_at_rest(&problem, &[0.0; 3], &[vec![0.0, 0.0], vec![0.0, 0.0]], 0.5);
    assert_eq!(quality.boundary_value_max, None);
    assert!(quality.survived);
}

/// A run of 3 s at 0.5 s per sample with these angles of the first joint, the second being wide open.
fn exit_of(knee: [f64; 7]) -> Option<f64> {
    let problem = problem(
        two_links(),
        vec![("rest", Track::Posture, soft())],
        Boundary::None,
    );
    let exit_joints = vec!["to_upper".to_owned(), "to_lower".to_owned()];
    let referee = Referee::new(
        &problem,
        JudgeSpec {
            exit_joints,
            ..plain_spec()
        },
    )
    .unwrap();
    let q: Vec<_> = knee.iter().map(|&angle| vec![angle, 1.0]).collect();
    let targets = constant(&problem, &[0.0, 0.0], q.len());
    referee
        .judge(&Run {
            dt_s: 0.5,
            q: &q,
            targets: &targets,
            phases: &ONLY,
            support: &[],
            walk: None,
        })
        .singularity_exit_s
}

#[test]
fn the_exit_is_the_sample_after_the_last_straight_one() {
    assert_eq!(exit_of([1.0, 1.0, 1.0, 0.01, 0.06, 1.0, 1.0]), Some(2.0));
    assert_eq!(exit_of([1.0, 1.0, 1.0, 0.01, 0.06, -0.2, 1.0]), Some(3.0));
    assert_eq!(exit_of([1.0; 7]), None, "never straight");
    assert_eq!(
        exit_of([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]),
        None,
        "straight until t = 1 s only"
    );
    assert_eq!(
        exit_of([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
        None,
        "never out again"
    );
    let problem = problem(
        two_links(),
        vec![("rest", Track::Posture, soft())],
        Boundary::None,
    );
    let q = vec![vec![0.0, 0.0]; 7];
    assert_eq!(
        judge_at_rest(&problem, &[0.0, 0.0], &q, 0.5).singularity_exit_s,
        None,
        "not asked for"
    );
}

#[test]
fn torques_are_averaged_from_one_second_on() {
    let robot = embedded("pendulum").unwrap();
    let (mass, length) = (robot.bodies()[1].mass_kg, robot.bodies()[1].com.norm());
    let tip = frame(&robot, "tip");
    let problem = problem(robot, vec![("rest", Track::Posture, soft())], Boundary::None);
    let q: Vec<_> = [1.5, 1.5, FRAC_PI_2, 0.0].map(|angle| vec![angle]).to_vec();
    let targets = constant(&problem, &[0.0], 4);
    let run = Run {
        dt_s: 0.5,
        q: &q,
        targets: &targets,
        phases: &ONLY,
        support: &[],
        walk: None,
    };
    let asked = Referee::new(
        &problem,
        JudgeSpec {
            torque_supports: vec![tip],
            ..plain_spec()
        },
    )
    .unwrap();
    let largest = mass * 9.806_65 * length;
    close(
        asked.judge(&run).torque_squared_mean_n2m2.unwrap(),
        0.5 * largest * largest,
    );
    assert_eq!(referee(&problem).judge(&run).torque_squared_mean_n2m2, None);
    let short = Run { q: &q[..2], ..run };
    assert_eq!(
        asked.judge(&short).torque_squared_mean_n2m2,
        None,
        "nothing after 1 s"
    );
}

#[test]
fn singular_values_and_ranks() {
    let robot = two_links();
    let tip = frame(&robot, "tip");
    let problem = problem(
        robot,
        vec![("tip", Track::Position(tip), Priority::Hard)],
        Boundary::None,
    );
    let judged = |elbow: f64| judge_at_rest(&problem, &[0.0; 3], &[vec![0.3, 1.0], vec![0.3, elbow]], 0.1);
    // J Jᵀ has trace 3 + 2 cos(elbow) and the determinant sin²(elbow).
    let sigma = |elbow: f64| {
        let (trace, determinant) = (3.0 + 2.0 * elbow.cos(), elbow.sin().powi(2));
        (0.5 * (trace - (trace * trace - 4.0 * determinant).sqrt())).sqrt()
    };
    close(judged(FRAC_PI_2).sigma_min, sigma(1.0).min(sigma(FRAC_PI_2)));
    close(judged(0.2).sigma_min, sigma(0.2));
    assert_eq!(judged(0.2).hard_rank_min, 2);
    let straight = judged(0.0);
    assert!(straight.sigma_min < 1e-15);
    assert_eq!(straight.hard_rank_min, 1);
}

/// Soles flat on the ground below a level pelvis, both knees at `knee`.
fn standing(robot: &Robot, knee: f64) -> Vec<f64> {
    let mut q = robot.neutral();
    for (name, part) in [("HipSag", -0.5), ("KneeSag", 1.0), ("AnkSag", -0.5)] {
        for side in ["L", "R"] {
            q[7 + robot.coordinate(&format!("{side}{name}")).unwrap()] = part * knee;
        }
    }
    q
}

#[test]
fn two_straight_parallel_legs_lose_one_hard_row() {
    let problem = shoot_out(Boundary::Positions);
    let judged = |knee| judge_at_rest(&problem, &[0.0; 18], &[standing(problem.robot(), knee)], 0.005);
    assert_eq!((judged(0.6).hard_rank_min, judged(0.0).hard_rank_min), (15, 14));
    assert!(judged(0.6).sigma_min > 1e-3 && judged(0.0).sigma_min < 1e-12);
}

#[test]
fn without_hard_tasks_the_hard_rank_is_zero() {
    let problem = problem(
        two_links(),
        vec![("com", Track::CentreOfMass, soft())],
        Boundary::None,
    );
    assert_eq!(
        judge_at_rest(&problem, &[0.0; 3], &[vec![0.0, 0.0]], 0.1).hard_rank_min,
        0
    );
}

#[test]
fn each_condition_of_survival_can_fail_alone() {
    let robot = with_limits(&slides(), "to_beam", 0.0, 2.0, 4.0);
    let tip = frame(&robot, "tip");
    let tasks = vec![
        ("com", Track::CentreOfMass, soft()),
        ("tip", Track::Position(tip), Priority::Hard),
    ];
    let ellipse = problem(robot.clone(), tasks.clone(), Boundary::Ellipse { margin: 0.0 });
    let survives = |problem, x: [f64; 6], to: f64| {
        judge_at_rest(problem, &x, &[vec![1.0, 0.0], vec![to, 0.0]], 0.5).survived
    };
    let at = |com: f64, tip: f64| [com, 0.0, 0.0, tip, 0.0, 0.0];
    assert!(survives(&ellipse, at(1.0, 1.0), 1.0));
    assert!(survives(&ellipse, at(1.079, 1.0009), 1.0));
    assert!(!survives(&ellipse, at(1.081, 1.0), 1.0), "centre of mass");
    assert!(!survives(&ellipse, at(1.0, 1.0011), 1.0), "hard row");
    let loose = |boundary| problem(robot.clone(), vec![("rest", Track::Posture, soft())], boundary);
    let moved = |boundary, to| {
        judge_at_rest(&loose(boundary), &[0.0; 2], &[vec![1.0, 0.0], vec![to, 0.0]], 0.5).survived
    };
    assert!(
        moved(Boundary::Positions, 2.0 + 5e-7) && !moved(Boundary::Positions, 2.0 + 2e-6),
        "position limit"
    );
    let margin = Boundary::Ellipse { margin: 0.5 };
    // (u / 0.5)² + (2u / 4)² ≤ 1 holds up to u = 4.25^(-1/2) = 0.48507.
    assert!(moved(margin, 1.485) && !moved(margin, 1.4852), "eq. (6)");
    let attitude = vec![("tip", Track::Orientation(tip), Priority::Hard)];
    let turned = problem(robot, attitude, Boundary::None);
    let hard = |angle| judge_at_rest(&turned, &[0.0, angle, 0.0], &[vec![1.0, 0.0]], 0.5).survived;
    assert!(hard(9e-4) && !hard(1.1e-3), "hard angle");
}

/// A run on `slides` with one number of one sample replaced.
fn spoilt(value: f64) -> Quality {
    let problem = problem(
        slides(),
        vec![("com", Track::CentreOfMass, soft())],
        Boundary::Box,
    );
    let mut q: Vec<Vec<f64>> = (0..6).map(|k| vec![0.001 * f64::from(k * k), 0.0]).collect();
    q[4][1] = value;
    judge_at_rest(&problem, &[0.0; 3], &q, 0.1)
}

#[test]
fn what_cannot_be_read_ends_the_run_and_leaves_finite_numbers() {
    let sound = spoilt(0.0);
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -2e9] {
        let quality = spoilt(value);
        assert!(!quality.survived);
        let text = serde_json::to_string(&quality).unwrap();
        assert_eq!(serde_json::from_str::<Quality>(&text).unwrap(), quality);
        // Samples 0 to 3 are judged.
        close(quality.com_error_max_m.unwrap(), 0.009);
        close(quality.velocity_max_rad_s, 0.05);
        close(quality.acceleration_max_rad_s2, 0.2);
    }
    assert!(sound.survived);
    close(sound.com_error_max_m.unwrap(), 0.025);
    let far = spoilt(1e9);
    assert!(far.com_error_rms_m.unwrap().is_finite() && far.acceleration_max_rad_s2.is_finite());
}

#[test]
fn runs_that_do_not_fit_the_problem_do_not_survive() {
    let problem = shoot_out(Boundary::Positions);
    let q = standing(problem.robot(), 0.6);
    let mut short = q.clone();
    short.pop();
    let mut stretched = q.clone();
    stretched[6] = 1.1;
    for bad in [short, stretched, Vec::new()] {
        assert_eq!(
            judge_at_rest(&problem, &[0.0; 18], &[bad], 0.005),
            Quality::default()
        );
    }
    let targets = constant(&problem, &[0.0; 18], 1);
    let q = [q.clone(), q];
    let run = Run {
        dt_s: 0.005,
        q: &q,
        targets: &targets,
        phases: &ONLY,
        support: &[],
        walk: None,
    };
    let judged = |run: Run<'_>| referee(&problem).judge(&run);
    assert!(
        !judged(run).survived && judged(run).com_error_max_m.is_some(),
        "the second sample has no target"
    );
    for dt_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(judged(Run { dt_s, ..run }), Quality::default());
    }
    assert_eq!(judged(Run { phases: &[], ..run }), Quality::default());
    assert_eq!(
        judged(Run {
            phases: &[PhaseId(1)],
            ..run
        }),
        Quality::default()
    );
    assert_eq!(judged(Run { q: &[], ..run }), Quality::default());
}

#[test]
fn a_target_that_is_no_attitude_cannot_be_judged() {
    let robot = two_links();
    let tasks = vec![("tip", Track::Orientation(frame(&robot, "tip")), Priority::Hard)];
    let parts = parts(robot, tasks, Boundary::None);
    let parts = ProblemParts {
        orientation: OrientationCoordinates::Log,
        ..parts
    };
    let problem = Arc::new(Problem::new(parts).unwrap());
    assert_eq!(
        judge_at_rest(&problem, &[0.0; 4], &[vec![0.0, 0.0]], 0.1),
        Quality::default()
    );
}

#[test]
fn specifications_are_checked() {
    use crate::referee::RefereeError;
    let problem = shoot_out(Boundary::Positions);
    let fails = |spec| Referee::new(&problem, spec).unwrap_err();
    let unknown = fails(JudgeSpec {
        exit_joints: vec!["knee".to_owned()],
        ..plain_spec()
    });
    assert!(unknown.to_string().contains("`knee`") && unknown.to_string().contains("LKneeSag"));
    let frame = fails(JudgeSpec {
        torque_supports: vec![FrameId(999)],
        ..plain_spec()
    });
    assert!(matches!(frame, RefereeError::Frame { frame: 999, .. }));
    for soft_tolerance_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            fails(JudgeSpec {
                soft_tolerance_m,
                ..plain_spec()
            }),
            RefereeError::Tolerance(_)
        ));
    }
}
