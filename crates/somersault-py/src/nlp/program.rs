//! A nonlinear program whose functions are Python's.

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use somersault::nlp::{Curvature, EvaluationError, Nlp, NoHessian, Structure};

/// Callables of a program: `evaluate(x) -> (f, c)`, `differentiate(x) -> (gradient, values of the Jacobian)` and
/// `hessian(x, cost_factor, multipliers) -> values`, in the order of the patterns.
pub(crate) struct PythonProgram {
    pub(crate) structure: Structure,
    pub(crate) evaluate: Py<PyAny>,
    pub(crate) differentiate: Py<PyAny>,
    pub(crate) hessian: Option<Py<PyAny>>,
}

fn failed(error: PyErr) -> EvaluationError {
    EvaluationError::Failed(Box::new(error))
}

fn fill(values: &Bound<'_, PyAny>, out: &mut [f64]) -> PyResult<()> {
    let values = values.cast::<PyArray1<f64>>().map_err(PyErr::from)?.readonly();
    let values = values.as_slice()?;
    if values.len() != out.len() {
        let (found, wanted) = (values.len(), out.len());
        return Err(pyo3::exceptions::PyValueError::new_err(format!("{found} values, wanted {wanted}")));
    }
    out.copy_from_slice(values);
    Ok(())
}

impl Nlp for PythonProgram {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        Python::attach(|py| {
            let (cost, values): (f64, Bound<'_, PyAny>) =
                self.evaluate.bind(py).call1((PyArray1::from_slice(py, z),))?.extract()?;
            fill(&values, constraints)?;
            Ok(cost)
        })
        .map_err(failed)
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        Python::attach(|py| {
            let found = self.differentiate.bind(py).call1((PyArray1::from_slice(py, z),))?;
            let (slope, values): (Bound<'_, PyAny>, Bound<'_, PyAny>) = found.extract()?;
            fill(&slope, gradient)?;
            fill(&values, jacobian)
        })
        .map_err(failed)
    }

    fn curvature(&self) -> Curvature {
        if self.hessian.is_some() { Curvature::Exact } else { Curvature::None }
    }

    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let Some(callable) = &self.hessian else { return Err(NoHessian.into()) };
        Python::attach(|py| {
            let arguments = (PyArray1::from_slice(py, z), cost_factor, PyArray1::from_slice(py, multipliers));
            fill(&callable.bind(py).call1(arguments)?, hessian)
        })
        .map_err(failed)
    }
}
