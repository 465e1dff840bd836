//! Whether finite-time exponents and the directions that they belong to have converged in the averaging time.

use super::growth::{Growth, Law, Unsettled};
use super::{Spectrum, SpectrumError, Subspace, TimeDirection};
use std::f64::consts::LN_2;
use std::fmt;

/// Whether exponents have converged, and why not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ExponentConvergence {
    /// Every exponent is known to the tolerance.
    Converged,
    /// No perturbation grows or decays by a rate, and this one does like a power of time.
    Power {
        /// Number of the exponent, from 1.
        number: usize,
        /// The power.
        power: f64,
    },
    /// The law of an exponent is not known.
    Unknown {
        /// Number of the exponent, from 1.
        number: usize,
        /// Why.
        why: Unsettled,
    },
    /// The error of an exponent is above the tolerance.
    Error {
        /// Number of the exponent, from 1.
        number: usize,
        /// The error, 1/s.
        error: f64,
        /// What it may be, 1/s.
        allowed: f64,
    },
    /// Every exponent is zero within its error, and no rate serves for comparison.
    Neutral,
}

impl fmt::Display for Unsettled {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::FewTimes => "has fewer than 16 averaging times in the last three quarters of the time",
            Self::Trend => "still changes from the first to the last of that time",
            Self::Slow => "has acted for less than three time constants",
            Self::NoValue => "has no value",
        })
    }
}

impl fmt::Display for ExponentConvergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Converged => f.write_str("the exponents have converged"),
            Self::Power { number, power } => write!(
                f,
                "no exponent is a rate: the stretch of exponent {number} grows like T to the power {power:.2}, so that it falls like ln T/T to zero"
            ),
            Self::Unknown { number, why } => write!(f, "exponent {number} {why}"),
            Self::Error { number, error, allowed } => {
                write!(f, "exponent {number} has an error of {error:.2e} 1/s, {allowed:.2e} is allowed")
            }
            Self::Neutral => {
                f.write_str("every exponent is zero within its error, and no rate serves for comparison")
            }
        }
    }
}

/// A power of time from which the growth of a motion without rates is not neutral.
const HIDDEN_POWER: f64 = 0.5;

impl ExponentConvergence {
    /// Of exponents with laws and errors: the latter may be `tolerance` times the largest rate, or times `scale` where there is no
    /// rate. A power of time counts as an exponent of zero, known to as much as it is from zero; where there is no rate beside it,
    /// nothing has converged, though it be hidden in oscillations.
    pub fn of(growths: &[Growth], errors: &[f64], tolerance: f64, scale: Option<f64>) -> Self {
        let numbered = || (1..).zip(growths);
        for (number, growth) in numbered() {
            if let Law::Unknown(why) = growth.law {
                return Self::Unknown { number, why };
            }
        }
        let rates = growths.iter().filter(|growth| growth.law == Law::Exponential);
        let largest = rates.map(|growth| growth.rate.abs()).reduce(f64::max);
        if largest.is_none()
            && let Some((number, growth)) =
                numbered().find(|(_, growth)| growth.law == Law::Power || growth.power.abs() >= HIDDEN_POWER)
        {
            return Self::Power { number, power: growth.power };
        }
        let Some(scale) = largest.or(scale) else { return Self::Neutral };
        let allowed = tolerance * scale;
        let wide = (1..).zip(errors).find(|(_, error)| error.is_nan() || **error > allowed);
        match wide {
            Some((number, &error)) => Self::Error { number, error, allowed },
            None => Self::Converged,
        }
    }
}

/// How a subspace of the slowest directions settles with the averaging time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settling {
    /// The law of the gap between the exponents beside which it ends.
    pub gap: Growth,
    /// The largest angle between the subspaces at half of the time and at the end, rad.
    pub change: f64,
    /// The rate at which that angle falls with the averaging time, 1/s: the gap, for a gap of rates. NaN where too few times show
    /// it.
    pub rate: f64,
}

