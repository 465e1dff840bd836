//! Many motions of one tree at once.

use crate::core::convert::{a_type, array, check_finite, contiguous, integer, interval_of, row, shape_text};
use crate::core::error::{Class, Error};
use crate::core::memory::{bytes_of_numbers, expect_room};
use crate::core::rows::Rows;
use crate::core::waiting::cancel_on_signal;
use crate::integrators::plan::every_of;
use crate::multibody::model::Model;
use numpy::prelude::*;
use numpy::{PyArrayDyn, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use somersault::integrators::driver::TimeGrid;
use somersault::multibody::motion::{HeldTorques, RolloutError, Rollouts, rollout as roll_out};

impl From<RolloutError> for Error {
    fn from(error: RolloutError) -> Self {
        match error {
            RolloutError::Argument(error) => error.into(),
            RolloutError::State(error) => error.into(),
            RolloutError::Copy { copy, source } => Self::from(source).of("copy", copy),
            error => Self::own(Class::Integration, &error),
        }
    }
}

/// Motions of many copies of a tree, each from its own state and under its own torques, without contacts.
///
/// The classical Runge-Kutta-Munthe-Kaas method of order 4, ``"rkmk"`` of the table, moves the copies several at a time in the vector
/// registers of each core. Torques are held during each step, as a control loop holds them, so that their jumps cost no accuracy. The
/// motion of a copy does not depend, to the last bit, on the others.
///
/// Parameters
/// ----------
/// model : Model
///     The tree.
/// q : array_like, shape (n_positions,) or (copies, n_positions)
///     Positions at the start, of all copies or of each.
/// v : array_like, shape (n_velocities,) or (copies, n_velocities)
///     Joint velocities at the start, of all copies or of each.
/// interval : tuple of float
///     Start and end time, s.
/// dt : float
///     Step, s. Where it does not divide the interval the last step is shorter.
/// torque : array_like, shape (n_velocities,) or (copies, steps, n_velocities), optional
///     Joint torques, dual to v: constant, or of each copy and each step; an axis of length 1 stands for all. None unless given.
/// every : int, optional
///     Return every so many steps. The last is always returned.
///
/// Returns
/// -------
/// t : ndarray, shape (n,)
///     Times, s, from the start to the end.
/// q : ndarray, shape (copies, n, n_positions)
///     Positions.
/// v : ndarray, shape (copies, n, n_velocities)
///     Joint velocities.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, or the numbers of copies differ.
/// IntegrationError
///     If a state stops being finite; the message has the number of the first such copy.
/// DynamicsError
///     If the mass matrix of a copy becomes singular.
///
/// Notes
/// -----
/// Other Python threads run meanwhile, and Ctrl-C is looked for. Copies with contacts, events or adapted steps are runs of
/// `integrate_tree`.
///
/// Examples
/// --------
/// A cart-pendulum under random forces on the cart, each held for 10 ms: which comes nearest to where it is to be?
///
/// >>> import numpy as np
/// >>> from somersault import multibody
/// >>> pole = multibody.cart_pendulum()
/// >>> force = np.zeros((1000, 50, 2))
/// >>> force[..., 0] = np.random.default_rng(1).normal(0.0, 5.0, (1000, 50))
/// >>> t, q, v = multibody.rollout(pole, [0.0, 0.1], [0.0, 0.0], (0.0, 0.5), 0.01, torque=force)
/// >>> q.shape
/// (1000, 51, 2)
/// >>> best = np.argmin(abs(q[:, -1]).sum(axis=1))
/// >>> bool(abs(q[best, -1]).sum() < 0.25)
/// True
#[pyfunction]
#[pyo3(signature = (model, q, v, interval, dt, *, torque=None, every=1))]
pub(crate) fn rollout<'py>(
    py: Python<'py>,
    model: &Bound<'py, Model>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    dt: f64,
    torque: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = integer)] every: i64,
) -> Result<(Array<'py>, Array<'py>, Array<'py>), Error> {
    let model = &model.get().model;
    let (n_q, n) = (model.n_positions(), model.n_velocities());
    let grid = TimeGrid::try_new(interval[0], interval[1], dt)?;
    let every = every_of(every)?;
    let steps = usize::try_from(grid.steps()).unwrap_or(usize::MAX);
    let (q, v) = (Rows::extract("q", &[n_q], q)?, Rows::extract("v", &[n], v)?);
    let torque = torque.map(|torque| Torque::extract(n, torque)).transpose()?;

    let mut copies = None;
    let counts = [("q", q.count()), ("v", v.count()), ("torque", torque.as_ref().and_then(Torque::copies))];
    for (argument, found) in counts.into_iter().filter_map(|(argument, count)| Some((argument, count?))) {
        let (first, expected) = *copies.get_or_insert((argument, found));
        if found != expected {
            return Err(Error::input(format!(
                "`{argument}` must be of one copy or of the {expected} of `{first}`, found {found}"
            )));
        }
        if found == 0 {
            return Err(Error::input(format!("`{argument}` must be of at least one copy, found none")));
        }
    }
    let copies = copies.map_or(1, |(_, copies)| copies);
    let held = match &torque {
        None => HeldTorques::default(),
        Some(torque) => torque.held(steps)?,
    };
    let times = steps / usize::try_from(every).unwrap_or(usize::MAX) + 2;
    expect_room(
        "the states of the copies (give a larger `every`)",
        bytes_of_numbers(&[copies, times, n_q + n]),
    )?;
    let (q, v) = (repeated(&q, copies)?, repeated(&v, copies)?);
    let found = cancel_on_signal(py, |token| roll_out(model, &q, &v, &grid, &held, every, token))?;
    let Rollouts { times, positions, velocities } = found;
    let shape = [copies, times.len()];
    let q = array(py, positions, &[shape[0], shape[1], n_q])?;
    let v = array(py, velocities, &[shape[0], shape[1], n])?;
    Ok((row(py, times)?, q, v))
}

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// The rows of all copies, which one row may stand for.
fn repeated(rows: &Rows<'_>, copies: usize) -> Result<Vec<f64>, Error> {
    let given = rows.all()?;
    Ok(if rows.count().is_some() { given.to_vec() } else { given.repeat(copies) })
}

