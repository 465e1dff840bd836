//! Grid search and least-squares match of the thesis' arm from round values, and their polish.

use crate::common::arm_nodes;
use somersault_core::argument::ArgumentError;
use somersault_ftla::budget::Limits;
use somersault_ftla::flow::{FlowTolerances, VariationalFlow};
use somersault_ftla::matching::{GridSearch, LeastSquares, MatchStatus, Matching, MatchingError};
use somersault_ftla::placement::{Placement, Schedule};
use somersault_ftla::shooting::{End, MultipleShooting, ShootingStatus};
use somersault_ftla::spectrum::{SplittingDims, TimeDirection};
use somersault_ftla::system::{ArmMinimumTorque, HamiltonianSystem};
use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

const INITIAL: [f64; 4] = [-FRAC_PI_2, 0.05, 0.0, 0.0];
const LAST: [f64; 4] = [FRAC_PI_2, 0.05, 0.0, 0.0];

/// The thesis' problem from round values of the costates at both ends, averaging times up to 3 s.
fn matching<'a>(
    flow: VariationalFlow<'a, ArmMinimumTorque>,
    guess: [&[f64]; 2],
) -> Matching<'a, ArmMinimumTorque> {
    matching_with(flow, guess, 0.25)
}

/// The same with averaging times `step` apart.
fn matching_with<'a>(
    flow: VariationalFlow<'a, ArmMinimumTorque>,
    guess: [&[f64]; 2],
    step: f64,
) -> Matching<'a, ArmMinimumTorque> {
    let dims = SplittingDims { stable: 2, center: 4, unstable: 2 };
    let placements = [TimeDirection::Forward, TimeDirection::Backward].map(|direction| {
        let schedule = Schedule::try_steps(step, step, 3.0).expect("ascending");
        let mut placement = Placement::try_new(8, direction, dims, &[0, 2], schedule).expect("they add up");
        placement.tolerance = 1e-6;
        placement
    });
    let matching = Matching::try_new(flow, [&INITIAL, &LAST], guess, 10.0, placements).expect("they fit");
    matching.try_with_course(5.0, &[2.0, 4.0, 6.0, 8.0]).expect("inside")
}

const GUESS: [[f64; 4]; 2] = [[-0.2, 0.0, -1.3, -0.1], [-0.2, 0.0, 1.3, 0.1]];

fn loose(arm: &ArmMinimumTorque) -> VariationalFlow<'_, ArmMinimumTorque> {
    VariationalFlow::try_new(arm, FlowTolerances { relative: 1e-8, absolute: 1e-10 })
        .expect("in range")
        .with_max_steps(2000)
}

#[test]
fn least_squares_match_from_round_values_and_polish_to_rounding() {
    let arm = ArmMinimumTorque::default();
    let matching = matching(loose(&arm), [&GUESS[0], &GUESS[1]]);
    let search = LeastSquares { conserved: vec![0], ..LeastSquares::default() };
    let found = search.run(&matching).expect("well posed");
    assert_eq!(found.status, MatchStatus::Matched);
    assert!(found.mismatch < 2e-3 && found.rounds < 15, "{:e} after {} rounds", found.mismatch, found.rounds);
    // λ₁ is one unknown
    assert_eq!(found.ends[0][4], found.ends[1][4]);
    let nodes = arm_nodes();
    let off = (&found.ends[0] - &nodes[0].1).amax().max((&found.ends[1] - &nodes[40].1).amax());
    assert!(off < 2e-3, "{off:e}");

    let times: Vec<f64> = nodes.iter().map(|(t, _)| *t).collect();
    let guess = found.nodes(&matching, &times).expect("regular");
    let ends = [&INITIAL, &LAST].map(|x| End::try_state(x).expect("four states"));
    let extremal = MultipleShooting::default().solve(&arm, &ends, &times, &guess).expect("well posed");
    assert_eq!(extremal.status, ShootingStatus::Converged);
    assert!(extremal.residual <= 1e-10 && extremal.iterations < 8, "{:e}", extremal.residual);
    let [low, high] = extremal.range_of(|p| arm.hamiltonian(p));
    assert!(high - low < 1e-10, "{:e}", high - low);
    let gap = extremal.nodes.iter().zip(&nodes).map(|(p, (_, q))| (p - q).amax()).fold(0.0, f64::max);
    assert!(gap < 1e-8, "{gap:e}");
}

