//! Quantities of the bodies of a tile, one row each, and the arithmetic of vectors and quaternions on them.
//!
//! Components are vectors of as many bodies as an instruction takes ([`Lanes`]); quaternions have their real part first.

use core::f64::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI};
use somersault_core::lanes::Lanes;

/// Bodies in one tile: eight AVX-512 vectors, enough independent work to hide the latency of an
/// operation.
pub(super) const TILE: usize = 64;

/// One quantity of all bodies of a tile.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Row(pub(super) [f64; TILE]);

impl Default for Row {
    fn default() -> Self {
        Self([0.0; TILE])
    }
}

/// A row at the bodies `at..at + WIDTH`.
#[inline(always)]
pub(super) fn one<L: Lanes>(l: L, row: &Row, at: usize) -> L::Vector {
    l.load(&row.0[at..at + L::WIDTH])
}

#[inline(always)]
pub(super) fn load<L: Lanes, const N: usize>(l: L, rows: &[Row; N], at: usize) -> [L::Vector; N] {
    let mut x = [l.splat(0.0); N];
    for i in 0..N {
        x[i] = l.load(&rows[i].0[at..at + L::WIDTH]);
    }
    x
}

#[inline(always)]
pub(super) fn store<L: Lanes, const N: usize>(l: L, x: [L::Vector; N], rows: &mut [Row; N], at: usize) {
    for i in 0..N {
        l.store(x[i], &mut rows[i].0[at..at + L::WIDTH]);
    }
}

#[inline(always)]
pub(super) fn select<L: Lanes, const N: usize>(
    l: L,
    mask: L::Mask,
    a: [L::Vector; N],
    mut b: [L::Vector; N],
) -> [L::Vector; N] {
    for i in 0..N {
        b[i] = l.select(mask, a[i], b[i]);
    }
    b
}

/// x + a p, entry by entry.
#[inline(always)]
pub(super) fn advance<L: Lanes>(
    l: L,
    x: [L::Vector; 3],
    a: [L::Vector; 3],
    p: [L::Vector; 3],
) -> [L::Vector; 3] {
    [l.mul_add(a[0], p[0], x[0]), l.mul_add(a[1], p[1], x[1]), l.mul_add(a[2], p[2], x[2])]
}

/// x + y
#[inline(always)]
pub(super) fn sum<L: Lanes>(l: L, x: [L::Vector; 3], y: [L::Vector; 3]) -> [L::Vector; 3] {
    [l.add(x[0], y[0]), l.add(x[1], y[1]), l.add(x[2], y[2])]
}

/// x × y
#[inline(always)]
pub(super) fn cross<L: Lanes>(l: L, x: [L::Vector; 3], y: [L::Vector; 3]) -> [L::Vector; 3] {
    [
        l.neg_mul_add(x[2], y[1], l.mul(x[1], y[2])),
        l.neg_mul_add(x[0], y[2], l.mul(x[2], y[0])),
        l.neg_mul_add(x[1], y[0], l.mul(x[0], y[1])),
    ]
}

/// a x + y, with one number a for all components.
#[inline(always)]
pub(super) fn moved<L: Lanes>(l: L, a: L::Vector, x: [L::Vector; 3], y: [L::Vector; 3]) -> [L::Vector; 3] {
    advance(l, y, [a; 3], x)
}

#[inline(always)]
pub(super) fn scaled<L: Lanes>(l: L, a: L::Vector, x: [L::Vector; 3]) -> [L::Vector; 3] {
    [l.mul(a, x[0]), l.mul(a, x[1]), l.mul(a, x[2])]
}

/// x/a
#[inline(always)]
pub(super) fn divided<L: Lanes>(l: L, x: [L::Vector; 3], a: L::Vector) -> [L::Vector; 3] {
    [l.div(x[0], a), l.div(x[1], a), l.div(x[2], a)]
}

#[inline(always)]
pub(super) fn dot<L: Lanes>(l: L, x: [L::Vector; 3], y: [L::Vector; 3]) -> L::Vector {
    l.mul_add(x[2], y[2], l.mul_add(x[1], y[1], l.mul(x[0], y[0])))
}

