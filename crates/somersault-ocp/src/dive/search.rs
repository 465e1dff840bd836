//! The search for a dive: soft first, then hard.
//!
//! From a template the entry is far off, and twists respond to the arms so strongly that linearised constraints mean
//! little there. So entry and clearances begin as costs ½ μ Σ violation², the thesis' soft constraints, whose
//! Gauss–Newton steps are convex and whose only constraints are linear; μ grows from stage to stage. The last
//! stage has them as constraints. It starts from the last soft Hessian, which is that of an augmented Lagrangian,
//! and from the multipliers μ · violation.

use super::{DiveError, DiveProgram, KeyFrame};
use crate::nlp::Nlp;
use crate::solver::{Flow, HessianSource, Iteration, NlpSolver, Report, SolverError, Sqp, Start};
use rayon::prelude::*;

/// How a dive is searched for.
#[derive(Debug, Clone, PartialEq)]
pub struct DiveSearch {
    /// μ of the soft stages; none for dives that need none.
    pub soft_weights: Vec<f64>,
    /// Solver of the soft stages.
    pub soft: Sqp,
    /// Solver of the last stage.
    pub hard: Sqp,
}

/// Why a search did not even begin, or was broken off.
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
    /// For dives in the plane: no soft stages.
    pub fn direct() -> Self {
        let hard = Sqp { stationarity_tol: 1e-6, ..Sqp::default() };
        Self { soft_weights: Vec::new(), soft: Sqp::default(), hard }
    }

    /// For dives in space: four soft stages.
    pub fn staged() -> Self {
        let soft = Sqp { stationarity_tol: 1e-3, max_iterations: 40, ..Sqp::default() };
        let hard = Sqp { stationarity_tol: 1e-6, max_iterations: 200, ..Sqp::default() };
        Self { soft_weights: vec![1.0, 10.0, 100.0, 1000.0], soft, hard }
    }

    /// Searches from `z`. `on_iteration` sees all stages and may end the search.
    pub fn solve(
        &self,
        program: &DiveProgram,
        z: Vec<f64>,
        on_iteration: &mut dyn FnMut(&Iteration<'_>) -> Flow,
    ) -> Result<Report, DiveSearchError> {
        let mut start = Start::from(z);
        for weight in &self.soft_weights {
            let mut stage = program.softened(*weight)?;
            let report = self.soft.solve(&mut stage, &start, on_iteration)?;
            start = following(&mut stage, report)?;
        }
        Ok(self.hard.solve(&mut program.clone(), &start, on_iteration)?)
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

/// The start of the stage after a soft one.
fn following(stage: &mut DiveProgram, report: Report) -> Result<Start, DiveSearchError> {
    let structure = stage.structure().clone();
    let mut values = vec![0.0; structure.constraints.len()];
    let mut gradient = vec![0.0; report.z.len()];
    let mut jacobian = vec![0.0; structure.jacobian.n_entries()];
    let mut hessian = vec![0.0; structure.hessian.n_entries()];
    let z = report.z;
    let evaluated = stage
        .evaluate(&z, &mut values)
        .and_then(|_| stage.differentiate(&z, &mut gradient, &mut jacobian))
        .and_then(|()| stage.hessian(&z, 1.0, &values, &mut hessian));
    if evaluated.is_err() {
        return Ok(Start::from(z));
    }
    let mut constraint_multipliers = report.constraint_multipliers;
    for (y, soft) in constraint_multipliers.iter_mut().zip(stage.soft_multipliers()) {
        *y += soft;
    }
    Ok(Start { z, constraint_multipliers, hessian: Some(hessian) })
}
