//! Flights behind recordings.

use super::fit::MarkerSet;
use super::markers::MarkerRecording;
use super::matrix::{count, matrix, matrix_array, numbers_array, same_length};
use super::motion_fit::{name_of, status_of};
use super::phases::FlightPhase;
use crate::core::convert::{a_type, array, interval_of, vector_array};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::leave_on_signal;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::motion::fit::BodyScale;
use somersault::motion::nalgebra::{DMatrix, Matrix3, Vector3};
use somersault::motion::reconstruction::{
    BeyondLimit, Departure, Exchange, FlightFrame, FlightReconstruction, MarkerNoise, Quantity,
    ReconstructedFlight as Flight, ReconstructionOptions, ReconstructionStatus,
};

/// Finds the flight behind a recording, by the laws of flight.
///
/// From take-off to entry the centre of mass keeps to a parabola and the angular momentum L about it is constant. A motion that obeys
/// both exactly is fitted to all frames at once: its unknowns are the orientation near the middle, L, the centre of mass
/// and its velocity, cubic splines of the joints, and, where they are sought, size and gravity. With ω = I⁻¹(RᵀL − A q̇) the
/// orientation follows from L and the joints. Second derivatives of the joints at the knots are normal with sizes that are estimated;
/// so are size and correlation of the noise, by restricted maximum likelihood: taken for white, noise that is correlated, as that of
/// video is, makes intervals that are far too short. Masses are those of the model: cameras see L/m and I/m only, and masses that are
/// wrong are not seen in the residuals.
///
/// Other Python threads run meanwhile. Ctrl-C raises at once and stops the search.
///
/// Parameters
/// ----------
/// markers : MarkerSet
///     The markers, and the model they are on, whose root has a free or a planar joint; its other joints are hinges, slides and balls.
/// recording : MarkerRecording
///     The flight, and what was recorded before and after it.
/// knot_spacing : float, optional
///     Time between the knots of the joints' splines, s; 0.07 unless given.
/// scale : float or tuple of float, optional
///     Size over that of the model if it is known; otherwise its mean and standard deviation before the markers are looked at,
///     1 ± 0.1 unless given.
/// seek_gravity : bool, optional
///     Whether gravity is sought too. If it differs from the model's, the rate of the frames or the unit of length is wrong.
/// threshold : float or None, optional
///     Distance in standard deviations from which on a marker counts less (Huber's loss); None counts squares.
/// noise : float or tuple of float, optional
///     The noise of each coordinate of a marker of weight 1 if it is known: the standard deviation of white noise, m; or this, the fraction of
///     the variance that is correlated, and the time over which it is, s. It is estimated unless given.
/// interval : tuple of float, optional
///     First and last time that belong to the flight, s; found as by `find_flight` unless given, where the recording has frames before the
///     take-off or after the entry.
/// max_iterations : int, optional
///     Iterations over all frames, at most, between estimates of the noise; 50 unless given.
///
/// Returns
/// -------
/// ReconstructedFlight
///     The best flight that was found, whatever its status.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, the model cannot fly, the recording has none of the markers, or fewer than ten frames show any.
///
/// Examples
/// --------
/// A somersault in the plane, seen with noise of 20 mm:
///
/// >>> import numpy as np
/// >>> from somersault import motion, multibody
/// >>> diver = multibody.diver_planar()
/// >>> straight, pike = diver.configuration("A"), diver.configuration("H")
/// >>> def fold(t):
/// ...     return straight[3:] + np.sin(2 * t) ** 2 * (pike - straight)[3:], 2 * np.sin(4 * t) * (pike - straight)[3:]
/// >>> v = np.zeros(12)
/// >>> v[:3] = 1.0, 4.0, -4.0
/// >>> true = multibody.fly(diver.model, straight, v, fold, (0.0, 1.0), dt=0.02)
/// >>> markers = motion.MarkerSet.joint_centres(diver.model)
/// >>> seen = motion.place_markers(markers, true.t, true.q)
/// >>> points = seen.points + np.random.default_rng(1).normal(0.0, 0.02, seen.points.shape)
/// >>> flight = motion.reconstruct_flight(markers, motion.MarkerRecording(seen.names, seen.times, points))
/// >>> flight.success, flight.unseen
/// (True, ('toes', 'head', 'hand'))
/// >>> momentum = diver.model.centroidal_momentum(true.q[0], true.v[0])[4]
/// >>> bool(abs(flight.angular_momentum[1] - momentum) < 3 * flight.angular_momentum_deviation[1] < 0.05 * momentum)
/// True
#[pyfunction]
#[pyo3(signature = (
    markers, recording, *, knot_spacing=None, scale=None, seek_gravity=false, threshold=4.0, noise=None, interval=None,
    max_iterations=None
))]
pub(crate) fn reconstruct_flight(
    py: Python<'_>,
    markers: &Bound<'_, MarkerSet>,
    recording: &Bound<'_, MarkerRecording>,
    knot_spacing: Option<f64>,
    scale: Option<&Bound<'_, PyAny>>,
    seek_gravity: bool,
    threshold: Option<f64>,
    noise: Option<&Bound<'_, PyAny>>,
    interval: Option<&Bound<'_, PyAny>>,
    max_iterations: Option<i128>,
) -> Result<ReconstructedFlight, Error> {
    let default = ReconstructionOptions::default();
    let options = ReconstructionOptions {
        knot_spacing: knot_spacing.unwrap_or(default.knot_spacing),
        scale: scale.map_or(Ok(default.scale), scale_of)?,
        seek_gravity,
        threshold,
        noise: noise.map(noise_of).transpose()?,
        interval: interval.map(interval_of).transpose()?.map(<(f64, f64)>::from),
        max_iterations: max_iterations.map_or(Ok(default.max_iterations), |n| count("max_iterations", n))?,
    };
    let set = markers.get();
    let problem = FlightReconstruction::try_new(&set.model.get().model, set.markers.clone(), options)?;
    let recording = recording.get().recording.clone();
    let flight = leave_on_signal(py, move |token| problem.reconstruct_cancellable(&recording, token))?;
    Ok(ReconstructedFlight { markers: markers.clone().unbind(), flight })
}

