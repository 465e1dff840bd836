//! Gradients by the adjoint: a run of a tree that is recorded, and a backward pass through its record.
//!
//! The columns of a run are advanced by linear maps: by the variational equations, with the slopes K_i of an explicit Runge–Kutta method,
//! and by a saltation at each event. The adjoint applies the transposes of the same maps from the end to the start. Of a step
//! ```text
//! D_i = δ + h Σ_j a_ij K_j,   K_i = A_i D_i + g_i δp,   δ₊ = δ + h Σ_i b_i K_i,
//! K̄_i = h b_i λ₊ + h Σ_{j>i} a_ji D̄_j,   D̄_i = A_iᵀ K̄_i,   λ = λ₊ + Σ_i D̄_i,   p̄ += Σ_i g_iᵀ K̄_i,
//! ```
//! and of an event with δ⁺ = P δ − f_J δt and δt = −(∇g · δ + ∂g/∂p)/ġ
//! ```text
//! s = w − f_Jᵀ λ⁺,   λ = Pᵀ λ⁺ − (s/ġ) ∇g,   p̄ −= (s/ġ) ∂g/∂p
//! ```
//! with the weight w of its time in the cost. So adjoint and columns agree to rounding, or with capsules and boxes to the errors of
//! central differences: both are the variational equations by the method of the run, in its steps. A running cost ∫ l dt is Σ h b_i l_i, with the order of the method.
//!
//! A. Griewank and A. Walther, *Evaluating Derivatives* (2008), chapter 3; W. W. Hager, *Runge–Kutta methods in optimal control and the
//! transformed adjoint system*, Numer. Math. 87 (2000) 247, for the transposes of Runge–Kutta methods.

use super::collect::without_columns;
use super::differentiable::Differentiable;
use super::outcome::{SensitivityError, Undifferentiated};
use super::record::{Record, Steps};
use super::run::{SensitivityRun, Watching, prepare, varied, why};
use super::system::Variational;
use super::transposed::{Costate, Transposed, dot};
use crate::event::EventKind;
use crate::laws::ContactMode;
use crate::tree::{TouchingState, TreeInContact};
use somersault_core::argument::expect_length;
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::driver::{self, Flow, Observer, Step};
use somersault_integrators::engine::{Engine, Slot, Track};
use somersault_integrators::events::{Frozen, Located};
use somersault_integrators::run::{Engages, Run};
use somersault_integrators::state::State;
use somersault_integrators::tableau::Tableau;
use somersault_integrators::variation::Varied;
use somersault_multibody::motion::{Coordinates, JointDrive, Rates, TreeForces, TreeState};
use std::fmt;

/// The outcome of a run that is recorded; an error has what was recorded, unless the run did not begin, and borrows what that does:
/// its `reason` alone does not.
pub type RecordedResult<R> = Result<R, Box<Undifferentiated<Option<R>>>>;

/// A run of a tree in contact with the record that a backward pass needs: see [`SensitivityRun::recorded_from`].
pub struct RecordedRun<'a, 'm, F: TreeForces, D: JointDrive, M> {
    variational: Variational<'a, TreeInContact<'m, F, D>>,
    method: M,
    tableau: Tableau,
    is_adapted: bool,
    start: (f64, TouchingState),
    steps: Steps,
    run: Located<Augmented<Coordinates>, EventKind>,
}

/// Derivatives of a cost of the end of a run: by the motions of the joints along q ⊕ ε e_k, by their velocities, and by the times of the
/// events.
#[derive(Debug, Clone, Copy, Default)]
pub struct EndCost<'a> {
    /// By the motions of the joints at the end, n_velocities.
    pub by_motion: &'a [f64],
    /// By the velocities of the joints at the end, n_velocities.
    pub by_velocity: &'a [f64],
    /// By the times of the events, in the order of those of the run; empty where the cost does not depend on them.
    pub by_event_times: &'a [f64],
}

