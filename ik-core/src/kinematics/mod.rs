//! Kinematics of a robot: everything is read off one pass over the tree.
//!
//! [`forward`] walks the tree once and fills a [`Page`]: the pose of every body, the centre of mass and its Jacobian.
//! Because body frames are aligned so that each joint turns or slides along its body's z axis, the poses *are* the
//! joint axes and origins, and frame Jacobians ([`jacobian`]), second-order terms ([`second_order`]), gravity
//! torques ([`gravity`], [`hanging`]) and the screws of the joints ([`screws`]) need nothing else. Everything is expressed in the world
//! frame, SI units, radians. [`successive`] is a second, slower way to the same poses and axes.
//!
//! Velocity coordinates of a floating root: linear velocity of the root origin, then angular velocity, both in world
//! axes (see [`crate::configuration`]).

pub mod gravity;
pub mod hanging;
pub mod jacobian;
pub mod screws;
pub mod second_order;
mod sin_cos;
pub mod successive;

use crate::instructions::{self, Kernel};
use crate::robot::{FrameId, Motion, Robot, Root};
use crate::spatial::lane::{self, AXES, Lane, ZERO};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};

/// Pose of one body in the world: its axes as columns and its origin (m).
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyPose {
    pub(crate) x: Lane,
    pub(crate) y: Lane,
    pub(crate) z: Lane,
    pub(crate) origin: Lane,
}

impl BodyPose {
    #[inline(always)]
    fn rotate<const FMA: bool>(&self, x: f64, y: f64, z: f64) -> Lane {
        let xy = lane::add_times::<FMA>(lane::scale(self.x, x), self.y, y);
        lane::add_times::<FMA>(xy, self.z, z)
    }

    /// World coordinates of a point given in body coordinates.
    #[inline(always)]
    pub(crate) fn point(&self, p: &Vector3<f64>) -> Lane {
        self.point_at::<false>(p)
    }

    /// [`Self::point`], products fused or not.
    #[inline(always)]
    pub(crate) fn point_at<const FMA: bool>(&self, p: &Vector3<f64>) -> Lane {
        let x = lane::add_times::<FMA>(self.origin, self.x, p.x);
        let xy = lane::add_times::<FMA>(x, self.y, p.y);
        lane::add_times::<FMA>(xy, self.z, p.z)
    }

    /// World rotation matrix of a frame whose rotation in the body is `r`.
    pub(crate) fn rotation(&self, r: &Matrix3<f64>) -> Matrix3<f64> {
        let column = |k: usize| lane::to_vector(self.rotate::<false>(r[(0, k)], r[(1, k)], r[(2, k)]));
        Matrix3::from_columns(&[column(0), column(1), column(2)])
    }
}

/// What one tree pass leaves behind, and its scratch. Sized once for a robot; [`forward`] never allocates.
///
/// Vectors are padded to four lanes and contiguous, bodies in tree order (a body's subtree is a contiguous range).
#[derive(Clone, Debug)]
pub struct Page {
    pub(crate) bodies: Vec<BodyPose>,
    /// Centre of mass (m).
    pub(crate) com: Lane,
    /// One column per velocity coordinate: ∂com/∂v.
    pub(crate) com_jacobian: Vec<Lane>,
    /// First mass moment (kg m, world) of the subtree of each body.
    moments: Vec<Lane>,
    /// Mass (kg) of the subtree of each body.
    subtree_mass: Vec<f64>,
    /// 1 / total moving mass, 0 for a massless robot.
    inverse_mass: f64,
    value: Vec<f64>,
    sine: Vec<f64>,
    cosine: Vec<f64>,
}

impl Page {
    /// A page for `robot`; contents are those of no configuration until [`forward`] fills it.
    pub fn new(robot: &Robot) -> Self {
        let bodies = robot.bodies().len();
        let joints = robot.joints().len();
        let identity = BodyPose {
            x: AXES[0],
            y: AXES[1],
            z: AXES[2],
            origin: ZERO,
        };
        let mut subtree_mass: Vec<f64> = robot.aligned_bodies.iter().map(|(mass, _)| *mass).collect();
        if robot.root() == Root::Fixed {
            // Mass that cannot move is no part of the centre of mass.
            subtree_mass[0] = 0.0;
        }
        for (i, joint) in robot.joints().iter().enumerate().rev() {
            subtree_mass[joint.parent] += subtree_mass[i + 1];
        }
        let mass = subtree_mass[0];
        Self {
            bodies: vec![identity; bodies],
            com: ZERO,
            com_jacobian: vec![ZERO; robot.nv()],
            moments: vec![ZERO; bodies],
            inverse_mass: if mass > 0.0 { 1.0 / mass } else { 0.0 },
            subtree_mass,
            value: vec![0.0; joints],
            sine: vec![0.0; joints],
            cosine: vec![0.0; joints],
        }
    }

