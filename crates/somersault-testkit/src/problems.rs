//! Motions of one body with what is known at their end.

use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::so3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::TimeGrid;
use somersault_integrators::exact::FreeBody;
use somersault_integrators::force::{BoxedForce, ConstantForce, Drag, Wrench};
use somersault_integrators::methods::{Method, Options};
use somersault_integrators::state::RigidBodyState;
use somersault_integrators::system::RigidBodySystem;
use std::f64::consts::{PI, SQRT_2};

/// What a problem asks of a method; the fields of [`somersault_integrators::stepper::Orders`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Position under r̈ = f(r).
    Translation,
    /// Position under r̈ = f(r, ṙ).
    TranslationWithVelocity,
    /// Orientation of a free body.
    Rotation,
    /// Orientation of a body under torque.
    RotationWithTorque,
}

/// A body, its forces, its start and where it must be at the end.
pub struct Problem {
    /// Name in words.
    pub name: &'static str,
    /// What it asks.
    pub kind: Kind,
    /// Whether two principal moments are equal, so that a method may do better than its order.
    pub symmetric: bool,
    /// Body and forces.
    pub system: RigidBodySystem<Vec<BoxedForce>>,
    /// State at t = 0.
    pub initial: RigidBodyState,
    /// End of the interval, s.
    pub duration: f64,
    /// State at the end.
    pub end: RigidBodyState,
}

impl Problem {
    /// Distance of the positions (m) or angle between the orientations (rad), as the kind asks.
    pub fn error(&self, state: &RigidBodyState) -> f64 {
        match self.kind {
            Kind::Translation | Kind::TranslationWithVelocity => {
                (state.position() - self.end.position()).norm()
            }
            Kind::Rotation | Kind::RotationWithTorque => {
                so3::angle_between(state.orientation(), self.end.orientation())
            }
        }
    }

    /// The error of a method with `steps` equal steps; `None` where the run fails.
    pub fn error_of(&self, method: Method, steps: u64) -> Option<f64> {
        let grid = TimeGrid::try_with_steps(0.0, self.duration, steps).ok()?;
        let end = method.integrate(Options::default(), &self.system, &self.initial, &grid, &mut ()).ok()?;
        Some(self.error(&end.state))
    }
}

/// A box with the given proportions, 1 kg and 1 m³, with the inertia in full precision: thesis 7.2.1.
fn unit_box(proportions: [f64; 3]) -> RigidBody {
    let proportions = Vector3::from(proportions);
    let scale = proportions.product().cbrt();
    RigidBody::try_box(1.0, proportions / scale).expect("a box")
}

fn free(name: &'static str, body: RigidBody, omega: Vector3<f64>, duration: f64, symmetric: bool) -> Problem {
    let initial = RigidBodyState::spinning(omega);
    let motion = FreeBody::try_new(&body, &initial).expect("a finite state");
    let end = motion.at(duration).expect("a finite time");
    let system = RigidBodySystem::new(body, Vec::new());
    Problem { name, kind: Kind::Rotation, symmetric, system, initial, duration, end }
}

/// Case 1, 2 or 3 of thesis 7.2.1 (any other number is taken as 3) over `duration`, 10 s in the thesis.
///
/// Case 2 starts next to an unstable axis: it is no measure of orders.
pub fn thesis_case(number: u8, duration: f64) -> Problem {
    let inclined = Vector3::new(0.0, SQRT_2 * PI, SQRT_2 * PI);
    match number {
        1 => free("case 1 of 7.2.1", unit_box([1.0, 1.0, 5.0]), inclined, duration, true),
        2 => {
            let omega = Vector3::new(0.0, 2.0 * PI, 2.0 * PI * 1e-4);
            free("case 2 of 7.2.1", unit_box([1.0, 2.0, 5.0]), omega, duration, false)
        }
        _ => free("case 3 of 7.2.1", unit_box([5.0, 5.0, 1.0]), inclined, duration, true),
    }
}

/// A box 1:2:3 that tumbles away from its separatrix.
pub fn asymmetric_body() -> Problem {
    free("asymmetric body", unit_box([1.0, 2.0, 3.0]), Vector3::new(2.5, -1.5, 4.0), 2.5, false)
}

/// Eccentricity of the orbits below.
const ECCENTRICITY: f64 = 0.1;

