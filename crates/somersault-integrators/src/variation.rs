//! First variations: tangents to a state, and configurations that carry columns of them.
//!
//! A family of states q_ε = exp(ε δq) q, p_ε = p + ε δp has the tangent (δq, δp) at ε = 0. For one rigid
//! body that is
//! ```text
//! x_ε = x + ε δx,   R_ε = exp(ε δφ̂) R,   v_ε = v + ε δv,   ω_ε = ω + ε δω,
//! ```
//! all four in the world frame; δφ is the small rotation that leads from R to R_ε. Along a motion
//! q̇ = p the displacement obeys
//! ```text
//! δq' = δp + [p, δq],   that is   δx' = δv,   δφ' = δω + ω × δφ,
//! ```
//! (J. E. Marsden and T. S. Ratiu, *Introduction to Mechanics and Symmetry*, 1999, section 13.5, with the
//! sign of spatial velocities), and δp' is the derivative of the acceleration.
//!
//! [`Varied`] puts columns of tangents beside a configuration or a rate. They belong to its ℝᵐ: methods add
//! and scale them and have no bracket for them, so that a method moves the base exactly as it does without
//! columns, and the columns to its own order. The columns may be in other axes than the base.

use crate::augmented::{Augmented, AugmentedRate};
use crate::body::RigidBody;
use crate::force::Wrench;
use crate::scratch::{OnHeap, Storage};
use crate::state::{Configuration, ErrorSum, Pose, Rate, RigidBodyState, State, Tolerances, Twist};
use nalgebra::{Matrix3, SVector};
use somersault_core::lie::so3;

/// A tangent to a state: displacement (δq) and change of the rate (δp).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tangent<V> {
    /// δq, by which the configuration moves as exp(ε δq) q.
    pub displacement: V,
    /// δp.
    pub rate: V,
}

impl Tangent<Twist> {
    /// The `i`-th of the twelve unit tangents of a body: three of position (m), orientation (rad), velocity
    /// (m/s) and angular velocity (rad/s) each, world frame; zero beyond.
    pub fn unit(i: usize) -> Self {
        let mut unit = Self::default();
        let parts = [
            &mut unit.displacement.linear,
            &mut unit.displacement.angular,
            &mut unit.rate.linear,
            &mut unit.rate.angular,
        ];
        if let Some(part) = parts.into_iter().nth(i / 3) {
            part[i % 3] = 1.0;
        }
        unit
    }

    /// The twelve components, in the order of [`unit`](Self::unit).
    pub fn components(&self) -> SVector<f64, 12> {
        let (q, p) = (&self.displacement, &self.rate);
        let parts = [&q.linear, &q.angular, &p.linear, &p.angular];
        SVector::from_iterator(parts.into_iter().flatten().copied())
    }

    /// The state at ε on the family through `x`.
    pub fn moved(&self, x: &RigidBodyState, epsilon: f64) -> RigidBodyState {
        let mut moved = *x;
        moved.drift(&self.displacement, epsilon);
        moved.kick(&self.rate, epsilon);
        moved
    }
}

/// A configuration or a rate with columns of tangents beside it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Varied<T, V = T> {
    /// What is varied.
    pub base: T,
    /// The columns: displacements of a configuration, changes of a rate.
    pub columns: Vec<V>,
}

impl<Q: Configuration, V: Rate> State<Varied<Q, V>> {
    /// A state with columns.
    pub fn varied(base: State<Q>, columns: impl IntoIterator<Item = Tangent<V>>) -> Self {
        let (displacements, rates) = columns.into_iter().map(|c| (c.displacement, c.rate)).unzip();
        Self {
            configuration: Varied { base: base.configuration, columns: displacements },
            rate: Varied { base: base.rate, columns: rates },
        }
    }

    /// The state without its columns.
    pub fn base(&self) -> State<Q> {
        State { configuration: self.configuration.base.clone(), rate: self.rate.base.clone() }
    }
}

impl State<Varied<Augmented<Pose>, AugmentedRate<Twist>>> {
    /// The state of the body, without columns and variables.
    #[inline]
    pub fn body(&self) -> RigidBodyState {
        State { configuration: self.configuration.base.0, rate: self.rate.base.base }
    }
}

impl<Q: Configuration> State<Varied<Q, AugmentedRate<Twist>>> {
    /// Column `k` of the body, for `k` below their number.
    #[inline]
    pub fn column(&self, k: usize) -> Tangent<Twist> {
        Tangent { displacement: self.configuration.columns[k].base, rate: self.rate.columns[k].base }
    }

