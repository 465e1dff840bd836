//! Steps of fixed size.

use super::hybrid::Hybrid;
use super::outcome::Interruption;
use super::run::{InProgress, Span};
use super::stiff::Stiff;
use crate::driver::{Flow, Status, TimeGrid};

/// Makes the steps of a grid, counted again from each event and from each time at which the equations are not smooth.
pub(super) fn steps<H: Hybrid>(
    run: &mut InProgress<'_, H>,
    mut grid: TimeGrid,
) -> Result<Status, Interruption<H::Fault>> {
    let end = grid.time(grid.steps());
    let mut stiff = Stiff::new(run.location.stiff, &run.worker.engine.info(), grid.dt());
    stiff.enter(run.worker.frozen, run.so_far.t, &run.before.state)?;
    let mut until = run.begin(end);
    if stiff.step() < grid.dt() || until < end {
        grid = TimeGrid::try_new(run.so_far.t, until, stiff.step())?;
    }
    let mut n = 0;
    while run.so_far.t < end {
        let t = run.so_far.t;
        if t >= until {
            until = run.begin(end);
            run.worker.restart();
            (grid, n) = (TimeGrid::try_new(t, until, stiff.step())?, 0);
        }
        let h = if n < grid.full_steps() { grid.dt() } else { until - t };
        if n == grid.full_steps() {
            run.worker.restart();
        }
        let made = run.worker.step(t, run.before.slot, h, &mut run.after);
        n += 1;
        // A step that is thrown off is not searched for what it meets on the way.
        let mut stands = match made {
            Ok(()) => stiff.holds(run.worker.frozen, t, &run.after.state)?,
            Err(reason) if reason.is_of_the_step() && stiff.shortens() => false,
            Err(reason) => return Err(reason),
        };
        let mut span = Span { h, t_after: grid.time(n), is_event: false };
        if stands {
            span = run.locate(h, span.t_after)?;
            stands = stiff.accepts(run.worker.frozen, t, &run.after.state)?;
        }
        if !stands {
            run.so_far.trials += 1;
            run.worker.restart();
            (grid, n) = (TimeGrid::try_new(t, until, stiff.step())?, 0);
            continue;
        }
        run.so_far.substeps += u64::from(stiff.step() < stiff.dt);
        let flow = run.commit(span)?;
        if flow == Flow::Stop && run.so_far.t < end {
            return Ok(Status::Stopped);
        }
        if span.is_event && span.t_after < end {
            stiff.enter(run.worker.frozen, span.t_after, &run.before.state)?;
            until = run.begin(end);
            (grid, n) = (TimeGrid::try_new(span.t_after, until, stiff.step())?, 0);
        } else if stiff.grows() && span.t_after < until {
            run.worker.restart();
            (grid, n) = (TimeGrid::try_new(span.t_after, until, stiff.step())?, 0);
        }
    }
    Ok(Status::Finished)
}
