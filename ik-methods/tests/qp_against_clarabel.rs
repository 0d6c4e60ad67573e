//! The active-set solver against an interior-point solver and the KKT conditions, on 10 000 seeded problems.
//!
//! Objectives and KKT residuals are compared, not points: with a flat objective the point is not unique.

#![allow(clippy::float_cmp, reason = "points are clipped onto their bounds exactly")]
#![allow(
    clippy::print_stdout,
    reason = "counts of what the sweeps met, shown on request"
)]

use ik_methods::qp::{
    ActiveSet, ClarabelQp, Lexicographic, MatRef, Outcome, Qp, QpSolution, QpSolver, QpStatus, kkt_residuals,
};

const INF: f64 = f64::INFINITY;

/// SplitMix64 (Steele, Lea & Flood 2014): one 64-bit state, good enough to draw test data.
struct Draw(u64);

impl Draw {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in [lo, hi).
    fn within(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn index(&mut self, len: usize) -> usize {
        (self.bits() % len as u64) as usize
    }

    fn vector(&mut self, len: usize, size: f64) -> Vec<f64> {
        (0..len).map(|_| self.within(-size, size)).collect()
    }
}

/// Owned problem, columns contiguous.
#[derive(Clone)]
struct Problem {
    n: usize,
    m: usize,
    h: Vec<f64>,
    g: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    lo: Vec<f64>,
    hi: Vec<f64>,
}

impl Problem {
    fn view(&self) -> Qp<'_> {
        Qp {
            h: MatRef::new(&self.h, self.n, self.n),
            g: &self.g,
            a: MatRef::new(&self.a, self.m, self.n),
            b: &self.b,
            lo: &self.lo,
            hi: &self.hi,
        }
    }

    /// H = Jᵀ J + damping I with a random J of `rows` rows; a feasible point inside the box.
    fn random(draw: &mut Draw, n: usize, m: usize, rows: usize, damping: f64) -> (Self, Vec<f64>) {
        let jacobian = draw.vector(rows * n, 1.0);
        let mut h = gram(&jacobian, rows, n);
        (0..n).for_each(|i| h[i * (n + 1)] += damping);
        let feasible = draw.vector(n, 1.0);
        let lo: Vec<f64> = feasible.iter().map(|x| x - draw.within(0.0, 0.6)).collect();
        let hi: Vec<f64> = feasible.iter().map(|x| x + draw.within(0.0, 0.6)).collect();
        let mut problem = Self {
            n,
            m,
            h,
            g: draw.vector(n, 2.0),
            a: draw.vector(m * n, 1.0),
            b: vec![0.0; m],
            lo,
            hi,
        };
        problem.b = problem.rows_at(&feasible);
        (problem, feasible)
    }

    fn rows_at(&self, x: &[f64]) -> Vec<f64> {
        (0..self.m)
            .map(|r| (0..self.n).map(|j| self.a[r + j * self.m] * x[j]).sum())
            .collect()
    }

    /// Row `r` becomes the combination of the rows before it.
    fn make_row_dependent(&mut self, draw: &mut Draw, r: usize) {
        let weights = draw.vector(r, 1.0);
        let combine = |row: &dyn Fn(usize) -> f64| weights.iter().enumerate().map(|(i, w)| w * row(i)).sum();
        for j in 0..self.n {
            let value = combine(&|i| self.a[i + j * self.m]);
            self.a[r + j * self.m] = value;
        }
        let value = combine(&|i| self.b[i]);
        self.b[r] = value;
    }
}

fn gram(jacobian: &[f64], rows: usize, n: usize) -> Vec<f64> {
    let column = |j: usize| &jacobian[j * rows..][..rows];
    let entry = |i: usize, j: usize| column(i).iter().zip(column(j)).map(|(a, b)| a * b).sum();
    (0..n * n).map(|index| entry(index % n, index / n)).collect()
}

fn size(draw: &mut Draw) -> (usize, usize) {
    let n = 1 + draw.index(24);
    (n, draw.index(n + 1))
}

