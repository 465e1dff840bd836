//! State and transition matrix together.

use super::argument::whole;
use super::chain::{Chain, Transition};
use super::dimension::{rows_array, vector};
use super::error::of_motion;
use super::run::{attend, attend_with_rest};
use super::spectrum::{Spectrum, direction_of};
use super::system::System;
use super::watched::Watched;
use crate::core::convert::{array, real_numbers};
use crate::core::error::Error;
use crate::core::rows::Rows;
use crate::core::value::{Pickled, by_restore};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyType;
use rayon::prelude::*;
use somersault::ftla::budget::Limits;
use somersault::ftla::flow::{self, FlowError, FlowTolerances};
use somersault::ftla::nalgebra::DVector;
use somersault::ftla::spectrum::spectra;
use somersault::ftla::system::{Piece, Side, VectorField};

/// Steps of a run, unless a user allows another number.
const MAX_STEPS: usize = 100_000;

/// Accuracy and length of runs.
#[derive(Clone, Copy)]
pub(crate) struct Settings {
    pub(crate) tolerances: FlowTolerances,
    pub(crate) max_steps: usize,
}

/// Settings as they are pickled: `rtol`, `atol` and `max_steps`.
pub(crate) type Plain = (f64, f64, usize);

impl Settings {
    /// What is pickled of them.
    pub(crate) fn plain(&self) -> Plain {
        (self.tolerances.relative, self.tolerances.absolute, self.max_steps)
    }

    /// Pickled settings.
    pub(crate) fn of_plain((rtol, atol, max_steps): Plain) -> Result<Self, Error> {
        Ok(Self { tolerances: tolerances_of(rtol, atol)?, max_steps })
    }

    /// Runs of the usual length.
    pub(crate) fn new(tolerances: FlowTolerances) -> Self {
        Self { tolerances, max_steps: MAX_STEPS }
    }

    /// The flow of a system in a run.
    pub(crate) fn flow<'a>(
        &self,
        system: &'a Watched,
    ) -> Result<flow::VariationalFlow<'a, Watched>, FlowError> {
        Ok(flow::VariationalFlow::try_new(system, self.tolerances)?.with_max_steps(self.max_steps))
    }
}

/// FlowTolerances by the names that they have in Python.
pub(crate) fn tolerances_of(rtol: f64, atol: f64) -> Result<FlowTolerances, Error> {
    if !(1e-15..=0.1).contains(&rtol) {
        return Err(Error::input(format!("`rtol` must be from 1e-15 to 0.1, found {rtol}")));
    }
    if !atol.is_finite() || atol < 0.0 {
        return Err(Error::input(format!("`atol` must be finite and not negative, found {atol}")));
    }
    Ok(FlowTolerances { relative: rtol, absolute: atol })
}

/// Integrates a system with its transition matrix, forward and, for a negative duration, backward.
///
/// DOP853, its steps controlled by both: the state relative to each of its entries, Φ relative to the largest entry of each
/// column.
///
/// Parameters
/// ----------
/// system : System
/// rtol : float, optional
///     Estimated error of one step relative to each entry of the state and each column of Φ, from 1e-15 to 0.1. The error of a
///     run is that of its steps, each carried on by the Φ that follows it: up to the number of steps times ``rtol`` times the
///     growth of Φ. For an error of a run, compare with a run at a hundredth of the tolerance.
/// atol : float, optional
///     Error of one step that is always allowed in an entry of the state.
/// max_steps : int, optional
///     Of a run.
/// start : float, optional
///     Time of a field that depends on it, at the start of runs.
///
/// Raises
/// ------
/// EvaluationError
///     By whatever integrates, where the field has no value.
/// IntegrationError
///     Where steps become too small or too many. Both have ``t``, the time since the start, and ``state``, the last one.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import ftla
/// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
/// >>> found = flow.transition([1.0, 0.4], 2.0)
/// >>> bool(np.isclose(np.linalg.det(found.matrix), 1.0))
/// True
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct VariationalFlow {
    pub(crate) system: Py<System>,
    pub(crate) settings: Settings,
    /// Time at the start of runs.
    start: f64,
}

