//! Direct collocation at Legendre–Gauss–Radau points.
mod entries;
mod error;
mod function;
mod guess;
mod layout;
mod mesh;
mod problem;
pub mod radau;
mod transcription;
mod tree;

pub use error::CollocationError;
pub use function::{Dynamics, Ends, Point, Terms, VectorFunction};
pub use guess::Guess;
pub use mesh::Mesh;
pub use problem::{End, Interval, Linkage, Phase, Place, Problem, Quantity};
pub use radau::Radau;
pub use transcription::Transcription;
pub use tree::TreeDynamics;
