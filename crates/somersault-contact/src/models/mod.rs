//! Model bodies and trees with contacts: bodies are a [`BodyInContact`](crate::contacts::BodyInContact) under weight, trees
//! a [`TreeContactSystem`], the parts of a [`TreeInContact`].

use crate::error::ContactError;
use crate::tree::{LinkContact, TreeInContact};
use somersault_core::InertiaError;
use somersault_integrators::body::BodyError;
use somersault_multibody::motion::TreeSystem;
use somersault_multibody::urdf::UrdfError;
use somersault_multibody::{DynamicsError, Model};

mod bouncing_ball;
mod falling_box;
mod hopping_leg;
mod planar;
mod planar_biped;
mod quadruped;
mod ragdoll;
mod rolling_disk;
mod sliding_block;
mod spinning_top;
mod springboard;
mod tippe_top;
mod tree_system;

pub use bouncing_ball::BouncingBall;
pub use falling_box::FallingBox;
pub use hopping_leg::HoppingLeg;
pub use planar_biped::PlanarBiped;
pub use quadruped::Quadruped;
pub use ragdoll::Ragdoll;
pub use rolling_disk::RollingDisk;
pub use sliding_block::SlidingBlock;
pub use spinning_top::SpinningTop;
pub use springboard::Springboard;
pub use tippe_top::TippeTop;
pub use tree_system::{JointActuator, JointActuators, TreeContactSystem};

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
    /// Its tree has no such body or state.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// The file of its robot cannot be read.
    #[error(transparent)]
    Robot(#[from] UrdfError),
    /// A joint that an actuator cannot drive.
    #[error("the joint of `{body}` must have one degree of freedom, found {found}")]
    Joint {
        /// Name of the body.
        body: String,
        /// Its degrees of freedom.
        found: usize,
    },
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

/// The least gap of the contacts of a tree at rest, m.
fn lowest(model: &Model, contacts: &[LinkContact], q: &[f64]) -> Result<f64, ModelError> {
    let bare = TreeInContact::try_new(TreeSystem::new(model, ()), contacts.to_vec(), vec![])?;
    let x = bare.unstretched(model.state(q, &vec![0.0; model.n_velocities()])?);
    Ok(bare.touches(&x).iter().fold(f64::INFINITY, |least, touch| least.min(touch.gap)))
}
