//! Arcs of a collocation solution, made exact and certified.

use super::CollocationResult;
use super::result::Subject;
use crate::core::convert::{array, check_finite, times};
use crate::core::error::Error;
use crate::core::value::{counted, value};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::ocp::arcs::{Arc, ControlKind, Instant, Polished, Verdict};

/// Result of `ControlProblem.polish`: the arcs of a solution, exact to rounding, and what they are certified as.
///
/// Where no extremal was found the motion is that of collocation. It holds functions of its problem, and is not pickled: keep problem
/// and result of collocation, and polish again.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct PolishResult {
    pub(super) polished: Polished,
    pub(super) found: Py<CollocationResult>,
    pub(super) subject: Subject,
}

fn kind_name(kind: ControlKind) -> &'static str {
    match kind {
        ControlKind::Lower => "lower",
        ControlKind::Upper => "upper",
        ControlKind::Interior => "interior",
        ControlKind::Singular => "singular",
    }
}

impl PolishResult {
    fn verdict_name(&self) -> &'static str {
        match self.polished.verdict {
            Verdict::StrictMinimum => "strict_minimum",
            Verdict::ConjugatePoint { .. } => "conjugate_point",
            Verdict::NotMinimum { .. } => "not_minimum",
            Verdict::FirstOrder { .. } => "first_order",
            // verdicts to come certify nothing here
            _ => "refused",
        }
    }

    fn entry<'py>(&self, py: Python<'py>, arc: &Arc) -> PyResult<Bound<'py, PyDict>> {
        let entry = PyDict::new(py);
        entry.set_item("start", arc.start)?;
        entry.set_item("end", arc.end)?;
        let controls = PyDict::new(py);
        for (name, kind) in self.subject.controls.iter().zip(&arc.kind.controls) {
            controls.set_item(name, kind_name(*kind))?;
        }
        entry.set_item("controls", controls)?;
        entry.set_item("bound", arc.contact.as_deref())?;
        entry.set_item("jumps", numpy::PyArray1::from_slice(py, &arc.jumps))?;
        Ok(entry)
    }

    /// Rows of something at times; of the collocation solution where there is no extremal.
    fn at<'py>(
        &self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        of: impl Fn(Instant) -> Vec<f64>,
        instead: impl Fn(&CollocationResult, f64) -> Option<Vec<f64>>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (single, times) = times("t", t)?;
        check_finite("t", &times)?;
        let row = |t: f64| match self.polished.at(t) {
            Some(instant) => Ok(of(instant)),
            None => instead(self.found.get(), t)
                .ok_or_else(|| Error::evaluation("no extremal was found: see `message`")),
        };
        let rows = times.iter().map(|&t| row(t)).collect::<Result<Vec<_>, _>>()?;
        match (single, rows.first()) {
            (true, Some(row)) => Ok(numpy::PyArray1::from_slice(py, row).into_any()),
            _ => {
                let shape = [rows.len(), rows.first().map_or(0, Vec::len)];
                Ok(array(py, rows.concat(), &shape)?.into_any())
            }
        }
    }
}

value! {
    impl PolishResult {
        /// str: ``'strict_minimum'``, a strict local minimum by sufficient conditions of second order; ``'first_order'`` where
        /// all conditions of first order hold, Legendre and Clebsch's and Kelley's among them, and none of second order was
        /// decided; ``'conjugate_point'`` or ``'not_minimum'`` for another extremal; ``'refused'`` where no extremal was found.
        verdict: &'static str = |own| own.verdict_name();
        /// bool: Whether it is an extremal that nothing speaks against: ``'strict_minimum'`` or ``'first_order'``.
        success: bool = |own| own.polished.verdict.is_certified();
        /// float: Cost; that of collocation where there is no extremal.
        cost: f64 = |own| own.polished.cost;
        /// float: The largest residual of the equations of the arcs, relative to the sizes of states and costates; infinite where
        /// there are none.
        residual: f64 = |own| own.polished.residual;
        /// int: Steps of Newton's method.
        nit: usize = |own| own.polished.steps;
        /// float or None: Time of the conjugate point, where that is the verdict.
        conjugate_time: Option<f64> = |own| match own.polished.verdict {
            Verdict::ConjugatePoint { time } => Some(time),
            _ => None,
        };
        /// ndarray, shape (n_arcs − 1,): Times at which arcs join.
        junctions: Bound<'py, PyAny> = |own, py| {
            let inner: Vec<f64> = own.polished.arcs.iter().skip(1).map(|arc| arc.start).collect();
            numpy::PyArray1::from_vec(py, inner).into_any()
        };
        /// list of dict: The arcs in the order of time: ``start`` and ``end``; ``controls``, by name ``'lower'`` or ``'upper'`` at a
        /// bound, ``'interior'`` or ``'singular'``; ``bound``, the name of the state or path constraint that is at its bound, or None;
        /// ``jumps`` of the costates at its start, by the derivatives of that bound.
        arcs: PyResult<Vec<Bound<'py, PyDict>>> =
            |own, py| own.polished.arcs.iter().map(|arc| own.entry(py, arc)).collect();
        /// tuple of float: First and last time.
        horizon: (f64, f64) = |own| own.polished.horizon;
        /// ndarray, shape (n_parameters,): Parameters.
        parameters: Bound<'py, PyAny> =
            |own, py| numpy::PyArray1::from_slice(py, &own.polished.parameters).into_any();
        /// CollocationResult: What was polished.
        found: Py<CollocationResult> = |own, py| own.found.clone_ref(py);
        /// list of str: Names of the states.
        state_names: Vec<String> = |own| own.subject.states.clone();
        /// list of str: Names of the controls.
        control_names: Vec<String> = |own| own.subject.controls.clone();
    }
}

