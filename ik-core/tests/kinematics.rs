//! Every Jacobian and second-order term against finite differences, over all embedded robots and all task kinds, at
//! random, zero and singular configurations; configurations on their manifold; gravity torques against virtual work.

#![allow(clippy::unwrap_used, missing_docs, reason = "tests")]

mod common;

use common::{Random, problem, robots, tracks, weights};
use ik_core::configuration::{difference, integrate};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::kinematics::gravity::{GRAVITY_M_S2, static_torques_into};
use ik_core::kinematics::jacobian::{Axes, frame_jacobian};
use ik_core::kinematics::{Page, forward};
use ik_core::problem::{PhaseId, Problem};
use ik_core::robot::{FrameId, Robot, Root};
use ik_core::rows::Rows;
use ik_core::spatial::so3;
use ik_core::step::Sample;
use ik_core::task::{OrientationCoordinates, Priority, Track};
use nalgebra::{DMatrix, DVector, Vector3};
use std::sync::Arc;

const H: f64 = 1e-5;
const PHASE: PhaseId = PhaseId(0);

fn target(problem: &Problem, random: &mut Random) -> (Vec<f64>, Vec<f64>) {
    (
        random.vector(problem.nx(), 0.7),
        random.vector(problem.nxdot(), 0.5),
    )
}

/// Random configurations, zero (straight legs, stretched arms) and one with every joint on a limit.
fn configurations(robot: &Robot, random: &mut Random) -> Vec<Vec<f64>> {
    let mut at_limits = random.configuration(robot, 0.8);
    for (q, c) in at_limits[robot.root().nq()..].iter_mut().zip(robot.coordinates()) {
        *q = if c.limits.lower.is_finite() {
            c.limits.lower
        } else {
            0.0
        };
    }
    vec![
        robot.neutral(),
        at_limits,
        random.configuration(robot, 1.0),
        random.configuration(robot, 0.3),
        random.configuration(robot, 1.4),
    ]
}

fn matrix(rows: &Rows, data: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.rows(), rows.cols(), |i, j| data[i + j * rows.ld()])
}

fn error(rows: &Rows) -> DVector<f64> {
    DVector::from_column_slice(&rows.error[..rows.rows()])
}

struct Fixture {
    problem: Arc<Problem>,
    evaluator: Evaluator,
    lin: Linearisation,
    x: Vec<f64>,
    xdot: Vec<f64>,
}

impl Fixture {
    fn rows_at(&mut self, q: &[f64]) -> Rows {
        let target = Sample {
            x: &self.x,
            xdot: &self.xdot,
        };
        self.evaluator.linearise(q, PHASE, target, &mut self.lin);
        if self.lin.hard.rows() > 0 {
            self.lin.hard.clone()
        } else {
            self.lin.soft.clone()
        }
    }
}

/// Calls `check` for every robot, task kind, orientation coordinates, priority and configuration.
fn sweep(mut check: impl FnMut(&mut Fixture, &[f64], &mut Random, &str)) {
    let mut random = Random(20_170_208);
    for robot in robots() {
        for track in tracks(&robot) {
            for orientation in [OrientationCoordinates::RollPitchYaw, OrientationCoordinates::Log] {
                for priority in [Priority::Hard, Priority::Compromised(weights(track.rows(&robot)))] {
                    let label = format!("{} {track:?} {orientation:?} {priority:?}", robot.name());
                    let problem = problem(&robot, track, orientation, priority);
                    let (x, xdot) = target(&problem, &mut random);
                    let mut fixture = Fixture {
                        evaluator: Evaluator::new(&problem),
                        lin: Linearisation::new(&problem),
                        problem,
                        x,
                        xdot,
                    };
                    for q in configurations(&robot, &mut random) {
                        if near_gimbal_lock(&fixture, &q) || near_half_turn(&mut fixture, &q) {
                            continue;
                        }
                        check(&mut fixture, &q, &mut random, &label);
                    }
                }
            }
        }
    }
}

/// Roll-pitch-yaw rows have no finite derivative near pitch = ±π/2.
fn near_gimbal_lock(fixture: &Fixture, q: &[f64]) -> bool {
    let robot = fixture.problem.robot();
    if fixture.problem.orientation() == OrientationCoordinates::Log {
        return false;
    }
    let (Track::Orientation(f) | Track::Pose(f)) = fixture.problem.tasks()[0].track else {
        return false;
    };
    let mut page = Page::new(robot);
    forward(robot, q, &mut page);
    page.frame_rotation(robot, f)[(2, 0)].abs() > 0.97
}