    /// The columns of the body.
    #[inline]
    pub fn columns(&self) -> impl ExactSizeIterator<Item = Tangent<Twist>> {
        (0..self.rate.columns.len()).map(|k| self.column(k))
    }
}

impl<T, V> Storage for Varied<T, V> {
    type Allocation = OnHeap;
}

impl<T: Rate, V: Rate> Rate for Varied<T, V> {
    fn dimension(&self) -> usize {
        self.base.dimension()
    }
    fn tangents(&self) -> usize {
        self.columns.len()
    }
    fn write(&self, out: &mut [f64]) {
        let (base, columns) = out.split_at_mut(self.base.dimension());
        self.base.write(base);
        self.columns.write(columns);
    }
    fn read(&mut self, numbers: &[f64]) {
        let (base, columns) = numbers.split_at(self.base.dimension());
        self.base.read(base);
        self.columns.read(columns);
    }
    fn assign(&mut self, other: &Self) {
        self.base.assign(&other.base);
        self.columns.assign(&other.columns);
    }
    fn set_zero(&mut self) {
        self.base.set_zero();
        self.columns.set_zero();
    }
    fn scale(&mut self, a: f64) {
        self.base.scale(a);
        self.columns.scale(a);
    }
    fn axpy(&mut self, a: f64, x: &Self) {
        self.base.axpy(a, &x.base);
        self.columns.axpy(a, &x.columns);
    }
    fn add_bracket(&mut self, a: f64, x: &Self, y: &Self) {
        self.base.add_bracket(a, &x.base, &y.base);
    }
    fn dexp_inv(&mut self, u: &Self) {
        self.base.dexp_inv(&u.base);
    }
    /// Of the base: tangents are of ℝᵐ.
    fn angle(&self) -> f64 {
        self.base.angle()
    }
    fn is_finite(&self) -> bool {
        self.base.is_finite() && self.columns.is_finite()
    }
    /// Weighs the base alone, so that columns do not change the steps of a motion.
    fn weigh(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.base.weigh(&other.base, &error.base, tolerances, sum);
    }
    fn weigh_all(&self, other: &Self, error: &Self, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.base.weigh_all(&other.base, &error.base, tolerances, sum);
        self.columns.weigh_all(&other.columns, &error.columns, tolerances, sum);
    }
}

impl<Q: Configuration, V: Rate> Configuration for Varied<Q, V> {
    type Rate = Varied<Q::Rate, V>;
    fn assign(&mut self, other: &Self) {
        self.base.assign(&other.base);
        self.columns.assign(&other.columns);
    }
    fn drift(&mut self, rate: &Self::Rate, h: f64) {
        self.base.drift(&rate.base, h);
        self.columns.axpy(h, &rate.columns);
    }
    fn difference(&self, from: &Self, out: &mut Self::Rate) {
        self.base.difference(&from.base, &mut out.base);
        out.columns.assign(&self.columns);
        out.columns.axpy(-1.0, &from.columns);
    }
    fn renormalize(&mut self) {
        self.base.renormalize();
    }
    fn is_finite(&self) -> bool {
        self.base.is_finite() && self.columns.is_finite()
    }
    /// Weighs the base alone, so that columns do not change the steps of a motion.
    fn weigh(&self, other: &Self, error: &Self::Rate, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.base.weigh(&other.base, &error.base, tolerances, sum);
    }
    fn weigh_all(&self, other: &Self, error: &Self::Rate, tolerances: &Tolerances, sum: &mut ErrorSum) {
        self.base.weigh_all(&other.base, &error.base, tolerances, sum);
        self.columns.weigh_all(&other.columns, &error.columns, tolerances, sum);
    }
}

/// Derivative of [`world_acceleration`](crate::system::world_acceleration) in one state, made once for all
/// columns. With I the inertia in the world frame, L = I ω and G = L̂ − ω̂ I,
/// ```text
/// δa = δF/m,   δα = I⁻¹ (δM + G δω) + (I⁻¹ (M̂ + G ω̂) − α̂) δφ.
/// ```
#[derive(Debug, Clone, Copy)]
pub struct AccelerationDerivative {
    per_mass: f64,
    by_torque: Matrix3<f64>,
    by_turn: Matrix3<f64>,
    by_angular_velocity: Matrix3<f64>,
}

