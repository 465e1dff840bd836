//! Files with recorded motions.

use super::convention::{axis, convention, length_unit};
use super::markers::MarkerRecording;
use super::matrix;
use super::skeleton::SkeletonRecording;
use crate::core::convert::a_type;
use crate::core::error::Error;
use crate::core::waiting::leave_on_signal;
use crate::multibody::models::Diver;
use pyo3::prelude::*;
use somersault::motion::readers::{
    self, MarkerOptions, Place, ReadError, ReadOptions, Recording, bvh, c3d, joint_motion, trc,
};
use somersault::multibody::models;

/// The bytes of a file, and its name for messages. A path is opened by Python, whose exceptions say why one cannot be.
fn bytes_of(source: &Bound<'_, PyAny>) -> Result<(Vec<u8>, Option<String>), Error> {
    if source.hasattr("read")? {
        let content = source.call_method0("read")?;
        if let Ok(text) = content.extract::<String>() {
            return Ok((text.into_bytes(), None));
        }
        let bytes = content.extract::<Vec<u8>>().map_err(|_| {
            let found = a_type(&content);
            Error::input(format!("`source` must be a path or a file that reads bytes or str, found {found}"))
        })?;
        return Ok((bytes, None));
    }
    let path = matrix::path("source", source)?;
    let name = path.str()?.to_string();
    Ok((path.call_method0("read_bytes")?.extract()?, Some(name)))
}

/// A read that failed, with line or byte as attributes of the exception.
struct Failed {
    error: ReadError,
    name: Option<String>,
}

impl From<Failed> for Error {
    fn from(Failed { error, name }: Failed) -> Self {
        if let ReadError::NoUnit { .. } | ReadError::Axes(_) = error {
            return Self::input(error.to_string());
        }
        let prefix = name.map_or(String::new(), |name| format!("{name}: "));
        let place = error.place();
        let raised: PyErr = Self::read(format!("{prefix}{error}")).into();
        Python::attach(|py| {
            let value = raised.value(py);
            match place {
                Some(Place::Line(line)) => value.setattr("line", line),
                Some(Place::Byte(byte)) => value.setattr("byte", byte),
                None => Ok(()),
            }
        })
        .map_or_else(Self::Raised, |()| Self::Raised(raised))
    }
}

/// Reads without the interpreter.
fn read_with<T: Send + 'static>(
    source: &Bound<'_, PyAny>,
    reader: impl FnOnce(&[u8]) -> Result<T, ReadError> + Send + 'static,
) -> Result<T, Error> {
    let (bytes, name) = bytes_of(source)?;
    leave_on_signal(source.py(), move |_| reader(&bytes).map_err(|error| Failed { error, name }))
}

/// Reads a recording in the format that the ending of its name stands for.
///
/// A file of CSV, TRC or C3D has markers, one of BVH or of DeepMimic (``.json``, ``.txt``) a skeleton. What the file does
/// not say itself is taken from the arguments, or from the format where these are not given. Readers of single formats,
/// such as `read_c3d`, say what that is.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading
/// format : str, optional
///     The ending of such files, ``'c3d'`` for example; that of the path unless given. A file that is open needs it.
/// unit : str, optional
///     Unit of length, ``'m'``, ``'cm'``, ``'in'``, …; BVH needs it.
/// up, forward : str, optional
///     Axes of the file that point up and forward, such as ``'y'`` or ``'-x'``.
/// nan_is_gap : bool, optional
///     Whether a marker with three times NaN is missing rather than an error.
/// diver : Diver, optional
///     Whose size motions without lengths take; the spatial diver's of 1.70 m unless given.
///
/// Returns
/// -------
/// MarkerRecording or SkeletonRecording
///
/// Raises
/// ------
/// ReadError
///     If the file is not of its format; the message and the attribute ``line`` or ``byte`` say where.
/// OSError
///     If the file cannot be opened.
///
/// Examples
/// --------
/// >>> import io
/// >>> from somersault import motion
/// >>> text = io.StringIO("time,hip_x,hip_y,hip_z\n0.00,0,0,900\n")
/// >>> motion.read_file(text, format="csv", unit="mm").points.tolist()
/// [[[0.0, 0.0, 0.9]]]
#[pyfunction]
#[pyo3(signature = (source, *, format=None, unit=None, up=None, forward=None, nan_is_gap=false, diver=None))]
pub(crate) fn read_file<'py>(
    source: &Bound<'py, PyAny>,
    format: Option<&str>,
    unit: Option<&str>,
    up: Option<&str>,
    forward: Option<&str>,
    nan_is_gap: bool,
    diver: Option<&Bound<'_, Diver>>,
) -> Result<Bound<'py, PyAny>, Error> {
    let py = source.py();
    let format = match format {
        Some(ending) => readers::format_of(ending).ok_or_else(|| not_an_ending("format", ending)),
        None if source.hasattr("read")? => {
            Err(Error::input("`format` must be given where `source` is a file, not a path"))
        }
        None => {
            let ending: String = matrix::path("source", source)?.getattr("suffix")?.extract()?;
            let known = readers::format_of(ending.trim_start_matches('.'));
            known.ok_or_else(|| not_an_ending("source", &ending))
        }
    }?;
    let options = ReadOptions {
        unit: unit.map(length_unit).transpose()?,
        up: up.map(|name| axis("up", name)).transpose()?,
        forward: forward.map(|name| axis("forward", name)).transpose()?,
        nan_is_gap,
        diver: diver.map_or_else(models::Diver::spatial, |diver| diver.get().diver),
    };
    let found = read_with(source, move |bytes| format.read(bytes, &options))?;
    for contradiction in found.contradictions {
        warn(py, &contradiction.to_string())?;
    }
    Ok(match found.recording {
        Recording::Markers(recording) => MarkerRecording { recording }.into_pyobject(py)?.into_any(),
        Recording::Skeleton(recording) => SkeletonRecording { recording }.into_pyobject(py)?.into_any(),
    })
}