/// Logarithms and wrapped angles jump at half a turn from the target.
fn near_half_turn(fixture: &mut Fixture, q: &[f64]) -> bool {
    let rows = fixture.rows_at(q);
    rows.error.iter().any(|e| e.abs() > 2.9) || error(&rows).norm() > 2.9
}

#[test]
fn rows_are_the_derivative_of_their_error() {
    let mut count = 0;
    sweep(|fixture, q, _, label| {
        let robot = Arc::clone(fixture.problem.robot_arc());
        let rows = fixture.rows_at(q);
        let mut numeric = DMatrix::zeros(rows.rows(), rows.cols());
        for v in 0..robot.nv() {
            let mut d = vec![0.0; robot.nv()];
            d[v] = H;
            let plus = error(&fixture.rows_at(&integrate(&robot, q, &d)));
            d[v] = -H;
            let minus = error(&fixture.rows_at(&integrate(&robot, q, &d)));
            numeric.set_column(v, &((plus - minus) / (2.0 * H)));
        }
        let difference = (matrix(&rows, &rows.jacobian) - numeric).amax();
        assert!(difference < 3e-7, "{label}: {difference:e}");
        count += 1;
    });
    assert!(count > 1000, "{count}");
}

#[test]
fn rates_keep_the_rows_at_rest_along_the_target() {
    // Moving the target by its rate changes the error by −rate · dt.
    sweep(|fixture, q, _, label| {
        let rows = fixture.rows_at(q);
        let (x, xdot) = (fixture.x.clone(), fixture.xdot.clone());
        let mut moved = |s: f64| {
            fixture.x = moved_target(&fixture.problem, &x, &xdot, s);
            error(&fixture.rows_at(q))
        };
        let numeric = (moved(H) - moved(-H)) / (2.0 * H);
        fixture.x = x.clone();
        let rate = DVector::from_column_slice(&rows.rate[..rows.rows()]);
        assert!((numeric + rate).amax() < 1e-7, "{label}");
    });
}

fn moved_target(problem: &Problem, x: &[f64], xdot: &[f64], s: f64) -> Vec<f64> {
    let turned = |q: &[f64], w: &[f64]| {
        let q = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q[3], q[0], q[1], q[2]));
        (so3::exp_quaternion(&(Vector3::from_column_slice(w) * s)) * q)
            .coords
            .as_slice()
            .to_vec()
    };
    let added = |x: &[f64], v: &[f64]| x.iter().zip(v).map(|(x, v)| x + s * v).collect::<Vec<f64>>();
    match (problem.tasks()[0].track, problem.orientation()) {
        (Track::Orientation(_), OrientationCoordinates::Log) => turned(x, xdot),
        (Track::Pose(_), OrientationCoordinates::Log) => {
            [added(&x[..3], &xdot[..3]), turned(&x[3..], &xdot[3..])].concat()
        }
        _ => added(x, xdot),
    }
}

#[test]
fn velocity_derivative_is_the_derivative_of_the_velocity_row() {
    // ∂[J(q)(q ⊖ q⁻)]/∂q with q⁻ fixed, as eqs. (8) and (9) need it.
    sweep(|fixture, q, random, label| {
        let robot = Arc::clone(fixture.problem.robot_arc());
        let q_prev = integrate(&robot, q, &random.vector(robot.nv(), 0.4));
        let mut row = |q: &[f64]| {
            let rows = fixture.rows_at(q);
            matrix(&rows, &rows.jacobian) * DVector::from_vec(difference(&robot, &q_prev, q))
        };
        let mut numeric = DMatrix::zeros(row(q).len(), robot.nv());
        for v in 0..robot.nv() {
            let mut d = vec![0.0; robot.nv()];
            d[v] = H;
            let plus = row(&integrate(&robot, q, &d));
            d[v] = -H;
            numeric.set_column(v, &((plus - row(&integrate(&robot, q, &d))) / (2.0 * H)));
        }
        let dq = difference(&robot, &q_prev, q);
        fixture.rows_at(q);
        let target = Sample {
            x: &fixture.x,
            xdot: &fixture.xdot,
        };
        fixture
            .evaluator
            .velocity_derivative(&mut fixture.lin, target, &dq);
        let rows = if fixture.lin.hard.rows() > 0 {
            &fixture.lin.hard
        } else {
            &fixture.lin.soft
        };
        let worst = (matrix(rows, &rows.second) - &numeric).amax();
        assert!(worst < 1e-6 * (1.0 + numeric.amax()), "{label}: {worst:e}");
    });
}

