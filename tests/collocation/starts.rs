//! Searches from many starts.

use crate::known::ALL;
use somersault_nlp::Flow;
use somersault_ocp::collocation::{Collocation, Guess, distinct};

#[test]
fn random_guesses_are_those_of_their_seed_and_keep_bounds() {
    for known in ALL {
        let problem = known.problem();
        let guesses = problem.random_guesses(5, 3);
        assert_eq!(guesses.len(), 5);
        assert_eq!(guesses, problem.random_guesses(5, 3));
        assert_ne!(guesses[1..], problem.random_guesses(5, 4)[1..]);
        for guess in &guesses {
            let Guess { times, states, controls, .. } = &guess[0];
            assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{}", known.name);
            assert!(states.iter().chain(controls).flatten().all(|x| x.is_finite()), "{}", known.name);
        }
    }
    assert!(ALL[0].problem().random_guesses(0, 1).is_empty());
}

#[test]
fn solutions_of_many_starts_are_merged_and_ranked() {
    let known = ALL.iter().find(|known| known.name == "Kelly's cart-pole").unwrap();
    let guesses = known.problem().random_guesses(8, 1);
    let collocation = Collocation { tolerance: 1e-4, ..Collocation::default() };
    let mut found = Vec::new();
    for (start, guess) in guesses.into_iter().enumerate() {
        let mut problem = known.problem_from(guess.into_iter().next());
        let report = collocation.solve(&mut problem, &[known.mesh()], &mut |_| Flow::Continue).unwrap();
        if report.program.status.is_converged() {
            found.push((start, report));
        }
    }
    let converged = found.len();
    let all = distinct(found);
    assert!(converged >= 6 && all.len() < converged, "{converged} solves, {} distinct", all.len());
    // the straight line does not lead to the cheapest of them
    let costs: Vec<f64> = all.iter().map(|(report, _)| report.cost).collect();
    assert!(costs[0] < known.cost - 0.5, "{costs:?}");
    assert!(costs.iter().any(|cost| (cost - known.cost).abs() < 1e-4 * known.cost), "{costs:?}");
    assert!(all[0].0.confirmation.is_confirmed(1e-4));
    assert!(all.windows(2).all(|pair| pair[0].0.cost <= pair[1].0.cost));
    assert_eq!(all.iter().map(|(_, starts)| starts.len()).sum::<usize>(), converged);
}
