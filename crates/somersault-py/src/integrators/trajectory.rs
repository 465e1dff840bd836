//! What an integration leaves: states over time, and what is derived from them.

use crate::contact::touches::Touches;
use crate::core::callable::Failure;
use crate::core::convert::{a_type, any_vectors, array, components, quaternions, rotation, sequence, times};
use crate::core::error::Error;
use crate::core::memory::expect_room;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::in_turn;
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::event::{Event, Events};
use crate::integrators::forces::models::Reader;
use crate::integrators::seen::{Curves, Seen};
use crate::integrators::watching::{
    EventsByFunction, PickledCertificate, certified, pickled, unpickled, unproved,
};
use crate::multibody::model::Model;
use numpy::PyArray1;
use pyo3::exceptions::{PyIndexError, PyTypeError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple, PyType};
use somersault::contact::bodies::BodiesInContact;
use somersault::contact::contacts::BodyInContact;
use somersault::contact::stretches::WithStretches;
use somersault::integrators::body::{self, PrincipalBody};
use somersault::integrators::counted::Counted;
use somersault::integrators::events::Certificate;
use somersault::integrators::force::BoxedForce;
use somersault::integrators::nalgebra::Vector3;
use somersault::integrators::solution;
use somersault::integrators::state::{self, RigidBodyState};
use std::ops::Deref;
use std::sync::{Arc, OnceLock};

/// Bodies. Those whose axes are the principal ones are made of their masses and moments when they are first needed.
#[derive(Clone)]
pub(crate) enum Bodies {
    Each(Vec<body::RigidBody>),
    Principal(Vec<PrincipalBody>, OnceLock<Vec<body::RigidBody>>),
}

impl Bodies {
    /// Errors: the first of which mass or moments are not those of a body.
    pub(crate) fn principal(masses: &[f64], moments: &[Vector3<f64>]) -> Result<Self, Error> {
        let body = |(at, (mass, moments)): (usize, (&f64, &Vector3<f64>))| {
            let body = PrincipalBody::try_new(*mass, *moments);
            body.map_err(|error| Error::input(format!("body {at}: {error}")))
        };
        let bodies = masses.iter().zip(moments).enumerate().map(body).collect::<Result<_, _>>()?;
        Ok(Self::Principal(bodies, OnceLock::new()))
    }

    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Each(bodies) => bodies.len(),
            Self::Principal(bodies, _) => bodies.len(),
        }
    }
}

impl Deref for Bodies {
    type Target = [body::RigidBody];

    fn deref(&self) -> &[body::RigidBody] {
        match self {
            Self::Each(bodies) => bodies,
            Self::Principal(bodies, made) => {
                made.get_or_init(|| bodies.iter().map(|body| (*body).into()).collect())
            }
        }
    }
}

/// One body or several. Where there is one, arrays have no axis for bodies.
#[derive(Clone)]
pub(crate) struct Cast {
    pub(crate) bodies: Bodies,
    pub(crate) single: bool,
}

impl Cast {
    /// A body, or a sequence of them.
    pub(crate) fn extract(argument: &str, value: &Bound<'_, PyAny>) -> Result<Self, Error> {
        if let Ok(RigidBody(body)) = value.extract() {
            return Ok(Self { bodies: Bodies::Each(vec![body]), single: true });
        }
        let wrong = |found: &Bound<'_, PyAny>| {
            let tree = if found.is_instance_of::<Model>() {
                "; a tree is integrated by `multibody.integrate_tree`"
            } else {
                ""
            };
            let found = a_type(found);
            Error::input(format!(
                "`{argument}` must be a RigidBody or a sequence of them, found {found}{tree}"
            ))
        };
        let list = sequence(value).ok_or_else(|| wrong(value))?;
        let mut bodies = Vec::new();
        for entry in list.try_iter()? {
            let entry = entry?;
            bodies.push(entry.extract::<RigidBody>().map_err(|_| wrong(&entry))?.0);
        }
        if bodies.is_empty() {
            return Err(Error::input(format!("`{argument}` must hold at least one body")));
        }
        Ok(Self { bodies: Bodies::Each(bodies), single: false })
    }

    /// One state for each body.
    pub(crate) fn states(
        &self,
        argument: &str,
        value: &Bound<'_, PyAny>,
    ) -> Result<Vec<RigidBodyState>, Error> {
        if self.single {
            let wrong = |_| Error::input(format!("`{argument}` must be a State, found {}", a_type(value)));
            return Ok(vec![value.extract::<State>().map_err(wrong)?.0]);
        }
        let wrong = |found: String| {
            let n = self.bodies.len();
            Error::input(format!(
                "`{argument}` must be a sequence of {n} states, one for each body, found {found}"
            ))
        };
        let list = sequence(value).ok_or_else(|| wrong(a_type(value)))?;
        let mut states = Vec::new();
        for entry in list.try_iter()? {
            let entry = entry?;
            states.push(entry.extract::<State>().map_err(|_| wrong(format!("{} in it", a_type(&entry))))?.0);
        }
        if states.len() != self.bodies.len() {
            return Err(wrong(format!("{} states", states.len())));
        }
        Ok(states)
    }

    /// The body, or the list of bodies.
    fn to_python<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        if self.single {
            Ok(Bound::new(py, RigidBody(self.bodies[0]))?.into_any())
        } else {
            Ok(PyList::new(py, self.bodies.iter().map(|b| RigidBody(*b)))?.into_any())
        }
    }
}

