//! Take-off and entry.

use super::fit::MarkerSet;
use super::markers::MarkerRecording;
use super::motion_fit::{name_of, status_of};
use crate::core::convert::{a_type, real_numbers, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::leave_on_signal;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::motion::phases::{self, PhaseDoubt, PhaseStatus, WithInterval, mean_heights};
use somersault::motion::reconstruction::{FlightReconstruction, MarkerNoise, ReconstructionOptions};

/// Gravity of the Earth, m/s².
const EARTH: f64 = 9.81;

/// Finds take-off and entry in a record that is longer than the flight.
///
/// In the air the height z of the centre of mass keeps to a parabola of known curvature. The stretch of frames that maximises Σ(3 − r²/s²), r the
/// residual to its own parabola and s their size, is found by cumulative sums. Beyond take-off and entry forces act that are not known: they are
/// integrated out, and what is left is the probability of each moment between frames. The noise of the heights, white and correlated, is
/// estimated by restricted likelihood.
///
/// At noise of 9 to 30 mm, 50 to 240 frames a second, the middle error is 6 to 20 ms, and intervals hold the truth in 97 of 100 cases. A force
/// that begins at once with several times the weight is seen up to 50 ms early. Seconds for 20 000
/// frames, milliseconds for 200. Other Python threads run meanwhile. Ctrl-C raises at once.
///
/// Parameters
/// ----------
/// recording : MarkerRecording or array_like, shape (n_frames,)
///     The markers; or heights of the centre of mass, m, NaN in frames without a height.
/// markers : MarkerSet, optional
///     The markers, and the model they are on: heights are then those of the centre of mass of fits of single frames. Without it they are those of
///     the mean of the markers, which leaves the parabola with the limbs; intervals are wider for it.
/// times : array_like, shape (n_frames,), optional
///     Times of heights, s, rising.
/// gravity : float, optional
///     Downwards, m/s²; that of the model of `markers`, or 9.81.
///
/// Returns
/// -------
/// FlightPhase
///     With a status that says whether a flight was found, and what is doubtful in it.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed or missing, fewer than ten frames have heights, or more than 20 000 (in 1/120 s each) are there.
///
/// Examples
/// --------
/// A push from 0.5 s on, a flight from 0.8 to 1.8 s, and water:
///
/// >>> import numpy as np
/// >>> from somersault import motion
/// >>> t = np.arange(0.0, 2.2, 0.01)
/// >>> force = np.interp(t, [0.5, 0.55, 0.74, 0.8, 1.8, 1.9], [1.0, 2.7, 2.7, 0.0, 0.0, 4.0])
/// >>> speed = np.cumsum(9.81 * (force - 1.0)) * 0.01
/// >>> heights = np.cumsum(speed) * 0.01 + np.random.default_rng(1).normal(0.0, 0.01, len(t))
/// >>> flight = motion.find_flight(heights, times=t)
/// >>> flight.status, bool(abs(flight.take_off - 0.8) < 0.03), bool(abs(flight.entry - 1.8) < 0.03)
/// ('found', True, True)
/// >>> lower, upper = flight.take_off_interval
/// >>> bool(lower < flight.take_off < upper)
/// True
#[pyfunction]
#[pyo3(signature = (recording, *, markers=None, times=None, gravity=None))]
pub(crate) fn find_flight(
    py: Python<'_>,
    recording: &Bound<'_, PyAny>,
    markers: Option<&Bound<'_, MarkerSet>>,
    times: Option<&Bound<'_, PyAny>>,
    gravity: Option<f64>,
) -> Result<FlightPhase, Error> {
    let given = gravity.unwrap_or(EARTH);
    let phase = match recording.cast::<MarkerRecording>() {
        Ok(_) if times.is_some() => {
            return Err(Error::input("`times` are those of the recording, and must not be given with one"));
        }
        Ok(recording) => {
            let recording = recording.get().recording.clone();
            match markers.map(Bound::get) {
                Some(_) if gravity.is_some() => {
                    return Err(Error::input(
                        "`gravity` is that of the model of `markers`, and must not be given with them",
                    ));
                }
                Some(set) => {
                    let (model, markers) = (&set.model.get().model, set.markers.clone());
                    let options = ReconstructionOptions::default();
                    let problem = FlightReconstruction::try_new(model, markers, options)?;
                    leave_on_signal(py, move |token| problem.find_flight_cancellable(&recording, token))?
                }
                None => leave_on_signal(py, move |_| {
                    phases::find_flight(recording.times(), &mean_heights(&recording)?, given)
                })?,
            }
        }
        Err(_) if markers.is_some() => {
            let found = a_type(recording);
            return Err(Error::input(format!(
                "`recording` must be a MarkerRecording where `markers` are given, found {found}"
            )));
        }
        Err(_) => {
            let missing = || Error::input("`times` must be given with heights");
            let times = real_numbers("times", times.ok_or_else(missing)?)?;
            let heights = with_shape("recording", &[times.len()], recording)?;
            let heights: Vec<_> = heights.iter().map(|z| (!z.is_nan()).then_some(*z)).collect();
            leave_on_signal(py, move |_| phases::find_flight(&times, &heights, given))?
        }
    };
    Ok(FlightPhase { phase })
}

/// When a body flies: take-off and entry with their 95 % intervals.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct FlightPhase {
    pub(super) phase: phases::FlightPhase,
}

