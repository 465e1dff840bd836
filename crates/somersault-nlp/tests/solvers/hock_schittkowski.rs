//! More problems of Hock & Schittkowski, with the ones in [`crate::problems`] more than a hundred, for both solvers.
//!
//! Starts and formulas are those of W. Hock & K. Schittkowski, Test Examples for Nonlinear Programming Codes (1981), optima
//! those of K. Schittkowski, An Updated Set of 306 Test Problems for Nonlinear Programming with Validated Optimal Solutions
//! (2010), or in closed form where there is one.

use crate::problems::{D, FREE, INF, POSITIVE, Problem, ZERO, published};
use crate::sqp::{kkt, solve};
use num_dual::DualNum;
use somersault_nlp::{Globalisation, InteriorPoint, NlpSolver, Sqp, Status};
use std::f64::consts::SQRT_2;

fn d(x: f64) -> D {
    D::from(x)
}

fn banana(x: &[D]) -> D {
    (x[1] - x[0] * x[0]).powi(2) * 100.0 + (x[0] - 1.0).powi(2)
}

fn sum(terms: &[D]) -> D {
    terms.iter().fold(d(0.0), |s, x| s + *x)
}

fn product(x: &[D]) -> D {
    x.iter().fold(d(1.0), |s, x| s * *x)
}

fn dot(weights: &[f64], x: &[D]) -> D {
    weights.iter().zip(x).fold(d(0.0), |s, (w, x)| s + *x * *w)
}

