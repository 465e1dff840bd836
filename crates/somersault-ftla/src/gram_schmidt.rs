//! QR factorisation of small square matrices.

use nalgebra::DMatrix;

/// Makes the columns of `a` orthonormal in place by Gram–Schmidt, each column done `PASSES` times: twice is as good as
/// reflections, and keeps the order of the columns. `part_of` receives what is to be added to the entry of R in row i and column
/// j; the diagonal of R is positive.
pub(crate) fn orthonormalise<const PASSES: usize>(
    a: &mut DMatrix<f64>,
    mut part_of: impl FnMut(usize, usize, f64),
) {
    let n = a.nrows();
    for j in 0..n {
        let (done, rest) = a.as_mut_slice().split_at_mut(j * n);
        let column = &mut rest[..n];
        for _ in 0..PASSES {
            for (i, q) in done.chunks_exact(n).enumerate() {
                let part = dot(q, column);
                part_of(i, j, part);
                for k in 0..n {
                    column[k] -= part * q[k];
                }
            }
        }
        let norm = dot(column, column).sqrt();
        part_of(j, j, norm);
        column.iter_mut().for_each(|x| *x /= norm);
    }
}

/// In four sums, so that they need not wait for one another.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len();
    let b = &b[..n];
    let mut sums = [0.0; 4];
    for k in 0..n {
        sums[k % 4] += a[k] * b[k];
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}
