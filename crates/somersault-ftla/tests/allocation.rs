//! Runs of the flow allocate nothing.

mod common;

use common::START;
use nalgebra::SVector;
use somersault_ftla::flow::{Chain, Tolerances, VariationalFlow};
use somersault_ftla::system::ArmMinimumTorque;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Counts the allocations of each thread.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    // While a thread ends the counter may be gone.
    let _ = ALLOCATIONS.try_with(|n| n.set(n.get() + 1));
}

// SAFETY: every call is passed on to the system's allocator; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn runs_allocate_nothing() {
    let arm = ArmMinimumTorque::default();
    let flow =
        VariationalFlow::try_new(&arm, Tolerances { relative: 1e-9, absolute: 1e-11 }).expect("in range");
    let p = SVector::from(START);
    let mut chain = Chain::new();
    let times = [1.0, 2.0, 3.0];
    // the first call reads the tableau and makes room in the chain
    flow.chain_into(&p, &times, 100.0, &mut chain).expect("regular");
    let before = ALLOCATIONS.get();
    flow.transition(&p, 2.0).expect("regular");
    flow.state(&p, -0.5).expect("regular");
    flow.cost(&p, 1.0).expect("regular");
    flow.chain_into(&p, &times, 100.0, &mut chain).expect("regular");
    assert_eq!(ALLOCATIONS.get() - before, 0);
}
