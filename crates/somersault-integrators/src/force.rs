//! Forces and torques on rigid bodies.

mod central;
mod scheduled;
mod several;
mod wrench;

pub use central::CentralGravity;
pub use scheduled::ScheduledTorque;
pub use several::{StatesInLanes, WrenchesInLanes};
pub(crate) use several::{add_by_times, add_one_by_one};
pub use wrench::Wrench;

use crate::body::RigidBody;
use crate::series::WrenchTerm;
use crate::state::{RigidBodyState, Twist};
use crate::variation::{Tangent, central_difference};
use nalgebra::{Matrix3, Vector3};
use somersault_core::interval::nearest;
use std::ops::Add;

/// States that a body may reach: in any orientation, and no farther, faster or more quickly turning than this.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Where the displacement is counted from, m.
    pub position: Vector3<f64>,
    /// Most that the centre of mass is displaced, m.
    pub displacement: f64,
    /// Largest speed of the centre of mass, m/s.
    pub speed: f64,
    /// Largest angular speed, rad/s.
    pub spin: f64,
}

/// Upper bounds of the magnitudes of a force (N) and of a torque about the centre of mass (N m).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WrenchBound {
    /// Of the force, N.
    pub force: f64,
    /// Of the torque, N m.
    pub torque: f64,
}

impl Add for WrenchBound {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { force: self.force + other.force, torque: self.torque + other.torque }
    }
}

/// A model of the force and torque on one body.
///
/// `()` is the free body, a pair of models their sum, and a closure
/// `Fn(f64, &RigidBody, &RigidBodyState) -> Wrench` is a model.
pub trait ForceModel {
    /// Wrench on `body` in state `x` at time `t`.
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench;

    /// Whether the wrench is always zero.
    fn is_free(&self) -> bool {
        false
    }

    /// Whether the torque about the centre of mass is always zero.
    fn is_torque_free(&self) -> bool {
        self.is_free()
    }

    /// Whether the wrench may depend on velocity or angular velocity.
    ///
    /// Splitting methods take one evaluation a kick where it does not.
    fn depends_on_velocity(&self) -> bool {
        !self.is_free()
    }

    /// Upper bounds of the wrench at all times and in all states of `reach`; `None` where none is known.
    ///
    /// With them a flight is proved clear of contacts; without them the accelerations during a step are
    /// estimated from the states at its ends. Models of this module have bounds, a closure has none.
    fn bound(&self, _body: &RigidBody, _reach: &Reach) -> Option<WrenchBound> {
        self.is_free().then(WrenchBound::default)
    }

    /// An energy (J) that falls by at least the work of the wrench, so that its sum with the kinetic energy
    /// never grows: the potential of a force that has one, zero for one that only dissipates. `None` where
    /// the wrench may drive the body, or nothing is known.
    fn potential(&self, _body: &RigidBody, _x: &RigidBodyState) -> Option<f64> {
        self.is_free().then_some(0.0)
    }

    /// Adds terms whose sum is the wrench at all times and in all states, for methods that use its Taylor series, and returns true;
    /// false, as by default, where no such terms are known.
    fn add_terms(&self, _body: &RigidBody, _terms: &mut Vec<WrenchTerm>) -> bool {
        self.is_free()
    }

    /// Adds the wrenches on several bodies, for batches: by default [`wrench`](Self::wrench) of each, which a model may make quicker with
    /// vector instructions or with what bodies have in common.
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        add_one_by_one(self, on, sums);
    }

    /// The first time on the way from `t` to `end`, which may be earlier, at which the wrench is not smooth in time; by default `None`: it is
    /// smooth in between. Adapted steps end at that time, and so do all steps of runs that locate events.
    fn next_stop(&self, _t: f64, _end: f64) -> Option<f64> {
        None
    }

    /// Derivative of the wrench along a tangent to the state.
    ///
    /// By default a central difference, good to about 1e-10 of the wrench where it is smooth on the scale of
    /// the state; models of this module have it in closed form.
    fn wrench_variation(
        &self,
        t: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        central_difference(x, along, |moved| self.wrench(t, body, moved))
    }

    /// Derivative of the wrench with respect to the mass of the body, 1/kg of a wrench.
    ///
    /// By default a central difference, exact but for rounding where the wrench is linear in the mass.
    fn mass_derivative(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        let step = 6e-6 * body.mass();
        let at = |mass: f64| self.wrench(t, &body.with_mass(mass), x);
        (at(body.mass() + step) - at(body.mass() - step)) * (0.5 / step)
    }
}

