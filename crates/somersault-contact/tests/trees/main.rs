//! Trees that touch. One program, so that methods are compiled for a tree in contact once.

mod allocation;
mod bodies;
mod bounds;
mod carried;
mod drops;
mod energy;
mod geometry;
mod gradients;
mod light_feet;
mod models;
mod orders;
mod references;
mod report;
mod scenes;
mod shots;
mod slider;
mod standing;

use somersault_testkit::allocations::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
