//! State and transition matrix together: ṗ = h(p), Φ̇ = D(p) Φ, Φ = 1 at the start (thesis (8.9), (8.11)).
//!
//! DOP853 with the step size controlled by both: the state relative to each of its entries, Φ relative to the largest entry
//! of each column, which says the same of v(T) = Φ v whatever the units. The steps of the state alone differ from those
//! with Φ, but by no more than the tolerance.
//!
//! Where the singular values of Φ span more than sixteen digits, one matrix does not hold the small ones. A
//! [`Chain`] keeps factors Φ = Φ_K ⋯ Φ₁, each ended where it has stretched or shrunk by a bound.
//!
//! Where a control reaches or leaves a bound the field has a kink. Steps end there ([`Piece`]); Φ has no jump.
//!
//! A run takes its memory at its start, some 20 N (N + 1) numbers for N of a point; its steps allocate nothing. The
//! coefficients are those of `somersault-integrators`.

mod kernel;

use crate::budget::{Budget, Limit};
use crate::system::{OptimalControlSystem, Piece, SystemError, VectorField};
use kernel::{Kernel, Progress};
use nalgebra::{DMatrix, DVector};
use somersault_core::argument::ArgumentError;

/// Accuracy of a run: bounds of the estimated error of each of its steps, not of their sum.
///
/// The error at the end of a run is that of its steps, each carried on by the Φ that follows it: about the number of steps
/// times the tolerance times the growth of Φ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlowTolerances {
    /// Error of a step relative to the size of each entry of the state and of each column of Φ.
    pub relative: f64,
    /// Error of a step that is always allowed in an entry of the state, in the scale of that entry
    /// ([`VariationalFlow::with_scale`]).
    pub absolute: f64,
}

impl Default for FlowTolerances {
    /// 1e-12 and 1e-14.
    fn default() -> Self {
        Self { relative: 1e-12, absolute: 1e-14 }
    }
}

/// Why a run ended before its time.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FlowError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The field or its Jacobian has no value near the state reached.
    #[error("the {quantity} is not finite near t = {t}")]
    NonFinite {
        /// Which of the two: `field` or `Jacobian`.
        quantity: &'static str,
        /// Time since the start of the run.
        t: f64,
        /// Last state with a value.
        state: Vec<f64>,
        /// Why, if the system knows.
        source: Option<SystemError>,
    },
    /// The step size went below the rounding of the time, as where a motion runs off to infinity.
    #[error("the step size underflows at t = {t}")]
    StepUnderflow {
        /// Time since the start of the run.
        t: f64,
        /// Last state.
        state: Vec<f64>,
    },
    /// The search that the run belongs to has reached a limit.
    #[error("{limit} at t = {t}")]
    LimitReached {
        /// The limit.
        limit: Limit,
        /// Time since the start of the run.
        t: f64,
        /// Last state.
        state: Vec<f64>,
    },
    /// The motion has left the domain that it was to stay in.
    #[error("the motion has left the domain at t = {t}")]
    LeftDomain {
        /// Time since the start of the run.
        t: f64,
        /// The first state outside, at the end of a step.
        state: Vec<f64>,
    },
    /// The run needs more steps than allowed.
    #[error("{steps} steps reach only t = {t}")]
    TooManySteps {
        /// Time since the start of the run.
        t: f64,
        /// Last state.
        state: Vec<f64>,
        /// Steps made.
        steps: usize,
    },
}

/// What a run cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Work {
    /// Evaluations of the field, or of field and Jacobian.
    pub evaluations: usize,
    /// Steps accepted.
    pub steps: usize,
    /// Steps rejected.
    pub rejected: usize,
    /// Crossings from one smooth piece of the field to the next.
    pub switches: usize,
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.evaluations += other.evaluations;
        self.steps += other.steps;
        self.rejected += other.rejected;
        self.switches += other.switches;
    }
}