/// What is made for Python when it is first requested.
#[derive(Clone, Copy)]
enum Made {
    T,
    Position,
    Orientation,
    Quaternion,
    Velocity,
    AngularVelocity,
    AngularVelocityBody,
    AngularMomentum,
    KineticEnergy,
    RotationalEnergy,
}

/// The number of kinds of it.
const MADE: usize = Made::RotationalEnergy as usize + 1;

/// States of one body or of several over time.
///
/// The first axis of every array is time. With several bodies the second counts them; with one there
/// is no such axis. Everything is in the world frame but for names that end in ``_body``. Indexing
/// with a number gives the `State` at that index, or a list of them.
///
/// Parameters
/// ----------
/// body : RigidBody or sequence of RigidBody
///     The body, or the bodies.
/// t : array_like, shape (n,)
///     Times, s.
/// position : array_like, shape (n, 3) or (n, bodies, 3)
///     Positions of the centre of mass, m.
/// quaternion : array_like, shape (n, 4) or (n, bodies, 4)
///     Orientations as quaternions (x, y, z, w).
/// velocity : array_like, shape (n, 3) or (n, bodies, 3)
///     Velocities of the centre of mass, m/s.
/// angular_velocity : array_like, shape (n, 3) or (n, bodies, 3)
///     Angular velocities in the world frame, rad/s.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> import somersault
/// >>> t = np.linspace(0.0, 1.0, 3)
/// >>> zero, still = np.zeros((3, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))
/// >>> body = somersault.RigidBody.sphere(2.0, 0.1)
/// >>> motion = somersault.Trajectory(body, t, zero, still, zero + [1.0, 2.0, 0.0], zero)
/// >>> motion.kinetic_energy
/// array([5., 5., 5.])
#[pyclass(frozen, subclass, module = "somersault")]
pub(crate) struct Trajectory {
    cast: Cast,
    times: Vec<f64>,
    /// The states of all bodies at the first time, then at the second, …
    states: Vec<RigidBodyState>,
    made: [PyOnceLock<Py<PyAny>>; MADE],
}

impl Trajectory {
    pub(crate) fn new(cast: Cast, times: Vec<f64>, states: Vec<RigidBodyState>) -> Self {
        Self { cast, times, states, made: std::array::from_fn(|_| PyOnceLock::new()) }
    }

