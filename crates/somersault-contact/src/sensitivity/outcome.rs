//! What a differentiated run leaves, and why it may not.

use super::grazing::Grazing;
use super::system::{EventTime, VariedPose};
use crate::error::ContactError;
use crate::event::EventKind;
use crate::surface::SurfaceFault;
use nalgebra::{DMatrix, Dyn, OMatrix, SMatrix, SVector, U12, Vector3};
use somersault_integrators::events::{Event, Interruption, Located};
use somersault_integrators::state::Pose;

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
}

/// A derivative that cannot be had, with the motion and the columns as far as they go.
///
/// After a graze they are the one-sided derivatives of the whole run, on the [`Side`](super::Side) on which it is.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{reason}")]
pub struct Undifferentiated {
    /// Why.
    pub reason: SensitivityError,
    /// What was integrated.
    pub so_far: Sensitivities,
}

/// Reads the columns of a run, and finds the derivative of the time of each of its events.
pub(super) fn collect(run: Located<VariedPose, EventKind>, times: &[EventTime]) -> Sensitivities {
    let columns: Vec<SVector<f64, 12>> = run.state.columns().map(|column| column.components()).collect();
    let event = |event: Event<VariedPose, EventKind>| {
        let Event { t, guard, kind, impulse, state } = event;
        Event { t, guard, kind, impulse, state: state.body() }
    };
    let events: Vec<Event<Pose, EventKind>> = run.events.into_iter().map(event).collect();
    let mut event_times = DMatrix::from_element(events.len(), columns.len(), f64::NAN);
    let mut rest = times;
    for (event, mut row) in events.iter().zip(event_times.row_iter_mut()) {
        let passed = rest.iter().take_while(|time| time.t < event.t).count();
        rest = &rest[passed..];
        let mut now = rest.iter().take_while(|time| time.t == event.t);
        if let Some(time) = now.find(|time| time.guard == event.guard) {
            row.iter_mut().zip(&time.columns).for_each(|(entry, time)| *entry = *time);
        }
    }
    Sensitivities {
        state: SMatrix::from_fn(|row, column| columns[column][row]),
        parameters: OMatrix::<f64, U12, Dyn>::from_fn(columns.len() - 12, |row, p| columns[12 + p][row]),
        event_times,
        stretches: run.state.rate.base.variables.clone(),
        run: Located {
            t: run.t,
            state: run.state.body(),
            status: run.status,
            steps: run.steps,
            rejected: run.rejected,
            trials: run.trials,
            substeps: run.substeps,
            event_count: run.event_count,
            events,
        },
    }
}