    /// Mass of everything that can move (kg).
    pub fn moving_mass_kg(&self) -> f64 {
        self.subtree_mass[0]
    }

    /// Centre of mass of everything that moves (m, world). A fixed root's own mass does not count.
    pub fn centre_of_mass(&self) -> Vector3<f64> {
        lane::to_vector(self.com)
    }

    /// Column `v` of the 3 × nv Jacobian of the centre of mass.
    pub fn centre_of_mass_column(&self, v: usize) -> Vector3<f64> {
        lane::to_vector(self.com_jacobian[v])
    }

    /// Position of a named frame (m, world).
    pub fn frame_position(&self, robot: &Robot, frame: FrameId) -> Vector3<f64> {
        let (body, _, p) = &robot.aligned_frames[frame.0];
        lane::to_vector(self.bodies[*body].point(p))
    }

    /// Rotation of a named frame, frame to world.
    pub fn frame_rotation(&self, robot: &Robot, frame: FrameId) -> Matrix3<f64> {
        let (body, r, _) = &robot.aligned_frames[frame.0];
        self.bodies[*body].rotation(r)
    }

    /// Pose of a named frame in the world.
    pub fn frame_pose(&self, robot: &Robot, frame: FrameId) -> Isometry3<f64> {
        let rotation = crate::spatial::so3::quaternion(&self.frame_rotation(robot, frame));
        Isometry3::from_parts(Translation3::from(self.frame_position(robot, frame)), rotation)
    }
}

/// Fills `page` for the configuration `q` (length `robot.nq()`, unit root quaternion).
pub fn forward(robot: &Robot, q: &[f64], page: &mut Page) {
    instructions::run(TreePass { robot, q, page });
}

struct TreePass<'a> {
    robot: &'a Robot,
    q: &'a [f64],
    page: &'a mut Page,
}

impl Kernel for TreePass<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        poses::<FMA>(self.robot, self.q, self.page);
        mass_moments::<FMA>(self.robot, self.page);
        centre_of_mass_jacobian::<FMA>(self.robot, self.page);
    }
}

#[inline(always)]
fn root_pose(robot: &Robot, q: &[f64]) -> BodyPose {
    match robot.root() {
        Root::Fixed => BodyPose {
            x: AXES[0],
            y: AXES[1],
            z: AXES[2],
            origin: ZERO,
        },
        Root::Floating => {
            let (i, j, k, w) = (q[3], q[4], q[5], q[6]);
            BodyPose {
                x: [
                    1.0 - 2.0 * (j * j + k * k),
                    2.0 * (i * j + k * w),
                    2.0 * (i * k - j * w),
                    0.0,
                ],
                y: [
                    2.0 * (i * j - k * w),
                    1.0 - 2.0 * (i * i + k * k),
                    2.0 * (j * k + i * w),
                    0.0,
                ],
                z: [
                    2.0 * (i * k + j * w),
                    2.0 * (j * k - i * w),
                    1.0 - 2.0 * (i * i + j * j),
                    0.0,
                ],
                origin: lane::from_slice(q),
            }
        }
    }
}

