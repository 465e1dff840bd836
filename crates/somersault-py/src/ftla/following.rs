//! How long motions follow an optimum that they start beside.

use super::flow::VariationalFlow;
use super::placement::{Placement, status_named, status_of};
use super::run::{Run, attend};
use super::settings::Settings;
use super::shooting::Extremal;
use super::system::System;
use crate::core::convert::{positive, real_numbers};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore};
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ftla::nalgebra::DVector;
use somersault::ftla::spectrum::TimeDirection;
use std::sync::Arc;

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

fn following(
    placement: &Placement,
    system: &System,
    settings: Settings,
    run: &Arc<Run>,
    optimum: &Extremal,
    error: &DVector<f64>,
    sizes: &[f64],
    bound: f64,
) -> Result<Vec<Following>, Error> {
    let placement = placement.typed(system.dimension, TimeDirection::Forward)?;
    let system = system.watched(run)?;
    let flow = settings.flow(&system)?;
    let found = placement.following(&flow, &optimum.extremal, error, sizes, bound)?;
    let plain = |each: somersault::ftla::placement::Following| Following {
        size: each.size,
        without_placement: each.without_placement,
        with_placement: each.with_placement,
        status: status_of(&each.status),
        left: each.left,
    };
    Ok(found.into_iter().map(plain).collect())
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
        let (system, settings) = (flow.system.get(), flow.settings);
        positive("bound", bound)?;
        optimum.expect_dimension(system.dimension)?;
        attend(py, |run| following(self, system, settings, run, optimum, &error, &sizes, bound))
    }
}