/// A size, or a mean and a standard deviation.
pub(super) fn scale_of(value: &Bound<'_, PyAny>) -> Result<BodyScale, Error> {
    match (value.extract::<f64>(), value.extract::<(f64, f64)>()) {
        (Ok(size), _) => Ok(BodyScale::Known(size)),
        (_, Ok((mean, deviation))) => Ok(BodyScale::Sought { mean, deviation }),
        _ => {
            let found = a_type(value);
            Err(Error::input(format!(
                "`scale` must be a number, or a mean and a standard deviation, found {found}"
            )))
        }
    }
}

/// White noise, or with the fraction of its variance that is correlated and the time of that.
pub(super) fn noise_of(value: &Bound<'_, PyAny>) -> Result<MarkerNoise, Error> {
    match (value.extract::<f64>(), value.extract::<(f64, f64, f64)>()) {
        (Ok(size), _) => Ok(MarkerNoise::white(size)),
        (_, Ok((size, correlated, time))) => Ok(MarkerNoise { size, correlated, time }),
        _ => {
            let found = a_type(value);
            Err(Error::input(format!(
                "`noise` must be a standard deviation, or this with the fraction that is correlated and its time, found {found}"
            )))
        }
    }
}

/// A flight that obeys the laws of flight exactly and comes nearest to a recording. Arrays have a row for each frame.
///
/// Deviations are standard deviations, those of the inverse of the Hessian, for the given masses. Of planar dives with noise of 30 mm, most of it
/// correlated, ± 1.96 of them hold the velocity in 96 of 100 cases, all results together in 93, and the angular momentum in 95. Pictures, `plotting.tree_motion` and the viewer take it like a MotionFit.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct ReconstructedFlight {
    pub(super) markers: Py<MarkerSet>,
    pub(super) flight: Flight,
}

