//! What a differentiated run leaves, and why it may not.

use super::grazing::Grazing;
use crate::error::ContactError;
use crate::event::EventKind;
use crate::surface::SurfaceFault;
use nalgebra::{DMatrix, Dyn, OMatrix, SMatrix, U12, Vector3};
use somersault_integrators::augmented::Augmented;
use somersault_integrators::events::{Interruption, Located};
use somersault_integrators::state::Pose;
use somersault_multibody::DynamicsError;
use somersault_multibody::motion::Coordinates;

/// A motion and its derivative.
///
/// Rows and columns of the twelve are position (m), orientation (rad, the small rotation δφ in the world
/// frame, R_ε = exp(ε δφ̂) R), velocity (m/s) and angular velocity (rad/s), three components each.
#[derive(Debug, Clone)]
pub struct Sensitivities {
    /// The run, as a [`Run`](somersault_integrators::run::Run) that locates events leaves it without sensitivities.
    pub run: Located<Pose, EventKind>,
    /// Derivative of the state reached, at a fixed time, with respect to the initial state.
    pub state: SMatrix<f64, 12, 12>,
    /// Derivative of the state reached, at a fixed time, with respect to the parameters, one column each.
    pub parameters: OMatrix<f64, U12, Dyn>,
    /// Derivative of the times of the events, laid out as `state` and `parameters` side by side: one row for each
    /// event, in the order of `run.events`, and one column for each component of the initial state, then for each
    /// parameter; s per unit. Without events kept it has no rows. NaN at an event that changes nothing: a guard
    /// of a contact's friction that changes sign as the contact ends.
    pub event_times: DMatrix<f64>,
    /// Stretches of the contacts' friction in the state reached, m.
    pub stretches: Vec<Vector3<f64>>,
}

/// A motion of a tree and its derivative.
///
/// With n degrees of freedom rows and columns of the 2 n are the motions of the joints along q ⊕ ε e_k, as in the
/// [partials](somersault_multibody::Partials) of dynamics, then the changes of their velocities v.
#[derive(Debug, Clone)]
pub struct TreeSensitivities {
    /// The run, as a [`Run`](somersault_integrators::run::Run) that locates events leaves it without sensitivities.
    pub run: Located<Augmented<Coordinates>, EventKind>,
    /// Derivative of the state reached, at a fixed time, with respect to the initial state, 2 n × 2 n.
    pub state: DMatrix<f64>,
    /// Derivative of the state reached, at a fixed time, with respect to the parameters, one column each.
    pub parameters: DMatrix<f64>,
    /// Derivative of the times of the events, as of [`Sensitivities::event_times`].
    pub event_times: DMatrix<f64>,
}

/// Why a derivative cannot be had.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SensitivityError {
    /// The run did not reach its end.
    #[error(transparent)]
    Run(#[from] Interruption<SurfaceFault>),
    /// The method is one for rigid bodies only, or in angular momentum.
    #[error(
        "method `{method}` cannot integrate columns: take one for any system, in the variables of the world or of the body"
    )]
    Method {
        /// The method.
        method: &'static str,
    },
    /// Stretches at the start that do not fit the contacts.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// A parameter belongs to a contact that there is not.
    #[error("`parameters` must name one of the {contacts} contacts, found contact {found}")]
    NoSuchContact {
        /// The contact named.
        found: usize,
        /// Number of contacts.
        contacts: usize,
    },
    /// The law of the contact has no parameter of that name.
    #[error("`parameters` must name one of {allowed:?} of the {law} of contact {contact}, found {found:?}")]
    NoSuchParameter {
        /// The contact.
        contact: usize,
        /// The type of its law.
        law: &'static str,
        /// The name given.
        found: String,
        /// The names that there are.
        allowed: &'static [&'static str],
    },
    /// A joint force of no degree of freedom.
    #[error("`parameters` must name a degree of freedom below {n}, found the force of {found}")]
    NoJoint {
        /// Number of degrees of freedom.
        n: usize,
        /// The one that was named.
        found: usize,
    },
    /// A knot that there is not.
    #[error("`parameters` must name a knot below {n}, found {found}")]
    NoKnot {
        /// Number of knots.
        n: usize,
        /// The one that was named.
        found: usize,
    },
    /// A parameter of the tree that there is not, or that accelerations have no derivative by.
    #[error("`parameters`: {0}")]
    Tree(#[from] DynamicsError),
    /// Joints are driven otherwise than by accelerations, and the derivative of such a drive is unknown.
    #[error("the joints are driven otherwise than by accelerations: there is no derivative")]
    Drive,
    /// A method whose steps the adjoint cannot transpose.
    #[error("a gradient by the adjoint takes an explicit Runge-Kutta method, found `{method}`")]
    NoAdjoint {
        /// The method.
        method: &'static str,
    },
    /// A run whose record exceeds the memory.
    #[error("there is not enough memory to record {steps} steps")]
    NoRoom {
        /// Steps made, or to be made.
        steps: u64,
    },
    /// A backward pass that was stopped.
    #[error("the backward pass was stopped at t = {t}")]
    Stopped {
        /// The time reached, s.
        t: f64,
    },
    /// A gradient with numbers that are not finite.
    #[error(
        "the gradient is not finite: a law has no derivative where the motion goes, or a number is too large"
    )]
    NonFinite,
    /// A parameter that the system does not have.
    #[error("`parameters` must name what {of} has, found {found}")]
    NotOf {
        /// The parameter.
        found: String,
        /// The system.
        of: &'static str,
    },
    /// A law that does not say how its force changes.
    #[error("the {law} of contact {contact} has no derivative")]
    NoDerivative {
        /// The contact.
        contact: usize,
        /// The type of its law.
        law: &'static str,
    },
    /// A constant of friction is requested of a contact without friction.
    #[error("`parameters` names the friction of contact {contact}, which has none")]
    NoFriction {
        /// The contact.
        contact: usize,
    },
    /// The start lies on a surface that it is about to enter: next to it are starts with and without the
    /// force of contact.
    #[error("`initial` lies on the surface of contact {guard}: there is no derivative with respect to it")]
    StartOnSurface {
        /// Which guard.
        guard: usize,
    },
    /// The motion grazes a surface.
    #[error(
        "contact {} is grazed at t = {}, with a least gap of {:e} m within {:e} m: there is no derivative, and that kept is one-sided, of motions that {}",
        .0.guard, .0.t, .0.gap, .0.bound, .0.side
    )]
    Grazing(Grazing),
    /// A capsule or a box touches with friction, and its nearest point passes from one of its parts to another: the plane of contact,
    /// with which the stretch of friction turns, changes the rate at which it turns at once.
    #[error(
        "the nearest point of contact {contact} passes to another part of its shape at t = {t}, under friction: there is no derivative, and that kept leaves out the jump there"
    )]
    Feature {
        /// Which contact.
        contact: usize,
        /// The end of the step in which it happens, s.
        t: f64,
    },
}

/// A derivative that cannot be had, with the motion and the columns as far as they go.
///
/// After a graze they are the one-sided derivatives of the whole run, on the [`Side`](super::Side) on which it is; after a change of
/// [`Feature`](SensitivityError::Feature) those of the whole run without the jump there.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{reason}")]
pub struct Undifferentiated<S = Sensitivities> {
    /// Why.
    pub reason: SensitivityError,
    /// What was integrated.
    pub so_far: S,
}
