//! One binary for all tests of the crate, which instantiate and link the same code.

mod allocation;
mod common;
mod diagnosis;
mod extended;
mod extremals;
mod flow;
mod flows;
mod limits;
mod matching;
mod placement;
mod posed;
mod spectrum;
mod success;
mod system;

use somersault_testkit::allocations::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
