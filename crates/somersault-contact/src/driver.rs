//! The event-locating driver.
//!
//! Each step is made in a frozen mode, along smooth equations. If a guard changes sign over it, or twice
//! within it, the earliest change is found by stepping again from the same state with a smaller h, until
//! h is known to two roundings of the time: the event lies on the method's own trajectory, so that its
//! time has the method's order and nothing is interpolated. The step to the far side of the change is
//! committed, the mode is read there, the memory restarts and the grid of times starts anew.
//!
//! - The committed end of a step to an event has the guard on its new side. What was found is therefore
//!   not found again, and guards that change together are handled together.
//! - Methods with history make the shorter step with their start-up, as after any restart.
//! - A change that comes and goes within one step is found if the gap has one extremum in the step; see
//!   [`Guard`]. What is missed of a graze is as deep as the cubic through the ends of the step is off, h⁴.
//! - A start on the surface belongs to what follows; a start at rest on it is free until it has moved by a
//!   rounding.
//! - A law whose force and rate of force are continuous at release, and whose gap rate is continuous at
//!   touch-down, as (7.10), cannot slide along the border of a mode. Anything else that does ends in
//!   [`Interruption::Chattering`].

use crate::event::{Event, EventKind, Interrupted, Interruption, Located, Location};
use crate::hybrid::{Frozen, Guard, Hybrid, HybridBodies};
use crate::step_curve::StepCurve;
use somersault_core::roots;
use somersault_integrators::dense::{Decoded, Interpolant};
use somersault_integrators::driver::{
    Flow, IntegrateError, Observer, Status, Step, TimeGrid, check_positive, check_state,
};
use somersault_integrators::methods::{Method, Options, Visitor};
use somersault_integrators::state::{Configuration, State};
use somersault_integrators::stepper::Stepper;
use somersault_integrators::system::{Decoder, Form, StateOf, System, Unchanged};

/// The outcome of a run with events.
pub type LocatedResult<Q> = Result<Located<Q>, Box<Interrupted<Q>>>;

/// Integrates bodies with modes by a method of the table, with a fixed step, locating events.
///
/// The steps have the size of the grid, counted anew from each event. The observer sees every committed
/// step, those that end at events among them, with its curve.
///
/// Errors keep the solution up to where they arose: a state or a guard that is not finite, a failure of
/// the method, events that follow each other faster than `location` allows.
///
/// Cost: the guards once a step, and about eight steps for each event.
pub fn integrate_located<H, O>(
    method: Method,
    options: Options,
    system: &H,
    initial: &StateOf<H>,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut O,
) -> LocatedResult<H::Configuration>
where
    H: HybridBodies,
    O: Observer<H::Configuration>,
{
    check_start(initial, grid, location)?;
    let frozen = Frozen::new(system, grid.time(0), initial);
    method.visit(options, &frozen, Visit { frozen: &frozen, initial, grid, location, observer })
}

/// Integrates any system with modes by any stepper, with a fixed step, locating events; see
/// [`integrate_located`].
pub fn integrate_hybrid<H, M, O>(
    frozen: &Frozen<H>,
    stepper: &M,
    initial: &StateOf<H>,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut O,
) -> LocatedResult<H::Configuration>
where
    H: Hybrid,
    M: Stepper<Frozen<H>>,
    O: Observer<H::Configuration>,
{
    check_start(initial, grid, location)?;
    frozen.freeze(grid.time(0), initial);
    let worker = Worker { frozen, form: frozen, stepper, decoder: Unchanged, encode: StateOf::<H>::clone };
    worker.integrate(initial, grid, location, observer)
}

struct Visit<'a, H: Hybrid, O> {
    frozen: &'a Frozen<&'a H>,
    initial: &'a StateOf<H>,
    grid: &'a TimeGrid,
    location: &'a Location,
    observer: &'a mut O,
}

impl<'a, H, O> Visitor<Frozen<&'a H>> for Visit<'a, H, O>
where
    H: HybridBodies,
    O: Observer<H::Configuration>,
{
    type Output = LocatedResult<H::Configuration>;

    fn visit<B: Form<H::Configuration>, M: Stepper<B>>(self, form: B, stepper: M) -> Self::Output {
        let Self { frozen, initial, grid, location, observer } = self;
        let (decoder, encode) = (form.decoder(), |x: &_| form.encode(x));
        let worker = Worker { frozen, form: &form, stepper: &stepper, decoder, encode };
        worker.integrate(initial, grid, location, observer)
    }
}

