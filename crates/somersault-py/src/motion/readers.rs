//! Files with recorded motions.

use super::channels::ChannelRecording;
use super::convention::{axis, length_unit};
use super::keypoints::KeypointRecording;
use super::markers::MarkerRecording;
use super::matrix;
use super::repair::Repair;
use super::skeleton::SkeletonRecording;
use crate::core::convert::a_type;
use crate::core::error::Error;
use crate::core::waiting::leave_on_signal;
use crate::multibody::models::Diver;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::motion::readers::{
    self, Format, LoadError, Place, ReadError, ReadOptions, Recording, RecordingFile,
};
use somersault::multibody::models;

/// The bytes of a file, and its name for messages. A path is opened by Python, whose exceptions say why one cannot be.
pub(super) fn bytes_of(source: &Bound<'_, PyAny>) -> Result<(Vec<u8>, Option<String>), Error> {
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
    if path.call_method0("is_dir")?.extract()? {
        return Ok((readers::pose::frames_in(&name).map_err(unloaded)?, Some(name)));
    }
    Ok((path.call_method0("read_bytes")?.extract()?, Some(name)))
}

/// What a path or its content is refused for.
fn unloaded(error: LoadError) -> Error {
    match error {
        LoadError::Read { path, source } => {
            let name = path.display().to_string();
            Failed { error: source, name: (!name.is_empty()).then_some(name) }.into()
        }
        LoadError::UnknownFormat { ref path, ref found } if path.as_os_str().is_empty() => {
            Error::input(format!(
                "`source` begins with `{found}` and has none of the known formats: {}",
                readers::format_names()
            ))
        }
        LoadError::Empty { ref path } if path.as_os_str().is_empty() => Error::read("`source` is empty"),
        LoadError::UnknownFormat { .. } => Error::input(format!("`source`: {error}")),
        LoadError::Io { .. } => Error::of_system(error.to_string()),
        _ => Error::read(error.to_string()),
    }
}

/// A read that failed, with line or byte as attributes of the exception.
pub(super) struct Failed {
    pub(super) error: ReadError,
    pub(super) name: Option<String>,
}

