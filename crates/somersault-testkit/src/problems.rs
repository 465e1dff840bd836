//! Motions of one body with what is known at their end.

use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::lie::so3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::driver::{Flow, Observer, Step, TimeGrid};
use somersault_integrators::exact::FreeBody;
use somersault_integrators::force::{BoxedForce, ConstantForce, Drag, ForceModel, Spring, Wrench};
use somersault_integrators::methods::Method;
use somersault_integrators::run::Run;
use somersault_integrators::series::WrenchTerm;
use somersault_integrators::state::{Pose, RigidBodyState};
use somersault_integrators::stepper::Orders;
use somersault_integrators::system::RigidBodySystem;
use std::f64::consts::{PI, SQRT_2};

/// What a problem asks of a method; the fields of [`somersault_integrators::stepper::Orders`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Position and velocity under r̈ = f(r).
    Translation,
    /// Position and velocity under r̈ = f(r, ṙ).
    TranslationWithVelocity,
    /// Position and velocity under r̈ = f(r, R).
    TranslationWithOrientation,
    /// Orientation and angular velocity of a free body.
    Rotation,
    /// Orientation and angular velocity of a body under torque.
    RotationWithTorque,
}

impl Kind {
    /// Whether it is a motion on ℝ³, else on SO(3).
    pub fn is_translation(self) -> bool {
        match self {
            Self::Translation | Self::TranslationWithVelocity | Self::TranslationWithOrientation => true,
            Self::Rotation | Self::RotationWithTorque => false,
        }
    }

    /// The order that a method states for it; `None` where it does not take the forces.
    pub fn stated(self, orders: &Orders) -> Option<u8> {
        match self {
            Self::Translation => Some(orders.translation),
            Self::TranslationWithVelocity => Some(orders.translation_with_velocity),
            Self::TranslationWithOrientation => Some(orders.translation_with_orientation),
            Self::Rotation => Some(orders.rotation),
            Self::RotationWithTorque => orders.rotation_with_torque,
        }
    }
}

/// A body, its forces, its start and where it must be at the end.
pub struct Problem {
    /// Name in words.
    pub name: &'static str,
    /// What is measured.
    pub kind: Kind,
    /// What the motion is besides, so that a method may have the order it states for that, if that is lower.
    pub coupled: &'static [Kind],
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
    /// The order a method states for the motion: the least of those of its kinds. `None` where it does not take the
    /// forces.
    pub fn stated(&self, orders: &Orders) -> Option<u8> {
        let mut least = self.kind.stated(orders)?;
        for kind in self.coupled {
            least = least.min(kind.stated(orders)?);
        }
        Some(least)
    }

    /// Distance of the positions (m) or angle between the orientations (rad), as the kind asks.
    pub fn error(&self, state: &RigidBodyState) -> f64 {
        self.errors(state)[0]
    }

    /// The same, and the distance of the velocities (m/s) or angular velocities (rad/s).
    pub fn errors(&self, state: &RigidBodyState) -> [f64; 2] {
        if self.kind.is_translation() {
            [state.position() - self.end.position(), state.velocity() - self.end.velocity()]
                .map(|gap| gap.norm())
        } else {
            [
                so3::angle_between(state.orientation(), self.end.orientation()),
                (state.angular_velocity() - self.end.angular_velocity()).norm(),
            ]
        }
    }

    /// The error of a method with `steps` equal steps; `None` where the run fails.
    pub fn error_of(&self, method: Method, steps: u64) -> Option<f64> {
        self.errors_of(method, steps).map(|[error, _]| error)
    }

    /// The errors of a method with `steps` equal steps; `None` where the run fails.
    pub fn errors_of(&self, method: Method, steps: u64) -> Option<[f64; 2]> {
        let grid = TimeGrid::try_with_steps(0.0, self.duration, steps).ok()?;
        let end = Run::new(&self.system, method, grid).from(&self.initial).ok()?;
        Some(self.errors(&end.state))
    }

    /// The errors between the ends of a step: at `fraction`, in (0, 1), of the step that follows `steps` equal ones, by
    /// the method's own curve. The steps are such that the reference is there. `None` where the run fails.
    pub fn errors_within_a_step(&self, method: Method, steps: u64, fraction: f64) -> Option<[f64; 2]> {
        let dt = self.duration / (steps as f64 + fraction);
        let grid = TimeGrid::try_with_steps(0.0, dt * (steps + 1) as f64, steps + 1).ok()?;
        let mut last = LastCurve { last: steps + 1, time: self.duration, state: None };
        Run::new(&self.system, method, grid).observed_by(&mut last).from(&self.initial).ok()?;
        Some(self.errors(&last.state?))
    }
}

/// The state at a time within the last step.
struct LastCurve {
    last: u64,
    time: f64,
    state: Option<RigidBodyState>,
}

