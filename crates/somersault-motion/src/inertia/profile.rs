//! Intervals by the profile of the likelihood: how far a function of the unknowns may be from where it is best, when all other
//! unknowns give way.
//!
//! With g(x) held at g₀ ± d the least sum of squares rises by E(d). Where the residuals are linear, E = (d/s)² with the standard
//! deviation s of g, and the interval ends where E is the square q² of the quantile. Where a valley bends E rises slower, and the interval
//! is longer than derivatives say.
//!
//! D. M. Bates and D. G. Watts, *Nonlinear Regression Analysis and Its Applications*, Wiley 1988, chapter 6.

use super::InertiaEstimateError;
use super::descent::{Until, descend};
use super::problem::{Held, Motion, OF_INERTIA, Record, Squares, UNKNOWNS, Unknowns, slopes};
use super::search::{Fit, PRIOR, ROUNDING};
use crate::noise::standard_deviation;
use nalgebra::{DVector, SMatrix, SVector};
use somersault_core::cancel::CancellationToken;

/// The rise at which a distance counts as the end, as a fraction of q².
const ENOUGH: f64 = 0.8;
/// By how much a distance grows that is not enough, and how often.
const LONGER: (f64, usize) = (1.5, 12);
/// How much a function that is held costs where it stays as it was, as a multiple of q².
const HELD: f64 = 9.0;
/// The shortest distance that is looked at.
const SHORTEST: f64 = 1e-4;
/// Evaluations of each search.
const EVALUATIONS: usize = 25;

/// Where the rise of the sum of squares is looked for.
pub(super) struct Profile<'a> {
    pub(super) record: &'a Record<'a>,
    pub(super) fit: &'a Fit,
    pub(super) covariance: &'a SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    pub(super) sigma: f64,
    pub(super) quantile: f64,
    pub(super) token: &'a CancellationToken,
}

impl Profile<'_> {
    /// How far a function may be from its value, downwards and upwards, at the level of the quantile: as far as derivatives say, or
    /// farther. Infinite where no end is found within `most`.
    pub(super) fn distances(
        &self,
        function: &dyn Fn(&Unknowns) -> f64,
        most: f64,
    ) -> Result<[f64; 2], InertiaEstimateError> {
        let slope = slopes(|x| SVector::<f64, 1>::new(function(x)), &self.fit.x);
        let spread = self.covariance * slope.transpose();
        let variance = (slope * spread)[0];
        let half_width = self.quantile * standard_deviation(variance);
        // what is exact to rounding has no noise that a rise could be compared with
        if self.sigma < ROUNDING || half_width.is_nan() || half_width == 0.0 {
            return Ok([half_width; 2]);
        }
        let mut ends = [half_width; 2];
        for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
            *end = self.distance(function, &(spread * (sign / variance)), sign, half_width, most)?;
        }
        Ok(ends)
    }

    /// That in one direction, in which the unknowns move by `along` for each unit of the function.
    fn distance(
        &self,
        function: &dyn Fn(&Unknowns) -> f64,
        along: &Unknowns,
        sign: f64,
        half_width: f64,
        most: f64,
    ) -> Result<f64, InertiaEstimateError> {
        let best = function(&self.fit.x);
        let (mut x, mut reached, mut distance) = (self.fit.x, 0.0, half_width.max(SHORTEST));
        for _ in 0..LONGER.1 {
            x += along * (distance - reached);
            reached = distance;
            let rise = self.rise(function, best + sign * distance, distance, &mut x)?;
            if rise >= ENOUGH {
                return Ok(half_width.max(distance / rise.sqrt()));
            }
            if distance > most {
                break;
            }
            distance *= LONGER.0;
        }
        Ok(f64::INFINITY)
    }

    /// E/q² with the function held at `target`, and the unknowns there, from `x`; infinite where the function cannot be there.
    fn rise(
        &self,
        function: &dyn Fn(&Unknowns) -> f64,
        target: f64,
        distance: f64,
        x: &mut Unknowns,
    ) -> Result<f64, InertiaEstimateError> {
        let Self { record, fit, sigma, quantile, token, .. } = self;
        let motion = |x: &[f64]| Motion::tumbling(x, &fit.base);
        let ties = Some((PRIOR * sigma, [0.0; OF_INERTIA]));
        let whole = quantile * sigma;
        let held = Some(Held { factor: HELD.sqrt() * whole / distance, target, function });
        let squares = Squares { record, part: 0..record.times.len(), motion: &motion, ties, held, token };
        let start = |x: &Unknowns| DVector::from_column_slice(x.as_slice());
        // at the best fit nothing is held but the distance
        let Some(at_best) = squares.half_sum(&start(&fit.x))? else { return Ok(f64::INFINITY) };
        let Some(before) = squares.half_sum(&start(x))? else { return Ok(f64::INFINITY) };
        // a start that is dearer than the best fit is worse than that
        let from = if before < at_best { *x } else { fit.x };
        let base = 2.0 * at_best - HELD * whole * whole;
        let until =
            Until { fraction: 1e-2 * whole * whole / at_best.max(whole * whole), evaluations: EVALUATIONS };
        let Some(end) = descend(&squares, start(&from), until)? else { return Ok(f64::INFINITY) };
        let Some(cost) = squares.half_sum(&end.x)? else { return Ok(f64::INFINITY) };
        *x = Unknowns::from_column_slice(end.x.as_slice());
        // T of min E s² + HELD (1 − s)² is E HELD/(E + HELD)
        let total = ((2.0 * cost - base) / (whole * whole)).max(0.0);
        Ok(if total < HELD { total * HELD / (HELD - total) } else { f64::INFINITY })
    }
}
