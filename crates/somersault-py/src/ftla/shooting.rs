//! Extremals by multiple shooting.

use super::argument::{limits_of, whole};
use super::chain::{Chain, Transition};
use super::dimension::{rows_array, vector};
use super::flow::{Plain, Settings, tolerances_of};
use super::run::{Run, attend};
use super::system::System;
use crate::core::convert::{array, check_finite, finite_all, real_numbers, times};
use crate::core::error::Error;
use crate::core::rows::Rows;
use crate::core::value::{Pickled, by_restore, value};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ftla::budget::Limits;
use somersault::ftla::flow::{self, Work};
use somersault::ftla::nalgebra::DVector;
use somersault::ftla::shooting::{self, End, MultipleShooting, ShootingStatus, graded_times};
use somersault::ftla::system::{HamiltonianSystem, OptimalControlSystem};
use std::sync::Arc;

/// What Python calls a status.
pub(crate) fn name_of(status: ShootingStatus) -> &'static str {
    match status {
        ShootingStatus::Converged => "converged",
        ShootingStatus::Floor => "floor",
        ShootingStatus::HamiltonianDrifts => "hamiltonian_drifts",
        ShootingStatus::Stalled => "stalled",
        ShootingStatus::MaxIterations => "max_iterations",
        ShootingStatus::Singular => "singular",
        ShootingStatus::LimitReached => "limit_reached",
        ShootingStatus::OnTheWay => "on_the_way",
    }
}

/// A pickled status.
fn status_named(name: &str) -> Result<ShootingStatus, Error> {
    let all = [
        ShootingStatus::Converged,
        ShootingStatus::Floor,
        ShootingStatus::HamiltonianDrifts,
        ShootingStatus::Stalled,
        ShootingStatus::MaxIterations,
        ShootingStatus::Singular,
        ShootingStatus::LimitReached,
        ShootingStatus::OnTheWay,
    ];
    let known = all.into_iter().find(|status| name_of(*status) == name);
    known.ok_or_else(|| Error::input(format!("`status` is not known: '{name}'")))
}

/// The states at one end, None where one is free.
pub(crate) type EndStates = Vec<Option<f64>>;

/// The conditions at one end.
pub(crate) fn end_of(name: &str, n: usize, states: &EndStates) -> Result<End, Error> {
    if states.len() != n {
        return Err(Error::input(format!("`{name}` must have {n} entries, found {}", states.len())));
    }
    check_finite(name, states.iter().flatten())?;
    // what is free is given first, and then freed
    let given: Vec<f64> = states.iter().map(|x| x.unwrap_or(0.0)).collect();
    let mut end = End::try_state(&given)?;
    for i in (0..states.len()).filter(|&i| states[i].is_none()) {
        end = end.with_free(i)?;
    }
    Ok(end)
}

/// A motion by its nodes that satisfies the conditions of an optimum, as far as `status` and `residual` say.
///
/// Called with times it gives states and costates there.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import ftla
/// >>> t = np.linspace(0.0, 2.0, 5)
/// >>> found = ftla.shoot(ftla.linear_regulator(), [1.0], [0.0], t, np.zeros((5, 2)))
/// >>> found([0.0, 1.0, 2.0])[:, 0].round(6) + 0.0
/// array([1.      , 0.229549, 0.      ])
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct Extremal {
    pub(crate) system: Py<System>,
    pub(crate) settings: Settings,
    pub(crate) extremal: shooting::Extremal,
}

impl Extremal {
    fn dimension(&self) -> usize {
        self.system.get().dimension
    }

    /// Fails unless its system has this dimension.
    pub(crate) fn expect_dimension(&self, expected: usize) -> Result<(), Error> {
        if self.dimension() == expected {
            return Ok(());
        }
        Err(Error::input(format!("the extremal must be of dimension {expected}, found {}", self.dimension())))
    }

    /// Times of the nodes as fractions of the horizon.
    pub(crate) fn fractions(&self) -> Vec<f64> {
        let times = &self.extremal.times;
        let (first, last) = (times[0], times[times.len() - 1]);
        times.iter().map(|t| (t - first) / (last - first)).collect()
    }
}

fn points(extremal: &Extremal, run: &Arc<Run>, times: &[f64]) -> Result<Vec<DVector<f64>>, Error> {
    let system = extremal.system.get().watched(run)?;
    let flow = extremal.settings.flow(&system)?;
    times.iter().map(|&t| Ok(extremal.extremal.at(&flow, t)?)).collect()
}

