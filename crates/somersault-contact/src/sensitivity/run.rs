//! Integrating state and columns together.

use super::outcome::{Sensitivities, SensitivityError, Undifferentiated, collect};
use super::parameter::{Differentiation, FoundParameter, Parameter};
use super::system::{FrozenVariational, InBodyAxes, Log, Variational, VariedPose, VariedState};
use crate::contacts::{BodyInContact, Contact, Contacts};
use crate::laws::LawParameter;
use crate::stretches::WithStretches;
use nalgebra::Vector3;
use somersault_core::argument::expect_positive;
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::driver::{Adaptive, Flow, IntegrateError, Observer, Step, TimeGrid};
use somersault_integrators::events::{
    Frozen, Located, LocatedResult, Location, integrate_hybrid, integrate_hybrid_adaptive,
    integrate_hybrid_form, integrate_hybrid_form_adaptive,
};
use somersault_integrators::force::ForceModel;
use somersault_integrators::methods::{Method, Options, Visitor};
use somersault_integrators::state::{Pose, RigidBodyState, State, Twist};
use somersault_integrators::stepper::{EmbeddedStepper, Stepper};
use somersault_integrators::system::Form;
use somersault_integrators::variation::Tangent;

/// The outcome of a run with sensitivities.
pub type SensitivityResult = Result<Sensitivities, Box<Undifferentiated>>;

/// Integrates a body in contact by a method of the table, with a fixed step, locating events, and the
/// derivative of its state with respect to the initial state and to parameters.
///
/// The method must be one for any system, in the variables of the world or of the body. The observer sees every
/// committed step with its columns: the twelve of the initial state, then the parameters.
///
/// Errors keep the solution: those of [`integrate_located`](somersault_integrators::events::integrate_located), which also
/// end runs whose columns stop being finite, a parameter of a contact or of friction that there is not, a
/// start on a surface, and grazing.
///
/// Cost: one and a half to two runs without columns for each column (the spinning top by `rkmk8` and `rkmk`),
/// which is what central differences take.
pub fn differentiate_located<F>(
    method: Method,
    options: Options,
    system: &BodyInContact<F>,
    initial: &RigidBodyState,
    differentiation: &Differentiation,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut dyn Observer<VariedPose>,
) -> SensitivityResult
where
    F: ForceModel,
{
    let interval = (grid.time(0), grid.time(grid.steps()));
    let task = Task { system, initial, differentiation, interval, location, observer };
    task.run(method.info().name, |run| {
        method.visit_frames(options, run.frozen, InBodyAxes(run.frozen), Fixed { run, grid })
    })
}

/// The same with steps adapted to tolerances, by a method that estimates its error; see [`differentiate_located`].
///
/// The steps are those of the motion without columns, whose errors are not weighed.
pub fn differentiate_located_adaptive<F>(
    method: Method,
    options: Options,
    system: &BodyInContact<F>,
    initial: &RigidBodyState,
    differentiation: &Differentiation,
    interval: (f64, f64),
    settings: &Adaptive,
    location: &Location,
    observer: &mut dyn Observer<VariedPose>,
) -> SensitivityResult
where
    F: ForceModel,
{
    let task = Task { system, initial, differentiation, interval, location, observer };
    if method.info().embedded.is_none() {
        let error = IntegrateError::NoErrorEstimate { method: method.info().name };
        return Err(refused(SensitivityError::Run(error.into()), interval.0, &task.unstretched()));
    }
    task.run(method.info().name, |run| {
        let adapted = Adapted { run, interval, settings };
        method.visit_frames(options, adapted.run.frozen, InBodyAxes(adapted.run.frozen), adapted)?
    })
}

/// The same by any stepper; see [`differentiate_located`].
pub fn differentiate_hybrid<'a, F, M>(
    stepper: &M,
    system: &'a BodyInContact<F>,
    initial: &RigidBodyState,
    differentiation: &'a Differentiation,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut dyn Observer<VariedPose>,
) -> SensitivityResult
where
    F: ForceModel,
    M: Stepper<FrozenVariational<'a, F>>,
{
    let interval = (grid.time(0), grid.time(grid.steps()));
    Task { system, initial, differentiation, interval, location, observer }
        .run(M::INFO.name, |run| Some(run.fixed(stepper, grid)))
}

/// The same by any stepper that estimates its error, with steps adapted to tolerances; see
/// [`differentiate_located_adaptive`].
pub fn differentiate_hybrid_adaptive<'a, F, M>(
    stepper: &M,
    system: &'a BodyInContact<F>,
    initial: &RigidBodyState,
    differentiation: &'a Differentiation,
    interval: (f64, f64),
    settings: &Adaptive,
    location: &Location,
    observer: &mut dyn Observer<VariedPose>,
) -> SensitivityResult
where
    F: ForceModel,
    M: EmbeddedStepper<FrozenVariational<'a, F>>,
{
    Task { system, initial, differentiation, interval, location, observer }
        .run(M::INFO.name, |run| Some(run.adapted(stepper, interval, settings)))
}

