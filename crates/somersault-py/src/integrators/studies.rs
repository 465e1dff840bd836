//! Studies of stability and accuracy.

use crate::core::convert::{array, entries, entries_or_none, finite, integer, real_numbers, vector_or};
use crate::core::error::Error;
use crate::core::memory::{bytes_of_numbers, expect_room};
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::leave_on_signal;
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::forces::models::{Drag, Gravity, Models, Spring};
use crate::integrators::methods;
use crate::integrators::plan::start_up_of;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple, PyType};
use somersault::integrators::body;
use somersault::integrators::counted::Counted;
use somersault::integrators::driver::Flow;
use somersault::integrators::force::{self, BoxedForce};
use somersault::integrators::methods::{Method, Options};
use somersault::integrators::studies::energy::{
    Behaviour, EnergyExtremes, EnergySetup, initial_angular_velocity,
};
use somersault::integrators::studies::problem::{self, Case, Errors};
use somersault::integrators::studies::stability::{self, Lambda};
use somersault::integrators::studies::work_precision::{self, StepChoice};
use somersault::integrators::studies::{Progress, StudyError, energy, order};
use somersault::integrators::system::{RigidBodySystem, RigidSystem};
use std::sync::Arc;

/// Runs a study without the interpreter, and looks for Ctrl-C meanwhile, after which what it has begun continues in the
/// background to its end: runs of millions of steps have no place to stop.
fn study<T: Send + 'static>(
    py: Python<'_>,
    run: impl FnOnce(&mut Progress<'_>) -> Result<T, StudyError> + Send + 'static,
) -> Result<T, Error> {
    leave_on_signal(py, |token| {
        run(&mut |_, _| if token.is_cancelled() { Flow::Stop } else { Flow::Continue })
    })
}

fn method_and_options(method: &Bound<'_, PyAny>, start_up: &str) -> Result<(Method, Options), Error> {
    Ok((methods::extract("method", method)?, Options { start_up: start_up_of(start_up)? }))
}

fn floats<'py>(py: Python<'py>, values: impl Iterator<Item = f64>) -> Bound<'py, PyAny> {
    PyArray1::from_vec(py, values.collect()).into_any()
}

/// Stability region of a method for ẍ = 2λ_R ẋ − (λ_R² + λ_I²) x at step 1.
#[pyclass(frozen, module = "somersault.studies")]
pub(crate) struct StabilityRegion(stability::StabilityRegion);

value! {
    impl StabilityRegion {
        /// float: Area of the whole region; infinite where it is unbounded.
        area: f64 = |own| own.0.area;
        /// float: Area divided by the square of the evaluations per step.
        corrected: f64 = |own| own.0.corrected;
        /// float: Stability limit on the imaginary axis: the method is stable for λ = iy with 0 < y ≤ b. 0 if for no y.
        imaginary_limit: f64 = |own| own.0.imaginary_limit;
        /// float: Stability limit on the negative real axis: the method is stable for λ = −x with 0 < x ≤ a. 0 if for no x.
        real_limit: f64 = |own| own.0.real_limit;
        /// int: Points at which a step failed, counted as outside.
        failed: usize = |own| own.0.failed;
    }
}

#[pymethods]
impl StabilityRegion {
    /// ndarray, shape (n, 2, 2): The boundary in the upper half plane as line segments, unordered.
    ///
    /// The axes are segment, end, and real and imaginary part. The lower half is its mirror image.
    #[getter]
    fn boundary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let ends = self.0.boundary.iter().flatten();
        let values = ends.flat_map(|lambda| [lambda.re, lambda.im]).collect();
        Ok(array(py, values, &[self.0.boundary.len(), 2, 2])?.into_any())
    }

    fn __repr__(&self) -> String {
        let r = &self.0;
        format!(
            "<StabilityRegion: area {:.4}, real axis to {:.4}, imaginary axis to {:.4}>",
            r.area, -r.real_limit, r.imaginary_limit
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let found = &slf.get().0;
        let ends = found.boundary.iter().map(|[a, b]| [a.re, a.im, b.re, b.im]);
        let limits = [found.area, found.corrected, found.imaginary_limit, found.real_limit];
        by_restore(slf, (limits, ends.collect::<Vec<_>>(), found.failed))
    }

    /// A pickled region.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, limits: [f64; 4], boundary: Vec<[f64; 4]>, failed: usize) -> Self {
        let [area, corrected, imaginary_limit, real_limit] = limits;
        let segment = |[re, im, to_re, to_im]: [f64; 4]| [Lambda { re, im }, Lambda { re: to_re, im: to_im }];
        let boundary = boundary.into_iter().map(segment).collect();
        Self(stability::StabilityRegion { area, corrected, imaginary_limit, real_limit, boundary, failed })
    }
}

