//! Elliptic integrals and Jacobi's elliptic functions, accurate up to modulus 1.
//!
//! ```text
//! R_F(x, y, z)    = ½ ∫₀^∞ dt / s(t),            s(t) = √((t + x)(t + y)(t + z))
//! R_C(x, y)       = R_F(x, y, y)
//! R_J(x, y, z, p) = 3⁄2 ∫₀^∞ dt / (s(t) (t + p)),   R_D(x, y, z) = R_J(x, y, z, z)
//!
//! F(φ | m)    = ∫₀^φ dθ / √(1 − m sin²θ),                       K(m) = F(π⁄2 | m)
//! Π(n; φ | m) = ∫₀^φ dθ / ((1 − n sin²θ) √(1 − m sin²θ)),       Π(n | m) = Π(n; π⁄2 | m)
//! u = F(am u | m),   sn u = sin am u,   cn u = cos am u,   dn u = √(1 − m sn² u)
//! ```
//!
//! Everything depends on the parameter m = k² *and* on its complement m₁ = 1 − m, and near m = 1 on m₁ with its full relative
//! accuracy: K ≈ ½ ln(16⁄m₁). A [`Parameter`] therefore carries both, and nothing here subtracts one from 1. That is also
//! why no published crate is used: those for Rust take m alone, so that m₁ below 1e-16 cannot even be written down, and have
//! neither Jacobi's functions nor the phase of a long argument to `f64` accuracy.
//!
//! Symmetric integrals follow Carlson's duplication (DLMF §19.36(i), expansions of degree 7), complete integrals the
//! arithmetic-geometric mean (§19.8(i)) and Bulirsch's extension of it (Numerische Mathematik 13, 1969, 305–315), Jacobi's
//! functions the descending Gauss transformation (§22.7(i)). The error is a few ulp; each function says more.

use crate::double_double::DoubleDouble;
use std::f64::consts::PI;

/// The parameter m of an elliptic integral with its complement m₁ = 1 − m, both to full relative accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    m: f64,
    m1: f64,
}

impl Parameter {
    /// From m in [0, 1], the complement being 1 − m: right for m up to about ½, and for any m that is exact as given.
    pub fn from_m(m: f64) -> Self {
        Self { m, m1: 1.0 - m }
    }

    /// From the complement m₁ in [0, 1], the parameter being 1 − m₁.
    pub fn from_complement(m1: f64) -> Self {
        Self { m: 1.0 - m1, m1 }
    }

    /// From both, where the caller has formulas for each that do not cancel. They must add up to 1 within rounding.
    pub fn new(m: f64, m1: f64) -> Self {
        Self { m, m1 }
    }

    /// The parameter m = k².
    pub fn m(&self) -> f64 {
        self.m
    }

    /// The complement m₁ = 1 − m.
    pub fn m1(&self) -> f64 {
        self.m1
    }

    /// The parameter with m and m₁ exchanged.
    pub fn complement(&self) -> Self {
        Self { m: self.m1, m1: self.m }
    }
}

/// Jacobi's functions at one argument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jacobi {
    /// sn u = sin am u.
    pub sn: f64,
    /// cn u = cos am u.
    pub cn: f64,
    /// dn u = √(1 − m sn² u), positive.
    pub dn: f64,
    /// The amplitude am u, continuous in u.
    pub am: f64,
}

/// Carlson's R_F(x, y, z) for arguments ≥ 0, at most one of them zero; symmetric, homogeneous of degree −½.
///
/// NaN for a negative argument, infinite for two zeros. Relative error below 1e-15; three square roots per step, and four to
/// twenty steps, the more the further the arguments lie apart.
pub fn carlson_rf(x: f64, y: f64, z: f64) -> f64 {
    if !(x >= 0.0 && y >= 0.0 && z >= 0.0) {
        return f64::NAN;
    }
    if x + y == 0.0 || y + z == 0.0 || z + x == 0.0 {
        return f64::INFINITY;
    }
    let (mut x, mut y, mut z) = (x, y, z);
    let mut a = (x + y + z) / 3.0;
    // the expansion below is left with a term of degree 8 in the relative spread
    while (a - x).abs().max((a - y).abs()).max((a - z).abs()) > SPREAD * a {
        let (rx, ry, rz) = (x.sqrt(), y.sqrt(), z.sqrt());
        let shift = rx * (ry + rz) + ry * rz;
        (x, y, z) = (0.25 * (x + shift), 0.25 * (y + shift), 0.25 * (z + shift));
        a = (x + y + z) / 3.0;
    }
    let (dx, dy) = (1.0 - x / a, 1.0 - y / a);
    let dz = -dx - dy;
    let e2 = dx * dy - dz * dz;
    let e3 = dx * dy * dz;
    let series = e2 * (-1.0 / 10.0 + e2 * (1.0 / 24.0 - 5.0 / 208.0 * e2))
        + e3 * (1.0 / 14.0 - 3.0 / 44.0 * e2 + 3.0 / 104.0 * e3 + e2 * e2 / 16.0);
    (1.0 + series) / a.sqrt()
}

