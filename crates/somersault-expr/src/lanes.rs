//! Eight numbers at a time, and functions of them.
//!
//! Sine, cosine, exponential and logarithm are those of fdlibm (Sun Microsystems, 1993) without branches, with fused
//! multiplications: errors are below one unit in the last place. Loops over lanes are left to the compiler, which makes
//! vectors of them where the caller is compiled for a machine that has any. Without vectors, and for arguments beyond
//! [`LARGEST_ANGLE`], the functions are those of the standard library.

use somersault_core::double_double::two_sum;

/// Eight numbers.
pub(crate) type Lanes = [f64; LANES];

/// Numbers that are computed at a time.
pub const LANES: usize = 8;

/// Angles up to this one are reduced in lanes: their multiples of π/2 are exact to 159 bits.
const LARGEST_ANGLE: f64 = 1e9;

#[inline(always)]
fn each(x: Lanes, f: impl Fn(f64) -> f64) -> Lanes {
    let mut values = [0.0; LANES];
    for k in 0..LANES {
        values[k] = f(x[k]);
    }
    values
}

/// Adding and subtracting it rounds to an integer, which the lowest bits of the sum are.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

/// Σ cₖ xᵏ, the highest coefficient first.
#[inline(always)]
fn polynomial<const N: usize>(x: f64, coefficients: [f64; N]) -> f64 {
    let mut sum = coefficients[0];
    for &c in &coefficients[1..] {
        sum = sum.mul_add(x, c);
    }
    sum
}

/// The sine and the cosine of one number, and whether they are those.
#[inline(always)]
fn sine_and_cosine(x: f64) -> (f64, f64) {
    // π/2 in three parts of 53 bits
    const PARTS: [f64; 3] =
        [std::f64::consts::FRAC_PI_2, 6.123_233_995_736_766e-17, -1.497_384_904_859_169_8e-33];
    let shifted = x.mul_add(std::f64::consts::FRAC_2_PI, ROUNDING);
    let quadrant = shifted.to_bits();
    let n = shifted - ROUNDING;
    // exact, since π/2 · n and x have the same last digit; then the sum of two numbers without rounding
    let high = (-n).mul_add(PARTS[0], x);
    let product = n * PARTS[1];
    let product_error = n.mul_add(PARTS[1], -product);
    let (r, sum_error) = two_sum(high, -product);
    let tail = (-n).mul_add(PARTS[2], sum_error - product_error);
    let z = r * r;
    let p = polynomial(
        z,
        [
            1.589_690_995_211_55e-10,
            -2.505_076_025_340_686_3e-8,
            2.755_731_370_707_006_8e-6,
            -1.984_126_982_985_795e-4,
            8.333_333_333_322_49e-3,
        ],
    );
    let v = z * r;
    let sine = r - ((z * (0.5 * tail - v * p) - tail) - v * -1.666_666_666_666_663_2e-1);
    let q = z * polynomial(
        z,
        [
            -1.135_964_755_778_819_5e-11,
            2.087_572_321_298_175e-9,
            -2.755_731_435_139_066_3e-7,
            2.480_158_728_947_673e-5,
            -1.388_888_888_887_411e-3,
            4.166_666_666_666_66e-2,
        ],
    );
    let half = 0.5 * z;
    let w = 1.0 - half;
    let cosine = w + (((1.0 - w) - half) + (z * q - r * tail));
    let odd = quadrant & 1 == 1;
    let (s, c) = if odd { (cosine, sine) } else { (sine, cosine) };
    // −0 stays −0, which r is not where it is 0 − 0
    let s = if x == 0.0 { x } else { s };
    let flip = |value: f64, when: u64| f64::from_bits(value.to_bits() ^ ((when & 2) << 62));
    (flip(s, quadrant), flip(c, quadrant.wrapping_add(1)))
}

/// Sines and cosines.
#[inline(always)]
pub(crate) fn sin_cos<V: pulp::Simd>(x: Lanes) -> (Lanes, Lanes) {
    if V::IS_SCALAR {
        return (each(x, f64::sin), each(x, f64::cos));
    }
    let mut both = ([0.0; LANES], [0.0; LANES]);
    let mut reducible = true;
    for k in 0..LANES {
        (both.0[k], both.1[k]) = sine_and_cosine(x[k]);
        reducible &= x[k].abs() <= LARGEST_ANGLE;
    }
    if !reducible {
        for k in 0..LANES {
            if x[k].is_nan() || x[k].abs() > LARGEST_ANGLE {
                (both.0[k], both.1[k]) = x[k].sin_cos();
            }
        }
    }
    both
}

