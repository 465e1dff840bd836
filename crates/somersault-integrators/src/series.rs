//! Taylor series of the motion of a rigid body, coefficient by coefficient.
//!
//! With position r, velocity v and force F in world axes, and orientation q, angular velocity ω, angular momentum L = Iω and
//! torque M about the centre of mass in body axes, the coefficients of tᵏ⁺¹ follow from those up to tᵏ:
//!
//! ```text
//! (k+1) rₖ₊₁ = vₖ                  (k+1) qₖ₊₁ = ½ Σ qⱼ ⊗ ωₖ₋ⱼ
//! (k+1) vₖ₊₁ = Fₖ / m              (k+1) Lₖ₊₁ = Mₖ + Σ Lⱼ × ωₖ₋ⱼ        ωₖ₊₁ = I⁻¹ Lₖ₊₁
//! ```
//!
//! A direction d that is fixed in the world has in body axes (k+1) dₖ₊₁ = Σ dⱼ × ωₖ₋ⱼ: the same sums as of q and L, which are
//! made together. What forces may be is a [`WrenchTerm`]; a [force model](crate::force::ForceModel) says of which terms it is
//! the sum.
//!
//! A user-defined force has a series where it is a sum of terms:
//!
//! ```
//! use somersault_integrators::body::RigidBody;
//! use somersault_integrators::driver::{Adaptive, Steps};
//! use somersault_integrators::force::{ForceModel, Wrench};
//! use somersault_integrators::methods::Method;
//! use somersault_integrators::nalgebra::Vector3;
//! use somersault_integrators::run::Run;
//! use somersault_integrators::series::WrenchTerm;
//! use somersault_integrators::state::RigidBodyState;
//! use somersault_integrators::system::RigidBodySystem;
//!
//! /// An engine fixed in the body.
//! struct Engine(Vector3<f64>);
//!
//! impl ForceModel for Engine {
//!     fn wrench(&self, _: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
//!         Wrench { force: x.orientation() * self.0, torque: Vector3::zeros() }
//!     }
//!     fn add_terms(&self, _: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
//!         terms.push(WrenchTerm::Thrust(self.0));
//!         true
//!     }
//! }
//!
//! let body = RigidBody::try_principal(2.0, Vector3::repeat(1.0))?;
//! let system = RigidBodySystem::new(body, Engine(Vector3::x()));
//! let turning = RigidBodyState::spinning(Vector3::z());
//! let steps = Steps::adapted((0.0, 1.0), Adaptive::with_tolerances(1e-12, 1e-12));
//! let end = Run::new(&system, Method::Taylor16, steps).from(&turning)?.state;
//! assert!((end.velocity().x - 0.5 * 1f64.sin()).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! À. Jorba and M. Zou, Experimental Mathematics 14 (2005) 99; the products of quaternions are Hamilton's.

use crate::body::RigidBody;
use crate::force::Wrench;
use crate::state::{Pose, RigidBodyState, Twist};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3, Vector4};
use somersault_core::lanes::{Quad, QuadKernel, places, run_on_quads};

/// The degree up to which motions are expanded.
pub const DEGREE: usize = 16;

/// A part of the wrench on a body whose Taylor series along a motion is known.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum WrenchTerm {
    /// A constant force at the centre of mass, world axes, N.
    Force(Vector3<f64>),
    /// A constant force of the world at a point of the body.
    ForceAtPoint {
        /// World axes, N.
        force: Vector3<f64>,
        /// From the centre of mass, body axes, m.
        point: Vector3<f64>,
    },
    /// A force at the centre of mass that is fixed in the body, body axes, N.
    Thrust(Vector3<f64>),
    /// A force at the centre of mass that is linear in its position and velocity, A r + B v, world axes.
    LinearForce {
        /// A, N/m.
        position: Matrix3<f64>,
        /// B, N s/m.
        velocity: Matrix3<f64>,
    },
    /// A force c |s|ᵖ s at a point of the body, s the way to it from a centre in the world, or c |s|ᵖ (s · ṡ) s: Newton's attraction by
    /// c < 0 and p = −3, a damper along s by p = −2.
    CentralForce {
        /// Where s is zero, world axes, m.
        centre: Vector3<f64>,
        /// From the centre of mass, body axes, m.
        point: Vector3<f64>,
        /// c, N/mᵖ⁺¹, and N s/mᵖ⁺³ of a damper.
        strength: f64,
        /// p.
        power: f64,
        /// Whether the factor s · ṡ is there.
        is_damper: bool,
    },
    /// The force c |v| v at the centre of mass, c in N s²/m².
    QuadraticDrag(f64),
    /// A constant torque fixed in the body, body axes, N m.
    Torque(Vector3<f64>),
    /// A constant torque fixed in the world, world axes, N m.
    WorldTorque(Vector3<f64>),
    /// The torque c ω, c in N m s.
    AngularDrag(f64),
    /// The force −k gap − c rate along the normal of a plane, at a point of the body with such a gap over the plane.
    Support {
        /// Of the plane, of length 1, world axes.
        normal: Vector3<f64>,
        /// Of the plane from the origin along the normal, m.
        offset: f64,
        /// From the centre of mass, body axes, m.
        point: Vector3<f64>,
        /// k, N/m.
        stiffness: f64,
        /// c, N s/m.
        damping: f64,
    },
}

