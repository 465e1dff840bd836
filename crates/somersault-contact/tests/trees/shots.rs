//! No contact is missed: trees that fly past small obstacles in long steps, against an independent search for the least gap.
//!
//! Until it touches a tree flies freely. Its free motion in short steps by another method has the least gap: a shot in which
//! that is deeper than the spacing of the samples can hide must have an event, one in which it stays larger must have none.

use crate::{Torques, passive};
use nalgebra::Vector3;
use somersault_contact::contacts::Contact;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::surface::{
    CylindricalSurface, HalfSpace, SignedDistance, Solid, SphericalSurface, Surface,
};
use somersault_contact::tree::{LinkContact, TreeInContact};
use somersault_integrators::driver::{Adaptive, Flow, Observer, Status, Step, Steps, TimeGrid};
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::motion::{Coordinates, TreeSystem};
use somersault_multibody::{Joint, Link, Model};
use somersault_testkit::trees::Random;
use std::sync::Arc;

const END: f64 = 0.25;
const SHORT: f64 = 2.5e-4;
/// The depth that the spacing of the samples can hide, m.
const HIDDEN: f64 = 2e-4;

/// A sphere without a bound of its second derivative.
#[derive(Debug)]
struct Bare(SphericalSurface);

impl Surface for Bare {
    fn signed_distance(&self, point: &Vector3<f64>) -> SignedDistance {
        self.0.signed_distance(point)
    }
    fn lipschitz(&self) -> f64 {
        1.0
    }
}

fn tree(random: &mut Random) -> Model {
    let mut builder = Model::builder();
    for i in 0..1 + random.below(3) {
        let body = random.body();
        let link = if i == 0 {
            Link::root("b0", Joint::Free, body)
        } else {
            let joint = [Joint::Spherical, Joint::Revolute { axis: random.vector(1.0) }][random.below(2)];
            Link::child(format!("b{i}"), format!("b{}", i - 1), joint, body).at(random.vector(0.3))
        };
        builder.add(link).unwrap();
    }
    builder.build().unwrap()
}

/// The least gap over a free motion, and where its contact was at a time.
struct Gaps<'a> {
    system: &'a TreeInContact<'a, Torques>,
    least: f64,
    at: f64,
    place: Vector3<f64>,
}

impl Observer<Coordinates> for Gaps<'_> {
    fn observe(&mut self, step: &mut Step<'_, Coordinates>) -> Flow {
        let touch = self.system.touches(&self.system.unstretched(step.after.clone()))[0];
        self.least = self.least.min(touch.gap);
        if step.t_before <= self.at {
            self.place = touch.point;
        }
        Flow::Continue
    }
}

#[test]
fn trees_that_fly_past_obstacles_miss_no_contact() {
    let mut random = Random::new(11);
    let (mut hits, mut misses) = (0, 0);
    for case in 0..240 {
        let model = tree(&mut random);
        let (link, place) = (format!("b{}", random.below(model.n_bodies())), random.vector(0.3));
        let law = CompliantLaw::try_new(2e3, 5.0).unwrap();
        let torques = |random: &mut Random| -> Torques {
            if random.below(2) == 0 {
                Box::new(())
            } else {
                Box::new(|_: f64, _: &[f64], _: &[f64], _: &mut [f64]| ())
            }
        };
        let against = |surface: Arc<dyn Surface>, torques: Torques| {
            let contact = Contact::try_ball(place, 0.01, surface, law).unwrap();
            let contact = vec![LinkContact::new("c", link.clone(), contact)];
            TreeInContact::try_new(TreeSystem::new(&model, torques), contact, vec![]).unwrap()
        };
        let mut q = model.neutral();
        model.displace(&model.neutral(), &random.numbers(model.n_velocities(), 1.5), &mut q).unwrap();
        let mut v = random.numbers(model.n_velocities(), 6.0);
        v[0] += 8.0;
        let start = model.state(&q, &v).unwrap();
        let free = TreeSystem::new(&model, passive());
        let fly = |system: &TreeInContact<'_, Torques>, at: f64| {
            let grid = TimeGrid::try_new(0.0, END, SHORT).unwrap();
            let mut gaps = Gaps { system, least: f64::INFINITY, at, place: Vector3::zeros() };
            Run::new(&free, Method::Rkmk, grid).observed_by(&mut gaps).from(&start).unwrap();
            (gaps.least, gaps.place)
        };
        // Far away: only where the contact passes is asked.
        let far = HalfSpace::try_new(-Vector3::z() * 1e3, Vector3::z()).unwrap();
        let (_, passed) = fly(&against(Arc::new(far), torques(&mut random)), random.within(0.05, END));
        let radius = random.within(0.02, 0.2);
        let centre = passed + random.vector(1.2 * radius);
        let sphere = SphericalSurface::try_new(centre, radius, Solid::Inside).unwrap();
        let obstacle: Arc<dyn Surface> = match random.below(3) {
            0 => Arc::new(sphere),
            1 => Arc::new(Bare(sphere)),
            _ => {
                let axis = random.vector(1.0);
                Arc::new(CylindricalSurface::try_new(centre, axis, radius, Solid::Inside).unwrap())
            }
        };
        let system = against(obstacle, torques(&mut random));
        let begin = system.unstretched(start.clone());
        let (least, _) = fly(&system, 0.0);
        if system.touches(&begin)[0].gap < 0.01 || least.abs() < HIDDEN {
            continue;
        }
        let (method, steps): (Method, Steps) = match random.below(3) {
            0 => (Method::Rkmk8, TimeGrid::try_new(0.0, END, [0.05, 0.02][random.below(2)]).unwrap().into()),
            1 => (Method::Rkmk5, TimeGrid::try_new(0.0, END, 0.01).unwrap().into()),
            _ => {
                let tolerance = 10f64.powf(random.within(-9.0, -6.0));
                (Method::Rkmk8, Steps::adapted((0.0, END), Adaptive::with_tolerances(tolerance, tolerance)))
            }
        };
        let run = Run::new(&system, method, steps).locating(Location::default());
        let run = run.from(&begin).unwrap_or_else(|broken| panic!("{case}: {}", broken.reason));
        assert_eq!(run.status, Status::Finished);
        if least < 0.0 {
            hits += 1;
            assert!(run.event_count > 0, "{case}: a hit of {least:e} was missed by {method}");
        } else {
            misses += 1;
            assert_eq!(run.event_count, 0, "{case}: {method} hit what it passed at {least:e}");
        }
    }
    assert!(hits > 100 && misses > 30, "{hits} {misses}");
}
