//! What an independent, accurate integration makes of a solution.
//!
//! A program may be solved to the last digit and the motion still be none: collocation asks for the equations at its
//! points only, and a coarse mesh leaves room between them, at a cost far below the true one. So the
//! controls found are re-integrated by DOP853: from the first node of each interval to its last (the
//! defect), and once from start to end. The latter grows where the problem is hyper-sensitive, however good the
//! solution is; it is reported, not required.

use super::error::CollocationError;
use super::function::VectorFunction;
use super::problem::{Phase, Problem};
use super::quaternions::{in_body_axes, set_sizes};
use super::solution::{PhaseSolution, combine};
use super::vector::{DrivenPhase, Vector};
use somersault_core::cancel::CancellationToken;
use somersault_integrators::driver::{Adaptive, Steps};
use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas};
use somersault_integrators::run::Run;
use somersault_integrators::state::State;
use somersault_nlp::EvaluationError;

/// Relative and absolute tolerance of each step of the integration.
const TOLERANCE: f64 = 1e-12;
/// The same in units of the relative error that functions have, where that is more than rounding.
const NOISE: f64 = 10.0;
/// Steps after which an integration counts as impossible.
const MAX_STEPS: usize = 20_000;
/// Places within each interval, beside its points, where bounds and path constraints are looked at.
const SAMPLES: usize = 8;

/// One phase re-integrated. Errors are relative: |Δx|/(1 + max |x|), the largest of all states; those of orientations are angles, rad.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PhaseConfirmation {
    /// At the end of each interval, integrated from its start. Infinite where the integration stopped early.
    pub defects: Vec<f64>,
    /// At t_f, integrated from t₀ in one piece.
    pub end_to_end_error: f64,
    /// State at t_f of that integration; NaN where it stopped early.
    pub end_to_end_state: Vec<f64>,
    /// Largest violation of bounds of states and controls and of path constraints, between the points too.
    pub violation: f64,
    /// What is violated there and when; empty where nothing is.
    pub violated: String,
    /// ∫ L dt, accurate, of the motion from interval to interval.
    pub running_cost: f64,
    /// Φ.
    pub end_cost: f64,
}

/// All phases re-integrated.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Confirmation {
    /// One for each phase.
    pub phases: Vec<PhaseConfirmation>,
    /// Cost with accurate integrals of the running costs.
    pub cost: f64,
}

impl Confirmation {
    /// Of a solution that was not integrated.
    pub(crate) fn unknown(solution: &[PhaseSolution]) -> Self {
        let of = |phase: &PhaseSolution| PhaseConfirmation {
            defects: vec![f64::INFINITY; phase.grid.intervals.len()],
            end_to_end_error: f64::INFINITY,
            end_to_end_state: vec![f64::NAN; phase.states[0].len()],
            violation: f64::INFINITY,
            violated: String::new(),
            running_cost: f64::NAN,
            end_cost: f64::NAN,
        };
        Self { phases: solution.iter().map(of).collect(), cost: f64::NAN }
    }

    fn largest(&self, of: impl Fn(&PhaseConfirmation) -> f64) -> f64 {
        self.phases.iter().map(of).fold(0.0, f64::max)
    }

    /// The largest defect.
    pub fn max_defect(&self) -> f64 {
        self.largest(|phase| phase.defects.iter().copied().fold(0.0, f64::max))
    }

    /// The largest violation of bounds and path constraints.
    pub fn max_violation(&self) -> f64 {
        self.largest(|phase| phase.violation)
    }

    /// A sentence about bounds and path constraints between the points, where one is exceeded by more than `allowed`.
    pub fn violation_sentence(&self, allowed: f64) -> Option<String> {
        let phases = self.phases.iter().enumerate();
        let (k, worst) = phases.max_by(|a, b| a.1.violation.total_cmp(&b.1.violation))?;
        let PhaseConfirmation { violation, violated, .. } = worst;
        let phase = if self.phases.len() > 1 { format!(" in phase {k}") } else { String::new() };
        // of a motion that was not looked at there is nothing to say
        (*violation > allowed && !violated.is_empty()).then(|| {
            format!("Between its points it exceeds its bounds by up to {violation:.1e}: {violated}{phase}.")
        })
    }

    /// Whether each defect is within `allowed`.
    pub fn is_confirmed(&self, allowed: f64) -> bool {
        self.max_defect() <= allowed
    }

