//! Placement on the slow manifolds: the regulator in closed form, the arm near and far from its optimum, and failures.

use crate::common::{Random, START, arm_motion, arm_nodes};
use nalgebra::{DVector, dvector};
use somersault_core::argument::ArgumentError;
use somersault_ftla::flow::{FlowTolerances, VariationalFlow};
use somersault_ftla::placement::{Method, Placement, PlacementError, PlacementStatus, Schedule};
use somersault_ftla::spectrum::{SplittingDims, TimeDirection, diagnose, spectra};
use somersault_ftla::system::{ArmMinimumTorque, CubicRegulator};
use std::f64::consts::{PI, SQRT_2};

const ARM_DIMS: SplittingDims = SplittingDims { stable: 2, center: 4, unstable: 2 };
const TOLERANCES: FlowTolerances = FlowTolerances { relative: 1e-10, absolute: 1e-12 };

fn arm_placement(direction: TimeDirection, last: f64) -> Placement {
    let schedule = Schedule::try_steps(0.25, 0.25, last).expect("ascending");
    Placement::try_new(8, direction, ARM_DIMS, &[0, 2], schedule).expect("they add up")
}

/// The optimal end for a direction of time.
fn optimal_end(direction: TimeDirection) -> DVector<f64> {
    match direction {
        TimeDirection::Forward => DVector::from_row_slice(&START),
        TimeDirection::Backward => arm_nodes()[40].1.clone(),
    }
}

#[test]
fn the_regulator_is_placed_on_its_manifolds_in_closed_form() {
    let flow = VariationalFlow::try_new(&CubicRegulator, FlowTolerances::default()).expect("in range");
    let dims = SplittingDims { stable: 1, center: 0, unstable: 1 };
    for (direction, exact) in
        [(TimeDirection::Forward, SQRT_2 - 1.0), (TimeDirection::Backward, -SQRT_2 - 1.0)]
    {
        for method in [Method::FixedPoint, Method::Newton] {
            let schedule = Schedule::try_steps(0.5, 0.5, 9.0).expect("ascending");
            let mut placement = Placement::try_new(2, direction, dims, &[], schedule).expect("fits");
            (placement.tolerance, placement.max_iterations) = (1e-10, 60);
            let placed = placement.with_method(method).place(&flow, &dvector![1.0, exact + 0.2]);
            assert_eq!(placed.status, PlacementStatus::Placed, "{direction:?} {method:?}: {placed:?}");
            assert_eq!(placed.time, 9.0);
            assert!(
                (placed.p[1] - exact).abs() < 1e-7,
                "{direction:?} {method:?}: {:e}",
                placed.p[1] - exact
            );
        }
    }
}

#[test]
fn the_arm_is_placed_on_its_optimum_from_a_tenth_off_in_both_directions() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, TOLERANCES).expect("in range");
    let mut random = Random::new(7);
    for direction in [TimeDirection::Forward, TimeDirection::Backward] {
        let optimum = optimal_end(direction);
        for size in [1e-3, 1e-2, 0.1] {
            let mut p = optimum.clone();
            p[5] += size * random.unit();
            p[7] += size * random.unit();
            let placed = arm_placement(direction, 3.5).place(&flow, &p);
            assert_eq!(placed.status, PlacementStatus::Placed, "{direction:?} {size}");
            assert!(placed.angle <= 1e-8 && placed.time == 3.5);
            // x, λ₁ and λ₃ are held; e^(−2·2.3·3.5) of the centre's motion is left in the others
            let off = placed.p - &optimum;
            assert!((0..8).all(|i| [5, 7].contains(&i) || off[i] == 0.0));
            assert!(off.amax() < 1e-6, "{direction:?} {size}: {:e}", off.amax());
        }
    }
}

#[test]
fn algorithm_one_converges_linearly_and_newton_in_two_thirds_of_the_iterations() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, TOLERANCES).expect("in range");
    for direction in [TimeDirection::Forward, TimeDirection::Backward] {
        let mut placement = arm_placement(direction, 2.0);
        (placement.tolerance, placement.max_iterations) = (1e-9, 100);
        let p = optimal_end(direction);
        let newton = placement.place(&flow, &p);
        let fixed = placement.with_method(Method::FixedPoint).place(&flow, &p);
        assert_eq!((&newton.status, &fixed.status), (&PlacementStatus::Placed, &PlacementStatus::Placed));
        assert!((&newton.p - &fixed.p).amax() < 1e-7, "{:e}", (&newton.p - &fixed.p).amax());
        assert!(3 * newton.iterations < 2 * fixed.iterations, "{} {}", newton.iterations, fixed.iterations);
    }
}

