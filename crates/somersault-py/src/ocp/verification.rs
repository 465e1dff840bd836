//! What accurate integrations make of results.

use crate::core::error::{Class, Error};
use crate::core::value::{Pickled, by_restore, value};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyTuple, PyType};
use somersault::ocp::verification::{self, ALLOWED, VerificationError};

type Make = Box<dyn Fn(Python<'_>) -> Result<Py<PyAny>, Error> + Send + Sync>;

/// A value that is made when it is first requested, and once.
struct Deferred {
    found: PyOnceLock<Py<PyAny>>,
    make: Make,
}

impl Deferred {
    fn new(make: impl Fn(Python<'_>) -> Result<Py<PyAny>, Error> + Send + Sync + 'static) -> Self {
        Self { found: PyOnceLock::new(), make: Box::new(make) }
    }

    /// A value that is there, of a stored result.
    fn of(py: Python<'_>, value: Py<PyAny>) -> Self {
        let found = PyOnceLock::new();
        // the cell is new, so that nothing can be in it
        let _ = found.set(py, value.clone_ref(py));
        Self { found, make: Box::new(move |py| Ok(value.clone_ref(py))) }
    }

    fn get(&self, py: Python<'_>) -> Result<Py<PyAny>, Error> {
        Ok(self.found.get_or_try_init(py, || (self.make)(py))?.clone_ref(py))
    }
}

/// The re-integration of a result, and the motion of a report.
pub(crate) struct Verifier {
    verification: Deferred,
    motion: Option<Deferred>,
}

impl Verifier {
    pub(crate) fn new(make: impl Fn(Python<'_>) -> Result<Py<PyAny>, Error> + Send + Sync + 'static) -> Self {
        Self { verification: Deferred::new(make), motion: None }
    }

    /// With the motion that is integrated again.
    pub(crate) fn with_motion(
        self,
        make: impl Fn(Python<'_>) -> Result<Py<PyAny>, Error> + Send + Sync + 'static,
    ) -> Self {
        Self { motion: Some(Deferred::new(make)), ..self }
    }

    /// Of a stored result.
    pub(crate) fn of(py: Python<'_>, verification: Py<PyAny>, motion: Option<Py<PyAny>>) -> Self {
        let motion = motion.map(|motion| Deferred::of(py, motion));
        Self { verification: Deferred::of(py, verification), motion }
    }

    pub(crate) fn get(&self, py: Python<'_>) -> Result<Py<PyAny>, Error> {
        self.verification.get(py)
    }

    /// None where another result has the motion.
    pub(crate) fn motion(&self, py: Python<'_>) -> Result<Option<Py<PyAny>>, Error> {
        self.motion.as_ref().map(|motion| motion.get(py)).transpose()
    }

    /// Whether the integration agrees, and a sentence; an integration that is not possible does not agree.
    pub(crate) fn judge(&self, py: Python<'_>) -> PyResult<(bool, String)> {
        match self.get(py) {
            Ok(found) => {
                let found = found.bind(py);
                Ok((found.getattr("confirmed")?.extract()?, found.getattr("message")?.extract()?))
            }
            Err(Error::Own { message, .. }) => {
                Ok((false, format!("The motion cannot be re-integrated: {message}.")))
            }
            Err(Error::Raised(error)) => Err(error),
        }
    }
}

/// "confirmed", or what it is not, in the text that stands for a result; nothing is integrated for it.
pub(crate) fn judgement(py: Python<'_>, verifier: &Verifier) -> PyResult<&'static str> {
    let Some(found) = verifier.verification.found.get(py) else { return Ok("not re-integrated yet") };
    let confirmed: bool = found.bind(py).getattr("confirmed")?.extract()?;
    Ok(if confirmed { "confirmed" } else { "NOT confirmed by integration" })
}

/// A motion re-integrated and accurately: from each node to the next one, and once from start to end.
///
/// Distances are the largest entry of the displacement of the positions (m, rad) and of the difference of the
/// velocities (m/s, rad/s); of a `CollocationResult` they are relative to 1 + max |x|.
#[pyclass(frozen, subclass, module = "somersault.ocp")]
pub(crate) struct Verification {
    pub(crate) found: verification::Verification,
    allowed: f64,
    confirmed: bool,
    message: String,
}

impl Verification {
    /// Of a motion by shooting: defects add up to at most [`ALLOWED`].
    pub(crate) fn of(found: verification::Verification) -> Self {
        Self {
            allowed: ALLOWED,
            confirmed: found.is_confirmed(ALLOWED),
            message: found.sentence(ALLOWED, None),
            found,
        }
    }

    pub(crate) fn judged(
        found: verification::Verification,
        allowed: f64,
        confirmed: bool,
        message: String,
    ) -> Self {
        Self { found, allowed, confirmed, message }
    }

    pub(crate) fn with_message(self, message: String) -> Self {
        Self { message, ..self }
    }

    /// What a stored one is made of.
    pub(crate) fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let verification::Verification { defects, terminal_error, momentum_drift } = &self.found;
        let defects = numpy::PyArray1::from_slice(py, defects);
        (defects, *terminal_error, *momentum_drift, self.allowed, self.confirmed, &self.message)
            .into_pyobject(py)
    }

    pub(crate) fn of_parts(parts: Parts) -> Self {
        let (defects, terminal_error, momentum_drift, allowed, confirmed, message) = parts;
        let found = verification::Verification { defects, terminal_error, momentum_drift };
        Self { found, allowed, confirmed, message }
    }
}

/// Defects, terminal error, momentum drift, what is allowed, whether it is kept to, and a sentence.
pub(crate) type Parts = (Vec<f64>, f64, f64, f64, bool, String);

value! {
    impl Verification {
        /// bool: Whether the integration agrees with the motion to `allowed`: of a motion by shooting the defects add up to no
        /// more, of collocation none is larger. The terminal error is no part of it, since it grows along hyper-sensitive
        /// motions however good they are.
        confirmed: bool = |own| own.confirmed;
        /// float: What `confirmed` allows: 10⁻⁴, or the tolerance of the collocation.
        allowed: f64 = |own| own.allowed;
        /// str: Whether the motion is confirmed, in a sentence.
        message: &str = |own| &own.message;
        /// ndarray, shape (n_steps + n_phases − 1,): For each step, integrated accurately from the node where it begins, the
        /// distance at its end; between two phases, the distance of the start of the later one from the end of the earlier one.
        /// Of collocation, one for each interval.
        defects: Bound<'py, PyAny> = |own, py| numpy::PyArray1::from_slice(py, &own.found.defects).into_any();
        /// float: The largest defect.
        max_defect: f64 = |own| own.found.largest_defect();
        /// float: The distance at the end, integrated from the start in one piece.
        terminal_error: f64 = |own| own.found.terminal_error;
        /// float: Largest change of the angular momentum about the centre of mass over the nodes, kg m²/s; meant for flight.
        momentum_drift: f64 = |own| own.found.momentum_drift;
    }
}

#[pymethods]
impl Verification {
    /// Whether the motion is confirmed where its use allows another distance, in a sentence.
    ///
    /// Parameters
    /// ----------
    /// allowed : float, optional
    ///
    /// Returns
    /// -------
    /// str
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody, ocp
    /// >>> phase = ocp.Phase(ocp.SplineMotion(1, 8, [("start", 0, 0.0)]), 1.0, 20)
    /// >>> problem = ocp.MotionProblem(multibody.cart_pendulum(), [0.0, np.pi], [0.0, 0.0], [phase], active=["cart"])
    /// >>> problem.verify(np.zeros(problem.n_variables)).sentence(1e-3).partition(":")[0]
    /// 'The motion holds when re-integrated'
    #[pyo3(signature = (allowed=1e-4))]
    fn sentence(&self, allowed: f64) -> Result<String, Error> {
        super::arguments::tolerance("allowed", Some(allowed))?;
        Ok(self.found.sentence(allowed, None))
    }

    fn __repr__(&self) -> String {
        let (end, defect) = (self.found.terminal_error, self.found.largest_defect());
        let confirmed = if self.confirmed { "confirmed" } else { "not confirmed" };
        format!("<Verification: {confirmed}, terminal error {end:.1e}, largest defect {defect:.1e}>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        by_restore(slf, (slf.get().parts(slf.py())?,))
    }

    /// A pickled verification.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, parts: Parts) -> Self {
        Self::of_parts(parts)
    }
}

/// A swing-up re-integrated, with the same motion of the cart.
#[pyclass(frozen, extends = Verification, module = "somersault.ocp")]
pub(crate) struct SwingUpVerification {
    /// float: Cost of the motion integrated accurately from start to end.
    #[pyo3(get)]
    cost: f64,
    /// float: Relative change of that cost when its step was last halved.
    #[pyo3(get)]
    cost_error: f64,
}

impl SwingUpVerification {
    /// With the cost that was found, where it is known, in the message.
    pub(crate) fn of(
        py: Python<'_>,
        found: somersault::ocp::swing_up::SwingUpVerification,
        cost_found: f64,
    ) -> PyResult<Py<Self>> {
        let somersault::ocp::swing_up::SwingUpVerification { motion, cost, cost_error } = found;
        let message = motion.sentence(ALLOWED, Some((cost_found, cost)));
        let base = Verification::of(motion).with_message(message);
        Py::new(py, PyClassInitializer::from(base).add_subclass(Self { cost, cost_error }))
    }
}

#[pymethods]
impl SwingUpVerification {
    fn __repr__(slf: &Bound<'_, Self>) -> String {
        let (base, cost) = (slf.as_super().get(), slf.get().cost);
        let (end, defect) = (base.found.terminal_error, base.found.largest_defect());
        let confirmed = if base.confirmed { "confirmed" } else { "not confirmed" };
        format!(
            "<SwingUpVerification: {confirmed}, cost {cost:.8}, terminal error {end:.1e}, largest defect {defect:.1e}>"
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let parts = slf.as_super().get().parts(slf.py())?;
        by_restore(slf, (parts, slf.get().cost, slf.get().cost_error))
    }

    /// A pickled verification.
    #[classmethod]
    fn _restore(cls: &Bound<'_, PyType>, parts: Parts, cost: f64, cost_error: f64) -> PyResult<Py<Self>> {
        let base = Verification::of_parts(parts);
        Py::new(cls.py(), PyClassInitializer::from(base).add_subclass(Self { cost, cost_error }))
    }
}

/// Why a motion could not be re-integrated.
pub(crate) struct VerificationFailure(pub(crate) VerificationError);

impl From<VerificationFailure> for Error {
    fn from(VerificationFailure(error): VerificationFailure) -> Self {
        match error {
            VerificationError::Problem(error) => error.into(),
            VerificationError::Integration(error) => error.into(),
            VerificationError::Dynamics(error) => error.into(),
            error => Self::own(Class::Evaluation, &error),
        }
    }
}
