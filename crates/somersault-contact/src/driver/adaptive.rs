//! Steps adapted to tolerances.

use super::LocatedResult;
use super::run::{Run, broken_at_start, check_start, run};
use super::worker::{Encode, Worker};
use crate::event::{Interruption, Location};
use crate::hybrid::{Frozen, Hybrid, HybridBodies};
use somersault_integrators::driver::{Adaptive, Flow, IntegrateError, Observer, Status, check_interval};
use somersault_integrators::methods::{EmbeddedVisitor, Method, Options};
use somersault_integrators::step_size::StepSizeControl;
use somersault_integrators::stepper::EmbeddedStepper;
use somersault_integrators::system::{Decoder, Form, StateOf, System, Unchanged};

/// Integrates bodies with modes from `interval.0` to `interval.1` by a method of the table that estimates
/// its error, with steps adapted to tolerances, locating events.
///
/// Far from contacts the steps are those of
/// [`integrate_adaptive`](somersault_integrators::driver::integrate_adaptive). A step that is not proved clear of
/// contacts is shortened to where the gap may be least, so that the gap takes part in the control of the steps. After an event the step is
/// chosen afresh from the accelerations of the new mode. A step that leads to where a guard is not finite
/// is rejected like one whose error is too large. The observer sees every committed step, those that end at
/// events among them, with its curve.
///
/// Cost: the guards once a step, about eight steps and two evaluations for each event.
pub fn integrate_located_adaptive<H, O>(
    method: Method,
    options: Options,
    system: &H,
    initial: &StateOf<H>,
    interval: (f64, f64),
    settings: &Adaptive,
    location: &Location,
    observer: &mut O,
) -> LocatedResult<H::Configuration>
where
    H: HybridBodies,
    O: Observer<H::Configuration>,
{
    check_start(system, interval.0, initial, location)?;
    let frozen = Frozen::new(system, interval.0, initial);
    let visit = Visit { frozen: &frozen, initial, interval, settings, location, observer };
    method.visit_embedded(options, &frozen, visit).unwrap_or_else(|| {
        let error = IntegrateError::NoErrorEstimate { method: method.info().name };
        Err(broken_at_start(error.into(), interval.0, initial))
    })
}

/// Integrates any system with modes by any stepper that estimates its error, with steps adapted to
/// tolerances, locating events; see [`integrate_located_adaptive`].
pub fn integrate_hybrid_adaptive<H, M, O>(
    frozen: &Frozen<H>,
    stepper: &M,
    initial: &StateOf<H>,
    interval: (f64, f64),
    settings: &Adaptive,
    location: &Location,
    observer: &mut O,
) -> LocatedResult<H::Configuration>
where
    H: Hybrid,
    M: EmbeddedStepper<Frozen<H>>,
    O: Observer<H::Configuration>,
{
    let form = (frozen, &StateOf::<H>::clone as Encode<'_, H, Frozen<H>>, Unchanged);
    integrate_hybrid_form_adaptive(frozen, form, stepper, initial, (interval, settings), location, observer)
}

/// The same with the system in other variables: a form, and the ways to its variables and back.
pub(crate) fn integrate_hybrid_form_adaptive<H, B, M, D, O>(
    frozen: &Frozen<H>,
    (form, encode, decoder): (&B, Encode<'_, H, B>, D),
    stepper: &M,
    initial: &StateOf<H>,
    (interval, settings): ((f64, f64), &Adaptive),
    location: &Location,
    observer: &mut O,
) -> LocatedResult<H::Configuration>
where
    H: Hybrid,
    B: System,
    M: EmbeddedStepper<B>,
    D: Decoder<B::Configuration, H::Configuration> + Clone + Send + Sync + 'static,
    O: Observer<H::Configuration>,
{
    check_start(frozen.system(), interval.0, initial, location)?;
    frozen.freeze(interval.0, initial);
    let worker = Worker { frozen, form, stepper, decoder, encode };
    run(worker, (interval.0, initial), location, observer, |run| steps(run, interval.1, settings))
}

struct Visit<'a, H: Hybrid, O> {
    frozen: &'a Frozen<&'a H>,
    initial: &'a StateOf<H>,
    interval: (f64, f64),
    settings: &'a Adaptive,
    location: &'a Location,
    observer: &'a mut O,
}

impl<'a, H, O> EmbeddedVisitor<Frozen<&'a H>> for Visit<'a, H, O>
where
    H: HybridBodies,
    O: Observer<H::Configuration>,
{
    type Output = LocatedResult<H::Configuration>;

    fn visit<B: Form<H::Configuration>, M: EmbeddedStepper<B>>(self, form: B, stepper: M) -> Self::Output {
        let Self { frozen, initial, interval, settings, location, observer } = self;
        let (decoder, encode) = (form.decoder(), &|x: &_| form.encode(x));
        let worker = Worker { frozen, form: &form, stepper: &stepper, decoder, encode };
        run(worker, (interval.0, initial), location, observer, |run| steps(run, interval.1, settings))
    }
}

fn steps<H, B, M, D, O>(
    run: &mut Run<'_, H, B, M, D, O>,
    end: f64,
    settings: &Adaptive,
) -> Result<Status, Interruption>
where
    H: Hybrid,
    B: System,
    M: EmbeddedStepper<B>,
    D: Decoder<B::Configuration, H::Configuration> + Clone + Send + Sync + 'static,
    O: Observer<H::Configuration>,
{
    let Worker { form, stepper, .. } = run.worker;
    check_interval(run.so_far.t, end)?;
    let mut control = StepSizeControl::try_new(settings, &M::INFO, form, run.so_far.t, &run.before.inner)?;
    while run.so_far.t < end {
        let t = run.so_far.t;
        let (h, t_after) = control.propose(t, end)?;
        let (x, memory, after) = (&run.before.inner, &mut run.memory, &mut run.after);
        stepper.step(form, t, x, h, memory, &mut after.inner).map_err(IntegrateError::from)?;
        let mut error = stepper.error(x, &after.inner, h, memory, &settings.tolerances);
        let mut fault = None;
        if error <= 1.0
            && let Err(reason) = run.worker.settle(t + h, &mut run.after)
        {
            (error, fault) = (f64::NAN, Some(reason));
        }
        if error <= 1.0
            && let Some(part) = run.doubt(h, t_after)
        {
            // A contact may have come and gone: the step ends where it would have been closest.
            control.shorten(part)?;
            stepper.reject(&mut run.memory);
            run.so_far.trials += 1;
            continue;
        }
        match control.accepts(t, h, error) {
            Ok(true) => {}
            Ok(false) => {
                stepper.reject(&mut run.memory);
                run.so_far.rejected += 1;
                continue;
            }
            Err(limit) => return Err(fault.unwrap_or(limit.into())),
        }
        let span = run.locate(h, t_after)?;
        let flow = run.commit(span)?;
        if span.is_event {
            control.restart(form, span.t_after, &run.before.inner);
        }
        if flow == Flow::Stop && span.t_after < end {
            return Ok(Status::Stopped);
        }
    }
    Ok(Status::Finished)
}
