//! # Davies' network method
//!
//! The robot and the virtual chains that impose its tasks are one closed mechanism; Davies' circulation law, the Kirchhoff
//! law of twists, relates all joint rates at once. One description whichever foot stands, no support switching, no
//! end-effector Jacobians. Exact where tasks and mobility match; it knows neither limits nor priorities by itself.
//!
//! ## Problem solved
//! ```text
//! N q̇ = 0,  columns [root chain | real joints | task chains]       one circuit per task, 6 rows (centre of mass 3)
//! N_s q̇_s = −N_p q̇_p,   q̇_p imposed virtual coordinates,   q̇_s real joints, monitored coordinates, a free root
//! ```
//! ## Step
//! (S1) Measure the virtual coordinates m at q⁻ by forward kinematics. (S2) `q̇_p = ẋ + K (x − m)` with the targets x of
//! the beginning of the step, ẋ their forward difference (`feed_forward = "difference"`) or the given rates (`"given"`).
//! (S3) Eliminate monitored coordinates and a free root by the left null space of their columns, which leaves `A q̇ = y` in
//! the real joints: square, the solution; fewer rows, the least joint rates; damped where asked for. (S4) Rates of the
//! root from what was eliminated. (S5) q = q⁻ ⊕ Δt q̇, or the classical Runge-Kutta rule with rows and rates inside the
//! step, on SO(3) in the manner of Munthe-Kaas; K (x − m) is held, so that the rule keeps its order.
//!
//! The default `correction` K Δt = 1 is full correction. With forward differences and one evaluation q̇_p is then
//! (x⁺ − m)/Δt (for orientations to second order), the form of closed-loop inverse kinematics. 0 is the open loop, which
//! drifts.
//!
//! Objectives of the problem: the least joint rates become those nearest to q̇₀ = −Σ γ ∇H (`secondary.rs`), in every block
//! `q̇ = q̇₀ + A⁺ (y − A q̇₀)`, which projects q̇₀ into what the circuits leave free. Damped circuits give way to it.
//!
//! ## What it needs
//! Targets; their rates if `feed_forward = "given"`. A hard pose of a frame on the root link imposes the root; otherwise the
//! root is free and follows. Hard tasks must not impose more than the mobility, as a whole or on any limb. Where all tasks
//! together leave the root open, its rates are kept least with those of the joints.
//!
//! ## Known limits
//! No boundary. Straight knees and elbows: the circuits lose rank there, rates grow without bound towards them, and an
//! exactly straight leg does not bend. Hard rows with a condition number beyond 1e5 are damped (`singular_damping`), and the
//! step says so. Integration is explicit: a frame that is far from the root misses by half the squared turn of the step
//! times that distance until the next correction.
//!
//! ## Source
//! Method: Davies (1981), Mechanical networks, Mech. Mach. Theory 16; Assur virtual chains: Campos, Guenther & Martins
//! (2005). Humanoid: the Bioloid paper of `docs/davies.md`, eqs. (1)-(11), (15).
//!
//! ## Deviations
//! Deviation: compromised tasks. The network knows no slack. Their circuits are solved after the hard ones, by least
//! squares in the motions those leave, damped towards a singularity (`soft_damping`, `soft_threshold`) and exact away from
//! it. Weights act on world axes. Dampings are in parts of the longest row, so units and a common factor of the weights
//! change nothing.
//! Deviation: `orientation = "angular-velocity"` by default. The paper's Euler rates impose the same motion but their
//! chain is singular at ±90 degrees.
//! Deviation: the circuit of the centre of mass is ours (see `virtual_chain`).
//! Deviation: least norm is over real joints only. Over all secondary columns it would shorten the rates of root and
//! monitored coordinates too, which are no effort.

mod circuits;
mod mechanism;
mod network;
mod rows;
mod virtual_chain;

pub use mechanism::{
    LinkKind, Mechanism, MechanismBlock, MechanismCircuit, MechanismJoint, MechanismLink, Role,
};
pub use network::{Network, ReferencePoint};