/// The integrand of a running cost: its value for (t, q, v), which writes its derivatives by the motions of the joints and by their velocities
/// into slices of zeros.
pub type RunningCost<'a> = &'a mut dyn FnMut(f64, &[f64], &[f64], [&mut [f64]; 2]) -> f64;

/// The gradient of a cost of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeGradient {
    /// By the initial state: the motions of the joints along q ⊕ ε e_k, then the changes of their velocities.
    pub state: Vec<f64>,
    /// By the parameters.
    pub parameters: Vec<f64>,
    /// The running cost.
    pub running: f64,
}

/// What moves, with room for columns.
type Moving = Varied<Augmented<Coordinates>, AugmentedRate<Rates>>;

/// Records the steps of a run and shows them to an observer.
struct Recording<'a, 'o> {
    steps: &'a mut Steps,
    is_full: bool,
    observer: Option<&'o mut dyn Observer<Moving>>,
}

impl Observer<Moving> for Recording<'_, '_> {
    fn observe(&mut self, step: &mut Step<'_, Moving>) -> Flow {
        let before = (&step.before.configuration.base, &step.before.rate.base);
        if self.steps.push([step.t_before, step.t_after], before).is_err() {
            self.is_full = true;
            return Flow::Stop;
        }
        self.observer.as_mut().map_or(Flow::Continue, |observer| observer.observe(step))
    }
}

impl<'a, 'm, F, D, M> SensitivityRun<'a, '_, TreeInContact<'m, F, D>, M>
where
    F: TreeForces,
    D: JointDrive,
    M: for<'b> Engages<Frozen<'b, Variational<'a, TreeInContact<'m, F, D>>>>,
{
    /// Runs from a state without columns, and records the run for gradients of costs of its end ([`RecordedRun::gradient`]). Each gradient
    /// takes the time of about four runs, for any number of parameters (`cargo bench --bench contact -- gradient_of_a_hop`).
    ///
    /// The method must be an explicit Runge–Kutta method ([`Scheme::on_vectors`](somersault_integrators::stepper::Scheme::on_vectors)):
    /// `euler`, `mp`, `heun`, `rk4`, `rkmk`, `rkmk3`, `rkmk5`, `rkmk8`, `cf4`,
    /// or a user-defined explicit Runge–Kutta method. Memory: a state for each step.
    ///
    /// Errors: those of [`from`](Self::from), a method of another kind, and a record for which there is no memory. After a graze the gradients are
    /// one-sided, as the columns are.
    pub fn recorded_from(self, initial: &TreeState) -> RecordedResult<RecordedRun<'a, 'm, F, D, M>> {
        let Self { system, differentiation, method, steps, location, observer } = self;
        let refuse = |reason| Box::new(Undifferentiated { reason, so_far: None });
        let (t, end) = steps.interval();
        let (stretched, parameters) = prepare(system, differentiation, initial).map_err(refuse)?;
        let grazing = differentiation.grazing;
        let variational = Variational::new(system, parameters, grazing, end - t, location.keep_events);
        let is_adapted = matches!(steps, driver::Steps::Adapted { .. });
        let moving = varied(stretched.clone(), &[], 0);
        let tableau = tableau_of(&method, &variational, t, &moving, is_adapted).map_err(refuse)?;
        let variational = variational.recording(Record::new(tableau.stages(), &stretched));
        let mut kept = Steps::default();
        if let driver::Steps::Fixed(grid) = &steps {
            // Those that events add come on top.
            let room = usize::try_from(grid.steps()).unwrap_or(usize::MAX);
            let reserved = kept.reserve(room, (&stretched.configuration, &stretched.rate));
            reserved.map_err(|_| refuse(SensitivityError::NoRoom { steps: grid.steps() }))?;
        }
        let mut recording = Recording { steps: &mut kept, is_full: false, observer };
        let mut watching = Watching { system: &variational, observer: Some(&mut recording) };
        let run = Run::by(&variational, &method, steps).locating(location).observed_by(&mut watching);
        let run = run.from(&moving);
        let is_full = recording.is_full;
        let without_derivative = variational.log.take().reason();
        let (run, reason) = match run {
            Ok(run) if is_full => {
                let reason = SensitivityError::NoRoom { steps: run.steps };
                (run, Some(reason))
            }
            Ok(run) => (run, without_derivative),
            Err(interrupted) => (interrupted.so_far, Some(why(interrupted.reason))),
        };
        let run = without_columns::<TreeInContact<'m, F, D>>(run);
        let recorded =
            RecordedRun { variational, method, tableau, is_adapted, start: (t, stretched), steps: kept, run };
        match reason {
            None => Ok(recorded),
            Some(reason) => Err(Box::new(Undifferentiated { reason, so_far: Some(recorded) })),
        }
    }
}

