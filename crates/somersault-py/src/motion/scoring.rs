//! Motions to be scored, and models that score them.

use super::markers::MarkerRecording;
use super::matrix::{self, count, matrix, matrix_array, numbers_array, same_length};
use super::pca::Pca;
use crate::core::convert::{a_type, entries, entries_or_none, real_numbers};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::leave_on_signal;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple, PyType};
use somersault::motion::nalgebra::Vector3;
use somersault::motion::recording;
use somersault::motion::scoring::{self, FeatureKind, Groups, RegressionMethod, Tuning, VectorOptions};

/// A motion to be scored, frame by frame.
///
/// Parameters
/// ----------
/// times : array_like, shape (n_frames,)
///     Times, s, rising.
/// names : sequence of str
///     Names of the columns of `postures`, which differ. A model finds them by name.
/// postures : array_like, shape (n_frames, n_features)
///     Coordinates that do not depend on where the body faces, such as joint angles, rad. For markers use `from_markers`.
/// path : array_like, shape (n_frames, 3)
///     Of the body, m, z up. Where it faces does not matter.
///
/// Raises
/// ------
/// InputError
///     If a number is not finite, times do not rise, names repeat, or shapes do not fit.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> t = np.linspace(0.0, 1.5, 60)
/// >>> hip, knee = np.sin(2.0 * t), np.cos(2.0 * t)
/// >>> path = np.column_stack([t, 0 * t, 10.0 + 4.0 * t - 4.905 * t**2])
/// >>> motion.Performance(t, ["hip", "knee"], np.column_stack([hip, knee]), path)
/// <Performance: 2 features, 1.500 s>
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct Performance {
    pub(super) performance: scoring::Performance,
}

value! {
    impl Performance {
        /// float: From the first to the last frame, s.
        duration: f64 = |own| own.performance.duration();
        /// int: Numbers in a posture.
        n_features: usize = |own| own.performance.n_features();
        /// tuple of str: Names of the markers or coordinates.
        names: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, &own.performance.features().names);
        /// str: ``'markers'``, three numbers for each name, or ``'coordinates'``, one.
        kind: String = |own| own.performance.features().kind.to_string();
        /// bool: Whether it is labelled as synthetic.
        synthetic: bool = |own| own.performance.is_synthetic();
    }
}

#[pymethods]
impl Performance {
    #[new]
    fn new(
        times: &Bound<'_, PyAny>,
        names: Vec<String>,
        postures: &Bound<'_, PyAny>,
        path: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let (times, postures) = (real_numbers("times", times)?, matrix("postures", postures)?);
        let path = matrix("path", path)?;
        Ok(Self { performance: scoring::Performance::try_new(times, names, postures, path)? })
    }

    /// From markers without gaps: their centre is the path, their places about it are the postures. A model finds them
    /// by name, and turns them about the vertical into one heading.
    ///
    /// Parameters
    /// ----------
    /// recording : MarkerRecording
    ///
    /// Returns
    /// -------
    /// Performance
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If a marker is missing.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> t = np.linspace(0.0, 1.0, 10)
    /// >>> points = np.stack([np.outer(t, [1.0, 0, 0]), np.outer(t, [1.0, 0, 0]) + [0, 0, 0.4]], axis=1)
    /// >>> motion.Performance.from_markers(motion.MarkerRecording(["knee", "hip"], t, points))
    /// <Performance: 6 features, 1.000 s>
    #[classmethod]
    fn from_markers(_: &Bound<'_, PyType>, recording: &Bound<'_, MarkerRecording>) -> Result<Self, Error> {
        Ok(Self { performance: scoring::Performance::from_markers(&recording.get().recording)? })
    }

