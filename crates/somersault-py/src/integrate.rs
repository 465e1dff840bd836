//! The front door: integration of one body or of several.

use crate::error::Error;
use crate::event::Events;
use crate::forces::{Failure, Reader};
use crate::methods;
use crate::trajectory::{Cast, Report, Seen, Solution};
use pyo3::exceptions::{PyKeyboardInterrupt, PyModuleNotFoundError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::contact::contacts::BodyInContact;
use somersault::contact::driver::integrate_located;
use somersault::contact::event::{Interrupted, Located, Location};
use somersault::integrators::body::RigidBody;
use somersault::integrators::driver::{
    Adaptive, Flow, IntegrateError, Observer, Outcome, Status, Step, TimeGrid,
};
use somersault::integrators::force::{BoxedForce, ForceModel, Wrench};
use somersault::integrators::methods::{Method, Options, StartUp};
use somersault::integrators::solution::Recorder;
use somersault::integrators::state::{Pose, RigidBodyState, State, Tolerances};
use somersault::integrators::studies::work_precision::Counted;
use somersault::integrators::system::{RigidBodiesSystem, RigidBodySystem, RigidSystem, StateOf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// How often a run looks whether it is to stop.
const ATTENTION: Duration = Duration::from_millis(50);

/// How many steps lie between two looks at the clock.
const STEPS_PER_LOOK: u64 = 64;

/// How the steps are chosen.
#[derive(Clone, Copy)]
enum Steps {
    Fixed(TimeGrid),
    Adapted((f64, f64), Adaptive),
}

/// A run, as asked for.
struct Plan {
    method: Method,
    options: Options,
    steps: Steps,
    start: f64,
    every: u64,
    dense: bool,
    calls_python: bool,
    return_interrupted: bool,
}

/// A bar that shows how far a run has come.
struct ProgressBar {
    bar: Py<PyAny>,
    shown: f64,
}

impl ProgressBar {
    fn open(py: Python<'_>, start: f64, end: f64) -> PyResult<Self> {
        let tqdm = py.import("tqdm.auto").map_err(|error| {
            if error.is_instance_of::<PyModuleNotFoundError>(py) {
                PyModuleNotFoundError::new_err(
                    "`progress` needs tqdm, which the extra `somersault[progress]` installs",
                )
            } else {
                error
            }
        })?;
        let options = PyDict::new(py);
        options.set_item("total", end - start)?;
        options
            .set_item("bar_format", "{l_bar}{bar}| t = {n:.4g} of {total:.4g} s [{elapsed}<{remaining}]")?;
        let bar = tqdm.getattr("tqdm")?.call((), Some(&options))?.unbind();
        Ok(Self { bar, shown: start })
    }

    fn show(&mut self, py: Python<'_>, t: f64) -> PyResult<()> {
        self.bar.call_method1(py, "update", (t - self.shown,))?;
        self.shown = t;
        Ok(())
    }
}

/// Records a run, shows it to Python, and stops it where Python says so.
struct Monitor<Q: Seen> {
    recorder: Recorder<Q>,
    observer: Option<Py<PyAny>>,
    progress: Option<ProgressBar>,
    failure: Failure,
    last_look: Instant,
    /// Steps made, and the time they reached.
    steps: u64,
    t: f64,
}

impl<Q: Seen> Monitor<Q> {
    /// Runs handlers of signals and moves the bar.
    fn look(&mut self, t: f64) -> PyResult<()> {
        self.last_look = Instant::now();
        let progress = &mut self.progress;
        Python::attach(|py| {
            py.check_signals()?;
            progress.as_mut().map_or(Ok(()), |bar| bar.show(py, t))
        })
    }
}

impl<Q: Seen> Observer<Q> for Monitor<Q> {
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        if self.failure.get().is_some() {
            return Flow::Stop;
        }
        let _ = self.recorder.observe(step);
        (self.steps, self.t) = (step.index, step.t_after);
        let mut flow = Flow::Continue;
        if let Some(observer) = &self.observer {
            let stop = Python::attach(|py| {
                let answer = observer.call1(py, (step.t_after, Q::to_python(py, step.after)?))?;
                answer.bind(py).is_truthy()
            });
            match stop {
                Ok(true) => flow = Flow::Stop,
                Ok(false) => {}
                Err(error) => self.failure.set(error),
            }
        }
        if step.index.is_multiple_of(STEPS_PER_LOOK)
            && self.last_look.elapsed() >= ATTENTION
            && let Err(error) = self.look(step.t_after)
        {
            self.failure.set(error);
        }
        if self.failure.get().is_some() { Flow::Stop } else { flow }
    }
}

/// How a run ended and what it took.
struct Ended<Q: Seen> {
    status: Result<Status, Error>,
    rejected: u64,
    nfev: u64,
    events: Events<Q>,
}

impl<Q: Seen> Ended<Q> {
    fn without_events(outcome: Result<Outcome<Q>, IntegrateError>, nfev: u64) -> Self {
        let rejected = outcome.as_ref().map_or(0, |outcome| outcome.rejected);
        let status = outcome.map(|outcome| outcome.status).map_err(Into::into);
        Self { status, rejected, nfev, events: Events::none() }
    }
}

/// Bodies to be integrated, and a count of how often their equations are evaluated.
trait Bodies: Sync {
    type Configuration: Seen;

    fn solve(
        &self,
        initial: &State<Self::Configuration>,
        plan: &Plan,
        observer: &mut Monitor<Self::Configuration>,
    ) -> Ended<Self::Configuration>;
}

/// A body without forces. Counting would hide from the methods that they can skip the forces.
struct Free(RigidBodySystem);

impl Bodies for Free {
    type Configuration = Pose;

    fn solve(&self, initial: &State<Pose>, plan: &Plan, observer: &mut Monitor<Pose>) -> Ended<Pose> {
        let outcome = plan.solve(&self.0, initial, observer);
        let rejected = outcome.as_ref().map_or(0, |outcome| outcome.rejected);
        let nfev = (observer.steps + rejected) * u64::from(plan.method.info().evaluations);
        Ended::without_events(outcome, nfev)
    }
}

/// Bodies under forces.
struct Forced<S>(S);

impl<S: RigidSystem<Configuration: Seen> + Sync> Bodies for Forced<S> {
    type Configuration = S::Configuration;

    fn solve(
        &self,
        initial: &StateOf<S>,
        plan: &Plan,
        observer: &mut Monitor<S::Configuration>,
    ) -> Ended<S::Configuration> {
        let system = Counted::new(&&self.0);
        let outcome = plan.solve(&system, initial, observer);
        Ended::without_events(outcome, system.calls())
    }
}

/// Models that add up and count how often they are evaluated.
struct CountedForces {
    models: Vec<BoxedForce>,
    calls: AtomicU64,
}

impl ForceModel for CountedForces {
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.calls.fetch_add(1, Ordering::Relaxed);
        self.models.wrench(t, body, x)
    }
    fn is_free(&self) -> bool {
        self.models.is_free()
    }
    fn is_torque_free(&self) -> bool {
        self.models.is_torque_free()
    }
    fn depends_on_velocity(&self) -> bool {
        self.models.depends_on_velocity()
    }
}

