//! # The dense active-set solver
//!
//! 1. Eliminate A x = b: x = x_c + Z v (`elimination.rs`), so that no KKT matrix is formed and the bounds
//!    stay bounds.
//! 2. Reduce and factorise the Hessian: M = Zᵀ H Z = L Lᵀ (`reduced.rs`).
//! 3. Hold the bounds that were active in the previous solve, go to the minimiser on them, let go of those
//!    with the wrong sign, and continue with the dual method of Goldfarb and Idnani (`dual.rs`). A strictly
//!    convex problem has one solution: warm and cold starts differ in work and rounding only.
//! 4. Compute the residual of the stationarity condition at the point; while it is above rounding, correct and continue from 3. With a semidefinite
//!    H the factor carries a small proximal weight and the corrections are proximal-point steps.
//! 5. Clip the rounding, recover the multipliers.
//!
//! Nothing is allocated after construction for problems up to the given size.

use super::dual::Dual;
use super::elimination::{DEPENDENT, Elimination, MAX_UNKNOWNS, NEARLY_DEPENDENT, Rows};
use super::kernels::{max_abs, max_abs_or_nan};
use super::reduced::Reduced;
use super::{Qp, QpSolution, QpSolver, QpStatus, kkt_residuals};

/// A reduced residual below this fraction of the gradient's terms is rounding: 100 times what the sums of
/// about 20 terms leave.
const CONVERGED: f64 = 1e-13;

/// A residual below this fraction of what the terms of the point contribute to it is rounding of the point,
/// some 50 units of it. This decides where the gradient itself vanishes at the solution.
const POINT_ROUNDING: f64 = 1e-14;

/// A point smaller than this fraction of its box counts as that large in rounding: a robot at rest, whose
/// solution is zero, must not be refined down to denormal numbers.
const REST: f64 = 1e-3;

/// Residual up to which an answer that no longer improves is still called solved.
const ACCEPTED: f64 = 1e-10;

/// Limit on corrections. A definite H needs none or one; a proximal step gains a factor of about
/// (curvature / 1e-9) and many steps mean an objective without a minimum.
const CORRECTION_LIMIT: u32 = 100;

/// A lower bound above its upper bound by more than this times max(1, |bound|) makes the box empty; less is
/// rounding of an interval that is a point (lengths in m and rad).
const EMPTY_BOX: f64 = 1e-12;

/// Rows missed by more than this (m, rad) by an answer that left nearly dependent ones out are not met.
const ROWS_LOST: f64 = 1e-8;

/// Violation, in units of the tolerance, at which an infeasible verdict is believed without a second look
/// from a freshly computed point.
const CLEARLY_VIOLATED: f64 = 1e6;

/// Warm-started dual active-set solver for small dense problems; see the module documentation.
#[derive(Clone, Debug)]
pub struct ActiveSet {
    n_max: usize,
    m_max: usize,
    elimination: Elimination,
    reduced: Reduced,
    dual: Dual,
    /// Unknowns at a bound in the previous solve, with the sign of the side.
    warm: Vec<(usize, f64)>,
    /// Position of each unknown.
    position: Vec<usize>,
    /// Gradient in the order of the problem, gradient in positions, reduced residual.
    gradient: Vec<f64>,
    at_positions: Vec<f64>,
    residual: Vec<f64>,
}

impl ActiveSet {
    /// Solver for problems of up to `n` unknowns and `m_max` equality rows.
    ///
    /// A larger problem is solved as well, after allocating again. Problems of no or more than
    /// 4095 unknowns are refused (`Numerical`).
    #[must_use]
    pub fn new(n: usize, m_max: usize) -> Self {
        Self {
            n_max: n,
            m_max,
            elimination: Elimination::new(n, m_max),
            reduced: Reduced::new(n, m_max),
            dual: Dual::new(n),
            warm: Vec::with_capacity(n),
            position: vec![0; n],
            gradient: vec![0.0; n],
            at_positions: vec![0.0; n],
            residual: vec![0.0; n],
        }
    }

