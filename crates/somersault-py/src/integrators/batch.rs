//! Many bodies at once.

use crate::core::callable::Failure;
use crate::core::convert::{
    a_type, any_vectors, check_finite, integer_or_none, interval_of, numbers_or_one, quaternions,
    real_numbers, sequence, vector_or,
};
use crate::core::error::Error;
use crate::core::memory::expect_room;
use crate::core::waiting::cancel_on_signal;
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::forces::models::{Acting, Reader, Shared};
use crate::integrators::methods;
use crate::integrators::plan::StepArguments;
use crate::integrators::trajectory::{Bodies, Cast, Trajectory};
use pyo3::prelude::*;
use somersault::core::cancel::CancellationToken;
use somersault::integrators::batch::{AdaptedRuns, BatchError, ForcedRuns, Forces, FreeRuns, Runs};
use somersault::integrators::body::{self, PrincipalFrame};
use somersault::integrators::counted::Counted;
use somersault::integrators::driver::{Adaptive, IntegrateError, Steps, TimeGrid, check_interval};
use somersault::integrators::force::{BoxedForce, ForceModel, Gravity};
use somersault::integrators::methods::Method;
use somersault::integrators::nalgebra::Vector3;
use somersault::integrators::series::WrenchTerm;
use somersault::integrators::solution::check_times;
use somersault::integrators::state::{Pose, RigidBodyState};
use somersault::integrators::system::{RigidBodySystem, RigidSystem};
use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

