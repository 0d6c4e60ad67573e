//! Which foot carries the robot.

/// The feet on the ground at a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// Both.
    Both,
    /// The right one.
    Right,
    /// The left one.
    Left,
}
