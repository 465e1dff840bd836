//! The system of one calculation: compiled, or Python callables, and stopped when the calculation is.

use super::differences::{expect_derivative, slopes_of};
use super::run::Run;
use crate::core::convert::with_shape;
use crate::core::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::ftla::nalgebra::DMatrix;
use somersault::ftla::system::{
    HamiltonianSystem, OptimalControlSystem, Piece, SystemError, TracedField, VectorField,
};
use std::sync::Arc;

/// A compiled system, as many runs share it.
pub(crate) type Compiled = Arc<dyn OptimalControlSystem + Send + Sync>;

/// The callables of a system that a user wrote.
pub(crate) struct Callables {
    pub(crate) field: Py<PyAny>,
    pub(crate) jacobian: Py<PyAny>,
    pub(crate) hamiltonian: Option<Py<PyAny>>,
    pub(crate) control: Option<Py<PyAny>>,
    pub(crate) running_cost: Option<Py<PyAny>>,
    pub(crate) dimension: usize,
    pub(crate) n_controls: usize,
}

/// Where a system comes from.
#[derive(Clone)]
pub(crate) enum Source {
    Compiled(Compiled),
    Callables(Arc<Callables>),
    Traced(Arc<TracedField>),
}

/// A system in one run. Stopped, it has no values, so that whatever integrates it comes to an end.
#[derive(Clone)]
pub(crate) struct Watched {
    source: Source,
    run: Arc<Run>,
}

/// What a callable makes of vectors: numbers of a shape; none once anything has been raised.
pub(super) fn call(
    run: &Run,
    name: &str,
    arguments: &str,
    callable: &Py<PyAny>,
    vectors: &[&[f64]],
    shape: &[usize],
) -> Option<Vec<f64>> {
    if run.is_stopped() {
        return None;
    }
    Python::attach(|py| {
        let given = vectors.iter().map(|vector| numpy::PyArray1::from_slice(py, vector));
        let given = PyTuple::new(py, given).map_err(|error| run.stop(error)).ok()?;
        let value = callable.call1(py, given).map_err(|error| run.raised(py, name, error)).ok()?;
        let numbers = with_shape(&format!("{name}({arguments})"), shape, value.bind(py));
        numbers.map_err(|error| run.stop(PyErr::from(input_of(error)))).ok()
    })
}

/// Notes what a callable returned that is no value, unless the run has ended.
pub(super) fn no_value(run: &Run, name: &str, value: f64) {
    if !run.is_stopped() {
        run.note(PyErr::from(Error::evaluation(format!("`{name}` returned {value}"))));
    }
}

impl Source {
    /// The system for one run.
    pub(crate) fn watched(self, run: &Arc<Run>) -> Watched {
        Watched { source: self, run: Arc::clone(run) }
    }
}

impl Watched {
    /// What a callable makes of p: numbers of a shape; none once anything has been raised.
    fn call(&self, name: &str, callable: &Py<PyAny>, p: &[f64], shape: &[usize]) -> Option<Vec<f64>> {
        call(&self.run, name, "p", callable, &[p], shape)
    }

    /// A number that a callable makes of p; NaN where it has no value, and an error where there is no callable.
    fn number(&self, name: &str, callable: Option<&Py<PyAny>>, p: &[f64]) -> f64 {
        let Some(callable) = callable else {
            self.run.stop(Error::input(format!("this system was made without `{name}`")).into());
            return f64::NAN;
        };
        let value = self.call(name, callable, p, &[]).map_or(f64::NAN, |numbers| numbers[0]);
        if !value.is_finite() {
            no_value(&self.run, name, value);
        }
        value
    }
}

/// What a callable returned is an argument of this module.
fn input_of(error: Error) -> Error {
    match error {
        Error::Own { message, .. } => Error::input(message),
        raised => raised,
    }
}

