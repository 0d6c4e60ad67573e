//! Balance: ground projection of the centre of mass and zero-moment point against the support polygon.
//!
//! Bodies are point masses at their centres of mass, turning bodies have no inertia of their own. The moment of
//! gravity and inertia forces about a point of the ground, the plane z = 0, has no horizontal part at the
//! zero-moment point (Vukobratović & Borovac 2004)
//!
//! ```text
//! x = Σ m [(z̈ + g) x − ẍ z] / Σ m (z̈ + g),   y alike;
//! ```
//!
//! the cart (Kajita et al. 2003) puts the whole mass at the centre of mass and neglects its z̈:
//! `x = x_com − ẍ_com z_com / g`. Accelerations are central differences over samples k − 1, k, k + 1. Samples 0 and
//! N take those of their neighbours 1 and N − 1; a run of fewer than three samples has none, all are zero.
//!
//! The support polygon is the hull of the corners of the soles in support, projected along z.

use super::hull::Hull;
use super::judge::Spread;
use super::torque::STANDARD_GRAVITY_M_S2;
use super::tree::{Posture, moving_masses};
use super::{Readable, Referee};
use crate::records::Quality;
use crate::trajectory::Support;
use ik_core::robot::{FrameId, Robot};
use nalgebra::{Point3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// A foot of a robot that walks on two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Foot {
    /// The right one.
    Right,
    /// The left one.
    Left,
}

impl Foot {
    /// The other one.
    pub(crate) fn other(self) -> Self {
        match self {
            Self::Right => Self::Left,
            Self::Left => Self::Right,
        }
    }

    /// Whether it is among the feet on the ground.
    fn supports(self, support: Support) -> bool {
        match support {
            Support::Both => true,
            Support::Right => self == Self::Right,
            Support::Left => self == Self::Left,
        }
    }
}

/// What a foot stands on: a rectangle around the origin of a frame, in its x–y plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sole {
    /// The frame; x points forwards.
    pub frame: FrameId,
    /// Half of the extent along x (m).
    pub half_length_m: f64,
    /// Half of the extent along y (m).
    pub half_width_m: f64,
    /// The foot it belongs to.
    pub foot: Foot,
}

impl Sole {
    /// The corners on the ground (m, world).
    fn corners(&self, robot: &Robot, posture: &Posture) -> [Vector2<f64>; 4] {
        let pose = posture.frame(robot, self.frame);
        [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(x, y)| {
            let corner = Point3::new(x * self.half_length_m, y * self.half_width_m, 0.0);
            (pose * corner).coords.xy()
        })
    }
}

/// A body as this file sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointMass {
    pub(super) mass_kg: f64,
    /// Where it is (m, world).
    pub(super) at: Vector3<f64>,
    /// Its acceleration (m/s², world).
    pub(super) acceleration: Vector3<f64>,
}

/// Zero-moment point (m, on the ground). None where the ground would have to pull, or carries nothing.
pub(super) fn zero_moment_point(masses: &[PointMass]) -> Option<Vector2<f64>> {
    let (mut moment, mut force) = (Vector2::zeros(), 0.0);
    for mass in masses {
        let lift = mass.mass_kg * (mass.acceleration.z + STANDARD_GRAVITY_M_S2);
        moment += mass.at.xy() * lift - mass.acceleration.xy() * (mass.mass_kg * mass.at.z);
        force += lift;
    }
    (force > 0.0).then(|| moment / force)
}

/// Centre of mass (m, world) and its acceleration (m/s²); zeros without mass.
fn total(masses: &[PointMass]) -> (Vector3<f64>, Vector3<f64>) {
    let mass_kg: f64 = masses.iter().map(|m| m.mass_kg).sum();
    let mean = |value: fn(&PointMass) -> Vector3<f64>| {
        masses
            .iter()
            .map(|m| value(m) * (m.mass_kg / mass_kg))
            .sum::<Vector3<f64>>()
    };
    (mean(|m| m.at), mean(|m| m.acceleration))
}

/// Zero-moment point of the cart (m, on the ground).
pub(super) fn cart_zero_moment_point(masses: &[PointMass]) -> Vector2<f64> {
    let (com, acceleration) = total(masses);
    com.xy() - acceleration.xy() * (com.z / STANDARD_GRAVITY_M_S2)
}

