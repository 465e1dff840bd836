//! How well motions are scored.

use super::matrix::{self, count, numbers_array, same_length};
use super::scoring::{Performance, ScoringOptions, components, groups_of, penalty, performances};
use crate::core::convert::{a_type, entries, entries_or_none, real_numbers, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, brief, by_restore, value};
use crate::core::waiting::leave_on_signal;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use somersault::motion::scoring::{self, Tuning, ValidationOptions};

/// A coefficient of correlation with its confidence interval and p-value.
#[pyclass(frozen, module = "somersault.motion")]
#[derive(Clone, Copy)]
pub(crate) struct Correlation {
    correlation: scoring::Correlation,
}

value! {
    impl Correlation {
        /// float: The coefficient.
        value: f64 = |own| own.correlation.value;
        /// tuple of float: Lower and upper end of the percentile interval over resamples of the motions.
        interval: (f64, f64) = |own| own.correlation.interval.into();
        /// float: Fraction of shuffles of the scores, the order given among them, with at least this coefficient.
        p_value: f64 = |own| own.correlation.p_value;
    }
}

#[pymethods]
impl Correlation {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        by_restore(slf, (own.value(), own.interval(), own.p_value()))
    }

    /// A pickled coefficient.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, value: f64, interval: (f64, f64), p_value: f64) -> Self {
        Self { correlation: scoring::Correlation { value, interval: interval.into(), p_value } }
    }

    fn __repr__(&self) -> String {
        let [lower, upper] = self.correlation.interval;
        let (value, p) = (self.correlation.value, self.correlation.p_value);
        format!("<Correlation: {value:.3} in [{lower:.3}, {upper:.3}], p = {p:.3}>")
    }
}

/// A simple predictor, validated in the same way.
#[pyclass(frozen, module = "somersault.motion")]
#[derive(Clone)]
pub(crate) struct Baseline {
    baseline: scoring::Baseline,
}

value! {
    impl Baseline {
        /// str: ``'mean'``, ``'duration'``, or the name of a feature.
        name: &str = |own| &own.baseline.name;
        /// ndarray, shape (n_motions,): Predictions, each from all other motions.
        predictions: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.baseline.predictions);
        /// float: Root mean square of their errors.
        rms_error: f64 = |own| own.baseline.rms_error;
    }
}

#[pymethods]
impl Baseline {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        by_restore(slf, (own.name(), own.predictions(py), own.rms_error()))
    }

    /// A pickled predictor.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        name: String,
        predictions: &Bound<'_, PyAny>,
        rms_error: f64,
    ) -> Result<Self, Error> {
        let predictions = real_numbers("predictions", predictions)?;
        Ok(Self { baseline: scoring::Baseline { name, predictions, rms_error } })
    }

    fn __repr__(&self) -> String {
        format!("<Baseline: {}, rms error {:.3}>", brief(&self.baseline.name, 40), self.baseline.rms_error)
    }
}

/// Leave-one-out predictions, and their errors.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct Validation {
    validation: scoring::Validation,
}

value! {
    impl Validation {
        /// ndarray, shape (n_motions,): The score of each motion by a model of all others, or of all other groups.
        predictions: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.validation.predictions);
        /// ndarray, shape (n_motions,): Distance of each motion to the others, over the greatest that one of the others has. The farthest
        /// of all is always beyond 1; far beyond, it is unlike the others.
        distances: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.validation.distances);
        /// list of int: Components of that model; empty for 'ridge'.
        n_components: Vec<usize> = |own| own.validation.tunings.iter().copied().filter_map(components).collect();
        /// ndarray, shape (n_motions,): Penalty of that model; of 'ridge' alone, else empty.
        penalties: Bound<'py, PyAny> = |own, py| numbers_array(py, &penalties_of(&own.validation));
        /// float: Root mean square of the errors.
        rms_error: f64 = |own| own.validation.rms_error;
        /// float: Fraction of the squared error of predictions by the mean of the others that the model saves; zero or below where it is
        /// no better.
        r_squared: f64 = |own| own.validation.r_squared();
        /// Correlation: Pearson's, of scores with predictions less the mean of the other scores.
        pearson: Correlation = |own| Correlation { correlation: own.validation.pearson };
        /// Correlation: Spearman's, of the same.
        spearman: Correlation = |own| Correlation { correlation: own.validation.spearman };
        /// list of Baseline: The mean of the others; a straight line over the duration, and over each feature.
        baselines: Vec<Baseline> =
            |own| own.validation.baselines.iter().cloned().map(|baseline| Baseline { baseline }).collect();
        /// bool: Whether some of the motions are synthetic.
        synthetic: bool = |own| own.validation.synthetic;
    }
}

/// Pickled predictions, distances, components and penalties, and the error.
type Predicted<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, (Vec<usize>, Vec<f64>), f64);

/// The penalty of each model, where they have one.
fn penalties_of(validation: &scoring::Validation) -> Vec<f64> {
    validation.tunings.iter().copied().filter_map(penalty).collect()
}

