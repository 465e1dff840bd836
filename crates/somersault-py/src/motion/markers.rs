//! Recordings of markers.

use super::matrix::{count, mask, numbers_array};
use super::repair::Repair;
use crate::core::convert::{array, entries, real_numbers, with_shape};
use crate::core::error::Error;
use crate::core::value::value;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::motion::nalgebra::Vector3;
use somersault::motion::recording::{self, uniform_times};

/// Positions of markers over time, in m, with x forward, y left and z up.
///
/// Parameters
/// ----------
/// names : sequence of str
///     Names of the markers, which differ.
/// times : array_like, shape (n_frames,)
///     Times of the frames, s, rising.
/// points : array_like, shape (n_frames, n_markers, 3)
///     Positions. NaN is an error unless `present` says that the marker is missing.
/// present : array_like of bool, shape (n_frames, n_markers), optional
///     Which markers there are in which frame; all unless given. What `points` has for the others does not matter.
/// weights : array_like, shape (n_frames, n_markers), optional
///     What the squared distance of each point counts in fits and reconstructions, above 0 and at most 1; 1 unless given. The variance of
///     the noise of a point is that of one of weight 1, divided by its weight.
///
/// Raises
/// ------
/// InputError
///     If a number is not finite, times do not rise, names repeat or a weight is not allowed.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> t = np.linspace(0.0, 1.0, 5)
/// >>> points = np.stack([t, t**2, 0.0 * t], axis=1)[:, None, :]
/// >>> recording = motion.MarkerRecording(["hip"], t, points, present=[[1 > 0], [True], [False], [True], [True]])
/// >>> recording.n_missing, recording.fill_gaps(0.6).points[2, 0].round(12).tolist()
/// (1, [0.5, 0.25, 0.0])
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct MarkerRecording {
    pub(crate) recording: recording::MarkerRecording,
    pub(crate) repairs: Vec<Repair>,
}

impl From<recording::MarkerRecording> for MarkerRecording {
    fn from(recording: recording::MarkerRecording) -> Self {
        Self { recording, repairs: Vec::new() }
    }
}

value! {
    impl MarkerRecording(names, times, points, present, weights) {
        /// tuple of str: Names of the markers.
        names: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, own.recording.names());
        /// ndarray, shape (n_frames,): Times of the frames, s.
        times: Bound<'py, PyAny> = |own, py| numbers_array(py, own.recording.times());
        /// int: Number of markers.
        n_markers: usize = |own| own.recording.n_markers();
        /// int: Number of frames.
        n_frames: usize = |own| own.recording.n_frames();
        /// int: Positions that are missing, over all markers and frames.
        n_missing: usize = |own| own.recording.n_missing();
        /// float: From the first to the last frame, s.
        duration: f64 = |own| duration(own.recording.times());
        /// list of Repair: What was repaired or decided when its file was read. Of what is made of a recording there are none.
        repairs: Vec<Repair> = |own| own.repairs.clone();
    }
}

#[pymethods]
impl MarkerRecording {
    #[new]
    #[pyo3(signature = (names, times, points, present=None, weights=None))]
    fn new(
        #[pyo3(from_py_with = entries)] names: Vec<String>,
        times: &Bound<'_, PyAny>,
        points: &Bound<'_, PyAny>,
        present: Option<&Bound<'_, PyAny>>,
        weights: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        if names.is_empty() {
            return Err(recording::RecordingError::Empty { argument: "names" }.into());
        }
        let times = real_numbers("times", times)?;
        let values = with_shape("points", &[times.len(), names.len(), 3], points)?;
        let n = times.len() * names.len();
        let present = match present {
            Some(present) => mask("present", &[times.len(), names.len()], present)?,
            None => vec![true; n],
        };
        let point = |(x, there): (&[f64], &bool)| there.then(|| Vector3::from_column_slice(x));
        let points = values.chunks_exact(3).zip(&present).map(point).collect();
        let weights = weights.map(|weights| with_shape("weights", &[times.len(), names.len()], weights));
        let weights = weights.transpose()?;
        let recording = recording::MarkerRecording::try_new(names, times, points)?;
        Ok(match weights {
            Some(weights) => recording.with_weights(weights)?.into(),
            None => recording.into(),
        })
    }

