//! Laws that a user defines: a hardening spring with a damper, viscous friction and a yielding bristle, held against
//! an integration of their own, exact decays, the library's laws and differences of located runs.

use crate::located_differences::{RKMK8, agrees_with_differences, differentiate};
use nalgebra::Vector3;
use somersault_contact::bodies::{BodiesInContact, BodyContacts, BodySphere, SpherePair};
use somersault_contact::contacts::{BodyInContact, Contact, Contacts};
use somersault_contact::event::EventKind;
use somersault_contact::laws::compliant::CompliantLaw;
use somersault_contact::laws::{
    ContactLaw, FrictionChange, FrictionDerivative, FrictionInput, FrictionLaw, FrictionResponse,
    FrictionSpring, NormalChange, NormalDerivative, NormalLaw, Stiffest, StiffestFriction,
};
use somersault_contact::sensitivity::{Parameter, SensitivityError};
use somersault_contact::stretches::WithStretches;
use somersault_contact::surface::HalfSpace;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::events::{Hybrid, Located, Location};
use somersault_integrators::force::Gravity;
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_integrators::state::{Pose, RigidBodyState, State, Twist};
use somersault_integrators::variation::Tangent;
use somersault_testkit::order::slope;
use std::sync::Arc;

const G: f64 = 9.81;
const MASS: f64 = 1.5;

/// Kelvin and Voigt's spring and damper with a quadratic term, F = k x + b x² − c Δẋ with the penetration x = −Δx.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Hardening {
    k: f64,
    b: f64,
    c: f64,
}

impl NormalLaw for Hardening {
    fn force_in_contact(&self, gap: f64, rate: f64) -> f64 {
        -self.k * gap + self.b * gap * gap - self.c * rate
    }

    /// The force is zero at Δẋ = (k + b x) x/c.
    fn lag(&self, gap: f64, _: f64) -> f64 {
        self.c / (self.k + self.b * gap.abs())
    }

    fn energy(&self, gap: f64) -> f64 {
        let x = (-gap).max(0.0);
        x * x * (self.k / 2.0 + self.b * x / 3.0)
    }

    fn stiffest(&self, gap: f64, rate: f64, mass: f64) -> Stiffest {
        let depth = (gap * gap + mass * rate * rate / self.k).sqrt();
        Stiffest {
            force: (self.k + self.b * depth) * depth + self.c * rate.abs(),
            stiffness: self.k + 2.0 * self.b * depth,
            damping: self.c,
        }
    }

    fn parameters(&self) -> &'static [&'static str] {
        &["k", "b", "c"]
    }

    fn derivative(&self, gap: f64, rate: f64, along: &NormalChange) -> Option<NormalDerivative> {
        let [k, b, c] = along.parameters();
        let force = (2.0 * self.b * gap - self.k) * along.gap - self.c * along.rate - k * gap + b * gap * gap
            - c * rate;
        let slope = self.k - self.b * gap;
        let lag = c / slope - self.c / (slope * slope) * (k - b * gap - self.b * along.gap);
        Some(NormalDerivative { force, lag })
    }
}

/// F = −η N v: with the impulse J of the normal force, v falls as exp(−η J/m).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Viscous {
    eta: f64,
}

impl FrictionLaw for Viscous {
    fn response(&self, by: &FrictionInput<'_>) -> FrictionResponse {
        let force = by.at.sliding * (-self.eta * by.normal_force);
        FrictionResponse { force, ..FrictionResponse::default() }
    }

    fn stiffest(&self, normal: &Stiffest) -> StiffestFriction {
        StiffestFriction { damping: self.eta * normal.force, ..StiffestFriction::default() }
    }

    fn parameters(&self) -> &'static [&'static str] {
        &["eta"]
    }

    fn derivative(&self, of: &FrictionInput<'_>, along: &FrictionChange<'_>) -> Option<FrictionDerivative> {
        let [eta] = along.parameters();
        let strength = self.eta * of.normal_force;
        let strength_change = eta * of.normal_force + self.eta * along.normal_force;
        let force = -of.at.sliding * strength_change - along.at.sliding * strength;
        Some(FrictionDerivative { force, ..FrictionDerivative::default() })
    }
}

/// Dahl's bristle, F = −k ξ with ξ̇ = v − ‖v‖ k ξ/(μ N), which has a stretch and no modes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bristle {
    mu: f64,
    k: f64,
}

impl FrictionLaw for Bristle {
    fn response(&self, by: &FrictionInput<'_>) -> FrictionResponse {
        let speed = by.at.sliding.norm();
        let stretch_rate = by.at.sliding - by.stretch * (speed * self.k / (self.mu * by.normal_force));
        FrictionResponse { force: by.stretch * -self.k, stretch_rate }
    }

