//! Step doubling: steps of any one-step method adapted to tolerances.
//!
//! A method without an estimate of its own makes each step of h from a state x₀ twice: whole, to x̂, and as two steps of h/2, to x. With
//! p the order of the method the error of x is
//!
//! ```math
//! e = \frac{x - \hat x}{2^p - 1} + O(h^{p+2})
//! ```
//! (E. Hairer, S. P. Nørsett and G. Wanner, *Solving Ordinary Differential Equations I* (1993), section II.4). On the group x − x̂ is the
//! logarithm of the rotation between the two. Where a method has several orders ([`Orders`](crate::stepper::Orders)) p is the least of
//! them: parts of the motion of a higher order have a smaller error than is estimated.
//!
//! The run continues from x as it is, without extrapolation. Its steps are therefore steps of the method, and what these conserve is
//! conserved. Parts of a step, to which events are located, are two steps of half their length as well; the curve of a step is that of
//! its halves. The cost is that of three steps of the method for each of the control, and of two more for a curve.
//!
//! A method that remembers previous steps takes no part: a change of its step costs it its memory.

use crate::dense::Interpolant;
use crate::engine::{Engine, Slot, Track};
use crate::error::IntegrateError;
use crate::state::{Configuration, Rate, State, Tolerances};
use crate::step_size::{Adaptive, StepSizeControl};
use crate::stepper::{MethodInfo, StepError, weighed_error};
use crate::tableau::Tableau;

/// Errors where the steps of a method cannot be adapted.
pub(crate) fn check_adaptive(method: &MethodInfo) -> Result<(), IntegrateError> {
    if method.is_adaptive() { Ok(()) } else { Err(IntegrateError::NoErrorEstimate { method: method.name }) }
}

/// Hands an engine to a driver, with its steps doubled if requested.
pub(crate) fn hand_over<Q: Configuration, R>(
    engine: &mut dyn Engine<Q>,
    is_doubled: bool,
    initial: &State<Q>,
    run: &mut dyn FnMut(&mut dyn Engine<Q>) -> R,
) -> Result<R, StepError> {
    if is_doubled { Ok(run(&mut Doubled::start(engine, initial)?)) } else { Ok(run(engine)) }
}

/// An engine each of whose steps is two of another one, with an estimate of their error by one whole step of that.
struct Doubled<'a, Q: Configuration> {
    engine: &'a mut dyn Engine<Q>,
    /// 2^p − 1.
    divisor: f64,
    /// The memory of whole steps and of those of curves.
    track: Track,
    /// Where whole steps and the halves of curves lead, and where half a step leads.
    whole: Slot,
    middle: Slot,
    /// States before a step, after it, and after the whole step.
    states: [State<Q>; 3],
    errors: [Q::Rate; 2],
}

impl<'a, Q: Configuration> Doubled<'a, Q> {
    fn start(engine: &'a mut dyn Engine<Q>, x: &State<Q>) -> Result<Self, StepError> {
        let order = engine.info().least_order();
        Ok(Self {
            divisor: f64::from(order).exp2() - 1.0,
            track: engine.branch(x)?,
            whole: engine.keep(x),
            middle: engine.keep(x),
            states: std::array::from_fn(|_| x.clone()),
            errors: std::array::from_fn(|_| x.rate.clone()),
            engine,
        })
    }

    /// The weighed error of the step just made, by its state and that of the whole step.
    fn error(&mut self, tolerances: &Tolerances) -> f64 {
        let [before, after, whole] = &self.states;
        let [displacement, change] = &mut self.errors;
        after.configuration.difference(&whole.configuration, displacement);
        displacement.scale(1.0 / self.divisor);
        change.assign(&after.rate);
        change.axpy(-1.0, &whole.rate);
        change.scale(1.0 / self.divisor);
        weighed_error(before, after, displacement, change, tolerances)
    }

