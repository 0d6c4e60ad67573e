//! Target trajectories: sums of analytic terms on single components of tasks, and a walk if there is one, sampled once on
//! the control grid.

mod gait;
mod preview_walk;
mod samples;
mod shape;
mod spline;
mod targets;
mod task_finder;
#[cfg(test)]
mod tests;

pub use gait::{Gait, GaitSpec, GaitTasks, HeightKnot, Support, Swing, Walk};
pub use preview_walk::{
    CartTable, NoGains, Plan, PreviewControl, PreviewSpec, PreviewWalk, Step, WalkSpec, WalkTasks,
};
pub use samples::{Grid, Rates, Samples};
pub use shape::Shape;
pub use spline::{CubicSpline, Curve, KnotError};
pub use targets::{Locomotion, MotionSpec, Trajectory};

pub(crate) use targets::{row_name, task_values};
