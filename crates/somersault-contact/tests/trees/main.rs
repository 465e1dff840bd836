//! Trees that touch. One program, so that methods are compiled for a tree in contact once.

mod allocation;
mod bodies;
mod bounds;
mod carried;
mod drops;
mod energy;
mod gradients;
mod orders;
mod report;
mod scenes;
mod shots;
mod slider;

use somersault_testkit::allocations::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
