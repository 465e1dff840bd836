//! Errors of the Rust crates as Python exceptions.
//!
//! The classes are those of `somersault.errors`; this file says which one an error belongs to.

use crate::convert::did_you_mean;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::ContactError;
use somersault::contact::event::Interruption;
use somersault::contact::models::ModelError as ContactModelError;
use somersault::contact::sensitivity::SensitivityError;
use somersault::core::InertiaError;
use somersault::integrators::batch::BatchError;
use somersault::integrators::body::BodyError;
use somersault::integrators::driver::IntegrateError;
use somersault::integrators::exact::FreeBodyError;
use somersault::integrators::methods::{Method, UnknownMethod};
use somersault::integrators::stepper::StepError;
use somersault::integrators::studies::StudyError;
use somersault::integrators::system::CountMismatch;
use somersault::motion::analysis::AnalysisError;
use somersault::motion::fit::FitError;
use somersault::motion::recording::RecordingError;
use somersault::motion::scoring::{ScoringError, StorageError};
use somersault::motion::synthetic::SyntheticError;
use somersault::motion::writers::WriteError;
use somersault::multibody::flight::FlightError;
use somersault::multibody::joint_motion::JointMotionError;
use somersault::multibody::models::PostureError;
use somersault::multibody::motion::MotionError;
use somersault::multibody::urdf::UrdfError;
use somersault::multibody::{DynamicsError, ModelError};
use somersault::nlp::SolverError;
use somersault::ocp::OcpError;
use somersault::ocp::collocation::CollocationError;
use somersault::ocp::dive::{DiveError, DiveJudgementError, DiveSearchError};

/// What a function of this module fails with.
pub(crate) enum Error {
    /// An exception that Python code raised.
    Raised(PyErr),
    /// An exception of `somersault.errors`, by the name of its class.
    Own { class: &'static str, message: String },
}

impl Error {
    /// An argument that is not allowed.
    pub(crate) fn input(message: impl Into<String>) -> Self {
        Self::Own { class: "InputError", message: message.into() }
    }

    /// A surface that is no surface.
    pub(crate) fn surface(message: String) -> Self {
        Self::Own { class: "SurfaceError", message }
    }

    /// A problem that could not be solved for a reason of its own.
    pub(crate) fn ocp(error: &impl ToString) -> Self {
        Self::own("OcpError", error)
    }

    /// A file that is no recording.
    pub(crate) fn read(message: String) -> Self {
        Self::Own { class: "ReadError", message }
    }

    /// What the system refuses.
    pub(crate) fn of_system(message: String) -> Self {
        Self::Own { class: "SomersaultError", message }
    }

    /// Motions that cannot be compared.
    pub(crate) fn analysis_input(message: String) -> Self {
        Self::Own { class: "AnalysisInputError", message }
    }

    /// An optimal control problem that is none.
    pub(crate) fn ocp_input(message: String) -> Self {
        Self::Own { class: "OcpInputError", message }
    }

    /// The same error, which says more.
    pub(crate) fn followed_by(self, more: &str) -> Self {
        match self {
            Self::Own { class, message } => Self::Own { class, message: message + more },
            raised => raised,
        }
    }

    /// What it says.
    pub(crate) fn message(&self) -> String {
        match self {
            Self::Raised(error) => error.to_string(),
            Self::Own { message, .. } => message.clone(),
        }
    }

    /// The error of one of many rows.
    pub(crate) fn in_row(self, row: usize) -> Self {
        match self {
            Self::Own { class, message } => Self::Own { class, message: format!("row {row}: {message}") },
            raised => raised,
        }
    }

    fn own(class: &'static str, error: &impl ToString) -> Self {
        Self::Own { class, message: error.to_string() }
    }
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match error {
            Error::Raised(error) => error,
            Error::Own { class, message } => Python::attach(|py| {
                let found = py
                    .import("somersault.errors")
                    .and_then(|errors| errors.getattr(class))
                    .and_then(|class| Ok(class.cast_into::<PyType>()?));
                match found {
                    Ok(class) => PyErr::from_type(class, message),
                    // Only where the extension is imported without its package.
                    Err(_) => PyRuntimeError::new_err(message),
                }
            }),
        }
    }
}

