//! Arrays of two axes ↔ matrices.

use crate::core::convert::{a_type, array, contiguous, shape_text};
use crate::core::error::Error;
use numpy::PyUntypedArray;
use numpy::prelude::*;
use pyo3::exceptions::PyTypeError;
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
    let motions = values.try_iter().map_err(|_| {
        let found = a_type(values);
        Error::input(format!("`{argument}` must be a sequence of arrays of shape (n, m), found {found}"))
    })?;
    motions.enumerate().map(one).collect()
}

/// An array with the rows and columns of a matrix.
pub(super) fn matrix_array<'py>(py: Python<'py>, m: &DMatrix<f64>) -> PyResult<Bound<'py, PyAny>> {
    Ok(array(py, m.transpose().as_slice().to_vec(), &[m.nrows(), m.ncols()])?.into_any())
}

/// Numbers in one axis.
pub(super) fn numbers_array<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyAny> {
    numpy::PyArray1::from_slice(py, values).into_any()
}

/// The most frames, or motions, that memory is certainly there for.
const MOST: usize = 1_000_000;

/// A number of frames, motions or the like.
pub(super) fn count(argument: &str, n: i128) -> Result<usize, Error> {
    match usize::try_from(n) {
        Ok(n) if n <= MOST => Ok(n),
        _ => Err(Error::input(format!("`{argument}` must be between 0 and {MOST}, found {n}"))),
    }
}

/// Fails unless a part of what was pickled is as long as the others.
pub(super) fn same_length(argument: &str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected {
        Ok(())
    } else {
        Err(Error::input(format!("`{argument}` must have {expected} entries, found {found}")))
    }
}

/// A number that a generator begins with.
pub(super) fn seed(n: i128) -> Result<u64, Error> {
    let most = u64::MAX;
    u64::try_from(n).map_err(|_| Error::input(format!("`seed` must be between 0 and {most}, found {n}")))
}

/// `pathlib.Path` of an argument.
pub(super) fn path<'py>(argument: &str, value: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
    value.py().import("pathlib")?.call_method1("Path", (value,)).map_err(|error| {
        let is_type_error = error.is_instance_of::<PyTypeError>(value.py());
        let message = format!("`{argument}` must be a path, found {}", a_type(value));
        if is_type_error { PyTypeError::new_err(message).into() } else { error.into() }
    })
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