fn check_start<Q: Configuration>(
    initial: &State<Q>,
    grid: &TimeGrid,
    location: &Location,
) -> Result<(), Box<Interrupted<Q>>> {
    check_state(initial).and_then(|()| check_positive("max_event_rate", location.max_event_rate)).map_err(
        |error| Box::new(Interrupted { reason: error.into(), so_far: at_start(grid.time(0), initial) }),
    )
}

fn at_start<Q: Configuration>(t: f64, initial: &State<Q>) -> Located<Q> {
    Located {
        t,
        state: initial.clone(),
        status: Status::Stopped,
        steps: 0,
        trials: 0,
        event_count: 0,
        events: Vec::new(),
    }
}

/// A state in the variables of the form and in those of the system, and the guards there.
struct Point<Q: Configuration, B: Configuration> {
    inner: State<B>,
    outer: State<Q>,
    guards: Vec<Guard>,
}

/// The method at work: makes steps in the mode that the system is frozen in.
struct Worker<'a, H: Hybrid, B, M, D, E> {
    frozen: &'a Frozen<H>,
    form: &'a B,
    stepper: &'a M,
    decoder: D,
    encode: E,
}

impl<H, B, M, D, E> Worker<'_, H, B, M, D, E>
where
    H: Hybrid,
    B: System,
    M: Stepper<B>,
    D: Decoder<B::Configuration, H::Configuration>,
{
    fn step(
        &self,
        t: f64,
        x: &StateOf<B>,
        h: f64,
        memory: &mut M::Memory,
        out: &mut Point<H::Configuration, B::Configuration>,
    ) -> Result<(), Interruption> {
        self.stepper.step(self.form, t, x, h, memory, &mut out.inner).map_err(IntegrateError::from)?;
        out.inner.configuration.renormalize();
        if !out.inner.is_finite() {
            return Err(IntegrateError::NonFinite { t: t + h }.into());
        }
        self.decoder.decode(&out.inner, &mut out.outer);
        self.frozen.guards(t + h, &out.outer, &mut out.guards);
        check_guards(t + h, &out.guards)
    }
}

fn check_guards(t: f64, guards: &[Guard]) -> Result<(), Interruption> {
    match guards.iter().enumerate().find(|(_, g)| !g.is_finite()) {
        None => Ok(()),
        Some((guard, &Guard { gap, rate, .. })) => Err(Interruption::NonFiniteGuard { guard, t, gap, rate }),
    }
}

/// +1 for a guard outside, −1 for one inside: its side times its margin falls to zero at an event.
fn side(guard: &Guard) -> f64 {
    if guard.is_inside() { -1.0 } else { 1.0 }
}

fn has_changed(before: &[Guard], after: &[Guard]) -> bool {
    before.iter().zip(after).any(|(a, b)| a.is_inside() != b.is_inside())
}

/// Steps made again from the start of a step, with memory and room of their own.
struct Search<'a, 'w, H: Hybrid, B: System, M: Stepper<B>, D, E> {
    worker: &'a Worker<'w, H, B, M, D, E>,
    memory: &'a mut M::Memory,
    point: &'a mut Point<H::Configuration, B::Configuration>,
    t: f64,
    x: &'a StateOf<B>,
    before: &'a [Guard],
    trials: &'a mut u64,
}

