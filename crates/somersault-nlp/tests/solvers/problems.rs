//! Problems with published optima, and a program that differentiates them with dual numbers.
//!
//! "HS n" is problem n of W. Hock & K. Schittkowski, Test Examples for Nonlinear Programming Codes (1981), with
//! start and optimal value as printed there, or in closed form where there is one.

use num_dual::{DualNum, HyperDual64};
use somersault_nlp::{Bounds, Curvature, EvaluationError, Nlp, Pattern, Structure};
use std::f64::consts::{PI, SQRT_2};

pub(crate) type D = HyperDual64;

/// Cost first, then the constraints.
pub(crate) type Functions = fn(&[D]) -> Vec<D>;

#[derive(Clone)]
pub(crate) struct Problem {
    pub(crate) name: &'static str,
    pub(crate) start: Vec<f64>,
    pub(crate) variables: Vec<(f64, f64)>,
    pub(crate) constraints: Vec<(f64, f64)>,
    pub(crate) optimum: f64,
    pub(crate) functions: Functions,
}

pub(crate) const INF: f64 = f64::INFINITY;
/// c ≥ 0.
pub(crate) const POSITIVE: (f64, f64) = (0.0, INF);
/// c = 0.
pub(crate) const ZERO: (f64, f64) = (0.0, 0.0);
pub(crate) const FREE: (f64, f64) = (-INF, INF);

impl Problem {
    pub(crate) fn new(
        name: &'static str,
        start: &[f64],
        variables: &[(f64, f64)],
        constraints: &[(f64, f64)],
        optimum: f64,
        functions: Functions,
    ) -> Self {
        let variables = if variables.is_empty() { vec![FREE; start.len()] } else { variables.to_vec() };
        Self { name, start: start.to_vec(), variables, constraints: constraints.to_vec(), optimum, functions }
    }

    pub(crate) fn program(&self) -> Differentiated {
        let n = self.start.len();
        let bounds = |pairs: &[(f64, f64)]| Bounds {
            lower: pairs.iter().map(|b| b.0).collect(),
            upper: pairs.iter().map(|b| b.1).collect(),
        };
        Differentiated {
            structure: Structure {
                variables: bounds(&self.variables),
                constraints: bounds(&self.constraints),
                jacobian: Pattern::dense(self.constraints.len(), n),
                hessian: Pattern::upper_triangle(n),
            },
            functions: self.functions,
        }
    }
}

/// A program with dense derivatives by hyper-dual numbers.
pub(crate) struct Differentiated {
    pub(crate) structure: Structure,
    functions: Functions,
}

impl Differentiated {
    fn dual(&self, z: &[f64], i: usize, j: usize) -> Vec<D> {
        let seed = |k: usize| D::new(z[k], f64::from(k == i), f64::from(k == j), 0.0);
        let x: Vec<D> = (0..z.len()).map(seed).collect();
        (self.functions)(&x)
    }
}

