//! Systems as they are pickled: by what they were made from.

use super::control_problem::state_costate;
use super::differentiated::Problem;
use super::named_systems::{arm, cubic_regulator, linear_regulator, tree};
use super::system::{GivenTree, Origin, Posed, System, Traced};
use super::watched::Callables;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore};
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use somersault::multibody::models::TwoLinkArm;

/// A callable as it comes out of a pickle.
type Code<'py> = Bound<'py, PyAny>;

#[pymethods]
impl System {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let tuple = |arguments: Bound<'py, PyTuple>, kind: &str| (kind, arguments).into_pyobject(py);
        let arguments = match &own.origin {
            Origin::Callables(own_code) => {
                let Callables { field, jacobian, hamiltonian, control, running_cost, n_controls, .. } =
                    &**own_code;
                let optional = (hamiltonian, control, running_cost);
                let given = ((field, jacobian), own.dimension, optional, n_controls);
                tuple(given.into_pyobject(py)?, "callables")?
            }
            Origin::Problem(problem) => {
                let Problem { callables: [dynamics, cost, jacobian, gradient, hessian], n_states, .. } =
                    &**problem;
                let bounds = problem.bounds.chunks(own.n_controls).collect::<Vec<_>>();
                let code = (dynamics, cost, jacobian, gradient, hessian);
                tuple((code, n_states, own.n_controls, bounds).into_pyobject(py)?, "problem")?
            }
            Origin::Arm(arm) => {
                let TwoLinkArm { masses, lengths, damping } = *arm.arm();
                let given = (masses, lengths, damping, arm.weights(), arm.torque_limits());
                tuple(given.into_pyobject(py)?, "arm")?
            }
            Origin::LinearRegulator => tuple(PyTuple::empty(py), "linear_regulator")?,
            Origin::CubicRegulator => tuple(PyTuple::empty(py), "cubic_regulator")?,
            Origin::Traced(Traced { origin: [maker, arguments], .. })
            | Origin::Posed(Posed { origin: [maker, arguments], .. }) => {
                let arguments = arguments.bind(py).cast::<PyTuple>()?.clone();
                return Ok((maker.bind(py).clone(), arguments));
            }
            Origin::Tree(GivenTree { model, weights, limits, passive, .. }) => {
                tuple((model, weights, limits, passive).into_pyobject(py)?, "tree")?
            }
        };
        by_restore(slf, arguments)
    }

    /// A pickled system; user-defined callables must be functions of a module.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, kind: &str, arguments: &Bound<'_, PyTuple>) -> Result<Self, Error> {
        match kind {
            "callables" => {
                let ([field, jacobian], dimension, optional, n_controls): (
                    [Code<'_>; 2],
                    usize,
                    [Option<Code<'_>>; 3],
                    usize,
                ) = arguments.extract()?;
                let [hamiltonian, control, running_cost] = optional.each_ref().map(Option::as_ref);
                Self::new(&field, &jacobian, dimension, hamiltonian, control, running_cost, n_controls)
            }
            "problem" => {
                let ([dynamics, cost, jacobian, gradient, hessian], n_states, n_controls, bounds): (
                    [Code<'_>; 5],
                    usize,
                    usize,
                    Code<'_>,
                ) = arguments.extract()?;
                let bounds = Some(&bounds);
                state_costate(&dynamics, &cost, n_states, n_controls, &jacobian, &gradient, &hessian, bounds)
            }
            "arm" => {
                let (masses, lengths, damping, weights, limits) = arguments.extract()?;
                arm(masses, lengths, damping, weights, Some(limits))
            }
            "linear_regulator" => Ok(linear_regulator()),
            "cubic_regulator" => Ok(cubic_regulator()),
            "tree" => {
                let (model, weights, limits, passive): (
                    Bound<'_, Model>,
                    Bound<'_, PyAny>,
                    Bound<'_, PyAny>,
                    _,
                ) = arguments.extract()?;
                tree(&model, Some(&weights), Some(&limits), passive)
            }
            other => Err(Error::input(format!("`kind` of a system is not known: '{other}'"))),
        }
    }
}
