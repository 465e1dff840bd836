//! Derivatives of the geometry of one contact along a tangent.
//!
//! With the lever arm r of the point of contact, its velocity u = v + ω × r, the centre C = x + R c of what
//! touches, the normal n = ∇φ(C) and the Hessian H of the distance,
//! ```text
//! δC = δx + δφ × R c,   δn = H δC,   δu = δv + δω × r + ω × δr,
//! δΔẋ = n · δu + u · δn,   δv_t = δu − n δΔẋ − δn Δẋ,
//! Ω = n × H w,   δΩ = δn × H w + n × (δH w + H δw)
//! ```
//! with w the velocity of C,
//! and by the shape of what touches, with a the axis of a rim and d = a (a · n) − n,
//!
//! | | δΔx | δr |
//! |---|---|---|
//! | point | n · δC | δφ × R c |
//! | ball | n · δC | δφ × R c − ρ δn |
//! | rim | n · δC − ρ δ‖d‖ | δφ × R c + ρ δ(d/‖d‖) |
//!
//! The point of a capsule or a box nearest to a surface moves in the shape: their encounters are differentiated by central
//! differences.

use crate::carrier::{Carrier, Frame};
use crate::contacts::Contact;
use crate::laws::Encounter;
use crate::shape::Shape;
use nalgebra::{Matrix3, Vector3};
use somersault_integrators::force::Wrench;
use somersault_integrators::state::Twist;
use somersault_integrators::variation::Tangent;

/// What the derivatives of a contact in a state need.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Linearization {
    pub(crate) at: Encounter,
    arm: Vector3<f64>,
    centre: Vector3<f64>,
    axis: Vector3<f64>,
    hessian: Matrix3<f64>,
    velocity: Vector3<f64>,
    angular_velocity: Vector3<f64>,
    /// Place and velocity of the centre, where the plane of contact turns.
    bending: Option<(Vector3<f64>, Vector3<f64>)>,
    /// The carrier and its mass, of a shape in which the point that touches moves.
    extended: Option<(Frame, f64)>,
}

/// Derivative of the Hessian along a way, by a central difference.
fn hessian_change(contact: &Contact, place: &Vector3<f64>, way: &Vector3<f64>) -> Matrix3<f64> {
    let length = way.norm();
    if length == 0.0 {
        return Matrix3::zeros();
    }
    let step = f64::EPSILON.cbrt() * place.amax().max(1.0) / length;
    let [after, before] = [step, -step].map(|step| contact.surface().hessian(&(place + way * step)));
    (after - before) * (0.5 / step)
}

/// The step of central differences along tangents, by which nothing moves farther than 6e-6 in SI units; 1 where they are zero.
pub(crate) fn step_along<const N: usize>(tangents: [&Tangent<Twist>; N]) -> f64 {
    let size = tangents.iter().fold(0.0_f64, |size, Tangent { displacement, rate }| {
        [displacement.linear, displacement.angular, rate.linear, rate.angular]
            .iter()
            .fold(size, |size, vector| size.max(vector.norm()))
    });
    if size > 0.0 { f64::EPSILON.cbrt() / size } else { 1.0 }
}

/// Derivative of an encounter, and of the lever arm.
pub(crate) struct Change {
    pub(crate) at: Encounter,
    pub(crate) arm: Vector3<f64>,
}