fn small() -> Vec<Problem> {
    let p = Problem::new;
    let root = (598.0f64 / 1200.0).sqrt();
    let at = 2.0 * root * ((2.5e-3 / root.powi(3)).acos() / 3.0).cos();
    vec![
        p(
            "HS 2",
            &[-2.0, 1.0],
            &[FREE, (1.5, INF)],
            &[],
            100.0 * (1.5 - at * at).powi(2) + (1.0 - at).powi(2),
            |x| vec![banana(x)],
        ),
        p("HS 16", &[-2.0, 1.0], &[(-0.5, 0.5), (-INF, 1.0)], &[POSITIVE; 2], 0.25, |x| {
            vec![banana(x), x[1] * x[1] + x[0], x[0] * x[0] + x[1]]
        }),
        p("HS 17", &[-2.0, 1.0], &[(-0.5, 0.5), (-INF, 1.0)], &[POSITIVE; 2], 1.0, |x| {
            vec![banana(x), x[1] * x[1] - x[0], x[0] * x[0] - x[1]]
        }),
        p("HS 20", &[0.1, 1.0], &[(-0.5, 0.5), FREE], &[POSITIVE; 3], 81.5 - 25.0 * 3f64.sqrt(), |x| {
            vec![banana(x), x[1] * x[1] + x[0], x[0] * x[0] + x[1], x[0] * x[0] + x[1] * x[1] - 1.0]
        }),
        p("HS 31", &[1.0; 3], &[(-10.0, 10.0), (1.0, 10.0), (-10.0, 1.0)], &[POSITIVE], 6.0, |x| {
            vec![x[0] * x[0] * 9.0 + x[1] * x[1] + x[2] * x[2] * 9.0, x[0] * x[1] - 1.0]
        }),
        p("HS 33", &[0.0, 0.0, 3.0], &[POSITIVE, POSITIVE, (0.0, 5.0)], &[POSITIVE; 2], SQRT_2 - 6.0, |x| {
            let s = x[0] * x[0] + x[1] * x[1];
            vec![(x[0] - 1.0) * (x[0] - 2.0) * (x[0] - 3.0) + x[2], x[2] * x[2] - s, x[2] * x[2] + s - 4.0]
        }),
        p("HS 38", &[-3.0, -1.0, -3.0, -1.0], &[(-10.0, 10.0); 4], &[], 0.0, |x| {
            let more = (x[3] - x[2] * x[2]).powi(2) * 90.0 + (x[2] - 1.0).powi(2);
            let (a, b) = (x[1] - 1.0, x[3] - 1.0);
            vec![banana(x) + more + (a * a + b * b) * 10.1 + a * b * 19.8]
        }),
        p("HS 41", &[1.0; 4], &[(0.0, 1.0), (0.0, 1.0), (0.0, 1.0), (0.0, 2.0)], &[ZERO], 52.0 / 27.0, |x| {
            vec![-product(&x[..3]) + 2.0, x[0] + x[1] * 2.0 + x[2] * 2.0 - x[3]]
        }),
        p("HS 45", &[2.0; 5], &[(0.0, 1.0), (0.0, 2.0), (0.0, 3.0), (0.0, 4.0), (0.0, 5.0)], &[], 1.0, |x| {
            vec![product(x) / -120.0 + 2.0]
        }),
        p("HS 46", &[SQRT_2 / 2.0, 1.75, 0.5, 2.0, 2.0], &[], &[ZERO; 2], 0.0, |x| {
            vec![
                (x[0] - x[1]).powi(2) + (x[2] - 1.0).powi(2) + (x[3] - 1.0).powi(4) + (x[4] - 1.0).powi(6),
                x[0] * x[0] * x[3] + (x[3] - x[4]).sin() - 1.0,
                x[1] + x[2].powi(4) * x[3] * x[3] - 2.0,
            ]
        }),
        p("HS 47", &[2.0, SQRT_2, -1.0, 2.0 - SQRT_2, 0.5], &[], &[ZERO; 3], 0.0, |x| {
            vec![
                (x[0] - x[1]).powi(2) + (x[1] - x[2]).powi(2) + (x[2] - x[3]).powi(4) + (x[3] - x[4]).powi(4),
                x[0] + x[1] * x[1] + x[2].powi(3) - 3.0,
                x[1] - x[2] * x[2] + x[3] - 1.0,
                x[0] * x[4] - 1.0,
            ]
        }),
        p("HS 49", &[10.0, 7.0, 2.0, -3.0, 0.8], &[], &[ZERO; 2], 0.0, |x| {
            vec![
                (x[0] - x[1]).powi(2) + (x[2] - 1.0).powi(2) + (x[3] - 1.0).powi(4) + (x[4] - 1.0).powi(6),
                x[0] + x[1] + x[2] + x[3] * 4.0 - 7.0,
                x[2] + x[4] * 5.0 - 6.0,
            ]
        }),
        p("HS 50", &[35.0, -31.0, 11.0, 5.0, -5.0], &[], &[ZERO; 3], 0.0, |x| {
            let row = |i: usize| x[i] + x[i + 1] * 2.0 + x[i + 2] * 3.0 - 6.0;
            vec![
                (x[0] - x[1]).powi(2) + (x[1] - x[2]).powi(2) + (x[2] - x[3]).powi(4) + (x[3] - x[4]).powi(4),
                row(0),
                row(1),
                row(2),
            ]
        }),
        p("HS 51", &[2.5, 0.5, 2.0, -1.0, 0.5], &[], &[ZERO; 3], 0.0, |x| {
            vec![
                (x[0] - x[1]).powi(2)
                    + (x[1] + x[2] - 2.0).powi(2)
                    + (x[3] - 1.0).powi(2)
                    + (x[4] - 1.0).powi(2),
                x[0] + x[1] * 3.0 - 4.0,
                x[2] + x[3] - x[4] * 2.0,
                x[1] - x[4],
            ]
        }),
        p("HS 52", &[2.0; 5], &[], &[ZERO; 3], 1859.0 / 349.0, |x| {
            vec![
                (x[0] * 4.0 - x[1]).powi(2)
                    + (x[1] + x[2] - 2.0).powi(2)
                    + (x[3] - 1.0).powi(2)
                    + (x[4] - 1.0).powi(2),
                x[0] + x[1] * 3.0,
                x[2] + x[3] - x[4] * 2.0,
                x[1] - x[4],
            ]
        }),
        p("HS 53", &[2.0; 5], &[(-10.0, 10.0); 5], &[ZERO; 3], 176.0 / 43.0, |x| {
            vec![
                (x[0] - x[1]).powi(2)
                    + (x[1] + x[2] - 2.0).powi(2)
                    + (x[3] - 1.0).powi(2)
                    + (x[4] - 1.0).powi(2),
                x[0] + x[1] * 3.0,
                x[2] + x[3] - x[4] * 2.0,
                x[1] - x[4],
            ]
        }),
        p(
            "HS 55",
            &[1.0, 2.0, 0.0, 0.0, 0.0, 2.0],
            &[(0.0, 1.0), POSITIVE, POSITIVE, (0.0, 1.0), POSITIVE, POSITIVE],
            &[ZERO; 6],
            19.0 / 3.0,
            |x| {
                vec![
                    x[0] + x[1] * 2.0 + x[4] * 4.0 + (x[0] * x[3]).exp(),
                    x[0] + x[1] * 2.0 + x[4] * 5.0 - 6.0,
                    x[0] + x[1] + x[2] - 3.0,
                    x[3] + x[4] + x[5] - 2.0,
                    x[0] + x[3] - 1.0,
                    x[1] + x[4] - 2.0,
                    x[2] + x[5] - 2.0,
                ]
            },
        ),
        {
            let (a, b) = ((1.0f64 / 4.2).sqrt().asin(), (5.0f64 / 7.2).sqrt().asin());
            p("HS 56", &[1.0, 1.0, 1.0, a, a, a, b], &[], &[ZERO; 4], -3.456, |x| {
                vec![
                    -product(&x[..3]),
                    x[0] - x[3].sin().powi(2) * 4.2,
                    x[1] - x[4].sin().powi(2) * 4.2,
                    x[2] - x[5].sin().powi(2) * 4.2,
                    x[0] + x[1] * 2.0 + x[2] * 2.0 - x[6].sin().powi(2) * 7.2,
                ]
            })
        },
        p("HS 61", &[0.0; 3], &[], &[ZERO; 2], -143.646142201, |x| {
            vec![
                x[0] * x[0] * 4.0 + x[1] * x[1] * 2.0 + x[2] * x[2] * 2.0 - x[0] * 33.0 + x[1] * 16.0
                    - x[2] * 24.0,
                x[0] * 3.0 - x[1] * x[1] * 2.0 - 7.0,
                x[0] * 4.0 - x[2] * x[2] - 11.0,
            ]
        }),
        p("HS 62", &[0.7, 0.2, 0.1], &[(0.0, 1.0); 3], &[ZERO], -26272.5144873, |x| {
            let (b3, c3) = (x[2] + 0.03, x[2] * 0.13 + 0.03);
            let (b2, c2) = (b3 + x[1], b3 + x[1] * 0.07);
            let (b1, c1) = (b2 + x[0], b2 + x[0] * 0.09);
            let log = (b1 / c1).ln() * 255.0 + (b2 / c2).ln() * 280.0 + (b3 / c3).ln() * 290.0;
            vec![log * -32.174, sum(x) - 1.0]
        }),
        p("HS 64", &[1.0; 3], &[(1e-5, INF); 3], &[POSITIVE], 6299.84242821, |x| {
            let cost = x[0] * 5.0
                + x[0].recip() * 5e4
                + x[1] * 20.0
                + x[1].recip() * 7.2e4
                + x[2] * 10.0
                + x[2].recip() * 1.44e5;
            vec![cost, -x[0].recip() * 4.0 - x[1].recip() * 32.0 - x[2].recip() * 120.0 + 1.0]
        }),
        p(
            "HS 72",
            &[1.0; 4],
            &[(1e-3, 4e5), (1e-3, 3e5), (1e-3, 2e5), (1e-3, 1e5)],
            &[POSITIVE; 2],
            727.67936,
            |x| {
                let r: Vec<D> = x.iter().map(|x| x.recip()).collect();
                vec![
                    sum(x) + 1.0,
                    -dot(&[4.0, 2.25, 1.0, 0.25], &r) + 0.0401,
                    -dot(&[0.16, 0.36, 0.64, 0.64], &r) + 0.010085,
                ]
            },
        ),
        p("HS 73", &[1.0; 4], &[POSITIVE; 4], &[POSITIVE, POSITIVE, ZERO], 29.8943781573, |x| {
            let spread = x[0] * x[0] * 0.28 + x[1] * x[1] * 0.19 + x[2] * x[2] * 20.5 + x[3] * x[3] * 0.62;
            vec![
                dot(&[24.55, 26.75, 39.0, 40.5], x),
                dot(&[2.3, 5.6, 11.1, 1.3], x) - 5.0,
                dot(&[12.0, 11.9, 41.8, 52.1], x) - spread.sqrt() * 1.645 - 21.0,
                sum(x) - 1.0,
            ]
        }),
        p(
            "HS 81",
            &[-2.0, 2.0, 2.0, -1.0, -1.0],
            &[(-2.3, 2.3), (-2.3, 2.3), (-3.2, 3.2), (-3.2, 3.2), (-3.2, 3.2)],
            &[ZERO; 3],
            0.0539498477749,
            |x| {
                let cubes = x[0].powi(3) + x[1].powi(3) + 1.0;
                vec![
                    product(x).exp() - cubes * cubes * 0.5,
                    x.iter().fold(d(-10.0), |s, x| s + *x * *x),
                    x[1] * x[2] - x[3] * x[4] * 5.0,
                    cubes,
                ]
            },
        ),
        p(
            "HS 83",
            &[78.0, 33.0, 27.0, 27.0, 27.0],
            &[(78.0, 102.0), (33.0, 45.0), (27.0, 45.0), (27.0, 45.0), (27.0, 45.0)],
            &[(0.0, 92.0), (0.0, 20.0), (0.0, 5.0)],
            -30665.5386717,
            |x| {
                vec![
                    x[2] * x[2] * 5.3578547 + x[0] * x[4] * 0.8356891 + x[0] * 37.293239 - 40792.141,
                    x[1] * x[4] * 5.6858e-3 + x[0] * x[3] * 6.262e-4 - x[2] * x[4] * 2.2053e-3 + 85.334407,
                    x[1] * x[4] * 7.1317e-3 + x[0] * x[1] * 2.9955e-3 + x[2] * x[2] * 2.1813e-3 - 9.48751,
                    x[2] * x[4] * 4.7026e-3 + x[0] * x[2] * 1.2547e-3 + x[2] * x[3] * 1.9085e-3 - 10.699039,
                ]
            },
        ),
        p(
            "HS 84",
            &[2.52, 2.0, 37.5, 9.25, 6.8],
            &[(0.0, 1e3), (1.2, 2.4), (20.0, 60.0), (9.0, 9.3), (6.5, 7.0)],
            &[(0.0, 2.94e5), (0.0, 2.94e5), (0.0, 2.772e5)],
            -5280335.13306,
            |x| {
                let of = |a: [f64; 5]| x[0] * (dot(&a[1..], &x[1..]) + a[0]);
                vec![
                    -(of([-8720288.849, 150512.5253, -156.6950325, 476470.3222, 729482.8271]) - 24345.0),
                    of([-145421.402, 2931.1506, -40.427932, 5106.192, 15711.36]),
                    of([-155011.1084, 4360.53352, 12.9492344, 10236.884, 13176.786]),
                    of([-326669.5104, 7390.68412, -27.8986976, 16643.076, 30988.146]),
                ]
            },
        ),
        p("HS 44", &[0.0; 4], &[POSITIVE; 4], &[POSITIVE; 6], -15.0, |x| {
            vec![
                x[0] - x[1] - x[2] - x[0] * x[2] + x[0] * x[3] + x[1] * x[2] - x[1] * x[3],
                -x[0] - x[1] * 2.0 + 8.0,
                -x[0] * 4.0 - x[1] + 12.0,
                -x[0] * 3.0 - x[1] * 4.0 + 12.0,
                -x[2] * 2.0 - x[3] + 8.0,
                -x[2] - x[3] * 2.0 + 8.0,
                -x[2] - x[3] + 5.0,
            ]
        }),
        p("HS 59", &[90.0, 10.0], &[(0.0, 75.0), (0.0, 65.0)], &[POSITIVE; 3], -7.80422632408, |x| {
            let (a, b) = (x[0], x[1]);
            let (a2, b2) = (a * a, b * b);
            let (a3, b3) = (a2 * a, b2 * b);
            vec![
                a * 3.8112 - a2 * 0.12694 + a3 * 2.0567e-3 - a3 * a * 1.0345e-5 + b * 6.8306
                    - a * b * 3.0234e-2
                    + a2 * b * 1.28134e-3
                    - a3 * b * 3.5256e-5
                    + a3 * a * b * 2.266e-7
                    - b2 * 0.25645
                    + b3 * 3.4604e-3
                    - b3 * b * 1.3514e-5
                    + (b + 1.0).recip() * 28.106
                    + a2 * b2 * 5.2375e-6
                    + a3 * b2 * 6.3e-8
                    - a3 * b3 * 7e-10
                    - a * b2 * 3.4054e-4
                    + a * b3 * 1.6638e-6
                    + (a * b * 5e-4).exp() * 2.8673
                    - 75.196,
                a * b - 700.0,
                b - a2 * 8e-3,
                (b - 50.0).powi(2) - (a - 55.0) * 5.0,
            ]
        }),
    ]
}