/// Stability region of a method of the table.
///
/// Parameters
/// ----------
/// method : str or MethodInfo
///     A method of the table.
/// start_up : {'one_step', 'ladder'}, optional
///     How the Adams methods start, on which the region does not depend.
///
/// Returns
/// -------
/// StabilityRegion
///     Area, limits on the axes, boundary.
///
/// Raises
/// ------
/// EvaluationError
///     If the method is not one that can be studied so.
///
/// Examples
/// --------
/// >>> from somersault import studies
/// >>> region = studies.stability_region("heun")
/// >>> round(region.real_limit, 3)
/// 2.0
#[pyfunction]
#[pyo3(signature = (method, *, start_up="one_step"))]
pub(crate) fn stability_region(
    py: Python<'_>,
    method: &Bound<'_, PyAny>,
    start_up: &str,
) -> Result<StabilityRegion, Error> {
    let (method, options) = method_and_options(method, start_up)?;
    Ok(StabilityRegion(study(py, move |progress| stability::stability_region(method, options, progress))?))
}

/// Spectral radii of a method on a grid of the plane of λ, at step 1; the method is stable where they
/// do not exceed 1.
///
/// Parameters
/// ----------
/// method : str or MethodInfo
///     A method of the table.
/// re, im : float or array_like, shape (n,)
///     Real and imaginary parts of the grid.
/// start_up : {'one_step', 'ladder'}, optional
///     How the Adams methods start, on which the radii do not depend.
///
/// Returns
/// -------
/// ndarray, shape (len(im), len(re))
///     Spectral radii; NaN where a step failed, infinite where numbers overflow.
///
/// Raises
/// ------
/// InputError
///     If a part is not finite.
/// EvaluationError
///     If the method is not one that can be studied so.
///
/// Examples
/// --------
/// >>> from somersault import studies
/// >>> studies.spectral_radii("heun", [-1.0, -3.0], 0.0).round(3)
/// array([[0.5, 2.5]])
#[pyfunction]
#[pyo3(signature = (method, re, im, *, start_up="one_step"))]
pub(crate) fn spectral_radii<'py>(
    py: Python<'py>,
    method: &Bound<'py, PyAny>,
    re: &Bound<'py, PyAny>,
    im: &Bound<'py, PyAny>,
    start_up: &str,
) -> Result<Bound<'py, PyAny>, Error> {
    let (method, options) = method_and_options(method, start_up)?;
    let (re, im) = (real_numbers("re", re)?, real_numbers("im", im)?);
    let shape = [im.len(), re.len()];
    expect_room("as many radii as `re` times `im`", bytes_of_numbers(&shape))?;
    let radii = study(py, move |progress| stability::raster(method, options, &re, &im, progress))?;
    Ok(array(py, radii, &shape)?.into_any())
}

/// Extremes of the energy as they are pickled: steps, largest and smallest ratio with their bodies, and counts.
type Extremes = (u64, (f64, usize), (f64, usize), (usize, usize));

/// What a method does to the rotational energy of free bodies at large steps.
#[pyclass(frozen, module = "somersault.studies")]
pub(crate) struct EnergyStudy(energy::EnergyStudy);

