//! # Closed-loop inverse kinematics with objectives in the null space
//!
//! The classical redundancy resolution: the pseudo-inverse of the task Jacobian closes the loop on the next target, and
//! whatever the tasks leave free descends the secondary objectives. The support foot is the base, so one Jacobian of the
//! joints holds for the whole robot. Right for redundant robots away from joint limits and singularities.
//!
//! ## Problem solved
//! ```text
//! minimise  ‖q̇ − q̇₀‖²    subject to  J(q_k) q̇ = (x_{k+1} − f(q_k))/Δt,     q̇₀ = −Σ γ ∇H
//! ```
//! ## Step
//! (S1) Place the base at its planned pose and write f and J for the joints with the base held: `J_j − J_root $_j`.
//! (S2) `q̇ = J⁺ (x_{k+1} − f)/Δt + (q̇₀ − J⁺ (J q̇₀))`; the projector `1 − J⁺J` is never formed, since
//! `Δq = p + J⁺ (x_{k+1} − f − J p)` with p = Δt q̇₀. (S3) q = q⁻ + Δt q̇, the root where the base at its next planned pose
//! puts it.
//!
//! Feedforward and correction are one. With `correction` κ ≠ 1 the right-hand side is `κ (x_{k+1} − f) + (1 − κ) ẋ Δt`, which
//! is `ẋ + K (x_k − f)` with K Δt = κ.
//!
//! ## What it needs
//! Targets x (and ẋ if κ ≠ 1). The base is the support of the phase, whose pose must be a hard task; without a support it is
//! the first frame with a hard pose. Without one either, and for a fixed root, J and its norm are over all velocity
//! coordinates.
//!
//! ## Known limits
//! No boundary. The pseudo-inverse is not cyclic: without objectives, joints drift over repeated motions. Rates grow without
//! bound towards a singularity. With `inverse = "exact"` hard and compromised rows with a condition number beyond 1e5 are
//! damped there and only there, and the step says so; `"damped"` damps everywhere, `"truncated"` leaves out rows that depend
//! on others.
//!
//! ## Source
//! Melson: (S1) its section on the support foot and eq. (26), (S2) = eq. (9), (S3) = eq. (10); objectives eqs. (11)–(14).
//! Chain of ideas: Liégeois (1977), Automatic supervisory control of the configuration and behavior of multibody mechanisms.
//!
//! ## Deviations
//! Deviation: compromised tasks, which the source does not know, are a second priority: least squares in the motions that the
//! hard rows leave, before the objectives. Weights act among them.
//! Deviation: J⁺ comes from a rank-revealing orthogonal factorisation, not from singular values; truncation therefore acts on
//! its pivots.

use crate::generic_posture::generic_postures;
use crate::least_norm::{DEPENDENT, DROP, DROP_AT_GENERIC_POSTURE, Ranks, Stage, fade};
use crate::registry::{Allowed, Field, Method, MethodInfo, Parameters};
use crate::secondary::Secondary;
use crate::step_qp::stay;
use crate::support_base::Base;
use ik_core::configuration::{difference_into, integrate_into};
use ik_core::evaluator::{Evaluator, Linearisation};
use ik_core::formulation::{
    Declined, Formulation, Honours, Prepared, Solution, Stepper, Termination, Trust, Use,
};
use ik_core::problem::{PhaseId, Problem};
use ik_core::rows::Rows;
use ik_core::step::{ControlStep, Sample};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How J is inverted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Inverse {
    /// Moore-Penrose; damped only at a loss of rank.
    #[default]
    Exact,
    /// `Jᵀ (J Jᵀ + λ²)⁻¹` everywhere.
    Damped,
    /// Moore-Penrose of the rows that do not depend on others.
    Truncated,
}

/// Parameters of [`NullSpaceClik`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NullSpaceClikParameters {
    /// K Δt.
    pub correction: f64,
    /// How J is inverted.
    pub inverse: Inverse,
    /// λ in parts of the longest row.
    pub damping: f64,
    /// Pivot, in parts of the longest row, below which a row depends on the others.
    pub truncation: f64,
}

