//! Singular values and right singular vectors of a square matrix by one-sided Jacobi rotations: columns are rotated in pairs, A ← A J, until
//! all are perpendicular; their lengths are the singular values then, and the product of the rotations holds the vectors.
//!
//! Cost: some eight sweeps of n²/2 rotations, each of 11 n multiplications. That of nalgebra takes a quarter of the time for n = 200, but is not
//! reliable where the rank is not full: for a triangle of 7 columns and rank 6, U S Vᵀ missed A by 1e-8
//! (the test `all_components_give_the_samples_back_on_either_shape` finds it).
//!
//! Source: J. Demmel and K. Veselić, *Jacobi's method is more accurate than QR*, SIAM J. Matrix Anal. Appl. 13 (1992) 1204.

use nalgebra::DMatrix;

/// Sweeps at most; about eight are needed.
const SWEEPS: usize = 40;
/// Length over that of the whole matrix below which a column is rounding.
const NEGLIGIBLE: f64 = 1e-20;

/// A decomposition A = U S Vᵀ.
pub(crate) struct SingularValues {
    /// The diagonal of S, descending.
    pub(crate) values: Vec<f64>,
    /// V.
    pub(crate) vectors: DMatrix<f64>,
    /// A V = U S.
    pub(crate) images: DMatrix<f64>,
}

impl SingularValues {
    /// Decomposes a matrix. None where a number is not finite or the sweeps do not end.
    pub(crate) fn of(mut matrix: DMatrix<f64>) -> Option<Self> {
        if matrix.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let n = matrix.ncols();
        let mut vectors = DMatrix::identity(n, n);
        let negligible = NEGLIGIBLE * matrix.norm();
        if !(0..SWEEPS).any(|_| !sweep(&mut matrix, &mut vectors, negligible)) {
            return None;
        }
        let lengths: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|i, j| lengths[*j].total_cmp(&lengths[*i]));
        Some(Self {
            values: order.iter().map(|i| lengths[*i]).collect(),
            vectors: vectors.select_columns(&order),
            images: matrix.select_columns(&order),
        })
    }
}

/// Rotates each pair of columns that are not perpendicular; whether there was one.
fn sweep(matrix: &mut DMatrix<f64>, vectors: &mut DMatrix<f64>, negligible: f64) -> bool {
    let n = matrix.ncols();
    // a cosine of the size of its rounding
    let perpendicular = 2.0 * f64::EPSILON * (matrix.nrows() as f64).sqrt();
    let mut was_rotated = false;
    for j in 1..n {
        for i in 0..j {
            let (of_i, of_j) = (matrix.column(i), matrix.column(j));
            let (a, b, product) = (of_i.norm(), of_j.norm(), of_i.dot(&of_j));
            if a.min(b) <= negligible || product.abs() <= perpendicular * a * b {
                continue;
            }
            was_rotated = true;
            let zeta = (b - a) * (b + a) / (2.0 * product);
            let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
            let cosine = tangent.hypot(1.0).recip();
            rotate(matrix, i, j, cosine, cosine * tangent);
            rotate(vectors, i, j, cosine, cosine * tangent);
        }
    }
    was_rotated
}

/// Columns i < j ← c xᵢ − s xⱼ, s xᵢ + c xⱼ.
fn rotate(matrix: &mut DMatrix<f64>, i: usize, j: usize, c: f64, s: f64) {
    let n = matrix.nrows();
    let (before, from_j) = matrix.as_mut_slice().split_at_mut(j * n);
    for (x, y) in before[i * n..(i + 1) * n].iter_mut().zip(&mut from_j[..n]) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// U diag(s) Vᵀ with known factors, some of rank that is not full.
    #[test]
    fn values_and_vectors_are_those_the_matrix_is_made_of() {
        let mut rng = ChaCha8Rng::seed_from_u64(21);
        for n in [1_usize, 2, 5, 30, 80] {
            for rank in [n, n.div_ceil(2)] {
                let mut orthogonal = || DMatrix::from_fn(n, n, |_, _| rng.random_range(-1.0..1.0)).qr().q();
                let (u, v) = (orthogonal(), orthogonal());
                let values =
                    DVector::from_fn(
                        n,
                        |i, _| {
                            if i < rank { 10f64.powf(-6.0 * i as f64 / n as f64) } else { 0.0 }
                        },
                    );
                let matrix = u * DMatrix::from_diagonal(&values) * v.transpose();
                let found = SingularValues::of(matrix.clone()).unwrap();
                for (found, value) in found.values.iter().zip(values.iter()) {
                    assert!((found - value).abs() < 1e-14, "{n} {rank}: {found} {value}");
                }
                let vectors = &found.vectors;
                assert!((vectors.tr_mul(vectors) - DMatrix::identity(n, n)).amax() < 1e-13);
                assert!((matrix * vectors - &found.images).amax() < 1e-14, "{n} {rank}");
                let gram = found.images.tr_mul(&found.images);
                let squares = DMatrix::from_diagonal(&values.map(|x| x * x));
                assert!((gram - squares).amax() < 1e-14, "{n} {rank}");
            }
        }
    }

    /// Columns that are copies, scaled by up to 1e12, and a Hilbert matrix: the sweeps end.
    #[test]
    fn decompositions_of_singular_matrices_are_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(23);
        let hilbert = |n: usize| DMatrix::from_fn(n, n, |i, j| 1.0 / (i + j + 1) as f64);
        let mut matrices: Vec<DMatrix<f64>> = (1..40).map(hilbert).collect();
        for k in 0..200 {
            let (n, rank) = (rng.random_range(1..30), rng.random_range(1..6));
            let columns = DMatrix::from_fn(n, rank, |_, _| rng.random_range(-1.0..1.0));
            let mut matrix = DMatrix::from_fn(n, n, |i, j| columns[(i, j % rank)]);
            for mut column in matrix.column_iter_mut() {
                column *= 10f64.powf(rng.random_range(-6.0..6.0));
            }
            matrices.push(if k % 2 == 0 { matrix } else { matrix.qr().r().transpose() });
        }
        for matrix in matrices {
            let n = matrix.ncols();
            let SingularValues { values, vectors, images } = SingularValues::of(matrix.clone()).unwrap();
            let size = values[0];
            assert!((vectors.tr_mul(&vectors) - DMatrix::identity(n, n)).amax() < 1e-13, "{n}");
            assert!((images.clone() * vectors.transpose() - matrix).amax() < 1e-14 * size, "{n}");
            let gram = images.tr_mul(&images);
            let squares = DMatrix::from_fn(n, n, |i, j| if i == j { values[i].powi(2) } else { 0.0 });
            assert!((gram - squares).amax() < 1e-14 * size * size, "{n}");
        }
    }

    #[test]
    fn a_matrix_of_zeros_has_values_of_zero_and_one_that_is_not_finite_has_none() {
        let found = SingularValues::of(DMatrix::zeros(3, 3)).unwrap();
        assert_eq!((found.values, found.vectors), (vec![0.0; 3], DMatrix::identity(3, 3)));
        assert!(SingularValues::of(DMatrix::from_element(2, 2, f64::NAN)).is_none());
    }
}
