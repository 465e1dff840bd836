//! The systems of the library.

use super::error::input;
use super::system::System;
use crate::convert::numbers_or_one;
use crate::error::Error;
use crate::model::Model;
use pyo3::prelude::*;
use somersault::ftla::system::{ArmMinimumTorque, CubicRegulator, LinearRegulator, TreeMinimumTorque};
use somersault::multibody::models::TwoLinkArm;

/// Minimum-torque motions of the two-link arm (thesis 8.2, 8.3), field and Jacobian in closed form.
///
/// p = (θ₁, θ₂, dθ₁/dt, dθ₂/dt, λ₁, …, λ₄); running cost ½ (γ₁u₁² + γ₂u₂²).
///
/// Parameters
/// ----------
/// masses, lengths, damping : tuple of float, optional
///     m, kg, L, m, and c, N m s; those of Table 8.1 unless given.
/// weights : tuple of float, optional
///     γ.
/// torque_limits : tuple of float, optional
///     Largest |u|, N m; infinite unless given.
///
/// Returns
/// -------
/// System
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> ftla.arm().field([0.0, 3.0, 0.5, 0.0, -0.2, 0.0, -0.2, 0.02])[:4].round(4)
/// array([ 0.5   ,  0.    , -0.5628, -5.9769])
#[pyfunction]
#[pyo3(signature = (
    *, masses=[0.5, 0.5], lengths=[2.0, 0.5], damping=[0.2, 0.0], weights=[1.0, 0.5], torque_limits=None
))]
pub(crate) fn arm(
    masses: [f64; 2],
    lengths: [f64; 2],
    damping: [f64; 2],
    weights: [f64; 2],
    torque_limits: Option<[f64; 2]>,
) -> Result<System, Error> {
    let mut arm = ArmMinimumTorque::try_new(TwoLinkArm { masses, lengths, damping }, weights)?;
    let mut limited = String::new();
    if let Some(limits) = torque_limits {
        check_limits(&limits)?;
        arm = arm.try_with_torque_limits(limits)?;
        limited = format!(", torque_limits={limits:?}");
    }
    let description = format!(
        "arm, masses={masses:?}, lengths={lengths:?}, damping={damping:?}, weights={weights:?}{limited}"
    );
    Ok(System::compiled(arm, description).of_arm(arm))
}

/// The regulator dx/dt = −x + u with cost ½ ∫ x² + u² dt: linear, with rates ±√2.
///
/// Returns
/// -------
/// System
#[pyfunction]
pub(crate) fn linear_regulator() -> System {
    System::compiled(LinearRegulator, "linear regulator".to_owned())
}

/// The regulator dx/dt = −x³ + u with cost ½ ∫ x² + u² dt.
///
/// Its manifolds are λ = −x³ ± x √(1 + x⁴), the stable one with the upper sign.
///
/// Returns
/// -------
/// System
#[pyfunction]
pub(crate) fn cubic_regulator() -> System {
    System::compiled(CubicRegulator, "cubic regulator".to_owned())
}

/// Limits may be infinite.
fn check_limits(limits: &[f64]) -> Result<(), Error> {
    match limits.iter().find(|limit| limit.is_nan() || **limit <= 0.0) {
        Some(found) => Err(input(format!("`torque_limits` must be positive, found {found}"))),
        None => Ok(()),
    }
}

/// Minimum-torque motions of a tree whose joints have one degree of freedom each.
///
/// p = (q, v, λ), running cost ½ Σ γᵢuᵢ².
///
/// Parameters
/// ----------
/// model : Model
///     The tree, of one to four joints.
/// weights : float or array_like, shape (n,), optional
///     γ.
/// torque_limits : float or array_like, shape (n,), optional
///     Largest |u|, N m or N; infinite unless given.
/// passive : sequence of int, optional
///     Joints without torque, by number from 0; one at least must be driven.
///
/// Returns
/// -------
/// System
#[pyfunction]
#[pyo3(signature = (model, weights=None, *, torque_limits=None, passive=vec![]))]
pub(crate) fn tree(
    model: &Bound<'_, Model>,
    weights: Option<&Bound<'_, PyAny>>,
    torque_limits: Option<&Bound<'_, PyAny>>,
    passive: Vec<usize>,
) -> Result<System, Error> {
    let tree = &model.get().model;
    let n = tree.n_velocities();
    let numbers = |name, value: Option<&Bound<'_, PyAny>>, default| {
        value.map_or(Ok(vec![default; n]), |value| numbers_or_one(name, n, value))
    };
    let weights = numbers("weights", weights, 1.0)?;
    let limits = numbers("torque_limits", torque_limits, f64::INFINITY)?;
    check_limits(&limits)?;
    let limited = if torque_limits.is_some() { format!(", torque_limits={limits:?}") } else { String::new() };
    let description = format!("tree of {n} joints, weights={weights:?}, passive={passive:?}{limited}");
    fn of<const N: usize>(
        tree: &somersault::multibody::Model,
        weights: &[f64],
        limits: &[f64],
        passive: &[usize],
        description: String,
    ) -> Result<System, Error> {
        let mut system = TreeMinimumTorque::<N>::try_new(tree, weights)?.try_with_torque_limits(limits)?;
        for &joint in passive {
            system = system.try_with_passive(joint)?;
        }
        Ok(System::compiled(system, description))
    }
    match n {
        1 => of::<4>(tree, &weights, &limits, &passive, description),
        2 => of::<8>(tree, &weights, &limits, &passive, description),
        3 => of::<12>(tree, &weights, &limits, &passive, description),
        4 => of::<16>(tree, &weights, &limits, &passive, description),
        other => Err(input(format!("`model` must have one to four degrees of freedom, found {other}"))),
    }
}
