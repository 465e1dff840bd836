//! Derivatives of a body's motion through contacts.

use crate::core::callable::Failure;
use crate::core::convert::{a_type, array, integer_or_none, interval_of, sequence, vector, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::event::Event;
use crate::integrators::forces::models::Reader;
use crate::integrators::methods;
use crate::integrators::monitor::Monitor;
use crate::integrators::plan::{Plan, StepArguments};
use crate::integrators::problem::stretched_as_given;
use crate::multibody::kinematics::write;
use numpy::PyArrayDyn;
use numpy::prelude::*;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::contacts::BodyInContact;
use somersault::contact::sensitivity::{
    self, Differentiation, Parameter, SensitivityRun, Undifferentiated, VariedState,
};
use somersault::contact::stretches::WithStretches;
use somersault::integrators::driver::Status;
use somersault::integrators::events::Location;
use somersault::integrators::methods::{Method, Options};
use somersault::integrators::nalgebra::{DMatrix, Vector3};

/// Derivatives of a run through contacts by its initial state and by parameters.
pub(crate) struct Derivatives {
    pub(crate) by_state: Py<PyArrayDyn<f64>>,
    pub(crate) by_parameters: Py<PyArrayDyn<f64>>,
    pub(crate) event_times: Py<PyArrayDyn<f64>>,
    pub(crate) stretches: Py<PyArrayDyn<f64>>,
}

/// As a file has them.
pub(crate) type PickledDerivatives<'py> = [Bound<'py, PyAny>; 4];

impl Derivatives {
    pub(crate) fn of(
        py: Python<'_>,
        [by_state, by_parameters, event_times]: [&DMatrix<f64>; 3],
        stretches: &[Vector3<f64>],
    ) -> PyResult<Self> {
        Ok(Self {
            by_state: matrix(py, by_state)?,
            by_parameters: matrix(py, by_parameters)?,
            event_times: matrix(py, event_times)?,
            stretches: matrix(py, &DMatrix::from_fn(stretches.len(), 3, |i, k| stretches[i][k]))?,
        })
    }

    pub(crate) fn pickled<'py>(&self, py: Python<'py>) -> PickledDerivatives<'py> {
        [&self.by_state, &self.by_parameters, &self.event_times, &self.stretches]
            .map(|array| array.bind(py).clone().into_any())
    }

    /// Those of a file, of a state with `n` entries.
    pub(crate) fn of_pickled(
        py: Python<'_>,
        n: usize,
        n_events: usize,
        [by_state, by_parameters, event_times, stretches]: PickledDerivatives<'_>,
    ) -> Result<Self, Error> {
        let read = |name: &str, value: &Bound<'_, PyAny>, rows: usize, columns: usize| {
            let values = with_shape(name, &[rows, columns], value)?;
            Ok::<_, Error>(array(py, values, &[rows, columns])?.unbind())
        };
        let columns = event_times.getattr("shape")?.get_item(1)?.extract::<usize>()?;
        let n_parameters = columns.saturating_sub(n);
        Ok(Self {
            by_state: read("by_state", &by_state, n, n)?,
            by_parameters: read("by_parameters", &by_parameters, n, n_parameters)?,
            event_times: read("event_times", &event_times, n_events, n + n_parameters)?,
            stretches: read("stretches", &stretches, stretches.len()?, 3)?,
        })
    }

    pub(crate) fn n_parameters(&self, py: Python<'_>) -> usize {
        self.by_parameters.bind(py).shape()[1]
    }
}

/// A motion through contacts and its derivative.
///
/// Rows of a derivative are position, m, orientation, rad (the small rotation δφ in the world frame,
/// R → exp(δφ̂) R), velocity, m/s, and angular velocity, rad/s, three components each.
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct Sensitivities {
    t: f64,
    state: State,
    events: Vec<Py<Event>>,
    derivatives: Derivatives,
}

value! {
    impl Sensitivities {
        /// float: Time reached, s.
        t: f64 = |own| own.t;
        /// State: State reached.
        state: State = |own| own.state;
        /// list of Event: What happened in contacts.
        events: Vec<Py<Event>> = |own, py| own.events.iter().map(|event| event.clone_ref(py)).collect();
        /// ndarray, shape (12, 12): Derivative of the state reached by the state at the start.
        by_state: Py<PyArrayDyn<f64>> = |own, py| own.derivatives.by_state.clone_ref(py);
        /// ndarray, shape (12, parameters): Derivative of the state reached by the parameters.
        by_parameters: Py<PyArrayDyn<f64>> = |own, py| own.derivatives.by_parameters.clone_ref(py);
        /// ndarray, shape (events, 12 + parameters): Derivative of the times of the events, s, laid out as `by_state`
        /// and `by_parameters` side by side: one row for each event. NaN at an event that changes nothing.
        event_times: Py<PyArrayDyn<f64>> = |own, py| own.derivatives.event_times.clone_ref(py);
        /// ndarray, shape (contacts, 3): Stretches of the contacts' friction in the state reached, m.
        stretches: Py<PyArrayDyn<f64>> = |own, py| own.derivatives.stretches.clone_ref(py);
    }
}