/// A body with contacts whose events are located.
struct InContact {
    system: BodyInContact<CountedForces>,
    grid: TimeGrid,
    location: Location,
}

impl Bodies for InContact {
    type Configuration = Pose;

    fn solve(&self, initial: &State<Pose>, plan: &Plan, observer: &mut Monitor<Pose>) -> Ended<Pose> {
        let Self { system, grid, location } = self;
        let found = integrate_located(plan.method, plan.options, system, initial, grid, location, observer);
        let (status, located) = match found {
            Ok(located) => (Ok(located.status), located),
            Err(interrupted) => {
                let Interrupted { reason, so_far } = *interrupted;
                (Err(reason.into()), so_far)
            }
        };
        let Located { trials, event_count, events, .. } = located;
        let nfev = system.forces.0.calls.load(Ordering::Relaxed);
        let events = Events { trials, count: event_count, events };
        Ended { status, rejected: 0, nfev, events }
    }
}

impl Plan {
    fn solve<S: RigidSystem>(
        &self,
        system: &S,
        initial: &StateOf<S>,
        observer: &mut Monitor<S::Configuration>,
    ) -> Result<Outcome<S::Configuration>, IntegrateError>
    where
        S::Configuration: Seen,
    {
        match &self.steps {
            Steps::Fixed(grid) => self.method.integrate(self.options, system, initial, grid, observer),
            Steps::Adapted(interval, control) => {
                self.method.integrate_adaptive(self.options, system, initial, *interval, control, observer)
            }
        }
    }
}