impl From<PyErr> for Error {
    fn from(error: PyErr) -> Self {
        Self::Raised(error)
    }
}

impl From<InertiaError> for Error {
    fn from(error: InertiaError) -> Self {
        Self::own("InertiaError", &error)
    }
}

impl From<BodyError> for Error {
    fn from(error: BodyError) -> Self {
        match error {
            BodyError::Inertia(error) => error.into(),
            error => Self::own("BodyError", &error),
        }
    }
}

impl From<CountMismatch> for Error {
    fn from(error: CountMismatch) -> Self {
        Self::own("CountMismatchError", &error)
    }
}

impl From<UnknownMethod> for Error {
    fn from(error: UnknownMethod) -> Self {
        let meant = did_you_mean(&error.found, Method::ALL.iter().map(|method| method.info().name));
        Self::own("UnknownMethodError", &error).followed_by(&meant)
    }
}

impl From<StepError> for Error {
    fn from(error: StepError) -> Self {
        match error {
            StepError::Torque { .. } => Self::own("TorqueError", &error),
            error => Self::own("StepError", &error),
        }
    }
}

impl From<IntegrateError> for Error {
    fn from(error: IntegrateError) -> Self {
        match error {
            IntegrateError::Step(error) => error.into(),
            IntegrateError::Interval { .. }
            | IntegrateError::Argument(_)
            | IntegrateError::TooManySteps { .. }
            | IntegrateError::InitialState { .. }
            | IntegrateError::NoErrorEstimate { .. }
            | IntegrateError::RigidBodiesOnly { .. }
            | IntegrateError::Variables { .. } => Self::own("IntegrateInputError", &error),
            error => Self::own("IntegrateError", &error),
        }
    }
}

impl From<BatchError> for Error {
    fn from(error: BatchError) -> Self {
        match error {
            BatchError::Length { .. } | BatchError::NonFinite { .. } | BatchError::NotPositive { .. } => {
                Self::own("BatchInputError", &error)
            }
            error => Self::own("BatchError", &error),
        }
    }
}

impl From<FreeBodyError> for Error {
    fn from(error: FreeBodyError) -> Self {
        Self::own("FreeBodyError", &error)
    }
}

impl From<StudyError> for Error {
    fn from(error: StudyError) -> Self {
        match error {
            StudyError::Step(error) => error.into(),
            StudyError::Body(error) => error.into(),
            StudyError::FreeBody(error) => error.into(),
            StudyError::Integrate(error) => error.into(),
            StudyError::Empty { .. } | StudyError::Argument(_) | StudyError::NotIncreasing { .. } => {
                Self::own("StudyInputError", &error)
            }
            error => Self::own("StudyError", &error),
        }
    }
}

impl From<ModelError> for Error {
    fn from(error: ModelError) -> Self {
        Self::own("ModelError", &error)
    }
}

impl From<DynamicsError> for Error {
    fn from(error: DynamicsError) -> Self {
        match error {
            DynamicsError::Singular { .. } => Self::own("DynamicsError", &error),
            error => Self::own("DynamicsInputError", &error),
        }
    }
}

impl From<ContactError> for Error {
    fn from(error: ContactError) -> Self {
        Self::own("ContactError", &error)
    }
}

impl From<ContactModelError> for Error {
    fn from(error: ContactModelError) -> Self {
        match error {
            ContactModelError::Body(error) => error.into(),
            ContactModelError::Contact(error) => error.into(),
            error => Self::own("ContactError", &error),
        }
    }
}

impl From<Interruption> for Error {
    fn from(reason: Interruption) -> Self {
        match reason {
            Interruption::Integrate(error) => error.into(),
            Interruption::Chattering { .. } => Self::own("ChatteringError", &reason),
            Interruption::NonFiniteGuard { guard, t, gap, rate } => Self::surface(format!(
                "the gap of contact {guard} is not finite at t = {t}: it is {gap}, its rate {rate}"
            )),
            Interruption::Surface { .. } => Self::surface(reason.to_string()),
            reason => Self::own("IntegrateError", &reason),
        }
    }
}

impl From<SensitivityError> for Error {
    fn from(error: SensitivityError) -> Self {
        match error {
            SensitivityError::Run(reason) => reason.into(),
            SensitivityError::Grazing(_) => Self::own("SensitivityError", &error),
            error => Self::own("SensitivityInputError", &error),
        }
    }
}