impl Linearization {
    /// Of a contact on a carrier of some mass, kg.
    #[inline]
    pub(crate) fn new<C: Carrier>(contact: &Contact, mass: f64, x: &C) -> Self {
        let (at, arm) = contact.meet_on(mass, x);
        let centre = x.turned(contact.shape().centre());
        let axis = match contact.shape() {
            Shape::Rim { axis, .. } => x.turned(axis.as_ref()),
            Shape::Point(_) | Shape::Ball { .. } | Shape::Capsule { .. } | Shape::Box { .. } => {
                Vector3::zeros()
            }
        };
        let extended = match contact.shape() {
            Shape::Point(_) | Shape::Ball { .. } | Shape::Rim { .. } => None,
            Shape::Capsule { .. } | Shape::Box { .. } => Some((Frame::of(x), mass)),
        };
        let bends = contact.law().friction().has_stretch() && contact.surface().as_half_space().is_none();
        let place = x.origin() + centre;
        Self {
            at,
            arm,
            centre,
            axis,
            bending: bends.then(|| (place, x.velocity_at(&centre))),
            hessian: contact.surface().hessian(&place),
            velocity: x.velocity_at(&arm),
            angular_velocity: *x.spin(),
            extended,
        }
    }

    /// The derivative along a tangent.
    #[inline]
    pub(crate) fn along(&self, contact: &Contact, tangent: &Tangent<Twist>) -> Change {
        if let Some((frame, mass)) = &self.extended {
            let step = step_along([tangent]);
            let [after, before] = [step, -step].map(|way| contact.meet_on(*mass, &frame.moved(tangent, way)));
            let factor = 0.5 / step;
            let at = after.0.change_from(&before.0, factor);
            return Change { at, arm: (after.1 - before.1) * factor };
        }
        let (turn, rate) = (&tangent.displacement.angular, &tangent.rate);
        let normal = &self.at.normal;
        let centre_change = turn.cross(&self.centre);
        let way = tangent.displacement.linear + centre_change;
        let normal_change = self.hessian * way;
        let (gap, arm) = match contact.shape() {
            Shape::Point(_) => (normal.dot(&way), centre_change),
            Shape::Ball { radius, .. } => (normal.dot(&way), centre_change - normal_change * *radius),
            Shape::Capsule { .. } | Shape::Box { .. } => (f64::NAN, Vector3::repeat(f64::NAN)),
            Shape::Rim { radius, .. } => {
                let axis_change = turn.cross(&self.axis);
                let slant = self.axis.dot(normal);
                let slant_change = axis_change.dot(normal) + self.axis.dot(&normal_change);
                let down = self.axis * slant - normal;
                let down_change = axis_change * slant + self.axis * slant_change - normal_change;
                let slope = down.norm();
                if slope > 0.0 {
                    let slope_change = down.dot(&down_change) / slope;
                    let reach_change = (down_change - down * (slope_change / slope)) * (radius / slope);
                    (normal.dot(&way) - radius * slope_change, centre_change + reach_change)
                } else {
                    (normal.dot(&way), centre_change)
                }
            }
        };
        let velocity_change = rate.linear + rate.angular.cross(&self.arm) + self.angular_velocity.cross(&arm);
        let rate_change = normal.dot(&velocity_change) + normal_change.dot(&self.velocity);
        let at = Encounter {
            gap,
            rate: rate_change,
            normal: normal_change,
            point: tangent.displacement.linear + arm,
            sliding: velocity_change - normal * rate_change - normal_change * self.at.rate,
            turning: rate.angular,
            tilting: self.bending.map_or_else(Vector3::zeros, |(place, velocity)| {
                let velocity_change = rate.linear
                    + rate.angular.cross(&self.centre)
                    + self.angular_velocity.cross(&centre_change);
                let turned =
                    hessian_change(contact, &place, &way) * velocity + self.hessian * velocity_change;
                normal_change.cross(&(self.hessian * velocity)) + normal.cross(&turned)
            }),
            mass: 0.0,
        };
        Change { at, arm }
    }

    /// The wrench about the centre of mass of an effort at the point of contact.
    #[inline]
    pub(crate) fn wrench(&self, effort: &Wrench) -> Twist {
        Twist { linear: effort.force, angular: self.arm.cross(&effort.force) + effort.torque }
    }

