//! Static joint torques from virtual work: the potential energy's gradient less what the supports carry.
//!
//! With `g = M g₀ ∂z_com/∂v` and the support wrenches w (force and moment about each support's origin, world
//! axes), the root rows `Σ Jᵢᵀ wᵢ = g` leave w free as soon as there are two supports; the one of least
//! Euclidean norm (N and Nm mixed) is taken. Here it comes from a QR decomposition of the transposed root
//! rows, `Aᵀ = QR`, `w = Q R⁻ᵀ g`.

use super::tree::{Posture, moving_mass_kg};
use ik_core::robot::{FrameId, Robot, Root};
use nalgebra::{DMatrix, DVector};

/// Standard gravity (m/s²), acting along −z.
pub(super) const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;

/// Gradient of the potential energy along each velocity coordinate (N, Nm).
fn potential_gradient(robot: &Robot, posture: &Posture) -> DVector<f64> {
    let mut com = DMatrix::zeros(3, robot.nv());
    posture.add_com_rows(robot, 0, &mut com);
    com.row(2).transpose() * (moving_mass_kg(robot) * STANDARD_GRAVITY_M_S2)
}

/// Torque (Nm, N for a prismatic joint) of each independent coordinate that holds the robot still on
/// `supports`; a fixed root needs none and ignores them. None if the supports cannot carry a floating root
/// (there are none).
pub(super) fn static_torques(robot: &Robot, posture: &Posture, supports: &[FrameId]) -> Option<Vec<f64>> {
    let gradient = potential_gradient(robot, posture);
    let first = robot.root().nv();
    if robot.root() == Root::Fixed {
        return Some(gradient.as_slice().to_vec());
    }
    let mut jacobian = DMatrix::zeros(6 * supports.len(), robot.nv());
    for (i, &support) in supports.iter().enumerate() {
        posture.add_position_rows(robot, support, 6 * i, &mut jacobian);
        posture.add_rotation_rows(robot, support, 6 * i + 3, &mut jacobian);
    }
    let wrench = least_norm(
        jacobian.columns(0, first).into_owned(),
        gradient.rows(0, first).into_owned(),
    )?;
    let torque = gradient - jacobian.transpose() * wrench;
    Some(torque.as_slice()[first..].to_vec())
}

/// The shortest w with `Aᵀ w = b`, A of full column rank.
fn least_norm(a: DMatrix<f64>, mut b: DVector<f64>) -> Option<DVector<f64>> {
    if a.nrows() < a.ncols() {
        return None;
    }
    let qr = a.qr();
    qr.r().tr_solve_upper_triangular_mut(&mut b).then(|| qr.q() * b)
}
