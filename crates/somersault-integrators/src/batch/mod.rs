//! Many bodies in one call, vectorised across bodies and parallel over cores.
//!
//! Each body has its own inertia, its own state and its own times; no body sees another.
//!
//! | Type | Systems | Method |
//! |---|---|---|
//! | [`FreeRuns`] | bodies, free or under uniform gravity | Runge–Kutta–Munthe-Kaas of order 4 in the body frame, vectorised, and the parabola of the centre of mass |
//! | [`ForcedRuns`] | bodies under sums of [`WrenchTerm`]s (constant and central forces, springs, drag, torques, planes) and other forces | the same with all stages, vectorised |
//! | [`AdaptedRuns`] | the same, by adapted steps | Runge–Kutta–Munthe-Kaas of order 8 in the body frame, vectorised |
//! | [`Runs`] | any | any of the table, one [`Run`] at a time on each core |
//! | [`FreeBodyBatch`] | free bodies, rotation only | the vectorised kernel under the first |
//!
//! Tiles of 64 bodies are the unit of work of the kernel. Within a tile the bodies share vector
//! instructions ([`InstructionSet`], chosen once a call); the tiles are shared among the threads of
//! the current rayon pool. A body goes through the same rounded operations whichever instructions are
//! used, in whichever tile it is and whichever thread takes it, so the result is **the same to the last
//! bit** for any processor, any number of threads and any company. Bodies with many steps are put into
//! tiles together; where counts still differ within a tile, the bodies that have finished are held.
//!
//! A step costs 141 floating-point operations, with which a core does more than half of what its FMA
//! units can; `benches/batch.rs` measures both.
//!
//! ```
//! use nalgebra::Vector3;
//! use somersault_integrators::{batch, body::RigidBody, driver::TimeGrid, state::RigidBodyState};
//!
//! let bodies: Vec<_> = (1..=100)
//!     .map(|i| RigidBody::try_box(1.0, Vector3::new(1.0, 2.0, i as f64 / 10.0)))
//!     .collect::<Result<_, _>>()?;
//! let states = vec![RigidBodyState::spinning(Vector3::new(0.1, 3.0, 0.0)); 100];
//! let grids = vec![TimeGrid::try_new(0.0, 2.0, 0.01)?; 100];
//! let ends = batch::FreeRuns::new(&bodies, &grids).from(&states)?;
//! assert_eq!(ends.len(), 100);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod adapted;
mod forced;
mod free;
mod rows;

pub use somersault_core::lanes::InstructionSet;

use crate::body::{PrincipalFrame, RigidBody};
use crate::driver::{Adaptive, IntegrateError, Outcome, Steps, TimeGrid, check_interval, check_state};
use crate::force::{ForceModel, Gravity, Wrench};
use crate::methods::{Dop853, Forms, Method, Options, RungeKuttaMuntheKaas};
use crate::run::Run;
use crate::series::WrenchTerm;
use crate::solution::{Recorder, check_times};
use crate::state::RigidBodyState;
use crate::step_size::StepSizeControl;
use crate::stepper::Scheme;
use crate::system::{RigidBodySystem, StateOf, System};
use adapted::AdaptedTile;
use forced::{ForcedTile, Moving};
use free::Tile;
use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use rows::TILE;
use somersault_core::cancel::CancellationToken;
use somersault_core::interval::nearest;
use std::cmp::Reverse;
use std::fmt;

/// Forces on a body that are no sums of [`WrenchTerm`]s. Bodies that have the same slice, neighbours in a tile, are given to a force
/// together ([`ForceModel::add_in_lanes`]).
pub type Forces<'a> = &'a [&'a (dyn ForceModel + Sync)];

impl fmt::Debug for dyn ForceModel + Sync + '_ {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a force model")
    }
}

/// Steps that the bodies of a tile make between two looks at a token: some hundredths of a second. Forces that are no sums of terms may
/// take longer.
const STEPS_PER_LOOK: u64 = 1 << 15;
const FORCED_STEPS_PER_LOOK: u64 = 1 << 8;

