//! Flights flown again with a change, and advice for the entry.

use super::identification::facing_of;
use super::motion_fit::name_of;
use super::phases::bounds;
use super::reconstruction::ReconstructedFlight;
use crate::core::convert::{a_type, array, finite, integer_or_none};
use crate::core::error::{Error, did_you_mean};
use crate::core::value::{Pickled, by_restore, counted, value};
use crate::core::waiting::leave_on_signal;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::motion::advice::{
    self, AdviceStatus, Correction, FlightAdvice as Found, Outcome, Reach, WhatIf as Flown, WhatIfFlight,
};
use somersault::motion::identification::{Facing, identify_flight};
use somersault::motion::phases::WithInterval;
use somersault::multibody::flight::{FlightChange, HeldPosture};

/// Flies a reconstructed flight again with a change: what would have been.
///
/// The joints of the flight, its momentum, its parabola and its first orientation are those of the reconstruction; between frames joints are cubic
/// Hermite interpolants. With σ(x) = 3x² − 2x³, which rises while the folded posture is held,
///
/// .. code-block:: text
///
///     s(t) = h(τ) ⊕ posture · w(τ) d,   τ = t₀ + r (t − t₀) − opening · σ(x),   L → (1 + momentum) L
///
/// so that the posture is left later by `opening`, and all that follows with it; d closes hips and, of a tuck, knees. Numbers of hinges are added; a ball
/// turns by the rotation vector in the axes of its body. A flight that rises higher by `height`
/// lasts until the centre of mass is where it was at the end, and all joints take their time in proportion. The orientation is integrated in
/// steps of 5 ms, of order 4.
///
/// A flight that is no success is flown again as it was found: ask `flight.success` before. Frames that are so far apart that the joints between them lead to another entry are
/// refused.
///
/// Beside what is flown stands the linear change: by exact derivatives of the orientation by opening, posture and momentum, and by central
/// differences by the height and of the line from feet to hands. `agrees` says whether both differ by at most a tenth, in the entry and, beyond 0.01, in the twists; they do not for
/// large changes, nor for throws and square-outs of twisting dives.
///
/// Parameters
/// ----------
/// flight : ReconstructedFlight
///     Of a diver: `diver_planar`, `diver_spatial`, `diver_ball_jointed`, or a model with hinges, slides and balls whose bodies have their names.
/// opening : float
///     By how much later the posture is left, s; earlier where it is negative. At most 0.6 of the time it is held, to either side.
/// posture : float
///     By how much tighter the posture is, rad of the joint that moves most; looser where it is negative. A ball turns about the axis that
///     closes its angle most.
/// momentum : float
///     By which fraction of it the angular momentum is larger, from −1 to 1.
/// height : float
///     By how much higher the centre of mass rises, m.
/// phase : tuple of float, optional
///     When the posture that changes begins to be taken, is taken, begins to be left and is left, s: rising. Unless given, the phase in which the
///     hip is closed most; a flight that is not folded has none.
/// joints : dict of str to float, optional
///     Degrees of freedom that `posture` moves, and how far for 1: of a throw, for instance, those of an arm. Names are those of bodies whose joint
///     has one degree of freedom; of balls those of their bodies with `_x`, `_y` or `_z`, about whose axes they turn. Hips and knees unless given.
///
/// Returns
/// -------
/// WhatIf
///
/// Raises
/// ------
/// InputError
///     If a change is beyond what is allowed or the flight holds no posture, times do not rise or leave the flight, a name is unknown, or the
///     model has not the bodies of a diver, or has free or planar joints beside the root's.
///
/// Examples
/// --------
/// A pike that is opened 20 ms later turns further:
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
/// >>> points = seen.points + np.random.default_rng(1).normal(0.0, 0.005, seen.points.shape)
/// >>> flight = motion.reconstruct_flight(markers, motion.MarkerRecording(seen.names, seen.times, points))
/// >>> found = motion.what_if(flight, opening=0.02)
/// >>> found.agrees, bool(10.0 < np.degrees(found.entry_angle_change) < 20.0)
/// (True, True)
#[pyfunction]
#[pyo3(signature = (flight, *, opening=0.0, posture=0.0, momentum=0.0, height=0.0, phase=None, joints=None))]
pub(crate) fn what_if(
    flight: &Bound<'_, ReconstructedFlight>,
    opening: f64,
    posture: f64,
    momentum: f64,
    height: f64,
    phase: Option<[f64; 4]>,
    joints: Option<&Bound<'_, PyDict>>,
) -> Result<WhatIf, Error> {
    let (py, own) = (flight.py(), flight.get());
    let model = own.markers.get().model.get().model.clone();
    let direction = joints.map(|joints| direction_of(&model, joints)).transpose()?;
    let (known, change) = (own.flight.clone(), FlightChange { opening, posture, momentum, height });
    let flown = leave_on_signal(py, move |_| {
        let report = identify_flight(&model, &known, None)?;
        let mut again = WhatIfFlight::try_new(&model, &known, &report, None)?;
        if phase.is_some() || direction.is_some() {
            let own = again.folded();
            let times = phase.or(own.map(|folded| folded.times));
            let direction = direction.or(own.map(|folded| folded.direction.clone()));
            let n = model.n_velocities() - model.velocities_of(0).len();
            let argument = if times.is_none() { "joints" } else { "posture" };
            let times = times.ok_or(advice::AdviceError::NotFolded { argument })?;
            let held = HeldPosture { times, direction: direction.unwrap_or_else(|| vec![0.0; n]) };
            again = WhatIfFlight::try_new(&model, &known, &report, Some(held))?;
        }
        let phase = again.held();
        again.fly(&change).map(|flown| (flown, phase))
    })?;
    let (flown, phase) = flown;
    let joints = joints.map(|joints| joints.copy()).transpose()?.map(Bound::unbind);
    Ok(WhatIf { flight: flight.clone().unbind(), phase, joints, flown })
}

