use super::*;
use crate::figures::synthetic::{folder, row, write_results};
use crate::records::TerminationRecord;
use crate::records_io::{ROWS_FILE, read_rows};

fn full() -> Vec<Row> {
    // Tests run side by side: each has its folder.
    let dir = folder(&format!("summary-{:?}", std::thread::current().id()));
    write_results(&dir);
    let rows = read_rows(&dir.join(ROWS_FILE)).unwrap().rows;
    std::fs::remove_dir_all(dir).unwrap();
    rows
}

fn declined() -> Row {
    let termination = TerminationRecord::Declined {
        reason: "made up".to_owned(),
    };
    Row {
        termination,
        metrics: None,
        ..row("penalty-cg", None, "coman/squat", "A")
    }
}

#[test]
fn numbers_have_three_digits() {
    let expected = [
        (0.0, "0"),
        (1.46332e-3, "0.00146"),
        (12.34, "12.3"),
        (1234.5, "1234"),
        (-2e-12, "-2.00e-12"),
    ];
    for (value, text) in expected {
        assert_eq!(number(Some(value)), text);
    }
    assert_eq!(number(None), NONE);
}

#[test]
fn the_terminal_table_fits_and_folds_large_suites() {
    let mut rows = full();
    rows.push(row(
        "a-method-with-a-very-long-name",
        Some(100),
        "coman/squat",
        "a-long-scenario-name",
    ));
    let table = terminal_table(&rows);
    for line in table.lines() {
        assert!(
            line.chars().count() <= TERMINAL_WIDTH,
            "{} columns: {line}",
            line.chars().count()
        );
    }
    let folded: Vec<&str> = table.lines().filter(|l| l.starts_with("12 others")).collect();
    assert_eq!(folded.len(), 13, "{table}");
    assert!(
        folded.iter().any(|l| l.contains("ik4 ") && l.ends_with("6/12")),
        "{table}"
    );
    assert!(!table.contains("C6_1_4"), "{table}");
    assert!(table.lines().any(|l| l.starts_with("B1 ")), "{table}");
    assert!(
        table
            .lines()
            .any(|l| l.contains("penalty-cg") && l.ends_with("decl.")),
        "{table}"
    );
}

#[test]
fn the_terminal_says_which_steps_ended_otherwise_than_they_should() {
    let mut lost = row("closed-form", Some(15), "bioloid/gait", "gait-bounded");
    let steps = [("converged", 790), ("outside-limits", 10)];
    lost.termination = TerminationRecord::Completed {
        steps: steps.map(|(word, count)| (word.to_owned(), count)).into(),
    };
    let rows = [row("ik1", None, "bioloid/gait", "gait-bounded"), lost];
    let table = terminal_table(&rows);
    assert!(
        table.contains("closed-form n=15: of 800 steps 10 outside-limits\n"),
        "{table}"
    );
    assert!(!table.contains("ik1: of"), "{table}");
}

#[test]
fn the_summary_has_a_table_and_the_analysis_per_suite() {
    let mut lost = row("ik2", Some(3), "coman/lean", "D");
    lost.metrics.as_mut().unwrap().quality.survived = false;
    let rows = [row("ik1", None, "coman/squat", "A"), declined(), lost];
    let analysis = BTreeMap::from([("coman/squat".to_owned(), "Why this squat.\n".to_owned())]);
    let text = summary_markdown(&rows, &analysis);
    assert!(
        text.contains("revision 0123abc on made-up, 2 logical processors"),
        "{text}"
    );
    assert!(
        text.contains("## coman/squat\n\nWhy this squat.\n\n| scenario | method |"),
        "{text}"
    );
    assert!(
        text.contains("| A | ik1 | – | 1.50 | 2.20 | 3.33e-10 | – | -1.20e-12 | 53.0 |"),
        "{text}"
    );
    assert!(
        text.lines()
            .any(|l| l.contains("penalty-cg") && l.ends_with("| declined |")),
        "{text}"
    );
    assert!(
        text.lines()
            .any(|l| l.starts_with("| D | ik2 | 3 |") && l.ends_with("| NO |")),
        "{text}"
    );
    let columns = |line: &str| line.matches('|').count();
    let mut tables = text.lines().filter(|l| l.starts_with('|'));
    assert!(tables.all(|l| columns(l) == HEADER.len() + 1), "{text}");
}

