//! How far the gap of a guard may move during a step, and what that proves.
//!
//! With |φ̇| ≤ V and φ̈ ≥ −a during a step of h, two criteria say that a gap φ stays positive:
//!
//! - by speed: φ₀ + φ₁ > V h, whatever the gap is of;
//! - by acceleration: φ + a s²/2 is convex and so above its tangents at both ends, which meet at s*; clear where
//!   φ₀ + φ̇₀ s* − a s*²/2 > 0, whatever the speed.
//!
//! Where nothing is known, and where a guard is inside, the cubic through gap and rate at both ends is trusted.

use super::guard::Guard;
use super::step_curve::{StepCurve, is_clear};

/// Bounds of the motion of a guard's gap during a step, in units of the gap and of time: metres and seconds in contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// |φ̇| is at most this.
    pub speed: f64,
    /// φ̈ is at least minus this; infinite where no such bound is known.
    pub fall: f64,
    /// The size of the numbers that the gap is computed from: it is known to a few roundings of this.
    pub size: f64,
}

impl Sweep {
    /// Nothing is known: the inside of a step is decided by the cubic through its ends.
    pub const UNKNOWN: Self = Self { speed: f64::INFINITY, fall: f64::INFINITY, size: 0.0 };

    /// The time for which a gap stays positive under this bound, from a state in which |φ̇| ≤ `speed` already
    /// bounds it for all of that time.
    pub fn clear_time(&self, gap: f64) -> f64 {
        if gap > 0.0 { gap / self.speed } else { 0.0 }
    }
}

/// What the two ends of a step tell about a guard between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Verdict {
    /// It keeps its sign up to the end.
    Clear,
    /// It is not known to: to be looked at after this part of the step.
    Split(f64),
    /// The cubic through the ends has it otherwise: to be looked at after this part of the step.
    Suspect(f64),
}

impl Verdict {
    /// Whether a guard keeps its sign over a step of h, or changes it at the very end of the step.
    ///
    /// `graze` is the depth below which the criterion by speed lets a hit pass.
    pub(super) fn of(before: &Guard, after: &Guard, h: f64, sweep: &Sweep, graze: f64) -> Self {
        if before.is_inside() || sweep.speed.is_infinite() {
            by_cubic(before, after, h)
        } else if before.gap < 0.0 {
            below_surface(before, after, h, sweep)
        } else {
            outside(before, after, h, sweep, graze)
        }
    }
}

/// Of a function with |φ̇| ≤ `bound`, on either side of zero and at its end perhaps just beyond: it has no root within a step of h where
/// |φ₀| + |φ₁| > `bound` h, since from either end it takes the time |φ|/`bound` at least to get to zero.
pub(super) fn by_lipschitz(before: &Guard, after: &Guard, h: f64, bound: f64) -> Verdict {
    let side = if before.is_inside() { -1.0 } else { 1.0 };
    let (first, last) = ((side * before.gap).max(0.0), (side * after.gap).max(0.0));
    // A function that does not change has no root that it crosses.
    if bound == 0.0 || first + last > bound * h {
        return Verdict::Clear;
    }
    // Between what is clear from either end.
    let reached = 0.5 * (h + (first - last) / bound);
    Verdict::Split((reached / h).clamp(0.02, 0.98))
}

/// By the cubic through gap and rate at both ends.
fn by_cubic(before: &Guard, after: &Guard, h: f64) -> Verdict {
    if is_clear(before, after, h) {
        return Verdict::Clear;
    }
    let side = if before.is_inside() { -1.0 } else { 1.0 };
    let Some((theta, least)) = StepCurve::new(before, after, h).least(side) else {
        return Verdict::Clear;
    };
    // How much nearer to zero than both ends; a dip shallower than what is left of it is trusted.
    let depth = (side * before.margin()).min(side * after.margin()) - least;
    if least >= 0.0 && least >= depth { Verdict::Clear } else { Verdict::Suspect(theta.clamp(0.1, 0.9)) }
}

/// Of a gap that is not negative before the step, and at its end not or only just.
fn outside(before: &Guard, after: &Guard, h: f64, sweep: &Sweep, graze: f64) -> Verdict {
    if after.gap < 0.0 && !after.is_inside() {
        // It went in and is on its way out.
        return Verdict::Split(0.5);
    }
    let (first, last) = (before.gap, after.gap.max(0.0));
    if first + last > sweep.speed * h {
        return Verdict::Clear;
    }
    if sweep.fall.is_finite() {
        let (s, least) = Tangents::new(before, after, h, sweep.fall).meet(0.0);
        if least >= -rounding(before, after, h, sweep) {
            return Verdict::Clear;
        }
        return Verdict::Split((s / h).clamp(0.02, 0.98));
    }
    if first + last >= sweep.speed * h - 2.0 * graze {
        return Verdict::Clear;
    }
    // Between what is clear from either end.
    let reached = 0.5 * (h + (first - last) / sweep.speed);
    Verdict::Split((reached / h).clamp(0.02, 0.98))
}

