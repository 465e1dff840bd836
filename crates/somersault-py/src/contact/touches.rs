//! What contacts do at the times of a solution, as arrays.

use crate::core::convert::array;
use pyo3::prelude::*;
use somersault::contact::encounters::ContactState;
use somersault::integrators::nalgebra::Vector3;

/// One row for each time.
pub(crate) struct Touches {
    pub(crate) forces: Py<PyAny>,
    pub(crate) points: Py<PyAny>,
    pub(crate) gaps: Py<PyAny>,
    pub(crate) elastic_energy: Py<PyAny>,
}

impl Touches {
    /// Of the states of so many contacts at each time, and the energy of their springs.
    pub(crate) fn of(
        py: Python<'_>,
        contacts: usize,
        rows: impl IntoIterator<Item = (Vec<ContactState>, f64)>,
    ) -> PyResult<Self> {
        let (states, energies): (Vec<_>, Vec<f64>) = rows.into_iter().unzip();
        let n = states.len();
        let vectors = |of: fn(&ContactState) -> Vector3<f64>| -> PyResult<Py<PyAny>> {
            let numbers = states.iter().flatten().flat_map(|state| <[f64; 3]>::from(of(state))).collect();
            Ok(array(py, numbers, &[n, contacts, 3])?.into_any().unbind())
        };
        let gaps = states.iter().flatten().map(|state| state.gap).collect();
        Ok(Self {
            forces: vectors(|state| state.force)?,
            points: vectors(|state| state.point)?,
            gaps: array(py, gaps, &[n, contacts])?.into_any().unbind(),
            elastic_energy: array(py, energies, &[n])?.into_any().unbind(),
        })
    }
}
