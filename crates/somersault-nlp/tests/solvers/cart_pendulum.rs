//! The cart-pendulum of appendix A of the thesis, as it reproduces Table A.1: quintic splines for the cart, Euler's
//! method with 200 steps, start imposed by two linear constraints.

use crate::problems::D;
use num_dual::DualNum;
use somersault_nlp::{
    Bounds, Curvature, EvaluationError, Flow, Nlp, NlpSolver, Pattern, Report, Sqp, Start, Status, Structure,
};

const STEPS: usize = 200;
const H: f64 = 0.01;

/// Coefficients of the spline; and, if lifted, the terminal state's error and angle and rate at nodes between as
/// variables of their own, equal to what they are by constraints. The penalty of 10⁵ then bends no valley into the
/// cost.
pub(crate) struct CartPendulum {
    structure: Structure,
    /// Of each time and parameter: spline, its rate and its acceleration.
    basis: Vec<Vec<[f64; 3]>>,
    curvature: Curvature,
    /// Nodes between, if lifted.
    nodes: Option<usize>,
}

/// (2.14) and two derivatives.
fn spline(s: f64, j: f64) -> [f64; 3] {
    let weights = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0];
    let mut b = [0.0; 3];
    for (k, w) in weights.into_iter().enumerate() {
        let x = (s - (j - 3.0 + k as f64)).max(0.0);
        b[0] += w * x.powi(5) / 120.0;
        b[1] += w * x.powi(4) / 24.0;
        b[2] += w * x.powi(3) / 6.0;
    }
    b
}

const PENALTY: f64 = 1e5;

impl CartPendulum {
    pub(crate) fn new(n: usize, curvature: Curvature, nodes: Option<usize>) -> Self {
        let rate = (n - 5) as f64 / (STEPS as f64 * H);
        let at = |k: usize, j: usize| {
            let [b, db, ddb] = spline(rate * k as f64 * H + 3.0, (j + 1) as f64);
            [b, rate * db, rate * rate * ddb]
        };
        let basis: Vec<Vec<[f64; 3]>> = (0..=STEPS).map(|k| (0..n).map(|j| at(k, j)).collect()).collect();
        let lifted = nodes.map_or(0, |nodes| 4 + 2 * nodes);
        let width = n + lifted;
        let mut bounds = vec![-1.0, 0.0];
        bounds.resize(2 + lifted, 0.0);
        let structure = Structure {
            variables: Bounds::free(width),
            jacobian: Pattern::dense(bounds.len(), width),
            hessian: Pattern::upper_triangle(width),
            constraints: Bounds { lower: bounds.clone(), upper: bounds },
        };
        Self { structure, basis, curvature, nodes }
    }

    /// A straight line for the cart, and for the angle at nodes.
    pub(crate) fn start(&self) -> Start {
        let n = self.basis[0].len();
        let mut z: Vec<f64> = (0..n).map(|k| -1.0 + k as f64 / (n - 1) as f64).collect();
        z.resize(self.structure.variables.len(), 0.0);
        let nodes = self.nodes.unwrap_or(0);
        for k in 0..nodes {
            z[n + 4 + 2 * k] = std::f64::consts::PI * (1.0 - (k + 1) as f64 / (nodes + 1) as f64);
        }
        Start::from(z)
    }