/// Why a batch cannot be integrated. Bodies count from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BatchError {
    /// An argument with more or fewer entries than there are bodies.
    #[error("`{argument}` must have one entry for each of {expected} bodies, found {found}")]
    Length {
        /// Name of the argument.
        argument: &'static str,
        /// Number of bodies.
        expected: usize,
        /// Number of entries.
        found: usize,
    },
    /// An entry that is NaN or infinite.
    #[error("`{argument}` must be finite, found {found:?} for body {body}")]
    NonFinite {
        /// Name of the argument.
        argument: &'static str,
        /// The body.
        body: usize,
        /// Its entry.
        found: Vec<f64>,
    },
    /// A principal moment that is not positive.
    #[error("principal moments must be positive, found {found:?} for body {body}")]
    NotPositive {
        /// The body.
        body: usize,
        /// Its principal moments.
        found: [f64; 3],
    },
    /// The motion of a body stopped being finite: its step is too large.
    #[error("the state of body {body} stopped being finite")]
    Diverged {
        /// The first such body.
        body: usize,
    },
    /// A central force of another power of the distance than lanes evaluate.
    #[error("the power of a central force must be 0, -1, -2 or -3, found {found} for body {body}")]
    Power {
        /// The first such body.
        body: usize,
        /// The power.
        found: f64,
    },
    /// A method of the table failed.
    #[error("system {index}: {source}")]
    Integrate {
        /// The first system of which it failed.
        index: usize,
        /// Why.
        source: IntegrateError,
    },
    /// The work was cancelled.
    #[error("the batch was cancelled")]
    Cancelled,
}

impl BatchError {
    /// The error of a batch of some of many bodies, by the number that its body has among all: `members` holds that of each.
    #[must_use]
    pub fn among(mut self, members: &[usize]) -> Self {
        match &mut self {
            Self::NonFinite { body, .. }
            | Self::NotPositive { body, .. }
            | Self::Diverged { body }
            | Self::Power { body, .. }
            | Self::Integrate { index: body, .. } => *body = members.get(*body).copied().unwrap_or(*body),
            Self::Length { .. } | Self::Cancelled => {}
        }
        self
    }
}

/// Runs of free bodies, each over a grid of its own.
///
/// The method is `rkmk_b` of the table ([`Method::RkmkB`]) with the rotation in principal axes and the
/// translation in closed form: order 4, and the results of the two differ by rounding.
///
/// A body is needed for its [`PrincipalFrame`]: of many in arrays a [`PrincipalBody`](crate::body::PrincipalBody) takes least room.
#[derive(Debug, Clone, Copy)]
#[must_use = "runs begin with states, `from`"]
pub struct FreeRuns<'a, B = RigidBody> {
    bodies: &'a [B],
    grids: &'a [TimeGrid],
    gravity: Vector3<f64>,
}

impl<'a, B: PrincipalFrame + Sync> FreeRuns<'a, B> {
    /// Without forces.
    pub fn new(bodies: &'a [B], grids: &'a [TimeGrid]) -> Self {
        Self { bodies, grids, gravity: Vector3::zeros() }
    }

    /// With all bodies under uniform gravity g: r + vT + gT²/2, v + gT after the time T.
    ///
    /// Gravity that is not finite leads to ends that are not, and so to the same error.
    pub fn in_gravity(self, gravity: &Gravity) -> Self {
        Self { gravity: gravity.acceleration, ..self }
    }

    /// Runs from a state of each body to the end of its grid.
    ///
    /// Errors: slices of different lengths, states that are not finite at the start or at the end.
    pub fn from(self, states: &[RigidBodyState]) -> Result<Vec<RigidBodyState>, BatchError> {
        let mut ends = states.to_vec();
        self.advance(&mut ends, &CancellationToken::new())?;
        Ok(ends)
    }

    /// The same with the ends in the place of the states, and soon ended where it is cancelled.
    ///
    /// Errors: as of [`from`](Self::from), and [`BatchError::Cancelled`]. What the states are after one of a body that diverged, or after
    /// work that was cancelled, is not specified.
    pub fn advance(self, states: &mut [RigidBodyState], token: &CancellationToken) -> Result<(), BatchError> {
        let Self { bodies, grids, .. } = self;
        check_length("states", bodies.len(), states.len())?;
        let instructions = InstructionSet::detect();
        advance_by_tiles(grids, states, token, Tile::new, |tile, order, states| {
            self.advance_tile(instructions, tile, order, states, token);
        })
    }

    /// Moves the bodies of one tile, by their numbers.
    fn advance_tile(
        &self,
        instructions: InstructionSet,
        tile: &mut Tile,
        order: &[usize],
        states: &mut [RigidBodyState],
        token: &CancellationToken,
    ) {
        let Self { bodies, grids, gravity } = self;
        let (mut whole, mut rest) = ([(0.0, 0); TILE], [(0.0, 0); TILE]);
        for (at, (x, &i)) in states.iter().zip(order).enumerate() {
            let (body, grid) = (&bodies[i], &grids[i]);
            tile.set(at, body.moments(), &body.axes(), x.orientation(), x.angular_velocity());
            whole[at] = (grid.dt(), grid.full_steps());
            rest[at] = (last_step(grid), 1);
        }
        tile.turn_in_world(instructions, order.len(), [&whole, &rest], token);
        for (at, (x, &i)) in states.iter_mut().zip(order).enumerate() {
            let duration = grids[i].time(grids[i].steps()) - grids[i].time(0);
            let gained = gravity * duration;
            let (orientation, omega) = tile.get(at);
            let position = x.position() + (x.velocity() + gained * 0.5) * duration;
            *x = RigidBodyState::new(position, orientation, x.velocity() + gained, omega);
        }
    }
}

