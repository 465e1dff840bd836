//! Arrays of two axes ↔ matrices.

use crate::convert::{a_type, array, contiguous, shape_text};
use crate::error::Error;
use numpy::PyUntypedArray;
use numpy::prelude::*;
use pyo3::prelude::*;
use somersault::motion::nalgebra::DMatrix;

/// Real numbers with a sample or a frame in each row; finite or not.
pub(super) fn matrix(argument: &str, value: &Bound<'_, PyAny>) -> Result<DMatrix<f64>, Error> {
    let expected = "real numbers of shape (n, m)";
    let found = contiguous(argument, expected, value)?;
    let [rows, columns] = *found.shape() else {
        let shape = shape_text(found.shape());
        return Err(Error::input(format!("`{argument}` must be {expected}, found shape {shape}")));
    };
    Ok(DMatrix::from_row_slice(rows, columns, found.as_slice().map_err(PyErr::from)?))
}

/// A matrix for each motion.
pub(super) fn matrices(argument: &str, values: &Bound<'_, PyAny>) -> Result<Vec<DMatrix<f64>>, Error> {
    let one = |(k, value): (usize, PyResult<_>)| matrix(&format!("{argument}[{k}]"), &value?);
    values.try_iter()?.enumerate().map(one).collect()
}

/// An array with the rows and columns of a matrix.
pub(super) fn matrix_array<'py>(py: Python<'py>, m: &DMatrix<f64>) -> PyResult<Bound<'py, PyAny>> {
    Ok(array(py, m.transpose().as_slice().to_vec(), &[m.nrows(), m.ncols()])?.into_any())
}

/// Numbers in one axis.
pub(super) fn numbers_array<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyAny> {
    numpy::PyArray1::from_slice(py, values).into_any()
}

/// Truth values of the given shape.
pub(super) fn mask(argument: &str, shape: &[usize], value: &Bound<'_, PyAny>) -> Result<Vec<bool>, Error> {
    let expected = format!("truth values of shape {}", shape_text(shape));
    let wrong = |what: String| Error::input(format!("`{argument}` must be {expected}, found {what}"));
    let given = value.py().import("numpy")?.call_method1("asarray", (value,))?;
    let untyped = given.cast::<PyUntypedArray>().map_err(PyErr::from)?;
    if untyped.dtype().kind() != b'b' {
        return Err(wrong(format!("{} of dtype {}", a_type(value), untyped.dtype())));
    }
    if untyped.shape() != shape {
        return Err(wrong(format!("shape {}", shape_text(untyped.shape()))));
    }
    Ok(given.call_method0("ravel")?.extract::<Vec<bool>>()?)
}
