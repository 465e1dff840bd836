//! The basis of the cart's spline at all places where it is needed.

use crate::motion::SplineMotion;
use crate::shooting::Scheme;
use std::ops::Range;

/// Basis functions that act at one place: the splines are quintic.
const ACTIVE: usize = 6;

/// Factors of the coefficients that act at a place.
type Factors = [f64; ACTIVE];

/// All places of a motion, and how coefficients follow from parameters.
#[derive(Debug, Clone)]
pub(super) struct Tables {
    /// First of the coefficients that act at each place.
    first: Vec<usize>,
    /// Their factors for r and for its first two rates.
    factors: [Vec<Factors>; 3],
    pub(super) motion: SplineMotion,
    /// For each coefficient, the parameters it depends on, with factors.
    parameters: Vec<Vec<(usize, f64)>>,
}

impl Tables {
    pub(super) fn new(motion: SplineMotion, scheme: Scheme, n_steps: usize, duration: f64) -> Self {
        let n_points = scheme.points_per_step() * n_steps;
        let mut first = vec![0; n_points + 1];
        let mut scale = 1.0;
        let factors = [0, 1, 2].map(|derivative| {
            let place = |(k, first): (usize, &mut usize)| {
                let mut factors = [0.0; ACTIVE];
                *first = motion.basis().evaluate(k as f64 / n_points as f64, derivative, &mut factors);
                factors.map(|b| b * scale)
            };
            let factors = first.iter_mut().enumerate().map(place).collect();
            scale /= duration;
            factors
        });
        let mut parameters = vec![Vec::new(); motion.n_coefficients()];
        for (coefficient, parameter, factor) in motion.dependences() {
            parameters[coefficient].push((parameter, factor));
        }
        Self { first, factors, parameters, motion }
    }

    /// The parameters that move the cart between two places, or some more.
    pub(super) fn active(&self, places: Range<usize>) -> Range<usize> {
        let coefficients = self.first[places.start]..self.first[places.end] + ACTIVE;
        let all = self.parameters[coefficients].iter().flatten().map(|(parameter, _)| *parameter);
        all.fold(self.motion.n_parameters()..0, |range, j| range.start.min(j)..range.end.max(j + 1))
    }

    /// A rate of r at a place by the parameters from `first_parameter`, of which all others have no part in it.
    pub(super) fn row(&self, place: usize, derivative: usize, first_parameter: usize, out: &mut [f64]) {
        out.fill(0.0);
        let parameters = &self.parameters[self.first[place]..];
        for (factor, parameters) in self.factors[derivative][place].iter().zip(parameters) {
            for (parameter, share) in parameters {
                out[parameter - first_parameter] += factor * share;
            }
        }
    }

    /// r for derivative 0, ṙ for 1.
    pub(super) fn value(&self, place: usize, derivative: usize, coefficients: &[f64]) -> f64 {
        product(&self.factors[derivative][place], &coefficients[self.first[place]..])
    }

    /// Adds what a gradient by that number is for the coefficients.
    pub(super) fn pull_back(&self, place: usize, derivative: usize, by: f64, coefficients: &mut [f64]) {
        let factors = &self.factors[derivative][place];
        coefficients[self.first[place]..].iter_mut().zip(factors).for_each(|(out, b)| *out += by * b);
    }

    /// r̈ at all places.
    pub(super) fn pushes(&self, coefficients: &[f64], out: &mut [f64]) {
        for ((out, factors), first) in out.iter_mut().zip(&self.factors[2]).zip(&self.first) {
            *out = product(factors, &coefficients[*first..]);
        }
    }

    /// Adds what a gradient by r̈ at all of `places` is for the coefficients.
    pub(super) fn pull_pushes(&self, places: Range<usize>, by: &[f64], coefficients: &mut [f64]) {
        let mut end = places.start;
        while end < places.end {
            // sums in registers while the same coefficients act
            let first = self.first[end];
            let mut sums = [0.0; ACTIVE];
            while end < places.end && self.first[end] == first {
                let factors = &self.factors[2][end];
                (0..ACTIVE).for_each(|i| sums[i] += by[end] * factors[i]);
                end += 1;
            }
            coefficients[first..].iter_mut().zip(sums).for_each(|(out, sum)| *out += sum);
        }
    }
}

#[inline(always)]
fn product(b: &Factors, coefficients: &[f64]) -> f64 {
    let c = &coefficients[..ACTIVE];
    (b[0] * c[0] + b[1] * c[1] + b[2] * c[2]) + (b[3] * c[3] + b[4] * c[4] + b[5] * c[5])
}
