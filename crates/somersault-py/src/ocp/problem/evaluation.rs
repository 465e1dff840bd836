//! Values and derivatives at a decision vector.

use super::MotionProblem;
use super::recipe::Program;
use crate::core::convert::{finite, with_shape};
use crate::core::error::Error;
use pyo3::prelude::*;
use somersault::nlp::{EvaluationError, Nlp};

impl MotionProblem {
    /// A decision vector, and room for the constraints at it.
    pub(super) fn room(&self, z: &Bound<'_, PyAny>) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let z = with_shape("z", &[self.n_variables], z)?;
        for x in &z {
            finite("z", *x)?;
        }
        Ok((z, vec![0.0; self.n_constraints]))
    }

    pub(super) fn run<T: Send>(
        &self,
        py: Python<'_>,
        run: impl FnOnce(&mut Program) -> Result<T, EvaluationError> + Send,
    ) -> Result<T, Error> {
        run(&mut *self.shared.acquire(py)?).map_err(undefined)
    }

    /// The gradient of the cost, and the entries of the Jacobian of the constraints.
    pub(super) fn derivatives(
        &self,
        py: Python<'_>,
        z: &Bound<'_, PyAny>,
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let (z, mut constraints) = self.room(z)?;
        self.run(py, |problem| {
            let mut gradient = vec![0.0; z.len()];
            let mut jacobian = vec![0.0; problem.structure().jacobian.n_entries()];
            problem.evaluate(&z, &mut constraints)?;
            problem.differentiate(&z, &mut gradient, &mut jacobian)?;
            Ok((gradient, jacobian))
        })
    }
}

fn undefined(error: EvaluationError) -> Error {
    match error {
        EvaluationError::Failed(source) => Error::failed(source),
        error => Error::evaluation(error.to_string()),
    }
}
