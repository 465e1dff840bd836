//! Numbers of about 32 digits as unevaluated sums of two `f64`.
//!
//! A [`DoubleDouble`] holds `hi + lo` with `|lo| ≤ ulp(hi)/2`. Sums and products are built from the error-free
//! transformations of Dekker (1971) and Knuth, the algorithms being those collected by Joldes, Muller and Popescu,
//! *Tight and rigorous error bounds for basic building blocks of double-word arithmetic*, ACM TOMS 44 (2017). The relative
//! error of one operation is a few units of 2⁻¹⁰⁴ as long as nothing underflows: factors whose product falls below about
//! 1e-290 keep `f64` accuracy only. Overflow gives infinities or NaN.
//!
//! They serve where a difference must keep its digits, or where a frequency is multiplied by a long time and the phase
//! taken modulo one turn.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// The unevaluated sum `hi + lo`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DoubleDouble {
    /// The number rounded to `f64`.
    pub hi: f64,
    /// What the rounding left.
    pub lo: f64,
}

/// `a + b` exactly, as rounded sum and error.
#[inline(always)]
pub fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let t = s - a;
    (s, (a - (s - t)) + (b - t))
}

/// `a + b` exactly for `|a| ≥ |b|`.
#[inline(always)]
fn quick_two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    (s, b - (s - a))
}

/// `a b` exactly, as rounded product and error; barring underflow, and overflow of `2²⁷ a`.
#[inline(always)]
pub fn two_prod(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    if cfg!(target_feature = "fma") {
        return (p, a.mul_add(b, -p));
    }
    let (ah, al) = split(a);
    let (bh, bl) = split(b);
    (p, ((ah * bh - p) + ah * bl + al * bh) + al * bl)
}

/// Dekker's split into two halves of 26 bits.
#[inline(always)]
fn split(a: f64) -> (f64, f64) {
    let t = 134_217_729.0 * a;
    let h = t - (t - a);
    (h, a - h)
}

impl DoubleDouble {
    /// π to 32 digits.
    pub const PI: Self = Self { hi: std::f64::consts::PI, lo: 1.224_646_799_147_353_2e-16 };

    /// The number `hi`.
    #[inline(always)]
    pub const fn new(hi: f64) -> Self {
        Self { hi, lo: 0.0 }
    }

    /// `a − b` without rounding.
    #[inline(always)]
    pub fn difference(a: f64, b: f64) -> Self {
        let (hi, lo) = two_sum(a, -b);
        Self { hi, lo }
    }

    /// `a b` without rounding.
    #[inline(always)]
    pub fn product(a: f64, b: f64) -> Self {
        let (hi, lo) = two_prod(a, b);
        Self { hi, lo }
    }

    /// The square root; zero for zero, NaN for negative numbers.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        let r = self.hi.sqrt();
        if r == 0.0 {
            return Self::new(r);
        }
        let square = Self::product(r, r);
        let rest = (self.hi - square.hi) - square.lo + self.lo;
        let (hi, lo) = quick_two_sum(r, rest / (2.0 * r));
        Self { hi, lo }
    }

    /// The absolute value.
    #[inline(always)]
    pub fn abs(self) -> Self {
        if self.hi < 0.0 { -self } else { self }
    }

    /// `2ⁿ`-fold for a power of two `scale`: exact.
    #[inline(always)]
    pub fn scale(self, scale: f64) -> Self {
        Self { hi: self.hi * scale, lo: self.lo * scale }
    }

    /// The fractional part of `self · t`, in [−½, ½], within about `1.2e-16 + 1e-31 |self · t|`.
    ///
    /// With a frequency in turns per unit of time this is the phase at time `t`, in turns.
    #[inline(always)]
    pub fn fraction_of_turns(self, t: f64) -> f64 {
        let (p, e) = two_prod(self.hi, t);
        let e = e + self.lo * t;
        let f = (p - p.round()) + (e - e.round());
        f - f.round()
    }
}

/// One term a (b − c) d² of [`difference_of_cubic_products`].
#[derive(Clone, Copy, Debug)]
pub struct CubicProduct {
    /// The factor a.
    pub factor: f64,
    /// b and c.
    pub gap: [f64; 2],
    /// d.
    pub root: DoubleDouble,
}

/// `a (b − c) d² − e (f − g) h²` without cancellation.
///
/// Plain double-double arithmetic where its result keeps 60 bits. Else, and if d and h are plain numbers, the exact sum of
/// the 32 partial products, which tells zero from almost zero; barring underflow. About 30 ns, or 1 µs for the exact sum.
pub fn difference_of_cubic_products(minuend: &CubicProduct, subtrahend: &CubicProduct) -> DoubleDouble {
    let product = |term: &CubicProduct| {
        term.root * term.root * DoubleDouble::difference(term.gap[0], term.gap[1]) * term.factor
    };
    let (x, y) = (product(minuend), product(subtrahend));
    let difference = x - y;
    let plain = minuend.root.lo == 0.0 && subtrahend.root.lo == 0.0;
    if !plain || difference.hi.abs() > 1e-13 * (x.hi.abs() + y.hi.abs()) {
        return difference;
    }
    let mut expansion = Expansion { parts: [0.0; 32], len: 0 };
    for (sign, term) in [(1.0, minuend), (-1.0, subtrahend)] {
        let gap = DoubleDouble::difference(term.gap[0], term.gap[1]);
        let square = DoubleDouble::product(term.root.hi, term.root.hi);
        for g in [gap.hi, gap.lo] {
            for s in [square.hi, square.lo] {
                let inner = DoubleDouble::product(g, s);
                for part in [inner.hi, inner.lo] {
                    let (p, e) = two_prod(sign * term.factor, part);
                    expansion.grow(e);
                    expansion.grow(p);
                }
            }
        }
    }
    expansion.parts.iter().fold(DoubleDouble::default(), |sum, part| sum + *part)
}

