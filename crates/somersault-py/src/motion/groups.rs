//! Groups of motions side by side.

use super::matrix::{count, matrices, matrix, matrix_array, numbers_array, same_length};
use super::motion_fit::MotionFit;
use crate::core::convert::{a_type, real_numbers, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, brief, by_restore, few, value};
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::motion::analysis::{self, AnalysisError, Panel};

/// Mean and spread of a group of motions at each frame.
///
/// Parameters
/// ----------
/// series : array_like, shape (n_motions, n_frames)
///
/// Raises
/// ------
/// InputError
///     If there is no motion, or a number is not finite.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> band = motion.Band([[0.0, 1.0, 2.0], [2.0, 3.0, 4.0]])
/// >>> band.mean.tolist(), band.deviation.round(3).tolist()
/// ([1.0, 2.0, 3.0], [1.414, 1.414, 1.414])
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct Band {
    band: analysis::Band,
}

value! {
    impl Band {
        /// ndarray, shape (n_frames,): Mean over the motions.
        mean: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.band.mean);
        /// ndarray, shape (n_frames,): Standard deviation over the motions, with n − 1 in the denominator; zero for a single
        /// motion.
        deviation: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.band.deviation);
    }
}

#[pymethods]
impl Band {
    #[new]
    fn new(series: &Bound<'_, PyAny>) -> Result<Self, Error> {
        Ok(Self { band: analysis::Band::of(&matrix("series", series)?)? })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        by_restore(slf, (own.mean(py), own.deviation(py)))
    }

    /// A pickled band.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        mean: &Bound<'_, PyAny>,
        deviation: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let mean = real_numbers("mean", mean)?;
        let deviation = with_shape("deviation", &[mean.len()], deviation)?;
        Ok(Self { band: analysis::Band { mean, deviation } })
    }

    fn __repr__(&self) -> String {
        format!("<Band: {} frames>", self.band.mean.len())
    }
}

/// One panel of Figure 4.1 for groups of fitted motions, each normalised to the same number of frames.
///
/// Parameters
/// ----------
/// groups : dict of str to sequence of MotionFit
///     Fits of one kind of model. Frames without markers are left out.
/// panel : {'eigenweight', 'marker_error', 'scale', 'rotation'}
///     An eigenweight; the root mean square of the residuals, m; the scale; or turns about the lateral axis, forwards
///     positive.
/// n_frames : int, optional
///     60 in the thesis.
/// weight : int, optional
///     Number of the eigenweight, from 0.
///
/// Raises
/// ------
/// InputError
///     If a fit has no such weight, or there is nothing to compare.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import motion, multibody
/// >>> arm = multibody.two_link_arm()
/// >>> markers = motion.MarkerSet(arm, {"elbow": ("lower", (0, 0, 0)), "hand": ("lower", (0.5, 0, 0))})
/// >>> t = np.linspace(0.0, 1.0, 8)
/// >>> def fit(size):
/// ...     seen = motion.place_markers(markers, t, np.outer(t, [1.0, 0.5]), scale=size)
/// ...     return motion.MarkerFit(markers).fit(seen)
/// >>> groups = {"small": [fit(0.9), fit(0.95)], "tall": [fit(1.1), fit(1.2)]}
/// >>> comparison = motion.GroupComparison(groups, "scale", n_frames=5)
/// >>> comparison.bands()["tall"].mean.round(3)
/// array([1.15, 1.15, 1.15, 1.15, 1.15])
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct GroupComparison {
    names: Vec<String>,
    comparison: analysis::GroupComparison,
}

fn panel_of(name: &str, weight: usize) -> Result<Panel, Error> {
    match name {
        "eigenweight" => Ok(Panel::Eigenweight(weight)),
        "marker_error" => Ok(Panel::MarkerError),
        "scale" => Ok(Panel::Scale),
        "rotation" => Ok(Panel::Rotation),
        _ => Err(Error::input(format!(
            "`panel` must be 'eigenweight', 'marker_error', 'scale' or 'rotation', found '{name}'"
        ))),
    }
}

