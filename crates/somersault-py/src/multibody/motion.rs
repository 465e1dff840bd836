//! Motion of trees under joint forces, with joints that may be driven.

use crate::contact::tree::{LinkEvent, PickledTouches, TreeContactList, TreeTouches, stretched};
use crate::core::callable::{Failure, callable_name, check_callable, noted};
use crate::core::convert::{array, finite_all, integer, integer_or_none, interval_of, times, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::returns_interrupted;
use crate::integrators::integrate::FORWARD_WITH_CONTACTS;
use crate::integrators::methods;
use crate::integrators::monitor::{Finish, Monitor, ProgressBar, Watch};
use crate::integrators::plan::{self, Plan, StepArguments, start_up_of, stiff_of};
use crate::integrators::solve;
use crate::integrators::trajectory::Report;
use crate::integrators::watching::{
    EventFunctions, EventsByFunction, PickledCertificate, certified, pickled, unpickled, unproved,
};
use crate::multibody::given::{Given, drive};
use crate::multibody::model::Model;
use numpy::PyArray1;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple, PyType};
use somersault::contact::tree::TouchingState;
use somersault::integrators::augmented::Augmented;
use somersault::integrators::events::{Certificate, Interrupted, Located, Location};
use somersault::integrators::methods::{Method, Options};
use somersault::integrators::reversal::TimeReversed;
use somersault::integrators::solution;
use somersault::integrators::state::{Configuration, State};
use somersault::multibody::motion::{Coordinates, TreeState, TreeSystem};
use somersault::multibody::{self, Split};

/// What a tree moves on, alone or with the stretches of its contacts beside.
trait OfTree: Configuration {
    /// The state of the tree.
    fn tree(x: &State<Self>) -> TreeState;
}

impl OfTree for Coordinates {
    fn tree(x: &TreeState) -> TreeState {
        x.clone()
    }
}

impl OfTree for Augmented<Coordinates> {
    fn tree(x: &TouchingState) -> TreeState {
        x.base()
    }
}

/// q and v of a state.
fn coordinates<Q: OfTree>(model: &multibody::Model, x: &State<Q>) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let (x, mut v) = (Q::tree(x), vec![0.0; model.n_velocities()]);
    model.joint_velocities(&x, &mut v)?;
    Ok((x.configuration.as_slice().to_vec(), v))
}

/// q and v of states, one after the other.
fn rows<Q: OfTree>(
    model: &multibody::Model,
    states: impl IntoIterator<Item = State<Q>>,
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let (mut q, mut v) = (Vec::new(), Vec::new());
    for x in states {
        let (of_q, of_v) = coordinates(model, &x)?;
        q.extend(of_q);
        v.extend(of_v);
    }
    Ok((q, v))
}

/// Configuration and velocity of a tree at any time of an integration.
///
/// Called with a number it gives (q, v); called with n times, arrays with n rows each. Its curves are not written to
/// files or pickles; arrays are.
///
/// Examples
/// --------
/// >>> from somersault import multibody
/// >>> cart = multibody.cart_pendulum()
/// >>> motion = multibody.integrate_tree(cart, [0.0, 0.1], [0.0, 0.0], (0.0, 1.0), dt=0.1, dense_output=True)
/// >>> q, v = motion.sol([0.25, 0.55])
/// >>> q.shape
/// (2, 2)
#[pyclass(frozen, module = "somersault.multibody")]
pub(crate) struct TreeDenseOutput {
    model: Py<Model>,
    curves: Box<dyn Curves + Send + Sync>,
}

/// The curves of a tree over time.
trait Curves {
    /// The state at a time.
    fn at(&self, t: f64) -> Option<TreeState>;
    /// The least and the greatest time.
    fn span(&self) -> (f64, f64);
}

impl<Q: OfTree> Curves for solution::Solution<Q> {
    fn at(&self, t: f64) -> Option<TreeState> {
        self.at(t).map(|x| Q::tree(&x))
    }
    fn span(&self) -> (f64, f64) {
        let (first, last) = self.span().unwrap_or((f64::NAN, f64::NAN));
        (first.min(last), first.max(last))
    }
}

