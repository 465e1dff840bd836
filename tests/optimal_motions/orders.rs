//! The schemes of shooting have their orders, on the groups of the joints too.

use crate::systems::{chain, floating, scattered, weights};
use somersault_core::spline::UniformBasis;
use somersault_multibody::Split;
use somersault_multibody::joint_motion::{Condition, EigenpostureBase, End, SplineMotion};
use somersault_ocp::dynamics::Tree;
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

/// Two phases of a chain in which each start fits the end before it, but for the `tear` of the last one.
fn in_two_phases(drive: Drive, motion: &SplineMotion, n_steps: usize, tear: f64) -> Verification {
    let (model, split) = chain();
    let split = if drive == Drive::Motion { split } else { Split::new(vec![false; 4]) };
    let phases = [0.3, 0.5].map(|duration| Phase::new(motion.clone(), n_steps, duration)).to_vec();
    let options = ShootingOptions { scheme: Scheme::RungeKutta4, drive };
    let start = Start::fixed(&[0.1, 0.4, -0.3, 0.2], &[0.0, 0.5, -0.2, 0.1]);
    let dynamics = Tree::try_new(model.clone(), split).unwrap();
    let mut shooting = Shooting::try_new(dynamics, start, phases, options).unwrap();
    let mut z: Vec<f64> = scattered(shooting.outline().n_variables(), 1.0).iter().map(|x| 0.3 * x).collect();
    let lifted = shooting.layout().lifted[0].clone();
    shooting.rollout(&z).unwrap();
    let gap = shooting.defects().to_vec();
    // the gap is linear in the start after it: all joints are hinges and slides
    z[lifted.start] += 1.0;
    shooting.rollout(&z).unwrap();
    let slope = shooting.defects()[0] - gap[0];
    z[lifted.start] -= 1.0;
    lifted.clone().zip(&gap).for_each(|(k, gap)| z[k] -= gap / slope);
    shooting.rollout(&z).unwrap();
    assert!(shooting.defects().iter().all(|d| d.abs() < 1e-12));
    z[lifted.start] += tear;
    verify(&mut shooting, &model, &z).unwrap()
}

fn expect_order_4(of: impl Fn(usize) -> Verification) {
    let [coarse, fine] = [of(20), of(40)];
    assert_eq!(coarse.defects.len(), 41);
    let order = |errors: [f64; 2]| (errors[0] / errors[1]).log2();
    let at_the_end = order([coarse.terminal_error, fine.terminal_error]);
    let of_a_step = order([coarse.largest_defect(), fine.largest_defect()]);
    println!("{at_the_end} {of_a_step} {} {}", coarse.terminal_error, fine.terminal_error);
    // errors of two phases may cancel for some step, so the end only shows that it is no less
    assert!(at_the_end > 3.5 && (of_a_step - 5.0).abs() < 0.6, "{at_the_end} {of_a_step}");
}

#[test]
fn a_motion_by_torques_in_two_phases_is_verified() {
    let base = EigenpostureBase::joints(2);
    let motion = SplineMotion::try_new(UniformBasis::try_new(5, 7).unwrap(), base, &[]).unwrap();
    let of = |n: usize, tear: f64| in_two_phases(Drive::Torque { dofs: vec![1, 3] }, &motion, n, tear);
    expect_order_4(|n| of(n, 0.0));
    // a start that does not fit shows at the end of one integration and between the phases, not in the steps
    let (whole, torn) = (of(80, 0.0), of(80, 1e-2));
    assert!(torn.terminal_error > 5e-3 && torn.terminal_error > 10.0 * whole.terminal_error, "{torn:?}");
    assert_eq!(torn.defects[..80], whole.defects[..80]);
    assert!(whole.defects[80] < 1e-12 && (torn.defects[80] - 1e-2).abs() < 1e-12, "{torn:?}");
}

#[test]
fn a_motion_of_joints_in_two_phases_is_verified() {
    // at rest in the same posture at both ends, so that the phases fit
    let at = |end, derivative, value| Condition { end, derivative, value };
    let conditions = [End::Start, End::Finish].map(|end| [at(end, 0, 0.2), at(end, 1, 0.0)]).concat();
    let base = EigenpostureBase::joints(2);
    let motion = SplineMotion::try_new(UniformBasis::try_new(5, 9).unwrap(), base, &conditions).unwrap();
    expect_order_4(|n| in_two_phases(Drive::Motion, &motion, n, 0.0));
}
