//! The row of a run.

use super::walk::Timed;
use super::{Passes, Played, Session, judged_run};
use crate::records::{Effort, Metrics, Row, SCHEMA, TerminationRecord};
use crate::statistics::{StepTimes, mean};
use crate::suite::Case;
use ik_methods::registry::Contestant;
use std::collections::BTreeMap;

/// A parameter table as it stands in records.
pub fn recorded(parameters: &toml::Table) -> BTreeMap<String, serde_json::Value> {
    let value = |v| serde_json::to_value(v).expect("numbers and words are JSON, ranges keep them finite");
    parameters.iter().map(|(k, v)| (k.clone(), value(v))).collect()
}

/// The row of a run before anything is known of it.
pub(super) fn blank(case: &Case, contestant: &Contestant, session: &Session) -> Row {
    Row {
        schema: SCHEMA.to_owned(),
        method: contestant.id.clone(),
        parameters: recorded(&contestant.parameters),
        suite: case.suite.clone(),
        scenario: case.scenario.clone(),
        dt_s: case.dt_s,
        seed: 0,
        revision: session.revision.clone(),
        machine: session.machine.clone(),
        termination: TerminationRecord::Completed {
            steps: BTreeMap::new(),
        },
        notes: case.notes.iter().chain(&session.notes).cloned().collect(),
        metrics: None,
        trace: None,
    }
}

/// Adds what was claimed, judged, counted and timed.
pub(super) fn complete(row: &mut Row, case: &Case, passes: &Passes, reference: Option<f64>) {
    let Passes {
        driver,
        played,
        timed,
    } = passes;
    row.termination = TerminationRecord::Completed {
        steps: played.terminations.clone(),
    };
    row.notes.extend(driver.notes().iter().cloned());
    row.notes
        .push(format!("replays for step times: {}", timed.repeats));
    if let Some(k) = timed.differs_at {
        row.notes.push(format!("{NOT_REPRODUCED} at step {k}"));
    }
    let quality = case.referee.judge(&judged_run(case, played));
    row.metrics = Some(Metrics {
        quality,
        effort: effort(played, timed, reference),
    });
}

/// Begins the remark on a run whose replay gave other answers.
pub const NOT_REPRODUCED: &str = "the timed replay did not reproduce the answers";

fn effort(played: &Played, timed: &Timed, reference: Option<f64>) -> Effort {
    let times = StepTimes::from_us(&mut timed.step_us.clone()).unwrap_or_default();
    let mean_of = |counts: &[u32]| {
        let values: Vec<f64> = counts.iter().map(|&n| f64::from(n)).collect();
        mean(&values).unwrap_or(0.0)
    };
    let largest = |counts: &[u32]| counts.iter().copied().max().unwrap_or(0);
    Effort {
        relaxed_steps: played.relaxed_steps,
        outside_steps: played.outside_steps,
        majors_mean: mean_of(&played.majors),
        majors_max: largest(&played.majors),
        minors_mean: mean_of(&played.minors),
        minors_max: largest(&played.minors),
        step_us_min: times.min,
        step_us_median: times.median,
        step_us_p95: times.p95,
        step_us_p99: times.p99,
        step_us_max: times.max,
        step_us_mean: times.mean,
        step_ratio_to_ik1: reference.filter(|r| *r > 0.0).map(|r| times.median / r),
    }
}
