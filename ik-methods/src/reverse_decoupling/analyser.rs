//! Which limbs of a robot have a closed form by reverse decoupling, and why the others have none.
//!
//! A *limb* is the chain of joints from the last branching body, or the root, to a leaf of the tree of moving bodies. It
//! has a closed form if it has exactly six joints, all of them revolute and independent, and three consecutive axes that
//! meet in one point at its base end (joints 1-2-3: the paper's legs and arms) or at its tip (4-5-6: Pieper's wrist).
//! Consecutive axes that meet do so at every configuration, so the zero pose decides.
//!
//! Where axes do not meet, the *miss* is the greatest distance from their least-squares point, the point with the least
//! sum of squared distances, to one of them. The point with the least greatest distance is at most this near and, since
//! its root mean square is no less than that of the least-squares point, at least 1/√3 of it.
//!
//! Source: Ali, Park & Lee, "Closed-Form Inverse Kinematic Joint Solution for Humanoid Robots", the Denavit–Hartenberg
//! tables of their leg and arm. Cases of the general limb: the elimination that follows from its first step.

mod denavit_hartenberg;
mod display;
mod lines;

pub use denavit_hartenberg::{DenavitHartenberg, DhRow};

use denavit_hartenberg::{Triple, rows};
use ik_core::kinematics::successive::{JointLine, ZeroPose};
use ik_core::robot::{FrameId, Motion, Robot};
pub(super) use lines::meeting;
use lines::{distance, sine};
use nalgebra::{Isometry3, Point3, Vector3};
use std::f64::consts::PI;

/// Axes with a miss up to this (m) meet. Demanded of the analyser; robots whose description is rounded to six decimals
/// of a metre still qualify. What the miss costs is in [`DenavitHartenberg::defect`].
const MEETS_M: f64 = 1e-6;
/// Axes within this angle (rad) of each other that pass within [`MEETS_M`] of one point are one axis: the limb has five
/// freedoms.
const SAME_AXIS_RAD: f64 = 1e-6;
/// How far (m, rad) a limb may be from the pattern of a family, whose formulas leave out what is zero in it. Their poses
/// are then within the 1e-10 asked of them.
const PATTERN: f64 = 1e-11;
/// A limb that begins this near (m) to the plane of symmetry is on no side.
const CENTRE_M: f64 = 1e-6;
/// Joints of a limb with a closed form for a pose.
const JOINTS: usize = 6;

/// Where the last joint of a limb is at the zero pose.
///
/// Heuristic: in the axes of the root, x forward and y left as in the descriptions of most robots; wrong for a robot whose
/// root faces another way (iCub's faces back).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// y > 0.
    Left,
    /// y < 0.
    Right,
    /// On the plane of symmetry.
    Centre,
}

/// One end of a limb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Joints 1, 2 and 3.
    Base,
    /// Joints 4, 5 and 6.
    Tip,
}

/// How the three joints away from a meeting triple are found in the general limb. `a5` and `α5` are those of the chain
/// with the triple first, [`DenavitHartenberg::reversed`] for a triple at the tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elimination {
    /// `a5 = 0`: two quadratic equations.
    IntersectingLastAxes,
    /// `sin α5 = 0`: two quadratic equations.
    ParallelLastAxes,
    /// Neither: a quartic equation in `tan(θ4 / 2)`.
    Quartic,
}

/// Families of limbs with a closed form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// The paper's leg: hip axes at right angles, axes 3, 4 and 5 parallel, axis 6 through axis 5 at a right angle. Its
    /// rows are the paper's up to the signs of the axes; `d3` is zero (Hubo) or the offset along the pitch axes (HRP-2).
    Leg,
    /// The paper's arm: consecutive axes at right angles, the elbow on axes 3, 4 and 5.
    Arm,
    /// Arm of four joints, as of HOAP-2: the paper's arm without its last two joints.
    FourJointArm,
    /// Any other limb with a meeting triple.
    General {
        /// Where the triple is.
        triple: End,
        /// How the other three joints are found.
        elimination: Elimination,
    },
}

