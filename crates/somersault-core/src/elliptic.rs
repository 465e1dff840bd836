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
//! accuracy: K ≈ ½ ln(16⁄m₁). A [`Parameter`] therefore carries both, and no function here subtracts one from 1.
//!
//! Carlson's integrals are those of the crate `ellip`, whose error was found below 1e-15 (against mpmath, arguments from 1e-200
//! to 1e30). Its Legendre integrals take m alone, so that an m₁ below 1e-16 cannot be written down, it has no Jacobi functions,
//! and `f64` periods are too coarse for the phase of a long argument; these are written here: Legendre's integrals on
//! Carlson's, periods by the arithmetic-geometric mean (DLMF §19.8(i)) and Bulirsch's extension of it (Numerische Mathematik 13,
//! 1969, 305–315) in double-double, Jacobi's functions by the descending Gauss transformation (§22.7(i)).

use crate::double_double::DoubleDouble;
use std::f64::consts::PI;

/// The parameter m of an elliptic integral with its complement m₁ = 1 − m, both to full relative accuracy.
///
/// The complement is kept in double-double, so that m as given is exact for long arguments too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    m: f64,
    m1: DoubleDouble,
}

impl Parameter {
    /// From m in [0, 1], exactly.
    pub fn from_m(m: f64) -> Self {
        Self { m, m1: DoubleDouble::difference(1.0, m) }
    }

    /// From the complement m₁ in [0, 1], exactly.
    pub fn from_complement(m1: f64) -> Self {
        Self { m: 1.0 - m1, m1: DoubleDouble::new(m1) }
    }

    /// From both, where the caller has formulas for each that do not cancel. They must add up to 1 within rounding.
    pub fn new(m: f64, m1: f64) -> Self {
        Self { m, m1: DoubleDouble::new(m1) }
    }

    /// The parameter m = k².
    pub fn m(&self) -> f64 {
        self.m
    }

    /// The complement m₁ = 1 − m.
    pub fn m1(&self) -> f64 {
        self.m1.hi
    }

    /// The parameter with m and m₁ exchanged.
    pub fn complement(&self) -> Self {
        Self { m: self.m1.hi, m1: DoubleDouble::new(self.m) }
    }

