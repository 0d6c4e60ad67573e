//! The leg: hip yaw, roll and pitch through one point, knee and ankle pitch parallel to hip pitch, ankle roll.

use super::{
    Hinge, Inverted, LimbPose, REACH_TOLERANCE_M, Solutions, Triple, TripleAngles, Unsolved, branch_number,
    denavit_hartenberg, hinge, sign, wrap,
};
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// Lengths of a leg (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// l3.
    pub thigh_m: f64,
    /// l4.
    pub shank_m: f64,
    /// l5, ankle to sole.
    pub ankle_m: f64,
    /// d3 along the hip-pitch axis (HRP-2; its left leg has the other sign).
    pub hip_offset_m: f64,
}

/// One of the eight postures of a leg, by the signs of its indicators.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegBranch {
    /// KNEE: sign of sin θ4.
    pub knee: f64,
    /// ANKLE: sign of K, the height of the hip over the ankle along its last link.
    pub ankle: f64,
    /// HIP: sign of sin θ2.
    pub hip: f64,
}

impl LegBranch {
    /// The branch of that number, 4 (knee < 0) + 2 (ankle < 0) + (hip < 0).
    pub fn numbered(number: u8) -> Self {
        let sign = |bit: u8| if number & bit == 0 { 1.0 } else { -1.0 };
        Self {
            knee: sign(4),
            ankle: sign(2),
            hip: sign(1),
        }
    }

    /// Its number.
    pub fn number(&self) -> u8 {
        branch_number(self.knee, self.ankle, self.hip)
    }
}

/// A hip centre this near the last axis, as part of the stretched leg, leaves θ6 free. The distance itself is compared,
/// not its square, whose rounding would catch poses 1e-5 away. With an offset |K| is compared instead: below this it is the
/// root of what rounding leaves of the pose, and the error of θ6, |K| / d3, would spread over a hip at S2 = 0.
const ON_ANKLE_AXIS: f64 = 1e-7;
/// Sines above this are of distinct branches.
const MERGING: f64 = 1e-5;

/// What the branches of one pose share: the knee, and where the hip is as the sole sees it.
struct Shared {
    x: f64,
    /// Distance of the hip from the last axis.
    across: f64,
    /// |K|.
    k: f64,
    knee: Hinge,
    /// ψ of a positive knee.
    psi: f64,
    /// Whether θ6 is free.
    free: bool,
    /// Whether θ5 is.
    folded: bool,
}

/// Joints 4, 5 and 6 of two branches that differ in the knee's sign, and the hip of both.
struct Lower {
    knee: f64,
    psi: f64,
    /// θ5 + ψ.
    sum: f64,
    /// θ6.
    sixth: f64,
    hip: TripleAngles,
}

impl Leg {
    /// Pose of the sole (frame 6) in the hip (frame 0) of joint angles (rad).
    pub fn forward(&self, q: &[f64; 6]) -> LimbPose {
        let rows = [
            (0.0, 0.0, FRAC_PI_2),
            (0.0, 0.0, -FRAC_PI_2),
            (self.hip_offset_m, self.thigh_m, 0.0),
            (0.0, self.shank_m, 0.0),
            (0.0, 0.0, FRAC_PI_2),
            (0.0, self.ankle_m, 0.0),
        ];
        let step = |pose: LimbPose, (theta, row): (&f64, (f64, f64, f64))| {
            denavit_hartenberg(&pose, *theta, row.0, row.1, row.2)
        };
        q.iter().zip(rows).fold(LimbPose::identity(), step)
    }

    /// Decision indicators of joint angles, zeros counting as positive.
    pub fn branch(&self, q: &[f64; 6]) -> LegBranch {
        let k = (q[3] + q[4]).cos() * self.thigh_m + q[4].cos() * self.shank_m;
        LegBranch {
            knee: sign(q[3].sin()),
            ankle: sign(k),
            hip: sign(q[1].sin()),
        }
    }

    /// The joint angles of one branch. Where the geometry leaves a joint free it stays at `previous`.
    ///
    /// # Errors
    /// A pose that is not rigid or not within reach.
    pub fn solve(
        &self,
        pose: &LimbPose,
        branch: LegBranch,
        previous: &[f64; 6],
    ) -> Result<[f64; 6], Unsolved> {
        pose.check()?;
        let inverted = pose.inverted();
        let lower = self.lower(&inverted, &self.shared(&inverted)?, branch.ankle, previous);
        Ok(lower.joints(branch.knee, branch.hip))
    }