impl<H, B, M, D, E> Search<'_, '_, H, B, M, D, E>
where
    H: Hybrid,
    B: System,
    M: Stepper<B>,
    D: Decoder<B::Configuration, H::Configuration>,
{
    /// Leaves the guards after a step of h in `point`.
    fn trial(&mut self, h: f64) -> Result<(), Interruption> {
        *self.trials += 1;
        self.worker.stepper.restart(self.memory);
        self.worker.step(self.t, self.x, h, self.memory, self.point)
    }

    /// A step within (0, h) after which guard `i` has changed sign, though the ends need not show it.
    ///
    /// Each trial halves the doubt: the cubics on either side of it are better than the one before.
    fn dip(&mut self, i: usize, h: f64, after: &Guard) -> Result<Option<f64>, Interruption> {
        let side = side(&self.before[i]);
        let (mut near, mut far) = ((0.0, self.before[i]), (h, *after));
        for _ in 0..24 {
            let width = far.0 - near.0;
            let curve = StepCurve::new(&near.1, &far.1, width);
            let Some((theta, least)) = curve.least(side) else { return Ok(None) };
            // How much nearer to zero than both ends; a dip shallower than what is left of it is believed.
            let depth = (side * near.1.margin()).min(side * far.1.margin()) - least;
            if least >= 0.0 && least >= depth {
                return Ok(None);
            }
            let h = near.0 + theta * width;
            self.trial(h)?;
            let found = self.point.guards[i];
            let margin = side * found.margin();
            if found.is_inside() != self.before[i].is_inside() {
                return Ok(Some(h));
            }
            if (margin - least).abs() < 0.25 * margin {
                return Ok(None);
            }
            let value = |a: (f64, Guard), b: (f64, Guard)| {
                StepCurve::new(&a.1, &b.1, b.0 - a.0).least(side).map_or(f64::INFINITY, |l| l.1)
            };
            let middle = (h, found);
            if value(near, middle) < value(middle, far) { far = middle } else { near = middle }
        }
        Ok(None)
    }

    /// The step to the far side of the earliest change of sign within h, if there is one.
    ///
    /// `after` are the guards after the step of h as it was made.
    fn earliest(&mut self, h: f64, after: &[Guard], tolerance: f64) -> Result<Option<f64>, Interruption> {
        let mut end = None;
        for i in 0..after.len() {
            if let Some(earlier) = self.dip(i, end.unwrap_or(h), &after[i])? {
                end = Some(earlier);
            }
        }
        let end = match end {
            Some(end) => end,
            None if has_changed(self.before, after) => h,
            None => return Ok(None),
        };
        self.trial(end)?;
        if !has_changed(self.before, &self.point.guards) {
            // Made again without its history the step does not quite reach the change: the step as it was
            // made ends there, within its error.
            return Ok(Some(h));
        }
        let mut guess = end;
        for (a, b) in self.before.iter().zip(&self.point.guards) {
            if a.is_inside() != b.is_inside() {
                guess = guess.min(end * StepCurve::new(a, b, end).crossing(1.0));
            }
        }
        let far = margin(self.before, &self.point.guards);
        let near = margin(self.before, self.before);
        let excess = |h| {
            self.trial(h)?;
            Ok(margin(self.before, &self.point.guards))
        };
        roots::bracket(excess, (0.0, near), (end, far), guess, tolerance).map(|(_, far)| Some(far))
    }
}

/// The least of side · margin over the guards: not negative exactly as long as none has changed.
fn margin(before: &[Guard], now: &[Guard]) -> f64 {
    before.iter().zip(now).fold(f64::INFINITY, |least, (a, b)| {
        let value = side(a) * b.margin();
        let changed = a.is_inside() != b.is_inside();
        // A margin of exactly zero is outside, whichever side it came from.
        least.min(if changed { value.min(-f64::MIN_POSITIVE) } else { value.max(0.0) })
    })
}

/// Remembers when the last events were.
struct Chatter {
    times: Vec<f64>,
    next: usize,
    max_event_rate: f64,
}

impl Chatter {
    fn new(guards: usize, max_event_rate: f64) -> Self {
        Self { times: vec![f64::NEG_INFINITY; 64 * guards.max(1)], next: 0, max_event_rate }
    }

    fn record(&mut self, t: f64) -> Result<(), Interruption> {
        let span = t - self.times[self.next];
        self.times[self.next] = t;
        self.next = (self.next + 1) % self.times.len();
        if span * self.max_event_rate < 64.0 {
            return Err(Interruption::Chattering { t, max_event_rate: self.max_event_rate });
        }
        Ok(())
    }
}

