//! What an independent, accurate integration says about a motion that was found.
//!
//! A transcription satisfies its own recursion, which proves nothing about the motion. Here the equations of motion are re-integrated
//! with adapted steps of order 8 and tolerances of 1e-12: from each node to the next one, which shows how accurate the motion
//! is there, and once from start to end. Where the defects add up to more than the use of the motion allows, the
//! optimum exploits its discretisation. What one integration from start to end makes of them is reported beside that: it
//! grows along a hyper-sensitive motion, however good its steps are.

use crate::dynamics::{HybridDynamics, Tree};
use crate::error::OcpError;
use crate::problem::MotionProblem;
use crate::shooting::{Drive, Shooting};
use crate::transcription::Transcription;
use somersault_core::argument::expect_length;
use somersault_core::cancel::CancellationToken;
use somersault_integrators::driver::{IntegrateError, Steps};
use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas};
use somersault_integrators::run::Run;
use somersault_integrators::state::Tolerances;
use somersault_integrators::step_size::Adaptive;
use somersault_multibody::motion::TreeSystem;
use somersault_multibody::{Data, DynamicsError, Model, Split};
use somersault_nlp::{EvaluationError, Flow, Iteration, NlpSolver, Report, SolverError, Start};

/// Tolerances of the integration, relative and absolute.
const TOLERANCE: f64 = 1e-12;
/// Steps of the integration for each of the motion's, at most: what takes more cannot be integrated.
const MAX_STEPS: usize = 1000;

/// Distance (m, rad, m/s, rad/s) that counts as agreement where nothing else is said.
pub const ALLOWED: f64 = 1e-4;

/// What a solver found, and what an accurate integration makes of its motion.
#[derive(Debug, Clone, PartialEq)]
pub struct VerifiedReport<V = Verification, E = VerificationError> {
    /// Of the solver; its status says nothing about the discretisation.
    pub report: Report,
    /// Of the motion of the best iterate, or why that cannot be integrated.
    pub verification: Result<V, E>,
}

/// What integrations say of a motion.
pub trait Holds {
    /// Whether the motion holds, to what counts as agreement where nothing else is said.
    fn holds(&self) -> bool;
}

impl<V: Holds, E> VerifiedReport<V, E> {
    /// Whether the program is solved, and its motion holds.
    pub fn is_success(&self) -> bool {
        self.report.status.is_converged() && self.verification.as_ref().is_ok_and(V::holds)
    }
}

/// Why a motion could not be re-integrated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VerificationError {
    /// The arguments.
    #[error(transparent)]
    Problem(#[from] OcpError),
    /// The motion itself has no value.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// The accurate integration.
    #[error(transparent)]
    Integration(#[from] IntegrateError),
    /// The model.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// It was not to continue.
    #[error("the integration was interrupted")]
    Interrupted,
}

/// How far a motion is from one integrated accurately. Distances are the largest entry of the displacement of the positions
/// (m, rad) and of the difference of the velocities (m/s, rad/s).
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// For each step from a node to the next one the distance at its end, phase by phase; before the second phase and each
    /// later one, the distance between its start and the end of the phase before it.
    pub defects: Vec<f64>,
    /// The distance at the end of one integration from start to end.
    pub terminal_error: f64,
    /// Largest change of the angular momentum about the centre of mass over the nodes, kg m²/s; meant for flight.
    pub momentum_drift: f64,
}

impl Holds for Verification {
    /// [Confirmed](Verification::is_confirmed) to [`ALLOWED`].
    fn holds(&self) -> bool {
        self.is_confirmed(ALLOWED)
    }
}

impl Verification {
    /// The largest defect.
    pub fn largest_defect(&self) -> f64 {
        self.defects.iter().fold(0.0, |largest, d| d.max(largest))
    }

    /// Whether the defects add up to at most `allowed`.
    pub fn is_confirmed(&self, allowed: f64) -> bool {
        self.defects.iter().sum::<f64>() <= allowed
    }

