//! The search for the earliest event within a step.

use super::worker::{Point, Worker};
use crate::event::Interruption;
use crate::hybrid::{Guard, Hybrid};
use crate::step_curve::{StepCurve, is_clear};
use somersault_core::roots;
use somersault_integrators::stepper::Stepper;
use somersault_integrators::system::{Decoder, StateOf, System};

/// Steps made again from the start of a step, with memory and room of their own.
pub(super) struct Search<'a, 'w, H: Hybrid, B: System, M: Stepper<B>, D> {
    pub(super) worker: &'a Worker<'w, H, B, M, D>,
    pub(super) memory: &'a mut M::Memory,
    pub(super) point: &'a mut Point<H::Configuration, B::Configuration>,
    /// Room for the guards at the end of the part of the step that is searched.
    pub(super) last: &'a mut Vec<Guard>,
    pub(super) t: f64,
    pub(super) x: &'a StateOf<B>,
    pub(super) before: &'a [Guard],
    pub(super) trials: &'a mut u64,
}

impl<H, B, M, D> Search<'_, '_, H, B, M, D>
where
    H: Hybrid,
    B: System,
    M: Stepper<B>,
    D: Decoder<B::Configuration, H::Configuration>,
{
    /// The step to the far side of the earliest change of sign within h, if there is one.
    ///
    /// `after` are the guards after the step of h as it was made.
    #[inline]
    pub(super) fn earliest(
        &mut self,
        h: f64,
        after: &[Guard],
        tolerance: f64,
    ) -> Result<Option<f64>, Interruption> {
        if self.before.iter().zip(after).all(|(a, b)| is_clear(a, b, h)) {
            return Ok(None);
        }
        let mut dip = None;
        for (i, at_end) in after.iter().enumerate() {
            let (end, last) = dip.map_or((h, *at_end), |earlier| (earlier, self.last[i]));
            if let Some(earlier) = self.dip(i, end, &last)? {
                self.last.clone_from(&self.point.guards);
                dip = Some(earlier);
            }
        }
        let end = match dip {
            Some(earlier) => earlier,
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
}

/// +1 for a guard outside, −1 for one inside: its side times its margin falls to zero at an event.
fn side(guard: &Guard) -> f64 {
    if guard.is_inside() { -1.0 } else { 1.0 }
}

fn has_changed(before: &[Guard], after: &[Guard]) -> bool {
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
