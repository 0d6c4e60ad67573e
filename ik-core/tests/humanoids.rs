//! The embedded humanoids `hubo`, `hoap2`, `hrp2` and `asimo` against the Denavit-Hartenberg tables of their source
//! (Ali, Park and Lee, with eqs. (3), (18) for the base of the limbs), written out here a second time.

#![allow(clippy::unwrap_used, reason = "tests")]

#[allow(dead_code, reason = "shared by several tests, each of which uses a part")]
mod common;

use common::Random;
use ik_core::kinematics::{Page, forward};
use ik_core::robot::{Motion, Robot, Root, embedded};
use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// What the tables say of one robot: lengths in m, right side.
struct Facts {
    id: &'static str,
    /// Half hip spacing, waist to hip, thigh, shank, ankle to sole, offset of the thigh along axis 3.
    leg: [f64; 6],
    /// Neck to shoulder, upper arm, forearm, hand.
    arm: [f64; 4],
    /// Joints of an arm.
    arm_joints: usize,
    /// Height of the neck above the waist.
    neck: f64,
    mass_kg: f64,
    /// Tilt of the first arm axis (rad), outer side up.
    tilt: f64,
    /// Angle of the table less the joint value, arm joint 5 (rad).
    forearm_offset: f64,
}

const FACTS: [Facts; 4] = [
    Facts {
        id: "hubo",
        leg: [0.08843, 0.18247, 0.30003, 0.30038, 0.09497, 0.0],
        arm: [0.2145, 0.17914, 0.18159, 0.12065],
        arm_joints: 6,
        neck: 0.19,
        mass_kg: 55.0,
        tilt: 0.0,
        forearm_offset: 0.0,
    },
    Facts {
        id: "hoap2",
        leg: [0.039, 0.055, 0.100, 0.100, 0.037, 0.0],
        arm: [0.0995, 0.101, 0.100, 0.033],
        arm_joints: 4,
        neck: 0.09,
        mass_kg: 7.0,
        tilt: 0.0,
        forearm_offset: 0.0,
    },
    Facts {
        id: "hrp2",
        leg: [0.060, 0.0, 0.300, 0.300, 0.105, -0.035],
        arm: [0.250, 0.250, 0.250, 0.150],
        arm_joints: 6,
        neck: 0.30,
        mass_kg: 58.0,
        tilt: 0.0,
        forearm_offset: FRAC_PI_2,
    },
    Facts {
        id: "asimo",
        leg: [0.080, 0.100, 0.280, 0.300, 0.090, 0.0],
        arm: [0.200, 0.240, 0.220, 0.120],
        arm_joints: 6,
        neck: 0.30,
        mass_kg: 54.0,
        tilt: 10.0 * PI / 180.0,
        forearm_offset: 0.0,
    },
];

/// Prefix of the names of a side, and +1 for the right, -1 for the left.
const SIDES: [(&str, f64); 2] = [("r", 1.0), ("l", -1.0)];

/// `Rz(theta) Tz(d) Tx(a) Rx(alpha)`, entry by entry.
fn link(theta: f64, [alpha, a, d]: [f64; 3]) -> Matrix4<f64> {
    let ((s, c), (sa, ca)) = (theta.sin_cos(), alpha.sin_cos());
    Matrix4::new(
        c,
        -s * ca,
        s * sa,
        a * c,
        s,
        c * ca,
        -c * sa,
        a * s,
        0.0,
        sa,
        ca,
        d,
        0.0,
        0.0,
        0.0,
        1.0,
    )
}

/// Axes of the paper's body frames (x right, y forward) in the project's (x forward, y left), at a height (m).
fn paper_frame(height: f64) -> Matrix4<f64> {
    Matrix4::new(
        0.0, 1.0, 0.0, 0.0, //
        -1.0, 0.0, 0.0, 0.0, //
        0.0, 0.0, 1.0, height, //
        0.0, 0.0, 0.0, 1.0,
    )
}

impl Facts {
    fn robot(&self) -> Robot {
        embedded(self.id).unwrap()
    }

    /// Pose of frame 6 of a leg in the waist at the angles of the table.
    fn foot(&self, side: f64, theta: [f64; 6]) -> Matrix4<f64> {
        let [l1, l2, l3, l4, l5, d3] = self.leg;
        let base = Matrix4::new(
            -1.0,
            0.0,
            0.0,
            side * l1, //
            0.0,
            -1.0,
            0.0,
            0.0, //
            0.0,
            0.0,
            1.0,
            -l2, //
            0.0,
            0.0,
            0.0,
            1.0,
        );
        let rows = [
            [FRAC_PI_2, 0.0, 0.0],
            [-FRAC_PI_2, 0.0, 0.0],
            [0.0, l3, side * d3],
            [0.0, l4, 0.0],
            [FRAC_PI_2, 0.0, 0.0],
            [0.0, l5, 0.0],
        ];
        paper_frame(0.0) * base * chain(theta, rows)
    }

