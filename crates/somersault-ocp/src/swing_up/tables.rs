//! The basis of the cart's spline at all places where it is needed, by the parameters.

use crate::motion::SplineMotion;
use crate::shooting::Scheme;

/// Basis functions that act at one place; quintic, and no more after elimination than there are parameters.
const ACTIVE: usize = 6;

/// One place: coefficients from `first` with their factors, for r and for its first two rates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) first: usize,
    pub(super) factors: [[f64; ACTIVE]; 3],
}

/// All places of a motion, and how coefficients follow from parameters.
#[derive(Debug, Clone)]
pub(super) struct Tables {
    pub(super) places: Vec<Place>,
    pub(super) motion: SplineMotion,
    /// For each place, parameters that have acted until there.
    pub(super) reached: Vec<usize>,
    /// For each place, r, ṙ and r̈ by all parameters.
    pub(super) rows: Vec<[Vec<f64>; 3]>,
}

impl Tables {
    pub(super) fn new(motion: SplineMotion, scheme: Scheme, n_steps: usize, duration: f64) -> Self {
        let n_points = scheme.points_per_step() * n_steps;
        let (mut places, mut rows) = (Vec::new(), Vec::new());
        let dependences: Vec<_> = motion.dependences().collect();
        for k in 0..=n_points {
            let share = k as f64 / n_points as f64;
            let mut place = Place { first: 0, factors: [[0.0; ACTIVE]; 3] };
            for (derivative, factors) in place.factors.iter_mut().enumerate() {
                place.first = motion.basis().evaluate(share, derivative, factors);
                let scale = (0..derivative).fold(1.0, |scale, _| scale / duration);
                factors.iter_mut().for_each(|b| *b *= scale);
            }
            let row = |factors: &[f64; ACTIVE]| {
                let mut row = vec![0.0; motion.n_parameters()];
                for (coefficient, parameter, factor) in &dependences {
                    if let Some(b) = coefficient.checked_sub(place.first).and_then(|i| factors.get(i)) {
                        row[*parameter] += factor * b;
                    }
                }
                row
            };
            rows.push([row(&place.factors[0]), row(&place.factors[1]), row(&place.factors[2])]);
            places.push(place);
        }
        let last = |rows: &[Vec<f64>; 3]| {
            rows.iter()
                .filter_map(|row| row.iter().rposition(|x| *x != 0.0))
                .map(|j| j + 1)
                .max()
                .unwrap_or(0)
        };
        let mut reached: Vec<usize> = rows.iter().map(last).collect();
        for k in 1..reached.len() {
            reached[k] = reached[k].max(reached[k - 1]);
        }
        Self { places, motion, reached, rows }
    }
}

impl Place {
    /// r for derivative 0, ṙ for 1, r̈ for 2.
    #[inline(always)]
    pub(super) fn value(&self, derivative: usize, coefficients: &[f64]) -> f64 {
        let (b, c) = (&self.factors[derivative], &coefficients[self.first..][..ACTIVE]);
        (b[0] * c[0] + b[1] * c[1] + b[2] * c[2]) + (b[3] * c[3] + b[4] * c[4] + b[5] * c[5])
    }

    /// Adds what a gradient by that number is for the coefficients.
    #[inline(always)]
    pub(super) fn pull_back(&self, derivative: usize, by: f64, coefficients: &mut [f64]) {
        let out = &mut coefficients[self.first..][..ACTIVE];
        out.iter_mut().zip(&self.factors[derivative]).for_each(|(out, b)| *out += by * b);
    }
}
