//! What holds for every robot: random trees, written out and read back, locked and unlocked; and texts torn
//! to pieces.

#![allow(clippy::unwrap_used, reason = "tests")]

mod robot_oracle;

use ik_core::robot::{
    Inertial, JointKind, JointSpec, Limits, LinkSpec, Mimic, Robot, RobotBuilder, Root, UrdfOptions,
};
use nalgebra::{Isometry3, Matrix3, Matrix4, Translation3, UnitQuaternion, Vector3};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use robot_oracle as oracle;
use std::fmt::Write;

/// Runs a law on `cases` values, the same ones in every run.
fn for_all<S: Strategy>(
    cases: u32,
    seed: u8,
    strategy: &S,
    law: impl Fn(S::Value) -> Result<(), TestCaseError>,
) {
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]);
    if let Err(error) = TestRunner::new_with_rng(config, rng).run(strategy, law) {
        panic!("{error}");
    }
}

/// The random numbers of one link and the joint above it.
#[derive(Debug, Clone)]
struct Limb {
    parent: prop::sample::Index,
    kind: u8,
    /// Less than 0.25: mimics the moving joint `master`.
    mimic: f64,
    master: prop::sample::Index,
    xyz: [f64; 3],
    rpy: [f64; 3],
    axis: [f64; 3],
    mass_kg: f64,
    com: [f64; 3],
    spread: [f64; 6],
    /// Less than 0.4: locked in the tests of locking.
    lock: f64,
}

fn limb() -> impl Strategy<Value = Limb> {
    let unit = -1.0..1.0f64;
    let three = || [unit.clone(), unit.clone(), unit.clone()];
    let axis = three().prop_filter("an axis has a direction", |a| Vector3::from(*a).norm() > 0.1);
    let tree = (
        any::<prop::sample::Index>(),
        0..4u8,
        0.0..1.0f64,
        any::<prop::sample::Index>(),
    );
    let mass = prop_oneof![1 => Just(0.0), 4 => 0.01..9.0f64];
    let body = (mass, three(), prop::array::uniform6(-1.0..1.0f64), 0.0..1.0f64);
    (tree, three(), prop::array::uniform3(-3.1..3.1f64), axis, body).prop_map(
        |((parent, kind, mimic, master), xyz, rpy, axis, (mass_kg, com, spread, lock))| Limb {
            parent,
            kind,
            mimic,
            master,
            xyz,
            rpy,
            axis,
            mass_kg,
            com,
            spread,
            lock,
        },
    )
}

/// A random tree: links `l0`, `l1`, .. with joints `j1`, `j2`, ..; joint `ji` moves link `li`.
#[derive(Debug, Clone)]
struct Plan {
    limbs: Vec<Limb>,
    floating: bool,
    seed: u64,
}

fn plan() -> impl Strategy<Value = Plan> {
    (vec(limb(), 1..14), any::<bool>(), any::<u64>()).prop_map(|(limbs, floating, seed)| Plan {
        limbs,
        floating,
        seed,
    })
}

impl Plan {
    fn link(&self, i: usize) -> LinkSpec {
        let limb = &self.limbs[i];
        let [a, b, c, d, e, f] = limb.spread;
        let root = Matrix3::new(a, 0.0, 0.0, b, c, 0.0, d, e, f);
        let inertial = (limb.mass_kg > 0.0).then(|| Inertial {
            mass_kg: limb.mass_kg,
            com: limb.com.into(),
            inertia: root * root.transpose() * limb.mass_kg,
        });
        LinkSpec {
            name: format!("l{i}"),
            inertial,
        }
    }

    /// The joint above link `i`, which is not 0.
    fn joint(&self, i: usize) -> JointSpec {
        let limb = &self.limbs[i];
        let kinds = [
            JointKind::Revolute,
            JointKind::Continuous,
            JointKind::Prismatic,
            JointKind::Fixed,
        ];
        let kind = kinds[usize::from(limb.kind)];
        let [roll, pitch, yaw] = limb.rpy;
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        JointSpec {
            name: format!("j{i}"),
            kind,
            parent: format!("l{}", limb.parent.index(i)),
            child: format!("l{i}"),
            origin: Isometry3::from_parts(Translation3::from(Vector3::from(limb.xyz)), rotation),
            axis: Vector3::from(limb.axis).normalize(),
            limits: Some(Limits {
                lower: -0.3 - limb.mass_kg,
                upper: 0.7,
                velocity: 2.5,
                effort: 30.0,
            }),
            mimic: self.mimic(i),
        }
    }

