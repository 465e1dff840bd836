//! A point of a body on a plane, where nothing acts but a push along the normal.
//!
//! With the point p from the centre of mass r, the plane n·x = d and the lever ℓ = p × n,
//! ```text
//! Δx = n·r + n·p − d,   Δẋ = n·v + ω·ℓ,   force n F,   torque ℓ F.
//! ```
//! Products of p, n and ω may be taken in axes of the body. There p is constant and n, turned once, does not
//! wait for the force: no other rotation stands between a pose and the torque that Euler's equations ask for.

use crate::surface::HalfSpace;
use nalgebra::Vector3;
use somersault_integrators::state::RigidBodyState;

/// The axes of angular velocities and torques.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Axes {
    World,
    Body,
}

/// The motion of a body, its rotation seen in some axes.
#[derive(Clone, Copy)]
pub(crate) struct Motion<'a> {
    pub(crate) x: &'a RigidBodyState,
    pub(crate) axes: Axes,
    /// Angular velocity in the axes, rad/s.
    pub(crate) omega: &'a Vector3<f64>,
}

impl<'a> Motion<'a> {
    pub(crate) fn in_world(x: &'a RigidBodyState) -> Self {
        Self { x, axes: Axes::World, omega: x.angular_velocity() }
    }

    /// With the angular velocity `omega` in axes of the body.
    pub(crate) fn in_body(x: &'a RigidBodyState, omega: &'a Vector3<f64>) -> Self {
        Self { x, axes: Axes::Body, omega }
    }

    /// A vector of the world in the axes.
    #[inline(always)]
    pub(crate) fn of_world(&self, v: &Vector3<f64>) -> Vector3<f64> {
        match self.axes {
            Axes::World => *v,
            Axes::Body => self.x.orientation().inverse_transform_vector(v),
        }
    }

    /// A vector of the body in the axes.
    #[inline(always)]
    fn of_body(&self, v: &Vector3<f64>) -> Vector3<f64> {
        match self.axes {
            Axes::World => self.x.orientation() * v,
            Axes::Body => *v,
        }
    }
}

/// Gap, its rate, and the torque of a unit push.
pub(crate) struct Touch {
    pub(crate) gap: f64,
    pub(crate) rate: f64,
    pub(crate) lever: Vector3<f64>,
}

impl Touch {
    #[inline(always)]
    pub(crate) fn new(point: &Vector3<f64>, plane: &HalfSpace, motion: Motion<'_>) -> Self {
        let (arm, normal) = (motion.of_body(point), motion.of_world(plane.normal()));
        let lever = arm.cross(&normal);
        let gap = plane.distance(motion.x.position()) + normal.dot(&arm);
        let rate = plane.normal().dot(motion.x.velocity()) + lever.dot(motion.omega);
        Self { gap, rate, lever }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Surface;
    use nalgebra::UnitQuaternion;

    #[test]
    fn both_axes_give_the_velocity_of_the_point_and_its_torque() {
        let plane = HalfSpace::try_new(Vector3::new(0.3, -0.1, 0.2), Vector3::new(1.0, -2.0, 3.0)).unwrap();
        for i in 0..50 {
            let some = |k: i32| Vector3::from_fn(|axis, _| f64::sin(f64::from(7 * i + 3 * k) + axis as f64));
            let orientation = UnitQuaternion::new(some(0) * 2.0);
            let x = RigidBodyState::new(some(1), orientation, some(2), some(3) * 10.0);
            let point = some(4);
            let arm = orientation * point;
            let velocity = x.velocity() + x.angular_velocity().cross(&arm);
            let omega = orientation.inverse() * x.angular_velocity();
            for motion in [Motion::in_world(&x), Motion::in_body(&x, &omega)] {
                let touch = Touch::new(&point, &plane, motion);
                let gap = plane.signed_distance(&(x.position() + arm)).distance;
                let torque = motion.of_world(&arm.cross(plane.normal()));
                assert!((touch.gap - gap).abs() < 1e-14, "{i}: {} {gap}", touch.gap);
                let rate = plane.normal().dot(&velocity);
                assert!((touch.rate - rate).abs() < 1e-13, "{i}: {} {rate}", touch.rate);
                assert!((touch.lever - torque).norm() < 1e-14, "{i}: {} {torque}", touch.lever);
            }
        }
    }
}
