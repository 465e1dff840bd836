//! Dives.

mod literal;
mod plan;
mod solution;
mod verification;

pub(crate) use literal::LiteralDive;
pub(crate) use plan::{dive_107b, dive_5174d};
pub(crate) use solution::DiveSolution;
pub(crate) use verification::DiveVerification;

use super::arguments::{count, limit, seed_of, tolerance};
use super::solver::{Watcher, deadline};
use crate::core::convert::{entries_or_none, finite_all, integer, integer_or_none, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, brief, by_restore, few, value};
use crate::core::waiting::{Cancellation, attend, deliver, returns_interrupted};
use crate::multibody::models::Diver;
use plan::{Course, Plan};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use rayon::prelude::*;
use somersault::dives::{self, Channels, DiveProgram, DiveSearch, DiveSearchError, KeyFrame, Range};
use somersault::multibody::models::Dimension;
use somersault::nlp::{Flow, Iteration, Nlp, Report, Status, ranked};

/// A dive to be found: from a posture to another in a flight whose angular momentum is constant.
///
/// ``½ a (L/L₀)² + ½ ∫ Σ (b ẇ² + c ẅ²) dt`` is minimised, with L₀ = m h²/(1 s), such that somersaults, twists and
/// tilt at the entry are as requested, the weights w of the postures are not negative and add up to at most one at all
/// times, and limbs keep apart. Flight is reduced by its momentum, which is therefore conserved to rounding. Unknown are the
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
///     For each channel the fractions of the duration between which it may differ from zero.
/// square_out : float, optional
///     Fraction of the duration at which twists and tilt must be what they are at the entry.
/// n_par : int, optional
///     Coefficients of each spline, of degree 5, of which the ends fix four; 10 unless given. Free are n_par − 4 for each
///     channel without a window, and the momentum.
/// somersaults, twists : float, optional
///     Turns to the entry, somersaults counted from the upright; 3.5 and 0 unless given. Backward somersaults are negative
///     and need a negative `momentum`; twists to the right are negative, and multiples of ½ where `square_out` is before
///     the entry.
/// lean : float or tuple of float, optional
///     Forward lean at take-off, rad, or its range; 10° unless given.
/// entry_lean : float, optional
///     Lean past the vertical at the entry, rad.
/// duration : float or tuple of float, optional
///     Of the flight, s, or its range; 1.7 s unless given. With the height and the distance of the entry it says how fast the
///     diver leaves the platform: a lower one needs a shorter flight.
/// momentum : float or tuple of float, optional
///     Angular momentum about the lateral axis, kg m²/s, or its range; from 0 to 500 unless given.
/// platform : float, optional
///     Height of the feet over the water at take-off, m, not negative; 10 m unless given.
/// entry_distance : float, optional
///     How far ahead the hands enter the water, m, or the feet where these are to enter first; 2 m unless given.
/// momentum_penalty, rate_penalty, acceleration_penalty : float, optional
///     a, b (s) and c (s³); 1, 10⁻³ and 0 unless given.
/// clearance : float, optional
///     Minimum distance of limbs, m, of a spatial diver; None for none.
/// clearance_times : int, optional
///     At how many times it is a constraint to begin with, between take-off and entry; 35 unless given. The search adds those
///     at which limbs come nearer in between.
/// n_steps : int, optional
///     Steps of the orientation; 60 unless given.
/// n_pieces : int, optional
///     Into how many pieces intervals of the splines are cut for the bounds on the channels; 2 unless given.
/// template : sequence of tuple, optional
///     A rough course to start from: ``(fraction, posture)`` with fractions that rise from 0 to 1.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed or contradicts another, or the diver has no such posture.
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

value! {
    impl Dive {
        /// Diver: Who dives.
        diver: Result<Diver, Error> = |own, py| Diver::of(py, own.plan.dive.diver);
        /// tuple of str: Names of the postures, the fundamental one first; numbers where angles were given.
        postures: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, &own.plan.names);
        /// int: Length of the decision vector z.
        n_variables: usize = |own| own.program.structure().variables.len();
    }
}

