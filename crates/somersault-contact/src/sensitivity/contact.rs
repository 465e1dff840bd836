//! Derivatives of one contact: its gap and its wrench along a tangent and with respect to its constants.
//!
//! With the lever arm r = R p, the point P = x + r, the normal n = ∇φ(P), the Hessian H of the distance and
//! the velocity u = v + ω × r of the point,
//! ```text
//! δr = δφ × r,   δP = δx + δr,   δn = H δP,   δu = δv + δω × r + ω × δr,
//! δΔx = n · δP,   δΔẋ = n · δu + δn · u,
//! δF = n (−k δΔx − c δΔẋ − δk Δx − δc Δẋ) + δn F,   δM = δr × F + r × δF.
//! ```

use crate::contacts::Contact;
use crate::hybrid::Guard;
use nalgebra::{Matrix3, Vector3};
use somersault_integrators::state::{RigidBodyState, Twist};
use somersault_integrators::variation::Tangent;

/// What a contact's derivatives in one state need.
pub(super) struct Linearization<'a> {
    contact: &'a Contact,
    guard: Guard,
    arm: Vector3<f64>,
    normal: Vector3<f64>,
    hessian: Matrix3<f64>,
    velocity: Vector3<f64>,
    angular_velocity: Vector3<f64>,
}

/// Change of a law's constants.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LawChange {
    /// δk, N/m.
    pub(super) stiffness: f64,
    /// δc, N s/m.
    pub(super) damping: f64,
}

/// Change of the geometry of a contact.
struct Change {
    arm: Vector3<f64>,
    normal: Vector3<f64>,
    gap: f64,
    rate: f64,
}

impl<'a> Linearization<'a> {
    pub(super) fn new(contact: &'a Contact, x: &RigidBodyState) -> Self {
        let arm = x.orientation() * contact.point();
        let point = x.position() + arm;
        let at = contact.surface().signed_distance(&point);
        let velocity = x.velocity() + x.angular_velocity().cross(&arm);
        Self {
            contact,
            guard: contact.law().guard(at.distance, at.gradient.dot(&velocity)),
            arm,
            normal: at.gradient,
            hessian: contact.surface().hessian(&point),
            velocity,
            angular_velocity: *x.angular_velocity(),
        }
    }

    pub(super) fn guard(&self) -> &Guard {
        &self.guard
    }

    fn change(&self, along: &Tangent<Twist>) -> Change {
        let arm = along.displacement.angular.cross(&self.arm);
        let point = along.displacement.linear + arm;
        let normal = self.hessian * point;
        let velocity =
            along.rate.linear + along.rate.angular.cross(&self.arm) + self.angular_velocity.cross(&arm);
        let rate = self.normal.dot(&velocity) + normal.dot(&self.velocity);
        Change { arm, normal, gap: self.normal.dot(&point), rate }
    }

    /// Δẍ along a motion with the acceleration `acceleration`.
    pub(super) fn second_rate(&self, x: &RigidBodyState, acceleration: &Twist) -> f64 {
        self.change(&Tangent { displacement: x.rate, rate: *acceleration }).rate
    }

    /// Derivative of the wrench as it acts in contact.
    pub(super) fn wrench_change(&self, along: &Tangent<Twist>, law: &LawChange) -> Twist {
        let change = self.change(along);
        let (stiffness, damping) = (self.contact.law().stiffness(), self.contact.law().damping());
        let size = self.contact.law().force_in_contact(self.guard.gap, self.guard.rate);
        let size_change = -stiffness * change.gap
            - damping * change.rate
            - law.stiffness * self.guard.gap
            - law.damping * self.guard.rate;
        let force = self.normal * size_change + change.normal * size;
        let angular = change.arm.cross(&(self.normal * size)) + self.arm.cross(&force);
        Twist { linear: force, angular }
    }

    /// The wrench as it begins to act at a touch-down.
    pub(super) fn first_wrench(&self) -> Twist {
        let force = self.normal * self.contact.law().force_in_contact(0.0, self.guard.rate);
        Twist { linear: force, angular: self.arm.cross(&force) }
    }

    /// Derivative of the gap along a displacement.
    pub(super) fn gap_change(&self, displacement: &Twist) -> f64 {
        self.normal.dot(&(displacement.linear + displacement.angular.cross(&self.arm)))
    }

    /// Rate of the margin of the guard where Δẍ is `second_rate`.
    pub(super) fn margin_rate(&self, second_rate: f64) -> f64 {
        if self.guard.rate > 0.0 { self.guard.rate + self.guard.lag * second_rate } else { self.guard.rate }
    }

    /// Derivative of the margin of the guard, Δx + (c/k) max(Δẋ, 0).
    pub(super) fn margin_change(&self, along: &Tangent<Twist>, law: &LawChange) -> f64 {
        let change = self.change(along);
        if self.guard.rate > 0.0 {
            let lag = (law.damping - self.guard.lag * law.stiffness) / self.contact.law().stiffness();
            change.gap + self.guard.lag * change.rate + lag * self.guard.rate
        } else {
            change.gap
        }
    }
}
