//! Closed form of any six-joint chain whose first or last three axes meet in one point.
//!
//! Reverse decoupling (Ali, Park & Lee, section III; derivation for general geometry in our notes, section 11): with the triple at
//! the base, the vector p' from the last frame to the meeting point depends on t4, t5, t6 only. `elbow` solves
//! those three from p', the spherical triple then follows from the rotation. A chain with the triple at its tip, such as an
//! industrial arm with a spherical wrist (Pieper), is the same problem for the chain read backwards:
//! (Rz(θ) Tz(d) Tx(a) Rx(α))⁻¹ is again a Denavit-Hartenberg row once every d moves to its neighbour, and the inverse of
//! the inverted pose is the pose itself. There are at most 8 solutions, 2 of the triple for each of at most 4 of t4, t5, t6.
//!
//! Singular poses. A joint that is free stays at its previous value: t1 where axes 1 and 3 coincide (sin t2 = 0 in an
//! orthogonal triple), t5 where the meeting point lies on axis 5, t6 where it lies on axis 6, both where it lies on both.
//! Branches that coincide are returned once. Not handled: skew far axes and a target at which the quartic vanishes
//! identically, so that a whole range of t4 serves; it is reported out of reach.
//!
//! For a triple at the tip read t1…t6 as −t6…−t1.

mod angle;
mod elbow;
mod skew;

use self::angle::Angle;
use self::elbow::{Elbow, ElbowFamily};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{PI, TAU};

/// Lengths up to this (m) count as zero when it is decided whether axes meet. They are neglected, so the position error of
/// a solution can reach it.
pub const MEETING_TOLERANCE_M: f64 = 1e-6;
/// Sines of twists up to this count as zero.
pub const PARALLEL_TOLERANCE: f64 = 1e-6;
/// Targets this far (m) past the boundary of reach count as on it.
pub const REACH_TOLERANCE_M: f64 = 1e-9;
/// Where three joints of the triple cannot reach an orientation (twists other than ±90°), the same for angles (rad).
const ORIENTATION_TOLERANCE_RAD: f64 = 1e-9;
/// Sine of the angle between axes 1 and 3 below which they coincide. The pose fixes it to some ε only, and t1 to ε over it;
/// keeping t1 there costs that much orientation.
const COLLINEAR: f64 = 1e-7;
/// Two solutions ±t2 of a double root closer than this are one; what is lost is second order, 1e-14.
const DOUBLE_T2: f64 = 1e-7;

/// Most solutions of one pose.
pub const MOST_SOLUTIONS: usize = 8;

/// One row of a standard Denavit-Hartenberg table: Rz(θ) Tz(d) Tx(a) Rx(α), θ being the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DhRow {
    /// Twist α between this axis and the next (rad).
    pub alpha: f64,
    /// Distance a between the two axes along their common normal (m).
    pub a: f64,
    /// Offset d along this axis (m).
    pub d: f64,
}

/// Which three axes meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Triple {
    /// Axes 1, 2, 3.
    Base,
    /// Axes 4, 5, 6.
    Tip,
}

/// How the two axes farthest from the triple (5 and 6, or 2 and 1) lie; decides which equation gives t4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FarAxes {
    /// They intersect: the distance of the meeting point gives t4 (a5 = 0).
    Meeting,
    /// They are parallel: its height along them gives t4 (sin α5 = 0).
    Parallel,
    /// Neither: a quartic in tan(t4/2).
    Skew,
}

/// Why a chain has no closed form with the triple at one end.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Misfit {
    /// An entry keeps three axes from meeting.
    #[error("row {row}: {entry} = {value} m keeps the three axes from meeting")]
    Apart {
        /// Row of the table, from 1.
        row: usize,
        /// Column, `a` or `d`.
        entry: &'static str,
        /// The entry (m).
        value: f64,
    },
    /// Two neighbouring axes of the triple are parallel.
    #[error("row {row}: sin(alpha) = {sine:e}, two axes of the triple are parallel")]
    Parallel {
        /// Row of the table, from 1.
        row: usize,
        /// sin α.
        sine: f64,
    },
    /// The axis next to the triple passes through its meeting point, so it moves nothing the triple does not.
    #[error("row {row}: the axis next to the triple passes through its meeting point")]
    FourAxesMeet {
        /// Row of the table, from 1.
        row: usize,
    },
    /// The two axes farthest from the triple coincide (a = 0 and sin α = 0).
    #[error("row {row}: the two axes farthest from the triple coincide")]
    FarAxesCoincide {
        /// Row of the table, from 1.
        row: usize,
    },
    /// The three axes outside the triple are all parallel, all meet, or two of them coincide: the meeting point keeps to
    /// a plane, a sphere or less.
    #[error("row {row}: the three axes outside the triple cannot place its meeting point in space")]
    NoElbow {
        /// Row of the table, from 1.
        row: usize,
    },
}

