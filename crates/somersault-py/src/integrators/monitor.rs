//! What watches a run: it records, shows progress, and stops where Python says so.

use crate::core::callable::Failure;
use crate::core::error::Error;
use crate::core::memory::{bytes_of_numbers, expect_room};
use crate::core::waiting::SignalTimer;
use crate::integrators::plan::Plan;
use crate::integrators::watching::{Arguments, EventFunctions, EventWatch, EventsByFunction};
use pyo3::exceptions::{PyKeyboardInterrupt, PyModuleNotFoundError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::integrators::driver::{Flow, IntegrateError, Observer, Status, Step, Steps};
use somersault::integrators::solution::{Recorder, Solution};
use somersault::integrators::state::{Configuration, State};

/// How many steps lie between two looks at the clock.
pub(crate) const STEPS_PER_LOOK: u64 = 64;

/// Steps for whose records there must be room where it is not known how many there will be.
const FIRST_ROOM: u64 = 1 << 16;

/// How many states the curve of a step is as large as.
const STATES_OF_A_CURVE: usize = 6;

/// A bar that shows how far a run has come.
pub(crate) struct ProgressBar {
    bar: Py<PyAny>,
    shown: f64,
}

impl ProgressBar {
    /// Opens a bar for an interval of time.
    pub(crate) fn open(py: Python<'_>, start: f64, end: f64) -> PyResult<Self> {
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
        options.set_item("total", (end - start).abs())?;
        options
            .set_item("bar_format", "{l_bar}{bar}| t = {n:.4g} of {total:.4g} s [{elapsed}<{remaining}]")?;
        let bar = tqdm.getattr("tqdm")?.call((), Some(&options))?.unbind();
        Ok(Self { bar, shown: start })
    }

    fn show(&mut self, py: Python<'_>, t: f64) -> PyResult<()> {
        self.bar.call_method1(py, "update", ((t - self.shown).abs(),))?;
        self.shown = t;
        Ok(())
    }
}

/// An observer that Python gave: it says whether to stop.
pub(crate) type Watch<Q> = Box<dyn Fn(Python<'_>, f64, &State<Q>) -> PyResult<bool> + Send>;

/// Records a run, shows it to Python, and stops it where Python says so.
pub(crate) struct Monitor<Q: Configuration> {
    recorder: Recorder<Q>,
    /// Start and state there.
    start: (f64, State<Q>),
    events: Option<(EventFunctions, EventWatch<Q>)>,
    watch: Option<Watch<Q>>,
    progress: Option<ProgressBar>,
    failure: Failure,
    timer: SignalTimer,
    /// Steps made, and the time they reached.
    pub(crate) steps: u64,
    t: f64,
    /// Bytes of the record of a step, and the step up to which there is room for records.
    bytes: f64,
    room: u64,
}

/// How a message says that an event of the function of that name ended a run.
pub(crate) fn ended_by_event(name: &str, t: f64) -> String {
    format!("ended by an event of {name} at t = {t}")
}

/// What is left of a run.
pub(crate) struct Finish<Q: Configuration> {
    pub(crate) recorded: Solution<Q>,
    /// The curves of all steps from the start on; none where they were not wanted.
    pub(crate) curves: Solution<Q>,
    /// The events of functions, where there were any.
    pub(crate) watched: Option<EventsByFunction<Q>>,
    pub(crate) steps: u64,
    pub(crate) status: i32,
    pub(crate) message: String,
    pub(crate) failed: Option<PyErr>,
}

impl<Q: Configuration> Monitor<Q> {
    /// A monitor of a run as planned, of states of so many numbers. Records that memory has no room for are refused before
    /// the first step, where the steps are fixed, or end the run.
    pub(crate) fn try_new(
        plan: &Plan,
        initial: &State<Q>,
        numbers: usize,
        watch: Option<Watch<Q>>,
        progress: Option<ProgressBar>,
        failure: Failure,
    ) -> Result<Self, Error> {
        let interval = plan.interval();
        let start = interval.0;
        let state = size_of::<State<Q>>() + bytes_of_numbers(&[numbers]) + size_of::<f64>();
        let (recorder, of_states) = match &plan.t_eval {
            None => (Recorder::new(start, initial, plan.every), state as f64 / plan.every as f64),
            Some(times) => {
                expect_room("the states at `t_eval`", times.len().saturating_mul(state))?;
                (Recorder::at_times(interval, initial, times.clone()).map_err(IntegrateError::from)?, 0.0)
            }
        };
        let recorder = if plan.dense { recorder.with_dense_output() } else { recorder };
        let bytes = if plan.dense { of_states + (STATES_OF_A_CURVE * state) as f64 } else { of_states };
        let mut monitor = Self {
            recorder,
            start: (start, initial.clone()),
            events: None,
            watch,
            progress,
            failure,
            timer: SignalTimer::start(),
            steps: 0,
            t: start,
            bytes,
            room: 0,
        };
        match plan.steps {
            Steps::Fixed(grid) => {
                monitor.expect_room_for(grid.steps())?;
                // it needs no more
                monitor.room = u64::MAX;
            }
            Steps::Adapted { .. } => monitor.expect_room_for(FIRST_ROOM)?,
        }
        Ok(monitor)
    }

    /// The same with functions whose events it looks for, which are called with those arguments.
    pub(crate) fn looking_for(
        self,
        py: Python<'_>,
        functions: Option<EventFunctions>,
        arguments: impl FnOnce() -> Arguments<Q>,
    ) -> Self {
        let watch = |functions: EventFunctions| {
            let watch = functions.watch(py, arguments(), &self.failure);
            (functions, watch)
        };
        Self { events: functions.map(watch), ..self }
    }

    /// Refuses more steps than memory has room for the records of.
    fn expect_room_for(&mut self, steps: u64) -> Result<(), Error> {
        // a record that grows asks for room for twice what it holds
        let bytes = 2.0 * steps as f64 * self.bytes;
        let what = format!("the records of {steps} steps (give a larger `every`)");
        expect_room(&what, bytes as usize)?;
        self.room = steps;
        Ok(())
    }

    /// Runs, without the interpreter where no Python code takes part.
    pub(crate) fn supervise<T: Send>(
        &mut self,
        py: Python<'_>,
        plan: &Plan,
        run: impl FnOnce(&mut Self) -> T + Send,
    ) -> PyResult<T>
    where
        Self: Send,
    {
        let result = if plan.calls_python { run(self) } else { py.detach(|| run(self)) };
        if let Some(bar) = &mut self.progress {
            bar.show(py, self.t)?;
            bar.bar.call_method0(py, "close")?;
        }
        Ok(result)
    }

    /// How the run ended. What Python raised comes before what the driver made of the numbers that followed.
    pub(crate) fn finish(self, py: Python<'_>, status: Result<Status, Error>) -> Finish<Q> {
        let Self { recorder, start, events, failure, steps, t, .. } = self;
        let ended_by = events.as_ref().and_then(|(functions, watch)| Some(functions.name(watch.ended_by()?)));
        let ended = match failure.get() {
            Some(error) => Err(error.clone_ref(py)),
            None => status.map_err(PyErr::from),
        };
        let (status, message) = match (&ended, ended_by) {
            (Ok(_), Some(name)) => (1, ended_by_event(&name, t)),
            (Ok(Status::Finished), None) => (0, "reached the end of the interval".to_owned()),
            (Ok(Status::Stopped), None) => (1, format!("stopped by the observer at t = {t}")),
            (Err(error), _) if error.is_instance_of::<PyKeyboardInterrupt>(py) => {
                (-1, format!("interrupted at t = {t}"))
            }
            (Err(_), _) => (-2, format!("failed after t = {t}")),
        };
        let mut recorded = recorder.into_solution();
        let segments = std::mem::take(&mut recorded.segments);
        // The curves know their ends; of the states only a first is needed, to be written into.
        let (t, state) = start;
        let curves = Solution { times: vec![t], states: vec![state], segments };
        let watched = events.map(|(functions, watch)| {
            let found = watch.finish().unwrap_or_else(|interrupted| interrupted.so_far);
            functions.sorted(found)
        });
        Finish { recorded, curves, watched, steps, status, message, failed: ended.err() }
    }

    /// Runs handlers of signals and moves the bar.
    fn look(&mut self, t: f64) -> PyResult<()> {
        Python::attach(|py| {
            self.timer.look(py)?;
            self.progress.as_mut().map_or(Ok(()), |bar| bar.show(py, t))
        })
    }
}

impl<Q: Configuration> Observer<Q> for Monitor<Q> {
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        if self.failure.get().is_some() {
            return Flow::Stop;
        }
        // before the record that holds half of them is full and asks for more
        if step.index >= self.room / 2
            && let Err(error) = self.expect_room_for(self.room.saturating_mul(2))
        {
            self.failure.set(error.into());
            return Flow::Stop;
        }
        let mut flow = Flow::Continue;
        if let Some((functions, events)) = &mut self.events {
            flow = events.observe(step);
            if let Some(reason) = events.fault() {
                self.failure.set(functions.error(reason).into());
                return Flow::Stop;
            }
        }
        let _ = step.show(&mut self.recorder);
        let end = step.end().cloned();
        let (t, state) = end.as_ref().map_or((step.t_after, step.after), |(t, state)| (*t, state));
        (self.steps, self.t) = (step.index, t);
        if let Some(watch) = &self.watch {
            match Python::attach(|py| watch(py, t, state)) {
                Ok(true) => flow = Flow::Stop,
                Ok(false) => {}
                Err(error) => self.failure.set(error),
            }
        }
        if step.index.is_multiple_of(STEPS_PER_LOOK)
            && self.timer.is_due()
            && let Err(error) = self.look(t)
        {
            self.failure.set(error);
        }
        if self.failure.get().is_some() { Flow::Stop } else { flow }
    }
}
