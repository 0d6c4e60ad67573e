//! The robot: an immutable tree of rigid bodies joined by revolute and prismatic joints.
//!
//! Bodies and joints are numbered depth first, parents before children; joint `i` moves body `i + 1` and body
//! 0 is the root. A body's frame coincides with its joint's frame at joint value zero, so that with `x_w_p`
//! the pose of the parent in the world the child stands at `x_w_p * x_parent_joint * motion(axis, value)`.
//!
//! Configuration `q = [root | coordinates]`, velocity `v = [root | coordinates]`. A floating root contributes
//! its pose in the world, `[x y z qx qy qz qw]`, to `q` and six numbers to `v`; a fixed root contributes
//! nothing. Every joint follows one independent coordinate affinely (mimic joints share one).

use super::aligned::{AlignedJoint, AlignedTree, align};
use super::check;
use super::error::{Place, RobotError};
use super::tree::Tree;
use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Index of a named frame in [`Robot::frames`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FrameId(pub usize);

/// How the root body is attached to the world.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Root {
    /// The root body frame is the world frame.
    #[default]
    Fixed,
    /// Free flyer: `q` starts with the pose of the root body in the world, position in m, then the unit
    /// quaternion in the order x, y, z, w; `v` starts with six numbers.
    Floating,
}

impl Root {
    /// Numbers the root contributes to a configuration.
    pub fn nq(self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Floating => 7,
        }
    }

    /// Numbers the root contributes to a velocity.
    pub fn nv(self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Floating => 6,
        }
    }
}

/// The one-parameter motion a joint allows. A continuous joint is a revolute one with infinite position
/// limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// Rotation about the axis, value in rad.
    Revolute,
    /// Translation along the axis, value in m.
    Prismatic,
}

/// A moving joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Name in the description.
    pub name: String,
    /// Rotation or translation.
    pub motion: Motion,
    /// Index of the body that carries the joint.
    pub parent: usize,
    /// Pose of the joint frame (= child body frame at value zero) in the parent body frame.
    pub x_parent_joint: Isometry3<f64>,
    /// Axis in the joint frame.
    pub axis: Unit<Vector3<f64>>,
    /// Index of the independent coordinate the joint follows.
    pub coordinate: usize,
    /// Joint value = `multiplier * coordinate + offset`; 1 for an independent joint.
    pub multiplier: f64,
    /// See `multiplier`; 0 for an independent joint.
    pub offset: f64,
}

impl Joint {
    /// Pose of the child body in the parent body at a joint value (rad or m).
    pub fn x_parent_child(&self, value: f64) -> Isometry3<f64> {
        match self.motion {
            Motion::Revolute => self.x_parent_joint * UnitQuaternion::from_axis_angle(&self.axis, value),
            Motion::Prismatic => self.x_parent_joint * Translation3::from(self.axis.into_inner() * value),
        }
    }
}

/// An independent joint variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinate {
    /// Name of the independent joint.
    pub name: String,
    /// Limits of the independent joint; limits of joints that mimic it do not enter.
    pub limits: Limits,
}

/// Limits of a coordinate, infinite where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Least value, rad or m.
    pub lower: f64,
    /// Largest value, rad or m.
    pub upper: f64,
    /// Largest speed, rad/s or m/s.
    pub velocity: f64,
    /// Largest torque or force, Nm or N.
    pub effort: f64,
}

impl Limits {
    /// No limit at all.
    pub const UNLIMITED: Self = Self {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        velocity: f64::INFINITY,
        effort: f64::INFINITY,
    };
}

/// A rigid body: a link and everything rigidly attached to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Name of the link the joint moves (of the root link for body 0).
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the body frame, m; zero for a massless body.
    pub com: Vector3<f64>,
    /// Inertia about the centre of mass, in the axes of the body frame, kg m^2.
    pub inertia: Matrix3<f64>,
}

/// A named frame fixed in a body: one per link of the description.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Name of the link.
    pub name: String,
    /// Index of the body it is fixed in.
    pub body: usize,
    /// Pose in the body frame.
    pub x_body_frame: Isometry3<f64>,
}