    /// Pose of frame 6 of an arm in the waist at the angles of the table.
    fn hand(&self, side: f64, theta: [f64; 6]) -> Matrix4<f64> {
        let [l1, l2, l3, l4] = self.arm;
        let base = Matrix4::new(
            0.0, 0.0, 1.0, 0.0, //
            1.0, 0.0, 0.0, 0.0, //
            0.0, 1.0, 0.0, 0.0, //
            0.0, 0.0, 0.0, 1.0,
        );
        let (s, c) = (side * self.tilt).sin_cos();
        let tilted_shoulder = Matrix4::new(
            c,
            0.0,
            -s,
            side * l1, //
            0.0,
            1.0,
            0.0,
            0.0, //
            s,
            0.0,
            c,
            0.0, //
            0.0,
            0.0,
            0.0,
            1.0,
        );
        let rows = [
            [FRAC_PI_2, 0.0, 0.0],
            [-FRAC_PI_2, 0.0, 0.0],
            [FRAC_PI_2, 0.0, -l2],
            [FRAC_PI_2, 0.0, 0.0],
            [FRAC_PI_2, 0.0, l3],
            [0.0, l4, 0.0],
        ];
        paper_frame(self.neck) * tilted_shoulder * base * chain(theta, rows)
    }

    /// Angles of the table of an arm whose joints have the values `q`.
    fn arm_angles(&self, q: &[f64]) -> [f64; 6] {
        match *q {
            [q1, q2, q3, q4] => [q1, q2, q3, q4, 0.0, FRAC_PI_2],
            [q1, q2, q3, q4, q5, q6] => [q1, q2, q3, q4, q5 + self.forearm_offset, q6],
            _ => panic!("{} joints in an arm", q.len()),
        }
    }
}

fn chain(theta: [f64; 6], rows: [[f64; 3]; 6]) -> Matrix4<f64> {
    theta
        .into_iter()
        .zip(rows)
        .fold(Matrix4::identity(), |pose, (theta, row)| pose * link(theta, row))
}

/// The configuration with the waist at the origin and the joints of one limb at `values`.
fn set_limb(robot: &Robot, q: &mut [f64], limb: &str, values: &[f64]) {
    for (i, value) in values.iter().enumerate() {
        let joint = format!("{limb}_{}", i + 1);
        q[robot.root().nq() + robot.coordinate(&joint).unwrap()] = *value;
    }
}

fn frame_at(robot: &Robot, q: &[f64], frame: &str) -> Isometry3<f64> {
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    page.frame_pose(robot, robot.frame(frame).unwrap())
}

/// Rotation and position of a frame in the world, without the detour of a quaternion.
fn matrix_at(robot: &Robot, q: &[f64], frame: &str) -> Matrix4<f64> {
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    let id = robot.frame(frame).unwrap();
    let mut pose = page.frame_rotation(robot, id).to_homogeneous();
    pose.fixed_view_mut::<3, 1>(0, 3)
        .copy_from(&page.frame_position(robot, id));
    pose
}

fn assert_close(found: &Matrix4<f64>, expected: &Matrix4<f64>, what: &str) {
    let error = (found - expected).amax();
    assert!(
        error < 1e-12,
        "{what}: {error:e}\nfound {found}\nexpected {expected}"
    );
}

#[test]
fn feet_and_hands_stand_where_the_tables_put_them() {
    for facts in &FACTS {
        let robot = facts.robot();
        let mut random = Random(4_000);
        for (side, sign) in SIDES {
            for _ in 0..200 {
                let mut q = robot.neutral();
                let leg: [f64; 6] = std::array::from_fn(|_| random.between(-PI, PI));
                let arm = random.vector(facts.arm_joints, PI);
                set_limb(&robot, &mut q, &format!("{side}_leg"), &leg);
                set_limb(&robot, &mut q, &format!("{side}_arm"), &arm);
                for (frame, expected) in [
                    ("foot", facts.foot(sign, leg)),
                    ("hand", facts.hand(sign, facts.arm_angles(&arm))),
                ] {
                    let frame = format!("{side}_{frame}");
                    let found = matrix_at(&robot, &q, &frame);
                    assert_close(&found, &expected, &format!("{} {frame} at {q:?}", facts.id));
                }
            }
        }
    }
}

