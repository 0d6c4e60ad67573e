//! Target trajectories: sums of analytic terms on single components of tasks, and a walk if there is one, sampled once on
//! the control grid.

mod gait;
mod samples;
mod shape;
mod spline;
mod targets;
#[cfg(test)]
mod tests;

pub use gait::{Gait, GaitSpec, GaitTasks, HeightKnot, Support, Swing, Walk};
pub use samples::{Grid, Rates, Samples};
pub use shape::Shape;
pub use spline::{CubicSpline, Curve, KnotError};
pub use targets::{MotionSpec, Trajectory};

pub(crate) use targets::{row_name, task_values};
