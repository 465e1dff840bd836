//! Rollouts: many motions of one tree, each from its own state and under its own torques, with steps in common.

use super::{Coordinates, TreeEnsemble, TreeForces, TreeState, TreeSystem};
use crate::error::DynamicsError;
use crate::model::Model;
use rayon::prelude::*;
use somersault_core::argument::{ArgumentError, expect_finite, expect_least, expect_length};
use somersault_core::cancel::CancellationToken;
use somersault_integrators::driver::{Flow, IntegrateError, Observer, Step, TimeGrid};
use somersault_integrators::methods::RungeKuttaMuntheKaas4;
use somersault_integrators::run::Run;
use somersault_integrators::state::Configuration;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Copies that move together in the lanes of a thread.
const GROUP: usize = 16;

/// Why rollouts have no result. Copies count from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RolloutError {
    /// An argument that is not allowed.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// States that no copy can have.
    #[error(transparent)]
    State(#[from] DynamicsError),
    /// A copy whose motion cannot be followed to the end.
    #[error("copy {copy}: {source}")]
    Copy {
        /// The first such copy.
        copy: usize,
        /// Why.
        source: IntegrateError,
    },
    /// The work was cancelled.
    #[error("the rollouts were cancelled")]
    Cancelled,
}

/// Joint torques that are held during each step: rows of n numbers by copy, and by step within each copy.
#[derive(Debug, Clone, Copy, Default)]
pub struct HeldTorques<'a> {
    /// The rows; none of them where there are no torques.
    pub values: &'a [f64],
    /// Copies that have rows, or 1 for all.
    pub copies: usize,
    /// Steps that have rows, or 1 for all.
    pub steps: usize,
}

/// States of rollouts at times that they have in common.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rollouts {
    /// Times, the start and the end among them, s.
    pub times: Vec<f64>,
    /// Positions: those of the first copy at all times, then those of the second.
    pub positions: Vec<f64>,
    /// Joint velocities in the same order.
    pub velocities: Vec<f64>,
}

/// Moves copies of a tree from rows of positions and joint velocities over a grid of steps, by the classical Runge–Kutta–Munthe-Kaas
/// method of order 4, on all processors and in vector lanes, and keeps every `every`-th state (0 is taken as 1) and the last.
///
/// Torques are held during each step, so that their jumps cost no accuracy. Each copy moves as it would alone, to the last bit.
///
/// Errors: arguments of the wrong length, the first copy whose motion has no end, and work that was cancelled.
///
/// ```
/// use somersault_core::cancel::CancellationToken;
/// use somersault_integrators::driver::TimeGrid;
/// use somersault_multibody::models::CartPendulum;
/// use somersault_multibody::motion::{HeldTorques, rollout};
///
/// let model = CartPendulum::default().model()?;
/// // one state under two sequences of forces on the cart, held for a step each
/// let push: Vec<f64> = (0..100).flat_map(|k| [if k < 50 { 1.0 } else { -1.0 }, 0.0]).collect();
/// let values = [push.clone(), push.iter().map(|f| -f).collect()].concat();
/// let torques = HeldTorques { values: &values, copies: 2, steps: 100 };
/// let grid = TimeGrid::try_new(0.0, 1.0, 0.01)?;
/// let found = rollout(&model, &[0.0; 4], &[0.0; 4], &grid, &torques, 100, &CancellationToken::new())?;
/// assert_eq!(found.times, [0.0, 1.0]);
/// // mirror images of each other
/// assert!(found.positions[2] > 0.1 && (found.positions[2] + found.positions[6]).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn rollout(
    model: &Model,
    q: &[f64],
    v: &[f64],
    grid: &TimeGrid,
    torques: &HeldTorques<'_>,
    every: u64,
    token: &CancellationToken,
) -> Result<Rollouts, RolloutError> {
    let (n_q, n) = (model.n_positions(), model.n_velocities());
    let copies = q.len().checked_div(n_q).unwrap_or(0);
    expect_least("q", q.len(), n_q.max(1))?;
    expect_length("q", q.len(), copies * n_q)?;
    expect_length("v", v.len(), copies * n)?;
    expect_finite("q", q)?;
    expect_finite("v", v)?;
    let steps = usize::try_from(grid.steps()).unwrap_or(usize::MAX);
    if !torques.values.is_empty() {
        let fits = |rows: usize, all: usize| rows == 1 || rows == all;
        let numbers = |copies: usize, steps: usize| copies.saturating_mul(steps).saturating_mul(n);
        if !fits(torques.copies, copies) || !fits(torques.steps, steps) {
            let expected = numbers(copies, steps);
            return Err(
                ArgumentError::Length { argument: "torques", expected, found: torques.values.len() }.into()
            );
        }
        expect_length("torques", torques.values.len(), numbers(torques.copies, torques.steps))?;
        expect_finite("torques", torques.values)?;
    }

    let every = every.max(1);
    let is_kept = |k: &u64| k.is_multiple_of(every) || *k == grid.steps();
    let times: Vec<f64> = (0..=grid.steps()).filter(is_kept).map(|k| grid.time(k)).collect();
    let mut positions = vec![0.0; copies * times.len() * n_q];
    let mut velocities = vec![0.0; copies * times.len() * n];
    let task = Task { model, grid, torques, every, token };
    let groups = (
        positions.par_chunks_mut(GROUP * times.len() * n_q),
        velocities.par_chunks_mut(GROUP * times.len() * n),
        q.par_chunks(GROUP * n_q),
        v.par_chunks(GROUP * n),
    );
    let moved = groups.into_par_iter().enumerate().map(|(group, (positions, velocities, q, v))| {
        task.move_together(group * GROUP, q, v, (positions, velocities), times.len())
    });
    let moved: Vec<Result<(), RolloutError>> = moved.collect();
    if token.is_cancelled() {
        return Err(RolloutError::Cancelled);
    }
    moved.into_iter().collect::<Result<(), _>>()?;
    Ok(Rollouts { times, positions, velocities })
}