    /// A joint may follow a moving one with a smaller number: chains, but no loops.
    fn mimic(&self, i: usize) -> Option<Mimic> {
        let moving: Vec<usize> = (1..i).filter(|&j| self.limbs[j].kind < 3).collect();
        let limb = &self.limbs[i];
        (limb.kind < 3 && limb.mimic < 0.25 && !moving.is_empty()).then(|| Mimic {
            joint: format!("j{}", limb.master.get(&moving)),
            multiplier: limb.axis[0] * 2.0,
            offset: limb.axis[1],
        })
    }

    fn builder(&self) -> RobotBuilder {
        let mut builder = RobotBuilder::new("random");
        for i in 0..self.limbs.len() {
            builder.link(self.link(i));
            if i > 0 {
                builder.joint(self.joint(i));
            }
        }
        if self.floating {
            builder.floating_root();
        }
        builder
    }

    fn build(&self) -> Robot {
        self.builder().build().unwrap()
    }

    /// The same tree as URDF text; the inertial frame is turned to see that it is turned back.
    fn urdf(&self) -> String {
        let mut text = String::from("<?xml version=\"1.0\"?>\n<robot name=\"random\">\n");
        for i in 0..self.limbs.len() {
            write_link(&mut text, &self.link(i), &self.limbs[i].rpy);
            if i > 0 {
                write_joint(&mut text, &self.joint(i), &self.limbs[i].rpy);
            }
        }
        text + "</robot>\n"
    }
}

fn blank_separated(numbers: &[f64]) -> String {
    numbers
        .iter()
        .map(|x| format!("{x:?}"))
        .collect::<Vec<_>>()
        .join(" ")
}

fn write_link(text: &mut String, link: &LinkSpec, rpy: &[f64; 3]) {
    writeln!(text, "<link name=\"{}\">", link.name).unwrap();
    if let Some(inertial) = &link.inertial {
        let r = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2])
            .to_rotation_matrix()
            .into_inner();
        let i = r.transpose() * inertial.inertia * r;
        let (com, rpy) = (blank_separated(inertial.com.as_slice()), blank_separated(rpy));
        writeln!(
            text,
            "<inertial><mass value=\"{:?}\"/><origin rpy=\"{rpy}\" xyz=\"{com}\"/>",
            inertial.mass_kg
        )
        .unwrap();
        let [xx, xy, xz, yy, yz, zz] = [i.m11, i.m12, i.m13, i.m22, i.m23, i.m33];
        writeln!(
            text,
            "<inertia ixx=\"{xx:?}\" ixy=\"{xy:?}\" ixz=\"{xz:?}\" iyy=\"{yy:?}\" iyz=\"{yz:?}\" izz=\"{zz:?}\"/></inertial>"
        )
        .unwrap();
    }
    text.push_str("<visual><origin xyz=\"none of our business\"/></visual></link>\n");
}

fn write_joint(text: &mut String, joint: &JointSpec, rpy: &[f64; 3]) {
    let kind = format!("{:?}", joint.kind).to_lowercase();
    let (xyz, rpy) = (
        blank_separated(joint.origin.translation.vector.as_slice()),
        blank_separated(rpy),
    );
    let axis = blank_separated(joint.axis.as_slice());
    writeln!(
        text,
        "<joint type=\"{kind}\" name=\"{}\"><origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>",
        joint.name
    )
    .unwrap();
    writeln!(
        text,
        "<axis xyz=\"{axis}\"/><parent link=\"{}\"/><child link=\"{}\"/>",
        joint.parent, joint.child
    )
    .unwrap();
    if let Some(Limits {
        lower,
        upper,
        velocity,
        effort,
    }) = joint.limits
    {
        let range = format!("lower=\"{lower:?}\" upper=\"{upper:?}\"");
        writeln!(
            text,
            "<limit {range} velocity=\"{velocity:?}\" effort=\"{effort:?}\"/>"
        )
        .unwrap();
    }
    if let Some(Mimic {
        joint,
        multiplier,
        offset,
    }) = &joint.mimic
    {
        writeln!(
            text,
            "<mimic joint=\"{joint}\" multiplier=\"{multiplier:?}\" offset=\"{offset:?}\"/>"
        )
        .unwrap();
    }
    text.push_str("</joint>\n");
}

