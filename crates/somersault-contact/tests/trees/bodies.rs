//! A tree of one free body is a rigid body, and a tree of two is a pair: the same motions to rounding.

use crate::{RKMK8, passive};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_contact::bodies::{BodiesInContact, BodyContacts, BodySphere, SpherePair};
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::laws::hunt_crossley::HuntCrossley;
use somersault_contact::laws::resistance::Resistance;
use somersault_contact::stretches::WithStretches;
use somersault_contact::surface::{
    CylindricalSurface, HalfSpace, SignedDistance, Solid, SphericalSurface, Surface,
};
use somersault_contact::tree::{LinkContact, LinkPair, TouchingState, TreeInContact};
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::events::Location;
use somersault_integrators::force::Gravity;
use somersault_integrators::run::Run;
use somersault_integrators::state::{RigidBodiesState, RigidBodyState};
use somersault_multibody::motion::TreeSystem;
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::sync::Arc;

/// A paraboloid z = (x² + y²)/2 as a function that is no distance, over the length of its gradient.
#[derive(Debug)]
struct Bowl;

impl Surface for Bowl {
    fn signed_distance(&self, p: &Vector3<f64>) -> SignedDistance {
        // The distance from a sphere of 1 m from within, by its own formula.
        let span = p - Vector3::new(0.0, 0.0, 1.0);
        SignedDistance { distance: 1.0 - span.norm(), gradient: -span.normalize() }
    }
    fn lipschitz(&self) -> f64 {
        1.0
    }
}

fn free(mass: MassProperties) -> Model {
    let mut builder = Model::builder();
    builder.add(Link::root("body", Joint::Free, mass)).unwrap();
    builder.build().unwrap()
}

/// q and v of a free link at a state of a body.
fn coordinates(x: &RigidBodyState) -> ([f64; 7], [f64; 6]) {
    let (p, r) = (x.position(), x.orientation());
    let [u, w] = [x.velocity(), x.angular_velocity()].map(|v| r.inverse() * v);
    let c = &r.coords;
    ([p.x, p.y, p.z, c.x, c.y, c.z, c.w], [u.x, u.y, u.z, w.x, w.y, w.z])
}

/// How far the first link of a tree is from a body: place, orientation, velocity.
fn apart(tree: &[f64], rates: &[f64], body: &RigidBodyState) -> f64 {
    let place = Vector3::from_column_slice(&tree[..3]) - body.position();
    let c = &body.orientation().coords;
    let turn = (0..4).map(|k| (tree[3 + k] - c[k]).abs()).fold(0.0, f64::max);
    let velocity = Vector3::from_column_slice(&rates[..3]) - body.velocity();
    let omega = body.orientation().inverse() * body.angular_velocity();
    let spin = Vector3::from_column_slice(&rates[3..6]) - omega;
    place.norm() + turn + velocity.norm() + spin.norm()
}

#[test]
fn a_tree_of_one_body_is_that_body() {
    let body = RigidBody::try_box(1.3, Vector3::new(0.2, 0.3, 0.1)).unwrap();
    let mass = MassProperties { mass: 1.3, center: Vector3::zeros(), inertia: *body.inertia().tensor() };
    let model = free(mass);
    let compliant = ContactLaw::from(CompliantLaw::try_new(5e3, 20.0).unwrap());
    let hertz = ContactLaw::from(HuntCrossley::try_new(3e4, 0.3).unwrap());
    let friction = CoulombFriction::try_new(0.4, 4e3, 30.0).unwrap();
    let rolling = Resistance::try_new(0.01, 0.02, 0.3).unwrap();
    let rough = compliant.clone().with_friction(friction);
    let hertz = hertz.with_friction(friction).with_resistance(rolling);
    let plane = HalfSpace::try_new(Vector3::zeros(), Vector3::new(0.1, -0.2, 1.0)).unwrap();
    let hill = SphericalSurface::try_new(Vector3::new(0.1, 0.0, -2.0), 2.0, Solid::Inside).unwrap();
    let axis = Vector3::new(1.0, 0.3, 0.1);
    let tube = CylindricalSurface::try_new(Vector3::z(), axis, 1.0, Solid::Outside).unwrap();
    let (point, centre) = (Vector3::new(0.1, 0.15, -0.05), Vector3::new(0.0, -0.05, 0.02));
    let scenes: [Vec<Contact>; 6] = [
        vec![Contact::try_new(point, Arc::new(plane), compliant).unwrap()],
        [-1.0, 1.0]
            .iter()
            .flat_map(|x| [-1.0, 1.0].map(|y| Vector3::new(0.1 * x, 0.15 * y, -0.05)))
            .map(|corner| Contact::try_new(corner, Arc::new(plane), rough.clone()).unwrap())
            .collect(),
        vec![Contact::try_ball(centre, 0.2, Arc::new(hill), rough.clone()).unwrap()],
        vec![Contact::try_ball(centre, 0.2, Arc::new(tube), hertz.clone()).unwrap()],
        vec![Contact::try_new(point, Arc::new(Bowl), rough.clone()).unwrap()],
        vec![Contact::try_rim(centre, Vector3::new(0.1, 0.9, 0.2), 0.25, plane, hertz).unwrap()],
    ];
    let start = RigidBodyState::new(
        Vector3::new(0.05, 0.02, 0.35),
        UnitQuaternion::new(Vector3::new(0.2, -0.1, 0.4)),
        Vector3::new(0.8, 0.1, -1.0),
        Vector3::new(1.0, 3.0, -2.0),
    );
    for (i, contacts) in scenes.into_iter().enumerate() {
        let named = contacts.iter().enumerate();
        let named = named.map(|(k, c)| LinkContact::new(format!("c{k}"), "body", c.clone())).collect();
        let bodies = BodyInContact::new(body, (Gravity::earth(), Contacts::new(contacts)));
        let bodies = WithStretches(&bodies);
        let tree = TreeInContact::try_new(TreeSystem::new(&model, passive()), named, vec![]).unwrap();
        let (q, v) = coordinates(&start);
        let state = tree.unstretched(model.state(&q, &v).unwrap());
        let grid = TimeGrid::try_new(0.0, 0.4, 5e-4).unwrap();
        let of_body = Run::by_stepper(&bodies, &RKMK8, grid).locating(Location::as_given());
        let of_body = of_body.from(&bodies.unstretched(start)).unwrap();
        let of_tree = Run::by_stepper(&tree, &RKMK8, grid).locating(Location::as_given());
        let of_tree = of_tree.from(&state).unwrap();
        assert!(of_body.event_count > 1, "{i}: {} events", of_body.event_count);
        let kinds = |events: Vec<(usize, EventKind)>| events;
        let [a, b] = [
            kinds(of_body.events.iter().map(|e| (e.guard, e.kind)).collect()),
            kinds(of_tree.events.iter().map(|e| (e.guard, e.kind)).collect()),
        ];
        assert_eq!(a, b, "{i}");
        for (a, b) in of_body.events.iter().zip(&of_tree.events) {
            assert!((a.t - b.t).abs() < 1e-11, "{i}: {} {}", a.t, b.t);
            assert!((a.impulse - b.impulse).abs() < 1e-9 * (1.0 + a.impulse), "{i}");
        }
        let TouchingState { configuration, rate } = &of_tree.state;
        let (q, p) = (configuration.0.as_slice(), rate.base.as_slice());
        let error = apart(q, p, &of_body.state.base());
        assert!(error < 1e-10, "{i}: {error:e}");
        for (a, b) in of_body.state.variables().iter().zip(&rate.variables) {
            assert!((a - b).norm() < 1e-11, "{i}: {a} {b}");
        }
    }
}

