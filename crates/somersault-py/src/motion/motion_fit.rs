//! Fits, and what they found.

use super::fit::MarkerFit;
use super::markers::MarkerRecording;
use super::matrix::{matrix, matrix_array, numbers_array};
use crate::core::convert::{array, real_numbers, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::leave_on_signal;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::motion::fit::{self, Estimate, FitStatus, FrameFit, Shape, UnknownStatus};
use somersault::motion::nalgebra::DMatrix;
use somersault::multibody::Link;

#[pymethods]
impl MarkerFit {
    /// Fits all frames of a recording.
    ///
    /// Markers of the recording that the model has not are ignored, those that the recording has not are missing.
    /// Other Python threads run meanwhile. Ctrl-C raises at once and stops the fit.
    ///
    /// Parameters
    /// ----------
    /// recording : MarkerRecording
    ///
    /// Returns
    /// -------
    /// MotionFit
    ///     The best estimate of each frame, whatever its status.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If the recording has none of the markers.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion, multibody
    /// >>> arm = multibody.two_link_arm()
    /// >>> markers = motion.MarkerSet(arm, {"elbow": ("lower", (0, 0, 0)), "hand": ("lower", (0.5, 0, 0))})
    /// >>> q = [[0.1, 0.2], [0.2, 0.4], [0.3, 0.6]]
    /// >>> seen = motion.place_markers(markers, [0.0, 0.1, 0.2], q, scale=1.1)
    /// >>> fit = motion.MarkerFit(markers).fit(seen)
    /// >>> fit.q.round(6).tolist(), fit.scale.round(6).tolist()
    /// ([[0.1, 0.2], [0.2, 0.4], [0.3, 0.6]], [1.1, 1.1, 1.1])
    fn fit(
        slf: &Bound<'_, Self>,
        py: Python<'_>,
        recording: &Bound<'_, MarkerRecording>,
    ) -> Result<MotionFit, Error> {
        let (fit, recording) = (slf.get().fit.clone(), recording.get().recording.clone());
        let motion = leave_on_signal(py, move |token| fit.fit_cancellable(&recording, token))?;
        Ok(MotionFit { fit: slf.clone().unbind(), motion })
    }
}

/// A fitted motion. Arrays have a row for each frame.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct MotionFit {
    pub(super) fit: Py<MarkerFit>,
    pub(super) motion: fit::MotionFit,
}

