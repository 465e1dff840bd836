//! Terms of costs and constraints: what Python says of them, and what the library makes of it.
//!
//! A term is a file with its [`Description`] and the function that makes it, and a row of the table of [`kinds`].

mod body;
mod displacement;
mod entries;
mod function;
mod momentum;
mod part;

use super::arguments::index;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore};
use pyo3::conversion::FromPyObjectOwned;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use somersault::ocp::dynamics::{HybridDynamics, Tree};
use somersault::ocp::term;
use somersault::ocp::transcription::NodeSizes;

/// The functions that make terms, and how each makes one of its arguments in a pickle.
macro_rules! kinds {
    (|$given:ident| $($module:ident::$name:ident: $made:expr;)*) => {
        /// Adds the functions to the module of Python.
        pub(in crate::ocp) fn add_functions(module: &Bound<'_, PyModule>) -> PyResult<()> {
            $(module.add_function(wrap_pyfunction!($module::$name, module)?)?;)*
            Ok(())
        }

        /// A pickled term.
        fn restored($given: &Arguments<'_, '_>) -> Result<Term, Error> {
            match $given.kind {
                $(stringify!($name) => $made,)*
                other => Err(Error::input(format!("`kind` must be that of a term, found '{other}'"))),
            }
        }
    };
}

kinds! {
    |given|
    body::axis_direction: body::axis_direction(given.get(0)?, &given.at(1)?);
    body::body_orientation: body::body_orientation(given.get(0)?, &given.at(1)?);
    body::point_position: body::point_position(given.get(0)?, given.optional(1)?.as_ref());
    displacement::displacement: displacement::displacement(&given.at(0)?, given.get(1)?);
    entries::entries: entries::entries(&given.get::<String>(0)?, given.get(1)?);
    function::function: {
        function::function(&given.at(0)?, given.get(1)?, given.optional(2)?.as_ref(), given.get(3)?)
    };
    momentum::momentum: momentum::momentum(&given.get::<String>(0)?);
}

/// What Python says of a term.
trait Description: Send + Sync {
    /// The function that makes it, and its arguments.
    fn made<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Bound<'py, PyTuple>)>;

    /// What it is, in words.
    fn what(&self) -> &'static str;

    /// The term for nodes of the given sizes.
    fn build(&self, py: Python<'_>, dynamics: &Tree, sizes: &NodeSizes)
    -> Result<Box<dyn term::Term>, Error>;

    /// Whether evaluations call Python.
    fn calls_python(&self) -> bool {
        false
    }
}

/// Rows of numbers made of a motion at one time: what costs and constraints are made of.
///
/// Made by the functions of `somersault.ocp`: `entries`, `displacement`, `momentum`, `point_position`,
/// `axis_direction`, `body_orientation` and `function`.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Term(Box<dyn Description>);

#[pymethods]
impl Term {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        by_restore(slf, slf.get().0.made(slf.py())?)
    }

    /// A pickled term.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, kind: &str, arguments: &Bound<'_, PyTuple>) -> Result<Self, Error> {
        restored(&Arguments { kind, given: arguments })
    }

    fn __repr__(&self) -> String {
        format!("<Term: {}>", self.0.what())
    }
}

impl Term {
    fn of(description: impl Description + 'static) -> Self {
        Self(Box::new(description))
    }

    /// Whether evaluations call Python.
    pub(crate) fn calls_python(&self) -> bool {
        self.0.calls_python()
    }

    /// The term for nodes of the given sizes.
    pub(crate) fn build(
        &self,
        py: Python<'_>,
        dynamics: &Tree,
        sizes: &NodeSizes,
    ) -> Result<Box<dyn term::Term>, Error> {
        self.0.build(py, dynamics, sizes)
    }
}

/// The arguments of a pickled term.
struct Arguments<'a, 'py> {
    kind: &'a str,
    given: &'a Bound<'py, PyTuple>,
}

impl<'py> Arguments<'_, 'py> {
    fn at(&self, k: usize) -> Result<Bound<'py, PyAny>, Error> {
        self.given.get_item(k).map_err(|_| {
            let (kind, n) = (self.kind, self.given.len());
            Error::input(format!("`arguments` of a term '{kind}' are too few: {n}"))
        })
    }

    fn get<T: FromPyObjectOwned<'py>>(&self, k: usize) -> Result<T, Error> {
        Ok(self.at(k)?.extract().map_err(Into::<PyErr>::into)?)
    }

    /// None for what Python calls so.
    fn optional(&self, k: usize) -> Result<Option<Bound<'py, PyAny>>, Error> {
        Ok(Some(self.at(k)?).filter(|found| !found.is_none()))
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