    /// The same, labelled as synthetic; models and validations that use it carry the label on.
    ///
    /// Returns
    /// -------
    /// Performance
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> t = np.linspace(0.0, 1.0, 10)
    /// >>> dive = motion.Performance(t, ["hip"], np.sin(t)[:, None], np.outer(t, [0, 0, 1.0]))
    /// >>> dive.labelled_synthetic().synthetic
    /// True
    fn labelled_synthetic(&self) -> Self {
        Self { performance: self.performance.clone().labelled_synthetic() }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), &slf.get().performance);
        let (values, path) = (matrix_array(py, own.values())?, matrix_array(py, own.path())?);
        let features = (slf.get().kind(), slf.get().names(py)?);
        by_restore(slf, (numbers_array(py, own.times()), features, values, path, own.is_synthetic()))
    }

    /// A pickled motion with its label; markers are in the world.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        times: &Bound<'_, PyAny>,
        features: (String, Vec<String>),
        values: &Bound<'_, PyAny>,
        path: &Bound<'_, PyAny>,
        synthetic: bool,
    ) -> Result<Self, Error> {
        let (kind, names) = features;
        let found = if kind == FeatureKind::Markers.to_string() {
            let (times, values) = (real_numbers("times", times)?, matrix("values", values)?);
            let point = |i: usize, k: usize| Vector3::from_fn(|axis, _| values[(i, 3 * k + axis)]);
            same_length("values", values.ncols(), 3 * names.len())?;
            let places = (0..values.nrows()).flat_map(|i| (0..names.len()).map(move |k| (i, k)));
            let points = places.map(|(i, k)| Some(point(i, k))).collect();
            let recording = recording::MarkerRecording::try_new(names, times, points)?;
            Self { performance: scoring::Performance::from_markers(&recording)? }
        } else if kind == FeatureKind::Coordinates.to_string() {
            Self::new(times, names, values, path)?
        } else {
            return Err(Error::input(format!("`kind` must be 'markers' or 'coordinates', found '{kind}'")));
        };
        Ok(if synthetic { found.labelled_synthetic() } else { found })
    }

    fn __repr__(&self) -> String {
        let label = if self.synthetic() { ", SYNTHETIC" } else { "" };
        format!("<Performance: {} features, {:.3} s{label}>", self.n_features(), self.duration())
    }
}

/// The components of a regression, where it has some.
pub(super) fn components(tuning: Tuning) -> Option<usize> {
    match tuning {
        Tuning::Components(n) => Some(n),
        Tuning::Penalty(_) => None,
    }
}

/// The penalty of a regression, where it has one.
pub(super) fn penalty(tuning: Tuning) -> Option<f64> {
    match tuning {
        Tuning::Components(_) => None,
        Tuning::Penalty(penalty) => Some(penalty),
    }
}