/// What is to be integrated and differentiated.
struct Task<'a, 'b, F> {
    system: &'a BodyInContact<F>,
    initial: &'b RigidBodyState,
    differentiation: &'a Differentiation,
    interval: (f64, f64),
    location: &'b Location,
    observer: &'b mut dyn Observer<VariedPose>,
}

/// A task begun.
struct Begun<'a, 'b, F: ForceModel> {
    frozen: &'b FrozenVariational<'a, F>,
    start: &'b VariedState,
    location: &'b Location,
    observer: &'b mut dyn Observer<VariedPose>,
}

/// Shows each step to an observer, after contacts that it just missed have been looked for.
struct Watching<'a, 'b, F: ForceModel> {
    frozen: &'b FrozenVariational<'a, F>,
    observer: &'b mut dyn Observer<VariedPose>,
}

impl<F: ForceModel> Observer<VariedPose> for Watching<'_, '_, F> {
    fn observe(&mut self, step: &mut Step<'_, VariedPose>) -> Flow {
        self.frozen.system().watch((step.t_before, step.before), (step.t_after, step.after));
        self.observer.observe(step)
    }
}

impl<'a, F: ForceModel> Begun<'a, '_, F> {
    fn fixed<M: Stepper<FrozenVariational<'a, F>>>(
        self,
        stepper: &M,
        grid: &TimeGrid,
    ) -> LocatedResult<Variational<'a, F>> {
        let Self { frozen, start, location, observer } = self;
        integrate_hybrid(frozen, stepper, start, grid, location, &mut Watching { frozen, observer })
    }

    fn adapted<M: EmbeddedStepper<FrozenVariational<'a, F>>>(
        self,
        stepper: &M,
        interval: (f64, f64),
        settings: &Adaptive,
    ) -> LocatedResult<Variational<'a, F>> {
        let Self { frozen, start, location, observer } = self;
        let mut watching = Watching { frozen, observer };
        integrate_hybrid_adaptive(frozen, stepper, start, interval, settings, location, &mut watching)
    }
}

/// Steps of fixed size by a method in one of two frames.
struct Fixed<'a, 'b, F: ForceModel> {
    run: Begun<'a, 'b, F>,
    grid: &'b TimeGrid,
}

impl<'a, F: ForceModel> Visitor<VariedPose> for Fixed<'a, '_, F> {
    type Output = LocatedResult<Variational<'a, F>>;

    fn visit<B: Form<VariedPose>, M: Stepper<B>>(self, form: B, stepper: M) -> Self::Output {
        let Begun { frozen, start, location, observer } = self.run;
        let mut watching = Watching { frozen, observer };
        let encode = |x: &_| form.encode(x);
        let form = (&form, &encode as &dyn Fn(&_) -> _, form.decoder());
        integrate_hybrid_form(frozen, form, &stepper, start, self.grid, location, &mut watching)
    }
}

/// Steps adapted to tolerances; none by a method that does not estimate its error.
struct Adapted<'a, 'b, F: ForceModel> {
    run: Begun<'a, 'b, F>,
    interval: (f64, f64),
    settings: &'b Adaptive,
}

impl<'a, F: ForceModel> Visitor<VariedPose> for Adapted<'a, '_, F> {
    type Output = Option<LocatedResult<Variational<'a, F>>>;

    fn visit<B: Form<VariedPose>, M: Stepper<B>>(self, _: B, _: M) -> Self::Output {
        None
    }

    fn visit_embedded<B: Form<VariedPose>, M: EmbeddedStepper<B>>(self, form: B, stepper: M) -> Self::Output {
        let Begun { frozen, start, location, observer } = self.run;
        let mut watching = Watching { frozen, observer };
        let encode = |x: &_| form.encode(x);
        let form = (&form, &encode as &dyn Fn(&_) -> _, form.decoder());
        let steps = (self.interval, self.settings);
        Some(integrate_hybrid_form_adaptive(frozen, form, &stepper, start, steps, location, &mut watching))
    }
}