/// Runs of bodies under forces, each over a grid of its own.
///
/// The method is `rkmk_b` of the table ([`Method::RkmkB`]) in principal axes, order 4 on ℝ³ and on SO(3): the results of the two differ by
/// rounding.
///
/// ```
/// use nalgebra::Vector3;
/// use somersault_integrators::batch::ForcedRuns;
/// use somersault_integrators::body::RigidBody;
/// use somersault_integrators::driver::TimeGrid;
/// use somersault_integrators::series::WrenchTerm;
/// use somersault_integrators::state::RigidBodyState;
///
/// let bodies = vec![RigidBody::try_box(2.0, Vector3::new(1.0, 2.0, 3.0))?; 100];
/// let grids = vec![TimeGrid::try_new(0.0, 1.0, 0.01)?; 100];
/// let terms: Vec<_> = (0..100).map(|i| vec![WrenchTerm::Force(Vector3::x() * f64::from(i))]).collect();
/// let ends = ForcedRuns::try_new(&bodies, &grids, &terms)?.from(&vec![RigidBodyState::default(); 100])?;
/// assert!((ends[99].position().x - 0.25 * 99.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
#[must_use = "runs begin with states, `from`"]
pub struct ForcedRuns<'a> {
    bodies: &'a [RigidBody],
    grids: &'a [TimeGrid],
    terms: &'a [Vec<WrenchTerm>],
    forces: &'a [Forces<'a>],
}

impl<'a> ForcedRuns<'a> {
    /// Of each body under the sum of its terms, which a [force model](crate::force::ForceModel::add_terms) says.
    ///
    /// Errors: slices of different lengths; a central force whose power is not 0, −1, −2 or −3.
    pub fn try_new(
        bodies: &'a [RigidBody],
        grids: &'a [TimeGrid],
        terms: &'a [Vec<WrenchTerm>],
    ) -> Result<Self, BatchError> {
        check_length("grids", bodies.len(), grids.len())?;
        check_terms(bodies, terms)?;
        Ok(Self { bodies, grids, terms, forces: &[] })
    }

    /// The same with other forces on each body beside its terms.
    ///
    /// Errors: a slice of another length.
    pub fn with_forces(self, forces: &'a [Forces<'a>]) -> Result<Self, BatchError> {
        check_length("forces", self.bodies.len(), forces.len())?;
        Ok(Self { forces, ..self })
    }

    /// Runs from a state of each body to the end of its grid.
    ///
    /// Errors: slices of different lengths, states that are not finite at the start or at the end.
    pub fn from(self, states: &[RigidBodyState]) -> Result<Vec<RigidBodyState>, BatchError> {
        let mut ends = states.to_vec();
        self.advance(&mut ends, &CancellationToken::new())?;
        Ok(ends)
    }

    /// The same with the ends in the place of the states, and soon ended where it is cancelled.
    ///
    /// Errors: as of [`from`](Self::from), and [`BatchError::Cancelled`]. What the states are after one of a body that diverged, or after
    /// work that was cancelled, is not specified.
    pub fn advance(self, states: &mut [RigidBodyState], token: &CancellationToken) -> Result<(), BatchError> {
        self.advance_with(InstructionSet::detect(), states, token)
    }

    /// [`advance`](Self::advance) with chosen vector instructions, which change the duration and not the result.
    pub fn advance_with(
        self,
        instructions: InstructionSet,
        states: &mut [RigidBodyState],
        token: &CancellationToken,
    ) -> Result<(), BatchError> {
        let Self { bodies, grids, terms, forces } = self;
        check_length("states", bodies.len(), states.len())?;
        advance_by_tiles(
            grids,
            states,
            token,
            || (),
            |(), order, states| {
                let mut moving = Moving::new();
                for (&i, x) in order.iter().zip(&*states) {
                    moving.add(&bodies[i], x, &terms[i], others(forces, i));
                }
                let mut tile = ForcedTile::new(moving);
                let mut made = [0; TILE];
                let has_others = order.iter().any(|&i| !others(forces, i).is_empty());
                let most = if has_others { FORCED_STEPS_PER_LOOK } else { STEPS_PER_LOOK };
                let whole = |i: usize| (grids[i].dt(), grids[i].full_steps());
                let rest = |i: usize| (last_step(&grids[i]), 1);
                for of in [&whole as &dyn Fn(usize) -> (f64, u64), &rest] {
                    in_parts(order.iter().map(|&i| of(i)), most, token, |next| {
                        tile.hold();
                        let moving = order.iter().zip(next).enumerate();
                        for (at, (&i, &(h, steps))) in moving.filter(|(_, (_, (_, steps)))| *steps > 0) {
                            tile.take(at, grids[i].time(made[at]), h, steps);
                            made[at] += steps;
                        }
                        instructions.run(&mut tile);
                    });
                }
                for (at, (&i, x)) in order.iter().zip(states).enumerate() {
                    *x = tile.bodies.state(at, &bodies[i]);
                }
            },
        )
    }
}