/// Motions as Rust takes them.
pub(super) fn performances(motions: &[Bound<'_, Performance>]) -> Vec<scoring::Performance> {
    motions.iter().map(|motion| motion.get().performance.clone()).collect()
}

/// Choices for a scoring model. Those of the thesis (4.1.2) unless given: 60 frames, four eigenweights, body path.
///
/// Parameters
/// ----------
/// n_frames : int, optional
///     Frames each motion is brought to.
/// n_eigenweights : int, optional
///     Eigenweights of each frame.
/// path : bool, optional
///     Whether the path of the body, from where it begins, is part of a motion's vector.
/// duration : bool, optional
///     Whether the duration is.
/// method : {'pcr', 'pls', 'ridge'}, optional
///     How scores are regressed on the vectors of motions: by least squares on their first principal components, as in the thesis; by partial
///     least squares; or with a penalty on the squares of the coefficients (ridge regression).
/// n_components : int, optional
///     Components of 'pcr' and 'pls'; chosen by leave-one-out cross-validation unless given.
/// max_components : int, optional
///     The most that cross-validation may choose.
/// penalty : float, optional
///     Of 'ridge', as a fraction of the vectors' sum of squares about their mean: scikit-learn's `alpha` is `penalty` times that sum. Positive;
///     chosen by leave-one-out cross-validation from 1e-4 to 10 unless given.
/// scale : tuple of float, optional
///     Least and greatest score there is; 0 to 10 unless given. Scores outside are refused.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> motion.ScoringOptions(n_eigenweights=2, duration=True).duration
/// True
/// >>> motion.ScoringOptions(method="ridge").penalty is None
/// True
#[pyclass(frozen, module = "somersault.motion")]
#[derive(Clone)]
pub(crate) struct ScoringOptions {
    options: scoring::ScoringOptions,
}

impl ScoringOptions {
    /// Those given, or those of the thesis.
    pub(super) fn or_thesis(options: Option<&Bound<'_, Self>>) -> scoring::ScoringOptions {
        options.map_or_else(scoring::ScoringOptions::thesis, |options| options.get().options)
    }
}

value! {
    impl ScoringOptions {
        /// int: Frames each motion is brought to.
        n_frames: usize = |own| own.options.vector.n_frames;
        /// int: Eigenweights of each frame.
        n_eigenweights: usize = |own| own.options.vector.n_eigenweights;
        /// bool: Whether the path of the body is part of a motion's vector.
        path: bool = |own| own.options.vector.path;
        /// bool: Whether the duration is.
        duration: bool = |own| own.options.vector.duration;
        /// str: ``'pcr'``, ``'pls'`` or ``'ridge'``.
        method: String = |own| own.options.method.to_string();
        /// int or None: Components of 'pcr' and 'pls'.
        n_components: Option<usize> = |own| own.options.n_components;
        /// int: The most that cross-validation may choose.
        max_components: usize = |own| own.options.max_components;
        /// float or None: Penalty of 'ridge'.
        penalty: Option<f64> = |own| own.options.penalty;
        /// tuple of float: Least and greatest score there is.
        scale: (f64, f64) = |own| own.options.scale.into();
    }
}

#[pymethods]
impl ScoringOptions {
    #[new]
    #[pyo3(signature = (
        *, n_frames=60, n_eigenweights=4, path=true, duration=false, method="pcr", n_components=None,
        max_components=5, penalty=None, scale=(0.0, 10.0)
    ))]
    fn new(
        n_frames: i128,
        n_eigenweights: i128,
        path: bool,
        duration: bool,
        method: &str,
        n_components: Option<i128>,
        max_components: i128,
        penalty: Option<f64>,
        scale: (f64, f64),
    ) -> Result<Self, Error> {
        let (n_frames, n_eigenweights) =
            (count("n_frames", n_frames)?, count("n_eigenweights", n_eigenweights)?);
        let n_components = n_components.map(|n| count("n_components", n)).transpose()?;
        let max_components = count("max_components", max_components)?;
        let vector = VectorOptions { n_frames, n_eigenweights, path, duration };
        let (method, scale) = (method_of(method)?, scale.into());
        let options =
            scoring::ScoringOptions { vector, method, n_components, max_components, penalty, scale };
        options.expect_scale(&[])?;
        options.expect_tuning()?;
        Ok(Self { options })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let scoring::ScoringOptions { vector, n_components, max_components, penalty, scale, .. } =
            slf.get().options;
        let VectorOptions { n_frames, n_eigenweights, path, duration } = vector;
        let regression = (slf.get().method(), n_components, max_components, penalty);
        by_restore(slf, (n_frames, n_eigenweights, path, duration, regression, (scale[0], scale[1])))
    }

    /// Pickled choices.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        n_frames: i128,
        n_eigenweights: i128,
        path: bool,
        duration: bool,
        regression: (String, Option<i128>, i128, Option<f64>),
        scale: (f64, f64),
    ) -> Result<Self, Error> {
        let (method, n, most, penalty) = regression;
        Self::new(n_frames, n_eigenweights, path, duration, &method, n, most, penalty, scale)
    }

    fn __repr__(&self) -> String {
        let has = |with: bool| if with { "True" } else { "False" };
        let n_components = self.options.n_components.map_or("None".to_owned(), |n| n.to_string());
        let penalty = self.options.penalty.map_or("None".to_owned(), |penalty| penalty.to_string());
        format!(
            "ScoringOptions(n_frames={}, n_eigenweights={}, path={}, duration={}, method='{}', \
             n_components={n_components}, max_components={}, penalty={penalty}, scale=({}, {}))",
            self.n_frames(),
            self.n_eigenweights(),
            has(self.path()),
            has(self.duration()),
            self.options.method,
            self.max_components(),
            self.options.scale[0],
            self.options.scale[1]
        )
    }
}

fn method_of(name: &str) -> Result<RegressionMethod, Error> {
    use RegressionMethod::{PartialLeastSquares, PrincipalComponents, Ridge};
    [PrincipalComponents, PartialLeastSquares, Ridge]
        .into_iter()
        .find(|method| method.to_string() == name)
        .ok_or_else(|| Error::input(format!("`method` must be 'pcr', 'pls' or 'ridge', found '{name}'")))
}

