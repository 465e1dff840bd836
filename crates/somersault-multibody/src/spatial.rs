//! Spatial vectors and transforms at fixed size (Featherstone 2008, chapter 2).
//!
//! A [`Motion`] is a velocity or an acceleration, a [`Force`] a wrench or a momentum; both are given by
//! a linear part at the origin of the frame they are written in, and an angular part, in this order.
//! With m₁ = (v₁, ω₁), m₂ = (v₂, ω₂) and f = (f, n):
//!
//! m₁ × m₂ = (ω₁ × v₂ + v₁ × ω₂, ω₁ × ω₂),  m₁ ×* f = (ω₁ × f, ω₁ × n + v₁ × f),  m·f = v·f + ω·n.
//!
//! A [`Transform`] (R, p) is the pose of a frame B in a frame A: x_A = R x_B + p.

use crate::triples::{
    cross, difference, dot, lifted, matrix_lifted, negative, product, scaled, sum, times, transposed_times,
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use somersault_core::Scalar;
use somersault_core::scalar::{Arithmetic, Lift};
use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// Spatial velocity (m/s, rad/s) or acceleration (m/s², rad/s²).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion<T> {
    /// Of the point at the origin of the frame.
    pub linear: Vector3<T>,
    /// Of the body.
    pub angular: Vector3<T>,
}

/// Wrench (N, N m) or momentum (kg m/s, kg m²/s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Force<T> {
    /// Resultant force or linear momentum.
    pub linear: Vector3<T>,
    /// Moment about the origin of the frame.
    pub angular: Vector3<T>,
}

macro_rules! vector_space {
    ($name:ident) => {
        impl<T: Arithmetic> $name<T> {
            /// From its two parts.
            #[inline(always)]
            pub fn new(linear: Vector3<T>, angular: Vector3<T>) -> Self {
                Self { linear, angular }
            }
            /// The same constant in other arithmetic.
            #[inline(always)]
            pub(crate) fn lift<N: Lift<T>>(&self, proof: N::Proof) -> $name<N> {
                $name::new(lifted(proof, &self.linear), lifted(proof, &self.angular))
            }
        }
        impl<T: Scalar> $name<T> {
            /// Zero.
            #[inline(always)]
            pub fn zero() -> Self {
                Self::new(Vector3::zeros(), Vector3::zeros())
            }
        }
        impl<T: Arithmetic> Add for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self::new(sum(&self.linear, &other.linear), sum(&self.angular, &other.angular))
            }
        }
        impl<T: Arithmetic> Sub for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self::new(difference(&self.linear, &other.linear), difference(&self.angular, &other.angular))
            }
        }
        impl<T: Arithmetic> Neg for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self::new(negative(&self.linear), negative(&self.angular))
            }
        }
        impl<T: Arithmetic> Mul<T> for $name<T> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, factor: T) -> Self {
                Self::new(scaled(&self.linear, factor), scaled(&self.angular, factor))
            }
        }
        impl<T: Arithmetic> AddAssign for $name<T> {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
        impl<T: Arithmetic> SubAssign for $name<T> {
            #[inline(always)]
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }
    };
}
vector_space!(Motion);
vector_space!(Force);

impl<T: Arithmetic> Motion<T> {
    /// self × other: the rate of a motion vector carried along by this velocity.
    #[inline(always)]
    pub fn cross(&self, other: &Self) -> Self {
        Self::new(
            sum(&cross(&self.angular, &other.linear), &cross(&self.linear, &other.angular)),
            cross(&self.angular, &other.angular),
        )
    }

    /// self ×* force: the rate of a force vector carried along by this velocity.
    #[inline(always)]
    pub fn cross_force(&self, force: &Force<T>) -> Force<T> {
        Force::new(
            cross(&self.angular, &force.linear),
            sum(&cross(&self.angular, &force.angular), &cross(&self.linear, &force.linear)),
        )
    }

    /// Power of a force (W for a velocity and a wrench).
    #[inline(always)]
    pub fn dot(&self, force: &Force<T>) -> T {
        dot(&self.linear, &force.linear) + dot(&self.angular, &force.angular)
    }

    /// The same motion with its linear part taken at `point`, axes unchanged.
    #[inline(always)]
    pub fn at(&self, point: &Vector3<T>) -> Self {
        Self::new(sum(&self.linear, &cross(&self.angular, point)), self.angular)
    }
}

impl<T: Arithmetic> Force<T> {
    /// The same force with its moment taken about `point`, axes unchanged.
    #[inline(always)]
    pub fn about(&self, point: &Vector3<T>) -> Self {
        Self::new(self.linear, difference(&self.angular, &cross(point, &self.linear)))
    }
}

/// A unit motion that is purely linear or purely angular. The columns of every motion subspace here are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Direction<T> {
    Linear(Vector3<T>),
    Angular(Vector3<T>),
}

