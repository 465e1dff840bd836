//! What a search found of one phase.

use super::CollocationOutcome;
use super::outcome::unit_rows;
use crate::core::convert::{array, check_finite, times};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::multibody::model::Model;
use crate::ocp::solver::{Report, status_name, status_of};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use somersault::multibody;
use somersault::ocp::WrongDerivative;
use somersault::ocp::collocation::{
    Accuracy, CollocationReport, CollocationStatus, Confirmation, Mesh, MeshRecord, PhaseConfirmation,
    PhaseRows, PhaseSolution, RelativeErrors,
};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// Result of collocation of one phase. Rows belong to the collocation points; those of `t`, `x`, `q`, `v` and `costates` have the
/// end as a last row.
#[pyclass(frozen, extends = CollocationOutcome, module = "somersault.ocp")]
pub(crate) struct CollocationResult {
    pub(super) report: Arc<CollocationReport>,
    pub(super) subject: Subject,
}

/// What a motion is of.
#[derive(Clone)]
pub(super) struct Subject {
    /// The tree, if it is one.
    pub(super) model: Option<multibody::Model>,
    pub(super) states: Vec<String>,
    pub(super) controls: Vec<String>,
    pub(super) parameters: Vec<String>,
}

impl Subject {
    /// Whether state `i` is an integral, which follow the states of the problem.
    pub(super) fn is_integral(&self, i: usize) -> bool {
        self.states[i].starts_with("integral ")
    }

    /// States without integrals.
    pub(super) fn n_own_states(&self) -> usize {
        (0..self.states.len()).filter(|&i| !self.is_integral(i)).count()
    }
}

fn table<'py>(py: Python<'py>, rows: &[Vec<f64>]) -> PyResult<Bound<'py, PyAny>> {
    let shape = [rows.len(), rows.first().map_or(0, Vec::len)];
    Ok(array(py, rows.concat(), &shape)?.into_any())
}

/// Names of states, controls and parameters, and values of these.
type Named = (Vec<String>, Vec<String>, Vec<String>, Vec<f64>);
/// Status, cost, tolerance.
type Outcome = (String, f64, f64);
/// Bounds and points of a mesh, ends of the horizon.
type OnMesh = (Vec<f64>, Vec<usize>, (f64, f64));
/// Defects, error and state of one integration from start to end, violation and what it is of, running and end cost, cost.
type Confirmed = (Vec<f64>, f64, Vec<f64>, (f64, String), (f64, f64), f64);
/// Of a mesh: bounds, points, whether it was for a start, cost, errors, status, steps, seconds.
type Tried = (Vec<f64>, Vec<usize>, bool, f64, [f64; 5], String, usize, f64);

/// A derivative that is wrong: function, derivative, entry, numbers found and expected, place. Relative errors of values and derivatives.
type Remarks = (Option<(String, String, String, f64, f64, String)>, [f64; 2]);

impl CollocationResult {
    pub(super) fn of(
        py: Python<'_>,
        report: CollocationReport,
        subject: Subject,
        tol: f64,
    ) -> PyResult<Py<Self>> {
        let report = Arc::new(report);
        let outcome = CollocationOutcome::of(report.clone(), vec![subject.model.clone()], tol);
        let own = Self { report, subject };
        Py::new(py, PyClassInitializer::from(outcome).add_subclass(own))
    }

    /// The problem has one phase.
    pub(super) fn phase(&self) -> &PhaseSolution {
        &self.report.phases[0]
    }

    /// The states, quaternions among them of unit norm.
    fn unit_states(&self) -> Vec<Vec<f64>> {
        unit_rows(self.subject.model.as_ref(), &self.phase().states)
    }

    /// Some of the states of a tree.
    fn part<'py>(
        &self,
        py: Python<'py>,
        places: impl Fn(&multibody::Model) -> Range<usize>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(model) = &self.subject.model else { return Ok(None) };
        let places = places(model);
        let rows: Vec<Vec<f64>> = self.unit_states().iter().map(|x| x[places.clone()].to_vec()).collect();
        table(py, &rows).map(Some)
    }

    /// Costates of displacements of the joints.
    fn of_displacements<'py>(&self, py: Python<'py>) -> Result<Option<Bound<'py, PyAny>>, Error> {
        let Some(model) = &self.subject.model else { return Ok(None) };
        let n = model.n_positions();
        let mut rows = Vec::with_capacity(self.phase().states.len());
        for (x, costate) in self.phase().states.iter().zip(&self.phase().costates) {
            let mut row = vec![0.0; model.n_velocities()];
            model.derivatives_along(&x[..n], &costate[..n], &mut row)?;
            rows.push(row);
        }
        Ok(Some(table(py, &rows)?))
    }

    fn at<'py>(
        &self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        value: impl Fn(&PhaseSolution, f64) -> Vec<f64>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (single, times) = times("t", t)?;
        check_finite("t", &times)?;
        let rows: Vec<Vec<f64>> = times.iter().map(|&t| value(self.phase(), t)).collect();
        match (single, rows.first()) {
            (true, Some(row)) => Ok(numpy::PyArray1::from_slice(py, row).into_any()),
            _ => Ok(table(py, &rows)?),
        }
    }
}

