//! The numbers of a step of DOP853 and what is done with them whatever the system is: compiled once for all systems.

use super::STAGES;
use super::rows::{ANY, Aligned, combine, identity, is_finite, multiply_add};
use crate::product::orthonormalise;
use nalgebra::DMatrix;
use somersault_integrators::tableau::{ErrorWeights, Tableau};

/// State, Φ and integral with the slopes of a step. Without Φ its numbers are none.
pub(super) struct Step {
    pub(super) n: usize,
    pub(super) tableau: &'static Tableau,
    error: &'static ErrorWeights,
    relative: f64,
    /// In each entry of the state.
    absolute: Vec<f64>,
    /// In the integral.
    integral_tolerance: f64,
    pub(super) state: Aligned,
    /// Φ.
    pub(super) rows: Aligned,
    pub(super) integral: f64,
    /// D at the current state, to restart Φ without an evaluation.
    pub(super) jacobian: DMatrix<f64>,
    /// The slopes of the stages, one after the other, of state, Φ and integral.
    pub(super) slopes: Aligned,
    pub(super) row_slopes: Aligned,
    pub(super) integrands: [f64; STAGES],
    /// State and Φ of a stage, and then those at the end of a trial.
    pub(super) next: Aligned,
    pub(super) next_rows: Aligned,
    pub(super) scratch: Scratch,
}

/// What is kept from before a step, and what errors are summed in.
pub(super) struct Scratch {
    pub(super) stage_jacobian: DMatrix<f64>,
    first_slope: Vec<f64>,
    first_row_slope: Vec<f64>,
    /// Two estimates of the error of the state, then of one of Φ.
    estimates: [Vec<f64>; 2],
    row_estimates: [Aligned; 2],
    /// Sums over columns.
    sums: [Vec<f64>; 3],
}

/// The end of a trial with Φ and its error, in loops of a length that the compiler knows.
struct Finish<'s> {
    step: &'s mut Step,
    h: f64,
}

impl pulp::WithSimd for Finish<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<V: pulp::Simd>(self, _: V) -> f64 {
        match self.step.n {
            2 => self.step.finish_by::<V, 2, 4, true>(self.h),
            3 => self.step.finish_by::<V, 3, 9, true>(self.h),
            4 => self.step.finish_by::<V, 4, 16, true>(self.h),
            6 => self.step.finish_by::<V, 6, 36, true>(self.h),
            8 => self.step.finish_by::<V, 8, 64, true>(self.h),
            _ => self.step.finish_by::<V, ANY, ANY, true>(self.h),
        }
    }
}

impl Step {
    /// At a state, with Φ = 1 if `matrix` says so. Tolerances are absolute in each entry of the state, and in the integral.
    pub(super) fn new(
        p: &[f64],
        matrix: bool,
        relative: f64,
        absolute: Vec<f64>,
        integral_tolerance: f64,
    ) -> Self {
        let (tableau, error) = Tableau::dop853();
        let n = p.len();
        let side = if matrix { n } else { 0 };
        let square = side * side;
        let zeros = |size: usize| vec![0.0; size];
        let mut rows = Aligned::zeros(square);
        identity(&mut rows, side);
        let mut state = Aligned::zeros(n);
        state.copy_from_slice(p);
        Self {
            n,
            tableau,
            error,
            relative,
            absolute,
            integral_tolerance,
            state,
            rows,
            integral: 0.0,
            jacobian: DMatrix::zeros(side, side),
            slopes: Aligned::zeros(STAGES * n),
            row_slopes: Aligned::zeros(STAGES * square),
            integrands: [0.0; STAGES],
            next: Aligned::zeros(n),
            next_rows: Aligned::zeros(square),
            scratch: Scratch {
                stage_jacobian: DMatrix::zeros(side, side),
                first_slope: zeros(n),
                first_row_slope: zeros(square),
                estimates: [zeros(n), zeros(n)],
                row_estimates: [Aligned::zeros(square), Aligned::zeros(square)],
                sums: [zeros(side), zeros(side), zeros(side)],
            },
        }
    }

