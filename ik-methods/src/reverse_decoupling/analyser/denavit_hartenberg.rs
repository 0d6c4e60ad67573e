//! Standard (distal) Denavit–Hartenberg rows of a limb, read off its axes at the zero pose.
//!
//! `A_i = Rz(θ_i) Tz(d_i) Tx(a_i) Rx(α_i)` with `θ_i = sign_i q_i + offset_i`. Frame i − 1 has its z axis on the axis of
//! joint i, its x axis along the common normal of the axes of joints i − 1 and i. What is left free is settled so:
//!
//! * the origins of the three frames of a meeting triple are the point itself, so that its rows have exactly
//!   `a = d = 0`; `d_1 = 0`, `offset_1 = 0`, and the last row is zero but for its angle: base and tool absorb them;
//! * of all common normals of parallel axes, the one through the foot of the next normal: a run of parallel axes has its
//!   whole offset along them in its first row (`d_3` of the HRP-2 leg), the other `d` are zero;
//! * `a ≥ 0`; where `a = 0`, `sin α ≥ 0`, in the second row `≤ 0`: the signs of the paper's tables.
//!
//! Directions are taken from rows already made, not from the normals of the axes: `α` and `θ` are the polar angles of
//! the next axis in the frame before. That is exact however small the angle between two axes is, where the direction of
//! their common normal is lost to rounding.

use super::lines::{distance, foot, projection, sine};
use ik_core::kinematics::successive::JointLine;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Axes within this angle (rad) are parallel: a hundred times what rounding leaves of parallel axes after six joints.
const PARALLEL_RAD: f64 = 1e-13;
/// Axes whose common normal is further away than this (m) are taken for parallel. Normals beyond it belong to angles below
/// 1e-9 rad or so, where rounding of an axis (1e-16) turns the normal by 1e-7 rad and moves it by hundreds of metres, and
/// leave lengths `d` that cancel; the angle is then the [`DenavitHartenberg::defect`].
const FAR_M: f64 = 1e3;
/// Lengths (m) and angles (rad) this near to zero (angles: to a multiple of 90°) are rounding and set to it, so that rows
/// show the structure. A hundredth of the accuracy asked of a row.
const ROUNDING: f64 = 1e-14;

/// One row: `A = Rz(sign q + offset) Tz(d) Tx(a) Rx(alpha)` takes the frame behind the joint to the one before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DhRow {
    /// Angle from this axis to the next about the common normal (rad).
    pub alpha: f64,
    /// Length of the common normal (m).
    pub a: f64,
    /// Distance along this axis between the common normals (m).
    pub d: f64,
    /// Angle θ where the joint is at zero (rad).
    pub offset: f64,
    /// −1 where the z axis points against the axis of the joint, else 1. Differs from 1 only in the families of the
    /// paper, whose tables fix the directions of the axes.
    pub sign: f64,
}

impl DhRow {
    /// The transform at the joint value `q` (rad).
    pub fn transform(&self, q: f64) -> Isometry3<f64> {
        self.at_angle(self.sign * q + self.offset)
    }

    /// The transform at the angle θ (rad).
    pub fn at_angle(&self, theta: f64) -> Isometry3<f64> {
        let about_z = Isometry3::from_parts(
            Translation3::new(0.0, 0.0, self.d),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), theta),
        );
        let about_x = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.alpha);
        about_z * Isometry3::from_parts(Translation3::new(self.a, 0.0, 0.0), about_x)
    }
}

/// A limb in Denavit–Hartenberg form: `base A_1 … A_n tool` is the pose of the tip body in the base body. The pose of a
/// frame of the tip body follows with its own pose in the body as a further factor.
#[derive(Clone, Debug, PartialEq)]
pub struct DenavitHartenberg {
    /// Pose of frame 0 in the base body.
    pub base: Isometry3<f64>,
    /// One row per joint, base to tip.
    pub rows: Vec<DhRow>,
    /// Pose of the tip body in the last frame.
    pub tool: Isometry3<f64>,
    /// Greatest deviation of a row's axis from that of its joint: of the direction (rad) or of the origin's distance from
    /// the axis (m). Rounding, unless the triple meets only within the tolerance or nearly parallel axes were taken for
    /// parallel. A pose is off by at most about one defect per joint.
    pub defect: f64,
}

