//! The runner: plays a method through a case, once for its answers and several times for its speed.
//!
//! Answers come from an accuracy pass, parallel over methods. Times come from a timing pass that is strictly serial: the
//! whole motion is replayed a few times, and the time of a step is its minimum over the repeats, which takes out what the
//! machine does besides. Only the call of the step is between the clocks. The first repeat has to reproduce the answers
//! bit for bit; a method that does not is told on in its row.

mod row;
mod walk;

pub use row::{NOT_REPRODUCED, recorded};

use crate::records::{Machine, Row, TerminationRecord, Trace};
use crate::referee::{Run, StepEfforts};
use crate::suite::Case;
use ik_core::driver::Driver;
use ik_core::formulation::Termination;
use ik_methods::registry::{Contestant, method};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;
use walk::{Timed, time, walk};

/// The method that step times are compared with.
pub const REFERENCE: &str = "ik1";

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
    pub const FULL: Self = Self {
        repeats: 5,
        cap: Duration::from_millis(150),
    };
    /// For a quick look.
    pub const QUICK: Self = Self {
        repeats: 2,
        cap: Duration::from_millis(50),
    };
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
    /// The run over time, at the samples that the suite keeps; none if the method declined.
    pub fn trace(&self, case: &Case) -> Option<Trace> {
        let efforts = StepEfforts {
            step_us: &self.step_us,
            majors: &self.played.majors,
            minors: &self.played.minors,
        };
        let run = judged_run(case, &self.played);
        if self.played.q.is_empty() {
            return None;
        }
        let mut trace = case.referee.trace(&run, &efforts);
        let (mut k, last) = (0, trace.rows.len().saturating_sub(1));
        trace.rows.retain(|_| {
            k += 1;
            (k - 1) % case.trace_every == 0 || k - 1 == last
        });
        Some(trace)
    }
}

/// A method on its way through a case: what it has to show, or why it has nothing.
struct Entrant<'a, T> {
    contestant: &'a Contestant,
    outcome: Result<T, String>,
}

/// Both passes of a method.
struct Passes {
    driver: Driver,
    played: Played,
    timed: Timed,
}

/// Runs methods on a case; `told` hears of every pass that is done.
pub fn run_case(
    case: &Case,
    contestants: &[Contestant],
    session: &Session,
    told: &(dyn Fn(&Contestant) + Sync),
) -> Vec<Finished> {
    let accuracy = |contestant| {
        let outcome = guarded(|| play(case, contestant));
        told(contestant);
        Entrant { contestant, outcome }
    };
    // One contestant per job: their costs differ a hundredfold.
    let played: Vec<Entrant<'_, _>> = contestants.par_iter().with_max_len(1).map(accuracy).collect();
    let mut entrants = Vec::with_capacity(played.len());
    for Entrant { contestant, outcome } in played {
        let outcome = outcome.and_then(|pass| guarded(|| Ok(timed(case, pass, session.timing))));
        told(contestant);
        entrants.push(Entrant { contestant, outcome });
    }
    let reference = reference_median(case, &entrants, session.timing);
    let finish = |entrant| finish(case, entrant, session, reference);
    entrants.into_par_iter().with_max_len(1).map(finish).collect()
}

fn timed(case: &Case, (mut driver, played): (Driver, Played), timing: Timing) -> Passes {
    let timed = time(case, &mut driver, &played, timing);
    Passes {
        driver,
        played,
        timed,
    }
}

fn finish(case: &Case, entrant: Entrant<'_, Passes>, session: &Session, reference: Option<f64>) -> Finished {
    let mut row = row::blank(case, entrant.contestant, session);
    match entrant.outcome {
        Ok(passes) => {
            row::complete(&mut row, case, &passes, reference);
            Finished {
                row,
                played: passes.played,
                step_us: passes.timed.step_us,
            }
        }
        Err(reason) => {
            row.termination = TerminationRecord::Declined { reason };
            Finished {
                row,
                played: Played::default(),
                step_us: Vec::new(),
            }
        }
    }
}

/// A method must not take the session down with it: a panic becomes the reason in its row.
fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        Err(format!(
            "stopped by a panic: {}",
            text.unwrap_or("without a message")
        ))
    })
}

/// The accuracy pass: prepares the method and drives it through the motion.
///
/// # Errors
/// The reason of a method that declines the problem.
pub fn play(case: &Case, contestant: &Contestant) -> Result<(Driver, Played), String> {
    let mut driver =
        Driver::new(contestant.formulation.as_ref(), &case.problem).map_err(|d| d.to_string())?;
    let mut played = Played {
        q: vec![case.q_start.clone()],
        ..Played::default()
    };
    let last = case.samples.steps();
    walk(case, &mut driver, last, |step| {
        played.outside_steps += u32::from(starts_outside(case, step.q_prev));
        played.relaxed_steps += u32::from(matches!(step.termination, Termination::HardRowsRelaxed { .. }));
        *played
            .terminations
            .entry(step.termination.word().to_owned())
            .or_default() += 1;
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

/// Median step time (µs) of the reference method on the case: that of its run if it competes, of an extra one otherwise.
fn reference_median(case: &Case, entrants: &[Entrant<'_, Passes>], timing: Timing) -> Option<f64> {
    let mut competing = entrants.iter().filter(|e| e.contestant.id == REFERENCE);
    if let Some(passes) = competing.find_map(|e| e.outcome.as_ref().ok()) {
        return passes.timed.median_us();
    }
    let contestant = method(REFERENCE).ok()?.build(&toml::Table::new()).ok()?;
    let (mut driver, played) = play(case, &contestant).ok()?;
    time(case, &mut driver, &played, timing).median_us()
}

fn judged_run<'a>(case: &'a Case, played: &'a Played) -> Run<'a> {
    Run {
        dt_s: case.dt_s,
        q: &played.q,
        targets: case.samples.judged(),
        phases: &case.phases,
        support: &case.support,
        walk: case.walk.as_ref(),
    }
}

#[cfg(test)]
mod tests;
