//! Spatial inertia of a rigid body and of an articulated one (Featherstone 2008, sections 2.13 and 7.1).
//!
//! With the linear part first,
//!
//! rigid: (f, n) = (m v + ω × h, h × v + I ω),  articulated: (f, n) = (M a + H α, Hᵀ a + I α),
//!
//! where m is the mass, h = m c the first moment of mass and I the rotational inertia about the origin
//! of the frame (not about the centre of mass c).

use crate::spatial::{Direction, Force, Motion, Transform};
use nalgebra::{Matrix3, Vector3};
use somersault_core::lie::so3::hat;
use somersault_core::scalar::{Scalar, constant};
use std::ops::AddAssign;

/// A symmetric 3 × 3 matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Symmetric3<T> {
    xx: T,
    xy: T,
    xz: T,
    yy: T,
    yz: T,
    zz: T,
}

impl<T: Scalar> Symmetric3<T> {
    #[inline(always)]
    fn diagonal(d: T) -> Self {
        let o = T::zero();
        Self { xx: d, xy: o, xz: o, yy: d, yz: o, zz: d }
    }

    /// From the upper triangle.
    #[inline(always)]
    fn upper(m: &Matrix3<T>) -> Self {
        Self { xx: m.m11, xy: m.m12, xz: m.m13, yy: m.m22, yz: m.m23, zz: m.m33 }
    }

    #[inline(always)]
    pub(crate) fn times(&self, v: &Vector3<T>) -> Vector3<T> {
        Vector3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    #[inline(always)]
    pub(crate) fn full(&self) -> Matrix3<T> {
        Matrix3::new(self.xx, self.xy, self.xz, self.xy, self.yy, self.yz, self.xz, self.yz, self.zz)
    }

    /// R S Rᵀ.
    #[inline(always)]
    fn rotated(&self, r: &Matrix3<T>) -> Self {
        let (x, y, z) = (r.row(0).transpose(), r.row(1).transpose(), r.row(2).transpose());
        let (sx, sy, sz) = (self.times(&x), self.times(&y), self.times(&z));
        Self {
            xx: x.dot(&sx),
            xy: x.dot(&sy),
            xz: x.dot(&sz),
            yy: y.dot(&sy),
            yz: y.dot(&sz),
            zz: z.dot(&sz),
        }
    }

    /// self − u uᵀ s
    #[inline(always)]
    fn subtract_square(&mut self, u: &Vector3<T>, s: T) {
        let w = u * s;
        self.xx -= u.x * w.x;
        self.xy -= u.x * w.y;
        self.xz -= u.x * w.z;
        self.yy -= u.y * w.y;
        self.yz -= u.y * w.z;
        self.zz -= u.z * w.z;
    }
}

impl<T: Scalar> AddAssign for Symmetric3<T> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        self.xx += o.xx;
        self.xy += o.xy;
        self.xz += o.xz;
        self.yy += o.yy;
        self.yz += o.yz;
        self.zz += o.zz;
    }
}

/// û m: the cross product of `u` with every column of `m`.
#[inline(always)]
fn hat_times<T: Scalar>(u: &Vector3<T>, m: &Matrix3<T>) -> Matrix3<T> {
    let column = |c: usize| u.cross(&m.column(c).into_owned());
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}

/// Spatial inertia of a rigid body about the origin of a frame: 10 numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpatialInertia<T> {
    pub(crate) mass: T,
    pub(crate) first_moment: Vector3<T>,
    pub(crate) rotational: Symmetric3<T>,
}

impl<T: Scalar> SpatialInertia<T> {
    /// From the mass (kg), the centre of mass (m) and the inertia tensor about it (kg m²), all in one
    /// frame; of the tensor the upper triangle is read.
    pub fn new(mass: T, center: &Vector3<T>, about_center: &Matrix3<T>) -> Self {
        let at_center =
            Self { mass, first_moment: Vector3::zeros(), rotational: Symmetric3::upper(about_center) };
        at_center.seen_from(&Transform::translation(*center))
    }

    pub(crate) fn zero() -> Self {
        Self { mass: T::zero(), first_moment: Vector3::zeros(), rotational: Symmetric3::diagonal(T::zero()) }
    }

    /// Mass, kg.
    pub fn mass(&self) -> T {
        self.mass
    }

    /// m c, mass times centre of mass, kg m.
    pub fn first_moment(&self) -> Vector3<T> {
        self.first_moment
    }

    /// Rotational inertia about the origin of the frame, kg m².
    pub fn rotational(&self) -> Matrix3<T> {
        self.rotational.full()
    }

