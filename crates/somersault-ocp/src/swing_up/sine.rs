//! Sine with cosine along a sequence of angles that are close to each other.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_4};

/// π/2 in two parts: the first has 33 bits, so that its multiples are exact.
const HALF_TURN: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_506_192e-11];
/// Beyond this angle the parts of π/2 are too few.
const LARGEST: f64 = 1e5;

/// The quadrant of the last angle.
///
/// A step waits for the sine of the angle where the last one ended, so its latency is what a pass takes. Most of it is the
/// reduction to ±π/4; here that is a difference while the quadrant lasts. The polynomials are those of fdlibm (Sun
/// Microsystems 1993). Errors are below 3·10⁻¹⁶.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quadrant {
    number: i64,
    parts: [f64; 2],
}

impl Quadrant {
    #[inline(always)]
    pub(super) fn of(angle: f64) -> Self {
        let number = (angle * FRAC_2_PI).round();
        Self { number: number as i64, parts: HALF_TURN.map(|part| number * part) }
    }

    #[inline(always)]
    pub(super) fn sin_cos(&mut self, angle: f64) -> (f64, f64) {
        let mut x = (angle - self.parts[0]) - self.parts[1];
        if x.abs() > FRAC_PI_4 {
            *self = Self::of(angle);
            x = (angle - self.parts[0]) - self.parts[1];
        }
        if angle.is_nan() || angle.abs() > LARGEST {
            return angle.sin_cos();
        }
        let (y, y2) = (x * x, (x * x) * (x * x));
        let sin = x + x
            * y
            * ((-1.666_666_666_666_663_2e-1 + y * 8.333_333_333_322_49e-3)
                + y2 * (-1.984_126_982_985_795e-4 + y * 2.755_731_370_707_006_8e-6)
                + (y2 * y2) * (-2.505_076_025_340_686_3e-8 + y * 1.589_690_995_211_55e-10));
        let cos = (1.0 - 0.5 * y)
            + y2 * ((4.166_666_666_666_66e-2 - y * 1.388_888_888_887_411e-3)
                + y2 * (2.480_158_728_947_673e-5 - y * 2.755_731_435_139_066_3e-7)
                + (y2 * y2) * (2.087_572_321_298_175e-9 - y * 1.135_964_755_778_819_5e-11));
        match self.number & 3 {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Quadrant;

    #[test]
    fn sine_and_cosine_are_right_to_3e_16() {
        for spread in [1.0, 1e2, 1e5, 1e7] {
            let mut quadrant = Quadrant::of(0.0);
            for k in -200_000..=200_000 {
                let angle = spread * f64::from(k) / 2e5;
                let (sin, cos) = quadrant.sin_cos(angle);
                let error = (sin - angle.sin()).abs().max((cos - angle.cos()).abs());
                assert!(error < 3e-16, "{angle}: {error}");
            }
        }
        let (sin, cos) = Quadrant::of(0.0).sin_cos(f64::NAN);
        assert!(sin.is_nan() && cos.is_nan());
    }
}
