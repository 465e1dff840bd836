//! Forces, Jacobians and a pose at rest, against dynamics.

use crate::{Torques, passive};
use crate::{in_contact, scenes::chain};
use nalgebra::{DVector, Vector3};
use somersault_contact::ContactError;
use somersault_contact::contacts::Contact;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::models::{HoppingLeg, Ragdoll};
use somersault_contact::surface::{HalfSpace, Solid, SphericalSurface};
use somersault_contact::tree::{LinkContact, LinkPair, TreeInContact};
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::events::{Hybrid, Location};
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_integrators::system::System;
use somersault_multibody::Data;
use somersault_multibody::motion::TreeSystem;
use somersault_testkit::trees::{Random, random_configuration, random_tree};
use std::sync::Arc;

/// M a + h = τ + Σ Jᵀ F with the Jacobians and forces reported, M and h by their own algorithms.
#[test]
fn forces_and_jacobians_are_those_of_the_dynamics() {
    let mut random = Random::new(5);
    let mut touching = 0;
    for case in 0..60 {
        let n = 2 + random.below(4);
        let model = random_tree(&mut random, n, 0.5).unwrap();
        if model.n_velocities() == 0 {
            continue;
        }
        let q = random_configuration(&mut random, &model).unwrap();
        let v = random.numbers(model.n_velocities(), 1.0);
        let law = ContactLaw::from(CompliantLaw::try_new(500.0, 3.0).unwrap())
            .with_friction(CoulombFriction::try_new(0.5, 300.0, 2.0).unwrap());
        let ball = SphericalSurface::try_new(random.vector(0.3), 1.5, Solid::Inside).unwrap();
        let ground: Arc<SphericalSurface> = Arc::new(ball);
        let mut contacts = Vec::new();
        for i in 0..n {
            let contact = Contact::try_ball(random.vector(0.3), 0.2, ground.clone(), law.clone()).unwrap();
            contacts.push(LinkContact::new(format!("c{i}"), format!("b{i}"), contact));
        }
        let pair = LinkPair::try_new(
            "pair",
            ("b0", random.vector(0.3), 0.4),
            (format!("b{}", n - 1), random.vector(0.3), 0.6),
            law,
        );
        let tree = TreeSystem::new(&model, passive());
        let system = TreeInContact::try_new(tree, contacts, vec![pair.unwrap()]).unwrap();
        let state = model.state(&q, &v).unwrap();
        let stretches = (0..=n).map(|_| random.vector(0.05)).collect();
        let x = system.stretched(state, stretches).unwrap();
        let touches = system.touches(&x);
        touching += touches.iter().filter(|touch| touch.force != Vector3::zeros()).count();
        let mut pushed = DVector::zeros(v.len());
        for touch in &touches {
            let jacobian = system.contact_jacobian(touch.contact, &x).unwrap();
            let velocity = &jacobian * DVector::from_column_slice(&v);
            let expected = touch.sliding + touch.normal * touch.rate;
            assert!((velocity - expected).norm() < 1e-12 * (1.0 + expected.norm()), "{case}");
            pushed += jacobian.transpose() * touch.force;
        }
        let mut w = system.workspace();
        let mode = system.mode(0.0, &x);
        let mut out = x.rate.clone();
        system.acceleration_in(&mode, &mut w, 0.0, &x, &mut out);
        // Joint accelerations are those of dynamics under the wrenches; checked by the balance of power and forces.
        let mut data = Data::new(&model);
        let mass = model.mass_matrix(&mut data, &q).unwrap().clone();
        let bias = DVector::from_column_slice(model.bias(&mut data, &q, &v).unwrap());
        let acceleration = mass.clone().lu().solve(&(pushed - &bias)).unwrap();
        // No joint force is needed for it, under the forces of the laws as under the same that are measured.
        let measured: Vec<_> = touches.iter().map(|touch| touch.force).collect();
        for given in [None, Some(&measured[..])] {
            let needed = system.inverse_dynamics(0.0, &x, acceleration.as_slice(), given).unwrap();
            let most = needed.iter().fold(0.0f64, |most, force| most.max(force.abs()));
            assert!(most < 1e-11 * (1.0 + bias.amax()) * (1.0 + acceleration.amax()), "{case}: {most:e}");
        }
        let short = system.inverse_dynamics(0.0, &x, acceleration.as_slice(), Some(&measured[1..]));
        assert!(matches!(short, Err(ContactError::MeasuredForces { .. })));
        let mut found = DVector::zeros(v.len());
        // By the derivative of the joint velocities along the rates, over a short time.
        let step = 1e-6;
        let velocities = |sign: f64| {
            let mut near = x.base();
            let rate = near.rate.clone();
            near.drift(&rate, sign * step);
            near.kick(&out.base, sign * step);
            let mut joint = vec![0.0; v.len()];
            model.joint_velocities(&near, &mut joint).unwrap();
            DVector::from_column_slice(&joint)
        };
        found += (velocities(1.0) - velocities(-1.0)) * (0.5 / step);
        let error = (&found - &acceleration).norm() / (1.0 + acceleration.norm());
        assert!(error < 1e-5, "{case}: {error:e}");
    }
    assert!(touching > 30, "{touching}");
}

