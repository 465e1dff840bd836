//! How long motions follow an optimum that they start beside.

use super::flow::VariationalFlow;
use super::placement::{Placement, status_named, status_of};
use super::shooting::Extremal;
use crate::core::convert::{positive, real_numbers};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore};
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ftla::placement;
use somersault::ftla::spectrum::TimeDirection;

/// Growth of one initial error, as `Placement.following` finds it.
#[pyclass(frozen, module = "somersault.ftla", get_all)]
pub(crate) struct Following {
    /// float: The size of the error.
    size: f64,
    /// float: For how long the motion follows the optimum, s.
    without_placement: f64,
    /// float: For how long it does when its start has been placed, s.
    with_placement: f64,
    /// str: How the placement ended, as `PlacementResult.status`.
    status: &'static str,
    /// float: The largest entry of what placement leaves of the error.
    left: f64,
}

#[pymethods]
impl Following {
    fn __repr__(&self) -> String {
        let Self { size, without_placement, with_placement, status, .. } = self;
        format!("<Following: error {size:e}, {without_placement} s, {status} {with_placement} s>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let Self { size, without_placement, with_placement, status, left } = slf.get();
        by_restore(slf, (size, without_placement, with_placement, status, left))
    }

    /// What was pickled.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        size: f64,
        without_placement: f64,
        with_placement: f64,
        status: &str,
        left: f64,
    ) -> Result<Self, Error> {
        Ok(Self { size, without_placement, with_placement, status: status_named(status)?, left })
    }
}

impl Following {
    fn of(found: &placement::Following) -> Self {
        let placement::Following { size, without_placement, with_placement, ref status, left } = *found;
        Self { size, without_placement, with_placement, status: status_of(status), left }
    }
}

#[pymethods]
impl Placement {
    /// How long motions that start beside an optimum follow it, as they are and placed (thesis Figure 10.2).
    ///
    /// Parameters
    /// ----------
    /// flow : VariationalFlow
    /// optimum : Extremal
    /// error : array_like, shape (dimension,)
    ///     Direction of the error at the start.
    /// sizes : array_like, shape (m,)
    ///     How far along it motions start.
    /// bound : float
    ///     A motion follows as long as every state is within this of the optimum.
    ///
    /// Returns
    /// -------
    /// list of Following
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ftla
    /// >>> system = ftla.linear_regulator()
    /// >>> flow, t = ftla.VariationalFlow(system), np.linspace(0.0, 10.0, 21)
    /// >>> optimum = ftla.shoot(system, [1.0], [1.0], t, np.zeros((21, 2)))
    /// >>> placement = ftla.Placement((1, 0, 1), [], [1.0, 2.0, 4.0])
    /// >>> found = placement.following(flow, optimum, [0.0, 1.0], [1e-4], 0.1)[0]
    /// >>> found.with_placement > found.without_placement
    /// True
    fn following(
        &self,
        py: Python<'_>,
        flow: &VariationalFlow,
        optimum: &Extremal,
        error: &Bound<'_, PyAny>,
        sizes: &Bound<'_, PyAny>,
        bound: f64,
    ) -> Result<Vec<Following>, Error> {
        let (error, sizes) = (flow.point("error", error)?, real_numbers("sizes", sizes)?);
        positive("bound", bound)?;
        optimum.expect_dimension(error.len())?;
        let found = flow.attend(py, |flow| {
            let placement = self.typed(error.len(), TimeDirection::Forward)?;
            Ok(placement.following(&flow, &optimum.extremal, &error, &sizes, bound)?)
        })?;
        Ok(found.iter().map(Following::of).collect())
    }
}
