//! An integration that is made step by step.
//!
//! The driver of `integrate` runs on a thread of its own and waits after every step for a request of the next one, so that the
//! steps, the events of functions and those of contacts are those of `integrate` itself.

use crate::core::callable::Failure;
use crate::core::convert::{array, integer_or_none};
use crate::core::error::Error;
use crate::integrators::event::Event;
use crate::integrators::forces::models::{Reader, states_list};
use crate::integrators::methods;
use crate::integrators::monitor::ended_by_event;
use crate::integrators::plan::{Plan, StepArguments, start_up_of, stiff_of};
use crate::integrators::problem::{Problem, Stretches, Use};
use crate::integrators::seen::{Curves, Seen};
use crate::integrators::solve::{Bodies, Ended};
use crate::integrators::trajectory::{Cast, DenseOutput, EventArrays, Trajectory, event_arrays};
use crate::integrators::watching::{EventFunctions, EventWatch, certified, unproved};
use pyo3::exceptions::{PyRuntimeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use somersault::contact::event::EventKind;
use somersault::integrators::driver::{Flow, Observer, Step};
use somersault::integrators::events::{Location, WatchProgress};
use somersault::integrators::methods::{Method, Options};
use somersault::integrators::nalgebra::Vector3;
use somersault::integrators::solution::Solution;
use somersault::integrators::state::{RigidBodyState, State};
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
    Step(Box<Made>),
    Curve(Curves),
    /// The run is over, by an error or without one.
    Ended(Option<Error>),
}

/// A step that was made, and what happened in it.
struct Made {
    t: f64,
    states: Vec<RigidBodyState>,
    stretches: Vec<Vector3<f64>>,
    /// The events of functions: which, when, and the states.
    found: Vec<(usize, f64, Vec<RigidBodyState>)>,
    /// The function whose event ends the run, if one does.
    ended_by: Option<usize>,
    watch: Option<WatchProgress>,
    /// The changes in contacts at its end: guard, kind and impulse.
    changes: Vec<(usize, EventKind, f64)>,
    /// How many contacts there are.
    contacts: usize,
    /// Since the run began.
    rejected: u64,
    nfev: u64,
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
        run: impl FnOnce(Requests) -> Result<(), Error> + Send + 'static,
    ) -> Result<Self, Error> {
        let (asked, requests) = channel();
        let (replies, answers) = channel();
        let requests = Requests { requests, replies: replies.clone() };
        let thread = std::thread::Builder::new().name("somersault".to_owned()).spawn(move || {
            if matches!(requests.requests.recv(), Ok(Asked::Step)) {
                let ended = run(requests).err();
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

impl Drop for Worker {
    /// Lets a step that is being made end soon: callables are not called any more.
    fn drop(&mut self) {
        self.failure.set(PyRuntimeError::new_err("the steps were given up"));
    }
}

/// The two ends of the line between a thread that makes steps and who asks for them.
struct Requests {
    requests: Receiver<Asked>,
    replies: Sender<Answer>,
}

/// Shows the steps requested, with their events, and waits after each.
struct Steps<'a, Q: Seen> {
    line: Requests,
    failure: Failure,
    events: Option<(EventFunctions, EventWatch<Q>)>,
    /// Evaluations of a run that has tried so many steps.
    evaluations: &'a dyn Fn(u64) -> u64,
    contacts: usize,
}

impl<Q: Seen> Steps<'_, Q> {
    /// What is said of a step; a run that ends within it has no changes at its end.
    fn made(&mut self, step: &Step<'_, Q>) -> Made {
        let end = step.end();
        let (t, state) = end.map_or((step.t_after, step.after), |(t, state)| (*t, state));
        let changes = if end.is_none() { step.changes } else { &[] };
        let kind = |guard, before, after| EventKind::of_guard(self.contacts, guard, before, after);
        let changes =
            changes.iter().map(|c| (c.guard, kind(c.guard, &c.before, &c.after), c.impulse)).collect();
        let watch = self.events.as_mut().map(|(_, watch)| watch);
        let (mut found, mut ended_by, mut progress) = (Vec::new(), None, None);
        if let Some(watch) = watch {
            let occurrences = watch.take_occurrences().into_iter();
            found = occurrences.map(|event| (event.function, event.t, Q::split(&event.state))).collect();
            (ended_by, progress) = (watch.ended_by(), Some(watch.progress()));
        }
        Made {
            t,
            states: Q::split(state),
            stretches: Q::stretches(state).to_vec(),
            found,
            ended_by,
            watch: progress,
            changes,
            contacts: self.contacts,
            rejected: step.rejected,
            nfev: (self.evaluations)(step.index + step.rejected),
        }
    }
}

impl<Q: Seen> Observer<Q> for Steps<'_, Q> {
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        let mut flow = Flow::Continue;
        if let Some((functions, watch)) = &mut self.events {
            flow = watch.observe(step);
            if let Some(reason) = watch.fault() {
                self.failure.set(functions.error(reason).into());
            }
        }
        if self.failure.get().is_some() {
            return Flow::Stop;
        }
        let made = self.made(step);
        let t = made.t;
        let mut sent = self.line.replies.send(Answer::Step(Box::new(made)));
        while sent.is_ok() {
            match self.line.requests.recv() {
                Ok(Asked::Step) => return flow,
                Ok(Asked::Curve) => {
                    let curve = Solution {
                        times: vec![step.t_before],
                        states: vec![step.before.clone()],
                        segments: vec![(t, step.interpolant())],
                    };
                    sent = self.line.replies.send(Answer::Curve(Q::curves(curve)));
                }
                Err(_) => break,
            }
        }
        Flow::Stop
    }
}

