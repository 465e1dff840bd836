#![doc = include_str!("../README.md")]
//!
//! # How it works
//!
//! Dives are the optimal motions of thesis chapter 3, and others like them, as programs with a search of their own.
//!
//! ```math
//! \min\ \frac{a}{2} \left( \frac{L}{L_0} \right)^2 + \frac12 \int_0^T \sum_i \left( b\, \dot w_i^2 + c\, \ddot w_i^2 \right) dt
//! ```
//! subject to ψ(T) = somersaults, φ = twists and τ = 0 at the square-out, and at all times w ≥ 0 and Σ w ≤ 1 (or joints within
//! their ranges) and capsules apart. The unknowns are the free spline parameters p, the angular momentum L about the lateral axis, and, where they are
//! given a range, the lean at take-off and the duration T. L₀ = m h²/(1 s). The diver begins in one posture and ends
//! in another, both at rest in their joints. Flight is reduced by its momentum ([`flight`]), so L is constant
//! to rounding and the centre of mass stays on its parabola; platform, entry and duration give its velocity at
//! take-off.
//!
//! After the square-out the diver moves symmetrically and without tilt, so that twists, a multiple of ½, and tilt stay as they
//! are. A pike amplifies what tilt it begins with; so the orientation restarts there, without tilt and with the twist requested
//! ([`OrientationPath::with_restart`](flight::OrientationPath::with_restart)), and what is left of both is the
//! defect that the constraints remove.
//!
//! A dive that was found is flown by the full equations ([`DiveReport`]): it is a success where the program is solved and that
//! flight has the counts requested, agrees with the nodes, and keeps limbs apart at all times.
//!
//! In space the search is Newton's: quasi-Newton steps creep along the valley of nearly equal twisting dives. The Hessian of the
//! Lagrangian is made convex without a change of the steps that constraints allow.
//!
//! The long axis of the body is the line from the centre of mass of its feet to that of its hands in the last posture,
//! fixed in the torso; somersaults, tilt and twists are counted with it ([`Counting`](somersault_multibody::counting::Counting)).
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

mod body;
mod bounds;
mod capsule;
mod clearance;
mod cost;
mod dive;
mod error;
pub mod flight;
mod literal;
mod mirror;
mod modelled;
mod motion;
mod named;
mod nearest;
mod program;
mod report;
mod search;
mod template;

pub use body::Body;
pub use capsule::{Capsule, NearestPoints, nearest_points};
pub use dive::{Channels, Clearance, Dive, Penalties, Range};
pub use error::DiveError;
pub use literal::{LiteralDive, momentum_along};
pub use mirror::mirror_image;
pub use motion::{DiveMotion, PeakTorque};
pub use nalgebra;
pub use program::DiveProgram;
pub use report::{ALLOWED, DiveJudgementError, DiveReport, Nearest};
pub use search::{DiveSearch, DiveSearchError};
pub use template::KeyFrame;
