//! Momentum-reduced flight of trees.

use crate::core::callable::{Failure, call, callable_name, check_callable, noted};
use crate::core::convert::{finite_all, integer, integer_or_none, interval_of, with_shape};
use crate::core::error::Error;
use crate::core::waiting::returns_interrupted;
use crate::integrators::methods;
use crate::integrators::monitor::{Finish, Monitor, ProgressBar};
use crate::integrators::plan::{self, Plan, StepArguments, start_up_of};
use crate::integrators::trajectory::Report;
use crate::multibody::model::Model;
use crate::multibody::motion::TreeSolution;
use pyo3::prelude::*;
use somersault::integrators::methods::{Method, Options};
use somersault::integrators::system::System;
use somersault::multibody::flight::{Flight, FlightSystem, ShapeMotion};
use std::sync::atomic::{AtomicU64, Ordering};

/// A callable ``f(t) -> (q, v)`` for the joints but the root's.
struct Shape {
    callable: Py<PyAny>,
    name: String,
    failure: Failure,
    calls: AtomicU64,
}

impl Shape {
    fn new(callable: &Bound<'_, PyAny>, failure: &Failure) -> Self {
        Self {
            callable: callable.clone().unbind(),
            name: callable_name(callable),
            failure: failure.clone(),
            calls: AtomicU64::new(0),
        }
    }
}

impl ShapeMotion for Shape {
    fn evaluate(&self, t: f64, q: &mut [f64], v: &mut [f64]) {
        self.calls.fetch_add(1, Ordering::Relaxed);
        let nan = (vec![f64::NAN; q.len()], vec![f64::NAN; v.len()]);
        let found = call(&self.failure, nan, |py| {
            let returned = self.callable.call1(py, (t,));
            let returned = noted(py, returned, || format!("{}(t) at t = {t}", self.name))?;
            let (of_q, of_v): (Bound<'_, PyAny>, Bound<'_, PyAny>) =
                returned.bind(py).extract().map_err(|_| {
                    let (name, n, m) = (&self.name, q.len(), v.len());
                    Error::input(format!("`{name}` must return a pair (q, v) of shapes ({n},) and ({m},)"))
                })?;
            let (in_q, in_v) = (format!("{}(t)[0]", self.name), format!("{}(t)[1]", self.name));
            let of_q = finite_all(&in_q, with_shape(&in_q, &[q.len()], &of_q)?)?;
            Ok((of_q, finite_all(&in_v, with_shape(&in_v, &[v.len()], &of_v)?)?))
        });
        q.copy_from_slice(&found.0);
        v.copy_from_slice(&found.1);
    }
}