    /// One sentence: whether the motion is confirmed, given the distance that its use allows and, if known, its cost as found
    /// and after accurate integration.
    pub fn sentence(&self, allowed: f64, costs: Option<(f64, f64)>) -> String {
        let cost = costs.map_or_else(String::new, |(found, accurate)| {
            format!(" Integrated accurately it costs {accurate:.6} instead of {found:.6}.")
        });
        let (defect, end) = (self.largest_defect(), self.terminal_error);
        if !self.is_confirmed(allowed) {
            format!(
                "The optimum exploits its discretisation: on re-integration it has defects up to {defect:.1e} and ends {end:.1e} away.{cost}"
            )
        } else if end <= allowed {
            format!(
                "The motion holds when re-integrated: defects ≤ {defect:.1e}, error at the end {end:.1e}.{cost}"
            )
        } else {
            format!(
                "The motion holds from node to node, with defects ≤ {defect:.1e}, and is sensitive: one integration from start to end is {end:.1e} away.{cost}"
            )
        }
    }
}

/// Integrates the motion of `z` again as a motion of `model`, the tree of the dynamics of the shooting.
pub fn verify<D: HybridDynamics>(
    shooting: &mut Shooting<D>,
    model: &Model,
    z: &[f64],
) -> Result<Verification, VerificationError> {
    verify_cancellable(shooting, model, z, &CancellationToken::new())
}

/// The same until it is cancelled, which is looked for at each step of the integration; then
/// [`VerificationError::Interrupted`].
pub fn verify_cancellable<D: HybridDynamics>(
    shooting: &mut Shooting<D>,
    model: &Model,
    z: &[f64],
    token: &CancellationToken,
) -> Result<Verification, VerificationError> {
    expect_length("z", z.len(), shooting.outline().n_variables()).map_err(OcpError::from)?;
    let dofs = shooting.dynamics().dofs().clone();
    expect_length("model", model.n_velocities(), dofs.n_velocities()).map_err(OcpError::from)?;
    expect_length("model", model.n_positions(), dofs.n_positions).map_err(OcpError::from)?;
    shooting.rollout(z)?;
    let phases = shooting.outline().phases.clone();
    let mut defects = Vec::new();
    let first = shooting.node(0);
    let mut through = (first.position.to_vec(), first.velocity.to_vec());
    for (i, nodes) in phases.iter().enumerate() {
        let leg = Leg::new(shooting, model, i, z);
        if i > 0 {
            let (before, after) = (shooting.node(phases[i - 1].end - 1), shooting.node(nodes.start));
            let end = (before.position.to_vec(), before.velocity.to_vec());
            defects.push(distance(model, &end, after.position, after.velocity)?);
        }
        for k in nodes.start..nodes.end - 1 {
            let (from, to) = (shooting.node(k), shooting.node(k + 1));
            let end = leg.integrate(from.position, from.velocity, [from.time, to.time], MAX_STEPS, token)?;
            defects.push(distance(model, &end, to.position, to.velocity)?);
        }
        let (start, end) = (shooting.node(nodes.start).time, shooting.node(nodes.end - 1).time);
        let max_steps = MAX_STEPS * nodes.len();
        through = leg.integrate(&through.0, &through.1, [start, end], max_steps, token)?;
    }
    let last = shooting.node(shooting.outline().n_nodes() - 1);
    let terminal_error = distance(model, &through, last.position, last.velocity)?;
    Ok(Verification { defects, terminal_error, momentum_drift: drift(shooting, model)? })
}

impl MotionProblem<Shooting<Tree>> {
    /// Integrates the motion of `z` again.
    pub fn verify(&mut self, z: &[f64]) -> Result<Verification, VerificationError> {
        let model = self.transcription().dynamics().model().clone();
        verify(self.transcription_mut(), &model, z)
    }

    /// Solves, and integrates the motion of the best iterate again.
    pub fn solve_verified(
        &mut self,
        solver: &dyn NlpSolver,
        start: &Start,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<VerifiedReport, SolverError> {
        let report = solver.solve(self, start, on_iteration)?;
        let verification = self.verify(&report.z);
        Ok(VerifiedReport { report, verification })
    }
}

/// One phase, to be integrated.
struct Leg<'a> {
    model: &'a Model,
    split: Split,
    drive: Drive,
    motion: somersault_multibody::joint_motion::SplineMotion,
    coefficients: Vec<f64>,
    driven: Vec<usize>,
    start: f64,
    duration: f64,
}

