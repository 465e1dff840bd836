//! All laws of a contact together, and its modes.

use crate::friction::{Friction, Resistance, Rubbing};
use crate::hybrid::Guard;
use crate::normal::NormalLaw;
use nalgebra::Vector3;
use somersault_integrators::force::Wrench;

/// What the laws see of two things that may touch: the first against the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Encounter {
    /// Gap, negative inside, m.
    pub gap: f64,
    /// Its rate, m/s.
    pub rate: f64,
    /// Unit normal, along which the first is pushed.
    pub normal: Vector3<f64>,
    /// The point of contact, world frame, m.
    pub point: Vector3<f64>,
    /// Velocity of the first relative to the second at the point, without its part along the normal, m/s.
    pub sliding: Vector3<f64>,
    /// Relative angular velocity, rad/s.
    pub turning: Vector3<f64>,
    /// Angular velocity of the plane of contact, with which a stretch turns, rad/s; zero on planes, and where no
    /// friction has a stretch.
    pub tilting: Vector3<f64>,
    /// Mass that a force between the two moves, kg: m, or m₁m₂/(m₁ + m₂).
    pub mass: f64,
}

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
