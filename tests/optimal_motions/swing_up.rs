//! The cart-pendulum problem: its two forms, its Hessian, and Table A.1.

use crate::systems::scattered;
use num_dual::HyperDual64;
use somersault_multibody::Scalar;
use somersault_multibody::models::CartPendulum;
use somersault_ocp::OcpError;
use somersault_ocp::motion::MotionError;
use somersault_ocp::nlp::Nlp;
use somersault_ocp::shooting::Scheme;
use somersault_ocp::swing_up::CartPendulumProblem;

/// A problem in which nothing is one or zero.
fn open(scheme: Scheme) -> CartPendulumProblem {
    CartPendulumProblem {
        system: CartPendulum { cart_mass: 1.4, mass: 0.7, length: 0.6, gravity: 8.1 },
        start: [2.5, -0.7, 0.4, 0.3],
        target: [0.3, 0.2, -0.1, 0.15],
        duration: 1.3,
        n_steps: 20,
        n_coefficients: 12,
        scheme,
        terminal_weights: [40.0, 30.0, 20.0, 10.0],
        force_weight: 0.8,
        running_weights: [0.6, 0.5, 0.4, 0.3],
    }
}

fn gradient(nlp: &mut impl Nlp, z: &[f64]) -> (f64, Vec<f64>) {
    let cost = nlp.evaluate(z, &mut []).unwrap();
    let mut gradient = vec![0.0; z.len()];
    nlp.differentiate(z, &mut gradient, &mut []).unwrap();
    (cost, gradient)
}

#[test]
fn both_forms_have_the_same_cost_and_gradient() {
    for scheme in [Scheme::ExplicitEuler, Scheme::RungeKutta4] {
        for problem in
            [open(scheme), CartPendulumProblem { scheme, ..CartPendulumProblem::with_parameters(15) }]
        {
            let z = scattered(problem.n_coefficients - 2, 4.0);
            let (cost, fast) = gradient(&mut problem.swing_up().unwrap(), &z);
            let (expected, composed) = gradient(&mut problem.motion_problem().unwrap(), &z);
            assert!((cost - expected).abs() < 1e-12 * expected, "{cost} {expected}");
            let scale = composed.iter().fold(1.0_f64, |s, g| s.max(g.abs()));
            for (a, b) in fast.iter().zip(&composed) {
                assert!((a - b).abs() < 1e-12 * scale, "{scheme:?}: {a} {b}");
            }
        }
    }
}

/// The cost of the problem, written anew over any scalar.
fn cost<T: Scalar>(problem: &CartPendulumProblem, z: &[T]) -> T {
    let number = |x: f64| nalgebra::convert::<f64, T>(x);
    let motion = problem.motion().unwrap();
    let mut coefficients: Vec<T> = motion.offset().iter().map(|x| number(*x)).collect();
    for (coefficient, parameter, factor) in motion.dependences() {
        coefficients[coefficient] += z[parameter] * number(factor);
    }
    let cart = |t: f64, derivative: usize| {
        let mut values = [0.0; 6];
        let first = motion.basis().evaluate(t / problem.duration, derivative, &mut values);
        let scale = problem.duration.powi(derivative as i32);
        (0..6).fold(T::zero(), |s, i| s + coefficients[first + i] * number(values[i] / scale))
    };
    let CartPendulum { cart_mass, mass, length, gravity } = problem.system;
    let acceleration = |x: T, push: T| (push * x.cos() + x.sin() * number(gravity)) / number(length);
    let n = problem.n_steps;
    let h = problem.duration / n as f64;
    let (mut x, mut v) = (number(problem.start[0]), number(problem.start[2]));
    let distance = |weights: [f64; 4], t: f64, x: T, v: T| {
        let apart = [x, cart(t, 0), v, cart(t, 1)];
        (0..4).fold(T::zero(), |s, i| {
            let d = apart[i] - number(problem.target[i]);
            s + d * d * number(0.5 * weights[i])
        })
    };
    let euler = problem.scheme == Scheme::ExplicitEuler;
    let mut sum = T::zero();
    for k in 0..=n {
        let t = k as f64 * h;
        let push = cart(t, 2);
        let a = acceleration(x, push);
        let force = push * number(cart_mass + mass) - (a * x.cos() - v * v * x.sin()) * number(mass * length);
        let weight = match k.min(n - k) {
            _ if euler => f64::from(u8::from(k < n)),
            0 => 3.0 / 8.0,
            1 => 7.0 / 6.0,
            2 => 23.0 / 24.0,
            _ => 1.0,
        };
        let force = force * force * number(0.5 * problem.force_weight);
        sum += (force + distance(problem.running_weights, t, x, v)) * number(weight * h);
        if k == n {
            break;
        }
        let half = number(h / 2.0);
        if euler {
            (x, v) = (x + v * number(h), v + a * number(h));
            continue;
        }
        let (x2, v2) = (x + v * half, v + a * half);
        let a2 = acceleration(x2, cart(t + h / 2.0, 2));
        let (x3, v3) = (x + v2 * half, v + a2 * half);
        let a3 = acceleration(x3, cart(t + h / 2.0, 2));
        let (x4, v4) = (x + v3 * number(h), v + a3 * number(h));
        let a4 = acceleration(x4, cart(t + h, 2));
        let sixth = number(h / 6.0);
        let two = number(2.0);
        (x, v) = (x + (v + (v2 + v3) * two + v4) * sixth, v + (a + (a2 + a3) * two + a4) * sixth);
    }
    sum + distance(problem.terminal_weights, problem.duration, x, v)
}

