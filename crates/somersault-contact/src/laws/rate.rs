//! How fast contacts are: stiffness and damping over the masses that they move.

use nalgebra::Vector3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::state::RigidBodyState;

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