/// HS 74 and 75.
fn generators(name: &'static str, a: f64, optimum: f64) -> Problem {
    let bounds = [(0.0, 1200.0), (0.0, 1200.0), (-a, a), (-a, a)];
    Problem::new(name, &[0.0; 4], &bounds, &[(-a, a), ZERO, ZERO, ZERO], optimum, |x| {
        let sine = |angle: D| (angle - 0.25).sin() * 1000.0;
        vec![
            x[0] * 3.0 + x[0].powi(3) * 1e-6 + x[1] * 2.0 + x[1].powi(3) * (2e-6 / 3.0),
            x[3] - x[2],
            sine(-x[2]) + sine(-x[3]) + 894.8 - x[0],
            sine(x[2]) + sine(x[2] - x[3]) + 894.8 - x[1],
            sine(x[3]) + sine(x[3] - x[2]) + 1294.8,
        ]
    })
}

/// HS 95 to 98.
fn blends(name: &'static str, b: [f64; 4], optimum: f64) -> Problem {
    let upper = [0.31, 0.046, 0.068, 0.042, 0.028, 0.0134];
    let rows = b.map(|b| (b, INF));
    Problem::new(name, &[0.0; 6], &upper.map(|u| (0.0, u)), &rows, optimum, |x| {
        vec![
            dot(&[4.3, 31.8, 63.3, 15.8, 68.5, 4.7], x),
            dot(&[17.1, 38.2, 204.2, 212.3, 623.4, 1495.5], x)
                - x[0] * x[2] * 169.0
                - x[2] * x[4] * 3580.0
                - x[3] * x[4] * 3810.0
                - x[3] * x[5] * 18500.0
                - x[4] * x[5] * 24300.0,
            dot(&[17.9, 36.8, 113.9, 169.7, 337.8, 1385.2], x)
                - x[0] * x[2] * 139.0
                - x[3] * x[4] * 2450.0
                - x[3] * x[5] * 16600.0
                - x[4] * x[5] * 17200.0,
            x[1] * -273.0 - x[3] * 70.0 - x[4] * 819.0 + x[3] * x[4] * 26000.0,
            x[0] * 159.9 - x[1] * 311.0 + x[3] * 587.0 + x[4] * 391.0 + x[5] * 2198.0 - x[0] * x[5] * 14000.0,
        ]
    })
}