    /// Cost, the sum of products of first derivatives of its residuals, and the constraints.
    fn roll(&self, z: &[f64], i: usize, j: usize) -> (D, f64, Vec<D>) {
        let (gravity, m_cart, m) = (9.81, 2.0, 1.0);
        let n = self.basis[0].len();
        let variable = |k: usize| D::new(z[k], f64::from(i == k), f64::from(j == k), 0.0);
        let cart = |k: usize, order: usize| {
            let row = &self.basis[k];
            let value = row.iter().zip(z).map(|(b, z)| b[order] * z).sum();
            let slope = |i: usize| row.get(i).map_or(0.0, |b| b[order]);
            D::new(value, slope(i), slope(j), 0.0)
        };
        let (mut cost, mut products) = (D::from(0.0), 0.0);
        let mut add = |r: D, weight: f64| {
            cost += r * r * (0.5 * weight);
            products += weight * r.eps1 * r.eps2;
        };
        let mut constraints = vec![cart(0, 0), cart(0, 1)];
        let mut gaps = Vec::new();
        let length = STEPS / (self.nodes.unwrap_or(0) + 1);
        let mut state = [D::from(std::f64::consts::PI), D::from(0.0)];
        for k in 0..STEPS {
            if k > 0 && k % length == 0 {
                let node = n + 2 + 2 * (k / length);
                let next = [variable(node), variable(node + 1)];
                gaps.extend([state[0] - next[0], state[1] - next[1]]);
                state = next;
            }
            let [q, w] = state;
            let (s, c) = (q.sin(), q.cos());
            let a = cart(k, 2);
            let alpha = a * c + s * gravity;
            add(a * (m_cart + m) - alpha * c * m + w * w * s * m, H);
            state = [q + w * H, w + alpha * H];
        }
        let terminal = [state[0], state[1], cart(STEPS, 0), cart(STEPS, 1)];
        for (l, error) in terminal.into_iter().enumerate() {
            if self.nodes.is_some() {
                add(variable(n + l), PENALTY);
                constraints.push(error - variable(n + l));
            } else {
                add(error, PENALTY);
            }
        }
        constraints.extend(gaps);
        (cost, products, constraints)
    }
}

const NONE: usize = usize::MAX;

impl Nlp for CartPendulum {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        let (cost, _, values) = self.roll(z, NONE, NONE);
        for (c, value) in constraints.iter_mut().zip(values) {
            *c = value.re;
        }
        Ok(cost.re)
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let m = self.structure.constraints.len();
        for (i, slope) in gradient.iter_mut().enumerate() {
            let (cost, _, values) = self.roll(z, i, NONE);
            *slope = cost.eps1;
            for (entry, value) in jacobian[i * m..].iter_mut().zip(values) {
                *entry = value.eps1;
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
        _: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let mut entry = 0;
        for j in 0..z.len() {
            for i in 0..=j {
                let (cost, products, constraints) = self.roll(z, i, j);
                hessian[entry] = products;
                if self.curvature == Curvature::Exact {
                    let curved: f64 = multipliers.iter().zip(&constraints).map(|(y, c)| y * c.eps1eps2).sum();
                    hessian[entry] = cost.eps1eps2 + curved;
                }
                entry += 1;
            }
        }
        Ok(())
    }
}

fn solve(n_free: usize, curvature: Curvature, nodes: Option<usize>) -> Report {
    let mut program = CartPendulum::new(n_free + 2, curvature, nodes);
    let start = program.start();
    let report = Sqp::default().solve(&mut program, &start, &mut |_| Flow::Continue).unwrap();
    println!(
        "{n_free} {curvature:?} nodes {nodes:?} {:?} {} {:.4} {:?}",
        report.status, report.iterations, report.cost, report.counts
    );
    assert_eq!(report.status, Status::Converged);
    report
}

/// Free parameters and cost of cases A, B, D, E and G as printed. C and F are no optima.
const PRINTED: [(usize, f64); 5] = [(5, 478.39), (10, 392.94), (20, 358.14), (30, 355.00), (50, 345.02)];

#[test]
fn lifted_cases_of_table_a_1_take_few_steps_from_a_straight_line() {
    for (n_free, printed) in PRINTED {
        let report = solve(n_free, Curvature::Exact, Some(3));
        assert!((report.cost - printed).abs() < 0.005, "{n_free}: {}", report.cost);
        assert!(report.iterations <= 15, "{n_free}: {}", report.iterations);
    }
}

#[test]
fn lifting_changes_the_steps_and_not_the_minimum() {
    for curvature in [Curvature::Exact, Curvature::GaussNewton] {
        let (n_free, printed) = PRINTED[0];
        let steps = [None, Some(0), Some(3)].map(|nodes| {
            let report = solve(n_free, curvature, nodes);
            assert!((report.cost - printed).abs() < 0.005, "{}", report.cost);
            report.iterations
        });
        assert!(steps[0] > steps[1] && steps[1] > steps[2], "{steps:?}");
    }
}