/// Relative spread of the arguments at which the duplication hands over to the expansion of degree 7.
const SPREAD: f64 = 8e-3;

/// Carlson's R_C(x, y) = R_F(x, y, y) for x ≥ 0, y ≠ 0; for y < 0 the Cauchy principal value.
///
/// NaN outside. Relative error below 1e-15, except near the zero that the principal value has.
pub fn carlson_rc(x: f64, y: f64) -> f64 {
    if !(x >= 0.0) || y.is_nan() {
        return f64::NAN;
    }
    if y == 0.0 {
        return f64::INFINITY;
    }
    if y < 0.0 {
        return (x / (x - y)).sqrt() * carlson_rc(x - y, -y);
    }
    let (mut x, mut y) = (x, y);
    let mut a = (x + 2.0 * y) / 3.0;
    while (x - a).abs() > SPREAD * a {
        let shift = 2.0 * x.sqrt() * y.sqrt() + y;
        (x, y) = (0.25 * (x + shift), 0.25 * (y + shift));
        a = (x + 2.0 * y) / 3.0;
    }
    let s = y / a - 1.0;
    let series =
        s * s * (0.3 + s * (1.0 / 7.0 + s * (0.375 + s * (9.0 / 22.0 + s * (159.0 / 208.0 + s * 9.0 / 8.0)))));
    (1.0 + series) / a.sqrt()
}

/// Carlson's R_J(x, y, z, p) for x, y, z ≥ 0, at most one of them zero, and p > 0; symmetric in x, y, z.
///
/// NaN outside. Relative error below 2e-15.
pub fn carlson_rj(x: f64, y: f64, z: f64, p: f64) -> f64 {
    if !(x >= 0.0 && y >= 0.0 && z >= 0.0 && p > 0.0) {
        return f64::NAN;
    }
    if x + y == 0.0 || y + z == 0.0 || z + x == 0.0 {
        return f64::INFINITY;
    }
    let (mut x, mut y, mut z, mut p) = (x, y, z, p);
    let mut sum = 0.0;
    let mut power = 1.0;
    loop {
        let a = (x + y + z + 2.0 * p) / 5.0;
        let spread = (a - x).abs().max((a - y).abs()).max((a - z).abs()).max((a - p).abs());
        if spread <= 0.5 * SPREAD * a {
            let (dx, dy, dz) = (1.0 - x / a, 1.0 - y / a, 1.0 - z / a);
            let dp = -0.5 * (dx + dy + dz);
            return power * degree_seven(dx, dy, dz, dp) / (a * a.sqrt()) + 6.0 * sum;
        }
        let (rx, ry, rz, rp) = (x.sqrt(), y.sqrt(), z.sqrt(), p.sqrt());
        let shift = rx * (ry + rz) + ry * rz;
        // DLMF 19.26.18 with α = p(√x + √y + √z) + √x√y√z and β = √p (p + shift)
        let alpha = p * (rx + ry + rz) + rx * ry * rz;
        let beta = rp * (p + shift);
        sum += power * carlson_rc(alpha * alpha, beta * beta) * 0.5;
        power *= 0.25;
        (x, y, z, p) = (0.25 * (x + shift), 0.25 * (y + shift), 0.25 * (z + shift), 0.25 * (p + shift));
    }
}

/// Carlson's R_D(x, y, z) = R_J(x, y, z, z) for x, y ≥ 0, not both zero, and z > 0; symmetric in x and y.
///
/// NaN outside. Relative error below 2e-15.
pub fn carlson_rd(x: f64, y: f64, z: f64) -> f64 {
    if !(x >= 0.0 && y >= 0.0 && z > 0.0) {
        return f64::NAN;
    }
    if x + y == 0.0 {
        return f64::INFINITY;
    }
    let (mut x, mut y, mut z) = (x, y, z);
    let mut sum = 0.0;
    let mut power = 1.0;
    loop {
        let a = (x + y + 3.0 * z) / 5.0;
        if (a - x).abs().max((a - y).abs()).max((a - z).abs()) <= 0.5 * SPREAD * a {
            let (dx, dy) = (1.0 - x / a, 1.0 - y / a);
            let dz = -(dx + dy) / 3.0;
            return power * degree_seven(dx, dy, dz, dz) / (a * a.sqrt()) + 3.0 * sum;
        }
        let (rx, ry, rz) = (x.sqrt(), y.sqrt(), z.sqrt());
        let shift = rx * (ry + rz) + ry * rz;
        sum += power / (rz * (z + shift));
        power *= 0.25;
        (x, y, z) = (0.25 * (x + shift), 0.25 * (y + shift), 0.25 * (z + shift));
    }
}

