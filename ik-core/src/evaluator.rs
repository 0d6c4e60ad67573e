//! The only door from a method to kinematics, with the meter that is budget and counter in one.

use crate::kinematics::second_order::SecondOrder;
use crate::kinematics::{Page, forward};
use crate::objective::{At, Scratch};
use crate::problem::{PhaseId, Problem};
use crate::robot::Robot;
use crate::rows::Rows;
use crate::step::Sample;
use std::sync::Arc;

/// What a step cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Outer iterations (linearisations solved).
    pub majors: u32,
    /// Inner iterations (working-set changes of a QP, iterations of a linear solver).
    pub minors: u32,
    /// Passes over the kinematic tree.
    pub passes: u32,
}

/// Budget and counter of one step: a method can only start a major that is counted and allowed.
#[derive(Clone, Debug, Default)]
pub struct Meter {
    counts: Counts,
    budget: u32,
}

impl Meter {
    /// Starts a major; false if the budget is spent, and then nothing is counted.
    pub fn next_major(&mut self) -> bool {
        let allowed = self.counts.majors < self.budget;
        self.counts.majors += u32::from(allowed);
        allowed
    }

    /// Counts `n` minors.
    pub fn minors(&mut self, n: u32) {
        self.counts.minors += n;
    }

    /// Majors that may still be started.
    pub fn majors_left(&self) -> u32 {
        self.budget - self.counts.majors
    }

    /// Counts so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    pub(crate) fn arm(&mut self, budget: u32) {
        *self = Self {
            counts: Counts::default(),
            budget,
        };
    }
}

/// Evaluates kinematics and task rows of one problem.
#[derive(Clone, Debug)]
pub struct Evaluator {
    problem: Arc<Problem>,
    objectives: Scratch,
    /// Budget and counts of the current step.
    pub meter: Meter,
}

/// A configuration's page with its hard and soft rows: scratch owned by a stepper, as many as it needs points.
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// One tree pass.
    pub page: Page,
    /// Rows that must hold.
    pub hard: Rows,
    /// Rows that may be compromised, multiplied by √Q.
    pub soft: Rows,
    second: SecondOrder,
    phase: PhaseId,
}

impl Linearisation {
    /// Room for the largest phase of `problem`.
    pub fn new(problem: &Problem) -> Self {
        let robot: &Robot = problem.robot();
        Self {
            page: Page::new(robot),
            hard: Rows::new(problem.largest_hard_rows(), robot.nv()),
            soft: Rows::new(problem.largest_soft_rows(), robot.nv()),
            second: SecondOrder::new(robot),
            phase: PhaseId(0),
        }
    }
}

impl Evaluator {
    /// An evaluator for `problem`.
    pub fn new(problem: &Arc<Problem>) -> Self {
        Self {
            problem: Arc::clone(problem),
            objectives: Scratch::new(problem.robot()),
            meter: Meter::default(),
        }
    }

    /// One tree pass at `q` (length nq).
    pub fn pass(&mut self, q: &[f64], page: &mut Page) {
        self.meter.counts.passes += 1;
        forward(self.problem.robot(), q, page);
    }

    /// One tree pass at `q` and the rows of `phase` against `target`.
    pub fn linearise(&mut self, q: &[f64], phase: PhaseId, target: Sample<'_>, out: &mut Linearisation) {
        self.residual(q, phase, target, out);
        self.hard_jacobian(out, target);
    }

    /// [`Evaluator::linearise`] without the Jacobian of the hard rows, for points that may be discarded;
    /// [`Evaluator::hard_jacobian`] completes it.
    pub fn residual(&mut self, q: &[f64], phase: PhaseId, target: Sample<'_>, out: &mut Linearisation) {
        self.pass(q, &mut out.page);
        let (layout, robot) = (self.problem.layout(phase), self.problem.robot());
        let page = &out.page;
        layout.hard.fill_residual(robot, q, page, target, &mut out.hard);
        layout.soft.fill_residual(robot, q, page, target, &mut out.soft);
        layout.soft.fill_jacobian(robot, page, target.x, &mut out.soft);
        out.phase = phase;
    }