#[pymethods]
impl GroupComparison {
    #[new]
    #[pyo3(signature = (groups, panel, *, n_frames=60, weight=0))]
    fn new(groups: &Bound<'_, PyDict>, panel: &str, n_frames: i128, weight: i128) -> Result<Self, Error> {
        let (panel, n_frames) = (panel_of(panel, count("weight", weight)?)?, count("n_frames", n_frames)?);
        let mut names = Vec::new();
        let mut fits: Vec<Vec<Bound<'_, MotionFit>>> = Vec::new();
        for (name, group) in groups.iter() {
            let wrong = |_| {
                let (name, group) = (a_type(&name), a_type(&group));
                let expected = "`groups` must have names with sequences of MotionFit";
                Error::input(format!("{expected}, found {name} with {group}"))
            };
            names.push(name.extract::<String>().map_err(wrong)?);
            fits.push(group.extract().map_err(wrong)?);
        }
        let Some(first) = fits.iter().flatten().next() else {
            return Err(Error::input("`groups` must have a fitted motion, found none".to_owned()));
        };
        let model = first.get().fit.get().fit.model();
        for fit in fits.iter().flatten() {
            let other = fit.get().fit.get().fit.model();
            if other.joint(0) != model.joint(0) || other.n_positions() != model.n_positions() {
                let message = format!(
                    "`groups` must be fits of one kind of model, found {} and {} numbers in a configuration",
                    model.n_positions(),
                    other.n_positions()
                );
                return Err(Error::input(message));
            }
        }
        let motions: Vec<Vec<_>> =
            fits.iter().map(|group| group.iter().map(|fit| &fit.get().motion).collect()).collect();
        let motions: Vec<&[_]> = motions.iter().map(Vec::as_slice).collect();
        let comparison = analysis::GroupComparison::try_new(model, &motions, panel, n_frames);
        let comparison = comparison.map_err(|error| match error {
            AnalysisError::NothingSeen { group, motion } => Error::input(format!(
                "`groups['{}'][{motion}]` must have markers, but has none in any frame",
                names[group]
            )),
            error => error.into(),
        })?;
        Ok(Self { names, comparison })
    }

    /// tuple of str: Names of the groups.
    #[getter]
    fn names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.names)
    }

    /// str: What is compared.
    #[getter]
    fn panel(&self) -> &'static str {
        match self.comparison.panel() {
            Panel::Eigenweight(_) => "eigenweight",
            Panel::MarkerError => "marker_error",
            Panel::Scale => "scale",
            Panel::Rotation => "rotation",
        }
    }

    /// The motions of a group.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_motions, n_frames)
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion, multibody
    /// >>> arm = multibody.two_link_arm()
    /// >>> markers = motion.MarkerSet(arm, {"elbow": ("lower", (0, 0, 0)), "hand": ("lower", (0.5, 0, 0))})
    /// >>> t = np.linspace(0.0, 1.0, 8)
    /// >>> seen = motion.place_markers(markers, t, np.outer(t, [1.0, 0.5]), scale=1.1)
    /// >>> fit = motion.MarkerFit(markers).fit(seen)
    /// >>> motion.GroupComparison({"tall": [fit]}, "scale", n_frames=4).series("tall").round(3)
    /// array([[1.1, 1.1, 1.1, 1.1]])
    fn series<'py>(&self, py: Python<'py>, name: &str) -> Result<Bound<'py, PyAny>, Error> {
        let mut series = self.names.iter().zip(self.comparison.series());
        let (_, found) = series.find(|(known, _)| *known == name).ok_or_else(|| {
            let known = self.names.join(", ");
            Error::input(format!("`name` must be one of the groups {known}, found '{name}'"))
        })?;
        Ok(matrix_array(py, &found)?)
    }

    /// Mean and spread of each group.
    ///
    /// Returns
    /// -------
    /// dict of str to Band
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion, multibody
    /// >>> arm = multibody.two_link_arm()
    /// >>> markers = motion.MarkerSet(arm, {"elbow": ("lower", (0, 0, 0)), "hand": ("lower", (0.5, 0, 0))})
    /// >>> t = np.linspace(0.0, 1.0, 8)
    /// >>> seen = [motion.place_markers(markers, t, np.outer(t, [1.0, 0.5]), scale=size) for size in (1.0, 1.2)]
    /// >>> fits = [motion.MarkerFit(markers).fit(each) for each in seen]
    /// >>> bands = motion.GroupComparison({"all": fits}, "scale", n_frames=3).bands()
    /// >>> bands["all"].mean.round(3), bands["all"].deviation.round(3)
    /// (array([1.1, 1.1, 1.1]), array([0.141, 0.141, 0.141]))
    fn bands<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>, Error> {
        let found = PyDict::new(py);
        for (name, band) in self.names.iter().zip(self.comparison.bands()?) {
            found.set_item(name, Band { band })?;
        }
        Ok(found)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let series = own.comparison.series().map(|series| matrix_array(py, &series));
        let series: Vec<_> = series.collect::<PyResult<_>>()?;
        let weight = match own.comparison.panel() {
            Panel::Eigenweight(weight) => weight,
            _ => 0,
        };
        by_restore(slf, (own.names(py)?, own.panel(), weight, series))
    }

    /// A pickled comparison.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        names: Vec<String>,
        panel: &str,
        weight: usize,
        series: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let series = matrices("series", series)?;
        same_length("series", series.len(), names.len())?;
        let comparison = analysis::GroupComparison::from_series(&series, panel_of(panel, weight)?)?;
        Ok(Self { names, comparison })
    }

    fn __repr__(&self) -> String {
        format!("<GroupComparison: {} of {}>", self.panel(), brief(&few(&self.names), 100))
    }
}