/// An immutable robot. Made by [`RobotBuilder`](super::RobotBuilder), [`Robot::from_urdf_str`] or
/// [`embedded`](super::embedded()).
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    name: String,
    root: Root,
    joints: Vec<Joint>,
    bodies: Vec<Body>,
    coordinates: Vec<Coordinate>,
    frames: Vec<Frame>,
    /// The tree in aligned axes; body and joint numbers are those of the public tree.
    pub(crate) aligned: Vec<AlignedJoint>,
    /// Mass (kg) and centre of mass (m, aligned body frame) of each body.
    pub(crate) aligned_bodies: Vec<(f64, Vector3<f64>)>,
    /// Body, and rotation and origin in the aligned body frame, of each frame.
    pub(crate) aligned_frames: Vec<(usize, Matrix3<f64>, Vector3<f64>)>,
    /// Joints on the path from the root to each body, ascending, one body after the other.
    pub(crate) support: Vec<usize>,
    /// Body b owns `support[support_start[b]..support_start[b + 1]]`.
    pub(crate) support_start: Vec<usize>,
    /// The subtree of body b is `b..subtree_end[b]`.
    pub(crate) subtree_end: Vec<usize>,
}

impl Robot {
    /// Adds everything that is derived from the tree.
    pub(super) fn from_tree(name: String, root: Root, tree: Tree) -> Self {
        let Tree {
            joints,
            bodies,
            coordinates,
            frames,
        } = tree;
        let AlignedTree {
            joints: aligned,
            bodies: aligned_bodies,
            frames: aligned_frames,
        } = align(&joints, &bodies, &frames);
        let (support, support_start) = support_paths(&joints);
        let subtree_end = subtree_ends(&joints);
        Self {
            name,
            root,
            joints,
            bodies,
            coordinates,
            frames,
            aligned,
            aligned_bodies,
            aligned_frames,
            support,
            support_start,
            subtree_end,
        }
    }

    fn tree(&self) -> Tree {
        Tree {
            joints: self.joints.clone(),
            bodies: self.bodies.clone(),
            coordinates: self.coordinates.clone(),
            frames: self.frames.clone(),
        }
    }

    fn place(&self) -> Place {
        Place::of(&self.name)
    }

    /// Name of the robot.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How the root is attached to the world.
    pub fn root(&self) -> Root {
        self.root
    }

    /// Length of a configuration `q`; coordinate `i` is `q[root().nq() + i]`.
    pub fn nq(&self) -> usize {
        self.root.nq() + self.coordinates.len()
    }

    /// Length of a velocity `v`; the rate of coordinate `i` is `v[root().nv() + i]`.
    pub fn nv(&self) -> usize {
        self.root.nv() + self.coordinates.len()
    }

    /// The moving joints, depth first; joint `i` moves body `i + 1`.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The bodies; 0 is the root.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The independent coordinates, in the order of their joints.
    pub fn coordinates(&self) -> &[Coordinate] {
        &self.coordinates
    }

    /// Every link of the description, in tree order; links behind fixed joints are frames of the body they
    /// belong to.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// The frame (link) of that name.
    ///
    /// # Errors
    /// [`RobotError::UnknownFrame`], which lists the frames there are.
    pub fn frame(&self, name: &str) -> Result<FrameId, RobotError> {
        let found = self.frames.iter().position(|frame| frame.name == name);
        found.map(FrameId).ok_or_else(|| RobotError::UnknownFrame {
            place: self.place(),
            name: name.to_owned(),
            known: self.frames.iter().map(|frame| frame.name.clone()).collect(),
        })
    }

    /// Name of a frame of this robot.
    ///
    /// # Panics
    /// If `id` comes from another robot and is out of range.
    pub fn frame_name(&self, id: FrameId) -> &str {
        &self.frames[id.0].name
    }

    /// Index of the independent coordinate (joint) of that name.
    ///
    /// # Errors
    /// [`RobotError::UnknownCoordinate`], which lists the coordinates there are.
    pub fn coordinate(&self, name: &str) -> Result<usize, RobotError> {
        self.coordinates
            .iter()
            .position(|c| c.name == name)
            .ok_or_else(|| RobotError::UnknownCoordinate {
                place: self.place(),
                name: name.to_owned(),
                known: self.coordinates.iter().map(|c| c.name.clone()).collect(),
            })
    }

    /// Mass of all bodies, that of a fixed root included.
    pub fn total_mass_kg(&self) -> f64 {
        self.bodies.iter().map(|body| body.mass_kg).sum()
    }

