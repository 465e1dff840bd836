//! Trees that touch. One program, so that methods are compiled for a tree in contact once.

mod scenes;

use somersault_testkit::allocations::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
