//! Direct collocation at Legendre–Gauss–Radau points.
mod confirmation;
mod entries;
mod error;
mod function;
mod guess;
mod layout;
mod mesh;
mod problem;
pub mod radau;
mod refinement;
mod solution;
mod solve;
mod transcription;
mod tree;
mod vector;

pub use confirmation::{Confirmation, PhaseConfirmation, confirm};
pub use error::CollocationError;
pub use function::{Dynamics, Ends, Point, Terms, VectorFunction};
pub use guess::Guess;
pub use mesh::Mesh;
pub use problem::{End, Interval, Linkage, Phase, Place, Problem, Quantity};
pub use radau::Radau;
pub use solution::PhaseSolution;
pub use solve::{Collocation, CollocationReport, CollocationStatus, MeshRecord};
pub use transcription::Transcription;
pub use tree::TreeDynamics;
