//! Derivatives of the angular velocity of the root, all of the shape in one sweep.
//!
//! Momentum in axes of the root, seen from the centre of mass, is h = Σ I_i V_i = (0, Rᵀ L), with V_i the
//! velocity of body i, the root's V₀ included. A displacement of degree of freedom k carries all bodies
//! further out along J_k, and their velocities against that of the parent λ. At fixed V₀
//!
//! ```text
//! ∂h/∂s_k = J_k ×* H_k − I_k (J_k × V_λ),   ∂h/∂ṡ_k = I_k J_k
//! ```
//! with I_k and H_k inertia and momentum of the bodies further out; V₀ then makes up for it.

use super::{Flight, FlightData};
use crate::error::DynamicsError;
use nalgebra::{Matrix3, Vector3};
use somersault_core::Scalar;

/// ω and its derivatives, in axes of the root.
///
/// Displacements of orientation and shape are those of [`Model::displace`](crate::Model::displace): in
/// axes of the root, R exp(δθ), and of each joint's child. In the plane only third components count.
#[derive(Debug, Clone, Copy)]
pub struct FlightDerivatives<'d, T: Scalar = f64> {
    /// ω.
    pub angular_velocity: Vector3<T>,
    /// ∂ω/∂s, one vector for each degree of freedom after the root's.
    pub by_shape: &'d [Vector3<T>],
    /// ∂ω/∂ṡ = −I⁻¹ A.
    pub by_shape_velocity: &'d [Vector3<T>],
    /// ∂ω/∂θ = I⁻¹ (RᵀL)^.
    pub by_orientation: Matrix3<T>,
    /// ∂ω/∂L = I⁻¹ Rᵀ, for L in world axes.
    pub by_angular_momentum: Matrix3<T>,
}

impl<T: Scalar> Flight<'_, T> {
    /// ω as by [`angular_velocity`](Self::angular_velocity), with its derivatives. Cost O(n).
    pub fn derivatives<'d>(
        &self,
        data: &'d mut FlightData<T>,
        q: &[T],
        v: &[T],
    ) -> Result<FlightDerivatives<'d, T>, DynamicsError> {
        self.set_shape(data, q, v)?;
        self.set_directions_in((), &mut data.0);
        let reduced = self.reduce(data, q);
        let shape = &data.0.shape;
        let (by_orientation, by_angular_momentum) =
            (shape.by_orientation(&reduced), shape.by_angular_momentum(&reduced));
        let [by_shape, by_shape_velocity] = self.derive_in((), &mut data.0, &reduced);
        Ok(FlightDerivatives {
            angular_velocity: reduced.velocity.angular,
            by_shape,
            by_shape_velocity,
            by_orientation,
            by_angular_momentum,
        })
    }
}