    /// The array of `N` numbers for each body at each time.
    fn array<'py, const N: usize>(
        &self,
        py: Python<'py>,
        what: Made,
        values: impl Fn(&body::RigidBody, &RigidBodyState) -> [f64; N],
    ) -> PyResult<Bound<'py, PyAny>> {
        let of_all = || self.cast.bodies.iter().cycle().zip(&self.states).map(|(body, x)| values(body, x));
        self.rows(py, what, || of_all().collect())
    }

    /// The same of what depends on states alone.
    fn array_of_states<'py, const N: usize>(
        &self,
        py: Python<'py>,
        what: Made,
        values: impl Fn(&RigidBodyState) -> [f64; N],
    ) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, what, || self.states.iter().map(values).collect())
    }

    /// The array of these rows, which are made when it is first requested.
    fn rows<'py, const N: usize>(
        &self,
        py: Python<'py>,
        what: Made,
        rows: impl FnOnce() -> Vec<[f64; N]>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let made = self.made[what as usize].get_or_try_init(py, || {
            let mut shape = vec![self.times.len()];
            if !self.cast.single {
                shape.push(self.cast.bodies.len());
            }
            if N > 1 {
                shape.push(N);
            }
            Ok::<_, PyErr>(array(py, rows().into_flattened(), &shape)?.into_any().unbind())
        })?;
        Ok(made.bind(py).clone())
    }

    pub(crate) fn state<'py>(&self, py: Python<'py>, i: usize) -> PyResult<Bound<'py, PyAny>> {
        let n = self.cast.bodies.len();
        let states = &self.states[i * n..(i + 1) * n];
        if self.cast.single {
            Ok(Bound::new(py, State(states[0]))?.into_any())
        } else {
            Ok(PyList::new(py, states.iter().map(|x| State(*x)))?.into_any())
        }
    }

    /// What the constructor takes.
    fn arguments<'py>(&self, py: Python<'py>) -> PyResult<[Bound<'py, PyAny>; 6]> {
        Ok([
            self.cast.to_python(py)?,
            self.t(py),
            self.position(py)?,
            self.quaternion(py)?,
            self.velocity(py)?,
            self.angular_velocity(py)?,
        ])
    }
}

value! {
    impl Trajectory {
        /// RigidBody or list of RigidBody: What moves.
        body: PyResult<Bound<'py, PyAny>> = |own, py| own.cast.to_python(py);
        /// ndarray, shape (n, 3) or (n, bodies, 3): Positions of the centre of mass, m.
        position: PyResult<Bound<'py, PyAny>> =
            |own, py| own.array_of_states(py, Made::Position, |x| (*x.position()).into());
        /// ndarray, shape (n, 4) or (n, bodies, 4): Orientations as unit quaternions (x, y, z, w).
        quaternion: PyResult<Bound<'py, PyAny>> =
            |own, py| own.array_of_states(py, Made::Quaternion, |x| components(x.orientation()));
        /// ndarray, shape (n, 3) or (n, bodies, 3): Velocities of the centre of mass, m/s.
        velocity: PyResult<Bound<'py, PyAny>> =
            |own, py| own.array_of_states(py, Made::Velocity, |x| (*x.velocity()).into());
        /// ndarray, shape (n, 3) or (n, bodies, 3): Angular velocities in the world frame, rad/s.
        angular_velocity: PyResult<Bound<'py, PyAny>> =
            |own, py| own.array_of_states(py, Made::AngularVelocity, |x| (*x.angular_velocity()).into());
        /// ndarray, shape (n, 3) or (n, bodies, 3): Angular momenta about the centre of mass, kg m²/s.
        angular_momentum: PyResult<Bound<'py, PyAny>> =
            |own, py| own.array(py, Made::AngularMomentum, |body, x| body.angular_momentum(x).into());
        /// ndarray, shape (n,) or (n, bodies): Kinetic energies of translation and rotation, J.
        kinetic_energy: PyResult<Bound<'py, PyAny>> =
            |own, py| own.array(py, Made::KineticEnergy, |body, x| [body.kinetic_energy(x)]);
        /// ndarray, shape (n,) or (n, bodies): Kinetic energies of the rotation, J.
        rotational_energy: PyResult<Bound<'py, PyAny>> =
            |own, py| own.array(py, Made::RotationalEnergy, |body, x| [body.rotational_energy(x)]);
    }
}

#[pymethods]
impl Trajectory {
    #[new]
    fn from_arrays(
        body: &Bound<'_, PyAny>,
        t: &Bound<'_, PyAny>,
        position: &Bound<'_, PyAny>,
        quaternion: &Bound<'_, PyAny>,
        velocity: &Bound<'_, PyAny>,
        angular_velocity: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let cast = Cast::extract("body", body)?;
        let (_, times) = times("t", t)?;
        let axes = if cast.single { vec![times.len()] } else { vec![times.len(), cast.bodies.len()] };
        let positions = any_vectors("position", &axes, position)?;
        let orientations = quaternions("quaternion", &axes, quaternion)?;
        let velocities = any_vectors("velocity", &axes, velocity)?;
        let angular_velocities = any_vectors("angular_velocity", &axes, angular_velocity)?;
        let states = (0..positions.len())
            .map(|i| RigidBodyState::new(positions[i], orientations[i], velocities[i], angular_velocities[i]))
            .collect();
        Ok(Self::new(cast, times, states))
    }