fn not_an_ending(argument: &str, found: &str) -> Error {
    Error::input(format!("`{argument}` must end in {}, found '{found}'", readers::endings()))
}

/// Reads a BVH file: a tree of joints and how they turned.
///
/// Any hierarchy and any order of channels. The first frame is at t = 0. An `End Site` is a joint that does not turn,
/// named after its parent with ``_end``, further ones of the same parent with ``_end2``, ``_end3``, ….
///
/// Parameters
/// ----------
/// source : path, or file opened for reading
/// unit : str
///     Unit of length, which the format does not say: ``'m'``, ``'cm'``, ``'in'``, …
/// up, forward : str, optional
///     Axes of the file that point up and forward, such as ``'y'`` or ``'-x'``.
///
/// Returns
/// -------
/// SkeletonRecording
///
/// Raises
/// ------
/// ReadError
///     If the file is no BVH; the message and the attribute ``line`` say where.
/// OSError
///     If the file cannot be opened.
///
/// Examples
/// --------
/// >>> import io
/// >>> from somersault import motion
/// >>> text = '''HIERARCHY
/// ... ROOT hip
/// ... {
/// ...   OFFSET 0 0 0
/// ...   CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
/// ...   End Site
/// ...   {
/// ...     OFFSET 0 -40 0
/// ...   }
/// ... }
/// ... MOTION
/// ... Frames: 1
/// ... Frame Time: 0.01
/// ... 0 90 0 0 0 0
/// ... '''
/// >>> recording = motion.read_bvh(io.StringIO(text), unit="cm")
/// >>> recording.joint_centres().track("hip_end").round(6)
/// array([[0. , 0. , 0.5]])
#[pyfunction]
#[pyo3(signature = (source, *, unit, up="y", forward="z"))]
pub(crate) fn read_bvh(
    source: &Bound<'_, PyAny>,
    unit: &str,
    up: &str,
    forward: &str,
) -> Result<SkeletonRecording, Error> {
    let convention = convention(unit, up, forward)?;
    let recording = read_with(source, move |bytes| bvh::read(readers::text(bytes)?, &convention))?;
    Ok(SkeletonRecording { recording })
}

/// Reads the points of a C3D file.
///
/// Integers or floats, of processors of Intel, DEC and MIPS. A point with a negative residual is missing. Analog
/// channels, force plates and events are not read. Where the header and the parameters of the file contradict each other, the length
/// of the file decides, and a `somersault.errors.ReadWarning` names what each declares and what is used.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading bytes
/// unit : str, optional
///     Unit of length where the file does not say.
/// up, forward : str, optional
///     Axes of the file that point up and forward, such as ``'z'`` or ``'-y'``.
/// nan_is_gap : bool, optional
///     Whether a point with three times NaN is missing rather than an error.
///
/// Returns
/// -------
/// MarkerRecording
///
/// Raises
/// ------
/// ReadError
///     If the file is no C3D; the message and the attribute ``byte`` say where.
/// OSError
///     If the file cannot be opened.
///
/// Examples
/// --------
/// >>> import pathlib, tempfile
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "walk.c3d"
/// >>> motion.write_c3d(path, motion.MarkerRecording(["hip"], [0.0, 0.01], np.ones((2, 1, 3))))
/// >>> motion.read_c3d(path).track("hip").round(6)
/// array([[1., 1., 1.],
///        [1., 1., 1.]])
#[pyfunction]
#[pyo3(signature = (source, *, unit="mm", up="z", forward="x", nan_is_gap=false))]
pub(crate) fn read_c3d(
    source: &Bound<'_, PyAny>,
    unit: &str,
    up: &str,
    forward: &str,
    nan_is_gap: bool,
) -> Result<MarkerRecording, Error> {
    let options = c3d::C3dOptions { convention: convention(unit, up, forward)?, nan_is_gap };
    let (recording, contradictions) =
        read_with(source, move |bytes| Ok((c3d::read(bytes, &options)?, c3d::contradictions(bytes)?)))?;
    for contradiction in contradictions {
        warn(source.py(), &contradiction.to_string())?;
    }
    Ok(MarkerRecording { recording })
}

