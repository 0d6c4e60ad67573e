use super::davies::tests::write_walk;
use super::synthetic::{folder, row, write_results};
use super::walk::tests::write_walks;
use super::*;
use crate::records_io::{RowStore, write_trace};

fn draw_into(dir: &Path) -> Drawn {
    draw_all(dir, &DrawnLimits::COMAN).unwrap()
}

fn figure(dir: &Path, name: &str) -> String {
    std::fs::read_to_string(dir.join("figures").join(name)).unwrap()
}

/// A results folder with one run, of `ik1` on the squat, with the given trace.
fn single(name: &str, columns: &[&str], rows: &[&[f64]]) -> PathBuf {
    let dir = folder(name);
    let columns = columns.iter().map(|c| (*c).to_owned()).collect();
    let trace = Trace {
        columns,
        rows: rows.iter().map(|r| r.to_vec()).collect(),
    };
    write_trace(&dir.join("traces/a.csv"), &trace).unwrap();
    let row = Row {
        trace: Some("traces/a.csv".to_owned()),
        ..row("ik1", None, "coman/squat", "A")
    };
    RowStore::open(&dir).unwrap().push(row).unwrap();
    dir
}

const SQUAT: [&str; 4] = ["t", "com_error_m", "com_rate_error_m_s", "step_us"];

