//! Smooth motions behind recordings.

use super::fit::MarkerSet;
use super::markers::MarkerRecording;
use super::matrix::{count, matrix, numbers_array, same_length};
use super::motion_fit::{name_of, status_of};
use super::reconstruction::{
    bodies_of, limits_dict, limits_pickled, limits_restored, message_of, noise_of, rms_dict, scale_of,
};
use crate::core::convert::array;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::leave_on_signal;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::motion::smoothing::{
    Deviations, MarkerNoise, MotionSmoother, SmoothedFrame, SmoothedMotion as Motion, SmoothingOptions,
    SmoothingStatus,
};

/// Finds the smooth motion behind a recording, on the ground or elsewhere, with velocities and accelerations.
///
/// One motion is fitted to all frames at once. Of the joints and of the root nothing is taken for granted but that third derivatives are
/// white noise, rougher in few steps than in the others, which for a single number makes the smoothest curve a quintic spline; its density is
/// estimated for each joint. So are size and correlation of the noise, by restricted maximum likelihood over up to 160 frames of the
/// middle: taken for white, noise that is correlated, as that of video is, makes intervals that are far too short. In flight,
/// where the laws of flight hold, `reconstruct_flight` knows more.
///
/// Other Python threads run meanwhile. Ctrl-C raises at once and stops the search.
///
/// Parameters
/// ----------
/// markers : MarkerSet
///     The markers, and the model they are on.
/// recording : MarkerRecording
///     The motion. Frames without markers at both ends are left out.
/// scale : float or tuple of float, optional
///     Size over that of the model if it is known; otherwise its mean and standard deviation before the markers are looked at,
///     1 ± 0.1 unless given.
/// threshold : float or None, optional
///     Distance in standard deviations from which on a marker counts less (Huber's loss); None counts squares.
/// noise : float or tuple of float, optional
///     The noise of each coordinate of a marker of weight 1 if it is known: the standard deviation of white noise, m; or this, the fraction of
///     the variance that is correlated, and the time over which it is, s. It is estimated unless given.
/// freedom : float or None, optional
///     Degrees of freedom of Student's distribution, which the third derivatives of a step have: few let some steps be much rougher than
///     the others, as a blow is; they are normal if None.
/// max_iterations : int, optional
///     Iterations, at most, between estimates of the noise and of the roughness; 50 unless given.
///
/// Returns
/// -------
/// SmoothedMotion
///     The best motion that was found, whatever its status.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, the recording has none of the markers, fewer than ten frames show any, or frames are so many that
///     their covariances take more than 1 GB.
///
/// Notes
/// -----
/// The cost is minimised by Gauss-Newton steps over the states of all frames, each of which is joined to the next alone: a step takes
/// O(N n³) for N frames of n unknowns, three for each degree of freedom and one for each coordinate of a marker.
///
/// References
/// ----------
/// H. J. Woltring, Adv. Eng. Software 8 (1986) 104. H. E. Rauch, F. Tung and C. T. Striebel, AIAA J. 3 (1965) 1445. T. D. Barfoot, *State
/// Estimation for Robotics*, Cambridge University Press 2017, chapter 11.
///
/// Examples
/// --------
/// A diver who bends and stands up again, seen with noise of 10 mm; the rate of the hips a quarter of the way:
///
/// >>> import numpy as np
/// >>> from somersault import motion, multibody
/// >>> diver = multibody.diver_planar()
/// >>> straight, pike = diver.configuration("A"), diver.configuration("H")
/// >>> t = np.linspace(0.0, 1.0, 51)
/// >>> q = straight + np.sin(np.pi * t[:, None]) ** 2 * (pike - straight)
/// >>> markers = motion.MarkerSet.joint_centres(diver.model)
/// >>> seen = motion.place_markers(markers, t, q)
/// >>> points = seen.points + np.random.default_rng(1).normal(0.0, 0.01, seen.points.shape)
/// >>> found = motion.smooth_motion(markers, motion.MarkerRecording(seen.names, t, points))
/// >>> found.success, found.unseen
/// (True, ('toes', 'head', 'hand'))
/// >>> hip = 4
/// >>> rate = np.pi * np.sin(2 * np.pi * t[12]) * (pike - straight)[hip]
/// >>> bool(abs(found.v[12, hip] - rate) < 3 * found.v_deviations[12, hip] < 0.2 * abs(rate))
/// True
#[pyfunction]
#[pyo3(signature = (markers, recording, *, scale=None, threshold=4.0, noise=None, freedom=3.0, max_iterations=None))]
pub(crate) fn smooth_motion(
    py: Python<'_>,
    markers: &Bound<'_, MarkerSet>,
    recording: &Bound<'_, MarkerRecording>,
    scale: Option<&Bound<'_, PyAny>>,
    threshold: Option<f64>,
    noise: Option<&Bound<'_, PyAny>>,
    freedom: Option<f64>,
    max_iterations: Option<i128>,
) -> Result<SmoothedMotion, Error> {
    let default = SmoothingOptions::default();
    let options = SmoothingOptions {
        scale: scale.map_or(Ok(default.scale), scale_of)?,
        threshold,
        noise: noise.map(noise_of).transpose()?,
        freedom,
        max_iterations: max_iterations.map_or(Ok(default.max_iterations), |n| count("max_iterations", n))?,
    };
    let set = markers.get();
    let problem = MotionSmoother::try_new(&set.model.get().model, set.markers.clone(), options)?;
    let recording = recording.get().recording.clone();
    let motion = leave_on_signal(py, move |token| problem.smooth_cancellable(&recording, token))?;
    Ok(SmoothedMotion { markers: markers.clone().unbind(), motion })
}

