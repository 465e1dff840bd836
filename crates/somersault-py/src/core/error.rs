//! Errors of the Rust crates as Python exceptions.
//!
//! The classes are those of `somersault.errors`; this file says which one an error belongs to.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::contact::ContactError;
use somersault::contact::models::ModelError as ContactModelError;
use somersault::contact::sensitivity::SensitivityError;
use somersault::contact::surface::SurfaceFault;
use somersault::core::InertiaError;
use somersault::core::argument::ArgumentError;
use somersault::dives::{DiveError, DiveJudgementError, DiveSearchError};
use somersault::integrators::batch::BatchError;
use somersault::integrators::body::BodyError;
use somersault::integrators::driver::IntegrateError;
use somersault::integrators::events::{Interruption, WatchError};
use somersault::integrators::exact::FreeBodyError;
use somersault::integrators::gyrostat::GyrostatError;
use somersault::integrators::methods::{Method, UnknownMethod};
use somersault::integrators::stepper::StepError;
use somersault::integrators::studies::StudyError;
use somersault::integrators::system::CountMismatch;
use somersault::motion::advice::AdviceError;
use somersault::motion::analysis::AnalysisError;
use somersault::motion::fit::FitError;
use somersault::motion::identification::IdentificationError;
use somersault::motion::inertia::InertiaEstimateError;
use somersault::motion::phases::PhaseError;
use somersault::motion::reconstruction::ReconstructionError;
use somersault::motion::recording::RecordingError;
use somersault::motion::scaling::ScalingError;
use somersault::motion::scoring::{ScoringError, StorageError};
use somersault::motion::smoothing::SmoothingError;
use somersault::motion::synthetic::SyntheticError;
use somersault::motion::writers::WriteError;
use somersault::multibody::flight::FlightError;
use somersault::multibody::joint_motion::JointMotionError;
use somersault::multibody::mjcf::MjcfError;
use somersault::multibody::models::PostureError;
use somersault::multibody::urdf::UrdfError;
use somersault::multibody::{DynamicsError, ModelError};
use somersault::nlp::{EvaluationError, NoDerivative, SolverError};
use somersault::ocp::OcpError;
use somersault::ocp::collocation::CollocationError;

/// A class of `somersault.errors`.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    Chattering,
    Dynamics,
    Evaluation,
    Input,
    Integration,
    Read,
    Sensitivity,
    Somersault,
    Write,
}

impl Class {
    const fn name(self) -> &'static str {
        match self {
            Self::Chattering => "ChatteringError",
            Self::Dynamics => "DynamicsError",
            Self::Evaluation => "EvaluationError",
            Self::Input => "InputError",
            Self::Integration => "IntegrationError",
            Self::Read => "ReadError",
            Self::Sensitivity => "SensitivityError",
            Self::Somersault => "SomersaultError",
            Self::Write => "WriteError",
        }
    }
}

/// What a function of this module fails with.
pub(crate) enum Error {
    /// An exception that Python code raised.
    Raised(PyErr),
    /// An exception of `somersault.errors`.
    Own { class: Class, message: String },
}

impl Error {
    /// An argument that is not allowed.
    pub(crate) fn input(message: impl Into<String>) -> Self {
        Self::Own { class: Class::Input, message: message.into() }
    }

    /// A function or a result that has no value.
    pub(crate) fn evaluation(message: impl Into<String>) -> Self {
        Self::Own { class: Class::Evaluation, message: message.into() }
    }

    /// What a function of the user failed with: what it raised in Python, as it was raised.
    pub(crate) fn failed(source: Box<dyn std::error::Error + Send + Sync>) -> Self {
        match source.downcast::<PyErr>() {
            Ok(raised) => Self::Raised(*raised),
            Err(other) => Self::evaluation(other.to_string()),
        }
    }

    /// A file or document that is not what it should be.
    pub(crate) fn read(message: impl Into<String>) -> Self {
        Self::Own { class: Class::Read, message: message.into() }
    }

    /// What the system refuses.
    pub(crate) fn of_system(message: impl Into<String>) -> Self {
        Self::Own { class: Class::Somersault, message: message.into() }
    }

