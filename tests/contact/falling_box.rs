//! The box dropped on a corner or an edge, boxes thrown at random, and a rod that jams.

use nalgebra::{UnitQuaternion, Vector3};
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::laws::ContactLaw;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::coulomb::CoulombFriction;
use somersault_contact::laws::regularised::RegularisedFriction;
use somersault_contact::models::FallingBox;
use somersault_contact::stretches::WithStretches;
use somersault_contact::surface::HalfSpace;
use somersault_core::lie::so3;
use somersault_integrators::augmented::Augmented;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Flow, Observer, Step, TimeGrid};
use somersault_integrators::events::{Frozen, Located, Location};
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::{
    Dop853, DormandPrince, Method, RungeKuttaMuntheKaas, RungeKuttaMuntheKaas4,
};
use somersault_integrators::run::Run;
use somersault_integrators::state::{Pose, RigidBodyState, State};
use somersault_integrators::stepper::Stepper;
use somersault_testkit::order::slope;
use somersault_testkit::planar_box::PlanarBox;
use somersault_testkit::trees::Random;
use std::sync::Arc;

type System = BodyInContact<Gravity>;

const GRAVITY: f64 = 9.81;

fn run<M: for<'a> Stepper<Frozen<'a, System>>>(
    stepper: &M,
    system: &System,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
) -> Located<Pose, EventKind> {
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    Run::by_stepper(system, stepper, grid).locating(Location::as_given()).from(start).unwrap()
}

fn kinds(run: &Located<Pose, EventKind>) -> Vec<EventKind> {
    run.events.iter().map(|e| e.kind).collect()
}

/// Position, orientation, velocity and angular velocity taken together.
fn distance(a: &RigidBodyState, b: &RigidBodyState) -> f64 {
    ((a.position() - b.position()).norm_squared()
        + so3::angle_between(a.orientation(), b.orientation()).powi(2)
        + (a.velocity() - b.velocity()).norm_squared()
        + (a.angular_velocity() - b.angular_velocity()).norm_squared())
    .sqrt()
}

/// Kinetic energy, weight and the springs of the normal laws.
fn energy(system: &System, x: &RigidBodyState) -> f64 {
    let weight = -system.body.mass() * system.forces.0.acceleration.dot(x.position());
    system.body.kinetic_energy(x) + weight + system.forces.1.energy(x)
}

const LENGTHS: Vector3<f64> = Vector3::new(0.3, 0.2, 0.12);

fn corner_law() -> CompliantLaw {
    CompliantLaw::try_new(1500.0, 8.0).unwrap()
}

fn smooth_box() -> FallingBox {
    let friction = RegularisedFriction::try_new(0.3, 0.1).unwrap();
    FallingBox::try_new(1.0, LENGTHS, ContactLaw::from(corner_law()).with_friction(friction)).unwrap()
}

#[test]
fn a_box_dropped_on_a_corner_keeps_the_order_through_its_events() {
    const END: f64 = 0.6;
    let model = smooth_box();
    let mut start = model.on_corner(0.05, 0.3);
    start.rate.angular = Vector3::new(0.6, -0.4, 0.9);
    let exact = run(&RungeKuttaMuntheKaas(Dop853), &model.system, &start, END, 1e-4);
    println!("{:?}", kinds(&exact));
    assert!(exact.events.len() >= 8 && exact.events.iter().any(|e| e.guard != 0));
    let slope_of = |error: &dyn Fn(f64) -> f64, sizes: &[u32]| {
        let points: Vec<_> = sizes.iter().map(|&n| (END / f64::from(n), error(END / f64::from(n)))).collect();
        println!("{points:?}");
        slope(&points)
    };
    let four = |h| {
        let found = run(&RungeKuttaMuntheKaas4, &model.system, &start, END, h);
        assert_eq!(kinds(&found), kinds(&exact));
        distance(&found.state, &exact.state)
    };
    let five = |h| {
        let stepper = RungeKuttaMuntheKaas(DormandPrince);
        distance(&run(&stepper, &model.system, &start, END, h).state, &exact.state)
    };
    let order = slope_of(&four, &[400, 800, 1600, 3200]);
    assert!((order - 4.0).abs() < 0.4, "{order}");
    let order = slope_of(&five, &[300, 600, 1200, 2400]);
    // The leading error is small beside the next ones at these step sizes.
    assert!(order > 4.7, "{order}");
}

