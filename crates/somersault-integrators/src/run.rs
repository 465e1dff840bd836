//! One way to run: a [`Run`] of a system by a method with steps, from a state to an [`Outcome`].
//!
//! One body, many bodies, a tree and any other system run alike; which methods of the table take it says the system
//! ([`System::Forms`]). Where its equations change at events, these are located ([`Run::locating`]).
//!
//! ```
//! use somersault_integrators::driver::{Adaptive, Steps, TimeGrid};
//! use somersault_integrators::{body::RigidBody, methods::Method, nalgebra::Vector3, run::Run};
//! use somersault_integrators::{solution::Recorder, state::RigidBodyState, system::RigidBodySystem};
//!
//! let system = RigidBodySystem::free(RigidBody::try_box(1.0, Vector3::new(0.2, 0.4, 0.6))?);
//! let start = RigidBodyState::spinning(Vector3::new(0.1, 8.0, 0.0));
//!
//! let end = Run::new(&system, Method::Rkmk, TimeGrid::try_new(0.0, 1.0, 1e-3)?).from(&start)?;
//! assert_eq!(end.steps, 1000);
//!
//! let steps = Steps::adapted((0.0, 1.0), Adaptive::with_tolerances(1e-10, 1e-10));
//! let mut recorder = Recorder::new(0.0, &start, 1);
//! let adapted = Run::new(&system, Method::Rkmk8B, steps).observed_by(&mut recorder).from(&start)?;
//! assert_eq!(recorder.into_solution().times.len() as u64, adapted.steps + 1);
//! assert!(end.state.orientation().angle_to(adapted.state.orientation()) < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::doubling::{check_adaptive, hand_over};
use crate::driver::{Observer, Outcome, Steps, check_state, run_adaptive, run_fixed};
use crate::engine::{Engine, FormEngine};
use crate::error::IntegrateError;
use crate::methods::{Forms, Method, Options};
use crate::stepper::{EmbeddedStepper, MethodInfo, StepError, Stepper};
use crate::system::{StateOf, System};

/// A run of a system by a method: from a state on, with the steps chosen, seen by an observer.
///
/// The method is one of the table ([`Run::new`]) or user-defined ([`Run::by_stepper`], [`Run::by_embedded_stepper`]). `L` says
/// how events are located: not at all by default, and as a [`Location`](crate::events::Location) has it after
/// [`Run::locating`].
#[must_use = "a run begins with a state, `from`"]
pub struct Run<'a, S: System, M, L = ()> {
    pub(crate) system: &'a S,
    pub(crate) method: M,
    pub(crate) steps: Steps,
    pub(crate) location: L,
    pub(crate) observer: Option<&'a mut dyn Observer<S::Configuration>>,
}

/// What makes an [`Engine`] of a method and a system.
pub trait Engages<S: System> {
    /// Runs an engine with adapted or with fixed steps, started from a state.
    ///
    /// Errors where the method does not take the system or its forces, or its steps cannot be adapted.
    fn engage<R>(
        &self,
        system: &S,
        initial: &StateOf<S>,
        is_adapted: bool,
        run: &mut dyn FnMut(&mut dyn Engine<S::Configuration>) -> R,
    ) -> Result<R, IntegrateError>;
}

impl<S: System, E: Engages<S>> Engages<S> for &E {
    fn engage<R>(
        &self,
        system: &S,
        initial: &StateOf<S>,
        is_adapted: bool,
        run: &mut dyn FnMut(&mut dyn Engine<S::Configuration>) -> R,
    ) -> Result<R, IntegrateError> {
        (**self).engage(system, initial, is_adapted, run)
    }
}

/// By a method of the table.
#[derive(Debug, Clone, Copy)]
pub struct ByMethod {
    /// The method.
    pub method: Method,
    /// Its options.
    pub options: Options,
}

impl From<Method> for ByMethod {
    /// With the default options.
    fn from(method: Method) -> Self {
        Self { method, options: Options::default() }
    }
}

impl<S: System<Forms: Forms<S>>> Engages<S> for ByMethod {
    fn engage<R>(
        &self,
        system: &S,
        initial: &StateOf<S>,
        is_adapted: bool,
        run: &mut dyn FnMut(&mut dyn Engine<S::Configuration>) -> R,
    ) -> Result<R, IntegrateError> {
        let Self { method, options } = *self;
        if is_adapted {
            method.engage_adapted(options, system, initial, run)
        } else {
            method.engage(options, system, initial, run)
        }
    }
}

/// By a user-defined method, whose estimate of its error is not used if it has one: adapted steps are [doubled](crate::doubling).
#[derive(Debug, Clone, Copy)]
pub struct ByStepper<'a, M>(pub &'a M);

impl<S: System, M: Stepper<S>> Engages<S> for ByStepper<'_, M> {
    fn engage<R>(
        &self,
        system: &S,
        initial: &StateOf<S>,
        is_adapted: bool,
        run: &mut dyn FnMut(&mut dyn Engine<S::Configuration>) -> R,
    ) -> Result<R, IntegrateError> {
        if is_adapted {
            check_adaptive(&MethodInfo { embedded: None, ..M::INFO })?;
        }
        let mut engine = FormEngine::unchanged(system, self.0, initial.clone())?;
        Ok(hand_over(&mut engine, is_adapted, initial, run)?)
    }
}

