//! The singular value decomposition of a product of matrices, small singular values as accurate as large ones.
//!
//! Formed and decomposed, Φ = Φ_K ⋯ Φ₁ keeps only singular values above 1e-16 σ₁. Instead
//!
//! 1. QR factorisations along the product and back along its transpose find an orthogonal Q₀ near the right singular
//!    vectors, in descending order;
//! 2. a sweep Φ_k Q_{k−1} = Q_k R_k turns the product into Q_K R Q₀ᵀ, R = R_K ⋯ R₁ upper triangular with its rows graded:
//!    R = diag(d) U with U well conditioned, and d held apart by its logarithms;
//! 3. one-sided Jacobi rotations of Rᵀ, which is graded by columns, give all singular values to high relative accuracy
//!    (J. Demmel and K. Veselić, *Jacobi's method is more accurate than QR*, SIAM J. Matrix Anal. Appl. 13 (1992)).
//!
//! The relative error of a singular value is of the size of ε Σ κ(Φ_k): short factors, not a long matrix, decide it.
//! Neither nalgebra nor faer has a decomposition of products, or one that keeps small singular values of a graded matrix.

use nalgebra::{DMatrix, DVector};

/// ln σ in descending order, with the right singular vectors as columns.
pub(crate) fn decompose<'a>(
    factors: impl DoubleEndedIterator<Item = &'a DMatrix<f64>> + Clone,
) -> (DVector<f64>, DMatrix<f64>) {
    let n = factors.clone().next().map_or(0, DMatrix::nrows);
    let mut q = DMatrix::<f64>::identity(n, n);
    let mut product = q.clone();
    for factor in factors.clone() {
        factor.mul_to(&q, &mut product);
        orthonormalise::<2>(&mut product, |_, _, _| ());
        std::mem::swap(&mut q, &mut product);
    }
    for factor in factors.clone().rev() {
        factor.tr_mul_to(&q, &mut product);
        orthonormalise::<2>(&mut product, |_, _, _| ());
        std::mem::swap(&mut q, &mut product);
    }
    // R = diag(exp(logs)) U
    let mut logs = DVector::<f64>::zeros(n);
    let mut before = logs.clone();
    let mut u = DMatrix::<f64>::identity(n, n);
    let (mut r, mut rows) = (u.clone(), u.clone());
    let mut basis = q.clone();
    for factor in factors.clone() {
        factor.mul_to(&basis, &mut product);
        r.fill(0.0);
        orthonormalise::<2>(&mut product, |i, j, part| r[(i, j)] += part);
        std::mem::swap(&mut basis, &mut product);
        // diag(d) U ← R diag(d) U, row by row: each row keeps its own scale
        before.copy_from(&logs);
        rows.fill(0.0);
        for i in 0..n {
            for k in i..n {
                // a direction that is decoupled stays so, however large the ratio of sizes
                if r[(i, k)] == 0.0 {
                    continue;
                }
                let ratio = r[(i, k)] * (before[k] - before[i]).exp();
                for j in k..n {
                    rows[(i, j)] += ratio * u[(k, j)];
                }
            }
            let size = rows.row(i).norm();
            rows.row_mut(i).unscale_mut(size);
            logs[i] = before[i] + size.ln();
        }
        std::mem::swap(&mut u, &mut rows);
    }
    // by columns, which lie together
    u.transpose_mut();
    jacobi(&mut logs, &mut u);
    // the columns of u are right singular vectors in the basis q
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| logs[j].total_cmp(&logs[i]));
    let vectors = q * u;
    (DVector::from_fn(n, |i, _| logs[order[i]]), DMatrix::from_fn(n, n, |i, j| vectors[(i, order[j])]))
}

/// Rotates the rows of diag(exp(logs)) U, from the left, until they are orthogonal; then they are of unit norm in U. `u` is
/// Uᵀ.
fn jacobi(logs: &mut DVector<f64>, u: &mut DMatrix<f64>) {
    let n = logs.len();
    for _sweep in 0..40 {
        let mut largest = 0.0f64;
        for i in 0..n {
            for j in i + 1..n {
                // the larger row first
                let (i, j) = if logs[i] >= logs[j] { (i, j) } else { (j, i) };
                let cosine = u.column(i).dot(&u.column(j));
                largest = largest.max(cosine.abs());
                if cosine.abs() <= 2.0 * f64::EPSILON {
                    continue;
                }
                // a = exp(log i), b = exp(log j), ratio b/a ≤ 1; Gram matrix (a², abc; ·, b²)
                let ratio = (logs[j] - logs[i]).exp();
                let zeta = (1.0 - ratio) * (1.0 + ratio) / (2.0 * cosine);
                // tangent over the ratio, as the angle goes to zero with it
                let tangent = 1.0 / (zeta + zeta.signum() * zeta.hypot(ratio));
                let t = ratio * tangent;
                let c = 1.0 / t.hypot(1.0);
                // a uᵢ' = c (a uᵢ + t b uⱼ), b uⱼ' = c (b uⱼ − t a uᵢ)
                for k in 0..n {
                    let (at_i, at_j) = (u[(k, i)], u[(k, j)]);
                    u[(k, i)] = (at_i + at_j * (t * ratio)) * c;
                    u[(k, j)] = (at_j - at_i * tangent) * c;
                }
                for k in [i, j] {
                    let size = u.column(k).norm();
                    logs[k] += size.ln();
                    u.column_mut(k).unscale_mut(size);
                }
            }
        }
        if largest <= 4.0 * f64::EPSILON {
            break;
        }
    }
}

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
