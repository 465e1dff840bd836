//! Derivatives of a tree's motion through contacts.

use crate::contact::sensitivity::{Derivatives, PickledDerivatives, outcome_of, parameters as parameters_of};
use crate::contact::tree::{LinkEvent, TreeContactList, TreeTouches, contact_named, stretched};
use crate::core::callable::Failure;
use crate::core::convert::{
    finite_all, integer_or_none, interval_of, row, row_of_pickled, sequence, vector, with_shape,
};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::integrators::methods;
use crate::integrators::monitor::Monitor;
use crate::integrators::plan::{Plan, StepArguments};
use crate::multibody::given::{Given, drive};
use crate::multibody::model::Model;
use crate::multibody::profile::TorqueProfile;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::sensitivity::{self, Differentiation, Parameter, SensitivityRun};
use somersault::contact::tree::TreeInContact;
use somersault::integrators::augmented::{Augmented, AugmentedRate};
use somersault::integrators::events::Location;
use somersault::integrators::methods::{Method, Options};
use somersault::integrators::nalgebra::Matrix3;
use somersault::integrators::state::State;
use somersault::integrators::variation::Varied;
use somersault::multibody::motion::{Coordinates, JointDrive, Rates, TreeForces, TreeState, TreeSystem};
use somersault::multibody::{self, Split, TreeParameter};

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
    fn of<F: TreeForces, D: JointDrive>(
        py: Python<'_>,
        system: &TreeInContact<'_, F, D>,
        found: &sensitivity::TreeSensitivities,
    ) -> Result<Self, Error> {
        let sensitivity::TreeSensitivities { run, state, parameters, event_times } = found;
        let end = run.state.base();
        let mut v = vec![0.0; system.model().n_velocities()];
        system.model().joint_velocities(&end, &mut v)?;
        let numbers = |numbers: &[f64]| row(py, numbers.to_vec()).map(Bound::unbind);
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
        let derivatives = Derivatives::of_pickled(py, 2 * v.len()?, events.len(), derivatives)?;
        Ok(Self { q: row_of_pickled("q", &q)?, v: row_of_pickled("v", &v)?, t, events, derivatives })
    }
}

/// What a parameter is: a constant of a law of contact, a joint force or those at knots, or a number that describes a link.
fn parameter(
    value: &Bound<'_, PyAny>,
    (model, names): (&multibody::Model, &[String]),
) -> Result<Vec<Parameter>, Error> {
    let contact = |of: &Bound<'_, PyAny>| match (of.extract::<usize>(), of.extract::<String>()) {
        (Ok(number), _) => Ok(Some(number)),
        (Err(_), Ok(name)) => contact_named("parameters", &name, names).map(Some),
        (Err(_), Err(_)) => Ok(None),
    };
    let body = |of: &Bound<'_, PyAny>| match of.extract::<String>() {
        Ok(name) => model.body(&name).map(Some).map_err(Error::from),
        Err(_) => Ok(None),
    };
    let one = |parameter| Some(vec![parameter]);
    let of_tree = |parameter| one(Parameter::Tree(parameter));
    let parts = sequence(value).map(|parts| parts.try_iter()?.collect::<PyResult<Vec<_>>>()).transpose()?;
    let parts = parts.unwrap_or_default();
    let name = parts.first().and_then(|name| name.extract::<String>().ok()).unwrap_or_default();
    let found = match (name.split_once('.'), name.as_str(), &parts[..]) {
        (Some(("law", name)), _, [_, of]) => {
            contact(of)?.and_then(|of| one(Parameter::normal(of, name.to_string())))
        }
        (Some(("friction", name)), _, [_, of]) => {
            contact(of)?.and_then(|of| one(Parameter::friction(of, name.to_string())))
        }
        (None, "torque", [_, dof]) => {
            dof.extract::<usize>().ok().and_then(|dof| one(Parameter::JointForce(dof)))
        }
        (None, "torque", [_, dof, profile]) => {
            match (dof.extract::<usize>(), profile.cast::<TorqueProfile>()) {
                (Ok(dof), Ok(profile)) => {
                    Some(Parameter::joint_forces_at(dof, profile.get().profile.knots()).collect())
                }
                (Ok(_) | Err(_), _) => None,
            }
        }
        (None, "mass", [_, of]) => body(of)?.and_then(|body| of_tree(TreeParameter::Mass(body))),
        (None, "center", [_, of, way]) => match body(of)? {
            Some(body) => of_tree(TreeParameter::Center(body, vector("parameters", way)?)),
            None => None,
        },
        (None, "origin", [_, of, way]) => match body(of)? {
            Some(body) => of_tree(TreeParameter::Placement(body, vector("parameters", way)?)),
            None => None,
        },
        (None, "inertia", [_, of, tensor]) => match body(of)? {
            Some(body) => {
                let numbers = finite_all("parameters", with_shape("parameters", &[3, 3], tensor)?)?;
                of_tree(TreeParameter::Inertia(body, Matrix3::from_row_slice(&numbers)))
            }
            None => None,
        },
        (Some(_) | None, _, _) => None,
    };
    match found {
        Some(found) => Ok(found),
        None => Err(Error::input(format!(
            "`parameters` must hold ('law.NAME', contact), ('friction.NAME', contact), ('torque', degree of freedom), \
             ('torque', degree of freedom, TorqueProfile), ('mass', body), ('center', body, direction), \
             ('inertia', body, tensor) or ('origin', body, direction), found {}",
            value.repr()?
        ))),
    }
}

