//! What a motion problem is made of.

use super::{Constraint, Cost, Motion, Phase};
use crate::core::convert::numbers_or_one;
use crate::core::error::Error;
use crate::core::waiting::cancel_on_signal;
use crate::multibody::model::Model;
use crate::ocp::term::sizes_of;
use crate::ocp::verification::{Verification, VerificationFailure, Verifier};
use pyo3::prelude::*;
use somersault::multibody::Split;
use somersault::nlp::{self, Bounds};
use somersault::ocp::dynamics::Tree;
use somersault::ocp::problem::{At, MotionProblem};
use somersault::ocp::shooting::{self, Drive, Shooting, ShootingOptions, Start};
use somersault::ocp::transcription::Transcription;
use somersault::ocp::verification::verify_cancellable;
use std::sync::Arc;

/// The problem of the library.
pub(super) type Program = MotionProblem<Shooting<Tree>>;

/// All that a problem is made of, to make it again: for each start of a search, and from a file.
pub(super) struct Recipe {
    pub(super) model: Py<Model>,
    /// Whether each degree of freedom is driven.
    pub(super) active: Vec<bool>,
    pub(super) drives_motion: bool,
    pub(super) scheme: shooting::Scheme,
    pub(super) start: Start,
    pub(super) phases: Vec<Py<Phase>>,
    pub(super) costs: Vec<Py<Cost>>,
    pub(super) constraints: Vec<Py<Constraint>>,
    pub(super) lower: Option<Py<PyAny>>,
    pub(super) upper: Option<Py<PyAny>>,
    pub(super) exact_hessian: bool,
}

impl Recipe {
    /// The motion without costs and constraints.
    pub(super) fn motion(&self, py: Python<'_>) -> Result<PosedMotion, Error> {
        let model = self.model.get().model.clone();
        let n = self.active.len();
        let (split, drive) = if self.drives_motion {
            (Split::new(self.active.clone()), Drive::Motion)
        } else {
            let dofs = (0..n).filter(|k| self.active[*k]).collect();
            (Split::new(vec![false; n]), Drive::Torque { dofs })
        };
        let names = [("motion.base", "phases"), ("motion.n_channels", "phases"), ("drive.dofs", "active")];
        Ok(PosedMotion {
            dynamics: Tree::try_new(model, split).map_err(|error| Error::from(error).with_names(&names))?,
            start: self.start.clone(),
            phases: self.phases.iter().map(|phase| phase.get().phase.clone()).collect(),
            options: ShootingOptions { scheme: self.scheme, drive },
            model: Arc::new(self.model.clone_ref(py)),
        })
    }

    pub(super) fn build(&self, py: Python<'_>) -> Result<Program, Error> {
        let motion = self.motion(py)?;
        let n_channels = self.phases.first().map_or(0, |phase| phase.get().phase.motion.n_channels());
        let (dynamics, sizes) = (&motion.dynamics, sizes_of(&motion.dynamics, n_channels));
        let mut builder = MotionProblem::builder(motion.shooting()?);
        for cost in &self.costs {
            let cost = cost.get();
            let term = cost.term.get().build(py, dynamics, &sizes)?;
            let loss = cost.loss(py, term.n_rows())?;
            builder = match cost.nodes {
                at @ (At::EveryNode | At::EveryNodeOf(_)) => builder.lagrange_over(at, term, loss)?,
                at => builder.mayer(at, term, loss)?,
            };
        }
        for constraint in &self.constraints {
            let constraint = constraint.get();
            let term = constraint.term.get().build(py, dynamics, &sizes)?;
            let n_rows = term.n_rows();
            let bounds = Bounds {
                lower: numbers_or_one("lower", n_rows, constraint.lower.bind(py))?,
                upper: numbers_or_one("upper", n_rows, constraint.upper.bind(py))?,
            };
            let built = if constraint.place.at == "integral" {
                builder.constrain_integral(constraint.nodes, term, bounds)
            } else {
                builder.constrain(constraint.nodes, term, bounds)
            };
            builder =
                built.map_err(|error| Error::from(error).with_names(&[("bounds", "lower` and `upper")]))?;
        }
        let n_variables = builder.transcription().outline().n_variables();
        let bounds = |name, value: &Option<Py<PyAny>>, default| match value {
            Some(value) => numbers_or_one(name, n_variables, value.bind(py)),
            None => Ok(vec![default; n_variables]),
        };
        let lower = bounds("lower", &self.lower, f64::NEG_INFINITY)?;
        let upper = bounds("upper", &self.upper, f64::INFINITY)?;
        let named = |error| {
            Error::from(error).with_names(&[("variables", "lower` and `upper"), ("start", "q` and `v")])
        };
        for (variable, (lower, upper)) in lower.into_iter().zip(upper).enumerate() {
            builder = builder.bound_variable(variable, lower, upper).map_err(named)?;
        }
        if self.exact_hessian {
            builder = builder.with_exact_hessian();
        }
        builder.build().map_err(named)
    }
}

/// A motion by shooting before it is made.
#[derive(Clone)]
pub(super) struct PosedMotion {
    dynamics: Tree,
    start: Start,
    phases: Vec<shooting::Phase>,
    options: ShootingOptions,
    model: Arc<Py<Model>>,
}

impl PosedMotion {
    fn shooting(&self) -> Result<Shooting<Tree>, Error> {
        let Self { dynamics, start, phases, options, .. } = self.clone();
        let names = [("motion.base", "phases"), ("motion.n_channels", "phases"), ("drive.dofs", "active")];
        Shooting::try_new(dynamics, start, phases, options)
            .map_err(|error| Error::from(error).with_names(&names))
    }

    pub(super) fn verify(&self, py: Python<'_>, z: &[f64]) -> Result<Verification, Error> {
        let mut shooting = self.shooting()?;
        let found = cancel_on_signal(py, |token| {
            verify_cancellable(&mut shooting, self.dynamics.model(), z, token).map_err(VerificationFailure)
        })?;
        Ok(Verification::of(found))
    }

    /// The motion that a decision vector makes.
    pub(super) fn of(&self, py: Python<'_>, z: &[f64]) -> Result<Motion, Error> {
        let mut shooting = self.shooting()?;
        py.detach(|| shooting.rollout(z)).map_err(|error| Error::evaluation(error.to_string()))?;
        Ok(Motion::of(self.model.clone_ref(py), &shooting))
    }

    pub(super) fn verifier(&self, report: &nlp::Report) -> Arc<Verifier> {
        let (verified, shown, z) = (self.clone(), self.clone(), report.z.clone());
        let same = z.clone();
        let verifier = Verifier::new(move |py| Ok(Py::new(py, verified.verify(py, &z)?)?.into_any()));
        Arc::new(verifier.with_motion(move |py| Ok(Py::new(py, shown.of(py, &same)?)?.into_any())))
    }
}
