//! Reading URDF, the Unified Robot Description Format (`<robot>` with `<link>` and `<joint>` elements).
//!
//! Only what kinematics and statics need is read: link/inertial (origin, mass, inertia) and joint/type,
//! parent, child, origin, axis, limit, mimic. Everything else (visual, collision, transmission, gazebo ..) is
//! ignored. `rpy` is the rotation `Rz(yaw) Ry(pitch) Rx(roll)`. No mesh, no other file is opened.

use super::builder::RobotBuilder;
use super::error::{Place, RobotError};
use super::model::{Limits, Robot, Root};
use super::spec::{Inertial, JointKind, JointSpec, LinkSpec, Mimic};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};
use std::path::Path;

/// What a URDF file does not say.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct UrdfOptions {
    /// How the root link is attached to the world. A joint of type `floating` under the root link makes it
    /// floating too.
    pub root: Root,
}

impl Robot {
    /// Reads a URDF from text; `source_name` stands for it in errors.
    ///
    /// # Errors
    /// Malformed XML or a description that is no robot, with the line, see [`RobotError`].
    pub fn from_urdf_str(text: &str, source_name: &str, options: &UrdfOptions) -> Result<Self, RobotError> {
        let document = Document::parse(text).map_err(|error| RobotError::Xml {
            place: Place::line(source_name, error.pos().row),
            reason: error.to_string(),
        })?;
        let reader = Reader {
            document: &document,
            source: source_name,
        };
        let robot = document.root_element();
        if robot.tag_name().name() != "robot" {
            let found = robot.tag_name().name().to_owned();
            return Err(RobotError::NotUrdf {
                place: reader.place(robot),
                found,
            });
        }
        let name = reader.attribute(robot, "the <robot> element", "name")?;
        let mut builder = RobotBuilder::at(name, Place::of(source_name));
        if options.root == Root::Floating {
            builder.floating_root();
        }
        for node in robot.children().filter(Node::is_element) {
            match node.tag_name().name() {
                "link" => builder.link_at(reader.link(node)?, reader.place(node)),
                "joint" => builder.joint_at(reader.joint(node)?, reader.place(node)),
                _ => &mut builder,
            };
        }
        builder.build()
    }

    /// Reads a URDF file.
    ///
    /// # Errors
    /// As [`Robot::from_urdf_str`], and a file that cannot be read.
    pub fn from_urdf_file(path: impl AsRef<Path>, options: &UrdfOptions) -> Result<Self, RobotError> {
        let path = path.as_ref().display().to_string();
        let text = std::fs::read_to_string(&path);
        let text = text.map_err(|error| RobotError::File {
            path: path.clone(),
            reason: error.to_string(),
        })?;
        Self::from_urdf_str(&text, &path, options)
    }
}

/// A parsed document and the name errors give it.
#[derive(Clone, Copy)]
struct Reader<'a, 'input> {
    document: &'a Document<'input>,
    source: &'a str,
}

impl<'a, 'input> Reader<'a, 'input> {
    fn link(self, node: Node<'a, 'input>) -> Result<LinkSpec, RobotError> {
        let name = self.attribute(node, "a link", "name")?.to_owned();
        let owner = format!("link `{name}`");
        let inertial = self.child(node, &owner, "inertial")?;
        let inertial = inertial
            .map(|inertial| self.inertial(inertial, &owner))
            .transpose()?;
        Ok(LinkSpec { name, inertial })
    }

    fn inertial(self, node: Node<'a, 'input>, owner: &str) -> Result<Inertial, RobotError> {
        let x_link_inertial = self.origin(node, owner)?;
        let mass = self.required_child(node, owner, "mass")?;
        let inertia = self.required_child(node, owner, "inertia")?;
        let entry = |name: &str| self.number(inertia, owner, name);
        let (xx, xy, xz) = (entry("ixx")?, entry("ixy")?, entry("ixz")?);
        let (yy, yz, zz) = (entry("iyy")?, entry("iyz")?, entry("izz")?);
        let rotation = x_link_inertial.rotation.to_rotation_matrix();
        let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Ok(Inertial {
            mass_kg: self.number(mass, owner, "value")?,
            com: x_link_inertial.translation.vector,
            inertia: rotation.matrix() * inertia * rotation.matrix().transpose(),
        })
    }

