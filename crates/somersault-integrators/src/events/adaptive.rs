//! Steps adapted to tolerances.

use super::hybrid::Hybrid;
use super::outcome::Interruption;
use super::run::InProgress;
use crate::driver::{Adaptive, Flow, Status, check_interval, judge};

/// Makes steps up to `end`, chosen afresh from each event and from each time at which the equations are not smooth.
pub(super) fn steps<H: Hybrid>(
    run: &mut InProgress<'_, H>,
    end: f64,
    settings: &Adaptive,
) -> Result<Status, Interruption<H::Fault>> {
    check_interval(run.so_far.t, end)?;
    let mut control = run.worker.engine.control(settings, run.so_far.t, run.before.slot)?;
    let mut until = run.begin(end);
    while run.so_far.t < end {
        let t = run.so_far.t;
        if t >= until {
            until = run.begin(end);
            run.worker.restart();
            run.worker.engine.restart_control(&mut control, t, run.before.slot);
        }
        let (from, to) = (run.before.slot, run.after.slot);
        if control.is_free()
            && let Some(longest) = run.worker.engine.longest_step(from, &settings.tolerances)?
        {
            control.choose(longest);
        }
        let (h, t_after) = control.propose(t, until)?;
        let attempt = run.worker.engine.attempt(t, h, from, to, &settings.tolerances);
        let (mut error, unsolved) = judge(attempt)?;
        let mut fault = unsolved.map(Interruption::from);
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
        if flow == Flow::Stop && run.so_far.t < end {
            return Ok(Status::Stopped);
        }
        if span.is_event {
            until = run.begin(end);
            run.worker.engine.restart_control(&mut control, span.t_after, run.before.slot);
        }
    }
    Ok(Status::Finished)
}
