//! A motion at the nodes of a transcription.

use crate::core::convert::{array, real_numbers, with_shape};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ocp::transcription::Transcription;

/// A motion at the nodes of a transcription, time first.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Motion {
    model: Py<Model>,
    times: Vec<f64>,
    parts: [(usize, Vec<f64>); 7],
}

impl Motion {
    pub(crate) fn of(model: Py<Model>, transcription: &impl Transcription) -> Self {
        let n_nodes = transcription.outline().n_nodes();
        let mut motion = Self { model, times: Vec::with_capacity(n_nodes), parts: Default::default() };
        for k in 0..n_nodes {
            let node = transcription.node(k);
            motion.times.push(node.time);
            let parts = [
                node.position,
                node.velocity,
                node.acceleration,
                node.torque,
                node.channel,
                node.channel_rate,
                node.channel_second_rate,
            ];
            for ((width, values), part) in motion.parts.iter_mut().zip(parts) {
                *width = part.len();
                values.extend_from_slice(part);
            }
        }
        motion
    }

    fn part<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyAny>> {
        let (width, values) = &self.parts[index];
        Ok(array(py, values.clone(), &[self.times.len(), *width])?.into_any())
    }
}

value! {
    impl Motion {
        /// Model: The tree that moves.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// ndarray, shape (n,): Times, s.
        t: Bound<'py, PyAny> = |own, py| numpy::PyArray1::from_slice(py, &own.times).into_any();
        /// ndarray, shape (n, n_positions): Configurations.
        q: PyResult<Bound<'py, PyAny>> = |own, py| own.part(py, 0);
        /// ndarray, shape (n, n_velocities): Velocities.
        v: PyResult<Bound<'py, PyAny>> = |own, py| own.part(py, 1);
        /// ndarray, shape (n, n_velocities): Accelerations.
        a: PyResult<Bound<'py, PyAny>> = |own, py| own.part(py, 2);
        /// ndarray, shape (n, n_velocities): Joint forces.
        torque: PyResult<Bound<'py, PyAny>> = |own, py| own.part(py, 3);
        /// ndarray, shape (n, n_channels): Weights of eigenpostures, or driven joints.
        channels: PyResult<Bound<'py, PyAny>> = |own, py| own.part(py, 4);
        /// ndarray, shape (n, n_channels): Rates of the channels, 1/s.
        channel_rates: PyResult<Bound<'py, PyAny>> = |own, py| own.part(py, 5);
        /// ndarray, shape (n, n_channels): Second rates of the channels, 1/s².
        channel_second_rates: PyResult<Bound<'py, PyAny>> = |own, py| own.part(py, 6);
    }
}

#[pymethods]
impl Motion {
    fn __len__(&self) -> usize {
        self.times.len()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, motion) = (slf.py(), slf.get());
        let parts = (0..motion.parts.len()).map(|k| motion.part(py, k)).collect::<PyResult<Vec<_>>>()?;
        by_restore(slf, (motion.model(py), motion.t(py), parts))
    }

    /// A pickled motion.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        model: Py<Model>,
        t: &Bound<'_, PyAny>,
        parts: [Bound<'_, PyAny>; 7],
    ) -> Result<Self, Error> {
        let times = real_numbers("t", t)?;
        let mut motion = Self { model, times, parts: Default::default() };
        for ((width, values), part) in motion.parts.iter_mut().zip(&parts) {
            let shape: (usize, usize) = part.getattr("shape")?.extract()?;
            *width = shape.1;
            *values = with_shape("parts", &[motion.times.len(), shape.1], part)?;
        }
        Ok(motion)
    }

    fn __repr__(&self) -> String {
        let (first, last) = (self.times.first().unwrap_or(&0.0), self.times.last().unwrap_or(&0.0));
        format!("<Motion: {} nodes, t = {first} to {last} s>", self.times.len())
    }
}
