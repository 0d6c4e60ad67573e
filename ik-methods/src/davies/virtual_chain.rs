//! Assur virtual chains: serial chains of massless links between the ground and the robot that measure and impose motion
//! without changing the mobility.
//!
//! A 3P3R chain has three prismatic joints along fixed x, y, z and three revolute joints x, y, z, in that order, through
//! one point: its coordinates are the position of the point and the angles of `R = Rx(a) Ry(b) Rz(c)` (Campos, Guenther &
//! Martins 2005; Davies' method for a humanoid, section 3). Every task kind has its chain:
//!
//! | task | chain | imposed | monitored |
//! |---|---|---|---|
//! | pose of a frame | 3P3R at its origin | 6 | – |
//! | position of a frame | 3P3R at its origin | 3P | 3R |
//! | orientation of a frame | 3P3R at its origin | 3R | 3P |
//! | centre of mass | 3P | 3P | – |
//! | posture | beside each joint a virtual joint of the same screw | 1 each | – |
//!
//! Our extension: the circuit of the centre of mass is no circuit of rigid links but the mass-weighted mean of the
//! circuits to every link's centre of mass, hence exact; that of a posture has one row.

use crate::davies::{Between, OrientationRates};
use ik_core::kinematics::Page;
use ik_core::problem::{Problem, Slot};
use ik_core::robot::FrameId;
use ik_core::spatial::{rpy, so3};
use ik_core::step::{Sample, Window};
use ik_core::task::{OrientationCoordinates, Track};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Imposed motion of one chain: velocity of its point (m/s) and angular velocity (rad/s), world axes. What the task does
/// not impose is zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ImposedTwist {
    pub(super) linear: Vector3<f64>,
    pub(super) angular: Vector3<f64>,
}

/// When and how the chains of one evaluation move: τ in [0, 1] between the samples of the step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant<'a> {
    pub(super) targets: Window<'a>,
    pub(super) dt_s: f64,
    pub(super) tau: f64,
    pub(super) between: Between,
    pub(super) rates: OrientationRates,
    /// Correction rates `K (x − m)` of all tasks as [`closure_into`] wrote them at the beginning of the step. They are held
    /// during the step: measured anew at every evaluation they would only partly be made up for.
    pub(super) corrections: &'a [f64],
    /// The secondary increment of the whole step (length nv), if objectives pull.
    pub(super) secondary: Option<&'a [f64]>,
}

impl<'a> Instant<'a> {
    /// Targets that rest at zero, nothing to correct: two samples and more of zeros.
    pub(super) fn resting(problem: &Problem, zeros: &'a [f64]) -> Self {
        Self {
            targets: Window::new(zeros, problem.nx(), problem.nxdot()).expect("two whole samples"),
            dt_s: 1.0,
            tau: 0.0,
            between: Between::Line,
            rates: OrientationRates::AngularVelocity,
            corrections: &zeros[..problem.nxdot()],
            secondary: None,
        }
    }

    /// The twist that imposes the target of task `task` on its chain at the page's configuration.
    pub(super) fn twist(&self, problem: &Problem, task: usize, page: &Page) -> ImposedTwist {
        let robot = problem.robot();
        let slot = problem.slots()[task];
        let none = Vector3::zeros();
        let turn = |frame: FrameId, slot: Slot| {
            self.angular(problem.orientation(), slot, &page.frame_rotation(robot, frame))
        };
        let (linear, angular) = match problem.tasks()[task].track {
            Track::Position(_) | Track::CentreOfMass => (self.linear(slot), none),
            Track::Orientation(f) => (none, turn(f, slot)),
            Track::Pose(f) => (self.linear(slot), turn(f, angular_part(slot))),
            Track::Posture => (none, none),
        };
        ImposedTwist { linear, angular }
    }

    /// Imposed rate of the virtual joint beside joint coordinate `j` of a posture task.
    pub(super) fn joint_rate(&self, slot: Slot, j: usize) -> f64 {
        let end = |s: Sample<'_>| (s.x[slot.x + j], s.xdot[slot.xdot + j]);
        let (_, rate) = self.interpolate(end(self.targets.previous()), end(self.targets.now()));
        rate + self.corrections[slot.xdot + j]
    }

