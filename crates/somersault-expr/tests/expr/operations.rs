//! Each operation of the table: values, edge cases, derivatives to the third order.

use crate::dual;
use num_dual::{Dual3_64, Dual64, DualNum};
use somersault_core::random::SplitMix64;
use somersault_expr::{Block, ExprFunction, Expression, Graph, Operation};

/// Arguments where an operation is smooth.
fn smooth(operation: Operation, random: &mut SplitMix64) -> Vec<f64> {
    let mut between = |a: f64, b: f64| a + (b - a) * random.unit();
    match operation {
        Operation::Sqrt | Operation::Log | Operation::Cbrt => vec![between(0.2, 5.0)],
        Operation::Log1p => vec![between(-0.7, 4.0)],
        Operation::Asin | Operation::Acos | Operation::Atanh => vec![between(-0.9, 0.9)],
        Operation::Acosh => vec![between(1.2, 5.0)],
        Operation::Tan => vec![between(-1.2, 1.2)],
        Operation::Power => vec![between(0.3, 3.0), between(-2.5, 2.5)],
        _ => (0..operation.arity()).map(|_| between(-3.0, 3.0)).collect(),
    }
}

fn close(found: f64, expected: f64, tolerance: f64) -> bool {
    (found - expected).abs() <= tolerance * (1.0 + expected.abs())
}

