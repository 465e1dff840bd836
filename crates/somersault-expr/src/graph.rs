//! The graph of expressions: each is there once, and simplifications keep values.

use crate::error::ExprError;
use crate::operation::Operation;
use std::collections::HashMap;

/// An expression of a [`Graph`]: the number of its node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Expression(pub(crate) u32);

impl Expression {
    /// What stands in the places of arguments that an operation does not have.
    pub(crate) const NONE: Self = Self(u32::MAX);

    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

/// What an expression is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Node {
    /// An input of this number.
    Input(u32),
    /// A number, by its bits.
    Constant(u64),
    /// An operation with as many arguments as it takes.
    Operation(Operation, [Expression; 3]),
}

/// Expressions over numbered inputs. Each is stored once: equal operations on equal arguments are the same node.
///
/// Arguments have smaller numbers than what is made of them. What goes wrong while a graph is built is kept, and returned where
/// a [`crate::ExprFunction`] is made of it.
#[derive(Debug, Clone, Default)]
pub struct Graph {
    nodes: Vec<Node>,
    known: HashMap<Node, Expression>,
    inputs: Vec<Expression>,
    fault: Option<ExprError>,
}

/// Most nodes of a graph: about 1.5 GB.
const MOST_NODES: usize = 1 << 24;
/// Largest exponent that is taken by multiplications.
const LARGEST_POWER: f64 = 16.0;

macro_rules! unary {
    ($($name:ident $operation:ident $text:literal;)*) => {$(
        #[doc = $text]
        pub fn $name(&mut self, x: Expression) -> Expression {
            self.unary(Operation::$operation, x)
        }
    )*};
}

macro_rules! binary {
    ($($name:ident $operation:ident $text:literal;)*) => {$(
        #[doc = $text]
        pub fn $name(&mut self, x: Expression, y: Expression) -> Expression {
            self.binary(Operation::$operation, x, y)
        }
    )*};
}

impl Graph {
    /// A graph without expressions.
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of expressions.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there are no expressions.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The inputs, in the order in which they were made.
    pub fn inputs(&self) -> &[Expression] {
        &self.inputs
    }

    /// A further input.
    pub fn input(&mut self) -> Expression {
        let number = self.inputs.len() as u32;
        let input = self.node(Node::Input(number));
        self.inputs.push(input);
        input
    }

    /// A number.
    pub fn constant(&mut self, x: f64) -> Expression {
        self.node(Node::Constant(x.to_bits()))
    }

    /// The number that an expression is, if it is one.
    pub fn as_constant(&self, x: Expression) -> Option<f64> {
        match self.nodes.get(x.index()) {
            Some(Node::Constant(bits)) => Some(f64::from_bits(*bits)),
            Some(Node::Input(_) | Node::Operation(..)) | None => None,
        }
    }

    /// The operation and arguments that an expression is, if it is one.
    pub fn as_operation(&self, x: Expression) -> Option<(Operation, &[Expression])> {
        match self.nodes.get(x.index()) {
            Some(Node::Operation(operation, arguments)) => {
                Some((*operation, &arguments[..operation.arity()]))
            }
            Some(Node::Input(_) | Node::Constant(_)) | None => None,
        }
    }

    unary! {
        sqrt Sqrt "√x.";
        cbrt Cbrt "∛x.";
        exp Exp "eˣ.";
        expm1 Expm1 "eˣ − 1.";
        log Log "The natural logarithm.";
        log1p Log1p "log(1 + x).";
        sin Sin "The sine.";
        cos Cos "The cosine.";
        tan Tan "The tangent.";
        asin Asin "The inverse sine.";
        acos Acos "The inverse cosine.";
        atan Atan "The inverse tangent.";
        sinh Sinh "The hyperbolic sine.";
        cosh Cosh "The hyperbolic cosine.";
        tanh Tanh "The hyperbolic tangent.";
        asinh Asinh "The inverse hyperbolic sine.";
        acosh Acosh "The inverse hyperbolic cosine.";
        atanh Atanh "The inverse hyperbolic tangent.";
        abs Abs "The absolute value; its derivative at zero is zero.";
        sign Sign "1, 0 or −1; its derivative is zero.";
        floor Floor "The largest integer that is not above; its derivative is zero.";
        ceil Ceil "The least integer that is not below; its derivative is zero.";
        not Not "1 where x is 0, otherwise 0.";
        negative Negative "−x.";
    }

