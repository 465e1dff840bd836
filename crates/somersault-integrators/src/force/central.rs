//! Attraction by a point.

use super::{ForceModel, Reach, Wrench, WrenchBound};
use crate::body::RigidBody;
use crate::series::WrenchTerm;
use crate::state::{RigidBodyState, Twist};
use crate::variation::Tangent;
use nalgebra::Vector3;

/// Newton's attraction of the centre of mass by a fixed point: F = −μ m s/|s|³ with the way s from the point.
///
/// It exerts no torque: that of its gradient is [`GravityGradient`](crate::satellite::GravityGradient).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CentralGravity {
    /// μ, m³/s².
    pub gravitational_parameter: f64,
    /// The point, world frame, m.
    pub centre: Vector3<f64>,
}

impl CentralGravity {
    fn force(&self, mass: f64, x: &RigidBodyState) -> Vector3<f64> {
        let way = x.position() - self.centre;
        way * (-self.gravitational_parameter * mass / way.norm().powi(3))
    }
}

impl ForceModel for CentralGravity {
    #[inline]
    fn wrench(&self, _: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        Wrench { force: self.force(body.mass(), x), torque: Vector3::zeros() }
    }
    fn is_torque_free(&self) -> bool {
        true
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
    /// None where the point itself is within reach.
    fn bound(&self, body: &RigidBody, reach: &Reach) -> Option<WrenchBound> {
        let nearest = (reach.position - self.centre).norm() - reach.displacement;
        let force = self.gravitational_parameter.abs() * body.mass() / (nearest * nearest);
        (nearest > 0.0).then_some(WrenchBound { force, torque: 0.0 })
    }
    fn potential(&self, body: &RigidBody, x: &RigidBodyState) -> Option<f64> {
        Some(-self.gravitational_parameter * body.mass() / (x.position() - self.centre).norm())
    }
    fn add_terms(&self, body: &RigidBody, terms: &mut Vec<WrenchTerm>) -> bool {
        terms.push(WrenchTerm::CentralForce {
            centre: self.centre,
            point: Vector3::zeros(),
            strength: -self.gravitational_parameter * body.mass(),
            power: -3.0,
            is_damper: false,
        });
        true
    }
    fn wrench_variation(
        &self,
        _: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        let way = x.position() - self.centre;
        let (change, square) = (&along.displacement.linear, way.norm_squared());
        let turned = change - way * (3.0 * way.dot(change) / square);
        let force = turned * (-self.gravitational_parameter * body.mass() / (square * square.sqrt()));
        Wrench { force, torque: Vector3::zeros() }
    }
    #[inline]
    fn mass_derivative(&self, _: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        Wrench { force: self.force(1.0, x), torque: Vector3::zeros() }
    }
}