#[test]
fn hessians_are_second_derivatives_and_symmetric() {
    sweep(|fixture, q, random, label| {
        let robot = Arc::clone(fixture.problem.robot_arc());
        let n = robot.nv();
        let (u, w) = (random.vector(n, 1.0), random.vector(n, 1.0));
        let product = |fixture: &mut Fixture, u: &[f64]| {
            fixture.rows_at(q);
            let target = Sample {
                x: &fixture.x,
                xdot: &fixture.xdot,
            };
            fixture.evaluator.hessian_product(&mut fixture.lin, target, u);
            let rows = if fixture.lin.hard.rows() > 0 {
                &fixture.lin.hard
            } else {
                &fixture.lin.soft
            };
            matrix(rows, &rows.second)
        };
        let hu = product(fixture, &u) * DVector::from_vec(w.clone());
        let hw = product(fixture, &w) * DVector::from_vec(u.clone());
        assert!(
            (&hu - &hw).amax() < 1e-12 * (1.0 + hu.amax()),
            "{label}: not symmetric"
        );
        // uᵀ H u by the second difference of the error along u.
        let step = 2e-4;
        let along = |fixture: &mut Fixture, s: f64| {
            let d: Vec<f64> = u.iter().map(|u| u * s * step).collect();
            error(&fixture.rows_at(&integrate(&robot, q, &d)))
        };
        let numeric =
            (along(fixture, 1.0) + along(fixture, -1.0) - along(fixture, 0.0) * 2.0) / (step * step);
        let analytic = product(fixture, &u) * DVector::from_vec(u.clone());
        let scale = 1.0 + analytic.amax();
        assert!(
            (&analytic - &numeric).amax() < 2e-5 * scale * scale,
            "{label}: {analytic} {numeric}"
        );
    });
}

#[test]
fn frame_jacobians_match_differences_in_world_and_body_axes() {
    let mut random = Random(7);
    for robot in robots() {
        let mut page = Page::new(&robot);
        for q in configurations(&robot, &mut random) {
            for f in 0..robot.frames().len() {
                let frame = FrameId(f);
                forward(&robot, &q, &mut page);
                let world = frame_jacobian(&robot, &page, frame, Axes::World);
                let body = frame_jacobian(&robot, &page, frame, Axes::Body);
                let r = page.frame_rotation(&robot, frame);
                let u = random.vector(robot.nv(), 1.0);
                let mut at = |s: f64| {
                    let d: Vec<f64> = u.iter().map(|u| u * s).collect();
                    forward(&robot, &integrate(&robot, &q, &d), &mut page);
                    (
                        page.frame_position(&robot, frame),
                        page.frame_rotation(&robot, frame),
                    )
                };
                let ((p1, r1), (p0, r0)) = (at(H), at(-H));
                let linear = (p1 - p0) / (2.0 * H);
                let angular = so3::log(&(r1 * r0.transpose())) / (2.0 * H);
                let v = &world * DVector::from_vec(u.clone());
                assert!(
                    (v.fixed_rows::<3>(0) - linear).norm() < 1e-7
                        && (v.fixed_rows::<3>(3) - angular).norm() < 1e-7
                );
                let vb = &body * DVector::from_vec(u);
                assert!((r * vb.fixed_rows::<3>(0) - linear).norm() < 1e-7);
                assert!((r * vb.fixed_rows::<3>(3) - angular).norm() < 1e-7);
            }
        }
    }
}

