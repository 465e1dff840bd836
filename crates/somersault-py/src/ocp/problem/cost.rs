//! Parts of the cost.

use super::place::Place;
use crate::core::convert::{finite_all, integer_or_none, numbers_or_one, real_numbers};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore};
use crate::ocp::term::Term;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ocp::problem::{At, Loss};

/// Part of the cost: ½ Σ wᵢ (rᵢ − tᵢ)² of the rows r of a term, or Σ wᵢ rᵢ.
///
/// Parameters
/// ----------
/// term : Term
/// weights : float or array_like, shape (n_rows,), optional
///     w.
/// target : float or array_like, shape (n_rows,), optional
///     t.
/// at : {'path', 'start', 'finish', 'node'}, optional
///     Integrated over the whole motion (Lagrange), or taken at one time (Mayer).
/// node : int, optional
///     Which node, where `at` is ``'node'``; counted through all phases.
/// linear : bool, optional
///     Σ wᵢ rᵢ instead of squares.
/// phase : int, optional
///     Of which phase path, start or finish are meant; of the whole motion unless given.
///
/// Examples
/// --------
/// >>> from somersault import ocp
/// >>> ocp.Cost(ocp.entries("torque", [0]), weights=0.5)
/// <Cost: squares of torque, at 'path'>
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Cost {
    pub(super) term: Py<Term>,
    weights: Option<Py<PyAny>>,
    target: Option<Py<PyAny>>,
    place: Place,
    pub(super) nodes: At,
    linear: bool,
}

#[pymethods]
impl Cost {
    #[new]
    #[pyo3(signature = (term, weights=None, target=None, *, at="path", node=None, linear=false, phase=None))]
    fn new(
        py: Python<'_>,
        term: Py<Term>,
        weights: Option<Py<PyAny>>,
        target: Option<Py<PyAny>>,
        at: &str,
        #[pyo3(from_py_with = integer_or_none)] node: Option<i64>,
        linear: bool,
        #[pyo3(from_py_with = integer_or_none)] phase: Option<i64>,
    ) -> Result<Self, Error> {
        if linear && target.is_some() {
            return Err(Error::input("`target` is for squares; leave out `linear`"));
        }
        if at == "integral" {
            return Err(Error::input("`at` of a cost must be 'start', 'finish', 'node' or 'path'"));
        }
        for (argument, value) in [("weights", &weights), ("target", &target)] {
            if let Some(value) = value {
                finite_all(argument, real_numbers(argument, value.bind(py))?)?;
            }
        }
        let place = Place { at: at.to_owned(), node, phase };
        Ok(Self { term, weights, target, nodes: place.nodes()?, place, linear })
    }

    fn __repr__(&self) -> String {
        let kind = if self.linear { "linear" } else { "squares" };
        format!("<Cost: {kind} of {}, {}>", self.term.get().what(), self.place)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let copy = |value: &Option<Py<PyAny>>| value.as_ref().map(|value| value.clone_ref(py));
        let Place { at, node, phase } = own.place.clone();
        let place = (at, node, own.linear, phase);
        by_restore(slf, (own.term.clone_ref(py), copy(&own.weights), copy(&own.target), place))
    }

    /// A pickled cost.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        term: Py<Term>,
        weights: Option<Py<PyAny>>,
        target: Option<Py<PyAny>>,
        place: (String, Option<i64>, bool, Option<i64>),
    ) -> Result<Self, Error> {
        let (at, node, linear, phase) = place;
        Self::new(cls.py(), term, weights, target, &at, node, linear, phase)
    }
}

impl Cost {
    pub(super) fn loss(&self, py: Python<'_>, n_rows: usize) -> Result<Loss, Error> {
        let numbers = |name, value: &Option<Py<PyAny>>, default| match value {
            Some(value) => numbers_or_one(name, n_rows, value.bind(py)),
            None => Ok(vec![default; n_rows]),
        };
        let weights = numbers("weights", &self.weights, 1.0)?;
        Ok(if self.linear {
            Loss::Linear { weights }
        } else {
            Loss::HalfSquares { weights, target: numbers("target", &self.target, 0.0)? }
        })
    }
}
