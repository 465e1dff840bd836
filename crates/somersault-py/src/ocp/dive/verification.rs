//! How a dive holds when re-integrated.

use crate::core::convert::{any_vector, vector_array};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use somersault::dives::{ALLOWED, DiveReport, Nearest, PeakTorque};

/// Minimum distance, limbs, time and clearance of a pickled verification.
type NearestParts = (f64, [String; 2], f64, f64);

/// The largest force of each joint, and when it acts.
pub(super) fn peaks<'py>(py: Python<'py>, peaks: &[PeakTorque]) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    for PeakTorque { joint, torque, time } in peaks {
        found.set_item(joint, (torque, time))?;
    }
    Ok(found)
}

/// A dive as independent integrations have it.
///
/// The full dynamics of the tree with driven joints, which know no conserved momentum, are integrated from take-off to entry
/// with a tolerance of 10⁻¹⁴; somersaults, twists and tilt are counted along that flight. The reduced flight is integrated
/// beside it with 10⁻¹². Bounds are looked at at 1000 times, distances of limbs at all times.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct DiveVerification(pub(super) DiveReport);

value! {
    impl DiveVerification {
        /// bool: Whether it is the dive requested: both integrations agree with the motion that was found and with each other to
        /// `allowed` rad at all its times, and the angular momentum is kept to this fraction of its scale; somersaults, twists and
        /// tilt at the entry are those requested to `allowed` rad; limbs keep their clearance at all times.
        confirmed: bool = |own| own.0.is_confirmed(ALLOWED);
        /// str: Whether the dive is confirmed, in a sentence, or in one for each thing that is wrong.
        message: String = |own| own.0.sentence(ALLOWED);
        /// float: Somersaults to the entry, turns.
        somersaults: f64 = |own| own.0.somersaults;
        /// float: Twists to the entry, turns.
        twists: f64 = |own| own.0.twists;
        /// float: Tilt at the entry, rad.
        tilt: f64 = |own| own.0.tilt;
        /// float: Angle of the body's long axis to the vertical at the entry, rad.
        entry_angle: f64 = |own| own.0.entry_angle;
        /// float: Greatest difference of somersault, tilt and twist at the entry from those requested, whole turns counted, rad.
        entry_defect: f64 = |own| own.0.entry_defect;
        /// float: Greatest angle between the reduced flight and the motion that was found, at its times, rad.
        defect: f64 = |own| own.0.defect;
        /// ndarray, shape (n,): That angle at each of the times `DiveSolution.t`, rad.
        defects: Bound<'py, PyAny> = |own, py| numpy::PyArray1::from_slice(py, &own.0.defects).into_any();
        /// float: Change of the angular momentum in the full dynamics over its scale: its size |L|, or the largest that the
        /// joints alone have at a time of `DiveSolution.t`, with the torso at rest, or 10⁻³ m h²/(1 s), whichever is largest.
        momentum_drift: f64 = |own| own.0.momentum_drift;
        /// float: Greatest angle between the orientations of both integrations at the times of `DiveSolution.t`, rad.
        full_dynamics_defect: f64 = |own| own.0.full_dynamics_defect;
        /// float: Least channel.
        least_channel: f64 = |own| own.0.least_channel;
        /// float: Greatest sum of channels.
        greatest_sum: f64 = |own| own.0.greatest_sum;
        /// float or None: Minimum distance of limbs over all times, m, where the dive has a clearance: none is smaller, one at most
        /// 10 μm greater.
        least_distance: Option<f64> = |own| own.0.nearest.as_ref().map(|nearest| nearest.distance);
        /// float or None: When they do, s.
        nearest_time: Option<f64> = |own| own.0.nearest.as_ref().map(|nearest| nearest.time);
        /// dict of str to (float, float): For each joint the largest force, N m, and when, s.
        peak_torques: PyResult<Bound<'py, PyDict>> = |own, py| peaks(py, &own.0.peak_torques);
        /// ndarray, shape (3,): Centre of mass at take-off, m.
        take_off: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.take_off);
        /// ndarray, shape (3,): Its velocity, m/s.
        take_off_velocity: Bound<'py, PyAny> = |own, py| vector_array(py, &own.0.take_off_velocity);
    }
}

#[pymethods]
impl DiveVerification {
    /// float: What `confirmed` allows, 10⁻³.
    #[getter]
    fn allowed(&self) -> f64 {
        ALLOWED
    }

    /// tuple of str or None: The limbs that come nearest.
    #[getter]
    fn nearest_limbs(&self) -> Option<(&str, &str)> {
        self.0
            .nearest
            .as_ref()
            .map(|Nearest { limbs: [first, second], .. }| (first.as_str(), second.as_str()))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, found) = (slf.py(), &slf.get().0);
        let torques: Vec<_> =
            found.peak_torques.iter().map(|peak| (peak.joint.clone(), peak.torque, peak.time)).collect();
        let nearest = found.nearest.as_ref().map(|nearest| {
            let Nearest { distance, limbs, time, clearance } = nearest;
            (*distance, limbs.clone(), *time, *clearance)
        });
        let arguments = (
            (found.momentum, found.duration, found.somersaults, found.twists, found.tilt, found.entry_angle),
            (
                numpy::PyArray1::from_slice(py, &found.defects),
                found.momentum_drift,
                found.full_dynamics_defect,
                found.entry_defect,
            ),
            (found.least_channel, found.greatest_sum, nearest),
            torques,
            (vector_array(py, &found.take_off), vector_array(py, &found.take_off_velocity)),
        );
        by_restore(slf, arguments)
    }

    /// A pickled verification.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        flight: (f64, f64, f64, f64, f64, f64),
        integration: (Vec<f64>, f64, f64, f64),
        bounds: (f64, f64, Option<NearestParts>),
        torques: Vec<(String, f64, f64)>,
        take_off: (Bound<'_, PyAny>, Bound<'_, PyAny>),
    ) -> Result<Self, Error> {
        let (momentum, duration, somersaults, twists, tilt, entry_angle) = flight;
        let (defects, momentum_drift, full_dynamics_defect, entry_defect) = integration;
        let (least_channel, greatest_sum, nearest) = bounds;
        let nearest =
            nearest.map(|(distance, limbs, time, clearance)| Nearest { distance, limbs, time, clearance });
        let peak = |(joint, torque, time)| PeakTorque { joint, torque, time };
        Ok(Self(DiveReport {
            momentum,
            duration,
            somersaults,
            twists,
            tilt,
            entry_angle,
            entry_defect,
            defect: defects.iter().copied().fold(0.0, f64::max),
            defects,
            momentum_drift,
            full_dynamics_defect,
            least_channel,
            greatest_sum,
            nearest,
            peak_torques: torques.into_iter().map(peak).collect(),
            take_off: any_vector("take_off", &take_off.0)?,
            take_off_velocity: any_vector("take_off_velocity", &take_off.1)?,
        }))
    }

    fn __repr__(&self) -> String {
        let confirmed = if self.confirmed() { "confirmed" } else { "not confirmed" };
        format!(
            "<DiveVerification: {confirmed}, entry {:.4}° off the vertical, defect {:.1e} rad, momentum drift {:.1e}>",
            self.0.entry_angle.to_degrees(),
            self.0.defect,
            self.0.momentum_drift
        )
    }
}
