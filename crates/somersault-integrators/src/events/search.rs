//! The search for the earliest event within a step.

use super::guard::Guard;
use super::step_curve::StepCurve;
use super::sweep::{Sweep, Verdict, by_lipschitz};
use somersault_core::roots;

/// How many parts of a step are looked at for what a cubic says alone.
const SUSPICIONS: u32 = 64;

/// How many parts of a step are looked at before it is given up.
const MOST_PARTS: u32 = 20_000;

/// A step that can be made again from where it starts, in any part: all that a search asks of who integrates.
pub trait Retrace {
    /// Where a part of the step leads.
    type Point;
    /// Why a part cannot be made.
    type Error;

    /// The guards at a point, in one order. Their rates are those along the step.
    fn guards(point: &Self::Point) -> &[Guard];

    /// A point to be overwritten.
    fn room(&mut self) -> Self::Point;

    /// Makes the part of the first `h` > 0 of the step, without a history and without leaving one.
    fn make(&mut self, h: f64, out: &mut Self::Point) -> Result<(), Self::Error>;

    /// Writes bounds of the motion behind each guard during the part of the step of `width` from `start` on, between
    /// the points at its ends. Of guards left out at the end, as all are by default, nothing is known: the cubic through
    /// the ends is trusted.
    fn sweeps(&self, _start: f64, _width: f64, _ends: (&Self::Point, &Self::Point), _out: &mut Vec<Sweep>) {}

    /// A bound of |φ̇| of a guard without a lag along the step, on either side of zero, where one is given: it stands in the place of the
    /// sweep and of the cubic, and each part of the step is proved or looked at.
    fn lipschitz(&self, _guard: usize) -> Option<f64> {
        None
    }

    /// Whether what is known of the guards holds of a part of the step between two lengths; asked of each that is looked at.
    fn check(&self, _lengths: (f64, f64), _ends: (&Self::Point, &Self::Point)) -> Result<(), Self::Error> {
        Ok(())
    }

    /// That a step of `h` could not be proved clear of events of a guard, nor an event be found in it, in so many parts.
    fn unproved(&self, h: f64, parts: u32, guard: usize) -> Self::Error;
}

/// What is not known of a part of a step.
#[derive(Debug, Clone, Copy)]
struct Doubt {
    /// Where it is to be looked at, from its start on.
    part: f64,
    guard: usize,
    /// Whether a cubic says so alone.
    is_suspicion: bool,
}

/// A part of a step, by its length, and where it leads.
#[derive(Debug)]
struct Mark<P> {
    h: f64,
    point: P,
    /// Whether an event was narrowed down to its end.
    is_event: bool,
}

/// Room for searches: the part of the step known to be clear, and the parts that end later, latest first.
#[derive(Debug)]
pub struct Trail<P> {
    near: Mark<P>,
    far: Vec<Mark<P>>,
    /// How many of `far` are in use.
    len: usize,
    sweeps: Vec<Sweep>,
}

impl<P> Trail<P> {
    /// With a point to be overwritten.
    pub fn new(point: P) -> Self {
        let near = Mark { h: 0.0, point, is_event: false };
        Self { near, far: Vec::new(), len: 0, sweeps: Vec::new() }
    }
}

/// A search for events in one step.
pub struct EventSearch<'a, R: Retrace> {
    /// The step.
    pub step: R,
    /// Room.
    pub trail: &'a mut Trail<R::Point>,
    /// How much of the step is known already; zero for a whole step.
    pub from: f64,
    /// Where the step is then.
    pub before: &'a R::Point,
    /// Depth below which a guard may go in and come out unseen, where its sweep has a speed but no fall.
    pub graze: f64,
    /// Two parts of a step are one where they end no farther apart than this.
    pub tolerance: f64,
}