value! {
    impl CollocationResult {
        /// Model or None: The tree that moves, with x = (q, v) and integrals after them; None for equations that are not those of a tree.
        model: Option<Model> = |own| own.subject.model.clone().map(Model::of);
        /// list of str: Names of the states, one for each column of `x`.
        state_names: Vec<String> = |own| own.subject.states.clone();
        /// list of str: Names of the controls, one for each column of `u`.
        control_names: Vec<String> = |own| own.subject.controls.clone();
        /// list of str: Names of the parameters.
        parameter_names: Vec<String> = |own| own.subject.parameters.clone();
        /// ndarray, shape (n_parameters,): Parameters, constant in time.
        parameters: Bound<'py, PyAny> =
            |own, py| numpy::PyArray1::from_slice(py, &own.phase().parameters).into_any();
        /// ndarray, shape (n + 1,): Times, s.
        t: Bound<'py, PyAny> = |own, py| numpy::PyArray1::from_slice(py, &own.phase().times).into_any();
        /// ndarray, shape (n + 1, n_states): States.
        x: PyResult<Bound<'py, PyAny>> = |own, py| table(py, &own.unit_states());
        /// ndarray, shape (n + 1, n_positions), or None: Configurations, the first entries of x, where the motion is that of a tree.
        q: PyResult<Option<Bound<'py, PyAny>>> = |own, py| own.part(py, |model| 0..model.n_positions());
        /// ndarray, shape (n + 1, n_velocities), or None: Velocities, which follow them.
        v: PyResult<Option<Bound<'py, PyAny>>> =
            |own, py| own.part(py, |model| model.n_positions()..model.n_positions() + model.n_velocities());
        /// ndarray, shape (n, n_controls): Controls at the times but the last, which is not a collocation point; `control` gives
        /// them at any time.
        u: PyResult<Bound<'py, PyAny>> = |own, py| table(py, &own.phase().controls);
        /// ndarray, shape (n + 1, n_states): Costates λ, the change of the lowest cost from there on with the state; NaN of splines, which
        /// have none. That of a quaternion is orthogonal to it; `joint_costates` has what it says of rotations.
        costates: PyResult<Bound<'py, PyAny>> = |own, py| table(py, &own.phase().costates);
        /// ndarray, shape (n + 1, n_velocities), or None: Costates of the joints of a tree, the change of the lowest cost with a displacement of
        /// each degree of freedom in the axes of the child, as velocities are; None for equations that are not those of a tree.
        joint_costates: Result<Option<Bound<'py, PyAny>>, Error> = |own, py| own.of_displacements(py);
        /// ndarray, shape (n,): Hamiltonian L + λᵀ ẋ.
        hamiltonian: Bound<'py, PyAny> =
            |own, py| numpy::PyArray1::from_slice(py, &own.phase().hamiltonian).into_any();
        /// float: Largest minus smallest Hamiltonian; zero for the optimum.
        hamiltonian_spread: f64 = |own| own.phase().hamiltonian_spread();
        /// ndarray, shape (n_intervals,): Relative error at the end of each interval of the mesh, integrated accurately from
        /// its start; infinite where that stopped early.
        defects: Bound<'py, PyAny> =
            |own, py| numpy::PyArray1::from_slice(py, &own.report.confirmation.phases[0].defects).into_any();
        /// float: Relative error at the end of the motion, integrated from its start in one piece. It grows where the motion
        /// is hyper-sensitive, however good the solution is.
        terminal_error: f64 = |own| own.report.confirmation.end_to_end_error();
    }
}

