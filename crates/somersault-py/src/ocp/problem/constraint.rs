//! Constraints on terms.

use super::place::Place;
use crate::core::convert::{integer_or_none, real_numbers};
use crate::core::error::Error;
use crate::core::value::{Pickled, brief, by_restore};
use crate::ocp::term::Term;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ocp::problem::At;

/// Bounds on the rows of a term.
///
/// Parameters
/// ----------
/// term : Term
/// lower, upper : float or array_like, shape (n_rows,)
///     Equal for an equality, infinite where there is no bound.
/// at : {'path', 'start', 'finish', 'node', 'integral'}, optional
///     At every node, at one, or of the integral over time.
/// node : int, optional
///     Which node, where `at` is ``'node'``; counted through all phases.
/// phase : int, optional
///     Of which phase path, integral, start or finish are meant; of the whole motion unless given.
///
/// Examples
/// --------
/// >>> from somersault import ocp
/// >>> ocp.Constraint(ocp.entries("velocity"), 0.0, 0.0, at="finish")
/// <Constraint: velocity from 0.0 to 0.0, at 'finish'>
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Constraint {
    pub(super) term: Py<Term>,
    pub(super) lower: Py<PyAny>,
    pub(super) upper: Py<PyAny>,
    pub(super) place: Place,
    pub(super) nodes: At,
}

#[pymethods]
impl Constraint {
    #[new]
    #[pyo3(signature = (term, lower, upper, *, at="path", node=None, phase=None))]
    fn new(
        py: Python<'_>,
        term: Py<Term>,
        lower: Py<PyAny>,
        upper: Py<PyAny>,
        at: &str,
        #[pyo3(from_py_with = integer_or_none)] node: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] phase: Option<i64>,
    ) -> Result<Self, Error> {
        let place = Place { at: at.to_owned(), node, phase };
        in_order(&real_numbers("lower", lower.bind(py))?, &real_numbers("upper", upper.bind(py))?)?;
        Ok(Self { term, lower, upper, nodes: place.nodes()?, place })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let text = |bound: &Py<PyAny>| Ok::<_, PyErr>(brief(&bound.bind(py).str()?.to_cow()?, 40));
        let (what, lower, upper) = (self.term.get().what(), text(&self.lower)?, text(&self.upper)?);
        Ok(format!("<Constraint: {what} from {lower} to {upper}, {}>", self.place))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let Place { at, node, phase } = own.place.clone();
        let bounds = (own.lower.clone_ref(py), own.upper.clone_ref(py));
        by_restore(slf, (own.term.clone_ref(py), bounds.0, bounds.1, (at, node, phase)))
    }

    /// A pickled constraint.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        term: Py<Term>,
        lower: Py<PyAny>,
        upper: Py<PyAny>,
        place: (String, Option<i64>, Option<i64>),
    ) -> Result<Self, Error> {
        let (at, node, phase) = place;
        Self::new(cls.py(), term, lower, upper, &at, node, phase)
    }
}

/// Lower bounds that are not above their upper ones; a single bound is that of all rows.
fn in_order(lower: &[f64], upper: &[f64]) -> Result<(), Error> {
    for (argument, bounds) in [("lower", lower), ("upper", upper)] {
        if let Some(k) = bounds.iter().position(|bound| bound.is_nan()) {
            return Err(Error::input(format!(
                "`{argument}` of a constraint must be numbers or infinite, found NaN in entry {k}"
            )));
        }
    }
    let of = |bounds: &[f64], k: usize| bounds[k.min(bounds.len() - 1)];
    if lower.is_empty() || upper.is_empty() {
        return Ok(());
    }
    let pairs = (0..lower.len().max(upper.len())).map(|k| (of(lower, k), of(upper, k)));
    match pairs.enumerate().find(|(_, (lower, upper))| lower > upper) {
        Some((k, (lower, upper))) => Err(Error::input(format!(
            "`lower` of a constraint must not be above `upper`, found {lower} and {upper} in entry {k}"
        ))),
        None => Ok(()),
    }
}
