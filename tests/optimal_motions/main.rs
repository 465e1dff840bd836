//! Optimal motions: shooting, problems and their gradients.

mod gradients;
mod systems;
