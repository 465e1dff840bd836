//! Placing a point on the centre-stable or the centre-unstable manifold.

use super::argument::{limits_of, triple, whole, wholes};
use super::dimension::{dims_of, expect_dimension};
use super::error::told;
use super::flow::VariationalFlow;
use super::spectrum::{Diagnosis, Spectrum, direction_of};
use crate::core::convert::{positive, real_numbers};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, few, value};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ftla::flow::FlowError;
use somersault::ftla::nalgebra::DVector;
use somersault::ftla::placement::{self, Method, PlacementError, PlacementStatus, Schedule};
use somersault::ftla::spectrum::{SplittingDims, TimeDirection};

/// How points are placed on the slow manifolds by their costates (thesis 10.1).
///
/// A point is placed where its field lies in the directions that do not expand fast: E^cs forward, E^cu backward. As many
/// costates are solved for as there are fast directions; the others and the states are held.
///
/// Parameters
/// ----------
/// dims : tuple of int or Diagnosis
///     (n^s, n^c, n^u).
/// held : sequence of int
///     Numbers, from 0, of the costates that are held; see `rank_held_costates`.
/// times : array_like, shape (m,), optional
///     Averaging times, s, ascending; by default those of `Diagnosis.schedule`.
/// method : {'newton', 'fixed_point'}, optional
///     Newton's method with the change of the basis, damped; or the basis held and recomputed, as algorithms 1 and 2 do.
/// tol : float, optional
///     Angle between the field and the slow subspace, rad.
/// max_iterations : int, optional
///     For one averaging time.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import ftla
/// >>> flow = ftla.VariationalFlow(ftla.cubic_regulator())
/// >>> placement = ftla.Placement((1, 0, 1), [], np.arange(0.5, 9.1, 0.5))
/// >>> placed = placement.place(flow, [1.0, 0.6])
/// >>> placed.status, bool(abs(placed.p[1] - (np.sqrt(2) - 1)) < 1e-7)
/// ('placed', True)
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct Placement {
    dims: SplittingDims,
    /// list of int: Numbers of the costates held.
    #[pyo3(get)]
    held: Vec<usize>,
    schedule: Schedule,
    method: Method,
    /// float: Angle allowed, rad.
    #[pyo3(get)]
    tol: f64,
    /// int: Iterations for one averaging time.
    #[pyo3(get)]
    max_iterations: usize,
}

impl Placement {
    /// Number of costates held.
    pub(crate) fn held_count(&self) -> usize {
        self.held.len()
    }

    /// As the library has it, for points of a dimension.
    pub(crate) fn typed(
        &self,
        dimension: usize,
        direction: TimeDirection,
    ) -> Result<placement::Placement, PlacementError> {
        let placement = placement::Placement::try_new(
            dimension,
            direction,
            self.dims,
            &self.held,
            self.schedule.clone(),
        )?;
        let mut placement = placement.with_method(self.method);
        (placement.tolerance, placement.max_iterations) = (self.tol, self.max_iterations);
        Ok(placement)
    }
}

fn check(placement: &Placement, dimension: usize) -> Result<(), Error> {
    // where n^s and n^u differ, it can serve one direction only
    let forward = placement.typed(dimension, TimeDirection::Forward);
    let backward = placement.typed(dimension, TimeDirection::Backward);
    match (forward, backward) {
        (Err(error), Err(_)) => Err(error.into()),
        (Ok(_), _) | (_, Ok(_)) => Ok(()),
    }
}

value! {
    impl Placement {
        /// tuple of int: (n^s, n^c, n^u).
        dims: (usize, usize, usize) = |own| (own.dims.stable, own.dims.center, own.dims.unstable);
        /// ndarray, shape (m,): Averaging times, s.
        times: Bound<'py, PyAny> = |own, py| PyArray1::from_slice(py, own.schedule.times()).into_any();
    }
}

