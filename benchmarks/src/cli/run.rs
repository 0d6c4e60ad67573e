//! `ik-bench` and `ik-bench run`: plan, run heat by heat, record, show.
//!
//! A heat is one scenario with all its contestants; its rows and traces are written and dropped before the next begins,
//! so memory does not grow with the number of scenarios and an interrupted session loses one heat at most.

use super::limbs::{LimbRecorder, plans, run_limbs};
use super::plan::{Heat, Scenarios, heats, settings};
use super::progress::Progress;
use super::{DEFAULT_FOLDER, EffortArgs, Everything, Failure, RunArgs, draw};
use crate::error::InputError;
use crate::instance::Instance;
use crate::limbs::{Amount, LIMBS_FILE, LimbStore, LimbSuite, Plan, is_limb_suite, limbs_terminal};
use crate::machine::{is_pinned, machine, revision};
use crate::records::{Machine, Row};
use crate::records_io::{ROWS_FILE, RecordError, RowKey, RowStore, write_atomically, write_trace};
use crate::runner::{Finished, Session, Timing, play, recorded, run_case};
use crate::suite::{Case, Selection, Suite, Variation};
use crate::summary;
use ik_methods::registry::{Contestant, method};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Marks the rows of a quick session: they are never taken for those of a full one.
const QUICK_NOTE: &str = "quick session";

/// All suites, a quick session those that are not for full ones only, into one folder, with traces, figures and summary.
pub(super) fn everything(args: &Everything, out: &mut dyn Write) -> Result<(), Failure> {
    let mut suites = Suite::load_embedded()?;
    suites.retain(|suite| !(args.effort.quick && suite.full_only));
    let heats = heats(
        &suites,
        &Selection::default(),
        &Variation::default(),
        scenarios(args.effort),
    )?;
    let limb_suites = LimbSuite::load_embedded()?;
    let plans = plans(&limb_suites, amount(args.effort))?;
    let session = session(args.effort);
    check_folder(&args.out)?;
    let store = RowStore::open(&args.out)?;
    let limbs = LimbStore::open(&args.out)?;
    let reusable = is_reusable(&store, &limbs, &session);
    if !reusable && !args.effort.fresh && args.out != Path::new(DEFAULT_FOLDER) {
        let allowed = "a folder without rows, rows of this clean revision, or --fresh to start over";
        return Err(InputError::value("--out", "rows", args.out.display(), allowed).into());
    }
    let (store, limbs) = if reusable && !args.effort.fresh {
        (store, limbs)
    } else {
        start_over(&args.out)?
    };
    let mut recorder = Recorder {
        store: Some(store),
        dir: args.out.clone(),
        traces: Traces::Written,
        reusable: suites.iter().map(|s| s.id.clone()).collect(),
        kept: 0,
        rows: Vec::new(),
    };
    run_heats(&heats, &session, &mut recorder)?;
    let mut limbs = LimbRecorder {
        store: Some(limbs),
        dir: args.out.clone(),
        traces: Traces::Written,
        reusable: limb_suites.iter().map(|s| s.id.clone()).collect(),
        kept: 0,
        rows: Vec::new(),
    };
    run_limbs(&plans, &session, &mut limbs)?;
    let analysis = suites.into_iter().map(|s| (s.id, s.analysis));
    let limb_analysis = limb_suites.into_iter().map(|s| (s.id, s.analysis));
    let analysis: BTreeMap<String, String> = analysis.chain(limb_analysis).collect();
    let summary = summary::write_summary(&args.out, &recorder.rows, &limbs.rows, &analysis)?;
    write!(out, "{}", summary::terminal_table(&recorder.rows))?;
    write!(out, "{}", limbs_terminal(&limbs.rows))?;
    draw(&args.out, out)?;
    tell_kept(recorder.kept + limbs.kept, out)?;
    Ok(writeln!(
        out,
        "{} rows in {}, {} in {}; {}",
        recorder.rows.len(),
        args.out.join(ROWS_FILE).display(),
        limbs.rows.len(),
        args.out.join(LIMBS_FILE).display(),
        summary.display()
    )?)
}

