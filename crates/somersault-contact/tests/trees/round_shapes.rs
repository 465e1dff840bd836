//! Capsules, edges and boxes on spheres and cylinders, and against each other.

use crate::gradients::{differentiate, error_by_state};
use crate::{Torques, passive};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_contact::contacts::Contact;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::sensitivity::{Differentiation, SensitivityError, SensitivityRun};
use somersault_contact::surface::{CylindricalSurface, HalfSpace, Solid, SphericalSurface, Surface};
use somersault_contact::tree::{LinkContact, LinkPair, TreeInContact, shape_contacts};
use somersault_integrators::driver::{Adaptive, Steps, TimeGrid};
use somersault_integrators::events::Location;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_multibody::geometry::GeometryShape;
use somersault_multibody::motion::TreeSystem;
use somersault_multibody::{Joint, Link, MassProperties, Model};
use std::sync::Arc;

const CAPSULE: GeometryShape = GeometryShape::Capsule { radius: 0.06, length: 0.5 };
const BALL: GeometryShape = GeometryShape::Sphere { radius: 0.1 };
const BOX: GeometryShape = GeometryShape::Box { size: Vector3::new(0.3, 0.2, 0.5) };

fn some(k: usize, axis: usize) -> f64 {
    f64::sin(37.0 * k as f64 + 5.0 * axis as f64)
}

fn vector(k: usize) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| some(k, axis))
}

/// Two free bodies on a stand, without weight.
fn bodies() -> Model {
    let solid = |mass, moments: [f64; 3]| MassProperties {
        mass,
        center: Vector3::zeros(),
        inertia: Matrix3::from_diagonal(&Vector3::from(moments)),
    };
    let mut builder = Model::builder().with_gravity(Vector3::zeros());
    builder.add(Link::root("stand", Joint::Fixed, solid(1.0, [1.0; 3]))).unwrap();
    builder.add(Link::child("a", "stand", Joint::Free, solid(1.2, [0.03, 0.04, 0.02]))).unwrap();
    builder.add(Link::child("b", "stand", Joint::Free, solid(0.8, [0.02, 0.015, 0.025]))).unwrap();
    builder.build().unwrap()
}

fn law(damping: f64) -> ContactLaw {
    let friction = CoulombFriction::try_new(0.4, 4e3, 20.0).unwrap();
    ContactLaw::from(CompliantLaw::try_new(5e3, damping).unwrap()).with_friction(friction)
}

/// Where body a is turned and placed, b beside it, and how both move.
fn state(k: usize, apart: f64) -> ([f64; 14], [f64; 12]) {
    let (mut q, mut v) = ([0.0; 14], [0.0; 12]);
    let way = vector(3 * k + 1).normalize() * apart;
    for (body, place) in [way * 0.5, way * -0.5].into_iter().enumerate() {
        let turn = UnitQuaternion::new(vector(7 * k + body + 2) * 2.0);
        q[7 * body..7 * body + 3].copy_from_slice(place.as_slice());
        q[7 * body + 3..7 * body + 7].copy_from_slice(turn.coords.as_slice());
    }
    for (i, v) in v.iter_mut().enumerate() {
        *v = some(11 * k + 5, i);
    }
    (q, v)
}

/// Points of a shape about its core, at ends of its edges and within.
fn samples(shape: &GeometryShape) -> (Vec<Vector3<f64>>, f64) {
    let grid = |n: usize| (0..=n).map(move |i| 2.0 * i as f64 / n as f64 - 1.0);
    match shape {
        GeometryShape::Capsule { radius, length } => {
            (grid(2000).map(|z| Vector3::z() * (0.5 * length * z)).collect(), *radius)
        }
        GeometryShape::Sphere { radius } => (vec![Vector3::zeros()], *radius),
        GeometryShape::Box { size } => {
            let half = size * 0.5;
            let faces = (0..3).flat_map(|axis| [-1.0, 1.0].map(move |side| (axis, side)));
            let face = move |(axis, side): (usize, f64)| {
                grid(80).flat_map(move |x| {
                    grid(80).map(move |y| {
                        let mut place = Vector3::zeros();
                        place[axis] = side * half[axis];
                        place[(axis + 1) % 3] = x * half[(axis + 1) % 3];
                        place[(axis + 2) % 3] = y * half[(axis + 2) % 3];
                        place
                    })
                })
            };
            (faces.flat_map(face).collect(), 0.0)
        }
        other => panic!("{other:?}"),
    }
}

