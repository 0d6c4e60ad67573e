//! Walks by preview control end to end: what the secondary objectives of Melson do, what they cannot do, and that robots stay
//! over their soles.

#![allow(clippy::unwrap_used, missing_docs, reason = "tests")]

use benchmarks::records::{Quality, Trace};
use benchmarks::referee::{Run, StepEfforts};
use benchmarks::runner::play;
use benchmarks::suite::{Case, Suite, Variation};
use ik_core::configuration::difference_into;
use ik_core::kinematics::{Page, forward};
use ik_core::robot::{FrameId, Robot};
use ik_core::task::Track;
use ik_methods::registry::method;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// A walk and what a method made of it.
struct Walked {
    case: Case,
    q: Vec<Vec<f64>>,
}

impl Walked {
    fn new(suite: &str, scenario: &str, id: &str) -> Self {
        Self::of(&Suite::load(suite).unwrap(), scenario, id)
    }

    fn of(suite: &Suite, scenario: &str, id: &str) -> Self {
        let index = suite.scenarios.iter().position(|s| s.id == scenario).unwrap();
        let case = Case::new(suite, index, &Variation::default()).unwrap();
        let contestant = method(id).unwrap().build(&toml::Table::new()).unwrap();
        let (_, played) = play(&case, &contestant).unwrap();
        let steps = u32::try_from(case.samples.steps()).unwrap();
        let ends = ["stepped", "converged"].map(|end| played.terminations.get(end).copied().unwrap_or(0));
        assert_eq!(ends.iter().sum::<u32>(), steps, "{:?}", played.terminations);
        Self { case, q: played.q }
    }

    fn run(&self) -> Run<'_> {
        Run {
            dt_s: self.case.dt_s,
            q: &self.q,
            targets: self.case.samples.judged(),
            phases: &self.case.phases,
            support: &self.case.support,
            walk: self.case.walk.as_ref(),
        }
    }

    fn quality(&self) -> Quality {
        self.case.referee.judge(&self.run())
    }

    fn trace(&self) -> Trace {
        self.case.referee.trace(&self.run(), &StepEfforts::default())
    }

    /// Steps k in which the robot hangs on another foot than in step k − 1.
    fn switches(&self) -> Vec<usize> {
        let phases = &self.case.phases;
        (1..phases.len())
            .filter(|&k| phases[k] != phases[k - 1])
            .map(|k| k + 1)
            .collect()
    }

    /// Where the root would be at sample k if the sole stood exactly where it is planned and no joint moved.
    fn root_from(&self, foot: FrameId, slot: usize, k: usize) -> Vector3<f64> {
        let robot = self.case.problem.robot();
        let mut page = Page::new(robot);
        forward(robot, &self.q[k], &mut page);
        let mut x = vec![0.0; self.case.problem.nxdot()];
        self.case.trajectory.value_into(self.case.dt_s * k as f64, &mut x);
        let at = Translation3::new(x[slot], x[slot + 1], x[slot + 2]);
        let turn = UnitQuaternion::from_euler_angles(x[slot + 3], x[slot + 4], x[slot + 5]);
        let planned = Isometry3::from_parts(at, turn);
        let root = Vector3::from_column_slice(&self.q[k][..3]);
        (planned * page.frame_pose(robot, foot).inverse() * nalgebra::Point3::from(root)).coords
    }
}

const CASES: [&str; 3] = ["S1", "S2", "S3"];

/// Torques of a support ankle's roll in the samples in which its foot stands alone (Nm).
fn ankle_roll(trace: &Trace) -> Vec<f64> {
    let column = |name: &str| trace.column(name).unwrap();
    let (right, left) = (column("torque_r_ankle_roll"), column("torque_l_ankle_roll"));
    let standing = column("standing_foot")
        .into_iter()
        .zip(right.into_iter().zip(left));
    let alone = |(foot, (right, left)): (f64, (f64, f64))| match foot {
        f if f < 0.0 => Some(right),
        f if f > 0.0 => Some(left),
        _ => None,
    };
    standing.filter_map(alone).collect()
}