    /// Continues with Φ = 1 from here.
    #[inline]
    pub(super) fn restart_matrix(&mut self) {
        let n = self.n;
        identity(&mut self.rows, n);
        for (i, row) in self.row_slopes[..n * n].chunks_exact_mut(n).enumerate() {
            row.iter_mut().zip(self.jacobian.row(i).iter()).for_each(|(slope, d)| *slope = *d);
        }
    }

    /// Goes where a trial has led, and keeps where it began; the gain of the integral for a step of size 1.
    #[inline]
    pub(super) fn make(&mut self) -> f64 {
        let gain = self.combine_scalar(self.tableau.weights());
        self.scratch.first_slope.copy_from_slice(&self.slopes[..self.n]);
        self.scratch.first_row_slope.copy_from_slice(&self.row_slopes[..self.rows.len()]);
        self.swap();
        gain
    }

    /// Goes back to where the trial began.
    #[inline]
    pub(super) fn unmake(&mut self) {
        self.swap();
        let square = self.rows.len();
        self.slopes[..self.n].copy_from_slice(&self.scratch.first_slope);
        self.row_slopes[..square].copy_from_slice(&self.scratch.first_row_slope);
    }

    /// Exchanges the point that the step begins at with that at the end of a trial.
    #[inline]
    fn swap(&mut self) {
        std::mem::swap(&mut self.state, &mut self.next);
        std::mem::swap(&mut self.rows, &mut self.next_rows);
    }

    /// How far Φ stretches or shrinks: its largest entry, or the inverse of the smallest part of a column that the columns
    /// before it do not have.
    pub(super) fn spread(&mut self) -> f64 {
        // the scratch of a step is free between steps
        let Scratch { stage_jacobian: q, sums: [diagonal, ..], .. } = &mut self.scratch;
        q.copy_from_slice(&self.rows);
        // what lies by rows is the transpose by columns
        q.transpose_mut();
        let largest = q.amax();
        orthonormalise::<1>(q, |i, j, part| {
            if i == j {
                diagonal[i] = part;
            }
        });
        let smallest = diagonal.iter().copied().fold(f64::INFINITY, f64::min);
        largest.max(1.0 / smallest)
    }

    /// Where the slopes of the stages lead in a step of size h, to `next` and `next_rows`, with Φ; the error in units of the
    /// tolerance.
    pub(super) fn finish(&mut self, arch: pulp::Arch, h: f64) -> f64 {
        arch.dispatch(Finish { step: self, h })
    }

    #[inline(always)]
    pub(super) fn finish_by<V: pulp::Simd, const N: usize, const SQUARE: usize, const MATRIX: bool>(
        &mut self,
        h: f64,
    ) -> f64 {
        let n = if N == ANY { self.n } else { N };
        let weights = self.tableau.weights();
        combine::<V, N>(Some(&self.state[..n]), &self.slopes, weights, h, &mut self.next[..n]);
        if MATRIX {
            let square = n * n;
            let next_rows = &mut self.next_rows[..square];
            combine::<V, SQUARE>(Some(&self.rows[..square]), &self.row_slopes, weights, h, next_rows);
        }
        self.error_of::<V, N, SQUARE, MATRIX>(h)
    }