impl AccelerationDerivative {
    /// In the state `x` under a wrench, where `acceleration` is the acceleration.
    pub fn new(body: &RigidBody, x: &RigidBodyState, wrench: &Twist, acceleration: &Twist) -> Self {
        let r = x.orientation().to_rotation_matrix().into_inner();
        let inertia = r * body.inertia().tensor() * r.transpose();
        let by_torque = r * body.inertia().inverse() * r.transpose();
        let turning = so3::hat(x.angular_velocity());
        let gyroscopic = so3::hat(&(inertia * x.angular_velocity())) - turning * inertia;
        let by_angular_velocity = by_torque * gyroscopic;
        let by_turn = by_torque * so3::hat(&wrench.angular) + by_angular_velocity * turning
            - so3::hat(&acceleration.angular);
        Self { per_mass: 1.0 / body.mass(), by_torque, by_turn, by_angular_velocity }
    }

    /// Along a tangent on which the wrench changes by `change`.
    #[inline]
    pub fn along(&self, tangent: &Tangent<Twist>, change: &Twist) -> Twist {
        let Twist { linear, angular } = self.by_wrench(change);
        Twist {
            linear,
            angular: angular
                + self.by_turn * tangent.displacement.angular
                + self.by_angular_velocity * tangent.rate.angular,
        }
    }

    /// By a change of the wrench alone.
    #[inline]
    pub fn by_wrench(&self, change: &Twist) -> Twist {
        Twist { linear: change.linear * self.per_mass, angular: self.by_torque * change.angular }
    }
}