impl WrenchTerm {
    /// Force and torque in a state. A central force that is bounded near its centre, as that of a spring, is zero there.
    pub fn wrench(&self, x: &RigidBodyState) -> Wrench {
        let (force, point) = match *self {
            Self::Torque(torque) => return torque_alone(x.orientation() * torque),
            Self::WorldTorque(torque) => return torque_alone(torque),
            Self::AngularDrag(c) => return torque_alone(x.angular_velocity() * c),
            Self::Force(force) => (force, Vector3::zeros()),
            Self::ForceAtPoint { force, point } => (force, point),
            Self::Thrust(force) => (x.orientation() * force, Vector3::zeros()),
            Self::LinearForce { position, velocity } => {
                (position * x.position() + velocity * x.velocity(), Vector3::zeros())
            }
            Self::CentralForce { centre, point, strength, power, is_damper } => {
                let arm = x.orientation() * point;
                let way = x.position() + arm - centre;
                let rate = x.velocity() + x.angular_velocity().cross(&arm);
                let factor = if is_damper { way.dot(&rate) } else { 1.0 };
                let growth = power + if is_damper { 2.0 } else { 1.0 };
                let is_at_centre = way == Vector3::zeros() && growth >= 0.0;
                let size = if is_at_centre { 0.0 } else { way.norm().powf(power) };
                (way * (strength * size * factor), point)
            }
            Self::QuadraticDrag(c) => (x.velocity() * (c * x.velocity().norm()), Vector3::zeros()),
            Self::Support { normal, offset, point, stiffness, damping } => {
                let arm = x.orientation() * point;
                let gap = normal.dot(&(x.position() + arm)) - offset;
                let rate = normal.dot(&(x.velocity() + x.angular_velocity().cross(&arm)));
                (normal * -(stiffness * gap + damping * rate), point)
            }
        };
        Wrench { force, torque: (x.orientation() * point).cross(&force) }
    }

    /// The term of the same forces where time runs backwards, and with it the velocities.
    pub(crate) fn reversed(self) -> Self {
        match self {
            Self::LinearForce { position, velocity } => Self::LinearForce { position, velocity: -velocity },
            Self::AngularDrag(c) => Self::AngularDrag(-c),
            Self::QuadraticDrag(c) => Self::QuadraticDrag(-c),
            Self::CentralForce { centre, point, strength, power, is_damper: true } => {
                Self::CentralForce { centre, point, strength: -strength, power, is_damper: true }
            }
            Self::Support { normal, offset, point, stiffness, damping } => {
                Self::Support { normal, offset, point, stiffness, damping: -damping }
            }
            Self::Force(_)
            | Self::ForceAtPoint { .. }
            | Self::Thrust(_)
            | Self::CentralForce { .. }
            | Self::Torque(_)
            | Self::WorldTorque(_) => self,
        }
    }
}

/// Below 1 by what keeps a step off the edge of the disc in which the series of a length converges.
const MARGIN: f64 = 0.75;

fn torque_alone(torque: Vector3<f64>) -> Wrench {
    Wrench { force: Vector3::zeros(), torque }
}

/// Three or four numbers; of three, the fourth is zero.
type Entry = [f64; 4];

/// An entry for each degree.
type Row = [Entry; DEGREE + 1];

/// The same in the order of falling degrees up to that of degree 0 at [`DEGREE`], for what stands second in sums of products. With unused
/// entries behind it no place in such a sum need be checked.
type Falling = [Entry; 2 * DEGREE];

const ZERO: Row = [[0.0; 4]; DEGREE + 1];
const FALLING: Falling = [[0.0; 4]; 2 * DEGREE];

fn entry(v: &Vector3<f64>) -> Entry {
    [v.x, v.y, v.z, 0.0]
}

fn columns(m: &Matrix3<f64>) -> [Entry; 3] {
    [0, 1, 2].map(|i| entry(&m.column(i).into()))
}