    binary! {
        add Add "x + y.";
        subtract Subtract "x − y.";
        multiply Multiply "x · y, where a factor that is the constant 0 gives 0.";
        divide Divide "x / y.";
        atan2 Atan2 "The angle of the point (y, x), as `f64::atan2`.";
        hypot Hypot "√(x² + y²) without overflow.";
        minimum Minimum "The lesser one, NaN if either is; where both are equal, the derivative is that of x.";
        maximum Maximum "The larger one, NaN if either is; where both are equal, the derivative is that of x.";
        less Less "1 where x < y, otherwise 0.";
        less_equal LessEqual "1 where x ≤ y, otherwise 0.";
        equal Equal "1 where x = y, otherwise 0.";
        not_equal NotEqual "1 where x ≠ y, otherwise 0.";
        and And "1 where neither is 0, otherwise 0.";
        or Or "1 where either is not 0, otherwise 0.";
        power Power "xʸ. Constant integers to ±16 are products, as ½ is a root.";
    }

    /// `x` where `condition` is not 0, otherwise `y`.
    pub fn select(&mut self, condition: Expression, x: Expression, y: Expression) -> Expression {
        if x == y {
            return x;
        }
        if let Some(c) = self.as_constant(condition) {
            return if c != 0.0 { x } else { y };
        }
        // a branch within a branch that are otherwise the same
        if let Some((Operation::Select, &[inner, first, second])) = self.as_operation(x)
            && second == y
        {
            let both = self.and(condition, inner);
            return self.select(both, first, y);
        }
        self.made(Operation::Select, [condition, x, y])
    }

    /// The operation with these arguments, as many as it takes.
    pub fn apply(&mut self, operation: Operation, arguments: &[Expression]) -> Result<Expression, ExprError> {
        somersault_core::argument::expect_length("arguments", arguments.len(), operation.arity())?;
        Ok(match *arguments {
            [x] => self.unary(operation, x),
            [x, y] => self.binary(operation, x, y),
            [c, x, y] => self.select(c, x, y),
            [..] => Expression::NONE,
        })
    }

    fn unary(&mut self, operation: Operation, x: Expression) -> Expression {
        if operation == Operation::Negative {
            match self.nodes.get(x.index()) {
                Some(&Node::Operation(Operation::Negative, [inner, ..])) => return inner,
                Some(&Node::Operation(Operation::Subtract, [a, b, _])) => return self.subtract(b, a),
                Some(Node::Input(_) | Node::Constant(_) | Node::Operation(..)) | None => {}
            }
        }
        self.made(operation, [x, Expression::NONE, Expression::NONE])
    }

    fn binary(&mut self, operation: Operation, x: Expression, y: Expression) -> Expression {
        let (left, right) = (self.as_constant(x), self.as_constant(y));
        if left.is_some() && right.is_some() {
            return self.made(operation, [x, y, Expression::NONE]);
        }
        let simpler = match operation {
            Operation::Add => self.simpler_sum(x, y, left, right),
            Operation::Subtract => self.simpler_difference(x, y, left, right),
            Operation::Multiply => self.simpler_product(x, y, left, right),
            Operation::Divide => self.simpler_quotient(x, y, right),
            Operation::Power => right.and_then(|exponent| self.simpler_power(x, exponent)),
            Operation::Negative | Operation::Sqrt | Operation::Cbrt | Operation::Exp | Operation::Expm1 => {
                None
            }
            Operation::Log | Operation::Log1p | Operation::Sin | Operation::Cos | Operation::Tan => None,
            Operation::Asin | Operation::Acos | Operation::Atan | Operation::Sinh | Operation::Cosh => None,
            Operation::Tanh | Operation::Asinh | Operation::Acosh | Operation::Atanh | Operation::Abs => None,
            Operation::Sign | Operation::Floor | Operation::Ceil | Operation::Not => None,
            Operation::Atan2 | Operation::Hypot | Operation::Minimum | Operation::Maximum => None,
            Operation::Less | Operation::LessEqual | Operation::Equal | Operation::NotEqual => None,
            Operation::And | Operation::Or | Operation::Select => None,
        };
        if let Some(simpler) = simpler {
            return simpler;
        }
        let commutes = matches!(operation, Operation::Add | Operation::Multiply);
        let arguments = if commutes && y < x { [y, x] } else { [x, y] };
        self.made(operation, [arguments[0], arguments[1], Expression::NONE])
    }

