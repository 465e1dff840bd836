//! Functions of time and state that are watched along a run.
//!
//! A [`Watch`] finds where functions change their signs. They change nothing of the motion: the steps are those of a run that
//! nobody watches, but for the last, which ends at a *terminal* event. The search is that for guards ([`EventSearch`]): the step
//! is made again in parts by the method itself, so that an event has the accuracy of the method and nothing is interpolated.
//! Values and rates at both ends of a step tell whether a function may have changed its sign twice within it; the rates are
//! differences along the equations of motion.
//!
//! - A zero belongs to what follows: a function that is zero at the start has no event there, and one that is zero at the
//!   end of a step has one event.
//! - A touch without a crossing is not an event: two changes that differ in time by rounding only are dropped.
//! - Directions count along the run, also where that goes backwards in time, as in SciPy.
//!
//! # Certified events
//!
//! Where the signs, values and rates at the ends of a step agree with a function that stays away from zero, it may still have gone
//! through zero and come back. A bound L of |dg/dt| along the motion ([`WatchRule::lipschitz`]) excludes that: between two times h apart
//! g has no root if
//!
//! ```math
//! |g(t)| + |g(t + h)| > L h,
//! ```
//! in particular if |g| > L h/2 at both. A part of a step of which this does not hold is divided, until it holds of all parts or a
//! part is as short as four roundings of the time. The [`Certificate`] of the function says so; about 35 L/|dg/dt| parts are made before
//! an event and as many after it. A function that touches zero, or stays near it, cannot be certified in any number of parts that can be made: after
//! 20 000 the step is searched without the bound, and the certificate says where. A bound that two points of the motion contradict,
//! |g(t₂) − g(t₁)| > L |t₂ − t₁|, ends the run with [`WatchError::Violated`].

use super::guard::Guard;
use super::search::{EventSearch, Retrace, Trail};
use crate::driver::{Flow, IntegrateError, Observer, Step};
use crate::state::{Configuration, State};
use somersault_core::argument::{ArgumentError, expect_not_negative};

/// Difference of time by which rates are taken, relative to a step and to the time.
const NUDGE: (f64, f64) = (1e-6, 2e-9);

/// The part of a first step after which a function has left zero.
const LEAVE: f64 = 1e-3;

/// Two changes of a function no farther apart than this part of a step may be a touch.
const TOUCH: f64 = 1e-6;

/// A function that is no farther from zero than this many roundings of its size in a step is zero.
const ROUNDINGS: f64 = 16.0;

/// Two values contradict a bound where they differ by more than it allows and by this part of what it allows in the step besides,
/// which is far above the rounding of what functions are computed from.
const EXCESS: f64 = 1e-9;

/// Which changes of sign are events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Direction {
    /// Both.
    #[default]
    Both,
    /// From negative to positive along the run.
    Rising,
    /// From positive to negative along the run.
    Falling,
}

/// What is done about the changes of sign of a function.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WatchRule {
    /// Which of them are events.
    pub direction: Direction,
    /// The run ends at the event of this number, counted from 1; `None` for no end.
    pub terminal: Option<u64>,
    /// A bound of |dg/dt| along the motion, in units of the function per second, with which no event is missed; `None` where none is known.
    pub lipschitz: Option<f64>,
}

/// Whether events of a function may have been missed between the ends of steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Certificate {
    /// It has no bound: its values and rates at the ends of steps were trusted.
    Unbounded,
    /// None was missed, if the bound holds.
    Certified,
    /// It has a bound, which did not suffice in the step between these times, the first of its kind.
    Unproved {
        /// Start of the step.
        from: f64,
        /// Its end.
        to: f64,
    },
}

impl Certificate {
    /// Of a function before the first step.
    pub fn at_start(rule: &WatchRule) -> Self {
        match rule.lipschitz {
            Some(_) => Self::Certified,
            None => Self::Unbounded,
        }
    }
}

/// What the watch of a run needs that continues another one: counts of events, signs and certificates.
#[derive(Debug, Clone, PartialEq)]
pub struct WatchProgress {
    counts: Vec<u64>,
    last: Option<Vec<f64>>,
    certificates: Vec<Certificate>,
}