/// A driver at work, and the stretches of contacts that it starts from.
type Started = (Worker, Vec<Vector3<f64>>);

/// A driver to be started.
struct Start<'py> {
    py: Python<'py>,
    plan: Plan,
    events: Option<EventFunctions>,
    watch: Option<WatchProgress>,
    failure: Failure,
}

impl Use for Start<'_> {
    type Output = Started;

    fn with<B: Bodies>(self, bodies: B, initial: State<B::Configuration>, _: bool) -> Result<Started, Error> {
        let Self { py, plan, events, watch, failure } = self;
        let stretches = B::Configuration::stretches(&initial).to_vec();
        let events = events.map(|functions| {
            let watching = functions.watch(
                py,
                Box::new(|py, t, x| Ok((t, B::Configuration::to_python(py, x)?).into_pyobject(py)?.unbind())),
                &failure,
            );
            let watching = match watch {
                Some(progress) => watching.resuming(progress),
                None => watching,
            };
            (functions, watching)
        });
        let worker = Worker::start(failure.clone(), move |line| {
            let evaluations = |tried| bodies.evaluations(&plan, tried);
            let contacts = bodies.contacts();
            let mut steps = Steps { line, failure, events, evaluations: &evaluations, contacts };
            let Ended { status, .. } = bodies.solve(&initial, &plan, &mut steps);
            status.map(|_| ())
        })?;
        Ok((worker, stretches))
    }
}

/// Where an integration is.
struct Progress {
    t: f64,
    t_old: Option<f64>,
    states: Vec<RigidBodyState>,
    /// Those of contacts that are located.
    stretches: Vec<Vector3<f64>>,
    forces: Py<PyAny>,
    worker: Option<Worker>,
    n_steps: u64,
    /// Of this worker, and of those before it.
    counts: Counts,
    counts_before: Counts,
    watch: Option<WatchProgress>,
    /// The events of each function: times, and states of all bodies.
    found: Vec<(Vec<f64>, Vec<RigidBodyState>)>,
    /// What happened in contacts, if it is kept, and how often something did.
    happened: Vec<Py<Event>>,
    n_events: u64,
    outcome: Outcome,
}