    fn correction(&self, slot: Slot) -> Vector3<f64> {
        Vector3::from_column_slice(&self.corrections[slot.xdot..slot.xdot + 3])
    }

    fn linear(&self, slot: Slot) -> Vector3<f64> {
        let at = |s: &[f64], first: usize| Vector3::from_column_slice(&s[first..first + 3]);
        let end = |s: Sample<'_>| (at(s.x, slot.x), at(s.xdot, slot.xdot));
        let (_, rate) = self.between(end(self.targets.previous()), end(self.targets.now()));
        rate + self.correction(slot)
    }

    fn angular(&self, how: OrientationCoordinates, slot: Slot, now: &Matrix3<f64>) -> Vector3<f64> {
        let end = |s: Sample<'_>| attitude(how, slot, s);
        let (before, after) = (end(self.targets.previous()), end(self.targets.now()));
        match self.rates {
            OrientationRates::AngularVelocity => self.angular_velocity(before, after) + self.correction(slot),
            OrientationRates::Euler => {
                let rate = self.euler_rates(before, after) + self.correction(slot);
                euler_axes(&euler_angles(now)) * rate
            }
        }
    }

    /// Angular velocity of the target.
    fn angular_velocity(
        &self,
        (r0, w0): (Matrix3<f64>, Vector3<f64>),
        (r1, w1): (Matrix3<f64>, Vector3<f64>),
    ) -> Vector3<f64> {
        let turn = so3::log(&(r1 * r0.transpose()));
        let end_rate = so3::left_jacobian_inverse(&turn) * w1;
        let (phi, phi_dot) = self.between((Vector3::zeros(), w0), (turn, end_rate));
        so3::left_jacobian(&phi) * phi_dot
    }

    /// Rates of the angles of the target.
    fn euler_rates(
        &self,
        (r0, w0): (Matrix3<f64>, Vector3<f64>),
        (r1, w1): (Matrix3<f64>, Vector3<f64>),
    ) -> Vector3<f64> {
        let start = euler_angles(&r0);
        let end = start + wrapped(euler_angles(&r1) - start);
        let none = Vector3::zeros();
        let (_, rate) = match self.between {
            Between::Line => self.between((start, none), (end, none)),
            Between::Hermite => {
                self.between((start, euler_rates(&start, &w0)), (end, euler_rates(&end, &w1)))
            }
        };
        rate
    }

    fn between(
        &self,
        start: (Vector3<f64>, Vector3<f64>),
        end: (Vector3<f64>, Vector3<f64>),
    ) -> (Vector3<f64>, Vector3<f64>) {
        let (mut value, mut rate) = (Vector3::zeros(), Vector3::zeros());
        for k in 0..3 {
            (value[k], rate[k]) = self.interpolate((start.0[k], start.1[k]), (end.0[k], end.1[k]));
        }
        (value, rate)
    }

    /// Value and rate at τ between two samples (value, rate).
    fn interpolate(&self, (x0, v0): (f64, f64), (x1, v1): (f64, f64)) -> (f64, f64) {
        let (t, dt) = (self.tau, self.dt_s);
        match self.between {
            Between::Line => (x0 + t * (x1 - x0), (x1 - x0) / dt),
            Between::Hermite => {
                // x0 + t (v0 + t (a + t b)) in units of the step.
                let (v0, v1, rise) = (v0 * dt, v1 * dt, x1 - x0);
                let (a, b) = (3.0 * rise - 2.0 * v0 - v1, v0 + v1 - 2.0 * rise);
                let value = x0 + t * (v0 + t * (a + t * b));
                (value, (v0 + t * (2.0 * a + 3.0 * t * b)) / dt)
            }
        }
    }
}

/// Slot of the orientation part of a pose.
fn angular_part(slot: Slot) -> Slot {
    Slot {
        x: slot.x + 3,
        xdot: slot.xdot + 3,
    }
}