    /// ndarray, shape (n_frames, n_markers, 3): Positions, m; NaN where a marker is missing.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let all = self.recording.frames().flatten();
        let values = all.flat_map(|p| p.map_or([f64::NAN; 3], Into::into)).collect();
        Ok(array(py, values, &[self.recording.n_frames(), self.recording.n_markers(), 3])?.into_any())
    }

    /// ndarray of bool, shape (n_frames, n_markers): Which markers there are in which frame.
    #[getter]
    fn present<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let values: Vec<bool> = self.recording.frames().flatten().map(Option::is_some).collect();
        let shape = (self.recording.n_frames(), self.recording.n_markers());
        numpy::PyArray1::from_vec(py, values).call_method1("reshape", (shape,))
    }

    /// ndarray, shape (n_frames, n_markers): What the squared distance of each point counts; None where all count 1.
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let r = &self.recording;
        let values = (0..r.n_frames()).flat_map(|i| r.weights(i)).collect();
        r.is_weighted().then(|| Ok(array(py, values, &[r.n_frames(), r.n_markers()])?.into_any())).transpose()
    }

    /// One marker over all frames.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_frames, 3)
    ///     NaN where it is missing.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If there is no marker of this name.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> points = np.arange(12.0).reshape(2, 2, 3)
    /// >>> motion.MarkerRecording(["hip", "knee"], [0.0, 0.1], points).track("knee")
    /// array([[ 3.,  4.,  5.],
    ///        [ 9., 10., 11.]])
    fn track<'py>(&self, py: Python<'py>, name: &str) -> Result<Bound<'py, PyAny>, Error> {
        let track = self.recording.track(name)?;
        let values = track.flat_map(|p| p.map_or([f64::NAN; 3], Into::into)).collect();
        Ok(array(py, values, &[self.recording.n_frames(), 3])?.into_any())
    }

    /// The markers of these names, in this order.
    ///
    /// Parameters
    /// ----------
    /// names : sequence of str
    ///
    /// Returns
    /// -------
    /// MarkerRecording
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> recording = motion.MarkerRecording(["hip", "knee", "toe"], [0.0, 0.1], np.zeros((2, 3, 3)))
    /// >>> recording.select(["toe", "hip"]).names
    /// ('toe', 'hip')
    fn select(&self, names: Vec<String>) -> Result<Self, Error> {
        Ok(self.recording.select(&names)?.into())
    }

    /// The same motion at other times, by a cubic spline through each marker's unbroken stretches.
    ///
    /// What lies in a gap stays missing.
    ///
    /// Parameters
    /// ----------
    /// times : array_like, shape (n,), optional
    ///     Within the recording, s, rising.
    /// n_frames : int, optional
    ///     In the place of `times`: so many at equal distances.
    ///
    /// Returns
    /// -------
    /// MarkerRecording
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> t = np.linspace(0.0, 1.0, 5)
    /// >>> recording = motion.MarkerRecording(["hip"], t, np.outer(t, [1.0, 0.0, 2.0])[:, None])
    /// >>> recording.resample(n_frames=3).points[:, 0].round(6)
    /// array([[0. , 0. , 0. ],
    ///        [0.5, 0. , 1. ],
    ///        [1. , 0. , 2. ]])
    #[pyo3(signature = (times=None, *, n_frames=None))]
    fn resample(&self, times: Option<&Bound<'_, PyAny>>, n_frames: Option<i128>) -> Result<Self, Error> {
        let times = new_times(self.recording.times(), times, n_frames)?;
        Ok(self.recording.resample(&times)?.into())
    }

    /// Fills gaps by a cubic spline through all the frames that have the marker.
    ///
    /// Gaps at the start or the end stay.
    ///
    /// Parameters
    /// ----------
    /// longest : float
    ///     Gaps that last longer stay, s, from the frame before to the frame after.
    ///
    /// Returns
    /// -------
    /// MarkerRecording
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> t = np.linspace(0.0, 0.5, 6)
    /// >>> present = np.array([[True], [True], [False], [False], [True], [True]])
    /// >>> recording = motion.MarkerRecording(["hip"], t, np.outer(t, [1.0, 0.0, 2.0])[:, None], present)
    /// >>> recording.n_missing, recording.fill_gaps(0.2).n_missing, recording.fill_gaps(0.35).n_missing
    /// (2, 2, 0)
    fn fill_gaps(&self, longest: f64) -> Result<Self, Error> {
        Ok(self.recording.fill_gaps(longest)?.into())
    }

    fn __len__(&self) -> usize {
        self.recording.n_frames()
    }

    fn __repr__(&self) -> String {
        let r = &self.recording;
        format!(
            "<MarkerRecording: {} markers, {} frames, {:.3} s, {} positions missing>",
            r.n_markers(),
            r.n_frames(),
            self.duration(),
            r.n_missing()
        )
    }
}

/// From the first to the last time.
pub(super) fn duration(times: &[f64]) -> f64 {
    times[times.len() - 1] - times[0]
}

/// Times given, or so many at equal distances.
pub(super) fn new_times(
    old: &[f64],
    times: Option<&Bound<'_, PyAny>>,
    n_frames: Option<i128>,
) -> Result<Vec<f64>, Error> {
    match (times, n_frames) {
        (Some(times), None) => real_numbers("times", times),
        (None, Some(n)) if n < 1 => Err(Error::input(format!("`n_frames` must be at least 1, found {n}"))),
        (None, Some(n)) => Ok(uniform_times(old, count("n_frames", n)?)),
        _ => Err(Error::input("either `times` or `n_frames` must be given, found both or neither")),
    }
}