    /// ndarray, shape (n,): Times, s.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let made = self.made[Made::T as usize]
            .get_or_init(py, || PyArray1::from_slice(py, &self.times).into_any().unbind());
        made.bind(py).clone()
    }

    /// scipy.spatial.transform.Rotation: Rotations from the body frame to the world frame.
    ///
    /// A stack of n for one body. For several, of shape (n, bodies), which SciPy has from 1.17 on.
    #[getter]
    fn orientation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let made = self.made[Made::Orientation as usize]
            .get_or_try_init(py, || Ok::<_, PyErr>(rotation(&self.quaternion(py)?)?.unbind()))?;
        Ok(made.bind(py).clone())
    }

    /// ndarray, shape (n, 3) or (n, bodies, 3): Angular velocities in the body frame, rad/s.
    #[getter]
    fn angular_velocity_body<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array_of_states(py, Made::AngularVelocityBody, |x| {
            x.orientation().inverse_transform_vector(x.angular_velocity()).into()
        })
    }

    fn __len__(&self) -> usize {
        self.times.len()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: isize) -> PyResult<Bound<'py, PyAny>> {
        let from_start = if index < 0 { index + self.times.len() as isize } else { index };
        match usize::try_from(from_start) {
            Ok(i) if i < self.times.len() => self.state(py, i),
            _ => {
                let n = self.times.len();
                Err(PyIndexError::new_err(format!("there are states at {n} times, found index {index}")))
            }
        }
    }

    fn __repr__(&self) -> String {
        let span = match self.times[..] {
            [] => String::new(),
            [t] => format!(" at t = {t}"),
            [first, .., last] => format!(" from t = {first} to {last}"),
        };
        let bodies =
            if self.cast.single { String::new() } else { format!(", {} bodies", self.cast.bodies.len()) };
        format!("<Trajectory: {} states{span}{bodies}>", self.times.len())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyType>, Bound<'py, PyTuple>)> {
        let py = slf.py();
        Ok((py.get_type::<Self>(), PyTuple::new(py, slf.get().arguments(py)?)?))
    }
}

/// The state at any time of an integration.
///
/// Called with a number it gives the `State`, or a list of them for several bodies; called with an
/// array of times, a `Trajectory`. Its curves are not written to files or pickles; a `Trajectory` is.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> body, fall = somersault.RigidBody.sphere(1.0, 0.1), somersault.forces.Gravity()
/// >>> motion = somersault.integrate(body, somersault.State(), (0.0, 1.0), dt=0.1, forces=fall, dense_output=True)
/// >>> motion.sol(0.25).position.round(3)
/// array([ 0.   ,  0.   , -0.307])
#[pyclass(frozen, module = "somersault")]
pub(crate) struct DenseOutput {
    pub(crate) cast: Cast,
    pub(crate) curves: Arc<Curves>,
}

impl DenseOutput {
    /// The least and the greatest time.
    fn span(&self) -> (f64, f64) {
        let (first, last) = match &*self.curves {
            Curves::One(s) => s.span(),
            Curves::Several(s) => s.span(),
        }
        .unwrap_or((f64::NAN, f64::NAN));
        (first.min(last), first.max(last))
    }
}

#[pymethods]
impl DenseOutput {
    /// float: The least time; of a run backwards that of its end, as in SciPy.
    #[getter]
    fn t_min(&self) -> f64 {
        self.span().0
    }

    /// float: The greatest time; of a run backwards that of its start.
    #[getter]
    fn t_max(&self) -> f64 {
        self.span().1
    }

    #[pyo3(signature = (t, /))]
    fn __call__<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let (scalar, times) = times("t", t)?;
        let count = times.len().saturating_mul(self.cast.bodies.len());
        expect_room("the states at `t`", count.saturating_mul(size_of::<RigidBodyState>()))?;
        let mut states = Vec::with_capacity(count);
        in_turn(py, &times, |t| {
            let found = match &*self.curves {
                Curves::One(s) => s.at(*t).map(|x| states.push(x)),
                Curves::Several(s) => {
                    s.at(*t).map(|x| states.extend((0..x.configuration.len()).filter_map(|i| x.body(i))))
                }
            };
            found.ok_or_else(|| {
                Error::input(format!(
                    "`t` must be within the times integrated, {} to {}, found {t}",
                    self.t_min(),
                    self.t_max()
                ))
            })
        })?;
        let trajectory = Trajectory::new(self.cast.clone(), times, states);
        if scalar { Ok(trajectory.state(py, 0)?) } else { Ok(Bound::new(py, trajectory)?.into_any()) }
    }

    fn __repr__(&self) -> String {
        format!("<DenseOutput from t = {} to {}>", self.t_min(), self.t_max())
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "the curves of a DenseOutput cannot be written or pickled: take the Trajectory that it gives at the times needed",
        ))
    }
}