/// Motion of many rigid bodies that do not interact, in parallel.
///
/// With fixed steps of ``"rkmk_b"`` and adapted ones of ``"rkmk8_b"``, which are those where `method` is left out, bodies move several at a time
/// in the vector registers of each core, unless Python computes a force of theirs. Quickest are `Gravity`, `CentralGravity`, `Force`,
/// `Torque`, `Drag`, `Spring`, and `MagneticDipole` in a uniform field; a traced force, or one that depends on time, is evaluated for several
/// bodies at once where they are given the same object. The result does not depend, to the last bit, on the number of threads or which bodies
/// go together, nor on the processor, except by sines, cosines, exponentials and logarithms of traced forces. With fixed steps the centre of
/// mass of bodies without `forces` moves exactly. All others move one at a time on each core, as `integrate` moves them alone.
///
/// Parameters
/// ----------
/// bodies : RigidBody or sequence of RigidBody
///     The bodies; a single one stands for all.
/// states : sequence of State
///     Their states at the start.
/// interval : tuple of float
///     Start and end time, s.
/// dt : float or array_like, shape (bodies,), optional
///     Step, s, of all bodies or of each. Where it is left out the steps of each body are adapted to `rtol` and `atol`.
/// method : str or MethodInfo, optional
///     A method of the table that `somersault.methods` returns; ``"rkmk_b"`` unless given, or ``"rkmk8_b"`` where the steps are
///     adapted.
/// forces : force model, callable, or sequence of them, optional
///     What acts on the bodies: a single model acts on every body, a sequence has one entry for each of them, itself a model, a sequence
///     or None. A callable ``f(t, state)`` holds the interpreter; `forces.traced` makes a model of it that does not.
/// gravity : array_like, shape (3,), optional
///     Acceleration, m/s², of all bodies, beside `forces`; none unless given.
/// t_eval : array_like, shape (n,), optional
///     Times of the states to record, s, within the interval, each after the one before; its start and its end unless given. Of
///     bodies that move several at a time a step ends at each of them: with fixed steps the one before is shorter where `dt` does
///     not divide the time between two. The steps of others do not depend on them.
/// rtol, atol : float, optional
///     Relative and absolute tolerance of adaptive steps, 1e-8 and 1e-10 unless given.
/// max_step, first_step : float, optional
///     Largest and first step of adaptive runs, s.
/// max_steps : int, optional
///     Largest number of steps of an adaptive run, 10 million unless given.
///
/// Returns
/// -------
/// Trajectory
///     The states at the times recorded, in arrays of shape (n, bodies, ...).
///
/// Raises
/// ------
/// InputError
///     If the numbers of bodies, states, steps and forces differ, or the method does not take the forces.
/// IntegrationError
///     If a run cannot continue: a state stopped being finite, or a tolerance cannot be met. The message has the number of such a body.
///
/// Notes
/// -----
/// Other Python threads run meanwhile, and Ctrl-C is looked for.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
/// >>> states = [somersault.State(angular_velocity=(0.0, w, 0.1)) for w in range(100)]
/// >>> motion = somersault.batch.integrate_batch(body, states, (0.0, 1.0), 0.01)
/// >>> motion.quaternion.shape
/// (2, 100, 4)
///
/// With drag, by adapted steps:
///
/// >>> drag = somersault.forces.Drag(angular=0.01)
/// >>> motion = somersault.batch.integrate_batch(body, states, (0.0, 1.0), forces=drag, t_eval=[0.5, 1.0], rtol=1e-6)
/// >>> bool((motion.kinetic_energy[1, 1:] < motion.kinetic_energy[0, 1:]).all())
/// True
#[pyfunction]
#[pyo3(signature = (
    bodies, states, interval, dt=None, *, method=None, forces=None, gravity=None, t_eval=None, rtol=None, atol=None, max_step=None,
    first_step=None, max_steps=None
))]
pub(crate) fn integrate_batch(
    py: Python<'_>,
    bodies: &Bound<'_, PyAny>,
    states: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    dt: Option<&Bound<'_, PyAny>>,
    method: Option<&Bound<'_, PyAny>>,
    forces: Option<&Bound<'_, PyAny>>,
    gravity: Option<&Bound<'_, PyAny>>,
    t_eval: Option<&Bound<'_, PyAny>>,
    rtol: Option<f64>,
    atol: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
    #[pyo3(from_py_with = integer_or_none)] max_steps: Option<i64>,
) -> Result<Trajectory, Error> {
    let wrong = |found| Error::input(format!("`states` must be a sequence of State, found {found}"));
    let list = sequence(states).ok_or_else(|| wrong(a_type(states)))?;
    let times = recorded(interval, t_eval, list.len()?)?;
    let bodies = match bodies.extract::<RigidBody>() {
        Ok(RigidBody(body)) => Bodies::Each(vec![body; list.len()?]),
        Err(_) => Cast::extract("bodies", bodies)?.bodies,
    };
    let mut states: Vec<RigidBodyState> = Vec::with_capacity(bodies.len());
    for entry in list.try_iter()? {
        let entry = entry?;
        let State(state) = entry.extract().map_err(|_| wrong(format!("{} in it", a_type(&entry))))?;
        states.push(state);
    }
    expect_length("states", bodies.len(), states.len())?;
    let gravity = Gravity { acceleration: vector_or("gravity", gravity, Vector3::zeros())? };
    let steps = StepArguments { dt: None, rtol, atol, max_step, first_step, max_steps };
    let batch = Batch { bodies, states, interval, times, gravity };
    batch.run(py, &Asked { dt, method, forces, steps })
}