value! {
    impl TreeDenseOutput {
        /// float: The least time; of a run backwards that of its end, as in SciPy.
        t_min: f64 = |own| own.curves.span().0;
        /// float: The greatest time; of a run backwards that of its start.
        t_max: f64 = |own| own.curves.span().1;
    }
}

#[pymethods]
impl TreeDenseOutput {
    #[pyo3(signature = (t, /))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
    ) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Error> {
        let (scalar, times) = times("t", t)?;
        let mut states = Vec::with_capacity(times.len());
        for t in times {
            states.push(self.curves.at(t).ok_or_else(|| {
                let (first, last) = (self.t_min(), self.t_max());
                Error::input(format!("`t` must be within the times integrated, {first} to {last}, found {t}"))
            })?);
        }
        let model = &self.model.get().model;
        let n = states.len();
        let (q, v) = rows(model, states)?;
        let q = array(py, q, &[n, model.n_positions()])?.into_any();
        let v = array(py, v, &[n, model.n_velocities()])?.into_any();
        if scalar { Ok((q.get_item(0)?, v.get_item(0)?)) } else { Ok((q, v)) }
    }

    fn __repr__(&self) -> String {
        format!("<TreeDenseOutput from t = {} to {}>", self.t_min(), self.t_max())
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "the curves of a TreeDenseOutput cannot be written or pickled: take the arrays that it gives at the times needed",
        ))
    }
}

/// Motion of a tree: times, configurations and velocities, how the run ended and what it took.
///
/// Quantities of the model follow from q and v, as in ``solution.model.kinetic_energy(solution.q,
/// solution.v)``.
#[pyclass(frozen, module = "somersault.multibody")]
pub(crate) struct TreeSolution {
    model: Py<Model>,
    t: Py<PyAny>,
    q: Py<PyAny>,
    v: Py<PyAny>,
    report: Report,
    dense: Option<Py<TreeDenseOutput>>,
    /// None without `events`.
    watched: Option<FunctionEvents>,
    touches: Option<TreeTouches>,
}

/// The events of functions that a run was given: for each function an array of times, of configurations and of velocities.
struct FunctionEvents {
    arrays: [Py<PyTuple>; 3],
    certificates: Vec<Certificate>,
}

impl FunctionEvents {
    fn of<Q: OfTree>(
        py: Python<'_>,
        model: &multibody::Model,
        EventsByFunction { each, certificates }: EventsByFunction<Q>,
    ) -> Result<Self, Error> {
        let [mut t_events, mut q_events, mut v_events] = [(); 3].map(|()| Vec::new());
        for (times, states) in each {
            let n = times.len();
            let (q, v) = rows(model, states)?;
            t_events.push(array(py, times, &[n])?);
            q_events.push(array(py, q, &[n, model.n_positions()])?);
            v_events.push(array(py, v, &[n, model.n_velocities()])?);
        }
        let tuple = |arrays| PyTuple::new(py, arrays).map(Bound::unbind);
        Ok(Self { arrays: [tuple(t_events)?, tuple(q_events)?, tuple(v_events)?], certificates })
    }
}

impl TreeSolution {
    /// From times, and as many configurations and velocities, one after the other.
    pub(crate) fn of(
        py: Python<'_>,
        model: &Bound<'_, Model>,
        t: Vec<f64>,
        q: Vec<f64>,
        v: Vec<f64>,
        report: Report,
    ) -> PyResult<Self> {
        let (n, tree) = (t.len(), &model.get().model);
        let q = array(py, q, &[n, tree.n_positions()])?.into_any().unbind();
        let v = array(py, v, &[n, tree.n_velocities()])?.into_any().unbind();
        let t = PyArray1::from_vec(py, t).into_any().unbind();
        let model = model.clone().unbind();
        Ok(Self { model, t, q, v, report, dense: None, watched: None, touches: None })
    }
}

