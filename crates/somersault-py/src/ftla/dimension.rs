//! How many numbers a point and its subspaces may have, and arrays of vectors and matrices.

use crate::core::convert::array;
use crate::core::error::Error;
use pyo3::prelude::*;
use somersault::ftla::nalgebra::{DMatrix, DVector};
use somersault::ftla::spectrum::SplittingDims;

/// States and costates together. More are a slip, and no memory is there for it: a run takes some twenty of their squares.
pub(crate) const MOST: usize = 256;

/// A number of entries that there is memory for.
pub(crate) fn expect_dimension(argument: &str, found: usize) -> Result<usize, Error> {
    if (1..=MOST).contains(&found) {
        Ok(found)
    } else {
        Err(Error::input(format!("`{argument}` must be from 1 to {MOST}, found {found}")))
    }
}

/// Pickled numbers must be those of a square matrix.
pub(crate) fn expect_square(argument: &str, values: &[f64], n: usize) -> Result<(), Error> {
    expect_dimension("dimension", n)?;
    if values.len() != n * n {
        return Err(Error::input(format!(
            "`{argument}` must have {} entries, found {}",
            n * n,
            values.len()
        )));
    }
    Ok(())
}

/// (n^s, n^c, n^u) as they come from Python.
pub(crate) fn dims_of((stable, center, unstable): (usize, usize, usize)) -> SplittingDims {
    SplittingDims { stable, center, unstable }
}

/// Numbers as a vector.
pub(crate) fn vector(values: &[f64]) -> DVector<f64> {
    DVector::from_column_slice(values)
}

/// A square matrix as an array.
pub(crate) fn matrix_array<'py>(py: Python<'py>, matrix: &DMatrix<f64>) -> PyResult<Bound<'py, PyAny>> {
    Ok(array(py, by_rows(matrix), &[matrix.nrows(), matrix.ncols()])?.into_any())
}

/// The entries of a matrix, row by row.
pub(crate) fn by_rows(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// Vectors of equal length as one array.
pub(crate) fn rows_array<'py>(
    py: Python<'py>,
    rows: &[DVector<f64>],
    n: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let numbers = rows.iter().flat_map(|row| row.iter().copied()).collect();
    Ok(array(py, numbers, &[rows.len(), n])?.into_any())
}
