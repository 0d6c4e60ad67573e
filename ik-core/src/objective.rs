//! Secondary objectives a problem may carry: value and gradient in the joint coordinates.
//!
//! They belong to the problem, not to a method, so that every method can be asked for the same; gains arrive per step
//! and are ramped by whoever owns the clock.

use crate::robot::Robot;

/// A secondary objective.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Objective {
    /// `½ Σ ((q_j − m_j) / h_j)²` over joints with finite limits, m the middle and h the half of the range.
    JointCentring,
}

impl Objective {
    /// The value at `q`; adds `gain` times the gradient to `gradient` (length nv).
    pub fn add_gradient(&self, robot: &Robot, q: &[f64], gain: f64, gradient: &mut [f64]) -> f64 {
        match self {
            Self::JointCentring => {
                let joints = q[robot.root().nq()..]
                    .iter()
                    .zip(&mut gradient[robot.root().nv()..]);
                let mut value = 0.0;
                for (c, (q, g)) in robot.coordinates().iter().zip(joints) {
                    let half = 0.5 * (c.limits.upper - c.limits.lower);
                    if half.is_finite() && half > 0.0 {
                        let u = (q - 0.5 * (c.limits.upper + c.limits.lower)) / half;
                        value += 0.5 * u * u;
                        *g += gain * u / half;
                    }
                }
                value
            }
        }
    }
}