/// Costs of HS 101 to 103.
fn heat(x: &[D], power: f64) -> Vec<D> {
    let cost = x[0] * x[3] * x[3] * x[6].powf(power) / (x[1] * x[5].powi(3)) * 10.0
        + x[2] * x[3] / (x[0] * x[1] * x[1] * x[4] * x[6].sqrt()) * 15.0
        + x[1] * x[5] / (x[0] * x[0] * x[3] * x[4] * x[4]) * 20.0
        + x[0] * x[0] * x[1] * x[1] * x[4].sqrt() * x[6] / (x[2] * x[5] * x[5]) * 25.0;
    vec![
        cost,
        -x[0].sqrt() * x[6] / (x[2] * x[5] * x[5]) * 0.5
            - x[0].powi(3) * x[1] * x[5] * x[6].sqrt() / (x[2] * x[2]) * 0.7
            - x[2] * x[5].powf(2.0 / 3.0) * x[6].powf(0.25) / (x[1] * x[3].sqrt()) * 0.2
            + 1.0,
        -x[1] * x[5] / (x[0].sqrt() * x[2] * x[4]) * 1.3
            - x[2] * x[5] * x[5] / (x[3] * x[4]) * 0.8
            - x[1].sqrt() * x[5].powf(1.0 / 3.0) / (x[0] * x[3] * x[3] * x[4]) * 3.1
            + 1.0,
        -x[0] * x[4] * x[6].powf(1.0 / 3.0) / (x[2].powf(1.5) * x[5]) * 2.0
            - x[1] * x[4] / ((x[2] * x[6]).sqrt() * x[5]) * 0.1
            - x[1] * x[2].sqrt() * x[4] / x[0]
            - x[2] * x[4] * x[6] / (x[1] * x[1] * x[5]) * 0.65
            + 1.0,
        -x[1] * x[4].sqrt() * x[6].powf(1.0 / 3.0) / (x[0] * x[0] * x[3]) * 0.2
            - x[0].sqrt() * x[1] * x[1] * x[2] * x[3].powf(1.0 / 3.0) * x[6].powf(0.25)
                / x[4].powf(2.0 / 3.0)
                * 0.3
            - x[2] * x[4] * x[6].powf(0.75) / (x[0].powi(3) * x[1] * x[1]) * 0.4
            - x[3] * x[6].sqrt() / (x[2] * x[2]) * 0.5
            + 1.0,
        cost,
    ]
}

fn heat_exchangers() -> Vec<Problem> {
    let mut bounds = [(0.1, 10.0); 7];
    bounds[6].0 = 0.01;
    let rows = [POSITIVE, POSITIVE, POSITIVE, POSITIVE, (100.0, 3000.0)];
    let p = |name, optimum, f| Problem::new(name, &[6.0; 7], &bounds, &rows, optimum, f);
    vec![
        p("HS 101", 1809.76476556, |x| heat(x, -0.25)),
        p("HS 102", 911.880571336, |x| heat(x, 0.125)),
        p("HS 103", 543.667958424, |x| heat(x, 0.5)),
    ]
}

/// Chemical potentials of HS 111 and 112.
const POTENTIALS: [f64; 10] =
    [-6.089, -17.164, -34.054, -5.914, -24.721, -14.986, -24.1, -10.708, -26.662, -22.179];

fn equilibrium(n: &[D]) -> Vec<D> {
    let total = sum(n).ln();
    let cost = n.iter().zip(POTENTIALS).fold(d(0.0), |s, (n, c)| s + *n * (n.ln() - total + c));
    vec![
        cost,
        n[0] + n[1] * 2.0 + n[2] * 2.0 + n[5] + n[9] - 2.0,
        n[3] + n[4] * 2.0 + n[5] + n[6] - 1.0,
        n[2] + n[6] + n[7] + n[8] * 2.0 + n[9] - 1.0,
    ]
}

/// Data of HS 86 and 117, which is its dual.
const COLVILLE_A: [[f64; 5]; 10] = [
    [-16.0, 2.0, 0.0, 1.0, 0.0],
    [0.0, -2.0, 0.0, 0.4, 2.0],
    [-3.5, 0.0, 2.0, 0.0, 0.0],
    [0.0, -2.0, 0.0, -4.0, -1.0],
    [0.0, -9.0, -2.0, 1.0, -2.8],
    [2.0, 0.0, -4.0, 0.0, 0.0],
    [-1.0, -1.0, -1.0, -1.0, -1.0],
    [-1.0, -2.0, -3.0, -2.0, -1.0],
    [1.0, 2.0, 3.0, 4.0, 5.0],
    [1.0, 1.0, 1.0, 1.0, 1.0],
];
const COLVILLE_B: [f64; 10] = [-40.0, -2.0, -0.25, -4.0, -4.0, -1.0, -40.0, -60.0, 5.0, 1.0];
const COLVILLE_C: [[f64; 5]; 5] = [
    [30.0, -20.0, -10.0, 32.0, -10.0],
    [-20.0, 39.0, -6.0, -31.0, 32.0],
    [-10.0, -6.0, 10.0, -6.0, -10.0],
    [32.0, -31.0, -6.0, 39.0, -20.0],
    [-10.0, 32.0, -10.0, -20.0, 30.0],
];
const COLVILLE_D: [f64; 5] = [4.0, 8.0, 10.0, 6.0, 2.0];
const COLVILLE_E: [f64; 5] = [-15.0, -27.0, -36.0, -18.0, -12.0];