/// Some suites; rows go to a folder if one is given.
pub(super) fn run(args: &RunArgs, out: &mut dyn Write) -> Result<(), Failure> {
    let (limb_names, names): (Vec<String>, Vec<String>) =
        args.suites.iter().cloned().partition(|name| is_limb_suite(name));
    let suites: Vec<Suite> = names
        .iter()
        .map(|name| Suite::load(name))
        .collect::<Result<_, _>>()?;
    let limb_suites: Vec<LimbSuite> = limb_names
        .iter()
        .map(|name| LimbSuite::load(name))
        .collect::<Result<_, _>>()?;
    let mut embedded: BTreeSet<String> = Suite::load_embedded()?.into_iter().map(|s| s.id).collect();
    embedded.extend(LimbSuite::load_embedded()?.into_iter().map(|s| s.id));
    let ids = suites.iter().map(|s| s.id.as_str());
    let ids: Vec<&str> = ids.chain(limb_suites.iter().map(|s| s.id.as_str())).collect();
    check_ids(
        &names.iter().chain(&limb_names).collect::<Vec<_>>(),
        &ids,
        &embedded,
    )?;
    if suites.is_empty() {
        check_options_of_limbs(args, &limb_names)?;
    }
    let plans = plans(&limb_suites, amount(args.effort))?;
    let selection = Selection {
        methods: args.methods.clone(),
        set: settings(&args.set)?,
    };
    // Without a suite of control steps there is nobody who could have a parameter.
    let heats = if suites.is_empty() {
        Vec::new()
    } else {
        heats(&suites, &selection, &args.variation(), scenarios(args.effort))?
    };
    if let Some(k) = args.dump_step {
        heats.iter().try_for_each(|heat| check_step(&heat.case, k))?;
    }
    let session = session(args.effort);
    let stores = match &args.out {
        Some(dir) => {
            check_folder(dir)?;
            let stores = (RowStore::open(dir)?, LimbStore::open(dir)?);
            Some(if args.effort.fresh {
                start_over(dir)?
            } else {
                stores
            })
        }
        None => None,
    };
    let (store, limb_store) = stores.unzip();
    let traces = if args.trace {
        Traces::Written
    } else {
        Traces::Dropped
    };
    let dir = args.out.clone().unwrap_or_default();
    let mut recorder = Recorder {
        store,
        dir: dir.clone(),
        traces,
        reusable: embedded.clone(),
        kept: 0,
        rows: Vec::new(),
    };
    let mut limbs = LimbRecorder {
        store: limb_store,
        dir,
        traces,
        reusable: embedded,
        kept: 0,
        rows: Vec::new(),
    };
    run_heats(&heats, &session, &mut recorder)?;
    run_limbs(&plans, &session, &mut limbs)?;
    if let Some(k) = args.dump_step {
        heats
            .iter()
            .try_for_each(|heat| dump_step(heat, k, &recorder.dir, out))?;
    }
    write!(out, "{}", summary::terminal_table(&recorder.rows))?;
    write!(out, "{}", limbs_terminal(&limbs.rows))?;
    for note in plans.iter().flat_map(Plan::notes) {
        writeln!(out, "note: {note}")?;
    }
    Ok(tell_kept(recorder.kept + limbs.kept, out)?)
}

/// What is said to the methods of a suite means nothing to a limb.
fn check_options_of_limbs(args: &RunArgs, names: &[String]) -> Result<(), InputError> {
    let given = [
        ("--method", !args.methods.is_empty()),
        ("--set", !args.set.is_empty()),
        ("--dt", args.dt.is_some()),
        ("--velocity", args.velocity.is_some()),
        ("--margin", args.margin.is_some()),
        ("--rates", args.rates.is_some()),
        ("--dump-step", args.dump_step.is_some()),
    ];
    match given.iter().find(|(_, given)| *given) {
        Some((option, _)) => {
            let allowed = "none for suites of closed-form limbs, which have no control steps";
            Err(InputError::value(&names.join(", "), option, "given", allowed))
        }
        None => Ok(()),
    }
}

/// One session knows one suite by an id, and an embedded id means the embedded suite.
fn check_ids(names: &[&String], ids: &[&str], embedded: &BTreeSet<String>) -> Result<(), InputError> {
    for (i, (name, id)) in names.iter().zip(ids).enumerate() {
        let of_file = name != id;
        if of_file && embedded.contains(*id) {
            return Err(InputError::value(
                name,
                "id",
                id,
                "an id that no embedded suite has",
            ));
        }
        if ids[..i].contains(id) {
            return Err(InputError::value(name, "id", id, "each suite once in a session"));
        }
    }
    Ok(())
}