value! {
    impl TreeSolution {
        /// Model: The tree.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// ndarray, shape (n,): Times, s.
        t: Py<PyAny> = |own, py| own.t.clone_ref(py);
        /// ndarray, shape (n, n_positions): Configurations.
        q: Py<PyAny> = |own, py| own.q.clone_ref(py);
        /// ndarray, shape (n, n_velocities): Velocities.
        v: Py<PyAny> = |own, py| own.v.clone_ref(py);
        /// int: 0 if the end of the interval was reached, 1 if a terminal event ended the run or the observer stopped it, -1 if
        /// it was interrupted, -2 if it failed.
        status: i32 = |own| own.report.status;
        /// str: The same in words.
        message: &str = |own| &own.report.message;
        /// bool: Whether the run ended as asked, by its interval, a terminal event or its observer.
        success: bool = |own| own.report.status >= 0;
        /// int: How often the equations of motion were evaluated.
        nfev: u64 = |own| own.report.nfev;
        /// int: Steps made.
        n_steps: u64 = |own| own.report.n_steps;
        /// int: Steps tried and rejected by the step size control.
        n_rejected: u64 = |own| own.report.n_rejected;
        /// TreeDenseOutput or None: Configuration and velocity at any time, where dense output was requested.
        sol: Option<Py<TreeDenseOutput>> = |own, py| own.dense.as_ref().map(|dense| dense.clone_ref(py));
        /// tuple of ndarray, or None: The times of the events of each function in `events=`, s. None without `events`.
        t_events: Option<Py<PyTuple>> = |own, py| own.event_arrays(py, 0);
        /// tuple of ndarray, or None: The configurations at these times, for each function.
        q_events: Option<Py<PyTuple>> = |own, py| own.event_arrays(py, 1);
        /// tuple of ndarray, or None: The velocities at these times, for each function.
        v_events: Option<Py<PyTuple>> = |own, py| own.event_arrays(py, 2);
        /// tuple of bool, or None: For each function, whether no event can have been missed, by its attribute ``lipschitz``.
        certified: PyResult<Option<Bound<'py, PyTuple>>> =
            |own, py| own.watched.as_ref().map(|found| certified(py, &found.certificates)).transpose();
        /// tuple, or None: For each function start and end of the first step in which its bound did not suffice, s, or None.
        unproved: PyResult<Option<Bound<'py, PyTuple>>> =
            |own, py| own.watched.as_ref().map(|found| unproved(py, &found.certificates)).transpose();
        /// list of LinkContact and LinkPair: The contacts, those with surfaces first; empty where none were given.
        contacts: Py<PyAny> = |own, py| match &own.touches {
            Some(touches) => touches.contacts.clone_ref(py),
            None => PyList::empty(py).into_any().unbind(),
        };
        /// list of LinkEvent: What happened in contacts.
        events: Vec<Py<LinkEvent>> = |own, py| {
            own.touches.iter().flat_map(|found| &found.events).map(|event| event.clone_ref(py)).collect()
        };
        /// int: Number of events.
        n_events: u64 = |own| own.touches.as_ref().map_or(0, |found| found.counts.0);
        /// int: Steps tried to find events, and to prove steps clear of them, in addition.
        n_trials: u64 = |own| own.touches.as_ref().map_or(0, |found| found.counts.1);
        /// int: Steps that were parts of longer ones, divided for the contacts closed.
        n_substeps: u64 = |own| own.touches.as_ref().map_or(0, |found| found.counts.2);
        /// ndarray, shape (n, contacts, 3), or None: Stretches of friction, m, world frame.
        stretches: Option<Py<PyAny>> = |own, py| own.touching(py, |found| &found.stretches);
        /// ndarray, shape (n, contacts, 3), or None: Forces of contacts on the links, on the first of a pair, world frame, N.
        contact_forces: Option<Py<PyAny>> = |own, py| own.touching(py, |found| &found.touches.forces);
        /// ndarray, shape (n, contacts, 3), or None: Points of contact, world frame, m.
        contact_points: Option<Py<PyAny>> = |own, py| own.touching(py, |found| &found.touches.points);
        /// ndarray, shape (n, contacts), or None: Gaps, m, negative inside the surface.
        gaps: Option<Py<PyAny>> = |own, py| own.touching(py, |found| &found.touches.gaps);
        /// ndarray, shape (n,), or None: Energy of the springs of contacts and friction, J.
        elastic_energy: Option<Py<PyAny>> = |own, py| own.touching(py, |found| &found.touches.elastic_energy);
    }
}

