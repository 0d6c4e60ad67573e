#![allow(
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "tests compare copies and want to stop at the first surprise"
)]

use super::*;
use crate::suite::{Selection, Suite, Variation, lineup};
use ik_core::evaluator::Evaluator;
use ik_core::formulation::{Declined, Formulation, Honours, Prepared, Solution, Stepper, Trust, Use};
use ik_core::problem::Problem;
use ik_core::step::ControlStep;
use std::sync::Arc;

const TIMING: Timing = Timing {
    repeats: 2,
    cap: Duration::from_secs(60),
};

fn session() -> Session {
    Session {
        revision: "r".into(),
        machine: Machine::default(),
        timing: TIMING,
        notes: vec!["of a test".into()],
    }
}

/// The first tenth of a second of a suite's first scenario.
fn short_case(suite: &str) -> Case {
    let mut suite = Suite::load(suite).unwrap();
    suite.scenarios[0].duration_s = 0.1;
    if let Some(walk) = &mut suite.scenarios[0].walk {
        walk.preview.horizon_s = 0.1;
    }
    Case::new(&suite, 0, &Variation::default()).unwrap()
}

fn contestants(methods: &[&str]) -> Vec<Contestant> {
    let selection = Selection {
        methods: methods.iter().map(ToString::to_string).collect(),
        ..Selection::default()
    };
    lineup(&Suite::load("coman/stretch").unwrap(), &selection).unwrap()
}

fn run(case: &Case, contestants: &[Contestant]) -> Vec<Finished> {
    run_case(case, contestants, &session(), &|_| {})
}

#[test]
fn every_registered_method_reproduces_its_answers_on_every_suite() {
    for (id, _) in crate::suite::EMBEDDED {
        let case = short_case(id);
        let all = lineup(&Suite::load("coman/squat").unwrap(), &Selection::default()).unwrap();
        for finished in run(&case, &all) {
            let told = finished
                .row
                .notes
                .iter()
                .any(|note| note.starts_with(NOT_REPRODUCED));
            assert!(!told, "{} on {id}: {:?}", finished.row.method, finished.row.notes);
        }
    }
}

#[test]
fn answers_do_not_depend_on_the_session() {
    let case = short_case("coman/asymmetric");
    let all = contestants(&["ik1", "ik4", "ik5"]);
    let alone: Vec<Finished> = all
        .iter()
        .flat_map(|c| run(&case, std::slice::from_ref(c)))
        .collect();
    for (a, b) in run(&case, &all).iter().zip(&alone) {
        assert_eq!(a.played, b.played, "{}", a.row.method);
        assert_eq!(
            a.row.metrics.as_ref().unwrap().quality,
            b.row.metrics.as_ref().unwrap().quality
        );
    }
}

#[test]
fn rows_carry_what_was_run_judged_and_counted() {
    let case = short_case("coman/squat");
    let finished = run(&case, &contestants(&["ik1", "ik4"]));
    assert_eq!(
        finished.len(),
        4,
        "ik1, and ik4 with both budgets and with literal rows"
    );
    for run in &finished {
        let metrics = run.row.metrics.as_ref().unwrap();
        assert_eq!(
            (run.row.suite.as_str(), run.row.scenario.as_str(), run.row.dt_s),
            ("coman/squat", "A", 0.005)
        );
        assert_eq!(run.row.notes[0], "of a test");
        let TerminationRecord::Completed { steps } = &run.row.termination else {
            panic!("{:?}", run.row)
        };
        assert_eq!(steps.values().sum::<u32>(), 20);
        assert_eq!((run.played.q.len(), run.step_us.len()), (21, 20));
        let effort = &metrics.effort;
        assert!(effort.step_us_min > 0.0 && effort.step_us_min <= effort.step_us_median);
        assert!(effort.step_us_median <= effort.step_us_p95 && effort.step_us_p99 <= effort.step_us_max);
        assert!(effort.majors_mean >= 1.0 && effort.majors_mean <= f64::from(effort.majors_max));
        assert!(metrics.quality.com_error_max_m.unwrap() < 1e-3);
        let trace = run.trace(&case).unwrap();
        assert_eq!(trace.rows.len(), 21);
        assert_eq!(trace.column("step_us").unwrap()[1..], run.step_us);
        assert_eq!(trace.column("LKneeSag").unwrap()[0], case.q_start[7 + 3]);
    }
    assert_eq!(
        finished[0].row.metrics.as_ref().unwrap().effort.step_ratio_to_ik1,
        Some(1.0)
    );
}