#[test]
fn the_hessian_is_exact() {
    for scheme in [Scheme::ExplicitEuler, Scheme::RungeKutta4] {
        let problem = open(scheme);
        let mut nlp = problem.swing_up().unwrap();
        // twice, since the second must not see what the first left
        for seed in [1.0, 7.0] {
            let z = scattered(10, seed);
            let (value, gradient) = gradient(&mut nlp, &z);
            let mut hessian = vec![0.0; 55];
            nlp.hessian(&z, 2.0, &[], &mut hessian).unwrap();
            let pattern = nlp.structure().hessian.clone();
            for (k, i, j) in pattern.entries() {
                let seeded: Vec<HyperDual64> = (0..10)
                    .map(|m| {
                        let along = |n: usize| f64::from(u8::from(m == n));
                        HyperDual64::new(z[m], along(i), along(j), 0.0)
                    })
                    .collect();
                let expected = cost(&problem, &seeded);
                assert!((value - expected.re).abs() < 1e-12 * value.abs());
                assert!((gradient[i] - expected.eps1).abs() < 1e-11 * (1.0 + expected.eps1.abs()));
                let (found, expected) = (hessian[k] / 2.0, expected.eps1eps2);
                assert!(
                    (found - expected).abs() < 1e-11 * (1.0 + expected.abs()),
                    "({i}, {j}): {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn bad_numbers_are_named() {
    let with = |change: fn(&mut CartPendulumProblem)| {
        let mut problem = CartPendulumProblem::default();
        change(&mut problem);
        (problem.swing_up().map(|_| ()), problem.motion_problem().map(|_| ()))
    };
    let (fast, composed) = with(|p| p.n_coefficients = 5);
    assert!(matches!(fast, Err(OcpError::Motion(MotionError::Spline(_)))), "{fast:?}");
    assert_eq!(fast, composed);
    type Change = fn(&mut CartPendulumProblem);
    let cases: [(Change, &str); 6] = [
        (|p| p.start[0] = f64::NAN, "start"),
        (|p| p.target[3] = f64::INFINITY, "target"),
        (|p| p.duration = 0.0, "duration"),
        (|p| p.n_steps = 0, "n_steps"),
        (|p| p.force_weight = -1.0, "force_weight"),
        (|p| p.system.length = -1.0, "length"),
    ];
    for (change, name) in cases {
        let (fast, composed) = with(change);
        assert!(fast.unwrap_err().to_string().contains(name));
        assert!(composed.unwrap_err().to_string().contains(name));
    }
}
