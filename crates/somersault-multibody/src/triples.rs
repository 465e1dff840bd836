//! Sums and products of vectors and matrices of three rows, over any [`Arithmetic`].
//!
//! They are rounded in the order in which nalgebra does it. What lanes are computed with is compiled for vector
//! instructions where it is inlined, and nalgebra's functions need not be.

use nalgebra::{Matrix3, Vector3};
use somersault_core::scalar::{Arithmetic, Lift};

/// a + b
#[inline(always)]
pub(crate) fn sum<T: Arithmetic>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.x + b.x, a.y + b.y, a.z + b.z)
}

/// a − b
#[inline(always)]
pub(crate) fn difference<T: Arithmetic>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.x - b.x, a.y - b.y, a.z - b.z)
}

/// −a
#[inline(always)]
pub(crate) fn negative<T: Arithmetic>(a: &Vector3<T>) -> Vector3<T> {
    Vector3::new(-a.x, -a.y, -a.z)
}

/// a s
#[inline(always)]
pub(crate) fn scaled<T: Arithmetic>(a: &Vector3<T>, s: T) -> Vector3<T> {
    Vector3::new(a.x * s, a.y * s, a.z * s)
}

/// a·b
#[inline(always)]
pub(crate) fn dot<T: Arithmetic>(a: &Vector3<T>, b: &Vector3<T>) -> T {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// a × b
#[inline(always)]
pub(crate) fn cross<T: Arithmetic>(a: &Vector3<T>, b: &Vector3<T>) -> Vector3<T> {
    Vector3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// M a
#[inline(always)]
pub(crate) fn times<T: Arithmetic>(m: &Matrix3<T>, a: &Vector3<T>) -> Vector3<T> {
    Vector3::new(
        m.m11 * a.x + m.m12 * a.y + m.m13 * a.z,
        m.m21 * a.x + m.m22 * a.y + m.m23 * a.z,
        m.m31 * a.x + m.m32 * a.y + m.m33 * a.z,
    )
}

/// Mᵀ a
#[inline(always)]
pub(crate) fn transposed_times<T: Arithmetic>(m: &Matrix3<T>, a: &Vector3<T>) -> Vector3<T> {
    Vector3::new(
        m.m11 * a.x + m.m21 * a.y + m.m31 * a.z,
        m.m12 * a.x + m.m22 * a.y + m.m32 * a.z,
        m.m13 * a.x + m.m23 * a.y + m.m33 * a.z,
    )
}

/// The columns of a matrix.
#[inline(always)]
pub(crate) fn columns<T: Arithmetic>(m: &Matrix3<T>) -> [Vector3<T>; 3] {
    [Vector3::new(m.m11, m.m21, m.m31), Vector3::new(m.m12, m.m22, m.m32), Vector3::new(m.m13, m.m23, m.m33)]
}

/// The matrix of these columns.
#[inline(always)]
pub(crate) fn of_columns<T: Arithmetic>([a, b, c]: [Vector3<T>; 3]) -> Matrix3<T> {
    Matrix3::new(a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z)
}

/// Mᵀ
#[inline(always)]
pub(crate) fn transposed<T: Arithmetic>(m: &Matrix3<T>) -> Matrix3<T> {
    Matrix3::new(m.m11, m.m21, m.m31, m.m12, m.m22, m.m32, m.m13, m.m23, m.m33)
}

/// M N
#[inline(always)]
pub(crate) fn product<T: Arithmetic>(m: &Matrix3<T>, n: &Matrix3<T>) -> Matrix3<T> {
    let [a, b, c] = columns(n);
    of_columns([times(m, &a), times(m, &b), times(m, &c)])
}

/// û M
#[inline(always)]
pub(crate) fn hat_times<T: Arithmetic>(u: &Vector3<T>, m: &Matrix3<T>) -> Matrix3<T> {
    let [a, b, c] = columns(m);
    of_columns([cross(u, &a), cross(u, &b), cross(u, &c)])
}

/// M + N
#[inline(always)]
pub(crate) fn matrix_sum<T: Arithmetic>(m: &Matrix3<T>, n: &Matrix3<T>) -> Matrix3<T> {
    let ([a, b, c], [d, e, f]) = (columns(m), columns(n));
    of_columns([sum(&a, &d), sum(&b, &e), sum(&c, &f)])
}

/// M − N
#[inline(always)]
pub(crate) fn matrix_difference<T: Arithmetic>(m: &Matrix3<T>, n: &Matrix3<T>) -> Matrix3<T> {
    let ([a, b, c], [d, e, f]) = (columns(m), columns(n));
    of_columns([difference(&a, &d), difference(&b, &e), difference(&c, &f)])
}

/// M s
#[inline(always)]
pub(crate) fn matrix_scaled<T: Arithmetic>(m: &Matrix3<T>, s: T) -> Matrix3<T> {
    let [a, b, c] = columns(m);
    of_columns([scaled(&a, s), scaled(&b, s), scaled(&c, s)])
}

/// A constant vector.
#[inline(always)]
pub(crate) fn lifted<T: Arithmetic, N: Lift<T>>(proof: N::Proof, a: &Vector3<T>) -> Vector3<N> {
    Vector3::new(N::lift(proof, a.x), N::lift(proof, a.y), N::lift(proof, a.z))
}

/// A constant matrix.
#[inline(always)]
pub(crate) fn matrix_lifted<T: Arithmetic, N: Lift<T>>(proof: N::Proof, m: &Matrix3<T>) -> Matrix3<N> {
    let [a, b, c] = columns(m);
    of_columns([lifted(proof, &a), lifted(proof, &b), lifted(proof, &c)])
}