/// The matrix with these rows times x.
#[inline(always)]
pub(super) fn apply<L: Lanes>(l: L, rows: &[[L::Vector; 3]; 3], x: [L::Vector; 3]) -> [L::Vector; 3] {
    [dot(l, rows[0], x), dot(l, rows[1], x), dot(l, rows[2], x)]
}

/// Its transpose times x.
#[inline(always)]
pub(super) fn apply_transposed<L: Lanes>(
    l: L,
    rows: &[[L::Vector; 3]; 3],
    x: [L::Vector; 3],
) -> [L::Vector; 3] {
    moved(l, x[2], rows[2], moved(l, x[1], rows[1], scaled(l, x[0], rows[0])))
}

/// The rows of the rotation matrix of q.
#[inline(always)]
pub(super) fn rotation<L: Lanes>(l: L, q: [L::Vector; 4]) -> [[L::Vector; 3]; 3] {
    let [w, x, y, z] = q;
    let (x2, y2, z2) = (l.add(x, x), l.add(y, y), l.add(z, z));
    let (wx, wy, wz) = (l.mul(w, x2), l.mul(w, y2), l.mul(w, z2));
    let (xx, xy, xz) = (l.mul(x, x2), l.mul(x, y2), l.mul(x, z2));
    let (yy, yz, zz) = (l.mul(y, y2), l.mul(y, z2), l.mul(z, z2));
    let unit = l.splat(1.0);
    [
        [l.sub(unit, l.add(yy, zz)), l.sub(xy, wz), l.add(xz, wy)],
        [l.add(xy, wz), l.sub(unit, l.add(xx, zz)), l.sub(yz, wx)],
        [l.sub(xz, wy), l.add(yz, wx), l.sub(unit, l.add(xx, yy))],
    ]
}

/// The quaternion product q ⊗ p.
#[inline(always)]
pub(super) fn product<L: Lanes>(l: L, q: [L::Vector; 4], p: [L::Vector; 4]) -> [L::Vector; 4] {
    let s = l.neg_mul_add(q[1], p[1], l.mul(q[0], p[0]));
    let s = l.neg_mul_add(q[2], p[2], s);
    let s = l.neg_mul_add(q[3], p[3], s);
    let x = l.mul_add(q[1], p[0], l.mul(q[0], p[1]));
    let x = l.mul_add(q[2], p[3], x);
    let x = l.neg_mul_add(q[3], p[2], x);
    let y = l.mul_add(q[2], p[0], l.mul(q[0], p[2]));
    let y = l.mul_add(q[3], p[1], y);
    let y = l.neg_mul_add(q[1], p[3], y);
    let z = l.mul_add(q[3], p[0], l.mul(q[0], p[3]));
    let z = l.mul_add(q[1], p[2], z);
    let z = l.neg_mul_add(q[2], p[1], z);
    [s, x, y, z]
}

/// q (3 − |q|²)/2: Newton's step for q/|q|, which squares the deviation of |q| from one.
#[inline(always)]
pub(super) fn renormalise<L: Lanes>(l: L, q: [L::Vector; 4]) -> [L::Vector; 4] {
    let norm = l.mul_add(q[1], q[1], l.mul(q[0], q[0]));
    let norm = l.mul_add(q[2], q[2], norm);
    let norm = l.mul_add(q[3], q[3], norm);
    let scale = l.neg_mul_add(l.splat(0.5), norm, l.splat(1.5));
    [l.mul(q[0], scale), l.mul(q[1], scale), l.mul(q[2], scale), l.mul(q[3], scale)]
}

/// Below this |φ|² the polynomials are evaluated at φ itself.
const SMALL: f64 = FRAC_PI_4 * FRAC_PI_4;

/// What π exceeds its nearest `f64` by.
const PI_LOW: f64 = 1.2246467991473532e-16;

/// Adding and subtracting it rounds to the nearest integer.
const ROUND: f64 = 6755399441055744.0;