fn run<B: Bodies>(
    py: Python<'_>,
    cast: Cast,
    bodies: &B,
    initial: &State<B::Configuration>,
    plan: &Plan,
    observer: Option<Py<PyAny>>,
    progress: Option<ProgressBar>,
    failure: Failure,
) -> Result<Py<Solution>, Error> {
    let recorder = Recorder::new(plan.start, initial, plan.every);
    let mut monitor = Monitor {
        recorder: if plan.dense { recorder.with_dense_output() } else { recorder },
        observer,
        progress,
        failure,
        last_look: Instant::now(),
        steps: 0,
        t: plan.start,
    };
    let Ended { status, rejected, nfev, events } = if plan.calls_python {
        bodies.solve(initial, plan, &mut monitor)
    } else {
        let monitor = &mut monitor;
        py.detach(|| bodies.solve(initial, plan, monitor))
    };
    if let Some(bar) = &mut monitor.progress {
        bar.show(py, monitor.t)?;
        bar.bar.call_method0(py, "close")?;
    }
    let Monitor { recorder, failure, steps, t, .. } = monitor;
    // What Python raised comes before what the driver made of the numbers that followed.
    let failed = match (failure.get(), status) {
        (Some(error), _) => Err(error.clone_ref(py)),
        (None, status) => status.map_err(PyErr::from),
    };
    let (status, message) = match &failed {
        Ok(Status::Finished) => (0, "reached the end of the interval".to_owned()),
        Ok(Status::Stopped) => (1, format!("stopped by the observer at t = {t}")),
        Err(error) if error.is_instance_of::<PyKeyboardInterrupt>(py) => {
            (-1, format!("interrupted at t = {t}"))
        }
        Err(_) => (-2, format!("failed after t = {t}")),
    };
    let report = Report { status, message, nfev, n_steps: steps, n_rejected: rejected };
    let solution = Solution::create(py, cast, recorder.into_solution(), plan.dense, report, events)?;
    match failed {
        Err(error) if !(status == -1 && plan.return_interrupted) => {
            // An exception that takes no attributes is still the one to raise.
            let _ = error.value(py).setattr("solution", solution);
            Err(error.into())
        }
        _ => Ok(solution),
    }
}

/// The adaptive methods, for a message.
fn adaptive_names() -> String {
    let names: Vec<_> =
        Method::ALL.iter().map(|m| m.info()).filter(|i| i.embedded.is_some()).map(|i| i.name).collect();
    names.join(", ")
}

