//! State–costate systems, compiled or users' own.

use super::dimension::{DIMENSIONS, by_rows, for_dimension, no_such, vector};
use super::error::input;
use super::run::{Run, attend};
use super::watched::{Callables, Compiled, Source, Watched};
use crate::error::Error;
use crate::plan::check_callable;
use crate::rows::Rows;
use pyo3::prelude::*;
use somersault::ftla::system::{ArmMinimumTorque, HamiltonianSystem, OptimalControlSystem, VectorField};
use std::any::Any;
use std::sync::Arc;

/// Controls that a user's system may have: what is asked for beyond is a slip, and no memory is there for it.
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
///     ``jacobian(p) -> D``, of shape (dimension, dimension): ∂hᵢ/∂pⱼ.
/// dimension : int
///     States and costates together: 2, 4, 6, 8, 10, 12 or 16.
/// hamiltonian : callable, optional
///     ``hamiltonian(p) -> float``, for what needs it: a least-squares match, the spread along an extremal.
/// control : callable, optional
///     ``control(p) -> u``, of shape (n_controls,).
/// running_cost : callable, optional
///     ``running_cost(p) -> float``, for the cost of a motion.
/// n_controls : int, optional
///     Number of controls.
///
/// Raises
/// ------
/// FieldError
///     By whatever calls them, where a callable raises, which is then the cause, or the field is not finite.
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
    source: Box<dyn Any + Send + Sync>,
    /// The arm that it is of, if it is of one.
    pub(crate) arm: Option<ArmMinimumTorque>,
}

impl System {
    pub(super) fn compiled<const N: usize>(
        system: impl OptimalControlSystem<N> + Send + Sync + 'static,
        description: String,
    ) -> Self {
        let n_controls = system.n_controls();
        let shared: Compiled<N> = Arc::new(system);
        let source = Box::new(Source::Compiled(shared));
        Self { dimension: N, n_controls, description, source, arm: None }
    }

    /// The same, which is of this arm.
    pub(super) fn of_arm(self, arm: ArmMinimumTorque) -> Self {
        Self { arm: Some(arm), ..self }
    }

    /// The system for one run, where the dimension is N.
    pub(crate) fn watched<const N: usize>(&self, run: &Arc<Run>) -> Result<Watched<N>, Error> {
        match self.source.downcast_ref::<Source<N>>() {
            Some(source) => Ok(source.watched(run)),
            None => Err(input(format!("`system` must be of dimension {N}, found {}", self.dimension))),
        }
    }

    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        quantity: Quantity,
        p: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let n = self.dimension;
        let rows = Rows::extract("p", &[n], p)?;
        let points = rows.all()?;
        let values = attend(py, |run| for_dimension!(n, values(self, run, quantity, points)))??;
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
        Ok(crate::convert::array(py, values, &shape)?.into_any())
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

/// A quantity at each of the points, one after the other.
fn values<const N: usize>(
    system: &System,
    run: &Arc<Run>,
    quantity: Quantity,
    points: &[f64],
) -> Result<Vec<f64>, Error> {
    let watched = system.watched::<N>(run)?;
    let mut values = Vec::new();
    for point in points.chunks_exact(N) {
        if run.is_stopped() {
            break;
        }
        let p = vector::<N>(point);
        match quantity {
            Quantity::Field => values.extend_from_slice(watched.field(&p).as_slice()),
            Quantity::Jacobian => values.extend(by_rows(watched.jacobian(&p).as_slice(), N)),
            Quantity::Hamiltonian => values.push(watched.hamiltonian(&p)),
            Quantity::RunningCost => values.push(watched.running_cost(&p)),
            Quantity::Control => {
                let mut u = vec![0.0; system.n_controls];
                watched.control_into(&p, &mut u)?;
                values.extend(u);
            }
        }
        if values.iter().rev().take(N * N).any(|x| !x.is_finite())
            && let Some(why) = watched.fault(&p)
        {
            return Err(why.into());
        }
    }
    Ok(values)
}

#[pymethods]
impl System {
    #[new]
    #[pyo3(signature = (
        field, jacobian, dimension, *, hamiltonian=None, control=None, running_cost=None, n_controls=1
    ))]
    fn new(
        field: &Bound<'_, PyAny>,
        jacobian: &Bound<'_, PyAny>,
        dimension: usize,
        hamiltonian: Option<&Bound<'_, PyAny>>,
        control: Option<&Bound<'_, PyAny>>,
        running_cost: Option<&Bound<'_, PyAny>>,
        n_controls: usize,
    ) -> Result<Self, Error> {
        if !DIMENSIONS.contains(&dimension) {
            return Err(no_such("dimension", dimension));
        }
        if !(1..=MOST_CONTROLS).contains(&n_controls) {
            return Err(input(format!(
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
            n_controls,
        });
        fn boxed<const N: usize>(callables: Arc<Callables>) -> Result<Box<dyn Any + Send + Sync>, Error> {
            Ok(Box::new(Source::<N>::Callables(callables)))
        }
        let source = for_dimension!(dimension, boxed(callables))?;
        let description = format!("callables of dimension {dimension}");
        Ok(Self { dimension, n_controls, description, source, arm: None })
    }

    /// int: States and costates together.
    #[getter]
    fn dimension(&self) -> usize {
        self.dimension
    }

    /// int: Number of controls.
    #[getter]
    fn n_controls(&self) -> usize {
        self.n_controls
    }

    /// h(p) = dp/dt.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,) or (m, dimension)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (dimension,) or (m, dimension)
    fn field<'py>(&self, py: Python<'py>, p: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.evaluate(py, Quantity::Field, p)
    }

    /// D = ∂h/∂p (thesis (8.11)).
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,) or (m, dimension)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (dimension, dimension) or (m, dimension, dimension)
    fn jacobian<'py>(&self, py: Python<'py>, p: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.evaluate(py, Quantity::Jacobian, p)
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
    fn hamiltonian<'py>(&self, py: Python<'py>, p: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.evaluate(py, Quantity::Hamiltonian, p)
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
    fn control<'py>(&self, py: Python<'py>, p: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.evaluate(py, Quantity::Control, p)
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
    fn running_cost<'py>(&self, py: Python<'py>, p: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.evaluate(py, Quantity::RunningCost, p)
    }

    fn __repr__(&self) -> String {
        format!("<System: {}>", self.description)
    }
}
