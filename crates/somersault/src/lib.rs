//! Motion of rigid and articulated bodies: geometric integration with evidence.
//!
//! ```
//! use somersault::prelude::*;
//!
//! // A box that tumbles freely for ten seconds.
//! let body = RigidBody::try_box(1.0, Vector3::new(0.2, 0.4, 0.6))?;
//! let system = RigidBodySystem::free(body);
//! let start = RigidBodyState::spinning(Vector3::new(1.0, 2.0, 3.0));
//! let grid = TimeGrid::try_new(0.0, 10.0, 0.01)?;
//! let end = Method::Rkmk.integrate(Options::default(), &system, &start, &grid, &mut ())?;
//! assert_eq!(end.t, 10.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub use somersault_contact as contact;
pub use somersault_core as core;
pub use somersault_ftla as ftla;
pub use somersault_integrators as integrators;
pub use somersault_motion as motion;
pub use somersault_multibody as multibody;
pub use somersault_nlp as nlp;
pub use somersault_ocp as ocp;

pub mod storage;

/// What most programs need.
pub mod prelude {
    pub use somersault_core::{Inertia, so3};
    pub use somersault_integrators::body::RigidBody;
    pub use somersault_integrators::driver::{
        Adaptive, Flow, Observer, Outcome, Status, Step, TimeGrid, integrate, integrate_adaptive,
    };
    pub use somersault_integrators::exact::FreeBody;
    pub use somersault_integrators::force::{
        ConstantForce, ConstantTorque, Drag, ForceModel, Gravity, Spring, Wrench,
    };
    pub use somersault_integrators::methods::{Method, Options, StartUp};
    pub use somersault_integrators::nalgebra::{UnitQuaternion, Vector3};
    pub use somersault_integrators::solution::{Recorder, Solution};
    pub use somersault_integrators::state::{RigidBodyState, State};
    pub use somersault_integrators::stepper::{MethodInfo, Scheme, Stepper};
    pub use somersault_integrators::system::{RigidBodySystem, System};
}
