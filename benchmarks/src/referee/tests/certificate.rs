//! Optimality certificates: hand-solved problems, a solved humanoid step, and false claims.

use super::*;
use crate::referee::rows::{difference, error_jacobian, errors, integrate};
use crate::referee::{Certificate, CertifiedStep, RefereeError};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::Claim;
use ik_core::problem::PhaseId;
use ik_core::step::Sample;
use nalgebra::{DMatrix, DVector};

/// Three sliders: two along x, one along y between them; the tip stands at `(q0 + q2, q1, 0)`.
fn redundant() -> Robot {
    RobotBuilder::new("redundant")
        .link(link("base", 0.0, Vector3::zeros()))
        .link(link("a", 1.0, Vector3::zeros()))
        .link(link("b", 1.0, Vector3::zeros()))
        .link(link("tip", 1.0, Vector3::zeros()))
        .joint(joint(
            JointKind::Prismatic,
            ("base", "a"),
            [0.0; 3],
            [1.0, 0.0, 0.0],
        ))
        .joint(joint(JointKind::Prismatic, ("a", "b"), [0.0; 3], [0.0, 1.0, 0.0]))
        .joint(joint(
            JointKind::Prismatic,
            ("b", "tip"),
            [0.0; 3],
            [1.0, 0.0, 0.0],
        ))
        .build()
        .unwrap()
}

/// `min ½ Σ w_j q_j²` with the tip held at `x`.
fn resting(weights: [f64; 3]) -> Arc<Problem> {
    let robot = redundant();
    let tip = frame(&robot, "tip");
    let rest = Priority::Compromised(Weights::Diagonal(weights.to_vec()));
    let tasks = vec![
        ("rest", Track::Posture, rest),
        ("tip", Track::Position(tip), Priority::Hard),
    ];
    problem(robot, tasks, Boundary::None)
}

const FREE: [f64; 3] = [f64::INFINITY; 3];
const X: [f64; 6] = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0];

fn certify(problem: &Arc<Problem>, q: [f64; 3], lo: [f64; 3], hi: [f64; 3]) -> Certificate {
    let step = CertifiedStep {
        q_prev: &[0.0; 3],
        q: &q,
        x: &X,
        phase: PhaseId(0),
        lo: &lo,
        hi: &hi,
        active_tolerance: 1e-9,
    };
    referee(problem).certificate(&step).unwrap()
}

#[test]
fn a_free_optimum_has_the_multiplier_computed_by_hand() {
    let free = FREE.map(|v| -v);
    // q0 + q2 = 2 with least q0² + q2²: both 1, and the multiplier of x is 1.
    let found = certify(&resting([1.0; 3]), [1.0, 0.0, 1.0], free, FREE);
    assert!(found.residual < 1e-12 && found.hard_error < 1e-15, "{found:?}");
    assert!((found.hard[0] - 1.0).abs() < 1e-12 && found.bound.iter().all(|z| z.abs() < 1e-12));
    // Weights 1 and 3 share 2 as 3 : 1, and the multiplier is 1.5.
    let weighted = certify(&resting([1.0, 1.0, 3.0]), [1.5, 0.0, 0.5], free, FREE);
    assert!(weighted.residual < 1e-12 && (weighted.hard[0] - 1.5).abs() < 1e-12);
    // Away from it the best multiplier is the mean of 0.8 and 1.2.
    let off = certify(&resting([1.0; 3]), [0.8, 0.0, 1.2], free, FREE);
    assert!((off.residual - 0.2).abs() < 1e-12 && (off.relative - 0.2 / 1.2).abs() < 1e-12);
    let missed = certify(&resting([1.0; 3]), [1.0, 0.0, 0.75], free, FREE);
    assert!((missed.hard_error - 0.25).abs() < 1e-15);
}

#[test]
fn a_bound_multiplier_counts_only_with_its_sign() {
    let problem = resting([1.0; 3]);
    let free = FREE.map(|v| -v);
    // q0 may not pass 0.5: the rest goes to q2, y = 1.5 and z0 = 0.5 − 1.5 = −1.
    let upper = certify(&problem, [0.5, 0.0, 1.5], free, [0.5, 1.0, 9.0]);
    assert!(upper.residual < 1e-12 && upper.bound_violation == 0.0);
    assert!((upper.hard[0] - 1.5).abs() < 1e-12 && (upper.bound[0] + 1.0).abs() < 1e-12);
    // The same point with 0.5 as the least value: q0 would like to grow, nothing holds it.
    let lower = certify(&problem, [0.5, 0.0, 1.5], [0.5, -1.0, -9.0], FREE);
    assert!((lower.residual - 0.5).abs() < 1e-12, "{lower:?}");
    assert!(lower.bound.iter().all(|&z| z == 0.0));
    // Pinned from both sides any sign is right.
    assert!(certify(&problem, [0.5, 0.0, 1.5], [0.5, -1.0, -9.0], [0.5, 1.0, 9.0]).residual < 1e-12);
    // Out of the interval is seen, and the bound still counts as active.
    let outside = certify(&problem, [0.5, 0.0, 1.5], free, [0.4, 1.0, 9.0]);
    assert!(outside.residual < 1e-12 && (outside.bound_violation - 0.1).abs() < 1e-15);
}