impl ReconstructedFlight {
    /// Numbers of each frame.
    fn rows<'py>(
        &self,
        py: Python<'py>,
        shape: &[usize],
        of: impl Fn(&FlightFrame) -> Vec<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let values = self.flight.frames.iter().flat_map(of).collect();
        Ok(array(py, values, &[&[self.flight.frames.len()], shape].concat())?.into_any())
    }

    fn vectors<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&FlightFrame) -> Vector3<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, &[3], |frame| of(frame).as_slice().to_vec())
    }

    fn numbers<'py>(&self, py: Python<'py>, of: impl Fn(&FlightFrame) -> f64) -> Bound<'py, PyAny> {
        numbers_array(py, &self.flight.frames.iter().map(of).collect::<Vec<_>>())
    }

    fn by_marker<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&Quantity) -> &Vector3<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        for (name, offset) in &self.flight.marker_offsets {
            found.set_item(name, vector_array(py, of(offset)))?;
        }
        Ok(found)
    }

    fn width(&self, of: impl Fn(&FlightFrame) -> usize) -> usize {
        self.flight.frames.first().map_or(0, of)
    }
}

value! {
    impl ReconstructedFlight {
        /// MarkerSet: The markers, and the model they are on.
        markers: Py<MarkerSet> = |own, py| own.markers.clone_ref(py);
        /// Model: The model.
        model: Py<Model> = |own, py| own.markers.get().model.clone_ref(py);
        /// ndarray, shape (n_frames,): Times, s.
        times: Bound<'py, PyAny> = |own, py| own.numbers(py, |frame| frame.time);
        /// ndarray, shape (n_frames, n_positions): Configurations of the model; places of its root are in m and not scaled.
        q: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, &[own.width(|frame| frame.q.len())], |frame| frame.q.clone());
        /// ndarray, shape (n_frames, n_velocities): Their velocities; that of the root in m/s, in its axes.
        v: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, &[own.width(|frame| frame.v.len())], |frame| frame.v.clone());
        /// ndarray, shape (n_frames, n): Deviations of the orientation of the root, three numbers along its axes or one in the plane, and of the joints, rad
        /// or m, in the order of `v`.
        deviations: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, &[own.width(|frame| frame.covariance.nrows())], FlightFrame::deviations);
        /// ndarray, shape (n_frames, n, n): Covariance of orientation and joints in each frame, in the order of `deviations`.
        frame_covariances: PyResult<Bound<'py, PyAny>> = |own, py| {
            let n = own.width(|frame| frame.covariance.nrows());
            own.rows(py, &[n, n], |frame| frame.covariance.iter().copied().collect())
        };
        /// float: Size over that of the model.
        scale: f64 = |own| own.flight.scale[0];
        /// float: Its deviation; 0 if it was known.
        scale_deviation: f64 = |own| own.flight.scale[1];
        /// ndarray, shape (3,): Angular momentum about the centre of mass, world axes, kg m²/s.
        angular_momentum: Bound<'py, PyAny> = |own, py| vector_array(py, &own.flight.angular_momentum.value).into_any();
        /// ndarray, shape (3,): Its deviation.
        angular_momentum_deviation: Bound<'py, PyAny> =
            |own, py| vector_array(py, &own.flight.angular_momentum.deviation).into_any();
        /// ndarray, shape (n_frames, 3): Centre of mass, m.
        center_of_mass: PyResult<Bound<'py, PyAny>> = |own, py| own.vectors(py, |frame| frame.center_of_mass);
        /// ndarray, shape (3,): Velocity of the centre of mass in the first frame, m/s.
        take_off_velocity: Bound<'py, PyAny> = |own, py| vector_array(py, &own.flight.velocity.value).into_any();
        /// ndarray, shape (3,): Its deviation.
        take_off_velocity_deviation: Bound<'py, PyAny> =
            |own, py| vector_array(py, &own.flight.velocity.deviation).into_any();
        /// float: How far the centre of mass rises above its place in the first frame, m.
        height: f64 = |own| own.flight.height;
        /// ndarray, shape (n_frames, 3): Angular velocity of the root, world axes, rad/s.
        angular_velocity: PyResult<Bound<'py, PyAny>> =
            |own, py| own.vectors(py, |frame| frame.angular_velocity.value);
        /// ndarray, shape (n_frames, 3): Its deviation.
        angular_velocity_deviation: PyResult<Bound<'py, PyAny>> =
            |own, py| own.vectors(py, |frame| frame.angular_velocity.deviation);
        /// ndarray, shape (n_frames,): Moment of inertia about the centre of mass and the axis of the angular momentum, joints locked, kg m².
        moment_of_inertia: Bound<'py, PyAny> = |own, py| own.numbers(py, |frame| frame.moment_of_inertia);
        /// ndarray, shape (n_frames,): Its deviation.
        moment_of_inertia_deviation: Bound<'py, PyAny> =
            |own, py| own.numbers(py, |frame| frame.moment_of_inertia_deviation);
        /// ndarray, shape (n_frames, 3, 3): Inertia about the centre of mass, world axes, joints locked, kg m².
        inertia: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, &[3, 3], |frame| frame.inertia.transpose().as_slice().to_vec());
        /// ndarray, shape (n_frames,): Angle of the body's long axis from the vertical about the axis of the somersault, forwards positive, whole turns
        /// counted, rad: between -π and π in the first frame.
        inclination: Bound<'py, PyAny> = |own, py| own.numbers(py, |frame| frame.inclination);
        /// ndarray, shape (n_frames,): Its deviation.
        inclination_deviation: Bound<'py, PyAny> = |own, py| own.numbers(py, |frame| frame.inclination_deviation);
        /// ndarray, shape (n_frames,): Somersaults since the first frame, forwards positive, about the horizontal part of the angular momentum.
        somersaults: Bound<'py, PyAny> = |own, py| own.numbers(py, |frame| frame.somersaults);
        /// float: Deviation of the somersaults of the whole flight.
        somersaults_deviation: f64 = |own| own.flight.turns_deviation[0];
        /// ndarray, shape (n_frames,): Twists since the first frame, to the left positive.
        twists: Bound<'py, PyAny> = |own, py| own.numbers(py, |frame| frame.twists);
        /// float: Deviation of the twists of the whole flight.
        twists_deviation: f64 = |own| own.flight.turns_deviation[1];
        /// ndarray, shape (n_frames,): Tilt of the body out of the plane of the somersault, rad.
        tilt: Bound<'py, PyAny> = |own, py| own.numbers(py, |frame| frame.tilt);
        /// float: Gravity over that of the model: 1 unless it was sought.
        gravity: f64 = |own| own.flight.gravity[0];
        /// float: Its deviation; 0 if it was not sought.
        gravity_deviation: f64 = |own| own.flight.gravity[1];
        /// float: Gravity over that of the model as the recording has it: where it was not sought, by one step of the search from the
        /// minimum. Where it is not 1 the rate of the frames or the unit is wrong.
        seen_gravity: f64 = |own| own.flight.seen_gravity[0];
        /// float: Its deviation.
        seen_gravity_deviation: f64 = |own| own.flight.seen_gravity[1];
        /// FlightPhase or None: Take-off and entry as they were found; None where `interval` was given, or nothing falls.
        phase: Option<FlightPhase> = |own| own.flight.phase.clone().map(|phase| FlightPhase { phase });
        /// ndarray, shape (11, 11): Covariance of angular momentum, centre of mass and its velocity in the first frame, scale and gravity.
        covariance: PyResult<Bound<'py, PyAny>> = |own, py| matrix_array(py, &own.flight.covariance);
        /// tuple of float: The noise: standard deviation of a coordinate of a marker of weight 1, m; fraction of the variance that is correlated; the time
        /// over which it is, s.
        noise: (f64, f64, f64) =
            |own| (own.flight.noise.size, own.flight.noise.correlated, own.flight.noise.time);
        /// float or None: χ² per degree of freedom, against the noise that was given, or else that fits of single frames leave, which know
        /// no law of flight. None where these have no coordinates beyond their unknowns.
        chi_squared: Option<f64> = |own| own.flight.chi_squared;
        /// tuple of float: Where it must lie.
        chi_squared_range: (f64, f64) = |own| own.flight.chi_squared_range.into();
        /// float: When the push begins that fits best, s; it counts where that departure is beyond its limit.
        push_time: f64 = |own| own.flight.push_time;
        /// float: Largest angle to the orientations that the full equations of motion lead to from the first frame on, joints prescribed, rad.
        full_dynamics_defect: f64 = |own| own.flight.full_dynamics_defect;
        /// int: Iterations made.
        iterations: usize = |own| own.flight.iterations;
        /// str: How the search ended and what the checks found: ``'converged'``, ``'iteration_limit'``, ``'no_progress'``,
        /// ``'undetermined'`` where markers determine too little, ``'misfit'`` where the laws of flight do not hold for the
        /// recording with this model, rate, unit and interval, ``'not_confirmed'`` where the full equations of motion lead elsewhere,
        /// ``'not_in_flight'`` where no stretch falls with gravity and the laws of flight lead far from the markers: then the search ended early, and its numbers
        /// mean nothing.
        status: &'static str = |own| name_of(&ReconstructionStatus::ALL, &own.flight.status);
        /// bool: Whether the search converged, the covariance is finite, χ² per degree of freedom is known and within its range, `departures` are
        /// within their limits, and the full equations of motion confirm the flight.
        success: bool = |own| own.flight.success();
    }
}