    fn stiffest(&self, _: &Stiffest) -> StiffestFriction {
        StiffestFriction { stiffness: self.k, ..StiffestFriction::default() }
    }

    fn spring(&self, normal_force: f64) -> Option<FrictionSpring> {
        Some(FrictionSpring { stiffness: self.k, longest: self.mu * normal_force / self.k })
    }
}

/// A body whose centre touches the ground under some law, which does not turn it.
fn body_on_ground(law: impl Into<ContactLaw>, mass: f64) -> BodyInContact<Gravity> {
    let inertia = *RigidBody::try_box(MASS, Vector3::repeat(0.1)).unwrap().inertia();
    let body = RigidBody::try_new(mass, inertia).unwrap();
    let contact = Contact::try_new(Vector3::zeros(), Arc::new(HalfSpace::ground()), law).unwrap();
    BodyInContact::new(body, (Gravity::earth(), Contacts::new(vec![contact])))
}

fn at(z: f64, velocity: Vector3<f64>) -> RigidBodyState {
    let mut state = RigidBodyState::default();
    (state.configuration.position.z, state.rate.linear) = (z, velocity);
    state
}

fn run(
    method: Method,
    system: &BodyInContact<Gravity>,
    start: &RigidBodyState,
    end: f64,
    dt: f64,
) -> Located<Pose, EventKind> {
    let grid = TimeGrid::try_new(0.0, end, dt).unwrap();
    Run::new(system, method, grid).locating(Location::default()).from(start).unwrap()
}

const LAW: Hardening = Hardening { k: 400.0, b: 3000.0, c: 9.0 };
const DROP: f64 = 0.4;
const END: f64 = 0.6;

/// Height and vertical velocity at `END` after a fall from `DROP` at rest, by the equation of the height alone: the fall
/// in closed form, the contact in small steps of the classical method, its last one to where the force is zero.
fn height_of_its_own(law: &Hardening) -> (f64, f64) {
    let force = |z: f64, v: f64| -law.k * z + law.b * z * z - law.c * v;
    let step = |(z, v): (f64, f64), h: f64| {
        let slope = |(z, v): (f64, f64)| (v, force(z, v) / MASS - G);
        let to = |k: (f64, f64), s: f64| (z + s * k.0, v + s * k.1);
        let k1 = slope((z, v));
        let k2 = slope(to(k1, h / 2.0));
        let k3 = slope(to(k2, h / 2.0));
        let k4 = slope(to(k3, h));
        let mean = |a: f64, b: f64, c: f64, d: f64| h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
        (z + mean(k1.0, k2.0, k3.0, k4.0), v + mean(k1.1, k2.1, k3.1, k4.1))
    };
    let (mut t, h) = ((2.0 * DROP / G).sqrt(), 1e-5);
    let mut x = (0.0, -G * t);
    loop {
        let next = step(x, h);
        if force(next.0, next.1) < 0.0 {
            break;
        }
        (x, t) = (next, t + h);
    }
    let (mut near, mut far) = (0.0, h);
    while far - near > 1e-18 {
        let middle = 0.5 * (near + far);
        let there = step(x, middle);
        if force(there.0, there.1) < 0.0 {
            far = middle
        } else {
            near = middle
        }
        if middle == near && middle == far {
            break;
        }
    }
    let (z, v) = step(x, far);
    let rest = END - t - far;
    (z + v * rest - G / 2.0 * rest * rest, v - G * rest)
}

#[test]
fn a_users_laws_keep_the_order_of_methods_through_located_events() {
    let eta = 0.07;
    let (z, v) = height_of_its_own(&LAW);
    // m (v + g t) is the impulse of the ground.
    let sliding = 2.0 * (-eta * (v + G * END)).exp();
    let system = body_on_ground(ContactLaw::from(LAW).with_friction(Viscous { eta }), MASS);
    let start = at(DROP, Vector3::new(2.0, 0.0, 0.0));
    for (method, order, steps) in [
        (Method::Rkmk, 4.0, [100, 150, 200, 300, 400]),
        (Method::RkmkB, 4.0, [100, 150, 200, 300, 400]),
        (Method::Rkmk5, 5.0, [75, 100, 150, 200, 300]),
        (Method::Rkmk8, 8.0, [36, 43, 50, 60, 75]),
    ] {
        let error = |n: u32| {
            let found = run(method, &system, &start, END, END / f64::from(n));
            let kinds: Vec<_> = found.events.iter().map(|event| event.kind).collect();
            assert_eq!(kinds, [EventKind::TouchDown, EventKind::Release]);
            let impulse = found.events[1].impulse;
            assert!((impulse / (MASS * (v + G * END)) - 1.0).abs() < 1e-4, "{impulse}");
            let x = found.state;
            (x.position().z - z).abs() + (x.velocity().z - v).abs() + (x.velocity().x - sliding).abs()
        };
        let points: Vec<_> = steps.into_iter().map(|n| (1.0 / f64::from(n), error(n))).collect();
        println!("{method}: {:.2} {points:?}", slope(&points));
        assert!(slope(&points) > order - 0.4, "{method}: {points:?}");
        assert!(points[4].1 < 1e-5, "{method}: {points:?}");
    }
    // What is left is the rounding of the small steps.
    let fine = run(Method::Rkmk8, &system, &start, END, 1e-3).state;
    let errors = [fine.position().z - z, fine.velocity().z - v, fine.velocity().x - sliding];
    assert!(errors.iter().all(|error| error.abs() < 1e-11), "{errors:?}");
}

