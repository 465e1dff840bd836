//! A derivative that a user wrote and that differences contradict, for messages.

use somersault_core::differences::Contradiction;
use std::fmt;

/// A derivative that differences contradict.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct WrongDerivative {
    /// The function whose derivative it is.
    pub function: String,
    /// "jacobian" or "hessian".
    pub derivative: String,
    /// The entry: which output by which argument, or which two arguments.
    pub entry: String,
    /// What was given.
    pub found: f64,
    /// What differences give.
    pub expected: f64,
    /// Where that is, argument by argument.
    pub place: String,
}

impl fmt::Display for WrongDerivative {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { function, derivative, entry, found, expected, place } = self;
        let (found, expected) = (Short(*found), Short(*expected));
        write!(
            f,
            "the {derivative} of `{function}` must be its derivative: {entry} is {found}, and differences give {expected}"
        )?;
        write!(f, " at {place}")
    }
}

/// A number of some six digits.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size == 0.0 || (1e-3..1e6).contains(&size) {
            let rounded = (self.0 * 1e6).round() / 1e6;
            write!(f, "{rounded}")
        } else {
            write!(f, "{:.5e}", self.0)
        }
    }
}

impl WrongDerivative {
    pub(crate) fn new<'a>(
        function: &str,
        derivative: &str,
        entry: String,
        wrong: Contradiction,
        place: impl Iterator<Item = (&'a str, f64)>,
    ) -> Self {
        let place = place.map(|(name, x)| format!("{name} = {}", Short(x)));
        Self {
            function: function.to_owned(),
            derivative: derivative.to_owned(),
            entry,
            found: wrong.found,
            expected: wrong.expected,
            place: place.collect::<Vec<_>>().join(", "),
        }
    }
}
