//! Second-order kinematics: how Jacobians change along a direction.
//!
//! For a chain, `∂J_i/∂q_k = z_k × J_i` when joint k comes before i and `z_i × J_k` when it comes after, so the
//! contraction with a vector u needs no tensor:
//!
//! ```text
//! W_k = Σ_i u_i ∂J_i/∂q_k = z_k × V_k + Ω_k × J_k,   V_k = Σ_{i ≥ k} J_i u_i,   Ω_k = Σ_{i < k} z_i u_i
//! ```
//!
//! which is O(n) per frame. `V` and `Ω` are subtree and ancestor sums; the centre of mass obeys the same rule over the
//! whole tree. The three rotations of a floating root act together at its origin: none comes before the others, so all
//! of Ω counts for each of them and none of V. `W` is the exact derivative of `J(q) u` along the velocity coordinates.

use super::Page;
use super::jacobian::joint_column;
use crate::robot::{Motion, Robot, Root};
use crate::spatial::lane::{self, AXES, Lane, ZERO};

/// Scratch of the second-order sums, one entry per joint.
#[derive(Clone, Debug)]
pub struct SecondOrder {
    omega: Vec<Lane>,
    velocity: Vec<Lane>,
}

impl SecondOrder {
    /// Scratch for `robot`.
    pub fn new(robot: &Robot) -> Self {
        let n = robot.joints().len();
        Self {
            omega: vec![ZERO; n],
            velocity: vec![ZERO; n],
        }
    }

    /// For the frame point `p` on `body`: calls `write(v, linear, angular)` with the derivatives of `J_linear u` and
    /// `J_angular u` along each velocity coordinate `v` (world axes). Contributions to a coordinate add up.
    pub(crate) fn frame(
        &mut self,
        robot: &Robot,
        page: &Page,
        (body, p): (usize, Lane),
        u: &[f64],
        mut write: impl FnMut(usize, Lane, Lane),
    ) {
        let first = robot.root().nv();
        let path = robot.path(body);
        let root_omega = root_rotation(robot, u);
        let mut omega = root_omega;
        for &i in path {
            let joint = &robot.aligned[i];
            let rate = joint.multiplier * u[first + joint.coordinate];
            self.omega[i] = omega;
            let (linear, angular) = joint_column(joint.motion, &page.bodies[i + 1], p);
            self.velocity[i] = lane::scale(linear, rate);
            omega = lane::add_scaled(omega, angular, rate);
        }
        let mut velocity = ZERO;
        for &i in path.iter().rev() {
            let joint = &robot.aligned[i];
            velocity = lane::add(velocity, self.velocity[i]);
            let (linear, angular) = joint_column(joint.motion, &page.bodies[i + 1], p);
            let change = lane::add(lane::cross(angular, velocity), lane::cross(self.omega[i], linear));
            // Only joints behind i turn with it: their share of the angular velocity is omega − omega_i − z_i u_i,
            // and z_i × z_i u_i vanishes.
            let turn = lane::cross(angular, lane::sub(omega, self.omega[i]));
            let m = joint.multiplier;
            write(
                first + joint.coordinate,
                lane::scale(change, m),
                lane::scale(turn, m),
            );
        }
        if robot.root() == Root::Floating {
            let arm = lane::sub(p, page.bodies[0].origin);
            let behind = lane::sub(omega, root_omega);
            for (k, axis) in AXES.into_iter().enumerate() {
                let column = lane::cross(axis, arm);
                let change = lane::add(lane::cross(axis, velocity), lane::cross(root_omega, column));
                write(3 + k, change, lane::cross(axis, behind));
            }
        }
    }

    /// The same for the centre of mass: calls `write(v, linear)`.
    pub(crate) fn centre_of_mass(
        &mut self,
        robot: &Robot,
        page: &Page,
        u: &[f64],
        mut write: impl FnMut(usize, Lane),
    ) {
        let first = robot.root().nv();
        let root_omega = root_rotation(robot, u);
        let mut root_velocity = ZERO;
        for (i, joint) in robot.aligned.iter().enumerate() {
            let rate = joint.multiplier * u[first + joint.coordinate];
            let (before, turning) = match joint.parent {
                0 => (root_omega, ZERO),
                parent => {
                    let j = &robot.aligned[parent - 1];
                    let rate = j.multiplier * u[first + j.coordinate];
                    let z = if j.motion == Motion::Revolute {
                        page.bodies[parent].z
                    } else {
                        ZERO
                    };
                    (self.omega[parent - 1], lane::scale(z, rate))
                }
            };
            self.omega[i] = lane::add(before, turning);
            self.velocity[i] = lane::scale(self.com_column(robot, page, i), rate);
        }
        for (i, joint) in robot.aligned.iter().enumerate().rev() {
            let velocity = self.velocity[i];
            match joint.parent {
                0 => root_velocity = lane::add(root_velocity, velocity),
                parent => self.velocity[parent - 1] = lane::add(self.velocity[parent - 1], velocity),
            }
            let z = if joint.motion == Motion::Revolute {
                page.bodies[i + 1].z
            } else {
                ZERO
            };
            let column = self.com_column(robot, page, i);
            let change = lane::add(lane::cross(z, velocity), lane::cross(self.omega[i], column));
            write(first + joint.coordinate, lane::scale(change, joint.multiplier));
        }
        if robot.root() == Root::Floating {
            let arm = lane::sub(page.com, page.bodies[0].origin);
            for (k, axis) in AXES.into_iter().enumerate() {
                let column = lane::cross(axis, arm);
                write(
                    3 + k,
                    lane::add(lane::cross(axis, root_velocity), lane::cross(root_omega, column)),
                );
            }
        }
    }

    /// Velocity of the centre of mass for a unit rate of joint `i` alone (a coordinate may drive several joints).
    fn com_column(&self, robot: &Robot, page: &Page, i: usize) -> Lane {
        let (mass, moment, pose) = (page.subtree_mass[i + 1], page.moments[i + 1], &page.bodies[i + 1]);
        let column = match robot.aligned[i].motion {
            Motion::Revolute => lane::cross(pose.z, lane::add_scaled(moment, pose.origin, -mass)),
            Motion::Prismatic => lane::scale(pose.z, mass),
        };
        lane::scale(column, page.inverse_mass)
    }
}

/// Angular velocity that the velocity `u` gives a floating root.
fn root_rotation(robot: &Robot, u: &[f64]) -> Lane {
    match robot.root() {
        Root::Fixed => ZERO,
        Root::Floating => lane::from_slice(&u[3..6]),
    }
}