#[pymethods]
impl Placement {
    #[new]
    #[pyo3(signature = (dims, held, times=None, *, method="newton", tol=1e-8, max_iterations=30))]
    fn new(
        dims: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = wholes::held)] held: Vec<usize>,
        times: Option<&Bound<'_, PyAny>>,
        method: &str,
        tol: f64,
        #[pyo3(from_py_with = whole::max_iterations)] max_iterations: usize,
    ) -> Result<Self, Error> {
        let times = times.map(|times| real_numbers("times", times)).transpose()?;
        let diagnosis = dims.cast::<Diagnosis>().ok().map(|found| found.get().diagnosis);
        let dims = diagnosis.map_or_else(|| triple::dims(dims).map(dims_of), |found| Ok(found.dims))?;
        let schedule = match (diagnosis, times) {
            (_, Some(times)) => Schedule::try_times(times)?,
            (Some(diagnosis), None) => Schedule::of_diagnosis(&diagnosis)?,
            (None, None) => {
                return Err(Error::input("`times` must be given where `dims` is no Diagnosis"));
            }
        };
        let method = match method {
            "newton" => Method::Newton,
            "fixed_point" => Method::FixedPoint,
            other => {
                return Err(Error::input(format!(
                    "`method` must be 'newton' or 'fixed_point', found '{other}'"
                )));
            }
        };
        positive("tol", tol)?;
        if max_iterations == 0 {
            return Err(Error::input("`max_iterations` must be positive, found 0"));
        }
        let placement = Self { dims, held, schedule, method, tol, max_iterations };
        let dimension = dims.stable.saturating_add(dims.center).saturating_add(dims.unstable);
        expect_dimension("dims", dimension)?;
        check(&placement, dimension)?;
        Ok(placement)
    }

    /// str: ``'newton'`` or ``'fixed_point'``.
    #[getter]
    fn method(&self) -> &'static str {
        match self.method {
            Method::Newton => "newton",
            Method::FixedPoint => "fixed_point",
        }
    }

    /// Places a point for one averaging time after the other (thesis algorithms 3 and 4).
    ///
    /// A time at which placing fails is approached in smaller steps before giving up; the first one from zero.
    ///
    /// Parameters
    /// ----------
    /// flow : VariationalFlow
    /// p : array_like, shape (dimension,)
    /// direction : {'forward', 'backward'}, optional
    ///     Forward for a point at the start, backward for one at the end.
    /// max_time : float, optional
    ///     s. Where it is reached the status is ``'limit_reached'``.
    /// max_evaluations : int, optional
    ///     Of the field, likewise.
    ///
    /// Returns
    /// -------
    /// PlacementResult
    ///     The placed point, or the best one found; the status says which.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> placed = ftla.Placement((1, 0, 1), [], [2.0, 4.0, 8.0]).place(flow, [1.0, 0.0])
    /// >>> placed.p.round(6), round(2**0.5 - 1, 6)
    /// (array([1.      , 0.414214]), 0.414214)
    #[pyo3(signature = (flow, p, direction="forward", *, max_time=None, max_evaluations=None))]
    fn place(
        &self,
        py: Python<'_>,
        flow: &VariationalFlow,
        p: &Bound<'_, PyAny>,
        direction: &str,
        max_time: Option<&Bound<'_, PyAny>>,
        max_evaluations: Option<&Bound<'_, PyAny>>,
    ) -> Result<PlacementResult, Error> {
        flow.system.get().expect_autonomous()?;
        let p = flow.point("p", p)?;
        let (direction, limits) = (direction_of(direction)?, limits_of(max_time, max_evaluations)?);
        flow.attend(py, |flow| {
            let placement = self.typed(p.len(), direction)?;
            Ok(PlacementResult::of(placement.place(&flow.within(&limits.start()), &p)))
        })
    }

    fn __repr__(&self) -> String {
        let (SplittingDims { stable, center, unstable }, times) = (self.dims, self.schedule.times());
        format!(
            "<Placement: {stable}/{center}/{unstable}, costates [{}] held, {} for {} times up to {} s>",
            few(&self.held),
            self.method(),
            times.len(),
            times[times.len() - 1]
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let arguments =
            (own.dims(), own.held.clone(), own.times(py), own.method(), own.tol, own.max_iterations);
        by_restore(slf, arguments)
    }

    /// A pickled placement.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        dims: &Bound<'_, PyAny>,
        held: Vec<usize>,
        times: &Bound<'_, PyAny>,
        method: &str,
        tol: f64,
        max_iterations: usize,
    ) -> Result<Self, Error> {
        Self::new(dims, held, Some(times), method, tol, max_iterations)
    }
}