#[test]
fn integrate_and_difference_are_inverse_and_keep_unit_quaternions() {
    let mut random = Random(11);
    for robot in robots() {
        for _ in 0..200 {
            let (a, b) = (
                random.configuration(&robot, 1.3),
                random.configuration(&robot, 1.3),
            );
            let d = difference(&robot, &a, &b);
            let back = integrate(&robot, &a, &d);
            assert!(
                difference(&robot, &b, &back)
                    .iter()
                    .all(|e| e.abs() < 1e-14 * 10.0)
            );
            let tiny: Vec<f64> = random.vector(robot.nv(), 1e-9);
            let moved = difference(&robot, &a, &integrate(&robot, &a, &tiny));
            assert!(moved.iter().zip(&tiny).all(|(m, t)| (m - t).abs() < 1e-15));
            if robot.root() == Root::Floating {
                assert!((back[3..7].iter().map(|c| c * c).sum::<f64>() - 1.0).abs() < 1e-14);
            }
        }
        let q = random.configuration(&robot, 1.0);
        assert!(
            difference(&robot, &q, &integrate(&robot, &q, &vec![0.0; robot.nv()]))
                .iter()
                .all(|e| e.abs() < 1e-15)
        );
    }
}

#[test]
fn static_torques_balance_virtual_work() {
    // For any joint motion that keeps a single support still, torque · dq = change of potential energy.
    let mut random = Random(13);
    for robot in robots() {
        let mut page = Page::new(&robot);
        let first = robot.root().nv();
        let last = FrameId(robot.frames().len() - 1);
        for _ in 0..20 {
            let q = random.configuration(&robot, 1.0);
            forward(&robot, &q, &mut page);
            let mut torque = vec![0.0; robot.nv() - first];
            static_torques_into(&robot, &page, &[last], &mut torque).unwrap();
            let mut d = random.vector(robot.nv(), 1.0);
            if robot.root() == Root::Floating {
                // Root motion that keeps the support still: J_root d_root = −J_joints d_joints.
                let j = frame_jacobian(&robot, &page, last, Axes::World);
                let root = j.fixed_columns::<6>(0).into_owned();
                let rest = j.columns(6, robot.nv() - 6) * DVector::from_column_slice(&d[6..]);
                let solved = nalgebra::Matrix6::from(root).lu().solve(&-rest).unwrap();
                d[..6].copy_from_slice(solved.as_slice());
            }
            let mass = page.moving_mass_kg();
            let power: f64 = torque.iter().zip(&d[first..]).map(|(t, d)| t * d).sum();
            let climb: f64 = (0..robot.nv())
                .map(|v| page.centre_of_mass_column(v).z * d[v])
                .sum();
            assert!((power - mass * GRAVITY_M_S2 * climb).abs() < 1e-9 * (1.0 + power.abs()));
        }
    }
}

#[test]
fn weights_of_any_size_multiply_their_rows() {
    // A chain of 70 joints; its posture weighted once by a number, once by the same number as a matrix.
    let links: String = (0..=70).map(|i| format!("<link name=\"l{i}\"/>")).collect();
    let joints: String = (0..70)
        .map(|i| {
            format!(
                "<joint name=\"j{i}\" type=\"continuous\"><parent link=\"l{i}\"/><child link=\"l{}\"/>\
                 <origin xyz=\"0.1 0 0\"/><axis xyz=\"0 0 1\"/></joint>",
                i + 1
            )
        })
        .collect();
    let text = format!("<robot name=\"chain\">{links}{joints}</robot>");
    let options = ik_core::robot::UrdfOptions { root: Root::Fixed };
    let robot = Arc::new(Robot::from_urdf_str(&text, "chain", &options).unwrap());
    let full = (0..70)
        .map(|i| (0..70).map(|j| if i == j { 2.0 } else { 0.0 }).collect())
        .collect();
    for weights in [
        ik_core::task::Weights::Uniform(2.0),
        ik_core::task::Weights::Matrix(full),
    ] {
        let problem = problem(
            &robot,
            Track::Posture,
            OrientationCoordinates::Log,
            Priority::Compromised(weights),
        );
        let mut lin = Linearisation::new(&problem);
        let (x, xdot) = (vec![0.5; 70], vec![0.0; 70]);
        let target = Sample { x: &x, xdot: &xdot };
        Evaluator::new(&problem).linearise(&[0.0; 70], PHASE, target, &mut lin);
        let square: f64 = lin.soft.error.iter().map(|e| e * e).sum();
        assert!((square - 70.0 * 2.0 * 0.25).abs() < 1e-12, "{square}");
    }
}
