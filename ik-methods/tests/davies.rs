//! Davies' method against the network matrix written out, against pseudo-inverses, and against its own counts.

#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs, reason = "tests")]

use ik_core::boundary::Boundary;
use ik_core::configuration::integrate;
use ik_core::driver::{Driver, StepInput};
use ik_core::formulation::{Declined, Termination};
use ik_core::kinematics::jacobian::{Axes, frame_jacobian};
use ik_core::kinematics::{Page, forward};
use ik_core::problem::{Kind, Phase, PhaseId, Problem, ProblemParts, Supplies};
use ik_core::robot::{Robot, Root, UrdfOptions, embedded};
use ik_core::spatial::so3;
use ik_core::step::Window;
use ik_core::task::{OrientationCoordinates, Priority, Task, Track, Weights};
use ik_methods::davies::{Network, OrientationRates, ReferencePoint, Role};
use ik_methods::registry::method;
use nalgebra::{DMatrix, DVector, Matrix3, Quaternion, UnitQuaternion, Vector3};
use std::sync::Arc;

const WHOLE: PhaseId = PhaseId(0);

fn soft() -> Priority {
    Priority::Compromised(Weights::Uniform(1.0))
}

fn problem(robot: &Arc<Robot>, tasks: &[(&str, Track, Priority)]) -> Arc<Problem> {
    let parts = ProblemParts {
        robot: Arc::clone(robot),
        tasks: tasks
            .iter()
            .map(|(name, track, _)| Task {
                name: (*name).into(),
                track: *track,
            })
            .collect(),
        phases: vec![Phase {
            name: "whole".into(),
            tasks: tasks
                .iter()
                .enumerate()
                .map(|(i, (_, _, p))| (i, p.clone()))
                .collect(),
        }],
        boundary: Boundary::None,
        objectives: vec![],
        kind: Kind::Tracking,
        supplies: Supplies {
            rates: true,
            preview_s: 0.0,
        },
        orientation: OrientationCoordinates::Log,
    };
    Arc::new(Problem::new(parts).unwrap())
}

/// The tasks of the Bioloid gait.
fn gait_tasks(robot: &Robot, hands: Priority) -> Vec<(&'static str, Track, Priority)> {
    let frame = |name| robot.frame(name).unwrap();
    vec![
        ("right-foot", Track::Pose(frame("r_foot")), Priority::Hard),
        ("left-foot", Track::Pose(frame("l_foot")), Priority::Hard),
        ("waist", Track::Pose(frame("waist")), Priority::Hard),
        ("right-hand", Track::Position(frame("r_hand")), hands.clone()),
        ("left-hand", Track::Position(frame("l_hand")), hands),
    ]
}

fn bioloid() -> Arc<Robot> {
    Arc::new(embedded("bioloid").unwrap())
}

/// Bioloid with three wrist joints per arm, turning about z, y and x of the hand.
fn bioloid_with_wrists() -> Arc<Robot> {
    let mut text = include_str!("../../ik-core/robots/bioloid.urdf").to_owned();
    for side in ["r", "l"] {
        let mount = format!("<link name=\"{side}_hand\"/>");
        assert!(text.contains(&mount), "the hand of the description has changed");
        let mut wrist = String::new();
        let mut parent = format!("{side}_mount");
        for (k, axis) in ["0 0 1", "0 1 0", "1 0 0"].iter().enumerate() {
            let child = if k == 2 {
                format!("{side}_hand")
            } else {
                format!("{side}_wrist_{k}")
            };
            wrist += &format!(
                "<link name=\"{child}\"/><joint name=\"{side}_wrist_joint_{k}\" type=\"continuous\"><parent \
                 link=\"{parent}\"/><child link=\"{child}\"/><axis xyz=\"{axis}\"/></joint>"
            );
            parent = child;
        }
        let mounted = format!("<link name=\"{side}_mount\"/>{wrist}");
        text = text
            .replace(
                &format!("<child link=\"{side}_hand\"/>"),
                &format!("<child link=\"{side}_mount\"/>"),
            )
            .replace(&mount, &mounted);
    }
    let options = UrdfOptions { root: Root::Floating };
    Arc::new(Robot::from_urdf_str(&text, "bioloid with wrists", &options).unwrap())
}

