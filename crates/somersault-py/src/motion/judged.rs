//! Sets of judged motions that users provide.

use super::convention::convention;
use super::markers::MarkerRecording;
use super::matrix::{numbers_array, same_length};
use super::readers::warn;
use super::scoring::Performance;
use crate::core::convert::with_shape;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::leave_on_signal;
use crate::multibody::models::Diver;
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::motion::judged::{self, JudgedError, JudgedOptions};
use somersault::motion::readers::{LoadError, Place};
use somersault::multibody::models;
use std::path::PathBuf;

/// Motions with scores, as `read_judged` reads them: markers of the same names without gaps.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct JudgedSet {
    pub(super) set: judged::JudgedSet,
}

/// The exception for an error, with the line of the list where there is one.
fn raised(error: JudgedError) -> Error {
    let message = error.to_string();
    let line = match error {
        JudgedError::Scoring { source, .. } => return source.into(),
        JudgedError::Write(error) => return error.into(),
        JudgedError::Io { .. } | JudgedError::List(LoadError::Io { .. }) => {
            return Error::Raised(PyOSError::new_err(message));
        }
        JudgedError::List(LoadError::Read { source, .. }) => match source.place() {
            Some(Place::Line(line)) => Some(line),
            _ => None,
        },
        JudgedError::Motion { line, .. }
        | JudgedError::Twice { line, .. }
        | JudgedError::UnknownFormat { line, .. }
        | JudgedError::NotCsv { line, .. }
        | JudgedError::Recording { line, .. }
        | JudgedError::Gap { line, .. } => Some(line),
        _ => None,
    };
    let raised: PyErr = Error::read(message).into();
    Python::attach(|py| line.map_or(Ok(()), |line| raised.value(py).setattr("line", line)))
        .map_or_else(Error::Raised, |()| Error::Raised(raised))
}

value! {
    impl JudgedSet {
        /// tuple of str: Files of the motions, relative to the list.
        files: PyResult<Bound<'py, PyTuple>> =
            |own, py| PyTuple::new(py, own.set.list.motions.iter().map(|motion| motion.file.as_str()));
        /// ndarray, shape (n_motions,): Scores.
        scores: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.set.scores());
        /// tuple of str or None: The athlete of each motion, where the list says so; `groups` of `validate` and `ScoringModel`.
        athletes: PyResult<Option<Bound<'py, PyTuple>>> =
            |own, py| own.set.athletes().map(|athletes| PyTuple::new(py, athletes)).transpose();
        /// list of bool: Whether motion or score are synthetic.
        synthetic: Vec<bool> = |own| own.set.list.motions.iter().map(|motion| motion.synthetic).collect();
        /// list of MarkerRecording: The motions.
        recordings: Vec<MarkerRecording> =
            |own| own.set.recordings.iter().cloned().map(MarkerRecording::from).collect();
    }
}

#[pymethods]
impl JudgedSet {
    /// dict of str to ndarray: Single features, for baselines.
    #[getter]
    fn features<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        for (name, values) in self.set.features() {
            found.set_item(name, numbers_array(py, &values))?;
        }
        Ok(found)
    }

    /// The motions to be scored, synthetic ones labelled so.
    ///
    /// Returns
    /// -------
    /// list of Performance
    ///
    /// Examples
    /// --------
    /// >>> import pathlib, tempfile
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> folder, t = pathlib.Path(tempfile.mkdtemp()), np.linspace(0.0, 1.0, 10)
    /// >>> for name in ("one", "two"):
    /// ...     hip = motion.MarkerRecording(["hip"], t, np.outer(t, [1.0, 0.0, 0.5])[:, None])
    /// ...     motion.write_csv(folder / f"{name}.csv", hip)
    /// >>> _ = (folder / "judged.csv").write_text("motion,score\none.csv,7.5\ntwo.csv,8\n")
    /// >>> motion.read_judged(folder / "judged.csv").performances()
    /// [<Performance: 3 features, 1.000 s>, <Performance: 3 features, 1.000 s>]
    fn performances(&self) -> Result<Vec<Performance>, Error> {
        let found = self.set.performances().map_err(raised)?;
        Ok(found.into_iter().map(|performance| Performance { performance }).collect())
    }

    /// Writes the list as ``judged.csv`` and its motions as CSV into a folder. What is synthetic says SYNTHETIC.
    ///
    /// Parameters
    /// ----------
    /// folder : path
    ///
    /// Raises
    /// ------
    /// ReadError
    ///     If a file of the list does not end in ``.csv``.
    /// WriteError
    ///     If a file has the name of the list.
    /// OSError
    ///     If the folder cannot be written to.
    ///
    /// Examples
    /// --------
    /// >>> import pathlib, tempfile
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> folder, t = pathlib.Path(tempfile.mkdtemp()), np.linspace(0.0, 1.0, 10)
    /// >>> hip = motion.MarkerRecording(["hip"], t, np.outer(t, [1.0, 0.0, 0.5])[:, None])
    /// >>> motion.write_csv(folder / "one.csv", hip)
    /// >>> _ = (folder / "list.csv").write_text("motion,score\none.csv,7.5\n")
    /// >>> motion.read_judged(folder / "list.csv").save(folder / "copy")
    /// >>> sorted(path.name for path in (folder / "copy").iterdir())
    /// ['judged.csv', 'one.csv']
    fn save(&self, folder: PathBuf) -> Result<(), Error> {
        self.set.save(folder).map_err(raised)
    }

    fn __len__(&self) -> usize {
        self.set.recordings.len()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let lines: Vec<usize> = own.set.list.motions.iter().map(|motion| motion.line).collect();
        let (features, recordings) = (own.features(py)?, own.recordings());
        let (files, athletes) = (own.files(py)?, own.athletes(py)?);
        by_restore(slf, (files, own.scores(py), own.synthetic(), lines, features, recordings, athletes))
    }

    /// A pickled set.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        files: Vec<String>,
        scores: &Bound<'_, PyAny>,
        synthetic: Vec<bool>,
        lines: Vec<usize>,
        features: &Bound<'_, PyDict>,
        recordings: Vec<Bound<'_, MarkerRecording>>,
        athletes: Option<Vec<String>>,
    ) -> Result<Self, Error> {
        let n = files.len();
        same_length("athletes", athletes.as_ref().map_or(n, Vec::len), n)?;
        let scores = with_shape("scores", &[n], scores)?;
        same_length("synthetic", synthetic.len(), n)?;
        same_length("lines", lines.len(), n)?;
        same_length("recordings", recordings.len(), n)?;
        let (mut feature_names, mut columns) = (Vec::new(), Vec::new());
        for (name, values) in features.iter() {
            feature_names.push(name.extract::<String>()?);
            columns.push(with_shape("features", &[n], &values)?);
        }
        let motion = |(k, file): (usize, String)| judged::JudgedMotion {
            file,
            score: scores[k],
            athlete: athletes.as_ref().map(|athletes| athletes[k].clone()),
            synthetic: synthetic[k],
            features: columns.iter().map(|column| column[k]).collect(),
            line: lines[k],
        };
        let motions = files.into_iter().enumerate().map(motion).collect();
        let recordings = recordings.iter().map(|recording| recording.get().recording.clone()).collect();
        let list = judged::JudgedList { feature_names, motions };
        Ok(Self { set: judged::JudgedSet { list, recordings, repairs: Vec::new() } })
    }

    fn __repr__(&self) -> String {
        let made_up = self.set.list.motions.iter().filter(|motion| motion.synthetic).count();
        let label = if made_up > 0 { format!(", {made_up} of them SYNTHETIC") } else { String::new() };
        format!("<JudgedSet: {} motions{label}>", self.set.recordings.len())
    }
}

