//! The steps of DOP853 on a state, its transition matrix and one integral.

mod rows;
mod switching;

use super::{FlowError, Tolerances, VariationalFlow, Work};
use crate::budget::Budget;
use crate::gram_schmidt::orthonormalise;
use crate::system::{Piece, VectorField};
use nalgebra::{ArrayStorage, SMatrix, SVector};
use rows::{Rows, combine, identity, is_finite, multiply_add};
use somersault_integrators::tableau::{ErrorWeights, Tableau};
use switching::{Ahead, Watch};

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

pub(super) struct Kernel<'a, S, const N: usize, const MATRIX: bool> {
    system: &'a S,
    tableau: &'static Tableau,
    error: &'static ErrorWeights,
    relative: f64,
    /// In each entry of the state.
    absolute: SVector<f64, N>,
    /// In the integral.
    integral_tolerance: f64,
    max_steps: usize,
    budget: Option<&'a Budget>,
    /// Evaluations that the budget knows of.
    reported: usize,
    pub(super) t: f64,
    pub(super) state: SVector<f64, N>,
    /// Φ.
    rows: Rows<N>,
    pub(super) integral: f64,
    pub(super) work: Work,
    /// The piece of the field that steps are made in.
    pub(super) piece: Piece<N>,
    /// Whether to come back where a piece ends.
    pub(super) stops_at_switches: bool,
    watch: Watch<N>,
    /// The next step size, with the sign of the direction.
    h: f64,
    /// D at the current state, to restart Φ without an evaluation.
    jacobian: SMatrix<f64, N, N>,
    states: [SVector<f64, N>; STAGES],
    row_slopes: [Rows<N>; STAGES],
    integrands: [f64; STAGES],
}

/// Steps whose loops over columns are compiled for the widest vectors of the machine. A closure would not do: it is not
/// inlined into what is compiled for them.
struct Steps<'k, 'a, S, F, const N: usize, const MATRIX: bool> {
    kernel: &'k mut Kernel<'a, S, N, MATRIX>,
    end: f64,
    growth: f64,
    integrand: F,
}

impl<S, F, const N: usize, const MATRIX: bool> pulp::WithSimd for Steps<'_, '_, S, F, N, MATRIX>
where
    S: VectorField<N>,
    F: Fn(&Piece<N>, &SVector<f64, N>) -> f64,
{
    type Output = Result<Progress, FlowError>;

    #[inline(always)]
    fn with_simd<V: pulp::Simd>(self, _: V) -> Self::Output {
        self.kernel.steps::<V>(self.end, self.growth, self.integrand)
    }
}

impl<'a, S: VectorField<N>, const N: usize, const MATRIX: bool> Kernel<'a, S, N, MATRIX> {
    pub(super) fn start(
        flow: &VariationalFlow<'a, S, N>,
        p: &SVector<f64, N>,
        duration: f64,
    ) -> Result<Self, FlowError> {
        let (tableau, error) = Tableau::dop853();
        let (system, Tolerances { relative, absolute }) = (flow.system, flow.tolerances);
        let mut kernel = Self {
            system,
            tableau,
            error,
            relative,
            absolute: flow.scale.state * absolute,
            integral_tolerance: flow.scale.cost * absolute,
            max_steps: flow.max_steps,
            budget: flow.budget,
            reported: 0,
            t: 0.0,
            state: *p,
            rows: identity(),
            integral: 0.0,
            work: Work::default(),
            piece: system.piece(p),
            stops_at_switches: false,
            watch: Watch::default(),
            h: 0.0,
            jacobian: SMatrix::zeros(),
            states: [SVector::zeros(); STAGES],
            row_slopes: [[[0.0; N]; N]; STAGES],
            integrands: [0.0; STAGES],
        };
        if !kernel.first_stage::<pulp::Scalar>() {
            return Err(kernel.non_finite());
        }
        kernel.h = kernel.first_step_size().min(duration.abs()).copysign(duration);
        if system.n_switches() > 0 {
            kernel.watch = kernel.watch(&kernel.piece, p, &kernel.states[0], kernel.h);
        }
        Ok(kernel)
    }

