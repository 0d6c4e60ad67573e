//! Making a robot from links and joints, in code or on behalf of a file reader.
//!
//! `build` checks names, numbers, limits, the tree and the mimic relations in that order and reports the
//! first fault with its place. Links are then numbered depth first, children in the order their joints were
//! given; fixed joints are merged.

use super::check;
use super::error::{Place, RobotError};
use super::mimic::{self, Followed};
use super::model::{Body, Coordinate, Frame, Joint, Limits, Motion, Robot, Root};
use super::order::{self, Edge, Visit};
use super::spec::{Inertial, JointKind, JointSpec, LinkSpec};
use super::tree::Tree;
use nalgebra::{Isometry3, Matrix3, Unit, Vector3};
use std::collections::HashMap;

/// The list of joints on the path to each body grows with the square of the depth; a chain of this many
/// joints needs 4 MiB.
const MAX_JOINTS: usize = 1024;

/// Collects links and joints, in any order.
///
/// ```
/// use ik_core::robot::{JointKind, JointSpec, Limits, LinkSpec, RobotBuilder};
/// use nalgebra::{Isometry3, Vector3};
/// let link = |name: &str| LinkSpec { name: name.to_owned(), inertial: None };
/// let robot = RobotBuilder::new("door")
///     .link(link("frame"))
///     .link(link("leaf"))
///     .joint(JointSpec {
///         name: "hinge".to_owned(),
///         kind: JointKind::Revolute,
///         parent: "frame".to_owned(),
///         child: "leaf".to_owned(),
///         origin: Isometry3::translation(0.4, 0.0, 0.0),
///         axis: Vector3::z(),
///         limits: Some(Limits { lower: 0.0, upper: 1.5, ..Limits::UNLIMITED }),
///         mimic: None,
///     })
///     .build()?;
/// assert_eq!(robot.nq(), 1);
/// # Ok::<(), ik_core::robot::RobotError>(())
/// ```
#[derive(Debug, Clone)]
pub struct RobotBuilder {
    name: String,
    place: Place,
    root: Root,
    links: Vec<(LinkSpec, Place)>,
    joints: Vec<(JointSpec, Place)>,
    locked: Vec<(String, f64)>,
}

impl RobotBuilder {
    /// An empty robot with a fixed root.
    pub fn new(name: &str) -> Self {
        Self::at(name, Place::of(name))
    }

    /// An empty robot described at `place`.
    pub(super) fn at(name: &str, place: Place) -> Self {
        Self {
            name: name.to_owned(),
            place,
            root: Root::Fixed,
            links: Vec::new(),
            joints: Vec::new(),
            locked: Vec::new(),
        }
    }

    /// Adds a link.
    pub fn link(&mut self, link: LinkSpec) -> &mut Self {
        self.link_at(link, Place::of(&self.name))
    }

    pub(super) fn link_at(&mut self, link: LinkSpec, place: Place) -> &mut Self {
        self.links.push((link, place));
        self
    }

    /// Adds a joint.
    pub fn joint(&mut self, joint: JointSpec) -> &mut Self {
        self.joint_at(joint, Place::of(&self.name))
    }

    pub(super) fn joint_at(&mut self, joint: JointSpec, place: Place) -> &mut Self {
        self.joints.push((joint, place));
        self
    }

    /// Lets the root body fly freely.
    pub fn floating_root(&mut self) -> &mut Self {
        self.root = Root::Floating;
        self
    }

    /// Holds an independent joint at a value (rad or m), see [`Robot::with_locked`].
    pub fn lock(&mut self, name: &str, value: f64) -> &mut Self {
        self.locked.push((name.to_owned(), value));
        self
    }

    /// Checks everything and makes the robot.
    ///
    /// # Errors
    /// The first fault found, see [`RobotError`].
    pub fn build(&self) -> Result<Robot, RobotError> {
        let link_index = self.unique_links()?;
        self.check_joints()?;
        let edges = self.edges(&link_index)?;
        let names: Vec<&str> = self.links.iter().map(|(link, _)| link.name.as_str()).collect();
        let visits = order::depth_first(&self.place, &names, &edges)?;
        let (root, visits) = self.take_floating_joint(visits)?;
        let tree = self.tree(&visits)?;
        tree.check_finite(&self.place)?;
        let robot = Robot::from_tree(self.name.clone(), root, tree);
        if self.locked.is_empty() {
            return Ok(robot);
        }
        let locked: Vec<(&str, f64)> = self
            .locked
            .iter()
            .map(|(name, value)| (name.as_str(), *value))
            .collect();
        robot.with_locked(&locked)
    }