/// Where the interval of a number begins and ends.
pub(super) fn bounds(number: &WithInterval) -> (f64, f64) {
    (number.lower, number.upper)
}

value! {
    impl FlightPhase {
        /// str: ``'found'``; ``'uncertain'`` where `doubts` has something; ``'other_gravity'`` where a stretch keeps to a parabola that is not
        /// that of gravity: the rate of the frames or the unit of length is wrong; ``'not_found'``.
        status: &'static str = |own| name_of(&PhaseStatus::ALL, &own.phase.status);
        /// bool: Whether one flight was found without a doubt.
        success: bool = |own| own.phase.success();
        /// float: Take-off, s; NaN where no flight was found.
        take_off: f64 = |own| own.phase.take_off.value;
        /// tuple of float: Its 95 % interval; from -inf where the record may begin in flight.
        take_off_interval: (f64, f64) = |own| bounds(&own.phase.take_off);
        /// float: Entry, s; NaN where no flight was found.
        entry: f64 = |own| own.phase.entry.value;
        /// tuple of float: Its 95 % interval; to inf where the record may end in flight.
        entry_interval: (f64, f64) = |own| bounds(&own.phase.entry);
        /// float: Duration of the flight, s.
        duration: f64 = |own| own.phase.duration.value;
        /// tuple of float: Its 95 % interval.
        duration_interval: (f64, f64) = |own| bounds(&own.phase.duration);
        /// tuple of float or None: First and last time that belong to the flight, as `reconstruct_flight` takes them; infinite where
        /// the record may begin or end in flight, None where no flight was found.
        interval: Option<(f64, f64)> = |own| own.phase.interval();
        /// float: Curvature of the heights within the flight, downwards, m/s², as the record has it.
        gravity: f64 = |own| own.phase.gravity.value;
        /// tuple of float: Its 95 % interval.
        gravity_interval: (f64, f64) = |own| bounds(&own.phase.gravity);
        /// tuple of float: The noise of the heights: standard deviation, m; fraction of the variance that is correlated; the time over
        /// which it is, s.
        noise: (f64, f64, f64) = |own| (own.phase.noise.size, own.phase.noise.correlated, own.phase.noise.time);
        /// str: What was found, and what is doubtful, or why nothing was found.
        message: String = |own| own.phase.message();
    }
}

/// Names of doubts, and their times.
type Doubts = Vec<(String, [f64; 2])>;

