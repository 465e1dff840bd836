//! What a flight was.

use super::motion_fit::name_of;
use super::phases::bounds;
use super::reconstruction::ReconstructedFlight;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use somersault::motion::identification::{
    self, Direction, Facing, FlightReport as Report, Group, IdentificationStatus, Position,
};

/// Says what a reconstructed flight was: its dive number, and what a coach asks of it, each value with its 95 % interval.
///
/// Half somersaults are those of the line from feet to hands in the last frame, half twists those of the whole flight, both counted on SO(3) in
/// the frame of travel, as whole numbers with probabilities; the position follows from hip and knee where the hip is closed most. A dive number
/// is said where it has at least 90 %, the flight is a success, and gravity as the recording has it is that of the model.
///
/// Parameters
/// ----------
/// flight : ReconstructedFlight
///     Of a diver: `diver_planar`, `diver_spatial`, or a model whose bodies have their names.
/// facing : str, optional
///     Where the diver faces at take-off, ``'water'`` or ``'board'``, which no recording shows. Unless it is given, the diver is taken to travel away
///     from the board; where the velocity does not say, both stand among the alternatives.
///
/// Returns
/// -------
/// FlightReport
///     ``print`` shows it as a page of text.
///
/// Raises
/// ------
/// InputError
///     If the model has not the bodies of a diver, or `facing` is another.
///
/// Examples
/// --------
/// Two and a half somersaults in pike, markers with noise of 20 mm:
///
/// >>> import numpy as np
/// >>> from somersault import motion, multibody
/// >>> diver = multibody.diver_planar()
/// >>> straight, pike = diver.configuration("A"), diver.configuration("H")
/// >>> def fold(t):
/// ...     w, rate = np.sin(np.pi * t / 1.2) ** 2, np.pi / 1.2 * np.sin(2 * np.pi * t / 1.2)
/// ...     return straight[3:] + w * (pike - straight)[3:], rate * (pike - straight)[3:]
/// >>> v = np.zeros(12)
/// >>> v[:3] = 1.0, 5.0, -7.5
/// >>> true = multibody.fly(diver.model, straight, v, fold, (0.0, 1.2), dt=0.02)
/// >>> markers = motion.MarkerSet.joint_centres(diver.model)
/// >>> seen = motion.place_markers(markers, true.t, true.q)
/// >>> points = seen.points + np.random.default_rng(1).normal(0.0, 0.02, seen.points.shape)
/// >>> flight = motion.reconstruct_flight(markers, motion.MarkerRecording(seen.names, seen.times, points))
/// >>> report = motion.identify_flight(flight, facing="water")
/// >>> report.number, report.half_somersaults
/// ('105B', 5)
#[pyfunction]
#[pyo3(signature = (flight, *, facing=None))]
pub(crate) fn identify_flight(
    flight: &Bound<'_, ReconstructedFlight>,
    facing: Option<&str>,
) -> Result<FlightReport, Error> {
    let side = facing_of(facing)?;
    let own = flight.get();
    let report = identification::identify_flight(&own.markers.get().model.get().model, &own.flight, side)?;
    Ok(FlightReport { flight: flight.clone().unbind(), facing: side, report })
}

/// Where the diver faced.
pub(super) fn facing_of(facing: Option<&str>) -> Result<Option<Facing>, Error> {
    let side = facing.map(|name| {
        let known = Facing::ALL.iter().find(|(_, known)| *known == name);
        let wrong = || Error::input(format!("`facing` must be 'water' or 'board', found '{name}'"));
        known.map(|(side, _)| *side).ok_or_else(wrong)
    });
    side.transpose()
}

/// What a flight was. Values are for the given masses, angles in rad; ``print`` shows degrees.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct FlightReport {
    flight: Py<ReconstructedFlight>,
    facing: Option<Facing>,
    report: Report,
}

