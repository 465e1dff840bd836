//! The two-link arm of thesis 8.4, Table 8.1: ten seconds from one stretched posture to the opposite one.

use somersault_core::Scalar;
use somersault_multibody::models::TwoLinkArm;
use somersault_nlp::{Flow, Status};
use somersault_ocp::collocation::{
    Collocation, CollocationReport, CollocationStatus, Guess, Mesh, Phase, Point, Problem, Terms,
    TreeDynamics,
};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// ½ (u₁² + ½ u₂²), (8.7) with γ = (1, 0.5).
struct Effort;

impl Terms for Effort {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let [u1, u2] = [at.control[0], at.control[1]];
        (u1 * u1 + u2 * u2 * nalgebra::convert::<f64, T>(0.5)) * nalgebra::convert::<f64, T>(0.5)
    }
}

/// The arm to θ₂ = 0.05 + `turn`; the guess is straight, or has θ₂ = `fold` in the middle.
fn arm(fold: Option<f64>, turn: f64) -> Problem {
    let dynamics = TreeDynamics::try_fully_actuated(&TwoLinkArm::default().model().unwrap()).unwrap();
    let (first, last) = ([-FRAC_PI_2, 0.05, 0.0, 0.0], [FRAC_PI_2, 0.05 + turn, 0.0, 0.0]);
    let phase = Phase::of_tree(dynamics, Effort).initial_state(first).final_state(last).horizon(0.0, 10.0);
    Problem::try_new(match fold {
        None => phase,
        Some(fold) => {
            let folded = |angle: f64| vec![angle, fold, PI / 10.0, 0.0];
            phase.guess(Guess {
                times: vec![0.0, 1.0, 9.0, 10.0],
                states: vec![first.to_vec(), folded(-0.4 * PI), folded(0.4 * PI), last.to_vec()],
                controls: vec![vec![0.0; 2]; 4],
                parameters: Vec::new(),
            })
        }
    })
    .unwrap()
}

fn solve(mut problem: Problem, tolerance: f64) -> CollocationReport {
    let collocation = Collocation { tolerance, ..Collocation::default() };
    let mesh = Mesh::try_uniform(40, 4).unwrap();
    let report = collocation.solve(&mut problem, &[mesh], &mut |_| Flow::Continue).unwrap();
    assert_eq!(report.status, CollocationStatus::Converged, "{:?}", report.history);
    report
}

/// Table 10.1, column p⁺ at t = 5 s; its own mismatch with p⁻ is up to 5.6e-4, its method no better (10.2).
const TABLE_10_1: [f64; 8] =
    [-0.027597, 3.068603, 0.477425, 0.009792, -0.203408, 0.019078, -0.209560, 0.019651];

#[test]
fn the_arm_from_a_straight_and_from_a_folded_guess_is_the_motion_of_the_thesis() {
    for fold in [None, Some(PI)] {
        let report = solve(arm(fold, 0.0), 1e-7);
        let phase = &report.phases[0];
        let middle = [phase.state(5.0), phase.costate(5.0)].concat();
        for (found, printed) in middle.iter().zip(TABLE_10_1) {
            assert!((found - printed).abs() < 1e-4, "{middle:?} for {TABLE_10_1:?}");
        }
        // an integration between the nodes agrees, and has the same cost
        assert!(report.confirmation.max_defect() < 1e-7);
        assert!((report.confirmation.cost - report.cost).abs() < 1e-7);
        assert!(report.confirmation.end_to_end_error() < 1e-3);
        // θ₁ is cyclic, so its costate is constant
        let cyclic = phase.costates.iter().map(|l| (l[0] - phase.costates[0][0]).abs());
        assert!(cyclic.fold(0.0, f64::max) < 1e-6, "λ₁ changes");
        // nothing names the time, so the Hamiltonian is constant
        assert!(phase.hamiltonian_spread() < 1e-4, "spread {}", phase.hamiltonian_spread());
    }
}

/// Figure 8.6: "converge towards zero as the tolerances get tighter".
#[test]
fn the_spread_of_the_hamiltonian_shrinks_with_the_tolerance() {
    let spreads: Vec<f64> = [1e-4, 1e-6, 1e-8]
        .iter()
        .map(|&tolerance| solve(arm(None, 0.0), tolerance).phases[0].hamiltonian_spread())
        .collect();
    assert!(spreads.windows(2).all(|pair| pair[1] < 0.3 * pair[0]), "{spreads:?}");
    assert!(spreads[2] < 1e-6, "{spreads:?}");
}

