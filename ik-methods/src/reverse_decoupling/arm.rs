//! The arm: three shoulder axes through one point, an elbow, a wrist of two axes; and the arm of four joints that ends
//! behind its elbow.

use super::{
    Inverted, LimbPose, REACH_TOLERANCE_M, STRAIGHT_TRIPLE, Solutions, Triple, TripleAngles, Unsolved,
    branch_number, denavit_hartenberg, distance, hinge, sign, wrap,
};
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Lengths of an arm (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// l2.
    pub upper_arm_m: f64,
    /// l3.
    pub forearm_m: f64,
    /// l4.
    pub hand_m: f64,
}

/// One of the eight postures of a right arm, by the signs of its indicators; those of a left arm have the other sign of
/// wrist and shoulder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmBranch {
    /// ELBOW: sign of sin θ4.
    pub elbow: f64,
    /// WRIST: sign of cos θ5.
    pub wrist: f64,
    /// SHOULDER: sign of sin θ2.
    pub shoulder: f64,
}

impl ArmBranch {
    /// The branch of that number, 4 (elbow < 0) + 2 (wrist < 0) + (shoulder < 0).
    pub fn numbered(number: u8) -> Self {
        let sign = |bit: u8| if number & bit == 0 { 1.0 } else { -1.0 };
        Self {
            elbow: sign(4),
            wrist: sign(2),
            shoulder: sign(1),
        }
    }

    /// Its number.
    pub fn number(&self) -> u8 {
        branch_number(self.elbow, self.wrist, self.shoulder)
    }
}

/// An elbow whose sine is below this is straight or folded. The sine of a stretched elbow is the root of what rounding
/// leaves of the pose, some 1e-7; snapping it costs the sine times the upper arm.
const STRAIGHT_ELBOW: f64 = 5e-7;
/// What rounding of the pose leaves of the sine of a stretched elbow.
const STRETCHED_SLACK: f64 = 1e-7;
/// A wrist whose cosine (times the sine of the elbow) is below this is at its double root: the same argument.
const DOUBLE_WRIST: f64 = 1e-7;
/// A shoulder this near the last axis, as part of the stretched arm, leaves θ6 free.
const ON_WRIST_AXIS: f64 = 1e-7;

/// Joints 4 to 6 of one pair of signs, and their shoulder.
struct Lower {
    fourth: f64,
    fifth: f64,
    sixth: f64,
    shoulder: TripleAngles,
}

impl Lower {
    fn joints(&self, s2: f64) -> [f64; 6] {
        let (first, second, third) = self.shoulder.branch(s2);
        [first, second, third, self.fourth, self.fifth, self.sixth].map(wrap)
    }
}

/// Sines above this are of distinct branches.
const MERGING: f64 = 1e-5;

impl Arm {
    /// Pose of the hand (frame 6) in the shoulder (frame 0) of joint angles (rad).
    pub fn forward(&self, q: &[f64; 6]) -> LimbPose {
        let rows = [
            (0.0, 0.0, FRAC_PI_2),
            (0.0, 0.0, -FRAC_PI_2),
            (-self.upper_arm_m, 0.0, FRAC_PI_2),
            (0.0, 0.0, FRAC_PI_2),
            (self.forearm_m, 0.0, FRAC_PI_2),
            (0.0, self.hand_m, 0.0),
        ];
        let step = |pose: LimbPose, (theta, row): (&f64, (f64, f64, f64))| {
            denavit_hartenberg(&pose, *theta, row.0, row.1, row.2)
        };
        q.iter().zip(rows).fold(LimbPose::identity(), step)
    }

    /// Decision indicators of joint angles, zeros counting as positive.
    pub fn branch(&self, q: &[f64; 6]) -> ArmBranch {
        ArmBranch {
            elbow: sign(q[3].sin()),
            wrist: sign(q[4].cos()),
            shoulder: sign(q[1].sin()),
        }
    }

    /// The joint angles of one branch. Where the geometry leaves a joint free it stays at `previous`.
    ///
    /// # Errors
    /// A pose that is not rigid or not within reach.
    pub fn solve(
        &self,
        pose: &LimbPose,
        branch: ArmBranch,
        previous: &[f64; 6],
    ) -> Result<[f64; 6], Unsolved> {
        pose.check()?;
        let inverted = pose.inverted();
        let elbow = self.elbow(&inverted)?;
        Ok(self.joints(&inverted, &elbow, branch, previous))
    }

