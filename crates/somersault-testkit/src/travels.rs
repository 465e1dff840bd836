//! Seeded problems of two-link arms that travel from rest to rest, folded on the way.

use crate::trees::Random;
use somersault_multibody::models::TwoLinkArm;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// From θ₁ = −travel/2 to travel/2, at rest with θ₂ = 0.05 at both ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Travel {
    /// The arm.
    pub arm: TwoLinkArm,
    /// By how much θ₁ changes, rad.
    pub travel: f64,
    /// In which time, s.
    pub horizon: f64,
    /// θ₂ on the way, π or −π.
    pub fold: f64,
}

/// Masses, lengths and friction within ±50 % of Table 8.1, travel in [π/2, 2π), horizon in [6, 20) s, folds in turn.
pub fn random_travels(seed: u64, count: usize) -> Vec<Travel> {
    let mut random = Random::new(seed);
    let thesis = TwoLinkArm::default();
    let mut varied = |values: [f64; 2]| values.map(|value| value * random.within(0.5, 1.5));
    let mut arm = || TwoLinkArm {
        masses: varied(thesis.masses),
        lengths: varied(thesis.lengths),
        damping: varied(thesis.damping),
    };
    let arms: Vec<TwoLinkArm> = (0..count).map(|_| arm()).collect();
    let travel = |(k, arm)| Travel {
        arm,
        travel: random.within(FRAC_PI_2, TAU),
        horizon: random.within(6.0, 20.0),
        fold: if k % 2 == 0 { PI } else { -PI },
    };
    arms.into_iter().enumerate().map(travel).collect()
}
