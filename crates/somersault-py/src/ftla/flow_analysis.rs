//! Analyses of flows: long runs, fields of exponents, ridges, and convergence. `somersault._flows` makes objects of what these give.

use super::argument::{limits_of, whole};
use super::error::told;
use super::flow::VariationalFlow;
use super::spectrum::Spectrum;
use crate::core::convert::{array, contiguous, entries, shape_text};
use crate::core::error::Error;
use crate::core::rows::Rows;
use numpy::PyReadonlyArrayDyn;
use numpy::prelude::*;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::ftla::flow::FlowError;
use somersault::ftla::ftle::{Grid, PointStatus, RidgeCriteria, ftle_field};
use somersault::ftla::nalgebra::DMatrix;
use somersault::ftla::spectrum::{self, Growth, Law, LongRun, SpectraConvergence};

/// Names and values.
type Given<'py> = Result<Bound<'py, PyDict>, Error>;

/// What Python calls the end of a point's motion.
fn status_name(status: PointStatus) -> &'static str {
    match status {
        PointStatus::Arrived => "arrived",
        PointStatus::LeftDomain => "left_domain",
        PointStatus::NoValue => "no_value",
        PointStatus::StepUnderflow => "step_underflow",
        PointStatus::TooManySteps => "too_many_steps",
        PointStatus::LimitReached => "limit_reached",
        PointStatus::Interrupted => "interrupted",
    }
}

/// What Python calls a law of growth.
fn law_name(law: Law) -> &'static str {
    match law {
        Law::Exponential => "exponential",
        Law::Power => "power",
        Law::Neutral => "neutral",
        Law::Unknown(_) => "unknown",
    }
}

/// Laws of growth, a row for each property.
fn set_growths(found: &Bound<'_, PyDict>, growths: &[Growth]) -> Result<(), Error> {
    let py = found.py();
    let all = |of: fn(&Growth) -> f64| array(py, growths.iter().map(of).collect(), &[growths.len()]);
    found.set_item("growth", growths.iter().map(|growth| law_name(growth.law)).collect::<Vec<_>>())?;
    found.set_item("rates", all(|growth| growth.rate)?)?;
    found.set_item("powers", all(|growth| growth.power)?)?;
    Ok(found.set_item("rate_errors", all(|growth| growth.error)?)?)
}

/// A matrix as an array.
fn rows_of<'py>(py: Python<'py>, matrix: &DMatrix<f64>) -> PyResult<Bound<'py, PyAny>> {
    Ok(array(py, matrix.transpose().as_slice().to_vec(), &[matrix.nrows(), matrix.ncols()])?.into_any())
}

/// Lyapunov exponents along a long motion, for `lyapunov_spectrum`.
///
/// Parameters
/// ----------
/// flow : VariationalFlow
/// p : array_like, shape (dimension,)
/// duration : float
/// transient : float
///     The part of it that is left out.
/// samples : int
/// tolerance : float
/// max_time : float, optional
/// max_evaluations : int, optional
///
/// Returns
/// -------
/// dict
#[pyfunction]
#[pyo3(signature = (flow, p, duration, transient, samples, tolerance, *, max_time=None, max_evaluations=None))]
pub(crate) fn long_run<'py>(
    py: Python<'py>,
    flow: &VariationalFlow,
    p: &Bound<'py, PyAny>,
    duration: f64,
    transient: f64,
    #[pyo3(from_py_with = whole::samples)] samples: usize,
    tolerance: f64,
    max_time: Option<&Bound<'py, PyAny>>,
    max_evaluations: Option<&Bound<'py, PyAny>>,
) -> Given<'py> {
    let p = flow.point("p", p)?;
    let run = LongRun { duration, transient, samples, tolerance };
    let limits = limits_of(max_time, max_evaluations)?;
    let (done, raised) = flow.attend_with_rest(py, limits, |flow| Ok(run.spectrum(&flow, &p)?))?;
    let n = p.len();
    let found = PyDict::new(py);
    set_growths(&found, &done.growths)?;
    let (status, message) = match (&raised, &done.ended) {
        (Some(error), _) => ("interrupted", format!("the run was interrupted: {error}")),
        (None, Some(error)) => (status_name(PointStatus::of(error)), told(error)),
        (None, None) if done.is_converged() => ("converged", done.convergence.to_string()),
        (None, None) => ("not_converged", done.convergence.to_string()),
    };
    found.set_item("status", status)?;
    found.set_item("message", message)?;
    found.set_item("exponents", array(py, done.exponents.as_slice().to_vec(), &[n])?)?;
    found.set_item("errors", array(py, done.errors.as_slice().to_vec(), &[n])?)?;
    found.set_item("times", array(py, done.times.clone(), &[done.times.len()])?)?;
    found.set_item("history", rows_of(py, &done.history)?)?;
    found.set_item("state", array(py, done.state.as_slice().to_vec(), &[n])?)?;
    found.set_item("kaplan_yorke_dimension", done.kaplan_yorke_dimension())?;
    found.set_item("n_evaluations", done.work.evaluations)?;
    found.set_item("raised", raised)?;
    Ok(found)
}