use crate::generic_posture::generic_postures;
use crate::registry::{Allowed, Field, Method, MethodInfo, Parameters, Preset};
use crate::secondary::Secondary;
use crate::step_qp::stay;
use circuits::{Circuits, Damping, RootChain};
use ik_core::configuration::integrate_into;
use ik_core::evaluator::Evaluator;
use ik_core::formulation::{
    Declined, Formulation, Honours, Prepared, Solution, Stepper, Termination, Trust, Use,
};
use ik_core::kinematics::Page;
use ik_core::problem::Problem;
use ik_core::robot::Root;
use ik_core::spatial::so3;
use ik_core::step::ControlStep;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use virtual_chain::{Instant, closure_into};

/// How targets move between the samples of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Between {
    /// On a line: rates are forward differences.
    #[default]
    #[serde(rename = "difference")]
    Line,
    /// On the cubic through both samples with their given rates.
    #[serde(rename = "given")]
    Hermite,
}

/// What the revolute coordinates of a virtual chain are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum OrientationRates {
    /// World angular velocity: three axes e_x, e_y, e_z through the point.
    #[default]
    #[serde(rename = "angular-velocity")]
    AngularVelocity,
    /// Rates of the angles of `Rx Ry Rz`, the paper's chain.
    #[serde(rename = "euler-rates")]
    Euler,
}

/// How rates become positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integrator {
    /// One evaluation per step.
    #[default]
    Euler,
    /// The classical Runge-Kutta rule: four evaluations per step.
    Rk4,
}

impl Integrator {
    /// Nodes τ, weights of the previous rate in the node's increment, weights in the result.
    fn stages(self) -> &'static [(f64, f64, f64)] {
        match self {
            Self::Euler => &[(0.0, 0.0, 1.0)],
            Self::Rk4 => &[
                (0.0, 0.0, 1.0 / 6.0),
                (0.5, 0.5, 1.0 / 3.0),
                (0.5, 0.5, 1.0 / 3.0),
                (1.0, 1.0, 1.0 / 6.0),
            ],
        }
    }
}

/// Parameters of [`Davies`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DaviesParameters {
    /// K Δt.
    pub correction: f64,
    /// Where the rates of the targets come from.
    pub feed_forward: Between,
    /// Revolute coordinates of the virtual chains.
    pub orientation: OrientationRates,
    /// Integration rule.
    pub integrator: Integrator,
    /// λ of hard rows.
    pub damping: f64,
    /// λ of compromised rows at a singularity, in parts of the longest row.
    pub soft_damping: f64,
    /// Independence of the compromised rows from which they are not damped.
    pub soft_threshold: f64,
    /// λ of hard rows at a singularity, in parts of the longest row.
    pub singular_damping: f64,
}

impl Default for DaviesParameters {
    fn default() -> Self {
        Self {
            correction: 1.0,
            feed_forward: Between::Line,
            orientation: OrientationRates::AngularVelocity,
            integrator: Integrator::Euler,
            damping: 0.0,
            // Empirical: with less damping coman/lean and coman/asymmetric are thrown by straight legs; from a threshold
            // of 0.3 on bioloid/com-sway, which is far from straight, is damped too.
            soft_damping: 0.5,
            soft_threshold: 0.25,
            singular_damping: 1e-2,
        }
    }
}

const DAMPING: Allowed = Allowed::Number {
    least: 0.0,
    largest: 1e3,
};
/// Never zero: rounding must not be divided by.
const RELATIVE: Allowed = Allowed::Number {
    least: 1e-6,
    largest: 1e3,
};

impl Parameters for DaviesParameters {
    const HELP: &'static [Field] = &[
        Field {
            key: "correction",
            unit: "-",
            meaning: "K dt: part of the closure error removed per step; 0 is the open loop, stable below 2",
            allowed: Allowed::Number {
                least: 0.0,
                largest: 1.999,
            },
        },
        Field {
            key: "feed_forward",
            unit: "-",
            meaning: "rates of the targets: forward differences of the samples, or those the suite gives, with a cubic between",
            allowed: Allowed::Words(&["difference", "given"]),
        },
        Field {
            key: "orientation",
            unit: "-",
            meaning: "revolute coordinates of the virtual chains",
            allowed: Allowed::Words(&["angular-velocity", "euler-rates"]),
        },
        Field {
            key: "integrator",
            unit: "-",
            meaning: "integration rule",
            allowed: Allowed::Words(&["euler", "rk4"]),
        },
        Field {
            key: "damping",
            unit: "m, rad",
            meaning: "lambda of the hard rows",
            allowed: DAMPING,
        },
        Field {
            key: "soft_damping",
            unit: "-",
            meaning: "lambda of the compromised rows at a singularity in parts of the longest row, fading out away from it",
            allowed: RELATIVE,
        },
        Field {
            key: "soft_threshold",
            unit: "-",
            meaning: "independence of the compromised rows (about 1 / condition number) from which they are not damped",
            allowed: RELATIVE,
        },
        Field {
            key: "singular_damping",
            unit: "-",
            meaning: "lambda of the hard rows at a singularity in parts of the longest row; none below a condition of 1e5",
            allowed: RELATIVE,
        },
    ];
}