fn pose(q: &[f64], body: usize) -> (Vector3<f64>, UnitQuaternion<f64>) {
    let q = &q[7 * body..7 * body + 7];
    let quaternion = nalgebra::Quaternion::new(q[6], q[3], q[4], q[5]);
    (Vector3::new(q[0], q[1], q[2]), UnitQuaternion::from_quaternion(quaternion))
}

/// q moved along v for a time.
fn later(model: &Model, q: &[f64], v: &[f64], time: f64) -> Vec<f64> {
    let step: Vec<f64> = v.iter().map(|v| v * time).collect();
    let mut out = q.to_vec();
    model.displace(q, &step, &mut out).unwrap();
    out
}

/// Gap of a contact against the smallest distance of all points of a shape, and its rate against differences along the motion.
fn check(system: &TreeInContact<'_, Torques>, q: &[f64], v: &[f64], least: f64, within: f64) {
    let model = system.model();
    let at = |q: &[f64]| system.touches(&system.unstretched(model.state(q, v).unwrap()))[0];
    let touch = at(q);
    assert!(least >= touch.gap - 1e-12 && least - touch.gap < within, "{least} {}", touch.gap);
    let [after, before] = [1e-6, -1e-6].map(|time| at(&later(model, q, v, time)));
    let rate = (after.gap - before.gap) / 2e-6;
    assert!((rate - touch.rate).abs() < 1e-8, "{rate} {}", touch.rate);
}

#[test]
fn gaps_over_round_surfaces_are_those_of_the_nearest_points() {
    let model = bodies();
    let ball = SphericalSurface::try_new(Vector3::zeros(), 0.3, Solid::Inside).unwrap();
    let axis = Vector3::new(1.0, 0.3, -0.2);
    let log = CylindricalSurface::try_new(Vector3::zeros(), axis, 0.3, Solid::Inside).unwrap();
    let surfaces: [Arc<dyn Surface>; 2] = [Arc::new(ball), Arc::new(log)];
    let mut count = 0;
    for (s, surface) in surfaces.iter().enumerate() {
        for shape in [&CAPSULE, &BOX] {
            let place = (Vector3::new(0.03, -0.02, 0.05), UnitQuaternion::new(Vector3::new(0.2, 0.5, -0.3)));
            let touches = shape_contacts("a", "a", shape, place, surface, &law(10.0)).unwrap();
            let names: Vec<&str> = touches.iter().map(LinkContact::name).collect();
            match (shape, s) {
                (GeometryShape::Box { .. }, 1) => {
                    assert_eq!((names.len(), names[0], names[11]), (12, "a edge 1", "a edge 12"));
                }
                _ => assert_eq!(names, ["a"]),
            }
            let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), touches, vec![]).unwrap();
            let (points, radius) = samples(shape);
            for k in 0..12 {
                let (q, v) = state(k, 1.3);
                let (origin, turn) = pose(&q, 0);
                let gaps = points.iter().map(|p| {
                    surface.signed_distance(&(origin + turn * (place.0 + place.1 * p))).distance - radius
                });
                let least = gaps.fold(f64::INFINITY, f64::min);
                let x = system.unstretched(model.state(&q, &v).unwrap());
                let found =
                    system.touches(&x).iter().fold(f64::INFINITY, |least, touch| least.min(touch.gap));
                assert!(least >= found - 1e-12 && least - found < 1e-4, "{s} {shape:?} {k}: {least} {found}");
                if system.contacts().len() == 1 {
                    check(&system, &q, &v, least, 1e-4);
                    count += 1;
                }
            }
        }
    }
    assert_eq!(count, 36);
}