    /// The complementary modulus k′ = √m₁, to 30 digits.
    pub fn complementary_modulus(&self) -> DoubleDouble {
        self.m1.sqrt()
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
/// NaN outside. Relative error below 1e-15; about 60 ns.
pub fn carlson_rf(x: f64, y: f64, z: f64) -> f64 {
    ellip::elliprf(x, y, z).unwrap_or(f64::NAN)
}

/// Carlson's R_C(x, y) = R_F(x, y, y) for x ≥ 0, y ≠ 0; for y < 0 the Cauchy principal value.
///
/// NaN outside. Relative error below 1e-15.
pub fn carlson_rc(x: f64, y: f64) -> f64 {
    ellip::elliprc(x, y).unwrap_or(f64::NAN)
}

/// Carlson's R_J(x, y, z, p) for x, y, z ≥ 0, at most one of them zero, and p ≠ 0; symmetric in x, y, z. For p < 0 the Cauchy
/// principal value.
///
/// NaN outside. Relative error below 2e-15 for p > 0.
pub fn carlson_rj(x: f64, y: f64, z: f64, p: f64) -> f64 {
    ellip::elliprj(x, y, z, p).unwrap_or(f64::NAN)
}

/// Carlson's R_D(x, y, z) = R_J(x, y, z, z) for x, y ≥ 0, not both zero, and z > 0; symmetric in x and y.
///
/// NaN outside. Relative error below 2e-15.
pub fn carlson_rd(x: f64, y: f64, z: f64) -> f64 {
    ellip::elliprd(x, y, z).unwrap_or(f64::NAN)
}

/// K(m), by the arithmetic-geometric mean of 1 and √m₁; infinite for m₁ = 0. Relative error below 4e-16.
pub fn complete_first(parameter: &Parameter) -> f64 {
    let (mut a, mut b) = (1.0, parameter.m1().sqrt());
    if b == 0.0 {
        return f64::INFINITY;
    }
    while (a - b).abs() > 1e-8 * a {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    PI / (a + b)
}

/// Π(n | m) for n < 1; infinite for m₁ = 0. Relative error below 2e-15.
pub fn complete_third(n: f64, parameter: &Parameter) -> f64 {
    if parameter.m1() == 0.0 {
        return f64::INFINITY;
    }
    carlson_rf(0.0, parameter.m1(), 1.0) + n / 3.0 * carlson_rj(0.0, parameter.m1(), 1.0, 1.0 - n)
}

/// F(φ | m) for any φ; for m₁ = 0 with |φ| < π⁄2. Relative error below 2e-15 plus the conditioning of φ near odd multiples
/// of π⁄2, where F is as steep as 1⁄√m₁.
pub fn incomplete_first(phi: f64, parameter: &Parameter) -> f64 {
    let (turns, s, c) = reduced_amplitude(phi);
    let part = s * carlson_rf(c * c, c * c + parameter.m1() * s * s, 1.0);
    if turns == 0.0 { part } else { 2.0 * turns * complete_first(parameter) + part }
}

/// Π(n; φ | m) for n < 1 and any φ; for m₁ = 0 with |φ| < π⁄2. Relative error below 4e-15 plus the conditioning of φ; for
/// n > 0 the two terms of 19.25.14 have one sign, for n ≪ −1 the digits of 1 + |n| sin²φ are lost at worst.
pub fn incomplete_third(n: f64, phi: f64, parameter: &Parameter) -> f64 {
    let (turns, s, c) = reduced_amplitude(phi);
    let (s2, c2) = (s * s, c * c);
    let d2 = c2 + parameter.m1() * s2;
    let part = s * (carlson_rf(c2, d2, 1.0) + n / 3.0 * s2 * carlson_rj(c2, d2, 1.0, c2 + (1.0 - n) * s2));
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
    pub fn new(
        complementary_modulus: DoubleDouble,
        p: DoubleDouble,
        a: DoubleDouble,
        b: DoubleDouble,
    ) -> Self {
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
        Self {
            first: DoubleDouble::PI.scale(power) / mean,
            average: (a * mean + b).scale(0.5 / power) / (mean + p),
        }
    }
}

/// sn, cn, dn and am at any real u.
///
/// u is reduced modulo 2K with K in double-double, then to |u| ≤ K⁄2, so that each function keeps a relative error below
/// 4e-15, also at its zeros, for arguments up to about 1e15 K; where K is large, up to that of half an ulp of K⁄2 in u. For m₁ = 0 the functions are tanh, sech, sech and the
/// Gudermannian. About 150 ns for |u| ≤ K, 500 ns beyond.
pub fn jacobi(u: f64, parameter: &Parameter) -> Jacobi {
    let m1 = parameter.m1();
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
    let one = DoubleDouble::new(1.0);
    let k = QuarterPeriod::new(parameter.complementary_modulus(), one, one, one).first;
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

#[cfg(test)]
mod tests {
    use super::*;

    // Golden values: mpmath 1.4 at 60 digits (ellipk, ellipf, ellippi, ellipfun, elliprf, elliprc, elliprj, elliprd), of the
    // arguments as they stand here in binary, rounded to f64. `true` marks a complement.

    fn parameter(is_complement: bool, value: f64) -> Parameter {
        if is_complement { Parameter::from_complement(value) } else { Parameter::from_m(value) }
    }

    fn assert_close(found: f64, expected: f64, tolerance: f64, what: &str) {
        assert!(
            (found - expected).abs() <= tolerance * expected.abs(),
            "{what}: {found:e}, expected {expected:e}, off by {:e}",
            found / expected - 1.0
        );
    }

    #[rustfmt::skip]
    #[allow(clippy::approx_constant)]
    const JACOBI: [(bool, f64, f64, f64, f64, f64, f64); 46] = [
        (false, 0.0, 4.712389451623588, -0.999999999999889, 4.712388983857671e-7, 1.0, 4.712389451623588),
        (false, 0.0, -1.3, -0.963558185417193, 0.26749882862458735, 1.0, -1.3),
        (false, 0.0, 1.5236724369910497, 0.99888987496197, 0.04710645070964268, 1.0, 1.5236724369910497),
        (false, 0.0, 3e11, -0.4178078179506031, -0.908535429831636, 1.0, 3e11),
        (false, 0.0, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (false, 1e-20, 0.4, 0.3894183423086505, 0.9210609940028851, 1.0, 0.4),
        (false, 1e-20, 3e11, -0.4178078172692015, -0.9085354301449919, 1.0, 3e11),
        (false, 1e-20, -1.3, -0.963558185417193, 0.26749882862458735, 1.0, -1.3),
        (false, 1e-20, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (false, 0.0009765625, 3e11, 0.49810226185910367, 0.8671182945428179, 0.9998788472199526, 299926735448.7452),
        (false, 0.0009765625, 1.5240446318111902, 0.9988904162784451, 0.047094970719543265, 0.9995126829877578, 1.5236839297364229),
        (false, 0.0009765625, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (false, 0.0009765625, 12345.678, 0.6088862315486817, -0.7932575603361403, 0.99981895702824, 12342.662880165144),
        (false, 0.0009765625, -7500000.0, 0.3845162808758021, -0.9231182100584092, 0.9999278036583663, -7498168.386305316),
        (true, 0.7, 12345.678, -0.8998182334395136, 0.4362649960400135, 0.8701138684281143, 11314.897385537173),
        (true, 0.7, 0.4, 0.3865679212384839, 0.9222609404443828, 0.9773277713647592, 0.3969073022515188),
        (true, 0.7, -7500000.0, 0.6962173712204954, 0.7178310191199756, 0.9244373486630918, -6873822.805495977),
        (true, 0.7, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (false, 0.5, 12345.678, -0.9044579716257335, -0.4265627475092777, 0.7687508626215205, 10459.492051116495),
        (false, 0.5, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (false, 0.5, 3e11, 0.7789922006952384, 0.6270336125408185, 0.8346170233274628, 254163925438.2797),
        (false, 0.5, -7500000.0, -0.7742147445692026, 0.6329230042364113, 0.8368367610506975, -6354098.222029886),
        (false, 0.75, 2.091820178074654, 0.9994763101785926, 0.03235900789248263, 0.5007847132689249, 1.538431669024528),
        (false, 0.75, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (false, 0.75, 12345.678, 0.9819463068863569, 0.18915985407121857, 0.5261521527031734, 8992.61866441741),
        (false, 0.75, 3e11, 0.3482605794727239, -0.9373977644443806, 0.9534337557423651, 218518654656.94357),
        (true, 0.1, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (true, 0.1, 2.500749349947728, 0.9997003827418827, 0.024477433397588032, 0.3170792176588684, 1.5463164484837972),
        (true, 0.1, 3e11, 0.9923971034079099, -0.12307716745030439, 0.33709522428066413, 182785904195.7149),
        (true, 0.1, 0.4, 0.380891762070405, 0.9246196329231291, 0.9324319380138218, 0.3907605688044569),
        (true, 0.001, 12345.678, -0.6584450927831801, -0.7526287662518284, 0.7529167349248916, 4006.249384247589),
        (true, 0.001, 0.4, 0.3799583856635797, 0.9250035811627577, 0.9250816145285574, 0.3897513077609229),
        (true, 0.001, 3e11, 0.8727630110521094, 0.48814416573309116, 0.48892375869118526, 97340630967.54518),
        (true, 0.001, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (true, 1e-8, -1.3, -0.8617231606309563, 0.5073787485027285, 0.5073787558204058, -1.038656142111367),
        (true, 1e-8, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (true, 1e-8, 3e11, 0.999987459848779, 0.005008008105683157, 0.0050090063820868455, 44470618158.322365),
        (true, 1e-8, 31.78990745025341, -1.0, 3.1789904282139574e-10, 0.0001000000000005053, 4.712388980702589),
        (true, 1e-16, 19.21276585192009, 1.0, 6.297994892091175e-9, 1.1817983739234308e-8, 1.5707963204969018),
        (true, 1e-16, 59.420931257309306, -1.0, 5.942092536126459e-14, 1.0000000000176542e-8, 4.712388980384749),
        (true, 1e-16, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (true, 1e-16, 12345.678, -0.9999999999982224, 1.8854851113046444e-6, 1.8855116294925064e-6, 978.6061134787057),
        (true, 1e-30, 1e-9, 1e-9, 1.0, 1.0, 1e-9),
        (true, 1e-30, 34.84731863334966, 1.0, 1.2988539767171355e-15, 1.6392137300650934e-15, 1.5707963267948952),
        (true, 1e-30, -7500000.0, 0.9999355792655291, 0.01135065279668205, 0.01135065279668205, -327930.4481068867),
        (true, 1e-30, 107.77522304561296, -1.0, 1.0777521233655596e-20, 1.0000000000580776e-15, 4.71238898038469),
    ];

    #[test]
    fn jacobi_functions_keep_their_relative_accuracy_for_all_moduli_and_long_arguments() {
        for (complement, value, u, sn, cn, dn, am) in JACOBI {
            let found = jacobi(u, &parameter(complement, value));
            let what = format!("{complement} {value:e} at {u:e}");
            assert_close(found.sn, sn, 4e-15, &format!("sn {what}"));
            assert_close(found.cn, cn, 4e-15, &format!("cn {what}"));
            assert_close(found.dn, dn, 4e-15, &format!("dn {what}"));
            assert_close(found.am, am, 1e-15, &format!("am {what}"));
        }
    }

    #[rustfmt::skip]
    #[allow(clippy::approx_constant)]
    const COMPLETE: [(bool, f64, f64, f64, f64); 22] = [
        (false, 0.0, -3.0, 1.5707963267948966, 0.7853981633974483),
        (false, 0.0, 0.6, 1.5707963267948966, 2.4836470664490253),
        (false, 1e-20, -3.0, 1.5707963267948966, 0.7853981633974483),
        (false, 1e-20, 0.6, 1.5707963267948966, 2.4836470664490253),
        (false, 0.0009765625, -3.0, 1.5711800327950414, 0.7855260575878528),
        (false, 0.0009765625, 0.6, 1.5711800327950414, 2.484390385294216),
        (true, 0.7, -3.0, 1.7138894481787912, 0.8320678424199239),
        (true, 0.7, 0.6, 1.7138894481787912, 2.765041461426732),
        (false, 0.5, -3.0, 1.8540746773013719, 0.8760028274011438),
        (false, 0.5, 0.6, 1.8540746773013719, 3.0486233926644046),
        (false, 0.75, -3.0, 2.1565156474996434, 0.9660073560143947),
        (false, 0.75, 0.6, 2.1565156474996434, 3.685091270264895),
        (true, 0.1, -3.0, 2.5780921133481733, 1.0837422223440127),
        (true, 0.1, 0.6, 2.5780921133481733, 4.620687687139782),
        (true, 0.001, -3.0, 4.841132560550297, 1.6633825749047402),
        (true, 0.001, 0.6, 4.841132560550297, 10.11057043265235),
        (true, 1e-8, -3.0, 10.59663475708766, 3.1026085214316867),
        (true, 1e-8, 0.6, 10.59663475708766, 24.493672706112235),
        (true, 1e-16, -3.0, 19.806975105072258, 5.405193617326619),
        (true, 1e-16, 0.6, 19.806975105072258, 47.519523411735754),
        (true, 1e-30, -3.0, 35.92507075603058, 9.434717530066198),
        (true, 1e-30, 0.6, 35.92507075603058, 87.81476253913155),
    ];

    #[test]
    fn complete_integrals_agree_with_forty_digits() {
        for (complement, value, n, k, pi) in COMPLETE {
            let p = parameter(complement, value);
            assert_close(complete_first(&p), k, 4e-16, "K");
            assert_close(complete_third(n, &p), pi, 2e-15, &format!("Π({n} | {value:e})"));
            let one = DoubleDouble::new(1.0);
            let quarter = QuarterPeriod::new(p.complementary_modulus(), one - DoubleDouble::new(n), one, one);
            assert_close(quarter.first.hi, k, 3e-16, "K, extended");
            assert_close((quarter.first * quarter.average).hi, pi, 3e-16, "K times the average");
        }
        assert_eq!(complete_first(&Parameter::from_complement(0.0)), f64::INFINITY);
    }

    #[rustfmt::skip]
    #[allow(clippy::approx_constant)]
    const INCOMPLETE: [(bool, f64, f64, f64, f64, f64); 33] = [
        (false, 0.0, 0.98, -2.0, -2.0, -20.095191607786766),
        (false, 0.0, -0.01, 1.5, 1.5, 1.4929042319761046),
        (false, 0.0, -0.01, 1e-8, 1e-8, 1e-8),
        (false, 1e-20, -3.0, 1.2, 1.2, 0.6894004892658616),
        (false, 1e-20, -0.01, 1e-8, 1e-8, 1e-8),
        (false, 1e-20, 0.98, 7.0, 7.0, 45.29590516373493),
        (false, 0.0009765625, -3.0, 1.5, 1.5003491699223197, 0.7677961257574868),
        (false, 0.0009765625, -3.0, -2.0, -2.000581011556385, -0.8980555064711234),
        (false, 0.0009765625, 0.98, 1e-8, 1e-8, 1e-8),
        (true, 0.7, 0.98, 1.2, 1.274832760386613, 2.6973126170373254),
        (true, 0.7, 0.98, 1.5, 1.6293018873244831, 9.046713412992467),
        (true, 0.7, -3.0, 1e-8, 1e-8, 9.999999999999999e-9),
        (false, 0.5, -0.01, 1e-8, 1e-8, 1e-8),
        (false, 0.5, -0.01, 0.3, 0.3022546685750176, 0.3021651299206619),
        (false, 0.5, 0.98, 1.5, 1.7540369168667462, 10.348777838355566),
        (false, 0.75, -3.0, 7.0, 9.392246854553152, 4.41704321115942),
        (false, 0.75, -0.01, -2.0, -2.9525696736557796, -2.932617742863211),
        (false, 0.75, 0.98, 0.3, 0.3034170018010327, 0.3127452393202954),
        (true, 0.1, -0.01, 1e-8, 1e-8, 1e-8),
        (true, 0.1, 0.98, 0.3, 0.30412616230154565, 0.31349392540925547),
        (true, 0.1, -0.01, 7.0, 11.090943055385205, 11.02472151905027),
        (true, 0.001, -3.0, 1e-8, 1e-8, 9.999999999999999e-9),
        (true, 0.001, 0.98, -2.0, -8.159742654909165, -223.34674842750726),
        (true, 0.001, -0.01, 1.5, 3.2950027527258308, 3.2722114131279167),
        (true, 1e-8, 0.98, 1.2, 1.6736992359965512, 4.157123502408884),
        (true, 1e-8, -3.0, 7.0, 43.174032233691186, 12.97529299880566),
        (true, 1e-8, 0.6, 0.3, 0.3046039743537185, 0.3102341769914894),
        (true, 1e-16, 0.98, 1.5, 3.340677542798306, 41.64527970936115),
        (true, 1e-16, 0.98, 1.2, 1.6736992495582428, 4.157123559637409),
        (true, 1e-16, 0.98, 7.0, 80.01539362655063, 3438.8522632238996),
        (true, 1e-30, 0.98, 0.3, 0.3046039744017041, 0.31399842332284866),
        (true, 1e-30, -0.01, 1.2, 1.673699249558243, 1.6663294966070576),
        (true, 1e-30, 0.6, -2.0, -70.32668906849848, -173.51698776881557),
    ];

    #[test]
    fn incomplete_integrals_agree_with_forty_digits() {
        for (complement, value, n, phi, first, third) in INCOMPLETE {
            let p = parameter(complement, value);
            let what = format!("{n}; {phi} | {complement} {value:e}");
            assert_close(incomplete_first(phi, &p), first, 2e-15, &what);
            assert_close(incomplete_third(n, phi, &p), third, 4e-15, &what);
        }
    }

    #[rustfmt::skip]
    #[allow(clippy::approx_constant)]
    const CARLSON: [([f64; 4], f64, f64, f64, f64); 9] = [
        ([1.0, 2.0, 3.0, 4.0], 0.7269459354689082, 0.6045997880780726, 0.23984809974956775, 0.29046028102899063),
        ([0.0, 1.0, 2.0, 3.0], 1.3110287771460598, 0.9068996821171089, 0.7768862377858233, 1.0679379896673957),
        ([1e-30, 1.0, 2.0, 0.5], 1.3110287771460591, 2.2214414690791813, 2.936671269238114, 1.0679379896673946),
        ([0.0, 1e-20, 1.0, 1000.0], 24.412145291060348, 0.04967294132898051, 0.07309034448545482, 70.23643587318104),
        ([1e-10, 1e10, 3.0, 1e-5], 0.00012349907909121283, 495.73189028877897, 0.008576342526333472, 9.999942249031543e-6),
        ([2.0, 2.0, 2.0, 2.0], 0.7071067811865476, 0.7071067811865476, 0.3535533905932738, 0.3535533905932738),
        ([1.0, 1.0001, 0.9999, 1.0002], 1.000000001, 0.9999333413321907, 0.9998800192827147, 1.0000600064290714),
        ([5e-300, 0.001, 1.0, 1.0], 4.841132560550297, 1.5707963267948966, 11.528413722870425, 11.528413722870425),
        ([1e100, 1e98, 2e100, 1e99], 1.2447653461535466e-50, 1.9168108714139515e-50, 6.607657522037543e-150, 9.708927710640627e-151),
    ];

    #[test]
    fn symmetric_integrals_agree_with_forty_digits() {
        for ([x, y, z, p], rf, rc, rj, rd) in CARLSON {
            let what = format!("{x:e}, {y:e}, {z:e}, {p:e}");
            assert_close(carlson_rf(x, y, z), rf, 1e-15, &format!("R_F {what}"));
            assert_close(carlson_rc(x, p), rc, 1e-15, &format!("R_C {what}"));
            assert_close(carlson_rj(x, y, z, p), rj, 2e-15, &format!("R_J {what}"));
            assert_close(carlson_rd(x, y, z), rd, 2e-15, &format!("R_D {what}"));
        }
        assert_close(carlson_rc(0.25, -2.0), 0.23104906018664845, 1e-15, "R_C, principal value");
        assert!(carlson_rf(-1.0, 1.0, 1.0).is_nan());
        assert!(carlson_rf(0.0, 0.0, 1.0).is_nan());
    }

    #[test]
    fn jacobi_functions_on_the_separatrix_are_hyperbolic() {
        let separatrix = Parameter::from_complement(0.0);
        let found = jacobi(1.5, &separatrix);
        assert_eq!((found.sn, found.cn, found.dn), (1.5f64.tanh(), 1.0 / 1.5f64.cosh(), 1.0 / 1.5f64.cosh()));
        let near = jacobi(1.5, &Parameter::from_complement(1e-30));
        assert!((near.sn - found.sn).abs() < 3e-16 && (near.am - found.am).abs() < 3e-16);
    }
}
