//! QR factorisation of small square matrices.

use nalgebra::SMatrix;

/// Q and R with a positive diagonal by Gram–Schmidt, each column done `PASSES` times: twice is as good as reflections, and
/// keeps the order of the columns.
pub(crate) fn orthonormalise<const PASSES: usize, const N: usize>(
    mut a: SMatrix<f64, N, N>,
) -> (SMatrix<f64, N, N>, SMatrix<f64, N, N>) {
    let mut r = SMatrix::<f64, N, N>::zeros();
    for j in 0..N {
        let (done, rest) = a.data.0.split_at_mut(j);
        let column = &mut rest[0];
        for _ in 0..PASSES {
            for (i, q) in done.iter().enumerate() {
                let part: f64 = dot(q, column);
                r[(i, j)] += part;
                (0..N).for_each(|k| column[k] -= part * q[k]);
            }
        }
        let norm = dot(column, column).sqrt();
        r[(j, j)] = norm;
        column.iter_mut().for_each(|x| *x /= norm);
    }
    (a, r)
}

/// In four sums, so that they need not wait for one another.
#[inline(always)]
fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut sums = [0.0; 4];
    for k in 0..N {
        sums[k % 4] += a[k] * b[k];
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}
