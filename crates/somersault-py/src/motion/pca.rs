//! Principal components of motions, and motions in a base.

use super::matrix::{count, matrices, matrix, matrix_array, numbers_array};
use crate::core::convert::{real_numbers, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::leave_on_signal;
use crate::ocp::joint_motion::EigenpostureBase;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::motion::analysis::{self, WeightBounds, eigenpostures};
use somersault::motion::nalgebra::DMatrix;

/// Principal components of samples: mean, directions in which they differ most, and their variances.
///
/// By singular values of the samples less their mean, never of a covariance matrix. The sign of a component is such that
/// its largest entry is positive, as in scikit-learn. Of the postures of motions, components are eigenpostures and
/// scores eigenweights.
///
/// Parameters
/// ----------
/// samples : array_like, shape (n_samples, n_features)
/// n_components : int, optional
///     At most n_samples − 1 and n_features, which is taken unless given.
///
/// Raises
/// ------
/// InputError
///     If there are fewer than two samples or fewer than components, a number is not finite, or samples do not differ.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> pca = motion.Pca([[0.0, 0.1], [1.0, 0.9], [2.0, 2.1], [3.0, 2.9]], 1)
/// >>> bool(pca.explained_variance_ratio[0] > 0.99)
/// True
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct Pca {
    pub(super) pca: analysis::Pca,
}

value! {
    impl Pca {
        /// ndarray, shape (n_features,): Mean of the samples.
        mean: Bound<'py, PyAny> = |own, py| numbers_array(py, own.pca.mean().as_slice());
        /// ndarray, shape (n_components, n_features): The components, of unit length, that of the largest variance first.
        components: PyResult<Bound<'py, PyAny>> =
            |own, py| matrix_array(py, &own.pca.components().transpose());
        /// int: Number of components.
        n_components: usize = |own| own.pca.n_components();
        /// int: Number of samples it is of.
        n_samples: usize = |own| own.pca.n_samples();
        /// ndarray, shape (n_components,): Variance of the scores of each component, with n − 1 in the denominator.
        explained_variance: Bound<'py, PyAny> = |own, py| numbers_array(py, own.pca.explained_variance());
        /// ndarray, shape (n_components,): Fraction of each component in the variance of the samples.
        explained_variance_ratio: Bound<'py, PyAny> =
            |own, py| numbers_array(py, &own.pca.explained_variance_ratio());
        /// float: Variance of the samples in all directions.
        total_variance: f64 = |own| own.pca.total_variance();
    }
}

#[pymethods]
impl Pca {
    #[new]
    #[pyo3(signature = (samples, n_components=None))]
    fn new(py: Python<'_>, samples: &Bound<'_, PyAny>, n_components: Option<i128>) -> Result<Self, Error> {
        let samples = matrix("samples", samples)?;
        let most = samples.nrows().saturating_sub(1).min(samples.ncols());
        let n = n_components.map_or(Ok(most), |n| count("n_components", n))?;
        Ok(Self { pca: leave_on_signal(py, move |_| analysis::Pca::fit(&samples, n))? })
    }

    /// What samples are in the components: (x − x̄)·v for each.
    ///
    /// Parameters
    /// ----------
    /// samples : array_like, shape (n, n_features)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n, n_components)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion
    /// >>> samples = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]
    /// >>> motion.Pca(samples, 1).scores(samples).round(6)
    /// array([[-1.414214],
    ///        [ 0.      ],
    ///        [ 1.414214]])
    fn scores<'py>(&self, py: Python<'py>, samples: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        Ok(matrix_array(py, &self.pca.scores(&matrix("samples", samples)?)?)?)
    }

    /// The samples that have these scores: x̄ + Σ s v.
    ///
    /// Parameters
    /// ----------
    /// scores : array_like, shape (n, n_components)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n, n_features)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion
    /// >>> pca = motion.Pca([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], 1)
    /// >>> pca.reconstruct([[0.0], [2.0**0.5]]).round(6)
    /// array([[1., 1.],
    ///        [2., 2.]])
    fn reconstruct<'py>(
        &self,
        py: Python<'py>,
        scores: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        Ok(matrix_array(py, &self.pca.reconstruct(&matrix("scores", scores)?)?)?)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let variance = (own.explained_variance(py), own.total_variance(), own.n_samples());
        by_restore(slf, (own.mean(py), own.components(py)?, variance))
    }

    /// Pickled components, checked.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        mean: &Bound<'_, PyAny>,
        components: &Bound<'_, PyAny>,
        variances: (Bound<'_, PyAny>, f64, usize),
    ) -> Result<Self, Error> {
        let (variance, total, n_samples) = variances;
        let (mean, variance) = (real_numbers("mean", mean)?, real_numbers("variance", &variance)?);
        let components = matrix("components", components)?.transpose();
        Ok(Self { pca: analysis::Pca::from_parts(mean.into(), components, variance, total, n_samples)? })
    }

    fn __repr__(&self) -> String {
        let fraction: f64 = self.pca.explained_variance_ratio().iter().sum();
        format!(
            "<Pca: {} components of {} samples, {:.1} % of their variance>",
            self.pca.n_components(),
            self.pca.n_samples(),
            100.0 * fraction
        )
    }
}