/// The end of a run with its transition matrix, ∂p(t + T)/∂p(t).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Transition {
    /// T, negative backward in time.
    pub duration: f64,
    /// p(t + T).
    pub end: DVector<f64>,
    /// Φ(T, p).
    pub matrix: DMatrix<f64>,
}

impl Transition {
    /// The largest |φᵢᵀJφⱼ − J_ij| / max(1, ‖φᵢ‖‖φⱼ‖) over columns φ of Φ; zero for a symplectic matrix.
    pub fn symplecticity_defect(&self) -> f64 {
        let (n, phi) = (self.matrix.nrows() / 2, &self.matrix);
        let norm: Vec<f64> = phi.column_iter().map(|column| column.norm()).collect();
        let mut defect = 0.0f64;
        for i in 0..norm.len() {
            for j in 0..i {
                let form: f64 =
                    (0..n).map(|k| phi[(k, i)] * phi[(n + k, j)] - phi[(n + k, i)] * phi[(k, j)]).sum();
                let expected = if i == j + n { -1.0 } else { 0.0 };
                defect = defect.max((form - expected).abs() / (norm[i] * norm[j]).max(1.0));
            }
        }
        defect
    }
}

/// Factors of a transition matrix, in the order of time: Φ = Φ_K ⋯ Φ₁.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chain {
    pub(crate) links: Vec<Transition>,
    /// Number of links up to each of the times requested.
    pub(crate) marks: Vec<usize>,
    pub(crate) times: Vec<f64>,
    /// What the run cost.
    pub work: Work,
}

impl Chain {
    /// An empty chain.
    pub fn new() -> Self {
        Self::default()
    }

    /// A chain of given factors, with a mark after each: the segments of a motion known by its nodes.
    pub fn from_links(links: Vec<Transition>) -> Self {
        let marks = (1..=links.len()).collect();
        let times =
            links.iter().scan(0.0, |t, link| Some(std::mem::replace(t, *t + link.duration) + link.duration));
        let times = times.collect();
        Self { links, marks, times, work: Work::default() }
    }

    /// The factors.
    pub fn links(&self) -> &[Transition] {
        &self.links
    }

    /// The times requested, since the start, negative backward.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The factors up to time number `mark`.
    pub fn until(&self, mark: usize) -> &[Transition] {
        &self.links[..self.marks[mark]]
    }
}

/// What [`VariationalFlow::factors`] gives.
#[derive(Debug)]
pub(crate) enum Factor {
    /// The next factor.
    Link(Transition),
    /// The time of this number is reached.
    Mark(usize),
}

/// Integrates a field with its transition matrix, forward and, for a negative duration, backward.
#[derive(Debug)]
pub struct VariationalFlow<'a, S> {
    system: &'a S,
    tolerances: FlowTolerances,
    max_steps: usize,
    scale: Scale,
    budget: Option<&'a Budget>,
    origin: f64,
    domain: Option<&'a [[f64; 2]]>,
}

/// The units in which absolute tolerances count.
#[derive(Debug, Clone, PartialEq)]
struct Scale {
    state: DVector<f64>,
    cost: f64,
}

impl<S> Clone for VariationalFlow<'_, S> {
    fn clone(&self) -> Self {
        Self { scale: self.scale.clone(), ..*self }
    }
}

impl<'a, S: VectorField> VariationalFlow<'a, S> {
    /// A flow of at most 100 000 steps a run. The relative tolerance must be in [1e-15, 0.1], the absolute one not negative.
    pub fn try_new(system: &'a S, tolerances: FlowTolerances) -> Result<Self, FlowError> {
        let FlowTolerances { relative, absolute } = tolerances;
        if !(1e-15..=0.1).contains(&relative) {
            let allowed = "in [1e-15, 0.1]";
            return Err(ArgumentError::OutOfRange { argument: "relative", allowed, found: relative }.into());
        }
        if !(absolute >= 0.0 && absolute.is_finite()) {
            let allowed = "finite and not negative";
            return Err(ArgumentError::OutOfRange { argument: "absolute", allowed, found: absolute }.into());
        }
        let scale = Scale { state: DVector::repeat(system.dimension(), 1.0), cost: 1.0 };
        Ok(Self { system, tolerances, max_steps: 100_000, scale, budget: None, origin: 0.0, domain: None })
    }

