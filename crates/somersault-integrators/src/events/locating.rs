//! The run of a system with modes: events are located.

use super::hybrid::{Frozen, Hybrid};
use super::location::Location;
use super::outcome::{Interrupted, Interruption, LocatedResult};
use super::run::{broken_at_start, check_start, run};
use super::{adaptive, fixed};
use crate::driver::Steps;
use crate::run::{Engages, Run, drive, explain};
use crate::system::StateOf;

impl<'a, H: Hybrid, M> Run<'a, H, M> {
    /// Freezes the system in its mode during each step, and ends the step where the mode ends; see
    /// [`events`](crate::events). Without it the mode is read at every evaluation, and steps straddle events.
    ///
    /// The method must take the system frozen in a mode, [`Frozen`], as those of the table do that take the system. The
    /// observer sees every committed step, those that end at events among them, with its curve.
    ///
    /// - Fixed steps have the size of the grid, counted again from each event. While springs act that a step is too long for
    ///   it is divided, and further where the energy grows; see [`StiffSteps`](super::StiffSteps). The cost is the guards
    ///   once a step, and about eight steps for each event.
    /// - Adapted steps far from events are those of a run without events. A step that is not proved clear of events is
    ///   shortened to where the gap may be least, so that the gap takes part in the control of the steps. After an event the
    ///   step is chosen afresh from the accelerations of the new mode. A step that leads to where a guard is not finite is
    ///   rejected like one whose error is too large. The cost is the guards once a step, and about eight steps and two
    ///   evaluations for each event.
    pub fn locating(self, location: Location) -> Run<'a, H, M, Location> {
        let Self { system, method, steps, location: (), observer } = self;
        Run { system, method, steps, location, observer }
    }
}

impl<'a, H: Hybrid, M> Run<'a, H, M, Location> {
    /// Runs from a state.
    ///
    /// Errors keep the solution up to where they arose: those of a run without events, settings of the location that are
    /// not positive, and what [`Interruption`] lists besides.
    pub fn from(self, initial: &StateOf<H>) -> LocatedResult<H>
    where
        M: Engages<Frozen<'a, H>>,
    {
        let Self { system, method, steps, location, observer } = self;
        let t = steps.interval().0;
        check_start(system, t, initial, &location)?;
        let frozen = Frozen::new(system, t, initial);
        let located = drive(&method, &frozen, initial, &steps, observer, &mut |engine, observer| {
            run(&frozen, engine, (t, initial), &location, observer, |run| match &steps {
                Steps::Fixed(grid) => fixed::steps(run, *grid),
                Steps::Adapted { interval, settings } => adaptive::steps(run, interval.1, settings),
            })
        });
        let broken = match located {
            Ok(Ok(located)) => return Ok(located),
            Ok(Err(broken)) => broken,
            Err(error) => broken_at_start::<H>(error.into(), t, initial),
        };
        Err(match *broken {
            Interrupted { reason: Interruption::Integrate(error), so_far } => {
                Box::new(Interrupted { reason: explain(system, error).into(), so_far })
            }
            broken => Box::new(broken),
        })
    }
}