/// The rate of the momentum, by differences along the motion, is what weight and ground give.
#[test]
fn momentum_changes_by_weight_and_contacts() {
    let scene = Ragdoll::example().unwrap().system().unwrap();
    let system = in_contact(&scene);
    let start = system.unstretched(scene.start().unwrap());
    let steps = Steps::adapted((0.0, 0.6), Adaptive::with_tolerances(1e-6, 1e-8));
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default());
    let x = run.from(&start).unwrap().state;
    assert!(system.touches(&x).iter().any(|touch| touch.force.z > 1.0));
    let (mut w, mut out, step) = (system.workspace(), x.rate.clone(), 1e-6);
    system.acceleration_in(&system.mode(0.0, &x), &mut w, 0.6, &x, &mut out);
    let [before, after] = [-step, step].map(|h| {
        let mut near = x.base();
        let rate = near.rate.clone();
        near.drift(&rate, h);
        near.kick(&out.base, h);
        system.momentum(&system.unstretched(near)).unwrap()
    });
    let now = system.momentum(&x).unwrap();
    let close = |rate: Vector3<f64>, given: Vector3<f64>| (rate - given).norm() < 1e-6 * (1.0 + given.norm());
    assert!(close((after.linear - before.linear) / (2.0 * step), now.weight + now.force));
    assert!(close((after.angular - before.angular) / (2.0 * step), now.moment));
}

/// A leg on two feet apart, on soft ground, with a body and hips that are springs.
#[test]
fn a_pose_at_rest_stays_at_rest() {
    let leg = HoppingLeg::example().unwrap();
    let model = leg.model().unwrap();
    // Springs hold hip and knee.
    let (hip, knee) = (0.6, -1.2);
    let springs: Torques = Box::new(move |_: f64, q: &[f64], v: &[f64], torque: &mut [f64]| {
        torque[3] += 300.0 * (hip - q[3]) - 6.0 * v[3];
        torque[4] += 300.0 * (knee - q[4]) - 6.0 * v[4];
    });
    let law = ContactLaw::from(leg.law).with_friction(leg.friction);
    let ground = Arc::new(HalfSpace::ground());
    let at = |name: &str, link: &str, place: Vector3<f64>| {
        LinkContact::new(name, link, Contact::try_new(place, ground.clone(), law.clone()).unwrap())
    };
    // A foot of 0.2 m with heel and toe at the end of the shank, level where that leans by 0.6 rad.
    let (down, along) = (-0.3 * Vector3::y(), Vector3::new(0.1 * 0.6f64.cos(), 0.1 * 0.6f64.sin(), 0.0));
    let contacts = vec![at("toe", "shank", down + along), at("heel", "shank", down - along)];
    let system = TreeInContact::try_new(TreeSystem::new(&model, springs), contacts, vec![]).unwrap();
    let guess = [0.0, 0.05 + 0.6 * 0.6f64.cos() - 2e-3, 0.0, hip, knee];
    let standing = system.equilibrium(0.0, &guess).unwrap();
    assert!(standing.is_held, "{standing:?}");
    let held: f64 = system.touches(&standing.state).iter().map(|touch| touch.force.z).sum();
    assert!((held - 6.5 * 9.81).abs() < 1e-9, "{held}");
    let steps = Steps::adapted((0.0, 0.2), Adaptive::with_tolerances(1e-12, 1e-14));
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default());
    let end = run.from(&standing.state).unwrap();
    let moved = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (from, to) = (standing.state.configuration.0.as_slice(), end.state.configuration.0.as_slice());
    assert!(moved(from, to) < 1e-11, "{:e}", moved(from, to));
    assert_eq!(end.event_count, 0);
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let (model, contacts) = chain();
    let law = CompliantLaw::try_new(1e4, 1.0).unwrap();
    let contact = contacts[0].contact().clone();
    let made = |contacts, pairs| {
        TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, pairs).map(|_| ()).unwrap_err()
    };
    let unknown = made(vec![LinkContact::new("a", "third", contact.clone())], vec![]);
    assert_eq!(unknown.to_string(), "`link` must be the name of a body of the model, found `third`");
    let twice = ["first", "second"].map(|link| LinkContact::new("a", link, contact.clone()));
    assert_eq!(made(twice.to_vec(), vec![]), ContactError::DuplicateName { name: "a".into() });
    let none = Vector3::zeros();
    let same = LinkPair::try_new("a", ("first", none, 0.1), ("first", none, 0.1), law).unwrap_err();
    assert_eq!(same, ContactError::SameLink { link: "first".into() });
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), contacts, vec![]).unwrap();
    let x = system.unstretched(model.state(&model.neutral(), &[0.0; 4]).unwrap());
    let beyond = system.contact_jacobian(3, &x).unwrap_err();
    assert_eq!(beyond, ContactError::NoContact { found: 3, contacts: 3 });
}
