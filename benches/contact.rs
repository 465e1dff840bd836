//! Time per step of the spinning top of thesis 7.3.2: without contacts, with the guard of its tip watched in
//! flight, and with the contact active; the time of one second with its seven events, with fixed and with adapted
//! steps; that of a box dropped on a corner, whose friction is a law asked through its object; that of a chain of 16 links by the
//! number of balls on it that touch the ground; that of a body on a leg whose foot weighs 1 g, by explicit methods and by an
//! implicit one; and that of the gradient of a hop by 1, 10 and 100 numbers, by columns and by the adjoint.
//!
//! `cargo bench --bench contact`; criterion reports the time of one element, which is one step.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use somersault::contact::contacts::Contact;
use somersault::contact::laws::ContactLaw;
use somersault::contact::laws::compliant::CompliantLaw;
use somersault::contact::laws::coulomb::CoulombFriction;
use somersault::contact::laws::regularised::RegularisedFriction;
use somersault::contact::models::{FallingBox, HoppingLeg, SpinningTop};
use somersault::contact::sensitivity::{Differentiation, EndCost, Parameter, SensitivityRun};
use somersault::contact::surface::HalfSpace;
use somersault::contact::tree::{LinkContact, TreeInContact};
use somersault::integrators::driver::{Adaptive, Flow, Steps};
use somersault::integrators::events::Location;
use somersault::integrators::nalgebra::{DMatrix, Matrix3};
use somersault::integrators::stepper::Scope;
use somersault::multibody::motion::{Between, Knots, TorqueProfile, TreeForces, TreeSystem};
use somersault::multibody::{Joint, Link, MassProperties, Model};
use somersault::prelude::*;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

const STEPS: u64 = 1_000;

fn steps(c: &mut Criterion) {
    let top = SpinningTop::thesis().expect("the top of the thesis");
    let free = RigidBodySystem::new(top.system.body, Gravity::earth());
    let location = Location::default();
    // In 10 ms from the start the tip does not touch; after 0.2 s it never leaves.
    let grid = TimeGrid::try_with_steps(0.0, 0.01, STEPS).expect("a forward interval");
    let settle = TimeGrid::try_new(0.0, 0.2, 1e-4).expect("a forward interval");
    let settled = Run::new(&top.system, Method::RkmkB, settle).locating(location).from(&top.start);
    let settled = settled.expect("a run of the top");
    for method in Method::ALL.into_iter().filter(|m| m.info().scope != Scope::TorqueFree) {
        let mut group = c.benchmark_group(method.info().name);
        group.throughput(Throughput::Elements(STEPS));
        group.bench_function("contact_free", |b| {
            b.iter(|| Run::new(&free, method, grid).from(black_box(&top.start)))
        });
        for (name, start) in [("guarded", &top.start), ("in_contact", &settled.state)] {
            group.bench_function(name, |b| {
                b.iter(|| Run::new(&top.system, method, grid).locating(location).from(black_box(start)))
            });
        }
        group.finish();
    }
}

fn one_second(c: &mut Criterion) {
    let top = SpinningTop::thesis().expect("the top of the thesis");
    let grid = TimeGrid::try_new(0.0, 1.0, 1e-3).expect("a forward interval");
    let run = |method: Method, steps: Steps| {
        Run::new(&top.system, method, steps).locating(Location::default()).from(black_box(&top.start))
    };
    let mut group = c.benchmark_group("one_second_of_the_top");
    for method in [Method::RkmkB, Method::Rkmk5B, Method::Rkmk8B] {
        group.bench_function(method.info().name, |b| b.iter(|| run(method, grid.into())));
    }
    for (method, tolerance) in [(Method::Rkmk5B, 1e-9), (Method::Rkmk8B, 1e-9), (Method::Rkmk8B, 1e-11)] {
        let steps = Steps::adapted((0.0, 1.0), Adaptive::with_tolerances(tolerance, tolerance));
        group.bench_function(format!("{method}_adaptive_{tolerance:e}"), |b| b.iter(|| run(method, steps)));
    }
    group.finish();
}

