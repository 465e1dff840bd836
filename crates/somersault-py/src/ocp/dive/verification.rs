//! How a dive holds when integrated anew.

use crate::convert::vector_array;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::ocp::dive::DiveReport;

/// A dive as independent integrations have it.
///
/// The reduced flight is integrated from take-off to entry with a tolerance of 10⁻¹², and the full dynamics of the tree
/// with driven joints, which know no conserved momentum, with 10⁻¹⁴. Bounds are looked at at 1000 times.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct DiveVerification(pub(super) DiveReport);

#[pymethods]
impl DiveVerification {
    /// float: Somersaults to the entry, turns.
    #[getter]
    fn somersaults(&self) -> f64 {
        self.0.somersaults
    }

    /// float: Twists to the entry, turns.
    #[getter]
    fn twists(&self) -> f64 {
        self.0.twists
    }

    /// float: Tilt at the entry, rad.
    #[getter]
    fn tilt(&self) -> f64 {
        self.0.tilt
    }

    /// float: Angle of the body's long axis to the vertical at the entry, rad.
    #[getter]
    fn entry_angle(&self) -> f64 {
        self.0.entry_angle
    }

    /// float: Greatest angle between that integration and the motion that was found, at its times, rad.
    #[getter]
    fn defect(&self) -> f64 {
        self.0.defect
    }

    /// float: Change of the angular momentum in the full dynamics, relative.
    #[getter]
    fn momentum_drift(&self) -> f64 {
        self.0.momentum_drift
    }

    /// float: Angle between the orientations of both integrations at the entry, rad.
    #[getter]
    fn full_dynamics_defect(&self) -> f64 {
        self.0.full_dynamics_defect
    }

    /// float: Least channel.
    #[getter]
    fn least_channel(&self) -> f64 {
        self.0.least_channel
    }

    /// float: Greatest sum of channels.
    #[getter]
    fn greatest_sum(&self) -> f64 {
        self.0.greatest_sum
    }

    /// float or None: Least distance of limbs, m, where the dive has a clearance.
    #[getter]
    fn least_distance(&self) -> Option<f64> {
        self.0.least_distance.map(|(distance, _)| distance)
    }

    /// tuple of str or None: The limbs that come nearest.
    #[getter]
    fn nearest_limbs(&self) -> Option<(&'static str, &'static str)> {
        self.0.least_distance.map(|(_, [first, second])| (first, second))
    }

    /// dict of str to (float, float): For each joint the largest force, N m, and when, s.
    #[getter]
    fn peak_torques<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        super::solution::peaks(py, &self.0.peak_torques)
    }

    /// ndarray, shape (3,): Centre of mass at take-off, m.
    #[getter]
    fn take_off<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, &self.0.take_off)
    }

    /// ndarray, shape (3,): Its velocity, m/s.
    #[getter]
    fn take_off_velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, &self.0.take_off_velocity)
    }

    fn __repr__(&self) -> String {
        format!(
            "<DiveVerification: entry {:.4}° off the vertical, defect {:.1e} rad, momentum drift {:.1e}>",
            self.0.entry_angle.to_degrees(),
            self.0.defect,
            self.0.momentum_drift
        )
    }
}