/// Solves with both and asserts that they agree; returns false where the reference gave up.
fn agree(label: &str, seed: u64, problem: &Problem, solver: &mut ActiveSet) -> bool {
    let qp = problem.view();
    let mut ours = QpSolution::new(problem.n, problem.m);
    let status = solver.solve(&qp, &mut ours);
    assert!(
        ours.x.iter().all(|x| x.is_finite()),
        "{label} {seed}: x is not finite"
    );
    assert_eq!(
        status,
        QpStatus::Solved,
        "{label} {seed}: n = {}, m = {}",
        problem.n,
        problem.m
    );
    let residuals = kkt_residuals(&qp, &ours);
    assert!(
        residuals.worst_relative() < 1e-10,
        "{label} {seed}: {residuals:?}"
    );
    assert_eq!(residuals.bound, 0.0, "{label} {seed}: outside the box");

    let mut reference = QpSolution::new(problem.n, problem.m);
    if ClarabelQp.solve(&qp, &mut reference) != QpStatus::Solved {
        return false;
    }
    let (ours, theirs) = (qp.objective(&ours.x), qp.objective(&reference.x));
    // The reference may be lower by what its own violation of the rows buys it.
    let bought: f64 =
        kkt_residuals(&qp, &reference).equality * reference.y.iter().map(|y| y.abs()).sum::<f64>();
    let scale = 1.0 + ours.abs();
    assert!(
        ours <= theirs + 1e-8 * scale + bought,
        "{label} {seed}: {ours} above the reference {theirs}"
    );
    assert!(
        ours >= theirs - 1e-6 * scale - bought,
        "{label} {seed}: {ours} far below the reference {theirs}"
    );
    true
}

/// Runs `count` problems and allows the reference to give up on a few.
fn sweep(label: &str, count: u64, allowed_gaps: u64, make: impl Fn(&mut Draw) -> Problem) {
    let mut gaps = 0;
    for seed in 0..count {
        let problem = make(&mut Draw(seed));
        gaps += u64::from(!agree(
            label,
            seed,
            &problem,
            &mut ActiveSet::new(problem.n, problem.m),
        ));
    }
    println!("{label}: {count} problems, reference gave up on {gaps}");
    assert!(
        gaps <= allowed_gaps,
        "{label}: the reference solved only {} of {count}",
        count - gaps
    );
}

#[test]
fn positive_definite() {
    sweep("positive definite", 2000, 20, |draw| {
        let (n, m) = size(draw);
        Problem::random(draw, n, m, n + 2, 1e-2).0
    });
}

#[test]
fn semidefinite() {
    sweep("semidefinite", 1500, 30, |draw| {
        let (n, m) = size(draw);
        let rows = draw.index(n + 1);
        Problem::random(draw, n, m, rows, 0.0).0
    });
}

#[test]
fn semidefinite_with_flat_optimum() {
    sweep("flat optimum", 500, 10, |draw| {
        let (n, m) = size(draw);
        let rows = 1 + draw.index(n);
        let (mut problem, _) = Problem::random(draw, n, m, rows, 0.0);
        // g in the range of H: the objective is flat in the null space of J.
        let target = draw.vector(n, 1.0);
        problem.g = (0..n)
            .map(|i| -(0..n).map(|j| problem.h[i + j * n] * target[j]).sum::<f64>())
            .collect();
        problem
    });
}

#[test]
fn linear_objective() {
    sweep("linear objective", 500, 10, |draw| {
        let (n, m) = size(draw);
        Problem::random(draw, n, m, 0, 0.0).0
    });
}

#[test]
fn redundant_rows() {
    sweep("redundant rows", 1000, 20, |draw| {
        let (n, m) = size(draw);
        let m = m.max(1);
        let (mut problem, _) = Problem::random(draw, n, m, n, 1e-2);
        for _ in 0..=draw.index(3) {
            let row = draw.index(m);
            problem.make_row_dependent(draw, row);
        }
        problem
    });
}

#[test]
fn fixed_unknowns() {
    sweep("fixed unknowns", 800, 10, |draw| {
        let (n, m) = size(draw);
        let (mut problem, feasible) = Problem::random(draw, n, m, n + 2, 1e-2);
        for _ in 0..=draw.index(n) {
            let j = draw.index(n);
            (problem.lo[j], problem.hi[j]) = (feasible[j], feasible[j]);
        }
        problem
    });
}

#[test]
fn infinite_bounds() {
    sweep("infinite bounds", 1000, 10, |draw| {
        let (n, m) = size(draw);
        let (mut problem, _) = Problem::random(draw, n, m, n + 2, 1e-2);
        for j in 0..n {
            match draw.index(4) {
                0 => problem.lo[j] = -INF,
                1 => problem.hi[j] = INF,
                2 => (problem.lo[j], problem.hi[j]) = (-INF, INF),
                _ => {}
            }
        }
        problem
    });
}