impl From<Failed> for Error {
    fn from(Failed { error, name }: Failed) -> Self {
        let of_caller = matches!(
            error,
            ReadError::NoUnit { .. }
                | ReadError::NoRate { .. }
                | ReadError::Rate { .. }
                | ReadError::Person { .. }
                | ReadError::Axes(_)
        );
        if of_caller {
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

/// The format that is read.
enum Sought {
    Content,
    Ending(String),
    Format(Format),
}

/// What the arguments of a reader say.
#[derive(Default)]
struct Given<'a, 'py> {
    strict: bool,
    unit: Option<&'a str>,
    up: Option<&'a str>,
    forward: Option<&'a str>,
    nan_is_gap: bool,
    rate: Option<f64>,
    person: Option<i128>,
    diver: Option<&'a Bound<'py, Diver>>,
}

impl Given<'_, '_> {
    fn options(&self) -> Result<ReadOptions, Error> {
        let person = |k: i128| {
            usize::try_from(k).map_err(|_| Error::input(format!("`person` must be at least 0, found {k}")))
        };
        Ok(ReadOptions {
            strict: self.strict,
            unit: self.unit.map(length_unit).transpose()?,
            up: self.up.map(|name| axis("up", name)).transpose()?,
            forward: self.forward.map(|name| axis("forward", name)).transpose()?,
            nan_is_gap: self.nan_is_gap,
            rate: self.rate,
            person: self.person.map(person).transpose()?,
            diver: self.diver.map_or_else(models::Diver::spatial, |diver| diver.get().size()),
        })
    }

    /// Reads in a format, in that of an ending, or in that which the file is of, without the interpreter.
    fn read<'py>(&self, source: &Bound<'py, PyAny>, format: Sought) -> Result<Bound<'py, PyAny>, Error> {
        let py = source.py();
        let options = self.options()?;
        let (bytes, name) = bytes_of(source)?;
        let found = leave_on_signal(py, move |_| {
            let name = name.unwrap_or_default();
            let format = match format {
                Sought::Content => None,
                Sought::Ending(ending) => readers::format_of_ending(&ending, &bytes).copied(),
                Sought::Format(format) => Some(format),
            };
            let Some(format) = format else {
                return readers::read_named(name, &bytes, &options).map_err(unloaded);
            };
            let read = format.read(&bytes, &options);
            read.map_err(|source| unloaded(LoadError::Read { path: name.into(), source }))
        })?;
        recording(py, found)
    }
}

/// The object of what was read. What was wrong with the file is a warning besides.
fn recording(py: Python<'_>, file: RecordingFile) -> Result<Bound<'_, PyAny>, Error> {
    for repair in file.repairs.iter().filter(|repair| !repair.is_decision) {
        warn(py, &repair.to_string())?;
    }
    let repairs = Repair::all(file.repairs);
    Ok(match file.recording {
        Recording::Markers(recording) => MarkerRecording { recording, repairs }.into_pyobject(py)?.into_any(),
        Recording::Skeleton(recording) => {
            SkeletonRecording { recording, repairs }.into_pyobject(py)?.into_any()
        }
        Recording::Keypoints(recording) => {
            KeypointRecording { recording, repairs }.into_pyobject(py)?.into_any()
        }
        Recording::Channels(recording) => {
            ChannelRecording { recording, repairs }.into_pyobject(py)?.into_any()
        }
    })
}

/// Warns of something in a file that is repaired.
pub(super) fn warn(py: Python<'_>, message: &str) -> Result<(), Error> {
    let category = py.import("somersault.errors")?.getattr("ReadWarning")?;
    py.import("warnings")?.call_method1("warn", (message, category))?;
    Ok(())
}

/// Reads a recording in the format that it is of, which is found by what the file has and not by its name.
///
/// | Format | Of | Gives |
/// |---|---|---|
/// | C3D | all acquisition systems | `MarkerRecording` |
/// | TRC | OpenSim, Cortex, Pose2Sim, OpenCap | `MarkerRecording` |
/// | BVH | animation | `SkeletonRecording` |
/// | motions of DeepMimic (JSON) | simulated characters | `SkeletonRecording` |
/// | key points (JSON) | OpenPose, COCO, AlphaPose, MMPose, MediaPipe | `KeypointRecording` |
/// | MOT, STO | OpenSim | `ChannelRecording` |
/// | CSV, TSV | plain tables; Motive, Nexus, QTM | `MarkerRecording` or `ChannelRecording` |
///
/// What the file does not say itself is taken from the arguments, or from the format where these are not given. Text may be
/// UTF-8, UTF-16 or Latin-1. What is not quite of its format but has one meaning only is repaired: `repairs` of the recording
/// lists what was found where, and each repair is a `somersault.errors.ReadWarning`. So do decisions, without a warning: which axis
/// of a TRC or C3D is up where `up` is not given and markers show another than usual (heads above feet, or the fall of a flight), which columns are
/// angles in degrees, which person is followed.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading
///     The path of a folder is one of OpenPose, with a file for each frame.
/// format : str, optional
///     The ending of the format, ``'c3d'`` for example, in the place of what the file has.
/// strict : bool, optional
///     Whether a file that needs a repair is an error.
/// unit : str, optional
///     Unit of length, ``'m'``, ``'cm'``, ``'in'``, …; BVH needs it.
/// up, forward : str, optional
///     Axes of the file that point up and forward, such as ``'y'`` or ``'-x'``.
/// nan_is_gap : bool, optional
///     Whether a marker with three times NaN is missing. If it is not, that is a repair, and with `strict` an error.
/// rate : float, optional
///     Frames a second of files that have no times, and of key points in any case.
/// person : int, optional
///     Number of the person in each frame of key points; unless given, the one seen best in the first frame is followed.
/// diver : Diver, optional
///     Whose size motions without lengths take; the spatial diver's of 1.70 m unless given.
///
/// Returns
/// -------
/// MarkerRecording, SkeletonRecording, KeypointRecording or ChannelRecording
///
/// Raises
/// ------
/// ReadError
///     If the file is not of its format; the message and the attribute ``line`` or ``byte`` say where.
/// InputError
///     If the file is of no format, or leaves something open that must be given.
/// OSError
///     If the file cannot be opened.
///
/// Examples
/// --------
/// >>> import io
/// >>> from somersault import motion
/// >>> text = io.StringIO("time,hip_x,hip_y,hip_z\n0.00,0,0,900\n")
/// >>> motion.read_file(text, unit="mm").points.tolist()
/// [[[0.0, 0.0, 0.9]]]
/// >>> table = io.StringIO("squat\nnRows=2\nnColumns=2\ninDegrees=yes\nendheader\ntime\tknee_angle_r\n0\t0\n0.1\t90\n")
/// >>> squat = motion.read_file(table)
/// >>> squat.track("knee_angle_r").round(6).tolist(), squat.repairs[0].what
/// ([0.0, 1.570796], '1 columns are converted from degrees to radians: knee_angle_r')
#[pyfunction]
#[pyo3(signature = (
    source, *, format=None, strict=false, unit=None, up=None, forward=None, nan_is_gap=false, rate=None, person=None,
    diver=None
))]
pub(crate) fn read_file<'py>(
    source: &Bound<'py, PyAny>,
    format: Option<&str>,
    strict: bool,
    unit: Option<&str>,
    up: Option<&str>,
    forward: Option<&str>,
    nan_is_gap: bool,
    rate: Option<f64>,
    person: Option<i128>,
    diver: Option<&Bound<'py, Diver>>,
) -> Result<Bound<'py, PyAny>, Error> {
    let sought = match format {
        None => Sought::Content,
        Some(ending) if readers::format_of(ending.trim_start_matches('.')).is_none() => {
            let known = readers::endings();
            return Err(Error::input(format!("`format` must be one of {known}, found '{ending}'")));
        }
        Some(ending) => Sought::Ending(ending.to_owned()),
    };
    Given { strict, unit, up, forward, nan_is_gap, rate, person, diver }.read(source, sought)
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
/// strict : bool, optional
///     Whether a file that needs a repair is an error. Otherwise `repairs` of the recording lists what was repaired.
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
#[pyo3(signature = (source, *, unit, up="y", forward="z", strict=false))]
pub(crate) fn read_bvh<'py>(
    source: &Bound<'py, PyAny>,
    unit: &str,
    up: &str,
    forward: &str,
    strict: bool,
) -> Result<Bound<'py, PyAny>, Error> {
    let (unit, up, forward) = (Some(unit), Some(up), Some(forward));
    Given { unit, up, forward, strict, ..Given::default() }.read(source, Sought::Format(readers::bvh::FORMAT))
}

