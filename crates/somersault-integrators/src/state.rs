//! Configurations on ℝᵐ × SO(3)ᵏ, the rates that move them, and states.
//!
//! A method is written once over these traits and serves one body, several bodies and whatever else
//! has a configuration of this kind. Rates are added and bracketed; configurations are moved by rates.
//! Steps write into values that exist, so that a state that lives on the heap costs no allocation.

use crate::scratch::{OnHeap, OnStack, Storage};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::lie::so3;

/// Tolerances of an adaptive step, weighed as `absolute + relative · size`.
///
/// Each three-vector (position, velocity, angular velocity) is weighed by its length, so that the
/// choice of axes does not matter; the size of an orientation is one radian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Error allowed in proportion to the size of each vector.
    pub relative: f64,
    /// Error allowed however small the vector is.
    pub absolute: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self { relative: 1e-8, absolute: 1e-10 }
    }
}

/// Sum of squared weighed errors and the number of vectors in it.
#[derive(Debug, Clone, Copy, Default)]
pub struct ErrorSum {
    /// Sum of the squares.
    pub squares: f64,
    /// How many vectors were weighed.
    pub count: usize,
}

impl ErrorSum {
    /// Adds one vector: its error against its size.
    #[inline]
    pub fn add(&mut self, error: &Vector3<f64>, size: f64, tolerances: &Tolerances) {
        let weighed = error.norm_squared() / (tolerances.absolute + tolerances.relative * size).powi(2);
        self.squares += weighed;
        self.count += 1;
    }

    /// Adds one vector by the length of its error.
    #[inline]
    pub(crate) fn add_norm(&mut self, error: f64, size: f64, tolerances: &Tolerances) {
        self.squares += (error / (tolerances.absolute + tolerances.relative * size)).powi(2);
        self.count += 1;
    }

    /// Root mean square; at most 1 where the tolerances are met.
    pub fn root_mean_square(&self) -> f64 {
        (self.squares / self.count as f64).sqrt()
    }
}

/// An element of ℝᵐ ⊕ so(3)ᵏ: a velocity, an acceleration, or a displacement in the Lie algebra.
pub trait Rate: Clone + std::fmt::Debug + Storage + Send + Sync + 'static {
    /// How many numbers it has, without those of tangents that it carries.
    fn dimension(&self) -> usize;
    /// How many tangents it carries, of as many numbers each.
    fn tangents(&self) -> usize {
        0
    }
    /// out ← its numbers, then those of each tangent; lengths must fit.
    fn write(&self, out: &mut [f64]);
    /// self ← numbers as [`write`](Self::write) gives them.
    fn read(&mut self, numbers: &[f64]);
    /// self ← other.
    fn assign(&mut self, other: &Self);
    /// self ← 0.
    fn set_zero(&mut self);
    /// self ← a self.
    fn scale(&mut self, a: f64);
    /// self ← self + a x.
    fn axpy(&mut self, a: f64, x: &Self);
    /// self ← self + Σ a x, in the order of the terms.
    #[inline]
    fn add_sum<'a>(&mut self, terms: impl Iterator<Item = (f64, &'a Self)>) {
        terms.for_each(|(a, x)| self.axpy(a, x));
    }
    /// self ← self + a \[x, y\], with \[x, y\] = (0, x × y) for a left action and (0, −x × y) for a right one.
    fn add_bracket(&mut self, a: f64, x: &Self, y: &Self);
    /// self ← dexp⁻¹_u(self).
    fn dexp_inv(&mut self, u: &Self);
    /// Largest norm of the parts in so(3): of a velocity the rate at which orientations turn, of a displacement the
    /// angle. An angle about a fixed axis is a number of ℝ and none of them.
    fn angle(&self) -> f64;
    /// Whether all components are finite.
    fn is_finite(&self) -> bool;
    /// Weighs `error` against the larger of `self` and `other`.
    fn weigh(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum);
    /// The same with every tangent carried along, which [`weigh`](Self::weigh) leaves out: for an iteration that must
    /// converge in all of them.
    fn weigh_all(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum);
}

