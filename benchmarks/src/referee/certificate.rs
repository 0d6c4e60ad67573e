//! Optimality certificates of one step.
//!
//! With e_s, e_h the compromised and hard rows at the returned q, J_s, J_h their Jacobians and Δq = q ⊖ q⁻,
//! the conditions of `min ½ e_sᵀ Q e_s` subject to `e_h = 0` and `lo ≤ Δq ≤ hi` are
//! `J_sᵀ Q e_s − J_hᵀ y − z = 0`, z positive only where Δq is at its least and negative only where it is at
//! its largest.
//!
//! [`shared_stationarity`] looks for the y and z that come nearest. A bound multiplier takes up its own
//! component of the residual exactly, and only if its sign allows: what is left is a least-squares problem in
//! y and signed z, solved by the active-set method of Lawson & Hanson (1974), chapter 23, with y always free.
//!
//! Jacobians are finite differences of the referee's own rows (`rows.rs`), so residuals below about 1e-12 of
//! the rows mean nothing.

use super::rows::{difference, error_jacobian, errors};
use super::tasks::hard_then_soft;
use super::{RefereeError, is_configuration, is_readable, is_target};
use faer::Mat;
use ik_core::formulation::Claim;
use ik_core::problem::{PhaseId, Problem};
use ik_core::task::{Priority, Weights};
use nalgebra::{DMatrix, DVector};

/// One returned step.
#[derive(Clone, Copy, Debug)]
pub struct CertifiedStep<'a> {
    /// Configuration before the step (length nq).
    pub q_prev: &'a [f64],
    /// Returned configuration (length nq).
    pub q: &'a [f64],
    /// Target x of the step (length nx).
    pub x: &'a [f64],
    /// Phase of the step.
    pub phase: PhaseId,
    /// Least Δq (length nv), −∞ where free.
    pub lo: &'a [f64],
    /// Largest Δq (length nv), ∞ where free.
    pub hi: &'a [f64],
    /// A bound nearer to Δq than this (rad, m) is active.
    pub active_tolerance: f64,
}

/// How well the conditions of the plain problem can be met at a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// Largest component of what the best multipliers leave of the gradient.
    pub residual: f64,
    /// The same divided by the largest component of the gradient; where the gradient is below 1e-9, by that.
    pub relative: f64,
    /// Largest component of the hard rows (m, rad).
    pub hard_error: f64,
    /// Largest amount by which Δq leaves its interval (rad, m).
    pub bound_violation: f64,
    /// Best multipliers of the hard rows, of least norm where these are dependent.
    pub hard: Vec<f64>,
    /// Best multipliers of the bounds (length nv).
    pub bound: Vec<f64>,
}

/// How well a method's claim meets the conditions of its own problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnStationarity {
    /// `‖J_sᵀ Q e_s + own − J_hᵀ y − z‖∞` with the claimed own, y and z.
    pub residual: f64,
    /// The same divided by the largest component of `J_sᵀ Q e_s + own`; where that is below 1e-9, by 1e-9.
    pub relative: f64,
    /// Largest |z_j| on the wrong side: positive away from the least Δq_j, or negative away from the largest.
    pub sign_violation: f64,
}

/// Gradients below this (m, rad) are those of a target that is reached; relative residuals would compare
/// rounding errors.
const LEAST_GRADIENT: f64 = 1e-9;
/// Singular values below this part of the largest count as zero; above the errors of finite differences.
const RANK_TOLERANCE: f64 = 1e-9;
/// A bound multiplier is not worth taking up for less than this part of the gradient.
const WORTHWHILE: f64 = 1e-14;

/// The conditions at the returned q, before multipliers.
struct Conditions {
    /// `J_sᵀ Q e_s`.
    gradient: DVector<f64>,
    hard_error: DVector<f64>,
    hard_jacobian: DMatrix<f64>,
    dq: Vec<f64>,
}