fn pair(shapes: [&GeometryShape; 2], law: ContactLaw) -> LinkPair {
    let place = (Vector3::new(0.02, 0.0, -0.03), UnitQuaternion::new(Vector3::new(0.0, 0.4, 0.2)));
    LinkPair::of_shapes("pair", ["a", "b"], shapes.map(|shape| (shape, place)), law).unwrap()
}

#[test]
fn gaps_of_pairs_are_those_of_their_nearest_points() {
    let model = bodies();
    for shapes in [[&BALL, &CAPSULE], [&CAPSULE, &BALL], [&BALL, &BOX], [&CAPSULE, &CAPSULE]] {
        let touches = vec![pair(shapes, law(10.0))];
        let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), vec![], touches).unwrap();
        let place = (Vector3::new(0.02, 0.0, -0.03), UnitQuaternion::new(Vector3::new(0.0, 0.4, 0.2)));
        for k in 0..8 {
            let (q, v) = state(k, 0.9);
            let [(a, radius_a), (b, radius_b)] = [0, 1].map(|i| {
                let ((origin, turn), (points, radius)) = (pose(&q, i), samples(shapes[i]));
                let every = if points.len() > 2000 && i == 0 { 40 } else { 1 };
                let points = points.into_iter().step_by(every);
                (points.map(|p| origin + turn * (place.0 + place.1 * p)).collect::<Vec<_>>(), radius)
            });
            let least = a.iter().fold(f64::INFINITY, |least, p| {
                b.iter().fold(least, |least, other| least.min((p - other).norm()))
            });
            check(&system, &q, &v, least - radius_a - radius_b, 2e-3);
        }
    }
}

/// Without losses a pair keeps its energy, and momentum always: the force is the gradient of the spring along the gap.
#[test]
fn pairs_keep_momentum_and_energy() {
    let model = bodies();
    for (k, shapes) in [[&BALL, &CAPSULE], [&BOX, &BALL], [&CAPSULE, &CAPSULE]].into_iter().enumerate() {
        let spring = ContactLaw::from(CompliantLaw::try_new(5e3, 0.0).unwrap());
        for (law, is_kept) in [(spring, true), (law(10.0), false)] {
            let touches = vec![pair(shapes, law)];
            let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), vec![], touches).unwrap();
            let (q, _) = state(k + 1, 0.8);
            let ((a, turn_a), (b, turn_b)) = (pose(&q, 0), pose(&q, 1));
            let way = (b - a).normalize();
            let v: Vec<f64> = [turn_a.inverse() * way * 2.0, Vector3::new(1.0, -2.0, 0.5)]
                .into_iter()
                .chain([turn_b.inverse() * way * -2.0, Vector3::new(-1.0, 0.5, 2.0)])
                .flat_map(<[f64; 3]>::from)
                .collect();
            let start = system.unstretched(model.state(&q, &v).unwrap());
            let steps = Steps::adapted((0.0, 0.6), Adaptive::with_tolerances(1e-11, 1e-11));
            let run =
                Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start).unwrap();
            assert!(run.event_count >= 2, "{k}: {}", run.event_count);
            let [before, after] = [&start, &run.state].map(|x| system.momentum(x).unwrap());
            assert!((after.linear - before.linear).norm() < 1e-9, "{k}");
            assert!((after.angular - before.angular).norm() < 1e-9, "{k}");
            let [before, after] = [&start, &run.state].map(|x| system.ledger(x).total());
            let lost = before - after;
            println!("{k} {lost:e} of {before}");
            assert!(if is_kept { lost.abs() < 1e-7 } else { lost > 1e-3 }, "{k}: {lost}");
        }
    }
}