value! {
    impl EnergyStudy {
        /// ndarray, shape (n,): Numbers of steps after which the study looked.
        steps: Bound<'py, PyAny> =
            |own, py| PyArray1::from_vec(py, own.0.extremes.iter().map(|e| e.steps).collect()).into_any();
        /// ndarray, shape (n,): Largest ratio Tₙ/T₀ over the bodies; infinite where a state overflowed.
        max: Bound<'py, PyAny> = |own, py| floats(py, own.0.extremes.iter().map(|e| e.max));
        /// ndarray, shape (n,): Smallest ratio Tₙ/T₀ over the bodies.
        min: Bound<'py, PyAny> = |own, py| floats(py, own.0.extremes.iter().map(|e| e.min));
        /// float: Largest energy in units of L²/(2 I_min), what the angular momentum allows.
        fraction_of_bound: f64 = |own| own.0.fraction_of_bound;
        /// float: Largest factor by which the energy grew in one step of any body.
        largest_rise: f64 = |own| own.0.largest_rise;
        /// int: Bodies whose step failed.
        failed: usize = |own| own.0.failed;
    }
}

#[pymethods]
impl EnergyStudy {
    /// ndarray, shape (n,): How many bodies have gained energy.
    #[getter]
    fn gained<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        PyArray1::from_vec(py, self.0.extremes.iter().map(|e| e.gained as u64).collect()).into_any()
    }

    /// ndarray, shape (n,): How many bodies have lost energy.
    #[getter]
    fn lost<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        PyArray1::from_vec(py, self.0.extremes.iter().map(|e| e.lost as u64).collect()).into_any()
    }

    /// str: ``"unconditionally stable"``, ``"conditionally stable"`` or ``"unconditionally unstable"``.
    #[getter]
    fn behaviour(&self) -> &'static str {
        match self.0.behaviour() {
            Behaviour::UnconditionallyStable => "unconditionally stable",
            Behaviour::ConditionallyStable => "conditionally stable",
            Behaviour::UnconditionallyUnstable => "unconditionally unstable",
        }
    }

    fn __repr__(&self) -> String {
        format!("<EnergyStudy: {}, {:.4} of the bound>", self.behaviour(), self.0.fraction_of_bound)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let found = &slf.get().0;
        let extremes = found
            .extremes
            .iter()
            .map(|e| (e.steps, (e.max, e.max_body), (e.min, e.min_body), (e.gained, e.lost)));
        let rest = (found.fraction_of_bound, found.largest_rise, found.failed);
        by_restore(slf, (extremes.collect::<Vec<_>>(), rest))
    }

    /// A pickled study.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, extremes: Vec<Extremes>, rest: (f64, f64, usize)) -> Self {
        let (fraction_of_bound, largest_rise, failed) = rest;
        let row = |(steps, (max, max_body), (min, min_body), (gained, lost))| EnergyExtremes {
            steps,
            max,
            max_body,
            min,
            min_body,
            gained,
            lost,
        };
        let extremes = extremes.into_iter().map(row).collect();
        Self(energy::EnergyStudy { extremes, fraction_of_bound, largest_rise, failed })
    }
}

/// The prisms 1 x l_y x l_z of mass 6 with l_y and l_z in {1/n, 2/n, ..., 1}, l_z running fastest.
///
/// Parameters
/// ----------
/// n : int
///     Sides to try, from 1 to 1000; n² bodies.
///
/// Returns
/// -------
/// list of RigidBody
///     The bodies.
///
/// Examples
/// --------
/// >>> from somersault import studies
/// >>> [body.principal_moments.tolist() for body in studies.prisms(2)][-1]
/// [1.0, 1.0, 1.0]
#[pyfunction]
pub(crate) fn prisms(#[pyo3(from_py_with = integer)] n: i64) -> Result<Vec<RigidBody>, Error> {
    Ok(energy::prisms(at_most_a_thousand("n", n)?)?.into_iter().map(RigidBody).collect())
}

fn at_most_a_thousand(argument: &str, found: i64) -> Result<usize, Error> {
    let few = usize::try_from(found).ok().filter(|n| (1..=1000).contains(n));
    few.ok_or_else(|| Error::input(format!("`{argument}` must be from 1 to 1000, found {found}")))
}

