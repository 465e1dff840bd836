//! The systems of the library.

use super::argument::{pair, pair_or_none, wholes};
use super::dimension::MOST;
use super::system::{GivenTree, Origin, System};
use crate::core::convert::numbers_or_one;
use crate::core::error::Error;
use crate::core::value::few;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use somersault::ftla::system::{ArmMinimumTorque, TreeMinimumTorque};
use somersault::multibody::models::TwoLinkArm;
use std::sync::Arc;

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
    #[pyo3(from_py_with = pair::masses)] masses: [f64; 2],
    #[pyo3(from_py_with = pair::lengths)] lengths: [f64; 2],
    #[pyo3(from_py_with = pair::damping)] damping: [f64; 2],
    #[pyo3(from_py_with = pair::weights)] weights: [f64; 2],
    #[pyo3(from_py_with = pair_or_none::torque_limits)] torque_limits: Option<[f64; 2]>,
) -> Result<System, Error> {
    let mut arm = ArmMinimumTorque::try_new(TwoLinkArm { masses, lengths, damping }, weights)?;
    if let Some(limits) = torque_limits {
        check_limits(&limits)?;
        arm = arm.try_with_torque_limits(limits)?;
    }
    Ok(of_arm(arm))
}

/// The system of an arm.
pub(super) fn of_arm(arm: ArmMinimumTorque) -> System {
    let TwoLinkArm { masses, lengths, damping } = *arm.arm();
    let (weights, limited) = (arm.weights(), limits_text(&arm.torque_limits()));
    let description = format!(
        "arm, masses={masses:?}, lengths={lengths:?}, damping={damping:?}, weights={weights:?}{limited}"
    );
    System::made_from(8, 2, description, Origin::Arm(arm))
}

fn limits_text(limits: &[f64]) -> String {
    if limits.iter().any(|limit| limit.is_finite()) {
        format!(", torque_limits=[{}]", few(limits))
    } else {
        String::new()
    }
}

/// The regulator dx/dt = −x + u with cost ½ ∫ x² + u² dt: linear, with rates ±√2.
///
/// Returns
/// -------
/// System
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> ftla.linear_regulator().jacobian([1.0, 0.4])
/// array([[-1., -1.],
///        [-1.,  1.]])
#[pyfunction]
pub(crate) fn linear_regulator() -> System {
    System::made_from(2, 1, "linear regulator".to_owned(), Origin::LinearRegulator)
}

/// The regulator dx/dt = −x³ + u with cost ½ ∫ x² + u² dt.
///
/// Its manifolds are λ = −x³ ± x √(1 + x⁴), the stable one with the upper sign.
///
/// Returns
/// -------
/// System
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import ftla
/// >>> stable = [1.0, np.sqrt(2) - 1]
/// >>> round(ftla.cubic_regulator().hamiltonian(stable), 9) + 0.0
/// 0.0
#[pyfunction]
pub(crate) fn cubic_regulator() -> System {
    System::made_from(2, 1, "cubic regulator".to_owned(), Origin::CubicRegulator)
}

/// Limits may be infinite.
fn check_limits(limits: &[f64]) -> Result<(), Error> {
    match limits.iter().find(|limit| limit.is_nan() || **limit <= 0.0) {
        Some(found) => Err(Error::input(format!("`torque_limits` must be positive, found {found}"))),
        None => Ok(()),
    }
}

/// Minimum-torque motions of a tree of any joints.
///
/// p = (q, v, λ), running cost ½ Σ γᵢuᵢ². Angles and lengths are their own coordinates. A ball joint has the vector of its
/// rotation from the home position, so that it must stay below a whole turn; a free one has its place and that vector, a
/// planar one place and angle. Velocities v are those of `Model`, in the axes of the child.
///
/// Parameters
/// ----------
/// model : Model
///     The tree, of one to 64 degrees of freedom.
/// weights : float or array_like, shape (n,), optional
///     γ of each degree of freedom.
/// torque_limits : float or array_like, shape (n,), optional
///     Largest |u|, N m or N; infinite unless given.
/// passive : sequence of int, optional
///     Degrees of freedom without torque, by number from 0; one at least must be driven.
///
/// Returns
/// -------
/// System
///
/// Examples
/// --------
/// >>> from somersault import ftla, multibody
/// >>> system = ftla.tree(multibody.two_link_arm(), [1.0, 0.5])
/// >>> system.dimension, system.n_controls
/// (8, 2)
#[pyfunction]
#[pyo3(signature = (model, weights=None, *, torque_limits=None, passive=vec![]))]
pub(crate) fn tree(
    model: &Bound<'_, Model>,
    weights: Option<&Bound<'_, PyAny>>,
    torque_limits: Option<&Bound<'_, PyAny>>,
    #[pyo3(from_py_with = wholes::passive)] passive: Vec<usize>,
) -> Result<System, Error> {
    let tree = &model.get().model;
    let n = tree.n_velocities();
    if !(1..=MOST / 4).contains(&n) {
        return Err(Error::input(format!(
            "`model` must have from 1 to {} degrees of freedom, found {n}",
            MOST / 4
        )));
    }
    for (i, joint) in passive.iter().enumerate() {
        if *joint >= n || passive[..i].contains(joint) {
            let allowed = format!("different numbers of degrees of freedom below {n}");
            return Err(Error::input(format!("`passive` must be {allowed}, found {passive:?}")));
        }
    }
    if passive.len() == n {
        return Err(Error::input("`passive` must leave one degree of freedom driven"));
    }
    let numbers = |name, value: Option<&Bound<'_, PyAny>>, default| {
        value.map_or(Ok(vec![default; n]), |value| numbers_or_one(name, n, value))
    };
    let weights = numbers("weights", weights, 1.0)?;
    let limits = numbers("torque_limits", torque_limits, f64::INFINITY)?;
    check_limits(&limits)?;
    let limited = limits_text(&limits);
    let description = format!(
        "tree of {n} degrees of freedom, weights=[{}], passive=[{}]{limited}",
        few(&weights),
        few(&passive)
    );
    let mut system = TreeMinimumTorque::try_new(tree, &weights)?.try_with_torque_limits(&limits)?;
    for &joint in &passive {
        system = system.try_with_passive(joint)?;
    }
    let (model, system) = (model.clone().unbind(), Arc::new(system));
    let given = GivenTree { model, weights, limits, passive, system };
    Ok(System::made_from(4 * n, n, description, Origin::Tree(given)))
}
