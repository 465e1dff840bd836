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

use super::{Flight, FlightData, Reduced, Shape};
use crate::error::DynamicsError;
use crate::spatial::Force;
use nalgebra::{Matrix3, Vector3};
use somersault_core::Scalar;
use somersault_core::lie::so3::hat;

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
        self.set_directions(data);
        Ok(self.derivatives_of_shape(data, q))
    }

    /// Evaluates what the [derivatives](Self::derivatives_of_shape) by the shape that was set last have in common.
    pub fn set_directions(&self, data: &mut FlightData<T>) {
        let FlightData { nodes, shape, columns, by_shape_velocity, .. } = data;
        for (node, body) in nodes.iter().zip(&self.model.bodies) {
            if body.parent.is_none() {
                continue;
            }
            for k in body.dofs.clone() {
                let column = self.model.directions[k].seen_from((), &node.pose);
                by_shape_velocity[k - self.n_root()] = shape.answer(node.inertia.times(&column));
                columns[k - self.n_root()] = column;
            }
        }
    }

    /// The derivatives for the shape that was [set](Self::set_shape) last, with its [directions](Self::set_directions): of `q` only the
    /// orientation of the root is read.
    pub fn derivatives_of_shape<'d>(&self, data: &'d mut FlightData<T>, q: &[T]) -> FlightDerivatives<'d, T> {
        let Reduced { turn, momentum, velocity } = self.reduce(&data.shape, q);
        let FlightData { nodes, shape, columns, by_shape, by_shape_velocity, gathered, .. } = data;
        for (node, body) in nodes.iter().zip(&self.model.bodies) {
            let Some(parent) = body.parent else { continue };
            let outer = velocity + nodes[parent].velocity;
            let carried = node.momentum + node.inertia.times(&velocity);
            for k in body.dofs.clone() {
                let column = &columns[k - self.n_root()];
                let change = column.cross_force(&carried) - node.inertia.times(&column.cross(&outer));
                by_shape[k - self.n_root()] = shape.answer(change);
            }
        }
        let [of_shape, of_velocity] = gathered;
        let (from, zero) = (self.n_root(), Vector3::zeros());
        FlightDerivatives {
            angular_velocity: velocity.angular,
            by_shape: self.model.gather_from(from, by_shape, zero, of_shape),
            by_shape_velocity: self.model.gather_from(from, by_shape_velocity, zero, of_velocity),
            by_orientation: shape.inverse_inertia * hat(&momentum),
            by_angular_momentum: shape.inverse_inertia * turn.transpose(),
        }
    }
}

impl<T: Scalar> Shape<T> {
    /// What the angular velocity of the root makes up for.
    fn answer(&self, change: Force<T>) -> Vector3<T> {
        self.inverse_inertia * -change.about(&self.center).angular
    }
}
