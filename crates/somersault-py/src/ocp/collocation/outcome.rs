//! What a search found as a whole, of one phase or several.

use crate::core::error::Error;
use crate::core::value::value;
use crate::ocp::solver::{Report, status_name};
use crate::ocp::verification::{Verification, Verifier};
use pyo3::prelude::*;
use somersault::multibody;
use somersault::nlp::Status;
use somersault::ocp::collocation::{CollocationReport, CollocationStatus};
use somersault::ocp::verification::{self, momentum_drift};
use std::sync::Arc;

/// States with quaternions of unit norm, which they have to the tolerance.
pub(super) fn unit_rows(model: Option<&multibody::Model>, rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut rows = rows.to_vec();
    if let Some(model) = model {
        for row in &mut rows {
            // one of norm zero stays what it is
            let _ = model.normalize(&mut row[..model.n_positions()]);
        }
    }
    rows
}

/// How messages introduce a derivative that is wrong.
const LIKELY: &str = "A likely reason: ";

/// Result of collocation, of one phase or several.
#[pyclass(frozen, subclass, module = "somersault.ocp")]
pub(crate) struct CollocationOutcome {
    pub(super) report: Arc<CollocationReport>,
    pub(super) tol: f64,
    verifier: Arc<Verifier>,
}

impl CollocationOutcome {
    /// One tree for each phase that is one of a tree.
    pub(super) fn of(
        report: Arc<CollocationReport>,
        models: Vec<Option<multibody::Model>>,
        tol: f64,
    ) -> Self {
        let judged = report.clone();
        let verifier = Verifier::new(move |py| {
            let confirmation = &judged.confirmation;
            let mut drift: f64 = 0.0;
            for (model, phase) in models.iter().zip(&judged.phases) {
                let Some(model) = model else { continue };
                // integrals may follow
                let (n, m) = (model.n_positions(), model.n_velocities());
                let rows = unit_rows(Some(model), &phase.states);
                let states = rows.iter().map(|x| x[..n + m].split_at(n));
                drift = drift.max(momentum_drift(model, states)?);
            }
            let found = verification::Verification {
                defects: confirmation.phases.iter().flat_map(|phase| phase.defects.iter().copied()).collect(),
                terminal_error: confirmation.end_to_end_error(),
                momentum_drift: drift,
            };
            let (confirmed, message) = (confirmation.is_confirmed(tol), confirmation.sentence(tol));
            Ok(Py::new(py, Verification::judged(found, tol, confirmed, message))?.into_any())
        });
        Self { report, tol, verifier: Arc::new(verifier) }
    }

    /// What stands for it in the texts of its subclasses.
    pub(super) fn summary(&self) -> String {
        let (cost, meshes) = (self.report.cost, self.report.history.len());
        let (status, defect) = (self.status(), self.max_defect());
        let confirmed = if self.confirmed() { "confirmed" } else { "NOT confirmed by integration" };
        format!("{status}, {confirmed}, cost {cost:.8}, {meshes} meshes, largest defect {defect:.1e}")
    }
}

value! {
    impl CollocationOutcome {
        /// bool: Whether the status is ``'converged'``.
        success: bool = |own| own.report.status == CollocationStatus::Converged;
        /// bool: Whether each interval, re-integrated, ends within the tolerance of where it should.
        confirmed: bool = |own| own.report.confirmation.is_confirmed(own.tol);
        /// Verification: The motion re-integrated, interval by interval, phase after phase.
        verification: Result<Py<PyAny>, Error> = |own, py| own.verifier.get(py);
        /// float: Cost as the program sees it; that of an accurate integration is `verified_cost`. Of one of several phases, and of
        /// splines, both are accurate.
        cost: f64 = |own| own.report.cost;
        /// float: Cost with the running cost integrated accurately along the motion.
        verified_cost: f64 = |own| own.report.confirmation.cost;
        /// float: The largest relative error at the end of an interval of a mesh, integrated accurately from its start.
        max_defect: f64 = |own| own.report.confirmation.max_defect();
        /// float: Largest violation of a bound or path constraint, between the points and at the ends too.
        violation: f64 = |own| own.report.confirmation.max_violation();
        /// float: Estimated error of the cost, relative to one and the cost, from the residuals of states, costates and controls and
        /// from bounds exceeded between the points.
        cost_error: f64 = |own| own.report.accuracy().cost;
        /// Report: Of the last program.
        report: Report =
            |own| Report { report: own.report.program.clone(), verifier: Some(own.verifier.clone()), wrong_derivative: None };
    }
}

