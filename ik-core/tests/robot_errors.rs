//! What is refused, and in which words.

#![allow(clippy::unwrap_used, reason = "tests")]

use ik_core::robot::{
    Inertial, JointKind, JointSpec, Limits, LinkSpec, Mimic, Robot, RobotBuilder, RobotError, Root,
    UrdfOptions, embedded,
};
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Reads lines of URDF inside `<robot name="r">`; the first of them is line 2.
fn read(lines: &str) -> Result<Robot, RobotError> {
    let text = format!("<robot name=\"r\">\n{lines}\n</robot>");
    Robot::from_urdf_str(&text, "r.urdf", &UrdfOptions::default())
}

fn refusal(lines: &str) -> String {
    read(lines)
        .map(|robot| format!("accepted: {robot:?}"))
        .unwrap_err()
        .to_string()
}

const TWO_LINKS: &str = "<link name=\"a\"/>\n<link name=\"b\"/>";
const LIMIT: &str = "<limit lower=\"-1\" upper=\"2\" velocity=\"3\" effort=\"4\"/>";

/// Two links and, on line 4, a joint of that type between them with that content.
fn joint(kind: &str, content: &str) -> String {
    format!(
        "{TWO_LINKS}\n<joint name=\"j\" type=\"{kind}\"><parent link=\"a\"/><child link=\"b\"/>{content}</joint>"
    )
}

fn connect(name: &str, parent: &str, child: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"fixed\"><parent link=\"{parent}\"/><child link=\"{child}\"/></joint>\n"
    )
}

/// A revolute joint from `a` to the link `child` that mimics `master`.
fn mimic(name: &str, child: &str, master: &str) -> String {
    format!(
        "<link name=\"{child}\"/><joint name=\"{name}\" type=\"revolute\"><parent link=\"a\"/><child link=\"{child}\"/>\
         {LIMIT}<mimic joint=\"{master}\"/></joint>\n"
    )
}

#[test]
fn a_sound_description_is_accepted() {
    let robot = read(&joint("revolute", LIMIT)).unwrap();
    assert_eq!(
        (robot.nq(), robot.joints()[0].axis),
        (1, Vector3::x_axis()),
        "without <axis> it is x"
    );
    let limits = Limits {
        lower: -1.0,
        upper: 2.0,
        velocity: 3.0,
        effort: 4.0,
    };
    assert_eq!(robot.coordinates()[0].limits, limits);
}

#[test]
fn faults_of_the_text_are_named_with_their_line() {
    let cases = [
        (
            "<link name=\"a\">".to_owned(),
            "r.urdf:3: malformed XML: expected 'link' tag, not 'robot' at 3:1",
        ),
        (
            "<link/>".to_owned(),
            "r.urdf:2: a link: attribute `name` of <link> is missing",
        ),
        (
            format!("{TWO_LINKS}\n<joint name=\"j\"/>"),
            "r.urdf:4: joint `j`: attribute `type` of <joint> is missing",
        ),
        (
            "<link name=\"a\"/>\n<joint name=\"j\" type=\"fixed\"><child link=\"a\"/></joint>".to_owned(),
            "r.urdf:3: joint `j`: element <parent> is missing",
        ),
        (
            "<link name=\"a\"/>\n<joint name=\"j\" type=\"fixed\"><parent link=\"a\"/></joint>".to_owned(),
            "r.urdf:3: joint `j`: element <child> is missing",
        ),
        (
            joint("fixed", "<parent link=\"b\"/>"),
            "r.urdf:4: joint `j`: <parent> occurs more than once, write it once",
        ),
        (
            "<link name=\"a\">\n<inertial>\n<mass value=\"1\"/>\n</inertial>\n</link>".to_owned(),
            "r.urdf:3: link `a`: element <inertia> is missing",
        ),
        (
            joint("fixed", "\n<origin xyz=\"0 0\"/>"),
            "r.urdf:5: joint `j`: <origin xyz> is `0 0`, expected three numbers separated by blanks",
        ),
        (
            joint("fixed", "<origin rpy=\"0 0 zero\"/>"),
            "r.urdf:4: joint `j`: <origin rpy> is `0 0 zero`, expected three numbers separated by blanks",
        ),
        (
            joint(
                "revolute",
                "<limit lower=\"1,5\" upper=\"2\" velocity=\"1\" effort=\"1\"/>",
            ),
            "r.urdf:4: joint `j`: <limit lower> is `1,5`, expected a number",
        ),
        (
            joint("revolute", "<limit lower=\"-1\" upper=\"2\" effort=\"1\"/>"),
            "r.urdf:4: joint `j`: attribute `velocity` of <limit> is missing",
        ),
        (
            joint("revolute", "<axis/>"),
            "r.urdf:4: joint `j`: attribute `xyz` of <axis> is missing",
        ),
        (
            joint("fixed", "<origin xyz=\"0 NaN 0\"/>"),
            "r.urdf:4: joint `j`: <origin xyz> is NaN, which is not a finite number",
        ),
        (
            joint(
                "revolute",
                "<limit lower=\"-1\" upper=\"1e999\" velocity=\"1\" effort=\"1\"/>",
            ),
            "r.urdf:4: joint `j`: <limit upper> is inf, which is not a finite number",
        ),
    ];
    for (lines, message) in cases {
        assert_eq!(refusal(&lines), message);
    }
}

