//! All laws of a contact together, and its modes.

mod encounter;

pub use encounter::Encounter;

use crate::friction::{Friction, Resistance, Rubbing};
use crate::normal::NormalLaw;
use nalgebra::Vector3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::events::Guard;
use somersault_integrators::force::Wrench;
use somersault_integrators::state::RigidBodyState;

/// What a contact does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactMode {
    /// Exerts no force.
    Open,
    /// Pushes; friction, where it has modes, sticks.
    Closed,
    /// Pushes and slips.
    Slip,
}

/// What a unit force at a contact does to the bodies, in the directions that laws act in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mobility {
    /// Along the normal, 1/kg: the inverse of the effective mass.
    pub normal: f64,
    /// Along any tangent at most, 1/kg.
    pub tangential: f64,
    /// Of a unit couple at most, 1/(kg m²).
    pub turning: f64,
}

impl Mobility {
    /// Of a point of a body: 1/m + (r × n)·I⁻¹(r × n), and 1/m + r²/I₁ with the least principal moment I₁.
    pub(crate) fn of_body(
        body: &RigidBody,
        x: &RigidBodyState,
        arm: &Vector3<f64>,
        normal: &Vector3<f64>,
    ) -> Self {
        let (inverse_mass, inertia) = (1.0 / body.mass(), body.inertia());
        let lever = x.orientation().inverse_transform_vector(&arm.cross(normal));
        let turning = 1.0 / inertia.principal_moments().min();
        Self {
            normal: inverse_mass + lever.dot(&inertia.velocity(&lever)),
            tangential: inverse_mass + arm.norm_squared() * turning,
            turning,
        }
    }
}

impl std::ops::Add for Mobility {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            normal: self.normal + other.normal,
            tangential: self.tangential + other.tangential,
            turning: self.turning + other.turning,
        }
    }
}

/// Stiffness and damping of contacts over the masses they move.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactRate {
    /// Σ k/m, 1/s².
    pub stiffness: f64,
    /// Σ c/m, 1/s.
    pub damping: f64,
    /// The largest k/c of friction, 1/s: with it the stretch of a contact that slips relaxes, whatever the mass.
    pub relaxation: f64,
}

impl ContactRate {
    /// An upper bound of |λ|, 1/s: of what oscillates √(Σ k/m), of what is damped beyond that Σ c/m, of what relaxes
    /// k/c.
    ///
    /// The sums are traces, and so no less than any eigenvalue of several contacts together.
    pub fn bound(&self) -> f64 {
        self.stiffness.sqrt().max(self.damping).max(self.relaxation)
    }
}

impl std::iter::Sum for ContactRate {
    fn sum<I: Iterator<Item = Self>>(rates: I) -> Self {
        rates.fold(Self::default(), |a, b| Self {
            stiffness: a.stiffness + b.stiffness,
            damping: a.damping + b.damping,
            relaxation: a.relaxation.max(b.relaxation),
        })
    }
}

/// Laws of a contact: along the normal, against sliding, against rolling and spinning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactLaw {
    /// Along the normal.
    pub normal: NormalLaw,
    /// Against sliding.
    pub friction: Friction,
    /// Against rolling and spinning.
    pub resistance: Resistance,
}

impl<L: Into<NormalLaw>> From<L> for ContactLaw {
    /// A law without friction.
    fn from(normal: L) -> Self {
        Self { normal: normal.into(), friction: Friction::None, resistance: Resistance::default() }
    }
}

impl ContactLaw {
    /// The same with another friction.
    #[must_use]
    pub fn with_friction(self, friction: impl Into<Friction>) -> Self {
        Self { friction: friction.into(), ..self }
    }

    /// The same with another resistance to rolling and spinning.
    #[must_use]
    pub fn with_resistance(self, resistance: Resistance) -> Self {
        Self { resistance, ..self }
    }

    /// Whether force or couple depend on velocities.
    pub fn depends_on_velocity(&self) -> bool {
        self.normal.is_damped() || self.friction != Friction::None || !self.resistance.is_none()
    }

    /// Whether there is neither friction nor resistance.
    #[inline(always)]
    pub(crate) fn is_only_normal(&self) -> bool {
        self.friction == Friction::None && self.resistance.is_none()
    }

    /// The guard of the contact itself: inside where it pushes.
    #[inline(always)]
    pub fn guard(&self, at: &Encounter) -> Guard {
        self.normal.guard(at.gap, at.rate)
    }

