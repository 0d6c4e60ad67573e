//! Repeated steps at a resting target go down the objective to where it has no descent in the null space of the tasks.

use crate::fixture::{DT_S, Fixture, PHASE};
use crate::support::{arm, melson};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::Use;
use ik_core::step::Sample;
use ik_core::task::{Priority, Weights};
use nalgebra::{DMatrix, DVector};

/// Every method that takes objectives, with the parameters it is held to.
const METHODS: [(&str, &str); 8] = [
    ("clik", ""),
    ("davies", ""),
    ("ik1", ""),
    ("ik2", ""),
    ("ik2", "inner = 'cg'"),
    ("ik3", ""),
    ("ik4", ""),
    ("ik5", ""),
];

/// Where a run ends.
struct End {
    q: Vec<f64>,
    /// Length of the gradient in the null space of the tasks, in parts of the whole gradient.
    slope: f64,
    /// Largest error of a task (m, rad).
    error: f64,
    /// Largest rise of the objective in a step, in parts of its value.
    rise: f64,
}

fn descend(fixture: &Fixture, (id, parameters): (&str, &str), gains: &[f64], steps: usize) -> End {
    let mut driver = fixture.driver(id, parameters);
    assert_ne!(driver.honours().objective, Use::Ignored, "{id}");
    let mut q = fixture.start.clone();
    let (mut value, _) = fixture.objective(&q, gains);
    let mut rise = 0.0_f64;
    for _ in 0..steps {
        fixture.step(&mut driver, &q, &fixture.target, gains);
        q.copy_from_slice(&driver.solution().q);
        let (next, _) = fixture.objective(&q, gains);
        rise = rise.max(next / value - 1.0);
        value = next;
    }
    let (_, gradient) = fixture.objective(&q, gains);
    let gradient = DVector::from_vec(gradient);
    let (jacobian, error) = rows(fixture, &q);
    let gram = (&jacobian * jacobian.transpose()).cholesky().unwrap();
    let along = &gradient - jacobian.transpose() * gram.solve(&(&jacobian * &gradient));
    End {
        q,
        slope: along.norm() / gradient.norm(),
        error: error.amax(),
        rise,
    }
}