/// A torque by a direction in body axes: d itself, or arm × d.
#[derive(Debug, Clone, Copy)]
struct Moment {
    direction: usize,
    arm: Option<Entry>,
}

/// A plane under a point; gap and rate are weighed together.
#[derive(Debug, Clone, Copy)]
struct Plane {
    /// Of the normal.
    direction: usize,
    normal: Entry,
    arm: Entry,
    stiffness: f64,
    damping: f64,
    /// k times the distance of the plane from the origin, N.
    preload: f64,
}

/// What a collinear force is along.
#[derive(Debug, Clone, Copy)]
enum Along {
    /// The way from a centre to a point of the body, or to the centre of mass.
    Way { centre: Vector3<f64>, point: Option<Vector3<f64>> },
    /// The velocity of the centre of mass.
    Velocity,
}

/// A force c |s|ᵖ s or c |s|ᵖ (s · ṡ) s along a vector s that does not vanish in a step.
#[derive(Debug, Clone, Copy)]
struct CollinearForce {
    along: Along,
    strength: f64,
    power: f64,
    is_damper: bool,
    /// Coefficients of s, |s|², |s|ᵖ, the factor of s, and the force.
    ways: [Vector3<f64>; DEGREE + 1],
    squares: [f64; DEGREE + 1],
    powers: [f64; DEGREE + 1],
    factors: [f64; DEGREE + 1],
    pulls: [Vector3<f64>; DEGREE + 1],
    /// How many coefficients of s are known.
    known: usize,
    /// The degree of the first coefficient of a velocity that is not zero.
    leading: Option<usize>,
}

impl CollinearForce {
    fn new(along: Along, strength: f64, power: f64, is_damper: bool) -> Self {
        let (numbers, vectors) = ([0.0; DEGREE + 1], [Vector3::zeros(); DEGREE + 1]);
        Self {
            along,
            strength,
            power,
            is_damper,
            ways: vectors,
            squares: numbers,
            powers: numbers,
            factors: numbers,
            pulls: vectors,
            known: 0,
            leading: None,
        }
    }

    /// Takes the next coefficient of s.
    fn learn(&mut self, way: Vector3<f64>) {
        let n = self.known;
        self.ways[n] = way;
        self.squares[n] = (0..=n).map(|j| self.ways[j].dot(&self.ways[n - j])).sum();
        self.known += 1;
    }

    /// Finds the coefficient of degree k of the force: of a damper from those of s up to degree k + 1.
    fn pull(&mut self, k: usize) -> Vector3<f64> {
        let Self { ways, squares, powers, factors, pulls, .. } = self;
        // u = |s|ᵖ obeys s² u' = ½ p (s²)' u.
        let exponent = 0.5 * self.power;
        powers[k] = if k == 0 {
            squares[0].powf(exponent)
        } else if self.power == 0.0 {
            0.0
        } else {
            let terms = (0..k).map(|j| (exponent * (k - j) as f64 - j as f64) * squares[k - j] * powers[j]);
            terms.sum::<f64>() / (k as f64 * squares[0])
        };
        factors[k] = if self.is_damper {
            // s · ṡ is half the derivative of |s|².
            (0..=k).map(|j| powers[j] * 0.5 * (k - j + 1) as f64 * squares[k - j + 1]).sum()
        } else {
            powers[k]
        };
        pulls[k] = (0..=k).map(|j| ways[k - j] * factors[j]).sum::<Vector3<f64>>() * self.strength;
        pulls[k]
    }

    /// The same from the velocity v, whose coefficient of degree k is the last that is known. From rest v = tⁿ w with w that is not zero,
    /// and |v| v = t²ⁿ |w| w.
    fn resist(&mut self, velocity: &Row, k: usize) -> Vector3<f64> {
        if self.leading.is_none() && vector(&velocity[k]) != Vector3::zeros() {
            self.leading = Some(k);
        }
        let Some(leading) = self.leading.filter(|leading| 2 * leading <= k) else { return Vector3::zeros() };
        let degree = k - 2 * leading;
        self.learn(vector(&velocity[degree + leading]));
        self.pull(degree)
    }

    /// Whether s is not zero up to h: no term of |s|² is less before than at h or at the start.
    fn holds_to(&self, h: f64) -> bool {
        self.stays_above(0.0, h, |term| term.min(0.0))
    }

    /// Whether s is zero at no time within h of the start, complex ones included, so that the series of |s|ᵖ converges there: all other
    /// terms of |s|² together are less than [`MARGIN`] times that of degree 0.
    fn converges_to(&self, h: f64) -> bool {
        self.stays_above(1.0 - MARGIN, h, |term| -term.abs())
    }

