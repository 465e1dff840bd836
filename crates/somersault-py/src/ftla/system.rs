//! State–costate systems, compiled or users' own.

use super::argument::whole;
use super::differentiated::{DifferentiatedCallables, Problem};
use super::dimension::{by_rows, expect_dimension};
use super::run::{Run, attend};
use super::watched::{Callables, Source, Watched};
use crate::core::callable::check_callable;
use crate::core::error::Error;
use crate::core::rows::Rows;
use crate::core::value::{brief, value};
use crate::expr::CompiledFunction;
use crate::multibody::model::Model;
use crate::ocp::collocation::TracedProblem;
use pyo3::prelude::*;
use somersault::ftla::nalgebra::DMatrix;
use somersault::ftla::system::{
    ArmMinimumTorque, CubicRegulator, DifferentiatedProblem, HamiltonianSystem, LinearRegulator,
    OptimalControlSystem, PosedProblem, StateCostate, SystemError, TracedField, TreeMinimumTorque,
    VectorField,
};
use std::sync::Arc;

/// Controls that a user's system may have: what is requested beyond is a slip, and no memory is there for it.
const MOST_CONTROLS: usize = 1000;

/// The state–costate system of an optimal control problem, dp/dt = h(p) with p = (x, λ), as a user's own callables.
///
/// `arm`, `tree`, `linear_regulator` and `cubic_regulator` make those of the library, which need no Python code.
///
/// Parameters
/// ----------
/// field : callable
///     ``field(p) -> h``, of shape (dimension,).
/// jacobian : callable
///     ``jacobian(p) -> D``, of shape (dimension, dimension): ∂hᵢ/∂pⱼ. Checked against differences of the field at the first
///     points of every calculation and, ever more rarely, at later ones; an entry that is off by 0.1 % is refused.
/// dimension : int
///     States and costates together, up to 256. What is no control problem may have any number, an odd one too.
/// hamiltonian : callable, optional
///     ``hamiltonian(p) -> float``, for what needs it: a least-squares match, the spread along an extremal. With it an
///     extremal counts as converged only if it is constant there.
/// control : callable, optional
///     ``control(p) -> u``, of shape (n_controls,).
/// running_cost : callable, optional
///     ``running_cost(p) -> float``, for the cost of a motion.
/// n_controls : int, optional
///     Number of controls.
///
/// Raises
/// ------
/// EvaluationError
///     By whatever calls them, where a callable raises, which is then the cause, or the field is not finite. An
///     ``ArithmeticError`` counts as no value: a trial that overflows is a step rejected.
/// InputError
///     By whatever calls it, where ``jacobian`` is not the derivative of ``field``.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import ftla
/// >>> rates = np.array([[-1.0, -1.0], [-1.0, 1.0]])
/// >>> own = ftla.System(lambda p: rates @ p, lambda p: rates, 2)
/// >>> spectrum = ftla.VariationalFlow(own).spectrum([1.0, 0.4], 8.0)
/// >>> spectrum.exponents.round(6)
/// array([-1.414214,  1.414214])
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct System {
    pub(crate) dimension: usize,
    pub(crate) n_controls: usize,
    description: String,
    pub(super) origin: Origin,
}

/// What a system is made from, for its runs and to be made again.
pub(super) enum Origin {
    Callables(Arc<Callables>),
    Problem(Arc<Problem>),
    Arm(ArmMinimumTorque),
    LinearRegulator,
    CubicRegulator,
    Tree(GivenTree),
    Traced(Traced),
    Posed(Posed),
}

/// A traced field, and the call that makes the system again.
pub(super) struct Traced {
    pub(super) field: Arc<TracedField>,
    pub(super) origin: [Py<PyAny>; 2],
}

/// The system of a problem, and the call that makes it again.
pub(super) struct Posed {
    pub(super) system: Arc<StateCostate<PosedProblem>>,
    pub(super) origin: [Py<PyAny>; 2],
}

