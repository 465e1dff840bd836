//! Cholesky factorisation of dense symmetric matrices: A = L Lᵀ with L lower triangular, a block of columns at a time, so that nearly all
//! of it is products of matrices.
//!
//! Cost: n³/6 multiplications for the factor, n² for each right-hand side, n³/3 for the inverse.
//!
//! Source: G. H. Golub and C. F. Van Loan, *Matrix Computations*, Johns Hopkins 2013, section 4.2.

use nalgebra::{DMatrix, DMatrixViewMut};
use std::ops::Range;

/// Columns that are factored one by one before the others take part in a product.
const BLOCK: usize = 16;

/// The factor of a positive definite matrix.
#[derive(Debug, Clone)]
pub(crate) struct Cholesky {
    /// L; what is above its diagonal is not read.
    lower: DMatrix<f64>,
}

/// The blocks of n rows, in order.
pub(crate) fn blocks(n: usize) -> impl DoubleEndedIterator<Item = Range<usize>> {
    (0..n.div_ceil(BLOCK)).map(move |k| k * BLOCK..((k + 1) * BLOCK).min(n))
}

/// y ← y + a x.
fn add_multiple(y: &mut [f64], a: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
}

/// Adds a · B Bᵀ to the lower half of a matrix, `factor` being B.
pub(crate) fn add_square(mut matrix: DMatrixViewMut<'_, f64>, a: f64, factor: &DMatrix<f64>) {
    let transposed = factor.transpose();
    for block in blocks(factor.nrows()) {
        let rows = block.start..factor.nrows();
        let mut target = matrix.view_range_mut(rows.clone(), block.clone());
        target.gemm(a, &factor.rows_range(rows), &transposed.columns_range(block), 1.0);
    }
}

/// X ← X B⁻ᵀ with the block B of L on its diagonal: long columns, one after the other.
fn divide_by_transpose(x: &mut DMatrix<f64>, lower: &DMatrix<f64>, block: &Range<usize>) {
    let rows = x.nrows();
    for k in 0..block.len() {
        let (before, from_k) = x.as_mut_slice().split_at_mut(k * rows);
        let column = &mut from_k[..rows];
        let row = block.start + k;
        for (j, done) in before.chunks_exact(rows.max(1)).enumerate() {
            add_multiple(column, -lower[(row, block.start + j)], done);
        }
        column.iter_mut().for_each(|x| *x /= lower[(row, row)]);
    }
}

/// X ← X B⁻¹ with the block B of L on its diagonal.
fn divide_by_block(x: &mut DMatrix<f64>, lower: &DMatrix<f64>, block: &Range<usize>) {
    let rows = x.nrows();
    for k in (0..block.len()).rev() {
        let (to_k, after) = x.as_mut_slice().split_at_mut((k + 1) * rows);
        let column = &mut to_k[k * rows..];
        let at = block.start + k;
        for (j, done) in after.chunks_exact(rows.max(1)).enumerate() {
            add_multiple(column, -lower[(at + 1 + j, at)], done);
        }
        column.iter_mut().for_each(|x| *x /= lower[(at, at)]);
    }
}

impl Cholesky {
    /// Factors the matrix with this lower half; what is above its diagonal is not read. None where it is not positive definite.
    pub(crate) fn of(mut matrix: DMatrix<f64>) -> Option<Self> {
        let n = matrix.nrows();
        for block in blocks(n) {
            for j in block.clone() {
                let (before, column) = matrix.as_mut_slice().split_at_mut(j * n);
                let column = &mut column[j..block.end];
                for k in block.start..j {
                    let factored = &before[k * n + j..k * n + block.end];
                    add_multiple(column, -factored[0], factored);
                }
                let pivot = column[0];
                // NaN is not positive either
                if !(pivot > 0.0 && pivot.is_finite()) {
                    return None;
                }
                let root = pivot.sqrt();
                column.iter_mut().for_each(|x| *x /= root);
            }
            let rest = block.end..n;
            let mut panel = matrix.view_range(rest.clone(), block.clone()).into_owned();
            divide_by_transpose(&mut panel, &matrix, &block);
            matrix.view_range_mut(rest.clone(), block).copy_from(&panel);
            add_square(matrix.view_range_mut(rest.clone(), rest), -1.0, &panel);
        }
        Some(Self { lower: matrix })
    }

    /// ln det A.
    pub(crate) fn log_determinant(&self) -> f64 {
        (0..self.lower.nrows()).map(|i| 2.0 * self.lower[(i, i)].ln()).sum()
    }

    /// x ← L⁻¹ x for a single right-hand side.
    pub(crate) fn solve_lower(&self, x: &mut [f64]) {
        for (k, column) in self.lower.column_iter().enumerate() {
            let column = &column.as_slice()[k..];
            x[k] /= column[0];
            let solved = x[k];
            add_multiple(&mut x[k + 1..], -solved, &column[1..]);
        }
    }

    /// x ← L⁻ᵀ x for a single right-hand side.
    pub(crate) fn solve_upper(&self, x: &mut [f64]) {
        for (k, column) in self.lower.column_iter().enumerate().rev() {
            let column = &column.as_slice()[k..];
            let sum: f64 = column[1..].iter().zip(&x[k + 1..]).map(|(a, x)| a * x).sum();
            x[k] = (x[k] - sum) / column[0];
        }
    }