impl Sensitivities {
    fn of(py: Python<'_>, contacts: usize, found: &sensitivity::Sensitivities) -> PyResult<Self> {
        let sensitivity::Sensitivities { run, state, parameters, event_times, stretches } = found;
        let of_rows =
            |rows: usize, columns: usize, numbers: &[f64]| DMatrix::from_column_slice(rows, columns, numbers);
        let by_state = of_rows(12, 12, state.as_slice());
        let by_parameters = of_rows(12, parameters.ncols(), parameters.as_slice());
        let event = |event| Py::new(py, Event::of(py, contacts, event)?);
        Ok(Self {
            t: run.t,
            state: State(run.state),
            events: run.events.iter().map(event).collect::<PyResult<_>>()?,
            derivatives: Derivatives::of(py, [&by_state, &by_parameters, event_times], stretches)?,
        })
    }
}

#[pymethods]
impl Sensitivities {
    fn __repr__(&self, py: Python<'_>) -> String {
        let parameters = self.derivatives.n_parameters(py);
        format!("<Sensitivities at t = {}: {} events, {parameters} parameters>", self.t, self.events.len())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        by_restore(slf, (own.t, own.state, &own.events, own.derivatives.pickled(py)))
    }

    /// Pickled sensitivities.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        t: f64,
        state: State,
        events: Vec<Py<Event>>,
        derivatives: PickledDerivatives<'_>,
    ) -> Result<Self, Error> {
        let derivatives = Derivatives::of_pickled(cls.py(), 12, events.len(), derivatives)?;
        Ok(Self { t, state, events, derivatives })
    }
}

fn matrix(py: Python<'_>, matrix: &DMatrix<f64>) -> PyResult<Py<PyArrayDyn<f64>>> {
    let mut values = vec![0.0; matrix.len()];
    write(matrix, &mut values);
    Ok(array(py, values, &[matrix.nrows(), matrix.ncols()])?.unbind())
}

/// A constant of the equations: a name, or a name with a contact or a direction.
fn parameter(value: &Bound<'_, PyAny>) -> Result<Parameter, Error> {
    let parameter = if let Ok(name) = value.extract::<String>() {
        match name.as_str() {
            "mass" => Some(Parameter::Mass),
            "inertia_scale" => Some(Parameter::InertiaScale),
            _ => None,
        }
    } else if let Ok((name, of)) = value.extract::<(String, Bound<'_, PyAny>)>() {
        match (name.split_once('.'), of.extract::<usize>()) {
            (Some(("law", name)), Ok(contact)) => Some(Parameter::normal(contact, name.to_string())),
            (Some(("friction", name)), Ok(contact)) => Some(Parameter::friction(contact, name.to_string())),
            (None, _) if name == "acceleration" => {
                Some(Parameter::uniform_acceleration(vector("parameters", &of)?))
            }
            (Some(_) | None, _) => None,
        }
    } else {
        None
    };
    match parameter {
        Some(parameter) => Ok(parameter),
        None => Err(Error::input(format!(
            "`parameters` must hold 'mass', 'inertia_scale', ('law.NAME', contact), ('friction.NAME', contact) or ('acceleration', direction), found {}",
            value.repr()?
        ))),
    }
}

