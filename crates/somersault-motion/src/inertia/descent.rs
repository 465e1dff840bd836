//! Least squares by the method of Levenberg and Marquardt as a trust region, scaled by the columns of the Jacobian.
//!
//! Each step minimises ½|f + J p|² within |D p| ≤ Δ, where D has the greatest norms that the columns of J have had; the multiplier is found by
//! Newton's method on the length of the step, from a singular value decomposition.
//!
//! J. J. Moré, *The Levenberg–Marquardt algorithm: implementation and theory*, Lecture Notes in Mathematics 630, Springer 1978; J. Nocedal and
//! S. J. Wright, *Numerical Optimization*, Springer 2006, section 10.3.

use super::InertiaEstimateError;
use super::problem::Squares;
use super::triangle::singular;
use nalgebra::{DMatrix, DVector};

/// Newton's steps for the multiplier, at most, and how well the length of a step is to meet the radius.
const MULTIPLIER: (usize, f64) = (10, 0.01);
/// Ratios of the decrease to the predicted one below which the radius shrinks, and above which it grows.
const TRUSTED: [f64; 2] = [0.25, 0.75];

/// When a search ends: the sum of squares falls, or the unknowns move, by a smaller fraction; or after so many evaluations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Until {
    pub(super) fraction: f64,
    pub(super) evaluations: usize,
}

/// Where a search has ended.
pub(super) struct End {
    pub(super) x: DVector<f64>,
    /// Whether it is a minimum: the evaluations were enough.
    pub(super) is_minimum: bool,
}

/// Where the least squares are, from `x`; `None` where the residuals are not finite there.
pub(super) fn descend(
    squares: &Squares<'_>,
    mut x: DVector<f64>,
    until: Until,
) -> Result<Option<End>, InertiaEstimateError> {
    let Some(mut cost) = squares.half_sum(&x)? else { return Ok(None) };
    let mut evaluations = 1;
    let mut scale = DVector::zeros(x.len());
    let mut radius = f64::NAN;
    let mut multiplier = 0.0;
    loop {
        let Some(linear) = squares.linearized(&x)? else { return Ok(None) };
        for (scale, column) in scale.iter_mut().zip(linear.triangle.column_iter()) {
            *scale = column.norm().max(*scale);
        }
        let by_scale = scale.map(|norm| if norm == 0.0 { 1.0 } else { norm.recip() });
        if radius.is_nan() {
            let size = x.component_div(&by_scale).norm();
            radius = if size == 0.0 { 1.0 } else { size };
        }
        let Some(model) = Model::new(&linear.triangle, &linear.image, &by_scale, linear.rows) else {
            return Ok(None);
        };
        loop {
            if evaluations == until.evaluations {
                return Ok(Some(End { x, is_minimum: false }));
            }
            let (scaled, predicted) = model.step(radius, &mut multiplier);
            let step = scaled.component_mul(&by_scale);
            let trial = &x + &step;
            evaluations += 1;
            let length = scaled.norm();
            let Some(found) = squares.half_sum(&trial)? else {
                radius = 0.25 * length;
                if radius == 0.0 {
                    return Ok(Some(End { x, is_minimum: true }));
                }
                continue;
            };
            let decrease = cost - found;
            let ratio = if predicted > 0.0 { decrease / predicted } else { 0.0 };
            let small = decrease < until.fraction * cost && ratio > TRUSTED[0]
                || step.norm() < until.fraction * (until.fraction + x.norm())
                || predicted <= 0.0;
            let before = radius;
            if ratio < TRUSTED[0] {
                radius = 0.25 * length;
            } else if ratio > TRUSTED[1] && length > 0.95 * radius {
                radius *= 2.0;
            }
            multiplier *= before / radius;
            if decrease > 0.0 {
                (x, cost) = (trial, found);
            }
            if small {
                return Ok(Some(End { x, is_minimum: true }));
            }
            if decrease > 0.0 {
                break;
            }
        }
    }
}

/// ½|f + J D⁻¹ s|² by the singular values of J D⁻¹.
struct Model {
    values: DVector<f64>,
    /// Right singular vectors, as rows.
    vectors: DMatrix<f64>,
    /// Uᵀf.
    image: DVector<f64>,
    full_rank: bool,
}

impl Model {
    fn new(
        triangle: &DMatrix<f64>,
        image: &DVector<f64>,
        by_scale: &DVector<f64>,
        rows: usize,
    ) -> Option<Self> {
        let mut scaled = triangle.clone();
        scaled.column_iter_mut().zip(by_scale).for_each(|(mut column, by)| column *= *by);
        let (values, vectors, image) = singular(scaled, image)?;
        let full_rank = values.min() > f64::EPSILON * rows as f64 * values.max();
        Some(Self { values, vectors, image, full_rank })
    }

    /// The step within the radius, and the decrease that it predicts; `multiplier` is where the search for it begins, and its end.
    fn step(&self, radius: f64, multiplier: &mut f64) -> (DVector<f64>, f64) {
        if self.full_rank {
            let whole = self.image.component_div(&self.values);
            if whole.norm() <= radius {
                *multiplier = 0.0;
                return self.predicted(&-whole);
            }
        }
        let numerators = self.image.component_mul(&self.values);
        let upper_bound = numerators.norm() / radius;
        // by how much the step is too long, and the derivative of that by the multiplier
        let excess = |at: f64| {
            let (mut square, mut slope) = (0.0, 0.0);
            for (numerator, value) in numerators.iter().zip(&self.values) {
                let denominator = value * value + at;
                square += (numerator / denominator).powi(2);
                slope -= numerator * numerator / denominator.powi(3);
            }
            (square.sqrt() - radius, slope / square.sqrt())
        };
        let (mut lower, mut upper) = (0.0, upper_bound);
        if self.full_rank {
            let (too_long, slope) = excess(0.0);
            lower = -too_long / slope;
        }
        let inside = |lower: f64, upper: f64| (1e-3 * upper).max((lower * upper).sqrt());
        if !self.full_rank && *multiplier == 0.0 {
            *multiplier = inside(lower, upper);
        }
        for _ in 0..MULTIPLIER.0 {
            if !(lower..=upper).contains(multiplier) {
                *multiplier = inside(lower, upper);
            }
            let (too_long, slope) = excess(*multiplier);
            if too_long < 0.0 {
                upper = *multiplier;
            }
            let newton = too_long / slope;
            lower = lower.max(*multiplier - newton);
            *multiplier -= (too_long + radius) * newton / radius;
            if too_long.abs() < MULTIPLIER.1 * radius {
                break;
            }
        }
        let damped = numerators.zip_map(&self.values, |numerator, value| {
            let denominator = value * value + *multiplier;
            if denominator > 0.0 { -numerator / denominator } else { 0.0 }
        });
        let length = damped.norm();
        self.predicted(&if length > 0.0 { damped * (radius / length) } else { damped })
    }

    /// The step whose components along the right singular vectors are given, and the decrease that it predicts.
    fn predicted(&self, along: &DVector<f64>) -> (DVector<f64>, f64) {
        let moved = along.component_mul(&self.values);
        (self.vectors.tr_mul(along), -moved.dot(&self.image) - 0.5 * moved.norm_squared())
    }
}