    fn simpler_sum(
        &mut self,
        x: Expression,
        y: Expression,
        left: Option<f64>,
        right: Option<f64>,
    ) -> Option<Expression> {
        if left == Some(0.0) {
            return Some(y);
        }
        if right == Some(0.0) {
            return Some(x);
        }
        if let Some(b) = self.negated(y) {
            return Some(self.subtract(x, b));
        }
        if let Some(a) = self.negated(x) {
            return Some(self.subtract(y, a));
        }
        (x == y).then(|| {
            let two = self.constant(2.0);
            self.multiply(two, x)
        })
    }

    fn simpler_difference(
        &mut self,
        x: Expression,
        y: Expression,
        left: Option<f64>,
        right: Option<f64>,
    ) -> Option<Expression> {
        if right == Some(0.0) {
            return Some(x);
        }
        if left == Some(0.0) {
            return Some(self.negative(y));
        }
        self.negated(y).map(|b| self.add(x, b))
    }

    fn simpler_product(
        &mut self,
        x: Expression,
        y: Expression,
        left: Option<f64>,
        right: Option<f64>,
    ) -> Option<Expression> {
        for (factor, other) in [(left, y), (right, x)] {
            if factor == Some(0.0) {
                return Some(self.constant(0.0));
            }
            if factor == Some(1.0) {
                return Some(other);
            }
            if factor == Some(-1.0) {
                return Some(self.negative(other));
            }
        }
        self.with_sign_outside(Self::multiply, x, y)
    }

    /// A product or a quotient of arguments that are negated, without their signs; none where neither is.
    fn with_sign_outside(
        &mut self,
        operation: fn(&mut Self, Expression, Expression) -> Expression,
        x: Expression,
        y: Expression,
    ) -> Option<Expression> {
        let (a, b) = (self.negated(x), self.negated(y));
        if a.is_none() && b.is_none() {
            return None;
        }
        let value = operation(self, a.unwrap_or(x), b.unwrap_or(y));
        Some(if a.is_some() && b.is_some() { value } else { self.negative(value) })
    }

    fn simpler_quotient(&mut self, x: Expression, y: Expression, right: Option<f64>) -> Option<Expression> {
        if right == Some(1.0) {
            return Some(x);
        }
        if let Some(divisor) = right
            && is_power_of_two(divisor)
        {
            let inverse = self.constant(divisor.recip());
            return Some(self.multiply(x, inverse));
        }
        self.with_sign_outside(Self::divide, x, y)
    }

    fn simpler_power(&mut self, x: Expression, exponent: f64) -> Option<Expression> {
        if exponent == 0.5 {
            return Some(self.sqrt(x));
        }
        if exponent.fract() != 0.0 || exponent.abs() > LARGEST_POWER {
            return None;
        }
        let one = self.constant(1.0);
        let (mut result, mut square, mut left) = (one, x, exponent.abs() as u32);
        while left > 0 {
            if left % 2 == 1 {
                result = self.multiply(result, square);
            }
            left /= 2;
            if left > 0 {
                square = self.multiply(square, square);
            }
        }
        Some(if exponent < 0.0 { self.divide(one, result) } else { result })
    }

    /// What an expression is the negative of.
    fn negated(&self, x: Expression) -> Option<Expression> {
        match self.as_operation(x) {
            Some((Operation::Negative, &[inner])) => Some(inner),
            Some(_) | None => None,
        }
    }

    /// √(1 − x²), accurate near ±1.
    pub(crate) fn half_circle(&mut self, x: Expression) -> Expression {
        let difference = self.one_less_square(x);
        self.sqrt(difference)
    }

    /// 1 − x², accurate near ±1.
    pub(crate) fn one_less_square(&mut self, x: Expression) -> Expression {
        let one = self.constant(1.0);
        let (less, more) = (self.subtract(one, x), self.add(one, x));
        self.multiply(less, more)
    }

    pub(crate) fn square_sum(&mut self, x: Expression, y: Expression) -> Expression {
        let (x, y) = (self.multiply(x, x), self.multiply(y, y));
        self.add(x, y)
    }

