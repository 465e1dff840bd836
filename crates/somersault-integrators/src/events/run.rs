//! A run in progress: what is done with a step, fixed or adapted, once it is made.

use super::guard::{Guard, GuardChange};
use super::hybrid::{Frozen, Hybrid};
use super::location::Location;
use super::outcome::{Event, Interrupted, InterruptedRun, Interruption, Located, LocatedResult};
use super::search::{EventSearch, Trail, has_changed};
use super::worker::{Point, StepFrom, Worker};
use crate::driver::{Flow, Observer, Status, Step, check_state};
use crate::engine::{Engine, EngineStep, Slot, Track};
use crate::system::StateOf;
use somersault_core::argument::expect_positive;

/// For how many steps ahead a flight is proved clear at once.
const AHEAD: f64 = 64.0;

/// The part of a step that is committed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    /// Its length.
    pub(super) h: f64,
    /// Time at its end.
    pub(super) t_after: f64,
    /// Whether it ends at an event.
    pub(super) is_event: bool,
}

/// A run in progress.
pub(super) struct InProgress<'a, H: Hybrid> {
    pub(super) worker: Worker<'a, H>,
    /// The last state that was committed.
    pub(super) before: Box<Point<H::Configuration>>,
    /// The state that a step leads to. Each in a box of its own: they are exchanged after every step.
    pub(super) after: Box<Point<H::Configuration>>,
    trail: Trail<Point<H::Configuration>>,
    /// Until when no guard can go in, as far as is proved.
    clear_until: f64,
    impulses: Vec<f64>,
    /// Whether a guard went in before, and so was examined.
    entered: Vec<bool>,
    chatter: Chatter,
    pub(super) location: Location,
    observer: &'a mut dyn Observer<H::Configuration>,
    is_observed: bool,
    /// The memory and the slot of parts of steps that the observer asks for.
    place: Option<(Track, Slot)>,
    /// The guards that change at the end of the step that is shown.
    changes: Vec<GuardChange>,
    /// The outcome but for the state, which is that of `before`.
    pub(super) so_far: Located<H::Configuration, H::Kind>,
}

/// Runs `steps` of an engine from a state at `t`.
pub(super) fn run<'a, H: Hybrid>(
    frozen: &'a Frozen<'a, H>,
    engine: &'a mut dyn Engine<H::Configuration>,
    (t, initial): (f64, &StateOf<H>),
    location: &Location,
    observer: &'a mut dyn Observer<H::Configuration>,
    steps: impl FnOnce(&mut InProgress<'a, H>) -> Result<Status, Interruption<H::Fault>>,
) -> LocatedResult<H> {
    let mut run = InProgress::start(frozen, engine, (t, initial), location, observer)
        .map_err(|reason| broken_at_start::<H>(reason, t, initial))?;
    let outcome = steps(&mut run);
    let mut so_far = run.so_far;
    so_far.state = run.before.state;
    match outcome {
        Ok(status) => Ok(Located { status, ..so_far }),
        Err(reason) => Err(Box::new(Interrupted { reason, so_far })),
    }
}

/// Errors where a run cannot start.
pub(super) fn check_start<H: Hybrid>(
    system: &H,
    t: f64,
    initial: &StateOf<H>,
    location: &Location,
) -> Result<(), InterruptedRun<H>> {
    system
        .check()
        .and_then(|()| check_state(initial))
        .and_then(|()| {
            expect_positive("max_event_rate", location.max_event_rate)?;
            expect_positive("graze", location.graze)?;
            Ok(())
        })
        .map_err(|error| broken_at_start::<H>(error.into(), t, initial))
}

pub(super) fn broken_at_start<H: Hybrid>(
    reason: Interruption<H::Fault>,
    t: f64,
    initial: &StateOf<H>,
) -> InterruptedRun<H> {
    Box::new(Interrupted { reason, so_far: Located::at_start(t, initial) })
}

