//! Traced functions that call functions that are not.

use crate::core::convert::{array, with_shape};
use crate::core::error::Error;
use crate::expr::CompiledFunction;
use pyo3::prelude::*;
use somersault::core::cancel::CancellationToken;
use somersault::core::differences::Differences;
use somersault::expr::ExprFunction;
use somersault::nlp::{EvaluationError, Exhausted};
use somersault::ocp::collocation::{
    CollocationError, ComposedFunction, ExternalFunction, Labels, TracedFunction, VectorFunction,
};
use std::sync::Arc;

/// Arguments of a call as expressions; names of function, outputs and arguments; `values(points)`, `jacobian(points)` and
/// `hessian(point, multipliers)`; relative error of the values.
type GivenCall = (
    Py<CompiledFunction>,
    String,
    (Vec<String>, Vec<String>),
    (Py<PyAny>, Option<Py<PyAny>>, Option<Py<PyAny>>),
    f64,
);

/// A function as it was recorded, with calls.
pub(super) type GivenFunction = (Py<CompiledFunction>, Vec<GivenCall>);

/// A traced function, with calls of functions that are not.
pub(super) struct Recorded {
    pub(super) function: ExprFunction,
    calls: Vec<Call>,
}

struct Call {
    arguments: ExprFunction,
    labels: Labels,
    callables: Arc<Callables>,
    differences: Differences,
}

struct Callables {
    values: Py<PyAny>,
    jacobian: Option<Py<PyAny>>,
    hessian: Option<Py<PyAny>>,
}

impl Recorded {
    pub(super) fn try_new((function, calls): GivenFunction) -> Result<Self, Error> {
        let call = |(arguments, function, (outputs, names), callables, error): GivenCall| {
            let (values, jacobian, hessian) = callables;
            Ok(Call {
                arguments: arguments.get().function.clone(),
                labels: Labels { function, outputs, arguments: names },
                callables: Arc::new(Callables { values, jacobian, hessian }),
                differences: Differences::try_new(error).map_err(CollocationError::from)?,
            })
        };
        let calls = calls.into_iter().map(call).collect::<Result<_, Error>>()?;
        Ok(Self { function: function.get().function.clone(), calls })
    }

    /// Whether it is traced throughout.
    pub(super) fn is_traced(&self) -> bool {
        self.calls.is_empty()
    }

    /// Names of the functions that are called and not traced.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.calls.iter().map(|call| call.labels.function.as_str())
    }

    /// Numbers that calls return, which are the last inputs of the graph.
    pub(super) fn n_returned(&self) -> usize {
        self.calls.iter().map(|call| call.labels.outputs.len()).sum()
    }

    /// What evaluates it, until the token says otherwise.
    pub(super) fn built(
        &self,
        token: &Arc<CancellationToken>,
    ) -> Result<Box<dyn VectorFunction>, CollocationError> {
        if self.is_traced() {
            return Ok(Box::new(TracedFunction::try_new(&self.function)?));
        }
        let calls = self.calls.iter().map(|call| (&call.arguments, call.built(token))).collect();
        Ok(Box::new(ComposedFunction::try_new(&self.function, calls)?))
    }
}

impl Call {
    fn built(&self, token: &Arc<CancellationToken>) -> ExternalFunction {
        let (n, m) = (self.labels.arguments.len(), self.labels.outputs.len());
        let (callables, watched) = (self.callables.clone(), token.clone());
        let values = move |points: &[f64], values: &mut [f64]| {
            let callable = &callables.values;
            called(&watched, values, |py| callable.call1(py, (rows(py, points, n)?,)))
        };
        let mut function =
            ExternalFunction::new(self.labels.clone(), values).with_differences(self.differences);
        if self.callables.jacobian.is_some() {
            let (callables, watched) = (self.callables.clone(), token.clone());
            function = function.with_jacobian(move |points, jacobians| {
                let Some(callable) = &callables.jacobian else { return Ok(()) };
                called(&watched, jacobians, |py| callable.call1(py, (rows(py, points, n)?,)))
            });
        }
        if self.callables.hessian.is_some() {
            let (callables, watched) = (self.callables.clone(), token.clone());
            function = function.with_hessian(move |point, weights, hessian| {
                let Some(callable) = &callables.hessian else { return Ok(()) };
                called(&watched, hessian, |py| {
                    callable.call1(py, (rows(py, point, n)?, rows(py, weights, m)?))
                })
            });
        }
        function
    }
}

/// Points one below the other.
fn rows<'py>(py: Python<'py>, points: &[f64], n: usize) -> PyResult<Bound<'py, PyAny>> {
    let count = points.len().checked_div(n).unwrap_or(1);
    Ok(array(py, points.to_vec(), &[count, n])?.into_any())
}

/// Writes the numbers that a call gives, unless all is to end.
fn called(
    token: &CancellationToken,
    out: &mut [f64],
    call: impl FnOnce(Python<'_>) -> PyResult<Py<PyAny>>,
) -> Result<(), EvaluationError> {
    if token.is_cancelled() {
        let exhausted = if token.has_expired() { Exhausted::Time } else { Exhausted::Interrupted };
        return Err(exhausted.into());
    }
    Python::attach(|py| {
        let found = call(py)?;
        let numbers = with_shape("values", &[out.len()], found.bind(py)).map_err(PyErr::from)?;
        out.copy_from_slice(&numbers);
        Ok(())
    })
    .map_err(|error: PyErr| EvaluationError::Failed(Box::new(error)))
}
