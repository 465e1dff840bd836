//! Model bodies and trees with contacts: bodies are a [`BodyInContact`](crate::contacts::BodyInContact) under weight, trees the
//! parts of a [`TreeInContact`](crate::tree::TreeInContact).

use crate::error::ContactError;
use somersault_core::InertiaError;
use somersault_integrators::body::BodyError;

mod bouncing_ball;
mod falling_box;
mod hopping_leg;
mod rolling_disk;
mod sliding_block;
mod spinning_top;
mod tippe_top;

pub use bouncing_ball::BouncingBall;
pub use falling_box::FallingBox;
pub use hopping_leg::HoppingLeg;
pub use rolling_disk::RollingDisk;
pub use sliding_block::SlidingBlock;
pub use spinning_top::SpinningTop;
pub use tippe_top::TippeTop;

/// Why a model body cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// Its body cannot.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// Its contact cannot.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// Its tree cannot.
    #[error(transparent)]
    Tree(#[from] somersault_multibody::ModelError),
    /// A measure that the model does not allow.
    #[error("`{argument}` must lie between {low} and {high}, found {found}")]
    OutOfRange {
        /// Name of the argument.
        argument: &'static str,
        /// The value given.
        found: f64,
        /// Bound below.
        low: f64,
        /// Bound above.
        high: f64,
    },
}

impl From<InertiaError> for ModelError {
    fn from(error: InertiaError) -> Self {
        Self::Body(error.into())
    }
}

fn between(argument: &'static str, found: f64, low: f64, high: f64) -> Result<f64, ModelError> {
    if found > low && found < high {
        Ok(found)
    } else {
        Err(ModelError::OutOfRange { argument, found, low, high })
    }
}