value! {
    impl FlightReport {
        /// ReconstructedFlight: The flight.
        flight: Py<ReconstructedFlight> = |own, py| own.flight.clone_ref(py);
        /// str or None: Where the diver faced at take-off, as it was given.
        facing: Option<&'static str> = |own| own.facing.map(|side| name_of(&Facing::ALL, &side));
        /// str: ``'identified'``; ``'between'`` where no dive number has 90 %; ``'other_gravity'`` where gravity in the recording is not that of the
        /// model, so that a rate or a unit is wrong; ``'not_reconstructed'`` where the flight is no success.
        status: &'static str = |own| name_of(&IdentificationStatus::ALL, &own.report.status);
        /// bool: Whether the status is ``'identified'``.
        success: bool = |own| own.report.success();
        /// str or None: The dive number, as ``'5174D'``, where one is identified.
        number: Option<String> = |own| own.report.number.clone();
        /// str: ``'somersaults'``, ``'twisting'`` or ``'armstand'``.
        group: &'static str = |own| name_of(&Group::ALL, &own.report.group);
        /// int: Half somersaults from the upright, or from the armstand, forwards positive: the most probable number.
        half_somersaults: i32 = |own| own.report.half_somersaults.value;
        /// float: Its probability.
        half_somersaults_probability: f64 = |own| own.report.half_somersaults.probability;
        /// int: Half twists, to the left positive: the most probable number.
        half_twists: i32 = |own| own.report.half_twists.value;
        /// float: Its probability.
        half_twists_probability: f64 = |own| own.report.half_twists.probability;
        /// float: Somersaults of the long axis from the first to the last frame, forwards positive.
        somersaults: f64 = |own| own.report.somersaults.value;
        /// tuple of float: Its 95 % interval.
        somersaults_interval: (f64, f64) = |own| bounds(&own.report.somersaults);
        /// float: Twists, to the left positive.
        twists: f64 = |own| own.report.twists.value;
        /// tuple of float: Its 95 % interval.
        twists_interval: (f64, f64) = |own| bounds(&own.report.twists);
        /// float: Duration of the flight, s.
        duration: f64 = |own| own.report.duration.value;
        /// tuple of float: Its 95 % interval.
        duration_interval: (f64, f64) = |own| bounds(&own.report.duration);
        /// float: How far the centre of mass rises above its place at take-off, m.
        height: f64 = |own| own.report.height.value;
        /// tuple of float: Its 95 % interval.
        height_interval: (f64, f64) = |own| bounds(&own.report.height);
        /// float: Speed of the centre of mass at take-off, m/s.
        speed: f64 = |own| own.report.speed.value;
        /// tuple of float: Its 95 % interval.
        speed_interval: (f64, f64) = |own| bounds(&own.report.speed);
        /// float: Angle of the velocity at take-off above the horizontal, rad.
        take_off_angle: f64 = |own| own.report.take_off_angle.value;
        /// tuple of float: Its 95 % interval.
        take_off_angle_interval: (f64, f64) = |own| bounds(&own.report.take_off_angle);
        /// float: Size of the angular momentum about the centre of mass, kg m²/s.
        angular_momentum: f64 = |own| own.report.angular_momentum.value;
        /// tuple of float: Its 95 % interval.
        angular_momentum_interval: (f64, f64) = |own| bounds(&own.report.angular_momentum);
        /// float: Least moment of inertia about its axis, kg m²; `flight.moment_of_inertia` has that of each frame.
        least_inertia: f64 = |own| own.report.least_inertia.value;
        /// tuple of float: Its 95 % interval.
        least_inertia_interval: (f64, f64) = |own| bounds(&own.report.least_inertia);
        /// float: Greatest moment of inertia, kg m².
        greatest_inertia: f64 = |own| own.report.greatest_inertia.value;
        /// tuple of float: Its 95 % interval.
        greatest_inertia_interval: (f64, f64) = |own| bounds(&own.report.greatest_inertia);
        /// float: Angle of the hip where it is closed most, rad; π is straight.
        hip: f64 = |own| own.report.hip.value;
        /// tuple of float: Its 95 % interval.
        hip_interval: (f64, f64) = |own| bounds(&own.report.hip);
        /// float: Angle of the knee there, rad; π is straight.
        knee: f64 = |own| own.report.knee.value;
        /// tuple of float: Its 95 % interval.
        knee_interval: (f64, f64) = |own| bounds(&own.report.knee);
        /// float: Angle of the line from feet to hands beyond the vertical in the last frame, rad; negative where the dive is short.
        entry_angle: f64 = |own| own.report.entry_angle.value;
        /// tuple of float: Its 95 % interval.
        entry_angle_interval: (f64, f64) = |own| bounds(&own.report.entry_angle);
        /// float: Gravity as the recording has it, m/s².
        gravity: f64 = |own| own.report.gravity.value;
        /// tuple of float: Its 95 % interval.
        gravity_interval: (f64, f64) = |own| bounds(&own.report.gravity);
        /// str: The dive number with its probability, or why none is said.
        message: String = |own| own.report.message();
    }
}

