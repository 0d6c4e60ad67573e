//! Group `shootout`: one warm control step of every registered method on the first scenario of every Coman suite, in the
//! middle of the motion, methods that iterate with both usual budgets.
//!
//! The step is taken from the method's own run, so that each solves the step it would really be given. The id is
//! `suite/method`, with the budget behind it.

use benchmarks::runner::play;
use benchmarks::suite::{Case, EMBEDDED, Suite, Variation};
use criterion::{BenchmarkGroup, Criterion, criterion_group, criterion_main, measurement::WallTime};
use ik_core::configuration::difference;
use ik_core::driver::{Driver, StepInput};
use ik_core::problem::PhaseId;
use ik_methods::registry::{Contestant, METHODS};
use std::time::Duration;
use toml::Table;

/// Majors per step of methods that iterate (Faraji & Ijspeert 2017, section IV).
const BUDGETS: [i64; 2] = [3, 15];

/// A driver that has played the whole motion, and the step in its middle.
struct Ready {
    driver: Driver,
    q_prev: Vec<f64>,
    v_prev: Vec<f64>,
    k: usize,
}

impl Ready {
    fn new(case: &Case, contestant: &Contestant) -> Self {
        let (driver, played) = play(case, contestant).expect("every method takes the Coman problems");
        let k = case.samples.steps() / 2;
        let q_prev = played.q[k - 1].clone();
        let mut v_prev = difference(case.problem.robot(), &played.q[k - 2], &q_prev);
        v_prev.iter_mut().for_each(|v| *v /= case.dt_s);
        Self {
            driver,
            q_prev,
            v_prev,
            k,
        }
    }

    fn step(&mut self, case: &Case) {
        let input = StepInput {
            q_prev: &self.q_prev,
            v_prev: &self.v_prev,
            dt_s: case.dt_s,
            phase: PhaseId(0),
            targets: case.samples.window(self.k),
            gains: &[],
        };
        let majors = self.driver.majors();
        self.driver.step(&input, majors);
    }
}

fn measure(group: &mut BenchmarkGroup<'_, WallTime>, id: String, case: &Case, contestant: &Contestant) {
    // Criterion calls the closure once per sample, and not at all for what its filter leaves out.
    let mut ready = None;
    group.bench_function(id, |b| {
        let ready = ready.get_or_insert_with(|| Ready::new(case, contestant));
        b.iter(|| ready.step(case));
    });
}

fn shootout(c: &mut Criterion) {
    let mut group = c.benchmark_group("shootout");
    group
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(800))
        .sample_size(20);
    for (suite, _) in EMBEDDED.iter().filter(|(id, _)| id.starts_with("coman/")) {
        let suite = Suite::load(suite).expect("it is embedded");
        let case =
            Case::new(&suite, 0, &Variation::default()).expect("a test builds every embedded scenario");
        for entry in METHODS {
            let id = format!("{}/{}", suite.id, entry.info().id);
            if entry.iterates() {
                for n in BUDGETS {
                    let parameters = Table::from_iter([("n".to_owned(), n.into())]);
                    let contestant = entry.build(&parameters).expect("n is within its range");
                    measure(&mut group, format!("{id}/{n}"), &case, &contestant);
                }
            } else {
                let contestant = entry.build(&Table::new()).expect("defaults are allowed");
                measure(&mut group, id, &case, &contestant);
            }
        }
    }
}

criterion_group!(benches, shootout);
criterion_main!(benches);