/// Runs of bodies under forces, with steps that are adapted for each body by itself.
///
/// The method is `rkmk8_b` of the table ([`Method::Rkmk8B`]) in principal axes, its estimate of the error and its control of the steps.
///
/// ```
/// use nalgebra::Vector3;
/// use somersault_core::cancel::CancellationToken;
/// use somersault_integrators::batch::AdaptedRuns;
/// use somersault_integrators::body::RigidBody;
/// use somersault_integrators::driver::Adaptive;
/// use somersault_integrators::series::WrenchTerm;
/// use somersault_integrators::state::RigidBodyState;
///
/// let bodies = vec![RigidBody::try_box(2.0, Vector3::new(1.0, 2.0, 3.0))?; 100];
/// let terms: Vec<_> = (0..100).map(|i| vec![WrenchTerm::AngularDrag(-0.01 * f64::from(i))]).collect();
/// let starts = vec![RigidBodyState::spinning(Vector3::x()); 100];
/// let runs = AdaptedRuns::try_new(&bodies, (0.0, 2.0), Adaptive::with_tolerances(1e-9, 1e-9), &terms)?;
/// let at = runs.recorded(&starts, &[1.0, 2.0], &CancellationToken::new())?;
/// // About an axis of inertia the rate decays as exp(−c t / I).
/// let moment = bodies[0].inertia().principal_moments().max();
/// assert!((at[99][1].angular_velocity().x - (-0.99 * 2.0 / moment).exp()).abs() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
#[must_use = "runs begin with states, `recorded`"]
pub struct AdaptedRuns<'a> {
    bodies: &'a [RigidBody],
    interval: (f64, f64),
    settings: Adaptive,
    terms: &'a [Vec<WrenchTerm>],
    forces: &'a [Forces<'a>],
}

impl<'a> AdaptedRuns<'a> {
    /// Of each body under the sum of its terms, from one time to another.
    ///
    /// Errors: an interval that is empty, backwards or not finite; slices of different lengths; a central force whose power is not 0, −1, −2
    /// or −3.
    pub fn try_new(
        bodies: &'a [RigidBody],
        interval: (f64, f64),
        settings: Adaptive,
        terms: &'a [Vec<WrenchTerm>],
    ) -> Result<Self, BatchError> {
        check_interval(interval.0, interval.1)
            .map_err(|source| BatchError::Integrate { index: 0, source })?;
        check_terms(bodies, terms)?;
        Ok(Self { bodies, interval, settings, terms, forces: &[] })
    }