/// Why a table was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LimbError {
    /// NaN or infinite entry.
    #[error("row {row} is not finite")]
    NotFinite {
        /// Row of the table, from 1.
        row: usize,
    },
    /// Closed-form neither with the triple at the base nor at the tip.
    #[error("no spherical triple to solve with; at the base, {base}; at the tip, {tip}")]
    NoTriple {
        /// What keeps axes 1, 2, 3 from serving.
        base: Misfit,
        /// What keeps axes 4, 5, 6 from serving.
        tip: Misfit,
    },
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// This many solutions, at least one.
    Solved(usize),
    /// No solution.
    OutOfReach {
        /// By how much (m) the nearest branch misses the target's distance or height where an equation tells; `None` where
        /// the quartic has no real root, the orientation is out of reach, or the pose is not finite.
        excess_m: Option<f64>,
    },
}

/// Joint vectors of one pose (rad, each in (−π, π]), without allocation.
#[derive(Clone, Copy, Default)]
pub struct Solutions {
    joints: [[f64; 6]; MOST_SOLUTIONS],
    len: usize,
}

impl std::fmt::Debug for Solutions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.as_slice()).finish()
    }
}

impl Solutions {
    /// The solutions found; order follows the branches, not their distance to anything.
    pub fn as_slice(&self) -> &[[f64; 6]] {
        &self.joints[..self.len]
    }

    fn push(&mut self, joints: [f64; 6]) {
        self.joints[self.len] = joints;
        self.len += 1;
    }
}

/// A chain of six revolute joints with a spherical triple at one end, ready to be solved.
#[derive(Clone, Debug)]
pub struct GeneralLimb {
    rows: [DhRow; 6],
    triple: Triple,
    /// Twists of the three axes of the triple and those of the chain that begins with it.
    twist: [Angle; 6],
    elbow: ElbowFamily,
}

impl GeneralLimb {
    /// Finds the triple, the one at the base if there are two.
    ///
    /// d1 (base) is free, since axis 1 may carry its frame anywhere; so is all of row 6.
    ///
    /// # Errors
    /// A row that is not finite, or for both ends the first row that keeps the chain from being solved.
    pub fn new(rows: [DhRow; 6]) -> Result<Self, LimbError> {
        let finite = |row: &DhRow| row.alpha.is_finite() && row.a.is_finite() && row.d.is_finite();
        if let Some(bad) = rows.iter().position(|row| !finite(row)) {
            return Err(LimbError::NotFinite { row: bad + 1 });
        }
        let base = match Self::with_triple(rows, Triple::Base) {
            Ok(limb) => return Ok(limb),
            Err(misfit) => misfit,
        };
        Self::with_triple(rows, Triple::Tip).map_err(|tip| LimbError::NoTriple { base, tip })
    }

    fn with_triple(rows: [DhRow; 6], triple: Triple) -> Result<Self, Misfit> {
        let chain = match triple {
            Triple::Base => rows,
            Triple::Tip => backwards(&rows),
        };
        check_triple(&chain)
            .and_then(|()| ElbowFamily::new(&chain))
            .map(|elbow| Self {
                rows,
                triple,
                twist: chain.map(|row| Angle::new(row.alpha)),
                elbow,
            })
            .map_err(|misfit| match triple {
                Triple::Base => misfit,
                Triple::Tip => misfit.read_backwards(),
            })
    }

    /// Which axes meet.
    pub fn triple(&self) -> Triple {
        self.triple
    }

    /// How the two axes farthest from the triple lie.
    pub fn far_axes(&self) -> FarAxes {
        self.elbow.far_axes()
    }

    /// Pose of frame 6 in frame 0 at `joints` (rad): rotation and position (m).
    pub fn forward(&self, joints: &[f64; 6]) -> (Matrix3<f64>, Vector3<f64>) {
        let (mut rotation, mut position) = (Matrix3::identity(), Vector3::zeros());
        for (row, joint) in self.rows.iter().zip(joints) {
            let ((st, ct), (sa, ca)) = (joint.sin_cos(), row.alpha.sin_cos());
            position += rotation * Vector3::new(row.a * ct, row.a * st, row.d);
            rotation *= Matrix3::new(ct, -st * ca, st * sa, st, ct * ca, -ct * sa, 0.0, sa, ca);
        }
        (rotation, position)
    }