impl Family {
    /// The end where three axes meet.
    pub fn triple(self) -> End {
        match self {
            Self::General { triple, .. } => triple,
            Self::Leg | Self::Arm | Self::FourJointArm => End::Base,
        }
    }
}

/// Why a limb has no closed form here.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// A joint slides; its name.
    Prismatic(String),
    /// A joint follows another; its name.
    Mimic(String),
    /// Fewer than six joints.
    TooFewJoints,
    /// More than six joints.
    TooManyJoints,
    /// Two consecutive joints turn about the same axis; their names.
    SameAxis(String, String),
    /// The only axes that meet are in the middle, from the joint of this name on.
    MiddleTriple(String),
    /// No three consecutive axes meet.
    AxesMiss {
        /// Miss of the axes of joints 1, 2, 3 (m), see the module.
        base_m: f64,
        /// Miss of the axes of joints 4, 5, 6 (m).
        tip_m: f64,
    },
}

/// Whether a limb has a closed form.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// It has one, of this family.
    ClosedForm(Family),
    /// It has none.
    NotCovered(Reason),
}

/// One limb.
#[derive(Clone, Debug, PartialEq)]
pub struct LimbReport {
    /// Side of the robot on which it begins.
    pub side: Side,
    /// Indices of its joints in [`Robot::joints`], base to tip.
    pub joints: Vec<usize>,
    /// Names of its joints.
    pub joint_names: Vec<String>,
    /// Index of the body that carries it.
    pub base: usize,
    /// Name of that body.
    pub base_name: String,
    /// Index of its last body.
    pub tip: usize,
    /// Name of that body.
    pub tip_name: String,
    /// Frames fixed in the last body.
    pub frames: Vec<FrameId>,
    /// Closed form or not.
    pub verdict: Verdict,
}

/// The limbs of a robot, in the order of their last bodies.
pub fn limbs(robot: &Robot) -> Vec<LimbReport> {
    let mut children = vec![0_usize; robot.bodies().len()];
    for joint in robot.joints() {
        children[joint.parent] += 1;
    }
    let zero = ZeroPose::of(robot);
    let leaf = |&body: &usize| body > 0 && children[body] == 0;
    let report = |tip| report(robot, &zero, chain(robot, &children, tip), tip);
    (0..children.len()).filter(leaf).map(report).collect()
}

/// Why there are no Denavit–Hartenberg rows.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoRows {
    /// The limb has no closed form.
    #[error("limb at `{tip}` has no closed form: {reason}")]
    NotCovered {
        /// Name of its last body.
        tip: String,
        /// Why.
        reason: Reason,
    },
    /// The limb is not one of this robot.
    #[error("limb at `{tip}` is not a limb of robot `{robot}`")]
    OtherRobot {
        /// Name of its last body.
        tip: String,
        /// Name of the robot.
        robot: String,
    },
}

/// The Denavit–Hartenberg rows of a limb with a closed form, from its axes at the zero pose.
///
/// # Errors
/// A limb without closed form, or of another robot.
pub fn denavit_hartenberg(robot: &Robot, limb: &LimbReport) -> Result<DenavitHartenberg, NoRows> {
    let family = match &limb.verdict {
        Verdict::ClosedForm(family) => *family,
        Verdict::NotCovered(reason) => {
            return Err(NoRows::NotCovered {
                tip: limb.tip_name.clone(),
                reason: reason.clone(),
            });
        }
    };
    if !limbs(robot).contains(limb) {
        return Err(NoRows::OtherRobot {
            tip: limb.tip_name.clone(),
            robot: robot.name().to_owned(),
        });
    }
    let (lines, tip) = limb_axes(robot, &limb.joints);
    let triple = triple(&lines, family.triple());
    let plain = rows(&lines, &vec![1.0; lines.len()], triple, &tip);
    Ok(rows(&lines, &signs(&plain, family), triple, &tip))
}

