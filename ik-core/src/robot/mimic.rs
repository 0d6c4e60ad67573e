//! Mimic relations: each joint's value as an affine function of one independent joint.

use super::error::{Place, RobotError};
use super::spec::{JointSpec, Mimic};
use std::collections::HashMap;

/// Value = `multiplier * value of the independent joint + offset`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Followed {
    /// Index of the independent joint, the joint's own if it follows none.
    pub(super) joint: usize,
    pub(super) multiplier: f64,
    pub(super) offset: f64,
}

/// The independent joint behind each joint, chains of mimic relations composed.
pub(super) fn resolve(joints: &[(&JointSpec, &Place)]) -> Result<Vec<Followed>, RobotError> {
    let moving = joints
        .iter()
        .enumerate()
        .filter(|(_, (joint, _))| joint.kind.moves());
    let index: HashMap<&str, usize> = moving.map(|(j, (joint, _))| (joint.name.as_str(), j)).collect();
    (0..joints.len()).map(|j| follow(joints, &index, j)).collect()
}

fn follow(
    joints: &[(&JointSpec, &Place)],
    index: &HashMap<&str, usize>,
    start: usize,
) -> Result<Followed, RobotError> {
    let mut at = Followed {
        joint: start,
        multiplier: 1.0,
        offset: 0.0,
    };
    let mut steps = 0;
    while let Some(mimic) = &joints[at.joint].0.mimic {
        let master = index.get(mimic.joint.as_str()).copied();
        let Some(master) = master else {
            return Err(unknown(joints, at.joint, mimic));
        };
        steps += 1;
        if steps > joints.len() {
            return Err(in_loop(joints, index, at.joint));
        }
        at = Followed {
            joint: master,
            multiplier: at.multiplier * mimic.multiplier,
            offset: at.multiplier * mimic.offset + at.offset,
        };
    }
    Ok(at)
}

fn unknown(joints: &[(&JointSpec, &Place)], follower: usize, mimic: &Mimic) -> RobotError {
    let (joint, place) = joints[follower];
    let moving = joints.iter().filter(|(joint, _)| joint.kind.moves());
    RobotError::UnknownMimic {
        place: place.clone(),
        joint: joint.name.clone(),
        master: mimic.joint.clone(),
        known: moving.map(|(joint, _)| joint.name.clone()).collect(),
    }
}

/// The error for the loop that contains the joint `inside`.
fn in_loop(joints: &[(&JointSpec, &Place)], index: &HashMap<&str, usize>, inside: usize) -> RobotError {
    let next = |j: usize| {
        joints[j]
            .0
            .mimic
            .as_ref()
            .and_then(|mimic| index.get(mimic.joint.as_str()).copied())
    };
    let names = std::iter::successors(next(inside), |&j| if j == inside { None } else { next(j) });
    let names = std::iter::once(inside)
        .chain(names)
        .map(|j| joints[j].0.name.clone())
        .collect();
    RobotError::MimicLoop {
        place: joints[inside].1.clone(),
        joints: names,
    }
}