#[test]
fn faults_of_a_joint_are_named_with_their_line() {
    let cases = [
        (
            joint("planar", ""),
            "r.urdf:4: joint `j`: type `planar` is not supported; use revolute, continuous, prismatic, fixed, or floating \
             under the root link",
        ),
        (
            joint("revolute", &format!("{LIMIT}<axis xyz=\"0 0 0\"/>")),
            "r.urdf:4: joint `j`: axis (0, 0, 0) has length 0; it must be a unit vector (to 0.000001)",
        ),
        (
            joint("prismatic", &format!("{LIMIT}<axis xyz=\"0 0 1.00001\"/>")),
            "r.urdf:4: joint `j`: axis (0, 0, 1.00001) has length 1.00001; it must be a unit vector (to 0.000001)",
        ),
        (
            joint("revolute", ""),
            "r.urdf:4: joint `j`: a revolute joint needs limits (lower, upper, velocity, effort); an unlimited rotation \
             is a continuous joint",
        ),
        (
            joint("prismatic", ""),
            "r.urdf:4: joint `j`: a prismatic joint needs limits (lower, upper, velocity, effort); an unlimited rotation \
             is a continuous joint",
        ),
        (
            joint("revolute", "<limit lower=\"2\" upper=\"1\" velocity=\"1\" effort=\"1\"/>"),
            "r.urdf:4: joint `j`: position limits [2, 1] are no interval; need lower <= upper",
        ),
        (
            joint("revolute", "<limit lower=\"0\" upper=\"1\" velocity=\"-3\" effort=\"1\"/>"),
            "r.urdf:4: joint `j`: velocity limit is -3, it must be zero or more",
        ),
        (
            joint("continuous", "<limit velocity=\"3\" effort=\"-1\"/>"),
            "r.urdf:4: joint `j`: effort limit is -1, it must be zero or more",
        ),
        (
            joint("fixed", "<mimic joint=\"j\"/>"),
            "r.urdf:4: joint `j`: a fixed joint has no single value and cannot mimic another joint",
        ),
        (
            joint("revolute", &format!("{LIMIT}<mimic joint=\"j\"/>")),
            "r.urdf:4: the joints j -> j mimic each other in a loop; one of them must be independent",
        ),
        (
            joint("revolute", &format!("{LIMIT}<mimic joint=\"k\"/>")),
            "r.urdf:4: joint `j`: mimics joint `k`, which does not exist or does not move; moving joints: j",
        ),
        (
            format!("<link name=\"a\"/>\n{}{}{}", mimic("j", "b", "k"), mimic("k", "c", "l"), mimic("l", "d", "k")),
            "r.urdf:4: the joints k -> l -> k mimic each other in a loop; one of them must be independent",
        ),
        (
            "<link name=\"a\">\n<inertial><mass value=\"-2\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" \
             iyz=\"0\" izz=\"1\"/></inertial></link>"
                .to_owned(),
            "r.urdf:2: link `a`: mass is -2 kg, it must be zero or more",
        ),
    ];
    for (lines, message) in cases {
        assert_eq!(refusal(&lines), message);
    }
}

