use somersault_ocp::dive::Dive;
use somersault_ocp::nlp::Nlp;
use somersault_ocp::solver::{Flow, NlpSolver, Sqp, Start};
use std::time::Instant;

fn check(program: &mut impl Nlp, z: &[f64]) {
    let s = program.structure().clone();
    let (n, m) = (s.variables.len(), s.constraints.len());
    let mut c = vec![0.0; m];
    let mut g = vec![0.0; n];
    let mut j = vec![0.0; s.jacobian.n_entries()];
    program.evaluate(z, &mut c).unwrap();
    program.differentiate(z, &mut g, &mut j).unwrap();
    let mut worst = (0.0f64, 0, 0);
    let mut worst_g = 0.0f64;
    for k in 0..n {
        let h = 1e-6;
        let mut zp = z.to_vec();
        let (mut cp, mut cm) = (c.clone(), c.clone());
        zp[k] += h;
        let fp = program.evaluate(&zp, &mut cp).unwrap();
        zp[k] -= 2.0 * h;
        let fm = program.evaluate(&zp, &mut cm).unwrap();
        worst_g = worst_g.max((g[k] - (fp - fm) / (2.0 * h)).abs());
        for i in 0..m {
            let d = (cp[i] - cm[i]) / (2.0 * h);
            let a = s.jacobian.position(i, k).map_or(0.0, |p| j[p]);
            if (a - d).abs() > worst.0 { worst = ((a - d).abs(), i, k); }
        }
    }
    println!("n {n} m {m} entries {} gradient {worst_g:e} jacobian {worst:?}", j.len());
}

fn main() {
    let which: String = std::env::args().nth(1).unwrap_or("planar".into());
    let (dive, template) = if which == "planar" {
        (Dive::forward_pike().unwrap(), Dive::pike_template())
    } else {
        let mut dive = Dive::forward_twisting();
        dive.clearance = None;
        (dive, Dive::twisting_template())
    };
    let mut program = dive.program().unwrap();
    let z = program.start(&template).unwrap();
    check(&mut program, &z);
    let mut c = vec![0.0; program.structure().constraints.len()];
    let t = Instant::now();
    for _ in 0..10 { program.evaluate(&z, &mut c).unwrap(); }
    println!("evaluate {:?}", t.elapsed() / 10);
    let s = program.structure().clone();
    let mut g = vec![0.0; z.len()];
    let mut j = vec![0.0; s.jacobian.n_entries()];
    let t = Instant::now();
    for _ in 0..10 { program.differentiate(&z, &mut g, &mut j).unwrap(); }
    println!("differentiate {:?}", t.elapsed() / 10);
    println!("L start {}", program.momentum(&z));
    show(&mut program, &z);
    let t = Instant::now();
    let mut z = z;
    let mut hess = Vec::new(); let mut mult = Vec::new();
    for weight in [1.0, 10.0, 100.0, 1000.0] {
        let mut soft = program.softened(weight).unwrap();
        let solver = Sqp { stationarity_tol: 1e-3, max_iterations: 60, ..Sqp::default() };
        let t = Instant::now();
        let report = solver.solve(&mut soft, &Start::from(z), &mut |i| {
            if i.number % 5 == 0 { println!("{} {:.6} {:?} step {:.3} shift {:.1e}", i.number, i.cost, i.residuals.stationarity, i.step_length, i.shift); }
            Flow::Continue
        }).unwrap();
        println!("{:?} {:?} {} it {:?}", t.elapsed(), report.status, report.iterations, report.residuals);
        z = report.z;
        let s = soft.structure().clone();
        let mut c2 = vec![0.0; s.constraints.len()];
        soft.evaluate(&z, &mut c2).unwrap();
        let mut g = vec![0.0; z.len()];
        let mut j = vec![0.0; s.jacobian.n_entries()];
        soft.differentiate(&z, &mut g, &mut j).unwrap();
        hess = vec![0.0; s.hessian.n_entries()];
        soft.hessian(&z, 1.0, &c2, &mut hess).unwrap();
        let hard = program.structure().constraints.clone();
        mult = (0..c2.len()).map(|i| if s.constraints.lower[i].is_finite() || s.constraints.upper[i].is_finite() { report.constraint_multipliers[i] } else { weight * ((c2[i] - hard.upper[i]).max(0.0) + (c2[i] - hard.lower[i]).min(0.0)) }).collect::<Vec<f64>>();
        println!("violation {:?}", mult.iter().rev().take(3).map(|m| m / weight).collect::<Vec<_>>());
        println!("L {}", program.momentum(&z));
    }
    let solver = Sqp { stationarity_tol: 1e-6, max_iterations: 200, hessian: if std::env::args().nth(2).is_some() { somersault_ocp::solver::HessianSource::Offered } else { somersault_ocp::solver::HessianSource::QuasiNewton }, ..Sqp::default() };
    let t = Instant::now();
    let report = solver.solve(&mut program, &Start { z, constraint_multipliers: mult, hessian: Some(hess) }, &mut |i| {
        if i.number % 10 == 0 { println!("{} {:.6} {:.1e} {:.1e} {:.1e} step {:.3} shift {:.1e}", i.number, i.cost, i.residuals.stationarity, i.residuals.feasibility, i.residuals.complementarity, i.step_length, i.shift); }
        Flow::Continue
    }).unwrap();
    println!("{:?} {:?} {} it {:?} {:?}", t.elapsed(), report.status, report.iterations, report.residuals, report.counts);
    println!("L {} cost {}", program.momentum(&report.z), report.cost);
    show(&mut program, &report.z);
}

fn show(program: &mut somersault_ocp::dive::DiveProgram, z: &[f64]) {
    let mut c = vec![0.0; program.structure().constraints.len()];
    program.evaluate(z, &mut c).unwrap();
    let coefficients = program.coefficients(z);
    let motion = program.path().motion();
    let mut w = vec![0.0; motion.n_channels()];
    let n = program.path().n_steps();
    let angles = program.angles();
    for k in 0..=30 {
        let x = k as f64 / 30.0;
        motion.channels_into(&coefficients, x, 0, &mut w);
        let a = angles[k * n / 30];
        println!("{x:.3} {:?} som {:.3} tilt {:.1} twist {:.3}", w.iter().map(|w| (w * 1000.0).round() / 1000.0).collect::<Vec<_>>(), a.somersault / std::f64::consts::TAU, a.tilt.to_degrees(), a.twist / std::f64::consts::TAU);
    }
}
