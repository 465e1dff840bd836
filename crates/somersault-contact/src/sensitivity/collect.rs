//! Reading what a run with columns leaves.

use super::differentiable::{Collected, Differentiable, VariedOf};
use super::system::EventTime;
use crate::event::EventKind;
use nalgebra::DMatrix;
use somersault_integrators::augmented::Augmented;
use somersault_integrators::events::{Event, Located};
use somersault_integrators::variation::Tangent;

/// Reads the columns of a run, and finds the derivative of the time of each of its events.
pub(super) fn collect<S: Differentiable>(
    system: &S,
    run: Located<VariedOf<S>, EventKind>,
    times: &[EventTime],
) -> S::Sensitivities {
    let columns = run.state.configuration.columns.iter().zip(&run.state.rate.columns);
    let columns: Vec<_> = columns
        .map(|(displacement, rate)| Tangent {
            displacement: displacement.base.clone(),
            rate: rate.base.clone(),
        })
        .collect();
    let run = without_columns::<S>(run);
    let mut event_times = DMatrix::from_element(run.events.len(), columns.len(), f64::NAN);
    let mut rest = times;
    for (event, mut row) in run.events.iter().zip(event_times.row_iter_mut()) {
        let passed = rest.iter().take_while(|time| time.t < event.t).count();
        rest = &rest[passed..];
        let mut now = rest.iter().take_while(|time| time.t == event.t);
        if let Some(time) = now.find(|time| time.guard == event.guard) {
            row.iter_mut().zip(&time.columns).for_each(|(entry, time)| *entry = *time);
        }
    }
    system.collect(Collected { run, columns, event_times })
}

/// A run without its columns.
pub(super) fn without_columns<S: Differentiable>(
    run: Located<VariedOf<S>, EventKind>,
) -> Located<Augmented<S::Moved>, EventKind> {
    let event = |event: Event<VariedOf<S>, EventKind>| {
        let Event { t, guard, kind, impulse, state } = event;
        Event { t, guard, kind, impulse, state: state.base() }
    };
    Located {
        t: run.t,
        state: run.state.base(),
        status: run.status,
        steps: run.steps,
        rejected: run.rejected,
        trials: run.trials,
        substeps: run.substeps,
        event_count: run.event_count,
        events: run.events.into_iter().map(event).collect(),
    }
}