/// A folder that holds our names without our rows is somebody else's. The default folder is ours, also where a session was
/// interrupted before its first row.
fn check_folder(dir: &Path) -> Result<(), InputError> {
    if dir == Path::new(DEFAULT_FOLDER) || [ROWS_FILE, LIMBS_FILE].iter().any(|name| dir.join(name).exists())
    {
        return Ok(());
    }
    match ["summary.md", "traces", "figures", "instances"]
        .iter()
        .find(|name| dir.join(name).exists())
    {
        Some(name) => {
            let allowed = format!("a new folder, or one with a {ROWS_FILE}");
            Err(InputError::value(
                "command line",
                "--out",
                dir.join(name).display(),
                &allowed,
            ))
        }
        None => Ok(()),
    }
}

fn scenarios(effort: EffortArgs) -> Scenarios {
    if effort.quick {
        Scenarios::Quick
    } else {
        Scenarios::All
    }
}

fn amount(effort: EffortArgs) -> Amount {
    if effort.quick { Amount::Quick } else { Amount::Full }
}

fn session(effort: EffortArgs) -> Session {
    let (timing, notes) = if effort.quick {
        (Timing::QUICK, vec![QUICK_NOTE.to_owned()])
    } else {
        (Timing::FULL, Vec::new())
    };
    Session {
        revision: revision(),
        machine: machine(),
        timing,
        notes,
    }
}

/// Rows can be built upon if this source made them on this machine with the same care.
fn is_reusable(store: &RowStore, limbs: &LimbStore, session: &Session) -> bool {
    let same = |revision: &str, machine: &Machine, notes: &[String]| {
        revision == session.revision && *machine == session.machine && !is_quick(notes)
    };
    let is_empty = store.rows().is_empty() && limbs.rows().is_empty();
    let mut rows = store.rows().iter();
    let mut limbs = limbs.rows().iter();
    is_empty
        || (is_pinned(&session.revision)
            && !is_quick(&session.notes)
            && rows.all(|row| same(&row.revision, &row.machine, &row.notes))
            && limbs.all(|row| same(&row.revision, &row.machine, &row.notes)))
}

pub(super) fn is_quick(notes: &[String]) -> bool {
    notes.iter().any(|note| note == QUICK_NOTE)
}

