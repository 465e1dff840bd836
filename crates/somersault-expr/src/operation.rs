//! The operations: one table, whose row has the name of an operation, its value, its value in eight lanes, and its derivative.
//!
//! A derivative is a partial one, by one argument: what adjoints of results and tangents of arguments are multiplied by. It is an
//! expression like others, so that several products share it. A row without one has the derivative zero wherever it has any.

use crate::lanes::{self, Lanes};

/// The table, given to the macro that makes something of it.
macro_rules! table {
    ($callback:ident) => {
        $callback! {
            unary {
                Negative "negative" |x| -x; |g, y| Some(g.constant(-1.0));
                Sqrt "sqrt" |x| x.sqrt(); |g, y| { let half = g.constant(0.5); Some(g.divide(half, y)) };
                Cbrt "cbrt" |x| x.cbrt(); |g, y| {
                    let (one, three, square) = (g.constant(1.0), g.constant(3.0), g.multiply(y, y));
                    let inverse = g.multiply(three, square);
                    Some(g.divide(one, inverse))
                };
                Exp "exp" |x| x.exp(), lanes exp; |g, y| Some(y);
                Expm1 "expm1" |x| x.exp_m1(); |g, y| Some(g.exp(x));
                Log "log" |x| x.ln(), lanes log; |g, y| Some(g.inverse(x));
                Log1p "log1p" |x| x.ln_1p(); |g, y| {
                    let one = g.constant(1.0);
                    let more = g.add(one, x);
                    Some(g.inverse(more))
                };
                Sin "sin" |x| x.sin(), lanes sin; |g, y| Some(g.cos(x));
                Cos "cos" |x| x.cos(), lanes cos; |g, y| { let sine = g.sin(x); Some(g.negative(sine)) };
                Tan "tan" |x| x.tan(); |g, y| {
                    let (one, square) = (g.constant(1.0), g.multiply(y, y));
                    Some(g.add(one, square))
                };
                Asin "arcsin" |x| x.asin(); |g, y| { let root = g.half_circle(x); Some(g.inverse(root)) };
                Acos "arccos" |x| x.acos(); |g, y| {
                    let (root, one) = (g.half_circle(x), g.constant(-1.0));
                    Some(g.divide(one, root))
                };
                Atan "arctan" |x| x.atan(); |g, y| {
                    let one = g.constant(1.0);
                    let sum = g.square_sum(one, x);
                    Some(g.inverse(sum))
                };
                Sinh "sinh" |x| x.sinh(); |g, y| Some(g.cosh(x));
                Cosh "cosh" |x| x.cosh(); |g, y| Some(g.sinh(x));
                Tanh "tanh" |x| x.tanh(); |g, y| Some(g.one_less_square(y));
                Asinh "arcsinh" |x| x.asinh(); |g, y| {
                    let one = g.constant(1.0);
                    let root = g.hypot(x, one);
                    Some(g.inverse(root))
                };
                Acosh "arccosh" |x| x.acosh(); |g, y| {
                    let one = g.constant(1.0);
                    let (less, more) = (g.subtract(x, one), g.add(x, one));
                    let (less, more) = (g.sqrt(less), g.sqrt(more));
                    let root = g.multiply(less, more);
                    Some(g.inverse(root))
                };
                Atanh "arctanh" |x| x.atanh(); |g, y| { let less = g.one_less_square(x); Some(g.inverse(less)) };
                Abs "absolute" |x| x.abs(); |g, y| Some(g.sign(x));
                Sign "sign" |x| if x > 0.0 { 1.0 } else if x < 0.0 { -1.0 } else if x == 0.0 { 0.0 } else { x };
                    |g, y| None;
                Floor "floor" |x| x.floor(); |g, y| None;
                Ceil "ceil" |x| x.ceil(); |g, y| None;
                Not "logical_not" |x| f64::from(x == 0.0); |g, y| None;
            }
            binary {
                Add "add" |x, y| x + y; |g, v| Some(g.constant(1.0)), Some(g.constant(1.0));
                Subtract "subtract" |x, y| x - y; |g, v| Some(g.constant(1.0)), Some(g.constant(-1.0));
                Multiply "multiply" |x, y| x * y; |g, v| Some(y), Some(x);
                Divide "divide" |x, y| x / y; |g, v|
                    Some(g.inverse(y)),
                    {
                        let inverse = g.inverse(y);
                        let quotient = g.multiply(v, inverse);
                        Some(g.negative(quotient))
                    };
                Power "power" |x, y| x.powf(y); |g, v|
                    {
                        let one = g.constant(1.0);
                        let less = g.subtract(y, one);
                        let power = g.power(x, less);
                        Some(g.multiply(y, power))
                    },
                    {
                        let zero = g.constant(0.0);
                        let (at_zero, logarithm) = (g.equal(x, zero), g.log(x));
                        let product = g.multiply(v, logarithm);
                        Some(g.select(at_zero, zero, product))
                    };
                Atan2 "arctan2" |x, y| x.atan2(y); |g, v|
                    { let square = g.square_sum(x, y); Some(g.divide(y, square)) },
                    {
                        let square = g.square_sum(x, y);
                        let quotient = g.divide(x, square);
                        Some(g.negative(quotient))
                    };
                Hypot "hypot" |x, y| x.hypot(y); |g, v| Some(g.divide(x, v)), Some(g.divide(y, v));
                Minimum "minimum" |x, y| if x <= y || x.is_nan() { x } else { y }; |g, v|
                    { let first = g.less_equal(x, y); Some(g.when(first)) },
                    { let first = g.less_equal(x, y); Some(g.unless(first)) };
                Maximum "maximum" |x, y| if x >= y || x.is_nan() { x } else { y }; |g, v|
                    { let first = g.less_equal(y, x); Some(g.when(first)) },
                    { let first = g.less_equal(y, x); Some(g.unless(first)) };
                Less "less" |x, y| f64::from(x < y); |g, v| None, None;
                LessEqual "less_equal" |x, y| f64::from(x <= y); |g, v| None, None;
                Equal "equal" |x, y| f64::from(x == y); |g, v| None, None;
                NotEqual "not_equal" |x, y| f64::from(x != y); |g, v| None, None;
                And "logical_and" |x, y| f64::from(x != 0.0 && y != 0.0); |g, v| None, None;
                Or "logical_or" |x, y| f64::from(x != 0.0 || y != 0.0); |g, v| None, None;
            }
            ternary {
                Select "where" |c, x, y| if c != 0.0 { x } else { y }; |g|
                    None, Some(g.when(c)), Some(g.unless(c));
            }
        }
    };
}
pub(crate) use table;

