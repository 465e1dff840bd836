//! Steps of fixed size.

use super::hybrid::{Frozen, Hybrid, HybridBodies};
use super::location::Location;
use super::outcome::{Interruption, LocatedResult};
use super::run::{Run, Span, broken_at_start, check_start, run};
use super::stiff::Stiff;
use crate::driver::{Flow, IntegrateError, Observer, Status, TimeGrid};
use crate::engine::{Encode, Engine, FormEngine};
use crate::methods::{Method, Options};
use crate::stepper::Stepper;
use crate::system::{Decoder, StateOf, System, Unchanged};

/// Integrates bodies with modes by a method of the table, with a fixed step, locating events.
///
/// The steps have the size of the grid, counted again from each event. While springs act that a step is too long for it
/// is divided, and further where the energy grows; see [`StiffSteps`](super::StiffSteps). The observer sees every
/// committed step, those that end at events among them, with its curve.
///
/// Cost: the guards once a step, and about eight steps for each event.
pub fn integrate_located<H: HybridBodies>(
    method: Method,
    options: Options,
    system: &H,
    initial: &StateOf<H>,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut dyn Observer<H::Configuration>,
) -> LocatedResult<H> {
    let t = grid.time(0);
    check_start(system, t, initial, location)?;
    let frozen = Frozen::new(system, t, initial);
    let run = method.engage(options, &frozen, initial, &mut |engine| {
        go(&frozen, engine, initial, grid, location, observer)
    });
    run.unwrap_or_else(|error| Err(broken_at_start::<H>(error.into(), t, initial)))
}

/// Integrates any system with modes by any stepper, with a fixed step, locating events; see
/// [`integrate_located`].
pub fn integrate_hybrid<H, M>(
    frozen: &Frozen<H>,
    stepper: &M,
    initial: &StateOf<H>,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut dyn Observer<H::Configuration>,
) -> LocatedResult<H>
where
    H: Hybrid,
    M: Stepper<Frozen<H>>,
{
    let form = (frozen, &StateOf::<H>::clone as Encode<'_, _, _>, Unchanged);
    integrate_hybrid_form(frozen, form, stepper, initial, grid, location, observer)
}

/// [`integrate_hybrid`] with the system in other variables: a form, and the ways to its variables and back.
pub fn integrate_hybrid_form<H, B, M, D>(
    frozen: &Frozen<H>,
    (form, encode, decoder): (&B, Encode<'_, H::Configuration, B::Configuration>, D),
    stepper: &M,
    initial: &StateOf<H>,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut dyn Observer<H::Configuration>,
) -> LocatedResult<H>
where
    H: Hybrid,
    B: System,
    M: Stepper<B>,
    D: Decoder<B::Configuration, H::Configuration>,
{
    let t = grid.time(0);
    check_start(frozen.system(), t, initial, location)?;
    frozen.freeze(t, initial);
    let mut engine = FormEngine::start(form, stepper, decoder, encode, initial)
        .map_err(|error| broken_at_start::<H>(IntegrateError::from(error).into(), t, initial))?;
    go(frozen, &mut engine, initial, grid, location, observer)
}

fn go<H: Hybrid>(
    frozen: &Frozen<H>,
    engine: &mut dyn Engine<H::Configuration>,
    initial: &StateOf<H>,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut dyn Observer<H::Configuration>,
) -> LocatedResult<H> {
    run(frozen, engine, (grid.time(0), initial), location, observer, |run| steps(run, *grid))
}

fn steps<H: Hybrid>(run: &mut Run<'_, H>, mut grid: TimeGrid) -> Result<Status, Interruption<H::Fault>> {
    let end = grid.time(grid.steps());
    let mut stiff = Stiff::new(run.location.stiff, &run.worker.engine.info(), grid.dt());
    stiff.enter(run.worker.frozen, run.so_far.t, &run.before.state)?;
    if stiff.parts > 1 {
        grid = TimeGrid::try_new(run.so_far.t, end, stiff.part())?;
    }
    let mut n = 0;
    while run.so_far.t < end {
        let t = run.so_far.t;
        let h = if n < grid.full_steps() { grid.dt() } else { end - t };
        if n == grid.full_steps() {
            run.worker.restart();
        }
        run.worker.step(t, run.before.slot, h, &mut run.after)?;
        n += 1;
        // A step that is thrown off is not searched for what it meets on the way.
        let mut stands = stiff.holds(run.worker.frozen, t, &run.after.state)?;
        let mut span = Span { h, t_after: grid.time(n), is_event: false };
        if stands {
            span = run.locate(h, span.t_after)?;
            stands = stiff.accepts(run.worker.frozen, t, &run.after.state)?;
        }
        if !stands {
            run.so_far.trials += 1;
            run.worker.restart();
            (grid, n) = (TimeGrid::try_new(t, end, stiff.part())?, 0);
            continue;
        }
        run.so_far.substeps += u64::from(stiff.parts > 1);
        let flow = run.commit(span)?;
        if span.is_event && span.t_after < end {
            stiff.enter(run.worker.frozen, span.t_after, &run.before.state)?;
            (grid, n) = (TimeGrid::try_new(span.t_after, end, stiff.part())?, 0);
        }
        if flow == Flow::Stop && span.t_after < end {
            return Ok(Status::Stopped);
        }
    }
    Ok(Status::Finished)
}
