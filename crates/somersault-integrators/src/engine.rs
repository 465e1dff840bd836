//! A method at work on a system, behind one pointer.
//!
//! A driver decides which steps are made: of what size, again or for good, and who sees them. For that it need not know
//! by which method and in which variables: [`Engine`] makes the steps, from state to state in slots of its own, and turns
//! states into those of the system where they are requested. So the code of a driver is one for each kind of configuration,
//! and the code of a method one for each system ([`FormEngine`]), whichever drivers run it.
//!
//! A call through the pointer takes one or two nanoseconds, which is less than moving the states between steps: they stay in
//! their slots.

use crate::dense::{Decoded, Interpolant};
use crate::error::IntegrateError;
use crate::scratch::{Allocation, Storage};
use crate::state::{Configuration, Rate, State, Tolerances};
use crate::step_size::{Adaptive, StepSizeControl};
use crate::stepper::{EmbeddedStepper, MethodInfo, StepError, Stepper};
use crate::system::{Decoder, StateOf, System, Unchanged};
use crate::tableau::Tableau;
use somersault_core::argument::ArgumentError;

/// A place for a state in an engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slot(usize);

/// A memory of an engine: a trajectory has its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Track(usize);

impl Track {
    /// The one that every engine has.
    pub const RUN: Self = Self(0);
}

/// A method at work on a system with configurations `Q`.
pub trait Engine<Q: Configuration> {
    /// The row of the method table.
    fn info(&self) -> MethodInfo;

    /// As [`Scheme::on_vectors`](crate::stepper::Scheme::on_vectors).
    fn on_vectors(&self) -> Option<Tableau>;

    /// A new slot with a state in it.
    fn keep(&mut self, x: &State<Q>) -> Slot;

    /// Puts a state into a slot.
    fn write(&mut self, slot: Slot, x: &State<Q>);

    /// The state in a slot.
    fn read(&self, slot: Slot, out: &mut State<Q>);

    /// A new memory.
    fn branch(&mut self, x: &State<Q>) -> Result<Track, StepError>;

    /// Forgets the past.
    fn restart(&mut self, track: Track);

    /// Makes a step of h from t, from the state in one slot to another, where it is read into `seen` if requested.
    ///
    /// Errors: failures of the method, a state that is not finite, and a step to the slot that it comes from.
    fn advance(
        &mut self,
        track: Track,
        t: f64,
        h: f64,
        from: Slot,
        to: Slot,
        seen: Option<&mut State<Q>>,
    ) -> Result<(), IntegrateError>;

    /// Makes steps of h of [`Track::RUN`] that nobody looks at, the first from t, and leaves the state that they lead to in
    /// the slot that they start from.
    ///
    /// Errors: those of [`advance`](Self::advance).
    fn march(&mut self, t: f64, h: f64, steps: u64, slot: Slot) -> Result<(), IntegrateError>;

    /// The curve of the last step in a memory, which was of h from t and led from one slot to the other.
    fn segment(&mut self, track: Track, t: f64, h: f64, from: Slot, to: Slot) -> Box<dyn Interpolant<Q>>;

    /// A control of the step size for a run from a state at t.
    ///
    /// Errors: settings that are not positive.
    fn control(&self, settings: &Adaptive, t: f64, x: Slot) -> Result<StepSizeControl, IntegrateError>;

    /// Lets a control forget the past and choose the step afresh, from a state at t.
    fn restart_control(&self, control: &mut StepSizeControl, t: f64, x: Slot);

    /// Makes one step of [`Track::RUN`] and estimates its error, weighed by the tolerances: NaN where the state is not finite, so
    /// that it counts as too large.
    ///
    /// Errors: failures of the method, and a method without estimate.
    fn attempt(
        &mut self,
        t: f64,
        h: f64,
        from: Slot,
        to: Slot,
        tolerances: &Tolerances,
    ) -> Result<f64, IntegrateError>;

    /// The longest step of [`Track::RUN`] from a state that meets the tolerances, where the method knows it before the step is made.
    fn longest_step(&mut self, _from: Slot, _tolerances: &Tolerances) -> Result<Option<f64>, IntegrateError> {
        Ok(None)
    }

    /// Takes back the step just attempted.
    fn reject(&mut self);

    /// Moves a state at t by its velocity and acceleration there for a short time `dt` of either sign, to first order.
    fn nudge(&mut self, t: f64, x: &State<Q>, dt: f64, out: &mut State<Q>);
}