/// A point of ℝᵐ × SO(3)ᵏ.
pub trait Configuration: Clone + std::fmt::Debug + Storage + Send + Sync + 'static {
    /// The rates that move it.
    type Rate: Rate;
    /// self ← other.
    fn assign(&mut self, other: &Self);
    /// self ← exp(h · rate) · self.
    fn drift(&mut self, rate: &Self::Rate, h: f64);
    /// The least u with self = exp(u) · from.
    fn difference(&self, from: &Self, out: &mut Self::Rate);
    /// Removes the rounding that products of unit quaternions gather.
    ///
    /// The drivers call it once after each step, for every method alike; nothing else renormalises.
    fn renormalize(&mut self);
    /// Whether all components are finite.
    fn is_finite(&self) -> bool;
    /// Weighs a displacement `error` against the size of `self` and `other`.
    fn weigh(&self, other: &Self, error: &Self::Rate, tolerances: &Tolerances, sum: &mut ErrorSum);
    /// The same with every tangent carried along, as [`Rate::weigh_all`].
    fn weigh_all(&self, other: &Self, error: &Self::Rate, tolerances: &Tolerances, sum: &mut ErrorSum);
}

/// A configuration and its rate. What `rate` stands for (velocity, or momentum) is the system's to say.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(bound(
        serialize = "Q: serde::Serialize, Q::Rate: serde::Serialize",
        deserialize = "Q: serde::Deserialize<'de>, Q::Rate: serde::Deserialize<'de>"
    ))
)]
pub struct State<Q: Configuration> {
    /// Where.
    pub configuration: Q,
    /// How it moves.
    pub rate: Q::Rate,
}

impl<Q: Configuration> State<Q> {
    /// self ← other.
    #[inline]
    pub fn assign(&mut self, other: &Self) {
        self.configuration.assign(&other.configuration);
        self.rate.assign(&other.rate);
    }

    /// Moves the configuration: exp(h · velocity) · configuration.
    #[inline]
    pub fn drift(&mut self, velocity: &Q::Rate, h: f64) {
        self.configuration.drift(velocity, h);
    }

    /// Changes the rate: rate + h · acceleration.
    #[inline]
    pub fn kick(&mut self, acceleration: &Q::Rate, h: f64) {
        self.rate.axpy(h, acceleration);
    }

    /// Whether all components are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.configuration.is_finite() && self.rate.is_finite()
    }
}

impl<Q: Configuration> Storage for State<Q> {
    type Allocation = Q::Allocation;
}

/// Linear and angular part of a velocity, an acceleration or a momentum, world frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Twist {
    /// Linear part.
    pub linear: Vector3<f64>,
    /// Angular part.
    pub angular: Vector3<f64>,
}

/// Position of the centre of mass and orientation (body frame → world frame).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "PoseParts"))]
pub struct Pose {
    /// Position of the centre of mass, m.
    pub position: Vector3<f64>,
    /// Orientation, body frame → world frame.
    pub orientation: UnitQuaternion<f64>,
}

/// A pose as files hold it.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct PoseParts {
    position: Vector3<f64>,
    orientation: UnitQuaternion<f64>,
}

#[cfg(feature = "serde")]
impl TryFrom<PoseParts> for Pose {
    type Error = &'static str;

    fn try_from(PoseParts { position, orientation }: PoseParts) -> Result<Self, Self::Error> {
        // a NaN is not within
        if (orientation.coords.norm() - 1.0).abs() <= 1e-9 {
            Ok(Self { position, orientation })
        } else {
            Err("`orientation` must be of unit norm")
        }
    }
}

/// State of one rigid body: position, orientation, velocity and angular velocity, world frame.
pub type RigidBodyState = State<Pose>;

impl RigidBodyState {
    /// A state from its four parts, all in the world frame (m, –, m/s, rad/s).
    pub fn new(
        position: Vector3<f64>,
        orientation: UnitQuaternion<f64>,
        velocity: Vector3<f64>,
        angular_velocity: Vector3<f64>,
    ) -> Self {
        Self {
            configuration: Pose { position, orientation },
            rate: Twist { linear: velocity, angular: angular_velocity },
        }
    }

    /// At the origin, body and world axes aligned, turning with `angular_velocity` (rad/s).
    pub fn spinning(angular_velocity: Vector3<f64>) -> Self {
        Self::new(Vector3::zeros(), UnitQuaternion::identity(), Vector3::zeros(), angular_velocity)
    }

