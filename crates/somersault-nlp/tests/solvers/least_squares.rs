//! Hessians by Gauss and Newton, on sums of squares.

use crate::problems::{D, Functions, Problem};
use num_dual::DualNum;
use somersault_nlp::{
    Bounds, Curvature, EvaluationError, Flow, Nlp, NlpSolver, Pattern, Sqp, Start, Status, Structure,
};

/// Σ rᵢ(z)².
struct SumOfSquares {
    structure: Structure,
    residuals: Functions,
    curvature: Curvature,
}

impl SumOfSquares {
    fn new(n: usize, residuals: Functions, curvature: Curvature) -> Self {
        let structure = Structure {
            variables: Bounds::free(n),
            constraints: Bounds::default(),
            jacobian: Pattern::dense(0, n),
            hessian: Pattern::upper_triangle(n),
        };
        Self { structure, residuals, curvature }
    }

    fn dual(&self, z: &[f64], i: usize, j: usize) -> Vec<D> {
        let seed = |k: usize| D::new(z[k], f64::from(k == i), f64::from(k == j), 0.0);
        (self.residuals)(&(0..z.len()).map(seed).collect::<Vec<_>>())
    }
}

impl Nlp for SumOfSquares {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], _: &mut [f64]) -> Result<f64, EvaluationError> {
        Ok(self.dual(z, 0, 0).iter().map(|r| r.re * r.re).sum())
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        _: &mut [f64],
    ) -> Result<(), EvaluationError> {
        for (i, slope) in gradient.iter_mut().enumerate() {
            *slope = self.dual(z, i, i).iter().map(|r| 2.0 * r.re * r.eps1).sum();
        }
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        self.curvature
    }

    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        _: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let curved = if self.curvature == Curvature::Exact { 1.0 } else { 0.0 };
        let mut entry = 0;
        for j in 0..z.len() {
            for i in 0..=j {
                let terms = self.dual(z, i, j);
                let sum: f64 = terms.iter().map(|r| r.eps1 * r.eps2 + curved * r.re * r.eps1eps2).sum();
                hessian[entry] = 2.0 * cost_factor * sum;
                entry += 1;
            }
        }
        Ok(())
    }
}

/// Of J. Moré, B. Garbow & K. Hillstrom, ACM Trans. Math. Softw. 7 (1981): problems 2, 8, 15, 5, with the minima
/// printed there.
fn published() -> Vec<(Problem, Functions)> {
    let problem = |name, start: &[f64], optimum| Problem::new(name, start, &[], &[], optimum, |_| Vec::new());
    vec![
        (problem("Freudenstein & Roth", &[0.5, -2.0], 48.98425), |x| {
            vec![
                x[0] - 13.0 + ((-x[1] + 5.0) * x[1] - 2.0) * x[1],
                x[0] - 29.0 + ((x[1] + 1.0) * x[1] - 14.0) * x[1],
            ]
        }),
        (problem("Bard", &[1.0; 3], 8.21487e-3), |x| {
            let data =
                [0.14, 0.18, 0.22, 0.25, 0.29, 0.32, 0.35, 0.39, 0.37, 0.58, 0.73, 0.96, 1.34, 2.10, 4.39];
            let term = |(i, y): (usize, &f64)| {
                let (u, v) = ((i + 1) as f64, (15 - i) as f64);
                -x[0] - (x[1] * v + x[2] * u.min(v)).recip() * u + *y
            };
            data.iter().enumerate().map(term).collect()
        }),
        (problem("Kowalik & Osborne", &[0.25, 0.39, 0.415, 0.39], 3.07505e-4), |x| {
            let y = [0.1957, 0.1947, 0.1735, 0.1600, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246];
            let u = [4.0, 2.0, 1.0, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625];
            let term = |(y, u): (&f64, &f64)| -(x[0] * (x[1] * *u + u * u)) / (x[2] * *u + x[3] + u * u) + *y;
            y.iter().zip(&u).map(term).collect()
        }),
        (problem("Beale", &[1.0, 1.0], 0.0), |x| {
            let term = |(i, y): (i32, f64)| x[0] * (x[1].powi(i) - 1.0) + y;
            [(1, 1.5), (2, 2.25), (3, 2.625)].map(term).to_vec()
        }),
    ]
}

#[test]
fn gauss_newton_reaches_published_optima() {
    for (problem, residuals) in published() {
        let start = Start::from(problem.start.as_slice());
        for curvature in [Curvature::GaussNewton, Curvature::Exact] {
            let mut program = SumOfSquares::new(problem.start.len(), residuals, curvature);
            let report = Sqp::default().solve(&mut program, &start, &mut |_| Flow::Continue).unwrap();
            println!("{} {curvature:?} {} {:?}", problem.name, report.iterations, report);
            assert_eq!(report.status, Status::Converged, "{}", problem.name);
            let digits = 1e-5 * problem.optimum.max(1e-9);
            assert!((report.cost - problem.optimum).abs() < digits, "{}: {}", problem.name, report.cost);
        }
    }
}