/// The axes of joints are the z axes of the frames of the table, and those of hip and shoulder meet.
#[test]
fn the_first_three_axes_of_every_limb_meet() {
    for facts in &FACTS {
        let robot = facts.robot();
        for joint in robot.joints() {
            assert_eq!((joint.motion, joint.axis), (Motion::Revolute, Vector3::z_axis()));
        }
        for (side, _) in SIDES {
            for limb in ["leg", "arm"] {
                for number in [2, 3] {
                    let name = format!("{side}_{limb}_{number}");
                    let joint = robot.joints().iter().find(|joint| joint.name == name).unwrap();
                    assert!(joint.x_parent_joint.translation.vector.amax() < 1e-15, "{name}");
                }
            }
        }
    }
}

#[test]
fn whole_bodies_weigh_what_the_tables_say_and_the_two_sides_the_same() {
    // Fractions of the whole, anthropometric; the limb ones of one side.
    let fractions = [
        ("thigh", 0.1),
        ("shank", 0.0465),
        ("foot_body", 0.0145),
        ("upper_arm", 0.028),
    ];
    for facts in &FACTS {
        let robot = facts.robot();
        assert!(
            (robot.total_mass_kg() - facts.mass_kg).abs() < 1e-12,
            "{}",
            facts.id
        );
        assert_eq!(robot.bodies()[0].name, "waist");
        let mass = |name: &str| {
            let body = robot.bodies().iter().find(|body| body.name == name);
            body.map_or(0.0, |body| body.mass_kg)
        };
        assert!((mass("waist") - 0.578 * facts.mass_kg).abs() < 1e-12);
        for (side, _) in SIDES {
            for (link, fraction) in fractions {
                let found = mass(&format!("{side}_{link}"));
                assert!(
                    (found - fraction * facts.mass_kg).abs() < 1e-12,
                    "{side}_{link} {found}"
                );
            }
            // The palm of a robot without wrist is part of the forearm.
            let below_elbow = mass(&format!("{side}_forearm")) + mass(&format!("{side}_palm"));
            assert!(
                (below_elbow - 0.022 * facts.mass_kg).abs() < 1e-12,
                "{side} {below_elbow}"
            );
        }
    }
}

/// Masses lie in the middle of their links: seen on the standing robot with hanging arms.
#[test]
fn masses_lie_in_the_middle_of_their_links() {
    for facts in &FACTS {
        let robot = facts.robot();
        let q = standing(facts, &robot, 0.0, 0.0);
        let mut page = Page::new(&robot);
        forward(&robot, &q, &mut page);
        let ([_, l2, l3, l4, l5, _], [_, upper, fore, hand]) = (facts.leg, facts.arm);
        // Arms hang at the tilt of their shoulders.
        let along = facts.tilt.cos();
        let heights = [
            (0.142, -l2 / 2.0),
            (0.436, facts.neck / 2.0),
            (0.2, -l2 - l3 / 2.0),
            (0.093, -l2 - l3 - l4 / 2.0),
            (0.029, -l2 - l3 - l4 - l5 / 2.0),
            (0.056, facts.neck - along * upper / 2.0),
            (0.032, facts.neck - along * (upper + fore / 2.0)),
            (0.012, facts.neck - along * (upper + fore + hand / 2.0)),
        ];
        let height: f64 = heights.iter().map(|(fraction, z)| fraction * z).sum();
        let found = page.centre_of_mass();
        assert!(
            (found - Vector3::new(0.0, 0.0, height)).amax() < 1e-12,
            "{} {found}, expected height {height}",
            facts.id
        );
    }
}

/// Knees and elbows bent by these angles (rad), soles under the hips, arms hanging.
fn standing(facts: &Facts, robot: &Robot, knee: f64, elbow: f64) -> Vec<f64> {
    let mut q = robot.neutral();
    let leg = [0.0, -FRAC_PI_2, -knee / 2.0, knee, -knee / 2.0, 0.0];
    let arm = [
        FRAC_PI_2,
        -FRAC_PI_2,
        -FRAC_PI_2,
        elbow,
        -facts.forearm_offset,
        FRAC_PI_2,
    ];
    for (side, _) in SIDES {
        set_limb(robot, &mut q, &format!("{side}_leg"), &leg);
        set_limb(robot, &mut q, &format!("{side}_arm"), &arm[..facts.arm_joints]);
    }
    q
}

