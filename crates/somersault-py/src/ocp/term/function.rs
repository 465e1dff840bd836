//! Rows that a callable of Python computes.

use super::Term;
use super::part::{name_of, part_of};
use crate::core::callable::{callable_name, check_callable};
use crate::core::convert::{a_type, with_shape};
use crate::core::error::Error;
use crate::ocp::arguments::count;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::ocp::dynamics::Tree;
use somersault::ocp::term::{self, Node, NodeGradient, Part, UserError};

/// Rows and their gradient as callables, checked.
pub(super) struct UserFunction {
    rows: Py<PyAny>,
    gradient: Option<Py<PyAny>>,
    n_rows: usize,
    reads: Vec<Read>,
}

/// A part of a node that a function reads.
#[derive(Clone, Copy, PartialEq)]
enum Read {
    Position,
    Part(Part),
}

impl UserFunction {
    /// From the arguments of `function`.
    pub(super) fn try_new(
        rows: &Bound<'_, PyAny>,
        n_rows: i64,
        gradient: Option<&Bound<'_, PyAny>>,
        reads: Option<Vec<String>>,
    ) -> Result<Self, Error> {
        let n_rows = count("n_rows", n_rows, 1)?;
        check_callable("f", "f(node)", rows)?;
        if let Some(gradient) = gradient {
            check_callable("gradient", "gradient(node)", gradient)?;
        }
        let named = |name: String| match name.as_str() {
            "position" => Ok(Read::Position),
            other => Ok(Read::Part(part_of(other).map_err(|error| error.with_names(&[("part", "reads")]))?)),
        };
        let reads = match reads {
            Some(reads) if reads.is_empty() && gradient.is_none() => {
                return Err(Error::input("`reads` must have at least one part, found none"));
            }
            Some(reads) => reads.into_iter().map(named).collect::<Result<Vec<_>, Error>>()?,
            None => vec![Read::Position, Read::Part(Part::Velocity)],
        };
        let gradient = gradient.map(|gradient| gradient.clone().unbind());
        Ok(Self { rows: rows.clone().unbind(), gradient, n_rows, reads })
    }

    /// The term that the function `kind` makes of it.
    pub(super) fn term(self, py: Python<'_>, kind: &'static str) -> PyResult<Term> {
        let names = self.reads.iter().map(|read| match read {
            Read::Position => "position",
            Read::Part(part) => name_of(*part),
        });
        let named = PyDict::new(py);
        named.set_item("gradient", &self.gradient)?;
        named.set_item("reads", names.collect::<Vec<_>>())?;
        let arguments = (self.rows.clone_ref(py), self.n_rows);
        let made = Term::of((kind, "function"), py, arguments, move |py, tree, _| Ok(self.build(py, tree)))?;
        Ok(Term { calls_python: true, arguments: (made.arguments.0, named.unbind()), ..made })
    }

    fn build(&self, py: Python<'_>, tree: &Tree) -> term::Function {
        let Self { rows, gradient, n_rows, reads } = self;
        let name = match callable_name(rows.bind(py)) {
            name if name.is_empty() || name.ends_with("<lambda>") => "function".to_owned(),
            name => name,
        };
        let rows = rows_of(rows.clone_ref(py), *n_rows);
        if let Some(gradient) = gradient {
            let pull_back = pull_back_of(gradient.clone_ref(py), *n_rows);
            return term::Function::new(&name, *n_rows, rows, pull_back).compared_by(tree.clone());
        }
        let part = |read: &Read| match read {
            Read::Position => None,
            Read::Part(part) => Some(*part),
        };
        let parts: Vec<Part> = reads.iter().filter_map(part).collect();
        let by_position = reads.contains(&Read::Position);
        term::Function::by_differences(&name, *n_rows, tree.clone(), by_position, &parts, rows)
    }
}

/// A node as Python sees it.
fn seen<'py>(py: Python<'py>, node: &Node<'_>) -> PyResult<Bound<'py, PyAny>> {
    let seen = PyDict::new(py);
    seen.set_item("time", node.time)?;
    let array = |values: &[f64]| numpy::PyArray1::from_slice(py, values);
    seen.set_item("position", array(node.position))?;
    seen.set_item("velocity", array(node.velocity))?;
    seen.set_item("acceleration", array(node.acceleration))?;
    seen.set_item("torque", array(node.torque))?;
    seen.set_item("channel", array(node.channel))?;
    seen.set_item("channel_rate", array(node.channel_rate))?;
    seen.set_item("channel_second_rate", array(node.channel_second_rate))?;
    py.import("types")?.getattr("SimpleNamespace")?.call((), Some(&seen))
}

fn rows_of(
    callable: Py<PyAny>,
    n_rows: usize,
) -> impl FnMut(&Node<'_>, &mut [f64]) -> Result<(), UserError> + Send + 'static {
    move |node, out| {
        Python::attach(|py| {
            let found = callable.call1(py, (seen(py, node)?,))?.into_bound(py);
            if let Ok(number) = found.extract::<f64>()
                && n_rows == 1
            {
                out[0] = number;
                return Ok(());
            }
            let rows = with_shape("f(node)", &[n_rows], &found).map_err(PyErr::from)?;
            out.copy_from_slice(&rows);
            Ok(())
        })
        .map_err(|error: PyErr| Box::new(error) as UserError)
    }
}

fn pull_back_of(
    callable: Py<PyAny>,
    n_rows: usize,
) -> impl FnMut(&Node<'_>, &[f64], &mut NodeGradient) -> Result<(), UserError> + Send + 'static {
    move |node, y, gradient| {
        Python::attach(|py| {
            let found = callable.call1(py, (seen(py, node)?,))?.into_bound(py);
            let found = found.cast_into::<PyDict>().map_err(|error| {
                let found = a_type(&error.into_inner());
                PyErr::from(Error::input(format!("`gradient(node)` must return a dict, found {found}")))
            })?;
            for (name, matrix) in found.iter() {
                let name: String = name.extract()?;
                let out: &mut [f64] = match name.as_str() {
                    "time" => std::slice::from_mut(&mut gradient.time),
                    "position" => &mut gradient.position,
                    "velocity" => &mut gradient.velocity,
                    "acceleration" => &mut gradient.acceleration,
                    "torque" => &mut gradient.torque,
                    "channel" => &mut gradient.channel,
                    "channel_rate" => &mut gradient.channel_rate,
                    "channel_second_rate" => &mut gradient.channel_second_rate,
                    other => {
                        return Err(Error::input(format!(
                            "`gradient(node)` must have names of parts as keys, found '{other}'"
                        ))
                        .into());
                    }
                };
                let shape = [n_rows, out.len()];
                let rows =
                    with_shape(&format!("gradient(node)['{name}']"), &shape, &matrix).map_err(PyErr::from)?;
                for (row, y) in rows.chunks_exact(out.len().max(1)).zip(y) {
                    out.iter_mut().zip(row).for_each(|(out, x)| *out += x * y);
                }
            }
            Ok(())
        })
        .map_err(|error: PyErr| Box::new(error) as UserError)
    }
}