#[pymethods]
impl ReconstructedFlight {
    /// tuple of str: Bodies whose joints no marker sees, which are taken to be near the posture of the start, ± 0.5 rad. The deviations
    /// of all else contain that.
    #[getter]
    fn unseen<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, bodies_of(&self.markers.get().model.get().model, &self.flight.unseen))
    }

    /// dict of str to float: χ² per degree of freedom of departures: about 1 where the laws of flight hold and the body is that of the model,
    /// more where something else fits better. ``'whole'``: momentum and centre of mass vary over the whole flight, by polynomials of time
    /// of degrees 3 and 4; ``'start'``, ``'end'``: they do in its first and in its last 0.08 s; ``'size'``: a size that was given is another;
    /// ``'air'``: the air slows the body; ``'push'``: something pushes it for a tenth of its duration; ``'places'``: markers are elsewhere
    /// on their bodies, by more than 2 mm; ``'plane'``: a planar body leaves its plane, by more than 3°. NaN where the markers do not
    /// determine one, of a size that was sought, and of the plane where the body is not planar or nothing was measured across it.
    #[getter]
    fn departures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        by_departure(py, &self.flight.departures)
    }

    /// dict of str to float: What each must not exceed: passed by chance once in 4000 cases.
    #[getter]
    fn departure_limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        by_departure(py, &self.flight.departure_limits)
    }

    /// dict of str to ndarray, shape (3,): For each marker how far it is from where the model has it, at scale 1 in axes of its body, m: one step of the
    /// search from the minimum, where offsets are normal with a standard deviation of 30 mm before the recording is looked at. Added to
    /// the places of a `MarkerSet` they put them right. Empty where the markers determine too little.
    #[getter]
    fn marker_offsets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.by_marker(py, |offset| &offset.value)
    }

    /// dict of str to ndarray, shape (3,): Their deviations.
    #[getter]
    fn marker_offset_deviations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.by_marker(py, |offset| &offset.deviation)
    }

    /// tuple of tuple: Markers that were exchanged, as left and right are, and were put right before the last search: for each two names, the
    /// first and the last time, s, and the number of frames. Found where the flight predicts each at the place of the other, beyond six
    /// standard deviations of the noise.
    #[getter]
    fn exchanges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let of = |Exchange { markers: [a, b], start, end, n_frames }: &Exchange| {
            (a.clone(), b.clone(), *start, *end, *n_frames)
        };
        PyTuple::new(py, self.flight.exchanges.iter().map(of).collect::<Vec<_>>())
    }

    /// dict of str to tuple of float: For each joint that is beyond a limit that the model states by more than 0.02 rad or m, by the body that it
    /// carries: how far at most, its deviation, and when, s. Limits bound the search softly, by 0.1 rad or m; 0.3 beyond them, and four
    /// deviations, is a misfit.
    #[getter]
    fn beyond_limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        limits_dict(py, &self.flight.beyond_limits)
    }

    /// ndarray, shape (n_frames, n_markers): Distances of the markers to the recorded ones, m, in the plane of a planar model; NaN where one is missing.
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let width = self.width(|frame| frame.residuals.len());
        self.rows(py, &[width], |frame| frame.residuals.iter().map(|r| r.unwrap_or(f64::NAN)).collect())
    }

    /// dict of str to float: Root mean square of the residuals of each marker, m; NaN for one never seen.
    #[getter]
    fn marker_rms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        rms_dict(py, self.markers.get(), self.flight.rms_of_markers())
    }

    /// str: Whether it is a success, or why not, and which joints no marker sees.
    #[getter]
    fn message(&self) -> String {
        message_of(self.flight.message(), &self.markers.get().model.get().model, &self.flight.unseen)
    }

    fn __len__(&self) -> usize {
        self.flight.frames.len()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, flight) = (slf.py(), &slf.get().flight);
        let width = flight.frames.first().map_or(0, |frame| packed(frame).len());
        let rows = flight.frames.iter().flat_map(packed).collect();
        let frames = array(py, rows, &[flight.frames.len(), width])?;
        let status = name_of(&ReconstructionStatus::ALL, &flight.status);
        let of = |quantity: &Quantity| [quantity.value, quantity.deviation].map(<[f64; 3]>::from);
        let quantities = [&flight.angular_momentum, &flight.center_of_mass, &flight.velocity].map(of);
        let noise = slf.get().noise();
        let numbers = (flight.scale, flight.gravity, flight.height, flight.turns_deviation, noise);
        let checks = (
            flight.chi_squared,
            flight.chi_squared_range,
            ([flight.departures, flight.departure_limits], flight.push_time),
            flight.full_dynamics_defect,
            flight.unseen.clone(),
            flight.iterations,
        );
        let covariance = matrix_array(py, &flight.covariance)?;
        let offsets = flight.marker_offsets.iter().map(|(name, offset)| (name.clone(), of(offset)));
        let limits = limits_pickled(&flight.beyond_limits);
        let markers = (offsets.collect::<Vec<_>>(), slf.get().exchanges(py)?, limits);
        let found =
            (markers, slf.get().phase().map(|phase| Py::new(py, phase)).transpose()?, flight.seen_gravity);
        let arguments =
            (slf.get().markers(py), status, frames, quantities, numbers, checks, covariance, found);
        by_restore(slf, arguments)
    }

    /// A pickled flight.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        markers: Py<MarkerSet>,
        status: &str,
        frames: &Bound<'_, PyAny>,
        quantities: [[[f64; 3]; 2]; 3],
        numbers: Numbers,
        checks: Checks,
        covariance: &Bound<'_, PyAny>,
        found: (Markers, Option<Py<FlightPhase>>, [f64; 2]),
    ) -> Result<Self, Error> {
        let (scale, gravity, height, turns_deviation, (size, correlated, time)) = numbers;
        let (chi_squared, chi_squared_range, departures, full_dynamics_defect, unseen, iterations) = checks;
        let ([departures, departure_limits], push_time) = departures;
        let ((offsets, exchanges, limits), phase, seen_gravity) = found;
        let rows = matrix("frames", frames)?;
        let frames = rows.row_iter().map(|row| {
            let row: Vec<f64> = row.iter().copied().collect();
            unpacked(&row, &markers.get().model.get().model, markers.get().markers.markers().len())
        });
        let quantity =
            |[value, deviation]: [[f64; 3]; 2]| Quantity { value: value.into(), deviation: deviation.into() };
        let [angular_momentum, center_of_mass, velocity] = quantities.map(quantity);
        let flight = Flight {
            status: status_of(&ReconstructionStatus::ALL, status)?,
            frames: frames.collect::<Result<_, _>>()?,
            scale,
            angular_momentum,
            center_of_mass,
            velocity,
            gravity,
            seen_gravity,
            phase: phase.map(|phase| phase.get().phase.clone()),
            height,
            turns_deviation,
            covariance: matrix("covariance", covariance)?,
            noise: MarkerNoise { size, correlated, time },
            chi_squared,
            chi_squared_range,
            departures,
            departure_limits,
            push_time,
            marker_offsets: offsets.into_iter().map(|(name, offset)| (name, quantity(offset))).collect(),
            full_dynamics_defect,
            unseen,
            exchanges: exchanges
                .into_iter()
                .map(|(a, b, start, end, n_frames)| Exchange { markers: [a, b], start, end, n_frames })
                .collect(),
            beyond_limits: limits_restored(limits),
            iterations,
        };
        Ok(Self { markers, flight })
    }

    fn __repr__(&self) -> String {
        let flight = &self.flight;
        format!(
            "<ReconstructedFlight: {} frames, {}, {:.2} somersaults, {:.2} twists, {:.1} kg m²/s>",
            flight.frames.len(),
            name_of(&ReconstructionStatus::ALL, &flight.status),
            flight.somersaults(),
            flight.twists(),
            flight.angular_momentum.value.norm()
        )
    }
}

