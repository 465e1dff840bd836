//! What is changed about a flight.

use super::SyntheticError;
use somersault_core::argument::{expect_finite, expect_range};

/// What is changed about a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Perturbation {
    /// How much later the fold opens, s; negative earlier.
    pub exit_delay: f64,
    /// ℓ, fraction by which the fold is smaller: a loose pike. Negative: tighter, maybe beyond the joints' ranges.
    pub looseness: f64,
    /// How much farther the body turns till the entry, rad; negative: short.
    pub over_rotation: f64,
    /// A, amplitude of the wobble as a fraction of the fold.
    pub wobble: f64,
    /// f, of the wobble, Hz.
    pub wobble_frequency: f64,
    /// φ, of the wobble, rad.
    pub wobble_phase: f64,
    /// a, fraction by which joints named `right_…` fold more and those named `left_…` less.
    pub asymmetry: f64,
    /// d, fraction by which the flight lasts longer.
    pub duration: f64,
}

impl Perturbation {
    /// Nothing; a wobble would be of 6 Hz.
    pub fn none() -> Self {
        Self {
            exit_delay: 0.0,
            looseness: 0.0,
            over_rotation: 0.0,
            wobble: 0.0,
            wobble_frequency: 6.0,
            wobble_phase: 0.0,
            asymmetry: 0.0,
            duration: 0.0,
        }
    }

    /// Fails where a number is not finite, or a fraction not below 1.
    pub fn validate(&self) -> Result<(), SyntheticError> {
        let share =
            |argument, found| expect_range(argument, found, "between -1 and 1", |x: f64| x.abs() < 1.0);
        share("looseness", self.looseness)?;
        share("wobble", self.wobble)?;
        share("asymmetry", self.asymmetry)?;
        share("duration", self.duration)?;
        for (argument, found) in [
            ("exit_delay", self.exit_delay),
            ("over_rotation", self.over_rotation),
            ("wobble_frequency", self.wobble_frequency),
            ("wobble_phase", self.wobble_phase),
        ] {
            expect_finite(argument, [&found])?;
        }
        Ok(())
    }
}