/// Targets and configuration of a humanoid standing with bent knees; the posture task pulls the knees
/// elsewhere.
fn humanoid() -> (Arc<Problem>, Vec<f64>, Vec<f64>) {
    let robot = embedded("coman-legs").unwrap();
    let (left, right, torso) = (
        frame(&robot, "l_sole"),
        frame(&robot, "r_sole"),
        frame(&robot, "Waist"),
    );
    let matrix = vec![vec![2.0, 0.5, 0.0], vec![0.5, 1.0, 0.0], vec![0.0, 0.0, 3.0]];
    let tasks = vec![
        (
            "com",
            Track::CentreOfMass,
            Priority::Compromised(Weights::Matrix(matrix)),
        ),
        ("left", Track::Pose(left), Priority::Hard),
        ("right", Track::Pose(right), Priority::Hard),
        ("torso", Track::Orientation(torso), Priority::Hard),
        (
            "rest",
            Track::Posture,
            Priority::Compromised(Weights::Uniform(0.01)),
        ),
    ];
    let mut q = robot.neutral();
    for (joint, angle) in [
        ("LHipSag", -0.5),
        ("LKneeSag", 1.0),
        ("LAnkSag", -0.5),
        ("RHipSag", -0.5),
        ("RKneeSag", 1.0),
        ("RAnkSag", -0.5),
    ] {
        q[7 + robot.coordinate(joint).unwrap()] = angle;
    }
    let posture = crate::referee::tree::Posture::new(&robot, &q);
    let mut x: Vec<f64> = (posture.com + Vector3::new(0.01, 0.005, 0.02))
        .as_slice()
        .to_vec();
    for sole in [left, right] {
        x.extend(posture.frame(&robot, sole).translation.vector.iter());
        x.extend([0.0; 3]);
    }
    x.extend([0.05, -0.08, 0.1]);
    x.extend(vec![0.0; 12]);
    (problem(robot, tasks, Boundary::None), q, x)
}

/// Solves the plain problem without bounds by Gauss–Newton steps; returns q and the multipliers. The
/// posture's error does not vanish, so convergence is linear (a factor of 0.62 per step).
fn solve(problem: &Problem, start: &[f64], x: &[f64]) -> (Vec<f64>, DVector<f64>) {
    let weights = DVector::from_fn(15, |i, _| if i < 3 { 0.0 } else { 0.01 });
    let mut q_matrix = DMatrix::from_diagonal(&weights);
    q_matrix
        .view_mut((0, 0), (3, 3))
        .copy_from(&Matrix3::new(2.0, 0.5, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 3.0));
    let (mut q, nv, mut y) = (start.to_vec(), problem.robot().nv(), DVector::zeros(15));
    for _ in 0..80 {
        let (soft, hard) = (
            error_jacobian(problem, &[0, 4], &q, x),
            error_jacobian(problem, &[1, 2, 3], &q, x),
        );
        let gradient = soft.transpose() * &q_matrix * errors(problem, &[0, 4], &q, x);
        let mut kkt = DMatrix::zeros(nv + 15, nv + 15);
        kkt.view_mut((0, 0), (nv, nv))
            .copy_from(&(soft.transpose() * &q_matrix * &soft));
        kkt.view_mut((nv, 0), (15, nv)).copy_from(&hard);
        kkt.view_mut((0, nv), (nv, 15)).copy_from(&(-hard.transpose()));
        let mut right = DVector::zeros(nv + 15);
        right.rows_mut(0, nv).copy_from(&-gradient);
        right
            .rows_mut(nv, 15)
            .copy_from(&-errors(problem, &[1, 2, 3], &q, x));
        let solution = kkt.lu().solve(&right).unwrap();
        q = integrate(problem.robot(), &q, &solution.as_slice()[..nv]);
        y = solution.rows(nv, 15).into_owned();
    }
    (q, y)
}