/// Writes `K (x − m)` of every task of the problem into `out` (length nxdot, in slots of rates): x the targets of the
/// beginning of the step, m the chains' coordinates measured at the page's configuration `q`, K in 1/s.
pub(super) fn closure_into(
    problem: &Problem,
    (q, page): (&[f64], &Page),
    target: Sample<'_>,
    rates: OrientationRates,
    correction: f64,
    out: &mut [f64],
) {
    let robot = problem.robot();
    for (task, slot) in problem.tasks().iter().zip(problem.slots()) {
        let mut linear = |now: Vector3<f64>| {
            for k in 0..3 {
                out[slot.xdot + k] = correction * (target.x[slot.x + k] - now[k]);
            }
        };
        let turn = |frame: FrameId, slot: Slot| {
            let (wanted, _) = attitude(problem.orientation(), slot, target);
            let now = page.frame_rotation(robot, frame);
            match rates {
                OrientationRates::AngularVelocity => so3::log(&(wanted * now.transpose())),
                OrientationRates::Euler => wrapped(euler_angles(&wanted) - euler_angles(&now)),
            }
        };
        match task.track {
            Track::Position(f) => linear(page.frame_position(robot, f)),
            Track::CentreOfMass => linear(page.centre_of_mass()),
            Track::Orientation(f) => {
                let angular = turn(f, *slot) * correction;
                out[slot.xdot..slot.xdot + 3].copy_from_slice(angular.as_slice());
            }
            Track::Pose(f) => {
                linear(page.frame_position(robot, f));
                let angular = turn(f, angular_part(*slot)) * correction;
                out[slot.xdot + 3..slot.xdot + 6].copy_from_slice(angular.as_slice());
            }
            Track::Posture => {
                for (j, now) in q[robot.root().nq()..].iter().enumerate() {
                    out[slot.xdot + j] = correction * (target.x[slot.x + j] - now);
                }
            }
        }
    }
}

/// Rotation and world angular velocity of an orientation target.
fn attitude(how: OrientationCoordinates, slot: Slot, s: Sample<'_>) -> (Matrix3<f64>, Vector3<f64>) {
    let rate = Vector3::from_column_slice(&s.xdot[slot.xdot..slot.xdot + 3]);
    match how {
        OrientationCoordinates::RollPitchYaw => {
            let angles = Vector3::from_column_slice(&s.x[slot.x..slot.x + 3]);
            (
                rpy::to_matrix(&angles),
                rpy::rates_to_angular_velocity(&angles, &rate),
            )
        }
        OrientationCoordinates::Log => {
            let c = &s.x[slot.x..slot.x + 4];
            let turn = UnitQuaternion::new_normalize(Quaternion::new(c[3], c[0], c[1], c[2]));
            (turn.to_rotation_matrix().into_inner(), rate)
        }
    }
}

/// Angles (a, b, c) of the 3R part, `R = Rx(a) Ry(b) Rz(c)`, b in [−π/2, π/2] (rad).
pub(super) fn euler_angles(r: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(
        (-r[(1, 2)]).atan2(r[(2, 2)]),
        r[(0, 2)].atan2(r[(0, 0)].hypot(r[(0, 1)])),
        (-r[(0, 1)]).atan2(r[(0, 0)]),
    )
}

/// Axes of the 3R part in the world as columns: `e_x`, `Rx e_y`, `Rx Ry e_z`. Times the rates of the angles they are the
/// angular velocity, which the rates themselves are not.
pub(super) fn euler_axes(angles: &Vector3<f64>) -> Matrix3<f64> {
    let ((sa, ca), (sb, cb)) = (angles.x.sin_cos(), angles.y.sin_cos());
    Matrix3::new(1.0, 0.0, sb, 0.0, ca, -sa * cb, 0.0, sa, ca * cb)
}

/// Rates of the angles of an angular velocity; not finite at b = ±π/2, where the chain is singular.
fn euler_rates(angles: &Vector3<f64>, w: &Vector3<f64>) -> Vector3<f64> {
    let ((sa, ca), (sb, cb)) = (angles.x.sin_cos(), angles.y.sin_cos());
    let c = (ca * w.z - sa * w.y) / cb;
    Vector3::new(w.x - sb * c, ca * w.y + sa * w.z, c)
}

