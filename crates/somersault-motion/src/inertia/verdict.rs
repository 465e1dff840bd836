//! What the best of the fits determines, and how well.

use super::descent::{End, descend};
use super::distribution::{chi_squared_tail, f_tail, two_sided_quantile};
use super::problem::{Motion, OF_INERTIA, Principal, Record, Squares, UNKNOWNS, Unknowns, slopes, step};
use super::profile::Profile;
use super::search::{Fit, PRECISE, PRIOR, ROUNDING};
use super::triangle::singular;
use super::{
    FittedMotion, InertiaEstimate, InertiaEstimateError, InertiaOptions, InertiaStatus, significant,
};
use crate::noise::standard_deviation;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x6, Matrix3, Matrix6, SMatrix, SVector};
use nalgebra::{SymmetricEigen, UnitQuaternion, Vector3, Vector6};
use somersault_core::Inertia;
use somersault_core::cancel::CancellationToken;
use somersault_core::lie::so3;
use somersault_integrators::body::RigidBody;
use somersault_integrators::state::RigidBodyState;

/// Level of the tests of what is not determined.
const SURE: f64 = 1e-3;
/// Standard deviations from which another inertia is another one.
const APART: f64 = 6.0;
/// Half width of the interval of a ratio beyond which it says little.
const WIDE: f64 = 0.25;
/// What two moments that are taken for equal may differ by, as a fraction of their mean.
const DIFFERENT: f64 = 0.05;
/// The principal moments in their order.
const NAMES: [&str; 3] = ["least", "middle", "greatest"];
/// Singular values below this fraction of the greatest are zero.
const SINGULAR: f64 = 1e-14;