/// Derivative of the wrench with respect to a factor on the inertia of the body, at 1: by a central difference, exact but for
/// rounding where the wrench is linear in the inertia. NaN where there is no body of an inertia so near.
pub fn inertia_scale_derivative(
    force: &(impl ForceModel + ?Sized),
    t: f64,
    body: &RigidBody,
    x: &RigidBodyState,
) -> Wrench {
    const STEP: f64 = 6e-6;
    if force.is_free() {
        return Wrench::default();
    }
    let at = |factor| body.with_inertia_scaled(factor).map(|body| force.wrench(t, &body, x));
    match (at(1.0 + STEP), at(1.0 - STEP)) {
        (Ok(more), Ok(less)) => (more - less) * (0.5 / STEP),
        _ => Wrench::default() * f64::NAN,
    }
}

impl ForceModel for () {
    #[inline]
    fn wrench(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
    #[inline]
    fn is_free(&self) -> bool {
        true
    }
    #[inline]
    fn wrench_variation(&self, _: f64, _: &RigidBody, _: &RigidBodyState, _: &Tangent<Twist>) -> Wrench {
        Wrench::default()
    }
    #[inline]
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}

impl<F> ForceModel for F
where
    F: Fn(f64, &RigidBody, &RigidBodyState) -> Wrench,
{
    #[inline]
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self(t, body, x)
    }
}

#[deny(clippy::missing_trait_methods)]
impl<A: ForceModel, B: ForceModel> ForceModel for (A, B) {
    #[inline]
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.0.wrench(t, body, x) + self.1.wrench(t, body, x)
    }
    #[inline]
    fn is_free(&self) -> bool {
        self.0.is_free() && self.1.is_free()
    }
    #[inline]
    fn is_torque_free(&self) -> bool {
        self.0.is_torque_free() && self.1.is_torque_free()
    }
    #[inline]
    fn depends_on_velocity(&self) -> bool {
        self.0.depends_on_velocity() || self.1.depends_on_velocity()
    }
    #[inline]
    fn bound(&self, body: &RigidBody, reach: &Reach) -> Option<WrenchBound> {
        Some(self.0.bound(body, reach)? + self.1.bound(body, reach)?)
    }
    #[inline]
    fn potential(&self, body: &RigidBody, x: &RigidBodyState) -> Option<f64> {
        Some(self.0.potential(body, x)? + self.1.potential(body, x)?)
    }
    fn add_terms(&self, body: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        self.0.add_terms(body, terms) && self.1.add_terms(body, terms)
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        self.0.add_in_lanes(on, sums);
        self.1.add_in_lanes(on, sums);
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        nearest(t, [self.0.next_stop(t, end), self.1.next_stop(t, end)])
    }
    #[inline]
    fn wrench_variation(
        &self,
        t: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        self.0.wrench_variation(t, body, x, along) + self.1.wrench_variation(t, body, x, along)
    }
    #[inline]
    fn mass_derivative(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.0.mass_derivative(t, body, x) + self.1.mass_derivative(t, body, x)
    }
}

/// A boxed model, for choices made at run time.
pub type BoxedForce = Box<dyn ForceModel + Send + Sync>;

