//! The steps of DOP853 on a state, its transition matrix and one integral.

mod rows;
mod switching;

use super::{FlowError, FlowTolerances, Transition, VariationalFlow, Work, nothing};
use crate::budget::Budget;
use crate::product::orthonormalise;
use crate::system::{Piece, VectorField};
use nalgebra::{DMatrix, DVector};
use rows::{ANY, Aligned, combine, identity, is_finite, multiply_add};
use somersault_integrators::tableau::{ErrorWeights, Tableau};
use switching::Watch;

const STAGES: usize = 12;

/// Of four steps.
const EVALUATIONS_BETWEEN_REPORTS: usize = 4 * STAGES;

/// How an [`advance`](Kernel::advance) ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Progress {
    Arrived,
    Grown,
    Switched,
}

/// A run. `MATRIX` says whether it carries Φ.
///
/// Everything that a step needs lies here from the start: steps allocate nothing.
pub(super) struct Kernel<'a, S, const MATRIX: bool> {
    system: &'a S,
    n: usize,
    tableau: &'static Tableau,
    error: &'static ErrorWeights,
    relative: f64,
    /// In each entry of the state.
    absolute: Vec<f64>,
    /// In the integral.
    integral_tolerance: f64,
    max_steps: usize,
    budget: Option<&'a Budget>,
    /// Evaluations that the budget knows of.
    reported: usize,
    /// Time of the field at the start of the run.
    origin: f64,
    domain: Option<&'a [[f64; 2]]>,
    pub(super) t: f64,
    pub(super) state: Aligned,
    /// Φ.
    rows: Aligned,
    pub(super) integral: f64,
    pub(super) work: Work,
    /// The piece of the field that steps are made in.
    pub(super) piece: Piece,
    /// Whether to come back where a piece ends.
    pub(super) stops_at_switches: bool,
    watch: Watch,
    /// The next step size, with the sign of the direction.
    h: f64,
    /// D at the current state, to restart Φ without an evaluation.
    jacobian: DMatrix<f64>,
    /// The slopes of the stages, one after the other, of state, Φ and integral.
    slopes: Aligned,
    row_slopes: Aligned,
    integrands: [f64; STAGES],
    /// State and Φ of a stage, and then those at the end of a trial.
    next: Aligned,
    next_rows: Aligned,
    scratch: Scratch,
}

/// What is kept from before a step, and what errors are summed in.
struct Scratch {
    stage_jacobian: DMatrix<f64>,
    first_slope: Vec<f64>,
    first_row_slope: Vec<f64>,
    /// Two estimates of the error of the state, then of one of Φ.
    estimates: [Vec<f64>; 2],
    row_estimates: [Aligned; 2],
    /// Sums over columns.
    sums: [Vec<f64>; 3],
}

/// Steps whose loops over columns are compiled for the widest vectors of the machine. A closure would not do: it is not
/// inlined into what is compiled for them.
struct Steps<'k, 'a, S, F, const MATRIX: bool> {
    kernel: &'k mut Kernel<'a, S, MATRIX>,
    end: f64,
    growth: f64,
    integrand: F,
}

impl<S, F, const MATRIX: bool> pulp::WithSimd for Steps<'_, '_, S, F, MATRIX>
where
    S: VectorField,
    F: Fn(&Piece, &[f64]) -> f64,
{
    type Output = Result<Progress, FlowError>;

    #[inline(always)]
    fn with_simd<V: pulp::Simd>(self, _: V) -> Self::Output {
        let Self { kernel, end, growth, integrand } = self;
        // Loops of a length that the compiler knows are half as long again as quick at these sizes. Asked of the system, which
        // often knows it when it is compiled, the others are not made.
        match kernel.system.dimension() {
            2 => kernel.steps::<V, 2, 4>(end, growth, integrand),
            3 => kernel.steps::<V, 3, 9>(end, growth, integrand),
            4 => kernel.steps::<V, 4, 16>(end, growth, integrand),
            6 => kernel.steps::<V, 6, 36>(end, growth, integrand),
            8 => kernel.steps::<V, 8, 64>(end, growth, integrand),
            _ => kernel.steps::<V, ANY, ANY>(end, growth, integrand),
        }
    }
}

