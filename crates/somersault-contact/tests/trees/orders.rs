//! Observed orders: located events keep the order of a method, steps that straddle them are of order 1.

use crate::scenes::{absolute, chain, chain_start};
use crate::{in_contact, passive};
use somersault_contact::models::{HoppingLeg, PlanarBiped};
use somersault_contact::tree::{TouchingState, TreeInContact};
use somersault_integrators::driver::{Adaptive, Steps, TimeGrid};
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::{TreeForces, TreeSystem};

/// The median of the slopes between neighbouring step sizes that are an octave apart, of those above the floor.
pub(crate) fn median_order(errors: &[(f64, f64)], octave: usize, floor: f64) -> f64 {
    let pairs = errors.iter().zip(&errors[octave..]).filter(|(_, (_, fine))| *fine > floor);
    let mut slopes: Vec<f64> = pairs.map(|((h, e), (k, f))| (e / f).ln() / (h / k).ln()).collect();
    assert!(slopes.len() >= 4, "{errors:?}");
    slopes.sort_by(f64::total_cmp);
    slopes[slopes.len() / 2]
}

/// Orders of the end's places in fixed steps, of a run of some events, against `rkmk8` in adapted steps: methods, steps in the first of
/// nine sizes over two octaves, and the range that their median must be in.
fn keeps_orders<F: TreeForces>(
    system: &TreeInContact<'_, F>,
    start: &TouchingState,
    (end, events): (f64, u64),
    methods: &[(Method, f64, f64, f64)],
) {
    let settings = Adaptive::with_tolerances(1e-14, 1e-14);
    let reference = Run::new(system, Method::Rkmk8, Steps::adapted((0.0, end), settings));
    let reference = reference.locating(Location::default()).from(start).unwrap();
    assert_eq!(reference.event_count, events);
    let (place, _) = absolute(&reference.state);
    for &(method, first, least, most) in methods {
        let error = |k: i32| {
            let steps = (first * 2f64.powf(f64::from(k) / 4.0)).round() as u64;
            let grid = TimeGrid::try_with_steps(0.0, end, steps).unwrap();
            let run = Run::new(system, method, grid).locating(Location::as_given()).from(start);
            (end / steps as f64, distance(&run.unwrap().state, &place))
        };
        let found: Vec<_> = (0..=8).map(error).collect();
        let order = median_order(&found, 4, 3e-13);
        println!("{method}: {order:.2}");
        assert!((least..most).contains(&order), "{method}: {order} {found:?}");
    }
}

#[test]
fn the_leg_keeps_the_orders_of_methods() {
    let leg = HoppingLeg::example().unwrap().system().unwrap();
    let system = in_contact(&leg);
    let start = system.unstretched(leg.start().unwrap());
    let methods = [
        (Method::Rk4, 800.0, 3.8, 4.8),
        (Method::Rkmk, 800.0, 3.8, 4.8),
        (Method::Rkmk5, 600.0, 4.7, 7.0),
        (Method::Rkmk8, 300.0, 7.0, 9.0),
    ];
    keeps_orders(&system, &start, (0.6, 16), &methods);
}

#[test]
fn the_chain_keeps_the_orders_of_methods() {
    let (model, contacts) = chain();
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, vec![]).unwrap();
    let start = chain_start(&system);
    let methods = [
        (Method::Rkmk, 4000.0, 3.8, 4.8),
        (Method::Rkmk5, 2000.0, 4.7, 7.0),
        (Method::Rkmk8, 120.0, 7.0, 9.5),
    ];
    keeps_orders(&system, &start, (0.5, 10), &methods);
}

#[test]
fn the_step_of_a_biped_keeps_the_orders_of_methods() {
    let biped = PlanarBiped::example().unwrap().system().unwrap();
    let system = in_contact(&biped);
    let start = system.unstretched(biped.start().unwrap());
    let methods = [
        (Method::Rkmk, 2000.0, 3.8, 4.8),
        (Method::Rkmk5, 1500.0, 4.7, 7.0),
        (Method::Rkmk8, 500.0, 7.0, 9.5),
    ];
    keeps_orders(&system, &start, (1.0, 5), &methods);
}

/// Where steps straddle events the errors scatter: means over an octave are compared, of the chain, which has no friction.
#[test]
fn steps_that_straddle_events_are_of_order_1() {
    let (model, contacts) = chain();
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, vec![]).unwrap();
    let start = chain_start(&system);
    let settings = Adaptive::with_tolerances(1e-13, 1e-13);
    let reference = Run::new(&system, Method::Rkmk8, Steps::adapted((0.0, 0.5), settings));
    let reference = reference.locating(Location::default()).from(&start).unwrap();
    let (place, _) = absolute(&reference.state);
    for method in [Method::Rkmk, Method::Rkmk8] {
        let mean = |first: f64| {
            let error = |k: i32| {
                let steps = (first * 2f64.powf(f64::from(k) / 8.0)).round() as u64;
                let grid = TimeGrid::try_with_steps(0.0, 0.5, steps).unwrap();
                distance(&Run::new(&system, method, grid).from(&start).unwrap().state, &place).ln()
            };
            (0..8).map(error).sum::<f64>() / 8.0
        };
        let order = (mean(1000.0) - mean(4000.0)) / (2.0 * 2f64.ln());
        assert!((0.6..1.6).contains(&order), "{method}: {order}");
    }
}

fn distance(x: &TouchingState, place: &[f64]) -> f64 {
    let (found, _) = absolute(x);
    found.iter().zip(place).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}