/// Davies' method.
#[derive(Clone, Debug)]
pub struct Davies {
    parameters: DaviesParameters,
}

impl Method for Davies {
    type Parameters = DaviesParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "davies",
        name: "Davies' network method",
        summary: "circulation law over virtual chains, one step with full closure correction, no boundary",
        source: "Davies (1981); Campos, Guenther & Martins (2005); Bioloid paper, eqs. (1)-(11)",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self { parameters }
    }
}

/// The open loop: rates are integrated, nothing is corrected.
pub const OPEN_LOOP: Preset = Preset {
    info: MethodInfo {
        id: "davies-open",
        name: "Davies' network method, open loop",
        summary: "the same without closure correction: shows the drift of integrated rates",
        source: "Davies (1981); Campos, Guenther & Martins (2005); Bioloid paper, eqs. (1)-(11)",
    },
    values: &[("correction", 0.0)],
};

impl Formulation for Davies {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        if self.parameters.feed_forward == Between::Hermite && !problem.supplies().rates {
            return Err(Declined::Information {
                needs: "target rates (parameter feed_forward = \"given\")".to_owned(),
            });
        }
        let robot = problem.robot();
        let (mut phases, mut notes) = (Vec::new(), Vec::new());
        for phase in problem.phases() {
            let mut circuits = Circuits::new(problem, phase);
            let remarks = check_mobility(problem, &mut circuits)?;
            notes.extend(
                remarks
                    .into_iter()
                    .map(|note| format!("phase `{}`: {note}", phase.name)),
            );
            phases.push(circuits);
        }
        let stepper = DaviesStepper {
            problem: Arc::clone(problem),
            parameters: self.parameters.clone(),
            phases,
            page: Page::new(robot),
            secondary: Secondary::new(problem),
            q: vec![0.0; robot.nq()],
            v: vec![0.0; robot.nv()],
            increment: vec![0.0; robot.nv()],
            dq: vec![0.0; robot.nv()],
            corrections: vec![0.0; problem.nxdot()],
        };
        let honours = Honours {
            boundary: false,
            hard_rows: false,
            objective: Use::Projected,
            allocation_free: true,
            counts: Trust::Metered,
        };
        #[allow(clippy::cast_possible_truncation, reason = "one or four")]
        Ok(Prepared {
            stepper: Box::new(stepper),
            majors: self.parameters.integrator.stages().len() as u32,
            honours,
            notes,
        })
    }
}

#[derive(Debug)]
struct DaviesStepper {
    problem: Arc<Problem>,
    parameters: DaviesParameters,
    phases: Vec<Circuits>,
    page: Page,
    secondary: Secondary,
    q: Vec<f64>,
    v: Vec<f64>,
    /// Increment from q⁻ to the configuration of the next evaluation.
    increment: Vec<f64>,
    dq: Vec<f64>,
    /// `K (x − m)` at the beginning of the step, one number per rate of the targets.
    corrections: Vec<f64>,
}

impl Stepper for DaviesStepper {
    fn step(&mut self, step: &ControlStep<'_>, eval: &mut Evaluator, out: &mut Solution) -> Termination {
        stay(step, out);
        self.v.fill(0.0);
        self.dq.fill(0.0);
        let stages = self.parameters.integrator.stages();
        if (eval.meter.majors_left() as usize) < stages.len() {
            return Termination::Budget;
        }
        let (mut damped, mut missed_squared) = (false, 0.0_f64);
        for &(tau, previous, weight) in stages {
            eval.meter.next_major();
            for (d, v) in self.increment.iter_mut().zip(&self.v) {
                *d = previous * step.dt_s * v;
            }
            let quality = self.rates(step, tau, eval);
            damped |= quality.damped;
            missed_squared = missed_squared.max(quality.missed_squared);
            for (d, v) in self.dq.iter_mut().zip(&self.v) {
                *d += weight * step.dt_s * v;
            }
        }
        integrate_into(self.problem.robot(), step.q_prev, &self.dq, &mut out.q);
        for (v, d) in out.v.iter_mut().zip(&self.dq) {
            *v = d / step.dt_s;
        }
        if damped {
            let residual = missed_squared.sqrt() * step.dt_s;
            return Termination::Damped { residual };
        }
        Termination::Stepped
    }