/// Reads the points of a C3D file.
///
/// Integers or floats, of processors of Intel, DEC and MIPS. A point with a negative residual is missing. Analog
/// channels, events and force plates have readers of their own, `read_c3d_channels` and others. Where the header and the parameters of the file contradict each other, the length
/// of the file decides, and a `somersault.errors.ReadWarning` names what each declares and what is used.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading bytes
/// unit : str, optional
///     Unit of length where the file does not say.
/// up, forward : str, optional
///     Axes of the file that point up and forward, such as ``'z'`` or ``'-y'``. Unless given, z is up or what the points show.
/// nan_is_gap : bool, optional
///     Whether a point with three times NaN is missing. If it is not, that is a repair.
/// strict : bool, optional
///     Whether a file that needs a repair is an error. Otherwise `repairs` of the recording lists what was repaired.
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
#[pyo3(signature = (source, *, unit="mm", up=None, forward=None, nan_is_gap=false, strict=false))]
pub(crate) fn read_c3d<'py>(
    source: &Bound<'py, PyAny>,
    unit: &str,
    up: Option<&str>,
    forward: Option<&str>,
    nan_is_gap: bool,
    strict: bool,
) -> Result<Bound<'py, PyAny>, Error> {
    let unit = Some(unit);
    Given { unit, up, forward, nan_is_gap, strict, ..Given::default() }
        .read(source, Sought::Format(readers::c3d::FORMAT))
}

/// What a reader of a part of a file returns.
fn part<T: Send + 'static>(
    source: &Bound<'_, PyAny>,
    reader: impl FnOnce(&[u8]) -> Result<T, ReadError> + Send + 'static,
) -> Result<T, Error> {
    let (bytes, name) = bytes_of(source)?;
    leave_on_signal(source.py(), move |_| reader(&bytes).map_err(|error| Failed { error, name }))
}

/// Reads the analog channels of a C3D file, scaled: (number − OFFSET) · SCALE · GEN_SCALE.
///
/// Each sample becomes a frame, so that the recording has the sampling rate of the channels; times are those of `read_c3d`.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading bytes
///
/// Returns
/// -------
/// ChannelRecording or None
///     With the units of the file; None where the file has no channels.
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
/// >>> motion.read_c3d_channels(path) is None
/// True
#[pyfunction]
pub(crate) fn read_c3d_channels(source: &Bound<'_, PyAny>) -> Result<Option<ChannelRecording>, Error> {
    Ok(part(source, readers::c3d::channels)?.map(Into::into))
}

/// Reads the events of a C3D file: those of its group EVENT, or of its header.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading bytes
///
/// Returns
/// -------
/// list of (float, str, str)
///     Time, s, label and context of each, in the order of times.
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
/// >>> motion.read_c3d_events(path)
/// []
#[pyfunction]
pub(crate) fn read_c3d_events(source: &Bound<'_, PyAny>) -> Result<Vec<(f64, String, String)>, Error> {
    let events = part(source, readers::c3d::events)?;
    Ok(events.into_iter().map(|event| (event.time, event.label, event.context)).collect())
}