/// Exponents of many points, for `ftle_field`.
///
/// Parameters
/// ----------
/// flow : VariationalFlow
/// points : array_like, shape (m, dimension)
/// duration : float
/// domain : list of (float, float), optional
/// max_time : float, optional
/// max_evaluations : int, optional
///
/// Returns
/// -------
/// dict
#[pyfunction]
#[pyo3(signature = (flow, points, duration, domain=None, *, max_time=None, max_evaluations=None))]
pub(crate) fn field_exponents<'py>(
    py: Python<'py>,
    flow: &VariationalFlow,
    points: &Bound<'py, PyAny>,
    duration: f64,
    domain: Option<Vec<[f64; 2]>>,
    max_time: Option<&Bound<'py, PyAny>>,
    max_evaluations: Option<&Bound<'py, PyAny>>,
) -> Given<'py> {
    let n = flow.system.get().dimension;
    let rows = Rows::extract("points", &[n], points)?;
    let all = rows.all()?;
    let domain = domain.unwrap_or_else(|| vec![[f64::NEG_INFINITY, f64::INFINITY]; n]);
    let limits = limits_of(max_time, max_evaluations)?;
    let (done, raised) =
        flow.attend_with_rest(py, limits, |flow| Ok(ftle_field(&flow.inside(&domain), all, duration)?))?;
    let m = done.exponents.len();
    let found = PyDict::new(py);
    found.set_item("exponents", array(py, done.exponents, &[m])?)?;
    found.set_item("directions", array(py, done.directions, &[m, n])?)?;
    found.set_item("ends", array(py, done.ends, &[m, n])?)?;
    found.set_item("status", done.statuses.iter().map(|status| status_name(*status)).collect::<Vec<_>>())?;
    found.set_item("n_evaluations", done.work.evaluations)?;
    found.set_item("raised", raised)?;
    Ok(found)
}

/// A field on a grid, and its nodes along x and y.
fn field_of<'py>(values: &Bound<'py, PyAny>) -> Result<(PyReadonlyArrayDyn<'py, f64>, [usize; 2]), Error> {
    let given = contiguous("values", "real numbers of shape (ny, nx)", values)?;
    match *given.shape() {
        [ny, nx] => Ok((given, [nx, ny])),
        ref found => {
            let found = shape_text(found);
            Err(Error::input(format!("`values` must have shape (ny, nx), found {found}")))
        }
    }
}

/// A field on a grid smoothed by a Gaussian, for `FtleField.ridges`.
///
/// Parameters
/// ----------
/// values : array_like, shape (ny, nx)
/// smoothing : float
///     Standard deviation, in spacings.
///
/// Returns
/// -------
/// ndarray, shape (ny, nx)
#[pyfunction]
pub(crate) fn grid_smoothed<'py>(
    py: Python<'py>,
    values: &Bound<'py, PyAny>,
    smoothing: f64,
) -> Result<Bound<'py, PyAny>, Error> {
    let (given, count) = field_of(values)?;
    let numbers = given.as_slice().map_err(PyErr::from)?;
    let grid = Grid { origin: [0.0; 2], spacing: [1.0; 2], count };
    let found = py.detach(|| grid.smoothed(numbers, smoothing)).map_err(FlowError::from)?;
    Ok(array(py, found, &[count[1], count[0]])?.into_any())
}

/// Ridges of a field on a grid, for `FtleField.ridges`.
///
/// Parameters
/// ----------
/// values : array_like, shape (ny, nx)
/// origin, spacing : tuple of float
/// height, curvature, length : float
///
/// Returns
/// -------
/// list of tuple of ndarray
///     Points, heights and curvatures.
#[pyfunction]
pub(crate) fn grid_ridges<'py>(
    py: Python<'py>,
    values: &Bound<'py, PyAny>,
    origin: [f64; 2],
    spacing: [f64; 2],
    height: f64,
    curvature: f64,
    length: f64,
) -> Result<Vec<[Bound<'py, PyAny>; 3]>, Error> {
    let (given, count) = field_of(values)?;
    let numbers = given.as_slice().map_err(PyErr::from)?;
    let grid = Grid { origin, spacing, count };
    let ridges = py.detach(|| grid.ridges(numbers, RidgeCriteria { height, curvature, length }));
    let ridges = ridges.map_err(FlowError::from)?;
    let of = |ridge: &somersault::ftla::ftle::Ridge| {
        let m = ridge.points.len();
        let points = ridge.points.iter().flatten().copied().collect();
        Ok([
            array(py, points, &[m, 2])?.into_any(),
            array(py, ridge.heights.clone(), &[m])?.into_any(),
            array(py, ridge.curvatures.clone(), &[m])?.into_any(),
        ])
    };
    ridges.iter().map(of).collect()
}

/// Whether spectra have converged, for `exponent_convergence`.
///
/// Parameters
/// ----------
/// spectra : sequence of Spectrum
/// tolerance : float
///
/// Returns
/// -------
/// dict
#[pyfunction]
pub(crate) fn spectra_convergence<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = entries)] spectra: Vec<Bound<'py, Spectrum>>,
    tolerance: f64,
) -> Given<'py> {
    let spectra: Vec<_> = spectra.iter().map(|spectrum| spectrum.get().spectrum.clone()).collect();
    let done = SpectraConvergence::of(&spectra, tolerance)?;
    let found = PyDict::new(py);
    set_growths(&found, &done.growths)?;
    let subspaces = |of: fn(&spectrum::Settling) -> f64| {
        array(py, done.subspaces.iter().map(of).collect(), &[done.subspaces.len()])
    };
    found.set_item("converged", done.convergence == spectrum::ExponentConvergence::Converged)?;
    found.set_item("message", done.convergence.to_string())?;
    found.set_item("subspace_changes", subspaces(|settling| settling.change)?)?;
    found.set_item("subspace_rates", subspaces(|settling| settling.rate)?)?;
    found.set_item("gaps", subspaces(|settling| settling.gap.rate)?)?;
    let laws = done.subspaces.iter().map(|settling| law_name(settling.gap.law));
    found.set_item("gap_growth", laws.collect::<Vec<_>>())?;
    Ok(found)
}
