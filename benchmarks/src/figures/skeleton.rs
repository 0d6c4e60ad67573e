//! A robot as a stick figure: bodies joined to their parents' origins, frames at the ends of limbs, soles.
//!
//! Sides are told from a configuration in which it stands, x forwards and y to the left, so that any robot can be drawn.

use super::panel::{Curve, Markers};
use super::style::{Dash, LEFT, RIGHT, Style, TRUNK};
use crate::records::Trace;
use ik_core::kinematics::{Page, forward};
use ik_core::robot::{FrameId, Robot, Root};
use nalgebra::{Isometry3, Point3};

/// Bones shorter than this (m) are not drawn: joints with a common point.
const LEAST_BONE_M: f64 = 1e-6;
/// Bones that end less than this (m) beside the middle plane belong to no side.
const MIDDLE_M: f64 = 1e-3;

/// Bones are short, so are their dashes.
const SHORT_LEFT: Style = Style {
    dash: Dash::Short,
    ..LEFT
};

/// What is seen of space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    /// x to the right, z up: from the robot's right.
    Side,
    /// y to the right, z up: from before the robot.
    Front,
}

impl View {
    pub(super) fn point(self, p: &Point3<f64>) -> (f64, f64) {
        match self {
            Self::Side => (p.x, p.z),
            Self::Front => (p.y, p.z),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Right,
    Trunk,
    Left,
}

impl Side {
    fn look(self) -> (&'static str, Style) {
        match self {
            Self::Right => ("right limbs", RIGHT),
            Self::Trunk => ("trunk", TRUNK),
            Self::Left => ("left limbs", SHORT_LEFT),
        }
    }
}

/// A polyline through points fixed in frames.
#[derive(Clone, Debug)]
struct Bone {
    points: Vec<(FrameId, Point3<f64>)>,
    side: Side,
}

/// What is drawn of a robot.
#[derive(Clone, Debug)]
pub(super) struct Skeleton {
    /// Frame of each body.
    bodies: Vec<FrameId>,
    bones: Vec<Bone>,
    /// Poses of all frames while it stands.
    standing: Vec<Isometry3<f64>>,
}

impl Skeleton {
    /// Every body joined to its parent; sides are those of the configuration `standing` (length nq).
    pub(super) fn new(robot: &Robot, standing: &[f64]) -> Self {
        let bodies = robot
            .bodies()
            .iter()
            .map(|b| {
                robot
                    .frame(&b.name)
                    .expect("the link that names a body is a frame at its origin")
            })
            .collect();
        let mut skeleton = Self {
            bodies,
            bones: Vec::new(),
            standing: poses(robot, standing),
        };
        for (i, joint) in robot.joints().iter().enumerate() {
            skeleton.join(joint.parent, skeleton.bodies[i + 1]);
        }
        skeleton
    }

    /// Adds what is between the origin of its body and a frame; nothing if the robot has no such frame.
    pub(super) fn end(&mut self, robot: &Robot, frame: &str) {
        if let Ok(id) = robot.frame(frame) {
            self.join(robot.frames()[id.0].body, id);
        }
    }

    /// Adds a frame and the rectangle of a sole around it; nothing if the robot has no such frame.
    pub(super) fn sole(&mut self, robot: &Robot, frame: &str, [half_length_m, half_width_m]: [f64; 2]) {
        let Ok(id) = robot.frame(frame) else { return };
        self.end(robot, frame);
        let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
        let points = corners.map(|(x, y)| (id, Point3::new(x * half_length_m, y * half_width_m, 0.0)));
        self.bones.push(Bone {
            points: points.to_vec(),
            side: self.side(id),
        });
    }

    fn join(&mut self, parent: usize, to: FrameId) {
        let from = self.bodies[parent];
        let between = self.standing[to.0].translation.vector - self.standing[from.0].translation.vector;
        if between.norm() < LEAST_BONE_M {
            return;
        }
        self.bones.push(Bone {
            points: vec![(from, Point3::origin()), (to, Point3::origin())],
            // The root body is the trunk, however far its joints are from the middle.
            side: if parent == 0 { Side::Trunk } else { self.side(to) },
        });
    }

    fn side(&self, frame: FrameId) -> Side {
        let y = self.standing[frame.0].translation.y;
        if y < -MIDDLE_M {
            Side::Right
        } else if y > MIDDLE_M {
            Side::Left
        } else {
            Side::Trunk
        }
    }

    /// The robot at a configuration (length nq), moved to the right by `aside_m`. What is farther from the eye comes first.
    pub(super) fn curves(&self, robot: &Robot, q: &[f64], view: View, aside_m: f64) -> Vec<Curve> {
        let poses = poses(robot, q);
        let place = |(frame, p): &(FrameId, Point3<f64>)| {
            let (x, z) = view.point(&(poses[frame.0] * p));
            (x + aside_m, z)
        };
        let of_side = |side: Side| {
            let (name, style) = side.look();
            let bones = self.bones.iter().filter(move |b| b.side == side);
            bones.map(move |bone| Curve {
                name: name.to_owned(),
                points: bone.points.iter().map(place).collect(),
                style,
                width: 2.0,
                markers: Markers::None,
            })
        };
        let from_afar = [Side::Left, Side::Trunk, Side::Right];
        from_afar.into_iter().flat_map(of_side).collect()
    }
}

/// Pose of every frame.
fn poses(robot: &Robot, q: &[f64]) -> Vec<Isometry3<f64>> {
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    (0..robot.frames().len())
        .map(|i| page.frame_pose(robot, FrameId(i)))
        .collect()
}

/// The configurations (length nq) of a trace; none if it lacks a column of them.
pub(super) fn configurations(robot: &Robot, trace: &Trace) -> Option<Vec<Vec<f64>>> {
    let root: &[&str] = match robot.root() {
        Root::Fixed => &[],
        Root::Floating => &[
            "base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw",
        ],
    };
    let joints = robot.coordinates().iter().map(|c| c.name.as_str());
    let names = root.iter().copied().chain(joints);
    let place = |name: &str| trace.columns.iter().position(|c| c == name);
    let places: Vec<usize> = names.map(place).collect::<Option<_>>()?;
    let of_row = |row: &Vec<f64>| places.iter().map(|i| row[*i]).collect();
    Some(trace.rows.iter().map(of_row).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ik_core::robot::embedded;

    fn lengths(curves: &[Curve], name: &str) -> Vec<f64> {
        let length = |c: &Curve| {
            let steps = c.points.windows(2);
            steps.map(|w| (w[1].0 - w[0].0).hypot(w[1].1 - w[0].1)).sum()
        };
        curves.iter().filter(|c| c.name == name).map(length).collect()
    }

    #[test]
    fn bones_have_the_lengths_of_the_robot_and_the_sides_mirror_each_other() {
        let robot = embedded("bioloid").unwrap();
        let mut skeleton = Skeleton::new(&robot, &robot.neutral());
        skeleton.end(&robot, "r_hand");
        skeleton.sole(&robot, "r_foot", [0.052, 0.032]);
        let q = robot.neutral();
        let side = skeleton.curves(&robot, &q, View::Side, 1.0);
        // Upper arm, thigh, calf and foot of the paper, its forearm, and the sole there and back.
        let mut right = lengths(&side, "right limbs");
        right.sort_by(f64::total_cmp);
        let expected = [0.030_779, 0.051_78, 0.069_31, 0.077_382_9, 0.078_092_9, 0.208];
        assert_eq!(right.len(), expected.len(), "{right:?}");
        for (found, expected) in right.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{right:?}");
        }
        // Without hand and sole the left side has three bones: upper arm, thigh, calf.
        assert_eq!(lengths(&side, "left limbs").len(), 3);
        let front = skeleton.curves(&robot, &q, View::Front, 0.0);
        for (name, sign) in [("right limbs", -1.0), ("left limbs", 1.0)] {
            let mut points = front.iter().filter(|c| c.name == name).flat_map(|c| &c.points);
            assert!(points.all(|p| p.0 * sign > 0.0), "{name}");
        }
    }

    #[test]
    fn bones_keep_their_lengths_when_the_robot_moves() {
        let robot = embedded("bioloid").unwrap();
        let skeleton = Skeleton::new(&robot, &robot.neutral());
        let mut q = robot.neutral();
        // About y only: in the side view nothing is foreshortened.
        for name in ["r_hip_pitch", "r_knee_pitch"] {
            q[7 + robot.coordinate(name).unwrap()] = 0.7;
        }
        let curves = [robot.neutral(), q].map(|q| skeleton.curves(&robot, &q, View::Side, 0.0));
        let [still, moved] = curves.each_ref().map(|c| lengths(c, "right limbs"));
        assert!(
            still.iter().zip(&moved).all(|(a, b)| (a - b).abs() < 1e-12),
            "{still:?} {moved:?}"
        );
        let knee = |c: &[Curve]| {
            c.iter()
                .filter(|c| c.name == "right limbs")
                .flat_map(|c| c.points.clone())
                .fold(0.0, |m, p| f64::max(m, p.0.abs()))
        };
        assert!(knee(&curves[0]) < 1e-12 && knee(&curves[1]) > 0.04);
    }

    #[test]
    fn configurations_need_every_column() {
        let robot = embedded("bioloid").unwrap();
        let mut columns: Vec<String> = [
            "base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw",
        ]
        .map(str::to_owned)
        .to_vec();
        columns.extend(robot.coordinates().iter().map(|c| c.name.clone()));
        let rows = vec![robot.neutral()];
        let whole = Trace { columns, rows };
        assert_eq!(configurations(&robot, &whole), Some(vec![robot.neutral()]));
        let mut less = whole;
        less.columns[3] = "other".to_owned();
        assert_eq!(configurations(&robot, &less), None);
    }
}