/// By a user-defined method that estimates its error.
#[derive(Debug, Clone, Copy)]
pub struct ByEmbeddedStepper<'a, M>(pub &'a M);

impl<S: System, M: EmbeddedStepper<S>> Engages<S> for ByEmbeddedStepper<'_, M> {
    fn engage<R>(
        &self,
        system: &S,
        initial: &StateOf<S>,
        _: bool,
        run: &mut dyn FnMut(&mut dyn Engine<S::Configuration>) -> R,
    ) -> Result<R, IntegrateError> {
        Ok(run(&mut FormEngine::unchanged(system, self.0, initial.clone())?.with_estimate()))
    }
}

impl<'a, S: System> Run<'a, S, ByMethod> {
    /// By a method of the table, with the default [`Options`].
    pub fn new(system: &'a S, method: Method, steps: impl Into<Steps>) -> Self {
        Self::by(system, method.into(), steps)
    }
}

impl<'a, S: System, L> Run<'a, S, ByMethod, L> {
    /// The same with other options.
    pub fn with_options(self, options: Options) -> Self {
        Self { method: ByMethod { options, ..self.method }, ..self }
    }
}

impl<'a, 'm, S: System, M> Run<'a, S, ByStepper<'m, M>> {
    /// By any method; its steps are fixed, or adapted by [doubling](crate::doubling) if it remembers no previous steps.
    pub fn by_stepper(system: &'a S, stepper: &'m M, steps: impl Into<Steps>) -> Self {
        Self::by(system, ByStepper(stepper), steps)
    }
}

impl<'a, 'm, S: System, M> Run<'a, S, ByEmbeddedStepper<'m, M>> {
    /// By any method that estimates its error; its steps are fixed or adapted.
    pub fn by_embedded_stepper(system: &'a S, stepper: &'m M, steps: impl Into<Steps>) -> Self {
        Self::by(system, ByEmbeddedStepper(stepper), steps)
    }
}

impl<'a, S: System, M, L> Run<'a, S, M, L> {
    /// Shows each step to an observer, which may stop the run.
    pub fn observed_by(self, observer: &'a mut dyn Observer<S::Configuration>) -> Self {
        Self { observer: Some(observer), ..self }
    }
}

impl<'a, S: System, M> Run<'a, S, M> {
    /// By a method of any of the three kinds: [`ByMethod`], [`ByStepper`] or [`ByEmbeddedStepper`].
    pub fn by(system: &'a S, method: M, steps: impl Into<Steps>) -> Self {
        Self { system, method, steps: steps.into(), location: (), observer: None }
    }

    /// Runs from a state.
    ///
    /// Errors: a state that is not finite, at the start or after a step, a method that does not take the system or adapted
    /// steps, and failures of the method. A system that had no value says why, with [`IntegrateError::Fault`].
    pub fn from(self, initial: &StateOf<S>) -> Result<Outcome<S::Configuration>, IntegrateError>
    where
        M: Engages<S>,
    {
        let Self { system, method, steps, observer, .. } = self;
        check_state(initial)?;
        let run = drive(&method, system, initial, &steps, observer, &mut |engine, observer| match &steps {
            Steps::Fixed(grid) => run_fixed(engine, initial, grid, observer),
            Steps::Adapted { interval, settings } => run_adaptive(
                engine,
                initial,
                (*interval, settings),
                &|t, end| system.next_stop(t, end),
                observer,
            ),
        });
        run.and_then(std::convert::identity).map_err(|error| explain(system, error))
    }
}

/// What makes steps by an engine and shows them to an observer.
pub(crate) type Driver<'a, Q, R> = &'a mut dyn FnMut(&mut dyn Engine<Q>, &mut dyn Observer<Q>) -> R;

/// Hands an engine for some steps from a finite state to a driver, with the observer if there is one.
pub(crate) fn drive<S: System, M: Engages<S>, R>(
    method: &M,
    system: &S,
    initial: &StateOf<S>,
    steps: &Steps,
    observer: Option<&mut dyn Observer<S::Configuration>>,
    driver: Driver<'_, S::Configuration, R>,
) -> Result<R, IntegrateError> {
    let mut nobody = ();
    let observer: &mut dyn Observer<_> = match observer {
        Some(observer) => observer,
        None => &mut nobody,
    };
    // What was wrong before is not what goes wrong now.
    system.take_fault();
    let is_adapted = matches!(steps, Steps::Adapted { .. });
    method.engage(system, initial, is_adapted, &mut |engine| driver(engine, &mut *observer))
}

/// Puts the reason that a system has no value in the place of what it led to.
pub(crate) fn explain<S: System>(system: &S, error: IntegrateError) -> IntegrateError {
    let t = match error {
        IntegrateError::NonFinite { t } => t,
        IntegrateError::Step(StepError::NotConverged { t, residual, .. }) if residual.is_nan() => t,
        error => return error,
    };
    match system.take_fault() {
        Some(source) => IntegrateError::Fault { t, source },
        None => error,
    }
}