    /// Writes all distinct solutions; see [`Arm::solve`].
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
        let elbow = self.elbow(&inverted)?;
        if elbow.sine <= STRAIGHT_ELBOW {
            for number in 0..8 {
                out.push(
                    self.straight(&inverted, &elbow, ArmBranch::numbered(number), previous),
                    number,
                );
            }
            out.drop_repeated();
            return Ok(());
        }
        let mut least = elbow.sine.min(elbow.wrist / self.upper_arm_m);
        for s4 in [1.0, -1.0] {
            for s5 in [1.0, -1.0] {
                let lower = self.lower(&inverted, &elbow, (s4, s5), previous);
                least = least.min(lower.shoulder.sine);
                for s2 in [1.0, -1.0] {
                    out.push(lower.joints(s2), branch_number(s4, s5, s2));
                }
            }
        }
        // Branches can only merge where one of their signs belongs to a zero.
        if least < MERGING {
            out.drop_repeated();
        }
        Ok(())
    }

    /// The solution nearest to `previous`, by the largest difference of a joint.
    ///
    /// # Errors
    /// As [`Arm::solve`].
    pub fn solve_nearest(&self, pose: &LimbPose, previous: &[f64; 6]) -> Result<[f64; 6], Unsolved> {
        let mut all = Solutions::default();
        self.solve_all(pose, previous, &mut all)?;
        let nearest = all.nearest(previous).copied();
        Ok(nearest.expect("a pose within reach has a solution"))
    }

    /// What all branches share: the elbow, eq. (25), and the wrist as far as its sign is free.
    fn elbow(&self, inverted: &Inverted) -> Result<Elbow, Unsolved> {
        let (l2, l3) = (self.upper_arm_m, self.forearm_m);
        let (x, y, z) = (inverted.p.x + self.hand_m, inverted.p.y, inverted.p.z);
        let across = x.hypot(y);
        let hinge = hinge(l2, l3, across.hypot(z))?;
        // |p'z| = l2 |S4 S5|: the last axis fixes the plane of the forearm.
        let out_of_plane = l2 * hinge.sine;
        // Near a stretched elbow the sine is off by the root of rounding.
        let slack = if hinge.sine > STRAIGHT_ELBOW {
            REACH_TOLERANCE_M
        } else {
            l2 * STRETCHED_SLACK
        };
        if z.abs() > out_of_plane + slack {
            return Err(Unsolved::Orientation {
                found_m: z.abs(),
                largest_m: out_of_plane,
            });
        }
        let along = hinge.cosine * l2 + l3;
        // |S4 C5| l2. At C5 = 0 it is the root of a difference that is rounding, and its error would spread over the shoulder.
        let wrist = ((out_of_plane - z.abs()).max(0.0) * (out_of_plane + z.abs())).sqrt();
        Ok(Elbow {
            hinge_angle: hinge.angle,
            sine: hinge.sine,
            cosine: hinge.cosine,
            along,
            wrist: if wrist < DOUBLE_WRIST * l2 { 0.0 } else { wrist },
            across,
            x,
            y,
            z,
        })
    }

    fn joints(&self, inverted: &Inverted, elbow: &Elbow, branch: ArmBranch, previous: &[f64; 6]) -> [f64; 6] {
        if elbow.sine <= STRAIGHT_ELBOW {
            return self.straight(inverted, elbow, branch, previous);
        }
        let lower = self.lower(inverted, elbow, (branch.elbow, branch.wrist), previous);
        lower.joints(branch.shoulder)
    }

    /// Eqs. (26), (28) and the rotation that is left to the shoulder.
    fn lower(&self, inverted: &Inverted, elbow: &Elbow, (s4, s5): (f64, f64), previous: &[f64; 6]) -> Lower {
        let Inverted { n, s, a, .. } = inverted;
        let wrist = s5 * elbow.wrist;
        let scale = 1.0 / (elbow.sine * self.upper_arm_m);
        let (fifth, sine5, cosine5) = ((s4 * elbow.z).atan2(wrist), s4 * elbow.z * scale, wrist * scale);
        let (sixth, s6, c6) = elbow.sixth(s4 * wrist, self.upper_arm_m + self.forearm_m, previous[5]);
        let (sine4, cosine4) = (s4 * elbow.sine, elbow.cosine);
        let (k1, k2, k3) = (
            sine4 * cosine5 * c6 - cosine4 * s6,
            sine4 * sine5,
            sine4 * cosine5 * s6 + cosine4 * c6,
        );
        let second_row = |v: &Vector3<f64>| k1 * v.x + k2 * v.z - k3 * v.y;
        let first_row = |v: &Vector3<f64>| {
            (cosine4 * cosine5 * c6 + sine4 * s6) * v.x
                + cosine4 * sine5 * v.z
                + (sine4 * c6 - cosine4 * cosine5 * s6) * v.y
        };
        let third_row = sine5 * c6 * a.x - cosine5 * a.z - sine5 * s6 * a.y;
        let shoulder = Triple {
            sine_part: (second_row(n), second_row(s)),
            cosine: second_row(a),
            third: (third_row, first_row(a)),
            first_row: (first_row(n), first_row(s)),
        };
        Lower {
            fourth: s4 * elbow.hinge_angle,
            fifth,
            sixth,
            shoulder: shoulder.angles(previous[0]),
        }
    }

    /// A straight or folded elbow: θ3 and θ5 turn about one axis, and with S2 = 0 so does θ1. θ3 stays (and θ1).
    fn straight(
        &self,
        inverted: &Inverted,
        elbow: &Elbow,
        branch: ArmBranch,
        previous: &[f64; 6],
    ) -> [f64; 6] {
        let length = self.upper_arm_m + self.forearm_m;
        let held = elbow.sixth(0.0, length, previous[5]);
        let joints = straight_at(inverted, elbow, branch, previous, held);
        // Equal links folded up leave θ6 free. Where some θ6 makes S2 = 0, staying on it may be nearer than holding θ6,
        // which would have the shoulder leave S2 = 0 in a direction of its own.
        let a = &inverted.a;
        if elbow.across >= ON_WRIST_AXIS * length || a.z.abs() >= STRAIGHT_TRIPLE {
            return joints;
        }
        let scale = sign(held.1 * a.x + held.2 * a.y) / a.x.hypot(a.y);
        let (s6, c6) = (a.x * scale, a.y * scale);
        let aligned = straight_at(inverted, elbow, branch, previous, (s6.atan2(c6), s6, c6));
        if distance(&aligned, previous) < distance(&joints, previous) {
            aligned
        } else {
            joints
        }
    }
}

