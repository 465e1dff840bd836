//! The search for a dive: soft first, then hard; coarse first, then fine.
//!
//! From a template the entry is far off, and twists respond to the arms so strongly that linearised constraints mean
//! little there. So entry and clearances begin as costs ½ μ Σ violation², the thesis' soft constraints, whose
//! Gauss–Newton steps are convex and whose only constraints are linear; μ grows from stage to stage. Then they are
//! constraints, with the multipliers μ · violation to begin with. All this with few steps of the orientation; the last
//! stage has those of the dive, begins so near that it takes but a few iterations, and has the Hessians of the few steps.
//! Where the stage before it ends without a solution, it only tells the residuals of what there is.
//!
//! Clearances are constraints at single times. Where the limbs of a solution come nearer in between, the time at which they
//! are nearest is added and the stage continues from there, until they keep apart at all times.

use crate::modelled::Modelled;
use crate::{Dive, DiveError, DiveJudgementError, DiveProgram, DiveReport, KeyFrame, Penalties};
use rayon::prelude::*;
use somersault_nlp::{
    Flow, Globalisation, HessianSource, Iteration, Nlp, NlpSolver, Report, SolverError, Sqp, Start, Status,
    Structure,
};
use somersault_ocp::verification::VerifiedReport;
use std::cell::Cell;

/// Times at which a search asks for a clearance beside those of the dive, at most.
const MOST_ADDED: usize = 60;

/// How a dive is searched for.
#[derive(Debug, Clone, PartialEq)]
pub struct DiveSearch {
    /// μ of the soft stages; none for dives that need none.
    pub soft_weights: Vec<f64>,
    /// Solver of the soft stages.
    pub soft: Sqp,
    /// Solver of the stages with constraints.
    pub hard: Sqp,
    /// Steps of the orientation in all stages but the last; none where there is nothing to save.
    pub coarse_steps: Option<usize>,
}