    /// The guard of friction: inside where it slips. Its rate is not known.
    #[inline]
    pub fn friction_guard(&self, mode: &ContactMode, at: &Encounter, stretch: &Vector3<f64>) -> Guard {
        let gap = match mode {
            ContactMode::Open => 1.0,
            ContactMode::Closed => self.friction.margin(self.rubbing(false, at, stretch)),
            ContactMode::Slip => self.friction.margin(self.rubbing(true, at, stretch)),
        };
        Guard { gap, ..Guard::default() }
    }

    /// The mode of an encounter without history.
    pub fn mode(&self, at: &Encounter, stretch: &Vector3<f64>) -> ContactMode {
        self.next_mode(&ContactMode::Closed, at, stretch)
    }

    /// The mode after an event.
    pub fn next_mode(&self, before: &ContactMode, at: &Encounter, stretch: &Vector3<f64>) -> ContactMode {
        let (last, stretch) = match before {
            // A contact begins without stretch.
            ContactMode::Open => (ContactMode::Closed, &Vector3::zeros()),
            ContactMode::Closed | ContactMode::Slip => (*before, stretch),
        };
        if !self.guard(at).is_inside() {
            ContactMode::Open
        } else if self.friction_guard(&last, at, stretch).is_inside() {
            ContactMode::Slip
        } else {
            ContactMode::Closed
        }
    }

    /// Force and couple on the first at the point of contact, frozen in a mode.
    #[inline(always)]
    pub fn effort_in(&self, mode: &ContactMode, at: &Encounter, stretch: &Vector3<f64>) -> Wrench {
        let slips = match mode {
            ContactMode::Open => return Wrench::default(),
            ContactMode::Closed => false,
            ContactMode::Slip => true,
        };
        let rubbing = self.rubbing(slips, at, stretch);
        let push = rubbing.push;
        let torque = if self.resistance.is_none() {
            Vector3::zeros()
        } else {
            self.resistance.couple(push, &at.normal, &at.turning)
        };
        Wrench { force: at.normal * push + self.friction.force(rubbing), torque }
    }

    /// Stiffness and damping over the masses that they move, while the contact is closed.
    pub fn rate(&self, at: &Encounter, mobility: &Mobility) -> ContactRate {
        let tangent = self.normal.stiffest(at.gap, at.rate, 1.0 / mobility.normal);
        let (k, c, relaxation) = match &self.friction {
            Friction::None => (0.0, 0.0, 0.0),
            Friction::Regularised(law) => (0.0, law.coefficient() * tangent.force / law.speed(), 0.0),
            Friction::Coulomb(law) => (law.stiffness(), law.damping(), law.stiffness() / law.damping()),
        };
        let couple = if self.resistance.is_none() {
            0.0
        } else {
            self.resistance.rolling().max(self.resistance.spinning()) * tangent.force
                / self.resistance.speed()
        };
        ContactRate {
            stiffness: tangent.stiffness * mobility.normal + k * mobility.tangential,
            damping: tangent.damping * mobility.normal + c * mobility.tangential + couple * mobility.turning,
            relaxation,
        }
    }

    /// ξ̇, m/s, frozen in a mode: zero where the contact is open or has no stretch.
    #[inline]
    pub fn stretch_rate_in(
        &self,
        mode: &ContactMode,
        at: &Encounter,
        stretch: &Vector3<f64>,
    ) -> Vector3<f64> {
        let slips = match mode {
            ContactMode::Open => return Vector3::zeros(),
            ContactMode::Closed => false,
            ContactMode::Slip => true,
        };
        self.friction.stretch_rate(self.rubbing(slips, at, stretch)) + at.tilting.cross(stretch)
    }

    /// Energy of the springs, J: that of the normal law and ½ k ξ².
    pub fn energy(&self, gap: f64, stretch: &Vector3<f64>) -> f64 {
        self.normal.energy(gap) + self.friction.energy(stretch)
    }

    #[inline(always)]
    pub(crate) fn rubbing<'a>(
        &self,
        slips: bool,
        at: &'a Encounter,
        stretch: &'a Vector3<f64>,
    ) -> Rubbing<'a> {
        Rubbing { slips, push: self.normal.force_in_contact(at.gap, at.rate), at, stretch }
    }
}
