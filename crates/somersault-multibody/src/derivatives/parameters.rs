//! Derivatives of dynamics with respect to what describes a tree: masses, centres of mass, inertias, and where joints are.
//!
//! The joint forces of inverse dynamics are linear in the spatial inertia I of each body, so that a change I' acts as the wrench
//! ```text
//! f' = I' a + v ×* I' v
//! ```
//! on its body, a with −g. A joint that moves along d in its parent λ carries its body and all further out along. They move as by a
//! sliding joint between the two that is at rest, S = (d, 0), so that by the formulas of [`derivatives`](super)
//! ```text
//! ∂τ_k/∂ℓ = S_k · I^C a',   ∂τ_j/∂ℓ = S_j · (I^C a' + S ×* f^C),   a' = (α_λ × d + ω_λ × (ω_λ × d), 0)
//! ```
//! for k further out than the joint, with I^C of what k carries, and for j on the way to the root, with I^C and f^C of what the
//! joint carries. The frames of the bodies that are carried move by d at the rate ω_λ × d.

use super::{DerivativeData, DerivativeTables};
use crate::data::TreeData;
use crate::error::DynamicsError;
use crate::inertia::SpatialInertia;
use crate::model::Model;
use crate::spatial::{Force, Motion};
use nalgebra::{Matrix3, Vector3};
use somersault_core::argument::{expect_finite, expect_range};
use somersault_integrators::state::Twist;
use somersault_integrators::variation::Tangent;

/// A constant of the description of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TreeParameter {
    /// The mass of a body, kg, with its centre of mass and the inertia about that kept.
    Mass(usize),
    /// The centre of mass of a body along a direction in its axes, m, with mass and inertia about the centre kept.
    Center(usize, Vector3<f64>),
    /// A factor on a symmetric tensor, kg m², that is added to the inertia of a body about its centre of mass, body axes.
    Inertia(usize, Matrix3<f64>),
    /// The position of the joint of a body in its parent, or in the world for the root, along a direction in the axes of that, m. The body
    /// is displaced with its centre of mass, its points of contact, and the bodies that it carries.
    Placement(usize, Vector3<f64>),
}

impl TreeParameter {
    /// The number of the body.
    pub fn body(&self) -> usize {
        match self {
            Self::Mass(body) | Self::Center(body, _) | Self::Inertia(body, _) | Self::Placement(body, _) => {
                *body
            }
        }
    }

    /// Fails unless the model has the body and the numbers are finite, those of a tensor symmetric.
    pub fn check(&self, model: &Model) -> Result<(), DynamicsError> {
        model.expect_body(self.body())?;
        match self {
            Self::Mass(_) => {}
            Self::Center(_, direction) | Self::Placement(_, direction) => {
                expect_finite("direction", direction)?
            }
            Self::Inertia(_, tensor) => {
                expect_finite("inertia", tensor)?;
                let difference = (tensor - tensor.transpose()).amax();
                expect_range(
                    "inertia",
                    difference,
                    "symmetric, with a difference across the diagonal of zero",
                    |x| x == 0.0,
                )?;
            }
        }
        Ok(())
    }
}

impl Model {
    /// The change of the spatial inertia of a body with a parameter; none where it does not depend on it.
    fn inertia_change(&self, parameter: &TreeParameter) -> Option<SpatialInertia<f64>> {
        let mass = self.links().get(parameter.body())?.mass_properties();
        let change = match parameter {
            TreeParameter::Mass(_) => SpatialInertia::new(1.0, &mass.center, &Matrix3::zeros()),
            TreeParameter::Center(_, direction) => {
                // Of a product, by both of its factors: 2 c·d 1 − c dᵀ − d cᵀ.
                let product = mass.center * direction.transpose();
                let shift =
                    Matrix3::from_diagonal_element(2.0 * product.trace()) - product - product.transpose();
                let about_origin = SpatialInertia::new(0.0, &Vector3::zeros(), &(shift * mass.mass));
                SpatialInertia { first_moment: direction * mass.mass, ..about_origin }
            }
            TreeParameter::Inertia(_, tensor) => SpatialInertia::new(0.0, &Vector3::zeros(), tensor),
            TreeParameter::Placement(..) => return None,
        };
        Some(change)
    }

