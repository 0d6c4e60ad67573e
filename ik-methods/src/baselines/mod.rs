//! Baselines: the position problem as a user of a general optimiser would write it, hard rows and limits as penalties.
//!
//! ```text
//! minimise over d ∈ Rⁿ   ½ ‖e_s(q)‖² + ½ ρ ‖e_h(q)‖² + ½ ρ ‖d − clamp(d, lo, hi)‖²,    q = q⁻ ⊕ d
//! ```
//!
//! They prove that the seam takes a foreign optimiser, and they are what a specialised method has to beat. The optimiser
//! (argmin) allocates and owns its loop; its iterations are counted as majors after it returns, and it is told the budget
//! before it starts.

mod penalty_cg;
mod penalty_lbfgs;

pub use penalty_cg::{PenaltyCg, PenaltyCgParameters};
pub use penalty_lbfgs::{PenaltyLbfgs, PenaltyLbfgsParameters};

use crate::registry::{Allowed, Field};
use crate::step_qp::{finish_unbounded, stay};
use argmin::core::{CostFunction, Error, Gradient};
use ik_core::configuration::integrate_into;
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::{Honours, Prepared, Solution, Stepper, Termination, Trust, Use};
use ik_core::problem::Problem;
use ik_core::spatial::so3;
use ik_core::step::ControlStep;
use nalgebra::Vector3;
use std::cell::RefCell;
use std::sync::Arc;

const PENALTY_FIELD: Field = Field {
    key: "penalty",
    unit: "-",
    meaning: "weight of hard rows and of limits against the compromised rows",
    allowed: Allowed::Number {
        least: 1e-6,
        largest: 1e12,
    },
};

const TOLERANCE_FIELD: Field = Field {
    key: "gradient_tolerance",
    unit: "m, rad",
    meaning: "a gradient norm below this counts as converged",
    allowed: Allowed::Number {
        least: 1e-15,
        largest: 1.0,
    },
};

/// The penalised problem of one step, as argmin wants it: cost and gradient through `&self`.
struct Penalised<'a> {
    problem: &'a Problem,
    step: &'a ControlStep<'a>,
    penalty: f64,
    state: RefCell<State<'a>>,
}

struct State<'a> {
    eval: &'a mut Evaluator,
    scratch: &'a mut Scratch,
    best_cost: f64,
}

/// What a stepper keeps between steps.
#[derive(Debug)]
struct Scratch {
    lin: Linearisation,
    q: Vec<f64>,
    best: Vec<f64>,
}

impl Penalised<'_> {
    /// Cost and gradient at `d`; remembers the best point seen, which survives a line search that fails.
    fn evaluate(&self, d: &[f64]) -> (f64, Vec<f64>) {
        let state = &mut *self.state.borrow_mut();
        let Scratch { lin, q, best } = &mut *state.scratch;
        integrate_into(self.problem.robot(), self.step.q_prev, d, q);
        state
            .eval
            .linearise(q, self.step.phase, self.step.targets.now(), lin);
        let mut gradient = vec![0.0; d.len()];
        lin.soft.add_transposed(&lin.soft.error, 1.0, &mut gradient);
        lin.hard
            .add_transposed(&lin.hard.error, self.penalty, &mut gradient);
        to_chart(self.problem, d, &mut gradient);
        let squares = |e: &[f64]| e.iter().map(|e| e * e).sum::<f64>();
        let mut cost = 0.5 * squares(&lin.soft.error) + 0.5 * self.penalty * squares(&lin.hard.error);
        let bounds = self.step.bounds.lo.iter().zip(self.step.bounds.hi);
        for ((d, g), (lo, hi)) in d.iter().zip(&mut gradient).zip(bounds) {
            let excess = d - d.max(*lo).min(*hi);
            cost += 0.5 * self.penalty * excess * excess;
            *g += self.penalty * excess;
        }
        if cost < state.best_cost {
            state.best_cost = cost;
            best.copy_from_slice(d);
        }
        (cost, gradient)
    }
}

