#![allow(clippy::unwrap_used, reason = "tests want to stop at the first surprise")]

use super::*;
use std::time::Duration;

/// The squat, a twentieth of a second long, with three runs.
fn short_heats() -> Vec<Heat> {
    let mut suite = Suite::load("coman/squat").unwrap();
    suite.scenarios[0].duration_s = 0.05;
    let selection = Selection {
        methods: vec!["ik1".into(), "ik5".into()],
        ..Selection::default()
    };
    heats(&[suite], &selection, &Variation::default(), Scenarios::All).unwrap()
}

fn session_at(revision: &str) -> Session {
    let timing = Timing {
        repeats: 1,
        cap: Duration::from_secs(9),
    };
    Session {
        revision: revision.into(),
        machine: machine(),
        timing,
        notes: Vec::new(),
    }
}

/// Runs everything into `dir` and returns the rows in the order of the plan.
fn rows_after(dir: &Path, session: &Session) -> Vec<Row> {
    let store = Some(RowStore::open(dir).unwrap());
    let mut recorder = Recorder {
        store,
        dir: dir.into(),
        traces: Traces::Written,
        reusable: short_heats().iter().map(|heat| heat.case.suite.clone()).collect(),
        kept: 0,
        rows: Vec::new(),
    };
    run_heats(&short_heats(), session, &mut recorder).unwrap();
    recorder.rows
}

fn on_disk(dir: &Path) -> usize {
    RowStore::open(dir).unwrap().rows().len()
}

struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        Self(std::env::temp_dir().join(format!("ik-bench-run-{}-{test}", std::process::id())))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A leftover in the folder for temporary files harms nobody.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn runs_of_a_clean_revision_are_not_repeated() {
    let folder = Folder::new("resume");
    let session = session_at("0123456789ab");
    let first = rows_after(&folder.0, &session);
    assert_eq!(first.len(), 3);
    // Step times would differ if anything had run again.
    assert_eq!(rows_after(&folder.0, &session), first);
    assert_eq!(on_disk(&folder.0), 3);
    fs::remove_file(folder.0.join(first[1].trace.as_ref().unwrap())).unwrap();
    let mended = rows_after(&folder.0, &session);
    assert_eq!((&mended[0], &mended[2]), (&first[0], &first[2]));
    let row = &mended[1];
    assert_ne!(row, &first[1], "the run without its trace was made again");
    assert_eq!(on_disk(&folder.0), 3, "and took the place of its row");
}

#[test]
fn runs_of_another_or_a_dirty_revision_are_repeated() {
    let folder = Folder::new("repeat");
    for (count, revision) in [
        (3, "0123456789ab"),
        (6, "ba9876543210"),
        (9, "ba9876543210-dirty"),
        (9, "ba9876543210-dirty"),
    ] {
        rows_after(&folder.0, &session_at(revision));
        assert_eq!(on_disk(&folder.0), count, "{revision}");
    }
}

#[test]
fn only_rows_of_this_clean_revision_and_machine_made_with_care_can_be_built_upon() {
    let folder = Folder::new("reuse");
    let limbs = LimbStore::open(&folder.0).unwrap();
    let session = session_at("0123456789ab");
    assert!(
        is_reusable(
            &RowStore::open(&folder.0).unwrap(),
            &limbs,
            &session_at("unknown")
        ),
        "an empty folder"
    );
    rows_after(&folder.0, &session);
    let store = RowStore::open(&folder.0).unwrap();
    assert!(is_reusable(&store, &limbs, &session));
    assert!(!is_reusable(&store, &limbs, &session_at("0123456789ab-dirty")));
    assert!(!is_reusable(&store, &limbs, &session_at("ba9876543210")));
    let quick = Session {
        notes: vec![QUICK_NOTE.to_owned()],
        ..session.clone()
    };
    assert!(!is_reusable(&store, &limbs, &quick));
    let elsewhere = crate::records::Machine {
        cores: 99,
        ..session.machine.clone()
    };
    assert!(!is_reusable(
        &store,
        &limbs,
        &Session {
            machine: elsewhere,
            ..session
        }
    ));
}

#[test]
fn starting_over_removes_results_and_nothing_else() {
    let folder = Folder::new("fresh");
    rows_after(&folder.0, &session_at("0123456789ab"));
    fs::write(folder.0.join("notes.txt"), "mine").unwrap();
    assert!(start_over(&folder.0).unwrap().0.rows().is_empty());
    let left: Vec<_> = fs::read_dir(&folder.0)
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(left, ["notes.txt"]);
    assert!(start_over(&folder.0.join("nowhere")).unwrap().0.rows().is_empty());
}

#[test]
fn traces_are_named_by_what_tells_runs_apart() {
    let heat = &short_heats()[0];
    let names: Vec<String> = heat
        .contestants
        .iter()
        .map(|c| file_name(&heat.case, &c.id, &recorded(&c.parameters)))
        .collect();
    assert_eq!(
        names,
        [
            "coman-squat_A_ik1",
            "coman-squat_A_ik5_n-15",
            "coman-squat_A_ik5_n-3"
        ]
    );
    let suite = Suite::load("coman/squat").unwrap();
    let finer = Case::new(
        &suite,
        0,
        &Variation {
            dt_s: Some(0.001),
            ..Variation::default()
        },
    )
    .unwrap();
    assert_eq!(
        file_name(&finer, "ik1", &BTreeMap::new()),
        "coman-squat_A_ik1_dt-0.001"
    );
}