/// The name of a status in a table of all.
pub(super) fn name_of<T: PartialEq>(all: &[(T, &'static str)], status: &T) -> &'static str {
    // a table has all there are
    all.iter().find(|(known, _)| known == status).map_or("", |(_, name)| name)
}

/// The status of a name.
pub(super) fn status_of<T: Copy>(all: &[(T, &'static str)], name: &str) -> Result<T, Error> {
    let found = all.iter().find(|(_, known)| *known == name);
    let wrong = || Error::input(format!("`status` must be that of a fit, found '{name}'"));
    found.map(|(status, _)| *status).ok_or_else(wrong)
}

/// Scales, configurations, weights, residuals and costs of all frames.
type Estimates<'py> =
    (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// Statuses of all frames and of their unknowns, iterations, and whether a common scale has converged.
type Searches = ((Vec<String>, Vec<Vec<String>>), Vec<usize>, bool);

impl MotionFit {
    /// Names of the unknowns of a frame.
    fn unknown_names(&self) -> Vec<String> {
        let (model, options) = (self.fit.get().fit.model(), self.fit.get().fit.options());
        let of_body = |(i, link): (usize, &Link)| {
            let n = model.velocities_of(i).len();
            let name = link.name().to_owned();
            (0..n).map(move |k| if n == 1 { name.clone() } else { format!("{name} {k}") })
        };
        let mut names = vec!["scale".to_owned()];
        match &options.shape {
            Shape::Joints => names.extend(model.links().iter().enumerate().flat_map(of_body)),
            Shape::Eigenpostures(base) => {
                names.extend(model.links().iter().enumerate().take(1).flat_map(of_body));
                names.extend((0..base.n_weights()).map(|k| format!("weight {k}")));
            }
        }
        names
    }

    /// Names of the unknowns that have a status in any frame.
    fn unknowns_that_are(&self, status: UnknownStatus) -> Option<String> {
        let is_so = |k: usize| self.motion.frames.iter().any(|frame| frame.unknowns.get(k) == Some(&status));
        let names = self.unknown_names().into_iter().enumerate().filter(|(k, _)| is_so(*k));
        let names: Vec<String> = names.map(|(_, name)| name).collect();
        (!names.is_empty()).then(|| names.join(", "))
    }

    /// As many numbers of each frame as the first has.
    fn rows<'py>(
        &self,
        py: Python<'py>,
        width: usize,
        of: impl Fn(&FrameFit) -> Vec<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let values = self.motion.frames.iter().flat_map(of).collect();
        Ok(array(py, values, &[self.motion.frames.len(), width])?.into_any())
    }

    fn numbers<'py>(&self, py: Python<'py>, of: impl Fn(&FrameFit) -> f64) -> Bound<'py, PyAny> {
        numbers_array(py, &self.motion.frames.iter().map(of).collect::<Vec<_>>())
    }
}

value! {
    impl MotionFit {
        /// MarkerFit: What was fitted.
        fit: Py<MarkerFit> = |own, py| own.fit.clone_ref(py);
        /// Model: The model.
        model: Py<Model> = |own, py| own.fit.get().model(py);
        /// ndarray, shape (n_frames,): Times, s.
        times: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.motion.times);
        /// ndarray, shape (n_frames,): Size over that of the model.
        scale: Bound<'py, PyAny> = |own, py| own.numbers(py, |frame| frame.estimate.scale);
        /// ndarray, shape (n_frames, n_positions): Configurations of the model; places of its root are in m and not scaled.
        q: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, own.fit.get().fit.model().n_positions(), |frame| frame.estimate.q.clone());
        /// ndarray, shape (n_frames,): Root mean square of the residuals of each frame, m; NaN without markers.
        frame_rms: Bound<'py, PyAny> = |own, py| own.numbers(py, |frame| frame.rms.unwrap_or(f64::NAN));
        /// float: Root mean square of all residuals, m; NaN without markers.
        rms: f64 = |own| own.motion.rms().unwrap_or(f64::NAN);
        /// ndarray, shape (n_frames,): The minimum of ½ Σ c ρ in each frame.
        cost: Bound<'py, PyAny> = |own, py| own.numbers(py, |frame| frame.cost);
        /// list of int: Iterations made in each frame.
        iterations: Vec<usize> = |own| own.motion.frames.iter().map(|frame| frame.iterations).collect();
        /// list of str: How the fit of each frame ended: ``'converged'``, ``'iteration_limit'``, ``'no_progress'`` where no
        /// step makes the distances smaller, ``'no_markers'`` where the estimate is that of the frame before, ``'mirrored'`` where the
        /// mirror image of the markers is fitted with less than half of the residual, ``'misfit'`` where residuals are larger than the noise allows.
        status: Vec<&'static str> =
            |own| own.motion.frames.iter().map(|frame| name_of(&FitStatus::ALL, &frame.status)).collect();
        /// bool: Whether the search of every frame that has markers came to a minimum, at least one did, and a common scale too.
        converged: bool = |own| own.motion.converged();
        /// bool: Whether every frame has markers, its search converged, the markers determine every unknown, and neither limits nor
        /// mirrored axes nor the noise contradict them. Where it is False, `message` says why, and `status` and `unknown_status`
        /// say so of each frame.
        success: bool = |own| own.motion.success();
    }
}

#[pymethods]
impl MotionFit {
    /// str: Whether it is a success, or why not: how many frames ended otherwise than converged, and which unknowns the markers do not
    /// determine or would have beyond their limits.
    #[getter]
    fn message(&self) -> String {
        let frames = &self.motion.frames;
        let mut reasons: Vec<String> = (FitStatus::ALL.iter())
            .map(|(status, name)| {
                (status, name, frames.iter().filter(|frame| frame.status == *status).count())
            })
            .filter(|(status, _, n)| **status != FitStatus::Converged && *n > 0)
            .map(|(_, name, n)| format!("{n} of {} frames: {}", frames.len(), name.replace('_', " ")))
            .collect();
        if !self.motion.scale_converged {
            reasons.push("the common scale has not converged".to_owned());
        }
        let undetermined = self.unknowns_that_are(UnknownStatus::Undetermined);
        reasons.extend(undetermined.map(|names| format!("not determined by the markers: {names}")));
        let beyond = self.unknowns_that_are(UnknownStatus::BeyondLimit);
        reasons.extend(beyond.map(|names| format!("beyond their limits: {names}")));
        if reasons.is_empty() {
            "converged, and every unknown is determined".to_owned()
        } else {
            reasons.join("; ")
        }
    }

    /// ndarray, shape (n_frames, n_weights): Weights of the eigenpostures; none where joints were fitted.
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let width = self.motion.frames.first().map_or(0, |frame| frame.estimate.weights.len());
        self.rows(py, width, |frame| frame.estimate.weights.clone())
    }

    /// ndarray, shape (n_frames, n_markers): Distances of the markers to the recorded ones, m; NaN where one is missing.
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let width = self.fit.get().fit.markers().markers().len();
        let of = |frame: &FrameFit| frame.residuals.iter().map(|r| r.unwrap_or(f64::NAN)).collect();
        self.rows(py, width, of)
    }

    /// dict of str to float: Root mean square of the residuals of each marker, m; NaN for one never seen.
    #[getter]
    fn marker_rms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        let markers = self.fit.get().fit.markers().markers();
        for (marker, rms) in markers.iter().zip(self.motion.rms_of_markers()) {
            found.set_item(&marker.name, rms.unwrap_or(f64::NAN))?;
        }
        Ok(found)
    }

    /// tuple of str: Names of the unknowns of a frame, in the order of statuses and covariances: ``'scale'``, the degrees of
    /// freedom of the root, then of the joints, by the bodies they carry, or the weights. A joint of several is numbered: ``'torso 0'``, ….
    #[getter]
    fn unknowns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.unknown_names())
    }

    /// list of tuple of str: For each frame what is known of each unknown: ``'determined'``; ``'undetermined'`` where no marker
    /// says it, or only together with others; ``'at_limit'``; ``'beyond_limit'`` where the markers ask for more than three standard deviations
    /// beyond its limit; ``'given'``.
    #[getter]
    fn unknown_status<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyTuple>>> {
        let names = |frame: &FrameFit| {
            PyTuple::new(py, frame.unknowns.iter().map(|status| name_of(&UnknownStatus::ALL, status)))
        };
        self.motion.frames.iter().map(names).collect()
    }

    /// Covariance of the unknowns of a frame by linearisation.
    ///
    /// Parameters
    /// ----------
    /// frame : int
    ///     Number of the frame, from 0.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n, n), or None
    ///     Of scale, rates of the root in its own axes, and rates of the joints or weights, named by `unknowns`; those at a bound have
    ///     zeros, those that the markers do not determine an infinite variance. None without markers, or, if the noise
    ///     is not known, where measured coordinates are not more than what they determine.
    ///
    /// Examples
    /// --------
    /// How well each joint is known from markers with noise of 2 mm:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import motion, multibody
    /// >>> arm = multibody.two_link_arm()
    /// >>> markers = motion.MarkerSet(arm, {"elbow": ("lower", (0, 0, 0)), "hand": ("lower", (0.5, 0, 0))})
    /// >>> seen = motion.place_markers(markers, [0.0, 0.1], [[0.1, 0.2], [0.2, 0.4]])
    /// >>> fit = motion.MarkerFit(markers, scale=1.0, noise=0.002).fit(seen)
    /// >>> dict(zip(fit.unknowns, np.sqrt(np.diag(fit.covariance(0))).round(4).tolist()))
    /// {'scale': 0.0, 'upper': 0.001, 'lower': 0.0063}
    fn covariance<'py>(&self, py: Python<'py>, frame: i128) -> Result<Option<Bound<'py, PyAny>>, Error> {
        let n = self.motion.frames.len();
        let found = usize::try_from(frame).ok().and_then(|frame| self.motion.frames.get(frame));
        let found = found
            .ok_or_else(|| Error::input(format!("`frame` must be between 0 and {}, found {frame}", n - 1)))?;
        Ok(found.covariance.as_ref().map(|m| matrix_array(py, m)).transpose()?)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let covariances: Vec<Option<Bound<'py, PyAny>>> = (own.motion.frames.iter())
            .map(|frame| frame.covariance.as_ref().map(|m| matrix_array(py, m)).transpose())
            .collect::<PyResult<_>>()?;
        let estimates = (own.scale(py), own.q(py)?, own.weights(py)?, own.residuals(py)?, own.cost(py));
        let statuses = (own.status(), own.unknown_status(py)?);
        let searches = (statuses, own.iterations(), own.motion.scale_converged);
        by_restore(slf, (own.fit(py), own.times(py), estimates, searches, covariances))
    }

    /// A pickled fit.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        fit: Py<MarkerFit>,
        times: &Bound<'_, PyAny>,
        estimates: Estimates<'_>,
        searches: Searches,
        covariances: Vec<Option<Bound<'_, PyAny>>>,
    ) -> Result<Self, Error> {
        let (scale, q, weights, residuals, cost) = estimates;
        let ((status, unknowns), iterations, scale_converged) = searches;
        let times = real_numbers("times", times)?;
        let n = times.len();
        let (scale, cost) = (with_shape("scale", &[n], &scale)?, with_shape("cost", &[n], &cost)?);
        let q = matrix("q", &q)?;
        let (weights, residuals) = (matrix("weights", &weights)?, matrix("residuals", &residuals)?);
        let model = fit.get().fit.model();
        let sizes =
            [q.nrows(), weights.nrows(), residuals.nrows(), status.len(), unknowns.len(), iterations.len()];
        if sizes.iter().any(|size| *size != n) || covariances.len() != n || q.ncols() != model.n_positions() {
            return Err(Error::input(
                "a pickled MotionFit must have an entry for each frame in all its parts",
            ));
        }
        let row = |m: &DMatrix<f64>, i: usize| m.row(i).iter().copied().collect::<Vec<f64>>();
        let mut frames = Vec::with_capacity(n);
        for (i, covariance) in covariances.iter().enumerate() {
            let residuals: Vec<Option<f64>> =
                row(&residuals, i).into_iter().map(|r| (!r.is_nan()).then_some(r)).collect();
            frames.push(FrameFit {
                status: status_of(&FitStatus::ALL, &status[i])?,
                unknowns: unknowns[i]
                    .iter()
                    .map(|name| status_of(&UnknownStatus::ALL, name))
                    .collect::<Result<_, _>>()?,
                estimate: Estimate { scale: scale[i], q: row(&q, i), weights: row(&weights, i) },
                rms: FrameFit::rms_of(&residuals),
                residuals,
                cost: cost[i],
                iterations: iterations[i],
                covariance: covariance.as_ref().map(|m| matrix("covariance", m)).transpose()?,
            });
        }
        Ok(Self { fit, motion: fit::MotionFit { times, frames, scale_converged } })
    }

    fn __len__(&self) -> usize {
        self.motion.frames.len()
    }

    fn __repr__(&self) -> String {
        let done = self.motion.frames.iter().filter(|frame| frame.status == FitStatus::Converged).count();
        format!(
            "<MotionFit: {done} of {} frames converged, {}, rms {:.2} mm>",
            self.motion.frames.len(),
            if self.success() { "success" } else { "no success" },
            1e3 * self.rms()
        )
    }
}
