//! Shared by the integration tests: seeded random configurations and every task a robot allows.

use ik_core::boundary::Boundary;
use ik_core::problem::{Kind, Phase, Problem, ProblemParts, Supplies};
use ik_core::robot::{EMBEDDED, FrameId, Robot, Root, embedded};
use ik_core::task::{OrientationCoordinates, Priority, Task, Track, Weights};
use std::sync::Arc;

/// SplitMix64: small, seeded, good enough to draw configurations.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn between(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.next()
    }

    pub(crate) fn vector(&mut self, n: usize, scale: f64) -> Vec<f64> {
        (0..n).map(|_| self.between(-scale, scale)).collect()
    }

    /// A configuration within ±`scale` of neutral.
    pub(crate) fn configuration(&mut self, robot: &Robot, scale: f64) -> Vec<f64> {
        let dq = self.vector(robot.nv(), scale);
        ik_core::configuration::integrate(robot, &robot.neutral(), &dq)
    }
}

pub(crate) fn robots() -> Vec<Arc<Robot>> {
    let mut robots: Vec<_> = EMBEDDED
        .iter()
        .map(|e| Arc::new(embedded(e.id).unwrap()))
        .collect();
    robots.push(Arc::new(mimic_gripper()));
    robots
}

/// Floating base, a driven joint, two joints that mimic it (one prismatic), oblique axes.
fn mimic_gripper() -> Robot {
    let text = r#"<robot name="gripper">
      <link name="base"><inertial><origin xyz="0.1 0 0.05"/><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <link name="a"><inertial><origin xyz="0 0.1 0.02"/><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <link name="b"><inertial><origin xyz="0.03 0 0.1"/><mass value="0.5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <link name="c"><inertial><origin xyz="0 0 0.1"/><mass value="0.7"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <link name="tip"/>
      <joint name="j1" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/><axis xyz="0.6 0 0.8"/><limit lower="-1" upper="2" velocity="3" effort="1"/></joint>
      <joint name="j2" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0.1" rpy="-0.4 0 0.3"/><axis xyz="0 1 0"/><limit lower="-1" upper="2" velocity="3" effort="1"/><mimic joint="j1" multiplier="-1.5" offset="0.2"/></joint>
      <joint name="j3" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0 0.1 0.1" rpy="0.7 0 0"/><axis xyz="0 0.8 -0.6"/><limit lower="-1" upper="2" velocity="3" effort="1"/><mimic joint="j1" multiplier="0.3" offset="0.1"/></joint>
      <joint name="j4" type="continuous"><parent link="c"/><child link="tip"/><origin xyz="0.1 0 0.1" rpy="0 0.5 0"/><axis xyz="0 0 1"/></joint>
    </robot>"#;
    let options = ik_core::robot::UrdfOptions { root: Root::Floating };
    Robot::from_urdf_str(text, "gripper", &options).unwrap()
}

/// Every kind of task on a few frames.
pub(crate) fn tracks(robot: &Robot) -> Vec<Track> {
    let last = robot.frames().len() - 1;
    let mut tracks = vec![Track::CentreOfMass, Track::Posture];
    for f in [last, last / 2, 0] {
        tracks.extend([
            Track::Position(FrameId(f)),
            Track::Orientation(FrameId(f)),
            Track::Pose(FrameId(f)),
        ]);
    }
    tracks
}

/// A problem with the one task, hard or with a full weight matrix.
pub(crate) fn problem(
    robot: &Arc<Robot>,
    track: Track,
    orientation: OrientationCoordinates,
    priority: Priority,
) -> Arc<Problem> {
    let parts = ProblemParts {
        robot: Arc::clone(robot),
        tasks: vec![Task {
            name: "task".into(),
            track,
        }],
        phases: vec![Phase {
            name: "all".into(),
            support: None,
            tasks: vec![(0, priority)],
        }],
        boundary: Boundary::None,
        objectives: vec![],
        kind: Kind::Tracking,
        supplies: Supplies {
            rates: true,
            preview_s: 0.0,
        },
        orientation,
    };
    Arc::new(Problem::new(parts).unwrap())
}

/// A dense positive definite weight matrix.
pub(crate) fn weights(rows: usize) -> Weights {
    let entry = |i: usize, j: usize| {
        let off = 0.3 / (1.0 + (i as f64 - j as f64).abs());
        if i == j { 2.0 + 0.1 * i as f64 } else { off }
    };
    Weights::Matrix(
        (0..rows)
            .map(|i| (0..rows).map(|j| entry(i, j)).collect())
            .collect(),
    )
}