impl Observer<Pose> for LastCurve {
    fn observe(&mut self, step: &mut Step<'_, Pose>) -> Flow {
        if step.index == self.last {
            let mut state = *step.before;
            step.interpolant().evaluate(self.time, &mut state);
            self.state = Some(state);
        }
        Flow::Continue
    }
}

/// A box with the given proportions, 1 kg and 1 m³, with the inertia in full precision: thesis 7.2.1.
fn unit_box(proportions: [f64; 3]) -> RigidBody {
    let proportions = Vector3::from(proportions);
    let scale = proportions.product().cbrt();
    RigidBody::try_box(1.0, proportions / scale).expect("a box")
}

/// A body under a force behind a pointer, so that a test compiles the methods for one type of system whatever its forces.
pub fn under(
    body: RigidBody,
    force: impl ForceModel + Send + Sync + 'static,
) -> RigidBodySystem<Vec<BoxedForce>> {
    RigidBodySystem::new(body, vec![Box::new(force)])
}

fn free(name: &'static str, body: RigidBody, omega: Vector3<f64>, duration: f64) -> Problem {
    let initial = RigidBodyState::spinning(omega);
    let motion = FreeBody::try_new(&body, &initial).expect("a finite state");
    let end = motion.at(duration).expect("a finite time");
    let system = RigidBodySystem::new(body, Vec::new());
    Problem { name, kind: Kind::Rotation, coupled: &[], system, initial, duration, end }
}

/// Case 1, 2 or 3 of thesis 7.2.1 (any other number is taken as 3) over `duration`, 10 s in the thesis.
///
/// Case 2 starts next to an unstable axis: it is no measure of orders.
pub fn thesis_case(number: u8, duration: f64) -> Problem {
    let inclined = Vector3::new(0.0, SQRT_2 * PI, SQRT_2 * PI);
    match number {
        1 => free("case 1 of 7.2.1", unit_box([1.0, 1.0, 5.0]), inclined, duration),
        2 => {
            let omega = Vector3::new(0.0, 2.0 * PI, 2.0 * PI * 1e-4);
            free("case 2 of 7.2.1", unit_box([1.0, 2.0, 5.0]), omega, duration)
        }
        _ => free("case 3 of 7.2.1", unit_box([5.0, 5.0, 1.0]), inclined, duration),
    }
}