    /// 1/x.
    pub(crate) fn inverse(&mut self, x: Expression) -> Expression {
        let one = self.constant(1.0);
        self.divide(one, x)
    }

    /// 1 where the condition holds, otherwise 0.
    pub(crate) fn when(&mut self, condition: Expression) -> Expression {
        let (one, zero) = (self.constant(1.0), self.constant(0.0));
        self.select(condition, one, zero)
    }

    /// 0 where the condition holds, otherwise 1.
    pub(crate) fn unless(&mut self, condition: Expression) -> Expression {
        let otherwise = self.not(condition);
        self.when(otherwise)
    }

    /// The product of a seed and a derivative, by which derivatives are made. Where either is zero because a branch is not
    /// taken, so is the product, even if the other is infinite.
    pub(crate) fn scale(&mut self, seed: Expression, derivative: Expression) -> Expression {
        for (branches, other) in [(seed, derivative), (derivative, seed)] {
            if let Some((Operation::Select, &[condition, x, y])) = self.as_operation(branches)
                && self.as_constant(y) == Some(0.0)
            {
                // no deeper than both: select joins a branch within a branch
                let product = self.scale(x, other);
                return self.select(condition, product, y);
            }
        }
        self.multiply(seed, derivative)
    }

    /// The node of an operation, or the constant that it is.
    fn made(&mut self, operation: Operation, arguments: [Expression; 3]) -> Expression {
        let mut numbers = [0.0; 3];
        let mut constant = true;
        for (number, &argument) in numbers.iter_mut().zip(&arguments[..operation.arity()]) {
            if argument.index() >= self.nodes.len() {
                let fault = ExprError::Foreign { found: argument.index(), allowed: self.nodes.len() };
                self.fault.get_or_insert(fault);
                return self.constant(f64::NAN);
            }
            match self.as_constant(argument) {
                Some(value) => *number = value,
                None => constant = false,
            }
        }
        if constant {
            return self.constant(operation.apply(numbers));
        }
        self.node(Node::Operation(operation, arguments))
    }

    fn node(&mut self, node: Node) -> Expression {
        if let Some(&known) = self.known.get(&node) {
            return known;
        }
        if self.nodes.len() >= MOST_NODES {
            let fault =
                ExprError::TooLarge { what: "expressions", found: self.nodes.len() + 1, allowed: MOST_NODES };
            self.fault.get_or_insert(fault);
            return Expression(0);
        }
        let expression = Expression(self.nodes.len() as u32);
        self.nodes.push(node);
        self.known.insert(node, expression);
        expression
    }

    /// Fails where something went wrong while the graph was built, or an expression is none of it.
    pub(crate) fn check(&self, expressions: &[Expression]) -> Result<(), ExprError> {
        if let Some(fault) = &self.fault {
            return Err(fault.clone());
        }
        match expressions.iter().find(|x| x.index() >= self.nodes.len()) {
            Some(x) => Err(ExprError::Foreign { found: x.index(), allowed: self.nodes.len() }),
            None => Ok(()),
        }
    }

    /// The nodes; an expression is the number of one.
    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The values of expressions by straightforward interpretation of the graph, in which inputs that are left out are NaN.
    pub fn interpret(&self, of: &[Expression], inputs: &[f64]) -> Result<Vec<f64>, ExprError> {
        self.check(of)?;
        let end = of.iter().map(|x| x.index() + 1).max().unwrap_or(0);
        let mut values = Vec::with_capacity(end);
        for node in &self.nodes[..end] {
            let value = match *node {
                Node::Input(number) => inputs.get(number as usize).copied().unwrap_or(f64::NAN),
                Node::Constant(bits) => f64::from_bits(bits),
                Node::Operation(operation, arguments) => operation
                    .apply(arguments.map(|x: Expression| values.get(x.index()).copied().unwrap_or(f64::NAN))),
            };
            values.push(value);
        }
        Ok(of.iter().map(|x| values[x.index()]).collect())
    }
}

/// Whether division by it is a multiplication without rounding: its inverse is a normal power of two, too.
fn is_power_of_two(x: f64) -> bool {
    x.is_normal() && x.recip().is_normal() && x.to_bits() & ((1 << 52) - 1) == 0
}