/// What spectra at one point tell of their convergence.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectraConvergence {
    /// The laws of the exponents, in their order.
    pub growths: Vec<Growth>,
    /// The subspaces of the first vectors, as many as there are vectors but one.
    pub subspaces: Vec<Settling>,
    /// Of the exponents.
    pub convergence: ExponentConvergence,
}

/// Smallest angle that is not rounding, rad.
const ROUNDING: f64 = 1e-11;

impl SpectraConvergence {
    /// From spectra at one point for ascending averaging times; errors may be `tolerance` times the largest rate.
    pub fn of(spectra: &[Spectrum], tolerance: f64) -> Result<Self, SpectrumError> {
        Spectrum::expect_family(spectra)?;
        let last = spectra.last().ok_or(SpectrumError::Empty)?;
        let n = last.exponents.len();
        let times: Vec<f64> = spectra.iter().map(|spectrum| spectrum.time).collect();
        let logs = |i: usize| -> Vec<f64> { spectra.iter().map(|s| s.exponents[i] * s.time).collect() };
        let growths: Vec<_> = (0..n).map(|i| Growth::of(&times, &logs(i))).collect();
        let errors: Vec<_> = growths.iter().map(|growth| growth.error).collect();
        let convergence = ExponentConvergence::of(&growths, &errors, tolerance, None);
        let subspaces = (1..n).map(|k| {
            let gaps: Vec<_> =
                logs(k).iter().zip(logs(k - 1)).map(|(next, log)| (next - log).abs()).collect();
            settling(spectra, k, Growth::of(&times, &gaps))
        });
        Ok(Self { subspaces: subspaces.collect(), growths, convergence })
    }
}

/// How the span of the first `k` vectors settles.
fn settling(spectra: &[Spectrum], k: usize, gap: Growth) -> Settling {
    let spaces: Vec<Subspace> =
        spectra.iter().map(|spectrum| Subspace::of_columns(&spectrum.vectors, 0..k)).collect();
    let (Some(space), Some(end)) = (spaces.last(), spectra.last().map(|last| last.time)) else {
        return Settling { gap, change: f64::NAN, rate: f64::NAN };
    };
    let angles: Vec<(f64, f64)> = spectra
        .iter()
        .zip(&spaces)
        .map(|(spectrum, other)| (spectrum.time, other.angles(space).last().copied().unwrap_or(0.0)))
        .collect();
    let half = angles.iter().rev().find(|(time, _)| *time <= 0.5 * end * (1.0 + 1e-12));
    let change = half.map_or(f64::NAN, |(_, angle)| *angle);
    // near the end the angle is zero by its definition, and an angle of half a radian is not small
    let falling: Vec<_> = angles
        .iter()
        .filter(|(time, angle)| *time <= 0.75 * end && (ROUNDING..0.5).contains(angle))
        .collect();
    let rate = match (falling.first(), falling.last()) {
        (Some((t, angle)), Some((later, smaller))) if angle / smaller > 1.0 + LN_2 && later > t => {
            (angle / smaller).ln() / (later - t)
        }
        _ => f64::NAN,
    };
    Settling { gap, change, rate }
}

impl Spectrum {
    /// Fails unless spectra are of one dimension and direction, for ascending times.
    pub(super) fn expect_family(spectra: &[Self]) -> Result<(), SpectrumError> {
        for pair in spectra.windows(2) {
            let (expected, found) = (pair[0].exponents.len(), pair[1].exponents.len());
            if found != expected {
                return Err(SpectrumError::Sizes { expected, found });
            }
            let (before, after) = (pair[0].time, pair[1].time);
            if pair[0].direction != pair[1].direction || before.is_nan() || after.is_nan() || before >= after
            {
                return Err(SpectrumError::Order { before, after });
            }
        }
        Ok(())
    }

    /// The largest exponent in its direction of time, with the direction that it stretches.
    pub fn largest(&self) -> (f64, Vec<f64>) {
        let at = match self.direction {
            TimeDirection::Forward => self.exponents.len().saturating_sub(1),
            TimeDirection::Backward => 0,
        };
        (self.exponents[at], self.vectors.column(at).iter().copied().collect())
    }
}
