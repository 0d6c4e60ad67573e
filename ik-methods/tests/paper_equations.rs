//! The formulations against their printed equations, solved by other means: IK1 and IK2 against the pseudo-inverse of the
//! KKT matrix, IK3 against clarabel, IK2's conjugate gradients against its elimination.

#![allow(clippy::unwrap_used, missing_docs, reason = "tests")]

mod common;

use common::legs;
use ik_core::boundary::Boundary;
use ik_core::configuration::difference;
use ik_core::driver::{Driver, StepInput};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::problem::{PhaseId, Problem};
use ik_core::rows::Rows;
use ik_core::step::{Sample, Window};
use ik_methods::qp::{ClarabelQp, MatRef, Qp, QpSolution, QpSolver, QpStatus};
use ik_methods::registry::method;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

const R: f64 = 1e-2;
const DT: f64 = 0.005;

/// Standing with both knees at `knee`, soles flat.
fn stance(problem: &Problem, knee: f64) -> Vec<f64> {
    let robot = problem.robot();
    let hip = (0.2010 * knee.sin()).atan2(0.2258 + 0.2010 * knee.cos());
    let mut q = robot.neutral();
    q[2] = 0.2258 * hip.cos() + 0.2010 * (knee - hip).cos() + 0.09;
    for side in ["L", "R"] {
        for (joint, value) in [("HipSag", -hip), ("KneeSag", knee), ("AnkSag", hip - knee)] {
            q[7 + robot.coordinate(&format!("{side}{joint}")).unwrap()] = value;
        }
    }
    q
}

/// A target near the stance: feet where they are, centre of mass and torso displaced by `by`.
fn sample(com: [f64; 3], by: f64) -> (Vec<f64>, Vec<f64>) {
    let mut x = vec![com[0] + by, com[1] - 0.5 * by, com[2] - 2.0 * by];
    for y in [0.0726, -0.0726] {
        x.extend([0.0, y, 0.0, 0.0, 0.0, 0.0]);
    }
    x.extend([0.3 * by, by, -0.2 * by]);
    let mut xdot = vec![0.0; 18];
    xdot[2] = -by / DT;
    xdot[15] = by / DT;
    (x, xdot)
}

struct Fixture {
    problem: Arc<Problem>,
    q: Vec<f64>,
    x: Vec<f64>,
    xdot: Vec<f64>,
}

impl Fixture {
    fn new(boundary: Boundary, knee: f64, by: f64) -> Self {
        let problem = legs(boundary, vec![1.0, 2.0, 0.5], vec![]);
        let q = stance(&problem, knee);
        let mut page = ik_core::kinematics::Page::new(problem.robot());
        ik_core::kinematics::forward(problem.robot(), &q, &mut page);
        let (x, xdot) = sample(page.centre_of_mass().into(), by);
        Self { problem, q, x, xdot }
    }

    fn linearise(&self, q: &[f64]) -> Linearisation {
        let mut lin = Linearisation::new(&self.problem);
        let target = Sample {
            x: &self.x,
            xdot: &self.xdot,
        };
        Evaluator::new(&self.problem).linearise(q, PhaseId(0), target, &mut lin);
        lin
    }

    /// One step of a method: Δq and q̇.
    fn step(&self, id: &str, set: &str) -> (Vec<f64>, Vec<f64>) {
        let contestant = method(id).unwrap().build(&set.parse().unwrap()).unwrap();
        let mut driver = Driver::new(&*contestant.formulation, &self.problem).unwrap();
        let one = [self.x.clone(), self.xdot.clone()].concat();
        let data = [one.clone(), one].concat();
        let input = StepInput {
            q_prev: &self.q,
            v_prev: &[0.0; 18],
            dt_s: DT,
            phase: PhaseId(0),
            targets: Window::new(&data, 18, 18).unwrap(),
            gains: &[],
        };
        let majors = driver.majors();
        driver.step(&input, majors);
        let solution = driver.solution();
        (
            difference(self.problem.robot(), &self.q, &solution.q),
            solution.v.clone(),
        )
    }
}

fn dense(rows: &Rows) -> DMatrix<f64> {
    DMatrix::from_fn(rows.rows(), rows.cols(), |i, j| rows.jacobian[i + j * rows.ld()])
}

/// Eq. (2): the 33 × 33 system through the pseudo-inverse, for errors `soft` and `hard` (of the weighted rows).
fn by_pseudo_inverse(lin: &Linearisation, soft: &[f64], hard: &[f64]) -> DVector<f64> {
    let (js, jh) = (dense(&lin.soft), dense(&lin.hard));
    let (n, m) = (js.ncols(), jh.nrows());
    let mut kkt = DMatrix::zeros(n + m, n + m);
    let h = js.transpose() * &js + DMatrix::identity(n, n) * R;
    kkt.view_mut((0, 0), (n, n)).copy_from(&h);
    kkt.view_mut((0, n), (n, m)).copy_from(&jh.transpose());
    kkt.view_mut((n, 0), (m, n)).copy_from(&jh);
    let mut right = DVector::zeros(n + m);
    right
        .rows_mut(0, n)
        .copy_from(&(js.transpose() * DVector::from_column_slice(&soft[..js.nrows()])));
    right
        .rows_mut(n, m)
        .copy_from(&DVector::from_column_slice(&hard[..m]));
    let solved = kkt.svd(true, true).solve(&right, 1e-10).unwrap();
    solved.rows(0, n).into_owned()
}

