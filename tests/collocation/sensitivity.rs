//! Derivatives of solutions against closed forms and differences of solves.

use somersault_core::Scalar;
use somersault_core::cancel::CancellationToken;
use somersault_nlp::{Flow, NoDerivative, Sqp};
use somersault_ocp::collocation::{
    Collocation, CollocationError, CollocationReport, CollocationStatus, Dynamics, End, Interval, Mesh,
    Phase, Place, Point, Problem, Quantity, Terms,
};

/// ẍ = u/p where `stiffness` is zero, else ẍ = −x + p ẋ (1 − x²) + u; ½ ∫ u² + `stiffness` (x² + ẋ²) dt.
#[derive(Clone, Copy)]
struct Moved {
    stiffness: f64,
}

impl Dynamics for Moved {
    fn n_states(&self) -> usize {
        2
    }

    fn n_controls(&self) -> usize {
        1
    }

    fn n_parameters(&self) -> usize {
        1
    }

    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        let (x, u, p) = (at.state, at.control[0], at.parameters[0]);
        let force = p * x[1] * (T::one() - x[0] * x[0]) - x[0] + u;
        rates.copy_from_slice(&[x[1], if self.stiffness == 0.0 { u / p } else { force }]);
    }
}

impl Terms for Moved {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        let (x, u) = (at.state, at.control[0]);
        let squares = (x[0] * x[0] + x[1] * x[1]) * nalgebra::convert(self.stiffness) + u * u;
        squares * nalgebra::convert(0.5)
    }
}

fn start(quantity: Quantity) -> Place {
    Place { phase: 0, end: End::Start, quantity }
}

fn finish(quantity: Quantity) -> Place {
    Place { phase: 0, end: End::Finish, quantity }
}

/// From `from` at rest to 1 at rest, within `duration`, with the parameter and a bound of the control.
fn phase(stiffness: f64, [from, duration, p]: [f64; 3], bound: Interval) -> Phase {
    Phase::new(Moved { stiffness }, Moved { stiffness })
        .initial_state([from, 0.0])
        .final_state([1.0, 0.0])
        .parameter_bounds([Interval::fixed(p)])
        .control_bounds([bound])
        .horizon(0.0, duration)
}

fn posed(stiffness: f64, at: [f64; 3], bound: Interval) -> Problem {
    Problem::try_new(phase(stiffness, at, bound)).unwrap()
}

fn solved(problem: &mut Problem) -> CollocationReport {
    let collocation = Collocation {
        max_meshes: 1,
        solver: Sqp { stationarity_tol: 1e-11, feasibility_tol: 1e-12, ..Collocation::default().solver },
        ..Collocation::default()
    };
    let found = collocation.solve(problem, &[Mesh::try_uniform(12, 4).unwrap()], &mut |_| Flow::Continue);
    let found = found.unwrap();
    assert!(found.program.status.is_converged());
    found
}

#[test]
fn derivatives_of_a_moved_mass_are_its_closed_form() {
    // x = a + (1 − a)(3 s² − 2 s³) and u = p (1 − a)(6 − 12 s)/T² with s = t/T, cost 6 p² (1 − a)²/T³, λ₁ = −12 p² (1 − a)/T³
    let (from, duration, mass) = (0.0, 1.0, 2.0);
    let mut problem = posed(0.0, [from, duration, mass], Interval::FREE);
    let found = solved(&mut problem);
    let mut sensitivity = found.sensitivity(&mut problem).unwrap();
    assert_eq!(sensitivity.n_weakly_active(), 0);
    let given = sensitivity.given();
    assert_eq!(given.len(), 7, "{given:?}");
    let close = |found: f64, exact: f64, what: &str| {
        assert!((found - exact).abs() < 1e-7 * exact.abs().max(1.0), "{what}: {found} and not {exact}");
    };
    type Formula = fn(f64) -> f64;
    let cases: [(Place, f64, Formula, Formula, f64); 3] = [
        (
            start(Quantity::State(0)),
            -48.0,
            |s| 1.0 - 3.0 * s * s + 2.0 * s.powi(3),
            |s| -2.0 * (6.0 - 12.0 * s),
            48.0,
        ),
        (start(Quantity::Parameter(0)), 24.0, |_| 0.0, |s| 6.0 - 12.0 * s, -48.0),
        (finish(Quantity::Time), -72.0, |_| 0.0, |s| -4.0 * (6.0 - 12.0 * s), 144.0),
    ];
    let fractions: Vec<f64> = found.phases[0].times.clone();
    for (place, cost, position, control, costate) in cases {
        assert!(given.contains(&place));
        let by = sensitivity.derivative(&[(place, 1.0)]).unwrap();
        let phase = &by.phases[0];
        close(by.cost, cost, "the cost");
        for (i, &s) in fractions.iter().enumerate() {
            close(phase.states[i][0], position(s), "x");
            close(phase.costates[i][0], costate, "λ");
            if i < phase.controls.len() {
                close(phase.controls[i][0], control(s), "u");
            }
        }
        close(phase.horizon.1, f64::from(u8::from(place == finish(Quantity::Time))), "t_f");
    }
    // to first order in each change; the motion is linear in where it starts
    let by = sensitivity.derivative(&[(start(Quantity::State(0)), 0.25)]).unwrap();
    let predicted = by.phases[0].moved(&found.phases[0].to_guess(), 2.0);
    for (t, x) in predicted.times.iter().zip(&predicted.states) {
        close(x[0], 0.5 + 0.5 * (3.0 * t * t - 2.0 * t.powi(3)), "x from 0.5");
    }
}

