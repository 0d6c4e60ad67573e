//! Dense QP kernels: time of one solve, problem data ready.
//!
//! The problems have the shape of a differential-IK step: H = Jᵀ J + 0.01 I with three compromised rows, hard
//! rows of norm 0.1..1, the first six unknowns free, a narrow box on the rest. `cold` forgets the active set
//! before every solve, `warm` alternates between two neighbouring problems and keeps it.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ik_methods::qp::{
    ActiveSet, ClarabelQp, Lexicographic, MatRef, Outcome, Qp, QpSolution, QpSolver, QpStatus,
};

/// SplitMix64 (Steele, Lea & Flood 2014).
struct Draw(u64);

impl Draw {
    /// Uniform in [-size, size).
    fn within(&mut self, size: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 * size - size
    }

    fn vector(&mut self, len: usize, size: f64) -> Vec<f64> {
        (0..len).map(|_| self.within(size)).collect()
    }
}

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
    /// `soft` rows of the objective pull with `pull`; the box is 0.02 wide on either side.
    fn new(seed: u64, n: usize, m: usize, soft: usize, pull: f64) -> Self {
        let mut draw = Draw(seed);
        let jacobian = draw.vector(soft * n, 1.0);
        let target = draw.vector(soft, pull);
        let row = |r: usize, j: usize| jacobian[r + j * soft];
        let mut h: Vec<f64> = (0..n * n)
            .map(|index| (0..soft).map(|r| row(r, index % n) * row(r, index / n)).sum())
            .collect();
        (0..n).for_each(|i| h[i * (n + 1)] += 0.01);
        let g = (0..n)
            .map(|j| -(0..soft).map(|r| row(r, j) * target[r]).sum::<f64>())
            .collect();
        let a = draw.vector(m * n, 0.3);
        let met = draw.vector(n, 0.002);
        let b = (0..m)
            .map(|r| (0..n).map(|j| a[r + j * m] * met[j]).sum())
            .collect();
        let lo = (0..n)
            .map(|j| if j < 6 { f64::NEG_INFINITY } else { -0.02 })
            .collect();
        let hi = (0..n).map(|j| if j < 6 { f64::INFINITY } else { 0.02 }).collect();
        Self {
            n,
            m,
            h,
            g,
            a,
            b,
            lo,
            hi,
        }
    }

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

    fn active(&self) -> usize {
        let mut out = QpSolution::new(self.n, self.m);
        assert_eq!(
            ActiveSet::new(self.n, self.m).solve(&self.view(), &mut out),
            QpStatus::Solved
        );
        out.z.iter().filter(|z| z.abs() > 0.0).count()
    }

    /// First seeded problem of this shape with `active` active bounds.
    fn with_active(active: usize, n: usize, m: usize, soft: usize) -> Self {
        let pull = if active == 0 { 0.001 } else { 0.05 };
        (0..10_000)
            .map(|seed| Self::new(seed, n, m, soft, pull))
            .find(|problem| {
                let mut out = QpSolution::new(n, m);
                let status = ActiveSet::new(n, m).solve(&problem.view(), &mut out);
                status == QpStatus::Solved && problem.active() == active
            })
            .expect("10 000 draws hold every small number of active bounds")
    }

    /// The same problem a little later: objective and rows moved by a part in a thousand.
    fn next(&self) -> Self {
        let moved = |v: &[f64]| v.iter().map(|v| v * 1.001).collect();
        Self {
            h: self.h.clone(),
            a: self.a.clone(),
            g: moved(&self.g),
            b: moved(&self.b),
            ..Self::new(0, self.n, 0, 1, 0.0)
        }
        .with_rows(self.m)
    }

    fn with_rows(mut self, m: usize) -> Self {
        self.m = m;
        self
    }
}

fn cold(c: &mut Criterion, name: &str, problem: &Problem, solver: &mut dyn QpSolver) {
    let mut out = QpSolution::new(problem.n, problem.m);
    c.benchmark_group("kernels")
        .bench_function(format!("qp/{name}"), |bencher| {
            bencher.iter(|| {
                solver.reset();
                assert_eq!(
                    solver.solve(&black_box(problem.view()), &mut out),
                    QpStatus::Solved
                );
                out.x[0]
            });
        });
}

fn warm(c: &mut Criterion, name: &str, problem: &Problem) {
    let pair = [problem.next(), problem.next().next()];
    let mut solver = ActiveSet::new(problem.n, problem.m);
    let mut out = QpSolution::new(problem.n, problem.m);
    let mut turn = 0;
    c.benchmark_group("kernels")
        .bench_function(format!("qp/{name}"), |bencher| {
            bencher.iter(|| {
                turn = 1 - turn;
                assert_eq!(
                    solver.solve(&black_box(pair[turn].view()), &mut out),
                    QpStatus::Solved
                );
                out.x[0]
            });
        });
}

/// Rows that the box cannot follow: infeasible verdict, least-residual fit, objective.
fn relaxed(c: &mut Criterion) {
    let mut problem = Problem::with_active(0, 18, 15, 3);
    problem.b[4] += 0.2;
    let mut solver = Lexicographic::new(problem.n, problem.m);
    let mut out = QpSolution::new(problem.n, problem.m);
    c.benchmark_group("kernels")
        .bench_function("qp/n18_m15_relaxed_warm", |bencher| {
            bencher.iter(|| {
                let outcome = solver.solve(&black_box(problem.view()), &mut out);
                assert!(matches!(outcome, Outcome::Relaxed { .. }));
                out.x[0]
            });
        });
}

fn all(c: &mut Criterion) {
    for active in [0, 1, 2] {
        let problem = Problem::with_active(active, 18, 15, 3);
        cold(
            c,
            &format!("n18_m15_active{active}_cold"),
            &problem,
            &mut ActiveSet::new(18, 15),
        );
        warm(c, &format!("n18_m15_active{active}_warm"), &problem);
    }
    for active in [0, 3] {
        let problem = Problem::with_active(active, 18, 0, 6);
        cold(
            c,
            &format!("n18_m0_active{active}_cold"),
            &problem,
            &mut ActiveSet::new(18, 0),
        );
        warm(c, &format!("n18_m0_active{active}_warm"), &problem);
    }
    let large = Problem::with_active(6, 48, 18, 12);
    cold(c, "n48_m18_active6_cold", &large, &mut ActiveSet::new(48, 18));
    warm(c, "n48_m18_active6_warm", &large);
    relaxed(c);
    cold(
        c,
        "n18_m15_active2_clarabel",
        &Problem::with_active(2, 18, 15, 3),
        &mut ClarabelQp,
    );
}

criterion_group!(benches, all);
criterion_main!(benches);
