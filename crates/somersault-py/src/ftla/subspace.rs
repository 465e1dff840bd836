//! Subspaces, the splitting they form, and the costates to hold.

use super::argument::triple;
use super::dimension::{DIMENSIONS, for_dimension, vector};
use super::error::input;
use super::spectrum::Spectrum;
use crate::convert::{a_type, array};
use crate::error::Error;
use crate::rows::Rows;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use somersault::ftla::placement;
use somersault::ftla::spectrum::{self, SplittingDims};

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
    dimension: usize,
    /// Orthonormal rows.
    basis: Vec<f64>,
}

impl Subspace {
    fn of<const N: usize>(subspace: &spectrum::Subspace<N>) -> Self {
        let basis = subspace.basis().flat_map(|v| v.as_slice().to_vec()).collect();
        Self { dimension: N, basis }
    }

    pub(crate) fn typed<const N: usize>(&self) -> spectrum::Subspace<N> {
        let vectors: Vec<_> = self.basis.chunks_exact(N).map(vector).collect();
        spectrum::Subspace::spanned_by(&vectors)
    }

    fn beside(&self, other: &Self) -> Result<(), Error> {
        if self.dimension == other.dimension {
            return Ok(());
        }
        Err(input(format!("`other` must lie in {} dimensions, found {}", self.dimension, other.dimension)))
    }

    fn vector(&self, v: &Bound<'_, PyAny>) -> Result<Vec<f64>, Error> {
        let rows = Rows::extract("v", &[self.dimension], v)?;
        if rows.is_many() {
            return Err(input("`v` must be one vector, found many".to_owned()));
        }
        Ok(rows.all()?.to_vec())
    }
}

#[pymethods]
impl Subspace {
    #[new]
    fn new(vectors: &Bound<'_, PyAny>) -> Result<Self, Error> {
        let shape = vectors.py().import("numpy")?.call_method1("shape", (vectors,));
        let shape: Vec<usize> = shape.and_then(|shape| shape.extract()).map_err(|_| {
            input(format!("`vectors` must be of shape (m, dimension), found {}", a_type(vectors)))
        })?;
        let &[_, n] = shape.as_slice() else {
            return Err(input(format!("`vectors` must be of shape (m, dimension), found {shape:?}")));
        };
        if !DIMENSIONS.contains(&n) {
            return Err(input(format!("`vectors` must be of a dimension of {DIMENSIONS:?}, found {n}")));
        }
        let rows = Rows::extract("vectors", &[n], vectors)?;
        fn spanned<const N: usize>(all: &[f64]) -> Result<Subspace, Error> {
            let vectors: Vec<_> = all.chunks_exact(N).map(vector::<N>).collect();
            Ok(Subspace::of(&spectrum::Subspace::spanned_by(&vectors)))
        }
        for_dimension!(n, spanned(rows.all()?))
    }

    /// int: Its dimension.
    #[getter]
    fn dim(&self) -> usize {
        self.basis.len() / self.dimension
    }

    /// ndarray, shape (dim, dimension): Orthonormal vectors that span it, in rows.
    #[getter]
    fn basis<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(array(py, self.basis.clone(), &[self.dim(), self.dimension])?.into_any())
    }

    /// The orthogonal complement.
    ///
    /// Returns
    /// -------
    /// Subspace
    fn complement(&self) -> Result<Self, Error> {
        fn complement<const N: usize>(subspace: &Subspace) -> Result<Subspace, Error> {
            Ok(Subspace::of(&subspace.typed::<N>().complement()))
        }
        for_dimension!(self.dimension, complement(self))
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
    fn intersection(&self, other: &Self) -> Result<Self, Error> {
        self.beside(other)?;
        fn intersection<const N: usize>(a: &Subspace, b: &Subspace) -> Result<Subspace, Error> {
            Ok(Subspace::of(&a.typed::<N>().intersection(&b.typed())))
        }
        for_dimension!(self.dimension, intersection(self, other))
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
    fn angle_to(&self, v: &Bound<'_, PyAny>) -> Result<f64, Error> {
        let v = self.vector(v)?;
        fn angle<const N: usize>(subspace: &Subspace, v: &[f64]) -> Result<f64, Error> {
            Ok(subspace.typed::<N>().angle_to(&vector(v)))
        }
        for_dimension!(self.dimension, angle(self, &v))
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
    fn angles<'py>(&self, py: Python<'py>, other: &Self) -> Result<Bound<'py, PyAny>, Error> {
        self.beside(other)?;
        fn angles<const N: usize>(a: &Subspace, b: &Subspace) -> Result<Vec<f64>, Error> {
            Ok(a.typed::<N>().angles(&b.typed()))
        }
        let found = for_dimension!(self.dimension, angles(self, other))?;
        Ok(PyArray1::from_vec(py, found).into_any())
    }

    fn __repr__(&self) -> String {
        format!("<Subspace: {} of {} dimensions>", self.dim(), self.dimension)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let own = slf.get();
        let arguments = (own.dimension, PyArray1::from_slice(slf.py(), &own.basis));
        Ok((slf.get_type().getattr("_restore")?, arguments.into_pyobject(slf.py())?))
    }

    /// A pickled subspace.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, dimension: usize, basis: Vec<f64>) -> Result<Self, Error> {
        let whole = DIMENSIONS.contains(&dimension) && basis.len().is_multiple_of(dimension);
        if !whole || basis.len() > dimension * dimension {
            let found = basis.len();
            return Err(input(format!(
                "`basis` must be vectors of {dimension} entries, found {found} numbers"
            )));
        }
        Ok(Self { dimension, basis })
    }
}