    /// Whether the term of degree 0 of |s|² and what counts of the others at h sum to more than a fraction of the first.
    fn stays_above(&self, fraction: f64, h: f64, counts: impl Fn(f64) -> f64) -> bool {
        let Some((first, others)) = self.squares[..self.known].split_first() else { return true };
        let (mut sum, mut power) = (*first, 1.0);
        for c in others {
            power *= h;
            sum += counts(c * power);
        }
        // what is not finite is for the driver to see
        self.power == 0.0 || (*first != 0.0 && (sum > fraction * first || sum.is_nan()))
    }
}

/// The terms of a wrench, sorted, and the body.
#[derive(Debug, Clone, Default)]
struct Equations {
    inverse_mass: f64,
    is_diagonal: bool,
    force: Entry,
    torque: Entry,
    linear: Option<[[Entry; 3]; 2]>,
    angular_drag: f64,
    /// The direction of the first of the three axes of the world, where they are needed.
    axes: Option<usize>,
    thrust: Option<Vector3<f64>>,
    moments: Vec<Moment>,
    planes: Vec<Plane>,
    collinear: Vec<CollinearForce>,
    /// Fixed in the world.
    directions: Vec<Vector3<f64>>,
}

impl Equations {
    /// The place of a direction among those of the world.
    fn direction(&mut self, d: &Vector3<f64>) -> usize {
        self.directions.iter().position(|known| known == d).unwrap_or_else(|| {
            self.directions.push(*d);
            self.directions.len() - 1
        })
    }

    fn read(&mut self, body: &RigidBody, terms: &[WrenchTerm]) {
        *self = Self {
            inverse_mass: 1.0 / body.mass(),
            is_diagonal: body.inertia().is_diagonal(),
            ..Self::default()
        };
        let [mut constant, mut torque, mut of_world, mut thrust] = [Vector3::zeros(); 4];
        let (mut by_position, mut by_velocity) = (Matrix3::zeros(), Matrix3::zeros());
        for term in terms {
            match term {
                WrenchTerm::Force(force) => constant += force,
                WrenchTerm::ForceAtPoint { force, point } => {
                    constant += force;
                    let direction = self.direction(force);
                    self.moments.push(Moment { direction, arm: Some(entry(point)) });
                }
                WrenchTerm::Thrust(force) => thrust += force,
                WrenchTerm::LinearForce { position, velocity } => {
                    by_position += position;
                    by_velocity += velocity;
                }
                &WrenchTerm::CentralForce { centre, point, strength, power, is_damper } => {
                    let point = (point != Vector3::zeros()).then_some(point);
                    let along = Along::Way { centre, point };
                    self.collinear.push(CollinearForce::new(along, strength, power, is_damper));
                }
                WrenchTerm::QuadraticDrag(strength) => {
                    self.collinear.push(CollinearForce::new(Along::Velocity, *strength, 1.0, false));
                }
                WrenchTerm::Torque(of_body) => torque += of_body,
                WrenchTerm::WorldTorque(torque) => of_world += torque,
                WrenchTerm::AngularDrag(c) => self.angular_drag += c,
                WrenchTerm::Support { normal, offset, point, stiffness, damping } => {
                    let direction = self.direction(normal);
                    self.planes.push(Plane {
                        direction,
                        normal: entry(normal),
                        arm: entry(point),
                        stiffness: *stiffness,
                        damping: *damping,
                        preload: stiffness * offset,
                    });
                }
            }
        }
        if of_world != Vector3::zeros() {
            let direction = self.direction(&of_world);
            self.moments.push(Moment { direction, arm: None });
        }
        self.thrust = (thrust != Vector3::zeros()).then_some(thrust);
        let is_off_centre = |force: &CollinearForce| matches!(force.along, Along::Way { point: Some(_), .. });
        if self.thrust.is_some() || self.collinear.iter().any(is_off_centre) {
            self.axes = Some(self.directions.len());
            self.directions.extend([Vector3::x(), Vector3::y(), Vector3::z()]);
        }
        (self.force, self.torque) = (entry(&constant), entry(&torque));
        let is_linear = by_position != Matrix3::zeros() || by_velocity != Matrix3::zeros();
        self.linear = is_linear.then(|| [columns(&by_position), columns(&by_velocity)]);
    }
}

/// The motion of one body as polynomials of the time since their start.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyMotion {
    position: Row,
    velocity: Row,
    orientation: Row,
    momentum: Row,
    /// Of I⁻¹.
    columns: [Entry; 3],
}

