//! # Penalty CG: nonlinear conjugate gradient on the penalised position problem
//!
//! ## Problem solved
//! The penalised problem of [`super`].
//! ## Step
//! (S1) Polak–Ribière+ conjugate gradient with a Moré–Thuente line search, restarted every nv iterations, from q⁻, n
//! iterations at most. (S2) q = q⁻ ⊕ d, q̇ = d/Δt, d the best point evaluated.
//! ## What it needs
//! Targets x.
//! ## Known limits
//! The penalty makes the problem stiff: convergence takes many more iterations than the paper's budgets, hard rows and
//! limits are violated in proportion to 1/ρ.
//! ## Source
//! Nocedal & Wright (2006), Numerical Optimization, §5.2; solver: argmin.
//! ## Deviations
//! None.

use super::{Optimiser, PENALTY_FIELD, Penalised, TOLERANCE_FIELD, prepare};
use crate::registry::{Field, Method, MethodInfo, N_FIELD, Parameters};
use argmin::core::{Executor, State};
use argmin::solver::conjugategradient::NonlinearConjugateGradient;
use argmin::solver::conjugategradient::beta::PolakRibierePlus;
use argmin::solver::linesearch::MoreThuenteLineSearch;
use ik_core::formulation::{Declined, Formulation, Prepared};
use ik_core::problem::Problem;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Parameters of [`PenaltyCg`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PenaltyCgParameters {
    /// Most iterations.
    pub n: u32,
    /// Penalty weight ρ.
    pub penalty: f64,
    /// Gradient norm that counts as converged.
    pub gradient_tolerance: f64,
}

impl Default for PenaltyCgParameters {
    fn default() -> Self {
        Self {
            n: 15,
            penalty: 100.0,
            gradient_tolerance: 1e-9,
        }
    }
}

impl Parameters for PenaltyCgParameters {
    const HELP: &'static [Field] = &[N_FIELD, PENALTY_FIELD, TOLERANCE_FIELD];
}

/// The baseline.
#[derive(Clone, Debug)]
pub struct PenaltyCg {
    parameters: PenaltyCgParameters,
}

impl Method for PenaltyCg {
    type Parameters = PenaltyCgParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "penalty-cg",
        name: "Penalty CG",
        summary: "baseline: argmin's nonlinear conjugate gradient on the penalised position problem",
        source: "Nocedal & Wright (2006), section 5.2",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self { parameters }
    }
}

impl Formulation for PenaltyCg {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        let p = &self.parameters;
        Ok(prepare(
            problem,
            ConjugateGradient,
            p.n,
            p.penalty,
            p.gradient_tolerance,
        ))
    }
}

#[derive(Debug)]
struct ConjugateGradient;

impl Optimiser for ConjugateGradient {
    fn run(&self, problem: Penalised<'_>, start: Vec<f64>, most: u32) -> u32 {
        let restart = start.len() as u64;
        let search: MoreThuenteLineSearch<Vec<f64>, Vec<f64>, f64> = MoreThuenteLineSearch::new();
        let solver = NonlinearConjugateGradient::new(search, PolakRibierePlus::new()).restart_iters(restart);
        let run = Executor::new(problem, solver)
            .configure(|state| state.param(start).max_iters(u64::from(most)))
            .timer(false)
            .run();
        // A failed line search ends the run; the best point is kept by the problem itself.
        run.map_or(most, |result| {
            u32::try_from(result.state().get_iter()).unwrap_or(most)
        })
    }
}
