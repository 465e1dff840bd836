//! Terms of costs and constraints: what Python says of them, and what the library makes of it.
//!
//! A term is a function of the table.

mod function;
mod part;
mod table;

pub(in crate::ocp) use table::add_functions;

use super::arguments::index;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::ocp::dynamics::{HybridDynamics, Tree};
use somersault::ocp::term;
use somersault::ocp::transcription::NodeSizes;

/// Makes the term for nodes of the given sizes.
type Build = dyn Fn(Python<'_>, &Tree, &NodeSizes) -> Result<Box<dyn term::Term>, Error> + Send + Sync;

/// Rows of numbers made of a motion at one time: what costs and constraints are made of.
///
/// Made by functions of `somersault.ocp`, of which `function` takes any callable.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Term {
    /// The function of the table that makes it.
    kind: &'static str,
    /// With which arguments, and which by name.
    arguments: (Py<PyTuple>, Py<PyDict>),
    /// What it is, in words.
    what: &'static str,
    /// Whether evaluations call Python.
    calls_python: bool,
    build: Box<Build>,
}

#[pymethods]
impl Term {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let Self { kind, arguments: (arguments, named), .. } = slf.get();
        by_restore(slf, (*kind, arguments, named))
    }

    /// A pickled term.
    #[classmethod]
    fn _restore<'py>(
        _: &Bound<'_, PyType>,
        py: Python<'py>,
        kind: &str,
        arguments: &Bound<'py, PyTuple>,
        named: &Bound<'py, PyDict>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if !table::NAMES.contains(&kind) {
            return Err(Error::input(format!("`kind` must be that of a term, found '{kind}'")).into());
        }
        py.import("somersault._somersault.ocp")?.getattr(kind)?.call(arguments, Some(named))
    }

    fn __repr__(&self) -> String {
        format!("<Term: {}>", self.what)
    }
}

impl Term {
    /// What the function `kind` makes of `arguments`, with words for it, and how it is made for nodes.
    fn of<'py, T: term::Term + 'static>(
        (kind, what): (&'static str, &'static str),
        py: Python<'py>,
        arguments: impl IntoPyObject<'py, Target = PyTuple, Output = Bound<'py, PyTuple>, Error: Into<PyErr>>,
        build: impl Fn(Python<'_>, &Tree, &NodeSizes) -> Result<T, Error> + Send + Sync + 'static,
    ) -> PyResult<Self> {
        let arguments = arguments.into_pyobject(py).map_err(Into::into)?;
        Ok(Self {
            kind,
            arguments: (arguments.unbind(), PyDict::new(py).unbind()),
            what,
            calls_python: false,
            build: Box::new(move |py, tree, sizes| Ok(Box::new(build(py, tree, sizes)?))),
        })
    }

    /// What it is, in words.
    pub(crate) fn what(&self) -> &'static str {
        self.what
    }

    /// Whether evaluations call Python.
    pub(crate) fn calls_python(&self) -> bool {
        self.calls_python
    }

    /// The term for nodes of the given sizes.
    pub(crate) fn build(
        &self,
        py: Python<'_>,
        dynamics: &Tree,
        sizes: &NodeSizes,
    ) -> Result<Box<dyn term::Term>, Error> {
        (self.build)(py, dynamics, sizes)
    }
}

/// Which degrees of freedom or entries; not none of them.
fn numbers_of(argument: &str, numbers: Option<Vec<i64>>) -> Result<Option<Vec<usize>>, Error> {
    let Some(numbers) = numbers else { return Ok(None) };
    if numbers.is_empty() {
        return Err(Error::input(format!("`{argument}` must have at least one entry, found none")));
    }
    numbers.into_iter().map(|k| index(argument, k)).collect::<Result<Vec<_>, _>>().map(Some)
}

/// What the nodes of a shooting of this tree hold.
pub(crate) fn sizes_of(dynamics: &Tree, n_channels: usize) -> NodeSizes {
    let dofs = dynamics.dofs();
    let n = dofs.n_velocities();
    NodeSizes { n_positions: dofs.n_positions, n_velocities: n, n_accelerations: n, n_torques: n, n_channels }
}