/// Motion of many rigid bodies that do not interact, from arrays to arrays.
///
/// As `integrate_batch`, which takes objects, and with the same results.
///
/// Parameters
/// ----------
/// moments : array_like, shape (bodies, 3)
///     Principal moments of inertia, kg m²; the axes of the body frame are the principal ones.
/// quaternion : array_like, shape (bodies, 4)
///     Orientations at the start as quaternions (x, y, z, w), body frame to world frame.
/// angular_velocity : array_like, shape (bodies, 3)
///     Angular velocities at the start in the world frame, rad/s.
/// interval : tuple of float
///     Start and end time, s.
/// dt : float or array_like, shape (bodies,), optional
///     Step, s, of all bodies or of each. Where it is left out the steps of each body are adapted to `rtol` and `atol`.
/// mass : float or array_like, shape (bodies,), optional
///     Masses, kg, of all bodies or of each; 1 unless given. Without them the motion of free bodies is the same, and energies are those of
///     bodies of 1 kg.
/// position : array_like, shape (bodies, 3), optional
///     Positions of the centre of mass at the start, m; zero unless given.
/// velocity : array_like, shape (bodies, 3), optional
///     Velocities of the centre of mass at the start, m/s; zero unless given.
/// method, forces, gravity, t_eval, rtol, atol, max_step, first_step, max_steps
///     As of `integrate_batch`.
///
/// Returns
/// -------
/// Trajectory
///     The states at the times recorded, in arrays of shape (n, bodies, ...).
///
/// Raises
/// ------
/// InputError
///     If an array has another shape, or moments are not those of a body, and as of `integrate_batch`.
/// IntegrationError
///     As of `integrate_batch`.
///
/// Notes
/// -----
/// Other Python threads run meanwhile, and Ctrl-C is looked for.
///
/// Examples
/// --------
/// >>> import numpy as np, somersault
/// >>> random = np.random.default_rng(1)
/// >>> moments = np.array([0.4, 0.5, 0.6]) * random.uniform(1, 2, (1000, 1))
/// >>> upright, spin = np.tile([0, 0, 0, 1.0], (1000, 1)), random.normal(0, 3, (1000, 3))
/// >>> motion = somersault.batch.integrate_arrays(moments, upright, spin, (0.0, 1.0), 0.01, t_eval=[0.25, 0.5, 1.0])
/// >>> motion.quaternion.shape
/// (3, 1000, 4)
#[pyfunction]
#[pyo3(signature = (
    moments, quaternion, angular_velocity, interval, dt=None, *, mass=None, position=None, velocity=None, method=None, forces=None,
    gravity=None, t_eval=None, rtol=None, atol=None, max_step=None, first_step=None, max_steps=None
))]
pub(crate) fn integrate_arrays(
    py: Python<'_>,
    moments: &Bound<'_, PyAny>,
    quaternion: &Bound<'_, PyAny>,
    angular_velocity: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    dt: Option<&Bound<'_, PyAny>>,
    mass: Option<&Bound<'_, PyAny>>,
    position: Option<&Bound<'_, PyAny>>,
    velocity: Option<&Bound<'_, PyAny>>,
    method: Option<&Bound<'_, PyAny>>,
    forces: Option<&Bound<'_, PyAny>>,
    gravity: Option<&Bound<'_, PyAny>>,
    t_eval: Option<&Bound<'_, PyAny>>,
    rtol: Option<f64>,
    atol: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
    #[pyo3(from_py_with = integer_or_none)] max_steps: Option<i64>,
) -> Result<Trajectory, Error> {
    let moments = rows_of_three("moments", moments)?;
    let n = moments.len();
    let times = recorded(interval, t_eval, n)?;
    let masses = mass.map_or_else(|| Ok(vec![1.0; n]), |mass| numbers_or_one("mass", n, mass))?;
    let bodies = Bodies::principal(&masses, &moments)?;
    let mut states = vec![RigidBodyState::default(); n];
    if let Some(position) = position {
        each_vector("position", position, &mut states, |x, r| x.configuration.position = r)?;
    }
    if let Some(velocity) = velocity {
        each_vector("velocity", velocity, &mut states, |x, v| x.rate.linear = v)?;
    }
    each_vector("angular_velocity", angular_velocity, &mut states, |x, omega| x.rate.angular = omega)?;
    let orientations = quaternions("quaternion", &[n], quaternion)?;
    states.iter_mut().zip(orientations).for_each(|(x, q)| x.configuration.orientation = q);
    let gravity = Gravity { acceleration: vector_or("gravity", gravity, Vector3::zeros())? };
    let steps = StepArguments { dt: None, rtol, atol, max_step, first_step, max_steps };
    let batch = Batch { bodies, states, interval, times, gravity };
    batch.run(py, &Asked { dt, method, forces, steps })
}

