//! Derivatives by differences of values, and derivatives that are given compared with them.
//!
//! With values of relative error ε, central differences with the step ε^⅓ are off by about ε^⅔, second differences with the
//! step ε^¼ by √ε (Nocedal & Wright 2006, section 8.1). Functions take many points at once, one after the other in a slice.

use crate::argument::{ArgumentError, expect_range};

/// Step of the slopes that given derivatives are compared with, relative to the argument.
const STEP: f64 = 1e-5;
/// Fraction of itself by which an entry may differ from slopes: a tenth of what is to be found.
const WRONG: f64 = 2e-4;
/// Rounding of a function relative to its value: functions of many terms lose some digits.
const ROUNDING: f64 = 1e-13;

/// A function of points, whose values it writes; behind a pointer, so that differences are compiled once for a type of errors.
pub type Function<'a, E> = dyn FnMut(&[f64], &mut [f64]) -> Result<(), E> + 'a;

/// Differences of a function whose values have a relative error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Differences {
    error: f64,
}

impl Differences {
    /// Of values that are right to rounding.
    pub const OF_ROUNDED: Self = Self { error: f64::EPSILON };

    /// Of values with a relative error, from rounding to 10⁻².
    pub fn try_new(error: f64) -> Result<Self, ArgumentError> {
        let allowed = "from 2.2e-16, which is rounding, to 0.01";
        let is_useful = |error| (2.2e-16..=1e-2).contains(&error);
        Ok(Self { error: expect_range("relative_error", error, allowed, is_useful)? })
    }

    /// The relative error of the values.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// The relative error of first derivatives, about.
    pub fn accuracy(&self) -> f64 {
        self.error.powf(2.0 / 3.0)
    }

    /// The step from `x` for first derivatives; `size` is the least that the argument counts as.
    pub fn step(&self, x: f64, size: f64) -> f64 {
        self.error.cbrt() * x.abs().max(size)
    }

    fn long_step(&self, x: f64, size: f64) -> f64 {
        self.error.sqrt().sqrt() * x.abs().max(size)
    }

    /// The m × n Jacobian at a point, row by row: central differences, or those of second order to one side where the function
    /// has no value on the other.
    pub fn jacobian<E>(
        &self,
        at: &[f64],
        sizes: &[f64],
        m: usize,
        values: &mut Function<'_, E>,
        jacobian: &mut [f64],
    ) -> Result<(), E> {
        let n = at.len();
        let steps: Vec<f64> = at.iter().zip(sizes).map(|(x, size)| self.step(*x, *size)).collect();
        let mut points = Points::new(at);
        steps
            .iter()
            .enumerate()
            .for_each(|(j, h)| [*h, -*h].into_iter().for_each(|h| points.push(&[(j, h)])));
        let found = points.evaluated(m, values)?;
        for (j, pair) in found.chunks_exact(2 * m.max(1)).enumerate() {
            let (right, left) = pair.split_at(m);
            let by = (at[j] + steps[j]) - (at[j] - steps[j]);
            if pair.iter().all(|y| y.is_finite()) {
                (0..m).for_each(|i| jacobian[i * n + j] = (right[i] - left[i]) / by);
                continue;
            }
            let h = if right.iter().all(|y| y.is_finite()) { steps[j] } else { -steps[j] };
            let mut points = Points::new(at);
            [0.0, h, 2.0 * h].into_iter().for_each(|h| points.push(&[(j, h)]));
            let side = points.evaluated(m, values)?;
            let by = 2.0 * ((at[j] + h) - at[j]);
            for i in 0..m {
                jacobian[i * n + j] = (4.0 * side[m + i] - 3.0 * side[i] - side[2 * m + i]) / by;
            }
        }
        Ok(())
    }

