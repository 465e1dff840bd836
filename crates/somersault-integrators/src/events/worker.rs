//! The method at work: steps in the mode that the system is frozen in.

use super::guard::Guard;
use super::hybrid::{Frozen, Hybrid};
use super::outcome::Interruption;
use super::search::Retrace;
use super::sweep::Sweep;
use crate::driver::IntegrateError;
use crate::engine::{Engine, Slot, Track};
use crate::state::{Configuration, State};
use crate::system::StateOf;

/// A state of the system, where the engine keeps it, and the guards there.
pub(super) struct Point<Q: Configuration> {
    pub(super) slot: Slot,
    pub(super) state: State<Q>,
    pub(super) guards: Vec<Guard>,
}

/// A system with modes and a method that integrates it.
pub(super) struct Worker<'a, H: Hybrid> {
    pub(super) frozen: &'a Frozen<'a, H>,
    pub(super) engine: &'a mut dyn Engine<H::Configuration>,
    /// The memory of steps that are tried.
    trial: Track,
}

impl<'a, H: Hybrid> Worker<'a, H> {
    pub(super) fn start(
        frozen: &'a Frozen<'a, H>,
        engine: &'a mut dyn Engine<H::Configuration>,
        x: &StateOf<H>,
    ) -> Result<Self, IntegrateError> {
        let trial = engine.branch(x)?;
        Ok(Self { frozen, engine, trial })
    }

    /// A point with a slot of its own.
    pub(super) fn point(&mut self, state: &StateOf<H>) -> Point<H::Configuration> {
        Point { slot: self.engine.keep(state), state: state.clone(), guards: Vec::new() }
    }

    /// A step of h from `from` at `t`, with the guards after it.
    #[inline]
    pub(super) fn step(
        &mut self,
        t: f64,
        from: Slot,
        h: f64,
        out: &mut Point<H::Configuration>,
    ) -> Result<(), Interruption<H::Fault>> {
        self.advance(Track::RUN, t, from, h, out)
    }

    /// The same without a history and without leaving one.
    fn try_step(
        &mut self,
        t: f64,
        from: Slot,
        h: f64,
        out: &mut Point<H::Configuration>,
    ) -> Result<(), Interruption<H::Fault>> {
        self.engine.restart(self.trial);
        self.advance(self.trial, t, from, h, out)
    }

    #[inline]
    fn advance(
        &mut self,
        track: Track,
        t: f64,
        from: Slot,
        h: f64,
        out: &mut Point<H::Configuration>,
    ) -> Result<(), Interruption<H::Fault>> {
        self.engine.advance(track, t, h, from, out.slot, Some(&mut out.state))?;
        self.read_guards(t + h, out)
    }

    /// Forgets the history.
    pub(super) fn restart(&mut self) {
        self.engine.restart(Track::RUN);
    }

    /// Makes a point of the state that an attempt has left in its slot.
    #[inline]
    pub(super) fn settle(
        &self,
        t: f64,
        out: &mut Point<H::Configuration>,
    ) -> Result<(), Interruption<H::Fault>> {
        self.engine.read(out.slot, &mut out.state);
        self.read_guards(t, out)
    }

    #[inline]
    pub(super) fn read_guards(
        &self,
        t: f64,
        out: &mut Point<H::Configuration>,
    ) -> Result<(), Interruption<H::Fault>> {
        self.frozen.guards(t, &out.state, &mut out.guards);
        match out.guards.iter().enumerate().find(|(_, g)| !g.is_finite()) {
            None => Ok(()),
            Some((guard, &Guard { gap, rate, .. })) => {
                Err(match self.frozen.system().examine(guard, &out.state) {
                    Err(fault) => Interruption::Refused { guard, t, fault },
                    Ok(()) => Interruption::NonFiniteGuard { guard, t, gap, rate },
                })
            }
        }
    }
}

/// The step from `before` at `t`, in any part.
pub(super) struct StepFrom<'a, 'w, H: Hybrid> {
    pub(super) worker: &'a mut Worker<'w, H>,
    pub(super) t: f64,
    pub(super) before: &'a Point<H::Configuration>,
    /// Counts the parts made.
    pub(super) trials: &'a mut u64,
}

impl<H: Hybrid> Retrace for StepFrom<'_, '_, H> {
    type Point = Point<H::Configuration>;
    type Error = Interruption<H::Fault>;

    fn guards(point: &Self::Point) -> &[Guard] {
        &point.guards
    }

    fn room(&mut self) -> Self::Point {
        self.worker.point(&self.before.state)
    }

    fn make(&mut self, h: f64, out: &mut Self::Point) -> Result<(), Self::Error> {
        self.worker.try_step(self.t, self.before.slot, h, out)?;
        *self.trials += 1;
        Ok(())
    }

    fn sweeps(&self, start: f64, width: f64, ends: (&Self::Point, &Self::Point), out: &mut Vec<Sweep>) {
        self.worker.frozen.sweeps(self.t + start, width, (&ends.0.state, &ends.1.state), out);
    }

    fn unproved(&self, h: f64, parts: u32, _guard: usize) -> Self::Error {
        Interruption::Unproved { t: self.t, h, parts }
    }
}