/// How a run ended and what it took.
#[derive(Clone)]
pub(crate) struct Report {
    pub(crate) status: i32,
    pub(crate) message: String,
    pub(crate) nfev: u64,
    pub(crate) n_steps: u64,
    pub(crate) n_rejected: u64,
}

/// The events of a run as Python sees them.
struct Log {
    events: Py<PyTuple>,
    count: u64,
    trials: u64,
    substeps: u64,
    /// Contacts that were located.
    contacts: usize,
    /// Their stretches at the first time, then at the second, …
    stretches: Vec<Vector3<f64>>,
}

impl Log {
    /// The stretches at time `k`.
    fn stretches_at(&self, k: usize) -> Vec<Vector3<f64>> {
        self.stretches[k * self.contacts..(k + 1) * self.contacts].to_vec()
    }
}

/// The events of functions that a run was given.
struct FunctionEvents {
    /// An array of times for each.
    times: Py<PyTuple>,
    /// A trajectory for each, of its states.
    states: Py<PyTuple>,
    certificates: Vec<Certificate>,
}

impl FunctionEvents {
    fn of<Q: Seen>(py: Python<'_>, cast: &Cast, found: EventsByFunction<Q>) -> PyResult<Self> {
        let EventsByFunction { each, certificates } = found;
        let split = |(times, states): (_, Vec<_>)| (times, states.iter().flat_map(Q::split).collect());
        let (times, states) = event_arrays(py, cast, each.into_iter().map(split))?;
        Ok(Self { times, states, certificates })
    }
}

/// The times and the trajectories of the events of each function.
pub(crate) type EventArrays = (Py<PyTuple>, Py<PyTuple>);

/// The same, from times and states of all bodies at the first, the second, …
pub(crate) fn event_arrays(
    py: Python<'_>,
    cast: &Cast,
    each: impl Iterator<Item = (Vec<f64>, Vec<RigidBodyState>)>,
) -> PyResult<EventArrays> {
    let (mut all_times, mut all_states) = (Vec::new(), Vec::new());
    for (times, states) in each {
        all_times.push(PyArray1::from_slice(py, &times));
        all_states.push(Py::new(py, Trajectory::new(cast.clone(), times, states))?);
    }
    Ok((PyTuple::new(py, all_times)?.unbind(), PyTuple::new(py, all_states)?.unbind()))
}

/// The contacts that a run was given.
pub(crate) struct Given {
    /// Those of the one body, or a tuple of them for each of several.
    contacts: Py<PyTuple>,
    pairs: Py<PyTuple>,
}

impl Given {
    /// Of the arguments of a run, whatever they are.
    pub(crate) fn of(
        py: Python<'_>,
        single: bool,
        contacts: Option<&Bound<'_, PyAny>>,
        pairs: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let contacts = match contacts.and_then(sequence).filter(|_| !single) {
            Some(list) => {
                let each = list.try_iter()?.map(|of_body| listed(py, Some(&of_body?)));
                PyTuple::new(py, each.collect::<PyResult<Vec<_>>>()?)?
            }
            None => listed(py, contacts)?,
        };
        Ok(Self { contacts: contacts.unbind(), pairs: listed(py, pairs)?.unbind() })
    }

    /// What of it is written: nothing where a surface is a callable.
    fn written<'py>(&self, py: Python<'py>) -> PyResult<Option<(Bound<'py, PyTuple>, Bound<'py, PyTuple>)>> {
        let contacts = self.contacts.bind(py);
        for entry in contacts {
            let of_body = listed(py, Some(&entry))?;
            for contact in &of_body {
                if contact.getattr("surface")?.is_callable() {
                    return Ok(None);
                }
            }
        }
        Ok(Some((contacts.clone(), self.pairs.bind(py).clone())))
    }
}