    /// Continues with Φ = 1 from here.
    pub(super) fn restart_matrix(&mut self) {
        self.rows = identity();
        self.row_slopes[0] = self.jacobian.transpose().data.0;
    }

    /// Φ.
    pub(super) fn matrix(&self) -> SMatrix<f64, N, N> {
        SMatrix::from_array_storage(ArrayStorage(self.rows)).transpose()
    }

    pub(super) fn run(
        &mut self,
        end: f64,
        integrand: impl Fn(&Piece<N>, &SVector<f64, N>) -> f64,
    ) -> Result<(), FlowError> {
        self.advance(end, f64::INFINITY, integrand).map(|_| ())
    }

    /// Steps to `end`, or to the end of the step in which Φ stretches or shrinks by more than `growth`.
    pub(super) fn advance(
        &mut self,
        end: f64,
        growth: f64,
        integrand: impl Fn(&Piece<N>, &SVector<f64, N>) -> f64,
    ) -> Result<Progress, FlowError> {
        let progress = pulp::Arch::new().dispatch(Steps { kernel: self, end, growth, integrand });
        if let Some(budget) = self.budget {
            budget.spend(self.work.evaluations - self.reported);
            self.reported = self.work.evaluations;
        }
        progress
    }

    #[inline(always)]
    fn steps<V: pulp::Simd>(
        &mut self,
        end: f64,
        growth: f64,
        integrand: impl Fn(&Piece<N>, &SVector<f64, N>) -> f64,
    ) -> Result<Progress, FlowError> {
        let mut rejected = false;
        // a step to a minimum of a margin
        let mut cut: Option<f64> = None;
        while self.t != end {
            if self.work.steps + self.work.rejected >= self.max_steps {
                let (t, steps) = (self.t, self.work.steps);
                return Err(FlowError::TooManySteps { t, state: self.state.as_slice().to_vec(), steps });
            }
            self.report()?;
            let left = end - self.t;
            let mut last = cut.is_none() && left.abs() <= 1.01 * self.h.abs();
            // two equal steps rather than a long and a tiny one
            let mut h = if let Some(size) = cut.take() {
                size
            } else if last {
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
                    FlowError::StepUnderflow { t: self.t, state: self.state.as_slice().to_vec() }
                });
            }
            let (mut state, mut rows, size) = self.trial::<V>(h, &integrand);
            let limit = if rejected { 1.0 } else { 6.0 };
            // a NaN counts as far too large
            let factor =
                if size.is_finite() { (0.9 / size.sqrt().sqrt().sqrt()).clamp(0.2, limit) } else { 0.2 };
            if size.is_nan() || size > 1.0 {
                self.work.rejected += 1;
                self.h = h * factor.min(0.9);
                rejected = true;
                continue;
            }
            let before = (self.state, self.rows, self.states[0], self.row_slopes[0], self.piece);
            let mut watch = self.watch;
            if self.system.n_switches() > 0 {
                match self.ahead(h, &state) {
                    Ahead::Smooth(then) => watch = then,
                    Ahead::Minimum(size) => {
                        self.work.rejected += 1;
                        cut = Some(size);
                        continue;
                    }
                    Ahead::End(size) => {
                        (last, h) = (last && size == h, size);
                        (state, rows, _) = self.trial::<V>(h, &integrand);
                        self.piece = self.system.next_piece(&self.piece, &state);
                    }
                }
            }
            let gain = self.combine_scalar(self.tableau.weights());
            (self.state, self.rows) = (state, rows);
            if !self.first_stage::<V>() {
                (self.state, self.rows, self.states[0], self.row_slopes[0], self.piece) = before;
                self.work.rejected += 1;
                self.h = 0.2 * h;
                rejected = true;
                continue;
            }
            self.integral += h * gain;
            self.work.steps += 1;
            self.t = if last { end } else { self.t + h };
            // a step cut short to arrive says nothing against the size before it
            self.h = if h.abs() < self.h.abs() {
                self.h.abs().max((h * factor).abs()).copysign(h)
            } else {
                h * factor
            };
            rejected = false;
            self.watch = watch;
            if self.piece != before.4 {
                self.work.switches += 1;
                self.watch = self.watch(&self.piece, &self.state, &self.states[0], self.h);
                if self.stops_at_switches && self.t != end {
                    return Ok(Progress::Switched);
                }
            }
            if MATRIX && growth.is_finite() && self.t != end && self.spread() > growth {
                return Ok(Progress::Grown);
            }
        }
        Ok(Progress::Arrived)
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
            Some(limit) => {
                Err(FlowError::LimitReached { limit, t: self.t, state: self.state.as_slice().to_vec() })
            }
            None => Ok(()),
        }
    }

    /// How far Φ stretches or shrinks: its largest entry, or the inverse of the smallest part of a column that the columns
    /// before it do not have.
    fn spread(&self) -> f64 {
        let matrix = self.matrix();
        let (_, r) = orthonormalise::<1, N>(matrix);
        let smallest = (0..N).fold(f64::INFINITY, |m, j| m.min(r[(j, j)]));
        matrix.amax().max(1.0 / smallest)
    }

    /// Slopes at the current state; false if they are not finite.
    #[inline(always)]
    fn first_stage<V: pulp::Simd>(&mut self) -> bool {
        self.work.evaluations += 1;
        if MATRIX {
            let (field, jacobian) = self.system.linearize_in(&self.piece, &self.state);
            self.states[0] = field;
            self.jacobian = jacobian;
            self.system.tangent(&jacobian, &self.rows, &mut self.row_slopes[0], multiply_add::<V>);
        } else {
            self.states[0] = self.system.field_in(&self.piece, &self.state);
        }
        self.states[0].sum().is_finite() && (!MATRIX || is_finite(&self.row_slopes[0]))
    }

    /// One step of size h from the slopes at the current state: state, Φ, and the error in units of the tolerance.
    #[inline(always)]
    fn trial<V: pulp::Simd>(
        &mut self,
        h: f64,
        integrand: &impl Fn(&Piece<N>, &SVector<f64, N>) -> f64,
    ) -> (SVector<f64, N>, Rows<N>, f64) {
        self.integrands[0] = integrand(&self.piece, &self.state);
        let mut rows = [[0.0; N]; N];
        for i in 1..STAGES {
            let row = self.tableau.row(i);
            let state = self.combine_state::<V>(row, h);
            if MATRIX {
                // before the field, whose latency it fills
                combine::<V, N>(&self.rows, &self.row_slopes, row, h, &mut rows);
                let (field, jacobian) = self.system.linearize_in(&self.piece, &state);
                self.states[i] = field;
                self.system.tangent(&jacobian, &rows, &mut self.row_slopes[i], multiply_add::<V>);
            } else {
                self.states[i] = self.system.field_in(&self.piece, &state);
            }
            self.integrands[i] = integrand(&self.piece, &state);
        }
        self.work.evaluations += STAGES - 1;
        let weights = self.tableau.weights();
        let state = self.combine_state::<V>(weights, h);
        if MATRIX {
            combine::<V, N>(&self.rows, &self.row_slopes, weights, h, &mut rows);
        }
        let size = self.error_of::<V>(h, &state, &rows);
        (state, rows, size)
    }

    #[inline(always)]
    fn combine_state<V: pulp::Simd>(&self, row: &[(usize, f64)], h: f64) -> SVector<f64, N> {
        let mut sum = SVector::<f64, N>::zeros();
        for &(j, a) in row {
            for i in 0..N {
                sum[i] = multiply_add::<V>(a, self.states[j][i], sum[i]);
            }
        }
        self.state + sum * h
    }

    fn combine_scalar(&self, row: &[(usize, f64)]) -> f64 {
        row.iter().map(|&(j, a)| a * self.integrands[j]).sum()
    }

    /// The estimate of Hairer, Nørsett and Wanner, II.10: e₅²/√(e₅² + e₃²/100) in root mean square, the largest of state,
    /// columns of Φ and integral.
    #[inline(always)]
    fn error_of<V: pulp::Simd>(&self, h: f64, state: &SVector<f64, N>, rows: &Rows<N>) -> f64 {
        let (relative, absolute) = (self.relative, &self.absolute);
        // a pair without a second estimate has none of its weights
        let correction = self.error.correction().unwrap_or(&[]);
        let (mut fifth, mut third) = (0.0, 0.0);
        let (mut e5, mut e3) = (SVector::<f64, N>::zeros(), SVector::<f64, N>::zeros());
        for &(j, a) in self.error.main() {
            e5 += self.states[j] * a;
        }
        for &(j, a) in correction {
            e3 += self.states[j] * a;
        }
        for i in 0..N {
            let scale = absolute[i] + relative * self.state[i].abs().max(state[i].abs());
            fifth += (e5[i] / scale).powi(2);
            third += (e3[i] / scale).powi(2);
        }
        let mut size = ratio(fifth, third, N);
        if MATRIX {
            let none = [[0.0; N]; N];
            let (mut e5, mut e3) = (none, none);
            combine::<V, N>(&none, &self.row_slopes, self.error.main(), 1.0, &mut e5);
            combine::<V, N>(&none, &self.row_slopes, correction, 1.0, &mut e3);
            let (mut fifth, mut third, mut large) = ([0.0; N], [0.0; N], [f64::MIN_POSITIVE; N]);
            for i in 0..N {
                for c in 0..N {
                    fifth[c] = multiply_add::<V>(e5[i][c], e5[i][c], fifth[c]);
                    third[c] = multiply_add::<V>(e3[i][c], e3[i][c], third[c]);
                    large[c] = large[c].max(self.rows[i][c].abs()).max(rows[i][c].abs());
                }
            }
            for c in 0..N {
                let scale = (relative * large[c]).powi(-2);
                size = larger(size, ratio(fifth[c] * scale, third[c] * scale, N));
            }
        }
        let scale =
            self.integral_tolerance + relative * self.integral.abs().max((h * self.integrands[0]).abs());
        let main = self.combine_scalar(self.error.main());
        if main != 0.0 && scale > 0.0 {
            size = larger(
                size,
                ratio((main / scale).powi(2), (self.combine_scalar(correction) / scale).powi(2), 1),
            );
        }
        h.abs() * size
    }

    /// From the size of the slope against that of the state, and of D: the estimate of Hairer, Nørsett and Wanner, II.4,
    /// without its trial step.
    fn first_step_size(&self) -> f64 {
        let (relative, absolute) = (self.relative, &self.absolute);
        let mut rate = 0.0f64;
        for i in 0..N {
            let slope = self.states[0][i].abs();
            rate =
                rate.max(slope / (absolute[i] / relative + self.state[i].abs()).max(slope.min(1.0) * 1e-2));
        }
        if MATRIX {
            // ‖D‖ grows with the choice of units, √‖D²‖ less so
            rate = rate.max((self.jacobian * self.jacobian).amax().sqrt());
        }
        if rate > 0.0 { 2.0 * relative.powf(0.125) / rate } else { f64::MAX }
    }

    fn fields_are_finite(&self) -> bool {
        self.states.iter().all(|k| k.sum().is_finite())
    }

    fn stages_are_finite(&self) -> bool {
        self.fields_are_finite() && (!MATRIX || self.row_slopes.iter().all(is_finite))
    }

    fn non_finite(&self) -> FlowError {
        let quantity = if self.fields_are_finite() { "Jacobian" } else { "field" };
        let source = self.system.fault(&self.state);
        FlowError::NonFinite { quantity, t: self.t, state: self.state.as_slice().to_vec(), source }
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