/// Jacobian and error of all tasks, hard ones first.
fn rows(fixture: &Fixture, q: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let problem = &fixture.problem;
    let mut lin = Linearisation::new(problem);
    let xdot = vec![0.0; problem.nxdot()];
    let target = Sample {
        x: &fixture.target,
        xdot: &xdot,
    };
    Evaluator::new(problem).linearise(q, PHASE, target, &mut lin);
    let (hard, soft) = (lin.hard.rows(), lin.soft.rows());
    let stacked = |hard_part: &dyn Fn(usize) -> f64, soft_part: &dyn Fn(usize) -> f64, i: usize| {
        if i < hard {
            hard_part(i)
        } else {
            soft_part(i - hard)
        }
    };
    let jacobian = DMatrix::from_fn(hard + soft, problem.robot().nv(), |i, v| {
        stacked(&|i| lin.hard.column(v)[i], &|i| lin.soft.column(v)[i], i)
    });
    let error = DVector::from_fn(hard + soft, |i, _| {
        stacked(&|i| lin.hard.error[i], &|i| lin.soft.error[i], i)
    });
    (jacobian, error)
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// All methods, hard tasks: one stationary point.
fn assert_one_point(name: &str, fixture: &Fixture, gains: &[f64], steps: usize) {
    let ends = METHODS.map(|method| (method, descend(fixture, method, gains, steps)));
    let reference = &ends[0].1;
    assert!(
        largest_difference(&reference.q, &fixture.start) > 0.02,
        "{name}: nothing moved"
    );
    for ((id, parameters), end) in &ends {
        let apart = largest_difference(&end.q, &reference.q);
        println!(
            "{name} {id} {parameters}: slope {:.1e}, error {:.1e}, apart {apart:.1e}",
            end.slope, end.error
        );
        // Nothing but the rounding of the value.
        assert!(end.rise < 1e-13, "{name} {id} {parameters}: {:e}", end.rise);
        assert!(end.slope < 1e-9, "{name} {id} {parameters}: {:e}", end.slope);
        assert!(end.error < 1e-13, "{name} {id} {parameters}: {:e}", end.error);
        assert!(apart < 1e-8, "{name} {id} {parameters}: {apart:e}");
    }
}

#[test]
fn all_methods_centre_the_joints_of_melson_at_the_same_posture() {
    for support in ["r_foot", "l_foot"] {
        let fixture = melson(support, |_| {});
        assert_one_point(support, &fixture, &[100.0, 0.0], 4000);
    }
}

#[test]
fn all_methods_relieve_melson_at_the_same_posture() {
    assert_one_point("S3", &melson("l_foot", |_| {}), &[10.0, 40.0], 4000);
}

#[test]
fn all_methods_bring_the_elbow_of_an_arm_to_the_same_place() {
    assert_one_point("arm7", &arm(), &[200.0, 0.0], 4000);
}

#[test]
fn compromised_tasks_come_before_objectives() {
    let soft = |weight: f64| {
        melson("l_foot", move |parts| {
            for (task, priority) in &mut parts.phases[0].tasks {
                if *task >= 2 {
                    *priority = Priority::Compromised(Weights::Uniform(weight));
                }
            }
        })
    };
    let hard = descend(&melson("l_foot", |_| {}), ("clik", ""), &[100.0, 0.0], 4000);
    for mut method in METHODS {
        if method.0 == "davies" {
            // Its compromised circuits are damped from far away by default, and damped ones give way.
            method.1 = "soft_threshold = 1e-6";
        }
        let end = descend(&soft(4.0), method, &[100.0, 0.0], 4000);
        // Second priority where the method has one; regularised methods give way by R Δt γ ∇H / Q.
        let (allowed, apart) = match method.0 {
            "clik" | "davies" => (1e-13, 1e-8),
            "ik4" | "ik5" => (1e-6, 1e-5),
            "ik2" => (1e-4, 1e-3),
            _ => (1e-2, 1e-1),
        };
        let found = largest_difference(&end.q, &hard.q);
        println!(
            "{method:?}: slope {:.1e}, error {:.1e}, apart {found:.1e}",
            end.slope, end.error
        );
        assert!(
            end.error < allowed && found < apart,
            "{method:?}: {:e} {found:e}",
            end.error
        );
    }
}

#[test]
fn claimed_multipliers_count_the_pull_of_objectives() {
    let fixture = melson("l_foot", |parts| {
        parts.phases[0].tasks[4].1 = Priority::Compromised(Weights::Uniform(4.0));
    });
    for id in ["ik4", "ik5"] {
        let mut driver = fixture.driver(id, "");
        fixture.step(&mut driver, &fixture.start, &fixture.target, &[1.0, 1.0]);
        let solution = driver.solution();
        assert!(solution.claim.has, "{id}");
        let (jacobian, error) = rows(&fixture, &solution.q);
        let hard = solution.claim.hard.len();
        let (of_hard, of_soft) = (jacobian.rows(0, hard), jacobian.rows(hard, error.len() - hard));
        let balance = of_soft.tr_mul(&error.rows(hard, error.len() - hard))
            + DVector::from_column_slice(&solution.claim.own)
            - of_hard.tr_mul(&DVector::from_column_slice(&solution.claim.hard));
        let own = DVector::from_column_slice(&solution.claim.own).amax();
        assert!(
            own > 1e-9 && balance.amax() < 1e-6 * own,
            "{id}: {:e} {own:e}",
            balance.amax()
        );
    }
}

#[test]
fn without_gains_objectives_change_nothing() {
    let with = melson("l_foot", |_| {});
    let without = melson("l_foot", |parts| parts.objectives.clear());
    let ahead: Vec<f64> = with.target.iter().map(|x| x + 1e-3 * DT_S).collect();
    for (id, parameters) in METHODS {
        let (mut a, mut b) = (with.driver(id, parameters), without.driver(id, parameters));
        let first = with.step(&mut a, &with.start, &ahead, &[0.0, 0.0]);
        let second = without.step(&mut b, &with.start, &ahead, &[]);
        assert_eq!(first, second, "{id}");
        let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&a.solution().q), bits(&b.solution().q), "{id} {parameters}");
        assert_eq!(bits(&a.solution().v), bits(&b.solution().v), "{id} {parameters}");
    }
}