impl<H, B, M, D, E> Worker<'_, H, B, M, D, E>
where
    H: Hybrid,
    B: System,
    M: Stepper<B>,
    D: Decoder<B::Configuration, H::Configuration> + Clone + Send + Sync + 'static,
    E: Fn(&StateOf<H>) -> StateOf<B>,
{
    fn integrate<O: Observer<H::Configuration>>(
        &self,
        initial: &StateOf<H>,
        grid: &TimeGrid,
        location: &Location,
        observer: &mut O,
    ) -> LocatedResult<H::Configuration> {
        let mut so_far = at_start(grid.time(0), initial);
        match self.run(&(self.encode)(initial), grid, location, observer, &mut so_far) {
            Ok(status) => Ok(Located { status, ..so_far }),
            Err(reason) => Err(Box::new(Interrupted { reason, so_far })),
        }
    }

    fn run<O: Observer<H::Configuration>>(
        &self,
        encoded: &StateOf<B>,
        grid: &TimeGrid,
        location: &Location,
        observer: &mut O,
        so_far: &mut Located<H::Configuration>,
    ) -> Result<Status, Interruption> {
        let mut memory = self.stepper.start(self.form, encoded).map_err(IntegrateError::from)?;
        let mut trial_memory = self.stepper.start(self.form, encoded).map_err(IntegrateError::from)?;
        let point = || Point { inner: encoded.clone(), outer: so_far.state.clone(), guards: Vec::new() };
        let (mut before, mut after, mut trial) = (point(), point(), point());
        self.frozen.guards(so_far.t, &before.outer, &mut before.guards);
        check_guards(so_far.t, &before.guards)?;
        let mut impulses = vec![0.0; before.guards.len()];
        let mut chatter = Chatter::new(before.guards.len(), location.max_event_rate);
        let end = grid.time(grid.steps());
        let (mut grid, mut n) = (*grid, 0);
        while so_far.t < end {
            let t = so_far.t;
            let h = if n < grid.full_steps() { grid.dt() } else { end - t };
            if n == grid.full_steps() {
                self.stepper.restart(&mut memory);
            }
            let mut t_after = grid.time(n + 1);
            let mut step = h;
            self.step(t, &before.inner, h, &mut memory, &mut after)?;
            let tolerance = 2.0 * f64::EPSILON * t.abs().max(t_after.abs());
            let found = Search {
                worker: self,
                memory: &mut trial_memory,
                point: &mut trial,
                t,
                x: &before.inner,
                before: &before.guards,
                trials: &mut so_far.trials,
            }
            .earliest(h, &after.guards, tolerance)?;
            if let Some(earlier) = found.filter(|earlier| *earlier < h) {
                step = earlier;
                t_after = t + earlier;
                self.stepper.restart(&mut memory);
                self.step(t, &before.inner, step, &mut memory, &mut after)?;
            }
            for (i, impulse) in impulses.iter_mut().enumerate() {
                if before.guards[i].is_inside() {
                    *impulse += self.frozen.system().impulse(i, step, &before.guards[i], &after.guards[i]);
                }
            }
            so_far.steps += 1;
            let flow = self.show(observer, so_far.steps, (t, t_after, step), &before, &after, &mut memory);
            so_far.t = t_after;
            so_far.state.assign(&after.outer);
            n += 1;
            if found.is_some() {
                let mode = self.frozen.refreeze(t_after, &after.outer);
                self.log(t_after, &mode, &before.guards, &after, &mut impulses, location, so_far);
                chatter.record(t_after)?;
                if H::RESETS {
                    self.frozen.reset(t_after, &mode, &mut after.outer);
                    after.inner = (self.encode)(&after.outer);
                    so_far.state.assign(&after.outer);
                }
                self.frozen.guards(t_after, &after.outer, &mut after.guards);
                self.stepper.restart(&mut memory);
                if t_after < end {
                    (grid, n) = (TimeGrid::try_new(t_after, end, grid.dt())?, 0);
                }
            }
            std::mem::swap(&mut before, &mut after);
            if flow == Flow::Stop && so_far.t < end {
                return Ok(Status::Stopped);
            }
        }
        Ok(Status::Finished)
    }

    /// Shows a step, with its curve, to the observer.
    fn show<O: Observer<H::Configuration>>(
        &self,
        observer: &mut O,
        index: u64,
        (t, t_after, h): (f64, f64, f64),
        before: &Point<H::Configuration, B::Configuration>,
        after: &Point<H::Configuration, B::Configuration>,
        memory: &mut M::Memory,
    ) -> Flow {
        if !O::ACTIVE {
            return Flow::Continue;
        }
        let mut interpolant = || {
            let segment = self.stepper.segment(self.form, t, &before.inner, h, memory, &after.inner);
            Box::new(Decoded { segment, decoder: self.decoder.clone() })
                as Box<dyn Interpolant<H::Configuration>>
        };
        observer.observe(&mut Step::new(index, (t, t_after), &before.outer, &after.outer, &mut interpolant))
    }

    /// Counts and keeps the changes between the guards before a step and after it.
    fn log(
        &self,
        t: f64,
        mode: &H::Mode,
        before: &[Guard],
        after: &Point<H::Configuration, B::Configuration>,
        impulses: &mut [f64],
        location: &Location,
        so_far: &mut Located<H::Configuration>,
    ) {
        for (guard, (a, b)) in before.iter().zip(&after.guards).enumerate() {
            if a.is_inside() == b.is_inside() {
                continue;
            }
            let kind = self.frozen.event_kind(guard, a, b, mode);
            let impulse = if kind == EventKind::Release { std::mem::take(&mut impulses[guard]) } else { 0.0 };
            so_far.event_count += 1;
            if location.keep_events {
                so_far.events.push(Event { t, guard, kind, impulse, state: after.outer.clone() });
            }
        }
    }
}
