//! Derivatives of a tree's motion through contacts.

use crate::contact::sensitivity::{Derivatives, PickledDerivatives, outcome_of, parameters as parameters_of};
use crate::contact::tree::{LinkEvent, TreeContactList, TreeTouches, stretched};
use crate::core::callable::Failure;
use crate::core::convert::{array, finite_all, integer_or_none, interval_of, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::integrators::methods;
use crate::integrators::monitor::Monitor;
use crate::integrators::plan::{Plan, StepArguments};
use crate::multibody::given::Given;
use crate::multibody::model::Model;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::sensitivity::{self, Differentiation, Parameter, SensitivityRun, VariedOf};
use somersault::contact::tree::TreeInContact;
use somersault::integrators::events::Location;
use somersault::integrators::methods::{Method, Options};
use somersault::integrators::state::State;
use somersault::multibody::motion::{TreeForces, TreeSystem};

/// A motion of a tree through contacts and its derivative.
///
/// With n degrees of freedom rows of a derivative are the motions of the joints, along ``model.displace(q, e_k)``, then the
/// changes of their velocities.
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> leg = contact.hopping_leg()
/// >>> found = contact.differentiate_tree(
/// ...     leg.model, leg.q, leg.v, (0.0, 0.05), dt=1e-3, contacts=leg.contacts, torque=leg.torque)
/// >>> found.by_state.shape, found.event_times.shape
/// ((10, 10), (2, 10))
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct TreeSensitivities {
    t: f64,
    q: Py<PyArrayDyn<f64>>,
    v: Py<PyArrayDyn<f64>>,
    events: Vec<Py<LinkEvent>>,
    derivatives: Derivatives,
}

value! {
    impl TreeSensitivities {
        /// float: Time reached, s.
        t: f64 = |own| own.t;
        /// ndarray, shape (n_positions,): Configuration reached.
        q: Py<PyArrayDyn<f64>> = |own, py| own.q.clone_ref(py);
        /// ndarray, shape (n_velocities,): Velocity reached.
        v: Py<PyArrayDyn<f64>> = |own, py| own.v.clone_ref(py);
        /// list of LinkEvent: What happened in contacts.
        events: Vec<Py<LinkEvent>> = |own, py| own.events.iter().map(|event| event.clone_ref(py)).collect();
        /// ndarray, shape (2 n_velocities, 2 n_velocities): Derivative of the state reached by the state at the start.
        by_state: Py<PyArrayDyn<f64>> = |own, py| own.derivatives.by_state.clone_ref(py);
        /// ndarray, shape (2 n_velocities, parameters): Derivative of the state reached by the parameters.
        by_parameters: Py<PyArrayDyn<f64>> = |own, py| own.derivatives.by_parameters.clone_ref(py);
        /// ndarray, shape (events, 2 n_velocities + parameters): Derivative of the times of the events, s, laid out as
        /// `by_state` and `by_parameters` side by side: one row for each event. NaN at an event that changes nothing.
        event_times: Py<PyArrayDyn<f64>> = |own, py| own.derivatives.event_times.clone_ref(py);
        /// ndarray, shape (contacts, 3): Stretches of the contacts' friction in the state reached, m.
        stretches: Py<PyArrayDyn<f64>> = |own, py| own.derivatives.stretches.clone_ref(py);
    }
}

impl TreeSensitivities {
    fn of<F: TreeForces>(
        py: Python<'_>,
        system: &TreeInContact<'_, F>,
        found: &sensitivity::TreeSensitivities,
    ) -> Result<Self, Error> {
        let sensitivity::TreeSensitivities { run, state, parameters, event_times } = found;
        let end = run.state.base();
        let mut v = vec![0.0; system.model().n_velocities()];
        system.model().joint_velocities(&end, &mut v)?;
        let numbers =
            |numbers: &[f64]| Ok::<_, PyErr>(array(py, numbers.to_vec(), &[numbers.len()])?.unbind());
        let event = |event| TreeTouches::event(py, system, event);
        Ok(Self {
            t: run.t,
            q: numbers(end.configuration.as_slice())?,
            v: numbers(&v)?,
            events: run.events.iter().map(event).collect::<Result<_, _>>()?,
            derivatives: Derivatives::of(py, [state, parameters, event_times], run.state.variables())?,
        })
    }
}

#[pymethods]
impl TreeSensitivities {
    fn __repr__(&self, py: Python<'_>) -> String {
        let parameters = self.derivatives.n_parameters(py);
        format!(
            "<TreeSensitivities at t = {}: {} events, {parameters} parameters>",
            self.t,
            self.events.len()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        by_restore(slf, (own.t, (&own.q, &own.v), &own.events, own.derivatives.pickled(py)))
    }

    /// Pickled sensitivities.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        t: f64,
        state: [Bound<'_, PyAny>; 2],
        events: Vec<Py<LinkEvent>>,
        derivatives: PickledDerivatives<'_>,
    ) -> Result<Self, Error> {
        let (py, [q, v]) = (cls.py(), state);
        let read = |name: &str, value: &Bound<'_, PyAny>| {
            let shape = [value.len()?];
            Ok::<_, Error>(array(py, with_shape(name, &shape, value)?, &shape)?.unbind())
        };
        let derivatives = Derivatives::of_pickled(py, 2 * v.len()?, events.len(), derivatives)?;
        Ok(Self { q: read("q", &q)?, v: read("v", &v)?, t, events, derivatives })
    }
}

/// A constant of a law of contact, or a joint force.
fn parameter(value: &Bound<'_, PyAny>, names: &[String]) -> Result<Parameter, Error> {
    let contact = |of: &Bound<'_, PyAny>| match of.extract::<usize>() {
        Ok(number) => Some(number),
        Err(_) => of.extract::<String>().ok().and_then(|of| names.iter().position(|name| *name == of)),
    };
    let parameter = value.extract::<(String, Bound<'_, PyAny>)>().ok().and_then(|(name, of)| {
        match name.split_once('.') {
            Some(("law", name)) => Some(Parameter::normal(contact(&of)?, name.to_string())),
            Some(("friction", name)) => Some(Parameter::friction(contact(&of)?, name.to_string())),
            None if name == "torque" => of.extract::<usize>().ok().map(Parameter::JointForce),
            Some(_) | None => None,
        }
    });
    match parameter {
        Some(parameter) => Ok(parameter),
        None => Err(Error::input(format!(
            "`parameters` must hold ('law.NAME', contact), ('friction.NAME', contact) or ('torque', degree of freedom), found {}",
            value.repr()?
        ))),
    }
}

