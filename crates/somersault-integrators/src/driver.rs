//! Drivers: from an initial state over an interval of time, by steps of fixed or adapted size.
//!
//! A fixed-step run counts its steps and computes each time from the count; where the step does not
//! divide the interval the last one is shorter and the memory is restarted for it. After every step
//! the rounding that products of unit quaternions gather is removed once, for every method alike
//! ([`Configuration::renormalize`]).

mod error;

pub use error::IntegrateError;

use crate::dense::{Decoded, Interpolant, Segment};
use crate::state::{Configuration, Poses, Rate, State};
pub use crate::step_size::Adaptive;
use crate::step_size::StepSizeControl;
use crate::stepper::{EmbeddedStepper, Stepper};
use crate::system::{Decoder, Form, StateOf, System};
use somersault_core::argument::{ArgumentError, expect_positive};
pub use somersault_core::cancel::Flow;

/// An interval of time divided into steps of equal size, the last one possibly shorter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeGrid {
    start: f64,
    end: f64,
    dt: f64,
    full_steps: u64,
    has_remainder: bool,
}

impl TimeGrid {
    /// Steps of size `dt` from `start` to `end` > `start`.
    ///
    /// An interval within a relative 1e-9 of a whole number of steps is taken as that number, so that
    /// ten steps of 0.1 reach 1.
    pub fn try_new(start: f64, end: f64, dt: f64) -> Result<Self, IntegrateError> {
        check_interval(start, end)?;
        expect_positive("dt", dt)?;
        let ratio = (end - start) / dt;
        // Beyond 2⁵³ steps, or below the spacing of the times, the times would repeat.
        if ratio >= 9e15 || start + dt == start || end - dt == end {
            return Err(IntegrateError::TooManySteps { dt, start, end });
        }
        let nearest = ratio.round();
        if nearest >= 1.0 && (ratio - nearest).abs() <= 1e-9 * nearest {
            Ok(Self { start, end, dt, full_steps: nearest as u64, has_remainder: false })
        } else {
            Ok(Self { start, end, dt, full_steps: ratio.floor() as u64, has_remainder: true })
        }
    }

    /// `steps` equal steps from `start` to `end`.
    pub fn try_with_steps(start: f64, end: f64, steps: u64) -> Result<Self, IntegrateError> {
        check_interval(start, end)?;
        if steps == 0 {
            return Err(ArgumentError::NotPositive { argument: "steps", found: 0.0 }.into());
        }
        Self::try_new(start, end, (end - start) / steps as f64)
    }

    /// Size of the steps, but for a shorter last one.
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Number of steps of full size.
    pub fn full_steps(&self) -> u64 {
        self.full_steps
    }

    /// Number of steps.
    pub fn steps(&self) -> u64 {
        self.full_steps + u64::from(self.has_remainder)
    }

    /// Time after `n` steps; exactly the end after the last.
    pub fn time(&self, n: u64) -> f64 {
        if n >= self.steps() { self.end } else { self.start + n as f64 * self.dt }
    }
}

/// Errors where an interval is empty, reversed or not finite.
pub fn check_interval(start: f64, end: f64) -> Result<(), IntegrateError> {
    if start.is_finite() && end.is_finite() && start < end {
        Ok(())
    } else {
        Err(IntegrateError::Interval { start, end })
    }
}

/// Errors where a part of an initial state is not finite.
pub fn check_state<Q: Configuration>(x: &State<Q>) -> Result<(), IntegrateError> {
    if !x.configuration.is_finite() {
        Err(IntegrateError::InitialState { found: "a NaN or infinite position or orientation" })
    } else if !x.rate.is_finite() {
        Err(IntegrateError::InitialState { found: "a NaN or infinite velocity or angular velocity" })
    } else {
        Ok(())
    }
}

/// A step just made.
pub struct Step<'a, Q: Configuration> {
    /// Its number, from 1.
    pub index: u64,
    /// Time before.
    pub t_before: f64,
    /// Time after.
    pub t_after: f64,
    /// State before.
    pub before: &'a State<Q>,
    /// State after.
    pub after: &'a State<Q>,
    interpolant: &'a mut dyn FnMut() -> Box<dyn Interpolant<Q>>,
}

impl<'a, Q: Configuration> Step<'a, Q> {
    /// A step as a driver shows it: the `index`-th, between two times and the states there, with the
    /// curve between them made on demand.
    pub fn new(
        index: u64,
        times: (f64, f64),
        before: &'a State<Q>,
        after: &'a State<Q>,
        interpolant: &'a mut dyn FnMut() -> Box<dyn Interpolant<Q>>,
    ) -> Self {
        Self { index, t_before: times.0, t_after: times.1, before, after, interpolant }
    }

    /// The curve of this step.
    pub fn interpolant(&mut self) -> Box<dyn Interpolant<Q>> {
        (self.interpolant)()
    }
}