#[test]
fn a_pair_of_links_is_a_pair_of_bodies() {
    let masses = [1.0, 0.4];
    let bodies = masses.map(|mass| RigidBody::try_box(mass, Vector3::new(0.2, 0.3, 0.1)).unwrap());
    let law = ContactLaw::from(CompliantLaw::try_new(5e3, 10.0).unwrap())
        .with_friction(CoulombFriction::try_new(0.4, 4e3, 30.0).unwrap());
    let centres = [Vector3::new(0.02, 0.0, 0.01), Vector3::new(0.0, -0.01, 0.02)];
    let radii = [0.15, 0.1];
    let sphere = |i: usize| BodySphere::try_new(i, centres[i], radii[i]).unwrap();
    let pair = SpherePair::try_new(sphere(0), sphere(1), law.clone()).unwrap();
    let contacts = BodyContacts::try_new(2, vec![], vec![pair]).unwrap();
    let flying = BodiesInContact::try_new(bodies.to_vec(), vec![(); 2], contacts).unwrap();
    let flying = WithStretches(&flying);
    // Two free links on a stand that is fixed.
    let mut builder = Model::builder().with_gravity(Vector3::zeros());
    let stand = MassProperties { mass: 1.0, center: Vector3::zeros(), inertia: Matrix3::identity() };
    builder.add(Link::root("stand", Joint::Fixed, stand)).unwrap();
    for (name, body) in ["a", "b"].iter().zip(bodies) {
        let inertia = *body.inertia().tensor();
        let mass = MassProperties { mass: body.mass(), center: Vector3::zeros(), inertia };
        builder.add(Link::child(*name, "stand", Joint::Free, mass)).unwrap();
    }
    let model = builder.build().unwrap();
    let links = LinkPair::try_new("touch", ("a", centres[0], 0.15), ("b", centres[1], 0.1), law).unwrap();
    let tree = TreeInContact::try_new(TreeSystem::new(&model, passive()), vec![], vec![links]).unwrap();
    let of = |place: Vector3<f64>, velocity: Vector3<f64>, spin: Vector3<f64>| {
        RigidBodyState::new(place, UnitQuaternion::new(spin * 0.1), velocity, spin)
    };
    let states = [
        of(Vector3::zeros(), Vector3::new(1.0, 0.0, 0.0), Vector3::new(2.0, 1.0, 3.0)),
        of(Vector3::new(0.4, 0.05, 0.0), Vector3::new(-0.5, 0.0, 0.1), Vector3::new(-1.0, 4.0, 2.0)),
    ];
    let [(q0, v0), (q1, v1)] = states.each_ref().map(coordinates);
    let state = model.state(&[q0, q1].concat(), &[v0, v1].concat()).unwrap();
    let grid = TimeGrid::try_new(0.0, 0.3, 1e-3).unwrap();
    let of_tree = Run::by_stepper(&tree, &RKMK8, grid).locating(Location::as_given());
    let of_tree = of_tree.from(&tree.unstretched(state)).unwrap();
    let start = flying.unstretched(RigidBodiesState::from_bodies(&states));
    let of_bodies = Run::by_stepper(&flying, &RKMK8, grid).locating(Location::as_given());
    let of_bodies = of_bodies.from(&start).unwrap();
    assert_eq!(of_tree.event_count, of_bodies.event_count);
    assert!(of_tree.event_count >= 3, "{}", of_tree.event_count);
    let (q, p) = (of_tree.state.configuration.0.as_slice(), of_tree.state.rate.base.as_slice());
    for (i, body) in [0, 1].iter().map(|i| of_bodies.state.base().body(*i).unwrap()).enumerate() {
        let error = apart(&q[7 * i..], &p[6 * i..], &body);
        assert!(error < 1e-11, "{i}: {error:e}");
    }
}
