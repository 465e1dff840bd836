//! Two scalar problems of the literature with two-timescale extremals: minimise ½ ∫ x² + u² dt.
//!
//! **ẋ = −x + u.** u* = −λ, λ̇ = −x + λ: linear with rates ±√2. On the stable direction λ = (√2 − 1) x, on the unstable
//! one λ = −(√2 + 1) x.
//!
//! **ẋ = −x³ + u.** u* = −λ, λ̇ = −x + 3x²λ, H* = ½(x² − λ²) − λx³, so that (λ + x³)² = x² + x⁶ − 2H*. The manifolds of
//! the equilibrium have H* = 0: stable λ = −x³ + x√(1 + x⁴), unstable λ = −x³ − x√(1 + x⁴). With λ = ∂V/∂x the cost of
//! coming from x₀ to rest is V = −x₀⁴/4 + ½ A(x₀²), that of leaving rest for x_f is x_f⁴/4 + ½ A(x_f²), where
//! A(y) = ∫₀^y √(1 + s²) ds = ½ (y√(1 + y²) + arsinh y). On a long horizon the cost is their sum up to terms of size e^−2T.
//!
//! Source: A. V. Rao and K. D. Mease, *Eigenvector approximate dichotomic basis method for solving hyper-sensitive
//! optimal control problems*, Optimal Control Applications and Methods 21 (2000).

use super::{HamiltonianSystem, OptimalControlSystem, SystemError, VectorField, expect_controls};
use nalgebra::DMatrix;

/// ẋ = −x + u with cost ½ ∫ x² + u² dt.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LinearRegulator;

/// ẋ = −x³ + u with cost ½ ∫ x² + u² dt.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CubicRegulator;

impl VectorField for LinearRegulator {
    #[inline(always)]
    fn dimension(&self) -> usize {
        2
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        h.copy_from_slice(&[-p[0] - p[1], -p[0] + p[1]]);
    }

    fn jacobian_into(&self, _: &[f64], d: &mut DMatrix<f64>) {
        // column by column
        d.copy_from_slice(&[-1.0, -1.0, -1.0, 1.0]);
    }

    fn conserved(&self, p: &[f64]) -> Option<f64> {
        Some(self.hamiltonian(p))
    }
}

impl HamiltonianSystem for LinearRegulator {
    fn hamiltonian(&self, p: &[f64]) -> f64 {
        0.5 * (p[0] * p[0] - p[1] * p[1]) - p[0] * p[1]
    }
}

impl VectorField for CubicRegulator {
    #[inline(always)]
    fn dimension(&self) -> usize {
        2
    }

    fn field_into(&self, p: &[f64], h: &mut [f64]) {
        let square = p[0] * p[0];
        h.copy_from_slice(&[-p[0] * square - p[1], -p[0] + 3.0 * square * p[1]]);
    }

    fn jacobian_into(&self, p: &[f64], d: &mut DMatrix<f64>) {
        let stretch = 3.0 * p[0] * p[0];
        // column by column
        d.copy_from_slice(&[-stretch, -1.0 + 6.0 * p[0] * p[1], -1.0, stretch]);
    }

    fn conserved(&self, p: &[f64]) -> Option<f64> {
        Some(self.hamiltonian(p))
    }
}

impl HamiltonianSystem for CubicRegulator {
    fn hamiltonian(&self, p: &[f64]) -> f64 {
        0.5 * (p[0] * p[0] - p[1] * p[1]) - p[1] * p[0].powi(3)
    }
}

macro_rules! regulator {
    ($($name:ty),*) => {$(
        impl OptimalControlSystem for $name {
            fn n_controls(&self) -> usize {
                1
            }

            fn control_into(&self, p: &[f64], u: &mut [f64]) -> Result<(), SystemError> {
                expect_controls(u, 1)?;
                u[0] = -p[1];
                Ok(())
            }

            fn running_cost(&self, p: &[f64]) -> f64 {
                0.5 * (p[0] * p[0] + p[1] * p[1])
            }
        }
    )*};
}

regulator!(LinearRegulator, CubicRegulator);
