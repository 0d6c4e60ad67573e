//! The Bioloid gait end to end: how far open and corrected integration stray, and that the centre of mass stays over the
//! soles.

#![allow(clippy::unwrap_used, missing_docs, reason = "tests")]

use benchmarks::records::Quality;
use benchmarks::referee::Run;
use benchmarks::runner::play;
use benchmarks::suite::{Case, Suite, Variation};
use ik_core::kinematics::{Page, forward};
use ik_core::problem::PhaseId;
use ik_core::task::Track;
use ik_methods::registry::method;

fn gait(variation: &Variation) -> Case {
    Case::new(&Suite::load("bioloid/gait").unwrap(), 0, variation).unwrap()
}

fn played(case: &Case, parameters: &str) -> Vec<Vec<f64>> {
    let contestant = method("davies")
        .unwrap()
        .build(&parameters.parse().unwrap())
        .unwrap();
    let (_, played) = play(case, &contestant).unwrap();
    assert!(
        !played.terminations.contains_key("damped"),
        "{:?}",
        played.terminations
    );
    played.q
}

/// Largest component of the position of feet and hands off their targets (m).
fn closure_error(case: &Case, q: &[Vec<f64>]) -> f64 {
    let problem = &case.problem;
    let robot = problem.robot();
    let mut page = Page::new(robot);
    let mut target = vec![0.0; problem.nxdot()];
    let mut worst = 0.0_f64;
    for (k, q) in q.iter().enumerate() {
        case.trajectory.value_into(case.dt_s * k as f64, &mut target);
        forward(robot, q, &mut page);
        for (task, slot) in problem.tasks().iter().zip(problem.slots()) {
            let (Track::Pose(frame) | Track::Position(frame)) = task.track else {
                continue;
            };
            let now = page.frame_position(robot, frame);
            for i in 0..3 {
                worst = worst.max((now[i] - target[slot.xdot + i]).abs());
            }
        }
    }
    worst
}

fn judged(case: &Case, q: &[Vec<f64>]) -> Quality {
    case.referee.judge(&Run {
        dt_s: case.dt_s,
        q,
        targets: case.samples.judged(),
        phases: &[PhaseId(0)],
        support: &case.support,
        walk: None,
    })
}

#[test]
fn closure_errors_are_those_of_the_integration() {
    let case = gait(&Variation::default());
    let error = |parameters: &str| closure_error(&case, &played(&case, parameters));
    let open = error("correction = 0.0");
    let corrected = error("");
    let euler_rates = error("orientation = 'euler-rates'");
    let fourth_order = error("correction = 0.0\nintegrator = 'rk4'\nfeed_forward = 'given'");
    let all = format!("open {open:e}, corrected {corrected:e}, {euler_rates:e}, RK4 open {fourth_order:e}");
    assert!((5e-3..10e-3).contains(&open), "{all}");
    assert!(corrected < 1e-4 && euler_rates < 1e-4, "{all}");
    assert!(fourth_order < 1e-6, "{all}");
}

#[test]
fn the_drift_of_the_open_loop_is_of_first_order() {
    let error = |dt_s: f64| {
        let case = gait(&Variation {
            dt_s: Some(dt_s),
            ..Variation::default()
        });
        closure_error(&case, &played(&case, "correction = 0.0"))
    };
    let ratio = error(0.01) / error(0.005);
    assert!((1.8..2.2).contains(&ratio), "{ratio}");
}

#[test]
fn the_centre_of_mass_stays_over_the_soles() {
    let case = gait(&Variation::default());
    let quality = judged(&case, &played(&case, ""));
    assert!(quality.survived, "{quality:?}");
    assert!(quality.gcom_margin_min_m.unwrap() > 0.0);
    // The paper: the zero-moment point keeps near the projection and inside the soles.
    assert!(quality.zmp_gcom_distance_rms_m.unwrap() < 0.01);
    assert!(quality.zmp_margin_min_m.unwrap() > 0.0);
    assert!(quality.hard_error_max_m < 1e-4);
}
