//! Gravity torques of the tree hanging from one of its frames, and how they change.
//!
//! Held at a support foot, a robot is the tree re-rooted there: a joint on the path from the root to the support moves
//! everything on the *root's* side, the opposite way; every other joint moves its own subtree. With s_j the axis so
//! signed and b_j the velocity of the first mass moment of all that joint j moves (kg m per unit rate), the potential
//! energy `U = g M z_com` has
//!
//! ```text
//! τ_j = ∂U/∂q_j = g b_j·e_z                     ∂²U/∂q_i∂q_j = g (s_i × b_j)·e_z     for i between support and j
//! ```
//!
//! (the axis of the joint nearer the support turns the other's moment; zero for unrelated branches and for a sliding i).
//! The product of this symmetric matrix with a vector y needs no matrix: `g (s_k × V_k + Ω_k × b_k)·e_z` with V_k the
//! moments b y of all joints from k outwards and Ω_k the turn s y of all joints before k, O(n) for the whole tree.
//! Source: Melson, eq. (13); the recursion is ours.

use super::Page;
use super::gravity::GRAVITY_M_S2;
use crate::robot::{FrameId, Motion, Robot, Root};
use crate::spatial::lane::{self, Lane, ZERO};

/// The tree hanging from a support. Sized once; nothing here allocates afterwards.
#[derive(Clone, Debug)]
pub struct HangingTree {
    /// b of each joint.
    moments: Vec<Lane>,
    /// Sign of each joint: −1 on the path from the root to the support.
    signs: Vec<f64>,
    /// Body that is held.
    held: usize,
    /// Angular velocity of each body while the root is held.
    turns: Vec<Lane>,
    /// `Σ b y` over each body's joint and the joints behind it.
    sums: Vec<Lane>,
}

impl HangingTree {
    /// Room for `robot`.
    pub fn new(robot: &Robot) -> Self {
        let joints = robot.joints().len();
        Self {
            moments: vec![ZERO; joints],
            signs: vec![1.0; joints],
            held: 0,
            turns: vec![ZERO; joints + 1],
            sums: vec![ZERO; joints + 1],
        }
    }

    /// Hangs the robot, at the page's configuration, from a frame; from its root if there is none, or if the root is fixed
    /// and holds the robot anyway.
    pub fn hang(&mut self, robot: &Robot, page: &Page, support: Option<FrameId>) {
        self.held = match (robot.root(), support) {
            (Root::Floating, Some(frame)) => robot.frames()[frame.0].body,
            _ => 0,
        };
        self.signs.fill(1.0);
        for &i in robot.path(self.held) {
            self.signs[i] = -1.0;
        }
        let (whole, whole_mass) = (page.moments[0], page.subtree_mass[0]);
        let joints = robot.aligned.iter().zip(&self.signs);
        for (i, ((joint, sign), b)) in joints.zip(&mut self.moments).enumerate() {
            let pose = &page.bodies[i + 1];
            let (moment, mass) = if *sign > 0.0 {
                (page.moments[i + 1], page.subtree_mass[i + 1])
            } else {
                (
                    lane::sub(whole, page.moments[i + 1]),
                    whole_mass - page.subtree_mass[i + 1],
                )
            };
            let velocity = match joint.motion {
                Motion::Revolute => lane::cross(pose.z, lane::add_scaled(moment, pose.origin, -mass)),
                Motion::Prismatic => lane::scale(pose.z, mass),
            };
            *b = lane::scale(velocity, *sign);
        }
    }

    /// Writes the torque (Nm, or N) every joint coordinate must exert to hold the robot.
    pub fn torques_into(&self, robot: &Robot, torque: &mut [f64]) {
        torque.fill(0.0);
        for (joint, b) in robot.aligned.iter().zip(&self.moments) {
            torque[joint.coordinate] += GRAVITY_M_S2 * joint.multiplier * b[2];
        }
    }

    /// Writes how the torques change along the joint velocity `y`, `(∂τ/∂q) y`, at the page [`HangingTree::hang`] was given.
    pub fn torque_change_into(&mut self, robot: &Robot, page: &Page, y: &[f64], change: &mut [f64]) {
        self.turns[0] = ZERO;
        self.sums.fill(ZERO);
        for (i, joint) in robot.aligned.iter().enumerate() {
            let rate = joint.multiplier * y[joint.coordinate];
            self.turns[i + 1] = match joint.motion {
                Motion::Revolute => lane::add_scaled(self.turns[joint.parent], page.bodies[i + 1].z, rate),
                Motion::Prismatic => self.turns[joint.parent],
            };
            self.sums[i + 1] = lane::scale(self.moments[i], rate);
        }
        for (i, joint) in robot.aligned.iter().enumerate().rev() {
            self.sums[joint.parent] = lane::add(self.sums[joint.parent], self.sums[i + 1]);
        }
        change.fill(0.0);
        for (i, joint) in robot.aligned.iter().enumerate() {
            let (b, sign) = (self.moments[i], self.signs[i]);
            let (before, outwards) = if sign > 0.0 {
                (self.turns[joint.parent], self.sums[i + 1])
            } else {
                let rate = joint.multiplier * y[joint.coordinate];
                let beyond = lane::sub(self.sums[0], self.sums[i + 1]);
                (self.turns[i + 1], lane::add_scaled(beyond, b, rate))
            };
            let mut turned = cross_z(lane::sub(before, self.turns[self.held]), b);
            if joint.motion == Motion::Revolute {
                turned += sign * cross_z(page.bodies[i + 1].z, outwards);
            }
            change[joint.coordinate] += GRAVITY_M_S2 * joint.multiplier * turned;
        }
    }
}

/// `(a × b)·e_z`.
fn cross_z(a: Lane, b: Lane) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}