/// Extremes of the rotational energy of free bodies at large steps.
///
/// Parameters
/// ----------
/// method : str or MethodInfo
///     A method of the table.
/// bodies : sequence of RigidBody, optional
///     The bodies; ``prisms(100)`` unless given.
/// angular_velocity : array_like, shape (3,), optional
///     Angular velocity at the start, rad/s; (1, 1, 1)/√3 unless given.
/// dt : float, optional
///     Step, s.
/// steps : sequence of int, optional
///     Numbers of steps after which to look, increasing.
/// start_up : {'one_step', 'ladder'}, optional
///     How the Adams methods start.
///
/// Returns
/// -------
/// EnergyStudy
///     Extremes of Tₙ/T₀ and a verdict.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed or the method does not apply to free bodies.
///
/// Examples
/// --------
/// >>> from somersault import studies
/// >>> [studies.energy(name, studies.prisms(3), steps=[1, 10]).behaviour for name in ("rkmk", "dmv2s")]
/// ['unconditionally unstable', 'unconditionally stable']
#[pyfunction(name = "energy")]
#[pyo3(signature = (
    method, bodies=None, *, angular_velocity=None, dt=1.0, steps=vec![1, 2, 5, 10, 20, 50, 100], start_up="ladder"
))]
pub(crate) fn energy_study(
    py: Python<'_>,
    method: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = entries_or_none)] bodies: Option<Vec<RigidBody>>,
    angular_velocity: Option<&Bound<'_, PyAny>>,
    dt: f64,
    #[pyo3(from_py_with = entries)] steps: Vec<i64>,
    start_up: &str,
) -> Result<EnergyStudy, Error> {
    let positive = |&n: &i64| {
        u64::try_from(n).map_err(|_| Error::input(format!("entries of `steps` must be positive, found {n}")))
    };
    let steps = steps.iter().map(positive).collect::<Result<_, _>>()?;
    let (method, options) = method_and_options(method, start_up)?;
    let bodies: Vec<body::RigidBody> = match bodies {
        Some(bodies) => bodies.into_iter().map(|body| body.0).collect(),
        None => energy::prisms(100)?,
    };
    let angular_velocity = vector_or("angular_velocity", angular_velocity, initial_angular_velocity())?;
    let setup = EnergySetup { angular_velocity, dt, steps, options };
    Ok(EnergyStudy(study(py, move |progress| energy::energy(method, &setup, &bodies, progress))?))
}

/// The problems that can be chosen. Free bodies have a type of their own, as timings need it; bodies under forces have
/// that of a run by `integrate`, since each type has the methods compiled for it.
enum Chosen {
    Free(problem::Problem<RigidBodySystem>),
    Forced(problem::Problem<Counted<RigidBodySystem<Vec<BoxedForce>>>>, Models),
}

impl Chosen {
    /// The system once more, with a count of its own.
    fn counted(&self) -> Counted<RigidBodySystem<Vec<BoxedForce>>> {
        Counted::new(match self {
            Self::Free(p) => RigidBodySystem::new(p.system().body, Vec::new()),
            Self::Forced(p, models) => RigidBodySystem::new(*p.system().body(0), models.boxed()),
        })
    }
}

/// A motion from t = 0 whose state at the end is known.
///
/// Parameters
/// ----------
/// body : RigidBody
///     The body.
/// state : State
///     Its state at the start.
/// t_end : float
///     The end, s.
/// reference : State, optional
///     The state there. The exact one unless given, for which there must be no forces.
/// forces : force model or sequence of them, optional
///     What acts on the body. Callables are not accepted, since a study runs without the interpreter.
///
/// Raises
/// ------
/// InputError
///     If the end is not positive.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> from somersault import studies
/// >>> body, start = somersault.RigidBody(1.0, (1.0, 2.0, 2.5)), somersault.State(angular_velocity=(0.1, 2.0, 0.0))
/// >>> problem = studies.Problem(body, start, 3.0)
/// >>> round(studies.convergence(problem, "rkmk", [0.1, 0.05, 0.025]).orders["orientation"])
/// 4
#[pyclass(frozen, module = "somersault.studies")]
pub(crate) struct Problem(Arc<Chosen>);

