//! The schemes of shooting have their orders, on the groups of the joints too.

use crate::systems::{floating, scattered, weights};
use somersault_ocp::dynamics::Tree;
use somersault_ocp::shooting::{Drive, Phase, Scheme, Shooting, ShootingOptions, Start};
use somersault_ocp::transcription::Transcription;
use somersault_ocp::verification::verify;

/// The error after 0.8 s of a free body whose limbs move, against an integration of order 8 at 1e-12.
fn error(scheme: Scheme, n_steps: usize) -> f64 {
    let (model, split) = floating();
    let velocity = scattered(model.n_velocities(), 5.0);
    let phase = Phase::new(weights(9), n_steps, 0.8);
    let start = Start::fixed(&model.neutral(), &velocity);
    let options = ShootingOptions { scheme, drive: Drive::Motion };
    let dynamics = Tree::try_new(model.clone(), split).unwrap();
    let mut shooting = Shooting::try_new(dynamics, start, vec![phase], options).unwrap();
    let z: Vec<f64> = scattered(shooting.outline().n_variables(), 1.0).iter().map(|x| 0.3 * x).collect();
    verify(&mut shooting, &model, &z).unwrap().terminal_error
}

fn expect_order(scheme: Scheme, order: f64, n_steps: [usize; 3]) {
    let errors = n_steps.map(|n| error(scheme, n));
    for pair in errors.windows(2) {
        let observed = (pair[0] / pair[1]).log2();
        println!("{scheme:?} {errors:?}: order {observed:.3}");
        assert!((observed - order).abs() < 0.2, "{scheme:?}: {errors:?}");
    }
}

#[test]
fn explicit_euler_of_a_floating_tree_has_order_1() {
    expect_order(Scheme::ExplicitEuler, 1.0, [200, 400, 800]);
}

#[test]
fn runge_kutta_of_a_floating_tree_has_order_4() {
    expect_order(Scheme::RungeKutta4, 4.0, [40, 80, 160]);
}