#[pymethods]
impl Dive {
    #[new]
    #[pyo3(signature = (diver, postures, **options))]
    fn new(
        diver: &Bound<'_, Diver>,
        postures: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<Self, Error> {
        let dive = dives::Dive { diver: diver.get().hinged("diver")?, ..dives::Dive::forward_pike()? };
        let mut plan = Plan { own_postures: true, ..Plan::new(dive) };
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> ocp.dive_107b().replace(somersaults=2.5, platform=5.0)
    /// <Dive: 2.5 somersaults, 0 twists, postures A, H, 7 variables>
    #[pyo3(signature = (**changes))]
    fn replace(&self, changes: Option<&Bound<'_, PyDict>>) -> Result<Self, Error> {
        let mut plan = self.plan.clone();
        plan.change(changes)?;
        plan.build()
    }

    /// The mirror image: right and left exchanged in all postures, and the twists the other way round. Its variables mean the
    /// same, so that a solution of one is the mirror image of a solution of the other.
    ///
    /// Returns
    /// -------
    /// Dive
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> dive = ocp.dive_5174d(twists=0.5).mirrored()
    /// >>> dive.options["twists"], dive.postures
    /// (-0.5, ('C', 'A', 'E', 'D', 'mirrored I', 'H'))
    fn mirrored(&self) -> Result<Self, Error> {
        self.plan.mirrored()?.build()
    }

    /// list of tuple, or None: The template, as fraction and posture.
    #[getter]
    fn template(&self) -> Option<Vec<(f64, String)>> {
        let name = |frame: &KeyFrame| (frame.fraction, self.plan.names[frame.posture].clone());
        self.plan.key_frames_or_own().map(|frames| frames.iter().map(name).collect())
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

    /// A start from a template: splines nearest to its course, with the momentum that turns the somersaults.
    ///
    /// Parameters
    /// ----------
    /// template : sequence of tuple, optional
    ///     ``(fraction, posture)``; that of the dive unless given.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_variables,)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> dive = ocp.dive_107b()
    /// >>> dive.start([(0.0, "A"), (0.3, "H"), (0.7, "H"), (1.0, "A")]).shape
    /// (7,)
    #[pyo3(signature = (template=None))]
    fn start<'py>(
        &self,
        py: Python<'py>,
        template: Option<&Bound<'py, PyAny>>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let z = match template {
            Some(template) => self.start_of(&self.plan.key_frames(template)?)?,
            None => self.start_of(&self.own_template()?)?,
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
    ///     Of each stage with constraints; 500 in the plane and 100 in space unless given.
    /// max_evaluations : int, optional
    ///     Of cost and constraints, in each stage.
    /// max_time : float, optional
    ///     Of all stages, s.
    /// callback : callable, optional
    ///     ``callback(iteration, z, cost, residual)`` after each step of each stage; the search stops where it returns
    ///     true.
    /// on_interrupt : {'raise', 'return'}, optional
    ///     What Ctrl-C does: raise with the best iterate as the attribute ``solution``, or return it.
    ///
    /// Returns
    /// -------
    /// DiveSolution
    ///     The best iterate, whatever the status.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> found = ocp.dive_107b(n_steps=30).solve()
    /// >>> found.status, round(found.duration, 3)
    /// ('converged', 1.7)
    #[pyo3(signature = (
        z=None, *, soft_weights=None, tol=None, max_iterations=None, max_evaluations=None, max_time=None, callback=None,
        on_interrupt="raise"
    ))]
    fn solve(
        slf: &Bound<'_, Self>,
        py: Python<'_>,
        z: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = entries_or_none)] soft_weights: Option<Vec<f64>>,
        tol: Option<f64>,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] max_evaluations: Option<i64>,
        max_time: Option<f64>,
        callback: Option<&Bound<'_, PyAny>>,
        on_interrupt: &str,
    ) -> Result<DiveSolution, Error> {
        let dive = slf.get();
        let returned = returns_interrupted(on_interrupt)?;
        let deadline = deadline(max_time)?;
        let warm = z.and_then(|z| z.cast::<DiveSolution>().ok());
        let soft_weights = soft_weights.or_else(|| warm.map(|_| Vec::new()));
        let search = dive.search_with(soft_weights, tol, [max_iterations, max_evaluations])?;
        let z = match (z, warm) {
            (_, Some(solution)) => dive.checked(solution.get().report.z.clone())?,
            (Some(z), None) => dive.checked(with_shape("z", &[dive.n_variables()], z)?)?,
            (None, None) => dive.start_of(&dive.own_template()?)?,
        };
        let mut watcher = Watcher::new(callback)?;
        let (cancellation, mut stopped) = (Cancellation::at(deadline), false);
        let mut watch = |iteration: &Iteration<'_>| {
            stopped |= cancellation.token.is_cancelled() || watcher.look(iteration) == Flow::Stop;
            if stopped { Flow::Stop } else { Flow::Continue }
        };
        let solve = || search.solve(&dive.program, z, &mut watch);
        let mut report = attend(py, |raised| cancellation.raise(raised), solve)??;
        watcher.hears(cancellation.raised().map(|raised| raised.clone_ref(py)));
        if cancellation.token.has_expired() && report.status == Status::Stopped {
            report.status = Status::TimeLimit;
        }
        if watcher.is_interrupted(py) {
            report = report.interrupted();
        }
        let solution = DiveSolution::of(slf, report)?;
        deliver(py, watcher.into_raised(), returned, solution)
    }

    /// Searches from several starts in parallel: the template, and others whose inner key frames are moved.
    ///
    /// Parameters
    /// ----------
    /// n_starts : int, optional
    /// seed : int, optional
    ///     Of the other starts.
    /// soft_weights, tol, max_iterations, max_evaluations, max_time, on_interrupt
    ///     As of `solve`.
    ///
    /// Returns
    /// -------
    /// list of DiveSolution
    ///     One for each start: the successes first, and of these the cheapest. When the time is over or after
    ///     Ctrl-C, one for each start that had begun.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> found = ocp.dive_107b(n_steps=20).search(2, seed=1)
    /// >>> found[0].success
    /// True
    #[pyo3(signature = (
        n_starts=16, *, seed=1, soft_weights=None, tol=None, max_iterations=None, max_evaluations=None, max_time=None,
        on_interrupt="raise"
    ))]
    fn search(
        slf: &Bound<'_, Self>,
        py: Python<'_>,
        #[pyo3(from_py_with = integer)] n_starts: i64,
        #[pyo3(from_py_with = integer)] seed: i64,
        #[pyo3(from_py_with = entries_or_none)] soft_weights: Option<Vec<f64>>,
        tol: Option<f64>,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] max_evaluations: Option<i64>,
        max_time: Option<f64>,
        on_interrupt: &str,
    ) -> Result<Vec<DiveSolution>, Error> {
        let dive = slf.get();
        let returned = returns_interrupted(on_interrupt)?;
        let deadline = deadline(max_time)?;
        let search = dive.search_with(soft_weights, tol, [max_iterations, max_evaluations])?;
        let (n_starts, seed) = (count("n_starts", n_starts, 1)?, seed_of(seed)?);
        let templates = KeyFrame::variations(&dive.own_template()?, n_starts, seed);
        let cancellation = Cancellation::at(deadline);
        let solve = |template: &Vec<KeyFrame>| {
            let z = dive.program.start(template)?;
            let watch = &mut |_: &Iteration<'_>| {
                if cancellation.token.is_cancelled() { Flow::Stop } else { Flow::Continue }
            };
            let report = search.solve(&dive.program, z, watch)?;
            // where that cannot be made, or is interrupted, the solution tries again when it is asked
            let judged = report
                .status
                .is_converged()
                .then(|| dive.program.report_cancellable(&report.z, &cancellation.token).ok());
            Ok::<_, DiveSearchError>((report, judged.flatten()))
        };
        let from = |template: &Vec<KeyFrame>| (!cancellation.token.is_cancelled()).then(|| solve(template));
        let all = || templates.par_iter().with_max_len(1).filter_map(from).collect::<Result<Vec<_>, _>>();
        let reports = attend(py, |raised| cancellation.raise(raised), all)??;
        let raised = cancellation.raised();
        let ended = |report: Report| match report.status {
            Status::Stopped if raised.is_none() && cancellation.token.has_expired() => {
                Report { status: Status::TimeLimit, ..report }
            }
            _ => report.interrupted(),
        };
        let solution = |(report, judged)| match judged {
            Some(judged) => DiveSolution::judged(slf, ended(report), judged),
            None => DiveSolution::of(slf, ended(report)),
        };
        let mut solutions = Vec::with_capacity(reports.len());
        for found in reports {
            let solution = solution(found)?;
            solutions.push((!solution.success(py)?, solution));
        }
        let programs: Vec<&Report> = solutions.iter().map(|(_, solution)| &solution.report).collect();
        let mut merit = vec![0; solutions.len()];
        ranked(&programs).into_iter().enumerate().for_each(|(place, k)| merit[k] = place);
        let mut solutions: Vec<_> = merit.into_iter().zip(solutions).collect();
        solutions.sort_by_key(|(merit, (failed, _))| (*failed, *merit));
        let solutions = solutions.into_iter().map(|(_, (_, solution))| solution).collect();
        deliver(py, raised.map(|raised| raised.clone_ref(py)), returned, solutions)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, dive) = (slf.py(), slf.get());
        let plan = &dive.plan;
        let options = dive.options(py)?;
        options.set_item("first", plan.dive.first)?;
        options.set_item("last", plan.dive.last)?;
        let frame = |frame: &KeyFrame| (frame.fraction, frame.posture);
        if let Some(template) = &plan.template {
            options.set_item("template", template.iter().map(frame).collect::<Vec<_>>())?;
        }
        let diver = Diver::of(py, plan.dive.diver)?;
        let arguments = (
            diver,
            plan.names.clone(),
            plan.dive.postures.clone(),
            options,
            plan.course.name(),
            plan.own_postures,
        );
        let arguments = arguments.into_pyobject(py)?;
        by_restore(slf, arguments)
    }

    /// A pickled dive.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        diver: &Bound<'_, Diver>,
        names: Vec<String>,
        postures: Vec<Vec<f64>>,
        options: &Bound<'_, PyDict>,
        course: &str,
        own_postures: bool,
    ) -> Result<Self, Error> {
        if names.len() != postures.len() {
            let (n, found) = (postures.len(), names.len());
            return Err(Error::input(format!("`names` must have {n} entries, found {found}")));
        }
        let dive =
            dives::Dive { diver: diver.get().hinged("diver")?, postures, ..dives::Dive::forward_pike()? };
        let mut plan = Plan { names, course: Course::of(course)?, own_postures, ..Plan::new(dive) };
        plan.change(Some(options))?;
        plan.build()
    }

    fn __repr__(&self) -> String {
        let dive = &self.plan.dive;
        format!(
            "<Dive: {} somersaults, {} twists, postures {}, {} variables>",
            dive.somersaults,
            dive.twists,
            brief(&few(&self.plan.names), 80),
            self.n_variables()
        )
    }
}