#[pymethods]
impl Problem {
    #[new]
    #[pyo3(signature = (body, state, t_end, *, reference=None, forces=None))]
    fn new(
        body: RigidBody,
        state: State,
        t_end: f64,
        reference: Option<State>,
        forces: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let models = forces.map_or(Ok(Models::default()), |f| Models::extract("forces", &body.0, f))?;
        let chosen = match (reference, models.is_empty()) {
            (None, true) => Chosen::Free(problem::free_rotation(body.0, state.0, finite("t_end", t_end)?)?),
            (None, false) => {
                return Err(Error::input("`reference` must be given where there are `forces`"));
            }
            (Some(reference), true) => {
                let system = RigidBodySystem::free(body.0);
                Chosen::Free(problem::Problem::try_new(system, state.0, t_end, reference.0)?)
            }
            (Some(reference), false) => {
                let system = Counted::new(RigidBodySystem::new(body.0, models.boxed()));
                let problem = problem::Problem::try_new(system, state.0, t_end, reference.0)?;
                Chosen::Forced(problem, models)
            }
        };
        Ok(Self(Arc::new(chosen)))
    }

    /// A freely rotating body of section 7.2.1 of the thesis, for 10 s.
    ///
    /// Parameters
    /// ----------
    /// number : {1, 2, 3}
    ///     A symmetric rod, a box about its middle axis, or a symmetric plate.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import studies
    /// >>> studies.Problem.case(2)
    /// <Problem: free body, 10 s>
    #[classmethod]
    fn case(_: &Bound<'_, PyType>, #[pyo3(from_py_with = integer)] number: i64) -> Result<Self, Error> {
        let case = usize::try_from(number)
            .ok()
            .and_then(|number| Case::ALL.get(number.checked_sub(1)?))
            .ok_or_else(|| Error::input(format!("`number` must be 1, 2 or 3, found {number}")))?;
        Ok(Self(Arc::new(Chosen::Free(case.problem()?))))
    }

    /// An asymmetric free body far from the separatrix, for 5 s.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import studies
    /// >>> studies.Problem.asymmetric_body().t_end
    /// 5.0
    #[classmethod]
    fn asymmetric_body(_: &Bound<'_, PyType>) -> Result<Self, Error> {
        Ok(Self(Arc::new(Chosen::Free(problem::asymmetric_body()?))))
    }

    /// A unit mass on a spring in gravity, for 2 s: a force that depends on the position.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import studies
    /// >>> found = studies.convergence(studies.Problem.spring_pendulum(), "heun", [0.01, 0.005, 0.0025])
    /// >>> round(found.orders["position"], 1)
    /// 2.0
    #[classmethod]
    fn spring_pendulum(cls: &Bound<'_, PyType>) -> Result<Self, Error> {
        let (py, problem) = (cls.py(), problem::spring_pendulum()?);
        let (gravity, (spring, _)) = problem.system().forces;
        let forces = (Gravity::of(py, gravity)?, Spring::of(py, spring)?).into_pyobject(py)?;
        under(&problem, &forces)
    }

    /// As `spring_pendulum`, with damping and drag: forces that depend on the velocity.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import studies
    /// >>> [type(force).__name__ for force in studies.Problem.damped_spring_pendulum().forces]
    /// ['Gravity', 'Spring', 'Drag']
    #[classmethod]
    fn damped_spring_pendulum(cls: &Bound<'_, PyType>) -> Result<Self, Error> {
        let (py, problem) = (cls.py(), problem::damped_spring_pendulum()?);
        let (gravity, (spring, drag)) = problem.system().forces;
        let forces = (Gravity::of(py, gravity)?, Spring::of(py, spring)?, Drag::of(py, drag)?);
        under(&problem, &forces.into_pyobject(py)?)
    }