    /// Writes all distinct solutions; see [`Leg::solve`].
    ///
    /// # Errors
    /// A pose that is not rigid or not within reach; then there are no solutions.
    pub fn solve_all(
        &self,
        pose: &LimbPose,
        previous: &[f64; 6],
        out: &mut Solutions<6>,
    ) -> Result<(), Unsolved> {
        out.clear();
        pose.check()?;
        let inverted = pose.inverted();
        let shared = self.shared(&inverted)?;
        let lowers = [1.0, -1.0].map(|ankle| self.lower(&inverted, &shared, ankle, previous));
        for knee in [1.0, -1.0] {
            for (ankle, lower) in [1.0, -1.0].iter().zip(&lowers) {
                for hip in [1.0, -1.0] {
                    out.push(lower.joints(knee, hip), branch_number(knee, *ankle, hip));
                }
            }
        }
        // Branches can only merge where one of their signs belongs to a zero.
        let length = self.thigh_m + self.shank_m;
        let least = shared.knee.sine.min(shared.k / length).min(lowers[0].hip.sine);
        if least < MERGING {
            out.drop_repeated();
        }
        Ok(())
    }

    /// The solution nearest to `previous`, by the largest difference of a joint.
    ///
    /// # Errors
    /// As [`Leg::solve`].
    pub fn solve_nearest(&self, pose: &LimbPose, previous: &[f64; 6]) -> Result<[f64; 6], Unsolved> {
        let mut all = Solutions::default();
        self.solve_all(pose, previous, &mut all)?;
        let nearest = all.nearest(previous).copied();
        Ok(nearest.expect("a pose within reach has a solution"))
    }

    /// Eqs. (4)-(7) as far as no sign is chosen.
    fn shared(&self, inverted: &Inverted) -> Result<Shared, Unsolved> {
        let (l3, l4, d3) = (self.thigh_m, self.shank_m, self.hip_offset_m);
        let p = &inverted.p;
        let x = p.x + self.ankle_m;
        let across = x.hypot(p.y);
        // K² = X² + p'y² − d3²: the offset must fit beside the last axis.
        if across < d3.abs() - REACH_TOLERANCE_M {
            return Err(Unsolved::Distance {
                distance_m: across,
                least_m: d3.abs(),
                largest_m: f64::INFINITY,
            });
        }
        let near = ON_ANKLE_AXIS * (l3 + l4);
        let k = ((across - d3.abs()).max(0.0) * (across + d3.abs())).sqrt();
        let k = if k < near { 0.0 } else { k };
        let knee = hinge(l3, l4, k.hypot(p.z)).map_err(|unsolved| with_offset(unsolved, d3))?;
        Ok(Shared {
            x,
            across,
            k,
            psi: (knee.sine * l3).atan2(knee.cosine * l3 + l4),
            knee,
            // An offset smaller than that is none: the products with it would vanish on the axis.
            free: across < near,
            // Equal links folded up: the hip is on the ankle's own axis, and thigh and shank turn about it together.
            folded: k.hypot(p.z) < near,
        })
    }

    /// Joints 5 and 6, eqs. (12), (13), and the rotation they leave to the hip.
    fn lower(&self, inverted: &Inverted, shared: &Shared, s5: f64, previous: &[f64; 6]) -> Lower {
        let Inverted { n, s, a, p } = inverted;
        let (x, across, d3, k) = (shared.x, shared.across, self.hip_offset_m, s5 * shared.k);
        let (sixth, (s6, c6)) = if shared.free {
            (previous[5], previous[5].sin_cos())
        } else if d3 == 0.0 {
            ((s5 * p.y).atan2(-s5 * x), (s5 * p.y / across, -s5 * x / across))
        } else {
            let (sine, cosine) = (k * p.y - d3 * x, -(k * x + d3 * p.y));
            let scale = 1.0 / sine.hypot(cosine);
            (sine.atan2(cosine), (sine * scale, cosine * scale))
        };
        let turned = |v: &Vector3<f64>| (s6 * v.x + c6 * v.y, c6 * v.x - s6 * v.y);
        let ((vx, g11), (vy, g12), (c2, cosine)) = (turned(n), turned(s), turned(a));
        let hip = Triple {
            sine_part: (vx, vy),
            cosine: c2,
            third: (a.z, cosine),
            first_row: (g11, g12),
        };
        Lower {
            knee: shared.knee.angle,
            psi: shared.psi,
            sum: if shared.folded {
                previous[4] + shared.psi
            } else {
                (-p.z).atan2(k)
            },
            sixth,
            hip: hip.angles(previous[0]),
        }
    }
}

/// Distances as they are in the leg with its offset.
fn with_offset(unsolved: Unsolved, offset: f64) -> Unsolved {
    match unsolved {
        Unsolved::Distance {
            distance_m,
            least_m,
            largest_m,
        } => Unsolved::Distance {
            distance_m: distance_m.hypot(offset),
            least_m: least_m.hypot(offset),
            largest_m: largest_m.hypot(offset),
        },
        other => other,
    }
}

impl Lower {
    fn joints(&self, knee: f64, hip: f64) -> [f64; 6] {
        let (first, second, whole) = self.hip.branch(hip);
        let fourth = knee * self.knee;
        let fifth = self.sum - knee * self.psi;
        let third = whole - fourth - fifth;
        [first, second, third, fourth, fifth, self.sixth].map(wrap)
    }
}