    /// All joint vectors that put frame 6 at `rotation` (orthonormal, not checked) and `position` (m), both in frame 0.
    ///
    /// Joints that are free at a singular pose stay at `previous` (rad). `out` is overwritten and empty unless the outcome
    /// is [`Outcome::Solved`].
    pub fn solve_into(
        &self,
        rotation: &Matrix3<f64>,
        position: &Vector3<f64>,
        previous: &[f64; 6],
        out: &mut Solutions,
    ) -> Outcome {
        out.len = 0;
        // The chain that begins with the triple: rotation of its last frame, and its triple seen from there.
        let [x, y, z] = columns(rotation);
        let (seen, centre, before) = match self.triple {
            Triple::Base => {
                let from_end = Vector3::z() * self.rows[0].d - position;
                (
                    [x, y, z],
                    Vector3::new(x.dot(&from_end), y.dot(&from_end), z.dot(&from_end)),
                    *previous,
                )
            }
            Triple::Tip => {
                let DhRow { alpha, a, d } = self.rows[5];
                let wrist = Angle::new(alpha).untwist([x, y, z]);
                let centre = position - wrist[0] * a - wrist[2] * d;
                (
                    columns(&Matrix3::from_columns(&wrist).transpose()),
                    centre,
                    mirrored(previous),
                )
            }
        };
        let untwisted = self.twist[5].untwist(seen);
        let elbows = match self.elbow.solve(&centre, &before) {
            Ok(elbows) => elbows,
            Err(excess_m) => return Outcome::OutOfReach { excess_m },
        };
        for elbow in elbows.as_slice() {
            self.orient(elbow, untwisted, before[0], out);
        }
        if self.triple == Triple::Tip {
            for joints in &mut out.joints[..out.len] {
                *joints = mirrored(joints).map(wrap);
            }
        }
        match out.len {
            0 => Outcome::OutOfReach { excess_m: None },
            len => Outcome::Solved(len),
        }
    }

    /// The two ways (one where they coincide) to turn the triple, given the other three joints.
    ///
    /// M = Rz(t1) Rx(α1) Rz(t2) Rx(α2) Rz(t3) is the rotation left for it; `untwisted` is 0R6 Rx(−α6).
    fn orient(&self, elbow: &Elbow, untwisted: Columns, previous_t1: f64, out: &mut Solutions) {
        let [first, second, third, fourth, fifth, _] = &self.twist;
        let m = elbow.t6.unturn(untwisted);
        let m = elbow.t5.unturn(fifth.untwist(m));
        let m = third.untwist(elbow.t4.unturn(fourth.untwist(m)));
        let (s1, c1, s2, c2) = (first.sin, first.cos, second.sin, second.cos);

        let scale = s1 * s2;
        let cos_t2 = (c1 * c2 - m[2].z) / scale;
        let out_of_reach = cos_t2.abs() - 1.0 > ORIENTATION_TOLERANCE_RAD / scale.abs();
        // Written so that NaN is refused too.
        if out_of_reach || cos_t2.is_nan() {
            return;
        }
        let cos_t2 = cos_t2.clamp(-1.0, 1.0);
        // |sin t2| from column 3, which has length sin t2 sin α2 along x and k23 along y before t1 turns it: precise where
        // sqrt(1 − cos² t2) is not.
        let k23 = -(c1 * s2 * cos_t2 + s1 * c2);
        let sine = m[2].x.hypot(m[2].y);
        let sin_t2 = ((sine - k23.abs()) * (sine + k23.abs())).max(0.0).sqrt() / s2.abs();
        let [t4, t5, t6] = [elbow.t4.value, elbow.t5.value, elbow.t6.value];

        if sine < COLLINEAR {
            let along = m[0].y.atan2(m[0].x);
            let bend = (c1 * sin_t2).atan2(cos_t2);
            let t1 = wrap(previous_t1);
            let t3 = if m[2].z > 0.0 {
                along - bend - t1
            } else {
                t1 + bend - along
            };
            out.push([t1, wrap(sin_t2.atan2(cos_t2)), wrap(t3), t4, t5, t6]);
            return;
        }
        let norm = sin_t2.hypot(cos_t2);
        let (sin_t2, cos_t2) = (sin_t2 / norm, cos_t2 / norm);
        let (k23, k32) = (-(c1 * s2 * cos_t2 + s1 * c2), s1 * cos_t2 * c2 + c1 * s2);
        let branches: &[f64] = if sin_t2 < DOUBLE_T2 {
            &[0.0]
        } else {
            &[sin_t2, -sin_t2]
        };
        for &sin_t2 in branches {
            let (k13, k31) = (s2 * sin_t2, s1 * sin_t2);
            let t1 = (m[2].y * k13 - m[2].x * k23).atan2(m[2].x * k13 + m[2].y * k23);
            let t3 = (k32 * m[0].z - k31 * m[1].z).atan2(k31 * m[0].z + k32 * m[1].z);
            out.push([wrap(t1), wrap(sin_t2.atan2(cos_t2)), wrap(t3), t4, t5, t6]);
        }
    }
}

