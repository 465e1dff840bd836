//! Laws of contacts: along the normal, against sliding, against rolling and spinning.
//!
//! Laws see an [`Encounter`] and nothing else, but for the stretch of friction, so that a law and a shape never meet.
//! A law along the normal is a [`NormalLaw`], one against sliding a [`FrictionLaw`]; a [`ContactLaw`] holds them. Each
//! has a file with all that the library asks of it: value, guard, energy, stiffness, derivative and their test.
//!
//! | Law | Force | Modes | State |
//! |---|---|---|---|
//! | [`CompliantLaw`](compliant::CompliantLaw) | −k Δx − c Δẋ | open and closed | none |
//! | [`HuntCrossley`](hunt_crossley::HuntCrossley) | k x^{3/2} (1 + 3/2 α ẋ) with x = −Δx | open and closed | none |
//! | [`CoulombFriction`](coulomb::CoulombFriction) | −min(‖p‖, μ N) p/‖p‖ with p = k ξ + c v | stick and slip | the stretch ξ |
//! | [`RegularisedFriction`](regularised::RegularisedFriction) | −μ N v/√(v² + v_ε²) | none | none |
//! | [`Resistance`](resistance::Resistance) | couples against rolling and spinning | none | none |
//!
//! N is the normal force and v the sliding velocity, tangential to the surface.

mod contact_law;
mod encounter;
mod friction;
mod friction_law;
mod normal_law;
mod rate;
mod value;

pub mod compliant;
pub mod coulomb;
pub mod hunt_crossley;
pub mod regularised;
pub mod resistance;

#[cfg(test)]
mod checks;

pub use contact_law::{ContactLaw, ContactMode};
pub use encounter::Encounter;
pub use friction::Friction;
pub use friction_law::{
    FrictionChange, FrictionDerivative, FrictionInput, FrictionLaw, FrictionResponse, FrictionSpring,
    StiffestFriction,
};
pub use normal_law::{NormalChange, NormalDerivative, NormalLaw, Stiffest};
pub use rate::{ContactRate, Mobility};
pub use value::LawValue;

pub(crate) use contact_law::{ContactChange, LawParameter};