/// A sum held exactly as parts that do not overlap, in increasing order: Shewchuk, *Adaptive precision floating-point
/// arithmetic and fast robust geometric predicates*, Discrete Comput. Geom. 18 (1997).
struct Expansion {
    parts: [f64; 32],
    len: usize,
}

impl Expansion {
    fn grow(&mut self, term: f64) {
        let mut carry = term;
        for part in &mut self.parts[..self.len] {
            (carry, *part) = two_sum(carry, *part);
        }
        self.parts[self.len] = carry;
        self.len += 1;
    }
}

impl From<f64> for DoubleDouble {
    fn from(x: f64) -> Self {
        Self::new(x)
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn add(self, y: Self) -> Self {
        let (s, e) = two_sum(self.hi, y.hi);
        let (t, f) = two_sum(self.lo, y.lo);
        let (s, e) = quick_two_sum(s, e + t);
        let (hi, lo) = quick_two_sum(s, e + f);
        Self { hi, lo }
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn sub(self, y: Self) -> Self {
        self + (-y)
    }
}

impl Add<f64> for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn add(self, y: f64) -> Self {
        let (s, e) = two_sum(self.hi, y);
        let (hi, lo) = quick_two_sum(s, e + self.lo);
        Self { hi, lo }
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn mul(self, y: Self) -> Self {
        let (p, e) = two_prod(self.hi, y.hi);
        let (hi, lo) = quick_two_sum(p, e + (self.hi * y.lo + self.lo * y.hi));
        Self { hi, lo }
    }
}

impl Mul<f64> for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn mul(self, y: f64) -> Self {
        let (p, e) = two_prod(self.hi, y);
        let (hi, lo) = quick_two_sum(p, e + self.lo * y);
        Self { hi, lo }
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn div(self, y: Self) -> Self {
        let q = self.hi / y.hi;
        let back = y * q;
        let rest = (self.hi - back.hi) + (self.lo - back.lo);
        let (hi, lo) = quick_two_sum(q, rest / y.hi);
        Self { hi, lo }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dd(hi: f64, lo: f64) -> DoubleDouble {
        DoubleDouble { hi, lo }
    }

    #[test]
    fn products_and_quotients_invert_each_other_to_thirty_digits() {
        let mut x = dd(1.25, 3e-17);
        for i in 1..200 {
            let y = dd((i as f64).sqrt(), 1e-17 / i as f64);
            let back = (x * y) / y - x;
            assert!(back.hi.abs() < 1e-31 * x.hi.abs(), "{i}: {back:?}");
            let root = (x * x).sqrt() - x.abs();
            assert!(root.hi.abs() < 1e-31 * x.hi.abs(), "{i}: {root:?}");
            x = x + y.scale(0.5) - DoubleDouble::new(0.3);
        }
    }

    #[test]
    fn phases_of_long_times_keep_their_digits() {
        // 1/3 of a turn per second after 3e12 + 1 seconds; 1/3 = hi + lo with lo = 2⁻⁵⁴/3
        let third = DoubleDouble::new(1.0) / DoubleDouble::new(3.0);
        assert!((third.fraction_of_turns(3e12 + 1.0) - 1.0 / 3.0).abs() < 2e-16);
        assert!((third.fraction_of_turns(-3e12 + 1.0) - 1.0 / 3.0).abs() < 2e-16);
        // 10¹⁸ has remainder 1 modulo 3, 2·10¹⁸ remainder 2, that is −1/3 of a turn
        assert!((third.fraction_of_turns(1e18) - 1.0 / 3.0).abs() < 4e-13);
        assert!((third.fraction_of_turns(2e18) + 1.0 / 3.0).abs() < 4e-13);
    }

    #[test]
    fn cubic_products_that_agree_to_thirty_digits_are_told_apart() {
        // 1 · (2 − 1) · (3/4)² = 9/4 · (9/4 − 2) · 1², scaled by numbers of many bits
        let (r, s) = (1.0 + 2f64.powi(-48) * 3.0, 1.0 + 2f64.powi(-47) * 5.0);
        let term = |factor, gap, root| CubicProduct { factor, gap, root: DoubleDouble::new(root) };
        let x = term(r, [2.0 * r, r], 0.75 * s);
        let y = term(2.25 * r, [2.25 * r, 2.0 * r], s);
        assert_eq!(difference_of_cubic_products(&x, &y), DoubleDouble::default());
        let nudged = term(2.25 * r, [2.25 * r, 2.0 * r], s.next_up());
        let expected = -2.25 * 0.25 * 2.0 * f64::EPSILON;
        let found = difference_of_cubic_products(&x, &nudged).hi;
        assert!((found / expected - 1.0).abs() < 1e-12, "{found:e}, {expected:e}");
    }

    #[test]
    fn pi_is_the_zero_of_the_sine() {
        // sin(hi) = lo to first order, the next term being lo³/6
        assert_eq!(DoubleDouble::PI.hi.sin(), DoubleDouble::PI.lo);
    }
}
