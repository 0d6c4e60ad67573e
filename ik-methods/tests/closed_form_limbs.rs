//! The analyser of limbs on the embedded robots, on the reference robots where they are installed, and on limbs made to
//! measure; the table in `docs/closed-form.md` against what is measured.

#![allow(clippy::unwrap_used, reason = "tests")]

use ik_core::kinematics::{Page, forward};
use ik_core::robot::{
    EMBEDDED, JointKind, JointSpec, Limits, LinkSpec, Mimic, Robot, RobotBuilder, Root, UrdfOptions, embedded,
};
use ik_methods::reverse_decoupling::analyser::{
    DenavitHartenberg, DhRow, Elimination, End, Family, LimbReport, NoRows, Reason, Side, Verdict,
    denavit_hartenberg, limbs,
};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.next()
    }

    fn vector(&mut self, scale: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-scale, scale))
    }

    fn pose(&mut self) -> Isometry3<f64> {
        Isometry3::new(self.vector(0.5), self.vector(2.0))
    }

    fn angles(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.between(-PI, PI)).collect()
    }
}

/// The reference robots by name, none (with a message) where they are not installed.
fn shared_robots() -> Vec<Robot> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/robots");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        eprintln!(
            "skipped: the reference robots are not installed ({})",
            folder.display()
        );
        return vec![];
    };
    let mut robots = vec![];
    for entry in entries {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        let Ok(text) = std::fs::read_to_string(folder.join(format!("{name}.urdf"))) else {
            continue;
        };
        let options = UrdfOptions { root: Root::Floating };
        robots.push(
            Robot::from_urdf_str(&text, &name, &options)
                .unwrap()
                .renamed(&name),
        );
    }
    assert!(robots.len() >= 20, "{}", robots.len());
    robots.sort_by_key(|robot| robot.name().to_owned());
    robots
}

fn shared_robot(name: &str) -> Option<Robot> {
    let found = shared_robots().into_iter().find(|robot| robot.name() == name);
    assert!(found.is_some() || shared_robots().is_empty(), "{name}");
    found
}

fn embedded_robots() -> Vec<Robot> {
    EMBEDDED.iter().map(|robot| embedded(robot.id).unwrap()).collect()
}

fn general(triple: End, elimination: Elimination) -> Verdict {
    Verdict::ClosedForm(Family::General { triple, elimination })
}

fn is_closed_form(limb: &LimbReport) -> bool {
    matches!(limb.verdict, Verdict::ClosedForm(_))
}

/// Greatest entry of the difference of two poses.
fn difference(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    (a.to_homogeneous() - b.to_homogeneous()).amax()
}

/// Greatest difference between the rows of a limb, there and back, and the kinematics of the whole robot, over the tip
/// frames at random joints.
fn error_of_rows(robot: &Robot, limb: &LimbReport, rows: &DenavitHartenberg, random: &mut Random) -> f64 {
    let first = robot.root().nq();
    let base = robot
        .frames()
        .iter()
        .position(|frame| frame.body == limb.base)
        .unwrap();
    let x_body_base = robot.frames()[base].x_body_frame;
    let (mut page, mut worst) = (Page::new(robot), 0.0_f64);
    for _ in 0..50 {
        let mut q = robot.neutral();
        q[first..].copy_from_slice(&random.angles(robot.coordinates().len()));
        forward(robot, &q, &mut page);
        let frame_pose = |frame: usize| page.frame_pose(robot, ik_core::robot::FrameId(frame));
        let base_pose = frame_pose(base) * x_body_base.inverse();
        let mut values: Vec<f64> = limb
            .joints
            .iter()
            .map(|&j| q[first + robot.joints()[j].coordinate])
            .collect();
        let tip = rows.tip_pose(&values);
        values.reverse();
        let there_and_back = rows.reversed().tip_pose(&values) * tip;
        worst = worst.max(difference(&there_and_back, &Isometry3::identity()));
        for frame in &limb.frames {
            let expected = base_pose.inverse() * frame_pose(frame.0);
            let found = tip * robot.frames()[frame.0].x_body_frame;
            worst = worst.max(difference(&expected, &found));
        }
    }
    worst
}