/// Warns of something in a file that contradicts something else.
pub(super) fn warn(py: Python<'_>, message: &str) -> Result<(), Error> {
    let category = py.import("somersault.errors")?.getattr("ReadWarning")?;
    py.import("warnings")?.call_method1("warn", (message, category))?;
    Ok(())
}

/// Reads a TRC file of markers, as Motion Analysis and OpenSim write them.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading
/// up, forward : str, optional
///     Axes of the file that point up and forward; those of OpenSim unless given. The unit is the file's.
/// nan_is_gap : bool, optional
///     Whether a marker with three times NaN is missing rather than an error. Empty cells always are gaps.
///
/// Returns
/// -------
/// MarkerRecording
///
/// Raises
/// ------
/// ReadError
///     If the file is no TRC; the message and the attribute ``line`` say where.
/// OSError
///     If the file cannot be opened.
///
/// Examples
/// --------
/// >>> import pathlib, tempfile
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> path = pathlib.Path(tempfile.mkdtemp()) / "walk.trc"
/// >>> motion.write_trc(path, motion.MarkerRecording(["hip"], [0.0, 0.01], np.ones((2, 1, 3))))
/// >>> motion.read_trc(path)
/// <MarkerRecording: 1 markers, 2 frames, 0.010 s, 0 positions missing>
#[pyfunction]
#[pyo3(signature = (source, *, up="y", forward="x", nan_is_gap=false))]
pub(crate) fn read_trc(
    source: &Bound<'_, PyAny>,
    up: &str,
    forward: &str,
    nan_is_gap: bool,
) -> Result<MarkerRecording, Error> {
    let options = MarkerOptions { convention: convention("m", up, forward)?, nan_is_gap };
    let recording = read_with(source, move |bytes| trc::read(readers::text(bytes)?, &options))?;
    Ok(MarkerRecording { recording })
}

/// Reads markers as comma-separated values.
///
/// The first line has ``time``, s, and then ``_x``, ``_y`` and ``_z`` after the name of each marker; every other line is a
/// frame. Three empty cells are a gap. Lines that begin with ``#`` are comments.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading
/// unit : str, optional
///     Unit of length.
/// up, forward : str, optional
///     Axes of the file that point up and forward.
/// nan_is_gap : bool, optional
///     Whether a marker with three times NaN is missing rather than an error.
///
/// Returns
/// -------
/// MarkerRecording
///
/// Raises
/// ------
/// ReadError
///     If the file is no such table; the message and the attribute ``line`` say where.
/// OSError
///     If the file cannot be opened.
///
/// Examples
/// --------
/// >>> import io
/// >>> from somersault import motion
/// >>> text = "time,hip_x,hip_y,hip_z\n0.00,0,0,0.9\n0.01,,,\n"
/// >>> motion.read_csv(io.StringIO(text)).present.tolist()
/// [[True], [False]]
#[pyfunction]
#[pyo3(signature = (source, *, unit="m", up="z", forward="x", nan_is_gap=false))]
pub(crate) fn read_csv(
    source: &Bound<'_, PyAny>,
    unit: &str,
    up: &str,
    forward: &str,
    nan_is_gap: bool,
) -> Result<MarkerRecording, Error> {
    let options = MarkerOptions { convention: convention(unit, up, forward)?, nan_is_gap };
    let recording = read_with(source, move |bytes| readers::csv::read(readers::text(bytes)?, &options))?;
    Ok(MarkerRecording { recording })
}

/// Reads a motion in the format of DeepMimic: JSON with ``Frames`` of 44 numbers.
///
/// Such recordings carry no lengths of segments: these are the diver's, from the segment table it is made of.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading
/// diver : Diver, optional
///     Whose size it takes; the spatial diver's of 1.70 m unless given.
///
/// Returns
/// -------
/// SkeletonRecording
///
/// Raises
/// ------
/// ReadError
///     If the file is no such motion; the message and the attribute ``line`` say where.
/// OSError
///     If the file cannot be opened.
///
/// Examples
/// --------
/// >>> import io, json
/// >>> from somersault import motion
/// >>> still = [1.0, 0.0, 0.0, 0.0]
/// >>> pose = [0.0, 0.9, 0.0, *still, *still, *still, *still, 0.0, *still, *still, 0.0, *still, 0.0, *still, *still, 0.0]
/// >>> frames = io.StringIO(json.dumps({"Loop": "none", "Frames": [[0.1, *pose], [0.0, *pose]]}))
/// >>> motion.read_joint_motion(frames)
/// <SkeletonRecording: 18 joints, 2 frames, 0.100 s>
#[pyfunction]
#[pyo3(signature = (source, diver=None))]
pub(crate) fn read_joint_motion(
    source: &Bound<'_, PyAny>,
    diver: Option<&Bound<'_, Diver>>,
) -> Result<SkeletonRecording, Error> {
    let diver = diver.map_or_else(models::Diver::spatial, |diver| diver.get().diver);
    let recording = read_with(source, move |bytes| joint_motion::read(readers::text(bytes)?, &diver))?;
    Ok(SkeletonRecording { recording })
}