#[deny(clippy::missing_trait_methods)]
impl ForceModel for BoxedForce {
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        (**self).wrench(t, body, x)
    }
    fn is_free(&self) -> bool {
        (**self).is_free()
    }
    fn is_torque_free(&self) -> bool {
        (**self).is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        (**self).depends_on_velocity()
    }
    fn bound(&self, body: &RigidBody, reach: &Reach) -> Option<WrenchBound> {
        (**self).bound(body, reach)
    }
    fn potential(&self, body: &RigidBody, x: &RigidBodyState) -> Option<f64> {
        (**self).potential(body, x)
    }
    fn add_terms(&self, body: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        (**self).add_terms(body, terms)
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        (**self).add_in_lanes(on, sums);
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        (**self).next_stop(t, end)
    }
    fn wrench_variation(
        &self,
        t: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        (**self).wrench_variation(t, body, x, along)
    }
    fn mass_derivative(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        (**self).mass_derivative(t, body, x)
    }
}

/// The sum of the models in the list; an empty list is the free body.
#[deny(clippy::missing_trait_methods)]
impl ForceModel for Vec<BoxedForce> {
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.iter().fold(Wrench::default(), |sum, f| sum + f.wrench(t, body, x))
    }
    fn is_free(&self) -> bool {
        self.iter().all(ForceModel::is_free)
    }
    fn is_torque_free(&self) -> bool {
        self.iter().all(ForceModel::is_torque_free)
    }
    fn depends_on_velocity(&self) -> bool {
        self.iter().any(ForceModel::depends_on_velocity)
    }
    fn bound(&self, body: &RigidBody, reach: &Reach) -> Option<WrenchBound> {
        self.iter().try_fold(WrenchBound::default(), |sum, f| Some(sum + f.bound(body, reach)?))
    }
    fn potential(&self, body: &RigidBody, x: &RigidBodyState) -> Option<f64> {
        self.iter().map(|f| f.potential(body, x)).sum()
    }
    fn add_terms(&self, body: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        self.iter().all(|f| f.add_terms(body, terms))
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        self.iter().for_each(|f| f.add_in_lanes(on, sums));
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        nearest(t, self.iter().map(|f| f.next_stop(t, end)))
    }
    fn wrench_variation(
        &self,
        t: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        self.iter().fold(Wrench::default(), |sum, f| sum + f.wrench_variation(t, body, x, along))
    }
    fn mass_derivative(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.iter().fold(Wrench::default(), |sum, f| sum + f.mass_derivative(t, body, x))
    }
}

/// Uniform gravity: F = m g.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gravity {
    /// Acceleration, m/s².
    pub acceleration: Vector3<f64>,
}

impl Gravity {
    /// 9.81 m/s² along −z, the value the thesis' examples use.
    pub fn earth() -> Self {
        Self { acceleration: Vector3::new(0.0, 0.0, -9.81) }
    }
}

impl ForceModel for Gravity {
    #[inline]
    fn wrench(&self, _: f64, body: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench { force: self.acceleration * body.mass(), torque: Vector3::zeros() }
    }
    fn is_torque_free(&self) -> bool {
        true
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
    #[inline]
    fn bound(&self, body: &RigidBody, _: &Reach) -> Option<WrenchBound> {
        Some(WrenchBound { force: body.mass() * self.acceleration.norm(), torque: 0.0 })
    }
    #[inline]
    fn potential(&self, body: &RigidBody, x: &RigidBodyState) -> Option<f64> {
        Some(-body.mass() * self.acceleration.dot(x.position()))
    }
    #[inline]
    fn wrench_variation(&self, _: f64, _: &RigidBody, _: &RigidBodyState, _: &Tangent<Twist>) -> Wrench {
        Wrench::default()
    }
    fn add_terms(&self, body: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        terms.push(WrenchTerm::Force(self.acceleration * body.mass()));
        true
    }
    #[inline]
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench { force: self.acceleration, torque: Vector3::zeros() }
    }
}

/// Linear spring and damper between a point fixed on the body and an anchor fixed in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spring {
    /// Fixed end, world frame, m.
    pub anchor: Vector3<f64>,
    /// End on the body, body frame, m.
    pub attachment: Vector3<f64>,
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Damping along the spring, N s/m.
    pub damping: f64,
    /// Length without force, m; with zero the force is linear in the position.
    pub rest_length: f64,
}