/// Deletes what earlier sessions left in a results folder, and only that.
fn start_over(dir: &Path) -> Result<(RowStore, LimbStore), RecordError> {
    let gone = |path: PathBuf, removed: std::io::Result<()>| match removed {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => Err(RecordError::Io {
            path,
            action: "remove",
            source,
        }),
        _ => Ok(()),
    };
    for file in [ROWS_FILE, LIMBS_FILE, "summary.md"].map(|name| dir.join(name)) {
        let removed = fs::remove_file(&file);
        gone(file, removed)?;
    }
    for (folder, ending) in [("traces", "csv"), ("figures", "svg"), ("instances", "json")] {
        let entries = fs::read_dir(dir.join(folder)).into_iter().flatten().flatten();
        for path in entries.map(|entry| entry.path()) {
            if path.extension().is_some_and(|e| e == ending) {
                let removed = fs::remove_file(&path);
                gone(path, removed)?;
            }
        }
        // A folder that holds something else stays.
        let _ = fs::remove_dir(dir.join(folder));
    }
    Ok((RowStore::open(dir)?, LimbStore::open(dir)?))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Traces {
    Written,
    Dropped,
}

/// Where rows and traces go.
struct Recorder {
    /// None: rows are shown and forgotten.
    store: Option<RowStore>,
    dir: PathBuf,
    traces: Traces,
    /// Suites that the revision pins down; one from a file may have changed since its rows were made.
    reusable: BTreeSet<String>,
    /// Runs that were not made again.
    kept: usize,
    /// The rows of this session, those found on disk among them, in the order of the plan.
    rows: Vec<Row>,
}

impl Recorder {
    /// The row of a run that need not be made again.
    fn found(&self, case: &Case, contestant: &Contestant, session: &Session) -> Option<Row> {
        let store = self
            .store
            .as_ref()
            .filter(|_| is_pinned(&session.revision) && !is_quick(&session.notes))
            .filter(|_| self.reusable.contains(&case.suite))?;
        let parameters = recorded(&contestant.parameters);
        let key = RowKey::new(
            &contestant.id,
            &parameters,
            &case.suite,
            &case.scenario,
            case.dt_s,
            0,
            &session.revision,
        );
        let complete = |row: &Row| {
            let has_trace = row
                .trace
                .as_ref()
                .is_some_and(|trace| self.dir.join(trace).exists());
            !is_quick(&row.notes) && (self.traces == Traces::Dropped || has_trace || row.metrics.is_none())
        };
        store
            .rows()
            .iter()
            .rev()
            .find(|row| RowKey::of(row) == key && complete(row))
            .cloned()
    }

    /// Writes the traces of a heat in parallel, then its rows in order.
    fn record(&mut self, case: &Case, mut finished: Vec<Finished>) -> Result<Vec<Row>, RecordError> {
        if self.traces == Traces::Written {
            finished
                .par_iter_mut()
                .with_max_len(1)
                .try_for_each(|run| self.write_trace(case, run))?;
        }
        let rows: Vec<Row> = finished.into_iter().map(|run| run.row).collect();
        if let Some(store) = &mut self.store {
            rows.iter().try_for_each(|row| store.push(row.clone()))?;
        }
        Ok(rows)
    }

    fn write_trace(&self, case: &Case, run: &mut Finished) -> Result<(), RecordError> {
        let Some(trace) = run.trace(case) else {
            return Ok(());
        };
        let relative = format!(
            "traces/{}.csv",
            file_name(case, &run.row.method, &run.row.parameters)
        );
        write_trace(&self.dir.join(&relative), &trace)?;
        run.row.trace = Some(relative);
        Ok(())
    }
}

fn tell_kept(kept: usize, out: &mut dyn Write) -> std::io::Result<()> {
    match kept {
        0 => Ok(()),
        kept => writeln!(
            out,
            "{kept} finished runs of this revision kept; --fresh makes them again"
        ),
    }
}

fn run_heats(heats: &[Heat], session: &Session, recorder: &mut Recorder) -> Result<(), RecordError> {
    let progress = Progress::of_runs(heats.iter().map(|heat| heat.contestants.len()).sum());
    for heat in heats {
        let found = |contestant| recorder.found(&heat.case, contestant, session);
        let found: Vec<Option<Row>> = heat.contestants.iter().map(found).collect();
        let pairs = heat.contestants.iter().zip(&found);
        let missing: Vec<Contestant> = pairs
            .filter(|(_, row)| row.is_none())
            .map(|(c, _)| c.clone())
            .collect();
        recorder.kept += found.len() - missing.len();
        (missing.len()..found.len()).for_each(|_| progress.run_skipped());
        let mut made = Vec::new();
        if !missing.is_empty() {
            let told = |contestant: &Contestant| progress.pass_done(&heat.case, contestant);
            made = recorder.record(&heat.case, run_case(&heat.case, &missing, session, &told))?;
        }
        let mut made = made.into_iter();
        recorder
            .rows
            .extend(found.into_iter().filter_map(|row| row.or_else(|| made.next())));
    }
    progress.finish();
    Ok(())
}

/// A name that tells runs apart and is the same every time: parameters appear where they differ from the defaults, and
/// the budget always.
fn file_name(case: &Case, id: &str, parameters: &BTreeMap<String, serde_json::Value>) -> String {
    let mut name = format!("{}_{}_{id}", case.suite.replace('/', "-"), case.scenario);
    let defaults = method(id)
        .map(|entry| recorded(&entry.defaults()))
        .unwrap_or_default();
    for (key, value) in parameters
        .iter()
        .filter(|(key, value)| *key == "n" || defaults.get(*key) != Some(value))
    {
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        name.push_str(&format!("_{key}-{value}"));
    }
    if case.dt_s.to_bits() != case.suite_dt_s.to_bits() {
        name.push_str(&format!("_dt-{}", case.dt_s));
    }
    name
}

fn check_step(case: &Case, k: usize) -> Result<(), InputError> {
    if (1..=case.samples.steps()).contains(&k) {
        return Ok(());
    }
    let allowed = format!(
        "1 .. {} on {}/{}",
        case.samples.steps(),
        case.suite,
        case.scenario
    );
    Err(InputError::value("command line", "--dump-step", k, &allowed))
}

fn dump_step(heat: &Heat, k: usize, dir: &Path, out: &mut dyn Write) -> Result<(), Failure> {
    for contestant in &heat.contestants {
        let Ok((driver, played)) = play(&heat.case, contestant) else {
            continue;
        };
        let instance = Instance::of_run(&heat.case, contestant, &played, driver.majors(), k);
        let name = file_name(&heat.case, &contestant.id, &recorded(&contestant.parameters));
        let path = dir.join("instances").join(format!("{name}_step-{k}.json"));
        let text = serde_json::to_string_pretty(&instance).map_err(std::io::Error::from)?;
        write_atomically(&path, &(text + "\n"))?;
        writeln!(out, "{}", path.display())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
