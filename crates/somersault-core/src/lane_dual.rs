//! Dual numbers with a derivative in each lane.

use crate::lanes::{Lanes, Packed};
use crate::scalar::{Arithmetic, Lift};
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A number and its derivatives along as many directions as there are lanes: forward-mode differentiation of several directions at
/// once, which computes the number itself once.
///
/// ```
/// use somersault_core::lane_dual::LaneDual;
/// use somersault_core::lanes::{InstructionSet, Kernel, Lanes, WIDEST};
/// struct Square(f64);
/// impl Kernel for Square {
///     type Output = f64;
///     #[inline(always)]
///     fn run<L: Lanes>(self, lanes: L) -> f64 {
///         let x = LaneDual::new(lanes, self.0, &[1.0; WIDEST]);
///         let mut slopes = [0.0; WIDEST];
///         (x * x).store_slopes(&mut slopes);
///         slopes[0]
///     }
/// }
/// assert_eq!(InstructionSet::detect().run(Square(3.0)), 6.0);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct LaneDual<L: Lanes> {
    value: f64,
    slopes: Packed<L>,
}

impl<L: Lanes> LaneDual<L> {
    /// A number whose derivatives are the first entries, of at least as many as there are lanes.
    #[inline(always)]
    pub fn new(lanes: L, value: f64, slopes: &[f64]) -> Self {
        Self { value, slopes: Packed::load(lanes, slopes) }
    }

    /// The number.
    #[inline(always)]
    pub fn value(self) -> f64 {
        self.value
    }

    /// Writes the derivatives, to at least as many entries as there are lanes.
    #[inline(always)]
    pub fn store_slopes(self, entries: &mut [f64]) {
        self.slopes.store(entries);
    }

    /// The number times a constant.
    #[inline(always)]
    pub fn scaled(self, factor: f64) -> Self {
        Self { value: self.value * factor, slopes: self.slopes.scaled(factor) }
    }
}

impl<L: Lanes> PartialEq for LaneDual<L> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value && self.slopes == other.slopes
    }
}

impl<L: Lanes> Add for LaneDual<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slopes: self.slopes + other.slopes }
    }
}

impl<L: Lanes> Sub for LaneDual<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slopes: self.slopes - other.slopes }
    }
}

impl<L: Lanes> Mul for LaneDual<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let slopes = self.slopes.scaled(other.value).plus_scaled(other.slopes, self.value);
        Self { value: self.value * other.value, slopes }
    }
}

impl<L: Lanes> Div for LaneDual<L> {
    type Output = Self;
    /// (a/b)′ = (a′ − (a/b) b′)/b
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, slopes: self.slopes.plus_scaled(other.slopes, -value).scaled(1.0 / other.value) }
    }
}

impl<L: Lanes> Neg for LaneDual<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, slopes: -self.slopes }
    }
}

impl<L: Lanes> AddAssign for LaneDual<L> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<L: Lanes> SubAssign for LaneDual<L> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<L: Lanes> Arithmetic for LaneDual<L> {
    #[inline(always)]
    fn sine_and_cosine(self) -> (Self, Self) {
        let (sine, cosine) = self.value.sin_cos();
        (
            Self { value: sine, slopes: self.slopes.scaled(cosine) },
            Self { value: cosine, slopes: self.slopes.scaled(-sine) },
        )
    }

    #[inline(always)]
    fn square_root(self) -> Self {
        let value = self.value.sqrt();
        Self { value, slopes: self.slopes.scaled(0.5 / value) }
    }

    #[inline(always)]
    fn exceeds(self, bound: Self) -> bool {
        self.value > bound.value && self.value.is_finite()
    }
}

impl<L: Lanes> Lift<f64> for LaneDual<L> {
    type Proof = L;

    #[inline(always)]
    fn lift(lanes: L, constant: f64) -> Self {
        Self { value: constant, slopes: Packed::lift(lanes, 0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{InstructionSet, Kernel, WIDEST};
    use num_dual::{Dual64, DualNum};

    /// A formula with every operation, of two numbers.
    struct Formula([f64; 2]);

    impl Kernel for Formula {
        type Output = (f64, Vec<f64>);

        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) -> Self::Output {
            // lane k moves x by 1 and y by k
            let along: [f64; WIDEST] = core::array::from_fn(|k| k as f64);
            let x = LaneDual::new(lanes, self.0[0], &[1.0; WIDEST]);
            let y = LaneDual::new(lanes, self.0[1], &along);
            let (sine, cosine) = (x * y).sine_and_cosine();
            let mut found = -(sine / (y * y + LaneDual::lift(lanes, 2.0))) - cosine.scaled(3.0);
            found += (x * x + y * y).square_root();
            found -= x;
            let mut slopes = [0.0; WIDEST];
            found.store_slopes(&mut slopes);
            (found.value(), slopes[..L::WIDTH].to_vec())
        }
    }

    #[test]
    fn derivatives_are_those_of_scalar_dual_numbers() {
        for (x, y) in [(0.3, -1.2), (2.0, 0.5), (-4.0, 3.0)] {
            for set in InstructionSet::supported() {
                let (value, slopes) = set.run(Formula([x, y]));
                for (k, slope) in slopes.into_iter().enumerate() {
                    let (x, y) = (Dual64::new(x, 1.0), Dual64::new(y, k as f64));
                    let (sine, cosine) = (x * y).sin_cos();
                    let expected = -(sine / (y * y + 2.0)) - cosine * 3.0 + (x * x + y * y).sqrt() - x;
                    assert!(
                        (value - expected.re).abs() <= 1e-14 * (1.0 + expected.re.abs()),
                        "{}",
                        set.name()
                    );
                    let error = (slope - expected.eps).abs();
                    assert!(error <= 1e-13 * (1.0 + expected.eps.abs()), "{} lane {k}: {error}", set.name());
                }
            }
        }
    }

    #[test]
    fn bounds_are_exceeded_by_finite_values_only() {
        struct Exceeds(f64, f64);
        impl Kernel for Exceeds {
            type Output = bool;
            #[inline(always)]
            fn run<L: Lanes>(self, lanes: L) -> bool {
                LaneDual::lift(lanes, self.0).exceeds(LaneDual::lift(lanes, self.1))
            }
        }
        let set = InstructionSet::detect();
        assert!(set.run(Exceeds(2.0, 1.0)) && !set.run(Exceeds(1.0, 1.0)));
        assert!(!set.run(Exceeds(f64::NAN, 1.0)) && !set.run(Exceeds(f64::INFINITY, 1.0)));
    }
}
