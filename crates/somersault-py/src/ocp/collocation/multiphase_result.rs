//! What a search found of several phases.

use super::result::Subject;
use super::{CollocationOutcome, CollocationResult};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore};
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ocp::collocation::{CollocationReport, Confirmation, MeshRecord};
use std::sync::Arc;

/// Result of collocation of several phases.
#[pyclass(frozen, extends = CollocationOutcome, module = "somersault.ocp")]
pub(crate) struct MultiphaseResult {
    phases: Vec<Py<CollocationResult>>,
}

/// What a report has of one phase.
fn of_phase(report: &CollocationReport, k: usize) -> CollocationReport {
    let confirmed = report.confirmation.phases[k].clone();
    let cost = confirmed.running_cost + confirmed.end_cost;
    let of_mesh =
        |record: &MeshRecord| MeshRecord { meshes: vec![record.meshes[k].clone()], ..record.clone() };
    CollocationReport {
        status: report.status,
        phases: vec![report.phases[k].clone()],
        cost,
        confirmation: Confirmation { phases: vec![confirmed], cost },
        history: report.history.iter().map(of_mesh).collect(),
        program: report.program.clone(),
        wrong_derivative: report.wrong_derivative.clone(),
        relative_errors: report.relative_errors,
        origin: report.origin.clone(),
    }
}

impl MultiphaseResult {
    pub(super) fn of(
        py: Python<'_>,
        subjects: &[Subject],
        report: CollocationReport,
        tol: f64,
    ) -> Result<Py<Self>, Error> {
        let phase = |(k, subject): (usize, &Subject)| {
            Ok(CollocationResult::of(py, of_phase(&report, k), subject.clone(), tol)?)
        };
        let phases = subjects.iter().enumerate().map(phase).collect::<Result<_, Error>>()?;
        Ok(Self::of_phases(py, report, phases, tol)?)
    }

    fn of_phases(
        py: Python<'_>,
        report: CollocationReport,
        phases: Vec<Py<CollocationResult>>,
        tol: f64,
    ) -> PyResult<Py<Self>> {
        let models = phases.iter().map(|phase| phase.get().subject.model.clone()).collect();
        let outcome = CollocationOutcome::of(Arc::new(report), models, tol);
        Py::new(py, PyClassInitializer::from(outcome).add_subclass(Self { phases }))
    }
}

#[pymethods]
impl MultiphaseResult {
    /// list of CollocationResult: What was found of each phase, with times from the start of the whole motion. Its `cost` is
    /// that of an accurate integration; status, meshes and report are those of the whole.
    #[getter]
    fn phases(&self, py: Python<'_>) -> Vec<Py<CollocationResult>> {
        self.phases.iter().map(|phase| phase.clone_ref(py)).collect()
    }

    fn __len__(&self) -> usize {
        self.phases.len()
    }

    fn __repr__(slf: &Bound<'_, Self>) -> String {
        let (n, outcome) = (slf.get().phases.len(), slf.as_super().get());
        format!("<MultiphaseResult: {n} phases, {}>", outcome.summary())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, report) = (slf.py(), &slf.as_super().get().report);
        by_restore(slf, (slf.get().phases(py), report.cost, report.confirmation.cost))
    }

    /// A pickled result.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        phases: Vec<Py<CollocationResult>>,
        cost: f64,
        accurate: f64,
    ) -> Result<Py<Self>, Error> {
        let Some(first) = phases.first().map(|phase| phase.bind(cls.py())) else {
            return Err(Error::input("`phases` must have at least one phase, found none".to_owned()));
        };
        let tol = first.as_super().get().tol;
        let mut report = CollocationReport { cost, ..CollocationReport::clone(&first.get().report) };
        report.confirmation.cost = accurate;
        for phase in &phases[1..] {
            let other = &phase.get().report;
            report.phases.extend(other.phases.iter().cloned());
            report.confirmation.phases.extend(other.confirmation.phases.iter().cloned());
            for (record, other) in report.history.iter_mut().zip(&other.history) {
                record.meshes.extend(other.meshes.iter().cloned());
            }
        }
        Ok(Self::of_phases(cls.py(), report, phases, tol)?)
    }
}