/// Sees each step as it is made. `()` sees nothing.
pub trait Observer<Q: Configuration> {
    /// False for an observer that looks at nothing, so that a run without one pays nothing.
    const ACTIVE: bool = true;
    /// Looks at a step and says whether to go on.
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow;
}

impl<Q: Configuration> Observer<Q> for () {
    const ACTIVE: bool = false;
    fn observe(&mut self, _: &mut Step<'_, Q>) -> Flow {
        Flow::Continue
    }
}

#[deny(clippy::missing_trait_methods)]
impl<Q: Configuration, O: Observer<Q>> Observer<Q> for &mut O {
    const ACTIVE: bool = O::ACTIVE;
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        (**self).observe(step)
    }
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// At the end of the interval.
    Finished,
    /// An observer stopped it.
    Stopped,
}

/// Where a run ended and what it took.
#[derive(Debug, Clone)]
pub struct Outcome<Q: Configuration> {
    /// Time reached.
    pub t: f64,
    /// State there.
    pub state: State<Q>,
    /// How it ended.
    pub status: Status,
    /// Steps taken.
    pub steps: u64,
    /// Steps tried and rejected by the step size control.
    pub rejected: u64,
}

/// Integrates over a grid of times with a fixed step.
///
/// Errors: a state that is not finite, at the start or after a step, and failures of the method.
pub fn integrate<S, M, O>(
    system: &S,
    stepper: &M,
    initial: &StateOf<S>,
    grid: &TimeGrid,
    observer: &mut O,
) -> Result<Outcome<S::Configuration>, IntegrateError>
where
    S: System,
    M: Stepper<S>,
    O: Observer<S::Configuration>,
{
    integrate_observed(system, stepper, initial, grid, &mut |step| {
        if !O::ACTIVE {
            return Flow::Continue;
        }
        let mut interpolant = || Box::new((step.segment)()) as Box<dyn Interpolant<S::Configuration>>;
        observer.observe(&mut Step {
            index: step.index,
            t_before: step.t_before,
            t_after: step.t_after,
            before: step.before,
            after: step.after,
            interpolant: &mut interpolant,
        })
    })
}

/// A step in the variables of the system that is integrated.
struct RawStep<'a, Q: Configuration> {
    index: u64,
    t_before: f64,
    t_after: f64,
    before: &'a State<Q>,
    after: &'a State<Q>,
    segment: &'a mut dyn FnMut() -> Segment<Q>,
}