fn colville(x: &[D]) -> Vec<D> {
    let mut all = vec![dot(&COLVILLE_E, x)];
    for i in 0..5 {
        all[0] += x[i].powi(3) * COLVILLE_D[i] + x[i] * dot(&COLVILLE_C[i], x);
    }
    all.extend(COLVILLE_A.iter().zip(COLVILLE_B).map(|(a, b)| dot(a, x) - b));
    all
}

fn colville_dual(x: &[D]) -> Vec<D> {
    let (z, x) = x.split_at(10);
    let mut all = vec![-dot(&COLVILLE_B, z)];
    for j in 0..5 {
        all[0] += x[j].powi(3) * (2.0 * COLVILLE_D[j]) + x[j] * dot(&COLVILLE_C[j], x);
        let pulled = (0..10).fold(d(0.0), |s, i| s + z[i] * COLVILLE_A[i][j]);
        all.push(dot(&COLVILLE_C[j], x) * 2.0 + x[j] * x[j] * (3.0 * COLVILLE_D[j]) + COLVILLE_E[j] - pulled);
    }
    all
}

/// Rows of HS 107.
fn power_flow(x: &[D]) -> Vec<D> {
    let v = 48.4 / 50.176;
    let (c, s) = (v * 0.25f64.sin(), v * 0.25f64.cos());
    let (y1, y2, y3, y4) = (x[7].sin(), x[7].cos(), x[8].sin(), x[8].cos());
    let (y5, y6) = ((x[7] - x[8]).sin(), (x[7] - x[8]).cos());
    let (a, b, e) = (x[4] * x[5], x[4] * x[6], x[5] * x[6]);
    vec![
        x[0] * 3000.0 + x[0].powi(3) * 1000.0 + x[1] * 2000.0 + x[1].powi(3) * 666.66666667,
        x[4] * x[4] * (2.0 * c) - x[0] + 0.4 - a * (y1 * s + y2 * c) - b * (y3 * s + y4 * c),
        x[5] * x[5] * (2.0 * c) - x[1] + 0.4 + a * (y1 * s - y2 * c) + e * (y5 * s - y6 * c),
        x[6] * x[6] * (2.0 * c) + 0.8 + b * (y3 * s - y4 * c) - e * (y5 * s + y6 * c),
        x[4] * x[4] * (2.0 * s) - x[2] + 0.2 - a * (y2 * s - y1 * c) - b * (y4 * s - y3 * c),
        x[5] * x[5] * (2.0 * s) - x[3] + 0.2 - a * (y1 * c + y2 * s) - e * (y5 * c + y6 * s),
        x[6] * x[6] * (2.0 * s) - 0.337 - b * (y3 * c + y4 * s) - e * (y6 * s - y5 * c),
    ]
}