/// What the system of a tree is made from.
pub(super) struct GivenTree {
    pub(super) model: Py<Model>,
    pub(super) weights: Vec<f64>,
    pub(super) limits: Vec<f64>,
    pub(super) passive: Vec<usize>,
    pub(super) system: Arc<TreeMinimumTorque>,
}

impl System {
    /// The arm that it is of, if it is of one.
    pub(crate) fn arm(&self) -> Option<ArmMinimumTorque> {
        if let Origin::Arm(arm) = self.origin { Some(arm) } else { None }
    }

    /// The tree that it is of, if it is of one.
    pub(super) fn tree(&self) -> Option<&TreeMinimumTorque> {
        match &self.origin {
            Origin::Tree(given) => Some(&given.system),
            Origin::Callables(_)
            | Origin::Problem(_)
            | Origin::Arm(_)
            | Origin::LinearRegulator
            | Origin::CubicRegulator
            | Origin::Traced(_)
            | Origin::Posed(_) => None,
        }
    }

    /// The system of the problem that it is of, if it is of one.
    pub(super) fn posed(&self) -> Option<&StateCostate<PosedProblem>> {
        if let Origin::Posed(posed) = &self.origin { Some(&posed.system) } else { None }
    }

    pub(super) fn made_from(
        dimension: usize,
        n_controls: usize,
        description: String,
        origin: Origin,
    ) -> Self {
        Self { dimension, n_controls, description, origin }
    }

    /// Fails where the field depends on time.
    pub(super) fn expect_autonomous(&self) -> Result<(), Error> {
        match &self.origin {
            Origin::Traced(traced) if !traced.field.is_autonomous() => {
                Err(Error::input("`system` must not depend on time, found a field of t"))
            }
            _ => Ok(()),
        }
    }

    /// Number of states, where there are as many costates.
    pub(super) fn n_states(&self) -> Result<usize, Error> {
        self.expect_autonomous()?;
        if self.dimension.is_multiple_of(2) {
            Ok(self.dimension / 2)
        } else {
            Err(Error::input(format!(
                "`system` must have as many costates as states, found {} numbers",
                self.dimension
            )))
        }
    }

    /// The system for one run.
    pub(crate) fn watched(&self, run: &Arc<Run>) -> Result<Watched, Error> {
        let source = match &self.origin {
            Origin::Callables(callables) => Source::Callables(Arc::clone(callables)),
            Origin::Problem(problem) => {
                Source::Compiled(Arc::new(StateCostate::try_new(DifferentiatedCallables::new(problem, run))?))
            }
            Origin::Arm(arm) => Source::Compiled(Arc::new(*arm)),
            Origin::LinearRegulator => Source::Compiled(Arc::new(LinearRegulator)),
            Origin::CubicRegulator => Source::Compiled(Arc::new(CubicRegulator)),
            Origin::Tree(given) => Source::Compiled(Arc::clone(&given.system) as _),
            Origin::Traced(traced) => Source::Traced(Arc::clone(&traced.field)),
            Origin::Posed(posed) => Source::Compiled(Arc::clone(&posed.system) as _),
        };
        Ok(source.watched(run))
    }

    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        quantity: Quantity,
        p: &Bound<'py, PyAny>,
        t: f64,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let n = self.dimension;
        if !t.is_finite() {
            return Err(Error::input(format!("`t` must be finite, found {t}")));
        }
        let rows = Rows::extract("p", &[n], p)?;
        let points = rows.all()?;
        let values = attend(py, |run| values(self, run, quantity, (points, t)))?;
        let inner: &[usize] = match quantity {
            Quantity::Field => &[n],
            Quantity::Jacobian => &[n, n],
            Quantity::Control => &[self.n_controls],
            Quantity::Hamiltonian | Quantity::RunningCost => &[],
        };
        if inner.is_empty() && !rows.is_many() {
            return Ok(pyo3::types::PyFloat::new(py, values[0]).into_any());
        }
        let count = rows.is_many().then_some(points.len() / n);
        let shape: Vec<usize> = count.into_iter().chain(inner.iter().copied()).collect();
        Ok(crate::core::convert::array(py, values, &shape)?.into_any())
    }
}