    /// Writes the Jacobian of the hard rows at the configuration of `lin`.
    pub fn hard_jacobian(&self, lin: &mut Linearisation, target: Sample<'_>) {
        let rows = &self.problem.layout(lin.phase).hard;
        rows.fill_jacobian(self.problem.robot(), &lin.page, target.x, &mut lin.hard);
    }

    /// Fills `second` of both row stacks as [`Evaluator::soft_velocity_derivative`] does.
    pub fn velocity_derivative(&self, lin: &mut Linearisation, target: Sample<'_>, dq: &[f64]) {
        self.soft_velocity_derivative(lin, target, dq);
        self.hard_velocity_derivative(lin, target, dq);
    }

    /// Fills `second` of the soft rows with `∂[J(q) (q ⊖ q⁻)]/∂v` at the linearised configuration, `dq = q ⊖ q⁻`: the
    /// exact derivative of the velocity rows of Faraji & Ijspeert (2017), eqs. (8) and (9). For orientation rows as
    /// logarithms the target rate's own (first-order in the error) dependence on q is left out.
    pub fn soft_velocity_derivative(&self, lin: &mut Linearisation, target: Sample<'_>, dq: &[f64]) {
        self.soft_second(lin, target, dq);
        lin.soft.add_difference_derivative(self.problem.robot(), dq);
    }

    /// The same for the hard rows.
    pub fn hard_velocity_derivative(&self, lin: &mut Linearisation, target: Sample<'_>, dq: &[f64]) {
        self.hard_second(lin, target, dq);
        lin.hard.add_difference_derivative(self.problem.robot(), dq);
    }

    /// Fills `second` of both row stacks with the product of each row's Hessian (second derivative of
    /// `error(q ⊕ d)` at d = 0, symmetric) with `u`: entry (i, v) is `Σ_w ∂²error_i/∂v∂w u_w`.
    pub fn hessian_product(&self, lin: &mut Linearisation, target: Sample<'_>, u: &[f64]) {
        self.soft_second(lin, target, u);
        lin.soft.symmetrise_root(self.problem.robot(), u);
        self.hard_second(lin, target, u);
        lin.hard.symmetrise_root(self.problem.robot(), u);
    }

    fn soft_second(&self, lin: &mut Linearisation, target: Sample<'_>, u: &[f64]) {
        let rows = &self.problem.layout(lin.phase).soft;
        let (page, second) = (&lin.page, &mut lin.second);
        rows.fill_second(self.problem.robot(), page, second, target.x, u, &mut lin.soft);
    }

    fn hard_second(&self, lin: &mut Linearisation, target: Sample<'_>, u: &[f64]) {
        let rows = &self.problem.layout(lin.phase).hard;
        let (page, second) = (&lin.page, &mut lin.second);
        rows.fill_second(self.problem.robot(), page, second, target.x, u, &mut lin.hard);
    }

    /// Adds the gradient of `Σ γ H` (Melson, eq. (14)) to `gradient` (length nv; nothing to a root) and returns the sum: the
    /// problem's objectives, weighted by the gains of the step, at `q` with its `page` and with the support of `phase`.
    ///
    /// No tree pass. An objective whose gain is zero costs nothing.
    pub fn add_objectives(
        &mut self,
        q: &[f64],
        page: &Page,
        phase: PhaseId,
        gains: &[f64],
        gradient: &mut [f64],
    ) -> f64 {
        let at = At {
            robot: self.problem.robot(),
            q,
            page,
            support: self.problem.phases()[phase.0].support,
        };
        let mut sum = 0.0;
        for (objective, &gain) in self.problem.objectives().iter().zip(gains) {
            if gain != 0.0 {
                sum += gain * objective.add_gradient(at, gain, gradient, &mut self.objectives);
            }
        }
        sum
    }

    /// Lends at most `majors` of the budget to `inner`: a wrapper cannot spend more on an inner method than it decided.
    pub fn lend<T>(&mut self, majors: u32, inner: impl FnOnce(&mut Self) -> T) -> T {
        let budget = self.meter.budget;
        self.meter.budget = budget.min(self.meter.counts.majors.saturating_add(majors));
        let result = inner(self);
        self.meter.budget = budget;
        result
    }
}
