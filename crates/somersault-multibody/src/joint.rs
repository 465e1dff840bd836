//! Joints: how a body may move against its parent.
//!
//! | Joint | q | v, in the axes of the child | q ⊕ v |
//! |---|---|---|---|
//! | fixed | – | – | – |
//! | revolute | angle | its rate | sum |
//! | prismatic | displacement | its rate | sum |
//! | spherical | quaternion (x, y, z, w) | ω | q exp(v) on SO(3) |
//! | planar | x, y, angle θ | (v_x, v_y, ω_z) | on SE(2), θ counting whole turns |
//! | free | position, quaternion (x, y, z, w) | (v, ω) | on SE(3) |
//!
//! Joint positions are those of the child in the joint frame, which is fixed in the parent. All
//! velocities are taken in the axes of the child, where the motion subspace S of every joint above is
//! constant: v_child = v_parent + S v and no joint adds a velocity product of its own. The order is
//! linear before angular throughout.

use crate::scalar::Scalar;
use crate::spatial::{Direction, Transform};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// The kinds of joints between a body and its parent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Joint {
    /// No motion.
    Fixed,
    /// Rotation about an axis through the origin of the joint frame; the axis need not be of unit length.
    Revolute {
        /// Axis in the joint frame, any length but zero.
        axis: Vector3<f64>,
    },
    /// Translation along an axis.
    Prismatic {
        /// Axis in the joint frame, any length but zero.
        axis: Vector3<f64>,
    },
    /// Any rotation about the origin of the joint frame.
    Spherical,
    /// Translation in the x–y plane of the joint frame and rotation about its z axis.
    Planar,
    /// Any motion.
    Free,
}

impl Joint {
    /// Numbers in q.
    pub fn n_positions(&self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Revolute { .. } | Self::Prismatic { .. } => 1,
            Self::Spherical => 4,
            Self::Planar => 3,
            Self::Free => 7,
        }
    }

    /// Degrees of freedom: numbers in v.
    pub fn n_velocities(&self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Revolute { .. } | Self::Prismatic { .. } => 1,
            Self::Spherical | Self::Planar => 3,
            Self::Free => 6,
        }
    }

    /// The columns of the motion subspace S, axes already of unit length.
    pub(crate) fn directions<T: Scalar>(&self) -> Vec<Direction<T>> {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        match self {
            Self::Fixed => Vec::new(),
            Self::Revolute { axis } => vec![Direction::Angular(nalgebra::convert(*axis))],
            Self::Prismatic { axis } => vec![Direction::Linear(nalgebra::convert(*axis))],
            Self::Spherical => axes.map(Direction::Angular).to_vec(),
            Self::Planar => {
                vec![Direction::Linear(axes[0]), Direction::Linear(axes[1]), Direction::Angular(axes[2])]
            }
            Self::Free => {
                axes.map(Direction::Linear).into_iter().chain(axes.map(Direction::Angular)).collect()
            }
        }
    }
}

/// A joint with its frame in the parent, prepared for evaluation.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Mechanism<T> {
    Fixed(Transform<T>),
    /// R(q) = constant + cos q · cosine + sin q · sine: Rodrigues' formula times the placement.
    Revolute {
        constant: Matrix3<T>,
        cosine: Matrix3<T>,
        sine: Matrix3<T>,
        origin: Vector3<T>,
    },
    Prismatic {
        rotation: Matrix3<T>,
        origin: Vector3<T>,
        direction: Vector3<T>,
    },
    Spherical(Transform<T>),
    Planar(Transform<T>),
    Free(Transform<T>),
}

/// The quaternion stored in four numbers (x, y, z, w).
#[inline(always)]
pub(crate) fn quaternion<T: Scalar>(q: &[T]) -> Quaternion<T> {
    Quaternion::new(q[3], q[0], q[1], q[2])
}

#[inline(always)]
fn rotation<T: Scalar>(q: &[T]) -> Matrix3<T> {
    UnitQuaternion::new_unchecked(quaternion(q)).to_rotation_matrix().into_inner()
}

impl<T: Scalar> Mechanism<T> {
    /// `placement` is the pose of the joint frame in the parent; axes are of unit length.
    pub(crate) fn new(joint: &Joint, placement: Transform<T>) -> Self {
        let (r, origin) = (placement.rotation, placement.translation);
        match joint {
            Joint::Fixed => Self::Fixed(placement),
            Joint::Revolute { axis } => {
                let axis: Vector3<T> = nalgebra::convert(*axis);
                let along = axis * axis.transpose();
                Self::Revolute {
                    constant: r * along,
                    cosine: r * (Matrix3::identity() - along),
                    sine: r * crate::inertia::hat(&axis),
                    origin,
                }
            }
            Joint::Prismatic { axis } => {
                let axis: Vector3<T> = nalgebra::convert(*axis);
                Self::Prismatic { rotation: r, origin, direction: r * axis }
            }
            Joint::Spherical => Self::Spherical(placement),
            Joint::Planar => Self::Planar(placement),
            Joint::Free => Self::Free(placement),
        }
    }

    /// Pose of the child in the parent.
    #[inline(always)]
    pub(crate) fn transform(&self, q: &[T]) -> Transform<T> {
        match self {
            Self::Fixed(placement) => *placement,
            Self::Revolute { constant, cosine, sine, origin } => {
                let (s, c) = q[0].sin_cos();
                Transform::new(constant + cosine * c + sine * s, *origin)
            }
            Self::Prismatic { rotation, origin, direction } => {
                Transform::new(*rotation, origin + direction * q[0])
            }
            Self::Spherical(placement) => {
                Transform::new(placement.rotation * rotation(q), placement.translation)
            }
            Self::Planar(placement) => {
                let (s, c) = q[2].sin_cos();
                let (o, i) = (T::zero(), T::one());
                let turn = Matrix3::new(c, -s, o, s, c, o, o, o, i);
                placement.compose(&Transform::new(turn, Vector3::new(q[0], q[1], o)))
            }
            Self::Free(placement) => {
                placement.compose(&Transform::new(rotation(&q[3..7]), Vector3::new(q[0], q[1], q[2])))
            }
        }
    }
}
