//! Sensitivities: the derivative of a motion through its events.
//!
//! Between events the columns of the derivative obey the variational equations; see
//! [`somersault_integrators::variation`] for the frames. At an event where a guard g ends mode − and mode +
//! begins, the time of the event moves with the motion and the columns jump by the *saltation matrix*:
//! ```text
//! δt = −(∇g · δ + ∂g/∂p)/ġ,      δ⁺ = δ⁻ − (f⁺ − f⁻) δt,      ġ = ∇g · f⁻ + ∂g/∂t,
//! ```
//! with the equations of motion f before and after at the state of the event, which is itself continuous.
//! Under the law (7.10) the force jumps at a touch-down by −c Δẋ along the normal, and since position and
//! orientation do not jump, only δv and δω do. At a release and a re-engagement the force is continuous:
//! there the columns do not jump. Points that touch down at once jump one after the other; their guards'
//! rates are continuous, so that the order does not matter.
//!
//! The columns are integrated beside the state by the same method in the same steps, cut at the same events:
//! they have the method's own order, and the motion is to the bit what it is without them.
//!
//! **Where there is no derivative.** A point that touches its surface with no speed is touched or missed by
//! motions next to it: the derivative from one side differs from that from the other unless c = 0. Such a
//! run ends in [`SensitivityError::Grazing`], which keeps what was integrated; the columns are then those of
//! the side on which it touches. A graze that just misses is no event and is not seen.
//!
//! M. A. Aizerman and F. R. Gantmakher, *On the stability of periodic motions*, J. Appl. Math. Mech. 22
//! (1958) 1065; I. A. Hiskens and M. A. Pai, *Trajectory sensitivity analysis of hybrid systems*, IEEE Trans.
//! Circuits Syst. I 47 (2000) 204; M. di Bernardo, C. Budd, A. Champneys and P. Kowalczyk,
//! *Piecewise-smooth Dynamical Systems* (2008), section 2.5.

mod contact;
mod law;
mod system;

pub use system::{Variational, VariedState};

use system::{EventTime, Log};

use crate::contacts::BodyInContact;
use crate::driver::integrate_hybrid;
use crate::event::{Event, Interruption, Located, Location};
use crate::friction::Friction;
use crate::hybrid::Frozen;
use nalgebra::{DMatrix, Dyn, OMatrix, SMatrix, SVector, U12, Vector3};
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Observer, Status, TimeGrid, check_positive};
use somersault_integrators::force::{ForceModel, Wrench};
use somersault_integrators::state::{Pose, RigidBodyState, Twist};
use somersault_integrators::stepper::Stepper;
use somersault_integrators::variation::{Tangent, Varied};
use std::fmt;
use std::sync::Arc;

/// Derivative of a wrench with respect to a parameter, as a function of time, body and state.
pub type WrenchDerivative = dyn Fn(f64, &RigidBody, &RigidBodyState) -> Wrench + Send + Sync;

/// A constant of the equations of motion.
#[derive(Clone)]
#[non_exhaustive]
pub enum Parameter {
    /// The stiffness of a contact's normal law: k, N/m or N/m^{3/2}.
    Stiffness(usize),
    /// The damping of a contact's normal law: c, N s/m, or α, s/m.
    Damping(usize),
    /// μ of a contact.
    Friction(usize),
    /// The mass, kg, with the inertia kept.
    Mass,
    /// A factor on the inertia, at 1, with the mass kept. A body of other density has m times the column of
    /// the mass and once this.
    InertiaScale,
    /// A constant of the smooth forces, by the derivative of their wrench with respect to it.
    Force(Arc<WrenchDerivative>),
}

impl Parameter {
    /// A uniform acceleration in units of `direction` (m/s²): with a unit vector, a component of gravity.
    pub fn uniform_acceleration(direction: Vector3<f64>) -> Self {
        Self::Force(Arc::new(move |_, body, _| Wrench {
            force: direction * body.mass(),
            torque: Vector3::zeros(),
        }))
    }

    fn contact(&self) -> Option<usize> {
        match self {
            Self::Stiffness(contact) | Self::Damping(contact) | Self::Friction(contact) => Some(*contact),
            _ => None,
        }
    }
}

impl fmt::Debug for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stiffness(contact) => write!(f, "Stiffness({contact})"),
            Self::Damping(contact) => write!(f, "Damping({contact})"),
            Self::Friction(contact) => write!(f, "Friction({contact})"),
            Self::Mass => write!(f, "Mass"),
            Self::InertiaScale => write!(f, "InertiaScale"),
            Self::Force(_) => write!(f, "Force"),
        }
    }
}

