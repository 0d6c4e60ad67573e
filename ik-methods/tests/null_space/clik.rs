//! Steps of closed-loop inverse kinematics against eq. (9) written out: root eliminated by matrices, J⁺ by singular values,
//! P formed.

use crate::fixture::{DT_S, Fixture, PHASE, targets_at};
use crate::support::{arm, melson};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::{Declined, Termination};
use ik_core::problem::ProblemParts;
use ik_core::step::Sample;
use ik_core::task::{Priority, Weights};
use ik_methods::registry::method;
use nalgebra::{DMatrix, DVector};

/// SplitMix64 in ±1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// J and error of the joints alone; `base` is the first row of the task that is held, eliminated by its 6 × 6 block.
fn held(fixture: &Fixture, q: &[f64], x: &[f64], base: Option<usize>) -> (DMatrix<f64>, DVector<f64>) {
    let problem = &fixture.problem;
    let nv = problem.robot().nv();
    let mut lin = Linearisation::new(problem);
    let xdot = vec![0.0; problem.nxdot()];
    Evaluator::new(problem).linearise(q, PHASE, Sample { x, xdot: &xdot }, &mut lin);
    let full = DMatrix::from_fn(lin.hard.rows(), nv, |i, v| lin.hard.column(v)[i]);
    let error = DVector::from_fn(lin.hard.rows(), |i, _| -lin.hard.error[i]);
    let Some(first) = base else {
        return (full, error);
    };
    let others: Vec<usize> = (0..full.nrows())
        .filter(|i| !(first..first + 6).contains(i))
        .collect();
    let block = full.rows(first, 6);
    let inverse = block.columns(0, 6).into_owned().try_inverse().unwrap();
    let rest = full.select_rows(&others);
    let carried = rest.columns(0, 6) * inverse;
    let jacobian = rest.columns(6, nv - 6) - carried * block.columns(6, nv - 6);
    (jacobian, error.select_rows(&others))
}

/// Joint increments of eq. (9): `J* e + (1 − J* J) Δt q̇₀`, J* damped by `damping` longest rows.
fn equation_9(
    fixture: &Fixture,
    (q, x): (&[f64], &[f64]),
    gains: &[f64],
    base: Option<usize>,
    damping: f64,
) -> DVector<f64> {
    let (jacobian, error) = held(fixture, q, x, base);
    let lambda = damping * jacobian.row_iter().map(|r| r.norm()).fold(0.0, f64::max);
    let (_, gradient) = fixture.objective(q, gains);
    let n = jacobian.ncols();
    let p = DVector::from_fn(n, |j, _| -DT_S * gradient[gradient.len() - n + j]);
    let svd = jacobian.clone().svd(true, true);
    let (u, s, vt) = (svd.u.unwrap(), svd.singular_values, svd.v_t.unwrap());
    let filter = DMatrix::from_diagonal(&s.map(|s| s / (s * s + lambda * lambda)));
    let inverse = vt.transpose() * filter * u.transpose();
    let projector = DMatrix::identity(n, n) - &inverse * &jacobian;
    inverse * error + projector * p
}

/// A posture near the start, and the targets of one close to it.
fn disturbed(fixture: &Fixture, random: &mut Random) -> (Vec<f64>, Vec<f64>) {
    let robot = fixture.problem.robot();
    let mut near = |q: &[f64], scale: f64| {
        let dq: Vec<f64> = (0..robot.nv()).map(|_| scale * random.next()).collect();
        ik_core::configuration::integrate(robot, q, &dq)
    };
    let q = near(&fixture.start, 0.15);
    let x = targets_at(&fixture.problem, &near(&q, 2e-3));
    (q, x)
}