impl Default for NullSpaceClikParameters {
    fn default() -> Self {
        Self {
            correction: 1.0,
            inverse: Inverse::Exact,
            damping: 1e-2,
            truncation: 1e-3,
        }
    }
}

impl Parameters for NullSpaceClikParameters {
    const HELP: &'static [Field] = &[
        Field {
            key: "correction",
            unit: "-",
            meaning: "K dt: part of the task error removed per step; 0 integrates the target rates, stable below 2",
            allowed: Allowed::Number {
                least: 0.0,
                largest: 1.999,
            },
        },
        Field {
            key: "inverse",
            unit: "-",
            meaning: "pseudo-inverse: exact and damped only at a loss of rank, damped everywhere, or truncated",
            allowed: Allowed::Words(&["exact", "damped", "truncated"]),
        },
        Field {
            key: "damping",
            unit: "-",
            meaning: "lambda in parts of the longest row, everywhere (damped) or at a loss of rank (exact)",
            allowed: Allowed::Number {
                least: 1e-6,
                largest: 1e3,
            },
        },
        Field {
            key: "truncation",
            unit: "-",
            meaning: "pivot in parts of the longest row below which a row depends on the others (truncated)",
            allowed: Allowed::Number {
                least: 1e-12,
                largest: 1.0,
            },
        },
    ];
}

/// Closed-loop inverse kinematics with objectives in the null space.
#[derive(Clone, Debug)]
pub struct NullSpaceClik {
    parameters: NullSpaceClikParameters,
}

impl Method for NullSpaceClik {
    type Parameters = NullSpaceClikParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "clik",
        name: "Null-space CLIK",
        summary: "pseudo-inverse with the support foot as base, objectives in the null space, no boundary",
        source: "Melson, eqs. (8)-(14); Liegeois (1977)",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self { parameters }
    }
}

impl Formulation for NullSpaceClik {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        let mut lin = Linearisation::new(problem);
        let (mut phases, mut notes) = (Vec::new(), Vec::new());
        for (id, phase) in problem.phases().iter().enumerate() {
            let mut inverse = PhaseInverse::new(problem, PhaseId(id))?;
            inverse.count_ranks(problem, PhaseId(id), &mut lin);
            notes.push(format!("phase `{}`: {}", phase.name, inverse.remark(problem)));
            phases.push(inverse);
        }
        let stepper = NullSpaceClikStepper {
            problem: Arc::clone(problem),
            parameters: self.parameters.clone(),
            phases,
            lin,
            secondary: Secondary::new(problem),
            dq: vec![0.0; problem.robot().nv()],
        };
        let honours = Honours {
            boundary: false,
            hard_rows: false,
            objective: Use::Projected,
            allocation_free: true,
            counts: Trust::Metered,
        };
        Ok(Prepared {
            stepper: Box::new(stepper),
            majors: 1,
            honours,
            notes,
        })
    }
}

#[derive(Debug)]
struct NullSpaceClikStepper {
    problem: Arc<Problem>,
    parameters: NullSpaceClikParameters,
    phases: Vec<PhaseInverse>,
    lin: Linearisation,
    secondary: Secondary,
    dq: Vec<f64>,
}

impl Stepper for NullSpaceClikStepper {
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination {
        stay(step, out);
        if !eval.meter.next_major() {
            return Termination::Budget;
        }
        let (problem, lin, target) = (&self.problem, &mut self.lin, step.targets.now());
        let phase = &mut self.phases[step.phase.0];
        eval.linearise(step.q_prev, step.phase, target, lin);
        self.secondary.evaluate(eval, (step.q_prev, &lin.page), step);
        let planned = phase.base.map(|base| (base, base.planned(problem, target.x)));
        if let Some((base, planned)) = &planned {
            base.eliminate(problem, step.q_prev, planned, lin);
        }
        let wanted = Wanted {
            correction: self.parameters.correction,
            dt_s: step.dt_s,
            increment: self.secondary.increment(),
        };
        self.dq.fill(0.0);
        let quality = phase.solve(lin, &wanted, &self.parameters, &mut self.dq);
        integrate_into(problem.robot(), step.q_prev, &self.dq, &mut out.q);
        if let Some((base, planned)) = &planned {
            eval.pass(&out.q, &mut lin.page);
            base.place(problem, &lin.page, planned, &mut out.q);
        }
        difference_into(problem.robot(), step.q_prev, &out.q, &mut out.v);
        out.v.iter_mut().for_each(|v| *v /= step.dt_s);
        quality.termination()
    }

