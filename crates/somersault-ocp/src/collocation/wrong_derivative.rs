//! Derivatives that a user wrote, compared with differences, and what is said of one that is wrong.

use crate::WrongDerivative;
use somersault_core::differences::{Contradiction, Differences, Slopes};
use somersault_nlp::EvaluationError;

/// What a function, its outputs and its arguments are called in messages.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Labels {
    /// Such as "dynamics".
    pub function: String,
    /// One for each output, such as "the rate of v".
    pub outputs: Vec<String>,
    /// One for each argument, such as "v".
    pub arguments: Vec<String>,
}

/// Messages by labels.
impl WrongDerivative {
    fn of_jacobian(labels: &Labels, at: &[f64], wrong: Contradiction) -> Self {
        let entry = format!("∂({})/∂({})", labels.outputs[wrong.row], labels.arguments[wrong.column]);
        Self::of(labels, "jacobian", at, entry, wrong)
    }

    fn of_hessian(labels: &Labels, at: &[f64], wrong: Contradiction) -> Self {
        let by = [wrong.row, wrong.column].map(|k| &labels.arguments[k]);
        Self::of(labels, "hessian", at, format!("∂²/∂({})∂({})", by[0], by[1]), wrong)
    }

    fn of(labels: &Labels, derivative: &str, at: &[f64], entry: String, wrong: Contradiction) -> Self {
        let place = labels.arguments.iter().map(String::as_str).zip(at.iter().copied());
        Self::new(&labels.function, derivative, entry, wrong, place)
    }
}

/// What is compared: a function at points one after the other, its Jacobians row by row.
pub(super) trait Compared {
    /// The values.
    fn values(&mut self, points: &[f64], values: &mut [f64]) -> Result<(), EvaluationError>;
    /// The Jacobians as they were given.
    fn jacobians(&mut self, points: &[f64], jacobians: &mut [f64]) -> Result<(), EvaluationError>;
    /// The Hessian of Σ wᵢ fᵢ as it was given, if it was.
    fn hessian(&mut self, at: &[f64], weights: &[f64]) -> Result<Option<Vec<f64>>, EvaluationError>;
}

/// The first derivative that differences contradict at a point; none where the function has no value near it.
pub(super) fn contradicted(
    function: &mut impl Compared,
    labels: &Labels,
    at: &[f64],
    sizes: &[f64],
    differences: Differences,
) -> Result<Option<WrongDerivative>, EvaluationError> {
    match compare(function, labels, at, sizes, differences) {
        Err(EvaluationError::Undefined { .. }) => Ok(None),
        found => found,
    }
}

fn compare(
    function: &mut impl Compared,
    labels: &Labels,
    at: &[f64],
    sizes: &[f64],
    differences: Differences,
) -> Result<Option<WrongDerivative>, EvaluationError> {
    let (n, m) = (at.len(), labels.outputs.len());
    let slopes = Slopes::try_of(at, sizes, m, differences, &mut |points, out| function.values(points, out))?;
    let mut jacobian = vec![0.0; m * n];
    function.jacobians(at, &mut jacobian)?;
    if let Some(wrong) = slopes.and_then(|slopes| slopes.contradicted(&jacobian)) {
        return Ok(Some(WrongDerivative::of_jacobian(labels, at, wrong)));
    }
    // such that no two outputs can make up for each other
    let weights: Vec<f64> = (0..m).map(|i| 1.0 + (i as f64 + 1.0).sqrt().fract()).collect();
    let Some(hessian) = function.hessian(at, &weights)? else { return Ok(None) };
    let mut gradients = |points: &[f64], out: &mut [f64]| {
        let mut jacobians = vec![0.0; points.len() * m];
        function.jacobians(points, &mut jacobians)?;
        for (jacobian, out) in jacobians.chunks_exact((m * n).max(1)).zip(out.chunks_exact_mut(n)) {
            for (j, out) in out.iter_mut().enumerate() {
                *out = weights.iter().enumerate().map(|(i, w)| w * jacobian[i * n + j]).sum();
            }
        }
        Ok::<_, EvaluationError>(())
    };
    let slopes = Slopes::try_of(at, sizes, n, differences, &mut gradients)?;
    let wrong = slopes.and_then(|slopes| slopes.contradicted(&hessian));
    Ok(wrong.map(|wrong| WrongDerivative::of_hessian(labels, at, wrong)))
}