    fn unique_links(&self) -> Result<HashMap<&str, usize>, RobotError> {
        if self.links.is_empty() {
            return Err(RobotError::Empty {
                place: self.place.clone(),
            });
        }
        let index = unique(
            "link",
            self.links.iter().map(|(link, place)| (link.name.as_str(), place)),
        )?;
        self.links
            .iter()
            .try_for_each(|(link, place)| check::link(link, place))?;
        Ok(index)
    }

    fn check_joints(&self) -> Result<(), RobotError> {
        unique(
            "joint",
            self.joints
                .iter()
                .map(|(joint, place)| (joint.name.as_str(), place)),
        )?;
        self.joints
            .iter()
            .try_for_each(|(joint, place)| check::joint(joint, place))?;
        let found = self.joints.iter().filter(|(joint, _)| joint.kind.moves()).count();
        if found > MAX_JOINTS {
            return Err(RobotError::TooManyJoints {
                place: self.place.clone(),
                found,
                allowed: MAX_JOINTS,
            });
        }
        Ok(())
    }

    fn edges(&self, link_index: &HashMap<&str, usize>) -> Result<Vec<Edge<'_>>, RobotError> {
        let find = |joint: &JointSpec, place: &Place, role: &'static str, link: &str| {
            link_index
                .get(link)
                .copied()
                .ok_or_else(|| RobotError::UnknownLink {
                    place: place.clone(),
                    joint: joint.name.clone(),
                    role,
                    link: link.to_owned(),
                    known: self.links.iter().map(|(link, _)| link.name.clone()).collect(),
                })
        };
        let mut edges = Vec::with_capacity(self.joints.len());
        for (joint, place) in &self.joints {
            let parent = find(joint, place, "parent", &joint.parent)?;
            let child = find(joint, place, "child", &joint.child)?;
            edges.push(Edge {
                joint: &joint.name,
                place,
                parent,
                child,
            });
        }
        Ok(edges)
    }

    /// The kind of root and the links that are left when a floating joint has been taken off the tree.
    fn take_floating_joint(&self, mut visits: Vec<Visit>) -> Result<(Root, Vec<Visit>), RobotError> {
        let is_floating = |j: &usize| self.joints[*j].0.kind == JointKind::Floating;
        // The last one: a second floating joint further down must not pass unseen.
        let floating = visits
            .iter()
            .rev()
            .find_map(|visit| visit.via.filter(is_floating).map(|j| (visit.parent, j)));
        let Some((parent, j)) = floating else {
            return Ok((self.root, visits));
        };
        let (joint, place) = &self.joints[j];
        if let Some(rule) = self.floating_rule_broken(&visits, parent, joint) {
            return Err(RobotError::FloatingJoint {
                place: place.clone(),
                joint: joint.name.clone(),
                rule,
            });
        }
        visits.remove(0);
        for visit in &mut visits {
            visit.parent = visit.parent.saturating_sub(1);
        }
        visits[0].via = None;
        Ok((Root::Floating, visits))
    }

    fn floating_rule_broken(
        &self,
        visits: &[Visit],
        parent: usize,
        joint: &JointSpec,
    ) -> Option<&'static str> {
        let (root, _) = &self.links[visits[0].link];
        if parent != 0 {
            Some("must hang on the root link")
        } else if visits.iter().skip(1).filter(|visit| visit.parent == 0).count() > 1 {
            Some("must be the only joint of the root link")
        } else if root
            .inertial
            .as_ref()
            .is_some_and(|inertial| inertial.mass_kg > 0.0)
        {
            Some("needs a massless root link, which it replaces")
        } else if joint.origin != Isometry3::identity() {
            Some("must have no origin: the configuration itself is the pose of its child in the world")
        } else {
            None
        }
    }

    /// The tree of the visited links with fixed joints merged and coordinates numbered.
    fn tree(&self, visits: &[Visit]) -> Result<Tree, RobotError> {
        let specs: Vec<(&JointSpec, &Place)> =
            self.joints.iter().map(|(joint, place)| (joint, place)).collect();
        let followed = mimic::resolve(&specs)?;
        let mut coordinates = Vec::new();
        let mut coordinate_of = vec![0; self.joints.len()];
        for j in visits.iter().filter_map(|visit| visit.via) {
            if self.joints[j].0.kind.moves() && followed[j].joint == j {
                coordinate_of[j] = coordinates.len();
                coordinates.push(coordinate(&self.joints[j].0));
            }
        }
        let mut joints = Vec::with_capacity(visits.len());
        let mut rigid = Vec::with_capacity(visits.len());
        for (j, parent) in visits
            .iter()
            .filter_map(|visit| visit.via.map(|j| (j, visit.parent)))
        {
            let joint = &self.joints[j].0;
            joints.push(unmerged_joint(
                joint,
                parent,
                coordinate_of[followed[j].joint],
                &followed[j],
            ));
            rigid.push((!joint.kind.moves()).then_some(0.0));
        }
        let bodies = visits
            .iter()
            .map(|visit| body(&self.links[visit.link].0))
            .collect();
        let frames = visits
            .iter()
            .enumerate()
            .map(|(body, visit)| frame(&self.links[visit.link].0, body))
            .collect();
        Ok(Tree {
            joints,
            bodies,
            coordinates,
            frames,
        }
        .merge(&rigid))
    }
}