/// A smooth motion nearest to a recording. Arrays have a row for each frame.
///
/// Deviations are standard deviations by linearisation, infinite for what no marker sees. Pictures, `plotting.tree_motion` and the viewer take it like a
/// MotionFit.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct SmoothedMotion {
    markers: Py<MarkerSet>,
    motion: Motion,
}

impl SmoothedMotion {
    /// Numbers of each frame.
    fn rows<'py>(
        &self,
        py: Python<'py>,
        width: usize,
        of: impl Fn(&SmoothedFrame) -> &Vec<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let values = self.motion.frames.iter().flat_map(|frame| of(frame).iter().copied()).collect();
        Ok(array(py, values, &[self.motion.frames.len(), width])?.into_any())
    }

    fn tree(&self) -> &somersault::multibody::Model {
        &self.markers.get().model.get().model
    }
}

value! {
    impl SmoothedMotion {
        /// MarkerSet: The markers, and the model they are on.
        markers: Py<MarkerSet> = |own, py| own.markers.clone_ref(py);
        /// Model: The model.
        model: Py<Model> = |own, py| own.markers.get().model.clone_ref(py);
        /// ndarray, shape (n_frames,): Times, s.
        times: Bound<'py, PyAny> =
            |own, py| numbers_array(py, &own.motion.frames.iter().map(|frame| frame.time).collect::<Vec<_>>());
        /// ndarray, shape (n_frames, n_positions): Configurations of the model; places of its root are in m and not scaled.
        q: PyResult<Bound<'py, PyAny>> = |own, py| own.rows(py, own.tree().n_positions(), |frame| &frame.q);
        /// ndarray, shape (n_frames, n_velocities): Their velocities; that of the root in m/s, in its axes.
        v: PyResult<Bound<'py, PyAny>> = |own, py| own.rows(py, own.tree().n_velocities(), |frame| &frame.v);
        /// ndarray, shape (n_frames, n_velocities): Their accelerations, the derivatives of `v`, as `Model.inverse_dynamics` takes them.
        a: PyResult<Bound<'py, PyAny>> = |own, py| own.rows(py, own.tree().n_velocities(), |frame| &frame.a);
        /// ndarray, shape (n_frames, n_velocities): Deviations of the configurations, rad or m, in the order of `v`.
        q_deviations: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, own.tree().n_velocities(), |frame| &frame.deviations.positions);
        /// ndarray, shape (n_frames, n_velocities): Deviations of the velocities.
        v_deviations: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, own.tree().n_velocities(), |frame| &frame.deviations.velocities);
        /// ndarray, shape (n_frames, n_velocities): Deviations of the accelerations.
        a_deviations: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, own.tree().n_velocities(), |frame| &frame.deviations.accelerations);
        /// float: Size over that of the model.
        scale: f64 = |own| own.motion.scale[0];
        /// float: Its deviation; 0 if it was known.
        scale_deviation: f64 = |own| own.motion.scale[1];
        /// tuple of float: The noise: standard deviation of a coordinate of a marker of weight 1, m; fraction of the variance that is correlated; the time
        /// over which it is, s.
        noise: (f64, f64, f64) =
            |own| (own.motion.noise.size, own.motion.noise.correlated, own.motion.noise.time);
        /// float or None: χ² per degree of freedom, against the noise that was given, or else that fits of single frames leave, which do
        /// not assume that a motion is smooth. None where these have no coordinates beyond their unknowns.
        chi_squared: Option<f64> = |own| own.motion.chi_squared;
        /// tuple of float: Where it must lie.
        chi_squared_range: (f64, f64) = |own| own.motion.chi_squared_range.into();
        /// float or None: χ² per degree of freedom of the fifth of a second where it is largest against its limit.
        worst: Option<f64> = |own| own.motion.worst;
        /// float: The limit there.
        worst_limit: f64 = |own| own.motion.worst_limit;
        /// float: Where that fifth of a second begins, s.
        worst_time: f64 = |own| own.motion.worst_time;
        /// float: The largest smoothed disturbance of a number in a step between frames over its standard deviation; beyond its limit velocities jump
        /// as no smooth motion's do.
        disturbance: f64 = |own| own.motion.disturbance;
        /// float: What it must not exceed.
        disturbance_limit: f64 = |own| own.motion.disturbance_limit;
        /// float: The frame from which that step is, s.
        disturbance_time: f64 = |own| own.motion.disturbance_time;
        /// int: Points that the robust loss counts less than half, which χ² leaves out; a twentieth of all at most.
        n_outliers: usize = |own| own.motion.n_outliers;
        /// int: Iterations made.
        iterations: usize = |own| own.motion.iterations;
        /// str: How the search ended and what the checks found: ``'converged'``, ``'iteration_limit'``, ``'no_progress'``,
        /// ``'undetermined'`` where markers determine too little, ``'misfit'`` where the motion is not smooth, or the body is another.
        status: &'static str = |own| name_of(&SmoothingStatus::ALL, &own.motion.status);
        /// bool: Whether the search converged, the covariance is finite, χ² per degree of freedom is known and within its range over all frames and
        /// everywhere, no velocity jumps, and no joint is far beyond its limits.
        success: bool = |own| own.motion.success();
    }
}

