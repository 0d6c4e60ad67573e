//! The runner: plays a method through a case, once for its answers and several times for its speed.
//!
//! Answers come from an accuracy pass, parallel over methods. Times come from a timing pass that is strictly serial: the
//! whole motion is replayed a few times, and the time of a step is its minimum over the repeats, which takes out what the
//! machine does besides. Only the call of the step is between the clocks. The first repeat has to reproduce the answers
//! bit for bit; a method that does not is told on in its row.

use crate::records::{Effort, Machine, Metrics, Row, SCHEMA, TerminationRecord, Trace};
use crate::referee::{Run, StepEfforts};
use crate::statistics::StepTimes;
use crate::suite::Case;
use ik_core::driver::{Driver, StepInput};
use ik_core::evaluator::Counts;
use ik_core::formulation::Termination;
use ik_core::problem::PhaseId;
use ik_methods::registry::{Contestant, method};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// The method that step times are compared with.
pub const REFERENCE: &str = "ik1";
/// Control steps driven before the clock counts: caches and branch predictors settle within fewer.
const WARM_UP_STEPS: usize = 100;
/// The only phase of a suite's problem.
const WHOLE: PhaseId = PhaseId(0);

/// How often a motion is replayed for its step times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Replays.
    pub repeats: u32,
    /// No further replay starts after this much time on one run.
    pub cap: Duration,
}

impl Timing {
    /// For results that are kept.
    pub const FULL: Self = Self { repeats: 5, cap: Duration::from_millis(250) };
    /// For a quick look.
    pub const QUICK: Self = Self { repeats: 2, cap: Duration::from_millis(100) };
}

/// What goes into every row of a session.
#[derive(Clone, Debug)]
pub struct Session {
    /// Revision of the source.
    pub revision: String,
    /// This machine.
    pub machine: Machine,
    /// How steps are timed.
    pub timing: Timing,
    /// Remarks for every row.
    pub notes: Vec<String>,
}

/// What a method did with a case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Played {
    /// Configurations, k = 0 (the start) … N.
    pub q: Vec<Vec<f64>>,
    /// Majors of each step.
    pub majors: Vec<u32>,
    /// Minors of each step.
    pub minors: Vec<u32>,
    /// Steps by how they ended.
    pub terminations: BTreeMap<String, u32>,
    /// Steps that ended with relaxed hard rows.
    pub relaxed_steps: u32,
    /// Steps in which some joint started outside its boundary.
    pub outside_steps: u32,
}

/// A finished run.
#[derive(Clone, Debug)]
pub struct Finished {
    /// Its row.
    pub row: Row,
    /// What the method did; nothing if it declined.
    pub played: Played,
    /// Time of each step (µs).
    pub step_us: Vec<f64>,
}

impl Finished {
    /// The run over time; none if the method declined.
    pub fn trace(&self, case: &Case) -> Option<Trace> {
        let efforts =
            StepEfforts { step_us: &self.step_us, majors: &self.played.majors, minors: &self.played.minors };
        let run = judged_run(case, &self.played);
        (!self.played.q.is_empty()).then(|| case.referee.trace(&run, &efforts))
    }
}

/// A run between the accuracy and the timing pass.
struct Pending<'a> {
    contestant: &'a Contestant,
    outcome: Result<(Driver, Played), String>,
}