#[pymethods]
impl CollocationOutcome {
    /// str: ``'converged'``; ``'false_convergence'`` where the solution of the program is not a motion;
    /// ``'mesh_limit'`` where the last mesh does not meet the tolerance; ``'no_minimum'`` where the cost still falls along a free
    /// time; else how the last program ended, as for `Report`.
    #[getter]
    pub(super) fn status(&self) -> &'static str {
        match self.report.status {
            CollocationStatus::Converged => "converged",
            CollocationStatus::FalseConvergence => "false_convergence",
            CollocationStatus::MeshLimit => "mesh_limit",
            CollocationStatus::NoMinimum => "no_minimum",
            CollocationStatus::NotSolved(status) => status_name(status),
            // statuses to come end a search as well
            _ => "failed",
        }
    }

    /// str: The status in a sentence, and others where derivatives are differences, and where bounds or path constraints are exceeded by
    /// more than the tolerance between the collocation points or at an end, where they are not required: what, by how much and when. Where
    /// the program was not solved, the derivative that differences contradict along the motion, if there is one.
    #[getter]
    pub(super) fn message(&self) -> String {
        let defect = self.max_defect();
        let origin = Some(&self.report.origin).filter(|origin| !origin.is_empty()).cloned();
        let said = match self.report.status {
            CollocationStatus::Converged => {
                format!("converged and confirmed: on re-integration the largest defect is {defect:.1e}")
            }
            CollocationStatus::FalseConvergence => format!(
                "false convergence: the program was solved, but on re-integration its motion leaves its own nodes by \
                 {defect:.1e}"
            ),
            CollocationStatus::NotSolved(status) if self.report.program.status.is_converged() => {
                return match status {
                    Status::Interrupted => "interrupted before its motion was confirmed".to_owned(),
                    status => format!("{} before the search had ended", status.message()),
                } + "; its program was solved";
            }
            CollocationStatus::NotSolved(status) => {
                let said = format!("the program of the last mesh was not solved: {}", status.message());
                let wrong = self.report.wrong_derivative.as_ref();
                let said = wrong.map_or(said.clone(), |wrong| format!("{said}. {LIKELY}{wrong}"));
                return origin.map_or(said.clone(), |origin| format!("{said}. {origin}"));
            }
            CollocationStatus::NoMinimum => {
                "no minimum: the cost still falls along a free time, which runs away; bound the duration \
                                             from above, or let it cost"
                    .to_owned()
            }
            CollocationStatus::MeshLimit => format!(
                "the last mesh allowed does not meet the tolerance: {}",
                self.report.accuracy().shortfall(self.tol).unwrap_or_default()
            ),
            // statuses to come end a search as well
            _ => "failed".to_owned(),
        };
        let error = self.report.relative_errors.derivatives;
        let differenced = (error > 0.0).then(|| {
            format!("Some derivatives are differences, with relative errors of about {error:.0e}, and costates are no more accurate.")
        });
        let violation = self.report.confirmation.violation_sentence(self.tol);
        let wrong = self.report.wrong_derivative.as_ref().map(|wrong| format!("{LIKELY}{wrong}"));
        let more: Vec<String> = wrong.into_iter().chain(differenced).chain(violation).chain(origin).collect();
        if more.is_empty() { said } else { format!("{said}. {}", more.join(" ")) }
    }
}