/// Groups by labels, which are texts or integers.
pub(super) fn groups_of(labels: Option<Vec<Bound<'_, PyAny>>>, n: usize) -> Result<Groups, Error> {
    let Some(labels) = labels else {
        return Ok(Groups::single(n));
    };
    let label = |label: &Bound<'_, PyAny>| match (label.extract::<String>(), label.extract::<i64>()) {
        (Ok(text), _) => Ok((Some(text), 0)),
        (_, Ok(number)) => Ok((None, number)),
        _ => {
            Err(Error::input(format!("`groups` must be labels that are str or int, found {}", a_type(label))))
        }
    };
    let labels: Vec<(Option<String>, i64)> = labels.iter().map(label).collect::<Result<_, Error>>()?;
    same_length("groups", labels.len(), n)?;
    Ok(Groups::try_new(&labels)?)
}

/// A score with its interval, and how far the motion is from those that the model has learnt from.
#[pyclass(frozen, eq, module = "somersault.motion")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Score {
    score: scoring::Score,
}

value! {
    impl Score {
        /// float: The score. It may be beyond the scale, since the regression is a straight line.
        value: f64 = |own| own.score.value;
        /// tuple of float: Prediction interval: where the judge's score of a motion like the training motions lies with the probability
        /// requested, on average over such motions. As wide as the errors of the training motions by models that have not seen
        /// them; infinite where there are too few of them, fewer than 19 at 95 %.
        interval: (f64, f64) = |own| own.score.interval.into();
        /// float: Distance to the nearest training motion, over the greatest such distance among the training motions, each left out in
        /// turn. A motion like those n is beyond 1 with a chance of about 1/(n + 1).
        distance: f64 = |own| own.score.distance;
        /// bool: Whether the distance is at most 1. Else the model says nothing about the motion, whatever the value: units, axes or names
        /// may be mistaken, or it is another kind of motion.
        inside: bool = |own| own.score.is_inside();
    }
}

#[pymethods]
impl Score {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        by_restore(slf, (slf.get().value(), slf.get().interval(), slf.get().distance()))
    }

    /// A pickled score.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, value: f64, interval: (f64, f64), distance: f64) -> Self {
        Self { score: scoring::Score { value, interval: interval.into(), distance } }
    }

    fn __repr__(&self) -> String {
        let outside = if self.inside() { "" } else { ", OUTSIDE of what was learnt" };
        let (lower, upper) = self.interval();
        let distance = self.distance();
        format!(
            "<Score: {:.3} in [{lower:.3}, {upper:.3}] at a distance of {distance:.2}{outside}>",
            self.value()
        )
    }
}

/// A model that scores motions, learnt from motions and their scores (thesis 4.1).
///
/// Eigenpostures of all frames on one basis; for each motion a vector of its eigenweights, path and duration; principal
/// components of the vectors; score = a + b·s, by the method of the options. Every motion is turned about the vertical into one heading, so that it does not
/// matter where a diver faces in the laboratory. The model keeps the names of what it has learnt, and finds them in others by name.
///
/// Parameters
/// ----------
/// motions : sequence of Performance
///     Two more than components at least. All must have what the first has, by name.
/// scores : array_like, shape (n_motions,)
///     Within the scale of the options.
/// options : ScoringOptions, optional
/// groups : sequence of str or int, optional
///     A label of each motion, such as its athlete. Intervals and distances are then for motions of a group that is not among the training
///     motions. Three groups at least; each motion is its own unless given.
///
/// Raises
/// ------
/// InputError
///     If there are too few motions or groups, one lacks a marker or is in another unit, scores are not finite or not on the scale, or
///     motions have fewer numbers than components are requested.
///
/// Examples
/// --------
/// Motions that are scored by how far the hip opens, and one more of them:
///
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> t = np.linspace(0.0, 1.0, 30)
/// >>> def dive(opening):
/// ...     angles = np.column_stack([opening * np.sin(np.pi * t), 0.1 * t])
/// ...     return motion.Performance(t, ["hip", "knee"], angles, np.outer(t, [0, 0, 1.0]))
/// >>> openings = np.linspace(1.0, 2.0, 6)
/// >>> options = motion.ScoringOptions(n_eigenweights=1, n_components=1)
/// >>> model = motion.ScoringModel([dive(opening) for opening in openings], 3.0 * openings, options)
/// >>> round(model.score(dive(1.5)).value, 6)
/// 4.5
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct ScoringModel {
    model: scoring::ScoringModel,
}