    fn make_room(&mut self, qp: &Qp<'_>) {
        let (n, m) = (qp.unknowns(), qp.equalities());
        if n > self.n_max || m > self.m_max {
            *self = Self::new(n.max(self.n_max), m.max(self.m_max));
        }
    }

    /// Steps 2 to 4.
    fn minimise(&mut self, qp: &Qp<'_>) -> QpStatus {
        if !self.reduced.factorise(qp) {
            return QpStatus::Numerical;
        }
        self.start();
        self.iterate(qp)
    }

    /// Step 3 up to the first minimiser with a working set of right-signed members.
    fn start(&mut self) {
        if !self.warm.is_empty() {
            for (p, &unknown) in self.reduced.order.iter().enumerate() {
                self.position[unknown] = p;
            }
            for &(unknown, sign) in &self.warm {
                if unknown < self.reduced.order.len() {
                    self.dual.hold(&self.reduced, self.position[unknown], sign);
                }
            }
        }
        let residual = &mut self.residual[..self.reduced.unknowns()];
        self.reduced.initial_gradient_into(residual);
        self.dual.correct(&self.reduced, residual);
    }

    /// Steps 3 and 4.
    fn iterate(&mut self, qp: &Qp<'_>) -> QpStatus {
        let mut best = f64::INFINITY;
        for corrections_left in (0..CORRECTION_LIMIT).rev() {
            let status = self.dual.run(&self.reduced);
            let is_first = best == f64::INFINITY;
            let doubtful = status == QpStatus::Infeasible && is_first && self.is_doubtful();
            if status != QpStatus::Solved && !doubtful {
                return status;
            }
            let error = self.relative_residual(qp);
            let has_stalled = error > 0.5 * best || corrections_left == 0;
            if !doubtful && (error <= CONVERGED || (error <= ACCEPTED && has_stalled)) {
                return QpStatus::Solved;
            }
            if !error.is_finite() {
                break;
            }
            best = best.min(error);
            let residual = &mut self.residual[..self.reduced.unknowns()];
            self.dual.correct(&self.reduced, residual);
        }
        QpStatus::Numerical
    }

    /// True if an infeasible verdict rests on a violation that drift of the point could explain.
    fn is_doubtful(&self) -> bool {
        self.dual.is_inside(&self.reduced, CLEARLY_VIOLATED)
    }

    /// Residual of the reduced stationarity condition and of the members' bounds relative to their terms;
    /// leaves the former in `self.residual` and the gradient H x + g in positions.
    fn relative_residual(&mut self, qp: &Qp<'_>) -> f64 {
        self.reduced.complete(&mut self.dual.x);
        let n = qp.unknowns();
        let gradient = &mut self.gradient[..n];
        self.reduced.gradient_into(&self.dual.x, gradient);
        for (out, &unknown) in self.at_positions.iter_mut().zip(&self.reduced.order) {
            *out = gradient[unknown];
        }
        let scale = max_abs(qp.g) + max_abs(gradient);
        let residual = &mut self.residual[..self.reduced.unknowns()];
        self.reduced.project(&self.at_positions[..n], residual);
        self.dual.remove_multipliers(&self.reduced, residual);
        let mut stationarity = max_abs_or_nan(residual);
        if stationarity > CONVERGED * scale {
            let terms = self
                .reduced
                .gradient_terms(&qp.h, &self.dual.x, REST * self.dual.bound_scale());
            stationarity = (stationarity - POINT_ROUNDING * terms).max(0.0);
        }
        let stationarity = if stationarity > 0.0 {
            stationarity / scale
        } else {
            stationarity
        };
        // A gap within the violation tolerance is no error; it is closed by putting members on their bounds.
        let gap = self.dual.worst_member_gap(&self.reduced);
        if gap > 1.0 {
            stationarity.max(gap * CONVERGED)
        } else {
            stationarity
        }
    }

    /// Step 5: point clipped into the box and multipliers of an answer that is solved.
    fn write_multipliers(&mut self, out: &mut QpSolution) {
        let set = &self.dual.set;
        for ((&position, sign), multiplier) in set.positions.iter().zip(&set.signs).zip(&set.multipliers) {
            let z = sign * multiplier;
            out.z[self.reduced.order[position]] = z;
            self.at_positions[position] -= z;
        }
        self.elimination
            .multipliers_into(&self.at_positions[..self.reduced.rank()], &mut out.y);
    }

