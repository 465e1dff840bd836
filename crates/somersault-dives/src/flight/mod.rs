//! Flight of a dive, reduced by its momentum.
//!
//! In the air nothing of a tree's state is free but its orientation: the centre of mass keeps to its parabola and
//! the angular momentum to its value ([`somersault_multibody::flight`]). So of the passive states one rotation is
//! left to integrate, and momentum is exact at every node whatever the step. An [`OrientationPath`] has the exact derivatives
//! of its steps, first and second.

mod path;

pub(crate) use path::{COEFFICIENTS, MOMENTUM, NodeExpansion, START};
pub use path::{NodeDerivatives, OrientationPath, PathGradient};
