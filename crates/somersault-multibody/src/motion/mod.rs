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
//! are refused with [`IntegrateError::RigidBodiesOnly`].
//!
//! ```
//! use somersault_integrators::{driver::TimeGrid, methods::{Method, Options}};
//! use somersault_multibody::models::CartPendulum;
//! use somersault_multibody::motion::{TreeMotion, TreeSystem};
//!
//! let model = CartPendulum::default().model()?;
//! // A spring holds the cart.
//! let spring = |_: f64, q: &[f64], _: &[f64], torque: &mut [f64]| torque[0] -= 30.0 * q[0];
//! let system = TreeSystem::new(&model, spring);
//! let start = model.state(&[0.0, 0.1], &[0.0, 0.0])?;
//! let grid = TimeGrid::try_new(0.0, 2.0, 1e-3)?;
//! let end = system.integrate(Method::Rkmk, Options::default(), &start, &grid, &mut ())?;
//! assert!(end.state.configuration.as_slice()[1] > 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod forces;
mod state;
mod system;
mod workspace;

pub use crate::coordinates::{Coordinates, Rates};
pub use forces::{BodyWrenches, Driven, JointDrive, TreeForces};
pub use state::TreeState;
pub use system::{TreeDynamics, TreeSystem};
pub use workspace::TreeWorkspace;

use crate::error::DynamicsError;
use somersault_integrators::driver::{Adaptive, IntegrateError, Observer, Outcome, TimeGrid};
use somersault_integrators::methods::{Method, Options};
use somersault_integrators::stepper::StepError;
use somersault_integrators::system::System;
use std::sync::Mutex;

/// Why a motion could not start or could not go on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionError {
    /// The integrator.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// The equations of motion have no value, for what reason says the source.
    #[error("in the step at t = {t}: {source}")]
    Dynamics {
        /// Start or end of the step, as the integrator reports it.
        t: f64,
        /// What was wrong.
        source: DynamicsError,
    },
}

/// Where equations of motion that have no value leave the reason; what they return is NaN.
#[derive(Debug, Default)]
pub struct Failure(Mutex<Option<DynamicsError>>);

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

    fn take(&self) -> Option<DynamicsError> {
        self.slot().take()
    }

    fn slot(&self) -> std::sync::MutexGuard<'_, Option<DynamicsError>> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

/// A system of this crate: it integrates itself and says why it could not.
pub trait TreeMotion: System<Configuration = Coordinates> {
    /// Where it leaves the reason of a failure.
    fn failure(&self) -> &Failure;

    /// Integrates over a grid of times with a fixed step, see
    /// [`integrate`](somersault_integrators::driver::integrate).
    fn integrate(
        &self,
        method: Method,
        options: Options,
        initial: &TreeState,
        grid: &TimeGrid,
        observer: &mut dyn Observer<Coordinates>,
    ) -> Result<Outcome<Coordinates>, MotionError> {
        self.failure().take();
        let run = method.integrate_system(options, &self, initial, grid, observer);
        run.map_err(|error| self.explain(error))
    }

    /// Integrates with steps adapted to tolerances, see
    /// [`integrate_adaptive`](somersault_integrators::driver::integrate_adaptive).
    fn integrate_adaptive(
        &self,
        method: Method,
        options: Options,
        initial: &TreeState,
        interval: (f64, f64),
        control: &Adaptive,
        observer: &mut dyn Observer<Coordinates>,
    ) -> Result<Outcome<Coordinates>, MotionError> {
        self.failure().take();
        let run = method.integrate_system_adaptive(options, &self, initial, interval, control, observer);
        run.map_err(|error| self.explain(error))
    }

    /// Puts the reason of a failure in the place of what it led to.
    fn explain(&self, error: IntegrateError) -> MotionError {
        let t = match &error {
            IntegrateError::NonFinite { t } => *t,
            IntegrateError::Step(StepError::NotConverged { t, residual, .. }) if residual.is_nan() => *t,
            _ => return error.into(),
        };
        self.failure().take().map_or(error.into(), |source| MotionError::Dynamics { t, source })
    }
}
