//! **SYNTHETIC** dives with **SYNTHETIC** scores: perturbed optimal dives, a stated judge, marker noise.
//!
//! No set of judged dives is public. So that training and scoring can be shown from end to end, this module
//! makes one, and labels it: types are named synthetic, files say SYNTHETIC, and motions, models and
//! validations made of it carry the label on
//! ([`Performance::is_synthetic`](crate::scoring::Performance::is_synthetic)). **What is learnt from it says
//! nothing about dives or judges.**
//!
//! ```text
//! flight ── perturbation, seeded ──→ dives ── faults ── judge + noise ──→ scores
//!                                      └── markers + noise ──→ performances
//! ```
//! A flight is any motion of a tree in the air, configuration by configuration: an optimal dive of
//! `somersault-dives`, or a fitted recording. Its joint motion s(u), u the fraction of the duration T, is perturbed
//! in what it departs by from the straight way between its end postures, its fold F:
//!
//! ```text
//! s(u) = s₀ + (s₁ − s₀) u + F(u)
//! s̃(u) = s₀ + (s₁ − s₀) u + (1 − ℓ + A sin(2π f T̃ u + φ)) (1 ± a) F(u − β(u)),    T̃ = (1 + d) T
//! ```
//! with looseness ℓ, wobble of amplitude A and frequency f, asymmetry a (plus right, minus left) and a delay β
//! of the exit, that rises smoothly from the middle of the fold to its whole at the exit, the last time at
//! which ‖F‖ is half its greatest value, and falls to zero at the end. Postures at both ends stay. The flight
//! is then flown again: angular momentum is conserved ([`flight`](somersault_multibody::flight)), and its size
//! is found by which the root turns as far as in the given flight and by the over-rotation farther. A loose
//! pike thus spins with more momentum, as a diver's would who corrects at take-off; what is not corrected is
//! the over-rotation. The centre of mass flies from where it began to where it ended.
//!
//! The judge is [`SyntheticJudge`], with its formula.

mod curve;
mod judge;
mod markers;
mod perturbation;
mod perturbed;
mod set;

pub use judge::SyntheticJudge;
pub use markers::synthetic_markers;
pub use perturbation::Perturbation;
pub use perturbed::{SyntheticDive, SyntheticFlight};
pub use set::{SyntheticOptions, SyntheticSet};

use crate::analysis::AnalysisError;
use crate::fit::FitError;
use crate::recording::RecordingError;
use crate::scoring::ScoringError;
use somersault_core::argument::ArgumentError;
use somersault_integrators::driver::IntegrateError;
use somersault_multibody::DynamicsError;
use somersault_multibody::flight::FlightError;

/// Why there is no synthetic dive.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SyntheticError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The caller said that it is not to continue.
    #[error("making synthetic dives was interrupted")]
    Interrupted,
    /// The joints do not leave the straight way between their ends: there is nothing to perturb.
    #[error(
        "the joints of `positions` move straight from their first posture to their last: there is no fold to perturb"
    )]
    NoFold,
    /// The exit cannot be moved that far without going back in the motion.
    #[error("`exit_delay` must lie between {least} s and {greatest} s in this flight, found {found} s")]
    ExitDelay {
        /// Found, s.
        found: f64,
        /// The earliest, s.
        least: f64,
        /// The latest, s.
        greatest: f64,
    },
    /// The root does not turn.
    #[error("the flight has no angular momentum that could be changed")]
    NoMomentum,
    /// No angular momentum was found that turns the root as far as requested.
    #[error(
        "no angular momentum from {} to {} times the flight's was found to lead to the rotation requested; the best of \
         those tried misses it by {miss} rad", 1.0 - .reach, 1.0 + .reach
    )]
    NotAimed {
        /// How far the multiples that were tried are from 1.
        reach: f64,
        /// What is missing, rad.
        miss: f64,
    },
    /// A joint is not of one coordinate.
    #[error("joints of perturbed flights have one coordinate each, but that of `{body}` has {found}")]
    JointOfManyCoordinates {
        /// The body it carries.
        body: String,
        /// Its coordinates.
        found: usize,
    },
    /// Times or configurations.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A configuration is not the model's.
    #[error(transparent)]
    Model(#[from] DynamicsError),
    /// The model cannot fly.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// The flight stops early.
    #[error(transparent)]
    Motion(#[from] IntegrateError),
    /// Markers are not the model's.
    #[error(transparent)]
    Markers(#[from] FitError),
    /// The faults of a dive do not exist.
    #[error(transparent)]
    Faults(#[from] AnalysisError),
    /// The dives cannot be scored.
    #[error(transparent)]
    Scoring(#[from] ScoringError),
}