    /// The same with other forces on each body beside its terms.
    ///
    /// Errors: a slice of another length.
    pub fn with_forces(self, forces: &'a [Forces<'a>]) -> Result<Self, BatchError> {
        check_length("forces", self.bodies.len(), forces.len())?;
        Ok(Self { forces, ..self })
    }

    /// The states of each body at times within the interval, each after the one before. A step ends at each of them; the next has the size
    /// that was planned before.
    ///
    /// Errors: slices of different lengths, times outside of the interval, the first failure by index of the bodies, and
    /// [`BatchError::Cancelled`].
    pub fn recorded(
        self,
        states: &[RigidBodyState],
        t_eval: &[f64],
        token: &CancellationToken,
    ) -> Result<Vec<Vec<RigidBodyState>>, BatchError> {
        self.recorded_with(InstructionSet::detect(), states, t_eval, token)
    }

    /// [`recorded`](Self::recorded) with chosen vector instructions, which change the duration and not the result.
    pub fn recorded_with(
        self,
        instructions: InstructionSet,
        states: &[RigidBodyState],
        t_eval: &[f64],
        token: &CancellationToken,
    ) -> Result<Vec<Vec<RigidBodyState>>, BatchError> {
        check_length("states", self.bodies.len(), states.len())?;
        check_times(self.interval, t_eval)
            .map_err(|source| BatchError::Integrate { index: 0, source: source.into() })?;
        let numbers: Vec<usize> = (0..states.len()).collect();
        let of_tiles: Vec<Vec<Result<_, IntegrateError>>> = numbers
            .par_chunks(TILE)
            .map(|members| self.tile_recorded(instructions, members, states, t_eval, token))
            .collect();
        if token.is_cancelled() {
            return Err(BatchError::Cancelled);
        }
        each_named(of_tiles.into_iter().flatten().collect())
    }

    /// The same of the bodies of one tile.
    fn tile_recorded(
        &self,
        instructions: InstructionSet,
        members: &[usize],
        states: &[RigidBodyState],
        t_eval: &[f64],
        token: &CancellationToken,
    ) -> Vec<Result<Vec<RigidBodyState>, IntegrateError>> {
        let Self { bodies, interval: (start, _), settings, terms, forces } = self;
        let mut moving = Moving::new();
        for &i in members {
            moving.add(&bodies[i], &states[i], &terms[i], others(forces, i));
        }
        let mut tile = AdaptedTile::new(moving, settings.tolerances);
        let began = |&i: &usize| {
            let force = ForceOnBody { terms: &terms[i], others: others(forces, i) };
            OneRun::try_new(&bodies[i], &states[i], force, *start, settings, t_eval)
        };
        let mut runs: Vec<_> = members.iter().map(began).collect();
        while !token.is_cancelled() {
            let mut are_done = true;
            for (at, run) in runs.iter_mut().enumerate() {
                let h = match run {
                    Ok(run) => {
                        tile.t.0[at] = run.t;
                        run.propose(t_eval)
                    }
                    Err(_) => continue,
                };
                match h {
                    Ok(h) => {
                        tile.h.0[at] = h;
                        are_done &= h == 0.0;
                    }
                    Err(error) => *run = Err(error),
                }
            }
            if are_done {
                break;
            }
            instructions.run(&mut tile);
            for (at, (run, &i)) in runs.iter_mut().zip(members).enumerate() {
                let Ok(moving) = run else { continue };
                match moving.judge(tile.h.0[at], tile.error(at)) {
                    Ok(true) => {
                        tile.accept(at);
                        moving.keep(t_eval, || tile.bodies.state(at, &bodies[i]));
                    }
                    Ok(false) => {}
                    Err(error) => {
                        tile.h.0[at] = 0.0;
                        *run = Err(error);
                    }
                }
            }
        }
        runs.into_iter().map(|run| run.map(|run| run.kept)).collect()
    }
}

/// Where the run of one of the bodies of a tile is.
struct OneRun<'a> {
    force: ForceOnBody<'a>,
    t: f64,
    /// Where a step ends at the latest.
    until: f64,
    /// Where the step that is tried ends.
    t_after: f64,
    control: StepSizeControl,
    kept: Vec<RigidBodyState>,
}

impl<'a> OneRun<'a> {
    fn try_new(
        body: &RigidBody,
        x: &RigidBodyState,
        force: ForceOnBody<'a>,
        t: f64,
        settings: &Adaptive,
        t_eval: &[f64],
    ) -> Result<Self, IntegrateError> {
        check_state(x)?;
        let system = RigidBodySystem::new(*body, force);
        let control =
            StepSizeControl::try_new(settings, &RungeKuttaMuntheKaas::<Dop853>::INFO, &system, t, x)?;
        let kept = Vec::with_capacity(t_eval.len());
        let mut run = Self { force, t, until: t, t_after: t, control, kept };
        run.keep(t_eval, || *x);
        Ok(run)
    }

    /// The next step towards the next of the times, zero behind the last. A step ends where a force is not smooth.
    fn propose(&mut self, t_eval: &[f64]) -> Result<f64, IntegrateError> {
        let Some(&end) = t_eval.get(self.kept.len()) else { return Ok(0.0) };
        if self.t >= self.until {
            self.until = self.force.next_stop(self.t, f64::INFINITY).unwrap_or(f64::INFINITY);
        }
        let (h, t_after) = self.control.propose(self.t, end.min(self.until))?;
        self.t_after = t_after;
        Ok(h)
    }

    /// Whether the step that was tried is accepted, with its error; none was, if it had no size.
    fn judge(&mut self, h: f64, error: f64) -> Result<bool, IntegrateError> {
        let is_accepted = h > 0.0 && self.control.accepts(self.t, h, error)?;
        if is_accepted {
            self.t = self.t_after;
        }
        Ok(is_accepted)
    }

    /// Keeps the state where it is that of the next of the times.
    fn keep(&mut self, t_eval: &[f64], state: impl FnOnce() -> RigidBodyState) {
        if t_eval.get(self.kept.len()) == Some(&self.t) {
            self.kept.push(state());
        }
    }
}

/// All that acts on a body.
#[derive(Clone, Copy)]
struct ForceOnBody<'a> {
    terms: &'a [WrenchTerm],
    others: Forces<'a>,
}

