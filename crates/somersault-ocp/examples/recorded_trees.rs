//! Trees recorded as expressions, against the kernels and against equations that are written out: microseconds for values, Jacobian
//! and Hessian. Run with `cargo run -p somersault-ocp --example recorded_trees`.

use nalgebra::{DMatrix, Vector3};
use somersault_expr::{Block, ExprFunction};
use somersault_multibody::models::{CartPendulum, TwoLinkArm};
use somersault_multibody::{Joint, Link, MassProperties, Model, ModelBuilder, ModelError};
use somersault_nlp::EvaluationError;
use somersault_ocp::collocation::{TracedFunction, TreeDynamics, VectorFunction};
use std::error::Error;
use std::time::Instant;

/// Hinges with rods of 1 kg, about z in a plane or about other axes.
fn chain(n: usize, is_planar: bool) -> Result<Model, ModelError> {
    let mut builder = ModelBuilder::new();
    let end = if is_planar { -0.5 * Vector3::y() } else { Vector3::new(0.1, -0.5, 0.2) };
    for k in 0..n {
        let axis = if is_planar { Vector3::z() } else { Vector3::new(0.3 + k as f64, -0.2, 0.7) };
        let (joint, rod) = (Joint::Revolute { axis }, MassProperties::rod(1.0, Vector3::zeros(), end));
        builder.add(match k.checked_sub(1) {
            None => Link::root("0", joint, rod),
            Some(before) => Link::child(k.to_string(), before.to_string(), joint, rod).at(end),
        })?;
    }
    builder.build()
}

/// The arm of thesis (8.2), M₁₂ corrected.
fn arm() -> Result<ExprFunction, Box<dyn Error>> {
    Ok(ExprFunction::trace(vec![Block::new("x", [4]), Block::new("u", [2])], |v| {
        let ([angle, v1, v2], u) = ([v[0][1], v[0][2], v[0][3]], &v[1]);
        let cos = angle.cos();
        let (a, b, c) = (
            cos * 0.5 + 2.708_333_333_333_333_5,
            cos * 0.25 + 0.041_666_666_666_666_664,
            0.041_666_666_666_666_664,
        );
        let bias = angle.sin() * 0.25;
        let (f1, f2) = (u[0] + bias * v2 * (v1 * 2.0 + v2) - v1 * 0.2, u[1] - bias * v1 * v1);
        let below = a * c - b * b;
        vec![v1, v2, (f1 * c - b * f2) / below, (a * f2 - b * f1) / below]
    })?)
}

/// Cart and pendulum of thesis appendix A.
fn cart() -> Result<ExprFunction, Box<dyn Error>> {
    Ok(ExprFunction::trace(vec![Block::new("x", [4]), Block::new("u", [1])], |v| {
        let (x, force) = (&v[0], v[1][0]);
        let (sin, cos) = (x[1].sin(), x[1].cos());
        let a = (force - sin * x[3] * x[3] + sin * cos * 9.81) / (sin * sin + 2.0);
        vec![x[2], x[3], a, a * cos + sin * 9.81]
    })?)
}

/// The least time of a call, μs.
fn time(mut call: impl FnMut() -> Result<(), EvaluationError>) -> Result<f64, EvaluationError> {
    let mut least = f64::INFINITY;
    for _ in 0..20 {
        let start = Instant::now();
        (0..500).try_for_each(|_| call())?;
        least = least.min(start.elapsed().as_secs_f64() / 500.0);
    }
    Ok(1e6 * least)
}

fn print(name: &str, function: &mut dyn VectorFunction, at: &[f64]) -> Result<Vec<f64>, EvaluationError> {
    let (m, n) = (function.n_outputs(), at.len());
    let (mut values, mut jacobian, mut hessian) = (vec![0.0; m], DMatrix::zeros(m, n), DMatrix::zeros(n, n));
    let weights = vec![1.0; m];
    let first = time(|| function.evaluate(at, &mut values))?;
    let second = time(|| function.jacobian(at, &mut jacobian))?;
    let third = time(|| function.add_hessian(at, &weights, &mut hessian))?;
    println!("{name:40} {first:6.2} {second:6.2} {third:6.2}");
    Ok(values)
}

fn main() -> Result<(), Box<dyn Error>> {
    let all = |n: usize| (0..n).collect::<Vec<_>>();
    for (name, model, actuated, written) in [
        ("cart with a pole", CartPendulum::default().model()?, vec![0], Some(cart()?)),
        ("arm of two links", TwoLinkArm::default().model()?, all(2), Some(arm()?)),
        ("four hinges in a plane", chain(4, true)?, all(4), None),
        ("four hinges, axes in any direction", chain(4, false)?, all(4), None),
    ] {
        let mut tree = TreeDynamics::try_new(&model, &actuated)?;
        let at: Vec<f64> = (0..tree.n_states() + tree.n_controls()).map(|k| 0.3 + 0.1 * k as f64).collect();
        let recorded = tree.expressions(&at)?;
        let kernels = print(&format!("{name}, kernels"), &mut tree, &at)?;
        let graph = print(&format!("{name}, recorded"), &mut TracedFunction::try_new(&recorded)?, &at)?;
        assert_eq!(kernels, graph);
        if let Some(written) = written {
            let values =
                print(&format!("{name}, written out"), &mut TracedFunction::try_new(&written)?, &at)?;
            assert!(values.iter().zip(&kernels).all(|(a, b)| (a - b).abs() < 1e-12 * (1.0 + b.abs())));
        }
    }
    Ok(())
}