    /// Adds the n × n Hessian of Σ wᵢ fᵢ at a point, by second differences of values.
    pub fn add_hessian<E>(
        &self,
        at: &[f64],
        sizes: &[f64],
        weights: &[f64],
        values: &mut Function<'_, E>,
        hessian: &mut [f64],
    ) -> Result<(), E> {
        let (n, m) = (at.len(), weights.len());
        // such that x + h − x is h
        let exact = |(x, size): (&f64, &f64)| (x + self.long_step(*x, *size)) - x;
        let steps: Vec<f64> = at.iter().zip(sizes).map(exact).collect();
        let mut points = Points::new(at);
        points.push(&[]);
        for (i, &h) in steps.iter().enumerate() {
            points.push(&[(i, h)]);
            points.push(&[(i, -h)]);
        }
        for (i, &h) in steps.iter().enumerate() {
            for (j, &k) in steps.iter().enumerate().take(i) {
                points.push(&[(i, h), (j, k)]);
                points.push(&[(i, -h), (j, -k)]);
            }
        }
        let found = points.evaluated(m, values)?;
        let sum = |point: usize| -> f64 {
            found[point * m..(point + 1) * m].iter().zip(weights).map(|(y, w)| w * y).sum()
        };
        let middle = sum(0);
        // what both steps along an argument make of it, less the middle
        let bends: Vec<f64> = (0..n).map(|i| (sum(1 + 2 * i) - middle) + (sum(2 + 2 * i) - middle)).collect();
        let mut pair = 1 + 2 * n;
        for i in 0..n {
            hessian[i * n + i] += bends[i] / (steps[i] * steps[i]);
            for j in 0..i {
                let both = (sum(pair) - middle) + (sum(pair + 1) - middle);
                let mixed = (both - bends[i] - bends[j]) / (2.0 * steps[i] * steps[j]);
                hessian[i * n + j] += mixed;
                hessian[j * n + i] += mixed;
                pair += 2;
            }
        }
        Ok(())
    }

    /// Adds the n × n Hessian of Σ wᵢ fᵢ at a point, by central differences of m × n Jacobians.
    pub fn add_hessian_of_jacobians<E>(
        &self,
        at: &[f64],
        sizes: &[f64],
        weights: &[f64],
        jacobians: &mut Function<'_, E>,
        hessian: &mut [f64],
    ) -> Result<(), E> {
        let (n, m) = (at.len(), weights.len());
        let mut slopes = |points: &[f64], out: &mut [f64]| {
            let mut found = vec![0.0; points.len() / n.max(1) * m * n];
            jacobians(points, &mut found)?;
            for (slope, jacobian) in out.chunks_exact_mut(n).zip(found.chunks_exact(m * n)) {
                slope.fill(0.0);
                for (row, w) in jacobian.chunks_exact(n).zip(weights) {
                    slope.iter_mut().zip(row).for_each(|(s, y)| *s += w * y);
                }
            }
            Ok(())
        };
        let mut found = vec![0.0; n * n];
        if m > 0 {
            self.jacobian(at, sizes, n, &mut slopes, &mut found)?;
        }
        for i in 0..n {
            for j in 0..n {
                hessian[i * n + j] += 0.5 * (found[i * n + j] + found[j * n + i]);
            }
        }
        Ok(())
    }
}

/// Points about another, one after the other.
struct Points<'a> {
    at: &'a [f64],
    all: Vec<f64>,
    count: usize,
}

impl<'a> Points<'a> {
    fn new(at: &'a [f64]) -> Self {
        Self { at, all: Vec::new(), count: 0 }
    }

    fn push(&mut self, moves: &[(usize, f64)]) {
        let first = self.all.len();
        self.all.extend_from_slice(self.at);
        moves.iter().for_each(|(j, h)| self.all[first + j] += h);
        self.count += 1;
    }

    fn evaluated<E>(self, m: usize, values: &mut Function<'_, E>) -> Result<Vec<f64>, E> {
        let mut found = vec![0.0; self.count * m];
        values(&self.all, &mut found)?;
        Ok(found)
    }
}

/// Slopes of a function at a point, row by row: the least and the largest value that each may have.
#[derive(Debug, Clone, PartialEq)]
pub struct Slopes {
    least: Vec<f64>,
    largest: Vec<f64>,
    n: usize,
}

/// An entry of a Jacobian that slopes contradict.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contradiction {
    /// Its row.
    pub row: usize,
    /// Its column.
    pub column: usize,
    /// What was given.
    pub found: f64,
    /// The slope.
    pub expected: f64,
}