    /// The derivative of that.
    #[inline]
    pub(crate) fn wrench_change(
        &self,
        arm_change: &Vector3<f64>,
        effort: &Wrench,
        effort_change: &Wrench,
    ) -> Twist {
        let Twist { linear, angular } = self.wrench(effort_change);
        Twist { linear, angular: angular + arm_change.cross(&effort.force) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::ContactLaw;
    use crate::laws::compliant::CompliantLaw;
    use crate::laws::coulomb::CoulombFriction;
    use crate::surface::{CylindricalSurface, HalfSpace, Solid, SphericalSurface};
    use somersault_core::lie::so3;
    use somersault_integrators::body::RigidBody;
    use somersault_integrators::state::RigidBodyState;
    use std::sync::Arc;

    #[test]
    fn derivatives_of_encounters_are_their_differences() {
        let friction = CoulombFriction::try_new(0.3, 50.0, 2.0).unwrap();
        let law = ContactLaw::from(CompliantLaw::try_new(100.0, 1.0).unwrap()).with_friction(friction);
        let plane = HalfSpace::try_new(Vector3::zeros(), Vector3::new(0.1, -0.2, 1.0)).unwrap();
        let bowl =
            Arc::new(SphericalSurface::try_new(Vector3::new(0.1, 0.0, 2.0), 2.0, Solid::Outside).unwrap());
        let axis = Vector3::new(1.0, 0.2, 0.0);
        let log =
            CylindricalSurface::try_new(Vector3::new(0.0, 0.0, -1.0), axis, 1.0, Solid::Inside).unwrap();
        let point = Vector3::new(0.1, -0.2, -0.3);
        let contacts = [
            Contact::try_new(point, bowl.clone(), law.clone()).unwrap(),
            Contact::try_ball(point, 0.15, bowl, law.clone()).unwrap(),
            Contact::try_ball(point, 0.15, Arc::new(log), law.clone()).unwrap(),
            Contact::try_rim(point, Vector3::new(0.3, 1.0, 0.2), 0.25, plane, law).unwrap(),
        ];
        let x = RigidBodyState::new(
            Vector3::new(0.2, 0.1, 0.3),
            so3::exp(&Vector3::new(0.3, -0.6, 0.4)),
            Vector3::new(0.5, -0.2, 0.7),
            Vector3::new(1.1, 0.4, -0.9),
        );
        let body = RigidBody::try_box(1.0, Vector3::repeat(0.3)).unwrap();
        let effort = Wrench { force: Vector3::new(1.0, 2.0, 3.0), torque: Vector3::new(0.1, 0.2, 0.3) };
        let still = Wrench::default();
        for contact in &contacts {
            let at = Linearization::new(contact, body.mass(), &x);
            for i in 0..12 {
                let tangent = Tangent::unit(i);
                let change = at.along(contact, &tangent);
                let step = 1e-5;
                let [a, b] =
                    [step, -step].map(|e| Linearization::new(contact, body.mass(), &tangent.moved(&x, e)));
                let vectors = [
                    (a.at.normal - b.at.normal, change.at.normal),
                    (a.at.point - b.at.point, change.at.point),
                    (a.at.sliding - b.at.sliding, change.at.sliding),
                    (a.at.turning - b.at.turning, change.at.turning),
                    (a.at.tilting - b.at.tilting, change.at.tilting),
                    (a.arm - b.arm, change.arm),
                    (
                        a.wrench(&effort).angular - b.wrench(&effort).angular,
                        at.wrench_change(&change.arm, &effort, &still).angular,
                    ),
                ];
                for (difference, found) in vectors {
                    assert!((difference / (2.0 * step) - found).norm() < 1e-8, "{:?} {i}", contact.shape());
                }
                for (difference, found) in
                    [(a.at.gap - b.at.gap, change.at.gap), (a.at.rate - b.at.rate, change.at.rate)]
                {
                    assert!((difference / (2.0 * step) - found).abs() < 1e-8, "{:?} {i}", contact.shape());
                }
            }
        }
    }
}