/// A covariance of the unknowns.
type Covariance = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// What `fits`, the best first, say.
pub(super) fn judge(
    record: &Record<'_>,
    fits: &[Fit],
    options: &InertiaOptions,
    token: &CancellationToken,
) -> Result<InertiaEstimate, InertiaEstimateError> {
    let InertiaOptions { noise, level } = *options;
    let nothing = |status, reason: String| InertiaEstimate::nothing(status, reason, level);
    let Some(fit) = fits.first() else {
        let reason = "no motion of a free body is near the attitudes".to_owned();
        return Ok(nothing(InertiaStatus::Misfit, reason));
    };
    let freedom = fit.freedom();
    let estimated = (fit.square / freedom).sqrt();
    if let Some(misfit) = fit.misfit(noise) {
        let reason = format!("{misfit}: the body is not free or not rigid, or another motion fits");
        let residuals = fit.residuals.clone();
        return Ok(InertiaEstimate { noise: estimated, residuals, ..nothing(InertiaStatus::Misfit, reason) });
    }
    let sigma = noise.unwrap_or(estimated.max(1e-16));
    let singular_fit = || {
        let reason = "the derivative of the attitudes by the unknowns is not finite".to_owned();
        Ok(nothing(InertiaStatus::Weak, reason))
    };
    let Some(covariance) = covariance(record, fit, sigma, token)? else { return singular_fit() };

    let Some(steady) = steady(record, fit, sigma, token)? else { return singular_fit() };
    let excess = steady.square - fit.square;
    let turns_steadily = match noise {
        Some(noise) => chi_squared_tail(excess / (noise * noise), OF_INERTIA as f64) > SURE,
        None => {
            let mean = (fit.square / freedom).max(ROUNDING * ROUNDING);
            f_tail(excess / OF_INERTIA as f64 / mean, OF_INERTIA as f64, freedom) > SURE
        }
    };
    if turns_steadily {
        let reason = "the body turns steadily about one axis, within the noise: that is a principal axis, and the moments may be any";
        return Ok(InertiaEstimate {
            angular_velocity: steady.angular_velocity,
            angular_velocity_errors: steady.angular_velocity_errors,
            momentum_direction: steady.momentum_direction,
            momentum_error: steady.momentum_error,
            noise: estimated,
            residuals: fit.residuals.clone(),
            ..nothing(InertiaStatus::Steady, reason.to_owned())
        });
    }
    let first = record.times[0];
    let at_start = |x: &Unknowns| Motion::tumbling(x.as_slice(), &fit.base).at(first);
    let momentum = |x: &Unknowns| {
        let (orientation, rate) = at_start(x);
        unit(&(orientation * (Principal::of_numbers(&x.as_slice()[..OF_INERTIA]).tensor() * rate)))
    };
    let (orientation, angular_velocity) = at_start(&fit.x);
    let mut found = InertiaEstimate {
        angular_velocity,
        angular_velocity_errors: errors(&slopes(|x| at_start(x).1, &fit.x), &covariance),
        momentum_direction: momentum(&fit.x),
        momentum_error: errors(&slopes(momentum, &fit.x), &covariance).max(),
        noise: estimated,
        residuals: fit.residuals.clone(),
        ..nothing(InertiaStatus::Identified, "moments and axes are determined".to_owned())
    };
    let moments =
        Moments::new(fit, &covariance, two_sided_quantile(level, noise.is_none().then_some(freedom)));
    found.ratios = moments.ratios;
    found.ratio_intervals = moments.intervals().map(within_one);
    found.axes = moments.axes;
    found.axis_errors = moments.axis_errors;
    found.inertia = moments.tensor;
    let is_weak = |found: InertiaEstimate, reason: String| {
        Ok(InertiaEstimate { status: InertiaStatus::Weak, reason, ..found })
    };
    let body =
        Inertia::try_tensor(moments.tensor).ok().and_then(|inertia| RigidBody::try_new(1.0, inertia).ok());
    let start =
        RigidBodyState::new(Vector3::zeros(), orientation, Vector3::zeros(), orientation * angular_velocity);
    found.motion = body.and_then(|body| FittedMotion::try_new(body, start, record.first).ok());
    if found.motion.is_none() {
        return is_weak(found, "the least moment is zero within rounding: the body is a rod".to_owned());
    }
    if !fit.is_minimum {
        let reason = "the search for the least squares did not end: inertias that differ much fit nearly as well, as near the separatrix";
        return is_weak(found, reason.to_owned());
    }
    if let Some(rival) = rival(fits, &moments, sigma.max(ROUNDING)) {
        for (interval, other) in found.ratio_intervals.iter_mut().zip(&rival) {
            *interval = within_one([interval[0].min(*other), interval[1].max(*other)]);
        }
        let [least, middle] = [0, 1].map(|k| significant(rival[k], 3));
        return is_weak(
            found,
            format!(
                "moments as {least}, {middle}, 1 fit as well: so it is near the separatrix, where the angular velocity stays in a plane of the body \
                 and tells one number of the inertia"
            ),
        );
    }
    let wide = moments.half_widths[0].max(moments.half_widths[1]);
    if wide > WIDE || moments.equal.len() > 1 {
        return is_weak(
            found,
            format!(
                "the ratios of the moments are known to ±{} only: the body hardly wobbles, is near the separatrix, or the record is short",
                significant(wide, 2)
            ),
        );
    }
    let profile = Profile { record, fit, covariance: &covariance, sigma, quantile: moments.quantile, token };
    if let [pair] = moments.equal[..] {
        let bound = moments.greatest_difference(pair, &profile)?;
        if bound > DIFFERENT || pair[1] - pair[0] > 1 {
            let [one, other] = pair.map(|k| NAMES[k]);
            let bound = significant(bound, 2);
            return is_weak(
                found,
                format!(
                    "the {one} and the {other} moment may be equal, but differ by up to a fraction of {bound}"
                ),
            );
        }
        let off = moments.pair_off(pair, &profile)?;
        if off > WIDE {
            return is_weak(found, bends(3 - pair[0] - pair[1]));
        }
        moments.make_equal(&mut found, pair, bound, off, fit);
        return Ok(found);
    }
    for k in 0..2 {
        let [below, above] = profile.distances(&|x| sorted_ratios(x)[k], WIDE)?;
        found.ratio_intervals[k] = within_one([moments.ratios[k] - below, moments.ratios[k] + above]);
        if below.max(above) > WIDE {
            return is_weak(found, bends(k));
        }
    }
    Ok(found)
}