#[test]
fn every_method_that_takes_torque_has_at_least_its_order_on_the_box_dropped_on_a_corner() {
    const END: f64 = 0.3;
    let model = smooth_box();
    let mut start = model.on_corner(0.02, 0.3);
    start.rate.angular = Vector3::new(0.6, -0.4, 0.9);
    let exact = run(&RungeKuttaMuntheKaas(Dop853), &model.system, &start, END, 1e-4);
    assert!(exact.events.len() >= 4, "{:?}", kinds(&exact));
    // A run whose events are others, or whose implicit step is too large, does not count.
    let error = |method: Method, n: u32| {
        let grid = TimeGrid::try_with_steps(0.0, END, n.into()).unwrap();
        Run::new(&model.system, method, grid)
            .locating(Location::as_given())
            .from(&start)
            .ok()
            .filter(|found| kinds(found) == kinds(&exact))
            .map_or(f64::NAN, |found| distance(&found.state, &exact.state))
    };
    for method in Method::ALL.into_iter().filter(|m| m.info().takes_any_forces()) {
        let orders = method.info().orders;
        let order = orders.translation_with_velocity.min(orders.rotation_with_torque.unwrap_or(0));
        let (sizes, floor) = match order {
            6.. => ([24, 32, 40, 48, 56, 64], 1e-12),
            5 => ([40, 80, 160, 320, 640, 1280], 1e-11),
            3.. => ([150, 300, 600, 1200, 2400, 4800], 1e-11),
            _ => ([300, 600, 1200, 2400, 4800, 9600], 1e-11),
        };
        let points: Vec<(f64, f64)> = sizes
            .into_iter()
            .map(|base| {
                let sum: f64 = (0..4).map(|i| error(method, base + base * i / 8).powi(2)).sum();
                (END / f64::from(base), (0.25 * sum).sqrt())
            })
            .filter(|(_, error)| *error > floor)
            .collect();
        let last = &points[points.len().saturating_sub(3)..];
        let found = slope(last);
        println!(
            "{method:10} order {order} found {found:.2} {:.1e} {}",
            last.last().unwrap().1,
            points.len()
        );
        assert!(points.len() >= 3 && found > f64::from(order) - 0.3, "{method}: {found} {points:?}");
    }
}

#[test]
fn without_location_the_box_falls_to_first_order() {
    const END: f64 = 0.3;
    let model = smooth_box();
    let mut start = model.on_corner(0.02, 0.3);
    start.rate.angular = Vector3::new(0.6, -0.4, 0.9);
    let exact = run(&RungeKuttaMuntheKaas(Dop853), &model.system, &start, END, 1e-4).state;
    // Where steps fall relative to the switches matters: the mean over many sizes tells the order.
    let points: Vec<_> = [1000u64, 2000, 4000, 8000]
        .into_iter()
        .map(|base| {
            let error = |i| {
                let grid = TimeGrid::try_with_steps(0.0, END, base + base * i / 48).unwrap();
                let end = Run::by_stepper(&&model.system, &RungeKuttaMuntheKaas4, grid).from(&start).unwrap();
                distance(&end.state, &exact).powi(2)
            };
            (END / base as f64, ((0..48).map(error).sum::<f64>() / 48.0).sqrt())
        })
        .collect();
    println!("{:.2} {points:?}", slope(&points));
    assert!((slope(&points) - 1.0).abs() < 0.25, "{} {points:?}", slope(&points));
}

fn held_run<'a, M: for<'b> Stepper<Frozen<'b, WithStretches<&'a System>>>>(
    stepper: &M,
    system: &'a System,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
) -> Located<Augmented<Pose>, EventKind> {
    let with = WithStretches(system);
    let start = with.unstretched(*start);
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    Run::by_stepper(&with, stepper, grid).locating(Location::default()).from(&start).unwrap()
}

fn kinds_of(run: &Located<Augmented<Pose>, EventKind>) -> Vec<EventKind> {
    run.events.iter().map(|e| e.kind).collect()
}

