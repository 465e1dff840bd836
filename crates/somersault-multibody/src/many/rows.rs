//! Arguments and results of many states, row by row, and how they get into lanes and back.

use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use nalgebra::Vector3;
use somersault_core::argument::expect_length;
use somersault_core::lanes::{Lanes, Packed};
use somersault_core::scalar::Lift;
use std::ops::Range;

/// Rows of numbers, one for each state or one that stands for all; empty for an argument that there is not.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    numbers: &'a [f64],
    length: usize,
    many: bool,
}

impl<'a> Rows<'a> {
    pub(crate) fn new(
        argument: &'static str,
        numbers: &'a [f64],
        length: usize,
        count: usize,
    ) -> Result<Self, DynamicsError> {
        if numbers.len() != length {
            return Self::of_each(argument, numbers, length, count);
        }
        Ok(Self { numbers, length, many: false })
    }

    /// Rows of which there must be one for each state.
    pub(crate) fn of_each(
        argument: &'static str,
        numbers: &'a [f64],
        length: usize,
        count: usize,
    ) -> Result<Self, DynamicsError> {
        expect_length(argument, numbers.len(), length.saturating_mul(count))?;
        Ok(Self { numbers, length, many: true })
    }

    #[inline(always)]
    pub(crate) fn row(&self, i: usize) -> &'a [f64] {
        let start = if self.many { i * self.length } else { 0 };
        &self.numbers[start..start + self.length]
    }

    /// The rows of these states side by side; lanes without a state have the last one.
    #[inline(always)]
    pub(crate) fn interleave<L: Lanes>(&self, states: Range<usize>, numbers: &mut [f64]) {
        for lane in 0..L::WIDTH {
            let row = self.row((states.start + lane).min(states.end - 1));
            for (x, to) in row.iter().zip(numbers.chunks_exact_mut(L::WIDTH)) {
                to[lane] = *x;
            }
        }
    }
}

/// A wrench from its six numbers.
pub(super) fn wrench(f: &[f64]) -> Force<f64> {
    Force::new(Vector3::new(f[0], f[1], f[2]), Vector3::new(f[3], f[4], f[5]))
}

/// The arguments of the states in all lanes.
#[derive(Debug)]
pub(super) struct Inputs<L: Lanes> {
    pub(super) q: Vec<Packed<L>>,
    pub(super) v: Vec<Packed<L>>,
    /// Accelerations or joint forces.
    pub(super) given: Vec<Packed<L>>,
    wrenches: Vec<Force<Packed<L>>>,
    has_wrenches: bool,
    /// Numbers on their way into lanes or out of them, those of the lanes side by side.
    pub(super) numbers: Vec<f64>,
}

impl<L: Lanes> Inputs<L> {
    pub(super) fn new(lanes: L, model: &Model) -> Self {
        let (n_q, n, n_bodies) = (model.n_positions(), model.n_velocities(), model.n_bodies());
        let zero = Packed::lift(lanes, 0.0);
        Self {
            q: vec![zero; n_q],
            v: vec![zero; n],
            given: vec![zero; n],
            wrenches: vec![Force::zero().lift(lanes); n_bodies],
            has_wrenches: false,
            numbers: vec![0.0; n_q.max(6 * n_bodies).max(L::WIDTH) * L::WIDTH],
        }
    }

    /// One for each body, or none.
    #[inline(always)]
    pub(super) fn wrenches(&self) -> &[Force<Packed<L>>] {
        if self.has_wrenches { &self.wrenches } else { &[] }
    }

    /// The arguments of these states, at most as many as there are lanes.
    #[inline(always)]
    pub(super) fn load(
        &mut self,
        lanes: L,
        states: Range<usize>,
        [q, v, given]: [Rows<'_>; 3],
        wrenches: Rows<'_>,
    ) {
        let numbers = &mut self.numbers;
        let packed = |numbers: &[f64], k: usize| Packed::load(lanes, &numbers[k * L::WIDTH..]);
        for (rows, to) in [(q, &mut self.q), (v, &mut self.v), (given, &mut self.given)] {
            rows.interleave::<L>(states.clone(), numbers);
            for (k, to) in to[..rows.length].iter_mut().enumerate() {
                *to = packed(numbers, k);
            }
        }
        self.has_wrenches = wrenches.length > 0;
        if self.has_wrenches {
            wrenches.interleave::<L>(states, numbers);
            for (i, to) in self.wrenches.iter_mut().enumerate() {
                let at = |k| packed(numbers, 6 * i + k);
                *to = Force::new(Vector3::new(at(0), at(1), at(2)), Vector3::new(at(3), at(4), at(5)));
            }
        }
    }
}

/// What an evaluation found: a vector, and matrices of n rows by their columns, or nothing in their place.
pub(super) type Found<'a, X> = (&'a [X], [&'a [X]; 3]);

/// The numbers of a row of results: the vector, then the matrices, row by row.
pub(super) fn write_row((vector, matrices): Found<'_, f64>, n: usize, out: &mut [f64]) {
    let (front, mut rest) = out.split_at_mut(vector.len());
    front.copy_from_slice(vector);
    for matrix in matrices.into_iter().filter(|matrix| !matrix.is_empty()) {
        let (own, others) = rest.split_at_mut(n * n);
        for (i, row) in own.chunks_exact_mut(n).enumerate() {
            for (to, column) in row.iter_mut().zip(matrix.chunks_exact(n)) {
                *to = column[i];
            }
        }
        rest = others;
    }
}

/// The same for `count` states, those in the first lanes; `out` has a row for each.
#[inline(always)]
pub(super) fn write_rows<L: Lanes>(
    (vector, matrices): Found<'_, Packed<L>>,
    n: usize,
    numbers: &mut [f64],
    count: usize,
    out: &mut [f64],
) {
    let mut at = vector.len();
    write(vector, 1, at, numbers, 0, count, out);
    for matrix in matrices {
        if matrix.is_empty() {
            break;
        }
        for i in 0..n {
            write(&matrix[i..], n, n, numbers, at, count, out);
            at += n;
        }
    }
}

/// `length` numbers, each `step` after the one before, to the places from `at` on in the row of each state.
#[inline(always)]
fn write<L: Lanes>(
    from: &[Packed<L>],
    step: usize,
    length: usize,
    numbers: &mut [f64],
    at: usize,
    count: usize,
    out: &mut [f64],
) {
    let row = out.len() / count;
    let block = &mut numbers[..L::WIDTH * L::WIDTH];
    for first in (0..length).step_by(L::WIDTH) {
        let some = (length - first).min(L::WIDTH);
        for b in 0..some {
            from[(first + b) * step].store(&mut block[b * L::WIDTH..]);
        }
        for lane in 0..count.min(L::WIDTH) {
            let to = &mut out[lane * row + at + first..][..some];
            if some == L::WIDTH {
                for b in 0..L::WIDTH {
                    to[b] = block[b * L::WIDTH + lane];
                }
            } else {
                for b in 0..some {
                    to[b] = block[b * L::WIDTH + lane];
                }
            }
        }
    }
}
