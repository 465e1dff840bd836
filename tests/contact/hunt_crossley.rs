//! The law of Hunt and Crossley: its restitution, the order it leaves, and how graded steps restore it.

use nalgebra::Vector3;
use somersault_contact::ContactError;
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::laws::hunt_crossley::{Elastic, HuntCrossley};
use somersault_contact::surface::HalfSpace;
use somersault_core::argument::ArgumentError;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Adaptive, Steps, TimeGrid};
use somersault_integrators::events::{Frozen, Located, Location};
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::{Dop853, DormandPrince, RungeKuttaMuntheKaas, RungeKuttaMuntheKaas4};
use somersault_integrators::run::Run;
use somersault_integrators::state::{Pose, RigidBodyState};
use somersault_integrators::stepper::Stepper;
use somersault_testkit::order::slope;
use std::sync::Arc;

type System = BodyInContact<Gravity>;

fn run<M: for<'a> Stepper<Frozen<'a, System>>>(
    stepper: &M,
    system: &System,
    start: &RigidBodyState,
    times: (f64, f64),
    dt: f64,
) -> Located<Pose, EventKind> {
    let grid = TimeGrid::try_new(times.0, times.1, dt).unwrap();
    Run::by_stepper(system, stepper, grid).locating(Location::as_given()).from(start).unwrap()
}

/// A body of 1 kg that meets the ground at 1 m/s under no weight, with e = 0.7.
fn impact() -> (System, RigidBodyState) {
    let law = HuntCrossley::from_restitution(1e4, 0.7, 1.0).unwrap();
    let contact = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
    let body = RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap();
    let weightless = Gravity { acceleration: Vector3::zeros() };
    let system = BodyInContact::new(body, (weightless, Contacts::new(vec![contact])));
    let mut x = RigidBodyState::default();
    x.rate.linear.z = -1.0;
    (system, x)
}

/// How far the speed it leaves with is from e, run over the given times one step after the other.
fn impact_error<M: for<'a> Stepper<Frozen<'a, System>>>(stepper: &M, times: &[f64]) -> f64 {
    let (system, mut x) = impact();
    for pair in times.windows(2) {
        x = run(stepper, &system, &x, (pair[0], pair[1]), pair[1] - pair[0]).state;
    }
    assert!(x.position().z > 0.0);
    (x.velocity().z - 0.7).abs()
}

/// How long that contact lasts, from a run in very small steps.
fn duration() -> f64 {
    let (system, x) = impact();
    let run = run(&RungeKuttaMuntheKaas4, &system, &x, (0.0, 0.2), 1e-5);
    assert!(run.events.len() == 1 && run.events[0].kind == EventKind::Release);
    run.events[0].t
}

/// Times over a contact of duration T and a little beyond: m steps each to the middle and from it, with
/// t = T/2 (j/m)^r and its mirror image; r = 1 for even steps.
fn times(duration: f64, m: u32, r: f64) -> Vec<f64> {
    let half = |j: u32| 0.5 * duration * (f64::from(j) / f64::from(m)).powf(r);
    let first = (0..=m).map(half);
    let second = (0..m).rev().map(|j| duration - half(j));
    let mut times: Vec<f64> = first.chain(second).collect();
    // The last step reaches beyond the release, which is located within it.
    let last = times.len() - 1;
    times[last] += 0.5 * (times[last] - times[last - 1]);
    times
}

fn impact_order<M: for<'a> Stepper<Frozen<'a, System>>>(stepper: &M, sizes: [u32; 5], r: f64) -> f64 {
    let duration = duration();
    let points: Vec<_> = sizes
        .into_iter()
        .map(|m| {
            // Where the release falls within its step matters; the mean over sizes tells the order.
            let sum: f64 =
                (0..4).map(|i| impact_error(stepper, &times(duration, m + m * i / 8, r)).powi(2)).sum();
            (1.0 / f64::from(m), (0.25 * sum).sqrt())
        })
        .collect();
    println!("r = {r}: {:.2} {points:?}", slope(&points));
    slope(&points)
}