/// What to differentiate by, beyond the initial state, and when not to.
#[derive(Debug, Clone)]
pub struct Differentiation {
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// A touch-down within this part of a step, in time, of where the gap would be least, |Δẋ| ≤ `grazing`
    /// |Δẍ| dt, is a graze.
    ///
    /// The default, 1e-6, is met only by motions that touch to rounding; a larger one warns of derivatives
    /// that hold only for small changes: up to Δẋ²/(2|Δẍ|) of the gap.
    pub grazing: f64,
}

impl Default for Differentiation {
    fn default() -> Self {
        Self { parameters: Vec::new(), grazing: 1e-6 }
    }
}

impl Differentiation {
    /// By these parameters, with the default bound on grazing.
    pub fn by(parameters: impl Into<Vec<Parameter>>) -> Self {
        Self { parameters: parameters.into(), ..Self::default() }
    }
}

/// A motion and its derivative.
///
/// Rows and columns of the twelve are position (m), orientation (rad, the small rotation δφ in the world
/// frame, R_ε = exp(ε δφ̂) R), velocity (m/s) and angular velocity (rad/s), three components each.
#[derive(Debug, Clone)]
pub struct Sensitivities {
    /// The run, as [`integrate_hybrid`] leaves it without sensitivities.
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

/// Integrates a body in contact with a fixed step, locating events, and the derivative of its state with
/// respect to the initial state and to parameters.
///
/// The observer sees every committed step with its columns: the twelve of the initial state, then the
/// parameters.
///
/// Errors keep the solution: those of [`integrate_hybrid`], which also end runs whose columns stop being
/// finite, a parameter of a contact that there is not, and grazing.
///
/// Cost: about 3 times a run without.
pub fn integrate_with_sensitivities<F, M, O>(
    stepper: &M,
    system: &BodyInContact<F>,
    initial: &RigidBodyState,
    differentiation: &Differentiation,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut O,
) -> Result<Sensitivities, Box<Undifferentiated>>
where
    F: ForceModel,
    M: for<'a> Stepper<Frozen<Variational<'a, F>>>,
    O: Observer<Varied<Pose, Twist>>,
{
    let parameters = &differentiation.parameters;
    let columns = (0..12 + parameters.len()).map(Tangent::unit);
    let start = VariedState::varied(*initial, columns);
    let grazing_time = differentiation.grazing * grid.dt();
    let variational = Variational::new(system, parameters, grazing_time, location.keep_events, &start);
    let frozen = Frozen::new(variational, grid.time(0), &start);
    let run = match refusal(system, differentiation, initial) {
        None => integrate_hybrid(&frozen, stepper, &start, grid, location, observer)
            .map_err(|interrupted| (interrupted.reason.into(), interrupted.so_far)),
        Some(reason) => Err((reason, not_started(grid.time(0), start))),
    };
    let Log { times, grazing } = frozen.system().log.take();
    match (run, grazing) {
        (Ok(run), None) => Ok(sensitivities(run, &times)),
        (Ok(run), Some(grazing)) => Err((SensitivityError::Grazing(grazing), run)),
        (Err(error), _) => Err(error),
    }
    .map_err(|(reason, run)| Box::new(Undifferentiated { reason, so_far: sensitivities(run, &times) }))
}

/// Why a run is not begun.
fn refusal<F: ForceModel>(
    system: &BodyInContact<F>,
    differentiation: &Differentiation,
    initial: &RigidBodyState,
) -> Option<SensitivityError> {
    if let Err(error) = check_positive("grazing", differentiation.grazing) {
        return Some(Interruption::from(error).into());
    }
    let contacts = &system.forces.1;
    for parameter in &differentiation.parameters {
        let Some(found) = parameter.contact() else { continue };
        let Some(contact) = contacts.get(found) else {
            return Some(SensitivityError::NoSuchContact { found, contacts: contacts.len() });
        };
        if matches!(parameter, Parameter::Friction(_)) && contact.law().friction == Friction::None {
            return Some(SensitivityError::NoFriction { contact: found });
        }
    }
    contacts.iter().enumerate().find_map(|(guard, contact)| {
        let at = contact.encounter(&system.body, initial);
        (at.gap == 0.0 && at.rate <= 0.0 && contact.law().normal.jumps())
            .then_some(SensitivityError::StartOnSurface { guard })
    })
}

fn not_started(t: f64, state: VariedState) -> Located<Varied<Pose, Twist>> {
    let status = Status::Stopped;
    Located { t, state, status, steps: 0, trials: 0, event_count: 0, events: Vec::new() }
}

fn sensitivities(run: Located<Varied<Pose, Twist>>, times: &[EventTime]) -> Sensitivities {
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
            trials: run.trials,
            event_count: run.event_count,
            events,
        },
    }
}
