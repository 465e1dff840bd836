//! Integrating state and columns together.

use super::collect::collect;
use super::differentiable::{Differentiable, VariedOf};
use super::outcome::{Sensitivities, SensitivityError, Undifferentiated};
use super::parameter::{Differentiation, FoundParameter, Parameter};
use super::system::Variational;
use crate::encounters;
use crate::laws::{ContactLaw, Encounter, LawParameter};
use crate::linearized::Linearized;
use crate::surface::SurfaceFault;
use nalgebra::Vector3;
use somersault_core::argument::expect_positive;
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::driver::{Flow, IntegrateError, Observer, Step, Steps};
use somersault_integrators::events::{Frozen, Interruption, Located, Location};
use somersault_integrators::methods::{Method, Options};
use somersault_integrators::run::{ByEmbeddedStepper, ByMethod, ByStepper, Engages, Run};
use somersault_integrators::state::{Configuration, Rate, State};
use somersault_integrators::variation::{Tangent, Varied};

/// The outcome of a run with sensitivities.
pub type SensitivityResult<S = Sensitivities> = Result<S, Box<Undifferentiated<S>>>;

/// A run of a body or a tree in contact, with located events, that leaves the derivative of the state with respect to the initial state
/// and to parameters beside the state: as a [`Run`], which it is of state and columns together. What it leaves are
/// [`Sensitivities`] of a body and [`TreeSensitivities`](super::TreeSensitivities) of a tree.
///
/// The method is one of the table ([`SensitivityRun::new`]), which must be one for any system in the variables of the world or of
/// the body, or user-defined.
///
/// Adapted steps are those of the motion without columns, whose errors are not weighed.
///
/// Cost: one and a half to two runs without columns for each column (the spinning top by `rkmk8` and `rkmk`),
/// which is what central differences take.
#[must_use = "a run begins with a state, `from`"]
pub struct SensitivityRun<'a, 'o, S: Differentiable, M> {
    pub(super) system: &'a S,
    pub(super) differentiation: &'a Differentiation,
    pub(super) method: M,
    pub(super) steps: Steps,
    pub(super) location: Location,
    pub(super) observer: Option<&'o mut dyn Observer<VariedOf<S>>>,
}

impl<'a, S: Differentiable> SensitivityRun<'a, '_, S, ByMethod> {
    /// By a method of the table, with the default [`Options`].
    pub fn new(
        system: &'a S,
        differentiation: &'a Differentiation,
        method: Method,
        steps: impl Into<Steps>,
    ) -> Self {
        Self::by(system, differentiation, method.into(), steps)
    }

    /// The same with other options.
    pub fn with_options(self, options: Options) -> Self {
        Self { method: ByMethod { options, ..self.method }, ..self }
    }
}

impl<'a, 'm, S: Differentiable, M> SensitivityRun<'a, '_, S, ByStepper<'m, M>> {
    /// By any method; its steps are fixed.
    pub fn by_stepper(
        system: &'a S,
        differentiation: &'a Differentiation,
        stepper: &'m M,
        steps: impl Into<Steps>,
    ) -> Self {
        Self::by(system, differentiation, ByStepper(stepper), steps)
    }
}

impl<'a, 'm, S: Differentiable, M> SensitivityRun<'a, '_, S, ByEmbeddedStepper<'m, M>> {
    /// By any method that estimates its error; its steps are fixed or adapted.
    pub fn by_embedded_stepper(
        system: &'a S,
        differentiation: &'a Differentiation,
        stepper: &'m M,
        steps: impl Into<Steps>,
    ) -> Self {
        Self::by(system, differentiation, ByEmbeddedStepper(stepper), steps)
    }
}

impl<'a, 'o, S: Differentiable, M> SensitivityRun<'a, 'o, S, M> {
    fn by(system: &'a S, differentiation: &'a Differentiation, method: M, steps: impl Into<Steps>) -> Self {
        let (steps, location) = (steps.into(), Location::default());
        Self { system, differentiation, method, steps, location, observer: None }
    }

    /// Locates events otherwise than by default.
    pub fn locating(self, location: Location) -> Self {
        Self { location, ..self }
    }

    /// Shows each committed step to an observer, which may stop the run: the states have their columns, those of the
    /// initial state, then those of the parameters.
    pub fn observed_by(self, observer: &'o mut dyn Observer<VariedOf<S>>) -> Self {
        Self { observer: Some(observer), ..self }
    }

    /// Runs from a state.
    ///
    /// Errors keep the solution: those of a [`Run`] that locates events, which also end runs whose columns stop being finite, a
    /// parameter of a contact or of friction that there is not, a start on a surface, grazing, and nearest points that pass to another part
    /// of a shape under friction.
    pub fn from(self, initial: &State<S::Moved>) -> SensitivityResult<S::Sensitivities>
    where
        M: for<'b> Engages<Frozen<'b, Variational<'a, S>>>,
    {
        let Self { system, differentiation, method, steps, location, observer } = self;
        let (start, end) = steps.interval();
        let tangents = system.tangents(initial);
        let count = differentiation.parameters.len();
        let (stretched, parameters) = match prepare(system, differentiation, initial) {
            Ok((stretched, parameters)) => (varied(stretched, &tangents, count), parameters),
            Err(reason) => {
                let still = encounters::unstretched::<S::Moved>(system, initial.clone());
                let unstretched = varied(still, &tangents, count);
                let so_far = collect(system, Located::at_start(start, &unstretched), &[]);
                return Err(Box::new(Undifferentiated { reason, so_far }));
            }
        };
        let grazing = differentiation.grazing;
        let variational = Variational::new(system, parameters, grazing, end - start, location.keep_events);
        let mut watching = Watching { system: &variational, observer };
        let run = Run::by(&variational, method, steps).locating(location).observed_by(&mut watching);
        let run = run.from(&stretched);
        let log = variational.log.take();
        let (reason, times) = (log.reason(), log.times);
        match (run, reason) {
            (Ok(run), None) => Ok(collect(system, run, &times)),
            (Ok(run), Some(reason)) => Err((reason, run)),
            (Err(interrupted), _) => Err((why(interrupted.reason), interrupted.so_far)),
        }
        .map_err(|(reason, run)| Box::new(Undifferentiated { reason, so_far: collect(system, run, &times) }))
    }
}

