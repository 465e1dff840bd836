//! Spatial inertia of a rigid body and of an articulated one (Featherstone 2008, sections 2.13 and 7.1).
//!
//! With the linear part first,
//!
//! rigid: (f, n) = (m v + ω × h, h × v + I ω),  articulated: (f, n) = (M a + H α, Hᵀ a + I α),
//!
//! where m is the mass, h = m c the first moment of mass and I the rotational inertia about the origin
//! of the frame (not about the centre of mass c).

use crate::spatial::{Direction, Force, Motion, Transform};
use crate::triples::{
    columns, cross, difference, dot, hat_times, lifted, matrix_lifted, matrix_sum, of_columns, product,
    scaled, sum, times, transposed, transposed_times,
};
use nalgebra::{Matrix3, Vector3};
use somersault_core::lie::so3::hat;
use somersault_core::scalar::{Arithmetic, Lift, Scalar, constant};
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
}

impl<T: Arithmetic> Symmetric3<T> {
    /// From the upper triangle.
    #[inline(always)]
    fn upper(m: &Matrix3<T>) -> Self {
        Self { xx: m.m11, xy: m.m12, xz: m.m13, yy: m.m22, yz: m.m23, zz: m.m33 }
    }

    /// The same constant in other arithmetic.
    #[inline(always)]
    fn lift<N: Lift<T>>(&self, proof: N::Proof) -> Symmetric3<N> {
        let number = |x| N::lift(proof, x);
        Symmetric3 {
            xx: number(self.xx),
            xy: number(self.xy),
            xz: number(self.xz),
            yy: number(self.yy),
            yz: number(self.yz),
            zz: number(self.zz),
        }
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

    /// S⁻¹ by the factors L D Lᵀ, where S is positive definite; with the numbers 0 and 1.
    #[inline(always)]
    pub(crate) fn inverse(&self, [zero, one]: [T; 2]) -> Option<Self> {
        let d1 = self.xx;
        let (l21, l31) = (self.xy / d1, self.xz / d1);
        let d2 = self.yy - l21 * self.xy;
        let left = self.yz - l31 * self.xy;
        let l32 = left / d2;
        let d3 = self.zz - l31 * self.xz - l32 * left;
        if !(d1.exceeds(zero) && d2.exceeds(zero) && d3.exceeds(zero)) {
            return None;
        }
        let (i1, i2, zz) = (one / d1, one / d2, one / d3);
        let m31 = l21 * l32 - l31;
        let (yz, xz) = (-l32 * zz, m31 * zz);
        Some(Self {
            xx: i1 + l21 * l21 * i2 + m31 * xz,
            xy: -l21 * i2 - l32 * xz,
            xz,
            yy: i2 - l32 * yz,
            yz,
            zz,
        })
    }

    /// The square of the Frobenius norm.
    #[inline(always)]
    pub(crate) fn norm_squared(&self) -> T {
        let across = self.xy * self.xy + self.xz * self.xz + self.yz * self.yz;
        self.xx * self.xx + self.yy * self.yy + self.zz * self.zz + across + across
    }

    /// The inverse of the component S_zz alone, where it is positive, with zeros around it.
    #[inline(always)]
    pub(crate) fn inverse_of_normal(&self, [o, one]: [T; 2]) -> Option<Self> {
        let inverse = Self { xx: o, xy: o, xz: o, yy: o, yz: o, zz: one / self.zz };
        self.zz.exceeds(o).then_some(inverse)
    }

    /// R S Rᵀ.
    #[inline(always)]
    fn rotated(&self, r: &Matrix3<T>) -> Self {
        let [x, y, z] = columns(&transposed(r));
        let (sx, sy, sz) = (self.times(&x), self.times(&y), self.times(&z));
        Self {
            xx: dot(&x, &sx),
            xy: dot(&x, &sy),
            xz: dot(&x, &sz),
            yy: dot(&y, &sy),
            yz: dot(&y, &sz),
            zz: dot(&z, &sz),
        }
    }

    /// self − u uᵀ s
    #[inline(always)]
    fn subtract_square(&mut self, u: &Vector3<T>, s: T) {
        let w = scaled(u, s);
        self.xx -= u.x * w.x;
        self.xy -= u.x * w.y;
        self.xz -= u.x * w.z;
        self.yy -= u.y * w.y;
        self.yz -= u.y * w.z;
        self.zz -= u.z * w.z;
    }
}

impl<T: Arithmetic> AddAssign for Symmetric3<T> {
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

    /// The inertia of a body fixed in a frame of the given pose, about the outer origin in outer axes:
    /// h' = R h + m p, I' = R I Rᵀ + (m p·p + 2 p·Rh) 1 − m p pᵀ − p (Rh)ᵀ − (Rh) pᵀ.
    #[inline(always)]
    pub fn seen_from(&self, pose: &Transform<T>) -> Self {
        self.seen_from_in((), pose)
    }

