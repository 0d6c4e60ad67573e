//! Sizes, ranks and conditioning of the network, and what the paper prints of it.

use crate::support::*;
use ik_core::formulation::Declined;
use ik_core::spatial::so3;
use ik_core::task::{Priority, Track};
use ik_methods::davies::{Network, OrientationRates, ReferencePoint};
use nalgebra::{DMatrix, DVector, Vector3};

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
    assert_eq!(tasks, ["right-hand", "left-hand"]);
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
        "hard tasks impose 6 rows of rank 3 on a mobility of 3: too many are those of [\"right-hand\"]"
    );
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