impl TreeSolution {
    /// Times, configurations or velocities of the events of functions.
    fn event_arrays(&self, py: Python<'_>, which: usize) -> Option<Py<PyTuple>> {
        self.watched.as_ref().map(|found| found.arrays[which].clone_ref(py))
    }

    /// An array of what contacts did.
    fn touching(&self, py: Python<'_>, of: impl Fn(&TreeTouches) -> &Py<PyAny>) -> Option<Py<PyAny>> {
        self.touches.as_ref().map(|touches| of(touches).clone_ref(py))
    }
}

#[pymethods]
impl TreeSolution {
    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.t.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (n, report) = (self.__len__(py)?, &self.report);
        Ok(format!("<TreeSolution: {n} states; {} ({} steps)>", report.message, report.n_steps))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let Report { status, message, nfev, n_steps, n_rejected } = own.report.clone();
        let arrays = (own.model(py), own.t(py), own.q(py), own.v(py));
        let touches = own.touches.as_ref().map(|touches| touches.pickled(py));
        let watched = own.watched.as_ref().map(|found| {
            let certificates: Vec<_> =
                found.certificates.iter().map(|certificate| pickled(*certificate)).collect();
            (found.arrays.each_ref().map(|arrays| arrays.clone_ref(py)), certificates)
        });
        by_restore(slf, (arrays, (status, message, nfev, n_steps, n_rejected), touches, watched))
    }

    /// A pickled solution; the dense output is not part of it.
    #[classmethod]
    #[pyo3(signature = (arrays, report, touches=None, watched=None))]
    fn _restore(
        _: &Bound<'_, PyType>,
        arrays: (Py<Model>, Py<PyAny>, Py<PyAny>, Py<PyAny>),
        report: (i32, String, u64, u64, u64),
        touches: Option<PickledTouches>,
        watched: Option<([Py<PyTuple>; 3], Vec<PickledCertificate>)>,
    ) -> Self {
        let (model, t, q, v) = arrays;
        let (status, message, nfev, n_steps, n_rejected) = report;
        let report = Report { status, message, nfev, n_steps, n_rejected };
        let watched = watched.map(|(arrays, certificates)| {
            let certificates = certificates.into_iter().map(unpickled).collect();
            FunctionEvents { arrays, certificates }
        });
        Self { model, t, q, v, report, dense: None, watched, touches: touches.map(TreeTouches::of_pickled) }
    }
}