value! {
    impl ScoringModel {
        /// tuple of str: Names of the markers or coordinates it has learnt.
        names: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, &own.model.features().names);
        /// str: ``'markers'`` or ``'coordinates'``.
        kind: String = |own| own.model.features().kind.to_string();
        /// ndarray, shape (n_motions,): The scores it has learnt from.
        scores: Bound<'py, PyAny> = |own, py| numbers_array(py, own.model.scores());
        /// tuple of float: Least and greatest score there is.
        scale: (f64, f64) = |own| own.model.scale().into();
        /// Pca: The basis of postures.
        eigenpostures: Pca = |own| Pca { pca: own.model.eigenpostures().clone() };
        /// Pca: The basis of motions, the thesis' Eigendives: those that 'pcr' uses, or all.
        eigenmotions: Pca = |own| Pca { pca: own.model.eigenmotions().clone() };
        /// str: ``'pcr'``, ``'pls'`` or ``'ridge'``.
        method: String = |own| own.model.method().to_string();
        /// int or None: Components of 'pcr' and 'pls', requested or chosen by cross-validation.
        n_components: Option<usize> = |own| components(own.model.tuning());
        /// float or None: Penalty of 'ridge', requested or chosen by cross-validation.
        penalty: Option<f64> = |own| penalty(own.model.tuning());
        /// ndarray, shape (n_eigenmotions,): What a unit of each Eigendive's weight adds to the score.
        coefficients: Bound<'py, PyAny> = |own, py| numbers_array(py, own.model.coefficients());
        /// float: The score of the mean motion.
        intercept: f64 = |own| own.model.intercept();
        /// bool: Whether it has learnt from synthetic motions: then its scores say nothing about real ones.
        synthetic: bool = |own| own.model.is_synthetic();
    }
}

#[pymethods]
impl ScoringModel {
    #[new]
    #[pyo3(signature = (motions, scores, options=None, *, groups=None))]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = entries)] motions: Vec<Bound<'_, Performance>>,
        scores: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, ScoringOptions>>,
        #[pyo3(from_py_with = entries_or_none)] groups: Option<Vec<Bound<'_, PyAny>>>,
    ) -> Result<Self, Error> {
        let (motions, scores) = (performances(&motions), real_numbers("scores", scores)?);
        let (options, groups) = (ScoringOptions::or_thesis(options), groups_of(groups, motions.len())?);
        let train = move |_: &_| scoring::ScoringModel::train_in_groups(&motions, &scores, &groups, &options);
        let model = leave_on_signal(py, train)?;
        Ok(Self { model })
    }

    /// The score of a motion with its prediction interval, and how far the motion is from the training motions.
    ///
    /// Parameters
    /// ----------
    /// motion : Performance
    ///     With the markers or coordinates learnt, found by name; what else it has is not used.
    /// level : float, optional
    ///     Probability with which the interval has the judge's score, between 0 and 1; 0.95 unless given.
    ///
    /// Returns
    /// -------
    /// Score
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If it lacks a name, or its markers are more than twice as far apart as the training motions or less than half: the unit is
    ///     another. Also if `level` is not between 0 and 1.
    ///
    /// Examples
    /// --------
    /// A motion far from those that the model was trained on is marked as outside:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> t = np.linspace(0.0, 1.0, 30)
    /// >>> def dive(opening):
    /// ...     angles = np.column_stack([opening * np.sin(np.pi * t), 0.1 * t])
    /// ...     return motion.Performance(t, ["hip", "knee"], angles, np.outer(t, [0, 0, 1.0]))
    /// >>> openings = np.linspace(1.0, 2.0, 6)
    /// >>> options = motion.ScoringOptions(n_eigenweights=1, n_components=1)
    /// >>> model = motion.ScoringModel([dive(opening) for opening in openings], 3.0 * openings, options)
    /// >>> model.score(dive(1.5)).inside, model.score(dive(9.0)).inside
    /// (True, False)
    #[pyo3(signature = (motion, *, level=0.95))]
    fn score(&self, motion: &Bound<'_, Performance>, level: f64) -> Result<Score, Error> {
        Ok(Score { score: self.model.score_at_level(&motion.get().performance, level)? })
    }

    /// Writes the model to a file of JSON, with all digits.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///
    /// Examples
    /// --------
    /// >>> import pathlib, tempfile
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> t = np.linspace(0.0, 1.0, 30)
    /// >>> dives = [
    /// ...     motion.Performance(t, ["hip"], (k * np.sin(np.pi * t))[:, None], np.outer(t, [0, 0, 1.0]))
    /// ...     for k in range(1, 6)]
    /// >>> options = motion.ScoringOptions(n_eigenweights=1, n_components=1)
    /// >>> path = pathlib.Path(tempfile.mkdtemp()) / "model.json"
    /// >>> motion.ScoringModel(dives, [4.0, 5.0, 6.0, 7.0, 8.0], options).save(path)
    /// >>> path.stat().st_size > 1000
    /// True
    fn save(&self, path: &Bound<'_, PyAny>) -> Result<(), Error> {
        let text = self.model.to_json()?;
        let (py, path) = (path.py(), matrix::path("path", path)?);
        let text = PyBytes::new(py, text.as_bytes());
        py.import("somersault.storage")?.call_method1("write_bytes", (path, text))?;
        Ok(())
    }

    /// The model that `save` wrote, checked.
    ///
    /// Parameters
    /// ----------
    /// path : path
    ///
    /// Returns
    /// -------
    /// ScoringModel
    ///
    /// Raises
    /// ------
    /// ReadError
    ///     If the file is not such a model or of another version, the message has the line; or if its numbers do not follow
    ///     from each other.
    ///
    /// Examples
    /// --------
    /// >>> import pathlib, tempfile
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> t = np.linspace(0.0, 1.0, 30)
    /// >>> dives = [
    /// ...     motion.Performance(t, ["hip"], (k * np.sin(np.pi * t))[:, None], np.outer(t, [0, 0, 1.0]))
    /// ...     for k in range(1, 6)]
    /// >>> options = motion.ScoringOptions(n_eigenweights=1, n_components=1)
    /// >>> path = pathlib.Path(tempfile.mkdtemp()) / "model.json"
    /// >>> motion.ScoringModel(dives, [4.0, 5.0, 6.0, 7.0, 8.0], options).save(path)
    /// >>> round(motion.ScoringModel.load(path).score(dives[2]).value, 6)
    /// 6.0
    #[classmethod]
    fn load(_: &Bound<'_, PyType>, path: &Bound<'_, PyAny>) -> Result<Self, Error> {
        let bytes: Vec<u8> = matrix::path("path", path)?.call_method0("read_bytes")?.extract()?;
        Self::from_json(&String::from_utf8_lossy(&bytes))
    }

    fn __repr__(&self) -> String {
        format!(
            "<ScoringModel: {}, {} eigenpostures{}>",
            match self.model.tuning() {
                Tuning::Components(n) => format!("{} with {n} components of motions", self.model.method()),
                Tuning::Penalty(penalty) => format!("ridge with a penalty of {penalty:.3e}"),
            },
            self.model.eigenpostures().n_components(),
            if self.synthetic() { ", SYNTHETIC" } else { "" }
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        by_restore(slf, (slf.get().model.to_json().map_err(Error::from)?,))
    }

    /// A pickled model.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, text: &str) -> Result<Self, Error> {
        Self::from_json(text)
    }
}