impl WatchProgress {
    /// For a run that continues from another state, where functions may have other signs.
    pub fn from_another_state(self) -> Self {
        Self { last: None, ..self }
    }

    /// Whether events of each function may have been missed.
    pub fn certificates(&self) -> &[Certificate] {
        &self.certificates
    }
}

/// A change of sign of a function that is watched.
#[derive(Debug, Clone)]
pub struct Occurrence<Q: Configuration> {
    /// Which function.
    pub function: usize,
    /// When.
    pub t: f64,
    /// The state there.
    pub state: State<Q>,
}

/// What a watch has found.
#[derive(Debug, Clone)]
pub struct Watched<Q: Configuration> {
    /// The events, in the order of the run.
    pub occurrences: Vec<Occurrence<Q>>,
    /// The function whose event ended the run, if one did.
    pub ended_by: Option<usize>,
    /// Whether events of each function may have been missed.
    pub certificates: Vec<Certificate>,
}

/// Why a watch ended a run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WatchError {
    /// A function has no value.
    #[error("the event function {function} is not finite at t = {t}: it is {found}")]
    NonFinite {
        /// Which function.
        function: usize,
        /// When.
        t: f64,
        /// Its value.
        found: f64,
    },
    /// The bound of a function is not one.
    #[error("the event function {function}: {source}")]
    Lipschitz {
        /// Which function.
        function: usize,
        /// What is wrong.
        source: ArgumentError,
    },
    /// A function changes faster than its bound allows.
    #[error(
        "`lipschitz` = {lipschitz} of the event function {function} is too small: it changes from {} to {} between t = {} and {}",
        values.0, values.1, times.0, times.1
    )]
    Violated {
        /// Which function.
        function: usize,
        /// Its bound.
        lipschitz: f64,
        /// Two times.
        times: (f64, f64),
        /// The values then.
        values: (f64, f64),
    },
    /// A part of a step could not be made.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// Events are too many to be told apart.
    #[error(
        "the events of function {function} in the step of {h:e} from t = {t} could not be told apart in {parts} parts"
    )]
    Unproved {
        /// Which function.
        function: usize,
        /// Start of the step.
        t: f64,
        /// Its length.
        h: f64,
        /// Parts looked at.
        parts: u32,
    },
}

/// A run that its watch ended without an event, with the events up to there.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{reason}")]
pub struct WatchInterrupted<Q: Configuration> {
    /// What ended it.
    pub reason: WatchError,
    /// The events before.
    pub so_far: Watched<Q>,
}

/// A state, and the functions there as guards, negative inside.
struct Point<Q: Configuration> {
    state: State<Q>,
    guards: Vec<Guard>,
}

/// An observer that finds where functions of time and state change their signs, and ends the run at terminal events.
///
/// Another observer that is to see the run up to its end stands after it in a pair. The cost is three evaluations of the
/// functions and two of the equations a step, and about eight steps for each event.
///
/// ```
/// use somersault_integrators::driver::{Status, TimeGrid};
/// use somersault_integrators::events::{Direction, Watch, WatchRule};
/// use somersault_integrators::{body::RigidBody, force::Gravity, methods::Method, nalgebra::Vector3, run::Run};
/// use somersault_integrators::{solution::Recorder, state::RigidBodyState, system::RigidBodySystem};
///
/// // A ball is thrown upwards: where is it highest, and when is it back?
/// let ball = RigidBodySystem::new(RigidBody::try_box(1.0, Vector3::repeat(0.1))?, Gravity::earth());
/// let mut start = RigidBodyState::default();
/// start.rate.linear = Vector3::new(0.0, 0.0, 9.81);
/// let back = WatchRule { direction: Direction::Falling, terminal: Some(1), ..WatchRule::default() };
/// let mut watch = Watch::new(vec![WatchRule::default(), back], |_, x: &RigidBodyState, out: &mut [f64]| {
///     (out[0], out[1]) = (x.velocity().z, x.position().z);
/// });
/// let mut recorder = Recorder::new(0.0, &start, 1);
/// let mut observer = (&mut watch, &mut recorder);
/// let grid = TimeGrid::try_new(0.0, 10.0, 0.3)?;
/// let end = Run::new(&ball, Method::Rkmk, grid).observed_by(&mut observer).from(&start)?;
/// let found = watch.finish()?;
/// assert!((found.occurrences[0].t - 1.0).abs() < 1e-12 && (end.t - 2.0).abs() < 1e-12);
/// assert_eq!((end.status, found.ended_by), (Status::Stopped, Some(1)));
/// assert_eq!(recorder.into_solution().times.last(), Some(&end.t));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Watch<Q: Configuration, F> {
    rules: Vec<WatchRule>,
    /// Writes the values of all functions.
    functions: F,
    /// How many events of each there were.
    counts: Vec<u64>,
    /// The values at the end of the last step; `None` where they are to be read there.
    last: Option<Vec<f64>>,
    trail: Option<Trail<Point<Q>>>,
    found: Watched<Q>,
    fault: Option<WatchError>,
}