impl Nlp for Differentiated {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError> {
        let values = self.dual(z, 0, 0);
        for (c, value) in constraints.iter_mut().zip(&values[1..]) {
            *c = value.re;
        }
        Ok(values[0].re)
    }

    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let m = self.structure.constraints.len();
        for i in 0..z.len() {
            let values = self.dual(z, i, i);
            gradient[i] = values[0].eps1;
            for (entry, value) in jacobian[i * m..].iter_mut().zip(&values[1..]) {
                *entry = value.eps1;
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
        let mut k = 0;
        for j in 0..z.len() {
            for i in 0..=j {
                let values = self.dual(z, i, j);
                let curved: f64 = values[1..].iter().zip(multipliers).map(|(c, y)| y * c.eps1eps2).sum();
                hessian[k] = cost_factor * values[0].eps1eps2 + curved;
                k += 1;
            }
        }
        Ok(())
    }
}

fn banana(x: &[D]) -> D {
    (x[1] - x[0] * x[0]).powi(2) * 100.0 + (x[0] - 1.0).powi(2)
}

fn squares(x: &[D]) -> D {
    x.iter().fold(D::from(0.0), |s, x| s + x * x)
}

fn product(x: &[D]) -> D {
    x.iter().fold(D::from(1.0), |s, x| s * x)
}

/// All of them, each with one known optimum that its start leads to.
pub(crate) fn published() -> Vec<Problem> {
    let p = Problem::new;
    vec![
        p("HS 1", &[-2.0, 1.0], &[FREE, (-1.5, INF)], &[], 0.0, |x| vec![banana(x)]),
        p("HS 3", &[10.0, 1.0], &[FREE, POSITIVE], &[], 0.0, |x| vec![x[1] + (x[1] - x[0]).powi(2) * 1e-5]),
        p("HS 4", &[1.125, 0.125], &[(1.0, INF), POSITIVE], &[], 8.0 / 3.0, |x| {
            vec![(x[0] + 1.0).powi(3) / 3.0 + x[1]]
        }),
        p("HS 5", &[0.0, 0.0], &[(-1.5, 4.0), (-3.0, 3.0)], &[], -0.75f64.sqrt() - PI / 3.0, |x| {
            vec![(x[0] + x[1]).sin() + (x[0] - x[1]).powi(2) - x[0] * 1.5 + x[1] * 2.5 + 1.0]
        }),
        p("HS 6", &[-1.2, 1.0], &[], &[ZERO], 0.0, |x| {
            vec![(x[0] - 1.0).powi(2), (x[1] - x[0] * x[0]) * 10.0]
        }),
        p("HS 7", &[2.0, 2.0], &[], &[ZERO], -3f64.sqrt(), |x| {
            let a = x[0] * x[0] + 1.0;
            vec![a.ln() - x[1], a * a + x[1] * x[1] - 4.0]
        }),
        p("HS 8", &[2.0, 1.0], &[], &[ZERO, ZERO], -1.0, |x| {
            vec![D::from(-1.0), squares(x) - 25.0, x[0] * x[1] - 9.0]
        }),
        p("HS 9", &[0.0, 0.0], &[], &[ZERO], -0.5, |x| {
            vec![(x[0] * PI / 12.0).sin() * (x[1] * PI / 16.0).cos(), x[0] * 4.0 - x[1] * 3.0]
        }),
        p("HS 10", &[-10.0, 10.0], &[], &[POSITIVE], -1.0, |x| {
            vec![x[0] - x[1], x[0] * x[0] * -3.0 + x[0] * x[1] * 2.0 - x[1] * x[1] + 1.0]
        }),
        p("HS 11", &[4.9, 0.1], &[], &[POSITIVE], -8.498464223, |x| {
            vec![(x[0] - 5.0).powi(2) + x[1] * x[1] - 25.0, x[1] - x[0] * x[0]]
        }),
        p("HS 12", &[0.0, 0.0], &[], &[POSITIVE], -30.0, |x| {
            vec![
                x[0] * x[0] * 0.5 + x[1] * x[1] - x[0] * x[1] - x[0] * 7.0 - x[1] * 7.0,
                x[0] * x[0] * -4.0 - x[1] * x[1] + 25.0,
            ]
        }),
        p("HS 14", &[2.0, 2.0], &[], &[POSITIVE, ZERO], 9.0 - 2.875 * 7f64.sqrt(), |x| {
            vec![
                (x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2),
                x[0] * x[0] * -0.25 - x[1] * x[1] + 1.0,
                x[0] - x[1] * 2.0 + 1.0,
            ]
        }),
        p("HS 15", &[-2.0, 1.0], &[(-INF, 0.5), FREE], &[POSITIVE; 2], 306.5, |x| {
            vec![banana(x), x[0] * x[1] - 1.0, x[0] + x[1] * x[1]]
        }),
        p("HS 18", &[2.0, 2.0], &[(2.0, 50.0), (0.0, 50.0)], &[POSITIVE; 2], 5.0, |x| {
            vec![x[0] * x[0] * 0.01 + x[1] * x[1], x[0] * x[1] - 25.0, squares(x) - 25.0]
        }),
        p("HS 19", &[20.1, 5.84], &[(13.0, 100.0), (0.0, 100.0)], &[POSITIVE; 2], -6961.81381, |x| {
            let (a, b) = ((x[1] - 5.0).powi(2), x[0] - 5.0);
            vec![
                (x[0] - 10.0).powi(3) + (x[1] - 20.0).powi(3),
                b * b + a - 100.0,
                -a - (x[0] - 6.0).powi(2) + 82.81,
            ]
        }),
        p("HS 21", &[-1.0, -1.0], &[(2.0, 50.0), (-50.0, 50.0)], &[POSITIVE], -99.96, |x| {
            vec![x[0] * x[0] * 0.01 + x[1] * x[1] - 100.0, x[0] * 10.0 - x[1] - 10.0]
        }),
        p("HS 22", &[2.0, 2.0], &[], &[POSITIVE; 2], 1.0, |x| {
            vec![(x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2), -x[0] - x[1] + 2.0, x[1] - x[0] * x[0]]
        }),
        p("HS 23", &[3.0, 1.0], &[(-50.0, 50.0); 2], &[POSITIVE; 5], 2.0, |x| {
            let (a, b) = (x[0] * x[0], x[1] * x[1]);
            vec![a + b, x[0] + x[1] - 1.0, a + b - 1.0, a * 9.0 + b - 9.0, a - x[1], b - x[0]]
        }),
        p("HS 24", &[1.0, 0.5], &[POSITIVE; 2], &[POSITIVE; 3], -1.0, |x| {
            let root = 3f64.sqrt();
            vec![
                ((x[0] - 3.0).powi(2) - 9.0) * x[1].powi(3) / (27.0 * root),
                x[0] / root - x[1],
                x[0] + x[1] * root,
                -x[0] - x[1] * root + 6.0,
            ]
        }),
        p("HS 26", &[-2.6, 2.0, 2.0], &[], &[ZERO], 0.0, |x| {
            vec![
                (x[0] - x[1]).powi(2) + (x[1] - x[2]).powi(4),
                (x[1] * x[1] + 1.0) * x[0] + x[2].powi(4) - 3.0,
            ]
        }),
        p("HS 27", &[2.0, 2.0, 2.0], &[], &[ZERO], 0.04, |x| {
            vec![(x[0] - 1.0).powi(2) * 0.01 + (x[1] - x[0] * x[0]).powi(2), x[0] + x[2] * x[2] + 1.0]
        }),
        p("HS 28", &[-4.0, 1.0, 1.0], &[], &[ZERO], 0.0, |x| {
            vec![(x[0] + x[1]).powi(2) + (x[1] + x[2]).powi(2), x[0] + x[1] * 2.0 + x[2] * 3.0 - 1.0]
        }),
        p("HS 29", &[1.0, 1.0, 1.0], &[], &[POSITIVE], -16.0 * SQRT_2, |x| {
            vec![-product(x), x[0] * x[0] * -1.0 - x[1] * x[1] * 2.0 - x[2] * x[2] * 4.0 + 48.0]
        }),
        p("HS 30", &[1.0; 3], &[(1.0, 10.0), (-10.0, 10.0), (-10.0, 10.0)], &[POSITIVE], 1.0, |x| {
            vec![squares(x), squares(&x[..2]) - 1.0]
        }),
        p("HS 32", &[0.1, 0.7, 0.2], &[POSITIVE; 3], &[POSITIVE, ZERO], 1.0, |x| {
            vec![
                (x[0] + x[1] * 3.0 + x[2]).powi(2) + (x[0] - x[1]).powi(2) * 4.0,
                x[1] * 6.0 + x[2] * 4.0 - x[0].powi(3) - 3.0,
                -x[0] - x[1] - x[2] + 1.0,
            ]
        }),
        p(
            "HS 34",
            &[0.0, 1.05, 2.9],
            &[(0.0, 100.0), (0.0, 100.0), (0.0, 10.0)],
            &[POSITIVE; 2],
            -(10f64.ln().ln()),
            |x| vec![-x[0], x[1] - x[0].exp(), x[2] - x[1].exp()],
        ),
        p("HS 35", &[0.5; 3], &[POSITIVE; 3], &[POSITIVE], 1.0 / 9.0, |x| {
            vec![
                x[0] * x[0] * 2.0 + x[1] * x[1] * 2.0 + x[2] * x[2] + x[0] * x[1] * 2.0 + x[0] * x[2] * 2.0
                    - x[0] * 8.0
                    - x[1] * 6.0
                    - x[2] * 4.0
                    + 9.0,
                -x[0] - x[1] - x[2] * 2.0 + 3.0,
            ]
        }),
        p("HS 36", &[10.0; 3], &[(0.0, 20.0), (0.0, 11.0), (0.0, 42.0)], &[POSITIVE], -3300.0, |x| {
            vec![-product(x), -x[0] - x[1] * 2.0 - x[2] * 2.0 + 72.0]
        }),
        p("HS 37", &[10.0; 3], &[(0.0, 42.0); 3], &[(0.0, 72.0)], -3456.0, |x| {
            vec![-product(x), x[0] + x[1] * 2.0 + x[2] * 2.0]
        }),
        p("HS 39", &[2.0; 4], &[], &[ZERO; 2], -1.0, |x| {
            vec![-x[0], x[1] - x[0].powi(3) - x[2] * x[2], x[0] * x[0] - x[1] - x[3] * x[3]]
        }),
        p("HS 40", &[0.8; 4], &[], &[ZERO; 3], -0.25, |x| {
            vec![-product(x), x[0].powi(3) + x[1] * x[1] - 1.0, x[0] * x[0] * x[3] - x[2], x[3] * x[3] - x[1]]
        }),
        p("HS 42", &[1.0; 4], &[], &[ZERO; 2], 28.0 - 10.0 * SQRT_2, |x| {
            let cost = (0..4).fold(D::from(0.0), |s, i| s + (x[i] - (i + 1) as f64).powi(2));
            vec![cost, x[0] - 2.0, squares(&x[2..]) - 2.0]
        }),
        p("HS 43", &[0.0; 4], &[], &[POSITIVE; 3], -44.0, |x| {
            let s: Vec<D> = x.iter().map(|x| x * x).collect();
            vec![
                s[0] + s[1] + s[2] * 2.0 + s[3] - x[0] * 5.0 - x[1] * 5.0 - x[2] * 21.0 + x[3] * 7.0,
                -s[0] - s[1] - s[2] - s[3] - x[0] + x[1] - x[2] + x[3] + 8.0,
                -s[0] - s[1] * 2.0 - s[2] - s[3] * 2.0 + x[0] + x[3] + 10.0,
                -s[0] * 2.0 - s[1] - s[2] - x[0] * 2.0 + x[1] + x[3] + 5.0,
            ]
        }),
        p("HS 48", &[3.0, 5.0, -3.0, 2.0, -2.0], &[], &[ZERO; 2], 0.0, |x| {
            vec![
                (x[0] - 1.0).powi(2) + (x[1] - x[2]).powi(2) + (x[3] - x[4]).powi(2),
                x[0] + x[1] + x[2] + x[3] + x[4] - 5.0,
                x[2] - (x[3] + x[4]) * 2.0 + 3.0,
            ]
        }),
        p("HS 60", &[2.0; 3], &[(-10.0, 10.0); 3], &[ZERO], 0.03256820025, |x| {
            vec![
                (x[0] - 1.0).powi(2) + (x[0] - x[1]).powi(2) + (x[1] - x[2]).powi(4),
                x[0] * (x[1] * x[1] + 1.0) + x[2].powi(4) - 4.0 - 3.0 * SQRT_2,
            ]
        }),
        p("HS 63", &[2.0; 3], &[POSITIVE; 3], &[ZERO; 2], 961.7151721, |x| {
            vec![
                -x[0] * x[0] - x[1] * x[1] * 2.0 - x[2] * x[2] - x[0] * x[1] - x[0] * x[2] + 1000.0,
                x[0] * 8.0 + x[1] * 14.0 + x[2] * 7.0 - 56.0,
                squares(x) - 25.0,
            ]
        }),
        p(
            "HS 65",
            &[-5.0, 5.0, 0.0],
            &[(-4.5, 4.5), (-4.5, 4.5), (-5.0, 5.0)],
            &[POSITIVE],
            0.9535288567,
            |x| {
                vec![
                    (x[0] - x[1]).powi(2) + (x[0] + x[1] - 10.0).powi(2) / 9.0 + (x[2] - 5.0).powi(2),
                    -squares(x) + 48.0,
                ]
            },
        ),
        p(
            "HS 66",
            &[0.0, 1.05, 2.9],
            &[(0.0, 100.0), (0.0, 100.0), (0.0, 10.0)],
            &[POSITIVE; 2],
            0.5181632741,
            |x| vec![x[2] * 0.2 - x[0] * 0.8, x[1] - x[0].exp(), x[2] - x[1].exp()],
        ),
        p("HS 71", &[1.0, 5.0, 5.0, 1.0], &[(1.0, 5.0); 4], &[(25.0, INF), (40.0, 40.0)], 17.0140173, |x| {
            vec![x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2], product(x), squares(x)]
        }),
        p("HS 76", &[0.5; 4], &[POSITIVE; 4], &[POSITIVE; 3], -4.681818181, |x| {
            vec![
                x[0] * x[0] + x[1] * x[1] * 0.5 + x[2] * x[2] + x[3] * x[3] * 0.5 - x[0] * x[2] + x[2] * x[3]
                    - x[0]
                    - x[1] * 3.0
                    + x[2]
                    - x[3],
                -x[0] - x[1] * 2.0 - x[2] - x[3] + 5.0,
                -x[0] * 3.0 - x[1] - x[2] * 2.0 + x[3] + 4.0,
                x[1] + x[2] * 4.0 - 1.5,
            ]
        }),
        p("HS 77", &[2.0; 5], &[], &[ZERO; 2], 0.24150513, |x| {
            vec![
                (x[0] - 1.0).powi(2)
                    + (x[0] - x[1]).powi(2)
                    + (x[2] - 1.0).powi(2)
                    + (x[3] - 1.0).powi(4)
                    + (x[4] - 1.0).powi(6),
                x[0] * x[0] * x[3] + (x[3] - x[4]).sin() - 2.0 * SQRT_2,
                x[1] + x[2].powi(4) * x[3] * x[3] - 8.0 - SQRT_2,
            ]
        }),
        p("HS 78", &[-2.0, 1.5, 2.0, -1.0, -1.0], &[], &[ZERO; 3], -2.91970041, |x| {
            vec![
                product(x),
                squares(x) - 10.0,
                x[1] * x[2] - x[3] * x[4] * 5.0,
                x[0].powi(3) + x[1].powi(3) + 1.0,
            ]
        }),
        p("HS 79", &[2.0; 5], &[], &[ZERO; 3], 0.0787768209, |x| {
            vec![
                (x[0] - 1.0).powi(2)
                    + (x[0] - x[1]).powi(2)
                    + (x[1] - x[2]).powi(2)
                    + (x[2] - x[3]).powi(4)
                    + (x[3] - x[4]).powi(4),
                x[0] + x[1] * x[1] + x[2].powi(3) - 2.0 - 3.0 * SQRT_2,
                x[1] - x[2] * x[2] + x[3] + 2.0 - 2.0 * SQRT_2,
                x[0] * x[4] - 2.0,
            ]
        }),
        p(
            "HS 80",
            &[-2.0, 2.0, 2.0, -1.0, -1.0],
            &[(-2.3, 2.3), (-2.3, 2.3), (-3.2, 3.2), (-3.2, 3.2), (-3.2, 3.2)],
            &[ZERO; 3],
            0.0539498478,
            |x| {
                vec![
                    product(x).exp(),
                    squares(x) - 10.0,
                    x[1] * x[2] - x[3] * x[4] * 5.0,
                    x[0].powi(3) + x[1].powi(3) + 1.0,
                ]
            },
        ),
        p(
            "HS 93",
            &[5.54, 4.4, 12.02, 11.8, 0.702, 0.852],
            &[POSITIVE; 6],
            &[POSITIVE; 2],
            135.075961,
            |x| {
                let a = x[0] * x[3] * (x[0] + x[1] + x[2]);
                let b = x[1] * x[2] * (x[0] + x[1] * 1.57 + x[3]);
                let (u, v) = (x[4] * x[4], x[5] * x[5]);
                vec![
                    a * 0.0204 + b * 0.0187 + a * u * 0.0607 + b * v * 0.0437,
                    product(x) * 0.001 - 2.07,
                    -(a * u * 0.00062) - b * v * 0.00058 + 1.0,
                ]
            },
        ),
        p("HS 100", &[1.0, 2.0, 0.0, 4.0, 0.0, 1.0, 1.0], &[], &[POSITIVE; 4], 680.6300573, |x| {
            vec![
                (x[0] - 10.0).powi(2)
                    + (x[1] - 12.0).powi(2) * 5.0
                    + x[2].powi(4)
                    + (x[3] - 11.0).powi(2) * 3.0
                    + x[4].powi(6) * 10.0
                    + x[5] * x[5] * 7.0
                    + x[6].powi(4)
                    - x[5] * x[6] * 4.0
                    - x[5] * 10.0
                    - x[6] * 8.0,
                -(x[0] * x[0] * 2.0) - x[1].powi(4) * 3.0 - x[2] - x[3] * x[3] * 4.0 - x[4] * 5.0 + 127.0,
                -(x[0] * 7.0) - x[1] * 3.0 - x[2] * x[2] * 10.0 - x[3] + x[4] + 282.0,
                -(x[0] * 23.0) - x[1] * x[1] - x[5] * x[5] * 6.0 + x[6] * 8.0 + 196.0,
                -(x[0] * x[0] * 4.0) - x[1] * x[1] + x[0] * x[1] * 3.0 - x[2] * x[2] * 2.0 - x[5] * 5.0
                    + x[6] * 11.0,
            ]
        }),
        Problem { start: vec![2.0, 1.0, 1.0], ..waechter_biegler() },
        // Nocedal & Wright (2006), example 15.4, from a point on the circle.
        p("Maratos", &[0.6, 0.8], &[], &[ZERO], -1.0, |x| {
            vec![(squares(x) - 1.0) * 2.0 - x[0], squares(x) - 1.0]
        }),
        // Moré, Garbow & Hillstrom (1981), problem 21.
        p("extended Rosenbrock", &[-1.2, 1.0, -1.2, 1.0, -1.2, 1.0, -1.2, 1.0], &[], &[], 0.0, |x| {
            vec![x.chunks(2).fold(D::from(0.0), |s, x| s + banana(x))]
        }),
    ]
}

/// Wächter & Biegler, Math. Program. 88 (2000) 565–574, with a = −1, b = 1/2 and a start from which interior-point
/// methods of the class they name fail.
pub(crate) fn waechter_biegler() -> Problem {
    let variables = [FREE, POSITIVE, POSITIVE];
    Problem::new("Wächter–Biegler", &[-2.0, 3.0, 1.0], &variables, &[ZERO; 2], 1.0, |x| {
        vec![x[0], x[0] * x[0] - x[1] - 1.0, x[0] - x[2] - 0.5]
    })
}