impl ForceModel for Spring {
    fn wrench(&self, _: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        let arm = x.orientation() * self.attachment;
        let point = x.position() + arm;
        let span = point - self.anchor;
        let length = span.norm();
        let velocity = x.velocity() + x.angular_velocity().cross(&arm);
        // At zero length the direction is undefined; a spring of rest length zero has no need of it.
        let mut force = -self.stiffness * span;
        if length > 0.0 {
            let direction = span / length;
            force +=
                direction * (self.stiffness * self.rest_length - self.damping * direction.dot(&velocity));
        }
        Wrench::at_point(force, &point, x.position())
    }
    fn is_torque_free(&self) -> bool {
        self.attachment == Vector3::zeros()
    }
    fn depends_on_velocity(&self) -> bool {
        self.damping != 0.0
    }
    fn bound(&self, _: &RigidBody, reach: &Reach) -> Option<WrenchBound> {
        let lever = self.attachment.norm();
        let span = (reach.position - self.anchor).norm() + reach.displacement + lever;
        let stretch = span + self.rest_length.abs();
        let force = self.stiffness.abs() * stretch + self.damping.abs() * (reach.speed + reach.spin * lever);
        Some(WrenchBound { force, torque: lever * force })
    }
    fn potential(&self, _: &RigidBody, x: &RigidBodyState) -> Option<f64> {
        let length = (x.position() + x.orientation() * self.attachment - self.anchor).norm();
        let stretch = length - self.rest_length;
        (self.damping >= 0.0).then_some(0.5 * self.stiffness * stretch * stretch)
    }
    fn wrench_variation(&self, _: f64, _: &RigidBody, x: &RigidBodyState, along: &Tangent<Twist>) -> Wrench {
        let arm = x.orientation() * self.attachment;
        let span = x.position() + arm - self.anchor;
        let length = span.norm();
        let velocity = x.velocity() + x.angular_velocity().cross(&arm);
        let arm_change = along.displacement.angular.cross(&arm);
        let span_change = along.displacement.linear + arm_change;
        let velocity_change =
            along.rate.linear + along.rate.angular.cross(&arm) + x.angular_velocity().cross(&arm_change);
        let mut force = -self.stiffness * span;
        let mut force_change = -self.stiffness * span_change;
        if length > 0.0 {
            let direction = span / length;
            let turn = (span_change - direction * direction.dot(&span_change)) / length;
            let along_spring = self.stiffness * self.rest_length - self.damping * direction.dot(&velocity);
            force += direction * along_spring;
            force_change += turn * along_spring
                - direction * (self.damping * (turn.dot(&velocity) + direction.dot(&velocity_change)));
        }
        Wrench { force: force_change, torque: arm_change.cross(&force) + arm.cross(&force_change) }
    }
    fn add_terms(&self, _: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        let Self { anchor: centre, attachment: point, stiffness, damping, rest_length } = *self;
        let mut add = |strength: f64, power, is_damper| {
            if strength != 0.0 {
                terms.push(WrenchTerm::CentralForce { centre, point, strength, power, is_damper });
            }
        };
        add(-stiffness, 0.0, false);
        add(stiffness * rest_length, -1.0, false);
        add(-damping, -2.0, true);
        true
    }
    #[inline]
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}

/// Drag linear and quadratic in the speed, and linear in the angular velocity:
/// F = −(c₁ + c₂‖v‖) v, M = −c_ω ω.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drag {
    /// c₁, N s/m.
    pub linear: f64,
    /// c₂, N s²/m².
    pub quadratic: f64,
    /// c_ω, N m s.
    pub angular: f64,
}