/// Gradients come in the tangent space at q; argmin works in the chart d around q⁻: `∂/∂d = J_l(d)ᵀ ∂` for the root's
/// rotation.
fn to_chart(problem: &Problem, d: &[f64], gradient: &mut [f64]) {
    if problem.robot().root() == ik_core::robot::Root::Floating {
        let inverse = so3::left_jacobian_inverse(&Vector3::new(d[3], d[4], d[5]));
        if let Some(jacobian) = inverse.try_inverse() {
            let turned = jacobian.transpose() * Vector3::new(gradient[3], gradient[4], gradient[5]);
            gradient[3..6].copy_from_slice(turned.as_slice());
        }
    }
}

impl CostFunction for Penalised<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, d: &Vec<f64>) -> Result<f64, Error> {
        Ok(self.evaluate(d).0)
    }
}

impl Gradient for Penalised<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;
    fn gradient(&self, d: &Vec<f64>) -> Result<Vec<f64>, Error> {
        Ok(self.evaluate(d).1)
    }
}

/// Runs an argmin solver on the penalised problem from `d = 0` for at most so many iterations; returns how many it took.
trait Optimiser: Send + std::fmt::Debug + 'static {
    fn run(&self, problem: Penalised<'_>, start: Vec<f64>, most: u32) -> u32;
}

/// The stepper of both baselines.
#[derive(Debug)]
struct PenaltyStepper<O> {
    problem: Arc<Problem>,
    optimiser: O,
    penalty: f64,
    gradient_tolerance: f64,
    scratch: Scratch,
}

impl<O: Optimiser> Stepper for PenaltyStepper<O> {
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination {
        stay(step, out);
        let most = eval.meter.majors_left();
        if most == 0 {
            return Termination::Budget;
        }
        if !self.error_is_finite(step.q_prev, step, eval) {
            // A line search of the optimiser would never return.
            return Termination::Numerical("the cost is not finite");
        }
        self.scratch.best.fill(0.0);
        let start = vec![0.0; self.problem.robot().nv()];
        let taken = {
            let state = State {
                eval,
                scratch: &mut self.scratch,
                best_cost: f64::INFINITY,
            };
            let penalised = Penalised {
                problem: &self.problem,
                step,
                penalty: self.penalty,
                state: RefCell::new(state),
            };
            self.optimiser.run(penalised, start, most)
        };
        for _ in 0..taken.clamp(1, most) {
            eval.meter.next_major();
        }
        let best = self.scratch.best.clone();
        finish_unbounded(&self.problem, step, &best, out);
        if !self.error_is_finite(&out.q, step, eval) {
            stay(step, out);
            return Termination::Numerical("the cost is not finite");
        }
        let converged = self.gradient_norm(step, &best) < self.gradient_tolerance;
        if converged {
            Termination::Converged
        } else {
            Termination::Budget
        }
    }

    fn reset(&mut self) {}
}

impl<O> PenaltyStepper<O> {
    /// Linearises at `q`; false if an error is not a number there.
    fn error_is_finite(&mut self, q: &[f64], step: &ControlStep<'_>, eval: &mut Evaluator) -> bool {
        let lin = &mut self.scratch.lin;
        eval.linearise(q, step.phase, step.targets.now(), lin);
        lin.soft
            .error
            .iter()
            .chain(&lin.hard.error)
            .all(|e| e.is_finite())
    }

    /// Norm of the penalised gradient at the linearised point.
    fn gradient_norm(&self, step: &ControlStep<'_>, d: &[f64]) -> f64 {
        let lin = &self.scratch.lin;
        let mut gradient = vec![0.0; d.len()];
        lin.soft.add_transposed(&lin.soft.error, 1.0, &mut gradient);
        lin.hard
            .add_transposed(&lin.hard.error, self.penalty, &mut gradient);
        for (i, g) in gradient.iter_mut().enumerate() {
            *g += self.penalty * (d[i] - d[i].max(step.bounds.lo[i]).min(step.bounds.hi[i]));
        }
        gradient.iter().map(|g| g * g).sum::<f64>().sqrt()
    }
}

