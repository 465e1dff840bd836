//! Trees with a name in the literature.

use crate::error::Error;
use crate::model::Model;
use pyo3::prelude::*;
use somersault::multibody::models::{CartPendulum, TwoLinkArm};

/// The pendulum on a cart (thesis appendix A).
///
/// q = (r, θ) with r along x and θ from the upright towards −x.
///
/// Parameters
/// ----------
/// cart_mass, mass : float, optional
///     Masses of the cart and of the point at the end of the pendulum, kg.
/// length : float, optional
///     Length of the pendulum, m.
/// gravity : float, optional
///     Acceleration along −z, m/s².
///
/// Returns
/// -------
/// Model
///     Bodies ``'cart'`` and ``'pendulum'``.
///
/// Examples
/// --------
/// >>> from somersault import multibody
/// >>> multibody.cart_pendulum().mass_matrix([0.0, 0.0])
/// array([[ 3., -1.],
///        [-1.,  1.]])
#[pyfunction]
#[pyo3(signature = (cart_mass=2.0, mass=1.0, length=1.0, gravity=9.81))]
pub(crate) fn cart_pendulum(cart_mass: f64, mass: f64, length: f64, gravity: f64) -> Result<Model, Error> {
    Ok(Model::of(CartPendulum { cart_mass, mass, length, gravity }.model()?))
}

/// The two-link robot arm on a horizontal plane (thesis 8.2).
///
/// q = (θ₁, θ₂) about z; the links lie along x at q = 0 and are uniform rods.
///
/// Parameters
/// ----------
/// masses : tuple of float, optional
///     m₁, m₂, kg.
/// lengths : tuple of float, optional
///     L₁, L₂, m.
/// damping : tuple of float, optional
///     c₁, c₂, N m s.
///
/// Returns
/// -------
/// Model
///     Bodies ``'upper'`` and ``'lower'``.
#[pyfunction]
#[pyo3(signature = (masses=[0.5, 0.5], lengths=[2.0, 0.5], damping=[0.2, 0.0]))]
pub(crate) fn two_link_arm(masses: [f64; 2], lengths: [f64; 2], damping: [f64; 2]) -> Result<Model, Error> {
    Ok(Model::of(TwoLinkArm { masses, lengths, damping }.model()?))
}
