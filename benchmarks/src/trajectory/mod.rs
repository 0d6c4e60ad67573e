//! Target trajectories: sums of analytic terms on single components of tasks, sampled once on the control grid.

mod gait;
mod samples;
mod shape;
mod targets;
#[cfg(test)]
mod tests;

pub use gait::Support;
pub use samples::{Grid, Rates, Samples};
pub use shape::Shape;
pub use targets::{MotionSpec, Trajectory};

pub(crate) use targets::task_values;