/// Reads the force plates of a C3D file, as its group FORCE_PLATFORM describes them.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading bytes
///
/// Returns
/// -------
/// list of dict
///     For each plate its ``type``, ``corners`` (four points) and ``origin`` (NaN if the file has none) in the unit and axes of the
///     file, the ``channels``, numbers from 0 among those of `read_c3d_channels`, and the ``calibration``, column by column.
///
/// Raises
/// ------
/// ReadError
///     If the file is no C3D, or types or corners of some plates are missing; the message and the attribute ``byte`` say where.
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
/// >>> motion.read_c3d_force_plates(path)
/// []
#[pyfunction]
pub(crate) fn read_c3d_force_plates<'py>(
    source: &Bound<'py, PyAny>,
) -> Result<Vec<Bound<'py, PyDict>>, Error> {
    let one = |plate: readers::c3d::ForcePlate| {
        let found = PyDict::new(source.py());
        found.set_item("type", plate.kind)?;
        found.set_item("corners", plate.corners)?;
        found.set_item("origin", plate.origin)?;
        found.set_item("channels", plate.channels)?;
        found.set_item("calibration", plate.calibration)?;
        Ok(found)
    };
    part(source, readers::c3d::force_plates)?.into_iter().map(one).collect()
}

/// Reads a TRC file of markers, as Motion Analysis, OpenSim, Pose2Sim, OpenCap and spreadsheets write them.
///
/// Repaired are: numbers of frames and markers that are not those of what follows, runs of tabs, other separators, empty columns,
/// rows that end early, columns without a name, NaN, decimal commas, frames without a number or a time, names that repeat.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading
/// up, forward : str, optional
///     Axes of the file that point up and forward. Unless given, y is up, as for OpenSim, or what the markers show: heads above
///     feet, or the fall of a flight. The unit is the file's.
/// nan_is_gap : bool, optional
///     Whether a marker with three times NaN is missing. If it is not, that is a repair. Empty cells always are gaps.
/// rate : float, optional
///     Frames a second where times do not rise or are missing, in the place of ``DataRate``.
/// strict : bool, optional
///     Whether a file that needs a repair is an error. Otherwise `repairs` of the recording lists what was repaired.
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
#[pyo3(signature = (source, *, up=None, forward=None, nan_is_gap=false, rate=None, strict=false))]
pub(crate) fn read_trc<'py>(
    source: &Bound<'py, PyAny>,
    up: Option<&str>,
    forward: Option<&str>,
    nan_is_gap: bool,
    rate: Option<f64>,
    strict: bool,
) -> Result<Bound<'py, PyAny>, Error> {
    Given { up, forward, nan_is_gap, rate, strict, ..Given::default() }
        .read(source, Sought::Format(readers::trc::FORMAT))
}

/// Reads a table of markers, or of other named columns, with commas, semicolons or tabs.
///
/// The first line has ``time``, s, and then ``_x``, ``_y`` and ``_z`` after the name of each marker; every other line is a
/// frame. Three empty cells are a gap. Lines that begin with ``#`` are comments. Coordinates may end in ``:X``, ``.x``, `` X`` or
/// ``[0]`` too, and a table of other columns is read as channels. What OptiTrack Motive, Vicon Nexus and Qualisys QTM export is
/// known by its header: unit, rate, names and axes are theirs.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading
/// unit : str, optional
///     Unit of length where the file has none; m unless given.
/// up, forward : str, optional
///     Axes of the file that point up and forward. Unless given, z is up, and y of Motive.
/// nan_is_gap : bool, optional
///     Whether a marker with three times NaN is missing. If it is not, that is a repair.
/// rate : float, optional
///     Frames a second of a table without times.
/// strict : bool, optional
///     Whether a file that needs a repair is an error. Otherwise `repairs` of the recording lists what was repaired.
///
/// Returns
/// -------
/// MarkerRecording or ChannelRecording
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
#[pyo3(signature = (
    source, *, unit=None, up=None, forward=None, nan_is_gap=false, rate=None, strict=false
))]
pub(crate) fn read_csv<'py>(
    source: &Bound<'py, PyAny>,
    unit: Option<&str>,
    up: Option<&str>,
    forward: Option<&str>,
    nan_is_gap: bool,
    rate: Option<f64>,
    strict: bool,
) -> Result<Bound<'py, PyAny>, Error> {
    Given { unit, up, forward, nan_is_gap, rate, strict, ..Given::default() }
        .read(source, Sought::Format(readers::csv::FORMAT))
}