impl<T: Arithmetic> Direction<T> {
    /// The same in other arithmetic.
    #[inline(always)]
    pub(crate) fn lift<N: Lift<T>>(&self, proof: N::Proof) -> Direction<N> {
        match self {
            Self::Linear(axis) => Direction::Linear(lifted(proof, axis)),
            Self::Angular(axis) => Direction::Angular(lifted(proof, axis)),
        }
    }

    #[inline(always)]
    pub(crate) fn dot(&self, force: &Force<T>) -> T {
        match self {
            Self::Linear(axis) => dot(axis, &force.linear),
            Self::Angular(axis) => dot(axis, &force.angular),
        }
    }

    #[inline(always)]
    pub(crate) fn add_to(&self, motion: &mut Motion<T>, rate: T) {
        match self {
            Self::Linear(axis) => motion.linear = sum(&motion.linear, &scaled(axis, rate)),
            Self::Angular(axis) => motion.angular = sum(&motion.angular, &scaled(axis, rate)),
        }
    }
}

impl<T: Scalar> Direction<T> {
    /// This direction, fixed in a frame of the given pose, in the outer frame.
    #[inline(always)]
    pub(crate) fn seen_from<N: Lift<T>>(&self, proof: N::Proof, pose: &Transform<N>) -> Motion<N> {
        match self {
            Self::Linear(axis) => {
                Motion::new(times(&pose.rotation, &lifted(proof, axis)), lifted(proof, &Vector3::zeros()))
            }
            Self::Angular(axis) => {
                let angular = times(&pose.rotation, &lifted(proof, axis));
                Motion::new(cross(&pose.translation, &angular), angular)
            }
        }
    }
}

/// Pose (R, p) of an inner frame in an outer one: x_outer = R x_inner + p.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform<T> {
    /// R, inner axes → outer axes.
    pub rotation: Matrix3<T>,
    /// p, the inner origin in the outer frame, m.
    pub translation: Vector3<T>,
}

impl<T: Arithmetic> Transform<T> {
    /// From its two parts; `rotation` must be a rotation.
    #[inline(always)]
    pub fn new(rotation: Matrix3<T>, translation: Vector3<T>) -> Self {
        Self { rotation, translation }
    }

    /// The same constant in other arithmetic.
    #[inline(always)]
    pub(crate) fn lift<N: Lift<T>>(&self, proof: N::Proof) -> Transform<N> {
        Transform::new(matrix_lifted(proof, &self.rotation), lifted(proof, &self.translation))
    }

    /// The pose, in the outer frame, of a frame whose pose in the inner frame is `inner`.
    #[inline(always)]
    pub fn compose(&self, inner: &Self) -> Self {
        Self::new(product(&self.rotation, &inner.rotation), self.point(&inner.translation))
    }

    /// A point from inner to outer coordinates.
    #[inline(always)]
    pub fn point(&self, inner: &Vector3<T>) -> Vector3<T> {
        sum(&times(&self.rotation, inner), &self.translation)
    }

    /// A motion from inner to outer coordinates.
    #[inline(always)]
    pub fn motion(&self, inner: &Motion<T>) -> Motion<T> {
        let angular = times(&self.rotation, &inner.angular);
        let linear = times(&self.rotation, &inner.linear);
        Motion::new(sum(&linear, &cross(&self.translation, &angular)), angular)
    }

    /// A motion from outer to inner coordinates.
    #[inline(always)]
    pub fn inverse_motion(&self, outer: &Motion<T>) -> Motion<T> {
        let at_origin = sum(&outer.linear, &cross(&outer.angular, &self.translation));
        Motion::new(
            transposed_times(&self.rotation, &at_origin),
            transposed_times(&self.rotation, &outer.angular),
        )
    }

    /// A force from inner to outer coordinates.
    #[inline(always)]
    pub fn force(&self, inner: &Force<T>) -> Force<T> {
        let linear = times(&self.rotation, &inner.linear);
        let angular = times(&self.rotation, &inner.angular);
        Force::new(linear, sum(&angular, &cross(&self.translation, &linear)))
    }

    /// A force from outer to inner coordinates.
    #[inline(always)]
    pub fn inverse_force(&self, outer: &Force<T>) -> Force<T> {
        let about_origin = difference(&outer.angular, &cross(&self.translation, &outer.linear));
        Force::new(
            transposed_times(&self.rotation, &outer.linear),
            transposed_times(&self.rotation, &about_origin),
        )
    }
}

impl<T: Scalar> Transform<T> {
    /// The two frames coincide.
    pub fn identity() -> Self {
        Self::new(Matrix3::identity(), Vector3::zeros())
    }

    /// Parallel axes, origin displaced.
    pub fn translation(translation: Vector3<T>) -> Self {
        Self::new(Matrix3::identity(), translation)
    }

    /// From a quaternion and the origin.
    pub fn from_parts(rotation: &UnitQuaternion<T>, translation: Vector3<T>) -> Self {
        Self::new(rotation.to_rotation_matrix().into_inner(), translation)
    }
}
