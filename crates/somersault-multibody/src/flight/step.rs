//! One step of the orientation, with its exact derivatives.
//!
//! In space RKMK4 in the axes of the root: R₊ = R exp(u), u̇ = ω + ½ u × ω + ¹⁄₁₂ u × (u × ω)
//! ([`short::rate`](somersault_core::lie::short::rate)), by the classical Runge–Kutta method. A stage i that turns by e_i more,
//! and a start that is displaced by δθ, displace the end by
//!
//! ```text
//! δθ₊ = F δθ + Σ M_i e_i
//! ```
//! In the plane ω does not depend on the orientation and the same method is Simpson's rule: F = 1, M = h (1, 4, 1)/6.
//!
//! Source: H. Munthe-Kaas, BIT 38 (1998) 92; the series of the inverse differential may end there for order 4.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_core::lie::short::{rate, rate_partials};
use somersault_core::lie::so3::{self, hat, right_jacobian};
use somersault_integrators::tableau::RUNGE_KUTTA_4;

/// Stages of a step.
pub const STAGES: usize = RUNGE_KUTTA_4.nodes.len();

/// Where each stage is, in fractions of the step.
pub const NODES: &[f64] = RUNGE_KUTTA_4.nodes;
/// What each stage counts.
pub const WEIGHTS: &[f64] = RUNGE_KUTTA_4.weights.factors;

/// The shape that each stage has, of those at the start, in the middle and at the end of the step.
pub const SHAPE_OF: [usize; STAGES] = [0, 1, 1, 2];

/// Weights of Simpson's rule; the third stage repeats the second.
pub const SIMPSON: [f64; STAGES] = [WEIGHTS[0], WEIGHTS[1] + WEIGHTS[2], 0.0, WEIGHTS[3]];

/// F and M_i.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepDerivative {
    /// F.
    pub by_start: Matrix3<f64>,
    /// M_i.
    pub by_stage: [Matrix3<f64>; STAGES],
}

impl StepDerivative {
    /// Room for one.
    pub fn zero() -> Self {
        Self { by_start: Matrix3::zeros(), by_stage: [Matrix3::zeros(); STAGES] }
    }

    /// In the plane.
    pub fn simpson(h: f64) -> Self {
        let by_stage = SIMPSON.map(|weight| Matrix3::from_diagonal_element(h * weight));
        Self { by_start: Matrix3::identity(), by_stage }
    }
}

/// ω of a stage and ∂ω/∂θ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageRate {
    /// ω, axes of the root, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// ∂ω/∂θ for displacements R exp(δθ).
    pub by_orientation: Matrix3<f64>,
}

/// Second derivatives of a · log(exp(−u₀) exp(δ) exp(u)) at δ = 0: by δ and u, and by u twice.
pub fn displacement_curvature(u: &Vector3<f64>, a: &Vector3<f64>) -> [Matrix3<f64>; 2] {
    // exp(−u₀) exp(δ) exp(u) = exp(Aδ) exp(Jδu + …), whose logarithm has half of their bracket beside their sum
    let carried = so3::exp(u).to_rotation_matrix().into_inner();
    let by_u = so3::dexp_partials(u, a);
    [carried * hat(a) * right_jacobian(u) * -0.5, (by_u + by_u.transpose()) * 0.5]
}

/// Displacements by the start and by each stage.
type Columns = [Matrix3<f64>; 1 + STAGES];

/// A step of length `h`, also of a negative one, from `start`; `stage(i, R)` is the rate in stage i. Derivatives are wanted where there is
/// room for them.
pub fn turn<E>(
    start: &UnitQuaternion<f64>,
    h: f64,
    mut stage: impl FnMut(usize, &UnitQuaternion<f64>) -> Result<StageRate, E>,
    derivative: Option<&mut StepDerivative>,
) -> Result<UnitQuaternion<f64>, E> {
    let with_derivatives = derivative.is_some();
    let zero: Columns = [Matrix3::zeros(); 1 + STAGES];
    let (mut k, mut sum) = (Vector3::zeros(), Vector3::zeros());
    let (mut k_columns, mut sum_columns) = (zero, zero);
    for i in 0..STAGES {
        let u = k * (h * NODES[i]);
        let StageRate { angular_velocity: omega, by_orientation } = stage(i, &(start * so3::exp(&u)))?;
        k = rate(&u, &omega);
        sum += k * (h * WEIGHTS[i]);
        if !with_derivatives {
            continue;
        }
        let [by_omega, by_u] = rate_partials(&u, &omega);
        let by_turn = by_omega * by_orientation;
        // through u, which moves both the stage's orientation and the rate of u
        let through = (by_turn * right_jacobian(&u) + by_u) * (h * NODES[i]);
        for column in &mut k_columns {
            *column = through * *column;
        }
        k_columns[0] += by_turn * so3::exp(&-u).to_rotation_matrix().into_inner();
        k_columns[1 + i] += by_omega;
        for (total, column) in sum_columns.iter_mut().zip(&k_columns) {
            *total += column * (h * WEIGHTS[i]);
        }
    }
    if let Some(out) = derivative {
        let jacobian = right_jacobian(&sum);
        let [by_start, by_stage @ ..] = sum_columns.map(|column| jacobian * column);
        *out = StepDerivative {
            by_start: by_start + so3::exp(&-sum).to_rotation_matrix().into_inner(),
            by_stage,
        };
    }
    Ok(so3::renormalize(&(start * so3::exp(&sum))))
}