#[pymethods]
impl CollocationResult {
    /// States at times, by the polynomials of collocation.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///     Times outside of the motion count as its ends.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_states,) or (m, n_states)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody, ocp
    /// >>> block = multibody.Link("block", joint="prismatic", axis=(1, 0, 0), mass=1.0)
    /// >>> model = multibody.Model([block], gravity=(0, 0, 0))
    /// >>> effort = lambda x, u: 0.5 * u.u_block**2
    /// >>> found = ocp.ControlProblem(model, initial=[0, 0], final=[1, 0], running_cost=effort).solve()
    /// >>> found.state([0.0, 0.5, 1.0]).round(4) + 0.0
    /// array([[0. , 0. ],
    ///        [0.5, 1.5],
    ///        [1. , 0. ]])
    fn state<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let model = self.subject.model.as_ref();
        self.at(py, t, |phase, t| unit_rows(model, &[phase.state(t)]).swap_remove(0))
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
    /// >>> from somersault import multibody, ocp
    /// >>> block = multibody.Link("block", joint="prismatic", axis=(1, 0, 0), mass=1.0)
    /// >>> model = multibody.Model([block], gravity=(0, 0, 0))
    /// >>> effort = lambda x, u: 0.5 * u.u_block**2
    /// >>> found = ocp.ControlProblem(model, initial=[0, 0], final=[1, 0], running_cost=effort).solve()
    /// >>> found.control([0.25, 0.75]).round(4)
    /// array([[ 3.],
    ///        [-3.]])
    fn control<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.at(py, t, PhaseSolution::control)
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
    /// >>> from somersault import multibody, ocp
    /// >>> block = multibody.Link("block", joint="prismatic", axis=(1, 0, 0), mass=1.0)
    /// >>> model = multibody.Model([block], gravity=(0, 0, 0))
    /// >>> effort = lambda x, u: 0.5 * u.u_block**2
    /// >>> found = ocp.ControlProblem(model, initial=[0, 0], final=[1, 0], running_cost=effort).solve()
    /// >>> found.costate(0.25).round(3)
    /// array([-12.,  -3.])
    fn costate<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        self.at(py, t, PhaseSolution::costate)
    }

    /// list of dict: All meshes: ``n_intervals``, ``n_points``, ``is_start`` (whether splines, or minimum effort on a fixed
    /// horizon, were sought for a start, or a saddle was left, with no estimated errors), ``cost``, estimated errors, relative, of the states (``error``),
    /// the cost (``cost_error``), the costates (``costate_error``) and the Hamiltonian (``hamiltonian_error``), the ``violation`` of
    /// bounds of states between the points, ``status`` of the program, ``nit`` and ``seconds``.
    #[getter]
    fn meshes<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let record = |record: &MeshRecord| {
            let entry = PyDict::new(py);
            entry.set_item("n_intervals", record.meshes[0].n_intervals())?;
            entry.set_item("n_points", record.meshes[0].n_points())?;
            entry.set_item("is_start", record.is_start)?;
            entry.set_item("cost", record.cost)?;
            let Accuracy { equations, cost, costates, hamiltonian, violation } = record.accuracy;
            entry.set_item("error", equations)?;
            entry.set_item("cost_error", cost)?;
            entry.set_item("costate_error", costates)?;
            entry.set_item("hamiltonian_error", hamiltonian)?;
            entry.set_item("violation", violation)?;
            entry.set_item("status", status_name(record.status))?;
            entry.set_item("nit", record.iterations)?;
            entry.set_item("seconds", record.time.as_secs_f64())?;
            Ok(entry)
        };
        self.report.history.iter().map(record).collect()
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        format!("<CollocationResult: {}>", slf.as_super().get().summary())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (own, outcome) = (slf.get(), slf.as_super().get());
        let (report, phase) = (&own.report, own.phase());
        let confirmed = &report.confirmation.phases[0];
        let tables = [&phase.states, &phase.controls, &phase.costates, &phase.path_multipliers];
        let tables = tables.map(|rows| rows.clone());
        let tried = |record: &MeshRecord| -> Tried {
            let mesh = &record.meshes[0];
            let (status, seconds) = (status_name(record.status).to_owned(), record.time.as_secs_f64());
            let points = mesh.points().to_vec();
            let Accuracy { equations, cost, costates, hamiltonian, violation } = record.accuracy;
            let errors = [equations, cost, costates, hamiltonian, violation];
            let (bounds, is_start) = (mesh.bounds().to_vec(), record.is_start);
            (bounds, points, is_start, record.cost, errors, status, record.iterations, seconds)
        };
        let on_mesh: OnMesh =
            (phase.mesh().bounds().to_vec(), phase.mesh().points().to_vec(), phase.horizon());
        let integrated: Confirmed = (
            confirmed.defects.clone(),
            confirmed.end_to_end_error,
            confirmed.end_to_end_state.clone(),
            (confirmed.violation, confirmed.violated.clone()),
            (confirmed.running_cost, confirmed.end_cost),
            report.confirmation.cost,
        );
        let wrong = report.wrong_derivative.clone();
        let wrong = wrong.map(|WrongDerivative { function, derivative, entry, found, expected, place }| {
            (function, derivative, entry, found, expected, place)
        });
        let remarks: Remarks = (wrong, [report.relative_errors.values, report.relative_errors.derivatives]);
        let arguments = (
            own.model(),
            (own.state_names(), own.control_names(), own.parameter_names(), phase.parameters.clone()),
            (outcome.status(), report.cost, outcome.tol),
            on_mesh,
            tables,
            phase.hamiltonian.clone(),
            integrated,
            report.history.iter().map(tried).collect::<Vec<_>>(),
            Report { report: report.program.clone(), verifier: None, wrong_derivative: None },
            remarks,
            report.origin.clone(),
        );
        by_restore(slf, arguments)
    }

    /// A pickled result.
    #[classmethod]
    #[pyo3(signature = (model, subject, outcome, on_mesh, tables, hamiltonian, integrated, history, program, remarks=None, origin=None))]
    fn _restore(
        cls: &Bound<'_, PyType>,
        model: Option<&Bound<'_, Model>>,
        subject: Named,
        outcome: Outcome,
        on_mesh: OnMesh,
        tables: [Vec<Vec<f64>>; 4],
        hamiltonian: Vec<f64>,
        integrated: Confirmed,
        history: Vec<Tried>,
        program: &Bound<'_, Report>,
        remarks: Option<Remarks>,
        origin: Option<String>,
    ) -> Result<Py<Self>, Error> {
        let (wrong, [values, derivatives]) = remarks.unwrap_or_default();
        let (status, cost, tol) = outcome;
        let status = match status.as_str() {
            "converged" => CollocationStatus::Converged,
            "false_convergence" => CollocationStatus::FalseConvergence,
            "mesh_limit" => CollocationStatus::MeshLimit,
            "no_minimum" => CollocationStatus::NoMinimum,
            other => CollocationStatus::NotSolved(status_of(other)?),
        };
        let (bounds, points, horizon) = on_mesh;
        let [states, controls, costates, path_multipliers] = tables;
        let (state_names, control_names, parameter_names, parameters) = subject;
        let rows = PhaseRows { states, controls, costates, path_multipliers, hamiltonian, parameters };
        let mesh = Mesh::try_new(bounds, points)?;
        let (defects, end_to_end_error, end_to_end_state, violation, costs, accurate) = integrated;
        let ((violation, violated), (running_cost, end_cost)) = (violation, costs);
        if defects.len() != mesh.n_intervals() {
            let (n, found) = (mesh.n_intervals(), defects.len());
            return Err(Error::input(format!("`defects` must have {n} entries, found {found}")));
        }
        let phase = PhaseSolution::try_new(mesh, horizon, rows)?;
        let subject = Subject {
            model: model.map(|model| model.get().model.clone()),
            states: state_names,
            controls: control_names,
            parameters: parameter_names,
        };
        let of_tree = subject.model.as_ref().map(|model| model.n_positions() + model.n_velocities());
        // integrals may follow
        let width = subject.states.len();
        for (argument, n, found) in [
            ("states", of_tree.filter(|n| *n > width).unwrap_or(width), phase.states[0].len()),
            ("state_names", phase.states[0].len(), subject.states.len()),
            ("control_names", phase.controls.first().map_or(0, Vec::len), subject.controls.len()),
            ("parameter_names", phase.parameters.len(), subject.parameters.len()),
        ] {
            if n != found {
                return Err(Error::input(format!("`{argument}` must have {n} columns, found {found}")));
            }
        }
        let tried = |(bounds, points, is_start, cost, errors, status, iterations, seconds): Tried| {
            let time = Duration::try_from_secs_f64(seconds)
                .map_err(|_| Error::input(format!("`seconds` must not be negative, found {seconds}")))?;
            let meshes = vec![Mesh::try_new(bounds, points)?];
            let [equations, of_cost, costates, hamiltonian, violation] = errors;
            let accuracy = Accuracy { equations, cost: of_cost, costates, hamiltonian, violation };
            Ok(MeshRecord { meshes, is_start, cost, accuracy, status: status_of(&status)?, iterations, time })
        };
        let confirmed = PhaseConfirmation {
            defects,
            end_to_end_error,
            end_to_end_state,
            violation,
            violated,
            running_cost,
            end_cost,
        };
        let report = CollocationReport {
            status,
            phases: vec![phase],
            cost,
            confirmation: Confirmation { phases: vec![confirmed], cost: accurate },
            history: history.into_iter().map(tried).collect::<Result<_, Error>>()?,
            program: program.get().report.clone(),
            wrong_derivative: wrong.map(|(function, derivative, entry, found, expected, place)| {
                WrongDerivative { function, derivative, entry, found, expected, place }
            }),
            relative_errors: RelativeErrors { values, derivatives },
            origin: origin.unwrap_or_default(),
        };
        Ok(Self::of(cls.py(), report, subject, tol)?)
    }
}