fn large() -> Vec<Problem> {
    let p = Problem::new;
    vec![
        p("HS 86", &[0.0, 0.0, 0.0, 0.0, 1.0], &[POSITIVE; 5], &[POSITIVE; 10], -32.3486789716, colville),
        {
            let mut start = [1e-3; 15];
            start[6] = 60.0;
            p("HS 117", &start, &[POSITIVE; 15], &[POSITIVE; 5], 32.3486789791, colville_dual)
        },
        p("HS 99", &[0.5; 7], &[(0.0, 1.58); 7], &[ZERO; 2], -831079891.516, |x| {
            let thrust = [50.0, 50.0, 75.0, 75.0, 75.0, 100.0, 100.0];
            let times = [0.0, 25.0, 50.0, 100.0, 150.0, 200.0, 290.0, 380.0];
            let (mut height, mut speed, mut rise) = (d(0.0), d(0.0), d(0.0));
            for i in 0..7 {
                let step = times[i + 1] - times[i];
                let (up, along) = (x[i].sin() * thrust[i] - 32.0, x[i].cos() * thrust[i]);
                height += up * (0.5 * step * step) + rise * step;
                rise += up * step;
                speed += along * step;
            }
            vec![-speed * speed, height - 1e5, rise - 1e3]
        }),
        p(
            "HS 104",
            &[6.0, 3.0, 0.4, 0.2, 6.0, 6.0, 1.0, 0.5],
            &[(0.1, 10.0); 8],
            &[POSITIVE, POSITIVE, POSITIVE, POSITIVE, (1.0, 4.2)],
            3.95116343955,
            |x| {
                let cost = ((x[0] / x[6]).powf(0.67) + (x[1] / x[7]).powf(0.67)) * 0.4 - x[0] - x[1] + 10.0;
                let row = |i: usize| {
                    -(x[i] * 4.0 + x[i].powf(-0.71) * 2.0) / x[i + 2] - x[i].powf(-1.3) * x[i + 4] * 0.0588
                        + 1.0
                };
                vec![
                    cost,
                    -x[4] * x[6] * 0.0588 - x[0] * 0.1 + 1.0,
                    -x[5] * x[7] * 0.0588 - x[0] * 0.1 - x[1] * 0.1 + 1.0,
                    row(2),
                    row(3),
                    cost,
                ]
            },
        ),
        p(
            "HS 105",
            &[0.1, 0.2, 100.0, 125.0, 175.0, 11.2, 13.2, 15.8],
            &[
                (1e-3, 0.499),
                (1e-3, 0.499),
                (100.0, 180.0),
                (130.0, 210.0),
                (170.0, 240.0),
                (5.0, 25.0),
                (5.0, 25.0),
                (5.0, 25.0),
            ],
            &[POSITIVE],
            1138.41623960,
            |x| {
                let counts = [
                    (95.0, 1.0),
                    (105.0, 1.0),
                    (110.0, 4.0),
                    (115.0, 4.0),
                    (120.0, 15.0),
                    (125.0, 15.0),
                    (130.0, 15.0),
                    (135.0, 13.0),
                    (140.0, 21.0),
                    (145.0, 12.0),
                    (150.0, 17.0),
                    (155.0, 4.0),
                    (160.0, 20.0),
                    (165.0, 8.0),
                    (170.0, 17.0),
                    (175.0, 8.0),
                    (180.0, 6.0),
                    (185.0, 6.0),
                    (190.0, 7.0),
                    (195.0, 4.0),
                    (200.0, 3.0),
                    (205.0, 3.0),
                    (210.0, 8.0),
                    (215.0, 1.0),
                    (220.0, 6.0),
                    (230.0, 5.0),
                    (235.0, 1.0),
                    (240.0, 7.0),
                    (245.0, 1.0),
                    (260.0, 2.0),
                ];
                let rest = -x[0] - x[1] + 1.0;
                let bell = |share: D, mean: D, width: D, y: f64| {
                    share / width * (-(mean - y).powi(2) / (width * width * 2.0)).exp()
                };
                let root = (2.0 * std::f64::consts::PI).sqrt();
                let cost = counts.iter().fold(d(0.0), |s, &(y, count)| {
                    let density =
                        bell(x[0], x[2], x[5], y) + bell(x[1], x[3], x[6], y) + bell(rest, x[4], x[7], y);
                    s - (density / root).ln() * count
                });
                vec![cost, rest]
            },
        ),
        p(
            "HS 106",
            &[5000.0, 5000.0, 5000.0, 200.0, 350.0, 150.0, 225.0, 425.0],
            &[
                (100.0, 1e4),
                (1e3, 1e4),
                (1e3, 1e4),
                (10.0, 1e3),
                (10.0, 1e3),
                (10.0, 1e3),
                (10.0, 1e3),
                (10.0, 1e3),
            ],
            &[POSITIVE; 6],
            7049.2480,
            |x| {
                vec![
                    sum(&x[..3]),
                    -(x[3] + x[5]) * 2.5e-3 + 1.0,
                    -(x[4] + x[6] - x[3]) * 2.5e-3 + 1.0,
                    -(x[7] - x[4]) * 0.01 + 1.0,
                    x[0] * x[5] - x[3] * 833.33252 - x[0] * 100.0 + 83333.333,
                    x[1] * x[6] - x[4] * 1250.0 - x[1] * x[3] + x[3] * 1250.0,
                    x[2] * x[7] - 1.25e6 - x[2] * x[4] + x[4] * 2500.0,
                ]
            },
        ),
        p(
            "HS 107",
            &[0.8, 0.8, 0.2, 0.2, 1.0454, 1.0454, 1.0454, 0.0, 0.0],
            &[
                POSITIVE,
                POSITIVE,
                FREE,
                FREE,
                (0.90909, 1.0909),
                (0.90909, 1.0909),
                (0.90909, 1.0909),
                FREE,
                FREE,
            ],
            &[ZERO; 6],
            5055.01180339,
            power_flow,
        ),
        p(
            "HS 108",
            &[1.0; 9],
            &[FREE, FREE, FREE, FREE, FREE, FREE, FREE, FREE, POSITIVE],
            &[POSITIVE; 13],
            -0.866025403784,
            |x| {
                let disc = |a: D, b: D| -a * a - b * b + 1.0;
                vec![
                    (x[0] * x[3] - x[1] * x[2] + x[2] * x[8] - x[4] * x[8] + x[4] * x[7] - x[5] * x[6])
                        * -0.5,
                    disc(x[2], x[3]),
                    disc(x[8], d(0.0)),
                    disc(x[4], x[5]),
                    disc(x[0], x[1] - x[8]),
                    disc(x[0] - x[4], x[1] - x[5]),
                    disc(x[0] - x[6], x[1] - x[7]),
                    disc(x[2] - x[4], x[3] - x[5]),
                    disc(x[2] - x[6], x[3] - x[7]),
                    disc(x[6], x[7] - x[8]),
                    x[0] * x[3] - x[1] * x[2],
                    x[2] * x[8],
                    -x[4] * x[8],
                    x[4] * x[7] - x[5] * x[6],
                ]
            },
        ),
        p("HS 110", &[9.0; 10], &[(2.001, 9.999); 10], &[], -45.7784697153, |x| {
            let logs = x.iter().fold(d(0.0), |s, x| s + (*x - 2.0).ln().powi(2) + (-*x + 10.0).ln().powi(2));
            vec![logs - product(x).powf(0.2)]
        }),
        p("HS 111", &[-2.3; 10], &[(-100.0, 100.0); 10], &[ZERO; 3], -47.7610908594, |x| {
            equilibrium(&x.iter().map(|x| x.exp()).collect::<Vec<_>>())
        }),
        p("HS 112", &[0.1; 10], &[(1e-6, INF); 10], &[ZERO; 3], -47.7610908594, equilibrium),
        p(
            "HS 113",
            &[2.0, 3.0, 5.0, 5.0, 1.0, 2.0, 7.0, 3.0, 6.0, 10.0],
            &[],
            &[POSITIVE; 8],
            24.3062090641,
            |x| {
                vec![
                    x[0] * x[0] + x[1] * x[1] + x[0] * x[1] - x[0] * 14.0 - x[1] * 16.0
                        + (x[2] - 10.0).powi(2)
                        + (x[3] - 5.0).powi(2) * 4.0
                        + (x[4] - 3.0).powi(2)
                        + (x[5] - 1.0).powi(2) * 2.0
                        + x[6] * x[6] * 5.0
                        + (x[7] - 11.0).powi(2) * 7.0
                        + (x[8] - 10.0).powi(2) * 2.0
                        + (x[9] - 7.0).powi(2)
                        + 45.0,
                    x[0] * -4.0 - x[1] * 5.0 + x[6] * 3.0 - x[7] * 9.0 + 105.0,
                    x[0] * -10.0 + x[1] * 8.0 + x[6] * 17.0 - x[7] * 2.0,
                    x[0] * 8.0 - x[1] * 2.0 - x[8] * 5.0 + x[9] * 2.0 + 12.0,
                    (x[0] - 2.0).powi(2) * -3.0 - (x[1] - 3.0).powi(2) * 4.0 - x[2] * x[2] * 2.0
                        + x[3] * 7.0
                        + 120.0,
                    x[0] * x[0] * -5.0 - x[1] * 8.0 - (x[2] - 6.0).powi(2) + x[3] * 2.0 + 40.0,
                    (x[0] - 8.0).powi(2) * -0.5 - (x[1] - 4.0).powi(2) * 2.0 - x[4] * x[4] * 3.0
                        + x[5]
                        + 30.0,
                    -x[0] * x[0] - (x[1] - 2.0).powi(2) * 2.0 + x[0] * x[1] * 2.0 - x[4] * 14.0 + x[5] * 6.0,
                    x[0] * 3.0 - x[1] * 6.0 - (x[8] - 8.0).powi(2) * 12.0 + x[9] * 7.0,
                ]
            },
        ),
        p(
            "HS 114",
            &[1745.0, 12000.0, 110.0, 3048.0, 1974.0, 89.2, 92.8, 8.0, 3.6, 145.0],
            &[
                (1e-5, 2000.0),
                (1e-5, 16000.0),
                (1e-5, 120.0),
                (1e-5, 5000.0),
                (1e-5, 2000.0),
                (85.0, 93.0),
                (90.0, 95.0),
                (3.0, 12.0),
                (1.2, 4.0),
                (145.0, 162.0),
            ],
            &[
                POSITIVE, POSITIVE, POSITIVE, POSITIVE, POSITIVE, POSITIVE, POSITIVE, POSITIVE, ZERO, ZERO,
                ZERO,
            ],
            -1768.80696344,
            |x| {
                let yields = x[0] * 1.12 + x[0] * x[7] * 0.13167 - x[0] * x[7] * x[7] * 6.67e-3;
                let octane = x[7] * 1.098 - x[7] * x[7] * 0.038 + x[5] * 0.325 + 57.425;
                vec![
                    x[0] * 5.04 + x[1] * 0.035 + x[2] * 10.0 + x[4] * 3.36 - x[3] * x[6] * 0.063,
                    x[9] * -0.222 - x[8] * 0.9 + 35.82,
                    x[6] * 3.0 - x[9] * 0.99 - 133.0,
                    x[9] * 0.222 + x[8] * (10.0 / 9.0) - 35.82,
                    x[6] * -3.0 + x[9] / 0.99 + 133.0,
                    yields - x[3] * 0.99,
                    octane - x[6] * 0.99,
                    x[3] / 0.99 - yields,
                    x[6] / 0.99 - octane,
                    x[3] * 1.22 - x[0] - x[4],
                    x[2] * 98000.0 / (x[3] * x[8] + x[2] * 1000.0) - x[5],
                    (x[1] + x[4]) / x[0] - x[7],
                ]
            },
        ),
        {
            let mut start = [20.0; 15];
            for (i, value) in [(1, 55.0), (2, 15.0), (4, 60.0), (7, 60.0), (10, 60.0), (13, 60.0)] {
                start[i] = value;
            }
            let mut bounds = vec![(8.0, 21.0), (43.0, 57.0), (3.0, 16.0)];
            (0..4).for_each(|_| bounds.extend([(0.0, 90.0), (0.0, 120.0), (0.0, 60.0)]));
            let mut rows = Vec::new();
            (0..4).for_each(|_| rows.extend([(-7.0, 6.0), (-7.0, 7.0), (-7.0, 6.0)]));
            rows.extend([60.0, 50.0, 70.0, 85.0, 100.0].map(|low| (low, INF)));
            p("HS 118", &start, &bounds, &rows, 664.820449993, |x| {
                let cost = x.chunks(3).fold(d(0.0), |s, x| {
                    s + dot(&[2.3, 1.7, 2.2], x) + (x[0] * x[0] + x[1] * x[1]) * 1e-4 + x[2] * x[2] * 1.5e-4
                });
                let mut all = vec![cost];
                all.extend((0..12).map(|i| x[i + 3] - x[i]));
                all.extend(x.chunks(3).map(sum));
                all
            })
        },
        p("HS 119", &[10.0; 16], &[(0.0, 5.0); 16], &[ZERO; 8], 244.899697515, |x| {
            let pairs = [
                (1, 4),
                (1, 7),
                (1, 8),
                (1, 16),
                (2, 3),
                (2, 7),
                (2, 10),
                (3, 7),
                (3, 9),
                (3, 10),
                (3, 14),
                (4, 7),
                (4, 11),
                (4, 15),
                (5, 6),
                (5, 10),
                (5, 12),
                (5, 16),
                (6, 8),
                (6, 15),
                (7, 11),
                (7, 13),
                (8, 10),
                (8, 15),
                (9, 12),
                (9, 16),
                (10, 14),
                (11, 13),
                (12, 14),
                (13, 14),
            ];
            let rows: [([f64; 8], f64); 8] = [
                ([0.22, 0.2, 0.19, 0.25, 0.15, 0.11, 0.12, 0.13], 2.5),
                ([-1.46, 0.0, -1.3, 1.82, -1.15, 0.0, 0.8, 0.0], 1.1),
                ([1.29, -0.89, 0.0, 0.0, -1.16, -0.96, 0.0, -0.49], -3.1),
                ([-1.1, -1.06, 0.95, -0.54, 0.0, -1.78, -0.41, 0.0], -3.5),
                ([0.0, 0.0, 0.0, -1.43, 1.51, 0.59, -0.33, -0.43], 1.3),
                ([0.0, -1.72, -0.33, 0.0, 1.62, 1.24, 0.21, -0.26], 2.1),
                ([1.12, 0.0, 0.0, 0.31, 0.0, 0.0, 1.12, 0.0], 2.3),
                ([0.0, 0.45, 0.26, -1.1, 0.58, 0.0, -1.03, 0.1], -1.5),
            ];
            let t: Vec<D> = x.iter().map(|x| *x * *x + *x + 1.0).collect();
            let squares = t.iter().fold(d(0.0), |s, t| s + *t * *t);
            let mut all = vec![pairs.iter().fold(squares, |s, (i, j)| s + t[i - 1] * t[j - 1])];
            for (k, (row, c)) in rows.iter().enumerate() {
                let more = if k == 6 { x[8] * -0.36 } else { d(0.0) };
                all.push(dot(row, &x[..8]) + more + x[8 + k] - *c);
            }
            all
        }),
        {
            let upper = [1.0, 1.0, 1.0, 0.1, 0.9, 0.9, 1e3, 1e3, 1e3, 500.0, 150.0, 150.0, 150.0];
            let lower = [0.1, 0.1, 0.1, 1e-4, 0.1, 0.1, 0.1, 0.1, 500.0, 0.1, 1.0, 1e-4, 1e-4];
            let bounds: Vec<(f64, f64)> = lower.into_iter().zip(upper).collect();
            let start = [0.5, 0.8, 0.9, 0.1, 0.14, 0.5, 489.0, 80.0, 650.0, 450.0, 150.0, 150.0, 150.0];
            let mut rows = vec![POSITIVE; 14];
            rows[3] = (50.0, 250.0);
            p("HS 116", &start, &bounds, &rows, 97.5884089805, |x| {
                let cost = sum(&x[10..]);
                let loss =
                    |i: usize, j: usize| x[j] - x[i] * 0.03475 - x[i] * x[j] * 0.975 + x[i] * x[i] * 9.75e-3;
                let power = |i: usize, j: usize, k: usize| x[i] - x[j] * 1.262626 + x[k] * x[j] * 1.231059;
                vec![
                    cost,
                    x[2] - x[1],
                    x[1] - x[0],
                    (x[6] - x[7]) * -2e-3 + 1.0,
                    cost,
                    power(12, 9, 2),
                    loss(1, 4),
                    loss(2, 5),
                    x[4] * x[6] - x[0] * x[7] - x[3] * x[6] + x[3] * x[7],
                    (x[1] * x[8] + x[4] * x[7] - x[0] * x[7] - x[5] * x[8]) * -2e-3 - x[5] - x[4] + 1.0,
                    x[1] * x[8] - x[2] * x[9] - x[5] * x[8] - (x[1] - x[5]) * 500.0 + x[1] * x[9],
                    x[1] - (x[1] * x[9] - x[2] * x[9]) * 2e-3 - 0.9,
                    loss(0, 3),
                    power(10, 7, 0),
                    power(11, 8, 1),
                ]
            })
        },
    ]
}

