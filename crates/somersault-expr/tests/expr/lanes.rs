//! Functions in lanes: accuracy and edges.

use crate::digits::{COS, EXP, LOG, SIN};
use somersault_core::random::SplitMix64;
use somersault_expr::{Block, ExprFunction, Expression, Graph};

type Make = fn(&mut Graph, Expression) -> Expression;

/// Values in lanes.
fn many(make: Make, x: &[f64]) -> Vec<f64> {
    let mut graph = Graph::new();
    let input = graph.input();
    let output = make(&mut graph, input);
    let f = ExprFunction::new(graph, vec![Block::new("x", [])], vec![output]).unwrap();
    let mut values = vec![0.0; x.len()];
    f.evaluator().evaluate_many(x, &mut values).unwrap();
    values
}

type OfNumber = fn(f64) -> f64;

const FUNCTIONS: [(Make, OfNumber); 4] =
    [(Graph::sin, f64::sin), (Graph::cos, f64::cos), (Graph::exp, f64::exp), (Graph::log, f64::ln)];

/// The unit in the last place.
fn ulp(x: f64) -> f64 {
    let x = x.abs();
    x.next_up() - x
}

#[test]
fn functions_in_lanes_are_within_one_unit_in_the_last_place_of_sixty_digits() {
    for ((make, _), table) in FUNCTIONS.into_iter().zip([&SIN[..], &COS, &EXP, &LOG]) {
        let x: Vec<f64> = table.iter().map(|row| row[0]).collect();
        for (found, [x, high, low]) in many(make, &x).iter().zip(table) {
            let error = ((found - high) - low).abs() / ulp(*high);
            assert!(error < 1.0, "{found} for {high} + {low} at {x}: {error} ulp");
        }
    }
}

#[test]
fn functions_in_lanes_are_within_two_units_in_the_last_place_of_the_standard_library() {
    let mut random = SplitMix64::new(3);
    for (index, (make, exact)) in FUNCTIONS.into_iter().enumerate() {
        let x: Vec<f64> = (0..200_000)
            .map(|k| {
                let t = 2.0 * random.unit() - 1.0;
                match (index, k % 4) {
                    (0 | 1, 0) => 1e9 * t,
                    (0 | 1, 1) => 1e15 * t,
                    (0 | 1, _) => 10.0 * t,
                    (2, 0) => 745.0 * t,
                    (2, _) => 3.0 * t,
                    (_, 0) => (700.0 * t).exp(),
                    (_, _) => 1.0 + 0.6 * t,
                }
            })
            .collect();
        for (found, x) in many(make, &x).iter().zip(&x) {
            let expected = exact(*x);
            let near = (found - expected).abs() <= 2.0 * ulp(expected);
            assert!(*found == expected || near, "function {index} at {x}: {found} for {expected}");
        }
    }
}

#[test]
fn edges_in_lanes_are_those_of_the_standard_library() {
    let edges = [
        0.0,
        -0.0,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
        -f64::NAN,
        -1.0,
        1.0,
        f64::MAX,
        f64::MIN,
        f64::MIN_POSITIVE,
        710.0,
        -745.2,
        -800.0,
        1e300,
    ];
    for (index, (make, exact)) in FUNCTIONS.into_iter().enumerate() {
        for (found, x) in many(make, &edges).iter().zip(edges) {
            let expected = exact(x);
            let same = found.to_bits() == expected.to_bits()
                || (found.is_nan() && expected.is_nan())
                || (found - expected).abs() <= ulp(expected);
            assert!(same, "function {index} at {x}: {found} for {expected}");
            assert!(
                expected != 0.0 || found.is_sign_negative() == expected.is_sign_negative(),
                "{index} {x}"
            );
        }
    }
}