/// Reads a motion or storage file of OpenSim: named columns over time.
///
/// ``nRows`` and ``nColumns``, or ``datarows`` and ``datacolumns`` of SIMM, are compared with what follows. With
/// ``inDegrees=yes`` columns that are angles by their names are converted to radians, and `repairs` of the recording says which; all
/// are but translations (``_tx``, ``_ty``, ``_tz``), forces, points, torques, activations, lengths and the like, of
/// which OpenSim itself learns from the model. Vectors of a column (``DataType=Vec3``, …) become columns that end in ``_1``,
/// ``_2``, ….
///
/// Parameters
/// ----------
/// source : path, or file opened for reading
/// strict : bool, optional
///     Whether a file that needs a repair is an error.
///
/// Returns
/// -------
/// ChannelRecording
///
/// Raises
/// ------
/// ReadError
///     If the file is no such file; the message and the attribute ``line`` say where.
/// OSError
///     If the file cannot be opened.
///
/// Examples
/// --------
/// >>> import io
/// >>> from somersault import motion
/// >>> text = "squat\nnRows=2\nnColumns=2\ninDegrees=no\nendheader\ntime\tpelvis_ty\n0\t0.9\n0.1\t0.8\n"
/// >>> motion.read_mot(io.StringIO(text)).track("pelvis_ty").tolist()
/// [0.9, 0.8]
#[pyfunction]
#[pyo3(signature = (source, *, strict=false))]
pub(crate) fn read_mot<'py>(source: &Bound<'py, PyAny>, strict: bool) -> Result<Bound<'py, PyAny>, Error> {
    Given { strict, ..Given::default() }.read(source, Sought::Format(readers::mot::FORMAT))
}

/// Reads key points of a pose estimator.
///
/// | Program | A file is |
/// |---|---|
/// | OpenPose | a frame with ``people``; a folder of them; a list |
/// | COCO, AlphaPose | a list of results with ``image_id``, or ``annotations``; frames under the names of their pictures |
/// | MMPose | ``instance_info``, or a list of frames with ``instances`` |
/// | MediaPipe | a frame or a list of them: landmarks with ``x``, ``y``, ``z``, ``visibility`` |
/// | EasyMocap | a folder of lists with ``keypoints3d`` |
///
/// Names are the file's, or those of the model with as many points: COCO (17), OpenPose (18, BODY_25), HALPE-26, MediaPipe (33).
/// Weights are confidences, half of COCO's visibility, or 1; they are 0 where a point was not found.
///
/// Parameters
/// ----------
/// source : path, or file opened for reading
/// rate : float, optional
///     Frames a second; needed where the file has no times, and used in their place.
/// person : int, optional
///     Number of the person in each frame; unless given, the one seen best in the first frame is followed. Frames in which
///     this person is absent have weights of 0, and `repairs` lists how many there are.
/// strict : bool, optional
///     Whether a file that needs a repair is an error.
///
/// Returns
/// -------
/// KeypointRecording
///
/// Raises
/// ------
/// ReadError
///     If the file has no key points; the message and the attribute ``line`` say where: the line of what is no JSON, and
///     otherwise the number of the frame.
/// InputError
///     If `rate` is missing, or there is no such person.
/// OSError
///     If the file cannot be opened.
///
/// Examples
/// --------
/// >>> import io, json
/// >>> from somersault import motion
/// >>> person = {"pose_keypoints_2d": [100.0, 50.0, 0.9] + 24 * [0.0, 0.0, 0.0]}
/// >>> frames = io.StringIO(json.dumps([{"people": [person]}, {"people": [person]}]))
/// >>> seen = motion.read_pose(frames, rate=30.0)
/// >>> seen.names[0], seen.points[1, 0].tolist(), seen.weights[1, :2].tolist()
/// ('nose', [100.0, 50.0], [0.9, 0.0])
#[pyfunction]
#[pyo3(signature = (source, *, rate=None, person=None, strict=false))]
pub(crate) fn read_pose<'py>(
    source: &Bound<'py, PyAny>,
    rate: Option<f64>,
    person: Option<i128>,
    strict: bool,
) -> Result<Bound<'py, PyAny>, Error> {
    Given { rate, person, strict, ..Given::default() }.read(source, Sought::Format(readers::pose::FORMAT))
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
pub(crate) fn read_joint_motion<'py>(
    source: &Bound<'py, PyAny>,
    diver: Option<&Bound<'py, Diver>>,
) -> Result<Bound<'py, PyAny>, Error> {
    Given { diver, ..Given::default() }.read(source, Sought::Format(readers::joint_motion::FORMAT))
}
