//! Rigid bodies and the methods that move them. One program, so that what all of them use is compiled once.

mod allocation;
mod bad_input;
mod batch;
mod conservation;
mod events;
mod exact;
mod implicit;
mod moser_veselov;
mod orders;
mod taylor;
mod thesis_tables;
mod watch;

use somersault_testkit::allocations::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
