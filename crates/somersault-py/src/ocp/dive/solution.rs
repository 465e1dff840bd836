//! A dive that was found.

use super::verification::{DiveVerification, peaks};
use super::{Dive, LiteralDive};
use crate::core::convert::{array, integer};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::cancel_on_signal;
use crate::multibody::model::Model;
use crate::ocp::arguments::count;
use crate::ocp::solver::{Report, status_name};
use crate::ocp::verification::{Verifier, judgement};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use somersault::dives::{Channels, DiveMotion, DiveReport};
use somersault::nlp;
use std::f64::consts::TAU;
use std::sync::Arc;

/// A dive that was found: what the solver says of it, its motion, and how it holds when re-integrated.
///
/// Arrays are over `t`. The origin is at the water's level below the end of the platform.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct DiveSolution {
    dive: Py<Dive>,
    pub(super) report: nlp::Report,
    verifier: Arc<Verifier>,
    motion: DiveMotion,
    momentum: f64,
    duration: f64,
    lean: f64,
    n_positions: usize,
    n_velocities: usize,
    n_channels: usize,
}

impl DiveSolution {
    pub(super) fn of(dive: &Bound<'_, Dive>, report: nlp::Report) -> Result<Self, Error> {
        let (judged, z) = (dive.get().program.clone(), report.z.clone());
        let verifier = Verifier::new(move |py| {
            Ok(Py::new(
                py,
                DiveVerification(cancel_on_signal(py, |token| judged.report_cancellable(&z, token))?),
            )?
            .into_any())
        });
        Self::with_verifier(dive, report, Arc::new(verifier))
    }

    /// With what integrations have already made of it.
    pub(super) fn judged(
        dive: &Bound<'_, Dive>,
        report: nlp::Report,
        found: DiveReport,
    ) -> Result<Self, Error> {
        let verification = Py::new(dive.py(), DiveVerification(found))?.into_any();
        Self::with_verifier(dive, report, Arc::new(Verifier::of(dive.py(), verification, None)))
    }

    fn with_verifier(
        dive: &Bound<'_, Dive>,
        report: nlp::Report,
        verifier: Arc<Verifier>,
    ) -> Result<Self, Error> {
        let program = &dive.get().program;
        let model = program.path().model();
        Ok(Self {
            dive: dive.clone().unbind(),
            verifier,
            motion: program.motion(&report.z)?,
            momentum: program.momentum(&report.z),
            duration: program.duration(&report.z),
            lean: program.lean(&report.z),
            n_positions: model.n_positions(),
            n_velocities: model.n_velocities(),
            n_channels: program.path().motion().n_channels(),
            report,
        })
    }

    fn rows<'py>(&self, py: Python<'py>, values: &[f64], width: usize) -> PyResult<Bound<'py, PyAny>> {
        Ok(array(py, values.to_vec(), &[self.motion.times.len(), width])?.into_any())
    }

    fn numbers<'py>(&self, py: Python<'py>, values: impl Iterator<Item = f64>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_vec(py, values.collect()).into_any()
    }
}