    /// With the absolute tolerance in units of `state` for each entry of p and of `cost` for the cost, all positive; one
    /// unless given. What is computed does then not depend on the units that a problem is written in.
    pub fn with_scale(self, state: DVector<f64>, cost: f64) -> Self {
        Self { scale: Scale { state, cost }, ..self }
    }

    /// Within the limits of a search: runs count their evaluations there and end where a limit is reached.
    pub fn within(self, budget: &'a Budget) -> Self {
        Self { budget: Some(budget), ..self }
    }

    /// Allows `max_steps` steps in a run.
    pub fn with_max_steps(self, max_steps: usize) -> Self {
        Self { max_steps, ..self }
    }

    /// With runs that start at time `t` of a field that depends on time; at zero unless given.
    pub fn starting_at(self, t: f64) -> Self {
        Self { origin: t, ..self }
    }

    /// With runs that end where a step has led out of a box, a lower and an upper limit of each entry of p. What is along its
    /// boundary is inside.
    pub fn inside(self, domain: &'a [[f64; 2]]) -> Self {
        Self { domain: Some(domain), ..self }
    }

    /// The time of the field at the start of runs.
    pub fn start(&self) -> f64 {
        self.origin
    }

    /// What has ended the search that runs belong to, if anything has.
    pub(crate) fn ended(&self) -> Option<Limit> {
        self.budget.and_then(Budget::reached)
    }