/// The bodies whose joints have some of the velocities with these numbers.
pub(super) fn bodies_of<'m>(model: &'m somersault::multibody::Model, numbers: &[usize]) -> Vec<&'m str> {
    let has_one = |i: &usize| model.velocities_of(*i).any(|k| numbers.contains(&k));
    (0..model.n_bodies()).filter(has_one).filter_map(|i| model.name(i)).collect()
}

/// What a result says, and which joints no marker sees.
pub(super) fn message_of(text: String, model: &somersault::multibody::Model, unseen: &[usize]) -> String {
    let unseen = bodies_of(model, unseen);
    if unseen.is_empty() { text } else { format!("{text}; no marker sees {}", unseen.join(", ")) }
}

/// Joints beyond their limits by the bodies that they carry.
pub(super) fn limits_dict<'py>(py: Python<'py>, limits: &[BeyondLimit]) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    for BeyondLimit { body, by, deviation, time } in limits {
        found.set_item(body, (*by, *deviation, *time))?;
    }
    Ok(found)
}

/// Joints beyond their limits as pickled.
pub(super) fn limits_pickled(limits: &[BeyondLimit]) -> Vec<(String, [f64; 3])> {
    let of = |limit: &BeyondLimit| (limit.body.clone(), [limit.by, limit.deviation, limit.time]);
    limits.iter().map(of).collect()
}