/// Transitions from points, one after the other, in parallel.
fn transitions(
    flow: &flow::VariationalFlow<'_, Watched>,
    points: &[f64],
    duration: f64,
) -> Result<Vec<Transition>, Error> {
    let n = flow.system().dimension();
    let propagated = points.par_chunks_exact(n).enumerate().map(|(row, p)| {
        let which = if points.len() == n { String::new() } else { format!("row {row}: ") };
        flow.transition(&vector(p), duration).map(Transition::of).map_err(|error| of_motion(&which, error))
    });
    propagated.collect()
}

/// What Python calls the sides of switches.
fn sides(piece: &Piece, n_controls: usize) -> Vec<&'static str> {
    let named = |i: usize| match piece.side(i) {
        Side::Lower => "lower",
        Side::Free => "free",
        Side::Upper => "upper",
    };
    (0..n_controls).map(named).collect()
}

impl VariationalFlow {
    /// Calculates with the flow of the library, in a run of its own.
    pub(super) fn attend<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(flow::VariationalFlow<'_, Watched>) -> Result<T, Error> + Send,
    ) -> Result<T, Error> {
        let (system, settings, start) = (self.system.get(), self.settings, self.start);
        attend(py, |run| work(settings.flow(&system.watched(run)?)?.starting_at(start)))
    }

    /// As `attend` within limits, for work that gives what it has where it ends early: with what was raised.
    pub(super) fn attend_with_rest<T: Send>(
        &self,
        py: Python<'_>,
        limits: Limits,
        work: impl FnOnce(flow::VariationalFlow<'_, Watched>) -> Result<T, Error> + Send,
    ) -> Result<(T, Option<PyErr>), Error> {
        let (system, settings, start) = (self.system.get(), self.settings, self.start);
        let budget = limits.start();
        attend_with_rest(
            py,
            || budget.stop(),
            |run| work(settings.flow(&system.watched(run)?)?.starting_at(start).within(&budget)),
        )
    }

    /// A point of the system's dimension.
    pub(crate) fn point(&self, name: &'static str, p: &Bound<'_, PyAny>) -> Result<DVector<f64>, Error> {
        let rows = Rows::extract(name, &[self.system.get().dimension], p)?;
        if rows.is_many() {
            return Err(Error::input(format!("`{name}` must be one point, found many")));
        }
        Ok(vector(rows.all()?))
    }
}

#[pymethods]
impl VariationalFlow {
    #[new]
    #[pyo3(signature = (system, *, rtol=1e-12, atol=1e-14, max_steps=100_000, start=0.0))]
    fn new(
        system: Py<System>,
        rtol: f64,
        atol: f64,
        #[pyo3(from_py_with = whole::max_steps)] max_steps: usize,
        start: f64,
    ) -> Result<Self, Error> {
        let tolerances = tolerances_of(rtol, atol)?;
        if max_steps == 0 {
            return Err(Error::input("`max_steps` must be positive, found 0"));
        }
        if !start.is_finite() {
            return Err(Error::input(format!("`start` must be finite, found {start}")));
        }
        Ok(Self { system, settings: Settings { tolerances, max_steps }, start })
    }

    /// float: Time of a field that depends on it, at the start of runs.
    #[getter]
    fn start(&self) -> f64 {
        self.start
    }

    /// System: What is integrated.
    #[getter]
    fn system(&self, py: Python<'_>) -> Py<System> {
        self.system.clone_ref(py)
    }

    /// p(t + T), without Φ.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,)
    /// duration : float or array_like, shape (m,)
    ///     T, s. Each of many is a run of its own.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (dimension,) or (m, dimension)
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> flow.state([1.0, np.sqrt(2) - 1], [1.0, 2.0])[:, 0].round(6)
    /// array([0.243117, 0.059106])
    fn state<'py>(
        &self,
        py: Python<'py>,
        p: &Bound<'py, PyAny>,
        duration: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (p, (single, durations)) =
            (self.point("p", p)?, crate::core::convert::times("duration", duration)?);
        let ends = self.attend(py, |flow| {
            let ends = durations.par_iter().map(|&duration| flow.state(&p, duration));
            Ok(ends.collect::<Result<Vec<_>, _>>()?)
        })?;
        if single {
            return Ok(PyArray1::from_slice(py, ends[0].as_slice()).into_any());
        }
        Ok(rows_array(py, &ends, p.len())?)
    }

