//! The step of a free body, for a tile of bodies at once.
//!
//! With principal moments I₁, I₂, I₃ and the angular velocity ω in the principal frame, Euler's
//! equations and the kinematics of the unit quaternion q (principal frame → world) read
//!
//! ω̇₁ = (I₂ − I₃)/I₁ ω₂ω₃ and cyclic, q̇ = ½ q ⊗ (0, ω).
//!
//! One step of the fourth-order Runge–Kutta–Munthe-Kaas method (classical tableau, dexp⁻¹ truncated
//! after the first bracket) in the body frame, where the exponential acts from the right and the
//! brackets change sign:
//!
//! q ← q ⊗ exp(h/6 (ω⁽¹⁾ + 2ω⁽²⁾ + 2ω⁽³⁾ + ω⁽⁴⁾) + h²/12 ω⁽¹⁾ × ω⁽⁴⁾), where ω⁽¹⁾…ω⁽⁴⁾ are the
//! stages of the classical method for Euler's equations, which do not contain q, so that the inner
//! exponentials are not needed.
//!
//! The kernel works with the half-angle per step, v = hω/2, and with the products p = (v₂v₃, v₃v₁,
//! v₁v₂). In these h disappears: with a = ((I₂ − I₃)/I₁, …) taken entry by entry, v changes by 2ap
//! in one step, so that
//!
//! - v⁽²⁾ = v + a p⁽¹⁾, v⁽³⁾ = v + a p⁽²⁾, v⁽⁴⁾ = v + d with d = 2a p⁽³⁾
//! - v̄ = v + a/3 (p⁽¹⁾ + p⁽²⁾ + p⁽³⁾), which is the weighted mean of the stages
//! - v ← v̄ + a/3 (p⁽²⁾ + p⁽³⁾ + p⁽⁴⁾)
//! - q ← q ⊗ (cos |φ|, sin |φ| φ/|φ|) with φ = v̄ + v × d/6, then q ← q (3 − |q|²)/2.
//!
//! That v × v⁽⁴⁾ = v × d keeps the product small in small steps and zero where the axis rests.
//!
//! # Cost
//!
//! 141 floating-point operations (a fused multiply–add counts two) in 92 instructions, while |φ| <
//! π/4: 51 for v, 15 for φ, 5 for |φ|², 26 for the two polynomials, 3 + 28 for the product and 13
//! for the renormalisation. A vector with a larger half-angle in any lane costs 44 more, among them
//! a square root and a division.
//!
//! # Sources
//!
//! Munthe-Kaas, *High order Runge–Kutta methods on manifolds*, Appl. Numer. Math. 29 (1999);
//! Iserles, Munthe-Kaas, Nørsett and Zanna, *Lie-group methods*, Acta Numerica 9 (2000).

use core::f64::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI};
use somersault_core::lanes::{Kernel, Lanes};

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

/// The state of up to [`TILE`] bodies and what their steps need.
///
/// Entries that no body fills have no steps: what they are makes no difference.
pub(super) struct Tile {
    /// a = (I₂ − I₃)/I₁ and cyclic.
    a: [Row; 3],
    /// 2a.
    a_double: [Row; 3],
    /// a/3.
    a_third: [Row; 3],
    /// v = hω/2 in the principal frame.
    v: [Row; 3],
    /// q, principal frame → world, real part first.
    q: [Row; 4],
    /// How many steps each body takes.
    steps: Row,
    /// The least and the largest of them among the bodies present.
    steps_range: (u64, u64),
}

impl Tile {
    /// A tile of bodies at rest, to be filled by [`set`](Self::set).
    pub(super) fn new() -> Self {
        let zero = Row([0.0; TILE]);
        Self {
            a: [zero; 3],
            a_double: [zero; 3],
            a_third: [zero; 3],
            v: [zero; 3],
            q: [Row([1.0; TILE]), zero, zero, zero],
            steps: zero,
            steps_range: (u64::MAX, 0),
        }
    }