/// The box dropped on a corner: eight contacts, the steps of 0.1 ms of its first half second.
fn box_with_regularised_friction(c: &mut Criterion) {
    let normal = CompliantLaw::try_new(400.0, 4.0).expect("a spring and a damper");
    let friction = RegularisedFriction::try_new(0.3, 0.1).expect("a coefficient and a speed");
    let law = ContactLaw::from(normal).with_friction(friction);
    let model = FallingBox::try_new(1.0, Vector3::new(0.3, 0.2, 0.1), law).expect("a box");
    let (start, location) = (model.on_corner(0.1, 0.4), Location::default());
    let grid = TimeGrid::try_new(0.0, 0.5, 1e-4).expect("a forward interval");
    let mut group = c.benchmark_group("box_with_regularised_friction");
    group.throughput(Throughput::Elements(grid.steps()));
    for method in [Method::Rkmk, Method::RkmkB, Method::Rkmk8B] {
        group.bench_function(method.info().name, |b| {
            b.iter(|| Run::new(&model.system, method, grid).locating(location).from(black_box(&start)))
        });
    }
    group.finish();
}

/// A chain of 16 links that lies on the ground, with so many balls that touch it, over its links in turn: what a step costs by the number of
/// contacts.
fn contacts_of_a_tree(c: &mut Criterion) {
    let rod = MassProperties { mass: 1.0, center: Vector3::x() * 0.1, inertia: Matrix3::identity() * 0.01 };
    let mut builder = Model::builder();
    builder.add(Link::root("0", Joint::Free, rod)).expect("a root");
    for i in 1..16 {
        let axis = [Vector3::y(), Vector3::z()][i % 2];
        let link = Link::child(i.to_string(), (i - 1).to_string(), Joint::Revolute { axis }, rod);
        builder.add(link.at(Vector3::x() * 0.2)).expect("a link");
    }
    let model = builder.build().expect("a chain");
    let friction = CoulombFriction::try_new(0.5, 1e4, 50.0).expect("a coefficient, a spring and a damper");
    let law = ContactLaw::from(CompliantLaw::try_new(1e4, 50.0).expect("a spring and a damper"))
        .with_friction(friction);
    let ground = Arc::new(HalfSpace::ground());
    let grid = TimeGrid::try_new(0.0, 2e-3, 1e-5).expect("a forward interval");
    let mut group = c.benchmark_group("contacts_of_a_tree");
    group.throughput(Throughput::Elements(grid.steps()));
    for n in [0, 1, 2, 4, 8, 16, 32] {
        let ball = |i: usize| {
            let centre = Vector3::new(0.2 * ((i / 16) as f64), 0.0, 0.049);
            let ball = Contact::try_ball(centre, 0.05, ground.clone(), law.clone()).expect("a ball");
            LinkContact::new(format!("ball {i}"), (i % 16).to_string(), ball)
        };
        let system = TreeInContact::try_new(TreeSystem::new(&model, ()), (0..n).map(ball).collect(), vec![]);
        let system = system.expect("links of the chain");
        let still = model.state(&model.neutral(), &[0.0; 21]).expect("a state");
        let start = system.unstretched(still);
        for method in [Method::Rkmk, Method::Rkmk8] {
            group.bench_function(format!("{method}/{n}"), |b| {
                b.iter(|| {
                    Run::new(&system, method, grid).locating(Location::default()).from(black_box(&start))
                })
            });
        }
    }
    group.finish();
}

