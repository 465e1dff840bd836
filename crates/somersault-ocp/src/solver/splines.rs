//! The motion of lowest cost among splines.

use super::spline_program::{Program, STEPS, SplineProgram};
use crate::NoSplines;
use crate::collocation::{CollocationError, Guess, Limited, Mesh, PhaseRows, PhaseSolution, Problem, Radau};
use crate::dynamics::HybridDynamics;
use crate::shooting::Drive;
use crate::transcription::Transcription;
use somersault_core::cancel::CancellationToken;
use somersault_nlp::{Flow, Globalisation, Iteration, NlpSolver, Report, SolverError, Sqp, Start};
use std::error::Error;
use std::time::{Duration, Instant};

/// Stationarity, and steps, at which a program for a start ends, and how often its splines are halved.
const ROUGH: f64 = 1e-4;
const FEW: usize = 60;
const HALVINGS_OF_A_START: usize = 4;

/// Shooting with splines, as a method to solve an optimal control problem.
///
/// Joints of a tree move by splines, what they exert follows by inverse dynamics, and joints without forces by hybrid dynamics: there
/// are no defects, and the cost is integrated at more points than the splines have coefficients, so that a minimum is a
/// motion. Of other equations the controls are splines, and multiple shooting integrates the states.
#[derive(Debug, Clone)]
pub struct Splines {
    /// Intervals of the first splines, which are quintic.
    pub n_intervals: usize,
    /// Times that these are halved at most, each program starting from the motion of the one before it.
    pub max_halvings: usize,
    /// Whether the Hessian has the curvature of the motion where joints alone move. Without it the Hessian is that of Gauss and Newton:
    /// fewer steps far from a minimum, and more next to one.
    pub exact_hessian: bool,
    /// What solves the programs.
    pub solver: Sqp,
}

impl Default for Splines {
    fn default() -> Self {
        let solver = Sqp { globalisation: Globalisation::Filter, stationarity_tol: 1e-6, ..Sqp::default() };
        Self { n_intervals: 4, max_halvings: 5, exact_hessian: true, solver }
    }
}

impl Splines {
    /// The same for motions that others start from, whose programs need not be solved to the end.
    pub(super) fn for_a_start(&self) -> Self {
        let solver = Sqp {
            stationarity_tol: ROUGH.max(self.solver.stationarity_tol),
            max_iterations: FEW.min(self.solver.max_iterations),
            ..self.solver.clone()
        };
        let max_halvings = self.max_halvings.min(HALVINGS_OF_A_START);
        Self { max_halvings, exact_hessian: false, solver, ..self.clone() }
    }
}

/// A motion of splines.
pub(super) struct SplineMotionReport {
    /// Of the solver.
    pub(super) program: Report,
    /// The motion on the mesh of the intervals of the splines. It has no costates: they are NaN.
    pub(super) solution: PhaseSolution,
    /// Whether joints move by splines, and not controls.
    pub(super) of_joints: bool,
    /// What it took.
    pub(super) time: Duration,
    /// What a function of the user failed with.
    pub(super) failure: Option<Box<dyn Error + Send + Sync>>,
}

impl Splines {
    /// Solves with one number of intervals, from the guess of the phase or from another one; `points` are those of each interval of the mesh of the motion.
    pub(super) fn solve(
        &self,
        problem: &Problem,
        n_intervals: usize,
        guess: Option<&Guess>,
        points: usize,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        token: &CancellationToken,
        left: &mut Option<usize>,
    ) -> Result<SplineMotionReport, CollocationError> {
        match SplineProgram::try_new(problem, n_intervals, self.exact_hessian)? {
            SplineProgram::Joints(program) => {
                self.solve_program(*program, problem, guess, points, on_iteration, token, left)
            }
            SplineProgram::Controls(program) => {
                self.solve_program(*program, problem, guess, points, on_iteration, token, left)
            }
        }
    }