/// A quantity of all frames, brought to so many at equal distances in time by a cubic spline.
///
/// Parameters
/// ----------
/// times : array_like, shape (n,)
/// values : array_like, shape (n,)
/// n_frames : int
///
/// Returns
/// -------
/// ndarray, shape (n_frames,)
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> motion.normalize_frames([0.0, 1.0, 2.0, 4.0], [0.0, 1.0, 2.0, 4.0], 5).round(6)
/// array([0., 1., 2., 3., 4.])
#[pyfunction]
pub(crate) fn normalize_frames<'py>(
    py: Python<'py>,
    times: &Bound<'py, PyAny>,
    values: &Bound<'py, PyAny>,
    n_frames: i128,
) -> Result<Bound<'py, PyAny>, Error> {
    let times = real_numbers("times", times)?;
    let values = with_shape("values", &[times.len()], values)?;
    let n_frames = count("n_frames", n_frames)?;
    Ok(numbers_array(py, &analysis::normalize_frames(&times, &values, n_frames)?))
}

/// Somersaults that the root of a tree, the torso of a diver, has made since the first configuration.
///
/// Of a planar root that is its angle. Of a free one it is the turn about the horizontal axis that was lateral in the first
/// configuration, whatever the twist. Configurations must be less than a half turn apart.
///
/// Parameters
/// ----------
/// model : Model
/// q : array_like, shape (n, n_positions)
///
/// Returns
/// -------
/// ndarray, shape (n,), or None
///     In turns, forwards positive; None for a root that does not turn so.
///
/// Raises
/// ------
/// InputError
///     If a number is not finite, or a root's quaternion is not of unit length.
///
/// Examples
/// --------
/// A somersault and a half:
///
/// >>> import numpy as np
/// >>> from somersault import motion, multibody
/// >>> diver = multibody.diver_planar()
/// >>> q = np.tile(diver.configuration("A"), (20, 1))
/// >>> q[:, 2] = np.linspace(0.0, -3 * np.pi, 20)
/// >>> round(float(motion.somersaults(diver.model, q)[-1]), 6)
/// 1.5
#[pyfunction]
pub(crate) fn somersaults<'py>(
    py: Python<'py>,
    model: &Bound<'py, Model>,
    q: &Bound<'py, PyAny>,
) -> Result<Option<Bound<'py, PyAny>>, Error> {
    let model = &model.get().model;
    let q = matrix("q", q)?;
    let n = model.n_positions();
    if q.ncols() != n {
        return Err(Error::input(format!("`q` must have {n} columns, found {}", q.ncols())));
    }
    if n == 0 {
        return Ok(None);
    }
    let rows = q.transpose();
    let rows: Vec<&[f64]> = rows.as_slice().chunks_exact(n).collect();
    Ok(analysis::somersaults(model, &rows)?.map(|turns| numbers_array(py, &turns)))
}
