//! The dimensions that analyses are compiled for, and plain numbers ↔ those of fixed size.

use super::error::input;
use crate::convert::array;
use crate::error::Error;
use pyo3::prelude::*;
use somersault::ftla::nalgebra::{SMatrix, SVector};

/// Numbers of states and costates together.
pub(crate) const DIMENSIONS: [usize; 9] = [2, 4, 6, 8, 10, 12, 16, 20, 24];

/// Calls a function that is generic over the dimension with the one that is known at run time.
macro_rules! for_dimension {
    ($n:expr, $function:ident ( $($argument:expr),* $(,)? )) => {
        match $n {
            2 => $function::<2>($($argument),*),
            4 => $function::<4>($($argument),*),
            6 => $function::<6>($($argument),*),
            8 => $function::<8>($($argument),*),
            10 => $function::<10>($($argument),*),
            12 => $function::<12>($($argument),*),
            16 => $function::<16>($($argument),*),
            20 => $function::<20>($($argument),*),
            24 => $function::<24>($($argument),*),
            other => Err($crate::ftla::dimension::no_such("dimension", other)),
        }
    };
}
pub(crate) use for_dimension;

/// An argument asks for a dimension that there is none of.
pub(crate) fn no_such(argument: &str, found: usize) -> Error {
    input(format!("`{argument}` must be one of {DIMENSIONS:?}, found {found}"))
}

/// Pickled numbers must be those of a square matrix of one of the dimensions.
pub(crate) fn expect_square(argument: &str, values: &[f64], n: usize) -> Result<(), Error> {
    if !DIMENSIONS.contains(&n) {
        return Err(no_such("dimension", n));
    }
    if values.len() != n * n {
        return Err(input(format!("`{argument}` must have {} entries, found {}", n * n, values.len())));
    }
    Ok(())
}

/// A vector whose length callers have checked.
pub(crate) fn vector<const N: usize>(values: &[f64]) -> SVector<f64, N> {
    SVector::from_column_slice(values)
}

/// A matrix from its columns one after the other, whose number callers have checked.
pub(crate) fn matrix<const N: usize>(values: &[f64]) -> SMatrix<f64, N, N> {
    SMatrix::from_column_slice(values)
}

/// A square matrix as an array, from its columns one after the other.
pub(crate) fn matrix_array<'py>(py: Python<'py>, columns: &[f64], n: usize) -> PyResult<Bound<'py, PyAny>> {
    Ok(array(py, by_rows(columns, n), &[n, n])?.into_any())
}

/// The columns of a square matrix as rows.
pub(crate) fn by_rows(columns: &[f64], n: usize) -> Vec<f64> {
    (0..n * n).map(|k| columns[k % n * n + k / n]).collect()
}

/// Rows of equal length as one array.
pub(crate) fn rows_array<'py>(py: Python<'py>, rows: &[Vec<f64>], n: usize) -> PyResult<Bound<'py, PyAny>> {
    Ok(array(py, rows.concat(), &[rows.len(), n])?.into_any())
}
