//! What is taken for granted before the markers are looked at.
//!
//! Second derivatives of the joints at the knots are normal with standard deviations a_c, one for each channel, that are estimated
//! with the fit; the ends of the splines are normal about the posture at the start, so widely that only joints feel it that no
//! marker sees, which also move little; the scale is normal where it is sought, and so is g. Hinges and slides are beyond their limits at the
//! knots by normal numbers: those of living joints are not sharp, and markers that are sure of more are followed.

use super::joints::JointSplines;
use super::unknowns::{Estimate, Layout};
use nalgebra::DMatrix;
use std::ops::Range;

/// Standard deviations before the markers are looked at.
#[derive(Debug, Clone)]
pub(super) struct Prior {
    /// Of the second derivatives of each channel, 1/s².
    accelerations: Vec<f64>,
    /// Of the ends of each channel about the posture.
    ends: Vec<f64>,
    seen: Vec<bool>,
    posture: Vec<f64>,
    /// Mean and standard deviation.
    scale: (f64, f64),
    gravity: (f64, f64),
    /// Limits of each channel.
    limits: Vec<Option<[f64; 2]>>,
}

/// Standard deviation of second derivatives to begin with, 1/s², and bounds of those that are estimated.
const ACCELERATION: f64 = 60.0;
const ACCELERATIONS: [f64; 2] = [2.0, 1000.0];
/// Of a joint that no marker sees.
const UNSEEN_ACCELERATION: f64 = 3.0;
/// Of the ends of joints that markers see, and that none sees, rad or m.
const ENDS: [f64; 2] = [10.0, 0.5];
/// Of channels beyond their limits, rad or m.
const LIMIT: f64 = 0.1;
/// Of g, in fractions.
const GRAVITY: f64 = 1.0;

impl Prior {
    pub(super) fn new(
        posture: &[f64],
        seen: &[bool],
        scale: (f64, f64),
        limits: Vec<Option<[f64; 2]>>,
    ) -> Self {
        let of =
            |values: [f64; 2]| seen.iter().map(|seen| if *seen { values[0] } else { values[1] }).collect();
        Self {
            accelerations: of([ACCELERATION, UNSEEN_ACCELERATION]),
            ends: of(ENDS),
            seen: seen.to_vec(),
            posture: posture.to_vec(),
            scale,
            gravity: (1.0, GRAVITY),
            limits,
        }
    }

    /// The residuals over their standard deviations, each with its derivatives by unknowns.
    fn rows(
        &self,
        layout: &Layout,
        splines: &JointSplines,
        estimate: &Estimate,
        knots: &Range<usize>,
    ) -> Vec<(f64, [(usize, f64); 3])> {
        let n = layout.n_channels;
        let mut rows = Vec::with_capacity((knots.len() + 2) * n + 2);
        let square = splines.spacing().powi(2);
        let at = |knot: usize, c: usize| layout.coefficients() + (knot - knots.start) * n + c;
        for first in knots.start..knots.end.saturating_sub(2) {
            for c in 0..n {
                let factor = 1.0 / (square * self.accelerations[c]);
                let value = |k: usize| estimate.coefficients[(first + k) * n + c];
                let residual = (value(0) - 2.0 * value(1) + value(2)) * factor;
                let by =
                    [(at(first, c), factor), (at(first + 1, c), -2.0 * factor), (at(first + 2, c), factor)];
                rows.push((residual, by));
                if let Some([lower, upper]) = self.limits[c] {
                    let at_knot = (value(0) + 4.0 * value(1) + value(2)) / 6.0;
                    let beyond = at_knot - at_knot.max(lower).min(upper);
                    if beyond != 0.0 {
                        let by = [1.0, 4.0, 1.0].map(|x| x / (6.0 * LIMIT));
                        let by =
                            [(at(first, c), by[0]), (at(first + 1, c), by[1]), (at(first + 2, c), by[2])];
                        rows.push((beyond / LIMIT, by));
                    }
                }
            }
        }
        for knot in [knots.start, knots.end - 1] {
            for c in 0..n {
                let residual = (estimate.coefficients[knot * n + c] - self.posture[c]) / self.ends[c];
                rows.push((residual, [(at(knot, c), 1.0 / self.ends[c]), (0, 0.0), (0, 0.0)]));
            }
        }
        let numbers = [
            (layout.scale(), estimate.scale, self.scale),
            (layout.gravity(), estimate.gravity, self.gravity),
        ];
        for (place, value, (mean, deviation)) in numbers {
            if let Some(k) = place {
                rows.push(((value - mean) / deviation, [(k, 1.0 / deviation), (0, 0.0), (0, 0.0)]));
            }
        }
        rows
    }

    /// Adds the squares to a sum, and their derivatives to the lower half of a matrix and to a gradient.
    pub(super) fn add(
        &self,
        layout: &Layout,
        splines: &JointSplines,
        estimate: &Estimate,
        knots: &Range<usize>,
        matrix: &mut DMatrix<f64>,
        gradient: &mut [f64],
    ) -> f64 {
        let mut squares = 0.0;
        for (residual, by) in self.rows(layout, splines, estimate, knots) {
            squares += residual * residual;
            for (i, x) in by {
                gradient[i] += x * residual;
                for (j, y) in by {
                    if j <= i {
                        matrix[(i, j)] += x * y;
                    }
                }
            }
        }
        squares
    }

    /// The sum of the squares.
    pub(super) fn squares(
        &self,
        layout: &Layout,
        splines: &JointSplines,
        estimate: &Estimate,
        knots: &Range<usize>,
    ) -> f64 {
        self.rows(layout, splines, estimate, knots).iter().map(|(residual, _)| residual * residual).sum()
    }

    /// One step of expectation and maximisation for the second derivatives of the channels that markers see: their mean square
    /// under the posterior, whose `covariance` is that of all unknowns.
    pub(super) fn maximize(
        &mut self,
        layout: &Layout,
        splines: &JointSplines,
        estimate: &Estimate,
        covariance: &DMatrix<f64>,
    ) {
        let n = layout.n_channels;
        let n_rows = splines.n_knots() - 2;
        let square = splines.spacing().powi(2);
        let seen: Vec<usize> = (0..n).filter(|c| self.seen[*c]).collect();
        for c in seen {
            let mut sum = 0.0;
            for first in 0..n_rows {
                let factors = [1.0, -2.0, 1.0];
                let at = |k: usize| layout.coefficients() + (first + k) * n + c;
                let mut mean = 0.0;
                for (i, x) in factors.iter().enumerate() {
                    mean += x * estimate.coefficients[(first + i) * n + c];
                    for (j, y) in factors.iter().enumerate() {
                        sum += x * y * covariance[(at(i), at(j))];
                    }
                }
                sum += mean * mean;
            }
            let deviation = (sum / n_rows as f64).max(0.0).sqrt() / square;
            self.accelerations[c] = deviation.clamp(ACCELERATIONS[0], ACCELERATIONS[1]);
        }
    }
}
