//! How joints and the centre of mass move with the waist while the ends of all limbs are held.

use super::plan::{LimbPlan, Plan, Target};
use super::whole_body::{Candidate, root_pose};
use crate::reverse_decoupling::analyser::End;
use ik_core::kinematics::Page;
use ik_core::kinematics::screws::for_each_screw;
use ik_core::robot::Robot;
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Determinants below this, of columns scaled to one, are singular.
const SINGULAR: f64 = 1e-6;
/// Damping of a singular system, in parts of its longest column.
const DAMPING: f64 = 1e-2;

/// `∂com/∂p`: p the position of the root, its rotation and the ends of all limbs held.
pub(super) fn centre_of_mass_rate(robot: &Robot, plan: &Plan, at: &Candidate) -> Matrix3<f64> {
    let first = robot.root().nv();
    let mut rate = Matrix3::identity();
    let pose = root_pose(robot, &at.q);
    for limb in &plan.limbs {
        let rates = joint_rates(robot, limb, &pose, &at.page);
        for (c, joint) in limb.coordinates.iter().zip(rates) {
            rate += at.page.centre_of_mass_column(first + c) * joint.transpose();
        }
    }
    rate
}

/// `∂q/∂p` of each joint of a limb (rad/m): p the position of the root, whose pose is `root`, the end of the limb held.
pub(super) fn joint_rates(
    robot: &Robot,
    limb: &LimbPlan,
    root: &Isometry3<f64>,
    page: &Page,
) -> [Vector3<f64>; 6] {
    let point = match limb.triple {
        (End::Base, point) => root * point,
        (End::Tip, point) => limb.tip_pose(robot, page) * point,
    };
    let (mut linear, mut angular) = ([Vector3::zeros(); 6], [Vector3::zeros(); 6]);
    let mut joints = linear.iter_mut().zip(&mut angular);
    for_each_screw(robot, page, limb.tip, &point.coords, |_, screw| {
        if let Some((linear, angular)) = joints.next() {
            (*linear, *angular) = (screw.linear, screw.angular);
        }
    });
    let block = |columns: &[Vector3<f64>; 6], first: usize| {
        Matrix3::from_columns(&[columns[first], columns[first + 1], columns[first + 2]])
    };
    // The joints that move the meeting point of the others, and the others.
    let (far, triple) = match limb.triple.0 {
        End::Base => (3, 0),
        End::Tip => (0, 3),
    };
    let moved = -inverse(&block(&linear, far));
    let mut rates = [Vector3::zeros(); 6];
    let mut write = |first: usize, block: Matrix3<f64>| {
        for k in 0..3 {
            rates[first + k] = block.row(k).transpose();
        }
    };
    write(far, moved);
    if matches!(limb.target, Target::Pose(..)) {
        write(
            triple,
            -inverse(&block(&angular, triple)) * block(&angular, far) * moved,
        );
    }
    rates
}

/// The inverse, damped where the columns are nearly dependent.
fn inverse(m: &Matrix3<f64>) -> Matrix3<f64> {
    if let Some(inverse) = m.try_inverse().filter(|_| is_regular(m)) {
        return inverse;
    }
    let longest = m.column_iter().map(|c| c.norm()).fold(0.0, f64::max);
    let damping = Matrix3::from_diagonal_element((DAMPING * longest).powi(2).max(f64::MIN_POSITIVE));
    let normal = m.tr_mul(m) + damping;
    normal
        .try_inverse()
        .map_or_else(Matrix3::zeros, |inverse| inverse * m.transpose())
}

/// Whether the columns are well independent.
pub(super) fn is_regular(m: &Matrix3<f64>) -> bool {
    let scale = m.column_iter().map(|c| c.norm()).product::<f64>();
    m.determinant().abs() > SINGULAR * scale
}