#[test]
fn a_step_is_equation_9() {
    let mut random = Random(9);
    // First number of the base's target, which is also its first row: roll, pitch and yaw.
    let cases = [
        (melson("r_foot", |_| {}), Some(0)),
        (melson("l_foot", |_| {}), Some(6)),
        (arm(), None),
    ];
    for (fixture, base) in cases {
        for (parameters, damping) in [("", 0.0), ("inverse = 'damped'\ndamping = 0.05", 0.05)] {
            let mut driver = fixture.driver("clik", parameters);
            for gains in [[0.0, 0.0], [1.0, 0.0], [0.35, 1.6], [30.0, 5.0]] {
                let (q, mut x) = disturbed(&fixture, &mut random);
                if let Some(first) = base {
                    let here = targets_at(&fixture.problem, &q);
                    x[first..first + 6].copy_from_slice(&here[first..first + 6]);
                }
                let expected = equation_9(&fixture, (&q, &x), &gains, base, damping);
                let (termination, counts) = fixture.step(&mut driver, &q, &x, &gains);
                assert_eq!(
                    termination.word(),
                    if damping > 0.0 { "damped" } else { "stepped" }
                );
                assert_eq!(counts.passes, if base.is_some() { 2 } else { 1 });
                let joints = q.len() - expected.len();
                for (j, expected) in expected.iter().enumerate() {
                    let moved = driver.solution().q[joints + j] - q[joints + j];
                    assert!(
                        (moved - expected).abs() < 1e-11,
                        "{base:?} {gains:?} {j}: {moved} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn the_base_stands_where_it_is_planned_wherever_it_was() {
    let fixture = melson("l_foot", |_| {});
    let mut random = Random(4);
    let mut driver = fixture.driver("clik", "");
    for _ in 0..20 {
        // The other foot stood before: the new base is off by what the step before left, and moves besides.
        let (q, x) = disturbed(&fixture, &mut random);
        let before = error(&fixture, &q, &x);
        fixture.step(&mut driver, &q, &x, &[0.0, 0.0]);
        let after = error(&fixture, &driver.solution().q, &x);
        assert!(after.rows(6, 6).amax() < 1e-14, "{after}");
        assert!(after.amax() < 10.0 * before.norm_squared(), "{before} {after}");
    }
}

fn error(fixture: &Fixture, q: &[f64], x: &[f64]) -> DVector<f64> {
    let mut lin = Linearisation::new(&fixture.problem);
    let xdot = vec![0.0; fixture.problem.nxdot()];
    Evaluator::new(&fixture.problem).linearise(q, PHASE, Sample { x, xdot: &xdot }, &mut lin);
    DVector::from_column_slice(&lin.hard.error[..lin.hard.rows()])
}

#[test]
fn the_root_of_a_robot_at_rest_does_not_drift() {
    let fixture = melson("r_foot", |_| {});
    let mut driver = fixture.driver("clik", "");
    let mut q = fixture.start.clone();
    for _ in 0..10_000 {
        fixture.step(&mut driver, &q, &fixture.target, &[0.0, 0.0]);
        q.copy_from_slice(&driver.solution().q);
    }
    let moved = q
        .iter()
        .zip(&fixture.start)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(moved < 1e-12, "{moved:e}");
}

#[test]
fn a_support_that_no_hard_pose_holds_is_declined_by_name() {
    let fixture = melson("l_foot", |parts: &mut ProblemParts| {
        parts.phases[0].tasks[1].1 = Priority::Compromised(Weights::Uniform(1.0));
    });
    let clik = method("clik").unwrap().build(&"".parse().unwrap()).unwrap();
    let declined = clik.formulation.prepare(&fixture.problem).unwrap_err();
    assert!(
        matches!(&declined, Declined::Shape(why) if why.contains("`l_foot`")),
        "{declined}"
    );
}

#[test]
fn a_stretched_leg_is_damped_and_says_so() {
    let fixture = melson("l_foot", |_| {});
    let robot = fixture.problem.robot();
    let mut q = robot.neutral();
    q[2] = 0.265;
    // Both knees straight: the height of the other foot depends on the height of the hip.
    let x = targets_at(&fixture.problem, &q);
    for parameters in ["", "inverse = 'damped'", "inverse = 'truncated'"] {
        let mut driver = fixture.driver("clik", parameters);
        let (termination, _) = fixture.step(&mut driver, &q, &x, &[1.0, 1.0]);
        assert!(
            matches!(termination, Termination::Damped { .. }),
            "{parameters}: {termination:?}"
        );
        let moved = driver
            .solution()
            .q
            .iter()
            .zip(&q)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(moved < 0.1, "{parameters}: {moved}");
    }
}

#[test]
fn rows_that_contradict_each_other_are_reported() {
    // The arm's hand at two places at once.
    let fixture = arm();
    let mut parts = ik_core::problem::ProblemParts {
        robot: fixture.problem.robot_arc().clone(),
        tasks: fixture.problem.tasks().to_vec(),
        phases: fixture.problem.phases().to_vec(),
        boundary: *fixture.problem.boundary(),
        objectives: vec![],
        kind: fixture.problem.kind(),
        supplies: fixture.problem.supplies(),
        orientation: fixture.problem.orientation(),
    };
    let mut second = parts.tasks[0].clone();
    second.name = "again".into();
    parts.tasks.push(second);
    parts.phases[0].tasks.push((1, Priority::Hard));
    let fixture = Fixture::new(parts, fixture.start);
    let mut driver = fixture.driver("clik", "");
    let (consistent, _) = fixture.step(&mut driver, &fixture.start, &fixture.target, &[]);
    assert_eq!(consistent, Termination::Stepped);
    let mut x = fixture.target.clone();
    x[0] += 0.02;
    let (contradicting, _) = fixture.step(&mut driver, &fixture.start, &x, &[]);
    let Termination::HardRowsRelaxed { residual } = contradicting else {
        panic!("{contradicting:?}");
    };
    // Half the way each.
    assert!((residual - 0.02 / 2.0_f64.sqrt()).abs() < 1e-9, "{residual}");
}

#[test]
fn correction_is_the_part_of_the_error_that_is_removed() {
    let fixture = arm();
    let mut random = Random(2);
    let (q, x) = disturbed(&fixture, &mut random);
    let full = equation_9(&fixture, (&q, &x), &[0.0, 0.0], None, 0.0);
    for correction in [0.0, 0.25, 1.0] {
        let mut driver = fixture.driver("clik", &format!("correction = {correction:?}"));
        fixture.step(&mut driver, &q, &x, &[0.0, 0.0]);
        for (j, full) in full.iter().enumerate() {
            let moved = driver.solution().q[j] - q[j];
            assert!((moved - correction * full).abs() < 1e-12, "{correction} {j}");
        }
    }
}
