//! Secondary objectives a problem may carry: value and gradient in the joint coordinates.
//!
//! They belong to the problem, not to a method, so that every method can be asked for the same; gains arrive per step
//! and are ramped by whoever owns the clock. With gains γ a method moves the joints by `q̇₀ = −Σ γ ∇H` as far as the tasks
//! leave them free. Source: Melson, eqs. (11)–(14).
//!
//! An objective is a function of the joints alone: gradients are taken with the support held, a floating root following the
//! joints, and the root's own entries are zero. Along any motion that keeps the support where it is, such a gradient is that
//! of the value.

use crate::kinematics::Page;
use crate::kinematics::hanging::HangingTree;
use crate::problem::{Phase, ProblemError};
use crate::robot::{FrameId, Robot, Root};
use serde::{Deserialize, Serialize};

/// A secondary objective.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Objective {
    /// `½ Σ ((q − mid) / (max − min))²` over all joint coordinates (no unit), eq. (12): the *whole* range divides.
    JointCentring,
    /// `½ τᵀ W τ` with the torques τ (Nm, N) that hold the robot against gravity as a tree hanging from the phase's support,
    /// eq. (13). A fixed root is the support of its robot in every phase.
    GravityTorque {
        /// The diagonal of W, one positive number per joint coordinate; the identity if left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        weights: Option<Vec<f64>>,
    },
}

/// Where objectives are evaluated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) q: &'a [f64],
    /// One tree pass at `q`.
    pub(crate) page: &'a Page,
    pub(crate) support: Option<FrameId>,
}

/// What the gradients are made in; sized once.
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    tree: HangingTree,
    torque: Vec<f64>,
    product: Vec<f64>,
}

impl Scratch {
    pub(crate) fn new(robot: &Robot) -> Self {
        let joints = robot.coordinates().len();
        Self {
            tree: HangingTree::new(robot),
            torque: vec![0.0; joints],
            product: vec![0.0; joints],
        }
    }
}

impl Objective {
    /// Checks that the objective is defined for this robot in every phase.
    pub(crate) fn check(&self, robot: &Robot, phases: &[Phase]) -> Result<(), ProblemError> {
        match self {
            Self::JointCentring => check_ranges(robot),
            Self::GravityTorque { weights } => {
                if let Some(weights) = weights {
                    check_weights(robot, weights)?;
                }
                let hanging = |phase: &&Phase| robot.root() == Root::Floating && phase.support.is_none();
                match phases.iter().find(hanging) {
                    Some(phase) => Err(ProblemError::NoSupport {
                        phase: phase.name.clone(),
                        robot: robot.name().to_owned(),
                    }),
                    None => Ok(()),
                }
            }
        }
    }

    /// The value; adds `gain` times the gradient to `gradient` (length nv).
    pub(crate) fn add_gradient(
        &self,
        at: At<'_>,
        gain: f64,
        gradient: &mut [f64],
        scratch: &mut Scratch,
    ) -> f64 {
        let joints = &mut gradient[at.robot.root().nv()..];
        match self {
            Self::JointCentring => add_centring(at, gain, joints),
            Self::GravityTorque { weights } => add_gravity(at, weights.as_deref(), gain, joints, scratch),
        }
    }
}

/// Eq. (12), gradient `(q − mid) / (max − min)²`.
fn add_centring(at: At<'_>, gain: f64, gradient: &mut [f64]) -> f64 {
    let joints = &at.q[at.robot.root().nq()..];
    let mut value = 0.0;
    for ((c, q), g) in at.robot.coordinates().iter().zip(joints).zip(gradient) {
        let range = c.limits.upper - c.limits.lower;
        let u = (q - 0.5 * (c.limits.upper + c.limits.lower)) / range;
        value += 0.5 * u * u;
        *g += gain * u / range;
    }
    value
}

/// Eq. (13), gradient `(∂τ/∂q)ᵀ W τ`. τ is itself the gradient of the potential energy, so ∂τ/∂q is symmetric.
fn add_gravity(
    at: At<'_>,
    weights: Option<&[f64]>,
    gain: f64,
    gradient: &mut [f64],
    scratch: &mut Scratch,
) -> f64 {
    let Scratch {
        tree,
        torque,
        product,
    } = scratch;
    tree.hang(at.robot, at.page, at.support);
    tree.torques_into(at.robot, torque);
    let mut twice = 0.0;
    match weights {
        None => twice += torque.iter().map(|t| t * t).sum::<f64>(),
        Some(weights) => {
            for (t, w) in torque.iter_mut().zip(weights) {
                twice += w * *t * *t;
                *t *= w;
            }
        }
    }
    tree.torque_change_into(at.robot, at.page, torque, product);
    for (g, p) in gradient.iter_mut().zip(product) {
        *g += gain * *p;
    }
    0.5 * twice
}

fn check_ranges(robot: &Robot) -> Result<(), ProblemError> {
    let without = robot.coordinates().iter().filter(|c| {
        let range = c.limits.upper - c.limits.lower;
        !(range.is_finite() && range > 0.0)
    });
    let joints: Vec<String> = without.map(|c| c.name.clone()).collect();
    if joints.is_empty() {
        return Ok(());
    }
    Err(ProblemError::NoRange {
        robot: robot.name().to_owned(),
        joints,
    })
}

fn check_weights(robot: &Robot, weights: &[f64]) -> Result<(), ProblemError> {
    let joints = robot.coordinates();
    if weights.len() != joints.len() {
        return Err(ProblemError::TorqueWeights {
            found: format!("{} weights", weights.len()),
            allowed: format!("one for each of the {} joint coordinates", joints.len()),
        });
    }
    let good = |w: &f64| w.is_finite() && *w > 0.0;
    match weights.iter().zip(joints).find(|(w, _)| !good(w)) {
        Some((w, joint)) => Err(ProblemError::TorqueWeights {
            found: format!("{w} for joint `{}`", joint.name),
            allowed: "finite numbers above 0".to_owned(),
        }),
        None => Ok(()),
    }
}
