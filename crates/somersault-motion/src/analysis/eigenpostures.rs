//! Eigenpostures of motions.
//!
//! [`common`] stacks the frames of all motions and finds one basis for them; weights of different motions can then be
//! compared. [`per_motion`] is the variant of the thesis (4.1.1), a basis for each motion. **Bases of single motions
//! have signs and an order of their own**: what is the first eigenweight of one may be minus the second of another, so
//! that weights must not be compared across motions. It is here to reproduce what was done.

use super::{AnalysisError, Pca};
use nalgebra::DMatrix;
use somersault_core::argument::{ArgumentError, expect_length};

/// One basis for all `motions`, each with a frame in every row.
pub fn common(motions: &[DMatrix<f64>], n_eigenpostures: usize) -> Result<Pca, AnalysisError> {
    let Some(first) = motions.first() else {
        return Err(ArgumentError::TooFew { argument: "motions", least: 1, found: 0 }.into());
    };
    let rows = motions.iter().map(DMatrix::nrows).sum();
    let mut stacked = DMatrix::zeros(rows, first.ncols());
    let mut at = 0;
    for motion in motions {
        expect_length("columns of motions", motion.ncols(), first.ncols())?;
        stacked.rows_mut(at, motion.nrows()).copy_from(motion);
        at += motion.nrows();
    }
    of(&stacked, n_eigenpostures)
}

fn of(postures: &DMatrix<f64>, n_eigenpostures: usize) -> Result<Pca, AnalysisError> {
    Pca::fit(postures, n_eigenpostures).map_err(|error| match error {
        AnalysisError::Components { found, most, samples, features, .. } => {
            AnalysisError::Components { argument: "n_eigenpostures", found, most, samples, features }
        }
        error => error,
    })
}

/// A basis for each motion: the thesis' variant.
pub fn per_motion(motions: &[DMatrix<f64>], n_eigenpostures: usize) -> Result<Vec<Pca>, AnalysisError> {
    motions.iter().map(|motion| of(motion, n_eigenpostures)).collect()
}