#[test]
fn viscous_friction_decays_exactly_on_a_body_at_rest_on_its_spring() {
    let (eta, end) = (0.4, 1.0);
    let normal = CompliantLaw::try_new(2e3, 10.0).unwrap();
    let system = body_on_ground(ContactLaw::from(normal).with_friction(Viscous { eta }), MASS);
    let start = at(-MASS * G / 2e3, Vector3::new(1.0, -2.0, 0.0));
    let found = run(Method::Rkmk8, &system, &start, end, 5e-3);
    let left = (-eta * G * end).exp();
    assert!(found.events.is_empty());
    assert!((found.state.velocity() - Vector3::new(left, -2.0 * left, 0.0)).norm() < 1e-13);
    let way = (1.0 - left) / (eta * G);
    assert!((found.state.position().xy() - nalgebra::Vector2::new(way, -2.0 * way)).norm() < 1e-13);
}

/// The body with ε in column `k`: the start, then k, b, c, η and the mass.
fn dropped(k: usize, epsilon: f64) -> (BodyInContact<Gravity>, RigidBodyState) {
    let of = |i: usize| if i + 12 == k { epsilon } else { 0.0 };
    let law = Hardening { k: LAW.k + of(0), b: LAW.b + of(1), c: LAW.c + of(2) };
    let law = ContactLaw::from(law).with_friction(Viscous { eta: 0.07 + of(3) });
    let system = body_on_ground(law, MASS + of(4));
    let start = at(DROP, Vector3::new(2.0, 0.3, 0.0));
    let start = if k < 12 { Tangent::unit(k).moved(&start, epsilon) } else { start };
    (system, start)
}

#[test]
fn the_derivative_by_a_users_parameters_is_the_difference_of_located_runs() {
    let by = [
        Parameter::normal(0, "k"),
        Parameter::normal(0, "b"),
        Parameter::normal(0, "c"),
        Parameter::friction(0, "eta"),
        Parameter::Mass,
    ];
    let (system, start) = dropped(0, 0.0);
    let found = differentiate(&system, &start, &by, (0.0, END), 2e-4).unwrap();
    assert_eq!(found.run.events.len(), 2);
    let steps = [[1e-5; 12].as_slice(), &[1e-2, 1e-1, 1e-4, 1e-5, 1e-5]].concat();
    agrees_with_differences(&found, dropped, &steps, (END, 2e-4), 1e-7);
    // v = v₀ exp(−η (v_z + g t)), and so by η.
    let x = found.run.state;
    let impulse = x.velocity().z + G * END;
    let by_eta = found.parameters[(6, 3)];
    assert!((by_eta / (-impulse * x.velocity().x) - 1.0).abs() < 1e-9, "{by_eta}");
    let (_, v) = height_of_its_own(&Hardening { b: LAW.b + 0.1, ..LAW });
    let (_, w) = height_of_its_own(&Hardening { b: LAW.b - 0.1, ..LAW });
    let by_b = found.parameters[(8, 1)];
    assert!(((v - w) / 0.2 / by_b - 1.0).abs() < 1e-6, "{by_b} {}", (v - w) / 0.2);
}

