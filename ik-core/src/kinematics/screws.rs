//! Normalised screws of the joints and of the root, read off a [`Page`]: world axes, any reference point, no
//! allocation.
//!
//! Written at the point of a task, the screws on the path to its body are the columns of a circuit (Davies 1981); stacked,
//! they are the screw Jacobian, eq. (5) of the Davies network paper on a Bioloid humanoid. [`super::successive`] derives
//! the same screws from the description at the zero pose.

use super::Page;
use super::jacobian::for_each_joint_column;
use crate::robot::{Robot, Root};
use crate::spatial::lane;
use crate::spatial::screw::Screw;
use nalgebra::Vector3;

/// Calls `write(v, screw)` for each joint on the path from the root to `body`, in that order: the velocity coordinate the
/// joint follows and the twist that a unit rate of this coordinate gives the body, in world axes, written at `point`
/// (m, world).
///
/// That is the normalised screw of the joint times its multiplier; several joints may share a coordinate (mimic), so
/// contributions add up. The root is not visited, see [`root_screws`]. The body of a frame is `robot.frames()[id.0].body`.
#[inline]
pub fn for_each_screw(
    robot: &Robot,
    page: &Page,
    body: usize,
    point: &Vector3<f64>,
    mut write: impl FnMut(usize, &Screw),
) {
    let p = [point.x, point.y, point.z, 0.0];
    for_each_joint_column(robot, page, body, p, |v, linear, angular| {
        let screw = Screw {
            angular: lane::to_vector(angular),
            linear: lane::to_vector(linear),
        };
        write(v, &screw);
    });
}

/// The twists that unit rates of the root's six velocity coordinates give the root, in world axes, written at `point`
/// (m, world): translations along world x, y, z, then rotations about world x, y, z through the root's origin. All zero
/// for a fixed root, which has no such coordinates.
pub fn root_screws(robot: &Robot, page: &Page, point: &Vector3<f64>) -> [Screw; 6] {
    let mut screws = [Screw::default(); 6];
    if robot.root() == Root::Floating {
        let arm = lane::to_vector(page.bodies[0].origin) - point;
        for (k, axis) in [Vector3::x(), Vector3::y(), Vector3::z()].iter().enumerate() {
            screws[k] = Screw::prismatic(axis);
            screws[3 + k] = Screw::revolute(axis, &arm);
        }
    }
    screws
}
