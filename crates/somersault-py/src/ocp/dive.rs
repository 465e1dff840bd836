//! Dives.

use super::solver::{Report, Watcher, duration, status_name};
use crate::convert::{array, real_numbers, vector_array, with_shape};
use crate::error::Error;
use crate::named_models::Diver;
use crate::plan::returns_interrupted;
use pyo3::exceptions::{PyKeyboardInterrupt, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rayon::prelude::*;
use somersault::multibody::models::Dimension;
use somersault::ocp::dive::{
    self, Channels, Clearance, DiveMotion, DiveProgram, DiveReport, DiveSearch, KeyFrame, Range,
};
use somersault::ocp::nlp::Nlp;
use somersault::ocp::solver::{self, Flow, Iteration, Status};
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often a search of several starts looks for Ctrl-C.
const ATTENTION: Duration = Duration::from_millis(20);

/// A dive to be found: from a posture to another in a flight whose angular momentum is constant.
///
/// ``½ a (L/L₀)² + ½ ∫ Σ (b ẇ² + c ẅ²) dt`` is to be least, with L₀ = m h²/(1 s), such that somersaults, twists and
/// tilt at the entry are as wanted, the weights w of the postures are not negative and add up to at most one at all
/// times, and limbs keep apart. Flight is reduced by its momentum, which is therefore kept to rounding. Unknown are the
/// coefficients of the splines for w, the angular momentum L and, where they have a range, lean and duration. The
/// body's long axis goes from the feet to the hands in the last posture.
///
/// `dive_107b` and `dive_5174d` are those of the thesis (3.1 and 3.2).
///
/// Parameters
/// ----------
/// diver : Diver
///     Who dives, in the plane or in space.
/// postures : sequence of str or of array_like, shape (n_joints,)
///     Letters, or joint angles, rad; the fundamental posture first.
/// first, last : str or int, optional
///     The postures at take-off and at the entry, where all joints are at rest; the fundamental one unless given.
/// channels : {'weights', 'joints'}, optional
///     Splines for the weights, or one for each joint, which then keeps to its limits.
/// windows : sequence of tuple of float, optional
///     For each channel the shares of the duration between which it may differ from zero.
/// square_out : float, optional
///     Share of the duration at which twists and tilt must be what they are at the entry.
/// n_par : int, optional
///     Coefficients of each spline, of degree 5; 10 unless given.
/// somersaults, twists : float, optional
///     Turns to the entry, somersaults counted from the upright; 3.5 and 0 unless given.
/// lean : float or tuple of float, optional
///     Forward lean at take-off, rad, or its range; 10° unless given.
/// entry_lean : float, optional
///     Lean past the vertical at the entry, rad.
/// duration : float or tuple of float, optional
///     Of the flight, s, or its range; 1.7 s unless given.
/// momentum : float or tuple of float, optional
///     Angular momentum about the lateral axis, kg m²/s, or its range; from 0 to 500 unless given.
/// platform : float, optional
///     Height of the feet over the water at take-off, m; 10 m unless given.
/// entry_distance : float, optional
///     How far ahead the hands enter the water, m; 2 m unless given.
/// momentum_penalty, rate_penalty, acceleration_penalty : float, optional
///     a, b (s) and c (s³); 1, 10⁻³ and 0 unless given.
/// clearance : float, optional
///     Least distance of limbs, m, of a spatial diver; None for none.
/// clearance_times : int, optional
///     At how many times it is asked for between take-off and entry; 35 unless given.
/// n_steps : int, optional
///     Steps of the orientation; 60 unless given.
/// n_pieces : int, optional
///     Into how many pieces intervals of the splines are cut for the bounds on the channels; 2 unless given.
/// template : sequence of tuple, optional
///     A rough course to start from: ``(share, posture)`` with shares that rise from 0 to 1.
///
/// Raises
/// ------
/// OcpInputError
///     If an argument is not allowed or contradicts another.
/// PostureError
///     If the diver has no such posture.
///
/// Examples
/// --------
/// >>> from somersault import multibody, ocp
/// >>> course = [(0.0, "B"), (0.25, "F"), (0.7, "F"), (1.0, "A")]
/// >>> dive = ocp.Dive(
/// ...     multibody.diver_planar(mass=55.0, height=1.6), "BAF", first="B", last="A", somersaults=2.5,
/// ...     duration=1.6, template=course)
/// >>> dive.solve().success
/// True
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Dive {
    program: DiveProgram,
    plan: Plan,
}

/// A dive in the making.
#[derive(Clone)]
struct Plan {
    dive: dive::Dive,
    names: Vec<String>,
    clearance_times: usize,
    template: Option<Vec<KeyFrame>>,
}

/// A number, or a range.
#[derive(FromPyObject)]
enum NumberOrRange {
    Number(f64),
    Ends(f64, f64),
}

impl From<NumberOrRange> for Range {
    fn from(value: NumberOrRange) -> Self {
        match value {
            NumberOrRange::Number(value) => Self::fixed(value),
            NumberOrRange::Ends(lower, upper) => Self::new(lower, upper),
        }
    }
}

/// A posture by its name, or its number.
#[derive(FromPyObject)]
enum NameOrNumber {
    Number(usize),
    Name(String),
}

impl Plan {
    /// Joint angles and names of postures.
    fn set_postures(&mut self, postures: &Bound<'_, PyAny>) -> Result<(), Error> {
        let diver = self.dive.diver;
        let n_root = match diver.dimension {
            Dimension::Planar => 3,
            Dimension::Spatial => 7,
        };
        self.names.clear();
        self.dive.postures.clear();
        for (k, posture) in postures.try_iter()?.enumerate() {
            let posture = posture?;
            let (name, angles) = match posture.extract::<String>() {
                Ok(letter) => {
                    let q = diver.configuration(letter.parse()?)?;
                    (letter, q[n_root..].to_vec())
                }
                Err(_) => (k.to_string(), real_numbers(&format!("postures[{k}]"), &posture)?),
            };
            self.names.push(name);
            self.dive.postures.push(angles);
        }
        Ok(())
    }

    fn posture(&self, argument: &'static str, posture: NameOrNumber) -> Result<usize, Error> {
        match posture {
            NameOrNumber::Number(number) => Ok(number),
            NameOrNumber::Name(name) => self.names.iter().position(|known| *known == name).ok_or_else(|| {
                let known = self.names.join(", ");
                Error::input(format!("`{argument}` must be one of the postures {known}, found '{name}'"))
            }),
        }
    }

    fn key_frames(&self, template: &Bound<'_, PyAny>) -> Result<Vec<KeyFrame>, Error> {
        let frames: Vec<(f64, NameOrNumber)> = template.extract()?;
        let frame = |(share, posture)| Ok(KeyFrame { share, posture: self.posture("template", posture)? });
        frames.into_iter().map(frame).collect()
    }

    fn change(&mut self, changes: Option<&Bound<'_, PyDict>>) -> Result<(), Error> {
        let Some(changes) = changes else { return Ok(()) };
        // what the others are understood by comes first
        if let Some(diver) = changes.get_item("diver")? {
            self.dive.diver = diver.cast::<Diver>().map_err(PyErr::from)?.get().diver;
        }
        if let Some(postures) = changes.get_item("postures")? {
            self.set_postures(&postures)?;
        }
        for (name, value) in changes.iter() {
            let name: String = name.extract()?;
            self.set(&name, &value)?;
        }
        Ok(())
    }

    fn set(&mut self, name: &str, value: &Bound<'_, PyAny>) -> Result<(), Error> {
        let range = || Ok::<Range, PyErr>(value.extract::<NumberOrRange>()?.into());
        match name {
            "diver" | "postures" => {}
            "first" => self.dive.first = self.posture("first", value.extract()?)?,
            "last" => self.dive.last = self.posture("last", value.extract()?)?,
            "channels" => self.dive.channels = channels_of(&value.extract::<String>()?)?,
            "windows" => {
                let windows: Vec<NumberOrRange> = value.extract()?;
                self.dive.windows = windows.into_iter().map(Range::from).collect();
            }
            "square_out" => self.dive.square_out = value.extract()?,
            "n_par" => self.dive.n_par = value.extract()?,
            "somersaults" => self.dive.somersaults = value.extract()?,
            "twists" => self.dive.twists = value.extract()?,
            "lean" => self.dive.lean = range()?,
            "entry_lean" => self.dive.entry_lean = value.extract()?,
            "duration" => self.dive.duration = range()?,
            "momentum" => self.dive.momentum = range()?,
            "platform" => self.dive.platform = value.extract()?,
            "entry_distance" => self.dive.entry_distance = value.extract()?,
            "momentum_penalty" => self.dive.penalties.momentum = value.extract()?,
            "rate_penalty" => self.dive.penalties.rate = value.extract()?,
            "acceleration_penalty" => self.dive.penalties.acceleration = value.extract()?,
            "clearance" => {
                let distance: Option<f64> = value.extract()?;
                let n_times = self.clearance_times;
                self.dive.clearance = distance.map(|distance| Clearance { distance, n_times });
            }
            "clearance_times" => {
                self.clearance_times = value.extract()?;
                if let Some(clearance) = &mut self.dive.clearance {
                    clearance.n_times = self.clearance_times;
                }
            }
            "n_steps" => self.dive.n_steps = value.extract()?,
            "n_pieces" => self.dive.n_pieces = value.extract()?,
            "template" => self.template = Some(self.key_frames(value)?),
            other => {
                let message = format!("a dive has no argument '{other}'");
                return Err(PyTypeError::new_err(message).into());
            }
        }
        Ok(())
    }

    fn build(self) -> Result<Dive, Error> {
        Ok(Dive { program: self.dive.program()?, plan: self })
    }
}

fn channels_of(name: &str) -> Result<Channels, Error> {
    match name {
        "weights" => Ok(Channels::Weights),
        "joints" => Ok(Channels::Joints),
        other => Err(Error::input(format!("`channels` must be 'weights' or 'joints', found '{other}'"))),
    }
}

fn letters(names: &str) -> Vec<String> {
    names.chars().map(String::from).collect()
}

/// The forward three and a half somersaults in pike position, 107B, in the plane (thesis 3.1).
///
/// Postures A and H, ten coefficients, 1.7 s from the platform of 10 m. What the thesis leaves open is 10° of lean at
/// take-off, an entry 2 m ahead, a = 1 and b = 10⁻³ s.
///
/// Parameters
/// ----------
/// **changes
///     Arguments of `Dive` that are to be different.
///
/// Returns
/// -------
/// Dive
///
/// Examples
/// --------
/// >>> from somersault import ocp
/// >>> dive = ocp.dive_107b().solve()
/// >>> round(float(dive.somersaults[-1]), 6)
/// 3.5
#[pyfunction]
#[pyo3(signature = (**changes))]
pub(crate) fn dive_107b(changes: Option<&Bound<'_, PyDict>>) -> Result<Dive, Error> {
    let dive = dive::Dive::forward_pike()?;
    let template = Some(dive::Dive::pike_template());
    let mut plan = Plan { dive, names: letters("AH"), clearance_times: CLEARANCE_TIMES, template };
    plan.change(changes)?;
    plan.build()
}

/// The forward three and a half somersaults with two twists, free, 5174D, in space (thesis 3.2).
///
/// Postures C, A, D, E, I and H, 2 s from the platform of 10 m into the water 2 m ahead. The search starts from a template:
/// somersault with the arms sideways, throw, twists wrapped, square-out, pike, entry.
///
/// Parameters
/// ----------
/// **changes
///     Arguments of `Dive` that are to be different.
///
/// Returns
/// -------
/// Dive
#[pyfunction]
#[pyo3(signature = (**changes))]
pub(crate) fn dive_5174d(changes: Option<&Bound<'_, PyDict>>) -> Result<Dive, Error> {
    let dive = dive::Dive::forward_twisting();
    let clearance_times = dive.clearance.map_or(CLEARANCE_TIMES, |clearance| clearance.n_times);
    let template = Some(dive::Dive::twisting_template());
    let mut plan = Plan { dive, names: letters("CADEIH"), clearance_times, template };
    plan.change(changes)?;
    plan.build()
}

const CLEARANCE_TIMES: usize = 35;

#[pymethods]
impl Dive {
    #[new]
    #[pyo3(signature = (diver, postures, **options))]
    fn new(
        diver: &Bound<'_, Diver>,
        postures: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<Self, Error> {
        let dive = dive::Dive { diver: diver.get().diver, ..dive::Dive::forward_pike()? };
        let mut plan = Plan { dive, names: Vec::new(), clearance_times: CLEARANCE_TIMES, template: None };
        plan.set_postures(postures)?;
        plan.change(options)?;
        plan.build()
    }

    /// The same dive with other arguments.
    ///
    /// Parameters
    /// ----------
    /// **changes
    ///     Arguments of the class.
    ///
    /// Returns
    /// -------
    /// Dive
    #[pyo3(signature = (**changes))]
    fn replace(&self, changes: Option<&Bound<'_, PyDict>>) -> Result<Self, Error> {
        let mut plan = self.plan.clone();
        plan.change(changes)?;
        plan.build()
    }

    /// Diver: Who dives.
    #[getter]
    fn diver(&self, py: Python<'_>) -> Result<Diver, Error> {
        Diver::of(py, self.plan.dive.diver)
    }

    /// tuple of str: Names of the postures, the fundamental one first; numbers where angles were given.
    #[getter]
    fn postures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.plan.names)
    }

    /// list of tuple, or None: The template, as share and posture.
    #[getter]
    fn template(&self) -> Option<Vec<(f64, String)>> {
        let name = |frame: &KeyFrame| (frame.share, self.plan.names[frame.posture].clone());
        self.plan.template.as_ref().map(|frames| frames.iter().map(name).collect())
    }

    /// dict: The other arguments of the class, by their names.
    #[getter]
    fn options<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dive = &self.plan.dive;
        let options = PyDict::new(py);
        let pair = |range: &Range| (range.lower, range.upper);
        options.set_item("first", &self.plan.names[dive.first])?;
        options.set_item("last", &self.plan.names[dive.last])?;
        options
            .set_item("channels", if dive.channels == Channels::Weights { "weights" } else { "joints" })?;
        options.set_item("windows", dive.windows.iter().map(pair).collect::<Vec<_>>())?;
        options.set_item("square_out", dive.square_out)?;
        options.set_item("n_par", dive.n_par)?;
        options.set_item("somersaults", dive.somersaults)?;
        options.set_item("twists", dive.twists)?;
        options.set_item("lean", pair(&dive.lean))?;
        options.set_item("entry_lean", dive.entry_lean)?;
        options.set_item("duration", pair(&dive.duration))?;
        options.set_item("momentum", pair(&dive.momentum))?;
        options.set_item("platform", dive.platform)?;
        options.set_item("entry_distance", dive.entry_distance)?;
        options.set_item("momentum_penalty", dive.penalties.momentum)?;
        options.set_item("rate_penalty", dive.penalties.rate)?;
        options.set_item("acceleration_penalty", dive.penalties.acceleration)?;
        options.set_item("clearance", dive.clearance.map(|clearance| clearance.distance))?;
        options.set_item("clearance_times", self.plan.clearance_times)?;
        options.set_item("n_steps", dive.n_steps)?;
        options.set_item("n_pieces", dive.n_pieces)?;
        Ok(options)
    }

    /// int: Length of the decision vector z.
    #[getter]
    fn n_variables(&self) -> usize {
        self.program.structure().variables.len()
    }

    /// A start from a template: splines nearest to its course, with the momentum that turns the somersaults.
    ///
    /// Parameters
    /// ----------
    /// template : sequence of tuple, optional
    ///     ``(share, posture)``; that of the dive unless given.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_variables,)
    #[pyo3(signature = (template=None))]
    fn start<'py>(
        &self,
        py: Python<'py>,
        template: Option<&Bound<'py, PyAny>>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let z = match template {
            Some(template) => self.program.start(&self.plan.key_frames(template)?)?,
            None => self.program.start(self.own_template()?)?,
        };
        Ok(numpy::PyArray1::from_vec(py, z).into_any())
    }

    /// Finds the dive.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,), or DiveSolution, optional
    ///     Start; that of the template unless given.
    /// soft_weights : sequence of float, optional
    ///     Stages before the last in which entry and clearances are costs ½ μ Σ violation² with these μ; none in the
    ///     plane and 1, 10, 100, 1000 in space unless given, none where `z` is a solution.
    /// tol : float, optional
    ///     Of the residuals in the last stage.
    /// max_iterations : int, optional
    ///     Of the last stage.
    /// max_time : float, optional
    ///     Of all stages, s.
    /// callback : callable, optional
    ///     ``callback(iteration, z, cost, residual)`` after each step of each stage; the search stops where it returns
    ///     true.
    /// on_interrupt : {'return', 'raise'}, optional
    ///     What Ctrl-C does: return the best iterate, or raise with it as the attribute ``solution``.
    ///
    /// Returns
    /// -------
    /// DiveSolution
    ///     The best iterate, whatever the status.
    #[pyo3(signature = (
        z=None, *, soft_weights=None, tol=None, max_iterations=None, max_time=None, callback=None,
        on_interrupt="return"
    ))]
    fn solve(
        slf: &Bound<'_, Self>,
        py: Python<'_>,
        z: Option<&Bound<'_, PyAny>>,
        soft_weights: Option<Vec<f64>>,
        tol: Option<f64>,
        max_iterations: Option<usize>,
        max_time: Option<f64>,
        callback: Option<&Bound<'_, PyAny>>,
        on_interrupt: &str,
    ) -> Result<DiveSolution, Error> {
        let dive = slf.get();
        let returned = returns_interrupted(on_interrupt)?;
        let deadline = duration(max_time)?.map(|limit| Instant::now() + limit);
        let warm = z.and_then(|z| z.cast::<DiveSolution>().ok());
        let soft_weights = soft_weights.or_else(|| warm.map(|_| Vec::new()));
        let search = dive.search_with(soft_weights, tol, max_iterations);
        let z = match (z, warm) {
            (_, Some(solution)) => dive.checked(solution.get().report.z.clone())?,
            (Some(z), None) => dive.checked(with_shape("z", &[dive.n_variables()], z)?)?,
            (None, None) => dive.program.start(dive.own_template()?)?,
        };
        let mut watcher = Watcher::new(callback);
        let (mut stopped, mut is_late) = (false, false);
        let mut watch = |iteration: &Iteration<'_>| {
            is_late |= deadline.is_some_and(|deadline| Instant::now() >= deadline);
            stopped |= is_late || watcher.look(iteration) == Flow::Stop;
            if stopped { Flow::Stop } else { Flow::Continue }
        };
        let mut report = py.detach(|| search.solve(&dive.program, z, &mut watch))?;
        if is_late && report.status == Status::Stopped {
            report.status = Status::TimeLimit;
        }
        let solution = DiveSolution::of(slf, report)?;
        match watcher.into_raised(py, returned) {
            Some(error) => Err(with_solution(py, error, solution)),
            None => Ok(solution),
        }
    }

    /// Searches from several starts in parallel: the template, and others whose inner key frames are moved.
    ///
    /// Parameters
    /// ----------
    /// n_starts : int, optional
    /// seed : int, optional
    ///     Of the other starts.
    /// soft_weights, tol, max_iterations, max_time, on_interrupt
    ///     As of `solve`.
    ///
    /// Returns
    /// -------
    /// list of DiveSolution
    ///     One for each start: those that converged first, and of these the cheapest.
    #[pyo3(signature = (
        n_starts=16, *, seed=1, soft_weights=None, tol=None, max_iterations=None, max_time=None, on_interrupt="return"
    ))]
    fn search(
        slf: &Bound<'_, Self>,
        py: Python<'_>,
        n_starts: usize,
        seed: u64,
        soft_weights: Option<Vec<f64>>,
        tol: Option<f64>,
        max_iterations: Option<usize>,
        max_time: Option<f64>,
        on_interrupt: &str,
    ) -> Result<Vec<DiveSolution>, Error> {
        let dive = slf.get();
        let returned = returns_interrupted(on_interrupt)?;
        let deadline = duration(max_time)?.map(|limit| Instant::now() + limit);
        let search = dive.search_with(soft_weights, tol, max_iterations);
        let templates = KeyFrame::variations(dive.own_template()?, n_starts, seed);
        let stop = AtomicBool::new(false);
        let from = |template: &Vec<KeyFrame>| {
            let z = dive.program.start(template)?;
            search.solve(&dive.program, z, &mut |_| {
                if stop.load(Ordering::Relaxed) { Flow::Stop } else { Flow::Continue }
            })
        };
        let mut raised = None;
        let reports = py.detach(|| {
            std::thread::scope(|scope| {
                let all = || templates.par_iter().with_max_len(1).map(from).collect::<Result<Vec<_>, _>>();
                let worker = scope.spawn(all);
                while !worker.is_finished() {
                    std::thread::sleep(ATTENTION);
                    if raised.is_none() {
                        raised = Python::attach(|py| py.check_signals()).err();
                    }
                    let is_late = deadline.is_some_and(|deadline| Instant::now() >= deadline);
                    stop.fetch_or(is_late || raised.is_some(), Ordering::Relaxed);
                }
                worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })
        })?;
        if let Some(error) = raised
            && !(returned && error.is_instance_of::<PyKeyboardInterrupt>(py))
        {
            return Err(error.into());
        }
        let mut solutions =
            reports.into_iter().map(|report| DiveSolution::of(slf, report)).collect::<Result<Vec<_>, _>>()?;
        solutions.sort_by(|a, b| {
            let failed = |solution: &DiveSolution| !solution.report.status.is_converged();
            failed(a).cmp(&failed(b)).then(a.report.cost.total_cmp(&b.report.cost))
        });
        Ok(solutions)
    }

    fn __repr__(&self) -> String {
        let dive = &self.plan.dive;
        format!(
            "<Dive: {} somersaults, {} twists, postures {}, {} variables>",
            dive.somersaults,
            dive.twists,
            self.plan.names.join(", "),
            self.n_variables()
        )
    }
}