#[test]
fn a_users_law_that_is_one_of_the_librarys_gives_its_motion() {
    // Between spheres, behind an `Arc`, and in steps divided for a stiff contact.
    let (k, c) = (1e6, 60.0);
    let users: Arc<dyn NormalLaw> = Arc::new(Hardening { k, b: 0.0, c });
    let librarys = ContactLaw::from(CompliantLaw::try_new(k, c).unwrap());
    let bounce = |law: ContactLaw| {
        let run = run(Method::Rkmk5, &body_on_ground(law, 1.0), &at(0.1, Vector3::zeros()), 0.3, 1e-2);
        assert!(run.substeps > 2 && run.event_count == 2, "{run:?}");
        run
    };
    let (a, b) = (bounce(users.clone().into()), bounce(librarys.clone()));
    assert_eq!((a.substeps, a.trials), (b.substeps, b.trials));
    assert!((a.state.position().z - b.state.position().z).abs() < 1e-12);
    let impact = |law: ContactLaw| {
        let sphere = |body| BodySphere::try_new(body, Vector3::zeros(), 0.1).unwrap();
        let pair = SpherePair::try_new(sphere(0), sphere(1), law).unwrap();
        let bodies = vec![RigidBody::try_box(1.0, Vector3::repeat(0.1)).unwrap(); 2];
        let forces = vec![Gravity { acceleration: Vector3::zeros() }; 2];
        let contacts = BodyContacts::try_new(2, vec![], vec![pair]).unwrap();
        let system = BodiesInContact::try_new(bodies, forces, contacts).unwrap();
        let at = |x: f64| Pose { position: Vector3::x() * x, ..Pose::default() };
        let moving = |v: f64| Twist { linear: Vector3::x() * v, ..Twist::default() };
        let start = State { configuration: vec![at(0.0), at(0.25)], rate: vec![moving(1.0), moving(-1.0)] };
        let grid = TimeGrid::try_new(0.0, 0.1, 1e-4).unwrap();
        Run::new(&system, Method::Rkmk5, grid).locating(Location::default()).from(&start).unwrap()
    };
    let (a, b) = (impact(users.into()), impact(librarys));
    assert_eq!(a.event_count, 2);
    assert!((a.state.rate[0].linear.x - b.state.rate[0].linear.x).abs() < 1e-11);
}

#[test]
fn the_energy_of_a_users_spring_is_part_of_the_sum() {
    let system = body_on_ground(Hardening { c: 0.0, ..LAW }, MASS);
    let start = at(DROP, Vector3::zeros());
    let run = run(Method::Rkmk8, &system, &start, 0.36, 1e-3);
    let energy = system.energy(&run.state).unwrap();
    assert!(energy.springs > 1.0, "{energy:?}");
    let before = system.energy(&start).unwrap().total();
    assert!((energy.total() / before - 1.0).abs() < 1e-12, "{energy:?} {before}");
}

#[test]
fn a_users_friction_may_have_a_stretch() {
    // On the way s from rest of the bristle F = μ N (1 − exp(−k s/(μ N))).
    let (mu, k, speed, end) = (0.3, 900.0, 1.5, 0.4);
    let normal = CompliantLaw::try_new(2e3, 10.0).unwrap();
    let system = body_on_ground(ContactLaw::from(normal).with_friction(Bristle { mu, k }), MASS);
    let with = WithStretches(&system);
    let start = with.unstretched(at(-MASS * G / 2e3, Vector3::x() * speed));
    let grid = TimeGrid::try_new(0.0, end, 1e-3).unwrap();
    let location = Location::default();
    let found = Run::by_stepper(&with, &RKMK8, grid).locating(location).from(&start).unwrap();
    let (bound, x) = (mu * MASS * G, found.state.base());
    let work = bound * (x.position().x - bound / k * (1.0 - (-k * x.position().x / bound).exp()));
    let lost = 0.5 * MASS * (speed * speed - x.velocity().x.powi(2));
    assert!((work - lost).abs() < 1e-11, "{work} {lost}");
    assert!((found.state.variables()[0].x - bound / k).abs() < 1e-12);
    assert!(with.energy(&found.state) > 0.5 * k * (bound / k).powi(2));
    let run = Run::new(&system, Method::Rkmk8, grid).locating(location);
    let refused = run.from(&at(0.0, Vector3::x()));
    assert!(refused.unwrap_err().to_string().contains("WithStretches"));
}

#[test]
fn sensitivities_refuse_a_law_without_a_derivative_and_a_parameter_that_no_law_names() {
    let start = at(DROP, Vector3::zeros());
    let reason = |law: ContactLaw, by: &[Parameter]| {
        differentiate(&body_on_ground(law, MASS), &start, by, (0.0, 0.1), 1e-2).unwrap_err().reason
    };
    let bristle = ContactLaw::from(LAW).with_friction(Bristle { mu: 0.3, k: 900.0 });
    let error = reason(bristle, &[]);
    assert!(
        matches!(error, SensitivityError::NoDerivative { contact: 0, law } if law.ends_with("Bristle")),
        "{error}"
    );
    let viscous = ContactLaw::from(LAW).with_friction(Viscous { eta: 0.1 });
    for (parameter, allowed) in [
        (Parameter::normal(0, "stiffness"), ["k", "b", "c"].as_slice()),
        (Parameter::friction(0, "coefficient"), &["eta"]),
    ] {
        let error = reason(viscous.clone(), &[parameter]);
        assert!(
            matches!(error, SensitivityError::NoSuchParameter { allowed: found, .. } if found == allowed),
            "{error}"
        );
    }
}