impl VectorField for Watched {
    fn dimension(&self) -> usize {
        match &self.source {
            Source::Compiled(system) => system.dimension(),
            Source::Callables(own) => own.dimension,
            Source::Traced(field) => field.dimension(),
        }
    }

    #[inline]
    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        match &self.source {
            _ if self.run.is_stopped() => h.fill(f64::NAN),
            Source::Compiled(system) => system.field_into(p, h),
            Source::Traced(field) => field.field_into(p, h),
            Source::Callables(own) => match self.call("field", &own.field, p, &[p.len()]) {
                Some(found) => h.copy_from_slice(&found),
                None => h.fill(f64::NAN),
            },
        }
    }

    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        let n = p.len();
        match &self.source {
            Source::Compiled(system) => system.jacobian_into(p, d),
            Source::Traced(field) => field.jacobian_into(p, d),
            Source::Callables(own) => {
                let Some(rows) = self.call("jacobian", &own.jacobian, p, &[n, n]) else {
                    return d.fill(f64::NAN);
                };
                if self.run.checks_derivatives() {
                    let field = |p: &[f64]| self.call("field", &own.field, p, &[n]);
                    let found = slopes_of(p, n, field);
                    expect_derivative(&self.run, "jacobian(p)", "field", &rows, found.as_ref());
                }
                d.copy_from_slice(&rows);
                d.transpose_mut();
            }
        }
    }

    #[inline]
    fn linearize_into(&self, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        match &self.source {
            Source::Compiled(system) if !self.run.is_stopped() => system.linearize_into(p, h, d),
            Source::Traced(field) if !self.run.is_stopped() => field.linearize_into(p, h, d),
            Source::Compiled(_) | Source::Callables(_) | Source::Traced(_) => {
                self.field_into(p, h);
                self.jacobian_into(p, d);
            }
        }
    }

    #[inline]
    fn n_switches(&self) -> usize {
        match &self.source {
            Source::Compiled(system) => system.n_switches(),
            Source::Callables(_) | Source::Traced(_) => 0,
        }
    }

    fn piece(&self, p: &[f64]) -> Piece {
        match &self.source {
            Source::Compiled(system) => system.piece(p),
            Source::Callables(_) | Source::Traced(_) => Piece::FREE,
        }
    }

    fn field_in(&self, piece: &Piece, p: &[f64], h: &mut [f64]) {
        match &self.source {
            Source::Compiled(system) if !self.run.is_stopped() => system.field_in(piece, p, h),
            Source::Compiled(_) | Source::Callables(_) | Source::Traced(_) => self.field_into(p, h),
        }
    }

    fn linearize_in(&self, piece: &Piece, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        match &self.source {
            Source::Compiled(system) if !self.run.is_stopped() => system.linearize_in(piece, p, h, d),
            Source::Compiled(_) | Source::Callables(_) | Source::Traced(_) => self.linearize_into(p, h, d),
        }
    }

    #[inline]
    fn field_at(&self, t: f64, piece: &Piece, p: &[f64], h: &mut [f64]) {
        match &self.source {
            Source::Traced(field) if !self.run.is_stopped() => field.field_at(t, piece, p, h),
            Source::Compiled(_) | Source::Callables(_) | Source::Traced(_) => self.field_in(piece, p, h),
        }
    }

    fn linearize_at(&self, t: f64, piece: &Piece, p: &[f64], h: &mut [f64], d: &mut DMatrix<f64>) {
        match &self.source {
            Source::Traced(field) if !self.run.is_stopped() => field.linearize_at(t, piece, p, h, d),
            Source::Compiled(_) | Source::Callables(_) | Source::Traced(_) => {
                self.linearize_in(piece, p, h, d)
            }
        }
    }

    #[inline(always)]
    fn variation_at(
        &self,
        t: f64,
        piece: &Piece,
        p: &[f64],
        h: &mut [f64],
        d: &mut DMatrix<f64>,
        variation: (&[f64], &mut [f64]),
        multiply_add: impl Fn(f64, f64, f64) -> f64,
    ) {
        match &self.source {
            Source::Traced(field) if !self.run.is_stopped() => {
                field.variation_at(t, piece, p, h, d, variation, multiply_add);
            }
            Source::Compiled(_) | Source::Callables(_) | Source::Traced(_) => {
                self.variation_in(piece, p, h, d, variation, multiply_add);
            }
        }
    }

    fn margins_into(&self, piece: &Piece, p: &[f64], margins: &mut [f64]) {
        match &self.source {
            Source::Compiled(system) => system.margins_into(piece, p, margins),
            Source::Callables(_) | Source::Traced(_) => margins.fill(f64::INFINITY),
        }
    }

    fn next_piece(&self, piece: &Piece, p: &[f64]) -> Piece {
        match &self.source {
            Source::Compiled(system) => system.next_piece(piece, p),
            Source::Callables(_) | Source::Traced(_) => piece.clone(),
        }
    }

    fn conserved(&self, p: &[f64]) -> Option<f64> {
        match &self.source {
            Source::Compiled(system) => system.conserved(p),
            Source::Traced(_) => None,
            Source::Callables(own) => {
                let hamiltonian = own.hamiltonian.as_ref()?;
                Some(self.call("hamiltonian", hamiltonian, p, &[]).map_or(f64::NAN, |numbers| numbers[0]))
            }
        }
    }

    fn fault(&self, p: &[f64]) -> Option<SystemError> {
        match &self.source {
            Source::Compiled(system) => system.fault(p),
            Source::Callables(_) | Source::Traced(_) => {
                let quantity = if !self.field(p).sum().is_finite() {
                    "field"
                } else if !self.jacobian(p).sum().is_finite() {
                    "jacobian"
                } else {
                    return None;
                };
                Some(SystemError::NoValue { quantity })
            }
        }
    }
}

