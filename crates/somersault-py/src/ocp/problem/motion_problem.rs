//! A motion problem by shooting.

use super::recipe::Program;
use super::recipe::Recipe;
use super::shared::Shared;
use super::{Constraint, Cost, Motion, Phase};
use crate::core::convert::{
    array, entries, entries_or_none, finite_all, integer, integer_or_none, with_shape,
};
use crate::core::error::Error;
use crate::core::memory::{bytes_of_numbers, expect_room};
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::returns_interrupted;
use crate::multibody::model::Model;
use crate::ocp::arguments::{count, seed_of, starts_or_none};
use crate::ocp::search::{SearchArguments, SearchResult};
use crate::ocp::solver::{Report, SolverArguments, deadline};
use crate::ocp::swing_up::scheme_of;
use crate::ocp::verification::Verification;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice, PyType};
use somersault::nlp::{self, Nlp, samples};
use somersault::ocp::shooting::{self, Start};

/// A motion problem: passive joints follow the equations of motion, driven ones splines.
///
/// The decision vector z holds what is free of the start, the parameters of the splines, free durations and the starts of
/// segments; see `parts`.
///
/// Parameters
/// ----------
/// model : Model
///     The tree.
/// q, v : array_like, shape (n_positions,) and (n_velocities,)
///     Passive state at the start; what they hold for driven joints is not read.
/// phases : sequence of Phase
///     One after the other.
/// active : sequence of str or of bool
///     Driven bodies, or degrees of freedom.
/// drive : {'motion', 'torque'}, optional
///     Whether the splines are the motion of the driven joints, or their torques.
/// scheme : {'rk4', 'euler'}, optional
///     Runge–Kutta steps, on the group where joints rotate freely; or explicit Euler, as in the thesis.
/// costs : sequence of Cost, optional
/// constraints : sequence of Constraint, optional
/// free_positions, free_velocities : sequence of bool, shape (n_velocities,), optional
///     Degrees of freedom whose start is a variable.
/// lower, upper : array_like, shape (n_variables,), optional
///     Bounds on z beside those of free durations.
/// exact_hessian : bool, optional
///     The exact Hessian of the Lagrangian in place of that of Gauss and Newton: where joints are hinges or
///     sliders, durations fixed, and terms entries or displacements.
///
/// Raises
/// ------
/// InputError
///     If the parts do not fit each other, or bounds contradict.
///
/// Examples
/// --------
/// A cart swings its pendulum from rest to an angle of 0.3 rad:
///
/// >>> import numpy as np
/// >>> from somersault import multibody, ocp
/// >>> rest = [(end, r, 0.0) for end in ("start", "finish") for r in (0, 1)]
/// >>> phase = ocp.Phase(ocp.SplineMotion(1, 8, rest), 1.0, 20)
/// >>> effort = ocp.Cost(ocp.entries("torque", [0]))
/// >>> swing = ocp.Cost(ocp.displacement([0.0, np.pi - 0.3], [1]), 1e4, at="finish")
/// >>> problem = ocp.MotionProblem(
/// ...     multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"], costs=[effort, swing])
/// >>> report = problem.solve(np.full(problem.n_variables, 0.1))
/// >>> report.status, round(float(problem.motion(report.z).q[-1, 1]), 2)
/// ('converged', 2.85)
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct MotionProblem {
    recipe: Recipe,
    pub(super) shared: Shared,
    pub(super) n_variables: usize,
    pub(super) n_constraints: usize,
    calls_python: bool,
}

value! {
    impl MotionProblem {
        /// int: Length of z.
        n_variables: usize = |own| own.n_variables;
        /// list of str: A name for each constraint.
        constraint_names: Result<Vec<String>, Error> =
            |own, py| Ok(own.shared.acquire(py)?.constraint_names());
    }
}

