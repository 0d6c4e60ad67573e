//! Closed forms of humanoid limbs by reverse decoupling.
//!
//! A limb of six joints whose first three axes meet in one point (hip or shoulder) has its spherical part at the wrong end
//! for Pieper's decoupling. Seen from the end effector it is at the far end again: in the *inverted* pose
//! `[n' s' a' p'] = (⁰T₆)⁻¹` the vector p', the common point seen from the end effector, depends on joints 4, 5 and 6 only.
//! They follow from it, then joints 1, 2 and 3 from the rotation: eight solutions, no iteration.
//!
//! Source: Ali, Park & Lee, *Closed-form inverse kinematic joint solution for humanoid robots*; equation numbers are
//! theirs. Frames are those of the standard (distal) Denavit-Hartenberg convention,
//! `A_i = Rz(θ_i) Tz(d_i) Tx(a_i) Rx(α_i)`, poses those of frame 6 in frame 0, right limb.
//!
//! Deviation: forms that keep their precision at the ends of the range are used throughout: no arc cosine, both arguments
//! of an arc tangent multiplied by the branch sign instead of adding π, clamped roots, one wrap at the end.

pub mod analyser;
mod arm;
pub mod formulation;
pub mod general;
mod leg;
mod limb;
pub mod quartic;

pub use arm::{Arm, ArmBranch, ElbowArm};
pub use leg::{Leg, LegBranch};
pub use limb::{Limb, Unbound};

use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{PI, TAU};

/// Pose of frame 6 in frame 0 of a limb.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimbPose {
    /// Rotation.
    pub rotation: Matrix3<f64>,
    /// Position (m).
    pub position: Vector3<f64>,
}

/// Largest deviation of `RᵀR` from the identity, and of the determinant from 1, that still counts as a rotation: products
/// of some hundred rotations are off by less.
const RIGID: f64 = 1e-9;
/// A target this far past the boundary of reach (m) counts as on it.
const REACH_TOLERANCE_M: f64 = 1e-9;
/// A spherical triple whose middle joint has a sine below this is singular: its outer joints turn about one axis. The
/// position of the axis in the pose is known to some 1e-16, its direction to 1e-16 over the sine; below 1e-7 snapping to the
/// singularity costs no more than dividing by it.
const STRAIGHT_TRIPLE: f64 = 1e-7;

/// Why a limb has no solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Unsolved {
    /// The pose is no rigid motion.
    #[error(
        "the pose is not rigid: it is off by {defect} (orthogonality, determinant, or a number that is not finite)"
    )]
    NotRigid {
        /// Largest defect found; infinite if a number is not finite.
        defect: f64,
    },
    /// The common point of the first axes is too far from the end, or too near.
    #[error("out of reach: the distance is {distance_m} m, possible are {least_m} to {largest_m} m")]
    Distance {
        /// Distance found (m).
        distance_m: f64,
        /// Least possible (m).
        least_m: f64,
        /// Largest possible (m).
        largest_m: f64,
    },
    /// The distance is right, the orientation is not: the last axes fix a plane that the limb cannot leave as far.
    #[error(
        "out of reach with this orientation: {found_m} m out of the plane of the last axes, possible are {largest_m} m"
    )]
    Orientation {
        /// Distance from that plane (m).
        found_m: f64,
        /// Largest possible (m).
        largest_m: f64,
    },
    /// A limb of the general family has no solution.
    #[error("out of reach{}", .excess_m.map_or(String::new(), |excess| format!(" by {excess} m")))]
    General {
        /// By how much (m), where an equation tells.
        excess_m: Option<f64>,
    },
    /// An arm of four joints cannot take this pose: its poses are a four-dimensional set.
    #[error("an arm of four joints misses this pose by {position_m} m and {rotation_rad} rad")]
    OffSet {
        /// Largest component of the position that remains (m).
        position_m: f64,
        /// Rotation that remains (rad).
        rotation_rad: f64,
    },
}

/// Up to eight solutions with their branch numbers, without allocation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solutions<const JOINTS: usize> {
    joints: [[f64; JOINTS]; 8],
    branches: [u8; 8],
    count: usize,
}

