//! Integrating state and columns together.

use super::outcome::{Sensitivities, SensitivityError, Undifferentiated, collect};
use super::parameter::{Differentiation, Parameter};
use super::system::{Log, Variational, VariedState};
use crate::contacts::{BodyInContact, Contact};
use crate::driver::{LocatedResult, integrate_hybrid, integrate_hybrid_adaptive};
use crate::event::{Interruption, Located, Location};
use crate::friction::Friction;
use crate::hybrid::Frozen;
use somersault_integrators::driver::{Adaptive, Observer, TimeGrid, check_positive};
use somersault_integrators::force::ForceModel;
use somersault_integrators::methods::{Method, Options, SystemVisitor};
use somersault_integrators::state::{Pose, RigidBodyState, Twist};
use somersault_integrators::stepper::{EmbeddedStepper, Stepper};
use somersault_integrators::variation::{Tangent, Varied};

/// A body in contact with columns, frozen in a mode: what steppers see.
pub type FrozenVariational<'a, F> = Frozen<Variational<'a, F>>;

/// The outcome of a run with sensitivities.
pub type SensitivityResult = Result<Sensitivities, Box<Undifferentiated>>;

/// Integrates a body in contact by a method of the table, with a fixed step, locating events, and the
/// derivative of its state with respect to the initial state and to parameters.
///
/// The method must be one for any system, in world variables. The observer sees every committed step with
/// its columns: the twelve of the initial state, then the parameters.
///
/// Errors keep the solution: those of [`integrate_located`](crate::driver::integrate_located), which also
/// end runs whose columns stop being finite, a parameter of a contact or of friction that there is not, a
/// start on a surface, and grazing.
///
/// Cost: one and a half to two runs without columns for each column (the spinning top by `rkmk8` and `rkmk`),
/// which is what central differences take.
pub fn differentiate_located<'a, F, O>(
    method: Method,
    options: Options,
    system: &'a BodyInContact<F>,
    initial: &RigidBodyState,
    differentiation: &'a Differentiation,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut O,
) -> SensitivityResult
where
    F: ForceModel,
    O: Observer<Varied<Pose, Twist>>,
{
    let visit = Visit { system, initial, differentiation, grid, location, observer };
    method.visit_system(options, visit).unwrap_or_else(|| {
        let reason = SensitivityError::Method { method: method.info().name };
        Err(refused(reason, grid.time(0), &start(initial, differentiation)))
    })
}

/// The same by any stepper; see [`differentiate_located`].
pub fn differentiate_hybrid<'a, F, M, O>(
    stepper: &M,
    system: &'a BodyInContact<F>,
    initial: &RigidBodyState,
    differentiation: &'a Differentiation,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut O,
) -> SensitivityResult
where
    F: ForceModel,
    M: Stepper<FrozenVariational<'a, F>>,
    O: Observer<Varied<Pose, Twist>>,
{
    let interval = (grid.time(0), grid.time(grid.steps()));
    differentiate(system, initial, differentiation, interval, grid.dt(), location, |frozen, start| {
        integrate_hybrid(frozen, stepper, start, grid, location, observer)
    })
}

/// The same by any stepper that estimates its error, with steps adapted to tolerances; see
/// [`differentiate_located`].
///
/// The steps are those of the motion without columns, whose errors are not weighed. With Coulomb's friction
/// `settings.max_step` must be finite: it is the time over which columns settle before a stop.
pub fn differentiate_hybrid_adaptive<'a, F, M, O>(
    stepper: &M,
    system: &'a BodyInContact<F>,
    initial: &RigidBodyState,
    differentiation: &'a Differentiation,
    interval: (f64, f64),
    settings: &Adaptive,
    location: &Location,
    observer: &mut O,
) -> SensitivityResult
where
    F: ForceModel,
    M: EmbeddedStepper<FrozenVariational<'a, F>>,
    O: Observer<Varied<Pose, Twist>>,
{
    let has_stops = |contact: &Contact| matches!(contact.law().friction, Friction::Coulomb(_));
    if settings.max_step == f64::INFINITY && system.forces.1.iter().any(has_stops) {
        let reason = SensitivityError::UnboundedStep;
        return Err(refused(reason, interval.0, &start(initial, differentiation)));
    }
    differentiate(system, initial, differentiation, interval, settings.max_step, location, |frozen, start| {
        integrate_hybrid_adaptive(frozen, stepper, start, interval, settings, location, observer)
    })
}

struct Visit<'a, 'b, F, O> {
    system: &'a BodyInContact<F>,
    initial: &'b RigidBodyState,
    differentiation: &'a Differentiation,
    grid: &'b TimeGrid,
    location: &'b Location,
    observer: &'b mut O,
}

impl<'a, F, O> SystemVisitor<FrozenVariational<'a, F>> for Visit<'a, '_, F, O>
where
    F: ForceModel,
    O: Observer<Varied<Pose, Twist>>,
{
    type Output = SensitivityResult;

    fn visit<M: Stepper<FrozenVariational<'a, F>>>(self, stepper: M) -> SensitivityResult {
        let Self { system, initial, differentiation, grid, location, observer } = self;
        differentiate_hybrid(&stepper, system, initial, differentiation, grid, location, observer)
    }
}

/// The initial state with its columns.
fn start(initial: &RigidBodyState, differentiation: &Differentiation) -> VariedState {
    VariedState::varied(*initial, (0..12 + differentiation.parameters.len()).map(Tangent::unit))
}

fn refused(reason: SensitivityError, t: f64, start: &VariedState) -> Box<Undifferentiated> {
    Box::new(Undifferentiated { reason, so_far: collect(Located::at_start(t, start), &[]) })
}

fn differentiate<'a, F: ForceModel>(
    system: &'a BodyInContact<F>,
    initial: &RigidBodyState,
    differentiation: &'a Differentiation,
    interval: (f64, f64),
    largest_step: f64,
    location: &Location,
    run: impl FnOnce(&FrozenVariational<'a, F>, &VariedState) -> LocatedResult<Varied<Pose, Twist>>,
) -> SensitivityResult {
    let start = start(initial, differentiation);
    if let Some(reason) = refusal(system, differentiation, initial) {
        return Err(refused(reason, interval.0, &start));
    }
    let times = (differentiation.grazing * (interval.1 - interval.0), largest_step);
    let parameters = &differentiation.parameters;
    let variational = Variational::new(system, parameters, times, location.keep_events, &start);
    let frozen = Frozen::new(variational, interval.0, &start);
    let run = run(&frozen, &start);
    let Log { times, grazing } = frozen.system().log.take();
    match (run, grazing) {
        (Ok(run), None) => Ok(collect(run, &times)),
        (Ok(run), Some(grazing)) => Err((SensitivityError::Grazing(grazing), run)),
        (Err(interrupted), _) => Err((interrupted.reason.into(), interrupted.so_far)),
    }
    .map_err(|(reason, run)| Box::new(Undifferentiated { reason, so_far: collect(run, &times) }))
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
