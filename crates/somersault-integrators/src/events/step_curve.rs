//! What the guards at the two ends of a step tell about its inside.
//!
//! The gap is taken as the cubic through its values and rates at both ends. Its margin can only have
//! extrema where the rate vanishes, at a corner of the margin, or where the rate of φ + τ φ̇ does: the
//! roots of two quadratics. Between them the margin is monotone.

use super::guard::Guard;

/// The gap of a guard over a step, as a cubic in θ ∈ [0, 1].
#[derive(Debug, Clone, Copy)]
pub struct StepCurve {
    /// Coefficients of 1, θ, θ², θ³.
    c: [f64; 4],
    /// τ/h, so that the margin is p + lag · max(p', 0) with p' = dp/dθ.
    lag: f64,
}

/// Whether the margin keeps its sign over a step, and so far from zero that no extremum is uncertain.
///
/// Gap and rate lie between the control points of their Bernstein forms, which are those of the cubic and
/// of its derivative: a bound that costs neither a root nor a division by what may vanish.
#[inline]
pub(super) fn is_clear(before: &Guard, after: &Guard, h: f64) -> bool {
    let inner = [before.gap + h / 3.0 * before.rate, after.gap - h / 3.0 * after.rate];
    let least = if before.is_inside() {
        let middle_rate = 3.0 / h * (inner[1] - inner[0]);
        let gap = before.gap.max(after.gap).max(inner[0]).max(inner[1]);
        -(gap + before.lag * before.rate.max(after.rate).max(middle_rate).max(0.0))
    } else {
        before.gap.min(after.gap).min(inner[0]).min(inner[1])
    };
    let ends = before.margin().abs().min(after.margin().abs());
    least > 0.0 && least >= ends - least
}

impl StepCurve {
    /// Over a step of h with a guard at both ends.
    pub fn new(before: &Guard, after: &Guard, h: f64) -> Self {
        let (jump, first, last) = (after.gap - before.gap, h * before.rate, h * after.rate);
        let c = [before.gap, first, 3.0 * jump - 2.0 * first - last, first + last - 2.0 * jump];
        Self { c, lag: before.lag / h }
    }

    /// The margin at θ.
    pub(super) fn margin(&self, theta: f64) -> f64 {
        let [c0, c1, c2, c3] = self.c;
        let gap = c0 + theta * (c1 + theta * (c2 + theta * c3));
        let slope = c1 + theta * (2.0 * c2 + theta * 3.0 * c3);
        gap + self.lag * slope.max(0.0)
    }

    /// The θ strictly between 0 and 1 where `side` · margin is least, and its value, if it has extrema there; `side` is
    /// 1 or −1.
    pub fn least(&self, side: f64) -> Option<(f64, f64)> {
        let [_, c1, c2, c3] = self.c;
        let turns = quadratic_roots(c1, 2.0 * c2, 3.0 * c3);
        let flats = quadratic_roots(c1 + 2.0 * c2 * self.lag, 2.0 * c2 + 6.0 * c3 * self.lag, 3.0 * c3);
        turns
            .into_iter()
            .chain(flats)
            .filter(|theta| *theta > 1e-6 && *theta < 1.0 - 1e-6)
            .map(|theta| (theta, side * self.margin(theta)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Where the margin changes sign before `end`, by bisection; half of `end` if it does not.
    pub(super) fn crossing(&self, end: f64) -> f64 {
        let (mut near, mut far) = (0.0, end);
        let inside = self.margin(end) < 0.0;
        if (self.margin(0.0) < 0.0) == inside {
            return 0.5 * end;
        }
        for _ in 0..40 {
            let middle = 0.5 * (near + far);
            if (self.margin(middle) < 0.0) == inside { far = middle } else { near = middle }
        }
        far
    }
}

/// Real roots of a + b θ + c θ², NaN where there is none.
fn quadratic_roots(a: f64, b: f64, c: f64) -> [f64; 2] {
    // The sum without cancellation; the second root is the product over the first.
    let q = -0.5 * (b + (b * b - 4.0 * a * c).sqrt().copysign(b));
    [q / c, a / q]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extrema_of_the_margin_are_found() {
        // φ = (t − 0.4)² − 0.01 over [0, 1]: least at 0.4 where the lag is zero.
        let at = |t: f64, lag| Guard { gap: (t - 0.4) * (t - 0.4) - 0.01, rate: 2.0 * (t - 0.4), lag };
        let (theta, value) = StepCurve::new(&at(0.0, 0.0), &at(1.0, 0.0), 1.0).least(1.0).unwrap();
        assert!((theta - 0.4).abs() < 1e-15 && (value + 0.01).abs() < 1e-15);
        // With a lag the least margin is at the corner, where the rate is zero.
        let (theta, _) = StepCurve::new(&at(0.0, 0.2), &at(1.0, 0.2), 1.0).least(1.0).unwrap();
        assert!((theta - 0.4).abs() < 1e-15);
        // Seen from inside, φ = −(t − 0.4)² + 0.01 + … has its greatest margin before the gap's.
        let at = |t: f64| Guard { gap: 0.01 - (t - 0.4) * (t - 0.4), rate: -2.0 * (t - 0.4), lag: 0.1 };
        let (theta, value) = StepCurve::new(&at(0.0), &at(1.0), 1.0).least(-1.0).unwrap();
        assert!((theta - 0.3).abs() < 1e-15 && (value + 0.02).abs() < 1e-15, "{theta} {value}");
        // Free fall has none.
        let at = |t: f64| Guard { gap: 1.0 - t * t, rate: -2.0 * t, lag: 0.1 };
        assert!(StepCurve::new(&at(0.0), &at(0.5), 0.5).least(1.0).is_none());
        assert!(StepCurve::new(&at(0.2), &at(0.2), 0.5).least(1.0).is_some());
    }

    #[test]
    fn a_clear_step_has_no_extremum_in_doubt() {
        let mut clear = 0;
        for i in 0..4096u32 {
            // Four numbers from −1.5 to 1.5 and a lag, by the digits of i.
            let digit = |k: u32| f64::from((i / 8u32.pow(k)) % 8) * 3.0 / 7.0 - 1.5;
            for lag in [0.0, 0.3] {
                let before = Guard { gap: digit(0), rate: digit(1), lag };
                let after = Guard { gap: digit(2), rate: digit(3), lag };
                if !is_clear(&before, &after, 0.7) {
                    continue;
                }
                clear += 1;
                let side = if before.is_inside() { -1.0 } else { 1.0 };
                assert_eq!(before.is_inside(), after.is_inside());
                let curve = StepCurve::new(&before, &after, 0.7);
                assert!(
                    (0..=100).all(|k| side * curve.margin(0.01 * f64::from(k)) > 0.0),
                    "{before:?} {after:?}"
                );
            }
        }
        assert!(clear > 500, "{clear}");
    }

    #[test]
    fn the_crossing_of_the_cubic_is_a_guess() {
        let at = |t: f64| Guard { gap: 1.0 - t, rate: -1.0, lag: 0.1 };
        assert!((StepCurve::new(&at(0.0), &at(3.0), 3.0).crossing(1.0) - 1.0 / 3.0).abs() < 1e-11);
    }
}