value! {
    impl DiveSolution {
        /// Dive: What was searched for.
        dive: Py<Dive> = |own, py| own.dive.clone_ref(py);
        /// Report: What the solver says of the program, in its last stage; the dive itself has its own `status` and `success`.
        report: Report = |own| Report { report: own.report.clone(), verifier: Some(own.verifier.clone()), wrong_derivative: None };
        /// bool: Whether integrations that are independent of the search agree with it: its flight, the counts at the entry
        /// and the distances of limbs.
        confirmed: PyResult<bool> = |own, py| Ok(own.verifier.judge(py)?.0);
        /// DiveVerification: The dive re-integrated, when first requested.
        verification: Result<Py<PyAny>, Error> = |own, py| own.verifier.get(py);
        /// ndarray, shape (n,): Decision vector.
        z: Bound<'py, PyAny> = |own, py| numpy::PyArray1::from_slice(py, &own.report.z).into_any();
        /// float: Angular momentum about the lateral axis, forward, kg m²/s.
        momentum: f64 = |own| own.momentum;
        /// float: Duration of the flight, s.
        duration: f64 = |own| own.duration;
        /// float: Forward lean at take-off, rad.
        lean: f64 = |own| own.lean;
        /// ndarray, shape (n,): Times, s.
        t: Bound<'py, PyAny> = |own, py| numpy::PyArray1::from_slice(py, &own.motion.times).into_any();
        /// ndarray, shape (n, n_positions): Configurations.
        q: PyResult<Bound<'py, PyAny>> = |own, py| own.rows(py, &own.motion.positions, own.n_positions);
        /// ndarray, shape (n, n_velocities): Velocities.
        v: PyResult<Bound<'py, PyAny>> = |own, py| own.rows(py, &own.motion.velocities, own.n_velocities);
        /// ndarray, shape (n, n_velocities): Accelerations.
        a: PyResult<Bound<'py, PyAny>> = |own, py| own.rows(py, &own.motion.accelerations, own.n_velocities);
        /// ndarray, shape (n, n_velocities): Joint forces that the motion takes, by hybrid dynamics, N m; zero for the root,
        /// which nothing pushes in flight.
        torques: PyResult<Bound<'py, PyAny>> = |own, py| own.rows(py, &own.motion.torques, own.n_velocities);
        /// dict of str to (float, float): For each joint the largest force at the times of the motion, with its sign, N m, and
        /// when it acts, s.
        peak_torques: PyResult<Bound<'py, PyDict>> =
            |own, py| peaks(py, &own.motion.peak_torques(own.dive.get().program.path().model()));
        /// ndarray, shape (n, n_channels): Weights of the postures but the fundamental one, or joints where these are the
        /// channels.
        channels: PyResult<Bound<'py, PyAny>> = |own, py| own.rows(py, &own.motion.channels, own.n_channels);
        /// ndarray, shape (n, n_channels): Rates of the channels, 1/s.
        channel_rates: PyResult<Bound<'py, PyAny>> =
            |own, py| own.rows(py, &own.motion.channel_rates, own.n_channels);
        /// ndarray, shape (n,): Somersaults, turns, 0 for upright.
        somersaults: Bound<'py, PyAny> =
            |own, py| own.numbers(py, own.motion.angles.iter().map(|a| a.somersault / TAU));
        /// ndarray, shape (n,): Twists, turns to the left.
        twists: Bound<'py, PyAny> =
            |own, py| own.numbers(py, own.motion.angles.iter().map(|a| a.twist / TAU));
        /// ndarray, shape (n,): Tilt of the body's long axis out of the plane of the somersault, rad.
        tilt: Bound<'py, PyAny> = |own, py| own.numbers(py, own.motion.angles.iter().map(|a| a.tilt));
        /// ndarray, shape (n,): Rate of the somersault ψ, rad/s.
        somersault_rate: Bound<'py, PyAny> =
            |own, py| own.numbers(py, own.motion.angle_rates.iter().map(|a| a.somersault));
        /// ndarray, shape (n,): Rate of the tilt τ, rad/s.
        tilt_rate: Bound<'py, PyAny> =
            |own, py| own.numbers(py, own.motion.angle_rates.iter().map(|a| a.tilt));
        /// ndarray, shape (n,): Rate of the twist φ, rad/s.
        twist_rate: Bound<'py, PyAny> =
            |own, py| own.numbers(py, own.motion.angle_rates.iter().map(|a| a.twist));
    }
}

#[pymethods]
impl DiveSolution {
    /// str: How the search ended: as in `Report`, or ``'false_convergence'`` where the program is solved and its motion is not
    /// the dive requested, by its `verification`.
    #[getter]
    pub(super) fn status(&self, py: Python<'_>) -> PyResult<&'static str> {
        if self.report.status.is_converged() && !self.confirmed(py)? {
            return Ok("false_convergence");
        }
        Ok(status_name(self.report.status))
    }

    /// str: The status in a sentence, and what the verification says.
    #[getter]
    fn message(&self, py: Python<'_>) -> PyResult<String> {
        let (confirmed, judged) = self.verifier.judge(py)?;
        let status = match self.report.status {
            nlp::Status::Converged if !confirmed => {
                "false convergence: the program is solved, and not the dive"
            }
            status => status.message(),
        };
        Ok(format!("{status}. {judged}"))
    }

    /// bool: Whether this is the dive requested: its program is solved, and it is `confirmed`.
    #[getter]
    pub(super) fn success(&self, py: Python<'_>) -> PyResult<bool> {
        Ok(self.report.status.is_converged() && self.confirmed(py)?)
    }

    /// ndarray, shape (n, 3): Angular momentum of the motion about its centre of mass, world axes, kg m²/s.
    #[getter]
    fn angular_momentum<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let values: Vec<f64> = self.motion.angular_momentum.iter().flat_map(|l| [l.x, l.y, l.z]).collect();
        self.rows(py, &values, 3)
    }

    /// float: Angle of the body's long axis to the vertical at the entry, rad.
    #[getter]
    fn entry_angle(&self) -> f64 {
        let level = |angles: &somersault::multibody::counting::BodyAngles| {
            (angles.somersault.cos() * angles.tilt.cos()).abs().min(1.0).acos()
        };
        self.motion.angles.last().map_or(f64::NAN, level)
    }

