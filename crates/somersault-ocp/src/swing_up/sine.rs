//! Sine with cosine along a sequence of angles that are close to each other.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_4};

/// π/2 in two parts: the first has 33 bits, so that its multiples are exact.
const HALF_TURN: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_506_192e-11];
/// Added and taken away again, it rounds to an integer, which is then in the last bits of the sum.
const ROUNDER: f64 = 1.5 * (1_u64 << 52) as f64;
/// Coefficients of (sin x − x)/x³ and (cos x − 1 + x²/2)/x⁴ by powers of x².
const SERIES: [[f64; 2]; 6] = [
    [-1.666_666_666_666_663_2e-1, 4.166_666_666_666_66e-2],
    [8.333_333_333_322_49e-3, -1.388_888_888_887_411e-3],
    [-1.984_126_982_985_795e-4, 2.480_158_728_947_673e-5],
    [2.755_731_370_707_006_8e-6, -2.755_731_435_139_066_3e-7],
    [-2.505_076_025_340_686_3e-8, 2.087_572_321_298_175e-9],
    [1.589_690_995_211_55e-10, -1.135_964_755_778_819_5e-11],
];

/// The quadrant of the last angle.
///
/// A step waits for the sine of the angle where the last one ended, so its latency is what a pass takes. Most of it is the
/// reduction to ±π/4; here that is a difference while the quadrant lasts. The polynomials are those of fdlibm (Sun
/// Microsystems 1993). Errors are below 3·10⁻¹⁶ to 10⁵ rad; beyond, as if the angle were rounded once more.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quadrant {
    number: u64,
    parts: [f64; 2],
    /// What [`turn`](Self::turn) has made of the remainder.
    rest: f64,
}

impl Quadrant {
    #[inline(always)]
    pub(super) fn of(angle: f64) -> Self {
        let sum = angle * FRAC_2_PI + ROUNDER;
        let parts = HALF_TURN.map(|part| (sum - ROUNDER) * part);
        Self { number: sum.to_bits(), parts, rest: (angle - parts[0]) - parts[1] }
    }

    /// Adds to the angle.
    #[inline(always)]
    pub(super) fn turn(&mut self, by: f64) {
        self.rest += by;
    }

    /// At the angle that turns have led to, which is given as well: without waiting for a reduction.
    #[inline(always)]
    pub(super) fn sin_cos_here(&mut self, angle: f64) -> (f64, f64) {
        if self.rest.abs() > FRAC_PI_4 {
            *self = Self::of(angle);
        }
        self.series(self.rest)
    }

    #[inline(always)]
    fn remainder(&self, angle: f64) -> f64 {
        (angle - self.parts[0]) - self.parts[1]
    }

    #[inline(always)]
    pub(super) fn sin_cos(&mut self, angle: f64) -> (f64, f64) {
        let mut x = self.remainder(angle);
        if x.abs() > FRAC_PI_4 {
            *self = Self::of(angle);
            x = self.rest;
        }
        self.series(x)
    }

    #[inline(always)]
    fn series(&self, x: f64) -> (f64, f64) {
        let y = x * x;
        let (y2, y4) = (y * y, (y * y) * (y * y));
        let c = &SERIES;
        let series: [f64; 2] = std::array::from_fn(|i| {
            (c[0][i] + y * c[1][i]) + y2 * (c[2][i] + y * c[3][i]) + y4 * (c[4][i] + y * c[5][i])
        });
        let (sin, cos) = (x + x * y * series[0], (1.0 - 0.5 * y) + y2 * series[1]);
        // the number's bits: whether they change places, and signs
        let (n, is_odd) = (self.number, self.number & 1 != 0);
        let (sin, cos) = if is_odd { (cos, sin) } else { (sin, cos) };
        let signed = |x: f64, number: u64| f64::from_bits(x.to_bits() ^ ((number & 2) << 62));
        (signed(sin, n), signed(cos, n ^ (n << 1)))
    }
}

#[cfg(test)]
mod tests {
    use super::Quadrant;

    #[test]
    fn sine_and_cosine_are_right_to_3e_16() {
        for spread in [1.0, 1e2, 1e5] {
            let mut quadrant = Quadrant::of(0.0);
            for k in -200_000..=200_000 {
                let angle = spread * f64::from(k) / 2e5;
                let (sin, cos) = quadrant.sin_cos(angle);
                let error = (sin - angle.sin()).abs().max((cos - angle.cos()).abs());
                assert!(error < 3e-16, "{angle}: {error}");
            }
        }
        let mut quadrant = Quadrant::of(0.0);
        for k in 0..=100_000 {
            let angle = f64::from(k) / 1024.0;
            let (sin, cos) = quadrant.sin_cos_here(angle);
            // turns round as well
            assert!((sin - angle.sin()).abs().max((cos - angle.cos()).abs()) < 1e-15, "{angle}");
            quadrant.turn(1.0 / 1024.0);
        }
        let (sin, cos) = Quadrant::of(0.0).sin_cos(f64::NAN);
        assert!(sin.is_nan() && cos.is_nan());
    }
}
