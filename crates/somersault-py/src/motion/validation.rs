//! How well motions are scored.

use super::matrix::numbers_array;
use super::scoring::{Performance, ScoringOptions, performances};
use super::worker::attended;
use crate::convert::{real_numbers, with_shape};
use crate::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::motion::scoring::{self, ValidationOptions};

/// Resamples that memory is certainly there for.
const MOST_RESAMPLES: usize = 100_000_000;

/// A coefficient of correlation with its bootstrap interval.
#[pyclass(frozen, module = "somersault.motion")]
#[derive(Clone, Copy)]
pub(crate) struct Correlation {
    correlation: scoring::Correlation,
}

#[pymethods]
impl Correlation {
    /// float: The coefficient.
    #[getter]
    fn value(&self) -> f64 {
        self.correlation.value
    }

    /// tuple of float: Lower and upper end of the percentile interval.
    #[getter]
    fn interval(&self) -> (f64, f64) {
        self.correlation.interval.into()
    }

    fn __repr__(&self) -> String {
        let [lower, upper] = self.correlation.interval;
        format!("<Correlation: {:.3} in [{lower:.3}, {upper:.3}]>", self.correlation.value)
    }
}

/// A simple predictor, validated in the same way.
#[pyclass(frozen, module = "somersault.motion")]
#[derive(Clone)]
pub(crate) struct Baseline {
    baseline: scoring::Baseline,
}

#[pymethods]
impl Baseline {
    /// str: ``'mean'``, ``'duration'``, or the name of a feature.
    #[getter]
    fn name(&self) -> &str {
        &self.baseline.name
    }

    /// ndarray, shape (n_motions,): Predictions, each from all other motions.
    #[getter]
    fn predictions<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numbers_array(py, &self.baseline.predictions)
    }

    /// float: Root mean square of their errors.
    #[getter]
    fn rms_error(&self) -> f64 {
        self.baseline.rms_error
    }

    fn __repr__(&self) -> String {
        format!("<Baseline: {}, rms error {:.3}>", self.baseline.name, self.baseline.rms_error)
    }
}

/// Leave-one-out predictions, and what they are worth.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct Validation {
    validation: scoring::Validation,
}

#[pymethods]
impl Validation {
    /// ndarray, shape (n_motions,): The score of each motion by a model of all others.
    #[getter]
    fn predictions<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numbers_array(py, &self.validation.predictions)
    }

    /// list of int: Components of that model.
    #[getter]
    fn n_components(&self) -> Vec<usize> {
        self.validation.n_components.clone()
    }

    /// float: Root mean square of the errors.
    #[getter]
    fn rms_error(&self) -> f64 {
        self.validation.rms_error
    }

    /// Correlation: Pearson's, of scores with predictions less the mean of the other scores.
    #[getter]
    fn pearson(&self) -> Correlation {
        Correlation { correlation: self.validation.pearson }
    }

    /// Correlation: Spearman's, of the same.
    #[getter]
    fn spearman(&self) -> Correlation {
        Correlation { correlation: self.validation.spearman }
    }

    /// list of Baseline: The mean of the others; a straight line over the duration, and over each feature.
    #[getter]
    fn baselines(&self) -> Vec<Baseline> {
        self.validation.baselines.iter().cloned().map(|baseline| Baseline { baseline }).collect()
    }

    fn __repr__(&self) -> String {
        format!(
            "<Validation: {} motions, rms error {:.3}, Pearson {:.3}, Spearman {:.3}>",
            self.validation.predictions.len(),
            self.validation.rms_error,
            self.validation.pearson.value,
            self.validation.spearman.value
        )
    }
}

/// Scores each motion by a model of all others, and says what that is worth.
///
/// Bases, number of components and regression are made anew for each motion. The mean of the others falls where the score left
/// out is high: it is correlated by −1 with any scores, and so in part are predictions, which contain it. So
/// correlations are of what a prediction differs by from that mean. A negative one is no finding.
///
/// Parameters
/// ----------
/// motions : sequence of Performance
/// scores : array_like, shape (n_motions,)
/// options : ScoringOptions, optional
/// n_resamples : int, optional
///     Resamples of the bootstrap.
/// level : float, optional
///     Of the intervals, between 0 and 1.
/// seed : int, optional
///     Of the generator that draws the resamples.
/// features : dict of str to array_like, optional
///     A number of each motion, for further baselines.
///
/// Returns
/// -------
/// Validation
///
/// Raises
/// ------
/// ScoringError
///     If there are too few motions, or an argument is not allowed.
#[pyfunction]
#[pyo3(signature = (motions, scores, options=None, *, n_resamples=10_000, level=0.95, seed=0, features=None))]
pub(crate) fn validate(
    py: Python<'_>,
    motions: Vec<Bound<'_, Performance>>,
    scores: &Bound<'_, PyAny>,
    options: Option<&Bound<'_, ScoringOptions>>,
    n_resamples: usize,
    level: f64,
    seed: u64,
    features: Option<&Bound<'_, PyDict>>,
) -> Result<Validation, Error> {
    let (motions, scores) = (performances(&motions), real_numbers("scores", scores)?);
    let options = ScoringOptions::or_thesis(options);
    if n_resamples > MOST_RESAMPLES {
        let message = format!("`n_resamples` must be at most {MOST_RESAMPLES}, found {n_resamples}");
        return Err(Error::input(message));
    }
    let choices = ValidationOptions { n_resamples, level, seed };
    let mut named: Vec<(String, Vec<f64>)> = Vec::new();
    for (name, values) in features.into_iter().flatten() {
        let name: String = name.extract()?;
        let values = real_numbers(&format!("features['{name}']"), &values)?;
        named.push((name, values));
    }
    let validation = attended(py, move || {
        let features: Vec<(&str, &[f64])> =
            named.iter().map(|(name, values)| (name.as_str(), values.as_slice())).collect();
        scoring::validate(&motions, &scores, &options, &choices, &features)
    })?;
    Ok(Validation { validation })
}

/// Pearson's correlation: the cosine between the deviations from the means.
///
/// Parameters
/// ----------
/// x, y : array_like, shape (n,)
///
/// Returns
/// -------
/// float
#[pyfunction]
pub(crate) fn pearson(x: &Bound<'_, PyAny>, y: &Bound<'_, PyAny>) -> Result<f64, Error> {
    let (x, y) = pair(x, y)?;
    Ok(scoring::pearson(&x, &y)?)
}

/// Spearman's correlation: Pearson's of the ranks; equal values share the mean of theirs.
///
/// Parameters
/// ----------
/// x, y : array_like, shape (n,)
///
/// Returns
/// -------
/// float
#[pyfunction]
pub(crate) fn spearman(x: &Bound<'_, PyAny>, y: &Bound<'_, PyAny>) -> Result<f64, Error> {
    let (x, y) = pair(x, y)?;
    Ok(scoring::spearman(&x, &y)?)
}

fn pair(x: &Bound<'_, PyAny>, y: &Bound<'_, PyAny>) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let x = real_numbers("x", x)?;
    let y = with_shape("y", &[x.len()], y)?;
    Ok((x, y))
}
