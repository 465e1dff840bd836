//! What a friction law is.

use super::encounter::Encounter;
use super::normal_law::{Stiffest, unit};
use super::value::LawValue;
use nalgebra::Vector3;
use std::any::Any;

/// What friction depends on.
#[derive(Debug, Clone, Copy)]
pub struct FrictionInput<'a> {
    /// Whether it slips; of laws without modes it says nothing.
    pub slips: bool,
    /// Normal force N, N.
    pub normal_force: f64,
    /// Sliding velocity v, normal and the rest of the encounter.
    pub at: &'a Encounter,
    /// Stretch ξ in the plane of contact, m; zero of laws without one.
    pub stretch: &'a Vector3<f64>,
}

/// A direction in which a friction law is differentiated.
#[derive(Debug, Clone, Copy)]
pub struct FrictionChange<'a> {
    /// Of the normal force.
    pub normal_force: f64,
    /// Of the encounter.
    pub at: &'a Encounter,
    /// Of the stretch.
    pub stretch: &'a Vector3<f64>,
    /// The parameter of the law that grows at the rate 1, by its place in [`FrictionLaw::parameters`].
    pub parameter: Option<usize>,
}

impl FrictionChange<'_> {
    /// The changes of the N parameters of a law, in their order.
    #[inline]
    pub fn parameters<const N: usize>(&self) -> [f64; N] {
        unit(self.parameter)
    }
}

/// What a friction law gives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrictionResponse {
    /// F on the first body, N, tangential.
    pub force: Vector3<f64>,
    /// ξ̇, m/s; zero of laws without a stretch.
    pub stretch_rate: Vector3<f64>,
}

/// Derivatives of a friction law in some direction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrictionDerivative {
    /// Of the force.
    pub force: Vector3<f64>,
    /// Of the rate of stretch.
    pub stretch_rate: Vector3<f64>,
    /// Of the margin.
    pub margin: f64,
}

/// The spring by which friction holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionSpring {
    /// k > 0, N/m: a stretch ξ holds the force −k ξ at rest.
    pub stiffness: f64,
    /// The longest stretch that does so under the normal force, m.
    pub longest: f64,
}

/// How steep a friction law is at most.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StiffestFriction {
    /// Derivative of the force by the stretch, N/m.
    pub stiffness: f64,
    /// Derivative of the force by the sliding velocity, N s/m.
    pub damping: f64,
    /// Rate at which the stretch relaxes whatever the mass, 1/s.
    pub relaxation: f64,
}

/// A force against sliding as a function of the normal force N (N), of the sliding velocity v (m/s), tangential to the
/// surface, and, of laws that have it, of a stretch ξ (m) in the plane of contact, which is part of the state.
///
/// In each mode the law is smooth; the mode ends where the margin m changes sign,
/// ```text
/// F = F(N, v, ξ; stick),   ξ̇ = g(N, v, ξ; stick)   while m(N, v, ξ; stick) > 0,
/// F = F(N, v, ξ; slip),    ξ̇ = g(N, v, ξ; slip)    while m(N, v, ξ; slip) < 0.
/// ```
/// A contact begins with ξ = 0; the turning of ξ with the plane of contact is not the law's matter. Friction must not
/// give energy, F · v + k ξ · ξ̇ ≤ 0: steps in stiff contacts are accepted by the sum of energies.
///
/// | Required | |
/// |---|---|
/// | [`response`](Self::response) | F and ξ̇ |
/// | [`stiffest`](Self::stiffest) | how steep F is at most: steps in contact are divided by it |
///
/// | Provided | unless overridden |
/// |---|---|
/// | [`has_modes`](Self::has_modes), [`margin`](Self::margin), [`breaks_away`](Self::breaks_away) | no modes |
/// | [`spring`](Self::spring) | no stretch |
/// | [`energy`](Self::energy) | that of the spring, ½ k ξ² |
/// | [`derivative`](Self::derivative), [`parameters`](Self::parameters) | none: sensitivities refuse the law by name |
pub trait FrictionLaw: LawValue {
    /// F and ξ̇.
    fn response(&self, by: &FrictionInput<'_>) -> FrictionResponse;

    /// How steep F is at most, given the normal force at its greatest.
    fn stiffest(&self, normal: &Stiffest) -> StiffestFriction;

    /// Whether it sticks and slips, so that its margin is a guard.
    fn has_modes(&self) -> bool {
        false
    }

    /// m, positive where it sticks and negative where it slips; in any unit.
    fn margin(&self, _by: &FrictionInput<'_>) -> f64 {
        1.0
    }

    /// Whether the force jumps where stick ends.
    fn breaks_away(&self) -> bool {
        false
    }

    /// The spring of the stretch under a normal force (N), where the law has a stretch: with it bodies can be put down at
    /// rest under a load ([`WithStretches::loaded`](crate::stretches::WithStretches::loaded)).
    fn spring(&self, _normal_force: f64) -> Option<FrictionSpring> {
        None
    }

    /// Energy that a stretch stores, J.
    fn energy(&self, stretch: &Vector3<f64>) -> f64 {
        self.spring(0.0).map_or(0.0, |spring| 0.5 * spring.stiffness * stretch.norm_squared())
    }

    /// The names of the constants by which the law can be differentiated.
    fn parameters(&self) -> &'static [&'static str] {
        &[]
    }

    /// Derivatives of F, ξ̇ and m along a change of all that the law depends on and one parameter; `None` where the law
    /// has none.
    fn derivative(&self, _of: &FrictionInput<'_>, _along: &FrictionChange<'_>) -> Option<FrictionDerivative> {
        None
    }
}

impl dyn FrictionLaw {
    /// The law itself, where it is of the type `L`.
    pub fn downcast_ref<L: FrictionLaw>(&self) -> Option<&L> {
        (self as &dyn Any).downcast_ref()
    }
}

impl PartialEq for dyn FrictionLaw {
    fn eq(&self, other: &Self) -> bool {
        self.is_equal(other as &dyn Any)
    }
}