impl<'a, H: Hybrid> InProgress<'a, H> {
    fn start(
        frozen: &'a Frozen<'a, H>,
        engine: &'a mut dyn Engine<H::Configuration>,
        (t, initial): (f64, &StateOf<H>),
        location: &Location,
        observer: &'a mut dyn Observer<H::Configuration>,
    ) -> Result<Self, Interruption<H::Fault>> {
        let mut worker = Worker::start(frozen, engine, initial)?;
        let (mut before, after) = (Box::new(worker.point(initial)), Box::new(worker.point(initial)));
        let trail = Trail::new(worker.point(initial));
        worker.read_guards(t, &mut before)?;
        let count = before.guards.len();
        let is_observed = observer.is_active();
        let mut run = Self {
            worker,
            trail,
            before,
            after,
            clear_until: f64::NEG_INFINITY,
            impulses: vec![0.0; count],
            entered: vec![false; count],
            chatter: Chatter::new(count, location.max_event_rate),
            location: *location,
            observer,
            is_observed,
            place: None,
            changes: Vec::new(),
            so_far: Located::at_start(t, initial),
        };
        run.examine()?;
        Ok(run)
    }

    /// Begins steps from the last state; returns the time at which they must end, `end` or before.
    pub(super) fn begin(&self, end: f64) -> f64 {
        self.worker.frozen.begin(self.so_far.t).min(end)
    }

    /// Examines the guards that are inside in the last state and never were before.
    fn examine(&mut self) -> Result<(), Interruption<H::Fault>> {
        let (system, t, point) = (self.worker.frozen.system(), self.so_far.t, &self.before);
        for (guard, (entered, at)) in self.entered.iter_mut().zip(&point.guards).enumerate() {
            if at.is_inside() && !*entered {
                *entered = true;
                let refused = |fault| Interruption::Refused { guard, t, fault };
                system.examine(guard, &point.state).map_err(refused)?;
            }
        }
        Ok(())
    }

    /// Whether the step of h just made to `t_after` is known to be clear from what was proved ahead of it.
    #[inline(always)]
    fn is_clear_ahead(&mut self, h: f64, t_after: f64) -> bool {
        if has_changed(&self.before.guards, &self.after.guards) {
            return false;
        }
        if t_after > self.clear_until {
            let (frozen, t) = (self.worker.frozen, self.so_far.t);
            let time = frozen.clear_time(t, &self.before.state, &self.before.guards, AHEAD * h);
            self.clear_until = t + time;
        }
        t_after <= self.clear_until
    }

    /// Where in the step just made a guard may have changed its sign and changed it back, if anywhere: how long a
    /// step is to be tried instead.
    pub(super) fn doubt(&mut self, h: f64, t_after: f64) -> Option<f64> {
        let is_changed = has_changed(&self.before.guards, &self.after.guards);
        if is_changed || self.is_clear_ahead(h, t_after) {
            return None;
        }
        let (mut search, after) = self.search(t_after);
        let shortest = 4.0 * search.tolerance;
        search.doubt(h, after).filter(|part| *part > shortest)
    }

    fn search(&mut self, t_after: f64) -> (EventSearch<'_, StepFrom<'_, 'a, H>>, &Point<H::Configuration>) {
        let (t, before) = (self.so_far.t, &self.before);
        let step = StepFrom { worker: &mut self.worker, t, before, trials: &mut self.so_far.trials };
        let tolerance = 2.0 * f64::EPSILON * t.abs().max(t_after.abs());
        let graze = self.location.graze;
        (EventSearch { step, trail: &mut self.trail, from: 0.0, before, graze, tolerance }, &self.after)
    }

    /// Finds the earliest event in the step of h just made to `t_after`, and makes the step to it instead.
    // inlined, as most steps are clear
    #[inline(always)]
    pub(super) fn locate(&mut self, h: f64, t_after: f64) -> Result<Span, Interruption<H::Fault>> {
        if self.is_clear_ahead(h, t_after) {
            return Ok(Span { h, t_after, is_event: false });
        }
        self.earliest(h, t_after)
    }

    #[inline(never)]
    fn earliest(&mut self, h: f64, t_after: f64) -> Result<Span, Interruption<H::Fault>> {
        let t = self.so_far.t;
        let (mut search, after) = self.search(t_after);
        let found = search.earliest(h, after)?;
        match found {
            Some(earlier) if earlier < h => {
                self.worker.restart();
                self.worker.step(t, self.before.slot, earlier, &mut self.after)?;
                Ok(Span { h: earlier, t_after: t + earlier, is_event: true })
            }
            _ => Ok(Span { h, t_after, is_event: found.is_some() }),
        }
    }

