//! The cart-pendulum problem: its three forms and their derivatives.

use crate::systems::scattered;
use num_dual::HyperDual64;
use somersault_core::Scalar;
use somersault_multibody::joint_motion::JointMotionError;
use somersault_multibody::models::CartPendulum;
use somersault_nlp::{Flow, Nlp, NlpSolver, Pattern, Sqp, Status};
use somersault_ocp::OcpError;
use somersault_ocp::shooting::Scheme;
use somersault_ocp::swing_up::CartPendulumProblem;
use std::f64::consts::PI;
use std::ops::Range;

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
fn fast_and_composed_forms_have_the_same_cost_and_gradient() {
    for scheme in [Scheme::ExplicitEuler, Scheme::RungeKutta4] {
        for problem in
            [open(scheme), CartPendulumProblem { scheme, ..CartPendulumProblem::with_parameters(15) }]
        {
            let z = scattered(problem.n_coefficients - 2, 4.0);
            let (cost, fast) = gradient(&mut problem.single_shooting().unwrap(), &z);
            let (expected, composed) = gradient(&mut problem.motion_problem().unwrap(), &z);
            assert!((cost - expected).abs() < 1e-12 * expected, "{cost} {expected}");
            let scale = composed.iter().fold(1.0_f64, |s, g| s.max(g.abs()));
            for (a, b) in fast.iter().zip(&composed) {
                assert!((a - b).abs() < 1e-12 * scale, "{scheme:?}: {a} {b}");
            }
        }
    }
}

/// r, ṙ or r̈ at a time, over any scalar.
fn cart<T: Scalar>(problem: &CartPendulumProblem, parameters: &[T], t: f64, derivative: usize) -> T {
    let number = |x: f64| nalgebra::convert::<f64, T>(x);
    let motion = problem.motion().unwrap();
    let mut coefficients: Vec<T> = motion.offset().iter().map(|x| number(*x)).collect();
    for (coefficient, parameter, factor) in motion.dependences() {
        coefficients[coefficient] += parameters[parameter] * number(factor);
    }
    let mut values = [0.0; 6];
    let first = motion.basis().evaluate(t / problem.duration, derivative, &mut values);
    let scale = problem.duration.powi(derivative as i32);
    (0..6).fold(T::zero(), |s, i| s + coefficients[first + i] * number(values[i] / scale))
}

/// ½ (x − x_f)ᵀ diag(w) (x − x_f), and x − x_f.
fn distance<T: Scalar>(
    problem: &CartPendulumProblem,
    parameters: &[T],
    weights: [f64; 4],
    t: f64,
    [x, v]: [T; 2],
) -> (T, [T; 4]) {
    let number = |x: f64| nalgebra::convert::<f64, T>(x);
    let state = [x, cart(problem, parameters, t, 0), v, cart(problem, parameters, t, 1)];
    let apart: [T; 4] = std::array::from_fn(|i| state[i] - number(problem.target[i]));
    ((0..4).fold(T::zero(), |s, i| s + apart[i] * apart[i] * number(0.5 * weights[i])), apart)
}

/// What is paid during `steps` and the state at their end, written anew over any scalar.
fn integrate<T: Scalar>(
    problem: &CartPendulumProblem,
    parameters: &[T],
    steps: Range<usize>,
    [mut x, mut v]: [T; 2],
) -> (T, [T; 2]) {
    let number = |x: f64| nalgebra::convert::<f64, T>(x);
    let cart = |t: f64| cart(problem, parameters, t, 2);
    let CartPendulum { cart_mass, mass, length, gravity } = problem.system;
    let acceleration = |x: T, push: T| (push * x.cos() + x.sin() * number(gravity)) / number(length);
    let n = problem.n_steps;
    let h = problem.duration / n as f64;
    let euler = problem.scheme == Scheme::ExplicitEuler;
    let mut sum = T::zero();
    for k in steps.start..=steps.end {
        if k == steps.end && k < n {
            break;
        }
        let t = k as f64 * h;
        let push = cart(t);
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
        let (running, _) = distance(problem, parameters, problem.running_weights, t, [x, v]);
        sum += (force + running) * number(weight * h);
        if k == n {
            break;
        }
        let half = number(h / 2.0);
        if euler {
            (x, v) = (x + v * number(h), v + a * number(h));
            continue;
        }
        let (x2, v2) = (x + v * half, v + a * half);
        let a2 = acceleration(x2, cart(t + h / 2.0));
        let (x3, v3) = (x + v2 * half, v + a2 * half);
        let a3 = acceleration(x3, cart(t + h / 2.0));
        let (x4, v4) = (x + v3 * number(h), v + a3 * number(h));
        let a4 = acceleration(x4, cart(t + h));
        let sixth = number(h / 6.0);
        let two = number(2.0);
        (x, v) = (x + (v + (v2 + v3) * two + v4) * sixth, v + (a + (a2 + a3) * two + a4) * sixth);
    }
    (sum, [x, v])
}