/// The tableau of a method that takes the system.
fn tableau_of<'a, 'm, F: TreeForces, D: JointDrive, M>(
    method: &M,
    variational: &Variational<'a, TreeInContact<'m, F, D>>,
    t: f64,
    x: &State<Moving>,
    is_adapted: bool,
) -> Result<Tableau, SensitivityError>
where
    M: for<'b> Engages<Frozen<'b, Variational<'a, TreeInContact<'m, F, D>>>>,
{
    let frozen = Frozen::new(variational, t, x);
    let found = method.engage(&frozen, x, is_adapted, &mut |engine| {
        engine.on_vectors().ok_or(SensitivityError::NoAdjoint { method: engine.info().name })
    });
    found.map_err(|error| why(error.into()))?
}

impl<F: TreeForces, D: JointDrive, M> fmt::Debug for RecordedRun<'_, '_, F, D, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RecordedRun").field("run", &self.run).finish_non_exhaustive()
    }
}

impl<'a, 'm, F: TreeForces, D: JointDrive, M> RecordedRun<'a, 'm, F, D, M> {
    /// The run, as a [`Run`] that locates events leaves it.
    pub fn run(&self) -> &Located<Augmented<Coordinates>, EventKind> {
        &self.run
    }

    /// The gradient of a cost of the end, of the times of the events, and of a running cost if one is given, by the initial state and the
    /// parameters. To rounding it is the product of the derivatives of the cost and the rows of
    /// [`TreeSensitivities`](super::TreeSensitivities).
    ///
    /// `watch` is called in the backward pass with the time before each step, and may stop it.
    ///
    /// Errors: lengths that do not fit, a backward pass that was stopped, and numbers that are not finite.
    pub fn gradient<'w>(
        &mut self,
        cost: &EndCost<'_>,
        running: Option<RunningCost<'w>>,
        watch: &'w mut dyn FnMut(f64) -> Flow,
    ) -> Result<TreeGradient, SensitivityError>
    where
        M: for<'b> Engages<Frozen<'b, Variational<'a, TreeInContact<'m, F, D>>>>,
    {
        let system = self.variational.system();
        let n = system.model().n_velocities();
        let length = |argument, found, expected| {
            expect_length(argument, found, expected).map_err(|error| SensitivityError::Tree(error.into()))
        };
        length("by_motion", cost.by_motion.len(), n)?;
        length("by_velocity", cost.by_velocity.len(), n)?;
        if !cost.by_event_times.is_empty() {
            length("by_event_times", cost.by_event_times.len(), self.run.events.len())?;
        }
        let (t, start) = &self.start;
        let moving = varied(start.clone(), &[], 0);
        let frozen = Frozen::new(&self.variational, *t, &moving);
        let mut pass = BackwardPass::new(self, cost, running, watch, (frozen.mode(), moving.clone()))?;
        let done =
            self.method.engage(&frozen, &moving, self.is_adapted, &mut |engine| pass.run(engine, &frozen));
        done.map_err(|error| why(error.into()))??;
        let state: Vec<f64> = system
            .tangents(&start.base())
            .iter()
            .map(|unit| {
                let Costate { displacement, rate } = &pass.costate;
                dot(displacement, &unit.displacement) + dot(&rate.base, &unit.rate)
            })
            .collect();
        let gradient = TreeGradient { state, parameters: pass.parameters, running: pass.value };
        let TreeGradient { state, parameters, running } = &gradient;
        let finite = running.is_finite() && state.iter().chain(parameters).all(|x| x.is_finite());
        if finite { Ok(gradient) } else { Err(SensitivityError::NonFinite) }
    }
}

