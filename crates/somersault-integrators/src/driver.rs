//! Drivers: from an initial state over an interval of time, by steps of fixed or adapted size ([`Steps`]).
//!
//! [`Run`](crate::run::Run) calls them.
//!
//! A fixed-step run counts its steps and computes each time from the count; where the step does not
//! divide the interval the last one is shorter and the memory is restarted for it. After every step
//! the rounding that products of unit quaternions gather is removed once, for every method alike
//! ([`Configuration::renormalize`]).

use crate::dense::Interpolant;
use crate::engine::{Engine, EngineStep, Interior, Slot, Track};
pub use crate::error::IntegrateError;
use crate::events::GuardChange;
use crate::state::{Configuration, Rate, State};
pub use crate::step_size::Adaptive;
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

    /// Time and size of the step after `n`, and whether its size differs from that of the step before.
    #[inline]
    fn step(&self, n: u64) -> (f64, f64, bool) {
        let t = self.time(n);
        if n < self.full_steps { (t, self.dt, false) } else { (t, self.end - t, true) }
    }

    /// Time after `n` steps; exactly the end after the last.
    pub fn time(&self, n: u64) -> f64 {
        if n >= self.steps() { self.end } else { self.start + n as f64 * self.dt }
    }
}

/// How the steps of a run are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Steps {
    /// On a grid of times.
    Fixed(TimeGrid),
    /// Adapted to tolerances, from one time to another; [`crate::step_size`] says how.
    Adapted {
        /// Start and end.
        interval: (f64, f64),
        /// What the steps are adapted to.
        settings: Adaptive,
    },
}

impl Steps {
    /// Steps adapted to tolerances, from `interval.0` to `interval.1`.
    pub fn adapted(interval: (f64, f64), settings: Adaptive) -> Self {
        Self::Adapted { interval, settings }
    }

    /// Start and end.
    pub fn interval(&self) -> (f64, f64) {
        match self {
            Self::Fixed(grid) => (grid.start, grid.end),
            Self::Adapted { interval, .. } => *interval,
        }
    }
}

impl From<TimeGrid> for Steps {
    fn from(grid: TimeGrid) -> Self {
        Self::Fixed(grid)
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
    /// How many steps the control of their size has rejected up to this one.
    pub rejected: u64,
    /// The guards that change their signs at its end.
    pub changes: &'a [GuardChange],
    interior: &'a mut dyn Interior<Q>,
    end: Option<(f64, State<Q>)>,
}

impl<'a, Q: Configuration> Step<'a, Q> {
    /// A step as a driver shows it: the `index`-th, between two times and the states there, with what is between them. None was rejected,
    /// and no guard changes its sign.
    pub fn new(
        index: u64,
        times: (f64, f64),
        before: &'a State<Q>,
        after: &'a State<Q>,
        interior: &'a mut dyn Interior<Q>,
    ) -> Self {
        let (t_before, t_after) = times;
        Self { index, t_before, t_after, before, after, rejected: 0, changes: &[], interior, end: None }
    }

    /// The curve of this step.
    pub fn interpolant(&mut self) -> Box<dyn Interpolant<Q>> {
        self.interior.interpolant()
    }

    /// What is between the ends of this step.
    pub fn interior(&mut self) -> &mut dyn Interior<Q> {
        &mut *self.interior
    }

    /// The states at times within this step, in their order: by its curve where that is of the order of the method, and
    /// otherwise by the method itself, which makes the part of the step up to each time.
    ///
    /// Where the method refuses a part, the curve stands for it.
    pub fn states_at(&mut self, times: &[f64]) -> Vec<State<Q>> {
        let mut curve = None;
        let by_curve = self.interior.is_curve_of_full_order();
        let mut state_at = |&t: &f64| {
            let mut state = self.after.clone();
            let length = (t - self.t_before).abs();
            let is_end = t == self.t_after;
            if !is_end && (by_curve || length == 0.0 || self.interior.part(length, &mut state).is_err()) {
                let curve = curve.get_or_insert_with(|| self.interior.interpolant());
                curve.evaluate(t, &mut state);
            }
            state
        };
        times.iter().map(&mut state_at).collect()
    }