/// Why a search did not even begin, or was stopped early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DiveSearchError {
    /// The dive or a start.
    #[error(transparent)]
    Dive(#[from] DiveError),
    /// The solver.
    #[error(transparent)]
    Solver(#[from] SolverError),
}

impl DiveSearch {
    /// For dives in the plane: no soft stages, and quasi-Newton steps that begin with the Hessian of the cost. Three to
    /// twelve steps are enough with weights, for any number of coefficients, and some twenty with joints. With a posture that
    /// the optimum leaves out Newton's may stall short of the tolerance.
    pub fn direct() -> Self {
        let hard = Sqp { hessian: HessianSource::QuasiNewton, stationarity_tol: 1e-6, ..Sqp::default() };
        Self { soft_weights: Vec::new(), soft: Sqp::default(), hard, coarse_steps: None }
    }

    /// For dives in space: four soft stages, and 280 steps until the last. The stages with constraints accept
    /// steps by a filter, for a merit function shortens them along the curved constraints of the entry; but none that leaves
    /// the dive that the soft stages have found.
    pub fn staged() -> Self {
        let soft = Sqp { stationarity_tol: 1e-3, max_iterations: 20, ..Sqp::default() };
        let hard = Sqp {
            stationarity_tol: 1e-6,
            globalisation: Globalisation::Filter,
            violation_limit: 0.03,
            max_iterations: 100,
            ..Sqp::default()
        };
        Self { soft_weights: vec![1.0, 10.0, 100.0, 1000.0], soft, hard, coarse_steps: Some(280) }
    }

    /// Searches from `z`. The status is that of the program; whether the motion is the dive requested says
    /// [`solve_verified`](Self::solve_verified). Multipliers are those of the constraints of `program`, then of the clearances
    /// that the search added. `on_iteration` sees all stages and may end the search: of the stages that are left then the last
    /// alone begins, to give what was found its residuals.
    pub fn solve(
        &self,
        program: &DiveProgram,
        z: Vec<f64>,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Report, DiveSearchError> {
        let has_ended = Cell::new(false);
        let mut watch = |iteration: &Iteration<'_>| {
            has_ended.set(has_ended.get() || on_iteration(iteration) == Flow::Stop);
            if has_ended.get() { Flow::Stop } else { Flow::Continue }
        };
        let steps = self.coarse_steps.filter(|steps| *steps < program.dive().n_steps);
        let coarse = steps.map(|n_steps| Dive { n_steps, ..program.dive().clone() }.program()).transpose()?;
        let mut start = Start::from(z);
        for weight in self.soft_weights.iter().take_while(|_| !has_ended.get()) {
            let mut stage = coarse.as_ref().unwrap_or(program).softened(*weight)?;
            let report = self.soft.solve(&mut stage, &start, &mut watch)?;
            start = following(&mut stage, report);
        }
        let mut program = program.clone();
        let Some(mut model) = coarse else {
            let mut report = self.constrained(&mut program, start, &mut watch)?;
            while let Some(start) = self.with_breaches(&mut [&mut program], &report)? {
                report = self.constrained(&mut program, start, &mut watch)?;
            }
            return Ok(report);
        };
        let mut solver = self.hard.clone();
        let mut given_up = None;
        if !has_ended.get() {
            let mut found = self.constrained(&mut model, start, &mut watch)?;
            while let Some(start) = self.with_breaches(&mut [&mut model, &mut program], &found)? {
                found = self.constrained(&mut model, start, &mut watch)?;
            }
            start = Start {
                z: found.z,
                constraint_multipliers: found.constraint_multipliers,
                ..Start::default()
            };
            if !matches!(found.status, Status::Converged | Status::Stalled) {
                solver.max_iterations = 0;
                given_up = Some(found.status);
            }
        }
        let start = self.prepared(&mut program, start);
        let modelled = &mut Modelled { program: &mut program, model: &mut model };
        let mut report = solver.solve(modelled, &start, &mut watch)?;
        while let Some(start) = self.with_breaches(&mut [&mut model, &mut program], &report)? {
            let start = self.prepared(&mut program, start);
            let modelled = &mut Modelled { program: &mut program, model: &mut model };
            report = solver.solve(modelled, &start, &mut watch)?;
        }
        if let (Some(status), Status::IterationLimit) = (given_up, report.status) {
            report.status = status;
        }
        Ok(report)
    }

    /// Where limbs of a solution come too near to each other between the times at which the clearance is a constraint of these
    /// programs of one structure, makes it one there too, and returns where to continue. None where there is nothing to add, or
    /// more than [`MOST_ADDED`] times would be.
    fn with_breaches(
        &self,
        programs: &mut [&mut DiveProgram],
        found: &Report,
    ) -> Result<Option<Start>, DiveError> {
        let Some(first) = programs.first().filter(|_| found.status.is_converged()) else { return Ok(None) };
        let breaches = first.breaches(&found.z)?;
        if breaches.is_empty() || first.added().len() + breaches.len() > MOST_ADDED {
            return Ok(None);
        }
        for program in programs.iter_mut() {
            **program = program.with_clearance_at(&breaches)?;
        }
        let mut start =
            Start { constraint_multipliers: found.constraint_multipliers.clone(), ..found.z.clone().into() };
        // rows of the times that are added come last
        let n_rows = programs.first().map_or(0, |program| program.structure().constraints.len());
        start.constraint_multipliers.resize(n_rows, 0.0);
        Ok(Some(start))
    }

    /// A stage with constraints.
    fn constrained(
        &self,
        stage: &mut DiveProgram,
        start: Start,
        watch: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Report, DiveSearchError> {
        let start = self.prepared(stage, start);
        Ok(self.hard.solve(stage, &start, watch)?)
    }

    /// The start with the matrix that quasi-Newton steps begin with.
    fn prepared(&self, stage: &mut DiveProgram, start: Start) -> Start {
        match self.hard.hessian {
            HessianSource::QuasiNewton => Start { hessian: curvature_of_cost(stage, &start.z), ..start },
            HessianSource::Offered => start,
        }
    }

    /// Searches from `z`, and judges what was found.
    pub fn solve_verified(
        &self,
        program: &DiveProgram,
        z: Vec<f64>,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<VerifiedReport<DiveReport, DiveJudgementError>, DiveSearchError> {
        let report = self.solve(program, z, on_iteration)?;
        let verification = program.report(&report.z);
        Ok(VerifiedReport { report, verification })
    }

    /// Searches from several templates, in parallel; one report for each.
    pub fn solve_all(
        &self,
        program: &DiveProgram,
        templates: &[Vec<KeyFrame>],
    ) -> Vec<Result<Report, DiveSearchError>> {
        let solve = |template: &Vec<KeyFrame>| {
            let z = program.start(template)?;
            self.solve(program, z, &mut |_| Flow::Continue)
        };
        templates.par_iter().with_max_len(1).map(solve).collect()
    }
}

/// Where quasi-Newton steps begin: the Hessian of the cost, none where it has no value or no curvature in the channels. From the
/// unit matrix they would have to learn ∫ ẇ² dt, whose condition grows with the square of the coefficients.
fn curvature_of_cost(program: &mut DiveProgram, z: &[f64]) -> Option<Vec<f64>> {
    let Penalties { rate, acceleration, .. } = program.dive().penalties;
    let Structure { variables, constraints, jacobian, hessian } = program.structure();
    // a start of another length is refused by the solver
    if (rate == 0.0 && acceleration == 0.0) || z.len() != variables.len() {
        return None;
    }
    let mut hessian = vec![0.0; hessian.n_entries()];
    let (mut gradient, mut jacobian) = (vec![0.0; z.len()], vec![0.0; jacobian.n_entries()]);
    let (mut values, none) = (vec![0.0; constraints.len()], vec![0.0; constraints.len()]);
    program.evaluate(z, &mut values).ok()?;
    program.differentiate(z, &mut gradient, &mut jacobian).ok()?;
    program.hessian(z, 1.0, &none, &mut hessian).ok()?;
    Some(hessian)
}

/// The start of the stage after a soft one.
fn following(stage: &mut DiveProgram, report: Report) -> Start {
    let Report { z, mut constraint_multipliers, .. } = report;
    let mut values = vec![0.0; constraint_multipliers.len()];
    if stage.evaluate(&z, &mut values).is_err() {
        return Start::from(z);
    }
    for (y, soft) in constraint_multipliers.iter_mut().zip(stage.soft_multipliers()) {
        *y += soft;
    }
    Start { z, constraint_multipliers, ..Start::default() }
}
