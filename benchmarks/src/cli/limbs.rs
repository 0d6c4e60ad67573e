//! The limb suites of a session: plan, run limb by limb, record.
//!
//! Rows of a limb are written together, so an interrupted session loses one limb at most.

use super::progress::Progress;
use super::run::{Traces, is_quick};
use crate::error::InputError;
use crate::limbs::{Amount, Job, LimbRow, LimbStore, LimbSuite, Made, Plan};
use crate::machine::is_pinned;
use crate::records_io::{RecordError, write_trace};
use crate::runner::Session;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Checks the suites.
pub(super) fn plans(suites: &[LimbSuite], amount: Amount) -> Result<Vec<Plan>, InputError> {
    suites.iter().map(|suite| Plan::new(suite, amount)).collect()
}

/// Where the rows of limbs go.
pub(super) struct LimbRecorder {
    /// None: rows are shown and forgotten.
    pub(super) store: Option<LimbStore>,
    pub(super) dir: PathBuf,
    pub(super) traces: Traces,
    /// Suites that the revision pins down.
    pub(super) reusable: BTreeSet<String>,
    /// Rows that were not made again.
    pub(super) kept: usize,
    /// The rows of this session, in the order of the plan.
    pub(super) rows: Vec<LimbRow>,
}

impl LimbRecorder {
    fn found(&self, plan: &Plan, job: &Job, session: &Session) -> Option<LimbRow> {
        let store = self
            .store
            .as_ref()
            .filter(|_| is_pinned(&session.revision) && !is_quick(&session.notes))
            .filter(|_| self.reusable.contains(&plan.suite().id))?;
        let row = store.find(&plan.key(job, &session.revision))?;
        let has_trace = row.trace.as_ref().is_some_and(|t| self.dir.join(t).exists());
        let needs_trace = self.traces == Traces::Written && plan.is_traced(job);
        (!is_quick(&row.notes) && row.machine == session.machine && (has_trace || !needs_trace))
            .then(|| row.clone())
    }

    fn finished(&self, made: Made) -> Result<LimbRow, RecordError> {
        let Made { mut row, trace } = made;
        if let Some(trace) = trace.filter(|_| self.traces == Traces::Written) {
            let name = [&row.suite, &row.robot, &row.limb, &row.set].map(|part| part.replace('/', "-"));
            let relative = format!("traces/{}.csv", name.join("_"));
            write_trace(&self.dir.join(&relative), &trace)?;
            row.trace = Some(relative);
        }
        Ok(row)
    }
}

/// Runs the plans; rows found on disk are not made again.
pub(super) fn run_limbs(
    plans: &[Plan],
    session: &Session,
    recorder: &mut LimbRecorder,
) -> Result<(), RecordError> {
    let progress = Progress::of_limbs(plans.iter().map(|plan| plan.jobs().len()).sum());
    for plan in plans {
        for jobs in plan.jobs().chunk_by(|a, b| a.is_of_limb(b)) {
            let mut made = Vec::new();
            for job in jobs {
                progress.limb_done(&plan.label(job));
                if let Some(row) = recorder.found(plan, job, session) {
                    recorder.kept += 1;
                    recorder.rows.push(row);
                    continue;
                }
                let row = recorder.finished(plan.make(job, session))?;
                made.push(row.clone());
                recorder.rows.push(row);
            }
            if let Some(store) = recorder.store.as_mut().filter(|_| !made.is_empty()) {
                store.add(&made)?;
            }
        }
    }
    progress.finish();
    Ok(())
}
