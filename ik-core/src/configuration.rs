//! Configurations on their manifold: R³ × SO(3) for a floating root, R for every other coordinate.
//!
//! A configuration q holds `[x y z qx qy qz qw]` of a floating root, then one value per independent joint coordinate. A
//! velocity or increment holds the root's linear part, its angular part, both in *world* axes, then the joints.
//!
//! Deviation: architecture sketches call the root SE(3). Position and rotation are moved separately here, as in the
//! generalised coordinates of Faraji & Ijspeert (2017): the position of the root is then one number per axis, which its
//! damping, limits and differences act on, and no screw motion couples it to the rotation.

use crate::kinematics::root_quaternion;
use crate::robot::{Robot, Root};
use crate::spatial::so3;
use nalgebra::{Isometry3, Translation3, Vector3};

/// Pose of the root body in the world; identity if it is fixed.
pub fn root_pose(robot: &Robot, q: &[f64]) -> Isometry3<f64> {
    match robot.root() {
        Root::Fixed => Isometry3::identity(),
        Root::Floating => Isometry3::from_parts(Translation3::new(q[0], q[1], q[2]), root_quaternion(q)),
    }
}

/// Writes `q ⊕ dq`: positions and joints add, the root turns by `exp(dq_angular)` from the left; the quaternion is
/// renormalised. `q` and `out` have length nq, `dq` length nv.
pub fn integrate_into(robot: &Robot, q: &[f64], dq: &[f64], out: &mut [f64]) {
    if robot.root() == Root::Floating {
        for k in 0..3 {
            out[k] = q[k] + dq[k];
        }
        let turned = so3::exp_quaternion(&Vector3::new(dq[3], dq[4], dq[5])).into_inner()
            * root_quaternion(q).into_inner();
        let turned = turned.normalize();
        out[3..7].copy_from_slice(turned.coords.as_slice());
    }
    let (nq, nv) = (robot.root().nq(), robot.root().nv());
    for ((o, a), b) in out[nq..].iter_mut().zip(&q[nq..]).zip(&dq[nv..]) {
        *o = a + b;
    }
}

/// Writes the increment `q1 ⊖ q0` with `q0 ⊕ (q1 ⊖ q0) = q1`; the rotation part is the shortest one.
pub fn difference_into(robot: &Robot, q0: &[f64], q1: &[f64], out: &mut [f64]) {
    if robot.root() == Root::Floating {
        for k in 0..3 {
            out[k] = q1[k] - q0[k];
        }
        let turn = so3::log_quaternion(&(root_quaternion(q1) * root_quaternion(q0).inverse()));
        out[3..6].copy_from_slice(turn.as_slice());
    }
    let (nq, nv) = (robot.root().nq(), robot.root().nv());
    for ((o, a), b) in out[nv..].iter_mut().zip(&q1[nq..]).zip(&q0[nq..]) {
        *o = a - b;
    }
}

/// Allocating convenience of [`integrate_into`].
pub fn integrate(robot: &Robot, q: &[f64], dq: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; robot.nq()];
    integrate_into(robot, q, dq, &mut out);
    out
}

/// Allocating convenience of [`difference_into`].
pub fn difference(robot: &Robot, q0: &[f64], q1: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; robot.nv()];
    difference_into(robot, q0, q1, &mut out);
    out
}
