//! What a differentiated run leaves, and why it may not.

use super::system::EventTime;
use crate::event::{Event, Interruption, Located};
use nalgebra::{DMatrix, Dyn, OMatrix, SMatrix, SVector, U12};
use somersault_integrators::state::{Pose, Twist};
use somersault_integrators::variation::Varied;

/// A motion and its derivative.
///
/// Rows and columns of the twelve are position (m), orientation (rad, the small rotation δφ in the world
/// frame, R_ε = exp(ε δφ̂) R), velocity (m/s) and angular velocity (rad/s), three components each.
#[derive(Debug, Clone)]
pub struct Sensitivities {
    /// The run, as [`integrate_hybrid`](crate::driver::integrate_hybrid) leaves it without sensitivities.
    pub run: Located<Pose>,
    /// Derivative of the state reached, at a fixed time, with respect to the initial state.
    pub state: SMatrix<f64, 12, 12>,
    /// Derivative of the state reached, at a fixed time, with respect to the parameters, one column each.
    pub parameters: OMatrix<f64, U12, Dyn>,
    /// Derivative of the times of the events, one column each in the order of `run.events`: twelve rows of
    /// the initial state, then the parameters; s per unit. Without events kept there is none. NaN at an event
    /// that changes nothing: a guard of a contact's friction that changes sign as the contact ends.
    pub event_times: DMatrix<f64>,
}

/// A touch-down without a derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grazing {
    /// When.
    pub t: f64,
    /// Which guard.
    pub guard: usize,
    /// Rate of the gap, m/s.
    pub rate: f64,
    /// Size of the rate up to which a touch-down is a graze, m/s.
    pub bound: f64,
}

/// Why a derivative cannot be had.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SensitivityError {
    /// The run did not reach its end.
    #[error(transparent)]
    Run(#[from] Interruption),
    /// The method is one for rigid bodies, or in other variables than those of the world.
    #[error("method `{method}` cannot integrate columns: take one for any system in world variables")]
    Method {
        /// The method.
        method: &'static str,
    },
    /// Steps without a bound, and Coulomb's friction.
    #[error("`max_step` must be finite where friction is Coulomb's, found infinity")]
    UnboundedStep,
    /// A parameter belongs to a contact that there is not.
    #[error("`parameters` must name one of the {contacts} contacts, found contact {found}")]
    NoSuchContact {
        /// The contact named.
        found: usize,
        /// Number of contacts.
        contacts: usize,
    },
    /// A coefficient of friction is asked for of a contact without friction.
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
        "guard {} is touched at t = {} with the rate {:e}, within {:e}: there is no derivative beyond",
        .0.guard, .0.t, .0.rate, .0.bound
    )]
    Grazing(Grazing),
}

/// A derivative that cannot be had, with the motion and the columns as far as they go.
///
/// After a graze they are those of the whole run, of the side on which it touches.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{reason}")]
pub struct Undifferentiated {
    /// Why.
    pub reason: SensitivityError,
    /// What was integrated.
    pub so_far: Sensitivities,
}

/// Reads the columns of a run, and finds the derivative of the time of each of its events.
pub(super) fn collect(run: Located<Varied<Pose, Twist>>, times: &[EventTime]) -> Sensitivities {
    let columns: Vec<SVector<f64, 12>> = run.state.columns().map(|column| column.components()).collect();
    let event = |event: Event<Varied<Pose, Twist>>| {
        let Event { t, guard, kind, impulse, state } = event;
        Event { t, guard, kind, impulse, state: state.base() }
    };
    let events: Vec<Event<Pose>> = run.events.into_iter().map(event).collect();
    let mut event_times = DMatrix::from_element(columns.len(), events.len(), f64::NAN);
    let mut rest = times;
    for (event, mut column) in events.iter().zip(event_times.column_iter_mut()) {
        let passed = rest.iter().take_while(|time| time.t < event.t).count();
        rest = &rest[passed..];
        let mut now = rest.iter().take_while(|time| time.t == event.t);
        if let Some(time) = now.find(|time| time.guard == event.guard) {
            column.copy_from_slice(&time.columns);
        }
    }
    Sensitivities {
        state: SMatrix::from_fn(|row, column| columns[column][row]),
        parameters: OMatrix::<f64, U12, Dyn>::from_fn(columns.len() - 12, |row, p| columns[12 + p][row]),
        event_times,
        run: Located {
            t: run.t,
            state: run.state.base(),
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