#[test]
fn sticking_and_slipping_on_an_edge_keep_the_order() {
    // In a plane all sliding is straight.
    const END: f64 = 0.5;
    let friction = CoulombFriction::try_new(0.3, 1500.0, 40.0).unwrap();
    let law = ContactLaw::from(corner_law()).with_friction(friction);
    let model = FallingBox::try_new(1.0, LENGTHS, law).unwrap();
    let start = RigidBodyState::new(
        Vector3::new(0.0, 0.0, 0.2),
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.5),
        Vector3::new(0.4, 0.0, 0.0),
        Vector3::new(0.0, -1.0, 0.0),
    );
    let exact = held_run(&RungeKuttaMuntheKaas(Dop853), &model.system, &start, END, 2e-5);
    println!("{:?}", kinds_of(&exact));
    // The shortest switches last a millisecond: steps that lose some are too long.
    let points: Vec<_> = [1000, 2000, 4000, 8000, 16000]
        .into_iter()
        .filter_map(|n| {
            let h = END / f64::from(n);
            let found = held_run(&RungeKuttaMuntheKaas4, &model.system, &start, END, h);
            let error = distance(&found.state.base(), &exact.state.base());
            (found.events.len() == exact.events.len()).then_some((h, error))
        })
        .collect();
    assert!(points.len() > 2, "{points:?}");
    println!("{points:?}");
    assert!(kinds_of(&exact).contains(&EventKind::Stick) && kinds_of(&exact).contains(&EventKind::Slip));
    assert!((slope(&points) - 4.0).abs() < 0.4, "{} {points:?}", slope(&points));
}

#[test]
fn a_box_dropped_on_an_edge_agrees_with_three_coordinates() {
    let model = smooth_box();
    let moment = (LENGTHS.x * LENGTHS.x + LENGTHS.z * LENGTHS.z) / 12.0;
    let planar = PlanarBox {
        mass: 1.0,
        moment,
        half: [0.5 * LENGTHS.x, 0.5 * LENGTHS.z],
        stiffness: 1500.0,
        damping: 8.0,
        friction: 0.3,
        speed: 0.1,
        gravity: GRAVITY,
    };
    let (angle, height) = (0.5, 0.25);
    let (exact, switches) = planar.run([0.0, height, angle, 0.4, 0.0, -1.0], 0.8, 1e-5);
    let start = RigidBodyState::new(
        Vector3::new(0.0, 0.0, height),
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle),
        Vector3::new(0.4, 0.0, 0.0),
        Vector3::new(0.0, -1.0, 0.0),
    );
    let found = run(&RungeKuttaMuntheKaas4, &model.system, &start, 0.8, 5e-5);
    let x = &found.state;
    let turned = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), exact[2]);
    let errors = [
        (x.position() - Vector3::new(exact[0], 0.0, exact[1])).norm(),
        so3::angle_between(x.orientation(), &turned),
        (x.velocity() - Vector3::new(exact[3], 0.0, exact[4])).norm(),
        (x.angular_velocity() - Vector3::new(0.0, exact[5], 0.0)).norm(),
    ];
    println!("{errors:?}, {} switches", switches.len());
    assert!(errors.iter().all(|e| *e < 1e-9), "{errors:?}");
    // Two corners of the box switch with each corner of the rectangle.
    assert!(
        switches.len() >= 6 && found.events.len() == 2 * switches.len(),
        "{} {}",
        switches.len(),
        found.events.len()
    );
    for (pair, t) in found.events.chunks(2).zip(&switches) {
        assert!(pair.iter().all(|e| (e.t - t).abs() < 1e-9), "{t} {pair:?}");
    }
}

/// Watches the energy, that of sticking springs included.
struct FullEnergy<'a> {
    system: WithStretches<&'a System>,
    growth: f64,
}

impl FullEnergy<'_> {
    fn of(&self, x: &State<Augmented<Pose>>) -> f64 {
        let (system, base) = (self.system.0, x.base());
        energy(system, &base) - system.forces.1.energy(&base) + self.system.energy(x)
    }
}

impl Observer<Augmented<Pose>> for FullEnergy<'_> {
    fn observe(&mut self, step: &mut Step<'_, Augmented<Pose>>) -> Flow {
        self.growth = self.growth.max(self.of(step.after) - self.of(step.before));
        Flow::Continue
    }
}

