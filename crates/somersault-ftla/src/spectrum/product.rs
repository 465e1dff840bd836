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

use crate::flow::Transition;
use crate::gram_schmidt::orthonormalise;
use nalgebra::{DMatrix, DVector};

/// ln σ in descending order, with the right singular vectors as columns.
pub(super) fn decompose(links: &[Transition]) -> (DVector<f64>, DMatrix<f64>) {
    let n = links.first().map_or(0, |link| link.matrix.nrows());
    let mut q = DMatrix::<f64>::identity(n, n);
    let mut product = q.clone();
    for link in links {
        link.matrix.mul_to(&q, &mut product);
        orthonormalise::<2>(&mut product, |_, _, _| ());
        std::mem::swap(&mut q, &mut product);
    }
    for link in links.iter().rev() {
        link.matrix.tr_mul_to(&q, &mut product);
        orthonormalise::<2>(&mut product, |_, _, _| ());
        std::mem::swap(&mut q, &mut product);
    }
    // R = diag(exp(logs)) U
    let mut logs = DVector::<f64>::zeros(n);
    let mut before = logs.clone();
    let mut u = DMatrix::<f64>::identity(n, n);
    let (mut r, mut rows) = (u.clone(), u.clone());
    let mut basis = q.clone();
    for link in links {
        link.matrix.mul_to(&basis, &mut product);
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
                let factor = r[(i, k)] * (before[k] - before[i]).exp();
                for j in k..n {
                    rows[(i, j)] += factor * u[(k, j)];
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