#[test]
fn a_suite_that_walks_has_a_second_table_and_a_line_in_the_readme() {
    let mut walked = row("clik", None, "melson/walk", "S1");
    let quality = quality_of(&mut walked);
    quality.objective_mean.insert("joint-centring".to_owned(), 0.22);
    quality.single_support_torque_squared_mean_n2m2 = Some(2.75);
    quality.settled_zmp_margin_min_m = Some(0.0295);
    let rows = [row("clik", None, "coman/squat", "A"), walked, declined()];
    let text = summary_markdown(&rows, &BTreeMap::new());
    let second = "| S1 | clik | – | 0.220 | – | 2.75 | – | – | – | – | 29.5 | – |";
    assert_eq!(text.matches("mean H_joint").count(), 1, "{text}");
    assert!(
        text.contains(second) && text.contains("drift: largest change"),
        "{text}"
    );
    assert!(!summary_markdown(&rows[..1], &BTreeMap::new()).contains("drift"));
    let terminal = terminal_table(&rows);
    let line = terminal
        .lines()
        .filter(|line| line.starts_with("S1 "))
        .nth(1)
        .unwrap();
    assert!(line.contains("0.220") && line.contains("29.5"), "{terminal}");
    assert!(
        terminal
            .lines()
            .all(|line| line.chars().count() <= TERMINAL_WIDTH)
    );
    assert!(!terminal_table(&rows[..1]).contains("H_joint"));
    let readme = readme_table(&rows);
    assert!(
        readme.contains("| clik | – | 0.220, – | 2.75, – | – |"),
        "{readme}"
    );
    assert!(!readme_table(&rows[..1]).contains("H_joint"));
}

/// Rows recorded before there were maxima per task have the centre of mass in their place.
#[test]
fn the_soft_columns_take_the_worst_point_and_read_older_rows() {
    let mut run = row("ik1", None, "coman/squat", "A");
    let soft = |run: &Row| {
        let cells = cells(&labelled(std::slice::from_ref(run))[0]);
        (cells[3].clone(), cells[4].clone())
    };
    let pair = |rms: &str, max: &str| (rms.to_owned(), max.to_owned());
    assert_eq!(soft(&run), pair("1.50", "2.20"));
    let quality = quality_of(&mut run);
    quality.soft_error_max.insert("com".to_owned(), 2.2e-3);
    (quality.soft_error_rms_m, quality.soft_error_max_m) = (Some(7e-3), Some(9e-3));
    assert_eq!(soft(&run), pair("7.00", "9.00"));
    // A compromised orientation alone places no point, whatever the hard centre of mass does.
    let quality = quality_of(&mut run);
    (quality.soft_error_rms_m, quality.soft_error_max_m) = (None, None);
    assert_eq!(soft(&run), pair(NONE, NONE));
}

fn quality_of(run: &mut Row) -> &mut Quality {
    &mut run.metrics.as_mut().unwrap().quality
}

fn published(folder: &str) -> Vec<Row> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../results");
    read_rows(&root.join(folder).join(ROWS_FILE)).unwrap().rows
}

#[test]
fn the_published_rows_give_the_tables_of_the_readme() {
    let rows = published("2026-11-22-humanoids");
    let readme = Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md");
    let readme = std::fs::read_to_string(readme).unwrap();
    assert!(readme.contains(&readme_table(&rows)), "{}", readme_table(&rows));
}

/// Rows that were recorded before some fields of today are read, and their centre of mass is the worst task.
#[test]
fn earlier_published_rows_are_read() {
    for row in &published("2026-11-22-coman") {
        let Some(metrics) = &row.metrics else { continue };
        assert_eq!(
            metrics.quality.worst_soft_rms_m(),
            metrics.quality.com_error_rms_m
        );
        assert_eq!(
            metrics.quality.worst_soft_max_m(),
            metrics.quality.com_error_max_m
        );
    }
}

#[test]
fn the_readme_table_has_one_line_per_method_and_budget() {
    let rows = full();
    let table = readme_table(&rows);
    let lines: Vec<&str> = table.lines().filter(|l| l.starts_with("| ik4 ")).collect();
    assert_eq!(lines.len(), 4, "{table}");
    assert!(lines[0].starts_with("| ik4 | 15 | 0.0346 |"), "{table}");
    assert!(
        lines[0].contains("| survives | 6/6 + 0/6 | survives | 31.0 | 6.20 |"),
        "{table}"
    );
    assert!(
        table
            .lines()
            .any(|l| l.starts_with("| penalty-cg |") && l.contains("| declined |")),
        "{table}"
    );
    assert!(readme_table(&[]).lines().count() >= 2);
}

#[test]
fn the_readme_table_goes_between_its_markers() {
    let dir = folder("readme");
    let readme = dir.join("README.md");
    std::fs::write(
        &readme,
        format!("# Title\n\n{RESULTS_BEGIN}\n{RESULTS_END}\n\nEnd\n"),
    )
    .unwrap();
    let rows = [row("ik1", None, "coman/squat", "A")];
    replace_readme_table(&readme, &rows).unwrap();
    let text = std::fs::read_to_string(&readme).unwrap();
    assert!(
        text.contains(&readme_table(&rows)) && text.ends_with("\n\nEnd\n"),
        "{text}"
    );
    let summary = write_summary(&dir, &rows, &[], &BTreeMap::new()).unwrap();
    assert_eq!(
        std::fs::read_to_string(summary).unwrap(),
        summary_markdown(&rows, &BTreeMap::new())
    );
    std::fs::remove_dir_all(dir).unwrap();
}
