//! Random programs with quadratic cost, linear constraints and a known feasible point.

use somersault_nlp::{
    Bounds, Curvature, EvaluationError, Flow, Globalisation, HessianSource, Nlp, NlpSolver, Pattern, Report,
    Sqp, Start, Status, Structure, samples,
};

/// ½ zᵀ H z + gᵀ z, A z within bounds; all matrices dense by columns.
pub(crate) struct Quadratic {
    structure: Structure,
    h: Vec<f64>,
    g: Vec<f64>,
    a: Vec<f64>,
}

impl Quadratic {
    /// Of `convex` rank: H = Bᵀ B with as many rows in B, minus `concave` on the diagonal.
    pub(crate) fn new(n: usize, m: usize, rank: usize, concave: f64, seed: u64) -> Self {
        let size = n * rank + n + n * m + n + m;
        let cube = Bounds { lower: vec![-1.0; size], upper: vec![1.0; size] };
        let numbers = samples(&cube, 1, seed).unwrap().remove(0).z;
        let (b, rest) = numbers.split_at(n * rank);
        let (g, rest) = rest.split_at(n);
        let (a, rest) = rest.split_at(n * m);
        let (feasible, kinds) = rest.split_at(n);
        let mut h = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                h[i + n * j] = (0..rank).map(|k| b[k + rank * i] * b[k + rank * j]).sum();
            }
            h[i + n * i] -= concave;
        }
        let mut constraints = Bounds::default();
        for k in 0..m {
            let value: f64 = (0..n).map(|i| a[k + m * i] * feasible[i]).sum();
            match kinds[k] {
                x if x < -0.7 && k < n / 2 => constraints.push(value, value),
                x if x < 0.0 => constraints.push(value - 0.1, f64::INFINITY),
                x => constraints.push(value - 1.0, value + x),
            }
        }
        let structure = Structure {
            variables: Bounds { lower: vec![-2.0; n], upper: vec![2.0; n] },
            constraints,
            jacobian: Pattern::dense(m, n),
            hessian: Pattern::upper_triangle(n),
        };
        Self { structure, h, g: g.to_vec(), a: a.to_vec() }
    }

    /// With three rows that contradict each other, wherever z is: they add up to zero and are to be ½ together.
    pub(crate) fn contradicted(mut self) -> Self {
        let constraints = &mut self.structure.constraints;
        let m = constraints.len();
        for column in self.a.chunks_mut(m) {
            column[m - 1] = -(column[0] + column[1]);
        }
        for (row, lower) in [(0, 0.0), (1, 0.0), (m - 1, 0.5)] {
            (constraints.lower[row], constraints.upper[row]) = (lower, f64::INFINITY);
        }
        self
    }

    fn slope(&self, z: &[f64], i: usize) -> f64 {
        let n = z.len();
        self.g[i] + (0..n).map(|j| self.h[i + n * j] * z[j]).sum::<f64>()
    }

    /// Largest error in the conditions of Karush, Kuhn and Tucker.
    pub(crate) fn error(&self, report: &Report) -> f64 {
        let (z, y) = (&report.z, &report.constraint_multipliers);
        let (n, m) = (z.len(), y.len());
        let mut worst = 0.0f64;
        for i in 0..n {
            let pulled: f64 = (0..m).map(|k| self.a[k + m * i] * y[k]).sum();
            worst = worst.max((self.slope(z, i) + pulled + report.bound_multipliers[i]).abs());
        }
        let values = (0..m).map(|k| (0..n).map(|i| self.a[k + m * i] * z[i]).sum::<f64>());
        let all = z.iter().copied().chain(values);
        let multipliers = report.bound_multipliers.iter().chain(y);
        let Structure { variables: v, constraints: c, .. } = &self.structure;
        let bounds = v.lower.iter().zip(&v.upper).chain(c.lower.iter().zip(&c.upper));
        for ((value, y), (&lower, &upper)) in all.zip(multipliers).zip(bounds) {
            worst = worst.max(lower - value).max(value - upper);
            let distance = if *y > 0.0 { upper - value } else { value - lower };
            worst = worst.max(if *y == 0.0 { 0.0 } else { (y * distance).abs() });
        }
        worst
    }
}

impl Nlp for Quadratic {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        let (n, m) = (z.len(), constraints.len());
        for (k, c) in constraints.iter_mut().enumerate() {
            *c = (0..n).map(|i| self.a[k + m * i] * z[i]).sum();
        }
        Ok((0..n).map(|i| 0.5 * (self.slope(z, i) + self.g[i]) * z[i]).sum())
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        for (i, slope) in gradient.iter_mut().enumerate() {
            *slope = self.slope(z, i);
        }
        jacobian.copy_from_slice(&self.a);
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        Curvature::Exact
    }

    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        _: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let n = z.len();
        for j in 0..n {
            for i in 0..=j {
                hessian[j * (j + 1) / 2 + i] = cost_factor * self.h[i + n * j];
            }
        }
        Ok(())
    }
}

fn solve_all(concave: f64, hessian: HessianSource) -> Vec<usize> {
    let solver = Sqp { hessian, ..Sqp::default() };
    (0..200u64)
        .map(|seed| {
            let (n, m) = (1 + seed as usize % 12, (seed as usize * 7) % 17);
            // Every third Hessian is singular.
            let rank = if seed % 3 == 0 { n / 2 } else { n };
            let mut program = Quadratic::new(n, m, rank, concave, seed);
            let start = Start::from(vec![1.0; n]);
            let report = solver.solve(&mut program, &start, &mut |_| Flow::Continue).unwrap();
            assert_eq!(report.status, Status::Converged, "seed {seed} n {n} m {m}: {report:?}");
            let error = program.error(&report);
            assert!(error < 1e-6, "seed {seed} n {n} m {m}: {error:e} {report:?}");
            report.iterations
        })
        .collect()
}

#[test]
fn contradicted_quadratic_programs_are_infeasible() {
    use Globalisation::{Filter, Merit};
    for (globalisation, crossover) in [(Merit, false), (Filter, false), (Merit, true), (Filter, true)] {
        let solver = Sqp { globalisation, crossover, ..Sqp::default() };
        for seed in 0..100u64 {
            let (n, m) = (1 + seed as usize % 12, 3 + (seed as usize * 7) % 14);
            let mut program = Quadratic::new(n, m, n, 0.0, seed).contradicted();
            let start = Start::from(vec![1.0; n]);
            let report = solver.solve(&mut program, &start, &mut |_| Flow::Continue).unwrap();
            assert_eq!(report.status, Status::Infeasible, "seed {seed} n {n} m {m}: {report:?}");
            // a third of ½ at least in one of the three rows
            assert!(report.residuals.feasibility > 0.16, "seed {seed} n {n} m {m}: {report:?}");
        }
    }
}

#[test]
fn convex_quadratic_programs_take_one_step_or_two() {
    let steps = solve_all(0.0, HessianSource::Offered);
    assert!(steps.iter().all(|s| *s <= 2), "{steps:?}");
}

#[test]
fn quadratic_programs_are_solved_without_their_hessian() {
    let steps = solve_all(0.0, HessianSource::QuasiNewton);
    assert!(steps.iter().all(|s| *s <= 100), "{steps:?}");
}

#[test]
fn nonconvex_quadratic_programs_end_at_stationary_points() {
    for hessian in [HessianSource::Offered, HessianSource::QuasiNewton] {
        let steps = solve_all(0.5, hessian);
        println!("{steps:?}");
    }
}