    /// Position of the centre of mass, m.
    #[inline]
    pub fn position(&self) -> &Vector3<f64> {
        &self.configuration.position
    }

    /// Orientation, body frame → world frame.
    #[inline]
    pub fn orientation(&self) -> &UnitQuaternion<f64> {
        &self.configuration.orientation
    }

    /// Velocity of the centre of mass, m/s.
    #[inline]
    pub fn velocity(&self) -> &Vector3<f64> {
        &self.rate.linear
    }

    /// Angular velocity in the world frame, rad/s.
    #[inline]
    pub fn angular_velocity(&self) -> &Vector3<f64> {
        &self.rate.angular
    }
}

/// The larger of two lengths.
#[inline(always)]
fn larger(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.norm_squared().max(b.norm_squared()).sqrt()
}

/// Whether all numbers are finite: 0 · x is 0 for them and NaN for the rest, without a branch each.
#[inline(always)]
fn finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().fold(0.0, |sum, x| sum + 0.0 * x) == 0.0
}

impl Twist {
    /// The linear part and the angular one.
    #[inline(always)]
    fn numbers(&self) -> [f64; 6] {
        let (v, w) = (&self.linear, &self.angular);
        [v.x, v.y, v.z, w.x, w.y, w.z]
    }

    #[inline(always)]
    fn from_numbers(numbers: [f64; 6]) -> Self {
        let [a, b, c, d, e, f] = numbers;
        Self { linear: Vector3::new(a, b, c), angular: Vector3::new(d, e, f) }
    }
}

impl Storage for Twist {
    type Allocation = OnStack;
}

impl Rate for Twist {
    #[inline(always)]
    fn dimension(&self) -> usize {
        6
    }
    #[inline(always)]
    fn write(&self, out: &mut [f64]) {
        out[..3].copy_from_slice(self.linear.as_slice());
        out[3..].copy_from_slice(self.angular.as_slice());
    }
    #[inline(always)]
    fn read(&mut self, numbers: &[f64]) {
        self.linear.copy_from_slice(&numbers[..3]);
        self.angular.copy_from_slice(&numbers[3..]);
    }
    #[inline(always)]
    fn assign(&mut self, other: &Self) {
        *self = *other;
    }
    #[inline(always)]
    fn set_zero(&mut self) {
        *self = Self::default();
    }
    #[inline(always)]
    fn scale(&mut self, a: f64) {
        self.linear *= a;
        self.angular *= a;
    }
    #[inline(always)]
    fn axpy(&mut self, a: f64, x: &Self) {
        self.linear += x.linear * a;
        self.angular += x.angular * a;
    }
    #[inline(always)]
    fn add_sum<'a>(&mut self, terms: impl Iterator<Item = (f64, &'a Self)>) {
        // As an array by value, so that the sum stays in registers, two numbers in each.
        let mut sum = self.numbers();
        terms.for_each(|(a, x)| {
            let x = x.numbers();
            for i in 0..6 {
                sum[i] += x[i] * a;
            }
        });
        *self = Self::from_numbers(sum);
    }
    #[inline(always)]
    fn add_bracket(&mut self, a: f64, x: &Self, y: &Self) {
        self.angular += x.angular.cross(&y.angular) * a;
    }
    #[inline(always)]
    fn dexp_inv(&mut self, u: &Self) {
        self.angular = so3::dexp_inv(&u.angular, &self.angular);
    }
    #[inline(always)]
    fn angle(&self) -> f64 {
        self.angular.norm()
    }
    #[inline(always)]
    fn is_finite(&self) -> bool {
        finite(self.linear.iter().chain(&self.angular))
    }
    #[inline(always)]
    fn weigh(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        sum.add(&error.linear, larger(&self.linear, &other.linear), tolerances);
        sum.add(&error.angular, larger(&self.angular, &other.angular), tolerances);
    }
    #[inline(always)]
    fn weigh_all(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.weigh(other, error, tolerances, sum);
    }
}

impl Storage for Pose {
    type Allocation = OnStack;
}