impl Dive {
    fn own_template(&self) -> Result<&[KeyFrame], Error> {
        let none = || Error::input("the dive needs a `template`, or a start `z`");
        self.plan.template.as_deref().ok_or_else(none)
    }

    fn checked(&self, z: Vec<f64>) -> Result<Vec<f64>, Error> {
        let n = self.n_variables();
        if z.len() != n {
            return Err(Error::input(format!("`z` must have {n} numbers, found {}", z.len())));
        }
        z.into_iter().map(|x| crate::convert::finite("z", x)).collect()
    }

    fn search_with(
        &self,
        soft_weights: Option<Vec<f64>>,
        tol: Option<f64>,
        max_iterations: Option<usize>,
    ) -> DiveSearch {
        let mut search = match self.plan.dive.diver.dimension {
            Dimension::Planar => DiveSearch::direct(),
            Dimension::Spatial => DiveSearch::staged(),
        };
        if let Some(weights) = soft_weights {
            search.soft_weights = weights;
        }
        if let Some(tol) = tol {
            let hard = &mut search.hard;
            (hard.stationarity_tol, hard.feasibility_tol, hard.complementarity_tol) = (tol, tol, tol);
        }
        search.hard.max_iterations = max_iterations.unwrap_or(search.hard.max_iterations);
        search
    }
}