    /// The same in other arithmetic.
    #[inline(always)]
    pub(crate) fn seen_from_in<N: Lift<T>>(&self, proof: N::Proof, pose: &Transform<N>) -> SpatialInertia<N> {
        let SpatialInertia { mass, first_moment, rotational } = self.lift(proof);
        let p = &pose.translation;
        let h = times(&pose.rotation, &first_moment);
        let mut rotational: Symmetric3<N> = rotational.rotated(&pose.rotation);
        // with g = h + m p / 2 the shift is 2 (p·g) 1 − p gᵀ − g pᵀ
        let g = sum(&h, &scaled(p, N::lift(proof, self.mass * constant(0.5))));
        let (x, y, z) = (p.x * g.x, p.y * g.y, p.z * g.z);
        let two = |a: N| a + a;
        rotational += Symmetric3 {
            xx: two(y + z),
            xy: -(p.x * g.y + p.y * g.x),
            xz: -(p.x * g.z + p.z * g.x),
            yy: two(x + z),
            yz: -(p.y * g.z + p.z * g.y),
            zz: two(x + y),
        };
        SpatialInertia { mass, first_moment: sum(&h, &scaled(p, mass)), rotational }
    }
}

impl<T: Arithmetic> SpatialInertia<T> {
    /// The same constant in other arithmetic.
    #[inline(always)]
    pub(crate) fn lift<N: Lift<T>>(&self, proof: N::Proof) -> SpatialInertia<N> {
        SpatialInertia {
            mass: N::lift(proof, self.mass),
            first_moment: lifted(proof, &self.first_moment),
            rotational: self.rotational.lift(proof),
        }
    }

    /// The centre of mass, and the rotational inertia about it.
    #[inline(always)]
    pub(crate) fn about_center(&self, one: T) -> (Vector3<T>, Symmetric3<T>) {
        let center = scaled(&self.first_moment, one / self.mass);
        let (c, h, mut about) = (&center, &self.first_moment, self.rotational);
        let (x, y, z) = (c.x * h.x, c.y * h.y, c.z * h.z);
        about.xx -= y + z;
        about.yy -= x + z;
        about.zz -= x + y;
        about.xy += c.x * h.y;
        about.xz += c.x * h.z;
        about.yz += c.y * h.z;
        (center, about)
    }

    /// The momentum of the body moving at `motion`.
    #[inline(always)]
    pub fn times(&self, motion: &Motion<T>) -> Force<T> {
        Force::new(
            sum(&scaled(&motion.linear, self.mass), &cross(&motion.angular, &self.first_moment)),
            sum(&self.rotational.times(&motion.angular), &cross(&self.first_moment, &motion.linear)),
        )
    }
}

impl<T: Arithmetic> AddAssign for SpatialInertia<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.mass += other.mass;
        self.first_moment = sum(&self.first_moment, &other.first_moment);
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
}

impl<T: Arithmetic> ArticulatedInertia<T> {
    /// The same constant in other arithmetic.
    #[inline(always)]
    pub(crate) fn lift<N: Lift<T>>(&self, proof: N::Proof) -> ArticulatedInertia<N> {
        ArticulatedInertia {
            linear: self.linear.lift(proof),
            coupling: matrix_lifted(proof, &self.coupling),
            rotational: self.rotational.lift(proof),
        }
    }

    #[inline(always)]
    pub(crate) fn times(&self, motion: &Motion<T>) -> Force<T> {
        Force::new(
            sum(&self.linear.times(&motion.linear), &times(&self.coupling, &motion.angular)),
            sum(&transposed_times(&self.coupling, &motion.linear), &self.rotational.times(&motion.angular)),
        )
    }

    #[inline(always)]
    pub(crate) fn column(&self, direction: &Direction<T>) -> Force<T> {
        match direction {
            Direction::Linear(axis) => {
                Force::new(self.linear.times(axis), transposed_times(&self.coupling, axis))
            }
            Direction::Angular(axis) => Force::new(times(&self.coupling, axis), self.rotational.times(axis)),
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
        let (a, w) = (&u.linear, scaled(&u.angular, s));
        let [x, y, z] = columns(&self.coupling);
        self.coupling = of_columns([
            difference(&x, &scaled(a, w.x)),
            difference(&y, &scaled(a, w.y)),
            difference(&z, &scaled(a, w.z)),
        ]);
        self.rotational.subtract_square(&u.angular, s);
    }

    /// Adds the inertia of a body fixed in a frame of the given pose:
    /// M' = R M Rᵀ, H' = R H Rᵀ − M' p̂, I' = R I Rᵀ + p̂ H' + (p̂ R H Rᵀ)ᵀ.
    #[inline(always)]
    pub(crate) fn add_seen_from(&mut self, inner: &Self, pose: &Transform<T>) {
        let (r, p) = (&pose.rotation, &pose.translation);
        let linear = inner.linear.rotated(r);
        let turned = product(&product(r, &inner.coupling), &transposed(r));
        // M p̂ = −(p̂ M)ᵀ
        let coupling = matrix_sum(&turned, &transposed(&hat_times(p, &linear.full())));
        let lever = matrix_sum(&hat_times(p, &coupling), &transposed(&hat_times(p, &turned)));
        self.linear += linear;
        self.coupling = matrix_sum(&self.coupling, &coupling);
        self.rotational += inner.rotational.rotated(r);
        self.rotational += Symmetric3::upper(&lever);
    }
}
