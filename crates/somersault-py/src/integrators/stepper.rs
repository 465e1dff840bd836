//! An integration that is made step by step.
//!
//! The driver of `integrate` runs on a thread of its own and waits after every step for a request of the next one, so that the
//! steps are those of `integrate` itself.

use crate::core::callable::Failure;
use crate::core::convert::integer_or_none;
use crate::core::error::Error;
use crate::integrators::forces::models::Reader;
use crate::integrators::integrate::either_way;
use crate::integrators::methods;
use crate::integrators::plan::{Plan, StepArguments, start_up_of};
use crate::integrators::seen::{Curves, Seen};
use crate::integrators::solve;
use crate::integrators::trajectory::{Cast, DenseOutput, Trajectory};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use somersault::integrators::driver::{Flow, IntegrateError, Observer, Step};
use somersault::integrators::methods::{Method, Options};
use somersault::integrators::reversal::TimeReversed;
use somersault::integrators::run::{ByMethod, Engages};
use somersault::integrators::solution::Solution;
use somersault::integrators::state::{RigidBodyState, State};
use somersault::integrators::system::{RigidBodiesSystem, RigidBodySystem, StateOf, System};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

/// How often who waits for a step looks for signals.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(20);

/// What a driver that waits may do next.
enum Asked {
    Step,
    Curve,
}

/// What it answers.
enum Answer {
    /// Time and states after a step.
    Step(f64, Vec<RigidBodyState>),
    Curve(Curves),
    /// The run is over, by an error or without one.
    Ended(Option<IntegrateError>),
}

/// A driver at work.
struct Worker {
    asked: Sender<Asked>,
    answers: Mutex<Receiver<Answer>>,
    failure: Failure,
    /// The process that has the thread; a forked child has none.
    process: u32,
}

impl Worker {
    /// Starts a thread for a run, which begins with the request of the first step.
    fn start(
        failure: Failure,
        run: impl FnOnce(Steps) -> Result<(), IntegrateError> + Send + 'static,
    ) -> Result<Self, Error> {
        let (asked, requests) = channel();
        let (replies, answers) = channel();
        let steps = Steps { requests, replies: replies.clone(), failure: failure.clone() };
        let thread = std::thread::Builder::new().name("somersault".to_owned()).spawn(move || {
            if matches!(steps.requests.recv(), Ok(Asked::Step)) {
                let ended = run(steps).err();
                // nobody listens to a run that was given up
                let _ = replies.send(Answer::Ended(ended));
            }
        });
        thread.map_err(|error| Error::of_system(format!("no thread can be started: {error}")))?;
        Ok(Self { asked, answers: Mutex::new(answers), failure, process: std::process::id() })
    }

    /// Asks and waits, looking for signals meanwhile.
    fn ask(&self, py: Python<'_>, asked: Asked) -> Result<Answer, Error> {
        if self.process != std::process::id() {
            return Err(Error::input(
                "a Stepper is not used after a fork: make another one from its `t` and `state`",
            ));
        }
        let gone = || Error::of_system("the thread that makes the steps is gone".to_owned());
        self.asked.send(asked).map_err(|_| gone())?;
        let answer: PyResult<Option<Answer>> = py.detach(|| {
            let Ok(answers) = self.answers.lock() else { return Ok(None) };
            loop {
                match answers.recv_timeout(SIGNAL_INTERVAL) {
                    Ok(answer) => return Ok(Some(answer)),
                    Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals())?,
                    Err(RecvTimeoutError::Disconnected) => return Ok(None),
                }
            }
        });
        answer?.ok_or_else(gone)
    }
}

/// Shows the steps requested, and waits after each.
struct Steps {
    requests: Receiver<Asked>,
    replies: Sender<Answer>,
    failure: Failure,
}

impl<Q: Seen> Observer<Q> for Steps {
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        if self.failure.get().is_some() {
            return Flow::Stop;
        }
        let mut sent = self.replies.send(Answer::Step(step.t_after, Q::split(step.after)));
        while sent.is_ok() {
            match self.requests.recv() {
                Ok(Asked::Step) => return Flow::Continue,
                Ok(Asked::Curve) => {
                    let curve = Solution {
                        times: vec![step.t_before],
                        states: vec![step.before.clone()],
                        segments: vec![(step.t_after, step.interpolant())],
                    };
                    sent = self.replies.send(Answer::Curve(Q::curves(curve)));
                }
                Err(_) => break,
            }
        }
        Flow::Stop
    }
}

/// A worker that runs a system.
fn worker_of<S>(system: S, initial: StateOf<S>, plan: Plan, failure: Failure) -> Result<Worker, Error>
where
    S: System<Configuration: Seen> + Send + 'static,
    StateOf<S>: Send,
    ByMethod: Engages<S>,
{
    Worker::start(failure, move |mut steps| {
        solve::integrate(&system, &initial, &plan, &mut steps).map(|_| ())
    })
}