/// A robot of one chain, its axes along the z axes of rows at zero times `signs`, its frames placed and turned at random
/// on them.
fn made_to_measure(rows: &[DhRow], random: &mut Random) -> Robot {
    let mut poses = vec![];
    let mut frame = random.pose();
    for row in rows {
        let turn = UnitQuaternion::from_scaled_axis(random.vector(2.0));
        let slide = Translation3::new(0.0, 0.0, random.between(-0.3, 0.3));
        poses.push((frame * slide * turn, turn.inverse() * Vector3::z() * row.sign));
        frame *= row.transform(0.0);
    }
    let joints = (0..rows.len()).map(|i| {
        let parent = if i == 0 {
            Isometry3::identity()
        } else {
            poses[i - 1].0
        };
        let (pose, axis) = poses[i];
        joint(i, JointKind::Revolute, parent.inverse() * pose, axis)
    });
    chain(joints.collect())
}

fn joint(i: usize, kind: JointKind, origin: Isometry3<f64>, axis: Vector3<f64>) -> JointSpec {
    JointSpec {
        name: format!("j{}", i + 1),
        kind,
        parent: format!("l{i}"),
        child: format!("l{}", i + 1),
        origin,
        axis,
        limits: Some(Limits::UNLIMITED),
        mimic: None,
    }
}

fn chain(joints: Vec<JointSpec>) -> Robot {
    let mut builder = RobotBuilder::new("made-to-measure");
    for i in 0..=joints.len() {
        builder.link(LinkSpec {
            name: format!("l{i}"),
            inertial: None,
        });
    }
    for joint in joints {
        builder.joint(joint);
    }
    builder.build().unwrap()
}

/// A chain of joints without turned frames: axes and origins, each in the frame of the one before.
fn plain_chain(joints: &[(Vector3<f64>, Vector3<f64>)]) -> Robot {
    let spec = |(i, (axis, origin)): (usize, &(Vector3<f64>, Vector3<f64>))| {
        joint(i, JointKind::Revolute, Translation3::from(*origin).into(), *axis)
    };
    chain(joints.iter().enumerate().map(spec).collect())
}

fn only_limb(robot: &Robot) -> LimbReport {
    let [limb] = limbs(robot).try_into().unwrap();
    limb
}

fn row(alpha_deg: f64, a: f64, d: f64, offset: f64, sign: f64) -> DhRow {
    DhRow {
        alpha: alpha_deg.to_radians(),
        a,
        d,
        offset,
        sign,
    }
}

