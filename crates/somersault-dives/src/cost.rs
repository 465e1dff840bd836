//! The cost of rates: integrals of squared derivatives of splines, exact.

use nalgebra::{DMatrix, DVector};
use somersault_core::quadrature::GAUSS_5;
use somersault_multibody::joint_motion::SplineMotion;

/// ½ ∫₀¹ Σ (d^r c_i/dx^r)² dx as ½ pᵀ Q p + gᵀ p + k in the parameters of the splines.
#[derive(Debug, Clone)]
pub(crate) struct Quadratic {
    pub(crate) matrix: DMatrix<f64>,
    pub(crate) linear: DVector<f64>,
    pub(crate) constant: f64,
}

impl Quadratic {
    /// Of the `derivative`-th rate.
    pub(crate) fn of_rate(motion: &SplineMotion, derivative: usize) -> Self {
        let basis = motion.basis();
        let (n, n_intervals) = (basis.n_coefficients(), basis.n_intervals());
        let mut gram = DMatrix::zeros(n, n);
        let mut values = vec![0.0; basis.n_active()];
        for interval in 0..n_intervals {
            for (node, weight) in GAUSS_5 {
                let fraction = (interval as f64 + node) / n_intervals as f64;
                let first = basis.evaluate(fraction, derivative, &mut values);
                for (i, a) in values.iter().enumerate() {
                    for (j, b) in values.iter().enumerate() {
                        gram[(first + i, first + j)] += weight / n_intervals as f64 * a * b;
                    }
                }
            }
        }
        let (n_coefficients, n_parameters) = (motion.n_coefficients(), motion.n_parameters());
        let mut expansion = DMatrix::zeros(n_coefficients, n_parameters);
        for (coefficient, parameter, factor) in motion.dependences() {
            expansion[(coefficient, parameter)] = factor;
        }
        let mut whole = DMatrix::zeros(n_coefficients, n_coefficients);
        for channel in 0..motion.n_channels() {
            whole.view_mut((channel * n, channel * n), (n, n)).copy_from(&gram);
        }
        let offset = DVector::from_column_slice(motion.offset());
        let at_offset = &whole * &offset;
        Self {
            matrix: expansion.transpose() * &whole * &expansion,
            linear: expansion.transpose() * &at_offset,
            constant: 0.5 * offset.dot(&at_offset),
        }
    }

    /// Its value; adds its gradient times `factor` to `gradient`.
    pub(crate) fn evaluate(&self, p: &[f64], factor: f64, mut gradient: Option<&mut [f64]>) -> f64 {
        let mut value = self.constant;
        for (i, column) in self.matrix.column_iter().enumerate() {
            let product: f64 = column.iter().zip(p).map(|(a, b)| a * b).sum();
            value += p[i] * (0.5 * product + self.linear[i]);
            if let Some(gradient) = &mut gradient {
                gradient[i] += factor * (product + self.linear[i]);
            }
        }
        value
    }
}
