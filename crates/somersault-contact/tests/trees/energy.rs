//! Energy: kept without damping, and never created.

use crate::scenes::{chain, chain_start};
use crate::slider::LEG;
use crate::{Torques, passive};
use nalgebra::Vector3;
use somersault_contact::contacts::Contact;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::surface::HalfSpace;
use somersault_contact::tree::{LinkContact, TreeInContact};
use somersault_integrators::driver::{Adaptive, Flow, Observer, Step, Steps, TimeGrid};
use somersault_integrators::events::{Hybrid, Location};
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::TreeSystem;
use std::sync::Arc;

#[test]
fn energy_is_kept_without_damping() {
    let (model, _) = chain();
    let law = CompliantLaw::try_new(2e4, 0.0).unwrap();
    let of = |name: &str, link: &str, length: f64| {
        let point = -Vector3::y() * length;
        let contact = Contact::try_new(point, Arc::new(HalfSpace::ground()), law).unwrap();
        LinkContact::new(name, link, contact)
    };
    let contacts = vec![of("hinge", "first", 0.0), of("tip 1", "first", 0.5), of("tip 2", "second", 0.4)];
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, vec![]).unwrap();
    let start = chain_start(&system);
    let steps = Steps::adapted((0.0, 2.0), Adaptive::with_tolerances(1e-12, 1e-12));
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start).unwrap();
    assert!(run.event_count > 20, "{}", run.event_count);
    let [before, after] = [&start, &run.state].map(|x| system.ledger(x).total());
    assert!((after - before).abs() < 1e-8, "{before} {after}");
    // Fixed steps are divided for the springs, by a bound of their rate.
    let grid = TimeGrid::try_new(0.0, 0.5, 0.02).unwrap();
    let run = Run::new(&system, Method::Rkmk8, grid).locating(Location::default()).from(&start).unwrap();
    assert!(run.substeps > 0);
    let after = system.ledger(&run.state).total();
    assert!((after - before).abs() < 1e-5 * before.abs(), "{before} {after}");
}

/// Sees the energy after every step.
struct Falls<'a, S> {
    system: &'a S,
    last: f64,
    scale: f64,
    steps: u64,
}

impl<S: Hybrid> Observer<S::Configuration> for Falls<'_, S> {
    fn observe(&mut self, step: &mut Step<'_, S::Configuration>) -> Flow {
        let energy = self.system.energy(step.after).unwrap();
        self.scale = self.scale.max(energy.kinetic + energy.springs);
        let total = energy.total();
        assert!(total <= self.last + 1e-8 * self.scale, "{} {total} after {} steps", self.last, self.steps);
        self.last = total;
        self.steps += 1;
        Flow::Continue
    }
}

#[test]
fn energy_is_never_created() {
    let model = LEG.model();
    let law = CompliantLaw::try_new(2e4, 30.0).unwrap();
    let contact = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
    let contacts = vec![LinkContact::new("foot", "foot", contact)];
    let system =
        TreeInContact::try_new(TreeSystem::new(&model, Box::new(LEG) as Torques), contacts, vec![]).unwrap();
    let start = system.unstretched(model.state(&[0.8, 0.0], &[0.0, 0.0]).unwrap());
    let mut falls = Falls { system: &system, last: system.ledger(&start).total(), scale: 0.0, steps: 0 };
    let first = falls.last;
    let steps = Steps::adapted((0.0, 3.0), Adaptive::with_tolerances(1e-11, 1e-11));
    let run = Run::new(&system, Method::Rkmk8, steps).observed_by(&mut falls);
    let end = run.locating(Location::default()).from(&start).unwrap();
    let ledger = system.ledger(&end.state);
    assert!(ledger.elastic > 0.0 && ledger.forces > 0.0 && first - ledger.total() > 5.0, "{ledger:?}");
}