    /// The system.
    pub fn system(&self) -> &'a S {
        self.system
    }

    /// The tolerances.
    pub fn tolerances(&self) -> FlowTolerances {
        self.tolerances
    }

    /// p(T), without Φ.
    pub fn state(&self, p: &DVector<f64>, duration: f64) -> Result<DVector<f64>, FlowError> {
        let mut kernel = self.kernel::<false>(p, duration)?;
        kernel.run(duration, None)?;
        Ok(kernel.point())
    }

    /// p(T) and Φ(T, p).
    pub fn transition(&self, p: &DVector<f64>, duration: f64) -> Result<Transition, FlowError> {
        self.transition_counted(p, duration).map(|(transition, _)| transition)
    }

    /// p(T) and Φ(T, p), with what they cost.
    pub fn transition_counted(
        &self,
        p: &DVector<f64>,
        duration: f64,
    ) -> Result<(Transition, Work), FlowError> {
        let mut kernel = self.kernel::<true>(p, duration)?;
        kernel.run(duration, None)?;
        Ok((Transition { duration, end: kernel.point(), matrix: kernel.matrix() }, kernel.work))
    }

    /// Factors of Φ up to the last of `times`, with a link ended at each of them and wherever Φ has come to
    /// stretch or shrink by `growth`, into `chain`.
    ///
    /// `times` must be ascending from above zero, or descending from below zero. A `growth` of 100 loses up to four digits
    /// of sixteen in a link.
    pub fn chain_into(
        &self,
        p: &DVector<f64>,
        times: &[f64],
        growth: f64,
        chain: &mut Chain,
    ) -> Result<(), FlowError> {
        let Some(&last) = times.last() else {
            return Err(ArgumentError::OutOfRange {
                argument: "times",
                allowed: "of at least one entry",
                found: 0.0,
            }
            .into());
        };
        let ordered = |pair: &[f64]| (pair[1] - pair[0]) * last > 0.0;
        if let Some(&found) = times.iter().find(|t| !t.is_finite()) {
            return Err(ArgumentError::OutOfRange { argument: "times", allowed: "finite", found }.into());
        }
        if !(times[0] * last > 0.0 && times.windows(2).all(ordered)) {
            let allowed = "monotonic, away from zero, and of one sign";
            return Err(ArgumentError::OutOfRange { argument: "times", allowed, found: times[0] }.into());
        }
        if growth.is_nan() || growth <= 1.0 {
            return Err(ArgumentError::OutOfRange {
                argument: "growth",
                allowed: "above one",
                found: growth,
            }
            .into());
        }
        chain.links.clear();
        chain.marks.clear();
        chain.times.clear();
        let mut kernel = self.kernel::<true>(p, last)?;
        for &time in times {
            kernel.links_to(time, growth, |link| chain.links.push(link))?;
            chain.marks.push(chain.links.len());
            chain.times.push(time);
        }
        chain.work = kernel.work;
        Ok(())
    }

    /// Gives `each` the factors of Φ up to a time and, after the last of them, `mark` its number, for each of `times` in turn, which
    /// are as those of a chain. Factors end as in a chain and are not kept. `max_steps` bounds the steps between times.
    pub(crate) fn factors(
        &self,
        p: &DVector<f64>,
        times: &[f64],
        growth: f64,
        mut each: impl FnMut(Factor),
    ) -> (Work, Result<(), FlowError>) {
        let Some(&last) = times.last() else { return (Work::default(), Ok(())) };
        let mut kernel = match self.kernel::<true>(p, last) {
            Ok(kernel) => kernel,
            Err(error) => return (Work::default(), Err(error)),
        };
        let mut work = Work::default();
        for (mark, &time) in times.iter().enumerate() {
            let done = kernel.links_to(time, growth, |link| each(Factor::Link(link)));
            work += kernel.take_work();
            if let Err(error) = done {
                return (work, Err(error));
            }
            each(Factor::Mark(mark));
        }
        (work, Ok(()))
    }

    /// Where the motion from `p` goes from one smooth piece of the field to the next, with the piece that begins there.
    pub fn switches(&self, p: &DVector<f64>, duration: f64) -> Result<Vec<(f64, Piece)>, FlowError> {
        let mut kernel = self.kernel::<false>(p, duration)?;
        kernel.stops_at_switches = true;
        let mut found = Vec::new();
        while kernel.advance(duration, f64::INFINITY, None)? == Progress::Switched {
            found.push((kernel.t, kernel.piece.clone()));
        }
        Ok(found)
    }

    fn kernel<const MATRIX: bool>(
        &self,
        p: &DVector<f64>,
        duration: f64,
    ) -> Result<Kernel<'a, S, MATRIX>, FlowError> {
        let expected = self.system.dimension();
        for (argument, found) in [("p", p.len()), ("scale", self.scale.state.len())] {
            if found != expected {
                return Err(ArgumentError::Length { argument, expected, found }.into());
            }
        }
        if !duration.is_finite() {
            return Err(ArgumentError::OutOfRange {
                argument: "duration",
                allowed: "finite",
                found: duration,
            }
            .into());
        }
        if let Some(&found) = p.iter().find(|x| !x.is_finite()) {
            return Err(ArgumentError::OutOfRange { argument: "p", allowed: "finite", found }.into());
        }
        Kernel::start(self, p, duration)
    }
}

impl<S: OptimalControlSystem> VariationalFlow<'_, S> {
    /// p(T) and the cost ∫ ℓ(p, u*) dt on the way, by the weights of the step and to the tolerance of the state;
    /// backward in time the cost is negative.
    pub fn cost(&self, p: &DVector<f64>, duration: f64) -> Result<(DVector<f64>, f64), FlowError> {
        let mut kernel = self.kernel::<false>(p, duration)?;
        kernel.run(duration, Some(&|piece, p| self.system.running_cost_in(piece, p)))?;
        Ok((kernel.point(), kernel.integral()))
    }
}
