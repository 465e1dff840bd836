//! Motion of a tree: what the integrators of `somersault-integrators` move.
//!
//! ```text
//! q̇ = p,   ṗ = d/dt of the rates that belong to the joint accelerations M⁻¹(τ − h + Σ Jᵀ f_ext)
//! ```
//! The positions of all joints are one point of ℝᵐ × SO(3)ᵏ ([`Coordinates`]) and p its rate. For most
//! joints that is the joint velocity v itself. The linear parts of free and planar joints are taken in
//! the joint frame, which is fixed in the parent, instead of the axes of the child: ẋ = R v. So a body
//! that falls and spins keeps the two apart, and a uniform velocity of the whole changes no error.
//!
//! Every method for any system applies, with the order it has for forces that depend on velocity: on ℝ³
//! where no joint is spherical or free, on SO(3) under torque otherwise. Methods made for rigid bodies
//! are refused with [`IntegrateError::RigidBodiesOnly`]. Where the equations have no value a run ends with the
//! [`DynamicsError`] as its [`IntegrateError::Fault`].
//!
//! ```
//! use somersault_integrators::{driver::TimeGrid, methods::Method, run::Run};
//! use somersault_multibody::models::CartPendulum;
//! use somersault_multibody::motion::TreeSystem;
//!
//! let model = CartPendulum::default().model()?;
//! // A spring holds the cart.
//! let spring = |_: f64, q: &[f64], _: &[f64], torque: &mut [f64]| torque[0] -= 30.0 * q[0];
//! let system = TreeSystem::new(&model, spring);
//! let start = model.state(&[0.0, 0.1], &[0.0, 0.0])?;
//! let grid = TimeGrid::try_new(0.0, 2.0, 1e-3)?;
//! let end = Run::new(&system, Method::Rkmk, grid).from(&start)?;
//! assert!(end.state.configuration.as_slice()[1] > 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`IntegrateError::RigidBodiesOnly`]: somersault_integrators::driver::IntegrateError::RigidBodiesOnly
//! [`IntegrateError::Fault`]: somersault_integrators::driver::IntegrateError::Fault

mod bounds;
mod ensemble;
mod forces;
mod linearized;
mod profile;
#[cfg(feature = "rayon")]
mod rollout;
mod state;
mod system;
mod transposed;
mod variation;
mod workspace;

pub use crate::coordinates::{Coordinates, Rates};
pub use bounds::{LinkBound, LinkBounds, mobility_bound};
pub use ensemble::{EnsembleWorkspace, TreeEnsemble};
pub use forces::{BodyWrenches, Driven, JointDrive, TreeForces};
pub use profile::{Between, Knots, TorqueProfile};
#[cfg(feature = "rayon")]
pub use rollout::{HeldTorques, RolloutError, Rollouts, rollout};
pub use state::TreeState;
pub use system::{TreeDynamics, TreeSystem};
pub use transposed::TreeAdjoint;
pub use variation::TreeVariation;
pub use workspace::TreeWorkspace;

use crate::error::DynamicsError;
use somersault_integrators::system::Fault;
use std::sync::Mutex;

/// Where equations of motion that have no value leave the reason; what they return is NaN.
#[derive(Debug, Default)]
pub(crate) struct Failure(Mutex<Option<DynamicsError>>);

impl Failure {
    /// Keeps the reason in case of an error and says whether there was one.
    pub(crate) fn keep<T>(&self, result: Result<T, DynamicsError>) -> Option<T> {
        match result {
            Ok(value) => Some(value),
            Err(error) => {
                *self.slot() = Some(error);
                None
            }
        }
    }

    /// Takes the reason, if there is one.
    pub(crate) fn take(&self) -> Option<Fault> {
        self.slot().take().map(Fault::new)
    }

    fn slot(&self) -> std::sync::MutexGuard<'_, Option<DynamicsError>> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}