/// Motion of a tree through contacts, and its derivative by the initial state and by parameters.
///
/// The variational equations are integrated beside the state, by the same method in the same steps, and jump
/// where contacts begin and end. Joint forces that are callables are differentiated by central differences. No joint is driven.
///
/// Parameters
/// ----------
/// model : Model
///     The tree.
/// q, v : array_like, shape (n_positions,) and (n_velocities,)
///     Configuration and velocity at the start, no contact on its surface.
/// interval : tuple of float
///     Start and end time, s.
/// dt : float, optional
///     Step, s. Where it is left out the steps are adapted to `rtol` and `atol` of the motion.
/// contacts : LinkContact, LinkPair or sequence of them
///     Where links touch surfaces and each other.
/// method : str or MethodInfo, optional
///     As of `multibody.integrate_tree`.
/// torque : array_like, shape (n_velocities,), or callable, optional
///     Joint forces, or ``f(t, q, v)`` that returns them; none unless given.
/// parameters : sequence, optional
///     What to differentiate by: ``('law.stiffness', contact)`` and the like, a constant of the law of a contact, by its name
///     or number, or of its friction, ``('friction.coefficient', contact)``, as of `differentiate`; and ``('torque', k)``,
///     a constant force of degree of freedom k.
/// rtol, atol, max_step, first_step, max_steps
///     As of `multibody.integrate_tree`. Errors of derivatives are not weighed.
/// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
///     Stretches of the contacts' friction at the start; they do not change with the state at the start.
/// grazing : float, optional
///     Size of the least gap up to which a surface is grazed, as of `differentiate`.
/// max_event_rate : float, optional
///     Most events per second and contact, averaged over the last 64.
///
/// Returns
/// -------
/// TreeSensitivities
///     The state reached, events, and derivatives.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, or the derivative does not exist: by the friction of a contact without friction, or
///     of a start on a surface.
/// SensitivityError
///     If the motion grazes a surface, touching it or just missing it. The derivatives in the attribute
///     `solution` are then one-sided; the message says of which side.
/// DynamicsError
///     If the mass matrix becomes singular.
/// IntegrationError
///     If the run cannot continue. This one and `SensitivityError` have what was found before in the attribute `solution`.
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> leg = contact.hopping_leg()
/// >>> found = contact.differentiate_tree(
/// ...     leg.model, leg.q, leg.v, (0.0, 0.05), dt=1e-3, contacts=leg.contacts, torque=leg.torque,
/// ...     parameters=[("friction.coefficient", "foot"), ("torque", 4)],
/// ... )
/// >>> found.by_parameters.shape
/// (10, 2)
#[pyfunction]
#[pyo3(signature = (
    model, q, v, interval, *, dt=None, contacts, method=None, torque=None, parameters=None, rtol=None, atol=None,
    max_step=None, first_step=None, max_steps=None, stretches=None, grazing=1.5e-8, max_event_rate=1e9
))]
pub(crate) fn differentiate_tree(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    q: &Bound<'_, PyAny>,
    v: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    dt: Option<f64>,
    contacts: &Bound<'_, PyAny>,
    method: Option<&Bound<'_, PyAny>>,
    torque: Option<&Bound<'_, PyAny>>,
    parameters: Option<&Bound<'_, PyAny>>,
    rtol: Option<f64>,
    atol: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
    #[pyo3(from_py_with = integer_or_none)] max_steps: Option<i64>,
    stretches: Option<&Bound<'_, PyAny>>,
    grazing: f64,
    max_event_rate: f64,
) -> Result<Py<TreeSensitivities>, Error> {
    let tree = &model.get().model;
    let default = if dt.is_some() { Method::Rkmk } else { Method::Rkmk8 };
    let method = method.map_or(Ok(default), |m| methods::extract("method", m))?;
    let interval = (interval[0], interval[1]);
    let steps = StepArguments { dt, rtol, atol, max_step, first_step, max_steps }.steps(method, interval)?;
    let q = finite_all("q", with_shape("q", &[tree.n_positions()], q)?)?;
    let v = finite_all("v", with_shape("v", &[tree.n_velocities()], v)?)?;
    let state = tree.state(&q, &v)?;
    let failure = Failure::default();
    let torque = Given::extract("torque", tree.n_velocities(), torque, &failure)?;
    let contacts = TreeContactList::extract("contacts", contacts)?;
    let plan = Plan {
        method,
        options: Options::default(),
        steps,
        every: u64::MAX,
        dense: false,
        calls_python: torque.is_callable() || contacts.calls_python(py),
        return_interrupted: false,
    };
    let system = contacts.on(py, TreeSystem::new(tree, &torque), &failure)?;
    let names = system.contacts().names();
    let parameters = parameters_of(parameters, |entry| parameter(entry, names))?;
    let location = Location { max_event_rate, ..Location::default() };
    let initial = stretched(&system, stretches, interval.0, state.clone())?;
    let by = Differentiation { parameters, grazing, stretches: initial.rate.variables.clone() };
    let initial = State::<VariedOf<TreeInContact<'_, &Given>>>::varied(initial, []);
    let mut monitor = Monitor::try_new(&plan, &initial, 0, None, None, failure)?;
    let outcome = monitor.supervise(py, &plan, |monitor| {
        let run = SensitivityRun::new(&system, &by, method, steps).with_options(plan.options);
        run.locating(location).observed_by(monitor).from(&state)
    })?;
    let (found, status) = outcome_of(outcome, |found| found.run.status);
    let solution = Py::new(py, TreeSensitivities::of(py, &system, &found)?)?;
    plan.deliver(py, monitor.finish(py, status).failed, solution)
}