/// α, a and d of the paper's leg (with the offset of HRP-2) and arm.
fn paper_leg(l3: f64, l4: f64, d3: f64) -> [(f64, f64, f64); 6] {
    [
        (90.0, 0.0, 0.0),
        (-90.0, 0.0, 0.0),
        (0.0, l3, d3),
        (0.0, l4, 0.0),
        (90.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
    ]
}

fn paper_arm(l2: f64, l3: f64) -> [(f64, f64, f64); 6] {
    [
        (90.0, 0.0, 0.0),
        (-90.0, 0.0, 0.0),
        (90.0, 0.0, -l2),
        (90.0, 0.0, 0.0),
        (90.0, 0.0, l3),
        (0.0, 0.0, 0.0),
    ]
}

/// A limb on those rows with random zero angles and signs is of that family, and its rows are those.
fn is_recognised(rows: &[(f64, f64, f64)], family: Family, random: &mut Random) {
    let made: Vec<DhRow> = rows
        .iter()
        .map(|&(alpha, a, d)| {
            let sign = if random.next() < 0.5 { -1.0 } else { 1.0 };
            row(alpha, a, d, random.between(-3.0, 3.0), sign)
        })
        .collect();
    let robot = made_to_measure(&made, random);
    let limb = only_limb(&robot);
    assert_eq!(limb.verdict, Verdict::ClosedForm(family));
    let found = denavit_hartenberg(&robot, &limb).unwrap();
    // The pitch axes of a leg may point either way: d3 changes sign with them.
    for (i, (found, (alpha, a, d))) in found.rows.iter().zip(rows).enumerate() {
        let miss = (found.alpha - alpha.to_radians()).abs().max((found.a - a).abs());
        assert!(miss < 1e-13, "{family} row {i} {found:?} {made:?}");
        let d_miss = if family == Family::Leg {
            (found.d.abs() - d.abs()).abs()
        } else {
            (found.d - d).abs()
        };
        assert!(d_miss < 1e-13, "{family} row {i} {found:?} {made:?}");
    }
    assert!(error_of_rows(&robot, &limb, &found, random) < 1e-12);
}

#[test]
fn the_limbs_of_the_embedded_robots() {
    let verdicts = |id: &str| -> Vec<(String, Verdict)> {
        let limbs = limbs(&embedded(id).unwrap());
        limbs
            .into_iter()
            .map(|limb| (limb.tip_name, limb.verdict))
            .collect()
    };
    let named = |list: &[(&str, Verdict)]| -> Vec<(String, Verdict)> {
        list.iter()
            .map(|(name, verdict)| ((*name).to_owned(), verdict.clone()))
            .collect()
    };
    let coman = general(End::Base, Elimination::IntersectingLastAxes);
    let leg = Verdict::ClosedForm(Family::Leg);
    let many = Verdict::NotCovered(Reason::TooManyJoints);
    let few = Verdict::NotCovered(Reason::TooFewJoints);
    let legs = named(&[("LFoot", coman.clone()), ("RFoot", coman.clone())]);
    assert_eq!(verdicts("coman-legs"), legs);
    assert_eq!(verdicts("coman-legs-hyperextension"), legs);
    let arms = named(&[("LWrMot3", many.clone()), ("RWrMot3", many.clone())]);
    assert_eq!(verdicts("coman"), [legs, arms].concat());
    let bioloid = [
        ("r_foot_body", leg.clone()),
        ("l_foot_body", leg),
        ("r_forearm", few.clone()),
        ("l_forearm", few.clone()),
    ];
    assert_eq!(verdicts("bioloid"), named(&bioloid));
    assert_eq!(
        verdicts("arm6"),
        named(&[("flange", general(End::Tip, Elimination::Quartic))])
    );
    assert_eq!(verdicts("arm7"), named(&[("flange", many)]));
    let slides = Verdict::NotCovered(Reason::Prismatic("slide".into()));
    assert_eq!(verdicts("slider-arm"), named(&[("hand", slides)]));
    assert_eq!(verdicts("pendulum"), named(&[("rod", few)]));
}

#[test]
fn a_limb_is_told_with_its_bodies_joints_and_frames() {
    let robot = embedded("bioloid").unwrap();
    let limb = limbs(&robot).remove(1);
    assert_eq!((limb.side, limb.base_name.as_str()), (Side::Left, "waist"));
    let names = [
        "hip_yaw",
        "hip_roll",
        "hip_pitch",
        "knee_pitch",
        "ankle_pitch",
        "ankle_roll",
    ];
    assert_eq!(limb.joint_names, names.map(|name| format!("l_{name}")));
    assert!(limb.frames.contains(&robot.frame("l_foot").unwrap()));
    assert_eq!(limbs(&robot)[0].side, Side::Right);
    assert_eq!(limbs(&embedded("pendulum").unwrap())[0].side, Side::Centre);
    // At zero both legs of the humanoids of the source lie to the left.
    for name in ["hubo", "hoap2", "hrp2", "asimo", "coman"] {
        for limb in limbs(&embedded(name).unwrap()) {
            let is_left = limb.tip_name.to_lowercase().starts_with('l');
            let side = if is_left { Side::Left } else { Side::Right };
            assert_eq!(limb.side, side, "{name} {}", limb.tip_name);
        }
    }
}

#[test]
fn the_legs_of_the_reference_robots() {
    let robots = shared_robots();
    let mut closed: Vec<&str> = vec![];
    let mut misses = vec![];
    for robot in &robots {
        for limb in limbs(robot) {
            match limb.verdict {
                Verdict::ClosedForm(_) => closed.push(robot.name()),
                Verdict::NotCovered(Reason::AxesMiss { base_m, .. }) => misses.push((robot.name(), base_m)),
                Verdict::NotCovered(_) => {}
            }
        }
    }
    if robots.is_empty() {
        return;
    }
    // Both legs of each, and no other limb.
    let legs = ["coman", "drchubo", "hoap2", "hrp4c", "hubo2", "icub"];
    assert_eq!(closed, legs.map(|robot| [robot; 2]).concat());
    let expected = [
        ("op3", 5e-5),
        ("g1", 1.8e-2),
        ("valkyrie", 3e-2),
        ("atlas", 4.1e-2),
    ];
    for (robot, miss) in expected {
        let found: Vec<f64> = misses
            .iter()
            .filter(|(name, _)| *name == robot)
            .map(|(_, miss)| *miss)
            .collect();
        assert_eq!(found.len(), 2, "{robot}");
        assert!(
            found.iter().all(|found| (found / miss - 1.0).abs() < 0.02),
            "{robot} {found:?}"
        );
    }
    assert_eq!(misses.len(), 2 * expected.len() + 1, "and ur5: {misses:?}");
}

#[test]
fn locked_fingers_and_wrists_make_limbs() {
    let arm = |robot: Option<Robot>, locked: &[(&str, f64)], tip: &str| {
        let robot = robot?.with_locked(locked).unwrap();
        let limb = limbs(&robot)
            .into_iter()
            .find(|limb| limb.tip_name == tip)
            .unwrap();
        let rows = denavit_hartenberg(&robot, &limb).unwrap();
        assert!(error_of_rows(&robot, &limb, &rows, &mut Random(5)) < 1e-12);
        Some(limb.verdict)
    };
    let hoap2 = arm(shared_robot("hoap2"), &[("larm_joint_5", 0.3)], "larm_4");
    assert!(hoap2.is_none_or(|verdict| verdict == Verdict::ClosedForm(Family::FourJointArm)));
    let hrp4c = arm(
        shared_robot("hrp4c"),
        &[("L_HAND_J0", 0.0), ("L_HAND_J1", 0.0)],
        "L_WRIST_R_LINK",
    );
    assert!(hrp4c.is_none_or(|verdict| verdict == general(End::Base, Elimination::IntersectingLastAxes)));
}

#[test]
fn rows_reproduce_every_limb_with_a_closed_form() {
    let mut random = Random(11);
    let mut checked = 0;
    for robot in embedded_robots().into_iter().chain(shared_robots()) {
        for limb in limbs(&robot).iter().filter(|limb| is_closed_form(limb)) {
            let rows = denavit_hartenberg(&robot, limb).unwrap();
            let error = error_of_rows(&robot, limb, &rows, &mut random);
            assert!(error < 1e-12, "{} {} {error:e}", robot.name(), limb.tip_name);
            assert!(
                rows.defect < 1e-14,
                "{} {} {:e}",
                robot.name(),
                limb.tip_name,
                rows.defect
            );
            let tip = matches!(
                limb.verdict,
                Verdict::ClosedForm(Family::General { triple: End::Tip, .. })
            );
            let ordered = if tip { rows.reversed() } else { rows };
            for row in &ordered.rows[..2] {
                assert!(row.a == 0.0 && row.d == 0.0, "{} {row:?}", robot.name());
            }
            checked += 1;
        }
    }
    assert!(checked >= 9, "{checked}");
}

#[test]
fn the_limbs_of_the_paper_are_recognised_whatever_the_signs_of_their_axes() {
    let mut random = Random(21);
    for _ in 0..200 {
        let (a, b) = (random.between(0.1, 0.5), random.between(0.1, 0.5));
        let offset = random.between(0.01, 0.1);
        is_recognised(&paper_leg(a, b, 0.0), Family::Leg, &mut random);
        is_recognised(&paper_leg(a, b, offset), Family::Leg, &mut random);
        is_recognised(&paper_arm(a, b), Family::Arm, &mut random);
        let mut four = paper_arm(a, b)[..4].to_vec();
        four[3].0 = 0.0;
        is_recognised(&four, Family::FourJointArm, &mut random);
    }
}

/// Rows of a general limb with its triple at the base end.
fn random_rows(elimination: Elimination, random: &mut Random) -> Vec<DhRow> {
    let mut rows: Vec<DhRow> = (0..6)
        .map(|i| {
            let length = if i < 2 { 0.0 } else { 1.0 };
            let alpha = random.between(20.0, 160.0);
            let (a, d) = (
                random.between(0.05, 0.4) * length,
                random.between(-0.4, 0.4) * length,
            );
            row(alpha, a, d, random.between(-3.0, 3.0), 1.0)
        })
        .collect();
    match elimination {
        Elimination::IntersectingLastAxes => rows[4].a = 0.0,
        Elimination::ParallelLastAxes => rows[4].alpha = PI * (random.next() < 0.5) as u8 as f64,
        Elimination::Quartic => {}
    }
    rows
}

#[test]
fn general_limbs_are_recognised_at_either_end() {
    let mut random = Random(31);
    let cases = [
        Elimination::IntersectingLastAxes,
        Elimination::ParallelLastAxes,
        Elimination::Quartic,
    ];
    for elimination in cases {
        for _ in 0..100 {
            let rows = random_rows(elimination, &mut random);
            let turned = DenavitHartenberg {
                base: Isometry3::identity(),
                rows: rows.clone(),
                tool: Isometry3::identity(),
                defect: 0.0,
            }
            .reversed();
            for (rows, end) in [(rows, End::Base), (turned.rows, End::Tip)] {
                let robot = made_to_measure(&rows, &mut random);
                let limb = only_limb(&robot);
                assert_eq!(limb.verdict, general(end, elimination), "{rows:?}");
                let found = denavit_hartenberg(&robot, &limb).unwrap();
                let error = error_of_rows(&robot, &limb, &found, &mut random);
                assert!(error < 1e-12, "{error:e} {rows:?}");
            }
        }
    }
}

#[test]
fn nearly_parallel_axes_cost_at_most_their_angle() {
    let mut random = Random(41);
    for exponent in 3..=12 {
        for _ in 0..20 {
            let mut rows = random_rows(Elimination::IntersectingLastAxes, &mut random);
            rows[3].alpha = 10.0_f64.powi(-exponent);
            let robot = made_to_measure(&rows, &mut random);
            let limb = only_limb(&robot);
            let found = denavit_hartenberg(&robot, &limb).unwrap();
            let error = error_of_rows(&robot, &limb, &found, &mut random);
            let bound = 1e-12 + 6.0 * found.defect;
            assert!(error < bound, "1e-{exponent} {error:e} {:e}", found.defect);
            // Below 1e-9 rad rounding of the axes moves their common normal by kilometres: they are taken for parallel.
            let most = if exponent < 9 { 1e-13 } else { 1.1 * rows[3].alpha };
            assert!(found.defect < most, "1e-{exponent} {:e}", found.defect);
        }
    }
}

/// Six axes at right angles, origins given; the third axis passes `miss` beside the crossing of the other two.
fn missing_by(miss: f64) -> Robot {
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    plain_chain(&[
        (z, Vector3::zeros()),
        (x, Vector3::zeros()),
        (y, x * miss),
        (y, z * -0.3),
        (y, z * -0.3),
        (x, z * -0.1),
    ])
}

#[test]
fn a_miss_is_measured_from_the_least_squares_point() {
    // Axes 1 and 3 are `miss` apart and both cross axis 2 at right angles: the point is half way on axis 2.
    for miss in [1e-5, 1e-3, 0.1] {
        let verdict = only_limb(&missing_by(miss)).verdict;
        let Verdict::NotCovered(Reason::AxesMiss { base_m, .. }) = verdict else {
            panic!("{verdict}");
        };
        assert!((base_m - miss / 2.0).abs() < 1e-15, "{base_m:e}");
    }
    // Within the tolerance the limb qualifies, and its rows say what that costs.
    let robot = missing_by(1e-6);
    let limb = only_limb(&robot);
    assert_eq!(
        limb.verdict,
        Verdict::ClosedForm(Family::General {
            triple: End::Base,
            elimination: Elimination::Quartic
        })
    );
    let rows = denavit_hartenberg(&robot, &limb).unwrap();
    assert!((rows.defect - 5e-7).abs() < 1e-12, "{:e}", rows.defect);
    assert!(error_of_rows(&robot, &limb, &rows, &mut Random(1)) < 6.0 * rows.defect);
}

#[test]
fn what_is_not_covered_is_said() {
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let origin = Vector3::zeros();
    let reason = |robot: &Robot| match only_limb(robot).verdict {
        Verdict::NotCovered(reason) => reason,
        Verdict::ClosedForm(family) => panic!("{family}"),
    };
    let middle = |first: usize| {
        let axes = [x, z, x, y, z, x];
        let place = |i: usize| {
            if i == first || i > first + 2 {
                Vector3::new(0.1, 0.2, 0.3)
            } else {
                origin
            }
        };
        let start = |i: usize| {
            if i < first {
                Vector3::new(0.3, -0.1, 0.2)
            } else {
                place(i)
            }
        };
        plain_chain(&[0, 1, 2, 3, 4, 5].map(|i| (axes[i], start(i))))
    };
    assert_eq!(reason(&middle(1)), Reason::MiddleTriple("j2".into()));
    assert_eq!(reason(&middle(2)), Reason::MiddleTriple("j3".into()));
    // Joint 2 and 3 on one axis: the three axes pass through a point, and yet it is no spherical joint.
    let same = plain_chain(&[
        (z, origin),
        (x, origin),
        (x, x * 0.2),
        (y, z * 0.3),
        (y, z * 0.3),
        (x, z),
    ]);
    assert_eq!(reason(&same), Reason::SameAxis("j2".into(), "j3".into()));
    let mut joints: Vec<JointSpec> = (0..6)
        .map(|i| joint(i, JointKind::Revolute, Isometry3::identity(), [x, y, z][i % 3]))
        .collect();
    joints[4].mimic = Some(Mimic {
        joint: "j1".into(),
        multiplier: 1.0,
        offset: 0.0,
    });
    assert_eq!(reason(&chain(joints.clone())), Reason::Mimic("j5".into()));
    joints[4].mimic = None;
    joints[2].kind = JointKind::Prismatic;
    assert_eq!(reason(&chain(joints)), Reason::Prismatic("j3".into()));
}

#[test]
fn rows_are_refused_for_other_limbs() {
    let coman = embedded("coman").unwrap();
    let bioloid = embedded("bioloid").unwrap();
    let arm = limbs(&coman).pop().unwrap();
    let refused = denavit_hartenberg(&coman, &arm).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "limb at `RWrMot3` has no closed form: more than six joints"
    );
    let leg = &limbs(&coman)[0];
    let refused = denavit_hartenberg(&bioloid, leg).unwrap_err();
    assert!(matches!(refused, NoRows::OtherRobot { .. }), "{refused}");
}