    /// Whether the motion is confirmed, given the relative error that its use allows, and what of its bounds it exceeds by more.
    pub fn sentence(&self, allowed: f64) -> String {
        let worth = self.worth(allowed);
        self.violation_sentence(allowed).map_or(worth.clone(), |violation| format!("{worth} {violation}"))
    }

    fn worth(&self, allowed: f64) -> String {
        let (defect, end) = (self.max_defect(), self.end_to_end_error());
        if defect.is_infinite() {
            "The motion was not re-integrated to its end: the integration stopped early.".to_owned()
        } else if self.is_confirmed(allowed) {
            format!(
                "The motion holds when re-integrated: defects ≤ {defect:.1e}, from start to end {end:.1e}."
            )
        } else {
            format!(
                "The optimum exploits its discretisation: on re-integration it has defects up to {defect:.1e} and ends {end:.1e} away."
            )
        }
    }

    /// The largest error of an integration from start to end.
    pub fn end_to_end_error(&self) -> f64 {
        self.largest(|phase| phase.end_to_end_error)
    }
}

/// Integrates a solution again.
pub fn confirm(problem: &mut Problem, solution: &[PhaseSolution]) -> Result<Confirmation, CollocationError> {
    confirm_cancellable(problem, solution, &CancellationToken::new())
}

/// The same until it is cancelled, which is looked for at each step of the integration: after that there are no
/// integrations, whose defects are infinite.
pub fn confirm_cancellable(
    problem: &mut Problem,
    solution: &[PhaseSolution],
    token: &CancellationToken,
) -> Result<Confirmation, CollocationError> {
    let (expected, found) = (problem.phases.len(), solution.len());
    if expected != found {
        return Err(CollocationError::Length { phase: None, argument: "solution", expected, found });
    }
    let (mut cost, mut phases) = (0.0, Vec::new());
    for (phase, solution) in problem.phases.iter_mut().zip(solution) {
        let confirmation = confirm_phase(phase, solution, token)?;
        cost += confirmation.running_cost + confirmation.end_cost;
        phases.push(confirmation);
    }
    Ok(Confirmation { phases, cost })
}

fn confirm_phase(
    phase: &mut Phase,
    solution: &PhaseSolution,
    token: &CancellationToken,
) -> Result<PhaseConfirmation, CollocationError> {
    let n_states = phase.sizes.states;
    let largest = |s: usize| solution.states.iter().fold(0.0, |m: f64, x| m.max(x[s].abs()));
    let mut sizes: Vec<f64> = (0..n_states).map(|s| 1.0 + largest(s)).collect();
    let quaternions = phase.quaternions.clone();
    set_sizes(&quaternions, &mut sizes);
    let error = |found: &[f64], expected: &[f64]| {
        let mut differences: Vec<f64> = found.iter().zip(expected).map(|(a, b)| a - b).collect();
        in_body_axes(&quaternions, expected, &mut differences);
        let errors = differences.iter().zip(&sizes).map(|(difference, size)| difference.abs() / size);
        // a NaN would be lost in the maximum
        errors.fold(0.0, |m: f64, e| if e.is_nan() { f64::INFINITY } else { m.max(e) })
    };
    let (mut defects, mut running_cost) = (Vec::new(), 0.0);
    let mut through = solution.states[0].clone();
    for (k, interval) in solution.grid.intervals.iter().enumerate() {
        let first = &solution.states[interval.first];
        let last = &solution.states[interval.first + interval.radau.len()];
        let (reached, cost) = integrate(phase, solution, k, first, token)?;
        defects.push(error(&reached, last));
        running_cost += cost;
        (through, _) = integrate(phase, solution, k, &through, token)?;
    }
    let last = &solution.states[solution.states.len() - 1];
    let (violation, violated) = violation(phase, solution)?;
    Ok(PhaseConfirmation {
        defects,
        end_to_end_error: error(&through, last),
        end_to_end_state: through,
        violation,
        violated,
        running_cost,
        end_cost: end_cost(phase, solution)?,
    })
}

