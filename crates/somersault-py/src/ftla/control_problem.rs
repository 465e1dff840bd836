//! Optimal control problems of a user's own, written by dynamics and running cost.

use super::argument::whole;
use super::differentiated::{NAMES, Problem};
use super::dimension::MOST;
use super::system::{Origin, System};
use crate::core::callable::check_callable;
use crate::core::convert::with_shape;
use crate::core::error::Error;
use pyo3::prelude::*;
use std::cmp::Ordering;
use std::sync::Arc;

/// The state–costate system of a user-defined optimal control problem: minimise ∫ ℓ(x, u) dt subject to dx/dt = f(x, u).
///
/// Any dynamics, any running cost such that λᵀf + ℓ is strictly convex in u, and bounds on the controls: the control that
/// minimises is found by a projected Newton's method, and where it reaches or leaves a bound is located.
///
/// Parameters
/// ----------
/// dynamics : callable
///     ``dynamics(x, u) -> f``, of shape (n_states,).
/// running_cost : callable
///     ``running_cost(x, u) -> float``, ℓ.
/// n_states : int
///     From 1 to 128.
/// n_controls : int
///     From 1 to 128.
/// jacobian : callable
///     ``jacobian(x, u)``, of shape (n_states, n_states + n_controls): ∂f/∂(x, u).
/// gradient : callable
///     ``gradient(x, u)``, of shape (n_states + n_controls,): ∂ℓ/∂(x, u).
/// hessian : callable
///     ``hessian(x, u, costate)``, of shape (n_states + n_controls, n_states + n_controls): ∂²(λᵀf + ℓ)/∂(x, u)².
/// control_bounds : array_like, shape (2, n_controls), optional
///     Lower and upper bounds of the controls; infinite ones are ignored.
///
/// Returns
/// -------
/// System
///
/// Raises
/// ------
/// EvaluationError
///     By whatever calls them, where a callable raises, returns what is not finite, or no control minimises. In a trial of a
///     search what is not finite, or an ``ArithmeticError``, is a step rejected.
/// InputError
///     By whatever calls them, where ``jacobian``, ``gradient`` or ``hessian`` is not the derivative that it must be. They are
///     checked against differences at the first points of every calculation and, ever more rarely, at later ones; an entry that is
///     off by 0.1 % is refused.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import ftla
/// >>> system = ftla.state_costate(
/// ...     lambda x, u: -x + u,
/// ...     lambda x, u: 0.5 * (x @ x + u @ u),
/// ...     1,
/// ...     1,
/// ...     jacobian=lambda x, u: [[-1.0, 1.0]],
/// ...     gradient=lambda x, u: [x[0], u[0]],
/// ...     hessian=lambda x, u, costate: np.eye(2),
/// ...     control_bounds=[[-0.2], [0.2]],
/// ... )
/// >>> system.control([[0.0, 0.1], [0.0, 0.4]])
/// array([[-0.1],
///        [-0.2]])
#[pyfunction]
#[pyo3(signature = (
    dynamics, running_cost, n_states, n_controls, *, jacobian, gradient, hessian, control_bounds=None
))]
pub(crate) fn state_costate(
    dynamics: &Bound<'_, PyAny>,
    running_cost: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = whole::n_states)] n_states: usize,
    #[pyo3(from_py_with = whole::n_controls)] n_controls: usize,
    jacobian: &Bound<'_, PyAny>,
    gradient: &Bound<'_, PyAny>,
    hessian: &Bound<'_, PyAny>,
    control_bounds: Option<&Bound<'_, PyAny>>,
) -> Result<System, Error> {
    for (name, found) in [("n_states", n_states), ("n_controls", n_controls)] {
        if !(1..=MOST / 2).contains(&found) {
            return Err(Error::input(format!("`{name}` must be from 1 to {}, found {found}", MOST / 2)));
        }
    }
    let given = [dynamics, running_cost, jacobian, gradient, hessian];
    for (name, callable) in NAMES.into_iter().zip(given) {
        check_callable(name, if name == "hessian" { "of (x, u, costate)" } else { "of (x, u)" }, callable)?;
    }
    let bounds = match control_bounds {
        Some(bounds) => with_shape("control_bounds", &[2, n_controls], bounds)?,
        None => [vec![f64::NEG_INFINITY; n_controls], vec![f64::INFINITY; n_controls]].concat(),
    };
    if let Some(i) =
        (0..n_controls).find(|&i| bounds[i].partial_cmp(&bounds[n_controls + i]) != Some(Ordering::Less))
    {
        let found = [bounds[i], bounds[n_controls + i]];
        return Err(Error::input(format!(
            "`control_bounds` must be a lower below an upper bound, found {found:?}"
        )));
    }
    let callables = given.map(|callable| callable.clone().unbind());
    let description = format!("problem of {n_states} states and {n_controls} controls");
    let problem = Problem { callables, n_states, n_controls, bounds };
    Ok(System::made_from(2 * n_states, n_controls, description, Origin::Problem(Arc::new(problem))))
}
