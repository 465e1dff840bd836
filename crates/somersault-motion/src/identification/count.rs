//! Half somersaults and half twists as whole numbers.

use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Probabilities of whole numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Count {
    /// The most probable one.
    pub value: i32,
    /// Its probability.
    pub probability: f64,
    /// The probability that the angle lies between whole numbers.
    pub between: f64,
    /// The neighbour that is most probable after it, and its probability.
    pub neighbour: (i32, f64),
}

/// Probability, before the angle is looked at, that a motion is not one of whole numbers.
const UNUSUAL: f64 = 0.05;

impl Count {
    /// Of half turns in `angle`, rad, whose deviation is `deviation`, where motions depart by `spread` from a whole number.
    pub(super) fn of_half_turns(angle: f64, deviation: f64, spread: f64) -> Self {
        let size = deviation.hypot(spread);
        let value = (angle / PI).round();
        let next = if angle > value * PI { value + 1.0 } else { value - 1.0 };
        let weigh = |n: f64| {
            let off = (angle - n * PI) / size;
            (1.0 - UNUSUAL) * (-0.5 * off * off).exp() / (size * (2.0 * PI).sqrt())
        };
        let (own, other, none) = (weigh(value), weigh(next), UNUSUAL / PI);
        let all = own + other + none;
        // an angle without a standard deviation is not known
        let share = |part: f64| if all.is_finite() { part / all } else { 0.0 };
        Self {
            value: value as i32,
            probability: share(own),
            between: if all.is_finite() { none / all } else { 1.0 },
            neighbour: (next as i32, share(other)),
        }
    }

    /// The two most probable numbers.
    pub(super) fn candidates(&self) -> [(i32, f64); 2] {
        [(self.value, self.probability), self.neighbour]
    }
}

/// The probability that a normal number is below `z` standard deviations.
pub(super) fn below(z: f64) -> f64 {
    0.5 * libm::erfc(-z / 2f64.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_probable_near_them_and_none_is_in_the_middle() {
        let near = Count::of_half_turns(7.0 * PI + 0.2, 0.1, 0.5);
        assert!(near.value == 7 && near.probability > 0.95 && near.neighbour.0 == 8, "{near:?}");
        let middle = Count::of_half_turns(-4.5 * PI, 0.05, 0.5);
        assert!(middle.probability < 0.4 && middle.between > 0.3, "{middle:?}");
        for count in [near, middle] {
            assert!((count.probability + count.neighbour.1 + count.between - 1.0).abs() < 1e-12);
        }
        let unknown = Count::of_half_turns(1.0, f64::NAN, 0.5);
        assert_eq!((unknown.probability, unknown.between), (0.0, 1.0));
    }

    #[test]
    fn probabilities_are_those_of_the_normal_distribution() {
        // M. Abramowitz and I. A. Stegun, Table 26.1
        for (z, p) in [(0.0, 0.5), (1.0, 0.841_344_746), (-1.96, 0.024_997_895), (3.0, 0.998_650_102)] {
            assert!((below(z) - p).abs() < 1e-9);
        }
    }
}