    /// The curves of two steps of h.
    fn halves(&mut self, t: f64, h: f64, from: Slot) -> Result<[Box<dyn Interpolant<Q>>; 2], IntegrateError> {
        let Self { engine, track, middle, whole, .. } = self;
        engine.restart(*track);
        engine.advance(*track, t, h, from, *middle, None)?;
        let first = engine.segment(*track, t, h, from, *middle);
        engine.advance(*track, t + h, h, *middle, *whole, None)?;
        Ok([first, engine.segment(*track, t + h, h, *middle, *whole)])
    }

    /// Makes both steps of an attempt.
    fn make(&mut self, t: f64, h: f64, from: Slot, to: Slot) -> Result<(), IntegrateError> {
        self.engine.restart(self.track);
        self.engine.advance(self.track, t, h, from, self.whole, None)?;
        self.advance(Track::RUN, t, h, from, to, None)?;
        let slots = [from, to, self.whole];
        slots.iter().zip(&mut self.states).for_each(|(slot, state)| self.engine.read(*slot, state));
        Ok(())
    }
}

impl<Q: Configuration> Engine<Q> for Doubled<'_, Q> {
    fn info(&self) -> MethodInfo {
        self.engine.info()
    }

    /// None: the stages of a step are those of three.
    fn on_vectors(&self) -> Option<Tableau> {
        None
    }

    fn keep(&mut self, x: &State<Q>) -> Slot {
        self.engine.keep(x)
    }

    fn write(&mut self, slot: Slot, x: &State<Q>) {
        self.engine.write(slot, x);
    }

    fn read(&self, slot: Slot, out: &mut State<Q>) {
        self.engine.read(slot, out);
    }

    fn branch(&mut self, x: &State<Q>) -> Result<Track, StepError> {
        self.engine.branch(x)
    }

    fn restart(&mut self, track: Track) {
        self.engine.restart(track);
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
        let half = 0.5 * h;
        self.engine.advance(track, t, half, from, self.middle, None)?;
        self.engine.advance(track, t + half, half, self.middle, to, seen)
    }

    fn march(&mut self, t: f64, h: f64, steps: u64, slot: Slot) -> Result<(), IntegrateError> {
        self.engine.march(t, 0.5 * h, 2 * steps, slot)
    }

    /// The halves are made again, in a memory of their own, so that the curve is right for methods that make theirs from what a step has
    /// left. Where a half is refused, which the step was not, the curve over the whole step stands for them.
    fn segment(&mut self, track: Track, t: f64, h: f64, from: Slot, to: Slot) -> Box<dyn Interpolant<Q>> {
        let curves = self.halves(t, 0.5 * h, from);
        let whole = |_| self.engine.segment(track, t, h, from, to);
        curves.map_or_else(whole, |curves| Box::new(Halves { middle: t + 0.5 * h, curves }))
    }

    fn control(&self, settings: &Adaptive, t: f64, x: Slot) -> Result<StepSizeControl, IntegrateError> {
        self.engine.control(settings, t, x)
    }

    fn restart_control(&self, control: &mut StepSizeControl, t: f64, x: Slot) {
        self.engine.restart_control(control, t, x);
    }

    fn attempt(
        &mut self,
        t: f64,
        h: f64,
        from: Slot,
        to: Slot,
        tolerances: &Tolerances,
    ) -> Result<f64, IntegrateError> {
        match self.make(t, h, from, to) {
            Ok(()) => Ok(self.error(tolerances)),
            Err(IntegrateError::NonFinite { .. }) => Ok(f64::NAN),
            Err(reason) => Err(reason),
        }
    }

    fn reject(&mut self) {
        self.engine.restart(Track::RUN);
    }

    fn nudge(&mut self, t: f64, x: &State<Q>, dt: f64, out: &mut State<Q>) {
        self.engine.nudge(t, x, dt, out);
    }
}

/// The curves of the halves of a step.
struct Halves<Q: Configuration> {
    middle: f64,
    curves: [Box<dyn Interpolant<Q>>; 2],
}

impl<Q: Configuration> Interpolant<Q> for Halves<Q> {
    fn evaluate(&self, t: f64, out: &mut State<Q>) {
        let [first, last] = &self.curves;
        if t < self.middle { first.evaluate(t, out) } else { last.evaluate(t, out) }
    }
}