fn direction_of(model: &somersault::multibody::Model, joints: &Bound<'_, PyDict>) -> Result<Vec<f64>, Error> {
    let n_root = model.velocities_of(0).len();
    let mut direction = vec![0.0; model.n_velocities() - n_root];
    let mut names = Vec::with_capacity(direction.len());
    for (i, link) in model.links().iter().enumerate().skip(1) {
        let (name, dofs) = (link.name(), model.velocities_of(i));
        if dofs.len() == 1 {
            names.push((name.to_owned(), dofs.start));
        } else {
            names.extend(["x", "y", "z"].iter().zip(dofs).map(|(axis, k)| (format!("{name}_{axis}"), k)));
        }
    }
    for (name, size) in joints.iter() {
        let wrong = |what: &str| {
            Error::input(format!("`joints` must be names of degrees of freedom with numbers, found {what}"))
        };
        let name: String = name.extract().map_err(|_| wrong(&a_type(&name)))?;
        let size: f64 = size.extract().map_err(|_| wrong(&a_type(&size)))?;
        let Some((_, dof)) = names.iter().find(|(known, _)| *known == name) else {
            let meant = did_you_mean(&name, names.iter().map(|(known, _)| known.as_str()));
            return Err(Error::input(format!(
                "`joints` must name bodies whose joint has one degree of freedom, or a ball's body with _x, _y or _z, found '{name}'{meant}"
            )));
        };
        direction[dof - n_root] = finite("joints", size)?;
    }
    Ok(direction)
}

/// A reconstructed flight with a change, flown. Angles are in rad, counted as in FlightReport.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct WhatIf {
    flight: Py<ReconstructedFlight>,
    phase: Option<[f64; 4]>,
    joints: Option<Py<PyDict>>,
    flown: Flown,
}

