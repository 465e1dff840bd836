//! The pendulum on a cart in closed form (thesis appendix A, corrected).
//!
//! ```text
//! θ̈ = (r̈ cos θ + g sin θ) / ℓ + τ / (m ℓ²)
//! F = (m_c + m) r̈ − m ℓ (θ̈ cos θ − θ̇² sin θ)
//! ```
//! (A.2) as printed lacks the ℓ under τ, and (A.3) has the wrong sign of its entry (1, 2).

use super::{Dofs, HybridDynamics, HybridSecondDerivatives};
use crate::error::OcpError;
use somersault_core::Scalar;
use somersault_core::argument::{expect_finite, expect_not_negative, expect_positive};
use somersault_multibody::{models::CartPendulum, nalgebra};
use somersault_nlp::EvaluationError;

/// The pendulum, passive, on the cart, active: q = (r, θ) as in the tree of [`CartPendulum`].
#[derive(Debug, Clone, PartialEq)]
pub struct CartPendulumDynamics {
    parameters: CartPendulum,
    dofs: Dofs,
}

impl CartPendulumDynamics {
    /// Masses and length must be positive, the mass of the cart may be zero, gravity of any sign.
    pub fn try_new(parameters: CartPendulum) -> Result<Self, OcpError> {
        expect_positive("mass", parameters.mass)?;
        expect_positive("length", parameters.length)?;
        expect_not_negative("cart_mass", parameters.cart_mass)?;
        expect_finite("gravity", &[parameters.gravity])?;
        let dofs = Dofs {
            n_positions: 2,
            active: vec![true, false],
            positions: vec![Some(0), Some(1)],
            groups: Vec::new(),
        };
        Ok(Self { parameters, dofs })
    }

    /// Masses, length and gravity.
    pub fn parameters(&self) -> &CartPendulum {
        &self.parameters
    }

    /// (θ̈, F) for θ, θ̇, r̈ and a torque τ about the pivot, over any scalar.
    #[inline(always)]
    pub fn solve<T: Scalar>(&self, angle: T, rate: T, cart_acceleration: T, torque: T) -> (T, T) {
        let CartPendulum { cart_mass, mass, length, gravity } = self.parameters;
        let number = |x: f64| nalgebra::convert::<f64, T>(x);
        let (sin, cos) = angle.sin_cos();
        let acceleration = (cart_acceleration * cos + sin * number(gravity)) / number(length)
            + torque / number(mass * length * length);
        let centripetal = acceleration * cos - rate * rate * sin;
        let force = cart_acceleration * number(cart_mass + mass) - centripetal * number(mass * length);
        (acceleration, force)
    }
}

impl HybridDynamics for CartPendulumDynamics {
    #[inline]
    fn dofs(&self) -> &Dofs {
        &self.dofs
    }

    #[inline]
    fn calc(
        &mut self,
        q: &[f64],
        v: &[f64],
        known: &[f64],
        found: &mut [f64],
    ) -> Result<(), EvaluationError> {
        (found[1], found[0]) = self.solve(q[1], v[1], known[0], known[1]);
        Ok(())
    }

    #[inline]
    fn calc_diff(
        &mut self,
        q: &[f64],
        v: &[f64],
        known: &[f64],
        partials: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let CartPendulum { cart_mass, mass, length, gravity } = self.parameters;
        let (sin, cos) = q[1].sin_cos();
        let (rate, push) = (v[1], known[0]);
        let (acceleration, _) = self.solve(q[1], rate, push, known[1]);
        let inertia = mass * length;
        let by_angle = (gravity * cos - push * sin) / length;
        let (by_push, by_torque) = (cos / length, 1.0 / (inertia * length));
        let force_by_angle = inertia * (acceleration * sin + rate * rate * cos - by_angle * cos);
        // columns: displacements of r and θ, then their rates, then r̈ and τ; rows: F, θ̈
        partials.copy_from_slice(&[
            0.0,
            0.0,
            force_by_angle,
            by_angle,
            0.0,
            0.0,
            2.0 * inertia * rate * sin,
            0.0,
            cart_mass + mass - inertia * cos * by_push,
            by_push,
            -inertia * cos * by_torque,
            by_torque,
        ]);
        Ok(())
    }

    fn second_derivatives(&mut self) -> Option<&mut dyn HybridSecondDerivatives> {
        None
    }
}
