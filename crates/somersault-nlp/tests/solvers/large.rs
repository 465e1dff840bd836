//! Programs of the sizes that optimal motions have.

use crate::problems::D;
use num_dual::DualNum;
use somersault_nlp::{
    Bounds, Curvature, EvaluationError, Flow, Globalisation, HessianSource, Nlp, NlpSolver, Pattern, Sqp,
    Start, Status, Structure,
};
use std::time::Instant;

/// Swing-up of a pendulum on a cart by trapezoidal collocation: the problem of M. Kelly, SIAM Review 59 (2017),
/// section 6, with (position, angle, their rates, force) at each node.
struct SwingUp {
    structure: Structure,
    n_nodes: usize,
    h: f64,
    curvature: Curvature,
}

const WIDTH: usize = 5;

fn rates(x: &[D; WIDTH]) -> [D; 4] {
    let (m1, m2, l, g) = (1.0, 0.3, 0.5, 9.81);
    let [_, q, v, w, u] = *x;
    let (s, c) = (q.sin(), q.cos());
    let mass = s * s * m2 + m1;
    let cart = (s * w * w * (l * m2) + u + c * s * (m2 * g)) / mass;
    let pole = -(c * s * w * w * (l * m2) + u * c + s * ((m1 + m2) * g)) / (mass * l);
    [v, w, cart, pole]
}

impl SwingUp {
    fn new(n_nodes: usize, curvature: Curvature) -> Self {
        let mut variables = Bounds::default();
        for k in 0..n_nodes {
            let goal = [1.0, std::f64::consts::PI, 0.0, 0.0];
            for i in 0..4 {
                match k {
                    0 => variables.push(0.0, 0.0),
                    _ if k + 1 == n_nodes => variables.push(goal[i], goal[i]),
                    _ => variables.push(-[2.0, 10.0, 50.0, 50.0][i], [2.0, 10.0, 50.0, 50.0][i]),
                }
            }
            variables.push(-20.0, 20.0);
        }
        let mut constraints = Bounds::default();
        (0..4 * (n_nodes - 1)).for_each(|_| constraints.push(0.0, 0.0));
        let n = WIDTH * n_nodes;
        let defects = (0..n_nodes - 1)
            .flat_map(|k| (0..4).flat_map(move |i| (0..2 * WIDTH).map(move |j| (4 * k + i, WIDTH * k + j))));
        let blocks = (0..n_nodes)
            .flat_map(|k| (0..WIDTH).flat_map(move |j| (0..=j).map(move |i| (WIDTH * k + i, WIDTH * k + j))));
        let structure = Structure {
            jacobian: Pattern::from_entries(constraints.len(), n, defects),
            hessian: Pattern::from_entries(n, n, blocks),
            variables,
            constraints,
        };
        Self { structure, n_nodes, h: 2.0 / (n_nodes - 1) as f64, curvature }
    }

    fn start(&self) -> Vec<f64> {
        let mut z = vec![0.0; WIDTH * self.n_nodes];
        for k in 0..self.n_nodes {
            let s = k as f64 / (self.n_nodes - 1) as f64;
            z[WIDTH * k] = s;
            z[WIDTH * k + 1] = std::f64::consts::PI * s;
        }
        z
    }

    fn node(z: &[f64], k: usize, i: usize, j: usize) -> [D; WIDTH] {
        std::array::from_fn(|l| D::new(z[WIDTH * k + l], f64::from(l == i), f64::from(l == j), 0.0))
    }

    fn weight(&self, k: usize) -> f64 {
        if k == 0 || k + 1 == self.n_nodes { 0.5 * self.h } else { self.h }
    }
}

