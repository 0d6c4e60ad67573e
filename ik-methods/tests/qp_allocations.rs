//! The active-set solvers allocate nothing after construction.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use ik_methods::qp::{ActiveSet, Lexicographic, MatRef, Outcome, Qp, QpSolution, QpSolver, QpStatus};

/// Counts what this thread allocates, so that the test harness does not disturb the count.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

#[allow(
    unsafe_code,
    reason = "the trait of global allocators is unsafe; both calls are passed on unchanged"
)]
// SAFETY: every request goes to the system allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn allocations_of(work: impl FnOnce()) -> usize {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

/// Numbers in [-size, size] without structure.
fn numbers(len: usize, seed: f64, size: f64) -> Vec<f64> {
    (0..len)
        .map(|i| size * ((i as f64 + seed) * 12.9898 + (i * i % 97) as f64).sin())
        .collect()
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations_of(|| drop(std::hint::black_box(vec![0.0; 8]))), 1);
}

#[test]
fn solves_do_not_allocate() {
    let (n, m) = (18, 15);
    let jacobian = numbers(3 * n, 0.1, 1.0);
    let gram = |i: usize, j: usize| {
        (0..3)
            .map(|r| jacobian[r + 3 * i] * jacobian[r + 3 * j])
            .sum::<f64>()
    };
    let a = numbers(m * n, 0.2, 0.3);
    let wide = numbers(m, 0.3, 1.0);
    let (lo, hi) = (vec![-0.02; n], vec![0.02; n]);
    for damping in [0.01, 0.0] {
        let h: Vec<f64> = (0..n * n)
            .map(|i| gram(i % n, i / n) + if i % (n + 1) == 0 { damping } else { 0.0 })
            .collect();
        let mut solver = ActiveSet::new(n, m);
        let mut lexicographic = Lexicographic::new(n, m);
        let mut out = QpSolution::new(n, m);
        let mut changes = 0;
        let count = allocations_of(|| {
            for step in 0..20 {
                let mut g = [0.0; 18];
                g.iter_mut()
                    .enumerate()
                    .for_each(|(i, g)| *g = 0.05 * ((i * step) as f64).sin());
                let reachable = Qp {
                    h: MatRef::new(&h, n, n),
                    g: &g,
                    a: MatRef::new(&a, m, n),
                    b: &[0.0; 15],
                    lo: &lo,
                    hi: &hi,
                };
                let free = Qp {
                    a: MatRef::new(&[], 0, n),
                    b: &[],
                    ..reachable
                };
                let out_of_reach = Qp {
                    b: &wide,
                    ..reachable
                };
                assert_eq!(solver.solve(&reachable, &mut out), QpStatus::Solved);
                assert_eq!(solver.solve(&free, &mut out), QpStatus::Solved);
                changes += out.minors;
                assert_eq!(solver.solve(&out_of_reach, &mut out), QpStatus::Infeasible);
                assert!(matches!(
                    lexicographic.solve(&out_of_reach, &mut out),
                    Outcome::Relaxed { .. }
                ));
                assert_eq!(lexicographic.solve(&reachable, &mut out), Outcome::Solved);
                solver.reset();
            }
        });
        assert_eq!(count, 0, "allocations with damping {damping}");
        assert!(changes > 20, "the problems must exercise the active set");
    }
}