#[pymethods]
impl PolishResult {
    /// str: The verdict in a sentence, with the reason.
    #[getter]
    fn message(&self) -> String {
        self.polished.verdict.to_string()
    }

    /// States at times.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///     Times outside of the motion count as its ends; at a junction the arc that begins counts.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_states,) or (m, n_states)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> problem = ocp.ControlProblem(
    /// ...     lambda x, u: [x.v, u.force], states=("x", "v"), controls=("force",), initial=[0, 0],
    /// ...     final=[1, 0], duration=(0.1, 10), bounds={"force": (-1, 1)}, end_cost=lambda x, t: t)
    /// >>> problem.polish(problem.solve(tol=1e-4)).state(1.0).round(9)
    /// array([0.5, 1. ])
    fn state<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.at(py, t, |at| at.state, |found, t| Some(found.phase().state(t)))
    }

    /// Controls at times.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_controls,) or (m, n_controls)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> problem = ocp.ControlProblem(
    /// ...     lambda x, u: [x.v, u.force], states=("x", "v"), controls=("force",), initial=[0, 0],
    /// ...     final=[1, 0], duration=(0.1, 10), bounds={"force": (-1, 1)}, end_cost=lambda x, t: t)
    /// >>> problem.polish(problem.solve(tol=1e-4)).control([0.5, 1.5])
    /// array([[ 1.],
    ///        [-1.]])
    fn control<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.at(py, t, |at| at.control, |found, t| Some(found.phase().control(t)))
    }

    /// Costates at times.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_states,) or (m, n_states)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> problem = ocp.ControlProblem(
    /// ...     lambda x, u: [x.v, u.force], states=("x", "v"), controls=("force",), initial=[0, 0],
    /// ...     final=[1, 0], duration=(0.1, 10), bounds={"force": (-1, 1)}, end_cost=lambda x, t: t)
    /// >>> problem.polish(problem.solve(tol=1e-4)).costate(0.0).round(9)
    /// array([-1., -1.])
    fn costate<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.at(py, t, |at| at.costate, |found, t| Some(found.phase().costate(t)))
    }

    /// The slope of the Hamiltonian by each control: the switching function of one that the Hamiltonian is affine in.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_controls,) or (m, n_controls)
    ///
    /// Raises
    /// ------
    /// somersault.errors.EvaluationError
    ///     If no extremal was found.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> problem = ocp.ControlProblem(
    /// ...     lambda x, u: [x.v, u.force], states=("x", "v"), controls=("force",), initial=[0, 0],
    /// ...     final=[1, 0], duration=(0.1, 10), bounds={"force": (-1, 1)}, end_cost=lambda x, t: t)
    /// >>> problem.polish(problem.solve(tol=1e-4)).switching([0.0, 1.0, 2.0]).round(6).ravel() + 0.0
    /// array([-1.,  0.,  1.])
    fn switching<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.at(py, t, |at| at.slopes, |_, _| None)
    }

    /// Hamiltonian L + λᵀ ẋ at times.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (1,) or (m, 1)
    ///
    /// Raises
    /// ------
    /// somersault.errors.EvaluationError
    ///     If no extremal was found.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> problem = ocp.ControlProblem(
    /// ...     lambda x, u: [x.v, u.force], states=("x", "v"), controls=("force",), initial=[0, 0],
    /// ...     final=[1, 0], duration=(0.1, 10), bounds={"force": (-1, 1)}, end_cost=lambda x, t: t)
    /// >>> problem.polish(problem.solve(tol=1e-4)).hamiltonian(0.3).round(9)
    /// array([-1.])
    fn hamiltonian<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.at(py, t, |at| vec![at.hamiltonian], |_, _| None)
    }

    fn __repr__(&self) -> String {
        let arcs = counted(self.polished.arcs.len(), "arc", "arcs");
        let (verdict, cost) = (self.verdict_name(), self.polished.cost);
        format!("<PolishResult: {verdict}, {arcs}, cost {cost:.10}, residual {:.1e}>", self.polished.residual)
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "a PolishResult holds functions of its problem: keep that, and polish again",
        ))
    }
}
