//! QR factorisation of small square matrices.

use nalgebra::DMatrix;

/// Makes the columns of `a` orthonormal in place by Gram–Schmidt, each column done `PASSES` times: twice is as good as
/// reflections, and keeps the order of the columns. `part_of` is told what is to be added to the entry of R in row i and column
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
                column.iter_mut().zip(q).for_each(|(x, q)| *x -= part * q);
            }
        }
        let norm = dot(column, column).sqrt();
        part_of(j, j, norm);
        column.iter_mut().for_each(|x| *x /= norm);
    }
}

/// In four sums, so that they need not wait for one another.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (four_a, rest_a) = a.as_chunks::<4>();
    let (four_b, rest_b) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in four_a.iter().zip(four_b) {
        (0..4).for_each(|k| sums[k] += a[k] * b[k]);
    }
    rest_a.iter().zip(rest_b).enumerate().for_each(|(k, (a, b))| sums[k] += a * b);
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}
