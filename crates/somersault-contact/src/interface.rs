//! All laws of a contact together, and its modes.

use crate::friction::{Friction, Resistance};
use crate::hybrid::Guard;
use crate::normal::NormalLaw;
use nalgebra::Vector3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::force::Wrench;
use somersault_integrators::state::RigidBodyState;

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
    /// Mass that a force between the two moves, kg: m, or m₁m₂/(m₁ + m₂).
    pub mass: f64,
}

/// What a contact does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContactMode {
    /// Exerts no force.
    Open,
    /// Pushes, with smooth friction or none.
    Closed,
    /// Sticks, by a spring and damper between the point of contact and its anchor.
    Stick {
        /// Where the point was when sticking began, world frame, m.
        anchor: Vector3<f64>,
    },
    /// Slides.
    Slip {
        /// Direction of sliding when it began, or turned last; of length 1.
        direction: Vector3<f64>,
    },
    /// Creeps within the bound of viscous creep.
    Creep,
    /// Slides beyond it.
    Slide,
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
}

impl ContactRate {
    /// An upper bound of |λ|, 1/s: of what oscillates √(Σ k/m), of what is damped beyond that Σ c/m.
    ///
    /// The sums are traces, and so no less than any eigenvalue of several contacts together.
    pub fn bound(&self) -> f64 {
        self.stiffness.sqrt().max(self.damping)
    }
}

impl std::iter::Sum for ContactRate {
    fn sum<I: Iterator<Item = Self>>(rates: I) -> Self {
        rates.fold(Self::default(), |a, b| Self {
            stiffness: a.stiffness + b.stiffness,
            damping: a.damping + b.damping,
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

    /// The guard of friction: it goes in where the mode of friction ends. Its rate is not known.
    #[inline]
    pub fn friction_guard(&self, mode: &ContactMode, at: &Encounter) -> Guard {
        let gap = match (&self.friction, mode) {
            (Friction::Coulomb(law), ContactMode::Stick { anchor }) => {
                law.margin(self.normal_force(at), &law.sticking(&stretch(at, anchor), &at.sliding))
            }
            (Friction::Coulomb(law), ContactMode::Slip { direction }) => law.heading(&at.sliding, direction),
            (Friction::Creep(law), ContactMode::Creep | ContactMode::Slide) => {
                law.margin(self.normal_force(at), &at.sliding)
            }
            _ => 1.0,
        };
        Guard { gap, ..Guard::default() }
    }

    /// The mode that an encounter without history belongs to.
    pub fn mode(&self, at: &Encounter) -> ContactMode {
        if !self.guard(at).is_inside() {
            return ContactMode::Open;
        }
        match &self.friction {
            Friction::None | Friction::Regularised(_) => ContactMode::Closed,
            Friction::Coulomb(law) => {
                if law.stops(self.normal_force(at), &at.sliding, at.mass) {
                    ContactMode::Stick { anchor: at.point }
                } else {
                    ContactMode::Slip { direction: at.sliding.normalize() }
                }
            }
            Friction::Creep(law) => {
                if law.margin(self.normal_force(at), &at.sliding) < 0.0 {
                    ContactMode::Slide
                } else {
                    ContactMode::Creep
                }
            }
        }
    }

    /// The mode after an event.
    pub fn next_mode(&self, before: &ContactMode, at: &Encounter) -> ContactMode {
        if !self.guard(at).is_inside() {
            return ContactMode::Open;
        }
        match (&self.friction, before) {
            (Friction::Coulomb(law), ContactMode::Stick { anchor }) => {
                let force = law.sticking(&stretch(at, anchor), &at.sliding);
                if law.margin(self.normal_force(at), &force) < 0.0 {
                    // A point that the spring held at rest moves where the load pulls, against the spring.
                    let start = if at.sliding == Vector3::zeros() { -force } else { at.sliding };
                    ContactMode::Slip { direction: start.normalize() }
                } else {
                    *before
                }
            }
            (Friction::Coulomb(law), ContactMode::Slip { direction })
                if law.heading(&at.sliding, direction) >= 0.0 =>
            {
                *before
            }
            _ => self.mode(at),
        }
    }

    /// Force and couple on the first at the point of contact, frozen in a mode.
    #[inline(always)]
    pub fn effort_in(&self, mode: &ContactMode, at: &Encounter) -> Wrench {
        if matches!(mode, ContactMode::Open) {
            return Wrench::default();
        }
        let push = self.normal_force(at);
        let friction = match (&self.friction, mode) {
            (Friction::Regularised(law), _) => law.force(push, &at.sliding),
            (Friction::Coulomb(law), ContactMode::Stick { anchor }) => {
                law.sticking(&stretch(at, anchor), &at.sliding)
            }
            (Friction::Coulomb(law), ContactMode::Slip { direction }) => {
                law.slipping(push, &at.sliding, direction)
            }
            (Friction::Creep(law), ContactMode::Creep) => law.creeping(&at.sliding),
            (Friction::Creep(law), ContactMode::Slide) => law.slipping(push, &at.sliding),
            _ => Vector3::zeros(),
        };
        let torque = if self.resistance.is_none() {
            Vector3::zeros()
        } else {
            self.resistance.couple(push, &at.normal, &at.turning)
        };
        Wrench { force: at.normal * push + friction, torque }
    }

    /// Stiffness and damping over the masses that they move, while the contact is closed.
    pub fn rate(&self, at: &Encounter, mobility: &Mobility) -> ContactRate {
        let tangent = self.normal.stiffest(at.gap, at.rate, 1.0 / mobility.normal);
        let (k, c) = match &self.friction {
            Friction::None => (0.0, 0.0),
            Friction::Regularised(law) => (0.0, law.coefficient() * tangent.force / law.speed()),
            Friction::Coulomb(law) => (law.stiffness(), law.damping()),
            Friction::Creep(law) => (0.0, law.damping()),
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
        }
    }

    /// Energy of the springs, J: that of the normal law and, while the contact sticks, ½ k ξ².
    pub fn energy_in(&self, mode: &ContactMode, at: &Encounter) -> f64 {
        let held = match (&self.friction, mode) {
            (Friction::Coulomb(law), ContactMode::Stick { anchor }) => {
                0.5 * law.stiffness() * stretch(at, anchor).norm_squared()
            }
            _ => 0.0,
        };
        self.normal.energy(at.gap) + held
    }

    #[inline(always)]
    fn normal_force(&self, at: &Encounter) -> f64 {
        self.normal.force_in_contact(at.gap, at.rate)
    }
}

/// The way from the anchor to the point of contact, within the surface.
#[inline]
fn stretch(at: &Encounter, anchor: &Vector3<f64>) -> Vector3<f64> {
    let way = at.point - anchor;
    way - at.normal * at.normal.dot(&way)
}