#[test]
fn degenerate_vertices() {
    sweep("degenerate vertices", 1000, 30, |draw| {
        let (n, m) = size(draw);
        let (mut problem, feasible) = Problem::random(draw, n, m, n + 2, 1e-2);
        // More bounds pass through the feasible point than there are degrees of freedom.
        for (j, x) in feasible.iter().enumerate() {
            match draw.index(3) {
                0 => problem.lo[j] = *x,
                1 => problem.hi[j] = *x,
                _ => {}
            }
        }
        // Half of them have their unconstrained optimum there: all multipliers are zero.
        if draw.index(2) == 0 {
            problem.g = (0..n)
                .map(|i| -(0..n).map(|j| problem.h[i + j * n] * feasible[j]).sum::<f64>())
                .collect();
        }
        problem
    });
}

/// Differential-IK shape: 18 unknowns, 6 of them free, 15 rows of norm 0.1..1, 3 compromised rows, a narrow
/// moving box. `singular` scales the last row's part that the others do not span.
fn ik_like(draw: &mut Draw, damping: f64, singular: f64) -> Problem {
    let (n, m) = (18, 15);
    let (mut problem, _) = Problem::random(draw, n, m, 3, damping);
    for r in 0..m {
        let norm = draw.within(0.1, 1.0) / (n as f64 / 3.0).sqrt();
        (0..n).for_each(|j| problem.a[r + j * m] *= norm);
    }
    let own: Vec<f64> = (0..n).map(|j| problem.a[m - 1 + j * m]).collect();
    if singular < 1.0 {
        problem.make_row_dependent(draw, m - 1);
        (0..n).for_each(|j| problem.a[m - 1 + j * m] += singular * own[j]);
    }
    let step: Vec<f64> = draw.vector(n, 0.02);
    let previous = draw.vector(n, 0.02);
    for (j, previous) in previous.iter().enumerate() {
        let is_free = j < 6;
        problem.lo[j] = if is_free { -INF } else { -0.02 + 0.2 * previous };
        problem.hi[j] = if is_free { INF } else { 0.02 };
    }
    let feasible: Vec<f64> = (0..n)
        .map(|j| step[j].max(problem.lo[j]).min(problem.hi[j]))
        .collect();
    problem.b = problem.rows_at(&feasible);
    problem.g = draw.vector(n, 0.05);
    problem
}

#[test]
fn ik_like_problems() {
    sweep("IK-like, damping 1e-2", 500, 10, |draw| ik_like(draw, 1e-2, 1.0));
    sweep("IK-like, damping 1e-6", 500, 10, |draw| ik_like(draw, 1e-6, 1.0));
}

#[test]
fn ik_like_problems_with_dependent_rows() {
    sweep("IK-like, singular value 1e-16", 200, 50, |draw| {
        ik_like(draw, 1e-2, 1e-16)
    });
    sweep("IK-like, singular value 0", 200, 50, |draw| {
        ik_like(draw, 1e-6, 0.0)
    });
}

/// Rows whose remainder is below 1e-7 of their 1-norm (here at most 3) count as dependent: unknowns that move by at most
/// 0.035 then miss them by at most this.
const DROPPED_ROW: f64 = 1e-8;

/// With a singular value of 1e-9 the box decides within rounding of the rows whether there is a solution.
/// The lexicographic solver must come back with rows met but for the remainder that it leaves out, whatever the
/// verdict.
#[test]
fn ik_like_problems_with_nearly_dependent_rows() {
    let mut relaxed = 0;
    for seed in 0..500 {
        let problem = ik_like(&mut Draw(seed), 1e-2, 1e-9);
        let mut out = QpSolution::new(problem.n, problem.m);
        let outcome = Lexicographic::new(problem.n, problem.m).solve(&problem.view(), &mut out);
        let residuals = kkt_residuals(&problem.view(), &out);
        assert_eq!(residuals.bound, 0.0, "{seed}");
        assert!(
            residuals.equality < DROPPED_ROW,
            "{seed}: {outcome:?} {residuals:?}"
        );
        relaxed += usize::from(outcome != Outcome::Solved);
    }
    println!("nearly dependent rows: {relaxed} of 500 not called solved");
    assert!(relaxed < 50);
}