/// The same restored.
pub(super) fn limits_restored(limits: Vec<(String, [f64; 3])>) -> Vec<BeyondLimit> {
    let of = |(body, [by, deviation, time]): (_, [f64; 3])| BeyondLimit { body, by, deviation, time };
    limits.into_iter().map(of).collect()
}

/// Root mean squares by the names of markers, NaN for one never seen.
pub(super) fn rms_dict<'py>(
    py: Python<'py>,
    markers: &MarkerSet,
    rms: Vec<Option<f64>>,
) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    for (marker, rms) in markers.markers.markers().iter().zip(rms) {
        found.set_item(&marker.name, rms.unwrap_or(f64::NAN))?;
    }
    Ok(found)
}

/// Scale, gravity, height, deviations of the turns, noise.
type Numbers = ([f64; 2], [f64; 2], f64, [f64; 2], (f64, f64, f64));

/// χ², its range, departures and their limits with the time of a push, defect, joints that are not seen, iterations.
type Checks = (Option<f64>, [f64; 2], ([[f64; 8]; 2], f64), f64, Vec<usize>, usize);

/// Offsets of markers, exchanges, joints beyond their limits.
type Markers =
    (Vec<(String, [[f64; 3]; 2])>, Vec<(String, String, f64, f64, usize)>, Vec<(String, [f64; 3])>);

