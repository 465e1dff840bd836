//! The steps of DOP853 on a state, its transition matrix and one integral.

mod rows;
mod step;
mod switching;

use super::{FlowError, FlowTolerances, Transition, VariationalFlow, Work};
use crate::budget::Budget;
use crate::system::{Piece, VectorField};
use nalgebra::{DMatrix, DVector};
use rows::{ANY, combine, multiply_add};
use step::Step;
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

/// What is integrated along a motion, if anything is.
pub(super) type Integrand<'f> = Option<&'f dyn Fn(&Piece, &[f64]) -> f64>;

/// A run. `MATRIX` says whether it carries Φ.
///
/// Everything that a step needs lies here from the start: steps allocate nothing.
pub(super) struct Kernel<'a, S, const MATRIX: bool> {
    system: &'a S,
    max_steps: usize,
    budget: Option<&'a Budget>,
    /// Evaluations that the budget knows of.
    reported: usize,
    /// Time of the field at the start of the run.
    origin: f64,
    domain: Option<&'a [[f64; 2]]>,
    pub(super) t: f64,
    pub(super) work: Work,
    /// The piece of the field that steps are made in.
    pub(super) piece: Piece,
    /// Whether to come back where a piece ends.
    pub(super) stops_at_switches: bool,
    watch: Watch,
    /// The next step size, with the sign of the direction.
    h: f64,
    /// What the loops over columns are compiled for: the widest vectors of the machine.
    arch: pulp::Arch,
    numbers: Step,
}

/// The first stage of a step with Φ, at a time since the start of the run.
struct First<'k, 'a, S, const MATRIX: bool>(&'k mut Kernel<'a, S, MATRIX>, f64);

impl<S: VectorField, const MATRIX: bool> pulp::WithSimd for First<'_, '_, S, MATRIX> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: pulp::Simd>(self, _: V) {
        let Self(kernel, t) = self;
        match kernel.system.dimension() {
            2 => kernel.first_by::<V, 2>(t),
            3 => kernel.first_by::<V, 3>(t),
            4 => kernel.first_by::<V, 4>(t),
            6 => kernel.first_by::<V, 6>(t),
            8 => kernel.first_by::<V, 8>(t),
            _ => kernel.first_by::<V, ANY>(t),
        }
    }
}

/// The other stages of a step of size `h`, in loops of a length that the compiler knows, which are half as long again as quick
/// at these sizes. A closure would not do: it is not inlined into what is compiled for the vectors of the machine.
struct Trial<'k, 'a, S, const MATRIX: bool> {
    kernel: &'k mut Kernel<'a, S, MATRIX>,
    h: f64,
    integrand: Integrand<'k>,
}

impl<S: VectorField, const MATRIX: bool> pulp::WithSimd for Trial<'_, '_, S, MATRIX> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<V: pulp::Simd>(self, _: V) -> f64 {
        let Self { kernel, h, integrand } = self;
        // Asked of the system, which often knows it when it is compiled, the others are not made.
        match kernel.system.dimension() {
            2 => kernel.trial_by::<V, 2, 4>(h, integrand),
            3 => kernel.trial_by::<V, 3, 9>(h, integrand),
            4 => kernel.trial_by::<V, 4, 16>(h, integrand),
            6 => kernel.trial_by::<V, 6, 36>(h, integrand),
            8 => kernel.trial_by::<V, 8, 64>(h, integrand),
            _ => kernel.trial_by::<V, ANY, ANY>(h, integrand),
        }
    }
}