impl DenavitHartenberg {
    /// Pose of the tip body in the base body at joint values `q` (rad), base to tip.
    pub fn tip_pose(&self, q: &[f64]) -> Isometry3<f64> {
        let rows = self.rows.iter().zip(q);
        rows.fold(self.base, |pose, (row, &q)| pose * row.transform(q)) * self.tool
    }

    /// The same limb seen from its tip, as a solver for triples at the base end wants one with its triple at the tip: the
    /// pose of the base body in the tip body, whose joint values are those of the limb *in reverse order*. Row i is row
    /// n + 1 − i turned round: `a` and `α` change sign and move one row on, as do `d`, sign and offset on their row.
    #[must_use]
    pub fn reversed(&self) -> Self {
        let before = |i: usize| i.checked_sub(1).map(|i| self.rows[i]);
        let turned = |(i, row): (usize, &DhRow)| DhRow {
            alpha: before(i).map_or(0.0, |next| -next.alpha),
            a: before(i).map_or(0.0, |next| -next.a),
            d: -row.d,
            offset: -row.offset,
            sign: -row.sign,
        };
        // a and α of the last row have no joint behind them here; they are constant and go with the tool.
        let beyond = self
            .rows
            .last()
            .map_or_else(Isometry3::identity, |row| DhRow { d: 0.0, ..*row }.at_angle(0.0));
        Self {
            base: (beyond * self.tool).inverse(),
            rows: self.rows.iter().enumerate().rev().map(turned).collect(),
            tool: self.base.inverse(),
            defect: self.defect,
        }
    }
}

/// Three consecutive axes that meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triple {
    /// Index of the first of the three joints.
    pub(super) first: usize,
    /// The point where they meet (m).
    pub(super) point: Vector3<f64>,
}

/// The rows of a chain of at least two joints with the given axes and pose of the tip at zero, all in the base body.
/// `signs`: see [`DhRow::sign`].
pub(super) fn rows(
    lines: &[JointLine],
    signs: &[f64],
    triple: Triple,
    tip: &Isometry3<f64>,
) -> DenavitHartenberg {
    let directed = |(line, sign): (&JointLine, &f64)| JointLine {
        axis: line.axis * *sign,
        point: line.point,
    };
    let lines: Vec<JointLine> = lines.iter().zip(signs).map(directed).collect();
    let feet = feet(&lines, triple, &tip.translation.vector);
    let mut frame = Isometry3::from_parts(
        Translation3::from(feet[0]),
        UnitQuaternion::face_towards(&lines[0].axis, &across(&lines[0].axis)),
    );
    let (mut base, mut rows, mut defect) = (frame, Vec::new(), defect_of(&frame, &lines[0]));
    for i in 0..lines.len() - 1 {
        let meets = triple.first <= i && i < triple.first + 2;
        let mut row = row(&frame, &lines[i], &lines[i + 1], &feet[i + 1], meets);
        if i == 1 && row.a == 0.0 && row.alpha > 0.0 && row.alpha < PI {
            row = flipped(&row);
        }
        if i == 0 {
            frame *= UnitQuaternion::from_axis_angle(&Vector3::z_axis(), row.offset);
            (base, row.offset) = (frame, 0.0);
        }
        row.sign = signs[i];
        frame *= row.at_angle(row.offset);
        defect = defect.max(defect_of(&frame, &lines[i + 1]));
        rows.push(row);
    }
    rows.push(DhRow {
        alpha: 0.0,
        a: 0.0,
        d: 0.0,
        offset: 0.0,
        sign: signs[lines.len() - 1],
    });
    DenavitHartenberg {
        base,
        rows,
        tool: frame.inverse() * tip,
        defect,
    }
}

