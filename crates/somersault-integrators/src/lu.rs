//! Factors of a square matrix in memory of their own, with pivots by columns: those of nalgebra allocate each time.

use nalgebra::{ComplexField, DMatrix};

/// P A = L U, in the place of A.
#[derive(Debug, Clone)]
pub(crate) struct Factors<T> {
    matrix: DMatrix<T>,
    /// The row that each row was exchanged with.
    pivots: Vec<usize>,
}

impl<T: ComplexField<RealField = f64> + Copy> Factors<T> {
    /// Room for n rows.
    pub(crate) fn new(n: usize) -> Self {
        Self { matrix: DMatrix::zeros(n, n), pivots: vec![0; n] }
    }

    /// Factors the matrix with these entries, and says whether it is regular.
    pub(crate) fn factor(&mut self, entry: impl Fn(usize, usize) -> T) -> bool {
        let Self { matrix, pivots } = self;
        let n = pivots.len();
        for (column, row) in (0..n).flat_map(|column| (0..n).map(move |row| (column, row))) {
            matrix[(row, column)] = entry(row, column);
        }
        for k in 0..n {
            let largest = (k..n).fold((k, 0.0), |(at, most), row| {
                let size = matrix[(row, k)].norm1();
                if size > most { (row, size) } else { (at, most) }
            });
            if largest.1 == 0.0 || !largest.1.is_finite() {
                return false;
            }
            pivots[k] = largest.0;
            matrix.swap_rows(k, largest.0);
            let pivot = matrix[(k, k)];
            for row in k + 1..n {
                matrix[(row, k)] /= pivot;
            }
            let (done, mut rest) = matrix.columns_range_pair_mut(k, k + 1..);
            for mut column in rest.column_iter_mut() {
                let factor = column[k];
                for row in k + 1..n {
                    column[row] -= done[row] * factor;
                }
            }
        }
        true
    }

    /// b ← A⁻¹ b.
    pub(crate) fn solve(&self, b: &mut [T]) {
        let Self { matrix, pivots } = self;
        let n = pivots.len();
        for (k, row) in pivots.iter().enumerate() {
            b.swap(k, *row);
        }
        for k in 0..n {
            for row in k + 1..n {
                let known = b[k];
                b[row] -= matrix[(row, k)] * known;
            }
        }
        for k in (0..n).rev() {
            b[k] /= matrix[(k, k)];
            for row in 0..k {
                let known = b[k];
                b[row] -= matrix[(row, k)] * known;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Complex, DVector};

    #[test]
    fn what_is_solved_satisfies_its_equations() {
        let n = 7;
        // Zeros on the diagonal, so that rows must be exchanged.
        let real = |i: usize, k: usize| if i == k { 0.0 } else { ((3 * i + 5 * k * k + 1) as f64).sin() };
        let complex = |i: usize, k: usize| Complex::new(real(i, k), real(k + 1, i));
        let right = DVector::from_fn(n, |i, _| (i as f64 + 0.5).cos());
        let mut factors = Factors::new(n);
        assert!(factors.factor(real));
        let mut x = right.clone();
        factors.solve(x.as_mut_slice());
        assert!((DMatrix::from_fn(n, n, real) * x - &right).amax() < 1e-13);
        let mut factors = Factors::new(n);
        assert!(factors.factor(complex));
        let right = right.map(|x| Complex::new(x, 1.0));
        let mut x = right.clone();
        factors.solve(x.as_mut_slice());
        assert!((DMatrix::from_fn(n, n, complex) * x - right).iter().all(|x| x.norm1() < 1e-13));
    }

    #[test]
    fn a_singular_matrix_and_one_without_numbers_are_refused() {
        assert!(!Factors::new(3).factor(|i, _| i as f64));
        assert!(!Factors::new(3).factor(|i, k| if i == k { f64::NAN } else { 0.0 }));
    }
}