value! {
    impl WhatIf {
        /// ReconstructedFlight: The flight as it was.
        flight: Py<ReconstructedFlight> = |own, py| own.flight.clone_ref(py);
        /// Model: The model.
        model: Py<Model> = |own, py| own.flight.get().markers.get().model.clone_ref(py);
        /// float: By how much later the posture is left, s.
        opening: f64 = |own| own.flown.change.opening;
        /// float: By how much tighter it is, rad.
        posture: f64 = |own| own.flown.change.posture;
        /// float: By which fraction the angular momentum is larger.
        momentum: f64 = |own| own.flown.change.momentum;
        /// float: By how much higher the centre of mass rises, m.
        height: f64 = |own| own.flown.change.height;
        /// tuple of float or None: Times at which the diver starts to fold, is folded, starts to open and is open, s; None if the flight has no folded phase.
        phase: Option<(f64, f64, f64, f64)> = |own| own.phase.map(Into::into);
        /// ndarray, shape (n_frames,): Times, s, as many as the flight has frames.
        t: PyResult<Bound<'py, PyAny>> = |own, py| {
            Ok(array(py, own.flown.times.clone(), &[own.flown.times.len()])?.into_any())
        };
        /// ndarray, shape (n_frames, n_positions): Configurations; places of the root are in m and not scaled.
        q: PyResult<Bound<'py, PyAny>> = |own, py| {
            let n = own.flown.times.len();
            let positions = own.flown.positions.clone();
            let width = positions.len() / n;
            Ok(array(py, positions, &[n, width])?.into_any())
        };
        /// float: Somersaults, forwards positive.
        somersaults: f64 = |own| own.flown.outcome.somersaults;
        /// float: Twists, to the left positive.
        twists: f64 = |own| own.flown.outcome.twists;
        /// float: Angle of the line from feet to hands beyond the vertical at the end, rad; negative where the dive is short.
        entry_angle: f64 = |own| own.flown.outcome.entry_angle;
        /// float: By how much the somersaults are more than without the change.
        somersaults_change: f64 = |own| own.flown.flown.somersaults;
        /// float: By how much the twists are.
        twists_change: f64 = |own| own.flown.flown.twists;
        /// float: By how much the angle at the entry is, rad.
        entry_angle_change: f64 = |own| own.flown.flown.entry_angle;
        /// float: The change of the somersaults by derivatives.
        linear_somersaults_change: f64 = |own| own.flown.linear.somersaults;
        /// float: That of the twists.
        linear_twists_change: f64 = |own| own.flown.linear.twists;
        /// float: That of the angle at the entry, rad.
        linear_entry_angle_change: f64 = |own| own.flown.linear.entry_angle;
        /// bool: Whether the linear changes of the angle at the entry and of the twists differ from those that are flown by at most a tenth.
        agrees: bool = |own| own.flown.agrees;
    }
}

/// Attributes of a flight with a change that are numbers.
const OF_CHANGE: [&str; 15] = [
    "opening",
    "posture",
    "momentum",
    "height",
    "phase",
    "somersaults",
    "twists",
    "entry_angle",
    "somersaults_change",
    "twists_change",
    "entry_angle_change",
    "linear_somersaults_change",
    "linear_twists_change",
    "linear_entry_angle_change",
    "agrees",
];

/// Attributes by their names.
fn named<'py>(object: &Bound<'py, PyAny>, names: &[&str]) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(object.py());
    for name in names {
        found.set_item(name, object.getattr(*name)?)?;
    }
    Ok(found)
}

/// What a change comes to, in words.
fn words_of(outcome: &Outcome, flown: &Outcome) -> String {
    format!(
        "{:.2} somersaults, {:.2} twists, the entry {:.0}° {} the vertical, {:.1}° {}",
        outcome.somersaults,
        outcome.twists,
        outcome.entry_angle.abs().to_degrees(),
        if outcome.entry_angle < 0.0 { "short of" } else { "beyond" },
        flown.entry_angle.abs().to_degrees(),
        if flown.entry_angle < 0.0 { "less far" } else { "further" },
    )
}

