//! What a solver says: status, iterate, residuals and counts.

use std::fmt;
use std::ops::AddAssign;

/// How a solve ended. In every case the report has the best iterate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Status {
    /// All residuals are within their tolerances.
    Converged,
    /// No step makes further progress; rounding often, see the residuals.
    Stalled,
    /// The limit of iterations came first.
    IterationLimit,
    /// The limit of evaluations came first.
    EvaluationLimit,
    /// The limit of time came first.
    TimeLimit,
    /// Violations of constraints are stationary: no small step reduces the sum of their squares. The program may
    /// have feasible points elsewhere.
    Infeasible,
    /// The cost fell below every reasonable value at feasible points.
    Unbounded,
    /// Cost, constraints or derivatives have no finite value at the start.
    Undefined,
    /// The callback asked to stop.
    Stopped,
    /// The solve was stopped early from outside.
    Interrupted,
    /// A function of the user failed; its error comes beside the report.
    Failed,
}

impl Status {
    /// One sentence.
    pub fn message(self) -> &'static str {
        match self {
            Self::Converged => "converged: all residuals are within their tolerances",
            Self::Stalled => "no step makes further progress",
            Self::IterationLimit => "the limit of iterations was reached",
            Self::EvaluationLimit => "the limit of evaluations was reached",
            Self::TimeLimit => "the limit of time was reached",
            Self::Infeasible => "locally infeasible: no small step reduces the violation of the constraints",
            Self::Unbounded => "the cost is unbounded below",
            Self::Undefined => "the program has no finite value at the start",
            Self::Stopped => "stopped by the callback",
            Self::Interrupted => "interrupted; this is the best iterate until then",
            Self::Failed => "a function of the user failed",
        }
    }

    /// Whether derivatives that are wrong would end a solve so: without a solution, and by no one's wish.
    pub fn is_suspect(self) -> bool {
        match self {
            Self::Stalled | Self::IterationLimit | Self::Infeasible | Self::Unbounded | Self::Undefined => {
                true
            }
            Self::Converged
            | Self::EvaluationLimit
            | Self::TimeLimit
            | Self::Stopped
            | Self::Interrupted
            | Self::Failed => false,
        }
    }

    /// Whether it is [`Status::Converged`].
    pub fn is_converged(self) -> bool {
        self == Self::Converged
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.message())
    }
}

/// Residuals of the conditions of Karush, Kuhn and Tucker.
///
/// ```text
/// stationarity     ‖∇f + Jᵀ y + y_z‖∞ / s,   s = max(100, ‖∇f(z₀)‖∞, mean |y|, |y_z|) / 100
/// feasibility      max over constraints and bounds of violation / max(1, |bound|)
/// complementarity  max |multiplier| · distance to its bound / s
/// ```
/// z₀ is the start. The scale s is that of IPOPT (Wächter & Biegler 2006, equation 6, and its scaling of
/// costs with large gradients).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct KktResiduals {
    /// Of the gradient of the Lagrangian.
    pub stationarity: f64,
    /// Of constraints and bounds.
    pub feasibility: f64,
    /// Of multipliers and distances to bounds.
    pub complementarity: f64,
}

impl KktResiduals {
    /// The largest.
    pub fn max(&self) -> f64 {
        self.stationarity.max(self.feasibility).max(self.complementarity)
    }

    /// Before anything is known.
    pub(crate) const UNKNOWN: Self =
        Self { stationarity: f64::NAN, feasibility: f64::NAN, complementarity: f64::NAN };
}

/// What a solve cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counts {
    /// Of cost and constraints.
    pub evaluations: usize,
    /// Of first derivatives.
    pub gradients: usize,
    /// Of Hessians that the program offers.
    pub hessians: usize,
    /// Factorisations of KKT matrices.
    pub factorisations: usize,
    /// Quadratic programs that went to the interior-point method.
    pub quadratic_programs: usize,
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.evaluations += other.evaluations;
        self.gradients += other.gradients;
        self.hessians += other.hessians;
        self.factorisations += other.factorisations;
        self.quadratic_programs += other.quadratic_programs;
    }
}

/// Where a solver begins.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Start {
    /// Decision vector; solvers move it within its bounds.
    pub z: Vec<f64>,
    /// One for each constraint, or none: then they are estimated.
    pub constraint_multipliers: Vec<f64>,
    /// One for each variable, or none. With those of the constraints an interior-point method begins near its end.
    pub bound_multipliers: Vec<f64>,
    /// Quasi-Newton approximation from the report of the same solver on a program of the same structure.
    pub hessian: Option<Vec<f64>>,
}

impl From<Vec<f64>> for Start {
    fn from(z: Vec<f64>) -> Self {
        Self { z, ..Self::default() }
    }
}

impl From<&[f64]> for Start {
    fn from(z: &[f64]) -> Self {
        z.to_vec().into()
    }
}

/// What a solver found.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Report {
    /// How it ended.
    pub status: Status,
    /// The best iterate: the last one if converged, stalled or infeasible; else that of the lowest f + ρ · violation, with
    /// the largest Σ |y| of all iterates for ρ. Always within the bounds of z.
    pub z: Vec<f64>,
    /// y, one for each constraint: positive at upper bounds, negative at lower ones.
    pub constraint_multipliers: Vec<f64>,
    /// y_z, one for each variable, with the same signs.
    pub bound_multipliers: Vec<f64>,
    /// f(z); NaN where it has no value.
    pub cost: f64,
    /// At z; NaN where derivatives have no value.
    pub residuals: KktResiduals,
    /// Steps taken.
    pub iterations: usize,
    /// Work done.
    pub counts: Counts,
    /// Quasi-Newton approximation at the end, for a warm start.
    pub hessian: Option<Vec<f64>>,
}

impl Report {
    /// A warm start from here.
    pub fn start(&self) -> Start {
        Start {
            z: self.z.clone(),
            constraint_multipliers: self.constraint_multipliers.clone(),
            bound_multipliers: self.bound_multipliers.clone(),
            hessian: self.hessian.clone(),
        }
    }

    /// The same of a solve that was not stopped by a callback's wish but from outside.
    pub fn interrupted(self) -> Self {
        let status = if self.status == Status::Stopped { Status::Interrupted } else { self.status };
        Self { status, ..self }
    }
}

/// What a callback sees, at the start and after each step.
#[derive(Debug, Clone, Copy)]
pub struct Iteration<'a> {
    /// Steps taken so far.
    pub number: usize,
    /// Decision vector.
    pub z: &'a [f64],
    /// f(z).
    pub cost: f64,
    /// At z.
    pub residuals: KktResiduals,
    /// Fraction of the step that the line search kept; 1 at the start.
    pub step_length: f64,
    /// Multiple of the identity that was added to the Hessian.
    pub shift: f64,
}
