//! What the Adams methods share: history, start-up and coefficients.
//!
//! A method of K steps remembers the slopes of the K − 1 steps before. Until they exist it starts up in
//! one of two ways that the user chooses.

use crate::methods::rkmk::RungeKuttaMuntheKaas4;
use crate::scratch::Scratch;
use crate::state::Rate;
use crate::stepper::{StepError, Stepper};
use crate::system::{RateOf, StateOf, System};

/// How a method with history makes its first steps, and its steps after a restart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StartUp {
    /// By `rkmk`, of order 4 on the group: keeps the order of every method here.
    #[default]
    OneStep,
    /// By its own family with as many steps as there are, from one up: the reading that reproduces
    /// Table 6.2. Costs the four-step methods their order on ℝ³ (the first step is of order one).
    Ladder,
}

/// Adams–Bashforth weights of v_{n+1} − v_n = h Σ b_j a_{n−j} for one to four steps.
pub(crate) const BASHFORTH: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.0],
    [3.0 / 2.0, -1.0 / 2.0, 0.0, 0.0],
    [23.0 / 12.0, -16.0 / 12.0, 5.0 / 12.0, 0.0],
    [55.0 / 24.0, -59.0 / 24.0, 37.0 / 24.0, -9.0 / 24.0],
];

/// Adams–Moulton weights of r_{n+1} − r_n = h Σ b_j v_{n+1−j} for one to four values.
///
/// The thesis prints −19/24 in line 5 of algorithm 14; (5.13) and order 4 require +19/24.
pub(crate) const MOULTON: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.0],
    [1.0 / 2.0, 1.0 / 2.0, 0.0, 0.0],
    [5.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0, 0.0],
    [9.0 / 24.0, 19.0 / 24.0, -5.0 / 24.0, 1.0 / 24.0],
];

/// Memory of a K-step Adams method.
pub struct AdamsMemory<S: System, const K: usize> {
    /// Slopes (v, a) of the current step and of the steps before, newest first.
    slopes: [(RateOf<S>, RateOf<S>); K],
    /// How many of them, the current one included, belong to this trajectory.
    known: usize,
    workspace: S::Workspace,
    sum: Scratch<RateOf<S>>,
    starter: <RungeKuttaMuntheKaas4 as Stepper<S>>::Memory,
}

impl<S: System, const K: usize> AdamsMemory<S, K> {
    pub(crate) fn new(system: &S, x: &StateOf<S>) -> Result<Self, StepError> {
        Ok(Self {
            slopes: std::array::from_fn(|_| (x.rate.clone(), x.rate.clone())),
            known: 0,
            workspace: system.workspace(),
            sum: Scratch::like(&x.rate),
            starter: RungeKuttaMuntheKaas4.start(system, x)?,
        })
    }

    pub(crate) fn restart(&mut self) {
        self.known = 0;
    }

    /// Makes room for the slope at `x` and evaluates it. Returns the row of the tables to use.
    #[inline(always)]
    fn advance(&mut self, system: &S, t: f64, x: &StateOf<S>) -> usize {
        self.slopes.rotate_right(1);
        let (v, a) = &mut self.slopes[0];
        system.velocity(&mut self.workspace, t, x, v);
        system.acceleration(&mut self.workspace, t, x, a);
        self.known = (self.known + 1).min(K);
        self.known - 1
    }

    /// One step: `explicit` takes the displacement from velocities known (Adams–Bashforth), otherwise
    /// it includes the new velocity (Adams–Moulton).
    #[inline(always)]
    pub(crate) fn step(
        &mut self,
        system: &S,
        start_up: StartUp,
        explicit: bool,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        let row = self.advance(system, t, x);
        if row + 1 < K && start_up == StartUp::OneStep {
            return RungeKuttaMuntheKaas4.step(system, t, x, h, &mut self.starter, out);
        }
        let mut sum = self.sum.lend();
        sum.set_zero();
        for j in 0..=row {
            sum.axpy(BASHFORTH[row][j], &self.slopes[j].1);
        }
        out.assign(x);
        out.kick(&sum, h);
        if explicit {
            sum.set_zero();
            for j in 0..=row {
                sum.axpy(BASHFORTH[row][j], &self.slopes[j].0);
            }
            out.drift(&sum, h);
        } else {
            let weights = &MOULTON[row];
            // The new velocity enters with the configuration it is about to leave.
            system.velocity(&mut self.workspace, t + h, out, &mut sum);
            sum.scale(weights[0]);
            for j in 0..row {
                sum.axpy(weights[j + 1], &self.slopes[j].0);
            }
            out.drift(&sum, h);
        }
        Ok(())
    }
}
