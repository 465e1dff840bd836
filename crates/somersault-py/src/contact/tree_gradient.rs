//! Gradients of costs of a tree's motion through contacts, by the adjoint.

use crate::contact::tree::{LinkEvent, TreeTouches};
use crate::contact::tree_sensitivity::{Arguments, Prepared};
use crate::core::callable::{Failure, call, callable_name, check_callable, noted};
use crate::core::convert::{
    a_type, finite, finite_all, integer_or_none, interval_of, row, row_of_pickled, sequence, with_shape,
};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, counted, value};
use crate::core::waiting::SignalTimer;
use crate::integrators::monitor::STEPS_PER_LOOK;
use crate::integrators::plan::StepArguments;
use crate::multibody::model::Model;
use numpy::prelude::*;
use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::event::EventKind;
use somersault::contact::sensitivity::{EndCost, SensitivityError, SensitivityRun, Undifferentiated};
use somersault::contact::tree::TreeInContact;
use somersault::integrators::augmented::Augmented;
use somersault::integrators::driver::Flow;
use somersault::integrators::events::{Located, Location};
use somersault::multibody::motion::{Coordinates, JointDrive, TreeForces};

/// A motion of a tree through contacts, a cost of it, and the gradient of that.
///
/// With n degrees of freedom the 2 n entries by the state are by the motions of the joints, along ``model.displace(q, e_k)``, then
/// by the changes of their velocities.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import contact
/// >>> leg = contact.hopping_leg()
/// >>> found = contact.gradient_tree(
/// ...     leg.model, leg.q, leg.v, (0.0, 0.05), lambda q, v: (v[1], None, np.eye(5)[1]), dt=1e-3, contacts=leg.contacts)
/// >>> found.by_state.shape
/// (10,)
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct TreeGradient {
    t: f64,
    q: Py<PyArrayDyn<f64>>,
    v: Py<PyArrayDyn<f64>>,
    events: Vec<Py<LinkEvent>>,
    cost: f64,
    by_state: Py<PyArrayDyn<f64>>,
    by_parameters: Py<PyArrayDyn<f64>>,
}

value! {
    impl TreeGradient {
        /// float: Time reached, s.
        t: f64 = |own| own.t;
        /// ndarray, shape (n_positions,): Configuration reached.
        q: Py<PyArrayDyn<f64>> = |own, py| own.q.clone_ref(py);
        /// ndarray, shape (n_velocities,): Velocity reached.
        v: Py<PyArrayDyn<f64>> = |own, py| own.v.clone_ref(py);
        /// list of LinkEvent: What happened in contacts.
        events: Vec<Py<LinkEvent>> = |own, py| own.events.iter().map(|event| event.clone_ref(py)).collect();
        /// float: The cost.
        cost: f64 = |own| own.cost;
        /// ndarray, shape (2 n_velocities,): Derivative of the cost by the state at the start.
        by_state: Py<PyArrayDyn<f64>> = |own, py| own.by_state.clone_ref(py);
        /// ndarray, shape (parameters,): Derivative of the cost by the parameters.
        by_parameters: Py<PyArrayDyn<f64>> = |own, py| own.by_parameters.clone_ref(py);
    }
}

impl TreeGradient {
    fn of<F: TreeForces, D: JointDrive>(
        py: Python<'_>,
        system: &TreeInContact<'_, F, D>,
        run: &Located<Augmented<Coordinates>, EventKind>,
        (cost, by_state, by_parameters): (f64, Vec<f64>, Vec<f64>),
    ) -> Result<Self, Error> {
        let end = run.state.base();
        let mut v = vec![0.0; system.model().n_velocities()];
        system.model().joint_velocities(&end, &mut v)?;
        let row = |numbers: Vec<f64>| row(py, numbers).map(Bound::unbind);
        Ok(Self {
            t: run.t,
            q: row(end.configuration.as_slice().to_vec())?,
            v: row(v)?,
            events: run
                .events
                .iter()
                .map(|event| TreeTouches::event(py, system, event))
                .collect::<Result<_, _>>()?,
            cost,
            by_state: row(by_state)?,
            by_parameters: row(by_parameters)?,
        })
    }
}