#[pymethods]
impl MotionProblem {
    #[new]
    #[pyo3(signature = (
        model, q, v, phases, *, active, drive="motion", scheme="rk4", costs=vec![], constraints=vec![],
        free_positions=None, free_velocities=None, lower=None, upper=None, exact_hessian=false
    ))]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, Model>,
        q: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = entries)] phases: Vec<Py<Phase>>,
        active: &Bound<'_, PyAny>,
        drive: &str,
        scheme: &str,
        #[pyo3(from_py_with = entries)] costs: Vec<Py<Cost>>,
        #[pyo3(from_py_with = entries)] constraints: Vec<Py<Constraint>>,
        #[pyo3(from_py_with = entries_or_none)] free_positions: Option<Vec<bool>>,
        #[pyo3(from_py_with = entries_or_none)] free_velocities: Option<Vec<bool>>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        exact_hessian: bool,
    ) -> Result<Self, Error> {
        let tree = &model.get().model;
        let n = tree.n_velocities();
        let drives_motion = match drive {
            "motion" => true,
            "torque" => false,
            other => {
                return Err(Error::input(format!("`drive` must be 'motion' or 'torque', found '{other}'")));
            }
        };
        if phases.is_empty() {
            return Err(Error::input("`phases` must have at least one phase, found none".to_owned()));
        }
        let free = |argument: &str, free: Option<Vec<bool>>| match free {
            None => Ok(vec![false; n]),
            Some(free) if free.len() == n => Ok(free),
            Some(free) => {
                let found = free.len();
                Err::<_, Error>(Error::input(format!("`{argument}` must have {n} entries, found {found}")))
            }
        };
        let start = Start {
            position: finite_all("q", with_shape("q", &[tree.n_positions()], q)?)?,
            velocity: finite_all("v", with_shape("v", &[n], v)?)?,
            free_positions: free("free_positions", free_positions)?,
            free_velocities: free("free_velocities", free_velocities)?,
        };
        let recipe = Recipe {
            model: model.clone().unbind(),
            active: model.get().split(active).map_err(|error| error.within("active"))?.active().to_vec(),
            drives_motion,
            scheme: scheme_of(scheme)?,
            start,
            phases,
            costs,
            constraints,
            lower: lower.map(|bound| bound.clone().unbind()),
            upper: upper.map(|bound| bound.clone().unbind()),
            exact_hessian,
        };
        let problem = recipe.build(py)?;
        let calls_python = recipe.costs.iter().any(|cost| cost.get().term.get().calls_python())
            || recipe.constraints.iter().any(|constraint| constraint.get().term.get().calls_python());
        Ok(Self {
            n_variables: problem.structure().variables.len(),
            n_constraints: problem.structure().constraints.len(),
            shared: Shared::new(problem),
            calls_python,
            recipe,
        })
    }

    /// dict of str to slice or list of slice: Where z has its parts: ``'start'``, ``'parameters'`` of each phase,
    /// ``'durations'`` that are free, and ``'lifted'`` states.
    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>, Error> {
        let layout = self.shared.acquire(py)?.transcription().layout().clone();
        let slice = |range: &std::ops::Range<usize>| {
            // lengths of decision vectors are far below the limits of isize
            PySlice::new(py, range.start as isize, range.end as isize, 1)
        };
        let parts = PyDict::new(py);
        parts.set_item("start", slice(&layout.start))?;
        parts.set_item("parameters", layout.parameters.iter().map(slice).collect::<Vec<_>>())?;
        parts.set_item("durations", layout.durations.iter().flatten().copied().collect::<Vec<_>>())?;
        parts.set_item("lifted", layout.lifted.iter().map(slice).collect::<Vec<_>>())?;
        Ok(parts)
    }

    /// The cost.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// float
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody, ocp
    /// >>> phase = ocp.Phase(ocp.SplineMotion(1, 8, [("start", 0, 0.0)]), 1.0, 20)
    /// >>> effort = ocp.Cost(ocp.entries("torque", [0]))
    /// >>> problem = ocp.MotionProblem(
    /// ...     multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"], costs=[effort])
    /// >>> round(problem.cost(np.zeros(problem.n_variables)), 9)
    /// 0.0
    fn cost(&self, py: Python<'_>, z: &Bound<'_, PyAny>) -> Result<f64, Error> {
        let (z, mut constraints) = self.room(z)?;
        self.run(py, |problem| problem.evaluate(&z, &mut constraints))
    }

    /// The gradient of the cost.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_variables,)
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody, ocp
    /// >>> phase = ocp.Phase(ocp.SplineMotion(1, 8, [("start", 0, 0.0)]), 1.0, 20)
    /// >>> effort = ocp.Cost(ocp.entries("torque", [0]))
    /// >>> problem = ocp.MotionProblem(
    /// ...     multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"], costs=[effort])
    /// >>> z, step = np.full(problem.n_variables, 0.1), np.eye(problem.n_variables)[0] * 1e-5
    /// >>> difference = (problem.cost(z + step) - problem.cost(z - step)) / 2e-5
    /// >>> bool(np.isclose(problem.gradient(z)[0], difference))
    /// True
    fn gradient<'py>(&self, py: Python<'py>, z: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        Ok(numpy::PyArray1::from_vec(py, self.derivatives(py, z)?.0).into_any())
    }

    /// The constraints.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_constraints,)
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody, ocp
    /// >>> phase = ocp.Phase(ocp.SplineMotion(1, 8, [("start", 0, 0.0)]), 1.0, 20)
    /// >>> still = ocp.Constraint(ocp.entries("velocity"), 0.0, 0.0, at="finish")
    /// >>> problem = ocp.MotionProblem(
    /// ...     multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"], constraints=[still])
    /// >>> problem.constraints(np.zeros(problem.n_variables)).round(6) + 0.0
    /// array([0., 0.])
    fn constraints<'py>(&self, py: Python<'py>, z: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let (z, mut constraints) = self.room(z)?;
        self.run(py, |problem| problem.evaluate(&z, &mut constraints))?;
        Ok(numpy::PyArray1::from_vec(py, constraints).into_any())
    }

    /// The Jacobian of the constraints.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_constraints, n_variables)
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody, ocp
    /// >>> phase = ocp.Phase(ocp.SplineMotion(1, 8, [("start", 0, 0.0)]), 1.0, 20)
    /// >>> still = ocp.Constraint(ocp.entries("velocity"), 0.0, 0.0, at="finish")
    /// >>> problem = ocp.MotionProblem(
    /// ...     multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"], constraints=[still])
    /// >>> problem.jacobian(np.zeros(problem.n_variables)).shape
    /// (2, 7)
    fn jacobian<'py>(&self, py: Python<'py>, z: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let values = self.derivatives(py, z)?.1;
        let (shape, dense) = {
            let problem = self.shared.acquire(py)?;
            let pattern = &problem.structure().jacobian;
            let (m, n) = (pattern.n_rows, pattern.n_columns());
            let mut dense = vec![0.0; m * n];
            for column in 0..n {
                for k in pattern.columns[column]..pattern.columns[column + 1] {
                    dense[pattern.rows[k] * n + column] = values[k];
                }
            }
            ([m, n], dense)
        };
        Ok(array(py, dense, &shape)?.into_any())
    }

    /// Solves from a start.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,), or Report
    ///     Start; a report of an earlier solve gives its multipliers as well.
    /// solver : {'sqp', 'sqp_filter', 'sqp_bfgs', 'lbfgs', 'gradient_descent'}, optional
    ///     Sequential quadratic programming with the Hessian of the problem, steps accepted by a merit function, which is
    ///     cautious under strong penalties, or by a filter, which takes full steps along curved constraints; with a
    ///     quasi-Newton Hessian; the last two for problems without constraints.
    /// tol : float, optional
    ///     Of the residuals of the conditions of Karush, Kuhn and Tucker, scaled.
    /// max_iterations : int, optional
    /// max_evaluations : int, optional
    ///     Of cost and constraints.
    /// max_time : float, optional
    ///     s.
    /// callback : callable, optional
    ///     ``callback(iteration, z, cost, residual)`` after each step; the solve stops where it returns true.
    /// on_interrupt : {'raise', 'return'}, optional
    ///     What Ctrl-C does: raise with the best iterate as the attribute ``solution``, or return it.
    ///
    /// Returns
    /// -------
    /// Report
    ///     With the best iterate, whatever the status.
    ///
    /// Examples
    /// --------
    /// The minimum effort that moves a cart and its pendulum by 1 m in 1.5 s, from rest to rest:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import multibody, ocp
    /// >>> ends = [("start", 0, 0.0), ("start", 1, 0.0), ("finish", 0, 1.0), ("finish", 1, 0.0)]
    /// >>> phase = ocp.Phase(ocp.SplineMotion(1, 14, ends), 1.5, 50)
    /// >>> effort = ocp.Cost(ocp.entries("torque", [0]))
    /// >>> hangs = ocp.Constraint(ocp.displacement([0.0, np.pi], [1]), 0.0, 0.0, at="finish")
    /// >>> still = ocp.Constraint(ocp.entries("velocity", [1]), 0.0, 0.0, at="finish")
    /// >>> problem = ocp.MotionProblem(
    /// ...     multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"], costs=[effort],
    /// ...     constraints=[hangs, still])
    /// >>> report = problem.solve(np.zeros(problem.n_variables))
    /// >>> report.status, report.feasibility < 1e-6
    /// ('converged', True)
    #[pyo3(signature = (
        z, *, solver="sqp", tol=None, max_iterations=None, max_evaluations=None, max_time=None, callback=None,
        on_interrupt="raise"
    ))]
    fn solve(
        &self,
        py: Python<'_>,
        z: &Bound<'_, PyAny>,
        solver: &str,
        tol: Option<f64>,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] max_evaluations: Option<i64>,
        max_time: Option<f64>,
        callback: Option<&Bound<'_, PyAny>>,
        on_interrupt: &str,
    ) -> Result<Report, Error> {
        let start = match z.cast::<Report>() {
            Ok(report) => report.get().report.start(),
            Err(_) => self.room(z)?.0.into(),
        };
        let arguments = SolverArguments {
            solver,
            tol,
            max_iterations,
            max_evaluations,
            max_time,
            callback,
            on_interrupt,
        };
        let calls_python = self.calls_python;
        let motion = self.recipe.motion(py)?;
        let mut problem = self.shared.acquire(py)?;
        let found = arguments
            .solve(py, &mut *problem, &start, calls_python, |report| Some(motion.verifier(report)))?;
        let wrong_derivative = suspected(&mut problem, &found.report);
        Ok(Report { wrong_derivative, ..found })
    }

    /// Solves from many starts, in parallel, and gathers the distinct minima.
    ///
    /// The first start is `z`. Others are a Latin hypercube about it, within the bounds; the states of segments stay
    /// as they are there. The same arguments give the same minima for any number of threads. Functions in Python take
    /// turns.
    ///
    /// Parameters
    /// ----------
    /// n_starts : int, optional
    ///     Those of the library.
    /// z : array_like, shape (n_variables,), optional
    ///     By default the middle of bounds that are finite on both sides, which are then the range, and what is nearest to
    ///     zero otherwise.
    /// starts : array_like, shape (m, n_variables), optional
    ///     Others, numbered before these.
    /// seed : int, optional
    /// reach : float or array_like, shape (n_variables,), optional
    ///     How far the others are from `z` in each variable at most.
    /// distance_tol : float, optional
    ///     Two minima are the same if no variable differs by more, relative to its size where that is above 1.
    /// solver, tol, max_iterations, max_evaluations
    ///     As of `solve`, for each start.
    /// max_time : float, optional
    ///     Of all starts, s.
    /// on_interrupt : {'raise', 'return'}, optional
    ///     What Ctrl-C does: raise with what has been found as the attribute ``solution``, or return it.
    ///
    /// Returns
    /// -------
    /// SearchResult
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody, ocp
    /// >>> rest = [(end, r, 0.0) for end in ("start", "finish") for r in (0, 1)]
    /// >>> phase = ocp.Phase(ocp.SplineMotion(1, 8, rest), 1.0, 20)
    /// >>> effort = ocp.Cost(ocp.entries("torque", [0]))
    /// >>> swing = ocp.Cost(ocp.displacement([0.0, np.pi - 0.3], [1]), 1e4, at="finish")
    /// >>> problem = ocp.MotionProblem(
    /// ...     multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"], costs=[effort, swing])
    /// >>> found = problem.search(4, z=np.full(problem.n_variables, 0.1), reach=0.5)
    /// >>> found.success, found.best.status
    /// (True, 'converged')
    #[pyo3(signature = (
        n_starts=16, *, z=None, starts=None, seed=0, reach=None, distance_tol=1e-4, solver="sqp", tol=None,
        max_iterations=None, max_evaluations=None, max_time=None, on_interrupt="raise"
    ))]
    fn search(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = integer)] n_starts: i64,
        z: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = entries_or_none)] starts: Option<Vec<Bound<'_, PyAny>>>,
        #[pyo3(from_py_with = integer)] seed: i64,
        reach: Option<&Bound<'_, PyAny>>,
        distance_tol: f64,
        solver: &str,
        tol: Option<f64>,
        #[pyo3(from_py_with = integer_or_none)] max_iterations: Option<i64>,
        #[pyo3(from_py_with = integer_or_none)] max_evaluations: Option<i64>,
        max_time: Option<f64>,
        on_interrupt: &str,
    ) -> Result<SearchResult, Error> {
        let returned = returns_interrupted(on_interrupt)?;
        let (n_starts, seed) = (count("n_starts", n_starts, 0)?, seed_of(seed)?);
        let given = starts_or_none(starts, n_starts)?;
        expect_room("so many starts of `n_starts`", bytes_of_numbers(&[n_starts, self.n_variables()]))?;
        let from = |z: &Bound<'_, PyAny>| {
            self.room(z).map(|(z, _)| z.into()).map_err(|error| error.with_names(&[("z", "starts")]))
        };
        let mut all = given.iter().map(from).collect::<Result<Vec<nlp::Start>, Error>>()?;
        let (centre, range) = self.range(py, z, reach)?;
        if n_starts > 0 {
            all.push(centre.into());
            all.extend(samples(&range, n_starts - 1, seed)?);
        }
        let deadline = deadline(max_time)?;
        let arguments = SolverArguments {
            solver,
            tol,
            max_iterations,
            max_evaluations,
            max_time: None,
            callback: None,
            on_interrupt,
        };
        let arguments = SearchArguments { solver: arguments.solver()?, distance_tol, deadline, returned };
        let motion = self.recipe.motion(py)?;
        let make = || Python::attach(|py| self.recipe.build(py));
        let wrong = |report: &nlp::Report| suspected(&mut self.recipe.build(py).ok()?, report);
        arguments.run(py, &all, make, |report| report, |report| Some(motion.verifier(report)), wrong)
    }

    /// Integrates the motion of a decision vector again and accurately.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// Verification
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody, ocp
    /// >>> phase = ocp.Phase(ocp.SplineMotion(1, 8, [("start", 0, 0.0)]), 1.0, 20)
    /// >>> problem = ocp.MotionProblem(multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"])
    /// >>> problem.verify(np.zeros(problem.n_variables)).confirmed
    /// True
    fn verify(&self, py: Python<'_>, z: &Bound<'_, PyAny>) -> Result<Verification, Error> {
        let z = self.room(z)?.0;
        self.recipe.motion(py)?.verify(py, &z)
    }

    /// The motion that a decision vector makes.
    ///
    /// Parameters
    /// ----------
    /// z : array_like, shape (n_variables,)
    ///
    /// Returns
    /// -------
    /// Motion
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody, ocp
    /// >>> phase = ocp.Phase(ocp.SplineMotion(1, 8, [("start", 0, 0.0)]), 1.0, 20)
    /// >>> problem = ocp.MotionProblem(multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"])
    /// >>> problem.motion(np.zeros(problem.n_variables))
    /// <Motion: 21 nodes, t = 0 to 1 s>
    fn motion(&self, py: Python<'_>, z: &Bound<'_, PyAny>) -> Result<Motion, Error> {
        let (z, _) = self.room(z)?;
        self.recipe.motion(py)?.of(py, &z)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, recipe) = (slf.py(), &slf.get().recipe);
        let copy = |value: &Option<Py<PyAny>>| value.as_ref().map(|value| value.clone_ref(py));
        let Start { position, velocity, free_positions, free_velocities } = recipe.start.clone();
        let scheme = if recipe.scheme == shooting::Scheme::ExplicitEuler { "euler" } else { "rk4" };
        let choices = (
            recipe.active.clone(),
            if recipe.drives_motion { "motion" } else { "torque" },
            scheme,
            recipe.exact_hessian,
        );
        let arguments = (
            recipe.model.clone_ref(py),
            (numpy::PyArray1::from_vec(py, position), numpy::PyArray1::from_vec(py, velocity)),
            recipe.phases.iter().map(|phase| phase.clone_ref(py)).collect::<Vec<_>>(),
            choices,
            recipe.costs.iter().map(|cost| cost.clone_ref(py)).collect::<Vec<_>>(),
            recipe.constraints.iter().map(|constraint| constraint.clone_ref(py)).collect::<Vec<_>>(),
            (free_positions, free_velocities),
            (copy(&recipe.lower), copy(&recipe.upper)),
        );
        by_restore(slf, arguments)
    }

    /// A pickled problem.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        model: &Bound<'_, Model>,
        start: (Bound<'_, PyAny>, Bound<'_, PyAny>),
        phases: Vec<Py<Phase>>,
        choices: (Bound<'_, PyAny>, String, String, bool),
        costs: Vec<Py<Cost>>,
        constraints: Vec<Py<Constraint>>,
        free: (Vec<bool>, Vec<bool>),
        bounds: (Option<Bound<'_, PyAny>>, Option<Bound<'_, PyAny>>),
    ) -> Result<Self, Error> {
        let (active, drive, scheme, exact_hessian) = choices;
        Self::new(
            cls.py(),
            model,
            &start.0,
            &start.1,
            phases,
            &active,
            &drive,
            &scheme,
            costs,
            constraints,
            Some(free.0),
            Some(free.1),
            bounds.0.as_ref(),
            bounds.1.as_ref(),
            exact_hessian,
        )
    }

    fn __repr__(&self) -> String {
        format!("<MotionProblem: {} variables, {} constraints>", self.n_variables, self.n_constraints)
    }
}

/// What is said of a derivative that may be behind a solve that did not converge.
fn suspected(problem: &mut Program, report: &nlp::Report) -> Option<String> {
    // what has no value there has been said already
    let wrong =
        report.status.is_suspect().then(|| problem.wrong_derivative(&report.z).ok()).flatten().flatten();
    wrong.map(|wrong| wrong.to_string())
}