fn families() -> Vec<Problem> {
    vec![
        generators("HS 74", 0.55, 5126.49810934),
        generators("HS 75", 0.48, 5174.41288686),
        blends("HS 95", [4.97, -1.88, -29.08, -78.02], 0.0156195144282),
        blends("HS 96", [4.97, -1.88, -69.08, -118.02], 0.0156195144282),
        blends("HS 97", [32.97, 25.12, -29.08, -78.02], 3.1358089),
        blends("HS 98", [32.97, 25.12, -124.08, -173.02], 3.1358089),
    ]
}

pub(crate) fn all() -> Vec<Problem> {
    [published(), small(), families(), heat_exchangers(), large()].concat()
}

/// Other values that are right: local minima that lie nearer to the start, and optima that the publications print otherwise.
/// IPOPT 3.14 finds those of HS 2, 44, 55, 59, 105 and 116 for the same formulas, from the same starts.
const OTHERS: [(&str, f64); 10] = [
    ("HS 2", 4.941229318),
    ("HS 16", 23.14466094),
    ("HS 44", -13.0),
    ("HS 55", 20.0 / 3.0),
    // the digits of the formula are those of 2010, of the optimum those of 1981
    ("HS 59", -7.804235951),
    ("HS 59", -6.754566019),
    ("HS 97", 4.071246372),
    // 1138.41624 cuts off the tails of the distributions; 1151.48 is a local minimum
    ("HS 105", 1138.410663672),
    ("HS 105", 1151.482633),
    ("HS 108", -0.6749814276),
];
/// 97.5884089805 in the publication, which leaves x₉ off its bound.
const HS_116: f64 = 97.58750956;

