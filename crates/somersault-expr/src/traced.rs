//! Numbers whose arithmetic is recorded, for formulas that are generic over the scalar.
//!
//! A formula over [`Scalar`](somersault_core::Scalar) branches on numbers, which expressions are not. So each [`Traced`] number has
//! its value at one point together with its expression: comparisons are decided there, as dual numbers decide them, and the graph keeps the
//! decisions as conditions.

use crate::error::ExprError;
use crate::graph::{Expression, Graph};
use crate::operation::Operation;
use nalgebra::{ComplexField, Field, RealField, SimdValue};
use num_traits::{FromPrimitive, Num, One, Signed, Zero};
use simba::scalar::{SubsetOf, SupersetOf};
use std::cell::RefCell;
use std::cmp::Ordering;
use std::f64::consts;
use std::fmt;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign};
use std::sync::atomic::{AtomicU64, Ordering as Memory};

/// What a thread records.
struct Recording {
    number: u64,
    graph: Graph,
    /// Conditions that hold at the point.
    decided: Vec<Expression>,
}

thread_local! {
    static RECORDING: RefCell<Option<Recording>> = const { RefCell::new(None) };
}

/// Recordings that were begun.
static BEGUN: AtomicU64 = AtomicU64::new(0);

/// A real number that records what is computed of it: a constant, or an expression with its value at the point of a
/// [recording](crate::ExprFunction::record), outside of which it is NaN.
#[derive(Debug, Clone, Copy)]
pub struct Traced {
    value: f64,
    place: Option<Place>,
}

/// An expression of a recording.
#[derive(Debug, Clone, Copy)]
struct Place {
    recording: u64,
    expression: Expression,
}

/// The recording that a thread had before, which it has again when this is dropped.
struct Before(Option<Recording>);

impl Drop for Before {
    fn drop(&mut self) {
        RECORDING.set(self.0.take());
    }
}

/// The graph with what a formula returns of its inputs at a point. Where comparisons would fall otherwise, that is NaN.
pub(crate) fn record<E: From<ExprError>>(
    at: &[f64],
    formula: impl FnOnce(&[Traced]) -> Result<Vec<Traced>, E>,
) -> Result<(Graph, Vec<Expression>), E> {
    let number = BEGUN.fetch_add(1, Memory::Relaxed);
    let mut graph = Graph::new();
    let input = |&value: &f64| {
        let place = Place { recording: number, expression: graph.input() };
        Traced { value, place: Some(place) }
    };
    let inputs: Vec<Traced> = at.iter().map(input).collect();
    let before = Before(RECORDING.replace(Some(Recording { number, graph, decided: Vec::new() })));
    let found = formula(&inputs);
    let recording = RECORDING.take();
    drop(before);
    let (found, Some(mut recording)) = (found?, recording) else {
        return Ok((Graph::new(), Vec::new()));
    };
    let mut outputs: Vec<Expression> = found.iter().map(|x| recording.expression(x)).collect();
    recording.guard(&mut outputs);
    Ok((recording.graph, outputs))
}

impl Recording {
    fn expression(&mut self, x: &Traced) -> Expression {
        match x.place {
            None => self.graph.constant(x.value),
            Some(place) if place.recording == self.number => place.expression,
            // the graph says so where a function is made of it
            Some(_) => Expression::NONE,
        }
    }

    fn apply(&mut self, operation: Operation, arguments: &[Traced]) -> Result<Expression, ExprError> {
        let arguments: Vec<Expression> = arguments.iter().map(|x| self.expression(x)).collect();
        self.graph.apply(operation, &arguments)
    }

    /// Makes outputs NaN where something decided does not hold: what is added has no derivatives.
    fn guard(&mut self, outputs: &mut [Expression]) {
        self.decided.sort_unstable();
        self.decided.dedup();
        let conditions = std::mem::take(&mut self.decided);
        let graph = &mut self.graph;
        let Some(all) = conditions.into_iter().reduce(|all, condition| graph.and(all, condition)) else {
            return;
        };
        let (zero, nothing) = (graph.constant(0.0), graph.constant(f64::NAN));
        let guard = graph.select(all, zero, nothing);
        outputs.iter_mut().for_each(|output| *output = graph.add(*output, guard));
    }
}

