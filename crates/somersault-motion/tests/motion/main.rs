//! Tests of recorded motions, as one program.

mod advice;
mod allocation;
mod analysis;
mod dialects;
mod files;
mod fitting;
mod groups;
mod hostile;
mod identification;
mod inertia;
mod judged;
mod keypoints;
mod phases;
mod readers;
mod reconstruction;
mod recorded;
mod scaling;
mod scoring;
mod smoothing;
mod synthetic;
mod writers;

use somersault_testkit::allocations::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