/// What is between the ends of a step that was made.
pub trait Interior<Q: Configuration> {
    /// The curve of the step.
    fn interpolant(&mut self) -> Box<dyn Interpolant<Q>>;

    /// Whether the curve is of the order that the ends of the step have.
    fn is_curve_of_full_order(&self) -> bool;

    /// Makes the part of the first `length` > 0 of the step again, by the method itself and without its history.
    ///
    /// Errors: failures of the method.
    fn part(&mut self, length: f64, out: &mut State<Q>) -> Result<(), IntegrateError>;

    /// Moves a state at t by its velocity and acceleration there for a short time `dt` of either sign, to first order.
    fn nudge(&mut self, t: f64, x: &State<Q>, dt: f64, out: &mut State<Q>);
}

/// The step of h from t of an engine, from one slot to another, the last of [`Track::RUN`].
pub(crate) struct EngineStep<'a, Q: Configuration> {
    pub(crate) engine: &'a mut dyn Engine<Q>,
    pub(crate) t: f64,
    pub(crate) h: f64,
    pub(crate) from: Slot,
    pub(crate) to: Slot,
    pub(crate) before: &'a State<Q>,
    /// The memory and the slot of parts, which the first one makes.
    pub(crate) place: &'a mut Option<(Track, Slot)>,
}

impl<Q: Configuration> Interior<Q> for EngineStep<'_, Q> {
    fn interpolant(&mut self) -> Box<dyn Interpolant<Q>> {
        self.engine.segment(Track::RUN, self.t, self.h, self.from, self.to)
    }

    fn is_curve_of_full_order(&self) -> bool {
        let MethodInfo { orders, dense_order, .. } = self.engine.info();
        dense_order >= orders.translation.max(orders.rotation)
    }

    fn part(&mut self, length: f64, out: &mut State<Q>) -> Result<(), IntegrateError> {
        let (track, slot) = match *self.place {
            Some(place) => place,
            None => *self.place.insert((self.engine.branch(self.before)?, self.engine.keep(self.before))),
        };
        self.engine.restart(track);
        self.engine.advance(track, self.t, length, self.from, slot, Some(out))
    }

    fn nudge(&mut self, t: f64, x: &State<Q>, dt: f64, out: &mut State<Q>) {
        self.engine.nudge(t, x, dt, out);
    }
}

/// How a state of the system is written in the variables that a method integrates, into a state of the same size.
pub type Encode<'a, Q, B> = &'a dyn Fn(&State<Q>, &mut State<B>);

/// What an engine of a method with an estimate does beside stepping. Other methods are not compiled for it.
struct Estimate<E> {
    #[allow(clippy::type_complexity)]
    attempt: fn(&mut E, f64, f64, Slot, Slot, &Tolerances) -> Result<f64, IntegrateError>,
    longest_step: fn(&mut E, Slot, &Tolerances) -> Result<Option<f64>, StepError>,
    reject: fn(&mut E),
}

/// The states of an engine, in the variables of a form, with the ways there and back: what does not depend on the method.
struct Slots<'a, Q: Configuration, B: System, D> {
    form: &'a B,
    decoder: D,
    encode: Encode<'a, Q, B::Configuration>,
    states: Vec<StateOf<B>>,
    /// Of the size of all states.
    pattern: StateOf<B>,
}

impl<Q, B, D> Slots<'_, Q, B, D>
where
    Q: Configuration,
    B: System,
    D: Decoder<B::Configuration, Q>,
{
    /// A state of the system in the variables of the form.
    fn encoded(&self, x: &State<Q>) -> StateOf<B> {
        let mut state = self.pattern.clone();
        (self.encode)(x, &mut state);
        state
    }

    fn keep(&mut self, x: &State<Q>) -> Slot {
        self.states.push(self.encoded(x));
        Slot(self.states.len() - 1)
    }

    fn write(&mut self, slot: Slot, x: &State<Q>) {
        (self.encode)(x, &mut self.states[slot.0]);
    }

    fn read(&self, slot: Slot, out: &mut State<Q>) {
        self.decoder.decode(&self.states[slot.0], out);
    }

    /// The states in two slots.
    #[inline(always)]
    fn pair(&mut self, from: Slot, to: Slot) -> Result<[&mut StateOf<B>; 2], ArgumentError> {
        let allowed = "a slot of this engine, and another than `from`";
        let wrong = |_| ArgumentError::OutOfRange { argument: "to", allowed, found: to.0 as f64 };
        self.states.get_disjoint_mut([from.0, to.0]).map_err(wrong)
    }

    fn decoded(&self, curve: Box<dyn Interpolant<B::Configuration>>) -> Box<dyn Interpolant<Q>> {
        Box::new(Decoded { curve, pattern: self.pattern.clone(), decoder: self.decoder.clone() })
    }

    fn nudge(&self, t: f64, x: &State<Q>, dt: f64, out: &mut State<Q>) {
        let mut y = self.encoded(x);
        let mut workspace = self.form.workspace();
        let (mut velocity, mut acceleration) = (y.rate.clone(), y.rate.clone());
        self.form.velocity(&mut workspace, t, &y, &mut velocity);
        self.form.acceleration(&mut workspace, t, &y, &mut acceleration);
        y.configuration.drift(&velocity, dt);
        y.rate.axpy(dt, &acceleration);
        self.decoder.decode(&y, out);
    }
}