/// Kepler's problem with unit semi-major axis and unit attraction, from the pericentre: the position at
/// `t` and the velocity there.
fn kepler(t: f64) -> (Vector3<f64>, Vector3<f64>) {
    let e = ECCENTRICITY;
    let mut anomaly = t;
    for _ in 0..50 {
        anomaly -= (anomaly - e * anomaly.sin() - t) / (1.0 - e * anomaly.cos());
    }
    let (sin, cos) = anomaly.sin_cos();
    let (minor, rate) = ((1.0 - e * e).sqrt(), 1.0 / (1.0 - e * cos));
    (Vector3::new(cos - e, minor * sin, 0.0), Vector3::new(-sin, minor * cos, 0.0) * rate)
}

fn attraction(r: &Vector3<f64>) -> Vector3<f64> {
    -r / r.norm().powi(3)
}

fn at(position: Vector3<f64>, velocity: Vector3<f64>) -> RigidBodyState {
    RigidBodyState::new(position, UnitQuaternion::identity(), velocity, Vector3::zeros())
}

/// A force on the position alone, which no method need ask for its velocity or its torque.
struct Central;

impl somersault_integrators::force::ForceModel for Central {
    fn wrench(&self, _: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        Wrench { force: attraction(x.position()) * body.mass(), torque: Vector3::zeros() }
    }
    fn is_torque_free(&self) -> bool {
        true
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
}

/// An elliptic orbit under gravity: r̈ = −r/|r|³, in closed form.
pub fn orbit() -> Problem {
    let duration = 6.0;
    let ((r0, v0), (r1, v1)) = (kepler(0.0), kepler(duration));
    let system = RigidBodySystem::new(unit_box([1.0, 2.0, 3.0]), vec![Box::new(Central) as BoxedForce]);
    Problem {
        name: "orbit",
        kind: Kind::Translation,
        symmetric: false,
        system,
        initial: at(r0, v0),
        duration,
        end: at(r1, v1),
    }
}

/// The forces of a frame that turns at Ω: gravity, centrifugal and Coriolis force.
struct CentralInTurningFrame {
    turning: Vector3<f64>,
}

impl somersault_integrators::force::ForceModel for CentralInTurningFrame {
    fn wrench(&self, _: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        let carried = self.turning.cross(x.position());
        let a =
            attraction(x.position()) - 2.0 * self.turning.cross(x.velocity()) - self.turning.cross(&carried);
        Wrench { force: a * body.mass(), torque: Vector3::zeros() }
    }
    fn is_torque_free(&self) -> bool {
        true
    }
}

/// The same orbit seen from a turning frame: r̈ = f(r, ṙ) with the Coriolis force, in closed form.
pub fn orbit_in_turning_frame() -> Problem {
    let duration = 6.0;
    let turning = Vector3::new(0.2, -0.3, 0.4);
    let seen = |t: f64| {
        let back = so3::exp(&(turning * -t));
        let (r, v) = kepler(t);
        let (r, v) = (back * r, back * v);
        at(r, v - turning.cross(&r))
    };
    let force: BoxedForce = Box::new(CentralInTurningFrame { turning });
    Problem {
        name: "orbit in a turning frame",
        kind: Kind::TranslationWithVelocity,
        symmetric: false,
        system: RigidBodySystem::new(unit_box([1.0, 2.0, 3.0]), vec![force]),
        initial: seen(0.0),
        duration,
        end: seen(duration),
    }
}

/// A box under a force at a point off its centre, as a heavy top under its weight, and, if asked for,
/// under drag.
///
/// The reference is the method of order 8 with 4000 steps, good to about 1e-13.
pub fn heavy_top(drag: bool) -> Problem {
    let weight = ConstantForce { force: Vector3::new(0.0, 0.0, -4.0), point: Vector3::new(0.1, 0.0, 0.5) };
    let mut forces: Vec<BoxedForce> = vec![Box::new(weight)];
    if drag {
        forces.push(Box::new(Drag { linear: 0.2, quadratic: 0.1, angular: 0.1 }));
    }
    let system = RigidBodySystem::new(unit_box([1.0, 2.0, 3.0]), forces);
    let initial = RigidBodyState::spinning(Vector3::new(1.0, 0.7, 2.0));
    let duration = 2.0;
    let grid = TimeGrid::try_with_steps(0.0, duration, 4000).expect("a grid");
    let end = Method::Rkmk8
        .integrate(Options::default(), &system, &initial, &grid, &mut ())
        .expect("a smooth motion")
        .state;
    let name = if drag { "heavy top with drag" } else { "heavy top" };
    Problem { name, kind: Kind::RotationWithTorque, symmetric: false, system, initial, duration, end }
}

/// All problems that measure orders.
pub fn for_orders() -> Vec<Problem> {
    vec![
        orbit(),
        orbit_in_turning_frame(),
        thesis_case(1, 1.0),
        thesis_case(3, 1.0),
        asymmetric_body(),
        heavy_top(false),
        heavy_top(true),
    ]
}