/// (n^s, n^c, n^u) as they come from Python.
pub(crate) fn dims_of((stable, center, unstable): (usize, usize, usize)) -> SplittingDims {
    SplittingDims { stable, center, unstable }
}

/// The subspaces at a point from which motions were followed both ways (thesis (9.5)–(9.9)).
///
/// Parameters
/// ----------
/// forward, backward : Spectrum
///     At the same point.
/// dims : tuple of int
///     (n^s, n^c, n^u).
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct Splitting {
    /// tuple of int: (n^s, n^c, n^u).
    #[pyo3(get)]
    dims: (usize, usize, usize),
    parts: [Subspace; 5],
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
            return Err(input("`forward` and `backward` must be of one dimension".to_owned()));
        }
        fn parts<const N: usize>(
            forward: &Spectrum,
            backward: &Spectrum,
            dims: (usize, usize, usize),
        ) -> Result<[Subspace; 5], Error> {
            let splitting =
                spectrum::Splitting::<N>::try_new(dims_of(dims), forward.typed(), backward.typed())?;
            Ok([
                Subspace::of(&splitting.stable()),
                Subspace::of(&splitting.center_stable()),
                Subspace::of(&splitting.center()),
                Subspace::of(&splitting.center_unstable()),
                Subspace::of(&splitting.unstable()),
            ])
        }
        let parts = for_dimension!(forward.dimension(), parts(forward, backward, dims))?;
        Ok(Self { dims, parts })
    }

    /// Subspace: E^s (9.5).
    #[getter]
    fn stable(&self) -> Subspace {
        self.parts[0].clone()
    }

    /// Subspace: E^cs (9.6).
    #[getter]
    fn center_stable(&self) -> Subspace {
        self.parts[1].clone()
    }

    /// Subspace: E^c (9.7).
    #[getter]
    fn center(&self) -> Subspace {
        self.parts[2].clone()
    }

    /// Subspace: E^cu (9.8).
    #[getter]
    fn center_unstable(&self) -> Subspace {
        self.parts[3].clone()
    }

    /// Subspace: E^u (9.9).
    #[getter]
    fn unstable(&self) -> Subspace {
        self.parts[4].clone()
    }

    fn __repr__(&self) -> String {
        let (stable, center, unstable) = self.dims;
        format!("<Splitting: {stable} stable, {center} centre, {unstable} unstable>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let own = slf.get();
        let arguments = (own.dims, own.parts.to_vec());
        Ok((slf.get_type().getattr("_restore")?, arguments.into_pyobject(slf.py())?))
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
#[pyfunction]
pub(crate) fn slow_subspace(
    spectrum: &Spectrum,
    #[pyo3(from_py_with = triple::dims)] dims: (usize, usize, usize),
) -> Result<Subspace, Error> {
    fn slow<const N: usize>(spectrum: &Spectrum, dims: SplittingDims) -> Result<Subspace, Error> {
        Ok(Subspace::of(&somersault::ftla::spectrum::slow_subspace(
            &spectrum.typed::<N>(),
            dims.check::<N>()?,
        )))
    }
    for_dimension!(spectrum.dimension(), slow(spectrum, dims_of(dims)))
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
#[pyfunction]
pub(crate) fn rank_held_costates(slow: &Subspace) -> Result<Vec<(Vec<usize>, f64)>, Error> {
    fn rank<const N: usize>(slow: &Subspace) -> Result<Vec<(Vec<usize>, f64)>, Error> {
        Ok(placement::rank_held_costates(&slow.typed::<N>()))
    }
    for_dimension!(slow.dimension, rank(slow))
}