/// Reads motions with scores: a list as comma-separated values, and the files that it names.
///
/// The first line of the list names its columns: ``motion``, a file below the folder of the list; ``score``; ``athlete`` and ``synthetic``,
/// which may be left out, a name, and ``true`` or ``false``; all others are numbers that serve as single features. Files are read by
/// their ending: ``.csv``, ``.trc`` and ``.c3d`` have markers; of ``.bvh``, ``.json`` and ``.txt`` joint centres are taken. All must
/// have the markers of the first, and no file may be listed twice. Contradictions in a C3D are warned of as by `read_c3d`.
///
/// Parameters
/// ----------
/// path : path
///     The list.
/// unit, up, forward : str, optional
///     Axes of all files, and the unit where a file has none.
/// nan_is_gap : bool, optional
///     Whether NaN in files of markers is a gap.
/// longest_gap : float, optional
///     The longest gap that is filled, s. Gaps that are left are errors.
/// diver : Diver, optional
///     Whose lengths the motions of DeepMimic have.
///
/// Returns
/// -------
/// JudgedSet
///
/// Raises
/// ------
/// ReadError
///     If list or motion are not what they should be; the attribute ``line`` is that of the list.
/// OSError
///     If the list cannot be opened.
///
/// Examples
/// --------
/// >>> import pathlib, tempfile
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> folder, t = pathlib.Path(tempfile.mkdtemp()), np.linspace(0.0, 1.0, 10)
/// >>> for name in ("one", "two"):
/// ...     hip = motion.MarkerRecording(["hip"], t, np.outer(t, [1.0, 0.0, 0.5])[:, None])
/// ...     motion.write_csv(folder / f"{name}.csv", hip)
/// >>> _ = (folder / "judged.csv").write_text("motion,score\none.csv,7.5\ntwo.csv,8\n")
/// >>> motion.read_judged(folder / "judged.csv").scores
/// array([7.5, 8. ])
#[pyfunction]
#[pyo3(signature = (
    path, *, unit="m", up="z", forward="x", nan_is_gap=false, longest_gap=0.1, diver=None
))]
pub(crate) fn read_judged(
    py: Python<'_>,
    path: PathBuf,
    unit: &str,
    up: &str,
    forward: &str,
    nan_is_gap: bool,
    longest_gap: f64,
    diver: Option<&Bound<'_, Diver>>,
) -> Result<JudgedSet, Error> {
    let convention = convention(unit, up, forward)?;
    let diver = diver.map_or_else(models::Diver::spatial, |diver| diver.get().size());
    let options = JudgedOptions { convention, nan_is_gap, longest_gap, diver };
    let set = leave_on_signal(py, move |_| judged::load_set(path, &options).map_err(raised))?;
    for (line, repair) in set.repairs.iter().filter(|(_, repair)| !repair.is_decision) {
        warn(py, &format!("line {line} of the list: {repair}"))?;
    }
    Ok(JudgedSet { set })
}