/// The worst of it: nearly dependent rows met by a point on many bounds at once. Rounding of the data decides
/// whether a solution exists; the lexicographic solver must meet the rows all the same.
#[test]
fn degenerate_vertices_with_nearly_dependent_rows() {
    let (mut solved, mut relaxed) = (0, 0);
    for seed in 0..1000 {
        let draw = &mut Draw(seed);
        let singular = 10f64.powf(draw.within(-15.0, -3.0));
        let mut problem = ik_like(draw, 1e-4, singular);
        let (n, m) = (problem.n, problem.m);
        let middle = |j: usize| {
            if j < 6 {
                0.01
            } else {
                0.5 * (problem.lo[j] + problem.hi[j])
            }
        };
        let feasible: Vec<f64> = (0..n).map(middle).collect();
        problem.b = problem.rows_at(&feasible);
        for (j, x) in feasible.into_iter().enumerate() {
            match draw.index(4) {
                0 => problem.lo[j] = x,
                1 => problem.hi[j] = x,
                _ => {}
            }
        }
        let mut out = QpSolution::new(n, m);
        match Lexicographic::new(n, m).solve(&problem.view(), &mut out) {
            Outcome::Solved => solved += 1,
            Outcome::Relaxed { residual } => {
                assert!(residual < DROPPED_ROW, "{seed}: {residual:e}");
                relaxed += 1;
            }
            Outcome::Failed(status) => panic!("{seed}: {status:?}"),
        }
        let residuals = kkt_residuals(&problem.view(), &out);
        assert_eq!(residuals.bound, 0.0, "{seed}");
        assert!(residuals.equality < DROPPED_ROW, "{seed}: {residuals:?}");
    }
    println!("degenerate and nearly dependent: {solved} solved, {relaxed} relaxed by less than 1e-8");
    assert!(solved >= 900);
}

fn assert_both_infeasible(label: &str, seed: u64, problem: &Problem) {
    let mut out = QpSolution::new(problem.n, problem.m);
    let ours = ActiveSet::new(problem.n, problem.m).solve(&problem.view(), &mut out);
    assert_eq!(ours, QpStatus::Infeasible, "{label} {seed}");
    assert!(out.x.iter().all(|x| x.is_finite()), "{label} {seed}");
    assert_eq!(kkt_residuals(&problem.view(), &out).bound, 0.0, "{label} {seed}");
    let theirs = ClarabelQp.solve(&problem.view(), &mut out);
    assert_eq!(theirs, QpStatus::Infeasible, "{label} {seed}: reference");
}

#[test]
fn contradictory_rows() {
    for seed in 0..300 {
        let draw = &mut Draw(seed);
        let (n, m) = size(draw);
        let m = m.max(2);
        let (mut problem, _) = Problem::random(draw, n, m, n + 2, 1e-2);
        let row = 1 + draw.index(m - 1);
        problem.make_row_dependent(draw, row);
        problem.b[row] += 1.0;
        assert_both_infeasible("contradictory rows", seed, &problem);
    }
}

#[test]
fn rows_out_of_reach_of_the_box() {
    for seed in 0..500 {
        let draw = &mut Draw(seed);
        let (n, m) = size(draw);
        let m = m.max(1);
        let (mut problem, _) = Problem::random(draw, n, m, n + 2, 1e-2);
        // Largest value row 0 can take in the box, and more.
        let reach = |j: usize| (problem.a[j * m] * problem.lo[j]).max(problem.a[j * m] * problem.hi[j]);
        problem.b[0] = (0..n).map(reach).sum::<f64>() + draw.within(0.1, 1.0);
        assert_both_infeasible("out of reach", seed, &problem);
    }
}

#[test]
fn empty_box() {
    let (mut problem, _) = Problem::random(&mut Draw(1), 5, 2, 5, 1.0);
    (problem.lo[3], problem.hi[3]) = (1.0, 0.5);
    let mut out = QpSolution::new(5, 2);
    assert_eq!(
        ActiveSet::new(5, 2).solve(&problem.view(), &mut out),
        QpStatus::Infeasible
    );
    assert_eq!(ClarabelQp.solve(&problem.view(), &mut out), QpStatus::Infeasible);
    let outcome = Lexicographic::new(5, 2).solve(&problem.view(), &mut out);
    assert_eq!(outcome, Outcome::Failed(QpStatus::Infeasible));
    // Crossed by rounding only: the interval is a point.
    (problem.lo[3], problem.hi[3]) = (0.5 + 1e-16, 0.5);
    problem.m = 0;
    problem.b.clear();
    assert_eq!(
        ActiveSet::new(5, 0).solve(&problem.view(), &mut out),
        QpStatus::Solved
    );
    assert_eq!(out.x[3], 0.5);
}