/// The arguments of a run of a tree that is differentiated.
pub(crate) struct Arguments<'a, 'py> {
    pub(crate) q: &'a Bound<'py, PyAny>,
    pub(crate) v: &'a Bound<'py, PyAny>,
    pub(crate) interval: [f64; 2],
    pub(crate) steps: StepArguments,
    pub(crate) contacts: &'a Bound<'py, PyAny>,
    pub(crate) method: Option<&'a Bound<'py, PyAny>>,
    pub(crate) torque: Option<&'a Bound<'py, PyAny>>,
    pub(crate) active: Option<&'a Bound<'py, PyAny>>,
    pub(crate) acceleration: Option<&'a Bound<'py, PyAny>>,
}

/// A run of a tree that is differentiated, before its system is made.
pub(crate) struct Prepared {
    pub(crate) state: TreeState,
    pub(crate) plan: Plan,
    pub(crate) failure: Failure,
    torque: Given,
    acceleration: Given,
    split: Split,
    contacts: TreeContactList,
}

impl Prepared {
    pub(crate) fn of(
        py: Python<'_>,
        model: &Model,
        Arguments { q, v, interval, steps, contacts, method, torque, active, acceleration }: Arguments<
            '_,
            '_,
        >,
    ) -> Result<Self, Error> {
        let tree = &model.model;
        let n = tree.n_velocities();
        let default = if steps.dt.is_some() { Method::Rkmk } else { Method::Rkmk8 };
        let method = method.map_or(Ok(default), |m| methods::extract("method", m))?;
        let steps = steps.steps(method, (interval[0], interval[1]))?;
        let q = finite_all("q", with_shape("q", &[tree.n_positions()], q)?)?;
        let v = finite_all("v", with_shape("v", &[n], v)?)?;
        let state = tree.state(&q, &v)?;
        let failure = Failure::default();
        let torque = Given::extract("torque", n, torque, &failure)?;
        if acceleration.is_some() && active.is_none() {
            return Err(Error::input(
                "`acceleration` is that of `active` degrees of freedom, and there are none",
            ));
        }
        let split = active.map_or(Ok(Split::new(vec![false; n])), |active| model.split(active))?;
        let acceleration = Given::accelerations(n, acceleration, &failure)?;
        let contacts = TreeContactList::extract("contacts", contacts)?;
        let plan = Plan {
            method,
            options: Options::default(),
            steps,
            backwards: false,
            every: u64::MAX,
            t_eval: None,
            dense: false,
            calls_python: torque.is_callable() || acceleration.is_callable() || contacts.calls_python(py),
            return_interrupted: false,
        };
        Ok(Self { state, plan, failure, torque, acceleration, split, contacts })
    }

