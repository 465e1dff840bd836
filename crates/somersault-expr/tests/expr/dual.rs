//! The graph interpreted over dual numbers: derivatives that the graph's own have no part in.

use num_dual::DualNum;
use somersault_expr::{Expression, Graph, Operation};
use std::collections::HashMap;

/// The value of an expression, whose inputs have these values.
pub(crate) fn evaluate<D: DualNum<Primitive = f64> + Copy>(graph: &Graph, of: Expression, inputs: &[D]) -> D {
    let mut known = HashMap::new();
    for (&input, &value) in graph.inputs().iter().zip(inputs) {
        known.insert(input, value);
    }
    walk(graph, of, &mut known)
}

fn walk<D: DualNum<Primitive = f64> + Copy>(
    graph: &Graph,
    x: Expression,
    known: &mut HashMap<Expression, D>,
) -> D {
    if let Some(&value) = known.get(&x) {
        return value;
    }
    let value = match (graph.as_constant(x), graph.as_operation(x)) {
        (Some(number), _) => D::from(number),
        (None, Some((operation, arguments))) => {
            let values: Vec<D> = arguments.iter().map(|&a| walk(graph, a, known)).collect();
            apply(operation, &values)
        }
        (None, None) => panic!("an input without a value"),
    };
    known.insert(x, value);
    value
}

fn truth<D: DualNum<Primitive = f64>>(holds: bool) -> D {
    D::from(f64::from(u8::from(holds)))
}

/// An operation by the formulas of num-dual.
pub(crate) fn apply<D: DualNum<Primitive = f64> + Copy>(operation: Operation, arguments: &[D]) -> D {
    let x = arguments[0];
    let y = arguments.get(1).copied().unwrap_or(x);
    let z = arguments.get(2).copied().unwrap_or(x);
    match operation {
        Operation::Negative => -x,
        Operation::Sqrt => x.sqrt(),
        Operation::Cbrt => x.cbrt(),
        Operation::Exp => x.exp(),
        Operation::Expm1 => x.exp_m1(),
        Operation::Log => x.ln(),
        Operation::Log1p => x.ln_1p(),
        Operation::Sin => x.sin(),
        Operation::Cos => x.cos(),
        Operation::Tan => x.tan(),
        Operation::Asin => x.asin(),
        Operation::Acos => x.acos(),
        Operation::Atan => x.atan(),
        Operation::Sinh => x.sinh(),
        Operation::Cosh => x.cosh(),
        Operation::Tanh => x.tanh(),
        Operation::Asinh => x.asinh(),
        Operation::Acosh => x.acosh(),
        Operation::Atanh => x.atanh(),
        Operation::Abs => {
            if x.re() < 0.0 {
                -x
            } else {
                x
            }
        }
        Operation::Sign => D::from(if x.re() == 0.0 { 0.0 } else { x.re().signum() }),
        Operation::Floor => D::from(x.re().floor()),
        Operation::Ceil => D::from(x.re().ceil()),
        Operation::Not => truth(x.re() == 0.0),
        Operation::Add => x + y,
        Operation::Subtract => x - y,
        Operation::Multiply => x * y,
        Operation::Divide => x / y,
        Operation::Power => x.powd(y),
        Operation::Atan2 => x.atan2(y),
        Operation::Hypot => (x * x + y * y).sqrt(),
        Operation::Minimum => {
            if x.re() <= y.re() {
                x
            } else {
                y
            }
        }
        Operation::Maximum => {
            if x.re() >= y.re() {
                x
            } else {
                y
            }
        }
        Operation::Less => truth(x.re() < y.re()),
        Operation::LessEqual => truth(x.re() <= y.re()),
        Operation::Equal => truth(x.re() == y.re()),
        Operation::NotEqual => truth(x.re() != y.re()),
        Operation::And => truth(x.re() != 0.0 && y.re() != 0.0),
        Operation::Or => truth(x.re() != 0.0 || y.re() != 0.0),
        Operation::Select => {
            if x.re() != 0.0 {
                y
            } else {
                z
            }
        }
        _ => panic!("{operation:?} has no dual"),
    }
}
