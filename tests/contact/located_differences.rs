//! Sensitivities against differences of accurately located runs.

use nalgebra::SVector;
use somersault_contact::contacts::BodyInContact;
use somersault_contact::event::EventKind;
use somersault_contact::sensitivity::{
    Differentiation, Parameter, Sensitivities, SensitivityRun, Undifferentiated,
};
use somersault_contact::stretches::WithStretches;
use somersault_integrators::augmented::Augmented;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::events::{Event, Located, Location};
use somersault_integrators::force::ForceModel;
use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas};
use somersault_integrators::run::Run;
use somersault_integrators::state::{Configuration, Pose, RigidBodyState, Twist};
use somersault_integrators::variation::Tangent;

/// The method of the runs.
pub(crate) const RKMK8: RungeKuttaMuntheKaas<Dop853> = RungeKuttaMuntheKaas(Dop853);
type Column = SVector<f64, 12>;

/// Differentiates by [`RKMK8`].
pub(crate) fn differentiate<F: ForceModel>(
    system: &BodyInContact<F>,
    start: &RigidBodyState,
    by: &[Parameter],
    interval: (f64, f64),
    dt: f64,
) -> Result<Sensitivities, Box<Undifferentiated>> {
    let grid = TimeGrid::try_new(interval.0, interval.1, dt).unwrap();
    let by = Differentiation::by(by);
    SensitivityRun::by_stepper(system, &by, &RKMK8, grid).locating(Location::as_given()).from(start)
}

/// A run by [`RKMK8`] from time 0, its contacts unstretched.
pub(crate) fn located<F: ForceModel>(
    system: BodyInContact<F>,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
) -> Located<Pose, EventKind> {
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    let with = WithStretches(&system);
    let start = with.unstretched(*start);
    let run = Run::by_stepper(&with, &RKMK8, grid).locating(Location::as_given()).from(&start).unwrap();
    let bare = |event: Event<Augmented<Pose>, EventKind>| {
        let Event { t, guard, kind, impulse, state } = event;
        Event { t, guard, kind, impulse, state: state.base() }
    };
    let Located { t, state, status, steps, rejected, trials, substeps, event_count, events } = run;
    let events = events.into_iter().map(bare).collect();
    Located { t, state: state.base(), status, steps, rejected, trials, substeps, event_count, events }
}

/// From one state to another, in the twelve components.
pub(crate) fn components(from: &RigidBodyState, to: &RigidBodyState) -> Column {
    let mut displacement = Twist::default();
    to.configuration.difference(&from.configuration, &mut displacement);
    let rate = Twist {
        linear: to.velocity() - from.velocity(),
        angular: to.angular_velocity() - from.angular_velocity(),
    };
    Tangent { displacement, rate }.components()
}

/// A central difference of order 4 by Richardson's extrapolation of two.
pub(crate) fn difference<const N: usize>(step: f64, at: impl Fn(f64) -> SVector<f64, N>) -> SVector<f64, N> {
    let central = |h: f64| (at(h) - at(-h)) / (2.0 * h);
    (central(0.5 * step) * 4.0 - central(step)) / 3.0
}

/// Whether every column agrees with the differences of located runs, of their states and event times, to
/// `tolerance` of the column's size.
///
/// `varied(k, ε)` is the problem changed by ε in column k, by whose `steps` differences are taken;
/// one of zero leaves a column out.
pub(crate) fn agrees_with_differences<F: ForceModel>(
    found: &Sensitivities,
    varied: impl Fn(usize, f64) -> (BodyInContact<F>, RigidBodyState),
    steps: &[f64],
    (end, dt): (f64, f64),
    tolerance: f64,
) {
    const EVENTS: usize = 24;
    let base = {
        let (system, start) = varied(0, 0.0);
        located(system, &start, end, dt)
    };
    assert_eq!(base.state, found.run.state);
    assert_eq!(found.parameters.ncols() + 12, steps.len());
    assert!(base.events.len() <= EVENTS);
    let mut worst: f64 = 0.0;
    for (k, &step) in steps.iter().enumerate().filter(|(_, step)| **step > 0.0) {
        let run = |epsilon: f64| {
            let (system, start) = varied(k, epsilon);
            let run = located(system, &start, end, dt);
            assert_eq!(run.events.len(), base.events.len(), "column {k}");
            run
        };
        let states = difference(step, |e| components(&base.state, &run(e).state));
        let times = difference(step, |e| {
            let run = run(e);
            SVector::<f64, EVENTS>::from_fn(|i, _| run.events.get(i).map_or(0.0, |event| event.t))
        });
        let column = if k < 12 { found.state.column(k) } else { found.parameters.column(k - 12) };
        let error = (column - states).norm() / column.norm();
        let event_times = found.event_times.column(k);
        let scale = event_times.norm().max(f64::MIN_POSITIVE);
        let time_error = (event_times - times.rows(0, base.events.len())).norm() / scale;
        println!("column {k}: {:.3e}, error {error:.1e}, of the event times {time_error:.1e}", column.norm());
        let time_error = if scale > 1e-12 { time_error } else { times.norm() };
        worst = worst.max(error).max(time_error);
    }
    println!("worst {worst:.1e}");
    assert!(worst < tolerance, "{worst:e}");
}