#[test]
fn every_operation_has_the_derivatives_of_dual_numbers_to_the_third_order() {
    let mut random = SplitMix64::new(7);
    for &operation in Operation::ALL {
        let mut graph = Graph::new();
        let inputs: Vec<_> = (0..operation.arity()).map(|_| graph.input()).collect();
        let value = graph.apply(operation, &inputs).unwrap();
        for k in 0..operation.arity() {
            let mut orders = vec![value];
            for order in 0..3 {
                let next = graph.gradient(orders[order], &inputs[k..=k]).unwrap()[0];
                orders.push(next);
            }
            for _ in 0..20 {
                let point = smooth(operation, &mut random);
                let found = graph.interpret(&orders, &point).unwrap();
                let mut duals: Vec<Dual3_64> = point.iter().map(|&x| Dual3_64::from(x)).collect();
                duals[k] = duals[k].derivative();
                let expected = dual::apply(operation, &duals);
                for (found, expected) in
                    found.iter().zip([expected.re, expected.v1, expected.v2, expected.v3])
                {
                    assert!(
                        close(*found, expected, 3e-12),
                        "{operation:?} by argument {k} at {point:?}: {found} for {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn forward_and_reverse_derivatives_agree() {
    let mut random = SplitMix64::new(8);
    for &operation in Operation::ALL {
        let mut graph = Graph::new();
        let inputs: Vec<_> = (0..operation.arity()).map(|_| graph.input()).collect();
        let value = graph.apply(operation, &inputs).unwrap();
        let gradient = graph.gradient(value, &inputs).unwrap();
        for k in 0..inputs.len() {
            let one = graph.constant(1.0);
            let forward = graph.tangent(&[value], &inputs[k..=k], &[one]).unwrap()[0];
            let point = smooth(operation, &mut random);
            let found = graph.interpret(&[forward, gradient[k]], &point).unwrap();
            assert!(close(found[0], found[1], 1e-15), "{operation:?}: {found:?}");
        }
    }
}

/// The value and the gradient of an expression of one input.
fn at(build: impl Fn(&mut Graph, Expression) -> Expression, x: f64) -> (f64, f64) {
    let mut graph = Graph::new();
    let input = graph.input();
    let value = build(&mut graph, input);
    let gradient = graph.gradient(value, &[input]).unwrap()[0];
    let found = graph.interpret(&[value, gradient], &[x]).unwrap();
    (found[0], found[1])
}

#[test]
fn edges_have_the_values_and_derivatives_of_the_formulas() {
    assert_eq!(at(|g, x| g.sqrt(x), 0.0), (0.0, f64::INFINITY));
    assert_eq!(at(|g, x| g.cbrt(x), 0.0), (0.0, f64::INFINITY));
    assert_eq!(at(|g, x| g.abs(x), 0.0), (0.0, 0.0));
    assert_eq!(at(|g, x| g.log(x), 0.0), (f64::NEG_INFINITY, f64::INFINITY));
    assert_eq!(at(|g, x| g.exp(x), f64::NEG_INFINITY), (0.0, 0.0));
    assert_eq!(at(|g, x| g.tanh(x), f64::INFINITY).0, 1.0);
    assert_eq!(at(|g, x| g.asinh(x), 1e200), (1e200f64.asinh(), 1e-200));
    for power in 0..6 {
        let (value, slope) = at(
            |g, x| {
                let power = g.constant(f64::from(power));
                g.power(x, power)
            },
            0.0,
        );
        assert_eq!((value, slope), (0f64.powi(power), if power == 1 { 1.0 } else { 0.0 }));
    }
    for power in [2.5, 1.5, 17.0] {
        let exponent = |g: &mut Graph, x| {
            let power = g.constant(power);
            g.power(x, power)
        };
        assert_eq!(at(exponent, 0.0), (0.0, 0.0));
    }
    // the exponent moves: 0ʸ is 0 for y > 0
    let zero = |g: &mut Graph, y| {
        let base = g.constant(0.0);
        g.power(base, y)
    };
    assert_eq!(at(zero, 2.0), (0.0, 0.0));
    // ties take the first argument
    let tie = |g: &mut Graph, x| {
        let double = g.add(x, x);
        g.maximum(x, double)
    };
    assert_eq!(at(tie, 0.0), (0.0, 1.0));
    let nan = |g: &mut Graph, x| {
        let one = g.constant(1.0);
        g.minimum(one, x)
    };
    assert!(at(nan, f64::NAN).0.is_nan());
}

#[test]
fn a_branch_that_is_not_taken_has_no_derivative() {
    // where(x > 0, √x, 0) at 0, where the root has the slope ∞
    let root = |g: &mut Graph, x| {
        let zero = g.constant(0.0);
        let (positive, root) = (g.less(zero, x), g.sqrt(x));
        g.select(positive, root, zero)
    };
    assert_eq!(at(root, 0.0), (0.0, 0.0));
    assert_eq!(at(root, 4.0), (2.0, 0.25));
    let quotient = |g: &mut Graph, x| {
        let (zero, one) = (g.constant(0.0), g.constant(1.0));
        let (here, sine) = (g.equal(x, zero), g.sin(x));
        let quotient = g.divide(sine, x);
        g.select(here, one, quotient)
    };
    assert_eq!(at(quotient, 0.0), (1.0, 0.0));
}

#[test]
fn branches_within_branches_cost_one_condition_each() {
    // 2000 nested roots, each within the branch of the one before
    let mut g = Graph::new();
    let x = g.input();
    let (zero, mut y) = (g.constant(0.0), x);
    for _ in 0..2000 {
        let (positive, root) = (g.less(zero, y), g.sqrt(y));
        y = g.select(positive, root, zero);
    }
    let before = g.len();
    let slope = g.gradient(y, &[x]).unwrap()[0];
    assert!(g.len() - before < 8 * 2000, "{}", g.len() - before);
    assert_eq!(g.interpret(&[y, slope], &[0.0]).unwrap(), [0.0, 0.0]);
}

#[test]
fn simplifications_keep_values() {
    let mut graph = Graph::new();
    let (x, y) = (graph.input(), graph.input());
    let (zero, one, two) = (graph.constant(0.0), graph.constant(1.0), graph.constant(2.0));
    assert_eq!(graph.add(x, zero), x);
    assert_eq!(graph.multiply(one, x), x);
    assert_eq!(graph.multiply(x, zero), zero);
    assert_eq!(graph.divide(x, one), x);
    assert_eq!(graph.power(x, one), x);
    let negative = graph.negative(x);
    assert_eq!(graph.negative(negative), x);
    let (sum, difference) = (graph.add(x, y), graph.subtract(y, x));
    assert_eq!(graph.add(y, x), sum);
    assert_eq!(graph.add(negative, y), difference);
    assert_eq!(graph.negative(difference), graph.subtract(x, y));
    assert_eq!(graph.add(x, x), graph.multiply(two, x));
    assert_eq!(graph.multiply(two, two), graph.constant(4.0));
    assert_eq!(graph.select(one, x, y), x);
    // what these are for infinite x is no constant
    for kept in [graph.subtract(x, x), graph.divide(x, x), graph.divide(zero, x)] {
        assert_eq!(graph.as_constant(kept), None);
        assert!(graph.interpret(&[kept], &[f64::NAN, 0.0]).unwrap()[0].is_nan());
    }
}

#[test]
fn the_gradient_of_a_formula_of_rust_is_that_of_dual_numbers() {
    fn formula<D: DualNum<Primitive = f64> + Copy>(x: D, y: D) -> D {
        (x * y.sin() + (x * x + y * y).sqrt().ln()) / (y.exp() + 1.5)
    }
    let function = ExprFunction::trace(vec![Block::new("x", []), Block::new("y", [])], |v| {
        let (x, y) = (v[0][0], v[1][0]);
        vec![(x * y.sin() + (x * x + y * y).sqrt().ln()) / (y.exp() + 1.5)]
    })
    .unwrap();
    let mut found = [0.0; 2];
    function.jacobian().unwrap().evaluator().evaluate(&[0.7, -1.3], &mut found).unwrap();
    let by_x = formula(Dual64::from(0.7).derivative(), Dual64::from(-1.3)).eps;
    let by_y = formula(Dual64::from(0.7), Dual64::from(-1.3).derivative()).eps;
    assert!(close(found[0], by_x, 1e-15) && close(found[1], by_y, 1e-15), "{found:?} {by_x} {by_y}");
}