/// The series of one body from a state, under a sum of terms.
#[derive(Debug, Clone)]
pub(crate) struct BodySeries {
    /// What the coefficients belong to.
    of: Option<(RigidBody, RigidBodyState, Vec<WrenchTerm>)>,
    equations: Equations,
    motion: BodyMotion,
    /// ω in body axes, each component in all of an entry; falling degrees.
    spin: [Falling; 3],
    /// The directions of the equations in body axes, and (k+1) times the coefficient found last.
    directions: Vec<(Row, Entry)>,
    /// The force of each plane, in all of an entry; falling degrees.
    pushes: Vec<Falling>,
}

impl BodySeries {
    /// No series yet.
    pub(crate) fn new() -> Self {
        Self {
            of: None,
            equations: Equations::default(),
            motion: BodyMotion {
                position: ZERO,
                velocity: ZERO,
                orientation: ZERO,
                momentum: ZERO,
                columns: [[0.0; 4]; 3],
            },
            spin: [FALLING; 3],
            directions: Vec::new(),
            pushes: Vec::new(),
        }
    }

    /// Expands the motion of a body from a state; coefficients that are known of just this are kept. True where
    /// they were not known.
    pub(crate) fn expand(&mut self, body: &RigidBody, x: &RigidBodyState, terms: &[WrenchTerm]) -> bool {
        let has_body = match &self.of {
            Some((known, start, of)) if known == body && of == terms => {
                if start == x {
                    return false;
                }
                true
            }
            Some(_) | None => false,
        };
        match &mut self.of {
            Some((_, start, _)) if has_body => *start = *x,
            of => {
                self.equations.read(body, terms);
                self.motion.columns = columns(body.inertia().inverse());
                self.directions.resize(self.equations.directions.len(), (ZERO, [0.0; 4]));
                self.pushes.resize(self.equations.planes.len(), FALLING);
                *of = Some((*body, *x, terms.to_vec()));
            }
        }
        let turn = x.orientation().inverse();
        let spin = turn * x.angular_velocity();
        self.motion.position[0] = entry(x.position());
        self.motion.velocity[0] = entry(x.velocity());
        self.motion.orientation[0] = x.orientation().coords.into();
        self.motion.momentum[0] = entry(&body.inertia().momentum(&spin));
        for (row, component) in self.spin.iter_mut().zip(spin.iter()) {
            row[DEGREE] = [*component; 4];
        }
        for ((row, _), d) in self.directions.iter_mut().zip(&self.equations.directions) {
            row[0] = entry(&(turn * d));
        }
        run_on_quads(Expansion { series: self, spin: entry(&spin) });
        true
    }

    /// Whether the motion begins in this state.
    pub(crate) fn begins_at(&self, x: &RigidBodyState) -> bool {
        self.of.as_ref().is_some_and(|(_, start, _)| start == x)
    }

    /// Whether the series may be used up to h: no centre of a force is reached on the way, and no rest under quadratic drag.
    pub(crate) fn holds_to(&self, h: f64) -> bool {
        self.equations.collinear.iter().all(|force| force.holds_to(h))
    }

    /// Whether the series of lengths converge up to h, for sure.
    pub(crate) fn converges_to(&self, h: f64) -> bool {
        self.equations.collinear.iter().all(|force| force.converges_to(h))
    }

    /// The motion.
    pub(crate) fn motion(&self) -> &BodyMotion {
        &self.motion
    }

    /// The coefficients of degree k of a vector of the body in world axes.
    fn turned(directions: &[(Row, Entry)], axes: Option<usize>, v: &Vector3<f64>, k: usize) -> Vector3<f64> {
        axes.map_or(Vector3::zeros(), |first| {
            Vector3::from_fn(|i, _| vector(&directions[first + i].0[k]).dot(v))
        })
    }

    /// The coefficients of degree k of the collinear forces and their torques, from those of velocity up to degree k, and of position
    /// and directions up to degree k + 1.
    fn collinear_wrench(&mut self, k: usize) -> [Entry; 2] {
        let Self { equations, motion: BodyMotion { position, velocity, .. }, directions, .. } = self;
        let axes = equations.axes;
        let [mut sum, mut torque] = [Vector3::zeros(); 2];
        for force in &mut equations.collinear {
            if k == 0 {
                (force.known, force.leading) = (0, None);
            }
            let Along::Way { centre, point } = force.along else {
                sum += force.resist(velocity, k);
                continue;
            };
            while force.known <= k + 1 {
                let n = force.known;
                let of_point =
                    point.map_or(Vector3::zeros(), |point| Self::turned(directions, axes, &point, n));
                let start = if n == 0 { centre } else { Vector3::zeros() };
                force.learn(vector(&position[n]) + of_point - start);
            }
            sum += force.pull(k);
            if let (Some(point), Some(first)) = (point, axes) {
                let mut of_body = Vector3::zeros();
                for (j, pull) in force.pulls[..=k].iter().enumerate() {
                    for i in 0..3 {
                        of_body += vector(&directions[first + i].0[k - j]) * pull[i];
                    }
                }
                torque += point.cross(&of_body);
            }
        }
        [entry(&sum), entry(&torque)]
    }
}