#[test]
fn placed_points_follow_the_optimum_longer_the_larger_the_error_was() {
    // Figure 10.2: without placement the time falls by ln 10/μ with each digit of the error, with it by nothing
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, TOLERANCES).expect("in range");
    let optimum = arm_motion(PI, 0.05).extremal;
    let mut error = DVector::zeros(8);
    (error[5], error[7]) = (1.0, -1.0);
    let placement = arm_placement(TimeDirection::Forward, 3.5);
    let found = placement.following(&flow, &optimum, &error, &[1e-4, 1e-5, 1e-6], 0.2).expect("regular");
    println!("{found:?}");
    for (k, f) in found.iter().enumerate() {
        assert_eq!(f.status, PlacementStatus::Placed, "{f:?}");
        assert!(f.left < 1e-6 && (f.with_placement - found[0].with_placement).abs() < 0.3, "{f:?}");
        assert!(k == 0 || f.without_placement > found[k - 1].without_placement, "{f:?}");
    }
    assert!(found.iter().all(|f| f.with_placement > f.without_placement + 1.0), "{found:?}");
    assert!(placement.following(&flow, &optimum, &error, &[1e-2], 0.0).is_err());
}

#[test]
fn the_schedule_follows_from_the_spectrum() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, TOLERANCES).expect("in range");
    let times: Vec<f64> = (1..=10).map(|k| 0.5 * k as f64).collect();
    let found =
        spectra(&flow, &DVector::from_row_slice(&START), TimeDirection::Forward, &times).expect("regular");
    let schedule = Schedule::of_diagnosis(&diagnose(&found, 10.0).expect("not empty")).expect("fast rates");
    let (first, last) = (schedule.times()[0], schedule.times()[schedule.times().len() - 1]);
    assert!((0.2..0.3).contains(&first) && (3.0..4.0).contains(&last), "{schedule:?}");
    let steps = Schedule::try_steps(0.25, 0.5, 2.0).expect("ascending");
    assert_eq!(steps.times(), [0.25, 0.75, 1.25, 1.75, 2.0]);
    assert_eq!(Schedule::try_steps(1.0, 0.5, 1.0).expect("one").times(), [1.0]);
}

#[test]
fn placements_that_fail_say_why_and_give_the_best_point() {
    let arm = ArmMinimumTorque::default();
    let flow = VariationalFlow::try_new(&arm, TOLERANCES).expect("in range").with_max_steps(2000);
    // boundary states out of reach of the averaging window: far off and long
    let mut far = DVector::from_row_slice(&START);
    far[7] += 30.0;
    let long = Placement::try_new(
        8,
        TimeDirection::Forward,
        ARM_DIMS,
        &[0, 2],
        Schedule::try_times(vec![6.0]).expect("one"),
    );
    let placed = long.expect("they add up").place(&flow, &far);
    assert_ne!(placed.status, PlacementStatus::Placed);
    assert_eq!(placed.p[4], far[4]);
    let mut few = arm_placement(TimeDirection::Forward, 3.5).with_method(Method::FixedPoint);
    few.max_iterations = 2;
    let placed = few.place(&flow, &DVector::from_row_slice(&START));
    assert_eq!(placed.status, PlacementStatus::MaxIterations);
    assert!(placed.spectrum.is_some() && placed.angle.is_finite());
}

#[test]
fn arguments_out_of_range_are_named() {
    let schedule = || Schedule::try_times(vec![1.0]).expect("one");
    let of = |held: &[usize]| Placement::try_new(8, TimeDirection::Forward, ARM_DIMS, held, schedule()).err();
    assert_eq!(of(&[0]), Some(PlacementError::Held { held: 1, fast: 2, expected: 4 }));
    assert!(matches!(
        of(&[0, 4]),
        Some(PlacementError::Argument(ArgumentError::OutOfRange { argument: "held", .. }))
    ));
    assert!(matches!(
        of(&[1, 1]),
        Some(PlacementError::Argument(ArgumentError::OutOfRange { argument: "held", .. }))
    ));
    let dims = SplittingDims { stable: 2, center: 2, unstable: 2 };
    let error = Placement::try_new(8, TimeDirection::Forward, dims, &[0, 2], schedule()).expect_err("six");
    assert_eq!(error.to_string(), "the dimensions 2 + 2 + 2 must add up to 8");
    for times in [vec![], vec![0.0], vec![2.0, 1.0], vec![f64::NAN]] {
        assert!(Schedule::try_times(times).is_err());
    }
    assert!(Schedule::try_steps(0.25, 0.0, 1.0).is_err() && Schedule::try_steps(2.0, 0.5, 1.0).is_err());
    assert!(Schedule::try_steps(0.25, 1e-12, 1.0).is_err());
}
