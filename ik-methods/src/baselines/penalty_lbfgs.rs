//! # Penalty L-BFGS: limited-memory quasi-Newton on the penalised position problem
//!
//! ## Problem solved
//! The penalised problem of [`super`].
//! ## Step
//! (S1) L-BFGS with `memory` pairs and a Moré–Thuente line search from q⁻, n iterations at most. (S2) q = q⁻ ⊕ d,
//! q̇ = d/Δt, d the best point evaluated.
//! ## What it needs
//! Targets x.
//! ## Known limits
//! The penalty makes the problem stiff: convergence takes many more iterations than the paper's budgets, hard rows and
//! limits are violated in proportion to 1/ρ.
//! ## Source
//! Nocedal & Wright (2006), Numerical Optimization, §7.2; solver: argmin.
//! ## Deviations
//! None.

use super::{Optimiser, PENALTY_FIELD, Penalised, TOLERANCE_FIELD, prepare};
use crate::registry::{Allowed, Field, Method, MethodInfo, N_FIELD, Parameters};
use argmin::core::{Executor, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use ik_core::formulation::{Declined, Formulation, Prepared};
use ik_core::problem::Problem;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Parameters of [`PenaltyLbfgs`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PenaltyLbfgsParameters {
    /// Most iterations.
    pub n: u32,
    /// Penalty weight ρ.
    pub penalty: f64,
    /// Gradient norm that counts as converged.
    pub gradient_tolerance: f64,
    /// Pairs kept.
    pub memory: u32,
}

impl Default for PenaltyLbfgsParameters {
    fn default() -> Self {
        Self {
            n: 15,
            penalty: 100.0,
            gradient_tolerance: 1e-9,
            memory: 7,
        }
    }
}

impl Parameters for PenaltyLbfgsParameters {
    const HELP: &'static [Field] = &[
        N_FIELD,
        PENALTY_FIELD,
        TOLERANCE_FIELD,
        Field {
            key: "memory",
            unit: "-",
            meaning: "pairs of steps and gradient changes kept",
            allowed: Allowed::Whole {
                least: 1,
                largest: 100,
            },
        },
    ];
}

/// The baseline.
#[derive(Clone, Debug)]
pub struct PenaltyLbfgs {
    parameters: PenaltyLbfgsParameters,
}

impl Method for PenaltyLbfgs {
    type Parameters = PenaltyLbfgsParameters;
    const INFO: MethodInfo = MethodInfo {
        id: "penalty-lbfgs",
        name: "Penalty L-BFGS",
        summary: "baseline: argmin's L-BFGS on the penalised position problem",
        source: "Nocedal & Wright (2006), section 7.2",
    };
    fn new(parameters: Self::Parameters) -> Self {
        Self { parameters }
    }
}

impl Formulation for PenaltyLbfgs {
    fn prepare(&self, problem: &Arc<Problem>) -> Result<Prepared, Declined> {
        let p = &self.parameters;
        Ok(prepare(
            problem,
            LimitedMemory {
                pairs: p.memory as usize,
            },
            p.n,
            p.penalty,
            p.gradient_tolerance,
        ))
    }
}

#[derive(Debug)]
struct LimitedMemory {
    pairs: usize,
}

impl Optimiser for LimitedMemory {
    fn run(&self, problem: Penalised<'_>, start: Vec<f64>, most: u32) -> u32 {
        let search: MoreThuenteLineSearch<Vec<f64>, Vec<f64>, f64> = MoreThuenteLineSearch::new();
        let solver: LBFGS<_, Vec<f64>, Vec<f64>, f64> = LBFGS::new(search, self.pairs);
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