/// A placed point, or the best one found.
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct PlacementResult {
    p: DVector<f64>,
    /// str: ``'placed'``, ``'stalled'``, ``'max_iterations'``, ``'singular_costates'``, ``'flow'`` or ``'limit_reached'``.
    #[pyo3(get)]
    status: &'static str,
    /// str: The status in a sentence.
    #[pyo3(get)]
    message: String,
    /// float: Angle between the field and the slow subspace, rad; NaN where the motion could not be followed at all.
    #[pyo3(get)]
    angle: f64,
    /// float: Averaging time of point and angle, s.
    #[pyo3(get)]
    time: f64,
    spectrum: Option<Spectrum>,
    /// int: Iterations over all averaging times.
    #[pyo3(get)]
    n_iterations: usize,
    /// int: Spectra computed.
    #[pyo3(get)]
    n_flow_evaluations: usize,
}

/// What Python calls a status.
pub(crate) fn status_of(status: &PlacementStatus) -> &'static str {
    match status {
        PlacementStatus::Placed => "placed",
        PlacementStatus::Stalled => "stalled",
        PlacementStatus::MaxIterations => "max_iterations",
        PlacementStatus::SingularCostates => "singular_costates",
        PlacementStatus::Flow(FlowError::LimitReached { .. }) => "limit_reached",
        PlacementStatus::Flow(_) => "flow",
    }
}

/// A pickled status.
pub(crate) fn status_named(name: &str) -> Result<&'static str, Error> {
    let known = ["placed", "stalled", "max_iterations", "singular_costates", "flow", "limit_reached"];
    let found = known.into_iter().find(|status| *status == name);
    found.ok_or_else(|| Error::input(format!("`status` must be one of {known:?}, found '{name}'")))
}

impl PlacementResult {
    fn of(placed: placement::PlacementResult) -> Self {
        let message = match &placed.status {
            PlacementStatus::Placed => {
                "the angle is within the tolerance at the last averaging time".to_owned()
            }
            PlacementStatus::Stalled => {
                "no step lowers the angle: the point is out of reach of this averaging time".to_owned()
            }
            PlacementStatus::MaxIterations => "the iterations for one averaging time are used up".to_owned(),
            PlacementStatus::SingularCostates => {
                "the costates solved for do not move the field along the fast directions: hold others"
                    .to_owned()
            }
            PlacementStatus::Flow(error) => {
                format!("the motion cannot be followed for the averaging time: {}", told(error))
            }
        };
        Self {
            p: placed.p,
            status: status_of(&placed.status),
            message,
            angle: placed.angle,
            time: placed.time,
            spectrum: placed.spectrum.map(|spectrum| Spectrum { spectrum }),
            n_iterations: placed.iterations,
            n_flow_evaluations: placed.flow_evaluations,
        }
    }
}

value! {
    impl PlacementResult {
        /// ndarray, shape (dimension,): The point.
        p: Bound<'py, PyAny> = |own, py| PyArray1::from_slice(py, own.p.as_slice()).into_any();
        /// bool: Whether it was placed at the last averaging time.
        success: bool = |own| own.status == "placed";
        /// Spectrum or None: The spectrum there, if the motion could be followed.
        spectrum: Option<Spectrum> = |own| own.spectrum.clone();
    }
}

#[pymethods]
impl PlacementResult {
    fn __repr__(&self) -> String {
        format!("<PlacementResult: {}, {:.1e} rad at T = {} s>", self.status, self.angle, self.time)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        let how = (own.status, own.message.clone(), own.angle, own.time);
        let counts = (own.n_iterations, own.n_flow_evaluations);
        by_restore(slf, (own.p(slf.py()), how, own.spectrum(), counts))
    }

    /// A pickled point.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        p: Vec<f64>,
        how: (String, String, f64, f64),
        spectrum: Option<Bound<'_, Spectrum>>,
        counts: (usize, usize),
    ) -> Result<Self, Error> {
        let (status, message, angle, time) = how;
        let (n_iterations, n_flow_evaluations) = counts;
        let (status, spectrum) = (status_named(&status)?, spectrum.map(|found| found.get().clone()));
        Ok(Self {
            p: DVector::from_vec(p),
            status,
            message,
            angle,
            time,
            spectrum,
            n_iterations,
            n_flow_evaluations,
        })
    }
}