/// Rows of a limb of three joints with three more axes through `point` (m, in the last body), along the axes of that body: a
/// virtual wrist, with which placing the point becomes a pose. None if a joint slides or follows another.
pub(super) fn with_virtual_wrist(
    robot: &Robot,
    limb: &LimbReport,
    point: &Point3<f64>,
) -> Option<DenavitHartenberg> {
    if limb.joints.len() != 3 || unfit_joint(robot, &limb.joints).is_some() {
        return None;
    }
    let (mut lines, tip) = limb_axes(robot, &limb.joints);
    let point = tip * point;
    let wrist = Isometry3::from_parts(point.coords.into(), tip.rotation);
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        lines.push(JointLine {
            axis: tip.rotation * axis,
            point: point.coords,
        });
    }
    let triple = Triple {
        first: 3,
        point: point.coords,
    };
    Some(rows(&lines, &[1.0; JOINTS], triple, &wrist))
}

/// Joints from the last branching body, or the root, to `tip`.
fn chain(robot: &Robot, children: &[usize], tip: usize) -> Vec<usize> {
    let path = robot.path(tip);
    let branches = |joint: &usize| children[robot.joints()[*joint].parent] > 1;
    let start = path.iter().rposition(branches).unwrap_or(0);
    path[start..].to_vec()
}

fn report(robot: &Robot, zero: &ZeroPose<'_>, joints: Vec<usize>, tip: usize) -> LimbReport {
    let base = robot.joints()[joints[0]].parent;
    // Where the limb begins: at zero its tip may be anywhere, both soles of Hubo are to the left.
    let side = match zero.lines()[joints[0]].point.y {
        y if y > CENTRE_M => Side::Left,
        y if y < -CENTRE_M => Side::Right,
        _ => Side::Centre,
    };
    let fixed_in_tip = |&FrameId(frame): &FrameId| robot.frames()[frame].body == tip;
    LimbReport {
        side,
        joint_names: joints.iter().map(|&j| robot.joints()[j].name.clone()).collect(),
        base,
        base_name: robot.bodies()[base].name.clone(),
        tip,
        tip_name: robot.bodies()[tip].name.clone(),
        frames: (0..robot.frames().len())
            .map(FrameId)
            .filter(fixed_in_tip)
            .collect(),
        verdict: closed_form(robot, &joints).map_or_else(Verdict::NotCovered, Verdict::ClosedForm),
        joints,
    }
}

/// Axes of a chain and pose of its last body, at the zero pose, in the body that carries it.
pub(super) fn limb_axes(robot: &Robot, joints: &[usize]) -> (Vec<JointLine>, Isometry3<f64>) {
    let mut pose = Isometry3::identity();
    let mut lines = Vec::with_capacity(joints.len());
    for &joint in joints {
        let joint = &robot.joints()[joint];
        pose *= joint.x_parent_joint;
        lines.push(JointLine {
            axis: (pose.rotation * joint.axis.into_inner()).normalize(),
            point: pose.translation.vector,
        });
    }
    (lines, pose)
}

fn closed_form(robot: &Robot, joints: &[usize]) -> Result<Family, Reason> {
    if let Some(reason) = unfit_joint(robot, joints) {
        return Err(reason);
    }
    let (lines, tip) = limb_axes(robot, joints);
    let name = |i: usize| robot.joints()[joints[i]].name.clone();
    match lines.len() {
        4 if is_four_joint_arm(&lines, &tip) => return Ok(Family::FourJointArm),
        0..JOINTS => return Err(Reason::TooFewJoints),
        JOINTS => {}
        _ => return Err(Reason::TooManyJoints),
    }
    if let Some(i) = (0..JOINTS - 1).find(|&i| same_axis(&lines[i], &lines[i + 1])) {
        return Err(Reason::SameAxis(name(i), name(i + 1)));
    }
    let [base, second, third, last] = [0, 1, 2, 3].map(|first| meeting(&lines[first..first + 3]).miss_m);
    if base <= MEETS_M {
        Ok(family(&lines, &tip, End::Base))
    } else if last <= MEETS_M {
        Ok(family(&lines, &tip, End::Tip))
    } else if second <= MEETS_M {
        Err(Reason::MiddleTriple(name(1)))
    } else if third <= MEETS_M {
        Err(Reason::MiddleTriple(name(2)))
    } else {
        Err(Reason::AxesMiss {
            base_m: base,
            tip_m: last,
        })
    }
}

