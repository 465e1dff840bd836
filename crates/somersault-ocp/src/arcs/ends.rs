//! Both ends of an extremal: what is fixed, and the multipliers of what is not.
//!
//! With ℓ = Φ + νᵀb over the end constraints that act, an end of the state that is free has λ(t₀) = −ℓ_x₀ or λ(t_f) = ℓ_x_f, and a
//! free time H(t₀) = ℓ_t₀ or H(t_f) = −ℓ_t_f.

use crate::collocation::{Interval, Phase};
use nalgebra::{DMatrix, DVector};
use somersault_expr::{Derivative, Evaluator, ExprError, ExprFunction};

/// Distance to a bound, relative to the size of a quantity, at which it acts in a collocation solution.
const AT_BOUND: f64 = 1e-6;

/// What is fixed, or held by a bound.
#[derive(Debug, Clone)]
pub(super) struct Ends {
    pub(super) initial: Vec<Option<f64>>,
    pub(super) last: Vec<Option<f64>>,
    pub(super) parameters: Vec<Option<f64>>,
    pub(super) start: Option<f64>,
    pub(super) finish: Option<f64>,
    /// End constraints that act, with what they are then.
    pub(super) constraints: Vec<(usize, f64)>,
}

/// The value that an interval holds a quantity at.
fn held(interval: &Interval, found: f64) -> Option<f64> {
    let near = |bound: f64| bound.is_finite() && (found - bound).abs() <= AT_BOUND * (1.0 + bound.abs());
    if interval.is_fixed() || near(interval.lower) {
        Some(interval.lower)
    } else {
        near(interval.upper).then_some(interval.upper)
    }
}

fn all_held(intervals: &[Interval], found: &[f64]) -> Vec<Option<f64>> {
    intervals.iter().zip(found).map(|(interval, &x)| held(interval, x)).collect()
}

impl Ends {
    /// What holds at the ends of a motion; a state that is held by its bound at all times alone counts as free there, where
    /// a contact has its multiplier.
    pub(super) fn of(
        phase: &Phase,
        [initial, last, parameters]: [&[f64]; 3],
        (start, finish): (f64, f64),
        end_values: &[f64],
    ) -> Self {
        let bounds = &phase.bounds;
        let constraints = bounds.end.iter().zip(end_values).enumerate();
        Self {
            initial: all_held(&bounds.initial_state, initial),
            last: all_held(&bounds.final_state, last),
            parameters: all_held(&bounds.parameters, parameters),
            start: held(&bounds.initial_time, start),
            finish: held(&bounds.final_time, finish),
            constraints: constraints.filter_map(|(k, (b, &x))| held(b, x).map(|value| (k, value))).collect(),
        }
    }
}

/// Φ and b with derivatives.
pub(super) struct EndTerms {
    values: Evaluator,
    jacobian: (Derivative, Evaluator),
    hessian: (Derivative, Evaluator),
}

/// ℓ, its derivatives and the constraints at some ends; arguments are x(t₀), x(t_f), p, t₀, t_f.
pub(super) struct EndValues {
    /// Φ, b.
    pub(super) values: Vec<f64>,
    /// ∂(Φ, b).
    pub(super) by: DMatrix<f64>,
    /// ℓ's gradient and Hessian.
    pub(super) gradient: DVector<f64>,
    pub(super) hessian: DMatrix<f64>,
}

impl EndTerms {
    pub(super) fn try_new(function: &ExprFunction) -> Result<Self, ExprError> {
        let (jacobian, hessian) = (function.jacobian()?, function.hessian()?);
        Ok(Self {
            values: function.evaluator(),
            jacobian: (jacobian.clone(), jacobian.evaluator()),
            hessian: (hessian.clone(), hessian.evaluator()),
        })
    }

    /// At ends, with the multipliers of the constraints.
    pub(super) fn evaluate(&mut self, arguments: &[f64], multipliers: &[f64]) -> Option<EndValues> {
        let (n, m) = (arguments.len(), self.values.n_outputs());
        let mut values = vec![0.0; m];
        self.values.evaluate(arguments, &mut values).ok()?;
        let mut weights = vec![1.0];
        weights.extend(multipliers);
        let mut by = DMatrix::zeros(m, n);
        let mut entries = vec![0.0; self.jacobian.1.n_outputs()];
        self.jacobian.1.evaluate(arguments, &mut entries).ok()?;
        for ((row, column), value) in self.jacobian.0.sparsity().entries().zip(&entries) {
            by[(row, column)] = *value;
        }
        let gradient = by.transpose() * DVector::from_column_slice(&weights);
        let mut hessian = DMatrix::zeros(n, n);
        let inputs: Vec<f64> = arguments.iter().chain(&weights).copied().collect();
        let mut entries = vec![0.0; self.hessian.1.n_outputs()];
        self.hessian.1.evaluate(&inputs, &mut entries).ok()?;
        for ((row, column), value) in self.hessian.0.sparsity().entries().zip(&entries) {
            hessian[(row, column)] = *value;
            hessian[(column, row)] = *value;
        }
        Some(EndValues { values, by, gradient, hessian })
    }
}
