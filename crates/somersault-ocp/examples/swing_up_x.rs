//! x
use somersault_multibody::models::CartPendulum;
use somersault_ocp::nlp::*;
use somersault_ocp::shooting::Scheme;
use somersault_ocp::solver::*;
use somersault_ocp::swing_up::CartPendulumProblem;
use std::time::Instant;

fn sqp(max: usize, mem: usize) -> Sqp {
    Sqp { max_iterations: max, merit_memory: mem, ..Sqp::default() }
}

fn run(name: &str, problem: &CartPendulumProblem, a: &[String]) {
    let mem: usize = a.get(2).map_or(0, |s| s.parse().unwrap());
    let mut least = f64::INFINITY;
    let mut report = None;
    for _ in 0..5 {
        let began = Instant::now();
        let mut nlp = problem.swing_up().unwrap();
        let start = nlp.start(&nlp.straight_line()).unwrap();
        let r = sqp(300, mem).solve(&mut nlp, &start, &mut |_| Flow::Continue).unwrap();
        least = least.min(began.elapsed().as_secs_f64());
        report = Some(r);
    }
    let r = report.unwrap();
    let nlp = problem.swing_up().unwrap();
    let p = nlp.n_parameters();
    let z = r.z[..p].to_vec();
    let mut single = problem.single_shooting().unwrap();
    let cost = single.evaluate(&z, &mut []).unwrap_or(f64::NAN);
    let mut g = vec![0.0; p];
    single.differentiate(&z, &mut g, &mut []).unwrap();
    let gn = g.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    println!(
        "{name} {:.5} single {cost:.5} |g| {gn:.1e} {} it {:.2} ms res {:.1e} {:?} fact {}",
        r.cost,
        r.iterations,
        least * 1e3,
        r.residuals.max(),
        r.status,
        r.counts.factorisations
    );
    if a.len() > 0 {
        let n: usize = a[0].parse().unwrap();
        let reach: f64 = a[1].parse().unwrap();
        let starts = nlp.starts(n, reach, 1).unwrap();
        let began = Instant::now();
        let f = MultiStart::new(sqp(100, mem)).solve(|| nlp.clone(), &starts, || false).unwrap();
        let t = began.elapsed().as_secs_f64();
        print!("   {} minima, failures {}, {:.0} ms: ", f.minima.len(), f.failures.len(), t * 1e3);
        for m in f.minima.iter().take(8) {
            print!(" {:.2}x{}({})", m.report.cost, m.starts.len(), m.report.iterations);
        }
        println!();
    }
}

fn main() {
    let a: Vec<String> = std::env::args().skip(1).collect();
    for (case, p) in [('A', 5), ('B', 10), ('C', 15), ('D', 20), ('E', 30), ('F', 40), ('G', 50)] {
        let e = CartPendulumProblem::with_parameters(p);
        run(&format!("{case}"), &e, &a);
        run(&format!("{case} rk4"), &CartPendulumProblem { scheme: Scheme::RungeKutta4, ..e }, &a);
    }
    let d = CartPendulumProblem { scheme: Scheme::RungeKutta4, ..CartPendulumProblem::with_parameters(15) };
    run("2pi", &CartPendulumProblem { target: [2.0 * std::f64::consts::PI, 0.0, 0.0, 0.0], ..d.clone() }, &a);
    let s = d.system;
    run("short", &CartPendulumProblem { system: CartPendulum { length: 0.5, ..s }, ..d.clone() }, &a);
    run("0.2 m", &CartPendulumProblem { system: CartPendulum { length: 0.2, ..s }, ..d.clone() }, &a);
    run("long", &CartPendulumProblem { system: CartPendulum { length: 5.0, ..s }, ..d.clone() }, &a);
    run("moon", &CartPendulumProblem { system: CartPendulum { gravity: 1.62, ..s }, ..d.clone() }, &a);
    run("no g", &CartPendulumProblem { system: CartPendulum { gravity: 0.0, ..s }, ..d.clone() }, &a);
    run("light cart", &CartPendulumProblem { system: CartPendulum { cart_mass: 0.5, ..s }, ..d.clone() }, &a);
    run("heavy", &CartPendulumProblem { system: CartPendulum { mass: 10.0, ..s }, ..d.clone() }, &a);
    run("4 s", &CartPendulumProblem { duration: 4.0, n_steps: 400, n_coefficients: 27, ..d.clone() }, &a);
    run("8 s", &CartPendulumProblem { duration: 8.0, n_steps: 800, n_coefficients: 52, ..d.clone() }, &a);
    run("1 s", &CartPendulumProblem { duration: 1.0, n_steps: 100, ..d.clone() }, &a);
    run("0.5 s", &CartPendulumProblem { duration: 0.5, n_steps: 50, ..d.clone() }, &a);
    run("20 steps", &CartPendulumProblem { n_steps: 20, ..d.clone() }, &a);
    run("4 steps", &CartPendulumProblem { n_steps: 4, n_coefficients: 7, ..d.clone() }, &a);
    run("1 step", &CartPendulumProblem { n_steps: 1, n_coefficients: 7, ..d.clone() }, &a);
    run(
        "open",
        &CartPendulumProblem {
            start: [2.5, -0.7, 0.4, 0.3],
            target: [0.3, 0.2, -0.1, 0.15],
            duration: 1.3,
            system: CartPendulum { cart_mass: 1.4, mass: 0.7, length: 0.6, gravity: 8.1 },
            terminal_weights: [40.0, 30.0, 20.0, 10.0],
            force_weight: 0.8,
            running_weights: [0.6, 0.5, 0.4, 0.3],
            ..d.clone()
        },
        &a,
    );
    run("running", &CartPendulumProblem { running_weights: [10.0; 4], ..d.clone() }, &a);
    run("no force", &CartPendulumProblem { force_weight: 0.0, running_weights: [1.0; 4], ..d.clone() }, &a);
    run("tiny force", &CartPendulumProblem { force_weight: 1e-4, ..d.clone() }, &a);
    run("weak end", &CartPendulumProblem { terminal_weights: [1e2; 4], ..d.clone() }, &a);
    run("hard end", &CartPendulumProblem { terminal_weights: [1e8; 4], ..d.clone() }, &a);
    run("zero end", &CartPendulumProblem { terminal_weights: [0.0; 4], ..d.clone() }, &a);
    run("balance", &CartPendulumProblem { start: [0.2, -1.0, 0.0, 0.0], ..d.clone() }, &a);
    run("fast", &CartPendulumProblem { start: [3.1, -1.0, 5.0, -2.0], ..d.clone() }, &a);
    run("far", &CartPendulumProblem { start: [3.14159, -10.0, 0.0, 0.0], ..d.clone() }, &a);
}
