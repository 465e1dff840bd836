//! Recordings of named numbers.

use super::markers::duration;
use super::matrix::{matrix, numbers_array};
use super::repair::Repair;
use crate::core::convert::{array, entries, real_numbers};
use crate::core::error::Error;
use crate::core::value::value;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::motion::recording;

/// Named numbers over time: coordinates of a model, forces, excitations, voltages.
///
/// Parameters
/// ----------
/// names : sequence of str
///     Names of the channels, which differ.
/// times : array_like, shape (n_frames,)
///     Times of the frames, s, rising.
/// values : array_like, shape (n_frames, n_channels)
///     Numbers; NaN where a channel has none.
/// units : sequence of str, optional
///     The unit of each channel; empty where it is not known.
///
/// Raises
/// ------
/// InputError
///     If a number is infinite, times do not rise or names repeat.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> squat = motion.ChannelRecording(["knee", "hip"], [0.0, 0.1], [[0.0, 0.1], [0.5, 0.2]])
/// >>> squat.track("knee").tolist(), squat.select(["hip"]).values.tolist()
/// ([0.0, 0.5], [[0.1], [0.2]])
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct ChannelRecording {
    pub(crate) recording: recording::ChannelRecording,
    pub(crate) repairs: Vec<Repair>,
}

impl From<recording::ChannelRecording> for ChannelRecording {
    fn from(recording: recording::ChannelRecording) -> Self {
        Self { recording, repairs: Vec::new() }
    }
}

value! {
    impl ChannelRecording(names, times, values, units) {
        /// tuple of str: Names of the channels.
        names: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, own.recording.names());
        /// tuple of str: The unit of each channel; empty where it is not known.
        units: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, own.recording.units());
        /// ndarray, shape (n_frames,): Times of the frames, s.
        times: Bound<'py, PyAny> = |own, py| numbers_array(py, own.recording.times());
        /// int: Number of channels.
        n_channels: usize = |own| own.recording.n_channels();
        /// int: Number of frames.
        n_frames: usize = |own| own.recording.n_frames();
        /// float: From the first to the last frame, s.
        duration: f64 = |own| duration(own.recording.times());
        /// list of Repair: What was repaired or decided when its file was read. Of what is made of a recording there are none.
        repairs: Vec<Repair> = |own| own.repairs.clone();
    }
}

#[pymethods]
impl ChannelRecording {
    #[new]
    #[pyo3(signature = (names, times, values, units=None))]
    fn new(
        #[pyo3(from_py_with = entries)] names: Vec<String>,
        times: &Bound<'_, PyAny>,
        values: &Bound<'_, PyAny>,
        units: Option<Vec<String>>,
    ) -> Result<Self, Error> {
        if names.is_empty() {
            return Err(recording::RecordingError::Empty { argument: "names" }.into());
        }
        let times = real_numbers("times", times)?;
        let found = matrix("values", values)?;
        if found.shape() != (times.len(), names.len()) {
            let expected = format!("({}, {})", times.len(), names.len());
            let found = format!("({}, {})", found.nrows(), found.ncols());
            return Err(Error::input(format!("`values` must have the shape {expected}, found {found}")));
        }
        let values = found.transpose().as_slice().to_vec();
        let recording = recording::ChannelRecording::try_new(names, times, values)?;
        Ok(match units {
            Some(units) => recording.with_units(units)?.into(),
            None => recording.into(),
        })
    }

    /// ndarray, shape (n_frames, n_channels): The numbers; NaN where a channel has none.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let values = self.recording.frames().flatten().copied().collect();
        Ok(array(py, values, &[self.recording.n_frames(), self.recording.n_channels()])?.into_any())
    }

    /// One channel over all frames.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_frames,)
    ///     NaN where it has none.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If there is no channel of this name.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion
    /// >>> motion.ChannelRecording(["knee"], [0.0, 0.1], [[0.0], [0.5]]).track("knee")
    /// array([0. , 0.5])
    fn track<'py>(&self, py: Python<'py>, name: &str) -> Result<Bound<'py, PyAny>, Error> {
        Ok(numbers_array(py, &self.recording.track(name)?.collect::<Vec<f64>>()))
    }

    /// The channels of these names, in this order.
    ///
    /// Parameters
    /// ----------
    /// names : sequence of str
    ///
    /// Returns
    /// -------
    /// ChannelRecording
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion
    /// >>> squat = motion.ChannelRecording(["knee", "hip"], [0.0, 0.1], [[0.0, 0.1], [0.5, 0.2]])
    /// >>> squat.select(["hip", "knee"]).names
    /// ('hip', 'knee')
    fn select(&self, names: Vec<String>) -> Result<Self, Error> {
        Ok(self.recording.select(&names)?.into())
    }

    fn __len__(&self) -> usize {
        self.recording.n_frames()
    }

    fn __repr__(&self) -> String {
        let r = &self.recording;
        let (n, frames) = (r.n_channels(), r.n_frames());
        format!("<ChannelRecording: {n} channels, {frames} frames, {:.3} s>", self.duration())
    }
}
