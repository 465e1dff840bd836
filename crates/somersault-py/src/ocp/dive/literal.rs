//! The planar dive by explicit Euler.

use crate::core::convert::{array, real_numbers, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::{Cancellation, attend, deliver, returns_interrupted, together};
use crate::multibody::model::Model;
use crate::ocp::solver::{Report, Watcher};
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::dives::{self, DiveProgram};
use somersault::nlp::{self, Flow, Iteration};
use std::f64::consts::TAU;

/// A planar dive as thesis 3.1 poses it, stepped by explicit Euler. The centre of mass starts at the origin.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct LiteralDive {
    model: Py<Model>,
    dive: dives::LiteralDive,
}

impl LiteralDive {
    pub(super) fn of(
        py: Python<'_>,
        model: Py<Model>,
        program: &DiveProgram,
        z: &[f64],
        n_steps: usize,
        optimise: bool,
        on_interrupt: &str,
    ) -> Result<Self, Error> {
        let returned = returns_interrupted(on_interrupt)?;
        if !optimise {
            let dive = together(py, || program.literal_motion(z, n_steps))??;
            return Ok(Self { model, dive });
        }
        let mut watcher = Watcher::new(None)?;
        let cancellation = Cancellation::default();
        let watch = &mut |i: &Iteration<'_>| {
            if cancellation.token.is_cancelled() { Flow::Stop } else { watcher.look(i) }
        };
        let solve = || program.solve_literal(z, n_steps, watch);
        let found = attend(py, |raised| cancellation.raise(raised), solve)??;
        watcher.hears(cancellation.raised().map(|raised| raised.clone_ref(py)));
        let interrupted = watcher.is_interrupted(py);
        let reported = |report: nlp::Report| if interrupted { report.interrupted() } else { report };
        let dive = dives::LiteralDive { report: found.report.map(reported), ..found };
        deliver(py, watcher.into_raised(), returned, Self { model, dive })
    }

    fn rows<'py>(&self, py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        let n = self.dive.times.len();
        Ok(array(py, values.to_vec(), &[n, values.len() / n])?.into_any())
    }
}

value! {
    impl LiteralDive {
        /// Model: The diver.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// ndarray, shape (n_steps + 1,): Times, s.
        t: Bound<'py, PyAny> = |own, py| numpy::PyArray1::from_slice(py, &own.dive.times).into_any();
        /// ndarray, shape (n_steps + 1, n_positions): Configurations.
        q: PyResult<Bound<'py, PyAny>> = |own, py| own.rows(py, &own.dive.positions);
        /// ndarray, shape (n_steps + 1, n_velocities): Velocities.
        v: PyResult<Bound<'py, PyAny>> = |own, py| own.rows(py, &own.dive.velocities);
        /// ndarray, shape (n_steps + 1,): Angular momentum about the centre of mass, lateral axis, kg m²/s.
        angular_momentum: Bound<'py, PyAny> =
            |own, py| numpy::PyArray1::from_slice(py, &own.dive.angular_momentum).into_any();
        /// float: Change of the angular momentum from take-off to entry over that at take-off: positive where it grows, forward or
        /// backward. One of less than 10⁻³ m h²/(1 s) says nothing of its own size and counts as that, forward.
        momentum_change: f64 = |own| own.dive.momentum_change();
        /// Report or None: What the solver says; None where a motion was only rolled out. It has no verification: how far explicit
        /// Euler is from the physics is what `momentum_change` says.
        report: Option<Report> = |own| own.dive.report.clone().map(|report| Report { report, verifier: None, wrong_derivative: None });
    }
}

#[pymethods]
impl LiteralDive {
    /// ndarray, shape (n_steps + 1,): Somersaults, turns, counted from the upright as those of `DiveSolution`: the first is the
    /// lean at take-off.
    #[getter]
    fn somersaults<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_vec(py, self.dive.somersault.iter().map(|a| a / TAU).collect()).into_any()
    }

    fn __len__(&self) -> usize {
        self.dive.times.len()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, dive) = (slf.py(), slf.get());
        let angles = numpy::PyArray1::from_slice(py, &dive.dive.somersault);
        let rows = (dive.q(py)?, dive.v(py)?);
        let momentum = (dive.angular_momentum(py), dive.dive.momentum_unit);
        by_restore(slf, (dive.model(py), dive.t(py), rows, momentum, angles, dive.report()))
    }

    /// A pickled dive.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        model: Py<Model>,
        t: &Bound<'_, PyAny>,
        rows: (Bound<'_, PyAny>, Bound<'_, PyAny>),
        momentum: (Bound<'_, PyAny>, f64),
        somersault: &Bound<'_, PyAny>,
        report: Option<&Bound<'_, Report>>,
    ) -> Result<Self, Error> {
        let times = real_numbers("t", t)?;
        if times.is_empty() {
            return Err(Error::input("`t` must have at least one time, found none"));
        }
        let n = times.len();
        let table = |name, value: &Bound<'_, PyAny>| {
            let (_, width): (usize, usize) = value.getattr("shape")?.extract()?;
            with_shape(name, &[n, width], value)
        };
        let dive = dives::LiteralDive {
            positions: table("q", &rows.0)?,
            velocities: table("v", &rows.1)?,
            angular_momentum: with_shape("angular_momentum", &[n], &momentum.0)?,
            momentum_unit: momentum.1,
            somersault: with_shape("somersault", &[n], somersault)?,
            report: report.map(|report| report.get().report.clone()),
            times,
        };
        Ok(Self { model, dive })
    }

    fn __repr__(&self) -> String {
        let turned = self.dive.somersault.last().map_or(f64::NAN, |a| a / TAU);
        format!(
            "<LiteralDive: {} times, {turned:.3} somersaults, momentum {:+.1} %>",
            self.dive.times.len(),
            100.0 * self.momentum_change()
        )
    }
}