#[test]
fn the_energy_of_the_box_never_grows_and_it_comes_to_rest() {
    let friction = CoulombFriction::try_new(0.4, 1500.0, 40.0).unwrap();
    let law = ContactLaw::from(corner_law()).with_friction(friction);
    let sticking = FallingBox::try_new(1.0, LENGTHS, law).unwrap();
    for model in [smooth_box(), sticking] {
        let mut start = model.on_corner(0.05, 0.3);
        start.rate.angular = Vector3::new(0.6, -0.4, 0.9);
        let run = watched(&model.system, &start, 8.0, 5e-4);
        let (end, growth) = (run.0.state.base(), run.1);
        println!("{} events, growth {growth:e}, {:?}", run.0.event_count, end.rate);
        assert!(growth < 1e-13, "{growth:e}");
        assert!(end.velocity().norm() < 1e-2 && end.angular_velocity().norm() < 1e-2);
        assert!(energy(&model.system, &end) < energy(&model.system, &start) - 0.1);
    }
}

/// Runs a system from a start; the most that the energy grew in a step.
fn watched(
    system: &System,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
) -> (Located<Augmented<Pose>, EventKind>, f64) {
    let with = WithStretches(system);
    let start = with.unstretched(*start);
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    let mut watch = FullEnergy { system: with, growth: 0.0 };
    let run = Run::by_stepper(&with, &RungeKuttaMuntheKaas4, grid).locating(Location::default());
    let run = run.observed_by(&mut watch).from(&start).unwrap();
    (run, watch.growth)
}

#[test]
fn boxes_thrown_at_random_neither_chatter_nor_gain_energy() {
    let mut random = Random::new(11);
    let coulomb = CoulombFriction::try_new(0.5, 1500.0, 20.0).unwrap();
    let creep = CoulombFriction::try_new(0.5, 0.0, 20.0).unwrap();
    let law = ContactLaw::from(corner_law());
    for case in 0..20 {
        let friction = if case % 2 == 0 { coulomb } else { creep };
        let law = law.clone().with_friction(friction);
        let model = FallingBox::try_new(1.0, LENGTHS, law).unwrap();
        let start = RigidBodyState::new(
            Vector3::new(0.0, 0.0, 0.3),
            UnitQuaternion::new(random.vector(3.0)),
            random.vector(2.0),
            random.vector(10.0),
        );
        let (run, growth) = watched(&model.system, &start, 2.0, 5e-4);
        let events = run.event_count;
        println!("case {case}: {events} events, growth {growth:e}");
        assert!(events < 400 && growth < 1e-12, "case {case}: {events} events, {growth:e}, {start:?}");
    }
}

#[test]
fn a_rod_that_jams_on_rough_ground_is_no_paradox() {
    // Painlevé's rod at the angle θ to the ground, pushed tip first: where 1 + 3 cos θ (cos θ − μ sin θ) < 0, as
    // here, rigid bodies have no motion or several. Compliant ones have one.
    let rod = RigidBody::try_principal(1.0, Vector3::new(1.0 / 12.0, 1.0 / 12.0, 1e-4)).unwrap();
    let friction = CoulombFriction::try_new(2.5, 2e4, 50.0).unwrap();
    let law = ContactLaw::from(CompliantLaw::try_new(2e4, 50.0).unwrap()).with_friction(friction);
    let ground = Arc::new(HalfSpace::ground());
    let tip = Contact::try_new(Vector3::new(0.0, 0.0, -0.5), ground, law).unwrap();
    let system = BodyInContact::new(rod, (Gravity::earth(), Contacts::new(vec![tip])));
    let lean = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -0.55);
    let height = 0.5 * 0.55f64.cos();
    let start = RigidBodyState::new(
        Vector3::new(0.0, 0.0, height),
        lean,
        Vector3::new(1.5, 0.0, 0.0),
        Vector3::zeros(),
    );
    let (run, growth) = watched(&system, &start, 0.15, 2e-5);
    let events = run.event_count;
    println!("{events} events, growth {growth:e}");
    assert!(events > 1 && growth < 1e-12, "{events} {growth:e}");
}