    /// The wrench on its body, body axes, that changes accelerations as the inertia of the body does with a parameter; in the state
    /// of the last partials in the workspace.
    pub(crate) fn inertia_wrench(
        &self,
        work: &DerivativeData,
        parameter: &TreeParameter,
    ) -> Option<Force<f64>> {
        let change = self.inertia_change(parameter)?;
        let (node, body) = (&work.data.tree.nodes[parameter.body()], &work.tables.bodies[parameter.body()]);
        let [velocity, acceleration] =
            [&body.velocity, &body.acceleration].map(|motion| node.pose.inverse_motion(motion));
        Some(-(change.times(&acceleration) + velocity.cross_force(&change.times(&velocity))))
    }

    /// The direction of a placement in the axes of the world, and the motion of the body that the joint is in.
    fn placed(
        &self,
        work: &DerivativeData,
        body: usize,
        direction: &Vector3<f64>,
    ) -> (Vector3<f64>, [Motion<f64>; 2]) {
        match self.bodies[body].parent {
            Some(parent) => {
                let carrier = &work.tables.bodies[parent];
                let turn = &work.data.tree.nodes[parent].pose.rotation;
                (turn * direction, [carrier.velocity, carrier.acceleration])
            }
            None => (*direction, [Motion::zero(); 2]),
        }
    }

    /// Adds to `torque` the joint forces that change accelerations as the placement of the joint of a body does, in the state of the
    /// last partials in the workspace.
    pub(crate) fn add_placement_forces(
        &self,
        work: &mut DerivativeData,
        (body, direction): (usize, &Vector3<f64>),
        torque: &mut [f64],
    ) {
        let (way, [velocity, acceleration]) = self.placed(work, body, direction);
        let (spin, turn) = (velocity.angular, acceleration.angular);
        let gained = Motion::new(turn.cross(&way) + spin.cross(&spin.cross(&way)), Vector3::zeros());
        let DerivativeData { data, tables: DerivativeTables { bodies, .. }, gathered, .. } = work;
        let TreeData { nodes, columns, torque: found, .. } = &mut data.tree;
        found.fill(0.0);
        for i in body..self.bodies.len() {
            if self.carries(body, i) {
                let force = nodes[i].composite.times(&gained);
                for k in self.bodies[i].dofs.clone() {
                    found[k] = -columns[k].dot(&force);
                }
            }
        }
        let shift = Motion::new(way, Vector3::zeros());
        let force = nodes[body].composite.times(&gained) + shift.cross_force(&bodies[body].force);
        let mut inner = self.bodies[body].parent;
        while let Some(i) = inner {
            for k in self.bodies[i].dofs.clone() {
                found[k] = -columns[k].dot(&force);
            }
            inner = self.bodies[i].parent;
        }
        let found = self.gather(found, &mut gathered.value);
        torque.iter_mut().zip(found).for_each(|(torque, found)| *torque += found);
    }

    /// The tangent of the frames of the bodies that the joint of a body carries, world axes, as its placement changes.
    pub(crate) fn placement_tangent(
        &self,
        work: &DerivativeData,
        (body, direction): (usize, &Vector3<f64>),
    ) -> Tangent<Twist> {
        let (way, [velocity, _]) = self.placed(work, body, direction);
        let linear = |linear| Twist { linear, angular: Vector3::zeros() };
        Tangent { displacement: linear(way), rate: linear(velocity.angular.cross(&way)) }
    }

    /// Whether the joint of body `inner` carries body `i`.
    pub(crate) fn carries(&self, inner: usize, i: usize) -> bool {
        std::iter::successors(Some(i), |&i| self.bodies[i].parent).any(|i| i == inner)
    }
}