#[pymethods]
impl TreeGradient {
    fn __repr__(&self, py: Python<'_>) -> String {
        format!(
            "<TreeGradient of the cost {} at t = {}: {}, {}>",
            self.cost,
            self.t,
            counted(self.events.len(), "event", "events"),
            counted(self.by_parameters.bind(py).len(), "parameter", "parameters")
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        let gradient = (own.cost, &own.by_state, &own.by_parameters);
        by_restore(slf, (own.t, (&own.q, &own.v), &own.events, gradient))
    }

    /// A pickled gradient.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        t: f64,
        state: [Bound<'_, PyAny>; 2],
        events: Vec<Py<LinkEvent>>,
        gradient: (f64, Bound<'_, PyAny>, Bound<'_, PyAny>),
    ) -> Result<Self, Error> {
        let ([q, v], (cost, by_state, by_parameters)) = (state, gradient);
        Ok(Self {
            t,
            q: row_of_pickled("q", &q)?,
            v: row_of_pickled("v", &v)?,
            events,
            cost,
            by_state: row_of_pickled("by_state", &by_state)?,
            by_parameters: row_of_pickled("by_parameters", &by_parameters)?,
        })
    }
}

/// A value and its derivatives as a callable returns them: each of so many numbers, or None where they are zero.
fn value_and_derivatives<const N: usize>(
    what: &str,
    returned: &Bound<'_, PyAny>,
    out: [&mut [f64]; N],
) -> Result<f64, Error> {
    let parts =
        sequence(returned).map(|parts| parts.try_iter()?.collect::<PyResult<Vec<_>>>()).transpose()?;
    let wrong = || {
        let found = a_type(returned);
        Error::input(format!("{what} must be a tuple of a number and {N} derivatives, found {found}"))
    };
    let parts = parts.filter(|parts| parts.len() == 1 + N).ok_or_else(wrong)?;
    let first = || {
        let found = a_type(&parts[0]);
        Error::input(format!("{what} must begin with a real number, found {found}"))
    };
    let value = finite(what, parts[0].extract::<f64>().map_err(|_| first())?)?;
    for (out, part) in out.into_iter().zip(&parts[1..]) {
        if part.is_none() {
            out.fill(0.0);
        } else {
            out.copy_from_slice(&finite_all(what, with_shape(what, &[out.len()], part)?)?);
        }
    }
    Ok(value)
}

/// Gradient of a cost of a tree's motion through contacts, by its initial state and by parameters.
///
/// The run is recorded, and a backward pass through the record applies the adjoint: the transpose of each step and of each jump at an event of
/// the columns of `differentiate_tree`. Both give the same numbers, to rounding. The time is that of about five runs for any number of
/// parameters, for example a torque profile of a hundred numbers. The record has a state for each step.
/// Capsules and boxes with friction have the limits that `differentiate_tree` names.
///
/// Parameters
/// ----------
/// model : Model
///     The tree.
/// q, v : array_like, shape (n_positions,) and (n_velocities,)
///     Configuration and velocity at the start, no contact on its surface.
/// interval : tuple of float
///     Start and end time, s.
/// cost : callable, optional
///     ``f(q, v)`` of the state reached, which returns its value and its derivatives by the motions of the joints, along
///     ``model.displace(q, e_k)``, that of planar and free joints along the axes of their bodies, and by their velocities, each of shape
///     (n_velocities,) or None where they are zero.
/// dt : float, optional
///     Step, s. Where it is left out the steps are adapted to `rtol` and `atol` of the motion.
/// contacts : LinkContact, LinkPair or sequence of them
///     Where links touch surfaces and each other.
/// running : callable, optional
///     ``f(t, q, v)``, which returns the integrand of a running cost and its derivatives, as `cost` does. It is evaluated at the stages of
///     all steps, in the backward pass, and integrated with the order of the method.
/// event_cost : callable, optional
///     ``f(t)`` of the times of the events, shape (events,), which returns its value and its derivatives by them. The time of an event that
///     changes nothing has no derivative and must have the weight zero.
/// method : str or MethodInfo, optional
///     An explicit Runge-Kutta method: 'euler', 'mp', 'heun', 'rk4', 'rkmk', 'rkmk3', 'rkmk5', 'rkmk8' or 'cf4'; 'rkmk' unless given,
///     or 'rkmk8' where steps are adapted.
/// torque : array_like, shape (n_velocities,), TorqueProfile or callable, optional
///     Joint forces, those at knots of time, or ``f(t, q, v)`` that returns them; none unless given. A callable is called
///     4 n_velocities times at each stage of the backward pass.
/// active, acceleration
///     Driven degrees of freedom and their accelerations, as of `multibody.integrate_tree`.
/// parameters : sequence, optional
///     What to differentiate by, as of `differentiate_tree`.
/// rtol, atol, max_step, first_step, max_steps
///     As of `multibody.integrate_tree`. Errors of derivatives are not weighed.
/// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
///     Stretches of the contacts' friction at the start; they do not change with the state at the start.
/// grazing : float, optional
///     Size of the minimum gap up to which a surface is grazed, as of `differentiate`.
/// max_event_rate : float, optional
///     Most events per second and contact, averaged over the last 64.
///
/// Returns
/// -------
/// TreeGradient
///     The state reached, events, the cost, which is the sum of those given, and its gradient.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, no cost is given, or the derivative does not exist: by the friction of a contact without
///     friction, or of a start on a surface.
/// SensitivityError
///     If the motion grazes a surface, touching it or just missing it: the gradient in the attribute
///     `solution` is then one-sided, and the message says of which side. Also if the nearest point of a capsule or a box passes to
///     another part of its shape while it touches with friction: the rate of the stretch jumps there, which it leaves out.
/// EvaluationError
///     If the gradient is not finite.
/// DynamicsError
///     If the mass matrix becomes singular.
/// IntegrationError
///     If the run cannot continue; the attribute `solution` has the state reached, without a gradient.
///
/// Examples
/// --------
/// The angle of the knee at the end, by its torque at twenty knots:
///
/// >>> import numpy as np
/// >>> from somersault import contact, multibody
/// >>> leg = contact.hopping_leg()
/// >>> times = np.linspace(0.0, 0.16, 20)
/// >>> knee = multibody.TorqueProfile(times, [leg.torque(t, leg.q, leg.v) for t in times])
/// >>> found = contact.gradient_tree(
/// ...     leg.model, leg.q, leg.v, (0.0, 0.16), lambda q, v: (q[4], np.eye(5)[4], None), dt=1e-3,
/// ...     contacts=leg.contacts, torque=knee, parameters=[("torque", 4, knee)])
/// >>> found.by_parameters.shape
/// (20,)
#[pyfunction]
#[pyo3(signature = (
    model, q, v, interval, cost=None, *, dt=None, contacts, running=None, event_cost=None, method=None, torque=None,
    active=None, acceleration=None, parameters=None, rtol=None, atol=None, max_step=None, first_step=None,
    max_steps=None, stretches=None, grazing=1.5e-8, max_event_rate=1e9
))]
pub(crate) fn gradient_tree(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    q: &Bound<'_, PyAny>,
    v: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    cost: Option<&Bound<'_, PyAny>>,
    dt: Option<f64>,
    contacts: &Bound<'_, PyAny>,
    running: Option<&Bound<'_, PyAny>>,
    event_cost: Option<&Bound<'_, PyAny>>,
    method: Option<&Bound<'_, PyAny>>,
    torque: Option<&Bound<'_, PyAny>>,
    active: Option<&Bound<'_, PyAny>>,
    acceleration: Option<&Bound<'_, PyAny>>,
    parameters: Option<&Bound<'_, PyAny>>,
    rtol: Option<f64>,
    atol: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
    #[pyo3(from_py_with = integer_or_none)] max_steps: Option<i64>,
    stretches: Option<&Bound<'_, PyAny>>,
    grazing: f64,
    max_event_rate: f64,
) -> Result<Py<TreeGradient>, Error> {
    let given =
        [("cost", "f(q, v)", cost), ("running", "f(t, q, v)", running), ("event_cost", "f(t)", event_cost)];
    for (name, signature, value) in given {
        value.map_or(Ok(()), |value| check_callable(name, signature, value))?;
    }
    if given.iter().all(|(_, _, value)| value.is_none()) {
        return Err(Error::input("one of `cost`, `running` and `event_cost` must be given, found none"));
    }
    let steps = StepArguments { dt, rtol, atol, max_step, first_step, max_steps };
    let arguments = Arguments { q, v, interval, steps, contacts, method, torque, active, acceleration };
    let prepared = Prepared::of(py, model.get(), arguments)?;
    let system = prepared.system(py, model.get())?;
    let by = prepared.by(&system, parameters, stretches, grazing)?;
    let location = Location { max_event_rate, ..Location::default() };
    let mut monitor = prepared.monitor(&system)?;
    let Prepared { plan, state, failure, .. } = &prepared;
    let outcome = monitor.supervise(py, plan, |monitor| {
        let run = SensitivityRun::new(&system, &by, plan.method, plan.steps).with_options(plan.options);
        run.locating(location).observed_by(monitor).recorded_from(state)
    })?;
    let (mut recorded, refused) = match outcome {
        Ok(recorded) => (recorded, None),
        Err(undifferentiated) => match *undifferentiated {
            Undifferentiated { reason, so_far: Some(recorded) } => (recorded, Some(reason)),
            Undifferentiated { reason, so_far: None } => {
                return Err(failure
                    .get()
                    .map_or_else(|| reason.into(), |raised| raised.clone_ref(py).into()));
            }
        },
    };
    let is_whole =
        matches!(refused, None | Some(SensitivityError::Grazing(_) | SensitivityError::Feature { .. }));
    let ended = refused.map_or(Ok(recorded.run().status), |reason| Err(reason.into()));
    let is_stopped = failure.get().is_some();
    let failed = monitor.finish(py, ended).failed;
    let n = model.get().model.n_velocities();
    let none = (f64::NAN, vec![f64::NAN; 2 * n], vec![f64::NAN; by.parameters.len()]);
    if !is_whole || is_stopped {
        let solution = Py::new(py, TreeGradient::of(py, &system, recorded.run(), none)?)?;
        return plan.deliver(py, failed, solution);
    }
    let mut value = 0.0;
    let (mut by_motion, mut by_velocity) = (vec![0.0; n], vec![0.0; n]);
    if let Some(cost) = cost {
        let end = recorded.run().state.base();
        let mut v = vec![0.0; n];
        model.get().model.joint_velocities(&end, &mut v)?;
        let q = PyArray1::from_slice(py, end.configuration.as_slice());
        let returned = cost.call1((q, PyArray1::from_vec(py, v)))?;
        let what = format!("{}(q, v)", callable_name(cost));
        value += value_and_derivatives(&what, &returned, [&mut by_motion, &mut by_velocity])?;
    }
    let mut by_event_times = Vec::new();
    if let Some(event_cost) = event_cost {
        let times: Vec<f64> = recorded.run().events.iter().map(|event| event.t).collect();
        by_event_times = vec![0.0; times.len()];
        let returned = event_cost.call1((PyArray1::from_vec(py, times),))?;
        let what = format!("{}(t)", callable_name(event_cost));
        value += value_and_derivatives(&what, &returned, [&mut by_event_times])?;
    }
    let end_cost =
        EndCost { by_motion: &by_motion, by_velocity: &by_velocity, by_event_times: &by_event_times };
    let running = running.map(|running| (running.clone().unbind(), callable_name(running)));
    let mut signals = Signals { failure, timer: SignalTimer::start(), steps: 0 };
    let mut back = || {
        let mut watch = |_: f64| signals.look();
        let Some((running, name)) = &running else { return recorded.gradient(&end_cost, None, &mut watch) };
        let what = format!("{name}(t, q, v)");
        let mut integrand = |t: f64, q: &[f64], v: &[f64], out: [&mut [f64]; 2]| {
            call(failure, f64::NAN, |py| {
                let arguments = (t, PyArray1::from_slice(py, q), PyArray1::from_slice(py, v));
                let returned = noted(py, running.call1(py, arguments), || format!("{what} at t = {t}"))?;
                value_and_derivatives(&what, returned.bind(py), out)
            })
        };
        recorded.gradient(&end_cost, Some(&mut integrand), &mut watch)
    };
    let gradient = if plan.calls_python || running.is_some() { back() } else { py.detach(back) };
    let (found, failed) = match (gradient, failure.get()) {
        (_, Some(raised)) => (none, Some(raised.clone_ref(py))),
        (Err(reason), None) => (none, Some(Error::from(reason).into())),
        (Ok(found), None) => ((value + found.running, found.state, found.parameters), failed),
    };
    let solution = Py::new(py, TreeGradient::of(py, &system, recorded.run(), found)?)?;
    plan.deliver(py, failed, solution)
}

/// Looks for signals in the backward pass.
struct Signals<'a> {
    failure: &'a Failure,
    timer: SignalTimer,
    steps: u64,
}

impl Signals<'_> {
    fn look(&mut self) -> Flow {
        self.steps += 1;
        if self.steps.is_multiple_of(STEPS_PER_LOOK)
            && self.timer.is_due()
            && let Err(raised) = Python::attach(|py| self.timer.look(py))
        {
            self.failure.set(raised);
        }
        if self.failure.get().is_some() { Flow::Stop } else { Flow::Continue }
    }
}