impl Traced {
    const fn constant(value: f64) -> Self {
        Self { value, place: None }
    }

    fn apply<const N: usize>(operation: Operation, arguments: [Self; N]) -> Self {
        let mut numbers = [0.0; 3];
        numbers.iter_mut().zip(&arguments).for_each(|(number, x)| *number = x.value);
        let value = operation.apply(numbers);
        if arguments.iter().all(|x| x.place.is_none()) {
            return Self::constant(value);
        }
        let expression = RECORDING.with_borrow_mut(|recording| {
            let recording = recording.as_mut()?;
            let expression = recording.apply(operation, &arguments).ok()?;
            Some((recording.number, expression, recording.graph.as_constant(expression)))
        });
        match expression {
            Some((_, _, Some(constant))) => Self::constant(constant),
            Some((recording, expression, None)) => {
                Self { value, place: Some(Place { recording, expression }) }
            }
            None => Self::constant(f64::NAN),
        }
    }

    /// Whether a condition holds at the point, which is kept.
    fn holds(self) -> bool {
        let holds = self.value != 0.0;
        let condition = if holds { self } else { Self::apply(Operation::Not, [self]) };
        if let Some(place) = condition.place {
            RECORDING.with_borrow_mut(|recording| {
                if let Some(recording) = recording.as_mut().filter(|found| found.number == place.recording) {
                    recording.decided.push(place.expression);
                }
            });
        }
        holds
    }

    fn select(condition: Self, x: Self, y: Self) -> Self {
        Self::apply(Operation::Select, [condition, x, y])
    }

    /// Whether two differ by no more than a number.
    fn is_within(&self, other: &Self, distance: Self) -> bool {
        *self == *other || ComplexField::abs(*self - *other) <= distance
    }
}

impl fmt::Display for Traced {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.value, f)
    }
}

macro_rules! operators {
    ($($operator:ident $method:ident $assigned:ident $assign:ident |$x:ident, $y:ident| $value:expr;)*) => {$(
        impl $operator for Traced {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                let ($x, $y) = (self, other);
                $value
            }
        }

        impl $assigned for Traced {
            fn $assign(&mut self, other: Self) {
                *self = $operator::$method(*self, other);
            }
        }
    )*};
}

operators! {
    Add add AddAssign add_assign |x, y| Self::apply(Operation::Add, [x, y]);
    Sub sub SubAssign sub_assign |x, y| Self::apply(Operation::Subtract, [x, y]);
    Mul mul MulAssign mul_assign |x, y| Self::apply(Operation::Multiply, [x, y]);
    Div div DivAssign div_assign |x, y| Self::apply(Operation::Divide, [x, y]);
    Rem rem RemAssign rem_assign |x, y| x - y * ComplexField::trunc(x / y);
}

impl Neg for Traced {
    type Output = Self;
    fn neg(self) -> Self {
        Self::apply(Operation::Negative, [self])
    }
}

impl PartialEq for Traced {
    fn eq(&self, other: &Self) -> bool {
        Self::apply(Operation::Equal, [*self, *other]).holds()
    }
}

impl PartialOrd for Traced {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        if self < other {
            Some(Ordering::Less)
        } else if other < self {
            Some(Ordering::Greater)
        } else {
            (self == other).then_some(Ordering::Equal)
        }
    }
    fn lt(&self, other: &Self) -> bool {
        Self::apply(Operation::Less, [*self, *other]).holds()
    }
    fn le(&self, other: &Self) -> bool {
        Self::apply(Operation::LessEqual, [*self, *other]).holds()
    }
    fn gt(&self, other: &Self) -> bool {
        other.lt(self)
    }
    fn ge(&self, other: &Self) -> bool {
        other.le(self)
    }
}

impl Zero for Traced {
    fn zero() -> Self {
        Self::constant(0.0)
    }
    fn is_zero(&self) -> bool {
        *self == Self::zero()
    }
}

impl One for Traced {
    fn one() -> Self {
        Self::constant(1.0)
    }
}

impl Num for Traced {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;
    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Self::constant)
    }
}

impl FromPrimitive for Traced {
    fn from_i64(n: i64) -> Option<Self> {
        f64::from_i64(n).map(Self::constant)
    }
    fn from_u64(n: u64) -> Option<Self> {
        f64::from_u64(n).map(Self::constant)
    }
    fn from_f64(x: f64) -> Option<Self> {
        Some(Self::constant(x))
    }
}