    fn joint(self, node: Node<'a, 'input>) -> Result<JointSpec, RobotError> {
        let name = self.attribute(node, "a joint", "name")?.to_owned();
        let owner = format!("joint `{name}`");
        let kind = self.kind(node, &name, &owner)?;
        let parent = self.required_child(node, &owner, "parent")?;
        let child = self.required_child(node, &owner, "child")?;
        Ok(JointSpec {
            kind,
            parent: self.attribute(parent, &owner, "link")?.to_owned(),
            child: self.attribute(child, &owner, "link")?.to_owned(),
            origin: self.origin(node, &owner)?,
            axis: self.axis(node, &owner)?,
            limits: self.limits(node, &owner)?,
            mimic: self.mimic(node, &owner)?,
            name,
        })
    }

    fn kind(self, node: Node<'a, 'input>, joint: &str, owner: &str) -> Result<JointKind, RobotError> {
        match self.attribute(node, owner, "type")? {
            "revolute" => Ok(JointKind::Revolute),
            "continuous" => Ok(JointKind::Continuous),
            "prismatic" => Ok(JointKind::Prismatic),
            "fixed" => Ok(JointKind::Fixed),
            "floating" => Ok(JointKind::Floating),
            other => Err(RobotError::UnknownJointType {
                place: self.place(node),
                joint: joint.to_owned(),
                found: other.to_owned(),
            }),
        }
    }

