//! How a solution moves with what is given: ends, times and parameters.

use super::error::{CollocationError, expect_length};
use super::guess::Guess;
use super::layout::PhaseLayout;
use super::linkage::{End, Place, Quantity};
use super::problem::Problem;
use super::solve::CollocationReport;
use super::transcription::Transcription;
use somersault_nlp::{Held, Sensitivity, Start};

/// A solution on its mesh, ready to be differentiated with respect to what is given: [`somersault_nlp::Sensitivity`] of its program.
///
/// Derivatives are exact for the program, and those of the motion as far as the mesh resolves it: where controls jump within
/// an interval, the time of the jump cannot move.
pub struct SolutionSensitivity<'p> {
    transcription: Transcription<'p>,
    sensitivity: Sensitivity,
}

/// How a solution moves in one direction of what is given.
#[derive(Debug, Clone, PartialEq)]
pub struct SolutionDerivative {
    /// Of the cost.
    pub cost: f64,
    /// Of each phase.
    pub phases: Vec<PhaseDerivative>,
}

/// How one phase moves, at points that keep their fractions of the duration. Rows are those of the
/// [`PhaseSolution`](super::PhaseSolution).
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseDerivative {
    /// Of t₀ and t_f.
    pub horizon: (f64, f64),
    /// Of x.
    pub states: Vec<Vec<f64>>,
    /// Of u.
    pub controls: Vec<Vec<f64>>,
    /// Of λ.
    pub costates: Vec<Vec<f64>>,
    /// Of p.
    pub parameters: Vec<f64>,
}

impl CollocationReport {
    /// Prepares derivatives of the solution of `problem`, which this is the report of. Fails where it is no isolated solution.
    pub fn sensitivity<'p>(
        &self,
        problem: &'p mut Problem,
    ) -> Result<SolutionSensitivity<'p>, CollocationError> {
        let meshes = self.meshes();
        let mut transcription = Transcription::with_fixed(problem, &meshes)?;
        let Start { z, constraint_multipliers, .. } = transcription.repeated(&self.phases, &self.program)?;
        let (found, expected) = (constraint_multipliers.len(), transcription.row_scales.len());
        expect_length(None, "multipliers of the solution", found, expected)?;
        let sensitivity = Sensitivity::try_new(&mut transcription, &z, &constraint_multipliers)?;
        Ok(SolutionSensitivity { transcription, sensitivity })
    }
}

impl SolutionSensitivity<'_> {
    /// What is given: ends of states, times and parameters that have one value only.
    pub fn given(&self) -> Vec<Place> {
        let mut given = Vec::new();
        for (phase, posed) in self.transcription.problem.phases.iter().enumerate() {
            let bounds = &posed.bounds;
            let ends = [(End::Start, &bounds.initial_state), (End::Finish, &bounds.final_state)];
            let states = ends.iter().flat_map(|&(end, intervals)| {
                let fixed = intervals.iter().enumerate().filter(|(_, interval)| interval.is_fixed());
                fixed.map(move |(i, _)| Place { phase, end, quantity: Quantity::State(i) })
            });
            given.extend(states);
            let times = [(End::Start, &bounds.initial_time), (End::Finish, &bounds.final_time)];
            let fixed = times.iter().filter(|(_, interval)| interval.is_fixed());
            given.extend(fixed.map(|&(end, _)| Place { phase, end, quantity: Quantity::Time }));
            let fixed = bounds.parameters.iter().enumerate().filter(|(_, interval)| interval.is_fixed());
            given.extend(fixed.map(|(i, _)| Place {
                phase,
                end: End::Start,
                quantity: Quantity::Parameter(i),
            }));
        }
        given
    }

    /// Bounds and path constraints that hold by a multiplier near zero, or nearly hold: derivatives are those of one side.
    pub fn n_weakly_active(&self) -> usize {
        self.sensitivity.weakly_active().len()
    }

    /// How the solution moves where each of these, which are [given](Self::given), moves by its number.
    pub fn derivative(&mut self, direction: &[(Place, f64)]) -> Result<SolutionDerivative, CollocationError> {
        let variables = &self.transcription.variables;
        let mut moved = vec![0.0; variables.scales.len()];
        let mut multipliers = vec![0.0; self.transcription.row_scales.len()];
        let mut cost = 0.0;
        for (by, change) in direction {
            let number = variables.phases[by.phase].place(by);
            let found = self.sensitivity.derivative(Held::Variable(number))?;
            // in units of the user
            let change = change / variables.scales[number];
            cost += change * found.cost;
            for ((x, dz), scale) in moved.iter_mut().zip(&found.z).zip(&variables.scales) {
                *x += change * dz * scale;
            }
            multipliers.iter_mut().zip(&found.constraint_multipliers).for_each(|(y, dy)| *y += change * dy);
        }
        let (mut row, mut phases) = (0, Vec::new());
        for k in 0..self.transcription.grids.len() {
            phases.push(self.phase(k, row, &moved, &multipliers));
            row += self.transcription.n_rows(k);
        }
        Ok(SolutionDerivative { cost, phases })
    }

    fn phase(&self, k: usize, row: usize, moved: &[f64], multipliers: &[f64]) -> PhaseDerivative {
        let sizes = self.transcription.problem.phases[k].sizes;
        let n = self.transcription.grids[k].n_points();
        let layout: PhaseLayout = self.transcription.variables.phases[k];
        let slice = |first: usize, length: usize| moved[first..first + length].to_vec();
        PhaseDerivative {
            horizon: (moved[layout.times()], moved[layout.times() + 1]),
            states: (0..=n).map(|i| slice(layout.state(i), sizes.states)).collect(),
            controls: (0..n).map(|i| slice(layout.control(i), sizes.controls)).collect(),
            costates: self.transcription.costates(k, row, multipliers),
            parameters: slice(layout.parameters(), sizes.parameters),
        }
    }
}

impl PhaseDerivative {
    /// The guess where what is given has moved by `change`, to first order, from one at the same points.
    pub fn moved(&self, guess: &Guess, change: f64) -> Guess {
        let mut moved = guess.clone();
        let add = |to: &mut [f64], by: &[f64]| to.iter_mut().zip(by).for_each(|(x, dx)| *x += change * dx);
        moved.states.iter_mut().zip(&self.states).for_each(|(x, by)| add(x, by));
        // a guess has controls at the end too, where nothing is collocated
        let last = self.controls.last();
        moved.controls.iter_mut().zip(self.controls.iter().chain(last)).for_each(|(u, by)| add(u, by));
        add(&mut moved.parameters, &self.parameters);
        let (start, end) = guess.interval();
        let (first, last) = (start + change * self.horizon.0, end + change * self.horizon.1);
        for t in &mut moved.times {
            *t = first + (*t - start) / (end - start) * (last - first);
        }
        moved
    }
}
