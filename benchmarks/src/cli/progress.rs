//! The progress bar: what is running and how long it will take. It draws on a terminal only.

use crate::suite::Case;
use ik_methods::registry::Contestant;
use indicatif::{ProgressBar, ProgressStyle};

/// Passes over a motion per run: one for the answers, one (repeated) for the times.
const PASSES: u64 = 2;

pub(super) struct Progress {
    bar: ProgressBar,
}

impl Progress {
    pub(super) fn of_runs(runs: usize) -> Self {
        Self::of(PASSES * runs as u64)
    }

    pub(super) fn of_limbs(rows: usize) -> Self {
        Self::of(rows as u64)
    }

    fn of(steps: u64) -> Self {
        let bar = ProgressBar::new(steps);
        let style = ProgressStyle::with_template("{bar:30} {percent:>3} % {eta:>4} left  {msg}");
        bar.set_style(style.expect("the template is well formed"));
        Self { bar }
    }

    pub(super) fn pass_done(&self, case: &Case, contestant: &Contestant) {
        self.bar
            .set_message(format!("{} on {}/{}", contestant.id, case.suite, case.scenario));
        self.bar.inc(1);
    }

    pub(super) fn limb_done(&self, label: &str) {
        self.bar.set_message(label.to_owned());
        self.bar.inc(1);
    }

    /// A run that need not be made.
    pub(super) fn run_skipped(&self) {
        self.bar.inc(PASSES);
    }

    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