#[test]
fn faults_of_the_tree_are_named() {
    let cases = [
        (String::new(), "r.urdf: the robot has no links"),
        (
            "<link name=\"a\"/>\n<link name=\"a\"/>".to_owned(),
            "r.urdf:3: link `a` is already defined at r.urdf:2; names must be unique",
        ),
        (
            format!(
                "{TWO_LINKS}\n{}{}",
                connect("j", "a", "b"),
                connect("j", "a", "b")
            ),
            "r.urdf:5: joint `j` is already defined at r.urdf:4; names must be unique",
        ),
        (
            format!("{TWO_LINKS}\n{}", connect("j", "a", "c")),
            "r.urdf:4: joint `j`: child link `c` does not exist; links: a, b",
        ),
        (
            format!("{TWO_LINKS}\n{}", connect("j", "c", "b")),
            "r.urdf:4: joint `j`: parent link `c` does not exist; links: a, b",
        ),
        (
            TWO_LINKS.to_owned(),
            "r.urdf: the links a, b have no parent; a robot has exactly one root link",
        ),
        (
            format!(
                "{TWO_LINKS}\n{}{}",
                connect("j", "a", "b"),
                connect("k", "a", "b")
            ),
            "r.urdf:5: link `b` is the child of joint `j` and of joint `k`; a tree allows one parent",
        ),
        (
            format!(
                "{TWO_LINKS}\n{}{}",
                connect("j", "a", "b"),
                connect("k", "b", "a")
            ),
            "r.urdf:5: the links a -> b -> a form a cycle; a robot must be a tree",
        ),
        (
            format!("{TWO_LINKS}\n{}", connect("j", "b", "b")),
            "r.urdf:4: the links b -> b form a cycle; a robot must be a tree",
        ),
        (
            format!(
                "{TWO_LINKS}\n<link name=\"c\"/>\n{}{}",
                connect("j", "b", "c"),
                connect("k", "c", "b")
            ),
            "r.urdf:5: the links c -> b -> c form a cycle; a robot must be a tree",
        ),
    ];
    for (lines, message) in cases {
        assert_eq!(refusal(&lines), message);
    }
}

#[test]
fn a_floating_joint_makes_the_root_float_or_says_why_not() {
    let floating = "<joint name=\"f\" type=\"floating\"><parent link=\"world\"/><child link=\"a\"/></joint>";
    let world = "<link name=\"world\"/>";
    let rest = joint("revolute", LIMIT);
    let robot = read(&format!("{rest}\n{world}\n{floating}")).unwrap();
    assert_eq!((robot.root(), robot.nq(), robot.nv()), (Root::Floating, 8, 7));
    assert_eq!(robot.bodies()[0].name, "a");
    let names: Vec<&str> = robot.frames().iter().map(|frame| frame.name.as_str()).collect();
    assert_eq!(names, ["a", "b"], "the massless root link is gone");

    let heavy = "<link name=\"world\"><inertial><mass value=\"1\"/><inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" \
                 iyz=\"0\" izz=\"0\"/></inertial></link>";
    let moved = floating.replace("</joint>", "<origin xyz=\"0 0 1\"/></joint>");
    let branch = format!("<link name=\"c\"/>{}", connect("k", "world", "c"));
    let second = "<joint name=\"f\" type=\"floating\"><parent link=\"a\"/><child link=\"b\"/></joint>";
    let cases = [
        (
            format!("{rest}\n{heavy}\n{floating}"),
            "needs a massless root link, which it replaces",
        ),
        (
            format!("{rest}\n{world}\n{moved}"),
            "must have no origin: the configuration itself is the pose of its child in the world",
        ),
        (
            format!("{rest}\n{world}\n{floating}{branch}"),
            "must be the only joint of the root link",
        ),
        (
            format!(
                "{TWO_LINKS}\n{world}{}\n{second}",
                floating.replace("\"f\"", "\"g\"")
            )
            .replacen('\n', "\n\n", 1),
            "must hang on the root link",
        ),
        (
            format!(
                "{rest}\n{world}\n{}<link name=\"p\"/>{}",
                floating,
                connect("k", "p", "world")
            ),
            "must hang on the root link",
        ),
    ];
    for (lines, rule) in cases {
        assert_eq!(
            refusal(&lines),
            format!("r.urdf:6: joint `f`: a floating joint {rule}")
        );
    }
}