#[test]
fn a_full_run_gives_every_figure_with_its_axes_and_methods() {
    let dir = folder("full");
    write_results(&dir);
    write_walk(&dir);
    write_walks(&dir);
    let drawn = draw_into(&dir);
    assert_eq!(drawn.files.len(), FIGURES.len(), "{:?}", drawn.notes);
    assert_eq!(
        drawn.notes,
        [
            "penalty-cg n=15 on coman/lean/D: the method declined",
            "no run of clik with a trace on melson/long-walk/S3"
        ]
    );
    let expected: [(&str, &[&str]); 8] = [
        (
            "fig1_squat.svg",
            &[
                "coman/squat, scenario A, Δt = 5 ms",
                "CoM error (m)",
                "n = 15",
                "n = 3",
                "ik4 literal",
            ],
        ),
        (
            "fig2_stretch.svg",
            &[
                "CoM height (m)",
                "left knee (rad)",
                "step time (µs)",
                "time (s)",
                "target",
            ],
        ),
        ("fig3_asymmetric.svg", &["right knee (rad)", "penalty-lbfgs"]),
        ("fig3_family.svg", &["C6_1_4", "survived", "6/12", "0/12"]),
        (
            "fig4_lean.svg",
            &["LHipSag (rad)", "hip pitch limit 0.7854", "ik2"],
        ),
        (
            "fig5_boundary.svg",
            &["knee velocity (rad/s)", "boundary: polygon", "ellipse, γ = 0"],
        ),
        (
            "fig6_regulator.svg",
            &[
                "left knee static torque (Nm)",
                "exit time (s)",
                "ik4, γ = 10",
                "ik5 n=15",
            ],
        ),
        (
            "fig7_posture.svg",
            &[
                "mean Στ² for t ≥ 1 s (N²m²)",
                "ik4 n=3, fitted",
                "relative to the start at 0.15 rad",
            ],
        ),
    ];
    for (name, texts) in expected {
        let svg = figure(&dir, name);
        for text in texts {
            assert!(svg.contains(text), "{name} lacks {text:?}");
        }
    }
    for name in [
        "overview_error.svg",
        "overview_time.svg",
        "overview_majors.svg",
        "overview_hard.svg",
    ] {
        let svg = figure(&dir, name);
        for text in [
            "coman/regulator",
            "ik4 gamma=100 n=15",
            "did not survive",
            "a-later-one",
        ] {
            assert!(svg.contains(text), "{name} lacks {text:?}");
        }
    }
    assert!(figure(&dir, "overview_time.svg").contains("declined"));
    // Neither suite of the Bioloid has a task of the centre of mass.
    let without = "Without this quantity: bioloid/gait, bioloid/squat.";
    assert!(figure(&dir, "overview_error.svg").contains(without));
    for path in &drawn.files {
        let svg = std::fs::read_to_string(path).unwrap();
        assert!(
            svg.starts_with("<svg width=\"1000\"") && svg.trim_end().ends_with("</svg>"),
            "{}",
            path.display()
        );
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{}", path.display());
        assert_eq!(
            svg.matches("<path").count(),
            svg.matches(" d=\"M").count(),
            "{}",
            path.display()
        );
    }
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn equal_folders_give_equal_bytes() {
    let dirs = [folder("once"), folder("again")];
    let texts = dirs.map(|dir| {
        write_results(&dir);
        let files = draw_into(&dir).files;
        let texts: Vec<String> = files
            .iter()
            .map(|f| std::fs::read_to_string(f).unwrap())
            .collect();
        std::fs::remove_dir_all(dir).unwrap();
        texts
    });
    assert!(texts[0] == texts[1], "the figures of equal folders differ");
}

#[test]
fn figures_without_data_are_left_out_with_the_reason_and_old_ones_removed() {
    let dir = folder("missing");
    let stale = dir.join("figures/fig2_stretch.svg");
    write_atomically(&stale, "old").unwrap();
    let mut store = RowStore::open(&dir).unwrap();
    store.push(row("ik1", None, "coman/squat", "A")).unwrap();
    let lost = Row {
        trace: Some("traces/lost.csv".to_owned()),
        ..row("ik2", Some(3), "coman/squat", "A")
    };
    store.push(lost).unwrap();
    let drawn = draw_into(&dir);
    let names: Vec<_> = drawn
        .files
        .iter()
        .map(|f| f.file_name().unwrap().to_owned())
        .collect();
    assert_eq!(
        names,
        [
            "overview_error.svg",
            "overview_time.svg",
            "overview_majors.svg",
            "overview_hard.svg"
        ]
    );
    for note in [
        "ik1 on coman/squat/A: no trace",
        "ik2 n=3 on coman/squat/A: no trace",
    ] {
        assert!(drawn.notes.iter().any(|n| n == note), "{:?}", drawn.notes);
    }
    assert!(
        drawn
            .notes
            .iter()
            .any(|n| n.starts_with("fig1_squat.svg not drawn")),
        "{:?}",
        drawn.notes
    );
    assert!(!stale.exists());
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn one_sample_and_missing_columns_are_drawn_as_far_as_they_go() {
    let dir = single("one-sample", &["t", "com_error_m"], &[&[0.0, 1e-4]]);
    let drawn = draw_into(&dir);
    assert!(drawn.files.iter().any(|f| f.ends_with("fig1_squat.svg")));
    assert!(
        drawn
            .notes
            .iter()
            .any(|n| n == "coman/squat/A: 1 of 1 traces have no column step_us"),
        "{:?}",
        drawn.notes
    );
    assert!(figure(&dir, "fig1_squat.svg").contains("no data"));
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn zero_errors_lie_on_a_stated_floor() {
    let rows: Vec<Vec<f64>> = (0..40)
        .map(|k| vec![f64::from(k) * 0.005, 0.0, 0.0, 5.0])
        .collect();
    let dir = single(
        "zero",
        &SQUAT,
        &rows.iter().map(Vec::as_slice).collect::<Vec<_>>(),
    );
    draw_into(&dir);
    let svg = figure(&dir, "fig1_squat.svg");
    assert!(
        svg.contains("CoM error (m): values below 10⁻¹⁶ are drawn at 10⁻¹⁶."),
        "{svg}"
    );
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn samples_that_are_not_finite_interrupt_a_curve() {
    let dir = single(
        "not-finite",
        &SQUAT,
        &[
            &[0.0, 0.0, 0.0, 0.0],
            &[0.1, 1e-3, 1e-2, 5.0],
            &[0.2, f64::NAN, f64::INFINITY, 5.0],
            &[0.3, 1e-3, 1e-2, 5.0],
            &[0.4, 2e-3, 1e-2, 5.0],
        ],
    );
    draw_into(&dir);
    let svg = figure(&dir, "fig1_squat.svg");
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_run_that_diverges_leaves_the_panel_to_the_survivors() {
    let dir = folder("diverging");
    write_results(&dir);
    let draw = |name: &str| {
        draw_into(&dir);
        figure(&dir, name)
    };
    let rows = read_rows(&dir.join(ROWS_FILE)).unwrap().rows;
    for (name, suite, column) in [
        ("fig2_stretch.svg", "coman/stretch", "LKneeSag"),
        ("fig4_lean.svg", "coman/lean", "LHipSag"),
    ] {
        assert!(!draw(name).contains("leaving the panel"), "{name}");
        let wild = |row: &&Row| row.suite == suite && row.method == "a-later-one";
        let mut wild = rows.iter().find(wild).unwrap().clone();
        let path = dir.join(wild.trace.as_ref().unwrap());
        let mut trace = read_trace(&path).unwrap();
        let at = trace.columns.iter().position(|c| c == column).unwrap();
        trace.rows.iter_mut().for_each(|row| row[at] *= 1e4);
        write_trace(&path, &trace).unwrap();
        wild.metrics.as_mut().unwrap().quality.survived = false;
        RowStore::open(&dir).unwrap().push(wild).unwrap();
        let after = draw(name);
        assert!(after.contains("leaving the panel: a-later-one (to "), "{name}");
        assert!(after.contains(AXES_OF_SURVIVORS), "{name}");
    }
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_malformed_trace_is_an_error_that_names_its_place() {
    let dir = single("malformed", &SQUAT, &[&[0.0, 0.0, 0.0, 0.0]]);
    std::fs::write(dir.join("traces/a.csv"), "t,com_error_m\n0,zero\n").unwrap();
    let error = draw_all(&dir, &DrawnLimits::COMAN).unwrap_err().to_string();
    for part in ["a.csv", "line 2", "com_error_m", "zero"] {
        assert!(error.contains(part), "{error}");
    }
    std::fs::remove_dir_all(&dir).unwrap();
    let error = draw_all(&dir, &DrawnLimits::COMAN).unwrap_err().to_string();
    assert!(error.contains("runs.jsonl"), "{error}");
}

#[test]
#[allow(clippy::float_cmp, reason = "copied, not computed")]
fn a_suite_is_shown_with_the_time_step_of_its_last_row() {
    let coarse = Row {
        dt_s: 0.01,
        ..row("ik1", None, "coman/squat", "A")
    };
    let rows = vec![
        row("ik1", None, "coman/squat", "A"),
        coarse,
        row("ik1", None, "coman/lean", "D"),
    ];
    let steps: Vec<f64> = of_last_dt(rows).iter().map(|r| r.dt_s).collect();
    assert_eq!(steps, [0.01, 0.005]);
}

#[test]
fn the_largest_of_all_tasks_counts_and_rates_do_not() {
    let columns = ["t", "a_error_m", "b_error_m", "a_error_rad", "com_rate_error_m_s"];
    let trace = Trace {
        columns: columns.map(str::to_owned).to_vec(),
        rows: vec![vec![0.0, 1.0, 2.0, 3.0, 9.0], vec![0.5, 5.0, 4.0, 3.5, 9.0]],
    };
    let largest = largest_over_time(&trace, "_error_m");
    assert_eq!(largest, Some(vec![(0.0, 2.0), (0.5, 5.0)]));
}