/// [`Arm::straight`] with θ6, its sine and its cosine.
fn straight_at(
    inverted: &Inverted,
    elbow: &Elbow,
    branch: ArmBranch,
    previous: &[f64; 6],
    (sixth, s6, c6): (f64, f64, f64),
) -> [f64; 6] {
    let Inverted { n, s, a, .. } = inverted;
    let cosine4 = sign(elbow.cosine);
    let fourth = if cosine4 > 0.0 { 0.0 } else { PI };
    let across = |v: &Vector3<f64>| c6 * v.y + s6 * v.x;
    let (gx, gy, cosine) = (across(n), across(s), -cosine4 * across(a));
    let sine = gx.hypot(gy);
    let s2 = branch.shoulder;
    let second = (s2 * sine).atan2(cosine);
    let (first, third) = if sine < STRAIGHT_TRIPLE {
        (previous[0], previous[2])
    } else {
        ((s2 * cosine4 * gy).atan2(s2 * cosine4 * gx), previous[2])
    };
    let fifth = if sine < STRAIGHT_TRIPLE {
        fifth_of_line(n, s, sign(cosine), cosine4, first, third)
    } else {
        let turn = (-s2 * a.z).atan2(s2 * cosine4 * (a.x * c6 - a.y * s6));
        cosine4 * (third - turn)
    };
    [first, second, third, fourth, fifth, sixth].map(wrap)
}

