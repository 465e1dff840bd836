//! The leading eigenpairs of a diagonal matrix less a dyad,
//!
//! ```text
//! Λ − ρ z zᵀ,   λ₁ ≥ … ≥ λ_r,   ρ > 0
//! ```
//! which is what leaving one motion out makes of the scatter of motions in their principal axes. Eigenvalue l is the zero between λ_{l+1} and
//! λ_l of the secular equation, where it falls from +∞ to −∞; its eigenvector follows:
//!
//! ```text
//! 1 − ρ Σ_p z_p² / (λ_p − μ) = 0,   q_p ∝ z_p / (λ_p − μ)
//! ```
//! Each is found from the nearer pole, so that differences keep their digits, by interpolation of the sums over the poles on either side
//! by a pole each. A pair costs O(r), a decomposition O(r³).
//!
//! Sources: J. R. Bunch, C. P. Nielsen and D. C. Sorensen, *Rank-one modification of the symmetric eigenproblem*, Numer. Math. 31 (1978),
//! 31–48; R.-C. Li, *Solving secular equations stably and efficiently*, LAPACK Working Note 89 (1994), for the interpolation.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Fraction of the largest eigenvalue by which eigenvalues, and of z by which its entries, must differ from each other and from zero to be
/// told apart; else the whole matrix is decomposed.
const APART: f64 = 1e-8;
/// Steps towards a zero, at most; five are usual.
const STEPS: usize = 60;

/// The `k` largest eigenvalues, falling, and their eigenvectors of unit length, a column each; `squares` fall and are positive.
pub(super) fn leading(squares: &[f64], rho: f64, z: &DVector<f64>, k: usize) -> (Vec<f64>, DMatrix<f64>) {
    if k == 0 {
        return (Vec::new(), DMatrix::zeros(squares.len(), 0));
    }
    let apart = k < squares.len()
        && squares.windows(2).take(k).all(|pair| pair[0] - pair[1] > APART * squares[0])
        && z.iter().take(k + 1).all(|x| x.abs() > APART * z.norm());
    if !apart {
        return decomposed(squares, rho, z, k);
    }
    let zz: Vec<f64> = z.iter().map(|x| x * x).collect();
    let mut poles = vec![0.0; squares.len()];
    let (mut values, mut vectors) = (Vec::with_capacity(k), DMatrix::zeros(squares.len(), k));
    for (l, mut vector) in vectors.column_iter_mut().enumerate() {
        let (origin, offset) = zero(squares, rho, &zz, l, &mut poles);
        values.push(squares[origin] + offset);
        for (entry, (z, pole)) in vector.iter_mut().zip(z.iter().zip(&poles)) {
            *entry = z / (pole - offset);
        }
        vector.normalize_mut();
    }
    (values, vectors)
}