/// Runs methods on a case; `told` hears of every pass that is done.
pub fn run_case(
    case: &Case,
    contestants: &[Contestant],
    session: &Session,
    told: &(dyn Fn(&Contestant) + Sync),
) -> Vec<Finished> {
    let accuracy = |contestant| {
        let pending = Pending { contestant, outcome: guarded(|| play(case, contestant)) };
        told(contestant);
        pending
    };
    // One contestant per job: their costs differ a hundredfold.
    let pending: Vec<Pending<'_>> = contestants.par_iter().with_max_len(1).map(accuracy).collect();
    let mut timed: Vec<Timed> = Vec::with_capacity(pending.len());
    let mut runs = Vec::with_capacity(pending.len());
    for Pending { contestant, outcome } in pending {
        let outcome = outcome.and_then(|(mut driver, played)| {
            timed.push(guarded(|| Ok(time(case, &mut driver, &played, session.timing)))?);
            Ok((driver, played, timed.len() - 1))
        });
        told(contestant);
        runs.push((contestant, outcome));
    }
    let reference = reference_median(case, &runs, &timed, session.timing);
    let finish = |(contestant, outcome): (&Contestant, Result<(Driver, Played, usize), String>)| {
        let mut row = blank_row(case, contestant, session);
        match outcome {
            Ok((driver, played, index)) => {
                let timed = &timed[index];
                complete(&mut row, case, &driver, &played, timed, reference);
                Finished { row, played, step_us: timed.step_us.clone() }
            }
            Err(reason) => {
                row.termination = TerminationRecord::Declined { reason };
                Finished { row, played: Played::default(), step_us: Vec::new() }
            }
        }
    };
    runs.into_par_iter().with_max_len(1).map(finish).collect()
}

/// A method must not take the session down with it: a panic becomes the reason in its row.
fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        Err(format!("stopped by a panic: {}", text.unwrap_or("without a message")))
    })
}

/// The accuracy pass: prepares the method and drives it through the motion.
///
/// # Errors
/// The reason of a method that declines the problem.
pub fn play(case: &Case, contestant: &Contestant) -> Result<(Driver, Played), String> {
    let mut driver = Driver::new(contestant.formulation.as_ref(), &case.problem).map_err(|d| d.to_string())?;
    let mut played = Played { q: vec![case.q_start.clone()], ..Played::default() };
    let last = case.samples.steps();
    walk(case, &mut driver, last, |step| {
        played.outside_steps += u32::from(starts_outside(case, step.q_prev));
        played.relaxed_steps += u32::from(matches!(step.termination, Termination::HardRowsRelaxed { .. }));
        *played.terminations.entry(step.termination.word().to_owned()).or_default() += 1;
        played.majors.push(step.counts.majors);
        played.minors.push(step.counts.minors);
        played.q.push(step.q.to_vec());
    });
    Ok((driver, played))
}

fn starts_outside(case: &Case, q_prev: &[f64]) -> bool {
    let robot = case.problem.robot();
    let mut joints = robot.coordinates().iter().zip(&q_prev[robot.root().nq()..]);
    joints.any(|(c, &q)| case.problem.boundary().interval(&c.limits, q, case.dt_s).outside)
}

/// One control step that was just made.
struct Step<'a> {
    k: usize,
    q_prev: &'a [f64],
    q: &'a [f64],
    termination: Termination,
    counts: Counts,
    elapsed: Duration,
}