/// State and running cost at the end of interval `k`, from `state` at its start; NaN where the motion cannot be
/// integrated.
fn integrate(
    phase: &mut Phase,
    solution: &PhaseSolution,
    k: usize,
    state: &[f64],
    mut token: &CancellationToken,
) -> Result<(Vec<f64>, f64), CollocationError> {
    let n = state.len();
    if token.is_cancelled() {
        return Ok((vec![f64::NAN; n], f64::NAN));
    }
    let interval = &solution.grid.intervals[k];
    let (start, end) =
        (solution.horizon.time(interval.start), solution.horizon.time(interval.start + interval.length));
    let initial = State {
        configuration: Vector(state.iter().copied().chain([0.0]).collect()),
        rate: Vector(vec![0.0; n + 1]),
    };
    // below the error of the values no step can be judged
    let tolerance = TOLERANCE.max(NOISE * phase.relative_errors().values);
    let control = Adaptive {
        first_step: Some(0.1 * (end - start)),
        max_steps: MAX_STEPS,
        ..Adaptive::with_tolerances(tolerance, tolerance)
    };
    let driven = DrivenPhase::new(phase, solution, k);
    let stepper = RungeKuttaMuntheKaas::<Dop853>::default();
    let steps = Steps::adapted((start, end), control);
    let outcome = Run::by_embedded_stepper(&driven, &stepper, steps).observed_by(&mut token).from(&initial);
    if let Some(error @ EvaluationError::Failed(_)) = driven.into_failure() {
        return Err(error.into());
    }
    let mut reached = match outcome {
        Ok(outcome) if !token.is_cancelled() => outcome.state.configuration.0,
        _ => vec![f64::NAN; n + 1],
    };
    let cost = reached.split_off(n)[0];
    Ok((reached, cost))
}

fn end_cost(phase: &mut Phase, solution: &PhaseSolution) -> Result<f64, CollocationError> {
    let mut arguments = solution.states[0].clone();
    arguments.extend(&solution.states[solution.states.len() - 1]);
    arguments.extend(&solution.parameters);
    arguments.extend(<[f64; 2]>::from(solution.horizon()));
    let mut values = vec![0.0; phase.ends.n_outputs()];
    phase.ends.evaluate(&arguments, &mut values)?;
    Ok(values[0])
}

/// Largest distance of states, controls and path constraints from their bounds, of which and when.
fn violation(phase: &mut Phase, solution: &PhaseSolution) -> Result<(f64, String), CollocationError> {
    let sizes = phase.sizes;
    let mut arguments = vec![0.0; sizes.point()];
    let mut path = vec![0.0; phase.path.n_outputs()];
    let (mut largest, mut place) = (0.0, None);
    let mut take = |distance: f64, row: usize, time: f64| {
        if distance > largest {
            (largest, place) = (distance, Some((row, time)));
        }
    };
    for interval in &solution.grid.intervals {
        let radau = &interval.radau;
        let (mut state_basis, mut control_basis) = (vec![0.0; radau.len() + 1], vec![0.0; radau.len()]);
        // with the end, where nothing is collocated
        let between = (1..=SAMPLES + 1).map(|i| 2.0 * i as f64 / (SAMPLES + 1) as f64 - 1.0);
        for tau in radau.points().iter().copied().chain(between) {
            radau.state_basis(tau, &mut state_basis);
            radau.control_basis(tau, &mut control_basis);
            let (state, rest) = arguments.split_at_mut(sizes.states);
            let (control, rest) = rest.split_at_mut(sizes.controls);
            let (parameters, time) = rest.split_at_mut(sizes.parameters);
            combine(&solution.states[interval.first..], &state_basis, state);
            combine(&solution.controls[interval.first..], &control_basis, control);
            parameters.copy_from_slice(&solution.parameters);
            time[0] = solution.horizon.time(interval.start + 0.5 * (tau + 1.0) * interval.length);
            let time = time[0];
            let at_point = arguments.iter().zip(phase.bounds.state.iter().chain(&phase.bounds.control));
            at_point.enumerate().for_each(|(row, (&x, bounds))| take(bounds.distance(x), row, time));
            if path.len() > 1 {
                phase.path.evaluate(&arguments, &mut path)?;
                let n = sizes.states + sizes.controls;
                let constraints = path[1..].iter().zip(&phase.bounds.path).enumerate();
                constraints.for_each(|(row, (&g, bounds))| take(bounds.distance(g), n + row, time));
            }
        }
    }
    let violated = place.map(|(row, time)| format!("{} at {time:.4} s", phase.name_of_row(row)));
    Ok((largest, violated.unwrap_or_default()))
}