impl Configuration for Pose {
    type Rate = Twist;
    #[inline(always)]
    fn assign(&mut self, other: &Self) {
        *self = *other;
    }
    #[inline(always)]
    fn drift(&mut self, rate: &Twist, h: f64) {
        self.position += rate.linear * h;
        self.orientation = so3::exp(&(rate.angular * h)) * self.orientation;
    }
    #[inline(always)]
    fn difference(&self, from: &Self, out: &mut Twist) {
        out.linear = self.position - from.position;
        out.angular = so3::log(&(self.orientation * from.orientation.inverse()));
    }
    #[inline(always)]
    fn renormalize(&mut self) {
        self.orientation = so3::renormalize(&self.orientation);
    }
    #[inline(always)]
    fn is_finite(&self) -> bool {
        finite(self.position.iter().chain(&self.orientation.coords))
    }
    #[inline(always)]
    fn weigh(&self, other: &Self, error: &Twist, tolerances: &Tolerances, sum: &mut ErrorSum) {
        sum.add(&error.linear, larger(&self.position, &other.position), tolerances);
        sum.add(&error.angular, 1.0, tolerances);
    }
    #[inline(always)]
    fn weigh_all(&self, other: &Self, error: &Twist, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.weigh(other, error, tolerances, sum);
    }
}

/// Marks a pose or twist whose rotational part is taken in the body frame: R' = R ω̂, so that rates
/// act from the right and brackets change sign. Positions and velocities stay in the world frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct InBody<T>(pub T);

impl Storage for InBody<Twist> {
    type Allocation = OnStack;
}

impl Rate for InBody<Twist> {
    #[inline(always)]
    fn dimension(&self) -> usize {
        self.0.dimension()
    }
    #[inline(always)]
    fn write(&self, out: &mut [f64]) {
        self.0.write(out);
    }
    #[inline(always)]
    fn read(&mut self, numbers: &[f64]) {
        self.0.read(numbers);
    }
    #[inline(always)]
    fn assign(&mut self, other: &Self) {
        *self = *other;
    }
    #[inline(always)]
    fn set_zero(&mut self) {
        self.0.set_zero();
    }
    #[inline(always)]
    fn scale(&mut self, a: f64) {
        self.0.scale(a);
    }
    #[inline(always)]
    fn axpy(&mut self, a: f64, x: &Self) {
        self.0.axpy(a, &x.0);
    }
    #[inline(always)]
    fn add_sum<'a>(&mut self, terms: impl Iterator<Item = (f64, &'a Self)>) {
        self.0.add_sum(terms.map(|(a, x)| (a, &x.0)));
    }
    #[inline(always)]
    fn add_bracket(&mut self, a: f64, x: &Self, y: &Self) {
        self.0.add_bracket(-a, &x.0, &y.0);
    }
    #[inline(always)]
    fn dexp_inv(&mut self, u: &Self) {
        self.0.angular = so3::dexp_inv(&-u.0.angular, &self.0.angular);
    }
    #[inline(always)]
    fn angle(&self) -> f64 {
        self.0.angle()
    }
    #[inline(always)]
    fn is_finite(&self) -> bool {
        self.0.is_finite()
    }
    #[inline(always)]
    fn weigh(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.0.weigh(&other.0, &error.0, tolerances, sum);
    }
    #[inline(always)]
    fn weigh_all(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.0.weigh_all(&other.0, &error.0, tolerances, sum);
    }
}

impl Storage for InBody<Pose> {
    type Allocation = OnStack;
}

impl Configuration for InBody<Pose> {
    type Rate = InBody<Twist>;
    #[inline(always)]
    fn assign(&mut self, other: &Self) {
        *self = *other;
    }
    #[inline(always)]
    fn drift(&mut self, rate: &InBody<Twist>, h: f64) {
        self.0.position += rate.0.linear * h;
        self.0.orientation *= so3::exp(&(rate.0.angular * h));
    }
    #[inline(always)]
    fn difference(&self, from: &Self, out: &mut InBody<Twist>) {
        out.0.linear = self.0.position - from.0.position;
        out.0.angular = so3::log(&(from.0.orientation.inverse() * self.0.orientation));
    }
    #[inline(always)]
    fn renormalize(&mut self) {
        self.0.renormalize();
    }
    #[inline(always)]
    fn is_finite(&self) -> bool {
        self.0.is_finite()
    }
    #[inline(always)]
    fn weigh(&self, other: &Self, error: &InBody<Twist>, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.0.weigh(&other.0, &error.0, tolerances, sum);
    }
    #[inline(always)]
    fn weigh_all(&self, other: &Self, error: &InBody<Twist>, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.0.weigh_all(&other.0, &error.0, tolerances, sum);
    }
}