    /// list of (str, float, float): Which posture weighs most, from when to when, s; empty where joints are the
    /// channels.
    #[getter]
    fn phases(&self) -> Vec<(String, f64, f64)> {
        let plan = &self.dive.get().plan;
        if plan.dive.channels == Channels::Joints {
            return Vec::new();
        }
        let shares = |weights: &[f64]| -> Vec<f64> {
            let rest = 1.0 - weights.iter().sum::<f64>();
            std::iter::once(rest).chain(weights.iter().copied()).collect()
        };
        let mut phases: Vec<(String, f64, f64)> = Vec::new();
        let (mut last, mut before, mut t_before) = (None, Vec::new(), 0.0);
        for (t, weights) in self.motion.times.iter().zip(self.motion.channels.chunks_exact(self.n_channels)) {
            let now = shares(weights);
            let heaviest = (0..now.len()).max_by(|a, b| now[*a].total_cmp(&now[*b])).unwrap_or_default();
            if last != Some(heaviest) {
                // where the two weigh the same, between two times
                let change = last.map_or(*t, |last: usize| {
                    let lead = [&before, &now].map(|w: &Vec<f64>| w[last] - w[heaviest]);
                    t_before + (t - t_before) * lead[0] / (lead[0] - lead[1])
                });
                if let Some((_, _, end)) = phases.last_mut() {
                    *end = change;
                }
                phases.push((plan.names[heaviest].clone(), change, self.duration));
            }
            (last, before, t_before) = (Some(heaviest), now, *t);
        }
        phases
    }

    /// Verifies the dive by integrations that are independent of the search: its `verification`.
    ///
    /// Returns
    /// -------
    /// DiveVerification
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> found = ocp.dive_107b().solve()
    /// >>> found.verify().confirmed
    /// True
    fn verify(&self, py: Python<'_>) -> Result<Py<PyAny>, Error> {
        self.verifier.get(py)
    }

    /// The planar dive as the thesis has it: the full hybrid dynamics by explicit Euler, x₊ = x + Δt f(x, u) (2.8).
    ///
    /// Nothing there conserves the angular momentum: each step leaves out what the motion curves by. Weights, lean and duration
    /// are those of this dive; with ``optimise`` the problem is solved again, from here, under these dynamics.
    ///
    /// Parameters
    /// ----------
    /// n_steps : int, optional
    ///     N; 200 in the thesis.
    /// optimise : bool, optional
    ///     Solve again instead of rolling this motion out.
    /// on_interrupt : {'raise', 'return'}, optional
    ///     As of `Dive.solve`.
    ///
    /// Returns
    /// -------
    /// LiteralDive
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If the dive is not planar, has joints for channels, or a range of durations or leans.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> literal = ocp.dive_107b().solve().literal()
    /// >>> bool(abs(literal.momentum_change) > 0.01)
    /// True
    #[pyo3(signature = (n_steps=200, *, optimise=false, on_interrupt="raise"))]
    fn literal(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = integer)] n_steps: i64,
        optimise: bool,
        on_interrupt: &str,
    ) -> Result<LiteralDive, Error> {
        let n_steps = count("n_steps", n_steps, 1)?;
        let dive = self.dive.get();
        let model = Py::new(py, Model::of(dive.program.path().model().clone()))?;
        LiteralDive::of(py, model, &dive.program, &self.report.z, n_steps, optimise, on_interrupt)
    }

    /// Angular momentum of this planar dive about its centre of mass by explicit Euler in the coordinates x, z, θ of the torso
    /// and their rates; `literal` steps velocities in axes of the torso.
    ///
    /// Parameters
    /// ----------
    /// n_steps : int, optional
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_steps + 1,)
    ///
    /// Examples
    /// --------
    /// Explicit Euler gains momentum that a diver in the air cannot gain:
    ///
    /// >>> from somersault import ocp
    /// >>> momentum = ocp.dive_107b().solve().literal_momentum(200)
    /// >>> bool(abs(momentum[-1] / momentum[0] - 1.0) > 0.01)
    /// True
    #[pyo3(signature = (n_steps=200))]
    fn literal_momentum<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = integer)] n_steps: i64,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let n_steps = count("n_steps", n_steps, 1)?;
        let along = self.dive.get().program.momentum_in_coordinates(&self.report.z, n_steps)?;
        Ok(numpy::PyArray1::from_vec(py, along).into_any())
    }

    fn __len__(&self) -> usize {
        self.motion.times.len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let end = self.motion.angles.last().copied().unwrap_or_default();
        Ok(format!(
            "<DiveSolution: {}, {}, {:.3} somersaults, {:.3} twists, L = {:.2} kg m²/s, {} times>",
            status_name(self.report.status),
            judgement(py, &self.verifier)?,
            end.somersault / TAU,
            end.twist / TAU,
            self.momentum,
            self.motion.times.len()
        ))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        by_restore(slf, (slf.get().dive.clone_ref(slf.py()), slf.get().report()))
    }

    /// A pickled dive; its motion follows from z.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        dive: &Bound<'_, Dive>,
        report: &Bound<'_, Report>,
    ) -> Result<Self, Error> {
        let Report { report, verifier, .. } = report.get();
        dive.get().checked(report.z.clone())?;
        let solution = Self::of(dive, report.clone())?;
        let verifier = verifier.clone().unwrap_or(solution.verifier.clone());
        Ok(Self { verifier, ..solution })
    }
}