impl ForceModel for Drag {
    #[inline]
    fn wrench(&self, _: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        let speed = x.velocity().norm();
        Wrench {
            force: x.velocity() * -(self.linear + self.quadratic * speed),
            torque: x.angular_velocity() * -self.angular,
        }
    }
    fn is_torque_free(&self) -> bool {
        self.angular == 0.0
    }
    fn bound(&self, _: &RigidBody, reach: &Reach) -> Option<WrenchBound> {
        let force = (self.linear.abs() + self.quadratic.abs() * reach.speed) * reach.speed;
        Some(WrenchBound { force, torque: self.angular.abs() * reach.spin })
    }
    fn potential(&self, _: &RigidBody, _: &RigidBodyState) -> Option<f64> {
        let dissipates = self.linear >= 0.0 && self.quadratic >= 0.0 && self.angular >= 0.0;
        dissipates.then_some(0.0)
    }
    fn wrench_variation(&self, _: f64, _: &RigidBody, x: &RigidBodyState, along: &Tangent<Twist>) -> Wrench {
        let (velocity, change) = (x.velocity(), &along.rate.linear);
        let speed = velocity.norm();
        // At rest the quadratic part has the derivative zero.
        let speed_change = if speed > 0.0 { velocity.dot(change) / speed } else { 0.0 };
        Wrench {
            force: -change * (self.linear + self.quadratic * speed)
                - velocity * (self.quadratic * speed_change),
            torque: along.rate.angular * -self.angular,
        }
    }
    fn add_terms(&self, _: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        terms.push(WrenchTerm::LinearForce {
            position: Matrix3::zeros(),
            velocity: Matrix3::from_diagonal_element(-self.linear),
        });
        terms.push(WrenchTerm::AngularDrag(-self.angular));
        if self.quadratic != 0.0 {
            terms.push(WrenchTerm::QuadraticDrag(-self.quadratic));
        }
        true
    }
    #[inline]
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}

/// A constant torque fixed in the world or in the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ConstantTorque {
    /// World frame, N m.
    World(Vector3<f64>),
    /// Body frame, N m.
    Body(Vector3<f64>),
}

impl ForceModel for ConstantTorque {
    #[inline]
    fn wrench(&self, _: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        let torque = match self {
            Self::World(torque) => *torque,
            Self::Body(torque) => x.orientation() * torque,
        };
        Wrench { force: Vector3::zeros(), torque }
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
    fn bound(&self, _: &RigidBody, _: &Reach) -> Option<WrenchBound> {
        let (Self::World(torque) | Self::Body(torque)) = self;
        Some(WrenchBound { force: 0.0, torque: torque.norm() })
    }
    #[inline]
    fn wrench_variation(&self, _: f64, _: &RigidBody, x: &RigidBodyState, along: &Tangent<Twist>) -> Wrench {
        let torque = match self {
            Self::World(_) => Vector3::zeros(),
            Self::Body(torque) => along.displacement.angular.cross(&(x.orientation() * torque)),
        };
        Wrench { force: Vector3::zeros(), torque }
    }
    fn add_terms(&self, _: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        terms.push(match self {
            Self::World(torque) => WrenchTerm::WorldTorque(*torque),
            Self::Body(torque) => WrenchTerm::Torque(*torque),
        });
        true
    }
    #[inline]
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}

/// A constant force, fixed in the world, at a point of the body: a thruster held in space, or the
/// weight of a heavy top about its tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConstantForce {
    /// Force, world frame, N.
    pub force: Vector3<f64>,
    /// Point of action, body frame, m.
    pub point: Vector3<f64>,
}

impl ForceModel for ConstantForce {
    #[inline]
    fn wrench(&self, _: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        Wrench { force: self.force, torque: (x.orientation() * self.point).cross(&self.force) }
    }
    fn is_torque_free(&self) -> bool {
        self.point == Vector3::zeros()
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
    fn bound(&self, _: &RigidBody, _: &Reach) -> Option<WrenchBound> {
        let force = self.force.norm();
        Some(WrenchBound { force, torque: self.point.norm() * force })
    }
    fn potential(&self, _: &RigidBody, x: &RigidBodyState) -> Option<f64> {
        Some(-self.force.dot(&(x.position() + x.orientation() * self.point)))
    }
    #[inline]
    fn wrench_variation(&self, _: f64, _: &RigidBody, x: &RigidBodyState, along: &Tangent<Twist>) -> Wrench {
        let arm_change = along.displacement.angular.cross(&(x.orientation() * self.point));
        Wrench { force: Vector3::zeros(), torque: arm_change.cross(&self.force) }
    }
    fn add_terms(&self, _: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        terms.push(WrenchTerm::ForceAtPoint { force: self.force, point: self.point });
        true
    }
    #[inline]
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}