    fn reset(&mut self) {}
}

impl DaviesStepper {
    /// Rates at q⁻ ⊕ increment and time τ, in `self.v`: those of the increment, should its rotation be finite.
    fn rates(&mut self, step: &ControlStep<'_>, tau: f64, eval: &mut Evaluator) -> circuits::Quality {
        let robot = self.problem.robot();
        integrate_into(robot, step.q_prev, &self.increment, &mut self.q);
        eval.pass(&self.q, &mut self.page);
        self.secondary.evaluate(eval, (&self.q, &self.page), step);
        let p = &self.parameters;
        if tau == 0.0 {
            let (measured, target) = ((&self.q[..], &self.page), step.targets.previous());
            let gain = p.correction / step.dt_s;
            closure_into(
                &self.problem,
                measured,
                target,
                p.orientation,
                gain,
                &mut self.corrections,
            );
        }
        let instant = Instant {
            targets: step.targets,
            dt_s: step.dt_s,
            tau,
            between: p.feed_forward,
            rates: p.orientation,
            corrections: &self.corrections,
            secondary: self.secondary.increment(),
        };
        let damping = Damping {
            hard: p.damping,
            soft: p.soft_damping,
            soft_threshold: p.soft_threshold,
            singular: p.singular_damping,
        };
        let circuits = &mut self.phases[step.phase.0];
        let quality = circuits.solve(&self.problem, &self.q, &self.page, &instant, damping, &mut self.v);
        if robot.root() == Root::Floating && tau > 0.0 {
            // log(exp(δ) exp(φ)) = φ + J_l⁻¹(φ) δ: the rate of the rotation vector φ of the increment.
            let phi = Vector3::from_column_slice(&self.increment[3..6]);
            let omega = Vector3::from_column_slice(&self.v[3..6]);
            let rate = so3::left_jacobian_inverse(&phi) * omega;
            self.v[3..6].copy_from_slice(rate.as_slice());
        }
        quality
    }
}

/// Counts the ranks and compares what hard tasks impose with what the mechanism, and each group of circuits in it, can do.
/// Remarks if they leave freedom.
fn check_mobility(problem: &Problem, circuits: &mut Circuits) -> Result<Vec<String>, Declined> {
    let robot = problem.robot();
    circuits.count_ranks(problem, &generic_postures(robot));
    let name = |task: &usize| problem.tasks()[*task].name.clone();
    let groups = circuits.imposed();
    let fixed = circuits.imposed_root.map_or(0, |_| 6);
    let mobility = robot.nv();
    let imposed = fixed + groups.iter().map(|g| g.rows).sum::<usize>();
    let over: Vec<_> = groups.iter().filter(|g| g.rank < g.rows).collect();
    if imposed > mobility {
        return Err(Declined::Mobility {
            imposed,
            mobility,
            rank: fixed + groups.iter().map(|g| g.rank).sum::<usize>(),
            tasks: over.iter().flat_map(|g| &g.tasks).map(name).collect(),
        });
    }
    if let Some(worst) = over.first() {
        return Err(Declined::Mobility {
            imposed: worst.rows,
            mobility: worst.mobility,
            rank: worst.rank,
            tasks: worst.tasks.iter().map(name).collect(),
        });
    }
    let mut notes = Vec::new();
    let compromised = groups.iter().map(|g| g.compromised).sum::<usize>();
    let spare = mobility - imposed - compromised;
    if spare > 0 {
        notes.push(format!(
            "redundant: of a mobility of {mobility} hard tasks impose {imposed} and compromised tasks {compromised}; the \
             other {spare} go to the least joint rates"
        ));
    }
    if circuits.groups.iter().any(|g| g.root == RootChain::Costed) {
        notes.push(
            "no task holds the whole root: its rates are kept least with those of the joints".to_owned(),
        );
    }
    Ok(notes)
}
