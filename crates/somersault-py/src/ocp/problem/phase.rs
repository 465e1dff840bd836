//! A phase of a motion.

use crate::core::convert::integer;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore};
use crate::ocp::arguments::{count, number_or_range};
use crate::ocp::joint_motion::SplineMotion;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ocp::shooting::{self, Duration};

/// A phase of a motion.
///
/// Parameters
/// ----------
/// motion : SplineMotion
///     Of the driven joints, or of their torques.
/// duration : float or tuple of float
///     s; a pair makes the duration a variable between the two.
/// n_steps : int
///     Steps of equal length.
/// n_segments : int, optional
///     1 for single shooting; more for multiple shooting, whose starts are variables.
///
/// Examples
/// --------
/// >>> from somersault import ocp
/// >>> ends = [("start", 0, 0.0), ("finish", 0, 1.0)]
/// >>> ocp.Phase(ocp.SplineMotion(1, 8, ends), (0.5, 2.0), 40)
/// <Phase: 0.5 to 2 s, 6 parameters, 40 steps in 1 segment>
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Phase {
    pub(super) phase: shooting::Phase,
    motion: Py<SplineMotion>,
}

#[pymethods]
impl Phase {
    #[new]
    #[pyo3(signature = (motion, duration, n_steps, *, n_segments=1))]
    fn new(
        motion: &Bound<'_, SplineMotion>,
        duration: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = integer)] n_steps: i64,
        #[pyo3(from_py_with = integer)] n_segments: i64,
    ) -> Result<Self, Error> {
        let (lower, upper) = number_or_range("duration", duration)?;
        // a NaN is not below
        if !(0.0 < lower && lower <= upper && upper.is_finite()) {
            return Err(Error::input(format!(
                "`duration` must be positive and finite, or a pair of such numbers in their order, found ({lower}, {upper})"
            )));
        }
        let duration = if lower == upper { Duration::Fixed(lower) } else { Duration::Free { lower, upper } };
        let n_steps = count("n_steps", n_steps, 1)?;
        let n_segments = count("n_segments", n_segments, 1)?;
        if n_segments > n_steps {
            return Err(Error::input(format!(
                "`n_segments` must be at most `n_steps` = {n_steps}, found {n_segments}"
            )));
        }
        let phase = shooting::Phase { motion: motion.get().motion.clone(), n_steps, duration, n_segments };
        Ok(Self { phase, motion: motion.clone().unbind() })
    }

    fn __repr__(&self) -> String {
        let shooting::Phase { n_steps, n_segments, motion, .. } = &self.phase;
        let duration = match self.phase.duration {
            Duration::Fixed(duration) => format!("{duration} s"),
            Duration::Free { lower, upper } => format!("{lower} to {upper} s"),
        };
        let (n, plural) = (motion.n_parameters(), if *n_segments == 1 { "" } else { "s" });
        format!("<Phase: {duration}, {n} parameters, {n_steps} steps in {n_segments} segment{plural}>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let shooting::Phase { n_steps, duration, n_segments, .. } = own.phase;
        let duration = match duration {
            Duration::Fixed(duration) => (duration, duration),
            Duration::Free { lower, upper } => (lower, upper),
        };
        by_restore(slf, (own.motion.clone_ref(py), duration, n_steps, n_segments))
    }

    /// A pickled phase.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        motion: &Bound<'_, SplineMotion>,
        duration: &Bound<'_, PyAny>,
        n_steps: i64,
        n_segments: i64,
    ) -> Result<Self, Error> {
        Self::new(motion, duration, n_steps, n_segments)
    }
}