impl ForceModel for ForceOnBody<'_> {
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        let of_terms = self.terms.iter().fold(Wrench::default(), |sum, term| sum + term.wrench(x));
        self.others.iter().fold(of_terms, |sum, force| sum + force.wrench(t, body, x))
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        nearest(t, self.others.iter().map(|force| force.next_stop(t, end)))
    }
}

/// The forces on a body beside its terms: none, where they were not given.
fn others<'a>(forces: &[Forces<'a>], i: usize) -> Forces<'a> {
    forces.get(i).copied().unwrap_or_default()
}

/// What a grid has left after its full steps.
fn last_step(grid: &TimeGrid) -> f64 {
    grid.time(grid.steps()) - grid.time(grid.full_steps())
}

/// Moves bodies along their grids by tiles of neighbours in the order of their numbers of steps: `advance` takes what `new` makes for it,
/// the numbers of the bodies of a tile, and their states.
fn advance_by_tiles<T>(
    grids: &[TimeGrid],
    states: &mut [RigidBodyState],
    token: &CancellationToken,
    new: impl Fn() -> T + Sync + Send,
    advance: impl Fn(&mut T, &[usize], &mut [RigidBodyState]) + Sync + Send,
) -> Result<(), BatchError> {
    check_length("grids", states.len(), grids.len())?;
    for (body, x) in states.iter().enumerate() {
        check_finite("states", body, x.position().as_slice())?;
        check_finite("states", body, x.orientation().coords.as_slice())?;
        check_finite("states", body, x.velocity().as_slice())?;
        check_finite("states", body, x.angular_velocity().as_slice())?;
    }
    let mut order: Vec<usize> = (0..grids.len()).collect();
    order.sort_by_key(|&i| Reverse(grids[i].full_steps()));
    let in_order = |states: &mut [RigidBodyState]| {
        let tiles = states.par_chunks_mut(TILE).zip(order.par_chunks(TILE));
        let advance = |made: &mut T, (states, order): (&mut [RigidBodyState], &[usize])| {
            advance(made, order, states);
            order.iter().zip(states).filter(|(_, x)| !x.is_finite()).map(|(i, _)| *i).min()
        };
        tiles.map_init(&new, advance).flatten().min()
    };
    let diverged = if order.is_sorted() {
        in_order(states)
    } else {
        let mut moved: Vec<RigidBodyState> = order.iter().map(|&i| states[i]).collect();
        let diverged = in_order(&mut moved);
        order.iter().zip(moved).for_each(|(&i, x)| states[i] = x);
        diverged
    };
    if token.is_cancelled() {
        return Err(BatchError::Cancelled);
    }
    diverged.map_or(Ok(()), |body| Err(BatchError::Diverged { body }))
}

/// Has the steps of the bodies of a tile made, by the size and the number of steps of each, so many at a time at most that a token is
/// looked at meanwhile; `make` takes how many of which size are next. A body without steps, or with steps of no size, has none.
fn in_parts(
    of: impl Iterator<Item = (f64, u64)>,
    most: u64,
    token: &CancellationToken,
    mut make: impl FnMut(&[(f64, u64); TILE]),
) {
    let mut left = [(0.0, 0); TILE];
    for (left, (h, steps)) in left.iter_mut().zip(of).filter(|(_, (h, steps))| moves(*h, *steps)) {
        *left = (h, steps);
    }
    while left.iter().any(|(_, steps)| *steps > 0) && !token.is_cancelled() {
        let next = left.map(|(h, steps)| (h, steps.min(most)));
        make(&next);
        for (left, next) in left.iter_mut().zip(next) {
            left.1 -= next.1;
        }
    }
}

/// How a body turns: the orientation of its principal frame, and its angular velocity there.
#[derive(Debug, Clone, Copy, Default)]
struct Turning {
    q: UnitQuaternion<f64>,
    omega: Vector3<f64>,
}

impl Turning {
    fn is_finite(&self) -> bool {
        self.q.coords.iter().chain(&self.omega).all(|x| x.is_finite())
    }
}

/// Whether a body with such steps moves.
fn moves(dt: f64, steps: u64) -> bool {
    steps > 0 && dt != 0.0
}

/// Runs of systems that do not see each other, each with steps of its own, by a method of the table.
#[derive(Debug)]
#[must_use = "runs begin with states, `from`"]
pub struct Runs<'a, S, T> {
    systems: &'a [S],
    method: Method,
    options: Options,
    steps: &'a [T],
}