impl<Q: Configuration, F: FnMut(f64, &State<Q>, &mut [f64])> Watch<Q, F> {
    /// A watch of as many functions as there are rules; `functions` writes their values at a time and a state.
    pub fn new(rules: Vec<WatchRule>, functions: F) -> Self {
        let counts = vec![0; rules.len()];
        let certificates = rules.iter().map(Certificate::at_start).collect();
        let found = Watched { occurrences: Vec::new(), ended_by: None, certificates };
        Self { rules, functions, counts, last: None, trail: None, found, fault: None }
    }

    /// The same for a run that continues one from where that ended, under the same rules.
    pub fn resuming(mut self, progress: WatchProgress) -> Self {
        let WatchProgress { counts, last, certificates } = progress;
        (self.counts, self.last, self.found.certificates) = (counts, last, certificates);
        self
    }

    /// What a run that continues from where this one is has to know.
    pub fn progress(&self) -> WatchProgress {
        let Self { counts, last, found, .. } = self;
        WatchProgress { counts: counts.clone(), last: last.clone(), certificates: found.certificates.clone() }
    }

    /// Takes the events found since the last call.
    pub fn take_occurrences(&mut self) -> Vec<Occurrence<Q>> {
        std::mem::take(&mut self.found.occurrences)
    }

    /// What was found.
    ///
    /// Errors keep what was found before: a function that is not finite, a part of a step that the method refuses, events that
    /// cannot be told apart.
    pub fn finish(self) -> Result<Watched<Q>, Box<WatchInterrupted<Q>>> {
        match self.fault {
            None => Ok(self.found),
            Some(reason) => Err(Box::new(WatchInterrupted { reason, so_far: self.found })),
        }
    }

    /// Why the watch has ended the run without an event, if it has.
    pub fn fault(&self) -> Option<&WatchError> {
        self.fault.as_ref()
    }

    /// The function whose event has ended the run, if one has.
    pub fn ended_by(&self) -> Option<usize> {
        self.found.ended_by
    }

