//! The bare tree a robot is made of, and the one operation on it: making joints rigid.
//!
//! A fixed joint of a description and a joint locked at a value are the same thing, a joint whose child is
//! merged into its parent: masses add, centres of mass average, inertias add about the common centre of mass
//! by the parallel axis theorem.

use super::check::not_finite_in;
use super::error::{Place, RobotError};
use super::model::{Body, Coordinate, Frame, Joint};
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Joints (depth first, joint `i` moves body `i + 1`), bodies, independent coordinates and frames.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    pub(super) joints: Vec<Joint>,
    pub(super) bodies: Vec<Body>,
    pub(super) coordinates: Vec<Coordinate>,
    pub(super) frames: Vec<Frame>,
}

impl Tree {
    /// The tree with every coordinate that has a value held there; the remaining ones keep their order.
    pub(super) fn lock(self, values: &[Option<f64>]) -> Self {
        let rigid: Vec<Option<f64>> = self
            .joints
            .iter()
            .map(|joint| values[joint.coordinate].map(|value| joint.multiplier * value + joint.offset))
            .collect();
        let mut merged = self.merge(&rigid);
        let mut renumbered = Vec::with_capacity(values.len());
        let mut next = 0;
        for value in values {
            renumbered.push(next);
            next += usize::from(value.is_none());
        }
        for joint in &mut merged.joints {
            joint.coordinate = renumbered[joint.coordinate];
        }
        let free = |(coordinate, value): (Coordinate, &Option<f64>)| value.is_none().then_some(coordinate);
        merged.coordinates = merged
            .coordinates
            .into_iter()
            .zip(values)
            .filter_map(free)
            .collect();
        merged
    }

    /// The tree with every joint that has a value made rigid at that joint value; coordinates are left as
    /// they are.
    pub(super) fn merge(self, rigid: &[Option<f64>]) -> Self {
        let mut bodies = self.bodies.into_iter();
        let mut merged = Self {
            joints: Vec::new(),
            bodies: bodies.by_ref().take(1).collect(),
            coordinates: self.coordinates,
            frames: self.frames,
        };
        // For each old body: the new body it belongs to and its pose there.
        let mut home: Vec<(usize, Isometry3<f64>)> = vec![(0, Isometry3::identity())];
        for ((mut joint, body), value) in self.joints.into_iter().zip(bodies).zip(rigid) {
            let (parent, x_new_old) = home[joint.parent];
            joint.parent = parent;
            joint.x_parent_joint = x_new_old * joint.x_parent_joint;
            if let Some(value) = value {
                let x_parent_child = joint.x_parent_child(*value);
                lump(&mut merged.bodies[parent], &body, &x_parent_child);
                home.push((parent, x_parent_child));
            } else {
                home.push((merged.bodies.len(), Isometry3::identity()));
                merged.joints.push(joint);
                merged.bodies.push(body);
            }
        }
        for frame in &mut merged.frames {
            let (body, x_new_old) = home[frame.body];
            frame.body = body;
            frame.x_body_frame = x_new_old * frame.x_body_frame;
        }
        merged
    }

    /// Refuses a tree whose numbers overflowed when they were combined.
    pub(super) fn check_finite(&self, place: &Place) -> Result<(), RobotError> {
        let fault = |owner: String, field: &str, value: f64| {
            Err(RobotError::NotFinite {
                place: place.clone(),
                owner,
                field: field.to_owned(),
                value,
            })
        };
        for body in &self.bodies {
            let numbers = body.com.iter().chain(body.inertia.iter()).chain([&body.mass_kg]);
            if let Some(&value) = numbers.clone().find(|x| !x.is_finite()) {
                return fault(
                    format!("link `{}`", body.name),
                    "combined mass, centre of mass or inertia",
                    value,
                );
            }
        }
        for joint in &self.joints {
            if let Some(value) = not_finite_in(&joint.x_parent_joint) {
                return fault(
                    format!("joint `{}`", joint.name),
                    "pose in the parent body",
                    value,
                );
            }
            if let Some(value) = [joint.multiplier, joint.offset]
                .into_iter()
                .find(|x| !x.is_finite())
            {
                return fault(
                    format!("joint `{}`", joint.name),
                    "combined mimic multiplier or offset",
                    value,
                );
            }
        }
        for frame in &self.frames {
            if let Some(value) = not_finite_in(&frame.x_body_frame) {
                return fault(format!("link `{}`", frame.name), "pose in its body", value);
            }
        }
        Ok(())
    }
}

/// Adds a body at pose `x_into_body` to the body `into`.
fn lump(into: &mut Body, body: &Body, x_into_body: &Isometry3<f64>) {
    let rotation = x_into_body.rotation.to_rotation_matrix();
    let inertia = rotation.matrix() * body.inertia * rotation.matrix().transpose();
    let com = (x_into_body * nalgebra::Point3::from(body.com)).coords;
    let mass_kg = into.mass_kg + body.mass_kg;
    if body.mass_kg > 0.0 {
        let common = into.com + (com - into.com) * (body.mass_kg / mass_kg);
        into.inertia +=
            point_inertia(into.mass_kg, &(into.com - common)) + point_inertia(body.mass_kg, &(com - common));
        into.com = common;
    }
    into.inertia += inertia;
    into.mass_kg = mass_kg;
}

/// Inertia about the origin of a point mass at `p`: m (p^T p 1 - p p^T).
fn point_inertia(mass_kg: f64, p: &Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * p.norm_squared() - p * p.transpose()) * mass_kg
}