/// Columns of a rotation, which products with Rz and Rx from the right combine in pairs.
type Columns = [Vector3<f64>; 3];

fn columns(matrix: &Matrix3<f64>) -> Columns {
    [0, 1, 2].map(|j| matrix.column(j).into_owned())
}

/// The angle in (−π, π].
fn wrap(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let turned = angle.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

/// Joints of the chain read backwards.
fn mirrored(joints: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|i| -joints[5 - i])
}

/// Table of the chain read backwards, whose frame 0 is frame 6 of `rows` before its a and α: row i takes α and a of row
/// 6 − i and d of row 7 − i, all negated.
fn backwards(rows: &[DhRow; 6]) -> [DhRow; 6] {
    std::array::from_fn(|i| {
        let (alpha, a) = if i < 5 {
            (-rows[4 - i].alpha, -rows[4 - i].a)
        } else {
            (0.0, 0.0)
        };
        DhRow {
            alpha,
            a,
            d: -rows[5 - i].d,
        }
    })
}

/// Whether axes 1, 2, 3 of `rows` meet and span all rotations near a regular point.
fn check_triple(rows: &[DhRow; 6]) -> Result<(), Misfit> {
    for (row, entry, value) in [(1, "a", rows[0].a), (2, "a", rows[1].a), (2, "d", rows[1].d)] {
        if value.abs() > MEETING_TOLERANCE_M {
            return Err(Misfit::Apart { row, entry, value });
        }
    }
    for (row, sine) in [(1, rows[0].alpha.sin()), (2, rows[1].alpha.sin())] {
        if sine.abs() <= PARALLEL_TOLERANCE {
            return Err(Misfit::Parallel { row, sine });
        }
    }
    Ok(())
}

impl Misfit {
    /// The same about the table that was read backwards.
    fn read_backwards(self) -> Self {
        match self {
            Self::Apart {
                row,
                entry: "d",
                value,
            } => Self::Apart {
                row: 7 - row,
                entry: "d",
                value: -value,
            },
            Self::Apart { row, entry, value } => Self::Apart {
                row: 6 - row,
                entry,
                value: -value,
            },
            Self::Parallel { row, sine } => Self::Parallel {
                row: 6 - row,
                sine: -sine,
            },
            Self::FourAxesMeet { row } => Self::FourAxesMeet { row: 6 - row },
            Self::FarAxesCoincide { row } => Self::FarAxesCoincide { row: 6 - row },
            Self::NoElbow { row } => Self::NoElbow { row: 6 - row },
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "wrapping is exact at the ends of the range")]
mod tests {
    use super::*;

    #[test]
    fn wrap_keeps_pi_and_turns_minus_pi() {
        assert_eq!(wrap(PI), PI);
        assert_eq!(wrap(-PI), PI);
        assert_eq!(wrap(0.5), 0.5);
        assert!((wrap(0.5 + 3.0 * TAU) - 0.5).abs() < 1e-14);
        assert!((wrap(-4.0) - (TAU - 4.0)).abs() < 1e-15);
    }

    /// T⁻¹ = Rx(−α6) Tx(−a6) · chain read backwards.
    #[test]
    fn the_chain_read_backwards_is_the_inverse() {
        let rows: [DhRow; 6] = std::array::from_fn(|i| DhRow {
            alpha: 0.3 + i as f64,
            a: 0.1 * (i as f64 - 2.5),
            d: 0.2 * (1.0 + i as f64),
        });
        let limb = |rows: [DhRow; 6]| GeneralLimb {
            rows,
            triple: Triple::Base,
            twist: [Angle::new(0.0); 6],
            elbow: ElbowFamily::new(&rows).unwrap(),
        };
        let joints = [0.3, -1.2, 2.0, 0.7, -0.4, 1.9];
        let (rotation, position) = limb(rows).forward(&joints);
        let (back, offset) = limb(backwards(&rows)).forward(&mirrored(&joints));
        // rotation · Rx(−α6) · back = 1, with the sum of the offsets zero.
        let twist = Matrix3::from_columns(&Angle::new(rows[5].alpha).untwist(columns(&rotation)));
        assert!((twist * back - Matrix3::identity()).norm() < 1e-14);
        let centre = position - twist.column(0) * rows[5].a + twist * offset;
        assert!(centre.norm() < 1e-14);
    }
}