/// Bodies, their states at the start, and the times at which they are recorded.
struct Batch {
    bodies: Bodies,
    states: Vec<RigidBodyState>,
    interval: [f64; 2],
    times: Vec<f64>,
    gravity: Gravity,
}

/// Bodies under forces that move several at a time.
#[derive(Default)]
struct Forced {
    members: Vec<usize>,
    /// Of each of them: the terms of its forces and of its weight, and which list holds the forces that are no sums of terms.
    terms: Vec<Vec<WrenchTerm>>,
    list_of: Vec<usize>,
    /// Lists of different forces, and where each is, by the addresses of the models.
    lists: Vec<Vec<Shared>>,
    places: HashMap<Vec<usize>, usize>,
}

impl Forced {
    fn add(&mut self, i: usize, body: &body::RigidBody, gravity: &Gravity, acting: Vec<Acting>) {
        let (mut terms, mut list) = (Vec::new(), Vec::new());
        gravity.add_terms(body, &mut terms);
        for force in acting {
            let known = terms.len();
            match force {
                Acting::Model(model) if !model.add_terms(body, &mut terms) => {
                    terms.truncate(known);
                    list.push(model);
                }
                Acting::Model(_) | Acting::Callable(_) => {}
            }
        }
        let addresses = list.iter().map(|model| Arc::as_ptr(model.model()).addr()).collect();
        let place = *self.places.entry(addresses).or_insert(self.lists.len());
        if place == self.lists.len() {
            self.lists.push(list);
        }
        self.members.push(i);
        self.terms.push(terms);
        self.list_of.push(place);
    }
}

fn as_model(model: &Shared) -> &(dyn ForceModel + Sync) {
    &**model.model()
}

/// What is asked of a batch in arguments that not all ways to move take.
struct Asked<'a, 'py> {
    dt: Option<&'a Bound<'py, PyAny>>,
    method: Option<&'a Bound<'py, PyAny>>,
    forces: Option<&'a Bound<'py, PyAny>>,
    /// Those of the steps but for `dt`.
    steps: StepArguments,
}