    /// The tree in contact.
    pub(crate) fn system<'s>(
        &'s self,
        py: Python<'_>,
        model: &'s Model,
    ) -> Result<TreeInContact<'s, &'s Given, impl JointDrive + use<'s>>, Error> {
        let tree = TreeSystem::new(&model.model, &self.torque);
        let tree = tree.driven(self.split.clone(), drive(&self.acceleration))?;
        self.contacts.on(py, tree, &self.failure)
    }

    /// What to differentiate a system by.
    pub(crate) fn by<D: JointDrive>(
        &self,
        system: &TreeInContact<'_, &Given, D>,
        parameters: Option<&Bound<'_, PyAny>>,
        stretches: Option<&Bound<'_, PyAny>>,
        grazing: f64,
    ) -> Result<Differentiation, Error> {
        let known = (system.model(), system.contacts().names());
        let parameters = parameters_of(parameters, |entry| parameter(entry, known))?;
        let (start, _) = self.plan.steps.interval();
        let initial = stretched(system, stretches, start, self.state.clone())?;
        let parameters = parameters.into_iter().flatten().collect();
        Ok(Differentiation { parameters, grazing, stretches: initial.rate.variables })
    }

    /// What watches the run.
    pub(crate) fn monitor<D: JointDrive>(
        &self,
        system: &TreeInContact<'_, &Given, D>,
    ) -> Result<Monitor<MovingTree>, Error> {
        let initial = State::<MovingTree>::varied(system.unstretched(self.state.clone()), []);
        Monitor::try_new(&self.plan, &initial, 0, None, None, self.failure.clone())
    }
}

/// A tree with room for columns.
pub(crate) type MovingTree = Varied<Augmented<Coordinates>, AugmentedRate<Rates>>;

/// Motion of a tree through contacts, and its derivative by the initial state and by parameters.
///
/// The variational equations are integrated beside the state, by the same method in the same steps, and jump
/// where contacts begin and end. Joint forces and accelerations that are callables are differentiated by central differences. For
/// many parameters and one cost, `gradient_tree` is faster.
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
/// torque : array_like, shape (n_velocities,), TorqueProfile or callable, optional
///     Joint forces, those at knots of time, or ``f(t, q, v)`` that returns them; none unless given.
/// active, acceleration
///     Driven degrees of freedom and their accelerations, as of `multibody.integrate_tree`.
/// parameters : sequence, optional
///     What to differentiate by:
///
///     * ``('law.stiffness', contact)`` and the like, a constant of the law of a contact, by its name or number, or of its
///       friction, ``('friction.coefficient', contact)``, as of `differentiate`;
///     * ``('torque', k)``, a constant force of degree of freedom k, and ``('torque', k, profile)``, its force at each of the
///       knots of a `multibody.TorqueProfile`: as many columns, linear in time between knots or held as the profile is,
///       whatever `torque` is;
///     * ``('mass', body)``, with the centre of mass and the inertia about it kept; ``('center', body, direction)``, the centre
///       of mass along a direction in the axes of the body, m; ``('inertia', body, tensor)``, a factor on a symmetric tensor that
///       is added to the inertia about the centre of mass, kg m²;
///     * ``('origin', body, direction)``, the position of the joint of a body in its parent, along a direction in the axes of the parent,
///       m: a length. The body is displaced with its centre of mass, its contacts and all bodies that it carries.
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
/// TreeSensitivities
///     The state reached, events, and derivatives.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, or the derivative does not exist: by the friction of a contact without friction, or
///     of a start on a surface.
/// SensitivityError
///     If the motion grazes a surface, touching it or just missing it: the derivatives in the attribute
///     `solution` are then one-sided, and the message says of which side. Also if the nearest point of a capsule or a box passes to
///     another part of its shape while it touches with friction: the rate of the stretch jumps there, which they leave out.
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
    model, q, v, interval, *, dt=None, contacts, method=None, torque=None, active=None, acceleration=None,
    parameters=None, rtol=None, atol=None, max_step=None, first_step=None, max_steps=None, stretches=None, grazing=1.5e-8, max_event_rate=1e9
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
) -> Result<Py<TreeSensitivities>, Error> {
    let steps = StepArguments { dt, rtol, atol, max_step, first_step, max_steps };
    let arguments = Arguments { q, v, interval, steps, contacts, method, torque, active, acceleration };
    let prepared = Prepared::of(py, model.get(), arguments)?;
    let system = prepared.system(py, model.get())?;
    let by = prepared.by(&system, parameters, stretches, grazing)?;
    let location = Location { max_event_rate, ..Location::default() };
    let mut monitor = prepared.monitor(&system)?;
    let Prepared { plan, state, .. } = &prepared;
    let outcome = monitor.supervise(py, plan, |monitor| {
        let run = SensitivityRun::new(&system, &by, plan.method, plan.steps).with_options(plan.options);
        run.locating(location).observed_by(monitor).from(state)
    })?;
    let (found, status) = outcome_of(outcome, |found| found.run.status);
    let solution = Py::new(py, TreeSensitivities::of(py, &system, &found)?)?;
    plan.deliver(py, monitor.finish(py, status).failed, solution)
}