/// θ5 where shoulder and elbow are both singular: everything turns about one line.
fn fifth_of_line(
    n: &Vector3<f64>,
    s: &Vector3<f64>,
    cosine2: f64,
    cosine4: f64,
    first: f64,
    third: f64,
) -> f64 {
    let turn = first + cosine2 * third;
    let (sine, cosine) = turn.sin_cos();
    let (row1, row3) = ((cosine2 * cosine, cosine2 * sine), (sine, -cosine));
    // C4 S5 row1 − C5 row3 = (n'z, s'z), the two rows being orthogonal.
    let s5 = cosine4 * (n.z * row1.0 + s.z * row1.1);
    let c5 = -(n.z * row3.0 + s.z * row3.1);
    s5.atan2(c5)
}

/// The elbow and the shoulder as the hand sees it.
#[derive(Clone, Copy, Debug)]
struct Elbow {
    hinge_angle: f64,
    sine: f64,
    cosine: f64,
    /// C4 l2 + l3.
    along: f64,
    /// |S4 C5| l2.
    wrist: f64,
    /// Distance of the shoulder from the last axis.
    across: f64,
    x: f64,
    y: f64,
    z: f64,
}

impl Elbow {
    /// θ6 with its sine and cosine, eq. (28), from `S4 C5 l2`; `previous` where the shoulder is on the last axis.
    fn sixth(&self, wrist: f64, length: f64, previous: f64) -> (f64, f64, f64) {
        if self.across < ON_WRIST_AXIS * length {
            let (sine, cosine) = previous.sin_cos();
            return (previous, sine, cosine);
        }
        // θ6 = β − ψ, β = atan2(−along, wrist), ψ = atan2(y, x).
        let (sine, cosine) = (
            -self.along * self.x - wrist * self.y,
            wrist * self.x - self.along * self.y,
        );
        let scale = 1.0 / sine.hypot(cosine);
        (sine.atan2(cosine), sine * scale, cosine * scale)
    }
}

/// The arm of four joints: shoulder and elbow, the hand fixed behind the elbow (θ5 = 0, θ6 = 90°).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElbowArm {
    /// The arm it is part of.
    pub arm: Arm,
}

/// What a pose may be off the four-dimensional set of poses of such an arm (m, rad).
const OFF_SET: f64 = 1e-6;

impl ElbowArm {
    /// Pose of the hand in the shoulder.
    pub fn forward(&self, q: &[f64; 4]) -> LimbPose {
        self.arm.forward(&[q[0], q[1], q[2], q[3], 0.0, FRAC_PI_2])
    }

    /// Writes both solutions (one where the shoulder is singular): θ4 from (19), (20), the shoulder from (29)-(31).
    ///
    /// # Errors
    /// A pose that is not rigid, or that the arm does not reach with this orientation.
    pub fn solve_all(
        &self,
        pose: &LimbPose,
        previous: &[f64; 4],
        out: &mut Solutions<4>,
    ) -> Result<(), Unsolved> {
        out.clear();
        pose.check()?;
        let Inverted { n, s, a, p } = pose.inverted();
        let x = p.x + self.arm.hand_m;
        let fourth = (-p.y).atan2(-(x + self.arm.forearm_m));
        let (s4, c4) = fourth.sin_cos();
        let second_row = |v: &Vector3<f64>| -c4 * v.x - s4 * v.y;
        let first_row = |v: &Vector3<f64>| s4 * v.x - c4 * v.y;
        let triple = Triple {
            sine_part: (second_row(&n), second_row(&s)),
            cosine: second_row(&a),
            third: (-a.z, first_row(&a)),
            first_row: (first_row(&n), first_row(&s)),
        };
        let shoulder = triple.angles(previous[0]);
        for s2 in [1.0, -1.0] {
            let (first, second, third) = shoulder.branch(s2);
            out.push([first, second, third, fourth].map(wrap), u8::from(s2 < 0.0));
        }
        out.drop_repeated();
        let missed = out.iter().next().map(|(q, _)| self.forward(q));
        let missed = missed.expect("two branches were written");
        let position_m = (missed.position - pose.position).amax();
        let turn = missed.rotation.tr_mul(&pose.rotation);
        let rotation_rad = ik_core::spatial::so3::log(&turn).norm();
        if position_m > OFF_SET || rotation_rad > OFF_SET {
            out.clear();
            return Err(Unsolved::OffSet {
                position_m,
                rotation_rad,
            });
        }
        Ok(())
    }
}
