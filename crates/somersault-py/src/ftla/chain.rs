//! Transition matrices, and chains of them.

use super::dimension::{by_rows, expect_square, matrix_array, vector};
use super::spectrum::Spectrum;
use crate::core::convert::integer;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use numpy::PyArray1;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ftla::flow::{self, Work};
use somersault::ftla::nalgebra::DMatrix;
use somersault::ftla::spectrum;

/// The end of a motion with its transition matrix Φ = ∂p(t + T)/∂p(t).
#[pyclass(frozen, from_py_object, module = "somersault.ftla")]
#[derive(Clone)]
pub(crate) struct Transition {
    pub(crate) transition: flow::Transition,
    /// float: The largest |φᵢᵀJφⱼ − Jᵢⱼ| / max(1, ‖φᵢ‖‖φⱼ‖) over columns φ of Φ: zero where Φ is symplectic.
    #[pyo3(get)]
    symplecticity_defect: f64,
}

impl Transition {
    pub(crate) fn of(transition: flow::Transition) -> Self {
        let symplecticity_defect = transition.symplecticity_defect();
        Self { transition, symplecticity_defect }
    }

    /// Φ, row by row.
    pub(crate) fn matrix_by_rows(&self) -> Vec<f64> {
        by_rows(&self.transition.matrix)
    }
}

value! {
    impl Transition {
        /// float: T, s, negative backward in time.
        duration: f64 = |own| own.transition.duration;
        /// ndarray, shape (dimension,): p(t + T).
        end: Bound<'py, PyAny> = |own, py| PyArray1::from_slice(py, own.transition.end.as_slice()).into_any();
        /// ndarray, shape (dimension, dimension): Φ.
        matrix: PyResult<Bound<'py, PyAny>> = |own, py| matrix_array(py, &own.transition.matrix);
    }
}

#[pymethods]
impl Transition {
    fn __repr__(&self) -> String {
        let (duration, symplecticity_defect) = (self.duration(), self.symplecticity_defect);
        format!("<Transition: over {duration} s, symplectic to {symplecticity_defect:.1e}>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let columns = PyArray1::from_slice(py, own.transition.matrix.as_slice());
        by_restore(slf, (own.duration(), own.end(py), columns, own.symplecticity_defect))
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
        let matrix = DMatrix::from_column_slice(end.len(), end.len(), &matrix);
        let transition = flow::Transition { duration, end: vector(&end), matrix };
        Ok(Self { transition, symplecticity_defect })
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
    pub(crate) fn of(dimension: usize, chain: &flow::Chain) -> Self {
        Self {
            links: chain.links().iter().cloned().map(Transition::of).collect(),
            dimension,
            marks: (0..chain.times().len()).map(|mark| chain.until(mark).len()).collect(),
            times: chain.times().to_vec(),
            work: chain.work,
        }
    }

    fn spectrum_of(&self, count: usize) -> Spectrum {
        let links: Vec<_> = self.links[..count].iter().map(|link| link.transition.clone()).collect();
        Spectrum { spectrum: spectrum::Spectrum::of_factors(&links) }
    }
}

value! {
    impl Chain {
        /// ndarray, shape (m,): The times requested, since the start, s; negative backward.
        times: Bound<'py, PyAny> = |own, py| PyArray1::from_slice(py, &own.times).into_any();
        /// list of int: Number of factors up to each of the times.
        marks: Vec<usize> = |own| own.marks.clone();
        /// int: Evaluations of the field.
        n_evaluations: usize = |own| own.work.evaluations;
    }
}

#[pymethods]
impl Chain {
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> chain = flow.chain([1.0, 0.4], [5.0, 50.0])
    /// >>> chain.spectrum().exponents.round(4)
    /// array([-1.4142,  1.4142])
    #[pyo3(signature = (mark=-1))]
    fn spectrum(&self, #[pyo3(from_py_with = integer)] mark: i64) -> Result<Spectrum, Error> {
        let known = self.marks.len();
        let number = index(mark as isize, known).map_err(|_| {
            Error::input(format!("`mark` must be from -{known} to {}, found {mark}", known as i64 - 1))
        })?;
        Ok(self.spectrum_of(self.marks[number]))
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

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        let Work { evaluations, steps, rejected, switches } = own.work;
        let work = (evaluations, steps, rejected, switches);
        by_restore(slf, (own.links.clone(), own.dimension, own.marks(), own.times(slf.py()), work))
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
        let fits = links.iter().all(|link| link.transition.end.len() == dimension)
            && marks.len() == times.len()
            && marks.iter().all(|&mark| mark <= links.len());
        if !fits {
            return Err(Error::input("`links`, `dimension`, `marks` and `times` of a chain must fit"));
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