/// Joint torques as they are given.
struct Torque<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
    n: usize,
}

impl<'py> Torque<'py> {
    fn extract(n: usize, value: &Bound<'py, PyAny>) -> Result<Self, Error> {
        let expected = format!("real numbers of shape ({n},) or (copies, steps, {n})");
        if value.is_callable() {
            let found = a_type(value);
            return Err(Error::input(format!(
                "`torque` must be {expected}, found {found}; `integrate_tree` takes functions"
            )));
        }
        let array = contiguous("torque", &expected, value)?;
        match array.shape() {
            [found] | [_, _, found] if *found == n => {}
            found => {
                let found = shape_text(found);
                return Err(Error::input(format!("`torque` must be {expected}, found shape {found}")));
            }
        }
        check_finite("torque", array.as_slice().map_err(PyErr::from)?)?;
        Ok(Self { array, n })
    }

    /// How many copies there are, where one does not stand for all.
    fn copies(&self) -> Option<usize> {
        match self.array.shape() {
            [copies, _, _] if *copies != 1 => Some(*copies),
            _ => None,
        }
    }

    fn held(&self, steps: usize) -> Result<HeldTorques<'_>, Error> {
        let values = self.array.as_slice().map_err(PyErr::from)?;
        match self.array.shape() {
            [copies, found, _] if [1, steps].contains(found) => {
                Ok(HeldTorques { values, copies: *copies, steps: *found })
            }
            [_, found, _] => Err(Error::input(format!(
                "`torque` must be of one step or of the {steps} of `interval` and `dt`, found {found}"
            ))),
            _ => Ok(HeldTorques { values: &values[..self.n], copies: 1, steps: 1 }),
        }
    }
}
