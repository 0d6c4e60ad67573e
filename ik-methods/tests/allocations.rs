//! `step` allocates nothing, for every method that says so.

#![allow(
    clippy::unwrap_used,
    missing_docs,
    unsafe_code,
    reason = "a counting global allocator in a test binary"
)]

mod common;

use common::legs;
use ik_core::boundary::Boundary;
use ik_core::driver::{Driver, StepInput};
use ik_core::objective::Objective;
use ik_core::problem::PhaseId;
use ik_core::step::Window;
use ik_methods::registry::METHODS;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on to the system allocator unchanged; the counter is a thread-local without destructor.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.with(|n| n.set(n.get() + 1));
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static GLOBAL: Counting = Counting;

/// A squat through the straight knee and back with a rolling torso: active bounds, relaxed rows, line searches.
fn sample(k: u32) -> Vec<f64> {
    let t = f64::from(k) * 0.01;
    let mut x = vec![0.0, 0.0, 0.52 + 0.06 * (3.0 * t).sin()];
    for y in [0.0726, -0.0726] {
        x.extend([0.0, y, 0.0, 0.0, 0.0, 0.0]);
    }
    x.extend([0.2 * (4.0 * t).sin(), 0.0, 0.0]);
    let mut xdot = vec![0.0; 18];
    xdot[2] = 0.18 * (3.0 * t).cos();
    xdot[15] = 0.8 * (4.0 * t).cos();
    [x, xdot].concat()
}

#[test]
fn a_step_allocates_nothing_where_it_is_promised() {
    let objectives = vec![
        Objective::JointCentring,
        Objective::GravityTorque { weights: None },
    ];
    let problem = legs(Boundary::Ellipse { margin: 0.0 }, vec![1.0, 2.0, 3.0], objectives);
    let mut promised = 0;
    for entry in METHODS {
        let variants: &[&str] = match entry.info().id {
            "ik2" => &["", "inner = 'cg'"],
            "ik4" => &["", "start = 'plain'", "start = 'curvature'", "rows = 'literal'"],
            "ik5" => &["", "start = 'curvature'"],
            "davies" => &[
                "",
                "integrator = 'rk4'\nfeed_forward = 'given'",
                "orientation = 'euler-rates'",
                "damping = 0.01",
            ],
            "clik" => &[
                "",
                "inverse = 'damped'",
                "inverse = 'truncated'\ncorrection = 0.5",
            ],
            _ => &[""],
        };
        for variant in variants {
            let contestant = entry.build(&variant.parse().unwrap()).unwrap();
            let mut driver = Driver::new(&*contestant.formulation, &problem).unwrap();
            if !driver.honours().allocation_free {
                continue;
            }
            promised += 1;
            let mut q = problem.robot().neutral();
            q[2] = 0.51;
            let mut v = vec![0.0; 18];
            let samples: Vec<f64> = (0..=220).flat_map(sample).collect();
            for k in 1..=220 {
                let input = StepInput {
                    q_prev: &q,
                    v_prev: &v,
                    dt_s: 0.01,
                    phase: PhaseId(0),
                    targets: Window::new(&samples[(k - 1) * 36..(k + 1) * 36], 18, 18).unwrap(),
                    gains: &[0.1, 1e-4],
                };
                let majors = driver.majors();
                let before = ALLOCATIONS.with(Cell::get);
                driver.step(&input, majors);
                let after = ALLOCATIONS.with(Cell::get);
                assert_eq!(
                    after - before,
                    0,
                    "{} {variant} allocates in step {k}",
                    contestant.id
                );
                driver.increment_into(&q, &mut v);
                v.iter_mut().for_each(|v| *v /= 0.01);
                q.copy_from_slice(&driver.solution().q);
            }
        }
    }
    assert!(promised >= 5, "the formulations of the paper promise it");
}