    /// The configuration with all coordinates zero and the root at the world frame.
    pub fn neutral(&self) -> Vec<f64> {
        let mut q = vec![0.0; self.nq()];
        if self.root == Root::Floating {
            q[6] = 1.0;
        }
        q
    }

    /// Joints on the path from the root to a body, ascending; empty for body 0.
    pub fn path(&self, body: usize) -> &[usize] {
        &self.support[self.support_start[body]..self.support_start[body + 1]]
    }

    /// The same robot with other limits of one coordinate.
    ///
    /// # Errors
    /// [`RobotError::UnknownCoordinate`], or limits that are reversed, negative (velocity, effort) or NaN.
    pub fn with_limits(&self, name: &str, limits: Limits) -> Result<Self, RobotError> {
        let index = self.coordinate(name)?;
        check::limits(&self.place(), name, &limits)?;
        let mut changed = self.clone();
        changed.coordinates[index].limits = limits;
        Ok(changed)
    }

    /// The same robot with some coordinates held at a value (rad or m), which need not lie within the limits.
    ///
    /// The bodies they move are lumped into the body that carries them, frames move along, joints that mimic
    /// a locked one are locked too. Coordinates are renumbered.
    ///
    /// # Errors
    /// A name that is no independent coordinate, a joint named twice, a value that is not finite.
    pub fn with_locked(&self, locked: &[(&str, f64)]) -> Result<Self, RobotError> {
        let mut values = vec![None; self.coordinates.len()];
        for &(name, value) in locked {
            let index = self.lockable(name)?;
            if !value.is_finite() {
                return Err(self.locked_not_finite(name, value));
            }
            if let Some(first) = values[index].replace(value) {
                let joint = name.to_owned();
                return Err(RobotError::LockedTwice {
                    place: self.place(),
                    joint,
                    first,
                    second: value,
                });
            }
        }
        let tree = self.tree().lock(&values);
        tree.check_finite(&self.place())?;
        Ok(Self::from_tree(self.name.clone(), self.root, tree))
    }

    fn locked_not_finite(&self, name: &str, value: f64) -> RobotError {
        let owner = format!("joint `{name}`");
        RobotError::NotFinite {
            place: self.place(),
            owner,
            field: "value to lock at".to_owned(),
            value,
        }
    }

    fn lockable(&self, name: &str) -> Result<usize, RobotError> {
        let index = self.coordinate(name);
        match self.joints.iter().find(|joint| joint.name == name) {
            Some(joint) if index.is_err() => Err(RobotError::LockedMimic {
                place: self.place(),
                joint: name.to_owned(),
                master: self.coordinates[joint.coordinate].name.clone(),
            }),
            _ => index,
        }
    }

    /// The same robot under another name.
    pub fn renamed(&self, name: &str) -> Self {
        Self {
            name: name.to_owned(),
            ..self.clone()
        }
    }
}

/// Joints on the path to each body as one flat list with the start of each body's part.
fn support_paths(joints: &[Joint]) -> (Vec<usize>, Vec<usize>) {
    let mut support = Vec::new();
    let mut start = vec![0, 0];
    for (i, joint) in joints.iter().enumerate() {
        support.extend_from_within(start[joint.parent]..start[joint.parent + 1]);
        support.push(i);
        start.push(support.len());
    }
    (support, start)
}

/// One past the last body of each body's subtree; bodies are numbered depth first.
fn subtree_ends(joints: &[Joint]) -> Vec<usize> {
    let mut end: Vec<usize> = (1..=joints.len() + 1).collect();
    for (i, joint) in joints.iter().enumerate().rev() {
        end[joint.parent] = end[joint.parent].max(end[i + 1]);
    }
    end
}

#[cfg(test)]
mod tests {
    use crate::robot::embedded;

    #[test]
    fn a_subtree_is_the_bodies_whose_path_goes_through_its_root() {
        for id in ["coman", "coman-legs", "arm7"] {
            let robot = embedded(id).expect("embedded robots are sound");
            let bodies = robot.bodies().len();
            assert_eq!(robot.subtree_end[0], bodies);
            for top in 1..bodies {
                let inside = (0..bodies).filter(|&body| robot.path(body).contains(&(top - 1)));
                assert!(inside.eq(top..robot.subtree_end[top]), "{id} body {top}");
            }
        }
    }
}