    /// Keeps the events of a step; returns where the run ends within it, if it does.
    fn look(&mut self, step: &mut Step<'_, Q>) -> Result<Option<(f64, State<Q>)>, WatchError> {
        let (t, t_after, count) = (step.t_before, step.t_after, self.rules.len());
        let h = (t_after - t).abs();
        let along = (t_after - t).signum();
        let difference = (NUDGE.0 * h).max(NUDGE.1 * t.abs().max(t_after.abs())).min(0.125 * h);
        let (first, end) = (step.before.clone(), step.after.clone());
        let bounds = self.rules.iter().map(|rule| rule.lipschitz).collect();
        let mut parts =
            Parts { step, functions: &mut self.functions, count, t, h, along, difference, bounds };
        parts.check_bounds()?;
        let known = self.last.take();
        let mut before = parts.point(0.0, first, known.as_deref())?;
        if known.is_none() {
            parts.leave_zeros(&mut before)?;
        }
        let mut after = parts.point(h, end, None)?;
        parts.round_to_zero(&before, &mut after);
        self.last = Some(after.guards.iter().map(|guard| guard.gap).collect());
        let trail = self.trail.get_or_insert_with(|| Trail::new(parts.blank()));
        let mut changes = parts.changes(trail, &before, &after)?;
        for (function, certificate) in self.found.certificates.iter_mut().enumerate() {
            if *certificate == Certificate::Certified && parts.bounds[function].is_none() {
                *certificate = Certificate::Unproved { from: t, to: t_after };
            }
        }
        drop_touches(&mut parts, &mut changes, &after)?;
        let mut end: Option<(f64, State<Q>)> = None;
        for Change { h: at, function, rises, state } in changes {
            let t = if at < h { t + along * at } else { t_after };
            if end.as_ref().is_some_and(|(last, _)| *last != t) {
                break;
            }
            let WatchRule { direction, terminal, .. } = self.rules[function];
            match direction {
                Direction::Rising if !rises => continue,
                Direction::Falling if rises => continue,
                Direction::Both | Direction::Rising | Direction::Falling => {}
            }
            self.counts[function] += 1;
            if end.is_none() && terminal.is_some_and(|last| self.counts[function] >= last) {
                self.found.ended_by = Some(function);
                end = Some((t, state.clone()));
            }
            self.found.occurrences.push(Occurrence { function, t, state });
        }
        if end.as_ref().is_some_and(|(t, _)| *t != t_after) {
            // a run that continues from there reads the values there
            self.last = None;
        }
        Ok(end)
    }
}

impl<Q: Configuration, F: FnMut(f64, &State<Q>, &mut [f64])> Observer<Q> for Watch<Q, F> {
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        match self.look(step) {
            Ok(None) => Flow::Continue,
            Ok(Some((t, state))) => {
                step.end_at(t, state);
                Flow::Stop
            }
            Err(fault) => {
                self.fault = Some(fault);
                Flow::Stop
            }
        }
    }
}

/// A change of sign within a step.
struct Change<Q: Configuration> {
    /// The length of the part of the step up to it.
    h: f64,
    function: usize,
    rises: bool,
    state: State<Q>,
}

/// Drops pairs of changes of a function that are apart by rounding alone.
fn drop_touches<Q: Configuration, F: FnMut(f64, &State<Q>, &mut [f64])>(
    parts: &mut Parts<'_, '_, Q, F>,
    changes: &mut Vec<Change<Q>>,
    after: &Point<Q>,
) -> Result<(), WatchError> {
    let mut i = 0;
    while i < changes.len() {
        let Change { h, function, .. } = changes[i];
        let next = changes.iter().skip(i + 1).position(|later| later.function == function);
        let close = next.map(|n| i + 1 + n).filter(|n| changes[*n].h - h <= TOUCH * parts.h);
        if let Some(n) = close {
            let mut between = parts.blank();
            parts.part(0.5 * (h + changes[n].h), &mut between)?;
            let Guard { gap, rate, .. } = after.guards[function];
            if between.guards[function].gap.abs()
                <= ROUNDINGS * f64::EPSILON * (gap.abs() + parts.h * rate.abs())
            {
                changes.remove(n);
                changes.remove(i);
                continue;
            }
        }
        i += 1;
    }
    Ok(())
}

/// A step in its parts, with the functions there.
struct Parts<'a, 's, Q: Configuration, F> {
    step: &'a mut Step<'s, Q>,
    functions: &'a mut F,
    count: usize,
    /// Start and length of the step.
    t: f64,
    h: f64,
    /// 1 where the run is forwards in time and −1 where it is backwards.
    along: f64,
    /// Difference of time for rates.
    difference: f64,
    /// The bounds of the functions by which they are proved clear.
    bounds: Vec<Option<f64>>,
}

impl<Q: Configuration, F: FnMut(f64, &State<Q>, &mut [f64])> Parts<'_, '_, Q, F> {
    /// A point to be overwritten.
    fn blank(&self) -> Point<Q> {
        Point { state: self.step.before.clone(), guards: Vec::new() }
    }

