//! The basis of the cart's spline at all places where it is needed.

use crate::shooting::Scheme;
use somersault_core::spline::{SplineError, UniformBasis};
use somersault_multibody::joint_motion::SplineMotion;
use std::ops::Range;

/// Basis functions that act at one place: the splines are quintic.
const ACTIVE: usize = 6;

/// Factors of the coefficients that act at a place.
type Factors = [f64; ACTIVE];

/// Second differences of the coefficients that act at a place: r̈ is a cubic spline in them.
const BENDS: usize = ACTIVE - 2;

/// All places of a motion, and how coefficients follow from parameters.
#[derive(Debug, Clone)]
pub(super) struct Tables {
    /// First of the coefficients that act at each place.
    first: Vec<usize>,
    /// Their factors for r and for its first two rates.
    factors: [Vec<Factors>; 3],
    /// Factors of the second differences for r̈.
    bends: Vec<[f64; BENDS]>,
    pub(super) motion: SplineMotion,
    /// For each coefficient, the parameters it depends on, with factors.
    parameters: Vec<Vec<(usize, f64)>>,
}

impl Tables {
    pub(super) fn try_new(
        motion: SplineMotion,
        scheme: Scheme,
        n_steps: usize,
        duration: f64,
    ) -> Result<Self, SplineError> {
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
        let cubic = UniformBasis::try_new(BENDS - 1, motion.n_coefficients() - 2)?;
        let scale = (cubic.n_intervals() as f64 / duration).powi(2);
        let bend = |k: usize| {
            let mut factors = [0.0; BENDS];
            cubic.evaluate(k as f64 / n_points as f64, 0, &mut factors);
            factors.map(|b| b * scale)
        };
        let bends = (0..=n_points).map(bend).collect();
        Ok(Self { first, factors, bends, parameters, motion })
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
            for (parameter, fraction) in parameters {
                out[parameter - first_parameter] += factor * fraction;
            }
        }
    }

    /// r for derivative 0, ṙ for 1.
    fn value(&self, place: usize, derivative: usize, coefficients: &[f64]) -> f64 {
        product(&self.factors[derivative][place], &coefficients[self.first[place]..])
    }

    /// Adds what a gradient by that number is for the coefficients.
    fn pull_back(&self, place: usize, derivative: usize, by: f64, coefficients: &mut [f64]) {
        let factors = &self.factors[derivative][place];
        coefficients[self.first[place]..].iter_mut().zip(factors).for_each(|(out, b)| *out += by * b);
    }

    /// x − x_f at a place where the pendulum is at (θ, θ̇).
    pub(super) fn apart(
        &self,
        place: usize,
        [angle, rate]: [f64; 2],
        target: &[f64; 4],
        coefficients: &[f64],
    ) -> [f64; 4] {
        let [r, r_rate] = [0, 1].map(|derivative| self.value(place, derivative, coefficients));
        [angle - target[0], r - target[1], rate - target[2], r_rate - target[3]]
    }

    /// From a gradient by the whole state at a place that by (θ, θ̇); adds that by the cart.
    pub(super) fn pull_state(&self, place: usize, by: [f64; 4], coefficients: &mut [f64]) -> [f64; 2] {
        self.pull_back(place, 0, by[1], coefficients);
        self.pull_back(place, 1, by[3], coefficients);
        [by[0], by[2]]
    }

    /// r̈ at all places. `differences` is for the second differences of the coefficients.
    pub(super) fn pushes(&self, coefficients: &[f64], differences: &mut [f64], out: &mut [f64]) {
        for (difference, c) in differences.iter_mut().zip(coefficients.windows(3)) {
            *difference = (c[0] - c[1]) - (c[1] - c[2]);
        }
        for ((out, b), first) in out.iter_mut().zip(&self.bends).zip(&self.first) {
            let d = &differences[*first..][..BENDS];
            *out = (b[0] * d[0] + b[1] * d[1]) + (b[2] * d[2] + b[3] * d[3]);
        }
    }

    /// Adds what a gradient by r̈ at all of `places` is for the coefficients.
    pub(super) fn pull_pushes(&self, places: Range<usize>, by: &[f64], coefficients: &mut [f64]) {
        let mut end = places.start;
        while end < places.end {
            // sums in registers while the same coefficients act
            let first = self.first[end];
            let mut sums = [0.0; BENDS];
            while end < places.end && self.first[end] == first {
                let factors = &self.bends[end];
                (0..BENDS).for_each(|i| sums[i] += by[end] * factors[i]);
                end += 1;
            }
            let out = &mut coefficients[first..][..ACTIVE];
            for (i, sum) in sums.into_iter().enumerate() {
                out[i] += sum;
                out[i + 1] -= 2.0 * sum;
                out[i + 2] += sum;
            }
        }
    }
}

#[inline(always)]
fn product(b: &Factors, coefficients: &[f64]) -> f64 {
    let c = &coefficients[..ACTIVE];
    (b[0] * c[0] + b[1] * c[1] + b[2] * c[2]) + (b[3] * c[3] + b[4] * c[4] + b[5] * c[5])
}