/// Why a moment is not determined whose likelihood has no end within what is allowed.
fn bends(moment: usize) -> String {
    format!(
        "the ratio of the {} moment is known to ±{WIDE} only: along a valley that bends, the sum of squares rises slower than its derivatives say",
        NAMES[moment]
    )
}

/// The moments in their order as fractions of the greatest.
fn sorted_ratios(x: &Unknowns) -> Vector3<f64> {
    let mut moments: [f64; 3] = Principal::of_numbers(&x.as_slice()[..OF_INERTIA]).moments.into();
    moments.sort_by(f64::total_cmp);
    Vector3::from(moments) / moments[2]
}

/// Ends of an interval within 0 and 1.
fn within_one(ends: [f64; 2]) -> [f64; 2] {
    ends.map(|end| end.clamp(0.0, 1.0))
}

fn unit(vector: &Vector3<f64>) -> Vector3<f64> {
    vector / vector.norm().max(1e-300)
}

/// (JᵀJ)⁺ σ² of a triangle with the products of the derivative of the residuals, by unknowns scaled to unit columns. `None` where a number is
/// not finite.
fn inverse_normal(triangle: &DMatrix<f64>, sigma: f64) -> Option<DMatrix<f64>> {
    let mut scaled = triangle.clone();
    let norms: Vec<f64> = scaled.column_iter().map(|column| column.norm().max(1e-300)).collect();
    scaled.column_iter_mut().zip(&norms).for_each(|(mut column, norm)| column /= *norm);
    let (values, mut rows, _) = singular(scaled, &DVector::zeros(norms.len()))?;
    let zero = SINGULAR * values.max();
    for (mut row, value) in rows.row_iter_mut().zip(&values) {
        row *= if *value > zero { sigma / value } else { 0.0 };
    }
    rows.column_iter_mut().zip(&norms).for_each(|(mut column, norm)| column /= *norm);
    Some(rows.tr_mul(&rows))
}

/// The covariance of the unknowns of a fit.
fn covariance(
    record: &Record<'_>,
    fit: &Fit,
    sigma: f64,
    token: &CancellationToken,
) -> Result<Option<Covariance>, InertiaEstimateError> {
    let motion = |x: &[f64]| Motion::tumbling(x, &fit.base);
    let ties = Some((PRIOR * sigma, [0.0; OF_INERTIA]));
    let squares = Squares { record, part: 0..record.times.len(), motion: &motion, ties, held: None, token };
    let linear = squares.linearized(&DVector::from_column_slice(fit.x.as_slice()))?;
    let found = linear.and_then(|linear| inverse_normal(&linear.triangle, sigma));
    Ok(found.map(|found| Covariance::from_column_slice(found.as_slice())))
}

/// Standard deviations of a function of the unknowns, by its derivative.
fn errors<const M: usize>(slopes: &SMatrix<f64, M, UNKNOWNS>, covariance: &Covariance) -> SVector<f64, M> {
    (slopes * covariance * slopes.transpose()).diagonal().map(standard_deviation)
}

/// The moments of a fit, and how well they are determined.
struct Moments {
    ratios: Vector3<f64>,
    axes: Matrix3<f64>,
    tensor: Matrix3<f64>,
    quantile: f64,
    half_widths: Vector3<f64>,
    /// Covariance of what [`in_axes`] gives.
    within: Matrix6<f64>,
    /// Pairs that are equal within their errors.
    equal: Vec<[usize; 2]>,
    axis_errors: Vector3<f64>,
}