/// Numbers in ±1 from a seed (SplitMix64).
fn numbers(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

fn random_posture(robot: &Robot, seed: u64) -> Vec<f64> {
    integrate(robot, &robot.neutral(), &numbers(seed, robot.nv()))
}

/// Targets where `q` puts them.
fn targets(problem: &Problem, q: &[f64]) -> Vec<f64> {
    let robot = problem.robot();
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    let turn = |f| {
        so3::quaternion(&page.frame_rotation(robot, f))
            .coords
            .as_slice()
            .to_vec()
    };
    let mut x = Vec::new();
    for task in problem.tasks() {
        match task.track {
            Track::Position(f) => x.extend(page.frame_position(robot, f).iter()),
            Track::Orientation(f) => x.extend(turn(f)),
            Track::Pose(f) => {
                x.extend(page.frame_position(robot, f).iter());
                x.extend(turn(f));
            }
            Track::CentreOfMass => x.extend(page.centre_of_mass().iter()),
            Track::Posture => x.extend(&q[robot.root().nq()..]),
        }
    }
    x
}

/// A random change of every target, and the rates of the virtual coordinates it means over one second: in the order of
/// the problem's tasks, linear first, as angular velocity.
fn moved(problem: &Problem, x: &[f64], seed: u64, size: f64) -> (Vec<f64>, Vec<Vec<f64>>) {
    let (mut to, mut rates) = (x.to_vec(), Vec::new());
    for (i, (task, slot)) in problem.tasks().iter().zip(problem.slots()).enumerate() {
        let rows = task.track.rows(problem.robot());
        let change: Vec<f64> = numbers(seed * 100 + i as u64, rows)
            .iter()
            .map(|c| size * c)
            .collect();
        let turn = match task.track {
            Track::Pose(_) => Some(3),
            Track::Orientation(_) => Some(0),
            _ => None,
        };
        let plain = turn.unwrap_or(rows);
        for k in 0..plain {
            to[slot.x + k] += change[k];
        }
        if let Some(at) = turn {
            let c = &mut to[slot.x + at..slot.x + at + 4];
            let before = UnitQuaternion::from_quaternion(Quaternion::new(c[3], c[0], c[1], c[2]));
            let w = Vector3::from_column_slice(&change[at..]);
            c.copy_from_slice((so3::exp_quaternion(&w) * before).coords.as_slice());
        }
        rates.push(change);
    }
    (to, rates)
}

fn drive(
    problem: &Arc<Problem>,
    parameters: &str,
    q: &[f64],
    x0: &[f64],
    x1: &[f64],
    dt_s: f64,
) -> (Vec<f64>, Termination) {
    let contestant = method("davies")
        .unwrap()
        .build(&parameters.parse().unwrap())
        .unwrap();
    let mut driver = Driver::new(&*contestant.formulation, problem).unwrap();
    let rest = vec![0.0; problem.nxdot()];
    let data = [x0, &rest, x1, &rest].concat();
    let input = StepInput {
        q_prev: q,
        v_prev: &vec![0.0; problem.robot().nv()],
        dt_s,
        phase: WHOLE,
        targets: Window::new(&data, problem.nx(), problem.nxdot()).unwrap(),
        gains: &[],
    };
    let majors = driver.majors();
    let (termination, _) = driver.step(&input, majors);
    (driver.solution().v.clone(), termination)
}

fn declined(problem: &Arc<Problem>) -> Declined {
    let contestant = method("davies").unwrap().build(&toml::Table::new()).unwrap();
    Driver::new(&*contestant.formulation, problem).unwrap_err()
}

#[test]
fn the_network_of_the_paper_has_the_corrected_sizes() {
    for hands in [Priority::Hard, soft()] {
        let robot = bioloid();
        let problem = problem(&robot, &gait_tasks(&robot, hands));
        let q = random_posture(&robot, 1);
        let network = Network::new(&problem, WHOLE, &q, ReferencePoint::Task, OrientationRates::Euler);
        assert_eq!(network.n.shape(), (24, 48));
        assert_eq!((network.primary().ncols(), network.secondary().ncols()), (24, 24));
        assert_eq!(Network::rank(&network.n), 24);
        assert_eq!(Network::rank(&network.secondary()), 24);
        let mechanism = &network.mechanism;
        assert_eq!(
            (
                mechanism.joints.len(),
                mechanism.links.len(),
                mechanism.circuits.len()
            ),
            (48, 45, 4)
        );
        assert_eq!(mechanism.mobility(), 24);
        // Euler's formula for one component: circuits = joints − links + 1.
        assert_eq!(
            mechanism.circuits.len(),
            mechanism.joints.len() + 1 - mechanism.links.len()
        );
    }
}

#[test]
fn three_more_joints_per_arm_give_the_printed_sizes() {
    let robot = bioloid_with_wrists();
    let mut tasks = gait_tasks(&robot, Priority::Hard);
    for (_, track, _) in &mut tasks {
        if let Track::Position(f) = *track {
            *track = Track::Pose(f);
        }
    }
    let problem = problem(&robot, &tasks);
    let q = random_posture(&robot, 2);
    let network = Network::new(&problem, WHOLE, &q, ReferencePoint::Task, OrientationRates::Euler);
    assert_eq!(network.n.shape(), (24, 54));
    assert_eq!((network.primary().ncols(), network.secondary().ncols()), (30, 24));
    assert_eq!(
        (Network::rank(&network.n), Network::rank(&network.secondary())),
        (24, 24)
    );
    assert_eq!(
        (network.mechanism.links.len(), network.mechanism.mobility()),
        (51, 30)
    );
}

#[test]
fn thirty_imposed_coordinates_are_too_many_for_eighteen_joints() {
    // The printed partition on the printed robot: every chain imposed.
    let robot = bioloid();
    let mut tasks = gait_tasks(&robot, Priority::Hard);
    for (_, track, _) in &mut tasks {
        if let Track::Position(f) = *track {
            *track = Track::Pose(f);
        }
    }
    let problem = problem(&robot, &tasks);
    let q = random_posture(&robot, 3);
    let network = Network::new(&problem, WHOLE, &q, ReferencePoint::Task, OrientationRates::Euler);
    assert_eq!(network.secondary().shape(), (24, 18));
    assert_eq!(Network::rank(&network.secondary()), 18);
    let Declined::Mobility {
        imposed,
        mobility,
        rank,
        tasks,
    } = declined(&problem)
    else {
        panic!("not refused for its mobility");
    };
    assert_eq!((imposed, mobility, rank), (30, 24, 24));
    assert_eq!(tasks.len(), 5);
}

#[test]
fn a_limb_that_is_asked_for_too_much_is_named() {
    // 21 of 24, but six on an arm of three joints.
    let robot = bioloid();
    let mut tasks = gait_tasks(&robot, Priority::Hard);
    tasks.pop();
    tasks[3] = (
        "right-hand",
        Track::Pose(robot.frame("r_hand").unwrap()),
        Priority::Hard,
    );
    let text = declined(&problem(&robot, &tasks)).to_string();
    assert_eq!(
        text,
        "tasks [\"right-hand\"] impose 6 rows of rank 3 on a mobility of 3"
    );
}

/// Problems whose N_s is square.
fn square_problems() -> Vec<Arc<Problem>> {
    let mut problems = Vec::new();
    let robot = bioloid();
    problems.push(problem(&robot, &gait_tasks(&robot, Priority::Hard)));
    let mut free = gait_tasks(&robot, Priority::Hard);
    free[2] = (
        "waist",
        Track::Orientation(robot.frame("waist").unwrap()),
        Priority::Hard,
    );
    free.push(("com", Track::CentreOfMass, Priority::Hard));
    problems.push(problem(&robot, &free));
    let legs = Arc::new(embedded("coman-legs").unwrap());
    let frame = |name| legs.frame(name).unwrap();
    problems.push(problem(
        &legs,
        &[
            ("com", Track::CentreOfMass, Priority::Hard),
            ("left", Track::Pose(frame("l_sole")), Priority::Hard),
            ("right", Track::Pose(frame("r_sole")), Priority::Hard),
            ("torso", Track::Orientation(frame("Waist")), Priority::Hard),
        ],
    ));
    for id in ["arm6", "slider-arm"] {
        let arm = Arc::new(embedded(id).unwrap());
        let tip = ik_core::robot::FrameId(arm.frames().len() - 1);
        problems.push(problem(&arm, &[("tip", Track::Pose(tip), Priority::Hard)]));
    }
    let arm7 = Arc::new(embedded("arm7").unwrap());
    problems.push(problem(&arm7, &[("rest", Track::Posture, Priority::Hard)]));
    problems
}

/// Rates of the primary coordinates of `network`, in its order, from the rates of the tasks.
fn primary_rates(
    problem: &Problem,
    network: &Network,
    q: &[f64],
    rates: &[Vec<f64>],
    how: OrientationRates,
) -> DVector<f64> {
    let robot = problem.robot();
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    let mechanism = &network.mechanism;
    let primary = mechanism.columns(Role::Imposed);
    let value = |column: usize| {
        let joint = &mechanism.joints[column];
        let task = problem
            .tasks()
            .iter()
            .position(|t| Some(&t.name) == joint.chain.as_ref())
            .unwrap();
        let first = mechanism
            .joints
            .iter()
            .position(|j| j.chain == joint.chain)
            .unwrap();
        let (k, rate) = (column - first, &rates[task]);
        let turn = |f, w: &[f64]| -> Vector3<f64> {
            let w = Vector3::from_column_slice(w);
            match how {
                OrientationRates::AngularVelocity => w,
                OrientationRates::Euler => {
                    // Columns e_x, Rx e_y, Rx Ry e_z from the angles of R = Rx Ry Rz, by hand.
                    let r: Matrix3<f64> = page.frame_rotation(robot, f);
                    let (a, b) = ((-r[(1, 2)]).atan2(r[(2, 2)]), r[(0, 2)].asin());
                    let rx = so3::exp(&Vector3::new(a, 0.0, 0.0));
                    let ry = so3::exp(&Vector3::new(0.0, b, 0.0));
                    let axes =
                        Matrix3::from_columns(&[Vector3::x(), rx * Vector3::y(), rx * ry * Vector3::z()]);
                    axes.try_inverse().unwrap() * w
                }
            }
        };
        match problem.tasks()[task].track {
            Track::Pose(f) if k >= 3 => turn(f, &rate[3..])[k - 3],
            Track::Orientation(f) => turn(f, rate)[k - 3],
            _ => rate[k],
        }
    };
    DVector::from_iterator(primary.len(), primary.iter().map(|&c| value(c)))
}

/// Velocity coordinates of the robot among the joints of the network: real joints, and those of a free root.
fn real_rates(
    problem: &Problem,
    network: &Network,
    secondary: &DVector<f64>,
    how: OrientationRates,
    v: &[f64],
) -> Vec<(f64, f64)> {
    let columns = network.mechanism.columns(Role::Secondary);
    let root = problem.robot().root().nv();
    let mut pairs = Vec::new();
    for (s, &column) in columns.iter().enumerate() {
        let euler = how == OrientationRates::Euler && (3..root).contains(&column);
        if column < problem.robot().nv() && !euler {
            pairs.push((v[column], secondary[s]));
        }
    }
    pairs
}

#[test]
fn a_square_network_is_solved_as_eq_11_says() {
    let (mut compared, mut worst) = (0, 0.0_f64);
    for problem in square_problems() {
        for seed in 0..60 {
            for how in [OrientationRates::AngularVelocity, OrientationRates::Euler] {
                let q = random_posture(problem.robot(), seed);
                let network = Network::new(&problem, WHOLE, &q, ReferencePoint::Task, how);
                let ns = network.secondary();
                assert!(ns.is_square());
                if network.condition() > 1e4 {
                    continue;
                }
                let x = targets(&problem, &q);
                let (to, rates) = moved(&problem, &x, seed + 7, 0.3);
                let qp = primary_rates(&problem, &network, &q, &rates, how);
                let expected = -ns.full_piv_lu().solve(&(network.primary() * qp)).unwrap();
                // The method moves its Euler angles, the targets turn at a constant rate: only the latter are compared.
                let (v, said) = drive(&problem, "correction = 0.0", &q, &x, &to, 1.0);
                assert_eq!(said, Termination::Stepped);
                let scale = v.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                for (found, expected) in real_rates(&problem, &network, &expected, how, &v) {
                    worst = worst.max((found - expected).abs() / scale);
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 5000 && worst < 1e-12, "{compared} {worst:e}");
}

#[test]
fn euler_rates_and_angular_velocity_impose_the_same_motion_to_first_order() {
    // Both bring every frame to its target; over a small step they differ by the square of the turn.
    for problem in square_problems() {
        for seed in 0..20 {
            let q = random_posture(problem.robot(), seed);
            let network = Network::new(&problem, WHOLE, &q, ReferencePoint::Task, OrientationRates::Euler);
            if network.condition() > 1e3 {
                continue;
            }
            let x = targets(&problem, &q);
            let (to, _) = moved(&problem, &x, seed, 1e-5);
            let (a, _) = drive(&problem, "orientation = 'angular-velocity'", &q, &x, &to, 1.0);
            let (b, _) = drive(&problem, "orientation = 'euler-rates'", &q, &x, &to, 1.0);
            let scale = a.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            assert!(
                a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-2 * scale),
                "{seed}"
            );
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-6), "{seed}");
        }
    }
}

#[test]
fn a_redundant_robot_on_a_fixed_foot_moves_by_its_pseudo_inverse() {
    let (mut compared, mut worst) = (0, 0.0_f64);
    for (id, foot, tasks) in [
        ("coman", "l_sole", &["r_sole", "Waist"][..]),
        ("coman", "r_sole", &["LForearm", "RForearm"]),
        ("bioloid", "r_foot", &["l_hand"]),
        ("bioloid", "l_foot", &["r_hand", "r_foot"]),
    ] {
        let robot = Arc::new(embedded(id).unwrap());
        let known: Vec<_> = robot.frames().iter().map(|f| f.name.clone()).collect();
        let frame = |name: &str| {
            robot
                .frame(name)
                .unwrap_or_else(|_| panic!("{name} of {known:?}"))
        };
        let mut list = vec![("foot", Track::Pose(frame(foot)), Priority::Hard)];
        for name in tasks {
            list.push((name, Track::Position(frame(name)), Priority::Hard));
        }
        list.push(("com", Track::CentreOfMass, Priority::Hard));
        let problem = problem(&robot, &list);
        for seed in 0..40 {
            let q = random_posture(&robot, seed);
            let x = targets(&problem, &q);
            let (mut to, rates) = moved(&problem, &x, seed, 0.2);
            to[..7].copy_from_slice(&x[..7]);
            // The robot re-rooted at its foot: root rates from those of the joints.
            let mut page = Page::new(&robot);
            forward(&robot, &q, &mut page);
            let whole = frame_jacobian(&robot, &page, frame(foot), Axes::World);
            let joints = robot.nv() - 6;
            let carried =
                -whole.fixed_columns::<6>(0).into_owned().try_inverse().unwrap() * whole.columns(6, joints);
            let (mut j, mut y) = (DMatrix::zeros(3 * tasks.len() + 3, joints), Vec::new());
            for (i, (_, track, _)) in list[1..].iter().enumerate() {
                let rows = match *track {
                    Track::Position(f) => frame_jacobian(&robot, &page, f, Axes::World)
                        .rows(0, 3)
                        .into_owned(),
                    _ => {
                        let columns: Vec<_> =
                            (0..robot.nv()).map(|v| page.centre_of_mass_column(v)).collect();
                        DMatrix::from_fn(3, robot.nv(), |r, c| columns[c][r])
                    }
                };
                let reduced = rows.columns(0, 6) * &carried + rows.columns(6, joints);
                j.rows_mut(3 * i, 3).copy_from(&reduced);
                y.extend(&rates[1 + i]);
            }
            let values = j.singular_values();
            if values[0] / values[values.len() - 1] > 1e4 {
                continue;
            }
            let expected = j.pseudo_inverse(1e-12).unwrap() * DVector::from_vec(y);
            let (v, said) = drive(&problem, "correction = 0.0", &q, &x, &to, 1.0);
            assert_eq!(said, Termination::Stepped);
            let scale = v.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            for (found, expected) in v[6..].iter().zip(expected.iter()) {
                worst = worst.max((found - expected).abs() / scale);
                compared += 1;
            }
        }
    }
    assert!(compared > 2000 && worst < 1e-12, "{compared} {worst:e}");
}

/// Bioloid with bent limbs, both feet flat, the waist 0.155 m over the ground.
fn stance(x: f64) -> Vec<f64> {
    let leg = [0.0, 0.0, -0.6486555, 1.2904366, -0.6417811, 0.0];
    let arm = [-0.3535033, -0.6403979, 1.5673627];
    let mut q = vec![x, 0.0, 0.155, 0.0, 0.0, 0.0, 1.0];
    q.extend(leg.iter().chain(&leg).chain(&arm));
    q.extend(arm.iter().map(|a| -a));
    q
}

#[test]
fn circuits_at_their_own_points_are_as_well_conditioned_anywhere() {
    let robot = bioloid();
    let problem = problem(&robot, &gait_tasks(&robot, Priority::Hard));
    let condition =
        |x: f64, point| Network::new(&problem, WHOLE, &stance(x), point, OrientationRates::Euler).condition();
    let here = condition(0.0, ReferencePoint::Task);
    for x in [1.0, 10.0, 100.0] {
        let there = condition(x, ReferencePoint::Task);
        assert!((there / here - 1.0).abs() < 0.01, "{x} m: {there} against {here}");
    }
    // Written at a fixed origin, as the paper does, it grows with the square of the distance.
    let far = [0.0, 1.0, 10.0, 100.0].map(|x| condition(x, ReferencePoint::Origin));
    let all = format!("{here} {far:?}");
    assert!((20.0..100.0).contains(&here), "{all}");
    assert!(far[2] > 1e3 && far[3] > 1e5, "{all}");
    assert!((far[3] / far[2] / 100.0 - 1.0).abs() < 0.05, "not a square");
}

#[test]
fn both_points_give_the_same_rates() {
    let robot = bioloid();
    let problem = problem(&robot, &gait_tasks(&robot, Priority::Hard));
    let q = stance(10.0);
    let rates = DVector::from_vec(numbers(5, 24));
    let solved = |point| {
        let network = Network::new(&problem, WHOLE, &q, point, OrientationRates::Euler);
        network
            .secondary()
            .full_piv_lu()
            .solve(&(network.primary() * &rates))
            .unwrap()
    };
    let (a, b) = (solved(ReferencePoint::Task), solved(ReferencePoint::Origin));
    assert!((&a - &b).amax() < 1e-9 * a.amax());
}

#[test]
fn straight_limbs_are_damped_and_flagged() {
    let robot = bioloid();
    let problem = problem(&robot, &gait_tasks(&robot, Priority::Hard));
    let q = robot.neutral();
    // Straight knees and elbows: one rank per limb is lost.
    let network = Network::new(
        &problem,
        WHOLE,
        &q,
        ReferencePoint::Task,
        OrientationRates::AngularVelocity,
    );
    assert_eq!(Network::rank(&network.secondary()), 20);
    let x = targets(&problem, &q);
    let mut to = x.clone();
    // The waist sinks by 1 mm, the feet stay: only bending the knees could do it, and their rate is exactly lost.
    let waist = problem.slots()[2].x;
    to[waist + 2] -= 1e-3;
    for damping in [0.0, 1e-2] {
        let (v, said) = drive(&problem, &format!("damping = {damping:?}"), &q, &x, &to, 1.0);
        assert!(v.iter().all(|v| v.is_finite()));
        let knee = v[6 + robot.coordinate("r_knee_pitch").unwrap()];
        assert!(knee.abs() < 1e-12, "{knee}");
        let Termination::Damped { residual } = said else {
            panic!("{said:?}");
        };
        // Both feet and both hands (which hang from the waist and would have to rise by 1 mm) miss 1 mm.
        assert!((residual - 2e-3).abs() < 1e-6, "{residual}");
    }
}

#[test]
fn the_rule_of_four_evaluations_is_of_fourth_order_on_a_turning_root() {
    // The waist turns and sways, the feet stand: an open loop integrated with analytic rates.
    let robot = bioloid();
    let problem = problem(&robot, &gait_tasks(&robot, soft()));
    let start = stance(0.0);
    let rest = targets(&problem, &start);
    let (nx, nxdot) = (problem.nx(), problem.nxdot());
    // x, ẋ at t: the waist turns by exp(φ(t)) with φ = a(t) n, whose angular velocity is ȧ n.
    let axis = Vector3::new(0.4, -0.6, 0.69).normalize();
    let sample = |t: f64| {
        let (mut x, mut xdot) = (rest.clone(), vec![0.0; nxdot]);
        let slot = problem.slots()[2];
        let (a, adot) = (0.3 * (1.0 - (2.0 * t).cos()), 0.6 * (2.0 * t).sin());
        let turn = so3::exp_quaternion(&(axis * a));
        x[slot.x + 1] += 0.02 * (1.0 - (3.0 * t).cos());
        xdot[slot.xdot + 1] = 0.06 * (3.0 * t).sin();
        x[slot.x + 3..slot.x + 7].copy_from_slice(turn.coords.as_slice());
        for k in 0..3 {
            xdot[slot.xdot + 3 + k] = axis[k] * adot;
        }
        [x, xdot].concat()
    };
    let error = |steps: usize| {
        let text = "correction = 0.0\nintegrator = 'rk4'\nrates = 'analytic'";
        let contestant = method("davies").unwrap().build(&text.parse().unwrap()).unwrap();
        let mut driver = Driver::new(&*contestant.formulation, &problem).unwrap();
        let (mut q, dt_s) = (start.clone(), 0.8 / steps as f64);
        for k in 0..steps {
            let data = [sample(dt_s * k as f64), sample(dt_s * (k + 1) as f64)].concat();
            let input = StepInput {
                q_prev: &q,
                v_prev: &vec![0.0; robot.nv()],
                dt_s,
                phase: WHOLE,
                targets: Window::new(&data, nx, nxdot).unwrap(),
                gains: &[],
            };
            let majors = driver.majors();
            assert_eq!(driver.step(&input, majors).0, Termination::Stepped);
            q.clone_from(&driver.solution().q);
        }
        let (reached, wanted) = (targets(&problem, &q), sample(0.8));
        let feet = &problem.slots()[..3];
        let positions = feet.iter().flat_map(|s| s.x..s.x + 3);
        positions
            .map(|i| (reached[i] - wanted[i]).abs())
            .fold(0.0, f64::max)
    };
    let (coarse, fine) = (error(40), error(80));
    assert!(coarse / fine > 13.0 && fine < 1e-6, "{coarse:e} {fine:e}");
}

/// Columns of the chain of the right foot in its own circuit.
fn chain_of_right_foot(q: &[f64], rates: OrientationRates) -> DMatrix<f64> {
    let robot = bioloid();
    let problem = problem(&robot, &gait_tasks(&robot, Priority::Hard));
    let network = Network::new(&problem, WHOLE, q, ReferencePoint::Task, rates);
    let joints = &network.mechanism.joints;
    let first = joints.iter().position(|j| j.name == "right-foot px").unwrap();
    network.n.view((0, first), (6, 6)).into_owned()
}

/// Eq. (7) prints the prismatic rate along y twice and none along z.
#[test]
fn the_chain_printed_in_eq_7_cannot_rise() {
    let chain = chain_of_right_foot(&stance(0.0), OrientationRates::Euler);
    let mut printed = chain.clone();
    let along_y = chain.column(1).into_owned();
    printed.set_column(2, &along_y);
    assert_eq!((Network::rank(&chain), Network::rank(&printed)), (6, 5));
    // A vertical velocity: angular part first.
    let rise = DVector::from_vec(vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let missed = |chain: &DMatrix<f64>| {
        let rates = chain.clone().pseudo_inverse(1e-12).unwrap() * &rise;
        (chain * rates - &rise).norm()
    };
    assert!(missed(&chain) < 1e-12 && (missed(&printed) - 1.0).abs() < 1e-12);
}

/// The text after eq. (7) says the chain's Jacobian can be inverted since it is 6 x 6.
#[test]
fn the_chain_called_invertible_is_singular_at_a_right_angle() {
    let robot = bioloid();
    let mut q = robot.neutral();
    let turn = so3::exp_quaternion(&Vector3::new(0.0, std::f64::consts::FRAC_PI_2, 0.0));
    q[3..7].copy_from_slice(turn.coords.as_slice());
    assert_eq!(
        Network::rank(&chain_of_right_foot(&q, OrientationRates::Euler)),
        5
    );
    assert_eq!(
        Network::rank(&chain_of_right_foot(&q, OrientationRates::AngularVelocity)),
        6
    );
}
