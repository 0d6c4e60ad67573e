//! Static gravity torques: what the joints must hold while the robot stands still.
//!
//! With the potential energy's gradient g(q) = M g ∂z_com/∂v, equilibrium reads `g = Sᵀτ + Σ Jᵢᵀ wᵢ` over the supporting
//! frames. The six root rows determine one wrench; of several the vector of all wrenches with least Euclidean norm is
//! taken (N and Nm mixed, moments about each frame's origin, world axes), so one support carries everything.

use super::Page;
use super::jacobian::for_each_column;
use crate::robot::{FrameId, Robot, Root};
use crate::spatial::lane;
use nalgebra::{Matrix6, Vector6};

/// Standard gravity (m/s²), acting along −z.
pub const GRAVITY_M_S2: f64 = 9.806_65;

/// Why torques cannot be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GravityError {
    /// A floating robot that stands on nothing.
    #[error("a floating robot needs at least one supporting frame")]
    NoSupport,
    /// The supports' root rows are singular (never for a rigid frame; guards rounding).
    #[error("the supporting frames cannot carry the robot")]
    Singular,
}

/// Writes the torque (Nm, or N) of every independent coordinate into `torque` (length nv − root nv).
///
/// # Errors
/// [`GravityError`] if the root is floating and nothing supports it. A fixed root needs no support; supports given are
/// then ignored.
pub fn static_torques_into(
    robot: &Robot,
    page: &Page,
    supports: &[FrameId],
    torque: &mut [f64],
) -> Result<(), GravityError> {
    let weight = page.moving_mass_kg() * GRAVITY_M_S2;
    let first = robot.root().nv();
    for (t, column) in torque.iter_mut().zip(&page.com_jacobian[first..]) {
        *t = weight * column[2];
    }
    if robot.root() == Root::Fixed {
        return Ok(());
    }
    if supports.is_empty() {
        return Err(GravityError::NoSupport);
    }
    let root = Vector6::from_fn(|k, _| weight * page.com_jacobian[k][2]);
    let jacobians = supports.iter().map(|&f| RootJacobian::new(robot, page, f));
    // Least norm: w_i = R_i (Σ R_jᵀ R_j)⁻¹ g_root with R_i the 6 × 6 root columns of J_i.
    let gram = jacobians
        .clone()
        .fold(Matrix6::zeros(), |sum, j| sum + j.root.transpose() * j.root);
    let dual = gram.cholesky().ok_or(GravityError::Singular)?.solve(&root);
    for jacobian in jacobians {
        let wrench = jacobian.root * dual;
        for_each_column(
            robot,
            page,
            jacobian.body,
            jacobian.point,
            |v, linear, angular| {
                if v >= first {
                    let power = (0..3)
                        .map(|k| linear[k] * wrench[k] + angular[k] * wrench[3 + k])
                        .sum::<f64>();
                    torque[v - first] -= power;
                }
            },
        );
    }
    Ok(())
}

/// Root columns of a frame's Jacobian.
struct RootJacobian {
    body: usize,
    point: lane::Lane,
    root: Matrix6<f64>,
}

impl RootJacobian {
    fn new(robot: &Robot, page: &Page, frame: FrameId) -> Self {
        let (body, _, p) = &robot.aligned_frames[frame.0];
        let point = page.bodies[*body].point(p);
        let mut root = Matrix6::zeros();
        for_each_column(robot, page, 0, point, |v, linear, angular| {
            for k in 0..3 {
                root[(k, v)] = linear[k];
                root[(3 + k, v)] = angular[k];
            }
        });
        Self {
            body: *body,
            point,
            root,
        }
    }
}