/// The exception, with the solution as its attribute.
fn with_solution(py: Python<'_>, error: PyErr, solution: DiveSolution) -> Error {
    if let Ok(solution) = Py::new(py, solution) {
        // an exception that takes no attributes is still the one to raise
        let _ = error.value(py).setattr("solution", solution);
    }
    error.into()
}

/// A dive that was found: what the solver says of it, its motion, and how it holds when integrated anew.
///
/// Arrays are over `t`. The origin is at the water's level below the end of the platform.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct DiveSolution {
    dive: Py<Dive>,
    report: solver::Report,
    motion: DiveMotion,
    momentum: f64,
    duration: f64,
    lean: f64,
    n_positions: usize,
    n_velocities: usize,
    n_channels: usize,
}

impl DiveSolution {
    fn of(dive: &Bound<'_, Dive>, report: solver::Report) -> Result<Self, Error> {
        let program = &dive.get().program;
        let model = program.path().model();
        Ok(Self {
            dive: dive.clone().unbind(),
            motion: program.motion(&report.z)?,
            momentum: program.momentum(&report.z),
            duration: program.duration(&report.z),
            lean: program.lean(&report.z),
            n_positions: model.n_positions(),
            n_velocities: model.n_velocities(),
            n_channels: program.path().motion().n_channels(),
            report,
        })
    }