    /// An error of the library.
    pub(crate) fn own(class: Class, error: &impl ToString) -> Self {
        Self::Own { class, message: error.to_string() }
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

    /// The same error by the names that Python has for arguments of the library: pairs of that one and this.
    pub(crate) fn with_names(self, names: &[(&str, &str)]) -> Self {
        let Self::Own { class, mut message } = self else { return self };
        for (theirs, ours) in names {
            message = message.replace(&format!("`{theirs}`"), &format!("`{ours}`"));
        }
        Self::Own { class, message }
    }

    /// The same error of something in an argument, which its message names.
    pub(crate) fn within(self, argument: &str) -> Self {
        match self {
            Self::Own { class, message } if !message.contains(&format!("`{argument}`")) => {
                Self::Own { class, message: format!("`{argument}`: {message}") }
            }
            named => named,
        }
    }

    /// The error of one of many rows.
    pub(crate) fn in_row(self, row: usize) -> Self {
        self.of("row", row)
    }

    /// The error of one of many, by its kind and its number.
    pub(crate) fn of(self, kind: &str, number: usize) -> Self {
        match self {
            Self::Own { class, message } => {
                Self::Own { class, message: format!("{kind} {number}: {message}") }
            }
            raised => raised,
        }
    }
}

/// The end of a message about a name that is unknown: the known one that was perhaps meant.
pub(crate) fn did_you_mean<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    let name = name.to_lowercase();
    let closest = Python::attach(|py| -> PyResult<Vec<String>> {
        py.import("difflib")?.call_method1("get_close_matches", (name, known, 1))?.extract()
    });
    match closest.as_deref() {
        Ok([closest, ..]) => format!("; did you mean `{closest}`?"),
        _ => String::new(),
    }
}

/// Errors of which every one is an argument's.
macro_rules! inputs {
    ($($error:ty),* $(,)?) => {$(
        impl From<$error> for Error {
            fn from(error: $error) -> Self {
                Self::own(Class::Input, &error)
            }
        }
    )*};
}
pub(crate) use inputs;