/// Names with their probabilities.
fn listed<'py, T: PartialEq>(
    py: Python<'py>,
    all: &[(T, &'static str)],
    found: &[(T, f64)],
) -> PyResult<Bound<'py, PyDict>> {
    let names = PyDict::new(py);
    for (kind, probability) in found {
        names.set_item(name_of(all, kind), probability)?;
    }
    Ok(names)
}

#[pymethods]
impl FlightReport {
    /// dict of str to float: Dive numbers with their probabilities, the most probable first, down to 1 %; none of a flight that was not
    /// reconstructed.
    #[getter]
    fn alternatives<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let names = PyDict::new(py);
        for (name, probability) in &self.report.alternatives {
            names.set_item(name, probability)?;
        }
        Ok(names)
    }

    /// dict of str to float: ``'forward'``, ``'back'``, ``'reverse'`` and ``'inward'`` with their probabilities.
    #[getter]
    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        listed(py, &Direction::ALL, &self.report.directions)
    }

    /// dict of str to float: ``'straight'``, ``'pike'``, ``'tuck'`` and ``'free'`` with their probabilities.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        listed(py, &Position::ALL, &self.report.positions)
    }

    /// The results as a dict of numbers, tuples and texts, for JSON and tables.
    ///
    /// Returns
    /// -------
    /// dict of str to object
    ///     An entry for each attribute but `flight`, by its name.
    ///
    /// Examples
    /// --------
    /// A fall without a somersault is no dive:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import motion, multibody
    /// >>> diver = multibody.diver_planar()
    /// >>> t = np.linspace(0.0, 0.4, 21)
    /// >>> q = np.tile(diver.configuration("A"), (21, 1))
    /// >>> q[:, 1] = 4.0 * t - 4.905 * t**2
    /// >>> markers = motion.MarkerSet.joint_centres(diver.model)
    /// >>> seen = motion.place_markers(markers, t, q)
    /// >>> flight = motion.reconstruct_flight(markers, seen, noise=0.01, scale=1.0)
    /// >>> found = motion.identify_flight(flight).to_dict()
    /// >>> found["number"], found["half_somersaults"]
    /// (None, 0)
    fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(slf.py());
        for name in [
            "status",
            "number",
            "alternatives",
            "group",
            "directions",
            "positions",
            "half_somersaults",
            "half_somersaults_probability",
            "half_twists",
            "half_twists_probability",
            "somersaults",
            "somersaults_interval",
            "twists",
            "twists_interval",
            "duration",
            "duration_interval",
            "height",
            "height_interval",
            "speed",
            "speed_interval",
            "take_off_angle",
            "take_off_angle_interval",
            "angular_momentum",
            "angular_momentum_interval",
            "least_inertia",
            "least_inertia_interval",
            "greatest_inertia",
            "greatest_inertia_interval",
            "hip",
            "hip_interval",
            "knee",
            "knee_interval",
            "entry_angle",
            "entry_angle_interval",
            "gravity",
            "gravity_interval",
            "message",
        ] {
            found.set_item(name, slf.getattr(name)?)?;
        }
        Ok(found)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        by_restore(slf, (slf.get().flight(slf.py()), slf.get().facing()))
    }

    /// A pickled report, which follows from its flight.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        flight: &Bound<'_, ReconstructedFlight>,
        facing: Option<&str>,
    ) -> Result<Self, Error> {
        identify_flight(flight, facing)
    }

    fn __str__(&self) -> String {
        self.report.page()
    }

    fn __repr__(&self) -> String {
        // the message of a flight that was not reconstructed has all its reasons
        match self.report.status {
            IdentificationStatus::NotReconstructed => format!("<FlightReport: {}>", self.status()),
            _ => format!("<FlightReport: {}, {}>", self.status(), self.report.message()),
        }
    }
}
