//! Recordings as files.

use super::channels::ChannelRecording;
use super::convention::convention;
use super::markers::MarkerRecording;
use super::matrix;
use super::skeleton::SkeletonRecording;
use crate::core::convert::a_type;
use crate::core::error::Error;
use crate::core::waiting::leave_on_signal;
use pyo3::exceptions::PyTypeError;
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
///
/// Examples
/// --------
/// >>> import pathlib, tempfile
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "walk.csv"
/// >>> motion.write_csv(path, motion.MarkerRecording(["hip"], [0.0, 0.01], np.ones((2, 1, 3))))
/// >>> path.read_text().splitlines()[0]
/// 'time,hip_x,hip_y,hip_z'
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
///
/// Examples
/// --------
/// >>> import pathlib, tempfile
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "walk.trc"
/// >>> motion.write_trc(path, motion.MarkerRecording(["hip"], [0.0, 0.01], np.ones((2, 1, 3))), unit="m")
/// >>> motion.read_file(path).track("hip").round(6)
/// array([[1., 1., 1.],
///        [1., 1., 1.]])
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
///
/// Examples
/// --------
/// >>> import pathlib, tempfile
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "walk.c3d"
/// >>> motion.write_c3d(path, motion.MarkerRecording(["hip"], [0.0, 0.01], np.ones((2, 1, 3))))
/// >>> motion.read_file(path)
/// <MarkerRecording: 1 markers, 2 frames, 0.010 s, 0 positions missing>
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

/// Writes channels as a motion or storage file of OpenSim, the format of `read_mot`, with all digits.
///
/// Parameters
/// ----------
/// path : path
/// recording : ChannelRecording
/// in_degrees : bool, optional
///     Whether columns that are angles by their names, in rad here, are written in degrees. OpenSim decides by its model which it
///     converts.
///
/// Raises
/// ------
/// WriteError
///     If a name cannot stand in the format.
///
/// Examples
/// --------
/// >>> import pathlib, tempfile
/// >>> from somersault import motion
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "squat.mot"
/// >>> motion.write_mot(path, motion.ChannelRecording(["knee_angle_r"], [0.0, 0.1], [[0.0], [0.5]]))
/// >>> motion.read_file(path)
/// <ChannelRecording: 1 channels, 2 frames, 0.100 s>
#[pyfunction]
#[pyo3(signature = (path, recording, *, in_degrees=true))]
pub(crate) fn write_mot(
    path: &Bound<'_, PyAny>,
    recording: &Bound<'_, ChannelRecording>,
    in_degrees: bool,
) -> Result<(), Error> {
    let name: String = matrix::path("path", path)?.getattr("stem")?.extract()?;
    let recording = recording.get().recording.clone();
    let text = leave_on_signal(path.py(), move |_| writers::mot::write(&recording, &name, in_degrees))?;
    put(path, text.as_bytes())
}

/// Writes a recording as GLB, the binary form of glTF 2.0, which viewers, engines and browsers play.
///
/// A skeleton is a stick figure with a node for each joint, markers are points, which have no size while they are missing. Lengths are
/// in m; in glTF z is forward, x left and y up. Players begin with the first frame at t = 0.
///
/// Parameters
/// ----------
/// path : path
/// recording : SkeletonRecording or MarkerRecording
///
/// Raises
/// ------
/// WriteError
///     If a number is beyond single precision.
///
/// Examples
/// --------
/// >>> import pathlib, tempfile
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "walk.glb"
/// >>> motion.write_glb(path, motion.MarkerRecording(["hip"], [0.0, 0.01], np.ones((2, 1, 3))))
/// >>> path.read_bytes()[:4]
/// b'glTF'
#[pyfunction]
pub(crate) fn write_glb(path: &Bound<'_, PyAny>, recording: &Bound<'_, PyAny>) -> Result<(), Error> {
    let bytes = if let Ok(skeleton) = recording.cast::<SkeletonRecording>() {
        let recording = skeleton.get().recording.clone();
        leave_on_signal(path.py(), move |_| writers::glb::write_skeleton(&recording))?
    } else if let Ok(markers) = recording.cast::<MarkerRecording>() {
        let recording = markers.get().recording.clone();
        leave_on_signal(path.py(), move |_| writers::glb::write_markers(&recording))?
    } else {
        let found = a_type(recording);
        let message = format!("`recording` must be a SkeletonRecording or a MarkerRecording, found {found}");
        return Err(PyTypeError::new_err(message).into());
    };
    put(path, &bytes)
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
///
/// Examples
/// --------
/// >>> import pathlib, tempfile
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "walk.bvh"
/// >>> skeleton = motion.Skeleton([motion.SkeletonJoint("hip", moves=True)])
/// >>> still = np.tile([0.0, 0.0, 0.0, 1.0], (2, 1, 1))
/// >>> walk = motion.SkeletonRecording(skeleton, [0.0, 0.1], still, [[[0.0, 0.0, 0.9]], [[0.1, 0.0, 0.9]]])
/// >>> motion.write_bvh(path, walk, unit="cm")
/// >>> motion.read_file(path, unit="cm")
/// <SkeletonRecording: 1 joints, 2 frames, 0.100 s>
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
///
/// Examples
/// --------
/// >>> import io, json, pathlib, tempfile
/// >>> from somersault import motion
/// >>> still = [1.0, 0.0, 0.0, 0.0]
/// >>> pose = [0.0, 0.9, 0.0, *still, *still, *still, *still, 0.0, *still, *still, 0.0, *still, 0.0, *still, *still, 0.0]
/// >>> frames = io.StringIO(json.dumps({"Loop": "none", "Frames": [[0.1, *pose], [0.0, *pose]]}))
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "stand.json"
/// >>> motion.write_joint_motion(path, motion.read_joint_motion(frames))
/// >>> len(json.loads(path.read_text())["Frames"][0])
/// 44
#[pyfunction]
pub(crate) fn write_joint_motion(
    path: &Bound<'_, PyAny>,
    recording: &Bound<'_, SkeletonRecording>,
) -> Result<(), Error> {
    let recording = recording.get().recording.clone();
    put(path, leave_on_signal(path.py(), move |_| writers::joint_motion::write(&recording))?.as_bytes())
}