impl Conditions {
    fn new(problem: &Problem, step: &CertifiedStep<'_>) -> Result<Self, RefereeError> {
        check(problem, step)?;
        let (hard, soft) = hard_then_soft(problem, step.phase);
        let weights = weight_matrix(problem, step.phase);
        let soft_error = errors(problem, &soft, step.q, step.x);
        Ok(Self {
            gradient: error_jacobian(problem, &soft, step.q, step.x).transpose() * (weights * soft_error),
            hard_error: errors(problem, &hard, step.q, step.x),
            hard_jacobian: error_jacobian(problem, &hard, step.q, step.x),
            dq: difference(problem.robot(), step.q_prev, step.q),
        })
    }
}

fn check(problem: &Problem, step: &CertifiedStep<'_>) -> Result<(), RefereeError> {
    let (nq, nv) = (problem.robot().nq(), problem.robot().nv());
    let vectors = [
        ("q_prev", step.q_prev, nq),
        ("q", step.q, nq),
        ("x", step.x, problem.nx()),
        ("lo", step.lo, nv),
        ("hi", step.hi, nv),
    ];
    for (field, values, needed) in vectors {
        if values.len() != needed {
            return Err(RefereeError::Length {
                field,
                found: values.len(),
                needed,
            });
        }
    }
    for (field, q) in [("q_prev", step.q_prev), ("q", step.q)] {
        if !is_configuration(problem, q) {
            return Err(RefereeError::Unreadable { field });
        }
    }
    if !is_target(problem, step.x) {
        return Err(RefereeError::Unreadable { field: "x" });
    }
    let count = problem.phases().len();
    if step.phase.0 >= count {
        return Err(RefereeError::Phase {
            found: step.phase.0,
            count,
        });
    }
    Ok(())
}

/// Q of all compromised tasks of a phase, one block per task.
fn weight_matrix(problem: &Problem, phase: PhaseId) -> DMatrix<f64> {
    let mut blocks = Vec::new();
    for (task, priority) in &problem.phases()[phase.0].tasks {
        let rows = problem.tasks()[*task].track.rows(problem.robot());
        if let Priority::Compromised(weights) = priority {
            blocks.push(match weights {
                Weights::Uniform(w) => DMatrix::from_diagonal_element(rows, rows, *w),
                Weights::Diagonal(d) => DMatrix::from_diagonal(&DVector::from_column_slice(d)),
                Weights::Matrix(m) => DMatrix::from_fn(rows, rows, |i, j| m[i][j]),
            });
        }
    }
    let size = blocks.iter().map(DMatrix::nrows).sum();
    let (mut all, mut at) = (DMatrix::zeros(size, size), 0);
    for block in blocks {
        all.view_mut((at, at), block.shape()).copy_from(&block);
        at += block.nrows();
    }
    all
}

/// Signs that the multiplier of a component may have.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sign {
    Zero,
    Positive,
    Negative,
    Any,
}

impl Sign {
    fn at(dq: f64, lo: f64, hi: f64, tolerance: f64) -> Self {
        match (dq <= lo + tolerance, dq >= hi - tolerance) {
            (false, false) => Self::Zero,
            (true, false) => Self::Positive,
            (false, true) => Self::Negative,
            (true, true) => Self::Any,
        }
    }

    /// How far `value` is from a multiplier of this sign.
    fn distance(self, value: f64) -> f64 {
        match self {
            Self::Zero => value.abs(),
            Self::Positive => (-value).max(0.0),
            Self::Negative => value.max(0.0),
            Self::Any => 0.0,
        }
    }
}

fn signs(step: &CertifiedStep<'_>, dq: &[f64]) -> Vec<Sign> {
    let bounds = step.lo.iter().zip(step.hi);
    dq.iter()
        .zip(bounds)
        .map(|(&dq, (&lo, &hi))| Sign::at(dq, lo, hi, step.active_tolerance))
        .collect()
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().map(f64::abs).fold(0.0, f64::max)
}

fn relative(residual: f64, gradient: &DVector<f64>) -> f64 {
    residual / gradient.amax().max(LEAST_GRADIENT)
}

