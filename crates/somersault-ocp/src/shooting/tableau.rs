//! A step as a tableau of moves.
//!
//! With displacements δ = h Σ f_i v_i of the passive positions, v_i the velocities at the stages, stage s starts from the
//! position of an earlier one, q_s = q_from ⊕ δ, and the end of the step is q₀ ⊕ δ ⊕ δ′; velocities add up as usual. With one
//! stage and one move this is explicit Euler.

use super::phase::Scheme;

/// Factors of the stages.
pub(super) type Factors = [f64; 4];

/// The moves and sums of a step, in units of h.
pub(super) struct Tableau {
    /// Of each stage but the first.
    pub(super) stages: &'static [Inner],
    /// Moves one after the other.
    pub(super) end: &'static [Factors],
    pub(super) end_velocity: Factors,
}

/// How a stage is reached.
pub(super) struct Inner {
    /// The stage from whose position it is reached.
    pub(super) from: usize,
    pub(super) position: Factors,
    /// From the velocity at the start of the step.
    pub(super) velocity: Factors,
}

const EULER: Tableau =
    Tableau { stages: &[], end: &[[1.0, 0.0, 0.0, 0.0]], end_velocity: [1.0, 0.0, 0.0, 0.0] };

const COMMUTATOR_FREE: Tableau = Tableau {
    stages: &[
        Inner { from: 0, position: [0.5, 0.0, 0.0, 0.0], velocity: [0.5, 0.0, 0.0, 0.0] },
        Inner { from: 0, position: [0.0, 0.5, 0.0, 0.0], velocity: [0.0, 0.5, 0.0, 0.0] },
        Inner { from: 1, position: [-0.5, 0.0, 1.0, 0.0], velocity: [0.0, 0.0, 1.0, 0.0] },
    ],
    end: &[
        [3.0 / 12.0, 2.0 / 12.0, 2.0 / 12.0, -1.0 / 12.0],
        [-1.0 / 12.0, 2.0 / 12.0, 2.0 / 12.0, 3.0 / 12.0],
    ],
    end_velocity: [1.0 / 6.0, 2.0 / 6.0, 2.0 / 6.0, 1.0 / 6.0],
};

impl Scheme {
    pub(super) fn tableau(self) -> &'static Tableau {
        match self {
            Self::ExplicitEuler => &EULER,
            Self::RungeKutta4 => &COMMUTATOR_FREE,
        }
    }
}
