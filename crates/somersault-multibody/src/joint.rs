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

use crate::spatial::{Direction, Force, Motion, Transform};
use crate::triples::{lifted, matrix_lifted, matrix_scaled, matrix_sum, product, scaled, sum};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use somersault_core::Scalar;
use somersault_core::lie::se3;
use somersault_core::lie::so3::{hat, matrix_of_xyzw};
use somersault_core::scalar::Lift;
use std::ops::Range;

/// The kinds of joints between a body and its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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

/// How a kind of joint turns its child.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turning {
    /// Not at all.
    None,
    /// About an axis: an angle in q, its rate in v.
    Angle,
    /// In any way: a quaternion in q, three numbers in v.
    Rotation,
}

/// The group that the displacements of a kind of joint are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// ℝⁿ: displacements are added.
    Vector,
    /// SO(3).
    Rotations,
    /// SE(2), the angle counting whole turns.
    PlanarMotions,
    /// SE(3).
    Motions,
}

/// A kind of joint as data: what depends on the kind is asked of this row.
///
/// A new kind is a row here, its pose, and its name in URDF and in Python; the compiler asks for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct JointKind {
    /// The name, in lower case.
    pub name: &'static str,
    /// Linear numbers, the first ones of q and of v.
    pub n_linear: usize,
    /// What follows them.
    pub turning: Turning,
}

impl JointKind {
    const fn new(name: &'static str, n_linear: usize, turning: Turning) -> Self {
        Self { name, n_linear, turning }
    }

    /// Numbers in q.
    pub const fn n_positions(&self) -> usize {
        self.n_linear
            + match self.turning {
                Turning::None => 0,
                Turning::Angle => 1,
                Turning::Rotation => 4,
            }
    }

    /// Degrees of freedom: numbers in v.
    pub const fn n_velocities(&self) -> usize {
        self.n_linear
            + match self.turning {
                Turning::None => 0,
                Turning::Angle => 1,
                Turning::Rotation => 3,
            }
    }

    /// Where q has the orientation, counted from the joint's first number.
    pub const fn orientation(&self) -> Range<usize> {
        self.n_linear..self.n_positions()
    }

    /// Where q has a quaternion, counted from the joint's first number.
    pub const fn quaternion(&self) -> Option<Range<usize>> {
        match self.turning {
            Turning::Rotation => Some(self.orientation()),
            Turning::None | Turning::Angle => None,
        }
    }

    /// The group of its displacements. An angle turns two linear numbers, which are across its axis, but not a single one, which is
    /// along it.
    pub const fn group(&self) -> Group {
        match (self.turning, self.n_linear) {
            (Turning::None, _) | (Turning::Angle, 0 | 1) => Group::Vector,
            (Turning::Angle, _) => Group::PlanarMotions,
            (Turning::Rotation, 0) => Group::Rotations,
            (Turning::Rotation, _) => Group::Motions,
        }
    }
}

impl Joint {
    /// The row of its kind.
    pub const fn kind(&self) -> JointKind {
        match self {
            Self::Fixed => JointKind::new("fixed", 0, Turning::None),
            Self::Revolute { .. } => JointKind::new("revolute", 0, Turning::Angle),
            Self::Prismatic { .. } => JointKind::new("prismatic", 1, Turning::None),
            Self::Spherical => JointKind::new("spherical", 0, Turning::Rotation),
            Self::Planar => JointKind::new("planar", 2, Turning::Angle),
            Self::Free => JointKind::new("free", 3, Turning::Rotation),
        }
    }

    /// The group of its displacements.
    pub const fn group(&self) -> Group {
        self.kind().group()
    }

    /// The axis of a hinge: of a joint that turns about an axis given, and does nothing else.
    pub const fn hinge(&self) -> Option<&Vector3<f64>> {
        let JointKind { n_linear, turning, .. } = self.kind();
        if n_linear == 0 && matches!(turning, Turning::Angle) { self.axis() } else { None }
    }

    /// The axis, where it is given one.
    pub const fn axis(&self) -> Option<&Vector3<f64>> {
        match self {
            Self::Revolute { axis } | Self::Prismatic { axis } => Some(axis),
            Self::Fixed | Self::Spherical | Self::Planar | Self::Free => None,
        }
    }

    /// The axis, to be changed.
    pub(crate) const fn axis_mut(&mut self) -> Option<&mut Vector3<f64>> {
        match self {
            Self::Revolute { axis } | Self::Prismatic { axis } => Some(axis),
            Self::Fixed | Self::Spherical | Self::Planar | Self::Free => None,
        }
    }

    /// Numbers in q.
    pub const fn n_positions(&self) -> usize {
        self.kind().n_positions()
    }

    /// Degrees of freedom: numbers in v.
    pub const fn n_velocities(&self) -> usize {
        self.kind().n_velocities()
    }

    /// Column `k` of the motion subspace S, axes already of unit length: a linear number is along the axis given, or along x, y
    /// or z; a turn is about the axis given, about z for an angle without one, or about x, y or z.
    pub(crate) fn direction<T: Scalar>(&self, k: usize) -> Direction<T> {
        let JointKind { n_linear, turning, .. } = self.kind();
        let unit = |i: usize| Vector3::ith(i, T::one());
        let given = self.axis().map(|axis| nalgebra::convert(*axis));
        if k < n_linear {
            return Direction::Linear(given.unwrap_or_else(|| unit(k)));
        }
        Direction::Angular(match turning {
            Turning::None | Turning::Rotation => unit(k - n_linear),
            Turning::Angle => given.unwrap_or_else(|| unit(2)),
        })
    }