/// The state that a run starts from, and what it is differentiated by.
type Prepared<'a, S> = (State<Augmented<<S as Linearized>::Moved>>, Vec<FoundParameter<'a>>);

/// What a run begins with, unless it is refused.
pub(super) fn prepare<'a, S: Differentiable>(
    system: &S,
    differentiation: &'a Differentiation,
    initial: &State<S::Moved>,
) -> Result<Prepared<'a, S>, SensitivityError> {
    if let Some(reason) = refusal(system, differentiation, initial) {
        return Err(reason);
    }
    let parameters = find(&differentiation.parameters, system)?;
    let stretched = if differentiation.stretches.is_empty() {
        encounters::unstretched::<S::Moved>(system, initial.clone())
    } else {
        encounters::stretched::<S::Moved>(system, initial.clone(), differentiation.stretches.clone())?
    };
    Ok((stretched, parameters))
}

/// Why there is no derivative of a run that was interrupted.
pub(super) fn why(reason: Interruption<SurfaceFault>) -> SensitivityError {
    match reason {
        Interruption::Integrate(IntegrateError::RigidBodiesOnly { method }) => {
            SensitivityError::Method { method }
        }
        reason => SensitivityError::Run(reason),
    }
}

/// Shows each step to an observer, after contacts that it just missed have been looked for.
pub(super) struct Watching<'a, 'b, 'o, S: Differentiable> {
    pub(super) system: &'b Variational<'a, S>,
    pub(super) observer: Option<&'o mut dyn Observer<VariedOf<S>>>,
}

impl<S: Differentiable> Observer<VariedOf<S>> for Watching<'_, '_, '_, S> {
    fn observe(&mut self, step: &mut Step<'_, VariedOf<S>>) -> Flow {
        self.system.watch((step.t_before, step.before), (step.t_after, step.after));
        self.observer.as_mut().map_or(Flow::Continue, |observer| observer.observe(step))
    }
}

/// A state with the columns of the initial state, then one for each parameter.
pub(super) fn varied<Q: Configuration>(
    base: State<Augmented<Q>>,
    tangents: &[Tangent<Q::Rate>],
    parameters: usize,
) -> State<Varied<Augmented<Q>, AugmentedRate<Q::Rate>>> {
    let still = vec![Vector3::zeros(); base.rate.variables.len()];
    let mut zero = base.rate.base.clone();
    zero.set_zero();
    let beside = |base: &Q::Rate| AugmentedRate { base: base.clone(), variables: still.clone() };
    let of_state = tangents.iter().map(|Tangent { displacement, rate }| (displacement, rate));
    let columns: Vec<_> = of_state
        .chain(std::iter::repeat_n((&zero, &zero), parameters))
        .map(|(displacement, rate)| Tangent { displacement: beside(displacement), rate: beside(rate) })
        .collect();
    State::varied(base, columns)
}

/// Why a run is not begun.
fn refusal<S: Differentiable>(
    system: &S,
    differentiation: &Differentiation,
    initial: &State<S::Moved>,
) -> Option<SensitivityError> {
    if let Err(error) = expect_positive("grazing", differentiation.grazing) {
        return Some(SensitivityError::Run(IntegrateError::from(error).into()));
    }
    let (mut without, mut on_surface) = (system.without_derivative(), None);
    let see = |contact: usize, law: &ContactLaw, at: &Encounter| {
        if without.is_none() {
            let law = law.without_derivative(at);
            without = law.map(|law| SensitivityError::NoDerivative { contact, law });
        }
        if on_surface.is_none() && at.gap == 0.0 && at.rate <= 0.0 && law.normal().jumps() {
            on_surface = Some(SensitivityError::StartOnSurface { guard: contact });
        }
    };
    system.each_encounter(&initial.configuration, &initial.rate, see);
    without.or(on_surface)
}

/// Finds the parameters of laws among those that the laws name.
fn find<'a, S: Differentiable>(
    parameters: &'a [Parameter],
    system: &S,
) -> Result<Vec<FoundParameter<'a>>, SensitivityError> {
    let law_of = |found: usize| {
        let missing = || SensitivityError::NoSuchContact { found, contacts: system.laws().count() };
        system.laws().nth(found).ok_or_else(missing)
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
            Parameter::Mass
            | Parameter::InertiaScale
            | Parameter::Force(_)
            | Parameter::JointForce(_)
            | Parameter::JointForceAt(..)
            | Parameter::Tree(_) => match system.refuse(parameter) {
                Some(reason) => return Err(reason),
                None => None,
            },
        };
        Ok(FoundParameter { parameter, of_law })
    };
    parameters.iter().map(find).collect()
}