impl BodyMotion {
    /// Pose and twist after h, world axes.
    pub(crate) fn at(&self, h: f64) -> (Pose, Twist) {
        let [position, velocity, orientation, momentum] = run_on_quads(Sums { motion: self, h });
        let orientation = UnitQuaternion::new_normalize(Quaternion::from(Vector4::from(orientation)));
        let spin = self.velocity_of(&momentum);
        let twist = Twist { linear: vector(&velocity), angular: orientation * spin };
        (Pose { position: vector(&position), orientation }, twist)
    }

    /// The terms of a degree of a step of 1: of position and orientation, and of the velocities, each of the length that it has in any
    /// axes.
    #[inline(always)]
    pub(crate) fn terms(&self, degree: usize) -> [Twist; 2] {
        // A change of a unit quaternion is half the angle.
        let half_angle = Vector4::from(self.orientation[degree]).norm();
        [
            Twist { linear: vector(&self.position[degree]), angular: Vector3::x() * (2.0 * half_angle) },
            Twist {
                linear: vector(&self.velocity[degree]),
                angular: self.velocity_of(&self.momentum[degree]),
            },
        ]
    }

    /// I⁻¹ L.
    #[inline(always)]
    fn velocity_of(&self, momentum: &Entry) -> Vector3<f64> {
        let [x, y, z] = self.columns.each_ref().map(vector);
        x * momentum[0] + y * momentum[1] + z * momentum[2]
    }
}

#[inline(always)]
fn vector(entry: &Entry) -> Vector3<f64> {
    Vector3::new(entry[0], entry[1], entry[2])
}

/// Places for the sums of products with ω: of its first, second and third component.
const BACKWARDS: i32 = places([3, 2, 1, 0]);
const HALVES: i32 = places([2, 3, 0, 1]);
const PAIRS: i32 = places([1, 0, 3, 2]);
/// The signs there.
const SIGNS: [Entry; 3] = [[1.0, 1.0, -1.0, -1.0], [-1.0, 1.0, 1.0, -1.0], [1.0, -1.0, 1.0, -1.0]];
/// Components in turn, for cross products.
const NEXT: i32 = places([1, 2, 0, 3]);
/// One component in all of an entry.
const FIRST: i32 = places([0, 0, 0, 0]);
const SECOND: i32 = places([1, 1, 1, 1]);
const THIRD: i32 = places([2, 2, 2, 2]);

/// 1/(k+1).
const QUOTIENTS: [f64; DEGREE] = {
    let mut quotients = [0.0; DEGREE];
    let mut k = 0;
    while k < DEGREE {
        quotients[k] = 1.0 / (k + 1) as f64;
        k += 1;
    }
    quotients
};

/// Σ rowⱼ ⊗ ωₖ₋ⱼ of some rows. What was found last, the entries of degree k and the components of ω there, is given beside the rows: it
/// comes from registers, and is added last.
macro_rules! sums_with_spin {
    ($q:ident, $spin:expr, $last:expr, $k:expr; $($row:expr, $entry:expr => $sum:ident),+) => {
        let from = DEGREE - $k;
        let [x, y, z] = $spin;
        $(let mut $sum = [$q.splat(0.0); 3];)+
        for j in 1..$k {
            let (x, y, z) = ($q.load(&x[from + j]), $q.load(&y[from + j]), $q.load(&z[from + j]));
            $(sums_with_spin!(@add $q, $q.load(&$row[j]), x, y, z, $sum);)+
        }
        if $k > 0 {
            let (x, y, z) = ($q.load(&x[DEGREE]), $q.load(&y[DEGREE]), $q.load(&z[DEGREE]));
            $(sums_with_spin!(@add $q, $entry, x, y, z, $sum);)+
        }
        let [x, y, z] = $last;
        $(sums_with_spin!(@add $q, $q.load(&$row[0]), x, y, z, $sum);)+
        $(let $sum = spun($q, $sum);)+
    };
    (@add $q:ident, $entry:expr, $x:ident, $y:ident, $z:ident, $sum:ident) => {
        let entry = $entry;
        $sum[0] = $q.mul_add($x, entry, $sum[0]);
        $sum[1] = $q.mul_add($y, entry, $sum[1]);
        $sum[2] = $q.mul_add($z, entry, $sum[2]);
    };
}