/// Sines.
#[inline(always)]
pub(crate) fn sin<V: pulp::Simd>(x: Lanes) -> Lanes {
    sin_cos::<V>(x).0
}

/// Cosines.
#[inline(always)]
pub(crate) fn cos<V: pulp::Simd>(x: Lanes) -> Lanes {
    sin_cos::<V>(x).1
}

/// ln 2 in two parts, the first one with 32 bits.
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];

#[inline(always)]
fn exponential(x: f64) -> f64 {
    // beyond these the result is 0 or infinite; NaN stays
    let within = if x > 710.0 { 710.0 } else { x };
    let within = if within < -746.0 { -746.0 } else { within };
    let shifted = within.mul_add(std::f64::consts::LOG2_E, ROUNDING);
    let n = shifted - ROUNDING;
    let high = (-n).mul_add(LN_2[0], within);
    let low = n * LN_2[1];
    let r = high - low;
    // the remainder of Remes: r coth(r/2) − 2, as in fdlibm
    let z = r * r;
    let c = r - z * polynomial(
        z,
        [
            4.138_136_797_057_238_5e-8,
            -1.653_390_220_546_525_2e-6,
            6.613_756_321_437_934e-5,
            -2.777_777_777_701_559_3e-3,
            1.666_666_666_666_660_2e-1,
        ],
    );
    let power = 1.0 - ((low - (r * c) / (2.0 - c)) - high);
    // 2ⁿ in two factors, so that neither overflows where the product does not
    let exponent = shifted.to_bits().wrapping_sub(ROUNDING.to_bits()) as i64;
    let first = exponent >> 1;
    let two_to = |k: i64| f64::from_bits((k.wrapping_add(1023) as u64) << 52);
    power * two_to(first) * two_to(exponent.wrapping_sub(first))
}

/// Exponentials.
#[inline(always)]
pub(crate) fn exp<V: pulp::Simd>(x: Lanes) -> Lanes {
    if V::IS_SCALAR {
        return each(x, f64::exp);
    }
    each(x, exponential)
}

#[inline(always)]
fn logarithm(x: f64) -> f64 {
    const SMALLEST: f64 = f64::MIN_POSITIVE;
    // numbers without a leading bit are brought to 54 more
    let tiny = x < SMALLEST;
    let scaled = if tiny { x * 18_014_398_509_481_984.0 } else { x };
    let bits = scaled.to_bits();
    // exponent and mantissa such that the latter is in [√½, √2)
    const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    let shifted = bits.wrapping_add(0x3ff0_0000_0000_0000 - ROOT_HALF);
    let exponent = f64::from_bits(0x4330_0000_0000_0000 | (shifted >> 52)) - 4_503_599_627_370_496.0;
    let k = exponent - 1023.0 - if tiny { 54.0 } else { 0.0 };
    let mantissa = f64::from_bits((shifted & 0x000f_ffff_ffff_ffff).wrapping_add(ROOT_HALF));
    let f = mantissa - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let r = z * polynomial(
        z,
        [
            1.479_819_860_511_658_6e-1,
            1.531_383_769_920_937_3e-1,
            1.818_357_216_161_805e-1,
            2.222_219_843_214_978_4e-1,
            2.857_142_874_366_239e-1,
            3.999_999_999_940_942e-1,
            6.666_666_666_666_735e-1,
        ],
    );
    let half = 0.5 * f * f;
    let value = k.mul_add(LN_2[0], f - (half - (s * (half + r) + k * LN_2[1])));
    let value = if x == 0.0 { f64::NEG_INFINITY } else { value };
    let value = if x < 0.0 { f64::NAN } else { value };
    if x < f64::INFINITY { value } else { x }
}

/// Natural logarithms.
#[inline(always)]
pub(crate) fn log<V: pulp::Simd>(x: Lanes) -> Lanes {
    if V::IS_SCALAR {
        return each(x, f64::ln);
    }
    each(x, logarithm)
}
