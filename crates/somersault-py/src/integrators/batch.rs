//! Many free bodies at once.

use crate::core::convert::{
    a_type, any_vectors, check_finite, interval_of, numbers_or_one, quaternions, real_numbers, sequence,
    vector_or,
};
use crate::core::error::Error;
use crate::core::memory::expect_room;
use crate::core::waiting::together;
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::trajectory::{Cast, Trajectory};
use pyo3::prelude::*;
use somersault::integrators::batch::{BatchError, FreeRuns};
use somersault::integrators::body;
use somersault::integrators::driver::{IntegrateError, TimeGrid, check_interval};
use somersault::integrators::force::Gravity;
use somersault::integrators::nalgebra::Vector3;
use somersault::integrators::solution::check_times;
use somersault::integrators::state::RigidBodyState;

/// How many steps lie between two looks at signals: a fraction of a second.
const STEPS_PER_LOOK: u64 = 20_000_000;

/// Motion of many rigid bodies that do not interact, free or under uniform gravity.
///
/// The fourth order Runge-Kutta-Munthe-Kaas method in the body frame, ``"rkmk_b"`` of the table,
/// vectorised over bodies and parallel over cores; the centre of mass moves exactly. The result does not
/// depend, to the last bit, on the processor, the number of threads or which bodies go together.
///
/// Parameters
/// ----------
/// bodies : RigidBody or sequence of RigidBody
///     The bodies; a single one stands for all.
/// states : sequence of State
///     Their states at the start.
/// interval : tuple of float
///     Start and end time, s.
/// dt : float or array_like, shape (bodies,)
///     Step, s, of all bodies or of each.
/// gravity : array_like, shape (3,), optional
///     Acceleration, m/s²; none unless given.
///
/// Returns
/// -------
/// Trajectory
///     The states at the start and at the end of the interval, in arrays of shape (2, bodies, ...).
///
/// Raises
/// ------
/// InputError
///     If the numbers of bodies, states and steps differ.
/// IntegrationError
///     If a state stops being finite.
///
/// Notes
/// -----
/// Other Python threads run meanwhile. Ctrl-C is looked for between groups of bodies that make 20 million
/// steps together, but of no fewer than 64 bodies a core.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
/// >>> states = [somersault.State(angular_velocity=(0.0, w, 0.1)) for w in range(100)]
/// >>> motion = somersault.batch.integrate_batch(body, states, (0.0, 1.0), 0.01)
/// >>> motion.quaternion.shape
/// (2, 100, 4)
#[pyfunction]
#[pyo3(signature = (bodies, states, interval, dt, *, gravity=None))]
pub(crate) fn integrate_batch(
    py: Python<'_>,
    bodies: &Bound<'_, PyAny>,
    states: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    dt: &Bound<'_, PyAny>,
    gravity: Option<&Bound<'_, PyAny>>,
) -> Result<Trajectory, Error> {
    let wrong = |found| Error::input(format!("`states` must be a sequence of State, found {found}"));
    let list = sequence(states).ok_or_else(|| wrong(a_type(states)))?;
    let cast = match bodies.extract::<RigidBody>() {
        Ok(RigidBody(body)) => Cast { bodies: vec![body; list.len()?], single: false },
        Err(_) => Cast::extract("bodies", bodies)?,
    };
    let mut starts: Vec<RigidBodyState> = Vec::with_capacity(cast.bodies.len());
    for entry in list.try_iter()? {
        let entry = entry?;
        let State(state) = entry.extract().map_err(|_| wrong(format!("{} in it", a_type(&entry))))?;
        starts.push(state);
    }
    let n = cast.bodies.len();
    if starts.len() != n {
        return Err(BatchError::Length { argument: "states", expected: n, found: starts.len() }.into());
    }
    let dt = numbers_or_one("dt", n, dt)?;
    let gravity = Gravity { acceleration: vector_or("gravity", gravity, Vector3::zeros())? };
    let ends = moved(py, &cast.bodies, &starts, interval, &dt, &gravity)?;
    starts.extend(ends);
    Ok(Trajectory::new(cast, interval.to_vec(), starts))
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
/// dt : float or array_like, shape (bodies,)
///     Step, s, of all bodies or of each.
/// mass : float or array_like, shape (bodies,), optional
///     Masses, kg, of all bodies or of each; 1 unless given. Without them the motion is the same, and energies are those of bodies of 1 kg.
/// position : array_like, shape (bodies, 3), optional
///     Positions of the centre of mass at the start, m; zero unless given.
/// velocity : array_like, shape (bodies, 3), optional
///     Velocities of the centre of mass at the start, m/s; zero unless given.
/// gravity : array_like, shape (3,), optional
///     Acceleration, m/s²; none unless given.
/// t_eval : array_like, shape (n,), optional
///     Times of the states to record, s, within the interval and in its direction, each once; its start and its end unless given. Steps
///     start again at each of them, and the step before it is shorter where `dt` does not divide the time between two.
///
/// Returns
/// -------
/// Trajectory
///     The states at the times recorded, in arrays of shape (n, bodies, ...).
///
/// Raises
/// ------
/// InputError
///     If an array has another shape, or moments are not those of a body.
/// IntegrationError
///     If a state stops being finite.
///
/// Notes
/// -----
/// Other Python threads run meanwhile. Ctrl-C is looked for as `integrate_batch` does.
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
    moments, quaternion, angular_velocity, interval, dt, *, mass=None, position=None, velocity=None, gravity=None, t_eval=None
))]
pub(crate) fn integrate_arrays(
    py: Python<'_>,
    moments: &Bound<'_, PyAny>,
    quaternion: &Bound<'_, PyAny>,
    angular_velocity: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    dt: &Bound<'_, PyAny>,
    mass: Option<&Bound<'_, PyAny>>,
    position: Option<&Bound<'_, PyAny>>,
    velocity: Option<&Bound<'_, PyAny>>,
    gravity: Option<&Bound<'_, PyAny>>,
    t_eval: Option<&Bound<'_, PyAny>>,
) -> Result<Trajectory, Error> {
    let moments = rows_of_three("moments", moments)?;
    let n = moments.len();
    let masses = mass.map_or_else(|| Ok(vec![1.0; n]), |mass| numbers_or_one("mass", n, mass))?;
    let bodies = std::iter::zip(masses, moments)
        .enumerate()
        .map(|(at, (mass, moments))| {
            body::RigidBody::try_principal(mass, moments)
                .map_err(|error| Error::input(format!("body {at}: {error}")))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let vectors = |argument, value: Option<&Bound<'_, PyAny>>| {
        value.map_or_else(|| Ok(vec![Vector3::zeros(); n]), |value| vectors_of(argument, n, value))
    };
    let (positions, velocities) = (vectors("position", position)?, vectors("velocity", velocity)?);
    let spins = vectors_of("angular_velocity", n, angular_velocity)?;
    let orientations = quaternions("quaternion", &[n], quaternion)?;
    let mut states: Vec<RigidBodyState> =
        (0..n).map(|i| RigidBodyState::new(positions[i], orientations[i], velocities[i], spins[i])).collect();
    let dt = numbers_or_one("dt", n, dt)?;
    let gravity = Gravity { acceleration: vector_or("gravity", gravity, Vector3::zeros())? };
    let times = recorded(interval, t_eval)?;
    let bytes = size_of::<RigidBodyState>().saturating_mul(n).saturating_mul(times.len());
    expect_room("the states at `t_eval`", bytes)?;
    let mut kept = Vec::with_capacity(times.len() * n);
    let mut now = interval[0];
    for &t in &times {
        if t != now {
            states = moved(py, &bodies, &states, [now, t], &dt, &gravity)?;
            now = t;
        }
        kept.extend_from_slice(&states);
    }
    Ok(Trajectory::new(Cast { bodies, single: false }, times, kept))
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

/// A finite vector for each body.
fn vectors_of(argument: &str, bodies: usize, value: &Bound<'_, PyAny>) -> Result<Vec<Vector3<f64>>, Error> {
    let vectors = any_vectors(argument, &[bodies], value)?;
    check_finite(argument, vectors.iter().flatten())?;
    Ok(vectors)
}

/// The times at which states are recorded.
fn recorded([start, end]: [f64; 2], t_eval: Option<&Bound<'_, PyAny>>) -> Result<Vec<f64>, Error> {
    check_interval(start, end)?;
    let Some(times) = t_eval else { return Ok(vec![start, end]) };
    let times = real_numbers("t_eval", times)?;
    check_times((start, end), &times).map_err(IntegrateError::from)?;
    Ok(times)
}

/// The states of bodies at the end of an interval.
fn moved(
    py: Python<'_>,
    bodies: &[body::RigidBody],
    states: &[RigidBodyState],
    [start, end]: [f64; 2],
    dt: &[f64],
    gravity: &Gravity,
) -> Result<Vec<RigidBodyState>, Error> {
    let grids = dt.iter().map(|dt| TimeGrid::try_new(start, end, *dt)).collect::<Result<Vec<_>, _>>()?;
    let n = bodies.len();
    let mut ends = Vec::with_capacity(n);
    while ends.len() < n {
        let first = ends.len();
        let last = (first + chunk(&grids[first..])).min(n);
        let part = |bodies: &[body::RigidBody], states: &[RigidBodyState], grids: &[TimeGrid]| {
            together(py, || FreeRuns::new(bodies, grids).in_gravity(gravity).from(states))
        };
        let moved = part(&bodies[first..last], &states[first..last], &grids[first..last])?;
        ends.extend(moved.map_err(|error| from(first, error))?);
        py.check_signals()?;
    }
    Ok(ends)
}

/// How many bodies to take at once: a fraction of a second's work, but enough for all cores.
fn chunk(grids: &[TimeGrid]) -> usize {
    let least = 64 * std::thread::available_parallelism().map_or(1, usize::from);
    let mut steps = 0;
    let within = grids.iter().take_while(|grid| {
        steps += grid.steps();
        steps <= STEPS_PER_LOOK
    });
    within.count().max(least)
}

/// An error of a part that begins with body `first`, with the body counted from the start of all.
fn from(first: usize, error: BatchError) -> BatchError {
    match error {
        BatchError::Diverged { body } => BatchError::Diverged { body: first + body },
        BatchError::NonFinite { argument, body, found } => {
            BatchError::NonFinite { argument, body: first + body, found }
        }
        error => error,
    }
}

/// Many rigid bodies at once.
#[pyo3::pymodule(name = "batch", module = "somersault._somersault", submodule)]
pub(crate) mod module {
    #[pymodule_export]
    use crate::integrators::batch::{integrate_arrays, integrate_batch};
}
