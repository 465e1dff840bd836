//! Expressions with the operators of Rust.

use crate::graph::{Expression, Graph};
use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// An expression with operators and functions, for formulas that are written as those of numbers are.
#[derive(Debug, Clone, Copy)]
pub struct Symbol<'g> {
    graph: &'g RefCell<Graph>,
    expression: Expression,
}

impl<'g> Symbol<'g> {
    /// A further input of a graph.
    pub fn input(graph: &'g RefCell<Graph>) -> Self {
        let expression = graph.borrow_mut().input();
        Self { graph, expression }
    }

    /// A number beside this symbol.
    pub fn constant(&self, x: f64) -> Self {
        self.with(|graph| graph.constant(x))
    }

    /// The expression.
    pub fn expression(&self) -> Expression {
        self.expression
    }

    fn with(&self, make: impl FnOnce(&mut Graph) -> Expression) -> Self {
        Self { graph: self.graph, expression: make(&mut self.graph.borrow_mut()) }
    }

    /// xʸ.
    pub fn powf(self, exponent: f64) -> Self {
        self.with(|graph| {
            let exponent = graph.constant(exponent);
            graph.power(self.expression, exponent)
        })
    }

    /// xⁿ.
    pub fn powi(self, exponent: i32) -> Self {
        self.powf(f64::from(exponent))
    }

    /// The angle of the point (other, self).
    pub fn atan2(self, other: Self) -> Self {
        self.with(|graph| graph.atan2(self.expression, other.expression))
    }

    /// √(x² + y²).
    pub fn hypot(self, other: Self) -> Self {
        self.with(|graph| graph.hypot(self.expression, other.expression))
    }

    /// The larger one.
    pub fn max(self, other: Self) -> Self {
        self.with(|graph| graph.maximum(self.expression, other.expression))
    }

    /// The lesser one.
    pub fn min(self, other: Self) -> Self {
        self.with(|graph| graph.minimum(self.expression, other.expression))
    }

    /// 1 where this is less, otherwise 0.
    pub fn less(self, other: Self) -> Self {
        self.with(|graph| graph.less(self.expression, other.expression))
    }

    /// `x` where this is not 0, otherwise `y`.
    pub fn select(self, x: Self, y: Self) -> Self {
        self.with(|graph| graph.select(self.expression, x.expression, y.expression))
    }
}

macro_rules! functions {
    ($($name:ident $of_graph:ident $text:literal;)*) => {
        impl Symbol<'_> {
            $(#[doc = $text]
            pub fn $name(self) -> Self {
                self.with(|graph| graph.$of_graph(self.expression))
            })*
        }
    };
}

functions! {
    sqrt sqrt "√x.";
    cbrt cbrt "∛x.";
    exp exp "eˣ.";
    exp_m1 expm1 "eˣ − 1.";
    ln log "The natural logarithm.";
    ln_1p log1p "log(1 + x).";
    sin sin "The sine.";
    cos cos "The cosine.";
    tan tan "The tangent.";
    asin asin "The inverse sine.";
    acos acos "The inverse cosine.";
    atan atan "The inverse tangent.";
    sinh sinh "The hyperbolic sine.";
    cosh cosh "The hyperbolic cosine.";
    tanh tanh "The hyperbolic tangent.";
    asinh asinh "The inverse hyperbolic sine.";
    acosh acosh "The inverse hyperbolic cosine.";
    atanh atanh "The inverse hyperbolic tangent.";
    abs abs "The absolute value.";
    signum sign "1, 0 or −1.";
    floor floor "The largest integer that is not above.";
    ceil ceil "The least integer that is not below.";
}

macro_rules! operators {
    ($($operator:ident $method:ident $of_graph:ident;)*) => {$(
        impl<'g> $operator for Symbol<'g> {
            type Output = Symbol<'g>;
            fn $method(self, other: Self) -> Self {
                self.with(|graph| graph.$of_graph(self.expression, other.expression))
            }
        }

        impl<'g> $operator<f64> for Symbol<'g> {
            type Output = Symbol<'g>;
            fn $method(self, other: f64) -> Self {
                $operator::$method(self, self.constant(other))
            }
        }

        impl<'g> $operator<Symbol<'g>> for f64 {
            type Output = Symbol<'g>;
            fn $method(self, other: Symbol<'g>) -> Symbol<'g> {
                $operator::$method(other.constant(self), other)
            }
        }
    )*};
}

operators! {
    Add add add;
    Sub sub subtract;
    Mul mul multiply;
    Div div divide;
}

impl Neg for Symbol<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        self.with(|graph| graph.negative(self.expression))
    }
}