/// Motion of one rigid body, or of several, under forces.
///
/// Integrates m r̈ = F, Ṙ = ω̂ R and I ω̇ = M − ω × I ω from `state` over `interval`, with a fixed step
/// `dt` or, where `dt` is left out, with steps adapted to `rtol` and `atol`.
///
/// Parameters
/// ----------
/// body : RigidBody or sequence of RigidBody
///     The body, or the bodies.
/// state : State or sequence of State
///     State at the start, one for each body.
/// interval : tuple of float
///     Start and end time, s.
/// dt : float, optional
///     Step, s. Where it does not divide the interval the last step is shorter.
/// method : str or MethodInfo, optional
///     A method of the table that `somersault.methods` returns; ``"rkmk"`` unless given, or ``"rkmk8_b"``
///     where the steps are adapted.
/// forces : force model, callable, or sequence of them, optional
///     What acts on the body; the models of a sequence add up. A callable ``f(t, state)`` returns force
///     and torque about the centre of mass, world frame. For several bodies a sequence has one entry
///     for each of them, itself a model, a sequence or None; a single model acts on every body.
/// interaction : Gravitation or callable, optional
///     What acts between several bodies. A callable ``f(t, states)`` returns forces and torques, each of
///     shape (bodies, 3).
/// contacts : Contact or sequence of Contact, optional
///     Where a single body touches surfaces.
/// locate : bool, optional
///     Whether to cut steps where a contact begins or ends, so that the method keeps its order, and to log
///     these events. Otherwise the forces of contacts switch within steps.
/// max_event_rate : float, optional
///     Most events per second and contact, averaged over the last 64, 1e9 unless given; more are an error.
/// keep_events : bool, optional
///     Whether to keep the events; they are counted in any case.
/// rtol, atol : float, optional
///     Relative and absolute tolerance of an adaptive step, 1e-8 and 1e-10 unless given. Each vector is
///     weighed by its length; an orientation counts as one radian.
/// max_step, first_step : float, optional
///     Largest and first step of an adaptive run, s.
/// max_steps : int, optional
///     Largest number of steps of an adaptive run, 10 million unless given.
/// start_up : {'one_step', 'ladder'}, optional
///     How the Adams methods make their first steps: by a one-step method of order 4, or by their own
///     family with as many steps as there are.
/// dense_output : bool, optional
///     Whether to keep the curves between the steps, for ``solution.sol(t)``.
/// every : int, optional
///     Record every so many steps. The last is always recorded.
/// observer : callable, optional
///     ``f(t, state)``, called after every step; the run stops where it returns something true.
/// on_interrupt : {'raise', 'return'}, optional
///     At Ctrl-C, raise KeyboardInterrupt or return what was recorded with status −1.
/// progress : bool, optional
///     Whether to show a progress bar, for which tqdm must be installed.
///
/// Returns
/// -------
/// Solution
///     Times, states and what is derived from them.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed. Subclasses: `UnknownMethodError`, `IntegrateInputError`,
///     `TorqueError`, `CountMismatchError`, `SurfaceError`.
/// IntegrateError
///     If the run cannot go on: the state stopped being finite, a tolerance cannot be met, the equation
///     of an implicit step was not solved (`StepError`), events follow each other too fast
///     (`ChatteringError`).
///
/// Notes
/// -----
/// Other Python threads run meanwhile unless a callable is given. What a callable raises stops the run
/// and comes out as it is. Every exception that stops a run has what was recorded before in its attribute
/// `solution`.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
/// >>> start = somersault.State(velocity=(0.0, 0.0, 5.0), angular_velocity=(0.0, 8.0, 0.1))
/// >>> gravity = somersault.forces.Gravity()
/// >>> motion = somersault.integrate(body, start, (0.0, 1.0), dt=0.01, forces=gravity)
/// >>> motion.position.shape
/// (101, 3)
/// >>> round(float(motion.position[-1, 2]), 6)
/// 0.095
#[pyfunction]
#[pyo3(signature = (
    body, state, interval, *, dt=None, method=None, forces=None, interaction=None, contacts=None, locate=true,
    max_event_rate=1e9, keep_events=true, rtol=None, atol=None, max_step=None, first_step=None, max_steps=None, start_up="one_step", dense_output=false, every=1,
    observer=None, on_interrupt="raise", progress=false
))]
pub(crate) fn integrate<'py>(
    py: Python<'py>,
    body: &Bound<'py, PyAny>,
    state: &Bound<'py, PyAny>,
    interval: [f64; 2],
    dt: Option<f64>,
    method: Option<&Bound<'py, PyAny>>,
    forces: Option<&Bound<'py, PyAny>>,
    interaction: Option<&Bound<'py, PyAny>>,
    contacts: Option<&Bound<'py, PyAny>>,
    locate: bool,
    max_event_rate: f64,
    keep_events: bool,
    rtol: Option<f64>,
    atol: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
    max_steps: Option<usize>,
    start_up: &str,
    dense_output: bool,
    every: i64,
    observer: Option<Bound<'py, PyAny>>,
    on_interrupt: &str,
    progress: bool,
) -> Result<Py<Solution>, Error> {
    let interval = (interval[0], interval[1]);
    let cast = Cast::extract("body", body)?;
    let initial = cast.states("state", state)?;
    let default = if dt.is_some() { Method::Rkmk } else { Method::Rkmk8B };
    let method = method.map_or(Ok(default), |m| methods::extract("method", m))?;
    let options = Options { start_up: start_up_of(start_up)? };
    let steps = match dt {
        Some(dt) => {
            let adaptive = [
                ("rtol", rtol.is_some()),
                ("atol", atol.is_some()),
                ("max_step", max_step.is_some()),
                ("first_step", first_step.is_some()),
                ("max_steps", max_steps.is_some()),
            ];
            if let Some((name, _)) = adaptive.iter().find(|(_, given)| *given) {
                return Err(Error::input(format!(
                    "`{name}` is for adaptive steps; leave out `dt` to have them"
                )));
            }
            Steps::Fixed(TimeGrid::try_new(interval.0, interval.1, dt)?)
        }
        None => {
            if method.info().embedded.is_none() {
                return Err(Error::input(format!(
                    "method `{}` has no error estimate to adapt its step by: give it a fixed step `dt`; those with one are {}",
                    method.info().name,
                    adaptive_names()
                )));
            }
            let default = Adaptive::default();
            Steps::Adapted(
                interval,
                Adaptive {
                    tolerances: Tolerances {
                        relative: positive("rtol", rtol.unwrap_or(default.tolerances.relative))?,
                        absolute: positive("atol", atol.unwrap_or(default.tolerances.absolute))?,
                    },
                    first_step,
                    max_step: max_step.unwrap_or(default.max_step),
                    max_steps: max_steps.unwrap_or(default.max_steps),
                },
            )
        }
    };
    let every = u64::try_from(every)
        .ok()
        .filter(|n| *n > 0)
        .ok_or_else(|| Error::input(format!("`every` must be a positive number of steps, found {every}")))?;
    let return_interrupted = match on_interrupt {
        "raise" => false,
        "return" => true,
        _ => {
            let message = format!("`on_interrupt` must be 'raise' or 'return', found '{on_interrupt}'");
            return Err(Error::input(message));
        }
    };
    if let Some(observer) = &observer
        && !observer.is_callable()
    {
        return Err(Error::input(format!(
            "`observer` must be a callable f(t, state), found {}",
            crate::convert::a_type(observer)
        )));
    }
    let failure = Failure::default();
    let mut reader = Reader { failure: failure.clone(), calls_python: observer.is_some() };
    let none = py.None().into_bound(py);
    let forces = forces.unwrap_or(&none);
    let bar = |start, end| if progress { ProgressBar::open(py, start, end).map(Some) } else { Ok(None) };
    let plan = |calls_python| Plan {
        method,
        options,
        steps,
        start: interval.0,
        every,
        dense: dense_output,
        calls_python,
        return_interrupted,
    };
    let observer = observer.map(Bound::unbind);
    if cast.single {
        if interaction.is_some() {
            return Err(Error::input("`interaction` acts between several bodies, and there is one"));
        }
        let (body, mut models) = (cast.bodies[0], reader.sum("forces", forces)?);
        let contacts = contacts.map(|contacts| reader.contacts("contacts", contacts)).transpose()?;
        let (plan, bar) = (plan(reader.calls_python), bar(interval.0, interval.1)?);
        if let Some(contacts) = contacts {
            if locate {
                let Steps::Fixed(grid) = steps else {
                    return Err(Error::input(
                        "`contacts` take a fixed step `dt` for their events to be located",
                    ));
                };
                let forces = CountedForces { models, calls: AtomicU64::new(0) };
                let location = Location { max_event_rate, keep_events };
                let system = BodyInContact::new(body, (forces, contacts));
                let bodies = InContact { system, grid, location };
                return run(py, cast, &bodies, &initial[0], &plan, observer, bar, failure);
            }
            models.push(Box::new(contacts));
        }
        if models.is_empty() {
            let bodies = Free(RigidBodySystem::free(body));
            run(py, cast, &bodies, &initial[0], &plan, observer, bar, failure)
        } else {
            let bodies = Forced(RigidBodySystem::new(body, models));
            run(py, cast, &bodies, &initial[0], &plan, observer, bar, failure)
        }
    } else {
        if contacts.is_some() {
            return Err(Error::input("`contacts` are those of a single body, and there are several"));
        }
        let each = reader.for_each("forces", cast.bodies.len(), forces)?;
        let between = reader.between(interaction)?;
        let bodies = Forced(RigidBodiesSystem::try_new(cast.bodies.clone(), each, between)?);
        let initial = State::from_bodies(&initial);
        let (plan, bar) = (plan(reader.calls_python), bar(interval.0, interval.1)?);
        run(py, cast, &bodies, &initial, &plan, observer, bar, failure)
    }
}

/// How the Adams methods start, by its name.
pub(crate) fn start_up_of(name: &str) -> Result<StartUp, Error> {
    match name {
        "one_step" => Ok(StartUp::OneStep),
        "ladder" => Ok(StartUp::Ladder),
        _ => Err(Error::input(format!("`start_up` must be 'one_step' or 'ladder', found '{name}'"))),
    }
}

fn positive(argument: &str, value: f64) -> Result<f64, Error> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(Error::input(format!("`{argument}` must be positive and finite, found {value}")))
    }
}
