//! Arithmetic on transition matrices by rows.
//!
//! The columns of Φ lie side by side in the lanes of a vector: an entry of D multiplies a row of Φ at once, an entry that
//! is known to be zero is left out, and the errors of all columns are summed together.

/// The rows of a matrix.
pub(super) type Rows<const N: usize> = [[f64; N]; N];

/// Numbers combined at once: sums of them fill half of the registers of AVX2.
const BLOCK: usize = 32;

pub(super) fn identity<const N: usize>() -> Rows<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }))
}

/// Whether every column has a finite sum.
#[inline(always)]
pub(super) fn is_finite<const N: usize>(rows: &Rows<N>) -> bool {
    let mut sums = [0.0; N];
    for row in rows {
        for c in 0..N {
            sums[c] += row[c];
        }
    }
    sums.iter().all(|sum| sum.is_finite())
}

/// a b + c, in one operation where vectors have it.
#[inline(always)]
pub(super) fn multiply_add<V: pulp::Simd>(a: f64, b: f64, c: f64) -> f64 {
    // of the vectors of x86, those of four numbers and more
    if V::F64_LANES >= 4 || cfg!(target_arch = "aarch64") { a.mul_add(b, c) } else { a * b + c }
}

/// start + h Σ a_j K_j.
#[inline(always)]
pub(super) fn combine<V: pulp::Simd, const N: usize>(
    start: &Rows<N>,
    slopes: &[Rows<N>],
    row: &[(usize, f64)],
    h: f64,
    out: &mut Rows<N>,
) {
    let mut at = 0;
    while at + BLOCK <= N * N {
        combine_block::<V, BLOCK, N>(at, start, slopes, row, h, out);
        at += BLOCK;
    }
    while at + 4 <= N * N {
        combine_block::<V, 4, N>(at, start, slopes, row, h, out);
        at += 4;
    }
    while at < N * N {
        combine_block::<V, 1, N>(at, start, slopes, row, h, out);
        at += 1;
    }
}

/// The same for `B` numbers from number `at` on.
#[inline(always)]
fn combine_block<V: pulp::Simd, const B: usize, const N: usize>(
    at: usize,
    start: &Rows<N>,
    slopes: &[Rows<N>],
    row: &[(usize, f64)],
    h: f64,
    out: &mut Rows<N>,
) {
    let mut sum = [0.0; B];
    for &(j, a) in row {
        let slope = &slopes[j].as_flattened()[at..at + B];
        for i in 0..B {
            sum[i] = multiply_add::<V>(a, slope[i], sum[i]);
        }
    }
    let start = &start.as_flattened()[at..at + B];
    for i in 0..B {
        sum[i] = multiply_add::<V>(h, sum[i], start[i]);
    }
    out.as_flattened_mut()[at..at + B].copy_from_slice(&sum);
}
