//! Functions: evaluation of many points, composition, errors, allocation.

use somersault_expr::{ArgumentError, Block, CancellationToken, ExprError, ExprFunction, Graph, Symbol};
use somersault_testkit::allocations::allocations;

/// A cart with a pendulum: states, a force, and a parameter.
fn cart_pendulum() -> ExprFunction {
    let blocks = vec![Block::new("x", [4]), Block::new("u", []), Block::new("mass", [])];
    ExprFunction::trace(blocks, |v| {
        let (x, u, m) = (&v[0], v[1][0], v[2][0]);
        let (s, c) = (x[1].sin(), x[1].cos());
        let total = 1.0 + m * (1.0 - c * c);
        let a = (u + m * s * (0.5 * x[3] * x[3] + 9.81 * c)) / total;
        let b = -(u * c + 0.5 * m * x[3] * x[3] * s * c + (1.0 + m) * 9.81 * s) / (0.5 * total);
        vec![x[2], x[3], a, b]
    })
    .unwrap()
}

fn inputs(points: usize) -> Vec<f64> {
    (0..points * 6).map(|k| 0.3 + (k as f64 * 0.7).sin()).collect()
}

#[test]
fn values_on_threads_are_those_of_one() {
    let f = cart_pendulum();
    for mut evaluator in [f.evaluator(), f.jacobian().unwrap().evaluator()] {
        let (n, m) = (10_003, evaluator.n_outputs());
        let inputs = inputs(n);
        let (mut one, mut several) = (vec![0.0; n * m], vec![0.0; n * m]);
        evaluator.evaluate_many(&inputs, &mut one).unwrap();
        evaluator.evaluate_on_threads(&inputs, &mut several, &CancellationToken::new()).unwrap();
        assert_eq!(one, several);
        let token = CancellationToken::new();
        token.cancel();
        assert_eq!(evaluator.evaluate_on_threads(&inputs, &mut several, &token), Err(ExprError::Cancelled));
    }
}

#[test]
fn evaluation_allocates_nothing() {
    let f = cart_pendulum();
    let (inputs, hessian) = (inputs(40), f.hessian().unwrap());
    let mut evaluator = f.evaluator();
    let mut outputs = vec![0.0; 40 * 4];
    evaluator.evaluate_many(&inputs, &mut outputs).unwrap();
    let count = allocations(|| {
        evaluator.evaluate(&inputs[..6], &mut outputs[..4]).unwrap();
        evaluator.evaluate_many(&inputs, &mut outputs).unwrap();
    });
    assert_eq!(count, 0);
    let mut evaluator = hessian.evaluator();
    let mut values = vec![0.0; evaluator.n_outputs()];
    assert_eq!(allocations(|| evaluator.evaluate(&inputs[..10], &mut values).unwrap()), 0);
}

#[test]
fn registers_are_used_again_and_a_sine_takes_its_cosine_along() {
    let f = ExprFunction::trace(vec![Block::new("x", [1])], |v| {
        let mut sum = v[0][0];
        for _ in 0..100 {
            sum = sum.sin() * sum.cos() + 1.0;
        }
        vec![sum]
    })
    .unwrap();
    let evaluator = f.evaluator();
    assert_eq!(evaluator.n_instructions(), 300);
    assert!(evaluator.n_registers() <= 7, "{}", evaluator.n_registers());
}

#[test]
fn the_derivative_of_a_function_is_a_function() {
    let f = cart_pendulum();
    let by_x = f.derivative("x").unwrap();
    let by_x_and_u = by_x.derivative("u").unwrap();
    assert_eq!((by_x.n_outputs(), by_x_and_u.n_outputs()), (16, 16));
    let point = inputs(1);
    let (h, mut dense) = (1e-6, [[0.0; 16]; 3]);
    by_x_and_u.evaluator().evaluate(&point, &mut dense[0]).unwrap();
    for (row, sign) in [(1, -1.0), (2, 1.0)] {
        let mut moved = point.clone();
        moved[4] += sign * h;
        by_x.evaluator().evaluate(&moved, &mut dense[row]).unwrap();
    }
    for k in 0..16 {
        let difference = (dense[2][k] - dense[1][k]) / (2.0 * h);
        assert!((difference - dense[0][k]).abs() < 1e-8);
    }
}

#[test]
fn lie_derivatives_along_a_field_are_tangents() {
    // a harmonic oscillator keeps its energy, and x″ = −x
    let mut g = Graph::new();
    let (x, v) = (g.input(), g.input());
    let field = [v, g.negative(x)];
    let square = g.multiply(x, x);
    let energy = {
        let other = g.multiply(v, v);
        g.add(square, other)
    };
    let change = g.tangent(&[energy], &[x, v], &field).unwrap()[0];
    let first = g.tangent(&[x], &[x, v], &field).unwrap()[0];
    let second = g.tangent(&[first], &[x, v], &field).unwrap()[0];
    assert_eq!(g.interpret(&[change, second], &[0.3, 0.4]).unwrap(), [0.0, -0.3]);
}