    /// The momentum of the body moving at `motion`.
    #[inline(always)]
    pub fn times(&self, motion: &Motion<T>) -> Force<T> {
        Force::new(
            motion.linear * self.mass + motion.angular.cross(&self.first_moment),
            self.rotational.times(&motion.angular) + self.first_moment.cross(&motion.linear),
        )
    }

    /// The inertia of a body fixed in a frame of the given pose, about the outer origin in outer axes:
    /// h' = R h + m p, I' = R I Rᵀ + (m p·p + 2 p·Rh) 1 − m p pᵀ − p (Rh)ᵀ − (Rh) pᵀ.
    #[inline(always)]
    pub fn seen_from(&self, pose: &Transform<T>) -> Self {
        let p = &pose.translation;
        let h = pose.rotation * self.first_moment;
        let mut rotational = self.rotational.rotated(&pose.rotation);
        // with g = h + m p / 2 the shift is 2 (p·g) 1 − p gᵀ − g pᵀ
        let g = h + p * (self.mass * constant(0.5));
        let (x, y, z) = (p.x * g.x, p.y * g.y, p.z * g.z);
        let two = |a: T| a + a;
        rotational += Symmetric3 {
            xx: two(y + z),
            xy: -(p.x * g.y + p.y * g.x),
            xz: -(p.x * g.z + p.z * g.x),
            yy: two(x + z),
            yz: -(p.y * g.z + p.z * g.y),
            zz: two(x + y),
        };
        Self { mass: self.mass, first_moment: h + p * self.mass, rotational }
    }
}

impl<T: Scalar> AddAssign for SpatialInertia<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.first_moment += other.first_moment;
        self.rotational += other.rotational;
    }
}

/// Inertia of a body with joints that give way: a symmetric positive semi-definite 6 × 6 matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ArticulatedInertia<T> {
    linear: Symmetric3<T>,
    coupling: Matrix3<T>,
    rotational: Symmetric3<T>,
}

impl<T: Scalar> ArticulatedInertia<T> {
    #[inline(always)]
    pub(crate) fn rigid(inertia: &SpatialInertia<T>) -> Self {
        Self {
            linear: Symmetric3::diagonal(inertia.mass),
            coupling: hat(&-inertia.first_moment),
            rotational: inertia.rotational,
        }
    }

    #[inline(always)]
    pub(crate) fn times(&self, motion: &Motion<T>) -> Force<T> {
        Force::new(
            self.linear.times(&motion.linear) + self.coupling * motion.angular,
            self.coupling.tr_mul(&motion.linear) + self.rotational.times(&motion.angular),
        )
    }

    #[inline(always)]
    pub(crate) fn column(&self, direction: &Direction<T>) -> Force<T> {
        match direction {
            Direction::Linear(axis) => Force::new(self.linear.times(axis), self.coupling.tr_mul(axis)),
            Direction::Angular(axis) => Force::new(self.coupling * axis, self.rotational.times(axis)),
        }
    }

    /// The trace of the block of a direction: no inertia along it, but for rounding, is little beside this.
    #[inline(always)]
    pub(crate) fn extent(&self, direction: &Direction<T>) -> T {
        let block = match direction {
            Direction::Linear(_) => &self.linear,
            Direction::Angular(_) => &self.rotational,
        };
        block.xx + block.yy + block.zz
    }

    /// self − u uᵀ s
    #[inline(always)]
    pub(crate) fn subtract_square(&mut self, u: &Force<T>, s: T) {
        self.linear.subtract_square(&u.linear, s);
        self.coupling -= u.linear * (u.angular * s).transpose();
        self.rotational.subtract_square(&u.angular, s);
    }

    /// Adds the inertia of a body fixed in a frame of the given pose:
    /// M' = R M Rᵀ, H' = R H Rᵀ − M' p̂, I' = R I Rᵀ + p̂ H' + (p̂ R H Rᵀ)ᵀ.
    #[inline(always)]
    pub(crate) fn add_seen_from(&mut self, inner: &Self, pose: &Transform<T>) {
        let (r, p) = (&pose.rotation, &pose.translation);
        let linear = inner.linear.rotated(r);
        let turned = (r * inner.coupling) * r.transpose();
        // M p̂ = −(p̂ M)ᵀ
        let coupling = turned + hat_times(p, &linear.full()).transpose();
        let lever = hat_times(p, &coupling) + hat_times(p, &turned).transpose();
        self.linear += linear;
        self.coupling += coupling;
        self.rotational += inner.rotational.rotated(r);
        self.rotational += Symmetric3::upper(&lever);
    }
}