#[pymethods]
impl Validation {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let tunings = (own.n_components(), penalties_of(&own.validation));
        let predicted = (own.predictions(py), own.distances(py), tunings, own.rms_error());
        by_restore(slf, (predicted, own.pearson(), own.spearman(), own.baselines(), own.synthetic()))
    }

    /// A pickled validation.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        predicted: Predicted<'_>,
        pearson: &Bound<'_, Correlation>,
        spearman: &Bound<'_, Correlation>,
        baselines: Vec<Bound<'_, Baseline>>,
        synthetic: bool,
    ) -> Result<Self, Error> {
        let (predictions, distances, (n_components, penalties), rms_error) = predicted;
        let predictions = real_numbers("predictions", &predictions)?;
        same_length("n_components and penalties", n_components.len() + penalties.len(), predictions.len())?;
        if baselines.first().is_none_or(|baseline| baseline.get().name() != "mean") {
            return Err(Error::input("`baselines` must begin with that of the mean"));
        }
        let components = n_components.into_iter().map(Tuning::Components);
        let validation = scoring::Validation {
            distances: with_shape("distances", &[predictions.len()], &distances)?,
            predictions,
            tunings: components.chain(penalties.into_iter().map(Tuning::Penalty)).collect(),
            rms_error,
            pearson: pearson.get().correlation,
            spearman: spearman.get().correlation,
            baselines: baselines.iter().map(|baseline| baseline.get().baseline.clone()).collect(),
            synthetic,
        };
        Ok(Self { validation })
    }

    fn __repr__(&self) -> String {
        format!(
            "<Validation: {} motions, rms error {:.3}, R² {:.3}, Pearson {:.3}, Spearman {:.3}>",
            self.validation.predictions.len(),
            self.validation.rms_error,
            self.r_squared(),
            self.validation.pearson.value,
            self.validation.spearman.value
        )
    }
}

/// Scores each motion by a model of all others, and reports the errors.
///
/// Bases, number of components or penalty, and regression are rebuilt for each motion, so that no error is smaller for a choice that has
/// seen it. The mean of the others falls where the score left
/// out is high: it is correlated by −1 with any scores, and so in part are predictions, which contain it. So
/// correlations are of what a prediction differs by from that mean. Scores that mean nothing still make them lean to the
/// negative. Intervals are over resamples of the motions, each with models of its own; p-values are fractions of shuffles of the
/// scores that are correlated at least as much. With `groups` the motions of each, such as those of an athlete, are left out and resampled
/// together, and shuffles are of the groups' means, and within groups; intervals of few groups, less than ten, may be too narrow.
///
/// A resample of n motions costs one decomposition, n³, and n² for each number of components.
///
/// Parameters
/// ----------
/// motions : sequence of Performance
/// scores : array_like, shape (n_motions,)
/// options : ScoringOptions, optional
/// groups : sequence of str or int, optional
///     A label of each motion: those of a label are left out together. Three at least; each motion is its own unless given.
/// n_resamples : int, optional
///     Resamples of the motions for the intervals, and shuffles of the scores for the p-values.
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
/// InputError
///     If there are too few motions, or without one of the groups, or an argument is not allowed.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> t = np.linspace(0.0, 1.0, 20)
/// >>> openings = np.linspace(1.0, 2.0, 8)
/// >>> dives = [
/// ...     motion.Performance(t, ["hip"], (k * np.sin(np.pi * t))[:, None], np.outer(t, [0, 0, 1.0]))
/// ...     for k in openings]
/// >>> options = motion.ScoringOptions(n_frames=10, n_eigenweights=1, n_components=1)
/// >>> found = motion.validate(dives, 3.0 * openings, options, n_resamples=20)
/// >>> found.rms_error < 0.01
/// True
#[pyfunction]
#[pyo3(signature = (
    motions, scores, options=None, *, groups=None, n_resamples=1000, level=0.95, seed=0, features=None
))]
pub(crate) fn validate(
    py: Python<'_>,
    #[pyo3(from_py_with = entries)] motions: Vec<Bound<'_, Performance>>,
    scores: &Bound<'_, PyAny>,
    options: Option<&Bound<'_, ScoringOptions>>,
    #[pyo3(from_py_with = entries_or_none)] groups: Option<Vec<Bound<'_, PyAny>>>,
    n_resamples: i128,
    level: f64,
    seed: i128,
    features: Option<&Bound<'_, PyDict>>,
) -> Result<Validation, Error> {
    let (motions, scores) = (performances(&motions), real_numbers("scores", scores)?);
    let (options, groups) = (ScoringOptions::or_thesis(options), groups_of(groups, motions.len())?);
    let (n_resamples, seed) = (count("n_resamples", n_resamples)?, matrix::seed(seed)?);
    let choices = ValidationOptions { n_resamples, level, seed };
    let mut named: Vec<(String, Vec<f64>)> = Vec::new();
    for (name, values) in features.into_iter().flatten() {
        let name: String = name.extract().map_err(|_| {
            Error::input(format!("`features` must have names that are str, found {}", a_type(&name)))
        })?;
        let values = real_numbers(&format!("features['{name}']"), &values)?;
        named.push((name, values));
    }
    let validation = leave_on_signal(py, move |token| {
        let features: Vec<(&str, &[f64])> =
            named.iter().map(|(name, values)| (name.as_str(), values.as_slice())).collect();
        scoring::validate_cancellable(&motions, &scores, &groups, &options, &choices, &features, token)
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
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> round(motion.pearson([1.0, 2.0, 3.0], [2.0, 4.0, 7.0]), 4)
/// 0.9934
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
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> motion.spearman([1.0, 2.0, 3.0], [2.0, 4.0, 70.0])
/// 1.0
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