impl<R: Retrace> EventSearch<'_, R> {
    /// Where in the step of h to `after` a guard may have changed its sign and changed it back, if anywhere: the
    /// part of the step to be looked at first.
    #[inline]
    pub fn doubt(&mut self, h: f64, after: &R::Point) -> Option<f64> {
        doubt(
            &self.step,
            (self.from, h - self.from),
            (self.before, after),
            &mut self.trail.sweeps,
            (self.graze, true),
        )
        .map(|doubt| doubt.part)
    }

    /// The step to the far side of the earliest change of sign between `from` and h, if there is one.
    ///
    /// `after` is where the step of h led as it was made. What lies between two parts of the step is clear where
    /// every guard is said to keep its sign; where it may not, the step is made again to somewhere in between. An
    /// event is narrowed down first and what lies before it is looked at then.
    pub fn earliest(&mut self, h: f64, after: &R::Point) -> Result<Option<f64>, R::Error> {
        let before = self.before;
        let start = R::guards(before);
        (self.trail.near.h, self.trail.len) = (self.from, 0);
        let (mut is_start, mut parts, mut suspicions) = (true, 0, 0);
        loop {
            let len = self.trail.len;
            let far = self.trail.far[..len].last();
            let (end, is_event, point) = far.map_or((h, false, after), |m| (m.h, m.is_event, &m.point));
            let near_h = self.trail.near.h;
            let near = if is_start { before } else { &self.trail.near.point };
            let is_changed = has_changed(start, R::guards(point));
            if is_changed && !is_event {
                if len == 0 && near_h >= h {
                    return Ok(Some(h));
                }
                let values = (margin(start, R::guards(near)), margin(start, R::guards(point)));
                let guess = guess(R::guards(near), R::guards(point), (near_h, end));
                if len == 0 {
                    // The step as it was made may have a history, the search has none. Where, made again, it does not quite reach the
                    // change, the step as it was made ends there, within its error, and what lies before is looked at.
                    self.push(h)?;
                    self.trail.far[0].h = h;
                    continue;
                }
                let found = self.narrow(((near_h, values.0), (end, values.1)), guess)?;
                if found < end {
                    self.push(found)?;
                }
                let last = self.trail.len - 1;
                self.trail.far[last].is_event = true;
                continue;
            }
            let width = end - near_h;
            self.step.check((near_h, end), (near, point))?;
            // A cubic that continues to promise what is not there has rates that are not those of its gaps.
            let rules = (self.graze, suspicions < SUSPICIONS);
            let doubt = doubt(&self.step, (near_h, width), (near, point), &mut self.trail.sweeps, rules);
            parts += 1;
            if let Some(Doubt { part, guard, is_suspicion }) = doubt
                && width > 4.0 * self.tolerance
            {
                if parts > MOST_PARTS {
                    return Err(self.step.unproved(h, MOST_PARTS, guard));
                }
                suspicions += u32::from(is_suspicion);
                self.push(near_h + part)?;
                continue;
            }
            if is_changed {
                return Ok(Some(end));
            }
            if len == 0 {
                return Ok(None);
            }
            self.trail.len = len - 1;
            let Trail { near, far, .. } = &mut *self.trail;
            std::mem::swap(near, &mut far[len - 1]);
            is_start = false;
        }
    }

    /// Narrows a change of sign down; returns the shorter step to its far side.
    fn narrow(&mut self, (near, far): ((f64, f64), (f64, f64)), guess: f64) -> Result<f64, R::Error> {
        // The last mark in use, past the far end, is where trials are made.
        let slot = self.trail.len;
        self.reserve(slot);
        let start = R::guards(self.before);
        let excess = |h| {
            let point = &mut self.trail.far[slot].point;
            self.step.make(h, point)?;
            Ok(margin(start, R::guards(point)))
        };
        roots::bracket(excess, near, far, guess, self.tolerance).map(|(_, far)| far)
    }

    /// Makes the step of h and marks where it leads.
    fn push(&mut self, h: f64) -> Result<(), R::Error> {
        let slot = self.trail.len;
        self.reserve(slot);
        let mark = &mut self.trail.far[slot];
        self.step.make(h, &mut mark.point)?;
        (mark.h, mark.is_event) = (h, false);
        self.trail.len = slot + 1;
        Ok(())
    }

    fn reserve(&mut self, slot: usize) {
        if slot == self.trail.far.len() {
            self.trail.far.push(Mark { h: 0.0, point: self.step.room(), is_event: false });
        }
    }
}

/// The first part of that of `width` from `start` on within which some guard is not known to keep its sign; `suspects`
/// says whether cubics count.
fn doubt<R: Retrace>(
    step: &R,
    (start, width): (f64, f64),
    ends: (&R::Point, &R::Point),
    sweeps: &mut Vec<Sweep>,
    (graze, suspects): (f64, bool),
) -> Option<Doubt> {
    let (before, after) = (R::guards(ends.0), R::guards(ends.1));
    sweeps.clear();
    step.sweeps(start, width, ends, sweeps);
    sweeps.resize(before.len(), Sweep::UNKNOWN);
    let guards = before.iter().zip(after).zip(&*sweeps).enumerate();
    let doubts = guards.filter_map(|(guard, ((a, b), sweep))| {
        let verdict = match step.lipschitz(guard) {
            Some(bound) => by_lipschitz(a, b, width, bound),
            None => Verdict::of(a, b, width, sweep, graze),
        };
        match verdict {
            Verdict::Clear => None,
            Verdict::Suspect(theta) => {
                suspects.then_some(Doubt { part: theta * width, guard, is_suspicion: true })
            }
            Verdict::Split(theta) => Some(Doubt { part: theta * width, guard, is_suspicion: false }),
        }
    });
    doubts.min_by(|a, b| a.part.total_cmp(&b.part))
}

/// Where the cubics through the ends of a part of the step change sign first.
fn guess(near: &[Guard], far: &[Guard], (start, end): (f64, f64)) -> f64 {
    let width = end - start;
    let crossings = near.iter().zip(far).filter(|(a, b)| a.is_inside() != b.is_inside());
    crossings.fold(end, |least, (a, b)| least.min(start + width * StepCurve::new(a, b, width).crossing(1.0)))
}

/// +1 for a guard outside, −1 for one inside: its side times its margin falls to zero at an event.
fn side(guard: &Guard) -> f64 {
    if guard.is_inside() { -1.0 } else { 1.0 }
}

/// Whether some guard has changed its sign.
#[inline]
pub(super) fn has_changed(before: &[Guard], after: &[Guard]) -> bool {
    before.iter().zip(after).any(|(a, b)| a.is_inside() != b.is_inside())
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