/// Angle differences brought into [−π, π].
fn wrapped(difference: Vector3<f64>) -> Vector3<f64> {
    difference.map(|d| d - TAU * (d / TAU).round())
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANGLES: [[f64; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [0.4, -0.9, 2.0],
        [-2.5, 1.2, -0.3],
        [3.0, 0.1, -3.0],
    ];

    fn rotation(a: &Vector3<f64>) -> Matrix3<f64> {
        let axis = |k: usize| so3::exp(&(Vector3::ith(k, a[k])));
        axis(0) * axis(1) * axis(2)
    }

    #[test]
    fn angles_axes_and_rates_belong_to_the_chain() {
        for angles in ANGLES.map(Vector3::from) {
            assert!((euler_angles(&rotation(&angles)) - angles).amax() < 1e-14);
            let rates = Vector3::new(0.3, -0.7, 0.5);
            let h = 1e-6;
            let ahead = rotation(&(angles + rates * h)) * rotation(&(angles - rates * h)).transpose();
            let w = so3::log(&ahead) / (2.0 * h);
            assert!((euler_axes(&angles) * rates - w).amax() < 1e-9, "{angles}");
            assert!((euler_rates(&angles, &w) - rates).amax() < 1e-8, "{angles}");
        }
    }

    #[test]
    fn targets_between_samples_are_a_line_or_a_cubic() {
        // x = t³ − 2t on [0, 0.1]: a cubic is met exactly.
        let (x, v) = (|t: f64| t.powi(3) - 2.0 * t, |t: f64| 3.0 * t * t - 2.0);
        let data = [x(0.0), v(0.0), x(0.1), v(0.1)];
        for tau in [0.0, 0.25, 0.5, 1.0] {
            let mut at = Instant {
                targets: Window::new(&data, 1, 1).unwrap(),
                dt_s: 0.1,
                tau,
                corrections: &[],
                secondary: None,
                between: Between::Hermite,
                rates: OrientationRates::AngularVelocity,
            };
            let ends = ((data[0], data[1]), (data[2], data[3]));
            let (value, rate) = at.interpolate(ends.0, ends.1);
            assert!((value - x(0.1 * tau)).abs() < 1e-15 && (rate - v(0.1 * tau)).abs() < 1e-13);
            at.between = Between::Line;
            let (value, rate) = at.interpolate(ends.0, ends.1);
            assert!((value - tau * x(0.1)).abs() < 1e-15 && (rate - x(0.1) / 0.1).abs() < 1e-13);
        }
    }

    #[test]
    fn both_descriptions_of_a_turn_impose_the_same_attitude_under_full_correction() {
        // From the measured attitude, one whole step at constant rates of the description ends at the target.
        let (r0, r1) = (
            rotation(&Vector3::new(0.2, -0.4, 0.7)),
            rotation(&Vector3::new(0.21, -0.39, 0.72)),
        );
        let now = rotation(&Vector3::new(0.2001, -0.4002, 0.6999));
        let dt = 0.01;
        for rates in [OrientationRates::AngularVelocity, OrientationRates::Euler] {
            let data = [0.0; 2];
            let at = Instant {
                targets: Window::new(&data, 1, 0).unwrap(),
                dt_s: dt,
                tau: 0.0,
                corrections: &[],
                secondary: None,
                between: Between::Line,
                rates,
            };
            let ends = ((r0, Vector3::zeros()), (r1, Vector3::zeros()));
            let w = match rates {
                OrientationRates::AngularVelocity => {
                    at.angular_velocity(ends.0, ends.1) + so3::log(&(r0 * now.transpose())) / dt
                }
                OrientationRates::Euler => {
                    let closure = wrapped(euler_angles(&r0) - euler_angles(&now)) / dt;
                    euler_axes(&euler_angles(&now)) * (at.euler_rates(ends.0, ends.1) + closure)
                }
            };
            let reached = so3::exp(&(w * dt)) * now;
            // What is left is of second order in the turn.
            let (turn, left) = (
                so3::log(&(r1 * r0.transpose())),
                so3::log(&(r1 * reached.transpose())),
            );
            assert!(left.norm() < turn.norm_squared(), "{rates:?}: {left}");
        }
    }
}