impl<'a, S, T> Runs<'a, S, T>
where
    S: System<Forms: Forms<S>> + Sync,
    StateOf<S>: Send + Sync,
    T: Into<Steps> + Copy + Sync,
{
    /// One run for each of the systems, as [`Run::new`] has it.
    pub fn new(systems: &'a [S], method: Method, steps: &'a [T]) -> Self {
        Self { systems, method, options: Options::default(), steps }
    }

    /// The same with other options.
    pub fn with_options(self, options: Options) -> Self {
        Self { options, ..self }
    }

    /// Runs from a state of each system, as each would alone.
    ///
    /// Errors: slices of different lengths, and the first failure by index.
    pub fn from(self, states: &[StateOf<S>]) -> Result<Vec<Outcome<S::Configuration>>, BatchError> {
        let Self { systems, method, options, steps } = self;
        check_length("states", systems.len(), states.len())?;
        check_length("steps", systems.len(), steps.len())?;
        let outcomes: Vec<_> = (systems, states, steps)
            .into_par_iter()
            .map(|(system, state, steps)| Run::new(system, method, *steps).with_options(options).from(state))
            .collect();
        each_named(outcomes)
    }

    /// The same with the states at times within the interval of all runs kept, as [`Recorder::at_times`] has them, and nothing else of
    /// the runs, which end soon after they are cancelled.
    ///
    /// Errors: as of [`from`](Self::from), times outside of the interval of a run or not in its direction, and
    /// [`BatchError::Cancelled`].
    pub fn recorded(
        self,
        states: &[StateOf<S>],
        t_eval: &[f64],
        token: &CancellationToken,
    ) -> Result<Vec<Vec<StateOf<S>>>, BatchError> {
        let Self { systems, method, options, steps } = self;
        check_length("states", systems.len(), states.len())?;
        check_length("steps", systems.len(), steps.len())?;
        let runs = (systems, states, steps).into_par_iter().map(|(system, state, steps)| {
            if token.is_cancelled() {
                return Ok(Vec::new());
            }
            let steps: Steps = (*steps).into();
            let mut recorder = Recorder::at_times(steps.interval(), state, t_eval.to_vec())?;
            let mut observer = (&mut recorder, token);
            Run::new(system, method, steps).with_options(options).observed_by(&mut observer).from(state)?;
            Ok(recorder.into_solution().states)
        });
        let kept: Vec<Result<_, IntegrateError>> = runs.collect();
        if token.is_cancelled() {
            return Err(BatchError::Cancelled);
        }
        each_named(kept)
    }
}

/// What each of the systems led to, or the first error, with the number of its system.
fn each_named<T>(found: Vec<Result<T, IntegrateError>>) -> Result<Vec<T>, BatchError> {
    let named = |(index, found): (usize, Result<T, _>)| {
        found.map_err(|source| BatchError::Integrate { index, source })
    };
    found.into_iter().enumerate().map(named).collect()
}

/// The rotation of many free bodies.
///
/// All in principal frames: orientations lead from them to the world frame, and angular velocities
/// have their components there.
///
/// ```
/// use nalgebra::{UnitQuaternion, Vector3};
/// use somersault_integrators::batch::FreeBodyBatch;
///
/// let moments = [Vector3::new(1.0, 2.0, 2.5), Vector3::new(3.0, 3.0, 3.0)];
/// let upright = [UnitQuaternion::identity(); 2];
/// let mut batch = FreeBodyBatch::try_new(&moments, &upright, &[Vector3::new(0.0, 1.0, 0.01), Vector3::z()])?;
/// batch.advance(&[0.01, 0.02], &[1000, 500])?;
/// let ten_seconds = UnitQuaternion::from_scaled_axis(Vector3::z() * 10.0);
/// assert!(batch.orientations()[1].angle_to(&ten_seconds) < 1e-12);
/// # Ok::<(), somersault_integrators::batch::BatchError>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct FreeBodyBatch {
    principal_moments: Vec<Vector3<f64>>,
    orientations: Vec<UnitQuaternion<f64>>,
    angular_velocities_body: Vec<Vector3<f64>>,
}

impl FreeBodyBatch {
    /// One body for each entry of the slices.
    ///
    /// Errors: slices of different lengths, entries that are not finite, moments that are not positive.
    pub fn try_new(
        principal_moments: &[Vector3<f64>],
        orientations: &[UnitQuaternion<f64>],
        angular_velocities_body: &[Vector3<f64>],
    ) -> Result<Self, BatchError> {
        let n = principal_moments.len();
        check_length("orientations", n, orientations.len())?;
        check_length("angular_velocities_body", n, angular_velocities_body.len())?;
        for body in 0..n {
            check_finite("principal_moments", body, principal_moments[body].as_slice())?;
            check_finite("orientations", body, orientations[body].coords.as_slice())?;
            check_finite("angular_velocities_body", body, angular_velocities_body[body].as_slice())?;
            // Subnormal moments are refused with the non-positive ones: dividing by them overflows.
            if principal_moments[body].min() < f64::MIN_POSITIVE {
                return Err(BatchError::NotPositive { body, found: principal_moments[body].into() });
            }
        }
        Ok(Self {
            principal_moments: principal_moments.to_vec(),
            orientations: orientations.to_vec(),
            angular_velocities_body: angular_velocities_body.to_vec(),
        })
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.principal_moments.len()
    }