impl<const JOINTS: usize> Default for Solutions<JOINTS> {
    fn default() -> Self {
        Self {
            joints: [[0.0; JOINTS]; 8],
            branches: [0; 8],
            count: 0,
        }
    }
}

/// Joints closer than this (rad) are the same solution.
const SAME_RAD: f64 = 1e-6;

impl<const JOINTS: usize> Solutions<JOINTS> {
    /// The solutions, in the order of branches: joints in [−π, π], branch number.
    pub fn iter(&self) -> impl Iterator<Item = (&[f64; JOINTS], u8)> {
        self.joints[..self.count].iter().zip(self.branches)
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The solution with the least largest difference from `previous` (rad, modulo full turns).
    pub fn nearest(&self, previous: &[f64; JOINTS]) -> Option<&[f64; JOINTS]> {
        let away = |joints: &[f64; JOINTS]| distance(joints, previous);
        let all = self.joints[..self.count].iter();
        all.min_by(|a, b| away(a).total_cmp(&away(b)))
    }

    fn clear(&mut self) {
        self.count = 0;
    }

    fn push(&mut self, joints: [f64; JOINTS], branch: u8) {
        self.joints[self.count] = joints;
        self.branches[self.count] = branch;
        self.count += 1;
    }

    /// Keeps the first of equal solutions.
    fn drop_repeated(&mut self) {
        let all = *self;
        self.count = 0;
        for (joints, branch) in all.iter() {
            let mut kept = self.joints[..self.count].iter();
            if !kept.any(|other| distance(other, joints) < SAME_RAD) {
                self.push(*joints, branch);
            }
        }
    }
}

/// Largest difference of two postures, modulo full turns (rad).
pub fn distance<const JOINTS: usize>(a: &[f64; JOINTS], b: &[f64; JOINTS]) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| wrap(a - b).abs());
    differences.fold(0.0, f64::max)
}

/// The angle in [−π, π] that is the same direction.
fn wrap(angle: f64) -> f64 {
    // Most angles are within: rounding is a call of a function on plain x86-64.
    if angle.abs() <= PI {
        return angle;
    }
    angle - TAU * (angle / TAU).round()
}

/// `Rz(θ) Tz(d) Tx(a) Rx(α)` applied behind a pose.
fn denavit_hartenberg(pose: &LimbPose, theta: f64, d: f64, a: f64, alpha: f64) -> LimbPose {
    let ((st, ct), (sa, ca)) = (theta.sin_cos(), alpha.sin_cos());
    let rotation = Matrix3::new(ct, -st * ca, st * sa, st, ct * ca, -ct * sa, 0.0, sa, ca);
    LimbPose {
        rotation: pose.rotation * rotation,
        position: pose.position + pose.rotation * Vector3::new(a * ct, a * st, d),
    }
}

impl LimbPose {
    /// No motion.
    pub fn identity() -> Self {
        Self {
            rotation: Matrix3::identity(),
            position: Vector3::zeros(),
        }
    }

    /// Refuses what is no rigid motion.
    fn check(&self) -> Result<(), Unsolved> {
        let r = &self.rotation;
        let finite = r.iter().chain(self.position.iter()).all(|x| x.is_finite());
        let defect = (r.tr_mul(r) - Matrix3::identity())
            .amax()
            .max((r.determinant() - 1.0).abs());
        match finite {
            false => Err(Unsolved::NotRigid {
                defect: f64::INFINITY,
            }),
            true if defect > RIGID => Err(Unsolved::NotRigid { defect }),
            true => Ok(()),
        }
    }

    /// The inverted pose `[n' s' a' p']`: columns of its rotation, and its position.
    fn inverted(&self) -> Inverted {
        let rows = self.rotation.transpose();
        Inverted {
            n: rows.column(0).into_owned(),
            s: rows.column(1).into_owned(),
            a: rows.column(2).into_owned(),
            p: -(rows * self.position),
        }
    }
}

/// `[n' s' a' p']`.
#[derive(Clone, Copy, Debug)]
struct Inverted {
    n: Vector3<f64>,
    s: Vector3<f64>,
    a: Vector3<f64>,
    p: Vector3<f64>,
}

