#![allow(clippy::unwrap_used, reason = "tests want to stop at the first surprise")]

use super::super::synthetic::{folder, run_into};
use super::super::{DrawnLimits, draw_all};
use super::*;
use std::path::Path;

/// Walks of Melson and Hubo at coarse time steps.
pub(in super::super) fn write_walks(dir: &Path) {
    run_into(dir, (SHORT, &["S1", "S2", "S3"]), (&[METHOD], 0.05), "");
    run_into(dir, (LONG, &["S1", "S2"]), (&[METHOD], 0.1), "");
    run_into(
        dir,
        ("walk/hubo", &["walk"]),
        (&[METHOD, "closed-form"], 0.05),
        "",
    );
}

#[test]
fn walks_give_every_figure_with_what_they_name() {
    let dir = folder("walks");
    write_walks(&dir);
    let notes = draw_all(&dir, &DrawnLimits::COMAN).unwrap().notes;
    let expected: [(&str, &[&str]); 9] = [
        (
            "melson_fig3_4_5_joints.svg",
            &[
                "Fig. 4  left knee",
                "torque (Nm)",
                "S3: joint centring and gravity torque",
            ],
        ),
        (
            "melson_fig6_7_8_strips.svg",
            &["Fig. 8  S3", "from the front", "12.0 s"],
        ),
        (
            "melson_fig9_poses.svg",
            &["before the first step", "S2: joint centring, from the front"],
        ),
        (
            "melson_fig10_drift.svg",
            &[
                "right hip roll",
                "at the ends of the cycles, less the first",
                "joint that changes most",
            ],
        ),
        (
            "melson_objectives.svg",
            &["H_joint (–)", "H_grav (N²m²)", "left foot stands alone"],
        ),
        (
            "melson_zmp.svg",
            &["reference", "off the reference (m)", "scenario S3"],
        ),
        ("walk_hubo_zmp.svg", &["extent of the support polygon"]),
        ("walk_hubo_strip.svg", &["Hubo walking: closed-form", "9.6 s"]),
        (
            "walk_hubo_methods.svg",
            &["closed-form", "clik", "step time (µs)"],
        ),
    ];
    for (name, texts) in expected {
        let svg = std::fs::read_to_string(dir.join("figures").join(name)).unwrap();
        for text in texts {
            assert!(svg.contains(text), "{name} lacks {text:?}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("no data"), "{name}");
    }
    assert!(
        notes
            .iter()
            .any(|n| n == "no run of clik with a trace on melson/long-walk/S3"),
        "{notes:?}"
    );
    std::fs::remove_dir_all(dir).unwrap();
}
