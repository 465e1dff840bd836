//! Optimal motions: shooting, problems and their gradients.

mod cold_starts;
mod curvature;
mod gradients;
mod optima;
mod orders;
mod swing_up;
mod systems;
mod table_a_1;
mod terms;
