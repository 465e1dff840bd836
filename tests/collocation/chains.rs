//! Chains of driven hinges, from rest to rest in a second, by both solvers of nonlinear programs.

use nalgebra::Vector3;
use somersault_core::Scalar;
use somersault_multibody::{Joint, Link, MassProperties, Model, ModelBuilder};
use somersault_nlp::{Flow, Globalisation, InteriorPoint, NlpSolver, Sqp};
use somersault_ocp::collocation::{
    Collocation, CollocationReport, CollocationStatus, Mesh, Phase, Point, Problem, Terms, TreeDynamics,
};
use std::f64::consts::PI;
use std::time::Instant;

/// ½ ‖u‖².
struct Effort;

impl Terms for Effort {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let half = nalgebra::convert::<f64, T>(0.5);
        at.control.iter().fold(T::zero(), |s, u| s + *u * *u * half)
    }
}

/// Rods of 1 kg, together 1 m long, that hang in line.
fn chain(n: usize) -> Model {
    let length = Vector3::new(0.0, -1.0 / n as f64, 0.0);
    let joint = Joint::Revolute { axis: Vector3::z() };
    let rod = || MassProperties::rod(1.0 / n as f64, Vector3::zeros(), length);
    let mut builder = ModelBuilder::new().with_gravity(Vector3::new(0.0, -9.81, 0.0));
    builder.add(Link::root("0", joint, rod())).unwrap();
    for i in 1..n {
        builder.add(Link::child(i.to_string(), (i - 1).to_string(), joint, rod()).at(length)).unwrap();
    }
    builder.build().unwrap()
}

/// From hanging to a half circle.
fn curled<S: NlpSolver>(n: usize, solver: S) -> CollocationReport {
    let model = chain(n);
    let dynamics = TreeDynamics::try_fully_actuated(&model).unwrap();
    let first = vec![0.0; 2 * n];
    let mut last = vec![PI / n as f64; n];
    last.resize(2 * n, 0.0);
    let phase = Phase::of_tree(dynamics, Effort).initial_state(first).final_state(last).horizon(0.0, 1.0);
    let collocation = Collocation { tolerance: 1e-5, max_meshes: 1, min_points: 3, max_points: 12, solver };
    let mut problem = Problem::try_new(phase).unwrap();
    let began = Instant::now();
    let report = collocation
        .solve(&mut problem, &[Mesh::try_uniform(10, 4).unwrap()], &mut |i| {
            if std::env::var("DBG").is_ok() {
                println!(
                    "{} {:.6e} {:?} {:.1e} {:.1e} {:?}",
                    i.number,
                    i.cost,
                    i.residuals,
                    i.step_length,
                    i.shift,
                    began.elapsed()
                );
            }
            if i.number > 150 { Flow::Stop } else { Flow::Continue }
        })
        .unwrap();
    let steps: Vec<_> = report.history.iter().map(|mesh| (mesh.status, mesh.iterations)).collect();
    println!("{n} hinges: {:?}, cost {:.8}, {:?}, {steps:?}", report.status, report.cost, began.elapsed());
    report
}

#[test]
fn four_hinges_curl_by_either_solver() {
    let sqp = curled(4, Sqp { globalisation: Globalisation::Filter, ..Sqp::default() });
    let interior = curled(4, InteriorPoint::default());
    assert_eq!(sqp.status, CollocationStatus::Converged);
    assert_eq!(interior.status, CollocationStatus::Converged);
    assert!((sqp.cost - interior.cost).abs() < 1e-5 * sqp.cost);
}

#[test]
#[ignore = "long form of four_hinges_curl_by_either_solver: eight and twelve; `make studies` runs it"]
fn eight_and_twelve_hinges_curl() {
    for n in [8, 12] {
        let report = curled(n, InteriorPoint::default());
        assert_eq!(report.status, CollocationStatus::Converged);
        curled(n, Sqp { globalisation: Globalisation::Filter, ..Sqp::default() });
    }
}