    /// X ← L⁻¹ X of the first columns alone, as many as `width` gives for a block of rows; the others are zero there and above.
    pub(crate) fn solve_lower_of(&self, x: &mut DMatrix<f64>, width: &dyn Fn(&Range<usize>) -> usize) {
        let n = self.lower.nrows();
        for block in blocks(n) {
            let width = width(&block);
            let mut solved = x.view_range(block.clone(), ..width).transpose();
            divide_by_transpose(&mut solved, &self.lower, &block);
            let solved = solved.transpose();
            x.view_range_mut(block.clone(), ..width).copy_from(&solved);
            let below = self.lower.view_range(block.end..n, block.clone());
            x.view_range_mut(block.end..n, ..width).gemm(-1.0, &below, &solved, 1.0);
        }
    }

    /// X ← L⁻ᵀ X of the first columns alone, as many as `width` gives for a block of rows.
    fn solve_upper_of(&self, x: &mut DMatrix<f64>, width: &dyn Fn(&Range<usize>) -> usize) {
        let n = self.lower.nrows();
        for block in blocks(n).rev() {
            let width = width(&block);
            let below = self.lower.view_range(block.end..n, block.clone()).transpose();
            let solved = x.view_range(block.end..n, ..width).into_owned();
            let mut rows = x.view_range_mut(block.clone(), ..width);
            rows.gemm(-1.0, &below, &solved, 1.0);
            let mut columns = rows.transpose();
            divide_by_block(&mut columns, &self.lower, &block);
            rows.copy_from(&columns.transpose());
        }
    }

    /// X ← A⁻¹ X.
    pub(crate) fn solve_of(&self, x: &mut DMatrix<f64>) {
        let width = x.ncols();
        self.solve_lower_of(x, &|_| width);
        self.solve_upper_of(x, &|_| width);
    }

    /// x ← A⁻¹ x for a single right-hand side.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        self.solve_lower(x);
        self.solve_upper(x);
    }

    /// A⁻¹. L⁻¹ is lower triangular, and of its product with L⁻ᵀ the lower half is the whole.
    pub(crate) fn inverse(&self) -> DMatrix<f64> {
        let n = self.lower.nrows();
        let mut inverse = DMatrix::identity(n, n);
        self.solve_lower_of(&mut inverse, &|rows| rows.end);
        self.solve_upper_of(&mut inverse, &|rows| rows.end);
        inverse.fill_upper_triangle_with_lower_triangle();
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// B Bᵀ + 1 for a random B.
    fn positive_definite(n: usize, rng: &mut ChaCha8Rng) -> DMatrix<f64> {
        let factor = DMatrix::from_fn(n, n, |_, _| rng.random_range(-1.0..1.0));
        &factor * factor.transpose() + DMatrix::identity(n, n)
    }

    /// Sizes below a block, of whole blocks, and beyond; what is above the diagonal is not read. nalgebra's factors are the reference.
    #[test]
    fn factors_solutions_and_inverses_are_those_of_nalgebra() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        for n in [1, 2, 15, 16, 17, 64, 100] {
            let matrix = positive_definite(n, &mut rng);
            let reference = matrix.clone().cholesky().unwrap();
            let mut lower_half = matrix.clone();
            (0..n).for_each(|j| (0..j).for_each(|i| lower_half[(i, j)] = f64::NAN));
            let factor = Cholesky::of(lower_half).unwrap();
            let size = matrix.amax();
            let found = factor.lower.lower_triangle();
            assert!((&found - reference.l()).amax() < 1e-12 * size, "{n}");
            let log_determinant: f64 = reference.l().diagonal().iter().map(|x| 2.0 * x.ln()).sum();
            assert!((factor.log_determinant() - log_determinant).abs() < 1e-10);
            let right = DMatrix::from_fn(n, 3, |_, _| rng.random_range(-1.0..1.0));
            let expected = reference.solve(&right);
            let mut solved = right.clone();
            factor.solve_of(&mut solved);
            assert!((&solved - &expected).amax() < 1e-12, "{n}");
            let mut column = right.column(0).as_slice().to_vec();
            factor.solve(&mut column);
            assert!((DMatrix::from_column_slice(n, 1, &column) - expected.column(0)).amax() < 1e-12);
            let mut half_way = right.clone();
            factor.solve_lower_of(&mut half_way, &|_| 3);
            assert!((&found * half_way - &right).amax() < 1e-12 * size, "{n}");
            assert!((factor.inverse() - reference.inverse()).amax() < 1e-12, "{n}");
        }
    }

    #[test]
    fn matrices_that_are_not_positive_definite_have_no_factor() {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        for n in [1, 31, 40, 70] {
            for k in [0, n / 2, n - 1] {
                for entry in [0.0, -1.0, f64::NAN, f64::INFINITY] {
                    let mut matrix = positive_definite(n, &mut rng);
                    matrix[(k, k)] = entry;
                    assert!(Cholesky::of(matrix).is_none(), "{n} {k} {entry}");
                }
            }
        }
    }

    #[test]
    fn squares_are_added_to_the_lower_half() {
        let mut rng = ChaCha8Rng::seed_from_u64(13);
        for (n, m) in [(3, 70), (50, 6), (65, 33)] {
            let factor = DMatrix::from_fn(n, m, |_, _| rng.random_range(-1.0..1.0));
            let start = DMatrix::from_fn(n, n, |_, _| rng.random_range(-1.0..1.0));
            let mut sum = start.clone();
            add_square(sum.as_view_mut(), -0.5, &factor);
            let expected = start - &factor * factor.transpose() * 0.5;
            assert!((sum - expected).lower_triangle().amax() < 1e-13);
        }
    }
}