#[inline(always)]
fn poses<const FMA: bool>(robot: &Robot, q: &[f64], page: &mut Page) {
    let coordinates = &q[robot.root().nq()..];
    for (joint, value) in robot.aligned.iter().zip(&mut page.value) {
        *value = joint.multiplier * coordinates[joint.coordinate] + joint.offset;
    }
    sin_cos::sin_cos_into::<FMA>(&page.value, &mut page.sine, &mut page.cosine);
    page.bodies[0] = root_pose(robot, q);
    for (i, joint) in robot.aligned.iter().enumerate() {
        let parent = page.bodies[joint.parent];
        let r = &joint.r_parent_joint;
        let x = parent.rotate::<FMA>(r[(0, 0)], r[(1, 0)], r[(2, 0)]);
        let y = parent.rotate::<FMA>(r[(0, 1)], r[(1, 1)], r[(2, 1)]);
        let z = parent.rotate::<FMA>(r[(0, 2)], r[(1, 2)], r[(2, 2)]);
        let origin = parent.point_at::<FMA>(&joint.p_parent_joint);
        page.bodies[i + 1] = match joint.motion {
            Motion::Revolute => {
                let (s, c) = (page.sine[i], page.cosine[i]);
                BodyPose {
                    x: lane::add_times::<FMA>(lane::scale(x, c), y, s),
                    y: lane::add_times::<FMA>(lane::scale(y, c), x, -s),
                    z,
                    origin,
                }
            }
            Motion::Prismatic => BodyPose {
                x,
                y,
                z,
                origin: lane::add_times::<FMA>(origin, z, page.value[i]),
            },
        };
    }
}

#[inline(always)]
fn mass_moments<const FMA: bool>(robot: &Robot, page: &mut Page) {
    for ((pose, (mass, com)), moment) in page
        .bodies
        .iter()
        .zip(&robot.aligned_bodies)
        .zip(&mut page.moments)
    {
        *moment = lane::scale(pose.point_at::<FMA>(com), *mass);
    }
    if robot.root() == Root::Fixed {
        page.moments[0] = ZERO;
    }
    for (i, joint) in robot.aligned.iter().enumerate().rev() {
        page.moments[joint.parent] = lane::add(page.moments[joint.parent], page.moments[i + 1]);
    }
    page.com = lane::scale(page.moments[0], page.inverse_mass);
}

#[inline(always)]
fn centre_of_mass_jacobian<const FMA: bool>(robot: &Robot, page: &mut Page) {
    page.com_jacobian.fill(ZERO);
    if robot.root() == Root::Floating {
        let arm = lane::sub(page.com, page.bodies[0].origin);
        for (k, axis) in AXES.into_iter().enumerate() {
            page.com_jacobian[k] = axis;
            page.com_jacobian[3 + k] = lane::cross(axis, arm);
        }
    }
    let first = robot.root().nv();
    for (i, joint) in robot.aligned.iter().enumerate() {
        let pose = &page.bodies[i + 1];
        let column = match joint.motion {
            Motion::Revolute => {
                let arm = lane::add_times::<FMA>(page.moments[i + 1], pose.origin, -page.subtree_mass[i + 1]);
                lane::cross(pose.z, arm)
            }
            Motion::Prismatic => lane::scale(pose.z, page.subtree_mass[i + 1]),
        };
        let v = first + joint.coordinate;
        page.com_jacobian[v] =
            lane::add_times::<FMA>(page.com_jacobian[v], column, joint.multiplier * page.inverse_mass);
    }
}

/// Unit quaternion stored in `q` of a floating root.
pub(crate) fn root_quaternion(q: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(q[6], q[3], q[4], q[5]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::integrate;
    use crate::robot::{EMBEDDED, embedded};

    /// Both variants of the tree pass, whatever this process has chosen; on a machine without the instructions one of them twice.
    #[test]
    fn variants_of_the_tree_pass_agree() {
        for entry in EMBEDDED {
            let robot = embedded(entry.id).expect("embedded robots are sound");
            for start in 0..50 {
                let number = |i: usize| 3.0 * ((start * 97 + i) as f64 * 0.618_033_988_749_895).fract() - 1.5;
                let step: Vec<f64> = (0..robot.nv()).map(number).collect();
                let q = integrate(&robot, &robot.neutral(), &step);
                let (mut chosen, mut portable) = (Page::new(&robot), Page::new(&robot));
                forward(&robot, &q, &mut chosen);
                TreePass {
                    robot: &robot,
                    q: &q,
                    page: &mut portable,
                }
                .run::<false>();
                let lanes = |page: &Page| {
                    let poses = page
                        .bodies
                        .iter()
                        .flat_map(|pose| [pose.x, pose.y, pose.z, pose.origin]);
                    let columns = page.com_jacobian.iter().copied().chain([page.com]);
                    poses.chain(columns).flatten().collect::<Vec<_>>()
                };
                for (a, b) in lanes(&chosen).iter().zip(lanes(&portable)) {
                    assert!((a - b).abs() <= 1e-13 * b.abs().max(1.0), "{}: {a} {b}", entry.id);
                }
            }
        }
    }
}