/// The expansion of R_J about equal arguments, DLMF 19.36.2, for deviations with dx + dy + dz + 2 dp = 0.
fn degree_seven(dx: f64, dy: f64, dz: f64, dp: f64) -> f64 {
    let dxyz = dx * dy * dz;
    let p2 = dp * dp;
    let e2 = dx * dy + dx * dz + dy * dz - 3.0 * p2;
    let e3 = dxyz + 2.0 * e2 * dp + 4.0 * p2 * dp;
    let e4 = (2.0 * dxyz + e2 * dp + 3.0 * p2 * dp) * dp;
    let e5 = dxyz * p2;
    1.0 - 3.0 / 14.0 * e2 + e3 / 6.0 + 9.0 / 88.0 * e2 * e2 - 3.0 / 22.0 * e4 - 9.0 / 52.0 * e2 * e3 + 3.0 / 26.0 * e5
        - e2 * e2 * e2 / 16.0
        + 3.0 / 40.0 * e3 * e3
        + 3.0 / 20.0 * e2 * e4
        + 45.0 / 272.0 * e2 * e2 * e3
        - 9.0 / 68.0 * (e3 * e4 + e2 * e5)
}

/// K(m), by the arithmetic-geometric mean of 1 and √m₁; infinite for m₁ = 0. Relative error below 4e-16.
pub fn complete_first(parameter: &Parameter) -> f64 {
    let (mut a, mut b) = (1.0, parameter.m1.sqrt());
    if b == 0.0 {
        return f64::INFINITY;
    }
    while (a - b).abs() > 1e-8 * a {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    PI / (a + b)
}

/// K(m) to 30 digits from the complementary modulus k′ = √m₁ in (0, 1], for phases of long arguments.
pub fn complete_first_extended(complementary_modulus: DoubleDouble) -> DoubleDouble {
    let one = DoubleDouble::new(1.0);
    QuarterPeriod::new(complementary_modulus, one, one, one).first
}

/// Π(n | m) for n < 1; infinite for m₁ = 0. Relative error below 2e-15.
pub fn complete_third(n: f64, parameter: &Parameter) -> f64 {
    if parameter.m1 == 0.0 {
        return f64::INFINITY;
    }
    carlson_rf(0.0, parameter.m1, 1.0) + n / 3.0 * carlson_rj(0.0, parameter.m1, 1.0, 1.0 - n)
}

/// F(φ | m) for any φ; for m₁ = 0 with |φ| < π⁄2. Relative error below 2e-15 plus the conditioning of φ near odd multiples
/// of π⁄2, where F is as steep as 1⁄√m₁.
pub fn incomplete_first(phi: f64, parameter: &Parameter) -> f64 {
    let (turns, s, c) = reduced_amplitude(phi);
    let part = s * carlson_rf(c * c, c * c + parameter.m1 * s * s, 1.0);
    if turns == 0.0 { part } else { 2.0 * turns * complete_first(parameter) + part }
}

/// Π(n; φ | m) for n < 1 and any φ; for m₁ = 0 with |φ| < π⁄2. Relative error below 4e-15 plus the conditioning of φ; for
/// n > 0 the two terms of 19.25.14 have one sign, for n ≪ −1 the digits of 1 + |n| sin²φ are lost at worst.
pub fn incomplete_third(n: f64, phi: f64, parameter: &Parameter) -> f64 {
    let (turns, s, c) = reduced_amplitude(phi);
    let (s2, c2) = (s * s, c * c);
    let d2 = c2 + parameter.m1 * s2;
    let part =
        s * (carlson_rf(c2, d2, 1.0) + n / 3.0 * s2 * carlson_rj(c2, d2, 1.0, c2 + (1.0 - n) * s2));
    if turns == 0.0 { part } else { 2.0 * turns * complete_third(n, parameter) + part }
}

/// φ less the nearest multiple of π: the multiple, and sine and cosine of the rest.
fn reduced_amplitude(phi: f64) -> (f64, f64, f64) {
    let half_turns = (phi / PI).round();
    let (s, c) = (phi - half_turns * PI).sin_cos();
    if half_turns == 0.0 {
        return (0.0, s, c);
    }
    let (s, c) = phi.sin_cos();
    let sign = if half_turns.rem_euclid(2.0) == 0.0 { 1.0 } else { -1.0 };
    (half_turns, sign * s, sign * c)
}

/// K and an average over a quarter period, both to 30 digits, by Bulirsch's general complete integral.
///
/// ```text
/// average = (1⁄K) ∫₀ᴷ (a cn²u + b sn²u) ⁄ (cn²u + p sn²u) du,      p > 0,
/// ```
///
/// that is cel(k′, p, a, b)⁄K, so that with a = b = 1, p = 1 − n the average is Π(n | m)⁄K. Six steps at k′ = ½, nine at
/// 1e-16; each costs a square root and two divisions of double-doubles, about 60 ns.
#[derive(Clone, Copy, Debug)]
pub struct QuarterPeriod {
    /// K(m).
    pub first: DoubleDouble,
    /// The average of the integrand.
    pub average: DoubleDouble,
}

impl QuarterPeriod {
    /// From the complementary modulus k′ in (0, 1], p > 0 and weights a, b ≥ 0; not finite outside.
    pub fn new(complementary_modulus: DoubleDouble, p: DoubleDouble, a: DoubleDouble, b: DoubleDouble) -> Self {
        let mut kc = complementary_modulus;
        let mut e = kc;
        // 2ⁿ times the n-th mean of 1 and k′
        let mut mean = DoubleDouble::new(1.0);
        let mut power = 1.0;
        let mut p = p.sqrt();
        let (mut a, mut b) = (a, b / p);
        loop {
            let (f, g) = (a, e / p);
            a = a + b / p;
            b = (b + f * g).scale(2.0);
            p = p + g;
            let old = mean;
            mean = mean + kc;
            // what is left is of the order of this difference squared
            let settled = (old.hi - kc.hi).abs() <= 1e-15 * old.hi;
            if settled || mean.hi.is_nan() {
                break;
            }
            kc = e.sqrt().scale(2.0);
            e = kc * mean;
            power *= 2.0;
        }
        Self { first: DoubleDouble::PI.scale(power) / mean, average: (a * mean + b).scale(0.5 / power) / (mean + p) }
    }
}

/// sn, cn, dn and am at any real u.
///
/// u is reduced modulo 2K with K in double-double, then to |u| ≤ K⁄2, so that each function keeps a relative error below
/// 2e-15 also at its zeros, for arguments up to about 1e15 K. For m₁ = 0 the functions are tanh, sech, sech and the
/// Gudermannian. About 150 ns for |u| ≤ K, 500 ns beyond.
pub fn jacobi(u: f64, parameter: &Parameter) -> Jacobi {
    let m1 = parameter.m1;
    if m1 == 0.0 {
        let sech = 1.0 / u.cosh();
        return Jacobi { sn: u.tanh(), cn: sech, dn: sech, am: u.sinh().atan() };
    }
    let half_period = complete_first(parameter);
    if u.abs() <= 0.5 * half_period {
        let (sn, cn, dn) = gauss_descent(u, m1);
        return Jacobi { sn, cn, dn, am: sn.atan2(cn) };
    }
    // u = n K + rest
    let k = complete_first_extended(DoubleDouble::new(m1).sqrt());
    let n = (u / k.hi).round();
    let rest = (DoubleDouble::new(u) - k * n).hi;
    let (s, c, d) = gauss_descent(rest, m1);
    let half_turns = (0.5 * n).floor();
    let sign = if half_turns.rem_euclid(2.0) == 0.0 { 1.0 } else { -1.0 };
    let (sn, cn, dn) = if n.rem_euclid(2.0) == 0.0 {
        (s, c, d)
    } else {
        let k1 = m1.sqrt();
        (c / d, -k1 * s / d, k1 / d)
    };
    Jacobi { sn: sign * sn, cn: sign * cn, dn, am: half_turns * PI + sn.atan2(cn) }
}

/// sn, cn, dn for |u| ≤ K⁄2 and m₁ > 0: the arithmetic-geometric means aᵢ, bᵢ up to aₙ = bₙ, where the functions are circular,
/// then down again with gᵢ = aᵢ cs and dᵢ = dn at level i.
fn gauss_descent(u: f64, m1: f64) -> (f64, f64, f64) {
    let (mut a, mut b) = ([0.0; MEANS], [0.0; MEANS]);
    let (mut an, mut bn) = (1.0, m1.sqrt());
    let mut n = 0;
    while n < MEANS {
        (a[n], b[n]) = (an, bn);
        let done = (an - bn).abs() <= 1e-8 * an;
        (an, bn) = (0.5 * (an + bn), (an * bn).sqrt());
        n += 1;
        if done {
            break;
        }
    }
    let (s, c) = (u * an).sin_cos();
    if s == 0.0 {
        return (u, 1.0, 1.0);
    }
    let mut g = an * (c / s);
    let mut d = 1.0;
    for i in (0..n).rev() {
        let square = g * g / an;
        g *= d;
        d = (b[i] + square) / (a[i] + square);
        an = a[i];
    }
    let sn = (1.0 / (g * g + 1.0).sqrt()).copysign(s);
    (sn, g * sn, d)
}

/// More steps than the means ever take: thirteen from m₁ = 5e-324.
const MEANS: usize = 16;