impl<T: Storage> Storage for Vec<T> {
    type Allocation = OnHeap;
}

impl<V: Rate> Rate for Vec<V> {
    fn dimension(&self) -> usize {
        self.iter().map(V::dimension).sum()
    }
    fn write(&self, mut out: &mut [f64]) {
        for part in self {
            let (own, rest) = out.split_at_mut(part.dimension());
            part.write(own);
            out = rest;
        }
    }
    fn read(&mut self, mut numbers: &[f64]) {
        for part in self {
            let (own, rest) = numbers.split_at(part.dimension());
            part.read(own);
            numbers = rest;
        }
    }
    fn assign(&mut self, other: &Self) {
        self.iter_mut().zip(other).for_each(|(a, b)| a.assign(b));
    }
    fn set_zero(&mut self) {
        self.iter_mut().for_each(V::set_zero);
    }
    fn scale(&mut self, a: f64) {
        self.iter_mut().for_each(|s| s.scale(a));
    }
    fn axpy(&mut self, a: f64, x: &Self) {
        self.iter_mut().zip(x).for_each(|(s, x)| s.axpy(a, x));
    }
    fn add_bracket(&mut self, a: f64, x: &Self, y: &Self) {
        self.iter_mut().zip(x).zip(y).for_each(|((s, x), y)| s.add_bracket(a, x, y));
    }
    fn dexp_inv(&mut self, u: &Self) {
        self.iter_mut().zip(u).for_each(|(s, u)| s.dexp_inv(u));
    }
    fn angle(&self) -> f64 {
        self.iter().map(V::angle).fold(0.0, f64::max)
    }
    fn is_finite(&self) -> bool {
        self.iter().all(V::is_finite)
    }
    fn weigh(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.iter().zip(other).zip(error).for_each(|((s, o), e)| s.weigh(o, e, tolerances, sum));
    }
    fn weigh_all(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.iter().zip(other).zip(error).for_each(|((s, o), e)| s.weigh_all(o, e, tolerances, sum));
    }
}

impl<C: Configuration> Configuration for Vec<C> {
    type Rate = Vec<C::Rate>;
    fn assign(&mut self, other: &Self) {
        self.iter_mut().zip(other).for_each(|(a, b)| a.assign(b));
    }
    fn drift(&mut self, rate: &Self::Rate, h: f64) {
        self.iter_mut().zip(rate).for_each(|(q, v)| q.drift(v, h));
    }
    fn difference(&self, from: &Self, out: &mut Self::Rate) {
        self.iter().zip(from).zip(out).for_each(|((a, b), d)| a.difference(b, d));
    }
    fn renormalize(&mut self) {
        self.iter_mut().for_each(C::renormalize);
    }
    fn is_finite(&self) -> bool {
        self.iter().all(C::is_finite)
    }
    fn weigh(&self, other: &Self, error: &Self::Rate, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.iter().zip(other).zip(error).for_each(|((s, o), e)| s.weigh(o, e, tolerances, sum));
    }
    fn weigh_all(&self, other: &Self, error: &Self::Rate, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.iter().zip(other).zip(error).for_each(|((s, o), e)| s.weigh_all(o, e, tolerances, sum));
    }
}

/// State of several rigid bodies.
pub type RigidBodiesState = State<Vec<Pose>>;

impl RigidBodiesState {
    /// The states of several bodies as one state.
    pub fn from_bodies(states: &[RigidBodyState]) -> Self {
        Self {
            configuration: states.iter().map(|s| s.configuration).collect(),
            rate: states.iter().map(|s| s.rate).collect(),
        }
    }

    /// The state of body `i`, if there is one.
    pub fn body(&self, i: usize) -> Option<RigidBodyState> {
        Some(State { configuration: *self.configuration.get(i)?, rate: *self.rate.get(i)? })
    }
}

