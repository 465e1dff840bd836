//! What carries the shape of a contact: a body by its centre of mass, or a link by the origin of its frame.

use nalgebra::{Matrix3, Vector3};
use somersault_core::lie::so3;
use somersault_integrators::state::{Pose, RigidBodyState, Twist};
use somersault_integrators::variation::Tangent;
use std::borrow::Borrow;

/// How a frame stands and moves in the world.
pub(crate) trait Carrier {
    /// Where its origin is, m.
    fn origin(&self) -> &Vector3<f64>;
    /// A vector of the frame in the axes of the world.
    fn turned(&self, v: &Vector3<f64>) -> Vector3<f64>;
    /// Velocity of its origin, m/s.
    fn speed(&self) -> &Vector3<f64>;
    /// Its angular velocity, rad/s.
    fn spin(&self) -> &Vector3<f64>;
    /// The velocity at the end of an arm from the origin, m/s.
    #[inline(always)]
    fn velocity_at(&self, arm: &Vector3<f64>) -> Vector3<f64> {
        self.speed() + self.spin().cross(arm)
    }
}

impl Carrier for RigidBodyState {
    #[inline(always)]
    fn origin(&self) -> &Vector3<f64> {
        &self.configuration.position
    }
    #[inline(always)]
    fn turned(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.configuration.orientation * v
    }
    #[inline(always)]
    fn speed(&self) -> &Vector3<f64> {
        &self.rate.linear
    }
    #[inline(always)]
    fn spin(&self) -> &Vector3<f64> {
        &self.rate.angular
    }
}

/// A body, by pose and rate.
impl Carrier for (&Pose, &Twist) {
    #[inline(always)]
    fn origin(&self) -> &Vector3<f64> {
        &self.0.position
    }
    #[inline(always)]
    fn turned(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.0.orientation * v
    }
    #[inline(always)]
    fn speed(&self) -> &Vector3<f64> {
        &self.1.linear
    }
    #[inline(always)]
    fn spin(&self) -> &Vector3<f64> {
        &self.1.angular
    }
}

/// The frame of a link, world axes; its rotation may stay where it was computed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame<R = Matrix3<f64>> {
    pub(crate) origin: Vector3<f64>,
    pub(crate) rotation: R,
    pub(crate) velocity: Vector3<f64>,
    pub(crate) angular_velocity: Vector3<f64>,
}

impl Frame {
    /// That of a carrier.
    pub(crate) fn of(x: &impl Carrier) -> Self {
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| x.turned(&axis));
        Self {
            origin: *x.origin(),
            rotation: Matrix3::from_columns(&columns),
            velocity: *x.speed(),
            angular_velocity: *x.spin(),
        }
    }

    /// As it stands and moves farther along a tangent.
    pub(crate) fn moved(&self, tangent: &Tangent<Twist>, way: f64) -> Self {
        let Tangent { displacement, rate } = tangent;
        Self {
            origin: self.origin + displacement.linear * way,
            rotation: so3::exp(&(displacement.angular * way)).to_rotation_matrix().into_inner()
                * self.rotation,
            velocity: self.velocity + rate.linear * way,
            angular_velocity: self.angular_velocity + rate.angular * way,
        }
    }

    /// As it stands and moves in the axes of another frame.
    #[inline]
    pub(crate) fn seen_from(&self, other: &Self) -> Self {
        let turn = &other.rotation;
        let span = self.origin - other.origin;
        Self {
            origin: turn.tr_mul(&span),
            rotation: turn.tr_mul(&self.rotation),
            velocity: turn.tr_mul(&(self.velocity - other.velocity_at(&span))),
            angular_velocity: turn.tr_mul(&(self.angular_velocity - other.angular_velocity)),
        }
    }
}

impl<R: Borrow<Matrix3<f64>>> Carrier for Frame<R> {
    #[inline(always)]
    fn origin(&self) -> &Vector3<f64> {
        &self.origin
    }
    #[inline(always)]
    fn turned(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.borrow() * v
    }
    #[inline(always)]
    fn speed(&self) -> &Vector3<f64> {
        &self.velocity
    }
    #[inline(always)]
    fn spin(&self) -> &Vector3<f64> {
        &self.angular_velocity
    }
}