fn controls(extremal: &Extremal, run: &Arc<Run>, times: &[f64]) -> Result<Vec<DVector<f64>>, Error> {
    let system = extremal.system.get().watched(run)?;
    let control = |p: DVector<f64>| {
        let mut u = DVector::zeros(system.n_controls());
        system.control_into(p.as_slice(), u.as_mut_slice())?;
        Ok(u)
    };
    points(extremal, run, times)?.into_iter().map(control).collect()
}

fn cost(extremal: &Extremal, run: &Arc<Run>) -> Result<f64, Error> {
    let system = extremal.system.get().watched(run)?;
    Ok(extremal.extremal.cost(&extremal.settings.flow(&system)?)?)
}

fn hamiltonian_range(extremal: &Extremal, run: &Arc<Run>) -> Result<[f64; 2], Error> {
    let system = extremal.system.get().watched(run)?;
    Ok(extremal.extremal.range_of(|p| system.hamiltonian(p)))
}

value! {
    impl Extremal {
        /// System: Whose motion it is.
        system: Py<System> = |own, py| own.system.clone_ref(py);
        /// str: ``'converged'``; ``'floor'`` where rounding and the segments' tolerance allow no smaller residual;
        /// ``'hamiltonian_drifts'`` where the conditions hold but the Hamiltonian is not constant, as with a wrong derivative;
        /// ``'stalled'``, ``'max_iterations'``, ``'singular'`` or ``'limit_reached'``; or ``'on_the_way'`` where a continuation stopped early
        /// and the nodes solve a problem before the requested one. The nodes are the best found.
        status: &'static str = |own| name_of(own.extremal.status);
        /// str: The status in a sentence.
        message: String = |own| own.extremal.status.to_string();
        /// ndarray, shape (m,): Times of the nodes, s.
        times: Bound<'py, PyAny> = |own, py| PyArray1::from_slice(py, &own.extremal.times).into_any();
        /// ndarray, shape (m, dimension): States and costates at the nodes.
        nodes: PyResult<Bound<'py, PyAny>> = |own, py| rows_array(py, &own.extremal.nodes, own.dimension());
        /// float: The largest entry of a defect or end condition, relative to the largest value of that entry of (x, λ) over the
        /// motion.
        residual: f64 = |own| own.extremal.residual;
        /// float: The residual below which rounding and the tolerance of the segments hide what a step does.
        floor: f64 = |own| own.extremal.floor;
        /// float or None: The range of the Hamiltonian over nodes and ends of segments, relative to the terms that it is a sum of;
        /// None where the system was made without it.
        hamiltonian_drift: Option<f64> = |own| own.extremal.hamiltonian_drift;
        /// int: Newton steps taken.
        n_iterations: usize = |own| own.extremal.iterations;
        /// int: Segments propagated.
        n_flow_evaluations: usize = |own| own.extremal.flow_evaluations;
        /// int: Evaluations of the field.
        n_evaluations: usize = |own| own.extremal.work.evaluations;
        /// Chain: The transition matrices of the segments.
        chain: Chain = |own| Chain::of(own.dimension(), &flow::Chain::from_links(own.extremal.links.clone()));
    }
}

#[pymethods]
impl Extremal {
    /// bool: Whether it converged.
    #[getter]
    pub(crate) fn success(&self) -> bool {
        self.extremal.status == ShootingStatus::Converged
    }