/// Problem number `step` of a slowly moving sequence.
fn moving(seed: u64, step: usize, n: usize, m: usize) -> Problem {
    let ik = (n, m) == (18, 15);
    let at = |offset: u64| {
        let draw = &mut Draw(seed + offset);
        if ik {
            ik_like(draw, 1e-2, 1.0)
        } else {
            Problem::random(draw, n, m, n / 2, 1e-2).0
        }
    };
    let (mut problem, other) = (at(0), at(1_000_000));
    let phase = 0.02 * step as f64;
    let blend = |a: &mut Vec<f64>, b: &[f64]| {
        a.iter_mut()
            .zip(b)
            .for_each(|(a, b)| *a = if a.is_finite() { *a + phase * (b - *a) } else { *a });
    };
    blend(&mut problem.a, &other.a);
    blend(&mut problem.g, &other.g);
    blend(&mut problem.lo, &other.lo);
    blend(&mut problem.hi, &other.hi);
    let middle: Vec<f64> = (0..n)
        .map(|j| {
            if problem.lo[j].is_finite() {
                0.7 * problem.lo[j] + 0.3 * problem.hi[j]
            } else {
                0.01
            }
        })
        .collect();
    problem.b = problem.rows_at(&middle);
    problem
}

#[test]
fn warm_and_cold_agree() {
    let (mut warm_minors, mut cold_minors) = (0, 0);
    for (n, m) in [(18, 15), (18, 0), (30, 12), (48, 18)] {
        for seed in 0..10 {
            let mut warm = ActiveSet::new(n, m);
            for step in 0..10 {
                let problem = moving(seed, step, n, m);
                let (mut from_warm, mut from_cold) = (QpSolution::new(n, m), QpSolution::new(n, m));
                let warm_status = warm.solve(&problem.view(), &mut from_warm);
                let cold_status = ActiveSet::new(n, m).solve(&problem.view(), &mut from_cold);
                assert_eq!(
                    (warm_status, cold_status),
                    (QpStatus::Solved, QpStatus::Solved),
                    "{n} {m} {seed}"
                );
                let residuals = kkt_residuals(&problem.view(), &from_warm);
                assert!(residuals.worst_relative() < 1e-10, "{residuals:?}");
                for (a, b) in from_warm.x.iter().zip(&from_cold.x) {
                    assert!((a - b).abs() < 1e-10, "{n} {m} {seed} {step}: {a} {b}");
                }
                warm_minors += from_warm.minors;
                cold_minors += from_cold.minors;
            }
        }
    }
    println!("changes of the active set: warm {warm_minors}, cold {cold_minors}");
    assert!(warm_minors < cold_minors);
}

/// A robot that comes to rest: from many active bounds to the solution zero, whose gradient vanishes too.
#[test]
fn warm_start_into_rest() {
    for seed in 0..100 {
        for (damping, m) in [(1e-2, 15), (0.0, 15), (0.0, 0)] {
            let mut problem = ik_like(&mut Draw(seed), damping, 1.0);
            problem.m = m;
            problem.a.truncate(m * problem.n);
            problem.b = vec![0.0; m];
            problem.g.iter_mut().for_each(|g| *g *= 100.0);
            let mut solver = ActiveSet::new(problem.n, m);
            let mut out = QpSolution::new(problem.n, m);
            let unbounded = damping == 0.0 && m == 0;
            let moving = solver.solve(&problem.view(), &mut out);
            assert!(moving == QpStatus::Solved || unbounded, "{seed}: {moving:?}");
            problem.g.fill(0.0);
            assert_eq!(
                solver.solve(&problem.view(), &mut out),
                QpStatus::Solved,
                "{seed} {damping}"
            );
            let gradient = problem.view().objective(&out.x).abs().sqrt();
            assert!(gradient < 1e-15, "{seed}: {gradient:e}");
        }
    }
}

