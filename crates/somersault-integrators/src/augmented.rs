//! Variables of first order beside bodies.
//!
//! Some forces have a state of their own, say the stretch ξ of a spring that slides, with an equation of first
//! order, ξ̇ = f(t, q, p, ξ). An [`Augmented`] configuration is the configuration of the bodies; its rate holds
//! the variables beside the rate of the bodies, and the wrenches hold their derivatives beside forces and
//! torques. Methods advance them as they advance velocities, with the same weights at the same stages, so that
//! they have the order that the method has for velocities under forces that depend on them.

use crate::scratch::{OnHeap, Storage};
use crate::state::{Configuration, ErrorSum, Poses, Rate, State, Tolerances};
use nalgebra::Vector3;

/// A configuration whose rate has variables of first order beside it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Augmented<Q>(pub Q);

/// A rate and variables of first order; as a slope, their derivatives. As a velocity its variables mean nothing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AugmentedRate<V> {
    /// The rate of the bodies.
    pub base: V,
    /// The variables, three numbers each.
    pub variables: Vec<Vector3<f64>>,
}

impl<Q: Configuration> State<Augmented<Q>> {
    /// A state with variables beside it.
    pub fn augmented(base: State<Q>, variables: Vec<Vector3<f64>>) -> Self {
        Self {
            configuration: Augmented(base.configuration),
            rate: AugmentedRate { base: base.rate, variables },
        }
    }

    /// The state without its variables.
    pub fn base(&self) -> State<Q> {
        State { configuration: self.configuration.0.clone(), rate: self.rate.base.clone() }
    }

    /// The variables.
    pub fn variables(&self) -> &[Vector3<f64>] {
        &self.rate.variables
    }
}

impl<Q> Storage for Augmented<Q> {
    type Allocation = OnHeap;
}

impl<V> Storage for AugmentedRate<V> {
    type Allocation = OnHeap;
}

impl<V: Rate> Rate for AugmentedRate<V> {
    fn dimension(&self) -> usize {
        self.base.dimension() + 3 * self.variables.len()
    }
    fn write(&self, out: &mut [f64]) {
        let (base, variables) = out.split_at_mut(self.base.dimension());
        self.base.write(base);
        variables.chunks_exact_mut(3).zip(&self.variables).for_each(|(x, s)| x.copy_from_slice(s.as_slice()));
    }
    fn read(&mut self, numbers: &[f64]) {
        let (base, variables) = numbers.split_at(self.base.dimension());
        self.base.read(base);
        variables.chunks_exact(3).zip(&mut self.variables).for_each(|(x, s)| s.copy_from_slice(x));
    }
    #[inline]
    fn assign(&mut self, other: &Self) {
        self.base.assign(&other.base);
        self.variables.copy_from_slice(&other.variables);
    }
    #[inline]
    fn set_zero(&mut self) {
        self.base.set_zero();
        self.variables.fill(Vector3::zeros());
    }
    #[inline]
    fn scale(&mut self, a: f64) {
        self.base.scale(a);
        self.variables.iter_mut().for_each(|s| *s *= a);
    }
    #[inline]
    fn axpy(&mut self, a: f64, x: &Self) {
        self.base.axpy(a, &x.base);
        self.variables.iter_mut().zip(&x.variables).for_each(|(s, x)| *s += x * a);
    }
    #[inline]
    fn add_bracket(&mut self, a: f64, x: &Self, y: &Self) {
        self.base.add_bracket(a, &x.base, &y.base);
    }
    #[inline]
    fn dexp_inv(&mut self, u: &Self) {
        self.base.dexp_inv(&u.base);
    }
    /// Of the base: variables are of ℝᵐ.
    #[inline]
    fn angle(&self) -> f64 {
        self.base.angle()
    }
    #[inline]
    fn is_finite(&self) -> bool {
        self.base.is_finite() && self.variables.iter().flatten().all(|x| x.is_finite())
    }
    /// Weighs the variables together, as one vector.
    fn weigh(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.base.weigh(&other.base, &error.base, tolerances, sum);
        self.weigh_variables(other, error, tolerances, sum);
    }
    fn weigh_all(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.base.weigh_all(&other.base, &error.base, tolerances, sum);
        self.weigh_variables(other, error, tolerances, sum);
    }
}

impl<V> AugmentedRate<V> {
    fn weigh_variables(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        let norm =
            |variables: &[Vector3<f64>]| variables.iter().map(Vector3::norm_squared).sum::<f64>().sqrt();
        if !self.variables.is_empty() {
            let size = norm(&self.variables).max(norm(&other.variables));
            sum.add_norm(norm(&error.variables), size, tolerances);
        }
    }
}

impl<Q: Configuration> Configuration for Augmented<Q> {
    type Rate = AugmentedRate<Q::Rate>;
    #[inline]
    fn assign(&mut self, other: &Self) {
        self.0.assign(&other.0);
    }
    #[inline]
    fn drift(&mut self, rate: &Self::Rate, h: f64) {
        self.0.drift(&rate.base, h);
    }
    #[inline]
    fn difference(&self, from: &Self, out: &mut Self::Rate) {
        self.0.difference(&from.0, &mut out.base);
        out.variables.fill(Vector3::zeros());
    }
    fn renormalize(&mut self) {
        self.0.renormalize();
    }
    fn is_finite(&self) -> bool {
        self.0.is_finite()
    }
    fn weigh(&self, other: &Self, error: &Self::Rate, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.0.weigh(&other.0, &error.base, tolerances, sum);
    }
    fn weigh_all(&self, other: &Self, error: &Self::Rate, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.0.weigh_all(&other.0, &error.base, tolerances, sum);
    }
}

impl<Q: Poses> Poses for Augmented<Q> {
    type InBodyFrame = Augmented<Q::InBodyFrame>;
    #[inline]
    fn count(&self) -> usize {
        self.0.count()
    }
    #[inline]
    fn pose(&self, i: usize) -> crate::state::Pose {
        self.0.pose(i)
    }
    #[inline]
    fn set_pose(&mut self, i: usize, pose: crate::state::Pose) {
        self.0.set_pose(i, pose);
    }
    #[inline]
    fn twist(rate: &Self::Rate, i: usize) -> crate::state::Twist {
        Q::twist(&rate.base, i)
    }
    #[inline]
    fn set_twist(rate: &mut Self::Rate, i: usize, twist: crate::state::Twist) {
        Q::set_twist(&mut rate.base, i, twist);
    }
    fn in_body_frame(x: &State<Self>) -> State<Self::InBodyFrame> {
        State::augmented(Q::in_body_frame(&x.base()), x.rate.variables.clone())
    }
    #[inline]
    fn variables(rate: &Self::Rate) -> &[Vector3<f64>] {
        &rate.variables
    }
    #[inline]
    fn variables_mut(rate: &mut Self::Rate) -> &mut [Vector3<f64>] {
        &mut rate.variables
    }
}

/// Sets the variables beside the bodies to those of `x` and Σ a · slope over the terms.
#[inline]
pub(crate) fn advance<Q: Poses>(x: &Q::Rate, terms: &[(f64, &Q::Rate)], out: &mut Q::Rate) {
    for (i, (out, x)) in Q::variables_mut(out).iter_mut().zip(Q::variables(x)).enumerate() {
        *out = *x;
        for (a, slope) in terms {
            *out += Q::variables(slope)[i] * *a;
        }
    }
}