/// Motion of a tree under joint forces.
///
/// Integrates q̇ = v and M(q) v̇ + h(q, v) = τ on the configuration manifold. Where some degrees of freedom
/// are active, they follow the accelerations given, by whatever forces that takes.
///
/// Parameters
/// ----------
/// model : Model
///     The tree.
/// q, v : array_like, shape (n_positions,) and (n_velocities,)
///     Configuration and velocity at the start.
/// interval : tuple of float
///     Start and end time, s. Where the end is before the start the motion is followed back in time, without contacts and knots of
///     a `TorqueProfile`.
/// dt : float, optional
///     Step, s; without it steps are adapted.
/// method : str or MethodInfo, optional
///     A method of the table whose scope is any system, in the world's variables; ``"rkmk"`` unless given,
///     or ``"rkmk8"`` where steps are adapted. ``"radau5"`` is for stiff joints and contacts of light feet.
/// torque : array_like, shape (n_velocities,), TorqueProfile or callable, optional
///     Joint forces, those at knots of time, or ``f(t, q, v)`` that returns them; none unless given.
/// active : sequence of str, or array_like of bool, shape (n_velocities,), optional
///     Bodies whose joints are active, or a flag for each degree of freedom; none unless given.
/// acceleration : array_like, shape (n_velocities,), or callable, optional
///     Accelerations of the active degrees of freedom, or ``f(t, q, v)`` that returns them; zero unless
///     given. The others are not used.
/// contacts : LinkContact, LinkPair or sequence of them, optional
///     Where links touch surfaces and each other; see `contact`. Steps are cut where a contact begins or ends, sticks or
///     slips, so that the method keeps its order.
/// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
///     Stretches of the friction of the contacts at the start, m, world frame, those of pairs last. ``'loaded'`` lets them
///     carry the load as far as friction can. Unstretched unless given.
/// max_event_rate, keep_events, graze, max_substeps
///     As of `somersault.integrate`.
/// rtol, atol, max_step, first_step, max_steps, start_up, dense_output, t_eval, every
///     As of `somersault.integrate`.
/// events : callable or sequence of callable, optional
///     Functions ``event(t, q, v) -> float`` of which changes of sign are looked for, with attributes ``terminal`` and
///     ``direction`` and ``lipschitz`` as of `somersault.integrate`. The attributes `t_events`, `q_events` and `v_events` of the solution
///     have them, `certified` whether none can have been missed.
/// observer : callable, optional
///     ``f(t, q, v)``, called after every step; the run stops where it returns something true.
/// on_interrupt, progress
///     As of `somersault.integrate`.
///
/// Returns
/// -------
/// TreeSolution
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed.
/// IntegrationError
///     If the run cannot continue; a `ChatteringError` where events follow each other too fast.
/// DynamicsError
///     If the mass matrix becomes singular.
///
/// Examples
/// --------
/// >>> from somersault import multibody
/// >>> pole = multibody.cart_pendulum()
/// >>> motion = multibody.integrate_tree(pole, [0.0, 0.1], [0.0, 0.0], (0.0, 1.0), dt=0.01)
/// >>> motion.q.shape
/// (101, 2)
///
/// Back to the start:
///
/// >>> back = multibody.integrate_tree(pole, motion.q[-1], motion.v[-1], (1.0, 0.0), rtol=1e-10, atol=1e-12)
/// >>> bool(abs(back.q[-1] - motion.q[0]).max() < 1e-6)
/// True
///
/// A leg that hops, with located events:
///
/// >>> from somersault import contact
/// >>> leg = contact.hopping_leg()
/// >>> hop = multibody.integrate_tree(
/// ...     leg.model, leg.q, leg.v, (0.0, 0.16), torque=leg.torque, contacts=leg.contacts)
/// >>> [event.kind for event in hop.events]
/// ['touch_down', 'stick', 'slip', 'release']
#[pyfunction]
#[pyo3(signature = (
    model, q, v, interval, *, dt=None, method=None, torque=None, active=None, acceleration=None, contacts=None,
    stretches=None, max_event_rate=1e9, keep_events=true, graze=1e-6, max_substeps=Some(100_000), rtol=None,
    atol=None, max_step=None, first_step=None, max_steps=None, start_up="one_step", dense_output=false,
    t_eval=None, events=None, every=1, observer=None, on_interrupt="raise", progress=false
))]
pub(crate) fn integrate_tree<'py>(
    py: Python<'py>,
    model: &Bound<'py, Model>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    dt: Option<f64>,
    method: Option<&Bound<'py, PyAny>>,
    torque: Option<&Bound<'py, PyAny>>,
    active: Option<&Bound<'py, PyAny>>,
    acceleration: Option<&Bound<'py, PyAny>>,
    contacts: Option<&Bound<'py, PyAny>>,
    stretches: Option<&Bound<'py, PyAny>>,
    max_event_rate: f64,
    keep_events: bool,
    graze: f64,
    #[pyo3(from_py_with = integer_or_none)] max_substeps: Option<i64>,
    rtol: Option<f64>,
    atol: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
    #[pyo3(from_py_with = integer_or_none)] max_steps: Option<i64>,
    start_up: &str,
    dense_output: bool,
    t_eval: Option<&Bound<'py, PyAny>>,
    events: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = integer)] every: i64,
    observer: Option<Bound<'py, PyAny>>,
    on_interrupt: &str,
    progress: bool,
) -> Result<Py<TreeSolution>, Error> {
    let tree = &model.get().model;
    let n = tree.n_velocities();
    let interval = (interval[0], interval[1]);
    let default = if dt.is_some() { Method::Rkmk } else { Method::Rkmk8 };
    let method = method.map_or(Ok(default), |m| methods::extract("method", m))?;
    let arguments = StepArguments { dt, rtol, atol, max_step, first_step, max_steps };
    let (steps, backwards) = arguments.either_way(method, interval)?;
    if backwards && contacts.is_some() {
        return Err(Error::input(FORWARD_WITH_CONTACTS));
    }
    let q = finite_all("q", with_shape("q", &[tree.n_positions()], q)?)?;
    let v = finite_all("v", with_shape("v", &[n], v)?)?;
    let initial = tree.state(&q, &v)?;
    if acceleration.is_some() && active.is_none() {
        return Err(Error::input(
            "`acceleration` is that of `active` degrees of freedom, and there are none",
        ));
    }
    let split = active.map_or(Ok(Split::new(vec![false; n])), |active| model.get().split(active))?;
    let failure = Failure::default();
    let torque = Given::extract("torque", n, torque, &failure)?;
    if backwards && torque.has_knots() {
        return Err(Error::input(
            "`torque` must be numbers or a callable where `interval` runs backwards, found a TorqueProfile",
        ));
    }
    let acceleration = Given::accelerations(n, acceleration, &failure)?;
    if let Some(observer) = &observer {
        check_callable("observer", "f(t, q, v)", observer)?;
    }
    let contacts = contacts.map(|contacts| TreeContactList::extract("contacts", contacts)).transpose()?;
    if stretches.is_some() && contacts.is_none() {
        return Err(Error::input("`stretches` are those of contacts, and there are none"));
    }
    let events = events.map(|events| EventFunctions::extract("f(t, q, v)", events)).transpose()?;
    let (t_eval, every) = plan::kept(t_eval, every)?;
    let location = Location { max_event_rate, keep_events, graze, stiff: stiff_of(max_substeps)? };
    let plan = Plan {
        method,
        options: Options { start_up: start_up_of(start_up)? },
        steps,
        backwards,
        every,
        t_eval,
        dense: dense_output,
        calls_python: observer.is_some()
            || events.is_some()
            || torque.is_callable()
            || acceleration.is_callable()
            || contacts.as_ref().is_some_and(|contacts| contacts.calls_python(py)),
        return_interrupted: returns_interrupted(on_interrupt)?,
    };
    let system = TreeSystem::new(tree, &torque).driven(split, drive(&acceleration))?;
    let mut requested = Requested { model, plan: &plan, torque: &torque, observer, events, progress };
    let touches = contacts.is_some();
    // Steps end at knots where events are located.
    let contacts = contacts.or_else(|| torque.has_knots().then(TreeContactList::default));
    let Some(contacts) = contacts else {
        let mut monitor = requested.monitor(py, &initial, &failure)?;
        let outcome = monitor.supervise(py, &plan, |monitor| {
            if backwards {
                solve::integrate(&TimeReversed(&system), &initial, &plan, monitor)
            } else {
                solve::integrate(&system, &initial, &plan, monitor)
            }
        })?;
        let n_rejected = outcome.as_ref().map_or(0, |outcome| outcome.rejected);
        let status = outcome.map(|outcome| outcome.status).map_err(Error::from);
        return requested.conclude(py, monitor.finish(py, status), n_rejected, |_| Ok(None));
    };
    let system = contacts.on(py, system, &failure)?;
    let initial = stretched(&system, stretches, interval.0, initial)?;
    let mut monitor = requested.monitor(py, &initial, &failure)?;
    let outcome = monitor.supervise(py, &plan, |monitor| {
        plan.run(&system).locating(location).observed_by(monitor).from(&initial)
    })?;
    let (status, located) = match outcome {
        Ok(located) => (Ok(located.status), located),
        Err(interrupted) => {
            let Interrupted { reason, so_far } = *interrupted;
            (Err(reason.into()), so_far)
        }
    };
    let Located { rejected, trials, substeps, event_count, events, .. } = located;
    requested.conclude(py, monitor.finish(py, status), rejected, |states| {
        let counts = (event_count, trials, substeps);
        let found = touches.then(|| TreeTouches::of(py, &system, &contacts, states, &events, counts));
        found.transpose()
    })
}