fn integrate_observed<S: System, M: Stepper<S>>(
    system: &S,
    stepper: &M,
    initial: &StateOf<S>,
    grid: &TimeGrid,
    observe: &mut impl FnMut(RawStep<'_, S::Configuration>) -> Flow,
) -> Result<Outcome<S::Configuration>, IntegrateError> {
    check_state(initial)?;
    let mut memory = stepper.start(system, initial)?;
    let mut before = initial.clone();
    let mut after = initial.clone();
    let steps = grid.steps();
    for n in 0..steps {
        let t = grid.time(n);
        let h = if n < grid.full_steps { grid.dt } else { grid.end - t };
        if n == grid.full_steps {
            stepper.restart(&mut memory);
        }
        stepper.step(system, t, &before, h, &mut memory, &mut after)?;
        after.configuration.renormalize();
        let t_after = grid.time(n + 1);
        if !after.is_finite() {
            return Err(IntegrateError::NonFinite { t: t_after });
        }
        let flow = observe(RawStep {
            index: n + 1,
            t_before: t,
            t_after,
            before: &before,
            after: &after,
            segment: &mut || stepper.segment(system, t, &before, h, &mut memory, &after),
        });
        std::mem::swap(&mut before, &mut after);
        if flow == Flow::Stop && n + 1 < steps {
            return Ok(Outcome {
                t: t_after,
                state: before,
                status: Status::Stopped,
                steps: n + 1,
                rejected: 0,
            });
        }
    }
    Ok(Outcome { t: grid.end, state: before, status: Status::Finished, steps, rejected: 0 })
}

/// Integrates from `interval.0` to `interval.1` with steps adapted to tolerances.
///
/// [`crate::step_size`] says how.
pub fn integrate_adaptive<S, M, O>(
    system: &S,
    stepper: &M,
    initial: &StateOf<S>,
    interval: (f64, f64),
    control: &Adaptive,
    observer: &mut O,
) -> Result<Outcome<S::Configuration>, IntegrateError>
where
    S: System,
    M: EmbeddedStepper<S>,
    O: Observer<S::Configuration>,
{
    adapt_observed(system, stepper, initial, interval, control, &mut |step| {
        if !O::ACTIVE {
            return Flow::Continue;
        }
        let mut interpolant = || Box::new((step.segment)()) as Box<dyn Interpolant<S::Configuration>>;
        observer.observe(&mut Step {
            index: step.index,
            t_before: step.t_before,
            t_after: step.t_after,
            before: step.before,
            after: step.after,
            interpolant: &mut interpolant,
        })
    })
}

fn adapt_observed<S: System, M: EmbeddedStepper<S>>(
    system: &S,
    stepper: &M,
    initial: &StateOf<S>,
    (start, end): (f64, f64),
    settings: &Adaptive,
    observe: &mut impl FnMut(RawStep<'_, S::Configuration>) -> Flow,
) -> Result<Outcome<S::Configuration>, IntegrateError> {
    check_interval(start, end)?;
    check_state(initial)?;
    let mut memory = stepper.start(system, initial)?;
    let mut control = StepSizeControl::try_new(settings, &M::INFO, system, start, initial)?;
    let mut before = initial.clone();
    let mut after = initial.clone();
    let mut t = start;
    while t < end {
        let (step, t_after) = control.propose(t, end)?;
        stepper.step(system, t, &before, step, &mut memory, &mut after)?;
        let error = stepper.error(&before, &after, step, &mut memory, &settings.tolerances);
        // A NaN from a wild trial step counts as an error too large, like any other.
        if !control.accepts(t, step, if after.is_finite() { error } else { f64::NAN })? {
            stepper.reject(&mut memory);
            continue;
        }
        after.configuration.renormalize();
        let flow = observe(RawStep {
            index: control.accepted(),
            t_before: t,
            t_after,
            before: &before,
            after: &after,
            segment: &mut || stepper.segment(system, t, &before, step, &mut memory, &after),
        });
        t = t_after;
        std::mem::swap(&mut before, &mut after);
        if flow == Flow::Stop && t < end {
            let (steps, rejected) = (control.accepted(), control.rejected());
            return Ok(Outcome { t, state: before, status: Status::Stopped, steps, rejected });
        }
    }
    let (steps, rejected) = (control.accepted(), control.rejected());
    Ok(Outcome { t: end, state: before, status: Status::Finished, steps, rejected })
}

/// Integrates a form of the bodies, showing the observer the bodies themselves.
pub(crate) fn integrate_form<Q, B, M, O>(
    form: &B,
    stepper: &M,
    initial: &State<Q>,
    grid: &TimeGrid,
    observer: &mut O,
) -> Result<Outcome<Q>, IntegrateError>
where
    Q: Poses,
    B: Form<Q>,
    M: Stepper<B>,
    O: Observer<Q>,
{
    check_state(initial)?;
    let mut watch = Watch::new(form, initial, observer);
    let outcome =
        integrate_observed(form, stepper, &form.encode(initial), grid, &mut |step| watch.observe(step))?;
    Ok(decode_outcome(form, initial, outcome))
}

/// As [`integrate_form`], with adapted steps.
pub(crate) fn adapt_form<Q, B, M, O>(
    form: &B,
    stepper: &M,
    initial: &State<Q>,
    interval: (f64, f64),
    control: &Adaptive,
    observer: &mut O,
) -> Result<Outcome<Q>, IntegrateError>
where
    Q: Poses,
    B: Form<Q>,
    M: EmbeddedStepper<B>,
    O: Observer<Q>,
{
    check_state(initial)?;
    let mut watch = Watch::new(form, initial, observer);
    let encoded = form.encode(initial);
    let outcome =
        adapt_observed(form, stepper, &encoded, interval, control, &mut |step| watch.observe(step))?;
    Ok(decode_outcome(form, initial, outcome))
}

fn decode_outcome<Q: Poses, B: Form<Q>>(
    form: &B,
    prototype: &State<Q>,
    outcome: Outcome<B::Configuration>,
) -> Outcome<Q> {
    let mut state = prototype.clone();
    form.decoder().decode(&outcome.state, &mut state);
    Outcome { t: outcome.t, state, status: outcome.status, steps: outcome.steps, rejected: outcome.rejected }
}

/// Turns the steps of a form into steps of the bodies for an observer.
struct Watch<'a, Q: Poses, D, O> {
    decoder: D,
    before: State<Q>,
    after: State<Q>,
    observer: &'a mut O,
}

impl<'a, Q: Poses, D: Clone, O: Observer<Q>> Watch<'a, Q, D, O> {
    fn new<B: Form<Q, Decoder = D>>(form: &B, initial: &State<Q>, observer: &'a mut O) -> Self {
        Self { decoder: form.decoder(), before: initial.clone(), after: initial.clone(), observer }
    }

    fn observe<B: Configuration>(&mut self, step: RawStep<'_, B>) -> Flow
    where
        D: Decoder<B, Q> + Send + Sync + 'static,
    {
        if !O::ACTIVE {
            return Flow::Continue;
        }
        self.decoder.decode(step.after, &mut self.after);
        let RawStep { index, t_before, t_after, segment, .. } = step;
        let decoder = &self.decoder;
        let mut interpolant =
            || Box::new(Decoded { segment: segment(), decoder: decoder.clone() }) as Box<dyn Interpolant<Q>>;
        let flow = self.observer.observe(&mut Step {
            index,
            t_before,
            t_after,
            before: &self.before,
            after: &self.after,
            interpolant: &mut interpolant,
        });
        std::mem::swap(&mut self.before, &mut self.after);
        flow
    }
}