/// The joint between two links of lengths `a` and `b` whose ends are `distance` apart.
#[derive(Clone, Copy, Debug)]
struct Hinge {
    /// Cosine, and sine of the positive solution.
    cosine: f64,
    sine: f64,
    /// The positive solution (rad), in [0, π].
    angle: f64,
}

/// The law of cosines without cancellation: `2 atan2(√((L−d)(L+d)), √((d−D)(d+D)))`, L the sum of the links, D their
/// difference.
fn hinge(a: f64, b: f64, distance: f64) -> Result<Hinge, Unsolved> {
    let (sum, difference) = (a + b, (a - b).abs());
    if !(difference - REACH_TOLERANCE_M..=sum + REACH_TOLERANCE_M).contains(&distance) {
        return Err(Unsolved::Distance {
            distance_m: distance,
            least_m: difference,
            largest_m: sum,
        });
    }
    let far = ((sum - distance).max(0.0) * (sum + distance)).sqrt();
    let near = ((distance - difference).max(0.0) * (distance + difference)).sqrt();
    // (L² − d²) + (d² − D²) = 4ab, also where a factor was clamped.
    let scale = 1.0 / (far * far + near * near);
    Ok(Hinge {
        cosine: (near * near - far * far) * scale,
        sine: 2.0 * far * near * scale,
        angle: 2.0 * far.atan2(near),
    })
}

/// Sign of an indicator, +1 for zero.
fn sign(value: f64) -> f64 {
    if value < 0.0 { -1.0 } else { 1.0 }
}

/// Number of the branch with these signs: 4 (s₄ < 0) + 2 (s₅ < 0) + (s₂ < 0).
fn branch_number(s4: f64, s5: f64, s2: f64) -> u8 {
    4 * u8::from(s4 < 0.0) + 2 * u8::from(s5 < 0.0) + u8::from(s2 < 0.0)
}

/// Joints 1, 2 and the sum or difference of a spherical triple from the entries of its rotation.
#[derive(Clone, Copy, Debug)]
struct Triple {
    /// `−C1 S2`, `−S1 S2`.
    sine_part: (f64, f64),
    /// C2.
    cosine: f64,
    /// `S2 S3`, `S2 C3` (leg: of θ3 + θ4 + θ5).
    third: (f64, f64),
    /// Entries (1,1) and (1,2), which decide where S2 = 0.
    first_row: (f64, f64),
}

impl Triple {
    /// θ1, θ2, θ3 of the branch with S2 > 0, eqs. (14)-(16), (29)-(31); θ1 stays at `previous` where S2 = 0.
    fn angles(&self, previous: f64) -> TripleAngles {
        let (vx, vy) = self.sine_part;
        let sine = vx.hypot(vy);
        let second = sine.atan2(self.cosine);
        if sine < STRAIGHT_TRIPLE {
            let (c, s) = self.first_row;
            // C2 = 1: θ1 + θ3 is known; C2 = −1: θ1 − θ3.
            let third = if self.cosine > 0.0 {
                s.atan2(c) - previous
            } else {
                previous - (-s).atan2(-c)
            };
            return TripleAngles {
                angles: (previous, second, third),
                flip: 0.0,
                sine,
            };
        }
        TripleAngles {
            angles: ((-vy).atan2(-vx), second, self.third.0.atan2(self.third.1)),
            flip: PI,
            sine,
        }
    }
}

/// A spherical triple solved for S2 > 0.
#[derive(Clone, Copy, Debug)]
struct TripleAngles {
    angles: (f64, f64, f64),
    /// What the outer joints turn by when the middle one changes its sign; nothing at the singularity.
    flip: f64,
    /// |S2|.
    sine: f64,
}

impl TripleAngles {
    /// θ1, θ2, θ3 of the branch with `s2`: (θ1 + π, −θ2, θ3 + π) for the negative one.
    fn branch(&self, s2: f64) -> (f64, f64, f64) {
        let (first, second, third) = self.angles;
        if s2 < 0.0 {
            (first + self.flip, -second, third + self.flip)
        } else {
            self.angles
        }
    }
}
