//! Legendre–Gauss–Radau points with their quadrature, differentiation and interpolation.
//!
//! The N points τ₁ = −1 < … < τ_N < 1 are the roots of P_{N−1} + P_N. Quadrature with their weights is exact
//! up to degree 2N − 2. States are interpolated through the points and τ_{N+1} = 1, where nothing is
//! collocated (degree N), controls through the points alone (degree N − 1). Derivatives and interpolation are barycentric.
//!
//! Source: D. Garg et al., *A unified framework for the numerical solution of optimal control problems using
//! pseudospectral methods*, Automatica 46 (2010); J.-P. Berrut and L. N. Trefethen, *Barycentric Lagrange
//! interpolation*, SIAM Review 46 (2004).

use super::error::CollocationError;
use nalgebra::DMatrix;
use somersault_core::quadrature;

/// Most points of one interval.
pub const MAX_POINTS: usize = 500;

/// The points and what goes with them.
#[derive(Debug, Clone, PartialEq)]
pub struct Radau {
    /// τ₁ … τ_N, then 1.
    nodes: Vec<f64>,
    weights: Vec<f64>,
    differentiation: DMatrix<f64>,
    state_factors: Vec<f64>,
    control_factors: Vec<f64>,
}

impl Radau {
    /// `n` points, from 1 to [`MAX_POINTS`]. Cost O(n²).
    pub fn try_new(n: usize) -> Result<Self, CollocationError> {
        if !(1..=MAX_POINTS).contains(&n) {
            return Err(CollocationError::Mesh { phase: None, reason: "an interval needs 1 to 500 points" });
        }
        let (mut nodes, weights) = quadrature::radau(n);
        let control_factors = barycentric_factors(&nodes);
        nodes.push(1.0);
        let state_factors = barycentric_factors(&nodes);
        let mut differentiation = DMatrix::zeros(n, n + 1);
        for i in 0..n {
            for j in 0..=n {
                if i != j {
                    let entry = state_factors[j] / state_factors[i] / (nodes[i] - nodes[j]);
                    differentiation[(i, j)] = entry;
                    // rows of a differentiation matrix have the sum zero
                    differentiation[(i, i)] -= entry;
                }
            }
        }
        Ok(Self { nodes, weights, differentiation, state_factors, control_factors })
    }

    /// Number N of points.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// Never: there is at least one point.
    pub fn is_empty(&self) -> bool {
        self.weights.is_empty()
    }

    /// τ₁ … τ_N, ascending from −1.
    pub fn points(&self) -> &[f64] {
        &self.nodes[..self.len()]
    }

    /// τ₁ … τ_N and 1: where the interpolant of a state has its values.
    pub fn state_nodes(&self) -> &[f64] {
        &self.nodes
    }

    /// Weights of quadrature over [−1, 1].
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// D, N × (N + 1): derivatives at the points from values at the state nodes.
    pub fn differentiation(&self) -> &DMatrix<f64> {
        &self.differentiation
    }

    /// A, N × N: integrals from −1 to τ₂ … τ_{N+1} of what has given values at the points; the inverse of
    /// D without its first column.
    pub fn integration(&self) -> DMatrix<f64> {
        let inner = self.differentiation.columns(1, self.len()).into_owned();
        // only constants have the derivative zero, and they do not vanish at −1
        inner.try_inverse().unwrap_or_else(|| DMatrix::from_element(self.len(), self.len(), f64::NAN))
    }

    /// The Lagrange polynomials of the state nodes at τ: N + 1 numbers.
    pub fn state_basis(&self, tau: f64, basis: &mut [f64]) {
        lagrange(&self.nodes, &self.state_factors, tau, basis);
    }

    /// The Lagrange polynomials of the points at τ: N numbers.
    pub fn control_basis(&self, tau: f64, basis: &mut [f64]) {
        lagrange(self.points(), &self.control_factors, tau, basis);
    }
}

/// 1/Π(x_i − x_j), with differences doubled: [−1, 1] has the capacity ½, so the products stay near 1.
fn barycentric_factors(nodes: &[f64]) -> Vec<f64> {
    let product =
        |i: usize| (0..nodes.len()).filter(|&j| j != i).map(|j| 2.0 * (nodes[i] - nodes[j])).product::<f64>();
    (0..nodes.len()).map(|i| 1.0 / product(i)).collect()
}

fn lagrange(nodes: &[f64], factors: &[f64], tau: f64, basis: &mut [f64]) {
    if let Some(hit) = nodes.iter().position(|&x| x == tau) {
        basis.fill(0.0);
        basis[hit] = 1.0;
        return;
    }
    let mut sum = 0.0;
    for ((b, x), factor) in basis.iter_mut().zip(nodes).zip(factors) {
        *b = factor / (tau - x);
        sum += *b;
    }
    basis.iter_mut().for_each(|b| *b /= sum);
}
