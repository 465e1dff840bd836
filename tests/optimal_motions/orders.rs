//! The schemes of shooting have their orders, on the groups of the joints too.

use crate::systems::{chain, floating, scattered, weights};
use somersault_core::spline::UniformBasis;
use somersault_multibody::Split;
use somersault_ocp::dynamics::Tree;
use somersault_ocp::motion::{EigenpostureBase, SplineMotion};
use somersault_ocp::shooting::{Drive, Phase, Scheme, Shooting, ShootingOptions, Start};
use somersault_ocp::transcription::Transcription;
use somersault_ocp::verification::{Verification, verify};

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

/// Two phases of a chain whose second joint is pushed, cart and first joint free.
fn pushed(n_steps: usize, n_segments: usize) -> Verification {
    let (model, _) = chain();
    let n = model.n_velocities();
    let base = EigenpostureBase::joints(2);
    let motion = SplineMotion::try_new(UniformBasis::try_new(5, 7).unwrap(), base, &[]).unwrap();
    let phase = |duration| Phase { n_segments, ..Phase::new(motion.clone(), n_steps, duration) };
    let options = ShootingOptions { scheme: Scheme::RungeKutta4, drive: Drive::Torque { dofs: vec![1, 3] } };
    let dynamics = Tree::try_new(model.clone(), Split::new(vec![false; n])).unwrap();
    let start = Start::fixed(&[0.1, 0.4, -0.3, 0.2], &[0.0, 0.5, -0.2, 0.1]);
    let mut shooting = Shooting::try_new(dynamics, start, vec![phase(0.3), phase(0.5)], options).unwrap();
    let z = scattered(shooting.outline().n_variables(), 1.0);
    verify(&mut shooting, &model, &z).unwrap()
}

#[test]
fn a_motion_by_torques_in_two_phases_is_verified() {
    let [coarse, fine] = [20, 40].map(|n| pushed(n, 1));
    assert_eq!(coarse.defects.len(), 40);
    let observed = (coarse.terminal_error / fine.terminal_error).log2();
    assert!((observed - 4.0).abs() < 0.3, "{observed}: {} {}", coarse.terminal_error, fine.terminal_error);
    // local errors are an order higher
    let observed = (coarse.largest_defect() / fine.largest_defect()).log2();
    assert!((observed - 5.0).abs() < 0.5, "{observed}");
    // lifted starts that do not fit are a defect, at the end of the segment before
    let torn = pushed(20, 2);
    assert!(torn.largest_defect() > 1e3 * coarse.largest_defect());
}

#[test]
fn joints_that_jump_between_phases_do_not_count_as_errors() {
    let (model, split) = floating();
    let velocity = scattered(model.n_velocities(), 5.0);
    let options = ShootingOptions { scheme: Scheme::RungeKutta4, drive: Drive::Motion };
    let errors = [40, 80].map(|n| {
        let phases = vec![Phase::new(weights(9), n, 0.4), Phase::new(weights(9), n, 0.4)];
        let dynamics = Tree::try_new(model.clone(), split.clone()).unwrap();
        let start = Start::fixed(&model.neutral(), &velocity);
        let mut shooting = Shooting::try_new(dynamics, start, phases, options.clone()).unwrap();
        let z: Vec<f64> = scattered(shooting.outline().n_variables(), 1.0).iter().map(|x| 0.3 * x).collect();
        verify(&mut shooting, &model, &z).unwrap()
    });
    println!("{} {}", errors[0].terminal_error, errors[1].terminal_error);
    assert!(errors[1].terminal_error < errors[0].terminal_error / 10.0);
}