impl Batch {
    fn run(mut self, py: Python<'_>, asked: &Asked<'_, '_>) -> Result<Trajectory, Error> {
        let (n, [start, end]) = (self.bodies.len(), self.interval);
        let method = asked.method.map(|method| methods::extract("method", method)).transpose()?;
        let method = method.unwrap_or(if asked.dt.is_some() { Method::RkmkB } else { Method::Rkmk8B });
        let steps_of = |dt| StepArguments { dt, ..asked.steps }.steps(method, (start, end));
        let dt = asked.dt.map(|dt| numbers_or_one("dt", n, dt)).transpose()?;
        let forces = asked.forces.filter(|forces| !forces.is_none());
        let failure = Failure::default();
        let acting = forces.map(|forces| -> Result<Vec<Vec<Acting>>, Error> {
            let mut reader = Reader { failure: failure.clone(), calls_python: false };
            let acting = reader.for_each("forces", &self.bodies, forces)?;
            expect_length("forces", n, acting.len())?;
            Ok(acting)
        });
        let acting = acting.transpose()?;
        let mut acting = acting.map(Vec::into_iter);
        let are_lanes = method == if dt.is_some() { Method::RkmkB } else { Method::Rkmk8B };

        let (mut free, mut forced, mut others) = (Vec::new(), Forced::default(), Vec::new());
        let (mut steps_of_others, mut forces_of_others) = (Vec::new(), Vec::new());
        // Most bodies of a batch have the same steps as the one before.
        let dt_of = |i: usize| dt.as_ref().and_then(|dt| dt.get(i).copied());
        let mut dt_before = dt_of(0);
        let mut steps = steps_of(dt_before)?;
        for i in 0..n {
            let acting = acting.as_mut().and_then(Iterator::next).unwrap_or_default();
            if dt_of(i) != dt_before {
                dt_before = dt_of(i);
                steps = steps_of(dt_before)?;
            }
            let callables = acting.iter().any(|force| matches!(force, Acting::Callable(_)));
            if are_lanes && dt.is_some() && acting.is_empty() {
                free.push(i);
            } else if are_lanes && !callables {
                forced.add(i, &self.bodies[i], &self.gravity, acting);
            } else {
                others.push(i);
                steps_of_others.push(steps);
                forces_of_others.push(acting.into_iter().map(BoxedForce::from).collect());
            }
        }
        let mut kept = Vec::new();
        let summed = &forced.members;
        let lists: Vec<Vec<_>> =
            forced.lists.iter().map(|list| list.iter().map(as_model).collect()).collect();
        let lists: Vec<&[_]> = forced.list_of.iter().map(|&list| &lists[list][..]).collect();
        if let Some(dt) = &dt {
            let moved = self.free_in_lanes(py, &free, dt)?;
            self.keep(&free, moved, &mut kept);
            if !summed.is_empty() {
                let states = self.take(summed);
                let bodies = chosen(&self.bodies, summed);
                let moved = self.in_lanes(py, summed, states, dt, |grids, states, token| {
                    let runs = ForcedRuns::try_new(&bodies, grids, &forced.terms)?;
                    runs.with_forces(&lists)?.advance(states, token)
                })?;
                self.keep(summed, moved, &mut kept);
            }
        } else if let Some(Steps::Adapted { settings, .. }) = Some(steps).filter(|_| !summed.is_empty()) {
            let moved = self.adapted_in_lanes(py, summed, &settings, &forced.terms, &lists)?;
            self.keep(summed, moved, &mut kept);
        }
        if !others.is_empty() {
            let moved = self.one_by_one(py, &others, method, &steps_of_others, forces_of_others, &failure)?;
            self.keep(&others, moved, &mut kept);
        }
        Ok(Trajectory::new(Cast { bodies: self.bodies, single: false }, self.times, kept))
    }

    /// Puts the states of some of the bodies at the times, those at one time after the other, among those of all.
    fn keep(&self, members: &[usize], moved: Vec<RigidBodyState>, kept: &mut Vec<RigidBodyState>) {
        let n = self.bodies.len();
        if members.len() == n {
            *kept = moved;
        } else if !members.is_empty() {
            kept.resize(self.times.len() * n, RigidBodyState::default());
            for (k, moved) in moved.chunks(members.len()).enumerate() {
                members.iter().zip(moved).for_each(|(i, x)| kept[k * n + i] = *x);
            }
        }
    }

    /// The states of some of the bodies at the start, which are not needed a second time where these are all.
    fn take(&mut self, members: &[usize]) -> Vec<RigidBodyState> {
        if members.len() == self.states.len() {
            std::mem::take(&mut self.states)
        } else {
            members.iter().map(|&i| self.states[i]).collect()
        }
    }

    /// Some of the bodies without forces by the method in vector lanes.
    fn free_in_lanes(
        &mut self,
        py: Python<'_>,
        members: &[usize],
        dt: &[f64],
    ) -> Result<Vec<RigidBodyState>, Error> {
        let states = self.take(members);
        match &self.bodies {
            Bodies::Each(bodies) => self.free_of(py, &chosen(bodies, members), members, states, dt),
            Bodies::Principal(bodies, _) => self.free_of(py, &chosen(bodies, members), members, states, dt),
        }
    }

    fn free_of<B: PrincipalFrame + Sync>(
        &self,
        py: Python<'_>,
        bodies: &[B],
        members: &[usize],
        states: Vec<RigidBodyState>,
        dt: &[f64],
    ) -> Result<Vec<RigidBodyState>, Error> {
        self.in_lanes(py, members, states, dt, |grids, states, token| {
            FreeRuns::new(bodies, grids).in_gravity(&self.gravity).advance(states, token)
        })
    }

