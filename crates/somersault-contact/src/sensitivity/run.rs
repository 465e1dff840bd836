//! Integrating state and columns together.

use super::outcome::{Sensitivities, SensitivityError, Undifferentiated, collect};
use super::parameter::{Differentiation, FoundParameter, Parameter};
use super::system::{Log, Variational, VariedPose, VariedState};
use crate::contacts::{BodyInContact, Contact, Contacts};
use crate::laws::LawParameter;
use crate::stretches::WithStretches;
use crate::surface::SurfaceFault;
use nalgebra::Vector3;
use somersault_core::argument::expect_positive;
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::driver::{Flow, IntegrateError, Observer, Step, Steps};
use somersault_integrators::events::{Frozen, Interruption, Located, Location};
use somersault_integrators::force::ForceModel;
use somersault_integrators::methods::{Method, Options};
use somersault_integrators::run::{ByEmbeddedStepper, ByMethod, ByStepper, Engages, Run};
use somersault_integrators::state::{Pose, RigidBodyState, State, Twist};
use somersault_integrators::variation::Tangent;

/// The outcome of a run with sensitivities.
pub type SensitivityResult = Result<Sensitivities, Box<Undifferentiated>>;

/// A run of a body in contact, with located events, that leaves the derivative of the state with respect to the initial state
/// and to parameters beside the state: as a [`Run`], which it is of state and columns together.
///
/// The method is one of the table ([`SensitivityRun::new`]), which must be one for any system in the variables of the world or of
/// the body, or user-defined.
///
/// Adapted steps are those of the motion without columns, whose errors are not weighed.
///
/// Cost: one and a half to two runs without columns for each column (the spinning top by `rkmk8` and `rkmk`),
/// which is what central differences take.
#[must_use = "a run begins with a state, `from`"]
pub struct SensitivityRun<'a, F, M> {
    system: &'a BodyInContact<F>,
    differentiation: &'a Differentiation,
    method: M,
    steps: Steps,
    location: Location,
    observer: Option<&'a mut dyn Observer<VariedPose>>,
}

impl<'a, F: ForceModel> SensitivityRun<'a, F, ByMethod> {
    /// By a method of the table, with the default [`Options`].
    pub fn new(
        system: &'a BodyInContact<F>,
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

impl<'a, 'm, F: ForceModel, M> SensitivityRun<'a, F, ByStepper<'m, M>> {
    /// By any method; its steps are fixed.
    pub fn by_stepper(
        system: &'a BodyInContact<F>,
        differentiation: &'a Differentiation,
        stepper: &'m M,
        steps: impl Into<Steps>,
    ) -> Self {
        Self::by(system, differentiation, ByStepper(stepper), steps)
    }
}

impl<'a, 'm, F: ForceModel, M> SensitivityRun<'a, F, ByEmbeddedStepper<'m, M>> {
    /// By any method that estimates its error; its steps are fixed or adapted.
    pub fn by_embedded_stepper(
        system: &'a BodyInContact<F>,
        differentiation: &'a Differentiation,
        stepper: &'m M,
        steps: impl Into<Steps>,
    ) -> Self {
        Self::by(system, differentiation, ByEmbeddedStepper(stepper), steps)
    }
}

impl<'a, F: ForceModel, M> SensitivityRun<'a, F, M> {
    fn by(
        system: &'a BodyInContact<F>,
        differentiation: &'a Differentiation,
        method: M,
        steps: impl Into<Steps>,
    ) -> Self {
        let (steps, location) = (steps.into(), Location::default());
        Self { system, differentiation, method, steps, location, observer: None }
    }

    /// Locates events otherwise than by default.
    pub fn locating(self, location: Location) -> Self {
        Self { location, ..self }
    }

    /// Shows each committed step to an observer, which may stop the run: the states have their columns, the twelve of the
    /// initial state, then those of the parameters.
    pub fn observed_by(self, observer: &'a mut dyn Observer<VariedPose>) -> Self {
        Self { observer: Some(observer), ..self }
    }

    /// Runs from a state.
    ///
    /// Errors keep the solution: those of a [`Run`] that locates events, which also end runs whose columns stop being finite, a
    /// parameter of a contact or of friction that there is not, a start on a surface, and grazing.
    pub fn from(self, initial: &RigidBodyState) -> SensitivityResult
    where
        M: for<'b> Engages<Frozen<'b, Variational<'a, F>>>,
    {
        let Self { system, differentiation, method, steps, location, observer } = self;
        let (start, end) = steps.interval();
        let held = WithStretches(system);
        let count = differentiation.parameters.len();
        let unstretched = varied(held.unstretched(*initial), count);
        let refuse = |reason| Err(refused(reason, start, &unstretched));
        if let Some(reason) = refusal(system, differentiation, initial) {
            return refuse(reason);
        }
        let parameters = match find(&differentiation.parameters, &system.forces.1) {
            Ok(parameters) => parameters,
            Err(reason) => return refuse(reason),
        };
        let stretched = if differentiation.stretches.is_empty() {
            unstretched.clone()
        } else {
            match held.stretched(*initial, differentiation.stretches.clone()) {
                Ok(stretched) => varied(stretched, count),
                Err(error) => return refuse(error.into()),
            }
        };
        let grazing = differentiation.grazing;
        let variational = Variational::new(held, parameters, grazing, end - start, location.keep_events);
        let mut watching = Watching { system: &variational, observer };
        let run = Run::by(&variational, method, steps).locating(location).observed_by(&mut watching);
        let run = run.from(&stretched);
        let Log { times, grazing } = variational.log.take();
        match (run, grazing) {
            (Ok(run), None) => Ok(collect(run, &times)),
            (Ok(run), Some(grazing)) => Err((SensitivityError::Grazing(grazing), run)),
            (Err(interrupted), _) => Err((why(interrupted.reason), interrupted.so_far)),
        }
        .map_err(|(reason, run)| Box::new(Undifferentiated { reason, so_far: collect(run, &times) }))
    }
}

/// Why there is no derivative of a run that was interrupted.
fn why(reason: Interruption<SurfaceFault>) -> SensitivityError {
    match reason {
        Interruption::Integrate(IntegrateError::RigidBodiesOnly { method }) => {
            SensitivityError::Method { method }
        }
        reason => SensitivityError::Run(reason),
    }
}

/// Shows each step to an observer, after contacts that it just missed have been looked for.
struct Watching<'a, 'b, F> {
    system: &'b Variational<'a, F>,
    observer: Option<&'a mut dyn Observer<VariedPose>>,
}

impl<F: ForceModel> Observer<VariedPose> for Watching<'_, '_, F> {
    fn observe(&mut self, step: &mut Step<'_, VariedPose>) -> Flow {
        self.system.watch((step.t_before, step.before), (step.t_after, step.after));
        self.observer.as_mut().map_or(Flow::Continue, |observer| observer.observe(step))
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