    /// RigidBody: The body.
    #[getter]
    fn body(&self) -> RigidBody {
        match &*self.0 {
            Chosen::Free(p) => RigidBody(p.system().body),
            Chosen::Forced(p, _) => RigidBody(*p.system().body(0)),
        }
    }

    /// State: The state at t = 0.
    #[getter]
    fn state(&self) -> State {
        match &*self.0 {
            Chosen::Free(p) => State(*p.initial()),
            Chosen::Forced(p, _) => State(*p.initial()),
        }
    }

    /// State: The state at the end.
    #[getter]
    fn reference(&self) -> State {
        match &*self.0 {
            Chosen::Free(p) => State(*p.reference()),
            Chosen::Forced(p, _) => State(*p.reference()),
        }
    }

    /// float: The end, s.
    #[getter]
    fn t_end(&self) -> f64 {
        match &*self.0 {
            Chosen::Free(p) => p.t_end(),
            Chosen::Forced(p, _) => p.t_end(),
        }
    }

    /// list of ForceModel: What acts on the body.
    #[getter]
    fn forces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        match &*self.0 {
            Chosen::Free(_) => Ok(PyList::empty(py)),
            Chosen::Forced(_, models) => models.to_python(py),
        }
    }

    fn __repr__(&self) -> String {
        let kind = match &*self.0 {
            Chosen::Free(_) => "free body",
            Chosen::Forced(..) => "body under forces",
        };
        format!("<Problem: {kind}, {} s>", self.t_end())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        by_restore(slf, (own.body(), own.state(), own.t_end(), own.reference(), own.forces(py)?))
    }

    /// A pickled problem.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        body: RigidBody,
        state: State,
        t_end: f64,
        reference: State,
        forces: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        Self::new(body, state, t_end, Some(reference), Some(forces))
    }
}

/// A problem of the library, with its forces as Python has them.
fn under<F: force::ForceModel>(
    problem: &problem::Problem<RigidBodySystem<F>>,
    forces: &Bound<'_, PyTuple>,
) -> Result<Problem, Error> {
    let (body, state) = (RigidBody(problem.system().body), State(*problem.initial()));
    Problem::new(body, state, problem.t_end(), Some(State(*problem.reference())), Some(forces))
}

fn errors_dict<'py>(py: Python<'py>, errors: &[Errors]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("position", floats(py, errors.iter().map(|e| e.position)))?;
    dict.set_item("orientation", floats(py, errors.iter().map(|e| e.orientation)))?;
    dict.set_item("velocity", floats(py, errors.iter().map(|e| e.velocity)))?;
    dict.set_item("angular_velocity", floats(py, errors.iter().map(|e| e.angular_velocity)))?;
    Ok(dict)
}

/// Errors of a method with several steps, and the orders they show.
#[pyclass(frozen, module = "somersault.studies")]
pub(crate) struct Convergence(order::Convergence);

#[pymethods]
impl Convergence {
    /// ndarray, shape (n,): Steps, s.
    #[getter]
    fn dt<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        floats(py, self.0.measured.iter().map(|m| m.dt))
    }

    /// dict of ndarray: Errors at the end, of shape (n,), in ``"position"``, m, ``"orientation"``, rad,
    /// ``"velocity"``, m/s, and ``"angular_velocity"``, rad/s. Infinite where a run overflowed or failed.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let errors: Vec<_> = self.0.measured.iter().map(|m| m.errors).collect();
        errors_dict(py, &errors)
    }

    /// dict: Slopes of the errors over the step in logarithms, with the same keys; None where fewer than
    /// three errors are above rounding.
    #[getter]
    fn orders<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("position", self.0.orders.position)?;
        dict.set_item("orientation", self.0.orders.orientation)?;
        dict.set_item("velocity", self.0.orders.velocity)?;
        dict.set_item("angular_velocity", self.0.orders.angular_velocity)?;
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        let text = |order: Option<f64>| order.map_or("-".to_owned(), |p| format!("{p:.2}"));
        let o = &self.0.orders;
        format!(
            "<Convergence: order {} in position, {} in orientation, {} steps>",
            text(o.position),
            text(o.orientation),
            self.0.measured.len()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let found = &slf.get().0;
        let measured: Vec<_> = found.measured.iter().map(|m| (m.dt, numbers_of(&m.errors))).collect();
        let o = &found.orders;
        by_restore(slf, (measured, [o.position, o.orientation, o.velocity, o.angular_velocity]))
    }

    /// A pickled study.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, measured: Vec<(f64, [f64; 4])>, orders: [Option<f64>; 4]) -> Self {
        let row = |(dt, errors)| order::Measured { dt, errors: errors_of(errors) };
        let [position, orientation, velocity, angular_velocity] = orders;
        let orders = order::ObservedOrders { position, orientation, velocity, angular_velocity };
        Self(order::Convergence { measured: measured.into_iter().map(row).collect(), orders })
    }
}