#[test]
fn rows_of_the_straight_leg_are_those_of_the_paper() {
    // Placed as the paper's leg at the standing pose (0, −90°, 0, 0, 0, 0).
    let robot = embedded("bioloid").unwrap();
    let rows = denavit_hartenberg(&robot, &limbs(&robot)[0]).unwrap().rows;
    let offsets: Vec<f64> = rows.iter().map(|row| row.offset).collect();
    assert_eq!(offsets, [0.0, -FRAC_PI_2, 0.0, 0.0, 0.0, 0.0]);
    assert!((rows[2].a - 0.0773829).abs() < 1e-15 && (rows[3].a - 0.0780929).abs() < 1e-15);
}

/// The rows of the table for one robot: limbs with the same number of joints and the same verdict together.
fn table_of(robot: &Robot) -> Vec<String> {
    let mut groups: Vec<(usize, String, Vec<String>)> = vec![];
    for limb in limbs(robot) {
        let name = format!("{} → {}", limb.base_name, limb.tip_name);
        let (joints, verdict) = (limb.joints.len(), limb.verdict.to_string());
        match groups
            .iter_mut()
            .find(|group| group.0 == joints && group.1 == verdict)
        {
            Some(group) => group.2.push(name),
            None => groups.push((joints, verdict, vec![name])),
        }
    }
    let line = |(joints, verdict, names): &(usize, String, Vec<String>)| {
        format!(
            "| {} | {} | {joints} | {verdict} |",
            robot.name(),
            names.join(", ")
        )
    };
    groups.iter().map(line).collect()
}

#[test]
fn the_documented_table_is_the_measured_one() {
    let document = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/closed-form.md");
    let document = std::fs::read_to_string(document).unwrap();
    let tables: Vec<String> = [embedded_robots(), shared_robots()]
        .iter()
        .map(|robots| robots.iter().flat_map(table_of).collect::<Vec<_>>().join("\n"))
        .collect();
    for table in tables {
        assert!(document.contains(&table), "docs/closed-form.md lacks:\n{table}");
    }
}