fn assert_same_frames(a: &Robot, q_a: &[f64], b: &Robot, q_b: &[f64], tolerance: f64) {
    let names = |robot: &Robot| {
        robot
            .frames()
            .iter()
            .map(|frame| frame.name.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(names(a), names(b));
    for ((x_a, x_b), name) in oracle::frames(a, q_a)
        .iter()
        .zip(oracle::frames(b, q_b))
        .zip(names(a))
    {
        let difference: Matrix4<f64> = x_a - x_b;
        assert!(
            difference.iter().all(|x| x.abs() < tolerance),
            "{name}: {difference}"
        );
    }
}

fn assert_same_masses(a: &Robot, q_a: &[f64], b: &Robot, q_b: &[f64], tolerance: f64) {
    let (mass_a, com_a, inertia_a) = oracle::mass_properties(a, q_a, 0);
    let (mass_b, com_b, inertia_b) = oracle::mass_properties(b, q_b, 0);
    assert!((mass_a - mass_b).abs() < tolerance);
    assert!(
        (com_a - com_b).iter().all(|x| x.abs() < tolerance),
        "{com_a} {com_b}"
    );
    let scale = 1.0 + inertia_a.amax();
    assert!(
        (inertia_a - inertia_b)
            .iter()
            .all(|x| x.abs() < tolerance * scale),
        "{inertia_a} {inertia_b}"
    );
}

#[test]
fn random_trees_are_sound() {
    for_all(400, 1, &plan(), |plan| {
        let robot = plan.build();
        oracle::assert_sound(&robot);
        let moving = plan.limbs[1..].iter().filter(|limb| limb.kind < 3).count();
        prop_assert_eq!(robot.joints().len(), moving);
        prop_assert_eq!(robot.frames().len(), plan.limbs.len());
        let mass: f64 = plan.limbs.iter().map(|limb| limb.mass_kg).sum();
        prop_assert!((robot.total_mass_kg() - mass).abs() < 1e-10);
        Ok(())
    });
}

/// Frames of the merged, depth-first tree against a walk up the links of the plan, which knows neither.
#[test]
fn merging_and_ordering_change_no_link() {
    for_all(300, 2, &plan(), |plan| {
        let robot = plan.build();
        let q = oracle::some_configuration(&robot, plan.seed);
        let poses = oracle::frames(&robot, &q);
        for i in 0..plan.limbs.len() {
            let expected = oracle::bodies(&robot, &q)[0] * link_in_root(&plan, &robot, &q, i);
            let found = poses[robot.frame(&format!("l{i}")).unwrap().0];
            prop_assert!(
                (found - expected).amax() < 1e-11,
                "l{}: {} {}",
                i,
                found,
                expected
            );
        }
        Ok(())
    });
}

fn link_in_root(plan: &Plan, robot: &Robot, q: &[f64], i: usize) -> Matrix4<f64> {
    if i == 0 {
        return Matrix4::identity();
    }
    let joint = plan.joint(i);
    let value = value_of(plan, robot, q, i);
    let motion = match joint.kind {
        JointKind::Fixed | JointKind::Floating => Matrix4::identity(),
        JointKind::Prismatic => Matrix4::new_translation(&(joint.axis * value)),
        JointKind::Revolute | JointKind::Continuous => Matrix4::from_scaled_axis(joint.axis * value),
    };
    link_in_root(plan, robot, q, plan.limbs[i].parent.index(i)) * joint.origin.to_homogeneous() * motion
}

/// The value of joint `ji`, mimic relations followed one by one.
fn value_of(plan: &Plan, robot: &Robot, q: &[f64], i: usize) -> f64 {
    match plan.mimic(i) {
        Some(Mimic {
            joint,
            multiplier,
            offset,
        }) => multiplier * value_of(plan, robot, q, joint[1..].parse().unwrap()) + offset,
        None if plan.limbs[i].kind < 3 => q[robot.root().nq() + robot.coordinate(&format!("j{i}")).unwrap()],
        None => 0.0,
    }
}

#[test]
fn a_urdf_of_a_robot_is_the_robot() {
    for_all(200, 3, &plan(), |plan| {
        let robot = plan.build();
        let options = UrdfOptions { root: robot.root() };
        let read = Robot::from_urdf_str(&plan.urdf(), "random.urdf", &options).unwrap();
        prop_assert_eq!(read.coordinates(), robot.coordinates());
        prop_assert_eq!(read.name(), robot.name());
        for (a, b) in read.joints().iter().zip(robot.joints()) {
            prop_assert_eq!(a, b);
        }
        for (a, b) in read.bodies().iter().zip(robot.bodies()) {
            prop_assert_eq!(&a.name, &b.name);
            prop_assert!((a.inertia - b.inertia).amax() < 1e-11 * (1.0 + b.inertia.amax()));
        }
        let q = oracle::some_configuration(&robot, plan.seed);
        assert_same_frames(&read, &q, &robot, &q, 1e-12);
        assert_same_masses(&read, &q, &robot, &q, 1e-11);
        Ok(())
    });
}

/// The joints to lock, the robot with them locked, and what is left of a configuration.
fn locked(plan: &Plan, robot: &Robot, q: &[f64]) -> (Vec<(String, f64)>, Vec<f64>) {
    let first = robot.root().nq();
    let (mut locked, mut rest) = (Vec::new(), q[..first].to_vec());
    for (coordinate, &value) in robot.coordinates().iter().zip(&q[first..]) {
        let i: usize = coordinate.name[1..].parse().unwrap();
        if plan.limbs[i].lock < 0.4 {
            locked.push((coordinate.name.clone(), value))
        } else {
            rest.push(value)
        }
    }
    (locked, rest)
}

#[test]
fn a_locked_robot_is_the_robot_held_there() {
    for_all(400, 4, &plan(), |plan| {
        let robot = plan.build();
        let q = oracle::some_configuration(&robot, plan.seed);
        let (joints, rest) = locked(&plan, &robot, &q);
        let joints: Vec<(&str, f64)> = joints
            .iter()
            .map(|(name, value)| (name.as_str(), *value))
            .collect();
        let held = robot.with_locked(&joints).unwrap();
        oracle::assert_sound(&held);
        prop_assert_eq!(held.nq() + joints.len(), robot.nq());
        for coordinate in held.coordinates() {
            let before = &robot.coordinates()[robot.coordinate(&coordinate.name).unwrap()];
            prop_assert_eq!(coordinate.limits, before.limits);
        }
        assert_same_frames(&held, &rest, &robot, &q, 1e-11);
        assert_same_masses(&held, &rest, &robot, &q, 1e-11);

        let mut builder = plan.builder();
        for (name, value) in joints {
            builder.lock(name, value);
        }
        prop_assert_eq!(
            builder.build().unwrap(),
            held,
            "locking while building is the same"
        );
        Ok(())
    });
}

#[test]
fn limits_and_name_change_nothing_else() {
    for_all(50, 5, &plan(), |plan| {
        let robot = plan.build();
        let renamed = robot.renamed("other");
        prop_assert_eq!(renamed.name(), "other");
        prop_assert_eq!(&renamed.renamed("random"), &robot);
        let Some(first) = robot.coordinates().first() else {
            return Ok(());
        };
        let tight = Limits {
            lower: -0.01,
            upper: 0.02,
            velocity: 0.3,
            effort: 0.4,
        };
        let changed = robot.with_limits(&first.name, tight).unwrap();
        prop_assert_eq!(changed.coordinates()[0].limits, tight);
        prop_assert_eq!(changed.with_limits(&first.name, first.limits).unwrap(), robot);
        Ok(())
    });
}

/// One way to damage a text at a place.
#[derive(Debug, Clone)]
enum Damage {
    Delete(usize),
    Repeat(usize),
    Insert(&'static str),
    ReplaceNumber(&'static str),
    SwapQuoted(prop::sample::Index),
}

fn damage() -> impl Strategy<Value = (prop::sample::Index, Damage)> {
    let token = prop::sample::select(vec![
        "<",
        ">",
        "\"",
        "/>",
        "</link>",
        "<link name=\"x\"/>",
        "&",
        "&#0;",
        "<!--",
        "]]>",
        "\u{0}",
        "é",
        " name=\"tip\"",
        "<mimic joint=\"pivot\"/>",
        "<!DOCTYPE a>",
    ]);
    let number = prop::sample::select(vec![
        "",
        "nan",
        "-inf",
        "1e999",
        "-1",
        "0",
        "1e308",
        "1e-320",
        "-0",
        "0x10",
        "1 2",
        "--1",
        "1e",
        "∞",
        "9999999999999999999",
    ]);
    let damage = prop_oneof![
        1 => (1..60usize).prop_map(Damage::Delete),
        1 => (1..200usize).prop_map(Damage::Repeat),
        1 => token.prop_map(Damage::Insert),
        8 => number.prop_map(Damage::ReplaceNumber),
        8 => any::<prop::sample::Index>().prop_map(Damage::SwapQuoted),
    ];
    (any::<prop::sample::Index>(), damage)
}

fn apply(text: &mut String, at: prop::sample::Index, damage: &Damage) {
    if text.is_empty() {
        return;
    }
    let boundary = |text: &str, mut i: usize| {
        i = i.min(text.len());
        while !text.is_char_boundary(i) {
            i -= 1;
        }
        i
    };
    let start = boundary(text, at.index(text.len()));
    match damage {
        Damage::Delete(length) => text.replace_range(start..boundary(text, start + length), ""),
        Damage::Repeat(length) => {
            let copy = text[start..boundary(text, start + length)].to_owned();
            text.insert_str(start, &copy);
        }
        Damage::Insert(token) => text.insert_str(start, token),
        Damage::ReplaceNumber(number) => {
            let is_digit = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
            if let Some(from) = text[start..].find(is_digit).map(|i| start + i) {
                let to = text[from..]
                    .find(|c| !is_digit(c))
                    .map_or(text.len(), |i| from + i);
                text.replace_range(from..to, number);
            }
        }
        Damage::SwapQuoted(other) => swap_quoted(text, start, *other),
    }
}

/// Puts one attribute value of the text in the place of another: links, joints and types get mixed up.
fn swap_quoted(text: &mut String, start: usize, other: prop::sample::Index) {
    let quotes: Vec<usize> = text.match_indices('"').map(|(i, _)| i).collect();
    let values: Vec<(usize, usize)> = quotes
        .chunks_exact(2)
        .map(|pair| (pair[0] + 1, pair[1]))
        .collect();
    if values.is_empty() {
        return;
    }
    let (from, to) = values[values
        .partition_point(|&(from, _)| from < start)
        .min(values.len() - 1)];
    let (other_from, other_to) = *other.get(&values);
    let value = text[other_from..other_to].to_owned();
    text.replace_range(from..to, &value);
}

const TEXTS: [&str; 11] = [
    include_str!("../robots/coman.urdf"),
    include_str!("../robots/bioloid.urdf"),
    include_str!("../robots/melson.urdf"),
    include_str!("../robots/hubo.urdf"),
    include_str!("../robots/hoap2.urdf"),
    include_str!("../robots/hrp2.urdf"),
    include_str!("../robots/asimo.urdf"),
    include_str!("../robots/arm6.urdf"),
    include_str!("../robots/arm7.urdf"),
    include_str!("../robots/slider-arm.urdf"),
    include_str!("../robots/pendulum.urdf"),
];

#[test]
fn a_damaged_description_is_a_sound_robot_or_an_error() {
    let (read, refused) = (std::cell::Cell::new(0), std::cell::Cell::new(0));
    let strategy = (0..TEXTS.len(), vec(damage(), 1..4), any::<bool>());
    for_all(6000, 6, &strategy, |(text, damages, floating)| {
        let mut text = TEXTS[text].to_owned();
        for (at, damage) in &damages {
            apply(&mut text, *at, damage);
        }
        let root = if floating { Root::Floating } else { Root::Fixed };
        match Robot::from_urdf_str(&text, "damaged.urdf", &UrdfOptions { root }) {
            Ok(robot) => {
                oracle::assert_sound(&robot);
                read.set(read.get() + 1);
            }
            Err(error) => {
                prop_assert!(error.to_string().starts_with("damaged.urdf"), "{}", error);
                refused.set(refused.get() + 1);
            }
        }
        Ok(())
    });
    eprintln!(
        "{} damaged descriptions read, {} refused",
        read.get(),
        refused.get()
    );
    assert!(
        read.get() > 500 && refused.get() > 500,
        "the damage is too heavy or too light to test anything"
    );
}

/// Elements inside elements without end do not exhaust the stack.
#[test]
fn deep_nesting_is_harmless() {
    for depth in [100, 100_000] {
        let text = format!(
            "<robot name=\"deep\">{}{}</robot>",
            "<link>".repeat(depth),
            "</link>".repeat(depth)
        );
        assert!(Robot::from_urdf_str(&text, "deep", &UrdfOptions::default()).is_err());
    }
}
