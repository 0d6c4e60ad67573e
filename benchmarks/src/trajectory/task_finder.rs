//! Tasks of a problem by the names a walk gives them.

use crate::error::InputError;
use ik_core::problem::Problem;

/// Looks up tasks of a walk; `place` and `field` (the path of the table) go into messages.
#[derive(Clone, Copy, Debug)]
pub(super) struct TaskFinder<'a> {
    pub(super) problem: &'a Problem,
    pub(super) place: &'a str,
    pub(super) field: &'a str,
}

impl TaskFinder<'_> {
    /// Index of the task that `key` of the table names.
    pub(super) fn task(&self, key: &str, name: &str) -> Result<usize, InputError> {
        let tasks = self.problem.tasks();
        let found = tasks.iter().position(|task| task.name == name);
        found.ok_or_else(|| {
            let place = format!("{}: {}.tasks.{key}", self.place, self.field);
            InputError::unknown(&place, "task", name, tasks.iter().map(|task| &task.name))
        })
    }

    /// The task is of another kind than `allowed`.
    pub(super) fn wrong(&self, key: &str, name: &str, allowed: &str) -> InputError {
        let field = format!("{}.tasks.{key}", self.field);
        InputError::value(self.place, &field, format!("`{name}`"), allowed)
    }
}