    /// States and costates at any times, integrated from the node before.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///     s; cut off at the ends.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (dimension,) or (m, dimension)
    fn __call__<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let (single, t) = finite_times(t)?;
        let found = attend(py, |run| points(self, run, &t))?;
        shaped(py, found, single, self.dimension())
    }

    /// The optimal control at any times.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///     s; cut off at the ends.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_controls,) or (m, n_controls)
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ftla
    /// >>> t = np.linspace(0.0, 2.0, 5)
    /// >>> found = ftla.shoot(ftla.linear_regulator(), [1.0], [0.0], t, np.zeros((5, 2)))
    /// >>> found.control([0.0, 1.0]).round(4)
    /// array([[-0.4241],
    ///        [-0.1359]])
    fn control<'py>(&self, py: Python<'py>, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let (single, t) = finite_times(t)?;
        let found = attend(py, |run| controls(self, run, &t))?;
        shaped(py, found, single, self.system.get().n_controls)
    }

    /// The cost of the motion, integrated over its segments.
    ///
    /// Returns
    /// -------
    /// float
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ftla
    /// >>> t = np.linspace(0.0, 2.0, 5)
    /// >>> found = ftla.shoot(ftla.linear_regulator(), [1.0], [0.0], t, np.zeros((5, 2)))
    /// >>> round(found.cost(), 6)
    /// 0.212065
    fn cost(&self, py: Python<'_>) -> Result<f64, Error> {
        attend(py, |run| cost(self, run))
    }

    /// The smallest and the largest Hamiltonian over the nodes and the ends of segments.
    ///
    /// Returns
    /// -------
    /// tuple of float
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ftla
    /// >>> t = np.linspace(0.0, 2.0, 5)
    /// >>> found = ftla.shoot(ftla.linear_regulator(), [1.0], [0.0], t, np.zeros((5, 2)))
    /// >>> low, high = found.hamiltonian_range()
    /// >>> high - low < 1e-9
    /// True
    fn hamiltonian_range(&self, py: Python<'_>) -> Result<(f64, f64), Error> {
        let range = attend(py, |run| hamiltonian_range(self, run))?;
        Ok(range.into())
    }

    fn __repr__(&self) -> String {
        let shooting::Extremal { times, residual, .. } = &self.extremal;
        let last = times[times.len() - 1];
        format!("<Extremal: {}, residual {residual:.1e}, {} nodes to {last} s>", self.status(), times.len())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let shooting::Extremal {
            links,
            residual,
            floor,
            hamiltonian_drift,
            iterations,
            flow_evaluations,
            work,
            ..
        } = &own.extremal;
        let links: Vec<_> = links.iter().cloned().map(Transition::of).collect();
        let Work { evaluations, steps, rejected, switches } = *work;
        let how = (own.status(), residual, floor, hamiltonian_drift, iterations, flow_evaluations);
        let work = (evaluations, steps, rejected, switches);
        let motion = (own.times(py), own.nodes(py)?, links);
        by_restore(slf, (own.system.bind(py), own.settings.plain(), motion, how, work))
    }

    /// A pickled extremal.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        system: Py<System>,
        settings: Plain,
        motion: (Vec<f64>, Vec<Vec<f64>>, Vec<Transition>),
        how: (String, f64, f64, Option<f64>, usize, usize),
        work: (usize, usize, usize, usize),
    ) -> Result<Self, Error> {
        let (times, points, links) = motion;
        let n = system.get().dimension;
        let fits = times.len() > 1
            && times.windows(2).all(|pair| pair[0] < pair[1])
            && points.len() == times.len()
            && points.iter().all(|p| p.len() == n)
            && links.len() + 1 == times.len()
            && links.iter().all(|link| link.transition.end.len() == n);
        if !fits {
            return Err(Error::input("times, nodes and links of an extremal must fit"));
        }
        let (status, residual, floor, hamiltonian_drift, iterations, flow_evaluations) = how;
        let status = status_named(&status)?;
        let (evaluations, steps, rejected, switches) = work;
        let work = Work { evaluations, steps, rejected, switches };
        let extremal = shooting::Extremal {
            times,
            nodes: points.into_iter().map(DVector::from_vec).collect(),
            links: links.into_iter().map(|link| link.transition).collect(),
            status,
            residual,
            floor,
            hamiltonian_drift,
            iterations,
            flow_evaluations,
            work,
        };
        Ok(Self { system, settings: Settings::of_plain(settings)?, extremal })
    }
}

fn finite_times(t: &Bound<'_, PyAny>) -> Result<(bool, Vec<f64>), Error> {
    let (single, found) = times("t", t)?;
    Ok((single, finite_all("t", found)?))
}

fn shaped(
    py: Python<'_>,
    rows: Vec<DVector<f64>>,
    single: bool,
    width: usize,
) -> Result<Bound<'_, PyAny>, Error> {
    let numbers = rows.iter().flat_map(|row| row.iter().copied()).collect();
    let count = (!single).then_some(rows.len());
    let shape: Vec<usize> = count.into_iter().chain([width]).collect();
    Ok(array(py, numbers, &shape)?.into_any())
}

/// A shooting by the names that its settings have in Python.
pub(crate) fn shooting_of(
    [tol, rtol, atol]: [f64; 3],
    max_iterations: usize,
    limits: Limits,
) -> Result<MultipleShooting, Error> {
    if !(1e-15..=0.1).contains(&tol) {
        return Err(Error::input(format!(
            "`tol` must be from 1e-15, below which is rounding, to 0.1, found {tol}"
        )));
    }
    Ok(MultipleShooting { tolerance: tol, max_iterations, flow: tolerances_of(rtol, atol)?, limits })
}