/// A capsule falls on a ball and a log with friction, whose stretch turns with the plane of contact, and hits a capsule.
#[test]
fn derivatives_with_capsules_are_differences_of_runs() {
    let model = bodies();
    let ball = SphericalSurface::try_new(Vector3::new(0.0, 0.3, -0.6), 0.3, Solid::Inside).unwrap();
    let axis = Vector3::new(0.1, 1.0, 0.0);
    let log = CylindricalSurface::try_new(Vector3::new(0.0, 0.0, -0.65), axis, 0.3, Solid::Inside).unwrap();
    let along = [Vector3::x() * -0.4, Vector3::x() * 0.4];
    let touch = |name: &str, link: &str, surface: Arc<dyn Surface>| {
        let contact = Contact::try_capsule(along, 0.05, surface, law(10.0)).unwrap();
        LinkContact::new(name, link, contact)
    };
    let touches = vec![touch("log", "a", Arc::new(log)), touch("ball", "b", Arc::new(ball))];
    let rod = GeometryShape::Capsule { radius: 0.05, length: 0.8 };
    let turn = UnitQuaternion::new(Vector3::y() * std::f64::consts::FRAC_PI_2);
    let shapes = [(&rod, (Vector3::zeros(), turn)); 2];
    let pair = LinkPair::of_shapes("rods", ["a", "b"], shapes, law(10.0)).unwrap();
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), touches, vec![pair]).unwrap();
    let q = [[0.05, 0.0, -0.2, 0.0, 0.05, 0.0, 1.0], [0.1, 0.35, -0.15, 0.02, 0.0, 0.4, 1.0]].concat();
    let v = [[0.3, 0.6, -1.5, 0.4, -0.3, 0.2], [-0.2, -0.9, -1.2, 0.3, 0.5, -0.4]].concat();
    let mut q = q;
    model.normalize(&mut q).unwrap();
    let start = model.state(&q, &v).unwrap();
    let grid = TimeGrid::try_new(0.0, 0.28, 1e-3).unwrap();
    let found = differentiate(&system, &start, [], grid);
    let touched: Vec<_> = found.run.events.iter().map(|event| event.guard % 3).collect();
    assert!((0..3).all(|i| touched.contains(&i)), "{touched:?}");
    let worst = error_by_state(&system, &start, &found, grid);
    println!("{worst:e}, {} events", touched.len());
    assert!(worst < 1e-6, "{worst:e}");
}

/// A rod slides over a ball to its end: with friction there the rate of the stretch jumps, and the run has no derivative.
#[test]
fn a_nearest_point_that_reaches_an_end_under_friction_has_no_derivative() {
    let model = bodies();
    let ball: Arc<dyn Surface> =
        Arc::new(SphericalSurface::try_new(Vector3::new(0.385, 0.0, -0.34), 0.3, Solid::Inside).unwrap());
    let along = [Vector3::x() * -0.4, Vector3::x() * 0.4];
    let (mut q, mut v) = ([0.0; 14], [0.0; 12]);
    (q[6], q[13], q[7]) = (1.0, 1.0, 9.0);
    v[0] = -3.0;
    let start = model.state(&q, &v).unwrap();
    let grid = TimeGrid::try_new(0.0, 0.03, 1e-3).unwrap();
    let with = |law: ContactLaw| {
        let rod = Contact::try_capsule(along, 0.05, ball.clone(), law).unwrap();
        let rod = LinkContact::new("rod", "a", rod);
        TreeInContact::try_new(TreeSystem::new(&model, passive()), vec![rod], vec![]).unwrap()
    };
    let smooth = with(CompliantLaw::try_new(5e3, 10.0).unwrap().into());
    let found = differentiate(&smooth, &start, [], grid);
    assert!(error_by_state(&smooth, &start, &found, grid) < 1e-6);

    let (system, by) = (with(law(10.0)), Differentiation::default());
    let run = || SensitivityRun::new(&system, &by, Method::Rkmk8, grid);
    // without friction the end is reached after 5 ms
    let is_there = |reason: &SensitivityError| matches!(reason, SensitivityError::Feature { contact: 0, t } if (0.005..0.0075).contains(t));
    let refused = run().from(&start).unwrap_err();
    assert!(is_there(&refused.reason), "{refused}");
    assert_eq!(refused.so_far.run.t, 0.03);
    assert!(refused.so_far.state.iter().all(|x| x.is_finite()));
    let recorded = run().recorded_from(&start).unwrap_err();
    assert!(is_there(&recorded.reason) && recorded.so_far.is_some(), "{}", recorded.reason);
}