/// Observed orders of a method.
///
/// Parameters
/// ----------
/// problem : Problem
///     What to run.
/// method : str or MethodInfo
///     A method of the table.
/// dts : array_like, shape (n,)
///     Steps, s.
/// start_up : {'one_step', 'ladder'}, optional
///     How the Adams methods start.
///
/// Returns
/// -------
/// Convergence
///     Errors and orders.
///
/// Raises
/// ------
/// InputError
///     If a step is not positive, or the method accepts no torque and the problem has one.
///
/// Examples
/// --------
/// >>> from somersault import studies
/// >>> found = studies.convergence(studies.Problem.case(1), "rkmk", [0.05, 0.025, 0.0125])
/// >>> round(found.orders["orientation"])
/// 4
#[pyfunction]
#[pyo3(signature = (problem, method, dts, *, start_up="one_step"))]
pub(crate) fn convergence(
    py: Python<'_>,
    problem: &Problem,
    method: &Bound<'_, PyAny>,
    dts: &Bound<'_, PyAny>,
    start_up: &str,
) -> Result<Convergence, Error> {
    let (method, options) = method_and_options(method, start_up)?;
    let dts = real_numbers("dts", dts)?;
    let problem = Arc::clone(&problem.0);
    Ok(Convergence(study(py, move |progress| match &*problem {
        Chosen::Free(p) => order::convergence(p, method, options, &dts, progress),
        Chosen::Forced(p, _) => order::convergence(p, method, options, &dts, progress),
    })?))
}

/// A run of a work-precision study as it is pickled: choice of the step, errors, counts and seconds.
type Point = ((String, f64), [f64; 4], (u64, u64, u64), f64);

fn numbers_of(errors: &Errors) -> [f64; 4] {
    [errors.position, errors.orientation, errors.velocity, errors.angular_velocity]
}

fn errors_of([position, orientation, velocity, angular_velocity]: [f64; 4]) -> Errors {
    Errors { position, orientation, velocity, angular_velocity }
}

/// Errors of a method against what it costs.
#[pyclass(frozen, module = "somersault.studies")]
pub(crate) struct WorkPrecision(Vec<work_precision::WorkPoint>);

value! {
    impl WorkPrecision {
        /// ndarray, shape (n,): Evaluations of the equations of motion.
        evaluations: Bound<'py, PyAny> =
            |own, py| PyArray1::from_vec(py, own.0.iter().map(|p| p.evaluations).collect()).into_any();
        /// ndarray, shape (n,): Steps made.
        steps: Bound<'py, PyAny> =
            |own, py| PyArray1::from_vec(py, own.0.iter().map(|p| p.steps).collect()).into_any();
        /// ndarray, shape (n,): Steps tried and rejected.
        rejected: Bound<'py, PyAny> =
            |own, py| PyArray1::from_vec(py, own.0.iter().map(|p| p.rejected).collect()).into_any();
        /// ndarray, shape (n,): Least wall time of the repeats, s.
        seconds: Bound<'py, PyAny> = |own, py| floats(py, own.0.iter().map(|p| p.seconds));
    }
}