impl<'a, S: VectorField, const MATRIX: bool> Kernel<'a, S, MATRIX> {
    pub(super) fn start(
        flow: &VariationalFlow<'a, S>,
        p: &DVector<f64>,
        duration: f64,
    ) -> Result<Self, FlowError> {
        let (system, FlowTolerances { relative, absolute }) = (flow.system, flow.tolerances);
        let in_state = flow.scale.state.iter().map(|scale| scale * absolute).collect();
        let mut kernel = Self {
            system,
            max_steps: flow.max_steps,
            budget: flow.budget,
            reported: 0,
            origin: flow.origin,
            domain: flow.domain,
            t: 0.0,
            work: Work::default(),
            piece: system.piece(p.as_slice()),
            stops_at_switches: false,
            watch: Watch::new(system.n_switches(), p.len()),
            h: 0.0,
            arch: pulp::Arch::new(),
            numbers: Step::new(p.as_slice(), MATRIX, relative, in_state, flow.scale.cost * absolute),
        };
        if !kernel.first_stage(0.0) {
            return Err(kernel.non_finite());
        }
        kernel.h = kernel.numbers.first_step_size().min(duration.abs()).copysign(duration);
        if system.n_switches() > 0 {
            kernel.watch_here();
        }
        Ok(kernel)
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
            let progress = self.advance(end, growth, None)?;
            each(Transition { duration: self.t - start, end: self.point(), matrix: self.matrix() });
            self.numbers.restart_matrix();
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
        DVector::from_column_slice(&self.numbers.state)
    }

