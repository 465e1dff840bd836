//! Expression graphs: values, derivatives, tapes and lanes.

mod dual;
mod functions;
mod lanes;
mod operations;
mod random;
mod recorded;

#[allow(clippy::approx_constant)] // arguments and values that are near constants are not those
mod digits;

use somersault_testkit::allocations::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