#[test]
fn texts_that_are_no_urdf_are_refused() {
    let read = |text: &str| {
        Robot::from_urdf_str(text, "x", &UrdfOptions::default())
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        read(""),
        "x:1: malformed XML: the document does not have a root node"
    );
    assert_eq!(
        read("<mujoco/>"),
        "x:1: the outermost element is <mujoco>, a URDF starts with <robot name=\"..\">"
    );
    assert_eq!(
        read("<robot><link name=\"a\"/></robot>"),
        "x:1: the <robot> element: attribute `name` of <robot> is missing"
    );
    let bomb = "<!DOCTYPE r [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]><robot name=\"&b;\"/>";
    assert!(read(bomb).contains("malformed XML"), "{}", read(bomb));
    let missing = Robot::from_urdf_file("no/such.urdf", &UrdfOptions::default()).unwrap_err();
    assert!(
        missing
            .to_string()
            .starts_with("no/such.urdf: cannot read the robot description: "),
        "{missing}"
    );
}

fn massless(name: &str) -> LinkSpec {
    LinkSpec {
        name: name.to_owned(),
        inertial: None,
    }
}

fn hinge(name: &str, parent: &str, child: &str) -> JointSpec {
    JointSpec {
        name: name.to_owned(),
        kind: JointKind::Revolute,
        parent: parent.to_owned(),
        child: child.to_owned(),
        origin: Isometry3::translation(0.0, 0.0, 0.1),
        axis: Vector3::y(),
        limits: Some(Limits::UNLIMITED),
        mimic: None,
    }
}

fn built(change: impl FnOnce(&mut LinkSpec, &mut JointSpec)) -> Result<Robot, RobotError> {
    let (mut link, mut joint) = (massless("b"), hinge("j", "a", "b"));
    change(&mut link, &mut joint);
    RobotBuilder::new("made")
        .link(massless("a"))
        .link(link)
        .joint(joint)
        .build()
}

/// Numbers a file cannot bring in but code can.
#[test]
fn the_builder_refuses_numbers_that_are_not_finite() {
    assert!(built(|_, _| ()).is_ok());
    let inertial = |mass_kg, x, ixx| {
        Some(Inertial {
            mass_kg,
            com: Vector3::new(x, 0.0, 0.0),
            inertia: Matrix3::identity() * ixx,
        })
    };
    let nan = f64::NAN;
    let limits = |limits: Limits| built(move |_, joint| joint.limits = Some(limits));
    let cases = [
        (
            built(|link, _| link.inertial = inertial(nan, 0.0, 1.0)),
            "link `b`: mass is NaN",
        ),
        (
            built(|link, _| link.inertial = inertial(1.0, f64::INFINITY, 1.0)),
            "link `b`: centre of mass is inf",
        ),
        (
            built(|link, _| link.inertial = inertial(1.0, 0.0, -f64::INFINITY)),
            "link `b`: inertia is -inf",
        ),
        (built(|_, joint| joint.axis.y = nan), "joint `j`: axis is NaN"),
        (
            built(|_, joint| joint.origin.translation.z = nan),
            "joint `j`: origin is NaN",
        ),
        (
            built(|_, joint| {
                joint.mimic = Some(Mimic {
                    joint: "j".to_owned(),
                    multiplier: nan,
                    offset: 0.0,
                })
            }),
            "joint `j`: mimic multiplier is NaN",
        ),
        (
            limits(Limits {
                velocity: nan,
                ..Limits::UNLIMITED
            }),
            "joint `j`: velocity limit is NaN",
        ),
    ];
    for (result, start) in cases {
        let message = result.unwrap_err().to_string();
        assert_eq!(message, format!("made: {start}, which is not a finite number"));
    }
    let upside_down = limits(Limits {
        lower: f64::INFINITY,
        ..Limits::UNLIMITED
    })
    .unwrap_err();
    assert_eq!(
        upside_down.to_string(),
        "made: joint `j`: position limits [inf, inf] are no interval; need lower <= upper"
    );
}

/// Finite numbers whose combination is not.
#[test]
fn overflow_is_an_error() {
    let heavy = |name: &str| LinkSpec {
        name: name.to_owned(),
        inertial: Some(Inertial {
            mass_kg: 1e308,
            com: Vector3::zeros(),
            inertia: Matrix3::identity(),
        }),
    };
    let fixed = JointSpec {
        kind: JointKind::Fixed,
        limits: None,
        ..hinge("j", "a", "b")
    };
    let result = RobotBuilder::new("made")
        .link(heavy("a"))
        .link(heavy("b"))
        .joint(fixed)
        .build();
    let message = result.unwrap_err().to_string();
    assert!(
        message.starts_with("made: link `a`: combined mass, centre of mass or inertia is"),
        "{message}"
    );
}

