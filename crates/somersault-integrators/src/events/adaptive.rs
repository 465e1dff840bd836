//! Steps adapted to tolerances.

use super::hybrid::{Frozen, Hybrid, HybridBodies};
use super::location::Location;
use super::outcome::{Interruption, LocatedResult};
use super::run::{Run, broken_at_start, check_start, run};
use crate::driver::{Adaptive, Flow, IntegrateError, Observer, Status, check_interval};
use crate::engine::{Encode, Engine, FormEngine};
use crate::methods::{Method, Options};
use crate::stepper::EmbeddedStepper;
use crate::system::{Decoder, StateOf, System, Unchanged};

/// Integrates bodies with modes from `interval.0` to `interval.1` by a method of the table that estimates
/// its error, with steps adapted to tolerances, locating events.
///
/// Far from events the steps are those of [`Run`](crate::run::Run). A step that is not
/// proved clear of them is shortened to where the gap may be least, so that the gap takes part in the control of the
/// steps. After an event the step is chosen afresh from the accelerations of the new mode. A step that leads to where a
/// guard is not finite is rejected like one whose error is too large. The observer sees every committed step, those that
/// end at events among them, with its curve.
///
/// Cost: the guards once a step, about eight steps and two evaluations for each event.
pub fn integrate_located_adaptive<H: HybridBodies>(
    method: Method,
    options: Options,
    system: &H,
    initial: &StateOf<H>,
    interval: (f64, f64),
    settings: &Adaptive,
    location: &Location,
    observer: &mut dyn Observer<H::Configuration>,
) -> LocatedResult<H> {
    check_start(system, interval.0, initial, location)?;
    let frozen = Frozen::new(system, interval.0, initial);
    let run = method.engage_embedded(options, &frozen, initial, &mut |engine| {
        go(&frozen, engine, initial, (interval, settings), location, observer)
    });
    run.unwrap_or_else(|error| Err(broken_at_start::<H>(error.into(), interval.0, initial)))
}

/// Integrates any system with modes by any stepper that estimates its error, with steps adapted to
/// tolerances, locating events; see [`integrate_located_adaptive`].
pub fn integrate_hybrid_adaptive<H, M>(
    frozen: &Frozen<H>,
    stepper: &M,
    initial: &StateOf<H>,
    interval: (f64, f64),
    settings: &Adaptive,
    location: &Location,
    observer: &mut dyn Observer<H::Configuration>,
) -> LocatedResult<H>
where
    H: Hybrid,
    M: EmbeddedStepper<Frozen<H>>,
{
    let form = (frozen, &StateOf::<H>::clone as Encode<'_, _, _>, Unchanged);
    integrate_hybrid_form_adaptive(frozen, form, stepper, initial, (interval, settings), location, observer)
}

/// [`integrate_hybrid_adaptive`] with the system in other variables: a form, and the ways to its variables and back.
pub fn integrate_hybrid_form_adaptive<H, B, M, D>(
    frozen: &Frozen<H>,
    (form, encode, decoder): (&B, Encode<'_, H::Configuration, B::Configuration>, D),
    stepper: &M,
    initial: &StateOf<H>,
    (interval, settings): ((f64, f64), &Adaptive),
    location: &Location,
    observer: &mut dyn Observer<H::Configuration>,
) -> LocatedResult<H>
where
    H: Hybrid,
    B: System,
    M: EmbeddedStepper<B>,
    D: Decoder<B::Configuration, H::Configuration>,
{
    check_start(frozen.system(), interval.0, initial, location)?;
    frozen.freeze(interval.0, initial);
    let engine = FormEngine::start(form, stepper, decoder, encode, initial)
        .map_err(|error| broken_at_start::<H>(IntegrateError::from(error).into(), interval.0, initial))?;
    go(frozen, &mut engine.with_estimate(), initial, (interval, settings), location, observer)
}

fn go<H: Hybrid>(
    frozen: &Frozen<H>,
    engine: &mut dyn Engine<H::Configuration>,
    initial: &StateOf<H>,
    (interval, settings): ((f64, f64), &Adaptive),
    location: &Location,
    observer: &mut dyn Observer<H::Configuration>,
) -> LocatedResult<H> {
    run(frozen, engine, (interval.0, initial), location, observer, |run| steps(run, interval.1, settings))
}

fn steps<H: Hybrid>(
    run: &mut Run<'_, H>,
    end: f64,
    settings: &Adaptive,
) -> Result<Status, Interruption<H::Fault>> {
    check_interval(run.so_far.t, end)?;
    let mut control = run.worker.engine.control(settings, run.so_far.t, run.before.slot)?;
    while run.so_far.t < end {
        let t = run.so_far.t;
        let (h, t_after) = control.propose(t, end)?;
        let (from, to) = (run.before.slot, run.after.slot);
        let mut error = run.worker.engine.attempt(t, h, from, to, &settings.tolerances)?;
        let mut fault = None;
        if error <= 1.0
            && let Err(reason) = run.worker.settle(t + h, &mut run.after)
        {
            (error, fault) = (f64::NAN, Some(reason));
        }
        if error <= 1.0
            && let Some(part) = run.doubt(h, t_after)
        {
            // A guard may have gone in and come out: the step ends where its gap would have been least.
            control.shorten(part)?;
            run.worker.engine.reject();
            run.so_far.trials += 1;
            continue;
        }
        match control.accepts(t, h, error) {
            Ok(true) => {}
            Ok(false) => {
                run.worker.engine.reject();
                run.so_far.rejected += 1;
                continue;
            }
            Err(limit) => return Err(fault.unwrap_or(limit.into())),
        }
        let span = run.locate(h, t_after)?;
        let flow = run.commit(span)?;
        if span.is_event {
            run.worker.engine.restart_control(&mut control, span.t_after, run.before.slot);
        }
        if flow == Flow::Stop && span.t_after < end {
            return Ok(Status::Stopped);
        }
    }
    Ok(Status::Finished)
}