#[pymethods]
impl SmoothedMotion {
    /// tuple of str: Bodies whose joints, or some of their axes, no marker sees. They rest in the posture of the first frame, their deviations are infinite.
    #[getter]
    fn unseen<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, bodies_of(self.tree(), &self.motion.unseen))
    }

    /// dict of str to tuple of float: For each joint that is beyond a limit that the model states by more than 0.02 rad or m, by the body that it
    /// carries: how far at most, its deviation, and when, s. Limits bound the search softly, by 0.1 rad or m; 0.3 beyond them, and four
    /// deviations, is a misfit.
    #[getter]
    fn beyond_limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        limits_dict(py, &self.motion.beyond_limits)
    }

    /// ndarray, shape (n_frames, n_markers): Distances of the markers to the recorded ones, m, in the plane of a planar model; NaN where one is missing.
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let frames = &self.motion.frames;
        let values = frames.iter().flat_map(|frame| frame.residuals.iter().map(|r| r.unwrap_or(f64::NAN)));
        let width = self.markers.get().markers.markers().len();
        Ok(array(py, values.collect(), &[frames.len(), width])?.into_any())
    }

    /// dict of str to float: Root mean square of the residuals of each marker, m; NaN for one never seen.
    #[getter]
    fn marker_rms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        rms_dict(py, self.markers.get(), self.motion.rms_of_markers())
    }

    /// str: Whether it is a success, or why not, and which joints no marker sees.
    #[getter]
    fn message(&self) -> String {
        message_of(self.motion.message(), self.tree(), &self.motion.unseen)
    }

    fn __len__(&self) -> usize {
        self.motion.frames.len()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let motion = &own.motion;
        let width = motion.frames.first().map_or(0, |frame| packed(frame).len());
        let frames =
            array(py, motion.frames.iter().flat_map(packed).collect(), &[motion.frames.len(), width])?;
        let checks = (
            (motion.chi_squared, motion.chi_squared_range),
            (motion.worst, motion.worst_limit, motion.worst_time),
            (motion.disturbance, motion.disturbance_limit, motion.disturbance_time),
            (motion.n_outliers, motion.unseen.clone(), motion.iterations),
        );
        let limits = limits_pickled(&motion.beyond_limits);
        by_restore(slf, (own.markers(py), own.status(), frames, motion.scale, own.noise(), checks, limits))
    }

    /// A pickled motion.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        markers: Py<MarkerSet>,
        status: &str,
        frames: &Bound<'_, PyAny>,
        scale: [f64; 2],
        noise: (f64, f64, f64),
        checks: Checks,
        limits: Vec<(String, [f64; 3])>,
    ) -> Result<Self, Error> {
        let (
            (chi_squared, chi_squared_range),
            (worst, worst_limit, worst_time),
            (disturbance, disturbance_limit, disturbance_time),
            (n_outliers, unseen, iterations),
        ) = checks;
        let (size, correlated, time) = noise;
        let rows = matrix("frames", frames)?;
        let frames = rows.row_iter().map(|row| {
            let row: Vec<f64> = row.iter().copied().collect();
            unpacked(&row, &markers.get().model.get().model, markers.get().markers.markers().len())
        });
        let motion = Motion {
            status: status_of(&SmoothingStatus::ALL, status)?,
            frames: frames.collect::<Result<_, _>>()?,
            scale,
            noise: MarkerNoise { size, correlated, time },
            chi_squared,
            chi_squared_range,
            worst,
            worst_limit,
            worst_time,
            disturbance,
            disturbance_limit,
            disturbance_time,
            n_outliers,
            unseen,
            beyond_limits: limits_restored(limits),
            iterations,
        };
        Ok(Self { markers, motion })
    }

    fn __repr__(&self) -> String {
        let motion = &self.motion;
        format!(
            "<SmoothedMotion: {} frames, {}, noise {:.1} mm>",
            motion.frames.len(),
            name_of(&SmoothingStatus::ALL, &motion.status),
            1e3 * motion.noise.size
        )
    }
}