    /// Ends the run within this step, at a state on its way; the observer that does so answers [`Flow::Stop`].
    pub fn end_at(&mut self, t: f64, state: State<Q>) {
        self.end = Some((t, state));
    }

    /// Where the run ends within this step, if it does.
    pub fn end(&self) -> Option<&(f64, State<Q>)> {
        self.end.as_ref()
    }

    /// Shows an observer what the run keeps of this step: all of it, or the part up to where it ends.
    pub fn show(&mut self, observer: &mut dyn Observer<Q>) -> Flow {
        let Some((t, state)) = self.end.take() else { return observer.observe(self) };
        let mut kept = Step::new(self.index, (self.t_before, t), self.before, &state, &mut *self.interior);
        kept.rejected = self.rejected;
        let flow = observer.observe(&mut kept);
        let earlier = kept.end.take();
        self.end = Some(earlier.unwrap_or((t, state)));
        flow
    }

    /// Shows it as a driver does, which then knows where the run ends within it.
    pub(crate) fn shown_to(mut self, observer: &mut dyn Observer<Q>) -> (Flow, Option<(f64, State<Q>)>) {
        (observer.observe(&mut self), self.end)
    }
}

/// Sees each step as it is made. `()` sees nothing.
pub trait Observer<Q: Configuration> {
    /// False for an observer that looks at nothing, so that a run without one pays nothing; asked once a run.
    fn is_active(&self) -> bool {
        true
    }
    /// Looks at a step and says whether to continue.
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow;
}

impl<Q: Configuration> Observer<Q> for () {
    fn is_active(&self) -> bool {
        false
    }
    fn observe(&mut self, _: &mut Step<'_, Q>) -> Flow {
        Flow::Continue
    }
}

#[deny(clippy::missing_trait_methods)]
impl<Q: Configuration, O: Observer<Q> + ?Sized> Observer<Q> for &mut O {
    fn is_active(&self) -> bool {
        (**self).is_active()
    }
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

/// Fixed steps by an engine that was started from a state, which is finite.
pub(crate) fn run_fixed<Q: Configuration>(
    engine: &mut dyn Engine<Q>,
    initial: &State<Q>,
    grid: &TimeGrid,
    observer: &mut dyn Observer<Q>,
) -> Result<Outcome<Q>, IntegrateError> {
    let mut show = Show::new(initial, observer);
    let (mut from, mut to) = (engine.keep(initial), engine.keep(initial));
    let steps = grid.steps();
    let mut n = 0;
    if !show.is_active {
        n = grid.full_steps;
        engine.march(grid.start, grid.dt, n, from)?;
    }
    while n < steps {
        let (t, h, is_short) = grid.step(n);
        if is_short {
            engine.restart(Track::RUN);
        }
        engine.advance(Track::RUN, t, h, from, to, show.room())?;
        n += 1;
        let flow = show.step(engine, (n, 0), (t, grid.time(n)), h, (from, to));
        std::mem::swap(&mut from, &mut to);
        if flow == Flow::Stop {
            break;
        }
    }
    let t = grid.time(n);
    Ok(show.outcome(engine, from, (t, grid.end), (n, 0)))
}

/// Adapted steps by an engine with an estimate that was started from a state, which is finite. A step ends where the equations are not
/// smooth, of which `next_stop` has the first time on the way from one to another.
pub(crate) fn run_adaptive<Q: Configuration>(
    engine: &mut dyn Engine<Q>,
    initial: &State<Q>,
    ((start, end), settings): ((f64, f64), &Adaptive),
    next_stop: &dyn Fn(f64, f64) -> Option<f64>,
    observer: &mut dyn Observer<Q>,
) -> Result<Outcome<Q>, IntegrateError> {
    check_interval(start, end)?;
    let mut show = Show::new(initial, observer);
    let (mut from, mut to) = (engine.keep(initial), engine.keep(initial));
    let mut control = engine.control(settings, start, from)?;
    let mut t = start;
    let mut until = start;
    while t < end {
        if t >= until {
            until = next_stop(t, end).unwrap_or(end);
        }
        if control.is_free()
            && let Some(longest) = engine.longest_step(from, &settings.tolerances)?
        {
            control.choose(longest);
        }
        let (h, t_after) = control.propose(t, until)?;
        let (error, unsolved) = judge(engine.attempt(t, h, from, to, &settings.tolerances))?;
        match control.accepts(t, h, error) {
            Ok(true) => {}
            Ok(false) => {
                engine.reject();
                continue;
            }
            Err(limit) => return Err(unsolved.unwrap_or(limit)),
        }
        if let Some(room) = show.room() {
            engine.read(to, room);
        }
        let counts = (control.accepted(), control.rejected());
        let flow = show.step(engine, counts, (t, t_after), h, (from, to));
        t = t_after;
        std::mem::swap(&mut from, &mut to);
        if flow == Flow::Stop {
            break;
        }
    }
    Ok(show.outcome(engine, from, (t, end), (control.accepted(), control.rejected())))
}

/// The error of an attempted step for the control of its size: NaN, so that it is too large, where the method refuses the step
/// and may take a shorter one, with the reason.
pub(crate) fn judge(
    attempt: Result<f64, IntegrateError>,
) -> Result<(f64, Option<IntegrateError>), IntegrateError> {
    match attempt {
        Ok(error) => Ok((error, None)),
        Err(reason) if reason.is_of_the_step() => Ok((f64::NAN, Some(reason))),
        Err(reason) => Err(reason),
    }
}

/// Shows the steps of an engine to an observer.
struct Show<'a, Q: Configuration> {
    observer: &'a mut dyn Observer<Q>,
    is_active: bool,
    before: State<Q>,
    after: State<Q>,
    /// The memory and the slot of parts of steps.
    place: Option<(Track, Slot)>,
    /// Where the run ended within the last step, if it did.
    end: Option<(f64, State<Q>)>,
}

impl<'a, Q: Configuration> Show<'a, Q> {
    fn new(initial: &State<Q>, observer: &'a mut dyn Observer<Q>) -> Self {
        let is_active = observer.is_active();
        let (before, after) = (initial.clone(), initial.clone());
        Self { observer, is_active, before, after, place: None, end: None }
    }

