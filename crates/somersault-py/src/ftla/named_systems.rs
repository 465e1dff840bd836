//! The systems of the library.

use super::argument::{pair, pair_or_none, wholes};
use super::error::input;
use super::system::{Origin, System};
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
    System::compiled(arm, description, Origin::Arm(arm))
}

fn limits_text(limits: &[f64]) -> String {
    if limits.iter().any(|limit| limit.is_finite()) {
        format!(", torque_limits={limits:?}")
    } else {
        String::new()
    }
}

/// The regulator dx/dt = −x + u with cost ½ ∫ x² + u² dt: linear, with rates ±√2.
///
/// Returns
/// -------
/// System
#[pyfunction]
pub(crate) fn linear_regulator() -> System {
    System::compiled(LinearRegulator, "linear regulator".to_owned(), Origin::Regulator("linear_regulator"))
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
    System::compiled(CubicRegulator, "cubic regulator".to_owned(), Origin::Regulator("cubic_regulator"))
}

/// What the system of a tree is made from.
pub(super) struct GivenTree {
    pub(super) model: Py<Model>,
    pub(super) weights: Vec<f64>,
    pub(super) limits: Vec<f64>,
    pub(super) passive: Vec<usize>,
}

impl GivenTree {
    /// The system, made anew; `N` is four times the degrees of freedom.
    pub(super) fn system<const N: usize>(&self, py: Python<'_>) -> Result<TreeMinimumTorque<N>, Error> {
        let tree = &self.model.bind(py).get().model;
        let mut system =
            TreeMinimumTorque::try_new(tree, &self.weights)?.try_with_torque_limits(&self.limits)?;
        for &joint in &self.passive {
            system = system.try_with_passive(joint)?;
        }
        Ok(system)
    }
}

/// Limits may be infinite.
fn check_limits(limits: &[f64]) -> Result<(), Error> {
    match limits.iter().find(|limit| limit.is_nan() || **limit <= 0.0) {
        Some(found) => Err(input(format!("`torque_limits` must be positive, found {found}"))),
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
///     The tree, of one to six degrees of freedom. (The Rust library has any number.)
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
    for (i, joint) in passive.iter().enumerate() {
        if *joint >= n || passive[..i].contains(joint) {
            let allowed = format!("different numbers of degrees of freedom below {n}");
            return Err(input(format!("`passive` must be {allowed}, found {passive:?}")));
        }
    }
    if n > 0 && passive.len() == n {
        return Err(input("`passive` must leave one degree of freedom driven".to_owned()));
    }
    let numbers = |name, value: Option<&Bound<'_, PyAny>>, default| {
        value.map_or(Ok(vec![default; n]), |value| numbers_or_one(name, n, value))
    };
    let weights = numbers("weights", weights, 1.0)?;
    let limits = numbers("torque_limits", torque_limits, f64::INFINITY)?;
    check_limits(&limits)?;
    let limited = limits_text(&limits);
    let description =
        format!("tree of {n} degrees of freedom, weights={weights:?}, passive={passive:?}{limited}");
    fn of<const N: usize>(
        model: &Bound<'_, Model>,
        given: GivenTree,
        description: String,
    ) -> Result<System, Error> {
        let system = given.system::<N>(model.py())?;
        Ok(System::compiled(system, description, Origin::Tree(given)))
    }
    let given = GivenTree { model: model.clone().unbind(), weights, limits, passive };
    match n {
        1 => of::<4>(model, given, description),
        2 => of::<8>(model, given, description),
        3 => of::<12>(model, given, description),
        4 => of::<16>(model, given, description),
        5 => of::<20>(model, given, description),
        6 => of::<24>(model, given, description),
        other => Err(input(format!("`model` must have one to six degrees of freedom, found {other}"))),
    }
}
