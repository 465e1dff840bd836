#![doc = include_str!("../README.md")]
//!
//! # Features
//!
//! All but `serde` alone are on by default. Without them (`default-features = false`) there are core and integrators, which is all that
//! the example above needs.
//!
//! | Feature | What it adds |
//! |---|---|
//! | `rayon` | batches of bodies, rollouts of trees, studies of energy and stability, on all processors |
//! | `multibody` | trees of bodies |
//! | `robots` | robots from URDF and MJCF, and URDF written, with `multibody` |
//! | `contact` | compliant contact with located events |
//! | `nlp` | nonlinear programs and their solvers |
//! | `expr` | expression graphs: exact derivatives of any order |
//! | `ocp` | optimal motions; brings `multibody` and `nlp` |
//! | `dives` | optimal dives; brings `ocp` |
//! | `motion` | recorded motions; brings `multibody` |
//! | `ftla` | finite-time Lyapunov analysis; brings `expr` and `multibody` |
//! | `serde` | serde's traits for bodies, states, models and results |
//! | `storage` | versioned files, with `serde` |
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

#[cfg(feature = "contact")]
pub use somersault_contact as contact;
pub use somersault_core as core;
#[cfg(feature = "dives")]
pub use somersault_dives as dives;
#[cfg(feature = "expr")]
pub use somersault_expr as expr;
#[cfg(feature = "ftla")]
pub use somersault_ftla as ftla;
pub use somersault_integrators as integrators;
#[cfg(feature = "motion")]
pub use somersault_motion as motion;
#[cfg(feature = "multibody")]
pub use somersault_multibody as multibody;
#[cfg(feature = "nlp")]
pub use somersault_nlp as nlp;
#[cfg(feature = "ocp")]
pub use somersault_ocp as ocp;

#[cfg(feature = "storage")]
pub mod storage;

/// What most programs need.
pub mod prelude {
    pub use somersault_core::{Inertia, lie::so3};
    pub use somersault_integrators::body::RigidBody;
    pub use somersault_integrators::driver::{
        Adaptive, Flow, Observer, Outcome, Status, Step, Steps, TimeGrid,
    };
    pub use somersault_integrators::exact::FreeBody;
    pub use somersault_integrators::force::{
        ConstantForce, ConstantTorque, Drag, ForceModel, Gravity, Spring, Wrench,
    };
    pub use somersault_integrators::methods::{Method, Options, StartUp};
    pub use somersault_integrators::nalgebra::{UnitQuaternion, Vector3};
    pub use somersault_integrators::run::Run;
    pub use somersault_integrators::solution::{Recorder, Solution};
    pub use somersault_integrators::state::{RigidBodyState, State};
    pub use somersault_integrators::stepper::{MethodInfo, Scheme, Stepper};
    pub use somersault_integrators::system::{OneForm, RigidBodySystem, System};
}