fn start_of<T: Scalar>(problem: &CartPendulumProblem) -> [T; 2] {
    [problem.start[0], problem.start[2]].map(nalgebra::convert)
}

fn cost<T: Scalar>(problem: &CartPendulumProblem, z: &[T]) -> T {
    let (sum, end) = integrate(problem, z, 0..problem.n_steps, start_of(problem));
    sum + distance(problem, z, problem.terminal_weights, problem.duration, end).0
}

/// Cost and constraints of the lifted form.
fn lifted<T: Scalar>(problem: &CartPendulumProblem, n_parameters: usize, z: &[T]) -> (T, Vec<T>) {
    let (parameters, s) = z.split_at(n_parameters);
    let n_segments = (s.len() - 4) / 2 + 1;
    let (mut cost, mut state, mut ends) = (T::zero(), start_of(problem), Vec::new());
    for k in 0..n_segments {
        let steps = k * problem.n_steps / n_segments..(k + 1) * problem.n_steps / n_segments;
        let (paid, end) = integrate(problem, parameters, steps, state);
        cost += paid;
        ends.extend(end);
        state = [s[2 * k], s[2 * k + 1]];
    }
    let (_, [angle, r, rate, r_rate]) = distance(
        problem,
        parameters,
        [0.0; 4],
        problem.duration,
        [ends[2 * n_segments - 2], ends[2 * n_segments - 1]],
    );
    ends.truncate(2 * n_segments - 2);
    ends.extend([angle, rate, r, r_rate]);
    let [a, b, c, d] = problem.terminal_weights;
    for (error, weight) in s[s.len() - 4..].iter().zip([a, c, b, d]) {
        cost += *error * *error * nalgebra::convert::<f64, T>(0.5 * weight);
    }
    (cost, ends.iter().zip(s).map(|(end, s)| *end - *s).collect())
}

fn seeded(z: &[f64], i: usize, j: usize) -> Vec<HyperDual64> {
    let along = |m: usize, n: usize| f64::from(u8::from(m == n));
    z.iter().enumerate().map(|(m, z)| HyperDual64::new(*z, along(m, i), along(m, j), 0.0)).collect()
}

fn assert_near(found: f64, expected: f64, what: &str) {
    assert!((found - expected).abs() < 1e-11 * (1.0 + expected.abs()), "{what}: {found} {expected}");
}

#[test]
fn the_hessian_is_exact() {
    for scheme in [Scheme::ExplicitEuler, Scheme::RungeKutta4] {
        let problem = open(scheme);
        let mut nlp = problem.single_shooting().unwrap();
        // twice, since the second must not see what the first left
        for seed in [1.0, 7.0] {
            let z = scattered(10, seed);
            let (value, gradient) = gradient(&mut nlp, &z);
            let mut hessian = vec![0.0; 55];
            nlp.hessian(&z, 2.0, &[], &mut hessian).unwrap();
            let pattern = nlp.structure().hessian.clone();
            for (k, i, j) in pattern.entries() {
                let expected = cost(&problem, &seeded(&z, i, j));
                assert_near(value, expected.re, "cost");
                assert_near(gradient[i], expected.eps1, "gradient");
                assert_near(hessian[k] / 2.0, expected.eps1eps2, "Hessian");
            }
        }
    }
}

#[test]
fn derivatives_of_the_lifted_form_are_exact() {
    for scheme in [Scheme::ExplicitEuler, Scheme::RungeKutta4] {
        let problem = open(scheme);
        let mut nlp = problem.swing_up().unwrap();
        let structure = nlp.structure().clone();
        let (n, m) = (structure.variables.len(), structure.constraints.len());
        assert_eq!((n, m), (10 + 12, 12), "five segments");
        for seed in [1.0, 7.0] {
            let (z, y) = (scattered(n, seed), scattered(m, seed + 3.0));
            let mut constraints = vec![0.0; m];
            let value = nlp.evaluate(&z, &mut constraints).unwrap();
            let (mut gradient, mut jacobian) = (vec![0.0; n], vec![0.0; structure.jacobian.n_entries()]);
            nlp.differentiate(&z, &mut gradient, &mut jacobian).unwrap();
            let mut hessian = vec![0.0; structure.hessian.n_entries()];
            nlp.hessian(&z, 2.0, &y, &mut hessian).unwrap();
            let entry = |pattern: &Pattern, values: &[f64], i, j| pattern.value(values, i, j);
            for j in 0..n {
                for i in 0..=j {
                    let (expected, rows) = lifted(&problem, 10, &seeded(&z, i, j));
                    assert_near(value, expected.re, "cost");
                    assert_near(gradient[j], expected.eps2, "gradient");
                    let mut lagrangian = 2.0 * expected.eps1eps2;
                    for (k, row) in rows.iter().enumerate() {
                        assert_near(constraints[k], row.re, "constraint");
                        assert_near(entry(&structure.jacobian, &jacobian, k, j), row.eps2, "Jacobian");
                        lagrangian += y[k] * row.eps1eps2;
                    }
                    assert_near(entry(&structure.hessian, &hessian, i, j), lagrangian, "Hessian");
                }
            }
        }
    }
}