#[test]
fn derivatives_of_a_bounded_nonlinear_problem_are_differences() {
    let at = [-0.4, 1.6, 0.8];
    for bound in [Interval::FREE, Interval::new(-2.0, 4.5)] {
        let mut problem = posed(1.0, at, bound);
        let found = solved(&mut problem);
        let mut sensitivity = found.sensitivity(&mut problem).unwrap();
        let places = [start(Quantity::State(0)), finish(Quantity::Time), start(Quantity::Parameter(0))];
        for (k, place) in places.iter().enumerate() {
            let by = sensitivity.derivative(&[(*place, 1.0)]).unwrap();
            let h = 1e-5;
            let [less, more] = [-h, h].map(|change| {
                let mut moved = at;
                moved[k] += change;
                solved(&mut posed(1.0, moved, bound))
            });
            let close = |exact: f64, less: f64, more: f64, what: &str| {
                let difference = (more - less) / (2.0 * h);
                assert!(
                    (exact - difference).abs() < 2e-5 * exact.abs().max(1.0),
                    "{what}, {place:?}: {exact}, {difference}"
                );
            };
            close(by.cost, less.cost, more.cost, "the cost");
            let [less, more] = [&less.phases[0], &more.phases[0]];
            for i in 0..by.phases[0].controls.len() {
                for s in 0..2 {
                    close(by.phases[0].states[i][s], less.states[i][s], more.states[i][s], "x");
                    close(by.phases[0].costates[i][s], less.costates[i][s], more.costates[i][s], "λ");
                }
                close(by.phases[0].controls[i][0], less.controls[i][0], more.controls[i][0], "u");
            }
        }
    }
}

#[test]
fn a_report_of_another_problem_is_refused() {
    let mut problem = posed(0.0, [0.0, 1.0, 2.0], Interval::FREE);
    let found = solved(&mut problem);
    let error = found.sensitivity(&mut posed(0.0, [0.5, 1.0, 2.0], Interval::FREE)).err().unwrap();
    assert!(error.to_string().contains("no solution of the program"), "{error}");
}

#[test]
fn a_like_problem_is_solved_again_in_few_steps() {
    let at = [-0.4, 1.6, 0.8];
    let bound = Interval::new(-2.0, 4.5);
    let collocation = Collocation::default();
    let mesh = [Mesh::try_uniform(12, 4).unwrap()];
    let mut problem = posed(1.0, at, bound);
    let first = collocation.solve(&mut problem, &mesh, &mut |_| Flow::Continue).unwrap();
    assert_eq!(first.status, CollocationStatus::Converged);
    let mut moved = posed(1.0, [-0.399, 1.601, 0.801], bound);
    let cold = collocation.solve(&mut moved, &mesh, &mut |_| Flow::Continue).unwrap();
    let again = collocation
        .solve_again(&mut moved, &first, &mut |_| Flow::Continue, &CancellationToken::new())
        .unwrap();
    assert_eq!(again.status, CollocationStatus::Converged);
    assert!((again.cost - cold.cost).abs() < 1e-8 * cold.cost);
    let steps = |report: &CollocationReport| report.history.iter().map(|mesh| mesh.iterations).sum::<usize>();
    assert!(
        again.history.len() == 1 && steps(&again) <= 2 && steps(&again) < steps(&cold),
        "{} {}",
        steps(&again),
        steps(&cold)
    );
    // of another size
    let narrow = Mesh::try_uniform(3, 2).unwrap();
    let mut of_two =
        Problem::try_of_phases(vec![phase(1.0, at, bound), phase(1.0, at, bound)], Vec::new()).unwrap();
    let other = collocation.solve(&mut of_two, &[narrow.clone(), narrow], &mut |_| Flow::Continue).unwrap();
    let refused =
        collocation.solve_again(&mut moved, &other, &mut |_| Flow::Continue, &CancellationToken::new());
    assert!(refused.err().unwrap().to_string().contains("`meshes` must have 1 entries, found 2"));
}

#[test]
fn the_cost_changes_with_the_start_by_the_costates_and_with_the_end_by_the_hamiltonian() {
    let mut compared = 0;
    for known in crate::known::ALL.iter().filter(|known| !known.name.contains("Goddard")) {
        let mut problem = known.problem();
        let found =
            Collocation::default().solve(&mut problem, &[known.mesh()], &mut |_| Flow::Continue).unwrap();
        let phase = &found.phases[0];
        let mut sensitivity = match found.sensitivity(&mut problem) {
            Ok(sensitivity) => sensitivity,
            // controls at their bounds but for an interval with a switch, or boundary arcs of states
            Err(CollocationError::NoDerivative(NoDerivative::NotIsolated)) => continue,
            Err(error) => panic!("{}: {error}", known.name),
        };
        for place in sensitivity.given() {
            let (exact, size) = match (place.quantity, place.end) {
                (Quantity::State(i), End::Start) => (phase.costates[0][i], phase.costates[0][i].abs()),
                (Quantity::State(i), End::Finish) => {
                    let last = phase.costates.len() - 1;
                    (-phase.costates[last][i], phase.costates[last][i].abs())
                }
                (Quantity::Time, End::Finish) => {
                    let sizes = phase.hamiltonian.iter().map(|h| h.abs());
                    (phase.hamiltonian[0], sizes.fold(found.cost.abs(), f64::max))
                }
                _ => continue,
            };
            let by = sensitivity.derivative(&[(place, 1.0)]);
            let by = by.unwrap_or_else(|error| panic!("{}, {place:?}: {error}", known.name));
            assert!(
                (by.cost - exact).abs() < 2e-3 * size.max(1.0),
                "{}, {place:?}: {} and not {exact}",
                known.name,
                by.cost
            );
            compared += 1;
        }
    }
    assert!(compared > 40, "{compared}");
}