/// Σ rowⱼ ⊗ ωₖ₋ⱼ, for a vector its cross product (and a fourth number), from the sums for each component of ω.
#[inline(always)]
fn spun<Q: Quad>(q: Q, [x, y, z]: [Q::Four; 3]) -> Q::Four {
    let third = q.mul(q.load(&SIGNS[2]), q.permute::<PAIRS>(z));
    let second = q.mul_add(q.load(&SIGNS[1]), q.permute::<HALVES>(y), third);
    q.mul_add(q.load(&SIGNS[0]), q.permute::<BACKWARDS>(x), second)
}

/// a × b, and zero, where the fourth number of a is.
#[inline(always)]
fn cross<Q: Quad>(q: Q, a: Q::Four, b: Q::Four) -> Q::Four {
    let turned = q.sub(q.mul(a, q.permute::<NEXT>(b)), q.mul(q.permute::<NEXT>(a), b));
    q.permute::<NEXT>(turned)
}

/// The first three numbers, each in all of an entry.
#[inline(always)]
fn spread<Q: Quad>(q: Q, a: Q::Four) -> [Q::Four; 3] {
    [q.permute::<FIRST>(a), q.permute::<SECOND>(a), q.permute::<THIRD>(a)]
}

/// The sum of four numbers, in all of an entry.
#[inline(always)]
fn total<Q: Quad>(q: Q, a: Q::Four) -> Q::Four {
    let pairs = q.add(a, q.permute::<HALVES>(a));
    q.add(pairs, q.permute::<PAIRS>(pairs))
}

/// The product of a matrix, by its columns, with a vector.
#[inline(always)]
fn product<Q: Quad>(q: Q, columns: &[Entry; 3], v: Q::Four) -> Q::Four {
    let [x, y, z] = spread(q, v);
    let third = q.mul(q.load(&columns[2]), z);
    q.mul_add(q.load(&columns[0]), x, q.mul_add(q.load(&columns[1]), y, third))
}

/// Finds all coefficients from those of degree 0.
struct Expansion<'a> {
    series: &'a mut BodySeries,
    /// ω of degree 0.
    spin: Entry,
}

