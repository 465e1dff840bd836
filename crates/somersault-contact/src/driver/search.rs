//! The search for the earliest event within a step.

use super::worker::{Point, Worker};
use crate::event::Interruption;
use crate::hybrid::{Guard, Hybrid};
use crate::step_curve::StepCurve;
use crate::sweep::{Sweep, Verdict};
use somersault_core::roots;
use somersault_integrators::state::Configuration;

/// How many parts of a step are looked at for what a cubic says alone.
const SUSPICIONS: u32 = 64;

/// How many parts of a step are looked at before it is given up.
const MOST_PARTS: u32 = 20_000;

/// A part of a step, by its length, and where it leads.
struct Mark<Q: Configuration> {
    h: f64,
    point: Point<Q>,
    /// Whether an event was narrowed down to its end.
    is_event: bool,
}

/// Room for the search: the part of the step known to be clear, and the parts that end later, latest first.
pub(super) struct Trail<Q: Configuration> {
    near: Mark<Q>,
    far: Vec<Mark<Q>>,
    /// How many of `far` are in use.
    len: usize,
    sweeps: Vec<Sweep>,
}

impl<Q: Configuration> Trail<Q> {
    pub(super) fn new(point: Point<Q>) -> Self {
        let near = Mark { h: 0.0, point, is_event: false };
        Self { near, far: Vec::new(), len: 0, sweeps: Vec::new() }
    }
}

/// Steps made again from the start of a step, with room of their own.
pub(super) struct Search<'a, 'w, H: Hybrid> {
    pub(super) worker: &'a mut Worker<'w, H>,
    pub(super) trail: &'a mut Trail<H::Configuration>,
    pub(super) t: f64,
    pub(super) before: &'a Point<H::Configuration>,
    pub(super) graze: f64,
    /// Two parts of a step are one where they end no farther apart than this.
    pub(super) tolerance: f64,
    pub(super) trials: &'a mut u64,
}

impl<H: Hybrid> Search<'_, '_, H> {
    /// Where in the step of h to `after` a guard may have changed its sign and changed it back, if anywhere: the
    /// part of the step to be looked at first.
    #[inline]
    pub(super) fn doubt(&mut self, h: f64, after: &Point<H::Configuration>) -> Option<f64> {
        let sweeps = &mut self.trail.sweeps;
        self.worker.frozen.sweeps(self.t, h, (&self.before.state, &after.state), sweeps);
        doubt(&self.before.guards, &after.guards, h, sweeps, (self.graze, true))
    }

    /// The step to the far side of the earliest change of sign within h, if there is one.
    ///
    /// `after` is where the step of h led as it was made. What lies between two parts of the step is clear where
    /// every guard is said to keep its sign; where it may not, the step is made again to somewhere in between. An
    /// event is narrowed down first and what lies before it is looked at then.
    pub(super) fn earliest(
        &mut self,
        h: f64,
        after: &Point<H::Configuration>,
    ) -> Result<Option<f64>, Interruption> {
        let before = self.before;
        (self.trail.near.h, self.trail.len) = (0.0, 0);
        let (mut is_start, mut parts) = (true, 0);
        loop {
            let len = self.trail.len;
            let far = self.trail.far[..len].last();
            let (end, is_event, point) = far.map_or((h, false, after), |m| (m.h, m.is_event, &m.point));
            let near_h = self.trail.near.h;
            let near = if is_start { before } else { &self.trail.near.point };
            let is_changed = has_changed(&before.guards, &point.guards);
            if is_changed && !is_event {
                let values = (margin(&before.guards, &near.guards), margin(&before.guards, &point.guards));
                let guess = self.guess(near, point, (near_h, end));
                if len == 0 {
                    // The step as it was made may have a history, the search has none.
                    self.push(h)?;
                    if !has_changed(&before.guards, &self.trail.far[0].point.guards) {
                        // Made again it does not quite reach the change: the step as it was made ends there,
                        // within its error.
                        return Ok(Some(h));
                    }
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
            self.worker.frozen.sweeps(
                self.t + near_h,
                width,
                (&near.state, &point.state),
                &mut self.trail.sweeps,
            );
            // A cubic that goes on to promise what is not there has rates that are not those of its gaps.
            let suspects = parts < SUSPICIONS;
            parts += 1;
            if parts > MOST_PARTS {
                return Err(Interruption::Unproved { t: self.t, h, parts: MOST_PARTS });
            }
            let part = doubt(&near.guards, &point.guards, width, &self.trail.sweeps, (self.graze, suspects));
            if let Some(part) = part
                && width > 4.0 * self.tolerance
            {
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

    /// Where the cubics through the ends of a part of the step change sign first.
    fn guess(
        &self,
        near: &Point<H::Configuration>,
        far: &Point<H::Configuration>,
        (start, end): (f64, f64),
    ) -> f64 {
        let (guards, width) = (near.guards.iter().zip(&far.guards), end - start);
        let crossings = guards.filter(|(a, b)| a.is_inside() != b.is_inside());
        crossings
            .fold(end, |least, (a, b)| least.min(start + width * StepCurve::new(a, b, width).crossing(1.0)))
    }

    /// Narrows a change of sign down; returns the shorter step to its far side.
    fn narrow(&mut self, (near, far): ((f64, f64), (f64, f64)), guess: f64) -> Result<f64, Interruption> {
        // The last mark in use, past the far end, is where trials are made.
        let slot = self.trail.len;
        self.reserve(slot);
        let before = &self.before.guards;
        let excess = |h| {
            let point = &mut self.trail.far[slot].point;
            self.worker.try_step(self.t, self.before.slot, h, point)?;
            *self.trials += 1;
            Ok(margin(before, &point.guards))
        };
        roots::bracket(excess, near, far, guess, self.tolerance).map(|(_, far)| far)
    }

    /// Makes the step of h and marks where it leads.
    fn push(&mut self, h: f64) -> Result<(), Interruption> {
        let slot = self.trail.len;
        self.reserve(slot);
        let mark = &mut self.trail.far[slot];
        self.worker.try_step(self.t, self.before.slot, h, &mut mark.point)?;
        *self.trials += 1;
        (mark.h, mark.is_event) = (h, false);
        self.trail.len = slot + 1;
        Ok(())
    }

    fn reserve(&mut self, slot: usize) {
        if slot == self.trail.far.len() {
            let point = self.worker.point(&self.before.state);
            self.trail.far.push(Mark { h: 0.0, point, is_event: false });
        }
    }
}

/// The first part of a step of h within which some guard is not known to keep its sign; `suspects` says whether
/// cubics count.
fn doubt(
    before: &[Guard],
    after: &[Guard],
    h: f64,
    sweeps: &[Sweep],
    (graze, suspects): (f64, bool),
) -> Option<f64> {
    let guards = before.iter().zip(after).zip(sweeps);
    let parts = guards.filter_map(|((a, b), sweep)| match Verdict::of(a, b, h, sweep, graze) {
        Verdict::Clear => None,
        Verdict::Suspect(theta) => suspects.then_some(theta * h),
        Verdict::Split(theta) => Some(theta * h),
    });
    parts.min_by(f64::total_cmp)
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