impl Slopes {
    /// Slopes to both sides, since the function may have a kink there; none where it has no value. What a step of half the length
    /// changes is allowed for, and the error of the values, which is relative to what they are sums of: those may cancel.
    pub fn try_of<E>(
        at: &[f64],
        sizes: &[f64],
        m: usize,
        differences: Differences,
        values: &mut Function<'_, E>,
    ) -> Result<Option<Self>, E> {
        let n = at.len();
        let part = STEP.max(differences.error.cbrt());
        let rounding = ROUNDING.max(10.0 * differences.error);
        let mut points = Points::new(at);
        points.push(&[]);
        let full: Vec<f64> = at.iter().zip(sizes).map(|(x, size)| part * x.abs().max(*size)).collect();
        for (j, &h) in full.iter().enumerate() {
            // to either side: by a whole step and by half of one
            [h, -h, 0.5 * h, -0.5 * h].into_iter().for_each(|h| points.push(&[(j, h)]));
        }
        let found = points.evaluated(m, values)?;
        let (value, moved) = found.split_at(m);
        // a value, or what an argument contributes to it
        let mut terms: Vec<f64> = value.iter().map(|y| y.abs()).collect();
        for row in moved.chunks_exact(m.max(1)) {
            for (i, term) in terms.iter_mut().enumerate() {
                *term = term.max((row[i] - value[i]).abs() / part);
            }
        }
        let mut slopes = Self { least: vec![0.0; m * n], largest: vec![0.0; m * n], n };
        for j in 0..n {
            let h = full[j];
            for i in 0..m {
                let slope =
                    |k: usize, h: f64| (moved[(4 * j + k) * m + i] - value[i]) / ((at[j] + h) - at[j]);
                let (right, left) = (slope(0, h), slope(1, -h));
                let (near_right, near_left) = (slope(2, 0.5 * h), slope(3, -0.5 * h));
                let truncation = ((right + left) - (near_right + near_left)).abs();
                let slack = truncation + rounding * terms[i] / (0.5 * h);
                slopes.least[i * n + j] = right.min(left) - slack;
                slopes.largest[i * n + j] = right.max(left) + slack;
            }
        }
        let is_finite = found.iter().chain(&slopes.least).chain(&slopes.largest).all(|x| x.is_finite());
        Ok(is_finite.then_some(slopes))
    }

    /// Number of arguments.
    pub fn n_columns(&self) -> usize {
        self.n
    }