/// The value in lanes of a row: that of each lane, or a function of its own.
macro_rules! in_lanes {
    ($simd:ident, |$($x:ident),+| $value:expr) => {
{
            let mut values = [0.0; lanes::LANES];
            for k in 0..lanes::LANES {
                $(let $x = $x[k];)+
                values[k] = $value;
            }
            values
        }
    };
    ($simd:ident, |$x:ident| $value:expr, $lanes:ident) => {
        lanes::$lanes::<$simd>($x)
    };
}

macro_rules! operations {
    (
        unary { $($u:ident $u_name:literal |$ux:ident| $u_value:expr $(, lanes $u_lanes:ident)? ;
            |$ug:ident, $uy:ident| $u_dx:expr;)* }
        binary { $($b:ident $b_name:literal |$bx:ident, $by:ident| $b_value:expr ;
            |$bg:ident, $bv:ident| $b_dx:expr, $b_dy:expr;)* }
        ternary { $($t:ident $t_name:literal |$tx:ident, $ty:ident, $tz:ident| $t_value:expr ;
            |$tg:ident| $t_dx:expr, $t_dy:expr, $t_dz:expr;)* }
    ) => {
        /// What a node computes of its arguments.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum Operation {
            $(#[doc = concat!("`", $u_name, "`.")] $u,)*
            $(#[doc = concat!("`", $b_name, "`.")] $b,)*
            $(#[doc = concat!("`", $t_name, "`.")] $t,)*
        }

        impl Operation {
            /// All operations.
            pub const ALL: &[Self] = &[$(Self::$u,)* $(Self::$b,)* $(Self::$t,)*];

            /// The name, which is NumPy's where NumPy has the function.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$u => $u_name,)*
                    $(Self::$b => $b_name,)*
                    $(Self::$t => $t_name,)*
                }
            }

            /// Number of arguments.
            pub const fn arity(self) -> usize {
                match self {
                    $(Self::$u => 1,)*
                    $(Self::$b => 2,)*
                    $(Self::$t => 3,)*
                }
            }

            /// The value; arguments are read where there are any.
            #[inline(always)]
            pub(crate) fn value(
                self, first: impl Fn() -> f64, second: impl Fn() -> f64, third: impl Fn() -> f64,
            ) -> f64 {
                match self {
                    $(Self::$u => { let $ux = first(); $u_value })*
                    $(Self::$b => { let ($bx, $by) = (first(), second()); $b_value })*
                    $(Self::$t => { let ($tx, $ty, $tz) = (first(), second(), third()); $t_value })*
                }
            }

            /// The values in lanes.
            #[inline(always)]
            pub(crate) fn values<V: pulp::Simd>(
                self, first: impl Fn() -> Lanes, second: impl Fn() -> Lanes, third: impl Fn() -> Lanes,
            ) -> Lanes {
                match self {
                    $(Self::$u => { let $ux = first(); in_lanes!(V, |$ux| $u_value $(, $u_lanes)?) })*
                    $(Self::$b => {
                        let ($bx, $by) = (first(), second());
                        in_lanes!(V, |$bx, $by| $b_value)
                    })*
                    $(Self::$t => {
                        let ($tx, $ty, $tz) = (first(), second(), third());
                        in_lanes!(V, |$tx, $ty, $tz| $t_value)
                    })*
                }
            }
        }
    };
}

table!(operations);

impl Operation {
    /// The value of these numbers, of which the first ones are arguments.
    pub(crate) fn apply(self, [x, y, z]: [f64; 3]) -> f64 {
        self.value(|| x, || y, || z)
    }
}