/// Flight of a tree whose joints move as prescribed, in uniform gravity.
///
/// The centre of mass stays on its parabola and the angular momentum about it as it was at the start, both to
/// rounding; what is integrated is the orientation of the root alone. The root has a free or a planar joint.
///
/// Parameters
/// ----------
/// model : Model
///     The tree.
/// q, v : array_like, shape (n_positions,) and (n_velocities,)
///     Configuration and velocity at the start, which give the momentum.
/// shape : callable
///     ``f(t)`` that returns q and v of all joints but the root's.
/// interval : tuple of float
///     Start and end time, s.
/// dt : float, optional
///     Step, s; without it steps are adapted.
/// method : str or MethodInfo, optional
///     A method of the table whose scope is any system, in the world's variables; ``"rkmk"`` unless given,
///     or ``"rkmk8"`` where steps are adapted.
/// rtol, atol, max_step, first_step, max_steps, start_up, every, on_interrupt, progress
///     As of `somersault.integrate`.
///
/// Returns
/// -------
/// TreeSolution
///     Whole configurations and velocities.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, or the root is held or damped.
/// IntegrationError
///     If the run cannot continue.
///
/// Examples
/// --------
/// A diver who folds into a pike turns faster, at the same angular momentum:
///
/// >>> import numpy as np
/// >>> from somersault import multibody
/// >>> diver = multibody.diver_planar()
/// >>> straight, pike = diver.configuration("A"), diver.configuration("H")
/// >>> def fold(t):
/// ...     return straight[3:] + t * (pike - straight)[3:], (pike - straight)[3:]
/// >>> v = np.zeros(12)
/// >>> v[2] = 4.0
/// >>> flight = multibody.fly(diver.model, straight, v, fold, (0.0, 1.0), dt=0.01)
/// >>> momentum = diver.model.centroidal_momentum(flight.q, flight.v)[:, 4]
/// >>> bool(np.ptp(momentum) < 1e-9 * abs(momentum).max()), bool(abs(flight.v[-1, 2]) > 4.0)
/// (True, True)
#[pyfunction]
#[pyo3(signature = (
    model, q, v, shape, interval, *, dt=None, method=None, rtol=None, atol=None, max_step=None,
    first_step=None, max_steps=None, start_up="one_step", every=1, on_interrupt="raise", progress=false
))]
pub(crate) fn fly<'py>(
    py: Python<'py>,
    model: &Bound<'py, Model>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    shape: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    dt: Option<f64>,
    method: Option<&Bound<'py, PyAny>>,
    rtol: Option<f64>,
    atol: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
    #[pyo3(from_py_with = integer_or_none)] max_steps: Option<i64>,
    start_up: &str,
    #[pyo3(from_py_with = integer)] every: i64,
    on_interrupt: &str,
    progress: bool,
) -> Result<Py<TreeSolution>, Error> {
    let tree = &model.get().model;
    let interval = (interval[0], interval[1]);
    let default = if dt.is_some() { Method::Rkmk } else { Method::Rkmk8 };
    let method = method.map_or(Ok(default), |m| methods::extract("method", m))?;
    let arguments = StepArguments { dt, rtol, atol, max_step, first_step, max_steps };
    let steps = arguments.steps(method, interval)?;
    let mut q = finite_all("q", with_shape("q", &[tree.n_positions()], q)?)?;
    let v = finite_all("v", with_shape("v", &[tree.n_velocities()], v)?)?;
    tree.normalize(&mut q)?;
    check_callable("shape", "f(t) -> (q, v)", shape)?;
    let failure = Failure::default();
    let motion = Shape::new(shape, &failure);
    let plan = Plan {
        method,
        options: Options { start_up: start_up_of(start_up)? },
        steps,
        backwards: false,
        every: plan::every_of(every)?,
        t_eval: None,
        dense: false,
        calls_python: true,
        return_interrupted: returns_interrupted(on_interrupt)?,
    };
    let flight = Flight::from_state(tree, interval.0, &q, &v)?;
    let system = FlightSystem::new(flight, &motion);
    let orientation = tree.joint(0).map_or(0..0, |root| root.kind().orientation());
    let initial = system.state(&q[orientation])?;
    let bar = if progress { Some(ProgressBar::open(py, interval.0, interval.1)?) } else { None };
    let mut monitor = Monitor::try_new(&plan, &initial, 8, None, bar, failure)?;
    let outcome =
        monitor.supervise(py, &plan, |monitor| plan.run(&system).observed_by(monitor).from(&initial))?;
    let n_rejected = outcome.as_ref().map_or(0, |outcome| outcome.rejected);
    let status = outcome.map(|outcome| outcome.status).map_err(Error::from);
    let Finish { recorded, steps, status, message, failed, .. } = monitor.finish(py, status);
    let nfev = motion.calls.load(Ordering::Relaxed);
    let report = Report { status, message, nfev, n_steps: steps, n_rejected };
    // What stopped the run keeps its callable from being asked again.
    let again = Shape::new(shape, &Failure::default());
    let system = FlightSystem::new(flight, &again);
    let (mut positions, mut velocities) = (Vec::new(), Vec::new());
    let mut workspace = system.workspace();
    let mut complete = || -> Result<(), Error> {
        for (t, x) in recorded.times.iter().zip(&recorded.states) {
            let (q, v) = system.complete(&mut workspace, *t, x)?;
            positions.extend_from_slice(q);
            velocities.extend_from_slice(v);
        }
        Ok(())
    };
    let completed = complete();
    let raised = again.failure.get().map_or(completed, |error| Err(error.clone_ref(py).into()));
    if let Err(error) = raised {
        // A shape that fails from the start leaves nothing to keep.
        return Err(failed.map_or(error, Error::from));
    }
    let solution = TreeSolution::of(py, model, recorded.times, positions, velocities, report)?;
    plan.deliver(py, failed, Py::new(py, solution)?)
}
