//! Uniform B-splines.
//!
//! A spline of degree d with n coefficients is s(x) = Σ c_j b_j(x) on [0, n − d], its knots at the integers.
//! Each basis function is a polynomial of degree d between knots, has d − 1 continuous derivatives, is
//! positive on d + 1 intervals and zero elsewhere; all of them add up to one. So a spline stays within
//! the range of its coefficients, at all times.
//!
//! ```text
//! b_{j,0} = 1 on [j, j + 1),    b_{j,d}(x) = ((x − j) b_{j,d−1}(x) + (j + d + 1 − x) b_{j+1,d−1}(x)) / d,
//! b′_{j,d} = b_{j,d−1} − b_{j+1,d−1}
//! ```
//! For d = 5 these are the quintic ones of thesis (2.14), b_j here being its b_{j+1}, x its s − 3. The argument is
//! the fraction x / (n − d), in [0, 1], of the interval on which the spline lives.
//!
//! Source: C. de Boor, *A Practical Guide to Splines*, Springer 2001, chapters IX and X.

/// The highest degree.
pub const MAX_DEGREE: usize = 15;

/// Why there is no such basis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SplineError {
    /// There is not one interval for the spline to live on.
    #[error("`n_coefficients` must be at least {} for degree {degree}, found {found}", degree + 1)]
    TooFewCoefficients {
        /// Degree requested.
        degree: usize,
        /// Coefficients given.
        found: usize,
    },
    /// The degree is out of range.
    #[error("`degree` must be at most {MAX_DEGREE}, found {found}")]
    Degree {
        /// Degree given.
        found: usize,
    },
}

/// The basis of uniform splines of one degree.
///
/// ```
/// use somersault_core::spline::UniformBasis;
///
/// let basis = UniformBasis::try_new(5, 9)?;
/// let mut values = [0.0; 6];
/// let first = basis.evaluate(0.5, 0, &mut values);
/// assert_eq!(first, 2);
/// assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-15);
/// # Ok::<(), somersault_core::spline::SplineError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UniformBasis {
    degree: usize,
    n_coefficients: usize,
}

impl UniformBasis {
    /// The basis of splines of `degree` with `n_coefficients`, of which at least degree + 1.
    pub fn try_new(degree: usize, n_coefficients: usize) -> Result<Self, SplineError> {
        if degree > MAX_DEGREE {
            return Err(SplineError::Degree { found: degree });
        }
        if n_coefficients <= degree {
            return Err(SplineError::TooFewCoefficients { degree, found: n_coefficients });
        }
        Ok(Self { degree, n_coefficients })
    }

    /// The degree d.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Number of coefficients n.
    pub fn n_coefficients(&self) -> usize {
        self.n_coefficients
    }

    /// Number of basis functions that may differ from zero at one place: d + 1.
    pub fn n_active(&self) -> usize {
        self.degree + 1
    }

    /// Number of intervals between knots: n − d.
    pub fn n_intervals(&self) -> usize {
        self.n_coefficients - self.degree
    }

    /// Writes the `derivative`-th derivative by the fraction of the [`n_active`](Self::n_active) basis functions at
    /// `fraction`, and returns the index of the first of them. Cost O(d²), independent of n.
    ///
    /// Fractions outside of [0, 1] continue the outermost polynomials. At a knot, up to rounding of the fraction, the highest
    /// derivative is that to the right of it, at the end that to the left. NaN is written to `out` where it is shorter than
    /// `n_active`.
    pub fn evaluate(&self, fraction: f64, derivative: usize, out: &mut [f64]) -> usize {
        let d = self.degree;
        if out.len() <= d {
            out.fill(f64::NAN);
            return 0;
        }
        let out = &mut out[..=d];
        let n_intervals = self.n_intervals();
        let x = at_knot(fraction * n_intervals as f64);
        // saturates for what is negative or NaN
        let first = (x as usize).min(n_intervals - 1);
        out.fill(0.0);
        if derivative > d {
            return first;
        }
        let u = x - first as f64;
        let lower = d - derivative;
        out[0] = 1.0;
        for k in 1..=lower {
            let step = 1.0 / k as f64;
            let mut carried = 0.0;
            for (i, value) in out[..k].iter_mut().enumerate() {
                let part = *value * step;
                let right = (i + 1) as f64 - u;
                *value = carried + right * part;
                carried = (u + (k - 1 - i) as f64) * part;
            }
            out[k] = carried;
        }
        let scale = n_intervals as f64;
        for k in lower + 1..=d {
            let mut before = 0.0;
            for value in &mut out[..k] {
                let here = *value * scale;
                *value = before - here;
                before = here;
            }
            out[k] = before;
        }
        first
    }
}