    /// Commits the step: shows it, counts it, and at an event reads the mode, lets the state jump and
    /// restarts the memory. Where the observer ends the run within the step, nothing follows it.
    #[inline(always)]
    pub(super) fn commit(&mut self, span: Span) -> Result<Flow, Interruption<H::Fault>> {
        let (guards, guards_after) = (&self.before.guards, &self.after.guards);
        for (i, impulse) in self.impulses.iter_mut().enumerate() {
            if guards[i].is_inside() {
                *impulse += self.worker.frozen.system().impulse(i, span.h, &guards[i], &guards_after[i]);
            }
        }
        self.so_far.steps += 1;
        let (flow, end) = if self.is_observed { self.show(span) } else { (Flow::Continue, None) };
        if let Some((t, state)) = end {
            (self.so_far.t, self.before.state) = (t, state);
            return Ok(flow);
        }
        self.so_far.t = span.t_after;
        if span.is_event {
            self.happen(span.t_after)?;
        } else {
            std::mem::swap(&mut self.before, &mut self.after);
        }
        Ok(flow)
    }

    /// Passes from the mode that ends at an event to the next.
    #[inline(never)]
    fn happen(&mut self, t: f64) -> Result<(), Interruption<H::Fault>> {
        let mode = self.worker.frozen.refreeze(t, &self.after.state);
        self.log(&mode);
        std::mem::swap(&mut self.before, &mut self.after);
        self.chatter.record::<H::Fault>(t)?;
        self.enter(&mode)
    }

    /// Restarts from an event, in a new mode.
    fn enter(&mut self, last_mode: &H::Mode) -> Result<(), Interruption<H::Fault>> {
        let (worker, t, point) = (&mut self.worker, self.so_far.t, &mut self.before);
        if H::RESETS {
            worker.frozen.reset(t, last_mode, &mut point.state);
            worker.engine.write(point.slot, &point.state);
        }
        worker.restart();
        worker.read_guards(t, point)?;
        self.clear_until = f64::NEG_INFINITY;
        self.examine()
    }

    /// Shows the step, with its curve, to the observer.
    #[inline(never)]
    fn show(&mut self, span: Span) -> (Flow, Option<(f64, StateOf<H>)>) {
        let Self { worker, before, after, so_far, place, changes, impulses, .. } = self;
        changes.clear();
        if span.is_event {
            changes.extend(changes_between(&before.guards, &after.guards, impulses));
        }
        let (t, from, to) = (so_far.t, before.slot, after.slot);
        let engine = &mut *worker.engine;
        let mut interior = EngineStep { engine, t, h: span.h, from, to, before: &before.state, place };
        let times = (t, span.t_after);
        let mut step = Step::new(so_far.steps, times, &before.state, &after.state, &mut interior);
        (step.rejected, step.changes) = (so_far.rejected, changes);
        step.shown_to(self.observer)
    }

    /// Counts and keeps the changes between the guards before a step and after it.
    fn log(&mut self, last_mode: &H::Mode) {
        let Self { worker, before, after, impulses, so_far, .. } = self;
        let mut changed = 0;
        for GuardChange { guard, before: a, after: b, impulse } in
            changes_between(&before.guards, &after.guards, impulses)
        {
            changed += 1;
            if self.location.keep_events {
                let kind = worker.frozen.event_kind(guard, &a, &b, last_mode);
                let (t, state) = (so_far.t, after.state.clone());
                so_far.events.push(Event { t, guard, kind, impulse, state });
            }
        }
        so_far.event_count += changed;
        let closed = impulses.iter_mut().zip(before.guards.iter().zip(&after.guards));
        closed.filter(|(_, (a, b))| a.is_inside() && !b.is_inside()).for_each(|(impulse, _)| *impulse = 0.0);
    }
}

/// The guards that change between the ends of a step, with what each has gathered inside.
fn changes_between(before: &[Guard], after: &[Guard], impulses: &[f64]) -> impl Iterator<Item = GuardChange> {
    let ends = before.iter().zip(after).zip(impulses).enumerate();
    let changed = ends.filter(|(_, ((a, b), _))| a.is_inside() != b.is_inside());
    changed.map(|(guard, ((&before, &after), &gathered))| {
        let impulse = if before.is_inside() { gathered } else { 0.0 };
        GuardChange { guard, before, after, impulse }
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

    fn record<F>(&mut self, t: f64) -> Result<(), Interruption<F>> {
        let span = t - self.times[self.next];
        self.times[self.next] = t;
        self.next = (self.next + 1) % self.times.len();
        if span * self.max_event_rate < 64.0 {
            return Err(Interruption::Chattering { t, max_event_rate: self.max_event_rate });
        }
        Ok(())
    }
}