    /// p(t + T) and the cost on the way, by the weights of the steps; backward in time it is negative.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,)
    /// duration : float
    ///     T, s.
    ///
    /// Returns
    /// -------
    /// end : ndarray, shape (dimension,)
    /// cost : float
    ///
    /// Examples
    /// --------
    /// The cost from x = 1 along the stable manifold is λ/2:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> end, cost = flow.cost([1.0, np.sqrt(2) - 1], 8.0)
    /// >>> round(cost, 6), round((2**0.5 - 1) / 2, 6)
    /// (0.207107, 0.207107)
    fn cost<'py>(
        &self,
        py: Python<'py>,
        p: &Bound<'py, PyAny>,
        duration: f64,
    ) -> Result<(Bound<'py, PyAny>, f64), Error> {
        let p = self.point("p", p)?;
        let (end, cost) = self.attend(py, |flow| Ok(flow.cost(&p, duration)?))?;
        Ok((PyArray1::from_slice(py, end.as_slice()).into_any(), cost))
    }

    /// p(t + T) with Φ.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,)
    /// duration : float
    ///     T, s.
    ///
    /// Returns
    /// -------
    /// Transition
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> flow.transition([1.0, 0.4], 1.0).matrix.round(4)
    /// array([[ 0.8099, -1.3683],
    ///        [-1.3683,  3.5465]])
    fn transition(&self, py: Python<'_>, p: &Bound<'_, PyAny>, duration: f64) -> Result<Transition, Error> {
        let p = self.point("p", p)?;
        let mut found = self.attend(py, |flow| transitions(&flow, p.as_slice(), duration))?;
        Ok(found.remove(0))
    }

    /// Ends and transition matrices from many points at once, in parallel.
    ///
    /// `rtol` of the flow bounds the error of a step and not of a run, as `VariationalFlow` says.
    ///
    /// Parameters
    /// ----------
    /// points : array_like, shape (m, dimension)
    /// duration : float
    ///     T, s.
    ///
    /// Returns
    /// -------
    /// ends : ndarray, shape (m, dimension)
    /// matrices : ndarray, shape (m, dimension, dimension)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.cubic_regulator())
    /// >>> ends, matrices = flow.transitions([[1.0, 0.4], [0.5, 0.1], [0.0, 0.0]], 1.0)
    /// >>> ends.shape, matrices.shape
    /// ((3, 2), (3, 2, 2))
    fn transitions<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        duration: f64,
    ) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Error> {
        let n = self.system.get().dimension;
        let rows = Rows::extract("points", &[n], points)?;
        let all = rows.all()?;
        let found = self.attend(py, |flow| transitions(&flow, all, duration))?;
        let ends = found.iter().flat_map(|t| t.transition.end.iter().copied()).collect();
        let matrices = found.iter().flat_map(Transition::matrix_by_rows).collect();
        let m = found.len();
        Ok((array(py, ends, &[m, n])?.into_any(), array(py, matrices, &[m, n, n])?.into_any()))
    }

    /// Where controls reach and leave their bounds on the way, located to rounding.
    ///
    /// The field has a kink there and Φ no jump; steps end at each.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,)
    /// duration : float
    ///     T, s.
    ///
    /// Returns
    /// -------
    /// list of tuple
    ///     (time since the start, s; a list that says of each control ``'lower'``, ``'free'`` or ``'upper'`` from there on).
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ftla
    /// >>> system = ftla.state_costate(
    /// ...     lambda x, u: u, lambda x, u: 0.5 * (x @ x + u @ u), 1, 1, jacobian=lambda x, u: [[0.0, 1.0]],
    /// ...     gradient=lambda x, u: [x[0], u[0]], hessian=lambda x, u, costate: np.eye(2),
    /// ...     control_bounds=[[-0.5], [0.5]])
    /// >>> flow = ftla.VariationalFlow(system)
    /// >>> [(round(t, 4), where) for t, where in flow.switches([1.0, 1.0], 2.0)]
    /// [(0.5858, ['free'])]
    fn switches(
        &self,
        py: Python<'_>,
        p: &Bound<'_, PyAny>,
        duration: f64,
    ) -> Result<Vec<(f64, Vec<&'static str>)>, Error> {
        let (p, n_controls) = (self.point("p", p)?, self.system.get().n_controls);
        let found = self.attend(py, |flow| Ok(flow.switches(&p, duration)?))?;
        Ok(found.into_iter().map(|(t, piece)| (t, sides(&piece, n_controls))).collect())
    }

    /// Factors of Φ that keep its small singular values.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,)
    /// times : array_like, shape (m,)
    ///     Where factors are to end, s: ascending from above zero, or descending from below.
    /// growth : float, optional
    ///     How far a factor stretches or shrinks before the next begins: with 100, it loses four digits of sixteen.
    ///
    /// Returns
    /// -------
    /// Chain
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> flow.chain([1.0, 0.4], [5.0, 20.0])
    /// <Chain: 7 factors, to 20 s>
    #[pyo3(signature = (p, times, growth=100.0))]
    fn chain(
        &self,
        py: Python<'_>,
        p: &Bound<'_, PyAny>,
        times: &Bound<'_, PyAny>,
        growth: f64,
    ) -> Result<Chain, Error> {
        let (p, times) = (self.point("p", p)?, real_numbers("times", times)?);
        self.attend(py, |flow| {
            let mut chain = flow::Chain::new();
            flow.chain_into(&p, &times, growth, &mut chain)?;
            Ok(Chain::of(p.len(), &chain))
        })
    }

    /// Finite-time Lyapunov exponents and vectors for many averaging times, from one run.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,)
    /// times : array_like, shape (m,)
    ///     Averaging times T > 0, s, ascending.
    /// direction : {'forward', 'backward'}, optional
    ///
    /// Returns
    /// -------
    /// list of Spectrum
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> [spectrum.exponents.round(3).tolist() for spectrum in flow.spectra([1.0, 0.4], [1.0, 4.0])]
    /// [[-1.414, 1.414], [-1.414, 1.414]]
    #[pyo3(signature = (p, times, direction="forward"))]
    fn spectra(
        &self,
        py: Python<'_>,
        p: &Bound<'_, PyAny>,
        times: &Bound<'_, PyAny>,
        direction: &str,
    ) -> Result<Vec<Spectrum>, Error> {
        let direction = direction_of(direction)?;
        let (p, times) = (self.point("p", p)?, real_numbers("times", times)?);
        let found = self.attend(py, |flow| Ok(spectra(&flow, &p, direction, &times)?))?;
        Ok(found.into_iter().map(|spectrum| Spectrum { spectrum }).collect())
    }

    /// Finite-time Lyapunov exponents and vectors for one averaging time.
    ///
    /// Parameters
    /// ----------
    /// p : array_like, shape (dimension,)
    /// time : float
    ///     Averaging time T > 0, s.
    /// direction : {'forward', 'backward'}, optional
    ///
    /// Returns
    /// -------
    /// Spectrum
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> flow.spectrum([1.0, 0.4], 8.0).exponents.round(5)
    /// array([-1.41421,  1.41421])
    #[pyo3(signature = (p, time, direction="forward"))]
    fn spectrum(
        &self,
        py: Python<'_>,
        p: &Bound<'_, PyAny>,
        time: f64,
        direction: &str,
    ) -> Result<Spectrum, Error> {
        let times = PyArray1::from_slice(py, &[time]).into_any();
        Ok(self.spectra(py, p, &times, direction)?.remove(0))
    }

    fn __repr__(&self) -> String {
        let FlowTolerances { relative, absolute } = self.settings.tolerances;
        format!("<VariationalFlow: rtol {relative:e}, atol {absolute:e}>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        by_restore(slf, (own.system.bind(slf.py()), own.settings.plain(), own.start))
    }

    /// A pickled flow.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        system: Py<System>,
        settings: Plain,
        start: f64,
    ) -> Result<Self, Error> {
        let (rtol, atol, max_steps) = settings;
        Self::new(system, rtol, atol, max_steps, start)
    }
}
