//! Articulated bodies. One program, so that the kernels are compiled for each scalar once.

mod allocation;
mod derivatives;
mod dynamics;
mod flight;
mod mimic;
mod mjcf;
mod models;
mod motion;
mod urdf;

use somersault_testkit::allocations::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