    /// Errors where a bound is not one.
    fn check_bounds(&self) -> Result<(), WatchError> {
        self.bounds.iter().enumerate().try_for_each(|(function, bound)| {
            let checked = bound.map(|bound| expect_not_negative("lipschitz", bound)).transpose();
            checked.map(|_| ()).map_err(|source| WatchError::Lipschitz { function, source })
        })
    }

    /// Makes the part of the first h of the step.
    fn part(&mut self, h: f64, out: &mut Point<Q>) -> Result<(), WatchError> {
        self.step.interior().part(h, &mut out.state)?;
        self.read(h, None, out)
    }

    /// A point of the step, with the values there where they are known.
    fn point(&mut self, h: f64, state: State<Q>, known: Option<&[f64]>) -> Result<Point<Q>, WatchError> {
        let mut point = Point { state, guards: Vec::new() };
        self.read(h, known, &mut point)?;
        Ok(point)
    }

    /// Reads the functions as guards at a point: their values, and their rates along the run by differences towards the
    /// middle of the step, or along the run where a value is zero, whose sign is that of what follows.
    fn read(&mut self, h: f64, known: Option<&[f64]>, point: &mut Point<Q>) -> Result<(), WatchError> {
        let t = self.t + self.along * h;
        let mut values = vec![0.0; self.count];
        match known {
            Some(known) => values.copy_from_slice(known),
            None => (self.functions)(t, &point.state, &mut values),
        }
        if let Some(function) = values.iter().position(|value| !value.is_finite()) {
            return Err(WatchError::NonFinite { function, t, found: values[function] });
        }
        let inwards = if h < 0.5 * self.h { self.along } else { -self.along };
        let rates = self.rates(t, inwards, &values, &point.state);
        point.guards.clear();
        point.guards.extend(values.iter().zip(rates).map(|(&gap, rate)| Guard { gap, rate, lag: 0.0 }));
        if inwards != self.along {
            self.look_ahead(t, point);
        }
        Ok(())
    }

    /// Takes the rates of functions that are zero at t along the run.
    fn look_ahead(&mut self, t: f64, point: &mut Point<Q>) {
        if point.guards.iter().any(|guard| guard.gap == 0.0) {
            let values: Vec<_> = point.guards.iter().map(|guard| guard.gap).collect();
            let ahead = self.rates(t, self.along, &values, &point.state);
            let zeros = point.guards.iter_mut().zip(ahead).filter(|(guard, _)| guard.gap == 0.0);
            zeros.for_each(|(guard, rate)| guard.rate = rate);
        }
    }

    /// Sets values at the end of the step to zero where they differ from zero by rounding only, so that a touch there is not an event.
    fn round_to_zero(&mut self, before: &Point<Q>, after: &mut Point<Q>) {
        for (a, b) in before.guards.iter().zip(&mut after.guards) {
            if b.gap.abs() <= ROUNDINGS * f64::EPSILON * (a.gap.abs() + self.h * a.rate.abs()) {
                b.gap = 0.0;
            }
        }
        self.look_ahead(self.t + self.along * self.h, after);
    }

    /// Gives functions that are zero with a rate of zero where the run starts the sign that they have a little later.
    fn leave_zeros(&mut self, before: &mut Point<Q>) -> Result<(), WatchError> {
        let is_still = |guard: &Guard| guard.gap == 0.0 && guard.rate == 0.0;
        if before.guards.iter().any(is_still) {
            let (mut later, length) = (self.blank(), LEAVE * self.h);
            self.part(length, &mut later)?;
            let still = before.guards.iter_mut().zip(&later.guards).filter(|(guard, _)| is_still(guard));
            still.for_each(|(guard, later)| guard.rate = later.gap / length);
        }
        Ok(())
    }