/// How often equations were evaluated and steps rejected.
#[derive(Clone, Copy, Default)]
struct Counts {
    nfev: u64,
    rejected: u64,
}

/// How it stands with an integration.
enum Outcome {
    Running,
    Finished(String),
    Failed(String),
}

/// An integration that is made step by step, as by SciPy's `OdeSolver`.
///
/// Steps and events are those of `somersault.integrate` with the same arguments. Between steps the state and the forces can be changed,
/// whereupon the method starts afresh from there, also after a terminal event.
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
/// contacts, pairs, stretches, locate : optional
///     What touches, as in `somersault.integrate`; steps end where a contact begins or ends.
/// max_event_rate, keep_events, graze, max_substeps : optional
///     As in `somersault.integrate`.
/// events : callable or sequence of callable, optional
///     Functions of which changes of sign are looked for, with their attributes ``terminal``, ``direction`` and ``lipschitz`` as in
///     `somersault.integrate`. The step that a terminal event is in ends there, and with it the integration: `status` is
///     ``"finished"`` and `message` names the function.
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
/// `somersault.integrate`. A stepper is not copied, pickled or used after a fork. A thread whose stepper is gone ends with the step that
/// it is making.
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
///
/// One that is switched off as soon as the body has turned by a quarter:
///
/// >>> def quarter(t, state):
/// ...     return state.orientation.as_rotvec()[2] - 1.5707963267948966
/// >>> quarter.terminal = True
/// >>> stepper = somersault.Stepper(body, somersault.State(), 0.0, 5.0, dt=0.1, forces=thruster, events=quarter)
/// >>> while stepper.status == "running":
/// ...     stepper.step()
/// >>> stepper.message.partition(" at ")[0], round(stepper.t, 9)
/// ('ended by an event of `events[0]` (quarter)', 3.544907702)
/// >>> stepper.set_forces(None)
/// >>> while stepper.status == "running":
/// ...     stepper.step()
/// >>> stepper.t, stepper.n_steps, stepper.t_events[0].round(9)
/// (5.0, 51, array([3.5449077]))
#[pyclass(frozen, module = "somersault")]
pub(crate) struct Stepper {
    cast: Cast,
    t_bound: f64,
    method: Method,
    options: Options,
    arguments: StepArguments,
    interaction: Option<Py<PyAny>>,
    contacts: Option<Py<PyAny>>,
    pairs: Option<Py<PyAny>>,
    locate: bool,
    location: Location,
    events: Option<EventFunctions>,
    progress: Mutex<Progress>,
}

impl Stepper {
    /// Where the integration is, unless another thread makes a step.
    fn progress(&self) -> Result<MutexGuard<'_, Progress>, Error> {
        self.progress.try_lock().map_err(|_| Error::input("another thread makes a step of this stepper"))
    }

    /// A driver from here on, with the stretches given or those of the last state.
    fn worker(
        &self,
        py: Python<'_>,
        progress: &Progress,
        stretches: Option<&Bound<'_, PyAny>>,
    ) -> Result<Started, Error> {
        let (steps, backwards) = self.arguments.either_way(self.method, (progress.t, self.t_bound))?;
        if backwards && (self.contacts.is_some() || self.pairs.is_some()) {
            return Err(Error::input(
                "`t_bound` must be after `t0` where there are contacts: they dissipate, and many motions lead to one state",
            ));
        }
        let failure = Failure::default();
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
        let bind = |value: &'_ Option<Py<PyAny>>| value.as_ref().map(|value| value.bind(py).clone());
        let [interaction, contacts, pairs] = [&self.interaction, &self.contacts, &self.pairs].map(bind);
        let problem = Problem {
            cast: &self.cast,
            forces: progress.forces.bind(py),
            interaction: interaction.as_ref(),
            contacts: contacts.as_ref(),
            pairs: pairs.as_ref(),
            locate: self.locate,
            location: self.location,
            backwards,
        };
        let events = self.events.as_ref().map(|events| events.clone_ref(py));
        let start = Start { py, plan, events, watch: progress.watch.clone(), failure: failure.clone() };
        let stretches = match stretches {
            Some(given) => Stretches::Argument(Some(given)),
            None => Stretches::Known(progress.stretches.clone()),
        };
        let reader = Reader { failure, calls_python: false };
        problem.using(reader, progress.t, &progress.states, &stretches, start)
    }

    /// The same, unless the bound of the time is reached.
    fn worker_unless_over(
        &self,
        py: Python<'_>,
        progress: &Progress,
        stretches: Option<&Bound<'_, PyAny>>,
    ) -> Result<Option<Started>, Error> {
        let is_over = progress.t == self.t_bound;
        if is_over { Ok(None) } else { self.worker(py, progress, stretches).map(Some) }
    }

    /// Times and states of the events of functions.
    fn function_events(&self, py: Python<'_>) -> Result<Option<EventArrays>, Error> {
        let progress = self.progress()?;
        let found = || event_arrays(py, &self.cast, progress.found.iter().cloned());
        Ok(self.events.as_ref().map(|_| found()).transpose()?)
    }
}