impl Moments {
    fn new(fit: &Fit, covariance: &Covariance, quantile: f64) -> Self {
        let body = Principal::of_numbers(&fit.x.as_slice()[..OF_INERTIA]);
        let mut order = [0, 1, 2];
        order.sort_by(|i, j| body.moments[*i].total_cmp(&body.moments[*j]));
        let greatest = body.moments[order[2]];
        let ratios = Vector3::from(order.map(|k| body.moments[k] / greatest));
        let [first, second] = [0, 1].map(|k| body.axes.column(order[k]).into_owned());
        let axes = Matrix3::from_columns(&[first, second, first.cross(&second)]);
        let slopes = slopes(|x| in_axes(x, &axes), &fit.x);
        let within = slopes * covariance * slopes.transpose();
        let mut equal = Vec::new();
        let mut axis_errors = Vector3::zeros();
        // of two moments that are equal, half the difference and the product of inertia are both zero
        for (k, [i, j]) in [[1, 2], [0, 2], [0, 1]].into_iter().enumerate() {
            let gap = ratios[j] - ratios[i];
            let mut pair = Matrix2x6::zeros();
            (pair[(0, i)], pair[(0, j)], pair[(1, 3 + k)]) = (-0.5, 0.5, 1.0);
            let apart = square_over(0.5 * gap, &(pair * within * pair.transpose()));
            if chi_squared_tail(apart, 2.0) > SURE {
                equal.push([i, j]);
                axis_errors[k] = f64::INFINITY;
            } else {
                axis_errors[k] = standard_deviation(within[(3 + k, 3 + k)]) / gap;
            }
        }
        let half_widths =
            within.diagonal().fixed_rows::<3>(0).map(|variance| quantile * standard_deviation(variance));
        let tensor = body.tensor() / greatest;
        Self { ratios, axes, tensor, quantile, half_widths, within, equal, axis_errors }
    }

    /// Ends of the intervals of the ratios.
    fn intervals(&self) -> [[f64; 2]; 3] {
        let mut found =
            [0, 1, 2].map(|k| [self.ratios[k] - self.half_widths[k], self.ratios[k] + self.half_widths[k]]);
        found[2] = [1.0; 2];
        found
    }

    /// What two moments differ by at most, at the level of the intervals, as a fraction of their mean.
    fn greatest_difference(
        &self,
        [i, j]: [usize; 2],
        profile: &Profile<'_>,
    ) -> Result<f64, InertiaEstimateError> {
        let mean = 0.5 * (self.ratios[i] + self.ratios[j]);
        let apart = |x: &Unknowns| {
            let own = in_axes(x, &self.axes);
            (own[j] - own[i]) / mean
        };
        Ok((self.ratios[j] - self.ratios[i]) / mean + profile.distances(&apart, DIFFERENT)?[1])
    }

    /// The third moment as a fraction of the mean of a pair, which is not drawn apart by noise.
    fn over_pair(&self, x: &Unknowns, [i, j]: [usize; 2]) -> f64 {
        let own = in_axes(x, &self.axes);
        2.0 * own[3 - i - j] / (own[i] + own[j])
    }

    /// By how much that may be off, at the level of the intervals.
    fn pair_off(&self, pair: [usize; 2], profile: &Profile<'_>) -> Result<f64, InertiaEstimateError> {
        let [below, above] = profile.distances(&|x| self.over_pair(x, pair), WIDE)?;
        Ok(below.max(above))
    }

    /// Says of a pair of moments that they are equal, whose difference is at most `bound` of their mean; `off` is that of the third
    /// over the mean.
    fn make_equal(&self, found: &mut InertiaEstimate, [i, j]: [usize; 2], bound: f64, off: f64, fit: &Fit) {
        let third = 3 - i - j;
        let ratio = self.over_pair(&fit.x, [i, j]);
        // each of the two is by up to half the bound away from their mean
        let [below, above] = [1.0 - 0.5 * bound, 1.0 + 0.5 * bound];
        let of_third = [ratio, (ratio - off) * below, ratio + off];
        let of_two = [1.0 / ratio, below / (ratio + off), above / (ratio - off)];
        for k in 0..3 {
            let [value, low, high] = match (k == third, third == 2) {
                (true, false) => of_third,
                (false, true) => of_two,
                (false, false) if k < 2 => [1.0, 1.0 - bound, 1.0],
                (true, true) | (false, false) => [1.0; 3],
            };
            (found.ratios[k], found.ratio_intervals[k]) = (value, within_one([low, high]));
            if k != third {
                found.axes.column_mut(k).fill(f64::NAN);
            }
        }
        found.status = InertiaStatus::Symmetric;
        found.reason = format!(
            "the {} and the {} moment are equal within their errors: the principal axes across the third one may be any",
            NAMES[i], NAMES[j]
        );
    }
}