#[pymethods]
impl WhatIf {
    /// dict of str to float or None: Degrees of freedom that `posture` moves, as they were given.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.joints.as_ref().map(|joints| joints.bind(py).copy()).transpose()
    }

    /// The numbers as a dict, for JSON and tables.
    ///
    /// Returns
    /// -------
    /// dict of str to object
    ///     An entry for each attribute but `flight`, `model`, `joints`, `t` and `q`, by its name.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion, multibody
    /// >>> diver = multibody.diver_planar()
    /// >>> t = np.linspace(0.0, 0.4, 21)
    /// >>> q = np.tile(diver.configuration("A"), (21, 1))
    /// >>> q[:, 1], q[:, 2] = 4.0 * t - 4.905 * t**2, -5.0 * t
    /// >>> markers = motion.MarkerSet.joint_centres(diver.model)
    /// >>> center = diver.model.center_of_mass(q[0])[[0, 2]] - q[0, :2]
    /// >>> turn = np.exp(1j * q[:, 2])
    /// >>> moved = (1.0 - turn) * complex(*center)
    /// >>> q[:, 0], q[:, 1] = q[:, 0] + moved.real, q[:, 1] + moved.imag
    /// >>> seen = motion.place_markers(markers, t, q)
    /// >>> flight = motion.reconstruct_flight(markers, seen, noise=0.01, scale=1.0)
    /// >>> found = motion.what_if(flight, momentum=0.1).to_dict()
    /// >>> round(found["somersaults_change"] / found["somersaults"], 3)
    /// 0.091
    fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        named(slf.as_any(), &OF_CHANGE)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let FlightChange { opening, posture, momentum, height } = own.flown.change;
        let change = [opening, posture, momentum, height];
        // a flight without a posture that can change is flown again likewise
        by_restore(slf, (own.flight(py), change, own.phase, own.joints(py)?))
    }

    /// A pickled flight, flown again.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        flight: &Bound<'_, ReconstructedFlight>,
        change: [f64; 4],
        phase: Option<[f64; 4]>,
        joints: Option<&Bound<'_, PyDict>>,
    ) -> Result<Self, Error> {
        let [opening, posture, momentum, height] = change;
        what_if(flight, opening, posture, momentum, height, phase, joints)
    }

    fn __repr__(&self) -> String {
        format!("<WhatIf: {}>", words_of(&self.flown.outcome, &self.flown.flown))
    }
}

/// Says what a diver can do for a vertical entry, ranked, each with its 95 % interval.
///
/// The line from feet to hands is to be vertical at the end. A dive that is short opens later or holds its posture tighter, one that turns too
/// far opens earlier; both can bring another angular momentum from the board. Amounts are solved with flown flights (`what_if`), and
/// their intervals are those of
///
/// .. code-block:: text
///
///     x = −e/s,   σ_x² = (σ_e/s)² + (x σ_s/s)²
///
/// with e the angle at the entry and its standard deviation, s its change for the unit of x. σ_s follows from flights flown again with the momentum, and
/// with the joints, displaced by a standard deviation to either side along each principal axis of their covariance. What has an interval
/// that spans zero is withheld. There is no advice where the entry is vertical within its interval, the flight is no success, gravity is another, or the
/// number of somersaults is not sure.
///
/// Within reach is opening later as long as the body is open for `line_up` before the entry, opening earlier by 0.6 of the time that the posture is held,
/// folding as tight as postures H (pike) and F (tuck) of the diver and the limits of the joints, and an angular momentum that differs by `momentum_reach`.
/// What covers at least half of the error in flight comes first, then the momentum, then the rest.
///
/// Other Python threads run meanwhile. Ctrl-C raises at once. Cost: some 20 flights, and two for each degree of freedom of the joints.
///
/// Parameters
/// ----------
/// flight : ReconstructedFlight
///     As of `what_if`.
/// half_somersaults : int, optional
///     How many the dive was to have, forwards positive: from 1 to 11. The number found unless given.
/// facing : str, optional
///     As of `identify_flight`.
/// line_up : float
///     How long the body must be open before the entry, s; 0.15 unless given. Which of opening and momentum comes first depends on it.
/// momentum_reach : float
///     By which fraction the angular momentum can be another, at most 0.5; 0.15 unless given.
///
/// Returns
/// -------
/// FlightAdvice
///     ``print`` shows it as text.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, or the model has not the bodies of a diver, or has free or planar joints beside the root's.
///
/// Examples
/// --------
/// A tuck that lacks momentum for three and a half somersaults:
///
/// >>> import numpy as np
/// >>> from somersault import motion, multibody
/// >>> diver = multibody.diver_planar()
/// >>> straight, tuck = diver.configuration("A"), diver.configuration("F")
/// >>> def fold(t):
/// ...     w, rate = np.sin(np.pi * t / 1.2) ** 2, np.pi / 1.2 * np.sin(2 * np.pi * t / 1.2)
/// ...     return straight[3:] + w * (tuck - straight)[3:], rate * (tuck - straight)[3:]
/// >>> v = np.zeros(12)
/// >>> v[:3] = 1.0, 5.0, -7.5
/// >>> true = multibody.fly(diver.model, straight, v, fold, (0.0, 1.2), dt=0.02)
/// >>> markers = motion.MarkerSet.joint_centres(diver.model)
/// >>> seen = motion.place_markers(markers, true.t, true.q)
/// >>> points = seen.points + np.random.default_rng(1).normal(0.0, 0.005, seen.points.shape)
/// >>> flight = motion.reconstruct_flight(markers, motion.MarkerRecording(seen.names, seen.times, points))
/// >>> found = motion.advise_flight(flight)
/// >>> found.status, found.advice[0].correction
/// ('given', 'more_momentum')
#[pyfunction]
#[pyo3(signature = (flight, *, half_somersaults=None, facing=None, line_up=None, momentum_reach=None))]
pub(crate) fn advise_flight(
    flight: &Bound<'_, ReconstructedFlight>,
    #[pyo3(from_py_with = integer_or_none)] half_somersaults: Option<i64>,
    facing: Option<&str>,
    line_up: Option<f64>,
    momentum_reach: Option<f64>,
) -> Result<FlightAdvice, Error> {
    let (py, own, side) = (flight.py(), flight.get(), facing_of(facing)?);
    // what is beyond 32 bits is beyond what is allowed
    let half_somersaults =
        half_somersaults.map(|n| i32::try_from(n).unwrap_or(if n < 0 { i32::MIN } else { i32::MAX }));
    let model = own.markers.get().model.get().model.clone();
    let known = own.flight.clone();
    let default = Reach::default();
    let reach = Reach {
        line_up: line_up.unwrap_or(default.line_up),
        momentum: momentum_reach.unwrap_or(default.momentum),
    };
    let found = leave_on_signal(py, move |token| {
        let report = identify_flight(&model, &known, side)?;
        advice::advise_flight(&model, &known, &report, half_somersaults, &reach, token)
    })?;
    Ok(FlightAdvice { flight: flight.clone().unbind(), asked: (half_somersaults, side), reach, found })
}