impl<'a, F: ForceModel> Task<'a, '_, F> {
    fn unstretched(&self) -> VariedState {
        let system = WithStretches(self.system);
        varied(system.unstretched(*self.initial), self.differentiation.parameters.len())
    }

    /// Runs by a method of some name, which integrates what has begun unless it cannot integrate columns.
    fn run(
        self,
        method: &'static str,
        integrate: impl for<'b> FnOnce(Begun<'a, 'b, F>) -> Option<LocatedResult<Variational<'a, F>>>,
    ) -> SensitivityResult {
        let Self { system, differentiation, interval, location, .. } = self;
        let unstretched = self.unstretched();
        let refuse = |reason| Err(refused(reason, interval.0, &unstretched));
        if let Some(reason) = refusal(system, differentiation, self.initial) {
            return refuse(reason);
        }
        let parameters = match find(&differentiation.parameters, &system.forces.1) {
            Ok(parameters) => parameters,
            Err(reason) => return refuse(reason),
        };
        let system = WithStretches(system);
        let start = if differentiation.stretches.is_empty() {
            unstretched.clone()
        } else {
            match system.stretched(*self.initial, differentiation.stretches.clone()) {
                Ok(start) => varied(start, differentiation.parameters.len()),
                Err(error) => return refuse(error.into()),
            }
        };
        let duration = interval.1 - interval.0;
        let grazing = differentiation.grazing;
        let variational = Variational::new(system, parameters, grazing, duration, location.keep_events);
        let frozen = Frozen::new(variational, interval.0, &start);
        let begun = Begun { frozen: &frozen, start: &start, location, observer: self.observer };
        let Some(run) = integrate(begun) else { return refuse(SensitivityError::Method { method }) };
        let Log { times, grazing } = frozen.system().log.take();
        match (run, grazing) {
            (Ok(run), None) => Ok(collect(run, &times)),
            (Ok(run), Some(grazing)) => Err((SensitivityError::Grazing(grazing), run)),
            (Err(interrupted), _) => Err((interrupted.reason.into(), interrupted.so_far)),
        }
        .map_err(|(reason, run)| Box::new(Undifferentiated { reason, so_far: collect(run, &times) }))
    }
}

/// A state with the columns of the initial state, then one for each parameter.
fn varied(base: State<Augmented<Pose>>, parameters: usize) -> VariedState {
    let still = vec![Vector3::zeros(); base.rate.variables.len()];
    let beside = |base| AugmentedRate { base, variables: still.clone() };
    let columns: Vec<_> = (0..12 + parameters)
        .map(|i| {
            let Tangent::<Twist> { displacement, rate } = Tangent::unit(i);
            Tangent { displacement: beside(displacement), rate: beside(rate) }
        })
        .collect();
    VariedState::varied(base, columns)
}

fn refused(reason: SensitivityError, t: f64, start: &VariedState) -> Box<Undifferentiated> {
    Box::new(Undifferentiated { reason, so_far: collect(Located::at_start(t, start), &[]) })
}

/// Why a run is not begun.
fn refusal<F: ForceModel>(
    system: &BodyInContact<F>,
    differentiation: &Differentiation,
    initial: &RigidBodyState,
) -> Option<SensitivityError> {
    if let Err(error) = expect_positive("grazing", differentiation.grazing) {
        return Some(SensitivityError::Run(IntegrateError::from(error).into()));
    }
    let contacts = &system.forces.1;
    let without = |(contact, at): (usize, &Contact)| {
        let law = at.law().without_derivative(&at.encounter(&system.body, initial))?;
        Some(SensitivityError::NoDerivative { contact, law })
    };
    if let Some(reason) = contacts.iter().enumerate().find_map(without) {
        return Some(reason);
    }
    contacts.iter().enumerate().find_map(|(guard, contact)| {
        let at = contact.encounter(&system.body, initial);
        (at.gap == 0.0 && at.rate <= 0.0 && contact.law().normal().jumps())
            .then_some(SensitivityError::StartOnSurface { guard })
    })
}

/// Finds the parameters of laws among those that the laws name.
fn find<'a>(
    parameters: &'a [Parameter],
    contacts: &Contacts,
) -> Result<Vec<FoundParameter<'a>>, SensitivityError> {
    let law_of = |found: usize| match contacts.get(found) {
        Some(contact) => Ok(contact.law()),
        None => Err(SensitivityError::NoSuchContact { found, contacts: contacts.len() }),
    };
    let place = |contact, law, allowed: &'static [&'static str], name: &str| {
        let found = || name.to_string();
        let missing = || SensitivityError::NoSuchParameter { contact, law, found: found(), allowed };
        allowed.iter().position(|allowed| *allowed == name).ok_or_else(missing)
    };
    let find = |parameter: &'a Parameter| {
        let of_law = match parameter {
            Parameter::Normal(contact, name) => {
                let law = law_of(*contact)?.normal();
                let place = place(*contact, law.type_name(), law.parameters(), name)?;
                Some((*contact, LawParameter::Normal(place)))
            }
            Parameter::Friction(contact, name) => {
                let none = SensitivityError::NoFriction { contact: *contact };
                let law = law_of(*contact)?.friction().law().ok_or(none)?;
                let place = place(*contact, law.type_name(), law.parameters(), name)?;
                Some((*contact, LawParameter::Friction(place)))
            }
            Parameter::Mass | Parameter::InertiaScale | Parameter::Force(_) => None,
        };
        Ok(FoundParameter { parameter, of_law })
    };
    parameters.iter().map(find).collect()
}