/// A row from a frame on `line` to one on `next`. `foot` is the origin of that frame where the normal does not say it,
/// that is for parallel axes and for axes that `meet` there.
fn row(frame: &Isometry3<f64>, line: &JointLine, next: &JointLine, foot: &Vector3<f64>, meet: bool) -> DhRow {
    let axis = frame.rotation.inverse() * next.axis;
    let to_foot = frame.inverse_transform_point(&Point3::from(*foot)).coords;
    let parallel = are_parallel(line, next);
    let (alpha, offset) = if parallel {
        let alpha = if axis.z > 0.0 { 0.0 } else { PI };
        (alpha, to_foot.y.atan2(to_foot.x))
    } else {
        (axis.xy().norm().atan2(axis.z), axis.x.atan2(-axis.y))
    };
    let (alpha, offset) = (rounded_angle(alpha), rounded_angle(offset));
    let x = Vector3::new(offset.cos(), offset.sin(), 0.0);
    let (a, d) = if parallel || meet {
        (to_foot.dot(&x), to_foot.z)
    } else {
        // The point of the next axis in the plane of z and x: what it lies beside that plane is run back along the axis.
        let y = Vector3::new(-x.y, x.x, 0.0);
        let along = to_foot.dot(&y) / alpha.sin();
        (to_foot.dot(&x), to_foot.z + along * alpha.cos())
    };
    let a = if meet { 0.0 } else { rounded_length(a) };
    let row = DhRow {
        alpha,
        a,
        d: rounded_length(d),
        offset,
        sign: 1.0,
    };
    if a < 0.0 { flipped(&row) } else { row }
}

/// The same row, of `a ≤ 0`, with the normal pointing the other way.
fn flipped(row: &DhRow) -> DhRow {
    DhRow {
        alpha: -row.alpha,
        a: row.a.abs(),
        offset: if row.offset > 0.0 {
            row.offset - PI
        } else {
            row.offset + PI
        },
        ..*row
    }
}

/// Origin of the frame on each axis: the triple's point, or the foot of the normal to the axis before; of parallel axes
/// the foot of the normal behind them, carried over.
fn feet(lines: &[JointLine], triple: Triple, tip: &Vector3<f64>) -> Vec<Vector3<f64>> {
    let last = lines.len() - 1;
    // Where the next normal leaves each axis.
    let mut leaves = vec![projection(&lines[last], tip); lines.len()];
    for i in (0..last).rev() {
        leaves[i] = if triple.first <= i && i < triple.first + 2 {
            triple.point
        } else if are_parallel(&lines[i], &lines[i + 1]) {
            projection(&lines[i], &leaves[i + 1])
        } else {
            foot(&lines[i], &lines[i + 1])
        };
    }
    let mut feet = vec![leaves[0]; lines.len()];
    for i in 1..lines.len() {
        feet[i] = if triple.first < i && i <= triple.first + 2 {
            triple.point
        } else if are_parallel(&lines[i - 1], &lines[i]) {
            leaves[i]
        } else {
            foot(&lines[i], &lines[i - 1])
        };
    }
    feet
}

/// A direction well away from that of `axis`: the coordinate axis it has least of.
fn across(axis: &Vector3<f64>) -> Vector3<f64> {
    let mut direction = Vector3::zeros();
    direction[axis.iamin()] = 1.0;
    direction
}

fn are_parallel(a: &JointLine, b: &JointLine) -> bool {
    let away = |line: &JointLine, other: &JointLine| (foot(line, other) - line.point).norm();
    sine(a, b) < PARALLEL_RAD || away(a, b).max(away(b, a)) > FAR_M
}

fn defect_of(frame: &Isometry3<f64>, line: &JointLine) -> f64 {
    let axis = frame.rotation * Vector3::z() - line.axis;
    axis.norm().max(distance(line, &frame.translation.vector))
}

fn rounded_length(length: f64) -> f64 {
    if length.abs() < ROUNDING { 0.0 } else { length }
}

fn rounded_angle(angle: f64) -> f64 {
    let nearest = (angle / FRAC_PI_2).round() * FRAC_PI_2;
    if (angle - nearest).abs() < ROUNDING {
        nearest
    } else {
        angle
    }
}