/// One object, several or none as a tuple.
fn listed<'py>(py: Python<'py>, value: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyTuple>> {
    match value {
        None => Ok(PyTuple::empty(py)),
        Some(value) if value.is_none() => Ok(PyTuple::empty(py)),
        Some(value) => match sequence(value) {
            Some(list) => PyTuple::new(py, list.try_iter()?.collect::<PyResult<Vec<_>>>()?),
            None => PyTuple::new(py, [value]),
        },
    }
}

/// Result of an integration: a `Trajectory`, its status and what it cost.
#[pyclass(frozen, extends = Trajectory, module = "somersault")]
pub(crate) struct Solution {
    report: Report,
    log: Log,
    /// None without `events`.
    watched: Option<FunctionEvents>,
    /// None where it was read from a file that does not have them.
    given: Option<Given>,
    dense: Option<Py<DenseOutput>>,
    /// The states of contacts, computed on first access.
    touches: PyOnceLock<Option<Touches>>,
}

impl Solution {
    /// What a run leaves, as a Python object.
    pub(crate) fn create<Q: Seen>(
        py: Python<'_>,
        cast: Cast,
        recorded: solution::Solution<Q>,
        curves: Option<solution::Solution<Q>>,
        watched: Option<EventsByFunction<Q>>,
        report: Report,
        events: Events<Q>,
        given: Given,
    ) -> PyResult<Py<Self>> {
        let Events { trials, substeps, count, contacts, events } = events;
        let events =
            events.iter().map(|event| Event::of(py, contacts, event)).collect::<PyResult<Vec<_>>>()?;
        let stretches = recorded.states.iter().flat_map(Q::stretches).copied().collect();
        let events = PyTuple::new(py, events)?.unbind();
        let log = Log { events, count, trials, substeps, contacts, stretches };
        let states = recorded.states.iter().flat_map(Q::split).collect();
        let dense = curves.map(|curves| {
            let curves = Arc::new(Q::curves(curves));
            Py::new(py, DenseOutput { cast: cast.clone(), curves })
        });
        let dense = dense.transpose()?;
        let watched = watched.map(|each| FunctionEvents::of(py, &cast, each)).transpose()?;
        let trajectory = Trajectory::new(cast, recorded.times, states);
        let own = Self { report, log, watched, given: Some(given), dense, touches: PyOnceLock::new() };
        Py::new(py, PyClassInitializer::from(trajectory).add_subclass(own))
    }

    /// An array of what contacts did.
    fn of_touches(
        slf: &Bound<'_, Self>,
        of: impl Fn(&Touches) -> &Py<PyAny>,
    ) -> Result<Option<Py<PyAny>>, Error> {
        let (py, own) = (slf.py(), slf.get());
        let found = own.touches.get_or_try_init(py, || own.find_touches(py, slf.as_super().get()))?;
        Ok(found.as_ref().map(|found| of(found).clone_ref(py)))
    }

    /// The states of contacts at all times, by the laws that the run was given.
    fn find_touches(&self, py: Python<'_>, base: &Trajectory) -> Result<Option<Touches>, Error> {
        let Some(given) = self.given.as_ref().filter(|_| self.log.contacts > 0) else { return Ok(None) };
        let failure = Failure::default();
        let mut reader = Reader { failure: failure.clone(), calls_python: false };
        let (contacts, pairs) = (given.contacts.bind(py), given.pairs.bind(py));
        let Cast { bodies, single } = &base.cast;
        let found = if *single {
            let contacts = reader.contacts("contacts", contacts)?;
            let none: Counted<Vec<BoxedForce>> = Counted::new(Vec::new());
            let system = WithStretches(BodyInContact::new(bodies[0], (none, contacts)));
            let rows = base.states.iter().enumerate().map(|(k, x)| {
                let x = state::State::augmented(*x, self.log.stretches_at(k));
                (system.touches(&x), system.energy(&x))
            });
            Touches::of(py, self.log.contacts, rows)?
        } else {
            let n = bodies.len();
            let contacts = (contacts.len() > 0).then_some(contacts);
            let contacts = reader.body_contacts(n, contacts.map(|given| given.as_any()), Some(pairs))?;
            let none = (0..n).map(|_| Counted::<Vec<BoxedForce>>::new(Vec::new())).collect();
            let system = WithStretches(BodiesInContact::try_new(bodies.to_vec(), none, contacts)?);
            let rows = base.states.chunks(n).enumerate().map(|(k, each)| {
                let x = state::State::augmented(state::State::from_bodies(each), self.log.stretches_at(k));
                (system.touches(&x), system.energy(&x))
            });
            Touches::of(py, self.log.contacts, rows)?
        };
        match failure.get() {
            Some(error) => Err(error.clone_ref(py).into()),
            None => Ok(Some(found)),
        }
    }
}

