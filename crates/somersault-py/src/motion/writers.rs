//! Recordings as files.

use super::convention::convention;
use super::markers::MarkerRecording;
use super::matrix;
use super::skeleton::SkeletonRecording;
use crate::core::error::Error;
use crate::core::waiting::leave_on_signal;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use somersault::motion::writers;

/// Puts bytes where `path` says; Python's exceptions say why it cannot be written.
fn put(path: &Bound<'_, PyAny>, bytes: &[u8]) -> Result<(), Error> {
    matrix::path("path", path)?.call_method1("write_bytes", (PyBytes::new(path.py(), bytes),))?;
    Ok(())
}

/// Writes markers as comma-separated values, the format of `read_csv`, with all digits.
///
/// Parameters
/// ----------
/// path : path
/// recording : MarkerRecording
/// unit, up, forward : str, optional
///     Unit of length and axes of the file.
///
/// Raises
/// ------
/// WriteError
///     If a name cannot stand in the format, or a length in this unit is beyond the greatest number.
#[pyfunction]
#[pyo3(signature = (path, recording, *, unit="m", up="z", forward="x"))]
pub(crate) fn write_csv(
    path: &Bound<'_, PyAny>,
    recording: &Bound<'_, MarkerRecording>,
    unit: &str,
    up: &str,
    forward: &str,
) -> Result<(), Error> {
    let convention = convention(unit, up, forward)?;
    let recording = recording.get().recording.clone();
    put(path, leave_on_signal(path.py(), move |_| writers::csv::write(&recording, &convention))?.as_bytes())
}

/// Writes markers as TRC, as OpenSim reads them, with all digits.
///
/// Parameters
/// ----------
/// path : path
/// recording : MarkerRecording
/// unit, up, forward : str, optional
///     Unit of length and axes of the file; OpenSim wants y up and x forward.
///
/// Raises
/// ------
/// WriteError
///     If a name cannot stand in the format, or a length in this unit is beyond the greatest number.
#[pyfunction]
#[pyo3(signature = (path, recording, *, unit="mm", up="y", forward="x"))]
pub(crate) fn write_trc(
    path: &Bound<'_, PyAny>,
    recording: &Bound<'_, MarkerRecording>,
    unit: &str,
    up: &str,
    forward: &str,
) -> Result<(), Error> {
    let convention = convention(unit, up, forward)?;
    let name: String = matrix::path("path", path)?.getattr("name")?.extract()?;
    let recording = recording.get().recording.clone();
    put(
        path,
        leave_on_signal(path.py(), move |_| writers::trc::write(&recording, &name, &convention))?.as_bytes(),
    )
}

/// Writes markers as C3D, in single precision.
///
/// The number of the first frame is that at its time; where it is not a whole number of frames after t = 0, the parameter
/// SOMERSAULT:FIRST_TIME has the time, which `read_c3d` reads.
///
/// Parameters
/// ----------
/// path : path
/// recording : MarkerRecording
///     With frames at equal distances in time.
/// unit, up, forward : str, optional
///     Unit of length and axes of the file.
///
/// Raises
/// ------
/// WriteError
///     If frames are not at equal times, there is more than the format can count, or a length in this unit is beyond
///     single precision.
#[pyfunction]
#[pyo3(signature = (path, recording, *, unit="mm", up="z", forward="x"))]
pub(crate) fn write_c3d(
    path: &Bound<'_, PyAny>,
    recording: &Bound<'_, MarkerRecording>,
    unit: &str,
    up: &str,
    forward: &str,
) -> Result<(), Error> {
    let convention = convention(unit, up, forward)?;
    let recording = recording.get().recording.clone();
    put(path, &leave_on_signal(path.py(), move |_| writers::c3d::write(&recording, &convention))?)
}

/// Writes a skeleton and its motion as BVH.
///
/// The format has no time of the first frame: who reads the file finds it at t = 0.
///
/// Parameters
/// ----------
/// path : path
/// recording : SkeletonRecording
///     With frames at equal distances in time.
/// unit : str
///     Unit of length, which the format does not say.
/// up, forward : str, optional
///     Axes of the file.
///
/// Raises
/// ------
/// WriteError
///     If frames are not at equal times, a name cannot stand in the format, or no joint turns or moves: such a
///     skeleton has no channels.
#[pyfunction]
#[pyo3(signature = (path, recording, *, unit, up="y", forward="z"))]
pub(crate) fn write_bvh(
    path: &Bound<'_, PyAny>,
    recording: &Bound<'_, SkeletonRecording>,
    unit: &str,
    up: &str,
    forward: &str,
) -> Result<(), Error> {
    let convention = convention(unit, up, forward)?;
    let recording = recording.get().recording.clone();
    put(path, leave_on_signal(path.py(), move |_| writers::bvh::write(&recording, &convention))?.as_bytes())
}

/// Writes a motion in the format of DeepMimic, without lengths.
///
/// The format has durations of frames: who reads the file finds the first frame at t = 0.
///
/// Parameters
/// ----------
/// path : path
/// recording : SkeletonRecording
///     With the joints of that format.
///
/// Raises
/// ------
/// WriteError
///     If a joint is not that of the format, or a knee or elbow turns about more than the lateral axis.
#[pyfunction]
pub(crate) fn write_joint_motion(
    path: &Bound<'_, PyAny>,
    recording: &Bound<'_, SkeletonRecording>,
) -> Result<(), Error> {
    let recording = recording.get().recording.clone();
    put(path, leave_on_signal(path.py(), move |_| writers::joint_motion::write(&recording))?.as_bytes())
}
