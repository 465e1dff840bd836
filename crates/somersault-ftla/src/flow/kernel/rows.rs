//! Arithmetic on transition matrices by rows.
//!
//! The columns of Φ lie side by side in the lanes of a vector: an entry of D multiplies a row of Φ at once, an entry that
//! is known to be zero is left out, and the errors of all columns are summed together. Matrices are n² numbers, row by row.

use std::ops::{Deref, DerefMut};

/// Numbers that begin with a cache line: a vector that lies on two lines takes twice as long to load.
pub(in crate::flow) struct Aligned {
    numbers: Vec<f64>,
    start: usize,
    size: usize,
}

impl Aligned {
    pub(super) fn zeros(size: usize) -> Self {
        const LINE: usize = 64 / size_of::<f64>();
        let numbers = vec![0.0; size + LINE - 1];
        let start = numbers.as_ptr().align_offset(64).min(LINE - 1);
        Self { numbers, start, size }
    }
}

impl Deref for Aligned {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.numbers[self.start..self.start + self.size]
    }
}

impl DerefMut for Aligned {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[self.start..self.start + self.size]
    }
}

/// In place of a size that the compiler knows: any other one.
pub(super) const ANY: usize = 0;

/// Numbers combined at once: sums of them fill half of the registers of AVX2.
const BLOCK: usize = 32;

/// Writes 1.
pub(super) fn identity(rows: &mut [f64], n: usize) {
    rows.fill(0.0);
    rows.iter_mut().step_by(n + 1).for_each(|x| *x = 1.0);
}

/// Whether the numbers have a finite sum.
#[inline(always)]
pub(super) fn is_finite(numbers: &[f64]) -> bool {
    // in as many sums as a vector has lanes
    let (blocks, rest) = numbers.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for block in blocks {
        for i in 0..8 {
            sums[i] += block[i];
        }
    }
    (sums.iter().sum::<f64>() + rest.iter().sum::<f64>()).is_finite()
}

/// a b + c, in one operation where vectors have it.
#[inline(always)]
pub(super) fn multiply_add<V: pulp::Simd>(a: f64, b: f64, c: f64) -> f64 {
    // of the vectors of x86, those of four numbers and more
    if V::F64_LANES >= 4 || cfg!(target_arch = "aarch64") { a.mul_add(b, c) } else { a * b + c }
}

/// start + h Σ a_j K_j, the K_j one after the other in `slopes`; `start` none for zero. `SIZE` is that of each, or [`ANY`].
#[inline(always)]
pub(super) fn combine<V: pulp::Simd, const SIZE: usize>(
    start: Option<&[f64]>,
    slopes: &[f64],
    row: &[(usize, f64)],
    h: f64,
    out: &mut [f64],
) {
    if SIZE == ANY {
        let size = out.len();
        combine_slopes::<V>(start, |j| &slopes[j * size..(j + 1) * size], row, h, out);
    } else {
        let slopes = slopes.as_chunks::<SIZE>().0;
        let start = start.map(|start| &start[..SIZE]);
        combine_slopes::<V>(start, |j| &slopes[j], row, h, &mut out[..SIZE]);
    }
}

#[inline(always)]
fn combine_slopes<'s, V: pulp::Simd>(
    start: Option<&[f64]>,
    slope: impl Fn(usize) -> &'s [f64],
    row: &[(usize, f64)],
    h: f64,
    out: &mut [f64],
) {
    let mut at = 0;
    while at + BLOCK <= out.len() {
        combine_block::<V, BLOCK>(at, start, &slope, row, h, out);
        at += BLOCK;
    }
    // what was just written by numbers is not at hand by vectors longer than two
    while at + 2 <= out.len() {
        combine_block::<V, 2>(at, start, &slope, row, h, out);
        at += 2;
    }
    while at < out.len() {
        combine_block::<V, 1>(at, start, &slope, row, h, out);
        at += 1;
    }
}

/// The same for `B` numbers from number `at` on.
#[inline(always)]
fn combine_block<'s, V: pulp::Simd, const B: usize>(
    at: usize,
    start: Option<&[f64]>,
    slope: &impl Fn(usize) -> &'s [f64],
    row: &[(usize, f64)],
    h: f64,
    out: &mut [f64],
) {
    let mut sum = [0.0; B];
    for &(j, a) in row {
        let slope = &slope(j)[at..at + B];
        for i in 0..B {
            sum[i] = multiply_add::<V>(a, slope[i], sum[i]);
        }
    }
    let out = &mut out[at..at + B];
    match start {
        Some(start) => {
            let start = &start[at..at + B];
            for i in 0..B {
                out[i] = multiply_add::<V>(h, sum[i], start[i]);
            }
        }
        None => {
            for i in 0..B {
                out[i] = h * sum[i];
            }
        }
    }
}