/// The backward pass through a run.
struct BackwardPass<'r, 'a, 'm, 'w, F: TreeForces, D: JointDrive, M> {
    recorded: &'r RecordedRun<'a, 'm, F, D, M>,
    event_times: &'r [f64],
    running: Option<RunningCost<'w>>,
    watch: &'w mut dyn FnMut(f64) -> Flow,
    transposed: Transposed,
    costate: Costate,
    parameters: Vec<f64>,
    value: f64,
    /// Those of the slope and of the stages of a step.
    of_slope: Costate,
    of_stages: Vec<Costate>,
    mode: Vec<ContactMode>,
    moving: State<Moving>,
    v: Vec<f64>,
    by: [Vec<f64>; 2],
}

impl<'r, 'a, 'm, 'w, F: TreeForces, D: JointDrive, M> BackwardPass<'r, 'a, 'm, 'w, F, D, M> {
    fn new(
        recorded: &'r RecordedRun<'a, 'm, F, D, M>,
        cost: &EndCost<'r>,
        running: Option<RunningCost<'w>>,
        watch: &'w mut dyn FnMut(f64) -> Flow,
        (mode, moving): (Vec<ContactMode>, State<Moving>),
    ) -> Result<Self, SensitivityError> {
        let system = recorded.variational.system();
        let none = vec![0.0; system.model().n_velocities()];
        let end = recorded.run.state.base();
        let mut v = none.clone();
        system.model().joint_velocities(&end, &mut v)?;
        let zero = Costate::zero(&moving.rate.base);
        let mut transposed = Transposed::new(system, &moving.rate.base);
        let mut costate = zero.clone();
        let at_end = (&end.configuration, &v[..]);
        transposed.add_joints(system, at_end, (cost.by_motion, cost.by_velocity), &mut costate);
        Ok(Self {
            recorded,
            event_times: cost.by_event_times,
            running,
            watch,
            transposed,
            costate,
            parameters: vec![0.0; recorded.variational.parameters().len()],
            value: 0.0,
            of_slope: zero.clone(),
            of_stages: vec![zero; recorded.tableau.stages()],
            mode,
            moving,
            v,
            by: [none.clone(), none],
        })
    }

    /// Passes back through all steps and events.
    fn run(
        &mut self,
        engine: &mut dyn Engine<Moving>,
        frozen: &Frozen<'_, Variational<'a, TreeInContact<'m, F, D>>>,
    ) -> Result<(), SensitivityError> {
        let RecordedRun { variational, steps, .. } = self.recorded;
        let slots = [(); 2].map(|()| engine.keep(&self.moving));
        let mut passed = 0;
        if let Some(record) = variational.record() {
            passed = record.passages.len();
            if let Some(last) = record.passages.last() {
                self.mode.clone_from(&last.modes.1);
            }
        }
        for k in (0..steps.len()).rev() {
            let Self { moving, .. } = self;
            let [t, t_after] = steps.read(k, (&mut moving.configuration.base, &mut moving.rate.base));
            passed = self.pass_back(t_after, passed);
            frozen.freeze(&self.mode);
            frozen.begin(t);
            self.step_back(engine, slots, [t, t_after])?;
            if (self.watch)(t) == Flow::Stop {
                return Err(SensitivityError::Stopped { t });
            }
        }
        Ok(())
    }