fn prepare<O: Optimiser>(
    problem: &Arc<Problem>,
    optimiser: O,
    n: u32,
    penalty: f64,
    gradient_tolerance: f64,
) -> Prepared {
    let robot = problem.robot();
    let stepper = PenaltyStepper {
        problem: Arc::clone(problem),
        optimiser,
        penalty,
        gradient_tolerance,
        scratch: Scratch {
            lin: Linearisation::new(problem),
            q: vec![0.0; robot.nq()],
            best: vec![0.0; robot.nv()],
        },
    };
    let honours = Honours {
        boundary: false,
        hard_rows: false,
        objective: Use::Ignored,
        allocation_free: false,
        counts: Trust::Declared,
    };
    Prepared {
        stepper: Box::new(stepper),
        majors: n,
        honours,
        notes: vec!["hard rows and limits are penalties: both are violated a little".into()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ik_core::boundary::Boundary;
    use ik_core::problem::{Kind, Phase, PhaseId, ProblemParts, Supplies};
    use ik_core::robot::embedded;
    use ik_core::step::{Bounds, Window};
    use ik_core::task::{OrientationCoordinates, Priority, Task, Track, Weights};

    #[test]
    fn the_gradient_is_that_of_the_cost() {
        let robot = Arc::new(embedded("coman-legs").unwrap());
        let tasks = [
            (
                "com",
                Track::CentreOfMass,
                Priority::Compromised(Weights::Uniform(2.0)),
            ),
            (
                "left",
                Track::Pose(robot.frame("l_sole").unwrap()),
                Priority::Hard,
            ),
        ];
        let problem = Arc::new(
            Problem::new(ProblemParts {
                robot: Arc::clone(&robot),
                tasks: tasks
                    .iter()
                    .map(|(n, t, _)| Task {
                        name: (*n).into(),
                        track: *t,
                    })
                    .collect(),
                phases: vec![Phase {
                    name: "all".into(),
                    support: None,
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
            })
            .unwrap(),
        );
        // Turned, bent, and with two joints outside narrow intervals.
        let d: Vec<f64> = (0..18).map(|i| 0.4 * f64::from(i * i % 7) - 0.93).collect();
        let (lo, hi) = ([-0.5; 18], [1.0; 18]);
        let one: Vec<f64> = (0..10 + 9)
            .map(|i| if i == 9 { 1.0 } else { 0.05 * f64::from(i % 4) })
            .collect();
        let data = [one.clone(), one].concat();
        let (q_prev, zeros) = (robot.neutral(), [0.0; 18]);
        let step = ControlStep {
            q_prev: &q_prev,
            v_prev: &zeros,
            dt_s: 0.01,
            phase: PhaseId(0),
            targets: Window::new(&data, problem.nx(), problem.nxdot()).unwrap(),
            bounds: Bounds {
                lo: &lo,
                hi: &hi,
                outside: 0,
            },
            gains: &[],
        };
        let mut eval = Evaluator::new(&problem);
        let mut scratch = Scratch {
            lin: Linearisation::new(&problem),
            q: vec![0.0; robot.nq()],
            best: vec![0.0; 18],
        };
        let state = State {
            eval: &mut eval,
            scratch: &mut scratch,
            best_cost: f64::INFINITY,
        };
        let penalised = Penalised {
            problem: &problem,
            step: &step,
            penalty: 3.0,
            state: RefCell::new(state),
        };
        let (_, gradient) = penalised.evaluate(&d);
        for v in 0..18 {
            let at = |h: f64| {
                let mut moved = d.clone();
                moved[v] += h;
                penalised.evaluate(&moved).0
            };
            let numeric = (at(1e-6) - at(-1e-6)) / 2e-6;
            assert!(
                (gradient[v] - numeric).abs() < 1e-7 * (1.0 + numeric.abs()),
                "{v}: {} {numeric}",
                gradient[v]
            );
        }
    }
}
