//! Optimal motions: shooting, problems and their gradients.

mod cold_starts;
mod curvature;
mod gradients;
mod optima;
mod orders;
#[path = "../../crates/somersault-ocp/src/swing_up/sine.rs"]
#[expect(dead_code, reason = "a file of the library with tests of what is no public name")]
mod sine;
mod swing_up;
mod systems;
mod table_a_1;
mod terms;