value! {
    impl Solution {
        /// int: 0 if the end of the interval was reached, 1 if a terminal event ended the run or the observer stopped it, -1 if
        /// it was interrupted, -2 if it failed.
        status: i32 = |own| own.report.status;
        /// str: The same in words.
        message: &str = |own| &own.report.message;
        /// bool: Whether the run ended as asked, by its interval, a terminal event or its observer.
        success: bool = |own| own.report.status >= 0;
        /// int: How often the equations of motion were evaluated, for all bodies at once.
        ///
        /// Under forces a count: start-up, rejected steps, iterations and dense output are in it. For one body
        /// without forces the nominal number, steps tried times evaluations of the method.
        nfev: u64 = |own| own.report.nfev;
        /// int: Steps made.
        n_steps: u64 = |own| own.report.n_steps;
        /// int: Steps tried and rejected by the step size control.
        n_rejected: u64 = |own| own.report.n_rejected;
        /// tuple of ndarray, or None: The times of the events of each function in `events=`, s. None without `events`.
        t_events: Option<Py<PyTuple>> = |own, py| own.watched.as_ref().map(|found| found.times.clone_ref(py));
        /// tuple of Trajectory, or None: The states at these times, for each function.
        y_events: Option<Py<PyTuple>> = |own, py| own.watched.as_ref().map(|found| found.states.clone_ref(py));
        /// tuple of bool, or None: For each of these functions, whether no event can have been missed, by its attribute ``lipschitz``; False
        /// where that is not given, or did not suffice. None without `events`.
        certified: PyResult<Option<Bound<'py, PyTuple>>> =
            |own, py| own.watched.as_ref().map(|found| certified(py, &found.certificates)).transpose();
        /// tuple, or None: For each of these functions start and end of the first step in which its bound did not suffice, s, or None.
        unproved: PyResult<Option<Bound<'py, PyTuple>>> =
            |own, py| own.watched.as_ref().map(|found| unproved(py, &found.certificates)).transpose();
        /// tuple of Event: What happened in contacts, in the order of time, where events were located and kept.
        events: Py<PyTuple> = |own, py| own.log.events.clone_ref(py);
        /// int: Number of events located, kept or not.
        n_events: u64 = |own| own.log.count;
        /// int: Steps tried to locate events and to prove steps clear of them, in addition to those made.
        n_trials: u64 = |own| own.log.trials;
        /// int: How many of the steps were parts of longer ones, divided for the contacts closed.
        n_substeps: u64 = |own| own.log.substeps;
        /// tuple of Contact, tuple of tuple of Contact, or None: The contacts of the body, for several bodies those of each. None where
        /// the solution was read from a file or a pickle and a surface is a callable, which these do not hold.
        contacts: Option<Py<PyTuple>> =
            |own, py| own.given.as_ref().map(|given| given.contacts.clone_ref(py));
        /// tuple of SpherePair, or None: The pairs of spheres that touch each other, in the same way.
        pairs: Option<Py<PyTuple>> = |own, py| own.given.as_ref().map(|given| given.pairs.clone_ref(py));
        /// DenseOutput or None: The state at any time, where dense output was requested.
        sol: Option<Py<DenseOutput>> = |own, py| own.dense.as_ref().map(|dense| dense.clone_ref(py));
    }
}

