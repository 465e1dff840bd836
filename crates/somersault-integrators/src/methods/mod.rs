//! The method table: each method is named here once.
//!
//! The table yields the enumeration [`Method`], its list, its parser and the `match` that enters the
//! loop of a method, once per trajectory. Bindings, benchmarks, documentation and tests iterate over
//! it. A method of your own is a type that implements [`Stepper`]; every driver and study takes one.

mod adams;
mod kick_drift_kick;
mod splitting;
mod table;
mod torque_free;

pub mod ab2;
pub mod ab4;
pub mod aso;
pub mod cf4;
pub mod dmv2;
pub mod dmv2s;
pub mod euler;
pub mod heun;
pub mod imid;
pub mod lgvi;
pub mod mp;
pub mod pmv;
pub mod rk4;
pub mod rkmk;
pub mod rkmk_tableau;
pub mod siabm2;
pub mod siabm4;
pub mod sie;
pub mod sieg;
pub mod split2;
pub mod split4;
pub mod sv;
pub mod sv2;

pub use adams::StartUp;
pub use table::{
    EmbeddedSystemVisitor, EmbeddedVisitor, Method, Options, SystemVisitor, UnknownMethod, Visitor,
};

pub use ab2::AdamsBashforth2;
pub use ab4::AdamsBashforth4;
pub use aso::AugmentedSecondOrder;
pub use cf4::CommutatorFree4;
pub use dmv2::DiscreteMoserVeselov;
pub use dmv2s::SplitMoserVeselov;
pub use euler::Euler;
pub use heun::Heun;
pub use imid::ImplicitMidpoint;
pub use lgvi::VariationalLieVerlet;
pub use mp::Midpoint;
pub use pmv::PreprocessedMoserVeselov;
pub use rk4::RungeKutta4;
pub use rkmk::RungeKuttaMuntheKaas4;
pub use rkmk_tableau::{
    BogackiShampine, Coefficients, Dop853, DormandPrince, EmbeddedCoefficients, RungeKuttaMuntheKaas,
};
pub use siabm2::SemiImplicitAdams2;
pub use siabm4::SemiImplicitAdams4;
pub use sie::SemiImplicitEuler;
pub use sieg::SemiImplicitEulerGyroscopic;
pub use split2::ExactSplitting2;
pub use split4::ExactSplitting4;
pub use sv::StormerVerlet;
pub use sv2::StormerVerlet2;

#[cfg(doc)]
use crate::stepper::Stepper;