#[test]
fn objectives_relieve_the_joints_of_melson_but_not_the_ankle_of_its_support() {
    let walks = CASES.map(|id| Walked::new("melson/walk", id, "clik"));
    let [nothing, centring, both] = walks.each_ref().map(Walked::quality);
    let h_joint = |q: &Quality| q.objective_mean["joint-centring"];
    assert!(h_joint(&centring) < 0.97 * h_joint(&nothing));
    let squares = |q: &Quality| q.single_support_torque_squared_mean_n2m2.unwrap();
    let saved = 1.0 - squares(&both) / squares(&nothing);
    assert!((0.10..0.25).contains(&saved), "{saved}");
    let [nothing, centring, both] = walks.each_ref().map(|w| ankle_roll(&w.trace()));
    // Two swings of 3 s, lift-off and touchdown apart.
    assert_eq!(nothing.len(), 2 * 299);
    for other in [centring, both] {
        let differences = nothing.iter().zip(&other).map(|(a, b)| (a - b).abs());
        let rms = (differences.clone().map(|d| d * d).sum::<f64>() / nothing.len() as f64).sqrt();
        let largest = differences.fold(0.0, f64::max);
        assert!(largest < 1e-4 && rms < 5e-6, "{largest} {rms}");
    }
}

#[test]
fn tasks_are_kept_and_no_support_switch_is_felt() {
    for id in CASES {
        let walked = Walked::new("melson/walk", id, "clik");
        let quality = walked.quality();
        assert!(quality.survived && quality.hard_error_max_m < 1e-5, "{id}");
        let robot = walked.case.problem.robot();
        let moved: Vec<f64> = walked.q.windows(2).map(|q| joint_change(robot, q)).collect();
        let switches = walked.switches();
        assert_eq!(switches, [501, 1001]);
        // moved[k − 1] is the increment of step k.
        let near = |k: &usize| switches.iter().any(|&s| (k + 1).abs_diff(s) <= 2);
        let largest = |at_switch: bool| {
            let steps = (0..moved.len()).filter(|k| near(k) == at_switch);
            steps.map(|k| moved[k]).fold(0.0, f64::max)
        };
        assert!(largest(true) <= largest(false), "{id}");
        for k in switches {
            let [right, left] = feet(&walked.case).map(|(foot, slot)| walked.root_from(foot, slot, k - 1));
            assert!(
                (right - left).norm() < 1e-5,
                "{id}, step {k}: {}",
                (right - left).norm()
            );
        }
    }
}

/// Largest increment of a joint between two configurations (rad).
fn joint_change(robot: &Robot, q: &[Vec<f64>]) -> f64 {
    let mut dq = vec![0.0; robot.nv()];
    difference_into(robot, &q[0], &q[1], &mut dq);
    dq[robot.root().nv()..].iter().fold(0.0, |m, d| m.max(d.abs()))
}

/// Frames of the feet and their first target rows.
fn feet(case: &Case) -> [(FrameId, usize); 2] {
    let problem = &case.problem;
    ["right-foot", "left-foot"].map(|name| {
        let task = problem.tasks().iter().position(|t| t.name == name).unwrap();
        let Track::Pose(frame) = problem.tasks()[task].track else {
            panic!("{name} tracks no pose");
        };
        (frame, problem.slots()[task].xdot)
    })
}

#[test]
fn without_objectives_joints_drift_and_centring_closes_their_path() {
    let [drifting, closed] = ["S1", "S2"].map(|id| Walked::new("melson/long-walk", id, "clik").quality());
    assert!(drifting.joint_drift_mean_rad_per_cycle.unwrap() > 5e-3);
    assert!(closed.joint_drift_last_rad_per_cycle.unwrap() < 1e-6);
    for quality in [drifting, closed] {
        assert_balanced(&quality, "melson/long-walk");
    }
}

/// The zero-moment point follows its reference, and stays over the soles, from 0.2 s on.
fn assert_balanced(quality: &Quality, name: &str) {
    let rms_m = quality.zmp_reference_error_rms_m.unwrap();
    let [cart, masses] = [
        quality.settled_cart_zmp_margin_min_m,
        quality.settled_zmp_margin_min_m,
    ];
    assert!(rms_m < 2e-3, "{name}: {rms_m}");
    assert!(
        cart.unwrap() > 0.0 && masses.unwrap() > 0.0,
        "{name}: {cart:?} {masses:?}"
    );
}

