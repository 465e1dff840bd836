//! Functions that are not traced: derivatives through their calls, derivatives that are wrong, and what a search may take.

use nalgebra::DMatrix;
use somersault_core::differences::Differences;
use somersault_expr::{Block, ExprFunction};
use somersault_nlp::{EvaluationError, Flow, Status};
use somersault_ocp::arcs::{Polish, Verdict};
use somersault_ocp::collocation::{
    Collocation, CollocationError, CollocationReport, CollocationStatus, ComposedFunction, ExternalFunction,
    Labels, Mesh, Phase, Problem, SearchError, TracedFunction, VectorFunction,
};

fn labels(function: &str, outputs: &[&str], arguments: &[&str]) -> Labels {
    let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    Labels { function: function.to_owned(), outputs: owned(outputs), arguments: owned(arguments) }
}

/// sin y, without derivatives.
fn sine() -> ExternalFunction {
    ExternalFunction::new(labels("sine", &["sine"], &["y"]), |points, values| {
        points.iter().zip(values).for_each(|(y, value)| *value = y.sin());
        Ok(())
    })
}

/// a b² and a + b, with their Jacobian.
fn pair() -> ExternalFunction {
    let values = |points: &[f64], values: &mut [f64]| {
        for (y, value) in points.chunks_exact(2).zip(values.chunks_exact_mut(2)) {
            value.copy_from_slice(&[y[0] * y[1] * y[1], y[0] + y[1]]);
        }
        Ok(())
    };
    let jacobian = |points: &[f64], values: &mut [f64]| {
        for (y, value) in points.chunks_exact(2).zip(values.chunks_exact_mut(4)) {
            value.copy_from_slice(&[y[1] * y[1], 2.0 * y[0] * y[1], 1.0, 1.0]);
        }
        Ok(())
    };
    ExternalFunction::new(labels("pair", &["product", "sum"], &["a", "b"]), values).with_jacobian(jacobian)
}

#[test]
fn derivatives_go_through_calls_of_what_calls_return() {
    let inputs = || vec![Block::new("z", [2]), Block::new("w", [3])];
    // w₀ = sin(z₀ z₁), (w₁, w₂) = pair(w₀ z₁, z₀ + w₀)
    let outer = ExprFunction::trace(inputs(), |b| {
        vec![b[1][1] * b[0][0] + b[1][0].sin(), b[1][2] * b[1][1] * b[0][1]]
    })
    .unwrap();
    let first = ExprFunction::trace(inputs(), |b| vec![b[0][0] * b[0][1]]).unwrap();
    let second = ExprFunction::trace(inputs(), |b| vec![b[1][0] * b[0][1], b[0][0] + b[1][0]]).unwrap();
    let mut composed = ComposedFunction::try_new(&outer, vec![(&first, sine()), (&second, pair())]).unwrap();
    let whole = ExprFunction::trace(vec![Block::new("z", [2])], |blocks| {
        let z = &blocks[0];
        let w = (z[0] * z[1]).sin();
        let (a, b) = (w * z[1], z[0] + w);
        let (product, sum) = (a * b * b, a + b);
        vec![product * z[0] + w.sin(), sum * product * z[1]]
    });
    let mut traced = TracedFunction::try_new(&whole.unwrap()).unwrap();
    for z in [[0.7, -1.3], [2.0, 0.4], [-0.1, 3.0]] {
        let mut values = [[0.0; 2]; 2];
        let mut jacobians = [DMatrix::zeros(2, 2), DMatrix::zeros(2, 2)];
        let mut hessians = [DMatrix::zeros(2, 2), DMatrix::zeros(2, 2)];
        let functions: [&mut dyn VectorFunction; 2] = [&mut composed, &mut traced];
        for (k, function) in functions.into_iter().enumerate() {
            function.evaluate(&z, &mut values[k]).unwrap();
            function.jacobian(&z, &mut jacobians[k]).unwrap();
            function.add_hessian(&z, &[0.7, -0.3], &mut hessians[k]).unwrap();
            hessians[k].fill_lower_triangle_with_upper_triangle();
        }
        assert_eq!(values[0], values[1]);
        let size = jacobians[1].amax() + hessians[1].amax() + 1.0;
        assert!((&jacobians[0] - &jacobians[1]).amax() < 1e-9 * size);
        // second differences of the sine
        assert!((&hessians[0] - &hessians[1]).amax() < 1e-6 * size);
    }
    assert!(composed.relative_errors().derivatives == Differences::OF_ROUNDED.accuracy());
    let none = composed.expressions(&[0.7, -1.3]).unwrap_err().to_string();
    assert_eq!(none, "the function `sine` is not traced");
}

/// A block that is pushed, with one entry of its Jacobian multiplied.
struct Pushed {
    factor: f64,
}