    /// The first entry of a Jacobian, given row by row, that these slopes contradict.
    pub fn contradicted(&self, given: &[f64]) -> Option<Contradiction> {
        let ranges = self.least.iter().zip(&self.largest);
        given.iter().zip(ranges).enumerate().find_map(|(entry, (&found, (&least, &largest)))| {
            let slack = WRONG * found.abs().max(least.abs()).max(largest.abs());
            // a NaN is not within
            let is_within = least - slack <= found && found <= largest + slack;
            (!is_within).then(|| Contradiction {
                row: entry / self.n,
                column: entry % self.n,
                found,
                expected: 0.5 * (least + largest),
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x² y + e^x and sin(x y), at points one after the other.
    fn values(points: &[f64], out: &mut [f64]) -> Result<(), ()> {
        for (point, out) in points.chunks_exact(2).zip(out.chunks_exact_mut(2)) {
            let (x, y) = (point[0], point[1]);
            out.copy_from_slice(&[x * x * y + x.exp(), (x * y).sin()]);
        }
        Ok(())
    }

    fn jacobians(points: &[f64], out: &mut [f64]) -> Result<(), ()> {
        for (point, out) in points.chunks_exact(2).zip(out.chunks_exact_mut(4)) {
            let (x, y) = (point[0], point[1]);
            let c = (x * y).cos();
            out.copy_from_slice(&[2.0 * x * y + x.exp(), x * x, y * c, x * c]);
        }
        Ok(())
    }

    const AT: [f64; 2] = [0.7, -1.3];

    #[test]
    fn differences_have_the_error_that_they_state() {
        let mut exact = [0.0; 4];
        jacobians(&AT, &mut exact).unwrap();
        let mut found = [0.0; 4];
        let differences = Differences::OF_ROUNDED;
        differences.jacobian(&AT, &[1.0; 2], 2, &mut values, &mut found).unwrap();
        for (a, b) in exact.iter().zip(found) {
            assert!((a - b).abs() < 10.0 * differences.accuracy(), "{a} {b}");
        }
        // the Hessian of 2 f₀ − 3 f₁
        let (x, y) = (AT[0], AT[1]);
        let (s, c) = (x * y).sin_cos();
        let mixed = 4.0 * x - 3.0 * (c - x * y * s);
        let exact = [2.0 * (2.0 * y + x.exp()) + 3.0 * y * y * s, mixed, mixed, 3.0 * x * x * s];
        let (mut second, mut of_slopes) = ([0.0; 4], [0.0; 4]);
        differences.add_hessian(&AT, &[1.0; 2], &[2.0, -3.0], &mut values, &mut second).unwrap();
        let weights = [2.0, -3.0];
        differences
            .add_hessian_of_jacobians(&AT, &[1.0; 2], &weights, &mut jacobians, &mut of_slopes)
            .unwrap();
        for k in 0..4 {
            assert!((exact[k] - second[k]).abs() < 1e-6, "{} {}", exact[k], second[k]);
            assert!((exact[k] - of_slopes[k]).abs() < 1e-9, "{} {}", exact[k], of_slopes[k]);
        }
    }

    #[test]
    fn rounding_of_terms_that_cancel_is_no_contradiction() {
        // x does not act, but moves the digits of what it is added to and taken from
        let mut values = |points: &[f64], out: &mut [f64]| -> Result<(), ()> {
            let all = points.chunks_exact(2).zip(out);
            all.for_each(|(point, y)| *y = ((1e3 * point[1] + point[0]) - 1e3) - point[0]);
            Ok(())
        };
        for x in 1..200 {
            let slopes = Slopes::try_of(
                &[0.01 * f64::from(x), 1.0],
                &[1.0; 2],
                1,
                Differences::OF_ROUNDED,
                &mut values,
            );
            let slopes = slopes.unwrap().unwrap();
            assert_eq!(slopes.contradicted(&[0.0, 1e3]), None, "{x}");
            assert!(slopes.contradicted(&[0.1, 1e3]).is_some());
        }
    }

    #[test]
    fn differences_are_taken_to_the_side_that_has_values() {
        let mut root = |points: &[f64], out: &mut [f64]| -> Result<(), ()> {
            points.iter().zip(out).for_each(|(x, y)| *y = x.powi(3) + x.sqrt() * 0.0);
            Ok(())
        };
        let mut slope = [f64::NAN];
        Differences::OF_ROUNDED.jacobian(&[0.0], &[1.0], 1, &mut root, &mut slope).unwrap();
        assert!(slope[0].abs() < 1e-9, "{}", slope[0]);
    }

    #[test]
    fn a_wrong_entry_is_found_and_a_kink_is_not_one() {
        let mut given = [0.0; 4];
        jacobians(&AT, &mut given).unwrap();
        let slopes =
            Slopes::try_of(&AT, &[1.0; 2], 2, Differences::OF_ROUNDED, &mut values).unwrap().unwrap();
        assert_eq!(slopes.contradicted(&given), None);
        given[2] *= 1.001;
        let wrong = slopes.contradicted(&given).unwrap();
        assert_eq!((wrong.row, wrong.column, wrong.found), (1, 0, given[2]));
        assert!((wrong.expected - given[2] / 1.001).abs() < 1e-6);
        let mut kinked = |points: &[f64], out: &mut [f64]| -> Result<(), ()> {
            points.iter().zip(out).for_each(|(x, y)| *y = x.abs());
            Ok(())
        };
        let slopes =
            Slopes::try_of(&[0.0], &[1.0], 1, Differences::OF_ROUNDED, &mut kinked).unwrap().unwrap();
        assert!([-1.0, 0.0, 1.0].into_iter().all(|slope| slopes.contradicted(&[slope]).is_none()));
        assert!(slopes.contradicted(&[1.1]).is_some());
    }

    #[test]
    fn errors_beyond_use_are_refused() {
        assert!(Differences::try_new(1e-8).is_ok());
        for error in [0.0, -1.0, 0.1, f64::NAN] {
            assert!(Differences::try_new(error).is_err());
        }
    }
}