    /// Passes back through those of the first `passed` passages that are at t; returns how many are left.
    fn pass_back(&mut self, t: f64, mut passed: usize) -> usize {
        let RecordedRun { variational, run, .. } = self.recorded;
        let Some(record) = variational.record() else { return passed };
        let (system, parameters) = (variational.system(), variational.parameters());
        while let Some(passage) = passed.checked_sub(1).and_then(|last| record.passages.get(last)) {
            if passage.t != t {
                break;
            }
            let weight = |guard: usize| {
                let event = run.events.iter().position(|event| event.t == t && event.guard == guard);
                event.and_then(|event| self.event_times.get(event)).copied().unwrap_or(0.0)
            };
            let (before, after) = &passage.modes;
            let x = (&passage.state.configuration, &passage.state.rate);
            let into = (&mut self.costate, &mut self.parameters[..]);
            self.transposed.pass(system, parameters, (before, after), t, x, weight, into);
            self.mode.clone_from(before);
            passed -= 1;
        }
        passed
    }

    /// Makes a step again, and passes back through its stages.
    fn step_back(
        &mut self,
        engine: &mut dyn Engine<Moving>,
        [from, to]: [Slot; 2],
        [t, t_after]: [f64; 2],
    ) -> Result<(), SensitivityError> {
        let RecordedRun { variational, tableau, .. } = self.recorded;
        let h = t_after - t;
        let note = |begins: bool| {
            if let Some(mut record) = variational.record() {
                if begins { record.stages.begin() } else { record.stages.end() }
            }
        };
        engine.write(from, &self.moving);
        engine.restart(Track::RUN);
        note(true);
        let made = engine.advance(Track::RUN, t, h, from, to, None);
        note(false);
        made.map_err(|error| why(error.into()))?;
        let Some(record) = variational.record() else { return Ok(()) };
        let points = record.stages.points();
        if points.len() != tableau.stages() {
            return Err(SensitivityError::NoAdjoint { method: engine.info().name });
        }
        let (system, parameters) = (variational.system(), variational.parameters());
        for (i, (t, x)) in points.iter().enumerate().rev() {
            let of = |row: &[(usize, f64)]| row.iter().find(|(j, _)| *j == i).map_or(0.0, |(_, a)| h * a);
            let Self { transposed, of_slope, of_stages, .. } = self;
            let (of_stages, later) = of_stages.split_at_mut(i + 1);
            let weight = of(tableau.weights());
            of_slope.set_zero();
            of_slope.axpy(weight, &self.costate);
            let mut acts = weight != 0.0;
            for (later, j) in later.iter().zip(i + 1..) {
                let a = of(tableau.row(j));
                if a != 0.0 {
                    of_slope.axpy(a, later);
                    acts = true;
                }
            }
            let of_stage = &mut of_stages[i];
            if !acts {
                of_stage.set_zero();
                continue;
            }
            let at = (&x.configuration, &x.rate);
            let into = (&mut *of_stage, &mut self.parameters[..]);
            transposed.pull(system, parameters, &self.mode, *t, at, of_slope, into);
            let Some(running) = self.running.as_mut().filter(|_| weight != 0.0) else { continue };
            let (q, v) = (&x.configuration.0, &mut self.v);
            system.model().joint_velocities_at((q, &x.rate.base), v)?;
            let [by_motion, by_velocity] = &mut self.by;
            by_motion.fill(0.0);
            by_velocity.fill(0.0);
            self.value += weight * running(*t, q.as_slice(), v, [by_motion, by_velocity]);
            by_motion.iter_mut().chain(&mut *by_velocity).for_each(|x| *x *= weight);
            transposed.add_joints(system, (q, v), (by_motion, by_velocity), of_stage);
        }
        let Self { costate, of_stages, .. } = self;
        of_stages.iter().for_each(|of_stage| costate.axpy(1.0, of_stage));
        Ok(())
    }
}
