//! Optimal motions: shooting, problems and their gradients.

mod gradients;
mod swing_up;
mod systems;
mod table_a_1;
