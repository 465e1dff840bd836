//! The planar dive by explicit Euler.

use crate::convert::array;
use crate::error::Error;
use crate::ocp::solver::{Report, Watcher};
use crate::plan::returns_interrupted;
use pyo3::prelude::*;
use somersault::ocp::dive::{self, DiveProgram};
use std::f64::consts::TAU;

/// A planar dive as thesis 3.1 poses it, stepped by explicit Euler. The centre of mass starts at the origin.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct LiteralDive(dive::LiteralDive);

impl LiteralDive {
    pub(super) fn of(
        py: Python<'_>,
        program: &DiveProgram,
        z: &[f64],
        n_steps: usize,
        optimise: bool,
        on_interrupt: &str,
    ) -> Result<Self, Error> {
        let returned = returns_interrupted(on_interrupt)?;
        if !optimise {
            return Ok(Self(py.detach(|| program.literal_motion(z, n_steps))?));
        }
        let mut watcher = Watcher::new(None);
        let found = py.detach(|| program.solve_literal(z, n_steps, &mut |i| watcher.look(i)))?;
        match watcher.into_raised(py, returned) {
            Some(error) => Err(error.into()),
            None => Ok(Self(found)),
        }
    }

    fn rows<'py>(&self, py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        let n = self.0.times.len();
        Ok(array(py, values.to_vec(), &[n, values.len() / n])?.into_any())
    }
}

#[pymethods]
impl LiteralDive {
    /// ndarray, shape (n_steps + 1,): Times, s.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.0.times).into_any()
    }

    /// ndarray, shape (n_steps + 1, n_positions): Configurations.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, &self.0.positions)
    }

    /// ndarray, shape (n_steps + 1, n_velocities): Velocities.
    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, &self.0.velocities)
    }

    /// ndarray, shape (n_steps + 1,): Angular momentum about the centre of mass, lateral axis, kg m²/s.
    #[getter]
    fn angular_momentum<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.0.angular_momentum).into_any()
    }

    /// ndarray, shape (n_steps + 1,): Somersaults since take-off, turns.
    #[getter]
    fn somersaults<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_vec(py, self.0.somersault.iter().map(|a| a / TAU).collect()).into_any()
    }

    /// float: Change of the angular momentum from take-off to entry, relative.
    #[getter]
    fn momentum_change(&self) -> f64 {
        match self.0.angular_momentum[..] {
            [first, .., last] => last / first - 1.0,
            _ => f64::NAN,
        }
    }

    /// Report or None: What the solver says; None where a motion was only rolled out.
    #[getter]
    fn report(&self) -> Option<Report> {
        self.0.report.clone().map(|report| Report { report })
    }

    fn __len__(&self) -> usize {
        self.0.times.len()
    }

    fn __repr__(&self) -> String {
        let turned = self.0.somersault.last().map_or(f64::NAN, |a| a / TAU);
        format!(
            "<LiteralDive: {} times, {turned:.3} somersaults in the air, momentum {:+.1} %>",
            self.0.times.len(),
            100.0 * self.momentum_change()
        )
    }
}