fn solve(
    shooting: &MultipleShooting,
    system: &System,
    run: &Arc<Run>,
    states: &[EndStates; 2],
    times: &[f64],
    nodes: &[f64],
) -> Result<shooting::Extremal, Error> {
    let n = system.n_states()?;
    let ends = [end_of("initial_state", n, &states[0])?, end_of("final_state", n, &states[1])?];
    let nodes: Vec<_> = nodes.chunks_exact(2 * n).map(vector).collect();
    Ok(shooting.solve(&system.watched(run)?, &ends, times, &nodes)?)
}

/// Solves for an extremal by multiple shooting, from nodes of a guess (thesis (8.5), (8.6), (8.10)).
///
/// Newton's method for all nodes at once with the transition matrices of the segments, damped by the natural monotonicity
/// test; segments are propagated in parallel, and no more accurately than the residual calls for.
///
/// Parameters
/// ----------
/// system : System
/// initial_state, final_state : sequence, length n
///     Numbers, None where a state is free, so that its costate is zero.
/// times : array_like, shape (m,)
///     Of the nodes, s, ascending.
/// nodes : array_like, shape (m, dimension)
///     A guess.
/// tol : float, optional
///     Largest defect and end residual of a solution, relative to the largest value of each entry of (x, λ) over the motion;
///     from 1e-15, below which is rounding, to 0.1.
/// max_iterations : int, optional
/// rtol, atol : float, optional
///     Of the segments in the last steps; the absolute one counts in the largest value of each entry.
/// max_time : float, optional
///     s. Where it is reached the status is ``'limit_reached'``.
/// max_evaluations : int, optional
///     Of the field, likewise.
///
/// Returns
/// -------
/// Extremal
///     With the best nodes, whatever the status.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import ftla
/// >>> times = ftla.graded_times(10.0, 0.2, 2.0)
/// >>> found = ftla.shoot(ftla.linear_regulator(), [1.0], [1.5], times, np.zeros((len(times), 2)))
/// >>> found.status, round(found.cost(), 6)
/// ('converged', 2.923094)
#[pyfunction]
#[pyo3(signature = (
    system, initial_state, final_state, times, nodes, *, tol=1e-11, max_iterations=100, rtol=1e-13, atol=1e-15,
    max_time=None, max_evaluations=None
))]
pub(crate) fn shoot(
    py: Python<'_>,
    system: Py<System>,
    initial_state: EndStates,
    final_state: EndStates,
    times: &Bound<'_, PyAny>,
    nodes: &Bound<'_, PyAny>,
    tol: f64,
    #[pyo3(from_py_with = whole::max_iterations)] max_iterations: usize,
    rtol: f64,
    atol: f64,
    max_time: Option<&Bound<'_, PyAny>>,
    max_evaluations: Option<&Bound<'_, PyAny>>,
) -> Result<Extremal, Error> {
    let n = system.get().dimension;
    let (times, rows) = (real_numbers("times", times)?, Rows::extract("nodes", &[n], nodes)?);
    let (all, states) = (rows.all()?, [initial_state, final_state]);
    let limits = limits_of(max_time, max_evaluations)?;
    let shooting = shooting_of([tol, rtol, atol], max_iterations, limits)?;
    let extremal = attend(py, |run| solve(&shooting, system.get(), run, &states, &times, all))?;
    Ok(Extremal { settings: Settings::new(shooting.flow), system, extremal })
}

/// Times from 0 to the horizon, `shortest` apart at both ends and half as much more at each step inwards, to `longest`.
///
/// Parameters
/// ----------
/// horizon, shortest, longest : float
///     s.
///
/// Returns
/// -------
/// ndarray, shape (m,)
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> ftla.graded_times(10.0, 0.5, 2.0).round(3)
/// array([ 0.   ,  0.412,  1.031,  1.959,  3.351,  5.   ,  6.649,  8.041,
///         8.969,  9.588, 10.   ])
#[pyfunction(name = "graded_times")]
pub(crate) fn py_graded_times(
    py: Python<'_>,
    horizon: f64,
    shortest: f64,
    longest: f64,
) -> Result<Bound<'_, PyAny>, Error> {
    Ok(PyArray1::from_vec(py, graded_times(horizon, shortest, longest)?).into_any())
}
