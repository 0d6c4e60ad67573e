//! # Reference solver: Clarabel
//!
//! Goulart & Chen, Clarabel: an interior-point solver for conic programs with quadratic objectives (2024),
//! behind the same door as the active-set solver. No warm start, new data structures for every problem: the
//! independent second opinion of the tests and the baseline a user would reach for, not a fast path.
//!
//! Rows in Clarabel's form (Gx + s = h): equalities and coinciding bounds in the zero cone, finite bounds in
//! the non-negative cone. Its multipliers w satisfy Hx + g + Gᵀw = 0.

use ::clarabel::algebra::CscMatrix;
use ::clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, SupportedConeT, ZeroConeT,
};

use super::active_set::{check_input, clip};
use super::{Qp, QpSolution, QpSolver, QpStatus};

/// Tolerance asked for: with the default 1e-8 the point is only good to 1e-5..1e-3 in flat directions.
const TOLERANCE: f64 = 1e-12;

/// Tolerance still called solved when rounding stops progress before [`TOLERANCE`].
const ACCEPTED: f64 = 1e-8;

/// Interior-point reference; keeps nothing between problems and allocates for each.
#[derive(Clone, Copy, Debug, Default)]
pub struct ClarabelQp;

/// What a row of Clarabel's constraint matrix stands for.
#[derive(Clone, Copy)]
enum Row {
    Equality(usize),
    Fixed(usize),
    Lower(usize),
    Upper(usize),
}

impl QpSolver for ClarabelQp {
    fn solve(&mut self, qp: &Qp<'_>, out: &mut QpSolution) -> QpStatus {
        out.clear_for(qp);
        let status = match check_input(qp) {
            QpStatus::Solved => solve_checked(qp, out),
            rejected => rejected,
        };
        clip(&mut out.x, qp.lo, qp.hi);
        status
    }

    fn reset(&mut self) {}
}

fn solve_checked(qp: &Qp<'_>, out: &mut QpSolution) -> QpStatus {
    if !is_finite(qp) {
        return QpStatus::Numerical;
    }
    let (rows, equalities) = rows_of(qp);
    let (constraints, rhs) = constraint_matrix(qp, &rows);
    let cones: [SupportedConeT<f64>; 2] = [ZeroConeT(equalities), NonnegativeConeT(rows.len() - equalities)];
    let hessian = upper_triangle(qp);
    let Ok(mut solver) = DefaultSolver::new(&hessian, qp.g, &constraints, &rhs, &cones, settings()) else {
        return QpStatus::Numerical;
    };
    solver.solve();
    out.minors = solver.solution.iterations;
    let status = status_of(solver.solution.status);
    if status == QpStatus::Solved {
        out.x.copy_from_slice(&solver.solution.x);
        for (row, w) in rows.iter().zip(&solver.solution.z) {
            match *row {
                Row::Equality(r) => out.y[r] = -w,
                Row::Fixed(j) | Row::Upper(j) => out.z[j] -= w,
                Row::Lower(j) => out.z[j] += w,
            }
        }
    }
    status
}

fn settings() -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        tol_gap_abs: TOLERANCE,
        tol_gap_rel: TOLERANCE,
        tol_feas: TOLERANCE,
        reduced_tol_gap_abs: ACCEPTED,
        reduced_tol_gap_rel: ACCEPTED,
        reduced_tol_feas: ACCEPTED,
        ..DefaultSettings::default()
    }
}

fn status_of(status: SolverStatus) -> QpStatus {
    match status {
        SolverStatus::Solved | SolverStatus::AlmostSolved => QpStatus::Solved,
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => QpStatus::Infeasible,
        SolverStatus::MaxIterations => QpStatus::MinorLimit,
        _ => QpStatus::Numerical,
    }
}

fn is_finite(qp: &Qp<'_>) -> bool {
    let columns = (0..qp.unknowns()).map(|j| qp.h.col(j));
    let rows = (0..qp.unknowns())
        .filter(|_| qp.equalities() > 0)
        .map(|j| qp.a.col(j));
    columns
        .chain(rows)
        .chain([qp.g, qp.b])
        .flatten()
        .all(|value| value.is_finite())
}

/// Rows in the order of the cones, and how many of them are equalities.
fn rows_of(qp: &Qp<'_>) -> (Vec<Row>, usize) {
    let is_fixed = |j: &usize| qp.lo[*j] >= qp.hi[*j];
    let unknowns = 0..qp.unknowns();
    let mut rows: Vec<Row> = (0..qp.equalities()).map(Row::Equality).collect();
    rows.extend(unknowns.clone().filter(is_fixed).map(Row::Fixed));
    let equalities = rows.len();
    for j in unknowns.filter(|j| !is_fixed(j)) {
        rows.extend(qp.lo[j].is_finite().then_some(Row::Lower(j)));
        rows.extend(qp.hi[j].is_finite().then_some(Row::Upper(j)));
    }
    (rows, equalities)
}

fn constraint_matrix(qp: &Qp<'_>, rows: &[Row]) -> (CscMatrix<f64>, Vec<f64>) {
    let mut triplets = (Vec::new(), Vec::new(), Vec::new());
    let mut push = |i: usize, j: usize, value: f64| {
        triplets.0.push(i);
        triplets.1.push(j);
        triplets.2.push(value);
    };
    let mut rhs = Vec::with_capacity(rows.len());
    for (i, row) in rows.iter().enumerate() {
        match *row {
            Row::Equality(r) => {
                (0..qp.unknowns()).for_each(|j| push(i, j, qp.a.col(j)[r]));
                rhs.push(qp.b[r]);
            }
            Row::Fixed(j) => {
                push(i, j, 1.0);
                rhs.push(0.5 * (qp.lo[j] + qp.hi[j]));
            }
            Row::Lower(j) => {
                push(i, j, -1.0);
                rhs.push(-qp.lo[j]);
            }
            Row::Upper(j) => {
                push(i, j, 1.0);
                rhs.push(qp.hi[j]);
            }
        }
    }
    (
        CscMatrix::new_from_triplets(rows.len(), qp.unknowns(), triplets.0, triplets.1, triplets.2),
        rhs,
    )
}

fn upper_triangle(qp: &Qp<'_>) -> CscMatrix<f64> {
    let n = qp.unknowns();
    let columns = (0..n).flat_map(|j| (0..=j).map(move |i| (i, j)));
    let (rows, cols): (Vec<usize>, Vec<usize>) = columns.unzip();
    let values = rows.iter().zip(&cols).map(|(&i, &j)| qp.h.col(j)[i]).collect();
    CscMatrix::new_from_triplets(n, n, rows, cols, values)
}