    fn rows<'py>(&self, py: Python<'py>, values: &[f64], width: usize) -> PyResult<Bound<'py, PyAny>> {
        Ok(array(py, values.to_vec(), &[self.motion.times.len(), width])?.into_any())
    }

    fn numbers<'py>(&self, py: Python<'py>, values: impl Iterator<Item = f64>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_vec(py, values.collect()).into_any()
    }
}

#[pymethods]
impl DiveSolution {
    /// Dive: What was searched for.
    #[getter]
    fn dive(&self, py: Python<'_>) -> Py<Dive> {
        self.dive.clone_ref(py)
    }

    /// Report: What the solver says, of the last stage.
    #[getter]
    fn report(&self) -> Report {
        Report { report: self.report.clone() }
    }

    /// str: How the search ended; see `Report`.
    #[getter]
    fn status(&self) -> &'static str {
        status_name(self.report.status)
    }

    /// bool: Whether all residuals are within their tolerances.
    #[getter]
    fn success(&self) -> bool {
        self.report.status.is_converged()
    }

    /// ndarray, shape (n,): Decision vector.
    #[getter]
    fn z<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.report.z).into_any()
    }

    /// float: Angular momentum about the lateral axis, forward, kg m²/s.
    #[getter]
    fn momentum(&self) -> f64 {
        self.momentum
    }

    /// float: Duration of the flight, s.
    #[getter]
    fn duration(&self) -> f64 {
        self.duration
    }

    /// float: Forward lean at take-off, rad.
    #[getter]
    fn lean(&self) -> f64 {
        self.lean
    }

    /// ndarray, shape (n,): Times, s.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_slice(py, &self.motion.times).into_any()
    }

    /// ndarray, shape (n, n_positions): Configurations.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, &self.motion.positions, self.n_positions)
    }

    /// ndarray, shape (n, n_velocities): Velocities.
    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, &self.motion.velocities, self.n_velocities)
    }

    /// ndarray, shape (n, n_channels): Weights of the postures but the fundamental one, or joints where these are the
    /// channels.
    #[getter]
    fn channels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, &self.motion.channels, self.n_channels)
    }

    /// ndarray, shape (n, n_channels): Rates of the channels, 1/s.
    #[getter]
    fn channel_rates<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, &self.motion.channel_rates, self.n_channels)
    }

    /// ndarray, shape (n,): Somersaults, turns, 0 for upright.
    #[getter]
    fn somersaults<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.numbers(py, self.motion.angles.iter().map(|a| a.somersault / TAU))
    }

    /// ndarray, shape (n,): Twists, turns to the left.
    #[getter]
    fn twists<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.numbers(py, self.motion.angles.iter().map(|a| a.twist / TAU))
    }

    /// ndarray, shape (n,): Tilt of the body's long axis out of the plane of the somersault, rad.
    #[getter]
    fn tilt<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.numbers(py, self.motion.angles.iter().map(|a| a.tilt))
    }

    /// ndarray, shape (n,): Rate of the somersault ψ, rad/s.
    #[getter]
    fn somersault_rate<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.numbers(py, self.motion.angle_rates.iter().map(|a| a.somersault))
    }

    /// ndarray, shape (n,): Rate of the tilt τ, rad/s.
    #[getter]
    fn tilt_rate<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.numbers(py, self.motion.angle_rates.iter().map(|a| a.tilt))
    }

    /// ndarray, shape (n,): Rate of the twist φ, rad/s.
    #[getter]
    fn twist_rate<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.numbers(py, self.motion.angle_rates.iter().map(|a| a.twist))
    }

    /// ndarray, shape (n, 3): Angular momentum of the motion about its centre of mass, world axes, kg m²/s.
    #[getter]
    fn angular_momentum<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let values: Vec<f64> = self.motion.angular_momentum.iter().flat_map(|l| [l.x, l.y, l.z]).collect();
        self.rows(py, &values, 3)
    }

    /// float: Angle of the body's long axis to the vertical at the entry, rad.
    #[getter]
    fn entry_angle(&self) -> f64 {
        let level = |angles: &somersault::ocp::flight::BodyAngles| {
            (angles.somersault.cos() * angles.tilt.cos()).abs().min(1.0).acos()
        };
        self.motion.angles.last().map_or(f64::NAN, level)
    }

    /// list of (str, float, float): Which posture weighs most, from when to when, s; empty where joints are the
    /// channels.
    #[getter]
    fn phases(&self) -> Vec<(String, f64, f64)> {
        let plan = &self.dive.get().plan;
        if plan.dive.channels == Channels::Joints {
            return Vec::new();
        }
        let shares = |weights: &[f64]| -> Vec<f64> {
            let rest = 1.0 - weights.iter().sum::<f64>();
            std::iter::once(rest).chain(weights.iter().copied()).collect()
        };
        let mut phases: Vec<(String, f64, f64)> = Vec::new();
        let (mut last, mut before, mut t_before) = (None, Vec::new(), 0.0);
        for (t, weights) in self.motion.times.iter().zip(self.motion.channels.chunks_exact(self.n_channels)) {
            let now = shares(weights);
            let heaviest = (0..now.len()).max_by(|a, b| now[*a].total_cmp(&now[*b])).unwrap_or_default();
            if last != Some(heaviest) {
                // where the two weigh the same, between two times
                let change = last.map_or(*t, |last: usize| {
                    let lead = [&before, &now].map(|w: &Vec<f64>| w[last] - w[heaviest]);
                    t_before + (t - t_before) * lead[0] / (lead[0] - lead[1])
                });
                if let Some((_, _, end)) = phases.last_mut() {
                    *end = change;
                }
                phases.push((plan.names[heaviest].clone(), change, self.duration));
            }
            (last, before, t_before) = (Some(heaviest), now, *t);
        }
        phases
    }

    /// Judges the dive by integrations that know nothing of how it was found.
    ///
    /// Returns
    /// -------
    /// DiveVerification
    fn verify(&self, py: Python<'_>) -> Result<DiveVerification, Error> {
        let program = &self.dive.get().program;
        Ok(DiveVerification(py.detach(|| program.report(&self.report.z))?))
    }

    fn __len__(&self) -> usize {
        self.motion.times.len()
    }

    fn __repr__(&self) -> String {
        let end = self.motion.angles.last().copied().unwrap_or_default();
        format!(
            "<DiveSolution: {}, {:.3} somersaults, {:.3} twists, L = {:.2} kg m²/s, {} times>",
            self.status(),
            end.somersault / TAU,
            end.twist / TAU,
            self.momentum,
            self.motion.times.len()
        )
    }
}

/// A dive as independent integrations have it.
///
/// The reduced flight is integrated from take-off to entry with a tolerance of 10⁻¹², and the full dynamics of the tree
/// with driven joints, which know no conserved momentum, with 10⁻¹⁴. Bounds are looked at at 1000 times.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct DiveVerification(DiveReport);

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