impl Dive {
    fn own_template(&self) -> Result<Vec<KeyFrame>, Error> {
        let none = || Error::input("the dive needs a `template`, or a start `z`");
        self.plan.key_frames_or_own().ok_or_else(none)
    }

    /// The decision vector nearest to a template.
    fn start_of(&self, frames: &[KeyFrame]) -> Result<Vec<f64>, Error> {
        self.program.start(frames).map_err(|error| Error::from(error).with_names(&plan::NAMES))
    }

    fn checked(&self, z: Vec<f64>) -> Result<Vec<f64>, Error> {
        let n = self.n_variables();
        if z.len() != n {
            return Err(Error::input(format!("`z` must have {n} numbers, found {}", z.len())));
        }
        z.into_iter().map(|x| crate::core::convert::finite("z", x)).collect()
    }

    fn search_with(
        &self,
        soft_weights: Option<Vec<f64>>,
        tol: Option<f64>,
        [max_iterations, max_evaluations]: [Option<i64>; 2],
    ) -> Result<DiveSearch, Error> {
        let mut search = match self.plan.dive.diver.dimension {
            Dimension::Planar => DiveSearch::direct(),
            Dimension::Spatial => DiveSearch::staged(),
        };
        if let Some(weights) = soft_weights {
            let positive = |weights: &[f64]| weights.iter().all(|weight| *weight > 0.0);
            search.soft_weights = finite_all("soft_weights", weights)?;
            if !positive(&search.soft_weights) {
                return Err(Error::input("`soft_weights` must be positive".to_owned()));
            }
        }
        if let Some(tol) = tolerance("tol", tol)? {
            let hard = &mut search.hard;
            (hard.stationarity_tol, hard.feasibility_tol, hard.complementarity_tol) = (tol, tol, tol);
        }
        let most = limit("max_iterations", max_iterations, 0)?;
        search.hard.max_iterations = most.unwrap_or(search.hard.max_iterations);
        let most = limit("max_evaluations", max_evaluations, 1)?;
        (search.soft.max_evaluations, search.hard.max_evaluations) = (most, most);
        Ok(search)
    }
}