#[pymethods]
impl Solution {
    /// ndarray, shape (n, contacts, 3), or None: Stretches of friction, m, world frame: contacts with surfaces first, then pairs; zero for a
    /// contact whose friction has none. None unless contacts were located. A run that continues takes the last row as `stretches`.
    #[getter]
    fn stretches<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Log { contacts, stretches, .. } = &slf.get().log;
        if *contacts == 0 {
            return Ok(None);
        }
        let values: Vec<f64> = stretches.iter().flatten().copied().collect();
        Ok(Some(array(slf.py(), values, &[stretches.len() / contacts, *contacts, 3])?.into_any()))
    }

    /// ndarray, shape (n, contacts, 3), or None: Forces of contacts on the bodies, for a pair on the first body, world frame, N. They are
    /// computed from the states on first access. None if no contacts were located, or if `contacts` is None.
    #[getter]
    fn contact_forces(slf: &Bound<'_, Self>) -> Result<Option<Py<PyAny>>, Error> {
        Self::of_touches(slf, |found| &found.forces)
    }

    /// ndarray, shape (n, contacts, 3), or None: Points of contact, world frame, m.
    #[getter]
    fn contact_points(slf: &Bound<'_, Self>) -> Result<Option<Py<PyAny>>, Error> {
        Self::of_touches(slf, |found| &found.points)
    }

    /// ndarray, shape (n, contacts), or None: Gaps, m, negative inside the surface.
    #[getter]
    fn gaps(slf: &Bound<'_, Self>) -> Result<Option<Py<PyAny>>, Error> {
        Self::of_touches(slf, |found| &found.gaps)
    }

    /// ndarray, shape (n,), or None: Energy of the springs of contacts and friction, J.
    #[getter]
    fn elastic_energy(slf: &Bound<'_, Self>) -> Result<Option<Py<PyAny>>, Error> {
        Self::of_touches(slf, |found| &found.elastic_energy)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        let own = slf.get();
        let base = slf.as_super().get().__repr__();
        let base = base.trim_start_matches("<Trajectory: ").trim_end_matches('>');
        format!("<Solution: {base}; {} ({} steps)>", own.report.message, own.report.n_steps)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let py = slf.py();
        let Report { status, message, nfev, n_steps, n_rejected } = slf.get().report.clone();
        let base = PyTuple::new(py, slf.as_super().get().arguments(py)?)?;
        let Log { events, count, trials, substeps, contacts, stretches } = &slf.get().log;
        let stretches: Vec<[f64; 3]> = stretches.iter().map(|&stretch| stretch.into()).collect();
        let log = (events, *count, *trials, *substeps, *contacts, stretches);
        let given = slf.get().given.as_ref().map(|given| given.written(py)).transpose()?.flatten();
        let watched = slf.get().watched.as_ref();
        let watched = watched.map(|found| {
            let certificates: Vec<_> =
                found.certificates.iter().map(|certificate| pickled(*certificate)).collect();
            (found.times.clone_ref(py), found.states.clone_ref(py), certificates)
        });
        by_restore(slf, (base, (status, message, nfev, n_steps, n_rejected), log, given, watched))
    }

    /// A pickled solution; the dense output is not part of it.
    #[classmethod]
    #[pyo3(signature = (arrays, report, log, given, watched=None))]
    fn _restore(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        arrays: [Bound<'_, PyAny>; 6],
        report: (i32, String, u64, u64, u64),
        log: (Py<PyTuple>, u64, u64, u64, usize, Vec<[f64; 3]>),
        given: Option<(Py<PyTuple>, Py<PyTuple>)>,
        watched: Option<(Py<PyTuple>, Py<PyTuple>, Vec<PickledCertificate>)>,
    ) -> Result<Py<Self>, Error> {
        let [body, t, position, quaternion, velocity, angular_velocity] = &arrays;
        let base = Trajectory::from_arrays(body, t, position, quaternion, velocity, angular_velocity)?;
        let (status, message, nfev, n_steps, n_rejected) = report;
        let report = Report { status, message, nfev, n_steps, n_rejected };
        let (events, count, trials, substeps, contacts, stretches) = log;
        if stretches.len() != contacts * base.times.len() {
            let (n, found) = (contacts * base.times.len(), stretches.len());
            return Err(Error::input(format!("`log` must have {n} stretches, found {found}")));
        }
        let stretches = stretches.into_iter().map(Vector3::from).collect();
        let log = Log { events, count, trials, substeps, contacts, stretches };
        let given = given.map(|(contacts, pairs)| Given { contacts, pairs });
        let watched = watched.map(|(times, states, certificates)| {
            let certificates = certificates.into_iter().map(unpickled).collect();
            FunctionEvents { times, states, certificates }
        });
        let own = Self { report, log, watched, given, dense: None, touches: PyOnceLock::new() };
        Ok(Py::new(py, PyClassInitializer::from(base).add_subclass(own))?)
    }
}