pub(super) fn shared_stationarity(
    problem: &Problem,
    step: &CertifiedStep<'_>,
) -> Result<Certificate, RefereeError> {
    let at = Conditions::new(problem, step)?;
    let signs = signs(step, &at.dq);
    let (hard, rest) = best_multipliers(&at.gradient, &at.hard_jacobian, &signs);
    let residual = largest(rest.iter().zip(&signs).map(|(&rest, sign)| sign.distance(rest)));
    let outside = at
        .dq
        .iter()
        .zip(step.lo.iter().zip(step.hi))
        .map(|(dq, (lo, hi))| (lo - dq).max(dq - hi).max(0.0));
    Ok(Certificate {
        residual,
        relative: relative(residual, &at.gradient),
        hard_error: largest(at.hard_error.iter().copied()),
        bound_violation: largest(outside),
        hard: hard.as_slice().to_vec(),
        bound: rest
            .iter()
            .zip(&signs)
            .map(|(&r, sign)| if sign.distance(r) > 0.0 { 0.0 } else { r })
            .collect(),
    })
}

/// The y that leaves least of `g − Jᵀy − z` over y and z of the given signs, and the rest `g − Jᵀy`, of which
/// the best z is the part that its sign allows.
///
/// A component whose z is at work drops out of the least squares; which ones are at work is settled as in
/// Lawson & Hanson: take up the component that promises most, and on the way to the new minimiser let go of
/// those whose sign would flip.
fn best_multipliers(g: &DVector<f64>, j: &DMatrix<f64>, signs: &[Sign]) -> (DVector<f64>, DVector<f64>) {
    let mut at_work: Vec<bool> = signs.iter().map(|&s| s == Sign::Any).collect();
    let mut y = least_squares(g, j, &at_work);
    // Each round lowers the sum of squares; the bound only guards against rounding.
    for _ in 0..3 * signs.len() {
        let rest = g - j.transpose() * &y;
        let promise = |i: usize| {
            let allowed = !at_work[i] && signs[i] != Sign::Zero && signs[i].distance(rest[i]) <= 0.0;
            if allowed { rest[i].abs() } else { 0.0 }
        };
        let best = (0..signs.len()).max_by(|&a, &b| promise(a).total_cmp(&promise(b)));
        let Some(best) = best.filter(|&i| promise(i) > WORTHWHILE * g.amax()) else {
            break;
        };
        at_work[best] = true;
        y = settle(g, j, signs, y, &mut at_work);
    }
    let rest = g - j.transpose() * &y;
    (y, rest)
}

/// Moves y to the minimiser for the components at work, and lets go of the first one whose sign would flip on
/// the way, until none does.
fn settle(
    g: &DVector<f64>,
    j: &DMatrix<f64>,
    signs: &[Sign],
    mut y: DVector<f64>,
    at_work: &mut [bool],
) -> DVector<f64> {
    loop {
        let next = least_squares(g, j, at_work);
        let (now, wanted) = (g - j.transpose() * &y, g - j.transpose() * &next);
        let flips = |i: &usize| at_work[*i] && signs[*i].distance(wanted[*i]) > 0.0;
        // Part of the way at which the multiplier of i vanishes.
        let reach = |i: usize| (now[i] / (now[i] - wanted[i])).clamp(0.0, 1.0);
        let first = (0..signs.len())
            .filter(flips)
            .min_by(|&a, &b| reach(a).total_cmp(&reach(b)));
        let Some(first) = first else { return next };
        y = &y + (next - &y) * reach(first);
        at_work[first] = false;
    }
}

/// The shortest y with least `Σ (g − Jᵀy)ᵢ²` over the components i that no bound multiplier takes up.
fn least_squares(g: &DVector<f64>, j: &DMatrix<f64>, taken: &[bool]) -> DVector<f64> {
    let kept: Vec<usize> = (0..g.len()).filter(|&i| !taken[i]).collect();
    if kept.is_empty() || j.nrows() == 0 {
        return DVector::zeros(j.nrows());
    }
    let a = Mat::from_fn(kept.len(), j.nrows(), |row, column| j[(column, kept[row])]);
    // A decomposition that does not converge explains nothing: the whole gradient is then left over.
    let Ok(svd) = a.thin_svd() else {
        return DVector::zeros(j.nrows());
    };
    let (u, v) = (svd.U(), svd.V());
    let s: Vec<f64> = svd.S().column_vector().iter().copied().collect();
    let mut y = DVector::zeros(j.nrows());
    for (k, &value) in s
        .iter()
        .enumerate()
        .filter(|(_, value)| **value > RANK_TOLERANCE * s[0])
    {
        let along = kept
            .iter()
            .enumerate()
            .map(|(row, &i)| u[(row, k)] * g[i])
            .sum::<f64>()
            / value;
        y.iter_mut()
            .enumerate()
            .for_each(|(row, y)| *y += along * v[(row, k)]);
    }
    y
}