impl VectorFunction for Pushed {
    fn n_outputs(&self) -> usize {
        2
    }
    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        values.copy_from_slice(&[arguments[1], arguments[2] - arguments[1].powi(3)]);
        Ok(())
    }
    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        jacobian.fill(0.0);
        jacobian[(0, 1)] = 1.0;
        jacobian[(1, 1)] = -3.0 * self.factor * arguments[1].powi(2);
        jacobian[(1, 2)] = 1.0;
        Ok(())
    }
    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        hessian[(1, 1)] -= 6.0 * self.factor * weights[1] * arguments[1];
        Ok(())
    }
}

/// L = u²/2 and no end cost.
fn effort(dynamics: Box<dyn VectorFunction>) -> Problem {
    let boxed = |traced: Result<ExprFunction, _>| -> Box<dyn VectorFunction> {
        Box::new(TracedFunction::try_new(&traced.unwrap()).unwrap())
    };
    let point = ExprFunction::trace(vec![Block::new("z", [4])], |b| vec![b[0][2] * b[0][2] * 0.5]);
    let ends = ExprFunction::trace(vec![Block::new("z", [6])], |b| vec![b[0][0] * 0.0]);
    let phase = Phase::with_derivatives(dynamics, 1, 0, ())
        .terms_with_derivatives(boxed(point), boxed(ends))
        .names(["x".to_owned(), "v".to_owned()], ["force".to_owned()])
        .initial_state([0.0, 0.0])
        .final_state([1.0, 0.0]);
    Problem::try_new(phase).unwrap()
}

fn solved(problem: &mut Problem, max_evaluations: Option<usize>) -> CollocationReport {
    let collocation = Collocation { max_evaluations, ..Collocation::default() };
    collocation.solve(problem, &[Mesh::try_uniform(10, 3).unwrap()], &mut |_| Flow::Continue).unwrap()
}

#[test]
fn a_wrong_derivative_behind_a_search_without_a_solution_is_named() {
    let mut right = effort(Box::new(Pushed { factor: 1.0 }));
    let report = solved(&mut right, None);
    assert_eq!(report.status, CollocationStatus::Converged);
    // it has derivatives of second order, and arcs need more
    let found = Polish::default().polish(&mut right, &report).unwrap();
    assert_eq!((found.cost, found.arcs.len()), (report.cost, 0));
    let Verdict::Refused { reason } = found.verdict else { panic!("{}", found.verdict) };
    assert!(reason.contains("a function that brings its derivatives has none"), "{reason}");
    let found = solved(&mut effort(Box::new(Pushed { factor: -2.0 })), None);
    assert!(matches!(found.status, CollocationStatus::NotSolved(_)), "{:?}", found.status);
    let wrong = found.wrong_derivative.unwrap();
    assert_eq!((wrong.function.as_str(), wrong.derivative.as_str()), ("dynamics", "jacobian"));
    assert_eq!(wrong.entry, "∂(rate of v)/∂(v)");
    assert!((wrong.found + 2.0 * wrong.expected).abs() < 1e-6 * wrong.expected.abs(), "{wrong}");
}

#[test]
fn derivatives_that_were_brought_are_compared_before_the_search() {
    let values = |points: &[f64], values: &mut [f64]| {
        for (z, value) in points.chunks_exact(4).zip(values.chunks_exact_mut(2)) {
            value.copy_from_slice(&[z[1], z[2]]);
        }
        Ok(())
    };
    let names = labels("block", &["rate of x", "rate of v"], &["x", "v", "force", "t"]);
    let external = ExternalFunction::new(names, values).with_jacobian(|points, jacobians| {
        for jacobian in jacobians.chunks_exact_mut(8).take(points.len() / 4) {
            jacobian.copy_from_slice(&[0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.1]);
        }
        Ok(())
    });
    let mut problem = effort(Box::new(external));
    let collocation = Collocation::default();
    let found =
        collocation.solve(&mut problem, &[Mesh::try_uniform(10, 3).unwrap()], &mut |_| Flow::Continue);
    let Err(SearchError::Collocation(CollocationError::WrongDerivative(wrong))) = found else {
        panic!("{found:?}")
    };
    assert_eq!((wrong.function.as_str(), wrong.entry.as_str()), ("block", "∂(rate of v)/∂(t)"));
}

#[test]
fn evaluations_are_counted_over_all_meshes() {
    let whole = solved(&mut effort(Box::new(Pushed { factor: 1.0 })), None);
    assert!(whole.history.len() > 1, "one mesh was enough");
    for most in [1, 2, 5, 8] {
        let found = solved(&mut effort(Box::new(Pushed { factor: 1.0 })), Some(most));
        assert_eq!(found.status, CollocationStatus::NotSolved(Status::EvaluationLimit), "{most}");
        assert!(found.phases[0].states.iter().flatten().all(|x| x.is_finite()));
    }
}