fn coordinate(joint: &JointSpec) -> Coordinate {
    let mut limits = joint.limits.unwrap_or(Limits::UNLIMITED);
    if joint.kind == JointKind::Continuous {
        limits = Limits {
            velocity: limits.velocity,
            effort: limits.effort,
            ..Limits::UNLIMITED
        };
    }
    Coordinate {
        name: joint.name.clone(),
        limits,
    }
}

/// The joint between two links; a fixed one is a joint about any axis that `Tree::merge` holds at zero.
fn unmerged_joint(joint: &JointSpec, parent: usize, coordinate: usize, followed: &Followed) -> Joint {
    Joint {
        name: joint.name.clone(),
        motion: if joint.kind == JointKind::Prismatic {
            Motion::Prismatic
        } else {
            Motion::Revolute
        },
        parent,
        x_parent_joint: joint.origin,
        axis: if joint.kind.moves() {
            Unit::new_normalize(joint.axis)
        } else {
            Vector3::x_axis()
        },
        coordinate,
        multiplier: followed.multiplier,
        offset: followed.offset,
    }
}

fn body(link: &LinkSpec) -> Body {
    let name = link.name.clone();
    match &link.inertial {
        Some(Inertial {
            mass_kg,
            com,
            inertia,
        }) => {
            // A massless link has no centre of mass; whatever the file says is ignored.
            let com = if *mass_kg > 0.0 { *com } else { Vector3::zeros() };
            Body {
                name,
                mass_kg: *mass_kg,
                com,
                inertia: *inertia,
            }
        }
        None => Body {
            name,
            mass_kg: 0.0,
            com: Vector3::zeros(),
            inertia: Matrix3::zeros(),
        },
    }
}

fn frame(link: &LinkSpec, body: usize) -> Frame {
    Frame {
        name: link.name.clone(),
        body,
        x_body_frame: Isometry3::identity(),
    }
}

/// Index by name, or the second element of a name that occurs twice.
fn unique<'a>(
    what: &'static str,
    names: impl Iterator<Item = (&'a str, &'a Place)>,
) -> Result<HashMap<&'a str, usize>, RobotError> {
    let mut seen: HashMap<&str, (usize, &Place)> = HashMap::new();
    for (i, (name, place)) in names.enumerate() {
        if let Some((_, first)) = seen.insert(name, (i, place)) {
            let (name, place, first) = (name.to_owned(), place.clone(), first.clone());
            return Err(RobotError::Duplicate {
                place,
                what,
                name,
                first,
            });
        }
    }
    Ok(seen.into_iter().map(|(name, (i, _))| (name, i)).collect())
}
