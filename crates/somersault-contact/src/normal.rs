//! The choice of a normal law.

mod stiffest;

pub use stiffest::Stiffest;

use crate::hunt_crossley::HuntCrossley;
use crate::law::CompliantLaw;
use somersault_integrators::events::Guard;

/// A force along the normal as a function of the gap and its rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NormalLaw {
    /// Spring and damper, thesis (7.10).
    Compliant(CompliantLaw),
    /// Hertz's spring with a damper that grows with the penetration.
    HuntCrossley(HuntCrossley),
}

impl From<CompliantLaw> for NormalLaw {
    fn from(law: CompliantLaw) -> Self {
        Self::Compliant(law)
    }
}

impl From<HuntCrossley> for NormalLaw {
    fn from(law: HuntCrossley) -> Self {
        Self::HuntCrossley(law)
    }
}

impl NormalLaw {
    /// The force frozen in contact, N.
    #[inline(always)]
    pub fn force_in_contact(&self, gap: f64, rate: f64) -> f64 {
        match self {
            Self::Compliant(law) => law.force_in_contact(gap, rate),
            Self::HuntCrossley(law) => law.force_in_contact(gap, rate),
        }
    }

    /// The guard that is inside exactly where the law acts.
    #[inline(always)]
    pub fn guard(&self, gap: f64, rate: f64) -> Guard {
        match self {
            Self::Compliant(law) => law.guard(gap, rate),
            Self::HuntCrossley(law) => law.guard(gap, rate),
        }
    }

    /// Energy of the spring, J.
    #[inline]
    pub fn energy(&self, gap: f64) -> f64 {
        match self {
            Self::Compliant(law) => law.energy(gap),
            Self::HuntCrossley(law) => law.energy(gap),
        }
    }

    /// ∫ F dt over a step of h in contact, N s, from gap and rate at its ends.
    #[inline]
    pub fn impulse(&self, h: f64, before: &Guard, after: &Guard) -> f64 {
        match self {
            Self::Compliant(law) => law.impulse(h, before, after),
            Self::HuntCrossley(law) => law.impulse(h, before, after),
        }
    }

    /// Force, stiffness and damping at the depth that a mass (kg) reaches from a gap and its rate if nothing is
    /// lost on the way.
    pub fn stiffest(&self, gap: f64, rate: f64, mass: f64) -> Stiffest {
        match self {
            Self::Compliant(law) => law.stiffest(gap, rate, mass),
            Self::HuntCrossley(law) => law.stiffest(gap, rate, mass),
        }
    }

    /// Whether the force depends on the rate of the gap.
    pub fn is_damped(&self) -> bool {
        match self {
            Self::Compliant(law) => law.damping() != 0.0,
            Self::HuntCrossley(law) => law.damping() != 0.0,
        }
    }
}