/// Configurations made of rigid-body poses: one body or several.
///
/// Bodies are read and written by value, since a pose and a twist are a dozen numbers.
pub trait Poses: Configuration {
    /// The same bodies with body-frame rotation rates.
    type InBodyFrame: Poses;
    /// How many bodies.
    fn count(&self) -> usize;
    /// The pose of body `i < count()`.
    fn pose(&self, i: usize) -> Pose;
    /// Sets the pose of body `i < count()`.
    fn set_pose(&mut self, i: usize, pose: Pose);
    /// The rate of body `i`.
    fn twist(rate: &Self::Rate, i: usize) -> Twist;
    /// Sets the rate of body `i`.
    fn set_twist(rate: &mut Self::Rate, i: usize, twist: Twist);
    /// The same poses, to be moved by body-frame rates, and the same variables; the rates of the bodies zero.
    fn in_body_frame(x: &State<Self>) -> State<Self::InBodyFrame>;
    /// The variables of first order beside all bodies; see [`augmented`](crate::augmented).
    fn variables(rate: &Self::Rate) -> &[Vector3<f64>];
    /// The same, to be changed.
    fn variables_mut(rate: &mut Self::Rate) -> &mut [Vector3<f64>];
}

impl Poses for Pose {
    type InBodyFrame = InBody<Pose>;
    #[inline]
    fn count(&self) -> usize {
        1
    }
    #[inline]
    fn pose(&self, _: usize) -> Pose {
        *self
    }
    #[inline]
    fn set_pose(&mut self, _: usize, pose: Pose) {
        *self = pose;
    }
    #[inline]
    fn twist(rate: &Twist, _: usize) -> Twist {
        *rate
    }
    #[inline]
    fn set_twist(rate: &mut Twist, _: usize, twist: Twist) {
        *rate = twist;
    }
    #[inline]
    fn in_body_frame(x: &State<Self>) -> State<InBody<Pose>> {
        State { configuration: InBody(x.configuration), rate: InBody::default() }
    }
    #[inline]
    fn variables(_: &Self::Rate) -> &[Vector3<f64>] {
        &[]
    }
    #[inline]
    fn variables_mut(_: &mut Self::Rate) -> &mut [Vector3<f64>] {
        &mut []
    }
}

impl Poses for InBody<Pose> {
    type InBodyFrame = Self;
    #[inline]
    fn count(&self) -> usize {
        1
    }
    #[inline]
    fn pose(&self, _: usize) -> Pose {
        self.0
    }
    #[inline]
    fn set_pose(&mut self, _: usize, pose: Pose) {
        self.0 = pose;
    }
    #[inline]
    fn twist(rate: &InBody<Twist>, _: usize) -> Twist {
        rate.0
    }
    #[inline]
    fn set_twist(rate: &mut InBody<Twist>, _: usize, twist: Twist) {
        rate.0 = twist;
    }
    #[inline]
    fn in_body_frame(x: &State<Self>) -> State<Self> {
        State { configuration: x.configuration, rate: InBody::default() }
    }
    #[inline]
    fn variables(_: &Self::Rate) -> &[Vector3<f64>] {
        &[]
    }
    #[inline]
    fn variables_mut(_: &mut Self::Rate) -> &mut [Vector3<f64>] {
        &mut []
    }
}

impl<C: Poses> Poses for Vec<C> {
    type InBodyFrame = Vec<C::InBodyFrame>;
    fn count(&self) -> usize {
        self.len()
    }
    fn pose(&self, i: usize) -> Pose {
        self[i].pose(0)
    }
    fn set_pose(&mut self, i: usize, pose: Pose) {
        self[i].set_pose(0, pose);
    }
    fn twist(rate: &Self::Rate, i: usize) -> Twist {
        C::twist(&rate[i], 0)
    }
    fn set_twist(rate: &mut Self::Rate, i: usize, twist: Twist) {
        C::set_twist(&mut rate[i], 0, twist);
    }
    fn in_body_frame(x: &State<Self>) -> State<Self::InBodyFrame> {
        let bodies = x.configuration.iter().zip(&x.rate);
        let (configuration, rate) = bodies
            .map(|(configuration, rate)| {
                let x = State { configuration: configuration.clone(), rate: rate.clone() };
                let s = C::in_body_frame(&x);
                (s.configuration, s.rate)
            })
            .unzip();
        State { configuration, rate }
    }
    #[inline]
    fn variables(_: &Self::Rate) -> &[Vector3<f64>] {
        &[]
    }
    #[inline]
    fn variables_mut(_: &mut Self::Rate) -> &mut [Vector3<f64>] {
        &mut []
    }
}