#[pymethods]
impl WorkPrecision {
    /// dict of ndarray: Errors at the end, with the keys of `Convergence.errors`.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let errors: Vec<_> = self.0.iter().map(|p| p.errors).collect();
        errors_dict(py, &errors)
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __repr__(&self) -> String {
        format!("<WorkPrecision: {} runs>", self.0.len())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let found = &slf.get().0;
        let row = |p: &work_precision::WorkPoint| {
            let choice = match p.choice {
                StepChoice::Fixed(dt) => ("dt", dt),
                StepChoice::Tolerance(tolerance) => ("tolerance", tolerance),
            };
            (choice, numbers_of(&p.errors), (p.steps, p.rejected, p.evaluations), p.seconds)
        };
        by_restore(slf, (found.iter().map(row).collect::<Vec<_>>(),))
    }

    /// A pickled study.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, points: Vec<Point>) -> Self {
        let row = |((kind, value), errors, (steps, rejected, evaluations), seconds): Point| {
            let choice = if kind == "dt" { StepChoice::Fixed(value) } else { StepChoice::Tolerance(value) };
            work_precision::WorkPoint {
                choice,
                errors: errors_of(errors),
                steps,
                rejected,
                evaluations,
                seconds,
            }
        };
        Self(points.into_iter().map(row).collect())
    }
}

/// Errors of a method against evaluations and time.
///
/// Parameters
/// ----------
/// problem : Problem
///     What to run.
/// method : str or MethodInfo
///     A method of the table.
/// dts : array_like, shape (n,), optional
///     Fixed steps, s.
/// tolerances : array_like, shape (n,), optional
///     Relative tolerances in the place of steps, for the adaptive methods; the absolute ones are a
///     hundredth of them.
/// repeats : int, optional
///     How often each run is timed, from 1 to 1000; the least time counts.
/// start_up : {'one_step', 'ladder'}, optional
///     How the Adams methods start.
///
/// Returns
/// -------
/// WorkPrecision
///     One entry for each step or tolerance.
///
/// Raises
/// ------
/// InputError
///     If a step or a tolerance is not positive.
///
/// Examples
/// --------
/// >>> from somersault import studies
/// >>> found = studies.work_precision(studies.Problem.case(1), "rkmk", [0.2, 0.1], repeats=1)
/// >>> found.evaluations.tolist(), bool(found.errors["orientation"][1] < found.errors["orientation"][0])
/// ([200, 400], True)
#[pyfunction(name = "work_precision")]
#[pyo3(signature = (problem, method, dts=None, *, tolerances=None, repeats=3, start_up="one_step"))]
pub(crate) fn work_precision_study(
    py: Python<'_>,
    problem: &Problem,
    method: &Bound<'_, PyAny>,
    dts: Option<&Bound<'_, PyAny>>,
    tolerances: Option<&Bound<'_, PyAny>>,
    #[pyo3(from_py_with = integer)] repeats: i64,
    start_up: &str,
) -> Result<WorkPrecision, Error> {
    let (method, options) = method_and_options(method, start_up)?;
    let repeats = at_most_a_thousand("repeats", repeats)?;
    let choices: Vec<StepChoice> = match (dts, tolerances) {
        (Some(dts), None) => real_numbers("dts", dts)?.into_iter().map(StepChoice::Fixed).collect(),
        (None, Some(t)) => real_numbers("tolerances", t)?.into_iter().map(StepChoice::Tolerance).collect(),
        _ => return Err(Error::input("one of `dts` and `tolerances` must be given")),
    };
    let (problem, counted) = (Arc::clone(&problem.0), problem.0.counted());
    Ok(WorkPrecision(study(py, move |progress| match &*problem {
        Chosen::Free(p) => {
            work_precision::work_precision(p, &counted, method, options, &choices, repeats, progress)
        }
        Chosen::Forced(p, _) => {
            work_precision::work_precision(p, &counted, method, options, &choices, repeats, progress)
        }
    })?))
}

/// Studies of stability and accuracy.
#[pyo3::pymodule(name = "studies", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::integrators::studies::{
        Convergence, EnergyStudy, Problem, StabilityRegion, WorkPrecision, convergence, energy_study, prisms,
        spectral_radii, stability_region, work_precision_study,
    };
}