fn grid() -> GridSearch {
    GridSearch { spacing: [vec![0.01, 0.05], vec![0.01, 0.05]], ..GridSearch::default() }
}

#[test]
#[ignore = "long form of `a_grid_search_that_ends_after_a_round_says_so`, 10 s: `make studies` runs it"]
fn the_grid_search_of_appendix_g_comes_below_two_thousandths_from_round_values() {
    let arm = ArmMinimumTorque::default();
    let found = grid().run(&matching(loose(&arm), [&GUESS[0], &GUESS[1]])).expect("well posed");
    assert_eq!(found.status, MatchStatus::Matched);
    assert!(found.mismatch < 2e-3 && found.branches == 18 * found.rounds);
    println!("{:e}, {} rounds, {} evaluations", found.mismatch, found.rounds, found.flow_evaluations);
}

#[test]
fn a_grid_search_that_ends_after_a_round_says_so() {
    let arm = ArmMinimumTorque::default();
    let matching = matching(loose(&arm), [&GUESS[0], &GUESS[1]]);
    let found = GridSearch { max_rounds: 1, ..grid() }.run(&matching).expect("well posed");
    assert_eq!((found.status, found.rounds, found.branches), (MatchStatus::MaxRounds, 1, 18));
    assert!(found.mismatch < 0.03, "{:e}", found.mismatch);
}

#[test]
fn searches_without_a_start_say_so_and_malformed_ones_are_errors() {
    let arm = ArmMinimumTorque::default();
    let far = matching(loose(&arm).with_max_steps(60), [&[-90.0, 0.0, 70.0, 50.0], &GUESS[1]]);
    let found = LeastSquares::default().run(&far).expect("well posed");
    assert_eq!((found.status, found.branches), (MatchStatus::NoStart, 2));
    let near = matching(loose(&arm), [&GUESS[0], &GUESS[1]]);
    let wrong = LeastSquares { conserved: vec![1], ..LeastSquares::default() }.run(&near);
    assert!(matches!(
        wrong,
        Err(MatchingError::Argument(ArgumentError::OutOfRange { argument: "conserved", .. }))
    ));
    let wrong = GridSearch::default().run(&near);
    assert!(matches!(
        wrong,
        Err(MatchingError::Argument(ArgumentError::Length { argument: "spacing", expected: 2, found: 0 }))
    ));
    assert!(near.clone().try_with_course(11.0, &[]).is_err());
    assert!(near.try_with_course(5.0, &[4.0, 2.0]).is_err());
}

#[test]
fn coarse_averaging_times_are_made_finer_where_placing_fails() {
    // from round values neither end can be placed at three seconds at once
    let arm = ArmMinimumTorque::default();
    let matching = matching_with(loose(&arm), [&GUESS[0], &GUESS[1]], 3.0);
    let search = LeastSquares { conserved: vec![0], max_rounds: 1, ..LeastSquares::default() };
    let found = search.run(&matching).expect("well posed");
    assert_eq!((found.status, found.rounds), (MatchStatus::MaxRounds, 1));
    assert!(found.mismatch.is_finite());
}

#[test]
fn searches_end_at_their_limits() {
    let arm = ArmMinimumTorque::default();
    let matching = matching(loose(&arm), [&GUESS[0], &GUESS[1]]);
    for limits in [
        Limits { time: Some(Duration::ZERO), evaluations: None },
        Limits { time: None, evaluations: Some(20_000) },
    ] {
        let search = LeastSquares { conserved: vec![0], limits, ..LeastSquares::default() };
        assert_eq!(search.run(&matching).expect("well posed").status, MatchStatus::LimitReached);
        let spacing = [vec![0.01, 0.05], vec![0.01, 0.05]];
        let search = GridSearch { spacing, limits, ..GridSearch::default() };
        assert_eq!(search.run(&matching).expect("well posed").status, MatchStatus::LimitReached);
    }
}
