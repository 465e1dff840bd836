//! Random graphs: the tape, the lanes, the derivatives and their patterns against straightforward interpretation.

use crate::dual;
use num_dual::{Dual3_64, Dual64, HyperDual64};
use somersault_core::random::SplitMix64;
use somersault_expr::{Block, ExprFunction, Expression, Graph, LANES};

const INPUTS: usize = 4;

/// A graph of some twenty operations, and some of its expressions. Arguments are brought to where operations are smooth, unless
/// it is to have edges; without transcendental functions all bits are the same in lanes.
fn graph(random: &mut SplitMix64, transcendental: bool, edges: bool) -> (Graph, Vec<Expression>) {
    let mut g = Graph::new();
    let mut pool: Vec<Expression> = (0..INPUTS).map(|_| g.input()).collect();
    pool.push(g.constant(0.75));
    pool.push(g.constant(-2.0));
    for _ in 0..20 {
        let pick = |random: &mut SplitMix64| (random.bits() % pool.len() as u64) as usize;
        let (x, y, z) = (pool[pick(random)], pool[pick(random)], pool[pick(random)]);
        let (one, half) = (g.constant(1.0), g.constant(0.5));
        let tame = |g: &mut Graph, x| {
            if edges {
                return x;
            }
            let square = g.multiply(x, x);
            let root = g.hypot(square, half);
            let scale = g.add(one, root);
            g.divide(x, scale)
        };
        let above = |g: &mut Graph, x| {
            if edges {
                return x;
            }
            let tame = tame(g, x);
            g.add(tame, one)
        };
        let kinds = if transcendental { 26 } else { 14 };
        let made = match random.bits() % kinds {
            0 => g.add(x, y),
            1 => g.subtract(x, y),
            2 => {
                let (x, y) = (tame(&mut g, x), tame(&mut g, y));
                g.multiply(x, y)
            }
            3 => {
                let y = above(&mut g, y);
                g.divide(x, y)
            }
            4 => {
                let x = above(&mut g, x);
                g.sqrt(x)
            }
            5 => g.negative(x),
            6 => g.abs(x),
            7 => g.minimum(x, y),
            8 => g.maximum(x, y),
            9 => {
                let c = g.less(x, y);
                g.select(c, z, x)
            }
            10 => {
                let c = g.less_equal(y, z);
                let d = g.not(c);
                g.select(d, z, x)
            }
            11 => {
                let (x, three) = (tame(&mut g, x), g.constant(3.0));
                g.power(x, three)
            }
            12 => {
                let c = g.floor(x);
                let d = g.sign(y);
                g.add(c, d)
            }
            13 => {
                let (c, d) = (g.less(x, y), g.not_equal(y, z));
                let e = g.and(c, d);
                g.select(e, x, y)
            }
            14 => g.sin(x),
            15 => g.cos(x),
            16 => {
                let x = tame(&mut g, x);
                g.exp(x)
            }
            17 => {
                let x = above(&mut g, x);
                g.log(x)
            }
            18 => {
                let x = tame(&mut g, x);
                g.tan(x)
            }
            19 => g.tanh(x),
            20 => {
                let y = above(&mut g, y);
                g.atan2(x, y)
            }
            21 => {
                let (x, y) = (above(&mut g, x), tame(&mut g, y));
                g.power(x, y)
            }
            22 => {
                let x = tame(&mut g, x);
                g.asinh(x)
            }
            23 => {
                let x = tame(&mut g, x);
                g.expm1(x)
            }
            24 => {
                let y = above(&mut g, y);
                g.hypot(x, y)
            }
            _ => g.atan(x),
        };
        pool.push(made);
    }
    let outputs = (0..3).map(|k| pool[pool.len() - 1 - 3 * k]).chain([pool[0], pool[4], pool[0]]).collect();
    (g, outputs)
}

fn function(g: &Graph, outputs: &[Expression]) -> ExprFunction {
    ExprFunction::new(g.clone(), vec![Block::new("x", [INPUTS])], outputs.to_vec()).unwrap()
}

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

fn close(found: f64, expected: f64, tolerance: f64) -> bool {
    same(found, expected) || (found - expected).abs() <= tolerance * (1.0 + expected.abs())
}

/// Points, of which some have the edges of `f64` among their numbers.
fn points(random: &mut SplitMix64, n: usize, edges: bool) -> Vec<f64> {
    const EDGES: [f64; 6] = [0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e300];
    (0..n * INPUTS)
        .map(|_| match random.bits() % 3 {
            0 if edges => EDGES[(random.bits() % 6) as usize],
            _ => 3.0 * random.unit() - 1.5,
        })
        .collect()
}