#[test]
fn a_start_on_its_motion_has_no_gaps_and_the_cost_of_the_motion() {
    let problem = open(Scheme::RungeKutta4);
    let mut nlp = problem.swing_up().unwrap();
    let parameters = scattered(10, 2.0);
    let start = nlp.start_on_motion(&parameters).unwrap();
    let mut gaps = vec![0.0; nlp.structure().constraints.len()];
    let lifted = nlp.evaluate(&start.z, &mut gaps).unwrap();
    assert!(gaps.iter().all(|gap| gap.abs() < 1e-14), "{gaps:?}");
    let (single, _) = gradient(&mut problem.single_shooting().unwrap(), &parameters);
    assert!((lifted - single).abs() < 1e-13 * single, "{lifted} {single}");
}

/// Other cart-pendulums than the thesis', integrated accurately, fifteen parameters.
fn others() -> Vec<(&'static str, CartPendulumProblem)> {
    let base =
        CartPendulumProblem { scheme: Scheme::RungeKutta4, ..CartPendulumProblem::with_parameters(15) };
    let system = |change: fn(&mut CartPendulum)| {
        let mut problem = base.clone();
        change(&mut problem.system);
        problem
    };
    vec![
        ("to 2π", CartPendulumProblem { target: [2.0 * PI, 0.0, 0.0, 0.0], ..base.clone() }),
        ("0.5 m", system(|s| s.length = 0.5)),
        ("0.2 m", system(|s| s.length = 0.2)),
        ("5 m", system(|s| s.length = 5.0)),
        ("on the Moon", system(|s| s.gravity = 1.62)),
        ("no gravity", system(|s| s.gravity = 0.0)),
        ("light cart", system(|s| s.cart_mass = 0.5)),
        ("heavy pendulum", system(|s| s.mass = 10.0)),
        ("1 s", CartPendulumProblem { duration: 1.0, n_steps: 100, ..base.clone() }),
        ("4 s", CartPendulumProblem { duration: 4.0, n_steps: 400, n_coefficients: 27, ..base.clone() }),
        ("20 steps", CartPendulumProblem { n_steps: 20, ..base.clone() }),
        ("one step", CartPendulumProblem { n_steps: 1, n_coefficients: 7, ..base.clone() }),
        ("on its way", CartPendulumProblem { start: [3.1, -1.0, 5.0, -2.0], ..base.clone() }),
        ("ten metres", CartPendulumProblem { start: [PI, -10.0, 0.0, 0.0], ..base.clone() }),
        ("soft", CartPendulumProblem { terminal_weights: [1e2; 4], ..base.clone() }),
        ("hard", CartPendulumProblem { terminal_weights: [1e8; 4], ..base.clone() }),
        ("running cost", CartPendulumProblem { running_weights: [10.0; 4], ..base.clone() }),
    ]
}

#[test]
fn other_cart_pendulums_are_solved_from_straight_lines() {
    for (name, problem) in others() {
        let mut nlp = problem.swing_up().unwrap();
        let start = nlp.start(&nlp.straight_line()).unwrap();
        let report = Sqp::default().solve(&mut nlp, &start, &mut |_| Flow::Continue).unwrap();
        let parameters = &report.z[..nlp.n_parameters()];
        let (single, _) = gradient(&mut problem.single_shooting().unwrap(), parameters);
        println!("{name}: {:.4} {} steps: {}", report.cost, report.iterations, report.status);
        assert_eq!(report.status, Status::Converged, "{name}");
        assert!((single - report.cost).abs() < 1e-6 * (1.0 + single), "{name}: {single} {}", report.cost);
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
    assert!(matches!(fast, Err(OcpError::Motion(JointMotionError::Spline(_)))), "{fast:?}");
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
    let mut nlp = CartPendulumProblem::default().swing_up().unwrap();
    for (found, name) in [
        (nlp.start(&[0.0; 4]).err(), "parameters"),
        (nlp.start_on_motion(&[0.0; 6]).err(), "parameters"),
        (nlp.starts(3, -1.0, 0).err(), "reach"),
        (nlp.starts(3, f64::NAN, 0).err(), "reach"),
    ] {
        assert!(found.unwrap().to_string().contains(name));
    }
}