#[test]
fn a_function_is_inserted_into_another_graph() {
    let f = cart_pendulum();
    let mut graph = Graph::new();
    let x: Vec<_> = (0..6).map(|_| graph.input()).collect();
    let twice: Vec<_> = x.iter().map(|&x| graph.add(x, x)).collect();
    let outputs = graph.insert(f.graph(), f.outputs(), &twice).unwrap();
    let composed = ExprFunction::new(graph, vec![Block::new("x", [6])], outputs).unwrap();
    let point = inputs(1);
    let double: Vec<f64> = point.iter().map(|x| 2.0 * x).collect();
    let (mut found, mut expected) = ([0.0; 4], [0.0; 4]);
    composed.evaluator().evaluate(&point, &mut found).unwrap();
    f.evaluator().evaluate(&double, &mut expected).unwrap();
    assert_eq!(found, expected);
}

#[test]
fn sparse_patterns_have_no_entry_too_many_for_separable_functions() {
    let n = 50;
    let f = ExprFunction::trace(vec![Block::new("x", [n])], |v| {
        (0..n - 1).map(|k| v[0][k].sin() * v[0][k + 1]).collect::<Vec<Symbol<'_>>>()
    })
    .unwrap();
    let jacobian = f.jacobian().unwrap();
    assert_eq!(jacobian.sparsity().rows.len(), 2 * (n - 1));
    // sin xₖ · xₖ₊₁: a diagonal, but for the last, and one below it
    assert_eq!(f.hessian().unwrap().sparsity().rows.len(), 2 * (n - 1));
}

#[test]
fn a_long_sum_has_its_derivatives_in_time_and_memory_that_grow_with_its_length() {
    // by columns the first of these would visit 10⁹ nodes, by rows the second
    let n = 50_000;
    let sum = ExprFunction::trace(vec![Block::new("x", [n])], |v| {
        vec![v[0].iter().fold(v[0][0].constant(0.0), |sum, &x| sum + x * x)]
    })
    .unwrap();
    assert_eq!(sum.jacobian().unwrap().sparsity().rows.len(), n);
    assert_eq!(sum.hessian().unwrap().sparsity().rows.len(), n);
    let sums = ExprFunction::trace(vec![Block::new("x", [])], |v| {
        let mut x = v[0][0];
        let mut next = || {
            x = x.sin();
            x
        };
        (0..n).map(|_| next()).collect()
    })
    .unwrap();
    assert_eq!(sums.jacobian().unwrap().sparsity().rows.len(), n);
}

#[test]
fn what_is_wrong_is_named() {
    let f = cart_pendulum();
    let length = |argument, expected, found| ArgumentError::Length { argument, expected, found };
    let mut evaluator = f.evaluator();
    assert_eq!(evaluator.evaluate(&[0.0; 5], &mut [0.0; 4]), Err(length("inputs", 6, 5)));
    assert_eq!(evaluator.evaluate(&[0.0; 6], &mut [0.0; 3]), Err(length("outputs", 4, 3)));
    assert_eq!(evaluator.evaluate_many(&[0.0; 13], &mut [0.0; 8]), Err(length("inputs", 12, 13)));
    assert_eq!(
        f.derivative("y").unwrap_err().to_string(),
        "there is no input `y`; the inputs are `x`, `u`, `mass`"
    );
    let twice = vec![Block::new("x", [1]), Block::new("x", [2])];
    assert_eq!(
        ExprFunction::trace(twice, |_| vec![]).unwrap_err(),
        ExprError::RepeatedInput { found: "x".into() }
    );
    let huge = vec![Block::new("x", [1 << 40, 1 << 40])];
    assert!(matches!(ExprFunction::trace(huge, |_| vec![]), Err(ExprError::TooLarge { what: "inputs", .. })));
    // an expression of a larger graph
    let (mut small, mut large) = (Graph::new(), Graph::new());
    let x = small.input();
    let far = (0..9).map(|_| large.input()).last().unwrap();
    let sum = small.add(x, far);
    let foreign = ExprFunction::new(small.clone(), vec![Block::new("x", [])], vec![sum]);
    assert_eq!(foreign.unwrap_err(), ExprError::Foreign { found: 8, allowed: 1 });
    let sine = large.sin(far);
    assert_eq!(large.gradient(far, &[sine]), Err(ExprError::NotAnInput { found: 9 }));
}

#[test]
fn a_function_without_outputs_or_inputs_is_one() {
    let nothing = ExprFunction::trace(vec![Block::new("x", [2])], |_| vec![]).unwrap();
    nothing.evaluator().evaluate(&[1.0, 2.0], &mut []).unwrap();
    let constant = ExprFunction::trace(vec![], |_| vec![]).unwrap();
    constant.evaluator().evaluate_many(&[], &mut []).unwrap();
    assert_eq!(nothing.jacobian().unwrap().sparsity().n_columns(), 2);
}

fn shared<T: Clone + Send + Sync>() {}

#[test]
fn functions_are_shared_between_threads() {
    shared::<ExprFunction>();
}