#[test]
fn a_solved_humanoid_step_is_certified_and_a_shifted_one_is_not() {
    let (problem, start, x) = humanoid();
    let (q, y) = solve(&problem, &start, &x);
    let nv = problem.robot().nv();
    let (lo, hi) = (vec![f64::NEG_INFINITY; nv], vec![f64::INFINITY; nv]);
    let step = CertifiedStep {
        q_prev: &start,
        q: &q,
        x: &x,
        phase: PhaseId(0),
        lo: &lo,
        hi: &hi,
        active_tolerance: 1e-9,
    };
    let referee = referee(&problem);
    let found = referee.certificate(&step).unwrap();
    assert!(
        found.residual < 1e-11 && found.relative < 1e-8 && found.hard_error < 1e-11,
        "{found:?}"
    );
    assert!(
        found.hard.iter().zip(y.iter()).all(|(a, b)| (a - b).abs() < 1e-9),
        "the method's multipliers are found"
    );

    let mut claim = Claim {
        has: true,
        hard: y.as_slice().to_vec(),
        bound: vec![0.0; nv],
        own: vec![0.0; nv],
    };
    let honest = referee.own_stationarity(&claim, &step).unwrap();
    assert!(
        honest.residual < 1e-11 && honest.sign_violation == 0.0,
        "{honest:?}"
    );
    claim.hard[0] += 1e-6;
    assert!(
        referee.own_stationarity(&claim, &step).unwrap().residual > 1e-7,
        "a false multiplier"
    );
    claim.hard[0] -= 1e-6;
    (claim.own[7], claim.bound[7]) = (0.25, 0.25);
    let private = referee.own_stationarity(&claim, &step).unwrap();
    assert!(
        private.residual < 1e-11 && private.sign_violation == 0.25,
        "no bound is active: {private:?}"
    );

    // Hard rows stay as they are to first order, the pelvis moves: only stationarity is lost.
    let moved = {
        let hard = error_jacobian(&problem, &[1, 2, 3], &q, &x);
        let any = DVector::from_fn(nv, |i, _| if i < 3 { 1e-3 } else { 0.0 });
        let gram = (&hard * hard.transpose()).lu();
        let along = &any - hard.transpose() * gram.solve(&(&hard * &any)).unwrap();
        integrate(problem.robot(), &q, along.as_slice())
    };
    let shifted = referee.certificate(&CertifiedStep { q: &moved, ..step }).unwrap();
    assert!(
        shifted.residual > 1e-6 && shifted.hard_error < 1e-7,
        "{shifted:?}"
    );
}

#[test]
fn claimed_bounds_are_checked_against_the_side_that_is_active() {
    let problem = resting([1.0; 3]);
    let q = [0.5, 0.0, 1.5];
    let (lo, hi) = ([-1.0; 3], [0.5, 1.0, 9.0]);
    let step = CertifiedStep {
        q_prev: &[0.0; 3],
        q: &q,
        x: &X,
        phase: PhaseId(0),
        lo: &lo,
        hi: &hi,
        active_tolerance: 1e-9,
    };
    let claim = |z: f64, y: f64| Claim {
        has: true,
        hard: vec![y, 0.0, 0.0],
        bound: vec![z, 0.0, 0.0],
        own: vec![0.0; 3],
    };
    let check = |claim: &Claim| referee(&problem).own_stationarity(claim, &step).unwrap();
    let right = check(&claim(-1.0, 1.5));
    assert!(right.residual < 1e-12 && right.sign_violation == 0.0);
    let turned = check(&claim(1.0, 1.5));
    assert!((turned.residual - 2.0).abs() < 1e-12 && turned.sign_violation == 1.0);
}