/// A run to be made.
struct Requested<'a, 'py> {
    model: &'a Bound<'py, Model>,
    plan: &'a Plan,
    torque: &'a Given,
    observer: Option<Bound<'py, PyAny>>,
    events: Option<EventFunctions>,
    progress: bool,
}

impl Requested<'_, '_> {
    /// What records and watches it.
    fn monitor<Q: OfTree>(
        &mut self,
        py: Python<'_>,
        initial: &State<Q>,
        failure: &Failure,
    ) -> Result<Monitor<Q>, Error> {
        let tree = &self.model.get().model;
        let watch = self.observer.as_ref().map(|observer| -> Watch<Q> {
            let name = callable_name(observer);
            let (observer, model) = (observer.clone().unbind(), self.model.clone().unbind());
            Box::new(move |py, t, x| {
                let (q, v) = coordinates(&model.get().model, x)?;
                let answer = observer.call1(py, (t, PyArray1::from_vec(py, q), PyArray1::from_vec(py, v)));
                let answer = noted(py, answer, || format!("the observer {name} at t = {t}"))?;
                answer.bind(py).is_truthy()
            })
        });
        let (start, end) = self.plan.interval();
        let bar = if self.progress { Some(ProgressBar::open(py, start, end)?) } else { None };
        let numbers = tree.n_positions() + tree.n_velocities();
        let monitor = Monitor::try_new(self.plan, initial, numbers, watch, bar, failure.clone())?;
        let model = self.model.clone().unbind();
        Ok(monitor.looking_for(py, self.events.take(), || {
            Box::new(move |py, t, x| {
                let (q, v) = coordinates(&model.get().model, x)?;
                Ok((t, PyArray1::from_vec(py, q), PyArray1::from_vec(py, v)).into_pyobject(py)?.unbind())
            })
        }))
    }

    /// The solution of what was recorded.
    fn conclude<Q: OfTree>(
        &self,
        py: Python<'_>,
        finish: Finish<Q>,
        n_rejected: u64,
        touches: impl FnOnce(&[State<Q>]) -> Result<Option<TreeTouches>, Error>,
    ) -> Result<Py<TreeSolution>, Error> {
        let (model, tree) = (self.model, &self.model.get().model);
        let Finish { recorded, curves, watched, steps, status, message, failed } = finish;
        let nfev = self.torque.calls();
        let report = Report { status, message, nfev, n_steps: steps, n_rejected };
        let touches = touches(&recorded.states)?;
        let (q, v) = rows(tree, recorded.states)?;
        let mut solution = TreeSolution::of(py, model, recorded.times, q, v, report)?;
        solution.touches = touches;
        solution.watched = watched.map(|each| FunctionEvents::of(py, tree, each)).transpose()?;
        if self.plan.dense {
            let model = model.clone().unbind();
            solution.dense = Some(Py::new(py, TreeDenseOutput { model, curves: Box::new(curves) })?);
        }
        self.plan.deliver(py, failed, Py::new(py, solution)?)
    }
}