/// Folding the other way is another extremal and costs more; reaching the same posture with θ₂ less by a turn costs less.
#[test]
fn the_other_fold_costs_more_and_a_turn_of_the_second_link_less() {
    let thesis = solve(arm(Some(PI), 0.0), 1e-6);
    let other = solve(arm(Some(-PI), 0.0), 1e-6);
    let turned = solve(arm(Some(-PI), -TAU), 1e-6);
    assert!(thesis.phases[0].state(5.0)[1] > 3.0 && other.phases[0].state(5.0)[1] < -3.0);
    assert!(turned.cost < thesis.cost - 5e-3, "{} and {}", turned.cost, thesis.cost);
    assert!(other.cost > thesis.cost + 1e-2, "{} and {}", other.cost, thesis.cost);
}

/// A solver's success is no evidence of a motion: on ten intervals it comes at a fifth of the true cost.
#[test]
fn success_on_a_coarse_mesh_is_named_false_convergence() {
    let collocation = Collocation { max_meshes: 1, ..Collocation::default() };
    let mesh = Mesh::try_uniform(10, 4).unwrap();
    let report = collocation.solve(&mut arm(Some(PI), 0.0), &[mesh], &mut |_| Flow::Continue).unwrap();
    assert_eq!(report.program.status, Status::Converged);
    assert_eq!(report.status, CollocationStatus::FalseConvergence);
    assert!(report.cost < 0.2 && report.confirmation.max_defect() > 1e-2, "{}", report.cost);
}

/// What a mesh cannot resolve to the tolerance, and an integration follows all the same, is no false convergence.
#[test]
fn a_motion_on_too_coarse_a_mesh_is_named_a_mesh_limit() {
    let collocation = Collocation { max_meshes: 1, ..Collocation::default() };
    let mesh = Mesh::try_uniform(40, 4).unwrap();
    let report = collocation.solve(&mut arm(Some(PI), 0.0), &[mesh], &mut |_| Flow::Continue).unwrap();
    assert_eq!(report.status, CollocationStatus::MeshLimit);
    let defect = report.confirmation.max_defect();
    assert!(report.history[0].accuracy.equations > 1e-6 && defect > 1e-6 && defect < 1e-2, "{defect}");
}

/// From a guess that is no motion at all the first program takes few steps, whatever its mesh, and never fails.
#[test]
fn programs_of_any_start_mesh_are_solved_in_some_ten_steps() {
    for (intervals, points) in [(30, 4), (40, 4), (60, 4), (50, 3)] {
        for (guess, most) in [(None, 40), (Some(PI), 30)] {
            let mesh = Mesh::try_uniform(intervals, points).unwrap();
            let report =
                Collocation::default().solve(&mut arm(guess, 0.0), &[mesh], &mut |_| Flow::Continue).unwrap();
            let first = &report.history[0];
            assert_eq!(report.status, CollocationStatus::Converged, "{intervals} × {points}: {first:?}");
            assert!(first.iterations <= most, "{intervals} × {points}: {} steps", first.iterations);
            assert!((report.cost - 0.321777232).abs() < 3e-9, "{intervals} × {points}: {}", report.cost);
        }
    }
}

/// Factors that lose too many digits made programs of finer tolerances take hundreds of steps.
#[test]
fn programs_of_any_tolerance_are_solved_in_some_ten_steps() {
    let mesh = Mesh::try_uniform(40, 4).unwrap();
    for tolerance in [1e-4, 1e-5, 1e-6, 1e-7, 1e-8] {
        let collocation = Collocation { tolerance, ..Collocation::default() };
        let report = collocation
            .solve(&mut arm(None, 0.0), std::slice::from_ref(&mesh), &mut |_| Flow::Continue)
            .unwrap();
        assert_eq!(report.status, CollocationStatus::Converged, "{tolerance:e}");
        let most = report.history.iter().map(|record| record.iterations).max();
        assert!(most <= Some(40), "{tolerance:e}: {most:?}");
    }
}