impl Signed for Traced {
    fn abs(&self) -> Self {
        Self::apply(Operation::Abs, [*self])
    }
    fn abs_sub(&self, other: &Self) -> Self {
        RealField::max(*self - *other, Self::zero())
    }
    fn signum(&self) -> Self {
        Self::apply(Operation::Sign, [*self])
    }
    fn is_positive(&self) -> bool {
        *self > Self::zero()
    }
    fn is_negative(&self) -> bool {
        *self < Self::zero()
    }
}

impl approx::AbsDiffEq for Traced {
    type Epsilon = Self;
    fn default_epsilon() -> Self {
        Self::constant(f64::EPSILON)
    }
    fn abs_diff_eq(&self, other: &Self, epsilon: Self) -> bool {
        self.is_within(other, epsilon)
    }
}

impl approx::RelativeEq for Traced {
    fn default_max_relative() -> Self {
        Self::constant(f64::EPSILON)
    }
    fn relative_eq(&self, other: &Self, epsilon: Self, max_relative: Self) -> bool {
        let size = RealField::max(ComplexField::abs(*self), ComplexField::abs(*other));
        self.is_within(other, RealField::max(epsilon, size * max_relative))
    }
}

impl approx::UlpsEq for Traced {
    fn default_max_ulps() -> u32 {
        f64::default_max_ulps()
    }
    fn ulps_eq(&self, other: &Self, epsilon: Self, max_ulps: u32) -> bool {
        approx::RelativeEq::relative_eq(
            self,
            other,
            epsilon,
            Self::constant(f64::EPSILON * f64::from(max_ulps)),
        )
    }
}

// the trait has two methods that must be declared so; here they are as safe as the others
#[allow(unsafe_code)]
impl SimdValue for Traced {
    const LANES: usize = 1;
    type Element = Self;
    type SimdBool = bool;
    fn splat(value: Self) -> Self {
        value
    }
    fn extract(&self, _: usize) -> Self {
        *self
    }
    unsafe fn extract_unchecked(&self, _: usize) -> Self {
        *self
    }
    fn replace(&mut self, _: usize, value: Self) {
        *self = value;
    }
    unsafe fn replace_unchecked(&mut self, _: usize, value: Self) {
        *self = value;
    }
    fn select(self, condition: bool, other: Self) -> Self {
        if condition { self } else { other }
    }
}

impl Field for Traced {}

impl SubsetOf<Self> for Traced {
    fn to_superset(&self) -> Self {
        *self
    }
    fn from_superset_unchecked(element: &Self) -> Self {
        *element
    }
    fn is_in_subset(_: &Self) -> bool {
        true
    }
}

macro_rules! supersets {
    ($($real:ty)*) => {$(
        impl SupersetOf<$real> for Traced {
            /// Constants are.
            fn is_in_subset(&self) -> bool {
                self.place.is_none()
            }
            fn to_subset_unchecked(&self) -> $real {
                let value = if self.place.is_none() { self.value } else { f64::NAN };
                SupersetOf::<$real>::to_subset_unchecked(&value)
            }
            fn from_subset(element: &$real) -> Self {
                Self::constant(f64::from(*element))
            }
        }
    )*};
}

supersets! { f32 f64 }

macro_rules! functions {
    ($($name:ident $operation:ident;)*) => {$(
        fn $name(self) -> Self {
            Self::apply(Operation::$operation, [self])
        }
    )*};
}

impl ComplexField for Traced {
    type RealField = Self;

    functions! {
        floor Floor;
        ceil Ceil;
        abs Abs;
        modulus Abs;
        norm1 Abs;
        signum Sign;
        sin Sin;
        cos Cos;
        tan Tan;
        asin Asin;
        acos Acos;
        atan Atan;
        sinh Sinh;
        cosh Cosh;
        tanh Tanh;
        asinh Asinh;
        acosh Acosh;
        atanh Atanh;
        ln Log;
        ln_1p Log1p;
        sqrt Sqrt;
        cbrt Cbrt;
        exp Exp;
        exp_m1 Expm1;
    }