/// Eigenpostures of motions on one basis for all: weights of different motions can be compared.
///
/// Parameters
/// ----------
/// motions : sequence of array_like, shape (n_frames, n_features)
///     A motion each, with a posture in every row; numbers of frames may differ.
/// n_eigenpostures : int
///
/// Returns
/// -------
/// Pca
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> t = np.linspace(0.0, 1.0, 20)
/// >>> slow, fast = np.outer(t, [1.0, 0.5]), np.outer(2 * t, [1.0, 0.5])
/// >>> pca = motion.common_eigenpostures([slow, fast], 1)
/// >>> pca.components.round(3)
/// array([[0.894, 0.447]])
#[pyfunction]
pub(crate) fn common_eigenpostures(
    py: Python<'_>,
    motions: &Bound<'_, PyAny>,
    n_eigenpostures: i128,
) -> Result<Pca, Error> {
    let (motions, n_eigenpostures) =
        (matrices("motions", motions)?, count("n_eigenpostures", n_eigenpostures)?);
    Ok(Pca { pca: leave_on_signal(py, move |_| eigenpostures::common(&motions, n_eigenpostures))? })
}

/// Eigenpostures of each motion by itself: the variant of the thesis (4.1.1).
///
/// Bases of single motions have signs and an order of their own, so weights must not be compared across motions.
///
/// Parameters
/// ----------
/// motions : sequence of array_like, shape (n_frames, n_features)
/// n_eigenpostures : int
///
/// Returns
/// -------
/// list of Pca
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> t = np.linspace(0.0, 1.0, 20)
/// >>> one, other = np.outer(t, [1.0, 0.0]), np.outer(t, [0.0, 1.0])
/// >>> [pca.components.round(3).tolist() for pca in motion.eigenpostures_per_motion([one, other], 1)]
/// [[[1.0, 0.0]], [[0.0, 1.0]]]
#[pyfunction]
pub(crate) fn eigenpostures_per_motion(
    py: Python<'_>,
    motions: &Bound<'_, PyAny>,
    n_eigenpostures: i128,
) -> Result<Vec<Pca>, Error> {
    let (motions, n_eigenpostures) =
        (matrices("motions", motions)?, count("n_eigenpostures", n_eigenpostures)?);
    let found = leave_on_signal(py, move |_| eigenpostures::per_motion(&motions, n_eigenpostures))?;
    Ok(found.into_iter().map(|pca| Pca { pca }).collect())
}

/// A motion in a base of eigenpostures.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct Projection {
    weights: DMatrix<f64>,
    distances: Vec<f64>,
}

value! {
    impl Projection {
        /// ndarray, shape (n_frames, n_weights): Weights.
        weights: PyResult<Bound<'py, PyAny>> = |own, py| matrix_array(py, &own.weights);
        /// ndarray, shape (n_frames,): Distance of each frame to the nearest posture of the base, in the norm of its coordinates.
        distances: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.distances);
    }
}

#[pymethods]
impl Projection {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        by_restore(slf, (own.weights(py)?, own.distances(py)))
    }

    /// A pickled projection.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        weights: &Bound<'_, PyAny>,
        distances: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let weights = matrix("weights", weights)?;
        let distances = with_shape("distances", &[weights.nrows()], distances)?;
        Ok(Self { weights, distances })
    }

    fn __repr__(&self) -> String {
        format!("<Projection: {} frames, {} weights>", self.weights.nrows(), self.weights.ncols())
    }
}

/// The weights that bring a base nearest to each posture, by least squares.
///
/// Parameters
/// ----------
/// base : EigenpostureBase
/// postures : array_like, shape (n_frames, n_joints)
/// bounds : {'simplex', 'none'}, optional
///     Whether weights are not negative and add up to at most one, or may be anything.
///
/// Returns
/// -------
/// Projection
///
/// Raises
/// ------
/// InputError
///     If a posture has another number of coordinates than the base, or is not finite.
///
/// Examples
/// --------
/// >>> from somersault import motion, ocp
/// >>> base = ocp.EigenpostureBase([[0.0, 0.0], [1.0, 2.0]])
/// >>> motion.project(base, [[0.25, 0.5], [1.0, 2.0], [2.0, 4.0]]).weights.round(6).tolist()
/// [[0.25], [1.0], [1.0]]
#[pyfunction]
#[pyo3(signature = (base, postures, *, bounds="simplex"))]
pub(crate) fn project(
    py: Python<'_>,
    base: &Bound<'_, EigenpostureBase>,
    postures: &Bound<'_, PyAny>,
    bounds: &str,
) -> Result<Projection, Error> {
    let bounds = match bounds {
        "simplex" => WeightBounds::Simplex,
        "none" => WeightBounds::None,
        _ => return Err(Error::input(format!("`bounds` must be 'simplex' or 'none', found '{bounds}'"))),
    };
    let (base, postures) = (base.get().base.clone(), matrix("postures", postures)?);
    let found = leave_on_signal(py, move |_| analysis::project(&base, &postures, bounds))?;
    Ok(Projection { weights: found.weights, distances: found.distances })
}