impl<'a, S: VectorField, const MATRIX: bool> Kernel<'a, S, MATRIX> {
    pub(super) fn start(
        flow: &VariationalFlow<'a, S>,
        p: &DVector<f64>,
        duration: f64,
    ) -> Result<Self, FlowError> {
        let (tableau, error) = Tableau::dop853();
        let (system, FlowTolerances { relative, absolute }) = (flow.system, flow.tolerances);
        let n = p.len();
        // without Φ its numbers are none
        let square = if MATRIX { n * n } else { 0 };
        let side = if MATRIX { n } else { 0 };
        let zeros = |size: usize| vec![0.0; size];
        let mut rows = Aligned::zeros(square);
        if MATRIX {
            identity(&mut rows, n);
        }
        let mut state = Aligned::zeros(n);
        state.copy_from_slice(p.as_slice());
        let mut kernel = Self {
            system,
            n,
            tableau,
            error,
            relative,
            absolute: flow.scale.state.iter().map(|scale| scale * absolute).collect(),
            integral_tolerance: flow.scale.cost * absolute,
            max_steps: flow.max_steps,
            budget: flow.budget,
            reported: 0,
            origin: flow.origin,
            domain: flow.domain,
            t: 0.0,
            state,
            rows,
            integral: 0.0,
            work: Work::default(),
            piece: system.piece(p.as_slice()),
            stops_at_switches: false,
            watch: Watch::new(system.n_switches(), n),
            h: 0.0,
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
        };
        if !kernel.first_stage::<pulp::Scalar, ANY>(0.0) {
            return Err(kernel.non_finite());
        }
        kernel.h = kernel.first_step_size().min(duration.abs()).copysign(duration);
        if system.n_switches() > 0 {
            kernel.watch_here();
        }
        Ok(kernel)
    }

    /// Continues with Φ = 1 from here.
    pub(super) fn restart_matrix(&mut self) {
        let n = self.n;
        identity(&mut self.rows, n);
        for (i, row) in self.row_slopes[..n * n].chunks_exact_mut(n).enumerate() {
            row.iter_mut().zip(self.jacobian.row(i).iter()).for_each(|(slope, d)| *slope = *d);
        }
    }

    /// Steps to `end`, and gives `each` the factors of Φ on the way, ended where they stretch or shrink by more than `growth`.
    pub(super) fn links_to(
        &mut self,
        end: f64,
        growth: f64,
        mut each: impl FnMut(Transition),
    ) -> Result<(), FlowError> {
        loop {
            let start = self.t;
            let progress = self.advance(end, growth, nothing)?;
            each(Transition { duration: self.t - start, end: self.point(), matrix: self.matrix() });
            self.restart_matrix();
            if progress == Progress::Arrived {
                return Ok(());
            }
        }
    }

    /// Counts the work from zero again.
    pub(super) fn take_work(&mut self) -> Work {
        self.reported = 0;
        std::mem::take(&mut self.work)
    }

    /// p.
    pub(super) fn point(&self) -> DVector<f64> {
        DVector::from_column_slice(&self.state)
    }

