//! Subspaces, the splitting they form, and the costates to hold.

use super::argument::triple;
use super::dimension::{dims_of, expect_dimension, rows_array, vector};
use super::spectrum::Spectrum;
use crate::core::convert::a_type;
use crate::core::error::Error;
use crate::core::rows::Rows;
use crate::core::value::{Pickled, by_restore, value};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ftla::nalgebra::DVector;
use somersault::ftla::placement;
use somersault::ftla::spectrum::{self, slow_subspace as slow};

/// A linear subspace.
///
/// Parameters
/// ----------
/// vectors : array_like, shape (m, dimension)
///     Vectors that span it, in rows; those that depend on others to ten digits add nothing.
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> plane = ftla.Subspace([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
/// >>> plane.dim, round(plane.angle_to([1.0, 0.0, 1.0, 0.0]), 4)
/// (2, 0.7854)
#[pyclass(frozen, from_py_object, module = "somersault.ftla")]
#[derive(Clone)]
pub(crate) struct Subspace {
    subspace: spectrum::Subspace,
}

impl Subspace {
    fn dimension(&self) -> usize {
        self.subspace.dimension()
    }

    fn beside(&self, other: &Self) -> Result<(), Error> {
        let (expected, found) = (self.dimension(), other.dimension());
        if expected == found {
            return Ok(());
        }
        Err(Error::input(format!("`other` must lie in {expected} dimensions, found {found}")))
    }

    fn vector(&self, v: &Bound<'_, PyAny>) -> Result<DVector<f64>, Error> {
        let rows = Rows::extract("v", &[self.dimension()], v)?;
        if rows.is_many() {
            return Err(Error::input("`v` must be one vector, found many"));
        }
        Ok(vector(rows.all()?))
    }
}

value! {
    impl Subspace {
        /// int: Its dimension.
        dim: usize = |own| own.subspace.dim();
        /// ndarray, shape (dim, dimension): Orthonormal vectors that span it, in rows.
        basis: PyResult<Bound<'py, PyAny>> =
            |own, py| rows_array(py, &own.subspace.basis().collect::<Vec<_>>(), own.dimension());
    }
}

#[pymethods]
impl Subspace {
    #[new]
    fn new(vectors: &Bound<'_, PyAny>) -> Result<Self, Error> {
        let shape = vectors.py().import("numpy")?.call_method1("shape", (vectors,));
        let shape: Vec<usize> = shape.and_then(|shape| shape.extract()).map_err(|_| {
            Error::input(format!("`vectors` must be of shape (m, dimension), found {}", a_type(vectors)))
        })?;
        let &[_, n] = shape.as_slice() else {
            return Err(Error::input(format!("`vectors` must be of shape (m, dimension), found {shape:?}")));
        };
        expect_dimension("dimension", n)?;
        let rows = Rows::extract("vectors", &[n], vectors)?;
        let vectors: Vec<_> = rows.all()?.chunks_exact(n).map(vector).collect();
        Ok(Self { subspace: spectrum::Subspace::spanned_by(n, &vectors) })
    }

    /// The orthogonal complement.
    ///
    /// Returns
    /// -------
    /// Subspace
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> ftla.Subspace([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).complement().basis.round(6)
    /// array([[0., 0., 1.]])
    fn complement(&self) -> Self {
        Self { subspace: self.subspace.complement() }
    }

    /// What is common to both.
    ///
    /// Parameters
    /// ----------
    /// other : Subspace
    ///
    /// Returns
    /// -------
    /// Subspace
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> xy = ftla.Subspace([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    /// >>> yz = ftla.Subspace([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    /// >>> abs(xy.intersection(yz).basis).round(6)
    /// array([[0., 1., 0.]])
    fn intersection(&self, other: &Self) -> Result<Self, Error> {
        self.beside(other)?;
        Ok(Self { subspace: self.subspace.intersection(&other.subspace) })
    }

    /// The angle between a vector and the subspace: asin(‖Wᵀv‖/‖v‖), W a basis of the complement.
    ///
    /// Parameters
    /// ----------
    /// v : array_like, shape (dimension,)
    ///
    /// Returns
    /// -------
    /// float
    ///     rad, from 0 to π/2.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ftla
    /// >>> plane = ftla.Subspace([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    /// >>> round(float(np.degrees(plane.angle_to([1.0, 0.0, 1.0]))), 6)
    /// 45.0
    fn angle_to(&self, v: &Bound<'_, PyAny>) -> Result<f64, Error> {
        Ok(self.subspace.angle_to(&self.vector(v)?))
    }

    /// The principal angles with another subspace, ascending, as many as the smaller dimension.
    ///
    /// Parameters
    /// ----------
    /// other : Subspace
    ///
    /// Returns
    /// -------
    /// ndarray, shape (k,)
    ///     rad; small ones keep their digits.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> one, other = ftla.Subspace([[1.0, 0.0, 0.0]]), ftla.Subspace([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    /// >>> one.angles(other).round(4)
    /// array([0.7854])
    fn angles<'py>(&self, py: Python<'py>, other: &Self) -> Result<Bound<'py, PyAny>, Error> {
        self.beside(other)?;
        Ok(PyArray1::from_vec(py, self.subspace.angles(&other.subspace)).into_any())
    }

    fn __repr__(&self) -> String {
        format!("<Subspace: {} of {} dimensions>", self.dim(), self.dimension())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        let basis: Vec<f64> = own.subspace.basis().flat_map(|v| v.as_slice().to_vec()).collect();
        by_restore(slf, (own.dimension(), PyArray1::from_vec(slf.py(), basis)))
    }

    /// A pickled subspace.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, dimension: usize, basis: Vec<f64>) -> Result<Self, Error> {
        expect_dimension("dimension", dimension)?;
        let whole = basis.len().is_multiple_of(dimension);
        if !whole || basis.len() > dimension * dimension {
            let found = basis.len();
            return Err(Error::input(format!(
                "`basis` must be vectors of {dimension} entries, found {found} numbers"
            )));
        }
        let vectors: Vec<_> = basis.chunks_exact(dimension).map(vector).collect();
        Ok(Self { subspace: spectrum::Subspace::spanned_by(dimension, &vectors) })
    }
}

/// The subspaces at a point from which motions were followed both ways (thesis (9.5)–(9.9)).
///
/// Parameters
/// ----------
/// forward, backward : Spectrum
///     At the same point.
/// dims : tuple of int
///     (n^s, n^c, n^u).
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
/// >>> forward = flow.spectrum([1.0, 0.4], 8.0)
/// >>> backward = flow.spectrum([1.0, 0.4], 8.0, "backward")
/// >>> splitting = ftla.Splitting(forward, backward, (1, 0, 1))
/// >>> round(splitting.stable.angle_to([1.0, 2**0.5 - 1]), 6) + 0.0
/// 0.0
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct Splitting {
    /// tuple of int: (n^s, n^c, n^u).
    #[pyo3(get)]
    dims: (usize, usize, usize),
    parts: [Subspace; 5],
}

value! {
    impl Splitting {
        /// Subspace: E^s (9.5).
        stable: Subspace = |own| own.parts[0].clone();
        /// Subspace: E^cs (9.6).
        center_stable: Subspace = |own| own.parts[1].clone();
        /// Subspace: E^c (9.7).
        center: Subspace = |own| own.parts[2].clone();
        /// Subspace: E^cu (9.8).
        center_unstable: Subspace = |own| own.parts[3].clone();
        /// Subspace: E^u (9.9).
        unstable: Subspace = |own| own.parts[4].clone();
    }
}

#[pymethods]
impl Splitting {
    #[new]
    fn new(
        forward: &Spectrum,
        backward: &Spectrum,
        #[pyo3(from_py_with = triple::dims)] dims: (usize, usize, usize),
    ) -> Result<Self, Error> {
        if forward.dimension() != backward.dimension() {
            return Err(Error::input("`forward` and `backward` must be of one dimension"));
        }
        let (forward, backward) = (forward.spectrum.clone(), backward.spectrum.clone());
        let splitting = spectrum::Splitting::try_new(dims_of(dims), forward, backward)?;
        let parts = [
            splitting.stable(),
            splitting.center_stable(),
            splitting.center(),
            splitting.center_unstable(),
            splitting.unstable(),
        ];
        Ok(Self { dims, parts: parts.map(|subspace| Subspace { subspace }) })
    }

    fn __repr__(&self) -> String {
        let (stable, center, unstable) = self.dims;
        format!("<Splitting: {stable} stable, {center} centre, {unstable} unstable>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        by_restore(slf, (own.dims, own.parts.to_vec()))
    }

    /// A pickled splitting.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, dims: (usize, usize, usize), parts: [Subspace; 5]) -> Self {
        Self { dims, parts }
    }
}

/// The directions that do not expand fast: E^cs of a forward spectrum, E^cu of a backward one.
///
/// Parameters
/// ----------
/// spectrum : Spectrum
/// dims : tuple of int
///     (n^s, n^c, n^u).
///
/// Returns
/// -------
/// Subspace
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
/// >>> slow = ftla.slow_subspace(flow.spectrum([1.0, 0.4], 8.0), (1, 0, 1))
/// >>> slow, round(slow.angle_to([1.0, 2**0.5 - 1]), 6) + 0.0
/// (<Subspace: 1 of 2 dimensions>, 0.0)
#[pyfunction]
pub(crate) fn slow_subspace(
    spectrum: &Spectrum,
    #[pyo3(from_py_with = triple::dims)] dims: (usize, usize, usize),
) -> Result<Subspace, Error> {
    let dims = dims_of(dims).check(spectrum.dimension())?;
    Ok(Subspace { subspace: slow(&spectrum.spectrum, dims) })
}

/// Every choice of costates to hold while the others place a point, best first.
///
/// Each with the smallest singular value of the fast directions' components along the costates solved for: near zero where
/// these cannot move the field out of the fast directions (thesis (10.1)).
///
/// Parameters
/// ----------
/// slow : Subspace
///     E^cs at the start or E^cu at the end, as `slow_subspace` gives it.
///
/// Returns
/// -------
/// list of tuple
///     (numbers of the costates held, from 0; singular value).
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> slow = ftla.Subspace([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.1]])
/// >>> [(held, round(value, 3)) for held, value in ftla.rank_held_costates(slow)]
/// [([0], 0.995), ([1], 0.1)]
#[pyfunction]
pub(crate) fn rank_held_costates(slow: &Subspace) -> Result<Vec<(Vec<usize>, f64)>, Error> {
    Ok(placement::rank_held_costates(&slow.subspace)?)
}