/// One piece of advice.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct Advice {
    advice: advice::Advice,
}

value! {
    impl Advice {
        /// str: ``'open_later'``, ``'open_earlier'``, ``'tighter'``, ``'more_momentum'`` or ``'less_momentum'``.
        correction: &'static str = |own| name_of(&Correction::ALL, &own.advice.correction);
        /// float: By how much, for a vertical entry: s, rad of the joint that moves most, or a fraction of the angular momentum.
        amount: f64 = |own| own.advice.amount.value;
        /// tuple of float: Its 95 % interval.
        amount_interval: (f64, f64) = |own| bounds(&own.advice.amount);
        /// float: How much of it is within reach.
        reach: f64 = |own| own.advice.reach;
        /// float: Which fraction of the angle at the entry is within reach, from 0 to 1.
        covers: f64 = |own| own.advice.covers;
        /// float: Change of the angle at the entry by what of the amount is within reach, flown, rad.
        entry_angle_change: f64 = |own| own.advice.flown;
        /// float: The same by the exact derivative.
        linear_entry_angle_change: f64 = |own| own.advice.linear;
        /// bool: Whether both differ by at most a tenth; otherwise the words do not use the derivative.
        agrees: bool = |own| own.advice.agrees;
        /// str: What to do, in words.
        words: String = |own| own.advice.words();
    }
}

#[pymethods]
impl Advice {
    /// The results as a dict, for JSON and tables.
    ///
    /// Returns
    /// -------
    /// dict of str to object
    ///     An entry for each attribute, by its name.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion
    /// >>> def table(flight):
    /// ...     return [advice.to_dict() for advice in motion.advise_flight(flight).advice]
    fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        const NAMES: [&str; 9] = [
            "correction",
            "amount",
            "amount_interval",
            "reach",
            "covers",
            "entry_angle_change",
            "linear_entry_angle_change",
            "agrees",
            "words",
        ];
        named(slf.as_any(), &NAMES)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = &slf.get().advice;
        let WithInterval { value, lower, upper } = own.amount;
        let numbers = [value, lower, upper, own.reach, own.covers, own.flown, own.linear];
        by_restore(slf, (slf.get().correction(), numbers, own.agrees, own.by_knees))
    }

    /// A pickled piece of advice.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        correction: &str,
        numbers: [f64; 7],
        agrees: bool,
        by_knees: bool,
    ) -> Result<Self, Error> {
        let [value, lower, upper, reach, covers, flown, linear] = numbers;
        let correction = super::motion_fit::status_of(&Correction::ALL, correction)?;
        let amount = WithInterval { value, lower, upper };
        Ok(Self {
            advice: advice::Advice { correction, amount, reach, covers, flown, linear, agrees, by_knees },
        })
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.advice == other.advice
    }

    fn __str__(&self) -> String {
        self.advice.words()
    }

    fn __repr__(&self) -> String {
        let name = self.correction();
        let (amount, covers) = (self.advice.amount.value, 100.0 * self.advice.covers);
        format!("<Advice: {name} by {amount:.3}, covers {covers:.0} %>")
    }
}