pub(super) fn own_stationarity(
    problem: &Problem,
    claim: &Claim,
    step: &CertifiedStep<'_>,
) -> Result<OwnStationarity, RefereeError> {
    let at = Conditions::new(problem, step)?;
    let (rows, nv) = (at.hard_error.len(), at.dq.len());
    // Claims are sized for the phase with most hard rows.
    let lengths = [
        ("claim.hard", &claim.hard, rows.max(claim.hard.len())),
        ("claim.bound", &claim.bound, nv),
        ("claim.own", &claim.own, nv),
    ];
    for (field, values, needed) in lengths {
        if values.len() != needed {
            return Err(RefereeError::Length {
                field,
                found: values.len(),
                needed,
            });
        }
        if !is_readable(values) {
            return Err(RefereeError::Unreadable { field });
        }
    }
    let gradient = at.gradient + DVector::from_column_slice(&claim.own);
    let y = DVector::from_column_slice(&claim.hard[..rows]);
    let left = &gradient - at.hard_jacobian.transpose() * y - DVector::from_column_slice(&claim.bound);
    let wrong = claim
        .bound
        .iter()
        .zip(signs(step, &at.dq))
        .map(|(&z, sign)| sign.distance(z));
    Ok(OwnStationarity {
        residual: left.amax(),
        relative: relative(left.amax(), &gradient),
        sign_violation: largest(wrong),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Least `‖g − Jᵀy − z‖²` by trying every set of bounds at work.
    fn by_enumeration(g: &DVector<f64>, j: &DMatrix<f64>, signs: &[Sign]) -> f64 {
        let mut best = f64::INFINITY;
        for set in 0..1_u32 << signs.len() {
            let taken: Vec<bool> = (0..signs.len()).map(|i| set >> i & 1 == 1).collect();
            let rest = g - j.transpose() * least_squares(g, j, &taken);
            let allowed = (0..signs.len()).all(|i| !taken[i] || signs[i].distance(rest[i]) == 0.0);
            if allowed {
                let left = (0..signs.len())
                    .filter(|&i| !taken[i])
                    .map(|i| rest[i] * rest[i])
                    .sum();
                best = best.min(left);
            }
        }
        best
    }

    #[test]
    fn signed_least_squares_match_enumeration() {
        let mut state = 7_u64;
        let mut draw = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1_u64 << 23) as f64 - 1.0
        };
        for round in 0..2000 {
            let (rows, size) = (round % 4, 2 + round % 6);
            let g = DVector::from_fn(size, |_, _| draw());
            let mut j = DMatrix::from_fn(rows, size, |_, _| draw());
            if rows == 3 {
                let twice = j.row(0) * 2.0;
                j.set_row(1, &twice);
            }
            let kinds = [
                Sign::Zero,
                Sign::Positive,
                Sign::Negative,
                Sign::Positive,
                Sign::Negative,
                Sign::Any,
            ];
            let signs: Vec<Sign> = (0..size)
                .map(|_| kinds[((draw() + 1.0) * 2.999) as usize])
                .collect();
            let (y, rest) = best_multipliers(&g, &j, &signs);
            assert!((&g - j.transpose() * y - &rest).amax() < 1e-12);
            let left: f64 = rest
                .iter()
                .zip(&signs)
                .map(|(&r, sign)| sign.distance(r).powi(2))
                .sum();
            let best = by_enumeration(&g, &j, &signs);
            assert!(
                (left - best).abs() < 1e-10,
                "round {round}: {left} instead of {best}"
            );
        }
    }
}