/// Without a fit the residual must be the least possible one: that of the reference on (1).
#[test]
fn lexicographic_finds_the_least_residual() {
    let mut improved = 0;
    for seed in 0..500 {
        let draw = &mut Draw(seed);
        let mut problem = ik_like(draw, 1e-2, if seed % 3 == 0 { 1e-16 } else { 1.0 });
        let row = draw.index(problem.m);
        problem.b[row] += if seed % 2 == 0 { 0.2 } else { 0.02 };
        let (n, m) = (problem.n, problem.m);
        let mut out = QpSolution::new(n, m);
        let outcome = Lexicographic::new(n, m).solve(&problem.view(), &mut out);
        assert_eq!(kkt_residuals(&problem.view(), &out).bound, 0.0, "{seed}");
        let residual = match outcome {
            Outcome::Solved => 0.0,
            Outcome::Relaxed { residual } => residual,
            Outcome::Failed(status) => panic!("{seed}: {status:?}"),
        };

        let fit = least_squares(&problem);
        let mut reference = QpSolution::new(n, 0);
        assert_eq!(
            ClarabelQp.solve(&fit.view(), &mut reference),
            QpStatus::Solved,
            "{seed}"
        );
        let least = norm(&difference(&problem.rows_at(&reference.x), &problem.b));
        assert!(
            (residual - least).abs() < 1e-6,
            "{seed}: {residual}, reference {least}"
        );
        let reached = norm(&difference(&problem.rows_at(&out.x), &problem.b));
        assert!(
            (residual - reached).abs() < 1e-10,
            "{seed}: claims {residual}, has {reached}"
        );

        // (2): no point with the same rows may be better by more than rounding.
        let mut met = problem.clone();
        met.b = problem.rows_at(&out.x);
        if ClarabelQp.solve(&met.view(), &mut reference) == QpStatus::Solved {
            let (ours, best) = (met.view().objective(&out.x), met.view().objective(&reference.x));
            improved += usize::from(ours <= best + 1e-7);
        } else {
            improved += 1;
        }
    }
    println!("lexicographic: {improved} of 500 minimal in the objective as well");
    assert!(improved >= 495);
}

fn least_squares(problem: &Problem) -> Problem {
    let (n, m) = (problem.n, problem.m);
    let column = |j: usize| &problem.a[j * m..][..m];
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let h = gram(&problem.a, m, n);
    let g = (0..n).map(|j| -dot(column(j), &problem.b)).collect();
    Problem {
        h,
        g,
        m: 0,
        a: Vec::new(),
        b: Vec::new(),
        ..problem.clone()
    }
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

#[test]
fn bad_input_is_reported_and_never_spreads() {
    let (good, _) = Problem::random(&mut Draw(7), 6, 3, 6, 1.0);
    let spoil: [fn(&mut Problem); 6] = [
        |p| p.h[7] = f64::NAN,
        |p| p.g[2] = f64::NAN,
        |p| p.a[4] = INF,
        |p| p.b[0] = f64::NAN,
        |p| p.lo[1] = f64::NAN,
        |p| p.b.push(0.0),
    ];
    let mut solver = ActiveSet::new(6, 3);
    let mut out = QpSolution::new(6, 3);
    for (case, spoil) in spoil.iter().enumerate() {
        let mut bad = good.clone();
        spoil(&mut bad);
        assert_eq!(
            solver.solve(&bad.view(), &mut out),
            QpStatus::Numerical,
            "case {case}"
        );
        assert!(out.x.iter().all(|x| x.is_finite()), "case {case}");
        assert_eq!(
            solver.solve(&good.view(), &mut out),
            QpStatus::Solved,
            "after case {case}"
        );
    }
}

#[test]
fn unbounded_objective_is_numerical() {
    let n = 3;
    let mut problem = Problem {
        n,
        m: 0,
        h: vec![0.0; n * n],
        g: vec![1.0, 0.0, -1.0],
        a: vec![],
        b: vec![],
        lo: vec![-INF; n],
        hi: vec![INF; n],
    };
    problem.h[0] = 1.0;
    let mut out = QpSolution::new(n, 0);
    assert_eq!(
        ActiveSet::new(n, 0).solve(&problem.view(), &mut out),
        QpStatus::Numerical
    );
    assert!(out.x.iter().all(|x| x.is_finite()));
}

/// One unknown, by hand: minimise 1/2 x² - 3 x in [0, 1] is x = 1 with z = 1 - 3 = -2.
#[test]
fn one_unknown_by_hand() {
    let qp = Qp {
        h: MatRef::new(&[1.0], 1, 1),
        g: &[-3.0],
        a: MatRef::new(&[], 0, 1),
        b: &[],
        lo: &[0.0],
        hi: &[1.0],
    };
    let mut out = QpSolution::new(1, 0);
    assert_eq!(ActiveSet::new(1, 0).solve(&qp, &mut out), QpStatus::Solved);
    assert_eq!((out.x[0], out.z[0]), (1.0, -2.0));
}