    /// Φ.
    pub(super) fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.n, self.n, &self.rows)
    }

    pub(super) fn run(
        &mut self,
        end: f64,
        integrand: impl Fn(&Piece, &[f64]) -> f64,
    ) -> Result<(), FlowError> {
        self.advance(end, f64::INFINITY, integrand).map(|_| ())
    }

    /// Steps to `end`, or to the end of the step in which Φ stretches or shrinks by more than `growth`.
    pub(super) fn advance(
        &mut self,
        end: f64,
        growth: f64,
        integrand: impl Fn(&Piece, &[f64]) -> f64,
    ) -> Result<Progress, FlowError> {
        let progress = pulp::Arch::new().dispatch(Steps { kernel: self, end, growth, integrand });
        if let Some(budget) = self.budget {
            budget.spend(self.work.evaluations - self.reported);
            self.reported = self.work.evaluations;
        }
        progress
    }

    #[inline(always)]
    fn steps<V: pulp::Simd, const N: usize, const SQUARE: usize>(
        &mut self,
        end: f64,
        growth: f64,
        integrand: impl Fn(&Piece, &[f64]) -> f64,
    ) -> Result<Progress, FlowError> {
        let n = if N == ANY { self.n } else { N };
        let square = if MATRIX { n * n } else { 0 };
        let mut rejected = false;
        while self.t != end {
            if self.work.steps + self.work.rejected >= self.max_steps {
                let (t, steps) = (self.t, self.work.steps);
                return Err(FlowError::TooManySteps { t, state: self.state.to_vec(), steps });
            }
            self.report()?;
            let left = end - self.t;
            let mut last = left.abs() <= 1.01 * self.h.abs();
            // two equal steps rather than a long and a tiny one
            let mut h = if last {
                left
            } else if left.abs() < 2.0 * self.h.abs() {
                0.5 * left
            } else {
                self.h
            };
            if h.abs() <= 8.0 * f64::EPSILON * self.t.abs() || h.abs() < f64::MIN_POSITIVE {
                return Err(if self.work.rejected > 0 && !self.stages_are_finite() {
                    self.non_finite()
                } else {
                    FlowError::StepUnderflow { t: self.t, state: self.state.to_vec() }
                });
            }
            let limit = if rejected { 1.0 } else { 6.0 };
            // of the trial that decides, and the piece that its step leads to, where it leads to another one
            let (mut accepted, mut entered) = (None, None);
            let factor = loop {
                // compiled once: a second trial goes to the end of the piece
                let size = self.trial::<V, N, SQUARE>(h, &integrand);
                if let Some(factor) = accepted {
                    entered = Some(self.system.next_piece(&self.piece, &self.next));
                    break factor;
                }
                // a NaN counts as far too large
                let factor =
                    if size.is_finite() { (0.9 / size.sqrt().sqrt().sqrt()).clamp(0.2, limit) } else { 0.2 };
                if size.is_nan() || size > 1.0 {
                    break factor;
                }
                accepted = Some(factor);
                if self.system.n_switches() == 0 {
                    break factor;
                }
                let Some(size) = self.end_of_piece(h)? else { break factor };
                (last, h) = (last && size == h, size);
            };
            if accepted.is_none() {
                self.work.rejected += 1;
                self.h = h * factor.min(0.9);
                rejected = true;
                continue;
            }
            let gain = self.combine_scalar(self.tableau.weights());
            self.scratch.first_slope.copy_from_slice(&self.slopes[..n]);
            self.scratch.first_row_slope.copy_from_slice(&self.row_slopes[..square]);
            self.swap();
            let before = entered.map(|next| std::mem::replace(&mut self.piece, next));
            let arrived = if last { end } else { self.t + h };
            if !self.first_stage::<V, N>(arrived) {
                self.swap();
                self.slopes[..n].copy_from_slice(&self.scratch.first_slope);
                self.row_slopes[..square].copy_from_slice(&self.scratch.first_row_slope);
                if let Some(before) = before {
                    self.piece = before;
                }
                self.work.rejected += 1;
                self.h = 0.2 * h;
                rejected = true;
                continue;
            }
            self.integral += h * gain;
            self.work.steps += 1;
            self.t = arrived;
            // a step cut short to arrive says nothing against the size before it
            self.h = if h.abs() < self.h.abs() {
                self.h.abs().max((h * factor).abs()).copysign(h)
            } else {
                h * factor
            };
            rejected = false;
            if self.domain.is_some_and(|domain| leaves(domain, &self.state)) {
                return Err(FlowError::LeftDomain { t: self.t, state: self.state.to_vec() });
            }
            match before {
                Some(before) => {
                    self.watch_here();
                    // an end of the piece may lead back into it
                    if before != self.piece {
                        self.work.switches += 1;
                        if self.stops_at_switches && self.t != end {
                            return Ok(Progress::Switched);
                        }
                    }
                }
                None => self.watch.arrive(),
            }
            if MATRIX && growth.is_finite() && self.t != end && self.spread() > growth {
                return Ok(Progress::Grown);
            }
        }
        Ok(Progress::Arrived)
    }

    /// Exchanges the point that the kernel is at with that at the end of a trial.
    fn swap(&mut self) {
        std::mem::swap(&mut self.state, &mut self.next);
        std::mem::swap(&mut self.rows, &mut self.next_rows);
    }

    /// Tells the budget what has been spent, every few steps: a look at the clock costs as much as an evaluation.
    #[inline(always)]
    fn report(&mut self) -> Result<(), FlowError> {
        let Some(budget) = self.budget else { return Ok(()) };
        if self.reported > 0 && self.work.evaluations - self.reported < EVALUATIONS_BETWEEN_REPORTS {
            return Ok(());
        }
        budget.spend(self.work.evaluations - self.reported);
        self.reported = self.work.evaluations;
        match budget.reached() {
            Some(limit) => Err(FlowError::LimitReached { limit, t: self.t, state: self.state.to_vec() }),
            None => Ok(()),
        }
    }

    /// How far Φ stretches or shrinks: its largest entry, or the inverse of the smallest part of a column that the columns
    /// before it do not have.
    fn spread(&mut self) -> f64 {
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

    /// Slopes at the current state, at a time since the start of the run; false if they are not finite.
    #[inline(always)]
    fn first_stage<V: pulp::Simd, const N: usize>(&mut self, t: f64) -> bool {
        let n = if N == ANY { self.n } else { N };
        self.work.evaluations += 1;
        let slope = &mut self.slopes[..n];
        if MATRIX {
            let row_slope = &mut self.row_slopes[..n * n];
            let (t, d) = (self.origin + t, &mut self.jacobian);
            self.system.linearize_at(t, &self.piece, &self.state[..n], slope, d);
            let d = &self.jacobian.as_slice()[..n * n];
            self.system.tangent(n, d, &self.rows[..n * n], row_slope, multiply_add::<V>);
        } else {
            self.system.field_at(self.origin + t, &self.piece, &self.state[..n], slope);
        }
        self.slopes[..n].iter().sum::<f64>().is_finite() && (!MATRIX || is_finite(&self.row_slopes[..n * n]))
    }

    /// One step of size h from the slopes at the current state, to `next` and `next_rows`; the error in units of the
    /// tolerance.
    #[inline(always)]
    fn trial<V: pulp::Simd, const N: usize, const SQUARE: usize>(
        &mut self,
        h: f64,
        integrand: &impl Fn(&Piece, &[f64]) -> f64,
    ) -> f64 {
        let n = if N == ANY { self.n } else { N };
        let square = if MATRIX { n * n } else { 0 };
        self.integrands[0] = integrand(&self.piece, &self.state);
        for i in 1..STAGES {
            let row = self.tableau.row(i);
            // a point of a size that the compiler knows stays in registers
            let mut known = [0.0; N];
            let p = if N == ANY { &mut self.next[..n] } else { &mut known[..] };
            combine::<V, N>(Some(&self.state[..n]), &self.slopes, row, h, p);
            let slope = &mut self.slopes[i * n..(i + 1) * n];
            let t = self.origin + self.t + self.tableau.node(i) * h;
            if MATRIX {
                // before the field, whose latency it fills
                let next_rows = &mut self.next_rows[..square];
                combine::<V, SQUARE>(Some(&self.rows[..square]), &self.row_slopes, row, h, next_rows);
                let variation = (&*next_rows, &mut self.row_slopes[i * square..(i + 1) * square]);
                let d = &mut self.scratch.stage_jacobian;
                self.system.variation_at(t, &self.piece, p, slope, d, variation, multiply_add::<V>);
            } else {
                self.system.field_at(t, &self.piece, p, slope);
            }
            self.integrands[i] = integrand(&self.piece, p);
        }
        self.work.evaluations += STAGES - 1;
        let weights = self.tableau.weights();
        combine::<V, N>(Some(&self.state[..n]), &self.slopes, weights, h, &mut self.next[..n]);
        if MATRIX {
            let next_rows = &mut self.next_rows[..square];
            combine::<V, SQUARE>(Some(&self.rows[..square]), &self.row_slopes, weights, h, next_rows);
        }
        self.error_of::<V, N, SQUARE>(h)
    }

    fn combine_scalar(&self, row: &[(usize, f64)]) -> f64 {
        row.iter().map(|&(j, a)| a * self.integrands[j]).sum()
    }

    /// The estimate of Hairer, Nørsett and Wanner, II.10: e₅²/√(e₅² + e₃²/100) in root mean square, the largest of state,
    /// columns of Φ and integral.
    #[inline(always)]
    fn error_of<V: pulp::Simd, const N: usize, const SQUARE: usize>(&mut self, h: f64) -> f64 {
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

    /// From the size of the slope against that of the state, and of D: the estimate of Hairer, Nørsett and Wanner, II.4,
    /// without its trial step.
    fn first_step_size(&self) -> f64 {
        let (relative, absolute) = (self.relative, &self.absolute);
        let mut rate = 0.0f64;
        for i in 0..self.n {
            let slope = self.slopes[i].abs();
            rate =
                rate.max(slope / (absolute[i] / relative + self.state[i].abs()).max(slope.min(1.0) * 1e-2));
        }
        if MATRIX {
            // ‖D‖ grows with the choice of units, √‖D²‖ less so
            rate = rate.max((&self.jacobian * &self.jacobian).amax().sqrt());
        }
        if rate > 0.0 { 2.0 * relative.powf(0.125) / rate } else { f64::MAX }
    }

    fn fields_are_finite(&self) -> bool {
        self.slopes.chunks_exact(self.n).all(|k| k.iter().sum::<f64>().is_finite())
    }

    fn stages_are_finite(&self) -> bool {
        self.fields_are_finite() && is_finite(&self.row_slopes)
    }

    fn non_finite(&self) -> FlowError {
        let quantity = if self.fields_are_finite() { "Jacobian" } else { "field" };
        let source = self.system.fault(&self.state);
        FlowError::NonFinite { quantity, t: self.t, state: self.state.to_vec(), source }
    }
}

/// Whether a point is outside of a box by more than rounding.
fn leaves(domain: &[[f64; 2]], state: &[f64]) -> bool {
    domain.iter().zip(state).any(|(&[low, high], x)| {
        let width = high - low;
        let slack = if width.is_finite() { OUTSIDE * width } else { 0.0 };
        *x < low - slack || *x > high + slack
    })
}

/// How far outside of its domain a point counts as gone, in widths of the domain: motions along its boundary are inside.
const OUTSIDE: f64 = 1e-9;

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