/// Numbers by the names of departures.
fn by_departure<'py>(py: Python<'py>, numbers: &[f64]) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    for ((_, name), number) in Departure::ALL.iter().zip(numbers) {
        found.set_item(*name, *number)?;
    }
    Ok(found)
}

/// Numbers of a frame beside those whose count depends on the model.
const N_OF_FRAME: usize = 26;

/// A frame as one row.
fn packed(frame: &FlightFrame) -> Vec<f64> {
    let FlightFrame { angular_velocity, .. } = frame;
    let mut row = vec![frame.time];
    row.extend(frame.center_of_mass.iter());
    row.extend(angular_velocity.value.iter().chain(angular_velocity.deviation.iter()));
    row.extend([frame.moment_of_inertia, frame.moment_of_inertia_deviation]);
    row.extend(frame.inertia.iter());
    row.extend([frame.somersaults, frame.twists, frame.tilt, frame.inclination, frame.inclination_deviation]);
    row.extend(frame.q.iter().chain(&frame.v).chain(&frame.covariance));
    row.extend(frame.residuals.iter().map(|r| r.unwrap_or(f64::NAN)));
    row
}

/// The frame of a row.
fn unpacked(
    row: &[f64],
    model: &somersault::multibody::Model,
    n_markers: usize,
) -> Result<FlightFrame, Error> {
    let (n_q, n_v) = (model.n_positions(), model.n_velocities());
    let n_linear = model.joint(0).map_or(0, |joint| joint.kind().n_linear);
    let n = n_v - n_linear;
    same_length("frames", row.len(), N_OF_FRAME + n_q + n_v + n * n + n_markers)?;
    let (fixed, rest) = row.split_at(N_OF_FRAME);
    let (q, rest) = rest.split_at(n_q);
    let (v, rest) = rest.split_at(n_v);
    let (covariance, residuals) = rest.split_at(n * n);
    let three = |first: usize| Vector3::from_column_slice(&fixed[first..first + 3]);
    Ok(FlightFrame {
        time: fixed[0],
        q: q.to_vec(),
        v: v.to_vec(),
        covariance: DMatrix::from_column_slice(n, n, covariance),
        center_of_mass: three(1),
        angular_velocity: Quantity { value: three(4), deviation: three(7) },
        moment_of_inertia: fixed[10],
        moment_of_inertia_deviation: fixed[11],
        inertia: Matrix3::from_column_slice(&fixed[12..21]),
        somersaults: fixed[21],
        twists: fixed[22],
        tilt: fixed[23],
        inclination: fixed[24],
        inclination_deviation: fixed[25],
        residuals: residuals.iter().map(|r| (!r.is_nan()).then_some(*r)).collect(),
    })
}