#[test]
fn too_many_joints_are_refused_but_long_rigid_chains_are_not() {
    let chain = |kind: JointKind, length: usize| {
        let mut builder = RobotBuilder::new("chain");
        builder.link(massless("0"));
        for i in 1..=length {
            let (parent, child) = (format!("{}", i - 1), i.to_string());
            builder.link(massless(&child));
            builder.joint(JointSpec {
                kind,
                ..hinge(&format!("j{i}"), &parent, &child)
            });
        }
        builder.build()
    };
    let longest = chain(JointKind::Revolute, 1024).unwrap();
    assert_eq!(longest.path(1024).len(), 1024);
    assert_eq!(
        chain(JointKind::Revolute, 1025).unwrap_err().to_string(),
        "chain: the robot has 1025 moving joints, at most 1024 are supported"
    );
    let rigid = chain(JointKind::Fixed, 50_000).unwrap();
    assert_eq!(
        (rigid.nq(), rigid.frames().len(), rigid.bodies().len()),
        (0, 50_001, 1)
    );
    assert!((rigid.frames()[50_000].x_body_frame.translation.z - 5000.0).abs() < 1e-6);
}

#[test]
fn questions_a_robot_cannot_answer_list_what_there_is() {
    let arm = embedded("pendulum").unwrap();
    let message = |result: Result<(), RobotError>| result.unwrap_err().to_string();
    assert_eq!(
        message(arm.frame("hand").map(|_| ())),
        "pendulum: no frame is named `hand`; frames: base, rod, tip"
    );
    assert_eq!(
        message(arm.coordinate("hinge").map(|_| ())),
        "pendulum: no independent joint is named `hinge`; independent joints: pivot"
    );
    assert_eq!(
        message(arm.with_limits("hinge", Limits::UNLIMITED).map(|_| ())),
        "pendulum: no independent joint is named `hinge`; independent joints: pivot"
    );
    assert_eq!(
        message(
            arm.with_limits(
                "pivot",
                Limits {
                    lower: 1.0,
                    upper: 0.0,
                    velocity: 1.0,
                    effort: 1.0
                }
            )
            .map(|_| ())
        ),
        "pendulum: joint `pivot`: position limits [1, 0] are no interval; need lower <= upper"
    );
    assert_eq!(
        message(arm.with_locked(&[("pivot", f64::NAN)]).map(|_| ())),
        "pendulum: joint `pivot`: value to lock at is NaN, which is not a finite number"
    );
    assert_eq!(
        message(arm.with_locked(&[("pivot", 0.5), ("pivot", 0.25)]).map(|_| ())),
        "pendulum: joint `pivot` is locked twice, at 0.5 and at 0.25"
    );
    assert_eq!(
        message(embedded("arm8").map(|_| ())),
        "no embedded robot is named `arm8`; embedded robots: coman, coman-legs, coman-legs-hyperextension, bioloid, melson, \
         hubo, hoap2, hrp2, asimo, arm6, arm7, slider-arm, pendulum"
    );
}

#[test]
fn a_joint_that_follows_another_cannot_be_locked() {
    let mut follower = hinge("k", "b", "c");
    follower.mimic = Some(Mimic {
        joint: "j".to_owned(),
        multiplier: -2.0,
        offset: 0.25,
    });
    let mut builder = RobotBuilder::new("made");
    builder
        .link(massless("a"))
        .link(massless("b"))
        .link(massless("c"));
    builder.joint(hinge("j", "a", "b")).joint(follower);
    assert_eq!(
        builder.clone().lock("k", 0.0).build().unwrap_err().to_string(),
        "made: joint `k` follows joint `j` and cannot be locked itself; lock `j`"
    );
    let locked = builder.lock("j", 0.5).build().unwrap();
    assert_eq!(
        (locked.nq(), locked.bodies().len(), locked.frames().len()),
        (0, 1, 3)
    );
    let (_, angle) = locked.frames()[2].x_body_frame.rotation.axis_angle().unwrap();
    assert!(
        (angle - 0.25).abs() < 1e-12,
        "0.5 - 2 * 0.5 + 0.25 about y is -0.25, found {angle}"
    );
}

/// An axis of length 1.0000003 is normalised.
#[test]
fn a_slightly_long_axis_is_normalised() {
    let robot = built(|_, joint| joint.axis = Vector3::new(0.6, 0.8000004, 0.0)).unwrap();
    assert!((robot.joints()[0].axis.norm() - 1.0).abs() < 1e-15);
}