/// exp of the half-angle vector φ, up to the sign of the quaternion: ±(cos |φ|, sin |φ| φ/|φ|).
///
/// No entry is wrong by more than 3·10⁻¹⁶ while |φ| < π/4 and by more than 10⁻¹⁵ + 3·10⁻¹⁶ |φ|
/// beyond; the second term is what rounding |φ| costs. From |φ| ≈ 10¹⁵ on, where neighbouring
/// numbers are turns apart, the result is merely a unit quaternion about the right axis.
#[inline(always)]
pub(super) fn exp<L: Lanes>(l: L, phi: [L::Vector; 3]) -> [L::Vector; 4] {
    let square = l.mul_add(phi[1], phi[1], l.mul(phi[0], phi[0]));
    let [c, s] = cos_sinc(l, l.mul_add(phi[2], phi[2], square));
    [c, l.mul(s, phi[0]), l.mul(s, phi[1]), l.mul(s, phi[2])]
}

/// ±(cos, sin(x)/x) at x = √`square`, the sign + below π/4.
#[inline(always)]
pub(super) fn cos_sinc<L: Lanes>(l: L, square: L::Vector) -> [L::Vector; 2] {
    let small = l.less(square, l.splat(SMALL));
    let (mut c, mut s) = (cos(l, square), sinc(l, square));
    if !l.all(small) {
        let (c_large, s_large) = cos_sinc_reduced(l, square);
        c = l.select(small, c, c_large);
        s = l.select(small, s, s_large);
    }
    [c, s]
}

/// ±(cos, sin(x)/x) at x = √`square` of any size.
///
/// Whole multiples of π are removed, which changes at most the common sign; then x is halved into
/// the range of the polynomials and the double-angle formulas lead back.
#[inline(always)]
fn cos_sinc_reduced<L: Lanes>(l: L, square: L::Vector) -> (L::Vector, L::Vector) {
    let x = l.sqrt(square);
    let round = l.splat(ROUND);
    let turns = l.sub(l.mul_add(x, l.splat(FRAC_1_PI), round), round);
    let rest = l.neg_mul_add(turns, l.splat(PI), x);
    let rest = l.neg_mul_add(turns, l.splat(PI_LOW), rest);
    let rest = l.max(l.splat(-FRAC_PI_2), l.min(l.splat(FRAC_PI_2), rest));
    let half = l.mul(rest, l.splat(0.5));
    let half_square = l.mul(half, half);
    let c = cos(l, half_square);
    let s = l.mul(half, sinc(l, half_square));
    let s_double = l.add(s, s);
    let cos = l.neg_mul_add(s_double, s, l.splat(1.0));
    (cos, l.div(l.mul(s_double, c), x))
}

/// cos √z on 0 ≤ z ≤ (π/4)², the best polynomial of degree 7 with the first two coefficients of the
/// series: truncation error 9·10⁻¹⁹.
#[inline(always)]
fn cos<L: Lanes>(l: L, z: L::Vector) -> L::Vector {
    polynomial(
        l,
        z,
        [
            1.0,
            -0.5,
            0.0416666666666666,
            -0.0013888888888874131,
            2.4801587289487026e-5,
            -2.755731435379283e-7,
            2.087572347955228e-9,
            -1.135965887189606e-11,
        ],
    )
}

/// sin(√z)/√z on 0 ≤ z ≤ (π/4)², the best polynomial of degree 6 with value 1 at 0: truncation
/// error 6·10⁻¹⁸.
#[inline(always)]
fn sinc<L: Lanes>(l: L, z: L::Vector) -> L::Vector {
    polynomial(
        l,
        z,
        [
            1.0,
            -0.16666666666666632,
            0.008333333333322418,
            -0.00019841269829812383,
            2.7557313693573296e-6,
            -2.5050758384412737e-8,
            1.589681179840629e-10,
        ],
    )
}

/// Horner's scheme, the constant coefficient first.
#[inline(always)]
pub(super) fn polynomial<L: Lanes, const N: usize>(l: L, z: L::Vector, coefficients: [f64; N]) -> L::Vector {
    let mut y = l.splat(coefficients[N - 1]);
    for i in (0..N - 1).rev() {
        y = l.mul_add(y, z, l.splat(coefficients[i]));
    }
    y
}