/// A function of state and costate.
#[derive(Clone, Copy)]
enum Quantity {
    Field,
    Jacobian,
    Hamiltonian,
    Control,
    RunningCost,
}

impl Quantity {
    fn name(self) -> &'static str {
        match self {
            Self::Field => "field",
            Self::Jacobian => "jacobian",
            Self::Hamiltonian => "hamiltonian",
            Self::Control => "control",
            Self::RunningCost => "running_cost",
        }
    }
}

/// A quantity at each of the points, one after the other.
fn values(
    system: &System,
    run: &Arc<Run>,
    quantity: Quantity,
    (points, t): (&[f64], f64),
) -> Result<Vec<f64>, Error> {
    let (watched, n) = (system.watched(run)?, system.dimension);
    let (mut h, mut d) = (vec![0.0; n], DMatrix::zeros(n, n));
    let mut values = Vec::new();
    for p in points.chunks_exact(n) {
        if run.is_stopped() {
            break;
        }
        match quantity {
            Quantity::Field => {
                watched.field_at(t, &watched.piece(p), p, &mut h);
                values.extend_from_slice(&h);
            }
            Quantity::Jacobian => {
                watched.linearize_at(t, &watched.piece(p), p, &mut h, &mut d);
                values.extend(by_rows(&d));
            }
            Quantity::Hamiltonian => values.push(watched.hamiltonian(p)),
            Quantity::RunningCost => values.push(watched.running_cost(p)),
            Quantity::Control => {
                let mut u = vec![0.0; system.n_controls];
                watched.control_into(p, &mut u)?;
                values.extend(u);
            }
        }
        if values.iter().rev().take(n * n).any(|x| !x.is_finite()) {
            let why = watched.fault(p).unwrap_or(SystemError::NoValue { quantity: quantity.name() });
            return Err(why.into());
        }
    }
    Ok(values)
}

value! {
    impl System {
        /// int: States and costates together.
        dimension: usize = |own| own.dimension;
        /// int: Number of controls.
        n_controls: usize = |own| own.n_controls;
        /// Model or None: The tree whose motions they are, where it is one of `arm` or `tree`.
        model: Result<Option<Py<Model>>, Error> = |own, py| match &own.origin {
            Origin::Tree(given) => Ok(Some(given.model.clone_ref(py))),
            Origin::Arm(arm) => Ok(Some(Py::new(py, Model::of(arm.arm().model()?))?)),
            Origin::Callables(_)
            | Origin::Problem(_)
            | Origin::LinearRegulator
            | Origin::CubicRegulator
            | Origin::Traced(_)
            | Origin::Posed(_) => Ok(None),
        };
    }
}