#[test]
fn tape_and_lanes_give_the_bits_of_the_interpretation() {
    let mut random = SplitMix64::new(11);
    for round in 0..1000 {
        let (transcendental, edges) = (round % 2 == 0, round % 4 > 1);
        let (g, outputs) = graph(&mut random, transcendental, edges);
        let f = function(&g, &outputs);
        let jacobian = f.jacobian().unwrap();
        let n = 2 * LANES + 3;
        let inputs = points(&mut random, n, edges);
        for (mut evaluator, values) in [(f.evaluator(), true), (jacobian.evaluator(), false)] {
            let m = evaluator.n_outputs();
            let mut one = vec![0.0; m];
            let mut many = vec![0.0; n * m];
            evaluator.evaluate_many(&inputs, &mut many).unwrap();
            for (k, point) in inputs.chunks(INPUTS).enumerate() {
                evaluator.evaluate(point, &mut one).unwrap();
                if values {
                    let expected = g.interpret(&outputs, point).unwrap();
                    assert!(one.iter().zip(&expected).all(|(a, b)| same(*a, *b)), "{one:?} {expected:?}");
                }
                for (a, b) in one.iter().zip(&many[k * m..]) {
                    let equal = if transcendental { edges || close(*b, *a, 1e-10) } else { same(*a, *b) };
                    assert!(equal, "round {round}: {a} one at a time, {b} in lanes");
                }
            }
        }
    }
}

#[test]
fn derivatives_are_those_of_dual_numbers() {
    let mut random = SplitMix64::new(12);
    for _ in 0..1000 {
        let (mut g, outputs) = graph(&mut random, true, false);
        let point = points(&mut random, 1, false);
        let f = function(&g, &outputs);
        let derivative = f.jacobian().unwrap();
        let mut values = vec![0.0; derivative.evaluator().n_outputs()];
        derivative.evaluator().evaluate(&point, &mut values).unwrap();
        let mut dense = vec![[0.0; INPUTS]; outputs.len()];
        for ((row, column), value) in derivative.sparsity().entries().zip(&values) {
            dense[row][column] = *value;
        }
        for column in 0..INPUTS {
            let mut duals: Vec<Dual64> = point.iter().map(|&x| x.into()).collect();
            duals[column] = duals[column].derivative();
            for (row, &x) in outputs.iter().enumerate() {
                let expected = dual::evaluate(&g, x, &duals).eps;
                assert!(close(dense[row][column], expected, 1e-10), "{} {expected}", dense[row][column]);
            }
        }
        // thirds by one input, which arcs of order one need
        let input = g.inputs()[..1].to_vec();
        let mut orders = vec![outputs[0]];
        for order in 0..3 {
            let next = g.gradient(orders[order], &input).unwrap()[0];
            orders.push(next);
        }
        let found = g.interpret(&orders[1..], &point).unwrap();
        let mut duals: Vec<Dual3_64> = point.iter().map(|&x| x.into()).collect();
        duals[0] = duals[0].derivative();
        let expected = dual::evaluate(&g, outputs[0], &duals);
        for (found, expected) in found.iter().zip([expected.v1, expected.v2, expected.v3]) {
            assert!(close(*found, expected, 1e-8), "{found} {expected}");
        }
    }
}

#[test]
fn hessians_are_those_of_hyper_dual_numbers_and_no_entry_is_missing() {
    let mut random = SplitMix64::new(13);
    for _ in 0..300 {
        let (g, outputs) = graph(&mut random, true, false);
        let point = points(&mut random, 1, false);
        let multipliers: Vec<f64> = outputs.iter().map(|_| random.unit() - 0.5).collect();
        let f = function(&g, &outputs);
        let derivative = f.hessian().unwrap();
        let mut values = vec![0.0; derivative.evaluator().n_outputs()];
        let inputs = [&point[..], &multipliers[..]].concat();
        derivative.evaluator().evaluate(&inputs, &mut values).unwrap();
        let mut dense = [[0.0; INPUTS]; INPUTS];
        for ((row, column), value) in derivative.sparsity().entries().zip(&values) {
            assert!(row >= column);
            dense[row][column] = *value;
        }
        for row in 0..INPUTS {
            for column in 0..=row {
                let duals: Vec<HyperDual64> = (0..INPUTS)
                    .map(|k| {
                        let mut dual = HyperDual64::from(point[k]);
                        dual.eps1 = f64::from(u8::from(k == row));
                        dual.eps2 = f64::from(u8::from(k == column));
                        dual
                    })
                    .collect();
                let expected: f64 = outputs
                    .iter()
                    .zip(&multipliers)
                    .map(|(&x, multiplier)| multiplier * dual::evaluate(&g, x, &duals).eps1eps2)
                    .sum();
                assert!(close(dense[row][column], expected, 1e-9), "{} {expected}", dense[row][column]);
            }
        }
    }
}
