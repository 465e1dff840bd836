//! Many free bodies at once.

use crate::core::convert::{a_type, interval_of, numbers_or_one, sequence, vector_or};
use crate::core::error::Error;
use crate::core::waiting::together;
use crate::integrators::bodies::{RigidBody, State};
use crate::integrators::trajectory::{Cast, Trajectory};
use pyo3::prelude::*;
use somersault::integrators::batch::{BatchError, FreeRuns};
use somersault::integrators::body;
use somersault::integrators::driver::TimeGrid;
use somersault::integrators::force::Gravity;
use somersault::integrators::nalgebra::Vector3;
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
    let grids = numbers_or_one("dt", n, dt)?
        .into_iter()
        .map(|dt| TimeGrid::try_new(interval[0], interval[1], dt))
        .collect::<Result<Vec<_>, _>>()?;
    let gravity = Gravity { acceleration: vector_or("gravity", gravity, Vector3::zeros())? };

    let mut ends = Vec::with_capacity(n);
    while ends.len() < n {
        let first = ends.len();
        let last = (first + chunk(&grids[first..])).min(n);
        let part = |bodies: &[body::RigidBody], states: &[RigidBodyState], grids: &[TimeGrid]| {
            together(py, || FreeRuns::new(bodies, grids).in_gravity(&gravity).from(states))
        };
        let moved = part(&cast.bodies[first..last], &starts[first..last], &grids[first..last])?;
        ends.extend(moved.map_err(|error| from(first, error))?);
        py.check_signals()?;
    }
    starts.append(&mut ends);
    Ok(Trajectory::new(cast, interval.to_vec(), starts))
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
    use crate::integrators::batch::integrate_batch;
}