#[test]
fn every_robot_walks_with_its_zero_moment_point_on_its_reference() {
    let walks = [
        ("melson/walk", "S1"),
        ("melson/walk", "S3"),
        ("walk/hubo", "walk"),
        ("walk/bioloid", "walk"),
        ("walk/coman", "walk"),
    ];
    for (suite, scenario) in walks {
        let quality = Walked::new(suite, scenario, "clik").quality();
        assert_balanced(&quality, suite);
        assert!(quality.survived, "{suite}");
    }
}

/// Thirty rows on thirty coordinates: one answer, however it is found.
#[test]
fn all_methods_walk_hubo_the_same_way() {
    let exact = Walked::new("walk/hubo", "walk", "ik4");
    assert_eq!(exact.case.problem.robot().nv(), 30);
    for id in ["ik1", "ik2", "ik3", "ik5", "clik", "davies", "closed-form"] {
        let other = Walked::new("walk/hubo", "walk", id);
        let robot = exact.case.problem.robot();
        let pairs = exact.q.iter().zip(&other.q);
        let apart = pairs.map(|(a, b)| joint_change(robot, &[a.clone(), b.clone()]));
        let worst = apart.fold(0.0, f64::max);
        assert!(worst < 1e-3, "{id}: {worst}");
    }
}

/// Two objectives of one kind, with different weights, are two values; not the mean of both under one name.
#[test]
fn objectives_of_one_kind_are_told_apart() {
    let walk = benchmarks::suite::EMBEDDED
        .iter()
        .find(|(id, _)| *id == "melson/walk")
        .unwrap()
        .1;
    let weights = format!("weights = [{}]", ["4.0"; 19].join(", "));
    let second =
        format!("kind = \"gravity-torque\"\n\n[[problem.objectives]]\nkind = \"gravity-torque\"\n{weights}");
    let text = walk
        .replace("id = \"melson/walk\"", "id = \"mine\"")
        .replace("kind = \"gravity-torque\"", &second)
        .replace(
            "single_support_ramp_s = 0.3 }]",
            "single_support_ramp_s = 0.3 }, { value = 0.0 }]",
        )
        .replace("duration_s = 12.0", "duration_s = 3.0");
    let suite = Suite::parse(&text, "mine.toml", std::path::Path::new(".")).unwrap();
    let walked = Walked::of(&suite, "S1", "clik");
    let (quality, trace) = (walked.quality(), walked.trace());
    let [once, fourfold] = ["gravity-torque", "gravity-torque-2"].map(|name| {
        let column = trace.column(&format!("objective_{name}")).unwrap();
        (quality.objective_mean[name], column[250])
    });
    assert!((fourfold.0 / once.0 - 4.0).abs() < 1e-12 && (fourfold.1 / once.1 - 4.0).abs() < 1e-12);
}

/// Least margins again, from the trace: Melson's feet point along x, so one sole is its own bounding box.
#[test]
fn the_least_margins_are_those_of_the_trace() {
    let walked = Walked::new("melson/walk", "S1", "clik");
    let (trace, quality) = (walked.trace(), walked.quality());
    let column = |name: &str| trace.column(name).unwrap();
    let (t, masses) = (column("t"), column("zmp_margin"));
    let (x, y) = (column("cart_zmp_x"), column("cart_zmp_y"));
    let [x_min, x_max, y_min, y_max] =
        ["support_x_min", "support_x_max", "support_y_min", "support_y_max"].map(column);
    let counted: Vec<usize> = (2..t.len() - 2).filter(|&k| t[k] > 0.2).collect();
    let least = counted.iter().map(|&k| masses[k]).fold(f64::INFINITY, f64::min);
    assert_eq!(quality.settled_zmp_margin_min_m, Some(least));
    let narrow = y_max[t.len() / 4] - y_min[t.len() / 4];
    let alone = counted.iter().filter(|&&k| y_max[k] - y_min[k] < narrow + 1e-3);
    let to_border = |&k: &usize| {
        let across = (x[k] - x_min[k]).min(x_max[k] - x[k]);
        across.min(y[k] - y_min[k]).min(y_max[k] - y[k])
    };
    let least = alone.map(to_border).fold(f64::INFINITY, f64::min);
    let judged = quality.settled_cart_zmp_margin_min_m.unwrap();
    assert!((judged - least).abs() < 1e-9, "{judged} {least}");
}