/// The referee's rows and finite differences against the rows that methods are given.
#[test]
fn rows_agree_with_those_of_the_evaluator() {
    let mut draw = Draw(21);
    for orientation in [OrientationCoordinates::RollPitchYaw, OrientationCoordinates::Log] {
        for robot in robots() {
            let last = FrameId(robot.frames().len() - 1);
            let weights = Weights::Diagonal(vec![1.0, 4.0, 0.25]);
            let tasks = vec![
                ("com", Track::CentreOfMass, Priority::Compromised(weights)),
                (
                    "turn",
                    Track::Orientation(last),
                    Priority::Compromised(Weights::Uniform(9.0)),
                ),
                ("tool", Track::Pose(last), Priority::Hard),
            ];
            let parts = ProblemParts {
                orientation,
                ..parts(robot, tasks, Boundary::None)
            };
            let problem = Arc::new(Problem::new(parts).unwrap());
            let robot = problem.robot();
            let mut q = draw.configuration(robot);
            if robot.root() == Root::Floating {
                // Joints near zero keep roll, pitch and yaw away from their singularity.
                q[3..].iter_mut().for_each(|v| *v *= 0.2);
                q[6] = (1.0 - q[3..6].iter().map(|c| c * c).sum::<f64>()).sqrt();
            }
            let attitude = |draw: &mut Draw| {
                let turn = UnitQuaternion::from_euler_angles(
                    0.5 * draw.next(),
                    0.5 * draw.next(),
                    0.5 * draw.next(),
                );
                let (roll, pitch, yaw) = turn.euler_angles();
                match orientation {
                    OrientationCoordinates::RollPitchYaw => vec![roll, pitch, yaw],
                    OrientationCoordinates::Log => turn.coords.as_slice().to_vec(),
                }
            };
            let mut x: Vec<f64> = (0..3).map(|_| draw.next()).collect();
            x.extend(attitude(&mut draw));
            x.extend((0..3).map(|_| draw.next()));
            x.extend(attitude(&mut draw));
            let mut lin = Linearisation::new(&problem);
            let target = Sample {
                x: &x,
                xdot: &vec![0.0; problem.nxdot()],
            };
            Evaluator::new(&problem).linearise(&q, PhaseId(0), target, &mut lin);
            let nv = robot.nv();
            let (lo, hi) = (vec![f64::NEG_INFINITY; nv], vec![f64::INFINITY; nv]);
            let step = CertifiedStep {
                q_prev: &q,
                q: &q,
                x: &x,
                phase: PhaseId(0),
                lo: &lo,
                hi: &hi,
                active_tolerance: 0.0,
            };
            // With own = −J_sᵀ e_s + J_hᵀ y of the evaluator nothing must be left.
            let y: Vec<f64> = (0..6).map(|_| draw.next()).collect();
            let mut own = vec![0.0; nv];
            lin.soft.add_transposed(&lin.soft.error, -1.0, &mut own);
            lin.hard.add_transposed(&y, 1.0, &mut own);
            let claim = Claim {
                has: true,
                hard: y,
                bound: vec![0.0; nv],
                own,
            };
            let left = referee(&problem).own_stationarity(&claim, &step).unwrap();
            assert!(left.residual < 1e-8, "{} {orientation:?}: {left:?}", robot.name());
            let errors = errors(&problem, &[2], &q, &x);
            let apart = errors
                .iter()
                .zip(&lin.hard.error)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            assert!(apart < 1e-12, "{}: {apart:e}", robot.name());
        }
    }
}

#[test]
fn integration_and_difference_are_inverse() {
    let mut draw = Draw(22);
    for robot in [linkage(), two_links()] {
        for _ in 0..20 {
            let q = draw.configuration(&robot);
            let dq: Vec<f64> = (0..robot.nv()).map(|_| draw.next()).collect();
            let back = difference(&robot, &q, &integrate(&robot, &q, &dq));
            assert!(back.iter().zip(&dq).all(|(a, b)| (a - b).abs() < 1e-14));
            let core = ik_core::configuration::integrate(&robot, &q, &dq);
            assert!(
                integrate(&robot, &q, &dq)
                    .iter()
                    .zip(&core)
                    .all(|(a, b)| (a - b).abs() < 1e-14)
            );
        }
    }
}

#[test]
fn steps_are_checked() {
    let problem = resting([1.0; 3]);
    let (lo, hi) = (FREE.map(|v| -v), FREE);
    let good = CertifiedStep {
        q_prev: &[0.0; 3],
        q: &[0.0; 3],
        x: &X,
        phase: PhaseId(0),
        lo: &lo,
        hi: &hi,
        active_tolerance: 0.0,
    };
    let fails = |step: CertifiedStep<'_>| referee(&problem).certificate(&step).unwrap_err();
    assert_eq!(
        fails(CertifiedStep { q: &[0.0; 2], ..good }),
        RefereeError::Length {
            field: "q",
            found: 2,
            needed: 3
        }
    );
    assert_eq!(
        fails(CertifiedStep {
            q: &[f64::NAN; 3],
            ..good
        }),
        RefereeError::Unreadable { field: "q" }
    );
    assert_eq!(
        fails(CertifiedStep {
            x: &[f64::NAN; 6],
            ..good
        }),
        RefereeError::Unreadable { field: "x" }
    );
    assert_eq!(
        fails(CertifiedStep {
            phase: PhaseId(1),
            ..good
        }),
        RefereeError::Phase { found: 1, count: 1 }
    );
    let claim = Claim {
        has: true,
        hard: vec![0.0; 2],
        bound: vec![0.0; 3],
        own: vec![0.0; 3],
    };
    let wrong = referee(&problem).own_stationarity(&claim, &good).unwrap_err();
    assert_eq!(
        wrong,
        RefereeError::Length {
            field: "claim.hard",
            found: 2,
            needed: 3
        }
    );
}