#[pymethods]
impl FlightPhase {
    /// tuple of str: What is doubtful: a record that may begin or end in flight, another flight, frames that are missing near
    /// take-off or entry, a curvature that is not that of gravity, noise that is too large.
    #[getter]
    fn doubts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.phase.doubts.iter().map(ToString::to_string))
    }

    /// The results as a dict of numbers, tuples and texts, for JSON and tables.
    ///
    /// Returns
    /// -------
    /// dict of str to object
    ///     An entry for each attribute, by its name.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion
    /// >>> t = np.arange(0.0, 1.0, 0.02)
    /// >>> motion.find_flight(4 * t - 4.905 * t**2, times=t).to_dict()["status"]
    /// 'uncertain'
    fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(slf.py());
        for name in [
            "status",
            "take_off",
            "take_off_interval",
            "entry",
            "entry_interval",
            "duration",
            "duration_interval",
            "gravity",
            "gravity_interval",
            "noise",
            "doubts",
            "message",
        ] {
            found.set_item(name, slf.getattr(name)?)?;
        }
        Ok(found)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let phase = &slf.get().phase;
        let numbers = [&phase.take_off, &phase.entry, &phase.duration, &phase.gravity]
            .map(|x| [x.value, x.lower, x.upper]);
        let doubts: Doubts = phase.doubts.iter().map(packed).collect();
        let noise = slf.get().noise();
        by_restore(slf, (slf.get().status(), numbers, phase.given_gravity, noise, doubts))
    }

    /// A pickled phase.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        status: &str,
        numbers: [[f64; 3]; 4],
        given_gravity: f64,
        noise: (f64, f64, f64),
        doubts: Doubts,
    ) -> Result<Self, Error> {
        let [take_off, entry, duration, gravity] =
            numbers.map(|[value, lower, upper]| WithInterval { value, lower, upper });
        let (size, correlated, time) = noise;
        let phase = phases::FlightPhase {
            status: status_of(&PhaseStatus::ALL, status)?,
            take_off,
            entry,
            duration,
            gravity,
            given_gravity,
            noise: MarkerNoise { size, correlated, time },
            doubts: doubts.iter().map(|(name, times)| unpacked(name, *times)).collect::<Result<_, _>>()?,
        };
        Ok(Self { phase })
    }

    fn __repr__(&self) -> String {
        let phase = &self.phase;
        let status = self.status();
        format!("<FlightPhase: {status}, from {:.3} to {:.3} s>", phase.take_off.value, phase.entry.value)
    }
}

/// A doubt by its name.
fn packed(doubt: &PhaseDoubt) -> (String, [f64; 2]) {
    let (name, times) = match doubt {
        PhaseDoubt::BeginsInFlight => ("begins_in_flight", [0.0; 2]),
        PhaseDoubt::EndsInFlight => ("ends_in_flight", [0.0; 2]),
        PhaseDoubt::OtherFlight { start, end } => ("other_flight", [*start, *end]),
        PhaseDoubt::Gap { start, end } => ("gap", [*start, *end]),
        PhaseDoubt::Curvature { found } => ("curvature", [*found, 0.0]),
        PhaseDoubt::Wide { width } => ("wide", [*width, 0.0]),
    };
    (name.to_owned(), times)
}

/// The doubt of a name.
fn unpacked(name: &str, [start, end]: [f64; 2]) -> Result<PhaseDoubt, Error> {
    Ok(match name {
        "begins_in_flight" => PhaseDoubt::BeginsInFlight,
        "ends_in_flight" => PhaseDoubt::EndsInFlight,
        "other_flight" => PhaseDoubt::OtherFlight { start, end },
        "gap" => PhaseDoubt::Gap { start, end },
        "curvature" => PhaseDoubt::Curvature { found: start },
        "wide" => PhaseDoubt::Wide { width: start },
        _ => return Err(Error::input(format!("`doubts` must be those of a flight, found '{name}'"))),
    })
}
