//! Displacement of the positions from a reference.

use super::{Description, Term, numbers_of};
use crate::core::convert::real_numbers;
use crate::core::error::Error;
use crate::ocp::arguments::{finite_all, integers_or_none};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::ocp::dynamics::Tree;
use somersault::ocp::term;
use somersault::ocp::transcription::NodeSizes;

struct Displacement {
    reference: Vec<f64>,
    dofs: Option<Vec<usize>>,
}

impl Description for Displacement {
    fn made<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Bound<'py, PyTuple>)> {
        Ok(("displacement", (self.reference.clone(), self.dofs.clone()).into_pyobject(py)?))
    }

    fn what(&self) -> &'static str {
        "displacement"
    }

    fn build(&self, _: Python<'_>, dynamics: &Tree, _: &NodeSizes) -> Result<Box<dyn term::Term>, Error> {
        let all: Vec<usize> = (0..dynamics.model().n_velocities()).collect();
        let dofs = self.dofs.as_ref().unwrap_or(&all);
        Ok(Box::new(term::Displacement::try_new(dynamics.clone(), &self.reference, dofs)?))
    }
}

/// Displacement of the positions from a reference: differences, and rotation vectors where joints rotate freely.
///
/// Parameters
/// ----------
/// reference : array_like, shape (n_positions,)
/// dofs : sequence of int, optional
///     Degrees of freedom; all unless given.
///
/// Returns
/// -------
/// Term
#[pyfunction]
#[pyo3(signature = (reference, dofs=None))]
pub(crate) fn displacement(
    reference: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = integers_or_none)] dofs: Option<Vec<i64>>,
) -> Result<Term, Error> {
    let reference = finite_all("reference", real_numbers("reference", reference)?)?;
    Ok(Term::of(Displacement { reference, dofs: numbers_of("dofs", dofs)? }))
}