    /// The estimate of Hairer, Nørsett and Wanner, II.10: e₅²/√(e₅² + e₃²/100) in root mean square, the largest of state,
    /// columns of Φ and integral.
    #[inline(always)]
    fn error_of<V: pulp::Simd, const N: usize, const SQUARE: usize, const MATRIX: bool>(
        &mut self,
        h: f64,
    ) -> f64 {
        let n = if N == ANY { self.n } else { N };
        let (relative, square) = (self.relative, n * n);
        // a pair without a second estimate has none of its weights
        let (main, correction) = (self.error.main(), self.error.correction().unwrap_or(&[]));
        let Scratch { estimates: [e5, e3], row_estimates, sums, .. } = &mut self.scratch;
        let (e5, e3) = (&mut e5[..n], &mut e3[..n]);
        combine::<V, N>(None, &self.slopes, main, 1.0, e5);
        combine::<V, N>(None, &self.slopes, correction, 1.0, e3);
        let (absolute, state, next) = (&self.absolute[..n], &self.state[..n], &self.next[..n]);
        let (mut fifth, mut third) = (0.0, 0.0);
        for i in 0..n {
            let scale = absolute[i] + relative * state[i].abs().max(next[i].abs());
            fifth += (e5[i] / scale).powi(2);
            third += (e3[i] / scale).powi(2);
        }
        let mut size = ratio(fifth, third, n);
        if MATRIX {
            let [e5, e3] = row_estimates;
            let (e5, e3) = (&mut e5[..square], &mut e3[..square]);
            combine::<V, SQUARE>(None, &self.row_slopes, main, 1.0, e5);
            combine::<V, SQUARE>(None, &self.row_slopes, correction, 1.0, e3);
            // sums of a length that the compiler knows stay in registers
            let mut known = [[0.0; N]; 3];
            let [fifth, third, large] = if N == ANY {
                let [fifth, third, large] = sums;
                [&mut fifth[..n], &mut third[..n], &mut large[..n]]
            } else {
                let [fifth, third, large] = &mut known;
                [&mut fifth[..], &mut third[..], &mut large[..]]
            };
            fifth.fill(0.0);
            third.fill(0.0);
            large.fill(f64::MIN_POSITIVE);
            let (before, after) = (&self.rows[..square], &self.next_rows[..square]);
            for i in 0..n {
                let row = i * n..(i + 1) * n;
                let (e5, e3) = (&e5[row.clone()], &e3[row.clone()]);
                let (before, after) = (&before[row.clone()], &after[row]);
                for c in 0..n {
                    fifth[c] = multiply_add::<V>(e5[c], e5[c], fifth[c]);
                    third[c] = multiply_add::<V>(e3[c], e3[c], third[c]);
                    large[c] = large[c].max(before[c].abs()).max(after[c].abs());
                }
            }
            for c in 0..n {
                let scale = (relative * large[c]).powi(-2);
                size = larger(size, ratio(fifth[c] * scale, third[c] * scale, n));
            }
        }
        let scale =
            self.integral_tolerance + relative * self.integral.abs().max((h * self.integrands[0]).abs());
        let of_integral = self.combine_scalar(main);
        if of_integral != 0.0 && scale > 0.0 {
            let correction = self.combine_scalar(correction);
            size = larger(size, ratio((of_integral / scale).powi(2), (correction / scale).powi(2), 1));
        }
        h.abs() * size
    }

    #[inline]
    fn combine_scalar(&self, row: &[(usize, f64)]) -> f64 {
        row.iter().map(|&(j, a)| a * self.integrands[j]).sum()
    }

    /// From the size of the slope against that of the state, and of D: the estimate of Hairer, Nørsett and Wanner, II.4,
    /// without its trial step.
    pub(super) fn first_step_size(&self) -> f64 {
        let (relative, absolute) = (self.relative, &self.absolute);
        let mut rate = 0.0f64;
        for i in 0..self.n {
            let slope = self.slopes[i].abs();
            rate =
                rate.max(slope / (absolute[i] / relative + self.state[i].abs()).max(slope.min(1.0) * 1e-2));
        }
        if !self.rows.is_empty() {
            // ‖D‖ grows with the choice of units, √‖D²‖ less so
            rate = rate.max((&self.jacobian * &self.jacobian).amax().sqrt());
        }
        if rate > 0.0 { 2.0 * relative.powf(0.125) / rate } else { f64::MAX }
    }

    /// Whether the slopes at the current state are finite.
    #[inline]
    pub(super) fn first_is_finite(&self) -> bool {
        self.slopes[..self.n].iter().sum::<f64>().is_finite()
            && is_finite(&self.row_slopes[..self.rows.len()])
    }

    pub(super) fn fields_are_finite(&self) -> bool {
        self.slopes.chunks_exact(self.n).all(|k| k.iter().sum::<f64>().is_finite())
    }

    pub(super) fn stages_are_finite(&self) -> bool {
        self.fields_are_finite() && is_finite(&self.row_slopes)
    }
}

/// The larger one, or NaN if there is one.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

#[inline(always)]
fn ratio(fifth: f64, third: f64, n: usize) -> f64 {
    let below = fifth + 0.01 * third;
    if below > 0.0 { fifth / (below * n as f64).sqrt() } else { below }
}