/// Central difference of a wrench along a tangent: exact for quadratic functions, else with an error of the
/// square of the step, ∛ε of the larger of 1 (m, rad, m/s, rad/s) and the size of the state.
pub(crate) fn central_difference(
    x: &RigidBodyState,
    along: &Tangent<Twist>,
    wrench: impl Fn(&RigidBodyState) -> Wrench,
) -> Wrench {
    let parts = [
        (x.position().norm(), along.displacement.linear.norm()),
        (0.0, along.displacement.angular.norm()),
        (x.velocity().norm(), along.rate.linear.norm()),
        (x.angular_velocity().norm(), along.rate.angular.norm()),
    ];
    let step = parts
        .into_iter()
        .map(|(size, change)| f64::EPSILON.cbrt() * size.max(1.0) / change)
        .fold(f64::INFINITY, f64::min);
    if step == f64::INFINITY {
        return Wrench::default();
    }
    (wrench(&along.moved(x, step)) - wrench(&along.moved(x, -step))) * (0.5 / step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::force::{ConstantForce, ConstantTorque, Drag, ForceModel, Gravity, Reach, Spring};
    use crate::orbit::{Elements, Orbit};
    use crate::rotors::{
        ControlMomentGyro, ControlMomentGyros, LinearSchedule, ReactionWheel, ReactionWheels, Rotors,
    };
    use crate::satellite::{AerodynamicDrag, Field, GravityGradient, MagneticDipole, Plate, SolarPressure};
    use crate::system::world_acceleration;
    use nalgebra::Vector3;

    fn twist(a: [f64; 6]) -> Twist {
        Twist { linear: Vector3::new(a[0], a[1], a[2]), angular: Vector3::new(a[3], a[4], a[5]) }
    }

    /// A state, a tangent and a body without symmetry.
    fn case() -> (RigidBodyState, Tangent<Twist>, RigidBody) {
        let (v, w) = (Vector3::new(0.7, -1.1, 0.4), Vector3::new(1.3, 0.2, -2.1));
        let x =
            RigidBodyState::new(Vector3::new(0.3, -0.2, 0.9), so3::exp(&Vector3::new(0.4, 1.2, -0.7)), v, w);
        let along = Tangent {
            displacement: twist([0.3, -0.8, 0.5, 0.9, -0.4, 0.2]),
            rate: twist([-0.6, 0.1, 0.8, 0.3, 1.1, -0.5]),
        };
        (x, along, RigidBody::try_principal(1.7, Vector3::new(0.4, 0.7, 1.0)).unwrap())
    }

    #[test]
    fn variations_of_wrenches_are_their_differences() {
        let (x, along, body) = case();
        let spring = Spring {
            anchor: Vector3::new(0.1, 0.2, -0.3),
            attachment: Vector3::new(0.2, -0.1, 0.4),
            stiffness: 3.0,
            damping: 0.7,
            rest_length: 0.5,
        };
        let orbit = Orbit::try_new(Elements { eccentricity: 0.3, ..Elements::circle(5.0, 1.5) }).unwrap();
        let (axis, across) = (Vector3::new(0.6, 0.8, 0.0), Vector3::z());
        let plate = Plate::try_new(2.0, axis, across, 0.2, 0.3).unwrap();
        let wheel = ReactionWheel::try_new(axis, 0.1, 0.7, LinearSchedule::constant(0.0)).unwrap();
        let gyro = ControlMomentGyro::try_new(axis, across, 0.8, 0.3, LinearSchedule::constant(0.4)).unwrap();
        let forces: [Box<dyn ForceModel>; 14] = [
            Box::new(()),
            Box::new(Gravity::earth()),
            Box::new(spring),
            Box::new((spring, Drag { linear: 0.3, quadratic: 0.2, angular: 0.5 })),
            Box::new(ConstantTorque::World(Vector3::new(1.0, 2.0, 3.0))),
            Box::new(ConstantTorque::Body(Vector3::new(1.0, 2.0, 3.0))),
            Box::new(ConstantForce {
                force: Vector3::new(1.0, 2.0, 3.0),
                point: Vector3::new(0.3, 0.1, 0.2),
            }),
            Box::new(GravityGradient { orbit }),
            Box::new(MagneticDipole { moment: axis, field: Field::Uniform(Vector3::new(1.0, 2.0, 3.0)) }),
            Box::new(MagneticDipole { moment: axis, field: Field::Dipole { orbit, strength: across } }),
            Box::new(AerodynamicDrag::try_new(orbit, vec![plate], 0.3, 2.2).unwrap()),
            Box::new(SolarPressure::try_new(-across, vec![plate], 0.7).unwrap()),
            Box::new(Rotors(ReactionWheels(vec![wheel]))),
            Box::new(Rotors(ControlMomentGyros(vec![gyro]))),
        ];
        let reach = Reach { position: *x.position(), displacement: 0.0, speed: 1.4, spin: 2.5 };
        for (i, force) in forces.iter().enumerate() {
            let difference = central_difference(&x, &along, |moved| force.wrench(0.0, &body, moved));
            let error = force.wrench_variation(0.0, &body, &x, &along) - difference;
            assert!(error.force.norm() + error.torque.norm() < 1e-9, "{i}: {error:?}");
            let heavier = RigidBody::try_new(2.7, *body.inertia()).unwrap();
            let change = force.wrench(0.0, &heavier, &x) - force.wrench(0.0, &body, &x);
            assert!((force.mass_derivative(0.0, &body, &x) - change).force.norm() < 1e-12, "{i}");
            let (wrench, bound) = (force.wrench(0.0, &body, &x), force.bound(&body, &reach).unwrap());
            assert!(wrench.force.norm() <= bound.force && wrench.torque.norm() <= bound.torque, "{i}");
        }
        // A closure has neither in closed form.
        let closure = |_: f64, body: &RigidBody, x: &RigidBodyState| Wrench {
            force: x.position() * body.mass(),
            torque: x.angular_velocity() * 2.0,
        };
        let change = closure.wrench_variation(0.0, &body, &x, &along);
        assert!((change.force - along.displacement.linear * 1.7).norm() < 1e-10);
        assert!((change.torque - along.rate.angular * 2.0).norm() < 1e-10);
        assert!((closure.mass_derivative(0.0, &body, &x).force - x.position()).norm() < 1e-10);
        assert_eq!(closure.wrench_variation(0.0, &body, &x, &Tangent::default()), Wrench::default());
    }

    #[test]
    fn the_variation_of_the_acceleration_is_its_difference() {
        let (x, along, body) = case();
        let (wrench, change) =
            (twist([1.0, 2.0, -1.0, 0.5, -0.7, 0.3]), twist([0.2, -0.1, 0.4, 0.6, 0.3, -0.8]));
        let at = |epsilon: f64| {
            let mut wrench = wrench;
            wrench.axpy(epsilon, &change);
            world_acceleration(&body, &along.moved(&x, epsilon), &wrench)
        };
        let found = AccelerationDerivative::new(&body, &x, &wrench, &at(0.0)).along(&along, &change);
        let (after, before) = (at(1e-5), at(-1e-5));
        assert!(((after.linear - before.linear) / 2e-5 - found.linear).norm() < 1e-9);
        assert!(((after.angular - before.angular) / 2e-5 - found.angular).norm() < 1e-9);
    }

    #[test]
    fn unit_tangents_are_the_columns_of_the_identity() {
        for i in 0..12 {
            let u = Tangent::unit(i);
            assert!(u.components().iter().enumerate().all(|(k, &e)| e == f64::from(u8::from(k == i))), "{i}");
        }
        assert_eq!(Tangent::unit(12), Tangent::default());
    }
}
