//! Driving a method through a motion, and timing it.

use super::{Played, Timing};
use crate::statistics::StepTimes;
use crate::suite::Case;
use ik_core::driver::{Driver, StepInput};
use ik_core::evaluator::Counts;
use ik_core::formulation::Termination;
use std::time::{Duration, Instant};

/// Control steps driven before the clock counts: caches and branch predictors settle within fewer.
const WARM_UP_STEPS: usize = 100;

/// One control step that was just made.
pub(super) struct Step<'a> {
    pub(super) k: usize,
    pub(super) q_prev: &'a [f64],
    pub(super) q: &'a [f64],
    pub(super) termination: Termination,
    pub(super) counts: Counts,
    pub(super) elapsed: Duration,
}

/// Drives a method from the start through steps 1 … `last`.
pub(super) fn walk(case: &Case, driver: &mut Driver, last: usize, mut each: impl FnMut(&Step<'_>)) {
    let (mut q_prev, mut v_prev) = (case.q_start.clone(), vec![0.0; case.problem.robot().nv()]);
    let majors = driver.majors();
    for k in 1..=last {
        let input = StepInput {
            q_prev: &q_prev,
            v_prev: &v_prev,
            dt_s: case.dt_s,
            phase: case.phases[k - 1],
            targets: case.samples.window(k),
            gains: case.gains_of(k),
        };
        let begin = Instant::now();
        let (termination, counts) = driver.step(&input, majors);
        let elapsed = begin.elapsed();
        each(&Step {
            k,
            q_prev: &q_prev,
            q: &driver.solution().q,
            termination,
            counts,
            elapsed,
        });
        driver.increment_into(&q_prev, &mut v_prev);
        v_prev.iter_mut().for_each(|v| *v /= case.dt_s);
        q_prev.copy_from_slice(&driver.solution().q);
    }
}

/// Step times of a run.
#[derive(Clone, Debug)]
pub(super) struct Timed {
    pub(super) step_us: Vec<f64>,
    pub(super) repeats: u32,
    /// First step whose replayed answer differed.
    pub(super) differs_at: Option<usize>,
}

impl Timed {
    /// Median over the steps (µs).
    pub(super) fn median_us(&self) -> Option<f64> {
        StepTimes::from_us(&mut self.step_us.clone()).map(|t| t.median)
    }
}

/// Replays a run for its step times and compares the answers of the first repeat.
/// Replays that every run gets: a minimum over one would be no minimum.
const LEAST_REPLAYS: u32 = 2;

pub(super) fn time(case: &Case, driver: &mut Driver, played: &Played, timing: Timing) -> Timed {
    let steps = case.samples.steps();
    driver.reset();
    walk(case, driver, steps.min(WARM_UP_STEPS), |_| {});
    let mut timed = Timed {
        step_us: vec![f64::INFINITY; steps],
        repeats: 0,
        differs_at: None,
    };
    let begin = Instant::now();
    while timed.repeats < timing.repeats && (timed.repeats < LEAST_REPLAYS || begin.elapsed() < timing.cap) {
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
