//! Optimal motions: shooting, problems and their gradients.

mod cold_starts;
mod curvature;
mod gradients;
mod optima;
mod orders;
#[path = "../../crates/somersault-ocp/src/swing_up/sine.rs"]
mod sine;
mod swing_up;
mod systems;
mod table_a_1;
mod terms;