/// The zero of the secular equation below pole `l`, as its offset from a pole; `poles` become those from there.
fn zero(squares: &[f64], rho: f64, zz: &[f64], l: usize, poles: &mut [f64]) -> (usize, f64) {
    let middle = 0.5 * (squares[l] + squares[l + 1]);
    let sum: f64 = squares.iter().zip(zz).map(|(square, zz)| zz / (square - middle)).sum();
    let origin = if 1.0 - rho * sum > 0.0 { l } else { l + 1 };
    poles.iter_mut().zip(squares).for_each(|(pole, square)| *pole = square - squares[origin]);
    let half = 0.5 * (squares[l] - squares[l + 1]);
    let (mut lower, mut upper) = if origin == l { (-half, 0.0) } else { (0.0, half) };
    let (above, below) = (poles[l], poles[l + 1]);
    let mut offset = 0.5 * (lower + upper);
    for _ in 0..STEPS {
        // value and slope of the sums over the poles above and below
        let part = |zz: &[f64], poles: &[f64]| {
            zz.iter().zip(poles).fold([0.0; 2], |[value, slope], (zz, pole)| {
                let inverse = 1.0 / (pole - offset);
                [value + zz * inverse, slope + zz * inverse * inverse]
            })
        };
        let ([psi, d_psi], [phi, d_phi]) =
            (part(&zz[..=l], &poles[..=l]), part(&zz[l + 1..], &poles[l + 1..]));
        let value = 1.0 / rho - psi - phi;
        if value == 0.0 {
            break;
        }
        if value > 0.0 {
            lower = offset
        } else {
            upper = offset
        }
        // rest − t/(above − x) − s/(below − x) has values and slopes of both sums here
        let (to_above, to_below) = (above - offset, below - offset);
        let (t, s) = (d_psi * to_above * to_above, d_phi * to_below * to_below);
        let rest = value + d_psi * to_above + d_phi * to_below;
        let (linear, constant) =
            (rest * (above + below) - t - s, rest * above * below - t * below - s * above);
        let root = (linear * linear - 4.0 * rest * constant).max(0.0).sqrt();
        let q = 0.5 * (linear + root.copysign(linear));
        let inside = |x: &f64| *x > lower && *x < upper;
        let next = [q / rest, constant / q].into_iter().find(inside).unwrap_or(0.5 * (lower + upper));
        let step = next - offset;
        offset = next;
        if step.abs() <= 2.0 * f64::EPSILON * offset.abs() {
            break;
        }
    }
    (origin, offset)
}

fn decomposed(squares: &[f64], rho: f64, z: &DVector<f64>, k: usize) -> (Vec<f64>, DMatrix<f64>) {
    let mut matrix = DMatrix::from_diagonal(&DVector::from_row_slice(squares));
    matrix.syger(-rho, z, z, 1.0);
    matrix.fill_upper_triangle_with_lower_triangle();
    let eigen = SymmetricEigen::new(matrix);
    let order = falling(&eigen.eigenvalues, k);
    let values = order.iter().map(|&i| eigen.eigenvalues[i].max(0.0)).collect();
    (values, eigen.eigenvectors.select_columns(&order))
}

/// Where the `k` largest of values are, the largest first.
pub(super) fn falling(values: &DVector<f64>, k: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    order.truncate(k);
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use somersault_core::random::SplitMix64;

    #[test]
    fn leading_pairs_are_those_of_the_whole_decomposition() {
        let mut random = SplitMix64::new(4);
        for case in 0..60 {
            let n = 3 + case % 9;
            let mut squares: Vec<f64> = (0..n).map(|_| (12.0 * random.unit() - 6.0).exp()).collect();
            squares.sort_by(|a, b| b.total_cmp(a));
            let mut z = DVector::from_fn(n, |i, _| squares[i].sqrt() * (2.0 * random.unit() - 1.0));
            match case % 4 {
                1 => z[0] = 0.0,
                2 => squares[1] = squares[0],
                _ => (),
            }
            // what is left is positive
            let inverse: f64 = z.iter().zip(&squares).map(|(z, square)| z * z / square).sum();
            let rho = (0.01 + 0.98 * random.unit()) / inverse;
            let k = 1 + case % (n - 1);
            let (values, vectors) = leading(&squares, rho, &z, k);
            let (expected, _) = decomposed(&squares, rho, &z, k);
            let matrix =
                DMatrix::from_diagonal(&DVector::from_row_slice(&squares)) - &z * z.transpose() * rho;
            let residual =
                &matrix * &vectors - &vectors * DMatrix::from_diagonal(&DVector::from_row_slice(&values));
            assert!(residual.amax() < 1e-13 * squares[0], "case {case}: {residual}");
            let identity = DMatrix::identity(k, k);
            assert!((vectors.tr_mul(&vectors) - identity).amax() < 1e-9, "case {case}");
            for (found, expected) in values.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-13 * squares[0], "case {case}: {found} for {expected}");
            }
        }
    }
}