impl From<PostureError> for Error {
    fn from(error: PostureError) -> Self {
        Self::own("PostureError", &error)
    }
}

impl From<UrdfError> for Error {
    fn from(error: UrdfError) -> Self {
        Self::own("UrdfError", &error)
    }
}

impl From<MotionError> for Error {
    fn from(error: MotionError) -> Self {
        match error {
            MotionError::Integrate(error) => error.into(),
            error => Self::own("DynamicsError", &error),
        }
    }
}

impl From<FlightError> for Error {
    fn from(error: FlightError) -> Self {
        match error {
            FlightError::Dynamics(error) => error.into(),
            error => Self::own("FlightError", &error),
        }
    }
}

impl From<JointMotionError> for Error {
    fn from(error: JointMotionError) -> Self {
        Self::own("OcpInputError", &error)
    }
}

impl From<OcpError> for Error {
    fn from(error: OcpError) -> Self {
        match error {
            OcpError::Dynamics(error) => error.into(),
            OcpError::Model(error) => error.into(),
            error => Self::own("OcpInputError", &error),
        }
    }
}

impl From<SolverError> for Error {
    fn from(error: SolverError) -> Self {
        match error {
            SolverError::Failed { source, .. } => Self::ocp(&source),
            error => Self::own("OcpInputError", &error),
        }
    }
}

impl From<CollocationError> for Error {
    fn from(error: CollocationError) -> Self {
        match error {
            CollocationError::Solver(error) => error.into(),
            CollocationError::Evaluation(error) => Self::ocp(&error),
            error => Self::own("OcpInputError", &error),
        }
    }
}

impl From<DiveError> for Error {
    fn from(error: DiveError) -> Self {
        match error {
            DiveError::Dynamics(error) => error.into(),
            DiveError::Flight(error) => error.into(),
            DiveError::Model(error) => error.into(),
            DiveError::Posture(error) => error.into(),
            error => Self::own("OcpInputError", &error),
        }
    }
}

impl From<DiveSearchError> for Error {
    fn from(error: DiveSearchError) -> Self {
        match error {
            DiveSearchError::Dive(error) => error.into(),
            DiveSearchError::Solver(error) => error.into(),
            error => Self::ocp(&error),
        }
    }
}

impl From<DiveJudgementError> for Error {
    fn from(error: DiveJudgementError) -> Self {
        match error {
            DiveJudgementError::Dive(error) => error.into(),
            DiveJudgementError::Motion(error) => error.into(),
            error => Self::ocp(&error),
        }
    }
}

impl From<RecordingError> for Error {
    fn from(error: RecordingError) -> Self {
        match error {
            RecordingError::Model(error) => error.into(),
            error => Self::own("RecordingError", &error),
        }
    }
}

impl From<FitError> for Error {
    fn from(error: FitError) -> Self {
        match error {
            FitError::Model(error) => error.into(),
            error => Self::own("FitError", &error),
        }
    }
}

impl From<AnalysisError> for Error {
    fn from(error: AnalysisError) -> Self {
        match error {
            AnalysisError::NoConvergence => Self::own("AnalysisError", &error),
            error => Self::own("AnalysisInputError", &error),
        }
    }
}

impl From<ScoringError> for Error {
    fn from(error: ScoringError) -> Self {
        match error {
            ScoringError::Analysis(error) => error.into(),
            error => Self::own("ScoringError", &error),
        }
    }
}

impl From<StorageError> for Error {
    fn from(error: StorageError) -> Self {
        Self::own("StorageError", &error)
    }
}

impl From<WriteError> for Error {
    fn from(error: WriteError) -> Self {
        Self::own("WriteError", &error)
    }
}

impl From<SyntheticError> for Error {
    fn from(error: SyntheticError) -> Self {
        match error {
            SyntheticError::Recording(error) => error.into(),
            SyntheticError::Model(error) => error.into(),
            SyntheticError::Flight(error) => error.into(),
            SyntheticError::Motion(error) => error.into(),
            SyntheticError::Markers(error) => error.into(),
            SyntheticError::Faults(error) => error.into(),
            SyntheticError::Scoring(error) => error.into(),
            error => Self::own("SyntheticError", &error),
        }
    }
}
