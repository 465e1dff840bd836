//! Rigid bodies in contact. One program, so that every method is compiled for a body in contact once.

mod adaptive;
mod allocation;
mod bodies;
mod events;
mod falling_box;
mod friction;
mod hunt_crossley;
mod located_differences;
mod models;
mod orders;
mod sensitivity;
mod sensitivity_errors;
mod sensitivity_friction;
mod shots;
mod stiff;
mod surfaces;
mod taylor;
mod user_laws;

use somersault_testkit::allocations::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