#[pymethods]
impl System {
    #[new]
    #[pyo3(signature = (
        field, jacobian, dimension, *, hamiltonian=None, control=None, running_cost=None, n_controls=1
    ))]
    pub(super) fn new(
        field: &Bound<'_, PyAny>,
        jacobian: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = whole::dimension)] dimension: usize,
        hamiltonian: Option<&Bound<'_, PyAny>>,
        control: Option<&Bound<'_, PyAny>>,
        running_cost: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = whole::n_controls)] n_controls: usize,
    ) -> Result<Self, Error> {
        expect_dimension("dimension", dimension)?;
        if !(1..=MOST_CONTROLS).contains(&n_controls) {
            return Err(Error::input(format!(
                "`n_controls` must be between 1 and {MOST_CONTROLS}, found {n_controls}"
            )));
        }
        let callable = |name: &str, value: &Bound<'_, PyAny>| {
            check_callable(name, "of p", value).map(|()| value.clone().unbind())
        };
        let optional = |name: &str, value: Option<&Bound<'_, PyAny>>| {
            value.map(|value| callable(name, value)).transpose()
        };
        let callables = Arc::new(Callables {
            field: callable("field", field)?,
            jacobian: callable("jacobian", jacobian)?,
            hamiltonian: optional("hamiltonian", hamiltonian)?,
            control: optional("control", control)?,
            running_cost: optional("running_cost", running_cost)?,
            dimension,
            n_controls,
        });
        let description = format!("callables of dimension {dimension}");
        Ok(Self { dimension, n_controls, description, origin: Origin::Callables(callables) })
    }

    /// A traced field: a function of the blocks `x` and `t`, what it is in words, and the call that makes the system again.
    #[staticmethod]
    fn _of_traced(
        function: &Bound<'_, CompiledFunction>,
        description: String,
        origin: [Py<PyAny>; 2],
    ) -> Result<Self, Error> {
        let field = Arc::new(TracedField::try_new(&function.get().function)?);
        let dimension = expect_dimension("states", field.dimension())?;
        Ok(Self { dimension, n_controls: 0, description, origin: Origin::Traced(Traced { field, origin }) })
    }

    /// The system of a `ControlProblem`, what it is in words, and the call that makes it again.
    #[staticmethod]
    fn _of_problem(
        problem: &TracedProblem,
        description: String,
        origin: [Py<PyAny>; 2],
    ) -> Result<Self, Error> {
        let problem = problem.problem(Vec::new(), &Arc::default())?;
        let system = Arc::new(StateCostate::of_problem(&problem)?);
        let [n, n_controls] = system.problem().sizes();
        let dimension = expect_dimension("problem", 2 * n)?;
        Ok(Self { dimension, n_controls, description, origin: Origin::Posed(Posed { system, origin }) })
    }

    /// h(p) = dp/dt.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,) or (m, dimension)
    /// t : float, optional
    ///     Time, for a field that depends on it.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (dimension,) or (m, dimension)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> ftla.linear_regulator().field([1.0, 0.5])
    /// array([-1.5, -0.5])
    #[pyo3(signature = (p, t=0.0))]
    fn field<'py>(&self, py: Python<'py>, p: &Bound<'py, PyAny>, t: f64) -> Result<Bound<'py, PyAny>, Error> {
        self.evaluate(py, Quantity::Field, p, t)
    }

    /// D = ∂h/∂p (thesis (8.11)).
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,) or (m, dimension)
    /// t : float, optional
    ///     Time, for a field that depends on it.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (dimension, dimension) or (m, dimension, dimension)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> ftla.cubic_regulator().jacobian([1.0, 0.5])
    /// array([[-3., -1.],
    ///        [ 2.,  3.]])
    #[pyo3(signature = (p, t=0.0))]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        p: &Bound<'py, PyAny>,
        t: f64,
    ) -> Result<Bound<'py, PyAny>, Error> {
        self.evaluate(py, Quantity::Jacobian, p, t)
    }

    /// The Hamiltonian at the optimal control, constant along motions.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,) or (m, dimension)
    ///
    /// Returns
    /// -------
    /// float or ndarray, shape (m,)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> ftla.linear_regulator().hamiltonian([[1.0, 0.5], [0.0, 0.0]])
    /// array([-0.125,  0.   ])
    fn hamiltonian<'py>(&self, py: Python<'py>, p: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.evaluate(py, Quantity::Hamiltonian, p, 0.0)
    }

    /// The optimal control u*(p).
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,) or (m, dimension)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_controls,) or (m, n_controls)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> ftla.linear_regulator().control([1.0, 0.5])
    /// array([-0.5])
    fn control<'py>(&self, py: Python<'py>, p: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.evaluate(py, Quantity::Control, p, 0.0)
    }

    /// The running cost at the optimal control.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,) or (m, dimension)
    ///
    /// Returns
    /// -------
    /// float or ndarray, shape (m,)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> ftla.linear_regulator().running_cost([1.0, 0.5])
    /// 0.625
    fn running_cost<'py>(&self, py: Python<'py>, p: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.evaluate(py, Quantity::RunningCost, p, 0.0)
    }

    fn __repr__(&self) -> String {
        format!("<System: {}>", brief(&self.description, 180))
    }
}