/// The gradient of the knee's angle of the hopping leg after its first stance, by so many knots of its torque: by columns and by the
/// adjoint, beside a run without either.
fn gradient_of_a_hop(c: &mut Criterion) {
    let leg = HoppingLeg::example().and_then(|leg| leg.system()).expect("the leg of the example");
    let start = leg.start().expect("its start");
    let grid = TimeGrid::try_new(0.0, 0.16, 1e-3).expect("a forward interval");
    let profile = |knots: u32| {
        let time = |knot: u32| 0.16 * f64::from(knot) / f64::from(knots.max(2) - 1);
        let times: Vec<f64> = (0..knots.max(2)).map(time).collect();
        let torque = |dof: usize, knot: usize| {
            let mut torque = [0.0; 5];
            leg.actuators.add_torque(times[knot], &leg.q, &leg.v, &mut torque);
            torque[dof]
        };
        let knots = Knots::try_new(&times, Between::Line).expect("increasing times");
        let values = DMatrix::from_fn(5, times.len(), torque);
        TorqueProfile::try_new(knots, values).expect("a column for each knot")
    };
    let mut group = c.benchmark_group("gradient_of_a_hop");
    for n in [1, 10, 100] {
        let profile = profile(n as u32);
        let by =
            Differentiation::by(Parameter::joint_forces_at(4, profile.knots()).take(n).collect::<Vec<_>>());
        let system =
            TreeInContact::try_new(TreeSystem::new(&leg.model, profile), leg.contacts.clone(), vec![]);
        let system = system.expect("the leg in contact");
        let touching = system.unstretched(start.clone());
        group.bench_function(format!("run/{n}"), |b| {
            b.iter(|| {
                Run::new(&system, Method::Rkmk8, grid)
                    .locating(Location::default())
                    .from(black_box(&touching))
            })
        });
        group.bench_function(format!("columns/{n}"), |b| {
            b.iter(|| SensitivityRun::new(&system, &by, Method::Rkmk8, grid).from(black_box(&start)))
        });
        let (knee, still) = ([0.0, 0.0, 0.0, 0.0, 1.0], [0.0; 5]);
        let cost = EndCost { by_motion: &knee, by_velocity: &still, by_event_times: &[] };
        group.bench_function(format!("adjoint/{n}"), |b| {
            b.iter(|| {
                let run = SensitivityRun::new(&system, &by, Method::Rkmk8, grid);
                let mut recorded = run.recorded_from(black_box(&start)).expect("a hop");
                recorded.gradient(&cost, None, &mut |_| Flow::Continue)
            })
        });
    }
    group.finish();
}

/// A body of 60 kg on a spring leg with a foot of 1 g: three stances in 1.5 s.
fn light_foot(c: &mut Criterion) {
    let point = |mass| MassProperties::point(mass, Vector3::zeros());
    let [up, down] = [Vector3::z(), -Vector3::z()].map(|axis| Joint::Prismatic { axis });
    let mut builder = Model::builder();
    builder.add(Link::root("body", up, point(60.0))).expect("a body");
    let foot = Link::child("foot", "body", down, point(1e-3)).at(-Vector3::z() * 0.5);
    builder.add(foot.with_damping(100.0)).expect("a foot");
    let model = builder.build().expect("a leg");
    let law = CompliantLaw::try_new(1e5, 60.0).expect("a spring and a damper");
    let sole = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).expect("a contact");
    let spring = |_: f64, q: &[f64], _: &[f64], force: &mut [f64]| force[1] -= 2e4 * q[1];
    let tree = TreeSystem::new(&model, spring);
    let system = TreeInContact::try_new(tree, vec![LinkContact::new("sole", "foot", sole)], vec![]);
    let system = system.expect("a leg on the ground");
    let start = system.unstretched(model.state(&[0.55, 0.0], &[0.3, 0.0]).expect("a state of the leg"));
    let run = |method, steps: Steps| {
        Run::new(&system, method, steps).locating(Location::default()).from(black_box(&start))
    };
    let mut group = c.benchmark_group("light_foot");
    for method in [Method::Rkmk5, Method::Rkmk8, Method::Radau5] {
        for tolerance in [1e-4, 1e-6] {
            let steps = Steps::adapted((0.0, 1.5), Adaptive::with_tolerances(tolerance, tolerance));
            group.bench_function(format!("{method}_adaptive_{tolerance:e}"), |b| {
                b.iter(|| run(method, steps))
            });
        }
    }
    let grid = TimeGrid::try_new(0.0, 1.5, 4e-3).expect("a forward interval");
    group.bench_function("radau5_4ms", |b| b.iter(|| run(Method::Radau5, grid.into())));
    group.finish();
}

criterion_group! {
    name = contact;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(600));
    targets = steps, one_second, box_with_regularised_friction, contacts_of_a_tree, light_foot, gradient_of_a_hop
}
criterion_main!(contact);