fn negative(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| -v).collect()
}

#[test]
fn ik1_solves_equation_2_with_bent_one_straight_and_two_straight_legs() {
    // Two straight, parallel legs: rank 14 of 15. The error there must be consistent: the torso stays.
    for (knee, by) in [(1.2, 0.004), (0.3, 0.002), (1e-3, 1e-4), (0.0, 0.0)] {
        let mut fixture = Fixture::new(Boundary::None, knee, by);
        if knee == 0.0 {
            fixture.x[0] += 0.003;
            fixture.x[2] -= 0.004;
        }
        let lin = fixture.linearise(&fixture.q);
        if knee == 0.0 {
            assert_eq!(dense(&lin.hard).rank(1e-9), 14);
        }
        let expected = by_pseudo_inverse(&lin, &negative(&lin.soft.error), &negative(&lin.hard.error));
        let (dq, v) = fixture.step("ik1", "");
        let worst = dq
            .iter()
            .zip(expected.iter())
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(worst < 1e-10, "knee {knee}: {worst:e}");
        assert!(v.iter().zip(&dq).all(|(v, d)| (v - d / DT).abs() < 1e-9));
        assert!(dq.iter().any(|d| d.abs() > 1e-4), "nothing moved");
    }
}

#[test]
fn ik2_repeats_equation_2_and_takes_its_velocity_from_equation_5() {
    let fixture = Fixture::new(Boundary::None, 1.0, 0.005);
    let mut q = fixture.q.clone();
    for _ in 0..4 {
        let lin = fixture.linearise(&q);
        let d = by_pseudo_inverse(&lin, &negative(&lin.soft.error), &negative(&lin.hard.error));
        q = ik_core::configuration::integrate(fixture.problem.robot(), &q, d.as_slice());
    }
    let lin = fixture.linearise(&q);
    let scaled = |rate: &[f64]| rate.iter().map(|r| r * DT).collect::<Vec<_>>();
    let motion = by_pseudo_inverse(&lin, &scaled(&lin.soft.rate), &scaled(&lin.hard.rate));
    let expected = difference(fixture.problem.robot(), &fixture.q, &q);
    for inner in ["direct", "cg"] {
        let (dq, v) = fixture.step("ik2", &format!("n = 4\ninner = '{inner}'"));
        let position = dq
            .iter()
            .zip(&expected)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(position < 1e-10, "{inner}: {position:e}");
        let velocity = v
            .iter()
            .zip(motion.iter())
            .map(|(a, b)| (a - b / DT).abs())
            .fold(0.0, f64::max);
        assert!(velocity < 1e-8, "{inner}: {velocity:e}");
    }
}

#[test]
fn ik3_solves_equation_7_as_an_interior_point_method_does() {
    for by in [1e-4, 0.02] {
        let fixture = Fixture::new(Boundary::Ellipse { margin: 0.0 }, 0.6, by);
        let lin = fixture.linearise(&fixture.q);
        let (js, jh) = (dense(&lin.soft), dense(&lin.hard));
        let h = js.transpose() * &js + DMatrix::identity(18, 18) * R;
        let g = js.transpose() * DVector::from_column_slice(&lin.soft.error[..3]);
        let b = negative(&lin.hard.error[..15]);
        let mut lo = vec![f64::NEG_INFINITY; 18];
        let mut hi = vec![f64::INFINITY; 18];
        for (j, c) in fixture.problem.robot().coordinates().iter().enumerate() {
            let interval = fixture
                .problem
                .boundary()
                .interval(&c.limits, fixture.q[7 + j], DT);
            (lo[6 + j], hi[6 + j]) = (interval.lo, interval.hi);
        }
        let qp = Qp {
            h: MatRef::new(h.as_slice(), 18, 18),
            g: g.as_slice(),
            a: MatRef::new(jh.as_slice(), 15, 18),
            b: &b,
            lo: &lo,
            hi: &hi,
        };
        let mut reference = QpSolution::new(18, 15);
        if ClarabelQp.solve(&qp, &mut reference) == QpStatus::Solved {
            let (dq, _) = fixture.step("ik3", "");
            let gap = qp.objective(&dq) - qp.objective(&reference.x);
            assert!(gap.abs() < 1e-9, "by {by}: {gap:e}");
        } else {
            assert!(by > 1e-3, "the small motion fits the boundary");
        }
    }
}