impl ScoringModel {
    fn from_json(text: &str) -> Result<Self, Error> {
        Ok(Self { model: scoring::ScoringModel::from_json(text)? })
    }
}

/// The points of a dive for the awards of its judges and its degree of difficulty.
///
/// Of seven judges the two highest and the two lowest awards are cancelled, of five the highest and the lowest, of three none; the sum of the
/// others is multiplied by the difficulty.
///
/// Parameters
/// ----------
/// awards : array_like, shape (3,), (5,) or (7,)
///     Half points from 0 to 10.
/// difficulty : float
///     Positive.
///
/// Returns
/// -------
/// points : float
/// counts : tuple of bool
///     Whether the award of each judge counts; of equal awards the first ones are cancelled.
///
/// Raises
/// ------
/// InputError
///     If there are other numbers of judges, an award is no half point from 0 to 10, or the difficulty is not positive.
///
/// Notes
/// -----
/// Source: World Aquatics, Competition Regulations, diving.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> motion.panel_score([7.0, 8.0, 7.5, 6.0, 7.0], 2.0)
/// (43.0, (True, False, True, False, True))
#[pyfunction]
pub(crate) fn panel_score<'py>(
    py: Python<'py>,
    awards: &Bound<'py, PyAny>,
    difficulty: f64,
) -> Result<(f64, Bound<'py, PyTuple>), Error> {
    let scoring::PanelScore { points, counts } =
        scoring::panel_score(&real_numbers("awards", awards)?, difficulty)?;
    Ok((points, PyTuple::new(py, counts)?))
}