/// The engine that a stepper is, with the system in the form that it integrates and the way back from there.
pub struct FormEngine<'a, Q: Configuration, B: System, M: Stepper<B>, D> {
    stepper: &'a M,
    estimate: Option<Estimate<Self>>,
    memories: Vec<M::Memory>,
    slots: Slots<'a, Q, B, D>,
}

impl<'a, Q, B, M, D> FormEngine<'a, Q, B, M, D>
where
    Q: Configuration,
    B: System,
    M: Stepper<B>,
    D: Decoder<B::Configuration, Q>,
{
    /// An engine for trajectories through states of the size of `x`, which is in the variables that the method integrates.
    pub fn start(
        form: &'a B,
        stepper: &'a M,
        decoder: D,
        encode: Encode<'a, Q, B::Configuration>,
        x: StateOf<B>,
    ) -> Result<Self, StepError> {
        let memories = vec![stepper.start(form, &x)?];
        let slots = Slots { form, decoder, encode, states: Vec::new(), pattern: x };
        Ok(Self { stepper, estimate: None, memories, slots })
    }

    /// The same with the estimate of the method.
    pub fn with_estimate(self) -> Self
    where
        M: EmbeddedStepper<B>,
    {
        let attempt = |engine: &mut Self, t, h, from, to, tolerances: &Tolerances| {
            let (form, stepper) = (engine.slots.form, engine.stepper);
            let [before, after] = engine.slots.pair(from, to)?;
            let memory = &mut engine.memories[Track::RUN.0];
            stepper.step(form, t, before, h, memory, after)?;
            let error = stepper.error(before, after, h, memory, tolerances);
            after.configuration.renormalize();
            Ok(if after.is_finite() { error } else { f64::NAN })
        };
        let longest_step = |engine: &mut Self, from: Slot, tolerances: &Tolerances| {
            let (form, memory) = (engine.slots.form, &mut engine.memories[Track::RUN.0]);
            engine.stepper.longest_step(form, &engine.slots.states[from.0], memory, tolerances)
        };
        let reject = |engine: &mut Self| engine.stepper.reject(&mut engine.memories[Track::RUN.0]);
        Self { estimate: Some(Estimate { attempt, longest_step, reject }), ..self }
    }
}

impl<'a, B: System, M: Stepper<B>> FormEngine<'a, B::Configuration, B, M, Unchanged> {
    /// An engine of a method that integrates the variables of the system itself, for trajectories through states of the size of `x`.
    pub(crate) fn unchanged(system: &'a B, stepper: &'a M, x: StateOf<B>) -> Result<Self, StepError> {
        Self::start(system, stepper, Unchanged, &|x, out| out.assign(x), x)
    }
}