    /// The rates of the functions along the run, by differences on one side; zero where a value there is not finite.
    fn rates(&mut self, t: f64, side: f64, values: &[f64], x: &State<Q>) -> Vec<f64> {
        let dt = (t + side * self.difference) - t;
        let (mut moved, mut rates) = (x.clone(), vec![0.0; self.count]);
        self.step.interior().nudge(t, x, dt, &mut moved);
        (self.functions)(t + dt, &moved, &mut rates);
        for (rate, value) in rates.iter_mut().zip(values) {
            let slope = self.along * (*rate - value) / dt;
            *rate = if slope.is_finite() { slope } else { 0.0 };
        }
        rates
    }

    /// All changes of sign within the step, in their order. A function that its bound does not suffice for is searched without it.
    fn changes(
        &mut self,
        trail: &mut Trail<Point<Q>>,
        before: &Point<Q>,
        after: &Point<Q>,
    ) -> Result<Vec<Change<Q>>, WatchError> {
        loop {
            match self.search(trail, before, after) {
                Err(WatchError::Unproved { function, .. }) if self.bounds[function].is_some() => {
                    self.bounds[function] = None;
                }
                found => return found,
            }
        }
    }

    fn search(
        &mut self,
        trail: &mut Trail<Point<Q>>,
        before: &Point<Q>,
        after: &Point<Q>,
    ) -> Result<Vec<Change<Q>>, WatchError> {
        let (h, mut from, mut changes, mut reached) = (self.h, 0.0, Vec::new(), None);
        let tolerance = 2.0 * f64::EPSILON * self.t.abs().max((self.t + self.along * h).abs());
        loop {
            let (step, near) = (&mut *self, reached.as_ref().unwrap_or(before));
            let mut search = EventSearch { step, trail, from, before: near, graze: 0.0, tolerance };
            let Some(at) = search.earliest(h, after)? else { return Ok(changes) };
            let mut far = self.blank();
            if at < h {
                self.part(at, &mut far)?;
            } else {
                far = Point { state: after.state.clone(), guards: after.guards.clone() };
            }
            for (function, (a, b)) in near.guards.iter().zip(&far.guards).enumerate() {
                if a.is_inside() != b.is_inside() {
                    let state = far.state.clone();
                    changes.push(Change { h: at, function, rises: a.is_inside(), state });
                }
            }
            if at >= h {
                return Ok(changes);
            }
            if at <= from {
                // nothing is known of the rest
                self.bounds.fill(None);
                return Ok(changes);
            }
            (from, reached) = (at, Some(far));
        }
    }
}

impl<Q: Configuration, F: FnMut(f64, &State<Q>, &mut [f64])> Retrace for &mut Parts<'_, '_, Q, F> {
    type Point = Point<Q>;
    type Error = WatchError;

    fn guards(point: &Point<Q>) -> &[Guard] {
        &point.guards
    }

    fn room(&mut self) -> Point<Q> {
        self.blank()
    }

    fn make(&mut self, h: f64, out: &mut Point<Q>) -> Result<(), WatchError> {
        self.part(h, out)
    }

    fn lipschitz(&self, guard: usize) -> Option<f64> {
        self.bounds[guard]
    }

    fn check(&self, (from, to): (f64, f64), (near, far): (&Point<Q>, &Point<Q>)) -> Result<(), WatchError> {
        let ends = near.guards.iter().zip(&far.guards);
        for (function, (bound, (a, b))) in self.bounds.iter().zip(ends).enumerate() {
            let Some(lipschitz) = *bound else { continue };
            let size = a.gap.abs() + b.gap.abs() + lipschitz * (self.t.abs() + self.h);
            let rounding = EXCESS * lipschitz * self.h + ROUNDINGS * f64::EPSILON * size;
            if (b.gap - a.gap).abs() > lipschitz * (to - from) + rounding {
                let times = (self.t + self.along * from, self.t + self.along * to);
                return Err(WatchError::Violated { function, lipschitz, times, values: (a.gap, b.gap) });
            }
        }
        Ok(())
    }

    fn unproved(&self, h: f64, parts: u32, function: usize) -> WatchError {
        WatchError::Unproved { function, t: self.t, h, parts }
    }
}
