//! Redundant problems at rest: Melson standing on a foot, an arm of seven joints.

use crate::fixture::{Fixture, parts};
use ik_core::objective::Objective;
use ik_core::problem::ProblemParts;
use ik_core::robot::{Robot, embedded};
use ik_core::task::{OrientationCoordinates, Track};
use std::sync::Arc;

/// Both objectives of the source, unweighted.
pub(crate) fn objectives() -> Vec<Objective> {
    vec![
        Objective::JointCentring,
        Objective::GravityTorque { weights: None },
    ]
}

/// Melson with both feet, both hands and its centre of mass to be held: 21 rows on 25 coordinates. `parts` may be changed
/// before they are checked.
pub(crate) fn melson(support: &str, change: impl FnOnce(&mut ProblemParts)) -> Fixture {
    let robot = Arc::new(embedded("melson").unwrap());
    let frame = |name: &str| robot.frame(name).unwrap();
    let tasks = [
        ("right-foot", Track::Pose(frame("r_foot"))),
        ("left-foot", Track::Pose(frame("l_foot"))),
        ("right-hand", Track::Position(frame("r_hand"))),
        ("left-hand", Track::Position(frame("l_hand"))),
        ("com", Track::CentreOfMass),
    ];
    let mut parts = parts(&robot, &tasks, OrientationCoordinates::RollPitchYaw);
    parts.objectives = objectives();
    parts.phases[0].support = Some(frame(support));
    change(&mut parts);
    Fixture::new(parts, standing(&robot))
}

/// The arm with its last frame to be held: 6 rows on 7 joints.
pub(crate) fn arm() -> Fixture {
    let robot = Arc::new(embedded("arm7").unwrap());
    let last = ik_core::robot::FrameId(robot.frames().len() - 1);
    let mut parts = parts(
        &robot,
        &[("hand", Track::Pose(last))],
        OrientationCoordinates::Log,
    );
    parts.objectives = objectives();
    Fixture::new(parts, vec![0.4, 0.6, -0.3, 1.1, 0.2, 0.7, 0.3])
}

/// Melson's start of the walk, a little asymmetric: knees bent, soles flat, hands in front.
pub(crate) fn standing(robot: &Robot) -> Vec<f64> {
    let mut q = robot.neutral();
    (q[0], q[2]) = (-0.009_413, 0.238);
    let mut set = |joint: &str, value: f64| q[7 + robot.coordinate(joint).unwrap()] = value;
    for (side, outwards) in [("r", -1.0), ("l", 1.0)] {
        set(&format!("{side}_hip_pitch"), -0.5);
        set(&format!("{side}_knee_pitch"), 0.95);
        set(&format!("{side}_ankle_pitch"), -0.45);
        set(&format!("{side}_shoulder_pitch"), 0.2 + 0.05 * outwards);
        set(&format!("{side}_shoulder_roll"), 0.2 * outwards);
        set(&format!("{side}_elbow_pitch"), -1.0);
    }
    q
}