/// Where an integration is.
struct Progress {
    t: f64,
    t_old: Option<f64>,
    states: Vec<RigidBodyState>,
    forces: Py<PyAny>,
    interaction: Option<Py<PyAny>>,
    worker: Option<Worker>,
    n_steps: u64,
    has_failed: bool,
}

/// An integration that is made step by step, as by SciPy's `OdeSolver`.
///
/// The steps are those of `somersault.integrate` with the same arguments. Between them the state and the forces can be changed,
/// whereupon the method starts afresh from there.
///
/// Parameters
/// ----------
/// body : RigidBody or sequence of RigidBody
///     The body, or the bodies.
/// state : State or sequence of State
///     State at `t0`, one for each body.
/// t0, t_bound : float
///     Start, and the time that is not passed, s; before `t0` for steps backwards.
/// dt : float, optional
///     Step, s; adapted to `rtol` and `atol` where it is left out.
/// method : str or MethodInfo, optional
///     A method of the table; ``"rkmk"`` unless given, or ``"rkmk8_b"`` where the steps are adapted.
/// forces : force model, callable, or sequence of them, optional
///     What acts on the body or the bodies, as in `somersault.integrate`.
/// interaction : Gravitation or callable, optional
///     What acts between several bodies.
/// rtol, atol, max_step, first_step : float, optional
///     As in `somersault.integrate`.
/// max_steps : int, optional
///     Largest number of steps from the start or the last change on.
/// start_up : {'one_step', 'ladder'}, optional
///     As in `somersault.integrate`.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed.
///
/// Notes
/// -----
/// A thread waits with the method's memory between steps, which costs some ten microseconds a step; for whole motions take
/// `somersault.integrate`. A stepper is not copied, pickled or used after a fork. Contacts are those of `somersault.integrate` only.
///
/// Examples
/// --------
/// A thruster that is switched off after 4 s:
///
/// >>> import somersault
/// >>> body = somersault.RigidBody(1.0, (1.0, 1.0, 2.0))
/// >>> thruster = somersault.forces.Torque((0.0, 0.0, 0.5), frame="body")
/// >>> stepper = somersault.Stepper(body, somersault.State(), 0.0, 10.0, dt=0.1, forces=thruster)
/// >>> for _ in range(40):
/// ...     stepper.step()
/// >>> stepper.set_forces(None)
/// >>> while stepper.status == "running":
/// ...     stepper.step()
/// >>> stepper.t, stepper.n_steps, stepper.state.angular_velocity.round(6) + 0.0
/// (10.0, 100, array([0., 0., 1.]))
/// >>> stepper.dense_output()(9.95).angular_velocity.round(6) + 0.0
/// array([0., 0., 1.])
#[pyclass(frozen, module = "somersault")]
pub(crate) struct Stepper {
    cast: Cast,
    t_bound: f64,
    method: Method,
    options: Options,
    arguments: StepArguments,
    progress: Mutex<Progress>,
}

impl Stepper {
    /// Where the integration is, unless another thread makes a step.
    fn progress(&self) -> Result<MutexGuard<'_, Progress>, Error> {
        self.progress.try_lock().map_err(|_| Error::input("another thread makes a step of this stepper"))
    }

    /// A driver from here on.
    fn worker(&self, py: Python<'_>, progress: &Progress) -> Result<Worker, Error> {
        let (steps, backwards) = self.arguments.either_way(self.method, (progress.t, self.t_bound))?;
        let failure = Failure::default();
        let mut reader = Reader { failure: failure.clone(), calls_python: false };
        let forces = progress.forces.bind(py);
        let plan = Plan {
            method: self.method,
            options: self.options,
            steps,
            backwards,
            every: 1,
            t_eval: None,
            dense: false,
            calls_python: true,
            return_interrupted: false,
        };
        if !self.cast.single {
            let each = reader.for_each("forces", &self.cast.bodies, forces)?;
            let each = each.into_iter().map(|models| either_way(models, backwards)).collect();
            let mut between = reader.between(progress.interaction.as_ref().map(|value| value.bind(py)))?;
            if backwards {
                between = Box::new(TimeReversed(between));
            }
            let system = RigidBodiesSystem::try_new(self.cast.bodies.clone(), each, between)?;
            return worker_of(system, State::from_bodies(&progress.states), plan, failure);
        }
        let (body, state) = (self.cast.bodies[0], progress.states[0]);
        let models = either_way(reader.sum("forces", &body, forces)?, backwards);
        if models.is_empty() {
            worker_of(RigidBodySystem::free(body), state, plan, failure)
        } else {
            worker_of(RigidBodySystem::new(body, models), state, plan, failure)
        }
    }
}

