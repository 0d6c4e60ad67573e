use super::*;
use crate::figures::synthetic::{folder, row};
use crate::records::{TerminationRecord, Trace};

fn key(row: &Row) -> RowKey {
    RowKey::of(row)
}

#[test]
fn rows_come_back_as_they_were_pushed() {
    let dir = folder("round-trip");
    let mut odd = row("ik5", Some(3), "coman/stretch", "B");
    odd.notes.push("a \"note\" with µ\nand a newline".to_owned());
    if let Some(metrics) = &mut odd.metrics {
        metrics.quality.com_error_rms_m = Some(0.1 + 0.2);
        metrics.quality.hard_error_max_m = f64::MIN_POSITIVE;
        metrics.quality.sigma_min = 5e-324;
        metrics.effort.step_us_max = f64::MAX;
        metrics.quality.singularity_exit_s = None;
    }
    let declined = Row {
        termination: TerminationRecord::Declined {
            reason: "made up".to_owned(),
        },
        metrics: None,
        ..row("penalty-cg", None, "coman/lean", "D")
    };
    let rows = [row("ik1", None, "coman/squat", "A"), odd, declined];
    let mut store = RowStore::open(&dir).unwrap();
    for row in &rows {
        store.push(row.clone()).unwrap();
    }
    assert_eq!(store.rows(), rows);
    let text = std::fs::read_to_string(dir.join(ROWS_FILE)).unwrap();
    assert_eq!(text.lines().count(), rows.len());
    let read = read_rows(&dir.join(ROWS_FILE)).unwrap();
    assert_eq!((read.rows.as_slice(), read.torn), (rows.as_slice(), None));
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_stopped_run_resumes_where_it_was() {
    let dir = folder("resume");
    let [first, second] = ["A", "B"].map(|scenario| row("ik1", None, "coman/squat", scenario));
    RowStore::open(&dir).unwrap().push(first.clone()).unwrap();
    let mut store = RowStore::open(&dir).unwrap();
    assert!(store.contains(&key(&first)) && !store.contains(&key(&second)));
    store.push(second.clone()).unwrap();
    assert_eq!(RowStore::open(&dir).unwrap().rows(), [first, second]);
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_key_changes_with_everything_that_makes_another_run_and_with_nothing_else() {
    let base = row("ik4", Some(15), "coman/squat", "A");
    let changes: [fn(&mut Row); 7] = [
        |r| r.method.push('x'),
        |r| drop(r.parameters.insert("gamma".to_owned(), 0.0.into())),
        |r| r.suite.push('x'),
        |r| r.scenario.push('x'),
        |r| r.dt_s = 0.01,
        |r| r.seed = 1,
        |r| r.revision.push('x'),
    ];
    for (index, change) in changes.iter().enumerate() {
        let mut other = base.clone();
        change(&mut other);
        assert_ne!(key(&base), key(&other), "change {index}");
    }
    let same = Row {
        metrics: None,
        notes: vec!["other".to_owned()],
        trace: Some("t".to_owned()),
        ..base.clone()
    };
    assert_eq!(key(&base), key(&same));
}

#[test]
fn opening_writes_nothing_and_leftovers_of_a_killed_write_are_ignored() {
    let dir = folder("leftover");
    let inner = dir.join("results");
    assert!(RowStore::open(&inner).unwrap().rows().is_empty());
    assert!(!inner.exists());
    let kept = row("ik1", None, "coman/squat", "A");
    RowStore::open(&inner).unwrap().push(kept.clone()).unwrap();
    std::fs::write(
        inner.join(format!(".{ROWS_FILE}.99999.tmp")),
        "{\"schema\":\"ik-be",
    )
    .unwrap();
    let mut store = RowStore::open(&inner).unwrap();
    assert_eq!(store.rows(), [kept]);
    store.push(row("ik2", None, "coman/squat", "A")).unwrap();
    assert_eq!(read_rows(&inner.join(ROWS_FILE)).unwrap().rows.len(), 2);
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn no_temporary_file_stays_behind() {
    let dir = folder("clean");
    write_atomically(&dir.join("a/b.txt"), "text").unwrap();
    write_atomically(&dir.join("a/b.txt"), "other").unwrap();
    let names: Vec<_> = std::fs::read_dir(dir.join("a"))
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(names, ["b.txt"]);
    assert_eq!(std::fs::read_to_string(dir.join("a/b.txt")).unwrap(), "other");
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_failed_write_leaves_store_and_file_as_they_were() {
    let dir = folder("failed");
    let kept = row("ik1", None, "coman/squat", "A");
    let mut store = RowStore::open(&dir).unwrap();
    store.push(kept.clone()).unwrap();
    // The folder gives way to a file: neither a temporary file nor the folder can be made.
    let hidden = dir.with_extension("moved");
    std::fs::rename(&dir, &hidden).unwrap();
    std::fs::write(&dir, "").unwrap();
    let error = store
        .push(row("ik2", None, "coman/squat", "A"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("cannot"), "{error}");
    assert_eq!(store.rows(), std::slice::from_ref(&kept));
    std::fs::remove_file(&dir).unwrap();
    std::fs::rename(&hidden, &dir).unwrap();
    assert_eq!(RowStore::open(&dir).unwrap().rows(), [kept]);
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_torn_last_line_is_skipped_and_reported_and_any_other_refused() {
    let dir = folder("torn");
    let path = dir.join(ROWS_FILE);
    let mut store = RowStore::open(&dir).unwrap();
    store.push(row("ik1", None, "coman/squat", "A")).unwrap();
    let good = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, format!("{good}\n{}", &good[..40])).unwrap();
    let mut store = RowStore::open(&dir).unwrap();
    assert_eq!(store.rows().len(), 1);
    let torn = store.torn().unwrap();
    assert!(torn.contains(ROWS_FILE) && torn.contains("line 3"), "{torn}");
    store.push(row("ik2", None, "coman/squat", "A")).unwrap();
    assert_eq!(read_rows(&path).unwrap().torn, None);

    for (bad, parts) in [
        (
            good.replace("\"seed\":0", "\"seed\":\"none\""),
            ["line 2", "invalid type"],
        ),
        (good.replace("\"suite\"", "\"suit\""), ["line 2", "`suit`"]),
        (
            good.replace("ik-bench/run/1", "ik-bench/run/9"),
            ["field schema", "ik-bench/run/9"],
        ),
        ("[1]\n".to_owned(), ["line 2", "not a run record"]),
    ] {
        std::fs::write(&path, format!("{good}{bad}{good}")).unwrap();
        let error = RowStore::open(&dir).unwrap_err().to_string();
        assert!(error.contains(ROWS_FILE), "{error}");
        assert!(parts.iter().all(|p| error.contains(p)), "{error}");
    }
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn a_row_that_json_cannot_hold_is_refused_by_name() {
    let dir = folder("nan");
    let mut bad = row("ik3", None, "coman/squat", "A");
    bad.metrics.as_mut().unwrap().quality.hard_error_max_m = f64::NAN;
    let error = RowStore::open(&dir).unwrap().push(bad).unwrap_err().to_string();
    for part in ["ik3", "coman/squat/A", "not finite", "hard_error_max_m"] {
        assert!(error.contains(part), "{error}");
    }
    assert!(!dir.join(ROWS_FILE).exists());
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn traces_come_back_bit_for_bit() {
    let dir = folder("trace");
    let path = dir.join("traces/a.csv");
    let values = [
        0.1 + 0.2,
        1e-17,
        -0.0,
        5e-324,
        f64::MAX,
        -1.0 / 3.0,
        1e16,
        3.0,
        f64::INFINITY,
    ];
    let columns: Vec<String> = (0..values.len()).map(|i| format!("c{i}")).collect();
    let trace = Trace {
        columns,
        rows: vec![values.to_vec(), values.map(|v| v * 0.5).to_vec()],
    };
    write_trace(&path, &trace).unwrap();
    let read = read_trace(&path).unwrap();
    assert_eq!(read.columns, trace.columns);
    let bits = |t: &Trace| -> Vec<u64> { t.rows.iter().flatten().map(|v| v.to_bits()).collect() };
    assert_eq!(bits(&read), bits(&trace));
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(
        text.contains("0.30000000000000004,1e-17,-0,") && text.contains(",3,"),
        "{text}"
    );
    write_trace(
        &path,
        &Trace {
            rows: Vec::new(),
            ..trace
        },
    )
    .unwrap();
    assert!(read_trace(&path).unwrap().rows.is_empty());
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn malformed_traces_are_refused_by_line_and_column() {
    let dir = folder("bad-trace");
    let path = dir.join("a.csv");
    for (text, parts) in [
        ("t,a\n0,1\n0,x\n", ["line 3", "column a", "\"x\""]),
        ("t,a\n0\n", ["line 2", "column 2", "1 values"]),
        ("t,a\n0,1,2\n", ["line 2", "3 values", "2, one per column"]),
        ("t,t\n0,1\n", ["line 1", "column 2", "differ"]),
        ("", ["line 1", "column 1", "not empty"]),
    ] {
        std::fs::write(&path, text).unwrap();
        let error = read_trace(&path).unwrap_err().to_string();
        assert!(
            error.contains("a.csv") && parts.iter().all(|p| error.contains(p)),
            "{text:?}: {error}"
        );
    }
    let trace = |columns: &[&str], row: &[f64]| Trace {
        columns: columns.iter().map(|c| (*c).to_owned()).collect(),
        rows: vec![row.to_vec()],
    };
    std::fs::remove_file(&path).unwrap();
    for bad in [trace(&["t", "a,b"], &[0.0, 1.0]), trace(&["t", "a"], &[0.0])] {
        assert!(write_trace(&path, &bad).is_err());
        assert!(!path.exists(), "a bad trace was written");
    }
    let error = read_trace(&path).unwrap_err().to_string();
    assert!(error.contains("cannot read"), "{error}");
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn text_between_markers_is_replaced_and_bad_markers_are_refused() {
    let dir = folder("markers");
    let path = dir.join("README.md");
    let replace = |text: &str| {
        std::fs::write(&path, text).unwrap();
        replace_between(&path, "<!-- b -->", "<!-- e -->", "new\nlines\n").map_err(|e| e.to_string())
    };
    replace("top\n<!-- b -->\nold\n<!-- e -->\nbottom\n").unwrap();
    let expected = "top\n<!-- b -->\nnew\nlines\n<!-- e -->\nbottom\n";
    assert_eq!(std::fs::read_to_string(&path).unwrap(), expected);
    replace(expected).unwrap();
    assert_eq!(
        std::fs::read_to_string(&path).unwrap(),
        expected,
        "replacing twice changes the file"
    );
    for (text, reason) in [
        ("no markers\n", "missing"),
        ("<!-- e -->\n<!-- b -->\n", "reversed"),
        ("<!-- b -->\n<!-- b -->\n<!-- e -->\n", "repeated"),
    ] {
        let error = replace(text).unwrap_err();
        assert!(error.contains(reason) && error.contains("README.md"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }
    std::fs::remove_dir_all(dir).unwrap();
}
