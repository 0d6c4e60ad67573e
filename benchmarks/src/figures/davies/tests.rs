#![allow(clippy::unwrap_used, reason = "tests want to stop at the first surprise")]

use super::super::labels::Labelled;
use super::super::synthetic::{folder, row, run_into};
use super::super::walked::{Walked, walk_case};
use super::super::{Drawn, DrawnLimits, FIGURES, draw_all};
use super::*;
use crate::records::{Row, Trace};
use crate::records_io::{RowStore, write_trace};
use std::path::Path;

/// Methods and time step of the runs (s).
const DAVIES: (&[&str], f64) = (&["davies", "davies-open"], 0.04);

/// Walks and squats of Davies' method, at a coarse time step.
pub(in super::super) fn write_walk(dir: &Path) {
    run_into(
        dir,
        (PLACE.suite, &[PLACE.scenario]),
        DAVIES,
        "integrator = [\"euler\", \"rk4\"]",
    );
    run_into(
        dir,
        ("bioloid/squat", &["z180", "z190"]),
        DAVIES,
        "damping = [0.0, 0.01]",
    );
}

fn drawn(dir: &Path) -> Drawn {
    draw_all(dir, &DrawnLimits::COMAN).unwrap()
}

fn figure(dir: &Path, name: &str) -> String {
    std::fs::read_to_string(dir.join("figures").join(name)).unwrap()
}

fn ours() -> impl Iterator<Item = &'static str> {
    FIGURES
        .iter()
        .map(|f| f.0)
        .filter(|name| name.starts_with("davies_"))
}

#[test]
fn a_walk_gives_every_figure_and_the_same_bytes_again() {
    let dir = folder("walk");
    write_walk(&dir);
    drawn(&dir);
    assert!(
        !dir.join("figures/overview_error.svg").exists(),
        "no task tracks a centre of mass"
    );
    let expected: [(&str, &[&str]); 9] = [
        (
            "davies_graph.svg",
            &[
                "N is 24 × 48, mobility 24. Primary 24 (18 imposed, 6 compromised), secondary 24.",
                "circuit 4",
                "r_shoulder_pitch",
                "secondary (monitored)",
            ],
        ),
        (
            "davies_fig6_7_feet.svg",
            &[
                "foot x (m)",
                "foot z (m)",
                "knot of the walk",
                "right foot stands alone",
                "Δt = 40 ms",
            ],
        ),
        (
            "davies_fig8_9_waist.svg",
            &["waist y (m)", "hand x less waist x (m)", "left hand"],
        ),
        (
            "davies_fig10_strip.svg",
            &["from the front", "0.8 s", "8.0 s", "left limbs", "floor"],
        ),
        (
            "davies_fig11_12_balance.svg",
            &[
                "extent of the support polygon",
                "ZMP of the cart",
                "margin to the border (m)",
            ],
        ),
        (
            "davies_fig13_joints.svg",
            &["knee pitch", "ankle roll", "left leg", "angle (rad)"],
        ),
        (
            "davies_closure.svg",
            &["integrator=rk4", "davies-open", "largest position error (m)"],
        ),
        (
            "davies_condition.svg",
            &["cond(N_s)", "circuits at their task points"],
        ),
        (
            "davies_damping.svg",
            &["davies damping=0.01", "right foot miss (m)", "straight leg"],
        ),
    ];
    assert!(ours().eq(expected.iter().map(|e| e.0)));
    let before: Vec<String> = ours().map(|name| figure(&dir, name)).collect();
    for ((name, texts), svg) in expected.iter().zip(&before) {
        for text in *texts {
            assert!(svg.contains(text), "{name} lacks {text:?}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("no data"), "{name}");
    }
    drawn(&dir);
    let again: Vec<String> = ours().map(|name| figure(&dir, name)).collect();
    assert!(before == again, "drawn twice, the figures differ");
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn every_knot_of_the_feet_is_marked() {
    let dir = folder("knots");
    run_into(
        &dir,
        (PLACE.suite, &[PLACE.scenario]),
        DAVIES,
        "integrator = \"euler\"",
    );
    drawn(&dir);
    // Four swings with three knots in x and seven in z, and the legend; a ring is two circles.
    let circles = figure(&dir, "davies_fig6_7_feet.svg").matches("<circle").count();
    assert_eq!(circles, 2 * (4 * (3 + 7) + 1));
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn without_joints_or_traces_the_figures_are_left_out_with_the_reason() {
    let dir = folder("no-walk");
    let trace = Trace {
        columns: vec!["t".to_owned(), "waist_x".to_owned()],
        rows: vec![vec![0.0, 0.1]],
    };
    write_trace(&dir.join("traces/a.csv"), &trace).unwrap();
    let row = Row {
        trace: Some("traces/a.csv".to_owned()),
        ..row(PLACE.method, None, PLACE.suite, PLACE.scenario)
    };
    RowStore::open(&dir).unwrap().push(row).unwrap();
    let notes = drawn(&dir).notes;
    for note in [
        "davies_fig10_strip.svg not drawn: the trace lacks joints of the robot",
        "davies_damping.svg not drawn: no run of davies with a trace on bioloid/squat",
    ] {
        assert!(notes.iter().any(|n| n == note), "{notes:?}");
    }
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn each_foot_stands_alone_twice_in_turn() {
    let (case, soles) = walk_case(PLACE, 0.01).unwrap();
    let made_up = row(PLACE.method, None, PLACE.suite, PLACE.scenario);
    let walked = Walked {
        run: Labelled {
            row: &made_up,
            label: PLACE.method.to_owned(),
            n: None,
        },
        trace: Trace::default(),
        q: Vec::new(),
        case,
        soles,
    };
    let bands = walked.supports();
    let feet: Vec<&str> = bands.iter().map(|b| b.name.split(' ').next().unwrap()).collect();
    assert_eq!(feet, ["left", "right", "left", "right"]);
    for (n, band) in bands.iter().enumerate() {
        // From 0.1 to 0.89 of each step of 2 s.
        let step = 2.0 * n as f64;
        assert!((band.points[0].0 - step - 0.2).abs() < 0.011, "{band:?}");
        assert!((band.points[1].0 - step - 1.78).abs() < 0.011, "{band:?}");
    }
}