/// What to differentiate by: each entry of a sequence, as `parameter` reads it; nothing where none is given.
pub(crate) fn parameters<P>(
    value: Option<&Bound<'_, PyAny>>,
    parameter: impl Fn(&Bound<'_, PyAny>) -> Result<P, Error>,
) -> Result<Vec<P>, Error> {
    let Some(value) = value else { return Ok(Vec::new()) };
    let wrong = || Error::input(format!("`parameters` must be a sequence, found {}", a_type(value)));
    sequence(value).ok_or_else(wrong)?.try_iter()?.map(|entry| parameter(&entry?)).collect()
}

/// The result of a run that was differentiated, and how the run ended.
pub(crate) fn outcome_of<S>(
    outcome: Result<S, Box<Undifferentiated<S>>>,
    status: impl FnOnce(&S) -> Status,
) -> (S, Result<Status, Error>) {
    match outcome {
        Ok(found) => {
            let status = status(&found);
            (found, Ok(status))
        }
        Err(undifferentiated) => {
            let Undifferentiated { reason, so_far } = *undifferentiated;
            (so_far, Err(reason.into()))
        }
    }
}

/// Motion of one rigid body through contacts, and its derivative by the initial state and by parameters.
///
/// The variational equations are integrated beside the state, by the same method in the same steps, and jump
/// where contacts begin and end. User-defined surfaces are differentiated by differences of their gradients,
/// callable forces by differences. Capsules and boxes with friction have the limits that `differentiate_tree` names.
///
/// Parameters
/// ----------
/// body : RigidBody
///     The body.
/// state : State
///     State at the start, not on a surface.
/// interval : tuple of float
///     Start and end time, s.
/// dt : float, optional
///     Step, s. Where it is left out the steps are adapted to `rtol` and `atol` of the motion.
/// contacts : Contact or sequence of Contact
///     Where the body touches surfaces.
/// method : str or MethodInfo, optional
///     A method for any system, in the variables of the world or of the body; ``"rkmk"`` unless given, or
///     ``"rkmk8_b"`` where the steps are adapted.
/// rtol, atol : float, optional
///     Relative and absolute tolerance of an adaptive step, 1e-8 and 1e-10 unless given, as in
///     `somersault.integrate`. Errors of derivatives are not weighed.
/// max_step, first_step : float, optional
///     Largest and first step of an adaptive run, s.
/// max_steps : int, optional
///     Largest number of steps of an adaptive run, 10 million unless given.
/// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
///     Stretches of the contacts' friction at the start, as in `somersault.integrate`; they do not change with the
///     state at the start.
/// forces : force model, callable, or sequence of them, optional
///     What acts on the body besides, as in `somersault.integrate`.
/// parameters : sequence, optional
///     What to differentiate by: ``'mass'`` with the inertia kept, ``'inertia_scale'``, a factor on the inertia,
///     ``('law.stiffness', i)`` and the like, a constant of the law of contact i or of its friction, as the objects
///     have them: ``law.stiffness``, ``law.damping``, ``friction.coefficient``, in whose proportion a static one
///     changes, ``friction.stiffness``, ``friction.damping`` and ``friction.speed``; and ``('acceleration', direction)``,
///     the strength of a uniform acceleration, m/s².
/// grazing : float, optional
///     Size of the minimum gap up to which a surface is grazed, touched or missed, and there is no derivative: in
///     parts of the way ‖u‖ T + ½ |Δẍ| T² that the point of contact covers in the interval T. The square root of
///     the machine epsilon, 1.5e-8, is the default and the least.
/// max_event_rate : float, optional
///     Most events per second and contact, averaged over the last 64.
///
/// Returns
/// -------
/// Sensitivities
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
/// IntegrationError
///     If the run cannot continue. This one and the last have what was found before in the attribute `solution`.
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> top = contact.spinning_top()
/// >>> found = contact.differentiate(
/// ...     top.body, top.state, (0.0, 0.1), dt=1e-4, contacts=top.contacts, forces=top.forces,
/// ...     parameters=["mass", ("law.stiffness", 0)],
/// ... )
/// >>> found.by_state.shape, found.by_parameters.shape
/// ((12, 12), (12, 2))
#[pyfunction]
#[pyo3(signature = (
    body, state, interval, *, dt=None, contacts, method=None, forces=None, parameters=None, rtol=None, atol=None, max_step=None,
    first_step=None, max_steps=None, stretches=None, grazing=1.5e-8, max_event_rate=1e9
))]
pub(crate) fn differentiate(
    py: Python<'_>,
    body: RigidBody,
    state: State,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    dt: Option<f64>,
    contacts: &Bound<'_, PyAny>,
    method: Option<&Bound<'_, PyAny>>,
    forces: Option<&Bound<'_, PyAny>>,
    parameters: Option<&Bound<'_, PyAny>>,
    rtol: Option<f64>,
    atol: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
    #[pyo3(from_py_with = integer_or_none)] max_steps: Option<i64>,
    stretches: Option<&Bound<'_, PyAny>>,
    grazing: f64,
    max_event_rate: f64,
) -> Result<Py<Sensitivities>, Error> {
    let default = if dt.is_some() { Method::Rkmk } else { Method::Rkmk8B };
    let method = method.map_or(Ok(default), |m| methods::extract("method", m))?;
    let interval = (interval[0], interval[1]);
    let steps = StepArguments { dt, rtol, atol, max_step, first_step, max_steps }.steps(method, interval)?;
    let parameters = self::parameters(parameters, parameter)?;
    let failure = Failure::default();
    let mut reader = Reader { failure: failure.clone(), calls_python: false };
    let models = reader.sum("forces", &body.0, forces.unwrap_or(&py.None().into_bound(py)))?;
    let contacts = reader.contacts("contacts", contacts)?;
    let (count, options) = (contacts.len(), Options::default());
    let system = BodyInContact::new(body.0, (models, contacts));
    let location = Location { max_event_rate, ..Location::default() };
    let initial = stretched_as_given(&WithStretches(&system), stretches, interval.0, state.0)?;
    let by = Differentiation { parameters, grazing, stretches: initial.rate.variables.clone() };
    let plan = Plan {
        method,
        options,
        steps,
        backwards: false,
        every: u64::MAX,
        t_eval: None,
        dense: false,
        calls_python: reader.calls_python,
        return_interrupted: false,
    };
    let initial = VariedState::varied(initial, []);
    let mut monitor = Monitor::try_new(&plan, &initial, 0, None, None, failure)?;
    let outcome = monitor.supervise(py, &plan, |monitor| {
        let run = SensitivityRun::new(&system, &by, method, steps).with_options(options);
        run.locating(location).observed_by(monitor).from(&state.0)
    })?;
    let (found, status) = outcome_of(outcome, |found| found.run.status);
    let solution = Py::new(py, Sensitivities::of(py, count, &found)?)?;
    plan.deliver(py, monitor.finish(py, status).failed, solution)
}
