//! Where a body of a tree is and how it is turned.

use super::{Node, NodeGradient, Term};
use crate::dynamics::undefined;
use crate::error::OcpError;
use nalgebra::{DMatrix, Rotation3, UnitQuaternion, Vector3};
use somersault_core::argument::expect_finite;
use somersault_core::lie::so3;
use somersault_multibody::{Axes, Data, Model, Transform};
use somersault_nlp::EvaluationError;

/// A frame in a body, with room for its Jacobian.
#[derive(Debug, Clone)]
struct Frame {
    model: Model,
    data: Data,
    body: usize,
    frame: Transform<f64>,
    jacobian: DMatrix<f64>,
}

impl Frame {
    fn try_new(model: Model, body: &str, origin: Vector3<f64>) -> Result<Self, OcpError> {
        expect_finite("point", origin.as_slice())?;
        Ok(Self {
            body: model.body(body)?,
            data: Data::new(&model),
            jacobian: DMatrix::zeros(6, model.n_velocities()),
            frame: Transform::translation(origin),
            model,
        })
    }

    fn pose(&mut self, node: &Node<'_>) -> Result<Transform<f64>, EvaluationError> {
        let positions = self.model.positions(&mut self.data, node.position).map_err(undefined)?;
        Ok(positions.pose(self.body).map_err(undefined)?.compose(&self.frame))
    }

    /// Adds Jᵀ y to the gradient by position, J the angular rows (first 3) or the linear ones (first 0).
    fn pull_back(
        &mut self,
        node: &Node<'_>,
        axes: Axes,
        first: usize,
        y: &Vector3<f64>,
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        let positions = self.model.positions(&mut self.data, node.position).map_err(undefined)?;
        positions.jacobian_into(self.body, &self.frame, axes, &mut self.jacobian).map_err(undefined)?;
        for (g, column) in gradient.position.iter_mut().zip(self.jacobian.column_iter()) {
            *g += column.fixed_rows::<3>(first).dot(y);
        }
        Ok(())
    }
}

fn vector(y: &[f64]) -> Vector3<f64> {
    Vector3::new(y[0], y[1], y[2])
}

/// The position of a point of a body in the world, m.
#[derive(Debug, Clone)]
pub struct PointPosition(Frame);

impl PointPosition {
    /// Of `point`, in the axes of the named body from its origin.
    pub fn try_new(model: Model, body: &str, point: Vector3<f64>) -> Result<Self, OcpError> {
        Frame::try_new(model, body, point).map(Self)
    }
}

impl Term for PointPosition {
    fn name(&self) -> &str {
        "point position"
    }

    fn n_rows(&self) -> usize {
        3
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
        rows.copy_from_slice(self.0.pose(node)?.translation.as_slice());
        Ok(())
    }

    fn pull_back(
        &mut self,
        node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        self.0.pull_back(node, Axes::World, 0, &vector(y), gradient)
    }
}

/// An axis of a body in the axes of the world.
#[derive(Debug, Clone)]
pub struct AxisDirection {
    frame: Frame,
    axis: Vector3<f64>,
}

impl AxisDirection {
    /// Of `axis`, fixed in the named body; its length is kept, and not zero.
    pub fn try_new(model: Model, body: &str, axis: Vector3<f64>) -> Result<Self, OcpError> {
        expect_finite("axis", axis.as_slice())?;
        if axis == Vector3::zeros() {
            return Err(OcpError::Zero { argument: "axis".to_owned() });
        }
        Ok(Self { frame: Frame::try_new(model, body, Vector3::zeros())?, axis })
    }
}

impl Term for AxisDirection {
    fn name(&self) -> &str {
        "axis direction"
    }

    fn n_rows(&self) -> usize {
        3
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
        let direction = self.frame.pose(node)?.rotation * self.axis;
        rows.copy_from_slice(direction.as_slice());
        Ok(())
    }

    fn pull_back(
        &mut self,
        node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        let direction = self.frame.pose(node)?.rotation * self.axis;
        // δ(R a) = δω × R a
        self.frame.pull_back(node, Axes::World, 3, &direction.cross(&vector(y)), gradient)
    }
}

/// The rotation of a body from a wanted orientation, as the rotation vector of least length in body axes, rad.
#[derive(Debug, Clone)]
pub struct BodyOrientation {
    frame: Frame,
    target: UnitQuaternion<f64>,
}

impl BodyOrientation {
    /// Of the named body, from `target` (body to world). Differentiable below a half turn.
    pub fn try_new(model: Model, body: &str, target: UnitQuaternion<f64>) -> Result<Self, OcpError> {
        expect_finite("target", target.coords.as_slice())?;
        Ok(Self { frame: Frame::try_new(model, body, Vector3::zeros())?, target })
    }

    fn turn(&mut self, node: &Node<'_>) -> Result<Vector3<f64>, EvaluationError> {
        let rotation = Rotation3::from_matrix_unchecked(self.frame.pose(node)?.rotation);
        Ok(so3::log(&(self.target.inverse() * UnitQuaternion::from_rotation_matrix(&rotation))))
    }
}

impl Term for BodyOrientation {
    fn name(&self) -> &str {
        "body orientation"
    }

    fn n_rows(&self) -> usize {
        3
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn evaluate(&mut self, node: &Node<'_>, rows: &mut [f64]) -> Result<(), EvaluationError> {
        rows.copy_from_slice(self.turn(node)?.as_slice());
        Ok(())
    }

    fn pull_back(
        &mut self,
        node: &Node<'_>,
        y: &[f64],
        gradient: &mut NodeGradient,
    ) -> Result<(), EvaluationError> {
        // u changes by dexp⁻¹(−u) ω with ω in body axes; its transpose is dexp⁻¹(u)
        let turn = self.turn(node)?;
        self.frame.pull_back(node, Axes::Frame, 3, &so3::dexp_inv(&turn, &vector(y)), gradient)
    }
}
