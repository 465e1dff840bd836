//! What is given in time: schedules, and a torque that has one.

use crate::core::convert::{array, real_numbers, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_class};
use crate::integrators::forces::models::{ForceModel, build, is_body};
use numpy::PyArray1;
use pyo3::prelude::*;
use somersault::integrators::force;
use somersault::integrators::rotors::LinearSchedule;

/// A schedule for each column of `values`, which has a row for each of the times.
pub(super) fn schedules(
    argument: &str,
    count: usize,
    values: &Bound<'_, PyAny>,
    times: &Bound<'_, PyAny>,
) -> Result<Vec<LinearSchedule>, Error> {
    let times = real_numbers("times", times)?;
    let rows = with_shape(argument, &[times.len(), count], values)?;
    let column = |i: usize| rows.iter().skip(i).step_by(count).copied().collect();
    (0..count)
        .map(|i| {
            let schedule = LinearSchedule::try_new(times.clone(), column(i));
            schedule.map_err(|error| Error::from(error).with_names(&[("values", argument)]))
        })
        .collect()
}

/// The times and rows that a pickle holds of schedules.
pub(super) fn rows<'a>(
    schedules: impl Iterator<Item = &'a LinearSchedule> + Clone,
) -> (Vec<f64>, Vec<Vec<f64>>) {
    let times = schedules.clone().next().map(|schedule| schedule.times().to_vec()).unwrap_or_default();
    let row = |i: usize| schedules.clone().map(|schedule| schedule.values()[i]).collect();
    let rows = (0..times.len()).map(row).collect();
    (times, rows)
}

/// Torque about the centre of mass that is linear between given times, fixed in the world or in the body.
///
/// Before the first time and after the last it is constant. Adapted steps end at these times, and so do all steps where contacts are
/// located; with other fixed steps a method keeps its order where the times are points of the grid.
///
/// Parameters
/// ----------
/// times : array_like, shape (n,)
///     Increasing times, s.
/// torques : array_like, shape (n, 3)
///     The torque at each, N m.
/// frame : {'world', 'body'}, optional
///     Where it is fixed.
///
/// Examples
/// --------
/// A torque that grows to 1 N m and falls again turns by its integral, 1 N m s:
///
/// >>> import somersault
/// >>> body = somersault.RigidBody(1.0, (1.0, 1.0, 2.0))
/// >>> pulse = somersault.forces.ScheduledTorque([0.0, 1.0, 2.0], [(0, 0, 0), (0, 0, 1), (0, 0, 0)])
/// >>> motion = somersault.integrate(body, somersault.State(), (0.0, 3.0), dt=0.1, forces=pulse)
/// >>> motion.angular_velocity[-1].round(6)
/// array([0. , 0. , 0.5])
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct ScheduledTorque(force::ScheduledTorque);

#[pymethods]
impl ScheduledTorque {
    #[new]
    #[pyo3(signature = (times, torques, frame="world"))]
    fn new(
        times: &Bound<'_, PyAny>,
        torques: &Bound<'_, PyAny>,
        frame: &str,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let components = schedules("torques", 3, torques, times)?;
        let components =
            components.try_into().map_err(|_| Error::input("`torques` must have three columns"))?;
        Ok(build(force::ScheduledTorque { components, is_in_body: is_body(frame)? }, Self))
    }

    /// ndarray, shape (n,): The times, s.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        PyArray1::from_slice(py, self.0.components[0].times()).into_any()
    }

    /// ndarray, shape (n, 3): The torque at each, N m.
    #[getter]
    fn torques<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Error> {
        let (times, rows) = rows(self.0.components.iter());
        Ok(array(py, rows.concat(), &[times.len(), 3])?.into_any())
    }

    /// str: Where it is fixed, ``"world"`` or ``"body"``.
    #[getter]
    fn frame(&self) -> &'static str {
        if self.0.is_in_body { "body" } else { "world" }
    }

    fn __repr__(&self) -> String {
        let times = self.0.components[0].times();
        let (first, last) = (times[0], times[times.len() - 1]);
        format!(
            "<ScheduledTorque in the {} at {} times from {first:?} to {last:?} s>",
            self.frame(),
            times.len()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        by_class(slf, (own.times(py), own.torques(py)?, own.frame()))
    }
}