/// The knot that a place in intervals is at but for rounding: k/n × n may be less than k.
fn at_knot(x: f64) -> f64 {
    let knot = x.round();
    if (x - knot).abs() <= 2.0 * f64::EPSILON * knot { knot } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum_of_truncated_powers(j: f64, s: f64) -> f64 {
        let binomials = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0];
        let powers = (-3..=3).map(|k| (s - j - f64::from(k)).max(0.0).powi(5));
        powers.zip(binomials).map(|(p, b)| p * b).sum::<f64>() / 120.0
    }

    #[test]
    fn the_quintic_basis_is_equation_2_14() {
        let (n, mut values) = (9, [0.0; 6]);
        let basis = UniformBasis::try_new(5, n).unwrap();
        for k in 0..=40 {
            let fraction = f64::from(k) / 40.0;
            let s = 3.0 + fraction * basis.n_intervals() as f64;
            let first = basis.evaluate(fraction, 0, &mut values);
            for j in 0..n {
                let ours = j.checked_sub(first).and_then(|i| values.get(i)).copied().unwrap_or(0.0);
                assert!((ours - sum_of_truncated_powers((j + 1) as f64, s)).abs() < 1e-11, "b_{j} at {s}");
            }
        }
    }

    #[test]
    fn a_basis_adds_up_to_one_and_is_positive() {
        for degree in 0..=MAX_DEGREE {
            let basis = UniformBasis::try_new(degree, degree + 4).unwrap();
            let mut values = [0.0; MAX_DEGREE + 1];
            for k in 0..=30 {
                basis.evaluate(f64::from(k) / 30.0, 0, &mut values);
                let active = &values[..=degree];
                assert!((active.iter().sum::<f64>() - 1.0).abs() < 1e-14 && active.iter().all(|v| *v >= 0.0));
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_polynomials_between_knots() {
        // by differences of the derivative below, which are exact to rounding for a polynomial's central difference
        let (degree, h) = (5, 1e-5);
        let basis = UniformBasis::try_new(degree, 8).unwrap();
        let spline = |fraction: f64, derivative: usize| {
            let mut values = [0.0; 6];
            let first = basis.evaluate(fraction, derivative, &mut values);
            (0..6).map(|i| values[i] * ((first + i) as f64 * 0.7).sin()).sum::<f64>()
        };
        for derivative in 1..=degree {
            for fraction in [0.1, 0.27, 0.5, 0.81] {
                let difference =
                    (spline(fraction + h, derivative - 1) - spline(fraction - h, derivative - 1)) / (2.0 * h);
                let found = spline(fraction, derivative);
                assert!(
                    (found - difference).abs() < 1e-6 * (1.0 + found.abs()),
                    "{derivative} at {fraction}"
                );
            }
        }
        assert_eq!(spline(0.3, degree + 1), 0.0);
    }

    #[test]
    fn too_few_coefficients_are_refused() {
        let found = UniformBasis::try_new(5, 5);
        assert_eq!(found, Err(SplineError::TooFewCoefficients { degree: 5, found: 5 }));
        assert_eq!(UniformBasis::try_new(16, 40), Err(SplineError::Degree { found: 16 }));
    }

    #[test]
    fn knots_are_found_whatever_their_rounding() {
        let mut values = [0.0; 6];
        for n_intervals in 1..500 {
            let basis = UniformBasis::try_new(5, n_intervals + 5).unwrap();
            for k in 0..n_intervals {
                let fraction = k as f64 / n_intervals as f64;
                assert_eq!(basis.evaluate(fraction, 0, &mut values), k, "knot {k} of {n_intervals}");
            }
        }
    }
}