impl<'a> Leg<'a> {
    fn new<D: HybridDynamics>(shooting: &Shooting<D>, model: &'a Model, phase: usize, z: &[f64]) -> Self {
        let motion = shooting.motion(phase).clone();
        let mut coefficients = vec![0.0; motion.n_coefficients()];
        motion.coefficients_into(&z[shooting.layout().parameters[phase].clone()], &mut coefficients);
        Self {
            model,
            split: Split::new(shooting.dynamics().dofs().active.clone()),
            drive: shooting.drive().clone(),
            driven: shooting.driven_dofs().collect(),
            start: shooting.node(shooting.outline().phases[phase].start).time,
            duration: shooting.durations()[phase],
            motion,
            coefficients,
        }
    }

    /// Writes what drives the joints at time `t`: accelerations, or forces.
    fn drive(&self, t: f64, out: &mut [f64]) {
        let fraction = (t - self.start) / self.duration;
        let mut channels = vec![0.0; self.motion.n_channels()];
        let mut joints = vec![0.0; self.driven.len()];
        if self.drive == Drive::Motion {
            self.motion.channels_into(&self.coefficients, fraction, 2, &mut channels);
            self.motion.base().rates_into(&channels, &mut joints);
            joints.iter_mut().for_each(|a| *a /= self.duration * self.duration);
        } else {
            self.motion.channels_into(&self.coefficients, fraction, 0, &mut channels);
            self.motion.base().positions_into(&channels, &mut joints);
        }
        self.driven.iter().zip(joints).for_each(|(dof, x)| out[*dof] = x);
    }

    fn integrate(
        &self,
        q: &[f64],
        v: &[f64],
        [from, to]: [f64; 2],
        max_steps: usize,
        mut token: &CancellationToken,
    ) -> Result<(Vec<f64>, Vec<f64>), VerificationError> {
        let state = self.model.state(q, v)?;
        let control = Adaptive {
            tolerances: Tolerances { relative: TOLERANCE, absolute: TOLERANCE },
            max_steps,
            ..Adaptive::default()
        };
        let write = |t: f64, _: &[f64], _: &[f64], out: &mut [f64]| self.drive(t, out);
        let steps = Steps::adapted((from, to), control);
        let stepper = RungeKuttaMuntheKaas(Dop853);
        let end = if self.drive == Drive::Motion {
            let system = TreeSystem::new(self.model, ()).driven(self.split.clone(), write)?;
            Run::by_embedded_stepper(&system, &stepper, steps).observed_by(&mut token).from(&state)?
        } else {
            let system = TreeSystem::new(self.model, write);
            Run::by_embedded_stepper(&system, &stepper, steps).observed_by(&mut token).from(&state)?
        };
        if token.is_cancelled() {
            return Err(VerificationError::Interrupted);
        }
        let mut velocity = vec![0.0; v.len()];
        self.model.joint_velocities(&end.state, &mut velocity)?;
        Ok((end.state.configuration.as_slice().to_vec(), velocity))
    }
}

fn distance(model: &Model, end: &(Vec<f64>, Vec<f64>), q: &[f64], v: &[f64]) -> Result<f64, DynamicsError> {
    let mut apart = vec![0.0; v.len()];
    model.difference(&end.0, q, &mut apart)?;
    let velocities = end.1.iter().zip(v).map(|(a, b)| (a - b).abs());
    Ok(apart.iter().map(|d| d.abs()).chain(velocities).fold(0.0, f64::max))
}

fn drift<D: HybridDynamics>(shooting: &Shooting<D>, model: &Model) -> Result<f64, DynamicsError> {
    let nodes = (0..shooting.outline().n_nodes()).map(|k| shooting.node(k));
    momentum_drift(model, nodes.map(|node| (node.position, node.velocity)))
}

/// Largest change of the angular momentum about the centre of mass over states (q, v) since the first of them, kg m²/s.
pub fn momentum_drift<'a>(
    model: &Model,
    states: impl IntoIterator<Item = (&'a [f64], &'a [f64])>,
) -> Result<f64, DynamicsError> {
    let mut data = Data::new(model);
    let (mut first, mut largest) = (None, 0.0_f64);
    for (q, v) in states {
        let momentum = model.centroidal(&mut data, q)?.momentum(v)?.angular;
        largest = largest.max((momentum - *first.get_or_insert(momentum)).norm());
    }
    Ok(largest)
}