/// χ² and its range; the worst fifth of a second; the largest disturbance; outliers, what is not seen, iterations.
type Checks = ((Option<f64>, [f64; 2]), (Option<f64>, f64, f64), (f64, f64, f64), (usize, Vec<usize>, usize));

/// A frame as one row.
fn packed(frame: &SmoothedFrame) -> Vec<f64> {
    let Deviations { positions, velocities, accelerations } = &frame.deviations;
    let mut row = vec![frame.time];
    for numbers in [&frame.q, &frame.v, &frame.a, positions, velocities, accelerations] {
        row.extend(numbers);
    }
    row.extend(frame.residuals.iter().map(|r| r.unwrap_or(f64::NAN)));
    row
}

/// The frame of a row.
fn unpacked(
    row: &[f64],
    model: &somersault::multibody::Model,
    n_markers: usize,
) -> Result<SmoothedFrame, Error> {
    let (n_q, n_v) = (model.n_positions(), model.n_velocities());
    same_length("frames", row.len(), 1 + n_q + 5 * n_v + n_markers)?;
    let (q, rest) = row[1..].split_at(n_q);
    let (numbers, residuals) = rest.split_at(5 * n_v);
    let part = |k: usize| numbers[k * n_v..(k + 1) * n_v].to_vec();
    Ok(SmoothedFrame {
        time: row[0],
        q: q.to_vec(),
        v: part(0),
        a: part(1),
        deviations: Deviations { positions: part(2), velocities: part(3), accelerations: part(4) },
        residuals: residuals.iter().map(|r| (!r.is_nan()).then_some(*r)).collect(),
    })
}