    fn write_point(&mut self, qp: &Qp<'_>, out: &mut QpSolution) {
        self.dual.snap();
        for (&unknown, &value) in self.reduced.order.iter().zip(&self.dual.x) {
            out.x[unknown] = value;
        }
        clip(&mut out.x, qp.lo, qp.hi);
        out.minors = self.dual.minors;
    }

    /// Steps 1 to 5, with rows whose remainder is below `dependent` left out.
    fn attempt(&mut self, qp: &Qp<'_>, dependent: f64, out: &mut QpSolution) -> QpStatus {
        let rows = self.elimination.run(qp, dependent);
        if rows == Rows::NotFinite {
            self.warm.clear();
            clip(&mut out.x, qp.lo, qp.hi);
            return QpStatus::Numerical;
        }
        self.reduced.load(&mut self.elimination);
        self.dual.load(&self.reduced, qp.lo, qp.hi);
        let status = if rows == Rows::Consistent {
            self.minimise(qp)
        } else {
            QpStatus::Infeasible
        };
        if status == QpStatus::Solved {
            self.write_multipliers(out);
        }
        self.write_point(qp, out);
        self.remember(status);
        status
    }

    fn remember(&mut self, status: QpStatus) {
        self.warm.clear();
        if matches!(status, QpStatus::Solved | QpStatus::Infeasible) {
            let set = &self.dual.set;
            let members = set.positions.iter().zip(&set.signs);
            self.warm
                .extend(members.map(|(&position, &sign)| (self.reduced.order[position], sign)));
        }
    }
}

impl QpSolver for ActiveSet {
    fn solve(&mut self, qp: &Qp<'_>, out: &mut QpSolution) -> QpStatus {
        out.clear_for(qp);
        let status = check_input(qp);
        if status != QpStatus::Solved {
            clip(&mut out.x, qp.lo, qp.hi);
            return status;
        }
        self.make_room(qp);
        let status = self.attempt(qp, DEPENDENT, out);
        if status != QpStatus::Numerical || qp.equalities() == 0 {
            return status;
        }
        // Rows that are nearly dependent cost the accuracy: once more without them.
        self.warm.clear();
        let tried = out.minors;
        out.clear_for(qp);
        let status = self.attempt(qp, NEARLY_DEPENDENT, out);
        out.minors += tried;
        let lost = status == QpStatus::Solved && kkt_residuals(qp, out).equality > ROWS_LOST;
        if lost { QpStatus::Infeasible } else { status }
    }

    fn reset(&mut self) {
        self.warm.clear();
    }
}

/// Size, shape and box; `Solved` means nothing is wrong with them.
pub(super) fn check_input(qp: &Qp<'_>) -> QpStatus {
    if !qp.is_consistent_in_shape() || !(1..=MAX_UNKNOWNS).contains(&qp.unknowns()) {
        return QpStatus::Numerical;
    }
    let mut status = QpStatus::Solved;
    for (lo, hi) in qp.lo.iter().zip(qp.hi) {
        if lo.is_nan() || hi.is_nan() {
            return QpStatus::Numerical;
        }
        let slack = EMPTY_BOX * lo.abs().max(hi.abs()).max(1.0);
        if *lo == f64::INFINITY || *hi == f64::NEG_INFINITY || lo - hi > slack {
            status = QpStatus::Infeasible;
        }
    }
    status
}

/// Moves `x` into the box; entries that are not finite become the finite value of the box nearest to 0.
pub(super) fn clip(x: &mut [f64], lo: &[f64], hi: &[f64]) {
    for ((x, lo), hi) in x.iter_mut().zip(lo).zip(hi) {
        let inner = if x.is_finite() { *x } else { 0.0 };
        let clipped = inner.max(*lo).min(*hi);
        *x = if clipped.is_finite() { clipped } else { 0.0 };
    }
}