inputs!(
    ArgumentError,
    BodyError,
    ContactError,
    ContactModelError,
    CountMismatch,
    FreeBodyError,
    GyrostatError,
    InertiaError,
    InertiaEstimateError,
    JointMotionError,
    ModelError,
    PostureError,
);

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match error {
            Error::Raised(error) => error,
            Error::Own { class, message } => Python::attach(|py| {
                let found = py
                    .import("somersault.errors")
                    .and_then(|errors| errors.getattr(class.name()))
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

impl From<UnknownMethod> for Error {
    fn from(error: UnknownMethod) -> Self {
        let meant = did_you_mean(&error.found, Method::ALL.iter().map(|method| method.info().name));
        Self::own(Class::Input, &error).followed_by(&meant)
    }
}

impl From<StepError> for Error {
    fn from(error: StepError) -> Self {
        let class = if error.is_refusal() { Class::Input } else { Class::Integration };
        Self::own(class, &error)
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
            | IntegrateError::Variables { .. } => Self::own(Class::Input, &error),
            IntegrateError::Fault { .. } => Self::own(Class::Dynamics, &error),
            error => Self::own(Class::Integration, &error),
        }
    }
}

impl From<BatchError> for Error {
    fn from(error: BatchError) -> Self {
        match error {
            BatchError::Length { .. } | BatchError::NonFinite { .. } | BatchError::NotPositive { .. } => {
                Self::own(Class::Input, &error)
            }
            BatchError::Integrate { index, source } => Self::from(source).of("body", index),
            error => Self::own(Class::Integration, &error),
        }
    }
}

impl From<StudyError> for Error {
    fn from(error: StudyError) -> Self {
        match error {
            StudyError::Step(error) => error.into(),
            StudyError::Integrate(error) => error.into(),
            StudyError::Body(_)
            | StudyError::FreeBody(_)
            | StudyError::Empty { .. }
            | StudyError::Argument(_)
            | StudyError::NotIncreasing { .. } => Self::own(Class::Input, &error),
            error => Self::own(Class::Evaluation, &error),
        }
    }
}

impl From<DynamicsError> for Error {
    fn from(error: DynamicsError) -> Self {
        match error {
            DynamicsError::Singular { .. } => Self::own(Class::Dynamics, &error),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<Interruption<SurfaceFault>> for Error {
    fn from(reason: Interruption<SurfaceFault>) -> Self {
        match reason {
            Interruption::Integrate(error) => error.into(),
            Interruption::Chattering { .. } => Self::own(Class::Chattering, &reason),
            Interruption::NonFiniteGuard { guard, t, gap, rate } => Self::input(format!(
                "the gap of contact {guard} is not finite at t = {t}: it is {gap}, its rate {rate}"
            )),
            Interruption::Refused { guard, t, fault } => {
                Self::input(format!("the surface behind guard {guard} cannot be touched at t = {t}: {fault}"))
            }
            reason => Self::own(Class::Integration, &reason),
        }
    }
}

impl From<WatchError> for Error {
    fn from(error: WatchError) -> Self {
        match error {
            WatchError::Integrate(error) => error.into(),
            WatchError::NonFinite { .. } | WatchError::Lipschitz { .. } | WatchError::Violated { .. } => {
                Self::own(Class::Input, &error)
            }
            WatchError::Unproved { .. } => Self::own(Class::Integration, &error),
        }
    }
}

impl From<SensitivityError> for Error {
    fn from(error: SensitivityError) -> Self {
        match error {
            SensitivityError::Run(reason) => reason.into(),
            SensitivityError::Grazing(_) | SensitivityError::Feature { .. } => {
                Self::own(Class::Sensitivity, &error)
            }
            SensitivityError::Tree(error) => error.into(),
            SensitivityError::NonFinite => Self::own(Class::Evaluation, &error),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<UrdfError> for Error {
    fn from(error: UrdfError) -> Self {
        match error {
            UrdfError::NotRepresentable { .. } => Self::own(Class::Write, &error),
            error => Self::own(Class::Read, &error),
        }
    }
}

impl From<MjcfError> for Error {
    fn from(error: MjcfError) -> Self {
        Self::own(Class::Read, &error)
    }
}

impl From<FlightError> for Error {
    fn from(error: FlightError) -> Self {
        match error {
            FlightError::Dynamics(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<OcpError> for Error {
    fn from(error: OcpError) -> Self {
        match error {
            OcpError::Dynamics(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<SolverError> for Error {
    fn from(error: SolverError) -> Self {
        match error {
            SolverError::Failed { source, .. } => Self::failed(source),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<CollocationError> for Error {
    fn from(error: CollocationError) -> Self {
        match error {
            CollocationError::Solver(error) => error.into(),
            CollocationError::Evaluation(EvaluationError::Failed(source)) => Self::failed(source),
            CollocationError::Evaluation(error) => Self::own(Class::Evaluation, &error),
            CollocationError::NoDerivative(
                error @ (NoDerivative::NotIsolated | NoDerivative::Dependent { .. }),
            ) => Self::own(Class::Sensitivity, &error),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<DiveError> for Error {
    fn from(error: DiveError) -> Self {
        match error {
            DiveError::Dynamics(error) => error.into(),
            DiveError::Flight(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<DiveSearchError> for Error {
    fn from(error: DiveSearchError) -> Self {
        match error {
            DiveSearchError::Dive(error) => error.into(),
            DiveSearchError::Solver(error) => error.into(),
            error => Self::own(Class::Evaluation, &error),
        }
    }
}

impl From<DiveJudgementError> for Error {
    fn from(error: DiveJudgementError) -> Self {
        match error {
            DiveJudgementError::Dive(error) => error.into(),
            DiveJudgementError::Motion(error) => error.into(),
            error => Self::own(Class::Evaluation, &error),
        }
    }
}

impl From<RecordingError> for Error {
    fn from(error: RecordingError) -> Self {
        match error {
            RecordingError::Model(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<FitError> for Error {
    fn from(error: FitError) -> Self {
        match error {
            FitError::Model(error) => error.into(),
            FitError::Diver(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<AdviceError> for Error {
    fn from(error: AdviceError) -> Self {
        match error {
            AdviceError::Model(error) => error.into(),
            AdviceError::Flight(error) => error.into(),
            AdviceError::Identification(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<IdentificationError> for Error {
    fn from(error: IdentificationError) -> Self {
        match error {
            IdentificationError::Model(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<PhaseError> for Error {
    fn from(error: PhaseError) -> Self {
        match error {
            PhaseError::Recording(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<ReconstructionError> for Error {
    fn from(error: ReconstructionError) -> Self {
        match error {
            ReconstructionError::Fit(error) => error.into(),
            ReconstructionError::Flight(error) => error.into(),
            ReconstructionError::Model(error) => error.into(),
            ReconstructionError::Recording(error) => error.into(),
            ReconstructionError::Phase(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<ScalingError> for Error {
    fn from(error: ScalingError) -> Self {
        match error {
            ScalingError::Fit(error) => error.into(),
            ScalingError::Dynamics(error) => error.into(),
            ScalingError::Model(error) => error.into(),
            ScalingError::Recording(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<SmoothingError> for Error {
    fn from(error: SmoothingError) -> Self {
        match error {
            SmoothingError::Fit(error) => error.into(),
            SmoothingError::Model(error) => error.into(),
            SmoothingError::Recording(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<AnalysisError> for Error {
    fn from(error: AnalysisError) -> Self {
        match error {
            AnalysisError::NoConvergence => Self::own(Class::Evaluation, &error),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<ScoringError> for Error {
    fn from(error: ScoringError) -> Self {
        match error {
            ScoringError::Analysis(error) => error.into(),
            error => Self::own(Class::Input, &error),
        }
    }
}

impl From<StorageError> for Error {
    fn from(error: StorageError) -> Self {
        Self::own(Class::Read, &error)
    }
}

impl From<WriteError> for Error {
    fn from(error: WriteError) -> Self {
        Self::own(Class::Write, &error)
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
            error => Self::own(Class::Input, &error),
        }
    }
}