#[test]
fn a_standing_robot_has_level_soles_under_its_hips_and_knees_in_front() {
    for facts in &FACTS {
        let robot = facts.robot();
        let [l1, l2, l3, l4, l5, d3] = facts.leg;
        for knee in [0.0, 0.3, 1.0] {
            let q = standing(facts, &robot, knee, 0.0);
            for (side, sign) in SIDES {
                let what = format!("{} {side} knee {knee}", facts.id);
                // Shank and thigh differ in length: the ankle is not quite below the hip.
                let ankle = Vector3::new(
                    (l3 - l4) * (knee / 2.0).sin(),
                    sign * (d3 - l1),
                    -l2 - (l3 + l4) * (knee / 2.0).cos(),
                );
                let sole = Matrix4::new_translation(&(ankle - Vector3::z() * l5));
                assert_close(&matrix_at(&robot, &q, &format!("{side}_sole")), &sole, &what);
                let joint = frame_at(&robot, &q, &format!("{side}_shank")).translation.vector;
                assert!(
                    (joint.x - l3 * (knee / 2.0).sin()).abs() < 1e-12,
                    "{what} {joint}"
                );
                let down_left_forwards = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0);
                let foot = frame_at(&robot, &q, &format!("{side}_foot"));
                let turn = foot.rotation.to_rotation_matrix();
                assert!((turn.matrix() - down_left_forwards).amax() < 1e-12, "{what}");
            }
        }
    }
}

/// Both arms at (90, -90, -90, elbow, 0, 90) degrees of the table: hanging, a positive elbow takes the hand forwards.
#[test]
fn a_bent_elbow_takes_the_hand_forwards_on_both_sides() {
    for facts in &FACTS {
        let robot = facts.robot();
        let [l1, l2, l3, l4] = facts.arm;
        for elbow in [0.0, 0.7, FRAC_PI_2] {
            let q = standing(facts, &robot, 0.0, elbow);
            for (side, sign) in SIDES {
                let below = l2 + (l3 + l4) * elbow.cos();
                // A tilted shoulder spreads the hanging arm outwards.
                let hanging = Rotation3::from_axis_angle(&Vector3::x_axis(), -sign * facts.tilt)
                    * Vector3::new((l3 + l4) * elbow.sin(), 0.0, -below);
                let expected = hanging + Vector3::new(0.0, -sign * l1, facts.neck);
                let found = frame_at(&robot, &q, &format!("{side}_hand")).translation.vector;
                assert!(
                    (found - expected).amax() < 1e-12,
                    "{} {side} {elbow}: {found}",
                    facts.id
                );
                assert!(found.y * -sign >= l1 - 1e-12);
            }
        }
    }
}

/// Hips and shoulders of the two sides mirror each other, and so do the soles of equally bent legs.
#[test]
fn right_is_at_negative_y_and_left_mirrors_it() {
    for facts in &FACTS {
        let robot = facts.robot();
        let q = standing(facts, &robot, 0.4, 0.2);
        let at = |frame: &str| frame_at(&robot, &q, frame).translation.vector;
        for (frame, offset) in [
            ("hip_turntable", facts.leg[0]),
            ("shoulder_turntable", facts.arm[0]),
            ("sole", facts.leg[0] - facts.leg[5]),
        ] {
            let (right, left) = (at(&format!("r_{frame}")), at(&format!("l_{frame}")));
            assert!((right.y + offset).abs() < 1e-12, "{} {frame} {right}", facts.id);
            let mirrored = Vector3::new(right.x, -right.y, right.z);
            assert!((left - mirrored).amax() < 1e-12, "{} {frame} {left}", facts.id);
        }
        let neck = frame_at(&robot, &q, "neck");
        assert!((neck.translation.vector - Vector3::new(0.0, 0.0, facts.neck)).amax() < 1e-15);
        assert!(neck.rotation.angle() < 1e-15);
    }
}

#[test]
fn joints_come_limb_by_limb_with_limits_of_half_a_turn() {
    for facts in &FACTS {
        let robot = facts.robot();
        let limb =
            |name: &str, joints: usize| (1..=joints).map(|i| format!("{name}_{i}")).collect::<Vec<_>>();
        let names = [
            limb("r_leg", 6),
            limb("l_leg", 6),
            limb("r_arm", facts.arm_joints),
            limb("l_arm", facts.arm_joints),
        ]
        .concat();
        let found: Vec<_> = robot.joints().iter().map(|joint| joint.name.clone()).collect();
        assert_eq!(found, names);
        assert_eq!(
            (robot.root(), robot.nv()),
            (Root::Floating, 6 + names.len()),
            "{}",
            facts.id
        );
        for coordinate in robot.coordinates() {
            let limits = coordinate.limits;
            assert!((limits.lower + PI).abs() < 1e-15 && (limits.upper - PI).abs() < 1e-15);
            assert!((limits.velocity - 10.0).abs() < 1e-15, "{}", coordinate.name);
        }
    }
}