/// Samples whose second difference is taken at sample k of `count`.
fn neighbours(k: usize, count: usize) -> [usize; 3] {
    if count < 3 {
        return [k; 3];
    }
    let middle = k.clamp(1, count - 2);
    [middle - 1, middle, middle + 1]
}

/// Every body with mass at sample k.
fn point_masses(robot: &Robot, postures: &[Posture], k: usize, dt_s: f64) -> Vec<PointMass> {
    let bodies = |i: usize| moving_masses(robot, &postures[i].bodies);
    let [before, middle, after] = neighbours(k, postures.len()).map(bodies);
    let second = before
        .zip(middle)
        .zip(after)
        .map(|(((_, _, before), (_, _, middle)), (_, _, after))| {
            (before - middle * 2.0 + after) / (dt_s * dt_s)
        });
    bodies(k)
        .zip(second)
        .map(|((_, mass_kg, at), acceleration)| PointMass {
            mass_kg,
            at,
            acceleration,
        })
        .collect()
}

/// Points on the ground and the support polygon at one sample (m, world).
#[derive(Clone, Debug)]
pub(super) struct Balance {
    pub(super) gcom: Vector2<f64>,
    pub(super) zmp: Option<Vector2<f64>>,
    pub(super) cart_zmp: Vector2<f64>,
    pub(super) polygon: Hull,
}

impl Balance {
    fn new(referee: &Referee, readable: &Readable<'_>, k: usize, dt_s: f64) -> Self {
        let robot = referee.problem.robot();
        let posture = &readable.postures[k];
        let masses = point_masses(robot, &readable.postures, k, dt_s);
        let carrying = referee
            .spec
            .soles
            .iter()
            .filter(|sole| sole.foot.supports(readable.samples[k].support));
        Self {
            gcom: posture.com.xy(),
            zmp: zero_moment_point(&masses),
            cart_zmp: cart_zero_moment_point(&masses),
            polygon: Hull::new(carrying.flat_map(|sole| sole.corners(robot, posture)).collect()),
        }
    }

    pub(super) fn gcom_margin_m(&self) -> f64 {
        self.polygon.signed_distance(&self.gcom)
    }

    pub(super) fn cart_zmp_margin_m(&self) -> f64 {
        self.polygon.signed_distance(&self.cart_zmp)
    }

    pub(super) fn zmp_margin_m(&self) -> Option<f64> {
        self.zmp.map(|zmp| self.polygon.signed_distance(&zmp))
    }
}

/// Balance at every sample; empty if the suite names no soles.
pub(super) fn balance(referee: &Referee, readable: &Readable<'_>, dt_s: f64) -> Vec<Balance> {
    if referee.spec.soles.is_empty() {
        return Vec::new();
    }
    (0..readable.samples.len())
        .map(|k| Balance::new(referee, readable, k, dt_s))
        .collect()
}

pub(super) fn judge_balance(referee: &Referee, readable: &Readable<'_>, dt_s: f64, quality: &mut Quality) {
    let samples = balance(referee, readable, dt_s);
    // The ends have no central difference of their own.
    let inner = samples
        .get(1..samples.len().saturating_sub(1))
        .unwrap_or_default();
    let least = |margins: Vec<f64>| margins.into_iter().reduce(f64::min);
    quality.gcom_margin_min_m = least(samples.iter().map(Balance::gcom_margin_m).collect());
    quality.cart_zmp_margin_min_m = least(inner.iter().map(Balance::cart_zmp_margin_m).collect());
    // One sample without a zero-moment point leaves no least margin: the robot could not have done this.
    quality.zmp_margin_min_m = inner
        .iter()
        .map(Balance::zmp_margin_m)
        .collect::<Option<_>>()
        .and_then(least);
    quality.zmp_gcom_distance_rms_m = distance_rms(inner);
}

/// RMS distance (m) of the zero-moment point from the projected centre of mass; none if there is not one at every
/// sample.
fn distance_rms(samples: &[Balance]) -> Option<f64> {
    let mut distance = Spread::default();
    for sample in samples {
        distance.add((sample.zmp? - sample.gcom).norm());
    }
    distance.rms()
}
