//! Checks of arguments, and what a failed one says.

use nalgebra::Vector3;

/// An argument that is not allowed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ArgumentError {
    /// It has the wrong number of entries.
    #[error("`{argument}` must have {expected} entries, found {found}")]
    Length {
        /// Name of the argument.
        argument: &'static str,
        /// Entries it should have.
        expected: usize,
        /// Entries it has.
        found: usize,
    },
    /// It has too few entries.
    #[error("`{argument}` must have at least {least} entries, found {found}")]
    TooFew {
        /// Name of the argument.
        argument: &'static str,
        /// Entries needed.
        least: usize,
        /// Entries given.
        found: usize,
    },
    /// A number is NaN or infinite.
    #[error("`{argument}` must be finite, found {found}")]
    NonFinite {
        /// Name of the argument.
        argument: &'static str,
        /// The number.
        found: f64,
    },
    /// A number that must be positive is not.
    #[error("`{argument}` must be positive and finite, found {found}")]
    NotPositive {
        /// Name of the argument.
        argument: &'static str,
        /// The number.
        found: f64,
    },
    /// A number that must not be negative is.
    #[error("`{argument}` must be finite and not negative, found {found}")]
    Negative {
        /// Name of the argument.
        argument: &'static str,
        /// The number.
        found: f64,
    },
    /// A number is so large that its square may not be finite.
    #[error("`{argument}` must be within ±1e100, found {found:e}")]
    TooLarge {
        /// Name of the argument.
        argument: &'static str,
        /// The number.
        found: f64,
    },
    /// A number is not among those allowed.
    #[error("`{argument}` must be {allowed}, found {found}")]
    OutOfRange {
        /// Name of the argument.
        argument: &'static str,
        /// What it may be.
        allowed: &'static str,
        /// The number.
        found: f64,
    },
}

/// The largest number whose square, products of it with weights and sums of them stay finite.
pub const LARGEST: f64 = 1e100;

/// Fails unless an argument has as many entries as it should.
#[inline(always)]
pub fn expect_length(argument: &'static str, found: usize, expected: usize) -> Result<(), ArgumentError> {
    if found == expected { Ok(()) } else { Err(ArgumentError::Length { argument, expected, found }) }
}

/// Fails where an argument has too few entries.
pub fn expect_least(argument: &'static str, found: usize, least: usize) -> Result<(), ArgumentError> {
    if found >= least { Ok(()) } else { Err(ArgumentError::TooFew { argument, least, found }) }
}

/// Fails unless every number is finite.
pub fn expect_finite<'a>(
    argument: &'static str,
    numbers: impl IntoIterator<Item = &'a f64>,
) -> Result<(), ArgumentError> {
    match numbers.into_iter().find(|x| !x.is_finite()) {
        Some(&found) => Err(ArgumentError::NonFinite { argument, found }),
        None => Ok(()),
    }
}

/// The number, if it is above zero and finite.
pub fn expect_positive(argument: &'static str, found: f64) -> Result<f64, ArgumentError> {
    if found.is_finite() && found > 0.0 {
        Ok(found)
    } else {
        Err(ArgumentError::NotPositive { argument, found })
    }
}

/// The unit vector along one of any length; one of length 1 within rounding stays as it is.
pub fn expect_direction(argument: &'static str, vector: Vector3<f64>) -> Result<Vector3<f64>, ArgumentError> {
    let length = expect_positive(argument, vector.norm())?;
    let is_unit = (length - 1.0).abs() <= 2.0 * f64::EPSILON;
    Ok(if is_unit { vector } else { vector / length })
}

/// The number, if it is zero or above and finite.
pub fn expect_not_negative(argument: &'static str, found: f64) -> Result<f64, ArgumentError> {
    if found.is_finite() && found >= 0.0 {
        Ok(found)
    } else {
        Err(ArgumentError::Negative { argument, found })
    }
}

/// Fails unless every number is finite and at most [`LARGEST`].
pub fn expect_squarable<'a>(
    argument: &'static str,
    numbers: impl IntoIterator<Item = &'a f64>,
) -> Result<(), ArgumentError> {
    for &found in numbers {
        if !found.is_finite() {
            return Err(ArgumentError::NonFinite { argument, found });
        }
        if found.abs() > LARGEST {
            return Err(ArgumentError::TooLarge { argument, found });
        }
    }
    Ok(())
}

/// The number, if it is `inside`, which `allowed` describes.
pub fn expect_range(
    argument: &'static str,
    found: f64,
    allowed: &'static str,
    inside: impl FnOnce(f64) -> bool,
) -> Result<f64, ArgumentError> {
    if inside(found) { Ok(found) } else { Err(ArgumentError::OutOfRange { argument, allowed, found }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a check says.
    fn said<T>(check: Result<T, ArgumentError>) -> String {
        check.map_or_else(|error| error.to_string(), |_| String::new())
    }

    #[test]
    fn a_check_names_the_argument_what_is_allowed_and_what_was_found() {
        assert_eq!(said(expect_length("q", 3, 4)), "`q` must have 4 entries, found 3");
        assert_eq!(said(expect_least("times", 1, 2)), "`times` must have at least 2 entries, found 1");
        assert_eq!(said(expect_finite("v", &[0.0, f64::NAN])), "`v` must be finite, found NaN");
        assert_eq!(said(expect_squarable("v", &[f64::INFINITY])), "`v` must be finite, found inf");
        assert_eq!(said(expect_squarable("v", &[-2e100])), "`v` must be within ±1e100, found -2e100");
        let share = |x| expect_range("share", x, "from 0 to 1", |x| (0.0..=1.0).contains(&x));
        assert_eq!(said(share(1.5)), "`share` must be from 0 to 1, found 1.5");
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(
                said(expect_positive("h", bad)),
                format!("`h` must be positive and finite, found {bad}")
            );
        }
        for bad in [-1e-300, f64::NAN, f64::INFINITY] {
            let expected = format!("`h` must be finite and not negative, found {bad}");
            assert_eq!(said(expect_not_negative("h", bad)), expected);
        }
    }

    #[test]
    fn a_check_hands_on_what_is_allowed() {
        assert_eq!(expect_positive("h", 1e-300), Ok(1e-300));
        assert_eq!(expect_not_negative("h", 0.0), Ok(0.0));
        assert_eq!(expect_range("h", 2.0, "any", |_| true), Ok(2.0));
        assert_eq!(said(expect_length("q", 4, 4)), "");
        assert_eq!(said(expect_least("q", 4, 4)), "");
        assert_eq!(said(expect_finite("q", &[1e300])), "");
        assert_eq!(said(expect_squarable("q", &[1e100])), "");
    }
}