    /// Whether there are no bodies.
    pub fn is_empty(&self) -> bool {
        self.principal_moments.is_empty()
    }

    /// Orientations, principal frame → world frame.
    ///
    /// A quaternion and its negative are the same orientation; which of them comes out is not
    /// specified.
    pub fn orientations(&self) -> &[UnitQuaternion<f64>] {
        &self.orientations
    }

    /// Angular velocities in the principal frames, rad/s.
    pub fn angular_velocities_body(&self) -> &[Vector3<f64>] {
        &self.angular_velocities_body
    }

    /// `steps[i]` steps of `dt[i]` seconds, of either sign, for body `i`.
    ///
    /// The method is of order 4. For any dt ‖ω‖ the orientations remain unit quaternions and a
    /// rotation about a principal axis is exact: to rounding in each step while dt ‖ω‖ < π/2, to
    /// 3·10⁻¹⁶ dt ‖ω‖ + 10⁻¹⁵ beyond.
    ///
    /// Errors: slices of the wrong length, steps that are not finite, and a motion that stops being
    /// finite. An error leaves the batch as it was.
    pub fn advance(&mut self, dt: &[f64], steps: &[u64]) -> Result<(), BatchError> {
        self.advance_with(InstructionSet::detect(), dt, steps)
    }

    /// [`advance`](Self::advance) with chosen vector instructions, which change the duration
    /// and not the result.
    pub fn advance_with(
        &mut self,
        instructions: InstructionSet,
        dt: &[f64],
        steps: &[u64],
    ) -> Result<(), BatchError> {
        check_length("dt", self.len(), dt.len())?;
        check_length("steps", self.len(), steps.len())?;
        for (body, dt) in dt.iter().enumerate() {
            check_finite("dt", body, &[*dt])?;
        }
        let mut moving: Vec<usize> = (0..self.len()).filter(|&i| moves(dt[i], steps[i])).collect();
        moving.sort_by_key(|&i| Reverse(steps[i]));
        let of = |i: usize| Turning { q: self.orientations[i], omega: self.angular_velocities_body[i] };
        let mut moved: Vec<Turning> = moving.iter().map(|&i| of(i)).collect();
        let (tiles, token) =
            (moved.par_chunks_mut(TILE).zip(moving.par_chunks(TILE)), CancellationToken::new());
        tiles.for_each_init(Tile::new, |tile, (moved, bodies)| {
            let (principal, mut made) = (UnitQuaternion::identity(), [(0.0, 0); TILE]);
            for (at, (Turning { q, omega }, &i)) in moved.iter().zip(bodies).enumerate() {
                tile.set(at, &self.principal_moments[i], &principal, q, omega);
                made[at] = (dt[i], steps[i]);
            }
            tile.turn(instructions, bodies.len(), [&made], &token);
            for (at, turning) in moved.iter_mut().enumerate() {
                let (q, omega) = tile.get(at);
                *turning = Turning { q, omega };
            }
        });

        let diverged = moving.iter().zip(&moved).filter(|(_, moved)| !moved.is_finite());
        if let Some(body) = diverged.map(|(&i, _)| i).min() {
            return Err(BatchError::Diverged { body });
        }
        for (i, Turning { q, omega }) in moving.into_iter().zip(moved) {
            self.orientations[i] = q;
            self.angular_velocities_body[i] = omega;
        }
        Ok(())
    }
}

/// Whether there is a list of terms for each of the bodies, which lanes evaluate.
fn check_terms(bodies: &[RigidBody], terms: &[Vec<WrenchTerm>]) -> Result<(), BatchError> {
    check_length("terms", bodies.len(), terms.len())?;
    let foreign = |(body, terms): (usize, &Vec<WrenchTerm>)| Some((body, forced::foreign_power(terms)?));
    let found = terms.iter().enumerate().find_map(foreign);
    found.map_or(Ok(()), |(body, found)| Err(BatchError::Power { body, found }))
}

fn check_length(argument: &'static str, expected: usize, found: usize) -> Result<(), BatchError> {
    if expected == found { Ok(()) } else { Err(BatchError::Length { argument, expected, found }) }
}

fn check_finite(argument: &'static str, body: usize, found: &[f64]) -> Result<(), BatchError> {
    if found.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(BatchError::NonFinite { argument, body, found: found.to_vec() })
    }
}