/// Advice on a flight, and why there is some or none.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct FlightAdvice {
    flight: Py<ReconstructedFlight>,
    asked: (Option<i32>, Option<Facing>),
    reach: Reach,
    found: Found,
}

value! {
    impl FlightAdvice {
        /// ReconstructedFlight: The flight.
        flight: Py<ReconstructedFlight> = |own, py| own.flight.clone_ref(py);
        /// str: ``'given'``; ``'vertical'`` where the entry is within its interval; ``'nothing_sure'`` where no change has an effect whose sign is
        /// sure; ``'no_target'`` where the number of somersaults is not sure; ``'far_from_target'`` where the flight is more than 270° from the number given;
        /// ``'other_gravity'``; ``'not_reconstructed'``; ``'frames_apart'`` where frames are so far apart that the joints between them lead to another entry.
        status: &'static str = |own| name_of(&AdviceStatus::ALL, &own.found.status);
        /// int: The number of half somersaults that the advice is for, forwards positive.
        half_somersaults: i32 = |own| own.found.half_somersaults;
        /// float: Angle of the line from feet to hands beyond the vertical for that number, rad; negative where the dive is short.
        entry_angle: f64 = |own| own.found.entry_angle.value;
        /// tuple of float: Its 95 % interval.
        entry_angle_interval: (f64, f64) = |own| bounds(&own.found.entry_angle);
        /// str: The angle at the entry and, where no advice is given, the reason.
        message: String = |own| own.found.message();
    }
}

#[pymethods]
impl FlightAdvice {
    /// tuple of Advice: What to do; the first comes first.
    #[getter]
    fn advice<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.found.advice.iter().map(|advice| Advice { advice: advice.clone() }))
    }

    /// tuple of str: Corrections that are withheld, since their intervals span zero, their effects are not sure, or what is in reach of them
    /// covers less than a twentieth of the error.
    #[getter]
    fn withheld<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.found.withheld.iter().map(|correction| name_of(&Correction::ALL, correction)))
    }

    /// The results as a dict, for JSON and tables.
    ///
    /// Returns
    /// -------
    /// dict of str to object
    ///     An entry for each attribute but `flight`, by its name; that of `advice` is a list of dicts.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion
    /// >>> def first(flight):
    /// ...     return motion.advise_flight(flight).to_dict()["advice"][:1]
    fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let py = slf.py();
        let names =
            ["status", "half_somersaults", "entry_angle", "entry_angle_interval", "withheld", "message"];
        let found = named(slf.as_any(), &names)?;
        let advice = slf.get().advice(py)?;
        let rows = advice.iter().map(|advice| advice.call_method0("to_dict"));
        found.set_item("advice", rows.collect::<PyResult<Vec<_>>>()?)?;
        Ok(found)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        let (half_somersaults, side) = own.asked;
        let facing = side.map(|side| name_of(&Facing::ALL, &side));
        let Reach { line_up, momentum } = own.reach;
        by_restore(slf, (own.flight(slf.py()), half_somersaults, facing, line_up, momentum))
    }

    /// Pickled advice, which follows from its flight.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        flight: &Bound<'_, ReconstructedFlight>,
        half_somersaults: Option<i64>,
        facing: Option<&str>,
        line_up: f64,
        momentum: f64,
    ) -> Result<Self, Error> {
        advise_flight(flight, half_somersaults, facing, Some(line_up), Some(momentum))
    }

    fn __str__(&self) -> String {
        let found = &self.found;
        let rows =
            found.advice.iter().enumerate().map(|(i, advice)| format!("{}. {}\n", i + 1, advice.words()));
        let message = found.message();
        format!("{}{}\n{}", message[..1].to_uppercase(), &message[1..], rows.collect::<String>())
    }

    fn __repr__(&self) -> String {
        let n = counted(self.found.advice.len(), "piece of advice", "pieces of advice");
        format!("<FlightAdvice: {}, {n}>", self.status())
    }
}