    fn solve_program<D: HybridDynamics>(
        &self,
        posed: Program<D>,
        problem: &Problem,
        guess: Option<&Guess>,
        points: usize,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
        token: &CancellationToken,
        left: &mut Option<usize>,
    ) -> Result<SplineMotionReport, CollocationError> {
        let began = Instant::now();
        let phase = &problem.phases[0];
        let own = phase.start().ok_or_else(|| NoSplines::Undefined { what: "the guess".to_owned() })?;
        let start = Start::from(posed.start(guess.unwrap_or(own), phase)?);
        let Program { mut program, mapping } = posed;
        let solved = self.solver.solve(&mut Limited { nlp: &mut program, left, token }, &start, on_iteration);
        let (report, failure) = match solved {
            Ok(report) => (report, None),
            Err(SolverError::Failed { source, report }) => (*report, Some(source)),
            Err(error) => return Err(error.into()),
        };
        let of_joints = matches!(program.transcription().drive(), Drive::Motion);
        let shooting = program.transcription_mut();
        if failure.is_none() {
            shooting.rollout(&report.z)?;
        }
        let sample = |node: usize| {
            let node = shooting.node(node);
            let value = |number: &crate::term::NodeNumber| number.value(&node);
            let states = mapping.states.iter().map(value).collect();
            let controls = mapping.controls.iter().map(value).collect();
            (states, controls)
        };
        let n_nodes = shooting.outline().n_nodes();
        let samples: Vec<Sample> = (0..n_nodes).map(sample).collect();
        let parameters = mapping.parameters.iter();
        let parameters = parameters.map(|source| source.value(&shooting.node(0))).collect();
        let horizon = (mapping.start, mapping.start + shooting.durations()[0]);
        let n_path = phase.bounds.path.len();
        let solution = on_mesh(&samples, (n_nodes - 1) / STEPS, points, horizon, n_path, parameters)?;
        Ok(SplineMotionReport { program: report, solution, of_joints, time: began.elapsed(), failure })
    }
}

/// States and controls of a node.
type Sample = (Vec<f64>, Vec<f64>);

/// The motion on a mesh of the intervals of the splines, by the polynomial through all nodes of each: that of joints is exact.
fn on_mesh(
    samples: &[Sample],
    n_intervals: usize,
    points: usize,
    horizon: (f64, f64),
    n_path: usize,
    parameters: Vec<f64>,
) -> Result<PhaseSolution, CollocationError> {
    let mesh = Mesh::try_uniform(n_intervals, points)?;
    let radau = Radau::try_new(points)?;
    let bases: Vec<[f64; STEPS + 1]> =
        radau.points().iter().map(|tau| through_nodes(0.5 * (tau + 1.0) * STEPS as f64)).collect();
    let (mut states, mut controls) = (Vec::new(), Vec::new());
    let combined = |first: usize, basis: &[f64], of: fn(&Sample) -> &Vec<f64>| {
        let mut row = vec![0.0; of(&samples[first]).len()];
        for (sample, factor) in samples[first..].iter().zip(basis) {
            row.iter_mut().zip(of(sample)).for_each(|(x, s)| *x += factor * s);
        }
        row
    };
    for k in 0..n_intervals {
        for basis in &bases {
            states.push(combined(k * STEPS, basis, |sample| &sample.0));
            controls.push(combined(k * STEPS, basis, |sample| &sample.1));
        }
    }
    states.extend(samples.last().map(|(state, _)| state.clone()));
    let (n, n_states) = (controls.len(), states[0].len());
    let rows = PhaseRows {
        costates: vec![vec![f64::NAN; n_states]; n + 1],
        path_multipliers: vec![vec![f64::NAN; n_path]; n],
        hamiltonian: vec![f64::NAN; n],
        states,
        controls,
        parameters,
    };
    PhaseSolution::try_new(mesh, horizon, rows)
}

/// Lagrange's polynomials through the nodes 0, 1, …, at `s`.
fn through_nodes(s: f64) -> [f64; STEPS + 1] {
    std::array::from_fn(|i| {
        let others = (0..=STEPS).filter(|j| *j != i);
        others.map(|j| (s - j as f64) / (i as f64 - j as f64)).product()
    })
}