    fn from_real(re: Self) -> Self {
        re
    }
    fn real(self) -> Self {
        self
    }
    fn imaginary(self) -> Self {
        Self::zero()
    }
    fn modulus_squared(self) -> Self {
        self * self
    }
    fn argument(self) -> Self {
        let is_negative = Self::apply(Operation::Less, [self, Self::zero()]);
        Self::select(is_negative, Self::pi(), Self::zero())
    }
    fn scale(self, factor: Self) -> Self {
        self * factor
    }
    fn unscale(self, factor: Self) -> Self {
        self / factor
    }
    fn round(self) -> Self {
        ComplexField::trunc(self + ComplexField::signum(self) * Self::constant(0.5))
    }
    fn trunc(self) -> Self {
        let is_negative = Self::apply(Operation::Less, [self, Self::zero()]);
        Self::select(is_negative, ComplexField::ceil(self), ComplexField::floor(self))
    }
    fn fract(self) -> Self {
        self - ComplexField::trunc(self)
    }
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
    fn hypot(self, other: Self) -> Self {
        Self::apply(Operation::Hypot, [self, other])
    }
    fn recip(self) -> Self {
        Self::one() / self
    }
    fn conjugate(self) -> Self {
        self
    }
    fn sin_cos(self) -> (Self, Self) {
        (ComplexField::sin(self), ComplexField::cos(self))
    }
    fn log(self, base: Self) -> Self {
        ComplexField::ln(self) / ComplexField::ln(base)
    }
    fn log2(self) -> Self {
        ComplexField::ln(self) / Self::ln_2()
    }
    fn log10(self) -> Self {
        ComplexField::ln(self) / Self::ln_10()
    }
    fn exp2(self) -> Self {
        ComplexField::powf(Self::constant(2.0), self)
    }
    fn powi(self, n: i32) -> Self {
        ComplexField::powf(self, Self::constant(f64::from(n)))
    }
    fn powf(self, n: Self) -> Self {
        Self::apply(Operation::Power, [self, n])
    }
    fn powc(self, n: Self) -> Self {
        ComplexField::powf(self, n)
    }
    fn is_finite(&self) -> bool {
        ComplexField::abs(*self) < Self::constant(f64::INFINITY)
    }
    fn try_sqrt(self) -> Option<Self> {
        (self >= Self::zero()).then(|| ComplexField::sqrt(self))
    }
}

macro_rules! constants {
    ($($name:ident $constant:ident;)*) => {$(
        fn $name() -> Self {
            Self::constant(consts::$constant)
        }
    )*};
}

impl RealField for Traced {
    constants! {
        pi PI;
        two_pi TAU;
        frac_pi_2 FRAC_PI_2;
        frac_pi_3 FRAC_PI_3;
        frac_pi_4 FRAC_PI_4;
        frac_pi_6 FRAC_PI_6;
        frac_pi_8 FRAC_PI_8;
        frac_1_pi FRAC_1_PI;
        frac_2_pi FRAC_2_PI;
        frac_2_sqrt_pi FRAC_2_SQRT_PI;
        e E;
        log2_e LOG2_E;
        log10_e LOG10_E;
        ln_2 LN_2;
        ln_10 LN_10;
    }

    fn is_sign_positive(&self) -> bool {
        *self >= Self::zero()
    }
    fn is_sign_negative(&self) -> bool {
        *self < Self::zero()
    }
    fn copysign(self, sign: Self) -> Self {
        let (size, is_negative) =
            (ComplexField::abs(self), Self::apply(Operation::Less, [sign, Self::zero()]));
        Self::select(is_negative, -size, size)
    }
    fn max(self, other: Self) -> Self {
        Self::apply(Operation::Maximum, [self, other])
    }
    fn min(self, other: Self) -> Self {
        Self::apply(Operation::Minimum, [self, other])
    }
    fn clamp(self, min: Self, max: Self) -> Self {
        RealField::min(RealField::max(self, min), max)
    }
    fn atan2(self, other: Self) -> Self {
        Self::apply(Operation::Atan2, [self, other])
    }
    fn min_value() -> Option<Self> {
        Some(Self::constant(f64::MIN))
    }
    fn max_value() -> Option<Self> {
        Some(Self::constant(f64::MAX))
    }
}
