//! Trees that touch: contacts of the links of a [`Model`](somersault_multibody::Model), in the same driver as those of bodies.
//!
//! ```text
//! M(q) v̇ + h(q, v) = τ + Σ Jᵢᵀ Fᵢ(gap, rate, sliding velocity, ξᵢ),    ξ̇ᵢ = …
//! ```
//! The force Fᵢ of a contact acts at its point as a wrench on its link, in the forward dynamics of the tree; surfaces, shapes
//! and laws are those of [`contacts`](crate::contacts) and [`laws`](crate::laws). The stretch ξ of each contact is part of the
//! state, beside the rates of the joints. Every method that moves trees takes a [`TreeInContact`], in fixed or adapted steps,
//! with located events.
//!
//! A surface stands in the world, or is carried by a body of the tree ([`LinkContact::on`]): a board on a spring, or a joint that
//! is [driven](somersault_multibody::motion::Driven). Platforms, tables and conveyors that move as functions of time are put beside
//! the tree by [`TreeOnPlatforms`]. The contacts of a box, a capsule, a cylinder or a sphere, and of what a robot's file collides
//! with, are made by [`shape_contacts`] and [`geometry_contacts`].
//!
//! # How a step is proved clear
//!
//! A contact moves no faster than √(2 (1/m + l²/I)) times the root of the energy E, with the mass m and the least principal
//! moment I of its link, whatever the joints do; and where nothing drives the tree, √E grows at √(M/2) g at most, M the mass of
//! the tree. So where the forces have a [potential](somersault_multibody::motion::TreeForces::potential) and no joint is driven,
//! steps whose gaps exceed that are *proved* clear. Where torques may give energy, near a surface, where accelerations
//! decide, in parts of a step in which no link turns by more than 0.1 rad, and for surfaces that a body carries, speeds and
//! accelerations are bounded along the chain from the rates of the joints at both ends of the step
//! ([`LinkBounds`](somersault_multibody::motion::LinkBounds)), |v_P| ≤ |v₀| + Σ |ωⱼ| lⱼ, with accelerations of the joints
//! estimated as twice those of the cubics through the ends. That is no proof; it fails where a step is too long for the
//! accelerations of the joints.
//!
//! ```
//! use nalgebra::{Matrix3, Vector3};
//! use somersault_contact::contacts::Contact;
//! use somersault_contact::event::EventKind;
//! use somersault_contact::laws::compliant::CompliantLaw;
//! use somersault_contact::surface::HalfSpace;
//! use somersault_contact::tree::{LinkContact, TreeInContact};
//! use somersault_integrators::{driver::TimeGrid, events::Location, methods::Method, run::Run};
//! use somersault_multibody::motion::TreeSystem;
//! use somersault_multibody::{Joint, Link, MassProperties, Model};
//! use std::sync::Arc;
//!
//! // A rod of 1 m on a hinge at a height of 0.5 m, whose tip falls to the ground.
//! let joint = Joint::Revolute { axis: Vector3::y() };
//! let rod = MassProperties { mass: 1.0, center: Vector3::x() * 0.5, inertia: Matrix3::identity() / 12.0 };
//! let mut builder = Model::builder();
//! builder.add(Link::root("rod", joint, rod).at(Vector3::z() * 0.5))?;
//! let model = builder.build()?;
//! let law = CompliantLaw::try_new(1e4, 5.0)?;
//! let tip = Contact::try_new(Vector3::x(), Arc::new(HalfSpace::ground()), law)?;
//! let tip = LinkContact::new("tip", "rod", tip);
//! let system = TreeInContact::try_new(TreeSystem::new(&model, ()), vec![tip], vec![])?;
//! let start = system.unstretched(model.state(&[0.0], &[0.0])?);
//! let grid = TimeGrid::try_new(0.0, 0.6, 1e-3)?;
//! let run = Run::new(&system, Method::Rkmk8, grid).locating(Location::default()).from(&start)?;
//! assert_eq!(run.events[0].kind, EventKind::TouchDown);
//! // By the energy: ½ (1/3) ω² = g/4 as the tip touches.
//! let speed = run.events[0].state.rate.base.as_slice()[0];
//! assert!((speed * speed - 1.5 * 9.81).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod contacts;
mod equilibrium;
mod geometry;
mod linearization;
mod linearized;
mod mesh;
mod platform;
mod report;
mod system;

pub use contacts::{LinkContact, LinkPair, TreeContacts};
pub use equilibrium::Equilibrium;
pub use geometry::{GeometryContacts, LeftOut, geometry_contacts, mesh_contacts, shape_contacts};
pub(crate) use linearization::LinkLinearization;
pub use linearization::TreeRoom;
pub use platform::{PlatformMotion, TreeOnPlatforms};
pub use report::{Ledger, MomentumLedger};
pub use system::{TouchingRate, TouchingState, TouchingWorkspace, TreeInContact};