impl<Q, B, M, D> Engine<Q> for FormEngine<'_, Q, B, M, D>
where
    Q: Configuration,
    B: System,
    M: Stepper<B>,
    D: Decoder<B::Configuration, Q>,
{
    fn info(&self) -> MethodInfo {
        M::INFO
    }

    fn on_vectors(&self) -> Option<Tableau> {
        self.stepper.on_vectors()
    }

    fn keep(&mut self, x: &State<Q>) -> Slot {
        self.slots.keep(x)
    }

    fn write(&mut self, slot: Slot, x: &State<Q>) {
        self.slots.write(slot, x);
    }

    fn read(&self, slot: Slot, out: &mut State<Q>) {
        self.slots.read(slot, out);
    }

    fn branch(&mut self, x: &State<Q>) -> Result<Track, StepError> {
        self.memories.push(self.stepper.start(self.slots.form, &self.slots.encoded(x))?);
        Ok(Track(self.memories.len() - 1))
    }

    fn restart(&mut self, track: Track) {
        self.stepper.restart(&mut self.memories[track.0]);
    }

    fn advance(
        &mut self,
        track: Track,
        t: f64,
        h: f64,
        from: Slot,
        to: Slot,
        seen: Option<&mut State<Q>>,
    ) -> Result<(), IntegrateError> {
        let form = self.slots.form;
        let [before, after] = self.slots.pair(from, to)?;
        self.stepper.step(form, t, before, h, &mut self.memories[track.0], after)?;
        after.configuration.renormalize();
        if !after.is_finite() {
            return Err(IntegrateError::NonFinite { t: t + h });
        }
        if let Some(seen) = seen {
            self.slots.read(to, seen);
        }
        Ok(())
    }

    fn march(&mut self, t: f64, h: f64, steps: u64, slot: Slot) -> Result<(), IntegrateError> {
        if B::IS_WATCHED {
            let other = Slot(self.slots.states.len());
            self.slots.states.push(self.slots.states[slot.0].clone());
            let outcome = (0..steps).try_for_each(|n| {
                self.advance(Track::RUN, t + n as f64 * h, h, slot, other, None)?;
                self.slots.states.swap(slot.0, other.0);
                Ok(())
            });
            self.slots.states.pop();
            return outcome;
        }
        // On the stack the states of a body and the memory of a method stay in registers from step to step, and a copy
        // of a state there costs less than an exchange of two.
        let (form, stepper) = (self.slots.form, self.stepper);
        let mut memory = self.memories.swap_remove(Track::RUN.0);
        let mut before = self.slots.states[slot.0].clone();
        let mut after = before.clone();
        let mut outcome = Ok(());
        for n in 0..steps {
            let t = t + n as f64 * h;
            if let Err(error) = stepper.step(form, t, &before, h, &mut memory, &mut after) {
                outcome = Err(error.into());
                break;
            }
            after.configuration.renormalize();
            if !after.is_finite() {
                outcome = Err(IntegrateError::NonFinite { t: t + h });
                break;
            }
            if <StateOf<B> as Storage>::Allocation::ON_STACK {
                before.assign(&after);
            } else {
                std::mem::swap(&mut before, &mut after);
            }
        }
        self.slots.states[slot.0] = before;
        self.memories.push(memory);
        let last = self.memories.len() - 1;
        self.memories.swap(Track::RUN.0, last);
        outcome
    }

    fn segment(&mut self, track: Track, t: f64, h: f64, from: Slot, to: Slot) -> Box<dyn Interpolant<Q>> {
        let (x, after) = (&self.slots.states[from.0], &self.slots.states[to.0]);
        let memory = &mut self.memories[track.0];
        self.slots.decoded(self.stepper.segment(self.slots.form, t, x, h, memory, after))
    }

    fn control(&self, settings: &Adaptive, t: f64, x: Slot) -> Result<StepSizeControl, IntegrateError> {
        StepSizeControl::try_new(settings, &M::INFO, self.slots.form, t, &self.slots.states[x.0])
    }

    fn restart_control(&self, control: &mut StepSizeControl, t: f64, x: Slot) {
        control.restart(self.slots.form, t, &self.slots.states[x.0]);
    }

    fn attempt(
        &mut self,
        t: f64,
        h: f64,
        from: Slot,
        to: Slot,
        tolerances: &Tolerances,
    ) -> Result<f64, IntegrateError> {
        match &self.estimate {
            Some(Estimate { attempt, .. }) => attempt(self, t, h, from, to, tolerances),
            None => Err(IntegrateError::NoErrorEstimate { method: M::INFO.name }),
        }
    }

    fn longest_step(&mut self, from: Slot, tolerances: &Tolerances) -> Result<Option<f64>, IntegrateError> {
        match &self.estimate {
            Some(Estimate { longest_step, .. }) => Ok(longest_step(self, from, tolerances)?),
            None => Ok(None),
        }
    }

    fn reject(&mut self) {
        if let Some(Estimate { reject, .. }) = &self.estimate {
            reject(self);
        }
    }

    fn nudge(&mut self, t: f64, x: &State<Q>, dt: f64, out: &mut State<Q>) {
        self.slots.nudge(t, x, dt, out);
    }
}
