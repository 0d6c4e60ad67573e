//! The problem of the paper, shared by the integration tests.

use ik_core::boundary::Boundary;
use ik_core::objective::Objective;
use ik_core::problem::{Kind, Phase, Problem, ProblemParts, Supplies};
use ik_core::robot::embedded;
use ik_core::task::{OrientationCoordinates, Priority, Task, Track, Weights};
use std::sync::Arc;

/// The legs of COMAN on the left foot: centre of mass compromised with these weights, soles and torso hard, orientations as rpy.
pub(crate) fn legs(boundary: Boundary, com_weights: Vec<f64>, objectives: Vec<Objective>) -> Arc<Problem> {
    let robot = Arc::new(embedded("coman-legs").unwrap());
    let frame = |name: &str| robot.frame(name).unwrap();
    let tasks = [
        (
            "com",
            Track::CentreOfMass,
            Priority::Compromised(Weights::Diagonal(com_weights)),
        ),
        ("left", Track::Pose(frame("l_sole")), Priority::Hard),
        ("right", Track::Pose(frame("r_sole")), Priority::Hard),
        ("torso", Track::Orientation(frame("Waist")), Priority::Hard),
    ];
    let parts = ProblemParts {
        robot: Arc::clone(&robot),
        tasks: tasks
            .iter()
            .map(|(name, track, _)| Task {
                name: (*name).into(),
                track: *track,
            })
            .collect(),
        phases: vec![Phase {
            name: "all".into(),
            support: Some(frame("l_sole")),
            tasks: tasks
                .iter()
                .enumerate()
                .map(|(i, (_, _, p))| (i, p.clone()))
                .collect(),
        }],
        boundary,
        objectives,
        kind: Kind::Tracking,
        supplies: Supplies {
            rates: true,
            preview_s: 0.0,
        },
        orientation: OrientationCoordinates::RollPitchYaw,
    };
    Arc::new(Problem::new(parts).unwrap())
}