    /// Φ.
    pub(super) fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.numbers.n, self.numbers.n, &self.numbers.rows)
    }

    /// The integral on the way here.
    pub(super) fn integral(&self) -> f64 {
        self.numbers.integral
    }

    pub(super) fn run(&mut self, end: f64, integrand: Integrand<'_>) -> Result<(), FlowError> {
        self.advance(end, f64::INFINITY, integrand).map(|_| ())
    }

    /// Steps to `end`, or to the end of the step in which Φ stretches or shrinks by more than `growth`.
    pub(super) fn advance(
        &mut self,
        end: f64,
        growth: f64,
        integrand: Integrand<'_>,
    ) -> Result<Progress, FlowError> {
        let progress = self.steps(end, growth, integrand);
        if let Some(budget) = self.budget {
            budget.spend(self.work.evaluations - self.reported);
            self.reported = self.work.evaluations;
        }
        progress
    }

    fn steps(&mut self, end: f64, growth: f64, integrand: Integrand<'_>) -> Result<Progress, FlowError> {
        let mut rejected = false;
        while self.t != end {
            if self.work.steps + self.work.rejected >= self.max_steps {
                let (t, steps) = (self.t, self.work.steps);
                return Err(FlowError::TooManySteps { t, state: self.numbers.state.to_vec(), steps });
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
                return Err(if self.work.rejected > 0 && !self.numbers.stages_are_finite() {
                    self.non_finite()
                } else {
                    FlowError::StepUnderflow { t: self.t, state: self.numbers.state.to_vec() }
                });
            }
            let limit = if rejected { 1.0 } else { 6.0 };
            // of the trial that decides, and the piece that its step leads to, where it leads to another one
            let (mut accepted, mut entered) = (None, None);
            let factor = loop {
                // compiled once: a second trial goes to the end of the piece
                let size = self.trial(h, integrand);
                if let Some(factor) = accepted {
                    entered = Some(self.system.next_piece(&self.piece, &self.numbers.next));
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
            let gain = self.numbers.make();
            let before = entered.map(|next| std::mem::replace(&mut self.piece, next));
            let arrived = if last { end } else { self.t + h };
            if !self.first_stage(arrived) {
                self.numbers.unmake();
                if let Some(before) = before {
                    self.piece = before;
                }
                self.work.rejected += 1;
                self.h = 0.2 * h;
                rejected = true;
                continue;
            }
            self.numbers.integral += h * gain;
            self.work.steps += 1;
            self.t = arrived;
            // a step cut short to arrive says nothing against the size before it
            self.h = if h.abs() < self.h.abs() {
                self.h.abs().max((h * factor).abs()).copysign(h)
            } else {
                h * factor
            };
            rejected = false;
            if self.domain.is_some_and(|domain| leaves(domain, &self.numbers.state)) {
                return Err(FlowError::LeftDomain { t: self.t, state: self.numbers.state.to_vec() });
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
            if MATRIX && growth.is_finite() && self.t != end && self.numbers.spread() > growth {
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
                Err(FlowError::LimitReached { limit, t: self.t, state: self.numbers.state.to_vec() })
            }
            None => Ok(()),
        }
    }

    /// Slopes at the current state, at a time since the start of the run; false if they are not finite.
    fn first_stage(&mut self, t: f64) -> bool {
        self.work.evaluations += 1;
        if MATRIX {
            let arch = self.arch;
            arch.dispatch(First(self, t));
        } else {
            let x = &mut self.numbers;
            self.system.field_at(self.origin + t, &self.piece, &x.state, &mut x.slopes[..x.n]);
        }
        self.numbers.first_is_finite()
    }

    /// One step of size h from the slopes at the current state, to `next` and `next_rows`; the error in units of the
    /// tolerance.
    fn trial(&mut self, h: f64, integrand: Integrand<'_>) -> f64 {
        self.work.evaluations += STAGES - 1;
        let arch = self.arch;
        let size = arch.dispatch(Trial { kernel: self, h, integrand });
        // once for all systems, but for steps that are so quick that another call is felt
        if MATRIX { self.numbers.finish(arch, h) } else { size }
    }

    #[inline(always)]
    fn first_by<V: pulp::Simd, const N: usize>(&mut self, t: f64) {
        let x = &mut self.numbers;
        let n = if N == ANY { x.n } else { N };
        let (slope, row_slope) = (&mut x.slopes[..n], &mut x.row_slopes[..n * n]);
        self.system.linearize_at(self.origin + t, &self.piece, &x.state[..n], slope, &mut x.jacobian);
        let d = &x.jacobian.as_slice()[..n * n];
        self.system.tangent(n, d, &x.rows[..n * n], row_slope, multiply_add::<V>);
    }

    #[inline(always)]
    fn trial_by<V: pulp::Simd, const N: usize, const SQUARE: usize>(
        &mut self,
        h: f64,
        integrand: Integrand<'_>,
    ) -> f64 {
        let x = &mut self.numbers;
        let n = if N == ANY { x.n } else { N };
        let square = if MATRIX { n * n } else { 0 };
        if let Some(integrand) = integrand {
            x.integrands[0] = integrand(&self.piece, &x.state);
        }
        for i in 1..STAGES {
            let row = x.tableau.row(i);
            // a point of a size that the compiler knows stays in registers
            let mut known = [0.0; N];
            let p = if N == ANY { &mut x.next[..n] } else { &mut known[..] };
            combine::<V, N>(Some(&x.state[..n]), &x.slopes, row, h, p);
            let slope = &mut x.slopes[i * n..(i + 1) * n];
            let t = self.origin + self.t + x.tableau.node(i) * h;
            if MATRIX {
                // before the field, whose latency it fills
                let next_rows = &mut x.next_rows[..square];
                combine::<V, SQUARE>(Some(&x.rows[..square]), &x.row_slopes, row, h, next_rows);
                let variation = (&*next_rows, &mut x.row_slopes[i * square..(i + 1) * square]);
                let d = &mut x.scratch.stage_jacobian;
                self.system.variation_at(t, &self.piece, p, slope, d, variation, multiply_add::<V>);
            } else {
                self.system.field_at(t, &self.piece, p, slope);
            }
            if let Some(integrand) = integrand {
                x.integrands[i] = integrand(&self.piece, p);
            }
        }
        if MATRIX { f64::NAN } else { x.finish_by::<V, N, SQUARE, false>(h) }
    }

    fn non_finite(&self) -> FlowError {
        let quantity = if self.numbers.fields_are_finite() { "Jacobian" } else { "field" };
        let source = self.system.fault(&self.numbers.state);
        FlowError::NonFinite { quantity, t: self.t, state: self.numbers.state.to_vec(), source }
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
