//! Transition matrices, and chains of them.

use super::dimension::{DIMENSIONS, by_rows, expect_square, for_dimension, matrix, matrix_array, vector};
use super::error::input;
use super::spectrum::Spectrum;
use crate::convert::integer;
use crate::error::Error;
use numpy::PyArray1;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use somersault::ftla::flow::{self, Work};
use somersault::ftla::spectrum;

/// The end of a motion with its transition matrix Φ = ∂p(t + T)/∂p(t).
#[pyclass(frozen, from_py_object, module = "somersault.ftla")]
#[derive(Clone)]
pub(crate) struct Transition {
    /// float: T, s, negative backward in time.
    #[pyo3(get)]
    duration: f64,
    end: Vec<f64>,
    /// Column by column.
    matrix: Vec<f64>,
    /// float: The largest |φᵢᵀJφⱼ − Jᵢⱼ| / max(1, ‖φᵢ‖‖φⱼ‖) over columns φ of Φ: zero where Φ is symplectic.
    #[pyo3(get)]
    symplecticity_defect: f64,
}

impl Transition {
    pub(crate) fn of<const N: usize>(transition: &flow::Transition<N>) -> Self {
        Self {
            duration: transition.duration,
            end: transition.end.as_slice().to_vec(),
            matrix: transition.matrix.as_slice().to_vec(),
            symplecticity_defect: transition.symplecticity_defect(),
        }
    }

    /// p(t + T).
    pub(crate) fn end_values(&self) -> &[f64] {
        &self.end
    }

    /// Φ, row by row.
    pub(crate) fn matrix_by_rows(&self) -> Vec<f64> {
        by_rows(&self.matrix, self.end.len())
    }

    pub(crate) fn typed<const N: usize>(&self) -> flow::Transition<N> {
        flow::Transition { duration: self.duration, end: vector(&self.end), matrix: matrix(&self.matrix) }
    }
}

#[pymethods]
impl Transition {
    /// ndarray, shape (dimension,): p(t + T).
    #[getter]
    fn end<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        PyArray1::from_slice(py, &self.end).into_any()
    }

    /// ndarray, shape (dimension, dimension): Φ.
    #[getter]
    fn matrix<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        matrix_array(py, &self.matrix, self.end.len())
    }

    fn __repr__(&self) -> String {
        let Self { duration, symplecticity_defect, .. } = self;
        format!("<Transition: over {duration} s, symplectic to {symplecticity_defect:.1e}>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let columns = PyArray1::from_slice(py, &own.matrix);
        let arguments = (own.duration, own.end(py), columns, own.symplecticity_defect);
        Ok((slf.get_type().getattr("_restore")?, arguments.into_pyobject(slf.py())?))
    }

    /// A pickled transition.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        duration: f64,
        end: Vec<f64>,
        matrix: Vec<f64>,
        symplecticity_defect: f64,
    ) -> Result<Self, Error> {
        expect_square("matrix", &matrix, end.len())?;
        Ok(Self { duration, end, matrix, symplecticity_defect })
    }
}

/// Factors of a transition matrix in the order of time, Φ = Φ_K ⋯ Φ₁.
///
/// One matrix does not hold singular values that span more than sixteen digits; its factors do.
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct Chain {
    pub(crate) links: Vec<Transition>,
    pub(crate) dimension: usize,
    /// Number of factors up to each of the times.
    marks: Vec<usize>,
    times: Vec<f64>,
    work: Work,
}

impl Chain {
    pub(crate) fn of<const N: usize>(chain: &flow::Chain<N>) -> Self {
        Self {
            links: chain.links().iter().map(Transition::of).collect(),
            dimension: N,
            marks: (0..chain.times().len()).map(|mark| chain.until(mark).len()).collect(),
            times: chain.times().to_vec(),
            work: chain.work,
        }
    }

    fn spectrum_of(&self, count: usize) -> Result<Spectrum, Error> {
        fn of<const N: usize>(links: &[Transition]) -> Result<Spectrum, Error> {
            let typed: Vec<_> = links.iter().map(Transition::typed::<N>).collect();
            Ok(Spectrum::of(&spectrum::Spectrum::of_factors(&typed)))
        }
        for_dimension!(self.dimension, of(&self.links[..count]))
    }
}

#[pymethods]
impl Chain {
    /// ndarray, shape (m,): The times asked for, since the start, s; negative backward.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        PyArray1::from_slice(py, &self.times).into_any()
    }

    /// list of int: Number of factors up to each of the times.
    #[getter]
    fn marks(&self) -> Vec<usize> {
        self.marks.clone()
    }

    /// int: Evaluations of the field.
    #[getter]
    fn n_evaluations(&self) -> usize {
        self.work.evaluations
    }

    /// The spectrum of the product up to one of the times.
    ///
    /// Parameters
    /// ----------
    /// mark : int, optional
    ///     Number of the time; the last unless given.
    ///
    /// Returns
    /// -------
    /// Spectrum
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If there is no such time.
    #[pyo3(signature = (mark=-1))]
    fn spectrum(&self, #[pyo3(from_py_with = integer)] mark: i64) -> Result<Spectrum, Error> {
        let known = self.marks.len();
        let number = index(mark as isize, known).map_err(|_| {
            super::error::input(format!("`mark` must be from -{known} to {}, found {mark}", known as i64 - 1))
        })?;
        self.spectrum_of(self.marks[number])
    }

    fn __len__(&self) -> usize {
        self.links.len()
    }

    fn __getitem__(&self, number: isize) -> Result<Transition, Error> {
        Ok(self.links[index(number, self.links.len())?].clone())
    }

    fn __repr__(&self) -> String {
        match self.times.last() {
            Some(last) => format!("<Chain: {} factors, to {last} s>", self.links.len()),
            None => "<Chain: empty>".to_owned(),
        }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let own = slf.get();
        let Work { evaluations, steps, rejected, switches } = own.work;
        let work = (evaluations, steps, rejected, switches);
        let arguments = (own.links.clone(), own.dimension, own.marks(), own.times(slf.py()), work);
        Ok((slf.get_type().getattr("_restore")?, arguments.into_pyobject(slf.py())?))
    }

    /// A pickled chain.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        links: Vec<Transition>,
        dimension: usize,
        marks: Vec<usize>,
        times: Vec<f64>,
        work: (usize, usize, usize, usize),
    ) -> Result<Self, Error> {
        let fits = links.iter().all(|link| link.end.len() == dimension)
            && marks.len() == times.len()
            && marks.iter().all(|&mark| mark <= links.len());
        if !fits || !DIMENSIONS.contains(&dimension) {
            return Err(input("`links`, `dimension`, `marks` and `times` of a chain must fit".to_owned()));
        }
        let (evaluations, steps, rejected, switches) = work;
        Ok(Self { links, dimension, marks, times, work: Work { evaluations, steps, rejected, switches } })
    }
}

/// The place that an index of Python means.
fn index(number: isize, length: usize) -> Result<usize, Error> {
    let place = if number < 0 { number + length as isize } else { number };
    match usize::try_from(place) {
        Ok(place) if place < length => Ok(place),
        Ok(_) | Err(_) => Err(PyIndexError::new_err(format!("index {number} of {length} entries")).into()),
    }
}