/// Indices of the problems that a solver does not solve.
fn failures(solver: &dyn NlpSolver) -> Vec<usize> {
    let mut failures = Vec::new();
    let mut steps = 0;
    let problems = all();
    for (k, problem) in problems.iter().enumerate() {
        let report = solve(solver, problem);
        let others = OTHERS.iter().chain([&("HS 116", HS_116)]);
        let known = others.filter(|(name, _)| *name == problem.name).map(|(_, value)| *value);
        let error = known
            .chain([problem.optimum])
            .fold(f64::INFINITY, |e, optimum| e.min((report.cost - optimum).abs() / optimum.abs().max(1.0)));
        let residuals = kkt(problem, &report);
        println!(
            "{:20} {:?} {:.12e} error {error:.1e} kkt {residuals:?} {}",
            problem.name, report.status, report.cost, report.iterations
        );
        steps += report.iterations;
        let is_solved = report.status == Status::Converged;
        if !is_solved || error > 1e-6 {
            failures.push(k);
        }
        let size =
            report.constraint_multipliers.iter().fold(problem.optimum.abs().max(1.0), |s, y| s.max(y.abs()));
        assert!(!is_solved || residuals.iter().all(|r| *r <= 1e-6 * size), "{} {residuals:?}", problem.name);
    }
    println!("{} problems, {steps} steps", problems.len());
    assert!(problems.len() >= 100);
    failures
}

fn names(failures: &[usize]) -> Vec<&'static str> {
    failures.iter().map(|k| all()[*k].name).collect()
}

#[test]
fn the_interior_point_method_reaches_published_optima() {
    let found = failures(&InteriorPoint::default());
    assert!(found.is_empty(), "{:?}", names(&found));
}

#[test]
fn sequential_quadratic_programming_reaches_published_optima_with_one_globalisation_or_the_other() {
    let merit = failures(&Sqp::default());
    let filtered = Sqp { globalisation: Globalisation::Filter, ..Sqp::default() };
    let filter = failures(&filtered);
    let crossed = failures(&Sqp { crossover: true, ..filtered });
    println!("merit function: not {:?}; filter: not {:?}", names(&merit), names(&filter));
    println!("crossover: not {:?}", names(&crossed));
    assert!(merit.iter().all(|k| !filter.contains(k)), "{:?} {:?}", names(&merit), names(&filter));
    assert!(merit.len() <= 2 && filter.len() <= 2, "{:?} {:?}", names(&merit), names(&filter));
    assert!(crossed.len() <= 1, "{:?}", names(&crossed));
}
