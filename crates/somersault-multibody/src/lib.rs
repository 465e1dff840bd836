#![doc = include_str!("../README.md")]
//!
//! # How it works
//!
//! The equations of motion of a tree under joint forces τ and external wrenches are
//!
//! ```math
//! M(q)\, a + h(q, v) = \tau + \sum_i J_i(q)^T f_i
//! ```
//! A [`Model`] is a tree of bodies, immutable; a [`Data`] is the workspace in which the algorithms
//! leave their results. They cost O(n) or O(n × depth), the partials of forward dynamics O(n² × depth); they
//! allocate nothing and are generic over the scalar, so that dual numbers go through them. Many states of one tree are
//! computed in the lanes of vector instructions ([`Model::forward_dynamics_many`],
//! [`Model::forward_dynamics_partials_many`]) and move as one system
//! ([`motion::TreeEnsemble`]).
//!
//! | Symbol | Meaning | Here |
//! |---|---|---|
//! | q | configuration, a point of the product of the joints' groups | `&[T]`, length [`Model::n_positions`] |
//! | v, a | velocity and acceleration, in the axes of each joint's child | `&[T]`, length [`Model::n_velocities`] |
//! | τ | joint forces, dual to v: power is τ·v | `&[T]` |
//! | q ⊕ v | motion of every joint by the exponential of its group | [`Model::displace`] |
//! | M, h | mass matrix and bias: M a + h = τ + Σ Jᵀ f_ext | [`Model::mass_matrix`], [`Model::bias`] |
//! | S | motion subspace of a joint, constant in the child | table in [`joint`] |
//! | (v, ω), (f, n) | spatial motion and force, linear part first | [`Motion`], [`Force`] |
//!
//! Body velocities and wrenches are in body axes at the body's origin, which is the origin of its
//! joint frame. SI units; angles in rad. Quaternions are stored x, y, z, w and must be of unit norm
//! ([`Model::normalize`]).
//!
//! Trees are built in code ([`ModelBuilder`]), read from model files (`urdf`, `mjcf`), or have a name in the
//! literature ([`models`]).
//! [`motion`] makes a tree a system for the integrators of `somersault-integrators`; [`flight`] is the
//! short way for a tree in the air whose joints move as prescribed. [`joint_motion`] has motions of joints with
//! parameters, splines and eigenpostures; [`counting`] reads somersaults, tilt and twists from the orientation of a root.
//!
//! Not meant for closed loops of joints. Trees that touch are in `somersault-contact`.
//!
//! Source: R. Featherstone, *Rigid Body Dynamics Algorithms*, Springer 2008.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

mod articulated;
mod builder;
mod centroidal;
mod configuration;
mod coordinates;
pub mod counting;
mod coupled;
mod coupling;
mod crba;
mod data;
mod derivatives;
mod error;
pub mod flight;
pub mod geometry;
mod independent;
mod inertia;
pub mod joint;
pub mod joint_motion;
mod kinematics;
mod lane_room;
mod link;
mod many;
mod mimic;
#[cfg(feature = "robots")]
pub mod mjcf;
mod model;
pub mod models;
pub mod motion;
mod rnea;
#[cfg(feature = "robots")]
pub mod robot;
mod spatial;
mod triples;
#[cfg(feature = "robots")]
pub mod urdf;

pub use articulated::Split;
pub use builder::ModelBuilder;
pub use centroidal::Centroidal;
pub use data::Data;
pub use derivatives::{DerivativeData, MomentumPartials, Partials, SecondDerivativeData, TreeParameter};
pub use error::{DynamicsError, ModelError};
pub use inertia::SpatialInertia;
pub use joint::{Group, Joint, JointKind, Turning};
pub use kinematics::{Accelerations, Axes, Positions, Velocities};
pub use link::{Link, MassProperties};
pub use many::{LaneData, LaneDerivativeData};
pub use mimic::Mimic;
pub use model::Model;
pub use nalgebra;
pub use spatial::{Force, Motion, Transform};