/// A box 1:2:3 that tumbles away from its separatrix.
pub fn asymmetric_body() -> Problem {
    free("asymmetric body", unit_box([1.0, 2.0, 3.0]), Vector3::new(2.5, -1.5, 4.0), 2.5)
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

fn attraction_term(body: &RigidBody) -> WrenchTerm {
    let (centre, point) = (Vector3::zeros(), Vector3::zeros());
    WrenchTerm::CentralForce { centre, point, strength: -body.mass(), power: -3.0, is_damper: false }
}

fn at(position: Vector3<f64>, velocity: Vector3<f64>) -> RigidBodyState {
    RigidBodyState::new(position, UnitQuaternion::identity(), velocity, Vector3::zeros())
}

/// A force on the position alone, which no method need ask for its velocity or its torque.
struct Central;

impl ForceModel for Central {
    fn wrench(&self, _: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        Wrench { force: attraction(x.position()) * body.mass(), torque: Vector3::zeros() }
    }
    fn add_terms(&self, body: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        terms.push(attraction_term(body));
        true
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
        coupled: &[],
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

impl ForceModel for CentralInTurningFrame {
    fn wrench(&self, _: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        let carried = self.turning.cross(x.position());
        let a =
            attraction(x.position()) - 2.0 * self.turning.cross(x.velocity()) - self.turning.cross(&carried);
        Wrench { force: a * body.mass(), torque: Vector3::zeros() }
    }
    fn add_terms(&self, body: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        let turning = self.turning.cross_matrix();
        terms.push(attraction_term(body));
        terms.push(WrenchTerm::LinearForce {
            position: -turning * turning * body.mass(),
            velocity: -2.0 * turning * body.mass(),
        });
        true
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
        coupled: &[],
        system: RigidBodySystem::new(unit_box([1.0, 2.0, 3.0]), vec![force]),
        initial: seen(0.0),
        duration,
        end: seen(duration),
    }
}

/// A box under a force at a point off its centre, as a heavy top under its weight, and, if requested,
/// under drag.
pub fn heavy_top(drag: bool) -> Problem {
    let weight = ConstantForce { force: Vector3::new(0.0, 0.0, -4.0), point: Vector3::new(0.1, 0.0, 0.5) };
    let mut forces: Vec<BoxedForce> = vec![Box::new(weight)];
    if drag {
        forces.push(Box::new(Drag { linear: 0.2, quadratic: 0.1, angular: 0.1 }));
    }
    let system = RigidBodySystem::new(unit_box([1.0, 2.0, 3.0]), forces);
    let initial = RigidBodyState::spinning(Vector3::new(1.0, 0.7, 2.0));
    let name = if drag { "heavy top with drag" } else { "heavy top" };
    with_fine_end(name, Kind::RotationWithTorque, &[], system, initial)
}

/// A problem over 2 s whose end is computed by the method of order 8 with 4000 steps, good to about 1e-13.
fn with_fine_end(
    name: &'static str,
    kind: Kind,
    coupled: &'static [Kind],
    system: RigidBodySystem<Vec<BoxedForce>>,
    initial: RigidBodyState,
) -> Problem {
    let duration = 2.0;
    let grid = TimeGrid::try_with_steps(0.0, duration, 4000).expect("a grid");
    let end = Run::new(&system, Method::Rkmk8, grid).from(&initial).expect("a smooth motion").state;
    Problem { name, kind, coupled, system, initial, duration, end }
}

/// An engine fixed in a body: a force on the centre of mass along an axis of the body.
struct Thrust(Vector3<f64>);

impl ForceModel for Thrust {
    fn wrench(&self, _: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        Wrench { force: x.orientation() * self.0, torque: Vector3::zeros() }
    }
    fn add_terms(&self, _: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        terms.push(WrenchTerm::Thrust(self.0));
        true
    }
    fn is_torque_free(&self) -> bool {
        true
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
}

/// A tumbling box with an engine fixed in it, on a spring at its centre of mass: r̈ = f(r, R).
pub fn thrust() -> Problem {
    let spring = Spring {
        anchor: Vector3::new(0.0, 0.0, 1.0),
        attachment: Vector3::zeros(),
        stiffness: 3.0,
        damping: 0.0,
        rest_length: 0.5,
    };
    let forces: Vec<BoxedForce> = vec![Box::new(spring), Box::new(Thrust(Vector3::new(0.6, -0.3, 1.1)))];
    let system = RigidBodySystem::new(unit_box([1.0, 2.0, 3.0]), forces);
    let mut initial = RigidBodyState::spinning(Vector3::new(2.5, -1.5, 4.0));
    initial.rate.linear = Vector3::new(0.3, 0.5, -0.2);
    with_fine_end("thrust fixed in a body", Kind::TranslationWithOrientation, &[], system, initial)
}

/// A box on a spring attached off its centre of mass, with drag if requested: forces and torques that depend on position and
/// orientation, and on the velocities. Measured on ℝ³ or on SO(3), as `kind` says.
pub fn spring_off_centre(drag: bool, kind: Kind) -> Problem {
    let spring = Spring {
        anchor: Vector3::new(0.0, 0.2, 1.5),
        attachment: Vector3::new(0.3, -0.2, 0.5),
        stiffness: 12.0,
        damping: 0.0,
        rest_length: 0.8,
    };
    let mut forces: Vec<BoxedForce> = vec![Box::new(spring)];
    let name = match (drag, kind) {
        (false, Kind::RotationWithTorque) => "spring off centre, on SO(3)",
        (true, Kind::RotationWithTorque) => "spring off centre with drag, on SO(3)",
        (false, _) => "spring off centre, on R^3",
        (true, _) => "spring off centre with drag, on R^3",
    };
    let coupled: &[Kind] = match drag {
        true => {
            // Quadratic drag is not smooth where the body stops.
            forces.push(Box::new(Drag { linear: 0.2, quadratic: 0.0, angular: 0.1 }));
            &[Kind::TranslationWithVelocity, Kind::TranslationWithOrientation, Kind::RotationWithTorque]
        }
        false => &[Kind::TranslationWithOrientation, Kind::RotationWithTorque],
    };
    let system = RigidBodySystem::new(unit_box([1.0, 2.0, 3.0]), forces);
    let mut initial = RigidBodyState::spinning(Vector3::new(1.0, 0.7, 2.0));
    initial.rate.linear = Vector3::new(0.4, -0.3, 0.2);
    with_fine_end(name, kind, coupled, system, initial)
}

/// All problems that measure orders.
pub fn for_orders() -> Vec<Problem> {
    vec![
        orbit(),
        orbit_in_turning_frame(),
        thrust(),
        thesis_case(1, 1.0),
        thesis_case(3, 1.0),
        asymmetric_body(),
        heavy_top(false),
        heavy_top(true),
        spring_off_centre(false, Kind::TranslationWithOrientation),
        spring_off_centre(false, Kind::RotationWithTorque),
        spring_off_centre(true, Kind::TranslationWithOrientation),
        spring_off_centre(true, Kind::RotationWithTorque),
    ]
}