    /// S v: numbers `v` of this joint, velocities or a displacement, as a motion in the axes of the child.
    pub fn motion(&self, v: &[f64]) -> Motion<f64> {
        let mut motion = Motion::zero();
        (0..self.n_velocities()).zip(v).for_each(|(k, rate)| self.direction(k).add_to(&mut motion, *rate));
        motion
    }

    /// A and J of a displacement with numbers `d` of this joint, which displacements ε obey,
    ///
    /// ```text
    /// (q ⊕ ε) ⊕ d = (q ⊕ d) ⊕ A ε,        A = Ad(exp d)⁻¹
    /// q ⊕ (d + ε) = (q ⊕ d) ⊕ J ε + O(ε²), J = J_r(d)
    /// ```
    /// with ones on the diagonal beyond the joint's degrees of freedom.
    pub fn displacement_maps(&self, d: &[f64]) -> [Matrix6<f64>; 2] {
        let Motion { linear, angular } = self.motion(d);
        let of_motions =
            [se3::adjoint(&se3::exp(&-linear, &-angular)), se3::right_jacobian(&linear, &angular)];
        let n = self.n_velocities();
        of_motions.map(|matrix| {
            let mut own = Matrix6::identity();
            for k in 0..n {
                let mut unit = [0.0; 6];
                unit[k] = 1.0;
                let Motion { linear, angular } = self.motion(&unit[..n]);
                let moved = matrix * Vector6::from_iterator(linear.iter().chain(&angular).copied());
                let moved = Motion::new(moved.fixed_rows::<3>(0).into(), moved.fixed_rows::<3>(3).into());
                self.numbers(&moved, &mut own.column_mut(k).as_mut_slice()[..n]);
            }
            own
        })
    }

    /// out ← Sᵀ m: the numbers of this joint of a motion `m` in the axes of the child.
    pub fn numbers(&self, m: &Motion<f64>, out: &mut [f64]) {
        let m = Force { linear: m.linear, angular: m.angular };
        (0..self.n_velocities()).zip(out).for_each(|(k, out)| *out = self.direction(k).dot(&m));
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
                    sine: r * hat(&axis),
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
    pub(crate) fn transform_in<N: Lift<T>>(&self, proof: N::Proof, q: &[N]) -> Transform<N> {
        match self {
            Self::Fixed(placement) => placement.lift(proof),
            Self::Revolute { constant, cosine, sine, origin } => {
                let (s, c) = q[0].sine_and_cosine();
                let (cosine, sine) = (matrix_lifted(proof, cosine), matrix_lifted(proof, sine));
                let turned = matrix_sum(&matrix_lifted(proof, constant), &matrix_scaled(&cosine, c));
                Transform::new(matrix_sum(&turned, &matrix_scaled(&sine, s)), lifted(proof, origin))
            }
            Self::Prismatic { rotation, origin, direction } => Transform::new(
                matrix_lifted(proof, rotation),
                sum(&lifted(proof, origin), &scaled(&lifted(proof, direction), q[0])),
            ),
            Self::Spherical(placement) => {
                let Transform { rotation, translation } = placement.lift(proof);
                Transform::new(product(&rotation, &matrix_of_xyzw(q)), translation)
            }
            Self::Planar(placement) => {
                let (s, c) = q[2].sine_and_cosine();
                let (o, i) = (N::lift(proof, T::zero()), N::lift(proof, T::one()));
                let turn = Matrix3::new(c, -s, o, s, c, o, o, o, i);
                placement.lift(proof).compose(&Transform::new(turn, Vector3::new(q[0], q[1], o)))
            }
            Self::Free(placement) => {
                let moved = Transform::new(matrix_of_xyzw(&q[3..7]), Vector3::new(q[0], q[1], q[2]));
                placement.lift(proof).compose(&moved)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_of_a_motion_of_a_joint_are_those_it_was_made_of() {
        let axis = Vector3::new(0.6, 0.0, -0.8);
        let joints = [
            Joint::Fixed,
            Joint::Revolute { axis },
            Joint::Prismatic { axis },
            Joint::Spherical,
            Joint::Planar,
            Joint::Free,
        ];
        let v = [0.3, -0.2, 0.7, 1.1, -0.4, 0.9];
        for joint in joints {
            let n = joint.n_velocities();
            let mut found = [0.0; 6];
            joint.numbers(&joint.motion(&v[..n]), &mut found[..n]);
            assert!(found[..n].iter().zip(&v).all(|(a, b)| (a - b).abs() < 1e-15), "{joint:?}: {found:?}");
            let kind = joint.kind();
            assert_eq!(kind.quaternion().is_some(), joint.n_positions() > n, "{joint:?}");
            assert_eq!(kind.orientation().end, joint.n_positions(), "{joint:?}");
        }
        assert_eq!(Joint::Planar.motion(&[1.0, 2.0, 3.0]).angular, Vector3::z() * 3.0);
        assert_eq!(Joint::Free.motion(&v).linear, Vector3::new(0.3, -0.2, 0.7));
    }
}