/// v² of the first of two numbers, the second being zero, over their covariance; infinite where that is zero.
fn square_over(v: f64, covariance: &Matrix2<f64>) -> f64 {
    let eigen = SymmetricEigen::new(*covariance);
    let greatest = eigen.eigenvalues.max();
    if greatest <= 0.0 {
        return f64::INFINITY;
    }
    let along = |k: usize| {
        let value = eigen.eigenvalues[k];
        if value > f64::EPSILON * greatest { (v * eigen.eigenvectors[(0, k)]).powi(2) / value } else { 0.0 }
    };
    along(0) + along(1)
}

/// Moments 11, 22, 33 and products 23, 13, 12 of inertia about axes, as fractions of the third moment.
fn in_axes(x: &Unknowns, axes: &Matrix3<f64>) -> Vector6<f64> {
    let turned = axes.transpose() * Principal::of_numbers(&x.as_slice()[..OF_INERTIA]).tensor() * axes;
    let m = |i: usize, j: usize| turned[(i, j)] / turned[(2, 2)];
    Vector6::new(m(0, 0), m(1, 1), m(2, 2), m(1, 2), m(0, 2), m(0, 1))
}

/// The ratios of the moments of another inertia that is as likely as the best.
fn rival(fits: &[Fit], best: &Moments, sigma: f64) -> Option<Vector3<f64>> {
    let allowed = best.within.diagonal().map(|variance| APART * standard_deviation(variance) + 1e-6);
    let (fit, others) = fits.split_first()?;
    let other = others.iter().find(|other| {
        let excess = (other.square - fit.square) / (sigma * sigma);
        let off = in_axes(&other.x, &best.axes) - in_axes(&fit.x, &best.axes);
        chi_squared_tail(excess, OF_INERTIA as f64) > SURE
            && off.zip_fold(&allowed, false, |any, off, allowed| any || off.abs() > allowed)
    })?;
    Some(sorted_ratios(&other.x))
}

/// The rotation of constant angular velocity that is nearest to the attitudes.
struct Steady {
    square: f64,
    angular_velocity: Vector3<f64>,
    angular_velocity_errors: Vector3<f64>,
    momentum_direction: Vector3<f64>,
    momentum_error: f64,
}

/// That of a fit; `None` where a number is not finite.
fn steady(
    record: &Record<'_>,
    fit: &Fit,
    sigma: f64,
    token: &CancellationToken,
) -> Result<Option<Steady>, InertiaEstimateError> {
    let motion = |x: &[f64]| Motion::steady(x, &fit.base);
    let squares =
        Squares { record, part: 0..record.times.len(), motion: &motion, ties: None, held: None, token };
    let mut start = DVector::zeros(6);
    start.rows_mut(3, 3).copy_from(&fit.x.fixed_rows::<3>(8));
    let Some(End { x, .. }) = descend(&squares, start, PRECISE)? else { return Ok(None) };
    let covariance = squares.linearized(&x)?.and_then(|linear| inverse_normal(&linear.triangle, sigma));
    let Some(covariance) = covariance else { return Ok(None) };
    let direction = |x: &DVector<f64>| steady_direction(x, &fit.base);
    let mut slopes = DMatrix::zeros(3, 6);
    for k in 0..6 {
        let h = step(x[k]);
        let [mut right, mut left] = [x.clone(), x.clone()];
        right[k] += h;
        left[k] -= h;
        slopes.set_column(k, &((direction(&right) - direction(&left)) / (2.0 * h)));
    }
    let across = &slopes * &covariance * slopes.transpose();
    Ok(Some(Steady {
        square: squares.residuals(&x)?.iter().map(Vector3::norm_squared).sum(),
        angular_velocity: x.fixed_rows::<3>(3).into_owned(),
        angular_velocity_errors: Vector3::from_fn(|k, _| standard_deviation(covariance[(3 + k, 3 + k)])),
        momentum_direction: direction(&x),
        momentum_error: standard_deviation(across.diagonal().max()),
    }))
}

/// The direction of the axis in the world of rotation R₀ exp(δ) exp(ω t).
fn steady_direction(x: &DVector<f64>, base: &UnitQuaternion<f64>) -> Vector3<f64> {
    let turn = base * so3::exp(&x.fixed_rows::<3>(0).into_owned());
    unit(&(turn * x.fixed_rows::<3>(3).into_owned()))
}