impl Progress {
    /// Puts a driver in the place of the last one; the integration continues unless it is over.
    fn replace(&mut self, started: Option<Started>) {
        let Counts { nfev, rejected } = std::mem::take(&mut self.counts);
        self.counts_before.nfev += nfev;
        self.counts_before.rejected += rejected;
        (self.worker, self.t_old) = (None, None);
        if let Some((worker, stretches)) = started {
            (self.worker, self.stretches, self.outcome) = (Some(worker), stretches, Outcome::Running);
        }
    }

    /// Takes in a step that was made.
    fn take_in(&mut self, py: Python<'_>, stepper: &Stepper, made: Made) -> Result<(), Error> {
        let Made { t, states, stretches, found, ended_by, watch, changes, contacts, rejected, nfev } = made;
        self.n_events += changes.len() as u64;
        if stepper.location.keep_events && !changes.is_empty() {
            let state = if stepper.cast.single {
                Bound::new(py, crate::integrators::bodies::State(states[0]))?.into_any().unbind()
            } else {
                states_list(py, &State::from_bodies(&states))?.into_any().unbind()
            };
            for (guard, kind, impulse) in changes {
                let event = Event::new_at(t, (contacts, guard), kind, impulse, state.clone_ref(py));
                self.happened.push(Py::new(py, event)?);
            }
        }
        for (function, t, states) in found {
            let (times, all) = &mut self.found[function];
            times.push(t);
            all.extend(states);
        }
        self.t_old = Some(self.t);
        (self.t, self.states, self.stretches, self.watch) = (t, states, stretches, watch);
        self.counts = Counts { nfev, rejected };
        self.n_steps += 1;
        let functions = stepper.events.as_ref();
        if let Some(name) = functions.and_then(|functions| Some(functions.name(ended_by?))) {
            self.outcome = Outcome::Finished(ended_by_event(&name, t));
        } else if t == stepper.t_bound {
            self.outcome = Outcome::Finished(format!("reached `t_bound` = {t}"));
        }
        Ok(())
    }
}