impl HamiltonianSystem for Watched {
    fn hamiltonian(&self, p: &[f64]) -> f64 {
        match &self.source {
            Source::Compiled(system) => system.hamiltonian(p),
            Source::Traced(_) => self.number("hamiltonian", None, p),
            Source::Callables(own) => self.number("hamiltonian", own.hamiltonian.as_ref(), p),
        }
    }
}

impl OptimalControlSystem for Watched {
    fn n_controls(&self) -> usize {
        match &self.source {
            Source::Compiled(system) => system.n_controls(),
            Source::Callables(own) => own.n_controls,
            Source::Traced(_) => 0,
        }
    }

    fn control_into(&self, p: &[f64], u: &mut [f64]) -> Result<(), SystemError> {
        match &self.source {
            Source::Compiled(system) => system.control_into(p, u),
            Source::Traced(_) => {
                self.number("control", None, p);
                Err(SystemError::NoValue { quantity: "control" })
            }
            Source::Callables(own) => {
                let found = match &own.control {
                    Some(control) => self.call("control", control, p, &[own.n_controls]),
                    None => {
                        self.number("control", None, p);
                        None
                    }
                };
                let found = found.unwrap_or_else(|| vec![f64::NAN; own.n_controls]);
                u.copy_from_slice(&found);
                match found.iter().find(|x| !x.is_finite()) {
                    Some(value) => {
                        no_value(&self.run, "control", *value);
                        Err(SystemError::NoValue { quantity: "control" })
                    }
                    None => Ok(()),
                }
            }
        }
    }

    fn running_cost(&self, p: &[f64]) -> f64 {
        match &self.source {
            Source::Compiled(system) => system.running_cost(p),
            Source::Traced(_) => self.number("running_cost", None, p),
            Source::Callables(own) => self.number("running_cost", own.running_cost.as_ref(), p),
        }
    }

    fn running_cost_in(&self, piece: &Piece, p: &[f64]) -> f64 {
        match &self.source {
            Source::Compiled(system) => system.running_cost_in(piece, p),
            Source::Callables(_) | Source::Traced(_) => self.running_cost(p),
        }
    }
}