fn unfit_joint(robot: &Robot, joints: &[usize]) -> Option<Reason> {
    joints.iter().find_map(|&j| {
        let joint = &robot.joints()[j];
        if robot.coordinates()[joint.coordinate].name != joint.name {
            Some(Reason::Mimic(joint.name.clone()))
        } else if joint.motion == Motion::Prismatic {
            Some(Reason::Prismatic(joint.name.clone()))
        } else {
            None
        }
    })
}

fn same_axis(a: &JointLine, b: &JointLine) -> bool {
    sine(a, b) <= SAME_AXIS_RAD && distance(a, &b.point) <= 2.0 * MEETS_M
}

/// The family of six axes with a meeting triple at `end`.
fn family(lines: &[JointLine], tip: &Isometry3<f64>, end: End) -> Family {
    let rows = rows(lines, &[1.0; JOINTS], triple(lines, end), tip).rows;
    let right = |i: usize| rows[i].alpha.cos().abs() <= PATTERN;
    let parallel = |i: usize| rows[i].alpha.sin().abs() <= PATTERN;
    let zero = |length: f64| length.abs() <= PATTERN;
    let meet_at_right_angles = end == End::Base && right(0) && right(1);
    let ankle =
        parallel(2) && parallel(3) && right(4) && zero(rows[4].a) && zero(rows[3].d) && zero(rows[4].d);
    let elbow = right(2) && right(3) && zero(rows[2].a) && zero(rows[3].a) && zero(rows[3].d);
    // Behind a triple at the base end row 5 leads to the last axis; behind one at the tip, seen from there, row 1 does.
    let last = if end == End::Base { 4 } else { 0 };
    let general = |elimination| Family::General {
        triple: end,
        elimination,
    };
    if meet_at_right_angles && ankle {
        Family::Leg
    } else if meet_at_right_angles && elbow && right(4) && zero(rows[4].a) {
        Family::Arm
    } else if zero(rows[last].a) {
        general(Elimination::IntersectingLastAxes)
    } else if parallel(last) {
        general(Elimination::ParallelLastAxes)
    } else {
        general(Elimination::Quartic)
    }
}

/// The paper's arm up to its elbow.
fn is_four_joint_arm(lines: &[JointLine], tip: &Isometry3<f64>) -> bool {
    if meeting(&lines[..3]).miss_m > MEETS_M {
        return false;
    }
    let rows = rows(lines, &[1.0; 4], triple(lines, End::Base), tip).rows;
    let right = |row: &DhRow| row.alpha.cos().abs() <= PATTERN;
    rows[..3].iter().all(right) && rows[2].a.abs() <= PATTERN && rows[2].d.abs() > MEETS_M
}

/// The meeting triple at one end of a limb.
fn triple(lines: &[JointLine], end: End) -> Triple {
    let first = match end {
        End::Base => 0,
        End::Tip => lines.len() - 3,
    };
    Triple {
        first,
        point: meeting(&lines[first..first + 3]).point,
    }
}

/// Directions of the z axes that give the paper's tables, from the rows along the axes as they are: the parallel axes of
/// a leg point the same way, those of an arm from the elbow to the shoulder (`d3 < 0`) and to the hand (`d5 > 0`).
fn signs(plain: &DenavitHartenberg, family: Family) -> Vec<f64> {
    let mut signs = vec![1.0; plain.rows.len()];
    let opposed = |i: usize| {
        if plain.rows[i].alpha.abs() > PI / 2.0 {
            -1.0
        } else {
            1.0
        }
    };
    match family {
        Family::Leg => {
            signs[3] = opposed(2);
            signs[4] = opposed(2) * opposed(3);
        }
        Family::Arm => {
            signs[2] = -plain.rows[2].d.signum();
            signs[4] = plain.rows[4].d.signum();
        }
        Family::FourJointArm => signs[2] = -plain.rows[2].d.signum(),
        Family::General { .. } => {}
    }
    signs
}