/// Of a point that was released below the surface and is on its way out: its margin φ + τ φ̇ is positive until
/// its gap is.
fn below_surface(before: &Guard, after: &Guard, h: f64, sweep: &Sweep) -> Verdict {
    let a = sweep.fall;
    let square = before.rate * before.rate + 2.0 * a * before.gap;
    if a.is_finite() && square >= 0.0 {
        // When φ₀ + φ̇₀ s − a s²/2 is zero; its margin is concave in s and positive at both ends of that time.
        let up = -2.0 * before.gap / (before.rate + square.sqrt());
        if up < h && after.gap >= 0.0 {
            let (_, least) = Tangents::new(before, after, h, a).meet(up);
            if least >= -rounding(before, after, h, sweep) {
                return Verdict::Clear;
            }
        } else if up >= h && before.margin() + h * (before.rate - a * (before.lag + 0.5 * h)) >= 0.0 {
            return Verdict::Clear;
        }
    }
    // The force may come back. The lag is the time in which it does: within that the cubic is good.
    if h <= before.lag { by_cubic(before, after, h) } else { Verdict::Split(0.5) }
}

/// A few roundings of the gap.
fn rounding(before: &Guard, after: &Guard, h: f64, sweep: &Sweep) -> f64 {
    let size = sweep.size + before.gap.abs() + after.gap.abs() + h * (before.rate.abs() + after.rate.abs());
    16.0 * f64::EPSILON * size
}

/// Tangents of the convex φ + a s²/2 at both ends of a step.
struct Tangents {
    a: f64,
    h: f64,
    first: f64,
    slopes: [f64; 2],
    /// Value at the start of the one at the end.
    last: f64,
}

impl Tangents {
    fn new(before: &Guard, after: &Guard, h: f64, a: f64) -> Self {
        let (first, end) = (before.gap, after.gap.max(0.0) + 0.5 * a * h * h);
        let chord = (end - first) / h;
        // A method that is off by more than the step allows has tangents above the chord: then the chord counts.
        let slopes = [before.rate.min(chord), (after.rate + a * h).max(chord)];
        Self { a, h, first, slopes, last: end - slopes[1] * h }
    }

    /// Where they meet, no earlier than `from`, and the bound of φ there.
    fn meet(&self, from: f64) -> (f64, f64) {
        let [m0, m1] = self.slopes;
        let crossing = (self.first - self.last) / (m1 - m0);
        let s = if crossing.is_finite() { crossing } else { 0.5 * self.h }.clamp(from, self.h);
        let tangent = (self.first + m0 * s).max(self.last + m1 * s);
        (s, tangent - 0.5 * self.a * s * s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some(k: i32, axis: usize) -> f64 {
        f64::sin(f64::from(37 * k) + 5.0 * axis as f64)
    }

    #[test]
    fn what_is_clear_by_a_lipschitz_constant_has_no_root() {
        let (h, at) = (0.5, |gap| Guard { gap, ..Guard::default() });
        let (mut clear, mut split) = (0, 0);
        for k in 0..2_000 {
            let (first, last, bound) = (some(k, 0), some(k, 1), 5.0 * some(k, 2).abs() + 0.01);
            if first * last <= 0.0 || (first - last).abs() > bound * h {
                continue;
            }
            // The function that comes nearest to zero falls at the bound from both ends.
            let least = 0.5 * (first.abs() + last.abs() - bound * h);
            match by_lipschitz(&at(first), &at(last), h, bound) {
                Verdict::Clear => (clear, _) = (clear + 1, assert!(least > 0.0)),
                Verdict::Split(theta) => {
                    (split, _) = (split + 1, assert!(least <= 0.0 && (0.02..=0.98).contains(&theta)));
                }
                Verdict::Suspect(_) => unreachable!(),
            }
        }
        assert!(clear > 200 && split > 200, "{clear} {split}");
        assert_eq!(by_lipschitz(&at(0.0), &at(0.0), h, 0.0), Verdict::Clear);
    }

    #[test]
    fn what_is_said_to_be_clear_is() {
        // Gaps whose second derivative lies between −a and some other bound, by cubics with random ends.
        let (h, a) = (0.3, 4.0);
        let mut clear = [0; 2];
        for k in 0..200_000 {
            let (g, r, bend, jerk) =
                (some(k, 0).abs(), 3.0 * some(k, 1), 20.0 * some(k, 2), 100.0 * some(k, 3));
            let at = |s: f64| {
                let gap = g + s * (r + s * (0.5 * bend + s / 6.0 * jerk));
                Guard { gap, rate: r + s * (bend + 0.5 * s * jerk), lag: 0.0 }
            };
            if bend.min(bend + h * jerk) < -a || at(h).gap < 0.0 {
                continue;
            }
            let slopes = [0.0, h, (-bend / jerk).clamp(0.0, h)].map(|s| at(s).rate.abs());
            let speed = slopes.into_iter().fold(0.0, f64::max);
            let least = (0..=300).map(|i| at(h * f64::from(i) / 300.0).gap).fold(f64::INFINITY, f64::min);
            for (i, fall) in [a, f64::INFINITY].into_iter().enumerate() {
                let sweep = Sweep { speed, fall, size: 1.0 };
                if Verdict::of(&at(0.0), &at(h), h, &sweep, 0.0) == Verdict::Clear {
                    clear[i] += 1;
                    assert!(least >= -1e-14, "{k} {i}: {least}");
                }
            }
        }
        assert!(clear[0] > 5_000 && clear[1] > 2_000, "{clear:?}");
    }
}