#[pymethods]
impl Stepper {
    #[new]
    #[pyo3(signature = (
        body, state, t0, t_bound, *, dt=None, method=None, forces=None, interaction=None, rtol=None, atol=None, max_step=None,
        first_step=None, max_steps=None, start_up="one_step"
    ))]
    fn new(
        py: Python<'_>,
        body: &Bound<'_, PyAny>,
        state: &Bound<'_, PyAny>,
        t0: f64,
        t_bound: f64,
        dt: Option<f64>,
        method: Option<&Bound<'_, PyAny>>,
        forces: Option<Py<PyAny>>,
        interaction: Option<Py<PyAny>>,
        rtol: Option<f64>,
        atol: Option<f64>,
        max_step: Option<f64>,
        first_step: Option<f64>,
        #[pyo3(from_py_with = integer_or_none)] max_steps: Option<i64>,
        start_up: &str,
    ) -> Result<Self, Error> {
        let cast = Cast::extract("body", body)?;
        let states = cast.states("state", state)?;
        let default = if dt.is_some() { Method::Rkmk } else { Method::Rkmk8B };
        let method = method.map_or(Ok(default), |method| methods::extract("method", method))?;
        if cast.single && interaction.is_some() {
            return Err(Error::input("`interaction` acts between several bodies, and there is one"));
        }
        if t0 == t_bound || !t0.is_finite() || !t_bound.is_finite() {
            return Err(Error::input(format!(
                "`t_bound` must be a finite time other than `t0`, found {t_bound} from {t0} on"
            )));
        }
        let stepper = Self {
            cast,
            t_bound,
            method,
            options: Options { start_up: start_up_of(start_up)? },
            arguments: StepArguments { dt, rtol, atol, max_step, first_step, max_steps },
            progress: Mutex::new(Progress {
                t: t0,
                t_old: None,
                states,
                forces: forces.unwrap_or_else(|| py.None()),
                interaction,
                worker: None,
                n_steps: 0,
                has_failed: false,
            }),
        };
        // what is wrong with the arguments is said here, not by the first step
        let worker = stepper.worker(py, &*stepper.progress()?)?;
        stepper.progress()?.worker = Some(worker);
        Ok(stepper)
    }

    /// Makes one step.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If `t_bound` is reached, a step failed before, or another thread makes a step.
    /// IntegrationError
    ///     If the step fails; then `status` is ``"failed"``, and the state that before the step. So it is where a callable raises or
    ///     Ctrl-C interrupts the step.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> body = somersault.RigidBody(1.0, (1.0, 2.0, 2.5))
    /// >>> stepper = somersault.Stepper(body, somersault.State(angular_velocity=(0.1, 1.0, 0.0)), 0.0, 5.0)
    /// >>> stepper.step()
    /// >>> 0.0 < stepper.t < 5.0
    /// True
    fn step(&self, py: Python<'_>) -> Result<(), Error> {
        let mut progress = self.progress()?;
        if progress.has_failed {
            return Err(Error::input("a step of this stepper failed: give it another state by `set_state`"));
        }
        if progress.t == self.t_bound {
            return Err(Error::input(format!("the stepper has reached `t_bound` = {}", self.t_bound)));
        }
        let worker = match progress.worker.take() {
            Some(worker) => worker,
            None => self.worker(py, &progress)?,
        };
        let answer = worker.ask(py, Asked::Step);
        if let Some(raised) = worker.failure.get() {
            progress.has_failed = true;
            return Err(raised.clone_ref(py).into());
        }
        match answer {
            Ok(Answer::Step(t, states)) => {
                progress.t_old = Some(progress.t);
                (progress.t, progress.states) = (t, states);
                progress.n_steps += 1;
                progress.worker = Some(worker);
                Ok(())
            }
            Ok(Answer::Ended(Some(error))) => {
                progress.has_failed = true;
                Err(error.into())
            }
            Ok(Answer::Ended(None) | Answer::Curve(_)) => {
                progress.has_failed = true;
                Err(Error::of_system("the run ended early".to_owned()))
            }
            Err(error) => {
                progress.has_failed = true;
                Err(error)
            }
        }
    }

    /// The curve of the last step.
    ///
    /// Returns
    /// -------
    /// DenseOutput
    ///     The state at any time of that step.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If no step was made since the start or the last change.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> body, fall = somersault.RigidBody.sphere(1.0, 0.1), somersault.forces.Gravity()
    /// >>> stepper = somersault.Stepper(body, somersault.State(), 0.0, 1.0, dt=0.5, forces=fall)
    /// >>> stepper.step()
    /// >>> stepper.dense_output()(0.25).position.round(3)
    /// array([ 0.   ,  0.   , -0.307])
    fn dense_output(&self, py: Python<'_>) -> Result<DenseOutput, Error> {
        let progress = self.progress()?;
        let none = || Error::input("there is no step since the start or the last change, and so no curve");
        let worker = match (&progress.worker, progress.t_old) {
            (Some(worker), Some(_)) => worker,
            _ => return Err(none()),
        };
        match worker.ask(py, Asked::Curve)? {
            Answer::Curve(curves) => {
                if let Some(raised) = worker.failure.get() {
                    return Err(raised.clone_ref(py).into());
                }
                Ok(DenseOutput { cast: self.cast.clone(), curves: Arc::new(curves) })
            }
            Answer::Step(..) | Answer::Ended(_) => Err(none()),
        }
    }

    /// Continues from another state at the same time; the method starts afresh.
    ///
    /// Parameters
    /// ----------
    /// state : State or sequence of State
    ///     The state, one for each body.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> body = somersault.RigidBody.sphere(1.0, 0.1)
    /// >>> stepper = somersault.Stepper(body, somersault.State(), 0.0, 1.0, dt=0.5)
    /// >>> stepper.set_state(somersault.State(velocity=(2.0, 0.0, 0.0)))
    /// >>> stepper.step()
    /// >>> stepper.state.position
    /// array([1., 0., 0.])
    fn set_state(&self, state: &Bound<'_, PyAny>) -> Result<(), Error> {
        let states = self.cast.states("state", state)?;
        let mut progress = self.progress()?;
        (progress.states, progress.worker, progress.t_old) = (states, None, None);
        progress.has_failed = false;
        Ok(())
    }

    /// Continues under other forces; the method starts afresh.
    ///
    /// Parameters
    /// ----------
    /// forces : force model, callable, sequence of them, or None
    ///     What acts from now on, in the place of what acted before.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> body = somersault.RigidBody.sphere(2.0, 0.1)
    /// >>> stepper = somersault.Stepper(body, somersault.State(), 0.0, 1.0, dt=0.5)
    /// >>> stepper.set_forces(somersault.forces.Force((4.0, 0.0, 0.0)))
    /// >>> stepper.step()
    /// >>> stepper.state.velocity
    /// array([1., 0., 0.])
    #[pyo3(signature = (forces))]
    fn set_forces(&self, py: Python<'_>, forces: Py<PyAny>) -> Result<(), Error> {
        let mut progress = self.progress()?;
        let before = std::mem::replace(&mut progress.forces, forces);
        if progress.t != self.t_bound {
            match self.worker(py, &progress) {
                Ok(worker) => progress.worker = Some(worker),
                Err(error) => {
                    progress.forces = before;
                    return Err(error);
                }
            }
            progress.t_old = None;
        }
        progress.has_failed = false;
        Ok(())
    }

    /// float: Time reached, s.
    #[getter]
    fn t(&self) -> Result<f64, Error> {
        Ok(self.progress()?.t)
    }

    /// float or None: Time before the last step, s; None before the first step and after a change of state or forces.
    #[getter]
    fn t_old(&self) -> Result<Option<f64>, Error> {
        Ok(self.progress()?.t_old)
    }

    /// float: The time that is not passed, s.
    #[getter]
    fn t_bound(&self) -> f64 {
        self.t_bound
    }

    /// float or None: Size of the last step, s.
    #[getter]
    fn step_size(&self) -> Result<Option<f64>, Error> {
        let progress = self.progress()?;
        Ok(progress.t_old.map(|before| (progress.t - before).abs()))
    }

    /// State or list of State: State at `t`.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Error> {
        let progress = self.progress()?;
        let now = Trajectory::new(self.cast.clone(), vec![progress.t], progress.states.clone());
        Ok(now.state(py, 0)?)
    }

    /// {'running', 'finished', 'failed'}: Whether steps can be made, `t_bound` is reached, or a step failed.
    #[getter]
    fn status(&self) -> Result<&'static str, Error> {
        let progress = self.progress()?;
        Ok(if progress.has_failed {
            "failed"
        } else if progress.t == self.t_bound {
            "finished"
        } else {
            "running"
        })
    }

    /// int: Steps made.
    #[getter]
    fn n_steps(&self) -> Result<u64, Error> {
        Ok(self.progress()?.n_steps)
    }

    fn __repr__(&self) -> Result<String, Error> {
        let (t, name) = (self.t()?, self.method.info().name);
        Ok(format!("<Stepper by {name} at t = {t} of {}, {}>", self.t_bound, self.status()?))
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "a Stepper cannot be copied or pickled: take its `t` and `state`, and make another one from there",
        ))
    }
}