    fn reset(&mut self) {}
}

/// What the rows of a step shall do.
struct Wanted<'a> {
    correction: f64,
    dt_s: f64,
    /// The secondary increment p.
    increment: Option<&'a [f64]>,
}

/// How the increment came out.
#[derive(Clone, Copy)]
struct Quality {
    damped: bool,
    /// Euclidean norm of what the hard rows miss in the linearisation.
    missed: f64,
}

/// What hard rows that contradict each other may miss (m, rad) before it is reported: far above rounding, and what is left
/// of consistent rows is of second order in a step.
const CONTRADICTION: f64 = 1e-6;

impl Quality {
    fn termination(self) -> Termination {
        let residual = self.missed;
        if self.damped {
            Termination::Damped { residual }
        } else if residual > CONTRADICTION {
            Termination::HardRowsRelaxed { residual }
        } else {
            Termination::Stepped
        }
    }
}

/// The rows of one phase and their inverse.
#[derive(Clone, Debug)]
struct PhaseInverse {
    base: Option<Base>,
    /// First velocity coordinate that is an unknown.
    first: usize,
    /// Hard rows that are not the base's.
    hard_rows: Vec<usize>,
    /// Hard rows, compromised rows.
    stages: [Stage; 2],
    /// Compromised rows `[J | y]`, one after the other.
    soft: Vec<f64>,
}

impl PhaseInverse {
    fn new(problem: &Problem, phase: PhaseId) -> Result<Self, Declined> {
        let base = Base::find(problem, &problem.phases()[phase.0])?;
        let layout = problem.layout(phase);
        let first = if base.is_some() {
            problem.robot().root().nv()
        } else {
            0
        };
        let unknowns = problem.robot().nv() - first;
        let others = layout
            .hard
            .groups()
            .iter()
            .filter(|g| base.is_none_or(|b| b.task != g.task));
        let hard_rows: Vec<usize> = others.flat_map(|g| g.row..g.row + g.rows).collect();
        let soft_rows = layout.soft.rows();
        Ok(Self {
            base,
            first,
            stages: [hard_rows.len(), soft_rows].map(|rows| Stage::new(rows, 0, unknowns)),
            hard_rows,
            soft: vec![0.0; soft_rows * (unknowns + 1)],
        })
    }

    fn unknowns(&self, nv: usize) -> usize {
        nv - self.first
    }

    /// Counts ranks at postures without symmetry and caps the factorisations by them: what is left of a row that always
    /// depends on others is rounding, not a direction.
    fn count_ranks(&mut self, problem: &Arc<Problem>, phase: PhaseId, lin: &mut Linearisation) {
        let mut eval = Evaluator::new(problem);
        // Any attitude will do: this one is the unit quaternion of a third of a turn.
        let (x, xdot) = (vec![0.5; problem.nx()], vec![0.0; problem.nxdot()]);
        let target = Sample { x: &x, xdot: &xdot };
        let wanted = Wanted {
            correction: 1.0,
            dt_s: 1.0,
            increment: None,
        };
        let mut most = [Ranks::NONE; 2];
        for q in generic_postures(problem.robot()) {
            eval.linearise(&q, phase, target, lin);
            if let Some(base) = self.base {
                let planned = base.planned(problem, target.x);
                base.eliminate(problem, &q, &planned, lin);
            }
            self.factorise(&lin.hard, &wanted, DROP_AT_GENERIC_POSTURE);
            self.stages[0].decide(0.0);
            self.follow(&lin.soft, &wanted, DROP_AT_GENERIC_POSTURE);
            for (most, stage) in most.iter_mut().zip(&self.stages) {
                *most = most.max(stage.found());
            }
        }
        for (stage, most) in self.stages.iter_mut().zip(most) {
            stage.cap(most);
        }
    }