/// What all groups of copies have in common.
struct Task<'a> {
    model: &'a Model,
    grid: &'a TimeGrid,
    torques: &'a HeldTorques<'a>,
    every: u64,
    token: &'a CancellationToken,
}

impl Task<'_> {
    /// The torques of a copy, in the step that `step` says.
    fn held<'b>(&'b self, copy: usize, step: &'b AtomicUsize) -> Held<'b> {
        Held { torques: self.torques, copy, step }
    }

    /// Moves the copies of a group, the first of which has a number, and keeps their states at so many times.
    fn move_together(
        &self,
        first: usize,
        q: &[f64],
        v: &[f64],
        (positions, velocities): (&mut [f64], &mut [f64]),
        times: usize,
    ) -> Result<(), RolloutError> {
        if self.token.is_cancelled() {
            return Ok(());
        }
        let (copies, step) = (q.len() / self.model.n_positions(), AtomicUsize::new(0));
        let held: Vec<Held<'_>> = (first..first + copies).map(|copy| self.held(copy, &step)).collect();
        let ensemble = TreeEnsemble::new(self.model, held);
        let start = ensemble.state(q, v)?;
        let rates = vec![0.0; v.len()];
        let mut keeper = Keeper {
            task: self,
            ensemble: &ensemble,
            positions,
            velocities,
            times,
            rates,
            kept: 0,
            step: &step,
        };
        keeper.keep(&start);
        let run = Run::by_stepper(&ensemble, &RungeKuttaMuntheKaas4, *self.grid).observed_by(&mut keeper);
        let Err(source) = run.from(&start) else { return Ok(()) };
        // the error is that of the group; by itself each copy moves alike
        self.expect_alone(first, q, v)?;
        Err(RolloutError::Copy { copy: first, source })
    }

    /// Fails with the first of the copies that has no end by itself.
    fn expect_alone(&self, first: usize, q: &[f64], v: &[f64]) -> Result<(), RolloutError> {
        let rows = q.chunks_exact(self.model.n_positions()).zip(v.chunks_exact(self.model.n_velocities()));
        for (copy, (q, v)) in (first..).zip(rows) {
            let step = AtomicUsize::new(0);
            let system = TreeSystem::new(self.model, self.held(copy, &step));
            let start = self.model.state(q, v)?;
            let mut counter = Counter { step: &step, token: self.token };
            let run = Run::by_stepper(&system, &RungeKuttaMuntheKaas4, *self.grid).observed_by(&mut counter);
            run.from(&start).map_err(|source| RolloutError::Copy { copy, source })?;
        }
        Ok(())
    }
}

/// The torques of one copy.
struct Held<'a> {
    torques: &'a HeldTorques<'a>,
    copy: usize,
    /// Steps that have been made.
    step: &'a AtomicUsize,
}

impl TreeForces for Held<'_> {
    fn add_torque(&self, _: f64, _: &[f64], _: &[f64], torque: &mut [f64]) {
        let HeldTorques { values, copies, steps } = *self.torques;
        if values.is_empty() {
            return;
        }
        let copy = if copies == 1 { 0 } else { self.copy };
        let step = self.step.load(Ordering::Relaxed).min(steps - 1);
        let row = values.chunks_exact(torque.len()).nth(copy * steps + step);
        torque.iter_mut().zip(row.into_iter().flatten()).for_each(|(torque, held)| *torque += held);
    }

    fn depends_on_state(&self) -> bool {
        false
    }
}

/// Counts steps.
struct Counter<'a> {
    step: &'a AtomicUsize,
    token: &'a CancellationToken,
}

impl<Q: Configuration> Observer<Q> for Counter<'_> {
    fn observe(&mut self, step: &mut Step<'_, Q>) -> Flow {
        self.step.store(step.index as usize, Ordering::Relaxed);
        if self.token.is_cancelled() { Flow::Stop } else { Flow::Continue }
    }
}

/// Keeps the states of a group.
struct Keeper<'a> {
    task: &'a Task<'a>,
    ensemble: &'a TreeEnsemble<'a, Held<'a>>,
    positions: &'a mut [f64],
    velocities: &'a mut [f64],
    /// Times that are kept, and how many of them are.
    times: usize,
    kept: usize,
    /// Joint velocities of all copies.
    rates: Vec<f64>,
    step: &'a AtomicUsize,
}

impl Keeper<'_> {
    fn keep(&mut self, x: &TreeState) {
        if self.ensemble.joint_velocities(x, &mut self.rates).is_err() {
            self.rates.fill(f64::NAN);
        }
        let model = self.task.model;
        let put = |out: &mut [f64], rows: &[f64], n: usize| {
            for (out, row) in out.chunks_exact_mut(self.times * n).zip(rows.chunks_exact(n)) {
                out[self.kept * n..][..n].copy_from_slice(row);
            }
        };
        put(self.positions, x.configuration.as_slice(), model.n_positions());
        put(self.velocities, &self.rates, model.n_velocities());
        self.kept += 1;
    }
}

impl Observer<Coordinates> for Keeper<'_> {
    fn observe(&mut self, step: &mut Step<'_, Coordinates>) -> Flow {
        if step.index.is_multiple_of(self.task.every) || step.index == self.task.grid.steps() {
            self.keep(step.after);
        }
        Counter { step: self.step, token: self.task.token }.observe(step)
    }
}