impl Nlp for SwingUp {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        let mut cost = 0.0;
        let mut before = rates(&Self::node(z, 0, 9, 9));
        for k in 0..self.n_nodes {
            cost += self.weight(k) * z[WIDTH * k + 4].powi(2);
            let here = rates(&Self::node(z, k, 9, 9));
            if k > 0 {
                for i in 0..4 {
                    constraints[4 * (k - 1) + i] = z[WIDTH * k + i]
                        - z[WIDTH * (k - 1) + i]
                        - 0.5 * self.h * (before[i].re + here[i].re);
                }
            }
            before = here;
        }
        Ok(cost)
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        gradient.fill(0.0);
        let pattern = &self.structure.jacobian;
        for k in 0..self.n_nodes {
            gradient[WIDTH * k + 4] = 2.0 * self.weight(k) * z[WIDTH * k + 4];
            for j in 0..WIDTH {
                let column = WIDTH * k + j;
                let slopes = rates(&Self::node(z, k, j, 9));
                for entry in pattern.columns[column]..pattern.columns[column + 1] {
                    let (interval, i) = (pattern.rows[entry] / 4, pattern.rows[entry] % 4);
                    let sign = if interval == k { -1.0 } else { 1.0 };
                    let own = if i == j { sign } else { 0.0 };
                    jacobian[entry] = own - 0.5 * self.h * slopes[i].eps1;
                }
            }
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
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let mut entry = 0;
        for k in 0..self.n_nodes {
            for j in 0..WIDTH {
                for i in 0..=j {
                    let curved = rates(&Self::node(z, k, i, j));
                    let mut value = 0.0;
                    for l in 0..4 {
                        let mut y = 0.0;
                        if k > 0 {
                            y += multipliers[4 * (k - 1) + l];
                        }
                        if k + 1 < self.n_nodes {
                            y += multipliers[4 * k + l];
                        }
                        value -= 0.5 * self.h * y * curved[l].eps1eps2;
                    }
                    if i == 4 {
                        value += 2.0 * cost_factor * self.weight(k);
                    }
                    hessian[entry] = value;
                    entry += 1;
                }
            }
        }
        Ok(())
    }
}

#[test]
fn sparse_collocation_of_2000_variables_takes_few_steps_and_converges_quadratically() {
    let mut program = SwingUp::new(401, Curvature::Exact);
    let start = Start::from(program.start());
    let mut steps = Vec::new();
    let report = Sqp::default()
        .solve(&mut program, &start, &mut |iteration| {
            steps.push((iteration.residuals.max(), iteration.shift));
            Flow::Continue
        })
        .unwrap();
    println!("{steps:?} {:?} {}", report.counts, report.cost);
    assert_eq!(report.status, Status::Converged);
    assert!(report.iterations <= 20, "{}", report.iterations);
    let [(first, _), (second, _), (third, shift)] = steps[steps.len() - 3..] else { unreachable!() };
    let order = (third / second).ln() / (second / first).ln();
    assert!(order > 1.8 && shift == 0.0, "{steps:?}");
}

#[test]
fn block_quasi_newton_reaches_the_optimum_of_exact_hessians() {
    let start = Start::from(SwingUp::new(51, Curvature::None).start());
    let mut costs = Vec::new();
    for curvature in [Curvature::Exact, Curvature::None] {
        let began = Instant::now();
        let report =
            Sqp::default().solve(&mut SwingUp::new(51, curvature), &start, &mut |_| Flow::Continue).unwrap();
        println!(
            "{curvature:?} {:?} {:?} {} {:?} {:?}",
            report.status,
            report.counts,
            report.cost,
            began.elapsed(),
            report.residuals
        );
        assert_eq!(report.status, Status::Converged);
        costs.push(report.cost);
    }
    assert!((costs[0] - costs[1]).abs() < 1e-6 * costs[0], "{costs:?}");
}

/// A chain of Rosenbrock's valleys with 52 variables, and 200 planes and spheres that cut it.
struct Valley {
    structure: Structure,
}

impl Valley {
    fn new(n: usize, m: usize) -> Self {
        let mut constraints = Bounds::default();
        (0..m).for_each(|_| constraints.push(f64::NEG_INFINITY, 0.0));
        Self {
            structure: Structure {
                variables: Bounds { lower: vec![-3.0; n], upper: vec![3.0; n] },
                constraints,
                jacobian: Pattern::dense(m, n),
                hessian: Pattern::upper_triangle(n),
            },
        }
    }

    fn coefficient(k: usize, i: usize) -> f64 {
        ((k * 37 + i * 101 + 1) as f64).sin()
    }
}