    /// Some of the bodies in their states by the method in vector lanes, from each time of the record to the next.
    fn in_lanes(
        &self,
        py: Python<'_>,
        members: &[usize],
        mut kept: Vec<RigidBodyState>,
        dt: &[f64],
        advance: impl Fn(&[TimeGrid], &mut [RigidBodyState], &CancellationToken) -> Result<(), BatchError> + Sync,
    ) -> Result<Vec<RigidBodyState>, Error> {
        let (n, mut now) = (members.len(), self.interval[0]);
        kept.reserve_exact(self.times.len().saturating_sub(1) * n);
        // one call for all times: each of many may end before anyone looks for signals
        cancel_on_signal(py, |token| {
            for (k, &t) in self.times.iter().enumerate() {
                if k > 0 {
                    kept.extend_from_within((k - 1) * n..);
                }
                if t != now {
                    let grids = grids(now, t, members.iter().map(|&i| dt[i]))?;
                    let moved = advance(&grids, &mut kept[k * n..], token);
                    moved.map_err(|error| error.among(members))?;
                    now = t;
                }
            }
            Ok::<_, Error>(kept)
        })
    }

    /// Some of the bodies by adapted steps in vector lanes.
    fn adapted_in_lanes(
        &self,
        py: Python<'_>,
        members: &[usize],
        settings: &Adaptive,
        terms: &[Vec<WrenchTerm>],
        forces: &[Forces<'_>],
    ) -> Result<Vec<RigidBodyState>, Error> {
        self.expect_room_at_times(members.len())?;
        let (bodies, states) = (chosen(&self.bodies, members), chosen(&self.states, members));
        let moved = cancel_on_signal(py, |token| {
            let runs = AdaptedRuns::try_new(&bodies, self.interval.into(), *settings, terms);
            let runs = runs.and_then(|runs| runs.with_forces(forces));
            let moved = runs.and_then(|runs| runs.recorded(&states, &self.times, token));
            moved.map_err(|error| error.among(members))
        })?;
        Ok(self.by_times(&moved))
    }

    /// States of some bodies at the times, given body by body, as those at one time after the other.
    fn by_times(&self, moved: &[Vec<RigidBodyState>]) -> Vec<RigidBodyState> {
        let at = |k: usize| moved.iter().map(move |states| states[k]);
        (0..self.times.len()).flat_map(at).collect()
    }

    /// Whether there is room for states of so many bodies at the times, of each by itself, with room to grow, and of all.
    fn expect_room_at_times(&self, members: usize) -> Result<(), Error> {
        let bytes = size_of::<RigidBodyState>().saturating_mul(self.times.len()).saturating_mul(members);
        expect_room("the states at `t_eval`", bytes.saturating_mul(3))
    }

    /// Some of the bodies, each by itself.
    fn one_by_one(
        &self,
        py: Python<'_>,
        members: &[usize],
        method: Method,
        steps: &[Steps],
        mut models: Vec<Vec<BoxedForce>>,
        failure: &Failure,
    ) -> Result<Vec<RigidBodyState>, Error> {
        let Self { bodies, states, gravity, .. } = self;
        self.expect_room_at_times(members.len())?;
        if gravity.acceleration != Vector3::zeros() {
            models.iter_mut().for_each(|models| models.push(Box::new(*gravity)));
        }
        let states = chosen(states, members);
        let are_free = models.iter().all(Vec::is_empty);
        let runs = members.iter().map(|&i| bodies[i]).zip(models);
        let moved = if are_free {
            let systems: Vec<_> = runs.map(|(body, _)| RigidBodySystem::free(body)).collect();
            self.each_recorded(py, members, &systems, method, steps, &states)
        } else {
            let forced = |(body, models)| Counted::new(RigidBodySystem::new(body, models));
            let systems: Vec<_> = runs.map(forced).collect();
            self.each_recorded(py, members, &systems, method, steps, &states)
        };
        if let Some(error) = failure.get() {
            return Err(error.clone_ref(py).into());
        }
        Ok(self.by_times(&moved?))
    }

    /// The states at the times of some of the bodies, of which these are the systems.
    fn each_recorded<S>(
        &self,
        py: Python<'_>,
        members: &[usize],
        systems: &[S],
        method: Method,
        steps: &[Steps],
        states: &[RigidBodyState],
    ) -> Result<Vec<Vec<RigidBodyState>>, Error>
    where
        S: RigidSystem<Configuration = Pose> + Send + Sync,
    {
        cancel_on_signal(py, |token| {
            let runs = Runs::new(systems, method, steps).recorded(states, &self.times, token);
            runs.map_err(|error| error.among(members))
        })
    }
}

/// The grids from one time to another of steps of these sizes, most of which are as the one before.
fn grids(start: f64, end: f64, sizes: impl Iterator<Item = f64>) -> Result<Vec<TimeGrid>, IntegrateError> {
    let mut grids: Vec<TimeGrid> = Vec::with_capacity(sizes.size_hint().0);
    for dt in sizes {
        let grid = match grids.last() {
            Some(before) if before.dt() == dt => *before,
            _ => TimeGrid::try_new(start, end, dt)?,
        };
        grids.push(grid);
    }
    Ok(grids)
}

/// Those of the members, which increase, among all: of all where they are all.
fn chosen<'a, T: Copy>(all: &'a [T], members: &[usize]) -> Cow<'a, [T]> {
    if members.len() == all.len() {
        Cow::Borrowed(all)
    } else {
        Cow::Owned(members.iter().map(|&i| all[i]).collect())
    }
}

