//! Recordings of key points.

use super::convention::axis;
use super::markers::{MarkerRecording, duration};
use super::matrix::numbers_array;
use super::repair::Repair;
use crate::core::convert::{array, entries, real_numbers, shape_text, with_shape};
use crate::core::error::Error;
use crate::core::value::value;
use numpy::PyUntypedArray;
use numpy::prelude::*;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::motion::recording::{self, Convention, LengthUnit};

/// Key points of a person, as pose estimators find them in pictures or in space.
///
/// Parameters
/// ----------
/// names : sequence of str
///     Names of the points, which differ.
/// times : array_like, shape (n_frames,)
///     Times of the frames, s, rising.
/// points : array_like, shape (n_frames, n_keypoints, 2 or 3)
///     Coordinates: pixels, fractions of the picture, or m.
/// weights : array_like, shape (n_frames, n_keypoints)
///     Confidences, at least 0; 0 where a point was not found.
///
/// Raises
/// ------
/// InputError
///     If a number is not finite, a weight is negative, times do not rise or names repeat.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> seen = motion.KeypointRecording(["nose"], [0.0, 0.04], [[[10.0, 40.0]], [[11.0, 40.0]]], [[0.9], [0.2]])
/// >>> seen.markers(scale=0.01, threshold=0.5).points[:, 0].round(6).tolist()
/// [[0.1, 0.0, -0.4], [nan, nan, nan]]
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct KeypointRecording {
    pub(crate) recording: recording::KeypointRecording,
    pub(crate) repairs: Vec<Repair>,
}

value! {
    impl KeypointRecording(names, times, points, weights) {
        /// tuple of str: Names of the points.
        names: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, own.recording.names());
        /// ndarray, shape (n_frames,): Times of the frames, s.
        times: Bound<'py, PyAny> = |own, py| numbers_array(py, own.recording.times());
        /// int: Number of points.
        n_keypoints: usize = |own| own.recording.n_keypoints();
        /// int: Number of frames.
        n_frames: usize = |own| own.recording.n_frames();
        /// int: Number of coordinates of a point, 2 or 3.
        n_dims: usize = |own| own.recording.n_dims();
        /// float: From the first to the last frame, s.
        duration: f64 = |own| duration(own.recording.times());
        /// list of Repair: What was repaired or decided when its file was read. Of what is made of a recording there are none.
        repairs: Vec<Repair> = |own| own.repairs.clone();
    }
}

#[pymethods]
impl KeypointRecording {
    #[new]
    fn new(
        #[pyo3(from_py_with = entries)] names: Vec<String>,
        times: &Bound<'_, PyAny>,
        points: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        if names.is_empty() {
            return Err(recording::RecordingError::Empty { argument: "names" }.into());
        }
        let times = real_numbers("times", times)?;
        let given = points.py().import("numpy")?.call_method1("asarray", (points,))?;
        let shape = given.cast::<PyUntypedArray>().map_err(PyErr::from)?.shape().to_vec();
        let [_, _, n_dims @ (2 | 3)] = shape[..] else {
            let expected = format!("({}, {}, 2 or 3)", times.len(), names.len());
            let found = shape_text(&shape);
            return Err(Error::input(format!("`points` must have the shape {expected}, found {found}")));
        };
        let values = with_shape("points", &[times.len(), names.len(), n_dims], points)?;
        let weights = with_shape("weights", &[times.len(), names.len()], weights)?;
        let (values, weights) = (values.to_vec(), weights.to_vec());
        let recording = recording::KeypointRecording::try_new(names, times, n_dims, values, weights)?;
        Ok(Self { recording, repairs: Vec::new() })
    }

    /// ndarray, shape (n_frames, n_keypoints, n_dims): Coordinates in the unit of the estimator; 0 where a point was not found.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let r = &self.recording;
        Ok(array(py, r.points().to_vec(), &[r.n_frames(), r.n_keypoints(), r.n_dims()])?.into_any())
    }

    /// ndarray, shape (n_frames, n_keypoints): Confidences; 0 where a point was not found.
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let r = &self.recording;
        Ok(array(py, r.weights().to_vec(), &[r.n_frames(), r.n_keypoints()])?.into_any())
    }

    /// The points as markers, which stand upright.
    ///
    /// Points of a picture get a third coordinate of 0: they lie in the vertical plane of x and z, seen from the right side. Their
    /// `weights` are the confidences as fractions of the largest.
    ///
    /// Parameters
    /// ----------
    /// scale : float or sequence of float
    ///     m of a unit of the estimator, or one for each coordinate: of fractions of a picture the width and the height, times m of a
    ///     pixel.
    /// up, forward : str, optional
    ///     Axes of the estimator that point up and forward. In pictures y points down.
    /// threshold : float, optional
    ///     Points of at most this weight are missing.
    ///
    /// Returns
    /// -------
    /// MarkerRecording
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If a scale is not positive.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion
    /// >>> seen = motion.KeypointRecording(["nose", "toe"], [0.0], [[[0.5, 0.1], [0.5, 0.9]]], [[0.9, 0.8]])
    /// >>> markers = seen.markers(scale=(19.2, 10.8))
    /// >>> float((markers.track("nose") - markers.track("toe"))[0, 2].round(6))
    /// 8.64
    #[pyo3(signature = (*, scale, up="-y", forward="x", threshold=0.0))]
    fn markers(
        &self,
        scale: &Bound<'_, PyAny>,
        up: &str,
        forward: &str,
        threshold: f64,
    ) -> Result<MarkerRecording, Error> {
        if threshold.is_nan() {
            return Err(Error::input("`threshold` must be a number, found NaN"));
        }
        let axes = Convention::try_new(LengthUnit::Metre, axis("up", up)?, axis("forward", forward)?)?;
        let scale = match scale.extract::<f64>() {
            Ok(one) => [one; 3],
            Err(_) => match real_numbers("scale", scale)?[..] {
                [x, y] => [x, y, 1.0],
                [x, y, z] => [x, y, z],
                ref other => {
                    let found = other.len();
                    return Err(Error::input(format!("`scale` must be a number or 2 or 3, found {found}")));
                }
            },
        };
        Ok(self.recording.markers(scale, &axes, threshold)?.into())
    }

    fn __len__(&self) -> usize {
        self.recording.n_frames()
    }

    fn __repr__(&self) -> String {
        let r = &self.recording;
        let (n, dims, frames) = (r.n_keypoints(), r.n_dims(), r.n_frames());
        format!(
            "<KeypointRecording: {n} points in {dims} dimensions, {frames} frames, {:.3} s>",
            self.duration()
        )
    }
}
