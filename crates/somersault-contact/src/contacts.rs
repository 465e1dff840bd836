//! Contact points of a body against surfaces, as a force and as a system with modes.

use crate::error::{ContactError, finite};
use crate::hybrid::{Guard, Hybrid, HybridBodies};
use crate::law::CompliantLaw;
use crate::surface::Surface;
use nalgebra::Vector3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::{ForceModel, Wrench};
use somersault_integrators::state::{RigidBodyState, Twist};
use somersault_integrators::system::{RigidBodySystem, world_acceleration};
use std::sync::Arc;

/// A point fixed on the body that touches a surface under a law.
#[derive(Debug, Clone)]
pub struct Contact {
    point: Vector3<f64>,
    surface: Arc<dyn Surface>,
    law: CompliantLaw,
}

/// Gap, its rate, the lever arm and the normal of a contact in some state.
struct Touch {
    guard: Guard,
    arm: Vector3<f64>,
    normal: Vector3<f64>,
}

impl Contact {
    /// A point of the body (body frame, from the centre of mass, m), a surface and a law.
    ///
    /// Points may share a surface: clone the `Arc`.
    pub fn try_new(
        point: Vector3<f64>,
        surface: Arc<dyn Surface>,
        law: CompliantLaw,
    ) -> Result<Self, ContactError> {
        Ok(Self { point: finite("point", point)?, surface, law })
    }

    /// The point, body frame, m.
    pub fn point(&self) -> &Vector3<f64> {
        &self.point
    }

    /// The surface.
    pub fn surface(&self) -> &dyn Surface {
        &*self.surface
    }

    /// The law.
    pub fn law(&self) -> &CompliantLaw {
        &self.law
    }

    #[inline(always)]
    fn touch(&self, x: &RigidBodyState) -> Touch {
        let arm = x.orientation() * self.point;
        let at = self.surface.signed_distance(&(x.position() + arm));
        let velocity = x.velocity() + x.angular_velocity().cross(&arm);
        Touch { guard: self.law.guard(at.distance, at.gradient.dot(&velocity)), arm, normal: at.gradient }
    }

    /// Gap and rate of the gap in a state.
    #[inline]
    pub fn guard(&self, x: &RigidBodyState) -> Guard {
        self.touch(x).guard
    }

    #[inline(always)]
    fn wrench_in_contact(&self, touch: &Touch) -> Wrench {
        let force = touch.normal * self.law.force_in_contact(touch.guard.gap, touch.guard.rate);
        Wrench { force, torque: touch.arm.cross(&force) }
    }
}

/// The contacts of a body.
///
/// As a [`ForceModel`] it switches each contact by its state, as the thesis does: that costs any method
/// its order. As part of a [`BodyInContact`] it has modes, one bit a contact, for
/// [`integrate_located`](crate::driver::integrate_located).
#[derive(Debug, Clone, Default)]
pub struct Contacts {
    contacts: Vec<Contact>,
}

impl Contacts {
    /// The contacts in the order that events count them.
    pub fn new(contacts: Vec<Contact>) -> Self {
        Self { contacts }
    }

    /// Energy of the springs, Σ ½ k min(Δx, 0)², J.
    pub fn energy(&self, x: &RigidBodyState) -> f64 {
        self.contacts.iter().map(|c| c.law.energy(c.guard(x).gap)).sum()
    }

    #[inline(always)]
    fn wrench_in(&self, mode: &[bool], x: &RigidBodyState) -> Wrench {
        let mut sum = Wrench::default();
        for (contact, &acts) in self.contacts.iter().zip(mode) {
            if acts {
                sum = sum + contact.wrench_in_contact(&contact.touch(x));
            }
        }
        sum
    }
}

impl std::ops::Deref for Contacts {
    type Target = [Contact];
    fn deref(&self) -> &[Contact] {
        &self.contacts
    }
}

impl ForceModel for Contacts {
    #[inline]
    fn wrench(&self, _: f64, _: &RigidBody, x: &RigidBodyState) -> Wrench {
        let mut sum = Wrench::default();
        for contact in &self.contacts {
            let touch = contact.touch(x);
            if touch.guard.is_inside() {
                sum = sum + contact.wrench_in_contact(&touch);
            }
        }
        sum
    }
    fn is_free(&self) -> bool {
        self.contacts.is_empty()
    }
    fn is_torque_free(&self) -> bool {
        self.contacts.iter().all(|c| c.point == Vector3::zeros())
    }
    fn depends_on_velocity(&self) -> bool {
        self.contacts.iter().any(|c| c.law.damping() != 0.0)
    }
}

/// A rigid body under forces `F`, smooth along a trajectory, and contacts.
pub type BodyInContact<F> = RigidBodySystem<(F, Contacts)>;

/// The mode says of each contact whether it acts.
impl<F: ForceModel> Hybrid for BodyInContact<F> {
    type Mode = Vec<bool>;

    fn mode(&self, _: f64, x: &RigidBodyState) -> Vec<bool> {
        self.forces.1.iter().map(|c| c.guard(x).is_inside()).collect()
    }

    #[inline]
    fn guards(&self, _: &Vec<bool>, _: f64, x: &RigidBodyState, out: &mut Vec<Guard>) {
        out.extend(self.forces.1.iter().map(|c| c.guard(x)));
    }

    #[inline(always)]
    fn acceleration_in(&self, mode: &Vec<bool>, (): &mut (), t: f64, x: &RigidBodyState, out: &mut Twist) {
        let mut wrench = Twist::default();
        self.wrenches_in(mode, t, x, &mut wrench);
        *out = world_acceleration(&self.body, x, &wrench);
    }

    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        self.forces.1.get(guard).map_or(0.0, |c| c.law.impulse(h, before, after))
    }
}

impl<F: ForceModel> HybridBodies for BodyInContact<F> {
    #[inline(always)]
    fn wrenches_in(&self, mode: &Vec<bool>, t: f64, x: &RigidBodyState, out: &mut Twist) {
        let (smooth, contacts) = &self.forces;
        let wrench = smooth.wrench(t, &self.body, x) + contacts.wrench_in(mode, x);
        *out = Twist { linear: wrench.force, angular: wrench.torque };
    }
}