/// A plank that lies across a log does not fall through it, though no corner is near.
#[test]
fn a_plank_rests_on_a_log() {
    let mut builder = Model::builder();
    let inertia = Matrix3::from_diagonal(&Vector3::new(0.03, 0.35, 0.37));
    let plank = MassProperties { mass: 4.0, center: Vector3::zeros(), inertia };
    builder.add(Link::root("plank", Joint::Free, plank)).unwrap();
    let model = builder.build().unwrap();
    let log = CylindricalSurface::try_new(Vector3::zeros(), Vector3::y(), 0.2, Solid::Inside).unwrap();
    let shape = GeometryShape::Box { size: Vector3::new(1.0, 0.2, 0.04) };
    let place = (Vector3::zeros(), UnitQuaternion::identity());
    let surface: Arc<dyn Surface> = Arc::new(log);
    let touches = shape_contacts("plank", "plank", &shape, place, &surface, &law(60.0)).unwrap();
    let system = TreeInContact::try_new(TreeSystem::new(&model, passive()), touches, vec![]).unwrap();
    let start = model.state(&[0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0], &[0.0; 6]).unwrap();
    let steps = Steps::adapted((0.0, 0.5), Adaptive::with_tolerances(1e-8, 1e-8));
    let start = system.unstretched(start);
    let run = Run::new(&system, Method::Rkmk8, steps).locating(Location::default()).from(&start).unwrap();
    let height = run.state.configuration.0.as_slice()[2];
    let closed = system.touches(&run.state).iter().filter(|touch| touch.gap < 0.0).count();
    assert!((height - 0.22).abs() < 8e-3 && closed == 2, "{height} {closed}");
}

#[test]
fn shapes_that_do_not_touch_smoothly_are_refused() {
    let ground: Arc<dyn Surface> = Arc::new(HalfSpace::ground());
    let ends = [Vector3::zeros(), Vector3::x()];
    let flat = Contact::try_capsule(ends, 0.1, ground.clone(), law(1.0)).unwrap_err().to_string();
    assert!(flat.contains("a capsule touches spheres and cylinders from outside"), "{flat}");
    let place = (Vector3::zeros(), UnitQuaternion::identity());
    let size = Vector3::repeat(0.1);
    let flat = Contact::try_box(size, place, ground, law(1.0)).unwrap_err().to_string();
    assert!(flat.contains("a box touches spheres from outside"), "{flat}");
    let point =
        Contact::try_capsule([Vector3::x(), Vector3::x()], 0.1, Arc::new(HalfSpace::ground()), law(1.0));
    assert_eq!(
        point.unwrap_err().to_string(),
        "`ends` must be two points with a finite distance other than zero, found 0"
    );
    for shape in [&CAPSULE, &GeometryShape::Cylinder { radius: 0.1, length: 0.5 }] {
        let pair = LinkPair::of_shapes("pair", ["a", "b"], [(&BOX, place), (shape, place)], law(1.0));
        assert!(pair.unwrap_err().to_string().starts_with("a pair must be of a ball with"));
    }
}