    /// What is held and what is free, in words.
    fn remark(&self, problem: &Problem) -> String {
        let unknowns = self.unknowns(problem.robot().nv());
        let [hard, soft] = [0, 1].map(|k| self.stages[k].most().costed);
        let base = match self.base {
            Some(base) => format!("base `{}`, ", base.name(problem)),
            None => String::new(),
        };
        let spare = unknowns - hard - soft;
        let rows = self.hard_rows.len();
        format!(
            "{base}{rows} hard rows of rank {hard} and compromised ones of rank {soft} on {unknowns} coordinates, {spare} free"
        )
    }

    fn factorise(&mut self, hard: &Rows, wanted: &Wanted<'_>, drop: f64) {
        let unknowns = self.unknowns(hard.cols());
        let rows = self.stages[0].clear(0, unknowns);
        fill(hard, self.hard_rows.iter().copied(), self.first, wanted, rows);
        self.stages[0].factorise(drop);
    }

    /// The compromised rows in what the decided hard ones leave.
    fn follow(&mut self, soft: &Rows, wanted: &Wanted<'_>, drop: f64) {
        fill(soft, 0..soft.rows(), self.first, wanted, &mut self.soft);
        let [hard, second] = &mut self.stages;
        hard.follow(&mut self.soft, second);
        second.factorise_followed(drop);
    }

    /// Eq. (9): writes the increment into `dq` (length nv; the root is left alone where there is a base).
    fn solve(
        &mut self,
        lin: &Linearisation,
        wanted: &Wanted<'_>,
        parameters: &NullSpaceClikParameters,
        dq: &mut [f64],
    ) -> Quality {
        let drop = match parameters.inverse {
            Inverse::Truncated => parameters.truncation,
            Inverse::Exact | Inverse::Damped => DROP,
        };
        self.factorise(&lin.hard, wanted, drop);
        let (lambda, mut damped) = damping(&mut self.stages[0], parameters);
        let missed = self.stages[0].decide(lambda);
        let x = &mut dq[self.first..];
        if !self.stages[1].is_empty() {
            self.follow(&lin.soft, wanted, drop);
            let [hard, soft] = &mut self.stages;
            let (lambda, also) = damping(soft, parameters);
            soft.decide(lambda);
            damped |= also;
            let (_, left) = hard.left();
            soft.finish(&mut [], &mut x[..left]);
        }
        self.stages[0].finish(&mut [], x);
        if let Some(p) = wanted.increment {
            x.iter_mut().zip(&p[self.first..]).for_each(|(x, p)| *x += p);
        }
        Quality { damped, missed }
    }
}

/// Writes rows `[J | y − J p]` with `y = κ (x − f) + (1 − κ) ẋ Δt`.
fn fill(rows: &Rows, which: impl Iterator<Item = usize>, first: usize, wanted: &Wanted<'_>, out: &mut [f64]) {
    let (ld, unknowns) = (rows.ld(), rows.cols() - first);
    for (to, row) in out.chunks_exact_mut(unknowns + 1).zip(which) {
        let (to, y) = to.split_at_mut(unknowns);
        let columns = rows.jacobian[first * ld..].iter().skip(row).step_by(ld);
        to.iter_mut().zip(columns).for_each(|(to, j)| *to = *j);
        let rate = (1.0 - wanted.correction) * rows.rate[row] * wanted.dt_s;
        y[0] = rate - wanted.correction * rows.error[row];
        if let Some(p) = wanted.increment {
            y[0] -= to.iter().zip(&p[first..]).map(|(j, p)| j * p).sum::<f64>();
        }
    }
}

/// λ of a factorised stage, and whether the step has to say so.
fn damping(stage: &mut Stage, parameters: &NullSpaceClikParameters) -> (f64, bool) {
    if stage.is_empty() {
        return (0.0, false);
    }
    let lambda = parameters.damping * stage.row_scale();
    match parameters.inverse {
        Inverse::Exact => {
            let near = fade(stage.independence(), DEPENDENT);
            (lambda * near, near > 0.0)
        }
        Inverse::Damped => (lambda, true),
        Inverse::Truncated => (0.0, stage.found().costed < stage.most().costed),
    }
}