#[pymethods]
impl Stepper {
    #[new]
    #[pyo3(signature = (
        body, state, t0, t_bound, *, dt=None, method=None, forces=None, interaction=None, contacts=None, pairs=None, stretches=None,
        locate=true, max_event_rate=1e9, keep_events=true, graze=1e-6, max_substeps=Some(100_000), events=None, rtol=None, atol=None,
        max_step=None, first_step=None, max_steps=None, start_up="one_step"
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
        contacts: Option<Py<PyAny>>,
        pairs: Option<Py<PyAny>>,
        stretches: Option<&Bound<'_, PyAny>>,
        locate: bool,
        max_event_rate: f64,
        keep_events: bool,
        graze: f64,
        #[pyo3(from_py_with = integer_or_none)] max_substeps: Option<i64>,
        events: Option<&Bound<'_, PyAny>>,
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
        let events = events.map(|events| EventFunctions::extract("f(t, state)", events)).transpose()?;
        if t0 == t_bound || !t0.is_finite() || !t_bound.is_finite() {
            return Err(Error::input(format!(
                "`t_bound` must be a finite time other than `t0`, found {t_bound} from {t0} on"
            )));
        }
        let n_functions = events.as_ref().map_or(0, EventFunctions::len);
        let stepper = Self {
            cast,
            t_bound,
            method,
            options: Options { start_up: start_up_of(start_up)? },
            arguments: StepArguments { dt, rtol, atol, max_step, first_step, max_steps },
            interaction,
            contacts,
            pairs,
            locate,
            location: Location { max_event_rate, keep_events, graze, stiff: stiff_of(max_substeps)? },
            events,
            progress: Mutex::new(Progress {
                t: t0,
                t_old: None,
                states,
                stretches: Vec::new(),
                forces: forces.unwrap_or_else(|| py.None()),
                worker: None,
                n_steps: 0,
                counts: Counts::default(),
                counts_before: Counts::default(),
                watch: None,
                found: vec![(Vec::new(), Vec::new()); n_functions],
                happened: Vec::new(),
                n_events: 0,
                outcome: Outcome::Running,
            }),
        };
        // what is wrong with the arguments is said here, not by the first step
        let started = stepper.worker(py, &*stepper.progress()?, stretches)?;
        stepper.progress()?.replace(Some(started));
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
        match &progress.outcome {
            Outcome::Running => {}
            Outcome::Failed(_) => {
                return Err(Error::input(
                    "a step of this stepper failed: give it another state by `set_state`",
                ));
            }
            Outcome::Finished(_) if progress.t == self.t_bound => {
                return Err(Error::input(format!("the stepper has reached `t_bound` = {}", self.t_bound)));
            }
            Outcome::Finished(reason) => {
                return Err(Error::input(format!(
                    "the stepper has {reason}: change its forces or its state to continue"
                )));
            }
        }
        let worker = match progress.worker.take() {
            Some(worker) => worker,
            None => self.worker(py, &progress, None)?.0,
        };
        let answer = worker.ask(py, Asked::Step);
        let error = match (worker.failure.get(), answer) {
            (Some(raised), _) => raised.clone_ref(py).into(),
            (None, Ok(Answer::Step(made))) => {
                progress.worker = Some(worker);
                return progress.take_in(py, self, *made);
            }
            (None, Ok(Answer::Ended(Some(error))) | Err(error)) => error,
            (None, Ok(Answer::Ended(None) | Answer::Curve(_))) => {
                Error::of_system("the run ended early".to_owned())
            }
        };
        progress.outcome =
            Outcome::Failed(format!("a step failed after t = {}: {}", progress.t, error.message()));
        Err(error)
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
    /// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
    ///     Stretches of the friction of contacts, as in `somersault.integrate`; unstretched unless given.
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
    #[pyo3(signature = (state, *, stretches=None))]
    fn set_state(
        &self,
        py: Python<'_>,
        state: &Bound<'_, PyAny>,
        stretches: Option<&Bound<'_, PyAny>>,
    ) -> Result<(), Error> {
        let states = self.cast.states("state", state)?;
        let mut progress = self.progress()?;
        let states = std::mem::replace(&mut progress.states, states);
        let of_contacts = std::mem::take(&mut progress.stretches);
        let watch = progress.watch.clone();
        progress.watch = watch.clone().map(WatchProgress::from_another_state);
        match self.worker_unless_over(py, &progress, stretches) {
            Ok(started) => progress.replace(started),
            Err(error) => {
                (progress.states, progress.stretches, progress.watch) = (states, of_contacts, watch);
                return Err(error);
            }
        }
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
        match self.worker_unless_over(py, &progress, None) {
            Ok(started) => progress.replace(started),
            Err(error) => {
                progress.forces = before;
                return Err(error);
            }
        }
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

    /// {'running', 'finished', 'failed'}: Whether steps can be made, `t_bound` is reached or a terminal event has ended the integration, or
    /// a step failed.
    #[getter]
    fn status(&self) -> Result<&'static str, Error> {
        Ok(match self.progress()?.outcome {
            Outcome::Running => "running",
            Outcome::Finished(_) => "finished",
            Outcome::Failed(_) => "failed",
        })
    }