impl QuadKernel for Expansion<'_> {
    type Output = ();

    #[inline(always)]
    fn run<Q: Quad>(self, q: Q) {
        let Self { series, spin } = self;
        let Equations { inverse_mass, is_diagonal, .. } = series.equations;
        let inertia = series.motion.columns;
        let has_collinear = !series.equations.collinear.is_empty();
        let moments = q.load(&[inertia[0][0], inertia[1][1], inertia[2][2], 0.0]);
        // Of degree k.
        let mut spin = q.load(&spin);
        let mut components = spread(q, spin);
        let (mut orientation, mut momentum) =
            (q.load(&series.motion.orientation[0]), q.load(&series.motion.momentum[0]));
        let mut direction = match series.directions.first() {
            Some((row, _)) => q.load(&row[0]),
            None => q.splat(0.0),
        };
        for k in 0..DEGREE {
            let quotient = QUOTIENTS[k];
            let of_vector = q.load(&[quotient, quotient, quotient, 0.0]);
            let (turned, gyroscopic);
            if let Some((first, others)) = series.directions.split_first_mut() {
                sums_with_spin!(q, &series.spin, components, k;
                    series.motion.orientation, orientation => a, series.motion.momentum, momentum => b, first.0, direction => c);
                (turned, gyroscopic) = (a, b);
                q.store(c, &mut first.1);
                direction = q.mul(c, of_vector);
                q.store(direction, &mut first.0[k + 1]);
                for (row, rate) in others {
                    sums_with_spin!(q, &series.spin, components, k; row, q.load(&row[k]) => c);
                    q.store(c, rate);
                    q.store(q.mul(c, of_vector), &mut row[k + 1]);
                }
            } else {
                sums_with_spin!(q, &series.spin, components, k;
                    series.motion.orientation, orientation => a, series.motion.momentum, momentum => b);
                (turned, gyroscopic) = (a, b);
            }
            orientation = q.mul(turned, q.splat(0.5 * quotient));
            q.store(orientation, &mut series.motion.orientation[k + 1]);
            let (position, velocity) =
                (q.load(&series.motion.position[k]), q.load(&series.motion.velocity[k]));
            q.store(q.mul(velocity, of_vector), &mut series.motion.position[k + 1]);

            let equations = &series.equations;
            let (mut force, mut torque) = (q.splat(0.0), gyroscopic);
            if k == 0 {
                force = q.load(&equations.force);
                torque = q.add(torque, q.load(&equations.torque));
            }
            if let Some([by_position, by_velocity]) = &equations.linear {
                force = q.add(force, product(q, by_position, position));
                force = q.add(force, product(q, by_velocity, velocity));
            }
            if equations.angular_drag != 0.0 {
                torque = q.mul_add(q.splat(equations.angular_drag), spin, torque);
            }
            for Moment { direction, arm } in &equations.moments {
                let d = q.load(&series.directions[*direction].0[k]);
                let moment = match arm {
                    Some(arm) => cross(q, q.load(arm), d),
                    None => d,
                };
                torque = q.add(torque, moment);
            }
            if let Some(thrust) = &equations.thrust {
                let along = BodySeries::turned(&series.directions, equations.axes, thrust, k);
                force = q.add(force, q.load(&entry(&along)));
            }
            for (plane, pushes) in equations.planes.iter().zip(&mut series.pushes) {
                let (row, rate) = &series.directions[plane.direction];
                let (arm, normal) = (q.load(&plane.arm), q.load(&plane.normal));
                let (stiffness, damping) = (q.splat(plane.stiffness), q.splat(plane.damping));
                let of_centre = q.mul_add(damping, velocity, q.mul(stiffness, position));
                let of_arm = q.mul_add(damping, q.load(rate), q.mul(stiffness, q.load(&row[k])));
                let push = total(q, q.mul_add(arm, of_arm, q.mul(normal, of_centre)));
                let preload = if k == 0 { plane.preload } else { 0.0 };
                let push = q.sub(q.splat(preload), push);
                q.store(push, &mut pushes[DEGREE - k]);
                force = q.mul_add(push, normal, force);
                let from = DEGREE - k;
                let (mut even, mut odd) = (q.splat(0.0), q.splat(0.0));
                let mut j = 1;
                while j < k {
                    even = q.mul_add(q.load(&pushes[from + j]), q.load(&row[j]), even);
                    odd = q.mul_add(q.load(&pushes[from + j + 1]), q.load(&row[j + 1]), odd);
                    j += 2;
                }
                if j == k {
                    even = q.mul_add(q.load(&pushes[DEGREE]), q.load(&row[j]), even);
                }
                let along = q.mul_add(push, q.load(&row[0]), q.add(even, odd));
                torque = q.add(torque, cross(q, arm, along));
            }
            if has_collinear {
                let [pull, moment] = series.collinear_wrench(k);
                force = q.add(force, q.load(&pull));
                torque = q.add(torque, q.load(&moment));
            }

            momentum = q.mul(torque, of_vector);
            q.store(momentum, &mut series.motion.momentum[k + 1]);
            let inverse = inverse_mass * quotient;
            q.store(q.mul(force, q.splat(inverse)), &mut series.motion.velocity[k + 1]);
            spin = if is_diagonal {
                q.mul(torque, q.mul(moments, of_vector))
            } else {
                product(q, &inertia, momentum)
            };
            components = spread(q, spin);
            for (row, component) in series.spin.iter_mut().zip(components) {
                q.store(component, &mut row[DEGREE - k - 1]);
            }
        }
    }
}

/// Position, velocity, orientation and angular momentum after h.
struct Sums<'a> {
    motion: &'a BodyMotion,
    h: f64,
}

impl QuadKernel for Sums<'_> {
    type Output = [Entry; 4];

    #[inline(always)]
    fn run<Q: Quad>(self, q: Q) -> [Entry; 4] {
        let Self { motion, h } = self;
        let h = q.splat(h);
        let (mut position, mut velocity) = (q.splat(0.0), q.splat(0.0));
        let (mut orientation, mut momentum) = (q.splat(0.0), q.splat(0.0));
        for k in (0..=DEGREE).rev() {
            position = q.mul_add(position, h, q.load(&motion.position[k]));
            velocity = q.mul_add(velocity, h, q.load(&motion.velocity[k]));
            orientation = q.mul_add(orientation, h, q.load(&motion.orientation[k]));
            momentum = q.mul_add(momentum, h, q.load(&motion.momentum[k]));
        }
        let mut sums = [[0.0; 4]; 4];
        q.store(position, &mut sums[0]);
        q.store(velocity, &mut sums[1]);
        q.store(orientation, &mut sums[2]);
        q.store(momentum, &mut sums[3]);
        sums
    }
}