/// Drives a method from the start through steps 1 … `last`.
fn walk(case: &Case, driver: &mut Driver, last: usize, mut each: impl FnMut(&Step<'_>)) {
    let (mut q_prev, mut v_prev) = (case.q_start.clone(), vec![0.0; case.problem.robot().nv()]);
    let majors = driver.majors();
    for k in 1..=last {
        let input = StepInput {
            q_prev: &q_prev,
            v_prev: &v_prev,
            dt_s: case.dt_s,
            phase: WHOLE,
            targets: case.samples.window(k),
            gains: &[],
        };
        let begin = Instant::now();
        let (termination, counts) = driver.step(&input, majors);
        let elapsed = begin.elapsed();
        each(&Step { k, q_prev: &q_prev, q: &driver.solution().q, termination, counts, elapsed });
        driver.increment_into(&q_prev, &mut v_prev);
        v_prev.iter_mut().for_each(|v| *v /= case.dt_s);
        q_prev.copy_from_slice(&driver.solution().q);
    }
}

/// Step times of a run.
#[derive(Clone, Debug)]
struct Timed {
    step_us: Vec<f64>,
    repeats: u32,
    /// First step whose replayed answer differed.
    differs_at: Option<usize>,
}

impl Timed {
    fn median_us(&self) -> Option<f64> {
        StepTimes::from_us(&mut self.step_us.clone()).map(|t| t.median)
    }
}

fn time(case: &Case, driver: &mut Driver, played: &Played, timing: Timing) -> Timed {
    let steps = case.samples.steps();
    driver.reset();
    walk(case, driver, steps.min(WARM_UP_STEPS), |_| {});
    let mut timed = Timed { step_us: vec![f64::INFINITY; steps], repeats: 0, differs_at: None };
    let begin = Instant::now();
    while timed.repeats < timing.repeats && (timed.repeats == 0 || begin.elapsed() < timing.cap) {
        driver.reset();
        let first = timed.repeats == 0;
        walk(case, driver, steps, |step| {
            let least = &mut timed.step_us[step.k - 1];
            *least = least.min(step.elapsed.as_secs_f64() * 1e6);
            if first && timed.differs_at.is_none() && !same_bits(step.q, &played.q[step.k]) {
                timed.differs_at = Some(step.k);
            }
        });
        timed.repeats += 1;
    }
    timed
}

fn same_bits(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Median step time (µs) of the reference method on the case: that of its run if it competes, of an extra one otherwise.
fn reference_median(
    case: &Case,
    runs: &[(&Contestant, Result<(Driver, Played, usize), String>)],
    timed: &[Timed],
    timing: Timing,
) -> Option<f64> {
    let competing = runs.iter().find(|(contestant, outcome)| contestant.id == REFERENCE && outcome.is_ok());
    if let Some((_, Ok((_, _, index)))) = competing {
        return timed[*index].median_us();
    }
    let contestant = method(REFERENCE).ok()?.build(&toml::Table::new()).ok()?;
    let (mut driver, played) = play(case, &contestant).ok()?;
    time(case, &mut driver, &played, timing).median_us()
}

/// A parameter table as it stands in records.
pub fn recorded(parameters: &toml::Table) -> BTreeMap<String, serde_json::Value> {
    let value = |v| serde_json::to_value(v).expect("numbers and words are JSON, ranges keep them finite");
    parameters.iter().map(|(k, v)| (k.clone(), value(v))).collect()
}

fn blank_row(case: &Case, contestant: &Contestant, session: &Session) -> Row {
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
        termination: TerminationRecord::Completed { steps: BTreeMap::new() },
        notes: case.notes.iter().chain(&session.notes).cloned().collect(),
        metrics: None,
        trace: None,
    }
}

fn judged_run<'a>(case: &'a Case, played: &'a Played) -> Run<'a> {
    Run { dt_s: case.dt_s, q: &played.q, targets: case.samples.judged(), phases: &[WHOLE] }
}

fn complete(row: &mut Row, case: &Case, driver: &Driver, played: &Played, timed: &Timed, reference: Option<f64>) {
    row.termination = TerminationRecord::Completed { steps: played.terminations.clone() };
    row.notes.extend(driver.notes().iter().cloned());
    row.notes.push(format!("step times: least of {} repeats", timed.repeats));
    if let Some(k) = timed.differs_at {
        row.notes.push(format!("{NOT_REPRODUCED} at step {k}"));
    }
    let quality = case.referee.judge(&judged_run(case, played));
    row.metrics = Some(Metrics { quality, effort: effort(played, timed, reference) });
}

/// Begins the remark on a run whose replay gave other answers.
pub const NOT_REPRODUCED: &str = "the timed replay did not reproduce the answers";

fn effort(played: &Played, timed: &Timed, reference: Option<f64>) -> Effort {
    let times = StepTimes::from_us(&mut timed.step_us.clone()).unwrap_or_default();
    let mean = |counts: &[u32]| {
        let values: Vec<f64> = counts.iter().map(|&n| f64::from(n)).collect();
        crate::statistics::mean(&values).unwrap_or(0.0)
    };
    let largest = |counts: &[u32]| counts.iter().copied().max().unwrap_or(0);
    Effort {
        relaxed_steps: played.relaxed_steps,
        outside_steps: played.outside_steps,
        majors_mean: mean(&played.majors),
        majors_max: largest(&played.majors),
        minors_mean: mean(&played.minors),
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

#[cfg(test)]
mod tests;