    /// str: The same in words, with the reason.
    #[getter]
    fn message(&self) -> Result<String, Error> {
        let progress = self.progress()?;
        Ok(match &progress.outcome {
            Outcome::Running => format!("at t = {} of {}", progress.t, self.t_bound),
            Outcome::Finished(reason) | Outcome::Failed(reason) => reason.clone(),
        })
    }

    /// int: Steps made.
    #[getter]
    fn n_steps(&self) -> Result<u64, Error> {
        Ok(self.progress()?.n_steps)
    }

    /// int: Steps tried and rejected by the step size control, up to the last step that was made.
    #[getter]
    fn n_rejected(&self) -> Result<u64, Error> {
        let progress = self.progress()?;
        Ok(progress.counts_before.rejected + progress.counts.rejected)
    }

    /// int: How often the equations of motion were evaluated up to the last step that was made, as `Solution.nfev`.
    #[getter]
    fn nfev(&self) -> Result<u64, Error> {
        let progress = self.progress()?;
        Ok(progress.counts_before.nfev + progress.counts.nfev)
    }

    /// tuple of ndarray, or None: The times of the events of each function in `events=` so far, s. None without `events`.
    #[getter]
    fn t_events(&self, py: Python<'_>) -> Result<Option<Py<PyTuple>>, Error> {
        Ok(self.function_events(py)?.map(|(times, _)| times))
    }

    /// tuple of Trajectory, or None: The states at these times, for each function.
    #[getter]
    fn y_events(&self, py: Python<'_>) -> Result<Option<Py<PyTuple>>, Error> {
        Ok(self.function_events(py)?.map(|(_, states)| states))
    }

    /// tuple of bool, or None: For each function, whether no event can have been missed so far; see `Solution.certified`.
    #[getter]
    fn certified<'py>(&self, py: Python<'py>) -> Result<Option<Bound<'py, PyTuple>>, Error> {
        let progress = self.progress()?;
        let certificates = self.events.as_ref().map(|events| events.certificates(progress.watch.as_ref()));
        Ok(certificates.map(|found| certified(py, &found)).transpose()?)
    }

    /// tuple, or None: For each function start and end of the first step in which its bound did not suffice, s, or None.
    #[getter]
    fn unproved<'py>(&self, py: Python<'py>) -> Result<Option<Bound<'py, PyTuple>>, Error> {
        let progress = self.progress()?;
        let certificates = self.events.as_ref().map(|events| events.certificates(progress.watch.as_ref()));
        Ok(certificates.map(|found| unproved(py, &found)).transpose()?)
    }

    /// tuple of Event: What happened in contacts so far, in the order of time, where events were located and kept.
    #[getter]
    fn events<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyTuple>, Error> {
        let progress = self.progress()?;
        Ok(PyTuple::new(py, progress.happened.iter().map(|event| event.clone_ref(py)))?)
    }

    /// int: Number of events in contacts, kept or not.
    #[getter]
    fn n_events(&self) -> Result<u64, Error> {
        Ok(self.progress()?.n_events)
    }

    /// ndarray, shape (contacts, 3): Stretches of friction at `t`, m, world frame, as `Solution.stretches`.
    #[getter]
    fn stretches<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Error> {
        let progress = self.progress()?;
        let values: Vec<f64> = progress.stretches.iter().flatten().copied().collect();
        Ok(array(py, values, &[progress.stretches.len(), 3])?.into_any())
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