    /// The pose in `<origin xyz=".." rpy=".."/>`; both default to zero.
    fn origin(self, node: Node<'a, 'input>, owner: &str) -> Result<Isometry3<f64>, RobotError> {
        let Some(origin) = self.child(node, owner, "origin")? else {
            return Ok(Isometry3::identity());
        };
        let xyz = self.optional_vector(origin, owner, "xyz")?.unwrap_or_default();
        let rpy = self.optional_vector(origin, owner, "rpy")?.unwrap_or_default();
        let rotation = UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z);
        Ok(Isometry3::from_parts(Translation3::from(xyz), rotation))
    }

    /// The axis; without the element it is x.
    fn axis(self, node: Node<'a, 'input>, owner: &str) -> Result<Vector3<f64>, RobotError> {
        let Some(axis) = self.child(node, owner, "axis")? else {
            return Ok(Vector3::x());
        };
        let found = self.optional_vector(axis, owner, "xyz")?;
        found.ok_or_else(|| self.missing(axis, owner, "attribute `xyz` of <axis>"))
    }

    /// `lower` and `upper` default to zero, `velocity` and `effort` are required.
    fn limits(self, node: Node<'a, 'input>, owner: &str) -> Result<Option<Limits>, RobotError> {
        let Some(limit) = self.child(node, owner, "limit")? else {
            return Ok(None);
        };
        Ok(Some(Limits {
            lower: self.optional_number(limit, owner, "lower")?.unwrap_or(0.0),
            upper: self.optional_number(limit, owner, "upper")?.unwrap_or(0.0),
            velocity: self.number(limit, owner, "velocity")?,
            effort: self.number(limit, owner, "effort")?,
        }))
    }

    fn mimic(self, node: Node<'a, 'input>, owner: &str) -> Result<Option<Mimic>, RobotError> {
        let Some(mimic) = self.child(node, owner, "mimic")? else {
            return Ok(None);
        };
        Ok(Some(Mimic {
            joint: self.attribute(mimic, owner, "joint")?.to_owned(),
            multiplier: self.optional_number(mimic, owner, "multiplier")?.unwrap_or(1.0),
            offset: self.optional_number(mimic, owner, "offset")?.unwrap_or(0.0),
        }))
    }

    fn optional_vector(
        self,
        node: Node<'a, 'input>,
        owner: &str,
        attribute: &str,
    ) -> Result<Option<Vector3<f64>>, RobotError> {
        let Some(text) = node.attribute(attribute) else {
            return Ok(None);
        };
        let numbers: Result<Vec<f64>, _> = text.split_ascii_whitespace().map(str::parse).collect();
        match numbers.as_deref() {
            Ok(&[x, y, z]) => {
                let vector = Vector3::new(x, y, z);
                vector
                    .iter()
                    .try_for_each(|&value| self.finite(node, owner, attribute, value))?;
                Ok(Some(vector))
            }
            _ => Err(self.unreadable(node, owner, attribute, text, "three numbers separated by blanks")),
        }
    }

    fn number(self, node: Node<'a, 'input>, owner: &str, attribute: &str) -> Result<f64, RobotError> {
        let found = self.optional_number(node, owner, attribute)?;
        found.ok_or_else(|| self.missing_attribute(node, owner, attribute))
    }

    fn optional_number(
        self,
        node: Node<'a, 'input>,
        owner: &str,
        attribute: &str,
    ) -> Result<Option<f64>, RobotError> {
        let Some(text) = node.attribute(attribute) else {
            return Ok(None);
        };
        match text.trim_ascii().parse() {
            Ok(value) => {
                self.finite(node, owner, attribute, value)?;
                Ok(Some(value))
            }
            Err(_) => Err(self.unreadable(node, owner, attribute, text, "a number")),
        }
    }

    fn finite(
        self,
        node: Node<'a, 'input>,
        owner: &str,
        attribute: &str,
        value: f64,
    ) -> Result<(), RobotError> {
        if value.is_finite() {
            return Ok(());
        }
        let field = field(node, attribute);
        Err(RobotError::NotFinite {
            place: self.place(node),
            owner: owner.to_owned(),
            field,
            value,
        })
    }

    /// The child element of that name; more than one is an error.
    fn child(
        self,
        node: Node<'a, 'input>,
        owner: &str,
        name: &str,
    ) -> Result<Option<Node<'a, 'input>>, RobotError> {
        let mut found = node
            .children()
            .filter(|child| child.is_element() && child.tag_name().name() == name);
        let first = found.next();
        match found.next() {
            Some(second) => Err(RobotError::Repeated {
                place: self.place(second),
                owner: owner.to_owned(),
                element: name.to_owned(),
            }),
            None => Ok(first),
        }
    }

    fn required_child(
        self,
        node: Node<'a, 'input>,
        owner: &str,
        name: &str,
    ) -> Result<Node<'a, 'input>, RobotError> {
        let found = self.child(node, owner, name)?;
        found.ok_or_else(|| self.missing(node, owner, &format!("element <{name}>")))
    }

    fn attribute(self, node: Node<'a, 'input>, owner: &str, name: &str) -> Result<&'a str, RobotError> {
        node.attribute(name)
            .ok_or_else(|| self.missing_attribute(node, owner, name))
    }

    fn missing_attribute(self, node: Node<'a, 'input>, owner: &str, name: &str) -> RobotError {
        self.missing(
            node,
            owner,
            &format!("attribute `{name}` of <{}>", node.tag_name().name()),
        )
    }

    fn missing(self, node: Node<'a, 'input>, owner: &str, missing: &str) -> RobotError {
        let (owner, missing) = (owner.to_owned(), missing.to_owned());
        RobotError::Missing {
            place: self.place(node),
            owner,
            missing,
        }
    }

    fn unreadable(
        self,
        node: Node<'a, 'input>,
        owner: &str,
        attribute: &str,
        text: &str,
        expected: &'static str,
    ) -> RobotError {
        let (owner, found) = (owner.to_owned(), text.to_owned());
        let field = field(node, attribute);
        RobotError::Number {
            place: self.place(node),
            owner,
            field,
            found,
            expected,
        }
    }

    fn place(self, node: Node<'a, 'input>) -> Place {
        Place::line(self.source, self.document.text_pos_at(node.range().start).row)
    }
}

fn field(node: Node<'_, '_>, attribute: &str) -> String {
    format!("<{} {attribute}>", node.tag_name().name())
}
