//! The closed forms on the embedded humanoids: their limbs, from the poses the robots' own kinematics give.

#![allow(clippy::unwrap_used, missing_docs, reason = "tests")]

use ik_core::kinematics::{Page, forward};
use ik_core::robot::{Robot, embedded};
use ik_methods::reverse_decoupling::{Arm, ElbowArm, Leg, LimbPose, Solutions, distance};
use std::f64::consts::{FRAC_PI_2, PI};

const POSES: usize = 2000;

/// Multiples of the golden ratio in ±π: they do not repeat.
fn angle(i: usize) -> f64 {
    PI * (2.0 * ((i + 1) as f64 * 0.618_033_988_749_894_9).fract() - 1.0)
}

fn posture(robot: &Robot, k: usize) -> Vec<f64> {
    let mut q = robot.neutral();
    q[7..]
        .iter_mut()
        .enumerate()
        .for_each(|(i, q)| *q = angle(97 * k + i));
    q
}

/// The joints of a limb in `q`, and the pose of its end in the frame of its first joint.
fn limb<const N: usize>(
    robot: &Robot,
    page: &Page,
    q: &[f64],
    limb: &str,
    end: &str,
) -> ([f64; N], LimbPose) {
    let index = |i: usize| robot.coordinate(&format!("{limb}_{}", i + 1)).unwrap();
    let first = robot
        .joints()
        .iter()
        .find(|j| j.name == format!("{limb}_1"))
        .unwrap();
    let base = page.frame_pose(robot, robot.frame("waist").unwrap()) * first.x_parent_joint;
    let in_base = base.inverse() * page.frame_pose(robot, robot.frame(end).unwrap());
    let pose = LimbPose {
        rotation: in_base.rotation.to_rotation_matrix().into_inner(),
        position: in_base.translation.vector,
    };
    (std::array::from_fn(|i| q[7 + index(i)]), pose)
}

fn among<const N: usize>(all: &Solutions<N>, q: &[f64; N]) -> bool {
    all.iter().any(|(solution, _)| distance(solution, q) < 1e-6)
}

/// Robot; leg lengths l3, l4, l5, d3 of the right leg; arm lengths l2, l3, l4; θ5 − q5 of the arm.
const ROBOTS: [(&str, [f64; 4], [f64; 3], f64); 4] = [
    (
        "hubo",
        [0.30003, 0.30038, 0.09497, 0.0],
        [0.17914, 0.18159, 0.12065],
        0.0,
    ),
    ("hoap2", [0.1, 0.1, 0.037, 0.0], [0.101, 0.1, 0.033], 0.0),
    ("hrp2", [0.3, 0.3, 0.105, 0.035], [0.25, 0.25, 0.15], FRAC_PI_2),
    ("asimo", [0.28, 0.3, 0.09, 0.0], [0.24, 0.22, 0.12], 0.0),
];

#[test]
fn every_limb_of_every_robot_is_solved() {
    for (id, leg, arm, offset) in ROBOTS {
        let robot = embedded(id).unwrap();
        let mut page = Page::new(&robot);
        let (mut found, mut asked) = (0, 0);
        for k in 0..POSES {
            let q = posture(&robot, k);
            forward(&robot, &q, &mut page);
            for (side, sign) in [("r", 1.0), ("l", -1.0)] {
                let leg = Leg {
                    thigh_m: leg[0],
                    shank_m: leg[1],
                    ankle_m: leg[2],
                    hip_offset_m: sign * leg[3],
                };
                let (joints, pose) =
                    limb::<6>(&robot, &page, &q, &format!("{side}_leg"), &format!("{side}_foot"));
                let mut all = Solutions::default();
                leg.solve_all(&pose, &joints, &mut all).unwrap();
                found += usize::from(among(&all, &joints));
                let arm = Arm {
                    upper_arm_m: arm[0],
                    forearm_m: arm[1],
                    hand_m: arm[2],
                };
                let (limb_name, end) = (format!("{side}_arm"), format!("{side}_hand"));
                if id == "hoap2" {
                    let (joints, pose) = limb::<4>(&robot, &page, &q, &limb_name, &end);
                    let mut both = Solutions::default();
                    ElbowArm { arm }.solve_all(&pose, &joints, &mut both).unwrap();
                    found += usize::from(among(&both, &joints));
                } else {
                    let (mut joints, pose) = limb::<6>(&robot, &page, &q, &limb_name, &end);
                    joints[4] += offset;
                    arm.solve_all(&pose, &joints, &mut all).unwrap();
                    found += usize::from(among(&all, &joints));
                }
                asked += 2;
            }
        }
        // Joints are only determined to 1e-6 away from singular postures.
        assert!(found >= asked - asked / 200, "{id}: {found} of {asked}");
    }
}