    /// Room for the state after a step, where it is shown.
    fn room(&mut self) -> Option<&mut State<Q>> {
        self.is_active.then_some(&mut self.after)
    }

    /// Shows the step of h just made from one slot to another, which led to the state in the room for it.
    fn step(
        &mut self,
        engine: &mut dyn Engine<Q>,
        (index, rejected): (u64, u64),
        (t_before, t_after): (f64, f64),
        h: f64,
        (from, to): (Slot, Slot),
    ) -> Flow {
        if !self.is_active {
            return Flow::Continue;
        }
        let Self { before, after, place, .. } = self;
        let mut interior = EngineStep { engine, t: t_before, h, from, to, before, place };
        let mut step = Step::new(index, (t_before, t_after), before, after, &mut interior);
        step.rejected = rejected;
        let flow;
        (flow, self.end) = step.shown_to(self.observer);
        std::mem::swap(&mut self.before, &mut self.after);
        flow
    }

    /// The outcome of a run to `end` that has reached t, with the state in a slot, unless it ended within its last step.
    fn outcome(
        self,
        engine: &dyn Engine<Q>,
        slot: Slot,
        (t, end): (f64, f64),
        (steps, rejected): (u64, u64),
    ) -> Outcome<Q> {
        let mut state = self.after;
        let (t, state) = self.end.unwrap_or_else(|| {
            engine.read(slot, &mut state);
            (t, state)
        });
        let status = if t < end { Status::Stopped } else { Status::Finished };
        Outcome { t, state, status, steps, rejected }
    }
}