#[test]
fn the_ratio_to_the_reference_needs_no_competing_reference() {
    let case = short_case("coman/squat");
    let finished = run(&case, &contestants(&["ik4"]));
    assert!(
        finished[0]
            .row
            .metrics
            .as_ref()
            .unwrap()
            .effort
            .step_ratio_to_ik1
            .unwrap()
            > 0.0
    );
}

/// Formulations that misbehave, each in its own way.
#[derive(Clone, Copy, Debug)]
enum Odd {
    Declines,
    PanicsAtOnce,
    PanicsLater,
    Remembers,
    ReturnsNan,
}

#[derive(Debug)]
struct OddStepper {
    odd: Odd,
    calls: u32,
}

impl Formulation for Odd {
    fn prepare(&self, _: &Arc<Problem>) -> Result<Prepared, Declined> {
        match self {
            Self::Declines => return Err(Declined::Shape("it has legs".into())),
            Self::PanicsAtOnce => panic!("not prepared"),
            Self::PanicsLater | Self::Remembers | Self::ReturnsNan => {}
        }
        let honours = Honours {
            boundary: false,
            hard_rows: false,
            objective: Use::Ignored,
            allocation_free: true,
            counts: Trust::Metered,
        };
        let stepper = Box::new(OddStepper { odd: *self, calls: 0 });
        Ok(Prepared {
            stepper,
            majors: 1,
            honours,
            notes: vec!["odd".into()],
        })
    }
}

impl Stepper for OddStepper {
    fn step(&mut self, step: &ControlStep<'_>, _: &mut Evaluator, out: &mut Solution) -> Termination {
        self.calls += 1;
        out.q.copy_from_slice(step.q_prev);
        out.v.fill(0.0);
        match self.odd {
            Odd::PanicsLater if self.calls == 5 => panic!("fell over at step {}", self.calls),
            Odd::Remembers => out.q[8] += 1e-6 * f64::from(self.calls),
            Odd::ReturnsNan => out.q[9] = f64::NAN,
            _ => {}
        }
        Termination::Stepped
    }

    /// Forgets nothing, against the law.
    fn reset(&mut self) {}
}

fn odd_run(odd: Odd) -> Finished {
    let contestant = Contestant {
        id: "odd".into(),
        parameters: toml::Table::new(),
        formulation: Arc::new(odd),
    };
    let good = contestants(&["ik1"]).remove(0);
    let mut finished = run(&short_case("coman/squat"), &[contestant, good]);
    assert!(
        finished[1].row.metrics.is_some(),
        "the other method is not affected"
    );
    finished.remove(0)
}

#[test]
fn methods_that_decline_or_fall_over_are_rows() {
    for (odd, words) in [
        (Odd::Declines, "it has legs"),
        (Odd::PanicsAtOnce, "panic: not prepared"),
        (Odd::PanicsLater, "panic: fell over at step 5"),
    ] {
        let finished = odd_run(odd);
        let TerminationRecord::Declined { reason } = &finished.row.termination else {
            panic!("{finished:?}")
        };
        assert!(reason.contains(words), "{reason}");
        assert!(finished.row.metrics.is_none() && finished.trace(&short_case("coman/squat")).is_none());
    }
}

#[test]
fn a_method_whose_memory_changes_its_answers_is_told_on() {
    let notes = odd_run(Odd::Remembers).row.notes;
    assert!(
        notes
            .iter()
            .any(|note| note == &format!("{NOT_REPRODUCED} at step 1")),
        "{notes:?}"
    );
}

#[test]
fn numbers_that_are_not_finite_end_as_numerical_and_stay_out_of_the_row() {
    let row = odd_run(Odd::ReturnsNan).row;
    let TerminationRecord::Completed { steps } = &row.termination else {
        panic!("{row:?}")
    };
    assert_eq!(steps.get("numerical"), Some(&20));
    assert!(row.metrics.unwrap().quality.com_error_max_m.unwrap().is_finite());
}