#[test]
fn hunt_and_crossley_limit_any_order_to_five_halves_with_even_steps() {
    let four = impact_order(&RungeKuttaMuntheKaas4, [40, 80, 160, 320, 640], 1.0);
    let eight = impact_order(&RungeKuttaMuntheKaas(Dop853), [40, 80, 160, 320, 640], 1.0);
    assert!((four - 2.5).abs() < 0.25, "{four}");
    assert!((eight - 2.5).abs() < 0.25, "{eight}");
}

#[test]
fn graded_steps_restore_the_order_with_hunt_and_crossley() {
    // The local errors h^{p+1} t^{3/2−p} sum to m^{−p} where r > p/(5/2).
    let four = impact_order(&RungeKuttaMuntheKaas4, [10, 20, 40, 80, 160], 2.0);
    assert!((four - 4.0).abs() < 0.3, "{four}");
    let five = impact_order(&RungeKuttaMuntheKaas(DormandPrince), [10, 15, 20, 30, 40], 2.5);
    assert!(five > 4.7, "{five}");
}

#[test]
fn adapted_steps_grade_themselves() {
    let (system, x) = impact();
    let points: Vec<_> = (6..=11)
        .map(|digits| {
            let settings = Adaptive::with_tolerances(10f64.powi(-digits), 10f64.powi(-digits));
            let (stepper, steps) =
                (RungeKuttaMuntheKaas(DormandPrince), Steps::adapted((0.0, 0.1), settings));
            let run = Run::by_embedded_stepper(&system, &stepper, steps).locating(Location::default());
            let run = run.from(&x).unwrap();
            (1.0 / run.steps as f64, (run.state.velocity().z - 0.7).abs())
        })
        .collect();
    println!("{:.2} {points:?}", slope(&points));
    assert!(slope(&points) > 4.0, "{points:?}");
}

#[test]
fn a_release_that_weight_and_damping_bring_about_below_the_surface_is_a_switch() {
    // Pulled out at more than 2/(3α) the law would pull; it lets go below the surface instead.
    let (mut system, mut x) = impact();
    let limit = 1.0 / (1.5 * HuntCrossley::from_restitution(1e4, 0.7, 1.0).unwrap().damping());
    system.0.forces.0.acceleration.z = 400.0;
    x.configuration.position.z = -0.02;
    x.rate.linear.z = 0.0;
    let run = run(&RungeKuttaMuntheKaas4, &system, &x, (0.0, 0.05), 1e-4);
    let release = &run.events[0];
    assert!(run.events.len() == 1 && release.kind == EventKind::Release);
    assert!(release.state.position().z < -1e-3, "{:?}", release.state.position());
    assert!((release.state.velocity().z / limit - 1.0).abs() < 1e-9, "{}", release.state.velocity().z);
}

#[test]
fn the_law_of_hunt_and_crossley_refuses_bad_input() {
    use ContactError::{Argument, PoissonRatio, Restitution};
    let law = HuntCrossley::try_new;
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            law(bad, 0.1),
            Err(Argument(ArgumentError::NotPositive { argument: "stiffness", .. }))
        ));
        assert!(matches!(law(1.0, bad), Err(Argument(ArgumentError::Negative { argument: "damping", .. }))));
        assert!(matches!(
            Elastic::try_new(bad, 0.3),
            Err(Argument(ArgumentError::NotPositive { argument: "young_modulus", .. }))
        ));
        assert!(matches!(
            HuntCrossley::from_restitution(1.0, 0.5, bad),
            Err(Argument(ArgumentError::NotPositive { argument: "speed", .. }))
        ));
    }
    for bad in [-1.0, 0.51, f64::NAN] {
        assert!(matches!(Elastic::try_new(1.0, bad), Err(PoissonRatio { .. })));
    }
    assert_eq!(HuntCrossley::from_restitution(1.0, 0.0, 1.0), Err(Restitution { found: 0.0 }));
    let steel = Elastic::try_new(1.0, 0.3).unwrap();
    let made = HuntCrossley::from_materials([steel, steel], 0.0, 0.0);
    assert!(matches!(made, Err(Argument(ArgumentError::NotPositive { argument: "effective_radius", .. }))));
}
