//! The cart-pendulum of appendix A of the thesis, as it reproduces Table A.1: quintic splines for the cart, Euler's
//! method with 200 steps, start imposed by two linear constraints.

use crate::problems::D;
use num_dual::DualNum;
use somersault_ocp::nlp::{Bounds, Curvature, EvaluationError, Nlp, Pattern, Structure};
use somersault_ocp::solver::{Flow, NlpSolver, Sqp, Start, Status};

const STEPS: usize = 200;
const H: f64 = 0.01;

/// Coefficients of the spline; and, if lifted, the terminal state's error as variables of its own, equal to it by four
/// constraints. The penalty of 10⁵ then bends no valley into the cost.
pub(crate) struct CartPendulum {
    structure: Structure,
    /// Of each time and parameter: spline, its rate and its acceleration.
    basis: Vec<Vec<[f64; 3]>>,
    curvature: Curvature,
    lifted: bool,
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
    pub(crate) fn new(n: usize, curvature: Curvature, lifted: bool) -> Self {
        let rate = (n - 5) as f64 / (STEPS as f64 * H);
        let at = |k: usize, j: usize| {
            let [b, db, ddb] = spline(rate * k as f64 * H + 3.0, (j + 1) as f64);
            [b, rate * db, rate * rate * ddb]
        };
        let basis: Vec<Vec<[f64; 3]>> = (0..=STEPS).map(|k| (0..n).map(|j| at(k, j)).collect()).collect();
        let (width, mut bounds) = (if lifted { n + 4 } else { n }, vec![-1.0, 0.0]);
        if lifted {
            bounds.extend([0.0; 4]);
        }
        let structure = Structure {
            variables: Bounds::free(width),
            jacobian: Pattern::dense(bounds.len(), width),
            hessian: Pattern::upper_triangle(width),
            constraints: Bounds { lower: bounds.clone(), upper: bounds },
        };
        Self { structure, basis, curvature, lifted }
    }

    /// A straight line for the cart.
    pub(crate) fn start(&self) -> Start {
        let n = self.basis[0].len();
        let mut z: Vec<f64> = (0..n).map(|k| -1.0 + k as f64 / (n - 1) as f64).collect();
        z.resize(self.structure.variables.len(), 0.0);
        Start::from(z)
    }

    /// Cost, the sum of products of first derivatives of its residuals, and the terminal state.
    fn roll(&self, z: &[f64], i: usize, j: usize) -> (D, f64, [D; 4]) {
        let (gravity, m_cart, m) = (9.81, 2.0, 1.0);
        let n = self.basis[0].len();
        let mut q = D::from(std::f64::consts::PI);
        let mut w = D::from(0.0);
        let (mut cost, mut products) = (D::from(0.0), 0.0);
        let cart = |k: usize, order: usize| {
            let row = &self.basis[k];
            let value = row.iter().zip(z).map(|(b, z)| b[order] * z).sum();
            let slope = |i: usize| row.get(i).map_or(0.0, |b| b[order]);
            D::new(value, slope(i), slope(j), 0.0)
        };
        let mut add = |r: D, weight: f64| {
            cost += r * r * (0.5 * weight);
            products += weight * r.eps1 * r.eps2;
        };
        for k in 0..STEPS {
            let (s, c) = (q.sin(), q.cos());
            let a = cart(k, 2);
            let alpha = a * c + s * gravity;
            add(a * (m_cart + m) - alpha * c * m + w * w * s * m, H);
            q += w * H;
            w += alpha * H;
        }
        let terminal = [q, w, cart(STEPS, 0), cart(STEPS, 1)];
        for l in 0..4 {
            let own = |i: usize| f64::from(i == n + l);
            let error = if self.lifted { D::new(z[n + l], own(i), own(j), 0.0) } else { terminal[l] };
            add(error, PENALTY);
        }
        (cost, products, terminal)
    }
}

const NONE: usize = usize::MAX;

impl Nlp for CartPendulum {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        let n = self.basis[0].len();
        let (cost, _, terminal) = self.roll(z, NONE, NONE);
        for (l, c) in constraints.iter_mut().enumerate() {
            *c = match l {
                0 | 1 => self.basis[0].iter().zip(z).map(|(b, z)| b[l] * z).sum(),
                _ => terminal[l - 2].re - z[n + l - 2],
            };
        }
        Ok(cost.re)
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let (n, m) = (self.basis[0].len(), self.structure.constraints.len());
        for (i, slope) in gradient.iter_mut().enumerate() {
            let (cost, _, terminal) = self.roll(z, i, NONE);
            *slope = cost.eps1;
            let column = &mut jacobian[i * m..(i + 1) * m];
            for (l, entry) in column.iter_mut().enumerate() {
                *entry = match l {
                    0 | 1 => self.basis[0].get(i).map_or(0.0, |b| b[l]),
                    _ => terminal[l - 2].eps1 - f64::from(i == n + l - 2),
                };
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
                let (cost, products, terminal) = self.roll(z, i, j);
                hessian[entry] = products;
                if self.curvature == Curvature::Exact {
                    hessian[entry] = cost.eps1eps2;
                    for (y, state) in multipliers[2..].iter().zip(&terminal) {
                        hessian[entry] += y * state.eps1eps2;
                    }
                }
                entry += 1;
            }
        }
        Ok(())
    }
}

#[test]
fn cases_of_table_a_1_are_reached_from_a_straight_line() {
    // Cases A, B and D as printed.
    for (n_free, printed) in [(5, 478.39), (10, 392.94), (20, 358.14)] {
        for curvature in [Curvature::Exact, Curvature::GaussNewton] {
            for lifted in [true, false] {
                let mut program = CartPendulum::new(n_free + 2, curvature, lifted);
                let start = program.start();
                let report = Sqp::default().solve(&mut program, &start, &mut |_| Flow::Continue).unwrap();
                println!(
                    "{n_free} {curvature:?} lifted {lifted} {:?} {} {:.4} {:?}",
                    report.status, report.iterations, report.cost, report.counts
                );
                assert_eq!(report.status, Status::Converged);
                assert!((report.cost - printed).abs() < 0.005, "{n_free}: {}", report.cost);
            }
        }
    }
}