fn expect_length(argument: &'static str, expected: usize, found: usize) -> Result<(), BatchError> {
    if expected == found { Ok(()) } else { Err(BatchError::Length { argument, expected, found }) }
}

/// An array of at least one row of three numbers.
fn rows_of_three(argument: &str, value: &Bound<'_, PyAny>) -> Result<Vec<Vector3<f64>>, Error> {
    let length = value.len().ok().filter(|length| *length > 0);
    let count = length.ok_or_else(|| {
        let found = a_type(value);
        Error::input(format!(
            "`{argument}` must be real numbers of shape (bodies, 3) of at least one body, found {found}"
        ))
    })?;
    any_vectors(argument, &[count], value)
}

/// Puts a finite vector for each body into its state.
fn each_vector(
    argument: &str,
    value: &Bound<'_, PyAny>,
    states: &mut [RigidBodyState],
    put: impl Fn(&mut RigidBodyState, Vector3<f64>),
) -> Result<(), Error> {
    let vectors = any_vectors(argument, &[states.len()], value)?;
    check_finite(argument, vectors.iter().flatten())?;
    states.iter_mut().zip(vectors).for_each(|(x, v)| put(x, v));
    Ok(())
}

/// The times at which states of so many bodies are recorded, where there is room for all that a batch needs.
fn recorded(
    [start, end]: [f64; 2],
    t_eval: Option<&Bound<'_, PyAny>>,
    bodies: usize,
) -> Result<Vec<f64>, Error> {
    check_interval(start, end)?;
    let times = match t_eval {
        None => vec![start, end],
        Some(times) => {
            let times = real_numbers("t_eval", times)?;
            check_times((start, end), &times).map_err(IntegrateError::from)?;
            times
        }
    };
    let of_a_body = size_of::<body::RigidBody>() + size_of::<TimeGrid>() + size_of::<usize>();
    let states_of_a_body = size_of::<RigidBodyState>().saturating_mul(times.len());
    let bytes = bodies.saturating_mul(states_of_a_body.saturating_add(of_a_body));
    expect_room("the states at `t_eval`", bytes)?;
    Ok(times)
}

/// Many rigid bodies at once.
#[pyo3::pymodule(name = "batch", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::integrators::batch::{integrate_arrays, integrate_batch};
}