impl Nlp for Valley {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        for (k, c) in constraints.iter_mut().enumerate() {
            *c = -0.5;
            for (i, z) in z.iter().enumerate() {
                let a = Self::coefficient(k, i);
                *c += a * z + if k % 2 == 0 { 0.05 * a * a * z * z } else { 0.0 };
            }
        }
        Ok(z.windows(2).map(|z| 100.0 * (z[1] - z[0] * z[0]).powi(2) + (1.0 - z[0]).powi(2)).sum())
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        gradient.fill(0.0);
        for i in 0..z.len() - 1 {
            let valley = z[i + 1] - z[i] * z[i];
            gradient[i + 1] += 200.0 * valley;
            gradient[i] -= 400.0 * valley * z[i] + 2.0 * (1.0 - z[i]);
        }
        let m = self.structure.constraints.len();
        for (i, z) in z.iter().enumerate() {
            for k in 0..m {
                let a = Self::coefficient(k, i);
                jacobian[i * m + k] = a + if k % 2 == 0 { 0.1 * a * a * z } else { 0.0 };
            }
        }
        Ok(())
    }

    fn curvature(&self) -> Curvature {
        Curvature::Exact
    }

    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        hessian.fill(0.0);
        let at = |i: usize, j: usize| j * (j + 1) / 2 + i;
        for i in 0..z.len() - 1 {
            hessian[at(i + 1, i + 1)] += 200.0 * cost_factor;
            hessian[at(i, i)] += cost_factor * (1200.0 * z[i] * z[i] - 400.0 * z[i + 1] + 2.0);
            hessian[at(i, i + 1)] -= 400.0 * cost_factor * z[i];
        }
        for (k, y) in multipliers.iter().enumerate().step_by(2) {
            for i in 0..z.len() {
                hessian[at(i, i)] += 0.1 * y * Self::coefficient(k, i).powi(2);
            }
        }
        Ok(())
    }
}

#[test]
fn valleys_with_many_inequalities_are_solved() {
    for (n, m) in [(52, 0), (92, 200)] {
        for hessian in [HessianSource::Offered, HessianSource::QuasiNewton] {
            let mut program = Valley::new(n, m);
            let start = Start::from(vec![-0.1; n]);
            let began = Instant::now();
            let report = Sqp { hessian, ..Sqp::default() }
                .solve(&mut program, &start, &mut |_| Flow::Continue)
                .unwrap();
            println!(
                "{n} {m} {hessian:?} {:?} {} {:?} {} {:?} {:?}",
                report.status,
                report.iterations,
                report.counts,
                report.cost,
                report.residuals,
                began.elapsed()
            );
            assert_eq!(report.status, Status::Converged);
        }
    }
}

/// From the interior-point method's solution the working set is that of the program: no quadratic program has to tell it.
#[test]
fn crossover_takes_the_place_of_quadratic_programs() {
    let solve = |crossover, last: usize| {
        let mut numbers = Vec::new();
        let solver = Sqp { globalisation: Globalisation::Filter, crossover, ..Sqp::default() };
        let start = Start::from(vec![-0.1; 92]);
        let report = solver
            .solve(&mut Valley::new(92, 200), &start, &mut |iteration| {
                numbers.push(iteration.number);
                if iteration.number == last { Flow::Stop } else { Flow::Continue }
            })
            .unwrap();
        (report, numbers)
    };
    let (plain, _) = solve(false, usize::MAX);
    let (crossed, numbers) = solve(true, usize::MAX);
    assert_eq!((plain.status, crossed.status), (Status::Converged, Status::Converged));
    assert!((plain.cost - crossed.cost).abs() < 1e-8 * plain.cost, "{} {}", plain.cost, crossed.cost);
    let programs = [plain, crossed.clone()].map(|report| report.counts.quadratic_programs);
    assert!(programs[0] > 0 && programs[1] == 0, "{programs:?}");
    // steps of both methods are counted as those of one, and a callback stops each
    assert!(numbers.is_sorted() && numbers.last() == Some(&crossed.iterations), "{numbers:?}");
    for last in 0..crossed.iterations {
        let (stopped, _) = solve(true, last);
        assert_eq!((stopped.status, stopped.iterations), (Status::Stopped, last));
        assert!(stopped.cost.is_finite());
    }
}
