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
use nalgebra::{SMatrix, SVector};

/// ln σ in descending order, with the right singular vectors as columns.
pub(super) fn decompose<const N: usize>(links: &[Transition<N>]) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
    let mut q = SMatrix::<f64, N, N>::identity();
    for link in links {
        q = orthonormalise::<2, N>(link.matrix * q).0;
    }
    for link in links.iter().rev() {
        q = orthonormalise::<2, N>(link.matrix.transpose() * q).0;
    }
    // R = diag(exp(logs)) U
    let mut logs = SVector::<f64, N>::zeros();
    let mut u = SMatrix::<f64, N, N>::identity();
    let mut basis = q;
    for link in links {
        let (next, r) = orthonormalise::<2, N>(link.matrix * basis);
        basis = next;
        // diag(d) U ← R diag(d) U, row by row: each row keeps its own scale
        let before = logs;
        let mut rows = SMatrix::<f64, N, N>::zeros();
        for i in 0..N {
            for k in i..N {
                // a direction that is decoupled stays so, however large the ratio of sizes
                if r[(i, k)] == 0.0 {
                    continue;
                }
                let factor = r[(i, k)] * (before[k] - before[i]).exp();
                for j in k..N {
                    rows[(i, j)] += factor * u[(k, j)];
                }
            }
            let size = rows.row(i).norm();
            rows.row_mut(i).unscale_mut(size);
            logs[i] = before[i] + size.ln();
        }
        u = rows;
    }
    jacobi(&mut logs, &mut u);
    // the rows of u are right singular vectors in the basis q
    let mut order: [usize; N] = std::array::from_fn(|i| i);
    order.sort_by(|&i, &j| logs[j].total_cmp(&logs[i]));
    let vectors = q * u.transpose();
    (SVector::from_fn(|i, _| logs[order[i]]), SMatrix::from_fn(|i, j| vectors[(i, order[j])]))
}

/// Rotates rows of diag(exp(logs)) U, from the left, until they are orthogonal; then they are of unit norm in U.
fn jacobi<const N: usize>(logs: &mut SVector<f64, N>, u: &mut SMatrix<f64, N, N>) {
    for _sweep in 0..40 {
        let mut largest = 0.0f64;
        for i in 0..N {
            for j in i + 1..N {
                // the larger row first
                let (i, j) = if logs[i] >= logs[j] { (i, j) } else { (j, i) };
                let cosine = u.row(i).dot(&u.row(j));
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
                let (row_i, row_j) = (u.row(i).into_owned(), u.row(j).into_owned());
                // a uᵢ' = c (a uᵢ + t b uⱼ), b uⱼ' = c (b uⱼ − t a uᵢ)
                let new_i = (row_i + row_j * (t * ratio)) * c;
                let new_j = (row_j - row_i * tangent) * c;
                let (size_i, size_j) = (new_i.norm(), new_j.norm());
                logs[i] += size_i.ln();
                logs[j] += size_j.ln();
                u.set_row(i, &(new_i / size_i));
                u.set_row(j, &(new_j / size_j));
            }
        }
        if largest <= 4.0 * f64::EPSILON {
            break;
        }
    }
}