    /// Takes all bodies out.
    pub(super) fn clear(&mut self) {
        self.steps = Row([0.0; TILE]);
        self.steps_range = (u64::MAX, 0);
    }

    /// Puts a body into entry `at`: principal moments, unit quaternion (real part first),
    /// half-angle vector per step.
    pub(super) fn set(&mut self, at: usize, moments: [f64; 3], q: [f64; 4], v: [f64; 3]) {
        for i in 0..3 {
            let a = (moments[(i + 1) % 3] - moments[(i + 2) % 3]) / moments[i];
            self.a[i].0[at] = a;
            self.a_double[i].0[at] = 2.0 * a;
            self.a_third[i].0[at] = a / 3.0;
            self.v[i].0[at] = v[i];
        }
        for i in 0..4 {
            self.q[i].0[at] = q[i];
        }
    }

    /// Says how many steps the body in entry `at` makes next; one that makes none is held if this is said.
    pub(super) fn take(&mut self, at: usize, steps: u64) {
        self.steps.0[at] = steps as f64;
        self.steps_range = (self.steps_range.0.min(steps), self.steps_range.1.max(steps));
    }

    /// The quaternion and the half-angle vector per step of the body in entry `at`.
    pub(super) fn get(&self, at: usize) -> ([f64; 4], [f64; 3]) {
        (self.q.map(|row| row.0[at]), self.v.map(|row| row.0[at]))
    }
}

/// All steps of all bodies of a tile.
impl Kernel for &mut Tile {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (least, largest) = self.steps_range;
        for _ in 0..least.min(largest) {
            for at in (0..TILE).step_by(L::WIDTH) {
                let (v, q) = step(lanes, self, at);
                store(lanes, v, &mut self.v, at);
                store(lanes, q, &mut self.q, at);
            }
        }
        for done in least..largest {
            let done = lanes.splat(done as f64);
            for at in (0..TILE).step_by(L::WIDTH) {
                let moves = lanes.less(done, lanes.load(&self.steps.0[at..at + L::WIDTH]));
                let (v, q) = step(lanes, self, at);
                let v = select(lanes, moves, v, load(lanes, &self.v, at));
                let q = select(lanes, moves, q, load(lanes, &self.q, at));
                store(lanes, v, &mut self.v, at);
                store(lanes, q, &mut self.q, at);
            }
        }
    }
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

/// One step of the bodies `at..at + WIDTH`: their next v and q.
#[inline(always)]
fn step<L: Lanes>(l: L, tile: &Tile, at: usize) -> ([L::Vector; 3], [L::Vector; 4]) {
    let v = load(l, &tile.v, at);
    let a = load(l, &tile.a, at);
    let a_double = load(l, &tile.a_double, at);
    let a_third = load(l, &tile.a_third, at);

    let p1 = products(l, v);
    let p2 = products(l, advance(l, v, a, p1));
    let p3 = products(l, advance(l, v, a, p2));
    let d = [l.mul(a_double[0], p3[0]), l.mul(a_double[1], p3[1]), l.mul(a_double[2], p3[2])];
    let v4 = sum(l, v, d);
    let p4 = products(l, v4);
    let p23 = sum(l, p2, p3);
    let mean = advance(l, v, a_third, sum(l, p1, p23));
    let v_next = advance(l, mean, a_third, sum(l, p23, p4));

    let sixth = l.splat(1.0 / 6.0);
    let phi = advance(l, mean, [sixth; 3], cross(l, v, d));
    let q_next = renormalise(l, product(l, load(l, &tile.q, at), exp(l, phi)));
    (v_next, q_next)
}

/// (v₂v₃, v₃v₁, v₁v₂)
#[inline(always)]
fn products<L: Lanes>(l: L, v: [L::Vector; 3]) -> [L::Vector; 3] {
    [l.mul(v[1], v[2]), l.mul(v[2], v[0]), l.mul(v[0], v[1])]
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
